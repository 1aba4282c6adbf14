"""Lines of delimited text: which of them are comments, what separates their cells, and whether a cell is a number."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from hdassist.preset.yamltext import NUMBER

_QUOTED = r'"(?:[^"]|"")*"'
_LIKE = r"[-+]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eE][-+]?[0-9]+)?"
_LIKE_A_NUMBER = re.compile(_LIKE)
_MEANT = re.compile(r"[-+−.,]*[0-9]")
_NOT_FINITE = re.compile(r"[-+]?\.?(?:nan|inf|infinity)|[-+]?1\.#\w+", re.IGNORECASE)
_THOUSANDS = re.compile(r"[-+]?[0-9]+(?:[.,' ][0-9]+)*[.,][0-9]*")
_COMMENT = re.compile(r"(?:#|//|%)[#/%]*")
_APART = re.compile(rf"{_QUOTED}\s*[;,\t].*")
_CELL = {mark: re.compile(rf" *({_QUOTED}(?= *(?:{mark}|$))|[^{mark}]*)") for mark in ";\t,"}
_BETWEEN_BLANKS = re.compile(rf"{_QUOTED}(?!\S)|\S+")
_WRITTEN = {".": re.compile(NUMBER), ",": re.compile(NUMBER.replace(r"\.", ","))}
_BY_BLANKS = re.compile(rf"(?:{_QUOTED}|{_LIKE})(?:\s+(?:{_QUOTED}|{_LIKE}))+")


class Cell(NamedTuple):
    """Text of a cell without its quotes, and the column of the line at which it begins, counted from 1."""

    text: str
    column: int


def comment_in(line: str) -> str | None:
    """Text of a comment without its marks; None for a line that is no comment.

    A line in quotes is one unless its quotes are those of cells: "Wheel 17 is, "1";"2,5" is not.
    """
    line = line.strip()
    if mark := _COMMENT.match(line):
        return line[mark.end() :].strip()
    if not line.startswith('"'):
        return None
    inner = line.strip('";,\t ')
    if mark := _COMMENT.match(inner):  # a comment that a spreadsheet has put in quotes
        return inner[mark.end() :].strip()
    is_row = _APART.fullmatch(line) or _BY_BLANKS.fullmatch(line) or is_meant_as_number(inner)
    return None if is_row else inner


def separator_of(lines: Sequence[str]) -> str:
    """What separates the cells of most lines of numbers: a semicolon, tab, comma or blank.

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


def split(line: str, separator: str) -> list[Cell]:
    """Cells of a line; empty ones at its end are left out."""
    cells: list[Cell]
    if separator == " ":
        cells = [Cell(_unquoted(found[0]), found.start() + 1) for found in _BETWEEN_BLANKS.finditer(line)]
    elif '"' not in line:
        cells, at = [], len(line) - len(line.lstrip())
        for text in line.strip().split(separator):
            cells.append(Cell(text.strip(), at + len(text) - len(text.lstrip()) + 1))
            at += len(text) + 1
    else:
        cells, at, end = [], len(line) - len(line.lstrip()), len(line.rstrip())
        pattern = _CELL[separator]
        while at <= end:
            found = pattern.match(line, at, end)
            assert found is not None
            cells.append(Cell(_unquoted(found[1].strip()), found.start(1) + 1))
            at = line.find(separator, found.end(), end) + 1 or end + 1
    while cells and not cells[-1].text:
        cells.pop()
    return cells


def _unquoted(text: str) -> str:
    quoted = len(text) > 1 and text.startswith('"') and text.endswith('"')
    return text[1:-1].replace('""', '"').strip() if quoted else text


def names_in(line: str, width: int, separator: str) -> tuple[str, ...] | None:
    """Names of the columns in a line above the rows, separated as these are or otherwise; None if they do not fit."""
    for other in dict.fromkeys((separator, ";", "\t", ",")):
        names = tuple(cell.text for cell in split(line, other))
        if len(names) == width:
            return names
    for pattern in (r"\s{2,}", r"\s+(?![\[(/])(?<!/)(?<!/\s)"):  # a unit belongs to the name before it
        names = tuple(re.split(pattern, line.strip()))
        if len(names) == width:
            return names
    return None


def is_meant_as_number(text: str) -> bool:
    """Whether a cell begins like a number, or is one that is not finite."""
    return bool(_MEANT.match(text) or _NOT_FINITE.fullmatch(text))


def decimal_mark_in(text: str) -> str:
    """The one point or comma of a number; empty without one, and for what is no number."""
    if ("." in text) == ("," in text) or not _LIKE_A_NUMBER.fullmatch(text):
        return ""
    return "." if "." in text else ","


def fault_of(text: str, decimal: str) -> tuple[str, str]:
    """Why a cell is no number, and a hint; both empty if it is one. Decimal is the mark of the file."""
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
    if re.match(rf"{_LIKE}\s*[^\W\d]", text):
        return "must be a number", "a unit stands in the line of names, like deviation [um]"
    return "must be a number", "put # in front of a line that is a remark"
