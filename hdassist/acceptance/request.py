"""Requests of an acceptance as plain data, of one drive or of each row of a lot; what a request names, read.

A request is kept beside its answer, and can be carried out again. Columns of a lot: serial, preset, measured or
measured@80 (a file), pitch_b, pitch_g (files of measured teeth), mark_b, mark_g (directions of their marks),
NAME[@TORQUE] (a value with its uncertainty, measured otherwise), limit NAME[@TORQUE], section.key (an override of the
preset). Names that begin with # or note are not used. A column is a field of the request, its cells add to that as the
option would, and their faults are reported with their places.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from math import isclose, isnan
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from hdassist.acceptance.decision import AcceptedValue, Predictions, order_place, predict
from hdassist.acceptance.limits import (
    F_IOR,
    LIMIT_NAME,
    Extent,
    Limit,
    LimitText,
    limits_of,
    load_limited,
    named_overrides,
)
from hdassist.belief.samples import EFFECTIVE_SAMPLES
from hdassist.errors import SURE, DataError, Fault, Finding, HdassistError, PresetError, UsageError
from hdassist.files import STDIN, is_file, number_of, preset_names
from hdassist.loading import Asked
from hdassist.measuring.bench import PositionRecord, SeenRange, StatedQuantity, position_quantities, seen_range
from hdassist.measuring.fit import COVERAGE_FACTOR
from hdassist.measuring.measure import Measurement, Reading
from hdassist.measuring.orders import parse_stated, stated_sources
from hdassist.model.deviations import MeasuredTeeth
from hdassist.model.geometry import Kinematics
from hdassist.preset.fields import REMOVED, Drive, OneLine, field_table, is_number, is_overridden, path_of
from hdassist.preset.text import InvalidValueError, near_miss, shown
from hdassist.readers.pitch import WheelFiles
from hdassist.readers.table import CellTable, NumberTable, read_texts, shortened
from hdassist.readers.trace import MAX_TRACE_BYTES
from hdassist.run.kept import ClosedRecord
from hdassist.run.run import Run

_PRINTED = 5e-6  # of a torque: rounding of sheets that print six digits of it
_TABLES = (".csv", ".tsv", ".csv.gz", ".tsv.gz")
_MARK_COLUMNS = ("mark_b", "mark_g")
_FILE_COLUMNS = ("preset", "pitch_b", "pitch_g", "measured")
_PLAIN_COLUMNS = ("serial", *_FILE_COLUMNS[:3], *_MARK_COLUMNS)
_LISTS = ("overrides", "limits", "measured", "values")  # fields of a request that cells are added to
_LIMIT = re.compile(r"limits?[\s:_]+(.+)", re.IGNORECASE)
_MEASURED = re.compile(r"measured(?:\s*@\s*(.+))?", re.IGNORECASE)
_UNUSED = re.compile(r"#|note", re.IGNORECASE)


@dataclass(frozen=True)
class Inputs:
    """Inputs of a request, read: its drive, traces by torque [N*m], values by limit, measured wheels.

    positions: tables of approached positions by torque [N*m], with what they tell of F'_ior.
    """

    drive: Drive
    measurements: dict[float, Measurement] = field(default_factory=dict)
    stated: dict[Limit, AcceptedValue] = field(default_factory=dict)
    wheels: MeasuredTeeth | None = None
    positions: dict[float, tuple[NumberTable, SeenRange]] = field(default_factory=dict)

    @property
    def unmeasured(self) -> tuple[Limit, ...]:
        """Limits of the drive that neither a trace nor a stated value is for.

        Raises DataError: no limit, something measured that no limit is for, or an order that the full cycle does not
        have; UsageError: such an order on the command line.
        """
        drive, limits = self.drive, limits_of(self.drive)
        for order in filter(None, (limit.per_cam_rev for limit in limits)):
            try:
                order_place(Kinematics.of(drive), order)
            except UsageError as error:
                if is_overridden("acceptance.order_amplitude", drive.origin.overrides):
                    raise
                raise DataError(f"{drive.name}: acceptance.order_amplitude: {error.message}", error.hint) from None
        by_trace = [limit for limit in limits if limit.check.of_trace and limit.M_g_Nm in self.measurements]
        if without := set(self.measurements) - {limit.M_g_Nm for limit in by_trace}:
            words = f"{drive.name}: measured at {min(without):g} N*m, for which there is no limit"
            raise DataError(words, f"--limit F_ior@{min(without):.15g}=30")
        return tuple(limit for limit in limits if limit not in by_trace and limit not in self.stated)


@dataclass(frozen=True)
class Request(ClosedRecord):
    """One drive to accept, with each part as the options of the command line give it.

    preset: a name, a path or -.
    serial: serial number of the drive, for reports.
    overrides: overrides of the preset.
    limits: limits instead of those of the preset.
    measured: recordings.
    values: values measured otherwise.
    reading: how recordings are read.
    measured_only: whether to make no prediction.
    cross_check: solver that solves some predicted states again.
    draws: minimum effective sample size of the uncertain inputs.
    sure: probability of meeting a limit that PASS of a prediction needs.
    seed: seed of the samples.
    wheels: wheels with measured teeth, for predictions.
    strict: whether every limit has to be decided by a measurement.
    shared: serial numbers of other drives of the lot with one of the same recordings.
    shared_records: whether such recordings decide nevertheless.
    """

    preset: OneLine
    serial: OneLine = ""
    overrides: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()
    measured: tuple[str, ...] = ()
    values: tuple[str, ...] = ()
    reading: Reading = field(default_factory=Reading)
    measured_only: bool = False
    cross_check: str = "highs"
    seed: Annotated[int, Field(ge=0)] = 0
    wheels: WheelFiles = field(default_factory=WheelFiles)
    draws: Annotated[int, Field(ge=0)] = EFFECTIVE_SAMPLES
    sure: Annotated[float, Field(ge=0.5, lt=1)] = SURE
    strict: bool = False
    shared: tuple[OneLine, ...] = ()
    shared_records: bool = False

    def files(self) -> list[str]:
        """Return the paths of all files read for the request; the preset, the first one, may be one of the library."""
        wheels = [] if self.measured_only else self.wheels.files.values()
        return [self.preset, *(torque_and_file(text)[1] for text in self.measured), *wheels]

    def load(self, asked: Asked = ()) -> Drive:
        """The drive, its limits included; asked, options that go into its origin.

        Raises DataError, PresetError or UsageError (a bad override or limit).
        """
        limits = [LimitText.parse(text, "--limit") for text in self.limits]
        return load_limited(self.preset, self.overrides, limits, asked)

    def require_sound(self) -> None:
        """Raise UsageError for parts that every drive of a lot would be refused for, or the fault of their preset."""
        self.reading.require_sound()
        if self.preset:
            self.load()

    def traces(self, drive: Drive) -> dict[float, str]:
        """Files of traces by torque [N*m]. Raises UsageError: the limits leave a torque open, or one stands twice."""
        files: dict[float, str] = {}
        for text in self.measured:
            torque, file = torque_and_file(text)
            held = dict.fromkeys(limit.M_g_Nm for limit in limits_of(drive) if limit.M_g_Nm is not None)
            torques = [float(torque)] if torque else list(held or drive.operation.M_g[:1])
            if len(torques) > 1:
                named = ", ".join(f"{M_g:g}={text}" for M_g in torques)
                raise UsageError(f"--measured {text}: the torque is missing", f"write one of {named}")
            if torques[0] in files:
                words = f"two recordings at {torques[0]:g} N*m"
                raise UsageError(words, "give one recording for each torque; join repeated runs in one file")
            files[torques[0]] = file
        return files

    def read(self, drive: Drive) -> Inputs:
        """The inputs of the request, read, with the drive.

        Raises UsageError where the torque of a trace is open or stands twice, or a value is none of a limit;
        PresetError or DataError for a file that cannot be used; UntrustedError where a record does not tell its orders
        apart.
        """
        files = self.traces(drive).items()
        how = {"seed": self.seed, "travel_deg": drive.acceptance.travel}
        measurements: dict[float, Measurement] = {}
        positions: dict[float, tuple[NumberTable, SeenRange]] = {}
        given = stated_values(self.values, drive)
        recorded: dict[Limit, AcceptedValue] = {}
        for M_g, file in files:
            found = self.reading.measured_or_bench(file, drive, M_g=M_g, **how)
            if isinstance(found, Measurement):
                measurements[M_g] = found
                own = (each for each in given if each.check.of_trace and each.M_g_Nm == M_g)
                if not found.trace.is_between_torques:
                    recorded |= {each: AcceptedValue.measured(each, found.directions[0]) for each in own}
            elif isinstance(found, PositionRecord):
                quantities = position_quantities(found, seed=self.seed)
                if (plan := found.plan) and plan.drive != drive.name:
                    words = f"{found.table.file}: the positions were planned for {plan.drive}, not for {drive.name}"
                    raise DataError(
                        words, f"plan the test of {drive.name} with hdassist plan {drive.name} --approach FILE"
                    )
                seen = seen_range(found, quantities)
                if seen is None:
                    advice = "approach at least two positions; 12 or 211 positions capture more of F'_ior"
                    raise DataError(f"{found.table.file}: F'_ior needs at least two positions, it lists one", advice)
                positions[M_g] = found.table, seen
                recorded |= self._at_positions(*positions[M_g], quantities, M_g, drive)
            else:
                words = f"{found.table.file}: F'_ior cannot be computed from a torque loop"
                raise DataError(
                    words, "compute its figures with hdassist measure; pass them to accept with --value NAME=VALUE±U"
                )
        for limit in given:
            if limit in recorded and recorded[limit].value is not None:
                raise UsageError(f"both a value and a recording for {limit.label}", "leave out one of the two")
        return Inputs(drive, measurements, recorded | given, self.read_wheels(drive), positions)

    def _at_positions(
        self, table: NumberTable, found: SeenRange, quantities: Sequence[StatedQuantity], M_g: float, drive: Drive
    ) -> dict[Limit, AcceptedValue]:
        """Values by approached positions at a torque M_g [N*m], of the limits of a drive that they are for.

        Raises DataError: positions of a plan at another torque, or that no limit is for.
        """
        by_name = {each.name: each for each in quantities}
        if found.M_g is not None and not isclose(found.M_g, M_g, rel_tol=_PRINTED):
            words = f"{table.file}: planned for {found.M_g:.9g} N*m, not for {M_g:.9g} N*m"
            raise DataError(words, f"--measured {found.M_g:.9g}={table.file}")
        sources = stated_sources(parse_stated(self.reading.budget))
        values = {}
        for limit in limits_of(drive):
            if limit.check is F_IOR and limit.M_g_Nm == M_g:
                values[limit] = AcceptedValue.at_positions(found, sources)
            elif own := by_name.get(limit.check.field):
                unsure = own.uncertainty_arcsec
                extent: Extent = "at least" if found.is_cut else "whole"
                if unsure is None:
                    extent = "scatter not known"
                values[limit] = AcceptedValue(own.arcsec, COVERAGE_FACTOR * (unsure or 0.0), "measured", extent)
        if not values:
            raise DataError(
                f"{drive.name}: positions at {M_g:g} N*m, for which there is no limit", f"--limit F_ior@{M_g:.15g}=30"
            )
        return values

    def read_wheels(self, drive: Drive) -> MeasuredTeeth | None:
        """Measured wheels; None without any, and without a prediction. Raises what WheelFiles.read does."""
        self.wheels.require_sound()
        return None if self.measured_only else self.wheels.read(drive)

    def predict(
        self, drive: Drive, limits: Sequence[Limit], wheels: MeasuredTeeth | None, run: Run = Run()
    ) -> Predictions | None:
        """Predictions for limits of the drive; None without any, and without a prediction.

        Raises UntrustedError: no answer to be trusted.
        """
        limits = tuple(limit for limit in limits if limit.check.needs)
        if self.measured_only or self.strict or not limits:
            return None
        run = replace(run, seed=self.seed, cross_check=self.cross_check)
        return predict(drive, limits=limits, wheels=wheels, draws=self.draws, sure=self.sure, run=run)


def torque_and_file(text: str) -> tuple[str, str]:
    """Torque as it is written, empty for none, and file of [TORQUE=]FILE."""
    torque, _, file = text.partition("=")
    return ("", text) if isnan(number_of(torque)) else (torque, file)


def stated_values(texts: Sequence[str], drive: Drive) -> dict[Limit, AcceptedValue]:
    """Values measured otherwise, by the limit of the drive that they are for.

    Raises UsageError: a text that is no value, one without its uncertainty, or one that no limit of the drive is for.
    """
    values: dict[Limit, AcceptedValue] = {}
    for given in (LimitText.parse(text, "--value") for text in texts):
        limit = given.limit_of(limits_of(drive))
        if limit in values:
            raise UsageError(f"--value {given}: given twice")
        values[limit] = AcceptedValue.stated(given, limit)
    return values


@dataclass(frozen=True)
class LotRow:
    """One drive to accept: its request, its place (FILE:LINE; None: no row of a lot).

    fault: of the row itself; then the request is not to be carried out. cells: those that set options, their names in
    messages (FILE:LINE:COLUMN: heading) and texts by how messages call the values that they set.
    """

    request: Request
    place: str | None = None
    fault: HdassistError | None = None
    cells: Mapping[str, tuple[str, str]] = field(default_factory=dict, compare=False)

    def message(self, error: HdassistError) -> str:
        """The message of an error, naming cells of the row in place of options."""
        if self.place is None or error is self.fault:
            return error.message
        message = named_overrides(error.message, [f"--set {text}" for text in self.request.overrides])
        message = "\n".join(map(self._in_cell, message.splitlines()))
        return message if self.place in message else f"{self.place}: {message}"

    def _in_cell(self, line: str) -> str:
        """A line of a message, with the cell in place of the option that it names."""
        called = max((cell for cell in self.cells if cell in line), key=len, default="")
        if not called:
            return line
        name, text = self.cells[called]
        rest = line.partition(f"{called}: ")[2]
        got = "" if not rest or "(got " in rest else f" (got {shown(text)})"
        return f"{name}: {rest or line}{got}"


@dataclass(frozen=True)
class Lot:
    """Drives to accept: file that names them with its SHA-256, rows in its order, and lines taken as remarks."""

    file: str
    sha256: str
    rows: tuple[LotRow, ...]
    remarks: tuple[int, ...] = ()

    def with_shared_records(self) -> Lot:
        """Return the lot with the other drives named in each request whose recording is that of several drives."""
        recordings = [_recordings(row.request) for row in self.rows]
        serials: dict[str, dict[str, None]] = {}  # of the drives of each recording, by its SHA-256
        for row, found in zip(self.rows, recordings, strict=True):
            for sha256 in found:
                serials.setdefault(sha256, {})[row.request.serial] = None
        rows = []
        for row, found in zip(self.rows, recordings, strict=True):
            others = dict.fromkeys(serial for sha256 in found for serial in serials[sha256])
            others.pop(row.request.serial, None)
            rows.append(replace(row, request=replace(row.request, shared=tuple(others))) if others else row)
        return replace(self, rows=tuple(rows))


def _recordings(request: Request) -> list[str]:
    """Return the SHA-256 of each recording of a request that is a file; a file that cannot be read has none."""
    found = []
    for text in request.measured:
        path = torque_and_file(text)[1]
        with suppress(OSError, ValueError):
            if is_file(path) and os.path.getsize(path) <= MAX_TRACE_BYTES:  # noqa: PTH202 (a path may have a NUL)
                with open(path, "rb") as stream:  # noqa: PTH123
                    found.append(hashlib.file_digest(stream, "sha256").hexdigest())
    return found


_Column = tuple[str, str]  # the field of a request (or of its wheels) that a column gives, and the text before a cell


def is_lot(path: str) -> bool:
    """Whether an argument is a lot: a file with the name of a table."""
    return path.lower().endswith(_TABLES)


def read_lot(path: str, base: Request) -> Lot:
    """Read a lot.

    Arguments: path of a table; base, the request of every drive, its preset empty or that of rows without one. A row
    adds its cells.
    Raises DataError: a file that cannot be read or has no drive; PresetError: names of columns that cannot be meant.
    The fault of a row is kept with it.
    """
    table = read_texts(path)
    columns = _columns(table)
    lines: dict[str, list[int]] = {}  # of each serial
    for line, cells in table.rows:
        for cell, column in zip(cells, columns, strict=False):
            if column == ("serial", ""):
                lines.setdefault(cell.text, []).append(line)
    rows = [_row(table, columns, place, base, lines) for place in range(len(table.rows))]
    return Lot(table.file, table.sha256, tuple(rows), table.remarks)


def _columns(table: CellTable) -> list[_Column | None]:
    """Columns of a table; None for those that are not used. Raises PresetError: every name that cannot be meant."""
    findings: list[Finding] = []
    columns: list[_Column | None] = []
    for name in table.names:
        try:
            column = _column(name.text) if name.text and not _UNUSED.match(name.text) else None
            if column and column in columns:
                raise InvalidValueError(f"column {columns.index(column) + 1} has the same name")
        except InvalidValueError as fault:
            column = None
            place = table.file, table.names_line, name.column, name.text
            findings.append(Finding(*place, fault.message, hint=fault.hint))
        columns.append(column)
    if len(findings) == len(table.names) > 1:
        remedy = f"for a recording use hdassist measure {table.file}, or accept PRESET --measured TORQUE={table.file}"
        raise DataError(f"{table.file}: no column name belongs to a lot file", remedy, Fault.FILE_INVALID)
    if findings:
        raise PresetError(findings)
    return columns


def _column(name: str) -> _Column:
    """The field that a column gives. Raises InvalidValueError: none."""
    if name.lower() in _PLAIN_COLUMNS:
        return name.lower(), ""
    if at := _MEASURED.fullmatch(name):
        if at[1] and not is_number(at[1]):
            raise InvalidValueError("not a column of a lot", "for example measured@80")
        return "measured", f"{float(at[1]):g}=" if at[1] else ""
    limit = _LIMIT.fullmatch(name)
    for gives, text in (("limits", limit[1] if limit else ""), ("values", name)):
        if LIMIT_NAME.fullmatch(text.strip()):
            return gives, f"{text.strip()}="
    if ".".join(map(str, path_of(name)[:2])) in field_table():
        return "overrides", f"{name}="
    typed = name.partition("@")[2].replace(",", ".")
    torque = typed if is_number(typed) else "80"
    examples = [f"{column}@{torque}" for column in ("F_ior", "limit F_ior", "measured")]
    known = [*_PLAIN_COLUMNS, "measured", *field_table(), *examples]
    hint = (
        REMOVED.get(name)
        or near_miss(name, known)
        or "use F_ior@80, limit F_ior@80, section.key, or note for a column to ignore"
    )
    raise InvalidValueError("not a column of a lot", hint)


def _row(
    table: CellTable, columns: Sequence[_Column | None], place: int, base: Request, lines: Mapping[str, list[int]]
) -> LotRow:
    """One row by its place; lines: those in which each serial stands."""
    line, cells = table.rows[place]
    folder = Path() if table.file == STDIN else Path(table.file).parent
    given: dict[str, Any] = {"serial": "" if ("serial", "") in columns else f"line {line}"}
    named: dict[str, tuple[str, str]] = {}
    faults = []

    def wrong(column: int, path: str, message: str, got: str = "", hint: str = "") -> None:
        faults.append(Finding(table.file, line, column, path, message, shown(got), hint))

    if opened := table.unclosed.get(line):
        wrong(opened, "", "quotes are not closed", hint="close the quotes at the end of the cell")
    for index, cell in enumerate(cells):
        name, column = (table.names[index].text, columns[index]) if index < len(columns) else ("", None)
        if cell.text and not name:
            wrong(
                cell.column,
                "",
                "a cell in a column without a name",
                cell.text,
                "put a cell that contains a comma in quotes",
            )
        if not cell.text or column is None:
            continue
        gives, start = column
        text = cell.text if gives in ("serial", *_FILE_COLUMNS) else table.with_points(cell.text)
        if gives == "measured" and not start:
            torque, text = torque_and_file(text)
            start = f"{torque}=" if torque else ""
        if gives in _FILE_COLUMNS:
            if text == "-":
                wrong(cell.column, name, "a row cannot read standard input", "-", "name a file")
            elif gives != "preset" or text not in preset_names():
                text = str(folder / text)
        elif gives in _MARK_COLUMNS and not is_number(text):
            wrong(cell.column, name, "must be an angle in deg", cell.text)
            continue
        given[gives] = (*given.get(gives, getattr(base, gives)), start + text) if gives in _LISTS else text
        called = text if gives in _FILE_COLUMNS else f"--{gives.replace('_', '-')}" if not start else start + text
        named.setdefault(called, (f"{table.file}:{line}:{cell.column}: {shown(name)}", cell.text))
    if not given["serial"]:
        wrong(1, "serial", "missing", hint="give each drive a serial, or leave out the column")
        given["serial"] = f"line {line}"
    elif others := [other for other in lines.get(given["serial"], ()) if other != line]:
        words = f"is also in line {shortened(others)}"
        wrong(1, "serial", words, given["serial"], "write one row for each drive")
    given |= {mark: float(given[mark]) for mark in _MARK_COLUMNS if mark in given}
    wheels = {option.name: given.pop(option.name) for option in fields(WheelFiles) if option.name in given}
    request = replace(base, **given, wheels=replace(base.wheels, **wheels))
    if not request.preset:
        wrong(1, "preset", "missing", hint="add a column preset, or use --preset NAME for all rows")
    return LotRow(request, f"{table.file}:{line}", PresetError(faults) if faults else None, named)
