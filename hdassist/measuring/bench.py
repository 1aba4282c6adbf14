"""Figures that makers and buyers state of a drive beside F'_ior: from approached positions, and from torque loops.

A file of either is known by the names of its columns. Positions: a target angle of the output, the angle or the
deviation that was measured there, and the side from which it was approached, 1 or -1; or a target and a column of
deviations for each run, with its side in the name ("run 1 fwd"). A loop: torque at the output and
its twist, the cam held; a number of the place in a third column.

Positions: every deviation is that of its position and side, and scatter of the approach, alike everywhere. Statistics
of drawn approaches say how uncertain those of the measured ones are, and by how much scatter widens a range.
Loops: the twist at a torque is that of a parabola through the readings around it, on each branch.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import DataError, PresetError, UsageError
from hdassist.files import GREATEST, number_of
from hdassist.measuring.fit import COVERAGE_FACTOR
from hdassist.measuring.orders import BIAS_SHARE, LARGEST_UNCERTAINTY
from hdassist.model.geometry import Array
from hdassist.readers.table import NumberTable
from hdassist.readers.trace import LARGEST_ERROR, WHOLE_TURN_DEG, AngleError, TraceForm, sweeps
from hdassist.readers.words import TURN_ARCSEC, is_numbered_run, run_side_in

_LOOP_SHARE = 0.04  # share of the rated torque, to each side, between which lost motion is measured
_AROUND = 5  # readings, at least, through which a parabola is laid
TINY = 1e-30  # N*m
_LOOP_HINT = "load from -T_0 to T_0 and back, with T_0 the rated torque"
_SHRINK = 2.0  # times the variance by scatter, taken off the variance of mean deviations
# Factor on the spread of a range whose bias was removed: the correction repeats the scatter of the estimate.
_SPREAD_FACTOR = 1.15
_LEAST_CHANCE = 0.975  # that a range is at least its lower confidence limit
_PLAN = re.compile(  # as hdassist plan names it, also in earlier versions (turns, both ways)
    r"(?P<drive>.*), (?P<count>[0-9]{1,9}) positions"
    r"(?: over (?P<turns>[0-9.e+-]+) output (?:revolutions|turns))?(?P<both> both ways| from both sides)?"
)
# Largest distance of an approached position from a planned one, as a share of the step between positions.
_PLANNED_NEAR = 0.05
_ANGLE_ROLES = ("twist", "actual", "angle", "output")  # contents of a column of angles of the output
_SAME_TARGET = 0.5  # arcsec: targets nearer than that are one


_REMARKS = {  # of a sheet: least and largest number, and the numbers in words
    "torque": (-1e7, 1e7, "a torque in N*m up to 1e+07"),
    "sees": (1e-9, 1.0, "three rising shares"),
    "uncertainty": (0.0, LARGEST_UNCERTAINTY, f"a standard uncertainty in arcsec from 0 to {LARGEST_UNCERTAINTY:g}"),
}


def _are_shares(numbers: Sequence[float]) -> bool:
    """Return whether numbers are three rising shares, or there are none."""
    return not numbers or (len(numbers) == 3 and list(numbers) == sorted(numbers))


@dataclass(frozen=True)
class _SheetPlan:
    """The plan of a filled-in sheet: its drive by name, positions, output revolutions, and whether from both sides."""

    drive: str
    positions: int
    turns: float
    has_both_sides: bool


@dataclass(frozen=True, eq=False)
class PositionRecord:
    """Approaches of positions, each of shape (rows,): target [arcsec], deviation [arcsec], side 1 or -1."""

    table: NumberTable
    target_arcsec: Array
    deviation_arcsec: Array
    side: Array

    def position_numbers(self) -> NDArray[np.int64]:
        """Return the number of the position of each approach, from 0 by rising target, shape (rows,)."""
        # targets written with other digits are one position
        return np.unique(np.rint(self.target_arcsec / _SAME_TARGET), return_inverse=True)[1]

    def _remark_text(self, key: str) -> str:
        """Return the text of a remark "key: text" of the file; empty without one."""
        entries = (line.entry for line in self.table.remarks)
        return next((entry[1] for entry in entries if entry and entry[0] == key), "")

    @property
    def plan(self) -> _SheetPlan | None:
        """The plan in the remarks of the file; None without one, or if it is not as a plan writes it."""
        # the plan writes its name into a remark of the sheet
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
        """Return whether every position of a plan was approached from every planned side."""
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
        """Return the numbers of a remark "key: number ..." of the file, as a plan writes them; empty without one.

        Raises PresetError with the line of the remark for other text and for numbers that a plan cannot have.
        """
        numbers = tuple(map(number_of, self._remark_text(key).split()))
        low, high, expected = _REMARKS[key]
        # NaN fails both comparisons
        if not all(low <= number <= high for number in numbers) or (key == "sees" and not _are_shares(numbers)):
            raise self._remark_fault(key, f"expected {expected}")
        return numbers

    def _remark_fault(self, key: str, message: str) -> PresetError:
        """Return the fault of a remark, with its line."""
        entries = ((line.number, line.entry) for line in self.table.remarks)
        number, (_, text, column) = next((line, entry) for line, entry in entries if entry and entry[0] == key)
        self.table.add(number, column, key, message, text, "keep the comment as hdassist plan wrote it")
        return PresetError(self.table.findings)


@dataclass(frozen=True, eq=False)
class LoopRecord:
    """Torque loops, each of shape (rows,): torque [N*m], twist [arcsec], number of the place."""

    table: NumberTable
    torque_Nm: Array
    twist_arcsec: Array
    place: Array


@dataclass(frozen=True)
class StatedQuantity:
    """A quantity that makers state: name of its limit in acceptance, value and standard uncertainty [arcsec].

    uncertainty_arcsec: None without repetition. of: the readings that it is of, in words. noise_arcsec: most by which
    the scatter of the approaches makes a range larger than that of the true deviations, but once in 40 records.
    """

    name: str
    arcsec: float
    uncertainty_arcsec: float | None
    of: str
    noise_arcsec: float = 0.0


@dataclass(frozen=True)
class SeenRange:
    """What positions tell of F'_ior [arcsec]: the range that they see, and more by their plan.

    uncertainty_arcsec: standard, with that of a plan, None without repetition; expanded_arcsec: how far the lower
    confidence limit of the range lies below it, without repetition by the plan alone; seen: share of F'_ior that they
    see, at 5, 50 and 95 % of drives and starts, empty without a plan that was carried out; M_g: torque of the plan
    [N*m]; is_cut: whether planned positions or sides are missing.
    """

    arcsec: float
    uncertainty_arcsec: float | None
    expanded_arcsec: float = 0.0
    seen: tuple[float, ...] = ()
    M_g: float | None = None
    is_cut: bool = False

    @property
    def at_least_arcsec(self) -> float:
        """The lower confidence limit of the range that they see, which is one of F'_ior too."""
        return max(0.0, self.arcsec - self.expanded_arcsec)

    @property
    def estimates_arcsec(self) -> tuple[float, ...]:
        """F'_ior where they see most, the median share, and least; empty without a plan."""
        return tuple(self.arcsec / share for share in reversed(self.seen))


