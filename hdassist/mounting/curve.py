"""F'_ior over the positions of the fixed wheel, computed: searches, full cycles, processes, interrupts.

Source: Lyuminarsky et al. 2019, Fig. 3, doi 10.18698/0536-1044-2019-11-3-8.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from hdassist.error.cycle import KinematicError, cross_check_of, kinematic_error
from hdassist.error.error_map import SEARCHED, Batch, ErrorMap, searchable
from hdassist.errors import UsageError
from hdassist.model.contacts import contact_system
from hdassist.model.deviations import ToothDeviations
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.model.wheels import MeasuredTeeth
from hdassist.mounting.positions import MountingCurve, merit, phase_deg, require_weights, rotated
from hdassist.preset.fields import Drive
from hdassist.run.run import Run
from hdassist.run.stops import until_interrupted
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.formulation import formulate
from hdassist.solve.throughcvxpy import CrossCheck

SAMPLED_STATES = 1  # random states solved again at each position, besides those of the extremes
AGAIN = 12  # positions of which one task solves states again
SEARCH_TOLERANCE = 0.01  # arcsec that a search may miss where every state is solved
POSITIONS_A_TASK = 3  # positions that one task searches
FREE_TOLERANCE = 0.3  # deg, of the bottom of a valley
HOLES = 24  # positions of which every state is solved
PROVEN = 2  # positions where every state is solved

_Result = TypeVar("_Result")


def curve_states(
    drive: Drive,
    torques: Sequence[float],
    rotations_deg: Sequence[float],
    *,
    every_state: bool,
    measured: MeasuredTeeth | None = None,
    searched: bool = False,
) -> int:
    """Number of states that a mounting curve solves, about, for a progress bar; searched: even of few positions."""
    cycle = Kinematics.of(drive).cycle_states
    every_state = every_state or (len(rotations_deg) <= HOLES and not searched)
    if every_state or measured or not searchable(drive):
        return len(torques) * len(rotations_deg) * cycle
    return len(torques) * (len(rotations_deg) * SEARCHED + PROVEN * cycle)


def mounting_curve(
    drive: Drive,
    torques: Sequence[float],
    rotations_deg: Sequence[float],
    *,
    measured: MeasuredTeeth | None = None,
    every_state: bool = False,
    proposed_from: int | None = None,
    weights: Sequence[float] | None = None,
    run: Run = Run(),
) -> MountingCurve:
    """F'_ior over the full cycle at each torque [N*m] and each rotation [deg] of the fixed wheel.

    Of the holes of a seat every state is solved. Of more positions extremes are proposed by a grid of states and
    proven; where the wheel stands and at the recommended position every state is solved then, and should more than
    SEARCH_TOLERANCE have been missed there, everywhere. An interrupt ends the work early:
    the curve has what was done, if the present position was.

    Where the seat has no holes, every valley of the curve is searched for its bottom and that position added.

    The error of measured teeth is not continuous and so cannot be searched: then every state is solved everywhere, and
    no position is added.

    Arguments: rotations_deg, 0 first, which is where the wheel stands; measured, wheels in place of first harmonics;
    every_state, solve all states of all positions; proposed_from, positions from which on extremes are proposed
    (HOLES + 1); weights of the torques in the choice of the best position, one each. Raises UsageError where the
    present position is not the first or weights are not one positive number a torque, UntrustedError where an answer
    cannot be trusted.
    """
    if not len(rotations_deg) or rotations_deg[0] != 0:
        raise UsageError("the first rotation must be 0, the present position")
    require_weights(weights, len(torques))
    searched_from = HOLES + 1 if proposed_from is None else proposed_from
    job = _Job(
        drive, tuple(torques), np.array(rotations_deg, dtype=float), measured,
        None if weights is None else tuple(weights), run,
    )  # fmt: skip
    if every_state or measured or not searchable(drive) or len(rotations_deg) < searched_from:
        job.solve((t, r) for r in _coarse_first(len(rotations_deg)) for t in range(len(torques)))
    else:
        job.search()
    if not (drive.mounting.holes or measured) and searchable(drive):
        job.refine()
    decisive = job.decisive()
    found = job.values.copy()
    job.solve(decisive)
    missed = max((abs(job.values[place] - found[place]) for place in decisive), default=0.0)
    if missed > SEARCH_TOLERANCE:
        job.solve(job.unsolved())
    return job.curve()


@dataclass
class _Job:
    """A mounting curve being made: values, shape (torques, rotations), NaN where nothing is known yet.

    solved, same shape: where every state was solved; weights of the torques, one each; measured, wheels in place of
    first harmonics.
    """

    drive: Drive
    torques: tuple[float, ...]
    rotations: Array
    measured: MeasuredTeeth | None = None
    weights: tuple[float, ...] | None = None
    run: Run = Run()
    certificate: Certificate = EMPTY
    cross_checks: list[CrossCheck] = field(default_factory=list)
    interrupted: bool = False

    def __post_init__(self) -> None:
        self.values = np.full((len(self.torques), len(self.rotations)), np.nan)
        self.solved = np.zeros(self.values.shape, dtype=bool)

    def search(self) -> None:
        """Search the extremes at every position."""
        order = _coarse_first(len(self.rotations))
        groups = [order[first : first + POSITIONS_A_TASK] for first in range(0, len(order), POSITIONS_A_TASK)]
        tasks = [(self.drive, self.torques, self.rotations[group].tolist()) for group in groups]
        for group, (values, proof) in zip(groups, self._run(_searched, tasks), strict=False):
            self.values[:, group] = values
            self._take(proof)

    def refine(self) -> None:
        """Add the bottom of every valley of the curve."""
        if self.interrupted or len(self.rotations) < 3:
            return
        value = merit(self.values, self.values[:, 0], self.weights)
        step = 360 / len(self.rotations)
        valleys = np.flatnonzero((value <= np.roll(value, 1)) & (value <= np.roll(value, -1)))
        now = self.values[:, 0]
        tasks = [(self.drive, self.torques, self.weights, now, self.rotations[k], step) for k in valleys]
        for rotation, values, proof in self._run(_bottom, tasks):
            self.rotations = np.append(self.rotations, rotation)
            self.values = np.column_stack([self.values, values])
            self.solved = np.column_stack([self.solved, np.zeros(len(self.torques), dtype=bool)])
            self._take(proof)

    def solve(self, places: Iterable[tuple[int, int]]) -> None:
        """Solve every state at some places (torque, rotation)."""
        places, found = list(places), []
        drives = [_with_teeth(*self._there(self.rotations[r])) for _, r in places]
        tasks = [(*drive, self.torques[t], self.run.of_task) for drive, (t, _) in zip(drives, places, strict=True)]
        for place, drive, (value, error) in zip(places, drives, self._run(_solved, tasks), strict=False):
            self.values[place], self.solved[place] = value, True
            self._take(error.certificate)
            found.append((*drive, error))
        if self.run.cross_check:
            # by as few processes as need be: the import of cvxpy takes each of them most of a second, and much memory
            parts = [found[first : first + AGAIN] for first in range(0, len(found), AGAIN)]
            for checks in self._run(_again, [(part, self.run.of_task) for part in parts]):
                self.cross_checks += checks

    def _there(self, rotation: float) -> tuple[Drive, MeasuredTeeth | None]:
        """The drive and its measured wheels at a rotation [deg]."""
        drive = rotated(self.drive, rotation)
        return drive, self.measured and self.measured.rotated(drive, rotation)

    def unsolved(self) -> list[tuple[int, int]]:
        """Places (torque, rotation) where not every state was solved."""
        return [(int(t), int(r)) for t, r in np.argwhere(~self.solved)]

    def decisive(self) -> list[tuple[int, int]]:
        """Those of them on which the advice rests."""
        done = np.flatnonzero(~np.isnan(self.values).any(axis=0))
        rotations = {int(done[place]) for place in self.curve().decisive}
        return [(t, r) for t, r in self.unsolved() if r in rotations]

    def curve(self) -> MountingCurve:
        """What is known so far, at the positions that are known for all torques."""
        done = ~np.isnan(self.values).any(axis=0)
        if not done[0]:
            raise KeyboardInterrupt
        return MountingCurve(
            torques=self.torques,
            rotation_deg=self.rotations[done],
            phase_deg=np.array([phase_deg(*self._there(r)) for r in self.rotations[done]]),
            F_ior_arcsec=self.values[:, done],
            every_state=self.solved[:, done],
            holes=self.drive.mounting.holes,
            allowed=None if self.drive.mounting.allowed == "all" else self.drive.mounting.allowed,
            weights=self.weights,
            missing=int(np.count_nonzero(~done)),
            interrupted=self.interrupted,
            certificate=self.certificate,
            cross_checks=tuple(self.cross_checks),
        )

    def _run(self, function: Callable[..., _Result], tasks: Sequence[tuple[Any, ...]]) -> Iterator[_Result]:
        if self.interrupted or not tasks:
            return
        self.interrupted = yield from until_interrupted(self.run.map(function, *zip(*tasks, strict=True)))

    def _take(self, proof: Certificate) -> None:
        self.certificate += proof
        self.run.solved(proof.states)


def _coarse_first(count: int) -> list[int]:
    """0 to count - 1 in an order that is spread out wherever it is cut off."""
    bits = max(count - 1, 1).bit_length()
    return sorted(range(count), key=lambda n: f"{n:0{bits}b}"[::-1])


def _with_teeth(drive: Drive, measured: MeasuredTeeth | None) -> tuple[Drive, ToothDeviations | None]:
    return measured.in_drive(drive) if measured else (drive, None)


def _searched(drive: Drive, torques: Sequence[float], rotations: Sequence[float]) -> tuple[Array, Certificate]:
    """F'_ior [arcsec] of extremes that were proposed and proven, shape (torques, rotations)."""
    batch, formulation = Batch.turned(drive, rotations), formulate(contact_system(drive))
    found = [ErrorMap(drive, M_g, formulation).many_extremes(batch) for M_g in torques]
    return np.array([each.F_ior_arcsec for each in found]), sum((each.certificate for each in found), EMPTY)


