"""F'_ior by search: the greatest and the least error of the full cycle, without solving every state.

In state j each wheel stands j of its pitches on in the cam's frame, so the state is the point
(j mod z_b, j mod z_g) of a torus on which the error is continuous: neighbours there have nearly the same
deviations, however far apart they lie in the cycle. A coarse grid over the torus, climbs from its best points
and a close look around the best tops find what solving every state finds (compared in the tests, and on
random drives in benchmarks/). The error has ridges, where contacts change: they run along a wheel's own direction
more often than not, and a climb is stuck on them; the close look follows them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from hdassist.error.cycle import place
from hdassist.errors import UsageError
from hdassist.model.deviations import gaps
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics, pitch_locked_states
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.loadcase import LoadCase

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Effort:
    """How thorough a search is.

    cells: least number of coarse points around each wheel; climbs: coarse points that are climbed from,
    towards each extreme; looks: tops that are looked around in the end.
    """

    cells: int
    climbs: int
    looks: int


# Tuned on 450 random drives (benchmarks/search.py, seeds below 2000), of which it missed 0.002 arcsec at most.
THOROUGH = Effort(cells=12, climbs=30, looks=3)
# For searching among many drives: of the same it missed 4 % at most, and more than a hundredth of the error of four.
QUICK = Effort(cells=12, climbs=6, looks=0)
NEAR = 7  # pitches: how far a close look goes to every side
ALONG = 16  # pitches: how far it goes along each wheel, where the error has ridges that a climb is stuck on
LEVEL = 0.01  # of the coarse grid's range: a top this much lower than another one is looked around as well


@dataclass(frozen=True)
class Extremes:
    """F'_ior as found [arcsec], and the states j of the greatest and of the least error."""

    F_ior_arcsec: float
    at_max: int
    at_min: int
    certificate: Certificate


SEARCHED = 750  # states that a thorough search solves, about
QUICK_STATES = 270  # states that a quick one solves, about
WORTH = 4000  # states of a cycle from which on that pays


def searchable(drive: Drive) -> bool:
    """Whether the error is continuous on the torus: rolling balls do not come back with the wheels."""
    return drive.bearing.ball_motion == "locked"


def worth_searching(drive: Drive, least: int = WORTH) -> bool:
    """Whether a search is possible and solves fewer states than the cycle has: at least so many."""
    return searchable(drive) and Kinematics.of(drive).cycle_states >= least


class CycleSearch:
    """The full cycle of a drive at a torque M_g [N*m], searched for its extremes.

    Arguments: like, the search of a drive that differs a little, whose compiled programme this one takes over. Raises
    UsageError for a drive that is not searchable.
    """

    def __init__(self, drive: Drive, M_g: float, like: CycleSearch | None = None) -> None:
        if not searchable(drive):
            raise UsageError("with rolling balls every state has to be solved")
        self._M_g = M_g
        # never solves a state: every search starts from it alike and so gives the same digits
        self._fresh: LoadCase = LoadCase.of(drive, M_g, like=like._fresh if like else None)
        self._kinematics = Kinematics.of(drive)
        self._states = pitch_locked_states(self._kinematics)

    def extremes(self, drive: Drive, effort: Effort = THOROUGH) -> Extremes:
        """Extremes of a drive that differs from the first at most in its deviations and their phases.

        Raises UntrustedError where an answer cannot be trusted.
        """
        case = LoadCase(self._fresh.formulation, self._M_g, like=self._fresh)
        proofs = []

        def error(j: Indices) -> Array:
            states = self._states.take(j)
            answers = case.solve(gaps(drive, case.system, states), partial(place, states, self._M_g))
            proofs.append(answers.certificate)
            return self._kinematics.error_sign * answers.rotation_arcsec

        torus = _Torus(self._kinematics, error)
        grid = torus.grid(effort.cells)
        (greatest, at_max), (least, at_min) = (torus.top(grid, effort, sign) for sign in (1, -1))
        return Extremes(greatest + least, at_max, at_min, sum(proofs, EMPTY))


