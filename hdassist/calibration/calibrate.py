"""Values of a preset found from targets: a global search, then least squares from its best, distant points.

Targets are few and unknowns many, so there is seldom one answer: every set that meets the targets and lies far
from the others is kept, and each value has an interval that says whether the targets have determined it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution, least_squares
from scipy.stats import qmc

from hdassist.calibration.evaluations import IMPOSSIBLE, Evaluations, Level, fault_of
from hdassist.calibration.quantities import FINE, MEDIUM, Quantities
from hdassist.calibration.shortfall import holding, in_the_way
from hdassist.calibration.targets import Targets, Unknown
from hdassist.errors import Fault, HdassistError, UntrustedError
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.solve.window import in_wide_enough_window

POPULATION = 4  # points of the global search's generation for each unknown
STARTS = 4  # points that least squares starts from by default
APART = 0.25  # of an unknown's range: sets that lie further apart in some unknown are different
STEP = 0.02  # of the range: step of difference quotients, above the roughness of a coarse scan
ROUNDS = 12  # steps of a least-squares run at most
DIGITS = 4  # of a found value
INDISTINCT = 0.95  # correlation from which on two unknowns cannot be told apart


@dataclass(frozen=True)
class Fit:
    """One set of found values, in the order of the unknowns.

    off: how far from each target, in its tolerances (0 inside a range); found: the quantity of each target,
    in its unit; best_deg: per torque of the preset, the mounting phase with the least F'_ior, None where that cannot be
    computed; met: which targets are.
    """

    values: tuple[float, ...]
    off: tuple[float, ...]
    found: tuple[float, ...]
    best_deg: tuple[float | None, ...]
    met: tuple[bool, ...]

    @property
    def all_met(self) -> bool:
        """Whether every target is met."""
        return all(self.met)


@dataclass(frozen=True)
class Calibration:
    """Found values, the best set first.

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
    def alternatives(self) -> tuple[Fit, ...]:
        """Other sets, far from the best, that meet every target too."""
        return self.fits[1:]

    @property
    def indistinct(self) -> list[tuple[str, str, float]]:
        """Pairs of unknowns that these targets cannot tell apart, with their correlation."""
        names = [unknown.path for unknown in self.targets.unknowns]
        rows, columns = np.nonzero(np.triu(np.abs(self.correlation), 1) > INDISTINCT)
        return [(names[i], names[k], float(self.correlation[i, k])) for i, k in zip(rows, columns, strict=True)]


def estimate_drives(targets: Targets, budget: int) -> int:
    """Number of drives that a calibration computes, about, for a progress bar."""
    return budget + STARTS * ROUNDS // 2 * (len(targets.unknowns) + 2)


def calibrate(
    drive: Drive,
    targets: Targets,
    evaluations: Evaluations,
    *,
    budget: int = 400,
    starts: int = STARTS,
    seed: int = 0,
    progress: Callable[[int], None] | None = None,
) -> Calibration:
    """Find the unknowns of a drive from its targets.

    Arguments: evaluations, which computes drives and remembers them; budget, drives that the global search may
    compute; starts, its best points, far from each other, that least squares starts from; seed, of the search;
    progress, told how many drives were computed or remembered.
    Raises UntrustedError where nothing could be computed or least squares did not come to rest.
    """
    unit = _Unit(targets.unknowns)
    start = tuple(u.start for u in targets.unknowns)
    seen: dict[tuple[float, ...], float] = {}

    def off(points: Iterable[Array], level: Level) -> list[Array]:
        points = list(points)
        rows = evaluations.off([unit.values(p) for p in points], level)
        if progress:
            progress(len(points))
        if level == "rough":
            seen.update({tuple(p.tolist()): float(row @ row) for p, row in zip(points, rows, strict=True)})
        return rows

    _search(unit, start, off, budget, seed)
    if min(seen.values()) >= IMPOSSIBLE**2:
        fault = fault_of(drive.with_values(targets.by_path(start)), targets.targets)
        why = f"; as the preset has it: {fault}" if fault else ""
        hint = "look at the bounds, and check the preset"
        raise UntrustedError(f"no drive within the bounds could be computed{why}", hint, Fault.FIT_UNSETTLED)
    runs = sorted((_settle(point, off) for point in _distant(seen, starts)), key=lambda run: run.cost)
    at_rest = runs[0].status > 0 or float(np.abs(runs[0].fun).max()) <= 1
    sets = [unit.values(run.x) for run in (runs if at_rest else runs[:1])]
    answers = evaluations.run(_fit, [(drive.with_values(targets.by_path(v)), targets, v) for v in sets])
    # a coarse scan may not have come to what a fine one does
    fits = [fit for fit in answers if fit is not None]
    if not fits:
        raise UntrustedError("no set that was found can be computed exactly", "narrow the bounds", Fault.FIT_UNSETTLED)
    kept = _far_apart(sorted(fits, key=lambda fit: float(np.sum(np.square(fit.off)))), unit)
    point = unit.point(kept[0].values)
    jacobian = _jacobian(point, off)
    held = holding(targets.unknowns, point, off([point], "medium")[0], jacobian)
    if not at_rest:
        words = in_the_way(targets.unknowns, targets.targets, kept[0].found, kept[0].met, held)
        raise UntrustedError(
            f"the fit did not come to rest: {words or 'its nearest set meets the targets all the same'}",
            "run again with the same --state and more --evaluations: what was computed is kept",
            Fault.FIT_UNSETTLED,
        )
    best = evaluations.run(_best_phases, [drive.with_values(targets.by_path(fit.values)) for fit in kept])
    kept = [replace(fit, best_deg=phases) for fit, phases in zip(kept, best, strict=True)]
    half, determined, correlation = _intervals(jacobian, unit, kept[0].values)
    count = evaluations.computed
    return Calibration(drive, targets, start, tuple(kept), half, determined, correlation, held, count, seed)