@dataclass(frozen=True)
class PlaceLoop:
    """Loops at one place: its number, hysteresis loss and lost motion [arcsec], each with its standard uncertainty."""

    place: float
    hysteresis: tuple[float, float]
    lost_motion: tuple[float, float]


def bench_record(table: NumberTable, form: TraceForm | None = None) -> PositionRecord | LoopRecord | None:
    """Return positions or loops of a table by the names of its columns; None for any other, such as a trace.

    Arguments: table of numbers with the names of its columns.
    form: units that options state, None for none. One that names columns of a trace makes the table a trace.
    Raises UsageError if a stated unit is that of no column; PresetError if a name has a unit that is not understood.
    """
    form = form or TraceForm()
    columns = {role: table.roles.index(role) for role in table.roles}
    angle = next((role for role in _ANGLE_ROLES if role in columns), "")
    # who names columns of a recording has one
    is_trace = not (form.angle is form.angle_of is form.error is form.second is None)
    # an input angle makes it a recording, whatever else it has
    if "cam" in columns or is_trace:
        return None
    # a column of targets: approached positions
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
    """Return the numbers of the column of a role, shape (rows,); ones without it."""
    return table.values[:, columns[role]] if role in columns else np.ones(len(table.lines))


def _positions_of_rows(
    table: NumberTable,
    columns: dict[str, int],
    angle: str,
    form: TraceForm,
) -> PositionRecord:
    """Return the approaches of a table that has a row for each.

    table: table of numbers with the names of its columns.
    columns: numbers of the columns by their roles.
    angle: role of the column of angles that were reached, empty if there is none.
    form: units that options state.
    Raises UsageError for a unit of a column that the table does not have; PresetError for a name with a unit that is
    not understood; DataError for readings that are no deviations.
    """
    units = form.angle_units
    has_deviations = "error" in columns
    _require_columns(form, has_angles=not has_deviations)
    target = table.in_unit(columns["target"], "target", "deg", units[0] if units else None, "--angle-unit")
    # deviations as the sheet asks for them, or angles as reached
    if has_deviations:
        deviation = table.in_unit(columns["error"], "error", "arcsec", form.error_unit, "--error-unit")
    else:
        reached = table.in_unit(columns[angle], angle, "deg", units[-1] if units else None, "--angle-unit")
        # the output encoder may have any zero
        deviation = _from_any_zero(reached - target)
    _require_deviations(table, deviation)
    return PositionRecord(
        table=table,
        target_arcsec=target,
        deviation_arcsec=deviation,
        side=np.sign(_numbers_of(table, columns, "side")),
    )


