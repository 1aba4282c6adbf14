"""Waves on the torus and their design matrix.

The error is a smooth function of both angles, so it is a Fourier series on their torus:

    e(phi, psi) = sum over (k, j) of a_kj cos 2 pi (k phi + j psi) + b_kj sin 2 pi (k phi + j psi).            (R2)

k is the number of periods per input revolution (the order), j the number of periods per output revolution (the sideband
of an order). The waves with k = 0, j > 0 are those of the output. The two waves (k, +-k) are those of a part that
rotates with the other wheel. Along the cycle (R1) the wave (k, j) has k p + j q periods, so a fast Fourier transform of
the amplitudes gives the curve over the whole cycle.

Both the readings and the columns of the design are averaged over blocks of consecutive readings of a run:

    y_B = mean over B of y,   X_B = mean over B of x.                                                          (R3)

Averaging both sides of a linear equation is exact, so it does not attenuate any wave.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.model.geometry import Array
from hdassist.recording.positions import OrderedReadings

_Indices = NDArray[np.int64]
# number of blocks per input revolution; for the highest waves of large ratios there are more
LEAST_BLOCKS_PER_REV = 80
MOST_BLOCKS = 30_000  # maximum number of blocks, as in three cycles of ratio 100, to limit memory
# points of a curve per input revolution, 3 per period of the highest order; parabolas give the peaks between them
CURVE_POINTS_PER_REV = 240
# Highest order that is included for any sampling. Coarse readings show a higher order as a lower one (its image) or not
# at all, so they do not exclude it. In solved drives, orders above 16 have 3 % of the power of the error.
ALWAYS_ORDER = 16
_SIDEBAND_ORDER = 20  # highest order with sidebands
_HIGHEST_ORDER = 36  # highest order of the waves other than those of single teeth
# Differences between teeth give even orders (two zones mesh) up to half the number of teeth of a wheel, 1 + ratio.
# Their waves rotate with either wheel, with one sideband on each side. With these waves above order 16, the range of
# solved drives is 97 +- 2.6 % of the true range, without them 90 +- 8 %. Of the other waves, the sidebands of the waves
# that rotate with the other wheel, orders 6 to 16, are the largest: they had a seventh of the omitted power.
_HIGHEST_FINE_ORDER = 80
_POINTS_PER_PERIOD = 2.2  # smallest number of blocks per period of the highest order
USUAL_SIDEBANDS = 6  # number of sidebands on each side of an order
_VISITED_REV = 0.009  # largest distance [input rev] of a covered position from a reading
_PHASE_POINTS_PER_REV = 1024  # points per input revolution for the phases of two waves
_SAME_READINGS = 0.9  # agreement of phases above which two waves have the same readings
_DIGITS = 6  # decimal digits of the number of readings per block, so that rounding errors do not decide
_CHUNK = 256  # number of rows whose columns are computed at a time, because they must fit into the processor's cache


def wave_pairs(
    cycle: Fraction,
    blocks_per_rev: float,
    more_sidebands: int = 0,
    more_pairs: Sequence[tuple[int, int]] = (),
) -> _Indices:
    """Return the waves (k, j) of the model, sorted, shape (waves, 2).

    cycle: ratio in lowest terms.
    blocks_per_rev: blocks of readings per input revolution.
    more_sidebands: sidebands on each side beyond the usual 6.
    more_pairs: further waves (k, j) shown by the readings.
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
    """Return the waves due to differences between teeth that are not among others.

    Waves with the same number of periods per cycle are identical, so each is included only once and only if it is not
    among the others.

    cycle: ratio in lowest terms.
    others: other waves.
    """
    periods = {k * cycle.numerator + j * cycle.denominator for k, j in others}
    highest = _highest_fine_order(cycle)
    fine: set[tuple[int, int]] = set()
    for k in range(2, highest + 1, 2):
        for j in (0, -1, 1, k, k - 1, k + 1, -k, -k - 1, -k + 1):
            period = k * cycle.numerator + j * cycle.denominator
            if period not in periods:
                periods.add(period)
                fine.add((k, j))
    return fine


