"""Values of a preset fitted to targets: least squares from the best, distant points of a Sobol set.

There are few targets and many unknowns, and therefore seldom a single solution. Every set of values that meets the
targets and is far from the other sets is retained. The interval of each value shows whether the targets determine it. A
text of targets is YAML with the unknown fields and the measured values of the drive:

schema: hdassist.targets/1
name: acceptance rig, drive 17
unknowns:
  gears.j_n: {low: 0, high: 20}
  supports.C_2:                     # between the ends of its range in the preset's source
targets:
  - {quantity: F_ior, M_g: 80, phase: 180, value: 20.1, tolerance: 0.5}
  - {quantity: K_1, value: 50e4, tolerance: 10 %}
  - {quantity: self_error, M_g: 80, low: 0.25, high: 2.0}
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from math import inf, isfinite
from typing import Any, Literal

import numpy as np
from scipy.optimize import OptimizeResult, least_squares, minimize_scalar

from hdassist.belief.prior import LOGARITHMIC, FieldPrior, owner_of
from hdassist.belief.statistics import sobol_points
from hdassist.drive.error.cycle import self_error
from hdassist.drive.error.error_map import Batch, ErrorMap
from hdassist.drive.error.extremes import many_extremes
from hdassist.drive.error.stiffness import Twist, stiffness
from hdassist.drive.model.geometry import Array
from hdassist.drive.model.rules import first_conflict
from hdassist.drive.preset.fields import Drive, field_table, measures, plain, short
from hdassist.drive.preset.text import (
    Document,
    InvalidValueError,
    Path,
    near_miss,
    ordered_findings,
    read_number,
    read_yaml,
)
from hdassist.features.mounting.positions import phase_deg
from hdassist.run.errors import DataError, Fault, HdassistError, PresetError, UntrustedError
from hdassist.run.run import UNCHECKED, Run

_TARGETS_SCHEMA = "hdassist.targets/1"
_RANGE_TOLERANCE = "10 %"  # tolerance of a range, as a share of its larger end
# margin in tolerances by which a fit should be inside a range, because its last step may end slightly outside
_INSIDE = 0.5
_TEXT = "text"  # marks a text in place of a unit
_KEY_UNITS = {"M_g": "N*m", "phase": "deg", "T_1": "N*m", "T_2": "N*m"}
# unit of each quantity, its required keys and its optional keys
_TARGET_KINDS: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "F_ior": ("arcsec", ("M_g",), ("phase",)),
    "F_ior_max": ("arcsec", ("M_g",), ()),  # largest value over the mounting phase
    "F_ior_min": ("arcsec", ("M_g",), ()),
    "self_error": ("arcsec", ("M_g",), ()),
    **{f"K_{k}": ("N*m/rad", (), ("T_1", "T_2")) for k in (1, 2, 3)},  # stiffness on the weaker side
    "lost_motion": ("arcsec", (), ("M_g",)),  # at 4 % of the rated torque by default
}
_PARTS: dict[str, tuple[type, str]] = {
    "unknowns": (dict, "gears.j_n: {low: 0, high: 20}"),
    "targets": (list, "- {quantity: F_ior_max, M_g: 80, value: 31, tolerance: 7 %}"),
}
_PHASE_STEP = 20.0  # step between the phases from which the extremes are located [deg]
_PHASE_TOLERANCE = 0.1  # tolerance of the phase of an extreme [deg]
_DISTANT = 0.25  # smallest distance between different sets, as a share of an unknown's range
# step of difference quotients, as a share of the range; it exceeds the roughness of located extremes
_DIFFERENCE_STEP = 0.02
_VALUE_DIGITS = 4  # significant digits of a found value
_INDISTINCT = 0.95  # smallest correlation of two unknowns that cannot be separated
_RANGE_SHARES = np.linspace(0, 1, 1001)  # shares of a field's range at which a value is looked up
_IMPOSSIBLE = 1e6  # residual of a drive that cannot be computed, in tolerances


@dataclass(frozen=True)
class CalibrationTarget:
    """A quantity with its required range.

    quantity: name of the quantity.
    asked: values of the keys of its kind.
    value: required value; None if any value in the range is equally good.
    low, high: ends of the range, in the unit of the quantity.
    tolerance: deviation that counts as 1, in the unit of the quantity.
    """

    quantity: str
    asked: Mapping[str, float]
    value: float | None
    low: float
    high: float
    tolerance: float

    @property
    def unit(self) -> str:
        """Unit of the quantity."""
        return _TARGET_KINDS[self.quantity][0]

    def deviation(self, predicted: float, inside: float = 0.0) -> float:
        """Return the deviation of a predicted quantity in tolerances; 0 inside a range.

        inside: margin in tolerances by which the range is narrowed at both ends.
        """
        # a range narrower than both margins is reduced to its middle
        margin = min(inside * self.tolerance, (self.high - self.low) / 2)
        nearest = min(max(predicted, self.low + margin), self.high - margin)
        return (predicted - (nearest if self.value is None else self.value)) / self.tolerance

    @property
    def wanted(self) -> str:
        """Description of the required value with its tolerance, or of the range."""
        if self.value is not None:
            return f"{plain(self.value)} ± {short(self.tolerance)}"
        return f"{plain(self.low)} to {plain(self.high)}".replace("-inf to", "at most").replace(" to inf", " or more")

    @property
    def words(self) -> str:
        """Short description of the target: quantity and arguments."""
        return ", ".join([self.quantity, *(f"{key} {value:g} {_KEY_UNITS[key]}" for key, value in self.asked.items())])


@dataclass(frozen=True)
class Targets:
    """Unknown fields and the targets that they should meet.

    name: name in the text of targets.
    sha256: hash of this text.
    unknowns: fields to find, with their bounds.
    targets: targets to meet.
    """

    name: str
    sha256: str
    unknowns: tuple[FieldPrior, ...]
    targets: tuple[CalibrationTarget, ...]

    def by_path(self, values: Iterable[float]) -> dict[str, float]:
        """Return the values of the unknowns by path; values: one per unknown, in the same sequence."""
        return {unknown.path: value for unknown, value in zip(self.unknowns, values, strict=True)}

    def deviations(self, predictions: Sequence[float], inside: float = 0.0) -> list[float]:
        """Return the deviation of each prediction from its target, as in `CalibrationTarget.deviation`."""
        return [
            target.deviation(prediction, inside) for target, prediction in zip(self.targets, predictions, strict=True)
        ]

    def met(self, predictions: Sequence[float]) -> list[bool]:
        """Return whether each target is met by its prediction."""
        return [
            target.low <= prediction <= target.high
            for target, prediction in zip(self.targets, predictions, strict=True)
        ]


def read_targets(
    text: bytes,
    file: str,
    drive: Drive,
) -> Targets:
    """Read and validate a text of targets for a drive.

    text: the text.
    file: name of the file in messages.
    drive: the drive; the ranges in its source are bounds of unknowns without stated bounds.
    Raises PresetError with all findings.
    """
    document = read_yaml(text, file)
    # faults of YAML are reported first because values below them cannot be trusted
    if document.findings:
        raise PresetError(ordered_findings(document.findings))
    data = {"name": ""} | _numbers(
        document, (), document.data, {"schema": None, "name": _TEXT, **dict.fromkeys(_PARTS)}
    )
    if data.get("schema") != _TARGETS_SCHEMA:
        document.add(("schema",), f"must be {_TARGETS_SCHEMA}")
    for key, (kind, example) in _PARTS.items():
        if not (isinstance(data.get(key), kind) and data[key]):
            document.add((key,), "needs at least one entry", f"for example {example}")
            # an empty part allows further faults to be found in the same run
            data[key] = kind()
    unknowns = [unknown for key, value in data["unknowns"].items() for unknown in _unknown(document, key, value, drive)]
    targets = [target for number, item in enumerate(data["targets"]) for target in _target(document, number, item)]
    if document.findings:
        raise PresetError(ordered_findings(document.findings))
    return Targets(
        name=data["name"], sha256=hashlib.sha256(text).hexdigest(), unknowns=tuple(unknowns), targets=tuple(targets)
    )


def _numbers(
    document: Document,
    path: Path,
    table: Any,
    units: Mapping[str, str | None],
    needs: Iterable[str] = (),
) -> dict[str, Any]:
    """Return the readable values of a table by key, and add faults to the findings.

    units: unit by key; _TEXT for a text, None for a value that is returned as it is.
    needs: required keys.
    """
    if not isinstance(table, dict):
        document.add(path, "must be a table of keys", f"known keys: {', '.join(units)}")
        return {}
    for key in needs:
        if key not in table:
            document.add((*path, key), "missing key", got="")
    values: dict[str, Any] = {}
    for key, value in table.items():
        key_path = (*path, key)
        unit = units.get(key)
        # the caller reads this value
        if unit in (_TEXT, None):
            values[key] = value
        elif key_path not in document.bad:
            try:
                values[key] = read_number(value, unit)
            except InvalidValueError as fault:
                document.refuse(key_path, fault)
        if key not in units:
            document.add(
                key_path,
                "unknown key",
                near_miss(key, units) or f"known: {', '.join(units)}",
                "",
                key=True,
            )
        elif unit == _TEXT and not isinstance(value, str):
            document.add(key_path, "must be text")
    return values


def _unknown(
    document: Document,
    key: str,
    value: Any,
    drive: Drive,
) -> Iterator[FieldPrior]:
    path = ("unknowns", key)
    source = drive.source.get(key)
    if key not in measures():
        document.add(
            path,
            "is not a numeric field of a preset",
            near_miss(key, measures()) or "for example gears.j_n",
            "",
            key=True,
        )
        return
    # bounds stated in the preset need not be repeated
    plausible = (
        dict(
            zip(
                ("low", "high"),
                source.range,
                strict=True,
            )
        )
        if source and source.range
        else {}
    )
    units = dict.fromkeys(("low", "high"), measures()[key].unit)
    bounds = plausible | _numbers(
        document, path, {} if value is None else value, units, [end for end in units if end not in plausible]
    )
    if bounds.keys() != units.keys():
        return
    low = bounds["low"]
    high = bounds["high"]
    if not low < high or not (drive.allows(key, low) and drive.allows(key, high)):
        document.add(
            path,
            f"low must be below high, and both must be within {measures()[key].range_words()}",
            got=f"{low:g}, {high:g}",
        )
    # as for priors, a wide positive range is logarithmic
    scale: Literal["logarithmic", "even"] = "logarithmic" if low > 0 and high / low > LOGARITHMIC else "even"
    yield FieldPrior(
        path=key,
        distribution=scale,
        low=low,
        high=high,
        owner=owner_of(drive, key),
        group=key,
        reason="bounds of the calibration",
    )


def _quantity_of(
    document: Document,
    path: Path,
    item: Any,
) -> str | None:
    """Return the quantity of a target; None if its name is invalid, with the fault added to the findings."""
    quantity = item.get("quantity") if isinstance(item, dict) else None
    if isinstance(quantity, str) and quantity in _TARGET_KINDS:
        return quantity
    hint = near_miss(str(quantity), _TARGET_KINDS) or f"known: {', '.join(_TARGET_KINDS)}"
    document.add((*path, "quantity"), "is not a known quantity", hint)
    return None


def _target(
    document: Document,
    number: int,
    item: Any,
) -> Iterator[CalibrationTarget]:
    """Yield a target, or nothing if it is invalid, with its faults added to the findings of the document."""
    path: Path = ("targets", number)
    quantity = _quantity_of(document, path, item)
    if quantity is None:
        return
    numbers = _target_numbers(document, path, item, quantity)
    if numbers is None:
        return
    value = numbers.get("value")
    low = numbers.get("low", -inf)
    high = numbers.get("high", inf)
    has_range = "low" in numbers or "high" in numbers
    if (value is None) != has_range or not low < high:
        document.add(path, "needs either value and tolerance, or low, high or both, with low below high", got="")
        return
    # a tolerance in percent refers to the larger end
    ends = (low, high) if value is None else (value, value)
    unit, _, _ = _TARGET_KINDS[quantity]
    tolerance = _tolerance(numbers.get("tolerance", _RANGE_TOLERANCE if value is None else None), unit, ends)
    # one comparison rejects both NaN and 0
    if not 0 < tolerance < inf:
        document.add((*path, "tolerance"), "must be a number or a percentage above 0, for example 5 %")
        return
    if value is not None:
        low = value - tolerance
        high = value + tolerance
    yield CalibrationTarget(
        quantity=quantity,
        asked={key: numbers[key] for key in _KEY_UNITS if key in numbers},
        value=value,
        low=low,
        high=high,
        tolerance=tolerance,
    )


def _target_numbers(
    document: Document,
    path: Path,
    item: Any,
    quantity: str,
) -> dict[str, Any] | None:
    """Return the numbers of a target by key; None if they are invalid, with the faults added to the findings."""
    unit, needs, takes = _TARGET_KINDS[quantity]
    units = {"quantity": _TEXT, **{key: _KEY_UNITS[key] for key in (*needs, *takes)}, "tolerance": None}
    faults = len(document.findings)
    numbers = _numbers(document, path, item, units | dict.fromkeys(("value", "low", "high"), unit), needs)
    for key in ("M_g", "T_1", "T_2"):
        # without torque, backlash leaves the rotation undetermined
        if numbers.get(key) == 0:
            document.add(
                (*path, key), "must not be 0, because backlash leaves the rotation undetermined without torque"
            )
    return numbers if len(document.findings) == faults else None


def _tolerance(
    stated: Any,
    unit: str,
    ends: tuple[float, float],
) -> float:
    """Return a tolerance in the unit of its target; 0 if it cannot be read.

    stated: a number, or a share in percent of the larger end.
    unit: unit of the target.
    ends: ends of the target's range, one of which may be infinite.
    """
    is_share = isinstance(stated, str) and stated.strip().endswith("%")
    try:
        if not is_share:
            return read_number(stated, unit)
        largest = max(abs(end) for end in ends if isfinite(end))
        return read_number(stated, "%") * (largest / 100)
    except InvalidValueError:
        return 0.0


@dataclass(frozen=True)
class PhaseScan:
    """Extremes of F'_ior over the mounting phase.

    least, greatest: smallest and largest F'_ior [arcsec].
    best_deg, worst_deg: phases of both [deg].
    """

    least: float
    best_deg: float
    greatest: float
    worst_deg: float


def predictions(drive: Drive, targets: Sequence[CalibrationTarget]) -> tuple[float, ...]:
    """Return the quantity of each target in its unit. Raises UntrustedError if one of them cannot be trusted."""
    # the cache computes each scan once, because several targets may have the same torque
    scan = cache(partial(phase_scan, drive))
    torques = sorted({target.asked["M_g"] for target in targets if target.quantity == "self_error"})
    self_errors = dict(
        zip(
            torques,
            self_error(drive, torques) if torques else (),
            strict=True,
        )
    )
    chords = cache(
        partial(
            stiffness,
            drive,
            points=0,
            run=UNCHECKED,
        )
    )

    def predicted(target: CalibrationTarget) -> float:
        arguments = target.asked
        quantity = target.quantity
        M_g = arguments.get("M_g", 0.0)
        if quantity == "F_ior":
            return float(F_ior_at_phases(ErrorMap(drive, M_g), [arguments.get("phase", phase_deg(drive))])[0])
        if quantity.startswith("F_ior"):
            return scan(M_g).greatest if quantity == "F_ior_max" else scan(M_g).least
        if quantity == "self_error":
            return self_errors[M_g].range_arcsec
        # a stated torque replaces 4 % of the rated torque
        if M_g:  # lost motion
            return Twist(drive).between(-M_g, M_g)
        curve = chords(T_1=arguments.get("T_1"), T_2=arguments.get("T_2"))
        return curve.lost_motion_arcsec if quantity == "lost_motion" else curve.weaker(int(quantity[-1]))

    return tuple(map(predicted, targets))


def F_ior_at_phases(error_map: ErrorMap, phases: Iterable[float]) -> Array:
    """Return F'_ior of the drive of an error map at mounting phases [deg], in arcsec, shape (phases,)."""
    # a rotation of the wheel is the difference between a phase and the drive's own phase
    own_phase_deg = phase_deg(error_map.drive)
    return many_extremes(
        error_map, Batch.turned(error_map.drive, [phase - own_phase_deg for phase in phases])
    ).F_ior_arcsec


