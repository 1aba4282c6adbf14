"""A drive's contact system under a torque: how its states are solved, each answer proven.

Many states by the walk, few, and those that it gives up, one after another: near the contact set of the one before, by
DAQP, by an interior-point method, whatever first has an answer.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext, suppress
from dataclasses import replace

import daqp
import numpy as np
from numpy.typing import NDArray

from hdassist.errors import UntrustedError
from hdassist.model.contacts import StateGaps
from hdassist.model.geometry import Array
from hdassist.run.run import Progress
from hdassist.solve.answers import (
    N_MM,
    STATES_AT_A_TIME,
    TOLERANCE,
    Answers,
    StateSums,
    proven_answers,
    residuals,
    rotation_slopes,
)
from hdassist.solve.formulation import Formulation, Reference
from hdassist.solve.pivoting import Pivoting, solve_near
from hdassist.solve.through_cvxpy import SECOND_SOLVER, require_compiled_as_stated, solve_through_cvxpy
from hdassist.solve.walk import Points, Rules, Starts, Torus, Walk, climbed, walk_library, walk_near_state

SOLVED = 1  # exit flag of daqp
ALWAYS_ACTIVE = 5  # sense of an equality row
_ACTIVE_LOWER = 3  # sense of a bound thought to hold: no force
# In the programme's own units forces are of order 0.1 to 100 and gaps of order 1 to 1000.
DAQP_SETTINGS = {"primal_tol": 1e-10, "dual_tol": 1e-12}
_HEAVIER = (1e4, 1e2, 1.0)  # times the load of a state: ways down to it
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

    def solve(self, delta_p: Array, torque: float | Array) -> tuple[Array, Array, int]:
        """Forces [N], shape (states, M), free displacements [mm, rad], and how many states the first way gave up.

        A state that no solver solves has an answer without proof, or NaN. The cause of one hopeless state makes its
        neighbours so, and each costs all ways: the first one that no solver solves is the last one tried. Arguments:
        delta_p, gaps without force [mm], shape (states, M); torque [N*mm] on the flexspline, of all states or of each.
        Raises UntrustedError where the solver asked for fails.
        """
        system = self._formulation.system
        forces, free = np.full(delta_p.shape, np.nan), np.full((len(delta_p), len(self._formulation.A)), np.nan)
        ways = [self._near, self._by_daqp, self._through_cvxpy][2 if self._solver else 0 :]
        given_up = tried = 0
        for k, (at_state, load) in enumerate(zip(delta_p, np.broadcast_to(torque, len(delta_p)).tolist(), strict=True)):
            for tried, way in enumerate(ways):
                given_up += tried == 1  # by the first way
                if answer := way(at_state, load):
                    forces[k], free[k] = answer
                    break
            if tried or self._solver:
                proof = residuals(system, at_state[None], load, forces[k, None], free[k, None])
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
        answer = self._solve_near(self._formulation, gaps, _HEAVIER[0] * right, none)
        for times in _HEAVIER[1:]:
            answer = answer and self._solve_near(self._formulation, gaps, times * right, answer[0] > 0)
        return answer and self._formulation.answer(*answer)

    def _by_daqp(self, delta_p: Array, torque: float) -> tuple[Array, Array] | None:
        formulation, right, n = self._formulation, -self._formulation.load(torque), len(delta_p)
        upper, lower = np.append(np.full(n, np.inf), right), np.append(np.zeros(n), right)
        for contact in (self.contact, np.ones(n, dtype=bool)):
            sense = np.append(np.where(contact, 0, _ACTIVE_LOWER), np.full(len(right), ALWAYS_ACTIVE)).astype(np.int32)
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


#


_POOR_PROOF = 1e-9  # residual of a state of the walk from which on it is solved once more, alone
MANY_STATES = 64  # states from which on a reference pays
_CARRIES = 1e-9  # of the greatest force: more is contact


class LoadCase:
    """A contact system under a torque: many states are solved by the walk, few, and those that it gives up, one by one.

    Arguments: formulation, the programme of the system; M_g, torque on the flexspline [N*m]; like, the load case of a
    system that is the same or differs a little, whose contact set this one takes over; many, whether many states will
    come, in batches however small; compiled, whether the walk in C may run, as it does where it is there; solver, a
    name that cvxpy knows, to send each state through cvxpy instead. Raises UntrustedError where cvxpy compiles the
    formulation to other data.
    """

    def __init__(
        self,
        formulation: Formulation,
        M_g: float,
        *,
        like: LoadCase | None = None,
        many: bool = False,
        compiled: bool = True,
        solver: str | None = None,
    ) -> None:
        if not solver:
            require_compiled_as_stated(formulation)
        contact = None
        if like and len(like.formulation.local) == len(formulation.local):
            contact = like._one_by_one.contact
        self.formulation: Formulation = formulation
        self.system = formulation.system
        self._compiled = compiled and walk_library()[0] is not None
        self._one_by_one: OneByOne = OneByOne(formulation, contact, compiled=self._compiled, solver=solver)
        self._walk: Walk | Pivoting | None = None
        self._pays = np.inf if solver else 0 if many else MANY_STATES
        self.load(M_g)

    def load(self, M_g: float) -> None:
        """Go on with another torque [N*m]; factors stay."""
        self._torque = M_g * N_MM

    def solve(
        self,
        gaps: StateGaps,
        place: Callable[[int], str],
        progress: Progress | None = None,
        *,
        slope: bool = False,
    ) -> Answers:
        """Solve states and prove each answer.

        Arguments: gaps of the states; place, words for where state k is, for errors; progress, called with how many
        states were solved since the last call; slope, whether that of the rotation by the scalars is asked for. Raises
        UntrustedError where a state is not solved, or its answer is outside the limits of the linear model.
        """
        firsts = range(0, len(gaps), STATES_AT_A_TIME)
        chunks = (self.sums(gaps[first : first + STATES_AT_A_TIME], slope=slope) for first in firsts)
        return proven_answers(self.system, self._torque, chunks, place, progress)

    def over(self, torques: Array, place: Callable[[int], str], progress: Progress | None = None) -> Answers:
        """Solve the state without deviations at torques M_g [N*m], each from the contacts of the one before.

        Arguments and errors as those of solve.
        """
        loads, delta_p = torques * N_MM, np.repeat(self.system.delta_p[None], len(torques), axis=0)
        sums = StateSums.of(self.system, delta_p, loads, *self._one_by_one.solve(delta_p, loads))
        return proven_answers(self.system, loads, [sums], place, progress)

    def sums(self, gaps: StateGaps, *, slope: bool = False) -> StateSums:
        """Sums of states without their proof, with slopes by the deviation scalars where asked for.

        A state that no solver solves has sums without proof, or NaN; states behind it are not tried, and NaN. Raises
        UntrustedError where a solver that was asked for has no answer.
        """
        if self._walk is None and len(gaps) >= self._pays and (reference := self._reference()):
            self._walk = Walk(reference) if self._compiled else Pivoting(self.formulation, reference)
        if self._walk is None:
            return self._alone(gaps, slope)
        sums = self._walk.solve(gaps, self._torque, slope=slope)
        given_up = np.flatnonzero(~(sums.residuals.worst <= _POOR_PROOF))  # or NaN
        if len(given_up):
            sums.put(given_up, self._alone(gaps[given_up], slope))
        return replace(sums, given_up=len(given_up))

    def climb(self, torus: Torus, hills: Starts, rules: Rules) -> Points:
        """The highest states around hills, as `climbed` says, shape (groups, 2): they are not proven."""
        if isinstance(walk := self._walk, Walk):
            return walk.climb(torus, self._torque, hills, rules)

        def state_at(scalars: Array) -> tuple[float, Array]:
            sums = self.sums(StateGaps(scalars[None]), slope=True)
            return float(sums.rotation[0]), np.zeros(0) if sums.slope is None else sums.slope[0]

        return climbed(torus, hills, rules, state_at)

    def forces(self, delta_p: Array) -> tuple[Array, Array, int]:
        """Forces [N], shape (states, M), free displacements [mm, rad], and how many states the first way gave up.

        Arguments: delta_p, gaps without force [mm], shape (states, M). Each state is solved alone, as OneByOne says.
        """
        return self._one_by_one.solve(delta_p, self._torque)

    def _reference(self) -> Reference | None:
        """Reference at the contacts of the drive without deviations, which do not depend on the states asked for.

        None where that contact set is no use.
        """
        known = self.formulation.references
        if self._torque not in known:
            near = next((each.held["contact"] > 0 for each in known.values() if each), None)  # at another torque
            nominal = OneByOne(self.formulation, near, compiled=self._compiled)
            forces, _, _ = nominal.solve(self.system.delta_p[None], self._torque)
            known[self._torque] = None
            with suppress(ValueError):
                known[self._torque] = Reference(self.formulation, forces[0] > _CARRIES * forces[0].max())
        return known[self._torque]

    def _alone(self, gaps: StateGaps, slope: bool = False) -> StateSums:
        delta_p = self.system.delta_p_of(gaps)
        forces, free, given_up = self.forces(delta_p)
        slopes = rotation_slopes(self.formulation, forces, gaps.scalars.shape[1]) if slope else None
        return StateSums.of(self.system, delta_p, self._torque, forces, free, given_up, slope=slopes)
