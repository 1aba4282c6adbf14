"""Design check of a drive (F'_ior, self error and verdict at each torque), and F'_ior over a grid of its fields."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, cached_property, partial
from math import prod
from typing import Self

import numpy as np
from pydantic import TypeAdapter

from hdassist.belief.evidence import evidence_of
from hdassist.belief.options import Step, steps_of
from hdassist.belief.predicted import MeasuredBeside, beside_prediction, beyond_words
from hdassist.belief.prior import DrivePrior, beside_measured_teeth, prior_of
from hdassist.belief.samples import EFFECTIVE_SAMPLES, ErrorBelief, Samples, drive_samples
from hdassist.belief.statistics import Probability
from hdassist.belief.steps import Influence, influences
from hdassist.drive.error.cycle import (
    KinematicError,
    SelfError,
    cross_checks_of,
    require_programme,
    self_error,
    whole_error,
)
from hdassist.drive.error.error_map import searchable
from hdassist.drive.error.extremes import DRAWN_STATES, extremes_of
from hdassist.drive.loading import OVERRIDE_PLACE, load_text
from hdassist.drive.model.deviations import MeasuredTeeth, ToothDeviations, Unknown, unknown_notes, unknowns
from hdassist.drive.model.geometry import Array, Kinematics
from hdassist.drive.preset.fields import Catalogue, Drive, PresetField, field_table, is_overridden, path_of
from hdassist.drive.preset.text import InvalidValueError, near_miss, read_count, read_number, scalar_value, shown
from hdassist.drive.solve.answers import EMPTY, Certificate, Residual
from hdassist.drive.solve.loadcase import CrossCheck, require_solver
from hdassist.features.report import attributes
from hdassist.run.errors import (
    SURE,
    DataError,
    HdassistError,
    UntrustedError,
    UsageError,
    Verdict,
    worst,
)
from hdassist.run.kept import ClosedRecord, Count, Magnitude, Number, RecordKind
from hdassist.run.run import CROSS_SOLVER, Run


@dataclass(frozen=True)
class OperatingPoint:
    """The error of a drive at one torque, and the limit with which it is compared.

    M_g: torque [N*m].
    self_error: self error of the drive.
    limit_arcsec: limit [arcsec]; None without a limit.
    open_: whether the drive has uncertain inputs.
    belief: distribution of F'_ior over these inputs; None if it was not computed.
    error: error over the full mesh cycle; None before it is computed. With samples, it is the error of the sample whose
        F'_ior is nearest to the median. Without samples, it is the error of the nominal values with unknown deviations
        of 0.
    sure: smallest probability of meeting the limit for the verdict PASS.
    """

    M_g: float
    self_error: SelfError
    limit_arcsec: float | None
    open_: bool = False
    belief: ErrorBelief | None = None
    error: KinematicError | None = None
    sure: float = SURE

    @property
    def F_ior_arcsec(self) -> float | None:
        """F'_ior [arcsec], the median over the uncertain inputs; None if these were not sampled."""
        if self.belief:
            return self.belief.p50
        return self.error.F_ior_arcsec if self.error and not self.open_ else None

    @property
    def F_ior_or_error(self) -> float:
        """F'_ior [arcsec]; without samples, F'_ior of the nominal drive with unknown deviations of 0."""
        as_given = self.error.F_ior_arcsec if self.error else np.nan
        return as_given if self.F_ior_arcsec is None else self.F_ior_arcsec

    @property
    def F_ior_upper_arcsec(self) -> float | None:
        """F'_ior plus the self error [arcsec]."""
        return None if self.F_ior_arcsec is None else self.F_ior_arcsec + self.self_error.range_arcsec

    @property
    def range_arcsec(self) -> tuple[float, float] | None:
        """5th and 95th percentiles of F'_ior [arcsec].

        Both are equal without uncertain inputs. The result is None if uncertain inputs were not sampled.
        """
        if self.belief:
            return self.belief.p5, self.belief.p95
        return None if self.F_ior_arcsec is None else (self.F_ior_arcsec, self.F_ior_arcsec)

    @property
    def held_arcsec(self) -> tuple[float, float] | None:
        """5th and 95th percentiles of F'_ior plus the self error [arcsec]."""
        self_error_arcsec = self.self_error.range_arcsec
        ends = self.range_arcsec
        return ends and (ends[0] + self_error_arcsec, ends[1] + self_error_arcsec)

    @property
    def left_arcsec(self) -> float | None:
        """Limit minus self error [arcsec], None without a limit."""
        return None if self.limit_arcsec is None else self.limit_arcsec - self.self_error.range_arcsec

    @property
    def probability(self) -> Probability | None:
        """Probability that F'_ior plus self error meets the limit; None without a limit or samples."""
        room_arcsec = self.left_arcsec
        if room_arcsec is None or self.belief is None:
            return None
        return self.belief.samples.probability_within(room_arcsec, self.belief.torque, self.sure)

    @property
    def verdict(self) -> Verdict:
        """Verdict on the probability of meeting the limit.

        Without uncertain inputs, the verdict compares F'_ior plus the self error with the limit. Without a limit, it is
        NO_LIMIT.
        """
        if self.limit_arcsec is None:
            return Verdict.NO_LIMIT
        if kept := self.probability:
            return kept.verdict(self.sure)
        if self.F_ior_upper_arcsec is None:
            return Verdict.INCONCLUSIVE
        return Verdict.PASS if self.F_ior_upper_arcsec <= self.limit_arcsec else Verdict.FAIL


