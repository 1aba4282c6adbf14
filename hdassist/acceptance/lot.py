"""Lots: many drives to accept, from the rows of a table or from the files of a folder."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hdassist.acceptance.lot_columns import Column, columns_of
from hdassist.acceptance.request import Request
from hdassist.errors import DataError, Finding, HdassistError, PresetError
from hdassist.preset.library import preset_names
from hdassist.preset.yamltext import shown
from hdassist.readers.table import Cell, TextTable, few, read_texts

TABLES = (".csv", ".tsv", ".csv.gz", ".tsv.gz")
_TRACE = re.compile(r"(?P<stem>.+?)(?:@(?P<torque>[-+0-9.eE]+))?\.(?:csv|tsv|txt)(?:\.gz)?")


@dataclass(frozen=True)
class LotRow:
    """One drive of a lot: its serial, what is asked of it, its place (FILE:LINE, or a file), and what is wrong with it.

    fault: of the row itself; then the request is not to be carried out.
    """

    serial: str
    request: Request
    place: str
    fault: HdassistError | None = None


@dataclass(frozen=True)
class Lot:
    """Drives to accept: file or folder that names them, SHA-256 of a file, rows in its order, what was found out."""

    file: str
    sha256: str | None
    rows: tuple[LotRow, ...]
    notes: tuple[str, ...] = ()


def is_lot(path: str) -> bool:
    """Whether an argument is a lot: a folder, or a file with the name of a table."""
    return path.lower().endswith(TABLES) or (path != "-" and Path(path).is_dir())


def read_lot(path: str, base: Request) -> Lot:
    """Read a lot.

    Arguments: path of a table or folder; base, what is asked of every drive, its preset empty or that of rows without
    one. A row adds to it what it says.
    Raises DataError: a file or folder that cannot be read or has no drive; PresetError: names of columns that cannot
    be meant. What is wrong with a row is kept with it.
    """
    return _of_folder(Path(path), base) if Path(path).is_dir() else _of_table(read_texts(path), base)


def _of_table(table: TextTable, base: Request) -> Lot:
    columns = columns_of(table)
    first: dict[str, int] = {}
    rows = [_row(table, columns, line, cells, base, first) for line, cells in table.rows]
    notes = [f"{len(rows)} drives"]
    inside = [number for number in table.remarks if number > table.names_line]
    if inside:
        notes.append(f"left out as remarks: line {few(inside, 20)}")
    left = [table.names[index].text for index in range(len(columns)) if columns[index] is None]
    if any(left):
        notes.append(f"columns not used: {shown(', '.join(filter(None, left)))}")
    return Lot(table.file, table.sha256, tuple(rows), tuple(notes))


def _row(
    table: TextTable,
    columns: Sequence[Column | None],
    line: int,
    cells: Sequence[Cell],
    base: Request,
    first: dict[str, int],
) -> LotRow:
    """One row; first: line in which each serial stood first, which is added to."""
    found: list[Finding] = []

    def wrong(column: int, path: str, message: str, got: str = "", hint: str = "") -> None:
        found.append(Finding(table.file, line, column, path, message, shown(got), hint))

    said = {"preset": "", "serial": ""}
    lists: dict[str, list[str]] = {"measured": [], "values": [], "limits": [], "overrides": []}
    for index, cell in enumerate(cells):
        if index >= len(columns):
            if cell.text:
                wrong(cell.column, "", f"a cell beyond the {len(columns)} columns", cell.text, "quotes around a comma?")
            continue
        column = columns[index]
        if column is None and cell.text and not table.names[index].text:
            wrong(cell.column, "", "a cell in a column without a name", cell.text)
        if column is None or not cell.text:
            continue
        if column.kind in said:
            said[column.kind] = cell.text
        elif column.kind == "measured":
            lists["measured"].append(column.prefix + _beside(table.file, cell.text, column.prefix == ""))
        else:
            lists[column.kind].append(column.prefix + table.with_points(cell.text))
    numbered = not any(column and column.kind == "serial" for column in columns)
    serial = f"line {line}" if numbered else said["serial"]
    if not serial:
        wrong(1, "serial", "missing", hint="each drive needs its serial; without the column its line is its name")
    elif first.setdefault(serial, line) != line:
        wrong(1, "serial", f"stands in line {first[serial]} too", serial, "one row for each drive")
    preset = _preset(table.file, said["preset"]) or base.preset
    if not preset:
        wrong(1, "preset", "missing", hint="a column preset, or --preset NAME for all rows")
    elif "-" in (preset, *lists["measured"]):
        wrong(1, "", "a row cannot read standard input", hint="name a file")
    serial = serial or f"line {line}"
    request = replace(
        base, preset=preset, serial=serial,
        measured=tuple(lists["measured"]),
        values=tuple(lists["values"]),
        limits=(*base.limits, *lists["limits"]),
        overrides=(*base.overrides, *lists["overrides"]),
    )  # fmt: skip
    return LotRow(serial, request, f"{table.file}:{line}", PresetError(found) if found else None)


def _beside(file: str, path: str, may_have_torque: bool) -> str:
    """A path of a row, which counts from the folder of the table; 80:FILE keeps its torque."""
    match = re.fullmatch(r"([-+0-9.eE]+:)(.+)", path) if may_have_torque else None
    torque, name = (match[1], match[2]) if match else ("", path)
    return torque + (name if name == "-" else str(Path(file).parent / name))


def _preset(file: str, name: str) -> str:
    """A preset of a row: a name of the library, or a path from the folder of the table."""
    return name if not name or name == "-" or name in preset_names() else str(Path(file).parent / name)


def _of_folder(folder: Path, base: Request) -> Lot:
    try:
        files = sorted(item for item in folder.iterdir() if item.is_file() and not item.name.startswith("."))
    except OSError as error:
        raise DataError(f"cannot read {folder}: {error.strerror}") from None
    presets = [item for item in files if item.suffix in (".yaml", ".yml")]
    if not presets:
        raise DataError(f"{folder}: no preset in the folder", "one NAME.yaml a drive, its trace beside it as NAME.csv")
    traces: dict[str, list[str]] = {item.stem: [] for item in presets}
    spare = []
    for item in files:
        match = _TRACE.fullmatch(item.name)
        stem = match["stem"] if match else ""
        if match and stem in traces:
            traces[stem].append((f"{match['torque']}:" if match["torque"] else "") + str(item))
        elif match:
            spare.append(item.name)
    rows = []
    for item in presets:
        request = replace(base, preset=str(item), serial=item.stem, measured=tuple(traces[item.stem]))
        rows.append(LotRow(item.stem, request, str(item), _twin(item, presets)))
    measured = sum(map(bool, traces.values()))
    notes = [f"{len(rows)} presets, {measured} of them with traces"]
    notes += [f"traces without a preset: {shown(', '.join(spare))}"] * bool(spare)
    return Lot(str(folder), None, tuple(rows), tuple(notes))


def _twin(item: Path, presets: Sequence[Path]) -> DataError | None:
    others = [other.name for other in presets if other.stem == item.stem and other != item]
    return DataError(f"{item}: {others[0]} is of the same drive", "one preset for each drive") if others else None
