"""Advice from trials: where to mount the fixed wheel when the direction of the cam offset is not known."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hdassist.error.table import STATES
from hdassist.errors import UsageError
from hdassist.model.geometry import Array
from hdassist.mounting.positions import Chances, Choice, Position, hole_of, phase_deg, rotated
from hdassist.mounting.robust import Criterion, share_best
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Progress
from hdassist.trials.posterior import NextTrial, Posterior, posterior, require_weights
from hdassist.trials.prior import FULL, offset_prior
from hdassist.trials.prior import STATES as WORLD_STATES
from hdassist.trials.trial import Rig, Trial, trial_positions
from hdassist.trials.unknowns import OffsetNames
from hdassist.trials.verification import Verification, verify
from hdassist.trials.weighted import picked

UNSURE = 0.05  # expected loss of the choice above which the trials settle nothing
SAMPLES = 400  # of what is known, for those who count samples


@dataclass(frozen=True)
class TrialAdvice:
    """What trials teach of a drive, the trial that would teach most, and an outcome compared with its prediction."""

    drive: Drive
    known: Posterior
    next: NextTrial
    outcome: Verification | None

    def at(self, place: int) -> Position:
        """One of the positions, with the F'_ior expected there; its phase is that of the likeliest direction."""
        rotation = self.known.rotations_deg[place]
        F_ior = self._expected_F_ior[: self.known.deciding, place]
        return Position(rotation, self.phase(rotation), hole_of(rotation, self.drive.mounting.holes), tuple(F_ior))

    def phase(self, rotation_deg: float) -> float:
        """Phase [deg] of a rotation if the offset points where it most likely does."""
        return phase_deg(rotated(self._facing, rotation_deg))

    @cached_property
    def _expected_F_ior(self) -> Array:
        return self.known.expected_F_ior()

    @cached_property
    def _facing(self) -> Drive:
        return self.drive.with_values({OffsetNames.of(self.drive).direction: self.known.likeliest_deg})

    @property
    def chosen(self) -> Position:
        """The position to choose."""
        return self.at(self.known.best)

    @property
    def settled(self) -> bool:
        """Whether the choice is expected to lose little against the best position."""
        return bool(self.known.expected_loss[self.known.best] <= UNSURE)

    @property
    def ranked(self) -> list[int]:
        """Places of the positions, best first."""
        return [int(place) for place in self.known.value.argsort(kind="stable")]

    @property
    def present(self) -> Position:
        """Where the wheel stood before the first trial, be it allowed or not, with the F'_ior expected there."""
        F_ior = (self.known.now_arcsec @ self.known.weight)[: self.known.deciding]
        return Position(0.0, self.phase(0.0), hole_of(0.0, self.drive.mounting.holes), tuple(F_ior))

    @property
    def choice(self) -> Choice:
        """The chosen position beside the others."""
        known, ranked = self.known, tuple(self.at(place) for place in self.ranked)
        current = next((p for p in ranked if not p.rotation_deg), self.present)
        turn = bool(ranked[0].rotation_deg)
        return Choice(self.drive, known.prior.torques[: known.deciding], current, ranked[0], turn, ranked)

    @property
    def chances(self) -> Chances:
        """How sure the choice is, over SAMPLES of what is known."""
        known = self.known
        some = picked(known.weight, SAMPLES)
        best, merits = share_best(known.merits[some]), known.merits[some, known.best]
        current = float(best[known.rotations_deg.index(0.0)]) if 0.0 in known.rotations_deg else None
        gain = float(np.mean(merits < known.now_merits[some]))
        return Chances(len(some), float(best[known.best]), current, gain)


def estimate_states(drive: Drive, torques: Sequence[float], rig: Rig, *, traced: bool = False) -> int:
    """Number of states that advice from trials is worth, about, for a progress bar; traced: with traces."""
    models = 1 + len(drive.alternatives)
    draws = FULL.traced_draws if traced else FULL.draws
    return len(_torques(torques, rig)) * models * (STATES + draws * WORLD_STATES)


def advise_from_trials(
    drive: Drive,
    torques: Sequence[float],
    trials: Sequence[Trial],
    rig: Rig,
    *,
    outcome: Trial | None = None,
    criterion: str = "expected",
    weights: Sequence[float] | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> TrialAdvice:
    """Infer the cam offset from trials and choose the position of the fixed wheel.

    Arguments: torques [N*m] that decide; trials, measured on the rig; outcome, measured in one more position, to be
    compared with its prediction; the others as in offset_prior and posterior. Raises what those do, UsageError too
    where only forbidden positions are left.
    """
    Criterion.of(criterion)  # wrong before anything is computed
    rig.require_sound()
    require_weights(weights, len(torques))
    positions = trial_positions(drive.mounting.holes, drive.mounting.allowed)
    if not positions:
        raise UsageError("no position of the seat is allowed", "mounting.allowed lists the usable holes")
    prior = offset_prior(
        drive,
        _torques(torques, rig),
        reseat=rig.reseat_um > 0,
        trials=trials,
        rig=rig,
        seed=seed,
        executor=executor,
        progress=progress,
    )
    known = posterior(prior, trials, rig, positions, criterion=criterion, deciding=len(torques), weights=weights)
    compared = None if outcome is None else verify(known, outcome)
    return TrialAdvice(drive, known, known.next_trial(seed), compared)


def _torques(torques: Sequence[float], rig: Rig) -> list[float]:
    return [*torques, *([] if rig.M_g in torques else [rig.M_g])]
