"""Greatest minus least of a fitted curve over the angles that were visited, without the part that noise adds to it.

Noise makes the range of a curve too large: the greatest value is looked for among values that err. The bias is
estimated by a parametric bootstrap: coefficients shrunk towards nothing as far as they are noise stand for the true
ones, and get noise as the fit says; by how much the range of their curves is greater, on the mean, is taken off.
The standard uncertainty is the spread of those ranges, WIDER because the correction repeats the noise of the
estimate, and a THIRD of the correction. Both numbers were found by simulation (tests/unit/test_measured.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.analysis.cells import Cells
from hdassist.analysis.tracefit import CHUNK, TraceFit, waves

DRAWS = 200
PER_PERIOD = 16  # points in a period of the highest order
GAP = 0.5  # periods of the highest order: what lies between readings further apart was not visited
WIDER = 1.15
THIRD = 1 / 3
SHRINK = 2.0  # times the power of noise, taken off the power of each order
CORRELATED = 1e3  # condition of the normal equations: beyond, orders cannot be shrunk one by one

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Range:
    """Range of a curve [arcsec]: as fitted, what noise has added to it, and the standard uncertainties of both."""

    fitted: float
    bias: float
    spread: float

    @property
    def value(self) -> float:
        """The range without the bias."""
        return self.fitted - self.bias

    @property
    def bias_uncertainty(self) -> float:
        """Standard uncertainty of the correction."""
        return THIRD * self.bias


def visited(cells: Cells, highest: float, cycle: int | None) -> Array:
    """Cam angles [turns] of a fine grid that lie between neighbouring readings, once in a cycle (None: no cycle)."""
    per_turn = PER_PERIOD * int(np.ceil(highest))
    found = []
    for index in range(int(cells.sweep[-1]) + 1):
        turns = cells.turns[cells.sweep == index]
        grid = np.arange(np.ceil(turns[0] * per_turn), np.floor(turns[-1] * per_turn) + 1)
        after = np.clip(np.searchsorted(turns, grid / per_turn), 1, len(turns) - 1)
        found.append(grid[turns[after] - turns[after - 1] <= GAP / highest])
    every = np.concatenate(found)
    if cycle is not None:
        every = np.mod(every, cycle * per_turn)
    return np.asarray(np.unique(every) / per_turn)


def range_of(fit: TraceFit, turns: Array, rng: np.random.Generator) -> Range:
    """Range of a fitted curve over angles [turns], shape (angles,), and its uncertainty."""
    best = _shrunk(fit)
    noise = fit.factor @ rng.standard_normal((fit.factor.shape[1], DRAWS))
    curves = np.concatenate([fit.coefficients[:, None], best[:, None], best[:, None] + noise], axis=1)
    high, low = np.full(curves.shape[1], -np.inf), np.full(curves.shape[1], np.inf)
    for start in range(0, len(turns), CHUNK):
        values = waves(turns[start : start + CHUNK], fit.orders) @ curves
        high, low = np.maximum(high, values.max(axis=0)), np.minimum(low, values.min(axis=0))
    fitted, without, drawn = high[0] - low[0], high[1] - low[1], (high - low)[2:]
    bias = max(0.0, float(drawn.mean() - without))
    return Range(float(fitted), bias, WIDER * float(drawn.std(ddof=1)))


def _shrunk(fit: TraceFit) -> Array:
    """Coefficients with each order made smaller by the share of noise in its power."""
    if fit.condition > CORRELATED:
        return fit.coefficients
    cosine, sine = fit.pair((fit.factor**2).sum(axis=1))
    keep = np.maximum(0.0, 1 - SHRINK * (cosine + sine) / np.maximum(fit.amplitude**2, 1e-300))
    return np.asarray(fit.coefficients * np.tile(keep, 2))
