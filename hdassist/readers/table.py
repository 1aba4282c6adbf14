"""Tables in files of instruments and spreadsheets: cells of numbers or text, with their lines and columns.

The decimal mark is a point, or a comma throughout the file unless commas separate its cells. A line of column names
may precede the rows; in a table of numbers it may be a comment. The first lines determine the separator, the decimal
mark and the number of columns; all rows are then read by the same rules.

Files of other programs are recognised by their first lines. Two kinds are converted to rows of a table with the same
line numbers:
PHD2 guide log: see `readers/guiding.py`.
EQMOD PE file: `!WormPeriod` in s, `!StepsPerWorm`, then rows of time in s, motor steps and error in arcsec.
"""

from __future__ import annotations

import re
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, nan
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.preset.text import MAX_FINDINGS, ordered_findings, shown
from hdassist.readers.guiding import SIDEREAL_ARCSEC_S, GuideForm, guide_rows
from hdassist.readers.words import (
    ANGLES,
    COUNTS,
    DEFINITIONS,
    PITCH_KEYS,
    TIMES,
    TORQUES,
    Cell,
    TableLine,
    angle_size,
    cells_of,
    decimal_mark_in,
    fault_of,
    foreign_unit_in,
    has_numbers,
    is_in_counts,
    is_of_moteus,
    moteus_unit_of,
    names_in,
    plain_unit,
    quantity_of,
    role_in,
    row_text,
    scaled_unit_in,
    separator_of,
    sexagesimal_degrees,
    unclosed_quote,
    unit_in,
)
from hdassist.run.errors import DataError, Finding, PresetError, UsageError
from hdassist.run.files import GREATEST, MAX_LINE, Readable, TextFile, number_of

_MOST_TABLE_BYTES = 5_000_000
SAMPLED_LINES = 300  # lines from which the form of the rows is determined
# number of unreadable rows that, as a majority of the first lines, show that the file is not a table of numbers
_FOREIGN_ROWS = 20
_FOREIGN_HEAD = 3  # number of unreadable lines above the rows that shows that the file is of another kind
NO_UNIT = "no unit stated"  # phrase in notes before an assumed unit
MAX_REMARKS = 1000  # maximum number of stored comments
_ANGLE_ROLES = ("cam", "output", "angle", "error", "target", "actual", "twist")  # roles of columns that contain angles
_SHAFTS = ("cam", "output", "angle", "error")  # roles of the columns of a recording
_SEPARATOR_LINE = re.compile(r'"?sep=(?:.|\\t)"?[;,\s]*', re.IGNORECASE)  # line that Excel writes above a table
_DECIMAL_COMMA = re.compile(r"(?<=[0-9]),(?=[0-9])")

_Cells = NDArray[np.float64]
_PROGRAMS = {  # words in the first lines, and the kind of file that they identify
    r"PHD2 (?:version|log version)|^PHD2": "a guide log of PHD2",
    r"^!WormPeriod": "a PE file of EQMOD",
    r"^TARGET DATA::|^USER-TEXT::": "a record of a laser at targets (.rtl)",
    r"^\W*(?:Record Length|Sample Interval|Horizontal Scale)\b": "a record of an oscilloscope",
    r"\b(?:TRUE|FALSE)$": "a record of a controller's signals",
    r"^\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d\S* \D": "a log of events",
}
_HEAD = 40  # number of first lines by which a program is identified


