"""Lag between the two encoders: one that is read later shows the way of its shaft in between as error.

A lag times the speed is an offset that changes sign with the direction and grows with the speed. At an even speed it is
part of the level, and F'_ior has nothing of it; friction and play change the level with the direction too. So a lag is
told only by a speed that changes, within the sweeps or from sweep to sweep.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hdassist.measuring.bins import Bins
from hdassist.measuring.fit import TraceFit

LEAST_SPEED_CHANGE = 0.02  # of the speed: within sweeps, from which on a lag is fitted
ARCSEC_PER_TURN = 1296000.0


@dataclass(frozen=True)
class EncoderLag:
    """Lag [ms] of the output's reading behind the cam's, and its standard uncertainty; None where it is not told.

    bound_ms: of that which is not told, the greatest that the difference of both directions leaves room for.
    """

    ms: float | None
    uncertainty_ms: float | None
    bound_ms: float | None = None


def speed_changes(bins: Bins) -> bool:
    """Whether the speed within the sweeps changes by enough to tell a lag."""
    apart = [bins.speed[own] - np.median(bins.speed[own]) for own in (bins.sweep == k for k in range(bins.sweeps))]
    low, high = np.quantile(np.concatenate(apart), (0.05, 0.95))  # a turning point alone tells no lag
    return float(high - low) / 2 > LEAST_SPEED_CHANGE * float(np.abs(bins.speed).mean())


def encoder_lag(fits: Sequence[TraceFit], ratio: float, sense: int) -> EncoderLag:
    """Lag by the fits of both directions: within the sweeps, else from sweep to sweep.

    Arguments: ratio, cam turns per output turn; sense, in which the two encoders count, 0 for a column of errors.
    """
    size = 1e3 * ratio * (sense or 1) / ARCSEC_PER_TURN  # ms of a lag in arcsec s/turn of the cam
    if told := [fit.slopes["speed"] for fit in fits if "speed" in fit.slopes]:
        values, spreads = np.array(told).T
        weight = 1 / np.maximum(spreads, 1e-12) ** 2
        return EncoderLag(float(size * (weight @ values) / weight.sum()), float(abs(size) / np.sqrt(weight.sum())))
    bins = [fit.design.bins for fit in fits]
    levels = np.concatenate([fit.level for fit in fits])
    speeds = np.array([own.speed[own.sweep == k].mean() for own in bins for k in range(own.sweeps)])
    ways = np.concatenate([np.full(own.sweeps, k) for k, own in enumerate(bins)])
    columns = np.column_stack([*(ways == k for k in range(len(fits))), speeds]).astype(float)
    uneven = max(float(np.ptp(speeds[ways == k])) for k in range(len(fits)))
    freedom = len(levels) - columns.shape[1]
    if freedom > 0 and uneven > LEAST_SPEED_CHANGE * float(np.abs(speeds).max()):
        solution, *_ = np.linalg.lstsq(columns, levels, rcond=None)
        variance = float(((levels - columns @ solution) ** 2).sum()) / freedom
        spread = np.sqrt(variance * np.linalg.inv(columns.T @ columns)[-1, -1])
        return EncoderLag(float(size * solution[-1]), float(abs(size) * spread))
    if len(fits) == 1:
        return EncoderLag(None, None)
    apart, faster = (values[ways == 0].mean() - values[ways == 1].mean() for values in (levels, speeds))
    return EncoderLag(None, None, float(abs(size * apart / faster)))