def _require_columns(form: TraceForm, *, has_angles: bool) -> None:
    """Raise UsageError for a stated unit of a column that approached positions do not have.

    form: units that options state; has_angles: whether the table has the angles that were reached, not deviations.
    """
    if len(form.angle_units) > 1 and not has_angles:
        message = f"--angle-unit {form.angle_unit}: a file of positions with deviations has only one column of angles"
        raise UsageError(message, "state one unit")
    if form.error_unit is not None and has_angles:
        message = f"--error-unit {form.error_unit}: the positions have no column of deviations"
        raise UsageError(message, "state the unit of their angles with --angle-unit")


def _loop(
    table: NumberTable,
    columns: dict[str, int],
    angle: str,
    form: TraceForm,
) -> LoopRecord:
    """Return the torque loops of a table; the arguments are those of `_positions_of_rows`."""
    units = list(form.angle_units)
    if form.error_unit is not None:
        units.append(form.error_unit)
    # one column cannot have two units
    if len(units) > 1:
        raise UsageError("a file of torque loops has only one column of angles, but several units are stated")
    return LoopRecord(
        table=table,
        torque_Nm=table.in_unit(columns["torque"], "torque", "N·m"),
        twist_arcsec=table.in_unit(columns[angle], angle, "arcsec", units[0] if units else None, "--angle-unit"),
        place=_numbers_of(table, columns, "place"),
    )


def _run_sides(table: NumberTable) -> dict[int, int]:
    """Return the sides of the columns that have one run each, by their numbers; empty for another form of table.

    Numbered runs without a side are forward if no column has a side. Raises PresetError if some columns have one.
    """
    roles = table.roles
    # a column of sides belongs to the form with a row for each approach
    if roles.count("target") != 1 or "side" in roles:
        return {}
    names = {column: name for column, name in enumerate(table.names) if roles[column] != "target"}
    # fwd, bwd and the like in the names of the columns
    sides = {column: side for column, name in names.items() if (side := run_side_in(name))}
    without_side = [column for column, name in names.items() if column not in sides and is_numbered_run(name)]
    if sides and without_side:
        message = f'the column "{names[without_side[0]]}" states no side, but other runs do'
        raise table.fault(message, "write fwd or bwd into the name of each run, for example run 1 bwd [arcsec]")
    # runs without a side are all from below
    return sides or dict.fromkeys(without_side, 1)


