"""The part of `hdassist accept` that takes lots."""

from __future__ import annotations

import time
from collections.abc import Generator
from contextlib import closing
from dataclasses import replace

from hdassist.acceptance import lot_page as report
from hdassist.acceptance.answer import ANSWERS, Answer, to_lines
from hdassist.acceptance.command import AcceptRun
from hdassist.acceptance.lot import Lot, read_lot
from hdassist.acceptance.lot_runner import answer_rows
from hdassist.acceptance.page import csv
from hdassist.acceptance.replay import still_stands
from hdassist.acceptance.request import Request
from hdassist.errors import HdassistError, UsageError
from hdassist.measuring.measure import require_drift
from hdassist.measuring.orders import parse_orders
from hdassist.measuring.uncertainty import parse_stated
from hdassist.preset.overrides import parse
from hdassist.run.kept import Kept, Owner, open_kept
from hdassist.run.processes import count, workers
from hdassist.run.stops import at_stop
from hdassist.runfiles import note_input
from hdassist.terminal.answers import json_text
from hdassist.terminal.files import write_text
from hdassist.terminal.output import complain, note
from hdassist.verdict import worst_exit_code
from hdassist.version import __version__


def accept_lot(path: str, run: AcceptRun) -> int:
    """Accept the drives of a lot; returns the exit code.

    Arguments: path of a table or folder; run, its base being what is asked of every drive.
    Raises UsageError: options that cannot be meant, or a file that is there already; DataError: a table, folder or file
    that cannot be read or written; PresetError: names of columns that cannot be meant.
    """
    _require_sound(run.base)
    lot = read_lot(path, run.base)
    for text in lot.notes:
        note(f"{lot.file}: {text}")
    for row in lot.rows:
        for path in row.request.files():
            note_input(path)
    file = run.files.lines_file
    if file is None:
        return _accept_lot(lot, run, None)
    owner = Owner(command="accept", inputs={"lot": lot.sha256} if lot.sha256 else {})
    with open_kept(file, owner, ANSWERS, force=not run.files.resume, any_inputs=True) as kept:
        return _accept_lot(lot, run, kept)


def _accept_lot(lot: Lot, run: AcceptRun, file: Kept[Answer] | None) -> int:
    files, options, out = run.files, run.options, run.out
    begun = time.monotonic()
    kept = _known(lot, file, run) if file is not None and files.resume else {}
    width = max(len(row.serial) for row in lot.rows)
    shown = not (options.json or files.take_stdout or out.csv == "-")
    done: list[Answer] = []
    lines: list[str] = []

    before = file.done if file is not None else 0

    def state() -> str:
        fresh = sum(answer.serial not in kept for answer in done) if file is None else file.done - before
        count = len(kept) + fresh
        where = f"are kept in {files.lines_file}: the same command with --resume goes on"
        known = where if files.lines_file else "are done, none is kept: --jsonl FILE"
        return f"{count} of {len(lot.rows)} rows {known}"

    with at_stop(state), closing(_all(lot, kept, run, file)) as answers:
        for answer in answers:
            done.append(answer)
            if error := answer.error:
                complain(HdassistError(f"{report.title(answer)}: {error.message}", error.hint, error.code))
            if shown:
                words = f"{report.title(answer)} {answer.status}" if options.quiet else report.line(answer, width)
                lines.append(out.style.text(words))
                if out.target == "-":
                    out.text(lines[-1] + "\n")
    if file is not None:
        if files.resume:
            file.rewrite(done)  # in the order of the rows, each once
        file.require_there()
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


def _known(lot: Lot, file: Kept[Answer], run: AcceptRun) -> dict[str, Answer]:
    """Answers by serial that are there from before and still stand.

    Raises UsageError: answers are there, and not one of them stands: most likely it is the file of another lot.
    """
    name = run.files.lines_file
    before = {answer.serial: answer for answer in file.records() if not answer.error}
    there = len(before)
    known = {}
    for row in lot.rows:
        answer = before.pop(row.serial, None)
        if answer is not None and not row.fault and still_stands(answer, row.request, __version__, run.fail_on):
            known[row.serial] = replace(answer, place=row.place)
    if there and not known and not run.out.force:
        words = f"{name}: not one of its answers is of these drives, files, options and version"
        raise UsageError(words, "--force begins anew")
    spare = f"; {len(before)} answers in it are of no row and are left out" if before else ""
    if file.done:
        note(f"{name}: {len(known)} of {len(lot.rows)} rows are known{spare}")
    return known


def _all(lot: Lot, kept: dict[str, Answer], run: AcceptRun, file: Kept[Answer] | None) -> Generator[Answer, None, None]:
    """Answers in the order of the rows, known or worked out, added to the file of lines as they come."""
    known = [None if row.fault else kept.get(row.serial) for row in lot.rows]
    to_do = [row for row, answer in zip(lot.rows, known, strict=True) if answer is None]
    with run.out.progress(lot.file, len(to_do)) as progress, workers(run.jobs) as executor:
        found = answer_rows(to_do, executor, run.fail_on, jobs=count(run.jobs), debug=run.options.debug)
        for before in known:
            answer: Answer = before or next(found)
            if before is None:
                progress(1)
                if file is not None:
                    file.append([answer])
            if run.files.jsonl == "-":
                write_text("-", to_lines([answer]), run.out.force)
            yield answer
