"""One state near a contact set, without the set-up that many states of one system would pay for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hdassist.model.geometry import Array
from hdassist.solve.formulation import Formulation, Springs

ZERO = 1e-10  # in the programme's units: a value this far below zero counts as zero
SOFT = 1e-6  # compliance, in the programme's units, that lets parts move by 1 under a millionth of a force unit
NEAR_STEPS = 100  # after which it is given up; most states take a dozen
NEAR_PATIENCE = 10  # steps in which no fewer candidates change sides, after which one at a time does


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
    structure, place, m = formulation.structure, formulation.system.place, len(formulation.H)
    patience, fewest = NEAR_PATIENCE, len(gaps) + 1
    for _ in range(NEAR_STEPS):
        springs = Springs.of(formulation, gaps, contact)
        inside = np.append(np.flatnonzero(springs.series), np.arange(m, len(structure)))  # places in contact, and duals
        series = np.append(springs.series, np.zeros(len(right)))
        system = structure[np.ix_(inside, inside)] + np.diag(series[inside])
        wanted, solution, loose = np.append(-springs.lowest - springs.offset, right), np.zeros(len(structure)), False
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
        moved = np.flatnonzero(np.where(contact, forces, open_gaps) < -ZERO)
        if not (loose or len(moved)):
            return np.maximum(forces, 0), solution[m:]
        fewer = loose or len(moved) < fewest
        patience, fewest = (NEAR_PATIENCE, len(moved)) if fewer else (patience - 1, fewest)
        contact = contact.copy()
        contact[moved if patience >= 0 else moved[-1:]] ^= True
    return None