@dataclass(eq=False)
class NumberTable:
    """A table of numbers with the findings of its file. Its values are valid only if there are no findings.

    file: name of the file.
    names: names of the columns, empty without a line of names.
    names_line: line of the names.
    names_in_remark: whether the names are in a comment.
    lines: line number of each row, shape (rows,).
    values: numbers, shape (rows, columns).
    remarks: first comments, up to MAX_REMARKS.
    notes: how the file was read.
    findings: faults of the file.
    sha256: checksum of the file.
    is_latin: whether the file was read as Latin-1.
    left_out: numbers of the lines that were omitted because they are not rows of numbers.
    sexagesimal: number of cells in degrees, minutes and seconds by column; their values are in deg.
    is_lower_bound, scale_uncertainty: properties of the errors, as in `guiding.GuideRows`.
    deg_per_s: speed of the shaft if its angles were computed from times, otherwise 0.
    """

    file: str
    names: tuple[str, ...] = ()
    names_line: int = 1
    names_in_remark: bool = False
    lines: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    values: _Cells = field(default_factory=lambda: np.empty((0, 0)))
    remarks: list[TableLine] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    sha256: str = ""
    is_latin: bool = False
    left_out: list[int] = field(default_factory=list)
    sexagesimal: Counter[int] = field(default_factory=Counter)
    is_lower_bound: bool = False
    scale_uncertainty: float = 0.0
    deg_per_s: float = 0.0

    @property
    def roles(self) -> list[str]:
        """The roles of the columns according to their names (see `role_in`); empty if there are no names."""
        return list(map(role_in, self.names))

    def name(self, column: int) -> str:
        """Return the name of a column for messages.

        column: index of the column.
        """
        return self.names[column] if column < len(self.names) else f"column {column + 1}"

    def unit_of(
        self,
        column: int,
        words: str,
        default: str,
        units: Iterable[str],
        asked: str | None = None,
        option: str = "",
    ) -> str:
        """Return the unit of a column from the option, its name or the default, and add a note on the unit.

        column: index of the column.
        words: description of the content for the note.
        default: unit of a column whose name has none.
        units: units that the column may have.
        asked: unit stated in an option, None if no option states it.
        option: name of the option, empty if the column has none.
        Raises PresetError if the name or a comment states another unit and no option states one.
        """
        name = self.name(column)
        named = unit_in(name, units) or self._unit_of_program(name, units)
        # the sexagesimal notation determines the unit
        if column in self.sexagesimal:
            self._require_degrees(column, words, units, named, asked)
            self.notes.append(f'"{name}": {words}, degrees, minutes and seconds')
            return "deg"
        # a stated unit takes precedence over the name
        if asked is None:
            self._require_known(column, named, default, units, option)
        unit = plain_unit(asked) if asked is not None else named or default
        foreign = foreign_unit_in(name, units)
        # a contradiction is allowed with a note, because headings of instruments are often wrong
        if asked is not None and (foreign or (named and named != unit)):
            self.notes.append(f'"{name}": {asked} as requested, although the name states {named or foreign}')
        assumed = f"{NO_UNIT}, {default} assumed"
        if option:
            assumed += f" ({option})"
        is_assumed = asked is None and not named
        definition = f" ({DEFINITIONS[unit]})" if unit in DEFINITIONS else ""
        self.notes.append(f'"{name}": {words}, {assumed if is_assumed else unit + definition}')
        return unit

    def _unit_of_program(self, name: str, units: Iterable[str]) -> str:
        """Return the unit used by the program that named a column, or "" if it is not one of the given units."""
        # names that known programs use for counts
        if is_in_counts(name):
            unit = COUNTS
        # the units of moteus follow from the names of all columns
        elif is_of_moteus(self.names):
            unit = moteus_unit_of(name)
        else:
            unit = ""
        return unit if unit in units else ""

    def _require_degrees(
        self,
        column: int,
        words: str,
        units: Iterable[str],
        named: str,
        asked: str | None,
    ) -> None:
        """Raise PresetError if a column in degrees, minutes and seconds has other cells or another stated unit."""
        name = self.name(column)
        decimal_rows = len(self.values) - self.sexagesimal[column]
        # 12.30 may mean 12.3 deg or 12 deg 30 min, so a mixed column is ambiguous
        if decimal_rows > 0:
            message = (
                f'"{name}": {decimal_rows} of {len(self.values)} rows are numbers without degrees, minutes and seconds'
            )
            raise self.fault(message, "write every angle of a column in the same way")
        stated = plain_unit(asked) if asked is not None else named or foreign_unit_in(name, units)
        if "deg" not in units:
            raise self.fault(
                f'"{name}" is read as {words}, but contains degrees, minutes and seconds', "check the column names"
            )
        if stated not in ("", "deg"):
            message = f'"{name}" contains degrees, minutes and seconds, but the unit {stated} is stated'
            raise self.fault(message, "leave out the unit, or write plain numbers in that unit")

    def _require_known(
        self,
        column: int,
        named: str,
        default: str,
        units: Iterable[str],
        option: str,
    ) -> None:
        """Raise PresetError if the name of a column or a comment states an unknown unit."""
        name = self.name(column)
        quantity = quantity_of(default) or "angle"
        hint = f"write a unit of {quantity} in the name, for example [{default}]"
        if option:
            hint = f"state it: {option} {default}, or another unit of {quantity}"
        if foreign := foreign_unit_in(name, units):
            foreign_quantity = quantity_of(foreign)
            fault = (
                f"a unit of {foreign_quantity}, not of {quantity}"
                if foreign_quantity
                else f"no known unit of {quantity}"
            )
            # the same word is used for two units
            if plain_unit(foreign) == "grad":
                fault = "a degree in German and 1/400 of a revolution elsewhere; write deg or gon"
            elif scaled_unit_in(name):  # a unit stated in an option would not include the factor
                fault = f"a unit with a factor, or not a unit of {quantity}"
                hint = f"convert the column to a unit of {quantity}, and write it in the name, for example [{default}]"
            raise self.fault(f'"{name}": {foreign} is {fault}', hint)
        entries = ((line, line.entry) for line in self.remarks)
        stated = [(line, entry) for line, entry in entries if entry and PITCH_KEYS.get(entry[0]) == "unit"]
        # if the column name states no unit, the unit in a comment may be that of another column
        if stated and not named and quantity == "angle":
            line, (_, text, place) = stated[0]
            message = f'the comment states the unit {text}, the name "{name}" states none'
            self.add(line.number, place, "", message, text, hint)
            raise PresetError(self.findings)

    def in_unit(
        self,
        column: int,
        words: str,
        default: str,
        asked: str | None = None,
        option: str = "",
    ) -> _Cells:
        """Return the values of a column in the base unit. Arguments and errors are those of `unit_of`."""
        # the default unit determines the quantity of the column
        sizes = next(sizes for sizes in (ANGLES, TIMES, TORQUES) if default in sizes)
        unit = self.unit_of(column, words, default, sizes, asked, option)
        return self.values[:, column] * (angle_size(unit) if sizes is ANGLES else sizes[unit])

    def add(
        self,
        line: int,
        column: int,
        path: str,
        message: str,
        got: str = "",
        hint: str = "",
    ) -> None:
        """Add a finding at a line and column of the file."""
        self.findings.append(
            Finding(
                file=self.file, line=line, column=column, path=shown(path), message=message, got=shown(got), hint=hint
            )
        )

    def add_at(
        self,
        row: int,
        column: int,
        message: str,
        got: str = "",
        hint: str = "",
    ) -> None:
        """Add a finding at a row and column index."""
        self.add(int(self.lines[row]), 1, self.name(column), message, got, hint)

    def fault(
        self,
        message: str,
        hint: str,
        row: int | None = None,
        column: int = 0,
    ) -> PresetError:
        """Add a finding for a cell, or for all columns if no row is given, and return the error with all findings.

        row: index of the row, None for the columns as a whole, whose names are then listed.
        column: index of the column.
        """
        # the finding concerns the columns as a whole
        if row is None or not len(self.lines):
            self.add(self.names_line, 1, "", message, self.listed, hint)
        else:
            self.add_at(row, column, message, hint=hint)
        return PresetError(self.findings)

    @property
    def listed(self) -> str:
        """The names of all columns, for messages."""
        return shown(", ".join(map(self.name, range(self.values.shape[1]))))

    def require_sound(self) -> None:
        """Raise PresetError with the findings in the order of the file, up to one hundred."""
        if self.findings:
            raise PresetError(ordered_findings(self.findings))


