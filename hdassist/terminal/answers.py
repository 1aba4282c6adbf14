"""Answers for scripts: the keys around the figures of every JSON answer, JSON and CSV as text."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterable, Sequence
from numbers import Number
from typing import TYPE_CHECKING, Any

from hdassist.errors import HdassistError
from hdassist.json_parts import Json, as_json, certificate_object, schema_of
from hdassist.plaintext import NUMBER, printable, visible
from hdassist.verdict import worst_exit_code
from hdassist.version import __version__

if TYPE_CHECKING:
    from hdassist.preset.fields import Drive
    from hdassist.report import Report

FORMULA = tuple("=+-@\t\n＝＋－＠")  # by which a spreadsheet knows one
_NUMBER = re.compile(NUMBER)


def envelope(command: str, drive: Drive | None, exit_code: int = 0, warnings: Sequence[str] = ()) -> Json:
    """Keys common to all answers of a command; drive, the subject of the answer, None without one."""
    origin = drive.origin if drive else None
    return {
        "schema": schema_of(command),
        "version": __version__,
        "preset": {
            "name": drive.name if drive else None,
            "sha256": origin.sha256 if origin else None,
            "overrides": list(origin.overrides) if origin else [],
        },
        "exit_code": exit_code,
        "warnings": list(warnings),
    }


def report_object(report: Report) -> Json:
    """A report as a JSON object."""
    answer = envelope(report.command, report.drive, report.exit_code, report.warnings) | report.values
    if report.certificate:
        answer["certificate"] = certificate_object(report.certificate, report.cross_checks)
    return {key: as_json(value) for key, value in answer.items()}


def failure(command: str, error: HdassistError, *, preset: str | None = None, file: str | None = None) -> Json:
    """The answer about a drive or a file that has none: its error.

    Arguments: command; error; preset and file, the names asked for.
    """
    return {
        "schema": schema_of(command),
        "version": __version__,
        "preset": {"name": preset, "sha256": None},
        **({} if file is None else {"file": {"name": file, "sha256": None}}),
        "exit_code": error.exit_code,
        "warnings": [],
        "error": {"code": str(error.fault), "message": error.message, "hint": error.hint},
    }


def combine(command: str, results: Sequence[Json]) -> Json:
    """One object for all drives: the answer itself where there is one, else a list of them."""
    return results[0] if len(results) == 1 else together(command, results)


def together(command: str, results: Sequence[Json]) -> Json:
    """One object with a list of answers, be it one or many; its exit code is the worst of theirs."""
    return {
        "schema": schema_of(command),
        "version": __version__,
        "exit_code": worst_exit_code(result["exit_code"] for result in results),
        "warnings": [],
        "results": list(results),
    }


def json_text(answer: Json) -> str:
    """An answer as text; never NaN or Infinity."""
    return printable(json.dumps(answer, indent=2, ensure_ascii=True, allow_nan=False)) + "\n"


def csv_text(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A table as CSV: one header line, plain newlines, full precision, empty where there is no value.

    Text cannot act: hidden characters are escaped, and an apostrophe stands before formulas of spreadsheets.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(_cell, header))
    writer.writerows(map(_cell, row) for row in rows)
    return text.getvalue()


def _cell(value: Any) -> Any:
    """A cell: numbers as they are, text made harmless."""
    if value is None or isinstance(value, Number):
        return "" if value is None else value
    text = visible(str(value))
    return f"'{text}" if text.startswith(FORMULA) and not _NUMBER.fullmatch(text) else text
