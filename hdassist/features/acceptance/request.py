"""Requests of an acceptance as plain data, for one drive or for each row of a lot, and reading of their inputs.

A request is stored with its result and can be executed again. A lot may have these columns: serial, preset, measured or
measured@80 (a file), pitch_b, pitch_g (files of measured teeth), mark_b, mark_g (directions of their marks),
NAME[@TORQUE] (a reported value with its uncertainty), limit NAME[@TORQUE], and section.key (an override of the preset).
Columns whose names begin with # or note are ignored. Each column corresponds to a field of the request. Its cells
extend that field as the option would, and errors in cells are reported with their positions.
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

from hdassist.belief.samples import EFFECTIVE_SAMPLES
from hdassist.drive.loading import Asked
from hdassist.drive.model.deviations import MeasuredTeeth
from hdassist.drive.model.geometry import Kinematics
from hdassist.drive.preset.fields import REMOVED, Drive, OneLine, field_table, is_number, is_overridden, path_of
from hdassist.drive.preset.text import InvalidValueError, near_miss, shown
from hdassist.features.acceptance.decision import AcceptedValue, Predictions, order_place, predict
from hdassist.features.acceptance.limits import (
    F_IOR,
    LIMIT_NAME,
    Extent,
    Limit,
    LimitText,
    NoLimitError,
    limits_of,
    load_limited,
    named_overrides,
)
from hdassist.features.measuring.bench import PositionRecord, SeenRange, StatedQuantity, position_quantities, seen_range
from hdassist.features.measuring.measure import Measurement, Reading
from hdassist.features.measuring.orders import parse_stated, stated_sources
from hdassist.readers.pitch import WheelFiles
from hdassist.readers.table import CellTable, NumberTable, read_texts, shortened
from hdassist.readers.trace import MAX_TRACE_BYTES
from hdassist.readers.words import Cell
from hdassist.run.errors import SURE, DataError, Fault, Finding, HdassistError, PresetError, UsageError
from hdassist.run.files import STDIN, is_file, number_of, preset_names
from hdassist.run.kept import ClosedRecord
from hdassist.run.run import Run

_PRINTED = 5e-6  # relative rounding error of a torque on sheets that print six digits
_TABLES = (".csv", ".tsv", ".csv.gz", ".tsv.gz")
_MARK_COLUMNS = ("mark_b", "mark_g")
_FILE_COLUMNS = ("preset", "pitch_b", "pitch_g", "measured")
_PLAIN_COLUMNS = ("serial", *_FILE_COLUMNS[:3], *_MARK_COLUMNS)
_LISTS = ("overrides", "limits", "measured", "values")  # fields of a request to which cells are added
_LIMIT = re.compile(r"limits?[\s:_]+(.+)", re.IGNORECASE)
_MEASURED = re.compile(r"measured(?:\s*@\s*(.+))?", re.IGNORECASE)
_UNUSED = re.compile(r"#|note", re.IGNORECASE)


@dataclass(frozen=True)
class Inputs:
    """Inputs of a request, as read.

    drive: the drive.
    measurements: results of recordings by torque [N*m].
    stated: values from reports and from recordings of positions, by limit.
    wheels: measured wheels, None if there are none.
    positions: tables of approached positions by torque [N*m], with the range of F'_ior that they capture.
    """

    drive: Drive
    measurements: dict[float, Measurement] = field(default_factory=dict)
    stated: dict[Limit, AcceptedValue] = field(default_factory=dict)
    wheels: MeasuredTeeth | None = None
    positions: dict[float, tuple[NumberTable, SeenRange]] = field(default_factory=dict)

    @property
    def unmeasured(self) -> tuple[Limit, ...]:
        """The limits of the drive for which there is neither a recording nor a value.

        Raises DataError if there is no limit, if a recording belongs to no limit, or if an order of the preset does not
        exist in the full cycle.
        Raises UsageError if an order on the command line does not exist in the full cycle.
        """
        drive = self.drive
        limits = limits_of(drive)
        # an order that the full cycle does not have can be neither measured nor predicted
        for order in filter(None, (limit.per_cam_rev for limit in limits)):
            try:
                order_place(Kinematics.of(drive), order)
            except UsageError as error:
                # an error on the command line is wrong usage, one in the preset is invalid data
                if is_overridden("acceptance.order_amplitude", drive.origin.overrides):
                    raise
                raise DataError(f"{drive.name}: acceptance.order_amplitude: {error.message}", error.hint) from None
        by_trace = [limit for limit in limits if limit.check.of_trace and limit.M_g_Nm in self.measurements]
        without_limit = set(self.measurements) - {limit.M_g_Nm for limit in by_trace}
        # a recording without a limit was most likely made at another torque
        if without_limit:
            M_g = min(without_limit)
            message = f"{drive.name} was measured at {M_g:g} N*m, for which no limit is set"
            raise DataError(message, f"add a limit, for example --limit F_ior@{M_g:.15g}=30")
        return tuple(limit for limit in limits if limit not in by_trace and limit not in self.stated)


@dataclass(frozen=True)
class Request(ClosedRecord):
    """A drive to accept, with each field as given by the options of the command line.

    preset: name, path or "-".
    serial: serial number of the drive, for reports.
    overrides: overrides of the preset.
    limits: limits that replace those of the preset.
    measured: recordings.
    values: reported values.
    reading: options for reading recordings.
    measured_only: whether predictions are omitted.
    cross_check: solver that solves some predicted states again.
    seed: seed of the samples.
    wheels: wheels with measured teeth, for predictions.
    draws: minimum effective sample size of the uncertain inputs.
    sure: probability of meeting a limit that PASS of a prediction requires.
    strict: whether every limit must be decided by a measurement.
    shared: serial numbers of other drives of the lot that use a recording of this drive.
    shared_records: whether shared recordings are allowed to decide.
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
        """Return the paths of all files read for the request, beginning with the preset or its name in the library."""
        # only predictions need measured wheels
        wheels = [] if self.measured_only else self.wheels.files.values()
        return [self.preset, *(torque_and_file(text)[1] for text in self.measured), *wheels]

    def load(self, asked: Asked = ()) -> Drive:
        """Return the drive with its limits.

        asked: options that become part of the drive's origin.
        Raises DataError or PresetError for an unusable preset.
        Raises UsageError for an invalid override or limit.
        """
        limits = [LimitText.parse(text, "--limit") for text in self.limits]
        return load_limited(self.preset, self.overrides, limits, asked)

    def require_sound(self) -> None:
        """Raise UsageError for options that are invalid for every drive of a lot, or the error of their preset."""
        self.reading.require_sound()
        # in a lot the preset may be a column
        if self.preset:
            self.load()

    def traces(self, drive: Drive) -> dict[float, str]:
        """Return the files of recordings by torque [N*m].

        Raises UsageError if the limits do not determine a torque, or if there are two recordings at one torque.
        """
        files: dict[float, str] = {}
        for text in self.measured:
            torque, file = torque_and_file(text)
            limited_torques = dict.fromkeys(limit.M_g_Nm for limit in limits_of(drive) if limit.M_g_Nm is not None)
            # if no torque is stated, the only torque with a limit applies
            torques = [float(torque)] if torque else list(limited_torques or drive.operation.M_g[:1])
            if len(torques) > 1:
                named = ", ".join(f"{M_g:g}={text}" for M_g in torques)
                raise UsageError(f"--measured {text}: the torque is missing", f"write one of {named}")
            # a second recording would replace the first one
            if torques[0] in files:
                message = f"--measured names two recordings at {torques[0]:g} N*m"
                raise UsageError(message, "give one recording for each torque; combine repeated runs in one file")
            files[torques[0]] = file
        return files

    def read(self, drive: Drive) -> Inputs:
        """Return the inputs of the request for a drive, as read.

        Raises UsageError if the torque of a recording is ambiguous, if there are two recordings at one torque, or if a
        value belongs to no limit.
        Raises PresetError or DataError for an unusable file.
        Raises UntrustedError if a recording does not resolve its orders.
        """
        files = self.traces(drive)
        stated = stated_values(self.values, drive)
        measurements: dict[float, Measurement] = {}
        positions: dict[float, tuple[NumberTable, SeenRange]] = {}
        recorded: dict[Limit, AcceptedValue] = {}
        # the kind of a file is known only after reading it
        for M_g, file in files.items():
            record = self.reading.measured_or_bench(
                file, drive, M_g=M_g, seed=self.seed, travel_deg=drive.acceptance.travel
            )
            if isinstance(record, Measurement):
                measurements[M_g] = record
                recorded |= _recorded_values(record, M_g, stated)
            elif isinstance(record, PositionRecord):
                quantities = position_quantities(record, seed=self.seed)
                error_range = _range_of_positions(record, quantities, drive)
                positions[M_g] = (record.table, error_range)
                recorded |= self._at_positions(record.table, error_range, quantities, M_g, drive)
            else:
                message = f"{record.table.file}: F'_ior cannot be computed from a torque loop"
                hint = (
                    "compute its quantities with hdassist measure, and pass them to hdassist accept "
                    "with --value NAME=VALUE±U"
                )
                raise DataError(message, hint)
        for limit in stated:
            # a value and a recording for the same limit may contradict each other
            if limit in recorded and recorded[limit].value is not None:
                message = f"both a value and a recording are given for {limit.label}"
                raise UsageError(message, "leave out one of the two")
        return Inputs(
            drive=drive,
            measurements=measurements,
            stated=recorded | stated,
            wheels=self.read_wheels(drive),
            positions=positions,
        )

    def _at_positions(
        self,
        table: NumberTable,
        error_range: SeenRange,
        quantities: Sequence[StatedQuantity],
        M_g: float,
        drive: Drive,
    ) -> dict[Limit, AcceptedValue]:
        """Return the values from approached positions at a torque, by limit of the drive.

        table: table of the positions.
        error_range: range of F'_ior at the positions.
        quantities: further quantities of the positions.
        M_g: torque [N*m].
        drive: the drive.
        Raises DataError if the positions were planned for another torque, or no limit applies to them.
        """
        # the sheet states the torque for which it was planned
        if error_range.M_g is not None and not isclose(error_range.M_g, M_g, rel_tol=_PRINTED):
            message = f"{table.file}: the test was planned for {error_range.M_g:.9g} N*m, not for {M_g:.9g} N*m"
            raise DataError(message, f"state this torque: --measured {error_range.M_g:.9g}={table.file}")
        by_name = {quantity.name: quantity for quantity in quantities}
        sources = stated_sources(parse_stated(self.reading.budget))
        values = {}
        for limit in limits_of(drive):
            quantity = by_name.get(limit.check.field)
            # positions capture a part of F'_ior; their other figures are complete
            if limit.check is F_IOR and limit.M_g_Nm == M_g:
                values[limit] = AcceptedValue.at_positions(error_range, sources)
            elif quantity is not None:
                values[limit] = _accepted_quantity(quantity, is_cut=error_range.is_cut)
        if not values:
            raise DataError(
                f"{drive.name}: the positions were approached at {M_g:g} N*m, for which no limit is set",
                f"add a limit, for example --limit F_ior@{M_g:.15g}=30",
            )
        return values

    def read_wheels(self, drive: Drive) -> MeasuredTeeth | None:
        """Return the measured wheels, or None if there are none or predictions are omitted.

        The errors raised are those of `WheelFiles.read` and `WheelFiles.require_sound`.
        """
        self.wheels.require_sound()
        return None if self.measured_only else self.wheels.read(drive)

    def predict(
        self,
        drive: Drive,
        limits: Sequence[Limit],
        wheels: MeasuredTeeth | None,
        run: Run = Run(),
    ) -> Predictions | None:
        """Return predictions for limits of the drive, or None if no limit can be predicted or predictions are omitted.

        Raises UntrustedError if a result is not reliable.
        """
        # some checks can only be measured
        limits = tuple(limit for limit in limits if limit.check.needs)
        if self.measured_only or self.strict or not limits:
            return None
        run = replace(
            run,
            seed=self.seed,
            cross_check=self.cross_check,
        )
        return predict(
            drive,
            limits=limits,
            wheels=wheels,
            draws=self.draws,
            sure=self.sure,
            run=run,
        )


