"""Both directions of rotation of a recording, for a correction: the mean of their errors, and their difference.

A controller stores one correction for both directions of rotation. Let f be the error with increasing angles and b the
error with decreasing angles. The correction is made for the mean m, and the residual contains half of the difference d:

    f = m + d/2,   b = m - d/2,   m = (f + b)/2,   d = f - b.

The model of `recording/directions.py` gives samples of both. The constant part of the difference is the lost motion at
reversal. It is a level, so it is neither part of a correction nor of a residual.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.error.waves import ErrorLines
from hdassist.drive.model.geometry import Array, Kinematics
from hdassist.drive.solve.answers import EMPTY
from hdassist.features.measuring.full_cycle import cleaned_recording, has_comparable_directions
from hdassist.features.measuring.measure import Measurement
from hdassist.features.measuring.terms import Bins
from hdassist.features.record_comparison.record import Alignment
from hdassist.recording.positions import Recording, recording_from_columns
from hdassist.recording.posterior import AmplitudePosterior, posterior_of_recording, posteriors_of_directions
from hdassist.run.errors import DataError, UntrustedError

RECORDED_DRAWS = 64  # sampled drives that agree with a recording


@dataclass(frozen=True, eq=False)
class DrawnErrors:
    """Errors that agree with a recording, sampled from the posterior of its amplitudes.

    lines: components at orders of the input and the output, for each sample; for two directions, those of their mean.
    beyond_arcsec: range that other components can add [arcsec], shape (samples,); their phases differ from cycle to
        cycle.
    difference: components of the error with increasing minus that with decreasing angles of the file, for each sample;
        None for one direction.
    """

    lines: ErrorLines
    beyond_arcsec: Array
    difference: ErrorLines | None = None


def drawn_both_directions(
    measurement: Measurement,
    kinematics: Kinematics,
    asked: Alignment,
) -> DrawnErrors | None:
    """Return sampled errors of both directions, or None if the recording does not contain comparable directions.

    measurement: the measurement with both directions as one and with the ratio.
    kinematics: kinematics of the drive.
    asked: counting convention of the file.
    """
    if not has_comparable_directions(measurement):
        return None
    recording = _aligned_recording(measurement, kinematics, asked)
    is_increasing = increasing_of(measurement.directions[0].bins)
    try:
        forward, backward = posteriors_of_directions(
            _selected(recording, is_increasing),
            _selected(recording, ~is_increasing),
            seed=measurement.seed,
        )
    except (DataError, UntrustedError):  # both directions then count as one
        return None
    draws = _even_draws(forward)
    mean_amplitudes = (forward.amplitudes + backward.amplitudes) / 2
    differences = forward.amplitudes - backward.amplitudes
    line_ranges = [2 * posterior.line_amplitudes[draws].sum(axis=1) for posterior in (forward, backward)]
    return DrawnErrors(
        lines=_lines_of_amplitudes(forward, mean_amplitudes[draws], kinematics),
        beyond_arcsec=np.maximum(*line_ranges),
        difference=_lines_of_amplitudes(forward, differences[draws], kinematics),
    )


def drawn_as_one(
    measurement: Measurement,
    kinematics: Kinematics,
    asked: Alignment,
) -> DrawnErrors:
    """Return sampled errors of a recording, in which both directions count as one and each sweep has its own level.

    The arguments are those of `drawn_both_directions`.
    Raises DataError if the readings are not a recording.
    """
    recording = _aligned_recording(measurement, kinematics, asked)
    posterior = posterior_of_recording(recording, seed=measurement.seed)
    draws = _even_draws(posterior)
    return DrawnErrors(
        lines=_lines_of_amplitudes(posterior, posterior.amplitudes[draws], kinematics),
        beyond_arcsec=2 * posterior.line_amplitudes[draws].sum(axis=1),
    )


def increasing_of(bins: Bins) -> NDArray[np.bool_]:
    """Return whether the angle increased with time at each averaged reading, shape (readings,).

    The averages of a sweep are sorted by angle, so the travel since the first row gives the direction.
    """
    is_increasing = np.ones(len(bins), bool)
    for sweep in range(bins.sweeps):
        is_of_sweep = bins.sweep == sweep
        travel = bins.travel[is_of_sweep]
        is_increasing[is_of_sweep] = travel[-1] >= travel[0]
    return is_increasing


def _aligned_recording(
    measurement: Measurement,
    kinematics: Kinematics,
    asked: Alignment,
) -> Recording:
    """Return the readings as corrected by `measure`, with the signs of the drive."""
    alignment = asked.of_file(measurement.trace, kinematics)
    ratio = abs(kinematics.u)
    cleaned = cleaned_recording(measurement.directions[0], ratio)
    input_rev = alignment.sense * cleaned.input_rev
    order = np.lexsort((input_rev, cleaned.sweep))  # sort each sweep by increasing angle
    return recording_from_columns(
        input_rev=input_rev[order],
        error_arcsec=alignment.sign * cleaned.error_arcsec[order],
        ratio=ratio,
        sweep=cleaned.sweep[order],
        time=np.sort(cleaned.time),
    )


def _selected(recording: Recording, is_selected: NDArray[np.bool_]) -> Recording:
    """Return the selected readings of a recording.

    is_selected: whether each reading is selected, shape (readings,).
    """
    return recording_from_columns(
        input_rev=recording.input_rev[is_selected],
        error_arcsec=recording.error_arcsec[is_selected],
        ratio=recording.ratio,
        sweep=recording.sweep[is_selected],
        time=recording.time[is_selected],
    )


def _even_draws(posterior: AmplitudePosterior) -> NDArray[np.int64]:
    """Return the indices of samples evenly spaced over all draws, shape (samples,)."""
    return np.linspace(0, len(posterior.amplitudes) - 1, RECORDED_DRAWS).astype(np.int64)


def _lines_of_amplitudes(
    posterior: AmplitudePosterior,
    amplitudes: Array,
    kinematics: Kinematics,
) -> ErrorLines:
    """Return the components of sampled amplitudes as lines of the full cycle.

    posterior: posterior with the waves.
    amplitudes: cosines, then sines [arcsec], shape (samples, 2 waves).
    """
    cosines, sines = np.split(amplitudes, 2, axis=1)
    cycle = posterior.cycle
    # each pair contains the periods per input revolution and per output revolution
    periods = posterior.pairs[:, 0] * cycle.numerator + posterior.pairs[:, 1] * cycle.denominator
    per_cycle, index = np.unique(periods, return_inverse=True)
    amplitude = np.zeros((len(amplitudes), len(per_cycle)), dtype=complex)
    np.add.at(amplitude.T, index, (cosines - 1j * sines).T)  # several components may have the same period
    return ErrorLines(
        kinematics=kinematics,
        per_cycle=per_cycle,
        amplitude=amplitude,
        certificate=EMPTY,
    )
