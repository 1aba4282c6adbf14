"""Least squares of a measured trace at given orders, on the angles as they were recorded, and how sure it is.

error = level of the sweep + drift + sum of a cos(2 pi f x) + b sin(2 pi f x). The coefficients are as uncertain as
those of independent residuals, widened by the noise floor of the residuals at each order, or, in records too short for
that, by the number of neighbours that err together: the integrated autocorrelation. What of the residuals goes on
from one cell to the next is no noise of reading but error beyond the given orders, or slow: its size is kept as
`unmodelled`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.measuring.bins import Cells
from hdassist.measuring.design_matrix import CHUNK, Design, waves
from hdassist.measuring.noise import noise_floor

LAGS = 2000
CLEAR = 4.0  # standard deviations of the power of noise

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TraceFit:
    """Coefficients of a trace.

    orders: per cam turn, shape (lines,); coefficients: of the cosines, then of the sines [arcsec], shape (2 lines,);
    factor: shape (2 lines, 2 lines + others), whose product with unit noise is an error of the coefficients; level:
    shape (sweeps,); drift: of t, t^2, shape (degree,), t = travel / reach; residual: shape (cells,). correlated: cells
    that err together; unmodelled: size of what is no noise of reading [arcsec]; condition: of the normal equations.
    """

    orders: Array
    coefficients: Array
    factor: Array
    level: Array
    drift: Array
    reach: float
    residual: Array
    correlated: float
    unmodelled: float
    condition: float

    @property
    def amplitude(self) -> Array:
        """Amplitude of each order [arcsec]."""
        return np.hypot(*self.pair(self.coefficients))

    @property
    def amplitude_uncertainty(self) -> Array:
        """Standard uncertainty of the amplitudes [arcsec], along their phase."""
        a, b = self.pair(self.coefficients)
        size = np.maximum(np.hypot(a, b), 1e-300)
        count = len(self.orders)
        along = (a / size)[:, None] * self.factor[:count] + (b / size)[:, None] * self.factor[count:]
        return np.asarray(np.sqrt((along**2).sum(axis=1)))

    def curve(self, turns: Array) -> Array:
        """The curve [arcsec] at cam angles [turns], without levels and drift."""
        parts = range(0, len(turns), CHUNK)
        return np.concatenate([waves(turns[k : k + CHUNK], self.orders) @ self.coefficients for k in parts])

    @property
    def clear_of_noise(self) -> bool:
        """Whether the orders together have more power than noise alone would leave in them, but once in thousands."""
        cosine, sine = self.pair((self.factor**2).sum(axis=1))
        power = float((2 * self.amplitude**2 / np.maximum(cosine + sine, 1e-300)).sum())
        freedom = 2 * len(self.orders)
        return power > freedom + CLEAR * float(np.sqrt(2 * freedom))

    def pair(self, values: Array) -> tuple[Array, Array]:
        """Cosine and sine parts."""
        return values[: len(self.orders)], values[len(self.orders) :]

    def drift_at(self, travel: Array) -> Array:
        """Drift that was taken off [arcsec] after so much travel [turns]."""
        return sum((c * (travel / self.reach) ** (k + 1) for k, c in enumerate(self.drift)), np.zeros(len(travel)))


def fit(cells: Cells, orders: Array, degree: int = 0) -> TraceFit:
    """Fit the orders, a level of each sweep, and a drift of a degree (0: none) to the cells of a trace.

    Raises UntrustedError: too few cells, or angles at which the orders cannot be told apart.
    """
    design = Design(cells, orders, degree)
    solution = design.solution()
    residual, columns = design.residual(solution), design.columns
    variance = float((cells.weight * residual**2).sum()) / (len(cells) - columns)
    correlated, unmodelled = _memory(residual, variance, columns, float(orders[-1]), cells)
    count, sweeps = 2 * len(orders), int(cells.sweep[-1]) + 1
    floor = noise_floor(cells, residual, orders, variance)
    wide = np.full(count, correlated) if floor is None else np.tile(floor, 2)
    return TraceFit(
        orders,
        solution[:count],
        design.root[:count] * np.sqrt(variance * wide)[:, None],
        solution[count : count + sweeps],
        solution[count + sweeps :],
        design.reach,
        residual,
        correlated,
        unmodelled,
        design.condition,
    )


def _memory(residual: Array, variance: float, columns: int, highest: float, cells: Cells) -> tuple[float, float]:
    """How many cells err together, and the size of what goes on from cell to cell [arcsec]."""
    size = len(residual)
    if not variance:
        return 1.0, 0.0
    padded = np.fft.rfft(residual, 2 * size)
    products = np.fft.irfft(np.abs(padded) ** 2)[: min(LAGS, size // 4)] / size
    rho = products / products[0] + columns / size  # the fit takes as much of the noise's own likeness away
    below = np.flatnonzero(rho[1:] < 2 / np.sqrt(size))
    last = int(below[0]) if len(below) else len(rho) - 1
    correlated = 1 + 2 * float(rho[1 : last + 1].sum())
    near = (np.diff(cells.turns) < 0.25 / highest) & (np.diff(cells.sweep) == 0)
    if near.sum() < size / 5:
        return correlated, 0.0
    following = float((residual[1:] * residual[:-1])[near].mean()) + variance * columns / size
    clear = following > 2 * variance / np.sqrt(near.sum())
    return correlated, float(np.sqrt(following)) if clear else 0.0