def _recorded_values(
    measurement: Measurement,
    M_g: float,
    stated: Mapping[Limit, AcceptedValue],
) -> dict[Limit, AcceptedValue]:
    """Return the values of a recording for limits that also have a reported value, to detect a conflict.

    A recording made only at other torques has no values.
    """
    # a recording at torques below and above does not contradict a reported value
    if measurement.trace.is_between_torques:
        return {}
    direction = measurement.directions[0]
    limits = [limit for limit in stated if limit.check.of_trace and limit.M_g_Nm == M_g]
    return {limit: AcceptedValue.measured(limit, direction) for limit in limits}


def _range_of_positions(
    record: PositionRecord,
    quantities: Sequence[StatedQuantity],
    drive: Drive,
) -> SeenRange:
    """Return the range of F'_ior at approached positions of a drive.

    Raises DataError if the positions were planned for another drive, or if there is only one position.
    """
    # the sheet was planned for another drive
    if record.plan and record.plan.drive != drive.name:
        message = f"{record.table.file}: the positions were planned for {record.plan.drive}, not for {drive.name}"
        raise DataError(message, f"plan the test of {drive.name} with hdassist plan {drive.name} --approach FILE")
    error_range = seen_range(record, quantities)
    if error_range is None:
        message = f"{record.table.file}: F'_ior needs at least two positions, but the file lists one"
        raise DataError(message, "approach at least two positions; 12 or 211 positions capture more of F'_ior")
    return error_range


