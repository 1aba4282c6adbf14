"""What trials teach of F'_ior: draws of it in every position, as likely as the measured values make them.

Given a sample of the cloud all is normal: the drive shows it with a scale, a smooth misfit and noise about the told
one (belief/misfit.py), the misfit and the noise both weighed by what is measured. Any one value may be misread, so that
one wrong value does not carry an order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.special import logsumexp, softmax
from scipy.stats import chi2, norm

from hdassist.belief.evidence import FREEDOM
from hdassist.belief.misfit import MISFITS, MISREAD, SCALE, kernel, likelihood_of_errors, spreads_with_misread
from hdassist.errors import UntrustedError
from hdassist.model.geometry import Array
from hdassist.mounting.losses import GOOD, Criterion, PositionStatistics
from hdassist.mounting.positions import hole_words
from hdassist.mounting.trial import Trial
from hdassist.trials.prior import Places, Prior

NOISES = tuple(2.0 ** (k / 2) for k in range(-2, 5))  # of the told noise
MISFIT_KINDS, AS_TOLD = np.array(list(product(MISFITS, NOISES))), np.array([[0.0, 1.0]])  # pairs of them
ANY_TWO = 3  # values: of no more, the two that agree may do so by chance
NOISE_SPREAD = 0.35  # of its logarithm before any trial: within half and twice with 95 %
POSTERIOR_DRAWS = 2048
UNLIKELY = 1e-3  # of a chance that the best explanation misses the trials so far: then there is none
WEEDED = 4096  # samples that are looked at closer
OUTCOMES = 64  # of a next trial that are looked at


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws, all alike likely, of what is not known after trials.

    places among samples and directions of the prior; misfit, noise, over the told one, and scale, shape (draws,);
    F_ior_arcsec at the torque of the trials and the noise of a value there, shape (draws, rotations); effective samples
    that they stand for; misread, probability of each value to be misread, shape (trials,).
    """

    places: Places
    misfit: Array
    noise: Array
    scale: Array
    F_ior_arcsec: Array
    noise_arcsec: Array
    effective: float
    misread: Array


