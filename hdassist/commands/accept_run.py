"""The runs of `hdassist accept`: drives one after the other, a lot, and answers done again."""

from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial

from hdassist.acceptance.accept import accept
from hdassist.acceptance.answer import ANSWERS, AcceptAnswer, answer_json, read_answers
from hdassist.acceptance.lot import Lot, LotRow, read_lot
from hdassist.acceptance.replay import changed_file, still_stands
from hdassist.acceptance.request import Request
from hdassist.acceptance.work import answer_rows, failure_of
from hdassist.commands.accept import AcceptCommand, AcceptOptions
from hdassist.design.check import check_states
from hdassist.errors import HdassistError, UsageError
from hdassist.json_parts import Json
from hdassist.pages import accept as page
from hdassist.pages.accept import junit
from hdassist.report import Report
from hdassist.run.kept import Kept, KeptOwner, open_kept
from hdassist.run.run import Run, stream
from hdassist.run.stops import at_stop
from hdassist.runfiles import note_input
from hdassist.terminal.answers import failure
from hdassist.terminal.files import write_text
from hdassist.terminal.output import Output, complain, note
from hdassist.terminal.runs import give, run_each
from hdassist.terminal.wheels import say_notes

ACCEPT_OWNER = KeptOwner(command="accept", inputs={})  # each answer has the files that it comes from


def accept_presets(presets: Sequence[str], base: Request, options: AcceptCommand) -> int:
    """Accept drives one after the other; returns the exit code.

    Raises what is wrong with the only drive, and UsageError with any.
    """
    out = options.open()
    answers: list[AcceptAnswer] = []

    def one(preset: str) -> Report:
        request = replace(base, preset=preset)
        drive = request.load(options.taken_over())
        inputs = request.read(drive)
        say_notes(inputs.wheels)
        states = 0 if request.measured_only else check_states(drive, inputs.wheels, request.draws)
        with out.progress(drive.name, states) as progress, out.workers(options) as executor:
            run = Run(executor, progress)
            predictions = request.predict(drive, inputs.unmeasured, inputs.wheels, run)
            predictions = predictions and predictions.with_steps(run)
        answers.append(accept(request, inputs, predictions))
        return page.accept_report(answers[-1], predictions, drive)

    def failed(preset: str, error: HdassistError) -> Json:
        answers.append(failure_of(LotRow(replace(base, preset=preset)), error))
        return answer_json(answers[-1])

    reports = run_each("accept", presets, one, options, failed=failed, keep_failures=options.junit is not None)
    return _give(reports, answers, "accept", options, out)


def accept_lot(path: str, base: Request, options: AcceptOptions) -> int:
    """Accept the drives of a lot; returns the exit code.

    Arguments: path of a table; base, the request that every drive gets; options.
    Raises UsageError: options that cannot be meant, or a file that is there already; DataError: a table or file
    that cannot be read or written; PresetError: names of columns that cannot be meant.
    """
    out = options.open()
    done: list[AcceptAnswer] = []
    name, sha256 = path, ""

    def one(path: str) -> Report:
        nonlocal name, sha256
        base.require_sound()
        lot = read_lot(path, base)
        name, sha256 = lot.file, lot.sha256
        for file in (file for row in lot.rows for file in row.request.files()):
            note_input(file)
        with open_kept(options.jsonl, ACCEPT_OWNER, ANSWERS, force=not options.resume) as kept:
            known = _known(lot, kept, options) if options.resume else [None] * len(lot.rows)
            before, is_known = kept.done, sum(map(bool, known))

            def state() -> str:
                where = f"are kept in {options.jsonl}: the same command with --resume goes on"
                words = where if options.jsonl else "are done, none is kept: --jsonl FILE"
                return f"{is_known + kept.done - before} of {len(lot.rows)} rows {words}"

            to_do = [row for row, answer in zip(lot.rows, known, strict=True) if answer is None]
            with at_stop(state), closing(_answers(to_do, lot.file, options, out)) as fresh:
                for there in known:
                    answer = there or next(fresh)
                    if there is None:
                        kept.append([answer])
                    done.append(answer)
                    if error := answer.error:
                        complain(HdassistError(f"{page.title(answer)}: {error.message}", error.hint, error.code))
            if options.resume:
                kept.rewrite(done)  # in the order of the rows, each once
        if options.jsonl:
            note(f"wrote {options.jsonl}")
        return page.lot_report(lot, done)

    reports = run_each("accept", [path], one, options, failed=lambda name, error: failure("accept", error, file=name))
    return _give(reports, done, name, options, out, sha256)


def _give(
    reports: Sequence[Report],
    answers: Sequence[AcceptAnswer],
    name: str,
    options: AcceptOptions,
    out: Output,
    lot_sha256: str = "",
) -> int:
    """Write reports, and their answers as CSV and as JUnit with a name of the whole; returns the exit code."""
    if options.junit == "-":
        reports = [replace(report, head="") for report in reports]
    code = give("accept", reports, options, out)
    for path, text_of in ((options.csv, page.csv), (options.junit, partial(junit, name, lot_sha256=lot_sha256))):
        if path is not None and answers:
            write_text(path, text_of(answers), options.replaces(path))
    return code


def _known(lot: Lot, kept: Kept[AcceptAnswer], options: AcceptOptions) -> list[AcceptAnswer | None]:
    """Answers to the rows that are there from before and still stand, None for the others.

    Raises UsageError: answers are there, and not one of them stands: most likely it is the file of another lot.
    """
    before = {answer.serial: answer for answer in kept.records() if not answer.error}
    found: list[AcceptAnswer | None] = []
    for row in lot.rows:
        answer = before.get(row.request.serial)
        stands = answer and not row.fault and still_stands(answer, row.request)
        found.append(replace(answer, place=row.place) if answer and stands else None)
    if before and not any(found) and not options.force:
        words = f"{options.jsonl}: not one of its answers is of these drives, files, options and version"
        raise UsageError(words, "--force begins anew")
    if kept.done:
        note(f"{options.jsonl}: {sum(map(bool, found))} of {len(lot.rows)} rows are known")
    return found


def replay_answers(path: str, options: AcceptOptions) -> int:
    """Do the answers of a file of --json or --jsonl again; returns the exit code. Raises DataError: no such file."""
    out, recorded = options.open(), read_answers(path)
    faults = list(map(changed_file, recorded))
    for fault in filter(None, faults):
        complain(fault)
    pairs = list(zip(recorded, faults, strict=True))
    rows = [LotRow(answer.request, answer.place) for answer, fault in pairs if answer.request and not fault]
    with closing(_answers(rows, "replay", options, out)) as fresh:
        reports = [
            page.replay_report(answer, None if fault or not answer.request else next(fresh), fault)
            for answer, fault in pairs
        ]
    return give("accept-replay", reports, options, out)


def _answers(
    rows: Sequence[LotRow], words: str, options: AcceptOptions, out: Output
) -> Generator[AcceptAnswer, None, None]:
    """Answers to rows, in their order, as they come; words beside the bar."""
    work = partial(answer_rows, rows, options.debug)
    with (
        out.progress(words, len(rows)) as progress,
        out.engine(options) as engine,
        closing(stream(work, len(rows), jobs=options.jobs, executor=engine)) as chunks,
    ):
        for answers in chunks:
            yield from answers
            progress(len(answers))
