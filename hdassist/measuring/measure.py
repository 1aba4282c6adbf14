"""F'_ior, orders and coverage of a measured trace, each direction by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot

import numpy as np

from hdassist.errors import DataError, Fault, UntrustedError, UsageError
from hdassist.measuring.bins import Bins, bins_of, travel_of
from hdassist.measuring.cycle import Coverage, Gearing, coverage, gearing_of
from hdassist.measuring.fit import BINS_PER_COLUMN, TraceFit, fit_orders
from hdassist.measuring.lines import with_lines
from hdassist.measuring.orders import DEFAULT, WHOLE, MeasuredOrder, order_grid, order_table
from hdassist.measuring.range import Range, ranges_of, visited_angles
from hdassist.measuring.uncertainty import (
    COVERAGE_FACTOR,
    OF_THE_RANGE,
    OF_THE_RECORD,
    UncertaintySource,
    budget,
    combined,
)
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.readers.sweeps import Sweep
from hdassist.readers.trace import MeasuredTrace

DRIFTS = {"none": 0, "linear": 1, "quadratic": 2}
SHORTEST = 1.0  # cam turns
STEPS_PER_PERIOD = 2.5  # of the angle, in a period of the highest order, at least
DRIFT_LEFT = "a linear drift of {:.3g} arcsec over the record is left in (--drift linear)"
DRIFTED = 0.05  # of F'_ior: a drift left in that is said
COARSE = 1 / 4  # of F'_ior: a step in time with the turns from which on the error is not told from it
UNMODELLED = 1 / 5  # of F'_ior: error beyond the orders that is said


@dataclass(frozen=True, eq=False)
class SweepResult:
    """What a trace says of one direction: 1 for growing cam angles, -1 for falling ones, 0 for both as one.

    fit: see there; range: over the visited angles, grid_turns, shape (angles,); revolution: the greatest within one
    turn of the cam; raw_range_arcsec: of the readings themselves, drift taken off where asked; coverage: None where
    the ratio is not known; sources: of the uncertainty of F'_ior.
    """

    direction: int
    fit: TraceFit
    grid_turns: Array
    range: Range
    revolution: Range
    raw_range_arcsec: float
    orders: tuple[MeasuredOrder, ...]
    coverage: Coverage | None
    sources: tuple[UncertaintySource, ...]

    @property
    def bins(self) -> Bins:
        """Averages of the readings, to which the fit was made."""
        return self.fit.design.bins

    @property
    def uncertainty_arcsec(self) -> float:
        """Combined standard uncertainty of F'_ior."""
        return combined(self.sources)

    @property
    def revolution_uncertainty_arcsec(self) -> float:
        """Combined standard uncertainty of the range within one cam turn: its own noise, the other sources alike."""
        return hypot(self.revolution.spread, self.revolution.bias_uncertainty, combined(self.sources[OF_THE_RANGE:]))

    @property
    def interval_arcsec(self) -> tuple[float, float]:
        """F'_ior with its expanded uncertainty, k = 2, to either side, above it what lines may add in another cycle."""
        reach = COVERAGE_FACTOR * self.uncertainty_arcsec
        return max(0.0, self.range.value - reach), self.range.value + self.rise_arcsec + reach

    @property
    def rise_arcsec(self) -> float:
        """By how much lines may make F'_ior greater in another cycle; 0 for a bound, which is of its angles only."""
        return 0.0 if self.is_bound else self.range.rise

    @property
    def revolution_rise_arcsec(self) -> float:
        """The same of the range within one cam turn."""
        return 0.0 if self.is_bound else self.revolution.rise

    @property
    def lines(self) -> tuple[MeasuredOrder, ...]:
        """Lines that are none of the declared orders."""
        return tuple(order for order in self.orders if order.per_cam_rev in self.fit.lines)

    @property
    def is_bound(self) -> bool:
        """Whether F'_ior of the full cycle may be greater, because not all of it was visited."""
        return self.coverage is None or not self.coverage.is_full


@dataclass(frozen=True)
class Reversal:
    """Error in growing minus error in falling direction at the same angles [arcsec]: mean, and greatest departure."""

    mean_arcsec: float
    greatest_arcsec: float


@dataclass(frozen=True, eq=False)
class Measurement:
    """A measured trace looked at: the directions, the one with the greatest F'_ior first; seed of the bootstrap."""

    trace: MeasuredTrace
    gearing: Gearing | None
    directions: tuple[SweepResult, ...]
    reversal: Reversal | None
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    seed: int

    @property
    def F_ior_arcsec(self) -> float:
        """F'_ior: the greater one of both directions."""
        return self.directions[0].range.value


