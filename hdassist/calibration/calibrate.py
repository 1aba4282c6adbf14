"""Values of a preset found from targets: least squares from the best, distant points of a Sobol set.

Targets are few and unknowns many, so there is seldom one answer: every set that meets the targets and lies far
from the others is kept, and each value has an interval that says whether the targets have determined it.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from hdassist.belief.prior import FieldPrior
from hdassist.belief.statistics import sobol_points
from hdassist.calibration.quantities import predictions
from hdassist.calibration.targets import INSIDE, Targets
from hdassist.errors import DataError, Fault, HdassistError, UntrustedError
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import plain, short, unit_of
from hdassist.run.run import Run

DISTANT = 0.25  # of an unknown's range: sets that lie further apart in some unknown are different
DIFFERENCE_STEP = 0.02  # of the range: step of difference quotients, above the roughness of a search for extremes
VALUE_DIGITS = 4  # of a found value
INDISTINCT = 0.95  # correlation from which on two unknowns cannot be separated
RANGE_SHARES = np.linspace(0, 1, 1001)  # of a field's range, at which a value is looked up
IMPOSSIBLE = 1e6  # tolerances, each residual of a drive that cannot be computed


@dataclass(frozen=True)
class Fit:
    """One set of found values, in the order of the unknowns.

    predictions: the quantity of each target in its unit, NaN of a drive without an answer; fault: why it has none.
    """

    values: tuple[float, ...]
    predictions: tuple[float, ...]
    fault: str = ""


@dataclass(frozen=True)
class FoundValue:
    """A value of the best set, in the unit of its field, by path; start, of the preset; low and high, its bounds.

    half_width: of its interval, in the sense in which the tolerances are half-widths; determined: share of the bounds'
    width by which the targets have narrowed the interval, 0..1; held_at: the bound at which it stands, None elsewhere.
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
    """Found values, the best set first, then others, far from it, that meet every target too.

    values: of the best set; shortfall: targets that it misses and bounds that hold it back, in words, empty where all
    are met; indistinct: pairs of unknowns that the targets cannot separate, with their correlation; evaluations:
    drives computed.
    """

    drive: Drive
    targets: Targets
    fits: tuple[Fit, ...]
    values: tuple[FoundValue, ...]
    shortfall: str
    indistinct: tuple[tuple[str, str, float], ...]
    evaluations: int
    seed: int


def estimate_drives(targets: Targets, points: int, starts: int = 4, iterations: int = 12) -> int:
    """Number of drives that a calibration computes, about, for a progress bar."""
    return points + starts * iterations // 2 * (len(targets.unknowns) + 2)


def calibrate(
    drive: Drive, targets: Targets, *, points: int = 64, starts: int = 4, iterations: int = 12, run: Run = Run()
) -> Calibration:
    """Find the unknowns of a drive from its targets.

    Arguments: points of the Sobol set; starts, its best points, far from each other, that least squares starts from;
    iterations of a least-squares run at most. Raises UntrustedError where no drive could be computed or least squares
    did not come to rest.
    """
    unknowns, search = targets.unknowns, _Search(drive, targets, run)
    sobol = sobol_points(points, len(unknowns), run.seed)
    sobol[0] = places_of(unknowns, {u.path: drive.number(u.path) for u in unknowns})
    costs = (search.residuals(sobol) ** 2).sum(axis=1)
    order = [k for k in np.argsort(costs, kind="stable") if costs[k] < IMPOSSIBLE**2]
    if not order:
        words = f"no drive within the bounds could be computed; as the preset has it: {search.fits(sobol[:1])[0].fault}"
        raise UntrustedError(words, "look at the bounds, and check the preset", Fault.FIT_UNSETTLED)
    runs = [search.settled(sobol[order[k]], iterations) for k in _distant(sobol[order])[:starts]]
    first, *others = sorted(runs, key=lambda each: each.cost)
    places = [first.x, *(each.x for each in others if all(targets.met(search.fits([each.x])[0].predictions)))]
    fits = search.fits(places[k] for k in _distant(places))
    # equation (12) of docs/theory.md; half the bounds' width is the half-width of a value that no target sees
    covariance = np.linalg.inv(first.jac.T @ first.jac + 4 * np.eye(len(unknowns)))
    deviation = np.sqrt(np.diag(covariance))
    values = [
        FoundValue(
            u.path, unit_of(field_table()[u.path]), drive.value(u.path), found,
            float(u.value(x + d) - u.value(x - d)) / 2, u.low, u.high, 1 - 2 * float(d),
            None if not side else u.low if side < 0 else u.high,
        )
        for u, found, x, d, side in zip(unknowns, fits[0].values, first.x, deviation, first.active_mask, strict=True)
    ]  # fmt: skip
    missed = _shortfall(targets, fits[0], values)
    if first.status <= 0 and np.abs(first.fun).max() > 1:
        words = missed or "its nearest set meets the targets all the same"
        raise UntrustedError(f"the fit did not come to rest: {words}", "more --evaluations", Fault.FIT_UNSETTLED)
    correlation = covariance / np.outer(deviation, deviation)
    alike = np.argwhere(np.triu(np.abs(correlation), 1) > INDISTINCT).tolist()
    indistinct = tuple((unknowns[i].path, unknowns[k].path, float(correlation[i, k])) for i, k in alike)
    return Calibration(drive, targets, tuple(fits), tuple(values), missed, indistinct, len(search.known), run.seed)