def _accepted_quantity(quantity: StatedQuantity, *, is_cut: bool) -> AcceptedValue:
    """Return a quantity of approached positions as a value.

    is_cut: whether the positions cover only a part of the plan.
    """
    # missing positions may be those with the largest deviations
    extent: Extent = "at least" if is_cut else "whole"
    if quantity.uncertainty_arcsec is None:
        extent = "scatter not known"
    return AcceptedValue(
        value=quantity.arcsec,
        expanded_uncertainty=quantity.expanded_arcsec,
        basis="measured",
        extent=extent,
    )


def torque_and_file(text: str) -> tuple[str, str]:
    """Return the torque as written (empty if there is none) and the file of [TORQUE=]FILE."""
    torque, _, file = text.partition("=")
    # a path may contain "="
    return ("", text) if isnan(number_of(torque)) else (torque, file)


def stated_values(texts: Sequence[str], drive: Drive) -> dict[Limit, AcceptedValue]:
    """Return reported values by limit of the drive.

    Raises UsageError if a text is not a value or has no uncertainty, or if the drive has no limit for it.
    """
    values: dict[Limit, AcceptedValue] = {}
    for text in texts:
        stated = LimitText.parse(text, "--value")
        limit = stated.limit_of(limits_of(drive))
        if limit in values:
            raise UsageError(f"--value {stated} is given twice", "give each value once")
        values[limit] = AcceptedValue.stated(stated, limit)
    return values


