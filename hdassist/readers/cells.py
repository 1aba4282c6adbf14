"""Lines of a table as instruments and spreadsheets write them: cells, separators, decimal marks, names and remarks.

Cells stand apart by semicolons, tabs, commas or blanks. Lines that begin with #, // or % are remarks.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import chain
from typing import NamedTuple

from hdassist.plaintext import NUMBER

_QUOTED = r'"(?:[^"]|"")*"'
_LIKE = r"[-+]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eE][-+]?[0-9]+)?"
_LIKE_A_NUMBER = re.compile(_LIKE)
_MEANT = re.compile(r"[-+−.,]*[0-9]")
_NOT_FINITE = re.compile(r"[-+]?\.?(?:nan|inf|infinity)|[-+]?1\.#\w+", re.IGNORECASE)
_THOUSANDS = re.compile(r"[-+]?[0-9]+(?:[.,' ][0-9]+)*[.,][0-9]*")
_REMARK = re.compile(r'[\s"]*(?:#|//|%)[#/%]*\s*')
_ENTRY = re.compile(r"([^\W\d][^:=]{0,39}?)\s*[:=](?!\s*//)\s*(.*)")
_CELLS = {mark: re.compile(rf" *({_QUOTED}(?= *(?:{mark}|$))|[^{mark}]*)") for mark in ";\t,"}
_CELLS[" "] = re.compile(rf"({_QUOTED}(?!\S)|\S+)")
_WRITTEN = {".": re.compile(NUMBER), ",": re.compile(NUMBER.replace(r"\.", ","))}


class Cell(NamedTuple):
    """Text of a cell without its quotes, and the column of the line at which it begins, counted from 1."""

    text: str
    column: int


class TableLine(NamedTuple):
    """A line that is not blank: its number, its text, and the column at which a remark's words begin; 0 for none."""

    number: int
    text: str
    remark: int

    @classmethod
    def of(cls, number: int, text: str) -> TableLine:
        """A line by its number and text."""
        mark = _REMARK.match(text)
        return cls(number, text, mark.end() + 1 if mark else 0)

    @property
    def words(self) -> str:
        """Words of a remark."""
        return self.text[self.remark - 1 :].rstrip(' ;,\t"')

    @property
    def entry(self) -> tuple[str, str, int] | None:
        """Key in lower case, value and column of the value, of a remark "key: value" or "key = value"."""
        match = _ENTRY.fullmatch(self.words)
        return (match[1].strip().lower(), match[2], self.remark + match.start(2)) if match else None


def cells_of(line: str, separator: str) -> list[Cell]:
    """Cells of a line; empty ones at its end are left out."""
    cells = []
    at, end = len(line) - len(line.lstrip()), len(line.rstrip())
    while at <= end and (match := _CELLS[separator].search(line, at, end)):
        text = match[1].strip()
        if len(text) > 1 and text.startswith('"') and text.endswith('"'):
            text = text[1:-1].replace('""', '"').strip()
        cells.append(Cell(text, match.start(1) + 1))
        at = match.end() if separator == " " else (line.find(separator, match.end(), end) + 1 or end + 1)
    while cells and not cells[-1].text:
        cells.pop()
    return cells


def row_text(row: Iterable[Cell]) -> str:
    """Texts of some cells, with blanks between them."""
    return " ".join(cell.text for cell in row).strip()


def has_numbers(row: Iterable[Cell]) -> bool:
    """Whether a cell begins like a number, or is one that is not finite."""
    return any(_MEANT.match(cell.text) or _NOT_FINITE.fullmatch(cell.text) for cell in row)


def separator_of(lines: Sequence[str]) -> str:
    """Separator of the cells in most lines of numbers: a semicolon, tab, comma or blank.

    Semicolons and tabs are never part of a number, so they count before commas, and commas before blanks.
    """
    bare = [re.sub(_QUOTED, "0", line).strip() for line in lines]
    bare = [line for line in bare if _MEANT.match(line)] or bare
    for separator in ";\t":
        if 2 * sum(separator in line for line in bare) >= max(len(bare), 1):
            return separator
    by_commas = 2 * sum("," in line for line in bare) >= max(len(bare), 1)
    return "," if by_commas and 2 * sum(map(_is_apart_by_blanks, bare)) < len(bare) else " "


def _is_apart_by_blanks(line: str) -> bool:
    cells = line.split()
    return len(cells) > 1 and all(
        _LIKE_A_NUMBER.fullmatch(cell) and not cell.startswith(",") and not cell.endswith(",") for cell in cells
    )


def names_in(line: str, width: int, separator: str) -> tuple[str, ...] | None:
    """Names of the columns in a line above the rows, separated as these are or otherwise; None if they do not fit."""
    by_marks = (tuple(cell.text for cell in cells_of(line, mark)) for mark in dict.fromkeys((separator, *";\t,")))
    # a unit belongs to the name before it
    by_blanks = (tuple(re.split(apart, line.strip())) for apart in (r"\s{2,}", r"\s+(?![\[(/])(?<!/)(?<!/\s)"))
    return next((names for names in chain(by_marks, by_blanks) if len(names) == width), None)


def decimal_mark_in(text: str) -> str:
    """The one point or comma of a number; empty without one, and for any other text."""
    if ("." in text) == ("," in text) or not _LIKE_A_NUMBER.fullmatch(text):
        return ""
    return "." if "." in text else ","


def fault_of(text: str, decimal: str) -> tuple[str, str]:
    """Fault of the text of a number, and a hint, both empty where it is one; decimal, the mark of the file."""
    if _WRITTEN[decimal].fullmatch(text):
        return "", ""
    if not text:
        return "a number is missing", "a gap in the measurement cannot be filled here"
    if _NOT_FINITE.fullmatch(text):
        return "must be a finite number", "a gap in the measurement cannot be filled here"
    if decimal_mark_in(text):
        wrong, usual = ("comma", "point") if decimal == "." else ("point", "comma")
        return f"a decimal {wrong} among decimal {usual}s", f"write every number with a decimal {usual}"
    if _THOUSANDS.fullmatch(text):
        return "must be a number", "nothing between thousands, and one decimal mark"
    if "−" in text:
        return "must be a number", "write an ASCII minus sign"
    if re.match(rf"{_LIKE}\s*([^\W\d]|[°′″])", text):
        return "must be a number", "a unit stands in the line of names, like deviation [um]"
    return "must be a number", "put # in front of a line that is a remark"
