"""F'_ior after trials: draws of it in every position, as likely as the measured values make them.

Given a sample of the cloud all is normal: the drive shows it with a scale, a smooth misfit and noise about the stated
one (belief/misfit.py), the misfit and the noise both weighed by what is measured. Any one value may be misread, so that
one wrong value does not carry an order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp, ndtr, ndtri, softmax

from hdassist.belief.evidence import FREEDOM
from hdassist.belief.misfit import (
    LEAST_SHOWN,
    MISFITS,
    SCALE,
    SMOOTH_NUMBERS,
    ErrorKind,
    error_kinds,
    errors_of_drive,
    kernel,
    log_likelihood_of_errors,
    log_likelihoods,
    require_shown,
    smooth_misfits,
)
from hdassist.errors import UntrustedError
from hdassist.model.geometry import Array
from hdassist.mounting.decision import GOOD
from hdassist.mounting.losses import PositionStatistics
from hdassist.mounting.positions import hole_words
from hdassist.mounting.trial import Trial
from hdassist.trials.prior import Places, Prior

NOISE_SPREAD = 0.56  # of the logarithm of the noise over the stated one: within a third and three times with 95 %
LOG_NOISES = {noise: -0.5 * (np.log(noise) / NOISE_SPREAD) ** 2 for noise in 2.0 ** (np.arange(-2, 5) / 2)}
AS_TOLD = (ErrorKind(),)  # neither misfit nor another noise
POSTERIOR_DRAWS = 2048
WEEDED = 4096  # samples that are looked at closer
FAR_LIKELIER = 100.0  # times as probable: a torque is taken for that at which trials were measured
NEXT_OUTCOMES = 64  # of a next trial that are looked at


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws, all alike likely, of the uncertain inputs after trials.

    places among samples and directions of the prior; misfit, noise, over the stated one, and scale, shape (draws,);
    F_ior_arcsec at the torque of the trials, shape (draws, rotations); effective samples that they stand for; misread,
    probability of each value to be misread, shape (trials,).
    """

    places: Places
    misfit: Array
    noise: Array
    scale: Array
    F_ior_arcsec: Array
    effective: float
    misread: Array


@dataclass(frozen=True)
class Prediction(Trial):
    """A measured value against the prediction from the trials before it: mean, 2.5 % and 97.5 % quantiles [arcsec].

    surprise: standard deviations by which it is off where the drive is taken to be as stated, without misfit.
    """

    expected_arcsec: float
    low_arcsec: float
    high_arcsec: float
    surprise: float

    @property
    def as_predicted(self) -> bool:
        """Whether the value lies between the quantiles."""
        return self.low_arcsec <= self.F_ior_arcsec <= self.high_arcsec


def weeded(prior: Prior, trials: Sequence[Trial], count: int = WEEDED) -> Prior:
    """The prior with at most about so many of its samples, those that all or the first of the trials make likely.

    Kept by chance with a probability that their weight is divided by: the sum of weights stays right on average.
    """
    possible, rng = prior.possible, np.random.default_rng([prior.seed, 2])
    weight = prior.weight.ravel()[possible]
    log, chance = np.log(weight), weight / weight.sum()
    for trial in trials:
        f = prior.at([trial.rotation_deg], possible)[:, 0]
        off = (trial.F_ior_arcsec - f) / np.hypot(2 * prior.noise([trial]), (SCALE + MISFITS[-1]) * f)
        log = log - (FREEDOM + 1) / 2 * np.log1p(off**2 / FREEDOM)
        chance = chance + softmax(log)
    chance = np.minimum(count / (len(trials) + 1) * chance, 1)
    kept = rng.random(len(possible)) < chance
    left = np.zeros(prior.weight.size)
    left[possible[kept]] = (weight / chance)[kept]
    return replace(prior, weight=(left / left.sum()).reshape(prior.weight.shape))