class _Torus:
    """The states by their coordinates (k, l) = (j mod z_b, j mod z_g), each solved once, when asked for."""

    def __init__(self, kinematics: Kinematics, solve: Callable[[Indices], Array]) -> None:
        self._shape = np.array([kinematics.z_b, kinematics.z_g])
        self._solve = solve
        j = np.arange(kinematics.cycle_states)
        self._state = np.full(self._shape, -1, dtype=np.int64)
        self._state[tuple(j % z for z in self._shape)] = j
        # both numbers of teeth even: k and l of every state are both even or both odd
        self._sparse = self._state[0, 1] < 0
        self._value = np.full(kinematics.cycle_states, np.nan)
        self.step = 0

    def at(self, points: Indices) -> Array:
        """Error at points, shape (..., 2)."""
        j = self._state[tuple(np.moveaxis(points % self._shape, -1, 0))]
        fresh, first = np.unique(j[np.isnan(self._value[j])], return_index=True)
        if len(fresh):
            fresh = fresh[np.argsort(first)]  # in the order asked for, in which neighbours follow each other
            self._value[fresh] = self._solve(fresh)
        return np.asarray(self._value[j])

    def around(self) -> Indices:
        """Steps of a close look, shape (steps, 2): NEAR on all sides, and ALONG each wheel's own direction."""
        near = set(product(range(-NEAR, NEAR + 1), repeat=2))
        along = set(product(range(-ALONG, ALONG + 1), (-1, 0, 1)))
        steps = sorted(near | along | {(l, k) for k, l in along} - {(0, 0)})
        return np.array([s for s in steps if not (self._sparse and sum(s) % 2)], dtype=np.int64)

    def grid(self, cells: int) -> Indices:
        """Points of a coarse grid, every other one left out as on a board, shape (points, 2).

        The step is even and a power of two. The order is there and back, so that neighbours follow each other.
        """
        self.step = 2 ** max(1, int(np.log2(max(self._shape.min() / cells, 2))))
        rows, columns = -(-self._shape // self.step)
        lines = [np.arange(row % 2, columns, 2)[:: -1 if row % 2 else 1] for row in range(rows)]
        points = np.concatenate([np.stack([np.full_like(line, row), line], axis=1) for row, line in enumerate(lines)])
        return np.asarray(points * self.step)

    def top(self, grid: Indices, effort: Effort, sign: int) -> tuple[float, int]:
        """Greatest value of sign * error that climbs from the grid find, and its state."""
        values = sign * self.at(grid)
        promising = np.flatnonzero(values + self._rise(grid, values) >= values.max())
        promising = promising[np.argsort(-values[promising], kind="stable")][: effort.climbs]
        tops = np.unique(self._climb(grid[promising], self.step // 2, sign) % self._shape, axis=0)
        height = sign * self.at(tops)
        tops = tops[np.argsort(-height, kind="stable")]
        if effort.looks:
            level = np.count_nonzero(height >= height.max() - LEVEL * np.ptp(values))
            tops = self._look(tops[: min(level, effort.looks)], self.around(), sign)
        height = sign * self.at(tops)
        best = int(np.argmax(height))
        return float(height[best]), int(self._state[tuple(tops[best] % self._shape)])

    def _rise(self, grid: Indices, values: Array) -> Array:
        """Half the way up to a neighbour, for each point: as much as may hide between two of them."""
        place = tuple((grid // self.step).T)
        board = np.full(np.max(place, axis=1) + 1, np.nan)
        board[place] = values
        ways = [np.abs(np.roll(board, step, (0, 1)) - board) for step in _DIAGONALS]
        return np.asarray(np.fmax.reduce(ways)[place] / 2)  # a field left out is not a number and does not count

    def _climb(self, points: Indices, step: int, sign: int) -> Indices:
        """Climb from points, shape (points, 2), all of them at once: a call for many states is worth its overhead."""
        while step:
            points = self._look(points, step * _DIAGONALS, sign)
            step //= 2
        return points

    def _look(self, points: Indices, steps: Indices, sign: int) -> Indices:
        """Go from each point to the best of those around it as long as there is a better one."""
        points, moving = points.copy(), np.arange(len(points))
        while len(moving):
            here = points[moving]
            values = sign * self.at(here[:, None] + steps)
            best = values.argmax(axis=1)
            better = values[np.arange(len(here)), best] > sign * self.at(here)
            moving = moving[better]
            points[moving] += steps[best[better]]
        return points


_DIAGONALS = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1), (2, 0), (-2, 0), (0, 2), (0, -2)])
