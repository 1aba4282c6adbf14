"""F'_ior against the mounting angle of the fixed wheel: what turning it on its seat brings.

Source: Lyuminarsky et al. 2019, Fig. 3, doi 10.18698/0536-1044-2019-11-3-8.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import product
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from hdassist.analysis.extremes import QUICK, SEARCHED, THOROUGH, CycleSearch, Effort, searchable, worth_searching
from hdassist.analysis.kinematic_error import CrossCheck, kinematic_error
from hdassist.analysis.sensitivity import SEARCHES
from hdassist.errors import UsageError
from hdassist.model.deviations import tooth_phases
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.preset.drive import Drive
from hdassist.preset.overrides import is_overridden
from hdassist.solve.answers import EMPTY, Certificate, Progress

SAMPLE = 1  # random states solved again at each position, besides those of the extremes
SEARCH_TOLERANCE = 0.01  # arcsec that a search may miss where every state is solved
GROUP = 6  # positions that one task searches
FREE_STEP = 5.0  # deg between positions where the seat has no holes
FREE_TOLERANCE = 0.3  # deg, of the bottom of a valley
FREE = 12  # positions tried under alternatives where the seat has no holes
PROVEN = 2  # positions where every state is solved

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Position:
    """The fixed wheel turned by rotation_deg from where it stands, and F'_ior [arcsec] there at each torque.

    phase_deg: direction of the fixed wheel's deviation from the cam offset that stands with it, in 0..360;
    hole: seat holes that it is turned by, None where that is no whole number of them.
    """

    rotation_deg: float
    phase_deg: float
    hole: int | None
    F_ior_arcsec: tuple[float, ...]

    @property
    def short_way_deg(self) -> float:
        """The same turn by the shorter way, in -180..180: negative is clockwise."""
        return self.rotation_deg - 360 if self.rotation_deg > 180 else self.rotation_deg


@dataclass(frozen=True)
class MountingCurve:
    """F'_ior over rotations of the fixed wheel.

    torques [N*m]; rotation_deg, shape (rotations,), counter-clockwise seen from the cam side, the present
    position first; phase_deg, the same positions as phases; F_ior_arcsec, shape (torques, rotations);
    every_state, same shape: where all states were solved, not searched; holes of the seat, 0 for a free angle;
    allowed: hole numbers that may be used, None for all; weights of the torques; missing: positions asked for that
    an interrupt left undone.
    """

    torques: tuple[float, ...]
    rotation_deg: Array
    phase_deg: Array
    F_ior_arcsec: Array
    certificate: Certificate
    cross_checks: tuple[CrossCheck, ...]
    every_state: NDArray[np.bool_]
    holes: int = 0
    allowed: tuple[int, ...] | None = None
    weights: tuple[float, ...] | None = None
    missing: int = 0
    interrupted: bool = False

    def at(self, place: int) -> Position:
        """One of the positions."""
        values = tuple(float(v) for v in self.F_ior_arcsec[:, place])
        rotation = float(self.rotation_deg[place])
        return Position(rotation, float(self.phase_deg[place]), hole_of(rotation, self.holes), values)

    @property
    def relative(self) -> Array:
        """Greatest over the torques of F'_ior against that of the present position, shape (rotations,).

        Each torque counts by its weight, the greatest weight being 1.
        """
        return merit(self.F_ior_arcsec, self.F_ior_arcsec[:, 0], self.weights)

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Which positions the wheel can be mounted in, shape (rotations,)."""
        if not self.holes:
            return np.ones(len(self.rotation_deg), dtype=bool)
        return np.array([_is_usable(hole_of(float(r), self.holes), self.allowed) for r in self.rotation_deg])

    @property
    def current(self) -> Position:
        """Where the wheel stands."""
        return self.at(0)

    @property
    def recommended(self) -> Position:
        """The usable position that is best for the torque it serves worst; the first of equals."""
        return self.at(self._ranked[0])

    @property
    def ranked(self) -> list[Position]:
        """The usable positions, best first."""
        return [self.at(place) for place in self._ranked]

    @property
    def worst(self) -> Position:
        """The usable position that is worst for some torque."""
        return self.at(self._ranked[-1])

    def extremes(self, torque: int) -> tuple[Position, Position]:
        """Best and worst position for one torque alone, by its place."""
        best, worst = self._extremes(torque)
        return self.at(best), self.at(worst)

    @property
    def decisive(self) -> set[int]:
        """Places of the present and of the recommended position."""
        return {0, self._ranked[0]}

    @property
    def _ranked(self) -> list[int]:
        """Places of the usable positions, best first."""
        places = np.flatnonzero(self.usable)
        return [int(p) for p in places[np.argsort(self.relative[places], kind="stable")]]

    def _extremes(self, torque: int) -> tuple[int, int]:
        values = self.F_ior_arcsec[torque]
        return int(np.argmin(values)), int(np.argmax(values))


