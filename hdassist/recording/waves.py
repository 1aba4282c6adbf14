"""Waves on the torus and their design matrix.

The error is a smooth function of both angles, so it is a Fourier series on their torus:

    e(phi, psi) = sum over (k, j) of a_kj cos 2 pi (k phi + j psi) + b_kj sin 2 pi (k phi + j psi).            (R2)

k counts periods per input revolution (the orders), j periods per output revolution (the sidebands of an order). The
waves with k = 0, j > 0 are those of the output; the two waves (k, +-k) are those of a part that turns with the other
wheel. Along the cycle (R1) the wave (k, j) has k p + j q periods, so that a fast Fourier transform of the amplitudes
gives the curve over the whole cycle.

Readings are averaged over blocks of consecutive readings of a run, the columns of the design as well as the errors:

    y_B = mean over B of y,   X_B = mean over B of x.                                                          (R3)

An average of both sides of a linear equation is exact, so averaging damps no wave.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from hdassist.model.geometry import Array
from hdassist.recording.positions import OrderedReadings

_Indices = NDArray[np.int64]
BLOCKS_PER_REV = 80  # of the input, at most
CURVE_POINTS_PER_REV = 240  # of the input: 3 a period of the highest order, between which a parabola finds the peak
# Orders that are open whatever the sampling. Coarse readings show a higher order as a lower one (its image) or not at
# all, so they do not exclude it. Solved drives have 3 % of the power of their error above order 16.
ALWAYS_ORDER = 16
_SIDEBAND_ORDER = 20  # the highest order with sidebands
_HIGHEST_ORDER = 36  # of the odd orders
# Teeth that differ give even orders (two zones mesh) up to half the number of teeth of a wheel, 1 + ratio. Their waves
# turn with either wheel, with one sideband on each side: with them the range of solved drives is 97 +- 2.6 % of the
# true one, without them 90 +- 8 %.
_HIGHEST_FINE_ORDER = 80
_POINTS_PER_PERIOD = 2.2  # blocks for each period of the highest order
USUAL_SIDEBANDS = 6  # on each side of an order
_VISITED_REV = 0.009  # of the input: a place with a reading within this distance on either side is visited
_PHASE_POINTS_PER_REV = 1024  # of the input: places for the phases of two waves
_SAME_READINGS = 0.9  # agreement of phases from which two waves have the same readings
_CHUNK = 512  # rows whose columns are computed at once: they stay in the processor's cache


def wave_pairs(
    cycle: Fraction,
    blocks_per_rev: float,
    more_sidebands: int = 0,
    more_pairs: Sequence[tuple[int, int]] = (),
) -> _Indices:
    """Return the waves (k, j) of the model, shape (waves, 2), sorted.

    cycle: ratio in lowest terms.
    blocks_per_rev: blocks of readings in an input revolution.
    more_sidebands: sidebands on each side beyond the usual 6.
    more_pairs: further waves (k, j) that the readings show.
    """
    ratio = float(cycle)
    sidebands = min(USUAL_SIDEBANDS + more_sidebands, max(1, int(ratio // 2)))
    resolved = blocks_per_rev / _POINTS_PER_PERIOD
    highest_beside = int(np.clip(resolved, ALWAYS_ORDER, _SIDEBAND_ORDER))
    highest = int(np.clip(resolved, ALWAYS_ORDER, _HIGHEST_ORDER))
    pairs = {(0, j) for j in range(1, sidebands + 1)}
    for k in range(1, highest_beside + 1):
        pairs |= {(k, j) for j in range(-sidebands, sidebands + 1)}
    for k in range(1, highest + 1):
        pairs.add((k, 0))
        if 2 * k < ratio:
            pairs |= {(k, k), (k, -k)}
    pairs |= set(more_pairs)
    return np.array(sorted(pairs | _fine_pairs(cycle, pairs)))


def _fine_pairs(cycle: Fraction, others: set[tuple[int, int]]) -> set[tuple[int, int]]:
    """Return the waves of teeth that differ, from the highest order that is always open on, without other waves.

    Two waves with equally many periods in a cycle are one wave, which is left out if it is among the others.
    """
    periods = {k * cycle.numerator + j * cycle.denominator for k, j in others}
    highest = min(_HIGHEST_FINE_ORDER, int(cycle) + 1)
    fine: set[tuple[int, int]] = set()
    for k in range(ALWAYS_ORDER + 2, highest + 1, 2):
        for j in (0, -1, 1, k, k - 1, k + 1, -k, -k - 1, -k + 1):
            period = k * cycle.numerator + j * cycle.denominator
            if period not in periods:
                periods.add(period)
                fine.add((k, j))
    return fine


def distinct_pairs(pairs: _Indices, place_rev: Array, cycle: Fraction) -> _Indices:
    """Return the waves without high orders that have the same readings as a lower one, shape (waves, 2).

    At even readings a wave with m periods in a cycle has the same readings as one with m' periods if all phases
    (m - m') t / p, or all (m + m') t / p, agree. The readings cannot tell the two apart, and the lower order is the
    likelier one. The level of a run is a wave with 0 periods.

    pairs: waves (k, j), ascending, shape (waves, 2).
    place_rev: places of the readings on the cycle [input rev], shape (readings,).
    cycle: ratio p/q in lowest terms.
    """
    points = _PHASE_POINTS_PER_REV * cycle.numerator
    counts = np.bincount(np.rint(place_rev * _PHASE_POINTS_PER_REV).astype(np.int64) % points, minlength=points)
    agreement = np.abs(np.fft.rfft(counts)) / len(place_rev)
    periods = pairs[:, 0] * cycle.numerator + pairs[:, 1] * cycle.denominator
    is_kept = pairs[:, 0] <= ALWAYS_ORDER
    for wave in np.flatnonzero(~is_kept).tolist():
        lower = np.append(periods[:wave][is_kept[:wave]], 0)  # 0 of the level of a run
        same = np.maximum(agreement[np.abs(periods[wave] - lower)], agreement[periods[wave] + lower])
        is_kept[wave] = not (same > _SAME_READINGS).any()
    return pairs[is_kept]


def wave_columns(input_rev: Array, output_rev: Array, pairs: _Indices) -> Array:
    """Return the columns of (R2): cosines of all waves, then sines, shape (readings, 2 waves).

    input_rev, output_rev: angles [rev], shape (readings,).
    pairs: waves (k, j), shape (waves, 2).
    """
    orders = np.arange(pairs[:, 0].max() + 1)
    widest = int(np.abs(pairs[:, 1]).max())
    sidebands = np.arange(-widest, widest + 1)
    by_order = np.exp(2j * np.pi * np.outer(input_rev, orders))
    by_sideband = np.exp(2j * np.pi * np.outer(output_rev, sidebands))
    waves = by_order[:, pairs[:, 0]] * by_sideband[:, pairs[:, 1] + widest]
    columns = np.empty((len(waves), 2 * len(pairs)))
    columns[:, : len(pairs)] = waves.real
    columns[:, len(pairs) :] = waves.imag
    return columns


def block_starts(readings: OrderedReadings) -> _Indices:
    """Return the first row of each block, shape (blocks,): parts of a run of equal size, at most one reading apart."""
    borders = np.flatnonzero(np.diff(readings.run)) + 1
    starts: list[_Indices] = []
    for rows in np.split(np.arange(len(readings.run)), borders):
        blocks = max(1, round(len(rows) / _readings_per_block(readings.place_rev[rows])))
        starts.append(rows[0] + np.arange(blocks) * len(rows) // blocks)
    return np.concatenate(starts)


def _readings_per_block(place: Array) -> int:
    """Return how many readings of a run one block takes."""
    steps = np.diff(place)
    steps = steps[steps > 0]
    if not len(steps):
        return 1
    return max(1, int(1 / (float(np.median(steps)) * BLOCKS_PER_REV) + 1e-6))


def block_means(values: Array, starts: _Indices) -> Array:
    """Return the means of values over blocks (R3), shape (blocks, ...).

    values: of each reading, shape (readings, ...).
    starts: first row of each block, shape (blocks,).
    """
    sizes = np.diff(np.append(starts, len(values)))
    sums = np.add.reduceat(values, starts, axis=0)
    return np.asarray(sums / sizes.reshape(-1, *[1] * (values.ndim - 1)))


class BlockDesign:
    """Columns of waves averaged over blocks (R3), each of which is computed once for all models of a recording."""

    def __init__(self, readings: OrderedReadings, starts: _Indices) -> None:
        """Keep the readings, and the first row of each block, shape (blocks,)."""
        self._readings = readings
        self._starts = starts
        self._pairs: _Indices = np.zeros((0, 2), np.int64)
        self._columns = np.zeros((len(starts), 0))

    def fill(self, pairs: _Indices, columns: Array) -> None:
        """Write the columns of waves: cosines, then sines.

        The columns of the call before are copied, so its array must be unchanged.

        pairs: waves (k, j), shape (waves, 2).
        columns: is overwritten, shape (blocks, 2 waves).
        """
        place_of = {pair: place for place, pair in enumerate(map(tuple, self._pairs.tolist()))}
        places = np.array([place_of.get(pair, -1) for pair in map(tuple, pairs.tolist())])
        is_computed = places >= 0
        old_cosines = places[is_computed]
        old = np.concatenate([old_cosines, len(self._pairs) + old_cosines])
        copied = np.flatnonzero(np.tile(is_computed, 2))
        new = np.flatnonzero(np.tile(~is_computed, 2))
        for first, last in self._chunks():  # which stay in the processor's cache
            columns[first:last, copied] = self._columns[first:last].take(old, axis=1)
            if len(new):
                columns[first:last, new] = self._means(first, last, pairs[~is_computed])
        self._pairs = pairs
        self._columns = columns

    def _chunks(self) -> Iterator[tuple[int, int]]:
        """Yield the first block of each chunk, and the one after its last block."""
        ends = np.append(self._starts[1:], len(self._readings.run))
        first = 0
        while first < len(self._starts):
            last = max(first + 1, int(np.searchsorted(ends, self._starts[first] + _CHUNK, side="right")))
            yield first, last
            first = last

    def _means(self, first: int, last: int, pairs: _Indices) -> Array:
        """Return the columns of waves for blocks first to last - 1, shape (last - first, 2 waves)."""
        starts = self._starts[first:last]
        end = self._starts[last] if last < len(self._starts) else len(self._readings.run)
        rows = slice(starts[0], end)
        columns = wave_columns(self._readings.input_rev[rows], self._readings.output_rev[rows], pairs)
        return block_means(columns, starts - starts[0])


def cycle_curves(amplitudes: Array, pairs: _Indices, cycle: Fraction) -> Array:
    """Return the curves of (R2) over the whole cycle, shape (curves, CURVE_POINTS_PER_REV * p).

    amplitudes: cosines, then sines, of each curve, shape (curves, 2 waves).
    pairs: waves (k, j), shape (waves, 2).
    cycle: ratio p/q in lowest terms.
    """
    points = CURVE_POINTS_PER_REV * cycle.numerator
    periods = pairs[:, 0] * cycle.numerator + pairs[:, 1] * cycle.denominator
    cosines, sines = np.split(amplitudes, 2, axis=1)
    spectrum = np.zeros((points // 2 + 1, len(amplitudes)), complex)
    np.add.at(spectrum, periods, (points / 2) * (cosines - 1j * sines).T)
    return np.fft.irfft(spectrum.T, points, axis=1)


def visited_places(place_rev: Array, cycle: Fraction) -> NDArray[np.bool_]:
    """Return which points of the curves over the cycle have a reading within 0.009 revolutions, shape (points,).

    place_rev: places with readings on the cycle [input rev], ascending, shape (readings,).
    cycle: ratio p/q in lowest terms.
    """
    length = float(cycle.numerator)
    points = np.arange(CURVE_POINTS_PER_REV * cycle.numerator) / CURVE_POINTS_PER_REV
    closed = np.concatenate([[place_rev[-1] - length], place_rev, [place_rev[0] + length]])
    after = np.searchsorted(closed, points)
    nearest = np.minimum(closed[after] - points, points - closed[np.maximum(after - 1, 0)])
    return np.asarray(nearest <= _VISITED_REV)
