"""Lines of a trace that are none of its orders: ball passes, cages, what hums on the rig.

A line that is left out makes the range too small, never too large. So the residuals of the fit are searched for lines,
the strongest first, and each is taken into the fit with an order of its own, until none is significant: its power over
the mean of its neighbours has to be one that noise alone brings once in 1/FALSE_ALARM records. For power of noise that
is even over the neighbourhood that ratio has an F distribution with 2 and 2 m degrees of freedom, m places told apart.
Slow noise is not even but falls with the order: the side of the neighbours counts that makes the line less significant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import UntrustedError
from hdassist.measuring.bins import Bins
from hdassist.measuring.fit import BINS_PER_COLUMN, TraceFit, distance, fit_orders, residual_power
from hdassist.model.geometry import Array

FALSE_ALARM = 0.01  # of a record without lines
PROBED = 2.5  # places probed, over those that the record tells apart: a peak between them is found too
NEIGHBOURHOOD = 32  # places told apart, on each side, that stand for the noise
FEWEST = 2  # of them
OWN = 1.5  # of the resolution, to either side: the line's own peak
APART = 0.75  # of the resolution: nearer to an order a line is that order
LOWEST = 3.0  # periods in the record: below, it drifts
HIGHEST = 4.0  # times the highest order: beyond, averages over bins make lines smaller
SMALLEST = 0.01  # of the greatest amplitude: a smaller line is left in the noise
MOST = 8  # lines
ROUNDS = 2  # of Gauss and Newton for the order of a line


@dataclass(frozen=True)
class Peak:
    """A peak of the residuals: its order per cam turn, amplitude [arcsec], and how often noise has such a one."""

    order: float
    amplitude: float
    chance: float


def with_lines(fit: TraceFit, orders: Array, degree: int, finest: float) -> TraceFit:
    """A fit with the significant lines of its residuals; finest: the highest order that the readings resolve."""
    bins = fit.design.bins
    while len(fit.lines) < MOST and len(bins) >= BINS_PER_COLUMN * (fit.design.columns + 2):
        peak = highest_peak(fit, min(finest, HIGHEST * float(orders[-1])))
        if peak is None or peak.chance > FALSE_ALARM or peak.amplitude < SMALLEST * fit.amplitude.max():
            break
        try:
            fit = _settled(bins, orders, degree, np.append(fit.lines, peak.order))
        except UntrustedError:  # too near to what was fitted
            break
    return fit


def highest_peak(fit: TraceFit, highest: float) -> Peak | None:
    """The peak of the residuals, up to an order, that stands out most from its neighbours; None: there is no room."""
    bins = fit.design.bins
    variance = float((bins.weight * fit.residual**2).mean())
    if not variance:
        return None
    probes, power = residual_power(bins, fit.residual, variance)
    told = 1 / bins.span
    free = (distance(probes, fit.orders) >= APART * told) & (probes <= highest)
    probes, power = probes[free], power[free]
    if not len(probes):
        return None
    each = bins.per_turn * bins.span / len(free) / 2  # places told apart, for each probe
    total = np.concatenate([[0.0], np.cumsum(power)])
    reach, at = max(1, int(NEIGHBOURHOOD / each)), np.arange(len(probes))
    below, above = np.searchsorted(probes, probes - OWN * told), np.searchsorted(probes, probes + OWN * told)
    sides = ((np.maximum(at - reach, 0), below), (above, np.minimum(at + reach, len(probes))))
    tail = np.max([_tail(power, total, first, last, each) for first, last in sides], axis=0)
    known = probes >= LOWEST * told
    if not known.any():
        return None
    best = int(np.where(known, tail, np.inf).argmin())
    chance = PROBED * len(probes) * each * float(np.exp(tail[best]))
    amplitude = 2 * np.sqrt(power[best] * variance * float((bins.weight**2).sum())) / float(bins.weight.sum())
    return Peak(float(probes[best]), float(amplitude), chance)


def _tail(power: Array, total: Array, first: NDArray[np.int64], last: NDArray[np.int64], each: float) -> Array:
    """Logarithm of the chance that noise has such a power over the mean of the neighbours from first to last.

    total: running sums of the power; each: places told apart, for each neighbour. 0 where there are none.
    """
    count = np.maximum(last - first, 0)
    mean = (total[np.maximum(first, last)] - total[first]) / np.maximum(count, 1)
    places = count * each
    ratio = power / np.maximum(mean * places, 1e-300)
    return np.asarray(np.where(places >= FEWEST, -places * np.log1p(ratio), 0.0))


def _settled(bins: Bins, orders: Array, degree: int, lines: Array) -> TraceFit:
    """A fit of orders and lines, the orders of the lines moved to where they fit best."""
    fit = fit_orders(bins, orders, degree, lines)
    centre, reach = float(bins.turns.mean()), 0.5 / bins.span
    for _ in range(ROUNDS):
        place = np.searchsorted(fit.orders, fit.lines)
        a, b = (part[place] for part in fit.pair(fit.coefficients))
        phase = (2 * np.pi) * bins.turns[:, None] * fit.lines
        slopes = (2 * np.pi) * (bins.turns - centre)[:, None] * (b * np.cos(phase) - a * np.sin(phase))
        own = fit.design.rest(slopes)
        weighted = own * bins.weight[:, None]
        step = np.linalg.lstsq(weighted.T @ own, weighted.T @ fit.residual, rcond=None)[0]
        fit = fit_orders(bins, orders, degree, fit.lines + np.clip(step, -reach, reach))
    return fit
