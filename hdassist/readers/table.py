"""Delimited text, as instruments write it, to rows of numbers with their places.

Columns stand apart by semicolons, tabs, commas or blanks. Decimals have a point, or a comma throughout the file
unless commas separate its columns. Lines that begin with #, //, % or an unpaired " are comments; "key: value" and
"key = value" in them are returned. One line of names may stand above the rows, as a comment too.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import NamedTuple

from hdassist.errors import Finding, PresetError
from hdassist.preset.yamltext import Mark, shown
from hdassist.readers.cells import (
    Cell,
    comment_in,
    decimal_mark_in,
    fault_of,
    is_meant_as_number,
    names_in,
    separator_of,
    split,
)
from hdassist.textfile import decode

MAX_BYTES = 5_000_000
MAX_LINE = 10_000  # characters
_LINE_END = re.compile(r"\r\n|\r|\n")
_ENTRY = re.compile(r"([^\W\d][^:=]{0,39}?)\s*[:=]\s*(.*)")
_FOREIGN = re.compile("[\x80-\xff]{3}")  # in Latin-1: letters of another code page


class Entry(NamedTuple):
    """A value that a comment states: key in lower case, the value, and where it stands."""

    key: str
    value: str
    mark: Mark


class Row(NamedTuple):
    """One row: the number of its line, its numbers, and the column at which each one begins."""

    line: int
    numbers: tuple[float, ...]
    columns: tuple[int, ...]


@dataclass
class NumberTable:
    """What a file says: names of the columns (none without a line of names), rows, entries, and what is wrong."""

    file: str
    separator: str = ""  # of its columns, once there are rows
    decimal: str = "."
    names: tuple[str, ...] = ()
    names_line: int = 1
    names_in_comment: bool = False
    rows: list[Row] = field(default_factory=list)
    entries: list[Entry] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)

    def name(self, column: int) -> str:
        """Name of a column (from 0), for messages."""
        return self.names[column] if column < len(self.names) else f"column {column + 1}"

    def add(self, line: int, column: int, path: str, message: str, got: str = "", hint: str = "") -> None:
        """Note what is wrong at a place."""
        self.findings.append(Finding(self.file, line, column, shown(path), message, shown(got), hint))


def parse(data: bytes, file: str, needs: Sequence[str] = (), at_most: int = MAX_BYTES) -> NumberTable:
    """Read a table of numbers; what is wrong with it ends up in the findings, nothing is raised.

    Arguments: data; file, its name in messages; needs, what the columns are to hold, at least as many as there
    must be; at_most, the number of bytes that the file may have. Result: the table, with rows of equal length
    if there are no findings.
    """
    table = NumberTable(file)
    try:
        text, latin = decode(data, file, at_most)
    except PresetError as error:
        table.findings.extend(error.findings)
        return table
    _Parser(table, needs, latin).run(text)
    return table


class _Parser:
    def __init__(self, table: NumberTable, needs: Sequence[str], latin: bool) -> None:
        self.table, self.needs, self.latin = table, needs, latin
        self.lines: list[tuple[int, str]] = []
        self.above = (0, "")  # the last comment above the first line that is none
        if latin:
            table.notes.append("not UTF-8: read as Latin-1")

    def run(self, text: str) -> None:
        for number, line in enumerate(_LINE_END.split(text), 1):
            if not line.strip(' ;,\t"'):
                continue
            if len(line) > MAX_LINE:
                self.table.add(number, 1, "", f"a line of {len(line)} characters", line, "one row on each line")
                continue
            comment = comment_in(line)
            if comment is None:
                self.lines.append((number, line))
            elif not self._entry(number, line, comment) and not self.lines:
                self.above = (number, comment)
        separator = separator_of([line for _, line in self.lines])
        cells = [(number, split(line, separator)) for number, line in self.lines]
        texts = {number for number, row in cells if not any(is_meant_as_number(cell.text) for cell in row)}
        if len(texts) == len(cells):
            if self.table.findings:
                return
            first = self.lines[0] if self.lines else (1, "")
            hint = f"rows of {', '.join(self.needs)}" if self.needs else "is this the file with the table?"
            self.table.add(first[0], 1, "", "no rows of numbers in the file", first[1].strip(), hint)
            return
        head = self.lines[0] if self.lines[0][0] in texts else (0, "")
        for number, row in cells:
            if number in texts and number != head[0]:
                hint = "put # in front of it; only one line of names, above the rows"
                self.table.add(number, row[0].column, "", "a line of text among the rows", _words(row), hint)
        self._rows([(number, row) for number, row in cells if number not in texts], head, separator)

    def _entry(self, number: int, line: str, comment: str) -> bool:
        found = _ENTRY.fullmatch(comment)
        if found is None or found[2].startswith("//"):
            return False
        column = line.index(comment) + 1
        self._readable(number, column, found[1])
        value = found[2].strip(' ;,\t"')
        self.table.entries.append(Entry(found[1].strip().lower(), value, Mark(number, column + found.start(2))))
        return True

    def _readable(self, number: int, column: int, name: str) -> None:
        if self.latin and _FOREIGN.search(name):
            self.table.add(number, column, "", "a name that is not UTF-8 text", name, "save the file as UTF-8")

    def _rows(self, rows: list[tuple[int, list[Cell]]], head: tuple[int, str], separator: str) -> None:
        width = Counter(len(row) for _, row in rows).most_common(1)[0][0]
        first, cells = rows[0]
        if width < len(self.needs):
            need = f"needs {len(self.needs)}: {', '.join(self.needs)}"
            hint = "columns stand apart by ; or , or tabs or blanks"
            self.table.add(first, 1, "", f"{width} column, {need}", _words(cells), hint)
            return
        self.table.separator = separator
        self._head(head, width, separator)
        for number, row in rows:
            if len(row) != width:
                hint = "a decimal comma? separate the columns by ;" if separator == "," else "one cell for each column"
                wrong = f"a row of {len(row)}, most rows have {width} columns"
                self.table.add(number, row[0].column, "", wrong, _words(row), hint)
        texts = [cell.text for _, row in rows for cell in row]
        if separator == "," and width > 2 and not self.table.names and not any(set(text) & set(".,") for text in texts):
            hint = "separate the columns by ; or write a line of names above them"
            self.table.add(first, 1, "", "commas between columns, or decimal commas?", ",".join(texts[:width]), hint)
            return
        self._numbers(rows)

    def _head(self, head: tuple[int, str], width: int, separator: str) -> None:
        written = bool(head[0])
        number, line = head if written else self.above
        names = names_in(line, width, separator) if number else None
        if names is not None:
            self.table.names, self.table.names_line = names, number
            self.table.names_in_comment = not written
            for name in names:
                self._readable(number, 1, name)
        elif written:
            hint = "one name for each column, separated as the rows are"
            self.table.add(number, 1, "", f"the line of names does not fit {width} columns", line.strip(), hint)

    def _numbers(self, rows: list[tuple[int, list[Cell]]]) -> None:
        marks = Counter(decimal_mark_in(cell.text) for _, row in rows for cell in row)
        self.table.decimal = decimal = "," if marks[","] > marks["."] else "."
        for line, row in rows:
            numbers = tuple(self._number(line, index, cell, decimal) for index, cell in enumerate(row))
            self.table.rows.append(Row(line, numbers, tuple(cell.column for cell in row)))

    def _number(self, line: int, index: int, cell: Cell, decimal: str) -> float:
        message, hint = fault_of(cell.text, decimal)
        value = float("nan") if message else float(cell.text.replace(decimal, "."))
        if not message and not isfinite(value):
            message, hint = "must be a finite number", "is this cell right?"
        if message:
            self.table.add(line, cell.column, self.table.name(index), message, cell.text or "nothing", hint)
        return value


def _words(row: list[Cell]) -> str:
    return " ".join(cell.text for cell in row).strip()