@dataclass(frozen=True)
class LotRow:
    """A drive to accept as a row of a lot.

    request: request for the drive.
    place: position of the row, FILE:LINE; None if the drive is not a row of a lot.
    fault: error in the row itself, None if there is none. A request with an error must not be executed.
    cells: name in messages (FILE:LINE:COLUMN: heading) and text of each cell that sets an option, by the name that
    messages use for the option's value.
    empty_limits: name in messages (FILE:LINE: heading) of each empty cell in a column of limits.
    """

    request: Request
    place: str | None = None
    fault: HdassistError | None = None
    cells: Mapping[str, tuple[str, str]] = field(default_factory=dict, compare=False)
    empty_limits: tuple[str, ...] = field(default=(), compare=False)

    def message(self, error: HdassistError) -> str:
        """Return the message of an error, with cells of the row named instead of options."""
        # the drive is not part of a lot, or the message already names the row
        if self.place is None or error is self.fault:
            return error.message
        if isinstance(error, NoLimitError) and self.empty_limits:
            unnamed = len(self.empty_limits) - 1
            unnamed_words = f" (and {unnamed} more)" if unnamed else ""
            return f"{self.empty_limits[0]}{unnamed_words}: the cell is empty, and {error.message}"
        message = named_overrides(error.message, [f"--set {text}" for text in self.request.overrides])
        message = "\n".join(map(self._in_cell, message.splitlines()))
        return message if self.place in message else f"{self.place}: {message}"

    def _in_cell(self, line: str) -> str:
        """Return a line of a message, with the cell named instead of the option."""
        # the longest match applies, because --limit F_ior@80 contains --limit F_ior@8
        option = max((option for option in self.cells if option in line), key=len, default="")
        if not option:
            return line
        name, text = self.cells[option]
        fault = line.partition(f"{option}: ")[2]
        got = "" if not fault or "(got " in fault else f" (got {shown(text)})"
        return f"{name}: {fault or line}{got}"


