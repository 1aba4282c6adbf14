"""Where to mount the fixed wheel: the curve, what is uncertain about it, and the position to choose."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from hdassist.error.cycle import kinematic_error
from hdassist.error.error_map import SEARCHED, searchable
from hdassist.error.sensitivity import Sensitivity, sensitivity
from hdassist.errors import UsageError
from hdassist.model.deviations import standing_offset
from hdassist.model.unknown import Unknown, no_hole_better, unknown_turn, unknowns
from hdassist.model.wheels import MeasuredTeeth
from hdassist.mounting.curve import FREE_POSITIONS, Alternative, alternatives, curve_states, mounting_curve
from hdassist.mounting.losses import Criterion, Losses
from hdassist.mounting.positions import Choice, MountingCurve, Position, rotated
from hdassist.mounting.robust import LEAST_PROBABILITY, is_open, robust, sample_states
from hdassist.mounting.stays import Stays, stays_best
from hdassist.preset.fields import Drive
from hdassist.solve.answers import Progress
from hdassist.solve.throughcvxpy import CROSS_SOLVER

LEAST_GAIN = 0.01  # of the error: a smaller one is not worth a turn
TRIALS = 3  # positions to begin trials with

Order = Literal["turn", "leave", "none"]


@dataclass(frozen=True)
class Advice:
    """Advice on one drive.

    robust: the positions over what is uncertain or not known, None without any of it, or where it was not sampled;
    others: the best position under each of the preset's alternatives; now and best: what a micrometre does where the
    wheel stands and at the chosen position, one for each torque, empty where it cannot be had; measured: wheels in
    place of first harmonics, for which there is the curve alone; unknown: deviations that are not known; rests_on:
    assumptions that the choice hinges on most; needed: probability of a gain for which a turn is ordered.
    """

    drive: Drive
    curve: MountingCurve
    robust: Losses | None
    others: tuple[Alternative, ...]
    now: tuple[Sensitivity, ...]
    best: tuple[Sensitivity, ...]
    measured: MeasuredTeeth | None = None
    unknown: tuple[Unknown, ...] = ()
    rests_on: tuple[Stays, ...] = ()
    needed: float = LEAST_PROBABILITY

    @property
    def chosen(self) -> Position:
        """The position to choose."""
        if not self.robust:
            return self.curve.recommended
        return self.curve.at(int(np.flatnonzero(self.curve.usable)[self.robust.best]))

    @property
    def gain(self) -> float:
        """What the chosen position takes off the error of the present one, as a share, for the torque served worst."""
        return self.robust.gain if self.robust else -self.chosen.change_from(self.curve.current)

    @property
    def any_hole(self) -> bool:
        """Whether nothing is known of the direction that decides: any hole may then be the best one."""
        return bool(self.unknown and self.deciding and not self.no_hole_better)

    @property
    def no_hole_better(self) -> str:
        """Why any hole is as good as any other, as model.unknown has it; empty where one may be better."""
        found = no_hole_better(self.drive)
        return "" if found == "turning" and self.measured and self.measured.fixed(self.drive) else found

    @property
    def deciding(self) -> tuple[str, ...]:
        """Directions that decide, and are not known at all."""
        return unknown_turn(self.drive)

    @property
    def has_curve(self) -> bool:
        """Whether the curve means anything: without the size of the offset that stands still it is flat."""
        size = "tolerances.e_hb" if self.drive.mounting.fixed == "rigid" else "tolerances.e_hg"
        return not self.any_hole or self.drive.value(size) is not None

    @property
    def order(self) -> Order:
        """What is ordered: to turn the wheel, to leave it; or nothing, where what is not known could reverse it.

        A turn is ordered where it gains more than LEAST_GAIN with the probability that is needed; a forbidden position
        is always left.
        """
        if not self.curve.usable[0] and self.no_hole_better:
            return "turn"
        if self.no_hole_better:
            return "leave"
        if self.any_hole or (self.unknown and not self.robust):
            return "none"
        if self.chosen == self.curve.current:
            return "leave"
        if not self.curve.usable[0]:
            return "turn"
        if self.gain <= LEAST_GAIN:
            return "leave"
        return "none" if self.robust and self.robust.probability_gain < self.needed else "turn"

    @property
    def to_measure(self) -> tuple[Position, ...]:
        """Usable positions, three that lie apart as far as they can, in which trials would tell."""
        usable = sorted(self.choice.ranked, key=lambda p: p.rotation_deg)
        wanted = [120.0 * k for k in range(TRIALS)]
        near = [min(usable, key=lambda p: abs((p.rotation_deg - at + 180) % 360 - 180)) for at in wanted]
        return tuple({p.rotation_deg: p for p in near}.values())

    @property
    def worth_turning(self) -> bool:
        """Whether a turn is ordered."""
        return self.order == "turn"

    @property
    def choice(self) -> Choice:
        """The chosen position beside the others; where they were sampled, with the F'_ior expected over the samples."""
        curve, turn = self.curve, self.worth_turning
        if not self.robust:
            return Choice(self.drive, curve.torques, curve.current, self.chosen, turn, tuple(curve.ranked))
        found = self.robust.choice(self.drive, self.drive.number(standing_offset(self.drive)[1]))
        return replace(found, torques=curve.torques, turn=turn)

    @property
    def disagreeing(self) -> tuple[Alternative, ...]:
        """Alternatives whose best position is more than a hole from the chosen one."""
        hole = 360 / (self.drive.mounting.holes or FREE_POSITIONS)
        return tuple(o for o in self.others if _apart(o.recommended, self.chosen) > hole + 1e-9)


