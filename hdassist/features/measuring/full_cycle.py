"""F'_ior of the full cycle from the model of `hdassist.recording`, for whole cycles and for parts.

The functions of `orders` give the range of fitted orders at the recorded angles. The model also contains the waves that
these orders omit, especially those of rough teeth. For a part of the cycle it includes the waves that, by their prior,
are possible at positions without readings. The interval therefore has two kinds of ends: the lower one refers to
covered positions, the upper one to the cycle. A value between them would depend on the cautious prior. For a part of
the cycle, the stated value is therefore that of the recorded part, and the lower end is the smaller one of the model
and of the fitted orders.

The recording is first processed by `measure`: spikes and steps are removed, and a lag and a wind-up are corrected, so
that the model receives the averages of the fit. Sources of uncertainty that the model does not contain widen the
interval at both ends.

`measure` and `accept` state the same interval. A verdict requires two further numbers: `at_most_arcsec`, the smallest
limit that F'_ior of the full cycle meets with a probability of 95 %, and `at_least_arcsec`, the largest limit that it
exceeds with this probability. The former requires at least a third of the cycle (`LEAST_SHARE_OF_PASS`). With less, the
prior alone decides whether the remainder resembles the recorded part. The upper end also includes lines outside the
orders that the fit of `measure` finds, because in another cycle their peaks may coincide with those of the curve. If
the readings are coarse, most such lines are images of high orders. These recur in each cycle and are part of the model,
so they are not added.

The model applies only in its domain, which is defined in `reason_outside`: the cycle and the size of the error are
known, F'_ior refers to the whole cycle, and the direction has one torque and 12 % of the cycle or more. If the model
applies to both directions, the readings of both determine the result of each (`recording/directions.py`). The
conditions on the covered share apply to each direction alone, so that no direction passes by the readings of the other.
Slow terms must not be much larger than the error of the orders (they may result from a wrong ratio), and the effective
sample size must be sufficient. Outside this domain, only the range of the fitted orders is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import hypot

import numpy as np

from hdassist.features.measuring.fit import COVERAGE_FACTOR
from hdassist.features.measuring.measure import Measurement, SweepResult
from hdassist.features.measuring.orders import FULL_SHARE, SCATTER, FullCycle, combined, image_change
from hdassist.recording.figures import RangeFigure, part_to_record, range_figure
from hdassist.recording.positions import Recording, recording_from_columns
from hdassist.recording.posterior import AmplitudePosterior, posterior_of_recording, posteriors_of_directions
from hdassist.recording.waves import ALWAYS_ORDER, LEAST_BLOCKS_PER_REV, MOST_BLOCKS
from hdassist.run.errors import GUARD, SURE, DataError, UntrustedError

_LEAST_SHARE = 0.12  # share of the cycle below which the model was not validated (benchmarks/recordings.py)
LEAST_SHARE_OF_PASS = 1 / 3  # share of the cycle from which the upper end may pass a drive
# largest slow terms, as a multiple of the range of the orders; larger ones may result from a wrong ratio
_LARGEST_SLOW = 10.0
_FEWEST_EFFECTIVE = 40.0  # effective sample size below which the upper end is unknown
# agreement of phases for which a line lies within 0.6 of the resolution of the wave or of its image
_LINE_IS_WAVE = 0.5
_READINGS_AT_ONCE = 2000  # number of readings whose phases are in memory at a time
# gap between readings from which the recording is interrupted, and may continue with another level [input rev]
_INTERRUPTION_REV = 0.5
_CELLS_PER_REV = 8  # cells of an input revolution that both directions together must cover
_PAUSE = 1e6  # pause between two levels, in rows, which makes each level a separate run


def with_full_cycle(result: Measurement) -> Measurement:
    """Return a measurement with F'_ior of the full cycle for each direction, the one with the largest value first.

    result: measurement, which is returned unchanged if it already contains these results.
    """
    if all(direction.full_cycle is not None for direction in result.directions):
        return result
    posteriors = _posteriors(result)
    directions = [
        _direction_with_full_cycle(result, direction, posteriors[direction.direction])
        for direction in result.directions
    ]
    return replace(result, directions=tuple(sorted(directions, key=lambda each: -each.F_ior_arcsec)))


def _direction_with_full_cycle(
    result: Measurement,
    sweep: SweepResult,
    posterior: AmplitudePosterior | str,
) -> SweepResult:
    """Return a direction of a measurement with F'_ior of the full cycle.

    posterior: samples of the direction, or the reason why there are none.
    """
    cycle = posterior if isinstance(posterior, str) else _full_cycle_of(result, sweep, posterior)
    revolution = sweep.revolution
    if isinstance(cycle, FullCycle):
        # a revolution is a part of the recorded angles, but its range has another estimator, which may be larger
        revolution = revolution.at_most(cycle.value_arcsec)
    return replace(sweep, full_cycle=cycle, revolution=revolution)


def reason_outside(result: Measurement, sweep: SweepResult) -> str:
    """Return the reason why the model does not apply to a direction of a measurement, empty if it applies."""
    if result.gearing is None or sweep.coverage is None:
        return "the length of the full mesh cycle is unknown"
    if result.gearing.travel:
        return "F'_ior refers to a travel whose position in the cycle is unknown"
    if sweep.is_scale_bound:
        return "the declination of the guide star, which sets the scale of the error, is unknown"
    if sweep.direction == 0:
        return "both directions were combined"
    if result.trace.is_between_torques or len(sweep.fit.blocks) > 1 or _is_torque_changing(result, sweep):
        return "the torque varies during the recording"
    if sweep.coverage.share < _LEAST_SHARE:
        return f"less than {100 * _LEAST_SHARE:.0f} % of the cycle was recorded"
    if _blocks(sweep) > MOST_BLOCKS:
        return "the recording is longer than the model allows: record one full mesh cycle"
    if sweep.slow_arcsec > _LARGEST_SLOW * sweep.cam.value:
        return "slow terms are much larger than the error of the orders: check the ratio and the drift"
    return ""


def full_cycle(result: Measurement, sweep: SweepResult) -> FullCycle | str:
    """Return F'_ior of the full cycle, or the reason why it is not available.

    result: measurement.
    sweep: direction of the measurement.
    """
    posterior = _posteriors(result)[sweep.direction]
    return posterior if isinstance(posterior, str) else _full_cycle_of(result, sweep, posterior)


def is_joint(result: Measurement) -> bool:
    """Return whether one model describes both directions: it applies to each of them, at the same torque."""
    if {sweep.direction for sweep in result.directions} != {1, -1}:
        return False
    if any(reason_outside(result, sweep) for sweep in result.directions):
        return False
    return _is_same_torque(result, result.directions)


def is_covered_together(result: Measurement) -> bool:
    """Return whether one model describes both directions of a measurement, and together they cover the full cycle."""
    gearing = result.gearing
    if gearing is None or not is_joint(result):
        return False
    cells = round(_CELLS_PER_REV * gearing.cycle)
    covered = [np.floor(_CELLS_PER_REV * sweep.grid_turns).astype(np.int64) % cells for sweep in result.directions]
    return len(np.unique(np.concatenate(covered))) >= FULL_SHARE * cells


def has_comparable_directions(result: Measurement) -> bool:
    """Return whether a recording contains both directions at one torque, so that one model may describe them.

    result: measurement with both directions as one.
    """
    if {sweep.direction for sweep in result.alone} != {1, -1} or result.trace.is_between_torques:
        return False
    for sweep in result.alone:
        if len(sweep.fit.blocks) > 1 or _is_torque_changing(result, sweep) or _blocks(sweep) > MOST_BLOCKS:
            return False
    return _is_same_torque(result, result.alone)


def _is_same_torque(result: Measurement, directions: Sequence[SweepResult]) -> bool:
    """Return whether both directions were recorded at the same torque, which may be measured against the motion."""
    if result.torque is None:
        return True
    loads = [np.abs(sweep.bins.load) for sweep in directions]
    return not result.torque.is_change([np.concatenate(loads)])


def _posteriors(result: Measurement) -> dict[int, AmplitudePosterior | str]:
    """Return the samples of each direction by its number, or the reason why there are none."""
    if is_joint(result) and result.gearing:
        ratio = result.gearing.ratio
        by_direction = {sweep.direction: sweep for sweep in result.directions}
        try:
            forward, backward = posteriors_of_directions(
                cleaned_recording(by_direction[1], ratio),
                cleaned_recording(by_direction[-1], ratio),
                seed=result.seed,
            )
        except (DataError, UntrustedError) as error:
            return {1: str(error), -1: str(error)}
        return {1: forward, -1: backward}
    return {sweep.direction: _posterior_alone(result, sweep) for sweep in result.directions}


def _posterior_alone(result: Measurement, sweep: SweepResult) -> AmplitudePosterior | str:
    """Return the samples of a direction from its own readings, or the reason why there are none."""
    reason = reason_outside(result, sweep)
    if reason or result.gearing is None:
        return reason
    try:
        return posterior_of_recording(cleaned_recording(sweep, result.gearing.ratio), seed=result.seed)
    except (DataError, UntrustedError) as error:
        return str(error)


def _full_cycle_of(
    result: Measurement,
    sweep: SweepResult,
    posterior: AmplitudePosterior,
) -> FullCycle | str:
    """Return F'_ior of the full cycle from samples of a direction, or the reason why it is not available."""
    figure = range_figure(posterior, seed=result.seed)
    if figure.whole_effective < _FEWEST_EFFECTIVE:
        return "the effective sample size of the model for the full cycle is too small"
    # Over a whole cycle, the model contains the waves that coarse readings and fitted orders omit. Over a part it
    # depends on its prior, so those sources of uncertainty remain.
    other_uncertainty = sweep.range.others
    if not sweep.is_bound:
        other_uncertainty = combined([source for source in sweep.sources if source.name not in SCATTER])
    ends = _Ends(figure, other_uncertainty)
    low, high = ends.interval_arcsec
    at_least = ends.at_least_arcsec
    if sweep.is_bound:  # for parts of artificial steep waves, the lower end of the model was up to 2 % too high
        low = min(low, sweep.range.interval[0])
        at_least = min(at_least, sweep.range.value - GUARD * sweep.range.uncertainty)
    if high < sweep.range.value:
        return "the upper end from the model for the full cycle is below the range of the recorded part"
    with_lines = sweep.range.value + _rise_by_lines(sweep, posterior)
    # the chain of the model stays with the lower one of two orders that the readings do not distinguish
    with_images = sweep.range.value + image_change(sweep.fit, sweep.grid_turns, is_likely=True)
    least_end = max(with_lines, with_images)
    return FullCycle(
        value_arcsec=figure.median_seen_arcsec if sweep.is_bound else figure.median_recorded_arcsec,
        interval_arcsec=(low, max(high, least_end)),
        standard_uncertainty_arcsec=ends.part_uncertainty_arcsec if sweep.is_bound else ends.cycle_uncertainty_arcsec,
        at_least_arcsec=at_least,
        at_most_arcsec=max(ends.at_most_arcsec, least_end) if _is_enough_to_pass(sweep) else None,
        record_next_rev=part_to_record(posterior),
        effective_samples=figure.whole_effective,
    )