def _positions_of_runs(
    table: NumberTable,
    target_column: int,
    runs: dict[int, int],
    form: TraceForm,
) -> PositionRecord:
    """Return the approaches of a table that has a row for each position and a column for each run.

    The runs have deviations, or the angles that were reached if their names say so, as "run 1 measured fwd".

    table: table of numbers with the names of its columns.
    target_column: number of the column of targets.
    runs: sides of the columns that have one run each, by their numbers.
    form: units that options state.
    Raises UsageError for a unit of a column that the table does not have; PresetError for a name with a unit that is
    not understood, and for runs of both kinds; DataError for readings that are no deviations.
    """
    units = form.angle_units
    are_angles = [table.roles[column] in _ANGLE_ROLES for column in runs]
    has_angles = any(are_angles)
    if has_angles and not all(are_angles):
        raise table.fault("some runs contain deviations, others contain angles", "write all runs in the same way")
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
    """Add the names of columns that are not used to the notes of a table; used: numbers of the other columns."""
    unused = [name for column, name in enumerate(table.names) if column not in used]
    if unused:
        table.notes.append(f"not used: {', '.join(unused)}")


def _from_any_zero(off_arcsec: Array) -> Array:
    """Return angles minus their targets [arcsec], shape (rows,), whatever zeros both have: 0 in the first row."""
    # wrapped into half a revolution to either side
    return np.asarray(np.mod(off_arcsec - off_arcsec[0] + TURN_ARCSEC / 2, TURN_ARCSEC) - TURN_ARCSEC / 2)


def _require_deviations(table: NumberTable, deviation_arcsec: Array) -> None:
    """Raise DataError for readings that are too far apart to be deviations [arcsec], shape (rows,)."""
    if (extent := float(np.ptp(deviation_arcsec))) > LARGEST_ERROR:
        hint = "write output angles in deg in this column, and deviations in a column deviation_arcsec"
        raise DataError(f"{table.file}: readings differ from their targets by up to {extent:.3g}″", hint)


@dataclass(frozen=True, eq=False)
class _Approaches:
    """Approaches of positions, sorted by target and then by side.

    side: 1 or -1, shape (rows,).
    deviation_arcsec: shape (rows,).
    positions: rows of each position.
    groups: rows of each position and side.
    """

    side: Array
    deviation_arcsec: Array
    positions: list[NDArray[np.int64]]
    groups: list[NDArray[np.int64]]

    @classmethod
    def of(cls, record: PositionRecord) -> _Approaches:
        """Sort the approaches of a record; targets that differ by less than _SAME_TARGET are one."""
        target = np.rint(record.target_arcsec / _SAME_TARGET)
        # the last key sorts first: by target, then by side
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
        """Return quantities of sets of deviations [arcsec], shape (sets, rows), each of shape (sets,).

        Quantities that need more approaches are left out.
        """
        positioning = []  # of each side
        for way in np.unique(self.side):
            # of repeated approaches, since F'_ior is a matter of the drive and not of scatter
            means = [deviations[:, rows].mean(axis=1) for rows in self.groups if self.side[rows[0]] == way]
            if len(means) > 1:
                positioning.append(np.ptp(means, axis=0))
        # positions that were approached from either side
        both_sides = [rows for rows in self.positions if np.ptp(self.side[rows])]
        ranges = {
            "positioning": positioning,
            "repeatability": [np.ptp(deviations[:, rows], axis=1) / 2 for rows in self.groups if len(rows) > 1],
            "bidirectional": [np.ptp(deviations[:, rows], axis=1) / 2 for rows in both_sides],
        }
        return {name: np.max(values, axis=0) for name, values in ranges.items() if values}


