"""Extremes of drives that share a contact system, from a few states with slopes.

Solving a state gives the rotation and its slopes by the deviation scalars. Three methods propose hills. The first is
cubic splines through a coarse grid of states and slopes. The error due to single teeth is added to them with mean
slopes, because single teeth turn the output by nearly the same angle everywhere. The second is tangents that extend
beyond the splines. The third is crests, where a mesh zone loses contact and the error jumps by its clearance; the
torque share of the zone predicts their positions. From the hills, drive/solve/walk.py climbs to the tops. The states at
the tops are states of the cycle and are solved and verified again, so F'_ior can only be too small. `python -m
benchmarks.proposals` measures by how much for drives with several grids, and `python -m benchmarks.draws` for samples,
which are numerous and use one grid.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial, reduce

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.error.cycle import state_place
from hdassist.drive.error.error_map import (
    Batch,
    ErrorMap,
    Extremes,
    Indices,
    error_maps,
    every_state,
    searchable,
    there_and_back,
)
from hdassist.drive.model.contacts import StateGaps
from hdassist.drive.model.deviations import SMOOTH_SCALARS
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import Drive
from hdassist.drive.solve.answers import ARCSEC, EMPTY
from hdassist.drive.solve.walk import Rules, Starts, Torus

# Numbers of positions of each wheel in the grids. One grid shows islands of the error that another one misses. There
# are many samples, so a single coarse grid has to suffice. Its number is odd, because the error is similar half a
# revolution further and those points then lie between the positions. For one drive, an extreme that one grid misses is
# usually found by another.
DRAWN_GRIDS = (7,)
FINE_GRIDS = (9, 14, 19)
SHORT_CYCLE = 4000  # cycles with fewer states are solved completely for a single drive
_MIN_F_IOR = 4.0  # arcsec; smallest F'_ior to which the shares below refer
SPLINE_POINTS = 4  # points of a spline per position of the grid
_ROUGH_POINTS = 6  # points of a spline per position of the grid if orders beyond the fourth are added
# largest slope of a spline, over the slope to the next state; larger slopes at a crease would make it overshoot
_MAX_SLOPE = 1.5
_TANGENT_SHARE = 0.25  # share of the difference between tangents and spline by which a hill may exceed the spline
# largest depth below the highest state of the grid, as a share of F'_ior, at which the state on a hill is solved
_TRIED = 0.06
_CLIMBED = 0.08  # largest depth below the highest state, as a share of F'_ior, at which a hill is climbed
_RADIUS = 0.5  # radius in which a climb searches for its next state, in steps of the grid
# radii of the rings around the highest state on which a climb searches for another upward slope, in steps between
# states
_DRAWN_RINGS = (8,)
_FINE_RINGS = (8, 4)
_BEFORE_CREST = 0.15  # distance before a crest at which a climb begins, in steps of the grid
_MAX_STEPS = 10  # largest number of steps of a climb
# approximate number of states solved for a drive at one torque, without those of climbs
DRAWN_STATES = 70
FINE_STATES = 700
# arcsec; smallest predicted gain for which a climb solves another state
_DRAWN_GAIN = 0.002
_FINE_GAIN = 0.0002


@dataclass(frozen=True)
class _Hills:
    """Points that may be an extreme of the error, shape (hills,)."""

    row: Indices  # index of the drive
    sign: Indices  # 1 for a maximum, -1 for a minimum
    point: Indices  # positions of both wheels, shape (hills, 2)
    height: Array  # error times sign [arcsec]
    # slope of the rotation [arcsec/mm], shape (hills, scalars); (hills, 0) until a state is solved on the hill
    slope: Array

    def __len__(self) -> int:
        return len(self.row)

    def __getitem__(self, chosen: NDArray[np.bool_] | Indices) -> _Hills:
        return _Hills(
            row=self.row[chosen],
            sign=self.sign[chosen],
            point=self.point[chosen],
            height=self.height[chosen],
            slope=self.slope[chosen],
        )

    def and_these(self, further: _Hills) -> _Hills:
        """Return these hills together with further hills."""
        return _Hills(
            row=np.concatenate([self.row, further.row]),
            sign=np.concatenate([self.sign, further.sign]),
            point=np.concatenate([self.point, further.point]),
            height=np.concatenate([self.height, further.height]),
            slope=np.concatenate([self.slope, further.slope]),
        )

    @property
    def tops(self) -> Array:
        """Largest height of the maxima and of the minima of each drive [arcsec], shape (drives, 2)."""
        # heights are signed, so the sum of both tops is F'_ior
        tops = np.full((self.row.max(initial=0) + 1, 2), -np.inf)
        np.maximum.at(tops, (self.row, self.sign // 2), self.height)  # column 0, or -1 for minima
        return tops

    def near_top(self, share: float) -> _Hills:
        """Return the hills that are close to the highest hill of the same drive and sign.

        share: largest depth below the highest hill, as a share of F'_ior.
        """
        tops = self.tops
        # a share of a very small F'_ior would leave no hill
        F_ior = np.maximum(tops.sum(axis=1), _MIN_F_IOR)
        depth = tops[self.row, self.sign // 2] - self.height
        return self[depth <= share * F_ior[self.row]]


@dataclass(frozen=True)
class _GridStates:
    """Solved states of a grid of n positions of each wheel, shape (drives, n, n), without rough orders.

    Rough orders are those beyond the fourth. Their error is stored separately.
    """

    error: Array  # error without rough orders [arcsec]
    by_b: Array  # slope of the error per grid step along the circular spline [arcsec]
    by_g: Array  # slope of the error per grid step along the flexspline [arcsec]
    zone_share: Array  # share of the torque on the first mesh zone
    rough: Array  # error due to rough orders [arcsec]
    rough_slopes: Array  # mean slope of the error by the scalars of rough orders, shape (drives, scalars) [arcsec/mm]

    @property
    def n(self) -> int:
        """Number of positions of each wheel."""
        return len(self.error[0])

    @property
    def tops(self) -> Array:
        """Largest error and largest negative error of each drive on the grid [arcsec], shape (drives, 2)."""
        # the error due to rough orders is stored separately, because splines cannot follow it
        total = self.error + self.rough
        return np.stack([total.max(axis=(1, 2)), -total.min(axis=(1, 2))], axis=1)


def _hills_of(
    up: Array,
    down: Array,
    to_points: Callable[[Array], Indices],
) -> _Hills:
    """Return the local maxima of an upper map and the local minima of a lower map.

    Each extreme is moved to the top of the parabola through its neighbours.

    Args:
        up: upper bound of the error over the torus [arcsec], shape (drives, k, l).
        down: lower bound of the error over the torus [arcsec], shape (drives, k, l).
        to_points: function that converts positions in a map, shape (hills, 2), to points at which there is a state.
    """
    # minima are maxima of the negative map, so one search finds both
    maps = np.concatenate([up, -down])
    neighbourhood = maps  # largest value among a point and its eight neighbours
    for axis in (1, 2):
        # two passes over three points cover the square of nine; np.roll closes the torus
        neighbours = np.maximum(np.roll(neighbourhood, 1, axis), np.roll(neighbourhood, -1, axis))
        neighbourhood = np.maximum(neighbourhood, neighbours)
    map_number, k, l = np.nonzero(maps >= neighbourhood)
    place, height = _tops_of_parabolas(maps, map_number, k, l)
    # the second half of the maps are the negative ones
    is_minimum, row = np.divmod(map_number, len(up))
    return _Hills(
        row=row, sign=1 - 2 * is_minimum, point=to_points(place), height=height, slope=np.empty((len(row), 0))
    )


def _tops_of_parabolas(
    maps: Array,
    map_number: Indices,
    k: Indices,
    l: Indices,
) -> tuple[Array, Array]:
    """Return the tops of the parabolas along both axes through points of maps and their neighbours.

    Args:
        maps: the maps, shape (maps, k, l).
        map_number: map of each point, shape (hills,).
        k: index of each point along the first axis.
        l: index of each point along the second axis.

    Returns the positions of the tops, shape (hills, 2), and their heights, shape (hills,).
    """
    steps = np.arange(-1, 2)
    rows_k = (k[:, None] + steps) % maps.shape[1]
    rows_l = (l[:, None] + steps) % maps.shape[2]
    patch = maps[map_number[:, None, None], rows_k[:, :, None], rows_l[:, None]]  # shape (hills, 3, 3)
    height = patch[:, 1, 1].copy()
    place = np.stack([k, l], axis=1).astype(float)
    lines = (patch[:, :, 1].T, patch[:, 1, :].T)  # three values along each axis
    for axis, (before, centre, behind) in enumerate(lines):
        # a flat line has no top: a small bend avoids division by zero, and clipping limits the shift
        bend = np.minimum(before + behind - 2 * centre, -1e-12)
        # the top of the parabola lies within half a step, because the centre is the largest of three values
        shift = np.clip((before - behind) / (2 * bend), -0.5, 0.5)
        place[:, axis] += shift
        height -= bend * shift**2 / 2
    return place, height


def many_extremes(
    error_map: ErrorMap,
    batch: Batch,
    grids: tuple[int, ...] = FINE_GRIDS,
) -> Extremes:
    """Return the extremes of drives from a few states of each drive, or from every state of a short cycle.

    Args:
        error_map: map of the common contact system and torque.
        batch: the drives.
        grids: numbers of positions of each wheel in the grids that propose hills.

    Raises UntrustedError if a result cannot be trusted.
    """
    search = _Search(error_map, batch)
    # solving all states of a short cycle is as fast as a search and cannot miss an extreme
    return search.every() if len(error_map.states) < SHORT_CYCLE else search.extremes(grids)


def extremes_of(drive: Drive, torques: Sequence[float]) -> list[Extremes]:
    """Return the extremes of a drive at torques [N*m] from a few states, or from every state if the balls roll.

    Raises UntrustedError if a result cannot be trusted.
    """
    if not searchable(drive):
        # with rolling balls the error is not a function of the wheel angles alone
        return [every_state(drive, M_g) for M_g in torques]
    return [many_extremes(error_map, Batch.of(drive)) for error_map in error_maps(drive, torques)]


class _Search:
    """A search for extremes of drives on the torus of wheel positions, by states solved with slopes."""

    def __init__(self, error_map: ErrorMap, batch: Batch) -> None:
        self._map = error_map
        self._drives = len(batch)
        # one walk serves all drives of the batch, because their contact sets are similar
        self._case = error_map.load_case()
        self._size = np.array(error_map.board.shape)  # number of positions of both wheels
        states = error_map.states
        z_b, z_g = error_map.board.shape
        # the first z_b states contain all angles of the circular spline, the first z_g all angles of the flexspline
        by_b, by_g = batch.by_wheel(states.alpha_b[:z_b], states.alpha_g[:z_g])
        self._torus = Torus(
            by_b=by_b,
            by_g=by_g,
            finest=error_map.finest,
        )
        self._certificate = EMPTY

    def every(self) -> Extremes:
        """Return the extremes of all drives from every state."""
        states = len(self._map.states)
        point = np.tile(np.argwhere(self._map.board >= 0), (self._drives, 1))
        row = np.repeat(np.arange(self._drives), states)
        rotation, _, _ = self._solve(row, point)
        by_drive = rotation.reshape(-1, states)
        # columns: index of the largest and of the smallest rotation
        ends = np.stack([by_drive.argmax(axis=1), by_drive.argmin(axis=1)], axis=1)
        return self._extremes_at(
            point[ends].reshape(-1, 2),
            np.take_along_axis(
                by_drive,
                ends,
                axis=1,
            ),
        )

    def extremes(self, grids: tuple[int, ...]) -> Extremes:
        """Return the extremes of all drives from hills that grids propose.

        grids: numbers of positions of each wheel.
        """
        hills_by_grid = []
        tops_by_grid = []
        # each grid proposes its own hills; together they find crests that one grid steps over
        for n in grids:
            hills, tops = self._proposed(n)
            hills_by_grid.append(hills)
            tops_by_grid.append(tops)
        hills = self._first_states(reduce(_Hills.and_these, hills_by_grid), np.max(tops_by_grid, axis=0))
        starts = _starts_of(hills)
        # hills of the coarsest grid are farthest from their tops
        radius = round(_RADIUS * float(self._size.mean()) / min(grids))
        is_drawn = grids == DRAWN_GRIDS
        gain = _DRAWN_GAIN if is_drawn else _FINE_GAIN
        rings = _DRAWN_RINGS if is_drawn else _FINE_RINGS
        rules = Rules(
            steps=_MAX_STEPS,
            gain=gain / ARCSEC,
            radius=(radius, *rings),
        )
        # states on the way have no certificate; only the tops are solved again
        points = self._case.climb(self._torus, starts, rules)
        rotation, _, _ = self._solve(np.repeat(np.arange(self._drives), 2), points)
        return self._extremes_at(points, rotation.reshape(-1, 2))

    def _extremes_at(self, points: Indices, rotation: Array) -> Extremes:
        """Return the extremes at given points.

        Args:
            points: points of the largest and the smallest rotation of each drive, shape (2 drives, 2).
            rotation: rotations at these points [arcsec], shape (drives, 2).
        """
        # if the sign is -1, the largest rotation is the smallest error
        at_max, at_min = self._map.state(points).reshape(-1, 2)[:, :: self._map.sign].T
        return Extremes(
            F_ior_arcsec=rotation[:, 0] - rotation[:, 1], at_max=at_max, at_min=at_min, certificate=self._certificate
        )

    def _solve(self, row: Indices, point: Indices) -> tuple[Array, Array, Array]:
        """Return the rotation [arcsec], its slopes [arcsec/mm] and the torque share of the first mesh zone, for states.

        Args:
            row: index of the drive, for each state.
            point: points of the states, shape (states, 2).
        """
        states = self._map.states.take(self._map.state(point))
        # the text is composed only if an error message needs it
        place = partial(state_place, states, self._map.M_g)
        answers = self._case.solve(
            StateGaps(self._torus.scalars(row, point)),
            place,
            slope=True,
        )
        self._certificate += answers.certificate
        assert answers.slope_arcsec_per_mm is not None
        return answers.rotation_arcsec, answers.slope_arcsec_per_mm, answers.zone_share[:, 0]

    def _proposed(self, n: int) -> tuple[_Hills, Array]:
        """Return the hills that a grid of n positions of each wheel proposes, and the largest heights of its states.

        The heights are those of the error and of the negative error [arcsec], shape (drives, 2).
        """
        grid = self._grid_states(n)
        crests = self._crests(grid)
        rough = self._rough(grid.rough_slopes, crests.row, crests.point)
        crests = replace(crests, height=crests.height + crests.sign * rough)
        # order 16 has 16 periods around a wheel, and four points between 9 states would miss its tops
        points = _ROUGH_POINTS if grid.rough_slopes.size else SPLINE_POINTS
        fine = n * points
        step = self._size / fine
        rough_b = self._rough_of_wheel(self._torus.by_b, grid.rough_slopes, fine)
        rough_g = self._rough_of_wheel(self._torus.by_g, grid.rough_slopes, fine)
        # splines give the smooth part; the rough part is a sum over both wheels
        up, down = between_states(grid.error, grid.by_b, grid.by_g, points)
        hills = _hills_of(
            up + rough_b[:, :, None] + rough_g[:, None],
            down + rough_b[:, :, None] + rough_g[:, None],
            lambda place: self._map.to_lattice(place * step),
        )
        return hills.and_these(crests), grid.tops

    def _grid_states(self, n: int) -> _GridStates:
        """Solve the states nearest to a grid of n positions of each wheel."""
        drives = self._drives
        index = np.stack(np.unravel_index(there_and_back((n, n)), (n, n)), axis=1)  # in the order of the walk
        grid_point = index * (self._size / n)
        row = np.tile(np.arange(drives), n * n)
        point = np.repeat(
            self._map.to_lattice(grid_point),
            drives,
            axis=0,
        )
        rotation, slopes, zone_share = self._solve(row, point)
        smooth = slice(SMOOTH_SCALARS)
        change_b, change_g = self._torus.changes(row, point)
        # chain rule: slope by the scalars times the change of the scalars per step of the wheel
        by_b = (slopes[:, smooth] * change_b[:, smooth]).sum(axis=1)  # per step between states
        by_g = (slopes[:, smooth] * change_g[:, smooth]).sum(axis=1)
        # mean over the grid, because single slopes depend on the contact set of their state
        rough_slopes = slopes[:, SMOOTH_SCALARS:].reshape(n * n, drives, -1).mean(axis=0)
        rough = self._rough(rough_slopes, row, point)
        # from the state to the point of the grid
        offset = np.repeat(grid_point, drives, axis=0) - point
        error = rotation - rough + by_b * offset[:, 0] + by_g * offset[:, 1]
        # advanced indices into (drives, n, n)
        place = (row, *np.repeat(index, drives, axis=0).T)

        def on_grid(values: Array) -> Array:
            gridded = np.empty((drives, n, n))
            gridded[place] = values
            return gridded

        return _GridStates(
            error=on_grid(error),
            by_b=on_grid(by_b * self._size[0] / n),
            by_g=on_grid(by_g * self._size[1] / n),
            zone_share=on_grid(zone_share),
            rough=on_grid(rough),
            rough_slopes=rough_slopes,
        )

    def _rough(
        self,
        rough_slopes: Array,
        row: Indices,
        point: Indices,
    ) -> Array:
        """Return the error due to orders beyond the fourth at points [arcsec].

        Args:
            rough_slopes: slopes of each drive by the scalars of these orders [arcsec/mm], shape (drives, scalars).
            row: index of the drive, for each point.
            point: the points, shape (points, 2).
        """
        scalars = self._torus.scalars(row, point)[:, SMOOTH_SCALARS:]
        return np.asarray((scalars * rough_slopes[row]).sum(axis=1))

    def _rough_of_wheel(
        self,
        part: Array,
        rough_slopes: Array,
        fine: int,
    ) -> Array:
        """Return the error due to orders beyond the fourth of one wheel [arcsec], shape (drives, fine).

        Each of the fine positions takes the value of the nearest tooth. This is accurate enough, because one tooth is a
        sixth of a wave of order 16 on 100 teeth.
        """
        z = part.shape[1]
        # rough orders are evaluated at whole teeth, where the states are
        nearest = np.rint(np.arange(fine) * z / fine).astype(int) % z
        return np.asarray((part[:, nearest, SMOOTH_SCALARS:] @ rough_slopes[:, :, None])[:, :, 0])

    def _crests(self, grid: _GridStates) -> _Hills:
        """Return the points between grid states where a mesh zone loses contact, at the height of the upper tangent."""
        crests = []
        for axis, slope in ((1, grid.by_b), (2, grid.by_g)):
            # either zone may lose contact
            for zone_share in (grid.zone_share, 1 - grid.zone_share):
                crests += self._crests_along(axis, grid.error, slope, zone_share)
        return reduce(_Hills.and_these, crests)

    def _crests_along(self, axis: int, error: Array, slope: Array, zone_share: Array) -> list[_Hills]:
        """Return the crests between neighbours along one axis of a grid where one mesh zone loses contact.

        Args:
            axis: 1 along the circular spline, 2 along the flexspline.
            error: error [arcsec], shape (drives, n, n).
            slope: slope of the error per grid step along the axis [arcsec], shape (drives, n, n).
            zone_share: share of the torque on the zone, shape (drives, n, n).
        """
        next_error = np.roll(error, -1, axis)
        next_slope = np.roll(slope, -1, axis)
        next_share = np.roll(zone_share, -1, axis)
        # the torque share of the zone changes sign between the two states, and linear interpolation gives its zero
        cell = np.nonzero(zone_share * next_share < 0)
        row, *position = cell
        t = zone_share[cell] / (zone_share[cell] - next_share[cell])  # position of the crest within its cell
        # on each side of the crest the error follows the tangent of that side, which does not hold beyond the crest
        tangent = error[cell] + slope[cell] * t
        next_tangent = next_error[cell] - next_slope[cell] * (1 - t)
        crests = []
        for sign in (1, -1):
            is_first_higher = sign * (tangent - next_tangent) > 0
            place = np.stack(position, axis=1).astype(float)
            # the climb begins on the side of the higher tangent, where its slope leads to the crest
            offset = np.where(is_first_higher, np.maximum(t - _BEFORE_CREST, 0), np.minimum(t + _BEFORE_CREST, 1))
            place[:, axis - 1] += offset
            crest = _Hills(
                row=row,
                sign=np.full(len(t), sign),
                # convert steps of the grid to steps between states
                point=self._map.to_lattice(place * self._size / len(error[0])),
                height=np.maximum(sign * tangent, sign * next_tangent),
                slope=np.empty((len(t), 0)),
            )
            crests.append(crest)
        return crests

    def _first_states(self, hills: _Hills, grid_tops: Array) -> _Hills:
        """Return the hills to be climbed, with a solved state on each hill and on its twin half a revolution further.

        Args:
            hills: all hills proposed by the grids.
            grid_tops: largest heights on the grids [arcsec], shape (drives, 2).
        """
        F_ior = np.maximum(grid_tops.sum(axis=1), _MIN_F_IOR)
        # the smaller value is a height that a state has or a spline predicts
        tops = np.minimum(grid_tops, hills.tops)  # a grid state may be higher than every proposed hill
        depth = tops[hills.row, (hills.sign < 0).astype(int)] - hills.height
        hills = self._with_states(hills[depth <= _TRIED * F_ior[hills.row]]).near_top(_CLIMBED)
        # half a revolution of both wheels reverses their deviations of odd order, which changes the error only slightly
        twins = self._with_states(replace(hills, point=self._map.to_lattice(hills.point + self._size / 2)))
        return hills.and_these(twins).near_top(_CLIMBED)

    def _with_states(self, hills: _Hills) -> _Hills:
        """Return the hills with the height and slope of the states at their points."""
        rotation, slope, _ = self._solve(hills.row, hills.point)
        return replace(hills, height=hills.sign * rotation, slope=slope)


def _starts_of(hills: _Hills) -> Starts:
    """Return the states at which climbs begin, in groups of one drive and sign, the highest first."""
    # climbs of one drive and sign share the bounds from all states solved in the group
    groups = hills.row * 2 + (hills.sign < 0)  # the maxima of a drive, then its minima
    # the last key is the primary key of lexsort
    order = np.lexsort((-hills.height, groups))
    ordered = hills[order]
    _, first = np.unique(groups[order], return_index=True)
    return Starts(
        first=first,
        row=ordered.row[first],
        sign=ordered.sign[first],
        point=ordered.point,
        rotation=ordered.sign * ordered.height / ARCSEC,
        slope=ordered.slope / ARCSEC,
    )


def between_states(
    value: Array,
    by_b: Array,
    by_g: Array,
    times: int = SPLINE_POINTS,
) -> tuple[Array, Array]:
    """Return an upper and a lower bound of the error between the states of a grid, shape (drives, n times, n times).

    Both are cubic splines. Where the tangents of all four surrounding states lie beyond the spline, the tangents are
    the bound. Elsewhere a share of the difference between the outermost tangent and the spline is added.

    Args:
        value: error of the states, shape (drives, n, n).
        by_b: slope of the error per grid step along the circular spline, shape (drives, n, n).
        by_g: slope of the error per grid step along the flexspline, shape (drives, n, n).
        times: points per position of the grid.
    """
    spline = _spline_between(value, by_b, by_g, times)
    # positions within a cell, from 0 at its lower corner
    t = np.arange(times) / times
    tangents = []
    for i in (0, 1):
        for j in (0, 1):
            # values at one corner of each cell and the tangents over the cell, shape (drives, n, 1, n, 1): the further
            # axes are for the positions within the cells
            corner_value, slope_b, slope_g = (
                np.roll(values, (-i, -j), (1, 2))[:, :, None, :, None] for values in (value, by_b, by_g)
            )
            tangent = corner_value + slope_b * (t - i)[:, None, None] + slope_g * (t - j)
            tangents.append(tangent.reshape(spline.shape))
    # where the error is concave all tangents lie above it, where it is convex below it
    low = np.minimum.reduce(tangents)
    high = np.maximum.reduce(tangents)
    # only a share of the difference between spline and tangents: the full difference would make every cell a hill
    up = np.maximum(low, spline + _TANGENT_SHARE * np.maximum(high - spline, 0))
    down = np.minimum(high, spline + _TANGENT_SHARE * np.minimum(low - spline, 0))
    return up, down


def _spline_between(
    value: Array,
    by_b: Array,
    by_g: Array,
    times: int,
) -> Array:
    """Return the cubic spline through the states of a grid; the arguments are those of `between_states`."""
    # slopes at a crease are valid on one side only
    b = _limited_slope(value, by_b, 1)
    g = _limited_slope(value, by_g, 2)
    # mixed derivative by central differences of the slopes
    twist = (np.roll(b, -1, 2) - np.roll(b, 1, 2) + np.roll(g, -1, 1) - np.roll(g, 1, 1)) / 4
    # tensor product of splines along both wheels
    A, B = _spline(value.shape[1], times)
    return np.asarray((A @ value + B @ b) @ A.T + (A @ g + B @ twist) @ B.T)


def _limited_slope(
    value: Array,
    slope: Array,
    axis: int,
) -> Array:
    """Return the slopes along an axis, limited to _MAX_SLOPE times the larger difference to a neighbour."""
    # a slope far above both differences belongs to a crease next to the state
    difference = np.abs(np.roll(value, -1, axis) - value)
    limit = _MAX_SLOPE * np.maximum(difference, np.roll(difference, 1, axis))
    return np.clip(slope, -limit, limit)


@lru_cache(maxsize=4)
def _spline(n: int, times: int) -> tuple[Array, Array]:
    """Return the weights of n values and of n slopes in a periodic cubic spline, shape (n times, n) each."""
    cell, part = np.divmod(np.arange(n * times), times)
    t = part / times
    rows = np.arange(n * times)
    next_cell = (cell + 1) % n
    value_weights = np.zeros((n * times, n))
    # Hermite polynomials on a cell of length 1
    value_weights[rows, next_cell] = (3 - 2 * t) * t**2
    value_weights[rows, cell] = 1 - value_weights[rows, next_cell]
    slope_weights = np.zeros((n * times, n))
    slope_weights[rows, cell] = t * (1 - t) ** 2
    slope_weights[rows, next_cell] = t**2 * (t - 1)
    return value_weights, slope_weights
