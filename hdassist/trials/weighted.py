"""Small tools for weighted values."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from hdassist.model.geometry import Array

ROUNDING = 1e-9
DEEP = 0.5  # of a peak: a valley that parts it from a higher one goes so far down


def quantile(values: Array, weight: Array, level: float) -> float:
    """Least of the values that holds at least so much of the weight with those below it."""
    order = np.argsort(values)
    place = np.searchsorted(np.cumsum(weight[order]), min(level, 1 - ROUNDING) * weight.sum())
    return float(values[order[min(int(place), len(order) - 1)]])


def hills(marginal: Array) -> list[NDArray[np.int64]]:
    """Parts of a circle around each peak of a density, from valley to valley; shallow valleys part nothing."""
    count = len(marginal)
    smooth = np.mean([np.roll(marginal, k) for k in (-1, 0, 1)], axis=0)
    start = int(np.argmin(smooth))
    line = np.append(np.roll(smooth, -start), smooth[start])
    peaks, about = find_peaks(line, prominence=0)
    peaks = peaks[about["prominences"] >= DEEP * line[peaks]]
    valleys = [a + int(np.argmin(line[a:b])) for a, b in pairwise(peaks)]
    return [(part + start) % count for part in np.split(np.arange(count), valleys)]


def picked(weight: Array, count: int) -> NDArray[np.int64]:
    """Places of so many evenly spread draws, each as often as it weighs; weight sums to 1."""
    places = np.searchsorted(np.cumsum(weight), (np.arange(count) + 0.5) / count)
    return np.minimum(places, len(weight) - 1)
