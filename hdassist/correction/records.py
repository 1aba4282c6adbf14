"""Lines of a drive's error as a record of its full cycle has them: no deviation is fitted, so no model is believed.

Each line of a record is shrunk by the share that noise of readings has in it, from what is expected of its size: as in
drives as this one may be, and as the lines around it. Of part of the cycle they are those of drives that agree with it,
but for a misfit.
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
from hdassist.comparing.compare import mirrored_reading
from hdassist.comparing.record import Alignment, doubts_of
from hdassist.correction.forms import between_points
from hdassist.error.cycle import kinematic_error
from hdassist.error.waves import POINTS_A_TURN, Complex, ErrorLines, error_lines
from hdassist.errors import Fault, UntrustedError
from hdassist.measuring.fit import COVERAGE_FACTOR
from hdassist.measuring.full_cycle import cleaned_recording
from hdassist.measuring.measure import Measurement
from hdassist.model.deviations import unknowns
from hdassist.model.geometry import Array, Kinematics
from hdassist.preset.fields import Drive
from hdassist.recording.positions import recording_from_columns
from hdassist.recording.posterior import AmplitudePosterior, posterior_of_recording
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate

_BEND_TURNS = 0.1  # input revolutions beyond the ends of a travel in which the error bends into its mirror image
RECORDED_DRAWS = 64  # drives that agree with a record
_LEAST_LINE = 0.02  # mean square of a line by a misfit, as a share of the mean over all lines
_USUAL_GAP = 0.5  # share of the cycle in gaps between readings that are no wider: lines are what that one resolves
_IMAGE = 0.5  # a wave is the image of another one if readings see this share of it there
_EVEN = 0.999  # the same of readings at even angles
_ROUNDS = 4  # rounds of least squares at most: readings that are not quite even mix lines
_SOLVED = 1e-5  # least squares end at this share of their first gradient
_FINER = 32  # times the points of curves: resolution of places
_WIDEST_GAP = 2  # steps between readings: in the middle of a wider gap the error counts as not read, and as 0
_MOST_ROUNDED = 0.1  # largest expanded uncertainty by counts at even angles, as a share of the range
_LEAST_REPEATS = 20  # readings beyond those that lines can follow, from which noise is known
_LEAST_CHANCE = 0.05  # that noise is less than it counts as for what is lost
_PEAK_CHANCE = 0.01  # that noise alone has a reading which counts as a peak of the error
_ALL_HIDDEN = 0.5  # share of drives of whose error noise hides less than it may, from none of that upwards
_MEDIAN_DEVIATION = 0.6745  # median magnitude of a standard normal number
_SIZE_STEP = 4.0  # factor between the mean squares of lines that are tried
_SIZE_ROUNDS = 50  # rounds for the frequencies of these mean squares
_LEAST_POWER = 1e-12  # arcsec^2
_FIRST_MISFIT = 0.1  # root mean square of the first misfit, as a share of the error
_MOST_MISFIT = 0.15  # largest root mean square of a misfit, as a share of the error
_MISFIT_CHANCE = 0.05  # that a misfit is more than its bound
# drives with open fields alone drawn, as many with all; the likeliest, from which fits begin until one shows the record
SEARCHED = 128
_STARTS = 10
_SHOWN = 0.05  # a fit shows a recording if it leaves less than this share of its root mean square
_FITS = 2  # the second by the misfit of the first, and with what lines leave of its drive's solved cycle
_MISFITS_A_TURN = 24  # independent numbers, in an input revolution, of a misfit of orders up to 12
_OPEN_DIRECTION = 12**-0.5  # standard deviation, as a share of its turn
_FEWEST_TURNS = 2.0  # input revolutions of which a table over the input is made
_LARGEST = 3.0  # standard deviations that a field differs by, at most


@dataclass(frozen=True, eq=False)
class RecordedError:
    """Error F_kpp of a recording, by the angle of the input from the recording's zero.

    cam_turns: input angles [turns], shape (readings,).
    error_arcsec: shape (readings,).
    is_part: whether the readings cover less than the full cycle.
    recorded_turns: first and last input angle of a travel that was recorded, None for the full cycle.
    F_ior_arcsec: as `measure` gives it, None for a solved error.
    sha256: of its file.
    scale_uncertainty: relative standard uncertainty of one factor of all errors.
    """

    cam_turns: Array
    error_arcsec: Array
    is_part: bool = False
    recorded_turns: tuple[float, float] | None = None
    F_ior_arcsec: float | None = None
    sha256: str = ""
    scale_uncertainty: float = 0.0

    def visited(self, kinematics: Kinematics) -> NDArray[np.bool_]:
        """Return the points of the curves of lines in the travel that was recorded, all of the full cycle."""
        turns = np.arange(POINTS_A_TURN * kinematics.cycle_cam_revolutions) / POINTS_A_TURN
        # without a travel the whole cycle was recorded
        first, last = self.recorded_turns or (0.0, float(turns[-1]))
        return np.asarray(np.mod(turns - first, _whole_turns(last - first, kinematics)) <= last - first)

    def filled(self, kinematics: Kinematics, fitted: Array) -> RecordedError:
        """Return the record of a travel continued over the full cycle, mirrored at both ends.

        So a correction has no leap where the output never comes, and no bend at the ends.

        kinematics: of the drive.
        fitted: values of the fit at the readings [arcsec], shape (readings,).
        """
        travel = _Travel.of(self, fitted)
        whole_turns = _whole_turns(travel.span, kinematics)
        # at the same mean step, from the last end of the travel to the next beginning
        beyond = np.arange(travel.span, whole_turns, travel.span / len(travel.turns))[1:]
        # from the mirror image at the last end to that at the first one
        share = (1 + np.cos(np.pi * (beyond - travel.span) / max(whole_turns - travel.span, 1e-12))) / 2
        # a mirrored curve has no jump and no bend at the ends that the correction would ring with
        from_last = travel.mirrored(beyond - travel.span, -1)
        from_first = travel.mirrored(whole_turns - beyond, 0)
        turns = np.append(travel.turns, travel.first + beyond)
        error = np.append(travel.error_arcsec, share * from_last + (1 - share) * from_first)
        # an odd number of teeth has a cycle of two output revolutions
        repeats = max(1, round(kinematics.cycle_cam_revolutions / whole_turns))
        offsets = np.arange(repeats)[:, None] * whole_turns
        return RecordedError(
            (turns + offsets).ravel(),
            np.tile(error, repeats),
            recorded_turns=(travel.first, travel.first + travel.span),
        )

    def points(self, lines: ErrorLines, finer: int = 1) -> NDArray[np.int64]:
        """Return the nearest points of the curves of lines, or of a grid finer by an integer factor."""
        cycle = lines.kinematics.cycle_cam_revolutions
        count = finer * POINTS_A_TURN * cycle
        places = np.mod(self.cam_turns / cycle, 1)
        return np.asarray(np.rint(places * count).astype(np.int64) % count)

    def _gaps(self, kinematics: Kinematics) -> tuple[NDArray[np.int64], Array]:
        """Return readings in the order of their places in the full cycle, and the gap behind each, as a share of it.

        Of a gap that is too wide no more than counts as read.
        """
        cycle = kinematics.cycle_cam_revolutions
        places = np.mod(self.cam_turns / cycle, 1)
        # by place in the cycle, whatever revolution a reading is of
        order = np.argsort(places, kind="stable")
        gaps = np.diff(places[order], append=places[order[0]] + 1)
        # an unrecorded part must not weigh on the readings at its ends
        return order, np.minimum(gaps, _WIDEST_GAP * np.ptp(self.cam_turns) / cycle / len(places))

    def weights(self, kinematics: Kinematics) -> Array:
        """Return the shares of the full cycle that readings stand for: to the middle between each and the next."""
        order, gaps = self._gaps(kinematics)
        weights = np.empty(len(order))
        # half of the gaps on both sides
        weights[order] = (gaps + np.roll(gaps, 1)) / 2
        return weights

    def apart(self, lines: ErrorLines) -> Array:
        """Return the readings minus the mean of lines [arcsec], shape (readings,)."""
        return self.error_arcsec - self._read(lines, lines.amplitude.mean(axis=0))

    def _read(self, lines: ErrorLines, amplitude: Complex) -> Array:
        """Return the curve of amplitudes of lines at the readings [arcsec], shape (readings,)."""
        points = _FINER * POINTS_A_TURN * lines.kinematics.cycle_cam_revolutions
        spectrum = np.zeros(points // 2 + 1, dtype=complex)
        # one inverse transform for all lines, read at the nearest point of a fine grid
        spectrum[lines.per_cycle] = amplitude
        return (np.fft.irfft(spectrum, points) * (points / 2))[self.points(lines, _FINER)]

    def lines(self, kinematics: Kinematics) -> ErrorLines:
        """Fit as many lines as the readings resolve and curves have, by least squares: those of one drive.

        The fit uses conjugate gradients, because uneven readings mix lines, and few iterations, so that the error stays
        small where there are no readings.
        """
        weights = self.weights(kinematics)
        lines = self._resolved_lines(kinematics, weights)
        points = self.points(lines, _FINER)
        grid = _FINER * POINTS_A_TURN * kinematics.cycle_cam_revolutions
        total = weights.sum()

        def gradient(residual: Array) -> Complex:
            """Return the gradient of half the weighted squares over the amplitudes, shape (lines,)."""
            # the level is no line
            levelled = weights * (residual - weights @ residual / total)
            return np.asarray(np.fft.rfft(np.bincount(points, levelled, grid))[lines.per_cycle])

        amplitude = np.zeros(len(lines.per_cycle), dtype=complex)
        # conjugate gradients: even readings need one round, nearly even ones a few
        descent = direction = gradient(self.error_arcsec)
        power = first_power = float(np.vdot(descent, descent).real)
        for _ in range(_ROUNDS):
            if power <= _SOLVED**2 * first_power:
                break
            # product of the normal matrix with the direction, without the matrix
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

        Lines that are images of each other are left out: readings of two sweeps in closely spaced pairs resolve the
        components of one sweep. A line is an image of another if the window of the readings, the transform of their
        weights, is large at the difference.

        weights: of the readings, shape (readings,).
        """
        cycle = kinematics.cycle_cam_revolutions
        gaps = np.sort(self._gaps(kinematics)[1])
        # the gap that half of the cycle does not exceed: single wide gaps do not limit the lines
        usual_gap = gaps[np.searchsorted(np.cumsum(gaps), _USUAL_GAP * gaps.sum())]
        # two readings for each period, and no line beyond the points of curves
        end = min(min(round(1 / usual_gap), len(gaps)) // 2 + 1, POINTS_A_TURN * cycle // 2)
        lines = ErrorLines(
            kinematics=kinematics,
            per_cycle=np.arange(1, end),
            amplitude=np.zeros((1, end - 1), dtype=complex),
            certificate=EMPTY,
        )
        total = weights.sum()
        on_grid = np.bincount(self.points(lines, _FINER), weights, _FINER * POINTS_A_TURN * cycle)
        # how much of a line the weighted readings see in another one, by the distance of both
        window = np.abs(np.fft.rfft(on_grid))[: 2 * end]
        is_image = window > _IMAGE * total
        first_distinct = int(np.argmin(is_image))  # neighbours in a part of the cycle look the same, but are no images
        images = np.flatnonzero(is_image[first_distinct:])
        if not len(images):
            return lines
        # the nearest distance at which lines look alike: lines up to half of it are distinct
        image = first_distinct + int(images[0])
        is_uneven = window[image] < _EVEN * total  # even readings resolve the line at half the image too
        return replace(lines, per_cycle=lines.per_cycle[: (image - is_uneven) // 2])

    def noise(self, lines: ErrorLines) -> tuple[int, float]:
        """Return the number of readings beyond those that lines can follow, and the variance of noise [arcsec^2]."""
        # two unknowns for each line, and the level
        again = len(self.cam_turns) - 2 * len(lines.per_cycle) - 1
        return again, float((self.apart(lines) ** 2).sum()) / max(again, 1)


@dataclass(frozen=True, eq=False)
class _Travel:
    """Readings of a travel in the order of their angles, each of shape (readings,).

    turns: input angles [turns].
    error_arcsec: at these.
    fitted_arcsec: values of the fit at these.
    """

    turns: Array
    error_arcsec: Array
    fitted_arcsec: Array

    @classmethod
    def of(cls, record: RecordedError, fitted: Array) -> _Travel:
        """Sort the readings of a record; fitted: values of the fit [arcsec], shape (readings,)."""
        order = np.argsort(record.cam_turns, kind="stable")
        return cls(
            turns=record.cam_turns[order],
            error_arcsec=record.error_arcsec[order],
            fitted_arcsec=fitted[order],
        )

    @property
    def first(self) -> float:
        """First input angle [turns]."""
        return float(self.turns[0])

    @property
    def span(self) -> float:
        """Input revolutions from the first to the last angle."""
        return float(np.ptp(self.turns))

    def mirrored(self, away: Array, end: int) -> Array:
        """Return the error mirrored at an end [arcsec], 0 for the first and -1 for the last, at distances [turns].

        The mirror image is even, so it has a bend at the end. Close to the end the odd one takes its place.
        """
        # back and forth within the travel
        inwards = self.span - np.abs(np.mod(away, 2 * self.span) - self.span)
        turns = self.turns[end] + (inwards if end == 0 else -inwards)
        even = np.interp(turns, self.turns, self.error_arcsec)
        # near the end an odd mirror image, which keeps the slope, further off an even one, which keeps the
        # level
        closeness = np.exp(-((away / _BEND_TURNS) ** 2))
        return np.asarray(even + 2 * closeness * (self.fitted_arcsec[end] - even))


def require_sense(
    measurement: Measurement,
    drive: Drive,
    M_g: float,
    alignment: Alignment,
) -> None:
    """Raise UntrustedError if a recording fits its drive clearly better when it is read the other way.

    Its start and zero are any over the full cycle, those of the drive over a part of it. A drive with unknown
    deviations may be either way round.

    M_g: torque [N*m].
    alignment: how the file counts.
    """
    # unknown directions fit a recording read either way
    if unknowns(drive):
        return
    sweep = measurement.directions[0]
    # only a full cycle determines start and zero
    is_free = not sweep.is_bound
    mirror = mirrored_reading(measurement, drive, M_g, replace(alignment, fitted=(is_free, is_free)))
    if mirror:
        message = f"{measurement.trace.file}: the mirrored recording fits {drive.name} clearly better"
        raise UntrustedError(f"{message}, {mirror.rms_arcsec:.2f}″ rms off", mirror.options)


def require_fine_counts(measurement: Measurement) -> None:
    """Raise UntrustedError if a correction of a record would store what the counts of an encoder round.

    Counts at even angles round alike in each revolution. The repetition of a record does not show that, and a
    correction would promise to remove an error that the drive does not have.
    """
    sweep = measurement.directions[0]
    trace = measurement.trace
    # at even times rounding is noise, and is not stored
    if not trace.in_time:
        return
    u = next((source.arcsec for source in sweep.sources if source.name == "resolution"), None) or 0.0
    if COVERAGE_FACTOR * u > _MOST_ROUNDED * sweep.range.value:
        counts = f"steps of up to {trace.step_arcsec:.3g}″ at the output, read at even angles"
        rounding = f"a correction would store their rounding, u = {u:.2g}″ of {sweep.range.value:.4g}″"
        raise UntrustedError(
            f"{trace.file}: {counts}: {rounding}",
            "sample both encoders at constant time intervals, not angles, or use an encoder with finer counts",
            Fault.ORDERS_UNTOLD,
        )


def recorded_error(
    measurement: Measurement,
    kinematics: Kinematics,
    asked: Alignment,
) -> RecordedError:
    """Return the error of a recording without level and drift, both directions as one.

    That of a travel is continued over the cycle.

    Argument: asked, how the file counts.
    """
    sweep = measurement.directions[0]
    # signs of the file become those of F_kpp and of the drive's input
    alignment = asked.of_file(measurement.trace, kinematics)
    error = RecordedError(alignment.sense * sweep.bins.turns, alignment.sign * sweep.fit.error, sweep.is_bound)
    if measurement.is_of_travel and not sweep.is_bound:
        error = error.filled(kinematics, alignment.sign * (sweep.fit.error - sweep.fit.residual))
    return replace(
        error,
        F_ior_arcsec=measurement.F_ior_arcsec,
        sha256=measurement.trace.sha256,
        scale_uncertainty=measurement.trace.scale_uncertainty,
    )


@dataclass(frozen=True, eq=False)
class _DrawnErrors:
    """Errors of sampled drives that agree with a recording.

    lines: components of the input and the output of each.
    beyond_arcsec: range that components off these lines can add, shape (drives,); their phases differ from cycle to
    cycle.
    """

    lines: ErrorLines
    beyond_arcsec: Array


def drawn_errors(
    measurement: Measurement,
    kinematics: Kinematics,
    asked: Alignment,
) -> _DrawnErrors:
    """Return errors that agree with a recording, by the posterior of its amplitudes.

    Waves that the recording does not determine, such as sidebands of a part of the cycle, differ from draw to draw.
    Both directions count as one, each sweep with a level of its own.

    measurement: both directions as one, with the ratio.
    kinematics: kinematics of the drive.
    asked: how the file counts.
    Raises UntrustedError for fewer input revolutions than two; DataError for readings that are no recording.
    """
    sweep = measurement.directions[0]
    trace = measurement.trace
    turns = sweep.bins.span
    # slow terms take the place of a single revolution
    if turns < _FEWEST_TURNS:
        message = f"{trace.file}: {turns:.2g} input revolutions in its longest sweep"
        raise UntrustedError(message, f"record at least {_FEWEST_TURNS:g} input revolutions for a table over the input")
    alignment = asked.of_file(trace, kinematics)
    ratio = abs(kinematics.u)
    cleaned = cleaned_recording(sweep, ratio)
    order = np.lexsort((cleaned.input_rev, cleaned.sweep))  # each sweep in the sense of growing angles
    recording = recording_from_columns(
        input_rev=alignment.sense * cleaned.input_rev[order],
        error_arcsec=alignment.sign * cleaned.error_arcsec[order],
        ratio=ratio,
        sweep=cleaned.sweep[order],
        time=np.sort(cleaned.time),
    )
    posterior = posterior_of_recording(recording, seed=measurement.seed)
    # evenly over the draws
    draws = np.linspace(0, len(posterior.amplitudes) - 1, RECORDED_DRAWS).astype(np.int64)
    return _DrawnErrors(
        lines=_lines_of_draws(posterior, draws, kinematics),
        beyond_arcsec=2 * posterior.line_amplitudes[draws].sum(axis=1),
    )


def _lines_of_draws(
    posterior: AmplitudePosterior,
    draws: NDArray[np.int64],
    kinematics: Kinematics,
) -> ErrorLines:
    """Return the components of some draws of a posterior as lines of the full cycle.

    draws: numbers of the draws, shape (drives,).
    """
    cosines, sines = np.split(
        posterior.amplitudes[draws],
        2,
        axis=1,
    )
    cycle = posterior.cycle
    # pairs count periods in an input and in an output revolution
    periods = posterior.pairs[:, 0] * cycle.numerator + posterior.pairs[:, 1] * cycle.denominator
    per_cycle, index = np.unique(periods, return_inverse=True)
    amplitude = np.zeros((len(draws), len(per_cycle)), dtype=complex)
    np.add.at(amplitude.T, index, (cosines - 1j * sines).T)  # several components may have the same period
    return ErrorLines(
        kinematics=kinematics,
        per_cycle=per_cycle,
        amplitude=amplitude,
        certificate=EMPTY,
    )


def with_scale_spread(
    lines: ErrorLines,
    scale_uncertainty: float,
    seed: int,
) -> ErrorLines:
    """Return lines of drives whose errors differ by a normal factor around 1, which a recording leaves open.

    lines: lines of the drives.
    scale_uncertainty: relative standard uncertainty of the factor.
    seed: seed of the sequence of the factors.
    """
    if not scale_uncertainty:
        return lines
    drives = len(lines.amplitude)
    # stratified, and in random order, since the drives are ordered
    normal = ndtri((np.arange(drives) + 0.5) / drives)
    factors = 1 + scale_uncertainty * np.random.default_rng(seed).permutation(normal)
    return replace(lines, amplitude=lines.amplitude * factors[:, None])


def _whole_turns(turns: float, kinematics: Kinematics) -> float:
    """Return the smallest number of input revolutions that are whole output revolutions and at least as many."""
    period = abs(kinematics.u)
    return float(period * np.ceil(turns / period - 1e-9))


def solved_error(
    drive: Drive,
    M_g: float,
    run: Run,
) -> tuple[RecordedError, Certificate]:
    """Return the solved error of a drive at a torque M_g [N*m], as a record of each state of its cycle."""
    solved = kinematic_error(
        drive,
        M_g,
        run=replace(run, cross_check=None),
    )
    return RecordedError(solved.states.phi_h / (2 * np.pi), solved.error_arcsec), solved.certificate


def with_more_lines(lines: ErrorLines, more: ErrorLines) -> ErrorLines:
    """Return the lines, rising, of drives with those of one drive more in each."""
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
    """Return the lines of drives that may differ by a misfit from these: standard deviation of a line, over its size.

    Where misfit is None phases are any.
    """
    # a misfit is a share of a line, and a little of the mean for lines that the drives do not have
    power = (np.abs(lines.amplitude) ** 2).mean(axis=0)
    scale = (misfit or 1.0) * np.sqrt((power + _LEAST_LINE * power.mean()) / 2)
    amplitudes = np.zeros((RECORDED_DRAWS, len(power))) if misfit is None else lines.amplitude
    return replace(lines, amplitude=amplitudes + scale * _drawn(len(amplitudes), len(power), run))


def _drawn(
    drives: int,
    lines: int,
    run: Run,
) -> Complex:
    """Draw normal numbers of standard deviation 1 in both parts, whose mean is 0, shape (drives, lines)."""
    # antithetic pairs: their mean is exactly 0
    real, imaginary = np.random.default_rng([run.seed, 1]).standard_normal((2, drives // 2, lines))
    drawn = real + 1j * imaginary
    return np.concatenate([np.zeros((drives % 2, lines)), drawn, -drawn])


@dataclass(frozen=True)
class _ReadingNoise:
    """Mean squares of the amplitude of a line by noise of readings [arcsec^2].

    power: best estimate.
    least: what it is at least, but for a probability of _LEAST_CHANCE.
    freedom: readings by which it is known, 0 if it is not known from the readings.
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
        """Return the noise by readings that no line can follow, or else the power that most lines have."""
        freedom, variance = record.noise(fitted)
        # too few repeats: most lines are noise, whose power has the median log(2) times its mean
        if freedom < _LEAST_REPEATS:
            median_power = float(np.median(np.abs(fitted.amplitude[0]) ** 2))
            return cls(
                power=max(median_power / np.log(2), _LEAST_POWER),
                least=_LEAST_POWER,
                freedom=0,
            )
        # variance of an amplitude by least squares with these weights
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
    """Return lines of drives that agree with a record of the full cycle.

    Each line is shrunk by what its kind shows of its size: lines of the model, of single teeth, of neither. Noise of
    readings is known from what no line can follow. Otherwise the power that most lines have counts as noise, and stays
    open, as it may be the error.

    lines: of drives as this one may be.
    record: of the full cycle.
    run: whose seed draws the drives.
    """
    fitted = record.lines(lines.kinematics)
    noise = _ReadingNoise.of(record, fitted, record.weights(lines.kinematics))
    # lines are shrunk by how large lines of their kind are
    kept_share, largest_power = _shrunk_by_kind(fitted, lines, noise)
    phase = np.angle(fitted.amplitude)
    shrunk_lines = replace(fitted, amplitude=kept_share * fitted.amplitude)
    with_peaks = with_more_lines(shrunk_lines, _peaks_of(record, shrunk_lines).lines(lines.kinematics))
    # what shrinking takes off may be error that noise happens to oppose
    lost = (1 - kept_share) * np.sqrt(largest_power) * np.exp(1j * phase)  # as noise may be least; peaks stay peaks
    hidden = np.clip(np.linspace(-1, 1, RECORDED_DRAWS) / _ALL_HIDDEN, -1, 1)[:, None]  # share that noise hides
    spread = kept_share + np.abs(hidden) * (np.sqrt(kept_share) - kept_share)
    drawn = spread * np.sqrt(noise.power / 2) * _drawn(RECORDED_DRAWS, len(fitted.per_cycle), run)
    if noise.freedom:
        # the noise itself is known by so many readings only
        chi_square = np.random.default_rng([run.seed, 2]).chisquare(noise.freedom, (RECORDED_DRAWS, 1))
        drawn *= np.sqrt(noise.freedom / chi_square)
    drawn += hidden * lost
    return replace(with_peaks, amplitude=with_peaks.amplitude + drawn - drawn.mean(axis=0))


def _shrunk_by_kind(
    fitted: ErrorLines,
    lines: ErrorLines,
    noise: _ReadingNoise,
) -> tuple[Array, Array]:
    """Return the share of each fitted line that is no noise, and its mean square if noise is least, shape (lines,).

    Kinds are lines of the model, lines of single teeth, of both, and of neither.

    fitted: to the readings.
    lines: of the model.
    """
    kinematics = fitted.kinematics
    power = np.abs(fitted.amplitude[0]) ** 2
    is_of_teeth = np.zeros(len(power), dtype=bool)
    for teeth in (kinematics.z_g, kinematics.z_b):
        # lines at whole periods of a wheel's revolution
        is_of_teeth |= fitted.per_cycle % (kinematics.cycle_states // teeth) == 0
    # predicted or not, of teeth or not: four kinds
    kinds = np.isin(fitted.per_cycle, lines.per_cycle) + 2 * is_of_teeth
    share = np.empty(len(power))
    size = np.empty(len(power))
    for kind in np.unique(kinds):
        is_of_kind = kinds == kind
        share[is_of_kind], _ = shrunk(power[is_of_kind], noise.power)
        _, size[is_of_kind] = shrunk(power[is_of_kind], noise.least)
    return share, size


def _peaks_of(record: RecordedError, lines: ErrorLines) -> RecordedError:
    """Return the readings of a record that stand out from its lines more than noise does, the others as 0."""
    remainder = record.apart(lines)
    deviation = np.median(np.abs(remainder)) / _MEDIAN_DEVIATION
    # a bound that noise alone passes once in a hundred recordings
    is_peak = np.abs(remainder) > deviation * float(ndtri(1 - _PEAK_CHANCE / len(remainder)))
    return replace(record, error_arcsec=remainder * is_peak)


def shrunk(power: Array, noise: float) -> tuple[Array, Array]:
    """Return the shares of lines of one kind that are no noise, and their mean squares, from squares of amplitudes.

    Each line is normal, of a size from none upwards by factors of SIZE_STEP; how many have which is what makes all of
    them most likely (expectation and maximisation).
    """
    # sizes in steps of a factor, from less than noise to the largest line
    largest = np.log(max(power.max() / noise, 1.0)) / np.log(_SIZE_STEP)
    sizes = noise * np.append(0, _SIZE_STEP ** np.arange(-1, largest + 1))
    shares = sizes / (sizes + noise)
    # empirical Bayes: how frequent each size is, by expectation and maximisation
    frequency = np.full(len(sizes), 1 / len(sizes))
    # power of a normal line of this size with noise: exponential
    likelihood = np.exp(-power[:, None] / (sizes + noise)) / (sizes + noise)
    for _ in range(_SIZE_ROUNDS):
        belief = likelihood * frequency
        belief /= belief.sum(axis=1, keepdims=True)
        frequency = belief.mean(axis=0)
    share = belief @ shares
    return share, noise * share + power * (belief @ shares**2)


def fitted_prior(drive: Drive) -> DrivePrior:
    """Return fields by which a recording of part of the cycle is fitted: open, uncertain, or doubted by `compare`."""
    # what `compare` doubts is fitted too: half of an uncertainty is a standard deviation
    doubts = {path: 2 * deviation for path, deviation in doubts_of(drive).items()}
    prior = prior_of(drive.model_copy(update={"uncertainty": doubts | drive.uncertainty}))
    fields = tuple(field for field in prior.fields if field.distribution == "normal" or drive.value(field.path) is None)
    return replace(prior, fields=fields)


@dataclass(frozen=True)
class _FitTerms:
    """Terms of the residuals of a fit."""

    start: Array  # directions are pulled towards it, shape (unknowns,)
    scale: float  # standard deviation of a reading [arcsec]
    beyond: Array  # error of the drive beyond its lines at the readings [arcsec], shape (readings,)


@dataclass(frozen=True)
class _RecordMisfit:
    """Misfit of the best drive to records."""

    noise: float  # variance of a reading [arcsec^2]
    excess: float  # variance of the residual beyond the noise [arcsec^2]
    bound: float  # upper bound of the misfit, as a share of the error


@dataclass(frozen=True, eq=False)
class _RecordFit:
    """Fit of the fields of a drive to records by torque [N*m].

    Unknowns are normal numbers of the fields, for directions shares of their turn, shape (drives, unknowns).
    """

    drive: Drive
    prior: DrivePrior
    records: Mapping[float, RecordedError]
    run: Run

    @cached_property
    def is_direction(self) -> NDArray[np.bool_]:
        """Whether an unknown is a direction, shape (unknowns,)."""
        return np.array([field.is_any_direction for field in self.prior.fields])

    @cached_property
    def cam_turns(self) -> float:
        """Input revolutions of all records."""
        return float(sum(np.ptp(record.cam_turns) for record in self.records.values()))

    @cached_property
    def read(self) -> Array:
        """Errors of all readings without their mean at each torque [arcsec], shape (readings,)."""
        return _levelled(record.error_arcsec for record in self.records.values())

    def values_of(self, unknowns: Array) -> list[dict[str, float]]:
        """Return the values of drives, by path."""
        # directions are shares of their turn, other unknowns standard deviations
        return self.prior.values(np.where(self.is_direction, unknowns, ndtr(unknowns)))

    def beyond_estimate(self, unknowns: Array) -> Array:
        """Return the errors of the records beyond the lines of drives [arcsec], shape (drives, readings)."""
        lines = {M_g: error_lines(self.drive, M_g, self.values_of(unknowns), self.run) for M_g in self.records}
        return _levelled(
            record.error_arcsec
            - between_points(lines[M_g].curves, record.cam_turns / lines[M_g].kinematics.cycle_cam_revolutions)
            for M_g, record in self.records.items()
        )

    def solved_beyond_lines(self, unknowns: Array) -> Array:
        """Return the solved cycle of one drive without its lines [arcsec], at the readings, shape (readings,)."""
        values = self.values_of(unknowns[None])[0]
        remainders = []
        for M_g, record in self.records.items():
            lines = error_lines(self.drive, M_g, [values], self.run)
            solved, _ = solved_error(self.drive.with_values(values), M_g, self.run)
            # the solved cycle has one reading for each state, and repeats
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
        """Return the residuals of drives, of readings and of unknowns, shape (drives, readings + unknowns)."""
        # prior terms: least squares finds the posterior's maximum
        pull = np.where(self.is_direction, (unknowns - terms.start) / _OPEN_DIRECTION, unknowns)
        return np.concatenate([(self.beyond_estimate(unknowns) - terms.beyond) / terms.scale, pull], axis=1)

    def starts(self) -> Array:
        """Return the likeliest of drawn drives, shape (_STARTS, unknowns)."""
        fields = self.prior.fields
        shares = self.prior.shares(SEARCHED, self.run.seed)[:, : len(fields)]
        drawn = np.where(self.is_direction, shares, np.clip(ndtri(shares), -_LARGEST, _LARGEST))
        # first with uncertain fields at their values, then with all fields drawn
        drawn = np.concatenate([drawn * [field.distribution != "normal" for field in fields], drawn])
        # before a fit the misfit is a guess
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
        """Return the best fit from some starts, and its terms; further starts are left out once one is close."""
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
            # a fit this close is found once
            if np.var(self.beyond_estimate(fit.x[None]) - beyond) <= _SHOWN**2 * np.var(self.read):
                break
        return min(fits, key=lambda fit_and_terms: float(fit_and_terms[0].cost))

    def misfit_of(self, best: Array, beyond: Array) -> _RecordMisfit:
        """Return the misfit of the best drive; beyond: its error beyond its lines [arcsec], shape (readings,)."""
        residual = self.beyond_estimate(best[None])[0] - beyond
        # differences of neighbours
        noise = float(np.var(np.diff(residual))) / 2  # of a reading: a misfit continues from one to the next
        excess = max(float(np.var(residual)) - noise, 0.0)
        independent = _MISFITS_A_TURN * self.cam_turns
        # its bound by chi square of independent numbers, and by what noise and a fit to it may hide of it
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
        """Draw unknowns that agree with the records, first the best ones, shape (draws, unknowns).

        Normal numbers around the fit are drawn and weighed by their likelihood.
        """
        # the normal approximation around the best fit
        *_, sizes, directions = np.linalg.svd(fit.jac, full_matrices=False)
        rng = np.random.default_rng([self.run.seed, 2])
        deviates = rng.standard_normal((draws, len(fit.x)))
        deviates[0] = 0
        drawn = fit.x + deviates / sizes @ directions
        # importance weights correct it by the true residuals
        log_weight = ((deviates**2).sum(axis=1) - (self.residuals(drawn, terms) ** 2).sum(axis=1)) / 2
        cumulative = np.cumsum(np.exp(log_weight - log_weight.max()))
        # systematic resampling
        rows = np.searchsorted(cumulative, (np.arange(1, draws) - rng.random()) * (cumulative[-1] / (draws - 1)))
        return np.asarray(drawn[np.append(0, rows)])


def _levelled(by_torque: Iterable[Array]) -> Array:
    """Return errors of all torques in one array, each without its mean over the readings."""
    return np.concatenate([errors - errors.mean(axis=-1, keepdims=True) for errors in by_torque], axis=-1)


def agreeing_drives(
    drive: Drive,
    records: Mapping[float, RecordedError],
    draws: int,
    run: Run,
) -> tuple[list[dict[str, float]], float]:
    """Find drives that agree with records by torque [N*m].

    The first of the drives agrees best; others that agree better than normal numbers around it would come more often.
    Fits begin at the likeliest of drawn drives: one from the preset's own values may end in a hollow beside the best.
    Angles of the records are the preset's. Fields of fitted_prior are normal numbers, directions shares of their turn;
    comparing/fit says how that differs from its own fit.

    Returns the values of the drives by path, and the most misfit, as a share of the error. Raises UntrustedError if no
    drive agrees.
    """
    record_fit = _RecordFit(
        drive=drive,
        prior=fitted_prior(drive),
        records=records,
        run=run,
    )
    read = record_fit.read
    together = len(read) / (_MISFITS_A_TURN * record_fit.cam_turns)  # readings within which a misfit is the same
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
            f"no drive within the ranges of {drive.name} reproduces the recording: {share:.0f} % of the error remain",
            "record the full mesh cycle, or find the cause with hdassist compare",
        )
    return record_fit.values_of(record_fit.agreeing(fit, terms, draws)), misfit.bound
