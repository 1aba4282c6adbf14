"""The walk over states in numpy: the engine for installations without a compiled walk, and the reference for its tests.

At a given contact set, the forces of the contacts and the gaps of the other candidates (the values) are linear in the
gaps without force. A state whose values are all positive is solved, however the contact set was found. If a value is
negative, its candidate changes sides, which is one principal pivot and a rank-one update. The tableau contains columns
of many states, so that each contact set is tried on all of them, in the same way as Ferreau, Bock and Diehl (2008, doi
10.1002/rnc.1251) follow a solution from one problem to the next.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.model.contacts import StateGaps
from hdassist.drive.model.geometry import Array
from hdassist.drive.solve.answers import StateSums, rotation_slopes
from hdassist.drive.solve.formulation import Formulation, Reference, Springs

_ZERO = 1e-10  # largest negative value, in units of the programme, that counts as zero
SOFT = 1e-6  # stiffness, in units of the programme, of the springs that hold loose parts
NEAR_STEPS = 100  # largest number of steps of the method for one state; most states take a dozen
# number of steps without a decrease in sign changes after which only one candidate at a time changes sides
_NEAR_PATIENCE = 10
_ABREAST = 64  # largest number of states in one tableau
LIMIT = 10  # largest number of pivots per candidate and state of a tableau
SMALLEST = 1e-9  # smallest allowed pivot; the pivots of the reference are one, and others ranged from 1e-3 to 1e3


class Pivoting:
    """Solver of many states at the same time, from one reference.

    The tableau contains only candidates that change sides in some state (the swing). The values of all other candidates
    follow from theirs. A candidate whose value is negative in a state joins the swing.
    """

    def __init__(self, formulation: Formulation, reference: Reference) -> None:
        self._formulation = formulation
        self._reference = reference
        # the swing persists between calls, because the states of one drive alternate between a few contact sets
        self._swing = np.zeros(0, dtype=int)

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
        system = self._formulation.system
        forces, free = self.forces(gaps, torque)
        slopes = rotation_slopes(self._formulation, forces, gaps.scalars.shape[1]) if slope else None
        return StateSums.of(
            system,
            system.delta_p_of(gaps),
            torque,
            forces,
            free,
            slope=slopes,
        )

    def forces(self, gaps: StateGaps, torque: float) -> tuple[Array, Array]:
        """Return forces [N], shape (states, M), and free displacements [mm, rad], NaN for a state that was given up."""
        law = self._reference.arrays["law"]
        _, teeth_coordinates = self._reference.of_teeth(gaps)
        # the start is linear in torque and deviations, so it needs no solution
        start = law[0] + torque * law[1] + gaps.scalars @ law[2 : 2 + gaps.scalars.shape[1]]
        if teeth_coordinates is not None:
            start = start + teeth_coordinates
        # states are solved in blocks, because the tableau grows with their number
        forces = []
        free = []
        for first in range(0, max(len(gaps), 1), _ABREAST):
            # states of a block share their pivots, because neighbours have similar contacts
            batch_forces, batch_free = self._abreast(start[first : first + _ABREAST])
            forces.append(batch_forces)
            free.append(batch_free)
        return np.concatenate(forces), np.concatenate(free)

    def _abreast(self, start: Array) -> tuple[Array, Array]:
        """Return forces [N] and free displacements [mm, rad] of states that share a tableau.

        Args:
            start: coordinates of the states at the reference, shape (states, m + free).
        """
        reference = self._reference
        arrays = reference.arrays
        place = arrays["place"]
        m = len(arrays["by_places"])
        coordinates = np.empty_like(start)
        values = np.zeros((len(start), len(place)))
        # opposite values of candidates that changed sides, otherwise 0
        opposite_values = np.zeros((len(start), len(place)))
        rows = np.arange(len(start))  # states to be solved with the present swing
        # the loop ends because the swing only grows, at most to all candidates
        while len(rows):
            swing = self._swing
            swing_values = self._pivoted(reference.values(start[rows], swing))
            opposite_values[np.ix_(rows, swing)] = swing_values
            # effect of the candidates that changed sides on the coordinates of all places
            by_swing = swing_values * arrays["weight"][swing] @ arrays["by_places"][place[swing]]
            coordinates[rows] = start[rows] + by_swing
            values[rows] = reference.values(coordinates[rows], np.arange(len(place)))
            is_missing = values[rows] < -_ZERO  # candidates that must join the swing
            # candidates of the swing are already solved; remaining negative values are below the tolerance
            is_missing[:, swing] = False
            rows = rows[is_missing.any(axis=1)]
            # states are solved again with the larger swing only if they need it
            self._swing = np.union1d(swing, np.flatnonzero(is_missing.any(axis=0)))
        return self._forces_of(values, opposite_values), coordinates[:, m:] * arrays["dual_unit"]

    def _forces_of(self, values: Array, opposite_values: Array) -> Array:
        """Return forces [N] from the values of candidates, or from the opposite values of those that changed sides."""
        arrays = self._reference.arrays
        # the value of a candidate that changed sides is its opposite value: a force instead of a gap, or the reverse
        has_changed = opposite_values != 0
        # gaps are multiplied by 0 below, and values of -1e-10 are rounding errors
        forces = np.maximum(np.where(has_changed, opposite_values, values), 0)
        forces *= np.where(has_changed, arrays["other_force"], arrays["value_force"])
        return forces

    def _tableau(self, start: Array) -> Array:
        """Return the tableau of the swing with the values of states as further columns, shape (swing, swing + states).

        Args:
            start: values of the swing at the reference, shape (states, swing).
        """
        arrays = self._reference.arrays
        swing = self._swing
        states, n = start.shape
        place = arrays["place"][swing]
        # responses between the places of the swing, shape (swing, swing)
        response = arrays["by_places"][np.ix_(place, place)].T
        # Fortran order lets BLAS update the tableau in place
        tableau = np.empty((n, n + states), order="F")
        tableau[:, :n] = arrays["gain"][swing, None] * response * arrays["weight"][swing] + np.diag(
            arrays["own"][swing]
        )
        # the states are further columns, so that a pivot acts on all of them at once
        tableau[:, n:] = start.T
        return tableau

    def _pivoted(self, start: Array) -> Array:
        """Return the opposite values of the swing that solve states, shape (states, swing).

        The values are 0 for a candidate that did not change sides and NaN for a state that was given up.

        Args:
            start: values of the swing at the reference, shape (states, swing).
        """
        from scipy.linalg.blas import dger  # importing scipy takes 0.1 s, which the compiled walk avoids

        states, n = start.shape
        tableau = self._tableau(start)
        # a view, so that each update of the tableau updates the values
        values = tableau[:, n:]  # values of all states at the present contact set
        has_changed = np.zeros(n, dtype=bool)
        solution = np.full(start.shape, np.nan)
        is_open = np.isfinite(start).all(axis=1)  # whether each state is still unsolved
        k = np.intp(0)  # state that the pivots currently aim at
        # choosing the most negative value is not guaranteed to terminate, hence the limit
        for _ in range(LIMIT * (n + states)):
            smallest_value = values.min(axis=0, initial=0)
            # no value is negative in a solved state; complementarity holds by construction, because a candidate has
            # only one of the two values
            is_solved = is_open & (smallest_value >= -_ZERO)
            solution[is_solved] = values[:, is_solved].T * has_changed
            is_open &= ~is_solved
            if not is_open.any():
                break
            if not is_open[k]:
                k = np.where(is_open, smallest_value, -np.inf).argmax()  # the unsolved state nearest to its solution
            # the candidate with the most negative value changes sides
            r = values[:, k].argmin()
            # copies, because the update below overwrites both
            column = tableau[:, r].copy()
            row = tableau[r].copy()
            pivot = column[r]
            if not pivot > SMALLEST:  # with this pivot no contact would hold the torque, so the state is given up
                is_open[k] = False
                continue
            # with these entries one rank-one update is also correct for the row and column of the pivot
            column[r] = pivot + 1
            row[r] = pivot - 1
            dger(
                -1 / pivot,
                column,
                row,
                a=tableau,
                overwrite_x=1,
                overwrite_y=1,
                overwrite_a=1,
            )
            has_changed[r] = not has_changed[r]
        return solution


@dataclass(frozen=True)
class _NearStep:
    """One state at a trial contact set."""

    forces: Array  # forces of candidates, whose signs are not yet checked, shape (M,)
    open_gaps: Array  # gaps of candidates, shape (M,)
    duals: Array  # duals of the equilibrium, shape (free,)
    is_loose: bool  # whether no contact holds the parts, so that soft springs hold them

    def violations(self, contact: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Return the candidates that are in contact with a negative force or open with a negative gap."""
        return np.flatnonzero(np.where(contact, self.forces, self.open_gaps) < -_ZERO)


