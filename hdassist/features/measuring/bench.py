"""Quantities that manufacturers and buyers state besides F'_ior, from approached positions and from torque loops.

The names of its columns identify the kind of file. A file of positions has the target angle of the output, the measured
angle or deviation, and the side from which the position was approached (1 or -1). Alternatively it has the target and a
column of deviations for each run, whose name states the side ("run 1 fwd"). A file of loops has the torque at the
output, the twist with the input locked, and optionally the number of the place in a third column.

Positions: each measured deviation is the deviation of its position and side plus the scatter of the approach. The
scatter has the same size at all positions.
Statistics of simulated approaches give the uncertainty of the measured statistics, and the amount by which scatter
widens a range.
Loops: the twist at a torque is that of a parabola through the nearby readings, on each branch.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.model.geometry import Array
from hdassist.features.measuring.fit import COVERAGE_FACTOR
from hdassist.features.measuring.orders import BIAS_SHARE, LARGEST_UNCERTAINTY
from hdassist.readers.table import NumberTable
from hdassist.readers.trace import LARGEST_ERROR, WHOLE_TURN_DEG, AngleError, TraceForm, sweeps
from hdassist.readers.words import TURN_ARCSEC, is_numbered_run, run_side_in
from hdassist.run.errors import DataError, PresetError, UsageError
from hdassist.run.files import GREATEST, number_of

_LOOP_SHARE = 0.04  # share of the rated torque, to each side, between which lost motion is measured
_AROUND = 5  # minimum number of readings for the fit of a parabola
TINY = 1e-30  # smallest range of torque [N*m], which avoids division by 0
_LOOP_HINT = "load the output from -T_0 to T_0 and back, where T_0 is the rated torque"
_SHRINK = 2.0  # multiple of the variance due to scatter that is subtracted from the variance of mean deviations
# Factor on the spread of a range whose bias was removed: the correction repeats the scatter of the estimate.
_SPREAD_FACTOR = 1.15
_LEAST_CHANCE = 0.975  # probability that a range is at least its lower confidence limit
_PLAN = re.compile(  # text written by hdassist plan, including earlier versions (turns, both ways)
    r"(?P<drive>.*), (?P<count>[0-9]{1,9}) positions"
    r"(?: over (?P<turns>[0-9.e+-]+) output (?:revolutions|turns))?(?P<both> both ways| from both sides)?"
)
# Largest distance of an approached position from a planned one, as a share of the step between positions.
_PLANNED_NEAR = 0.05
_ANGLE_ROLES = ("twist", "actual", "angle", "output")  # roles of columns that can contain output angles
_SAME_TARGET = 0.5  # arcsec: targets closer together than this are the same position


_REMARKS = {  # remarks of a sheet, each with its smallest and largest number and a description of its numbers
    "torque": (-1e7, 1e7, "a torque in N*m up to 1e+07"),
    "sees": (1e-9, 1.0, "three increasing shares"),
    "uncertainty": (0.0, LARGEST_UNCERTAINTY, f"a standard uncertainty in arcsec from 0 to {LARGEST_UNCERTAINTY:g}"),
}


def _are_shares(numbers: Sequence[float]) -> bool:
    """Return whether numbers are three increasing shares or empty."""
    return not numbers or (len(numbers) == 3 and list(numbers) == sorted(numbers))


@dataclass(frozen=True)
class _SheetPlan:
    """The plan of a filled-in sheet.

    drive: name of the drive.
    positions: number of positions.
    turns: output revolutions over which the positions are distributed.
    has_both_sides: whether each position is to be approached from both sides.
    """

    drive: str
    positions: int
    turns: float
    has_both_sides: bool


@dataclass(frozen=True, eq=False)
class PositionRecord:
    """Approaches of positions, in arrays of shape (rows,).

    target_arcsec: target angle of each approach.
    deviation_arcsec: deviation from the target.
    side: side from which the position was approached, 1 or -1.
    """

    table: NumberTable
    target_arcsec: Array
    deviation_arcsec: Array
    side: Array

    def position_numbers(self) -> NDArray[np.int64]:
        """Return the position number of each approach, counted from 0 by increasing target, shape (rows,)."""
        # targets written with different numbers of digits are the same position
        return np.unique(np.rint(self.target_arcsec / _SAME_TARGET), return_inverse=True)[1]

    def _remark_text(self, key: str) -> str:
        """Return the text of the remark "key: text" of the file, or an empty string if there is none."""
        entries = (line.entry for line in self.table.remarks)
        return next((entry[1] for entry in entries if entry and entry[0] == key), "")

    @property
    def plan(self) -> _SheetPlan | None:
        """The plan in the remarks of the file, or None if there is none or it is malformed."""
        # hdassist plan writes its name into a remark of the sheet
        written = _PLAN.fullmatch(self._remark_text("plan"))
        if written is None:
            return None
        turns = number_of(written["turns"]) if written["turns"] else 1.0
        positions = int(written["count"])
        if not (positions and 0 < turns < GREATEST):
            return None
        return _SheetPlan(
            drive=written["drive"], positions=positions, turns=turns, has_both_sides=bool(written["both"])
        )

    def is_carried_out(self, plan: _SheetPlan) -> bool:
        """Return whether every planned position was approached from every planned side."""
        step = TURN_ARCSEC * plan.turns / plan.positions
        planned = step * np.arange(plan.positions)
        tolerance = _PLANNED_NEAR * step
        sides = (1, -1) if plan.has_both_sides else (1,)
        for side in sides:
            targets = self.target_arcsec[self.side == side]
            # fewer approaches than positions cannot cover the plan
            if len(targets) < plan.positions:
                return False
            if np.abs(planned[:, None] - targets).min(axis=1).max() > tolerance:
                return False
        return True

    def remark(self, key: str) -> tuple[float, ...]:
        """Return the numbers of the remark "key: number ..." that hdassist plan writes, or () if it does not exist.

        Raises PresetError, with the line of the remark, if it has another form or numbers that a plan cannot contain.
        """
        numbers = tuple(map(number_of, self._remark_text(key).split()))
        low, high, expected = _REMARKS[key]
        # the comparison is false for NaN
        if not all(low <= number <= high for number in numbers) or (key == "sees" and not _are_shares(numbers)):
            raise self._remark_fault(key, f"expected {expected}")
        return numbers

    def _remark_fault(self, key: str, message: str) -> PresetError:
        """Return the error for an invalid remark, with its line."""
        entries = ((line.number, line.entry) for line in self.table.remarks)
        number, (_, text, column) = next((line, entry) for line, entry in entries if entry and entry[0] == key)
        self.table.add(number, column, key, message, text, "restore the comment that hdassist plan wrote")
        return PresetError(self.table.findings)


@dataclass(frozen=True, eq=False)
class LoopRecord:
    """Torque loops, in arrays of shape (rows,).

    torque_Nm: torque at the output.
    twist_arcsec: twist of the output.
    place: number of the place at which the loop was recorded.
    """

    table: NumberTable
    torque_Nm: Array
    twist_arcsec: Array
    place: Array


@dataclass(frozen=True)
class StatedQuantity:
    """Measured value of a quantity that manufacturers state.

    name: name of its acceptance limit.
    arcsec: measured value.
    uncertainty_arcsec: standard uncertainty, None if no approach was repeated.
    of: description of the readings from which it was computed.
    noise_arcsec: amount, exceeded in one recording out of 40, by which scatter of the approaches makes a range larger
    than that of the true deviations.
    """

    name: str
    arcsec: float
    uncertainty_arcsec: float | None
    of: str
    noise_arcsec: float = 0.0

    @property
    def expanded_arcsec(self) -> float:
        """Expanded uncertainty (k = 2); 0 without repeated approaches.

        It is at least noise_arcsec, so that value minus expanded uncertainty is never above the lower confidence limit.
        """
        if self.uncertainty_arcsec is None:
            return 0.0
        return max(COVERAGE_FACTOR * self.uncertainty_arcsec, self.noise_arcsec)

    @property
    def interval_arcsec(self) -> tuple[float, float] | None:
        """95 % interval; None without repeated approaches.

        Scatter alone makes a range larger than 0, so the lower end is the confidence limit that "at least" states.
        """
        if self.uncertainty_arcsec is None:
            return None
        lowest = max(0.0, self.arcsec - self.expanded_arcsec)
        return lowest, self.arcsec + COVERAGE_FACTOR * self.uncertainty_arcsec


@dataclass(frozen=True)
class SeenRange:
    """The range of deviations at approached positions, and the estimates of F'_ior that follow from the plan.

    arcsec: range at the positions.
    uncertainty_arcsec: standard uncertainty including that stated by the plan, None if no approach was repeated.
    expanded_arcsec: distance of the lower confidence limit below the range; if no approach was repeated, it includes
    only the uncertainty stated by the plan.
    seen: share of F'_ior that the positions capture, as 5, 50 and 95 % quantiles over drives and starting angles; empty
    unless a plan was carried out.
    M_g: torque of the plan [N*m].
    is_cut: whether planned positions or sides are missing.
    """

    arcsec: float
    uncertainty_arcsec: float | None
    expanded_arcsec: float = 0.0
    seen: tuple[float, ...] = ()
    M_g: float | None = None
    is_cut: bool = False

    @property
    def at_least_arcsec(self) -> float:
        """The lower confidence limit of the range at the positions, which is also a lower limit of F'_ior."""
        return max(0.0, self.arcsec - self.expanded_arcsec)

    @property
    def estimates_arcsec(self) -> tuple[float, ...]:
        """F'_ior if the positions capture the largest, the median and the smallest share; empty without a plan."""
        return tuple(self.arcsec / share for share in reversed(self.seen))


