"""Output of a command: pages, JSON, CSV and files; progress; and processing of several drives or files in sequence."""

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
from hdassist.features.report import Json, Report, as_json, certificate_object, schema_of
from hdassist.interface.terminal.streams import Style, console, made_or, say, stderr_style, write_text
from hdassist.run.errors import Fault, HdassistError, UsageError, worst_exit_code
from hdassist.run.files import NUMBER, printable, visible
from hdassist.run.stops import at_stop

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from rich.console import RenderableType
    from rich.progress import Progress

    from hdassist.drive.preset.fields import Drive
    from hdassist.run.run import Run


_WIPED = b"\r\x1b[2K\x1b[?25h"  # control codes that clear the line of a bar and show the cursor
BAR_PATIENCE = 0.5  # s; duration of work after which a progress bar with a total appears
_TASK: Any = 0  # identifier of the only task of a bar
_REDRAWN = 0.1  # s; shortest time between two redraws of a bar
_BAR_STYLES = {  # replace default colours of rich, which would suggest a verdict
    **dict.fromkeys(("bar.complete", "bar.finished", "progress.remaining"), "none"),
    "bar.back": "color(245)",
    "bar.pulse": "color(250)",
}


@dataclass(frozen=True)
class Output:
    """Output of one command.

    style: abilities of the stream.
    target: file of the result, "-" for standard output.
    csv: file of the table as CSV.
    force: whether existing files may be replaced.
    no_color: whether colours are disabled.
    plot, details: whether pages contain figures and all details.
    json, quiet: whether the result is JSON or a single line.
    has_page: whether there are pages or lines; there are none if a file uses standard output.
    verbose: whether durations are reported.
    debug: whether the first error ends the command.
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
    _bars: list[ProgressBar] = field(default_factory=list)  # the bar in use, if any

    def human(self, answer: RenderableType) -> None:
        """Write a result in readable form, with colours if the stream accepts them."""
        if self.style.codes:
            console(sys.stdout, self.style).print(answer)
            return
        self.text(self.page(answer))

    def page(self, answer: RenderableType) -> str:
        """Return a result in readable form as plain text."""
        page = io.StringIO()
        console(page, replace(self.style, codes=False)).print(answer)
        return "\n".join(line.rstrip() for line in page.getvalue().splitlines()).rstrip() + "\n"

    def text(self, answer: str) -> None:
        """Write a text to the file of the result, with hidden characters escaped."""
        write_text(self.target, visible(answer), self.force)

    @contextmanager
    def run(
        self,
        words: str,
        states: int,
        options: object,
    ) -> Iterator[Run]:
        """Yield a run for solving a number of states, with a progress bar.

        The options of the command determine processes, seed and cross-check solver. If they name a solver for all
        states, the work is done in this process, because this solver is slow and its progress must be visible.

        words: text beside the bar.
        states: number of states.
        options: options of the command.
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
        """Yield the executor named in the options of a command; None if they name none."""
        from hdassist.drive.solve.walk import installation
        from hdassist.run.run import cluster

        if not (name := getattr(options, "executor", None)):
            yield None
            return
        with cluster(name, getattr(options, "jobs", 0), installation) as engine:
            yield engine

    @contextmanager
    def workers(self, options: object) -> Iterator[Executor]:
        """Yield the executor named in the options of a command, or else an executor of processes on this machine."""
        from hdassist.run.run import workers

        with (
            self.engine(options) as engine,
            nullcontext(engine) if engine else workers(getattr(options, "jobs", 0)) as new_engine,
        ):
            yield new_engine

    @contextmanager
    def progress(self, words: str, total: int | None = None) -> Iterator[ProgressBar]:
        """Yield a progress bar with the remaining time; only a terminal shows the bar.

        Without a total, the bar appears at once; with a total, it appears after BAR_PATIENCE. Within the context of
        another bar, the other bar continues with the new text and total.

        words: text beside the bar.
        total: total amount of work, None if it is not known yet.
        """
        if self._bars:
            self._bars[0].expect(words, total)
            yield self._bars[0]
            return
        style = stderr_style(no_color=self.no_color)
        bar = ProgressBar(_bar(style) if style.codes else None, style)
        self._bars.append(bar)
        try:
            with at_stop(bar.wipe):  # the bar is cleared even if the process is stopped
                bar.expect(words, total)
                yield bar
        finally:
            self._bars.clear()
            bar.end()


