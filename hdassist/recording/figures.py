"""Results of a recording: F'_ior with its interval, and the verdict on a limit.

F'_ior is the range of the curve e (R2) over the full cycle or over a stated travel. Each sample of the amplitudes gives
one range. Two ranges are needed, one for each end of the interval:

    whole = range over all positions + rest + 2 sum of lines - excess,                                         (R12)
    seen  = min(range over covered positions + min(rest, 0) + flank - 2 excess, range of the readings).        (R13)

- rest: the contribution of waves beyond the model to the range, c u. The rms u of such waves follows from the fine
  waves of the model, and c from solved drives (see sizes). The part of u due to waves that are not in (R2) is at most
  the rms of the residuals. The other part is due to high orders that the readings show as lower ones. Its size relative
  to the fine waves of the model is that of the profile. `seen` excludes positive contributions.
- lines: the amplitudes of lines outside the orders. In another cycle their peaks may coincide with those of the curve;
  `seen` includes them with the recorded phases.
- excess: noise makes the range of a sample larger than that of the true curve. The excess is the mean range of the
  samples minus the range of the mean curve, both at the readings. Between the readings it would also include waves that
  coarse readings do not determine, which are not noise. The mean curve contains the noise of the readings as well. If
  the readings determine the waves, this increases its range by the excess again, and if the prior determines them, by
  less. `seen` and the stated value are therefore reduced by twice the excess, and the upper end, which must not be too
  low, by the excess.
- flank: a finite series overshoots next to a steep flank, and its range is too large. The readings there lie inside the
  curve. flank is the mean residual at the highest positions of the mean curve minus that at the lowest. It counts as 0
  unless it is negative beyond its own noise.
- A position is covered if a reading is close to it (`visited_places`). A steep flank also overshoots between two
  readings, so the range over covered positions is limited to that of the curve at the readings, with peaks between them
  from parabolas, except across gaps. Positions without readings cannot show that a drive is bad, whatever the prior is,
  so `seen` excludes them. They can hide the fault of a bad drive, so `whole` includes them.

The interval extends from the 2.5 % quantile of `seen` to the 97.5 % quantile of `whole`, so a part of a cycle gives a
high upper end. PASS requires P(whole <= limit) >= 95 %, FAIL requires P(seen > limit) >= 95 %, and other cases are
INCONCLUSIVE. Quantiles and probabilities are taken at the far end of their Monte Carlo interval, which is wide for a
small effective sample size n. A quantile p is taken at the upper end of the Jeffreys interval of n p out of n,

    p' = 95 % quantile of Beta(n p + 1/2, n (1 - p) + 1/2).                                                    (R15)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, ndtr

from hdassist.belief.statistics import CONFIDENCE, Probability, probability_by_share
from hdassist.drive.model.geometry import Array
from hdassist.recording.chain import ENOUGH_SAMPLES, effective_samples
from hdassist.recording.posterior import AmplitudePosterior
from hdassist.recording.sizes import FINE_ORDER, rest_profile
from hdassist.recording.waves import CURVE_POINTS_PER_REV, cycle_curves, parabola_peak, visited_places
from hdassist.run.errors import SURE, UsageError, Verdict

_CHUNK = 50  # number of curves computed at a time, to limit memory
_CELLS = 36  # number of cells into which the cycle is divided; one or several form the part to record next
_CELL_SHARE = 0.5  # share of the best cell's weight from which an adjacent cell belongs to the same part
_TAIL = 0.025  # probability beyond each end of an interval
# share of the range, from either extreme of the mean curve, within which readings show an overshoot
_EXTREME_SHARE = 0.03
_GAP = 1.5  # distance of two blocks, relative to the median, from which there is a gap between them
_FLANK_SIGMAS = 2.0  # standard errors from which an overshoot is not due to chance


@dataclass(frozen=True, eq=False)
class RangeFigure:
    """F'_ior over the cycle or a travel.

    whole_arcsec: samples of the range over all positions (R12), shape (draws,).
    recorded_arcsec: samples of the range over all positions with lines at the recorded phases, shape (draws,).
    seen_arcsec: samples of the range over covered positions (R13), shape (draws,); zeros if no position is covered.
    visited_share: share of the positions with readings, 0 to 1.
    whole_effective, seen_effective: effective sample size of each range.
    """

    whole_arcsec: Array
    recorded_arcsec: Array
    seen_arcsec: Array
    visited_share: float
    whole_effective: float
    seen_effective: float

    @property
    def median_arcsec(self) -> float:
        """The median of the range over all positions."""
        return float(np.median(self.whole_arcsec))

    @property
    def median_recorded_arcsec(self) -> float:
        """The median of the range over the recorded cycle, which is the best estimate if it was fully recorded."""
        return float(np.median(self.recorded_arcsec))

    @property
    def median_seen_arcsec(self) -> float:
        """The median of the range over covered positions."""
        return float(np.median(self.seen_arcsec))

    @property
    def interval_arcsec(self) -> tuple[float, float]:
        """The 95 % interval, from the lower end over covered positions to the upper end over all positions."""
        return self.lower_arcsec(1 - _TAIL), self.upper_arcsec(1 - _TAIL)

    def lower_arcsec(self, share: float) -> float:
        """Return the value that a share of the samples over covered positions, increased by (R15), exceeds."""
        return float(np.quantile(self.seen_arcsec, 1 - _far_share(share, self.seen_effective)))

    def upper_arcsec(self, share: float) -> float:
        """Return the quantile of the range over all positions for a share of the samples increased by (R15)."""
        return float(np.quantile(self.whole_arcsec, _far_share(share, self.whole_effective)))

    @property
    def has_few_samples(self) -> bool:
        """Whether the effective sample size is smaller than intended, so that the interval is rough."""
        return min(self.whole_effective, self.seen_effective) < ENOUGH_SAMPLES

    def probability_of_meeting(self, limit_arcsec: float, uncertainty_arcsec: float = 0.0) -> Probability:
        """Return the probability that the range over all positions meets a limit, with its Monte Carlo interval.

        limit_arcsec: limit [arcsec].
        uncertainty_arcsec: standard uncertainty of the instrument [arcsec], normal, in addition to that of the samples.
        """
        share = _share_below(self.whole_arcsec, limit_arcsec, uncertainty_arcsec)
        return probability_by_share(share, self.whole_effective)

    def probability_of_exceeding(self, limit_arcsec: float, uncertainty_arcsec: float = 0.0) -> Probability:
        """Return the probability that the range over covered positions exceeds a limit.

        The arguments are those of `probability_of_meeting`.
        """
        share = _share_below(self.seen_arcsec, limit_arcsec, uncertainty_arcsec)
        return probability_by_share(1 - share, self.seen_effective)

    def verdict(
        self,
        limit_arcsec: float,
        uncertainty_arcsec: float = 0.0,
        sure: float = SURE,
    ) -> Verdict:
        """Return PASS, FAIL or INCONCLUSIVE for a limit.

        limit_arcsec, uncertainty_arcsec: arguments of `probability_of_meeting`.
        sure: probability that PASS and FAIL require.
        """
        if self.probability_of_meeting(limit_arcsec, uncertainty_arcsec).low >= sure:
            return Verdict.PASS
        if self.probability_of_exceeding(limit_arcsec, uncertainty_arcsec).low >= sure:
            return Verdict.FAIL
        return Verdict.INCONCLUSIVE


def part_to_record(posterior: AmplitudePosterior) -> tuple[float, float] | None:
    """Return the ends of the part of the cycle whose recording would narrow the interval of F'_ior most [input rev].

    Angles are measured from the zero of the recorded angles. The part has the largest number of extremes of the sampled
    curves at positions without readings, each weighted by the contribution of such positions to the range of its curve.
    If the part contains the end of the cycle, its second angle exceeds the length of the cycle. The result is None if
    all positions are covered, or if uncovered positions do not contribute to the range.
    """
    seen = visited_places(posterior.visited_rev, posterior.cycle)
    cell_of_point = np.arange(len(seen)) * _CELLS // len(seen)
    is_open = np.bincount(cell_of_point, ~seen, minlength=_CELLS) > 0.5 * len(seen) / _CELLS
    weights = np.zeros(_CELLS)
    extremes = posterior.extremes
    gained = extremes.range_arcsec - extremes.visited_range_arcsec
    for places in (extremes.highest, extremes.lowest):
        np.add.at(weights, cell_of_point[places], np.where(seen[places], 0.0, gained))
    weights[~is_open] = 0.0
    if not weights.any():
        return None
    best = int(weights.argmax())
    enough = _CELL_SHARE * weights[best]
    first, last = best, best
    while weights[(first - 1) % _CELLS] > enough and last - first < _CELLS - 1:
        first -= 1
    while weights[(last + 1) % _CELLS] > enough and last - first < _CELLS - 1:
        last += 1
    length = posterior.cycle.numerator / _CELLS
    start = first % _CELLS
    return start * length, (start + last - first + 1) * length


def range_figure(
    posterior: AmplitudePosterior,
    travel_rev: tuple[float, float] | None = None,
    seed: int = 0,
) -> RangeFigure:
    """Return F'_ior over the full cycle or a travel.

    posterior: samples of the amplitudes.
    travel_rev: first and last angle of the output [rev], None for the full cycle.
    seed: seed of the random numbers for the rest.
    Raises UsageError if the length of the travel is not positive.
    """
    in_travel = _places_of_travel(posterior, travel_rev)
    is_cycle = bool(in_travel.all())
    seen = in_travel & visited_places(posterior.visited_rev, posterior.cycle)
    at_blocks = _BlockPoints(posterior, in_travel)
    block_curves = posterior.block_curves[:, at_blocks.inside]
    block_range = at_blocks.range(block_curves)
    if is_cycle:
        whole_range = posterior.extremes.peak_range_arcsec
        seen_range = posterior.extremes.visited_range_arcsec
    else:
        whole_range, seen_range = _ranges_of_travel(posterior, in_travel, seen)
    if seen.any():
        seen_range = np.minimum(seen_range, block_range)
    whole_effective, seen_effective = effective_samples(whole_range), effective_samples(seen_range)
    rest = _rest(posterior, seed)
    lines = 2 * posterior.line_amplitudes.sum(axis=1)
    recorded_range = whole_range
    if seen.any():
        excess = float(block_range.mean()) - float(at_blocks.range(block_curves.mean(axis=0)[None])[0])
        if len(posterior.lines):
            seen_range = block_range
        noise_range = 2 * excess  # of the samples around their mean, and of their mean around the true curve
        recorded_range = np.maximum(whole_range, seen_range) - noise_range
        flank = _flank(posterior, at_blocks)
        seen_range = np.minimum(seen_range + np.minimum(rest, 0.0) + flank - noise_range, posterior.readings_range)
        whole_range = whole_range - excess
    return RangeFigure(
        whole_arcsec=np.maximum(whole_range + lines + rest, 0.0),
        recorded_arcsec=np.maximum(recorded_range + rest, 0.0),
        seen_arcsec=np.maximum(seen_range, 0.0),
        visited_share=float(seen.sum() / in_travel.sum()),
        whole_effective=whole_effective,
        seen_effective=seen_effective,
    )


def _ranges_of_travel(
    posterior: AmplitudePosterior,
    in_travel: NDArray[np.bool_],
    seen: NDArray[np.bool_],
) -> tuple[Array, Array]:
    """Return samples of the range over the positions of a travel, and over those with readings, both (draws,)."""
    draws = len(posterior.amplitudes)
    whole_range = np.empty(draws)
    seen_range = np.zeros(draws)
    for first in range(0, draws, _CHUNK):
        chosen = slice(first, first + _CHUNK)
        curves = cycle_curves(posterior.amplitudes[chosen], posterior.pairs, posterior.cycle)
        whole_range[chosen] = np.ptp(curves[:, in_travel], axis=1)
        if seen.any():
            seen_range[chosen] = np.ptp(curves[:, seen], axis=1)
    return whole_range, seen_range


def _share_below(
    values: Array,
    limit: float,
    uncertainty: float,
) -> float:
    """Return the share of samples at or below a limit, smoothed by the instrument's standard uncertainty [arcsec]."""
    if uncertainty:
        return float(np.mean(ndtr((limit - values) / uncertainty)))
    return float(np.mean(values <= limit))