def merit(F_ior: Array, now: Array, weights: Sequence[float] | None = None) -> Array:
    """Greatest over the torques of F'_ior against now, each counted by its weight; shape (...,).

    Arguments: F_ior, shape (torques, ...); now, shape (torques,).
    """
    share = np.ones(len(now)) if weights is None else np.array(weights) / max(weights)
    return np.asarray(np.max(np.moveaxis(F_ior, 0, -1) / now * share, axis=-1))


def hole_of(rotation_deg: float, holes: int) -> int | None:
    """Holes of a seat that a turn [deg] is, None where it is no whole number of them."""
    turned = rotation_deg * holes / 360
    return round(turned) if holes and abs(turned - round(turned)) < 1e-9 else None


def _is_usable(hole: int | None, allowed: tuple[int, ...] | None) -> bool:
    return hole is not None and (allowed is None or hole in allowed)


def seat_positions(drive: Drive) -> list[float]:
    """Turns of the fixed wheel [deg] to try, 0 first: the usable holes, or 5 degree steps where the angle is free."""
    holes = drive.mounting.holes
    if not holes:
        return [FREE_STEP * k for k in range(round(360 / FREE_STEP))]
    allowed = drive.mounting.allowed
    return [360 * k / holes for k in range(holes) if k == 0 or allowed == "all" or k in allowed]


def rotated(drive: Drive, rotation_deg: float) -> Drive:
    """The drive with its fixed wheel turned on its seat [deg], counter-clockwise seen from the cam side."""
    name = "xi_b" if drive.mounting.fixed == "rigid" else "xi_g"
    turned = {name: getattr(drive.phases, name) + rotation_deg}
    return drive.model_copy(update={"phases": drive.phases.model_copy(update=turned)})


def phase_deg(drive: Drive) -> float:
    """Direction of the fixed wheel's deviation from the cam offset that stands with it [deg], in 0..360."""
    xi_g, xi_b = np.degrees(tooth_phases(drive))
    rigid = drive.mounting.fixed == "rigid"
    phase = xi_b - drive.phases.phi_hb if rigid else xi_g - drive.phases.phi_hg
    return float(np.mod(round(float(phase), 9), 360.0))


def work(drive: Drive, torques: Sequence[float], rotations_deg: Sequence[float], *, every_state: bool) -> int:
    """Number of states that a mounting curve and its sensitivities solve, about, for a progress bar."""
    cycle = Kinematics.of(drive).cycle_states
    others = 2 * SEARCHES + len(drive.alternatives) * (drive.mounting.holes or FREE)
    slopes = others * SEARCHED if searchable(drive) else 0
    if every_state or not worth_searching(drive):
        return len(torques) * (len(rotations_deg) * cycle + slopes)
    return len(torques) * (len(rotations_deg) * SEARCHED + PROVEN * cycle + slopes)


