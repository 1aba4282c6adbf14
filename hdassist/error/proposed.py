"""F'_ior of very many drives that differ in their deviations alone: a table proposes where, states prove how much.

The table of the error (table.py) is good to some tenths of an arc second, enough to tell where on the torus of tooth
positions (search.py) the extremes may be. There states are solved: one on each hill that may be the highest, as far as
the table missed the others; then around those that are near the highest, as long as a neighbour is higher. So an
extreme is a state of the cycle, solved and proven, higher than all around it. That no hill was overlooked is not
proven; `python -m benchmarks.tolerance` compares with every state of random drives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from hdassist.error.cycle import place
from hdassist.error.search import lattice
from hdassist.error.table import ErrorTable
from hdassist.model.contacts import StateGaps
from hdassist.model.deviations import scalars_of
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics, pitch_locked_states
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.formulation import Formulation
from hdassist.solve.loadcase import LoadCase

Indices = NDArray[np.int64]

READ = 40  # positions of each wheel at which the error is estimated, at most
BLOCK = 4  # of them, of each wheel, of which the highest one is a hill
HILLS = 40  # of a drive that are looked at, at most
FIRST = 3  # of them that are solved whatever the table says of the others
SPREADS = 3.0  # standard deviations of what the table misses that a hill may be higher
SPREAD = 0.005  # of F'_ior: what the table is taken to miss at least
NEAR = 0.02  # of F'_ior: a hill whose first state is no further below the highest is climbed
LEAST = 4.0  # arcsec: F'_ior that both are taken of at least
STRIDE = 2  # steps to the states of the first look around


@dataclass(frozen=True)
class Batch:
    """Drives that differ in their deviations alone: a drive, and values of its fields by path, shape (drives,) each."""

    drive: Drive
    columns: Mapping[str, Array]

    @classmethod
    def of(cls, drive: Drive) -> Batch:
        """A drive alone."""
        return cls(drive, {"tolerances.F_i1": np.array([drive.number("tolerances.F_i1")])})

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def take(self, rows: Indices) -> Batch:
        """The drives in some rows."""
        return Batch(self.drive, {path: column[rows] for path, column in self.columns.items()})

    def scalars(self, row: Indices, alpha_g: Array, alpha_b: Array) -> Array:
        """Scalars [mm] of the drives in some rows, where their wheels stand so [rad]; shapes broadcast."""
        number, columns = self.drive.number, self.columns

        def value(path: str) -> Array | float:
            return columns[path][row] if path in columns else number(path)

        return scalars_of(value, self.drive.mounting.mark_kind, alpha_g, alpha_b)


@dataclass(frozen=True)
class ManyExtremes:
    """F'_ior of drives [arcsec], and the states j of the greatest and of the least rotation, shape (drives,) each."""

    F_ior_arcsec: Array
    at_max: Indices
    at_min: Indices
    certificate: Certificate


