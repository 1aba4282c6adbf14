"""`hdassist stiffness`: twist against torque, lost motion, K1, K2, K3."""

from __future__ import annotations

from typing import Annotated

import typer

from hdassist.terminal import options as o


def command(
    preset: o.Preset,
    t1: Annotated[float | None, typer.Option("--t1", metavar="N*M", help="End of the first segment.")] = None,
    t2: Annotated[float | None, typer.Option("--t2", metavar="N*M", help="End of the second segment.")] = None,
    to: Annotated[float | None, typer.Option("--to", metavar="N*M", help="End of the curve, on both sides.")] = None,
    overrides: o.Overrides = [],  # noqa: B006 (typer copies it)
    json: o.Json = False,
    csv: o.Csv = None,
    output: o.Target = "-",
    force: o.Force = False,
    cross_check: o.CrossCheck = "clarabel",
    plot: o.Plot = True,
    ascii: o.Ascii = False,
    no_color: o.NoColor = False,
    quiet: o.Quiet = False,
    debug: o.Debug = False,  # noqa: ARG001 (main reads it)
) -> None:
    """Torsional stiffness: twist against torque in both directions, lost motion, K1, K2, K3.

    \b
    Examples:
      hdassist stiffness vzp160
      hdassist stiffness my-drive.yaml --t1 29 --t2 108 --to 250
      hdassist stiffness my-drive.yaml --csv curve.csv -q

    Mesh, rings and balls of the contact model in series with the shell as a tube, without deviations and without
    friction. The segments end where catalogues end them, by the cube of the pitch diameter, unless --t1 and --t2
    say otherwise.
    """
    from hdassist.design import stiffness_page as report
    from hdassist.error.stiffness import estimate_states, stiffness
    from hdassist.preset.library import load_preset
    from hdassist.terminal.answers import to_json
    from hdassist.terminal.output import Output, warn

    out = Output.open(output, csv, force=force, ascii=ascii, no_color=no_color)
    drive = load_preset(preset, overrides)
    with out.progress(drive.name, estimate_states()) as progress:
        result = stiffness(drive, T_1=t1, T_2=t2, T_max=to, cross_check=cross_check, progress=progress)
    for text in report.warnings(drive, result):
        warn(text)
    if json:
        out.text(to_json(report.answer(drive, result)))
    else:
        out.human(report.brief(result) if quiet else report.render(drive, result, out.look, plots=plot))
    out.figures(report.csv(result))