def learnt(
    prior: Prior,
    trials: Sequence[Trial],
    rotations_deg: Sequence[float],
    torques: Sequence[float] = (),
) -> tuple[Draws, PositionStatistics]:
    """The positions that may be chosen [deg], after trials.

    Argument: torques [N*m] that decide, that of the trials without them. At another torque the scale is that of the
    trials; the misfit is as large, but another. Raises UntrustedError where no sample explains the trials.
    """
    require_reachable(prior, trials)
    everywhere, rng = [*rotations_deg, 0.0], np.random.default_rng([prior.seed, 1])
    draws = drawn(prior, trials, everywhere)

    def at(M_g: float) -> Array:
        if M_g == prior.M_g:
            return draws.F_ior_arcsec
        f = prior.at(everywhere, draws.places, M_g)
        spread = (np.hypot(draws.misfit, prior.read_error[M_g]) * f.mean(axis=1))[:, None]
        smooth = smooth_misfits(everywhere, rng.standard_normal((len(f), SMOOTH_NUMBERS)))
        return np.asarray(np.maximum(f * draws.scale[:, None] + spread * smooth, LEAST_SHOWN * f))

    every, weights = np.array([at(M_g) for M_g in torques or [prior.M_g]]), np.ones(len(draws.places))
    return draws, PositionStatistics(tuple(rotations_deg), every[..., :-1], every[..., -1], weights)


def require_effective(prior: Prior, trials: Sequence[Trial], draws: Draws, needed: float) -> None:
    """Raise UntrustedError where fewer samples are effective than needed, naming the trial most probably misread."""
    if draws.effective >= needed:
        return
    doubted = trials[int(np.argmax(draws.misread))]
    where = hole_words(doubted.rotation_deg, prior.drive.mounting.holes)
    raise UntrustedError(
        f"too few samples explain the trials: {draws.effective:.1f} of {prior.possible.size} are effective, "
        f"{needed:g} are needed; {doubted.F_ior_arcsec:g}″ at {where} agrees least",
        f"measure {where} again; a larger --noise, or more samples: --draws 128",
    )


def likelier_torque(prior: Prior, trials: Sequence[Trial]) -> float | None:
    """Torque of the prior [N*m] at which trials are far more probable than at that of the rig; None without one."""
    tried, possible = [t.rotation_deg for t in trials], prior.possible
    measured = np.array([t.F_ior_arcsec for t in trials]), prior.noise(trials), kernel(tried, tried)
    weight = prior.weight.ravel()[possible]
    log_probability = {
        M_g: logsumexp(log_likelihood_of_errors(prior.at(tried, possible, M_g), *measured, read_error), b=weight)
        for M_g, read_error in prior.read_error.items()
    }
    likeliest = max(log_probability, key=log_probability.__getitem__)
    return likeliest if log_probability[likeliest] > log_probability[prior.M_g] + np.log(FAR_LIKELIER) else None


def next_trial(draws: Draws, losses: PositionStatistics, noise_arcsec: float, seed: int = 0) -> tuple[float, float]:
    """The position [deg] whose value would raise the probability most that the choice is good, and that expected.

    Arguments: noise_arcsec, stated standard deviation of a value; seed of the outcomes that are looked at.
    """
    rng, spread = np.random.default_rng(seed), draws.noise * noise_arcsec
    truth = rng.permutation(len(spread))[:NEXT_OUTCOMES]
    off, good = ndtri((rng.permutation(NEXT_OUTCOMES) + 0.5) / NEXT_OUTCOMES), (losses.losses < GOOD).astype(float)
    after = []
    for rotation, F_ior in zip(losses.rotations_deg, draws.F_ior_arcsec.T, strict=False):
        value = (F_ior[truth] + off * spread[truth])[:, None]
        density = np.exp(-0.5 * ((value - F_ior) / spread) ** 2) / spread
        after.append((rotation, float(np.mean((density @ good / density.sum(axis=1, keepdims=True)).max(axis=1)))))
    return max(after, key=lambda each: each[1])


