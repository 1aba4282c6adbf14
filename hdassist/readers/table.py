"""Tables as instruments and spreadsheets write them, to numbers or cells of text with their places.

Cells stand apart by semicolons, tabs, commas or blanks. Decimals have a point, or a comma throughout the file unless
commas separate its cells. Lines that begin with #, // or % are remarks. One line of names may stand above the rows, in
a table of numbers as a remark too. The first rows settle what a file is like; then every row is read by the same rules.
"""

from __future__ import annotations

import re
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import Finding, PresetError
from hdassist.numerals import NUMBER
from hdassist.preset.yamltext import MAX_FINDINGS, ordered_findings, shown
from hdassist.textfile import MAX_LINE, Readable, TextFile

MOST_TABLE_BYTES = 5_000_000
SAMPLED_LINES = 300  # lines that settle what a file is like
GREATEST = 1e30  # of a number, to either side: nothing is measured beyond, and what is computed of it is still finite
MAX_REMARKS = 1000  # that are kept: more of them are no header
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
_DECIMAL_COMMA = re.compile(r"(?<=[0-9]),(?=[0-9])")

Cells = NDArray[np.float64]


class Cell(NamedTuple):
    """Text of a cell without its quotes, and the column of the line at which it begins, counted from 1."""

    text: str
    column: int


class TableLine(NamedTuple):
    """A line that is not blank: its number, its text, and the column at which a remark's words begin; 0 for none."""

    number: int
    text: str
    remark: int

    @property
    def words(self) -> str:
        """What a remark says."""
        return self.text[self.remark - 1 :].rstrip(' ;,\t"')

    @property
    def entry(self) -> tuple[str, str, int] | None:
        """The key in lower case, value and column of the value, of a remark "key: value" or "key = value"."""
        found = _ENTRY.fullmatch(self.words)
        return (found[1].strip().lower(), found[2], self.remark + found.start(2)) if found else None


@dataclass(eq=False)
class NumberTable:
    """A table of numbers, and what is wrong with it.

    values: shape (rows, columns); lines: number of the line of each row, shape (rows,). names: of the columns, none
    without a line of names. remarks: the first thousand. Values are of use only without findings.
    """

    file: str
    names: tuple[str, ...] = ()
    names_line: int = 1
    names_in_remark: bool = False
    lines: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    values: Cells = field(default_factory=lambda: np.empty((0, 0)))
    remarks: list[TableLine] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    sha256: str = ""
    is_latin: bool = False

    def name(self, column: int) -> str:
        """Name of a column (from 0), for messages."""
        return self.names[column] if column < len(self.names) else f"column {column + 1}"

    def add(self, line: int, column: int, path: str, message: str, got: str = "", hint: str = "") -> None:
        """Note what is wrong at a place."""
        self.findings.append(Finding(self.file, line, column, shown(path), message, shown(got), hint))

    def add_at(self, row: int, column: int, message: str, got: str = "", hint: str = "") -> None:
        """Note what is wrong with a row and column (from 0)."""
        self.add(int(self.lines[row]), 1, self.name(column), message, got, hint)

    def require_sound(self) -> None:
        """Raise PresetError with what is wrong, in the order of the file; the first hundred of very many."""
        if self.findings:
            raise PresetError(ordered_findings(self.findings))


@dataclass(frozen=True)
class CellTable:
    """A table of text: SHA-256 of its file, separator, names and their line, rows, and the lines that are remarks.

    rows: number of the line and its cells, as many as the line has.
    """

    file: str
    sha256: str
    separator: str
    names: tuple[Cell, ...]
    names_line: int
    rows: tuple[tuple[int, tuple[Cell, ...]], ...]
    remarks: tuple[int, ...]

    def with_points(self, text: str) -> str:
        """A cell with decimal points, where the separator leaves commas free and the cell has no list in it."""
        free = self.separator != "," and "." not in text and "[" not in text
        return _DECIMAL_COMMA.sub(".", text) if free else text


