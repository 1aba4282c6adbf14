"""`hdassist accept`: drives, and lots of them, held against their limits."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from hdassist.errors import UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.terminal.output import Output


@dataclass(frozen=True)
class AcceptOptions(o.FigureOptions):
    """How answers are worked out and given; jsonl and junit also have the drives without an answer."""

    details: o.Details = False
    jsonl: Annotated[
        str | None, typer.Option("--jsonl", metavar="FILE", help="Write each answer as a line of JSON (- for stdout).")
    ] = None
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the answers in --jsonl FILE.")] = False
    junit: Annotated[str | None, typer.Option("--junit", metavar="FILE", help="Write JUnit XML (- for stdout).")] = None
    fail_on: Annotated[
        Literal["warn", "fail", "never"], typer.Option(help="What makes the exit code other than 0.")
    ] = "fail"
    jobs: o.Jobs = 0

    @property
    def lines_file(self) -> str | None:
        """The file that JSON Lines go to; None for standard output too."""
        return None if self.jsonl == "-" else self.jsonl

    @property
    def takes_stdout(self) -> bool:
        """Whether JSON Lines or JUnit go to standard output."""
        return "-" in (self.jsonl, self.junit)

    @property
    def has_lines(self) -> bool:
        """Whether there is a file that a drive without an answer stands in too."""
        return self.jsonl is not None or self.junit is not None

    @property
    def replaces_suite(self) -> bool:
        """Whether the file of --junit may be replaced: a lot that goes on replaces that of its last run."""
        from hdassist.pages.accept_junit import is_suite_of_lot

        return self.force or (self.resume and self.junit is not None and is_suite_of_lot(self.junit))

    def open(self) -> Output:
        """Where answers go. Raises UsageError and DataError unless each file has its own place, and can be written."""
        from hdassist.terminal.files import take_output

        if self.resume and self.lines_file is None:
            raise UsageError("--resume goes on with a file of answers", "--jsonl FILE --resume")
        if [self.csv, self.jsonl, self.junit, self.output if self.json else None].count("-") > 1:
            raise UsageError("standard output can take one of --json, --csv, --jsonl and --junit")
        out = super().open()
        if self.jsonl is not None:
            take_output(self.jsonl, self.force, is_kept=self.resume)
        if self.junit is not None:
            take_output(self.junit, self.replaces_suite)
        return out


@o.with_groups
def accept_command(
    presets: Annotated[
        list[str],
        typer.Argument(
            metavar="[PRESET...|LOT]",
            help="Preset names, paths, or - for stdin; or a lot: a table NAME.csv, or - with --preset.",
            show_default=False,
        ),
    ] = [],  # noqa: B006 (typer copies it)
    *,
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
    drives: o.DriveOptions,
    serial: Annotated[str, typer.Option(metavar="TEXT", help="Serial number in the report.")] = "",
    rule: Annotated[Literal["guard", "simple"] | None, typer.Option(help="Decision rule for measured values.")] = None,
    measured_only: Annotated[bool, typer.Option("--measured-only", help="Predict nothing.")] = False,
    preset: Annotated[
        str, typer.Option("--preset", metavar="PRESET", help="Preset of the rows of a lot that name none.")
    ] = "",
    replay: Annotated[
        str | None, typer.Option("--replay", metavar="RESULT", help="Do again what an answer says (--json, --jsonl).")
    ] = None,
    trace: o.TraceOptions,
    pitch: o.PitchOptions,
    cross_check: o.CrossCheckOption = "highs",
    draws: o.DrawsOption = 64,
    sure: o.VerdictProbability = 0.95,
    seed: o.SeedOption = 0,
    options: AcceptOptions,
) -> None:
    """PASS, FAIL or INCONCLUSIVE: drives held against the limits of their presets.

    \b
    Examples:
      hdassist accept my-drive.yaml
      hdassist accept my-drive.yaml --measured 80:run.csv \\
          --budget encoder=0.3,coupling=0,reseating=0.3,temperature=0.4
      hdassist accept vzp160 --limit F_ior@80=30 --limit lost_motion=60
      hdassist accept my-drive.yaml --value lost_motion=41±3 --json
      hdassist accept lot.csv --preset my-drive.yaml --measured-only \\
          --jsonl lot.jsonl --resume --junit lot.xml
      grep -v '^17-04' lot.csv | hdassist accept - --preset my-drive.yaml
      hdassist accept --replay result.json

    A limit is decided by what was measured, with its uncertainty and a decision rule, or else by the model's
    prediction: PASS where it keeps the limit with a probability of --sure over all that is not known exactly, by the
    samples of hdassist check. A trace passes only where --budget states encoder, coupling, reseating and temperature,
    0 allowed. hdassist explain CODE tells what a check means. A lot has a row for
    each drive, with the columns serial, preset, measured or measured@80, pitch_b, pitch_g (files), mark_b, mark_g,
    NAME[@TORQUE] (values like 28.1±1.2), limit NAME[@TORQUE], section.key (overrides). Exit codes: 0 PASS, 3 FAIL or a
    replay that differs, 6 INCONCLUSIVE, 4 bad preset, file or no limit, 5 no trustworthy answer; of several drives the
    worst, in the order 1, 5, 4, 3, 6, 0.
    """
    from hdassist.acceptance.lot import is_lot
    from hdassist.acceptance.request import TEXTS, Reading, Request, Wheels
    from hdassist.commands.accept_run import accept_lot, accept_presets, replay_answers

    lots = [name for name in presets if is_lot(name) or (name == "-" and preset)]
    if not presets and replay is None:
        raise UsageError("nothing to accept", "name a preset or a lot.csv; hdassist accept -h")
    if len(presets) > 1 and lots:
        raise UsageError(f"{lots[0]} is a lot: one lot at a time, without other drives")
    given = {"--set": drives.overrides, "--limit": limit, "--measured": measured, "--value": value}
    if rule:
        given["--set"] = [*drives.overrides, f"acceptance.rule={rule}"]
    base = Request(
        preset,
        serial,
        reading=Reading(**asdict(trace.form()), orders=trace.orders, drift=trace.drift, budget=tuple(trace.budget)),
        measured_only=measured_only,
        cross_check=cross_check,
        seed=seed,
        wheels=Wheels(**asdict(pitch)),
        draws=draws,
        sure=sure,
        **{field: tuple(map(parse, given[option])) for option, (field, parse) in TEXTS.items()},
    )
    wheels = base.wheels
    if not lots:
        wheels.require_sound()
    if (len(presets) > 1 or lots) and (measured or value or serial or wheels.files or wheels.is_marked):
        raise UsageError("what was measured belongs to one drive", "one PRESET, or columns of a lot: LOT.csv")
    if (preset or options.resume) and not lots:
        raise UsageError(f"{'--preset' if preset else '--resume'} is for lots", "hdassist accept LOT.csv")
    o.stdin_once(*presets, *(one.file for one in base.measured), *wheels.files.values(), replay)
    if measured_only and wheels.files:
        raise UsageError("--measured-only predicts nothing, and measured teeth are for predictions")
    if preset == "-":
        raise UsageError("rows of a lot cannot read standard input", "--preset FILE")
    if replay is not None:
        if lots or options.csv or options.has_lines or options.fail_on != "fail" or base != Request(""):
            raise UsageError("--replay does what its answer says", "no other options than PRESET, --json, -o, --jobs")
        raise typer.Exit(replay_answers(replay, presets, options))
    raise typer.Exit(accept_lot(lots[0], base, options) if lots else accept_presets(presets, base, options))
