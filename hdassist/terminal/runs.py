"""The run of a command: over drives or files, one after the other, and out in the form that was asked for."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from hdassist.errors import HdassistError, UsageError
from hdassist.json_parts import Json
from hdassist.report.report import CsvTable as CsvTable
from hdassist.report.report import Report
from hdassist.terminal.answers import combine, csv_text, failure, json_text, report_object
from hdassist.terminal.console import Style, made_or
from hdassist.terminal.options import AnswerOptions
from hdassist.terminal.output import Output, complain, note, warn
from hdassist.verdict import worst_exit_code

if TYPE_CHECKING:
    from rich.console import RenderableType


@dataclass(frozen=True)
class Answer:
    """What a command has to say of one drive or file, in each form that may be asked for; a form is made when it is.

    to_json: the object with its envelope; page: for people, None where there is nothing but an error; summary_line:
    the answer alone; figures: a table for CSV; about: what warnings and times are said of; warnings; proof: what
    -v says behind the time; exit_code.
    """

    to_json: Callable[[], Json]
    page: Callable[[Style], RenderableType] | None = None
    summary_line: Callable[[], str] = str
    figures: Callable[[], CsvTable] | None = None
    about: str = ""
    warnings: Sequence[str] = ()
    proof: object = ""
    exit_code: int = 0


def answer_of(report: Report, *, plots: bool = True, details: bool = False) -> Answer:
    """A report as an answer; plots, whether figures are drawn; details, whether all of it is shown."""

    def page(style: Style) -> RenderableType:
        from hdassist.terminal.page import report_page

        return report_page(report, style, plots=plots, details=details)

    csv = report.csv
    return Answer(
        lambda: report_object(report), page, lambda: report.line, (lambda: csv) if csv else None,
        report.about or (report.drive.name if report.drive else ""), report.warnings,
        report.certificate or report.proof, report.exit_code,
    )  # fmt: skip


def run_each(
    command: str,
    names: Sequence[str],
    one: Callable[[str], Answer],
    options: AnswerOptions,
    *,
    failed: Callable[[str, HdassistError], Json] | None = None,
    keep_failures: bool | None = None,
) -> list[Answer]:
    """Answers for presets or files one after the other; what is wrong with one is its answer, and the others go on.

    Arguments: command, for the schema of failures; names, of presets or files; one, what there is to say of it;
    options; failed, the JSON of one without an answer; keep_failures, whether the fault of the only one is an answer
    too (without it: where JSON is asked for).
    Raises UsageError at once, what is wrong with the only one, and with --debug anything.
    """
    kept = options.json if keep_failures is None else keep_failures
    answers: list[Answer] = []
    for name in names:
        begun = time.monotonic()
        try:
            answer = one(name)
        except HdassistError as error:
            if options.debug or isinstance(error, UsageError) or (len(names) == 1 and not kept):
                raise
            complain(error, "" if name in error.message else name)
            told = failed(name, error) if failed else failure(command, error, preset=name)
            answers.append(Answer(lambda told=told: told, exit_code=error.exit_code))  # type: ignore[misc]
            continue
        answers.append(answer)
        for text in answer.warnings:
            warn(f"{answer.about}: {text}" if answer.about else text)
        if options.verbose:
            proof = f", {answer.proof}" if answer.proof else ""
            note(f"{answer.about or name}: {time.monotonic() - begun:.1f} s{proof}")
    return answers


def give(
    command: str,
    answers: Sequence[Answer],
    options: AnswerOptions,
    out: Output,
    *,
    more: Mapping[str, Any] | None = None,
    below: Sequence[str] = (),
) -> int:
    """Write answers as JSON, pages or their summary lines, and their tables; returns the worst of their exit codes.

    Arguments: command, for the schema of several; answers; options; out; more, keys of JSON about all of them; below,
    lines under all pages.
    """
    if options.json:
        out.text(json_text({**combine(command, [answer.to_json() for answer in answers]), **(more or {})}))
    elif pages := [answer for answer in answers if answer.page]:
        from rich.console import Group

        if options.quiet:
            out.human("\n".join(answer.summary_line() for answer in pages))
        else:
            made = [
                made_or("page", partial(answer.page, out.style), answer.summary_line) for answer in pages if answer.page
            ]
            out.human(Group(*[part for page in made for part in (page, "")][:-1], *below))
    if out.csv is not None and (tables := [answer.figures() for answer in answers if answer.figures]):
        out.figures(csv_text(tables[0][0], [row for _, rows in tables for row in rows]))
    return worst_exit_code(answer.exit_code for answer in answers)


def give_report(report: Report, out: Output, *, json: bool) -> None:
    """Write a report that needs no drive or file, as JSON or as its page."""
    if json:
        out.text(json_text(report_object(report)))
    else:
        from hdassist.terminal.page import report_page

        out.human(report_page(report, out.style))
