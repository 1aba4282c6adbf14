"""`hdassist measure`: F'_ior of measured traces."""

from __future__ import annotations

from typing import Annotated

import typer

from hdassist.terminal import options as o


@o.with_groups
def measure_command(
    files: o.Traces,
    *,
    preset: Annotated[
        str | None, typer.Option("--drive", metavar="PRESET", help="The drive: ratio, cycle, causes of orders.")
    ] = None,
    ratio: Annotated[
        float | None,
        typer.Option(help="Turns of the cam (wave generator) per output turn, where no drive is given."),
    ] = None,
    traces: o.TraceOptions,
    seed: o.Bootstrap = 0,
    plot: o.Plot = True,
    details: o.Details = False,
    options: o.FigureOptions,
) -> None:
    """F'_ior, orders and coverage of measured traces, with their uncertainty.

    \b
    Examples:
      hdassist measure run.csv --drive my-drive.yaml
      hdassist measure run.csv --ratio 100 --error err_mdeg --drift linear
      hdassist measure run.csv --ratio 99.5 --angle enc1 --second enc2
      zcat run.csv.gz | hdassist measure - --ratio 100 --orders 1-6 --json

    A file has a column of angles and one of errors, or of a second encoder. F'_ior is the range of the error limited to
    the orders, without what noise adds; it is a lower bound unless the full cycle was visited. Each direction stands by
    itself. Exit codes: 0, 4 bad file, 5 orders or F'_ior that the record does not tell.
    """
    from hdassist.loading.load import load_preset
    from hdassist.measuring.cycle import gearing_of
    from hdassist.measuring.measure import Measurement, measure
    from hdassist.measuring.orders import parse_orders
    from hdassist.measuring.uncertainty import parse_stated
    from hdassist.pages.measure import measure_report, repeats, repeats_line
    from hdassist.readers.trace import read_trace
    from hdassist.terminal.answers import failure
    from hdassist.terminal.runs import Answer, answer_of, give, run_each

    o.stdin_once(*files, preset)
    out = options.open()
    stated, orders = parse_stated(traces.budget), parse_orders(traces.orders or None)
    drive = load_preset(preset) if preset is not None else None
    gearing = gearing_of(drive, ratio)
    form = traces.form()
    done: list[Measurement] = []

    def one(name: str) -> Answer:
        trace = read_trace(name, form, gearing.ratio if gearing else None)
        result = measure(trace, drive=drive, ratio=ratio, orders=orders, drift=traces.drift, stated=stated, seed=seed)
        done.append(result)
        return answer_of(measure_report(result, drive), plots=plot, details=details)

    answers = run_each("measure", files, one, options, failed=lambda name, fault: failure("measure", fault, file=name))
    several = repeats(done)
    more, below = ({"repeat_runs": several}, [repeats_line(several)]) if several else ({}, [])
    raise typer.Exit(give("measure", answers, options, out, more=more, below=below))
