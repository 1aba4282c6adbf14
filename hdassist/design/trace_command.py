"""`hdassist trace`: the error against the cam angle."""

from __future__ import annotations

import time
from typing import Annotated

import typer

from hdassist.terminal import options as o


def command(
    preset: o.Preset,
    torque: Annotated[
        float | None, typer.Option("--torque", help="Torque M_g in N*m.", show_default="first of the preset")
    ] = None,
    start: Annotated[
        float, typer.Option("--phi-g0", metavar="DEG", help="Angle of the moving wheel at phi_h = 0.")
    ] = 0.0,
    revolutions: Annotated[int, typer.Option("--revolutions", "-n", min=1, help="Cam revolutions.")] = 1,
    overrides: o.Overrides = [],  # noqa: B006 (typer copies it)
    pitch_b: o.PitchB = None,
    pitch_g: o.PitchG = None,
    mark_b: o.MarkB = None,
    mark_g: o.MarkG = None,
    pitch_form: o.PitchForm = None,
    pitch_sense: o.PitchSense = None,
    pitch_flank: o.PitchFlank = None,
    json: o.Json = False,
    csv: o.Csv = None,
    output: o.Target = "-",
    force: o.Force = False,
    solver: o.Solver = None,
    cross_check: o.CrossCheck = "clarabel",
    seed: o.Seed = 0,
    plot: o.Plot = True,
    ascii: o.Ascii = False,
    no_color: o.NoColor = False,
    quiet: o.Quiet = False,
    verbose: o.Verbose = False,
    debug: o.Debug = False,  # noqa: ARG001 (main reads it)
) -> None:
    """Kinematic error F_kpp against the cam angle, with its orders and their causes.

    \b
    Examples:
      hdassist trace vzp160 --torque 80 --phi-g0 20
      hdassist trace vzp160 --torque 80 -n 100 --csv trace.csv
      hdassist trace my-drive.yaml --set phases.xi_b=260 --json

    One cam revolution has as many states as the fixed wheel has teeth. Orders that differ by the
    flexspline's slow turn come apart over the full cycle only (for 200/202 teeth: -n 100).
    """
    from hdassist.design import trace_page as report
    from hdassist.error.trace import trace
    from hdassist.model.kinematics import Kinematics
    from hdassist.preset.library import load_preset
    from hdassist.terminal.answers import to_json
    from hdassist.terminal.output import Output, note, warn
    from hdassist.terminal.wheels import PitchFiles

    out = Output.open(output, csv, force=force, ascii=ascii, no_color=no_color)
    pitch = PitchFiles.asked(
        [preset], b=(pitch_b, mark_b), g=(pitch_g, mark_g), form=pitch_form, sense=pitch_sense, flank=pitch_flank
    )
    drive = load_preset(preset, [*overrides, *o.torque_overrides([] if torque is None else [torque])])
    measured = pitch.read(drive)
    M_g = drive.operation.M_g[0]
    begun = time.monotonic()
    with out.progress(drive.name, revolutions * Kinematics.of(drive).teeth_fixed) as progress:
        result = trace(
            drive, M_g, measured=measured, start_deg=start, revolutions=revolutions, solver=solver,
            cross_check=cross_check, seed=seed, progress=progress,
        )  # fmt: skip
    for text in drive.origin.warnings:
        warn(text)
    if verbose:
        note(f"{drive.name}: {time.monotonic() - begun:.1f} s, {result.error.certificate}")
    if json:
        out.text(to_json(report.answer(drive, result, seed)))
    else:
        out.human(report.brief(result) if quiet else report.render(drive, result, out.style, plots=plot))
    out.figures(report.csv(result))
