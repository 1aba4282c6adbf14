"""Faults of the reading, none of the drive: single readings far off all others, and steps of the level.

A shaft does not leap there and back between two readings. Such readings are refused, or left out where that is asked or
where the shaft turns back, and named; many of them are a fault of the rig that an answer must not
hide. A step stays: a coupling has slipped, an encoder has lost counts. Behind it the level of the error is another
one, which is fitted; the orders go on.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_opening, median_filter

from hdassist.errors import Fault, UntrustedError
from hdassist.measuring.fit import TraceFit
from hdassist.readers.table import shortened
from hdassist.readers.trace import MeasuredTrace

SPIKE_SIGMAS = 6.0  # robust standard deviations of the readings around the fit
SPIKE_RANGE_SHARE = 0.1  # of the fitted curve: a smaller spike has no effect
LONGEST_SPIKE = 2  # readings: a longer one may be the drive
BESIDE_SPIKE = 7  # readings around one, of whose departures the median is taken
TO_SIGMA = 1.4826  # standard deviation of normal readings over their median departure
MAX_SPIKE_SHARE = 1 / 20  # of the readings: with more of them the rig is at fault
NAMED_LINES = 3  # lines in a message
STEP_TURNS = 0.5  # of the cam, to each side of a step
FEWEST_BESIDE_STEP = 8  # readings there
SHARP = 0.7  # of a step: what a quarter of the readings beside it show, at least
STEP_SIGMAS = 8.0  # robust standard deviations of such differences
STEP_RANGE_SHARE = 0.1  # of the fitted curve: a smaller step is left to the noise
MOST_BREAKS = 3  # of more the rig is at fault, or the drive


def with_step(trace: MeasuredTrace, fit: TraceFit) -> tuple[MeasuredTrace, str] | None:
    """A trace with a level of its own behind the greatest step of what a fit leaves, and the warning; None without any.

    A step is the difference of the means over STEP_TURNS before and behind a reading, far above that of all readings,
    and no less over a quarter of that, where a slope would be.
    """
    if len(trace.breaks) == MOST_BREAKS:
        return None
    bins, fitted = fit.bins, fit.curve(fit.bins.turns)
    sizes, rows = [], []
    for k, sweep in enumerate(trace.sweeps):
        own = bins.sweep == k
        turns, error = trace.cam_deg[sweep.rows] / 360, trace.error_arcsec[sweep.rows]
        apart = error - np.interp(turns, bins.turns[own], fitted[own])
        reach = int(STEP_TURNS * len(turns) / max(float(np.ptp(turns)), STEP_TURNS))
        if reach < FEWEST_BESIDE_STEP or len(turns) < 4 * reach:
            continue
        total, at = np.cumsum(np.append(0.0, apart)), np.arange(reach, len(turns) - reach)
        near = max(reach // 4, FEWEST_BESIDE_STEP)
        far, close = ((total[at + r] - 2 * total[at] + total[at - r]) / r for r in (reach, near))
        sizes.append(np.where(close / np.where(far, far, 1.0) > SHARP, far, 0.0))
        rows.append(sweep.start + at)
    if not sizes:
        return None
    size, row = np.concatenate(sizes), np.concatenate(rows)
    usual = TO_SIGMA * float(np.median(np.abs(size[size != 0]))) if size.any() else 0.0
    place = int(np.abs(size).argmax())
    step, line = float(size[place]), int(trace.line[row[place]])
    if abs(step) < max(STEP_SIGMAS * usual, STEP_RANGE_SHARE * float(np.ptp(fitted))) or line in trace.breaks:
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
    words = f"the error steps by {step:.3g}″ at line {line}, as where a coupling slips or counts are lost: taken off"
    return replace(trace, breaks=tuple(sorted((*trace.breaks, line)))), words


def without_spikes(trace: MeasuredTrace, fit: TraceFit) -> tuple[MeasuredTrace, str] | None:
    """A trace without the spikes beside a fit to its sweeps, and the warning that names them; None without any.

    Raises UntrustedError: spikes where the trace is not to be read without them, or too many to leave out.
    """
    bins, fitted = fit.bins, fit.bins.error - fit.residual
    rows, moves = trace.rows, zip(*map(trace.by_sweep, (trace.cam_deg, trace.error_arcsec)), strict=True)
    apart = [
        error - np.interp(cam / 360, bins.turns[bins.sweep == k], fitted[bins.sweep == k])
        for k, (cam, error) in enumerate(moves)
    ]
    size = np.abs(np.concatenate(apart))
    beside = np.concatenate([np.abs(each - median_filter(each, BESIDE_SPIKE, mode="mirror")) for each in apart])
    # a spike draws the fit to it, and so its neighbours off: only the farthest are looked at
    noise = TO_SIGMA * float(np.median(size))
    far = size > max(SPIKE_SIGMAS * noise, SPIKE_RANGE_SHARE * float(np.ptp(fitted)), float(size.max()) / 2)
    short = far & ~binary_opening(far, np.ones(LONGEST_SPIKE + 1))
    # the misfit, greatest at the ends of a record, is smooth: noise alone stands off the readings beside it
    spikes = np.flatnonzero(short & (beside > np.maximum(size / 2, SPIKE_SIGMAS * TO_SIGMA * np.median(beside))))
    if not len(spikes):
        return None
    lines = shortened(trace.line[rows[spikes]].tolist(), NAMED_LINES)
    words = f"lines {lines}: {size[spikes].max():.3g}″ off the others"
    if len(spikes) > MAX_SPIKE_SHARE * len(rows):
        hint = "check the encoders' cables and counters"
        raise UntrustedError(f"{trace.file}: {words}: too many to leave out", hint, Fault.ORDERS_UNTOLD)
    inside = np.concatenate([np.minimum(np.arange(len(each)), np.arange(len(each))[::-1]) for each in apart])
    if not trace.robust and (inside[spikes] >= LONGEST_SPIKE).any():  # a shaft that turns back has play and a lag
        hint = "check the encoders' cables and counters, or leave out these rows: --robust"
        raise UntrustedError(f"{trace.file}: {words}, no readings of a shaft", hint, Fault.ORDERS_UNTOLD)
    words += f", left out; else the curve would span {np.ptp(fit.curve(bins.turns)):.1f}″"
    return trace.without(rows[spikes]), words