@dataclass(frozen=True)
class DesignCheck:
    """Design check of a drive, with one operating point for each torque in the sequence of the preset.

    drive: the drive.
    points: operating points.
    measured: wheels with measured teeth instead of first harmonics.
    unknown: unknown deviations.
    prior: uncertain inputs.
    samples: samples of these inputs; None without samples.
    steps: options to meet the limit at the governing torque; empty if all limits are met.
    steps_proof: certificate of the states behind these options.
    predicted: measured values of F'_ior with the preset's predictions that do not use them.
    """

    drive: Drive
    points: tuple[OperatingPoint, ...]
    measured: MeasuredTeeth | None = None
    unknown: tuple[Unknown, ...] = ()
    prior: DrivePrior | None = None
    samples: Samples | None = None
    steps: tuple[Step, ...] = ()
    steps_proof: Certificate = EMPTY
    predicted: tuple[MeasuredBeside, ...] = ()

    def with_samples(self, samples: Samples) -> Self:
        """Return the check with samples of the uncertain inputs."""
        beliefs = (ErrorBelief.of(samples, samples.torques.index(point.M_g)) for point in self.points)
        points = (replace(point, belief=belief) for point, belief in zip(self.points, beliefs, strict=True))
        return replace(self, points=tuple(points), samples=samples)

    def with_errors(self, errors: Sequence[KinematicError]) -> Self:
        """Return the check with the error over the full cycle at each torque."""
        points = (replace(point, error=error) for point, error in zip(self.points, errors, strict=True))
        return replace(self, points=tuple(points))

    def with_steps(self, run: Run) -> Self:
        """Return the check with options at the governing torque, unless PASS is certain for all limits."""
        is_known = self.samples or not (self.prior and self.prior.fields)
        if self.verdict is Verdict.PASS or self.measured or not (self.points and self.prior and is_known):
            return self
        rooms_arcsec = {point.M_g: point.left_arcsec for point in self.points}
        torques = self.samples.torques if self.samples else tuple(rooms_arcsec)
        point = self.points[self.governing]
        place = torques.index(point.M_g)
        rooms = [rooms_arcsec.get(M_g) for M_g in torques]
        steps, proof = steps_of(self.prior, self.samples, torques, place, rooms, run, point.sure, point.error)
        return replace(self, steps=steps, steps_proof=proof)

    @property
    def verdict(self) -> Verdict:
        """Worst verdict of the operating points."""
        return worst(point.verdict for point in self.points)

    @property
    def certificate(self) -> Certificate:
        """Certificate of all states at all torques, including self error and samples."""
        parts = [part for point in self.points for part in (point.error, point.self_error)]
        return sum((part.certificate for part in (*parts, self.samples) if part is not None), self.steps_proof)

    @property
    def cross_checks(self) -> tuple[CrossCheck, ...]:
        """Cross-check of each torque."""
        return tuple(p.error.cross_check for p in self.points if p.error and p.error.cross_check)

    @property
    def governing(self) -> int:
        """Index of the governing torque, which has the worst verdict and the largest probability of missing its limit.

        Among equal probabilities, the largest F'_ior relative to its limit decides. Without a limit, the governing
        torque is that with the largest median of the predicted F'_ior.
        """

        def severity(k: int) -> tuple[float, float]:
            """Return the probability of missing the limit and F'_ior over the limit; 0 and F'_ior without a limit."""
            point = self.points[k]
            if point.limit_arcsec and point.F_ior_upper_arcsec:
                probability_of_missing = 1 - point.probability.value if point.probability else 0.0
                return probability_of_missing, point.F_ior_upper_arcsec / point.limit_arcsec
            return 0.0, point.F_ior_or_error

        worst_ones = [k for k, point in enumerate(self.points) if point.verdict is self.verdict]
        return max(worst_ones, key=severity, default=0)

    @cached_property
    def influences(self) -> tuple[Influence, ...]:
        """Contributions to the variance of ln F'_ior at the governing torque, the largest first."""
        if not (self.samples and self.points):
            return ()
        return influences(self.samples.of_ranges, self.samples.torques.index(self.points[self.governing].M_g))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Notes on the results."""
        rated = self.drive.operation.rated
        over = [p.M_g for p in self.points if rated is not None and abs(p.M_g) > rated]
        remarks = [f"{M_g:g} N*m is above the rated torque of {rated:g} N*m" for M_g in over]
        if self.prior and self.prior.fields and not self.samples:
            paths = [field.path for field in self.prior.fields]
            omitted = f" and {len(paths) - 4} more" if len(paths) > 4 else ""
            uncertain = f"uncertain, but not sampled: {', '.join(paths[:4])}{omitted}"
            remarks.append(f"{uncertain}; computed at the given value or at 0, so results have no range")
        measured = any(figure.path.startswith("measured.") for figure in evidence_of(self.drive))
        if measured and self.prior and not self.prior.fields:
            remarks.append("the preset has no uncertain input, so the measured values have no effect")
        remarks += beyond_words(self.predicted)
        return (*self.drive.origin.warnings, *remarks, *(self.samples.remarks if self.samples else ()))


# description of the accuracy test, by catalogue.accuracy_test
_ACCURACY_TESTS = {
    "unstated": "no load",
    "full_revolution": "no load, tested over a full revolution",
    "12_positions": "no load, tested at 12 positions",
    "typical": "no load, typical value",
}


def accuracy_words(catalogue: Catalogue, points: Sequence[OperatingPoint]) -> str:
    """Return a comparison of F'_ior at the smallest torque with the catalogue accuracy; empty if none is given."""
    accuracy = catalogue.accuracy
    if accuracy is None:
        return ""
    point = min(points, key=lambda point: abs(point.M_g))
    compared = " to ".join(dict.fromkeys(f"{100 * end / accuracy:.0f}" for end in point.range_arcsec or ()))
    sentence = f"F'_ior at {point.M_g:g} N·m is {compared} % of the accuracy" if compared else "F'_ior is unknown"
    return f"accuracy {accuracy:g}″ ({_ACCURACY_TESTS[catalogue.accuracy_test]}); {sentence}"


