"""Commands of acceptance: plan, and accept for drives, lots and replays of stored results."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from math import hypot
from typing import TYPE_CHECKING

from hdassist.features.report import Report
from hdassist.interface.terminal import options as o
from hdassist.interface.terminal.output import Output, complain, give, run_each, warn
from hdassist.interface.terminal.streams import begins_with, say, take_output, write_text
from hdassist.run.errors import Fault, HdassistError, UsageError
from hdassist.run.files import note_input
from hdassist.run.stops import at_stop

if TYPE_CHECKING:
    from hdassist.drive.preset.fields import Drive
    from hdassist.features.acceptance.answer import AcceptAnswer
    from hdassist.features.acceptance.request import Lot, LotRow, Request
    from hdassist.features.planning import PlanChoice, ReadingPlan
    from hdassist.features.report import Json
    from hdassist.run.kept import Kept


_MOST_READINGS = 1_000_000  # largest number of readings in a test; a recording with more rows could not be read


class PlanCommand(o.PlotOptions, o.SamplingOptions, o.LimitedDriveOptions):
    """Share of F'_ior that a test captures, and which positions or which recording are sufficient.

    \b
    Examples:
      hdassist plan vzp160
      hdassist plan my-drive.yaml --limit F_ior@6.7=45 --noise 0.5
      hdassist plan my-drive.yaml --limit 45 --positions 127
      hdassist plan vzp160 --positions 24 --turns 2 --json
      hdassist plan own.yaml --positions 36 --both --repeats 3 \\
          --encoders 0.5,1 --approach run.csv --sheet run.html

    A test reads the output at some positions, starting from an unknown angle, and takes the largest minus the smallest
    error. It misses extremes between the positions, and components whose number per revolution equals the number of
    positions. Each test is simulated on each drive sampled from the uncertain inputs (docs/unknown.md), at the first
    torque with a limit. The teeth of these drives have random deviations, as real teeth do (docs/plan.md). --approach
    writes a file with the positions in the sequence of the test. With the measured angles filled in, measure and accept
    --measured read this file.

    With a limit, a test is sufficient if the shares of false PASS and of false FAIL among all tested drives are both
    within the allowed share (--wrong). Without a limit, a test is sufficient if it captures 95 % of F'_ior in 95 % of
    cases. Exit codes: 0 a test (or the given one) is sufficient, 3 it is not sufficient, 6 undecided, 2 invalid
    options, 4 invalid preset, 5 no trustworthy result.
    """

    preset: str
    positions: int | None = None
    turns: float = 1.0
    both: bool = False
    noise: float = 0.0
    corrected: bool = False
    wrong: float = 0.05
    travel: float | None = None
    encoders: str | None = None
    repeats: int = 1
    dwell: float = 5.0
    warm_up: float = 30.0
    rpm: float = 60.0
    approach: str | None = None
    sheet: str | None = None
    serial: str = ""
    beside = ("csv", "approach", "sheet")

    def plan(self, drive: Drive) -> ReadingPlan | None:
        """Return the requested test of a drive, None if none is requested.

        Raises UsageError if other options need a test.
        """
        from hdassist.features.planning import ReadingPlan

        if self.positions is not None:
            used = (self.travel or drive.acceptance.travel) / 360
            return ReadingPlan.positions(self.positions, min(used, 1) if self.turns == 1 else self.turns, self.both)
        if self.both or self.turns != 1:
            raise UsageError("--turns and --both require --positions", "state the test, for example --positions 12")
        return None

    def report(self, out: Output, preset: str) -> Report:
        """Return the report on the tests of a drive, and write the requested files."""
        from hdassist.drive.model.geometry import Kinematics
        from hdassist.features.design import check_states
        from hdassist.features.planning import ApproachRun, EncoderData, PlanDemands, choose_plan
        from hdassist.interface.pages.plan import plan_report

        self._require_sheet()
        drive = self.load(preset)
        encoders = EncoderData.of(self.encoders) if self.encoders is not None else EncoderData()
        noise = hypot(self.noise, encoders.uncertainty_arcsec(abs(Kinematics.of(drive).u)))
        demands = PlanDemands(self.wrong, noise, self.corrected)
        test = ApproachRun(
            repeats=self.repeats,
            dwell_s=self.dwell,
            warm_up_min=self.warm_up,
            cam_rpm=self.rpm,
        )
        with out.run(drive.name, check_states(drive, draws=self.draws), self) as run:
            choice = choose_plan(
                drive,
                self.plan(drive),
                test=test,
                travel_deg=self.travel,
                run=run,
                demands=demands,
                draws=self.draws,
            )
        self._write_files(choice)
        record = self.approach if self.approach and self.approach != "-" else "record.csv"
        return plan_report(choice, record)

    def _require_sheet(self) -> None:
        """Raise UsageError for an invalid name of the test sheet, or for too many readings."""
        if self.sheet is not None and self.sheet != "-" and not self.sheet.endswith((".html", ".txt")):
            raise UsageError(f"invalid name of a test sheet: {self.sheet!r}", "use a name that ends in .html or .txt")
        readings = (self.positions or 0) * self.repeats * (1 + self.both)
        if readings > _MOST_READINGS and not self.approach is self.sheet is None:
            message = f"a test at {self.positions} positions, {self.repeats} times each, needs {readings} readings"
            raise UsageError(message, f"reduce --positions or --repeats; at most {_MOST_READINGS} readings are allowed")

    def _write_files(self, choice: PlanChoice) -> None:
        """Write the requested files: the positions, and the test sheet."""
        from hdassist.interface.pages.plan import approach_csv, sheet_report
        from hdassist.interface.pages.report import blocks_text, report_html

        if self.approach is not None:
            write_text(self.approach, approach_csv(choice), self.force)
        if self.sheet is not None:
            sheet = sheet_report(choice, self.serial, self.approach or "")
            if self.sheet.endswith(".html"):
                text = report_html(sheet)
            else:
                text = blocks_text(
                    sheet.head,
                    sheet.blocks,
                    ascii=self.ascii,
                )
            write_text(self.sheet, text, self.force)


class AcceptOptions(o.FigureOptions, o.SamplingOptions):
    """Options for computing acceptance results and writing them; jsonl and junit include drives without a result."""

    details: bool = False
    jsonl: str | None = None
    resume: bool = False
    junit: str | None = None
    executor: str | None = None
    beside = ("csv", "junit")

    def replaces(self, path: str) -> bool:
        """Return whether an existing file may be replaced.

        A resumed lot replaces the CSV and JUnit files of its last run.
        """
        if self.force or not self.resume:
            return self.force
        from hdassist.interface.pages.accept import FIGURES_HEAD, SUITES_HEAD

        return begins_with(path, (FIGURES_HEAD, SUITES_HEAD))

    def open(self) -> Output:
        """Return the output, after claiming its files.

        Raises UsageError if two results have the same destination or a file exists already, DataError if a file cannot
        be written.
        """
        if self.jsonl == "-" or (self.resume and self.jsonl is None):
            raise UsageError("the results of a lot must be written to a file", "name the file with --jsonl FILE")
        if self.jsonl is not None:
            self._take_results(self.jsonl)
        return super().open()

    def _take_results(self, path: str) -> None:
        """Claim the file for the results of a lot.

        Raises UsageError or DataError; for an existing file, the hint explains how to keep its results.
        """
        try:
            take_output(path, self.force, is_kept=self.resume)
        except UsageError as error:
            if error.fault is not Fault.FILE_EXISTS:
                raise
            hint = "use --resume to keep its rows and compute the others, or --force to compute all rows again"
            raise UsageError(error.message, hint, error.fault) from None


class AcceptCommand(AcceptOptions, o.PitchOptions, o.TraceOptions, o.DriveOptions):
    """PASS, FAIL or INCONCLUSIVE: drives compared with the limits of their presets.

    \b
    Examples:
      hdassist accept my-drive.yaml
      hdassist accept my-drive.yaml --measured 80=run.csv \\
          --budget encoder=0.3,coupling=0,reseating=0.3,temperature=0.4
      hdassist accept vzp160 --limit 30 --limit lost_motion=60
      hdassist accept my-drive.yaml --value lost_motion=41±3 --json
      hdassist accept lot.csv --preset my-drive.yaml --measured-only \\
          --jsonl lot.jsonl --resume --junit lot.xml
      grep -v '^17-04' lot.csv | hdassist accept - --preset my-drive.yaml
      hdassist accept --replay result.json

    A limit is decided by the measured value, with its uncertainty and a decision rule (acceptance.rule). Without a
    measured value it is decided by the model's prediction, as in hdassist check. A recording passes only if --budget
    states the uncertainties of encoder, coupling, reseating and temperature; 0 is allowed. hdassist explain CODE
    explains a check. A lot has a row for each drive, with the columns serial, preset, measured or measured@80, pitch_b,
    pitch_g (files), mark_b, mark_g, NAME[@TORQUE] (values like 28.1±1.2), limit NAME[@TORQUE], section.key (overrides).
    Exit codes: 0 PASS, 3 FAIL or a replay that differs, 6 INCONCLUSIVE, 4 invalid preset or file, or no limit, 5 no
    trustworthy result. For several drives the worst code counts, in the sequence 1, 5, 4, 2, 3, 6, 0.
    """

    presets: list[str]
    limit: list[str]
    measured: list[str]
    value: list[str]
    measured_only: bool = False
    strict: bool = False
    shared_records: bool = False
    sure: float = 0.95
    serial: str = ""
    preset: str = ""
    replay: str | None = None
    cross_check: str = "highs"

    def run(self) -> int:
        """Accept drives or a lot, or replay stored results, and return the exit code."""
        out = self.open()
        with out.progress(self.presets[0] if self.presets else self.replay or ""):  # shown before numpy is imported
            from hdassist.features.acceptance.request import Request, is_lot

            base = self.request()
        lots = [name for name in self.presets if is_lot(name) or (name == "-" and self.preset)]
        self._require_drives(lots)
        if not lots:
            base.wheels.require_sound()
        self._require_inputs_of_drives(lots, base)
        o.stdin_once(*self.presets, *base.files()[1:], self.replay)
        if self.measured_only and base.wheels.files:
            raise UsageError(
                "--measured-only makes no prediction, so measured pitch deviations cannot be used",
                "leave out either --measured-only, or both --pitch-b and --pitch-g",
            )
        if self.preset == "-":
            raise UsageError(
                "the preset of a lot cannot be read from standard input", "name the preset file with --preset FILE"
            )
        if self.replay is not None:
            if self.presets or self.csv or self.jsonl or self.junit or base != Request(""):
                hint = "leave out PRESET and all options except --json, -o and --jobs"
                raise UsageError("--replay takes its inputs and options from the stored result", hint)
            return _replay_answers(self.replay, self, out)
        return accept_lot(lots[0], base, self, out) if lots else _accept_presets(self.presets, base, self, out)

    def _require_drives(self, lots: Sequence[str]) -> None:
        """Raise UsageError unless drives, a single lot or a replay are given; lots: lots among the arguments."""
        if not self.presets and self.replay is None:
            raise UsageError("no drive is named", "name a preset or a lot.csv; see hdassist accept -h")
        if len(self.presets) > 1 and lots:
            raise UsageError(
                f"{lots[0]} is a lot and cannot be combined with other drives or lots", "name only the lot"
            )

    def _require_inputs_of_drives(self, lots: Sequence[str], base: Request) -> None:
        """Raise UsageError for inputs of one drive with several drives, or for options of a lot without a lot.

        lots: lots among the arguments.
        base: request that is common to all drives.
        """
        of_one = self.measured or self.value or self.serial or base.wheels.files or base.wheels.marks
        if (len(self.presets) > 1 or lots) and of_one:
            message = "options for measured values apply to a single drive"
            raise UsageError(message, "name one PRESET, or use the columns of a LOT.csv")
        if (self.preset or self.resume or self.jsonl) and not (lots or self.replay):
            raise UsageError("--preset, --jsonl and --resume apply to lots only", "use hdassist accept LOT.csv")

    def request(self) -> Request:
        """Return the request that is common to all drives. Raises UsageError for an invalid limit."""
        from hdassist.features.acceptance.request import Request

        return Request(
            self.preset,
            self.serial,
            overrides=tuple(self.overrides),
            limits=tuple(map(str, o.limits_of_options(self.limit))),
            measured=tuple(self.measured),
            values=tuple(self.value),
            reading=self.reading(),
            measured_only=self.measured_only or self.strict,
            strict=self.strict,
            shared_records=self.shared_records,
            cross_check=self.cross_check,
            seed=self.seed,
            wheels=self.wheels(),
            draws=self.draws,
            sure=self.sure,
        )


def _accept_presets(
    presets: Sequence[str],
    base: Request,
    options: AcceptCommand,
    out: Output,
) -> int:
    """Accept drives in sequence, and return the exit code.

    Raises the error of a single drive. With several drives, only a UsageError is raised.
    """
    from hdassist.features.acceptance.accept import failure_of
    from hdassist.features.acceptance.answer import answer_json
    from hdassist.features.acceptance.request import LotRow

    answers: list[AcceptAnswer] = []

    def report_of(preset: str) -> Report:
        answer, report = _accept_preset(replace(base, preset=preset), options, out)
        answers.append(answer)
        return report

    def failed(preset: str, error: HdassistError) -> Json:
        answers.append(failure_of(LotRow(replace(base, preset=preset)), error))
        return answer_json(answers[-1])

    reports = run_each(
        "accept",
        presets,
        report_of,
        out,
        failed=failed,
        keep_failures=options.junit is not None,
    )
    return _give(reports, answers, "accept", options, out)


def _accept_preset(
    request: Request,
    options: AcceptCommand,
    out: Output,
) -> tuple[AcceptAnswer, Report]:
    """Return the acceptance result of one drive, and the report on it."""
    from hdassist.features.acceptance.accept import accept
    from hdassist.features.design import check_states
    from hdassist.interface.pages.accept import accept_report
    from hdassist.run.run import Run

    drive = request.load(options.taken_over())
    inputs = request.read(drive)
    o.note_teeth(inputs.wheels)
    states = 0 if request.measured_only else check_states(drive, inputs.wheels, request.draws)
    with out.progress(drive.name, states) as progress, out.workers(options) as executor:
        run = Run(executor, progress)
        predictions = request.predict(drive, inputs.unmeasured, inputs.wheels, run)
        predictions = predictions and predictions.with_steps(run)
    answer = accept(request, inputs, predictions)
    return answer, accept_report(answer, predictions, drive)


def accept_lot(
    path: str,
    base: Request,
    options: AcceptOptions,
    out: Output,
) -> int:
    """Accept the drives of a lot, and return the exit code.

    path: file of the lot.
    base: request that is common to all drives.
    options: options of the command.
    out: destination of the results.
    Raises UsageError for options that cannot be combined or for an existing file, DataError for a file that cannot be
    read or written, PresetError for unusable column names.
    """
    acceptance = _LotAcceptance(
        base=base,
        options=options,
        out=out,
        name=path,
    )
    reports = run_each(
        "accept",
        [path],
        acceptance.report_of,
        out,
        kind="file",
    )
    return _give(reports, acceptance.answers, acceptance.name, options, out, acceptance.sha256)


@dataclass(eq=False)
class _LotAcceptance:
    """Acceptance of a lot.

    base: request that is common to all drives.
    options: options of the command.
    out: destination of the results.
    name: name of the lot in reports.
    sha256: SHA-256 of the lot's file, empty before the file is read.
    answers: results of the rows so far, in order.
    faults: number of rows with each error message.
    """

    base: Request
    options: AcceptOptions
    out: Output
    name: str
    sha256: str = ""
    answers: list[AcceptAnswer] = field(default_factory=list)
    faults: Counter[str] = field(default_factory=Counter)

    def report_of(self, path: str) -> Report:
        """Compute all rows of the lot in a file, and return the report on the lot. Raises the errors of accept_lot."""
        from hdassist.features.acceptance.answer import ANSWERS
        from hdassist.features.acceptance.request import read_lot
        from hdassist.interface.pages.accept import lot_report
        from hdassist.run.kept import KeptOwner, open_kept

        self.base.require_sound()
        lot = read_lot(path, self.base).with_shared_records()
        self.name = lot.file
        self.sha256 = lot.sha256
        for row in lot.rows:
            for file in row.request.files():
                note_input(file)
        options = self.options
        owner = KeptOwner(command="accept", inputs={})  # no common inputs, because each result states its own files
        with open_kept(options.jsonl, owner, ANSWERS, force=not options.resume) as kept:
            stored: list[AcceptAnswer | None] = [None for _ in lot.rows]
            if options.resume:
                stored = _known(lot, kept, options)
            self._compute(lot, stored, kept)
            repeated = self.faults.total() - len(self.faults)
            if repeated:
                say(f"note: the same errors occur in {repeated} further row{'s' if repeated > 1 else ''}")
            if options.resume:
                kept.rewrite(self.answers)  # leaves one result per row in the file, in order
        if options.jsonl:
            say(f"wrote {options.jsonl}")
        return lot_report(lot, self.answers)

    def _compute(
        self,
        lot: Lot,
        stored: Sequence[AcceptAnswer | None],
        kept: Kept[AcceptAnswer],
    ) -> None:
        """Collect the results of all rows in order, and store each new result immediately.

        lot: lot with its rows.
        stored: valid result of an earlier run for each row, None if there is none.
        kept: file of stored results.
        """
        stored_count = sum(answer is not None for answer in stored)
        kept_before = kept.done

        def state() -> str:
            count = stored_count + kept.done - kept_before
            where = f"are stored in {self.options.jsonl}; to continue, repeat the command with --resume"
            hint = where if self.options.jsonl else "are done but not stored; use --jsonl FILE to store rows"
            return f"{count} of {len(lot.rows)} rows {hint}"

        to_do = [row for row, answer in zip(lot.rows, stored, strict=True) if answer is None]
        with at_stop(state), closing(_answers(to_do, lot.file, self.options, self.out)) as fresh:
            for stored_answer in stored:
                answer = stored_answer or next(fresh)
                if stored_answer is None:
                    kept.append([answer])
                self._take(answer)

    def _take(self, answer: AcceptAnswer) -> None:
        """Add the result of a row, and show its error unless the same error was shown before."""
        from hdassist.interface.pages.accept import fault_words, title

        self.answers.append(answer)
        error = answer.error
        if error is None:
            return
        fault = fault_words(answer)
        if fault not in self.faults:
            complain(HdassistError(f"{title(answer)}: {error.message}", error.hint, error.code))
        self.faults[fault] += 1


def _give(
    reports: Sequence[Report],
    answers: Sequence[AcceptAnswer],
    name: str,
    options: AcceptOptions,
    out: Output,
    lot_sha256: str = "",
) -> int:
    """Write the reports and the requested CSV and JUnit files, and return the exit code.

    name: name of all results in the JUnit file.
    lot_sha256: SHA-256 of the file of a lot, empty if there is no lot.
    """
    from hdassist.interface.pages.accept import csv, junit

    code = give("accept", reports, out)
    for path, text_of in ((options.csv, csv), (options.junit, partial(junit, name, lot_sha256=lot_sha256))):
        if path is not None and answers:
            write_text(path, text_of(answers), options.replaces(path))
    return code


def _known(
    lot: Lot,
    kept: Kept[AcceptAnswer],
    options: AcceptOptions,
) -> list[AcceptAnswer | None]:
    """Return the stored result of each row, None if there is none or if its inputs have changed.

    Raises UsageError if none of the stored results belongs to a drive of this lot, except with --force.
    """
    from hdassist.features.acceptance.answer import still_stands

    before = {answer.serial: answer for answer in kept.records() if not answer.error}
    stored: list[AcceptAnswer | None] = []
    for row in lot.rows:
        answer = before.get(row.request.serial)
        stands = answer and not row.fault and still_stands(answer, row.request)
        stored.append(replace(answer, place=row.place) if answer and stands else None)
    if before and not any(stored) and not options.force:
        if not any(row.request.serial in before for row in lot.rows):
            raise UsageError(
                f"{options.jsonl}: none of its results belongs to a drive of this lot", "use --force to overwrite it"
            )
        warn(f"{options.jsonl}: the files, the options or the version have changed; all rows are computed again")
    if kept.done:
        say(f"{options.jsonl}: {sum(map(bool, stored))} of {len(lot.rows)} rows are already computed")
    return stored


def _replay_answers(
    path: str,
    options: AcceptOptions,
    out: Output,
) -> int:
    """Replay the results in a file written by --json or --jsonl, and return the exit code.

    Raises DataError if the file cannot be read.
    """
    from hdassist.features.acceptance.answer import changed_file, read_answers
    from hdassist.features.acceptance.request import LotRow
    from hdassist.interface.pages.accept import replay_report, title

    recorded = read_answers(path)
    faults = list(map(changed_file, recorded))
    for fault in filter(None, faults):
        complain(fault)
    pairs = list(zip(recorded, faults, strict=True))
    rows = [LotRow(answer.request, answer.place) for answer, fault in pairs if answer.request and not fault]
    with closing(_answers(rows, "replay", options, out)) as fresh:
        reports = [
            replay_report(answer, None if fault or not answer.request else next(fresh), fault)
            for answer, fault in pairs
        ]
    if len(reports) > 1:
        reports = [
            replace(report, line=f"{title(answer)} {report.line}")
            for report, answer in zip(reports, recorded, strict=True)
        ]
    return give("accept-replay", reports, out)


def _answers(
    rows: Sequence[LotRow],
    words: str,
    options: AcceptOptions,
    out: Output,
) -> Generator[AcceptAnswer, None, None]:
    """Yield the result of each row in order, as soon as it is computed; words: text beside the progress bar."""
    from hdassist.features.acceptance.accept import answer_rows
    from hdassist.run.run import stream

    work = partial(answer_rows, rows, options.debug)
    with (
        out.progress(words, len(rows)) as progress,
        out.engine(options) as engine,
        closing(
            stream(
                work,
                len(rows),
                jobs=options.jobs,
                executor=engine,
            )
        ) as chunks,
    ):
        for answers in chunks:
            yield from answers
            progress(len(answers))
