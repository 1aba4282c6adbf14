"""F'_ior of the full cycle from a recording that is part of it.

The rules of `orders` give a lower bound there. The model of `hdassist.recording` also gives an upper end: what the
prior of the waves leaves open at places without readings. There is no value in between, because that would be one of
the prior, which is cautious. The recording passes through the cleaning of `measure` first: spikes and steps are
removed, and a lag and a wind-up are taken off, so that the model gets the averages of the fit. The lower end stays that
of the rules, so every command gives the same lower bound.

For a verdict one number counts: `at_most_arcsec`, the smallest limit that F'_ior of the full cycle meets with a
probability of 95 %. It is given from a third of the cycle on (`LEAST_SHARE_OF_PASS`). Over less of it, the prior alone
decides whether the remainder is like the recorded part. Lines off the orders that the fit of `measure` names have to
find room in it too, since in another cycle their peaks may meet those of the curve.

The model holds only in its domain, and `reason_outside` is the one place that states it: the cycle and the size of the
error are known, F'_ior counts over all of the cycle, one direction, one torque, a recording of 12 % of the cycle or
more, slow terms that are not much larger than the error of the orders (they may come from a wrong ratio), and enough
effective samples. Outside it there is no upper end.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import numpy as np

from hdassist.errors import GUARD, SURE, DataError, UntrustedError
from hdassist.measuring.fit import COVERAGE_FACTOR
from hdassist.measuring.measure import Measurement, SweepResult
from hdassist.recording.figures import part_to_record, range_figure
from hdassist.recording.positions import Recording, recording_from_columns
from hdassist.recording.posterior import posterior_of_recording
from hdassist.recording.waves import BLOCKS_PER_REV

_LEAST_SHARE = 0.12  # of the cycle: less was not judged (benchmarks/recordings.py)
LEAST_SHARE_OF_PASS = 1 / 3  # of the cycle, from which the upper end may pass a drive
_LARGEST_SLOW = 10.0  # times the range of the orders: larger slow terms may come from a wrong ratio
_FEWEST_EFFECTIVE = 40.0  # samples: with fewer an upper end is not known
_MOST_BLOCKS = 30_000  # of readings: three cycles of ratio 100; the design of more takes too much memory
_PAUSE = 1e6  # rows between two levels, so that each is a run of its own


@dataclass(frozen=True)
class FullCycle:
    """F'_ior of the full cycle.

    interval_arcsec: lower bound of the recording and upper end over the cycle, 95 %.
    record_next_rev: part of the cycle that would narrow the interval most, as input revolutions of the recorded angles
        modulo the cycle; None if there is none.
    effective_samples: number of independent samples of the range.
    at_most_arcsec: smallest limit that F'_ior meets with a probability of 95 %; None if too little of the cycle was
        recorded to pass a drive.
    """

    interval_arcsec: tuple[float, float]
    record_next_rev: tuple[float, float] | None
    effective_samples: float
    at_most_arcsec: float | None


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
    sweep: one of its directions, whose F'_ior is a lower bound.
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
    median, others = figure.median_arcsec, sweep.range.others
    upper = median + hypot(figure.interval_arcsec[1] - median, COVERAGE_FACTOR * others)
    if upper < sweep.range.value:
        return "the model of the full cycle contradicts the range of the recorded part"
    at_most = median + hypot(figure.upper_arcsec(SURE) - median, GUARD * others)
    is_enough = sweep.coverage is not None and sweep.coverage.share >= LEAST_SHARE_OF_PASS
    return FullCycle(
        interval_arcsec=(sweep.interval_arcsec[0], upper),
        record_next_rev=part_to_record(posterior),
        effective_samples=figure.whole_effective,
        at_most_arcsec=max(at_most, sweep.range.value + sweep.range.rise) if is_enough else None,
    )


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
