"""Where the answer of a command goes: pages, JSON, CSV and files; progress; one drive or file after the other."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from numbers import Number
from textwrap import indent
from typing import TYPE_CHECKING, Any, Literal

from hdassist import __version__
from hdassist.errors import Fault, HdassistError, UsageError, worst_exit_code
from hdassist.files import NUMBER, printable, visible
from hdassist.report import Json, Report, as_json, certificate_object, schema_of
from hdassist.run.stops import at_stop
from hdassist.terminal.streams import Style, console, made_or, say, stderr_style, write_text

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from rich.console import RenderableType
    from rich.progress import Progress

    from hdassist.preset.fields import Drive
    from hdassist.run.run import Run


_WIPED = b"\r\x1b[2K\x1b[?25h"  # the line of a bar emptied, and the cursor shown
BAR_PATIENCE = 0.5  # s of work before a progress bar with a total appears
_TASK: Any = 0  # the only one of a bar
_REDRAWN = 0.1  # s between two of its pictures
_BAR_STYLES = {  # of rich, whose own are colours that mean a verdict here
    **dict.fromkeys(("bar.complete", "bar.finished", "progress.remaining"), "none"),
    "bar.back": "color(245)",
    "bar.pulse": "color(250)",
}


@dataclass(frozen=True)
class Output:
    """How one command answers.

    target: the file of the answer, csv of the figures, "-" for stdout; force: whether these may be replaced; json,
    quiet: the answer as JSON, or in a line; plot, details: whether pages have figures and all that they can show;
    has_page: whether there are pages or lines, for which a file may have taken standard output;
    verbose: whether times are noted; debug: whether an error ends the command.
    """

    style: Style
    target: str = "-"
    csv: str | None = None
    force: bool = False
    no_color: bool = False
    plot: bool = True
    details: bool = False
    json: bool = False
    quiet: bool = False
    has_page: bool = True
    verbose: bool = False
    debug: bool = False
    _bars: list[ProgressBar] = field(default_factory=list)  # the one under way

    def human(self, answer: RenderableType) -> None:
        """Give the answer for people."""
        if self.style.codes:
            console(sys.stdout, self.style).print(answer)
            return
        self.text(self.page(answer))

    def page(self, answer: RenderableType) -> str:
        """Return the answer for people as plain text."""
        page = io.StringIO()
        console(page, replace(self.style, codes=False)).print(answer)
        return "\n".join(line.rstrip() for line in page.getvalue().splitlines()).rstrip() + "\n"

    def text(self, answer: str) -> None:
        """Give an answer that is text, hidden characters escaped: JSON has none."""
        write_text(self.target, visible(answer), self.force)

    @contextmanager
    def run(
        self,
        words: str,
        states: int,
        options: object,
    ) -> Iterator[Run]:
        """How work of so many states is carried out, with a bar and words beside it.

        Its processes, seed and other solver are those that the options of a command have; one that solves each state
        by a slow solver of its own works in this process, and shows how far it is.
        """
        from hdassist.run.run import CROSS_SOLVER, Run

        values = {"jobs": None, "seed": 0, "cross_check": CROSS_SOLVER, "solver": None} | vars(options)
        alone = values["jobs"] is None or values["solver"] is not None
        with self.progress(words, states) as progress, nullcontext() if alone else self.workers(options) as executor:
            yield Run(
                executor=executor,
                progress=progress,
                seed=values["seed"],
                cross_check=values["cross_check"],
            )

    @contextmanager
    def engine(self, options: object) -> Iterator[Executor | None]:
        """The executor that the options of a command name, None for processes of its own on this machine."""
        from hdassist.run.run import cluster
        from hdassist.solve.walk import installation

        if not (name := getattr(options, "executor", None)):
            yield None
            return
        with cluster(name, getattr(options, "jobs", 0), installation) as engine:
            yield engine

    @contextmanager
    def workers(self, options: object) -> Iterator[Executor]:
        """The executor that the options of a command name, or processes of its own on this machine."""
        from hdassist.run.run import workers

        with (
            self.engine(options) as engine,
            nullcontext(engine) if engine else workers(getattr(options, "jobs", 0)) as new_engine,
        ):
            yield new_engine

    @contextmanager
    def progress(self, words: str, total: int | None = None) -> Iterator[ProgressBar]:
        """A bar with the time left, on a terminal only: at once without a total, else after BAR_PATIENCE of work.

        Within another one it is that bar, which goes on with these words and this total.
        Arguments: words beside it; total of work, None before that is known.
        """
        if self._bars:
            self._bars[0].expect(words, total)
            yield self._bars[0]
            return
        style = stderr_style(no_color=self.no_color)
        bar = ProgressBar(_bar(style) if style.codes else None, style)
        self._bars.append(bar)
        try:
            with at_stop(bar.wipe):  # before it is shown
                bar.expect(words, total)
                yield bar
        finally:
            self._bars.clear()
            bar.end()


class ProgressBar:
    """Called with work that was done, it moves a bar with one task; None if nobody looks. style: of its words."""

    def __init__(self, bar: Progress | None, style: Style) -> None:
        self._bar = bar
        self._style = style
        self._next = time.monotonic() + BAR_PATIENCE  # that it is drawn

    def __call__(self, done: int) -> None:
        """Move on by work that was done."""
        if self._bar:
            self._bar.advance(_TASK, done)
            if (now_s := time.monotonic()) > self._next:
                self._next = now_s + _REDRAWN
                self._bar.start()
                self._bar.refresh()

    def expect(self, words: str, total: int | None = None) -> None:
        """Begin work of such a total, with words beside the bar; without a total it is shown at once."""
        if self._bar:
            if not self._bar.tasks:
                self._bar.add_task("")
            self._bar.reset(
                _TASK,
                description=self._style.text(words),
                total=total,
            )
            if total is None:
                self._bar.start()
                self._bar.refresh()

    def wipe(self) -> None:
        """Empty the line of the bar, which does not come back."""
        if self._bar and self._bar.live.is_started:
            os.write(2, _WIPED)  # past rich, which escapes codes while its bar is shown

    def end(self) -> None:
        """Take the bar away."""
        if self._bar and self._bar.live.is_started:
            self._bar.stop()


def _bar(style: Style) -> Progress:
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
    from rich.theme import Theme

    screen = console(sys.stderr, style)
    screen.push_theme(Theme(_BAR_STYLES))
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
        console=screen,
        transient=True,
        auto_refresh=False,  # without a thread of its own, beside which processes could not be forked
        redirect_stdout=sys.stdout.isatty(),  # lines above the bar; a file is left alone
    )


def complain(error: HdassistError, about: str = "") -> None:
    """Write an error on stderr, with its remedy."""
    where = f"{about}: " if about else ""
    say(f"error: {where}{error.message}\n  hint: {with_code(error.hint, error.fault)}")


def with_code(hint: str, fault: Fault) -> str:
    """Return a hint, and the command that explains errors of its kind."""
    return f"{hint} (hdassist explain {fault})" if hint else f"hdassist explain {fault}"


def warn(text: str) -> None:
    """Write a warning on stderr."""
    say(f"warning: {text}")


FORMULA = tuple("=+-@\t\n＝＋－＠")  # by which a spreadsheet knows one
_NUMBER = re.compile(NUMBER)


def _head(command: str) -> Json:
    return {"schema": schema_of(command), "version": __version__}


def envelope(
    command: str,
    drive: Drive | None,
    exit_code: int = 0,
    warnings: Sequence[str] = (),
) -> Json:
    """Return the keys common to all answers of a command; drive, the subject of the answer, None without one."""
    origin = drive.origin if drive else None
    return {
        **_head(command),
        "preset": {
            "name": drive.name if drive else None,
            "sha256": origin.sha256 if origin else None,
            "overrides": list(origin.overrides) if origin else [],
        },
        "exit_code": exit_code,
        "warnings": list(warnings),
    }


def report_object(report: Report) -> Json:
    """Return a report as a JSON object."""
    answer = envelope(report.command, report.drive, report.exit_code, report.warnings) | report.values
    if report.certificate:
        answer["certificate"] = certificate_object(report.certificate, report.cross_checks)
    return {key: as_json(value) for key, value in answer.items()}


def failure(
    command: str,
    error: HdassistError,
    *,
    preset: str | None = None,
    file: str | None = None,
) -> Json:
    """Return the answer about a drive or a file that has none: its error.

    Arguments: command; error; preset and file, the names asked for.
    """
    return {
        **_head(command),
        "preset": {"name": preset, "sha256": None},
        **({} if file is None else {"file": {"name": file, "sha256": None}}),
        "exit_code": error.exit_code,
        "warnings": [],
        "error": {"code": str(error.fault), "message": error.message, "hint": error.hint},
    }


def combine(command: str, results: Sequence[Json]) -> Json:
    """Return one object for all drives: the answer itself if there is one, else a list of them."""
    return results[0] if len(results) == 1 else together(command, results)


def together(command: str, results: Sequence[Json]) -> Json:
    """Return one object with a list of answers, be it one or many; its exit code is the worst of theirs."""
    return {
        **_head(command),
        "exit_code": worst_exit_code(result["exit_code"] for result in results),
        "warnings": [],
        "results": list(results),
    }


def json_text(answer: Json) -> str:
    """Return an answer as text; never NaN or Infinity."""
    return (
        printable(
            json.dumps(
                answer,
                indent=2,
                ensure_ascii=True,
                allow_nan=False,
            )
        )
        + "\n"
    )


def csv_text(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table as CSV: one header line, plain newlines, full precision, empty if there is no value.

    Text cannot act: hidden characters are escaped, and an apostrophe stands before formulas of spreadsheets.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(_cell, header))
    writer.writerows(map(_cell, row) for row in rows)
    return text.getvalue()


def _cell(value: Any) -> Any:
    """Return a cell: numbers as they are, text made harmless."""
    if value is None or isinstance(value, Number):
        return "" if value is None else value
    text = visible(str(value))
    return f"'{text}" if text.startswith(FORMULA) and not _NUMBER.fullmatch(text) else text


def run_each(
    command: str,
    names: Sequence[str],
    one: Callable[[str], Report],
    out: Output,
    *,
    kind: Literal["preset", "file"] = "preset",
    failed: Callable[[str, HdassistError], Json] | None = None,
    keep_failures: bool = False,
) -> list[Report]:
    """Return the reports on presets or files one after the other; the error of one is its answer, and the others go on.

    Each line of one of several begins with its name.

    Arguments: command, for the schema of failures; names, of presets or files, and their kind; one, its report; out;
    failed, the JSON of one without an answer; keep_failures, whether the fault of the only one is an answer too where
    no JSON is asked for. Raises UsageError at once, the error of the only one, and with --debug any error.
    """
    reports: list[Report] = []
    for name in names:
        begun = time.monotonic()
        try:
            with out.progress(name) if name else nullcontext():  # words before numpy is imported
                report = one(name)
        except HdassistError as error:
            is_ended = len(names) == 1 and not (out.json or keep_failures)
            if out.debug or isinstance(error, UsageError) or is_ended:
                raise
            complain(error, "" if name in error.message else name)
            fault = failed(name, error) if failed else failure(command, error, **{kind: name or None})
            reports.append(
                Report(
                    command,
                    None,
                    "",
                    values=fault,
                    exit_code=error.exit_code,
                )
            )
            continue
        reports.append(report if len(names) == 1 else replace(report, line=indent(report.line, f"{name}: ")))
        if out.verbose:
            _note_time(report, begun, name)
    return reports


def _note_time(
    report: Report,
    begun: float,
    name: str,
) -> None:
    """Note on stderr how long a report took since begun [s], its residuals, and the engine that solved its states."""
    from hdassist.solve.answers import Certificate
    from hdassist.solve.walk import walk_library
    from hdassist.terminal.words import proof

    certificate = report.certificate
    note = proof(report.certificate)
    if isinstance(certificate, Certificate):
        residuals = list(vars(certificate).items())[1:]
        note += "".join(f", {name.replace('_', ' ')} {value:.1g}" for name, value in residuals)
    seconds = f"{time.monotonic() - begun:.1f} s"
    say(f"{report.subject or name}: {seconds}" + (f", {note}; engine: {walk_library()[1]}" if note else ""))


def give(
    command: str,
    reports: Sequence[Report],
    out: Output,
    *,
    more: Mapping[str, Any] | None = None,
    below: Sequence[str] = (),
) -> int:
    """Write warnings, reports as JSON, pages or lines, and tables.

    Args:
        command: for the schema of several reports.
        reports: those without a head have no page.
        out: how and if they are written.
        more: keys of JSON about all reports.
        below: lines under all pages.

    Returns the worst of their exit codes.
    """
    for report in reports:
        for text in report.warnings:
            warn(f"{report.subject}: {text}" if report.subject else text)
    if out.json:
        out.text(json_text({**combine(command, list(map(report_object, reports))), **(more or {})}))
    elif out.has_page and (pages := [report for report in reports if report.head]):
        if out.quiet:
            lines = "".join(f"{report.line}\n" for report in pages)
            out.text(out.style.text(lines) if out.style.ascii else lines)
        else:
            _give_pages(pages, out, below)
    if out.csv is not None and (tables := [report.csv for report in reports if report.csv]):
        write_text(out.csv, csv_text(tables[0][0], [row for _, rows in tables for row in rows]), out.force)
    return worst_exit_code(report.exit_code for report in reports)


def _give_pages(
    reports: Sequence[Report],
    out: Output,
    below: Sequence[str],
) -> None:
    """Write the pages of reports, an empty line between them; below: lines under all pages."""
    from rich.console import Group

    from hdassist.terminal.page import report_page

    shown = partial(
        report_page,
        style=out.style,
        plots=out.plot,
        details=out.details,
    )
    parts: list[Any] = []
    for report in reports:
        if parts:
            parts.append("")
        parts.append(made_or("page", partial(shown, report), partial(getattr, report, "line")))
    out.human(Group(*parts, *below))
