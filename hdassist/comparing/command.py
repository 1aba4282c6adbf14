"""`hdassist compare`: a measured trace over the predicted one."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from hdassist.terminal import options as o


def command(
    preset: o.Preset,
    files: o.Traces,
    torque: Annotated[
        float | None, typer.Option("--torque", help="Torque M_g in N*m.", show_default="the preset's only one")
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
    angle: o.Angle = None,
    angle_of: o.AngleOf = None,
    angle_unit: o.AngleUnit = None,
    error: o.ErrorColumn = None,
    error_unit: o.ErrorUnit = None,
    second: o.Second = None,
    wrap: o.Wrap = None,
    orders: o.Orders = None,
    drift: o.Drift = "none",
    budget: o.Budget = [],  # noqa: B006 (typer copies it)
    seed: o.Bootstrap = 0,
    overrides: o.Overrides = [],  # noqa: B006 (typer copies it)
    json: o.Json = False,
    csv: o.Csv = None,
    output: o.Target = "-",
    force: o.Force = False,
    plot: o.Plot = True,
    ascii: o.Ascii = False,
    no_color: o.NoColor = False,
    quiet: o.Quiet = False,
    debug: o.Debug = False,
) -> None:
    """A measured trace over the predicted one, and which deviation would explain the difference.

    \b
    Examples:
      hdassist compare my-drive.yaml run.csv --torque 80
      hdassist compare my-drive.yaml run.csv --torque 80 --error-is output-cam --drift linear
      hdassist compare my-drive.yaml run.csv --torque 80 --angle enc1 --second enc2 --cam-zero fit
      hdassist compare my-drive.yaml run.csv --torque 80 --set phases.xi_b=230 --json

    Each deviation is fitted alone, then all together, through the contact model; what the record does not tell is said.
    Exit codes: 0, 4 bad file, 5 orders or a range that the record does not tell.
    """
    from dataclasses import replace

    from hdassist.comparing import figures
    from hdassist.comparing import page as report
    from hdassist.comparing.compare import WORK, Reading, compare, torque_of, zero_of
    from hdassist.comparing.comparison import Comparison
    from hdassist.errors import HdassistError, UsageError
    from hdassist.measuring.cycle import gearing_of
    from hdassist.measuring.figures import failure
    from hdassist.measuring.order_grid import DEFAULT, parse_orders
    from hdassist.measuring.uncertainty import parse_stated
    from hdassist.preset.library import load_preset
    from hdassist.readers.trace import read_trace
    from hdassist.readers.tracecolumns import TraceForm
    from hdassist.terminal.answers import combine, json_text
    from hdassist.terminal.output import Output, complain, warn
    from hdassist.verdict import worst_exit_code

    if [*files, preset].count("-") > 1:
        raise UsageError("standard input can be read once only")
    out = Output.open(output, csv, force=force, ascii=ascii, no_color=no_color)
    stated = parse_stated(budget)
    parse_orders(orders or DEFAULT)
    asked = Reading(
        o.degrees_or_fit("--phi-g0", start), o.degrees_or_fit("--cam-zero", zero or "0"), error_is, cam_sense
    )  # fmt: skip
    drive = load_preset(preset, [*overrides, *o.torque_overrides([] if torque is None else [torque])])
    M_g = torque_of(drive)
    gearing = gearing_of(drive, None)
    form = TraceForm(angle, o.shaft(angle_of), angle_unit, error, error_unit, second, wrap)
    done: list[Comparison] = []
    answers, pages = [], []
    for name in files:
        try:
            trace = read_trace(name, form, gearing.ratio if gearing else None)
            reading = asked if zero else replace(asked, zero_deg=zero_of(trace, drive, asked.start_deg))
            with out.progress(f"{drive.name}, {trace.file}", WORK) as progress:
                result = compare(
                    trace, drive, M_g, reading=reading, orders=orders, drift=drift, stated=stated, seed=seed,
                    progress=progress,
                )  # fmt: skip
        except HdassistError as fault:
            if debug or isinstance(fault, UsageError) or (len(files) == 1 and not json):
                raise
            complain(fault, "" if name in fault.message else name)
            answers.append(failure("compare", name, fault))
            continue
        done.append(result)
        answers.append(figures.answer(result, reading))
        pages.append(report.brief(result, reading) if quiet else report.render(result, reading, out.style, plots=plot))
        for text in result.warnings:
            warn(f"{name}: {text}")
    for text in drive.origin.warnings:
        warn(text)
    if json:
        out.text(json_text(combine("compare", answers)))
    elif pages:
        from rich.console import Group

        out.human(Group(*pages))
    if done:
        out.figures(figures.csv(done))
    raise typer.Exit(worst_exit_code(answer["exit_code"] for answer in answers))
