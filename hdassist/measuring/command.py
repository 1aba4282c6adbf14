"""`hdassist measure`: what a measured trace says."""

from __future__ import annotations

from typing import Annotated

import typer

from hdassist.terminal import options as o


def command(
    files: o.Traces,
    preset: Annotated[
        str | None, typer.Option("--drive", metavar="PRESET", help="The drive: ratio, cycle, causes of orders.")
    ] = None,
    ratio: Annotated[float | None, typer.Option(help="Cam turns per output turn, where no drive is given.")] = None,
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
    """F'_ior, orders and coverage of measured traces, with their uncertainty.

    \b
    Examples:
      hdassist measure run.csv --drive my-drive.yaml
      hdassist measure run.csv.gz --ratio 100 --error err_mdeg --drift linear
      hdassist measure run.csv --ratio 99.5 --angle enc1 --second enc2 --budget encoder=0.5
      zcat run.csv.gz | hdassist measure - --ratio 100 --orders 1-6 --json

    A file has a column of angles and one of errors, or of a second encoder. F'_ior is the range of the error limited to
    the orders, without what noise adds; it is a lower bound unless the full cycle was visited. Each direction stands by
    itself. Exit codes: 0, 4 bad file, 5 orders or F'_ior that the record does not tell.
    """
    from hdassist.errors import HdassistError, UsageError
    from hdassist.measuring import figures
    from hdassist.measuring import page as report
    from hdassist.measuring.cycle import gearing_of
    from hdassist.measuring.measure import measure
    from hdassist.measuring.measurement import Measurement
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
    drive = load_preset(preset) if preset is not None else None
    gearing = gearing_of(drive, ratio)
    form = TraceForm(angle, o.shaft(angle_of), angle_unit, error, error_unit, second, wrap)
    done: list[Measurement] = []
    answers, pages = [], []
    for name in files:
        try:
            trace = read_trace(name, form, gearing.ratio if gearing else None)
            result = measure(trace, drive=drive, ratio=ratio, orders=orders, drift=drift, stated=stated, seed=seed)
        except HdassistError as fault:
            if debug or isinstance(fault, UsageError) or (len(files) == 1 and not json):
                raise
            complain(fault, "" if name in fault.message else name)
            answers.append(figures.failure("measure", name, fault))
            continue
        done.append(result)
        answers.append(figures.answer(result, drive))
        pages.append(report.brief(result) if quiet else report.render(result, drive, out.style, plots=plot))
        for text in result.warnings:
            warn(f"{name}: {text}")
    repeats = figures.repeats(done)
    if json:
        together = combine("measure", answers)
        out.text(json_text({**together, "repeat_runs": repeats} if repeats else together))
    elif pages:
        from rich.console import Group

        if repeats and not quiet:
            mean, spread = repeats["mean_arcsec"], repeats["standard_deviation_arcsec"]
            pages.append(
                f"{repeats['files']} files: F'_ior {mean:.2f} arcsec on the mean, standard deviation {spread:.2f}"
            )
        out.human(Group(*pages))
    if done:
        out.figures(figures.csv(done))
    raise typer.Exit(worst_exit_code(answer["exit_code"] for answer in answers))
