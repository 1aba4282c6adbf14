"""F'_ior of the full cycle by the model of `hdassist.recording`, for whole cycles and for parts.

The rules of `orders` give the range of fitted orders at the recorded angles. The model also contains the waves that
these orders leave out, above all those of rough teeth, and for a part of the cycle what the prior of the waves leaves
open at places without readings. Hence two ends: the lower one is of visited places, the upper one of the cycle. Of a
part there is no value of the cycle in between, because that would be one of the prior, which is cautious: the value
stated is that of the recorded part, and its lower end is the lower one of the model and of the fitted orders.

The recording passes through the cleaning of `measure` first: spikes and steps are removed, and a lag and a wind-up are
taken off, so that the model gets the averages of the fit. Sources of uncertainty that the model does not contain widen
both ends.

`measure` and `accept` state this one interval. For a verdict two further numbers count: `at_most_arcsec`, the smallest
limit that F'_ior of the full cycle meets with a probability of 95 %, and `at_least_arcsec`, the largest one that it
exceeds. The former is given from a third of the cycle on (`LEAST_SHARE_OF_PASS`). Over less of it, the prior alone
decides whether the remainder is like the recorded part. Lines off the orders that the fit of `measure` names have to
find room in the upper end too, since in another cycle their peaks may meet those of the curve. At coarse readings most
of them are images of high orders: these return in each cycle, the model contains them, and they need no room.

The model holds only in its domain, and `reason_outside` is the one place that states it: the cycle and the size of the
error are known, F'_ior counts over all of the cycle, one direction, one torque, a recording of 12 % of the cycle or
more, slow terms that are not much larger than the error of the orders (they may come from a wrong ratio), and enough
effective samples. Outside it the range of the fitted orders is what is known.
"""

from __future__ import annotations

from dataclasses import replace
from math import hypot

import numpy as np

from hdassist.errors import GUARD, SURE, DataError, UntrustedError
from hdassist.measuring.fit import COVERAGE_FACTOR
from hdassist.measuring.measure import Measurement, SweepResult
from hdassist.measuring.orders import SCATTER, FullCycle, combined
from hdassist.recording.figures import RangeFigure, part_to_record, range_figure
from hdassist.recording.positions import Recording, recording_from_columns
from hdassist.recording.posterior import AmplitudePosterior, posterior_of_recording
from hdassist.recording.waves import ALWAYS_ORDER, BLOCKS_PER_REV

_LEAST_SHARE = 0.12  # of the cycle: less was not judged (benchmarks/recordings.py)
LEAST_SHARE_OF_PASS = 1 / 3  # of the cycle, from which the upper end may pass a drive
_LARGEST_SLOW = 10.0  # times the range of the orders: larger slow terms may come from a wrong ratio
_FEWEST_EFFECTIVE = 40.0  # samples: with fewer an upper end is not known
_MOST_BLOCKS = 30_000  # of readings: three cycles of ratio 100; the design of more takes too much memory
_LINE_IS_WAVE = 0.5  # agreement of phases: the line lies within 0.6 of the resolution of the wave or of its image
_READINGS_AT_ONCE = 2000  # whose phases are held in memory
_PAUSE = 1e6  # rows between two levels, so that each is a run of its own


def with_full_cycle(result: Measurement) -> Measurement:
    """Return a measurement whose directions have F'_ior of the full cycle, that of the greatest one first.

    result: a measurement; one that has it already is returned as it is.
    """
    if all(direction.full_cycle is not None for direction in result.directions):
        return result
    directions = [replace(each, full_cycle=full_cycle(result, each)) for each in result.directions]
    return replace(result, directions=tuple(sorted(directions, key=lambda each: -each.F_ior_arcsec)))


