"""From hills of the rotation to its highest states by slopes, in numpy: where no walk was compiled, and its oracle.

States are places of both wheels on a torus. The tangent of a state, straight in the scalars, is exact while contacts
stay as they are, and bounds the others from above until one of them is higher. The next state is the one that all
bounds, and the tangent of the highest state, let be the highest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.model.geometry import Array

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
            at, z = point[:, wheel], part.shape[1]
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
    tops, ends = [], np.append(hills.first[1:], len(hills.point))
    for first, end, row, sign in zip(hills.first, ends, hills.row, hills.sign, strict=True):
        highest = -np.inf
        for hill in range(first, end):
            climb = _Climb(torus, rules, state_at, int(row), int(sign))
            climb.add(hills.point[hill], hills.rotation[hill], hills.slope[hill])
            climb.go_up(radius, highest)
            if climb.height > highest:
                best, highest = climb, climb.height
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
        self._torus, self._rules, self._state_at, self._row, self._sign = torus, rules, state_at, row, sign
        self.points, self._heights = list[Points](), list[float]()
        self._slopes, self._scalars = list[Array](), list[Array]()
        self._tangents, self._is_bound = list[float](), list[bool]()  # at no deviations; whether no state is higher

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
        height, slope, gain = self._sign * rotation, self._sign * slope, self._rules.gain
        tangent, is_bound = height - slope @ scalars, True
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
            reach, top, before = min(int(radius + 0.5), _WIDEST_LOOK), self.top, self.height
            bounds = np.flatnonzero(self._is_bound | (np.arange(len(self.points)) == np.argmax(self._heights)))
            steps, slopes = np.arange(-reach, reach + 1), np.array(self._slopes)[bounds]
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
