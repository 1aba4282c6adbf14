"""The error over all tooth positions, at one torque: of a drive, or of many that differ in their deviations alone.

In state j each wheel stands j of its pitches on in the cam's frame, so the state is the point (j mod z_b, j mod z_g)
of a torus on which the error is continuous: neighbours there have nearly the same deviations, however far apart they
lie in the cycle. Of one drive every state is solved. Of very many, a grid of states proposes where the extremes may
be, the hills of the map, and states there prove how much they are: one on each hill that may be the highest; then
around those that are near the highest, as long as a neighbour is higher. So an extreme is a state of the cycle, solved
and proven, higher than all around it. That no hill was overlooked is not proven; `python -m benchmarks.proposals`
compares with every state of random drives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from hdassist.error.cycle import kinematic_error, state_place
from hdassist.errors import UsageError
from hdassist.model.contacts import StateGaps, contact_system
from hdassist.model.deviations import Waves, carried, scalars_of, waves_of
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics, States, pitch_locked_states
from hdassist.preset.fields import Drive
from hdassist.run.run import UNCHECKED
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.formulation import Formulation, formulate
from hdassist.solve.loadcase import LoadCase

Indices = NDArray[np.int64]

LEAST_F_IOR = 4.0  # arcsec: F'_ior of which shares are taken, at least


@dataclass(frozen=True)
class Hills:
    """Points that may be an extreme: row of the drive, sign of the extreme, point, shape (hills, 2), height [arcsec].

    Height is that of the error upside down where the sign is negative.
    """

    row: Indices
    sign: Indices
    point: Indices
    height: Array

    def __len__(self) -> int:
        return len(self.row)

    def __getitem__(self, chosen: NDArray[np.bool_]) -> Hills:
        return Hills(self.row[chosen], self.sign[chosen], self.point[chosen], self.height[chosen])

    def and_these(self, others: Hills) -> Hills:
        """These and others."""
        return Hills(*(np.concatenate(both) for both in zip(vars(self).values(), vars(others).values(), strict=True)))

    @property
    def tops(self) -> Array:
        """Greatest height of each drive as it is, and of it upside down [arcsec], shape (drives, 2)."""
        best = np.full((self.row.max(initial=0) + 1, 2), -np.inf)
        np.maximum.at(best, (self.row, self.sign // 2), self.height)  # column 0, or -1 upside down
        return best

    def near_top(self, share: float) -> Hills:
        """Those that are no more than a share of F'_ior below the highest one of their drive and sign."""
        tops = self.tops
        F_ior = np.maximum(tops.sum(axis=1), LEAST_F_IOR)
        return self[tops[self.row, self.sign // 2] - self.height <= share * F_ior[self.row]]


def hills_of(maps: Array, to_points: Callable[[Array], Indices], lower: Array | None = None) -> Hills:
    """Points of maps of the torus, shape (drives, k, l), with no higher one beside them, and of the map upside down.

    Between the points of a map they lie where a parabola through their neighbours has its top. Arguments: to_points,
    from places in a map, shape (hills, 2), to points at which there is a state; lower, maps that are turned upside down
    in place of these.
    """
    up = np.concatenate([maps, -(maps if lower is None else lower)])
    highest = up
    for axis in (1, 2):
        beside = np.maximum(np.roll(highest, 1, axis), np.roll(highest, -1, axis))
        highest = np.maximum(highest, beside)
    side, *at = np.nonzero(up >= highest)
    steps, k, l = np.arange(-1, 2), *(each[:, None] for each in at)
    patch = up[side[:, None, None], ((k + steps) % up.shape[1])[:, :, None], ((l + steps) % up.shape[2])[:, None]]
    height, place = patch[:, 1, 1].copy(), np.stack(at, axis=1).astype(float)
    for axis, (before, here, behind) in enumerate((patch[:, :, 1].T, patch[:, 1, :].T)):
        bend = np.minimum(before + behind - 2 * here, -1e-12)
        shift = np.clip((before - behind) / (2 * bend), -0.5, 0.5)
        place[:, axis] += shift
        height -= bend * shift**2 / 2
    upside_down, row = np.divmod(side, len(maps))
    return Hills(row, 1 - 2 * upside_down, to_points(place), height)


def there_and_back(shape: tuple[int, ...]) -> Indices:
    """Flat places of a grid in an order in which each is next to the one before."""
    index = np.indices(shape).reshape(len(shape), -1)
    path = index.copy()
    for axis in range(1, len(shape)):
        back = path[:axis].sum(axis=0) % 2 == 1
        path[axis] = np.where(back, shape[axis] - 1 - index[axis], index[axis])
    return np.asarray(np.ravel_multi_index(tuple(path), shape))


def interpolated(maps: Array, shape: tuple[int, ...]) -> Array:
    """Maps of the torus, shape (n, k, l), between their points too by their Fourier series, shape (n, *shape)."""
    for axis, (points, more) in enumerate(zip(maps.shape[1:], shape, strict=True), 1):
        if more > points:
            waves = np.take(np.fft.rfft(maps, axis=axis), range((points + 1) // 2), axis=axis)
            maps = np.fft.irfft(waves, more, axis=axis) * (more / points)
    return maps


#


READ = 40  # positions of each wheel at which estimates of the error are read, at most
GRID = 60  # positions of each wheel where they are solved, at most: 40 missed an island of 0.4 arcsec
PROMISING = 0.06  # of F'_ior: one state is solved on a hill that is estimated no further below the highest
NEAR = 0.02  # of F'_ior: a hill whose first state is no further below the highest is climbed
STILL_NEAR = 0.01  # of F'_ior: so near it has to be once the states around it are known
SEARCH_REACH = 5  # steps from an extreme, along each wheel, within which no state is higher
STRIDES = 4, 2  # steps to the states of the first looks around, the first of them where the grid is coarser than READ
SHORT_CYCLE = 4000  # states of a cycle below which all are solved
SEARCHED = 3800  # states that proposals solve of a drive, about


@dataclass(frozen=True)
class Batch:
    """Drives that differ in their deviations alone: a drive, and values of its fields by path, shape (drives,) each."""

    drive: Drive
    columns: Mapping[str, Array]

    @classmethod
    def of(cls, drive: Drive, count: int = 1) -> Batch:
        """A drive alone, or so many times."""
        return cls(drive, {"tolerances.F_i1": np.full(count, drive.number("tolerances.F_i1"))})

    @classmethod
    def turned(cls, drive: Drive, rotations_deg: Sequence[float] | Array) -> Batch:
        """A drive with its fixed wheel turned on its seat [deg], counter-clockwise seen from the cam side."""
        return cls(drive, {path: drive.number(path) + np.array(rotations_deg) for path in carried(drive)})

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def take(self, rows: Indices) -> Batch:
        """The drives in some rows."""
        return Batch(self.drive, {path: column[rows] for path, column in self.columns.items()})

    def scalars(self, row: Indices, alpha_g: Array, alpha_b: Array) -> Array:
        """Scalars [mm] of the drives in some rows, where their wheels stand so [rad]; shapes broadcast."""
        return scalars_of({key: wave[row] for key, wave in self._waves.items()}, alpha_g, alpha_b)

    def by_wheel(self, alpha_b: Array, alpha_g: Array) -> tuple[Array, Array]:
        """Parts of the scalars [mm] of states by the angle [rad] of each wheel, shape (drives, angles, scalars) both.

        What turns with neither wheel is part of the first.
        """
        row, parts = np.arange(len(self))[:, None], []
        for part, alpha in (("b", alpha_b), ("g", alpha_g)):
            own = {key: wave[row] * ((key[1] == "g") == (part == "g")) for key, wave in self._waves.items()}
            parts.append(scalars_of(own, alpha[None], alpha[None]))
        return parts[0], parts[1]

    @cached_property
    def _waves(self) -> Waves:
        columns, number = self.columns, self.drive.number
        waves = waves_of(lambda path: columns.get(path, number(path)), self.drive.mounting.mark_kind)
        return {key: np.broadcast_to(wave, len(self)) for key, wave in waves.items()}


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

    Arguments: drive, all that they have in common; M_g, the torque [N*m]; formulation of the contact system, where it
    is there already; like, a load case to start from. Raises UsageError for a drive with rolling balls.
    """

    def __init__(
        self, drive: Drive, M_g: float, formulation: Formulation | None = None, like: LoadCase | None = None
    ) -> None:
        if not searchable(drive):
            raise UsageError(
                "this needs locked balls: of rolling ones every state has to be solved",
                "--set bearing.ball_motion=locked",
            )
        self.drive, self.M_g = drive, M_g
        # never solves a state: every answer starts from it alike and so gives the same digits
        self.fresh = LoadCase(formulation or formulate(contact_system(drive)), M_g, like=like)
        kinematics = Kinematics.of(drive)
        self.sign = kinematics.error_sign
        self.states, self.board, self.finest = _lattice(kinematics)

    def load_case(self) -> LoadCase:
        """The load case of the map's states, to solve some of them, in batches however small."""
        return LoadCase(self.fresh.formulation, self.M_g, like=self.fresh, many=True)

    def extremes(self, drive: Drive | None = None) -> Extremes:
        """Extremes of a drive, by default the map's own, from every state of its cycle.

        Raises UntrustedError where an answer cannot be trusted.
        """
        return every_state(drive or self.drive, self.M_g)

    def points(self, count: int) -> Indices:
        """Points of the torus at which the error is estimated, at most so many around each wheel, shape (k, l, 2)."""
        lines = [np.linspace(0, z, min(count, z // 2), endpoint=False).astype(np.int64) for z in self.board.shape]
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
        return self._hills(solved.at_points(self.points(grid))).tops.sum(axis=1), solved.certificate

    def many_extremes(self, batch: Batch, *, grid: int = GRID, short_cycle: int = SHORT_CYCLE) -> Extremes:
        """Extremes of drives, solved and proven where a grid of states proposes them; of a short cycle every state.

        Arguments: batch, the drives; grid, positions of each wheel that are solved first; short_cycle, states of a
        cycle below which all are solved. Raises UntrustedError where an answer cannot be trusted.
        """
        solved = _Solved(self, batch)
        if len(self.states) < short_cycle:
            solved.at(np.arange(len(batch))[:, None], np.argwhere(self.board >= 0))
        else:
            maps = interpolated(solved.at_points(self.points(grid)), self.points(max(grid, READ)).shape[:2])
            solved.climb(self._hills(maps), STRIDES if grid < READ else STRIDES[1:])
        tops = solved.tops()
        ends = self.state(tops.point).reshape(-1, 2)  # of the greatest and of the least rotation
        at_max, at_min = ends[:, :: self.sign].T
        return Extremes(np.asarray(np.bincount(tops.row, tops.height)), at_max, at_min, solved.certificate)


def every_state(drive: Drive, M_g: float) -> Extremes:
    """Extremes of a drive at a torque [N*m] from every state of its cycle.

    Raises UntrustedError where an answer cannot be trusted.
    """
    error = kinematic_error(drive, M_g, run=UNCHECKED)
    F_ior, at_max, at_min = (np.array([each]) for each in (error.F_ior_arcsec, error.at_max, error.at_min))
    return Extremes(F_ior, at_max, at_min, error.certificate)


def extremes_of(drive: Drive, torques: Sequence[float]) -> list[Extremes]:
    """Extremes of one drive of many at torques [N*m], proposed by a grid of states, proven by states there.

    Every state is solved where the balls roll. Raises UntrustedError where an answer cannot be trusted.
    """
    if not searchable(drive):
        return [every_state(drive, M_g) for M_g in torques]
    return [each.many_extremes(Batch.of(drive)) for each in error_maps(drive, torques)]


def error_maps(drive: Drive, torques: Sequence[float]) -> list[ErrorMap]:
    """Maps of the error of a drive at torques [N*m], which share one contact system."""
    formulation, maps = formulate(contact_system(drive)), list[ErrorMap]()
    for M_g in torques:
        maps.append(ErrorMap(drive, M_g, formulation, maps[-1].fresh if maps else None))
    return maps


@lru_cache(maxsize=8)
def _window(reach: int, finest: int) -> Indices:
    """Steps from a state to those around it, at most so many along each wheel, shape (states, 2)."""
    steps = np.argwhere(np.ones((2 * reach + 1,) * 2)) - reach
    return np.asarray(steps[steps.sum(axis=1) % finest == 0])


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
        self._search, self._batch, self._case = search, batch, search.load_case()
        self.value = np.full((len(batch), len(search.states)), np.nan)
        self._solved = list[tuple[Indices, Indices]]()
        self.certificate = EMPTY

    def at_points(self, points: Indices) -> Array:
        """Rotation [arcsec] at the points of a grid, shape (k, l, 2), of all drives, shape (drives, k, l)."""
        self.at(
            np.arange(len(self._batch)), points.reshape(-1, 1, 2)[there_and_back(points.shape[:2])]
        )  # near ones of all drives together
        return np.asarray(self.value[:, self._search.state(points)])

    def at(self, row: Indices, point: Indices) -> Array:
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
            self._solved.append((rows, j))
            self.certificate += answers.certificate
        return np.asarray(self.value[row, state])

    def climb(self, hills: Hills, strides: Sequence[int]) -> None:
        """Solve states on hills that may be the highest of their drive, and around them, until none there is higher.

        At the end around the highest alone, but SEARCH_REACH steps far: along a crease, where contacts change, a state
        may be higher than its neighbours and yet not the highest one.
        """
        finest, hills = self._search.finest, hills.near_top(PROMISING)
        for stride, share in zip((0, *strides), (NEAR, STILL_NEAR, STILL_NEAR), strict=False):
            hills = self._highest(hills, stride * _window(1, finest)).near_top(share)
        for steps in (_window(finest, finest), _window(SEARCH_REACH, finest)):
            while len(hills):
                moved = self._highest(hills, steps)
                hills = moved[moved.height > hills.height]
            hills = self.tops()

    def _highest(self, hills: Hills, steps: Indices) -> Hills:
        """Hills at the highest of the states that are so many steps from them."""
        around = hills.point[:, None] + steps
        value = hills.sign[:, None] * self.at(hills.row[:, None], around)
        best, each = value.argmax(axis=1), np.arange(len(hills))
        return replace(hills, point=around[each, best], height=value[each, best])

    def tops(self) -> Hills:
        """The highest state of each drive, and the highest one upside down."""
        row, sign = np.repeat(np.arange(len(self._batch)), 2), np.tile([1, -1], len(self._batch))
        rows, states = map(np.concatenate, zip(*self._solved, strict=True))
        order, counts = np.lexsort((self.value[rows, states], rows)), np.bincount(rows)
        ends = np.cumsum(counts)
        state = states[order[np.stack([ends - 1, ends - counts], axis=1).ravel()]]
        return Hills(row, sign, state[:, None] % np.array(self._search.board.shape), sign * self.value[row, state])