def check_states(
    drive: Drive,
    measured: MeasuredTeeth | None = None,
    draws: int = EFFECTIVE_SAMPLES,
) -> int:
    """Return the approximate number of states that a check solves, for the progress bar."""
    drawn = draws if not measured and searchable(drive) and prior_of(drive).fields else 0
    return len(drive.operation.M_g) * (
        Kinematics.of(drive).cycle_states + drive.numerics.n_phase**2 + drawn * DRAWN_STATES
    )


def check(
    drive: Drive,
    *,
    measured: MeasuredTeeth | None = None,
    solver: str | None = None,
    draws: int = EFFECTIVE_SAMPLES,
    samples: Samples | None = None,
    sure: float = SURE,
    run: Run = Run(),
    seen: Callable[[DesignCheck], None] | None = None,
) -> DesignCheck:
    """Check a drive at the torques of its preset.

    measured: wheels with measured teeth instead of first harmonics; they exclude samples.
    solver: name of a solver known to cvxpy that solves each state instead of the engine.
    draws: minimum effective sample size of the uncertain inputs; 0 for no samples.
    samples: samples of the same drive, if they exist already.
    sure: smallest probability of meeting a limit for the verdict PASS, and of missing it for the verdict FAIL.
    seen: function that is called with interim checks from the samples so far.
    Raises UsageError for an unknown solver. Raises UntrustedError if a result cannot be trusted, or if the preset's
    catalogue contradicts its other values.
    """
    # measured wheels replace harmonics, and the fraction of a tooth in their angle shifts the cam eccentricity
    shown_drive, teeth = measured.in_drive(drive) if measured else (drive, None)
    # an unknown solver is refused before the computation
    require_solver(run.cross_check or CROSS_SOLVER)
    assumed_drive, prior = beside_measured_teeth(drive, measured)
    require_programme(drive, run)
    # self errors and limits come first because they determine the room for F'_ior
    points = _unsolved_points(
        drive,
        is_open=bool(prior.fields),
        sure=sure,
        run=run,
    )
    checked = DesignCheck(
        drive=drive,
        points=points,
        measured=measured,
        unknown=unknowns(assumed_drive),
        prior=prior,
    )
    # rolling balls and measured wheels have no samples
    is_sampled = searchable(drive) and not measured and bool(prior.fields)
    if is_sampled and draws and not samples:
        rooms = [point.left_arcsec for point in points]
        so_far = None if seen is None else lambda samples: seen(checked.with_samples(samples))
        samples = drive_samples(
            prior,
            rooms,
            draws=draws,
            sure=sure,
            run=run,
            seen=so_far,
        )
        checked = replace(
            checked,
            predicted=beside_prediction(
                prior,
                draws=draws,
                run=run,
            ),
        )
    # samples give percentiles, probabilities and contributions
    if samples:
        checked = checked.with_samples(samples)
    return _with_solved_errors(checked, shown_drive, teeth, solver, run)