def _highest_fine_order(cycle: Fraction) -> int:
    """Return the highest order of the waves due to differences between teeth."""
    return min(_HIGHEST_FINE_ORDER, int(cycle) + 1)


def distinct_pairs(
    pairs: _Indices,
    place_rev: Array,
    cycle: Fraction,
) -> _Indices:
    """Return the waves, except those of high orders with the same readings as a lower wave, shape (waves, 2).

    At evenly spaced readings, a wave with m periods per cycle has the same readings as one with m' periods if all
    phases (m - m') t / p, or all (m + m') t / p, agree. The readings cannot distinguish them, and the lower order is
    more likely. The level of a run counts as a wave with 0 periods.

    pairs: waves (k, j), ascending, shape (waves, 2).
    place_rev: positions of the readings on the cycle [input rev], shape (readings,).
    cycle: ratio p/q in lowest terms.
    """
    points = _PHASE_POINTS_PER_REV * cycle.numerator
    counts = np.bincount(np.rint(place_rev * _PHASE_POINTS_PER_REV).astype(np.int64) % points, minlength=points)
    agreement = np.abs(np.fft.rfft(counts)) / len(place_rev)
    periods = pairs[:, 0] * cycle.numerator + pairs[:, 1] * cycle.denominator
    is_kept = pairs[:, 0] <= ALWAYS_ORDER
    for wave in np.flatnonzero(~is_kept).tolist():
        lower = np.append(periods[:wave][is_kept[:wave]], 0)  # 0 for the level of a run
        same = np.maximum(agreement[np.abs(periods[wave] - lower)], agreement[periods[wave] + lower])
        is_kept[wave] = not (same > _SAME_READINGS).any()
    return pairs[is_kept]


def wave_values(
    input_rev: Array,
    output_rev: Array,
    pairs: _Indices,
) -> NDArray[np.complex128]:
    """Return exp 2 pi i (k phi + j psi) of all waves, shape (waves, readings).

    input_rev, output_rev: angles [rev], shape (readings,).
    pairs: waves (k, j), shape (waves, 2).
    """
    widest = int(np.abs(pairs[:, 1]).max(initial=0))
    orders = _powers(input_rev, int(pairs[:, 0].max(initial=0)))
    sidebands = _powers(output_rev, widest)
    sidebands = np.concatenate([sidebands[:0:-1].conj(), sidebands])
    return np.asarray(orders[pairs[:, 0]] * sidebands[pairs[:, 1] + widest])


def _powers(angle_rev: Array, highest: int) -> NDArray[np.complex128]:
    """Return exp 2 pi i n angle for n from 0 to the highest number, shape (highest + 1, readings)."""
    powers = np.ones((highest + 1, len(angle_rev)), complex)
    once = np.exp(2j * np.pi * angle_rev)
    for number in range(1, highest + 1):  # a product takes a tenth of the time of an exponential
        powers[number] = powers[number - 1] * once
    return powers


def _blocks_per_rev(cycle: Fraction, travelled_rev: float) -> float:
    """Return the number of blocks per input revolution that determine the highest waves.

    A mean over a block attenuates a wave with a period of the length of the block to 0. The readings then do not
    determine this wave, although they show it. In a recording of many cycles the blocks are longer.

    cycle: ratio in lowest terms.
    travelled_rev: total length of the runs [input rev].
    """
    determining = _POINTS_PER_PERIOD * _highest_fine_order(cycle)
    return max(LEAST_BLOCKS_PER_REV, min(determining, MOST_BLOCKS / max(travelled_rev, 1.0)))


