"""One state after another, each from the contact set of the one before, by whatever way first has an answer."""

from __future__ import annotations

from contextlib import nullcontext, suppress

import daqp
import numpy as np
from numpy.typing import NDArray

from hdassist.errors import UntrustedError
from hdassist.model.geometry import Array
from hdassist.solve.certificate import TOLERANCE, residuals
from hdassist.solve.formulation import Formulation
from hdassist.solve.near import solve_near
from hdassist.solve.throughcvxpy import SECOND_SOLVER, solve_through_cvxpy
from hdassist.solve.walk import walk_library, walk_near_state

SOLVED = 1  # exit flag of daqp
ALWAYS_ACTIVE = 5  # sense of an equality row
ACTIVE_LOWER = 3  # sense of a bound thought to hold: no force
# In the programme's own units forces are of order 0.1 to 100 and gaps of order 1 to 1000.
DAQP_SETTINGS = {"primal_tol": 1e-10, "dual_tol": 1e-12}
HEAVIER = (1e4, 1e2, 1.0)  # times the load of a state: ways down to it
ITERATIONS = 10  # for each row, after which daqp is stopped: states that it solves take one or two


class OneByOne:
    """Solves single states of one contact system: near a contact set, else by DAQP, else by an interior-point method.

    Arguments: formulation; contact, candidates thought to carry force, shape (M,), by default all; compiled, whether
    the way near that set may run in C, as it does where it is there; solver, a name that cvxpy knows, to send each
    state through cvxpy instead.
    """

    def __init__(
        self,
        formulation: Formulation,
        contact: NDArray[np.bool_] | None = None,
        *,
        compiled: bool = True,
        solver: str | None = None,
    ) -> None:
        self._formulation, self._solver = formulation, solver
        self._solve_near = walk_near_state if compiled and walk_library()[0] else solve_near
        self.contact = np.ones(len(formulation.local), dtype=bool) if contact is None else contact

    def solve(self, delta_p: Array, torque: float) -> tuple[Array, Array, int]:
        """Forces [N], shape (states, M), free displacements [mm, rad], and how many states the first way gave up.

        A state that no solver solves has an answer without proof, or NaN. The cause of one hopeless state makes its
        neighbours so, and each costs all ways: the first one that no solver solves is the last one tried. Arguments:
        delta_p, gaps without force [mm], shape (states, M); torque [N*mm] on the flexspline. Raises UntrustedError
        where the solver asked for fails.
        """
        system = self._formulation.system
        forces, free = np.full(delta_p.shape, np.nan), np.full((len(delta_p), len(self._formulation.A)), np.nan)
        ways = [self._near, self._by_daqp, self._through_cvxpy][2 if self._solver else 0 :]
        given_up = tried = 0
        for k, at_state in enumerate(delta_p):
            for tried, way in enumerate(ways):
                given_up += tried == 1  # by the first way
                if answer := way(at_state, torque):
                    forces[k], free[k] = answer
                    break
            if tried or self._solver:
                proof = residuals(system, at_state[None], torque, forces[k, None], free[k, None])
                if not proof.worst[0] <= TOLERANCE:
                    break
            self.contact = forces[k] > 0
        return forces, free, given_up

    def _near(self, delta_p: Array, torque: float) -> tuple[Array, Array] | None:
        gaps, right = self._formulation.gaps(delta_p), -self._formulation.load(torque)
        none = np.zeros_like(self.contact)
        # from none it is half the steps of a start from all, from which some never end
        for contact in (none,) if self.contact.all() else (self.contact, none):
            if answer := self._solve_near(self._formulation, gaps, right, contact):
                return self._formulation.answer(*answer)
        # teeth that hardly hold the parts come and go: a load that presses them together leads to theirs
        answer = self._solve_near(self._formulation, gaps, HEAVIER[0] * right, none)
        for times in HEAVIER[1:]:
            answer = answer and self._solve_near(self._formulation, gaps, times * right, answer[0] > 0)
        return answer and self._formulation.answer(*answer)

    def _by_daqp(self, delta_p: Array, torque: float) -> tuple[Array, Array] | None:
        formulation, right, n = self._formulation, -self._formulation.load(torque), len(delta_p)
        upper, lower = np.append(np.full(n, np.inf), right), np.append(np.zeros(n), right)
        for contact in (self.contact, np.ones(n, dtype=bool)):
            sense = np.append(np.where(contact, 0, ACTIVE_LOWER), np.full(len(right), ALWAYS_ACTIVE)).astype(np.int32)
            model = daqp.Model()
            model.settings = DAQP_SETTINGS | {"iter_limit": ITERATIONS * len(sense)}
            A = np.ascontiguousarray(formulation.A[:, formulation.system.place])
            flag, _ = model.setup(formulation.P, formulation.gaps(delta_p), A, upper, lower, sense)
            if flag < 0:  # coefficients too far apart to be factored
                continue
            x, _, flag, info = model.solve()
            if flag == SOLVED:
                return formulation.answer(x, info["lam"][n:])
        return None

    def _through_cvxpy(self, delta_p: Array, torque: float) -> tuple[Array, Array] | None:
        with nullcontext() if self._solver else suppress(UntrustedError):
            return solve_through_cvxpy(self._formulation, delta_p, torque, self._solver or SECOND_SOLVER)
        return None