def mounting_curve(
    drive: Drive,
    torques: Sequence[float],
    rotations_deg: Sequence[float],
    *,
    every_state: bool = False,
    weights: Sequence[float] | None = None,
    cross_check: str | None = "CLARABEL",
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> MountingCurve:
    """F'_ior over the full cycle at each torque [N*m] and each rotation [deg] of the fixed wheel.

    Extremes are searched for; where the wheel stands and at the recommended position every state is solved then,
    and should a search have missed more than SEARCH_TOLERANCE there, everywhere. An interrupt ends the work early:
    the curve has what was done, if the present position was.

    Where the seat has no holes, every valley of the curve is searched for its bottom and that position added.

    Arguments: rotations_deg, 0 first, which is where the wheel stands; every_state, solve all states of all
    positions; weights of the torques in the choice of the best position, one each; executor, to spread the work
    over (any concurrent.futures executor; the numbers do not depend on it); progress, told how many states were
    solved. Raises UsageError where the present position is not the first or weights are not one positive number a
    torque, UntrustedError where an answer cannot be trusted.
    """
    if not len(rotations_deg) or rotations_deg[0] != 0:
        raise UsageError("the first rotation must be 0, the present position")
    if weights is not None and (len(weights) != len(torques) or not all(0 < w < np.inf for w in weights)):
        raise UsageError(f"weights must be {len(torques)} positive numbers, one for each torque")
    job = _Job(drive, tuple(torques), np.array(rotations_deg, dtype=float), cross_check, seed, executor, progress)
    job.weights = None if weights is None else tuple(weights)
    if every_state or not worth_searching(drive):
        job.solve((t, r) for r in _coarse_first(len(rotations_deg)) for t in range(len(torques)))
    else:
        job.search()
    if not drive.mounting.holes and searchable(drive):
        job.refine()
    decisive = job.decisive()
    found = job.values.copy()
    job.solve(decisive)
    missed = max((abs(job.values[place] - found[place]) for place in decisive), default=0.0)
    if missed > SEARCH_TOLERANCE:
        job.solve(job.unsolved())
    return job.curve()


@dataclass(frozen=True)
class Alternative:
    """The best position under other values of identified fields that agree with the same targets."""

    values: dict[str, float]
    recommended: Position


def alternatives(
    drive: Drive, torques: Sequence[float], *, executor: Executor | None = None, progress: Progress | None = None
) -> list[Alternative]:
    """Best position under each of the preset's alternatives, in steps of a seat hole, or of 30 deg.

    Fields that were overridden keep their override. Arguments and errors as in mounting_curve.
    """
    count = drive.mounting.holes or FREE
    rotations = np.arange(count, dtype=float) * 360 / count
    found = []
    for given in drive.alternatives:
        values = {p: v for p, v in given.items() if not is_overridden(p, drive.origin.overrides)}
        job = _Job(drive.with_values(values), tuple(torques), rotations, None, 0, executor, progress)
        if searchable(drive):
            job.search(QUICK)  # which hole is asked, not how good it is
        else:
            job.solve(product(range(len(torques)), range(count)))
        found.append(Alternative(values, job.curve().recommended))
    return found


class _Job:
    """A mounting curve being made: values, shape (torques, rotations), NaN where nothing is known yet."""

    def __init__(
        self,
        drive: Drive,
        torques: tuple[float, ...],
        rotations: Array,
        cross_check: str | None,
        seed: int,
        executor: Executor | None,
        progress: Progress | None,
    ) -> None:
        self.drive, self.torques, self.rotations = drive, torques, rotations
        self.values = np.full((len(torques), len(rotations)), np.nan)
        self.solved = np.zeros(self.values.shape, dtype=bool)
        self._certificate, self._checks = EMPTY, list[CrossCheck]()
        self._cross_check, self._seed, self._executor, self._progress = cross_check, seed, executor, progress
        self._interrupted = False
        self.weights: tuple[float, ...] | None = None

    def search(self, effort: Effort = THOROUGH) -> None:
        """Search the extremes at every position."""
        order = _coarse_first(len(self.rotations))
        groups = [order[first : first + GROUP] for first in range(0, len(order), GROUP)]
        places = [(t, group) for group in groups for t in range(len(self.torques))]
        tasks = [(self.drive, self.torques[t], self.rotations[group], effort) for t, group in places]
        for (t, group), (values, proof) in zip(places, self._run(_searched, tasks), strict=False):
            self.values[t, group] = values
            self._take(proof)

    def refine(self) -> None:
        """Add the bottom of every valley of the curve."""
        if self._interrupted or len(self.rotations) < 3:
            return
        value = merit(self.values, self.values[:, 0], self.weights)
        step = 360 / len(self.rotations)
        valleys = np.flatnonzero((value <= np.roll(value, 1)) & (value <= np.roll(value, -1)))
        tasks = [
            (self.drive, self.torques, self.weights, tuple(self.values[:, 0]), self.rotations[k], step) for k in valleys
        ]
        for rotation, values, proof in self._run(_bottom, tasks):
            self.rotations = np.append(self.rotations, rotation)
            self.values = np.column_stack([self.values, values])
            self.solved = np.column_stack([self.solved, np.zeros(len(self.torques), dtype=bool)])
            self._take(proof)

    def solve(self, places: Iterable[tuple[int, int]]) -> None:
        """Solve every state at some places (torque, rotation)."""
        places = list(places)
        tasks = [
            (rotated(self.drive, self.rotations[r]), self.torques[t], self._cross_check, self._seed) for t, r in places
        ]
        for place, (value, proof, check) in zip(places, self._run(_solved, tasks), strict=False):
            self.values[place], self.solved[place] = value, True
            self._take(proof)
            self._checks += [check] if check else []

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
            phase_deg=np.array([phase_deg(rotated(self.drive, r)) for r in self.rotations[done]]),
            F_ior_arcsec=self.values[:, done],
            every_state=self.solved[:, done],
            holes=self.drive.mounting.holes,
            allowed=None if self.drive.mounting.allowed == "all" else self.drive.mounting.allowed,
            weights=self.weights,
            missing=int(np.count_nonzero(~done)),
            interrupted=self._interrupted,
            certificate=self._certificate,
            cross_checks=tuple(self._checks),
        )

    def _run(self, function: Callable[[_Task], _Result], tasks: list[_Task]) -> Iterator[_Result]:
        if self._interrupted:
            return
        try:
            yield from self._executor.map(function, tasks) if self._executor else map(function, tasks)
        except KeyboardInterrupt:
            self._interrupted = True

    def _take(self, proof: Certificate) -> None:
        self._certificate += proof
        if self._progress:
            self._progress(proof.states)


