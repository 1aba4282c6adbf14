"""Advice from trials: where to mount the fixed wheel when the direction of the cam offset is not known."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from hdassist.error.table import STATES
from hdassist.errors import UsageError
from hdassist.mounting.advice import Advice
from hdassist.mounting.positions import MountingCurve, Position, hole_of, phase_deg, rotated
from hdassist.mounting.robust import Criterion, Robust
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Progress
from hdassist.trials.posterior import NextTrial, Posterior, posterior, require_weights
from hdassist.trials.prior import STATES as WORLD_STATES
from hdassist.trials.prior import TRACED, WORLDS, offset_prior
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
        F_ior = self.known.expected_F_ior()[: self.known.deciding, place]
        return Position(rotation, self.phase(rotation), hole_of(rotation, self.drive.mounting.holes), tuple(F_ior))

    def phase(self, rotation_deg: float) -> float:
        """Phase [deg] of a rotation if the offset points where it most likely does."""
        return phase_deg(rotated(self._facing, rotation_deg))

    @property
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
    def as_advice(self) -> Advice:
        """The same as advice on a drive whose offset points where it most likely does, sampled from what is known."""
        known = self.known
        rotations, expected = np.array(known.rotations_deg), known.expected_F_ior()[: known.deciding]
        present = (known.now_arcsec @ known.weight)[: known.deciding]
        at_present = bool(len(rotations) and rotations[0] == 0)
        if not at_present:  # a position that must be left: it is shown all the same
            rotations, expected = np.append(0.0, rotations), np.column_stack([present, expected])
        mounting = self.drive.mounting
        curve = MountingCurve(
            torques=known.prior.torques[: known.deciding],
            rotation_deg=rotations,
            phase_deg=np.array([self.phase(float(rotation)) for rotation in rotations]),
            F_ior_arcsec=expected,
            certificate=known.prior.certificate,
            cross_checks=(),
            every_state=np.zeros(expected.shape, dtype=bool),
            holes=mounting.holes,
            allowed=None if mounting.allowed == "all" else mounting.allowed,
            weights=known.weights,
        )
        some = picked(known.weight, SAMPLES)
        sampled = FromTrials(
            known.criterion,
            tuple(range(len(rotations) - len(known.rotations_deg), len(rotations))),
            np.moveaxis(known.F_ior_arcsec[: known.deciding][:, some], 0, 1),
            known.merits[some],
            known.now_merits[some],
            0,
            known.prior.certificate,
            tuple(known.prior.standard_error_arcsec[: known.deciding]),
            order=tuple(self.ranked),
        )
        drive = self._facing
        if not known.pointed:  # no direction to draw
            drive = drive.with_values({OffsetNames.of(drive).size: 0.0})
        return AdviceFromTrials(drive, curve, sampled, (), (), ())


@dataclass(frozen=True)
class FromTrials(Robust):
    """Samples of what is known after trials, whose choice is made; order: the positions, best first."""

    order: tuple[int, ...] = (0,)

    @property
    def best(self) -> int:
        """Which of the positions is the choice."""
        return self.order[0]


@dataclass(frozen=True)
class AdviceFromTrials(Advice):
    """Advice whose choice stands: after trials the wheel lies elsewhere, and leaving it is no choice."""

    @property
    def worth_turning(self) -> bool:
        """Whether the choice is another position than the first one."""
        return bool(self.chosen.rotation_deg)

    @property
    def ranked(self) -> list[Position]:
        """The positions by the criterion that decides, best first, as the report has them."""
        sampled = self.robust
        assert isinstance(sampled, FromTrials)
        return [self.curve.at(sampled.places[place]) for place in sampled.order]


def work(drive: Drive, torques: Sequence[float], rig: Rig, *, traced: bool = False) -> int:
    """Number of states that advice from trials is worth, about, for a progress bar; traced: with traces."""
    models = 1 + len(drive.alternatives)
    return len(_torques(torques, rig)) * models * (STATES + (TRACED if traced else WORLDS) * WORLD_STATES)


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