def _far_share(share: float, effective: float) -> float:
    """Return the increased share p' (R15) for a share of samples with an effective sample size."""
    return float(betaincinv(effective * share + 0.5, effective * (1 - share) + 0.5, 1 - (1 - CONFIDENCE) / 2))


class _BlockPoints:
    """The blocks of readings inside a travel.

    inside: whether each block of the recording is inside the travel, shape (blocks,).
    """

    def __init__(self, posterior: AmplitudePosterior, in_travel: NDArray[np.bool_]) -> None:
        points = np.rint(posterior.block_place_rev * CURVE_POINTS_PER_REV).astype(np.int64) % len(in_travel)
        self.inside = in_travel[points]
        is_apart = _is_apart(
            posterior.block_place_rev[self.inside], posterior.block_run[self.inside], posterior.cycle.numerator
        )
        self._is_first = np.concatenate([[True], is_apart])
        self._is_last = np.concatenate([is_apart, [True]])

    def range(self, values: Array) -> Array:
        """Return the range of curves over the blocks, with peaks between blocks from parabolas, shape (curves,).

        The range is 0 if there are no blocks.

        values: values of the curves at the blocks, shape (curves, blocks inside).
        """
        if not values.shape[1]:
            return np.zeros(len(values))
        return self._highest(values) + self._highest(-values)

    def _highest(self, values: Array) -> Array:
        """Return the maximum of curves from a parabola through the highest block and its neighbours, shape (curves,).

        values: values at the blocks, shape (curves, blocks).
        """
        rows = np.arange(len(values))
        highest = values.argmax(axis=1)
        before = values[rows, np.where(self._is_first[highest], highest, highest - 1)]
        behind = values[rows, np.where(self._is_last[highest], highest, highest + 1)]
        return parabola_peak(before, values[rows, highest], behind)