@dataclass(frozen=True)
class CellTable:
    """A table of text.

    file: name of the file.
    sha256: checksum of the file.
    separator: separator of the cells.
    names: column names.
    names_line: line of the names.
    rows: line number and cells of each row.
    remarks: numbers of the lines below the names that are comments.
    unclosed: position of the first unclosed quote in a line, by line number.
    """

    file: str
    sha256: str
    separator: str
    names: tuple[Cell, ...]
    names_line: int
    rows: tuple[tuple[int, tuple[Cell, ...]], ...]
    remarks: tuple[int, ...]
    unclosed: Mapping[int, int]

    def with_points(self, text: str) -> str:
        """Return a cell with decimal points for commas, unless commas separate cells or the cell contains a list."""
        # "1,5" in a file with semicolons is a number; "[1,5]" is a list
        free = self.separator != "," and "." not in text and "[" not in text
        return _DECIMAL_COMMA.sub(".", text) if free else text


def _no_rows(file: str, line: int) -> PresetError:
    """Return the error of a table without rows.

    line: line of its names, 1 if there are none.
    """
    finding = Finding(
        file=file,
        line=line,
        column=1,
        path="",
        message="no rows in the table",
        hint="write a line of names, for example serial;preset;measured, and a row for each drive",
    )
    return PresetError([finding])


