"""Residuals of a fit outside its orders: spectral lines, outliers, and steps of the level.

Lines are ball passes, cages, vibration of the test rig. A line that is left out makes the range too small, never too
large. The residuals are therefore searched for lines, the strongest first, and each is included in the fit with its
own order, until no line is significant. A line is significant if noise alone reaches its power over the mean of its
neighbours only once in 1/LINE_FALSE_ALARM recordings. For a noise power that is even over the neighbourhood this
ratio has an F distribution with 2 and 2 m degrees of freedom, m resolved places. Slow noise is not even but decreases
with the order; the side of the neighbours that makes the line less significant counts.

Outliers and steps are faults of the reading, not of the drive: a shaft does not jump and return between two readings.
Such readings are refused. They are left out and named if that is requested, or where the shaft reverses; a large
number of them is a fault of the test rig that a result must not hide. A step remains in the recording: a coupling has
slipped, or an encoder has lost counts. After it the error has another level, which is fitted; the orders continue.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from hdassist.errors import Fault, UntrustedError
from hdassist.measuring.fit import EVEN, RESOLVED_GAP, TraceFit, distance, even_readings, fit_orders, residual_power
from hdassist.measuring.orders import LINE_WIDTH
from hdassist.measuring.terms import BINS_PER_COLUMN, Bins, order_columns
from hdassist.model.geometry import Array
from hdassist.readers.table import shortened
from hdassist.readers.trace import MeasuredTrace

_LINE_FALSE_ALARM = 0.01  # of a record without lines
_PROBES_PER_PLACE = 2.5  # places probed, for each resolved place, so that peaks between these are found
_NEIGHBOURHOOD = 32  # resolved places on each side that stand for the noise
_FEWEST_NEIGHBOURS = 2  # of them
_CLOSEST_ORDERS = 0.4  # of the resolution: no order is fitted nearer to another
_FEWEST_PERIODS = 3.0  # periods in the record: below, it drifts
_HIGHEST_LINE = 4.0  # times the highest order: beyond, averages over bins make lines smaller
_TORQUE_LINE = 0.5  # of a slope over the torque, that a line which goes with it leaves
_SMALLEST_LINE = 0.01  # of the greatest amplitude: a smaller line is left in the noise
_MAX_LINES = 8  # lines
_ORDER_ITERATIONS = 2  # of Gauss and Newton for the order of a line
_SPIKE_SIGMAS = 6.0  # robust standard deviations of the readings around the fit
_SPIKE_RANGE_SHARE = 0.1  # of the fitted curve: a smaller spike has no effect
_SPIKE_SPARSE_SHARE = 0.5  # the same, where a reading beside it is further off than half a period of the highest order
_LONGEST_SPIKE = 2  # readings: a longer one may be the drive
_BESIDE_SPIKE = 7  # readings around one, of whose departures the median is taken
_TO_SIGMA = 1.4826  # standard deviation of normal readings over their median departure
_MAX_SPIKE_SHARE = 1 / 20  # of the readings: with more of them the rig is at fault
_NAMED_LINES = 3  # lines in a message
_STEP_TURNS = 0.5  # of the cam, to each side of a step
_FEWEST_BESIDE_STEP = 8  # readings there
_SHARP = 0.7  # of a step: what a quarter of the readings beside it show, at least
_STEP_SIGMAS = 8.0  # robust standard deviations of such differences
_STEP_RANGE_SHARE = 0.1  # of the fitted curve: a smaller step is left to the noise
_MOST_BREAKS = 3  # of more the rig is at fault, or the drive


@dataclass(frozen=True)
class _Peak:
    """A peak of the residuals: its order per cam turn, amplitude [arcsec], and how often noise has such a one."""

    order: float
    amplitude: float
    chance: float


def with_lines(fit: TraceFit) -> TraceFit:
    """Return a fit with the significant lines of its residuals, as far as the readings resolve them.

    Even readings show only images of lower orders above half the readings per revolution. Uneven readings distinguish
    them, except for sidebands that a part of an output revolution leaves in the residuals, whose images look like
    lines.
    """
    bins, orders = fit.bins, fit.orders
    rate, _, evenness = even_readings(bins)
    has_images = evenness > EVEN or fit.design.slow.by_angle
    finest = min(_HIGHEST_LINE * float(orders[-1]), rate / 2 if has_images else np.inf)
    while len(fit.lines) < _MAX_LINES and len(bins) >= BINS_PER_COLUMN * (fit.design.columns + 2):
        peak = _highest_peak(fit, finest)
        if peak is None or peak.chance > _LINE_FALSE_ALARM or peak.amplitude < _SMALLEST_LINE * fit.amplitude.max():
            break
        try:
            trial = _settled(fit, orders, peak.order)
        except UntrustedError:  # too near to a fitted order
            break
        if "load" in fit.slopes and abs(trial.slopes["load"][0]) < _TORQUE_LINE * abs(fit.slopes["load"][0]):
            break  # it goes with the torque, whose noise makes the slope too small: the rest of its wind-up
        fit = trial
    return fit


def _highest_peak(fit: TraceFit, highest: float) -> _Peak | None:
    """The peak of the residuals, up to an order, that stands out most from its neighbours; None: there is no room."""
    bins = fit.bins
    variance = float((bins.weight * fit.residual**2).mean())
    if not variance:
        return None
    probes, power = residual_power(bins, fit.residual, variance)
    resolution = 1 / bins.span
    per_probe = bins.per_turn * bins.span / len(probes) / 2  # resolved places for each probe
    free = (distance(probes, fit.orders) >= RESOLVED_GAP * resolution) & (probes <= highest)
    free &= probes >= fit.design.slow.periods * resolution
    if not (free & (probes >= _FEWEST_PERIODS * resolution)).any():
        return None
    place, tail = _least_likely(probes[free], power[free], power[free], resolution, per_probe)
    order = float(probes[free][place])
    # in a short record side lobes of a line reach its neighbours: they are looked at without it
    own, pair = fit.beside(order_columns(bins.turns, np.array([order])))
    _, others = residual_power(bins, fit.residual - own @ pair, variance)
    near = np.abs(probes[free] - order) < LINE_WIDTH * resolution
    _, alone = _least_likely(probes[free], np.where(near, power[free], 0.0), others[free], resolution, per_probe)
    chance = _PROBES_PER_PLACE * int(free.sum()) * per_probe * float(np.exp(min(tail, alone)))
    top = 2 * np.sqrt(power[free][place] * variance * float((bins.weight**2).sum())) / float(bins.weight.sum())
    return _Peak(order, float(top), chance)


def _least_likely(probes: Array, power: Array, others: Array, resolution: float, per_probe: float) -> tuple[int, float]:
    """The place whose power noise has least often, and the logarithm of the chance; others: power of its neighbours.

    per_probe: resolved places for each of them.
    """
    total = np.concatenate([[0.0], np.cumsum(others)])
    reach, at = max(1, int(_NEIGHBOURHOOD / per_probe)), np.arange(len(probes))
    below, above = (np.searchsorted(probes, probes + side * resolution) for side in (-LINE_WIDTH, LINE_WIDTH))
    sides = ((np.maximum(at - reach, 0), below), (above, np.minimum(at + reach, len(probes))))
    tails = []
    for first, last in sides:
        places = np.maximum(last - first, 0) * per_probe
        ratio = power / np.maximum((total[np.maximum(first, last)] - total[first]) * per_probe, 1e-300)
        tails.append(np.where(places >= _FEWEST_NEIGHBOURS, -places * np.log1p(ratio), 0.0))
    # above the last place there is no neighbour, and no more noise than below
    tail = np.where(at + reach < len(probes), np.max(tails, axis=0), tails[0])
    tail = np.where(probes >= _FEWEST_PERIODS * resolution, tail, np.inf)
    best = int(tail.argmin())
    return best, float(tail[best])


def _settled(fit: TraceFit, orders: Array, order: float) -> TraceFit:
    """Return a fit with one further line, with the orders of the lines moved to the best fit.

    If a line is so close to a fitted order that the recording does not resolve them, it is put halfway between two
    orders, or half the resolution from one, where it reduces the residuals most: together they fit the error there.
    Raises UntrustedError if there is no room.
    """
    bins, slow, resolution = fit.bins, fit.design.slow, 1 / fit.bins.span
    held = fit.unresolved[fit.is_line]
    with suppress(UntrustedError):  # it came to where an order is
        trial = fit_orders(bins, orders, slow, np.append(fit.lines, order))
        for _ in range(_ORDER_ITERATIONS):
            free = ~np.isin(trial.lines, fit.lines[held])
            a, b = trial.coefficients.reshape(2, -1)[:, trial.is_line]
            phase = (2 * np.pi) * bins.turns[:, None] * trial.lines
            slopes = (2 * np.pi) * (bins.turns - bins.turns.mean())[:, None] * (b * np.cos(phase) - a * np.sin(phase))
            step = np.clip(trial.beside(slopes)[1], -resolution / 2, resolution / 2)  # to first order
            trial = fit_orders(bins, orders, slow, trial.lines + free * step)
        if trial.unresolved.sum() <= fit.unresolved.sum():
            return trial
    every = fit.orders
    gaps = np.diff(every) < 2 * RESOLVED_GAP * resolution
    places = np.concatenate([(every[1:] + every[:-1])[gaps] / 2, every - resolution / 2, every + resolution / 2])
    places = np.unique(
        places[(np.abs(places - order) < 0.5) & (distance(places, every) > _CLOSEST_ORDERS * resolution)]
    )
    if not len(places):
        raise UntrustedError("no room for a line", "")
    pairs = [fit.beside(order_columns(bins.turns, place[None])) for place in places]
    squares = [bins.weight @ (own @ pair) ** 2 for own, pair in pairs]
    return fit_orders(bins, orders, slow, np.append(fit.lines, places[int(np.argmax(squares))]))


def _departures(trace: MeasuredTrace, bins: Bins, fitted: Array) -> list[Array]:
    """Errors [arcsec] of the rows of each sweep of a trace less a curve, from its values at the bins."""
    columns = *map(trace.by_sweep, (trace.cam_deg / 360, trace.error_arcsec)), *map(bins.by_sweep, (bins.turns, fitted))
    return [error - np.interp(turns, at, curve) for turns, error, at, curve in zip(*columns, strict=True)]


def with_step(trace: MeasuredTrace, fit: TraceFit) -> tuple[MeasuredTrace, str] | None:
    """A trace with a level of its own behind the greatest step of what a fit leaves, and the warning; None without any.

    A step is the difference of the means over STEP_TURNS before and behind a reading, far above that of all readings,
    and no less over a quarter of that, where a slope would be.
    """
    if len(trace.breaks) == _MOST_BREAKS:
        return None
    bins, fitted = fit.bins, fit.curve(fit.bins.turns)
    sizes, rows = [], []
    for sweep, apart in zip(trace.sweeps, _departures(trace, bins, fitted), strict=True):
        reach = int(_STEP_TURNS * len(sweep) / max(float(np.ptp(trace.cam_deg[sweep.rows])) / 360, _STEP_TURNS))
        if reach < _FEWEST_BESIDE_STEP or len(sweep) < 4 * reach:
            continue
        total, at = np.cumsum(np.append(0.0, apart)), np.arange(reach, len(sweep) - reach)
        near = max(reach // 4, _FEWEST_BESIDE_STEP)
        far, close = ((total[at + r] - 2 * total[at] + total[at - r]) / r for r in (reach, near))
        sizes.append(np.where(close / np.where(far, far, 1.0) > _SHARP, far, 0.0))
        rows.append(sweep.start + at)
    if not sizes:
        return None
    size, row = np.concatenate(sizes), np.concatenate(rows)
    usual = _TO_SIGMA * float(np.median(np.abs(size[size != 0]))) if size.any() else 0.0
    place = int(np.abs(size).argmax())
    step, line = float(size[place]), int(trace.line[row[place]])
    if abs(step) < max(_STEP_SIGMAS * usual, _STEP_RANGE_SHARE * float(np.ptp(fitted))) or line in trace.breaks:
        return None
    there = trace.cam_deg[row[place]] / 360
    k = next(k for k, each in enumerate(trace.sweeps) if each.start <= row[place] < each.stop)
    behind = (bins.sweep == k) & ((bins.turns - there) * trace.sweeps[k].direction >= 0)
    columns = [
        behind.astype(float),
        bins.travel / fit.design.reach,
    ]  # a cycle that does not close has a step at its end
    (own, (step,)), (drift, (slope,)) = (fit.beside(column[:, None]) for column in columns)
    if step**2 * (bins.weight @ own**2)[0] < slope**2 * (bins.weight @ drift**2)[0]:
        return None
    words = (
        f"the error steps by {step:.3g}″ at line {line}, as if a coupling slips or counts are lost; the step is removed"
    )
    return replace(trace, breaks=tuple(sorted((*trace.breaks, line)))), words


def without_spikes(trace: MeasuredTrace, fit: TraceFit) -> tuple[MeasuredTrace, str] | None:
    """A trace without the spikes beside a fit to its sweeps, and the warning that names them; None without any.

    Raises UntrustedError: spikes where the trace is not to be read without them, or too many to leave out.
    """
    from scipy.ndimage import binary_opening, median_filter  # 20 ms, which values in holes do without

    bins, fitted = fit.bins, fit.bins.error - fit.residual
    rows, apart = trace.rows, _departures(trace, bins, fitted)
    size = np.abs(np.concatenate(apart))
    beside = np.concatenate([np.abs(each - median_filter(each, _BESIDE_SPIKE, mode="mirror")) for each in apart])
    # a spike draws the fit to it, and so its neighbours off: only the farthest are looked at
    noise = _TO_SIGMA * float(np.median(size))
    far = size > max(_SPIKE_SIGMAS * noise, _SPIKE_RANGE_SHARE * float(np.ptp(fitted)), float(size.max()) / 2)
    short = far & ~binary_opening(far, np.ones(_LONGEST_SPIKE + 1))
    # the misfit, greatest at the ends of a record, is smooth where rows are many, and comes near others as great
    short &= beside > np.maximum(size / 2, _SPIKE_SIGMAS * _TO_SIGMA * np.median(beside))
    turns = trace.cam_deg[rows] / 360
    gaps = np.maximum(np.abs(np.diff(turns, append=turns[-1])), np.abs(np.diff(turns, prepend=turns[0])))
    short &= size > np.where(gaps > 1 / (2 * fit.orders[-1]), _SPIKE_SPARSE_SHARE * np.ptp(fitted), 0.0)
    turn = np.floor(turns - turns.min()).astype(np.int64) + 1
    greatest = np.zeros(turn.max() + 2)  # of the others in each turn of the cam
    np.maximum.at(greatest, turn, np.where(short, 0.0, size))
    others = np.max([greatest[turn + off] for off in (-1, 0, 1)], axis=0)
    spikes = np.flatnonzero(short & (size > 2 * others))
    if not len(spikes):
        return None
    lines = shortened(trace.line[rows[spikes]].tolist(), _NAMED_LINES)
    words = f"lines {lines}: {size[spikes].max():.3g}″ off the others"
    if len(spikes) > _MAX_SPIKE_SHARE * len(rows):
        hint = "check the encoders' cables and counters"
        raise UntrustedError(f"{trace.file}: {words}: too many to leave out", hint, Fault.ORDERS_UNTOLD)
    inside = np.concatenate([np.minimum(np.arange(len(each)), np.arange(len(each))[::-1]) for each in apart])
    if not trace.robust and (inside[spikes] >= _LONGEST_SPIKE).any():  # a shaft that turns back has play and a lag
        hint = "check the encoders' cables and counters, or leave out these rows: --robust"
        raise UntrustedError(f"{trace.file}: {words}, no readings of a shaft", hint, Fault.ORDERS_UNTOLD)
    words += f", omitted; with them the curve would span {np.ptp(fit.curve(bins.turns)):.1f}″"
    return trace.without(rows[spikes]), words
