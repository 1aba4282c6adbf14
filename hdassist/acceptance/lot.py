"""Lots: many drives to accept, from the rows of a table or from the files of a folder.

Columns of a table: serial, preset, measured or measured@80 (a file), pitch_b, pitch_g (files of measured teeth),
mark_b, mark_g (directions of their marks), NAME[@TORQUE] (a value with its uncertainty, measured otherwise), limit
NAME[@TORQUE], section.key (an override of the preset). Names that begin with # or note are not used.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from hdassist.acceptance.cells import NamedCell
from hdassist.acceptance.limit_parser import LimitName, LimitText
from hdassist.acceptance.request import Request, TraceFile
from hdassist.errors import DataError, Finding, HdassistError, PresetError, UsageError
from hdassist.preset.fields import REMOVED, field_table
from hdassist.preset.kinds import is_number
from hdassist.preset.library import preset_names
from hdassist.preset.overrides import path_of
from hdassist.preset.yamltext import near, shown
from hdassist.readers.table import TextTable, few, read_texts
from hdassist.textfile import STDIN, is_folder

TABLES = (".csv", ".tsv", ".csv.gz", ".tsv.gz")
PLAIN: tuple[Literal["serial", "preset", "measured"], ...] = ("serial", "preset", "measured")
WHEELS: tuple[tuple[Literal["pitch", "mark"], str], ...] = (
    ("pitch", "b"), ("pitch", "g"), ("mark", "b"), ("mark", "g"),
)  # fmt: skip
_LIMIT = re.compile(r"limits?[\s:_]+(.+)", re.IGNORECASE)
_AT = re.compile(r"measured\s*@\s*(.+)", re.IGNORECASE)
_UNUSED = re.compile(r"#|note", re.IGNORECASE)
_PITCH = re.compile(r"(?P<stem>.+)\.pitch-(?P<wheel>[bg])\.(?:csv|tsv|txt)(?:\.gz)?")
_TRACE = re.compile(r"(?P<stem>.+?)(?:@(?P<torque>[-+0-9.eE]+))?\.(?:csv|tsv|txt)(?:\.gz)?")


@dataclass(frozen=True)
class LotRow:
    """One drive of a lot: its serial, what is asked of it, its place (FILE:LINE, or a file), and what is wrong with it.

    fault: of the row itself; then the request is not to be carried out. cells: those that say something of the drive.
    """

    serial: str
    request: Request
    place: str
    fault: HdassistError | None = None
    cells: tuple[NamedCell, ...] = field(default=(), compare=False)


@dataclass(frozen=True)
class Lot:
    """Drives to accept: file or folder that names them, SHA-256 of a file, rows in its order, what was found out."""

    file: str
    sha256: str | None
    rows: tuple[LotRow, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Column:
    """What the cells of a column are, of what (a torque, a wheel, the path of an override), and the name of a limit."""

    kind: Literal["serial", "preset", "measured", "pitch", "mark", "value", "limit", "override"]
    of: str = ""
    name: LimitName | None = None

    @property
    def is_text(self) -> bool:
        """Whether its cells are taken as they stand, and have no numbers in them."""
        return self.kind in (*PLAIN, "pitch")


def is_lot(path: str) -> bool:
    """Whether an argument is a lot: a folder, or a file with the name of a table."""
    return path.lower().endswith(TABLES) or (path != "-" and is_folder(path))


def read_lot(path: str, base: Request) -> Lot:
    """Read a lot.

    Arguments: path of a table or folder; base, what is asked of every drive, its preset empty or that of rows without
    one. A row adds to it what it says.
    Raises DataError: a file or folder that cannot be read or has no drive; PresetError: names of columns that cannot
    be meant. What is wrong with a row is kept with it.
    """
    return _of_folder(Path(path), base) if is_folder(path) else _of_table(read_texts(path), base)


def _of_table(table: TextTable, base: Request) -> Lot:
    columns = _columns(table)
    first: dict[str, int] = {}
    rows = [_row(table, columns, place, base, first) for place in range(len(table.rows))]
    notes = [f"{len(rows)} drives"]
    inside = [number for number in table.remarks if number > table.names_line]
    if inside:
        notes.append(f"left out as remarks: line {few(inside, 20)}")
    left = [name.text for name, column in zip(table.names, columns, strict=True) if column is None]
    if base.measured_only and any(column and column.kind == "pitch" for column in columns):
        notes.append("measured teeth are not used: --measured-only predicts nothing")
    if any(left):
        notes.append(f"columns not used: {shown(', '.join(filter(None, left)))}")
    return Lot(table.file, table.sha256, tuple(rows), tuple(notes))


def _columns(table: TextTable) -> list[Column | None]:
    """Columns of a table; None for those that are not used. Raises PresetError: every name that cannot be meant."""
    findings: list[Finding] = []
    columns: list[Column | None] = []

    def wrong(at: int, text: str, message: str, hint: str = "") -> None:
        findings.append(Finding(table.file, table.names_line, at, text, message, hint=hint))

    for name in table.names:
        column = None
        if name.text and not _UNUSED.match(name.text):
            column, hint = _column(name.text)
            if column is None:
                hint = hint or "section.key, limit NAME@TORQUE, or note for what is not used"
                wrong(name.column, name.text, "no such column", hint)
            elif column in columns:
                wrong(name.column, name.text, f"column {columns.index(column) + 1} is the same")
        columns.append(column)
    if not any(columns) and not findings:
        wrong(1, "", "no column that is used", ", ".join(PLAIN))
    if findings:
        raise PresetError(findings)
    return columns


def _column(name: str) -> tuple[Column | None, str]:
    """What a column is for, or a hint."""
    for plain in PLAIN:
        if name.lower() == plain:
            return Column(plain), ""
    for kind, wheel in WHEELS:
        if name.lower() == f"{kind}_{wheel}":
            return Column(kind, wheel), ""
    if at := _AT.fullmatch(name):
        return (Column("measured", f"{float(at[1]):g}"), "") if is_number(at[1]) else (None, "like measured@80")
    try:
        if (limit := _LIMIT.fullmatch(name)) and (of := LimitName.of_column(limit[1], "--limit")):
            return Column("limit", name=of), ""
        if of := LimitName.of_column(name, "--value"):
            return Column("value", name=of), ""
    except UsageError as error:
        return None, error.hint
    if ".".join(map(str, path_of(name)[:2])) in field_table():
        return Column("override", name), ""
    known = [*PLAIN, *map("_".join, WHEELS), *field_table(), "F_ior@80", "limit F_ior@80", "measured@80"]
    return None, REMOVED.get(name) or near(name, known)


def _row(
    table: TextTable, columns: Sequence[Column | None], place: int, base: Request, first: dict[str, int]
) -> LotRow:
    """One row by its place; first: line in which each serial stood first, which is added to."""
    line, cells = table.rows[place]
    numbered = not any(column and column.kind == "serial" for column in columns)
    request, named, faults = replace(base, serial=f"line {line}" if numbered else ""), [], []
    marked: dict[str, int] = {}  # columns of the line in which marks of wheels stand
    folder = Path() if table.file == STDIN else Path(table.file).parent

    def wrong(column: int, path: str, message: str, got: str = "", hint: str = "") -> None:
        faults.append(Finding(table.file, line, column, path, message, shown(got), hint))

    for index, cell in enumerate(cells):
        if not cell.text:
            continue
        column = columns[index] if index < len(columns) else None
        if index >= len(columns):
            wrong(cell.column, "", f"a cell beyond the {len(columns)} columns", cell.text, "quotes around a comma?")
        elif column is None:
            if not table.names[index].text:
                wrong(cell.column, "", "a cell in a column without a name", cell.text)
        else:
            name, text = table.names[index].text, cell.text if column.is_text else table.with_points(cell.text)
            if column.kind == "mark":
                marked[column.of] = cell.column
                if not is_number(text):
                    wrong(cell.column, name, "must be an angle in deg", cell.text)
                    continue
            changes, known = _said(column, text, request, folder)
            request = replace(request, **changes)
            named.append(NamedCell(f"{table.file}:{line}:{cell.column}", name, cell.text, **known))
            if known.get("file") == "-":
                wrong(cell.column, name, "a row cannot read standard input", "-", "name a file")
    serial = request.serial
    if not serial:
        wrong(1, "serial", "missing", hint="each drive needs its serial; without the column its line is its name")
    elif first.setdefault(serial, line) != line:
        wrong(1, "serial", f"stands in line {first[serial]} too", serial, "one row for each drive")
    if not request.preset:
        wrong(1, "preset", "missing", hint="a column preset, or --preset NAME for all rows")
    for wheel in marked.keys() - request.wheels.files.keys():
        message = "the mark of a wheel that is not measured"
        wrong(marked[wheel], f"mark_{wheel}", message, hint=f"its file in pitch_{wheel}")
    request = replace(request, serial=serial or f"line {line}")
    fault = PresetError(faults) if faults else None
    return LotRow(request.serial, request, f"{table.file}:{line}", fault, tuple(named))


def _said(column: Column, text: str, request: Request, folder: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """What a cell says: fields of a request that it changes, and how messages name it (fields of NamedCell).

    Arguments: column; text of the cell; request so far; folder from which paths count.
    """
    path = text if text == "-" else str(folder / text)
    if column.kind == "serial":
        return {"serial": text}, {}
    if column.kind == "preset":
        path = text if text in preset_names() else path
        return {"preset": path}, {"file": path}
    if column.kind == "measured":
        trace = TraceFile(column.of, text) if column.of else TraceFile.parse(text)
        trace = replace(trace, file=trace.file if trace.file == "-" else str(folder / trace.file))
        return {"measured": (*request.measured, trace)}, {"said": f"--measured {trace}", "file": trace.file}
    if column.kind in ("pitch", "mark"):
        is_file = column.kind == "pitch"
        value: dict[str, Any] = {f"{column.kind}_{column.of}": path if is_file else float(text)}
        return {"wheels": replace(request.wheels, **value)}, {"file": path} if is_file else {}
    if column.kind == "override":
        said = f"{column.of}={text}"
        return {"overrides": (*request.overrides, said)}, {"said": f"--set {said}", "path": column.of}
    limit = LimitText(column.name or LimitName(""), text)
    if column.kind == "value":
        return {"values": (*request.values, limit)}, {"said": f"--value {limit}"}
    known = {"said": f"--limit {limit}", "path": limit.override.partition("=")[0]}
    return {"limits": (*request.limits, limit)}, known


def _of_folder(folder: Path, base: Request) -> Lot:
    try:
        files = sorted(item for item in folder.iterdir() if item.is_file() and not item.name.startswith("."))
    except OSError as error:
        raise DataError(f"cannot read {folder}: {error.strerror}") from None
    if broken := [item.name for item in files if "\n" in item.name]:
        raise DataError(f"{folder}: a line break in the name of {broken[0]!r}", "names are written on one line")
    presets = [item for item in files if item.suffix in (".yaml", ".yml")]
    if not presets:
        raise DataError(f"{folder}: no preset in the folder", "one NAME.yaml a drive, its trace beside it as NAME.csv")
    traces: dict[str, list[TraceFile]] = {item.stem: [] for item in presets}
    pitch: dict[str, dict[str, str]] = {item.stem: {} for item in presets}
    spare = []
    for item in files:
        of_wheel, match = _PITCH.fullmatch(item.name), _TRACE.fullmatch(item.name)
        if of_wheel and of_wheel["stem"] in pitch:
            pitch[of_wheel["stem"]][of_wheel["wheel"]] = str(item)
        elif match and match["stem"] in traces:
            traces[match["stem"]].append(TraceFile(match["torque"] or "", str(item)))
        elif match:
            spare.append(item.name)
    rows = []
    for item in presets:
        own = pitch[item.stem]
        wheels = replace(base.wheels, pitch_b=own.get("b"), pitch_g=own.get("g"))
        request = replace(base, preset=str(item), serial=item.stem, measured=tuple(traces[item.stem]), wheels=wheels)
        rows.append(LotRow(item.stem, request, str(item), _twin(item, presets)))
    measured = sum(map(bool, traces.values()))
    notes = [f"{len(rows)} presets, {measured} of them with traces"]
    toothed = sum(map(bool, pitch.values()))
    notes += [f"{toothed} of them with measured teeth"] * bool(toothed)
    notes += [f"traces without a preset: {shown(', '.join(spare))}"] * bool(spare)
    return Lot(str(folder), None, tuple(rows), tuple(notes))


def _twin(item: Path, presets: Sequence[Path]) -> DataError | None:
    others = [other.name for other in presets if other.stem == item.stem and other != item]
    return DataError(f"{item}: {others[0]} is of the same drive", "one preset for each drive") if others else None
