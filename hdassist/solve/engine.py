"""The fast solver of many states, on the data of the formulation."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hdassist.model.contacts import StateGaps
from hdassist.model.geometry import Array
from hdassist.solve.activeset import ActiveSet
from hdassist.solve.compiled import require_compiled_as_stated
from hdassist.solve.formulation import Formulation
from hdassist.solve.pivoting import Pivoting, Reference
from hdassist.solve.places import PlaceReference
from hdassist.solve.sums import StateSums
from hdassist.solve.walk import Walk, walk_library

POOR_PROOF = 1e-9  # residual of a state of the walk from which on it is solved once more, alone
MANY_STATES = 64  # states from which on a reference pays
CARRIES = 1e-9  # of the greatest force: more is contact


@dataclass(frozen=True)
class _References:
    """Where the engines start from at one torque [N*mm]; None where that contact set is no use."""

    formulation: Formulation
    torque: float
    compiled: bool

    @cached_property
    def contact(self) -> NDArray[np.bool_]:
        """Contacts of the drive without deviations, so that they do not depend on the states asked for, shape (M,)."""
        nominal = ActiveSet(self.formulation, self.torque, compiled=self.compiled)
        forces, _, _ = nominal.solve(self.formulation.system.delta_p[None])
        return np.asarray(forces[0] > CARRIES * forces[0].max())

    @cached_property
    def by_candidates(self) -> Reference | None:
        """That of the numpy engine."""
        return Reference.at(self.formulation.P, self.formulation.A, self.contact)

    @cached_property
    def by_places(self) -> PlaceReference | None:
        """That of the compiled walk."""
        with suppress(ValueError):
            return PlaceReference(self.formulation, self.contact)
        return None


class Engine:
    """Solves many states by principal pivots, few states and what those give up by DAQP.

    Arguments: formulation; torque [N*mm] on the flexspline; like, the engine of a neighbouring system, whose contact
    set this one takes over where the shapes are the same, and whose reference where system and torque are; many,
    whether many states will come, in batches however small; compiled, whether the walk in C may run, as it does where
    it is there. Raises UntrustedError where cvxpy compiles the formulation to other data.
    """

    def __init__(
        self,
        formulation: Formulation,
        torque: float,
        like: Engine | None = None,
        *,
        many: bool = False,
        compiled: bool = True,
    ) -> None:
        require_compiled_as_stated(formulation)
        near: Engine | None = like if like is not None and like._formulation.A.shape == formulation.A.shape else None
        self._formulation: Formulation = formulation
        self._torque = torque
        contact = near._one_by_one.contact if near else None
        self._one_by_one: ActiveSet = ActiveSet(formulation, torque, contact, compiled=compiled)
        same = near is not None and near._formulation is formulation and near._torque == torque
        self._references: _References = (
            near._references if near and same else _References(formulation, torque, compiled)
        )
        self._pivoting: Pivoting | None = None
        self._walk: Walk | None = None
        self._compiled = compiled and walk_library()[0] is not None
        self._pays = 0 if many else MANY_STATES

    def load(self, torque: float) -> None:
        """Go on with another torque [N*mm]; what was factored stays."""
        self._torque = torque
        self._one_by_one.load(torque)
        if self._walk:
            self._walk.load(torque)

    def solve(self, gaps: StateGaps, *, pull: bool = False) -> StateSums:
        """Sums of states, and forces along the deviation scalars where asked for.

        A state that nothing solves has sums without proof, or NaN; states behind it are not tried, and NaN.
        """
        if self._walk is None and self._compiled and len(gaps) >= self._pays and (places := self._references.by_places):
            self._walk = Walk(places, self._torque)
        if self._walk is None:
            return self._sums(gaps, self.forces, pull)
        sums = self._walk.solve(gaps, pull=pull)
        given_up = np.flatnonzero(~(sums.residuals.worst <= POOR_PROOF))  # or NaN
        if len(given_up):
            sums.put(given_up, self._sums(gaps[given_up], self._one_by_one.solve, pull))
        return replace(sums, given_up=len(given_up))

    def forces(self, delta_p: Array) -> tuple[Array, Array, int]:
        """Forces [N], shape (states, M), free displacements [mm, rad], and how many states the first way gave up.

        Arguments: delta_p, gaps without force [mm], shape (states, M). A state that nothing solves has an answer
        without proof, or NaN; states behind it are not tried, and NaN.
        """
        if self._pivoting is None and len(delta_p) >= self._pays and (reference := self._references.by_candidates):
            self._pivoting = Pivoting(reference)
        if self._pivoting is None:
            return self._one_by_one.solve(delta_p)
        right = self._formulation.right_side(self._torque)
        forces, free = self._formulation.answer(*self._pivoting.solve(self._formulation.gaps(delta_p), right))
        given_up = np.flatnonzero(np.isnan(forces[:, 0]))
        if len(given_up):
            forces[given_up], free[given_up], _ = self._one_by_one.solve(delta_p[given_up])
        return forces, free, len(given_up)

    def _sums(self, gaps: StateGaps, solve: Callable[[Array], tuple[Array, Array, int]], pull: bool) -> StateSums:
        system = self._formulation.system
        delta_p = system.delta_p_of(gaps)
        return StateSums.of(system, delta_p, self._torque, *solve(delta_p), pull=pull)
