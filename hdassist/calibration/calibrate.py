"""Values of a preset found from targets: least squares from the best, distant points of a Sobol set.

Targets are few and unknowns many, so there is seldom one answer: every set that meets the targets and lies far
from the others is kept, and each value has an interval that says whether the targets have determined it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import OptimizeResult, least_squares
from scipy.stats import qmc

from hdassist.calibration.evaluations import IMPOSSIBLE, Evaluations, residuals_or_fault
from hdassist.calibration.quantities import REPORTING, SEARCHING, TargetQuantities
from hdassist.calibration.targets import CalibrationTarget, SoughtField, Targets
from hdassist.errors import Fault, HdassistError, UntrustedError
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.preset.kinds import plain

DISTANT = 0.25  # of an unknown's range: sets that lie further apart in some unknown are different
DIFFERENCE_STEP = 0.02  # of the range: step of difference quotients, above the roughness of a coarse scan
VALUE_DIGITS = 4  # of a found value
INDISTINCT = 0.95  # correlation from which on two unknowns cannot be told apart


@dataclass(frozen=True)
class Fit:
    """One set of found values, in the order of the unknowns.

    deviations: from each target, in its tolerances (0 inside a range; rms of a trace); predictions: the quantity of
    each target, in its unit; met: whether each target is; best_deg: mounting phase with the least F'_ior per torque of
    the preset, None where it cannot be computed.
    """

    values: tuple[float, ...]
    deviations: tuple[float, ...]
    predictions: tuple[float, ...]
    met: tuple[bool, ...]
    best_deg: tuple[float | None, ...] = ()

    @property
    def all_met(self) -> bool:
        """Whether every target is met."""
        return all(self.met)


@dataclass(frozen=True)
class Calibration:
    """Found values, the best set first, then others, far from it, that meet every target too.

    start: values of the preset; half_width: of the interval of each value of the best set, in the sense in which
    the tolerances are half-widths, cut to the bounds; determined: share of the bounds' width by which the targets
    have narrowed the interval, 0..1; correlation, shape (unknowns, unknowns); held: the bound at which each value of
    the best set stands and beyond which the fit would go on, None elsewhere; evaluations: drives computed.
    """

    drive: Drive
    targets: Targets
    start: tuple[float, ...]
    fits: tuple[Fit, ...]
    half_width: tuple[float, ...]
    determined: tuple[float, ...]
    correlation: Array
    held: tuple[float | None, ...]
    evaluations: int
    seed: int

    @property
    def best(self) -> Fit:
        """The set with the least sum of squares."""
        return self.fits[0]

    @property
    def indistinct(self) -> list[tuple[str, str, float]]:
        """Pairs of unknowns that these targets cannot tell apart, with their correlation."""
        names = [unknown.path for unknown in self.targets.unknowns]
        rows, columns = np.nonzero(np.triu(np.abs(self.correlation), 1) > INDISTINCT)
        return [(names[i], names[k], float(self.correlation[i, k])) for i, k in zip(rows, columns, strict=True)]

    @property
    def shortfall(self) -> str:
        """Targets that the best set misses and bounds that hold it back, in words; empty where all targets are met."""
        return shortfall(self.targets, self.best, self.held)


def estimate_drives(targets: Targets, points: int, starts: int = 4, iterations: int = 12) -> int:
    """Number of drives that a calibration computes, about, for a progress bar."""
    return points + starts * iterations // 2 * (len(targets.unknowns) + 2)


def calibrate(
    drive: Drive,
    targets: Targets,
    evaluations: Evaluations,
    *,
    points: int = 64,
    starts: int = 4,
    iterations: int = 12,
) -> Calibration:
    """Find the unknowns of a drive from its targets.

    Arguments: evaluations, which computes drives and remembers them; points of the Sobol set; starts, its best points,
    far from each other, that least squares starts from; iterations of a least-squares run at most.
    Raises UntrustedError where no drive could be computed or least squares did not come to rest.
    """
    cube = _UnitCube(targets.unknowns)
    start = tuple(u.start for u in targets.unknowns)

    def residuals(at: Sequence[Array]) -> Array:
        rows = evaluations.residuals([cube.values(point) for point in at])
        evaluations.run.solved(len(at))  # drives here
        return rows

    sobol = qmc.Sobol(len(start), seed=evaluations.run.seed).random(1 << (points - 1).bit_length())[:points]
    sobol[0] = cube.point(start)
    costs = (residuals(list(sobol)) ** 2).sum(axis=1)
    order = [k for k in np.argsort(costs, kind="stable") if costs[k] < IMPOSSIBLE**2]
    if not order:
        _, fault = residuals_or_fault(targets.targets, drive.with_values(targets.by_path(start)))
        why = f"; as the preset has it: {fault}" if fault else ""
        hint = "look at the bounds, and check the preset"
        raise UntrustedError(f"no drive within the bounds could be computed{why}", hint, Fault.FIT_UNSETTLED)
    first = [sobol[order[k]] for k in _distant(sobol[order])[:starts]]
    runs = sorted((_settle(point, residuals, iterations) for point in first), key=lambda run: run.cost)
    at_rest = runs[0].status > 0 or float(np.abs(runs[0].fun).max()) <= 1
    runs = runs if at_rest else runs[:1]
    # a coarse scan may not have come to what a fine one does
    fine = evaluations.run.map(partial(_fit, drive, targets), [cube.values(run.x) for run in runs])
    found = [(fit, run) for fit, run in zip(fine, runs, strict=True) if fit is not None]
    if not found:
        raise UntrustedError("no set that was found can be computed exactly", "narrow the bounds", Fault.FIT_UNSETTLED)
    found.sort(key=lambda pair: float(np.sum(np.square(pair[0].deviations))))
    best, run = found[0]
    bounds = ((u.low, u.high) for u in targets.unknowns)
    # the sum of squares would go on falling beyond a bound that the search came to
    held = tuple(
        None if side * slope >= 0 else low if side < 0 else high
        for (low, high), side, slope in zip(bounds, run.active_mask, run.grad, strict=True)
    )
    if not at_rest:
        words = shortfall(targets, best, held) or "its nearest set meets the targets all the same"
        hint = "run again with the same --state and more --evaluations: what was computed is kept"
        raise UntrustedError(f"the fit did not come to rest: {words}", hint, Fault.FIT_UNSETTLED)
    fits = [best, *(fit for fit, _ in found[1:] if fit.all_met)]
    fits = [fits[k] for k in _distant([cube.point(fit.values) for fit in fits])]
    phases = evaluations.run.map(_best_phases, [drive.with_values(targets.by_path(fit.values)) for fit in fits])
    # equation (12) of docs/theory.md; half the bounds' width is the half-width of a value that no target sees
    covariance = np.linalg.inv(run.jac.T @ run.jac + 4 * np.eye(len(start)))
    deviation = np.sqrt(np.diag(covariance))
    return Calibration(
        drive,
        targets,
        start,
        tuple(replace(fit, best_deg=best_deg) for fit, best_deg in zip(fits, phases, strict=True)),
        tuple((deviation * cube.slope(best.values)).tolist()),
        tuple((1 - 2 * deviation).tolist()),
        covariance / np.outer(deviation, deviation),
        held,
        evaluations.computed,
        evaluations.run.seed,
    )


class _UnitCube:
    """Values of the unknowns as points of the unit cube, shape (unknowns,), and back."""

    def __init__(self, unknowns: Sequence[SoughtField]) -> None:
        self.log = np.array([u.log for u in unknowns])
        self.low, self.high = (self._flat([getattr(u, end) for u in unknowns]) for end in ("low", "high"))

    def _flat(self, values: Sequence[float]) -> Array:
        flat = np.array(values, dtype=float)
        return np.asarray(np.log(flat, out=flat, where=self.log))

    def values(self, point: Array) -> tuple[float, ...]:
        flat = self.low + (self.high - self.low) * np.clip(point, 0, 1)
        # what is printed and written is what was computed
        return tuple(float(f"{v:.{VALUE_DIGITS}g}") for v in np.exp(flat, out=flat, where=self.log))

    def point(self, values: Sequence[float]) -> Array:
        return np.clip((self._flat(values) - self.low) / (self.high - self.low), 0.0, 1.0)

    def slope(self, values: Sequence[float]) -> Array:
        """Change of each value over its coordinate."""
        return np.where(self.log, np.array(values), 1.0) * (self.high - self.low)


_Residuals = Callable[[Sequence[Array]], Array]


def _distant(points: Iterable[Array]) -> list[int]:
    """Places of the points, in their order, that lie far from those before them."""
    chosen: dict[int, Array] = {}
    for k, point in enumerate(points):
        if all(np.abs(point - other).max() > DISTANT for other in chosen.values()):
            chosen[k] = point
    return list(chosen)


def _settle(point: Array, residuals: _Residuals, iterations: int) -> OptimizeResult:
    """Least squares (11) from a point; status above 0 where it came to rest."""
    return least_squares(
        lambda p: residuals([p])[0],
        np.clip(point, DIFFERENCE_STEP, 1 - DIFFERENCE_STEP),
        jac=lambda p: _jacobian(p, residuals),
        bounds=(0.0, 1.0),
        xtol=3e-3,  # of the bounds' width
        ftol=0.03,  # of the sum of squares: better is not worth the time
        gtol=1e-3,
        max_nfev=iterations,
    )


def _jacobian(point: Array, residuals: _Residuals) -> Array:
    """Change of the residuals over the unit cube, shape (residuals, unknowns), by differences towards its middle."""
    steps = np.where(point < 0.5, DIFFERENCE_STEP, -DIFFERENCE_STEP)
    center, *ends = residuals([point, *(point + np.diag(steps))])
    return np.stack([(end - center) / step for end, step in zip(ends, steps, strict=True)], axis=1)


def _fit(drive: Drive, targets: Targets, values: tuple[float, ...]) -> Fit | None:
    """A set of values computed closely; None where it cannot be."""
    try:
        fine = TargetQuantities(drive.with_values(targets.by_path(values)), REPORTING)
        predicted = [fine.predict(target) for target in targets.targets]
        rows = [target.residuals(each) for target, each in zip(targets.targets, predicted, strict=True)]
    except HdassistError:
        return None
    deviations = tuple(float(row[0] if len(row) == 1 else np.linalg.norm(row)) for row in rows)
    sizes = tuple(float(p[0] if len(p) == 1 else np.sqrt(np.mean(p**2))) for p in predicted)
    return Fit(values, deviations, sizes, tuple(map(CalibrationTarget.is_met, targets.targets, deviations)))


def _best_phases(drive: Drive) -> tuple[float | None, ...]:
    """Mounting phase [deg] of the least F'_ior at each torque of a drive; None where it cannot be computed."""

    def best(M_g: float) -> float | None:
        try:
            return TargetQuantities(drive, SEARCHING).scan(M_g).best_deg
        except HdassistError:
            return None

    return tuple(map(best, drive.operation.M_g))


def shortfall(targets: Targets, fit: Fit, held: Sequence[float | None]) -> str:
    """Targets that a fit misses and bounds that hold it back, in words; empty where all targets are met."""
    if fit.all_met:
        return ""
    met = zip(targets.targets, fit.predictions, fit.met, strict=True)
    at = [f"{path} stands at its bound {plain(b)}" for path, b in targets.by_path(held).items() if b is not None]
    return "; ".join([*(_missed(t, value) for t, value, ok in met if not ok), *(at or ["no bound is in the way"])])


def _missed(target: CalibrationTarget, value: float) -> str:
    """By how much a value misses a target, in words."""
    words = f"{target.words} {plain(float(f'{value:.3g}'))} {target.unit}"
    if target.trace:
        return f"{words} rms off the trace, {target.tolerance:g} allowed"
    end = target.low if value < target.low else target.high
    wanted = end if target.value is None else target.value
    side = "above" if value > wanted else "below"
    by = f"{100 * abs(value / wanted - 1):.2g} %" if wanted else f"{abs(value):.2g} {target.unit}"
    return f"{words} is still {by} {side} its target {plain(wanted)}"
