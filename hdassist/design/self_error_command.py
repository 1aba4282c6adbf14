"""`hdassist self-error`: the error of a drive without deviations."""

from __future__ import annotations

from hdassist.terminal import options as o


def command(
    preset: o.Preset,
    torque: o.Torques = [],  # noqa: B006 (typer copies it)
    overrides: o.Overrides = [],  # noqa: B006 (typer copies it)
    json: o.Json = False,
    csv: o.Csv = None,
    output: o.Target = "-",
    force: o.Force = False,
    ascii: o.Ascii = False,
    no_color: o.NoColor = False,
    quiet: o.Quiet = False,
    debug: o.Debug = False,  # noqa: ARG001 (main reads it)
) -> None:
    """Self error: what a drive without deviations does over tooth phase and ball phase.

    \b
    Examples:
      hdassist self-error vzp160
      hdassist self-error my-drive.yaml --torque 50 --json

    F'_ior looks at positions in which teeth and balls stand alike; this is what lies between them.
    """
    from hdassist.design import self_error_page as report
    from hdassist.error.self_error import self_error
    from hdassist.preset.library import load_preset
    from hdassist.terminal.answers import to_json
    from hdassist.terminal.output import Output, warn

    out = Output.open(output, csv, force=force, ascii=ascii, no_color=no_color)
    drive = load_preset(preset, [*overrides, *o.torque_overrides(torque)])
    torques = drive.operation.M_g
    with out.progress(drive.name, len(torques) * drive.numerics.n_phase**2) as progress:
        results = self_error(drive, torques, progress=progress)
    for text in drive.origin.warnings:
        warn(text)
    if json:
        out.text(to_json(report.answer(drive, results)))
    else:
        out.human(report.brief(results) if quiet else report.render(drive, results, out.style))
    out.figures(report.csv(results))