def block_starts(readings: OrderedReadings) -> _Indices:
    """Return the first row of each block, shape (blocks,). Blocks of a run differ in size by at most one reading."""
    borders = np.flatnonzero(np.diff(readings.run)) + 1
    runs = np.split(np.arange(len(readings.run)), borders)
    travelled_rev = sum(float(np.ptp(readings.place_rev[rows])) for rows in runs)
    per_rev = _blocks_per_rev(readings.cycle, travelled_rev)
    starts: list[_Indices] = []
    for rows in runs:
        blocks = max(1, round(len(rows) / _readings_per_block(readings.place_rev[rows], per_rev)))
        starts.append(rows[0] + np.arange(blocks) * len(rows) // blocks)
    return np.concatenate(starts)


def _readings_per_block(place: Array, blocks_per_rev: float) -> float:
    """Return the mean number of readings in a block of a run.

    Blocks of one reading and of two would have noise of very different size, so from two readings on blocks are used.

    place: positions of the readings of the run [input rev], ascending, shape (readings,).
    blocks_per_rev: wanted number of blocks per input revolution.
    """
    steps = np.diff(place)
    steps = steps[steps > 0]
    if not len(steps):
        return 1.0
    readings = round(1 / (float(np.median(steps)) * blocks_per_rev), _DIGITS)
    return readings if readings >= 2 else 1.0


def block_means(values: Array, starts: _Indices) -> Array:
    """Return the means of values over blocks (R3), shape (blocks, ...).

    values: value of each reading, shape (readings, ...).
    starts: first row of each block, shape (blocks,).
    """
    sizes = np.diff(np.append(starts, len(values)))
    sums = np.add.reduceat(values, starts, axis=0)
    return np.asarray(sums / sizes.reshape(-1, *[1] * (values.ndim - 1)))


def fill_block_columns(
    readings: OrderedReadings,
    starts: _Indices,
    pairs: _Indices,
    columns: Sequence[Array],
) -> None:
    """Write the columns of waves averaged over blocks (R3).

    readings: readings in canonical order.
    starts: first row of each block, shape (blocks,).
    pairs: waves (k, j), shape (waves, 2).
    columns: arrays of shape (blocks,) to be overwritten, first those of the cosines, then those of the sines.
    """
    if not len(pairs):
        return
    ends = np.append(starts[1:], len(readings.run))
    sizes = ends - starts
    first = 0
    while first < len(starts):
        last = max(
            first + 1,
            int(
                np.searchsorted(
                    ends,
                    starts[first] + _CHUNK,
                    side="right",
                )
            ),
        )
        rows = slice(starts[first], ends[last - 1])
        values = wave_values(readings.input_rev[rows], readings.output_rev[rows], pairs)
        means = _sums(values, starts[first:last] - starts[first]) / sizes[first:last]
        for number in range(len(pairs)):
            columns[number][first:last] = means[number].real
            columns[len(pairs) + number][first:last] = means[number].imag
        first = last


def _sums(values: NDArray[np.complex128], starts: _Indices) -> NDArray[np.complex128]:
    """Return the sums of values, shape (waves, readings), over blocks, shape (waves, blocks)."""
    size = values.shape[1] // len(starts)
    if (starts != size * np.arange(len(starts))).any() or size * len(starts) != values.shape[1]:
        return np.add.reduceat(values, starts, axis=1)
    sums = values[:, ::size].copy()  # for blocks of equal size, this takes a third of the time
    for number in range(1, size):
        sums += values[:, number::size]
    return sums


def cycle_curves(
    amplitudes: Array,
    pairs: _Indices,
    cycle: Fraction,
) -> Array:
    """Return the curves (R2) over the whole cycle, shape (curves, CURVE_POINTS_PER_REV * p).

    amplitudes: cosines, then sines, of each curve, shape (curves, 2 waves).
    pairs: waves (k, j), shape (waves, 2).
    cycle: ratio p/q in lowest terms.
    """
    points = CURVE_POINTS_PER_REV * cycle.numerator
    periods = pairs[:, 0] * cycle.numerator + pairs[:, 1] * cycle.denominator
    cosines, sines = np.split(amplitudes, 2, axis=1)
    spectrum = np.zeros((len(amplitudes), points // 2 + 1), complex)
    np.add.at(spectrum.T, periods, (points / 2) * (cosines - 1j * sines).T)
    return np.fft.irfft(spectrum, points, axis=1)


@dataclass(frozen=True, eq=False)
class CurveExtremes:
    """Extremes of curves over the cycle.

    range_arcsec: range over the points of the curve, shape (curves,).
    peak_range_arcsec: range including peaks between the points, shape (curves,).
    visited_range_arcsec: range over the covered points, 0 if there are none, shape (curves,).
    highest, lowest: indices of the points with the extremes, shape (curves,).
    """

    range_arcsec: Array
    peak_range_arcsec: Array
    visited_range_arcsec: Array
    highest: _Indices
    lowest: _Indices

    @classmethod
    def joined(cls, parts: Sequence[CurveExtremes]) -> CurveExtremes:
        """Return the extremes of the curves of all parts."""
        return cls(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])})

    def chosen(self, curves: slice) -> CurveExtremes:
        """Return the extremes of the selected curves."""
        return CurveExtremes(**{name: values[curves] for name, values in vars(self).items()})

    def mirrored(
        self,
        turned: int,
        flipped: int,
        *,
        points: int,
    ) -> CurveExtremes:
        """Return the extremes of the curves after mirroring angles and values.

        turned: factor on the angles, 1 or -1.
        flipped: factor on the values, 1 or -1.
        points: number of points of a curve.
        """
        highest = turned * self.highest % points
        lowest = turned * self.lowest % points
        if flipped < 0:
            return replace(self, highest=lowest, lowest=highest)
        return replace(self, highest=highest, lowest=lowest)