def prediction(prior: Prior, before: Sequence[Trial], trial: Trial) -> Prediction:
    """The prediction of another trial, and its error."""
    draws, told = (drawn(prior, before, [trial.rotation_deg], kinds) for kinds in ((), AS_TOLD))
    noise, as_told = (each.noise[:, None] * prior.noise([trial]) for each in (draws, told))
    noise *= np.random.default_rng([prior.seed, 2]).standard_normal((POSTERIOR_DRAWS, 1))
    expected = float(draws.F_ior_arcsec.mean())
    low, high = np.quantile(draws.F_ior_arcsec + noise, (0.025, 0.975)).tolist()
    # how far out in the tail where draws have run out is unknown
    below = ndtr((trial.F_ior_arcsec - told.F_ior_arcsec) / as_told).mean()
    surprise = float(ndtri(np.clip(below, 1e-6, 1 - 1e-6)))
    return Prediction(trial.rotation_deg, trial.F_ior_arcsec, expected, low, high, surprise)


def drawn(
    prior: Prior, trials: Sequence[Trial], rotations_deg: Sequence[float], kinds: Sequence[ErrorKind] = ()
) -> Draws:
    """Draw F'_ior in positions [deg] after trials, of which there may be none.

    Argument: kinds of error that values may have, all of them without it.
    """
    rng = np.random.default_rng(prior.seed)
    y, tried = np.array([t.F_ior_arcsec for t in trials]), [t.rotation_deg for t in trials]
    possible, stated, kinds = prior.possible, prior.noise(trials), kinds or error_kinds(len(trials), LOG_NOISES)
    mean, read_error = _mean(prior, possible), prior.read_error[prior.M_g]
    likelihoods = log_likelihoods(kinds, prior.at(tried, possible), y, stated, kernel(tried, tried), mean, read_error)
    weight = softmax(np.log(prior.weight.ravel()[possible]) + likelihoods)
    at = np.searchsorted(np.cumsum(weight), (np.arange(POSTERIOR_DRAWS) + 0.5) / POSTERIOR_DRAWS)
    kind, row = np.divmod(np.minimum(at, weight.size - 1), weight.shape[1])
    places = possible[row]
    misfit, noise = np.array([(each.misfit, each.noise) for each in kinds])[kind].T
    everywhere = [*rotations_deg, *tried]
    spread = np.array([each.spreads(stated, y) for each in kinds])[kind]
    f, variance = prior.at(everywhere, places), (misfit**2 + read_error**2) * _mean(prior, places) ** 2
    smooth = smooth_misfits(everywhere, rng.standard_normal((len(places), SMOOTH_NUMBERS)))
    normal = rng.standard_normal(len(places)), smooth, rng.standard_normal(spread.shape)
    F_ior, scale = errors_of_drive(f, y, variance, spread, kernel(everywhere, everywhere), normal)
    effective = float(1 / np.square(weight.sum(axis=0)).sum())
    of_kind, doubted = weight.sum(axis=1), np.array([each.misread for each in kinds])
    misread = np.array([of_kind[doubted == k].sum() for k in range(len(trials))])
    return Draws(places, misfit, noise, scale, F_ior, effective, misread)


def _mean(prior: Prior, places: Places) -> Array:
    """Mean F'_ior of samples over all directions [arcsec], shape (places,)."""
    return np.asarray(prior.F_ior_arcsec.mean(axis=1)[places // prior.weight.shape[1]])


def require_reachable(prior: Prior, trials: Sequence[Trial]) -> None:
    """Raise UntrustedError where no sample comes near the measured values.

    Values of one position count by their mean: that they differ is the noise's.
    """
    tried = sorted({trial.rotation_deg for trial in trials})
    alike = [[t for t in trials if t.rotation_deg == rotation] for rotation in tried]
    y = np.array([np.mean([t.F_ior_arcsec for t in some]) for some in alike])
    spreads = np.array([np.mean(prior.noise(some)) for some in alike])
    names = [hole_words(rotation, prior.drive.mounting.holes) for rotation in tried]
    hint = "check values, torque and how holes were counted; a larger offset, or --noise, may fit"
    require_shown(names, prior.at(tried, prior.possible), y, spreads, kernel(tried, tried), hint)