def _with_solved_errors(
    checked: DesignCheck,
    shown_drive: Drive,
    teeth: ToothDeviations | None,
    solver: str | None,
    run: Run,
) -> DesignCheck:
    """Return a check with the error of the full cycle at each torque, its cross-checks and its options.

    The error belongs to the sample with the median F'_ior, or to the nominal drive without samples.

    checked: check with its samples, if there are any.
    shown_drive: the drive, with measured wheels in place of harmonics if there are any.
    teeth: deviations of the measured wheels; None if no wheel is measured.
    solver: as in `check`.
    run: processes, progress and seed.
    """
    # torques have the sequence of the preset in all results
    torques = checked.drive.operation.M_g
    samples = checked.samples
    drives = [_middle(shown_drive, samples, number) if samples else shown_drive for number in range(len(torques))]
    errors = _whole_errors(drives, torques, teeth, solver, run)
    # another solver verifies the extremes while options are computed
    solved = [(drive, teeth, error.sampled(seed=run.seed)) for drive, error in zip(drives, errors, strict=True)]
    checks = run.beside(cross_checks_of, solved, run.of_task)
    checked = checked.with_errors(errors).with_steps(run)
    # wait for the other solver
    pairs = zip(errors, checks.result(), strict=True)
    return checked.with_errors([replace(error, cross_check=cross_check) for error, cross_check in pairs])


def _whole_errors(
    drives: Sequence[Drive],
    torques: Sequence[float],
    teeth: ToothDeviations | None,
    solver: str | None,
    run: Run,
) -> list[KinematicError]:
    """Return the error of the full cycle at each torque.

    drives: one drive for each torque.
    torques: torques [N*m].
    teeth: measured teeth of the wheels; None if no wheel is measured.
    solver, run: as in `check`.
    """
    errors = []
    for error in run.map(
        partial(
            whole_error,
            teeth=teeth,
            solver=solver,
            run=run.of_task,
        ),
        drives,
        torques,
    ):
        errors.append(error)
        run.finished(len(error.states))
    return errors


