"""Lines of a drive's error as a record of its full cycle has them: no deviation is fitted, so no model is believed.

Before a record of the full cycle each line is as large as in drives as this one may be, and its phase is not known; the
record then gives all lines by least squares (ridge regression, as its readings have noise). A record of part of it does
not tell lines apart that lie close together: before it they are those of drives that agree with it, but for a misfit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hdassist.comparing.record import Alignment
from hdassist.correction.table import between_points
from hdassist.error.waves import HIGHEST
from hdassist.measuring.measure import Measurement
from hdassist.model.geometry import Array
from hdassist.planning.lines import ErrorLines
from hdassist.preset.fields import Drive
from hdassist.run.run import Run

RECORDED_DRAWS = 64  # drives that agree with a record
LEAST_LINE = 0.02  # of the mean square of lines in the belief: that of a line which the model does not have
WAVES_OF_TEETH = 60  # around a wheel, at most
READINGS_AT_ONCE = 2048  # readings
NOISE_ROUNDS = 3  # in which the noise of readings is estimated
LEAST_VARIANCE = 1e-6  # arcsec^2


@dataclass(frozen=True, eq=False)
class RecordedError:
    """Error F_kpp [arcsec] that was read where the cam had turned so far from the record's zero, shape (readings,).

    is_part: whether that is less than the full cycle.
    """

    cam_turns: Array
    error_arcsec: Array
    is_part: bool = False


def recorded_error(measurement: Measurement, drive: Drive, asked: Alignment) -> RecordedError:
    """Error of a record of a drive without level and drift, from both of its directions measured as one.

    Argument: asked, how the file counts.
    """
    trace, sweep = measurement.trace, measurement.directions[0]
    alignment = asked.of_file(trace, drive)
    return RecordedError(alignment.sense * sweep.bins.turns, alignment.sign * sweep.fit.error, sweep.is_bound)


def with_waves_of_teeth(lines: ErrorLines) -> ErrorLines:
    """Lines with those of single teeth of either wheel, which no drive of the belief has: of amplitude 0."""
    kinematics, found = lines.kinematics, set()
    for z in (kinematics.z_g, kinematics.z_b):
        waves = np.arange(HIGHEST + 1, min(WAVES_OF_TEETH, z // 2) + 1)
        found |= set((waves * (kinematics.cycle_states // z)).tolist())
    more = np.array(sorted(found - set(lines.per_cycle.tolist())), dtype=np.int64)
    amplitude = np.pad(lines.amplitude, ((0, 0), (0, len(more))))
    return replace(lines, per_cycle=np.concatenate([lines.per_cycle, more]), amplitude=amplitude)


def recorded_lines(
    lines: ErrorLines, record: RecordedError | None, run: Run, misfit: float | None = None
) -> ErrorLines:
    """Lines of drives that agree with a record, from those of drives as this one may be.

    Their mean is that of the record. Without a record at this torque phases are any. misfit: standard deviation of a
    line from that of a drive, over its size, where drives agree with the records; None where phases are any.
    """
    lines = with_waves_of_teeth(lines) if record else lines
    half = len(lines.per_cycle)
    power = (np.abs(lines.amplitude) ** 2).mean(axis=0)
    scale = np.tile(np.sqrt((power + LEAST_LINE * power.mean()) / 2), 2)  # of cosines and sines, (2 lines,)
    parts = np.concatenate([lines.amplitude.real, lines.amplitude.imag], axis=1)
    parts = np.zeros((RECORDED_DRAWS, 2 * half)) if misfit is None else parts
    drawn = np.random.default_rng([run.seed, 1]).standard_normal((len(parts) // 2, 2 * half))
    drawn = np.concatenate([drawn, -drawn])  # their mean is 0
    if record is None:
        parts = parts + (misfit or 1.0) * scale * drawn
    else:
        per_turn = lines.per_cycle / lines.kinematics.cycle_cam_revolutions
        read = record.error_arcsec - record.error_arcsec.mean()
        gram, moment, level = np.zeros((2 * half, 2 * half)), np.zeros(2 * half), np.zeros(2 * half)
        for some in np.split(np.arange(len(read)), range(READINGS_AT_ONCE, len(read), READINGS_AT_ONCE)):
            waves = np.exp(2j * np.pi * record.cam_turns[some, None] * per_turn)
            columns = np.concatenate([waves.real, -waves.imag], axis=1)
            gram += columns.T @ columns
            moment += columns.T @ read[some]
            level += columns.sum(axis=0)
        gram -= np.outer(level, level) / len(read)  # its level is not known
        scale *= misfit or np.std(read) / np.sqrt(scale @ scale / 2)
        noise = float(np.var(read))
        for _ in range(NOISE_ROUNDS):
            precision = gram / noise + np.diag(scale**-2)
            found = parts + np.linalg.solve(precision, (moment - parts @ gram).T / noise).T
            mean = found.mean(axis=0)
            noise = max(float(read @ read - 2 * mean @ moment + mean @ gram @ mean) / len(read), LEAST_VARIANCE)
        parts = found + np.linalg.solve(np.linalg.cholesky(precision).T, drawn.T).T
    return replace(lines, amplitude=parts[:, :half] + 1j * parts[:, half:])


def beyond_lines(lines: ErrorLines, record: RecordedError) -> Array:
    """Error [arcsec] of a record that the mean lines do not have, at the points of their curves, shape (points,).

    The noise of readings is part of it, averaged at each point.
    """
    curve, turns = lines.curves.mean(axis=0), lines.kinematics.cycle_cam_revolutions
    places = np.mod(record.cam_turns / turns, 1)
    apart = record.error_arcsec - between_points(curve, places)
    points = np.rint(places * len(curve)).astype(np.int64) % len(curve)
    read = np.maximum(np.bincount(points, minlength=len(curve)), 1)
    return np.asarray(np.bincount(points, apart, len(curve)) / read)