@dataclass(frozen=True)
class PlaceLoop:
    """Hysteresis loss and lost motion at one place [arcsec], each with its standard uncertainty.

    place: number of the place.
    """

    place: float
    hysteresis: tuple[float, float]
    lost_motion: tuple[float, float]


def bench_record(table: NumberTable, form: TraceForm | None = None) -> PositionRecord | LoopRecord | None:
    """Return the positions or loops of a table, identified by its column names, or None for any other table.

    table: table of numbers with column names.
    form: units stated in options, or None. If the form selects columns of a recording, the result is None.
    Raises UsageError if a unit is stated for a column that the table does not have.
    Raises PresetError if a column name has an unknown unit.
    """
    form = form or TraceForm()
    columns = {role: table.roles.index(role) for role in table.roles}
    angle = next((role for role in _ANGLE_ROLES if role in columns), "")
    # the user names columns only for a recording
    is_trace = not (form.angle is form.angle_of is form.error is form.second is None)
    # a table with an input angle is a recording, regardless of its other columns
    if "cam" in columns or is_trace:
        return None
    # a column of targets belongs to approached positions
    if "target" in columns:
        runs = _run_sides(table)
        if runs:
            return _positions_of_runs(table, columns["target"], runs, form)
        if "error" in columns or angle:
            return _positions_of_rows(table, columns, angle, form)
    if "torque" in columns and angle and "error" not in columns:
        return _loop(table, columns, angle, form)
    return None


