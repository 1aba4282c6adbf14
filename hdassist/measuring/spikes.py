"""Single readings of a trace that stand far off all others: faults of the reading, none of the drive.

A shaft does not leap there and back between two readings. Such a reading is left out, and named; many of them are a
fault of the rig that an answer must not hide, unless it is asked to leave them out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter

from hdassist.errors import Fault, UntrustedError
from hdassist.measuring.fit import TraceFit
from hdassist.readers.sweeps import AngleSweep
from hdassist.readers.trace import MeasuredTrace

SPIKE_SIGMAS, ROBUST_SIGMAS = 10.0, 5.0  # robust standard deviations of the readings around the fit
SPIKE_RANGE_SHARE = 0.1  # of the fitted curve: a smaller spike has no effect
LONGEST_SPIKE = 2  # readings: a longer one may be the drive
BESIDE_SPIKE = 7  # readings around one, of whose departures the median is taken
TO_SIGMA = 1.4826  # standard deviation of normal readings over their median departure
MAX_SPIKE_SHARE, MAX_ROBUST_SHARE = 1 / 200, 1 / 10  # of the readings: with more of them the rig is at fault
NAMED_LINES = 3  # lines in a message
FEW_SPIKES = 3  # spikes that are no fault of the rig in a short record either


def without_spikes(
    trace: MeasuredTrace, sweeps: Sequence[AngleSweep], fit: TraceFit
) -> tuple[MeasuredTrace, list[str]]:
    """A trace without the spikes beside a fit to its sweeps, and the warning that names them; the same without any.

    Raises UntrustedError: too many to leave out.
    """
    bins, fitted = fit.design.bins, fit.design.bins.error - fit.residual
    rows = np.concatenate([np.arange(sweep.start, sweep.stop) for sweep in sweeps])
    fits = [
        np.interp(trace.cam_deg[s.start : s.stop] / 360, bins.turns[bins.sweep == k], fitted[bins.sweep == k])
        for k, s in enumerate(sweeps)
    ]
    apart = [trace.error_arcsec[s.start : s.stop] - fit for s, fit in zip(sweeps, fits, strict=True)]
    size = np.abs(np.concatenate(apart))
    beside = np.concatenate([np.abs(each - median_filter(each, BESIDE_SPIKE, mode="mirror")) for each in apart])
    # a spike draws the fit to it, and so its neighbours off: only the farthest are looked at
    noise = TO_SIGMA * float(np.median(size))
    sigmas, share = (ROBUST_SIGMAS, MAX_ROBUST_SHARE) if trace.robust else (SPIKE_SIGMAS, MAX_SPIKE_SHARE)
    far = size > max(sigmas * noise, SPIKE_RANGE_SHARE * float(np.ptp(fitted)), float(size.max()) / 2)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], far, [0]]))).reshape(-1, 2)
    short = [k for first, last in edges.tolist() if last - first <= LONGEST_SPIKE for k in range(first, last)]
    short = [k for k in short if beside[k] > size[k] / 2]  # what a fit misses is smooth
    if not short:
        return trace, []
    count, named = len(short), ", ".join(map(str, trace.line[rows[short[:NAMED_LINES]]]))
    where = f"line{'s' * (count > 1)} {named}{f' and {count - NAMED_LINES} more' if count > NAMED_LINES else ''}"
    words = f"{where}: {size[short].max():.2g}″ off all readings around"
    if count > max(FEW_SPIKES, share * len(trace.line)):
        hint = "check the encoders' cables and counters, or leave out these rows: --robust"
        raise UntrustedError(f"{trace.file}: {words}: too many to leave out", hint, Fault.ORDERS_UNTOLD)
    warning = f"{words}, left out; else the curve would span {np.ptp(fit.curve(bins.turns)):.1f}″"
    return trace.without(rows[short]), [warning]
