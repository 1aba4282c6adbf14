"""Lines of a drive's error as a record of its full cycle has them: no deviation is fitted, so no model is believed.

Before a record of the full cycle each line is as large as in drives as this one may be, and its phase is not known; the
record then gives all lines by least squares (ridge regression, as its readings have noise). A record of part of it does
not tell lines apart that lie close together: before it they are those of drives that agree with it, but for a misfit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hdassist.comparing.record import Alignment
from hdassist.correction.table import between_points
from hdassist.measuring.measure import Measurement
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.planning.lines import POINTS_A_TURN, ErrorLines
from hdassist.preset.fields import Drive
from hdassist.run.run import Run

RECORDED_DRAWS = 64  # drives that agree with a record
LEAST_LINE = 0.02  # of the mean square of lines in the belief: that of a line which the model does not have
READINGS_AT_ONCE = 2048  # readings
NOISE_ROUNDS = 3  # in which the noise of readings is estimated
LEAST_VARIANCE = 1e-6  # arcsec^2
MOST_LINES = 320  # of an error beyond the lines of a model
FINER = 32  # times the points of curves, at which places are told apart
LEAST_REPEATS = 20  # readings at points that have one already, from which noise is known
NO_DRAWS = np.zeros((1, 2 * MOST_LINES))


@dataclass(frozen=True, eq=False)
class RecordedError:
    """Error F_kpp [arcsec] that was read where the cam had turned so far from the record's zero, shape (readings,).

    is_part: whether that is less than the full cycle.
    """

    cam_turns: Array
    error_arcsec: Array
    is_part: bool = False

    def places(self, lines: ErrorLines) -> Array:
        """Places of the readings in the full cycle, 0 to 1."""
        return np.mod(self.cam_turns / lines.kinematics.cycle_cam_revolutions, 1)

    def points(self, lines: ErrorLines) -> NDArray[np.int64]:
        """The nearest points of the curves of lines."""
        count = lines.curves.shape[1]
        return np.asarray(np.rint(self.places(lines) * count).astype(np.int64) % count)

    def apart(self, lines: ErrorLines) -> Array:
        """What the mean of lines leaves of the readings [arcsec]."""
        return self.error_arcsec - between_points(lines.mean.curves[0], self.places(lines))

    def noise(self, apart: Array, lines: ErrorLines) -> float | None:
        """Variance of readings at the same point of curves [arcsec^2], None where too few points have two or more."""
        _, group, read = np.unique(self.points(lines), return_inverse=True, return_counts=True)
        again = len(group) - len(read)
        mean = np.bincount(group, apart) / read
        return float(((apart - mean[group]) ** 2).sum()) / again if again >= LEAST_REPEATS else None


def recorded_error(measurement: Measurement, drive: Drive, asked: Alignment) -> RecordedError:
    """Error of a record of a drive without level and drift, from both of its directions measured as one.

    Argument: asked, how the file counts.
    """
    trace, sweep = measurement.trace, measurement.directions[0]
    alignment = asked.of_file(trace, drive)
    return RecordedError(alignment.sense * sweep.bins.turns, alignment.sign * sweep.fit.error, sweep.is_bound)


def with_more_lines(lines: ErrorLines, per_cycle: NDArray[np.int64]) -> ErrorLines:
    """Lines, rising, with those that come so often in the full cycle too: where there were none, of amplitude 0."""
    every = np.union1d(lines.per_cycle, per_cycle)
    amplitude = np.zeros((len(lines.amplitude), len(every)), dtype=complex)
    amplitude[:, np.searchsorted(every, lines.per_cycle)] = lines.amplitude
    return replace(lines, per_cycle=every, amplitude=amplitude)


def waves_of_teeth(kinematics: Kinematics) -> NDArray[np.int64]:
    """How often waves of the single teeth of either wheel come in the full cycle, as far as curves have them."""
    wheels = (kinematics.z_g, kinematics.z_b)
    often = np.concatenate([np.arange(1, z // 2 + 1) * (kinematics.cycle_states // z) for z in wheels])
    return often[2 * often < POINTS_A_TURN * kinematics.cycle_cam_revolutions]


def recorded_lines(
    lines: ErrorLines, record: RecordedError | None, run: Run, misfit: float | None = None
) -> ErrorLines:
    """Lines of drives that agree with a record, from those of drives as this one may be.

    Their mean is that of the record. Without a record at this torque phases are any. misfit: standard deviation of a
    line from that of a drive, over its size, where drives agree with the records; None where phases are any.
    """
    lines = with_more_lines(lines, waves_of_teeth(lines.kinematics)) if record else lines
    half = len(lines.per_cycle)
    power = (np.abs(lines.amplitude) ** 2).mean(axis=0)
    scale = np.tile(np.sqrt((power + LEAST_LINE * power.mean()) / 2), 2)  # of cosines and sines, (2 lines,)
    parts = np.concatenate([lines.amplitude.real, lines.amplitude.imag], axis=1)
    parts = np.zeros((RECORDED_DRAWS, 2 * half)) if misfit is None else parts
    drawn = np.random.default_rng([run.seed, 1]).standard_normal((len(parts) // 2, 2 * half))
    drawn = np.concatenate([np.zeros((len(parts) % 2, 2 * half)), drawn, -drawn])  # their mean is 0
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
            fitted = replace(lines, amplitude=(mean[:half] + 1j * mean[half:])[None])
            off = record.apart(fitted)
            noise = max(record.noise(off, lines) or float(np.var(off)), LEAST_VARIANCE)
        free = len(read) - float(np.trace(np.linalg.solve(precision, gram))) / noise
        beyond = 1.0 if misfit else max(1.0, float(off @ off) / max(free, 1.0) / noise)  # error that is no sum of lines
        parts = found + np.sqrt(beyond) * np.linalg.solve(np.linalg.cholesky(precision).T, drawn.T).T
    return replace(lines, amplitude=parts[:, :half] + 1j * parts[:, half:])


def strongest_lines(
    lines: ErrorLines, places: Array, apart: Array, noise: float = 0.0, drawn: Array = NO_DRAWS
) -> ErrorLines:
    """Lines with the strongest of the error apart [arcsec] that they leave, at places all over the full cycle, 0 to 1.

    noise: variance of apart by readings [arcsec^2], by whose share each of them is shrunk; drawn: independent normal
    numbers of what that leaves open, shape (drives, 2 MOST_LINES).
    """
    count, most = len(places), POINTS_A_TURN * lines.kinematics.cycle_cam_revolutions
    fine, near = FINER * most, np.rint(places * most).astype(np.int64)
    weight = 1 / np.bincount(near)[near]  # of readings at the same point
    put = np.bincount(np.rint(places * fine).astype(np.int64) % fine, weight * (apart - apart.mean()), fine)
    spectrum = np.fft.rfft(put) * (2 / weight.sum())
    found = 1 + np.argsort(-np.abs(spectrum[1 : min(count, most) // 2]))[:MOST_LINES]
    of_noise = 4 * noise / count
    share = np.maximum(0, 1 - of_noise / np.maximum(np.abs(spectrum[found]) ** 2, LEAST_VARIANCE * 1e-6))
    lines = with_more_lines(lines, found)
    open_ = np.sqrt(share * of_noise / 2) * (drawn[:, : len(found)] + 1j * drawn[:, -len(found) :])
    lines.amplitude[:, np.searchsorted(lines.per_cycle, found)] += share * spectrum[found] + open_
    return lines


def recorded_beyond(lines: ErrorLines, record: RecordedError, run: Run) -> tuple[ErrorLines, Array]:
    """Lines of drives with those of a record that they leave, and then the error [arcsec] beyond, shape (points,).

    The former of a record of the full cycle. The latter at the points of their curves, without the noise of readings
    as far as that is known.
    """
    off = record.apart(lines)
    if not record.is_part:
        drawn = np.random.default_rng([run.seed, 3]).standard_normal((len(lines.amplitude) // 2, 2 * MOST_LINES))
        noise = record.noise(off, lines) or float(np.var(off))
        lines = strongest_lines(lines, record.places(lines), off, noise, np.concatenate([drawn, -drawn]))
        off = record.apart(lines)
    points = record.points(lines)
    read = np.bincount(points, minlength=POINTS_A_TURN * lines.kinematics.cycle_cam_revolutions)
    mean = np.bincount(points, off, len(read)) / np.maximum(read, 1)
    unfitted = max(0.0, 1 - 2 * len(lines.per_cycle) / len(off))  # lines have taken their part of the noise
    by_noise = unfitted * (record.noise(off, lines) or 0.0) * float(np.mean(1 / read[read > 0]))
    return lines, mean * np.sqrt(max(0.0, 1 - by_noise / float(np.var(mean[read > 0]))))
