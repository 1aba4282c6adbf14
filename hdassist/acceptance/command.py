"""`hdassist accept`: drives, and lots of them, held against their limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from hdassist.errors import HdassistError, UsageError
from hdassist.run.run import Run
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.acceptance.answer import Answer
    from hdassist.acceptance.request import FailOn, Request
    from hdassist.terminal.answers import Json
    from hdassist.terminal.output import Output
    from hdassist.terminal.runs import Answer as RunAnswer


@dataclass(frozen=True)
class FileOptions(o.OptionGroup):
    """Files of answers: JSON Lines and JUnit; resume: go on with the lines that are there."""

    jsonl: Annotated[
        str | None, typer.Option("--jsonl", metavar="FILE", help="Write each answer as a line of JSON (- for stdout).")
    ] = None
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the answers in --jsonl FILE.")] = False
    junit: Annotated[str | None, typer.Option("--junit", metavar="FILE", help="Write JUnit XML (- for stdout).")] = None

    @property
    def lines_file(self) -> str | None:
        """The file that JSON Lines go to; None for standard output too."""
        return None if self.jsonl == "-" else self.jsonl

    @property
    def take_stdout(self) -> bool:
        """Whether one of them is standard output."""
        return "-" in (self.jsonl, self.junit)

    @property
    def asked(self) -> bool:
        """Whether there is a file that a drive without an answer stands in too."""
        return self.jsonl is not None or self.junit is not None


@dataclass(frozen=True)
class AcceptRun:
    """What is asked of a run: base, of every drive; files and out, where answers go; the others as options are."""

    base: Request
    files: FileOptions
    options: o.FigureOptions
    out: Output
    fail_on: FailOn = "fail"
    jobs: int = 0
    details: bool = False

    def require_sound(self) -> None:
        """Raise UsageError unless each file has its own place, and can be written."""
        from hdassist.terminal.files import take_output

        files, out = self.files, self.out
        if files.resume and files.lines_file is None:
            raise UsageError("--resume goes on with a file of answers", "--jsonl FILE --resume")
        page = out.target if self.options.json else None
        if [out.csv, files.jsonl, files.junit, page].count("-") > 1:
            raise UsageError("standard output can take one of --json, --csv, --jsonl and --junit")
        if files.jsonl is not None:
            take_output(files.jsonl, out.force, is_kept=files.resume)
        if files.junit is not None:
            take_output(files.junit, self._replaces(files.junit))

    def write_suite(self, name: str, answers: Sequence[Answer], facts: Mapping[str, object]) -> None:
        """Write the JUnit suite where it was asked for."""
        from hdassist.acceptance.junit import junit
        from hdassist.terminal.files import write_text

        if self.files.junit is not None:
            text = junit(name, answers, {**facts, "seed": self.base.seed})
            write_text(self.files.junit, text, self._replaces(self.files.junit))

    def _replaces(self, suite: str) -> bool:
        """Whether the JUnit suite of a file may be replaced: a lot that goes on replaces that of its last run."""
        from hdassist.acceptance.junit import is_suite_of_lot

        return self.out.force or (self.files.resume and is_suite_of_lot(suite))


@o.with_groups
def command(
    presets: Annotated[
        list[str],
        typer.Argument(
            metavar="[PRESET...|LOT]",
            help="Preset names, paths, or - for stdin; or a lot: a table NAME.csv, a folder, or - with --preset.",
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
    fail_on: Annotated[
        Literal["warn", "fail", "never"], typer.Option(help="What makes the exit code other than 0.")
    ] = "fail",
    preset: Annotated[
        str, typer.Option("--preset", metavar="PRESET", help="Preset of the rows of a lot that name none.")
    ] = "",
    replay: Annotated[
        str | None, typer.Option("--replay", metavar="RESULT", help="Do again what an answer says (--json, --jsonl).")
    ] = None,
    trace: o.TraceOptions,
    pitch: o.PitchOptions,
    cross_check: o.CrossCheck = "highs",
    draws: o.Draws = 64,
    sure: o.VerdictProbability = 0.95,
    seed: o.Seed = 0,
    jobs: o.Jobs = 0,
    files: FileOptions,
    details: o.Details = False,
    options: o.FigureOptions,
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
    NAME[@TORQUE] (values like 28.1±1.2), limit NAME[@TORQUE], section.key (overrides); or it is a folder of presets
    with traces and pitch files beside them (17-042.yaml, 17-042@80.csv, 17-042.pitch-b.csv). Exit codes: 0 PASS, 3 FAIL
    or a replay that differs, 6 INCONCLUSIVE, 4 bad preset, file or no limit, 5 no trustworthy answer; of several drives
    the worst, in the order 1, 5, 4, 3, 6, 0.
    """
    from hdassist.acceptance.limit_parser import LimitText
    from hdassist.acceptance.lot import is_lot
    from hdassist.acceptance.lot_command import accept_lot
    from hdassist.acceptance.replay_command import replay_answers
    from hdassist.acceptance.request import Reading, Request, TraceFile, Wheels

    lots = [name for name in presets if is_lot(name) or (name == "-" and preset)]
    if not presets and replay is None:
        raise UsageError("nothing to accept", "name a preset, a lot.csv or a folder; hdassist accept -h")
    if len(presets) > 1 and lots:
        raise UsageError(f"{lots[0]} is a lot: one lot at a time, without other drives")
    wheels = Wheels(**asdict(pitch))
    if not lots:
        wheels.require_sound()
    if (len(presets) > 1 or lots) and (measured or value or serial or wheels.files or wheels.is_marked):
        raise UsageError("what was measured belongs to one drive", "one PRESET, or columns of a lot: LOT.csv")
    if (preset or files.resume) and not lots:
        raise UsageError(f"{'--preset' if preset else '--resume'} is for lots", "hdassist accept LOT.csv")
    traces = tuple(map(TraceFile.parse, measured))
    o.stdin_once(*presets, *(one.file for one in traces), *wheels.files.values(), replay)
    if measured_only and wheels.files:
        raise UsageError("--measured-only predicts nothing, and measured teeth are for predictions")
    if preset == "-":
        raise UsageError("rows of a lot cannot read standard input", "--preset FILE")
    rules = [f"acceptance.rule={rule}"] * bool(rule)
    reading = Reading(**asdict(trace.form()), orders=trace.orders, drift=trace.drift, budget=tuple(trace.budget))
    base = Request(
        preset, serial, (*drives.overrides, *rules), tuple(LimitText.parse(text, "--limit") for text in limit), traces,
        tuple(LimitText.parse(text, "--value") for text in value), reading, measured_only, cross_check, seed, wheels,
        draws, sure,
    )  # fmt: skip
    run = AcceptRun(base, files, options, options.open(), fail_on, jobs, details)
    run.require_sound()
    if replay is not None:
        if lots or options.csv or fail_on != "fail" or files != FileOptions() or base != Request(""):
            raise UsageError("--replay does what its answer says", "no other options than PRESET, --json, -o, --jobs")
        raise typer.Exit(replay_answers(replay, presets, run))
    raise typer.Exit(accept_lot(lots[0], run) if lots else accept_presets(presets, run))