@dataclass(frozen=True)
class Lot:
    """Drives to accept.

    file: file that lists them.
    sha256: its checksum.
    rows: rows in the order of the file.
    remarks: lines treated as comments.
    """

    file: str
    sha256: str
    rows: tuple[LotRow, ...]
    remarks: tuple[int, ...] = ()

    def with_shared_records(self) -> Lot:
        """Return the lot with requests that list the serial numbers of the other drives that share their recordings."""
        recordings = [_recordings(row.request) for row in self.rows]
        serials: dict[str, dict[str, None]] = {}  # serial numbers of the drives of each recording, by its SHA-256
        for row, hashes in zip(self.rows, recordings, strict=True):
            for sha256 in hashes:
                serials.setdefault(sha256, {})[row.request.serial] = None
        rows = []
        for row, hashes in zip(self.rows, recordings, strict=True):
            sharing = dict.fromkeys(serial for sha256 in hashes for serial in serials[sha256])
            # repeated rows of one drive may share its recording
            sharing.pop(row.request.serial, None)
            if sharing:
                row = replace(row, request=replace(row.request, shared=tuple(sharing)))
            rows.append(row)
        return replace(self, rows=tuple(rows))


def _recordings(request: Request) -> list[str]:
    """Return the SHA-256 of each recording of a request that is a readable file."""
    hashes = []
    for text in request.measured:
        path = torque_and_file(text)[1]
        with suppress(OSError, ValueError):
            # a pipe cannot be read twice
            if is_file(path) and os.path.getsize(path) <= MAX_TRACE_BYTES:  # noqa: PTH202 (a path may have a NUL)
                with open(path, "rb") as stream:  # noqa: PTH123
                    hashes.append(hashlib.file_digest(stream, "sha256").hexdigest())
    return hashes


_Column = tuple[str, str]  # the field of a request (or of its wheels) for a column, and the text before each cell


def is_lot(path: str) -> bool:
    """Return whether an argument names a lot, that is, a table file."""
    return path.lower().endswith(_TABLES)


def read_lot(path: str, base: Request) -> Lot:
    """Return the lot in a file. An error in a row is stored with the row instead of being raised.

    path: path of the table.
    base: request for every drive, extended by the cells of each row. Its preset applies to rows without a preset.
    Raises DataError if the file cannot be read or lists no drive.
    Raises PresetError if column names are unusable.
    """
    table = read_texts(path)
    columns = _columns(table)
    lines: dict[str, list[int]] = {}  # lines in which each serial number occurs
    for line, cells in table.rows:
        for cell, column in zip(cells, columns, strict=False):
            # a serial that occurs twice is an error in both rows
            if column == ("serial", ""):
                lines.setdefault(cell.text, []).append(line)
    rows = [_row(table, columns, place, base, lines) for place in range(len(table.rows))]
    return Lot(
        file=table.file,
        sha256=table.sha256,
        rows=tuple(rows),
        remarks=table.remarks,
    )