def read_texts(source: Readable) -> CellTable:
    """Return a table of text below a line of names, separated by semicolons, tabs or commas.

    A line that begins like a comment but has as many cells as there are names is a row, because a serial may begin with
    #.

    source: path, stream or bytes.
    Raises DataError if the file cannot be read.
    Raises PresetError if it has no rows or has lines that are too long.
    """
    text = TextFile(source, _MOST_TABLE_BYTES)
    table = NumberTable(text.name)
    lines: list[TableLine] = []
    remarks: list[int] = []
    separator = ""
    # the file is read in parts, because a large one may not fit into memory
    for first, part in text.parts():
        for line in _lines(first, part, table):
            if not line.remark:
                # the first line determines the separator, because column names rarely contain other separators
                separator = separator or next((mark for mark in ";\t," if mark in line.text), ";")
                lines.append(line)
            # a line that begins with # and has all cells is a row
            elif lines and _is_wide(line.text, separator, lines[0].text):
                lines.append(line)
            elif lines:
                remarks.append(line.number)
    table.require_sound()
    if len(lines) < 2:
        raise _no_rows(text.name, lines[0].number if lines else 1)
    # the first line that is not a comment contains the names
    names, *rows = ((line.number, tuple(cells_of(line.text, separator))) for line in lines)
    opened = {line.number: column for line in lines if (column := unclosed_quote(line.text, separator))}
    return CellTable(
        file=text.name,
        sha256=text.sha256,
        separator=separator,
        names=names[1],
        names_line=names[0],
        rows=tuple(rows),
        remarks=tuple(remarks),
        unclosed=opened,
    )


def _is_wide(
    text: str,
    separator: str,
    heading: str,
) -> bool:
    """Return whether a line has as many cells as a heading of several cells; empty cells count."""
    end = f"{separator}end"  # with a cell appended, empty cells at the end are not omitted
    width = len(cells_of(heading, separator))
    cells = cells_of(text.rstrip("\r\n") + end, separator)[:-1]
    if len(cells) > width and not cells[-1].text:
        cells.pop()  # the line ends with a separator
    return len(cells) == width > 1


def read_numbers(
    source: Readable,
    needs: Sequence[str] = (),
    at_most: int = _MOST_TABLE_BYTES,
    *,
    lenient: bool = False,
    takes_sexagesimal: bool = False,
    guide: GuideForm | None = None,
) -> NumberTable:
    """Return a table of numbers; faults of the text are added to its findings.

    source: path, stream or bytes.
    needs: descriptions of the required columns.
    at_most: largest size of the file in bytes.
    lenient: whether rows with a fault are omitted.
    takes_sexagesimal: whether angles in degrees, minutes and seconds are read; `NumberTable.in_unit` converts them.
    guide: options for a guide log, None if none are given.
    Raises DataError if the file cannot be read.
    """
    text = TextFile(source, at_most)
    table = NumberTable(text.name)
    rows = _Rows(table, needs, takes_sexagesimal=takes_sexagesimal)
    try:
        for first, part in _readable_parts(text, table, guide or GuideForm()):
            rows.take(first, part)
            # further findings would not be reported
            if len(table.findings) > MAX_FINDINGS and not lenient:
                break
        else:
            rows.end()
            # --robust: rows with any fault are omitted
            if lenient:
                table.left_out = list(dict.fromkeys(finding.line for finding in table.findings))
                table.findings.clear()
                # cells that could not be read are NaN
                kept = np.isfinite(table.values).all(axis=1)
                table.values = table.values[kept]
                table.lines = table.lines[kept]
    except PresetError as error:
        table.findings.extend(error.findings)
    table.sha256 = text.sha256
    table.is_latin = text.is_latin
    if text.is_latin:
        table.notes.append("not UTF-8: read as Latin-1")
    return table