def accept_presets(presets: Sequence[str], run: AcceptRun) -> int:
    """Accept drives one after the other; returns the exit code.

    Raises what is wrong with the only drive, and UsageError with any.
    """
    from functools import partial

    from hdassist.acceptance import page as report
    from hdassist.acceptance.answer import answer_of, failure_of, to_json, to_lines
    from hdassist.acceptance.limits import limits_of
    from hdassist.acceptance.predictions import estimate_states
    from hdassist.acceptance.request import carry_out, read_measurements, read_wheels
    from hdassist.run.processes import workers
    from hdassist.terminal.files import write_text
    from hdassist.terminal.runs import Answer as RunAnswer
    from hdassist.terminal.runs import give, run_each
    from hdassist.terminal.wheels import say_notes

    answers: list[Answer] = []

    def one(preset: str) -> RunAnswer:
        request = replace(run.base, preset=preset)
        drive = request.load()
        traces, teeth = read_measurements(request, drive), read_wheels(request, drive)
        say_notes(teeth)
        states = 0 if request.measured_only else estimate_states(drive, limits_of(drive), request.draws)
        with run.out.progress(drive.name, states) as progress, workers(run.jobs) as executor:
            result = carry_out(request, drive, traces, teeth, run=Run(executor, progress))
        answer = answer_of(request, result, run.fail_on)
        answers.append(answer)
        page = partial(report.render, result, serial=request.serial, details=run.details)
        return RunAnswer(
            lambda: to_json(answer),
            None if run.files.take_stdout else page,
            lambda: answer.status,
            about=drive.name,
            warnings=answer.warnings,
            exit_code=answer.exit_code,
        )

    def failed(preset: str, error: HdassistError) -> Json:
        answers.append(failure_of(replace(run.base, preset=preset), error))
        return to_json(answers[-1])

    kept = run.options.json or run.files.asked
    told = run_each("accept", presets, one, run.options, failed=failed, keep_failures=kept)
    code = give("accept", told, run.options, run.out)
    if run.out.csv is not None and not all(answer.error for answer in answers):
        run.out.figures(report.csv(answers))
    if run.files.jsonl is not None:
        write_text(run.files.jsonl, to_lines(answers), run.out.force)
    run.write_suite("accept", answers, {})
    return code
