"""How many of very many values lie where, in little memory: quantiles, yields and how sure they are."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import expm1, inf, log

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from hdassist.model.geometry import Array

FINE = 1e-4  # a bin's width, as a share of the value: as exact as a quantile is told
LEAST, MOST = 1e-3, 1e7  # arcsec, of what is told apart
BINS = int(log(MOST / LEAST) / FINE) + 2
CONFIDENCE = 0.95


@dataclass
class Tally:
    """Values above zero, counted in bins of FINE of their size.

    count; total, their sum; least, greatest; bins, how many lie in each.
    """

    count: int = 0
    total: float = 0.0
    least: float = inf
    greatest: float = -inf
    bins: NDArray[np.int64] = field(default_factory=lambda: np.zeros(BINS, dtype=np.int64), repr=False)

    def add(self, value: float) -> None:
        """Count a value."""
        self.count += 1
        self.total += value
        self.least, self.greatest = min(self.least, value), max(self.greatest, value)
        self.bins[_bin(value)] += 1

    @property
    def mean(self) -> float:
        """Mean of the values."""
        return self.total / self.count

    def quantile(self, share: float) -> float:
        """Value that a share of the values lies at or below, to FINE of it."""
        place = int(np.searchsorted(np.cumsum(self.bins), max(share * self.count, 1), side="left"))
        middle = LEAST * (1 + expm1((place - 0.5) * FINE)) if place else 0.0
        return min(max(middle, self.least), self.greatest)

    def between(self, edges: Array) -> NDArray[np.int64]:
        """How many values lie between one edge and the next, to FINE of the edges."""
        whole = np.concatenate([[0], np.cumsum(self.bins)])
        return np.asarray(np.diff(whole[[_bin(float(edge)) for edge in edges]]))


def _bin(value: float) -> int:
    return 0 if value <= LEAST else min(1 + int(log(value / LEAST) / FINE), BINS - 1)


@dataclass(frozen=True)
class Share:
    """How many of some drives are good, and between what their share in a production lies, with 95 % confidence.

    Source of the bounds: Clopper and Pearson 1934, doi 10.1093/biomet/26.4.404. open_: drives of which nothing is
    known, which the lower bound takes as bad and the upper one as good.
    """

    good: int
    count: int
    open_: int = 0

    @property
    def share(self) -> float:
        """Share of the good ones among those that are known."""
        return self.good / self.count if self.count else 0.0

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and greatest share of good ones in the production."""
        n = self.count + self.open_
        if not n:
            return 0.0, 1.0
        low = binomtest(self.good, n).proportion_ci(CONFIDENCE, method="exact").low
        high = binomtest(self.good + self.open_, n).proportion_ci(CONFIDENCE, method="exact").high
        return float(low), float(high)
