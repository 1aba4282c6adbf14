"""Spectral lines of a drive's error from a recording, without fitted deviations and thus without trust in the model.

Noise of the readings is part of each line of a recording. The line is therefore shrunk according to its expected size,
which follows from the possible drives and from similar lines. For a recording of part of the cycle, the lines are those
of drives that agree with the recording apart from a misfit.

If both directions of rotation were recorded, the model of `directions` gives their difference. Half of its mean is
removed from the readings of each direction. All readings then determine the mean of both directions, although each
direction may cover another part of the cycle. The samples of the difference remain part of the residual.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import chdtri, ndtr, ndtri

from hdassist.belief.prior import DrivePrior, prior_of
from hdassist.drive.error.cycle import kinematic_error
from hdassist.drive.error.waves import POINTS_A_TURN, Complex, ErrorLines, error_lines
from hdassist.drive.model.deviations import unknowns
from hdassist.drive.model.geometry import Array, Kinematics
from hdassist.drive.preset.fields import Drive
from hdassist.drive.solve.answers import EMPTY, Certificate
from hdassist.features.correction.directions import (
    RECORDED_DRAWS,
    DrawnErrors,
    drawn_as_one,
    drawn_both_directions,
    increasing_of,
)
from hdassist.features.correction.forms import between_points
from hdassist.features.measuring.fit import COVERAGE_FACTOR
from hdassist.features.measuring.measure import Measurement
from hdassist.features.record_comparison.compare import mirrored_reading
from hdassist.features.record_comparison.record import Alignment, doubts_of
from hdassist.run.errors import Fault, UntrustedError
from hdassist.run.run import Run

# input revolutions beyond an end of a travel, over which the continuation changes from an odd to an even image
_BEND_TURNS = 0.1
_LEAST_LINE = 0.02  # smallest mean square of a line due to a misfit, as a share of the mean square of all lines
_USUAL_GAP = 0.5  # share of the cycle in gaps no wider than the usual gap; the usual gap limits the resolved lines
_IMAGE = 0.5  # smallest correlation of two waves at the readings at which the waves count as images of each other
_EVEN = 0.999  # smallest correlation of images at which the readings count as evenly spaced
_ROUNDS = 4  # largest number of least-squares iterations: readings at slightly uneven angles mix lines
_SOLVED = 1e-5  # slope of the sum of squares, relative to its initial value, at which the iteration stops
_FINER = 32  # factor by which the grid for reading angles is finer than the points of curves
_WIDEST_GAP = 2  # widest gap, in mean steps between readings; the middle of a wider gap counts as unread, with error 0
_MOST_ROUNDED = 0.1  # largest expanded uncertainty from encoder counts at even angles, as a share of the recorded range
_LEAST_REPEATS = 20  # fewest readings beyond those that lines can follow, from which noise is estimated
_LEAST_CHANCE = 0.05  # probability that the noise is below its lowest plausible value
_PEAK_CHANCE = 0.01  # probability that noise alone makes one reading of a recording count as a peak of the error
_ALL_HIDDEN = 0.5  # share of sampled drives in which noise hides only part of the error that it can hide
_MEDIAN_DEVIATION = 0.6745  # median absolute value of a standard normal variable
_SIZE_STEP = 4.0  # ratio of successive mean squares of lines that are tried
_SIZE_ROUNDS = 50  # iterations that estimate the frequency of each mean square
_LEAST_POWER = 1e-12  # arcsec^2; smallest mean square of noise
_FIRST_MISFIT = 0.1  # root mean square of the misfit assumed before the first fit, as a share of the error
_MOST_MISFIT = 0.15  # largest accepted root mean square of the misfit, as a share of the error
_MISFIT_CHANCE = 0.05  # probability that the misfit exceeds its upper bound
# number of sampled drives in which only open fields vary; the same number of drives is sampled with all fields varied
SEARCHED = 128
_STARTS = 10  # largest number of fits, which start from the likeliest sampled drives
# largest root mean square of the residual, as a share of the error, of a fit that reproduces the recording
_SHOWN = 0.05
_FITS = 2  # number of fits; the second uses the misfit of the first and the solved error of its drive beyond the lines
_MISFITS_A_TURN = 24  # independent values of the misfit per input revolution, for orders up to 12
_OPEN_DIRECTION = 12**-0.5  # standard deviation of an unknown direction, as a share of a revolution
_FEWEST_TURNS = 2.0  # fewest input revolutions for a table over the input
_LARGEST = 3.0  # largest departure of a field from its mean, in standard deviations


@dataclass(frozen=True, eq=False)
class RecordedError:
    """Error F_kpp of a recording, by the input angle from the zero of the recording.

    cam_turns: input angles [revolutions], shape (readings,).
    error_arcsec: errors at these angles [arcsec], shape (readings,).
    is_part: whether the readings cover less than the full cycle.
    recorded_turns: first and last input angle of a recorded travel [revolutions]; None for the full cycle.
    F_ior_arcsec: F'_ior [arcsec] as given by `measure`; None for a solved error.
    sha256: hash of the recording's file.
    scale_uncertainty: relative standard uncertainty of a common factor of all errors.
    difference: samples of the error with increasing minus that with decreasing angles of the file, with the signs of
        the drive. The errors are then those of the mean of both directions. None without two comparable directions.
    """

    cam_turns: Array
    error_arcsec: Array
    is_part: bool = False
    recorded_turns: tuple[float, float] | None = None
    F_ior_arcsec: float | None = None
    sha256: str = ""
    scale_uncertainty: float = 0.0
    difference: ErrorLines | None = None

    def visited(self, kinematics: Kinematics) -> NDArray[np.bool_]:
        """Return whether each point of the cycle lies in the recorded travel, shape (points,)."""
        turns = np.arange(POINTS_A_TURN * kinematics.cycle_cam_revolutions) / POINTS_A_TURN
        # without a travel, the full cycle was recorded, so all points count
        first, last = self.recorded_turns or (0.0, float(turns[-1]))
        return np.asarray(np.mod(turns - first, _whole_turns(last - first, kinematics)) <= last - first)

    def filled(self, kinematics: Kinematics, fitted: Array) -> RecordedError:
        """Return the recording of a travel continued over the full cycle, mirrored at both ends.

        The continuation avoids a jump of the correction outside the travel and a bend at the ends.

        kinematics: kinematics of the drive.
        fitted: fitted values at the readings [arcsec], shape (readings,).
        """
        travel = _Travel.of(self, fitted)
        whole_turns = _whole_turns(travel.span, kinematics)
        # the continuation has the same mean step and reaches from the end of the travel to its next beginning
        beyond = np.arange(travel.span, whole_turns, travel.span / len(travel.turns))[1:]
        # the continuation blends the mirror image at the last end into the mirror image at the first end
        share = (1 + np.cos(np.pi * (beyond - travel.span) / max(whole_turns - travel.span, 1e-12))) / 2
        # a mirrored curve has no jump or bend at the ends, which would make the correction oscillate
        from_last = travel.mirrored(beyond - travel.span, -1)
        from_first = travel.mirrored(whole_turns - beyond, 0)
        turns = np.append(travel.turns, travel.first + beyond)
        error = np.append(travel.error_arcsec, share * from_last + (1 - share) * from_first)
        # with an odd number of teeth, the cycle has two output revolutions
        repeats = max(1, round(kinematics.cycle_cam_revolutions / whole_turns))
        offsets = np.arange(repeats)[:, None] * whole_turns
        return RecordedError(
            (turns + offsets).ravel(),
            np.tile(error, repeats),
            recorded_turns=(travel.first, travel.first + travel.span),
        )

    def points(self, lines: ErrorLines, finer: int = 1) -> NDArray[np.int64]:
        """Return the index of the nearest curve point for each reading, or of the nearest point of a finer grid.

        lines: lines whose curves define the points.
        finer: integer factor by which the grid is finer.
        """
        cycle = lines.kinematics.cycle_cam_revolutions
        count = finer * POINTS_A_TURN * cycle
        places = np.mod(self.cam_turns / cycle, 1)
        return np.asarray(np.rint(places * count).astype(np.int64) % count)

    def _gaps(self, kinematics: Kinematics) -> tuple[NDArray[np.int64], Array]:
        """Return the order of the readings in the full cycle, and the gap after each as a share of the cycle.

        A gap is limited to the width over which a reading is representative.
        """
        cycle = kinematics.cycle_cam_revolutions
        places = np.mod(self.cam_turns / cycle, 1)
        # sort by position in the cycle, in whichever revolution a reading was taken
        order = np.argsort(places, kind="stable")
        gaps = np.diff(places[order], append=places[order[0]] + 1)
        # an unrecorded part must not add weight to the readings at its ends
        return order, np.minimum(gaps, _WIDEST_GAP * np.ptp(self.cam_turns) / cycle / len(places))

    def weights(self, kinematics: Kinematics) -> Array:
        """Return the share of the full cycle that each reading represents, shape (readings,)."""
        order, gaps = self._gaps(kinematics)
        weights = np.empty(len(order))
        # a reading represents half of the gap on each side of it
        weights[order] = (gaps + np.roll(gaps, 1)) / 2
        return weights

    def apart(self, lines: ErrorLines) -> Array:
        """Return the readings minus the mean curve of the lines [arcsec], shape (readings,)."""
        return self.error_arcsec - self._read(lines, lines.amplitude.mean(axis=0))

    def _read(self, lines: ErrorLines, amplitude: Complex) -> Array:
        """Return the curve with these amplitudes of lines at the readings [arcsec], shape (readings,)."""
        points = _FINER * POINTS_A_TURN * lines.kinematics.cycle_cam_revolutions
        spectrum = np.zeros(points // 2 + 1, dtype=complex)
        # one inverse transform gives all lines, and each reading takes the nearest point of a fine grid
        spectrum[lines.per_cycle] = amplitude
        return (np.fft.irfft(spectrum, points) * (points / 2))[self.points(lines, _FINER)]

    def lines(self, kinematics: Kinematics) -> ErrorLines:
        """Return the lines that the readings resolve, fitted by least squares, as the lines of one drive.

        The fit uses conjugate gradients because uneven readings mix lines. It stops after a few iterations to keep the
        error small where there are no readings.
        """
        weights = self.weights(kinematics)
        lines = self._resolved_lines(kinematics, weights)
        points = self.points(lines, _FINER)
        grid = _FINER * POINTS_A_TURN * kinematics.cycle_cam_revolutions
        total = weights.sum()

        def gradient(residual: Array) -> Complex:
            """Return the gradient of half the weighted sum of squares over the amplitudes, shape (lines,)."""
            # the mean level is not a line
            levelled = weights * (residual - weights @ residual / total)
            return np.asarray(np.fft.rfft(np.bincount(points, levelled, grid))[lines.per_cycle])

        amplitude = np.zeros(len(lines.per_cycle), dtype=complex)
        # conjugate gradients need one iteration for even readings and a few for nearly even ones
        descent = direction = gradient(self.error_arcsec)
        power = first_power = float(np.vdot(descent, descent).real)
        for _ in range(_ROUNDS):
            if power <= _SOLVED**2 * first_power:
                break
            # the product of the normal matrix and the direction is computed without forming the matrix
            curvature = gradient(self._read(lines, direction))
            step = power / float(np.vdot(direction, curvature).real)
            amplitude = amplitude + step * direction
            descent = descent - step * curvature
            previous_power = power
            power = float(np.vdot(descent, descent).real)
            direction = descent + power / previous_power * direction
        return replace(lines, amplitude=amplitude[None])

    def _resolved_lines(self, kinematics: Kinematics, weights: Array) -> ErrorLines:
        """Return as many lines as the usual gap between readings resolves, with amplitudes of 0.

        Lines that are images of each other are omitted: readings of two sweeps in closely spaced pairs resolve only the
        components of one sweep. A line is an image of another if the window of the readings, which is the transform of
        their weights, is large at the difference of the two.

        weights: weights of the readings, shape (readings,).
        """
        cycle = kinematics.cycle_cam_revolutions
        gaps = np.sort(self._gaps(kinematics)[1])
        # half of the cycle lies in gaps up to this one, so single wide gaps do not limit the lines
        usual_gap = gaps[np.searchsorted(np.cumsum(gaps), _USUAL_GAP * gaps.sum())]
        # each period needs two readings, and the points of curves limit the highest line
        end = min(min(round(1 / usual_gap), len(gaps)) // 2 + 1, POINTS_A_TURN * cycle // 2)
        lines = ErrorLines(
            kinematics=kinematics,
            per_cycle=np.arange(1, end),
            amplitude=np.zeros((1, end - 1), dtype=complex),
            certificate=EMPTY,
        )
        total = weights.sum()
        on_grid = np.bincount(self.points(lines, _FINER), weights, _FINER * POINTS_A_TURN * cycle)
        # share of a line that the weighted readings see in another line, by the distance between the two
        window = np.abs(np.fft.rfft(on_grid))[: 2 * end]
        is_image = window > _IMAGE * total
        first_distinct = int(np.argmin(is_image))  # neighbours look the same in a part of the cycle but are not images
        images = np.flatnonzero(is_image[first_distinct:])
        if not len(images):
            return lines
        # nearest distance at which lines look the same: lines up to half of this distance are distinct
        image = first_distinct + int(images[0])
        is_uneven = window[image] < _EVEN * total  # even readings also resolve the line at half the image
        return replace(lines, per_cycle=lines.per_cycle[: (image - is_uneven) // 2])

    def noise(self, lines: ErrorLines) -> tuple[int, float]:
        """Return the number of readings beyond those that lines can follow, and the noise variance [arcsec^2]."""
        # each line has two unknowns, and the level is one more
        again = len(self.cam_turns) - 2 * len(lines.per_cycle) - 1
        return again, float((self.apart(lines) ** 2).sum()) / max(again, 1)


@dataclass(frozen=True, eq=False)
class _Travel:
    """Readings of a travel, sorted by angle; each array has shape (readings,).

    turns: input angles [revolutions].
    error_arcsec: errors at these angles [arcsec].
    fitted_arcsec: fitted values at these angles [arcsec].
    """

    turns: Array
    error_arcsec: Array
    fitted_arcsec: Array

    @classmethod
    def of(cls, record: RecordedError, fitted: Array) -> _Travel:
        """Sort the readings of a recording by angle.

        record: the recording.
        fitted: fitted values at the readings [arcsec], shape (readings,).
        """
        order = np.argsort(record.cam_turns, kind="stable")
        return cls(
            turns=record.cam_turns[order],
            error_arcsec=record.error_arcsec[order],
            fitted_arcsec=fitted[order],
        )

    @property
    def first(self) -> float:
        """First input angle [revolutions]."""
        return float(self.turns[0])

    @property
    def span(self) -> float:
        """Input revolutions from the first to the last angle."""
        return float(np.ptp(self.turns))

    def mirrored(self, away: Array, end: int) -> Array:
        """Return the mirrored error beyond an end of the travel [arcsec], shape (distances,).

        The mirror image is even, which makes a bend at the end. An odd image replaces it close to the end.

        away: distances from the end [revolutions], shape (distances,).
        end: 0 for the first end, -1 for the last.
        """
        # reflect the distance back and forth within the travel
        inwards = self.span - np.abs(np.mod(away, 2 * self.span) - self.span)
        turns = self.turns[end] + (inwards if end == 0 else -inwards)
        even = np.interp(turns, self.turns, self.error_arcsec)
        # an odd image near the end continues the slope; an even image further away keeps the level
        closeness = np.exp(-((away / _BEND_TURNS) ** 2))
        return np.asarray(even + 2 * closeness * (self.fitted_arcsec[end] - even))


def require_sense(
    measurement: Measurement,
    drive: Drive,
    M_g: float,
    alignment: Alignment,
) -> None:
    """Raise UntrustedError if the mirrored recording fits the drive clearly better.

    For a full cycle, start and zero of the recording are fitted. For part of the cycle, they are those of the drive. A
    drive with unknown deviations is not checked, because it fits the recording and its mirror image equally well.

    measurement: the measurement.
    drive: the drive.
    M_g: torque [N*m].
    alignment: counting convention of the file.
    """
    # unknown directions fit both the recording and its mirror image
    if unknowns(drive):
        return
    sweep = measurement.directions[0]
    # only a full cycle determines start and zero
    is_free = not sweep.is_bound
    mirror = mirrored_reading(measurement, drive, M_g, replace(alignment, fitted=(is_free, is_free)))
    if mirror:
        message = f"{measurement.trace.file}: the mirrored recording agrees clearly better with {drive.name}"
        raise UntrustedError(f"{message}, with a residual of {mirror.rms_arcsec:.2f}″ rms", f"use {mirror.options}")


def require_fine_counts(measurement: Measurement) -> None:
    """Raise UntrustedError if a correction from a recording would store the rounding of an encoder.

    Counts at even angles round the same way in each revolution. Repeated revolutions do not reveal this rounding, and a
    correction would predict the removal of an error that the drive does not have.
    """
    sweep = measurement.directions[0]
    trace = measurement.trace
    # at even times, rounding is noise and is not stored
    if not trace.in_time:
        return
    u = next((source.arcsec for source in sweep.sources if source.name == "resolution"), None) or 0.0
    if COVERAGE_FACTOR * u > _MOST_ROUNDED * sweep.range.value:
        counts = f"the output is sampled at even angles, in steps of up to {trace.step_arcsec:.3g}″"
        rounding = f"a correction would store the rounding error (u = {u:.2g}″; F'_ior is {sweep.range.value:.4g}″)"
        raise UntrustedError(
            f"{trace.file}: {counts}; {rounding}",
            "sample both encoders at constant time intervals, not angles, or use an encoder with a finer resolution",
            Fault.ORDERS_UNTOLD,
        )


def recorded_error(
    measurement: Measurement,
    kinematics: Kinematics,
    asked: Alignment,
) -> RecordedError:
    """Return the error of a recording without level and drift, for two directions that of their mean.

    The error of a travel is continued over the cycle.

    asked: counting convention of the file.
    """
    sweep = measurement.directions[0]
    # convert the signs of the file to those of F_kpp and of the drive's input
    alignment = asked.of_file(measurement.trace, kinematics)
    turns = alignment.sense * sweep.bins.turns
    two_directions = drawn_both_directions(measurement, kinematics, asked)
    difference = two_directions.difference if two_directions else None
    error_arcsec = alignment.sign * sweep.fit.error
    if difference:
        half = difference.mean.curves[0] / 2
        departure = between_points(half, turns / kinematics.cycle_cam_revolutions)
        error_arcsec = error_arcsec - np.where(increasing_of(sweep.bins), departure, -departure)
    error = RecordedError(turns, error_arcsec, sweep.is_bound)
    if measurement.is_of_travel and not sweep.is_bound:
        # several sweeps count as one, because a continuation with the mean step of all sweeps would seem to resolve
        # components that no sweep resolves
        step = np.unique(np.floor(sweep.bins.turns * sweep.bins.per_turn), return_inverse=True)[1]
        fitted_arcsec = error_arcsec - alignment.sign * sweep.fit.residual
        error = RecordedError(_means_by_step(turns, step), _means_by_step(error_arcsec, step))
        error = error.filled(kinematics, _means_by_step(fitted_arcsec, step))
    return replace(
        error,
        F_ior_arcsec=measurement.F_ior_arcsec,
        sha256=measurement.trace.sha256,
        scale_uncertainty=measurement.trace.scale_uncertainty,
        difference=difference,
    )


def _means_by_step(values: Array, step: NDArray[np.int64]) -> Array:
    """Return the means of values over all readings of each step of the angle, shape (steps,).

    values: value of each reading, shape (readings,).
    step: number of the step of each reading, from 0, shape (readings,).
    """
    return np.asarray(np.bincount(step, values) / np.bincount(step))


def drawn_errors(
    measurement: Measurement,
    kinematics: Kinematics,
    asked: Alignment,
) -> DrawnErrors:
    """Return errors that agree with a recording, sampled from the posterior of its amplitudes.

    Waves that the recording does not determine, such as sidebands in a part of the cycle, differ from sample to sample.

    measurement: the measurement with both directions as one and with the ratio.
    kinematics: kinematics of the drive.
    asked: counting convention of the file.
    Raises UntrustedError for fewer than two input revolutions, and DataError if the readings are not a recording.
    """
    turns = measurement.directions[0].bins.span
    # in a single revolution, slow terms cannot be separated
    if turns < _FEWEST_TURNS:
        message = f"{measurement.trace.file}: the longest sweep covers only {turns:.2g} input revolutions"
        raise UntrustedError(message, f"record at least {_FEWEST_TURNS:g} input revolutions for this table")
    two_directions = drawn_both_directions(measurement, kinematics, asked)
    return two_directions or drawn_as_one(measurement, kinematics, asked)


def with_scale_spread(
    lines: ErrorLines,
    scale_uncertainty: float,
    seed: int,
) -> ErrorLines:
    """Return the lines of drives, each multiplied by a random factor, because the scale of the recording is uncertain.

    lines: lines of the drives.
    scale_uncertainty: relative standard uncertainty of the factor, which is normal with mean 1.
    seed: seed of the sequence of factors.
    """
    if not scale_uncertainty:
        return lines
    drives = len(lines.amplitude)
    # the factors are stratified, and in random order because the drives are ordered
    normal = ndtri((np.arange(drives) + 0.5) / drives)
    factors = 1 + scale_uncertainty * np.random.default_rng(seed).permutation(normal)
    return replace(lines, amplitude=lines.amplitude * factors[:, None])


def _whole_turns(turns: float, kinematics: Kinematics) -> float:
    """Return the smallest number of input revolutions that gives whole output revolutions and is not below `turns`."""
    period = abs(kinematics.u)
    return float(period * np.ceil(turns / period - 1e-9))


def solved_error(
    drive: Drive,
    M_g: float,
    run: Run,
) -> tuple[RecordedError, Certificate]:
    """Return the solved error of a drive at a torque M_g [N*m], as a recording with one reading per state."""
    solved = kinematic_error(
        drive,
        M_g,
        run=replace(run, cross_check=None),
    )
    return RecordedError(solved.states.phi_h / (2 * np.pi), solved.error_arcsec), solved.certificate


def with_more_lines(lines: ErrorLines, more: ErrorLines) -> ErrorLines:
    """Return the lines of drives with those of one further drive added to each, by increasing frequency."""
    all_per_cycle = np.union1d(lines.per_cycle, more.per_cycle)
    amplitude = np.zeros((len(lines.amplitude), len(all_per_cycle)), dtype=complex)
    amplitude[:, np.searchsorted(all_per_cycle, lines.per_cycle)] = lines.amplitude
    amplitude[:, np.searchsorted(all_per_cycle, more.per_cycle)] += more.amplitude
    return replace(lines, per_cycle=all_per_cycle, amplitude=amplitude)


def alike_lines(
    lines: ErrorLines,
    run: Run,
    misfit: float | None,
) -> ErrorLines:
    """Return lines of drives that differ from the given ones by a misfit, or have random phases.

    lines: lines of the given drives.
    run: the run, whose seed determines the samples.
    misfit: standard deviation of a line over its size; None for random phases.
    """
    # a misfit is a share of a line, plus a small share of the mean for lines that the drives do not have
    power = (np.abs(lines.amplitude) ** 2).mean(axis=0)
    scale = (misfit or 1.0) * np.sqrt((power + _LEAST_LINE * power.mean()) / 2)
    amplitudes = np.zeros((RECORDED_DRAWS, len(power))) if misfit is None else lines.amplitude
    return replace(lines, amplitude=amplitudes + scale * _drawn(len(amplitudes), len(power), run))


def _drawn(
    drives: int,
    lines: int,
    run: Run,
) -> Complex:
    """Return complex normal samples with standard deviation 1 in both parts and mean 0, shape (drives, lines)."""
    # the mean of antithetic pairs is exactly 0
    real, imaginary = np.random.default_rng([run.seed, 1]).standard_normal((2, drives // 2, lines))
    drawn = real + 1j * imaginary
    return np.concatenate([np.zeros((drives % 2, lines)), drawn, -drawn])


@dataclass(frozen=True)
class _ReadingNoise:
    """Mean square of the amplitude of a line due to noise of the readings [arcsec^2].

    power: best estimate.
    least: lowest plausible value, which the noise exceeds except with probability _LEAST_CHANCE.
    freedom: number of readings that determine the noise; 0 if the readings do not determine it.
    """

    power: float
    least: float
    freedom: int

    @classmethod
    def of(
        cls,
        record: RecordedError,
        fitted: ErrorLines,
        weights: Array,
    ) -> _ReadingNoise:
        """Return the noise, estimated from surplus readings or, if there are too few, from the median line power.

        record: the recording.
        fitted: lines fitted to the recording.
        weights: weights of the readings, shape (readings,).
        """
        freedom, variance = record.noise(fitted)
        # with too few repeats, most lines count as noise, whose median power is log(2) times its mean
        if freedom < _LEAST_REPEATS:
            median_power = float(np.median(np.abs(fitted.amplitude[0]) ** 2))
            return cls(
                power=max(median_power / np.log(2), _LEAST_POWER),
                least=_LEAST_POWER,
                freedom=0,
            )
        # variance of an amplitude in a least-squares fit with these weights
        power = max(4 * variance * float(weights @ weights), _LEAST_POWER)
        return cls(
            power=power,
            least=power * freedom / chdtri(freedom, _LEAST_CHANCE),
            freedom=freedom,
        )


def recorded_lines(
    lines: ErrorLines,
    record: RecordedError,
    run: Run,
) -> ErrorLines:
    """Return the lines of sampled drives that agree with a recording of the full cycle.

    Each line is shrunk according to the size of lines of its kind: predicted by the model or not, and at tooth orders
    or not. Readings that no line can follow determine the noise. Without enough of them, the power of most lines counts
    as noise and stays uncertain, because it may be error.

    lines: lines of the possible drives, predicted by the model.
    record: recording of the full cycle.
    run: the run, whose seed determines the samples.
    """
    fitted = record.lines(lines.kinematics)
    noise = _ReadingNoise.of(record, fitted, record.weights(lines.kinematics))
    # the size of other lines of the same kind determines how much a line is shrunk
    kept_share, largest_power = _shrunk_by_kind(fitted, lines, noise)
    phase = np.angle(fitted.amplitude)
    shrunk_lines = replace(fitted, amplitude=kept_share * fitted.amplitude)
    with_peaks = with_more_lines(shrunk_lines, _peaks_of(record, shrunk_lines).lines(lines.kinematics))
    # the power removed by shrinking may be error that the noise happens to cancel; this lost error is computed at the
    # lowest plausible noise, and in phase with the fitted lines because this preserves peaks
    lost = (1 - kept_share) * np.sqrt(largest_power) * np.exp(1j * phase)
    # share of the lost error that noise hides in each drive
    hidden = np.clip(np.linspace(-1, 1, RECORDED_DRAWS) / _ALL_HIDDEN, -1, 1)[:, None]
    spread = kept_share + np.abs(hidden) * (np.sqrt(kept_share) - kept_share)
    drawn = spread * np.sqrt(noise.power / 2) * _drawn(RECORDED_DRAWS, len(fitted.per_cycle), run)
    if noise.freedom:
        # only this number of readings determines the noise, which is therefore uncertain
        chi_square = np.random.default_rng([run.seed, 2]).chisquare(noise.freedom, (RECORDED_DRAWS, 1))
        drawn *= np.sqrt(noise.freedom / chi_square)
    drawn += hidden * lost
    return replace(with_peaks, amplitude=with_peaks.amplitude + drawn - drawn.mean(axis=0))


def _shrunk_by_kind(
    fitted: ErrorLines,
    lines: ErrorLines,
    noise: _ReadingNoise,
) -> tuple[Array, Array]:
    """Return the share of each fitted line that is not noise, and its mean square at the lowest plausible noise.

    Both have shape (lines,). Lines fall into four kinds: predicted by the model or not, and at tooth orders or not.

    fitted: lines fitted to the readings.
    lines: lines predicted by the model.
    noise: noise of the readings.
    """
    kinematics = fitted.kinematics
    power = np.abs(fitted.amplitude[0]) ** 2
    is_of_teeth = np.zeros(len(power), dtype=bool)
    for teeth in (kinematics.z_g, kinematics.z_b):
        # lines with a whole number of periods per revolution of a wheel
        is_of_teeth |= fitted.per_cycle % (kinematics.cycle_states // teeth) == 0
    # four kinds: predicted or not, at tooth orders or not
    kinds = np.isin(fitted.per_cycle, lines.per_cycle) + 2 * is_of_teeth
    share = np.empty(len(power))
    size = np.empty(len(power))
    for kind in np.unique(kinds):
        is_of_kind = kinds == kind
        share[is_of_kind], _ = shrunk(power[is_of_kind], noise.power)
        _, size[is_of_kind] = shrunk(power[is_of_kind], noise.least)
    return share, size


def _peaks_of(record: RecordedError, lines: ErrorLines) -> RecordedError:
    """Return the recording with only those residuals that exceed the noise, and 0 for all other readings."""
    remainder = record.apart(lines)
    deviation = np.median(np.abs(remainder)) / _MEDIAN_DEVIATION
    # noise alone exceeds this bound once in a hundred recordings
    is_peak = np.abs(remainder) > deviation * float(ndtri(1 - _PEAK_CHANCE / len(remainder)))
    return replace(record, error_arcsec=remainder * is_peak)


def shrunk(power: Array, noise: float) -> tuple[Array, Array]:
    """Return the share of each line of one kind that is not noise, and its mean square, both of shape (lines,).

    The amplitude of each line is normal. Its mean square is 0 or one of several sizes with the ratio _SIZE_STEP. The
    frequency of each size is estimated by maximum likelihood (expectation and maximisation).

    power: squared amplitudes of the lines [arcsec^2], shape (lines,).
    noise: mean square of the noise [arcsec^2].
    """
    # sizes increase by a constant factor, from below the noise to the largest line
    largest = np.log(max(power.max() / noise, 1.0)) / np.log(_SIZE_STEP)
    sizes = noise * np.append(0, _SIZE_STEP ** np.arange(-1, largest + 1))
    shares = sizes / (sizes + noise)
    # expectation and maximisation estimate the frequency of each size (empirical Bayes)
    frequency = np.full(len(sizes), 1 / len(sizes))
    # the power of a normal line of this size plus noise has an exponential distribution
    likelihood = np.exp(-power[:, None] / (sizes + noise)) / (sizes + noise)
    for _ in range(_SIZE_ROUNDS):
        belief = likelihood * frequency
        belief /= belief.sum(axis=1, keepdims=True)
        frequency = belief.mean(axis=0)
    share = belief @ shares
    return share, noise * share + power * (belief @ shares**2)


def fitted_prior(drive: Drive) -> DrivePrior:
    """Return the prior of the fields fitted to part of the cycle: open, uncertain, or doubted by `compare`."""
    # fields doubted by `compare` are also fitted; an uncertainty is two standard deviations
    doubts = {path: 2 * deviation for path, deviation in doubts_of(drive).items()}
    prior = prior_of(drive.model_copy(update={"uncertainty": doubts | drive.uncertainty}))
    fields = tuple(field for field in prior.fields if field.distribution == "normal" or drive.value(field.path) is None)
    return replace(prior, fields=fields)


@dataclass(frozen=True)
class _FitTerms:
    """Terms of the residuals of a fit."""

    start: Array  # values that the directions are pulled towards, shape (unknowns,)
    scale: float  # standard deviation of a reading [arcsec]
    beyond: Array  # error of the drive beyond its lines at the readings [arcsec], shape (readings,)


@dataclass(frozen=True)
class _RecordMisfit:
    """Misfit between the best drive and the recordings."""

    noise: float  # variance of a reading [arcsec^2]
    excess: float  # variance of the residual beyond the noise [arcsec^2]
    bound: float  # upper bound of the misfit, as a share of the error


@dataclass(frozen=True, eq=False)
class _RecordFit:
    """Fit of the fields of a drive to recordings, by torque [N*m].

    Unknowns are standard normal values of the fields, or shares of a revolution for directions, shape (drives,
    unknowns).
    """

    drive: Drive
    prior: DrivePrior
    records: Mapping[float, RecordedError]
    run: Run

    @cached_property
    def is_direction(self) -> NDArray[np.bool_]:
        """Whether each unknown is a direction, shape (unknowns,)."""
        return np.array([field.is_any_direction for field in self.prior.fields])

    @cached_property
    def cam_turns(self) -> float:
        """Number of input revolutions of all recordings together."""
        return float(sum(np.ptp(record.cam_turns) for record in self.records.values()))

    @cached_property
    def read(self) -> Array:
        """Errors of all readings minus the mean at each torque [arcsec], shape (readings,)."""
        return _levelled(record.error_arcsec for record in self.records.values())

    def values_of(self, unknowns: Array) -> list[dict[str, float]]:
        """Return the field values of drives, by path."""
        # directions are shares of a revolution, other unknowns are in standard deviations
        return self.prior.values(np.where(self.is_direction, unknowns, ndtr(unknowns)))

    def beyond_estimate(self, unknowns: Array) -> Array:
        """Return the recorded errors minus the lines of each drive [arcsec], shape (drives, readings)."""
        lines = {M_g: error_lines(self.drive, M_g, self.values_of(unknowns), self.run) for M_g in self.records}
        return _levelled(
            record.error_arcsec
            - between_points(lines[M_g].curves, record.cam_turns / lines[M_g].kinematics.cycle_cam_revolutions)
            for M_g, record in self.records.items()
        )

    def solved_beyond_lines(self, unknowns: Array) -> Array:
        """Return the solved error of one drive minus its lines, at the readings [arcsec], shape (readings,)."""
        values = self.values_of(unknowns[None])[0]
        remainders = []
        for M_g, record in self.records.items():
            lines = error_lines(self.drive, M_g, [values], self.run)
            solved, _ = solved_error(self.drive.with_values(values), M_g, self.run)
            # the solved cycle has one reading per state, and repeats
            period = lines.kinematics.cycle_cam_revolutions
            remainders.append(
                np.interp(
                    record.cam_turns,
                    solved.cam_turns,
                    solved.apart(lines),
                    period=period,
                )
            )
        return _levelled(remainders)

    def residuals(self, unknowns: Array, terms: _FitTerms) -> Array:
        """Return the residuals of readings and unknowns for each drive, shape (drives, readings + unknowns)."""
        # with prior terms, least squares finds the maximum of the posterior
        pull = np.where(self.is_direction, (unknowns - terms.start) / _OPEN_DIRECTION, unknowns)
        return np.concatenate([(self.beyond_estimate(unknowns) - terms.beyond) / terms.scale, pull], axis=1)

    def starts(self) -> Array:
        """Return the likeliest of the sampled drives, shape (_STARTS, unknowns)."""
        fields = self.prior.fields
        shares = self.prior.shares(SEARCHED, self.run.seed)[:, : len(fields)]
        drawn = np.where(self.is_direction, shares, np.clip(ndtri(shares), -_LARGEST, _LARGEST))
        # in the first half, uncertain fields keep their nominal values; in the second half, all fields are sampled
        drawn = np.concatenate([drawn * [field.distribution != "normal" for field in fields], drawn])
        # before the first fit, the misfit is assumed
        allowed_variance = _FIRST_MISFIT**2 * np.var(self.read)
        unlikely = self.beyond_estimate(drawn).var(axis=1) / allowed_variance * _MISFITS_A_TURN * self.cam_turns
        unlikely += (drawn[:, ~self.is_direction] ** 2).sum(axis=1)
        return np.asarray(drawn[np.argsort(unlikely)[:_STARTS]])

    def best_fit(
        self,
        starts: Array,
        scale: float,
        beyond: Array,
    ) -> tuple[Any, _FitTerms]:
        """Return the best fit and its terms; further starts are skipped once a fit reproduces the recording.

        starts: unknowns from which fits start, shape (starts, unknowns).
        scale: standard deviation of a reading [arcsec].
        beyond: error of the drive beyond its lines at the readings [arcsec], shape (readings,).
        """
        bounds = np.where(self.is_direction, np.inf, _LARGEST)
        fits = []
        for start in starts:
            terms = _FitTerms(
                start=start,
                scale=scale,
                beyond=beyond,
            )
            fit = least_squares(
                lambda unknowns, terms: self.residuals(unknowns[None], terms)[0],
                start,
                bounds=(-bounds, bounds),
                ftol=1e-3,
                diff_step=1e-3,
                args=(terms,),
            )
            fits.append((fit, terms))
            # a fit this close makes further starts unnecessary
            if np.var(self.beyond_estimate(fit.x[None]) - beyond) <= _SHOWN**2 * np.var(self.read):
                break
        return min(fits, key=lambda fit_and_terms: float(fit_and_terms[0].cost))

    def misfit_of(self, best: Array, beyond: Array) -> _RecordMisfit:
        """Return the misfit of the best drive.

        best: unknowns of the best drive, shape (unknowns,).
        beyond: error of the best drive beyond its lines [arcsec], shape (readings,).
        """
        residual = self.beyond_estimate(best[None])[0] - beyond
        # estimate the noise from differences of neighbouring readings
        noise = float(np.var(np.diff(residual))) / 2  # a misfit hardly changes between neighbours
        excess = max(float(np.var(residual)) - noise, 0.0)
        independent = _MISFITS_A_TURN * self.cam_turns
        # the bound uses chi-square for the independent values, and adds the misfit that noise and fitting to it may
        # hide
        bound = excess * independent / chdtri(max(independent - len(best), 2.0), 1 - _MISFIT_CHANCE)
        bound += noise * (float(ndtri(1 - _MISFIT_CHANCE)) / len(self.read) ** 0.5 + len(best) / len(self.read))
        return _RecordMisfit(
            noise=noise,
            excess=excess,
            bound=float(np.sqrt(bound / np.var(self.read))),
        )

    def agreeing(
        self,
        fit: Any,
        terms: _FitTerms,
        draws: int,
    ) -> Array:
        """Sample unknowns that agree with the recordings, the best fit first, shape (draws, unknowns).

        Normal samples around the fit are weighted by their likelihood.
        """
        # samples come from a normal approximation around the best fit
        *_, sizes, directions = np.linalg.svd(fit.jac, full_matrices=False)
        rng = np.random.default_rng([self.run.seed, 2])
        deviates = rng.standard_normal((draws, len(fit.x)))
        deviates[0] = 0
        drawn = fit.x + deviates / sizes @ directions
        # importance weights correct the approximation by the true residuals
        log_weight = ((deviates**2).sum(axis=1) - (self.residuals(drawn, terms) ** 2).sum(axis=1)) / 2
        cumulative = np.cumsum(np.exp(log_weight - log_weight.max()))
        # systematic resampling selects samples by their weights
        rows = np.searchsorted(cumulative, (np.arange(1, draws) - rng.random()) * (cumulative[-1] / (draws - 1)))
        return np.asarray(drawn[np.append(0, rows)])


def _levelled(by_torque: Iterable[Array]) -> Array:
    """Return the errors at all torques in one array, minus the mean over the readings at each torque."""
    return np.concatenate([errors - errors.mean(axis=-1, keepdims=True) for errors in by_torque], axis=-1)


def agreeing_drives(
    drive: Drive,
    records: Mapping[float, RecordedError],
    draws: int,
    run: Run,
) -> tuple[list[dict[str, float]], float]:
    """Find drives that agree with recordings.

    The best fit is the first drive. Other drives are sampled from a normal approximation around it and reweighted. Fits
    start from the likeliest sampled drives because a fit from the preset's own values may end in a local minimum. The
    angles of the recordings are those of the preset. Fields of `fitted_prior` are normal variables, and directions are
    shares of a revolution; features/record_comparison/fit describes the differences from its own fit.

    records: recordings by torque [N*m].
    draws: number of drives.
    Returns the values of the drives by path, and the upper bound of the misfit as a share of the error.
    Raises UntrustedError if no drive agrees.
    """
    record_fit = _RecordFit(
        drive=drive,
        prior=fitted_prior(drive),
        records=records,
        run=run,
    )
    read = record_fit.read
    # number of readings over which the misfit is the same
    together = len(read) / (_MISFITS_A_TURN * record_fit.cam_turns)
    misfit = _RecordMisfit(
        noise=0.0,
        excess=0.0,
        bound=_FIRST_MISFIT,
    )
    beyond = np.zeros(len(read))
    starts = record_fit.starts()
    for _ in range(_FITS):
        scale = float(np.sqrt(misfit.noise + together * misfit.bound**2 * np.var(read)))
        fit, terms = record_fit.best_fit(starts, scale, beyond)
        starts = fit.x[None]
        beyond = record_fit.solved_beyond_lines(fit.x)
        misfit = record_fit.misfit_of(fit.x, beyond)
    if misfit.excess > _MOST_MISFIT**2 * np.var(read):
        share = 100 * np.sqrt(misfit.excess / np.var(read))
        raise UntrustedError(
            f"no drive within the ranges of {drive.name} reproduces the recording: {share:.0f} % of the error remains",
            "record the full mesh cycle, or find the cause with hdassist compare",
        )
    return record_fit.values_of(record_fit.agreeing(fit, terms, draws)), misfit.bound
