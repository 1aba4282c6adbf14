"""Long tables of numbers as arrays: parts without fault are read fast, the others with care, to name their faults.

The first lines are read by `numbertable.parse`, which settles names, separator and decimal mark. A part of the rest
that is nothing but rows of numbers goes through numpy; any other part goes through `parse`, behind the first lines.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import PresetError
from hdassist.preset.yamltext import MAX_FINDINGS, in_order
from hdassist.readers.table import NumberTable, parse
from hdassist.textfile import decode

HEAD = 300  # lines that settle what the file is like
PART = 5000  # lines that are read at once


@dataclass(frozen=True, eq=False)
class Columns:
    """A table: values, shape (rows, columns), and the number of the line of each row, shape (rows,)."""

    file: str
    names: tuple[str, ...]
    names_line: int
    lines: NDArray[np.int64]
    values: NDArray[np.float64]
    notes: list[str] = field(default_factory=list)

    def name(self, column: int) -> str:
        """Name of a column (from 0), for messages."""
        return self.names[column] if column < len(self.names) else f"column {column + 1}"


def read_columns(data: bytes, file: str, needs: Sequence[str], at_most: int) -> Columns:
    """Read a table of numbers into arrays.

    Arguments: data; file, its name in messages; needs, what the columns are to hold, at least as many as there
    must be; at_most, the number of bytes that the file may have. Raises PresetError: every fault of the file, the
    first hundred of very many.
    """
    text, latin = decode(data, file, at_most)
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    lines = HEAD
    while True:
        end = _after(text, lines)
        head = parse(text[:end].encode(), file, needs, at_most)
        if len(head.rows) > HEAD // 2 or end >= len(text):
            break
        lines *= 4
    findings, start = list(head.findings), text.count("\n", 0, end)
    values, places = [], []
    if head.rows and not findings:
        values, places = [_numbers(head, 0)], [_places(head, 0, 0)]
    for first, part in _parts(text, end, start) if head.separator else ():
        rows = _fast(part, head)
        if rows is not None:
            values.append(rows)
            places.append(np.arange(first, first + len(rows)))
            continue
        table = parse((text[:end] + part).encode(), file, needs, at_most)
        findings += [replace(f, line=f.line + first - 1 - start) for f in table.findings if f.line > start]
        if len(findings) > MAX_FINDINGS:
            break
        if not findings and table.rows[-1].line > start:
            values.append(_numbers(table, start))
            places.append(_places(table, start, first - 1 - start))
    if findings:
        raise PresetError(in_order(findings))
    notes = [*(["not UTF-8: read as Latin-1"] if latin else []), *head.notes]
    return Columns(file, head.names, head.names_line, np.concatenate(places), np.concatenate(values), notes)


def _after(text: str, lines: int) -> int:
    """Where so many lines end."""
    at = 0
    for _ in range(lines):
        at = text.find("\n", at) + 1
        if at == 0:
            return len(text)
    return at


def _parts(text: str, at: int, before: int) -> Iterator[tuple[int, str]]:
    """Parts of a text from a place on, each with the number of its first line."""
    while at < len(text):
        guess = text.find("\n", min(len(text), at + PART * max(8, (at or 8) // max(before, 1))))
        end = guess + 1 if guess >= 0 else len(text)
        part = text[at:end]
        yield before + 1, part
        before, at = before + part.count("\n"), end


def _fast(part: str, head: NumberTable) -> NDArray[np.float64] | None:
    """Rows of a part, shape (rows, columns), if it is nothing but rows of finite numbers; else None."""
    separator = head.separator
    if '"' in part:
        part = part.replace('"', "")
    if separator != "," and head.decimal == ",":
        if "." in part:
            return None
        part = part.replace(",", ".")
    if separator != " " and f"{separator}\n" in part:
        part = part.replace(f"{separator}\n", "\n")
    lines = part.rstrip("\n").split("\n")
    if not all(lines):
        return None
    try:
        rows = np.loadtxt(lines, delimiter=None if separator == " " else separator, comments=None, ndmin=2)
    except ValueError:
        return None
    width = len(head.rows[0].numbers)
    return rows if rows.shape == (len(lines), width) and bool(np.isfinite(rows).all()) else None


def _numbers(table: NumberTable, after: int) -> NDArray[np.float64]:
    rows = [row.numbers for row in table.rows if row.line > after]
    return np.array(rows).reshape(len(rows), len(table.rows[0].numbers))


def _places(table: NumberTable, after: int, shift: int) -> NDArray[np.int64]:
    return np.array([row.line + shift for row in table.rows if row.line > after], dtype=np.int64)
