"""F'_ior measured in holes: values and records as given, and samples of the belief in tables, reweighed by them.

Values may be of several torques: the scale is the same at all of them, the misfit another one, as large a share.

Stiffnesses, clearances and the wave are drawn as `check` draws them, by the evidence of stiffness; with each draw of
these F'_ior of many draws of the deviations is read off a table (belief/proposals.py), in all directions that stand.
Smooth curves over the holes that no drive made stand beside them: where no drive shows the values, these decide.

Given a sample all is normal: the drive shows it with a scale, a smooth misfit and noise about the stated one
(belief/evidence.py), misfit and noise both weighed by the values. Any one value may be misread.
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
from hdassist.error.error_map import Mesh, error_maps, searchable
from hdassist.errors import HdassistError, UntrustedError, UsageError
from hdassist.files import number_of, with_decimal_points
from hdassist.measuring.full_cycle import with_full_cycle
from hdassist.measuring.measure import Reading
from hdassist.model.deviations import standing_offset
from hdassist.model.geometry import Array
from hdassist.model.rules import position_fault, turn_of
from hdassist.mounting.decision import Decision
from hdassist.mounting.positions import hole_of
from hdassist.preset.fields import Drive, measures
from hdassist.preset.text import shown
from hdassist.readers.trace import LARGEST_ERROR
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate

_LEAST_NOISE = 1e-3  # arcsec
TRIAL_HINT = "use h4=17.3 (hole) or 120=17.3 (degrees), F'_ior in arcsec, or h4=run.csv for a recording"


@dataclass(frozen=True)
class Trial:
    """F'_ior measured [arcsec] with the fixed wheel turned by rotation_deg from where it stood at 0.

    M_g: torque [N*m]; None: that of the setup.
    noise_arcsec: standard deviation of this value; None: that of the setup.
    file: the recording that has this value; empty if the value itself was given.
    """

    rotation_deg: float
    F_ior_arcsec: float
    M_g: float | None = field(default=None, kw_only=True)
    noise_arcsec: float | None = field(default=None, kw_only=True)
    file: str = field(default="", kw_only=True, compare=False)


def read_trial(text: str, holes: int, allowed: Sequence[int] | str = "all") -> Trial:
    """Read 120=17.3 (degrees), h4=17.3 (holes of the seat, of which some are allowed) or h4@80=17.3 (N*m).

    A decimal comma is a decimal point, as in all values of the command line: the Russian card prints 17,3.
    Raises UsageError for all else.
    """
    where, _, value = text.lower().partition("=")
    rotation, M_g = _read_trial_position(where, text, holes, allowed)
    F_ior = number_of(with_decimal_points(value))
    if not 0 < F_ior <= LARGEST_ERROR:
        wanted = f"expected F'_ior in arcsec, as in {where}=17.3, or the file of a recording, as in {where}=run.csv"
        raise UsageError(f"invalid trial {shown(text)!r}: {wanted}", TRIAL_HINT)
    return Trial(rotation, F_ior, M_g=M_g)


def _read_trial_position(
    name: str, text: str, holes: int, allowed: Sequence[int] | str = "all"
) -> tuple[float, float | None]:
    """Turn [deg] and torque [N*m] of the position in a trial's text: degrees or a hole of the seat, and @80 or none.

    Raises UsageError for all else.
    """
    where, separator, torque = name.partition("@")
    M_g = number_of(with_decimal_points(torque)) if separator else None
    if M_g is not None and not _is_torque(M_g):
        raise UsageError(f"invalid trial {shown(text)!r}: expected HOLE@TORQUE=VALUE, N·m", TRIAL_HINT)
    where = with_decimal_points(where)
    rotation = turn_of(where, holes)
    if rotation != rotation and not (where.startswith("h") and where[1:].isdecimal()):
        raise UsageError(f"invalid trial {shown(text)!r}: expected HOLE=VALUE", TRIAL_HINT)
    if fault := position_fault(where, holes):
        raise UsageError(f"invalid trial {shown(text)!r}: {fault[0]}", fault[1] or TRIAL_HINT)
    hole = hole_of(rotation, holes)
    if hole is not None and allowed != "all" and hole % holes not in allowed:
        raise UsageError(
            f"hole {hole % holes} of trial {text!r} is not in mounting.allowed",
            "add it as a further trial; it is never recommended",
        )
    return (360 * (hole % holes) / holes if hole is not None else rotation % 360), M_g


def read_trial_or_record(
    text: str, drive: Drive, reading: Reading, M_g: float, seed: int = 0, allowed: Sequence[int] | str = "all"
) -> Trial:
    """Read h4=17.3 as read_trial does, or h4=run.csv, a record of the drive's error over its full cycle.

    A record's file has a suffix or a folder in its name, or is there and its name no number. reading: of the record;
    M_g, torque [N*m] where the text has none; seed of the bootstrap. Raises those of read_trial, read_trace and
    measure; UntrustedError for a record of less than the cycle.
    """
    where, _, file = text.partition("=")
    is_number = not isnan(number_of(with_decimal_points(file)))
    if not (re.search(r"[/\\]|\.[A-Za-z]", file) or (not is_number and os.path.lexists(file))):
        return read_trial(text, drive.mounting.holes, allowed)
    rotation, own_torque = _read_trial_position(where.lower(), text, drive.mounting.holes, allowed)
    record = reading.measured(file, drive, seed=seed, M_g=M_g if own_torque is None else own_torque)
    greatest = with_full_cycle(record).directions[0]  # the value and the uncertainty that measure states
    if greatest.is_bound and (covered := greatest.coverage):
        turns = covered.cam_turns
        cycle = covered.cam_turns / covered.share
        raise UntrustedError(
            f"{file}: {turns:.3g} of the {cycle:g} input revolutions of the full mesh cycle, "
            "so F'_ior is a lower bound and cannot be a trial",
            "record the full mesh cycle in one sweep",
        )
    noise_arcsec = max(greatest.uncertainty_arcsec, _LEAST_NOISE)
    return Trial(rotation, greatest.F_ior_arcsec, M_g=own_torque, noise_arcsec=noise_arcsec, file=file)


_Places = NDArray[np.int64]
Point = tuple[float, float]  # a position of the wheel [deg] and a torque [N*m]

_WIDEST_SIZE = 2.0  # a size without an uncertainty may be so many times the preset's
_NOISE_SPREAD = 0.56  # of the logarithm of the noise over the stated one: within a third and three times with 95 %
LOG_NOISES = {noise: -0.5 * (np.log(noise) / _NOISE_SPREAD) ** 2 for noise in 2.0 ** (np.arange(-2, 5) / 2)}
_POSTERIOR_DRAWS = 2048
_FAR_LIKELIER = 100.0  # times as probable: a torque is taken for that at which values were measured
SAMPLES_A_TABLE = 2  # effective samples of a belief for which one system has a table
_DRAWS_A_TABLE = 64  # draws of systems at most for each table that is wanted
_COMPARED = 16  # drives with a table of one system, to see its error
_FREE_SHARE = 0.25  # probability before any value that they are a smooth curve which no drive of the preset shows
_PHASOR_SHARE = 0.25  # that they are the sum of two phasors
# curves of each of the two families, and times that waves of smooth ones go around the seat
_FREE_CURVES = 1024
_FREE_ORDERS = 4
_FREE_CURVE_ORDERS = np.arange(1, _FREE_ORDERS + 1)
_PHASOR_NUMBERS = [0, 1, 1 + _FREE_ORDERS]  # of the numbers of a smooth curve: constant, cosine and sine of order 1
_LEAST_SQUARE = 1e-4  # of the mean square of values: F'_ior of two phasors that cancel is no less than a hundredth
_FREE_LEVEL = 1.0  # standard deviation of the logarithm of their level
_FREE_NEAR = 0.01  # of a value: within that of it they are drawn as densely, however little noise is stated
_STATED_SHARE = 0.5  # probability before any value that the standing offset is as the preset states it
_OPEN = 40.0  # deg: a direction whose standard deviation is more is not known


@dataclass(frozen=True)
class TrialSetup:
    """How F'_ior is measured in holes, unless a value has its own: at a torque [N*m], with noise [arcsec].

    That is the standard deviation of a value, that of mounting the wheel again included; others, further torques at
    which values may be measured. Raises UsageError unless the torque turns something and the noise is one.
    """

    M_g: float
    noise_arcsec: float = 1.0
    others: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not (_is_torque(self.M_g) and 1e-6 <= self.noise_arcsec <= 1e6):
            stated = f"{self.M_g:g} N·m, noise {self.noise_arcsec:g}″"
            wanted = "expected a torque up to 1e7 N*m other than 0, and a noise above 0"
            raise UsageError(
                f"invalid trials: {stated}: {wanted}", "state the torque of the values, for example --trial-torque 80"
            )

    def point(self, trial: Trial) -> Point:
        """Position [deg] and torque [N*m] of a value."""
        return trial.rotation_deg, self.M_g if trial.M_g is None else trial.M_g


def in_order(trials: Sequence[Trial], setup: TrialSetup) -> tuple[Trial, ...]:
    """Return measured values by position, torque, value and noise: sums and random numbers follow their order."""

    def place(trial: Trial) -> tuple[float, float, float, float]:
        noise_arcsec = setup.noise_arcsec if trial.noise_arcsec is None else trial.noise_arcsec
        return *setup.point(trial), trial.F_ior_arcsec, noise_arcsec

    return tuple(sorted(trials, key=place))


def _is_torque(M_g: float) -> bool:
    """Whether F'_ior can be measured at a torque [N*m]: beyond that, squares are no numbers."""
    return 0 < abs(M_g) <= 1e7