def _numbers_of(
    table: NumberTable,
    columns: dict[str, int],
    role: str,
) -> Array:
    """Return the numbers in the column of a role, or ones if there is no such column, shape (rows,)."""
    return table.values[:, columns[role]] if role in columns else np.ones(len(table.lines))


def _positions_of_rows(
    table: NumberTable,
    columns: dict[str, int],
    angle: str,
    form: TraceForm,
) -> PositionRecord:
    """Return the approaches of a table with one row for each approach.

    table: table of numbers with column names.
    columns: column numbers by role.
    angle: role of the column of reached angles, empty if there is none.
    form: units stated in options.
    Raises UsageError if a unit is stated for a column that the table does not have.
    Raises PresetError if a column name has an unknown unit.
    Raises DataError if the readings are too large to be deviations.
    """
    units = form.angle_units
    has_deviations = "error" in columns
    _require_columns(form, has_angles=not has_deviations)
    target = table.in_unit(columns["target"], "target", "deg", units[0] if units else None, "--angle-unit")
    # the column contains deviations, as the sheet requires, or reached angles
    if has_deviations:
        deviation = table.in_unit(columns["error"], "error", "arcsec", form.error_unit, "--error-unit")
    else:
        reached = table.in_unit(columns[angle], angle, "deg", units[-1] if units else None, "--angle-unit")
        # the zero of the output encoder is arbitrary
        deviation = _from_any_zero(reached - target)
    _require_deviations(table, deviation)
    return PositionRecord(
        table=table,
        target_arcsec=target,
        deviation_arcsec=deviation,
        side=np.sign(_numbers_of(table, columns, "side")),
    )


