"""One state near a contact set, without the set-up that many states of one system would pay for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hdassist.model.geometry import Array
from hdassist.solve.formulation import Formulation
from hdassist.solve.pivoting import ZERO

SOFT = 1e-6  # compliance, in the programme's units, that lets parts move by 1 under a millionth of a force unit
STEPS = 100  # after which it is given up; most states take a dozen
PATIENCE = 10  # steps in which no fewer candidates change sides, after which one at a time does


def solve_near(
    formulation: Formulation, gaps: Array, right: Array, contact: NDArray[np.bool_]
) -> tuple[Array, Array] | None:
    """Forces, shape (M,), and duals, shape (free,), of one state; None where the method gives up.

    Sets of candidates change sides until none has to: a primal-dual active-set method (Hintermueller, Ito, Kunisch
    2003, doi 10.1137/S1052623401383558); where they do not become fewer, one at a time, which cannot cycle (Judice and
    Pires 1994, doi 10.1016/0305-0548(94)90106-6). It needs no set-up and so serves where every state has matrices of
    its own.
    Arguments: formulation; gaps, shape (M,); right side of the equilibrium, shape (free,);
    contact, candidates thought to carry force, shape (M,). All in the programme's units.
    """
    H, local, place, first = formulation.H, formulation.local, formulation.system.place, formulation.system.first
    A = formulation.A_places
    free, lowest = len(A), gaps[first]
    above = gaps - lowest[place]  # so that a place with one candidate has 0, not a difference of large numbers
    patience, fewest = PATIENCE, len(gaps) + 1
    for _ in range(STEPS):
        # candidates in contact at a place are springs side by side
        springs = contact / local
        stiffness = np.add.reduceat(springs, first)
        inside = np.flatnonzero(stiffness)
        n, stiff = len(inside), stiffness[inside]
        offset = np.add.reduceat(springs * above, first)[inside] / stiff
        system = np.zeros((n + free, n + free))
        system[:n, :n] = H[np.ix_(inside, inside)]
        system[np.arange(n), np.arange(n)] += 1 / stiff
        system[n:, :n] = across = A[:, inside]
        system[:n, n:] = across.T
        right_side = np.concatenate([-lowest[inside] - offset, right])
        loose = False
        try:
            found = np.linalg.solve(system, right_side)
        except np.linalg.LinAlgError:  # no contact holds the parts: a soft spring lets them move on until some does
            loose = True
            system[np.arange(n, n + free), np.arange(n, n + free)] -= SOFT
            found = np.linalg.solve(system, right_side)
        if not np.all(np.isfinite(found)):
            return None
        closing = gaps + (H[:, inside] @ found[:n] + A.T @ found[n:])[place]
        approach = np.zeros(len(first))
        approach[inside] = found[:n] / stiff + offset
        forces = np.where(contact, (approach[place] - above) / local, 0.0)
        leave, enter = contact & (forces < -ZERO), ~contact & (closing < -ZERO)
        moved = np.flatnonzero(leave | enter)
        if not (loose or len(moved)):
            return np.maximum(forces, 0), found[n:]
        fewer = loose or len(moved) < fewest
        patience, fewest = (PATIENCE, len(moved)) if fewer else (patience - 1, fewest)
        contact = contact.copy()
        contact[moved if patience >= 0 else moved[-1:]] ^= True
    return None
