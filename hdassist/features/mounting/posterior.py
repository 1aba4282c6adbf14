"""F'_ior measured in holes: values and recordings as entered, and samples of the drive that they reweight.

Values may be measured at several torques. The scale of the model error is the same at all torques. The misfits at
different torques are independent, with the same relative size.

Stiffnesses, clearances and the radial deflection are sampled as in `check`, with weights by the reference data on
stiffness. For each of these samples, a table gives F'_ior of many samples of the deviations (belief/proposals.py), with
the stationary deviations in all directions. Smooth curves over the holes, which no drive produced, are added to the
samples. They dominate the result if no sampled drive agrees with the values.

Given a sample, all distributions are normal: a scale, a smooth misfit and noise relate the drive to the sample
(belief/evidence.py). The values determine the posterior of the sizes of misfit and noise. At most one value is misread.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import isnan

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, softmax

from hdassist.belief.evidence import (
    ACCURACY,
    SCALE,
    SMOOTH_NUMBERS,
    ErrorKind,
    error_kinds,
    errors_of_drive,
    evidence_of,
    kernel,
    log_likelihood_of_errors,
    log_likelihoods,
    smooth_misfits,
)
from hdassist.belief.predicted import MeasuredBeside, measured_beside
from hdassist.belief.prior import DrivePrior, FieldPrior, owner_of, prior_of
from hdassist.belief.proposals import (
    TabledErrors,
    TableEffort,
    any_direction,
    open_deviations,
    tabled_errors,
    turned_errors,
)
from hdassist.belief.samples import EFFECTIVE_SAMPLES, FEWEST_SAMPLES, Samples, SamplingEffort, draw_samples
from hdassist.drive.error.error_map import Mesh, error_maps, searchable
from hdassist.drive.model.deviations import standing_offset
from hdassist.drive.model.geometry import Array
from hdassist.drive.model.rules import position_fault, turn_of
from hdassist.drive.preset.fields import Drive, measures
from hdassist.drive.preset.text import shown
from hdassist.drive.solve.answers import EMPTY, Certificate
from hdassist.features.measuring.full_cycle import with_full_cycle
from hdassist.features.measuring.measure import Reading
from hdassist.features.mounting.decision import Decision
from hdassist.features.mounting.positions import hole_of
from hdassist.readers.trace import LARGEST_ERROR
from hdassist.run.errors import HdassistError, UntrustedError, UsageError
from hdassist.run.files import number_of, with_decimal_points
from hdassist.run.run import Run

_LEAST_NOISE = 1e-3  # arcsec; smallest noise of a value from a recording
TRIAL_HINT = "use h4=17.3 (hole) or 120=17.3 (degrees), F'_ior in arcsec, or h4=run.csv for a recording"


@dataclass(frozen=True)
class Trial:
    """A value of F'_ior, measured with the fixed wheel turned from its initial position.

    rotation_deg: rotation of the fixed wheel [deg].
    F_ior_arcsec: the measured value [arcsec].
    M_g: torque [N*m]; None for the torque of the setup.
    noise_arcsec: standard deviation of the value [arcsec]; None for the noise of the setup.
    file: recording that gives this value; empty if the value itself was entered.
    """

    rotation_deg: float
    F_ior_arcsec: float
    M_g: float | None = field(default=None, kw_only=True)
    noise_arcsec: float | None = field(default=None, kw_only=True)
    file: str = field(
        default="",
        kw_only=True,
        compare=False,
    )


def read_trial(
    text: str,
    holes: int,
    allowed: Sequence[int] | str = "all",
) -> Trial:
    """Parse a trial: 120=17.3 (degrees), h4=17.3 (a hole of the seat) or h4@80=17.3 (with a torque in N*m).

    A decimal comma is accepted, because the Russian card prints 17,3.

    holes: number of holes of the seat; 0 for a free angle.
    allowed: numbers of the usable holes, or "all".

    Raises UsageError for any other text.
    """
    where, _, value = text.lower().partition("=")
    rotation, M_g = _read_trial_position(where, text, holes, allowed)
    F_ior = number_of(with_decimal_points(value))
    if not 0 < F_ior <= LARGEST_ERROR:
        wanted = f"expected F'_ior in arcsec, as in {where}=17.3, or the file of a recording, as in {where}=run.csv"
        raise UsageError(f"invalid trial {shown(text)!r}: {wanted}", TRIAL_HINT)
    return Trial(rotation, F_ior, M_g=M_g)


def _read_trial_position(
    name: str,
    text: str,
    holes: int,
    allowed: Sequence[int] | str = "all",
) -> tuple[float, float | None]:
    """Return the rotation [deg] and torque [N*m] in a trial's text; the torque is None if the text has no @TORQUE.

    name: part of the text before the equals sign.
    text: whole text, for error messages.

    Raises UsageError if the position or the torque is invalid.
    """
    where, separator, torque = name.partition("@")
    M_g = number_of(with_decimal_points(torque)) if separator else None
    if M_g is not None and not _is_torque(M_g):
        raise UsageError(f"invalid trial {shown(text)!r}: expected HOLE@TORQUE=VALUE, with TORQUE in N·m", TRIAL_HINT)
    where = with_decimal_points(where)
    rotation = turn_of(where, holes)
    if rotation != rotation and not (where.startswith("h") and where[1:].isdecimal()):
        raise UsageError(f"invalid trial {shown(text)!r}: expected HOLE=VALUE", TRIAL_HINT)
    if fault := position_fault(where, holes):
        raise UsageError(f"invalid trial {shown(text)!r}: {fault[0]}", fault[1] or TRIAL_HINT)
    hole = hole_of(rotation, holes)
    if hole is not None and allowed != "all" and hole % holes not in allowed:
        raise UsageError(
            f"invalid --verify {shown(text)}: hole {hole % holes} is not in mounting.allowed",
            "state the value as HOLE=F_IOR without --verify; it is used, but the hole is never recommended",
        )
    return (360 * (hole % holes) / holes if hole is not None else rotation % 360), M_g


def read_trial_or_record(
    text: str,
    drive: Drive,
    reading: Reading,
    M_g: float,
    seed: int = 0,
    allowed: Sequence[int] | str = "all",
) -> Trial:
    """Parse a trial with a value (h4=17.3), or with a recording of the error over the full mesh cycle (h4=run.csv).

    The text after the equals sign is a file name if it contains a suffix or folder, or if it is not a number and the
    file exists.

    reading: settings for reading a recording.
    M_g: torque of a recording if the text states none [N*m].
    seed: seed of the bootstrap.

    Raises the errors of read_trial, read_trace and measure, and UntrustedError if a recording does not cover the full
    mesh cycle.
    """
    where, _, file = text.partition("=")
    is_number = not isnan(number_of(with_decimal_points(file)))
    if not (re.search(r"[/\\]|\.[A-Za-z]", file) or (not is_number and os.path.lexists(file))):
        return read_trial(text, drive.mounting.holes, allowed)
    rotation, own_torque = _read_trial_position(where.lower(), text, drive.mounting.holes, allowed)
    record = reading.measured(
        file,
        drive,
        seed=seed,
        M_g=M_g if own_torque is None else own_torque,
    )
    # `measure` prints the same value and uncertainty
    greatest = with_full_cycle(record).directions[0]
    if greatest.is_bound and (covered := greatest.coverage):
        turns = covered.cam_turns
        cycle = covered.cam_turns / covered.share
        raise UntrustedError(
            f"{file} covers {turns:.3g} of the {cycle:g} input revolutions of the full mesh cycle, "
            "so its F'_ior is a lower bound and cannot be used as a trial",
            "record the full mesh cycle in one sweep",
        )
    noise_arcsec = max(greatest.uncertainty_arcsec, _LEAST_NOISE)
    return Trial(
        rotation,
        greatest.F_ior_arcsec,
        M_g=own_torque,
        noise_arcsec=noise_arcsec,
        file=file,
    )


_Places = NDArray[np.int64]
Point = tuple[float, float]  # position of the wheel [deg] and torque [N*m]

_WIDEST_SIZE = 2.0  # largest size of a deviation without an uncertainty, relative to the preset
# standard deviation of the logarithm of the ratio of true to stated noise, which is within a factor of three with a
# probability of 95 %
_NOISE_SPREAD = 0.56
LOG_NOISES = {noise: -0.5 * (np.log(noise) / _NOISE_SPREAD) ** 2 for noise in 2.0 ** (np.arange(-2, 5) / 2)}
_POSTERIOR_DRAWS = 2048
_FAR_LIKELIER = 100.0  # ratio of probabilities above which the values are assigned to another torque
SAMPLES_A_TABLE = 2  # effective sample size per contact system with a table
_DRAWS_A_TABLE = 64  # largest number of draws of contact systems per required table
_COMPARED = 16  # number of drives solved to estimate the error of a table, if there is only one table
_FREE_SHARE = 0.25  # prior probability that the values belong to a smooth curve that no drive of the preset produces
_PHASOR_SHARE = 0.25  # prior probability that the values belong to a curve that is the sum of two phasors
_FREE_CURVES = 1024  # number of curves of each of these two kinds
_FREE_ORDERS = 4  # number of orders of a smooth curve
_FREE_CURVE_ORDERS = np.arange(1, _FREE_ORDERS + 1)
# Possible factors of the waves of a smooth curve, relative to those of the samples. Their logarithms are normal, with
# the medians of order 1 and of the higher orders, from hidden drives (benchmarks.waves).
_WAVE_FACTORS = (0.25, 0.5, 1.0, 2.0)
_WAVE_SPREAD = 0.7  # standard deviation of the logarithm
_FIRST_WAVE = 0.5
_HIGHER_WAVES = 0.7
# indices of constant, cosine and sine of order 1 among the numbers of a smooth curve
_PHASOR_NUMBERS = [0, 1, 1 + _FREE_ORDERS]
# smallest square of a curve of two phasors, relative to the mean square of the values: two opposite phasors still leave
# a hundredth of F'_ior
_LEAST_SQUARE = 1e-4
_FREE_LEVEL = 1.0  # standard deviation of the logarithm of the level of both kinds of curves
# relative standard deviation added to the noise of the values, because curves near very exact values are rarely drawn
_FREE_NEAR = 0.01
_STATED_SHARE = 0.5  # prior probability that the stationary eccentricity is as stated in the preset
_OPEN = 40.0  # deg; standard deviation above which a direction is considered unknown


@dataclass(frozen=True)
class TrialSetup:
    """Conditions of measurements of F'_ior in holes, which apply to values that do not state their own.

    M_g: torque [N*m].
    noise_arcsec: standard deviation of a value, including reinstallation of the wheel.
    others: further torques at which values may be measured [N*m].

    Raises UsageError if the torque or the noise is invalid.
    """

    M_g: float
    noise_arcsec: float = 1.0
    others: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not _is_torque(self.M_g):
            message = f"invalid torque {self.M_g:g} N·m: expected a torque up to 1e7 N·m, other than 0"
            raise UsageError(message, "state the torque at which F'_ior was measured, for example --trial-torque 80")
        if not 1e-6 <= self.noise_arcsec <= 1e6:
            message = f"invalid noise {self.noise_arcsec:g}″: expected 1e-6 to 1e6″"
            raise UsageError(message, "state the standard deviation of a measured F'_ior, for example --noise 1")

    def point(self, trial: Trial) -> Point:
        """Return the position [deg] and torque [N*m] of a value."""
        return trial.rotation_deg, self.M_g if trial.M_g is None else trial.M_g


def in_order(trials: Sequence[Trial], setup: TrialSetup) -> tuple[Trial, ...]:
    """Return measured values sorted by position, torque, value and noise, so that results do not depend on their order.

    setup: torque and noise of values that do not state their own.
    """

    def place(trial: Trial) -> tuple[float, float, float, float]:
        noise_arcsec = setup.noise_arcsec if trial.noise_arcsec is None else trial.noise_arcsec
        return *setup.point(trial), trial.F_ior_arcsec, noise_arcsec

    return tuple(sorted(trials, key=place))


def _is_torque(M_g: float) -> bool:
    """Return whether a torque [N*m] is valid for measurements: not 0 and at most 1e7."""
    return 0 < abs(M_g) <= 1e7


@dataclass(frozen=True, eq=False)
class HoleSamples:
    """Samples of a drive, with F'_ior for stationary deviations turned in equal steps of direction.

    setup: conditions of the measurements; its torque is the reference torque.
    F_ior_by_torque: F'_ior [arcsec] by torque M_g [N*m], shape (samples, directions) each.
    weight: weights with sum 1, shape (samples, directions).
    values: size and direction of the stationary eccentricity by path, shape (samples, directions) each; NaN for curves
        that no drive produced.
    read_error: relative standard deviation of the error of F'_ior from tables.
    seed: seed of the samples.
    few: remark if the effective sample size is smaller than requested; empty if it is not.
    draws: requested effective sample size.
    """

    drive: Drive
    setup: TrialSetup
    F_ior_by_torque: Mapping[float, Array]
    weight: Array
    values: Mapping[str, Array]
    read_error: float
    seed: int = 0
    certificate: Certificate = EMPTY
    few: str = ""
    draws: int = EFFECTIVE_SAMPLES

    @property
    def F_ior_arcsec(self) -> Array:
        """F'_ior at the torque of the setup with the wheel not turned [arcsec], shape (samples, directions)."""
        return self.F_ior_by_torque[self.setup.M_g]

    @cached_property
    def levels(self) -> dict[float, float]:
        """Median ratio of F'_ior to that at the torque of the setup, over samples and directions, by torque [N*m]."""
        return {M_g: float(np.median(F_ior / self.F_ior_arcsec)) for M_g, F_ior in self.F_ior_by_torque.items()}

    @property
    def possible(self) -> _Places:
        """Flat indices of the samples and directions with a positive weight."""
        return np.flatnonzero(self.weight)

    def at(self, points: Sequence[Point], places: _Places) -> Array:
        """Return F'_ior of selected samples at several torques and rotations of the wheel [arcsec].

        The shape is (places, points).

        A rotation of the wheel is equivalent to the opposite rotation of the directions.

        points: rotations [deg] and torques [N*m].
        places: flat indices into samples and directions.
        """
        shown = (turned_errors(self.F_ior_by_torque[M_g], [turn], places) for turn, M_g in points)
        return np.hstack([np.empty((len(places), 0)), *shown])

    def predicted(self, trial: Trial) -> MeasuredBeside:
        """Return a measured value with the range that the preset predicts for it without measured values."""
        rotation_deg, M_g = self.setup.point(trial)
        is_drive = ~np.isnan(self.values[standing_offset(self.drive)[0]].ravel()[self.possible])
        places = self.possible[is_drive]
        return measured_beside(
            trial.F_ior_arcsec,
            float(self.noise([trial])[0]),
            self.at([(rotation_deg, M_g)], places)[:, 0],
            self.weight.ravel()[places],
        )

    def correlation(self, points: Sequence[Point]) -> Array:
        """Return the covariance of the misfit between points, divided by its variance at the torque of the setup.

        The misfits at different torques are independent, with the same relative size. The shape is (points, points).
        """
        turns = [turn for turn, _ in points]
        torques = [M_g for _, M_g in points]
        levels = [self.levels[M_g] for M_g in torques]
        same_torque = np.equal.outer(torques, torques)
        return np.asarray(kernel(turns, turns) * same_torque * np.multiply.outer(levels, levels))

    def mean(self, places: _Places) -> Array:
        """Return the mean F'_ior of samples over all directions [arcsec], shape (places,)."""
        return np.asarray(self.F_ior_arcsec.mean(axis=1)[places // self.weight.shape[1]])

    def noise(self, trials: Sequence[Trial]) -> Array:
        """Return the stated standard deviations of values [arcsec], shape (trials,), from the values or the setup."""
        noise_arcsec = [
            self.setup.noise_arcsec if trial.noise_arcsec is None else trial.noise_arcsec for trial in trials
        ]
        return np.array(noise_arcsec, dtype=float)

    def with_free_curves(self, trials: Sequence[Trial]) -> HoleSamples:
        """Return the samples together with curves over the seat that no drive produced.

        The section "Trials 5" in docs/theory.md derives them. The level of the curves is lognormal with the median of
        the samples. Smooth curves have normally distributed waves of the size of those of the samples times a random
        factor, because another drive may be smoother or rougher. The other curves are the sum of two phasors. The
        curves are sampled near the values, with weights that correct for this.
        """
        smooth_curves, smooth_weights = self._free_curves(trials)
        phasor_curves, phasor_weights = self._phasor_curves(trials)
        curves = np.vstack([smooth_curves, phasor_curves])
        F_ior = {
            M_g: np.vstack([of_samples, self.levels[M_g] * curves]) for M_g, of_samples in self.F_ior_by_torque.items()
        }
        values = {
            path: np.vstack([of_samples, np.full(curves.shape, np.nan)]) for path, of_samples in self.values.items()
        }
        sample_weight = (1 - _FREE_SHARE - _PHASOR_SHARE) * self.weight
        curve_weight = np.zeros(curves.shape)
        # a turned curve would be another curve, so only direction 0 has a weight
        curve_weight[:, 0] = np.concatenate([_FREE_SHARE * smooth_weights, _PHASOR_SHARE * phasor_weights])
        weight = np.vstack([sample_weight, curve_weight])
        return replace(
            self,
            F_ior_by_torque=F_ior,
            weight=weight,
            values=values,
        )

    def _free_curves(self, trials: Sequence[Trial]) -> tuple[Array, Array]:
        """Return smooth curves near the values at the torque of the setup, and their weights.

        The curves have the shape (_FREE_CURVES, directions) [arcsec], and the weights (_FREE_CURVES,).
        """
        log_F = np.log(self.F_ior_arcsec)  # shape (samples, directions)
        sample_share = self.weight.sum(axis=1)
        level = sample_share @ log_F.mean(axis=1)
        directions = log_F.shape[1]
        spectrum = np.fft.rfft(log_F)
        # root mean square of the amplitude of each order over the samples
        amplitudes = np.sqrt(sample_share @ np.square(2 / directions * np.abs(spectrum)))
        # standard deviations of the numbers of a curve: its level, then the cosines and the sines of the orders
        sizes = np.array([_FREE_LEVEL, *np.tile(amplitudes[_FREE_CURVE_ORDERS] / np.sqrt(2), 2)])
        factors, log_factors = _wave_factors()
        kinds = error_kinds(len(trials), LOG_NOISES)
        numbers, density = _numbers_near(
            _trial_harmonics(trials),
            np.log(self._values_at_setup(trials)) - level,
            self._log_covariances(trials, kinds),
            kinds,
            np.random.default_rng([self.seed, 3]),
            sizes=sizes * factors,
            log_sizes=log_factors,
        )
        basis = _seat_harmonics(directions)
        curves = np.exp(level + numbers @ basis.T)
        return curves, density / _FREE_CURVES

    def _phasor_curves(self, trials: Sequence[Trial]) -> tuple[Array, Array]:
        """Return curves of two phasors near the values, and their weights, with the shapes of `_free_curves`.

        One phasor is stationary and the other turns with the wheel. The square of F'_ior is linear in three numbers:

        (2)  F'_ior^2 = level^2 (p + q cos(turn) + r sin(turn)),  q^2 + r^2 < p^2

        sqrt(p) is lognormal, and (q, r) is uniformly distributed in the circle of radius p.
        """
        log_F = np.log(self.F_ior_arcsec)
        level = float(self.weight.sum(axis=1) @ log_F.mean(axis=1))
        squares = np.square(self._values_at_setup(trials) / np.exp(level))
        kinds = error_kinds(len(trials), LOG_NOISES)
        # the numbers p, q, r are sampled from a normal distribution near the values
        size = float(squares.mean()) if trials else 1.0
        middle = np.array([size, 0.0, 0.0])
        basis = _trial_harmonics(trials)[:, _PHASOR_NUMBERS]
        normals, density = _numbers_near(
            size * basis,
            squares - basis @ middle,
            4 * np.multiply.outer(squares, squares) * self._log_covariances(trials, kinds),
            kinds,
            np.random.default_rng([self.seed, 5]),
            sizes=np.ones((1, 3)),
            log_sizes=np.zeros(1),
        )
        numbers = middle + size * normals
        log_drawn = -0.5 * np.square(normals).sum(axis=1) - 3 * np.log(size * np.sqrt(2 * np.pi))
        weights = density * np.exp(_log_phasor_prior(numbers) - log_drawn) / _FREE_CURVES
        seat = _seat_harmonics(log_F.shape[1])[:, _PHASOR_NUMBERS]
        squares_of_curves = np.maximum(numbers @ seat.T, _LEAST_SQUARE * size)
        return np.exp(level) * np.sqrt(squares_of_curves), weights

    def _values_at_setup(self, trials: Sequence[Trial]) -> Array:
        """Return values scaled by the levels from their own torques to that of the setup [arcsec], shape (trials,)."""
        torque_levels = np.array([self.levels[self.setup.point(trial)[1]] for trial in trials])
        values = np.array([trial.F_ior_arcsec for trial in trials])
        return np.asarray(values / torque_levels)

    def _log_covariances(self, trials: Sequence[Trial], kinds: Sequence[ErrorKind]) -> Array:
        """Return the covariances of the logarithms of values for each kind of error, shape (kinds, trials, trials)."""
        points = [self.setup.point(trial) for trial in trials]
        measured = np.array([trial.F_ior_arcsec for trial in trials])
        torque_levels = np.array([self.levels[M_g] for _, M_g in points])
        stated = self.noise(trials)
        correlation = self.correlation(points) / np.multiply.outer(torque_levels, torque_levels)
        covariances = []
        for kind in kinds:
            noise = np.diag((kind.spreads(stated, measured) / measured) ** 2 + _FREE_NEAR**2)
            covariances.append(SCALE**2 + kind.misfit**2 * correlation + noise)
        return np.array(covariances)


def _harmonics(angles: Array) -> Array:
    """Return 1, the cosines and the sines of the orders of smooth curves at angles [rad], shape (angles, numbers)."""
    order_angles = np.multiply.outer(angles, _FREE_CURVE_ORDERS)
    return np.hstack([np.ones((len(angles), 1)), np.cos(order_angles), np.sin(order_angles)])


def _trial_harmonics(trials: Sequence[Trial]) -> Array:
    """Return the harmonics at the positions of values, shape (trials, numbers)."""
    return _harmonics(-np.radians([trial.rotation_deg for trial in trials]))


def _seat_harmonics(directions: int) -> Array:
    """Return the harmonics in equal steps of direction, shape (directions, numbers)."""
    return _harmonics(2 * np.pi * np.arange(directions) / directions)


def _log_phasor_prior(numbers: Array) -> Array:
    """Return the prior log density of p, q and r of equation (2), shape (numbers,).

    The density is that of the logarithm of the level sqrt(p), times its derivative 1/(2 p), over the area pi p^2 of the
    circle. Its logarithm is -inf outside the circle.

    numbers: p, q and r, shape (numbers, 3).
    """
    constant = numbers[:, 0]
    is_inside = np.hypot(numbers[:, 1], numbers[:, 2]) < constant
    log_level = np.log(np.where(is_inside, constant, 1.0)) / 2
    log_density = -0.5 * np.square(log_level / _FREE_LEVEL) - np.log(_FREE_LEVEL * np.sqrt(2 * np.pi))
    return np.where(is_inside, log_density - 6 * log_level - np.log(2 * np.pi), -np.inf)


def _wave_factors() -> tuple[Array, Array]:
    """Return the factors of the numbers of a smooth curve for each pair of sizes, and their prior log probabilities.

    The factors have the shape (pairs, numbers), and the log probabilities (pairs,). The level has the factor 1, and the
    waves of order 2 and higher have a common factor.
    """
    factors = []
    log_factors = []
    for first, log_first in _log_factors(_FIRST_WAVE).items():
        for higher, log_higher in _log_factors(_HIGHER_WAVES).items():
            by_order = np.where(_FREE_CURVE_ORDERS == 1, first, higher)
            factors.append([1.0, *by_order, *by_order])
            log_factors.append(log_first + log_higher)
    return np.array(factors), np.array(log_factors)


def _log_factors(median: float) -> dict[float, float]:
    """Return the log probability of each of the _WAVE_FACTORS, whose logarithms are normal.

    median: median of the factors.
    """
    log_shares = -0.5 * np.square(np.log(np.array(_WAVE_FACTORS) / median) / _WAVE_SPREAD)
    return dict(zip(_WAVE_FACTORS, (log_shares - logsumexp(log_shares)).tolist(), strict=True))


def _numbers_near(
    basis: Array,
    y: Array,
    covariances: Array,
    kinds: Sequence[ErrorKind],
    rng: np.random.Generator,
    *,
    sizes: Array,
    log_sizes: Array,
) -> tuple[Array, Array]:
    """Return draws of normal numbers given values y = basis @ numbers + error, and their weights.

    The draws have the shape (_FREE_CURVES, numbers). The weights are inversely proportional to the likelihood, so the
    weighted draws have the prior distribution, a mixture of normal distributions of several sizes.

    basis: derivative of the values by the numbers, shape (values, numbers).
    y: the values, shape (values,).
    covariances: covariance of the error for each kind, shape (kinds, values, values).
    kinds: possible kinds of error.
    rng: source of random numbers.
    sizes: possible standard deviations of the numbers, shape (sizes, numbers).
    log_sizes: prior log probability of each of them, shape (sizes,).
    """
    log_shares = np.array([kind.log_share for kind in kinds])
    scaled_basis = basis * sizes[:, None, :]  # shape (sizes, values, numbers)
    to_numbers = np.swapaxes(scaled_basis, 1, 2)
    total = (scaled_basis @ to_numbers)[:, None] + covariances  # shape (sizes, kinds, values, values)
    log = log_sizes[:, None] + log_shares + _log_normal(y, total)
    size, kind = np.divmod(rng.choice(log.size, _FREE_CURVES, p=softmax(log.ravel())), len(kinds))
    normals, error = (rng.standard_normal((_FREE_CURVES, n, 1)) for n in basis.T.shape)
    off = y[:, None] - scaled_basis[size] @ normals - np.linalg.cholesky(covariances)[kind] @ error
    normals = normals + to_numbers[size] @ np.linalg.solve(total[size, kind], off)  # Matheron's rule
    numbers = sizes[size] * normals[..., 0]
    log_likelihood = logsumexp(log_shares + _log_normal((y - numbers @ basis.T)[:, None], covariances), axis=1)
    return numbers, np.exp(logsumexp(log) - log_likelihood)


def _log_normal(residuals: Array, covariances: Array) -> Array:
    """Return the log density of normal residuals without its constant, shape (...).

    residuals: residuals, shape (..., values).
    covariances: covariances, shape (..., values, values).
    """
    squares = np.einsum("...i,...ij,...j", residuals, np.linalg.inv(covariances), residuals)
    return np.asarray(-0.5 * (squares + np.linalg.slogdet(covariances)[1]))


@dataclass(frozen=True, eq=False)
class HolePosterior:
    """Equally weighted posterior draws of F'_ior in positions of the wheel, given the measured values.

    samples: prior samples from which the draws were selected.
    places: flat index of each draw into (samples, directions).
    misfit: standard deviation of the misfit as a share of the mean F'_ior, shape (draws,).
    noise: ratio of true to stated noise, shape (draws,).
    scale: ratio of true to computed F'_ior, shape (draws,).
    rotations_deg: rotations at which F'_ior is given [deg].
    F_ior_by_torque: F'_ior [arcsec] by torque M_g [N*m], shape (draws, rotations) each.
    effective: effective sample size.
    misread: probability that each value is misread, shape (trials,).
    """

    samples: HoleSamples
    places: _Places
    misfit: Array
    noise: Array
    scale: Array
    rotations_deg: tuple[float, ...]
    F_ior_by_torque: Mapping[float, Array]
    effective: float
    misread: Array

    @property
    def F_ior_arcsec(self) -> Array:
        """F'_ior at the torque of the setup [arcsec], shape (draws, rotations)."""
        return self.F_ior_by_torque[self.samples.setup.M_g]

    @cached_property
    def offset(self) -> tuple[Array, Array]:
        """Size [um] and direction [deg] of the stationary eccentricity in all draws that belong to a sampled drive."""
        size, direction = (self.samples.values[p].ravel()[self.places] for p in standing_offset(self.samples.drive))
        return size[~np.isnan(size)], direction[~np.isnan(size)]

    @property
    def by_values(self) -> float:
        """Probability that no drive of the preset produced the values, so that only the values determine the result."""
        return 1 - len(self.offset[0]) / len(self.places)

    @property
    def facing(self) -> tuple[float, float] | tuple[None, None]:
        """Direction of the stationary eccentricity and its standard deviation [deg]; both None if it is unknown."""
        mean = np.exp(1j * np.radians(self.offset[1])).mean() if len(self.offset[1]) else 0j
        length = min(float(abs(mean)), 1.0)  # rounding may give more than 1 for equal directions
        if not length or (spread := float(np.degrees(np.sqrt(-2 * np.log(length))))) > _OPEN:
            return None, None
        return float(np.degrees(np.angle(mean)) % 360), spread

    def decision(
        self,
        torques: Sequence[float],
        room_arcsec: Sequence[float | None],
        cost: float,
    ) -> Decision:
        """Return the decision among all rotations except the last one, which is the present position.

        torques: torques of the decision [N*m].
        room_arcsec: limit minus self error at each torque [arcsec]; None without a limit.
        cost: smallest relative reduction of F'_ior for which the wheel is moved.
        """
        F_ior_arcsec = np.array([self.F_ior_by_torque[M_g] for M_g in torques])
        ones = np.ones(len(self.places))
        holes = F_ior_arcsec[..., :-1]
        now_arcsec = F_ior_arcsec[..., -1]
        return Decision(
            rotations_deg=self.rotations_deg[:-1],
            F_ior_arcsec=holes,
            now_arcsec=now_arcsec,
            sample_weights=ones,
            room_arcsec=room_arcsec,
            cost=cost,
            worth=self.effective,
        )


@dataclass(frozen=True, eq=False)
class _ErrorDraws:
    """Pairs of a kind of error and a sample, drawn by their posterior probability given the values."""

    kind: NDArray[np.int64]  # index of the kind of each draw, shape (draws,)
    places: NDArray[np.int64]  # flat index of the sample and direction of each draw, shape (draws,)
    kind_weight: Array  # probability of each kind, shape (kinds,)
    effective: float  # effective sample size


def posterior_of(
    samples: HoleSamples,
    trials: Sequence[Trial],
    rotations_deg: Sequence[float],
    kinds: Sequence[ErrorKind] = (),
) -> HolePosterior:
    """Return posterior draws of F'_ior in positions, given any number of measured values.

    The section "Trials 4" in docs/theory.md derives them. A kind of error and a sample are drawn jointly by their
    posterior probability. Given both, F'_ior is drawn by equation (1) of belief/evidence.py, at all torques of the
    samples.

    Args:
        samples: samples of the drive.
        trials: measured values.
        rotations_deg: positions [deg].
        kinds: possible kinds of error; if empty, all kinds with the noise levels LOG_NOISES.
    """
    torques = tuple(samples.F_ior_by_torque)
    points = [samples.setup.point(trial) for trial in trials]
    measured = np.array([trial.F_ior_arcsec for trial in trials])
    stated = samples.noise(trials)
    kinds = kinds or error_kinds(len(trials), LOG_NOISES)
    drawn = _drawn_errors(samples, points, measured, stated, kinds)
    misfit = np.array([error_kind.misfit for error_kind in kinds])[drawn.kind]  # shape (draws,)
    noise = np.array([error_kind.noise for error_kind in kinds])[drawn.kind]  # shape (draws,)
    # shape (draws, trials)
    spread = np.array([error_kind.spreads(stated, measured) for error_kind in kinds])[drawn.kind]
    variance = (misfit**2 + samples.read_error**2) * samples.mean(drawn.places) ** 2
    hole_points = [(turn, M_g) for M_g in torques for turn in rotations_deg]
    all_points = [*hole_points, *points]
    normals = _posterior_normals(samples, all_points, spread.shape)
    F_ior, scale = errors_of_drive(
        samples.at(all_points, drawn.places), measured, variance, spread, samples.correlation(all_points), normals
    )
    misread_trial = np.array([error_kind.misread for error_kind in kinds])
    return HolePosterior(
        samples=samples,
        places=drawn.places,
        misfit=misfit,
        noise=noise,
        scale=scale,
        rotations_deg=tuple(rotations_deg),
        F_ior_by_torque=dict(
            zip(
                torques,
                np.split(F_ior, len(torques), axis=1),
                strict=True,
            )
        ),
        effective=drawn.effective,
        misread=np.array([drawn.kind_weight[misread_trial == k].sum() for k in range(len(trials))]),
    )


def _drawn_errors(
    samples: HoleSamples,
    points: Sequence[Point],
    measured: Array,
    stated: Array,
    kinds: Sequence[ErrorKind],
) -> _ErrorDraws:
    """Draw _POSTERIOR_DRAWS pairs of a kind of error and a sample, at equal steps of their cumulative probability.

    Args:
        samples: samples of the drive.
        points: rotation [deg] and torque [N*m] of each value.
        measured: values [arcsec], shape (trials,).
        stated: standard deviation of their noise [arcsec], shape (trials,).
        kinds: possible kinds of error.
    """
    possible = samples.possible
    log_likelihood = log_likelihoods(
        kinds,
        samples.at(points, possible),
        measured,
        stated,
        samples.correlation(points),
        samples.mean(possible),
        samples.read_error,
    )
    weight = softmax(np.log(samples.weight.ravel()[possible]) + log_likelihood)  # shape (kinds, places)
    quantiles = (np.arange(_POSTERIOR_DRAWS) + 0.5) / _POSTERIOR_DRAWS
    cell = np.minimum(np.searchsorted(np.cumsum(weight), quantiles), weight.size - 1)
    kind, row = np.divmod(cell, weight.shape[1])
    return _ErrorDraws(
        kind=kind,
        places=possible[row],
        kind_weight=weight.sum(axis=1),
        effective=float(1 / np.square(weight.sum(axis=0)).sum()),
    )


def _posterior_normals(
    samples: HoleSamples,
    points: Sequence[Point],
    spread_shape: tuple[int, ...],
) -> tuple[Array, Array, Array]:
    """Draw normal numbers for the scale, for the misfit at points, and for the errors of the values.

    The random numbers of the first torque do not depend on further torques.

    Args:
        samples: samples with the torques and the seed.
        points: rotations [deg] and torques [N*m].
        spread_shape: (draws, trials).
    """
    rng = np.random.default_rng(samples.seed)
    other_rng = np.random.default_rng([samples.seed, 1])
    draws, _ = spread_shape
    size = (draws, SMOOTH_NUMBERS)
    normals = {}
    for k, M_g in enumerate(samples.F_ior_by_torque):
        normals[M_g] = (other_rng if k else rng).standard_normal(size)
    misfits = [samples.levels[M_g] * smooth_misfits([turn], normals[M_g]) for turn, M_g in points]
    of_scale = rng.standard_normal(draws)
    of_errors = rng.standard_normal(spread_shape)
    return of_scale, np.hstack(misfits), of_errors


def likelier_torque(samples: HoleSamples, trials: Sequence[Trial]) -> float | None:
    """Return the torque of the samples [N*m] at which the values are far more probable than at their stated torque.

    The result is None if there is no such torque, or if the values were measured at different torques.
    """
    tried = [t.rotation_deg for t in trials]
    possible = samples.possible
    measured = np.array([t.F_ior_arcsec for t in trials]), samples.noise(trials), kernel(tried, tried)
    weight = samples.weight.ravel()[possible]
    stated, *other_points = {samples.setup.point(t)[1] for t in trials}
    log_probability = {
        M_g: logsumexp(
            log_likelihood_of_errors(
                samples.at([(turn, M_g) for turn in tried], possible), *measured, samples.read_error
            ),
            b=weight,
        )
        for M_g in samples.F_ior_by_torque
    }
    likeliest = max(log_probability, key=log_probability.__getitem__)
    is_far = log_probability[likeliest] > log_probability[stated] + np.log(_FAR_LIKELIER)
    return likeliest if is_far and not other_points else None


def hole_samples(
    drive: Drive,
    torques: Sequence[float],
    setup: TrialSetup,
    *,
    draws: int = EFFECTIVE_SAMPLES,
    table: TableEffort = TableEffort(),
    run: Run = Run(),
) -> HoleSamples:
    """Draw samples of the uncertain inputs of a drive, including its stationary eccentricity.

    The preset's reference data weight the samples.

    Args:
        drive: the drive.
        torques: torques in addition to those of the setup [N*m].
        setup: conditions of the measurements.
        draws: requested effective sample size, which determines the number of contact systems.
        table: effort for the table of each contact system.
        run: processes, progress and seed.

    Raises UsageError for a drive with rolling balls or without a known size of the eccentricity, and UntrustedError if
    too few draws are valid drives that agree with the reference data.
    """
    if not searchable(drive):
        raise UsageError("measured values require bearing.ball_motion: locked", "use --set bearing.ball_motion=locked")
    prior = open_prior(drive)
    stated_prior = prior_of(drive)
    believed = stated_prior if len(stated_prior.fields) < len(prior.fields) else None
    deviations = open_deviations(prior)
    systems = replace(prior, fields=tuple(field for field in prior.fields if field not in deviations))
    count = max(1, draws // SAMPLES_A_TABLE)
    if not systems.fields:  # only deviations are unknown, so one table with more deviations gives all samples
        table = TableEffort(count * table.deviations, Mesh(), min(_COMPARED, count))
        count = 1
    other_torques = {*setup.others, *torques} - {setup.M_g}
    all_torques = (setup.M_g, *sorted(other_torques))  # the random numbers of a torque depend on its index
    samples = _system_samples(drive, systems, count, run)
    solve = partial(_tabled, prior, believed, all_torques, table, run.seed)
    weights, tables = _solved_tables(samples, solve, run)
    log_missed = np.concatenate([errors.log_missed for errors in tables], axis=1)  # shape (torques, compared)
    F_ior = np.concatenate([errors.F_ior_arcsec for errors in tables], axis=1)  # shape (torques, samples, directions)
    weight = _sample_weights(drive, prior, believed is not None, weights, tables, F_ior)
    F_ior *= np.exp(log_missed.mean(axis=1))[:, None, None]  # correct the tables for their mean error
    offset_fields = standing_offset(drive)
    return HoleSamples(
        drive=drive,
        setup=setup,
        F_ior_by_torque=dict(zip(all_torques, F_ior, strict=True)),
        weight=weight / weight.sum(),
        values={path: np.concatenate([errors.values[path] for errors in tables]) for path in offset_fields},
        read_error=float(log_missed.std(axis=1).max()),
        seed=samples.seed,
        certificate=sum((errors.certificate for errors in tables), samples.certificate),
        few=samples.few,
        draws=draws,
    )


def _system_samples(
    drive: Drive,
    systems: DrivePrior,
    count: int,
    run: Run,
) -> Samples:
    """Draw samples of all uncertain fields except deviations, each of which determines a contact system.

    Args:
        drive: drive whose reference data weight the samples.
        systems: prior of the fields.
        count: effective sample size.
        run: processes, progress and seed.
    """
    return draw_samples(
        systems,
        (),
        evidence=tuple(evidence for evidence in evidence_of(drive) if not evidence.M_g),
        effort=SamplingEffort(
            effective=count,
            settling_draws=count,
            most_draws=_DRAWS_A_TABLE * count,
            batch=min(16, count),
            least=min(FEWEST_SAMPLES, count),
            for_action=True,
        ),
        run=run,
    )


def _solved_tables(
    samples: Samples,
    solve: Callable[[int, Mapping[str, float]], TabledErrors | None],
    run: Run,
) -> tuple[list[float], list[TabledErrors]]:
    """Return the weights and the tables of errors of all contact systems that have a result.

    Args:
        samples: samples of the systems.
        solve: function that returns the errors of a system from its index and values; None if it has no result.
        run: processes and progress.

    Raises UntrustedError if no system has a result.
    """
    weights: list[float] = []
    tables: list[TabledErrors] = []
    solved_tables = run.map(solve, range(len(samples.weights)), samples.values())
    for weight, errors in zip(samples.weights.tolist(), solved_tables, strict=True):
        if errors:
            weights.append(weight)
            tables.append(errors)
            run.solved(errors.certificate.states)
    if not tables:
        raise UntrustedError(
            "no sampled drive has a result at the torque of the measured values", "find the reason with hdassist check"
        )
    return weights, tables


def _sample_weights(
    drive: Drive,
    prior: DrivePrior,
    has_believed: bool,
    table_weights: Sequence[float],
    tables: Sequence[TabledErrors],
    F_ior: Array,
) -> Array:
    """Return the weights of samples and directions without normalization, shape (samples, directions).

    Args:
        drive: drive whose catalogue accuracy weights the samples.
        prior: prior of the drive with an open stationary eccentricity.
        has_believed: whether some samples of a table have the eccentricity stated in the preset.
        table_weights: weight of each table.
        tables: errors of each table.
        F_ior: F'_ior of the samples [arcsec], shape (torques, samples, directions).
    """
    draws_each = tables[0].F_ior_arcsec.shape[1]
    opened = len(tables[0].shares)
    weight = np.repeat(table_weights, draws_each)[:, None] * np.ones(F_ior.shape[1:])
    is_as_stated = np.tile(np.arange(draws_each) >= opened, len(tables))
    # samples with a known direction of the eccentricity count in that direction only
    weight[is_as_stated if any_direction(prior) else slice(None), 1:] = 0
    if has_believed:
        for is_part, share in ((is_as_stated, _STATED_SHARE), (~is_as_stated, 1 - _STATED_SHARE)):
            weight[is_part] *= share / weight[is_part].sum()
    for evidence in evidence_of(drive):
        # the accuracy applies without load, where F'_ior is largest, so it also limits F'_ior at the torque of trials
        if evidence.figure == ACCURACY:
            tested = F_ior[0]
            if evidence.positions:
                tested = np.concatenate([errors.tested_arcsec for errors in tables])
            weight *= np.exp(evidence.log_likelihood(tested))
    return weight


def _tabled(
    prior: DrivePrior,
    believed: DrivePrior | None,
    torques: tuple[float, ...],
    effort: TableEffort,
    seed: int,
    number: int,
    values: Mapping[str, float],
) -> TabledErrors | None:
    """Return F'_ior of a contact system with many samples of the deviations; None if a state has no valid result.

    prior: prior of all fields, with an open stationary eccentricity.
    believed: prior with the eccentricity stated in the preset; None if it is the same.
    torques: torques [N*m].
    effort: effort for the table.
    seed: seed of the samples.
    number: index of the system.
    values: values of the fields of the system, by path.
    """
    try:
        return tabled_errors(
            error_maps(prior.drive.with_values(values), torques), prior, effort, [seed, number], believed
        )
    except HdassistError:
        return None


def open_prior(drive: Drive) -> DrivePrior:
    """Return the prior of a drive as in `check`, but with an open stationary eccentricity.

    The eccentricity has any size up to _WIDEST_SIZE times that of the preset and any direction, unless `check` already
    samples it. The same applies to the rotating eccentricity. Raises UsageError if the size of the stationary
    eccentricity is neither stated nor sampled.
    """
    belief = prior_of(drive)
    size, direction = standing_offset(drive)
    size_path = "tolerances.e_hh"
    priors = {field.path: field for field in belief.fields}
    if size not in priors and not drive.number(size) > 0:
        raise UsageError(
            f"measured values require {size}, the size of the wave generator eccentricity",
            f"state the size, for example --set {size}=80; sizes up to {_WIDEST_SIZE:g} times 80 um are then sampled",
        )
    pairs = [(size, direction)]
    if drive.number(size_path) or any(path not in (size, direction) for path in drive.uncertainty):
        pairs.append((size_path, "phases.phi_hh"))
    for group, turn in pairs:
        reason = f"unknown during trials: up to {_WIDEST_SIZE:g} times the value of the preset"
        if group not in priors:
            widest_size = _WIDEST_SIZE * drive.number(group)
            priors[group] = FieldPrior(
                path=group,
                distribution="even",
                low=0.0,
                high=widest_size,
                owner=owner_of(drive, group),
                group=group,
                reason=reason,
            )
        if turn not in priors:
            priors[turn] = FieldPrior(
                path=turn,
                distribution="even",
                low=0.0,
                high=360.0,
                owner=owner_of(drive, turn),
                group=group,
                reason="any direction",
            )
    fields = tuple(priors[path] for path in measures() if path in priors and priors[path].low < priors[path].high)
    return replace(belief, fields=fields)