def _unsolved_points(
    drive: Drive,
    *,
    is_open: bool,
    sure: float,
    run: Run,
) -> tuple[OperatingPoint, ...]:
    """Return the operating points of a drive with self errors and limits, without solved errors.

    drive: the drive.
    is_open: whether it has uncertain inputs.
    sure: smallest probability of meeting a limit for the verdict PASS.
    run: processes and progress.
    """
    torques = drive.operation.M_g
    points = []
    for M_g, error in zip(
        torques,
        self_error(
            drive,
            torques,
            run=run,
        ),
        strict=True,
    ):
        points.append(
            OperatingPoint(
                M_g,
                error,
                drive.limit(M_g),
                open_=is_open,
                sure=sure,
            )
        )
    return tuple(points)


def _middle(
    drive: Drive,
    samples: Samples,
    torque: int,
) -> Drive:
    """Return the drive of the sample with the median F'_ior at a torque; torque is an index."""
    return drive.with_values(samples.values(np.array([samples.middle_sample(torque)]))[0])


# --- a grid of values, with a row for each combination of values and torque

_VARY = "--vary"
_TORQUE = "operation.M_g"
MOST_VALUES = 10_000  # largest number of values of a field
_FORM = f"write {_VARY} tolerances.e_hb=20:120:11, from 20 to 120 in 11 steps, or {_VARY} tolerances.e_hb=20,50,80"
_MOST_ROWS = 1_000_000  # largest number of rows of a grid


@dataclass(frozen=True)
class Axis:
    """A varied field: path, unit, and its values in that unit."""

    path: str
    unit: str
    values: tuple[float, ...]


def read_axes(texts: Sequence[str], overrides: Sequence[str]) -> tuple[Axis, ...]:
    """Return the varied fields from texts such as "tolerances.e_hb=20:120:11" or "gears.j_n=0,5 um,10".

    texts: the texts.
    overrides: overrides of the preset, which must not set the same fields.
    Raises UsageError for the first invalid text.
    """
    if not texts:
        raise UsageError("no field is varied", _FORM)
    axes: list[Axis] = []
    for text in texts:
        try:
            axis = _axis(text)
            if axis.path in [before.path for before in axes]:
                raise UsageError(
                    f"{_VARY} {axis.path} is given more than once", "give one range, or one list with all values"
                )
            if is_overridden(axis.path, overrides):
                hint = f"leave out either {_VARY} or the other option for this field"
                raise InvalidValueError("a field that neither --set nor --torque sets", hint)
        except InvalidValueError as fault:
            message = f"invalid {_VARY} {shown(text) or 'nothing'}: expected {fault.message}"
            raise UsageError(message, fault.hint) from None
        axes.append(axis)
    return tuple(axes)


@cache
def _fields() -> dict[str, PresetField]:
    """Return the fields that can be varied, by path."""
    table = field_table().items()
    return {path: field for path, field in table if path == _TORQUE or field.kind in ("number", "count")}


def _axis(text: str) -> Axis:
    """Return the field that a text varies, with its values.

    Raises InvalidValueError with the expected form if the form is wrong.
    """
    key, equals, values = text.partition("=")
    if not equals:
        raise InvalidValueError("KEY=START:STOP:STEPS or KEY=A,B,C", _FORM)
    path, field = _varied_field(key)
    is_grid = ":" in values
    parts = [part.strip() for part in values.split(":" if is_grid else ",")]
    if is_grid and len(parts) != 3:
        raise InvalidValueError("KEY=START:STOP:STEPS", _FORM)
    numbers = [_axis_number(part, field) for part in (parts[:2] if is_grid else parts)]
    if len(set(numbers)) < len(numbers):
        raise InvalidValueError("different values", "leave out the repeated value")
    if is_grid:
        start, stop = (Fraction(repr(number)) for number in numbers)
        numbers = _grid(start, stop, parts[2], field.kind == "count")
    return Axis(path, field.unit, tuple(numbers))


def _varied_field(key: str) -> tuple[str, PresetField]:
    """Return the path and the field of a key. Raises InvalidValueError for a field without a single number."""
    path = ".".join(map(str, path_of(key)))
    field = _fields().get(path)
    if field is not None:
        return path, field
    same_key = next((known_path for known_path in _fields() if known_path.split(".")[1] == path.split(".")[-1]), "")
    hint = f"the nearest name is {same_key}" if same_key else near_miss(path, _fields())
    raise InvalidValueError("a field with a single number", hint or "write section.key, for example gears.j_n")