def measure(
    trace: MeasuredTrace,
    *,
    drive: Drive | None = None,
    ratio: float | None = None,
    orders: Sequence[float] | None = None,
    drift: str = "none",
    stated: Mapping[str, float] | None = None,
    seed: int = 0,
    together: bool = False,
) -> Measurement:
    """Look at a measured trace.

    Arguments: trace; drive or ratio, for cycle, coverage and beats with the output; orders per cam turn, rising, to
    which the error is limited (None: 1 to 12, or as far as the steps of the angle resolve them); drift, none, linear
    or quadratic, to take off; stated, standard uncertainties [arcsec] by source; seed of the bootstrap;
    together, both directions as one, which is then 0.
    Raises UsageError: a wrong argument; DataError: less than one cam turn in one direction; UntrustedError: orders that
    the record does not resolve, or an F'_ior that is not clear of its noise.
    """
    require_drift(drift)
    gearing = gearing_of(drive, ratio)
    notes = list(trace.notes)
    found: list[SweepResult] = []
    for sign in (0,) if together else (1, -1):
        sweeps = [sweep for sweep in trace.sweeps if together or sweep.direction == sign]
        longest = max((abs(trace.cam_deg[s.stop - 1] - trace.cam_deg[s.start]) / 360 for s in sweeps), default=0.0)
        if longest < SHORTEST - 0.01:
            if sweeps:
                notes.append(f"{'growing' if sign > 0 else 'falling'} angles left out: {longest:.2g} of a cam turn")
            continue
        declared = _declared(trace, sweeps, orders, notes)
        bins = bins_of(trace, sweeps, declared[-1])
        fit = _fit(bins, declared, gearing, DRIFTS[drift], notes)
        if not together:
            fit = with_lines(fit, fit.orders, DRIFTS[drift], _finest(trace, sweeps))
        found.append(_sweep_result(sign, trace, sweeps, fit, gearing, drive, stated or {}, seed))
    if not found:
        hint = "F'_ior is looked for over whole turns; is the angle that of the cam, and its unit right?"
        raise DataError(f"{trace.file}: less than one cam turn in one direction", hint)
    warnings = tuple(dict.fromkeys(text for each in found for text in _warnings(each)))
    reversal = _reversal(*found) if len(found) == 2 else None
    found.sort(key=lambda each: -each.range.value)
    return Measurement(trace, gearing, tuple(found), reversal, tuple(dict.fromkeys(notes)), warnings, seed)


def require_drift(kind: str) -> None:
    """Raise UsageError unless it is a kind of drift that can be taken off."""
    if kind not in DRIFTS:
        raise UsageError(f"--drift must be none, linear or quadratic, not {kind}")


def drift_left(bins: Bins, residual: Array, extent: float) -> float:
    """Linear drift [arcsec] over the record that residuals show clearly beside a range; 0 where there is none."""
    travel = bins.travel - bins.travel.mean()
    slope = float(travel @ residual) / float(travel @ travel)
    size = slope * float(np.ptp(travel))
    scatter = float(np.std(residual - slope * travel))
    error = scatter * float(np.sqrt(12 / (2 * bins.span)))  # of a straight line, residuals alike for half a turn
    return size if abs(size) > max(4 * error, DRIFTED * extent) else 0.0


def _declared(
    trace: MeasuredTrace, sweeps: Sequence[Sweep], orders: Sequence[float] | None, notes: list[str]
) -> Sequence[float]:
    """Declared orders, refused where the steps of the angle do not resolve them; the default ones cut instead."""
    declared = orders or DEFAULT
    highest = _finest(trace, sweeps)
    if declared[-1] <= highest:
        return declared
    kept = tuple(order for order in declared if order <= highest)
    if orders is not None or not kept:
        message = f"steps of {360 / (STEPS_PER_PERIOD * highest):.3g} deg are too long for order {declared[-1]:g}"
        raise UntrustedError(
            f"{trace.file}: {message}", f"up to {highest:.2g} can be declared: --orders", Fault.ORDERS_UNTOLD
        )
    notes.append(f"orders up to {kept[-1]:g} only: the steps of the angle resolve no more")
    return kept


