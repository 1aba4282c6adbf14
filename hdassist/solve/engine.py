"""Solvers of many states: the fast engine on cvxpy's compiled data, or cvxpy itself for each state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import daqp
import numpy as np

from hdassist.errors import UntrustedError
from hdassist.model.geometry import Array
from hdassist.solve.formulation import Formulation, solve_through_cvxpy

SOLVED = 1  # exit flag of daqp
ALWAYS_ACTIVE = 5  # sense of an equality row
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
    """The programme as cvxpy hands it to a solver, dense, for any gaps and one load.

    minimise 1/2 x' P x + (q_0 + Q gaps)' x subject to A x = b, lower <= x.
    """

    P: Array
    q_0: Array
    Q: Array
    A: Array
    b: Array
    lower: Array


def compile_programme(formulation: Formulation, torque: float) -> Compiled:
    """Let cvxpy compile the programme for a torque [N*mm]; the gaps stay open, in the formulation's unit.

    Raises UntrustedError where the programme has rows other than equilibrium and bounds.
    """
    formulation.set_load(torque)
    formulation.gaps.value = np.zeros(formulation.gaps.size)
    data, _, _ = formulation.problem.get_problem_data("DAQP")
    if data["F"].shape[0]:
        raise UntrustedError("the programme has inequalities that the engine does not read")
    program = data["param_prob"]
    first = program.param_id_to_col[formulation.gaps.id]
    return Compiled(
        P=data["P"].toarray(),
        q_0=np.array(data["q"], dtype=float),
        # the tensor's last row is the objective's constant
        Q=program.q[:-1, first : first + formulation.gaps.size].toarray(),
        A=data["A"].toarray(),
        b=np.array(data["b"], dtype=float),
        lower=np.array(data["lower_bounds"], dtype=float),
    )


class Engine:
    """Warm active-set solver (DAQP): each state starts from the contact set of the one before.

    Arguments: formulation; torque [N*mm] on the flexspline.
    """

    def __init__(self, formulation: Formulation, torque: float) -> None:
        self.data = compile_programme(formulation, torque)
        self._formulation = formulation
        self._torque = torque
        n, rows = len(self.data.q_0), len(self.data.b)
        # held here, because the solver may read them as long as it lives
        self._upper = np.concatenate([np.full(n, np.inf), self.data.b])
        self._lower = np.concatenate([self.data.lower, self.data.b])
        self._sense = np.concatenate([np.zeros(n), np.full(rows, ALWAYS_ACTIVE)]).astype(np.int32)
        self._model: Any = None  # daqp.Model, once one is set up

    def solve(self, delta_p: Array) -> tuple[Array, Array, int]:
        """Solve states as StateSolver says: warm, else from scratch, else by an interior-point method."""
        data, units = self.data, self._formulation.units
        q = data.q_0 + (delta_p / units.gap) @ data.Q.T
        forces, free = np.empty(delta_p.shape), np.empty((len(delta_p), len(data.b)))
        fallbacks = 0
        for k in range(len(q)):
            first_way = self._warm(q[k]) if self._model else self._set_up(q[k])
            answer = first_way or self._set_up(q[k])
            fallbacks += first_way is None
            if answer:
                forces[k], free[k] = answer[0] * units.force, answer[1] * (units.gap / units.load)
            else:
                forces[k], free[k] = self._last_resort(delta_p[k])
        return forces, free, fallbacks

    def _warm(self, q: Array) -> tuple[Array, Array] | None:
        self._model.update(f=q)
        return self._run()

    def _set_up(self, q: Array) -> tuple[Array, Array] | None:
        self._model = daqp.Model()
        self._model.settings = SETTINGS
        self._model.setup(self.data.P, q, self.data.A, self._upper, self._lower, self._sense)
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
            return np.full(len(delta_p), np.nan), np.full(len(self.data.b), np.nan)


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