class ProgressBar:
    """Progress bar of a single task; a call with an amount of completed work advances the bar.

    bar: progress bar of rich; None if standard error is not a terminal.
    style: style of the text.
    """

    def __init__(self, bar: Progress | None, style: Style) -> None:
        self._bar = bar
        self._style = style
        self._next = time.monotonic() + BAR_PATIENCE  # earliest time of the next redraw

    def __call__(self, done: int) -> None:
        """Advance the bar; done: amount of work completed since the last call."""
        if self._bar:
            self._bar.advance(_TASK, done)
            if (now_s := time.monotonic()) > self._next:
                self._next = now_s + _REDRAWN
                self._bar.start()
                self._bar.refresh()

    def expect(self, words: str, total: int | None = None) -> None:
        """Restart the bar with a text and a total; without a total, the bar appears at once."""
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
        """Clear the line of the bar before the process ends."""
        if self._bar and self._bar.live.is_started:
            os.write(2, _WIPED)  # written directly, because rich escapes control codes while its bar is shown

    def end(self) -> None:
        """Remove the bar."""
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
        auto_refresh=False,  # avoids a thread, because a process with threads must not be forked
        redirect_stdout=sys.stdout.isatty(),  # keeps lines printed on the terminal above the bar
    )


def complain(error: HdassistError, about: str = "") -> None:
    """Write an error with its hint to standard error; about: name of the item that caused the error."""
    where = f"{about}: " if about else ""
    say(f"error: {where}{error.message}\n  hint: {with_code(error.hint, error.fault)}")


def with_code(hint: str, fault: Fault) -> str:
    """Return a hint followed by the command that explains the kind of error."""
    return f"{hint} (hdassist explain {fault})" if hint else f"hdassist explain {fault}"


def warn(text: str) -> None:
    """Write a warning to standard error."""
    say(f"warning: {text}")


FORMULA = tuple("=+-@\t\n＝＋－＠")  # characters that start a formula in a spreadsheet
_NUMBER = re.compile(NUMBER)


def _head(command: str) -> Json:
    return {"schema": schema_of(command), "version": __version__}


def envelope(
    command: str,
    drive: Drive | None,
    exit_code: int = 0,
    warnings: Sequence[str] = (),
) -> Json:
    """Return the keys that the JSON results of all commands share; drive: subject of the result, if it is a drive."""
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
    """Return the JSON object of a report, with its certificate if it has one."""
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
    """Return the JSON result for a preset or a file that could not be processed.

    command: name of the command.
    error: error that prevented the processing.
    preset: requested preset, None if a file was requested.
    file: requested file, None if a preset was requested.
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
    """Return a single result unchanged, or one JSON object that contains the list of several results."""
    return results[0] if len(results) == 1 else together(command, results)


def together(command: str, results: Sequence[Json]) -> Json:
    """Return one JSON object that contains the list of results and the worst of their exit codes."""
    return {
        **_head(command),
        "exit_code": worst_exit_code(result["exit_code"] for result in results),
        "warnings": [],
        "results": list(results),
    }


def json_text(answer: Json) -> str:
    """Return a result as JSON text; NaN and Infinity raise ValueError because JSON has no such numbers."""
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
    """Return a table as CSV with one header line and numbers in full precision; missing values are empty.

    In texts, hidden characters are escaped, and an apostrophe precedes anything that a spreadsheet would evaluate.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(_cell, header))
    writer.writerows(map(_cell, row) for row in rows)
    return text.getvalue()


def _cell(value: Any) -> Any:
    """Return the cell of a CSV file: a number unchanged, and a text so that no spreadsheet evaluates it."""
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
    """Return the reports on presets or files in sequence; the report on a failed item contains its error.

    For several items, each line for -q begins with the name of the item.

    command: command named in the schema of failures.
    names: presets or files.
    one: function that returns the report on an item.
    out: output of the command.
    kind: kind of the items.
    failed: function that returns the JSON result of a failed item, None for the usual result.
    keep_failures: whether the error of a single item gives a report even if JSON was not requested.
    Raises any UsageError at once. Raises other errors only for a single item, or with --debug.
    """
    reports: list[Report] = []
    for name in names:
        begun = time.monotonic()
        try:
            with out.progress(name) if name else nullcontext():  # the name is shown while numpy is imported
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
    """Write the duration of a report, its residuals and its engine to standard error; begun: starting time [s]."""
    from hdassist.drive.solve.answers import Certificate
    from hdassist.drive.solve.walk import walk_library
    from hdassist.interface.terminal.words import proof

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
    """Write the warnings, the reports (as JSON, pages or lines) and the CSV table, and return the worst exit code.

    command: command named in the schema of several reports.
    reports: reports; a report without a head has no page.
    out: output of the command.
    more: additional JSON keys that concern all reports.
    below: lines printed below all pages.
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
    """Write the pages of reports, separated by empty lines; below: lines printed below all pages."""
    from rich.console import Group

    from hdassist.interface.terminal.page import report_page

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