def _require_columns(form: TraceForm, *, has_angles: bool) -> None:
    """Raise UsageError if a unit is stated for a column that approached positions do not have.

    form: units stated in options.
    has_angles: whether the table contains reached angles instead of deviations.
    """
    if len(form.angle_units) > 1 and not has_angles:
        message = f"--angle-unit {form.angle_unit}: a file of positions with deviations has only one column of angles"
        raise UsageError(message, "state one unit only")
    if form.error_unit is not None and has_angles:
        message = f"--error-unit {form.error_unit}: the positions have no column of deviations"
        raise UsageError(message, "state the unit of the angles with --angle-unit")


def _loop(
    table: NumberTable,
    columns: dict[str, int],
    angle: str,
    form: TraceForm,
) -> LoopRecord:
    """Return the torque loops of a table. The arguments are those of `_positions_of_rows`."""
    units = list(form.angle_units)
    if form.error_unit is not None:
        units.append(form.error_unit)
    # one column cannot have two units
    if len(units) > 1:
        message = "a file of torque loops has only one column of angles, but several units are stated"
        raise UsageError(message, "state one unit only")
    return LoopRecord(
        table=table,
        torque_Nm=table.in_unit(columns["torque"], "torque", "N·m"),
        twist_arcsec=table.in_unit(columns[angle], angle, "arcsec", units[0] if units else None, "--angle-unit"),
        place=_numbers_of(table, columns, "place"),
    )


def _run_sides(table: NumberTable) -> dict[int, int]:
    """Return the side of each column that contains one run, by column number; empty for a table of another form.

    Numbered runs without a side count as forward if no column states a side.
    Raises PresetError if only some of the columns state a side.
    """
    roles = table.roles
    # a column of sides belongs to the form with one row for each approach
    if roles.count("target") != 1 or "side" in roles:
        return {}
    names = {column: name for column, name in enumerate(table.names) if roles[column] != "target"}
    # sides by fwd, bwd and similar words in the column names
    sides = {column: side for column, name in names.items() if (side := run_side_in(name))}
    without_side = [column for column, name in names.items() if column not in sides and is_numbered_run(name)]
    if sides and without_side:
        message = f'the column name "{names[without_side[0]]}" does not state the side of approach, but others do'
        raise table.fault(message, "add fwd or bwd to the name of each run, for example run 1 bwd [arcsec]")
    # if no run states a side, all runs are forward
    return sides or dict.fromkeys(without_side, 1)


def _positions_of_runs(
    table: NumberTable,
    target_column: int,
    runs: dict[int, int],
    form: TraceForm,
) -> PositionRecord:
    """Return the approaches of a table with one row for each position and one column for each run.

    The runs contain deviations, or reached angles if their names say so, as in "run 1 measured fwd".

    table: table of numbers with column names.
    target_column: number of the column of targets.
    runs: side of each column that contains one run, by column number.
    form: units stated in options.
    Raises UsageError if a unit is stated for a column that the table does not have.
    Raises PresetError if a column name has an unknown unit, or if some runs contain deviations and others angles.
    Raises DataError if the readings are too large to be deviations.
    """
    units = form.angle_units
    are_angles = [table.roles[column] in _ANGLE_ROLES for column in runs]
    has_angles = any(are_angles)
    if has_angles and not all(are_angles):
        raise table.fault(
            "some runs contain deviations, others contain angles", "use either deviations or angles in all runs"
        )
    _require_columns(form, has_angles=has_angles)
    target = table.in_unit(target_column, "target", "deg", units[0] if units else None, "--angle-unit")
    readings = []
    sides = []
    reached_unit = units[-1] if units else None
    for column, side in runs.items():
        way = "forward" if side > 0 else "backward"
        if has_angles:
            readings.append(table.in_unit(column, f"angles, {way}", "deg", reached_unit, "--angle-unit") - target)
        else:
            readings.append(table.in_unit(column, f"deviations, {way}", "arcsec", form.error_unit, "--error-unit"))
        sides.append(np.full(len(target), float(side)))
    deviation = np.concatenate(readings)
    if has_angles:
        deviation = _from_any_zero(deviation)
    _note_unused(table, {target_column, *runs})
    _require_deviations(table, deviation)
    return PositionRecord(
        table=table,
        target_arcsec=np.tile(target, len(runs)),
        deviation_arcsec=deviation,
        side=np.concatenate(sides),
    )


