"""The part of `hdassist accept` that takes lots."""

from __future__ import annotations

import time
from collections.abc import Generator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from hdassist.acceptance import lot_page as report
from hdassist.acceptance.answer import Accepted, Answer, Unanswered, read_answers, to_line, to_lines
from hdassist.acceptance.command import Run
from hdassist.acceptance.lot import Lot, read_lot
from hdassist.acceptance.lot_runner import answer_rows
from hdassist.acceptance.page import csv
from hdassist.acceptance.replay import still_stands
from hdassist.acceptance.request import Request
from hdassist.errors import DataError, HdassistError, UsageError
from hdassist.measuring.measure import require_drift
from hdassist.measuring.orders import parse_orders
from hdassist.measuring.uncertainty import parse_stated
from hdassist.preset.overrides import parse
from hdassist.run.processes import count, workers
from hdassist.run.stops import at_stop
from hdassist.runfiles import note_input
from hdassist.terminal.answers import json_text
from hdassist.terminal.files import add_line, held, put_text, write_text
from hdassist.terminal.output import complain, note
from hdassist.textfile import is_file, is_there
from hdassist.verdict import worst_exit_code
from hdassist.version import __version__


def accept_lot(path: str, run: Run) -> int:
    """Accept the drives of a lot; returns the exit code.

    Arguments: path of a table or folder; run, its base being what is asked of every drive.
    Raises UsageError: options that cannot be meant, or a file that is there already; DataError: a table, folder or file
    that cannot be read or written; PresetError: names of columns that cannot be meant.
    """
    with held(run.files.lines_file):
        return _accept_lot(path, run)


def _accept_lot(path: str, run: Run) -> int:
    base, files, options, out = run.base, run.files, run.options, run.out
    begun = time.monotonic()
    _require_sound(base)
    lot = read_lot(path, base)
    for text in lot.notes:
        note(f"{lot.file}: {text}")
    for row in lot.rows:
        for path in row.request.files():
            note_input(path)
    kept = _kept(lot, files.lines_file, run) if files.lines_file and files.resume else {}
    width = max(len(row.serial) for row in lot.rows)
    shown = not (options.json or files.take_stdout or out.csv == "-")
    done: list[Answer] = []
    lines: list[str] = []

    def state() -> str:
        count = len(kept) + sum(answer.serial not in kept for answer in done)
        where = f"are kept in {files.lines_file}: the same command with --resume goes on"
        known = where if files.lines_file else "are done, none is kept: --jsonl FILE"
        return f"{count} of {len(lot.rows)} rows {known}"

    with at_stop(state), closing(_all(lot, kept, run)) as answers:
        for answer in answers:
            done.append(answer)
            if isinstance(answer, Unanswered):
                error = answer.error
                complain(HdassistError(f"{report.title(answer)}: {error.message}", error.hint, error.code))
            if shown:
                words = f"{report.title(answer)} {answer.status}" if options.quiet else report.line(answer, width)
                lines.append(out.style.text(words))
                if out.target == "-":
                    out.text(lines[-1] + "\n")
    if files.lines_file is not None:
        if kept:
            put_text(files.lines_file, to_lines(done))  # in the order of the rows
        note(f"wrote {files.lines_file}")
    if options.verbose:
        note(f"{lot.file}: {time.monotonic() - begun:.1f} s")
    if options.json:
        out.text(json_text(report.to_json(lot, done)))
    elif shown:
        page = "" if options.quiet else "\n" + out.page(report.render(lot, done, out.style))
        out.text(page if out.target == "-" else "\n".join(lines) + "\n" + page)
    if out.csv is not None:
        out.figures(csv(done))
    run.write_suite(lot.file, done, {"lot_sha256": lot.sha256})
    return worst_exit_code(answer.exit_code for answer in done)


def _require_sound(base: Request) -> None:
    """Raise what is wrong with the options before every row says it: UsageError, or what a common preset has wrong."""
    parse_stated(base.reading.budget)
    parse_orders(base.reading.orders or None)
    require_drift(base.reading.drift)
    base.reading.require_sound()
    if base.preset:
        base.load()
    for place, text in enumerate((*base.overrides, *(limit.override for limit in base.limits)), 1):
        parse(text, place)


def _kept(lot: Lot, file: str, run: Run) -> dict[str, Accepted]:
    """Answers by serial that are there from before and still stand.

    Raises UsageError: answers are there, and not one of them stands: most likely it is the file of another lot.
    DataError: one of them contradicts itself.
    """
    if not is_there(file):
        return {}
    if not is_file(file):
        raise DataError(f"{file} is no file that answers can be kept in", "--jsonl FILE without --resume writes to it")
    if not Path(file).stat().st_size:
        return {}
    answers = read_answers(file)
    if not answers and not Path(file).read_bytes().strip():
        raise DataError(f"{file}: no answer of hdassist accept: blank lines", "--jsonl FILE without --resume")
    before = {answer.serial: answer for answer in answers if isinstance(answer, Accepted)}
    there = len(before)
    kept = {}
    for row in lot.rows:
        answer = before.pop(row.serial, None)
        if answer is not None and not row.fault and still_stands(answer, row.request, __version__, run.fail_on):
            if fault := answer.contradiction:
                hint = "it was changed: take its line out, and the row is done again"
                raise DataError(f"{file}: {report.title(answer)}: {fault}", hint)
            kept[row.serial] = replace(answer, place=row.place)
    if there and not kept and not run.out.force:
        words = f"{file}: not one of its answers is of these drives, files, options and version"
        raise UsageError(words, "--force begins anew")
    spare = f"; {len(before)} answers in it are of no row and are left out" if before else ""
    note(f"{file}: {len(kept)} of {len(lot.rows)} rows are known{spare}")
    return kept


def _all(lot: Lot, kept: dict[str, Accepted], run: Run) -> Generator[Answer, None, None]:
    """Answers in the order of the rows, known or worked out, added to the file of lines as they come."""
    known = [None if row.fault else kept.get(row.serial) for row in lot.rows]
    to_do = [row for row, answer in zip(lot.rows, known, strict=True) if answer is None]
    file = run.files.lines_file
    if file is not None:
        put_text(file, to_lines(filter(None, known)))
    with run.out.progress(lot.file, len(to_do)) as progress, workers(run.jobs) as executor:
        found = answer_rows(to_do, executor, run.fail_on, jobs=count(run.jobs), debug=run.options.debug)
        for before in known:
            answer: Answer = before or next(found)
            if before is None:
                progress(1)
                if file is not None:
                    add_line(file, to_line(answer))
            if run.files.jsonl == "-":
                write_text("-", to_lines([answer]), run.out.force)
            yield answer
