"""Lag between the two encoders: one that is read later shows the way of its shaft in between as error.

A lag times the speed is an offset that changes sign with the direction and grows with the speed. At an even speed it is
part of the level, and F'_ior has no part of it; friction and play change the level with the direction too. So a lag is
known only where the speed changes within a sweep.
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
    """Lag [ms] of the output's reading behind the cam's, and its standard uncertainty."""

    ms: float
    uncertainty_ms: float


def speed_changes(bins: Bins) -> bool:
    """Whether the speed within the sweeps changes by enough to tell a lag."""
    apart = [bins.speed[own] - np.median(bins.speed[own]) for own in (bins.sweep == k for k in range(bins.sweeps))]
    low, high = np.quantile(np.concatenate(apart), (0.05, 0.95))  # a turning point alone tells no lag
    return float(high - low) / 2 > LEAST_SPEED_CHANGE * float(np.abs(bins.speed).mean())


def encoder_lag(fits: Sequence[TraceFit], ratio: float, sense: int) -> EncoderLag | None:
    """Lag by the fits of both directions; None where the speed does not change.

    Arguments: ratio, cam turns per output turn; sense, in which the two encoders count, 0 for a column of errors.
    """
    slopes = [fit.slopes["speed"] for fit in fits if "speed" in fit.slopes]
    if not slopes:
        return None
    size = 1e3 * ratio * (sense or 1) / ARCSEC_PER_TURN  # ms of a lag in arcsec s/turn of the cam
    values, spreads = np.array(slopes).T
    weight = 1 / np.maximum(spreads, 1e-12) ** 2
    return EncoderLag(float(size * np.average(values, weights=weight)), float(abs(size) / np.sqrt(weight.sum())))
