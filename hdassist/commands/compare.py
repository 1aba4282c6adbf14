"""`hdassist compare`: a measured trace over the predicted one, or presets beside each other."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from hdassist.errors import UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.terminal.runs import Answer

PRESET_SUFFIXES = (".yaml", ".yml")

Others = Annotated[
    list[str], typer.Argument(metavar="FILE", help="Measured traces (- for stdin), or presets: names, .yaml files.")
]


@o.with_groups
def compare_command(
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
    draws: o.DrawsOption = 64,
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
    stiffness; which field does most, each changed alone. --torque, --set, --draws, --seed, --jobs are theirs too.
    Exit codes: 0, 4 bad file, 5 orders or a range that the record does not tell, or no trustworthy answer.
    """
    if any(map(is_preset, files)):
        plain = (start, zero, error_is, cam_sense, traces) == ("fit", None, "cam-output", "ccw", o.TraceOptions())
        _require_presets(files, plain=plain)
        code = _compare_presets([preset, *files], torque, drives, (draws, seed, jobs), options, details=details)
        raise typer.Exit(code)

    from dataclasses import replace
    from functools import partial

    from hdassist.comparing.compare import FIT_STATES, RecordConvention, compare, torque_of, zero_of
    from hdassist.measuring.orders import parse_orders
    from hdassist.measuring.uncertainty import parse_stated
    from hdassist.model.kinematics import Kinematics
    from hdassist.model.unknown import unknown_notes
    from hdassist.pages.compare import comparison_report
    from hdassist.readers.trace import read_trace
    from hdassist.run.run import Run
    from hdassist.solve.window import in_wide_enough_window
    from hdassist.terminal.answers import failure
    from hdassist.terminal.output import warn
    from hdassist.terminal.runs import answer_of, give, run_each

    o.stdin_once(*files, preset)
    out = options.open()
    angles = o.degrees_or_fit("--phi-g0", start), o.degrees_or_fit("--cam-zero", zero or "0")
    asked = RecordConvention(*angles, error_is, cam_sense)
    orders, stated = parse_orders(traces.orders or None), parse_stated(traces.budget)
    how = partial(compare, orders=orders, drift=traces.drift, stated=stated)
    drive = drives.load(preset, *o.torque_overrides(torque))
    M_g, form = torque_of(drive), traces.form()
    warnings = dict.fromkeys((*drive.origin.warnings, *unknown_notes(drive)))

    def one(name: str) -> Answer:
        trace = read_trace(name, form, abs(Kinematics.of(drive).u))
        convention = asked if zero else replace(asked, zero_deg=zero_of(trace, drive, asked.start_deg))
        with out.progress(f"{drive.name}, {trace.file}", FIT_STATES) as progress:
            analysis = partial(how, trace, M_g=M_g, convention=convention, run=Run(progress=progress, seed=seed))
            result = in_wide_enough_window(drive, analysis)
        warnings.update(dict.fromkeys(result.drive.origin.warnings))
        return answer_of(comparison_report(result), plots=plot, details=details)

    answers = run_each("compare", files, one, options, failed=lambda name, fault: failure("compare", fault, file=name))
    for text in warnings:
        warn(text)
    raise typer.Exit(give("compare", answers, options, out))


def is_preset(name: str) -> bool:
    """Whether an argument beside a preset is one too, and no trace: a name of the library, or a YAML file."""
    from hdassist.preset.library import preset_names

    return Path(name).suffix.lower() in PRESET_SUFFIXES or name in preset_names()


def _require_presets(names: list[str], *, plain: bool) -> None:
    """Raise UsageError where traces stand among presets, or options are asked for that belong to traces."""
    if traces := [name for name in names if not is_preset(name)]:
        words = f"{traces[0]} is taken for a trace, and {next(filter(is_preset, names))} for a preset"
        raise UsageError(words, "a preset is a name of the library or a .yaml file; compare presets, or traces")
    if not plain:
        raise UsageError("how a trace is read says nothing of presets", "leave out its options, or name a trace")


def _compare_presets(
    names: list[str],
    torque: float | None,
    drives: o.DriveOptions,
    work: tuple[int, int, int],
    options: o.FigureOptions,
    *,
    details: bool,
) -> int:
    """Compare presets and give the answer; returns the exit code.

    Arguments: names; torque [N*m], None for those that all have; drives; work: draws, seed and jobs; options; details,
    whether all tables are shown. Raises UsageError for a torque that is none.
    """
    from hdassist.comparing.drives import common_torques, compare_drives, estimate_comparison
    from hdassist.pages.compare_presets import comparison_warnings, drives_report
    from hdassist.run.processes import workers
    from hdassist.run.run import Run
    from hdassist.terminal.answers import failure
    from hdassist.terminal.output import warn
    from hdassist.terminal.runs import answer_of, give, run_each

    o.stdin_once(*names)
    out, (draws, seed, jobs) = options.open(), work

    def one(_: str) -> Answer:
        loaded = [drives.load(name) for name in names]
        if torque is not None and not (torque and loaded[0].allows("operation.M_g", torque)):
            raise UsageError(f"invalid --torque {torque:g}: expected a torque in N*m up to 1e7, and not 0")
        torques = common_torques(loaded) if torque is None else (torque,)
        total = estimate_comparison(loaded, torques, draws)
        with out.progress(", ".join(drive.name for drive in loaded), total) as progress, workers(jobs) as executor:
            result = compare_drives(loaded, torques, draws=draws, run=Run(executor, progress, seed))
        for text in comparison_warnings(result):
            warn(text)
        return answer_of(drives_report(result, seed), details=details)

    schema = "compare-presets"
    answers = run_each(schema, [""], one, options, failed=lambda _, e: failure(schema, e, preset=names[0]))
    return give(schema, answers, options, out)