def _coarse_first(count: int) -> list[int]:
    """0 to count - 1 in an order that is spread out wherever it is cut off."""
    bits = max(count - 1, 1).bit_length()
    mirrored = (int(f"{n:0{bits}b}"[::-1], 2) for n in range(2**bits))
    return [n for n in mirrored if n < count]


def _searched(task: tuple[Drive, float, Array, Effort]) -> tuple[list[float], Certificate]:
    drive, M_g, rotations, effort = task
    search = CycleSearch(drive, M_g)
    found = [search.extremes(rotated(drive, rotation), effort) for rotation in rotations]
    return [f.F_ior_arcsec for f in found], sum((f.certificate for f in found), EMPTY)


_Valley = tuple[Drive, tuple[float, ...], tuple[float, ...] | None, tuple[float, ...], float, float]


def _bottom(task: _Valley) -> tuple[float, list[float], Certificate]:
    """Rotation [deg] at the bottom of a valley of the merit, F'_ior there at each torque."""
    drive, torques, weights, now, middle, step = task
    searches = [CycleSearch(drive, M_g) for M_g in torques]
    proofs: list[Certificate] = []

    def at(rotation: float) -> list[float]:
        found = [search.extremes(rotated(drive, rotation)) for search in searches]
        proofs.extend(f.certificate for f in found)
        return [f.F_ior_arcsec for f in found]

    answer = minimize_scalar(
        lambda rotation: float(merit(np.array(at(rotation)), np.array(now), weights)),
        bounds=(middle - step, middle + step),
        method="bounded",
        options={"xatol": FREE_TOLERANCE},
    )
    rotation = round(float(answer.x), 1)  # finer than anyone can turn a wheel
    return rotation % 360, at(rotation), sum(proofs, EMPTY)


def _solved(task: tuple[Drive, float, str | None, int]) -> tuple[float, Certificate, CrossCheck | None]:
    drive, M_g, cross_check, seed = task
    error = kinematic_error(drive, M_g, cross_check=cross_check, sample=SAMPLE, seed=seed)
    return error.F_ior_arcsec, error.certificate, error.cross_check