def _columns(table: CellTable) -> list[_Column | None]:
    """Return the columns of a table, None for those that are ignored.

    Raises PresetError that lists all invalid column names.
    Raises DataError if none of several names is valid.
    """
    findings: list[Finding] = []
    columns: list[_Column | None] = []
    for name in table.names:
        try:
            column = _column(name.text) if name.text and not _UNUSED.match(name.text) else None
            # two columns set the same field
            if column and column in columns:
                message = f"column {columns.index(column) + 1} has the same name"
                raise InvalidValueError(message, "rename or remove one of the two columns")
        except InvalidValueError as fault:
            column = None
            findings.append(
                Finding(
                    file=table.file,
                    line=table.names_line,
                    column=name.column,
                    path=name.text,
                    message=fault.message,
                    hint=fault.hint,
                )
            )
        columns.append(column)
    # if no column fits, the table is of another kind
    if len(findings) == len(table.names) > 1:
        remedy = (
            f"for a recording, use hdassist measure {table.file} or hdassist accept PRESET --measured "
            f"TORQUE={table.file}"
        )
        raise DataError(f"{table.file}: no column has a name that is valid in a lot", remedy, Fault.FILE_INVALID)
    if findings:
        raise PresetError(findings)
    return columns


def _column(name: str) -> _Column:
    """Return the field of a column. Raises InvalidValueError if there is none."""
    if name.lower() in _PLAIN_COLUMNS:
        return name.lower(), ""
    if match := _MEASURED.fullmatch(name):
        torque = match[1]
        if torque and not is_number(torque):
            raise InvalidValueError("no column of a lot file has this name", "write the torque in N*m: measured@80")
        return "measured", f"{float(torque):g}=" if torque else ""
    limit = _LIMIT.fullmatch(name)
    for gives, text in (("limits", limit[1] if limit else ""), ("values", name)):
        if LIMIT_NAME.fullmatch(text.strip()):
            return gives, f"{text.strip()}="
    if ".".join(map(str, path_of(name)[:2])) in field_table():
        return "overrides", f"{name}="
    typed = name.partition("@")[2].replace(",", ".")
    # the hint uses the torque that was typed
    torque = typed if is_number(typed) else "80"
    examples = [f"{column}@{torque}" for column in ("F_ior", "limit F_ior", "measured")]
    possible_names = [*_PLAIN_COLUMNS, "measured", *field_table(), *examples]
    hint = (
        REMOVED.get(name)
        or near_miss(name, possible_names)
        or "name the column F_ior@80, limit F_ior@80 or section.key, or note if it is to be ignored"
    )
    raise InvalidValueError("no column of a lot file has this name", hint)


def _row(
    table: CellTable,
    columns: Sequence[_Column | None],
    place: int,
    base: Request,
    lines: Mapping[str, list[int]],
) -> LotRow:
    """Return one row of a lot.

    table: table of the lot.
    columns: field of each column, None for those that are ignored.
    place: index of the row.
    base: request for every drive.
    lines: lines in which each serial number occurs.
    """
    line, cells = table.rows[place]
    reader = _RowReader(
        table=table,
        line=line,
        base=base,
        has_serials=("serial", "") in columns,
    )
    if opened := table.unclosed.get(line):
        reader.note_fault(opened, "", "the quotes are not closed", hint="close the quotes at the end of the cell")
    for index, cell in enumerate(cells):
        if index < len(columns):
            reader.take(cell, table.names[index].text, columns[index])
        else:
            reader.take(cell, "", None)
    for index, column in enumerate(columns):
        # the reader of the table omits empty cells at the end of a line
        is_empty = index >= len(cells) or not cells[index].text
        if is_empty and column and column[0] == "limits":
            reader.empty_limits.append(f"{table.file}:{line}: {shown(table.names[index].text)}")
    reader.require_own_serial(lines)
    return reader.row()


