"""What the columns of a lot are for, told by their names.

serial, preset, measured or measured@80 (a file), NAME[@TORQUE] (a value with its uncertainty, measured otherwise),
limit NAME[@TORQUE], section.key (an override of the preset). Names that begin with # or note are not used.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from hdassist.acceptance.limit_parser import is_named
from hdassist.errors import Finding, PresetError, UsageError
from hdassist.preset.fields import field_table
from hdassist.preset.kinds import is_number
from hdassist.preset.overrides import path_of
from hdassist.preset.yamltext import near
from hdassist.readers.table import TextTable

_LIMIT = re.compile(r"limits?[\s:_]+(.+)", re.IGNORECASE)
_AT = re.compile(r"measured\s*@\s*(.+)", re.IGNORECASE)
_UNUSED = re.compile(r"#|note", re.IGNORECASE)


@dataclass(frozen=True)
class Column:
    """What a column is for, and what stands in front of its cells where the command line would have it."""

    kind: Literal["serial", "preset", "measured", "values", "limits", "overrides"]
    prefix: str = ""


PLAIN: dict[str, Column] = {column.kind: column for column in (Column("serial"), Column("preset"), Column("measured"))}


def columns_of(table: TextTable) -> list[Column | None]:
    """Columns of a table; None for those that are not used. Raises PresetError: every name that cannot be meant."""
    findings: list[Finding] = []
    columns: list[Column | None] = []
    first: dict[Column, int] = {}
    for place, name in enumerate(table.names, 1):
        column = None
        if name.text and not _UNUSED.match(name.text):
            column, hint = _column(name.text)
            if column is None:
                message, hint = "no such column", hint or "section.key, limit NAME@TORQUE, or note for what is not used"
                findings.append(Finding(table.file, table.names_line, name.column, name.text, message, hint=hint))
            elif first.setdefault(column, place) != place:
                message = f"column {first[column]} is the same"
                findings.append(Finding(table.file, table.names_line, name.column, name.text, message))
        columns.append(column)
    if not any(columns) and not findings:
        findings.append(Finding(table.file, table.names_line, 1, "", "no column that is used", hint=", ".join(PLAIN)))
    if findings:
        raise PresetError(findings)
    return columns


def _column(name: str) -> tuple[Column | None, str]:
    """What a column is for, or a hint."""
    if plain := PLAIN.get(name.lower()):
        return plain, ""
    if at := _AT.fullmatch(name):
        return (Column("measured", f"{float(at[1]):g}:"), "") if is_number(at[1]) else (None, "like measured@80")
    limit = _LIMIT.fullmatch(name)
    for option, text in (("--limit", limit[1] if limit else ""), ("--value", name)):
        try:
            if text and is_named(text, option):
                return Column("limits" if limit else "values", f"{text}="), ""
        except UsageError as error:
            return None, error.hint or error.message
    if ".".join(map(str, path_of(name)[:2])) in field_table():
        return Column("overrides", f"{name}="), ""
    known = [*PLAIN, *field_table(), "F_ior@80", "limit F_ior@80", "measured@80"]
    return None, near(name, known)
