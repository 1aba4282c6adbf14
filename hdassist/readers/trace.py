"""Measured recordings: the error of a drive's output over the input angle, from the file of an encoder test rig.

A file has a column of angles of the input or of the output, and a column of errors or of a second encoder at the
output. In the latter case the error is output angle - input angle / ratio, with the sign of the ratio as counted by the
encoders. The rows are divided into moves of the shaft in one direction, with wrapped angles joined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import hypot
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.text import UnitError
from hdassist.readers.guiding import GuideForm
from hdassist.readers.table import NumberTable, read_numbers, shortened
from hdassist.readers.words import (
    ANGLES,
    COUNTS,
    TIMES,
    angle_size,
    foreign_unit_in,
    plain_unit,
    quantity_of,
    unit_in,
)
from hdassist.run.errors import DataError, PresetError, UntrustedError, UsageError
from hdassist.run.files import Readable

WHOLE_TURN_DEG = 360.0
_COUNTER_BITS = (16, 24, 32)  # bits of counters that restart when they overflow
_WRAP_STEPS = 20.0  # largest step over a wrap, in median steps
_LEAST_WRAP_REST = 1.0  # deg: a step over a wrap of up to this size is always allowed
_LEAP = 0.4  # share of the wrap beyond which the direction of a step is ambiguous
_JITTER = 0.5  # deg: backward moves up to this size are noise of a shaft that is stationary or slow
_TURNING_STEPS = 4.0  # median steps: backward moves up to this size are noise of coarse readings
_WIDEST_TURNING = 5.0  # deg: upper limit of such backward moves
_WIDEST_TURN_BACK = 2.5  # median steps: largest deviation of a reading from its neighbours where the shaft reverses
_FEW_ROWS = 5  # minimum number of rows in a move
_SPIKE = 10.0  # median steps: largest first step after a restart
_Angles = NDArray[np.float64]
BY_ORDER = "without names, the columns are read as input angle and error"  # note added if no column has a name
_TIME_BY_ORDER = (  # note added if no column has a name and a speed or a period is given
    "without names, the columns are read as time and error (--angle-unit deg for an angle)"
)
MAX_TRACE_BYTES = 100_000_000
_ARCSEC_PER_DEG = 3600.0
LARGEST_ERROR = 7200.0  # arcsec: largest range of an error
_RESTART_HINT = "check whether an encoder was restarted; use only the rows above or below this line"
_LEAP_REST = 0.5  # largest range of the other values where an encoder was restarted, as a share of the leap
_SLIP = 0.02  # largest relative disagreement of two encoders with the ratio
# An increase of the error with the angle shows a wrong ratio if it exceeds the remaining range by this factor, and the
# ratio by this share: 1300 arcsec per output revolution at ratio 100, more than any drive, test rig or drift causes
_RAMP_OVER_REST = 5.0
_RAMP_OF_RATIO = 1e-3
_NEAR_ONE = 0.05  # two ratios differ by 1, within this tolerance, if the other wheel is fixed
_LEAST_WRAP = 1e-3  # deg: smallest wrap of an encoder
_ENCODERS = 2
_FEWEST_ROWS = 20  # minimum number of rows in a recording
# one row in this many is removed at each end of the sorted steps, as these steps are not due to rounding
_TURNING_ROWS = 200
_ROUNDED_STEP = 0.01  # rounding by printed digits, as a share of a step
_COUNTS_APART = 2  # counts of the input by which steps at constant speed may differ
_Shaft = Literal["cam", "output"]


@dataclass(frozen=True)
class _AngleSweep:
    """Rows of a move in one direction.

    start: index of the first row.
    stop: index after the last row.
    direction: 1 for increasing angles, -1 for decreasing ones.
    """

    start: int
    stop: int
    direction: int

    def __len__(self) -> int:
        return self.stop - self.start

    @property
    def rows(self) -> slice:
        """The rows as a slice."""
        return slice(self.start, self.stop)


class AngleError(ValueError):
    """An invalid angle: its row, a message and a hint."""

    def __init__(
        self,
        row: int,
        message: str,
        hint: str,
    ) -> None:
        super().__init__(message)
        self.row = row
        self.message = message
        self.hint = hint


def _guessed_wrap(angle: _Angles, count: float) -> float | None:
    """Return the angle at which an encoder restarts [deg], or None if it does not restart.

    The wrap is a revolution or the range of the counter. All angles lie within a wrap, and some steps exceed half of a
    wrap. If the wrap is removed from such a step, a step of usual size remains. If a large step remains, a test run was
    restarted, and the result is None.

    count: size of a count [deg].
    """
    steps = np.abs(np.diff(angle))
    span = float(np.ptp(angle))
    longest = float(steps.max(initial=0.0))
    wraps = (WHOLE_TURN_DEG, *(2**bits * count for bits in _COUNTER_BITS))
    # a revolution is tried first, then the counters in order of size
    for wrap in wraps:
        if span <= wrap < 2 * longest:
            # distances that the shaft moved in the steps over the wrap
            over = np.abs(wrap - steps[2 * steps > wrap])
            usual = float(np.median(steps[2 * steps <= wrap])) if (2 * steps <= wrap).any() else wrap
            return wrap if float(np.median(over)) <= max(_WRAP_STEPS * usual, _LEAST_WRAP_REST) else None
    return None


def _unwrapped(
    angle: _Angles,
    wrap: float,
    other: _Angles | None = None,
) -> _Angles:
    """Return the angles without the jumps of an encoder that restarts after a wrap, in the same unit, shape (rows,).

    other: the same angle measured by another encoder, without jumps and with either sign, which resolves long steps.
    Raises AngleError for a step with an ambiguous direction.
    """
    # the second encoder may count in either direction
    expected = [np.zeros(len(angle))] if other is None else [other, -other]
    way, off = min(
        ((expected_angle, np.unwrap(angle - expected_angle, period=wrap)) for expected_angle in expected),
        key=lambda pair: float(np.abs(np.diff(pair[1])).sum()),
    )
    joined = way + off
    # a step of nearly half the wrap may be forwards or backwards
    far = np.flatnonzero(np.abs(np.diff(off)) > _LEAP * wrap)
    if len(far):
        step = abs(np.diff(joined)[far[0]])
        raise AngleError(
            int(far[0]) + 1,
            f"the direction of a step of {step:.4g} is ambiguous, because the angle restarts after {wrap:g}",
            "record smaller steps",
        )
    return joined


def _leaping(angle: _Angles) -> NDArray[np.bool_]:
    """Return whether each angle [deg] differs strongly from the median of five neighbouring angles, shape (rows,)."""
    padded = np.pad(
        angle,
        2,
        mode="reflect",
        reflect_type="odd",
    )
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1)
    steps = np.abs(np.diff(around))
    return np.abs(angle - around) > _JITTER + _WIDEST_TURN_BACK * float(np.median(steps))


def sweeps(angle: _Angles) -> list[_AngleSweep]:
    """Return the moves of the shaft, each in one direction, in the order of the rows.

    Moves with fewer than _FEW_ROWS rows and the rows at turning points are omitted.

    angle: angles without jumps of the encoder [deg], shape (rows,).
    Raises AngleError if the angle runs backwards within a move.
    """
    steps = np.abs(np.diff(angle))
    steps = steps[steps > 0]
    if not len(steps):
        raise AngleError(0, "the angle does not change", "check the angle column")
    # median step over the rows in which the shaft moved
    step = float(np.median(steps, overwrite_input=True))
    moves = _moves(angle, max(_JITTER, min(_TURNING_STEPS * step, _WIDEST_TURNING)))
    for before, back, after in zip(moves, moves[1:], moves[2:], strict=False):
        # allowed: the shaft really moved back, or only a few rows precede the first reversal
        if len(back) >= _FEW_ROWS or (before is moves[0] and len(before) < _FEW_ROWS):
            continue
        row = back.start
        last = before.stop - 1
        is_leap = len(back) == 1 and abs(angle[row] - angle[last]) >= abs(angle[last] - angle[before.start]) / 2
        follows = len(after) >= _FEW_ROWS and abs(angle[after.start] - angle[after.start - 1]) <= _SPIKE * step
        if not (is_leap and follows):  # the row is not a restart of the same move
            message = f"the angle jumps back: {angle[row]:.6g} deg follows {angle[last]:.6g} deg"
            raise AngleError(row, message, "sort the rows by time (--robust does not sort), or use --wrap 360")
    return [move for move in _without_turning(angle, moves, step / 2) if len(move) >= _FEW_ROWS]


def _without_turning(
    angle: _Angles,
    moves: Sequence[_AngleSweep],
    within: float,
) -> list[_AngleSweep]:
    """Return moves without the rows at their turning points, which may belong to either direction.

    If a shaft reversed between two rows, the last row of one move may lie on the other side of the backlash and belong
    to the next move.

    within: distance from the turning point within which rows are omitted [deg].
    """
    # lists, since both ends are moved inwards below
    ends = [[move.start, move.stop] for move in moves]
    for before, after in pairwise(range(len(moves))):
        if min(len(moves[before]), len(moves[after])) >= _FEW_ROWS:
            away = np.abs(angle - angle[moves[before].stop - 1]) >= within
            ends[before][1] -= int(away[moves[before].rows][::-1].argmax())
            ends[after][0] += int(away[moves[after].rows].argmax())
    return [_AngleSweep(start, stop, move.direction) for (start, stop), move in zip(ends, moves, strict=True)]


def _moves(angle: _Angles, least: float) -> list[_AngleSweep]:
    """Return the moves between turning points that are at least a given distance apart [deg]."""
    # int8, because a long recording has millions of rows
    signs = np.sign(np.diff(angle)).astype(np.int8)
    moving = np.flatnonzero(signs)
    # only the last row before a change of direction can be a turning point
    ends = [*(moving[:-1][np.diff(signs[moving]) != 0] + 1).tolist(), len(angle) - 1]
    moves: list[_AngleSweep] = []
    start = 0
    extreme = 0
    direction = 0
    for row in ends:
        gap = float(angle[row] - angle[extreme])
        # the shaft moved further in the same direction
        if direction and direction * gap >= 0:
            extreme = row
        # far enough back to be a reversal of the shaft
        elif abs(gap) >= least:
            if direction:
                moves.append(_AngleSweep(start, extreme + 1, direction))
                start = extreme + 1
            extreme = row
            direction = 1 if gap > 0 else -1
    return [*moves, _AngleSweep(start, len(angle), direction or (1 if angle[-1] > angle[0] else -1))]


@dataclass(frozen=True)
class TraceForm:
    """Columns of a recording by name or number (from 1), their units, and the shaft of the angle; None if not stated.

    angle: column of the angle.
    angle_of: shaft of the angle.
    angle_unit: unit of the angle and, after a comma, of the second encoder, as read by `angle_size`.
    error: column of the error.
    error_unit: unit of the error.
    second: column of the output encoder; not allowed together with error.
    wrap: angle after which the encoders restart [deg].
    robust: whether rows that are not readings, and readings far from all others, are omitted.
    speed: speed of the output [arcsec/s], which converts a column of time to its angle.
    declination, guide_rate: declination of the guide star [deg] and guide rate [arcsec/s], for a guide log.
    period: period of an input revolution [s], which converts a column of time to the input angle.
    """

    angle: str | None = None
    angle_of: _Shaft | None = None
    angle_unit: str | None = None
    error: str | None = None
    error_unit: str | None = None
    second: str | None = None
    wrap: float | None = None
    robust: bool = False
    speed: float | None = None
    declination: float | None = None
    guide_rate: float | None = None
    period: float | None = None

    def require_sound(self) -> None:
        """Raise UsageError for an unknown unit, an invalid wrap, both error and second, or both speed and period."""
        angles = self.angle_units
        # both columns would give the error
        if self.error is not None and self.second is not None:
            raise UsageError(
                "--error cannot be combined with --second", "select either the error, or the angle of a second encoder"
            )
        if self.speed is not None and self.period is not None:
            raise UsageError(
                "--speed cannot be combined with --period",
                "use one of the two; each is sufficient to convert times to angles",
            )
        if len(angles) > _ENCODERS:
            message = f"invalid --angle-unit {self.angle_unit}: expected at most one unit for each encoder"
            raise UsageError(message, "use, for example, --angle-unit deg,arcsec")
        # a unit of time requires a speed or a period
        times = [unit for unit in angles if plain_unit(unit) in TIMES]
        if times and len(angles) > 1:
            message = f"invalid --angle-unit {self.angle_unit}: expected units of angle, not of time"
            raise UsageError(message, "use, for example, --angle-unit deg,arcsec")
        units = [*(("--angle-unit", unit) for unit in angles if not times), ("--error-unit", self.error_unit)]
        # unknown units are rejected before a file is read
        for option, unit in units:
            try:
                angle_size("deg" if unit is None else unit)
            except UnitError as fault:
                raise UsageError(f"invalid {option} {unit}: {fault.message}", fault.hint) from None
        if self.wrap is not None and not (np.isfinite(self.wrap) and self.wrap >= _LEAST_WRAP):
            message = f"invalid --wrap {self.wrap:g}: expected an angle of at least {_LEAST_WRAP:g} deg"
            raise UsageError(message, "use, for example, --wrap 360")

    @property
    def has_pace(self) -> bool:
        """Whether a speed or a period is given for converting times to angles."""
        return self.speed is not None or self.period is not None

    def output_speed(self, ratio: float) -> float | None:
        """Return the stated speed of the output [arcsec/s], or None.

        ratio: ratio of the drive.
        """
        # a speed refers to the output, a period to the input
        if self.period is None:
            return self.speed
        return WHOLE_TURN_DEG * _ARCSEC_PER_DEG / (self.period * ratio)

    @property
    def angle_units(self) -> list[str]:
        """The stated units of the angle and of the second encoder."""
        return self.angle_unit.split(",") if self.angle_unit is not None else []


@dataclass(frozen=True)
class _TraceColumn:
    """A column of a recording.

    index: index of the column.
    shaft: shaft of its angle, None for errors.
    unit: unit stated by the file or an option, or counts per revolution.
    size: size of the unit or count [arcsec]; for a unit of time, the angle of the shaft per unit.
    """

    index: int
    shaft: _Shaft | None
    unit: str
    size: float

    @property
    def in_counts(self) -> bool:
        """Whether the column contains counts of an encoder."""
        return self.unit.removeprefix("-") not in (*ANGLES, *TIMES)


@dataclass(frozen=True, eq=False)
class MeasuredTrace:
    """A measured recording in the order of its rows.

    file: name of the file.
    sha256: checksum of the file.
    cam_deg: input angle without wraps, shape (rows,).
    error_arcsec: error, shape (rows,).
    line: line number in the file, shape (rows,).
    step_arcsec: resolution of the readings, 0 if no step is found.
    sweeps: moves in one direction each.
    notes: conversions, assumptions and omitted rows.
    angle_of: shaft of the recorded angles; those of the output were multiplied by the ratio.
    sense: for two encoders, 1 if both count up, -1 if one counts down; 0 for a column of errors.
    in_time: whether the rounding repeats with the input revolutions, as for readings at even angles.
    robust: whether readings far from all others are omitted.
    time_s: time of each row, None without time stamps.
    load: torque [N*m] of each row, or the wind-up due to it, None without a torque.
    cam_step_arcsec: part of the resolution due to counts of the input, which noise of the output does not average out.
    dithered: whether the readings are counts at angles uneven by more than one count, whose rounding is part of the
    noise in the residuals.
    breaks: lines at which the level of the error steps.
    is_between_torques: whether the requested torque lies between those of the sweeps.
    is_lower_bound: whether all errors may be larger by one common factor.
    scale_uncertainty: relative standard uncertainty of such a factor.
    turns_per_s: constant speed of the input by which times were converted to angles [revolutions/s], 0 for recorded
    angles.
    """

    file: str
    sha256: str
    cam_deg: Array
    error_arcsec: Array
    line: NDArray[np.int64]
    step_arcsec: float
    sweeps: tuple[_AngleSweep, ...]
    notes: tuple[str, ...]
    angle_of: _Shaft = "cam"
    sense: int = 0
    in_time: bool = False
    robust: bool = False
    time_s: Array | None = None
    load: Array | None = None
    cam_step_arcsec: float = 0.0
    dithered: bool = False
    breaks: tuple[int, ...] = ()
    is_between_torques: bool = False
    is_lower_bound: bool = False
    scale_uncertainty: float = 0.0
    turns_per_s: float = 0.0

    @property
    def rows(self) -> NDArray[np.int64]:
        """The rows of the sweeps."""
        return np.concatenate(self.by_sweep(np.arange(len(self.line))))

    def by_sweep(self, values: NDArray[Any]) -> list[NDArray[Any]]:
        """Return the values of all rows, shape (rows,), split by sweep."""
        return [values[sweep.rows] for sweep in self.sweeps]

    def require_known_scale(self) -> None:
        """Raise UntrustedError if the size of the errors depends on an uncertain guide rate."""
        if self.scale_uncertainty:
            share = f"{100 * self.scale_uncertainty:.0f} %"
            message = (
                f"{self.file}: the guide rate, and with it the size of the error, has a standard uncertainty of {share}"
            )
            raise UntrustedError(message, "state the guide rate: --guide-rate ARCSEC/S")

    def one_way(self, sign: int) -> MeasuredTrace:
        """Return the recording with only the sweeps in one direction, or all sweeps.

        sign: direction, 0 for both.
        """
        return replace(self, sweeps=tuple(sweep for sweep in self.sweeps if sweep.direction == sign or not sign))

    def without(self, rows: NDArray[np.int64]) -> MeasuredTrace:
        """Return the recording without some rows."""
        columns = ("cam_deg", "error_arcsec", "line", "time_s", "load")
        arrays = {name: getattr(self, name) for name in columns}
        kept: dict[str, Any] = {name: np.delete(values, rows) for name, values in arrays.items() if values is not None}
        return replace(
            self,
            **kept,
            sweeps=tuple(sweeps(kept["cam_deg"])),
        )


def read_trace(
    source: Readable,
    form: TraceForm | None = None,
    ratio: float | None = None,
) -> MeasuredTrace:
    """Return the recording in a file. Arguments and errors are those of `read_record` and `trace_of`."""
    form = form or TraceForm()
    return trace_of(read_record(source, form), form, ratio)


def read_record(source: Readable, form: TraceForm) -> NumberTable:
    """Return the table of a recording.

    source: path ("-" is standard input), stream or bytes.
    form: form of the columns.
    Raises DataError if the file cannot be read.
    Raises PresetError that lists all faults of the rows.
    Raises UsageError for an invalid argument.
    """
    form.require_sound()
    guide = GuideForm(form.declination, form.guide_rate)
    table = read_numbers(
        source, ("angle", "error"), MAX_TRACE_BYTES, lenient=form.robust, takes_sexagesimal=True, guide=guide
    )
    try:
        table.require_sound()
    except PresetError as error:
        # --robust helps only if enough rows remain
        if not form.robust and len(table.lines) >= _FEWEST_ROWS and any(finding.path for finding in table.findings):
            error.hint = "use --robust to leave out rows without valid readings"
        raise
    if table.left_out:
        table.notes.append(f"left out, because they contain no valid readings: lines {shortened(table.left_out)}")
    return table


@dataclass(frozen=True, eq=False)
class _Readings:
    """Readings of a table in the order of its rows, each of shape (rows,)."""

    cam_deg: Array  # input angle without wraps [deg]
    second: Array  # column of the error or of the second encoder, in its unit
    output_deg: Array | None  # angle of the second encoder, without wraps [deg]
    time_s: Array | None
    torque: Array | None

    def second_deg(self, column: _TraceColumn) -> Array:
        """Return the angles of the second encoder without wraps, or the errors [deg].

        column: column of the angles or errors.
        """
        if self.output_deg is None:
            return self.second * (column.size / _ARCSEC_PER_DEG)
        return self.output_deg

    def of_rows(self, rows: NDArray[np.bool_]) -> _Readings:
        """Return the readings of the selected rows."""
        return _Readings(
            cam_deg=self.cam_deg[rows],
            second=self.second[rows],
            output_deg=None if self.output_deg is None else self.output_deg[rows],
            time_s=None if self.time_s is None else self.time_s[rows],
            torque=None if self.torque is None else self.torque[rows],
        )


@dataclass(frozen=True)
class _Resolution:
    """Resolution of the error. The fields are those of `MeasuredTrace`."""

    step_arcsec: float
    in_time: bool = False
    cam_step_arcsec: float = 0.0
    dithered: bool = False


def trace_of(
    table: NumberTable,
    form: TraceForm,
    ratio: float | None = None,
) -> MeasuredTrace:
    """Return the recording in a table, whose values are removed from it.

    table: table with its rows.
    form: form of the columns.
    ratio: input revolutions per output revolution, required for output angles and for two encoders.
    Raises PresetError for the first fault of the angles.
    Raises DataError if the ratio is missing.
    Raises UsageError if one column is selected both as the angle and as the error or second encoder.
    """
    first, second = _columns(table, form)
    _require_rows_and_ratio(table, first, second, ratio)
    # the signs of the ratio are determined from the encoders
    per_turn = abs(ratio or 1)
    readings = _readings_of(table, form, first, second, per_turn)
    # rows at which the second column jumps and returns
    far = _leaping(readings.second_deg(second))
    if form.robust:
        readings = _without_leaps(table, readings, {first.index: _leaping(readings.cam_deg), second.index: far})
    error, sense = _error_of(table, readings, second, per_turn)
    resolution = _resolution(readings, first, second, per_turn)
    if ratio is not None:
        _require_ratio(table, second.index, readings.cam_deg, error, per_turn, sense)
    turns_per_s = _turns_per_s(table, form, readings, first, per_turn)
    moves = _moves_of_readings(table, readings, first.index)
    _require_small_error(
        table,
        second.index,
        error,
        moves,
        has_far_readings=bool(far.any()),
    )
    return MeasuredTrace(
        file=table.file,
        sha256=table.sha256,
        cam_deg=readings.cam_deg,
        error_arcsec=error,
        line=table.lines,
        step_arcsec=resolution.step_arcsec,
        sweeps=tuple(moves),
        notes=tuple(table.notes),
        angle_of=first.shaft or "cam",
        sense=sense,
        in_time=resolution.in_time,
        robust=form.robust,
        time_s=readings.time_s,
        load=readings.torque,
        cam_step_arcsec=resolution.cam_step_arcsec,
        dithered=resolution.dithered,
        is_lower_bound=table.is_lower_bound,
        scale_uncertainty=table.scale_uncertainty,
        turns_per_s=turns_per_s,
    )


def _error_of(
    table: NumberTable,
    readings: _Readings,
    second: _TraceColumn,
    per_turn: float,
) -> tuple[Array, int]:
    """Return the error of each row [arcsec], shape (rows,), and the sense in which two encoders count.

    table: table for the position of a fault and for notes.
    readings: angles, and the errors or the output angles.
    second: column of the error or of the second encoder.
    per_turn: input revolutions per output revolution.
    Raises PresetError for a constant column, and for two encoders that disagree with the ratio.
    """
    if not np.ptp(readings.second):
        raise table.fault("the column is constant", "check the error column", 0, second.index)
    if readings.output_deg is None:
        return readings.second * second.size, 0
    return _second(table, second.index, readings.output_deg, readings.cam_deg, per_turn)


def _turns_per_s(
    table: NumberTable,
    form: TraceForm,
    readings: _Readings,
    first: _TraceColumn,
    per_turn: float,
) -> float:
    """Return the constant speed of the input by which times were converted to angles [1/s], 0 for recorded angles.

    table: table whose deg_per_s is the speed of the shaft if its angles were computed from times.
    form: form with the stated speed of the output.
    readings: readings with the times of the rows, if any.
    first: column of the angle.
    per_turn: input revolutions per output revolution.
    """
    is_of_output = first.shaft == "output"
    # for recorded angles without time stamps, only the stated speed relates them to time
    if form.speed is not None and not table.deg_per_s and readings.time_s is None:
        table.deg_per_s = form.speed / _ARCSEC_PER_DEG * (1.0 if is_of_output else per_turn)
    return table.deg_per_s / WHOLE_TURN_DEG * (per_turn if is_of_output else 1)


def _moves_of_readings(
    table: NumberTable,
    readings: _Readings,
    column: int,
) -> list[_AngleSweep]:
    """Return the moves of the shaft, and add a note on rows outside the moves.

    column: index of the column of the angle.
    Raises PresetError if the angle runs backwards.
    """
    try:
        moves = sweeps(readings.cam_deg)
    except AngleError as fault:
        raise table.fault(fault.message, fault.hint, fault.row, column) from None
    row_count = len(readings.cam_deg)
    left_out = row_count - sum(map(len, moves))
    if left_out:
        table.notes.append(f"rows left out at turning points and in short moves: {left_out} of {row_count}")
    return moves


def _require_rows_and_ratio(
    table: NumberTable,
    first: _TraceColumn,
    second: _TraceColumn,
    ratio: float | None,
) -> None:
    """Raise PresetError if a table has too few rows, and DataError if its columns require an unstated ratio."""
    if len(table.lines) < _FEWEST_ROWS:
        raise table.fault(
            f"the recording has too few rows: {len(table.lines)}",
            f"record at least {_FEWEST_ROWS} rows",
            0,
            first.index,
        )
    if ratio is None and "output" in (first.shaft, second.shaft):
        message = f"{table.file}: the ratio is needed to relate output and input"
        raise DataError(message, "state the ratio, for example --ratio 100, or name the drive with --drive PRESET")


def _readings_of(
    table: NumberTable,
    form: TraceForm,
    first: _TraceColumn,
    second: _TraceColumn,
    per_turn: float,
) -> _Readings:
    """Return the readings of a table without wraps, and add a note on unused columns.

    table: table whose values are removed, because a long recording needs much memory.
    form: form with the wrap of the angles.
    first: column of the angle.
    second: column of the error or of the second encoder.
    per_turn: input revolutions per output revolution.
    Raises PresetError if angles cannot be joined.
    """
    angle, second_values = (table.values[:, column.index].copy() for column in (first, second))
    time_s = _beside(table, "time", "s")
    torque = _beside(table, "torque", "N·m")
    used = {first.index, second.index, *(k for k, role in enumerate(table.roles) if role in ("time", "torque"))}
    unused = [
        f'"{name}" ({table.values[:, k].min():.6g} to {table.values[:, k].max():.6g})'
        for k, name in enumerate(table.names)
        if k not in used
    ]
    if unused:
        table.notes.append(f"not used: {', '.join(unused)}")
    # only the copies are needed from here on
    table.values = np.empty((0, 0))
    output_deg = None
    expected_deg = None  # input angle expected from the second encoder
    # the second encoder resolves the wraps of the first one
    if second.shaft:
        output_deg = _angle(table, second, second_values, form.wrap)
        expected_deg = output_deg * per_turn
    cam_deg = _angle(table, first, angle, form.wrap, expected_deg)
    if first.shaft == "output":
        cam_deg *= per_turn
    return _Readings(
        cam_deg=cam_deg,
        second=second_values,
        output_deg=output_deg,
        time_s=time_s,
        torque=torque,
    )


def _without_leaps(
    table: NumberTable,
    readings: _Readings,
    leaps: dict[int, NDArray[np.bool_]],
) -> _Readings:
    """Return the readings without rows that jump and return, and remove the lines of these rows from the table.

    leaps: whether each row jumps and returns, by column index.
    """
    for column, rows in leaps.items():
        if rows.any():
            lines = shortened(table.lines[rows].tolist())
            table.notes.append(f'left out, "{table.name(column)}" jumps and returns: lines {lines}')
    # a row is omitted if either column jumps in it
    is_kept = ~np.logical_or.reduce([*leaps.values()])
    table.lines = table.lines[is_kept]
    return readings.of_rows(is_kept)


def _resolution(
    readings: _Readings,
    first: _TraceColumn,
    second: _TraceColumn,
    per_turn: float,
) -> _Resolution:
    """Return the resolution of the error.

    per_turn: input revolutions per output revolution.
    """
    step_arcsec = _step(readings.second) * abs(second.size)
    if readings.output_deg is None:
        return _Resolution(step_arcsec=step_arcsec)
    in_time = False
    if not step_arcsec:
        step_arcsec = _step_in_time(readings.cam_deg, readings.output_deg, per_turn)
        in_time = step_arcsec > 0
    # the resolution of angles with decimals is that of their step
    if not (first.in_counts or second.in_counts):
        return _Resolution(step_arcsec=step_arcsec, in_time=in_time)
    cam_step_arcsec = abs(first.size) / per_turn if first.in_counts else 0.0
    output_step_arcsec = abs(second.size) if second.in_counts else 0.0
    largest_arcsec = max(_COUNTS_APART * cam_step_arcsec, output_step_arcsec)
    in_time = in_time or _is_even(readings.cam_deg, largest_arcsec * per_turn / _ARCSEC_PER_DEG)
    return _Resolution(
        step_arcsec=max(step_arcsec, hypot(cam_step_arcsec, output_step_arcsec)),
        in_time=in_time,
        cam_step_arcsec=cam_step_arcsec,
        dithered=not (step_arcsec or in_time),
    )


def _require_small_error(
    table: NumberTable,
    column: int,
    error: Array,
    moves: Sequence[_AngleSweep],
    *,
    has_far_readings: bool,
) -> None:
    """Raise PresetError if the range of the error exceeds LARGEST_ERROR.

    The fault is at the row where the error jumps or is largest.

    table: table for the position of the fault.
    column: index of the column of the error or of the second encoder.
    error: error of each row [arcsec], shape (rows,).
    moves: moves of the shaft.
    has_far_readings: whether single readings differ strongly from their neighbours.
    """
    reach = max((float(np.ptp(error[move.rows])) for move in moves), default=0.0)
    # the limit is two degrees, and larger values are not errors of a drive
    if reach <= LARGEST_ERROR:
        return
    spans = f"the error spans {reach / _ARCSEC_PER_DEG:.3g} deg"
    row = _leap_in(error)
    if row is not None:
        leap = float(error[row] - error[row - 1]) / _ARCSEC_PER_DEG
        message = f"{spans}, because it shifts by {leap:.3g} deg from this row on"
        raise table.fault(message, _RESTART_HINT, row, column)
    row = int(np.abs(error - np.median(error)).argmax())
    leaves_out = "; --robust leaves out single outliers" if has_far_readings else ""
    raise table.fault(spans, f"check the error column, its unit and the ratio{leaves_out}", row, column)


def _angle(
    table: NumberTable,
    column: _TraceColumn,
    readings: Array,
    wrap: float | None,
    other: Array | None = None,
) -> Array:
    """Return the angles of the readings of a column without wraps [deg].

    readings: values of the column in its unit, shape (rows,).
    wrap: stated wrap [deg], None to guess it.
    other: argument of `_unwrapped`.
    Raises PresetError if the column is constant or the direction of a step is ambiguous.
    """
    angle = readings * (column.size / _ARCSEC_PER_DEG)
    if not np.ptp(angle):
        raise table.fault("the column is constant", "check the angle column", 0, column.index)
    # the wrap is guessed unless an option states it
    guess = _guessed_wrap(angle, abs(column.size) / _ARCSEC_PER_DEG) if wrap is None else None
    try:
        joined = angle if (wrap or guess) is None else _unwrapped(angle, wrap or guess or WHOLE_TURN_DEG, other)
    except AngleError as wrong:
        # a guess that fails is withdrawn
        if guess and guess != WHOLE_TURN_DEG:  # the counter does not restart; the rows are out of order
            return angle
        raise table.fault(wrong.message, wrong.hint, wrong.row, column.index) from None
    if guess:
        table.notes.append(f'"{table.name(column.index)}" restarts after {guess:g} deg and was unwrapped')
    return joined


def _beside(
    table: NumberTable,
    role: str,
    default: str,
) -> Array | None:
    """Return the only column of a role in its base unit, or None if it is missing or its times do not increase."""
    if table.roles.count(role) != 1:
        return None
    values = table.in_unit(table.roles.index(role), role, default)
    # times that do not increase are not those of a clock
    if role == "time" and not (np.diff(values) > 0).all():
        table.notes[-1] += "; it does not increase in every row, so it does not contain time stamps"
        return None
    return values


def _second(
    table: NumberTable,
    column: int,
    output: Array,
    cam: Array,
    ratio: float,
) -> tuple[Array, int]:
    """Return the error [arcsec] from the angles of two encoders [deg], and the sense in which they count.

    Raises PresetError if the angles disagree with the ratio.
    """
    centred = cam - cam.mean()
    # the slope of output over input is the inverse of the ratio shown by the encoders
    slope = float(centred @ output / (centred @ centred))
    # over less than an input revolution, the error itself may cause the difference
    if np.ptp(cam) >= 360 and abs(abs(slope) * ratio - 1) > _SLIP:
        for way in (1, -1):
            difference = output - way * cam / ratio
            if (row := _leap_in(difference)) is not None:
                leap = f"{difference[row] - difference[row - 1]:.4g} deg"
                message = f"the angles of the two shafts jump apart by {leap}; an encoder was restarted or lost counts"
                raise table.fault(message, _RESTART_HINT, row, column)
        turns = (
            f"the input rotates {1 / abs(slope):.5g} times as far as the output"
            if slope
            else "the output does not rotate"
        )
        message = f"{turns}, but the ratio is {ratio:g}"
        raise table.fault(message, "check the units, the ratio and the columns", 0, column)
    sense = 1 if slope > 0 else -1
    table.notes.append(f"error = output - cam/ratio, ratio {sense * ratio:+g}, in the senses of the two encoders")
    error = (output - output[0] - sense * (cam - cam[0]) / ratio) * _ARCSEC_PER_DEG
    return error, sense


def _require_ratio(
    table: NumberTable,
    column: int,
    cam: Array,
    error: Array,
    ratio: float,
    sense: int,
) -> None:
    """Raise PresetError if the error increases with the angle as it does for a wrong ratio.

    table: table for the position of the fault.
    column: index of the column of the error or of the output.
    cam: input angles [deg].
    error: error [arcsec].
    ratio: stated ratio, positive.
    sense: sense in which two encoders count; 0 for an error of unknown sign, for which two ratios fit.
    """
    centred = cam - cam.mean()
    slope = float(centred @ error / (centred @ centred))  # arcsec per degree of the input
    ramp = abs(slope) * float(np.ptp(cam))
    residual_range = float(np.ptp(error - slope * centred))
    # the sign of the error is unknown, so both ratios are considered
    signs = (sense,) if sense else (1, -1)
    speeds = [1 / ratio + sign * slope / _ARCSEC_PER_DEG for sign in signs]  # output speeds relative to the input
    if ramp < _RAMP_OVER_REST * residual_range or abs(speeds[0] * ratio - 1) < _RAMP_OF_RATIO:
        return
    fitting = [1 / speed for speed in speeds if speed > 0]
    if not fitting:
        return
    ratios_text = " or ".join(f"{fit:.3f}" for fit in fitting)
    hint = "use a preset with this ratio, or state it with --ratio" + _cause_of_ratio(fitting, ratio)
    grows = f"the error grows by {ramp:.5g} arcsec over {np.ptp(cam) / WHOLE_TURN_DEG:.3g} input revolutions"
    raise table.fault(f"{grows}; the recording indicates a ratio of {ratios_text}, not {ratio:g}", hint, 0, column)


def _cause_of_ratio(fitting: Sequence[float], ratio: float) -> str:
    """Return the likely cause of a fitted ratio that differs from the stated one, empty if it is unknown.

    With the circular spline fixed, the ratio is N, half the number of teeth of the flexspline; with the flexspline
    fixed it is N + 1. For an error of unknown sign, two ratios fit a recording.
    """
    larger = any(abs(fit - ratio - 1) < _NEAR_ONE for fit in fitting)
    smaller = any(abs(ratio - fit - 1) < _NEAR_ONE for fit in fitting)
    causes = []
    if larger:
        causes.append(f"{ratio + 1:g}: the flexspline is fixed, and the output is on the circular spline")
    if smaller:
        causes.append(f"{ratio - 1:g}: the circular spline is fixed, and the output is on the flexspline")
    return f"; the likely cause of {'; of '.join(causes)}" if causes else ""


def _leap_in(values: Array) -> int | None:
    """Return the row at which values jump by most of their range and stay there, or None if there is no such jump."""
    steps = np.diff(values)
    # without its largest step, a column with one jump has a small range
    row = int(np.abs(steps).argmax())
    without_step = np.concatenate([values[: row + 1], values[row + 1 :] - steps[row]])
    return row + 1 if np.ptp(without_step) < _LEAP_REST * abs(steps[row]) else None


def _even_step(levels: Array, least: float) -> float:
    """Return the step of which all spacings of increasing levels are multiples, or 0 if there is no such step.

    least: smallest spacing of distinct levels; closer levels count as equal.
    """
    spacing = np.diff(levels)
    # differences due to rounding of printed digits are ignored
    spacing = spacing[spacing > least]
    step = float(spacing.min(initial=np.inf))
    return step if len(spacing) and np.abs(spacing / step - np.rint(spacing / step)).max() < _ROUNDED_STEP else 0.0


def _step(readings: Array) -> float:
    """Return the resolution of readings that repeat and are evenly spaced, or 0 if they are not."""
    # the resolution is visible only if most values occur repeatedly
    levels = np.unique(readings)
    rounding = 1e-9 * float(np.abs(readings).max() + np.ptp(readings))
    return _even_step(levels, rounding) if 2 * len(levels) <= len(readings) else 0.0


def _step_in_time(
    cam: Array,
    output: Array,
    ratio: float,
) -> float:
    """Return the resolution [arcsec] of output angles [deg] read at even input angles, or 0 if it is not visible.

    Angles of a rotating shaft seldom repeat, but the steps between them do. Steps over missing rows are excluded.
    """
    turned = np.abs(np.diff(cam))
    # steps over missing rows are longer and therefore excluded
    usual = np.abs(turned - np.median(turned)) < np.median(turned) / 2
    steps = np.sort(np.abs(np.diff(output))[usual]) * _ARCSEC_PER_DEG
    # the extremes include backlash where the shaft reverses
    steps = steps[len(steps) // _TURNING_ROWS : len(steps) - len(steps) // _TURNING_ROWS]
    least = _ROUNDED_STEP * float(np.diff(steps).max(initial=0.0))  # smaller differences are due to rounding
    repeat = 2 * int((np.diff(steps) > least).sum()) <= len(steps)
    step = _even_step(steps, least) if repeat else 0.0
    # if the angles are uneven by more than a step, rounding acts as noise and counts as noise
    return step if _is_even(cam, step * ratio / _ARCSEC_PER_DEG) else 0.0


def _is_even(cam: Array, within_deg: float) -> bool:
    """Return whether nine in ten steps of the input are equal within a tolerance [deg], so that rounding repeats."""
    return float(np.ptp(np.quantile(np.abs(np.diff(cam)), (0.05, 0.95)))) <= within_deg


def _second_column(
    table: NumberTable,
    form: TraceForm,
    kinds: Sequence[str],
    *,
    by_second: bool,
) -> int:
    """Return the index of the column of the output angle if by_second, otherwise of the error."""
    if by_second:
        return _column(table, form.second, kinds, "output", "second")
    return _column(table, form.error, kinds, "error", "error")


def _selected_twice(table: NumberTable, angle: int, *, by_second: bool) -> UsageError:
    """Return the error for the column of the angle, which is selected as second encoder or as error too."""
    role = "second encoder" if by_second else "error"
    message = f"column {table.name(angle)} is selected both as the angle and as the {role}"
    return UsageError(message, f"choose another column: {table.listed}")


def _columns(table: NumberTable, form: TraceForm) -> tuple[_TraceColumn, _TraceColumn]:
    """Return the columns of the angle, and of the error or the output angle, from options, names or positions.

    Raises UsageError if one column is selected for both.
    Raises PresetError if the roles of the columns are unclear.
    """
    kinds = _column_kinds(table, form)
    angle = _angle_column(table, form, kinds)
    is_time = _is_time(table, angle, kinds[angle], form)
    if form.period is not None and not is_time:
        message = f'--period applies to a time column, but "{table.name(angle)}" of {table.file} contains angles'
        raise UsageError(message, "leave out --period, or select the time column with --angle NAME")
    shaft = _shaft_of_angle(kinds[angle], form, is_time=is_time)
    kinds[angle] = ""  # the column of the angle is not a candidate for the error
    by_second = form.second is not None or (form.error is None and "error" not in kinds and "output" in kinds)
    second_index = _second_column(table, form, kinds, by_second=by_second)
    if second_index == angle:
        raise _selected_twice(table, angle, by_second=by_second)
    if by_second and shaft == "output":
        raise table.fault(
            "the file contains no column of input angles", "select a column with --angle NAME --angle-of cam"
        )
    if is_time:
        return _by_time(table, angle, form), _error_column(table, second_index, form)
    content = "input angle" if shaft == "cam" else "output angle"
    first_unit, second_unit = (*form.angle_units, None, None)[:_ENCODERS]
    first_column = _in_unit(table, angle, shaft, content, first_unit, "deg", "--angle-unit")
    if not by_second:
        return first_column, _error_column(table, second_index, form)
    default = first_column.unit.removeprefix("-")  # both encoders have the same unit unless stated otherwise
    content = "output angle, second encoder"
    return first_column, _in_unit(table, second_index, "output", content, second_unit, default, "--angle-unit")


def _column_kinds(table: NumberTable, form: TraceForm) -> list[str]:
    """Return the role of each column by its name, empty if unknown; two unnamed columns get roles by position."""
    kinds = table.roles or [""] * table.values.shape[1]
    if len(kinds) != _ENCODERS or any(kinds):
        return kinds
    is_time = form.has_pace and form.angle_unit is form.angle_of is None
    table.notes.append(_TIME_BY_ORDER if is_time else BY_ORDER)
    return ["time" if is_time else "cam", "error"]


def _angle_column(
    table: NumberTable,
    form: TraceForm,
    kinds: Sequence[str],
) -> int:
    """Return the index of the column of the angle, which may be a column of time if there are no angles."""
    kind = next((kind for kind in ("cam", "angle", "output") if kind in kinds), "angle")
    if kind not in kinds and kinds.count("time") == 1:
        # times are converted with the speed of the output or the period of the input, and rejected if neither is given
        kind = "time"
    return _column(table, form.angle, kinds, kind, "angle")


def _shaft_of_angle(
    kind: str,
    form: TraceForm,
    *,
    is_time: bool,
) -> _Shaft:
    """Return the shaft of the column of the angle.

    kind: role of the column by its name.
    form: form, whose shaft takes precedence if it is stated.
    is_time: whether the column contains times, which give output angles with a speed and input angles with a period.
    """
    if form.angle_of:
        return form.angle_of
    if is_time:
        return "output" if form.period is None else "cam"
    return "output" if kind == "output" else "cam"


def _error_column(
    table: NumberTable,
    index: int,
    form: TraceForm,
) -> _TraceColumn:
    """Return the column of the error with its unit."""
    return _in_unit(table, index, None, "error", form.error_unit, "arcsec", "--error-unit")


def _is_time(
    table: NumberTable,
    index: int,
    kind: str,
    form: TraceForm,
) -> bool:
    """Return whether the column of the angle contains times.

    The stated unit decides, or the name of the column if no unit is stated.
    """
    if form.angle_unit is not None:
        return plain_unit(form.angle_unit) in TIMES
    name = table.name(index)
    return not unit_in(name) and (kind == "time" or quantity_of(foreign_unit_in(name)) == "time")


def _by_time(
    table: NumberTable,
    index: int,
    form: TraceForm,
) -> _TraceColumn:
    """Return a column of time as the angle of a shaft that turns at a constant speed.

    The shaft is the output if the form has a speed, and the input if it has a period.

    Raises PresetError if the form has neither.
    Raises UsageError if the form states the other shaft for the angle.
    """
    if not form.has_pace:
        message = f'"{table.name(index)}" is a column of times, not of angles'
        hint = (
            "state the speed of the output (--speed ARCSEC/S) or the period of an input revolution (--period S), "
            "or select an angle column with --angle NAME"
        )
        raise table.fault(message, hint)
    shaft: _Shaft = "output" if form.period is None else "cam"
    if form.angle_of not in (None, shaft):
        option, part = ("--speed", "output") if form.period is None else ("--period", "input")
        raise UsageError(
            f"--angle-of {form.angle_of} cannot be combined with a time column and {option}",
            f"leave out --angle-of; {option} applies to the {part}",
        )
    unit = table.unit_of(index, "time", "s", TIMES, form.angle_unit, "--angle-unit")
    if form.period is None:
        arcsec_per_s = form.speed or 0.0
        table.notes[-1] += f", the output angle at {arcsec_per_s:g} arcsec/s (--speed)"
    else:
        arcsec_per_s = WHOLE_TURN_DEG * _ARCSEC_PER_DEG / form.period
        table.notes[-1] += f", the input angle at one revolution in {form.period:g} s (--period)"
    table.deg_per_s = arcsec_per_s / _ARCSEC_PER_DEG
    return _TraceColumn(
        index=index,
        shaft=shaft,
        unit=unit,
        size=TIMES[unit] * arcsec_per_s,
    )


def _column(
    table: NumberTable,
    asked: str | None,
    kinds: Sequence[str],
    kind: str,
    option: str,
) -> int:
    """Return the index of the column with a requested name or number, or of the only column of a kind.

    asked: name or number, None for the only column of the kind.
    Raises PresetError if there is no such column or several.
    """
    if asked is not None:
        for plain in (str, str.lower):
            same = [i for i, name in enumerate(table.names) if plain(name) == plain(asked)]
            if len(same) == 1:
                return same[0]
        if asked.isascii() and asked.isdecimal() and 0 < int(asked) <= table.values.shape[1]:
            return int(asked) - 1
        raise table.fault(f"the file contains no column {asked}", "state the name or the number of a column")
    candidates = [index for index, column_kind in enumerate(kinds) if column_kind == kind]
    if len(candidates) == 1:
        return candidates[0]
    description = {"angle": "input or output angles", "error": "errors", "second": "output angles"}[option]
    several = ": " + ", ".join(f'"{table.name(i)}"' for i in candidates) if candidates else " by its name"
    hint = f"select the column with --{option} NAME or its number"
    count = f"{len(candidates)} columns" if candidates else "no column"
    raise table.fault(f"{count} of {description}{several}", hint)


def _in_unit(
    table: NumberTable,
    index: int,
    shaft: _Shaft | None,
    words: str,
    asked: str | None,
    default: str,
    option: str,
) -> _TraceColumn:
    """Return a column in the requested unit, the unit in its name, or the default unit, and add a note on the unit."""
    unit = table.unit_of(index, words, default, (*ANGLES, COUNTS), asked, option)
    is_in_counts = unit.removeprefix("-") not in ANGLES
    if asked is None and is_in_counts:
        raise table.fault(
            f'"{table.name(index)}": the counts per revolution are unknown',
            f"state them, for example {option} 16384,4194304",
        )
    column = _TraceColumn(
        index=index,
        shaft=shaft,
        unit=unit,
        size=angle_size(unit),
    )
    if is_in_counts:
        table.notes[-1] += " a turn"
    return column