def _note_unused(table: NumberTable, used: set[int]) -> None:
    """Add the names of unused columns to the notes of a table.

    used: numbers of the used columns.
    """
    unused = [name for column, name in enumerate(table.names) if column not in used]
    if unused:
        table.notes.append(f"not used: {', '.join(unused)}")


def _from_any_zero(off_arcsec: Array) -> Array:
    """Return angles minus targets, relative to the first row and wrapped to ±half a revolution, shape (rows,)."""
    # the zeros of both encoders are arbitrary, so the range is half a revolution to either side of the first row
    return np.asarray(np.mod(off_arcsec - off_arcsec[0] + TURN_ARCSEC / 2, TURN_ARCSEC) - TURN_ARCSEC / 2)


def _require_deviations(table: NumberTable, deviation_arcsec: Array) -> None:
    """Raise DataError if readings differ by too much to be deviations.

    deviation_arcsec: readings minus their targets, shape (rows,).
    """
    if (extent := float(np.ptp(deviation_arcsec))) > LARGEST_ERROR:
        hint = "write output angles in deg in this column, and deviations in a column deviation_arcsec"
        raise DataError(f"{table.file}: the readings differ from their targets by up to {extent:.3g}″", hint)


@dataclass(frozen=True, eq=False)
class _Approaches:
    """Approaches of positions, sorted by target and then by side.

    side: side of each approach, 1 or -1, shape (rows,).
    deviation_arcsec: deviation from the target, shape (rows,).
    positions: rows of each position.
    groups: rows of each position and side.
    """

    side: Array
    deviation_arcsec: Array
    positions: list[NDArray[np.int64]]
    groups: list[NDArray[np.int64]]

    @classmethod
    def of(cls, record: PositionRecord) -> _Approaches:
        """Sort the approaches of a recording. Targets that differ by less than _SAME_TARGET count as one position."""
        target = np.rint(record.target_arcsec / _SAME_TARGET)
        # the last key is the primary one: by target, then by side
        order = np.lexsort([record.side, target])
        target = target[order]
        side = record.side[order]
        positions = [np.flatnonzero(target == position) for position in np.unique(target)]
        groups = [rows[side[rows] == way] for rows in positions for way in np.unique(side[rows])]
        return cls(
            side=side,
            deviation_arcsec=record.deviation_arcsec[order],
            positions=positions,
            groups=groups,
        )

    def figures(self, deviations: Array) -> dict[str, Array]:
        """Return each quantity for several sets of deviations [arcsec], shape (sets,).

        Quantities that need more approaches are omitted.

        deviations: deviations of the approaches in each set [arcsec], shape (sets, rows).
        """
        positioning = []  # one value for each side
        for way in np.unique(self.side):
            # repeated approaches are averaged, since scatter is not part of the drive's F'_ior
            means = [deviations[:, rows].mean(axis=1) for rows in self.groups if self.side[rows[0]] == way]
            if len(means) > 1:
                positioning.append(np.ptp(means, axis=0))
        # rows of the positions that were approached from both sides
        both_sides = [rows for rows in self.positions if np.ptp(self.side[rows])]
        ranges = {
            "positioning": positioning,
            "repeatability": [np.ptp(deviations[:, rows], axis=1) / 2 for rows in self.groups if len(rows) > 1],
            "bidirectional": [np.ptp(deviations[:, rows], axis=1) / 2 for rows in both_sides],
        }
        return {name: np.max(values, axis=0) for name, values in ranges.items() if values}