class _Unit:
    """Points of the unit cube and values of the unknowns."""

    def __init__(self, unknowns: Sequence[Unknown]) -> None:
        self.log = np.array([u.log for u in unknowns])
        ends = np.array([(u.low, u.high) for u in unknowns])
        self.low, self.high = self._flat(ends[:, 0]), self._flat(ends[:, 1])

    def _flat(self, values: Array) -> Array:
        return np.where(self.log, np.log(np.where(self.log, values, 1.0)), values)

    def values(self, point: Array) -> tuple[float, ...]:
        flat = self.low + (self.high - self.low) * np.clip(point, 0, 1)
        # what is printed and written is what was computed
        return tuple(float(f"{v:.{DIGITS}g}") for v in np.where(self.log, np.exp(np.where(self.log, flat, 0.0)), flat))

    def point(self, values: Sequence[float]) -> Array:
        return np.clip((self._flat(np.array(values)) - self.low) / (self.high - self.low), 0.0, 1.0)

    def slope(self, values: Sequence[float]) -> Array:
        """Change of each value over its coordinate."""
        return np.where(self.log, np.array(values), 1.0) * (self.high - self.low)


_Off = Callable[[Iterable[Array], Level], list[Array]]


def _search(unit: _Unit, start: Sequence[float], off: _Off, budget: int, seed: int) -> None:
    """Global search; what it sees is remembered by off."""
    count = len(start)
    size = max(8, POPULATION * count)
    first = qmc.Sobol(count, seed=seed).random(1 << (size - 1).bit_length())[:size]
    first[0] = unit.point(start)

    def costs(_: object, points: Iterable[Array]) -> list[float]:
        return [float(row @ row) for row in off(points, "rough")]

    differential_evolution(
        lambda point: float(np.sum(np.square(off([point], "rough")[0]))),
        [(0.0, 1.0)] * count,
        init=first,
        maxiter=max(0, budget // size - 1),
        tol=0.0,
        seed=seed,
        polish=False,
        updating="deferred",
        workers=costs,
    )


def _distant(seen: dict[tuple[float, ...], float], count: int) -> list[Array]:
    """The best points that lie apart, so many at most."""
    chosen: list[Array] = []
    for point in sorted(seen, key=lambda p: seen[p]):
        here = np.array(point)
        if len(chosen) < count and all(np.abs(here - other).max() > APART for other in chosen):
            chosen.append(here)
    return chosen


def _settle(point: Array, off: _Off) -> OptimizeResult:
    """Least squares from a point; status above 0 where it came to rest."""
    return least_squares(
        lambda p: off([p], "medium")[0],
        np.clip(point, STEP, 1 - STEP),
        jac=lambda p: _jacobian(p, off),
        bounds=(0.0, 1.0),
        xtol=3e-3,  # of the bounds' width
        ftol=0.03,  # of the sum of squares: better is not worth the time
        gtol=1e-3,
        max_nfev=ROUNDS,
    )


def _jacobian(point: Array, off: _Off) -> Array:
    """Change of what is off over the unit cube, shape (targets, unknowns), by differences towards its middle."""
    steps = np.where(point < 0.5, STEP, -STEP)
    here, *ends = off([point, *(point + np.diag(steps))], "medium")
    return np.stack([(end - here) / step for end, step in zip(ends, steps, strict=True)], axis=1)


def _fit(task: tuple[Drive, Targets, tuple[float, ...]]) -> Fit | None:
    drive, targets, values = task

    def found(there: Drive) -> Fit:
        fine = Quantities(there, FINE)
        rows = [fine.off(target) for target in targets.targets]
        off = tuple(float(row[0]) if len(row) == 1 else float(np.sqrt(row @ row)) for row in rows)
        met = tuple(t.is_met(x) for t, x in zip(targets.targets, off, strict=True))
        return Fit(values, off, tuple(fine.value(target) for target in targets.targets), (), met)

    try:
        return in_wide_enough_window(drive, found)
    except HdassistError:
        return None


def _best_phases(drive: Drive) -> tuple[float | None, ...]:
    """Mounting phase [deg] of the least F'_ior at each torque of a drive; None where it cannot be computed."""

    def best(M_g: float) -> float | None:
        try:
            return in_wide_enough_window(drive, lambda there: Quantities(there, MEDIUM).best_deg(M_g))
        except HdassistError:
            return None

    return tuple(map(best, drive.operation.M_g))


def _far_apart(fits: list[Fit], unit: _Unit) -> list[Fit]:
    """The first, and of the others those that meet all targets and lie far from what is kept."""
    kept = fits[:1]
    for fit in fits[1:]:
        point = unit.point(fit.values)
        if fit.all_met and all(np.abs(point - unit.point(other.values)).max() > APART for other in kept):
            kept.append(fit)
    return kept


def _intervals(
    jacobian: Array, unit: _Unit, values: Sequence[float]
) -> tuple[tuple[float, ...], tuple[float, ...], Array]:
    """Half-widths of the values, how far they are determined, and correlations.

    The bounds count as knowledge too: half their width is the half-width of a value that no target sees.
    """
    information = jacobian.T @ jacobian + 4 * np.eye(jacobian.shape[1])
    covariance = np.linalg.inv(information)
    deviation = np.sqrt(np.diag(covariance))
    half = deviation * unit.slope(values)
    correlation = covariance / np.outer(deviation, deviation)
    return tuple(half.tolist()), tuple((1 - 2 * deviation).tolist()), correlation
