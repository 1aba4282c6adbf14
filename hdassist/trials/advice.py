"""Advice from trials: where to mount the fixed wheel when the direction of the cam offset is not known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, circmean, circstd

from hdassist.error.rests_on import LEAST, weighed
from hdassist.error.table import Mesh
from hdassist.errors import UntrustedError, UsageError
from hdassist.mounting.losses import Losses
from hdassist.mounting.positions import Choice, Position, hole_words, require_weights, usable_positions
from hdassist.mounting.robust import Criterion
from hdassist.mounting.stays import Stays, Told, over_ranges
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Progress
from hdassist.trials.cloud import FULL, QUICK, Cloud, Effort, cloud_of
from hdassist.trials.posterior import Draws, Prediction, learnt, next_trial, prediction, require_reachable
from hdassist.trials.trial import Rig, Trial

NEEDED = 0.9  # probability that the choice is good from which on the trials settle it
OPEN = 40.0  # deg: a direction whose standard deviation is more is not known
FEW = 3  # trials, which fit any drive: predictions of later ones are held against the drive as told
FALSE_ALARM = 0.05
WORTH = 0.01  # of the error: going back for less is not worth it
SURE = 2.0  # standard deviations by which a value has to be worse where nothing explains it
COARSE, COUNT = Mesh((9, 5, 9, 9), 0), 12  # of tables that tell what an end of a range changes

Teach = Callable[[Cloud], tuple[Draws, Losses]]


@dataclass(frozen=True)
class Verification:
    """A measured outcome against its prediction.

    back_to: the position tried before to go back to, None where the outcome's is to be kept; probability_good of the
    position to be in, and the best one [deg] with that probability, both None where nothing explains the outcome.
    """

    predicted: Prediction
    back_to: Trial | None
    probability_good: float | None = None
    best: tuple[float, float] | None = None


@dataclass(frozen=True)
class TrialAdvice:
    """What trials teach: the choice, the next trial, what was predicted of each but the first, and an outcome.

    next: its position [deg], and the probability of a good choice that is expected after it; needed: that from which on
    it is settled; rests_on: assumptions that it hinges on most.
    """

    cloud: Cloud
    trials: tuple[Trial, ...]
    draws: Draws
    losses: Losses
    next: tuple[float, float]
    predictions: tuple[Prediction, ...]
    outcome: Verification | None = None
    needed: float = NEEDED
    rests_on: tuple[Stays, ...] = ()

    @property
    def drive(self) -> Drive:
        """The drive as told."""
        return self.cloud.drive

    @property
    def stay(self) -> tuple[float, float]:
        """The position to be in [deg], and the probability that it is good: 0 where nothing explains an outcome."""
        if not (outcome := self.outcome):
            best = self.losses.best
            return self.losses.rotations_deg[best], float(self.losses.probability_good[best])
        return (outcome.back_to or outcome.predicted).rotation_deg, outcome.probability_good or 0.0

    @property
    def settled(self) -> bool:
        """Whether the position to be in is good with the probability needed."""
        return self.stay[1] >= self.needed

    @property
    def unlike_told(self) -> bool:
        """Whether the values are off by more than they are in FALSE_ALARM of drives that are as the preset has them."""
        squares = [one.surprise**2 for one in self.predictions[FEW - 1 :]]
        return bool(squares) and bool(chi2.sf(sum(squares), len(squares)) < FALSE_ALARM)

    @property
    def repeats(self) -> list[tuple[Trial, Trial]]:
        """Trials of one position, in pairs."""
        return [(a, b) for a, b in combinations(self.trials, 2) if a.rotation_deg == b.rotation_deg]

    @property
    def noise_arcsec(self) -> float:
        """Noise of a value by the trials."""
        return float(self.cloud.rig.noise_arcsec * self.draws.noise.mean())

    @property
    def standard_errors(self) -> list[float]:
        """Of F'_ior interpolated [arcsec], at each torque that decides."""
        return [self.cloud.tables[M_g].standard_error for M_g in self.drive.operation.M_g]

    @cached_property
    def offset_um(self) -> NDArray[np.complex128]:
        """Offset that stands with the fixed wheel, as x + i y, shape (draws,)."""
        return self.cloud.offset_um[self.draws.places]

    @cached_property
    def direction(self) -> tuple[float, float]:
        """Its direction, and the standard deviation of that [deg]."""
        angles = np.angle(self.offset_um, deg=True)
        return float(circmean(angles, high=360)), float(circstd(angles, high=360))

    @property
    def facing(self) -> tuple[float, float] | tuple[None, None]:
        """The same, None where it is open."""
        return self.direction if self.direction[1] < OPEN else (None, None)

    def where(self, rotation_deg: float) -> str:
        """A position in words."""
        return hole_words(rotation_deg, self.drive.mounting.holes)

    def at(self, place: int | None) -> Position:
        """One of the positions, with the F'_ior expected there; None: where the wheel stood before the first trial."""
        return self.losses.position(self.drive, self.direction[0], place)

    @property
    def choice(self) -> Choice:
        """The chosen position beside the others."""
        return self.losses.choice(self.drive, self.direction[0])


