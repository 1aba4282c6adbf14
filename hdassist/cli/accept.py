"""`hdassist accept`: drives held against their limits."""

from __future__ import annotations

import time
from typing import Annotated, Literal

import typer

from hdassist.cli import options as o


def command(
    presets: o.Presets,
    measured: Annotated[
        list[str],
        typer.Option("--measured", metavar="[TORQUE:]FILE", help="Measured trace, at a torque in N*m. Repeatable."),
    ] = [],  # noqa: B006 (typer copies it)
    value: Annotated[
        list[str],
        typer.Option("--value", metavar="NAME=VALUE±U", help="Value measured otherwise, U with k = 2. Repeatable."),
    ] = [],  # noqa: B006 (typer copies it)
    limit: Annotated[
        list[str],
        typer.Option("--limit", metavar="NAME[@TORQUE]=VALUE", help="Limit instead of the preset's. Repeatable."),
    ] = [],  # noqa: B006 (typer copies it)
    overrides: o.Overrides = [],  # noqa: B006 (typer copies it)
    serial: Annotated[str, typer.Option(metavar="TEXT", help="Serial number in the report.")] = "",
    rule: Annotated[Literal["guard", "simple"] | None, typer.Option(help="Decision rule for measured values.")] = None,
    margin: Annotated[
        float | None, typer.Option(metavar="PERCENT", help="Margin of predicted values, to either side.")
    ] = None,
    measured_only: Annotated[bool, typer.Option("--measured-only", help="Predict nothing.")] = False,
    fail_on: Annotated[
        Literal["warn", "fail", "never"], typer.Option(help="What makes the exit code other than 0.")
    ] = "fail",
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
    cross_check: o.CrossCheck = "clarabel",
    seed: o.Seed = 0,
    jobs: o.Jobs = 0,
    json: o.Json = False,
    csv: o.Csv = None,
    output: o.Target = "-",
    force: o.Force = False,
    ascii: o.Ascii = False,
    no_color: o.NoColor = False,
    quiet: o.Quiet = False,
    verbose: o.Verbose = False,
    debug: o.Debug = False,
) -> None:
    """PASS, FAIL or INCONCLUSIVE: drives held against the limits of their presets.

    \b
    Examples:
      hdassist accept my-drive.yaml
      hdassist accept my-drive.yaml --measured 80:run.csv --measured-only --budget encoder=0.3
      hdassist accept vzp160 --limit F_ior@80=30 --limit order_2=5 --limit lost_motion=60
      hdassist accept my-drive.yaml --value lost_motion=41±3 --json

    A limit is decided by what was measured, with its uncertainty and a decision rule, or else by the model's
    prediction with a declared margin. hdassist explain CODE tells what a check means. Exit codes: 0 PASS, 3 FAIL,
    6 INCONCLUSIVE, 4 bad preset, file or no limit, 5 no trustworthy answer.
    """
    from hdassist.analysis.acceptance import Acceptance
    from hdassist.analysis.acceptance_request import Reading, Request, carry_out, read_measurements
    from hdassist.analysis.limits import limits_of
    from hdassist.analysis.predictions import work
    from hdassist.analysis.verdict import worst_exit_code
    from hdassist.cli.output import Output, complain, note, warn
    from hdassist.cli.workers import workers
    from hdassist.errors import HdassistError, UsageError
    from hdassist.report import accept as report
    from hdassist.report import accept_figures as figures
    from hdassist.report.envelope import combine, to_json

    if len(presets) > 1 and (measured or value or serial):
        raise UsageError("what was measured belongs to one drive", "one PRESET, or a list of drives in a CSV file")
    if [*presets, *(text.rpartition(":")[2] for text in measured)].count("-") > 1:
        raise UsageError("standard input can be read once only")
    out = Output.open(output, csv, force=force, ascii=ascii, no_color=no_color)
    rules = [f"acceptance.rule={rule}"] * bool(rule) + ([f"acceptance.margin={margin}"] if margin is not None else [])
    reading = Reading(
        angle, o.shaft(angle_of), angle_unit, error, error_unit, second, wrap, orders, drift, tuple(budget)
    )
    done: list[tuple[str, Acceptance]] = []
    answers, pages = [], []
    for preset in presets:
        request = Request(
            preset, serial, (*overrides, *rules), tuple(limit), tuple(measured), tuple(value), reading, measured_only,
            cross_check, seed,
        )  # fmt: skip
        begun = time.monotonic()
        try:
            drive = request.load()
            traces = read_measurements(request, drive)
            states = 0 if measured_only else work(drive, limits_of(drive))
            with out.progress(drive.name, states) as progress, workers(jobs) as executor:
                result = carry_out(request, drive, traces, executor=executor, progress=progress)
        except HdassistError as fault:
            if debug or isinstance(fault, UsageError) or (len(presets) == 1 and not json):
                raise
            complain(fault, "" if preset in fault.message else preset)
            answers.append(figures.failure(request, fault))
            continue
        done.append((serial, result))
        answers.append(figures.answer(request, result, fail_on))
        pages.append(report.brief(result) if quiet else report.render(result, out.look, serial))
        for text in drive.origin.warnings:
            warn(f"{drive.name}: {text}")
        if verbose:
            note(f"{drive.name}: {time.monotonic() - begun:.1f} s")
    if json:
        out.text(to_json(combine("accept", answers)))
    elif pages:
        from rich.console import Group

        out.human(Group(*pages))
    if done:
        out.figures(report.csv(done))
    raise typer.Exit(worst_exit_code(answer["exit_code"] for answer in answers))