@dataclass(frozen=True, eq=False)
class _DrawnFigures:
    """Quantities of simulated approaches by name [arcsec].

    of_mean: quantities of the mean deviations, without the spread that scatter adds to them, shape (1,).
    drawn: quantities of these deviations plus simulated scatter, shape (draws,).
    by_scatter: quantities of the simulated scatter only, shape (draws,).
    """

    of_mean: dict[str, Array]
    drawn: dict[str, Array]
    by_scatter: dict[str, Array]

    @classmethod
    def of(
        cls,
        approaches: _Approaches,
        seed: int,
        draws: int,
    ) -> _DrawnFigures | None:
        """Return quantities of simulated approaches with the measured scatter, or None if no approach was repeated.

        The size of the scatter is uncertain, so each draw has its own size.
        """
        deviation = approaches.deviation_arcsec
        # the mean of each group uses up one degree of freedom
        freedom = len(deviation) - len(approaches.groups)
        if not freedom:
            return None
        means = np.concatenate([np.full(len(rows), deviation[rows].mean()) for rows in approaches.groups])
        square_sum = float(np.sum((deviation - means) ** 2))
        rng = np.random.default_rng(seed)
        # few repetitions leave the size of the scatter uncertain, so each draw has its own size
        scatter = np.sqrt(square_sum / rng.chisquare(freedom, (draws, 1)))
        errors = scatter * rng.standard_normal((draws, len(deviation)))
        # draws are centred on means without the spread that scatter added to them
        best = _without_scatter(deviation, approaches.side, approaches.groups, square_sum / freedom)
        return cls(
            of_mean=approaches.figures(best[None]),
            drawn=approaches.figures(best + errors),
            by_scatter=approaches.figures(errors),
        )

    def bias(self, name: str) -> float:
        """Return the amount by which scatter widens a quantity [arcsec], 0 except for the positioning error."""
        # the other quantities describe the scatter itself
        if name != "positioning":
            return 0.0
        return max(0.0, float(self.drawn[name].mean() - self.of_mean[name][0]))

    def standard_uncertainty(self, name: str) -> float:
        """Return the standard uncertainty of a quantity after correction of its bias [arcsec]."""
        factor = _SPREAD_FACTOR if name == "positioning" else 1.0
        return hypot(factor * float(self.drawn[name].std()), BIAS_SHARE * self.bias(name))

    def noise(self, name: str) -> float:
        """Return the amount by which scatter may widen a range beyond its bias [arcsec].

        One recording in 40 exceeds this amount. A range is at most the range of the true deviations plus that of the
        scatter.
        """
        # even positions without true deviations have a range, which is due to scatter
        return max(0.0, float(np.quantile(self.by_scatter[name], _LEAST_CHANCE)) - self.bias(name))


def position_quantities(
    record: PositionRecord,
    *,
    seed: int = 0,
    draws: int = 2000,
) -> tuple[StatedQuantity, ...]:
    """Return the measured positioning error, repeatability and bidirectional repeatability.

    The positioning error is unidirectional. A single position has no positioning error.

    record: approached positions.
    seed: seed of the simulated approaches.
    draws: number of simulated sets of approaches, from which the uncertainty is estimated.
    Raises DataError if there is only one approach.
    """
    count = len(record.target_arcsec)
    if count < 2:
        hint = "approach at least two positions (preferably 12 or 211), or one position from both sides"
        raise DataError(f"{record.table.file}: only one approach of one position", hint)
    approaches = _Approaches.of(record)
    drawn = _DrawnFigures.of(approaches, seed, draws)
    quantities = []
    for name, (value,) in approaches.figures(approaches.deviation_arcsec[None]).items():
        bias = drawn.bias(name) if drawn else 0.0
        quantity = StatedQuantity(
            name=name,
            arcsec=max(0.0, float(value) - bias),
            uncertainty_arcsec=drawn.standard_uncertainty(name) if drawn else None,
            of=f"{_counted(len(approaches.positions), 'position')}, {count} approaches",
            noise_arcsec=drawn.noise(name) if drawn and name == "positioning" else 0.0,
        )
        quantities.append(quantity)
    return tuple(quantities)


