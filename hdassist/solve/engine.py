"""The fast solver of many states, on the data of the formulation."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from hdassist.model.contacts import StateGaps
from hdassist.model.geometry import Array
from hdassist.solve.compiled import require_compiled_as_stated
from hdassist.solve.formulation import Formulation
from hdassist.solve.onebyone import OneByOne
from hdassist.solve.pivoting import Pivoting
from hdassist.solve.reference import Reference
from hdassist.solve.sums import StateSums
from hdassist.solve.walk import Walk, walk_library

POOR_PROOF = 1e-9  # residual of a state of the walk from which on it is solved once more, alone
MANY_STATES = 64  # states from which on a reference pays
CARRIES = 1e-9  # of the greatest force: more is contact


class Engine:
    """Solves many states by the walk, few states and what that gives up one by one.

    Arguments: formulation; torque [N*mm] on the flexspline; like, the engine of a neighbouring system, whose contact
    set this one takes over where the shapes are the same; many, whether many states will come, in batches however
    small; compiled, whether the walk in C may run, as it does where it is there; solver, a name that cvxpy knows, to
    send each state through cvxpy instead. Raises UntrustedError where cvxpy compiles the formulation to other data.
    """

    def __init__(
        self,
        formulation: Formulation,
        torque: float,
        like: Engine | None = None,
        *,
        many: bool = False,
        compiled: bool = True,
        solver: str | None = None,
    ) -> None:
        if not solver:
            require_compiled_as_stated(formulation)
        near = like and len(like._formulation.local) == len(formulation.local)
        contact = like._one_by_one.contact if like and near else None
        self._formulation: Formulation = formulation
        self._torque = torque
        self._compiled = compiled and walk_library()[0] is not None
        self._one_by_one: OneByOne = OneByOne(formulation, torque, contact, compiled=self._compiled, solver=solver)
        self._walk: Walk | Pivoting | None = None
        self._pays = np.inf if solver else 0 if many else MANY_STATES

    def load(self, torque: float) -> None:
        """Go on with another torque [N*mm]; what was factored stays."""
        self._torque = torque
        self._one_by_one.load(torque)

    def solve(self, gaps: StateGaps, *, pull: bool = False) -> StateSums:
        """Sums of states, and forces along the deviation scalars where asked for.

        A state that nothing solves has sums without proof, or NaN; states behind it are not tried, and NaN. Raises
        UntrustedError where a solver that was asked for has no answer.
        """
        if self._walk is None and len(gaps) >= self._pays and (reference := self._reference()):
            self._walk = (Walk if self._compiled else Pivoting)(reference)
        if self._walk is None:
            return self._alone(gaps, pull)
        sums = self._walk.solve(gaps, self._torque, pull=pull)
        given_up = np.flatnonzero(~(sums.residuals.worst <= POOR_PROOF))  # or NaN
        if len(given_up):
            sums.put(given_up, self._alone(gaps[given_up], pull))
        return replace(sums, given_up=len(given_up))

    def forces(self, delta_p: Array) -> tuple[Array, Array, int]:
        """Forces [N], shape (states, M), free displacements [mm, rad], and how many states the first way gave up.

        Arguments: delta_p, gaps without force [mm], shape (states, M). Each state is solved alone, as OneByOne says.
        """
        return self._one_by_one.solve(delta_p)

    def _reference(self) -> Reference | None:
        """Reference at the contacts of the drive without deviations, which do not depend on the states asked for.

        None where that contact set is no use.
        """
        known = self._formulation.references
        if self._torque not in known:
            nominal = OneByOne(self._formulation, self._torque, compiled=self._compiled)
            forces, _, _ = nominal.solve(self._formulation.system.delta_p[None])
            known[self._torque] = None
            with suppress(ValueError):
                known[self._torque] = Reference(self._formulation, forces[0] > CARRIES * forces[0].max())
        return known[self._torque]

    def _alone(self, gaps: StateGaps, pull: bool) -> StateSums:
        system = self._formulation.system
        delta_p = system.delta_p_of(gaps)
        return StateSums.of(system, delta_p, self._torque, *self._one_by_one.solve(delta_p), pull=pull)