@dataclass(frozen=True, eq=False)
class _DrawnFigures:
    """Quantities of drawn approaches by their names [arcsec].

    of_mean: of the mean deviations without what scatter adds to their spread, shape (1,).
    drawn: of these with drawn scatter, shape (draws,).
    by_scatter: of the drawn scatter alone, shape (draws,).
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
        """Draw approaches with the scatter of measured ones, whose size is uncertain; None without repetition."""
        deviation = approaches.deviation_arcsec
        # repetitions: each group takes one degree of freedom for its mean
        freedom = len(deviation) - len(approaches.groups)
        if not freedom:
            return None
        means = np.concatenate([np.full(len(rows), deviation[rows].mean()) for rows in approaches.groups])
        square_sum = float(np.sum((deviation - means) ** 2))
        rng = np.random.default_rng(seed)
        # its size is known from few repetitions, so it is drawn too
        scatter = np.sqrt(square_sum / rng.chisquare(freedom, (draws, 1)))
        errors = scatter * rng.standard_normal((draws, len(deviation)))
        # draws go around means without the part of their spread that scatter made
        best = _without_scatter(deviation, approaches.side, approaches.groups, square_sum / freedom)
        return cls(
            of_mean=approaches.figures(best[None]),
            drawn=approaches.figures(best + errors),
            by_scatter=approaches.figures(errors),
        )

    def bias(self, name: str) -> float:
        """Return by how much scatter widens a quantity [arcsec]; that of positioning is corrected alone."""
        # the other figures state scatter itself
        if name != "positioning":
            return 0.0
        return max(0.0, float(self.drawn[name].mean() - self.of_mean[name][0]))

    def standard_uncertainty(self, name: str) -> float:
        """Return the standard uncertainty of a quantity without its bias [arcsec]."""
        factor = _SPREAD_FACTOR if name == "positioning" else 1.0
        return hypot(factor * float(self.drawn[name].std()), BIAS_SHARE * self.bias(name))

    def noise(self, name: str) -> float:
        """Return the most by which scatter widens a range beyond its bias [arcsec], but once in 40 records.

        A range is at most that of the true deviations plus that of the scatter.
        """
        # positions without any deviation of their own still show a range by scatter
        return max(0.0, float(np.quantile(self.by_scatter[name], _LEAST_CHANCE)) - self.bias(name))


def position_quantities(
    record: PositionRecord,
    *,
    seed: int = 0,
    draws: int = 2000,
) -> tuple[StatedQuantity, ...]:
    """Return positioning one way, repeatability, and repeatability from both sides, as far as they were measured.

    One position has no positioning.

    record: of approached positions.
    seed, draws: of the drawn approaches, by which the uncertainty is estimated.
    Raises DataError for a single approach.
    """
    count = len(record.target_arcsec)
    if count < 2:
        hint = "approach at least two positions, better 12 or 211, or one position from both sides"
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
    """Return the mean deviation of each approach's position and side, less what scatter adds to their spread.

    Means over few approaches scatter too, so their range is larger than that of the true deviations. The means of a
    side are drawn towards their common mean by the share of scatter in their variance.

    deviation, side: of each approach, shape (rows,).
    groups: rows of each position and side.
    variance: of single approaches [arcsec^2].
    """
    best = np.empty(len(deviation))
    for way in np.unique(side):
        of_side = [rows for rows in groups if side[rows[0]] == way]
        means = np.array([deviation[rows].mean() for rows in of_side])
        spread = float(np.var(means, ddof=1)) if len(means) > 1 else 0.0
        # variance of a mean of n readings
        by_scatter = variance * float(np.mean([1 / len(rows) for rows in of_side]))
        # as for orders: twice the noise is taken off the power
        kept = max(0.0, 1 - _SHRINK * by_scatter / spread) if spread else 1.0
        shrunk = means.mean() + np.sqrt(kept) * (means - means.mean())
        for rows, mean in zip(of_side, shrunk, strict=True):
            best[rows] = mean
    return best


def _counted(number: int, noun: str) -> str:
    """Return a number with its noun, in the plural for more than one."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def seen_range(record: PositionRecord, quantities: Sequence[StatedQuantity]) -> SeenRange | None:
    """Return what a record of positions shows of F'_ior; None for one position.

    The shares that a plan sees count only if all of its positions were approached from its sides.

    record: of approached positions.
    quantities: of the record.
    Raises PresetError for remarks that no plan has.
    """
    positioning = next((quantity for quantity in quantities if quantity.name == "positioning"), None)
    if positioning is None:
        return None
    planned_uncertainty = record.remark("uncertainty")
    by_scatter = positioning.uncertainty_arcsec  # known by repetition alone
    shares = record.remark("sees")
    torque = record.remark("torque")
    plan = record.plan
    # the plan's shares hold only for the positions of the plan
    is_cut = bool(shares) and (plan is None or not record.is_carried_out(plan))
    # what encoder, coupling and temperature add, by the sheet
    by_plan = COVERAGE_FACTOR * hypot(*planned_uncertainty)
    if by_scatter is None:  # the scatter of the readings is known only from the plan
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
    """Return hysteresis loss and lost motion of the loops at each place.

    record: of torque loops.
    rated: torque of the drive [N*m].
    Raises DataError for a loop without a rising and a falling branch between the torques of the lost motion.
    """
    # lost motion lies between the outer two, hysteresis at 0
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
    """Torque loops at one place: file and place in words, and torque and twist of each reading, shape (rows,)."""

    label: str
    torque_Nm: Array
    twist_arcsec: Array

    def figures(self, place: float, torques: Array) -> PlaceLoop:
        """Return hysteresis loss and lost motion.

        place: its number.
        torques: the negative one of the lost motion, 0, and the positive one [N*m], shape (3,).
        """
        try:
            # the torque as an angle of one revolution: the same search for turning points
            branches = sweeps(self.torque_Nm * WHOLE_TURN_DEG / max(np.ptp(self.torque_Nm), TINY))
        except AngleError:
            raise DataError(
                f"{self.label}: the torque does not increase and decrease in complete branches",
                f"{_LOOP_HINT}; for a recording over the input angle, select its columns with --angle and --second",
            ) from None
        rising = self._twists([branch.rows for branch in branches if branch.direction == 1], "rising", torques)
        falling = self._twists([branch.rows for branch in branches if branch.direction == -1], "falling", torques)
        # at torque 0 its size is the hysteresis loss
        difference = rising.arcsec - falling.arcsec
        variance = rising.variance + falling.variance
        # twist from one outer torque to the other, on each branch
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
        """Return the twists at torques [N*m] by all branches of one way that reach over them; way: in words."""
        complete = []
        for rows in branches:
            torque = self.torque_Nm[rows]
            if torque.min() <= torques[0] and torque.max() >= torques[2]:
                complete.append(rows)
        if not complete:
            span = f"from {torques[0]:.3g} to {torques[2]:.3g} N*m"
            raise DataError(f"{self.label}: no {way} branch {span}", _LOOP_HINT)
        # all complete branches of one way together
        torque = np.concatenate([self.torque_Nm[rows] for rows in complete])
        twist = np.concatenate([self.twist_arcsec[rows] for rows in complete])
        values = [_twist_at(torque, twist, wanted, torques[2]) for wanted in torques]
        return _BranchTwists(*np.array(values).T)


