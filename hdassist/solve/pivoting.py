"""Many states by principal pivots: a linear complementarity problem that neighbouring states share.

At a contact set that is fixed, forces of the contacts and gaps of the others (the values) are linear in the gaps
without force. A state whose values are all positive there is solved, whichever way that set was found; where one is
negative, that candidate changes sides: one principal pivot, a rank-one update. Columns of the states that come next
are carried along in the tableau, so that each set is tried on many states at once, as Ferreau, Bock and Diehl (2008,
doi 10.1002/rnc.1251) follow a solution from one problem to the next.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hdassist.model.geometry import Array

Flags = NDArray[np.bool_]

ZERO = 1e-10  # in the programme's units: a value this far below zero counts as zero
ABREAST = 32  # states that a tableau carries along
INACCURATE = 1e-8  # in the programme's units: a state that rounding spoils by more is given up
PIVOTS = 1000  # after which a tableau is made anew, against rounding
GREEDY = 3  # pivots for each candidate, after which the order is one that cannot cycle
LIMIT = 30  # pivots for each candidate, after which a state is given up
LOST = 8  # states given up after so many pivots, after which no more are tried: each took longer than any other way
INVERSE = 1e-6  # error of a product that should be the identity
SMALLEST = 1e-9  # pivot, where those of the reference are one and others were 1e-3 to 1e3


@dataclass(frozen=True)
class Reference:
    """The programme solved for the values at one contact set, for any gaps and any right side.

    values = at_gaps(gaps) + by_right right + by_others others: values, shape (M + free,), are forces of
    contacts, gaps of the rest, and the duals; others, shape (M,), are the gaps of contacts and forces of the rest,
    all zero as long as the set holds. All in the programme's units.
    """

    contact: Flags
    by_right: Array
    by_others: Array

    @cached_property
    def _by_contacts(self) -> Array:
        return np.ascontiguousarray(-self.by_others[:, self.contact].T)

    def at_gaps(self, gaps: Array) -> Array:
        """What gaps, shape (states, M), add to the values, shape (states, M + free)."""
        found = gaps[:, self.contact] @ self._by_contacts
        found[:, np.flatnonzero(~self.contact)] += gaps[:, ~self.contact]  # a gap that is open is a value of its own
        return np.asarray(found)

    def values(self, gaps: Array, right: Array) -> Array:
        """Values, shape (states, M + free), at gaps, shape (states, M), and a right side, others being zero."""
        found = self.at_gaps(gaps) + self.by_right @ right
        found[np.isnan(gaps.sum(axis=1))] = np.nan  # no part of such a state is known
        return np.asarray(found)

    @classmethod
    def at(cls, P: Array, A: Array, contact: Flags) -> Reference | None:
        """Reference at a contact set, shape (M,), of the programme with P and A.

        None where that set does not hold the parts in place.
        """
        free, M = A.shape
        inside, outside = np.flatnonzero(contact), np.flatnonzero(~contact)
        n = len(inside)
        system = np.zeros((n + free, n + free))
        system[:n, :n] = P[np.ix_(inside, inside)]
        system[n:, :n] = A[:, inside]
        system[:n, n:] = A[:, inside].T
        coupling = np.vstack([P[np.ix_(inside, outside)], A[:, outside]])
        right = np.hstack([np.eye(n + free), coupling])
        try:
            inverted = np.linalg.inv(system)
        except np.linalg.LinAlgError:
            return None
        both = inverted @ right
        rest = right - system @ both
        if not np.abs(rest[:, : n + free]).max(initial=0) <= INVERSE:
            return None
        both += inverted @ rest  # refined: without it two digits of the rotation are lost
        inverse, across = both[:, : n + free], both[:, n + free :]
        known = np.concatenate([inside, M + np.arange(free)])
        by_others, by_right = np.zeros((M + free, M)), np.zeros((M + free, free))
        by_others[np.ix_(known, inside)] = inverse[:, :n]
        by_others[np.ix_(known, outside)] = -across
        by_others[np.ix_(outside, inside)] = across[:n].T
        by_others[np.ix_(outside, outside)] = P[np.ix_(outside, outside)] - coupling.T @ across
        by_right[known], by_right[outside] = inverse[:, n:], across[n:].T
        if not np.all(np.diag(by_others) > 0):
            return None  # no pivots to start from
        return cls(contact, by_right, by_others)


class Pivoting:
    """Solves states from one reference, each from the contact set of the one before.

    Only candidates that change sides somewhere (the swing) are in the tableau; the others' values follow from
    theirs, are looked at for every state, and bring a candidate into the swing where one is negative.
    """

    def __init__(self, reference: Reference) -> None:
        self._reference = reference
        self._scale = 1 / np.sqrt(np.diag(reference.by_others))  # makes the reference's pivots one
        self._changed = np.zeros_like(reference.contact)  # against the reference, where the tableau stands
        self._useful = np.zeros_like(reference.contact)  # changed in some state
        self._lost = 0  # states that no end was found for
        self._take(np.flatnonzero(self._changed))

    def solve(self, gaps: Array, right: Array) -> tuple[Array, Array]:
        """Forces, shape (states, M), and duals, shape (states, free), NaN where a state is given up.

        Arguments: gaps without force, shape (states, M); right side, shape (free,); all in the programme's units.
        """
        reference = self._reference
        M = len(reference.contact)
        start = reference.values(gaps, right)
        forces, duals = np.empty(gaps.shape), np.empty((len(gaps), len(right)))
        rows = np.arange(len(gaps))
        if not len(self._swing):
            self._take(np.flatnonzero(start[:, :M].min(axis=0, initial=0) < -ZERO))
        while len(rows):
            values = start[rows]
            forces[rows] = self._settled(values)
            duals[rows] = values[:, M:]
            negative = values[:, :M] < -ZERO
            missing = np.flatnonzero(negative.any(axis=0))
            rows = rows[negative[:, missing].any(axis=1)]
            if len(rows):
                self._take(np.union1d(self._swing, missing))
        if np.count_nonzero(self._useful) < 0.9 * len(self._swing):
            self._take(np.flatnonzero(self._useful | self._changed))
        return forces, duals

    def _settled(self, values: Array) -> Array:
        """Forces of states, whose values at the reference become those of the solution as far as the swing goes."""
        contact, swing = self._reference.contact, self._swing
        solved, changed = self._walk(values[:, swing])
        others = np.maximum(solved, 0) * changed
        values += others @ self._effect
        here = values[:, swing]
        # in exact arithmetic what changed sides is zero, and nothing is negative
        wrong = np.where(changed, np.abs(here), -here).max(axis=1, initial=0)
        values[:, swing] = np.where(changed, 0, np.maximum(here, 0))
        forces = np.maximum(values[:, : len(contact)], 0) * contact
        forces[:, swing] += others * ~contact[swing]
        lost = ~(wrong <= INACCURATE)
        if lost.any():
            forces[lost] = values[lost] = np.nan
            self._take(swing)
        self._useful[swing] |= changed.any(axis=0)
        return forces

    def _take(self, swing: NDArray[np.int64]) -> None:
        """Make the tableau of a swing, where it stands now."""
        by_others, scale = self._reference.by_others, self._scale[swing]
        self._swing, self._pivots = swing, 0
        self._effect = np.ascontiguousarray(by_others[:, swing].T)
        n = len(swing)
        self._tableau = np.zeros((n, n + ABREAST), order="F")
        self._tableau[:, :n] = exchanged(by_others[np.ix_(swing, swing)] * scale * scale[:, None], self._changed[swing])

    def _walk(self, start: Array) -> tuple[Array, Flags]:
        """Values of the swing in each state, or others where those changed sides, and which did.

        Arguments: start, the values at the reference, shape (states, swing).
        """
        scale = self._scale[self._swing]
        start = start * scale
        solved, changed = np.empty(start.shape), np.empty(start.shape, dtype=bool)
        for first in range(0, len(start), ABREAST):
            part = slice(first, first + ABREAST)
            self._abreast(start[part], solved[part], changed[part])
        # a value is scaled up and the other of the same candidate down
        return np.where(changed, solved * scale, solved / scale), changed

    def _abreast(self, start: Array, solved: Array, changed: Flags) -> None:
        """Walk over states that the tableau carries along, from one to the nearest of those that are left."""
        if self._pivots > PIVOTS:
            self._take(self._swing)
        now = self._changed[self._swing]
        values, closed = self._enter(start, now), np.zeros(len(start), dtype=bool)
        while True:
            least = np.minimum.reduce(values, axis=0, initial=0)
            least[closed] = -np.inf
            done = (least >= -ZERO).nonzero()[0]
            if len(done):
                solved[done], changed[done] = values[:, done].T, now
                closed[done], least[done] = True, -np.inf
            k = least.argmax()
            if closed[k]:
                break  # all of them are
            if self._lost >= LOST:
                solved[~closed], changed[~closed] = np.nan, False
                break
            if not self._reach(k, len(start), now):
                solved[k], changed[k], closed[k] = np.nan, False, True
                now[:] = self._changed[self._swing] = False
                self._take(self._swing)
                values = self._enter(start, now)
        self._changed[self._swing] = now

    def _enter(self, start: Array, now: Flags) -> Array:
        """Columns of the tableau, now the values of states at its contact set."""
        n = len(now)
        values = self._tableau[:, n : n + len(start)]
        moved = start * now
        values[:] = (start - moved).T - self._tableau[:, :n] @ moved.T
        return values

    def _reach(self, k: int, abreast: int, now: Flags) -> bool:
        """Pivot to the contact set that solves state k of those abreast; False where that is not found."""
        from scipy.linalg.blas import dger  # a tenth of a second, which the compiled walk saves

        n = len(now)
        tableau = self._tableau[:, : n + abreast]
        values = tableau[:, n + k]
        for count in range(LIMIT * n):
            r = values.argmin()
            if not values[r] < -ZERO:
                self._pivots += count
                return bool(values[r] >= -ZERO)  # not so where it is not a number
            if count >= GREEDY * n:
                r = (values < -ZERO).argmax()  # the least index: finite, by Murty's theorem
            column, row = tableau[:, r].copy(), tableau[r].copy()
            pivot = column[r]
            if not pivot > SMALLEST:
                return False  # without it nothing would hold the torque
            # so that the one update makes of row and column what becomes of them, too
            column[r], row[r] = pivot + 1, pivot - 1
            dger(-1 / pivot, column, row, a=tableau, overwrite_x=1, overwrite_y=1, overwrite_a=1)
            now[r] = not now[r]
        self._lost += 1
        return False


def exchanged(matrix: Array, changed: Flags) -> Array:
    """Principal transform of a matrix, shape (n, n): values and others of what changed, shape (n,), trade places."""
    inside, outside = np.flatnonzero(changed), np.flatnonzero(~changed)
    result = np.empty_like(matrix)
    inverse = np.linalg.inv(matrix[np.ix_(inside, inside)])
    across = matrix[np.ix_(outside, inside)] @ inverse
    back = matrix[np.ix_(inside, outside)]
    result[np.ix_(inside, inside)] = inverse
    result[np.ix_(outside, inside)] = across
    result[np.ix_(inside, outside)] = -inverse @ back
    result[np.ix_(outside, outside)] = matrix[np.ix_(outside, outside)] - across @ back
    return result
