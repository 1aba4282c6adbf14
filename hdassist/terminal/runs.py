"""The run of a command: over drives or files, one after the other, and out in the form that was asked for."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from hdassist.errors import HdassistError, UsageError
from hdassist.files import is_written
from hdassist.json_parts import Json
from hdassist.report import Report
from hdassist.terminal.answers import combine, csv_text, failure, json_text, report_object
from hdassist.terminal.console import made_or
from hdassist.terminal.files import write_text
from hdassist.terminal.options import PageOptions
from hdassist.terminal.output import Output, complain, note, warn
from hdassist.verdict import worst_exit_code

if TYPE_CHECKING:
    from rich.console import RenderableType


def run_each(
    command: str,
    names: Sequence[str],
    one: Callable[[str], Report],
    options: PageOptions,
    *,
    failed: Callable[[str, HdassistError], Json] | None = None,
    keep_failures: bool = False,
) -> list[Report]:
    """Reports on presets or files one after the other; the error of one is its answer, and the others go on.

    Arguments: command, for the schema of failures; names, of presets or files; one, its report;
    options; failed, the JSON of one without an answer; keep_failures, whether the fault of the only one is an answer
    too where no JSON is asked for.
    Raises UsageError at once, the error of the only one, and with --debug any error.
    """
    kept = options.json or keep_failures
    reports: list[Report] = []
    for name in names:
        begun = time.monotonic()
        try:
            report = one(name)
        except HdassistError as error:
            if options.debug or isinstance(error, UsageError) or (len(names) == 1 and not kept):
                raise
            complain(error, "" if name in error.message else name)
            fault = failed(name, error) if failed else failure(command, error, preset=name or None)
            reports.append(Report(command, None, "", values=fault, exit_code=error.exit_code))
            continue
        reports.append(report)
        if getattr(options, "verbose", False):
            note_time(report, begun, name)
    return reports


def give_failure(command: str, error: HdassistError, options: PageOptions) -> None:
    """Write the error that ended a command as its JSON, unless its answer is there. Raises UsageError and DataError."""
    if not is_written(options.answer_file):
        answer = failure(command, error, preset=getattr(options, "preset", None))
        write_text(options.answer_file, json_text(answer), options.force)


def note_time(report: Report, begun: float, name: str = "") -> None:
    """Note on stderr how long a report took since begun [s], its residuals, and the engine that solved its states."""
    from hdassist.solve.answers import Certificate
    from hdassist.solve.walk import walk_library
    from hdassist.terminal.words import proof

    found, words = report.certificate, proof(report.certificate)
    if isinstance(found, Certificate):
        words += "".join(f", {name.replace('_', ' ')} {value:.1g}" for name, value in list(vars(found).items())[1:])
    seconds = f"{time.monotonic() - begun:.1f} s"
    note(f"{report.subject or name}: {seconds}" + (f", {words}; engine: {walk_library()[1]}" if words else ""))


def give(
    command: str,
    reports: Sequence[Report],
    options: PageOptions,
    out: Output,
    *,
    more: Mapping[str, Any] | None = None,
    below: Sequence[str] = (),
) -> int:
    """Write warnings, reports as JSON, pages or lines, and tables; returns the worst of their exit codes.

    Arguments: command, for the schema of several; reports, of which those without a head have no page; options; out;
    more, keys of JSON about all of them; below, lines under all pages.
    """
    for report in reports:
        for text in report.warnings:
            warn(f"{report.subject}: {text}" if report.subject else text)
    if options.json:
        out.text(json_text({**combine(command, list(map(report_object, reports))), **(more or {})}))
    elif pages := [report for report in reports if report.head]:
        if getattr(options, "quiet", False):
            if out.csv != "-":
                out.text("".join(f"{report.line}\n" for report in pages))
        else:
            from rich.console import Group

            made = [made_or("page", partial(_page, each, out), partial(getattr, each, "line")) for each in pages]
            out.human(Group(*[part for page in made for part in (page, "")][:-1], *below))
    if out.csv is not None and (tables := [report.csv for report in reports if report.csv]):
        out.figures(csv_text(tables[0][0], [row for _, rows in tables for row in rows]))
    return worst_exit_code(report.exit_code for report in reports)


def _page(report: Report, out: Output) -> RenderableType:
    from hdassist.terminal.page import report_page

    return report_page(report, out.style, plots=out.plots, details=out.details)