def _is_apart(
    place_rev: Array,
    run: NDArray[np.int64],
    cycle_rev: int,
) -> NDArray[np.bool_]:
    """Return whether a gap or the end of a run separates each block from the next one, shape (blocks - 1,).

    A parabola across a gap of lost readings may be far from the curve.

    place_rev: position of each block on the cycle [input rev], shape (blocks,).
    run: number of the run of each block, shape (blocks,).
    cycle_rev: length of the cycle [input rev].
    """
    distance = np.abs(np.diff(place_rev))
    distance = np.minimum(distance, cycle_rev - distance)  # the cycle ends where it begins
    if not len(distance):
        return np.zeros(0, bool)
    return np.asarray((np.diff(run) != 0) | (distance > _GAP * np.median(distance)))


def _flank(posterior: AmplitudePosterior, at_blocks: _BlockPoints) -> float:
    """Return the term `flank` of (R13) for the overshoot of the mean curve [arcsec], at most 0."""
    curve = posterior.block_curves[:, at_blocks.inside].mean(axis=0)
    residual = posterior.block_residual[at_blocks.inside]
    if not len(curve):
        return 0.0
    margin = _EXTREME_SHARE * float(np.ptp(curve))
    highest = residual[curve >= curve.max() - margin]
    lowest = residual[curve <= curve.min() + margin]
    overshoot = float(highest.mean() - lowest.mean())
    standard_error = float(np.std(posterior.block_residual) * np.sqrt(1 / len(highest) + 1 / len(lowest)))
    return overshoot if overshoot < -_FLANK_SIGMAS * standard_error else 0.0