@dataclass(frozen=True)
class Prediction(Trial):
    """A measured value against what the trials before it predicted: mean, 2.5 % and 97.5 % quantiles [arcsec].

    surprise: standard deviations by which it is off where the drive is taken to be as told, without misfit.
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
        off = (trial.F_ior_arcsec - f) / np.hypot(2 * prior.noise(f, [trial]), (SCALE + MISFITS[-1]) * f)
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
    *,
    torques: Sequence[float] = (),
    criterion: str = "expected",
    weights: Sequence[float] | None = None,
) -> tuple[Draws, PositionStatistics]:
    """What trials teach of the positions that may be chosen [deg].

    Arguments: torques [N*m] that decide, that of the trials without them, and their weights; criterion over the losses.
    At another torque the scale is that of the trials; the misfit is as large, but another. Raises UsageError for an
    unknown criterion, UntrustedError where no sample explains the trials.
    """
    require_reachable(prior, trials)
    everywhere, rng = [*rotations_deg, 0.0], np.random.default_rng([prior.seed, 1])
    draws = drawn(prior, trials, everywhere)

    def at(M_g: float) -> Array:
        if M_g == prior.M_g:
            return draws.F_ior_arcsec
        f = prior.at(everywhere, draws.places, M_g)
        spread = (np.hypot(draws.misfit, prior.read_error[M_g]) * f.mean(axis=1))[:, None]
        return np.asarray(np.maximum(f * draws.scale[:, None] + spread * _smooth(everywhere, len(f), rng), 0.1 * f))

    decide, shares = torques or [prior.M_g], None if weights is None else tuple(weights)
    every, weights_of_draws = np.array([at(M_g) for M_g in decide]), np.ones(len(draws.places))
    rotations, how = tuple(rotations_deg), Criterion.of(criterion)
    return draws, PositionStatistics(rotations, every[..., :-1], every[..., -1], weights_of_draws, how, shares)


def require_effective(prior: Prior, trials: Sequence[Trial], draws: Draws, needed: float) -> None:
    """Raise UntrustedError where fewer samples are effective than needed, naming the trial without which most are."""
    if draws.effective >= needed:
        return

    def without(k: int) -> float:
        return drawn(prior, [*trials[:k], *trials[k + 1 :]], [0.0]).effective

    doubted = trials[max(range(len(trials)), key=without)]
    where = hole_words(doubted.rotation_deg, prior.drive.mounting.holes)
    raise UntrustedError(
        f"too few samples explain the trials: {draws.effective:.1f} of {prior.possible.size} are effective, "
        f"{needed:g} are needed; {doubted.F_ior_arcsec:g} arcsec at {where} agrees least",
        f"measure {where} again; a larger --noise, or more samples: --draws 128",
    )


def next_trial(draws: Draws, losses: PositionStatistics, seed: int = 0) -> tuple[float, float]:
    """The position [deg] whose value would raise the probability most that the choice is good, and that expected."""
    rng, noise = np.random.default_rng(seed), draws.noise_arcsec
    truth = rng.permutation(len(noise))[:OUTCOMES]
    off, good = norm.ppf((rng.permutation(OUTCOMES) + 0.5) / OUTCOMES), (losses.losses < GOOD).astype(float)
    after = []
    for rotation, F_ior, spread in zip(losses.rotations_deg, draws.F_ior_arcsec.T, noise.T, strict=False):
        density = norm.pdf((F_ior[truth] + off * spread[truth])[:, None], F_ior, spread)
        after.append((rotation, float(np.mean((density @ good / density.sum(axis=1, keepdims=True)).max(axis=1)))))
    return max(after, key=lambda each: each[1])


def prediction(prior: Prior, before: Sequence[Trial], trial: Trial) -> Prediction:
    """What trials predict of another one, and how far that came out."""
    draws, told = (drawn(prior, before, [trial.rotation_deg], kinds) for kinds in (None, AS_TOLD))
    noise, as_told = (each.noise[:, None] * prior.noise(each.F_ior_arcsec, [trial]) for each in (draws, told))
    noise *= np.random.default_rng([prior.seed, 2]).standard_normal((POSTERIOR_DRAWS, 1))
    expected, (low, high) = (
        float(draws.F_ior_arcsec.mean()),
        np.quantile(draws.F_ior_arcsec + noise, (0.025, 0.975)).tolist(),
    )
    # how far out in the tail where draws have run out cannot be told
    below = norm.cdf(trial.F_ior_arcsec, told.F_ior_arcsec, as_told).mean()
    surprise = float(norm.ppf(np.clip(below, 1e-6, 1 - 1e-6)))
    return Prediction(trial.rotation_deg, trial.F_ior_arcsec, expected, low, high, surprise)


def drawn(prior: Prior, trials: Sequence[Trial], rotations_deg: Sequence[float], kinds: Array | None = None) -> Draws:
    """Draw F'_ior in positions [deg] after trials, of which there may be none.

    Argument: kinds, pairs of misfit and noise that may be, by default KINDS, and then any one value may be misread.
    """
    rng = np.random.default_rng(prior.seed)
    y, tried = np.array([t.F_ior_arcsec for t in trials]), [t.rotation_deg for t in trials]
    possible = prior.possible
    told, f = prior.noise(y, trials), prior.at(tried, possible) if trials else np.zeros((len(possible), 0))
    rows, doubts = (MISFIT_KINDS if kinds is None else kinds).tolist(), np.log(1 - MISREAD)
    plain = [(s, factor, -1, -0.5 * (np.log(factor) / NOISE_SPREAD) ** 2) for s, factor in rows]
    each_kind = plain
    if kinds is None and trials:
        shares = logsumexp([row[3] for row in plain])
        each_kind = [(s, factor, -1, share - shares + doubts) for s, factor, _, share in plain]
        doubt = np.log(MISREAD / len(trials) / len(MISFITS))
        each_kind += [(s, 1.0, k, doubt) for k in range(len(trials)) for s in MISFITS]
    spreads = np.array([spreads_with_misread(told, y, k) for _, _, k, _ in each_kind])
    with np.errstate(divide="ignore"):
        log = np.log(prior.weight.ravel()[possible]) + np.array([share for *_, share in each_kind])[:, None]
    if trials:
        log += [
            likelihood_of_errors(f, y, spread, _variance(prior, s, possible), kernel(tried, tried), factor)[1]
            for (s, factor, _, _), spread in zip(each_kind, spreads, strict=True)
        ]
    weight = softmax(log)
    at = np.searchsorted(np.cumsum(weight), (np.arange(POSTERIOR_DRAWS) + 0.5) / POSTERIOR_DRAWS)
    kind, row = np.divmod(np.minimum(at, weight.size - 1), weight.shape[1])
    places = possible[row]
    misfit, noise = np.array([row[:2] for row in each_kind])[kind].T
    # drawn without the values, then moved by what these differ from their own draw (Matheron's rule)
    count, everywhere, spread = len(rotations_deg), [*rotations_deg, *tried], noise[:, None] * spreads[kind]
    f, variance = prior.at(everywhere, places), _variance(prior, misfit, places)
    scale = 1 + SCALE * rng.standard_normal(len(places))
    F_ior = f * scale[:, None] + np.sqrt(variance)[:, None] * _smooth(everywhere, len(places), rng)
    there, seen = f[:, count:], F_ior[:, count:] + spread * rng.standard_normal((len(places), len(tried)))
    both = variance[:, None, None] * kernel(everywhere, tried) + SCALE**2 * f[:, :, None] * there[:, None, :]
    of_values = both[:, count:] + np.square(spread)[:, :, None] * np.eye(len(tried))
    moved = np.linalg.solve(of_values, (y - seen)[..., None])
    scale += SCALE**2 * (there * moved[..., 0]).sum(axis=1)
    # a normal distribution has no end, an error has
    F_ior = np.maximum((F_ior + (both @ moved)[..., 0])[:, :count], 0.1 * f[:, :count])
    effective = float(1 / np.square(weight.sum(axis=0)).sum())
    of_kind, doubted = weight.sum(axis=1), np.array([k for _, _, k, _ in each_kind])
    misread = np.array([of_kind[doubted == k].sum() for k in range(len(trials))])
    return Draws(places, misfit, noise, scale, F_ior, noise[:, None] * prior.noise(F_ior), effective, misread)


def _variance(prior: Prior, misfit: Array | float, places: Places | slice = slice(None)) -> Array:
    """Variance of the misfit [arcsec^2] of samples: the drive's and the table's."""
    mean = np.repeat(prior.F_ior_arcsec.mean(axis=1), prior.weight.shape[1])[places]
    return np.asarray((np.square(misfit) + prior.read_error[prior.M_g] ** 2) * mean**2)


def _smooth(rotations_deg: Sequence[float], draws: int, rng: np.random.Generator) -> Array:
    """Draws of the misfit of variance 1, shape (draws, rotations)."""
    own, basis = np.linalg.eigh(kernel(rotations_deg, rotations_deg))
    return np.asarray(rng.standard_normal((draws, len(own))) @ (np.sqrt(np.maximum(own, 0))[:, None] * basis.T))


def require_reachable(prior: Prior, trials: Sequence[Trial]) -> None:
    """Raise UntrustedError where no sample comes to the measured values, saying what would have to change.

    Values of one position count by their mean: that they differ is the noise's.
    """
    tried = sorted({trial.rotation_deg for trial in trials})
    alike = [[t for t in trials if t.rotation_deg == rotation] for rotation in tried]
    y = np.array([np.mean([t.F_ior_arcsec for t in some]) for some in alike])
    told = np.array([np.mean(prior.noise(y[k], some)) for k, some in enumerate(alike)])
    f, every = prior.at(tried, prior.possible), list(range(len(tried)))

    def off(some: list[int]) -> Array:
        variance = _variance(prior, MISFITS[-1], prior.possible)
        at = [tried[k] for k in some]
        return likelihood_of_errors(f[:, some], y[some], told[some], variance, kernel(at, at))[0]

    squares = off(every)
    nearest = int(np.argmin(squares))
    if chi2.sf(squares[nearest], len(tried)) >= UNLIKELY:
        return
    others = {k: [j for j in every if j != k] for k in every if len(tried) >= ANY_TWO}
    alone = [k for k, rest in others.items() if chi2.sf(off(rest).min(), len(rest)) >= UNLIKELY]
    if len(alone) == 1:
        if len(tried) > ANY_TWO:
            return  # it may be misread, which is taken into account
        where = hole_words(tried[alone[0]], prior.drive.mounting.holes)
        raise UntrustedError(
            f"{where}: measured {y[alone[0]]:g} arcsec contradicts the others, which drives of this preset explain",
            "measure it again, and look how holes were counted",
        )
    words = ", ".join(
        f"{hole_words(rotation, prior.drive.mounting.holes)}: measured {value:g}, at best {best:.1f}"
        for rotation, value, best in zip(tried, y, f[nearest], strict=True)
    )
    low, high, most = float(f.min()), float(f.max()), float(y.max())
    change = "offsets of that size don't differ so much from hole to hole: a larger offset, or --noise, may fit"
    if not low <= most <= high:
        change = f"deviations or offsets had to be {most / (high if most > high else low):.2g} times as large"
    raise UntrustedError(
        f"no cam offset up to {prior.offset(prior.possible)[0].max():.0f} um explains the trials ({words} arcsec)",
        f"this drive shows {low:.1f} to {high:.1f} arcsec at {prior.M_g:g} N*m: check values and torque; {change}",
    )
