"""What trials teach: what each position would lose, what to measure next, and how a trial came out."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from hdassist.errors import UntrustedError
from hdassist.mounting.losses import GOOD, Losses
from hdassist.mounting.robust import Criterion
from hdassist.trials.cloud import Cloud
from hdassist.trials.draws import Draws, drawn, smooth
from hdassist.trials.trial import Rig, Trial

TRUSTED = 5.0  # effective samples: fewer are no cloud any more
OUTCOMES = 64  # of a next trial that are looked at


@dataclass(frozen=True)
class Next:
    """The position whose measurement brings most: the probability that the choice after it is good, expected."""

    rotation_deg: float
    probability_after: float


@dataclass(frozen=True)
class Prediction:
    """A measured value against what the trials before it predicted: mean, 2.5 % and 97.5 % quantiles [arcsec].

    surprise: standard deviations by which it is off where the drive is taken to be as told, without misfit.
    """

    trial: Trial
    expected_arcsec: float
    low_arcsec: float
    high_arcsec: float
    surprise: float

    @property
    def as_predicted(self) -> bool:
        """Whether the value lies between the quantiles."""
        return self.low_arcsec <= self.trial.F_ior_arcsec <= self.high_arcsec


def learnt(
    cloud: Cloud,
    trials: Sequence[Trial],
    rig: Rig,
    rotations_deg: Sequence[float],
    *,
    torques: Sequence[float] | None = None,
    criterion: str = "expected",
    weights: Sequence[float] | None = None,
    seed: int = 0,
    executor: Executor | None = None,
) -> tuple[Draws, Losses]:
    """What trials teach of the positions that may be chosen [deg].

    Arguments: cloud; trials, measured on the rig; torques [N*m] that decide, that of the trials without it, and their
    weights; criterion over the losses. At another torque the scale is that of the trials; the misfit is as large, but
    another. Raises UsageError for an unknown criterion, UntrustedError where too few samples explain the trials.
    """
    everywhere, rng, found = [*rotations_deg, 0.0], np.random.default_rng([seed, 1]), []
    draws = drawn(cloud, trials, rig, everywhere, seed=seed)
    if draws.effective < TRUSTED:
        raise UntrustedError(
            f"too few of {cloud.weight.size} samples explain the trials: {draws.effective:.1f} effective ones",
            f"{TRUSTED:g} are needed: a larger --noise, or more samples: --samples 100000",
        )
    for M_g in [rig.M_g] if torques is None else torques:
        F_ior = draws.F_ior_arcsec
        if M_g != rig.M_g:
            f = cloud.at_torque(M_g, everywhere, draws.places, executor)
            spread = np.hypot(draws.misfit * f.mean(axis=1), cloud.tables[M_g].standard_error)[:, None]
            F_ior = np.maximum(f * draws.scale[:, None] + spread * smooth(everywhere, len(f), rng), 0.1 * f)
        found.append(F_ior)
    every, shares = np.array(found), None if weights is None else tuple(weights)
    return draws, Losses(tuple(rotations_deg), every[..., :-1], every[..., -1], Criterion.of(criterion), shares)


def next_trial(draws: Draws, losses: Losses, seed: int = 0) -> Next:
    """The position whose value would raise the probability most that the choice is a good one."""
    rng, noise = np.random.default_rng(seed), draws.noise_arcsec
    truth = rng.permutation(len(noise))[:OUTCOMES]
    off, good = norm.ppf((rng.permutation(OUTCOMES) + 0.5) / OUTCOMES), (losses.losses < GOOD).astype(float)
    after = []
    for F_ior, spread in zip(draws.F_ior_arcsec.T[: len(losses.rotations_deg)], noise.T, strict=False):
        density = norm.pdf((F_ior[truth] + off * spread[truth])[:, None], F_ior, spread)
        after.append(float(np.mean((density @ good / density.sum(axis=1, keepdims=True)).max(axis=1))))
    return Next(losses.rotations_deg[int(np.argmax(after))], max(after))


def prediction(cloud: Cloud, before: Sequence[Trial], rig: Rig, trial: Trial, seed: int = 0) -> Prediction:
    """What trials predict of another one, and how far that came out."""
    draws = drawn(cloud, before, rig, [trial.rotation_deg], seed=seed)
    told = drawn(cloud, before, rig, [trial.rotation_deg], misfits=(0.0,), noises=(1.0,), seed=seed)
    F_ior, noise = draws.F_ior_arcsec[:, 0], draws.noise_arcsec[:, 0]
    ends = float((F_ior - 9 * noise).min()), float((F_ior + 9 * noise).max())
    low, high = (float(brentq(lambda v, q=q: draws.chance(v) - q, *ends, xtol=1e-6)) for q in (0.025, 0.975))
    # how far out in the tail where draws have run out cannot be told
    surprise = float(norm.ppf(np.clip(told.chance(trial.F_ior_arcsec), 1e-6, 1 - 1e-6)))
    return Prediction(trial, float(F_ior.mean()), low, high, surprise)