def reason_outside(result: Measurement, sweep: SweepResult) -> str:
    """Return why the model does not hold for a direction of a measurement; empty if it does."""
    if result.gearing is None or sweep.coverage is None:
        return "the full cycle is unknown"
    if result.gearing.travel:
        return "F'_ior refers to a travel whose place in the cycle is unknown"
    if sweep.is_scale_bound:
        return "the declination of the guide star is unknown, and with it the size of the error"
    if sweep.direction == 0:
        return "both directions were combined"
    if result.trace.is_between_torques or len(sweep.fit.blocks) > 1 or _is_torque_changing(result, sweep):
        return "the torque changes"
    if sweep.coverage.share < _LEAST_SHARE:
        return f"less than {100 * _LEAST_SHARE:.0f} % of the cycle was recorded"
    if _blocks(sweep) > _MOST_BLOCKS:
        return "the recording is longer than the model allows: record one full mesh cycle"
    if sweep.slow_arcsec > _LARGEST_SLOW * sweep.cam.value:
        return "slow terms are much larger than the error of the orders: check the ratio and the drift"
    return ""


def full_cycle(result: Measurement, sweep: SweepResult) -> FullCycle | str:
    """Return F'_ior of the full cycle, or why there is none.

    result: a measurement.
    sweep: one of its directions.
    """
    reason = reason_outside(result, sweep)
    if reason or result.gearing is None:
        return reason
    try:
        posterior = posterior_of_recording(cleaned_recording(sweep, result.gearing.ratio), seed=result.seed)
    except (DataError, UntrustedError) as error:
        return str(error)
    figure = range_figure(posterior, seed=result.seed)
    if figure.whole_effective < _FEWEST_EFFECTIVE:
        return "the model of the full cycle has too few effective samples"
    # Over a whole cycle the model contains what coarse readings and fitted orders leave out. Over a part it depends on
    # its prior, so those sources stay.
    other_uncertainty = sweep.range.others
    if not sweep.is_bound:
        other_uncertainty = combined([source for source in sweep.sources if source.name not in SCATTER])
    ends = _Ends(figure, other_uncertainty)
    low, high = ends.interval_arcsec
    at_least = ends.at_least_arcsec
    if sweep.is_bound:  # steep waves of no drive: on parts of them the model alone was up to 2 % too high
        low = min(low, sweep.range.interval[0])
        at_least = min(at_least, sweep.range.value - GUARD * sweep.range.uncertainty)
    if high < sweep.range.value:
        return "the model of the full cycle contradicts the range of the recorded part"
    with_lines = sweep.range.value + _rise_by_lines(sweep, posterior)
    return FullCycle(
        value_arcsec=figure.median_seen_arcsec if sweep.is_bound else figure.median_recorded_arcsec,
        interval_arcsec=(low, max(high, with_lines)),
        standard_uncertainty_arcsec=ends.part_uncertainty_arcsec if sweep.is_bound else ends.cycle_uncertainty_arcsec,
        at_least_arcsec=at_least,
        at_most_arcsec=max(ends.at_most_arcsec, with_lines) if _is_enough_to_pass(sweep) else None,
        record_next_rev=part_to_record(posterior),
        effective_samples=figure.whole_effective,
    )


def _is_enough_to_pass(sweep: SweepResult) -> bool:
    """Return whether a direction covers enough of the cycle for a PASS by the upper end."""
    return sweep.coverage is not None and sweep.coverage.share >= LEAST_SHARE_OF_PASS