def advise_from_trials(
    drive: Drive,
    trials: Sequence[Trial],
    rig: Rig,
    *,
    outcome: Trial | None = None,
    criterion: str = "expected",
    weights: Sequence[float] | None = None,
    needed: float = NEEDED,
    effort: Effort = FULL,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> TrialAdvice:
    """Infer the cam offset from trials and choose the position of the fixed wheel, at the torques of the drive.

    Arguments: trials, measured on the rig; outcome, measured in one more position, to be compared with its prediction;
    criterion and weights as in learnt; needed, probability that settles; effort, seed, executor and progress as in
    cloud_of. Raises what those do, UsageError for what is out of range.
    """
    torques, positions = drive.operation.M_g, usable_positions(drive.mounting.holes, drive.mounting.allowed)
    Criterion.of(criterion)  # wrong before anything is computed
    rig.require_sound()
    require_weights(weights, len(torques))
    if not 0 < needed < 1:
        raise UsageError(f"the probability that settles must lie between 0 and 1, not {needed:g}", "--sure 0.9")
    require_reachable(cloud_of(drive, (), rig, effort=QUICK), trials)
    cloud = cloud_of(drive, torques, rig, seed=seed, effort=effort, executor=executor, progress=progress)
    teach = partial(learnt, cloud, torques=torques, criterion=criterion, weights=weights, executor=executor)
    draws, losses = teach(trials, positions)
    predictions = tuple(prediction(cloud, trials[:k], trials[k]) for k in range(1, len(trials)))
    verified = None
    if outcome:
        others = {trial.rotation_deg: trial for trial in trials if trial.rotation_deg != outcome.rotation_deg}
        everywhere = list(dict.fromkeys([outcome.rotation_deg, *others, *positions]))
        after, predicted = None, prediction(cloud, trials, outcome)
        with suppress(UntrustedError):  # its value alone is compared then
            _, after = teach([*trials, outcome], everywhere)
        verified = verification(after, predicted, list(others.values()), positions, rig.noise_arcsec)
    again = partial(learnt, trials=trials, rotations_deg=positions, criterion=criterion)
    held = stays_good(cloud, losses.best, effort.samples, again, executor)
    best = next_trial(draws, losses, seed)
    return TrialAdvice(cloud, tuple(trials), draws, losses, best, predictions, verified, needed, held)


def verification(
    after: Losses | None, predicted: Prediction, others: Sequence[Trial], positions: Sequence[float], noise: float
) -> Verification:
    """Whether to keep the position of an outcome, or to go back to one of others tried before.

    Argument: after, what is known with the outcome as one more trial, in all these positions. The position is kept
    unless one tried before is expected to lose less, over all torques that decide. Where nothing explains the outcome
    (None), its value alone is compared with the least measured one, by the noise [arcsec] of a value.
    """
    here: Trial = predicted
    cost, worth = {t.rotation_deg: t.F_ior_arcsec for t in (*others, here)}, SURE * np.sqrt(2) * noise
    if after:
        cost, worth = dict(zip(after.rotations_deg, after.expected_loss.tolist(), strict=True)), WORTH
    least = min(others, key=lambda t: cost[t.rotation_deg], default=here)
    back = least if cost[least.rotation_deg] + worth < cost[here.rotation_deg] else None
    if after is None:
        return Verification(predicted, back)
    good = dict(zip(after.rotations_deg, after.probability_good.tolist(), strict=True))
    best = min(positions, key=lambda rotation: cost[rotation])
    return Verification(predicted, back, good[(back or here).rotation_deg], (best, good[best]))


def stays_good(
    cloud: Cloud, best: int, samples: int, teach: Teach, executor: Executor | None = None
) -> tuple[Stays, ...]:
    """What becomes of a choice, by its place, over the ranges of the assumptions that move F'_ior most.

    The greatest change comes first. At both ends of each the same samples are drawn, coarser tables tell by how much
    their F'_ior changes, and the trials teach of that: at their own torque alone. Raises UntrustedError where an answer
    cannot be trusted.
    """
    if not (known := weighed(cloud.drive, (cloud.rig.M_g,), executor=executor)):
        return ()
    coarse = partial(cloud_of, torques=(), rig=cloud.rig, seed=cloud.seed, effort=Effort(samples, COARSE, COUNT))
    look = partial(_told, cloud, coarse(cloud.drive, executor=executor), best, coarse, teach)
    now = float(teach(cloud)[1].probability_good[best])
    assumed = [known.assumed[k] for k in known.heaviest()]
    return over_ranges(cloud.drive, assumed, look, lambda end: abs((end.good or 0.0) - now), executor=executor)


def _told(cloud: Cloud, here: Cloud, best: int, make: Callable[[Drive], Cloud], teach: Teach, drive: Drive) -> Told:
    """What becomes of a choice in another drive; here: cloud by coarse tables."""
    there = make(drive)
    if there.values.keys() == here.values.keys():  # else nothing is open of what was, and they are other samples
        change = there.F_ior_arcsec / np.maximum(here.F_ior_arcsec, LEAST)
        there = replace(there, tables=cloud.tables, F_ior_arcsec=cloud.F_ior_arcsec * change)
    with suppress(UntrustedError):
        _, losses = teach(there)
        good = float(losses.probability_good[best])
        return losses.rotations_deg[losses.best], float(losses.expected_loss[best]), good
    return None, None, None
