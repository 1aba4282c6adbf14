"""Residuals of a fit outside its orders: spectral lines, outliers, and steps of the level.

Lines are due to ball passes, cages and vibration of the test rig. Omitting a line makes the range too small, never too
large. The residuals are therefore searched for lines, the strongest first, and each line is included in the fit with
its own order, until no significant line remains. A line is significant if noise alone reaches its power relative to the
mean of its neighbours only once in 1/LINE_FALSE_ALARM recordings. If the noise power is uniform over the neighbourhood,
this ratio has an F distribution with 2 and 2 m degrees of freedom for m resolved frequencies. Slow noise is not uniform
but decreases with the order, so the side on which the line is less significant decides.

Outliers and steps are errors of the readings, not of the drive: a shaft does not jump and return between two readings.
A recording with outliers is rejected. They are omitted and listed instead if the user requests it, or if they occur
where the shaft reverses. A large number of outliers is a fault of the test rig that a result must not hide. A step
remains in the recording: a coupling has slipped, or an encoder has lost counts. After it the error has another level,
which is fitted, and the orders continue.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.model.geometry import Array
from hdassist.features.measuring.fit import (
    EVEN,
    RESOLVED_GAP,
    TraceFit,
    distance,
    even_readings,
    fit_orders,
    residual_power,
)
from hdassist.features.measuring.orders import LINE_WIDTH
from hdassist.features.measuring.terms import BINS_PER_COLUMN, Bins, TraceDesign, order_columns
from hdassist.readers.table import shortened
from hdassist.readers.trace import MeasuredTrace
from hdassist.recording.steps import clear_step
from hdassist.run.errors import Fault, UntrustedError

_LINE_FALSE_ALARM = 0.01  # probability that a recording without lines shows one
_PROBES_PER_PLACE = 2.5  # probed frequencies per resolved frequency, so that peaks between these are found
_NEIGHBOURHOOD = 32  # resolved frequencies on each side that represent the noise
_FEWEST_NEIGHBOURS = 2  # minimum number of resolved frequencies on a side
_CLOSEST_ORDERS = 0.4  # smallest distance of fitted orders, as a share of the resolution
_FEWEST_PERIODS = 3.0  # minimum number of periods of a line in the recording; with fewer it looks like drift
# highest order of a line, as a multiple of the highest fitted order: averages over bins attenuate faster lines
_HIGHEST_LINE = 4.0
_TORQUE_LINE = 0.5  # share of the slope over the torque below which a line that reduces it is wind-up
_SMALLEST_LINE = 0.01  # smallest line, as a share of the largest amplitude; smaller lines count as noise
_MAX_LINES = 8  # maximum number of lines
_ORDER_ITERATIONS = 2  # Gauss-Newton iterations for the order of a line
_SPIKE_SIGMAS = 6.0  # number of robust standard deviations of the residuals that a spike exceeds
_SPIKE_RANGE_SHARE = 0.1  # smallest spike, as a share of the range of the curve; smaller ones hardly matter
_SPIKE_SPARSE_SHARE = 0.5  # the same share next to a gap of more than half a period of the highest order
_LONGEST_SPIKE = 2  # maximum number of readings in a spike; a longer departure may be due to the drive
_BESIDE_SPIKE = 7  # number of adjacent readings for the median with which a reading is compared
_TO_SIGMA = 1.4826  # standard deviation of normal readings divided by their median absolute deviation
_MAX_SPIKE_SHARE = 1 / 20  # largest share of spikes among the readings; if there are more, the test rig is at fault
_NAMED_LINES = 3  # maximum number of lines named in a message
_STEP_TURNS = 0.5  # input revolutions compared on each side of a step
_FEWEST_BESIDE_STEP = 8  # minimum number of readings on each side of a step
_SHARP = 0.7  # smallest share of a step that is present over a quarter of the adjacent readings
_STEP_SIGMAS = 8.0  # number of robust standard deviations of the differences that a step exceeds
# smallest step that the evidence may show, as a share of the range of the fitted curve: a smaller one hardly matters,
# and in computed recordings without noise, missing waves are evidence
_SMALLEST_STEP = 0.02
# smallest share of the size of a step by the evidence that the fit of the measurement, which has other waves, confirms
_CONFIRMED_SHARE = 0.5
# Smallest step of the residuals, as a share of the range of the fitted curve. A smaller step counts as noise.
_STEP_RANGE_SHARE = 0.1
_MOST_BREAKS = 3  # maximum number of removed steps; if there are more, the test rig or the drive is at fault


@dataclass(frozen=True)
class _Peak:
    """A peak of the residuals.

    order: order per input revolution.
    amplitude: amplitude [arcsec].
    chance: expected number of such peaks due to noise in a recording.
    """

    order: float
    amplitude: float
    chance: float


@dataclass(frozen=True, eq=False)
class _TraceChange:
    """A recording without an identified error of its readings, and the warning that describes the error."""

    trace: MeasuredTrace
    warning: str


def with_lines(fit: TraceFit) -> TraceFit:
    """Return a fit with the significant lines of its residuals that the readings resolve.

    Evenly spaced readings do not distinguish an order above half the number of readings per revolution from a lower
    one, its image. Unevenly spaced readings do. Sidebands that remain in the residuals of a part of an output
    revolution are an exception, because their images look like lines.
    """
    bins = fit.bins
    base = fit.design
    rate, _, evenness = even_readings(bins)
    # above half the rate of even readings, a line would be an image
    has_images = evenness > EVEN or fit.design.slow.by_angle
    # averaging over bins attenuates faster lines
    highest = min(_HIGHEST_LINE * float(base.orders[-1]), rate / 2 if has_images else np.inf)
    # lines are added one at a time, because each changes the residuals
    while len(fit.lines) < _MAX_LINES and len(bins) >= BINS_PER_COLUMN * (fit.design.columns + 2):
        peak = _highest_peak(fit, highest)
        if peak is None or peak.chance > _LINE_FALSE_ALARM or peak.amplitude < _SMALLEST_LINE * fit.amplitude.max():
            break
        try:
            trial = _settled(fit, base, peak.order)
        except UntrustedError:  # the line is too close to a fitted order
            break
        # reject a line that only represents the wind-up differently
        if "load" in fit.slopes and abs(trial.slopes["load"][0]) < _TORQUE_LINE * abs(fit.slopes["load"][0]):
            # noise of the torque makes the slope too small, and such a line is the remaining wind-up
            break
        fit = trial
    return fit


def _highest_peak(fit: TraceFit, highest: float) -> _Peak | None:
    """Return the peak of the residuals that exceeds its neighbours most clearly, or None if there is no free frequency.

    highest: order up to which peaks are considered.
    """
    bins = fit.bins
    variance = float((bins.weight * fit.residual**2).mean())
    if not variance:
        return None
    probes, power = residual_power(bins, fit.residual, variance)
    resolution = 1 / bins.span
    # probes are closer together than the resolution, so each counts as a part of a resolved frequency
    places_per_probe = bins.per_turn * bins.span / len(probes) / 2
    is_free = _is_free(fit, probes) & (probes <= highest)
    # a wave with fewer periods looks like drift
    if not (is_free & (probes >= _FEWEST_PERIODS * resolution)).any():
        return None
    free_probes = probes[is_free]
    free_power = power[is_free]
    index, log_chance = _least_likely(free_probes, free_power, free_power, resolution, places_per_probe)
    # first test: the peak relative to its neighbours as they are
    order = float(free_probes[index])
    # in a short recording, side lobes of a line reach its neighbours, so the test is repeated without the line
    power_without = _power_without(fit, order, variance)[is_free]
    is_peak = np.abs(free_probes - order) < LINE_WIDTH * resolution
    peak_power = np.where(is_peak, free_power, 0.0)
    _, log_chance_alone = _least_likely(free_probes, peak_power, power_without, resolution, places_per_probe)
    # the second test, without the side lobes of the peak, may show it more clearly
    chance_in_place = float(np.exp(min(log_chance, log_chance_alone)))
    # conversion of relative power to arcsec
    square = free_power[index] * variance * float((bins.weight**2).sum())
    return _Peak(
        order=order,
        amplitude=float(2 * np.sqrt(square) / float(bins.weight.sum())),
        chance=_PROBES_PER_PLACE * int(is_free.sum()) * places_per_probe * chance_in_place,
    )


def _power_without(
    fit: TraceFit,
    order: float,
    variance: float,
) -> Array:
    """Return the power of the residuals of a fit after removal of a wave at an order, shape (probes,)."""
    column, coefficients = fit.beside(order_columns(fit.bins.turns, np.array([order])))
    _, power = residual_power(fit.bins, fit.residual - column @ coefficients, variance)
    return power


def _is_free(fit: TraceFit, probes: Array) -> NDArray[np.bool_]:
    """Return whether orders are resolved from those of a fit and from its slow terms, shape (probes,)."""
    resolution = 1 / fit.bins.span
    is_resolved = distance(probes, fit.orders) >= RESOLVED_GAP * resolution
    return np.asarray(is_resolved & (probes >= fit.design.slow.periods * resolution))


def _least_likely(
    probes: Array,
    power: Array,
    neighbours: Array,
    resolution: float,
    places_per_probe: float,
) -> tuple[int, float]:
    """Return the index of the probe whose power is least likely to be noise, and the logarithm of that probability.

    The power of noise at m frequencies has a chi-square distribution with 2 m degrees of freedom. The probability that
    the power at a single frequency exceeds the mean of m others by a ratio r is (1 + r / m)^-m.

    probes: orders, increasing, shape (probes,).
    power: power at the probes, shape (probes,).
    neighbours: power of each probe when it is a neighbour of another probe, shape (probes,).
    resolution: resolution of the recording, in orders.
    places_per_probe: number of resolved frequencies per probe.
    """
    count = len(probes)
    # sums over windows are differences of a cumulative sum
    total = np.concatenate([[0.0], np.cumsum(neighbours)])
    reach = max(1, int(_NEIGHBOURHOOD / places_per_probe))
    index = np.arange(count)
    last_below = np.searchsorted(probes, probes - LINE_WIDTH * resolution)
    first_above = np.searchsorted(probes, probes + LINE_WIDTH * resolution)
    # neighbours below and above, excluding the peak itself
    windows = (
        (np.maximum(index - reach, 0), last_below),
        (first_above, np.minimum(index + reach, count)),
    )
    log_chances = []
    for first, last in windows:
        places = np.maximum(last - first, 0) * places_per_probe
        noise = (total[np.maximum(first, last)] - total[first]) * places_per_probe
        ratio = power / np.maximum(noise, 1e-300)
        # tail probability of the ratio of exponential power to the mean of exponential neighbours
        log_chances.append(np.where(places >= _FEWEST_NEIGHBOURS, -places * np.log1p(ratio), 0.0))
    # both sides must be significant, so the larger probability decides; near the last probe only the lower side counts,
    # because the noise above it is not larger
    log_chance = np.where(index + reach < count, np.max(log_chances, axis=0), log_chances[0])
    log_chance = np.where(probes >= _FEWEST_PERIODS * resolution, log_chance, np.inf)
    least = int(log_chance.argmin())
    return least, float(log_chance[least])


def _settled(
    fit: TraceFit,
    base: TraceDesign,
    order: float,
) -> TraceFit:
    """Return a fit with one further line, after refining the orders of all lines.

    If the recording does not resolve the line from a fitted order, the line is placed between two orders.

    fit: fit with the lines found so far.
    base: design of the orders that are not lines.
    order: order of the further line.
    Raises UntrustedError if there is no room for the line.
    """

    def with_these(lines: Array) -> TraceFit:
        """Return the fit with the given lines."""
        return fit_orders(fit.bins, base.orders, base.slow, lines=lines, base=base)

    with suppress(UntrustedError):  # the line may have moved onto a fitted order
        trial = with_these(np.append(fit.lines, order))
        # a line that exchanges amplitude with an order would drift away from it
        fixed_lines = fit.lines[fit.unresolved[fit.is_line]]
        for _ in range(_ORDER_ITERATIONS):
            is_free = ~np.isin(trial.lines, fixed_lines)
            trial = with_these(trial.lines + is_free * _line_steps(trial))
        # if the line moved onto an order, it is placed between orders below
        if trial.unresolved.sum() <= fit.unresolved.sum():
            return trial
    return with_these(np.append(fit.lines, _place_between(fit, order)))


def _line_steps(fit: TraceFit) -> Array:
    """Return the steps of the orders of lines towards a better fit, to first order, shape (lines,).

    The derivative of a cos(p) + b sin(p) with respect to the order f, with p = 2 pi f x, is 2 pi x (b cos(p) - a
    sin(p)). The angle x is measured from the middle of the recording, so that a step does not change the phase there.
    """
    bins = fit.bins
    resolution = 1 / bins.span
    a, b = fit.coefficients.reshape(2, -1)[:, fit.is_line]
    phase = (2 * np.pi) * bins.turns[:, None] * fit.lines
    # derivative of the wave with respect to its order, about the middle of the recording
    derivative = (2 * np.pi) * (bins.turns - bins.turns.mean())[:, None] * (b * np.cos(phase) - a * np.sin(phase))
    return np.clip(fit.beside(derivative)[1], -resolution / 2, resolution / 2)


def _place_between(fit: TraceFit, order: float) -> float:
    """Return the best order for a line among fitted orders that the recording does not resolve from it.

    Candidates are half-way between two orders, or half the resolution from one order. The result is the candidate that
    reduces the residuals most, because the line and the orders together fit the error there.

    Raises UntrustedError if there is no candidate.
    """
    bins = fit.bins
    orders = fit.orders
    resolution = 1 / bins.span
    # in gaps this narrow, no position is resolved from both orders
    has_narrow_gap = np.diff(orders) < 2 * RESOLVED_GAP * resolution
    middles = (orders[1:] + orders[:-1])[has_narrow_gap] / 2
    places = np.concatenate([middles, orders - resolution / 2, orders + resolution / 2])
    is_near = np.abs(places - order) < 0.5
    is_free = distance(places, orders) > _CLOSEST_ORDERS * resolution
    places = np.unique(places[is_near & is_free])
    if not len(places):
        raise UntrustedError("the recording does not resolve another component from the fitted orders", "")
    reductions = []
    for place in places:
        column, coefficients = fit.beside(order_columns(bins.turns, place[None]))
        # reduction of the sum of squares by the candidate
        reductions.append(bins.weight @ (column @ coefficients) ** 2)
    return float(places[int(np.argmax(reductions))])


def _departures(
    trace: MeasuredTrace,
    bins: Bins,
    fitted: Array,
) -> list[Array]:
    """Return the errors of the rows minus a curve [arcsec], by sweep.

    fitted: values of the curve at the bins [arcsec], shape (bins,).
    """
    departures = []
    sweeps = zip(
        trace.by_sweep(trace.cam_deg / 360),
        trace.by_sweep(trace.error_arcsec),
        bins.by_sweep(bins.turns),
        bins.by_sweep(fitted),
        strict=True,
    )
    for turns, error, bin_turns, curve in sweeps:
        # the curve is interpolated at the rows, which are finer than the bins
        departures.append(error - np.interp(turns, bin_turns, curve))
    return departures


@dataclass(frozen=True, eq=False)
class _StepSizes:
    """Differences between mean errors after and before rows [arcsec], and the row indices, each of shape (rows,)."""

    size: Array
    row: NDArray[np.int64]

    @property
    def usual(self) -> float:
        """The robust standard deviation of the differences [arcsec]."""
        if not self.size.any():
            return 0.0
        return _TO_SIGMA * float(np.median(np.abs(self.size[self.size != 0])))


def with_step(
    trace: MeasuredTrace,
    fit: TraceFit,
    ratio: float,
) -> _TraceChange | None:
    """Return a trace with a new level after a step of the error, or None if there is no step.

    The evidence of a model with all sidebands decides, or if there is none, the residuals of the fit.

    ratio: input revolutions per output revolution.
    """
    if len(trace.breaks) == _MOST_BREAKS:
        return None
    step = _evident_step(trace, fit, ratio) or _large_step(trace, fit)
    if step is None or int(trace.line[step.row]) in trace.breaks:
        return None
    line = int(trace.line[step.row])
    where = f"the error steps by {step.size:.3g}″ at line {line}"
    warning = f"{where}, as if a coupling had slipped or counts were lost; the step is removed"
    return _TraceChange(replace(trace, breaks=tuple(sorted((*trace.breaks, line)))), warning)


@dataclass(frozen=True)
class _Step:
    """Row of a trace at which the error steps, and the size of the step [arcsec]."""

    row: int
    size: float


def _evident_step(
    trace: MeasuredTrace,
    fit: TraceFit,
    ratio: float,
) -> _Step | None:
    """Return the step of which the readings are evidence and which the fit confirms, or None.

    Waves that the model of the evidence lacks resemble a step. They are others than those that the fit lacks, so the
    sizes of such a step differ.

    ratio: input revolutions per output revolution.
    """
    bins = fit.bins
    error = bins.error.copy()
    for name, (slope, _) in fit.slopes.items():
        error -= slope * getattr(bins, name)
    step = clear_step(bins.turns, error, bins.level, ratio)
    if step is None or abs(step.size_arcsec) < _SMALLEST_STEP * float(np.ptp(fit.curve(bins.turns))):
        return None
    sweep = trace.sweeps[int(bins.sweep[step.first])]
    # bins ascend with the angle, rows with time
    border = float(bins.turns[step.first - 1] + bins.turns[step.first]) / 2
    is_after = sweep.direction * (trace.cam_deg[sweep.rows] / 360 - border) >= 0
    row = sweep.start + int(is_after.argmax())
    size = sweep.direction * step.size_arcsec
    fitted_size = _fitted_step(trace, fit, row)
    if fitted_size is None or fitted_size / size < _CONFIRMED_SHARE:
        return None
    return _Step(row=row, size=size)


def _large_step(trace: MeasuredTrace, fit: TraceFit) -> _Step | None:
    """Return the largest step of the residuals, or None if there is no step.

    A step is the difference between the means over _STEP_TURNS before and after a reading. It is far larger than such
    differences at most readings, and about as large over a quarter of that distance, over which a slope would be
    smaller.
    """
    fitted = fit.curve(fit.bins.turns)
    # differences of the means over half an input revolution before and after each row
    steps = _step_sizes(trace, _departures(trace, fit.bins, fitted))
    if steps is None:
        return None
    index = int(np.abs(steps.size).argmax())
    size = float(steps.size[index])
    row = int(steps.row[index])
    # the step must exceed the noise and be significant relative to the curve
    if abs(size) < max(_STEP_SIGMAS * steps.usual, _STEP_RANGE_SHARE * float(np.ptp(fitted))):
        return None
    fitted_size = _fitted_step(trace, fit, row)
    return None if fitted_size is None else _Step(row=row, size=fitted_size)


def _step_sizes(trace: MeasuredTrace, departures: Sequence[Array]) -> _StepSizes | None:
    """Return the sharp differences of means after and before the rows of a trace, or None if all sweeps are too short.

    Differences that a slope can explain are set to 0.

    departures: readings minus the fit [arcsec], by sweep.
    """
    sizes = []
    rows = []
    for sweep, departure in zip(trace.sweeps, departures, strict=True):
        span = float(np.ptp(trace.cam_deg[sweep.rows])) / 360
        # rows in half an input revolution
        reach = int(_STEP_TURNS * len(sweep) / max(span, _STEP_TURNS))
        if reach < _FEWEST_BESIDE_STEP or len(sweep) < 4 * reach:
            continue
        total = np.cumsum(np.append(0.0, departure))
        index = np.arange(reach, len(sweep) - reach)
        wide = _difference_of_means(total, index, reach)
        close = _difference_of_means(total, index, max(reach // 4, _FEWEST_BESIDE_STEP))
        # over a quarter of the distance, a step has its full size, and a drift has a quarter of its size
        is_sharp = close / np.where(wide, wide, 1.0) > _SHARP
        sizes.append(np.where(is_sharp, wide, 0.0))
        rows.append(sweep.start + index)
    if not sizes:
        return None
    return _StepSizes(size=np.concatenate(sizes), row=np.concatenate(rows))


def _difference_of_means(
    total: Array,
    index: NDArray[np.int64],
    reach: int,
) -> Array:
    """Return the mean over `reach` values after indices minus that before them.

    total: cumulative sum of the values.
    index: indices.
    reach: number of values on each side.
    """
    return np.asarray((total[index + reach] - 2 * total[index] + total[index - reach]) / reach)


def _fitted_step(
    trace: MeasuredTrace,
    fit: TraceFit,
    row: int,
) -> float | None:
    """Return the size of a step at a row from a joint fit [arcsec], or None if a drift explains more of the residuals.

    A cycle that does not close because of a drift has a step at its end.
    """
    bins = fit.bins
    turns = trace.cam_deg[row] / 360
    number = next(number for number, sweep in enumerate(trace.sweeps) if sweep.start <= row < sweep.stop)
    direction = trace.sweeps[number].direction
    # rows after the step in time; in a decreasing sweep these have smaller angles
    is_behind = (bins.sweep == number) & ((bins.turns - turns) * direction >= 0)
    step_column, (step,) = fit.beside(is_behind.astype(float)[:, None])
    drift_column, (drift,) = fit.beside((bins.travel / fit.design.reach)[:, None])
    # reduction of the sum of squares by each explanation
    by_step = step**2 * (bins.weight @ step_column**2)[0]
    by_drift = drift**2 * (bins.weight @ drift_column**2)[0]
    return None if by_step < by_drift else float(step)


def without_spikes(trace: MeasuredTrace, fit: TraceFit) -> _TraceChange | None:
    """Return a trace without spikes, which are short departures of its sweeps from a fit, or None if there are none.

    Raises UntrustedError if spikes may not be omitted from the trace, or are too many to omit.
    """
    fitted = fit.bins.error - fit.residual
    # rows are examined instead of bins, because a bin would hide a single bad row
    departures = _departures(trace, fit.bins, fitted)
    size = np.abs(np.concatenate(departures))
    is_spike = _is_short_spike(departures, size, float(np.ptp(fitted)))
    is_spike &= size > _least_spike(trace, fit, float(np.ptp(fitted)))
    is_spike &= size > 2 * _largest_of_others(trace, size, is_spike)
    spikes = np.flatnonzero(is_spike)
    if not len(spikes):
        return None
    spike_rows = trace.rows[spikes]
    lines = shortened(trace.line[spike_rows].tolist(), _NAMED_LINES)
    message = f"lines {lines} deviate from the other readings by up to {size[spikes].max():.3g}″"
    if len(spikes) > _MAX_SPIKE_SHARE * len(trace.rows):
        hint = "check the cables and counters of the encoders"
        raise UntrustedError(f"{trace.file}: {message}; these are too many rows to omit", hint, Fault.ORDERS_UNTOLD)
    # at the end of a sweep backlash can explain a departure; within a sweep nothing can
    is_within = _rows_to_end(departures)[spikes] >= _LONGEST_SPIKE
    if not trace.robust and is_within.any():  # the cause is not backlash or a lag at a reversal
        hint = "check the cables and counters of the encoders, or omit these rows with --robust"
        raise UntrustedError(
            f"{trace.file}: {message}; no movement of a shaft explains this", hint, Fault.ORDERS_UNTOLD
        )
    span = np.ptp(fit.curve(fit.bins.turns))
    return _TraceChange(
        trace=trace.without(spike_rows),
        warning=f"{message}, omitted; with them the curve would span {span:.1f}″",
    )


def _is_short_spike(
    departures: Sequence[Array],
    size: Array,
    extent: float,
) -> NDArray[np.bool_]:
    """Return whether each reading belongs to a short group far from the fit and from its neighbours, shape (rows,).

    departures: readings minus the fit [arcsec], by sweep.
    size: absolute values of the departures, shape (rows,).
    extent: range of the fitted curve [arcsec].
    """
    # imported here because it takes 20 ms, which measured holes do not need
    from scipy.ndimage import binary_opening, median_filter

    noise = _TO_SIGMA * float(np.median(size))
    # a spike also distorts the fit at its neighbours, so only the largest departures are considered
    is_far = size > max(_SPIKE_SIGMAS * noise, _SPIKE_RANGE_SHARE * extent, float(size.max()) / 2)
    is_short = is_far & ~binary_opening(is_far, np.ones(_LONGEST_SPIKE + 1))
    # a misfit of the curve is smooth, so that neighbours depart equally; it is largest at the ends of a recording
    from_neighbours = np.concatenate(
        [np.abs(departure - median_filter(departure, _BESIDE_SPIKE, mode="mirror")) for departure in departures]
    )
    usual = _SPIKE_SIGMAS * _TO_SIGMA * np.median(from_neighbours)
    return np.asarray(is_short & (from_neighbours > np.maximum(size / 2, usual)))


def _least_spike(
    trace: MeasuredTrace,
    fit: TraceFit,
    extent: float,
) -> Array:
    """Return the smallest spike that counts at each reading [arcsec], shape (rows,).

    It is larger next to a gap that is too wide to follow the curve, and 0 elsewhere.

    extent: range of the fitted curve [arcsec].
    """
    turns = trace.cam_deg[trace.rows] / 360
    gap_behind = np.abs(np.diff(turns, append=turns[-1]))
    gap_before = np.abs(np.diff(turns, prepend=turns[0]))
    is_sparse = np.maximum(gap_behind, gap_before) > 1 / (2 * fit.orders[-1])
    return np.where(is_sparse, _SPIKE_SPARSE_SHARE * extent, 0.0)


def _largest_of_others(
    trace: MeasuredTrace,
    size: Array,
    is_spike: NDArray[np.bool_],
) -> Array:
    """Return the largest departure among the normal readings around each reading [arcsec], shape (rows,).

    The maximum is taken over readings that are not spikes, in the input revolution of the reading and the two adjacent
    ones.
    """
    turns = trace.cam_deg[trace.rows] / 360
    # revolutions are counted from 1, because the first needs an (empty) predecessor
    revolution = np.floor(turns - turns.min()).astype(np.int64) + 1
    largest = np.zeros(revolution.max() + 2)
    np.maximum.at(largest, revolution, np.where(is_spike, 0.0, size))
    return np.asarray(np.max([largest[revolution - 1], largest[revolution], largest[revolution + 1]], axis=0))


def _rows_to_end(departures: Sequence[Array]) -> NDArray[np.int64]:
    """Return the number of rows between each reading and the nearer end of its sweep, shape (rows,)."""
    numbers = [np.arange(len(departure)) for departure in departures]
    return np.concatenate([np.minimum(number, number[::-1]) for number in numbers])
