"""Lots: many drives to accept, from the rows of a table.

Columns: serial, preset, measured or measured@80 (a file), pitch_b, pitch_g (files of measured teeth),
mark_b, mark_g (directions of their marks), NAME[@TORQUE] (a value with its uncertainty, measured otherwise), limit
NAME[@TORQUE], section.key (an override of the preset). Names that begin with # or note are not used. A cell has the
form of the option, and its faults are reported with the place of the cell.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from hdassist.acceptance.limits import LimitText, named_limits
from hdassist.acceptance.request import TEXTS, Request, TraceFile
from hdassist.errors import Finding, HdassistError, PresetError, UsageError
from hdassist.preset.fields import REMOVED, field_table
from hdassist.preset.kinds import is_number
from hdassist.preset.library import preset_names
from hdassist.preset.overrides import path_of
from hdassist.preset.yamltext import near_miss, path_text, shown
from hdassist.readers.table import CellTable, read_texts, shortened
from hdassist.textfile import STDIN

TABLES = (".csv", ".tsv", ".csv.gz", ".tsv.gz")
PLAIN_COLUMNS = ("serial", "preset")
WHEEL_COLUMNS = ("pitch_b", "pitch_g", "mark_b", "mark_g")
FILE_COLUMNS = ("preset", "--measured", "pitch_b", "pitch_g")  # whose cells name files
_LIMIT = re.compile(r"limits?[\s:_]+(.+)", re.IGNORECASE)
_MEASURED = re.compile(r"measured(?:\s*@\s*(.+))?", re.IGNORECASE)
_UNUSED = re.compile(r"#|note", re.IGNORECASE)


@dataclass(frozen=True)
class NamedCell:
    """A cell that sets an option of a drive.

    name: how a message about it begins (FILE:LINE:COLUMN: heading); text; option: the option in its place ("--value
    F_ior@4=28"); path, of the override that it is; file that it names; empty for none.
    """

    name: str
    text: str
    option: str = ""
    path: str = ""
    file: str = ""

    def of_option(self, line: str) -> str:
        """A message about the option, with the cell named in its place; empty for any other message."""
        if not self.option or not line.startswith(f"{self.option}: "):
            return ""
        rest = line.removeprefix(f"{self.option}: ")
        if self.path:
            return f"{self.name}: {rest.removeprefix(f'{path_text(path_of(self.path))}: ')}"
        return f"{self.name}: {rest} (got {shown(self.text)})"


@dataclass(frozen=True)
class LotRow:
    """One drive to accept: its request, its place (FILE:LINE; None: no row of a lot).

    fault: of the row itself; then the request is not to be carried out. cells: those that set options.
    """

    request: Request
    place: str | None = None
    fault: HdassistError | None = None
    cells: tuple[NamedCell, ...] = field(default=(), compare=False)

    def message(self, error: HdassistError) -> str:
        """The message of an error, naming cells of the row in place of options."""
        message = error.message
        if not self.fault:
            request = self.request
            lines = named_limits(message, request.overrides, request.limits, overrides=True).splitlines()
            found = [next(filter(None, (cell.of_option(line) for cell in self.cells)), "") for line in lines]
            files = [cell for cell in self.cells if cell.file and cell.file in message]
            if any(found):
                message = "\n".join(new or old for new, old in zip(found, message.splitlines(), strict=True))
            elif len(files) == 1:
                message = f"{files[0].name}: {message}"
        return message if not self.place or self.place in message else f"{self.place}: {message}"


@dataclass(frozen=True)
class Lot:
    """Drives to accept: file that names them with its SHA-256, rows in its order, remarks."""

    file: str
    sha256: str
    rows: tuple[LotRow, ...]
    notes: tuple[str, ...] = ()


# what cells of a column give: an option or a field of a request, and of what: torque, name of a limit, or override
Column = tuple[str, str]


def is_lot(path: str) -> bool:
    """Whether an argument is a lot: a file with the name of a table."""
    return path.lower().endswith(TABLES)


def read_lot(path: str, base: Request) -> Lot:
    """Read a lot.

    Arguments: path of a table; base, the request of every drive, its preset empty or that of rows without one. A row
    adds its cells.
    Raises DataError: a file that cannot be read or has no drive; PresetError: names of columns that cannot be meant.
    The fault of a row is kept with it.
    """
    table = read_texts(path)
    columns = _columns(table)
    first: dict[str, int] = {}
    rows = [_row(table, columns, place, base, first) for place in range(len(table.rows))]
    notes = [f"{len(rows)} drives"]
    if inside := [number for number in table.remarks if number > table.names_line]:
        notes.append(f"left out as remarks: line {shortened(inside, 20)}")
    if base.measured_only and {("pitch_b", ""), ("pitch_g", "")} & set(columns):
        notes.append("measured teeth are not used: --measured-only predicts nothing")
    left = [name.text for name, column in zip(table.names, columns, strict=True) if column is None]
    if any(left):
        notes.append(f"columns not used: {shown(', '.join(filter(None, left)))}")
    return Lot(table.file, table.sha256, tuple(rows), tuple(notes))


def _columns(table: CellTable) -> list[Column | None]:
    """Columns of a table; None for those that are not used. Raises PresetError: every name that cannot be meant."""
    findings: list[Finding] = []
    columns: list[Column | None] = []
    for name in table.names:
        column, message, hint = None, "", ""
        if name.text and not _UNUSED.match(name.text):
            try:
                column = _column(name.text)
                message = f"column {columns.index(column) + 1} is the same" if column in columns else ""
            except UsageError as error:
                message, hint = "no such column", error.hint
        if message:
            findings.append(Finding(table.file, table.names_line, name.column, name.text, message, hint=hint))
        columns.append(column)
    if not any(columns) and not findings:
        hint = ", ".join((*PLAIN_COLUMNS, "measured"))
        findings.append(Finding(table.file, table.names_line, 1, "", "no column that is used", hint=hint))
    if findings:
        raise PresetError(findings)
    return columns


def _column(name: str) -> Column:
    """The option or field that a column sets. Raises UsageError with a hint: none."""
    if name.lower() in (*PLAIN_COLUMNS, *WHEEL_COLUMNS):
        return name.lower(), ""
    if at := _MEASURED.fullmatch(name):
        if at[1] and not is_number(at[1]):
            raise UsageError(name, "like measured@80")
        return "--measured", f"{float(at[1]):g}" if at[1] else ""
    limit = _LIMIT.fullmatch(name)
    for option, text in (("--limit", limit[1] if limit else ""), ("--value", name)):
        if LimitText(text.strip(), "").is_known:
            return option, str(TEXTS[option][1](f"{text}=0")).removesuffix("=0")
    if ".".join(map(str, path_of(name)[:2])) in field_table():
        return "--set", name
    known = [*PLAIN_COLUMNS, "measured", *WHEEL_COLUMNS, *field_table(), "F_ior@80", "limit F_ior@80", "measured@80"]
    hint = REMOVED.get(name) or near_miss(name, known) or "section.key, limit NAME@TORQUE, or note for what is not used"
    raise UsageError(name, hint)


def _row(
    table: CellTable, columns: Sequence[Column | None], place: int, base: Request, first: dict[str, int]
) -> LotRow:
    """One row by its place; first: line in which each serial stood first, which is added to."""
    line, cells = table.rows[place]
    request, named, faults = replace(base, serial="" if ("serial", "") in columns else f"line {line}"), [], []
    marks: dict[str, int] = {}  # columns of the line in which marks of wheels stand
    folder = Path() if table.file == STDIN else Path(table.file).parent

    def wrong(column: int, path: str, message: str, got: str = "", hint: str = "") -> None:
        faults.append(Finding(table.file, line, column, path, message, shown(got), hint))

    for index, cell in enumerate(cells):
        name, column = (table.names[index].text, columns[index]) if index < len(columns) else ("", None)
        if cell.text and not name:
            wrong(cell.column, "", "a cell in a column without a name", cell.text, "quotes around a comma?")
        if not cell.text or column is None:
            continue
        text = cell.text if column[0] in (*PLAIN_COLUMNS, *FILE_COLUMNS) else table.with_points(cell.text)
        if column[0].startswith("mark"):
            marks[name] = cell.column
            if not is_number(text):
                wrong(cell.column, name, "must be an angle in deg", cell.text)
                continue
        request, found = _with_cell(request, *column, text, folder)
        named.append(replace(found, name=f"{table.file}:{line}:{cell.column}: {shown(name)}", text=cell.text))
        if found.file == "-":
            wrong(cell.column, name, "a row cannot read standard input", "-", "name a file")
    if not request.serial:
        wrong(1, "serial", "missing", hint="each drive needs its serial; without the column its line is its name")
        request = replace(request, serial=f"line {line}")
    elif first.setdefault(request.serial, line) != line:
        words = f"stands in line {first[request.serial]} too"
        wrong(1, "serial", words, request.serial, "one row for each drive")
    if not request.preset:
        wrong(1, "preset", "missing", hint="a column preset, or --preset NAME for all rows")
    for mark, at in marks.items():
        if mark[-1].lower() not in request.wheels.files:
            wrong(at, mark, "the mark of a wheel that is not measured", hint=f"its file in pitch_{mark[-1]}")
    return LotRow(request, f"{table.file}:{line}", PresetError(faults) if faults else None, tuple(named))


def _with_cell(request: Request, gives: str, of: str, text: str, folder: Path) -> tuple[Request, NamedCell]:
    """A request with a cell added, and the cell as messages name it; folder, from which paths count."""
    trace = TraceFile.recorded(text) if gives == "--measured" and not of else TraceFile(of, text)
    is_name = trace.file == "-" or (gives == "preset" and text in preset_names())
    file = trace.file if is_name else str(folder / trace.file)
    cell = NamedCell("", text, file=file if gives in FILE_COLUMNS else "")
    change: dict[str, Any]
    if gives in PLAIN_COLUMNS:
        change = {gives: file if gives in FILE_COLUMNS else text}
    elif gives in WHEEL_COLUMNS:
        wheel: dict[str, Any] = {gives: file if gives in FILE_COLUMNS else float(text)}
        change = {"wheels": replace(request.wheels, **wheel)}
    else:
        into, parse = TEXTS[gives]
        option: Any = replace(trace, file=file) if gives == "--measured" else parse(f"{of}={text}")
        change = {into: (*getattr(request, into), option)}
        path = option.override.partition("=")[0] if gives == "--limit" else of if gives == "--set" else ""
        cell = replace(cell, option=f"{gives} {option}", path=path)
    return replace(request, **change), cell
