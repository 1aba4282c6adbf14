"""Solvers of many states: the fast engine on cvxpy's compiled data, or cvxpy itself for each state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

import daqp
import numpy as np
from numpy.typing import NDArray

from hdassist.errors import UntrustedError
from hdassist.model.geometry import Array
from hdassist.solve.formulation import Formulation, solve_through_cvxpy

SOLVED = 1  # exit flag of daqp
ALWAYS_ACTIVE = 5  # sense of an equality row
ACTIVE_LOWER = 3  # sense of a bound thought to hold: no force
# In the programme's own units forces are of order 0.1 to 100 and gaps of order 1 to 1000.
SETTINGS = {"primal_tol": 1e-10, "dual_tol": 1e-12}
LAST_RESORT = "CLARABEL"  # an interior-point method does not cycle


class StateSolver(Protocol):
    """Anything that solves states of one contact system at one torque."""

    def solve(self, delta_p: Array) -> tuple[Array, Array, int]:
        """Forces [N] (states, M), displacements of the free freedoms [mm, rad] (states, free), fallbacks.

        Arguments: delta_p, gaps without force [mm], shape (states, M). Fallbacks counts the states that the
        first way gave up; a state that nothing solves is NaN.
        """
        ...


@dataclass(frozen=True)
class Compiled:
    """The programme as cvxpy hands it to a solver, dense, for any gaps and torque.

    minimise 1/2 x' P x + (q_0 + Q gaps)' x subject to A x = b_0 + torque b_1, lower <= x; torque in N*mm.
    """

    P: Array
    q_0: Array
    Q: Array
    A: Array
    b_0: Array
    b_1: Array
    lower: Array

    def moved(self, here: Formulation, there: Formulation) -> Compiled:
        """The data of a neighbouring system of the same shape: P and A move as the coefficients stated do."""
        return replace(self, P=self.P + (there.P - here.P), A=self.A + (there.A - here.A))


def compile_programme(formulation: Formulation) -> Compiled:
    """Let cvxpy compile the programme; gaps and torque stay open, gaps in the formulation's unit.

    Raises UntrustedError where the programme has rows other than equilibrium and bounds.
    """
    stated = formulation.statement
    stated.gaps.value = np.zeros(stated.gaps.size)
    b = []
    for torque in (0.0, 1.0):
        stated.load.value = formulation.load(torque)
        data, _, _ = stated.problem.get_problem_data("DAQP")
        b.append(np.array(data["b"], dtype=float))
    if data["F"].shape[0]:
        raise UntrustedError("the programme has inequalities that the engine does not read")
    program = data["param_prob"]
    first = program.param_id_to_col[stated.gaps.id]
    return Compiled(
        P=data["P"].toarray(),
        q_0=np.array(data["q"], dtype=float),
        # the tensor's last row is the objective's constant
        Q=program.q[:-1, first : first + stated.gaps.size].toarray(),
        A=data["A"].toarray(),
        b_0=b[0],
        b_1=b[1] - b[0],
        lower=np.array(data["lower_bounds"], dtype=float),
    )


class Engine:
    """Warm active-set solver (DAQP): each state starts from the contact set of the one before.

    Arguments: formulation; torque [N*mm] on the flexspline; like, the engine of a neighbouring system, whose
    compiled data and contact set this one takes over where the shapes are the same.
    """

    def __init__(self, formulation: Formulation, torque: float, like: Engine | None = None) -> None:
        near = like if like is not None and like.data.A.shape == formulation.A.shape else None
        self._formulation = formulation
        self.data: Compiled = (
            near.data.moved(near._formulation, formulation) if near else compile_programme(formulation)
        )
        n, rows = len(self.data.q_0), len(self.data.b_0)
        # candidates thought to carry force
        self._contact: NDArray[np.bool_] = near._contact if near else np.ones(n, dtype=bool)
        # held here, because the solver may read them as long as it lives
        self._upper = np.full(n + rows, np.inf)
        self._lower = np.concatenate([self.data.lower, np.zeros(rows)])
        self._model: Any = None  # daqp.Model, once one is set up
        self.load(torque)

    def load(self, torque: float) -> None:
        """Go on with another torque [N*mm]; what was factored stays."""
        self._torque = torque
        rows = slice(len(self.data.q_0), None)
        self._upper[rows] = self._lower[rows] = self.data.b_0 + torque * self.data.b_1
        if self._model:
            self._model.update(bupper=self._upper, blower=self._lower)

    def solve(self, delta_p: Array) -> tuple[Array, Array, int]:
        """Solve states as StateSolver says: warm, else from scratch, else by an interior-point method."""
        data, formulation = self.data, self._formulation
        q = data.q_0 + formulation.gaps(delta_p) @ data.Q.T
        forces, free = np.empty(delta_p.shape), np.empty((len(delta_p), len(data.b_0)))
        fallbacks = 0
        for k in range(len(q)):
            first_way = self._warm(q[k]) if self._model else self._set_up(q[k], self._contact)
            answer = first_way or self._set_up(q[k], np.ones_like(self._contact))
            fallbacks += first_way is None
            forces[k], free[k] = formulation.answer(*answer) if answer else self._last_resort(delta_p[k])
        if len(q):
            self._contact = forces[-1] > 0
        return forces, free, fallbacks

    def _warm(self, q: Array) -> tuple[Array, Array] | None:
        self._model.update(f=q)
        return self._run()

    def _set_up(self, q: Array, contact: NDArray[np.bool_]) -> tuple[Array, Array] | None:
        sense = np.where(contact, 0, ACTIVE_LOWER)
        sense = np.concatenate([sense, np.full(len(self.data.b_0), ALWAYS_ACTIVE)]).astype(np.int32)
        self._model = daqp.Model()
        self._model.settings = SETTINGS
        self._model.setup(self.data.P, q, self.data.A, self._upper, self._lower, sense)
        return self._run()

    def _run(self) -> tuple[Array, Array] | None:
        x, _, flag, info = self._model.solve()
        if flag == SOLVED:
            return x, info["lam"][len(x) :]
        self._model = None  # its contact set is not worth starting from
        return None

    def _last_resort(self, delta_p: Array) -> tuple[Array, Array]:
        try:
            return solve_through_cvxpy(self._formulation, delta_p, self._torque, LAST_RESORT)
        except UntrustedError:
            return np.full(len(delta_p), np.nan), np.full(len(self.data.b_0), np.nan)


class ThroughCvxpy:
    """Sends each state through cvxpy itself: slow, and independent of the engine.

    Arguments: formulation; torque [N*mm]; solver, a name that cvxpy knows.
    """

    def __init__(self, formulation: Formulation, torque: float, solver: str) -> None:
        self._formulation, self._torque, self._solver = formulation, torque, solver

    def solve(self, delta_p: Array) -> tuple[Array, Array, int]:
        """Solve states as StateSolver says; raises UntrustedError where the solver gives no answer."""
        answers = [solve_through_cvxpy(self._formulation, gaps, self._torque, self._solver) for gaps in delta_p]
        return np.stack([forces for forces, _ in answers]), np.stack([free for _, free in answers]), 0