def phase_scan(drive: Drive, M_g: float) -> PhaseScan:
    """Return the extremes of F'_ior over the mounting phase at a torque M_g [N*m]."""
    error_map = ErrorMap(drive, M_g)
    phases = np.arange(0, 360, _PHASE_STEP)
    F_ior = F_ior_at_phases(error_map, phases)

    def least(sign: int) -> tuple[float, float]:
        """Return the minimum of sign * F'_ior [arcsec] and its phase [deg]."""
        # F'_ior has few extremes over the phase, so the best coarse phase is near the true one
        middle = phases[(sign * F_ior).argmin()]
        extreme = minimize_scalar(
            lambda phase: sign * F_ior_at_phases(error_map, [phase])[0],
            bounds=(middle - _PHASE_STEP, middle + _PHASE_STEP),
            method="bounded",
            options={"xatol": _PHASE_TOLERANCE},
        )
        return float(extreme.fun), float(extreme.x) % 360

    low, best = least(+1)
    high, worst = least(-1)
    return PhaseScan(
        least=low,
        best_deg=best,
        greatest=-high,
        worst_deg=worst,
    )


@dataclass(frozen=True)
class Fit:
    """One set of found values.

    values: values in the sequence of the unknowns.
    predictions: quantity of each target in its unit; NaN for a drive without a result.
    fault: reason why the drive has no result; empty if it has one.
    """

    values: tuple[float, ...]
    predictions: tuple[float, ...]
    fault: str = ""


