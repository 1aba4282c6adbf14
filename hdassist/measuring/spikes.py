"""Single readings of a trace that stand far off all others: faults of the reading, none of the drive.

A shaft does not leap there and back between two readings. Such readings are refused, or left out where that is asked or
where the shaft turns back, and named; many of them are a fault of the rig that an answer must not hide.
"""

from __future__ import annotations

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
    spikes = np.flatnonzero(short & (beside > size / 2))  # the misfit is smooth
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