def read_texts(source: Readable, at_most: int = MOST_TABLE_BYTES, name: str = "") -> CellTable:
    """Read a table of text under a line of names, separated by semicolons, tabs or commas.

    Arguments: source, a path, stream or bytes; at_most, the bytes it may have; name of bytes and streams in messages.
    Raises DataError: a file that cannot be read; PresetError: one that has no rows, or lines that are too long.
    """
    text = TextFile(source, at_most, name)
    table = NumberTable(text.name)
    lines, remarks = [], []
    for first, part in text.parts():
        for line in _lines(first, part, table):
            if line.remark:
                remarks.append(line.number)
            else:
                lines.append(line)
    table.require_sound()
    if len(lines) < 2:
        hint = "a line of names such as serial;preset;measured, and a row for each drive"
        raise PresetError(
            [Finding(text.name, lines[0].number if lines else 1, 1, "", "no rows in the table", "", hint)]
        )
    separator = next((mark for mark in ";\t," if mark in lines[0].text), ";")
    names, *rows = ((line.number, tuple(split(line.text, separator))) for line in lines)
    return CellTable(text.name, text.sha256, separator, names[1], names[0], tuple(rows), tuple(remarks))


def read_numbers(
    source: Readable, needs: Sequence[str] = (), at_most: int = MOST_TABLE_BYTES, name: str = ""
) -> NumberTable:
    """Read a table of numbers; what is wrong with its text ends up in the findings.

    Arguments: source, a path, stream or bytes; needs, what the columns are to hold, at least as many as there must be;
    at_most, the bytes it may have; name of bytes and streams in messages. Raises DataError: a file that cannot be read.
    """
    text = TextFile(source, at_most, name)
    table = NumberTable(text.name)
    rows = _Rows(table, needs)
    try:
        for first, part in text.parts():
            rows.take(first, part)
            if len(table.findings) > MAX_FINDINGS:
                break
        else:
            rows.end()
    except PresetError as error:
        table.findings.extend(error.findings)
    table.sha256, table.is_latin = text.sha256, text.is_latin
    if text.is_latin:
        table.notes.append("not UTF-8: read as Latin-1")
    return table


