"""Quantities of approached positions defined by ISO 230-2: reversal value, repeatability and accuracy of positioning.

At position i the deviations of the approaches from side s have the mean x_is and the sample standard deviation s_is.
Forward is the side 1 (+), backward the side -1 (-):

    B_i = x_i+ - x_i-,   B = max |B_i|,   B_mean = mean of B_i                                        (1)
    M   = range over i of (x_i+ + x_i-) / 2                                                           (2)
    E_s = range over i of x_is,   E = range over i and s of x_is                                      (3)
    R_s = max over i of 4 s_is,   R = max over i of max(2 s_i+ + 2 s_i- + |B_i|, R_i+, R_i-)          (4)
    A_s = max over i of (x_is + 2 s_is) - min over i of (x_is - 2 s_is);   A: over i and s            (5)

Source: ISO 230-2:2014, clause 2. The standard requires five approaches from each side, and adds no measurement
uncertainty to these quantities. Here any number of approaches is allowed, and is part of the result.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.model.geometry import Array
from hdassist.features.measuring.bench import PositionRecord

_FORWARD = 1.0
_BACKWARD = -1.0
FEWEST_APPROACHES = 5  # number of approaches of each position from each side that the standard requires
_SIDES = 2
_FEWEST_FOR_SCATTER = 2  # minimum number of approaches for a sample standard deviation


@dataclass(frozen=True)
class _PositioningFigure:
    """A quantity of ISO 230-2: symbol, name and value [arcsec]."""

    symbol: str
    words: str
    arcsec: float


@dataclass(frozen=True)
class PositioningTest:
    """Quantities of approached positions according to ISO 230-2.

    figures: the quantities that the approaches determine.
    positions: number of positions.
    approaches: smallest number of approaches of any position from any side that occurs.
    reversal_uncertainty_arcsec: standard uncertainty of the mean reversal value due to the scatter of the approaches,
    None if the scatter is unknown.
    """

    figures: tuple[_PositioningFigure, ...]
    positions: int
    approaches: int
    reversal_uncertainty_arcsec: float | None

    @property
    def is_complete(self) -> bool:
        """Whether there are as many approaches as the standard requires."""
        return self.approaches >= FEWEST_APPROACHES

    def figure(self, symbol: str) -> _PositioningFigure | None:
        """Return the quantity with a symbol, or None if the approaches do not determine it."""
        return next((figure for figure in self.figures if figure.symbol == symbol), None)


@dataclass(frozen=True, eq=False)
class _SideStatistics:
    """Statistics of the approaches from one side, in arrays of shape (positions,).

    mean: mean deviation [arcsec].
    deviation: sample standard deviation [arcsec], NaN for a single approach.
    count: number of approaches.
    """

    mean: Array
    deviation: Array
    count: Array

    @property
    def has_scatter(self) -> bool:
        """Whether every position was approached often enough for a standard deviation."""
        return bool((self.count >= _FEWEST_FOR_SCATTER).all())

    @property
    def low(self) -> Array:
        """The mean minus two standard deviations [arcsec], shape (positions,)."""
        return self.mean - 2 * self.deviation

    @property
    def high(self) -> Array:
        """The mean plus two standard deviations [arcsec], shape (positions,)."""
        return self.mean + 2 * self.deviation


def positioning_test(record: PositionRecord) -> PositioningTest | None:
    """Return the quantities of ISO 230-2 that approached positions determine, or None if they determine none.

    Bidirectional quantities require that each position was approached from both sides. Quantities with a standard
    deviation require two approaches of every position from each side that occurs.
    """
    numbers = record.position_numbers()
    count = int(numbers.max()) + 1
    sides = {}
    # forward means approached with increasing angles
    for side in (_FORWARD, _BACKWARD):
        statistics = _side_statistics(numbers, record.deviation_arcsec, record.side == side, count)
        if statistics is not None:
            sides[side] = statistics
    figures = []
    for side, statistics in sides.items():
        figures += _one_sided(statistics, "+" if side == _FORWARD else "-")
    uncertainty = None
    # bidirectional quantities require approaches of every position from both sides
    if len(sides) == _SIDES:
        figures += _two_sided(sides[_FORWARD], sides[_BACKWARD])
        uncertainty = _reversal_uncertainty(sides[_FORWARD], sides[_BACKWARD])
    if not figures:
        return None
    approaches = min(int(statistics.count.min()) for statistics in sides.values())
    return PositioningTest(
        figures=tuple(figures), positions=count, approaches=approaches, reversal_uncertainty_arcsec=uncertainty
    )


def _side_statistics(
    numbers: NDArray[np.int64],
    deviation_arcsec: Array,
    is_side: Array,
    count: int,
) -> _SideStatistics | None:
    """Return the statistics of the approaches from one side, or None if a position has no approach from it.

    numbers: position number of each approach, from 0, shape (rows,).
    deviation_arcsec: deviations, shape (rows,).
    is_side: whether each approach was from this side, shape (rows,).
    count: number of positions.
    """
    means = np.empty(count)
    deviations = np.empty(count)
    counts = np.empty(count)
    for number in range(count):
        approaches = deviation_arcsec[is_side & (numbers == number)]
        if not len(approaches):
            return None
        counts[number] = len(approaches)
        # mean deviation of a position from one side, and its sample standard deviation
        means[number] = approaches.mean()
        deviations[number] = approaches.std(ddof=1) if len(approaches) > 1 else np.nan
    return _SideStatistics(means, deviations, counts)


def _one_sided(side: _SideStatistics, sign: str) -> list[_PositioningFigure]:
    """Return the unidirectional quantities by (3) to (5), or only the repeatability if there is one position."""
    way = "forward" if sign == "+" else "backward"
    figures = []
    if len(side.mean) > 1:
        figures.append(_PositioningFigure(f"E{sign}", f"systematic positioning error, {way}", float(np.ptp(side.mean))))
    # a single approach has no standard deviation
    if side.has_scatter:
        # R = 4 s at the worst position
        repeatability = float(4 * side.deviation.max())
        figures.append(_PositioningFigure(f"R{sign}", f"positioning repeatability, {way}", repeatability))
        if len(side.mean) > 1:
            accuracy = float(side.high.max() - side.low.min())
            figures.append(_PositioningFigure(f"A{sign}", f"positioning accuracy, {way}", accuracy))
    return figures


def _two_sided(forward: _SideStatistics, backward: _SideStatistics) -> list[_PositioningFigure]:
    """Return the bidirectional quantities by (1) to (5), or only B and R for a single position."""
    # reversal value of each position
    reversal = forward.mean - backward.mean
    figures = [
        _PositioningFigure("B", "largest reversal value", float(np.abs(reversal).max())),
        _PositioningFigure("B_mean", "mean reversal value, forward minus backward", float(reversal.mean())),
    ]
    is_several = len(reversal) > 1
    if is_several:
        centre = (forward.mean + backward.mean) / 2
        means = np.concatenate([forward.mean, backward.mean])
        figures.append(_PositioningFigure("M", "mean bidirectional positioning error", float(np.ptp(centre))))
        figures.append(_PositioningFigure("E", "bidirectional systematic positioning error", float(np.ptp(means))))
    if forward.has_scatter and backward.has_scatter:
        two_sided = 2 * forward.deviation + 2 * backward.deviation + np.abs(reversal)
        one_sided = 4 * np.maximum(forward.deviation, backward.deviation)
        figures.append(
            _PositioningFigure(
                "R", "bidirectional positioning repeatability", float(np.maximum(two_sided, one_sided).max())
            )
        )
        if is_several:
            high = max(forward.high.max(), backward.high.max())
            low = min(forward.low.min(), backward.low.min())
            figures.append(_PositioningFigure("A", "bidirectional positioning accuracy", float(high - low)))
    return figures


def _reversal_uncertainty(forward: _SideStatistics, backward: _SideStatistics) -> float | None:
    """Return the standard uncertainty of the mean reversal value from the pooled scatter [arcsec].

    The result is None if no approach was repeated.
    """
    counts = np.concatenate([forward.count, backward.count])
    freedom = float((counts - 1).sum())
    if not freedom:
        return None
    deviations = np.nan_to_num(np.concatenate([forward.deviation, backward.deviation]))
    pooled_variance = float(((counts - 1) * deviations**2).sum()) / freedom
    return float(np.sqrt(pooled_variance * (1 / counts).sum())) / len(forward.mean)