def _bottom(
    drive: Drive,
    torques: tuple[float, ...],
    weights: tuple[float, ...] | None,
    now: Array,
    middle: float,
    step: float,
) -> tuple[float, Array, Certificate]:
    """Rotation [deg] at the bottom of a valley of the merit, F'_ior there at each torque."""
    proofs: list[Certificate] = []

    def at(rotation: float) -> Array:
        values, proof = _searched(drive, torques, [rotation])
        proofs.append(proof)
        return values[:, 0]

    from scipy.optimize import minimize_scalar  # holes need none of it

    answer = minimize_scalar(
        lambda rotation: float(merit(at(rotation), now, weights)),
        bounds=(middle - step, middle + step),
        method="bounded",
        options={"xatol": FREE_TOLERANCE},
    )
    rotation = round(float(answer.x), 1)  # finer than anyone can turn a wheel
    return rotation % 360, at(rotation), sum(proofs, EMPTY)


def _solved(drive: Drive, teeth: ToothDeviations | None, M_g: float, run: Run) -> tuple[float, KinematicError]:
    """F'_ior [arcsec], and the error at the states that another solver is to solve again, with the proof of all."""
    error = kinematic_error(drive, M_g, teeth=teeth, run=replace(run, progress=None, cross_check=None))
    return error.F_ior_arcsec, error.sampled(SAMPLED_STATES, run.seed)


def _again(solved: Sequence[tuple[Drive, ToothDeviations | None, KinematicError]], run: Run) -> list[CrossCheck]:
    return [cross_check_of(drive, error, teeth, run=run) for drive, teeth, error in solved]