def _finest(trace: MeasuredTrace, sweeps: Sequence[Sweep]) -> float:
    """The highest order per cam turn that the steps of the angle resolve."""
    steps = np.concatenate([np.diff(trace.cam_deg[sweep.start : sweep.stop]) for sweep in sweeps]) / 360
    return 1 / (STEPS_PER_PERIOD * float(np.quantile(np.abs(steps[steps != 0]), 0.75)))


def _fit(bins: Bins, declared: Sequence[float], gearing: Gearing | None, degree: int, notes: list[str]) -> TraceFit:
    """Fit with beats where the record resolves them and has bins enough, else without."""
    ratio = gearing.ratio if gearing else None
    with_beats, without = (order_grid(declared, bins.span, ratio, beats=beats) for beats in (True, False))
    if len(with_beats) > len(without) and len(bins) >= BINS_PER_COLUMN * 2 * (2 * len(with_beats) + 4):
        try:
            return fit_orders(bins, with_beats, degree)
        except UntrustedError:
            pass
    if len(without) < len(declared):
        notes.append(f"orders closer than 1/{bins.span:.3g} joined: the record does not tell them apart")
    notes.append("beats with the output are not resolved: each order stands for them too")
    return fit_orders(bins, without, degree)


def _sweep_result(
    sign: int,
    trace: MeasuredTrace,
    sweeps: Sequence[Sweep],
    fit: TraceFit,
    gearing: Gearing | None,
    drive: Drive | None,
    stated: Mapping[str, float],
    seed: int,
) -> SweepResult:
    """The range of a fit with its uncertainty, refused where it is not clear of noise; orders and coverage."""
    bins = fit.design.bins
    again = gearing is not None and bins.span >= WHOLE * gearing.ratio and not len(fit.lines)
    cycle = gearing.cycle if gearing and again else None
    grid = visited_angles(bins, float(fit.orders[-1]), cycle)
    extent, revolution = ranges_of(fit, grid, np.random.default_rng([seed, sign + 1]))
    scatter = float(np.sqrt(np.mean(bins.rows * fit.residual**2)))
    step = trace.step_arcsec
    sources = budget(
        extent.spread, extent.bias_uncertainty, fit.unmodelled, step, scatter, stated, in_time=trace.in_time
    )
    if trace.in_time and step > COARSE * extent.value:
        message = f"the output is read in steps of {step:.2g} arcsec at even angles: what they round looks like error"
        raise UntrustedError(f"{trace.file}: {message}", "read both encoders by the clock", Fault.ORDERS_UNTOLD)
    alone = combined(sources[:OF_THE_RECORD])
    if not fit.clear_of_noise or not extent.value > COVERAGE_FACTOR * alone:
        message = f"F'_ior of {max(extent.value, 0.0):.3g} arcsec is not clear of its noise, u = {alone:.3g} arcsec"
        drifts = not len(fit.drift) and drift_left(bins, fit.residual, 0.0)
        hint = "it drifts: --drift linear" if drifts else "record longer or with less noise; is it the right column?"
        raise UntrustedError(f"{trace.file}: {message}", hint, Fault.ORDERS_UNTOLD)
    rows = np.concatenate([np.arange(sweep.start, sweep.stop) for sweep in sweeps])
    raw = float(np.ptp(trace.error_arcsec[rows] - fit.drift_at(travel_of(trace)[rows])))
    visits = coverage(trace.cam_deg[rows] / 360, gearing) if gearing else None
    return SweepResult(sign, fit, grid, extent, revolution, raw, order_table(fit, drive, gearing), visits, sources)


def _warnings(found: SweepResult) -> list[str]:
    """What stands in the way of trust in a direction: a drift left in, or error beyond the orders."""
    fit, extent, warnings = found.fit, found.range.value, []
    if not len(fit.drift) and (left := drift_left(found.bins, fit.residual, extent)):
        warnings.append(DRIFT_LEFT.format(left))
    if not fit.unmodelled < UNMODELLED * extent:
        size = f"{fit.unmodelled:.2g} arcsec"
        warnings.append(f"error beyond the declared orders, {size}: declare more of them, or it drifts")
    return warnings


def _reversal(up: SweepResult, down: SweepResult) -> Reversal | None:
    """Difference of the two directions at the angles that both have visited; None if there are none."""
    shared = np.intersect1d(np.rint(up.grid_turns * 1e6), np.rint(down.grid_turns * 1e6)) / 1e6
    if not len(shared):
        return None
    above, below = (each.fit.curve(shared) + each.fit.level.mean() for each in (up, down))
    apart = above - below
    return Reversal(float(apart.mean()), float(np.abs(apart - apart.mean()).max()))
