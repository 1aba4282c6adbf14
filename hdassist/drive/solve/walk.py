"""The compiled walk (walk.c), which solves, sums and verifies states in C, and climbs to the highest states.

A climb starts from a hill of the rotation and follows its slopes. It runs in numpy if the walk is not compiled, which
also serves as the reference for tests. States are positions of both wheels on a torus. The tangent of a state is linear
in the scalars and exact as long as the contacts do not change. It bounds the other states from above until one of them
is found to be higher. The next state is the one with the highest bound, by all valid bounds and the tangent of the
highest state.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hdassist.drive.model.contacts import StateGaps
from hdassist.drive.model.geometry import Array
from hdassist.drive.solve.answers import Residuals, StateSums
from hdassist.drive.solve.build import SOURCE, development_folder, library_name, source_hash
from hdassist.drive.solve.formulation import Formulation, Reference
from hdassist.drive.solve.pivoting import NEAR_STEPS, SOFT
from hdassist.run.kept import operating_system, program

Points = NDArray[np.int64]
# returns rotation [rad] and slopes [rad/mm] of a state from its scalars [mm]
_StateAt = Callable[[Array], tuple[float, Array]]

# directions of the points of a ring, in order
_DIRECTIONS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)])
_RING_ROUNDS = 3  # largest number of rounds with each ring around the highest state
_MAX_RADIUS = 24  # largest radius in which a climb searches for its next state, in steps along each wheel
_MOST_STATES = 256  # largest number of states of one climb, which usually needs two dozen


@dataclass(frozen=True, eq=False)
class Torus:
    """Deviation scalars of the states of drives, as sums of one part per wheel position.

    States are points of a torus, whose coordinates are the positions of the two wheels.
    """

    by_b: Array  # part of the circular spline [mm], shape (drives, z_b, scalars)
    by_g: Array  # part of the flexspline [mm], shape (drives, z_g, scalars)
    finest: int  # steps along each wheel from one state to the next

    def scalars(self, row: Points, point: Points) -> Array:
        """Return the scalars of states [mm], shape (states, scalars).

        Args:
            row: index of the drive, for each state.
            point: points of the states, shape (states, 2).
        """
        k, l = point.T % np.array([[self.by_b.shape[1]], [self.by_g.shape[1]]])
        return np.asarray(self.by_b[row, k] + self.by_g[row, l])

    def changes(self, row: Points, point: Points) -> list[Array]:
        """Return the changes of the scalars per step along each wheel [mm], both of shape (states, scalars).

        Args:
            row: index of the drive, for each state.
            point: points of the states, shape (states, 2).
        """
        return [_central_difference(self.by_b, row, point[:, 0]), _central_difference(self.by_g, row, point[:, 1])]


def _central_difference(
    part: Array,
    row: Points,
    position: Points,
) -> Array:
    z = part.shape[1]
    return np.asarray((part[row, (position + 1) % z] - part[row, (position - 1) % z]) / 2)


@dataclass(frozen=True, eq=False)
class Starts:
    """States on hills at which climbs begin, in groups of one drive and one sign."""

    first: Points  # index of the first hill of each group
    row: Points  # index of the drive of each group
    sign: Points  # sign of each group; -1 climbs the negative rotation
    point: Points  # point of each state, shape (hills, 2)
    rotation: Array  # rotation of each state [rad]
    slope: Array  # slope of the rotation by the scalars [rad/mm], shape (hills, scalars)


@dataclass(frozen=True)
class Rules:
    """Limits of a climb."""

    steps: int  # largest number of steps
    gain: float  # smallest predicted gain for which another state is solved [rad]
    # radius in which a climb searches for its next state, then the radii of the rings around its top
    radius: tuple[int, ...]


def climbed(
    torus: Torus,
    hills: Starts,
    rules: Rules,
    state_at: _StateAt,
) -> Points:
    """Return the highest states that climbs from the hills of each group reach, shape (groups, 2).

    Args:
        torus: scalars of all states.
        hills: states at which climbs begin.
        rules: limits of the climbs.
        state_at: function that solves a state.
    """
    radius, *rings = rules.radius
    tops = []
    ends = np.append(hills.first[1:], len(hills.point))
    for first, end, row, sign in zip(hills.first, ends, hills.row, hills.sign, strict=True):
        max_height = -np.inf
        for hill in range(first, end):
            climb = _Climb(
                torus=torus,
                rules=rules,
                state_at=state_at,
                row=int(row),
                sign=int(sign),
            )
            climb.add(hills.point[hill], hills.rotation[hill], hills.slope[hill])
            climb.go_up(radius, max_height)
            if climb.height > max_height:
                highest_climb = climb
                max_height = climb.height
        for ring in rings:
            max_height = highest_climb.look_around(ring, max_height)
        tops.append(highest_climb.top)
    return np.array(tops)


class _Climb:
    """States of one climb, with the bounds that they imply."""

    def __init__(
        self,
        torus: Torus,
        rules: Rules,
        state_at: _StateAt,
        row: int,
        sign: int,
    ) -> None:
        self._torus = torus
        self._rules = rules
        self._state_at = state_at
        self._row = row
        self._sign = sign
        self.points = list[Points]()
        self._heights = list[float]()
        self._slopes = list[Array]()
        self._scalars = list[Array]()
        self._tangents = list[float]()  # value of each state's tangent without deviations [rad]
        self._is_bound = list[bool]()  # whether the tangent of each state lies above all other states

    @property
    def height(self) -> float:
        """Height of the highest state [rad]."""
        return max(self._heights)

    @property
    def top(self) -> Points:
        """Point of the highest state."""
        return self.points[int(np.argmax(self._heights))]

    def visit(self, point: Points) -> bool:
        """Solve the state at a point and return whether it was solved and could be stored."""
        if len(self.points) == _MOST_STATES:
            return False
        rotation, slope = self._state_at(self._torus.scalars(np.array([self._row]), point[None])[0])
        if np.isfinite(rotation):
            self.add(point, rotation, slope)
        return bool(np.isfinite(rotation))

    def add(
        self,
        point: Points,
        rotation: float,
        slope: Array,
    ) -> None:
        """Add a solved state.

        Args:
            point: positions of both wheels.
            rotation: rotation [rad].
            slope: slope of the rotation by the scalars [rad/mm].
        """
        scalars = self._torus.scalars(np.array([self._row]), point[None])[0]
        height = self._sign * rotation
        slope = self._sign * slope
        gain = self._rules.gain
        tangent = height - slope @ scalars
        is_bound = True
        for i, other_scalars in enumerate(self._scalars):
            self._is_bound[i] &= bool(self._tangents[i] + self._slopes[i] @ scalars >= height - gain)
            is_bound &= bool(tangent + slope @ other_scalars >= self._heights[i] - gain)
        self.points.append(point)
        self._heights.append(height)
        self._slopes.append(slope)
        self._scalars.append(scalars)
        self._tangents.append(tangent)
        self._is_bound.append(is_bound)

    def go_up(self, radius: float, target: float) -> None:
        """Visit the state with the highest bound near the top repeatedly, until no bound promises a gain.

        Args:
            radius: radius of the search for the next state, in steps along each wheel.
            target: height that the bound of a state must exceed [rad].
        """
        for _ in range(self._rules.steps):
            reach = min(int(radius + 0.5), _MAX_RADIUS)
            top = self.top
            height = self.height
            bounds = self._upper_bounds(top, reach)
            best = np.unravel_index(bounds.argmax(), bounds.shape)
            if not bounds[best] > max(height, target) + self._rules.gain or not self.visit(top + best - reach):
                return
            if not self.height > height:
                radius = radius / 2

    def look_around(self, ring: int, height: float) -> float:
        """Visit states on a ring around the top and climb from them, until this no longer raises the top.

        Args:
            ring: radius of the ring, in steps along each wheel.
            height: height that a round must exceed by the gain [rad].

        Returns the height that the next ring must exceed.
        """
        for _ in range(_RING_ROUNDS):
            known_points = np.array(self.points)
            for point in self.top + ring * _DIRECTIONS:
                is_far = (2 * np.abs(known_points - point) > ring).any(axis=1)
                if is_far.all():
                    self.visit(point)
                    known_points = np.array(self.points)
            self.go_up(1.5 * ring, -np.inf)
            if not self.height > height + self._rules.gain:
                break
            height = self.height
        return height

    def _upper_bounds(self, top: Points, reach: int) -> Array:
        """Return upper bounds of the heights near the top [rad], shape (2 reach + 1, 2 reach + 1).

        Each bound is the lowest of the tangents that lie above all known states. It is -inf at points without a state
        and at visited states.
        """
        torus = self._torus
        is_top = np.arange(len(self.points)) == np.argmax(self._heights)
        rows = np.flatnonzero(self._is_bound | is_top)
        steps = np.arange(-reach, reach + 1)
        slopes = np.array(self._slopes)[rows]
        by_b = torus.by_b[self._row, (top[0] + steps) % torus.by_b.shape[1]] @ slopes.T
        by_g = torus.by_g[self._row, (top[1] + steps) % torus.by_g.shape[1]] @ slopes.T
        bounds = (np.array(self._tangents)[rows] + by_b[:, None] + by_g).min(axis=2)
        bounds[(steps[:, None] + steps) % torus.finest != 0] = -np.inf
        for offset in np.array(self.points) - top + reach:
            if (offset >= 0).all() and (offset <= 2 * reach).all():
                bounds[tuple(offset)] = -np.inf
        return np.asarray(bounds)


# --- the compiled walk

INSTRUCTIONS = {4: "AVX-512", 3: "AVX2", 1: "any machine"}


@cache
def walk_library() -> tuple[Any, str]:
    """Return the compiled walk for this machine, None if there is none, and a text.

    The text names the walk or the reason for its absence.
    """
    for folder in (Path(__file__).parent, development_folder()):
        if not (folder / library_name(1)).exists():
            continue
        try:
            level = _opened(folder / library_name(1)).walk_level()
            library = folder / library_name(level)
            source = _opened(library).walk_source().decode()
        except OSError as error:
            return None, f"the compiled walk cannot be loaded: {error}"
        if source != source_hash():
            return None, f"the compiled walk is older than {SOURCE.name}; install hdassist again"
        return _load(library), f"compiled walk, {INSTRUCTIONS[level]}"
    return None, "numpy: no compiled walk in this installation (no C compiler when it was made)"


def installation() -> tuple[str, ...]:
    """Return everything except the machine that results depend on in this process: source, versions and engine."""
    return (*program("cvxpy", "daqp"), "compiled" if walk_library()[0] else "numpy")


def digits_depend_on() -> tuple[str, ...]:
    """Return everything except the input that the last digits of a result depend on."""
    return (*program("daqp", "pydantic"), walk_library()[1], operating_system())


def _opened(path: Path) -> Any:
    """Load a library of any source version, which may lack functions but always names its source."""
    library: Any = ctypes.CDLL(str(path))
    library.walk_source.restype = ctypes.c_char_p
    return library


# result and arguments of each function: p pointer, i int, l long, d double, - nothing
_FUNCTIONS = {
    "walk_new": "ppp",
    "walk_free": "-p",
    "walk_solve": "lpldipppppppp",
    "walk_climb": "lpdipppdplppppppp",
    "walk_near": "iiiippppppdippp",
    "walk_read": "-lippppp",
}


def _load(path: Path) -> Any:
    """Load a library built from the current source, and declare the argument and result types of its functions."""
    library = _opened(path)
    kinds = {"p": ctypes.c_void_p, "i": ctypes.c_int, "l": ctypes.c_long, "d": ctypes.c_double, "-": None}
    for name, letters in _FUNCTIONS.items():
        function = getattr(library, name)
        result, *arguments = (kinds[letter] for letter in letters)
        function.argtypes = arguments
        function.restype = result
    return library


class Walk:
    """The compiled walk of one contact system."""

    climbed = 0  # number of states that all climbs have solved without verification, for studies

    def __init__(self, reference: Reference) -> None:
        self._library, _ = walk_library()
        self._reference = reference
        addresses = [array.ctypes.data for array in reference.arrays.values()]
        sizes = ctypes.c_int32 * len(reference.sizes)
        arrays = ctypes.c_void_p * len(addresses)
        self._walk = self._library.walk_new(sizes(*reference.sizes), arrays(*addresses))
        if not self._walk:
            raise MemoryError

    def __del__(self) -> None:
        if getattr(self, "_walk", None):
            self._library.walk_free(self._walk)

    def solve(
        self,
        gaps: StateGaps,
        torque: float,
        *,
        slope: bool = False,
    ) -> StateSums:
        """Return the sums and residuals of states, NaN for a state that was given up.

        Args:
            gaps: gap changes of the states.
            torque: torque on the flexspline [N*mm].
            slope: whether to compute the slope of the rotation by the scalars.
        """
        scalars = np.ascontiguousarray(gaps.scalars, dtype=float)
        count, p = scalars.shape
        rotation = np.empty(count)
        tooth_force = np.empty(count)
        moment = np.empty((count, 2))
        residual = np.empty((count, 4))
        slopes = np.empty((count, p)) if slope else None
        place_gaps, teeth_coordinates = self._reference.of_teeth(gaps)
        # this variable keeps the arrays alive until the call has ended, which addresses would not
        arrays = (scalars, place_gaps, teeth_coordinates, rotation, moment, tooth_force, residual, slopes)
        given_up = self._library.walk_solve(self._walk, count, torque, p, *map(_address, arrays))
        return StateSums(
            rotation=rotation,
            moment=moment,
            tooth_force=tooth_force,
            residuals=Residuals(residual),
            slope=slopes,
            given_up=given_up,
        )

    def climb(
        self,
        torus: Torus,
        torque: float,
        hills: Starts,
        rules: Rules,
    ) -> Points:
        """Return the result of `climbed`, computed in C; a state that is given up does not count.

        Args:
            torus: scalars of all states.
            torque: torque on the flexspline [N*mm].
            hills: states at which climbs begin.
            rules: limits of the climbs.
        """
        _, z_b, scalars = torus.by_b.shape
        _, z_g, _ = torus.by_g.shape
        groups = len(hills.row)
        # these variables keep the arrays alive until the call has ended, which addresses would not
        sizes = _int32([z_b, z_g, torus.finest, rules.steps, len(rules.radius) - 1])
        radius = _int32(rules.radius)
        by_b = np.ascontiguousarray(torus.by_b)
        by_g = np.ascontiguousarray(torus.by_g)
        group_arrays = [_int32(np.append(hills.first, len(hills.point))), _int32(hills.row), _int32(hills.sign)]
        state_arrays = [_int32(hills.point), np.ascontiguousarray(hills.rotation), np.ascontiguousarray(hills.slope)]
        top = np.empty((groups, 2), dtype=np.int32)
        solved = self._library.walk_climb(
            self._walk,
            torque,
            scalars,
            _address(sizes),
            _address(by_b),
            _address(by_g),
            rules.gain,
            _address(radius),
            groups,
            *map(_address, group_arrays),
            *map(_address, state_arrays),
            _address(top),
        )
        if solved < 0:
            raise MemoryError
        Walk.climbed += solved
        return top.astype(np.int64)


def walk_near_state(
    formulation: Formulation,
    gaps: Array,
    right: Array,
    contact: NDArray[np.bool_],
) -> tuple[Array, Array] | None:
    """Return the result of `pivoting.solve_near` for the same arguments, computed in C."""
    system = formulation.system
    place_ends = np.append(system.first, len(gaps)).astype(np.int32)
    contiguous_gaps = np.ascontiguousarray(gaps)
    contact_flags = contact.astype(np.uint8)
    forces = np.empty(len(gaps))
    duals = np.empty(len(right))
    is_solved = walk_library()[0].walk_near(
        len(gaps),
        len(system.first),
        len(right),
        _address(formulation.H),
        _address(formulation.local),
        _address(place_ends),
        _address(formulation.A),
        _address(contiguous_gaps),
        _address(right),
        SOFT,
        NEAR_STEPS,
        _address(contact_flags),
        _address(forces),
        _address(duals),
    )
    return (forces, duals) if is_solved else None


def read_table(
    table: Array,
    places: Array,
    factors: Array,
) -> Array:
    """Return the values of a table over four axes, interpolated linearly, NaN outside it, shape (points,).

    Args:
        table: value and slopes by the factors at each point, shape (*axes, 1 + factors).
        places: positions of the points along the axes, shape (points, 4).
        factors: factors of the slopes, shape (points, factors).
    """
    table = np.ascontiguousarray(table)
    places = np.ascontiguousarray(places)
    factors = np.ascontiguousarray(factors)
    library, _ = walk_library()
    if library:
        shape = np.array(table.shape[:-1], dtype=np.int32)
        values = np.empty(len(places))
        arrays = (shape, table, places, factors, values)
        library.walk_read(len(places), table.shape[-1], *map(_address, arrays))
        return values
    from scipy.ndimage import map_coordinates  # importing scipy.ndimage takes as long as a whole check

    value, *slopes = (map_coordinates(part, places.T, order=1, cval=np.nan) for part in np.moveaxis(table, -1, 0))
    return np.asarray(value + (np.transpose(slopes) * factors).sum(axis=1))


def _int32(values: ArrayLike) -> NDArray[np.int32]:
    return np.ascontiguousarray(values, np.int32)


def _address(array: Any) -> int | None:
    return None if array is None else array.ctypes.data