def solve_near(
    formulation: Formulation,
    gaps: Array,
    right: Array,
    contact: NDArray[np.bool_],
) -> tuple[Array, Array] | None:
    """Return forces, shape (M,), and duals, shape (free,), of one state; None if the method gives up.

    Sets of candidates change sides until none needs to: a primal-dual active-set method (Hintermueller, Ito, Kunisch
    2003, doi 10.1137/S1052623401383558). If their number does not decrease, one candidate at a time changes sides,
    which cannot cycle (Judice and Pires 1994, doi 10.1016/0305-0548(94)90106-6). The method needs no preparation, so it
    is suitable if every state has its own matrices. All numbers are in units of the programme.

    Args:
        formulation: the programme.
        gaps: gaps without force, shape (M,).
        right: right-hand side of the equilibrium A x = right, shape (free,).
        contact: candidates expected to carry force, shape (M,).
    """
    patience = _NEAR_PATIENCE
    # more violations than any step can have
    fewest = len(gaps) + 1
    for _ in range(NEAR_STEPS):
        # the solution is exact for the trial contact set; only the set may be wrong
        step = _solved_at(formulation, gaps, right, contact)
        if step is None:
            return None
        violations = step.violations(contact)
        # without a negative force or gap, this is the solution
        if not (step.is_loose or len(violations)):
            return np.maximum(step.forces, 0), step.duals
        if step.is_loose or len(violations) < fewest:
            patience = _NEAR_PATIENCE
            fewest = len(violations)
        else:
            patience -= 1
        contact = contact.copy()
        # changing only the last violation is the rule of least index in reverse order, which ends after finitely many
        # steps
        contact[violations if patience >= 0 else violations[-1:]] ^= True
    return None