class _Rows:
    """A reader of the rows of a table of numbers, whose first lines determine separator, decimal mark and width."""

    def __init__(
        self,
        table: NumberTable,
        needs: Sequence[str],
        *,
        takes_sexagesimal: bool = False,
    ) -> None:
        self.table = table
        self.needs = needs
        self.takes_sexagesimal = takes_sexagesimal
        # unknown until the first rows are read
        self.separator = ""
        self.decimal = ""
        self.width = 0
        self.waiting: list[TableLine] = []  # lines that wait for the separator to be determined
        self.above: TableLine | None = None  # the last comment above the rows that is not "key: value"
        # growing arrays, which need less memory than lists of parts
        self.values = array("d")
        self.lines = array("q")

    def take(self, first: int, part: str) -> None:
        """Read the lines of a part of the text.

        first: number of its first line.
        part: text of the part.
        """
        # the fast method applies as soon as the form of the rows is known
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
            # the comment directly above the rows may contain the column names
            if not lines and not self.waiting and not line.entry:
                self.above = line
        if self.separator:
            self._read(lines)
            return
        self.waiting += lines
        # the sample is complete; in a short file it is complete only at the end
        if len(self.waiting) >= SAMPLED_LINES:
            self._settle()

    def end(self) -> None:
        """Determine the form of a short file, and store the rows in the table."""
        if not self.separator:
            self._settle()
        self.table.values = np.frombuffer(self.values).reshape(-1, self.width)
        self.table.lines = np.frombuffer(self.lines, np.int64)

    def _settle(self) -> None:
        """Determine the form of the rows from the first lines, and read these lines.

        Raises PresetError if there are no rows of numbers or too few columns, or if another program wrote the file.
        """
        sample = self.waiting[:SAMPLED_LINES]
        separator = separator_of([line.text for line in sample])
        sample = self._without_preamble(sample, separator)
        cells = [cells_of(line.text, separator) for line in sample]
        self._settle_width(sample, cells)
        # a row of numbers cannot contain the names
        has_names = not has_numbers(cells[0])
        self._settle_names(sample, cells[0], separator, has_names=has_names)
        self.separator = separator
        self._settle_decimal(cells)
        # the sample is now read like all other lines
        lines = self.waiting[1:] if has_names else self.waiting
        self.waiting = []
        self._read(lines)
        self._refuse_foreign(sample, lines)

    def _without_preamble(self, sample: list[TableLine], separator: str) -> list[TableLine]:
        """Return the sample from the line of names on, and omit the lines above it with a note."""
        cells = [cells_of(line.text, separator) for line in sample]
        preamble_lines = _preamble(cells)
        # the file of a known program is rejected below, with its name
        if not preamble_lines or _program_of([line.text for line in sample]):
            return sample
        skipped = shortened([line.number for line in sample[:preamble_lines]])
        self.table.notes.append(f"left out, above the line of names: lines {skipped}")
        self.waiting = self.waiting[preamble_lines:]
        return sample[preamble_lines:]

    def _settle_width(self, sample: Sequence[TableLine], cells: Sequence[Sequence[Cell]]) -> None:
        """Set the number of columns to that of most rows. Raises PresetError without rows or with too few columns."""
        rows = [(line.number, row) for line, row in zip(sample, cells, strict=True) if has_numbers(row)]
        if not rows:
            first = sample[0] if sample else TableLine(1, "", 0)
            hint = (
                f"write rows of {', '.join(self.needs)}" if self.needs else "check that this is the file with the table"
            )
            self._refuse(first.number, "the file contains no rows of numbers", first.text.strip(), hint)
        first_number, first_row = rows[0]
        # the most frequent width applies, because a single row may be faulty
        self.width = Counter(len(row) for _, row in rows).most_common(1)[0][0]
        if self.width < len(self.needs):
            message = f"the rows have {self.width} column, but {len(self.needs)} are needed: {', '.join(self.needs)}"
            hint = "separate the columns by ; or , or tabs or blanks"
            self._refuse(first_number, message, row_text(first_row), hint)

    def _settle_names(
        self,
        sample: Sequence[TableLine],
        first_cells: Sequence[Cell],
        separator: str,
        *,
        has_names: bool,
    ) -> None:
        """Set the names of the columns.

        sample: first lines.
        first_cells: cells of the first line.
        separator: separator of the cells.
        has_names: whether the first line contains the names; otherwise a comment above the rows may contain them.
        """
        line = sample[0] if has_names else self.above
        if line is None:
            return
        names = names_in(line.text if has_names else line.words, self.width, separator)
        if names:
            self.table.names = names
            self.table.names_line = line.number
            self.table.names_in_remark = not has_names
        elif has_names:
            message = f"the line of names does not fit {self.width} columns"
            hint = "write one name for each column, with the separator of the rows"
            empty = [cell.text for cell in first_cells[self.width :]]
            # the sheet has a column that was never filled in
            if empty and all(row.text.rstrip().endswith(separator) for row in sample[1:]):
                message = f"no value is written in {', '.join(empty)}"
                hint = "fill it in, or leave out the column"
            self.table.add(line.number, 1, "", message, line.text.strip(), hint)

    def _refuse_foreign(self, sample: Sequence[TableLine], lines: Sequence[TableLine]) -> None:
        """Raise PresetError if so many of the first lines are not rows that the file must be of another program.

        sample: first lines.
        lines: lines that were read as rows.
        """
        head = sum(line.number < self.lines[0] for line in lines) if self.lines else 0
        # many faults in the first lines indicate another kind of file rather than a table with errors
        faulty = {finding.line for finding in self.table.findings}
        faulty &= {line.number for line in lines}
        is_mostly_faulty = len(faulty) >= _FOREIGN_ROWS and 2 * len(faulty) > len(lines)
        if not is_mostly_faulty and head < _FOREIGN_HEAD:
            return
        # one message replaces hundreds of findings
        self.table.findings.clear()
        program = _program_of([line.text for line in sample]) or "check whether this is a file of another program"
        message = "the file is not a table of numbers: "
        message += f"{len(faulty)} of the first {len(lines)} lines are not rows of {self.width} numbers"
        hint = f"{program}; write one line of names above rows of numbers, like {';'.join(self.needs)}"
        self._refuse(sample[0].number, message, sample[0].text.strip(), hint)

    def _refuse(
        self,
        line: int,
        message: str,
        got: str,
        hint: str,
    ) -> NoReturn:
        """Raise PresetError after adding a finding to the table, unless the table already has findings."""
        if not self.table.findings:
            self.table.add(line, 1, "", message, got, hint)
        raise PresetError([])

    def _read(self, lines: Sequence[TableLine]) -> None:
        """Read lines that are neither blank nor comments."""
        numbers = np.array([line.number for line in lines], np.int64)
        # the fast method fails as a whole if any line is unusual
        values = self._plain("\n".join(line.text for line in lines))
        if values is None:
            cells = [cells_of(line.text, self.separator) for line in lines]
            self._settle_decimal(cells)
            read = [self._row(line.number, row) for line, row in zip(lines, cells, strict=True)]
            kept = [row is not None for row in read]
            numbers = numbers[kept]
            values = np.array([row for row in read if row is not None]).reshape(-1, self.width)
        self._keep(values, numbers)

    def _keep(self, values: _Cells, lines: NDArray[np.int64]) -> None:
        self.values.frombytes(values.tobytes())
        self.lines.frombytes(lines.tobytes())

    def _plain(self, part: str) -> _Cells | None:
        """Return the rows of a part that contains only numbers and separators, shape (rows, columns), or None.

        The numbers are the same as those read by `_row`.
        """
        separator = self.separator
        decimal = self.decimal
        # "1,5" is ambiguous if commas are separators and decimal marks, so each cell is read separately
        if separator == decimal or part.isspace():
            return None
        blank = {" ": r" \t", "\t": ""}.get(separator, " ")
        # the characters are checked, because loadtxt would also accept nan and inf
        if not re.fullmatch(rf"[0-9eE+\-\n{separator}{blank}{decimal}]*", part):
            return None
        if separator != " ":
            part = part.replace(f"{separator}\n", "\n").removesuffix(separator)
        lines = (part.replace(",", ".") if decimal == "," else part).split("\n")
        # blank and overlong lines are processed one by one, with their own messages
        if not all(lines) or max(map(len, lines)) > MAX_LINE:
            return None
        try:
            rows = np.loadtxt(
                lines,
                delimiter=None if separator == " " else separator,
                comments=None,
                ndmin=2,
            )
        except ValueError:
            return None
        return rows if rows.shape == (len(lines), self.width) and bool((np.abs(rows) <= GREATEST).all()) else None

    def _settle_decimal(self, rows: Iterable[Sequence[Cell]]) -> None:
        if not self.decimal:
            # the majority of the cells decides; while no cell has a mark, the decimal mark stays unknown
            marks = Counter(decimal_mark_in(cell.text) for row in rows for cell in row)
            self.decimal = "," if marks[","] > marks["."] else "." if marks["."] else ""

    def _row(self, line: int, row: Sequence[Cell]) -> list[float] | None:
        """Return the numbers of a row, or None with a finding if the row has no numbers or a wrong number of cells."""
        # the line is a second line of names, or a comment without #
        if not has_numbers(row):
            hint = "put # in front of it; only one line of names is allowed, above the rows"
            self.table.add(line, row[0].column if row else 1, "", "a line of text among the rows", row_text(row), hint)
            return None
        if len(row) != self.width:
            hint = (
                "with decimal commas separate the columns by ;"
                if self.separator == ","
                else "write one cell for each column"
            )
            if len(row) < self.width:
                hint = "a cell is missing, or the file is cut off here"
            wrong = f"columns in this row: {len(row)}; in most rows: {self.width}"
            self.table.add(line, row[0].column, "", wrong, row_text(row), hint)
            return None
        return [self._number(line, index, cell) for index, cell in enumerate(row)]

    def _number(
        self,
        line: int,
        index: int,
        cell: Cell,
    ) -> float:
        message, hint = fault_of(cell.text, self.decimal or ".")
        if not message:
            value = float(cell.text.replace(",", "."))
            # larger numbers would make sums of squares overflow
            if abs(value) <= GREATEST:
                return value
            number_words = f"number up to {GREATEST:g}" if isfinite(value) else "finite number"
            message = f"must be a {number_words}"
            hint = "check this cell"
        # cells of angles may contain degrees, minutes and seconds
        elif self.takes_sexagesimal:
            try:
                degrees = sexagesimal_degrees(cell.text, by_colons=role_in(self.table.name(index)) in _ANGLE_ROLES)
            except ValueError as error:
                message = f"an angle of {error}"
                hint = "write 12°34'56.7\""
            else:
                if degrees is not None:
                    self.table.sexagesimal[index] += 1
                    return degrees
        self.table.add(line, cell.column, self.table.name(index), message, cell.text or "nothing", hint)
        return nan


