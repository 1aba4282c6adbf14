"""Measured traces: the error of a drive's output against the angle of its cam, from the file of an encoder rig.

A file has a column of angles, of the cam or of the output, and one of errors, or that of a second encoder at the
output; then the error is output angle - cam angle / ratio, with the sign of the ratio as the encoders count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import DataError, Finding, PresetError, UsageError
from hdassist.model.geometry import Array
from hdassist.preset.yamltext import shown
from hdassist.readers.sweeps import AngleError, AngleSweep, looks_wrapped, sweeps, unwrapped
from hdassist.readers.table import NumberTable, read_numbers
from hdassist.readers.words import ANGLES, angle_fault, plain_unit, role_in, unit_in
from hdassist.textfile import Readable

MAX_TRACE_BYTES = 100_000_000
ARCSEC_PER_DEG = 3600.0
LARGEST_ERROR = 7200.0  # arcsec, range of an error
SLIP = 0.02  # of the ratio: greatest disagreement of the two encoders with it
LEAST_WRAP = 1e-3  # deg, of encoders that restart
FEWEST_ROWS = 20  # rows
ROUNDED_STEP = 0.01  # of a step: rounding by printed digits

Shaft = Literal["cam", "output"]


@dataclass(frozen=True)
class TraceForm:
    """Columns of a trace file by name or number (from 1), their units, and the shaft of the angle; None: by the file.

    At most one of error and second, the column of the output's own encoder; wrap: angle [deg] after which the encoders
    begin again.
    """

    angle: str | None = None
    angle_of: Shaft | None = None
    angle_unit: str | None = None
    error: str | None = None
    error_unit: str | None = None
    second: str | None = None
    wrap: float | None = None

    def require_sound(self) -> None:
        """Raise UsageError for an unknown unit, a wrap that is none, or both error and second."""
        if self.error is not None and self.second is not None:
            raise UsageError("invalid --error with --second: expected the error or a second encoder, not both")
        for option, unit in (("--angle-unit", self.angle_unit), ("--error-unit", self.error_unit)):
            if unit is not None and (fault := angle_fault(unit)):
                raise UsageError(f"invalid {option} {unit}: expected a unit of angle", fault)
        if self.wrap is not None and not (np.isfinite(self.wrap) and self.wrap >= LEAST_WRAP):
            raise UsageError(f"invalid --wrap {self.wrap:g}: expected an angle of at least {LEAST_WRAP:g} deg")


@dataclass(frozen=True)
class Roles:
    """Columns (from 0) of the angle and of the error or second angle; sizes of their units in arcsec."""

    angle: int
    angle_of: Shaft
    angle_size: float
    other: int
    other_is: Literal["error", "second"]
    other_size: float


@dataclass(frozen=True, eq=False)
class MeasuredTrace:
    """A measured trace in the order of its rows.

    cam_deg, error_arcsec, line: shape (rows,), angle of the cam without wraps, error, line of the file. step_arcsec:
    resolution of the readings, 0 where no step is found; in_time: whether its rounding repeats with the turns of the
    cam, as with readings at even angles. sweeps: moves in one direction each. sha256: of the file. angle_of: shaft of
    the recorded angles; those of the output were multiplied by the ratio. sense: of two encoders, 1 where both count
    up, -1 where one counts down, 0 for a column of errors. notes: conversions, assumptions and rows left out.
    """

    file: str
    sha256: str
    cam_deg: Array
    error_arcsec: Array
    line: NDArray[np.int64]
    step_arcsec: float
    sweeps: tuple[AngleSweep, ...]
    notes: tuple[str, ...]
    angle_of: Shaft = "cam"
    sense: int = 0
    in_time: bool = False

    def without(self, rows: NDArray[np.int64]) -> MeasuredTrace:
        """The trace without some rows."""
        kept = np.ones(len(self.line), bool)
        kept[rows] = False
        cam = self.cam_deg[kept]
        return replace(
            self, cam_deg=cam, error_arcsec=self.error_arcsec[kept], line=self.line[kept], sweeps=tuple(sweeps(cam))
        )


def read_trace(
    source: Readable, form: TraceForm | None = None, ratio: float | None = None, fewest: int = FEWEST_ROWS
) -> MeasuredTrace:
    """Read a measured trace.

    Arguments: source, a path ("-" is standard input), stream or bytes; form of the columns; ratio, cam turns per output
    turn, needed for angles of the output and for two encoders; fewest, rows that are enough.
    Raises DataError: a file that cannot be read; PresetError: every fault of its rows, or the first one of its angles;
    UsageError: a wrong argument.
    """
    form = form or TraceForm()
    form.require_sound()
    table = read_numbers(source, ("angle", "error"), MAX_TRACE_BYTES)
    table.require_sound()
    notes = list(table.notes)
    column = _roles(table, form, notes)
    if len(table.lines) < fewest:
        raise _fault(table, 0, column.angle, f"{len(table.lines)} rows", f"a trace has {fewest} rows or more")
    if ratio is None and (column.angle_of == "output" or column.other_is == "second"):
        message = f"{table.file}: the ratio is needed to bring output and cam together"
        raise DataError(message, "--ratio 100, or --drive PRESET")
    angle, readings = (table.values[:, index].copy() for index in (column.angle, column.other))
    table.values = np.empty((0, 0))  # a long trace takes no more memory than it needs
    cam = _angle(table, column.angle, angle * (column.angle_size / ARCSEC_PER_DEG), form.wrap, notes)
    if ratio and column.angle_of == "output":
        cam *= abs(ratio)
    if not np.ptp(readings):
        raise _fault(table, 0, column.other, "a constant column", "check the column of the error")
    step, in_time = _step(readings) * column.other_size, False
    if column.other_is == "second":
        output = _angle(table, column.other, readings * (column.other_size / ARCSEC_PER_DEG), form.wrap, notes)
        error, sense = _second(table, column.other, output, cam, abs(ratio or 0), notes)
        if not step:
            step, in_time = _step_in_time(cam, output, abs(ratio or 1))
    else:
        error, sense = readings * column.other_size, 0
    try:
        moves = sweeps(cam)
    except AngleError as wrong:
        raise _fault(table, wrong.row, column.angle, wrong.message, wrong.hint) from None
    reach = max((float(np.ptp(error[s.start : s.stop])) for s in moves), default=0.0)
    if reach > LARGEST_ERROR:
        row = int(np.abs(error - np.median(error)).argmax())
        message = f"an error that spans {reach / ARCSEC_PER_DEG:.3g} deg"
        raise _fault(table, row, column.other, message, "check the column of the error, its unit and the ratio")
    left = len(cam) - sum(s.stop - s.start for s in moves)
    if left:
        notes.append(f"left out, short moves to the other side: {left} of {len(cam)} rows")
    return MeasuredTrace(
        table.file, table.sha256, cam, error, table.lines, step, tuple(moves), tuple(notes),
        column.angle_of, sense, in_time,
    )  # fmt: skip


def _angle(table: NumberTable, column: int, angle: Array, wrap: float | None, notes: list[str]) -> Array:
    """Angles [deg] of a column without wraps."""
    if not np.ptp(angle):
        raise _fault(table, 0, column, "a constant column", "check the column of the angle")
    if wrap is None and looks_wrapped(angle):
        wrap = 360.0
        notes.append(f'"{table.name(column)}" begins again after 360 deg: joined')
    try:
        return angle if wrap is None else unwrapped(angle, wrap)
    except AngleError as wrong:
        raise _fault(table, wrong.row, column, wrong.message, wrong.hint) from None


def _second(
    table: NumberTable, column: int, output: Array, cam: Array, ratio: float, notes: list[str]
) -> tuple[Array, int]:
    """Error [arcsec] out of the angles [deg] of two encoders, and the sense in which they count."""
    centred = cam - cam.mean()
    slope = float(centred @ output / (centred @ centred))
    if np.ptp(cam) >= 360 and abs(abs(slope) * ratio - 1) > SLIP:
        turns = f"the cam turns {1 / abs(slope):.5g} times as far" if slope else "the output does not turn"
        raise _fault(table, 0, column, f"{turns}, the ratio is {ratio:g}", "check the units, the ratio and the columns")
    sense = 1 if slope > 0 else -1
    notes.append(f"error = output - cam/ratio, ratio {sense * ratio:+g}: as the two encoders count")
    error = (output - output[0] - sense * (cam - cam[0]) / ratio) * ARCSEC_PER_DEG
    return np.asarray(error), sense


def _step(readings: Array) -> float:
    """Resolution of readings that repeat themselves and lie on even steps; 0 without such a step."""
    levels = np.unique(readings)
    apart = np.diff(levels)
    apart = apart[apart > 1e-9 * (np.abs(readings).max() + np.ptp(readings))]
    if 2 * len(levels) > len(readings) or not len(apart):
        return 0.0
    step = float(apart.min())
    return step if np.abs(apart / step - np.rint(apart / step)).max() < 0.01 else 0.0


def _step_in_time(cam: Array, output: Array, ratio: float) -> tuple[float, bool]:
    """Resolution [arcsec] of output angles [deg] read at even angles of the cam, and whether there is one.

    Angles of a turning shaft seldom repeat themselves, but the steps between them do; steps over missing rows are left
    out.
    """
    turned = np.abs(np.diff(cam))
    usual = np.abs(turned - np.median(turned)) < np.median(turned) / 2
    steps = np.sort(np.abs(np.diff(output))[usual]) * ARCSEC_PER_DEG
    apart = np.diff(steps)
    apart = apart[apart > ROUNDED_STEP * apart.max(initial=0.0)]  # printed digits differ by less
    if 2 * len(apart) > len(steps) or not len(apart):
        return 0.0, False
    step = float(apart.min())
    # where the angles are uneven by more than a step, its rounding is noise, and counted as such; the ends of a sweep
    # are left out
    uneven = float(np.ptp(np.quantile(turned, (0.05, 0.95)))) / ratio * ARCSEC_PER_DEG
    in_time = np.abs(apart / step - np.rint(apart / step)).max() < ROUNDED_STEP and uneven < step
    return (step, True) if in_time else (0.0, False)


def _fault(table: NumberTable, row: int, column: int, message: str, hint: str) -> PresetError:
    return PresetError([Finding(table.file, int(table.lines[row]), 1, table.name(column), message, hint=hint)])


def _roles(table: NumberTable, form: TraceForm, notes: list[str]) -> Roles:
    """Roles of the columns: as the form has them, by their names, or by their order.

    Arguments: table; form; notes, to which the roles are added. Raises UsageError: one column for both; PresetError:
    columns without a clear role.
    """
    kinds = [role_in(name) for name in table.names] or [""] * table.values.shape[1]
    if len(kinds) == 2 and not any(kinds):
        kinds = ["cam", "error"]
        notes.append("columns by their order: cam angle, error")
    angle = _column(table, form.angle, _first_of(kinds, "cam", "angle", "output"), "angle")
    of: Shaft = form.angle_of or ("output" if kinds[angle] == "output" else "cam")
    kinds[angle] = ""
    by_second = form.second is not None or (form.error is None and "error" not in kinds and "output" in kinds)
    asked, kind = (form.second, "output") if by_second else (form.error, "error")
    other = _column(table, asked, _first_of(kinds, kind), "second" if by_second else "error")
    if other == angle:
        raise UsageError(f"one column cannot be both: {table.name(angle)}", f"columns: {_listed(table)}")
    if by_second and of == "output":
        raise _unclear(table, "no column of cam angles", "name one: --angle NAME --angle-of cam")
    angle_unit, angle_size = _unit(table, angle, form.angle_unit, "deg", "--angle-unit", notes)
    other_unit = (form.error_unit, "arcsec") if not by_second else (None, angle_unit)
    unit, size = _unit(table, other, *other_unit, "--angle-unit" if by_second else "--error-unit", notes)
    words = "output angle, second encoder" if by_second else "error"
    notes.append(f'"{table.name(angle)}": {of} angle, {angle_unit}; "{table.name(other)}": {words}, {unit}')
    return Roles(angle, of, angle_size, other, "second" if by_second else "error", size)


def _first_of(kinds: Sequence[str], *wanted: str) -> list[int]:
    """Columns of the first kind that there is."""
    columns = ([i for i, own in enumerate(kinds) if own == kind] for kind in wanted)
    return next(filter(None, columns), [])


def _column(table: NumberTable, asked: str | None, candidates: list[int], option: str) -> int:
    """Column (from 0) by its name or number as asked for, else the only candidate."""
    if asked is not None:
        for plain in (str, str.lower):
            same = [i for i, name in enumerate(table.names) if plain(name) == plain(asked)]
            if len(same) == 1:
                return same[0]
        if asked.isascii() and asked.isdecimal() and 0 < int(asked) <= table.values.shape[1]:
            return int(asked) - 1
        raise _unclear(table, f"no column {asked}", "give its name or number")
    if len(candidates) == 1:
        return candidates[0]
    kinds = {"angle": "cam or output angles", "error": "errors", "second": "output angles"}[option]
    if candidates:
        several = ", ".join(f'"{table.name(i)}"' for i in candidates)
        raise _unclear(table, f"{len(candidates)} columns of {kinds}: {several}", f"choose one: --{option} NAME")
    raise _unclear(table, f"no column of {kinds} by its name", f"name it: --{option} NAME, or its number")


def _unit(
    table: NumberTable, column: int, asked: str | None, default: str, option: str, notes: list[str]
) -> tuple[str, float]:
    named = unit_in(table.name(column))
    unit = plain_unit(asked) if asked is not None else named or default
    if asked is not None and named not in ("", unit):
        notes.append(f'"{table.name(column)}": {asked} as asked for, though the name says {named}')
    elif asked is None and not named:
        notes.append(f'"{table.name(column)}": no unit given, {default} assumed ({option})')
    return unit, ANGLES[unit]


def _listed(table: NumberTable) -> str:
    return shown(", ".join(table.name(i) for i in range(table.values.shape[1])))


def _unclear(table: NumberTable, message: str, hint: str) -> PresetError:
    return PresetError([Finding(table.file, table.names_line, 1, "", message, _listed(table), hint)])
