"""Autocorrelation of the noise.

Residuals of a recording are seldom white: the test rig creeps, bearings hum, counters round. An ARMA(1,1) process of
the blocks along a run describes a white part and a part that decays:

    n_i = rho n_(i-1) + u_i + theta u_(i-1),   0 <= rho < 1,   -rho <= theta <= 0,   u white.                  (R4)

Its correlations at lags 1 and 2 determine both coefficients:

    r_2 / r_1 = rho,   r_1 = (1 + rho theta) (rho + theta) / (1 + 2 rho theta + theta^2).                      (R5)

Whitening applies u_i = n_i - rho n_(i-1) - theta u_(i-1) to the errors and to every column of the design. It restarts
in each run.

The noise model must not absorb the signal, because noise with a long correlation resembles a wave that the model lacks.
Three rules prevent this. The correlation is estimated only once, from the residuals of a fit that assumes white noise,
so that it never competes with a wave of the model. Correlations within 3 standard errors count as 0. The decay length
is at most half an input revolution, so that the main orders (2 and its multiples) always exceed the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.model.geometry import Array

_Indices = NDArray[np.int64]
_CHANCE_SIGMAS = 3.0  # number of standard errors within which a correlation counts as 0
_LEAST_RHO = 0.1  # smallest rho of correlated noise
_LONGEST_DECAY_REV = 0.5  # longest decay of the correlation, in input revolutions
_THETA_STEPS = 400  # number of values of theta that are compared


@dataclass(frozen=True)
class NoiseMemory:
    """The two coefficients rho and theta of (R4), both 0 for white noise."""

    rho: float = 0.0
    theta: float = 0.0

    @property
    def gain(self) -> float:
        """The rms of the noise divided by that of its white part."""
        variance = (1 + 2 * self.rho * self.theta + self.theta**2) / (1 - self.rho**2)
        return float(np.sqrt(variance))


WHITE = NoiseMemory()


def memory_of(
    residual: Array,
    run: _Indices,
    blocks_per_rev: float,
) -> NoiseMemory:
    """Return the coefficients of the noise from the autocorrelation of residuals (R5).

    residual: residual of each block [arcsec], shape (blocks,).
    run: number of the run of each block, ascending, shape (blocks,).
    blocks_per_rev: blocks per input revolution.
    """
    at_lag = [_covariance(residual, run, lag) for lag in (0, 1, 2)]
    if not at_lag[0]:
        return WHITE
    first = at_lag[1] / at_lag[0]
    if first < _CHANCE_SIGMAS / np.sqrt(len(residual)):
        return WHITE
    largest = float(np.exp(-1 / (_LONGEST_DECAY_REV * blocks_per_rev)))
    rho = float(np.clip(at_lag[2] / at_lag[1], min(_LEAST_RHO, largest), largest))
    thetas = np.linspace(-rho, 0.0, _THETA_STEPS)
    firsts = (1 + rho * thetas) * (rho + thetas) / (1 + 2 * rho * thetas + thetas**2)
    return NoiseMemory(rho=rho, theta=float(thetas[np.argmin(np.abs(firsts - first))]))


def _covariance(
    residual: Array,
    run: _Indices,
    lag: int,
) -> float:
    """Return the mean product of residuals `lag` blocks apart within a run, or 0 if no run is longer than the lag."""
    same = run[lag:] == run[: len(run) - lag]
    products = (residual[lag:] * residual[: len(residual) - lag])[same]
    return float(products.mean()) if len(products) else 0.0


def whitened(
    values: Array,
    run: _Indices,
    memory: NoiseMemory,
) -> Array:
    """Return whitened values, with the correlation (R4) removed run by run.

    values: errors or columns at each block, shape (blocks, ...).
    run: number of the run of each block, ascending, shape (blocks,).
    memory: coefficients of the noise.
    """
    if memory == WHITE:
        return values
    white = np.array(values, order="C")  # C order, so that rows are contiguous
    for block in np.flatnonzero(np.diff(run) == 0) + 1:  # scipy.signal has this filter but takes a second to import
        white[block] = values[block] - memory.rho * values[block - 1] - memory.theta * white[block - 1]
    return white