def _is_enough_to_pass(sweep: SweepResult) -> bool:
    """Return whether a direction covers enough of the cycle for its upper end to pass a drive."""
    return sweep.coverage is not None and sweep.coverage.share >= LEAST_SHARE_OF_PASS


def _rise_by_lines(sweep: SweepResult, posterior: AmplitudePosterior) -> float:
    """Return the rise of F'_ior in another cycle due to a fit's lines [arcsec], 0 if they are waves of high orders.

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
    """Ends of the interval of F'_ior from samples of the model, with sources of uncertainty outside the model.

    figure: F'_ior from samples of the model.
    others: standard uncertainty due to the sources outside the model [arcsec].
    """

    def __init__(self, figure: RangeFigure, others: float) -> None:
        self._figure = figure
        self._others = others

    @property
    def interval_arcsec(self) -> tuple[float, float]:
        """The 95 % interval, not below 0."""
        low, high = self._figure.interval_arcsec
        return self._lower(low, COVERAGE_FACTOR), self._upper(high, COVERAGE_FACTOR)

    @property
    def at_least_arcsec(self) -> float:
        """The largest limit that is exceeded with a probability of 95 %."""
        return self._lower(self._figure.lower_arcsec(SURE), GUARD)

    @property
    def at_most_arcsec(self) -> float:
        """The smallest limit that is met with a probability of 95 %."""
        return self._upper(self._figure.upper_arcsec(SURE), GUARD)

    @property
    def cycle_uncertainty_arcsec(self) -> float:
        """The standard uncertainty of F'_ior from the samples, a quarter of the width of their 95 % interval."""
        low, high = self._figure.interval_arcsec
        return (high - low) / (2 * COVERAGE_FACTOR)

    @property
    def part_uncertainty_arcsec(self) -> float:
        """The standard uncertainty of the range of the recorded part from the samples below its median."""
        return (self._figure.median_seen_arcsec - self._figure.interval_arcsec[0]) / COVERAGE_FACTOR

    def _lower(self, end: float, factor: float) -> float:
        """Return a lower end extended by the other sources of uncertainty.

        end: lower end from the samples.
        factor: number of standard uncertainties.
        """
        median = self._figure.median_seen_arcsec
        return max(0.0, median - hypot(median - end, factor * self._others))

    def _upper(self, end: float, factor: float) -> float:
        """Return an upper end extended by the other sources of uncertainty.

        end: upper end from the samples.
        factor: number of standard uncertainties.
        """
        median = self._figure.median_arcsec
        return median + hypot(end - median, factor * self._others)


