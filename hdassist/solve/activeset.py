"""One state after another, each from the contact set of the one before: by DAQP, or near that set without it."""

from __future__ import annotations

from typing import Any

import daqp
import numpy as np
from numpy.typing import NDArray

from hdassist.errors import UntrustedError
from hdassist.model.geometry import Array
from hdassist.solve import walk
from hdassist.solve.certificate import proven
from hdassist.solve.formulation import Formulation
from hdassist.solve.near import solve_near
from hdassist.solve.throughcvxpy import SECOND_SOLVER, solve_through_cvxpy

SOLVED = 1  # exit flag of daqp
ALWAYS_ACTIVE = 5  # sense of an equality row
ACTIVE_LOWER = 3  # sense of a bound thought to hold: no force
# In the programme's own units forces are of order 0.1 to 100 and gaps of order 1 to 1000.
DAQP_SETTINGS = {"primal_tol": 1e-10, "dual_tol": 1e-12}
ITERATIONS = 10  # for each row, after which daqp is stopped: states that it solves take one or two
FEW_STATES = 4  # states for which a model is not worth its set-up


class ActiveSet:
    """Warm active-set solver (DAQP) of the states of one contact system.

    Arguments: formulation; torque [N*mm] on the flexspline; contact, candidates thought to carry force, shape (M,), by
    default all; compiled, whether the way near that set may run in C, as it does where it is there.
    """

    def __init__(
        self,
        formulation: Formulation,
        torque: float,
        contact: NDArray[np.bool_] | None = None,
        *,
        compiled: bool = True,
    ) -> None:
        self._solve_near = walk.walk_near_state if compiled and walk.walk_library()[0] else solve_near
        self._formulation = formulation
        rows, n = formulation.A.shape
        self.contact = np.ones(n, dtype=bool) if contact is None else contact
        # held here, because the solver may read them as long as it lives
        self._upper = np.full(n + rows, np.inf)
        self._lower = np.zeros(n + rows)
        self._model: Any = None  # daqp.Model, once one is set up
        self.load(torque)

    def load(self, torque: float) -> None:
        """Go on with another torque [N*mm]; what was factored stays."""
        self._torque, self._right = torque, self._formulation.right_side(torque)
        self._upper[-len(self._right) :] = self._lower[-len(self._right) :] = self._right
        if self._model:
            self._model.update(bupper=self._upper, blower=self._lower)

    def solve(self, delta_p: Array) -> tuple[Array, Array, int]:
        """Forces [N], shape (states, M), free displacements [mm, rad], and how many states the warm way gave up.

        A state is solved warm, else from scratch, else by an interior-point method; one that nothing solves has an
        answer without proof, or NaN.

        What makes one state hopeless makes its neighbours so, and each costs all three ways: the first one that nothing
        solves is the last one tried.
        """
        formulation = self._formulation
        q = formulation.gaps(delta_p)
        forces, free = np.empty(delta_p.shape), np.empty((len(delta_p), len(self._right)))
        fallbacks = 0
        for k in range(len(q)):
            first_way = None if len(q) > FEW_STATES or self._model else self._near(q[k])
            first_way = first_way or (self._warm(q[k]) if self._model else self._set_up(q[k], self.contact))
            answer = first_way or self._set_up(q[k], np.ones_like(self.contact))
            fallbacks += first_way is None
            if answer:
                forces[k], free[k] = formulation.answer(*answer)
                continue
            forces[k], free[k] = self._last_resort(delta_p[k])
            if not proven(formulation.system, delta_p[k], self._torque, forces[k], free[k]):
                forces[k + 1 :], free[k + 1 :] = np.nan, np.nan
                break
        if len(q):
            self.contact = forces[-1] > 0
        return forces, free, fallbacks

    def _near(self, q: Array) -> tuple[Array, Array] | None:
        none = np.zeros_like(self.contact)  # half the steps of a start from all, from which some never end
        for contact in (none,) if self.contact.all() else (self.contact, none):
            answer = self._solve_near(self._formulation, q, self._right, contact)
            if answer:
                self.contact = answer[0] > 0
                return answer
        return None

    def _warm(self, q: Array) -> tuple[Array, Array] | None:
        self._model.update(f=q)
        return self._run()

    def _set_up(self, q: Array, contact: NDArray[np.bool_]) -> tuple[Array, Array] | None:
        sense = np.where(contact, 0, ACTIVE_LOWER)
        sense = np.concatenate([sense, np.full(len(self._right), ALWAYS_ACTIVE)]).astype(np.int32)
        self._model = daqp.Model()
        self._model.settings = DAQP_SETTINGS | {"iter_limit": ITERATIONS * len(sense)}
        flag, _ = self._model.setup(self._formulation.P, q, self._formulation.A, self._upper, self._lower, sense)
        if flag < 0:  # coefficients too far apart to be factored
            self._model = None
            return None
        return self._run()

    def _run(self) -> tuple[Array, Array] | None:
        x, _, flag, info = self._model.solve()
        if flag == SOLVED:
            return x, info["lam"][len(x) :]
        self._model = None  # its contact set is not worth starting from
        return None

    def _last_resort(self, delta_p: Array) -> tuple[Array, Array]:
        try:
            return solve_through_cvxpy(self._formulation, delta_p, self._torque, SECOND_SOLVER)
        except UntrustedError:
            return np.full(len(delta_p), np.nan), np.full(len(self._right), np.nan)
