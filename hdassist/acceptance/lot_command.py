"""The part of `hdassist accept` that takes lots."""

from __future__ import annotations

import time
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from hdassist.acceptance import lot_page as report
from hdassist.acceptance.answer import Accepted, Answer, Unanswered, as_object, read_answers
from hdassist.acceptance.junit import junit
from hdassist.acceptance.lot import Lot, read_lot
from hdassist.acceptance.lot_runner import answers as work
from hdassist.acceptance.page import csv
from hdassist.acceptance.replay import still_stands
from hdassist.acceptance.request import FailOn, Request
from hdassist.errors import DataError, HdassistError, UsageError
from hdassist.measuring.measure import require_drift
from hdassist.measuring.order_grid import DEFAULT, parse_orders
from hdassist.measuring.uncertainty import parse_stated
from hdassist.preset.overrides import parse
from hdassist.terminal.answers import to_json
from hdassist.terminal.files import add_line, put_text, require_writable, write_text
from hdassist.terminal.jsonlines import to_line, to_lines
from hdassist.terminal.output import Output, complain, note
from hdassist.terminal.workers import count, workers
from hdassist.verdict import worst_exit_code
from hdassist.version import __version__


@dataclass(frozen=True)
class Files:
    """Files of answers that were asked for: JSON Lines and JUnit; resume: go on with the lines that are there."""

    lines: str | None = None
    junit: str | None = None
    resume: bool = False

    def require_sound(self, out: Output, json: bool) -> None:
        """Raise UsageError unless each file has its own place, and can be written."""
        if self.resume and (self.lines is None or self.lines == "-"):
            raise UsageError("--resume goes on with a file of answers", "--jsonl FILE --resume")
        named = [path for path in (out.csv, self.lines, self.junit) if path is not None]
        named += [out.target] if out.target != "-" or json else []
        for path in named:
            if named.count(path) > 1:
                where = "standard output" if path == "-" else path
                raise UsageError(f"{where} can take one of --json, --csv, --jsonl and --junit")
        if self.lines is not None:
            require_writable(self.lines, out.force or self.resume)
        if self.junit is not None:
            require_writable(self.junit, out.force)

    @property
    def to_file(self) -> str | None:
        """The file that JSON Lines go to; None for standard output too."""
        return None if self.lines == "-" else self.lines

    @property
    def take_stdout(self) -> bool:
        """Whether one of them is standard output."""
        return "-" in (self.lines, self.junit)

    @property
    def asked(self) -> bool:
        """Whether there is a file that a drive without an answer stands in too."""
        return self.lines is not None or self.junit is not None

    def write_lines(self, out: Output, answers: Sequence[Answer]) -> None:
        """Write all lines at once."""
        if self.lines is not None:
            write_text(self.lines, to_lines(map(as_object, answers)), out.force)

    def write_suite(self, out: Output, name: str, answers: Sequence[Answer], facts: Mapping[str, object]) -> None:
        """Write the JUnit suite."""
        if self.junit is not None:
            write_text(self.junit, junit(name, answers, facts), out.force)