def _without_scatter(
    deviation: Array,
    side: Array,
    groups: Sequence[NDArray[np.int64]],
    variance: float,
) -> Array:
    """Return the mean deviation for the position and side of each approach, without the spread that scatter adds.

    Means of few approaches also scatter, so their range is larger than that of the true deviations. The means of a side
    are shrunk towards their common mean by the share of scatter in their variance.

    deviation: deviation of each approach [arcsec], shape (rows,).
    side: side of each approach, shape (rows,).
    groups: rows of each position and side.
    variance: variance of single approaches [arcsec^2].
    """
    best = np.empty(len(deviation))
    for way in np.unique(side):
        of_side = [rows for rows in groups if side[rows[0]] == way]
        means = np.array([deviation[rows].mean() for rows in of_side])
        spread = float(np.var(means, ddof=1)) if len(means) > 1 else 0.0
        # mean variance of the means, each of n readings
        by_scatter = variance * float(np.mean([1 / len(rows) for rows in of_side]))
        # as for orders, twice the variance due to noise is subtracted
        kept = max(0.0, 1 - _SHRINK * by_scatter / spread) if spread else 1.0
        shrunk = means.mean() + np.sqrt(kept) * (means - means.mean())
        for rows, mean in zip(of_side, shrunk, strict=True):
            best[rows] = mean
    return best