def _axis_number(part: str, field: PresetField) -> float:
    """Return the number of a field from a text. Raises InvalidValueError for an invalid text."""
    value = scalar_value(part)
    try:
        return read_count(value) if field.kind == "count" else float(read_number(value, field.unit))
    except InvalidValueError as fault:
        expected = f"numbers ({shown(part)} {fault.message})" if part else "numbers, but a value is missing"
        raise InvalidValueError(expected, fault.hint) from None


def _grid(
    start: Fraction,
    stop: Fraction,
    steps: str,
    is_count: bool,
) -> list[float]:
    """Return even values from start to stop, rounded only once. Raises InvalidValueError for invalid steps."""
    count = int(steps) if re.fullmatch("[0-9]{1,9}", steps) else 0
    if not 2 <= count <= MOST_VALUES:
        raise InvalidValueError(f"a number of steps from 2 to {MOST_VALUES}", _FORM)
    places = [start + (stop - start) * k / (count - 1) for k in range(count)]
    if is_count and any(place.denominator > 1 for place in places):
        hint = "use another number of steps, or list the values: KEY=A,B,C"
        raise InvalidValueError("a number of steps that gives whole numbers only", hint)
    return [int(place) if is_count else float(place) for place in places]


@dataclass(frozen=True, kw_only=True)
class SweepRow(ClosedRecord):
    """F'_ior of a row of a sweep.

    values: values of the varied fields.
    M_g_Nm: torque M_g [N*m].
    F_ior_arcsec: F'_ior [arcsec]; None without a result.
    states, max_residual: number of solved states and largest residual of the certificate.
    reason: reason why the row has no result.
    exit_code: exit code of that error; 0 with a result.
    Raises ValueError for any other exit code.
    """

    values: Mapping[str, Number]
    M_g_Nm: Number
    F_ior_arcsec: Magnitude | None = None
    states: Count | None = None
    max_residual: Residual | None = None
    reason: str | None = None
    exit_code: Count = 0

    def __post_init__(self) -> None:
        has_answer = self.F_ior_arcsec is not None
        codes = (0,) if has_answer else (HdassistError.exit_code, DataError.exit_code, UntrustedError.exit_code)
        if self.exit_code not in codes or has_answer != (self.reason is None):
            raise ValueError("expected either F'_ior, or a reason with the exit code of its error")


