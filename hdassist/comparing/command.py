"""`hdassist compare`: a measured trace over the predicted one, or presets beside each other."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from hdassist.comparing.presets_command import compare_presets, is_preset, require_presets
from hdassist.run.run import Run
from hdassist.terminal import options as o

Others = Annotated[
    list[str], typer.Argument(metavar="FILE", help="Measured traces (- for stdin), or presets: names, .yaml files.")
]


@o.with_groups
def command(
    preset: o.Preset,
    files: Others,
    *,
    torque: Annotated[
        float | None,
        typer.Option("--torque", help="Torque M_g in N*m.", show_default="the preset's only one; all of presets"),
    ] = None,
    start: Annotated[
        str, typer.Option("--phi-g0", metavar="DEG", help="Angle of the output at phi_h = 0, or fit.")
    ] = "fit",
    zero: Annotated[
        str | None,
        typer.Option(
            "--cam-zero",
            metavar="DEG",
            help="phi_h where the rig's cam angle is 0, or fit.",
            show_default="0; by --phi-g0 or fit for angles of the output",
        ),
    ] = None,
    error_is: Annotated[
        Literal["cam-output", "output-cam"],
        typer.Option(
            help="What a column of errors is: cam/ratio - output (F_kpp, as trace writes it) or the opposite."
        ),
    ] = "cam-output",
    cam_sense: Annotated[
        Literal["ccw", "cw"], typer.Option(help="How the file's angle counts, seen from the cam side.")
    ] = "ccw",
    traces: o.TraceOptions,
    seed: o.Bootstrap = 0,
    draws: o.Draws = 64,
    jobs: o.Jobs = 0,
    drives: o.DriveOptions,
    plot: o.Plot = True,
    details: o.Details = False,
    options: o.FigureOptions,
) -> None:
    """A measured trace over the predicted one, and which deviation explains the difference; or presets side by side.

    \b
    Examples:
      hdassist compare own.yaml run.csv --torque 80
      hdassist compare own.yaml run.csv --error-is output-cam --drift linear
      hdassist compare own.yaml run.csv --angle enc1 --second enc2
      hdassist compare own.yaml run.csv --set phases.xi_b=230 --json
      hdassist compare vzp160 own.yaml

    Each deviation, of the cam (wave generator), the rigid wheel (circular spline) or the flexspline, is fitted alone,
    then all together, through the contact model; what the record does not tell is said.

    A FILE that is a name of the library, or ends in .yaml or .yml, is a preset; anything else is a trace (./NAME for
    one that is called like a preset). Presets are compared with the first: fields that differ, F'_ior, best hole,
    stiffness; of two, which field does most, changed alone. --torque, --set, --draws, --seed, --jobs are theirs too.
    Exit codes: 0, 4 bad file, 5 orders or a range that the record does not tell, or no trustworthy answer.
    """
    from dataclasses import replace
    from functools import partial

    from hdassist.comparing.compare import FIT_STATES, RecordConvention, compare, torque_of, zero_of
    from hdassist.comparing.page import comparison_answer
    from hdassist.measuring.orders import parse_orders
    from hdassist.measuring.uncertainty import parse_stated
    from hdassist.model.kinematics import Kinematics
    from hdassist.model.unknown import told
    from hdassist.readers.trace import read_trace
    from hdassist.solve.window import in_wide_enough_window
    from hdassist.terminal.answers import failure
    from hdassist.terminal.output import warn
    from hdassist.terminal.runs import Answer, give, run_each

    o.stdin_once(*files, preset)
    if any(map(is_preset, files)):
        plain = (start, zero, error_is, cam_sense, traces) == ("fit", None, "cam-output", "ccw", o.TraceOptions())
        require_presets(files, plain=plain)
        raise typer.Exit(
            compare_presets([preset, *files], torque, drives, (draws, seed, jobs), options, details=details)
        )
    out = options.open()
    stated, orders = parse_stated(traces.budget), parse_orders(traces.orders or None)
    asked = RecordConvention(
        o.degrees_or_fit("--phi-g0", start), o.degrees_or_fit("--cam-zero", zero or "0"), error_is, cam_sense
    )  # fmt: skip
    drive = drives.load(preset, *o.torque_overrides(torque))
    M_g = torque_of(drive)
    form, said = traces.form(), dict.fromkeys((*drive.origin.warnings, *told(drive)))

    def one(name: str) -> Answer:
        trace = read_trace(name, form, abs(Kinematics.of(drive).u))
        convention = asked if zero else replace(asked, zero_deg=zero_of(trace, drive, asked.start_deg))
        with out.progress(f"{drive.name}, {trace.file}", FIT_STATES) as progress:
            analysis = partial(
                compare,
                trace,
                M_g=M_g,
                convention=convention,
                orders=orders,
                drift=traces.drift,
                stated=stated,
                run=Run(progress=progress, seed=seed),
            )
            result = in_wide_enough_window(drive, analysis)
        said.update(dict.fromkeys(result.drive.origin.warnings))
        return comparison_answer(result, plots=plot, details=details)

    answers = run_each("compare", files, one, options, failed=lambda name, fault: failure("compare", fault, file=name))
    for text in said:
        warn(text)
    raise typer.Exit(give("compare", answers, options, out))
