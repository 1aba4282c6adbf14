"""The programme solved at one contact set, for any gaps and load: where principal pivots start from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hdassist.model.geometry import Array
from hdassist.solve.compiled import Compiled

Flags = NDArray[np.bool_]

INVERSE = 1e-6  # error of a product that should be the identity


@dataclass(frozen=True)
class Reference:
    """The programme solved for the values at one contact set, for any gaps and any load.

    values = constant + by_gaps gaps + by_load load + by_others others: values, shape (M + free,), are forces of
    contacts, gaps of the rest, and the duals; others, shape (M,), are the gaps of contacts and forces of the rest,
    all zero as long as the set holds. All in the programme's units.
    """

    contact: Flags
    constant: Array
    by_gaps: Array
    by_load: Array
    by_others: Array

    @cached_property
    def _plain(self) -> Flags:
        """Gaps, shape (M,), that are but a value of their own: those of candidates without contact."""
        return np.asarray((self.by_gaps == np.eye(*self.by_gaps.shape)).all(axis=0))

    @cached_property
    def _by_rest(self) -> Array:
        return np.ascontiguousarray(self.by_gaps[:, ~self._plain].T)

    def values(self, gaps: Array, load: Array) -> Array:
        """Values, shape (states, M + free), at gaps, shape (states, M), and a load, others being zero."""
        plain = np.flatnonzero(self._plain)
        found = gaps[:, ~self._plain] @ self._by_rest
        found += self.constant + self.by_load @ load
        found[:, plain] += gaps[:, plain]
        found[np.isnan(gaps.sum(axis=1))] = np.nan  # no part of such a state is known
        return np.asarray(found)

    @classmethod
    def at(cls, data: Compiled, contact: Flags) -> Reference | None:
        """Reference at a contact set, shape (M,); None where that set does not hold the parts in place."""
        M, free = len(data.q_0), len(data.b_0)
        inside, outside = np.flatnonzero(contact), np.flatnonzero(~contact)
        n = len(inside)
        system = np.zeros((n + free, n + free))
        system[:n, :n] = data.P[np.ix_(inside, inside)]
        system[n:, :n] = data.A[:, inside]
        system[:n, n:] = data.A[:, inside].T
        coupling = np.vstack([data.P[np.ix_(inside, outside)], data.A[:, outside]])
        right = np.hstack([np.eye(n + free), coupling])
        try:
            # solved for and refined, not multiplied by the inverse: that cost two digits of the rotation
            both = np.linalg.solve(system, right)
            both += np.linalg.solve(system, right - system @ both)
        except np.linalg.LinAlgError:
            return None
        inverse, across = both[:, : n + free], both[:, n + free :]
        if not np.allclose(system @ inverse, np.eye(n + free), rtol=0, atol=INVERSE):
            return None
        known = np.concatenate([inside, M + np.arange(free)])
        by_others, by_load = np.zeros((M + free, M)), np.zeros((M + free, free))
        by_others[np.ix_(known, inside)] = inverse[:, :n]
        by_others[np.ix_(known, outside)] = -across
        by_others[np.ix_(outside, inside)] = across[:n].T
        by_others[np.ix_(outside, outside)] = data.P[np.ix_(outside, outside)] - coupling.T @ across
        by_load[known], by_load[outside] = inverse[:, n:], across[n:].T
        by_linear = np.zeros((M + free, M))
        by_linear[:, inside] = -by_others[:, inside]
        by_linear[outside, outside] = 1
        if not np.all(np.diag(by_others) > 0):
            return None  # no pivots to start from
        return cls(contact, by_linear @ data.q_0, by_linear @ data.Q, by_load, by_others)


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
