"""The error over all tooth positions, at one torque: of a drive, or of many that differ in their deviations alone.

In state j each wheel stands j of its pitches on in the cam's frame, so the state is the point (j mod z_b, j mod z_g)
of a torus on which the error is continuous: neighbours there have nearly the same deviations, however far apart they
lie in the cycle. Of one drive every state is solved. Of very many, estimates of their error (a grid of states, or a
table, table.py) propose where the extremes may be, and states there prove how much they are: one on each hill that may
be the highest, as far as the estimates missed the others; then around those that are near the highest, as long as a
neighbour is higher. So an extreme is a state of the cycle, solved and proven, higher than all around it. That no hill
was overlooked is not proven; `python -m benchmarks.proposals` compares with every state of random drives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial

import numpy as np

from hdassist.error.cycle import kinematic_error, state_place
from hdassist.error.hills import HILL_BLOCK, Hills, Indices, hills_of, interpolated
from hdassist.errors import UsageError
from hdassist.model.contacts import StateGaps, contact_system
from hdassist.model.deviations import carried, scalars_of, waves_of
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics, States, pitch_locked_states
from hdassist.preset.fields import Drive
from hdassist.run.run import UNCHECKED
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.formulation import Formulation, formulate
from hdassist.solve.loadcase import LoadCase

READ = 40  # positions of each wheel at which estimates of the error are read, at most
GRID = 60  # positions of each wheel where they are solved, at most: 40 missed an island of 0.4 arcsec
DIFFERENCES = 15  # positions of each wheel at which drives that are alike are compared, at least
FIRST = 3  # of them that are solved whatever the table says of the others
SPREADS = 3.0  # standard deviations of what the table misses that a hill may be higher
SPREAD = 0.005  # of F'_ior: what the table is taken to miss at least
NEAR = 0.02  # of F'_ior: a hill whose first state is no further below the highest is climbed
STILL_NEAR = 0.01  # of F'_ior: so near it has to be once the states around it are known
SEARCH_REACH = 5  # steps from an extreme, along each wheel, within which nothing is higher
LEAST_F_IOR = 4.0  # arcsec: F'_ior that both are taken of at least
STRIDES = 2, 4  # steps to the states of the first look around: on a grid of READ positions or more, on a coarser one
SHORT_CYCLE = 4000  # states of a cycle below which all are solved
MAP_STATES = 8192  # states of a grid, about, whose gaps are held at once
SEARCHED = 3800  # states that proposals solve of a drive, about


@dataclass(frozen=True)
class Batch:
    """Drives that differ in their deviations alone: a drive, and values of its fields by path, shape (drives,) each."""

    drive: Drive
    columns: Mapping[str, Array]
    _waves: dict[tuple[int, str, int], Array] = field(default_factory=dict, compare=False)  # once they were asked for

    @classmethod
    def of(cls, drive: Drive) -> Batch:
        """A drive alone."""
        return cls(drive, {"tolerances.F_i1": np.array([drive.number("tolerances.F_i1")])})

    @classmethod
    def turned(cls, drive: Drive, rotations_deg: Sequence[float]) -> Batch:
        """A drive with its fixed wheel turned on its seat [deg], counter-clockwise seen from the cam side."""
        return cls(drive, {path: drive.number(path) + np.array(rotations_deg) for path in carried(drive)})

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def take(self, rows: Indices) -> Batch:
        """The drives in some rows."""
        return Batch(self.drive, {path: column[rows] for path, column in self.columns.items()})

    def scalars(self, row: Indices, alpha_g: Array, alpha_b: Array) -> Array:
        """Scalars [mm] of the drives in some rows, where their wheels stand so [rad]; shapes broadcast."""
        if not self._waves:
            columns, number = self.columns, self.drive.number
            waves = waves_of(lambda path: columns.get(path, number(path)), self.drive.mounting.mark_kind)
            self._waves.update({key: np.broadcast_to(wave, len(self)) for key, wave in waves.items()})
        return scalars_of({key: wave[row] for key, wave in self._waves.items()}, alpha_g, alpha_b)


@dataclass(frozen=True)
class Extremes:
    """F'_ior of drives [arcsec], and the states j of the greatest and of the least error, shape (drives,) each."""

    F_ior_arcsec: Array
    at_max: Indices
    at_min: Indices
    certificate: Certificate

    @property
    def first(self) -> float:
        """F'_ior of the first drive [arcsec]."""
        return float(self.F_ior_arcsec[0])


