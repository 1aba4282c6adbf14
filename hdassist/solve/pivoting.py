"""The walk over states in numpy: the engine where none was compiled, and the oracle of walk.c.

At a contact set that is fixed, forces of the contacts and gaps of the others (the values) are linear in the gaps
without force. A state whose values are all positive there is solved, whichever way that set was found; where one is
negative, that candidate changes sides: one principal pivot, a rank-one update. Columns of many states are carried along
in the tableau, so that each set is tried on all of them, as Ferreau, Bock and Diehl (2008, doi 10.1002/rnc.1251) follow
a solution from one problem to the next.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.model.contacts import StateGaps
from hdassist.model.geometry import Array
from hdassist.solve.answers import StateSums, rotation_slopes
from hdassist.solve.formulation import Formulation, Reference, Springs

_ZERO = 1e-10  # a value this far below zero counts as zero, in the programme's units
SOFT = 1e-6  # stiffness, in the programme's units, of the springs that hold loose parts
NEAR_STEPS = 100  # most steps of the method for one state; most states take a dozen
_NEAR_PATIENCE = 10  # steps without fewer candidates that change sides, after which only one at a time does
_ABREAST = 64  # states in one tableau
LIMIT = 10  # most pivots for each candidate and state of a tableau
SMALLEST = 1e-9  # smallest pivot; those of the reference are one, and others were 1e-3 to 1e3


class Pivoting:
    """Solves states from one reference, many of them abreast.

    Only candidates that change sides in some state (the swing) are in the tableau. The values of all other candidates
    follow from theirs; a candidate whose value is negative in a state joins the swing.
    """

    def __init__(self, formulation: Formulation, reference: Reference) -> None:
        self._formulation = formulation
        self._reference = reference
        # grows from call to call: states of one drive swing between few contact sets
        self._swing = np.zeros(0, dtype=int)

    def solve(
        self,
        gaps: StateGaps,
        torque: float,
        *,
        slope: bool = False,
    ) -> StateSums:
        """Return sums and residuals of states, NaN for a state that was given up.

        Args:
            gaps: of the states.
            torque: on the flexspline [N*mm].
            slope: also compute the slope of the rotation by the scalars.
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
        # linear in torque and deviations: no state is solved to state its start
        start = law[0] + torque * law[1] + gaps.scalars @ law[2 : 2 + gaps.scalars.shape[1]]
        if teeth_coordinates is not None:
            start = start + teeth_coordinates
        # blocks of states: the tableau grows with their number
        forces = []
        free = []
        for first in range(0, max(len(gaps), 1), _ABREAST):
            # states of a block share the pivots, as neighbours have similar contacts
            batch_forces, batch_free = self._abreast(start[first : first + _ABREAST])
            forces.append(batch_forces)
            free.append(batch_free)
        return np.concatenate(forces), np.concatenate(free)

    def _abreast(self, start: Array) -> tuple[Array, Array]:
        """Return forces [N] and free displacements [mm, rad] of states abreast.

        Args:
            start: coordinates of the states at the reference, shape (states, m + free).
        """
        reference = self._reference
        arrays = reference.arrays
        place = arrays["place"]
        m = len(arrays["by_places"])
        coordinates = np.empty_like(start)
        values = np.zeros((len(start), len(place)))
        opposite_values = np.zeros((len(start), len(place)))  # of candidates that changed sides, else 0
        rows = np.arange(len(start))  # states to be solved with the present swing
        # ends because the swing only grows, at most to all candidates
        while len(rows):
            swing = self._swing
            swing_values = self._pivoted(reference.values(start[rows], swing))
            opposite_values[np.ix_(rows, swing)] = swing_values
            # what candidates that changed sides do to the coordinates of all places
            by_swing = swing_values * arrays["weight"][swing] @ arrays["by_places"][place[swing]]
            coordinates[rows] = start[rows] + by_swing
            values[rows] = reference.values(coordinates[rows], np.arange(len(place)))
            is_missing = values[rows] < -_ZERO  # candidates that have to join the swing
            # a candidate of the swing is solved already; what remains negative is below the tolerance
            is_missing[:, swing] = False
            rows = rows[is_missing.any(axis=1)]
            # all states are solved again with the larger swing only if they need it
            self._swing = np.union1d(swing, np.flatnonzero(is_missing.any(axis=0)))
        return self._forces_of(values, opposite_values), coordinates[:, m:] * arrays["dual_unit"]

    def _forces_of(self, values: Array, opposite_values: Array) -> Array:
        """Return forces [N] from values of candidates, or the opposite ones of those that changed sides."""
        arrays = self._reference.arrays
        # a candidate that changed sides has its opposite value: a force instead of a gap, or the reverse
        has_changed = opposite_values != 0
        # gaps have the factor 0 below, and values of -1e-10 are rounding
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
        # the responses between places of the swing, shape (swing, swing)
        response = arrays["by_places"][np.ix_(place, place)].T
        # in the order of Fortran, in which BLAS updates it in place
        tableau = np.empty((n, n + states), order="F")
        tableau[:, :n] = arrays["gain"][swing, None] * response * arrays["weight"][swing] + np.diag(
            arrays["own"][swing]
        )
        # a pivot acts on all states at once: they are further columns
        tableau[:, n:] = start.T
        return tableau

    def _pivoted(self, start: Array) -> Array:
        """Return the opposite values of the swing that solve states, shape (states, swing).

        They are 0 for a candidate that did not change sides, NaN for a state that was given up.

        Args:
            start: values of the swing at the reference, shape (states, swing).
        """
        from scipy.linalg.blas import dger  # its import takes 0.1 s, which the compiled walk does without

        states, n = start.shape
        tableau = self._tableau(start)
        # a view: each update of the tableau updates the values
        values = tableau[:, n:]  # of all states at the present contact set
        has_changed = np.zeros(n, dtype=bool)
        solution = np.full(start.shape, np.nan)
        is_open = np.isfinite(start).all(axis=1)  # states that are not solved yet
        k = np.intp(0)  # the state that the pivots lead to
        # by the most negative value, which cannot be proven to end, hence the limit
        for _ in range(LIMIT * (n + states)):
            smallest_value = values.min(axis=0, initial=0)
            # no value is negative there: complementarity holds by construction, as a candidate has one of both values
            is_solved = is_open & (smallest_value >= -_ZERO)
            solution[is_solved] = values[:, is_solved].T * has_changed
            is_open &= ~is_solved
            if not is_open.any():
                break
            if not is_open[k]:
                k = np.where(is_open, smallest_value, -np.inf).argmax()  # the open state nearest to its solution
            # the candidate that violates its sign most changes sides
            r = values[:, k].argmin()
            # copies: the update below overwrites both
            column = tableau[:, r].copy()
            row = tableau[r].copy()
            pivot = column[r]
            if not pivot > SMALLEST:  # after this pivot no contact would hold the torque: the state is given up
                is_open[k] = False
                continue
            # with these entries one rank-one update serves the pivot's row and column as well
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

    forces: Array  # of candidates, not yet checked for their sign, shape (M,)
    open_gaps: Array  # shape (M,)
    duals: Array  # shape (free,)
    is_loose: bool  # no contact holds the parts: soft springs hold them

    def violations(self, contact: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Return the candidates with a negative force in contact or a negative gap."""
        return np.flatnonzero(np.where(contact, self.forces, self.open_gaps) < -_ZERO)


def solve_near(
    formulation: Formulation,
    gaps: Array,
    right: Array,
    contact: NDArray[np.bool_],
) -> tuple[Array, Array] | None:
    """Return forces, shape (M,), and duals, shape (free,), of one state; None if the method gives up.

    Sets of candidates change sides until none has to: a primal-dual active-set method (Hintermueller, Ito, Kunisch
    2003, doi 10.1137/S1052623401383558). If their number does not fall, one at a time changes, which cannot cycle
    (Judice and Pires 1994, doi 10.1016/0305-0548(94)90106-6). The method needs no set-up, so it serves if every state
    has matrices of its own. All numbers are in the programme's units.

    Args:
        formulation: the programme.
        gaps: without force, shape (M,).
        right: right side of the equilibrium A x = right, shape (free,).
        contact: candidates expected to carry force, shape (M,).
    """
    patience = _NEAR_PATIENCE
    # no step can have more violations than candidates
    fewest = len(gaps) + 1
    for _ in range(NEAR_STEPS):
        # exact for the trial contact set; only the set may be wrong
        step = _solved_at(formulation, gaps, right, contact)
        if step is None:
            return None
        violations = step.violations(contact)
        # no force is negative and no gap is negative: this is the solution
        if not (step.is_loose or len(violations)):
            return np.maximum(step.forces, 0), step.duals
        if step.is_loose or len(violations) < fewest:
            patience = _NEAR_PATIENCE
            fewest = len(violations)
        else:
            patience -= 1
        contact = contact.copy()
        # the last violation alone is the rule of least index in reverse, which ends after finitely many steps
        contact[violations if patience >= 0 else violations[-1:]] ^= True
    return None


def _solved_at(
    formulation: Formulation,
    gaps: Array,
    right: Array,
    contact: NDArray[np.bool_],
) -> _NearStep | None:
    """Solve one state at a contact set, with the arguments of solve_near; None if the numbers overflow."""
    # unknowns: the forces of places in contact, and the displacements of the free freedoms
    structure = formulation.structure
    place = formulation.system.place
    m = len(formulation.H)
    springs = Springs.of(formulation, gaps, contact)
    inside = np.append(np.flatnonzero(springs.series), np.arange(m, len(structure)))  # places in contact, and duals
    # equilibrium rows have no compliance of their own
    series = np.append(springs.series, np.zeros(len(right)))
    matrix = structure[np.ix_(inside, inside)] + np.diag(series[inside])
    right_side = np.append(-springs.lowest - springs.offset, right)
    solution = np.zeros(len(structure))
    solution[inside], is_loose = _solved_or_loose(matrix, right_side[inside], inside >= m)
    if not np.all(np.isfinite(solution)):
        return None
    # gap of each candidate by the displacement of its place, without its own compliance
    open_gaps = gaps + (structure[:m, inside] @ solution[inside])[place]
    # approach of each place, from which each station takes its share by its own gap
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
    """Return the solution of a system, and whether it has none without soft springs.

    If no contact holds the parts, soft springs let them move until some contact does.

    Args:
        matrix: shape (unknowns, unknowns).
        right_side: shape (unknowns,).
        is_dual: whether an unknown is a displacement of a part, shape (unknowns,).
    """
    try:
        return np.asarray(np.linalg.solve(matrix, right_side)), False
    except np.linalg.LinAlgError:
        softened = matrix - SOFT * np.diag(is_dual)
        return np.asarray(np.linalg.lstsq(softened, right_side)[0]), True