def _solved_at(
    formulation: Formulation,
    gaps: Array,
    right: Array,
    contact: NDArray[np.bool_],
) -> _NearStep | None:
    """Solve one state at a contact set, with the arguments of `solve_near`; None if the numbers overflow."""
    # the unknowns are the forces of places in contact and the displacements of the free freedoms
    structure = formulation.structure
    place = formulation.system.place
    m = len(formulation.H)
    springs = Springs.of(formulation, gaps, contact)
    inside = np.append(np.flatnonzero(springs.series), np.arange(m, len(structure)))  # places in contact and duals
    # rows of the equilibrium have no compliance
    series = np.append(springs.series, np.zeros(len(right)))
    matrix = structure[np.ix_(inside, inside)] + np.diag(series[inside])
    right_side = np.append(-springs.lowest - springs.offset, right)
    solution = np.zeros(len(structure))
    solution[inside], is_loose = _solved_or_loose(matrix, right_side[inside], inside >= m)
    if not np.all(np.isfinite(solution)):
        return None
    # gap of each candidate due to the displacement of its place, without the candidate's own compliance
    open_gaps = gaps + (structure[:m, inside] @ solution[inside])[place]
    # approach of each place, from which each station takes its part according to its own gap
    approach = series[:m] * solution[:m] + springs.offset
    forces = np.where(contact, (approach[place] - springs.excess) / formulation.local, 0.0)
    return _NearStep(
        forces=forces,
        open_gaps=open_gaps,
        duals=solution[m:],
        is_loose=is_loose,
    )


def _solved_or_loose(
    matrix: Array,
    right_side: Array,
    is_dual: NDArray[np.bool_],
) -> tuple[Array, bool]:
    """Return the solution of a system, and whether it needs soft springs.

    If no contact holds the parts, soft springs let them move until a contact does.

    Args:
        matrix: matrix of the system, shape (unknowns, unknowns).
        right_side: right-hand side, shape (unknowns,).
        is_dual: whether each unknown is a displacement of a part, shape (unknowns,).
    """
    try:
        return np.asarray(np.linalg.solve(matrix, right_side)), False
    except np.linalg.LinAlgError:
        softened = matrix - SOFT * np.diag(is_dual)
        return np.asarray(np.linalg.lstsq(softened, right_side)[0]), True