class _Rows:
    """Rows of a table of numbers, taken up part after part, and what its first lines settle: how a row is written."""

    def __init__(self, table: NumberTable, needs: Sequence[str]) -> None:
        self.table, self.needs = table, needs
        self.separator, self.decimal, self.width = "", "", 0  # not settled yet
        self.waiting: list[TableLine] = []  # for the lines that settle it
        self.above: TableLine | None = None  # the last remark above the first other line that is no entry
        self.values, self.lines = array("d"), array("q")  # which grow in place, as lists of parts do not

    def take(self, first: int, part: str) -> None:
        """Take up the lines of a part of the text, the first of which has the number first."""
        if self.separator and (values := self._plain(part)) is not None:
            self._keep(values, np.arange(first, first + len(values)))
            return
        lines = []
        for line in _lines(first, part, self.table):
            if not line.remark:
                lines.append(line)
                continue
            if len(self.table.remarks) < MAX_REMARKS:
                self.table.remarks.append(line)
            if not lines and not self.waiting and not line.entry:
                self.above = line
        if self.separator:
            self._read(lines)
            return
        self.waiting += lines
        if len(self.waiting) >= SAMPLED_LINES:
            self._settle()

    def end(self) -> None:
        """Fill in the table."""
        if not self.separator:
            self._settle()
        self.table.values = np.frombuffer(self.values).reshape(-1, self.width)
        self.table.lines = np.frombuffer(self.lines, np.int64)

    def _settle(self) -> None:
        """Settle how rows are written by the first lines, and read those that have waited for it.

        Raises PresetError for what leaves no row readable.
        """
        sample = self.waiting[:SAMPLED_LINES]
        separator = separator_of([line.text for line in sample])
        cells = [split(line.text, separator) for line in sample]
        rows = [row for row in cells if _has_numbers(row)]
        first = sample[0] if sample else TableLine(1, "", 0)
        if not rows:
            hint = f"rows of {', '.join(self.needs)}" if self.needs else "is this the file with the table?"
            self._refuse(first.number, "no rows of numbers in the file", first.text.strip(), hint)
        self.width = Counter(map(len, rows)).most_common(1)[0][0]
        named = not _has_numbers(cells[0])
        row_line = next(line.number for line, row in zip(sample, cells, strict=True) if _has_numbers(row))
        if self.width < len(self.needs):
            message = f"{self.width} column, needs {len(self.needs)}: {', '.join(self.needs)}"
            self._refuse(row_line, message, _words(rows[0]), "columns stand apart by ; or , or tabs or blanks")
        self._name(first if named else self.above, separator, named)
        texts = [cell.text for row in rows for cell in row]
        bare = separator == "," and self.width > 2 and not self.table.names
        if bare and not any(set(text) & set(".,") for text in texts):
            hint = "separate the columns by ; or write a line of names above them"
            got = ",".join(texts[: self.width])
            self._refuse(row_line, "commas between columns, or decimal commas?", got, hint)
        self.separator = separator
        self._settle_decimal(rows)
        lines, self.waiting = self.waiting[named:], []
        self._read(lines)

    def _refuse(self, line: int, message: str, got: str, hint: str) -> None:
        if not self.table.findings:
            self.table.add(line, 1, "", message, got, hint)
        raise PresetError([])

    def _name(self, line: TableLine | None, separator: str, written: bool) -> None:
        """Take the names of the columns from a line or, where none is written, from a remark that fits."""
        names = names_in(line.text if written else line.words, self.width, separator) if line else None
        if line and names:
            self.table.names, self.table.names_line, self.table.names_in_remark = names, line.number, not written
        elif line and written:
            message = f"the line of names does not fit {self.width} columns"
            hint = "one name for each column, separated as the rows are"
            self.table.add(line.number, 1, "", message, line.text.strip(), hint)

    def _read(self, lines: Sequence[TableLine]) -> None:
        """Read lines that are neither blank nor remarks."""
        numbers = np.array([line.number for line in lines], np.int64)
        values = self._plain("\n".join(line.text for line in lines))
        if values is None:
            cells = [split(line.text, self.separator) for line in lines]
            self._settle_decimal(cells)
            read = [self._row(line.number, row) for line, row in zip(lines, cells, strict=True)]
            kept = [row is not None for row in read]
            numbers = numbers[kept]
            values = np.array([row for row in read if row is not None]).reshape(-1, self.width)
        self._keep(values, numbers)

    def _keep(self, values: Cells, lines: NDArray[np.int64]) -> None:
        self.values.frombytes(values.tobytes())
        self.lines.frombytes(lines.tobytes())

    def _plain(self, part: str) -> Cells | None:
        """Rows of a part that is nothing but rows as they are settled, shape (rows, columns); None for any other.

        It reads the same numbers as `_row` does, only faster: whatever is not plain is left to that.
        """
        separator, decimal = self.separator, self.decimal
        if separator == decimal or part.isspace():
            return None
        if '"' in part:  # around nothing but a number
            apart = r"\s" if separator == " " else rf"{separator}\n"
            part = re.sub(rf'(?<![^{apart}])"([0-9eE+\-{decimal}]*)"(?![^{apart}])', r"\1", part)
        blank = {" ": r" \t", "\t": ""}.get(separator, " ")
        if not re.fullmatch(rf"[0-9eE+\-\n{separator}{blank}{decimal}]*", part):
            return None
        if separator != " ":
            part = part.replace(f"{separator}\n", "\n").removesuffix(separator)
        lines = (part.replace(",", ".") if decimal == "," else part).split("\n")
        if not all(lines) or max(map(len, lines)) > MAX_LINE:
            return None
        try:
            rows = np.loadtxt(lines, delimiter=None if separator == " " else separator, comments=None, ndmin=2)
        except ValueError:
            return None
        return rows if rows.shape == (len(lines), self.width) and bool((np.abs(rows) <= GREATEST).all()) else None

    def _settle_decimal(self, rows: Iterable[Sequence[Cell]]) -> None:
        if not self.decimal:
            marks = Counter(decimal_mark_in(cell.text) for row in rows for cell in row)
            self.decimal = "," if marks[","] > marks["."] else "." if marks["."] else ""

    def _row(self, line: int, row: Sequence[Cell]) -> list[float] | None:
        """Numbers of a row; None for one that is none, with a finding."""
        if not _has_numbers(row):
            hint = "put # in front of it; only one line of names, above the rows"
            self.table.add(line, row[0].column if row else 1, "", "a line of text among the rows", _words(row), hint)
            return None
        if len(row) != self.width:
            hint = "a decimal comma? separate the columns by ;" if self.separator == "," else "one cell for each column"
            wrong = f"a row of {len(row)}, most rows have {self.width} columns"
            self.table.add(line, row[0].column, "", wrong, _words(row), hint)
            return None
        return [self._number(line, index, cell) for index, cell in enumerate(row)]

    def _number(self, line: int, index: int, cell: Cell) -> float:
        decimal = self.decimal or "."
        message, hint = fault_of(cell.text, decimal)
        value = float("nan") if message else float(cell.text.replace(decimal, "."))
        if not message and not abs(value) <= GREATEST:
            most = f"number up to {GREATEST:g}" if isfinite(value) else "finite number"
            message, hint = f"must be a {most}", "is this cell right?"
        if message:
            self.table.add(line, cell.column, self.table.name(index), message, cell.text or "nothing", hint)
        return value


