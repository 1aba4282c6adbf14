"""Noise at each order of a trace, read off the spectrum of the residuals beside the orders that were fitted.

Residuals of a real trace are not white: slow ones weigh on low orders more than on high ones. Their power halfway
between fitted orders, and on both sides of a group of them, stands for the power of the noise at the orders.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hdassist.measuring.bins import PER_PERIOD, Cells

SHORTEST = 2.0  # cam turns: below, there is no room between the orders
APART = 0.75  # of the resolution: how far from fitted orders the noise is read
AROUND = 0.5  # orders to either side
FEWEST = 8  # places, nearest to the order

Array = NDArray[np.float64]


def noise_floor(cells: Cells, residual: Array, orders: Array, variance: float) -> Array | None:
    """Power of the noise at each order, over that of independent residuals of the same variance, shape (lines,).

    Arguments: residual, shape (cells,) [arcsec]; variance, of the residuals at weight 1. None: the record is too short.
    """
    if cells.span < SHORTEST or not variance:
        return None
    density = PER_PERIOD * float(orders[-1])
    places = np.floor(cells.turns * density).astype(np.int64)
    sizes = [int(np.ptp(places[cells.sweep == k])) + 1 for k in range(int(cells.sweep[-1]) + 1)]
    length = 1 << int(np.ceil(np.log2(2 * max(sizes))))
    power = np.zeros(length // 2 + 1)
    for index, size in enumerate(sizes):
        own = cells.sweep == index
        line = np.zeros(size)
        line[places[own] - places[own].min()] = (cells.weight * residual)[own]
        power += np.abs(np.fft.rfft(line, length)) ** 2
    power /= float((cells.weight**2).sum()) * variance
    probes = np.arange(len(power)) * density / length
    after = np.clip(np.searchsorted(orders, probes), 1, max(len(orders) - 1, 1))
    near = np.minimum(np.abs(probes - orders[after - 1]), np.abs(probes - orders[np.minimum(after, len(orders) - 1)]))
    free = (near >= APART / cells.span) & (probes > 0) & (probes <= orders[-1] + 1)
    probes, power = probes[free], power[free]
    if len(probes) < FEWEST:
        return None
    total = np.concatenate([[0.0], np.cumsum(power)])
    first, last = np.searchsorted(probes, orders - AROUND), np.searchsorted(probes, orders + AROUND)
    few = last - first < FEWEST
    middle = np.clip(np.searchsorted(probes, orders) - FEWEST // 2, 0, len(probes) - FEWEST)
    first, last = np.where(few, middle, first), np.where(few, middle + FEWEST, last)
    return np.asarray((total[last] - total[first]) / (last - first))