def curve_extremes(curves: Array, is_visited: NDArray[np.bool_]) -> CurveExtremes:
    """Return the extremes of curves over the cycle.

    curves: curves as returned by `cycle_curves`, shape (curves, points).
    is_visited: whether each point has a reading nearby, shape (points,).
    """
    highest = curves.argmax(axis=1)
    lowest = curves.argmin(axis=1)
    rows = np.arange(len(curves))
    ranges = curves[rows, highest] - curves[rows, lowest]
    visited_ranges = np.zeros(len(curves))
    if is_visited.any():
        # most curves have both extremes at covered points
        is_inside = is_visited[highest] & is_visited[lowest]
        visited_ranges[is_inside] = ranges[is_inside]
        if not is_inside.all():
            visited_ranges[~is_inside] = np.ptp(curves[~is_inside][:, is_visited], axis=1)
    return CurveExtremes(
        range_arcsec=ranges,
        peak_range_arcsec=_value_at_extreme(curves, highest, 1) + _value_at_extreme(curves, lowest, -1),
        visited_range_arcsec=visited_ranges,
        highest=highest,
        lowest=lowest,
    )


def _value_at_extreme(
    curves: Array,
    places: _Indices,
    sign: int,
) -> Array:
    """Return the maximum of periodic curves times a sign, from parabolas through three neighbouring points.

    curves: curves over the cycle, shape (curves, points).
    places: index of the highest point of each curve times the sign, shape (curves,).
    sign: 1 for the maximum of the curves, -1 for the negative of their minimum.
    """
    rows = np.arange(len(curves))
    before = curves[rows, places - 1]
    behind = curves[rows, (places + 1) % curves.shape[1]]
    return parabola_peak(sign * before, sign * curves[rows, places], sign * behind)


def parabola_peak(
    before: Array,
    here: Array,
    behind: Array,
) -> Array:
    """Return the maximum of parabolas through three evenly spaced points, of which the middle one is the highest."""
    bend = np.minimum(before - 2 * here + behind, -1e-300)
    return np.asarray(here - (before - behind) ** 2 / (8 * bend))


def visited_places(place_rev: Array, cycle: Fraction) -> NDArray[np.bool_]:
    """Return whether each point of the curves over the cycle has a reading within 0.009 revolutions, shape (points,).

    place_rev: positions with readings on the cycle [input rev], ascending, shape (readings,).
    cycle: ratio p/q in lowest terms.
    """
    length = float(cycle.numerator)
    points = np.arange(CURVE_POINTS_PER_REV * cycle.numerator) / CURVE_POINTS_PER_REV
    closed = np.concatenate([[place_rev[-1] - length], place_rev, [place_rev[0] + length]])
    after = np.searchsorted(closed, points)
    nearest = np.minimum(closed[after] - points, points - closed[np.maximum(after - 1, 0)])
    return np.asarray(nearest <= _VISITED_REV)
