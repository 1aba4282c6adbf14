"""F'_ior by search: the greatest and the least error of the full cycle, without solving every state.

In state j each wheel stands j of its pitches on in the cam's frame, so the state is the point
(j mod z_b, j mod z_g) of a torus on which the error is continuous: neighbours there have nearly the same
deviations, however far apart they lie in the cycle. The torus is covered with cells. Each has five points, and
those that may hide an extreme between them are halved until every state in them is solved.

How much a cell hides is not proven. Where one zone alone holds the torque the error changes by 3 arcsec from pitch to
pitch of 37.5 um, and it may do so for a few pitches only: an island above the states around it, which no climb from
further off comes to. What is taken, HIDES of what a cell and its neighbours vary, is compared with every state of
random drives by `python -m benchmarks.search_study`.
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
from hdassist.model.deviations import state_gaps
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics, pitch_locked_states
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.loadcase import LoadCase

Indices = NDArray[np.int64]

CELLS = 12  # around each wheel to begin with, at least
HIDES = 0.25  # of what a cell and those around it vary: how far a state in it may lie beyond its five points
SMOOTH = 0.25  # of what a cell varies, what its parts are taken to vary at least: the share at a smooth top
EQUAL = 1e-3  # arcsec: a cell that may hide no more than this above the greatest error is left alone


@dataclass(frozen=True)
class Extremes:
    """F'_ior as found [arcsec], and the states j of the greatest and of the least error."""

    F_ior_arcsec: float
    at_max: int
    at_min: int
    certificate: Certificate


SEARCHED = 1500  # states that a search solves, about
WORTH = 4000  # states of a cycle from which on that pays


def searchable(drive: Drive) -> bool:
    """Whether the error is continuous on the torus: rolling balls do not come back with the wheels."""
    return drive.bearing.ball_motion == "locked"


def worth_searching(drive: Drive, least: int = WORTH) -> bool:
    """Whether a search is possible and solves fewer states than the cycle has: at least so many."""
    return searchable(drive) and Kinematics.of(drive).cycle_states >= least


class CycleSearch:
    """The full cycle of a drive at a torque M_g [N*m], searched for its extremes.

    Raises UsageError for a drive that is not searchable.
    """

    def __init__(self, drive: Drive, M_g: float) -> None:
        if not searchable(drive):
            raise UsageError("with rolling balls every state has to be solved")
        self._M_g = M_g
        # never solves a state: every search starts from it alike and so gives the same digits
        self._fresh: LoadCase = LoadCase.of(drive, M_g)
        self._kinematics = Kinematics.of(drive)
        self._states = pitch_locked_states(self._kinematics)

    def extremes(self, drive: Drive) -> Extremes:
        """Extremes of a drive that differs from the first at most in its deviations and their phases.

        Raises UntrustedError where an answer cannot be trusted.
        """
        case = LoadCase(self._fresh.formulation, self._M_g, like=self._fresh)
        proofs = []

        def error(j: Indices) -> Array:
            states = self._states.take(j)
            answers = case.solve(state_gaps(drive, case.system, states), partial(place, states, self._M_g))
            proofs.append(answers.certificate)
            return self._kinematics.error_sign * answers.rotation_arcsec

        found = Torus(self._kinematics, error).solve_around_extremes()
        at_max, at_min = int(np.nanargmax(found)), int(np.nanargmin(found))
        return Extremes(float(found[at_max] - found[at_min]), at_max, at_min, sum(proofs, EMPTY))


def lattice(kinematics: Kinematics) -> tuple[Indices, int]:
    """States j by their coordinates, shape (z_b, z_g), -1 where there is none; steps from one to the next along each.

    Where both numbers of teeth are even, k and l of every state are both even or both odd: steps of two.
    """
    j = np.arange(kinematics.cycle_states)
    board = np.full((kinematics.z_b, kinematics.z_g), -1, dtype=np.int64)
    board[j % kinematics.z_b, j % kinematics.z_g] = j
    return board, 2 if board[0, 1] < 0 else 1


class Torus:
    """The states by their coordinates (k, l) = (j mod z_b, j mod z_g), each solved once, when asked for.

    Arguments: solve, which gives the errors of states j.
    """

    def __init__(self, kinematics: Kinematics, solve: Callable[[Indices], Array]) -> None:
        self._state, self._finest = lattice(kinematics)
        self._shape = np.array(self._state.shape)
        self._solve = solve
        self._value = np.full(kinematics.cycle_states, np.nan)

    def solve_around_extremes(self) -> Array:
        """Errors [arcsec], shape (states,), of what was solved to find the extremes; NaN for all other states."""
        side, corners = self._cover()
        values = self._at_cells(corners, side)
        variation = self._around(values, side)
        while side.max() > self._finest:
            hidden = HIDES * variation - EQUAL
            highest, lowest = values.max(axis=1), values.min(axis=1)
            kept = (highest + hidden > highest.max()) | (lowest - hidden < lowest.min())
            if not kept.any():
                break
            halved = side > self._finest
            side = side // (1 + halved)
            parts = np.unique(_CORNERS * halved, axis=0)
            corners = (corners[kept, None] + side * parts).reshape(-1, 2)
            values = self._at_cells(corners, side)
            variation = np.maximum(np.ptp(values, axis=1), SMOOTH * np.repeat(variation[kept], len(parts)))
        return self._value

    def _cover(self) -> tuple[Indices, Indices]:
        """Cells all over the torus, the last ones across its seam: their sides, shape (2,), and corners (cells, 2).

        They are half as long around the wheel around which the error varies more: islands are as much narrower there.
        """
        side = np.repeat(2 ** max(1, int(np.log2(max(self._shape.min() / CELLS, 2)))), 2)
        board = self._at(self._corners(side)).reshape(self._cells(side))
        steeper = int(np.argmax([np.abs(np.roll(board, 1, axis) - board).sum() for axis in (0, 1)]))
        side[steeper] = max(side[steeper] // 2, self._finest)
        return side, self._corners(side)

    def _cells(self, side: Indices) -> Indices:
        """How many cells cover the torus along each coordinate, shape (2,)."""
        return np.asarray(-(-self._shape // side))

    def _corners(self, side: Indices) -> Indices:
        """First corners of the cells that cover the torus, row by row, shape (cells, 2)."""
        rows, columns = self._cells(side)
        return np.asarray(side * list(product(range(rows), range(columns))))

    def _around(self, values: Array, side: Indices) -> Array:
        """How much the values, shape (cells, points), of each cell and of those around it vary, shape (cells,)."""
        board = values.reshape(*self._cells(side), -1)
        around = [np.roll(board, step, (0, 1)) for step in product((-1, 0, 1), repeat=2)]
        return np.asarray(np.ptp(np.concatenate(around, axis=2), axis=2).ravel())

    def _at_cells(self, corners: Indices, side: Indices) -> Array:
        """Error [arcsec] at the corners and about the middle of cells, shape (cells, 5)."""
        middle = side // 2
        middle[1] += (self._finest - 1) * (middle.sum() % 2)  # to where there is a state
        return self._at(corners[:, None] + np.concatenate([side * _CORNERS, [middle]]))

    def _at(self, points: Indices) -> Array:
        """Error [arcsec] at points, shape (..., 2)."""
        j = self._state[tuple(np.moveaxis(points % self._shape, -1, 0))]
        fresh, first = np.unique(j[np.isnan(self._value[j])], return_index=True)
        if len(fresh):
            fresh = fresh[np.argsort(first)]  # in the order asked for, in which neighbours follow each other
            self._value[fresh] = self._solve(fresh)
        return np.asarray(self._value[j])


_CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
