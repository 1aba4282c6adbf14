"""One state from a contact set thought to be near: sets of candidates change sides until none has to.

A primal-dual active-set method (Hintermueller, Ito, Kunisch 2003, doi 10.1137/S1052623401383558). It needs no set-up
and so serves where every state has matrices of its own; it may cycle, and is given up then.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from hdassist.model.geometry import Array
from hdassist.solve.compiled import Compiled

STEPS = 12  # after which it is given up
ZERO = 1e-10  # in the programme's units: what is this far below zero counts as zero


def solve_near(data: Compiled, q: Array, load: Array, contact: NDArray[np.bool_]) -> tuple[Array, Array] | None:
    """Forces, shape (M,), and duals, shape (free,), of one state; None where the method gives up.

    Arguments: data, the compiled programme; q, its linear term, shape (M,), and load, its right side, shape (free,);
    contact, candidates thought to carry force, shape (M,). All in the programme's units.
    """
    M, free = len(q), len(load)
    for _ in range(STEPS):
        inside = np.flatnonzero(contact)
        n = len(inside)
        system = np.zeros((n + free, n + free))
        system[:n, :n] = data.P[np.ix_(inside, inside)]
        system[n:, :n] = across = data.A[:, inside]
        system[:n, n:] = across.T
        _, _, found, failed = lapack.dgesv(system, np.concatenate([-q[inside], load]), overwrite_a=1, overwrite_b=1)
        if failed or not np.all(np.isfinite(found)):
            return None
        forces = np.zeros(M)
        forces[inside] = found[:n]
        gaps = data.P[:, inside] @ found[:n] + q + data.A.T @ found[n:]
        leave, enter = contact & (forces < -ZERO), ~contact & (gaps < -ZERO)
        if not (leave.any() or enter.any()):
            return np.maximum(forces, 0), found[n:]
        contact = contact ^ leave ^ enter
    return None
