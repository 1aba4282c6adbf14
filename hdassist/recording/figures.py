"""Figures of a recording: F'_ior with its interval, and the verdict on a limit.

F'_ior is the range of the curve e (R2) over the full cycle or over a stated travel. Each sample of the amplitudes gives
one range. Two ends matter, and they answer different questions:

    whole = range over all places + rest - excess,                                                             (R12)
    seen  = min(range over visited places + min(rest, 0) - excess, range of the readings).                     (R13)

- rest: the effect of waves beyond the model, N(0, 1.5 u), with u from the widest sidebands (see sizes) and at most the
  rms of the residuals.
- excess: noise makes the range of a sample larger than that of the true curve. It is the mean range of the samples less
  the range of the mean curve, over visited places.
- A place is visited if a reading lies within 0.009 input revolutions of it. What no reading has visited cannot show
  that a drive is bad, whatever the prior says, so `seen` leaves it out; what no reading has visited can hide a bad
  drive, so `whole` includes it.

The interval runs from the 2.5 % quantile of `seen` to the 97.5 % quantile of `whole`: part of a cycle simply leaves a
wide upper end. PASS needs P(whole <= limit) >= 95 %, FAIL needs P(seen > limit) >= 95 %, anything else is INCONCLUSIVE.
Both probabilities count at the lower end of their Monte Carlo interval, which few effective samples make wide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from hdassist.belief.statistics import Probability, probability_by_share
from hdassist.errors import SURE, UsageError, Verdict
from hdassist.model.geometry import Array
from hdassist.recording.posterior import ENOUGH_SAMPLES, AmplitudePosterior, effective_samples
from hdassist.recording.sizes import REST_LOG_SIGMA, REST_RANGE, REST_RATIO, WIDEST_SIDEBANDS
from hdassist.recording.waves import CURVE_POINTS_PER_REV, cycle_curves

_VISITED_REV = 0.009  # of the input: a place with a reading within this distance on either side is visited
_CHUNK = 50  # curves computed at once, for the memory
_FEWEST_SIDEBANDS = 0.01  # of the rms of the waves, which stands for the widest sidebands if the model has none
_TAILS = (0.025, 0.5, 0.975)


@dataclass(frozen=True, eq=False)
class RangeFigure:
    """F'_ior over the cycle or a travel.

    whole_arcsec: samples of the range over all places (R12), shape (draws,).
    seen_arcsec: samples of the range over visited places (R13), shape (draws,); zeros if no place was visited.
    visited_share: share of the places with readings, 0 to 1.
    whole_effective, seen_effective: number of effective samples of either range.
    """

    whole_arcsec: Array
    seen_arcsec: Array
    visited_share: float
    whole_effective: float
    seen_effective: float

    @property
    def median_arcsec(self) -> float:
        """Median of the range over all places."""
        return float(np.quantile(self.whole_arcsec, _TAILS[1]))

    @property
    def interval_arcsec(self) -> tuple[float, float]:
        """95 % interval: from the lower end over visited places to the upper end over all places."""
        low = float(np.quantile(self.seen_arcsec, _TAILS[0]))
        return low, float(np.quantile(self.whole_arcsec, _TAILS[2]))

    @property
    def has_few_samples(self) -> bool:
        """Fewer effective samples than the sampler aims at: the interval is rough."""
        return min(self.whole_effective, self.seen_effective) < ENOUGH_SAMPLES

    def probability_of_meeting(self, limit_arcsec: float, uncertainty_arcsec: float = 0.0) -> Probability:
        """Return the probability that the range over all places meets a limit, with its Monte Carlo interval.

        limit_arcsec: limit [arcsec].
        uncertainty_arcsec: standard uncertainty of the instrument [arcsec], normal, beside that of the samples.
        """
        share = _share_below(self.whole_arcsec, limit_arcsec, uncertainty_arcsec)
        return probability_by_share(share, self.whole_effective)

    def probability_of_exceeding(self, limit_arcsec: float, uncertainty_arcsec: float = 0.0) -> Probability:
        """Return the probability that the range over visited places exceeds a limit; arguments as above."""
        share = _share_below(self.seen_arcsec, limit_arcsec, uncertainty_arcsec)
        return probability_by_share(1 - share, self.seen_effective)

    def verdict(self, limit_arcsec: float, uncertainty_arcsec: float = 0.0, sure: float = SURE) -> Verdict:
        """Return PASS, FAIL or INCONCLUSIVE for a limit.

        sure: probability that PASS and FAIL need.
        """
        if self.probability_of_meeting(limit_arcsec, uncertainty_arcsec).low >= sure:
            return Verdict.PASS
        if self.probability_of_exceeding(limit_arcsec, uncertainty_arcsec).low >= sure:
            return Verdict.FAIL
        return Verdict.INCONCLUSIVE


def range_figure(
    posterior: AmplitudePosterior, travel_rev: tuple[float, float] | None = None, seed: int = 0
) -> RangeFigure:
    """Return F'_ior over the full cycle or a travel.

    posterior: samples of the amplitudes.
    travel_rev: first and last angle of the output [rev], None for the full cycle.
    seed: of the random numbers of the rest.
    Raises UsageError for a travel of no length.
    """
    in_travel = _places_of_travel(posterior, travel_rev)
    is_cycle = bool(in_travel.all())
    seen = in_travel & _visited_places(posterior)
    draws = len(posterior.amplitudes)
    whole_range = np.empty(draws)
    seen_range = np.zeros(draws)
    for first in range(0, draws, _CHUNK):
        chosen = slice(first, first + _CHUNK)
        curves = cycle_curves(posterior.amplitudes[chosen], posterior.pairs, posterior.cycle)
        whole_range[chosen] = peak_range(curves) if is_cycle else np.ptp(curves[:, in_travel], axis=1)
        if seen.any():
            seen_range[chosen] = np.ptp(curves[:, seen], axis=1)
    whole_effective, seen_effective = effective_samples(whole_range), effective_samples(seen_range)
    rest = _rest(posterior, seed)
    if seen.any():
        mean_curve = cycle_curves(posterior.amplitudes.mean(axis=0)[None], posterior.pairs, posterior.cycle)[0]
        excess = float(seen_range.mean() - np.ptp(mean_curve[seen]))
        seen_range = np.minimum(seen_range + np.minimum(rest, 0.0) - excess, posterior.readings_range)
        whole_range = whole_range - excess
    return RangeFigure(
        whole_arcsec=np.maximum(whole_range + rest, 0.0),
        seen_arcsec=np.maximum(seen_range, 0.0),
        visited_share=float(seen.sum() / in_travel.sum()),
        whole_effective=whole_effective,
        seen_effective=seen_effective,
    )


def _share_below(values: Array, limit: float, uncertainty: float) -> float:
    """Return the share of samples at or below a limit, each smoothed by the uncertainty of the instrument [arcsec]."""
    if uncertainty:
        return float(np.mean(ndtr((limit - values) / uncertainty)))
    return float(np.mean(values <= limit))


def peak_range(curves: Array) -> Array:
    """Return the range of periodic curves, peaks between points by parabolas, shape (curves,).

    curves: even points of one period, shape (curves, points).
    """
    return _peak(curves) + _peak(-curves)


def _peak(curves: Array) -> Array:
    """Return the maximum of periodic curves by a parabola through the highest point and its neighbours."""
    points = curves.shape[1]
    rows = np.arange(len(curves))
    highest = curves.argmax(axis=1)
    before = curves[rows, (highest - 1) % points]
    here = curves[rows, highest]
    behind = curves[rows, (highest + 1) % points]
    bend = np.minimum(before - 2 * here + behind, -1e-300)
    return np.asarray(here - (before - behind) ** 2 / (8 * bend))


def _places_of_travel(posterior: AmplitudePosterior, travel_rev: tuple[float, float] | None) -> NDArray[np.bool_]:
    """Return which places of the cycle's grid a travel covers, shape (points,)."""
    points = CURVE_POINTS_PER_REV * posterior.cycle.numerator
    if travel_rev is None:
        return np.ones(points, bool)
    first, last = min(travel_rev), max(travel_rev)
    if not (np.isfinite(last - first) and last > first):
        raise UsageError(f"invalid travel {first:g} to {last:g} output revolutions: expected a positive length")
    start = round(first * float(posterior.cycle) * CURVE_POINTS_PER_REV)
    stop = round(last * float(posterior.cycle) * CURVE_POINTS_PER_REV)
    covered = np.zeros(points, bool)
    covered[np.arange(start, min(stop, start + points - 1) + 1) % points] = True
    return covered