@dataclass(eq=False)
class _RowReader:
    """A reader of the cells of one row of a lot into a request.

    table: table of the lot.
    line: line of the row.
    base: request for every drive.
    has_serials: whether the lot has a column of serial numbers.
    parts: values of the cells, by field of a request or of its wheels.
    cells: name and text of each cell, by the name that messages use for its value.
    faults: errors found in the row.
    empty_limits: name of each empty cell in a column of limits.
    """

    table: CellTable
    line: int
    base: Request
    has_serials: bool
    parts: dict[str, Any] = field(default_factory=dict)
    cells: dict[str, tuple[str, str]] = field(default_factory=dict)
    faults: list[Finding] = field(default_factory=list)
    empty_limits: list[str] = field(default_factory=list)

    def note_fault(
        self,
        column: int,
        path: str,
        message: str,
        got: str = "",
        hint: str = "",
    ) -> None:
        """Add an error in the row.

        column: column number in the line.
        path: name of the column.
        message: description of the error.
        got: text of the cell.
        hint: remedy.
        """
        finding = Finding(
            file=self.table.file,
            line=self.line,
            column=column,
            path=path,
            message=message,
            got=shown(got),
            hint=hint,
        )
        self.faults.append(finding)

    def take(
        self,
        cell: Cell,
        name: str,
        column: _Column | None,
    ) -> None:
        """Add the content of a cell to the request.

        cell: the cell.
        name: name of its column, empty if it has none.
        column: field of its column, None if the column is ignored.
        """
        if cell.text and not name:
            hint = "enclose a cell that contains a comma in quotation marks"
            self.note_fault(cell.column, "", "a cell in a column without a name", cell.text, hint)
        if not cell.text or column is None:
            return
        part, start = column
        text = cell.text if part in ("serial", *_FILE_COLUMNS) else self.table.with_points(cell.text)
        if part == "measured" and not start:
            torque, text = torque_and_file(text)
            start = f"{torque}=" if torque else ""
        if part in _FILE_COLUMNS:
            text = self._path(cell, name, part, text)
        elif part in _MARK_COLUMNS and not is_number(text):
            self.note_fault(cell.column, name, "must be an angle in deg", cell.text)
            return
        if part in _LISTS:
            self.parts[part] = (*self.parts.get(part, getattr(self.base, part)), start + text)
        else:
            self.parts[part] = text
        name_of_cell = f"{self.table.file}:{self.line}:{cell.column}: {shown(name)}"
        self.cells.setdefault(_name_in_messages(part, start, text), (name_of_cell, cell.text))

    def _path(
        self,
        cell: Cell,
        name: str,
        part: str,
        text: str,
    ) -> str:
        """Return the path of a file named in a cell, relative to the lot; a preset may be one of the library."""
        if text == "-":
            self.note_fault(cell.column, name, "a row cannot read standard input", "-", "name a file")
            return text
        if part == "preset" and text in preset_names():
            return text
        folder = Path() if self.table.file == STDIN else Path(self.table.file).parent
        return str(folder / text)

    def require_own_serial(self, lines: Mapping[str, list[int]]) -> None:
        """Add an error if the row has no serial number or one that occurs in another row.

        lines: lines in which each serial number occurs.
        """
        serial = self.parts.get("serial", "")
        if not serial:
            self.parts["serial"] = f"line {self.line}"
            if self.has_serials:
                hint = "give each drive a serial number, or leave out the column"
                self.note_fault(1, "serial", "missing", hint=hint)
            return
        equal_lines = [line for line in lines.get(serial, ()) if line != self.line]
        if equal_lines:
            message = f"also used in line {shortened(equal_lines)}"
            self.note_fault(1, "serial", message, serial, "write one row for each drive")

    def row(self) -> LotRow:
        """Return the row with its errors."""
        wheel_names = [option.name for option in fields(WheelFiles)]
        parts = dict(self.parts)
        for name in _MARK_COLUMNS:
            if name in parts:
                parts[name] = float(parts[name])
        wheels = {name: parts.pop(name) for name in wheel_names if name in parts}
        request = replace(
            self.base,
            **parts,
            wheels=replace(self.base.wheels, **wheels),
        )
        if not request.preset:
            hint = "add the column preset, or use --preset NAME for all rows"
            self.note_fault(1, "preset", "missing", hint=hint)
        return LotRow(
            request=request,
            place=f"{self.table.file}:{self.line}",
            fault=PresetError(self.faults) if self.faults else None,
            cells=self.cells,
            empty_limits=tuple(self.empty_limits),
        )


def _name_in_messages(
    part: str,
    start: str,
    text: str,
) -> str:
    """Return the name that messages use for the value of a cell: a file, an option, or an option's argument."""
    if part in _FILE_COLUMNS:
        return text
    return start + text if start else f"--{part.replace('_', '-')}"