def cleaned_recording(sweep: SweepResult, ratio: float) -> Recording:
    """Return the readings of a direction as corrected by `measure`.

    sweep: a direction of a measurement.
    ratio: input revolutions per output revolution.
    Raises DataError if the readings do not form a recording.
    """
    bins = sweep.bins
    error = bins.error.copy()
    for name, (slope, _) in sweep.fit.slopes.items():
        error -= slope * getattr(bins, name)
    is_new = (np.diff(bins.level, prepend=0) != 0) | (np.diff(bins.turns, prepend=bins.turns[0]) > _INTERRUPTION_REV)
    run = np.cumsum(is_new)
    rows = np.arange(len(bins), dtype=float)
    return recording_from_columns(
        input_rev=bins.turns,
        error_arcsec=error,
        ratio=ratio,
        sweep=run,
        time=rows + _PAUSE * run,
    )


def _blocks(sweep: SweepResult) -> float:
    """Return the number of blocks of readings that the model needs at least for a direction."""
    bins = sweep.bins
    revolutions = 0.0
    for level in range(bins.levels):
        revolutions += float(np.ptp(bins.turns[bins.level == level]))
    return min(len(bins), LEAST_BLOCKS_PER_REV * revolutions)


def _is_torque_changing(result: Measurement, sweep: SweepResult) -> bool:
    """Return whether the torque changes within or between the sweeps."""
    torque = result.torque
    return torque is not None and torque.is_change([sweep.bins.load])