def _lines(
    first: int,
    part: str,
    table: NumberTable,
) -> Iterator[TableLine]:
    """Yield the lines of a part of a text that are not blank, and add a finding for each overlong line."""
    # an empty row of a spreadsheet is a line of separators
    for number, line in enumerate(part.split("\n"), first):
        if not line.strip(' ;,\t"\x1a') or (number == 1 and _SEPARATOR_LINE.fullmatch(line)):
            continue
        if len(line) > MAX_LINE:
            table.add(number, 1, "", f"the line has {len(line)} characters", line, "write one row per line")
        else:
            yield TableLine.of(number, line)


def _preamble(cells: Sequence[Sequence[Cell]]) -> int:
    """Return the number of lines that an instrument writes above the names, or 0 if the line of names is uncertain.

    The line of names is certain if all lines below it are rows with the same number of columns, and if it is the first
    line with a known name.
    """
    # number of consecutive rows at the end of the sample
    rows = next((k for k, row in enumerate(reversed(cells)) if not _is_row(row, len(cells[-1]))), len(cells))
    names = len(cells) - rows - 1
    if names < 1 or rows < _FOREIGN_ROWS or len(cells[names]) != len(cells[-1]) or has_numbers(cells[names]):
        return 0
    is_head = [
        any(role_in(cell.text) in _SHAFTS for cell in row) and len(row) == len(cells[-1]) for row in cells[: names + 1]
    ]
    return names if is_head[-1] and not any(is_head[:-1]) else 0