def _counted(number: int, noun: str) -> str:
    """Return a number followed by its noun, in the plural unless the number is 1."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def seen_range(record: PositionRecord, quantities: Sequence[StatedQuantity]) -> SeenRange | None:
    """Return the range at approached positions and what it implies for F'_ior, or None for a single position.

    The shares stated by a plan count only if all planned positions were approached from all planned sides.

    record: approached positions.
    quantities: quantities of the recording.
    Raises PresetError if a remark does not have the form that hdassist plan writes.
    """
    positioning = next((quantity for quantity in quantities if quantity.name == "positioning"), None)
    if positioning is None:
        return None
    planned_uncertainty = record.remark("uncertainty")
    by_scatter = positioning.uncertainty_arcsec  # known only from repeated approaches
    shares = record.remark("sees")
    torque = record.remark("torque")
    plan = record.plan
    # the shares hold only for the planned positions
    is_cut = bool(shares) and (plan is None or not record.is_carried_out(plan))
    # contribution of encoder, coupling and temperature, according to the sheet
    by_plan = COVERAGE_FACTOR * hypot(*planned_uncertainty)
    if by_scatter is None:  # no approach was repeated, so only the plan states an uncertainty
        uncertainty = None
        expanded = by_plan
    else:
        uncertainty = hypot(by_scatter, *planned_uncertainty)
        expanded = hypot(max(COVERAGE_FACTOR * by_scatter, positioning.noise_arcsec), by_plan)
    return SeenRange(
        arcsec=positioning.arcsec,
        uncertainty_arcsec=uncertainty,
        expanded_arcsec=expanded,
        seen=() if is_cut else shares,
        M_g=torque[0] if torque else None,
        is_cut=is_cut,
    )


def place_loops(record: LoopRecord, rated: float) -> tuple[PlaceLoop, ...]:
    """Return the hysteresis loss and the lost motion of the loops at each place.

    record: torque loops.
    rated: rated torque of the drive [N*m].
    Raises DataError if a loop lacks an increasing or a decreasing branch between the torques of the lost motion.
    """
    # the lost motion is measured between the outer torques, the hysteresis at 0
    torques = _LOOP_SHARE * rated * np.array([-1.0, 0.0, 1.0])
    loops = []
    for place in np.unique(record.place):
        is_here = record.place == place
        branches = _LoopBranches(
            label=f"{record.table.file}: place {place:g}",
            torque_Nm=record.torque_Nm[is_here],
            twist_arcsec=record.twist_arcsec[is_here],
        )
        loops.append(branches.figures(float(place), torques))
    return tuple(loops)


@dataclass(frozen=True, eq=False)
class _LoopBranches:
    """Torque loops at one place.

    label: file and place, for messages.
    torque_Nm: torque of each reading, shape (rows,).
    twist_arcsec: twist of each reading, shape (rows,).
    """

    label: str
    torque_Nm: Array
    twist_arcsec: Array

    def figures(self, place: float, torques: Array) -> PlaceLoop:
        """Return the hysteresis loss and the lost motion.

        place: number of the place.
        torques: negative torque of the lost motion, 0, and positive torque of the lost motion [N*m], shape (3,).
        """
        try:
            # torque scaled to an angle of one revolution, so that the search for turning points of angles applies
            branches = sweeps(self.torque_Nm * WHOLE_TURN_DEG / max(np.ptp(self.torque_Nm), TINY))
        except AngleError:
            raise DataError(
                f"{self.label}: the torque does not increase and decrease in complete branches",
                f"{_LOOP_HINT}; for a recording over the input angle, select its columns with --angle and --second",
            ) from None
        rising = self._twists([branch.rows for branch in branches if branch.direction == 1], "rising", torques)
        falling = self._twists([branch.rows for branch in branches if branch.direction == -1], "falling", torques)
        # the absolute difference at torque 0 is the hysteresis loss
        difference = rising.arcsec - falling.arcsec
        variance = rising.variance + falling.variance
        # change of twist between the outer torques, on each branch
        widths = np.array([twists.arcsec[2] - twists.arcsec[0] for twists in (rising, falling)])
        return PlaceLoop(
            place=place,
            hysteresis=(abs(float(difference[1])), sqrt(variance[1])),
            lost_motion=(abs(float(widths.mean())), sqrt(variance[0] + variance[2]) / 2),
        )

    def _twists(
        self,
        branches: Sequence[slice],
        way: str,
        torques: Array,
    ) -> _BranchTwists:
        """Return the twists at torques [N*m], from all branches in one direction that cover these torques.

        branches: rows of each branch.
        way: name of the direction, for messages.
        torques: torques in increasing order [N*m], shape (3,).
        Raises DataError if no branch covers the torques.
        """
        complete = []
        for rows in branches:
            torque = self.torque_Nm[rows]
            if torque.min() <= torques[0] and torque.max() >= torques[2]:
                complete.append(rows)
        if not complete:
            span = f"from {torques[0]:.3g} to {torques[2]:.3g} N*m"
            raise DataError(f"{self.label}: no complete {way} branch {span} was recorded", _LOOP_HINT)
        # all complete branches in one direction are fitted together
        torque = np.concatenate([self.torque_Nm[rows] for rows in complete])
        twist = np.concatenate([self.twist_arcsec[rows] for rows in complete])
        values = [_twist_at(torque, twist, wanted, torques[2]) for wanted in torques]
        return _BranchTwists(*np.array(values).T)


@dataclass(frozen=True, eq=False)
class _BranchTwists:
    """Twists at several torques [arcsec] and their variances [arcsec^2], each of shape (torques,)."""

    arcsec: Array
    variance: Array


def loop_quantities(loops: tuple[PlaceLoop, ...]) -> tuple[StatedQuantity, ...]:
    """Return the largest hysteresis loss and the largest lost motion over all places."""
    places = f"the largest of {len(loops)} places" if len(loops) > 1 else "one place"
    hysteresis = max(loop.hysteresis for loop in loops)
    lost_motion = max(loop.lost_motion for loop in loops)
    return (
        StatedQuantity("hysteresis_loss", *hysteresis, places),
        StatedQuantity("lost_motion", *lost_motion, places),
    )


def _twist_at(
    torque: Array,
    twist: Array,
    wanted: float,
    reach: float,
) -> tuple[float, float]:
    """Return the twist at a torque [arcsec] from a parabola through the nearby readings, and its variance [arcsec^2].

    torque: torques of the readings [N*m], shape (rows,).
    twist: twists of the readings [arcsec], shape (rows,).
    wanted: torque at which the twist is computed [N*m].
    reach: largest torque difference of the readings used [N*m], increased if it includes too few readings.
    """
    offset = torque - wanted
    # distance that includes _AROUND readings even if they are sparse
    nearest = float(np.partition(np.abs(offset), _AROUND - 1)[_AROUND - 1])
    is_near = np.abs(offset) <= max(reach, nearest)
    # the parabola is centred on the wanted torque, so its constant is the twist there
    columns = np.vander(offset[is_near], 3, increasing=True)
    inverse = np.linalg.pinv(columns)
    solution = inverse @ twist[is_near]
    residual = twist[is_near] - columns @ solution
    variance = residual @ residual / (len(residual) - 3)
    return float(solution[0]), float(variance * (inverse[0] @ inverse[0]))