def _places_of_travel(posterior: AmplitudePosterior, travel_rev: tuple[float, float] | None) -> NDArray[np.bool_]:
    """Return whether a travel covers each position of the cycle's grid, shape (points,)."""
    points = CURVE_POINTS_PER_REV * posterior.cycle.numerator
    if travel_rev is None:
        return np.ones(points, bool)
    first, last = min(travel_rev), max(travel_rev)
    if not (np.isfinite(last - first) and last > first):
        raise UsageError(f"invalid travel {first:g} to {last:g} output revolutions: expected a positive travel")
    start = round(first * float(posterior.cycle) * CURVE_POINTS_PER_REV)
    stop = round(last * float(posterior.cycle) * CURVE_POINTS_PER_REV)
    covered = np.zeros(points, bool)
    covered[np.arange(start, min(stop, start + points - 1) + 1) % points] = True
    return covered


def _rest(posterior: AmplitudePosterior, seed: int) -> Array:
    """Return samples of the contribution of waves beyond the model to a range [arcsec], shape (draws,)."""
    rng = np.random.default_rng(seed)
    order = posterior.pairs[:, 0]
    profile = rest_profile(int(order[order % 2 == 1].max()), float(posterior.cycle))
    cosines, sines = np.split(
        posterior.amplitudes,
        2,
        axis=1,
    )
    is_fine = order >= FINE_ORDER
    fine = np.sqrt(((cosines**2 + sines**2) / 2)[:, is_fine].sum(axis=1))
    draws = len(fine)
    size = profile.size * np.exp(profile.size_log_sigma * rng.standard_normal(draws)) * fine
    added = profile.added + profile.added_sigma * rng.standard_normal(draws)
    beyond = np.minimum(size, posterior.noise_rms)
    # the readings show these waves at other orders, so they are not noise
    images = posterior.image_share * fine
    return np.asarray(np.hypot(beyond, images) * added)
