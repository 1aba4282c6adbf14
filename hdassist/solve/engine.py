"""The fast solver of many states, on the data that cvxpy compiles."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from hdassist.model.geometry import Array
from hdassist.solve.activeset import ActiveSet
from hdassist.solve.compiled import Compiled, compile_programme
from hdassist.solve.formulation import Formulation
from hdassist.solve.pivoting import Flags, Pivoting, Reference

MANY = 64  # states from which on a reference pays
CARRIES = 1e-9  # of the greatest force: more is contact


class Engine:
    """Solves many states by principal pivots, few states and what those give up by DAQP.

    Arguments: formulation; torque [N*mm] on the flexspline; like, the engine of a neighbouring system, whose
    compiled data and contact set this one takes over where the shapes are the same, and whose reference where system
    and torque are the same; many, whether many states will come, in batches however small.
    """

    def __init__(
        self, formulation: Formulation, torque: float, like: Engine | None = None, *, many: bool = False
    ) -> None:
        near = like if like is not None and like.data.A.shape == formulation.A.shape else None
        self._formulation, self._torque = formulation, torque
        self.data: Compiled = (
            near.data.moved(near._formulation, formulation) if near else compile_programme(formulation)
        )
        contact: Flags = near._one_by_one.contact if near else np.ones(len(self.data.q_0), dtype=bool)
        self._one_by_one: ActiveSet = ActiveSet(formulation, self.data, torque, contact)
        same = near and near._formulation is formulation and near._torque == torque
        self._same = near if same else None
        self._pivoting: Pivoting | None = None
        self._pays = 0 if many else MANY

    def load(self, torque: float) -> None:
        """Go on with another torque [N*mm]; what was factored stays."""
        self._torque = torque
        self._one_by_one.load(torque)

    def solve(self, delta_p: Array) -> tuple[Array, Array, int]:
        """Solve states as StateSolver says."""
        if self._pivoting is None and len(delta_p) >= self._pays and self._reference:
            self._pivoting = Pivoting(self._reference)
        if self._pivoting is None:
            return self._one_by_one.solve(delta_p)
        gaps, load = self._formulation.gaps(delta_p), self.data.load(self._torque)
        forces, free = self._formulation.answer(*self._pivoting.solve(gaps, load))
        given_up = np.flatnonzero(np.isnan(forces[:, 0]))
        if len(given_up):
            forces[given_up], free[given_up], _ = self._one_by_one.solve(delta_p[given_up])
        return forces, free, len(given_up)

    @cached_property
    def _reference(self) -> Reference | None:
        """The drive without deviations, so that it does not hang on the states asked for; None where it is no use."""
        if self._same:
            return self._same._reference
        if self.data.lower.any():
            return None
        system = self._formulation.system
        everywhere = np.ones(len(self.data.q_0), dtype=bool)
        forces, _, _ = ActiveSet(self._formulation, self.data, self._torque, everywhere).solve(system.delta_p[None])
        return Reference.at(self.data, forces[0] > CARRIES * forces[0].max())
