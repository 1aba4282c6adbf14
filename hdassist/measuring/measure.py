"""F'_ior, orders and coverage of a measured trace, each direction by itself."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import DataError, UntrustedError, UsageError
from hdassist.measuring.bins import Cells, cells_of, travel_of
from hdassist.measuring.coverage import coverage
from hdassist.measuring.cycle import Gearing, gearing_of
from hdassist.measuring.design_matrix import CELLS_PER_COLUMN
from hdassist.measuring.fit import TraceFit, fit
from hdassist.measuring.measurement import Direction, Measurement, Reversal
from hdassist.measuring.order_grid import DEFAULT, WHOLE, lines, parse_orders
from hdassist.measuring.orders import named
from hdassist.measuring.range import ranges_of, visited
from hdassist.measuring.uncertainty import COVERAGE_FACTOR, budget, combined
from hdassist.preset.fields import Drive
from hdassist.readers.sweeps import Sweep
from hdassist.readers.trace import MeasuredTrace

DRIFTS = {"none": 0, "linear": 1, "quadratic": 2}
Array = NDArray[np.float64]

SHORTEST = 1.0  # cam turns
PER_PERIOD = 2.5  # steps of the angle in a period of the highest order, at least
DRIFT_LEFT = "a linear drift of {:.3g} arcsec over the record is left in (--drift linear)"
DRIFTED = 0.05  # of F'_ior: a drift left in that is said


def measure(
    trace: MeasuredTrace,
    *,
    drive: Drive | None = None,
    ratio: float | None = None,
    orders: str | None = None,
    drift: str = "none",
    stated: Mapping[str, float] | None = None,
    seed: int = 0,
    together: bool = False,
) -> Measurement:
    """Look at a measured trace.

    Arguments: trace; drive or ratio, for cycle, coverage and beats with the output; orders per cam turn to which the
    error is limited, like "1-12" (None: these, or as far as the steps of the angle resolve them); drift, none, linear
    or quadratic, to take off; stated, standard uncertainties [arcsec] by source; seed of the bootstrap;
    together, both directions as one, which is then 0.
    Raises UsageError: a wrong argument; DataError: less than one cam turn in one direction; UntrustedError: orders that
    the record does not resolve, or an F'_ior that is not clear of its noise.
    """
    require_drift(drift)
    gearing = gearing_of(drive, ratio)
    notes, warnings = list(trace.notes), []
    found: list[Direction] = []
    for sign in (0,) if together else (1, -1):
        moves = [sweep for sweep in trace.sweeps if together or sweep.direction == sign]
        longest = max((abs(trace.cam_deg[s.stop - 1] - trace.cam_deg[s.start]) / 360 for s in moves), default=0.0)
        if longest < SHORTEST - 0.01:
            if moves:
                notes.append(f"{'growing' if sign > 0 else 'falling'} angles left out: {longest:.2g} of a cam turn")
            continue
        declared = _declared(trace, moves, orders, notes)
        cells = cells_of(trace, moves, declared[-1])
        result = _fit(cells, declared, gearing, DRIFTS[drift], notes)
        found.append(_direction(sign, trace, moves, cells, result, gearing, drive, stated or {}, seed))
        if drift == "none" and (left := drift_left(found[-1].cells, found[-1].fit.residual, found[-1].range.value)):
            warnings.append(DRIFT_LEFT.format(left))
        if not found[-1].fit.unmodelled < found[-1].range.value / 5:
            size = f"{found[-1].fit.unmodelled:.2g} arcsec"
            warnings.append(f"error beyond the declared orders, {size}: declare more of them, or it drifts")
    if not found:
        hint = "F'_ior is looked for over whole turns; is the angle that of the cam, and its unit right?"
        raise DataError(f"{trace.file}: less than one cam turn in one direction", hint)
    reversal = _reversal(found) if len(found) == 2 else None
    found.sort(key=lambda d: -d.range.value)
    return Measurement(
        trace, gearing, tuple(found), reversal, tuple(dict.fromkeys(notes)), tuple(dict.fromkeys(warnings)), seed
    )


def require_drift(kind: str) -> None:
    """Raise UsageError unless it is a kind of drift that can be taken off."""
    if kind not in DRIFTS:
        raise UsageError(f"--drift must be none, linear or quadratic, not {kind}")


def _declared(trace: MeasuredTrace, moves: list[Sweep], orders: str | None, notes: list[str]) -> tuple[float, ...]:
    """Declared orders, refused where the steps of the angle do not resolve them; the default ones cut instead."""
    declared = parse_orders(orders or DEFAULT)
    steps = np.concatenate([np.diff(trace.cam_deg[move.start : move.stop]) for move in moves]) / 360
    steps = np.abs(steps[steps != 0])
    highest = 1 / (PER_PERIOD * float(np.quantile(steps, 0.75)))
    if declared[-1] <= highest:
        return declared
    kept = tuple(order for order in declared if order <= highest)
    if orders is not None or not kept:
        message = f"steps of {360 * np.quantile(steps, 0.75):.3g} deg are too long for order {declared[-1]:g}"
        raise UntrustedError(f"{trace.file}: {message}", f"up to {highest:.2g} can be declared: --orders")
    notes.append(f"orders up to {kept[-1]:g} only: the steps of the angle resolve no more")
    return kept


def _fit(cells: Cells, declared: tuple[float, ...], gearing: Gearing | None, degree: int, notes: list[str]) -> TraceFit:
    """Fit with beats where the record resolves them and has cells enough, else without."""
    ratio = gearing.ratio if gearing else None
    with_beats, without = (lines(declared, cells.span, ratio, beats=beats) for beats in (True, False))
    if len(with_beats) > len(without) and len(cells) >= CELLS_PER_COLUMN * 2 * (2 * len(with_beats) + 4):
        try:
            return fit(cells, with_beats, degree)
        except UntrustedError:
            pass
    if len(without) < len(declared):
        notes.append(f"orders closer than 1/{cells.span:.3g} joined: the record does not tell them apart")
    notes.append("beats with the output are not resolved: each order stands for them too")
    return fit(cells, without, degree)


def _direction(
    sign: int,
    trace: MeasuredTrace,
    moves: list[Sweep],
    cells: Cells,
    result: TraceFit,
    gearing: Gearing | None,
    drive: Drive | None,
    stated: Mapping[str, float],
    seed: int,
) -> Direction:
    highest = float(result.orders[-1])
    cycle = gearing.cycle if gearing and cells.span >= WHOLE * gearing.ratio else None
    grid = visited(cells, highest, cycle)
    extent, revolution = ranges_of(result, grid, np.random.default_rng([seed, sign + 1]))
    scatter = float(np.sqrt(np.mean(cells.rows * result.residual**2)))
    sources = budget(extent.spread, extent.bias_uncertainty, result.unmodelled, trace.step_arcsec, scatter, stated)
    alone = combined(sources[:4])
    if not result.clear_of_noise or not extent.value > COVERAGE_FACTOR * alone:
        message = f"F'_ior of {max(extent.value, 0.0):.3g} arcsec is not clear of its noise, u = {alone:.3g} arcsec"
        drifts = not len(result.drift) and drift_left(cells, result.residual, 0.0)
        hint = "it drifts: --drift linear" if drifts else "record longer or with less noise; is it the right column?"
        raise UntrustedError(f"{trace.file}: {message}", hint)
    travel = travel_of(trace)
    raw = np.concatenate(
        [trace.error_arcsec[m.start : m.stop] - result.drift_at(travel[m.start : m.stop]) for m in moves]
    )
    visits = (
        coverage(np.concatenate([trace.cam_deg[m.start : m.stop] for m in moves]) / 360, gearing) if gearing else None
    )
    table = named(result, drive, gearing)
    return Direction(sign, cells, result, grid, extent, revolution, float(np.ptp(raw)), table, visits, sources)


def drift_left(cells: Cells, residual: Array, extent: float) -> float:
    """Linear drift [arcsec] over the record that residuals show clearly beside a range; 0 where there is none."""
    travel = cells.travel - cells.travel.mean()
    slope = float(travel @ residual) / float(travel @ travel)
    size = slope * float(np.ptp(travel))
    scatter = float(np.std(residual - slope * travel))
    error = scatter * float(np.sqrt(12 / (2 * cells.span)))  # of a straight line, residuals alike for half a turn
    return size if abs(size) > max(4 * error, DRIFTED * extent) else 0.0


def _reversal(found: list[Direction]) -> Reversal | None:
    """Difference of the two directions at the angles that both have visited; None if there are none."""
    up, down = found
    shared = np.intersect1d(np.rint(up.grid_turns * 1e6), np.rint(down.grid_turns * 1e6)) / 1e6
    if not len(shared):
        return None
    curves = [d.fit.curve(shared) + d.fit.level.mean() for d in found]
    apart = curves[0] - curves[1]
    return Reversal(float(apart.mean()), float(np.abs(apart - apart.mean()).max()))
