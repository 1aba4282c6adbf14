"""Advice from trials: where to mount the fixed wheel when the direction of the cam offset is not known."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import combinations
from typing import Any

import numpy as np
from scipy.stats import chi2

from hdassist.error.rests_on import MOST
from hdassist.errors import UntrustedError, UsageError
from hdassist.mounting.losses import Losses
from hdassist.mounting.positions import Choice, Position, hole_of, phase_deg, require_weights, rotated, usable_positions
from hdassist.mounting.robust import Criterion
from hdassist.mounting.stays import Stays
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Progress
from hdassist.trials.cloud import FULL, QUICK, Cloud, Effort, cloud_of
from hdassist.trials.draws import Draws, require_reachable, told_noise
from hdassist.trials.posterior import Next, Prediction, learnt, next_trial, prediction
from hdassist.trials.rests import stays_good
from hdassist.trials.trial import Rig, Trial
from hdassist.trials.unknowns import offset_fields

NEEDED = 0.9  # probability that the choice is good from which on the trials settle it
OPEN = 40.0  # deg: a direction whose standard deviation is more is not known
FEW = 3  # trials, which fit any drive: predictions of later ones are held against the drive as told
FALSE_ALARM = 0.05
APART = 3.0  # standard deviations by which values of one position may differ without a remark
WORTH = 0.01  # of the error: going back for less is not worth it
SURE = 2.0  # standard deviations by which a value has to be worse where nothing explains it


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

    @property
    def stay_deg(self) -> float:
        """The position to be in [deg]."""
        return (self.back_to or self.predicted.trial).rotation_deg


@dataclass(frozen=True)
class TrialAdvice:
    """What trials teach: the choice, the next trial, what was predicted of each but the first, and an outcome.

    needed: probability that the choice is good from which on it is settled; rests_on: assumptions that this probability
    hinges on most.
    """

    cloud: Cloud
    rig: Rig
    trials: tuple[Trial, ...]
    draws: Draws
    losses: Losses
    next: Next
    predictions: tuple[Prediction, ...]
    outcome: Verification | None
    needed: float = NEEDED
    rests_on: tuple[Stays, ...] = ()

    @property
    def drive(self) -> Drive:
        """The drive as told."""
        return self.cloud.drive

    @property
    def settled(self) -> bool:
        """Whether the choice, or the position to be in after an outcome, is good with the probability needed."""
        good = self.outcome.probability_good if self.outcome else self.losses.probability_good[self.losses.best]
        return good is not None and bool(good >= self.needed)

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
    def apart(self) -> list[tuple[Trial, Trial]]:
        """Those whose values differ by more than the told noise makes likely."""
        values = [(a, b, np.array([a.F_ior_arcsec, b.F_ior_arcsec])) for a, b in self.repeats]
        return [
            (a, b) for a, b, of in values if np.ptp(of) > APART * np.linalg.norm(told_noise(self.cloud, self.rig, of))
        ]

    @cached_property
    def direction(self) -> tuple[float, float]:
        """Direction of the offset and its standard deviation [deg]."""
        turn = complex(np.exp(1j * np.angle(self.cloud.offset_um[self.draws.places])).mean())
        return float(np.degrees(np.angle(turn)) % 360), float(np.degrees(np.sqrt(-2 * np.log(max(abs(turn), 1e-12)))))

    def at(self, place: int | None) -> Position:
        """One of the positions, with the F'_ior expected there; None: where the wheel stood before the first trial.

        Its phase is that of the expected direction.
        """
        F_ior = self.losses.now_arcsec if place is None else self.losses.F_ior_arcsec[:, :, place]
        rotation = 0.0 if place is None else self.losses.rotations_deg[place]
        facing = self.drive.with_values({offset_fields(self.drive)[1]: self.direction[0]})
        hole = hole_of(rotation, self.drive.mounting.holes)
        return Position(rotation, phase_deg(rotated(facing, rotation)), hole, tuple(F_ior.mean(axis=1).tolist()))

    @property
    def choice(self) -> Choice:
        """The chosen position beside the others."""
        ranked = tuple(map(self.at, self.losses.ranked))
        current = next((p for p in ranked if not p.rotation_deg), self.at(None))
        torques = tuple(self.drive.operation.M_g)
        return Choice(self.drive, torques, current, ranked[0], bool(ranked[0].rotation_deg), ranked)


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
    most: int = MOST,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> TrialAdvice:
    """Infer the cam offset from trials and choose the position of the fixed wheel, at the torques of the drive.

    Arguments: trials, measured on the rig; outcome, measured in one more position, to be compared with its prediction;
    criterion and weights as in learnt; needed, probability that settles; effort of the cloud; most, how many
    assumptions are told that it rests on; executor, progress as in cloud_of. Raises what those do; UntrustedError where
    nothing comes to the measured values; UsageError where only forbidden positions are left.
    """
    torques, seat = drive.operation.M_g, drive.mounting
    Criterion.of(criterion)  # wrong before anything is computed
    rig.require_sound()
    require_weights(weights, len(torques))
    if not 0 < needed < 1:
        raise UsageError(f"the probability that settles must lie between 0 and 1, not {needed:g}", "--sure 0.9")
    positions = usable_positions(seat.holes, seat.allowed)
    if not positions:
        raise UsageError("no position of the seat is allowed", "mounting.allowed lists the usable holes")
    require_reachable(cloud_of(drive, [], rig.M_g, effort=QUICK), trials, rig)
    make = partial(cloud_of, torques=torques, rig_M_g=rig.M_g, reseat=rig.reseat_um > 0, seed=seed)
    teach = partial(taught, rig=rig, torques=torques, criterion=criterion, weights=weights, seed=seed)
    cloud = make(drive, effort=effort, executor=executor, progress=progress)
    draws, losses = teach(cloud, trials, rotations_deg=positions, executor=executor)
    predictions = tuple(prediction(cloud, trials[:k], rig, trials[k], seed) for k in range(1, len(trials)))
    verified = None
    if outcome:
        others = {trial.rotation_deg: trial for trial in trials if trial.rotation_deg != outcome.rotation_deg}
        everywhere = list(dict.fromkeys([outcome.rotation_deg, *others, *positions]))
        after, predicted = None, prediction(cloud, trials, rig, outcome, seed)
        with suppress(UntrustedError):  # its value alone is compared then
            _, after = teach(cloud, [*trials, outcome], rotations_deg=everywhere, executor=executor)
        verified = verification(after, predicted, list(others.values()), positions, rig.noise_arcsec)
    again = partial(taught, trials=trials, rig=rig, rotations_deg=positions, criterion=criterion, seed=seed)
    held = stays_good(
        cloud, losses.best, effort.samples, partial(make, torques=()), again, most=most, executor=executor
    )
    best = next_trial(draws, losses, seed)
    return TrialAdvice(cloud, rig, tuple(trials), draws, losses, best, predictions, verified, needed, held)


def taught(
    cloud: Cloud, trials: Sequence[Trial], rig: Rig, rotations_deg: Sequence[float], **how: Any
) -> tuple[Draws, Losses]:
    """What trials teach, as learnt tells it; values that no sample comes to are refused before."""
    require_reachable(cloud, trials, rig)
    return learnt(cloud, trials, rig, rotations_deg, **how)


def verification(
    after: Losses | None, predicted: Prediction, others: Sequence[Trial], positions: Sequence[float], noise: float
) -> Verification:
    """Whether to keep the position of an outcome, or to go back to one of others tried before.

    Argument: after, what is known with the outcome as one more trial, in all these positions. The position is kept
    unless one tried before is expected to lose less, over all torques that decide. Where nothing explains the outcome
    (None), its value alone is compared with the least measured one, by the noise [arcsec] of a value.
    """
    here = predicted.trial
    if after is None:
        least = min(others, key=lambda t: t.F_ior_arcsec, default=here)
        worse = least.F_ior_arcsec + SURE * np.sqrt(2) * noise < here.F_ior_arcsec
        return Verification(predicted, least if worse else None)
    loss = dict(zip(after.rotations_deg, after.expected_loss.tolist(), strict=True))
    good = dict(zip(after.rotations_deg, after.probability_good.tolist(), strict=True))
    least = min(others, key=lambda t: loss[t.rotation_deg], default=here)
    back = least if loss[least.rotation_deg] + WORTH < loss[here.rotation_deg] else None
    best = min(positions, key=lambda rotation: loss[rotation])
    return Verification(predicted, back, good[(back or here).rotation_deg], (best, good[best]))
