"""The walk over states in numpy: the engine where none was compiled, and the oracle of walk.c.

At a contact set that is fixed, forces of the contacts and gaps of the others (the values) are linear in the gaps
without force. A state whose values are all positive there is solved, whichever way that set was found; where one is
negative, that candidate changes sides: one principal pivot, a rank-one update. Columns of many states are carried along
in the tableau, so that each set is tried on all of them, as Ferreau, Bock and Diehl (2008, doi 10.1002/rnc.1251) follow
a solution from one problem to the next.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hdassist.model.contacts import StateGaps
from hdassist.model.geometry import Array
from hdassist.solve.answers import StateSums, rotation_slopes
from hdassist.solve.formulation import Formulation, Reference, Springs

_ZERO = 1e-10  # in the programme's units: a value this far below zero counts as zero
SOFT = 1e-6  # compliance, in the programme's units, that lets parts move by 1 under a millionth of a force unit
NEAR_STEPS = 100  # after which it is given up; most states take a dozen
_NEAR_PATIENCE = 10  # steps in which no fewer candidates change sides, after which one at a time does
_ABREAST = 64  # states that a tableau carries along
LIMIT = 10  # pivots for each candidate and state of a tableau, after which those that are left are given up
SMALLEST = 1e-9  # pivot, where those of the reference are one and others were 1e-3 to 1e3


class Pivoting:
    """Solves states from one reference, many of them abreast.

    Only candidates that change sides somewhere (the swing) are in the tableau; the others' values follow from theirs,
    are looked at for every state, and bring a candidate into the swing where one is negative.
    """

    def __init__(self, formulation: Formulation, reference: Reference) -> None:
        self._formulation = formulation
        self._reference = reference
        self._swing = np.zeros(0, dtype=int)

    def solve(self, gaps: StateGaps, torque: float, *, slope: bool = False) -> StateSums:
        """Sums and residuals of states; NaN where one was given up.

        Arguments: gaps; torque [N*mm]; slope, whether the slope of the rotation by the scalars is asked for.
        """
        system = self._formulation.system
        forces, free = self.forces(gaps, torque)
        slopes = rotation_slopes(self._formulation, forces, gaps.scalars.shape[1]) if slope else None
        return StateSums.of(system, system.delta_p_of(gaps), torque, forces, free, slope=slopes)

    def forces(self, gaps: StateGaps, torque: float) -> tuple[Array, Array]:
        """Forces [N], shape (states, M), and free displacements [mm, rad] of states; NaN where one was given up."""
        law = self._reference.arrays["law"]
        _, of_teeth = self._reference.of_teeth(gaps)
        start = law[0] + torque * law[1] + gaps.scalars @ law[2 : 2 + gaps.scalars.shape[1]]
        start = start if of_teeth is None else start + of_teeth
        parts = [self._abreast(start[first : first + _ABREAST]) for first in range(0, max(len(gaps), 1), _ABREAST)]
        forces, free = (np.concatenate(each) for each in zip(*parts, strict=True))
        return forces, free

    def _abreast(self, start: Array) -> tuple[Array, Array]:
        """Forces [N] and free displacements [mm, rad] of states from their coordinates at the reference."""
        reference = self._reference
        held = self._reference.arrays
        place = held["place"]
        m = len(held["by_places"])
        coordinates, others, values = np.empty_like(start), *np.zeros((2, len(start), len(place)))
        rows = np.arange(len(start))
        while len(rows):
            swing = self._swing
            others[np.ix_(rows, swing)] = found = self._pivoted(reference.values(start[rows], swing))
            coordinates[rows] = start[rows] + found * held["weight"][swing] @ held["by_places"][place[swing]]
            values[rows] = reference.values(coordinates[rows], np.arange(len(place)))
            missing = values[rows] < -_ZERO
            missing[:, swing] = False
            rows = rows[missing.any(axis=1)]
            self._swing = np.union1d(swing, np.flatnonzero(missing.any(axis=0)))
        changed = others != 0
        forces = np.maximum(np.where(changed, others, values), 0)
        forces *= np.where(changed, held["other_force"], held["value_force"])
        return forces, coordinates[:, m:] * held["dual_unit"]

    def _pivoted(self, start: Array) -> Array:
        """Others of the swing that solve each state, 0 where a candidate did not change sides; NaN where given up.

        Arguments: start, the values at the reference, shape (states, swing).
        """
        from scipy.linalg.blas import dger  # a tenth of a second, which the compiled walk saves

        held = self._reference.arrays
        swing = self._swing
        states, n = start.shape
        place = held["place"][swing]
        through = held["by_places"][np.ix_(place, place)].T
        tableau = np.empty((n, n + states), order="F")
        tableau[:, :n] = held["gain"][swing, None] * through * held["weight"][swing] + np.diag(held["own"][swing])
        tableau[:, n:] = start.T
        values = tableau[:, n:]
        changed = np.zeros(n, dtype=bool)
        solved = np.full(start.shape, np.nan)
        left = np.asarray(np.isfinite(start).all(axis=1))
        k = np.intp(0)
        for _ in range(LIMIT * (n + states)):
            least = values.min(axis=0, initial=0)
            done = left & (least >= -_ZERO)
            if done.any():
                solved[done] = values[:, done].T * changed
                left &= ~done
                if not left.any():
                    break
            if not left[k]:
                k = np.where(left, least, -np.inf).argmax()  # the nearest of those that are left
            r = values[:, k].argmin()
            column = tableau[:, r].copy()
            row = tableau[r].copy()
            pivot = column[r]
            if not pivot > SMALLEST:  # without it no contact would hold the torque: this state is given up
                left[k] = False
                continue
            # so that the one update serves row and column, too
            column[r] = pivot + 1
            row[r] = pivot - 1
            dger(-1 / pivot, column, row, a=tableau, overwrite_x=1, overwrite_y=1, overwrite_a=1)
            changed[r] = not changed[r]
        return solved


def solve_near(
    formulation: Formulation, gaps: Array, right: Array, contact: NDArray[np.bool_]
) -> tuple[Array, Array] | None:
    """Forces, shape (M,), and duals, shape (free,), of one state; None where the method gives up.

    Sets of candidates change sides until none has to: a primal-dual active-set method (Hintermueller, Ito, Kunisch
    2003, doi 10.1137/S1052623401383558); where they do not become fewer, one at a time, which cannot cycle (Judice and
    Pires 1994, doi 10.1016/0305-0548(94)90106-6). It needs no set-up and so serves where every state has matrices of
    its own.
    Arguments: formulation; gaps, shape (M,); right side of the equilibrium A x = right, shape (free,);
    contact, candidates thought to carry force, shape (M,). All in the programme's units.
    """
    structure = formulation.structure
    place = formulation.system.place
    m = len(formulation.H)
    patience = _NEAR_PATIENCE
    fewest = len(gaps) + 1
    for _ in range(NEAR_STEPS):
        springs = Springs.of(formulation, gaps, contact)
        inside = np.append(np.flatnonzero(springs.series), np.arange(m, len(structure)))  # places in contact, and duals
        series = np.append(springs.series, np.zeros(len(right)))
        system = structure[np.ix_(inside, inside)] + np.diag(series[inside])
        wanted = np.append(-springs.lowest - springs.offset, right)
        solution = np.zeros(len(structure))
        loose = False
        try:
            solution[inside] = np.linalg.solve(system, wanted[inside])
        except np.linalg.LinAlgError:  # no contact holds the parts: a soft spring lets them move on until some does
            loose = True
            system -= SOFT * np.diag(inside >= m)
            solution[inside] = np.linalg.lstsq(system, wanted[inside])[0]
        if not np.all(np.isfinite(solution)):
            return None
        open_gaps = gaps + (structure[:m, inside] @ solution[inside])[place]
        approach = series[:m] * solution[:m] + springs.offset
        forces = np.where(contact, (approach[place] - springs.above) / formulation.local, 0.0)
        moved = np.flatnonzero(np.where(contact, forces, open_gaps) < -_ZERO)
        if not (loose or len(moved)):
            return np.maximum(forces, 0), solution[m:]
        fewer = loose or len(moved) < fewest
        patience, fewest = (_NEAR_PATIENCE, len(moved)) if fewer else (patience - 1, fewest)
        contact = contact.copy()
        contact[moved if patience >= 0 else moved[-1:]] ^= True
    return None


#