@dataclass(frozen=True, eq=False)
class HoleSamples:
    """Samples of a drive, and F'_ior [arcsec] with what stands turned in steps.

    F_ior_by_torque [arcsec] by M_g [N*m], and weight, which sums to 1, of shape (samples, directions) each;
    read_error, relative standard deviation of it; values of the offset that stands with the wheel by field,
    shape (samples, directions), NaN of curves that no drive made; seed; few: how many systems agree with the preset's
    evidence, in words, where they are fewer than wanted; draws: effective sample size that was asked for.
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
        """F'_ior [arcsec] at the torque of the setup with the wheel at 0, shape (samples, directions)."""
        return self.F_ior_by_torque[self.setup.M_g]

    @cached_property
    def levels(self) -> dict[float, float]:
        """F'_ior over that at the torque of the setup, median of all samples and directions, by M_g [N*m]."""
        return {M_g: float(np.median(F_ior / self.F_ior_arcsec)) for M_g, F_ior in self.F_ior_by_torque.items()}

    @property
    def possible(self) -> _Places:
        """Flat places among samples and directions that weigh anything."""
        return np.flatnonzero(self.weight)

    def at(self, points: Sequence[Point], places: _Places) -> Array:
        """F'_ior [arcsec] with the wheel turned at torques, shape (places, points): that of directions less by as much.

        Argument: flat places among samples and directions.
        """
        shown = (turned_errors(self.F_ior_by_torque[M_g], [turn], places) for turn, M_g in points)
        return np.hstack([np.empty((len(places), 0)), *shown])

    def predicted(self, trial: Trial) -> MeasuredBeside:
        """Return a measured value beside the range that the preset predicts there without measured values."""
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
        """Covariance of the misfit between points over its variance at the torque of the setup, shape (points, points).

        At another torque it is another one, as large a share of F'_ior.
        """
        turns = [turn for turn, _ in points]
        torques = [M_g for _, M_g in points]
        levels = [self.levels[M_g] for M_g in torques]
        same_torque = np.equal.outer(torques, torques)
        return np.asarray(kernel(turns, turns) * same_torque * np.multiply.outer(levels, levels))

    def mean(self, places: _Places) -> Array:
        """Mean F'_ior of samples over all directions [arcsec], shape (places,)."""
        return np.asarray(self.F_ior_arcsec.mean(axis=1)[places // self.weight.shape[1]])

    def noise(self, trials: Sequence[Trial]) -> Array:
        """Standard deviations of measured values as stated [arcsec], shape (trials,): their own, or that of all."""
        noise_arcsec = [
            self.setup.noise_arcsec if trial.noise_arcsec is None else trial.noise_arcsec for trial in trials
        ]
        return np.array(noise_arcsec, dtype=float)

    def with_free_curves(self, trials: Sequence[Trial]) -> HoleSamples:
        """Return the samples with curves over the seat that no drive made: Trials 5 in docs/theory.md.

        Their level is lognormal about that of the samples. Smooth curves have normal waves, as large as those of the
        samples: another drive is as smooth. Others are the sum of two phasors. The curves are drawn near the values,
        and weighted for that.
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
        # a turned curve is another curve
        curve_weight[:, 0] = np.concatenate([_FREE_SHARE * smooth_weights, _PHASOR_SHARE * phasor_weights])
        weight = np.vstack([sample_weight, curve_weight])
        return replace(self, F_ior_by_torque=F_ior, weight=weight, values=values)

    def _free_curves(self, trials: Sequence[Trial]) -> tuple[Array, Array]:
        """Return curves near the values, at the torque of the setup, and their weights, shape (_FREE_CURVES,).

        The curves have shape (_FREE_CURVES, directions) [arcsec].
        """
        log_F = np.log(self.F_ior_arcsec)  # (samples, directions)
        sample_share = self.weight.sum(axis=1)
        level = sample_share @ log_F.mean(axis=1)
        directions = log_F.shape[1]
        spectrum = np.fft.rfft(log_F)
        # root mean square of the amplitude of each order over the samples
        amplitudes = np.sqrt(sample_share @ np.square(2 / directions * np.abs(spectrum)))
        # standard deviations of the numbers: level, cosine and sine of each order
        sizes = np.array([_FREE_LEVEL, *np.tile(amplitudes[_FREE_CURVE_ORDERS] / np.sqrt(2), 2)])
        kinds = error_kinds(len(trials), LOG_NOISES)
        numbers, density = _numbers_near(
            sizes * _harmonics(-np.radians([trial.rotation_deg for trial in trials])),
            np.log(self._values_at_setup(trials)) - level,
            self._log_covariances(trials, kinds),
            kinds,
            np.random.default_rng([self.seed, 3]),
        )
        basis = sizes * _harmonics(2 * np.pi * np.arange(directions) / directions)  # (directions, numbers)
        curves = np.exp(level + numbers @ basis.T)
        return curves, density / _FREE_CURVES

    def _phasor_curves(self, trials: Sequence[Trial]) -> tuple[Array, Array]:
        """Return curves of two phasors near the values, and their weights, as _free_curves does.

        One phasor stays and one turns with the wheel. The square of F'_ior is linear in three numbers:

        (2)  F'_ior^2 = level^2 (p + q cos(turn) + r sin(turn)),  q^2 + r^2 < p^2

        sqrt(p) is lognormal, and every point (q, r) of the circle is as probable.
        """
        log_F = np.log(self.F_ior_arcsec)
        level = float(self.weight.sum(axis=1) @ log_F.mean(axis=1))
        squares = np.square(self._values_at_setup(trials) / np.exp(level))
        kinds = error_kinds(len(trials), LOG_NOISES)
        # numbers are drawn from normal ones about the values: p, q, r
        size = float(squares.mean()) if trials else 1.0
        middle = np.array([size, 0.0, 0.0])
        basis = _harmonics(-np.radians([trial.rotation_deg for trial in trials]))[:, _PHASOR_NUMBERS]
        normals, density = _numbers_near(
            size * basis,
            squares - basis @ middle,
            4 * np.multiply.outer(squares, squares) * self._log_covariances(trials, kinds),
            kinds,
            np.random.default_rng([self.seed, 5]),
        )
        numbers = middle + size * normals
        log_drawn = -0.5 * np.square(normals).sum(axis=1) - 3 * np.log(size * np.sqrt(2 * np.pi))
        weights = density * np.exp(_log_phasor_prior(numbers) - log_drawn) / _FREE_CURVES
        directions = log_F.shape[1]
        seat = _harmonics(2 * np.pi * np.arange(directions) / directions)[:, _PHASOR_NUMBERS]
        squares_of_curves = np.maximum(numbers @ seat.T, _LEAST_SQUARE * size)
        return np.exp(level) * np.sqrt(squares_of_curves), weights

    def _values_at_setup(self, trials: Sequence[Trial]) -> Array:
        """Return values [arcsec] over the level of F'_ior at their torques, shape (trials,)."""
        torque_levels = np.array([self.levels[self.setup.point(trial)[1]] for trial in trials])
        values = np.array([trial.F_ior_arcsec for trial in trials])
        return np.asarray(values / torque_levels)

    def _log_covariances(self, trials: Sequence[Trial], kinds: Sequence[ErrorKind]) -> Array:
        """Return the covariances of the logarithms of values by kind of error, shape (kinds, trials, trials)."""
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
    """Return 1 and the cosines and sines of the orders of free curves at angles [rad], shape (angles, numbers)."""
    order_angles = np.multiply.outer(angles, _FREE_CURVE_ORDERS)
    return np.hstack([np.ones((len(angles), 1)), np.cos(order_angles), np.sin(order_angles)])


def _log_phasor_prior(numbers: Array) -> Array:
    """Return the log density of p, q and r of equation (2), shape (numbers, 3), before any value, shape (numbers,).

    It is that of the level sqrt(p), of its derivative 1 / (2 p), and of the circle of area pi p^2; -inf outside of it.
    """
    constant = numbers[:, 0]
    is_inside = np.hypot(numbers[:, 1], numbers[:, 2]) < constant
    log_level = np.log(np.where(is_inside, constant, 1.0)) / 2
    log_density = -0.5 * np.square(log_level / _FREE_LEVEL) - np.log(_FREE_LEVEL * np.sqrt(2 * np.pi))
    return np.where(is_inside, log_density - 6 * log_level - np.log(2 * np.pi), -np.inf)


def _numbers_near(
    basis: Array, y: Array, covariances: Array, kinds: Sequence[ErrorKind], rng: np.random.Generator
) -> tuple[Array, Array]:
    """Normal numbers given values y = basis @ numbers + error, shape (_FREE_CURVES, numbers), and weights against that.

    Weighed so, one over the likelihood, the numbers are normal as before any value. Arguments: covariances of the error
    of each of the kinds, shape (kinds, values, values).
    """
    log_shares = np.array([kind.log_share for kind in kinds])

    def log_shown(off: Array, covariances: Array) -> Array:
        """Log density of each kind that it is off by so much, shape (kinds, rows)."""
        squares = ((off @ np.linalg.inv(covariances)) * off).sum(axis=2)
        return np.asarray(log_shares[:, None] - 0.5 * (squares + np.linalg.slogdet(covariances)[1][:, None]))

    total = basis @ basis.T + covariances
    log = log_shown(y[None], total)[:, 0]
    kind = rng.choice(len(log), _FREE_CURVES, p=softmax(log))
    numbers, error = (rng.standard_normal((_FREE_CURVES, n, 1)) for n in basis.T.shape)
    off = y[:, None] - basis @ numbers - np.linalg.cholesky(covariances)[kind] @ error
    numbers = (numbers + basis.T @ np.linalg.solve(total[kind], off))[..., 0]  # Matheron's rule
    return numbers, np.exp(logsumexp(log) - logsumexp(log_shown(y - numbers @ basis.T, covariances), axis=0))


@dataclass(frozen=True, eq=False)
class HolePosterior:
    """Draws after measured values, all of the same weight.

    samples that they are of; places among samples and directions of these; misfit, noise, over the stated one, and
    scale, shape (draws,); rotations_deg, and F_ior_by_torque [arcsec] in them by M_g [N*m], shape (draws, rotations);
    effective samples that they stand for; misread, probability of each value to be misread, shape (trials,).
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
        """Size [um] and direction [deg] of the offset that stands with the fixed wheel, of those that are drives."""
        size, direction = (self.samples.values[p].ravel()[self.places] for p in standing_offset(self.samples.drive))
        return size[~np.isnan(size)], direction[~np.isnan(size)]

    @property
    def by_values(self) -> float:
        """Probability that no drive of the preset shows the values: then these alone decide."""
        return 1 - len(self.offset[0]) / len(self.places)

    @property
    def facing(self) -> tuple[float, float] | tuple[None, None]:
        """Direction of the standing offset and its standard deviation [deg]; None where it is open."""
        mean = np.exp(1j * np.radians(self.offset[1])).mean() if len(self.offset[1]) else 0j
        length = min(float(abs(mean)), 1.0)  # rounding makes more of equal directions
        if not length or (spread := float(np.degrees(np.sqrt(-2 * np.log(length))))) > _OPEN:
            return None, None
        return float(np.degrees(np.angle(mean)) % 360), spread

    def decision(self, torques: Sequence[float], room_arcsec: Sequence[float | None], cost: float) -> Decision:
        """The decision among the rotations but the last one, which is 0, at torques [N*m]."""
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
    """Kinds of error and samples, drawn together by their likelihood after values."""

    kind: NDArray[np.int64]  # index of the kind of each draw, shape (draws,)
    places: NDArray[np.int64]  # of the sample and direction of each draw, shape (draws,)
    kind_weight: Array  # probability of each kind, shape (kinds,)
    effective: float  # effective sample size


def posterior_of(
    samples: HoleSamples, trials: Sequence[Trial], rotations_deg: Sequence[float], kinds: Sequence[ErrorKind] = ()
) -> HolePosterior:
    """Draw F'_ior in positions after values, of which there may be none: Trials 4 in docs/theory.md.

    A kind of error and a sample are drawn by their likelihood together, then F'_ior given both by equation (1) of
    belief/evidence.py, at all torques of the samples.

    Args:
        samples: of the drive.
        trials: values.
        rotations_deg: positions [deg].
        kinds: of error that values may have, by default all.
    """
    torques = tuple(samples.F_ior_by_torque)
    points = [samples.setup.point(trial) for trial in trials]
    measured = np.array([trial.F_ior_arcsec for trial in trials])
    stated = samples.noise(trials)
    kinds = kinds or error_kinds(len(trials), LOG_NOISES)
    drawn = _drawn_errors(samples, points, measured, stated, kinds)
    misfit = np.array([error_kind.misfit for error_kind in kinds])[drawn.kind]  # (draws,)
    noise = np.array([error_kind.noise for error_kind in kinds])[drawn.kind]  # (draws,)
    spread = np.array([error_kind.spreads(stated, measured) for error_kind in kinds])[drawn.kind]  # (draws, trials)
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
        F_ior_by_torque=dict(zip(torques, np.split(F_ior, len(torques), axis=1), strict=True)),
        effective=drawn.effective,
        misread=np.array([drawn.kind_weight[misread_trial == k].sum() for k in range(len(trials))]),
    )


def _drawn_errors(
    samples: HoleSamples, points: Sequence[Point], measured: Array, stated: Array, kinds: Sequence[ErrorKind]
) -> _ErrorDraws:
    """Draw kinds of error and samples by their likelihood, _POSTERIOR_DRAWS at even quantiles.

    Args:
        samples: of the drive.
        points: turn [deg] and torque [N*m] of each value.
        measured: values [arcsec], shape (trials,).
        stated: standard deviation of their noise [arcsec], shape (trials,).
        kinds: of error that values may have.
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
    weight = softmax(np.log(samples.weight.ravel()[possible]) + log_likelihood)  # (kinds, places)
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
    samples: HoleSamples, points: Sequence[Point], spread_shape: tuple[int, ...]
) -> tuple[Array, Array, Array]:
    """Draw normal numbers of draws: of their scale, of their misfit at points, and of the values' errors.

    Args:
        samples: their torques and seed. The random numbers of the first torque are those of samples with one torque.
        points: turns [deg] and torques [N*m].
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
    """Torque of the samples [N*m] at which values of one torque are far more probable; None without one."""
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
    """Draw samples of the uncertain inputs of a drive, its standing offset among them, by the preset's evidence.

    Args:
        drive: the drive.
        torques: [N*m], besides that of the setup.
        setup: how holes are measured.
        draws: effective sample size of the belief that they are worth.
        table: of each system.
        run: processes, progress and seed.

    Raises UsageError for a drive with rolling balls or without an offset, UntrustedError if too few draws are drives
    that agree with the evidence.
    """
    if not searchable(drive):
        raise UsageError("trials need bearing.ball_motion: locked", "use --set bearing.ball_motion=locked")
    prior = open_prior(drive)
    stated_prior = prior_of(drive)
    believed = stated_prior if len(stated_prior.fields) < len(prior.fields) else None
    deviations = open_deviations(prior)
    systems = replace(prior, fields=tuple(field for field in prior.fields if field not in deviations))
    count = max(1, draws // SAMPLES_A_TABLE)
    if not systems.fields:  # only deviations are unknown: as many samples from one finer table
        table = TableEffort(count * table.deviations, Mesh(), min(_COMPARED, count))
        count = 1
    other_torques = {*setup.others, *torques} - {setup.M_g}
    all_torques = (setup.M_g, *sorted(other_torques))  # the random numbers of a torque depend on its place
    samples = _system_samples(drive, systems, count, run)
    solve = partial(_tabled, prior, believed, all_torques, table, run.seed)
    weights, tables = _solved_tables(samples, solve, run)
    log_missed = np.concatenate([errors.log_missed for errors in tables], axis=1)  # (torques, compared)
    F_ior = np.concatenate([errors.F_ior_arcsec for errors in tables], axis=1)  # (torques, samples, directions)
    weight = _sample_weights(drive, prior, believed is not None, weights, tables, F_ior)
    F_ior *= np.exp(log_missed.mean(axis=1))[:, None, None]  # tables are corrected for their mean error
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


def _system_samples(drive: Drive, systems: DrivePrior, count: int, run: Run) -> Samples:
    """Draw samples of the fields of the contact systems, all but deviations.

    Args:
        drive: its evidence weighs the samples.
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
    samples: Samples, solve: Callable[[int, Mapping[str, float]], TabledErrors | None], run: Run
) -> tuple[list[float], list[TabledErrors]]:
    """Solve the errors of each system.

    Args:
        samples: of the systems.
        solve: returns the errors of a system by its number and values, None if it has none.
        run: processes and progress.

    Returns the weights of the systems with a result, and their errors. Raises UntrustedError if none has one.
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
            "no sampled drive has a result at the torque of the trials", "find the reason with hdassist check"
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
    """Return the weights of samples and directions, shape (samples, directions), not normalized.

    Args:
        drive: its catalogue's accuracy weighs the samples.
        prior: of the drive, with the standing offset open.
        has_believed: some samples of a table have the offset that the preset states.
        table_weights: of each table.
        tables: their errors.
        F_ior: of the samples [arcsec], shape (torques, samples, directions).
    """
    draws_each = tables[0].F_ior_arcsec.shape[1]
    opened = len(tables[0].shares)
    weight = np.repeat(table_weights, draws_each)[:, None] * np.ones(F_ior.shape[1:])
    is_as_stated = np.tile(np.arange(draws_each) >= opened, len(tables))
    # samples with a known direction of the offset count in that direction alone
    weight[is_as_stated if any_direction(prior) else slice(None), 1:] = 0
    if has_believed:
        for is_part, share in ((is_as_stated, _STATED_SHARE), (~is_as_stated, 1 - _STATED_SHARE)):
            weight[is_part] *= share / weight[is_part].sum()
    for evidence in evidence_of(drive):
        # The accuracy is that without load, where F'_ior is largest: F'_ior at the torque of the trials meets it too.
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
    """F'_ior of a system by its number, with values of its fields, and many deviations; None where it has none."""
    try:
        return tabled_errors(
            error_maps(prior.drive.with_values(values), torques), prior, effort, [seed, number], believed
        )
    except HdassistError:
        return None


def open_prior(drive: Drive) -> DrivePrior:
    """The prior of a drive, as `check` has it, with the offset that stands with the fixed wheel open.

    That offset is anywhere up to WIDEST_SIZE times the preset's, in any direction, unless the preset gives an
    uncertainty for it or does not know it; so is the one that turns with the cam. Raises UsageError where no
    distribution is known of the size of the standing offset.
    """
    belief = prior_of(drive)
    size, direction = standing_offset(drive)
    size_path = "tolerances.e_hh"
    priors = {field.path: field for field in belief.fields}
    if size not in priors and not drive.number(size) > 0:
        raise UsageError(
            f"trials need the size of the wave generator eccentricity: {size}",
            f"state the size, for example --set {size}=80; sizes up to {_WIDEST_SIZE:g} times 80 um are then sampled",
        )
    pairs = [(size, direction)]
    if drive.number(size_path) or any(path not in (size, direction) for path in drive.uncertainty):
        pairs.append((size_path, "phases.phi_hh"))
    for group, turn in pairs:
        reason = f"unknown in trials: up to {_WIDEST_SIZE:g} times the preset's value"
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