class ProposedSearch:
    """The search for extremes of many drives at one torque, led by estimates of their error.

    Arguments: drive, what they have in common; M_g, the torque [N*m]; formulation, of the contact system that they
    share; like, a load case to start from.
    """

    def __init__(self, drive: Drive, M_g: float, formulation: Formulation, like: LoadCase | None = None) -> None:
        self.M_g = M_g
        # never solves a state: every search starts from it alike and so gives the same digits
        self.fresh = LoadCase(formulation, M_g, like=like)
        kinematics = Kinematics.of(drive)
        self.states = pitch_locked_states(kinematics)
        self.board, self.finest = lattice(kinematics)

    @cached_property
    def points(self) -> Indices:
        """Points of the torus at which the error is estimated, shape (k, l, 2)."""
        lines = [
            np.linspace(0, z, max(min(READ, z // 2) // BLOCK, 1) * BLOCK, endpoint=False).astype(np.int64)
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

    def estimates(self, table: ErrorTable, batch: Batch) -> Array:
        """Rotation [arcsec] of drives as a table that spans their deviations has it, shape (drives, k, l).

        The table's contact system may differ a little from theirs.
        """
        points = self.state(self.points)
        there = self.states.take(points.ravel())
        # one by one, so that arrays stay in the cache
        rows = (np.array([row]) for row in range(len(batch)))
        found = [table.rotation(batch.scalars(row, there.alpha_g, there.alpha_b)) for row in rows]
        return np.reshape(found, (len(batch), *points.shape))

    def extremes(self, batch: Batch, estimates: Array) -> ManyExtremes:
        """Extremes of drives, solved and proven.

        Arguments: batch, the drives; estimates of their rotation [arcsec] at the points, shape (drives, k, l). Raises
        UntrustedError where an answer cannot be trusted.
        """
        case = LoadCase(self.fresh.formulation, self.M_g, like=self.fresh, many=True)
        solved = _Solved(self, batch, case)
        solved.climb(solved.promising(_hills(estimates, self)))
        value, rows = solved.value, np.arange(len(batch))
        at_max, at_min = np.nanargmax(value, axis=1), np.nanargmin(value, axis=1)
        return ManyExtremes(value[rows, at_max] - value[rows, at_min], at_max, at_min, solved.certificate)


@dataclass(frozen=True)
class _Hills:
    """Places that may be an extreme: row of the drive, sign of the extreme, point, shape (hills, 2), height [arcsec].

    rank: among those of its drive and sign.
    """

    row: Indices
    sign: Indices
    point: Indices
    height: Array
    rank: Indices

    def __getitem__(self, chosen: NDArray[np.bool_]) -> _Hills:
        return _Hills(**{f.name: getattr(self, f.name)[chosen] for f in fields(self)})

    def highest(self, value: Array, drives: int) -> Array:
        """Greatest of the values of each drive and sign, for each hill, shape (hills,)."""
        best = np.full((drives, 2), -np.inf)
        side = (self.sign > 0).astype(int)
        np.fmax.at(best, (self.row, side), value)
        return np.asarray(best[self.row, side])


def _hills(maps: Array, search: ProposedSearch) -> _Hills:
    """The highest point of each block of maps, shape (drives, k, l), and of what is upside down.

    Between the points of a map they lie where a parabola through their neighbours has its top.
    """
    n, *across = maps.shape
    blocks = [count // BLOCK for count in across]
    step = np.array(search.board.shape) / across
    found = []
    for sign in (1, -1):
        up = sign * maps
        tiles = up.reshape(n, blocks[0], BLOCK, blocks[1], BLOCK).swapaxes(2, 3).reshape(n, -1, BLOCK**2)
        row, tile = (axis.ravel() for axis in np.indices(tiles.shape[:2]))
        at = np.stack(np.divmod(tile, blocks[1])) * BLOCK + np.stack(np.divmod(tiles.argmax(axis=2).ravel(), BLOCK))
        here = up[row, at[0], at[1]]
        height, moved = here.copy(), at.astype(float)
        for axis in (0, 1):
            before, behind = (np.roll(up, way, 1 + axis)[row, at[0], at[1]] for way in (1, -1))
            bend = np.minimum(before + behind - 2 * here, -1e-12)
            shift = np.clip((before - behind) / (2 * bend), -0.5, 0.5)
            moved[axis] += shift
            height -= bend * shift**2 / 2
        order = np.lexsort((-height, row))
        rank = np.arange(len(order)) % tiles.shape[1]
        order, rank = order[rank < HILLS], rank[rank < HILLS]
        point = search.to_lattice(moved.T[order] * step)
        found.append(_Hills(row[order], np.full(len(order), sign), point, height[order], rank))
    both = {f.name: np.concatenate([getattr(hills, f.name) for hills in found]) for f in fields(_Hills)}
    return _Hills(**both)


class _Solved:
    """States of drives that are solved so far: value, the rotation [arcsec], shape (drives, states), NaN elsewhere."""

    def __init__(self, search: ProposedSearch, batch: Batch, case: LoadCase) -> None:
        self._search, self._batch, self._case = search, batch, case
        self.value = np.full((len(batch), len(search.states)), np.nan)
        self.certificate = EMPTY
        f = search.finest
        self._around = np.array([(0, 0), (1, 1), (f, 0), (1, -1), (0, -f), (-1, -1), (-f, 0), (-1, 1), (0, f)])

    def promising(self, hills: _Hills) -> _Hills:
        """Hills near the highest of their drive, after one state was solved on each that may be it."""
        drives = len(self._batch)
        # the first hill of each sign is the highest, the second upside down: their sum is F'_ior by the table
        scale = np.maximum(np.bincount(hills.row, np.where(hills.rank, 0, hills.height)), LEAST)
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

    def climb(self, hills: _Hills) -> None:
        """Solve what is around hills, and go on to the highest, until nothing around is higher."""
        row, sign, point = hills.row, hills.sign, hills.point
        stride = STRIDE
        while len(row):
            around = point[:, None] + stride * self._around
            value = sign[:, None] * self._at(row[:, None], around)
            best = value.argmax(axis=1)
            to = around[np.arange(len(row)), best]
            going = (best > 0) | (stride > 1)
            if stride > 1:
                to = self._search.to_lattice(point + stride * self._summit(value))
            row, sign, point, stride = row[going], sign[going], to[going], 1

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
            answers = self._case.solve(gaps, partial(place, states, self._search.M_g))
            self.value[rows, j] = answers.rotation_arcsec
            self.certificate += answers.certificate
        return np.asarray(self.value[row, state])

    def _summit(self, value: Array) -> Array:
        """Top of the parabola through values at the points around, shape (hills, 9), in strides from the middle.

        The highest of the points where the parabola has no top near them.
        """
        x, y = self._around.T.astype(float)
        _, p, q, xx, xy, yy = np.linalg.pinv(np.stack([np.ones(9), x, y, x * x, x * y, y * y], axis=1)) @ value.T
        det = 4 * xx * yy - xy * xy
        with np.errstate(divide="ignore", invalid="ignore"):
            top = np.stack([xy * q - 2 * yy * p, xy * p - 2 * xx * q], axis=1) / det[:, None]
        near = (xx < 0) & (det > 0) & (np.abs(top) <= 1.5 * self._search.finest).all(axis=1)
        return np.asarray(np.where(near[:, None], top, self._around[value.argmax(axis=1)]))