def _rise_by_lines(sweep: SweepResult, posterior: AmplitudePosterior) -> float:
    """Return the rise of F'_ior in another cycle by the lines of a fit [arcsec]; 0 if they are waves of high orders.

    A line is such a wave, or its image, if both have the same phases at all readings: the mean of exp(2 pi i (f - l) t)
    or of exp(2 pi i (f + l) t) over the readings is near 1, with the line at l and the wave at f periods per input
    revolution.
    """
    high_pairs = posterior.pairs[posterior.pairs[:, 0] > ALWAYS_ORDER]
    if not sweep.lines or not sweep.range.rise or not len(high_pairs):
        return sweep.range.rise
    waves = high_pairs[:, 0] + high_pairs[:, 1] / float(posterior.cycle)
    lines = np.array([line.per_cam_rev for line in sweep.lines])
    turns = sweep.bins.turns
    differences = np.zeros((len(waves), len(lines)), complex)
    sums = np.zeros_like(differences)
    for first in range(0, len(turns), _READINGS_AT_ONCE):
        part = turns[first : first + _READINGS_AT_ONCE]
        at_waves = np.exp(2j * np.pi * np.outer(waves, part))
        at_lines = np.exp(2j * np.pi * np.outer(part, lines))
        differences += at_waves @ at_lines.conj()
        sums += at_waves @ at_lines
    agreement = np.maximum(np.abs(differences), np.abs(sums)).max(axis=0) / len(turns)
    return sweep.range.rise if (agreement < _LINE_IS_WAVE).any() else 0.0


class _Ends:
    """Ends of F'_ior by the samples of the model, with the sources of uncertainty that these do not contain.

    figure: the samples. others: standard uncertainty by those sources [arcsec].
    """

    def __init__(self, figure: RangeFigure, others: float) -> None:
        self._figure = figure
        self._others = others

    @property
    def interval_arcsec(self) -> tuple[float, float]:
        """95 % interval, not below 0."""
        low, high = self._figure.interval_arcsec
        return self._lower(low, COVERAGE_FACTOR), self._upper(high, COVERAGE_FACTOR)

    @property
    def at_least_arcsec(self) -> float:
        """Largest limit that is exceeded with a probability of 95 %."""
        return self._lower(self._figure.lower_arcsec(SURE), GUARD)

    @property
    def at_most_arcsec(self) -> float:
        """Smallest limit that is met with a probability of 95 %."""
        return self._upper(self._figure.upper_arcsec(SURE), GUARD)

    @property
    def cycle_uncertainty_arcsec(self) -> float:
        """Standard uncertainty of F'_ior by the samples alone: a quarter of their 95 % interval."""
        low, high = self._figure.interval_arcsec
        return (high - low) / (2 * COVERAGE_FACTOR)

    @property
    def part_uncertainty_arcsec(self) -> float:
        """Standard uncertainty of the range of the recorded part by the samples alone, below its median."""
        return (self._figure.median_seen_arcsec - self._figure.interval_arcsec[0]) / COVERAGE_FACTOR

    def _lower(self, end: float, factor: float) -> float:
        """Return a lower end with as many standard uncertainties of the other sources below it as in its interval."""
        median = self._figure.median_seen_arcsec
        return max(0.0, median - hypot(median - end, factor * self._others))

    def _upper(self, end: float, factor: float) -> float:
        """Return an upper end in the same way."""
        median = self._figure.median_arcsec
        return median + hypot(end - median, factor * self._others)


def cleaned_recording(sweep: SweepResult, ratio: float) -> Recording:
    """Return the readings of a direction as `measure` has cleaned them.

    sweep: a direction of a measurement.
    ratio: input revolutions for each output revolution.
    Raises DataError for readings that are no recording.
    """
    bins = sweep.bins
    error = bins.error.copy()
    for name, (slope, _) in sweep.fit.slopes.items():
        error -= slope * getattr(bins, name)
    rows = np.arange(len(bins), dtype=float)
    return recording_from_columns(
        input_rev=bins.turns,
        error_arcsec=error,
        ratio=ratio,
        sweep=bins.level,
        time=rows + _PAUSE * bins.level,
    )


def _blocks(sweep: SweepResult) -> float:
    """Return the largest number of blocks of readings that the model makes of a direction."""
    bins = sweep.bins
    revolutions = 0.0
    for level in range(bins.levels):
        revolutions += float(np.ptp(bins.turns[bins.level == level]))
    return min(len(bins), BLOCKS_PER_REV * revolutions)


def _is_torque_changing(result: Measurement, sweep: SweepResult) -> bool:
    """Return whether the torque changes within or between the sweeps."""
    torque = result.torque
    return torque is not None and torque.is_change([sweep.bins.load])