def accept_lot(
    path: str,
    base: Request,
    out: Output,
    files: Files,
    *,
    fail_on: FailOn,
    jobs: int,
    json: bool,
    quiet: bool,
    verbose: bool,
    debug: bool,
) -> int:
    """Accept the drives of a lot; returns the exit code.

    Arguments: path of a table or folder; base, what is asked of every drive; out and files, where answers go; the
    others as on the command line. Raises what read_lot does, and UsageError or DataError for files.
    """
    begun = time.monotonic()
    _require_sound(base)
    lot = read_lot(path, base)
    for text in lot.notes:
        note(f"{lot.file}: {text}")
    kept = _kept(lot, files, fail_on, out.force) if files.resume else {}
    width = max(len(row.serial) for row in lot.rows)
    shown = not (json or files.take_stdout or out.csv == "-")
    done: list[Answer] = []
    lines: list[str] = []
    try:
        with closing(_all(lot, kept, out, files, fail_on, jobs, debug)) as answers:
            for answer in answers:
                done.append(answer)
                if isinstance(answer, Unanswered):
                    complain(HdassistError(f"{report.title(answer)}: {answer.error.message}", answer.error.hint))
                if shown:
                    words = f"{report.title(answer)} {answer.status}" if quiet else report.line(answer, width)
                    lines.append(out.look.text(words))
                    if out.target == "-":
                        out.text(lines[-1] + "\n")
    except KeyboardInterrupt:
        known = len(kept) + sum(answer.serial not in kept for answer in done)
        where = f"are kept in {files.lines}: the same command with --resume goes on"
        note(f"{known} of {len(lot.rows)} rows {where if files.to_file else 'are done, none is kept: --jsonl FILE'}")
        raise
    if files.to_file is not None:
        if kept:
            put_text(files.to_file, to_lines(map(as_object, done)))  # in the order of the rows
        note(f"wrote {files.to_file}")
    if verbose:
        note(f"{lot.file}: {time.monotonic() - begun:.1f} s")
    if json:
        out.text(to_json(report.combined(lot, done)))
    elif shown:
        page = "" if quiet else "\n" + out.page(report.render(lot, done, out.look))
        out.text(page if out.target == "-" else "\n".join(lines) + "\n" + page)
    out.figures(csv(done))
    files.write_suite(out, lot.file, done, {"lot_sha256": lot.sha256, "seed": base.seed})
    return worst_exit_code(answer.exit_code for answer in done)


def _require_sound(base: Request) -> None:
    """Raise what is wrong with the options before every row says it: UsageError, or what a common preset has wrong."""
    parse_stated(base.reading.budget)
    parse_orders(base.reading.orders or DEFAULT)
    require_drift(base.reading.drift)
    base.reading.require_sound()
    if base.preset:
        base.load()
    for place, text in enumerate((*base.overrides, *(limit.override for limit in base.limits)), 1):
        parse(text, place)


def _kept(lot: Lot, files: Files, fail_on: FailOn, force: bool) -> dict[str, Accepted]:
    """Answers by serial that are there from before and still stand.

    Raises UsageError: answers are there, and not one of them stands: most likely it is the file of another lot.
    DataError: one of them contradicts itself.
    """
    assert files.lines is not None
    if not Path(files.lines).exists() or not Path(files.lines).stat().st_size:
        return {}
    before = {answer.serial: answer for answer in read_answers(files.lines) if isinstance(answer, Accepted)}
    there = len(before)
    kept = {}
    for row in lot.rows:
        answer = before.pop(row.serial, None)
        if answer is not None and not row.fault and still_stands(answer, row.request, __version__, fail_on):
            if fault := answer.contradiction:
                hint = "it was changed: take its line out, and the row is done again"
                raise DataError(f"{files.lines}: {report.title(answer)}: {fault}", hint)
            kept[row.serial] = replace(answer, place=row.place)
    if there and not kept and not force:
        words = f"{files.lines}: not one of its answers is of these drives, files, options and version"
        raise UsageError(words, "--force begins anew")
    spare = f"; {len(before)} answers in it are of no row and are left out" if before else ""
    note(f"{files.lines}: {len(kept)} of {len(lot.rows)} rows are known{spare}")
    return kept


def _all(
    lot: Lot, kept: dict[str, Accepted], out: Output, files: Files, fail_on: FailOn, jobs: int, debug: bool
) -> Generator[Answer, None, None]:
    """Answers in the order of the rows, known or worked out, added to the file of lines as they come."""
    known = [None if row.fault else kept.get(row.serial) for row in lot.rows]
    to_do = [row for row, answer in zip(lot.rows, known, strict=True) if answer is None]
    if files.to_file is not None:
        put_text(files.to_file, to_lines(as_object(answer) for answer in known if answer))
    with out.progress(lot.file, len(to_do)) as progress, workers(jobs) as executor:
        found = work(to_do, executor, fail_on, jobs=count(jobs), debug=debug)
        for before in known:
            answer: Answer = before or next(found)
            if before is None:
                progress(1)
                if files.to_file is not None:
                    add_line(files.to_file, to_line(as_object(answer)))
            if files.lines == "-":
                write_text("-", to_line(as_object(answer)) + "\n", out.force)
            yield answer