def _visited_places(posterior: AmplitudePosterior) -> NDArray[np.bool_]:
    """Return which places of the cycle's grid have a reading within 0.009 revolutions, shape (points,)."""
    length = float(posterior.cycle.numerator)
    points = np.arange(CURVE_POINTS_PER_REV * posterior.cycle.numerator) / CURVE_POINTS_PER_REV
    visited = posterior.visited_rev
    closed = np.concatenate([[visited[-1] - length], visited, [visited[0] + length]])
    after = np.searchsorted(closed, points)
    nearest = np.minimum(closed[after] - points, points - closed[np.maximum(after - 1, 0)])
    return np.asarray(nearest <= _VISITED_REV)


def _rest(posterior: AmplitudePosterior, seed: int) -> Array:
    """Return samples of the effect of waves beyond the model on a range [arcsec], shape (draws,)."""
    rng = np.random.default_rng(seed)
    order, sideband = posterior.pairs[:, 0], np.abs(posterior.pairs[:, 1])
    is_wide = (sideband >= WIDEST_SIDEBANDS) & (sideband != order)
    cosines, sines = np.split(posterior.amplitudes, 2, axis=1)
    mean_squares = (cosines**2 + sines**2) / 2
    if is_wide.any():
        rms = np.sqrt(mean_squares[:, is_wide].sum(axis=1))
    else:
        rms = _FEWEST_SIDEBANDS * np.sqrt(mean_squares.sum(axis=1))
    draws = len(rms)
    size = REST_RATIO * np.exp(REST_LOG_SIGMA * rng.standard_normal(draws)) * rms
    rest = np.minimum(size, posterior.residual_rms) * REST_RANGE * rng.standard_normal(draws)
    return np.asarray(rest)
