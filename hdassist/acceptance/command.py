"""`hdassist accept`: drives, and lots of them, held against their limits."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from hdassist.terminal import options as o


def command(
    presets: Annotated[
        list[str],
        typer.Argument(
            metavar="[PRESET...|LOT]",
            help="Preset names, paths, or - for stdin; or a lot: a table NAME.csv, or a folder.",
            show_default=False,
        ),
    ] = [],  # noqa: B006 (typer copies it)
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
    preset: Annotated[
        str, typer.Option("--preset", metavar="PRESET", help="Preset of the rows of a lot that name none.")
    ] = "",
    replay: Annotated[
        str | None, typer.Option("--replay", metavar="RESULT", help="Do again what an answer says (--json, --jsonl).")
    ] = None,
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
    jsonl: Annotated[
        str | None, typer.Option("--jsonl", metavar="FILE", help="Write each answer as a line of JSON (- for stdout).")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the answers in --jsonl FILE.")] = False,
    junit: Annotated[
        str | None, typer.Option("--junit", metavar="FILE", help="Write JUnit XML (- for stdout).")
    ] = None,
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
      hdassist accept lot.csv --preset my-drive.yaml --measured-only --jsonl lot.jsonl --resume --junit lot.xml
      hdassist accept --replay result.json

    A limit is decided by what was measured, with its uncertainty and a decision rule, or else by the model's
    prediction with a declared margin. hdassist explain CODE tells what a check means. A lot has a row for each drive,
    with the columns serial, preset, measured or measured@80 (files), NAME[@TORQUE] (values like 28.1±1.2),
    limit NAME[@TORQUE], section.key (overrides); or it is a folder of presets with traces beside them
    (17-042.yaml, 17-042@80.csv). Exit codes: 0 PASS, 3 FAIL or a replay that differs, 6 INCONCLUSIVE, 4 bad preset,
    file or no limit, 5 no trustworthy answer; of several drives the worst, in the order 1, 5, 4, 3, 6, 0.
    """
    from hdassist.acceptance.lot import is_lot
    from hdassist.acceptance.lot_command import Files, accept_lot
    from hdassist.acceptance.replay_command import replay_answers
    from hdassist.acceptance.request import LimitText, Reading, Request, TraceFile
    from hdassist.acceptance.single import accept_presets
    from hdassist.errors import UsageError
    from hdassist.terminal.output import Output

    lots = [name for name in presets if is_lot(name)]
    if not presets and replay is None:
        raise UsageError("nothing to accept", "name a preset, a lot.csv or a folder; hdassist accept -h")
    if len(presets) > 1 and lots:
        raise UsageError(f"{lots[0]} is a lot: one lot at a time, without other drives")
    if (len(presets) > 1 or lots) and (measured or value or serial):
        raise UsageError("what was measured belongs to one drive", "one PRESET, or columns of a lot: LOT.csv")
    if (preset or resume) and not lots:
        raise UsageError(f"{'--preset' if preset else '--resume'} is for lots", "hdassist accept LOT.csv")
    traces = tuple(map(TraceFile.parse, measured))
    if [*presets, *(trace.file for trace in traces), replay].count("-") > 1:
        raise UsageError("standard input can be read once only")
    if preset == "-":
        raise UsageError("rows of a lot cannot read standard input", "--preset FILE")
    out = Output.open(output, csv, force=force, ascii=ascii, no_color=no_color)
    files = Files(jsonl, junit, resume)
    files.require_sound(out, json)
    rules = [f"acceptance.rule={rule}"] * bool(rule) + ([f"acceptance.margin={margin}"] if margin is not None else [])
    reading = Reading(
        angle, o.shaft(angle_of), angle_unit, error, error_unit, second, wrap, orders, drift, tuple(budget)
    )
    base = Request(
        preset, serial, (*overrides, *rules), tuple(LimitText.parse(text, "--limit") for text in limit), traces,
        tuple(LimitText.parse(text, "--value") for text in value), reading, measured_only, cross_check, seed,
    )  # fmt: skip
    if replay is not None:
        if lots or csv or fail_on != "fail" or files != Files() or base != Request(""):
            raise UsageError("--replay does what its answer says", "no other options than PRESET, --json, -o, --jobs")
        raise typer.Exit(replay_answers(replay, presets, out, jobs=jobs, json=json, quiet=quiet, debug=debug))
    if lots:
        code = accept_lot(
            lots[0], base, out, files, fail_on=fail_on, jobs=jobs, json=json, quiet=quiet, verbose=verbose, debug=debug
        )
    else:
        code = accept_presets(
            presets, base, out, files, fail_on=fail_on, jobs=jobs, json=json, quiet=quiet, verbose=verbose, debug=debug
        )
    raise typer.Exit(code)
