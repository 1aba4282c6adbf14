"""Extremes of drives that share a contact system, from few states with slopes.

A state gives, beside the rotation, its slopes by the scalars of the deviations. Three things propose hills: cubic
splines through a coarse grid of states with their slopes, on which what single teeth add lies by mean slopes, as they
turn the output nearly alike everywhere, what the tangents of those reach beyond, and crests where a mesh zone lets go
and the error jumps over its clearance, which the share of the zone shows from afar. From there solve/walk.py goes up.
The states that it finds are solved and proven once more, and are states of the cycle, so F'_ior can only be too small:
by how much of drives that were proposed by several grids, `python -m benchmarks.proposals` has, and of draws, of which
there are very many, by one, `python -m benchmarks.draws`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial, reduce

import numpy as np
from numpy.typing import NDArray

from hdassist.error.cycle import state_place
from hdassist.error.error_map import (
    Batch,
    ErrorMap,
    Extremes,
    Indices,
    error_maps,
    every_state,
    searchable,
    there_and_back,
)
from hdassist.model.contacts import StateGaps
from hdassist.model.deviations import SMOOTH_SCALARS
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.solve.answers import ARCSEC, EMPTY
from hdassist.solve.walk import Rules, Starts, Torus

# positions of each wheel in a grid: of draws odd, so that half a turn on, where the error is much alike, lies between
# them; islands of the error that one grid overlooks another one shows
DRAWN_GRIDS = (7,)
FINE_GRIDS = (9, 14, 19)
SHORT_CYCLE = 4000  # states of a cycle below which all are solved of one drive
_LEAST_F_IOR = 4.0  # arcsec: F'_ior of which shares are taken, at least
# times as many at which a spline is read; where orders beyond the fourth are added
SPLINE_POINTS = 4
_ROUGH_POINTS = 6
_STEEPEST = 1.5  # slope of a spline over that to the next state, at most: a crease would make it swing
_BEYOND = 0.25  # of what tangents reach beyond the spline, that a hill may have
_TRIED = 0.06  # of F'_ior: a hill is tried that may be no further below the highest state of the grid
_CLIMBED = 0.08  # of F'_ior: it is climbed where its first state is no further below the highest
_RADIUS = 0.5  # of a step of the grid: how far a climb looks around
# steps from the highest state found, where others look for another slope up
_DRAWN_RINGS = (8,)
_FINE_RINGS = (8, 4)
_BACK = 0.15  # of a step of the grid: so far before a crest a climb begins
_STEPS = 10  # of a climb at most
# that a drive takes at a torque, about, beside those of climbs
DRAWN_STATES = 70
FINE_STATES = 700
# arcsec that a state has to promise beyond the highest
_DRAWN_GAIN = 0.002
_FINE_GAIN = 0.0002


@dataclass(frozen=True)
class _Hills:
    """Points that may be an extreme: row of the drive, sign of the extreme, point, shape (hills, 2), height [arcsec].

    Height is that of the error upside down where the sign is negative. slope [arcsec/mm] of the rotation, shape (hills,
    scalars), where a state was solved there.
    """

    row: Indices
    sign: Indices
    point: Indices
    height: Array
    slope: Array

    def __len__(self) -> int:
        return len(self.row)

    def __getitem__(self, chosen: NDArray[np.bool_] | Indices) -> _Hills:
        return _Hills(*(each[chosen] for each in vars(self).values()))

    def and_these(self, others: _Hills) -> _Hills:
        """These and others."""
        return _Hills(*(np.concatenate(both) for both in zip(vars(self).values(), vars(others).values(), strict=True)))

    @property
    def tops(self) -> Array:
        """Greatest height of each drive as it is, and of it upside down [arcsec], shape (drives, 2)."""
        best = np.full((self.row.max(initial=0) + 1, 2), -np.inf)
        np.maximum.at(best, (self.row, self.sign // 2), self.height)  # column 0, or -1 upside down
        return best

    def near_top(self, share: float) -> _Hills:
        """Those that are no more than a share of F'_ior below the highest one of their drive and sign."""
        tops = self.tops
        F_ior = np.maximum(tops.sum(axis=1), _LEAST_F_IOR)
        return self[tops[self.row, self.sign // 2] - self.height <= share * F_ior[self.row]]


def _hills_of(up: Array, down: Array, to_points: Callable[[Array], Indices]) -> _Hills:
    """Points of maps of the torus, shape (drives, k, l), with no higher one beside them, of those upside down no lower.

    Between the points of a map they lie where a parabola through their neighbours has its top. Arguments: up, down,
    maps of what the error is at most and at least; to_points, from places in a map, shape (hills, 2), to points at
    which there is a state.
    """
    drives = len(up)
    up = np.concatenate([up, -down])
    highest = up
    for axis in (1, 2):
        beside = np.maximum(np.roll(highest, 1, axis), np.roll(highest, -1, axis))
        highest = np.maximum(highest, beside)
    side, *at = np.nonzero(up >= highest)
    steps, k, l = np.arange(-1, 2), *(each[:, None] for each in at)
    patch = up[side[:, None, None], ((k + steps) % up.shape[1])[:, :, None], ((l + steps) % up.shape[2])[:, None]]
    height = patch[:, 1, 1].copy()
    place = np.stack(at, axis=1).astype(float)
    for axis, (before, here, behind) in enumerate((patch[:, :, 1].T, patch[:, 1, :].T)):
        bend = np.minimum(before + behind - 2 * here, -1e-12)
        shift = np.clip((before - behind) / (2 * bend), -0.5, 0.5)
        place[:, axis] += shift
        height -= bend * shift**2 / 2
    upside_down, row = np.divmod(side, drives)
    return _Hills(
        row=row, sign=1 - 2 * upside_down, point=to_points(place), height=height, slope=np.empty((len(row), 0))
    )


def many_extremes(error_map: ErrorMap, batch: Batch, grids: tuple[int, ...] = FINE_GRIDS) -> Extremes:
    """Extremes of drives, few states of each; of a short cycle every state.

    Argument: grids that propose hills, of so many positions of each wheel. Raises UntrustedError where an answer cannot
    be trusted.
    """
    search = _Search(error_map, batch)
    return search.every() if len(error_map.states) < SHORT_CYCLE else search.extremes(grids)


def extremes_of(drive: Drive, torques: Sequence[float]) -> list[Extremes]:
    """Extremes of one drive of many at torques [N*m], by few states.

    Every state is solved where the balls roll. Raises UntrustedError where an answer cannot be trusted.
    """
    if not searchable(drive):
        return [every_state(drive, M_g) for M_g in torques]
    return [many_extremes(each, Batch.of(drive)) for each in error_maps(drive, torques)]


class _Search:
    """States of drives on the torus of the wheels' places, solved with slopes."""

    def __init__(self, error_map: ErrorMap, batch: Batch) -> None:
        self._map = error_map
        self._drives = len(batch)
        self._case = error_map.load_case()
        self._size = np.array(error_map.board.shape)
        states = error_map.states
        z_b, z_g = error_map.board.shape
        self._torus = Torus(*batch.by_wheel(states.alpha_b[:z_b], states.alpha_g[:z_g]), error_map.finest)
        self._certificate = EMPTY

    def every(self) -> Extremes:
        """Extremes of all drives from every state."""
        states = len(self._map.states)
        point = np.tile(np.argwhere(self._map.board >= 0), (self._drives, 1))
        rotation = self._at(np.repeat(np.arange(self._drives), states), point)[0].reshape(-1, states)
        ends = np.stack([rotation.argmax(axis=1), rotation.argmin(axis=1)], axis=1)
        return self._found(point[ends].reshape(-1, 2), np.take_along_axis(rotation, ends, axis=1))

    def extremes(self, grids: tuple[int, ...]) -> Extremes:
        """Extremes of all drives, proposed by grids of so many positions of each wheel."""
        proposed = [self._proposed(n) for n in grids]
        hills = reduce(_Hills.and_these, (found for found, _ in proposed))
        hills = self._first_states(hills, np.max([known for _, known in proposed], axis=0))
        groups = hills.row * 2 + (hills.sign < 0)  # of a drive first the hills, then those upside down
        order = np.lexsort((-hills.height, groups))
        hills = hills[order]
        _, first = np.unique(groups[order], return_index=True)
        rotation = hills.sign * hills.height / ARCSEC
        slope = hills.slope / ARCSEC
        starts = Starts(
            first=first, row=hills.row[first], sign=hills.sign[first], point=hills.point, rotation=rotation, slope=slope
        )
        radius = round(_RADIUS * float(self._size.mean()) / min(grids))
        gain, rings = (_DRAWN_GAIN, _DRAWN_RINGS) if grids == DRAWN_GRIDS else (_FINE_GAIN, _FINE_RINGS)
        tops = self._case.climb(self._torus, starts, Rules(_STEPS, gain / ARCSEC, (radius, *rings)))
        rotation, *_ = self._at(np.repeat(np.arange(self._drives), 2), tops)
        return self._found(tops, rotation.reshape(-1, 2))

    def _found(self, tops: Indices, rotation: Array) -> Extremes:
        """Extremes by the points of the greatest and the least rotation, and these [arcsec], shape (drives, 2)."""
        at_max, at_min = self._map.state(tops).reshape(-1, 2)[:, :: self._map.sign].T
        return Extremes(
            F_ior_arcsec=rotation[:, 0] - rotation[:, 1], at_max=at_max, at_min=at_min, certificate=self._certificate
        )

    def _at(self, row: Indices, point: Indices) -> tuple[Array, Array, Array]:
        """Rotation [arcsec] of drives at points, shape (states, 2), its slopes [arcsec/mm], and share of a zone."""
        states = self._map.states.take(self._map.state(point))
        place = partial(state_place, states, self._map.M_g)
        answers = self._case.solve(StateGaps(self._torus.scalars(row, point)), place, slope=True)
        self._certificate += answers.certificate
        assert answers.slope_arcsec_per_mm is not None
        return answers.rotation_arcsec, answers.slope_arcsec_per_mm, answers.zone_share[:, 0]

    def _proposed(self, n: int) -> tuple[_Hills, Array]:
        """Hills that splines and tangents of a grid of states propose; greatest height there, shape (drives, 2)."""
        drives = self._drives
        index = np.stack(np.unravel_index(there_and_back((n, n)), (n, n)), axis=1)
        exact = index * (self._size / n)
        row = np.tile(np.arange(drives), n * n)
        points = np.repeat(self._map.to_lattice(exact), drives, axis=0)
        rotation, slopes, share = self._at(row, points)
        steps = self._torus.changes(row, points)
        smooth = slice(SMOOTH_SCALARS)
        by_b, by_g = ((slopes[:, smooth] * each[:, smooth]).sum(axis=1) for each in steps)  # arcsec a step
        teeth = slopes[:, SMOOTH_SCALARS:].reshape(n * n, drives, -1).mean(axis=0)
        added = self._added(teeth, row, points)
        rotation -= added
        off = np.repeat(exact, drives, axis=0) - points
        flat = np.empty((5, drives, n, n))
        places = (row, *np.repeat(index, drives, axis=0).T)
        flat[0][places] = rotation + by_b * off[:, 0] + by_g * off[:, 1]
        flat[1][places] = by_b * self._size[0] / n
        flat[2][places] = by_g * self._size[1] / n
        flat[3][places] = share
        flat[4][places] = added
        whole = flat[0] + flat[4]
        crests = self._crests(*flat[:4])
        known = np.stack([whole.max(axis=(1, 2)), -whole.min(axis=(1, 2))], axis=1)
        crests = replace(crests, height=crests.height + crests.sign * self._added(teeth, crests.row, crests.point))
        fine = n * (_ROUGH_POINTS if teeth.size else SPLINE_POINTS)
        step = self._size / fine
        parts = (self._torus.by_b, self._torus.by_g)
        # of the nearest tooth: a whole tooth off is a sixth of a wave of order 16 on 100 teeth
        near = [np.rint(np.arange(fine) * part.shape[1] / fine).astype(int) % part.shape[1] for part in parts]
        b, g = (part[:, at, SMOOTH_SCALARS:] @ teeth[:, :, None] for part, at in zip(parts, near, strict=True))
        up, down = (each + b + g[:, None, :, 0] for each in between_states(flat[0], flat[1], flat[2], fine // n))
        return _hills_of(up, down, lambda place: self._map.to_lattice(place * step)).and_these(crests), known

    def _added(self, slopes: Array, row: Indices, point: Indices) -> Array:
        """What orders beyond the fourth add at points [arcsec], by slopes of drives, shape (drives, their scalars)."""
        return np.asarray((self._torus.scalars(row, point)[:, SMOOTH_SCALARS:] * slopes[row]).sum(axis=1))

    def _crests(self, value: Array, by_b: Array, by_g: Array, share: Array) -> _Hills:
        """Places between states of the grid where a mesh zone lets go, and the height of the upper tangent.

        Arguments: those of between_states; share of the torque that one zone takes, shape (drives, n, n).
        """
        n = len(value[0])
        found = list[_Hills]()
        for axis, slope in ((1, by_b), (2, by_g)):
            ahead = np.roll(value, -1, axis)
            slope_ahead = np.roll(slope, -1, axis)
            for zone in (share, 1 - share):
                beyond = np.roll(zone, -1, axis)
                at = np.nonzero(zone * beyond < 0)
                t = zone[at] / (zone[at] - beyond[at])
                near = value[at] + slope[at] * t
                far = ahead[at] - slope_ahead[at] * (1 - t)
                for sign in (1, -1):
                    first = sign * (near - far) > 0
                    place = np.stack(at[1:], axis=1).astype(float)
                    place[:, axis - 1] += np.where(first, np.maximum(t - _BACK, 0), np.minimum(t + _BACK, 1))
                    point = self._map.to_lattice(place * self._size / n)
                    found.append(
                        _Hills(
                            row=at[0],
                            sign=np.full(len(t), sign),
                            point=point,
                            height=np.maximum(sign * near, sign * far),
                            slope=np.empty((len(t), 0)),
                        )
                    )
        return reduce(_Hills.and_these, found)

    def _first_states(self, hills: _Hills, known: Array) -> _Hills:
        """Hills that are to be climbed: one state solved on each that may be the highest, and half a turn on."""
        F_ior = np.maximum(known.sum(axis=1), _LEAST_F_IOR)
        known = np.minimum(known, hills.tops)  # a state of the grid may be higher than all that splines propose
        hills = hills[known[hills.row, (hills.sign < 0).astype(int)] - hills.height <= _TRIED * F_ior[hills.row]]
        hills = self._solved(hills).near_top(_CLIMBED)
        twins = self._solved(replace(hills, point=self._map.to_lattice(hills.point + self._size / 2)))
        return hills.and_these(twins).near_top(_CLIMBED)

    def _solved(self, hills: _Hills) -> _Hills:
        """Hills with the states there."""
        rotation, slope, _ = self._at(hills.row, hills.point)
        return replace(hills, height=hills.sign * rotation, slope=slope)


def between_states(value: Array, by_b: Array, by_g: Array, times: int = SPLINE_POINTS) -> tuple[Array, Array]:
    """Bounds of the error between states of a grid, upper and lower, shape (drives, k, l), k = n times.

    Cubic splines; where the tangents of all four states around a place reach beyond them, those, and a share of what
    any of them reaches. Arguments: value of the states and its slopes by a step of the grid along either wheel, shape
    (drives, n, n).
    """
    n = value.shape[1]
    slopes = []
    for slope, axis in ((by_b, 1), (by_g, 2)):
        ahead = np.abs(np.roll(value, -1, axis) - value)
        most = _STEEPEST * np.maximum(ahead, np.roll(ahead, 1, axis))
        slopes.append(np.clip(slope, -most, most))
    b, g = slopes
    twist = (np.roll(b, -1, 2) - np.roll(b, 1, 2) + np.roll(g, -1, 1) - np.roll(g, 1, 1)) / 4
    A, B = _spline(n, times)
    spline = (A @ value + B @ b) @ A.T + (A @ g + B @ twist) @ B.T
    t = np.arange(times) / times
    tangents = []
    for i in (0, 1):
        for j in (0, 1):
            f, p, q = (np.roll(each, (-i, -j), (1, 2))[:, :, None, :, None] for each in (value, by_b, by_g))
            tangents.append((f + p * (t - i)[:, None, None] + q * (t - j)).reshape(spline.shape))
    low = np.minimum.reduce(tangents)
    high = np.maximum.reduce(tangents)
    up = np.maximum(low, spline + _BEYOND * np.maximum(high - spline, 0))
    down = np.minimum(high, spline + _BEYOND * np.minimum(low - spline, 0))
    return up, down


@lru_cache(maxsize=4)
def _spline(n: int, times: int) -> tuple[Array, Array]:
    """Weights of values and of slopes in a periodic cubic spline through n of them, shape (n times, n)."""
    cell, part = np.divmod(np.arange(n * times), times)
    t = part / times
    rows = np.arange(n * times)
    of_values, of_slopes = np.zeros((2, n * times, n))
    ahead = (cell + 1) % n
    of_values[rows, ahead] = (3 - 2 * t) * t**2
    of_values[rows, cell] = 1 - of_values[rows, ahead]
    of_slopes[rows, cell] = t * (1 - t) ** 2
    of_slopes[rows, ahead] = t**2 * (t - 1)
    return of_values, of_slopes