@dataclass(frozen=True)
class _FoundValue:
    """A value of the best set.

    path, unit: path of the field and its unit, which all values have.
    start: value in the preset.
    found: fitted value.
    half_width: half-width of its interval, at the same confidence as the tolerances of the targets.
    low, high: bounds of the unknown.
    determined: share of the bounds' width by which the targets narrow the interval, 0..1.
    held_at: bound that limits the value; None if no bound limits it.
    """

    path: str
    unit: str
    start: float | None
    found: float
    half_width: float
    low: float
    high: float
    determined: float
    held_at: float | None


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration.

    fits: the best set of values, then other sets far from it that also meet every target.
    values: values of the best set.
    shortfall: description of missed targets and limiting bounds; empty if all targets are met.
    indistinct: pairs of unknowns that the targets cannot separate, with their correlation.
    evaluations: number of computed drives.
    seed: seed of the Sobol set.
    """

    drive: Drive
    targets: Targets
    fits: tuple[Fit, ...]
    values: tuple[_FoundValue, ...]
    shortfall: str
    indistinct: tuple[tuple[str, str, float], ...]
    evaluations: int
    seed: int


def estimate_drives(
    targets: Targets,
    points: int,
    starts: int = 4,
    iterations: int = 12,
) -> int:
    """Return the approximate number of drives that a calibration computes, for the progress bar."""
    return points + starts * iterations // 2 * (len(targets.unknowns) + 2)


def calibrate(
    drive: Drive,
    targets: Targets,
    *,
    points: int = 64,
    starts: int = 4,
    iterations: int = 12,
    run: Run = Run(),
) -> Calibration:
    """Find the unknowns of a drive from its targets, equations (11) and (12).

    drive: the drive with the start values of the unknowns.
    targets: unknowns with their bounds, and targets.
    points: number of points of the Sobol set.
    starts: number of its best points, far from each other, from which least squares starts.
    iterations: maximum number of iterations of a least-squares run.
    run: processes and seed.
    Raises UntrustedError if no drive could be computed or least squares did not converge.
    """
    unknowns = targets.unknowns
    search = _Search(drive, targets, run)
    first, *other_runs = _least_squares_runs(
        drive,
        search,
        points=points,
        starts=starts,
        iterations=iterations,
    )
    fits = _distinct_fits(search, first, other_runs)
    # equation (12); the term 4 I gives an unknown that no target determines a half-width of half its range
    covariance = np.linalg.inv(first.jac.T @ first.jac + 4 * np.eye(len(unknowns)))
    deviation = np.sqrt(np.diag(covariance))
    values = _fitted_values(drive, unknowns, fits[0], first, deviation)
    shortfall = _shortfall(targets, fits[0], values)
    # a status of 0 or less means that least squares stopped at the maximum number of evaluations
    if first.status <= 0 and np.abs(first.fun).max() > 1:
        reason = shortfall or "the best set of values nevertheless meets the targets"
        raise UntrustedError(f"the fit did not converge: {reason}", "increase --evaluations", Fault.FIT_UNSETTLED)
    return Calibration(
        drive=drive,
        targets=targets,
        fits=tuple(fits),
        values=tuple(values),
        shortfall=shortfall,
        indistinct=_indistinct_pairs(unknowns, covariance / np.outer(deviation, deviation)),
        evaluations=len(search.known),
        seed=run.seed,
    )


def _distinct_fits(
    search: _Search,
    first: OptimizeResult,
    others: Sequence[OptimizeResult],
) -> list[Fit]:
    """Return the best fit, and other fits that meet the targets far from the best one and from each other."""
    targets = search.targets
    valid_runs = [run for run in others if all(targets.met(search.fits([run.x])[0].predictions))]
    points = [first.x, *(run.x for run in valid_runs)]
    return search.fits(points[number] for number in _distant(points))


def _least_squares_runs(
    drive: Drive,
    search: _Search,
    *,
    points: int,
    starts: int,
    iterations: int,
) -> list[OptimizeResult]:
    """Return the results of least squares from the best points of a Sobol set, lowest cost first.

    Raises UntrustedError if no drive could be computed.
    """
    unknowns = search.targets.unknowns
    sobol = sobol_points(points, len(unknowns), search.run.seed)
    # the preset's own values are one of the starts
    sobol[0] = _places_of(unknowns, {unknown.path: drive.number(unknown.path) for unknown in unknowns})
    costs = (search.residuals(sobol) ** 2).sum(axis=1)
    # points without a result are not used as starts
    order = [k for k in np.argsort(costs, kind="stable") if costs[k] < _IMPOSSIBLE**2]
    if not order:
        message = (
            f"no drive within the bounds could be computed; at the preset's values: {search.fits(sobol[:1])[0].fault}"
        )
        raise UntrustedError(message, "check the bounds and the preset", Fault.FIT_UNSETTLED)
    # the starts are far apart because other sets of values may also meet the targets
    runs = [search.settled(sobol[order[k]], iterations) for k in _distant(sobol[order])[:starts]]
    return sorted(runs, key=lambda fit: fit.cost)


def _fitted_values(
    drive: Drive,
    unknowns: Sequence[FieldPrior],
    fit: Fit,
    first: OptimizeResult,
    deviation: Array,
) -> list[_FoundValue]:
    """Return the fitted value of each unknown with its half-width.

    drive: the drive with the start values.
    unknowns: unknowns with their bounds.
    fit: values of the best fit.
    first: least-squares result of the best fit.
    deviation: standard deviation of each unknown in the unit cube, shape (unknowns,).
    """
    values = []
    for unknown, fitted, x, dx, active_bound in zip(
        unknowns, fit.values, first.x, deviation, first.active_mask, strict=True
    ):
        held_at = None
        # a value is at its bound if least squares ended there
        if active_bound:
            held_at = unknown.low if active_bound < 0 else unknown.high
        values.append(
            _FoundValue(
                path=unknown.path,
                unit=field_table()[unknown.path].unit,
                start=drive.value(unknown.path),
                found=fitted,
                half_width=float(unknown.value(x + dx) - unknown.value(x - dx)) / 2,
                low=unknown.low,
                high=unknown.high,
                determined=1 - 2 * float(dx),
                held_at=held_at,
            )
        )
    return values


def _indistinct_pairs(unknowns: Sequence[FieldPrior], correlation: Array) -> tuple[tuple[str, str, float], ...]:
    """Return the pairs of unknowns that the targets cannot separate, with their correlation."""
    pairs = np.argwhere(np.triu(np.abs(correlation), 1) > _INDISTINCT).tolist()
    return tuple((unknowns[i].path, unknowns[k].path, float(correlation[i, k])) for i, k in pairs)


class _Search:
    """Fits of a drive to targets at points of the unit cube, shape (unknowns,); each drive is computed only once."""

    def __init__(
        self,
        drive: Drive,
        targets: Targets,
        run: Run,
    ) -> None:
        self.drive = drive
        self.targets = targets
        self.run = run
        self.known: dict[tuple[float, ...], Fit] = {}

    def fits(self, points: Iterable[Array]) -> list[Fit]:
        """Return the sets of values at points of shape (unknowns,), with their predictions."""
        # rounding before the computation makes the results belong to the printed values
        sets = [_rounded_values(self.targets.unknowns, point) for point in points]
        fresh = [values for values in dict.fromkeys(sets) if values not in self.known]
        self.known |= zip(
            fresh,
            self.run.map(partial(_fit, self.drive, self.targets), fresh),
            strict=True,
        )
        self.run.solved(len(fresh))  # the progress bar counts drives here
        return [self.known[values] for values in sets]

    def residuals(self, points: Iterable[Array]) -> Array:
        """Return the deviations of the fits in tolerances, shape (points, targets)."""
        deviations = [self.targets.deviations(fit.predictions, _INSIDE) for fit in self.fits(points)]
        # a drive that cannot be computed repels the search without stopping it
        return np.asarray(np.nan_to_num(deviations, nan=_IMPOSSIBLE))

    def settled(self, point: Array, iterations: int) -> OptimizeResult:
        """Return the result of least squares (11) from a point, shape (unknowns,); a status above 0 is convergence."""
        return least_squares(
            lambda p: self.residuals([p])[0],
            # a start on a bound is moved inwards, because least squares could not leave the bound
            np.clip(point, _DIFFERENCE_STEP, 1 - _DIFFERENCE_STEP),
            jac=self._jacobian,
            bounds=(0.0, 1.0),
            xtol=3e-3,  # share of the bounds' width
            ftol=0.03,  # share of the sum of squares; a further decrease does not justify the time
            gtol=1e-3,
            max_nfev=iterations,
        )

    def _jacobian(self, point: Array) -> Array:
        """Return the derivatives of the residuals in the unit cube from differences, shape (residuals, unknowns)."""
        # inward steps keep all differences within the cube
        steps = np.where(point < 0.5, _DIFFERENCE_STEP, -_DIFFERENCE_STEP)
        center, *ends = self.residuals([point, *(point + np.diag(steps))])
        return np.stack([(end - center) / step for end, step in zip(ends, steps, strict=True)], axis=1)


def _places_of(unknowns: Sequence[FieldPrior], values: Mapping[str, float]) -> Array:
    """Return the positions of the unknowns' values between their bounds, 0..1, shape (unknowns,).

    unknowns: unknowns with their bounds.
    values: values by path.
    """
    return np.array([np.interp(values[u.path], u.value(_RANGE_SHARES), _RANGE_SHARES) for u in unknowns])


def _rounded_values(unknowns: Sequence[FieldPrior], point: Array) -> tuple[float, ...]:
    """Return the values of the unknowns at a point of the unit cube, rounded as they are printed."""
    return tuple(float(f"{u.value(x):.{_VALUE_DIGITS}g}") for u, x in zip(unknowns, point, strict=True))


def _distant(points: Iterable[Array]) -> list[int]:
    """Return the indices of the points that are far from all points chosen before them, in sequence."""
    chosen: dict[int, Array] = {}
    for k, point in enumerate(points):
        if all(np.abs(point - chosen_point).max() > _DISTANT for chosen_point in chosen.values()):
            chosen[k] = point
    return list(chosen)


def _fit(
    drive: Drive,
    targets: Targets,
    values: tuple[float, ...],
) -> Fit:
    """Return the predictions of a drive with other values."""
    fitted_drive = drive.with_values(targets.by_path(values))
    try:
        if (conflict := first_conflict(fitted_drive)) is not None:
            raise DataError(f"{conflict.path}: {conflict.message}", conflict.hint)
        return Fit(values, predictions(fitted_drive, targets.targets))
    # the reason is stored and shown if no set can be computed
    except HdassistError as error:
        return Fit(values, tuple(np.nan for _ in targets.targets), error.message)


def _shortfall(
    targets: Targets,
    fit: Fit,
    values: Sequence[_FoundValue],
) -> str:
    """Return a description of missed targets and limiting bounds; empty if all targets are met."""
    outcomes = zip(
        targets.targets,
        fit.predictions,
        targets.met(fit.predictions),
        strict=True,
    )
    missed = [
        f"{target.words} is {short(is_)} {target.unit}, wanted {target.wanted}"
        for target, is_, met in outcomes
        if not met
    ]
    bound_texts = [
        f"{value.path} is at its bound {plain(value.held_at)}" for value in values if value.held_at is not None
    ]
    return "; ".join([*missed, *(bound_texts or ["no fitted value is at its bound"])]) if missed else ""