def searchable(drive: Drive) -> bool:
    """Whether the error is continuous on the torus: rolling balls do not come back with the wheels."""
    return drive.bearing.ball_motion == "locked"


class ErrorMap:
    """The error of drives that share a contact system, at one torque, over all tooth positions.

    Arguments: drive, what they have in common; M_g, the torque [N*m]; formulation of the contact system, where it is
    there already; like, a load case to start from. Raises UsageError for a drive with rolling balls.
    """

    def __init__(
        self, drive: Drive, M_g: float, formulation: Formulation | None = None, like: LoadCase | None = None
    ) -> None:
        if not searchable(drive):
            raise UsageError("with rolling balls every state has to be solved", "set bearing.ball_motion=locked")
        self.drive, self.M_g = drive, M_g
        # never solves a state: every answer starts from it alike and so gives the same digits
        self.fresh = LoadCase(formulation or formulate(contact_system(drive)), M_g, like=like)
        kinematics = Kinematics.of(drive)
        self.sign = kinematics.error_sign
        self.states, self.board, self.finest = _lattice(kinematics)

    def extremes(self, drive: Drive | None = None) -> Extremes:
        """Extremes of a drive, by default the map's own, from every state of its cycle.

        Raises UntrustedError where an answer cannot be trusted.
        """
        return every_state(drive or self.drive, self.M_g)

    def points(self, count: int = READ) -> Indices:
        """Points of the torus at which the error is estimated, at most so many around each wheel, shape (k, l, 2)."""
        lines = [
            np.linspace(0, z, max(min(count, z // 2) // HILL_BLOCK, 1) * HILL_BLOCK, endpoint=False).astype(np.int64)
            for z in self.board.shape
        ]
        return self.to_lattice(np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1))

    def to_lattice(self, point: Array) -> Indices:
        """The nearest points at which there is a state, shape (..., 2)."""
        near = np.rint(point).astype(np.int64)
        near[..., 1] += (self.finest - 1) * (near.sum(axis=-1) % 2)
        return np.asarray(near)

    def state(self, point: Indices) -> Indices:
        """States j at points, shape (..., 2)."""
        return np.asarray(self.board[tuple(np.moveaxis(point % self.board.shape, -1, 0))])

    def _hills(self, maps: Array) -> Hills:
        step = np.array(self.board.shape) / maps.shape[1:]
        return hills_of(maps, lambda place: self.to_lattice(place * step))

    def estimated_ranges(self, batch: Batch, grid: int) -> tuple[Array, Certificate]:
        """F'_ior [arcsec] of drives by the tops of parabolas through a grid of states, shape (drives,); their proof.

        Arguments: batch, the drives; grid, positions of each wheel. Raises UntrustedError where an answer cannot be
        trusted.
        """
        solved = _Solved(self, batch)
        return self._hills(solved.at_points(self.points(grid))).ranges, solved.certificate

    def solved_map(self, batch: Batch) -> Array:
        """Rotation [arcsec] of drives at the points of a grid, shape (drives, k, l).

        Raises UntrustedError where an answer cannot be trusted.
        """
        return _Solved(self, batch).at_points(self.points(GRID))

    def many_extremes(
        self, batch: Batch, estimates: Array | None = None, *, grid: int = GRID, alike: Array | None = None
    ) -> Extremes:
        """Extremes of drives, solved and proven where estimates propose them.

        Arguments: batch, the drives; estimates of their rotation [arcsec] at points of the map, shape (drives, k, l),
        by default solved at so many positions of each wheel (grid), and in every state of a short cycle; alike, the
        solved_map of drives with the same deviations and other parts, from which these differ less than from point to
        point: then the difference is solved on a coarse grid. Raises UntrustedError where an answer cannot be trusted.
        """
        solved = _Solved(self, batch)
        if estimates is None and len(self.states) < SHORT_CYCLE:
            solved.every_state()
        else:
            if alike is not None:
                estimates = solved.near(alike)
            coarse = estimates is None and grid < READ
            proposed = solved.at_points(self.points(grid)) if estimates is None else estimates
            if coarse:
                proposed = interpolated(proposed, self.points().shape[:2])
            hills = self._hills(proposed)
            scale = np.maximum(hills.ranges, LEAST_F_IOR)
            solved.climb(solved.promising(hills, scale), scale, STRIDES[coarse])
            solved.look_around()
        value, rows = self.sign * solved.value, np.arange(len(batch))
        at_max, at_min = np.nanargmax(value, axis=1), np.nanargmin(value, axis=1)
        return Extremes(value[rows, at_max] - value[rows, at_min], at_max, at_min, solved.certificate)


def every_state(drive: Drive, M_g: float) -> Extremes:
    """Extremes of a drive at a torque [N*m] from every state of its cycle.

    Raises UntrustedError where an answer cannot be trusted.
    """
    error = kinematic_error(drive, M_g, run=UNCHECKED)
    return Extremes(
        np.array([error.F_ior_arcsec]), np.array([error.at_max]), np.array([error.at_min]), error.certificate
    )


def extremes_of(drive: Drive, torques: Sequence[float]) -> list[Extremes]:
    """Extremes of one drive of many at torques [N*m], proposed by a grid of states, proven by states there.

    Every state is solved where the balls roll. Raises UntrustedError where an answer cannot be trusted.
    """
    if not searchable(drive):
        return [every_state(drive, M_g) for M_g in torques]
    return [each.many_extremes(Batch.of(drive)) for each in error_maps(drive, torques)]


def error_maps(drive: Drive, torques: Sequence[float]) -> list[ErrorMap]:
    """Maps of the error of a drive at torques [N*m], which share one contact system."""
    formulation = formulate(contact_system(drive))
    maps: list[ErrorMap] = []
    for M_g in torques:
        maps.append(ErrorMap(drive, M_g, formulation, maps[-1].fresh if maps else None))
    return maps


@lru_cache(maxsize=4)  # of drives that differ in their deviations alone it is the same
def _lattice(kinematics: Kinematics) -> tuple[States, Indices, int]:
    """States of the cycle; states j by their coordinates, shape (z_b, z_g), -1 where there is none; steps along each.

    Where both numbers of teeth are even, k and l of every state are both even or both odd: steps of two.
    """
    j = np.arange(kinematics.cycle_states)
    board = np.full((kinematics.z_b, kinematics.z_g), -1, dtype=np.int64)
    board[j % kinematics.z_b, j % kinematics.z_g] = j
    return pitch_locked_states(kinematics, j), board, 2 if board[0, 1] < 0 else 1


class _Solved:
    """States of drives that are solved so far: value, the rotation [arcsec], shape (drives, states), NaN elsewhere."""

    def __init__(self, search: ErrorMap, batch: Batch) -> None:
        self._search, self._batch = search, batch
        self._case = LoadCase(search.fresh.formulation, search.M_g, like=search.fresh, many=True)
        self.value = np.full((len(batch), len(search.states)), np.nan)
        self.certificate = EMPTY
        f = search.finest
        self._around = np.array([(0, 0), (1, 1), (f, 0), (1, -1), (0, -f), (-1, -1), (-f, 0), (-1, 1), (0, f)])

    def every_state(self) -> None:
        """Solve every state of the cycle."""
        self._at(np.arange(len(self._batch))[:, None], np.argwhere(self._search.board >= 0))

    def near(self, alike: Array) -> Array:
        """Rotation [arcsec] at the points of the map of drives that are alike, by its difference at some of them."""
        points, shape = self._search.points(GRID), alike.shape[1:]
        down, across = (
            max(step for step in (1, 2, 3, 4, 5) if n % step == 0 and n // step >= DIFFERENCES) for n in shape
        )
        return alike + interpolated(self.at_points(points[::down, ::across]) - alike[:, ::down, ::across], shape)

    def at_points(self, points: Indices) -> Array:
        """Rotation [arcsec] at the points of a grid, shape (k, l, 2), of all drives, shape (drives, k, l)."""
        there_and_back, drives = points.copy(), np.arange(len(self._batch))
        there_and_back[1::2] = points[1::2, ::-1]
        path = there_and_back.reshape(-1, 2)
        for rows in np.array_split(drives, 1 + len(drives) * len(path) // MAP_STATES):
            self._at(rows[:, None], path)
        return np.asarray(self.value[drives[:, None, None], self._search.state(points)])

    def promising(self, hills: Hills, scale: Array) -> Hills:
        """Hills near the highest of their drive, after one state was solved on each that may be it.

        Argument: scale, F'_ior of the drives as estimated [arcsec], shape (drives,).
        """
        drives = len(self._batch)
        chosen, known = hills.rank < FIRST, np.full(len(hills.row), np.nan)
        while len(fresh := np.flatnonzero(chosen & np.isnan(known))):
            known[fresh] = hills.sign[fresh] * self._at(hills.row[fresh], hills.point[fresh])
            seen = ~np.isnan(known)
            row, missed = hills.row[seen], (hills.sign * (known - hills.height))[seen]
            count = np.bincount(row, minlength=drives)
            mean = np.bincount(row, missed, minlength=drives) / count
            spread = np.sqrt(np.bincount(row, (missed - mean[row]) ** 2, minlength=drives) / count)
            may_be = hills.height + hills.sign * mean[hills.row]
            may_be += SPREADS * np.maximum(spread, SPREAD * scale)[hills.row]
            chosen = may_be > hills.highest(known, drives)
        with np.errstate(invalid="ignore"):
            return hills[known >= hills.highest(known, drives) - NEAR * scale[hills.row]]

    def climb(self, hills: Hills, scale: Array, stride: int) -> None:
        """Solve what is around hills, by strides that are halved, and go on until nothing around is higher.

        Argument: scale as that of promising.
        """
        while len(hills.row):
            around = hills.point[:, None] + stride * self._around
            value = hills.sign[:, None] * self._at(hills.row[:, None], around)
            best, height = value.argmax(axis=1), value.max(axis=1)
            to, going = around[np.arange(len(best)), best], best > 0
            if stride > 1:
                going = height >= hills.highest(height, len(scale)) - STILL_NEAR * scale[hills.row]
            hills, stride = replace(hills, point=to)[going], max(stride // 2, 1)

    def look_around(self) -> None:
        """Solve what is within REACH of each drive's extremes, until nothing there is higher.

        Along a crease, where contacts change, a state may be higher than its neighbours and yet not the highest one.
        """
        z_b, z_g = self._search.board.shape
        wide = np.stack(np.meshgrid(*[np.arange(-SEARCH_REACH, SEARCH_REACH + 1)] * 2), axis=-1)
        wide[::2] = wide[::2, ::-1].copy()  # there and back
        wide = wide[wide.sum(axis=2) % self._search.finest == 0]
        for sign in (1, -1):
            row = np.arange(len(self._batch))
            while len(row):
                top = np.nanargmax(sign * self.value[row], axis=1)
                self._at(row[:, None], np.stack([top % z_b, top % z_g], axis=-1)[:, None] + wide)
                row = row[np.nanargmax(sign * self.value[row], axis=1) != top]

    def _at(self, row: Indices, point: Indices) -> Array:
        """Rotation [arcsec] of drives at points, shape (..., 2), solved where that is not known yet."""
        row, state = np.broadcast_arrays(row, self._search.state(point))
        new = np.isnan(self.value[row, state])
        if new.any():
            places = row[new] * self.value.shape[1] + state[new]
            _, first = np.unique(places, return_index=True)
            rows, j = np.divmod(places[np.sort(first)], self.value.shape[1])  # in order: neighbours follow each other
            states = self._search.states.take(j)
            gaps = StateGaps(self._batch.scalars(rows, states.alpha_g, states.alpha_b))
            answers = self._case.solve(gaps, partial(state_place, states, self._search.M_g))
            self.value[rows, j] = answers.rotation_arcsec
            self.certificate += answers.certificate
        return np.asarray(self.value[row, state])