def _is_row(row: Sequence[Cell], width: int) -> bool:
    return len(row) == width and not any(fault_of(cell.text, decimal_mark_in(cell.text) or ".")[0] for cell in row)


def shortened(items: Sequence[object], most: int = 5) -> str:
    """Return a list of items for a message, shortened to the given number of items: 3, 4, 5, 6, 7 ... (12 in all)."""
    text = ", ".join(map(str, items[:most]))
    return text if len(items) <= most else f"{text} ... ({len(items)} in all)"


def _program_of(lines: Sequence[str]) -> str:
    """Return a description of the kind of file that the first lines identify, or an empty string if it is unknown."""
    text = "\n".join(lines[:_HEAD])
    return next((program for pattern, program in _PROGRAMS.items() if re.search(pattern, text, re.MULTILINE)), "")


def _readable_parts(
    text: TextFile,
    table: NumberTable,
    guide: GuideForm,
) -> Iterator[tuple[int, str]]:
    """Yield the parts of a text; a guide log or PE file is converted to lines of a table with the same line numbers.

    text: text of the file.
    table: table to which notes on the file are added.
    guide: options for a guide log.
    Raises PresetError if a guide log or PE file contains no usable recording.
    Raises UsageError if options for a guide log are used with another file.
    """
    # the first lines identify the program
    parts = text.parts()
    for first, part in parts:
        program = _program_of(part.split("\n", _HEAD)) if first == 1 else ""
        is_guide_log = program == "a guide log of PHD2"
        if first == 1 and guide != GuideForm() and not is_guide_log:
            raise UsageError(
                f"--declination and --guide-rate apply to guide logs, but {text.name} is not a guide log",
                "leave out these options",
            )
        if not (is_guide_log or program == "a PE file of EQMOD"):
            yield first, part
            continue
        # the complete file is read, because the best section of a log is chosen
        lines = "\n".join([part, *(following for _, following in parts)]).split("\n")
        try:
            if is_guide_log:
                rows = guide_rows(lines, guide)
                table.notes += rows.notes
                table.is_lower_bound = rows.is_lower_bound
                table.scale_uncertainty = rows.scale_uncertainty
                table.deg_per_s = SIDEREAL_ARCSEC_S / 3600
                # there are as many lines as in the log, so that line numbers in messages are correct
                yield 1, "\n".join(rows.lines)
            else:
                yield 1, "\n".join(_of_pe_file(lines, table))
        except DataError as error:
            finding = Finding(
                file=text.name,
                line=1,
                column=1,
                path="",
                message=error.message,
                hint=error.hint,
            )
            raise PresetError([finding]) from None