def _lines(first: int, part: str, table: NumberTable) -> Iterator[TableLine]:
    """Lines of a part of a text that are not blank; one that is too long is added to the findings of the table."""
    for number, line in enumerate(part.split("\n"), first):
        if not line.strip(' ;,\t"\x1a'):
            continue
        if len(line) > MAX_LINE:
            table.add(number, 1, "", f"a line of {len(line)} characters", line, "one row on each line")
        else:
            mark = _REMARK.match(line)
            yield TableLine(number, line, mark.end() + 1 if mark else 0)


def split(line: str, separator: str) -> list[Cell]:
    """Cells of a line; empty ones at its end are left out."""
    cells = []
    at, end = len(line) - len(line.lstrip()), len(line.rstrip())
    while at <= end and (found := _CELLS[separator].search(line, at, end)):
        cells.append(Cell(_unquoted(found[1].strip()), found.start(1) + 1))
        at = found.end() if separator == " " else (line.find(separator, found.end(), end) + 1 or end + 1)
    while cells and not cells[-1].text:
        cells.pop()
    return cells


def _unquoted(text: str) -> str:
    quoted = len(text) > 1 and text.startswith('"') and text.endswith('"')
    return text[1:-1].replace('""', '"').strip() if quoted else text


def _words(row: Iterable[Cell]) -> str:
    return " ".join(cell.text for cell in row).strip()


def _has_numbers(row: Iterable[Cell]) -> bool:
    """Whether a cell begins like a number, or is one that is not finite."""
    return any(_MEANT.match(cell.text) or _NOT_FINITE.fullmatch(cell.text) for cell in row)


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


def names_in(line: str, width: int, separator: str) -> tuple[str, ...] | None:
    """Names of the columns in a line above the rows, separated as these are or otherwise; None if they do not fit."""
    by_marks = (tuple(cell.text for cell in split(line, mark)) for mark in dict.fromkeys((separator, *";\t,")))
    # a unit belongs to the name before it
    by_blanks = (tuple(re.split(apart, line.strip())) for apart in (r"\s{2,}", r"\s+(?![\[(/])(?<!/)(?<!/\s)"))
    return next((names for found in (by_marks, by_blanks) for names in found if len(names) == width), None)


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


def shortened(numbers: Sequence[int], most: int = 5) -> str:
    """Numbers for a message, the first ones of many: 3, 4, 5, 6, 7 ... (12 in all)."""
    text = ", ".join(map(str, numbers[:most]))
    return text if len(numbers) <= most else f"{text} ... ({len(numbers)} in all)"