def estimate_states(
    drive: Drive,
    torques: Sequence[float],
    rotations: Sequence[float],
    *,
    every_state: bool,
    samples: int,
    measured: MeasuredTeeth | None = None,
) -> int:
    """Number of states that an advice solves, about, for a progress bar."""
    curve = curve_states(drive, torques, rotations, every_state=every_state, measured=measured)
    if measured or not searchable(drive) or unknown_turn(drive):
        return curve
    others = SEARCHED * len(drive.alternatives) * (drive.mounting.holes or FREE_POSITIONS)
    return curve + len(torques) * (others + sample_states(drive, samples, len(rotations) + 1))


def advise(
    drive: Drive,
    torques: Sequence[float],
    rotations_deg: Sequence[float],
    *,
    measured: MeasuredTeeth | None = None,
    every_state: bool = False,
    weights: Sequence[float] | None = None,
    samples: int = 256,
    criterion: str = "expected",
    needed: float = LEAST_PROBABILITY,
    cross_check: str | None = CROSS_SOLVER,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Advice:
    """Find the position in which to mount the fixed wheel of a drive.

    Arguments: torques [N*m]; rotations_deg, positions to try [deg], 0 first, where the wheel stands; measured, wheels
    in place of first harmonics; every_state, solve all states instead of searching; weights of the torques, one each;
    samples of what is not known or has an uncertainty, and the criterion that chooses among positions in them:
    expected, worst or quantile:Q; needed, probability of a gain for which a turn is ordered; cross_check, solver of
    some states again; seed of samples and of those states; executor, to spread the work over (the numbers do not depend
    on it); progress, told how many states were solved. An
    interrupt ends the work early: the advice has what was done. Raises UsageError for positions, weights or a criterion
    that cannot be meant, and for samples of a drive with measured teeth; UntrustedError where an answer cannot be
    trusted.
    """
    Criterion.of(criterion)  # wrong before anything is computed, and without uncertainties too
    if measured and drive.uncertainty and samples:
        raise UsageError(
            "with measured teeth what the preset has as uncertain is not sampled: "
            "each sample would take every state at every position",
            "--samples 0 advises without the uncertainty",
        )
    curve = mounting_curve(
        drive,
        torques,
        rotations_deg,
        measured=measured,
        every_state=every_state,
        weights=weights,
        cross_check=cross_check,
        seed=seed,
        executor=executor,
        progress=progress,
    )
    unknown = unknowns(measured.without_harmonics(drive) if measured else drive)
    if curve.interrupted or measured or unknown_turn(drive):
        return Advice(drive, curve, None, (), (), (), measured, unknown, needed=needed)
    sampled = None
    if is_open(drive) and samples and searchable(drive):
        sampled = robust(
            drive, curve, samples=samples, criterion=criterion, seed=seed, executor=executor, progress=progress
        )
    others = tuple(alternatives(drive, torques, executor=executor, progress=progress))
    chosen = Advice(drive, curve, sampled, others, (), ()).chosen
    here, there = _slopes(drive, torques, (curve.current, chosen), executor)
    held = stays_best(drive, curve, chosen, executor=executor, progress=progress)
    return Advice(drive, curve, sampled, others, here, there, None, unknown, held, needed)


def _slopes(
    drive: Drive,
    torques: Sequence[float],
    positions: Sequence[Position],
    executor: Executor | None,
) -> list[tuple[Sensitivity, ...]]:
    if not searchable(drive):
        return [() for _ in positions]
    turned = [rotated(drive, position.rotation_deg) for position in positions]
    return list((executor.map if executor else map)(partial(_sensitivity, torques), turned))


def _sensitivity(torques: Sequence[float], drive: Drive) -> tuple[Sensitivity, ...]:
    return sensitivity(drive, [kinematic_error(drive, M_g, cross_check=None) for M_g in torques])


def _apart(one: Position, other: Position) -> float:
    return abs((one.phase_deg - other.phase_deg + 180) % 360 - 180)