class _Search:
    """Fits of a drive to targets at points of the unit cube, shape (unknowns,); each drive is computed once."""

    def __init__(self, drive: Drive, targets: Targets, run: Run) -> None:
        self.drive, self.targets, self.run = drive, targets, run
        self.known: dict[tuple[float, ...], Fit] = {}

    def fits(self, points: Iterable[Array]) -> list[Fit]:
        """Sets of values at points, and their predictions."""
        sets = [rounded_values(self.targets.unknowns, point) for point in points]
        fresh = [values for values in dict.fromkeys(sets) if values not in self.known]
        self.known |= zip(fresh, self.run.map(partial(_fit, self.drive, self.targets), fresh), strict=True)
        self.run.solved(len(fresh))  # drives here
        return [self.known[values] for values in sets]

    def residuals(self, points: Iterable[Array]) -> Array:
        """Deviations of fits [tolerances], shape (points, targets)."""
        found = [self.targets.deviations(fit.predictions, INSIDE) for fit in self.fits(points)]
        return np.asarray(np.nan_to_num(found, nan=IMPOSSIBLE))

    def settled(self, point: Array, iterations: int) -> OptimizeResult:
        """Least squares (11) from a point; status above 0 where it came to rest."""
        return least_squares(
            lambda p: self.residuals([p])[0],
            np.clip(point, DIFFERENCE_STEP, 1 - DIFFERENCE_STEP),
            jac=self._jacobian,
            bounds=(0.0, 1.0),
            xtol=3e-3,  # of the bounds' width
            ftol=0.03,  # of the sum of squares: better is not worth the time
            gtol=1e-3,
            max_nfev=iterations,
        )

    def _jacobian(self, point: Array) -> Array:
        """Change of the residuals over the cube, shape (residuals, unknowns), by differences towards its middle."""
        steps = np.where(point < 0.5, DIFFERENCE_STEP, -DIFFERENCE_STEP)
        center, *ends = self.residuals([point, *(point + np.diag(steps))])
        return np.stack([(end - center) / step for end, step in zip(ends, steps, strict=True)], axis=1)


def places_of(unknowns: Sequence[FieldPrior], values: Mapping[str, float]) -> Array:
    """Place of the value of each field, by path, between its bounds, 0..1, shape (unknowns,)."""
    return np.array([np.interp(values[u.path], u.value(RANGE_SHARES), RANGE_SHARES) for u in unknowns])


def rounded_values(unknowns: Sequence[FieldPrior], point: Array) -> tuple[float, ...]:
    """Values of fields at their places between the bounds, shape (unknowns,), as they are printed and written."""
    return tuple(float(f"{u.value(x):.{VALUE_DIGITS}g}") for u, x in zip(unknowns, point, strict=True))


def _distant(points: Iterable[Array]) -> list[int]:
    """Places of the points, in their order, that lie far from those before them."""
    chosen: dict[int, Array] = {}
    for k, point in enumerate(points):
        if all(np.abs(point - other).max() > DISTANT for other in chosen.values()):
            chosen[k] = point
    return list(chosen)


def _fit(drive: Drive, targets: Targets, values: tuple[float, ...]) -> Fit:
    """Predictions of a drive with other values."""
    there = drive.with_values(targets.by_path(values))
    try:
        if (conflict := first_conflict(there)) is not None:
            raise DataError(f"{conflict.path}: {conflict.message}", conflict.hint)
        return Fit(values, predictions(there, targets.targets))
    except HdassistError as error:
        return Fit(values, (np.nan,) * len(targets.targets), error.message)


def _shortfall(targets: Targets, fit: Fit, values: Sequence[FoundValue]) -> str:
    """Targets that a fit misses and bounds that hold its values back, in words; empty where all targets are met."""
    found = zip(targets.targets, fit.predictions, targets.met(fit.predictions), strict=True)
    missed = [f"{each.words} is {short(is_)} {each.unit}, wanted {each.wanted}" for each, is_, met in found if not met]
    at = [f"{each.path} stands at its bound {plain(each.held_at)}" for each in values if each.held_at is not None]
    return "; ".join([*missed, *(at or ["no bound is in the way"])]) if missed else ""