@dataclass(frozen=True, eq=False)
class _BranchTwists:
    """Twists at some torques [arcsec] and their variances [arcsec^2], each of shape (torques,)."""

    arcsec: Array
    variance: Array


def loop_quantities(loops: tuple[PlaceLoop, ...]) -> tuple[StatedQuantity, ...]:
    """Return the largest hysteresis loss and the largest lost motion over places."""
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
    """Return the twist at a torque by a parabola through the readings around it [arcsec], and its variance.

    torque, twist: of the readings [N*m], [arcsec], shape (rows,).
    wanted: the torque [N*m].
    reach: distance of readings that are used [N*m]; more if there are too few.
    """
    offset = torque - wanted
    # far enough for _AROUND readings, even if they are sparse
    nearest = float(np.partition(np.abs(offset), _AROUND - 1)[_AROUND - 1])
    is_near = np.abs(offset) <= max(reach, nearest)
    # about the wanted torque, so the constant is the twist there
    columns = np.vander(offset[is_near], 3, increasing=True)
    inverse = np.linalg.pinv(columns)
    solution = inverse @ twist[is_near]
    residual = twist[is_near] - columns @ solution
    variance = residual @ residual / (len(residual) - 3)
    return float(solution[0]), float(variance * (inverse[0] @ inverse[0]))
