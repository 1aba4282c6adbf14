"""The compiled walk (walk.c), which solves, sums and certifies states in C; and climbs to the highest states.

Climbs go from hills of the rotation by slopes, in numpy where no walk was compiled, and as its oracle. States are
places of both wheels on a torus. The tangent of a state, straight in the scalars, is exact while contacts stay as they
are, and bounds the others from above until one of them is higher. The next state is the one that all bounds, and the
tangent of the highest state, let be the highest.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hdassist.model.contacts import StateGaps
from hdassist.model.geometry import Array
from hdassist.run.kept import operating_system, program
from hdassist.solve.answers import Residuals, StateSums
from hdassist.solve.build import SOURCE, development_folder, library_name, source_hash
from hdassist.solve.formulation import Formulation, Reference
from hdassist.solve.pivoting import NEAR_STEPS, SOFT

Points = NDArray[np.int64]
_StateAt = Callable[[Array], tuple[float, Array]]  # rotation [rad] and slopes [rad/mm] of a state by its scalars [mm]

_WAYS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)])  # of a ring, side by side
_LOOKS = 3  # around the highest state of a climb, by each ring
_WIDEST_LOOK = 24  # steps along each wheel that a climb looks around, at most
_MOST_STATES = 256  # of one climb; two dozen are usual


@dataclass(frozen=True, eq=False)
class Torus:
    """Scalars [mm] of states of drives, as sums of parts by the places of both wheels, shape (drives, z, scalars).

    finest: steps along each wheel from one state to the next.
    """

    by_b: Array
    by_g: Array
    finest: int

    def scalars(self, row: Points, point: Points) -> Array:
        """Scalars [mm] of drives by their row at points, shape (states, 2): shape (states, scalars)."""
        k, l = point.T % np.array([[self.by_b.shape[1]], [self.by_g.shape[1]]])
        return np.asarray(self.by_b[row, k] + self.by_g[row, l])

    def changes(self, row: Points, point: Points) -> list[Array]:
        """Change of the scalars there by a step [mm] along each wheel, shape (states, scalars) both."""
        found = []
        for wheel, part in enumerate((self.by_b, self.by_g)):
            at = point[:, wheel]
            z = part.shape[1]
            found.append((part[row, (at + 1) % z] - part[row, (at - 1) % z]) / 2)
        return found


@dataclass(frozen=True, eq=False)
class Starts:
    """Where climbs begin: groups of a drive and sign, by the place of their first hill, and a state on each hill.

    row, sign: of each group; sign -1 climbs the rotation upside down. Of the states: point, shape (hills, 2), rotation
    [rad], shape (hills,), and its slope [rad/mm], shape (hills, scalars).
    """

    first: Points
    row: Points
    sign: Points
    point: Points
    rotation: Array
    slope: Array


@dataclass(frozen=True)
class Rules:
    """Steps of a climb at most; gain [rad] that a state has to promise; radius of a look around, then of rings."""

    steps: int
    gain: float
    radius: tuple[int, ...]


def climbed(torus: Torus, hills: Starts, rules: Rules, state_at: _StateAt) -> Points:
    """The highest states that climbs from the hills of each group, and rings around, come to, shape (groups, 2)."""
    radius, *rings = rules.radius
    tops = []
    ends = np.append(hills.first[1:], len(hills.point))
    for first, end, row, sign in zip(hills.first, ends, hills.row, hills.sign, strict=True):
        highest = -np.inf
        for hill in range(first, end):
            climb = _Climb(torus=torus, rules=rules, state_at=state_at, row=int(row), sign=int(sign))
            climb.add(hills.point[hill], hills.rotation[hill], hills.slope[hill])
            climb.go_up(radius, highest)
            if climb.height > highest:
                best = climb
                highest = climb.height
        for ring in rings:
            for _ in range(_LOOKS):
                known = np.array(best.points)
                for point in best.top + ring * _WAYS:
                    if (2 * np.abs(known - point) > ring).any(axis=1).all():
                        best.visit(point)
                        known = np.array(best.points)
                best.go_up(1.5 * ring, -np.inf)
                if not best.height > highest + rules.gain:
                    break
                highest = best.height
        tops.append(best.top)
    return np.array(tops)


class _Climb:
    """States of one climb, with the bounds that they set."""

    def __init__(self, torus: Torus, rules: Rules, state_at: _StateAt, row: int, sign: int) -> None:
        self._torus = torus
        self._rules = rules
        self._state_at = state_at
        self._row = row
        self._sign = sign
        self.points = list[Points]()
        self._heights = list[float]()
        self._slopes = list[Array]()
        self._scalars = list[Array]()
        # at no deviations; whether no state is higher
        self._tangents = list[float]()
        self._is_bound = list[bool]()

    @property
    def height(self) -> float:
        """Height of the highest state [rad]."""
        return max(self._heights)

    @property
    def top(self) -> Points:
        """Point of the highest state."""
        return self.points[int(np.argmax(self._heights))]

    def visit(self, point: Points) -> bool:
        """Solve the state at a point; whether it has an answer, and there was room."""
        if len(self.points) == _MOST_STATES:
            return False
        rotation, slope = self._state_at(self._torus.scalars(np.array([self._row]), point[None])[0])
        if np.isfinite(rotation):
            self.add(point, rotation, slope)
        return bool(np.isfinite(rotation))

    def add(self, point: Points, rotation: float, slope: Array) -> None:
        """Add the state at a point by its rotation [rad] and slope [rad/mm]."""
        scalars = self._torus.scalars(np.array([self._row]), point[None])[0]
        height = self._sign * rotation
        slope = self._sign * slope
        gain = self._rules.gain
        tangent = height - slope @ scalars
        is_bound = True
        for i, other in enumerate(self._scalars):
            self._is_bound[i] &= bool(self._tangents[i] + self._slopes[i] @ scalars >= height - gain)
            is_bound &= bool(tangent + slope @ other >= self._heights[i] - gain)
        self.points.append(point)
        self._heights.append(height)
        self._slopes.append(slope)
        self._scalars.append(scalars)
        self._tangents.append(tangent)
        self._is_bound.append(is_bound)

    def go_up(self, radius: float, highest: float) -> None:
        """Go on to the state that all bounds let be the highest, so many steps around the top, until they let none."""
        torus = self._torus
        for _ in range(self._rules.steps):
            reach = min(int(radius + 0.5), _WIDEST_LOOK)
            top = self.top
            before = self.height
            bounds = np.flatnonzero(self._is_bound | (np.arange(len(self.points)) == np.argmax(self._heights)))
            steps = np.arange(-reach, reach + 1)
            slopes = np.array(self._slopes)[bounds]
            by_b = torus.by_b[self._row, (top[0] + steps) % torus.by_b.shape[1]] @ slopes.T
            by_g = torus.by_g[self._row, (top[1] + steps) % torus.by_g.shape[1]] @ slopes.T
            model = (np.array(self._tangents)[bounds] + by_b[:, None] + by_g).min(axis=2)
            model[(steps[:, None] + steps) % torus.finest != 0] = -np.inf
            for at in np.array(self.points) - top + reach:
                if (at >= 0).all() and (at <= 2 * reach).all():
                    model[tuple(at)] = -np.inf
            best = np.unravel_index(model.argmax(), model.shape)
            if not model[best] > max(before, highest) + self._rules.gain or not self.visit(top + best - reach):
                return
            radius = radius if self.height > before else radius / 2


# --- the compiled walk

INSTRUCTIONS = {4: "AVX-512", 3: "AVX2", 1: "any machine"}


@cache
def walk_library() -> tuple[Any, str]:
    """The compiled walk for this machine, None where there is none, and words for which one it is or why not."""
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
    """All that an answer depends on in this process, but for the machine: source, versions, engine."""
    return (*program("cvxpy", "daqp"), "compiled" if walk_library()[0] else "numpy")


def digits_depend_on() -> tuple[str, ...]:
    """All that the last digits of an answer depend on, beside the question."""
    return (*program("daqp", "pydantic"), walk_library()[1], operating_system())


def _opened(path: Path) -> Any:
    """A library that says which source it is of: one of another source may lack functions."""
    opened: Any = ctypes.CDLL(str(path))
    opened.walk_source.restype = ctypes.c_char_p
    return opened


# of each function what it returns and takes: p pointer, i int, l long, d double, - nothing
_FUNCTIONS = {
    "walk_new": "ppp",
    "walk_free": "-p",
    "walk_solve": "lpldipppppppp",
    "walk_climb": "lpdipppdplppppppp",
    "walk_near": "iiiippppppdippp",
    "walk_read": "-lippppp",
}


def _load(path: Path) -> Any:
    """A library of this source, with the types of its functions."""
    loaded = _opened(path)
    kinds = {"p": ctypes.c_void_p, "i": ctypes.c_int, "l": ctypes.c_long, "d": ctypes.c_double, "-": None}
    for name, letters in _FUNCTIONS.items():
        function = getattr(loaded, name)
        result, *arguments = (kinds[letter] for letter in letters)
        function.argtypes = arguments
        function.restype = result
    return loaded


class Walk:
    """The compiled walk of one contact system."""

    climbed = 0  # states that climbs of all solved, and none proved: for studies

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

    def solve(self, gaps: StateGaps, torque: float, *, slope: bool = False) -> StateSums:
        """Sums and residuals of states; NaN where one was given up.

        Arguments: gaps; torque [N*mm]; slope, whether the slope of the rotation by the scalars is asked for.
        """
        scalars = np.ascontiguousarray(gaps.scalars, dtype=float)
        count, p = scalars.shape
        rotation, tooth_force = np.empty((2, count))
        moment = np.empty((count, 2))
        residual = np.empty((count, 4))
        slopes = np.empty((count, p)) if slope else None
        sums = rotation, moment, tooth_force, residual, slopes
        arrays = (scalars, *self._reference.of_teeth(gaps), *sums)  # held until the call has ended
        given_up = self._library.walk_solve(self._walk, count, torque, p, *map(_address, arrays))
        return StateSums(
            rotation=rotation,
            moment=moment,
            tooth_force=tooth_force,
            residuals=Residuals(residual),
            slope=slopes,
            given_up=given_up,
        )

    def climb(self, torus: Torus, torque: float, hills: Starts, rules: Rules) -> Points:
        """`climbed`, compiled; a state that is given up counts as none."""
        _, z_b, p = torus.by_b.shape
        z_g = torus.by_g.shape[1]
        groups = len(hills.row)
        sizes = [z_b, z_g, torus.finest, rules.steps, len(rules.radius) - 1]
        radius = rules.radius
        first = np.append(hills.first, len(hills.point))
        top = np.empty((groups, 2), dtype=np.int32)
        of_hills = first, hills.row, hills.sign, hills.point
        whole = [np.ascontiguousarray(each, np.int32) for each in (sizes, radius, *of_hills)]
        parts = [np.ascontiguousarray(part) for part in (torus.by_b, torus.by_g, hills.rotation, hills.slope)]
        begun = torque, p, _address(whole[0]), *map(_address, parts[:2]), rules.gain, _address(whole[1])
        states = map(_address, (*whole[2:], *parts[2:], top))
        solved = self._library.walk_climb(self._walk, *begun, groups, *states)
        if solved < 0:
            raise MemoryError
        Walk.climbed += solved
        return top.astype(np.int64)


def walk_near_state(
    formulation: Formulation, gaps: Array, right: Array, contact: NDArray[np.bool_]
) -> tuple[Array, Array] | None:
    """`pivoting.solve_near`, compiled."""
    system = formulation.system
    ends = np.append(system.first, len(gaps)).astype(np.int32)
    held = contact.astype(np.uint8)
    forces = np.empty(len(gaps))
    duals = np.empty(len(right))
    data = (formulation.H, formulation.local, ends, formulation.A, np.ascontiguousarray(gaps), right)
    sizes = len(gaps), len(system.first), len(right)
    made = map(_address, (held, forces, duals))
    found = walk_library()[0].walk_near(*sizes, *map(_address, data), SOFT, NEAR_STEPS, *made)
    return (forces, duals) if found else None


def read_table(table: Array, places: Array, factors: Array) -> Array:
    """Values of a table between its points, shape (points,), interpolated linearly over its axes; NaN beyond its ends.

    Arguments: table, at each point a value and its slopes by factors, shape (*axes, 1 + factors), of four axes;
    places along these, shape (points, 4); factors, shape (points, factors).
    """
    table, places, factors = map(np.ascontiguousarray, (table, places, factors))
    if library := walk_library()[0]:
        shape = np.array(table.shape[:-1], dtype=np.int32)
        values = np.empty(len(places))
        library.walk_read(len(places), table.shape[-1], *map(_address, (shape, table, places, factors, values)))
        return values
    from scipy.ndimage import map_coordinates  # imported in as much time as a check takes

    value, *slopes = (map_coordinates(part, places.T, order=1, cval=np.nan) for part in np.moveaxis(table, -1, 0))
    return np.asarray(value + (np.transpose(slopes) * factors).sum(axis=1))


def _address(array: Any) -> int | None:
    return None if array is None else array.ctypes.data