@dataclass(frozen=True)
class Sweep:
    """The rows of a grid of field values. A call with (first, last) returns the records of these rows for `stream`.

    text: text of the preset.
    file: name of the preset's file.
    overrides: overrides of the preset.
    varied: varied fields.
    further: axis of the preset's torques M_g [N*m], along which the drive does not change; empty if the torques are
        varied. The last axis changes fastest.
    """

    text: bytes
    file: str
    overrides: tuple[str, ...]
    varied: tuple[Axis, ...]
    further: tuple[Axis, ...]

    @classmethod
    def of(
        cls,
        text: bytes,
        file: str,
        drive: Drive,
        varied: Sequence[Axis],
    ) -> Sweep:
        """Return the sweep of a preset, whose drive includes the overrides. Raises UsageError for too many rows."""
        is_varied = _TORQUE in [axis.path for axis in varied]
        further_axes = () if is_varied else (Axis(_TORQUE, "N*m", drive.operation.M_g),)
        sweep = cls(text, file, drive.origin.overrides, tuple(varied), further_axes)
        if sweep.rows > _MOST_ROWS:
            hint = "reduce the number of steps or of fields"
            raise UsageError(f"{_VARY} requires {sweep.rows} rows; the maximum is {_MOST_ROWS}", hint)
        return sweep

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Varied fields, followed by the torques unless these are varied."""
        return self.varied + self.further

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the results: the number of values of each axis."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return prod(self.shape)

    def values(self, row: int) -> dict[str, float]:
        """Return the values along each axis in a row, by path."""
        places = np.unravel_index(row, self.shape)
        return {axis.path: axis.values[k] for axis, k in zip(self.axes, places, strict=True)}

    @property
    def kind(self) -> RecordKind[SweepRow]:
        """Kind of the records in a file; the record of each row must have the values of this row."""

        def fault(item: int, record: SweepRow) -> str:
            if item >= self.rows:
                return f"expected {self.rows} rows"
            is_own = {_TORQUE: record.M_g_Nm, **record.values} == self.values(item)
            return "" if is_own else f"expected the values of row {item + 1}"

        return RecordKind(TypeAdapter(SweepRow), fault)

    def __call__(self, first: int, last: int) -> list[SweepRow]:
        """Return the records of rows first to last - 1; each depends only on the number of its row."""
        return [self._record(self.values(row)) for row in range(first, last)]

    def _record(self, values: dict[str, float]) -> SweepRow:
        changes = {axis.path: values[axis.path] for axis in self.varied}
        M_g = values[_TORQUE]
        sets = [f"{path}={[value] if path == _TORQUE else value!r}" for path, value in changes.items()]
        try:  # the drive of a row is validated like any other drive
            (extremes,) = extremes_of(load_text(self.text, self.file, [*self.overrides, *sets]), [M_g])
        except HdassistError as error:
            reason = OVERRIDE_PLACE.sub("", error.message).replace("\n", "; ")
            code = DataError.exit_code if isinstance(error, UsageError) else error.exit_code
            return SweepRow(
                values=changes,
                M_g_Nm=M_g,
                reason=reason,
                exit_code=code,
            )
        proof = attributes(extremes.certificate, "states", "max_residual")
        return SweepRow(
            values=changes,
            M_g_Nm=M_g,
            F_ior_arcsec=extremes.first,
            **proof,
        )


@dataclass(frozen=True, eq=False)
class Swept:
    """Results of a sweep.

    F_ior_arcsec: F'_ior [arcsec] in the sweep's shape, NaN for a row without a result.
    states, max_residual: number of solved states and largest residual of all rows.
    failed: number of rows without a result.
    reason: reason of the first row without a result; empty if all rows have a result.
    exit_codes: exit codes of all rows without a result.
    """

    sweep: Sweep
    drive: Drive
    F_ior_arcsec: Array
    states: int
    max_residual: float
    failed: int
    reason: str
    exit_codes: frozenset[int]

    @property
    def ends(self) -> dict[str, tuple[int, float]]:
        """Rows with the smallest and the largest F'_ior, and these values [arcsec]; empty if no row has a result."""
        if self.failed == self.sweep.rows:
            return {}
        rows = {"least": np.nanargmin(self.F_ior_arcsec), "greatest": np.nanargmax(self.F_ior_arcsec)}
        return {end: (int(row), float(self.F_ior_arcsec.flat[row])) for end, row in rows.items()}

    @property
    def largest(self) -> Drive:
        """The drive with each varied field at its largest value; its unknown inputs are those of all rows together."""
        varied = {axis.path: max(axis.values) for axis in self.sweep.varied if axis.path != _TORQUE}
        return self.drive.with_values(varied)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Notes on the results."""
        return *self.drive.origin.warnings, *unknown_notes(self.largest)


def collect(
    sweep: Sweep,
    drive: Drive,
    records: Iterable[SweepRow],
) -> Swept:
    """Return the results from the records of all rows in sequence; each record is read once."""
    F_ior = np.full(sweep.rows, np.nan)
    states = 0
    residual = 0.0
    failed = 0
    reason = ""
    codes = set[int]()
    for row, record in enumerate(records):
        if record.F_ior_arcsec is None:
            failed = failed + 1
            reason = reason or record.reason or ""
            codes.add(record.exit_code)
            continue
        F_ior[row] = record.F_ior_arcsec
        states = states + (record.states or 0)
        residual = max(residual, record.max_residual or 0.0)
    shaped = F_ior.reshape(sweep.shape)
    return Swept(
        sweep=sweep,
        drive=drive,
        F_ior_arcsec=shaped,
        states=states,
        max_residual=residual,
        failed=failed,
        reason=reason,
        exit_codes=frozenset(codes),
    )