def _of_pe_file(lines: list[str], table: NumberTable) -> Iterator[str]:
    """Yield the lines of a table from a PE file: the angle of the worm, from motor steps or time, and the error.

    lines: lines of the PE file.
    table: table to which notes on the file are added.
    Raises DataError if the file does not state the worm period.
    """
    facts = re.findall(r"^!(WormPeriod|StepsPerWorm)\s*=\s*([-+0-9.]+)", "\n".join(lines), re.MULTILINE)
    stated = {key: number_of(number) for key, number in reversed(facts)}  # first value of a repeated key
    period, steps = (stated.get(key, nan) for key in ("WormPeriod", "StepsPerWorm"))
    if not period > 0:
        raise DataError(
            "the PE file of EQMOD contains no line !WormPeriod",
            "write the worm period in s above the rows, for example !WormPeriod=479",
        )
    # motor steps are angles; times are proportional to angles only at constant speed
    column, turn, by = (1, steps, "motor steps") if steps > 0 else (0, period, "time")
    table.deg_per_s = 360 / period
    table.notes.append(
        f"a PE file of EQMOD: one input revolution in the worm period of {period:g} s, by {by}; the sense is unknown"
    )
    names = "cam_deg error_arcsec"
    for line in lines:
        numbers = [number_of(word) for word in line.split()]
        is_row = len(numbers) == 3 and all(number == number for number in numbers)
        row = f"{360 * numbers[column] / turn:.7f} {numbers[2]:g}" if is_row else ""
        yield names if names and "=" in line else row
        names = "" if "=" in line else names
