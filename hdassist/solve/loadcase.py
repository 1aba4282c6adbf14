"""A drive's contact system under a torque: how its states are solved, each answer proven, by engines and cvxpy.

Many states are solved by the walk, few, and those that it gives up, one after another: near the contact set of the one
before, by DAQP, by an interior-point method, whatever first has an answer.

cvxpy hands a solver H, local, A, gaps and load as they were stated, whatever their numbers. So it is compiled and
compared once for each version of cvxpy, of the statement, and of the set of free freedoms; that it held is kept in the
user's cache. The tests compile every preset, `hdassist doctor` compiles anew. States sent to another solver are a check
of the engine. cvxpy, which takes a second to import, is imported where there is a programme.
"""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import daqp
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter

from hdassist.errors import Fault, UntrustedError, UsageError
from hdassist.model.contacts import StateGaps
from hdassist.model.geometry import Array
from hdassist.run.kept import ClosedRecord, Count, cached, keep, keeps_answers, operating_system, program
from hdassist.run.run import CROSS_SOLVER, Progress, Run
from hdassist.solve import formulation as statement
from hdassist.solve.answers import (
    ARCSEC,
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
from hdassist.solve.walk import Points, Rules, Starts, Torus, Walk, climbed, walk_library, walk_near_state

_COMPILED_TEMPLATE = "compiled"
_proven: set[tuple[bool, ...]] = set()  # freedoms that were free in the proven programmes, in this process


def require_compiled_as_stated(formulation: Formulation, run: Run = Run()) -> None:
    """Make sure that cvxpy compiles this formulation to the data that the engines run.

    Arguments: formulation; run, whose process for other solvers, if there is one, has a look in place of this one,
    which need not import cvxpy then. Raises UntrustedError where it compiles to something else.
    """
    supported = tuple(formulation.system.supported.tolist())
    if supported in _proven:
        return
    key = _key(formulation)
    is_kept = cached(_COMPILED_TEMPLATE, key) is not None
    if run.executor and not is_kept:
        run.beside(require_compiled_as_stated, formulation).result()
    elif not is_kept:
        if wrong := list(template_differences(formulation)):
            raise UntrustedError(
                f"cvxpy compiled the programme to different data: {', '.join(wrong)}",
                "install the versions with which hdassist was tested (hdassist doctor)",
            )
        keep(_COMPILED_TEMPLATE, key, b"")
    _proven.add(supported)


def template_differences(formulation: Formulation) -> Iterator[str]:
    """Names of parts that cvxpy compiles to other data than stated, at two torques and gaps."""
    stated = formulation.statement
    place = formulation.system.place
    M = len(formulation.local)
    m = len(formulation.H)
    P = np.zeros((M + m, M + m))
    P[:M, :M] = np.diag(formulation.local)
    P[M:, M:] = formulation.H
    A = np.zeros((len(formulation.A) + m, M + m))
    A[: len(formulation.A), M:] = formulation.A
    A[len(formulation.A) + place, np.arange(M)] = 1
    A[len(formulation.A) + np.arange(m), M + np.arange(m)] = -1
    lower = np.repeat([0.0, -np.inf], [M, m])
    for torque, gap in ((0.0, 0.0), (1e3, 1.0)):
        stated.gaps.value = gaps = gap * np.arange(1.0, M + 1)
        stated.load.value = load = formulation.load(torque)
        data, _, _ = stated.problem.get_problem_data("DAQP")
        expected: dict[str, Any] = {"P": P, "q": np.pad(gaps, (0, m)), "A": A, "b": np.pad(-load, (0, m))}
        expected |= {"lower_bounds": lower, "upper_bounds": None}
        if data["F"].shape[0]:
            yield "further rows"
        for name, value in expected.items():
            found = data[name]
            found = found.toarray() if hasattr(found, "toarray") else found
            if not np.array_equal(found, value):
                yield name


def _key(formulation: Formulation) -> str:
    source = Path(statement.__file__).read_bytes()
    free = np.flatnonzero(~formulation.system.supported).tolist()
    return hashlib.sha256(f"{version('cvxpy')} {free} ".encode() + source).hexdigest()


#


CROSS_TOLERANCE = 0.01  # arcsec between the engine and the other solver

# Solvers that take a quadratic programme, of those cvxpy knows.
_QUADRATIC = {
    "CLARABEL",
    "COPT",
    "CPLEX",
    "DAQP",
    "GUROBI",
    "HIGHS",
    "MOSEK",
    "OSQP",
    "PIQP",
    "PROXQP",
    "SCS",
    "XPRESS",
}

# Of those that come with cvxpy the quickest here: 20 ms a state with five stations where CLARABEL takes 70, within 2e-4
# arcsec of the engine over all presets; where it gives no answer, or another (stiff contacts under little torque: 0.013
# arcsec), CLARABEL decides.
SECOND_SOLVER = "CLARABEL"
_SHIPPED = {CROSS_SOLVER: "highspy", SECOND_SOLVER: "clarabel"}  # with cvxpy, by their packages
_SOLVED_AGAIN = "again"

_LONGEST_SOLVE = 120.0  # s for one state: solvers take milliseconds, of the largest drives seconds

# Tolerances at which each solver's answers earn their certificate, and where it stops without one; a name that is not
# here runs at its defaults, which bound its iterations.
SOLVER_SETTINGS: dict[str, dict[str, Any]] = {
    "CLARABEL": {
        "tol_gap_abs": 1e-11,
        "tol_gap_rel": 1e-11,
        "tol_feas": 1e-11,
        "max_iter": 200,
        "time_limit": _LONGEST_SOLVE,
    },
    "COPT": {"TimeLimit": _LONGEST_SOLVE},
    "CPLEX": {"cplex_params": {"timelimit": _LONGEST_SOLVE}},
    "GUROBI": {"TimeLimit": _LONGEST_SOLVE},
    "HIGHS": {"time_limit": _LONGEST_SOLVE},
    "MOSEK": {"mosek_params": {"MSK_DPAR_OPTIMIZER_MAX_TIME": _LONGEST_SOLVE}},
    "OSQP": {"eps_abs": 1e-11, "eps_rel": 1e-11, "max_iter": 1_000_000, "time_limit": _LONGEST_SOLVE},
    "SCS": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iters": 200_000, "time_limit_secs": _LONGEST_SOLVE},
}


def require_solver(name: str) -> str:
    """Name of a solver as cvxpy writes it; raises UsageError where it is not there or solves no such programme."""
    if name.upper() not in (CROSS_SOLVER, SECOND_SOLVER) and name.upper() not in _able():
        raise UsageError(f"no solver {name!r} for the contact problem", f"choose one of {', '.join(_able()).lower()}")
    return name.upper()


@cache  # cvxpy looks for every solver anew each time
def _able() -> list[str]:
    import cvxpy as cp

    return sorted(set(cp.installed_solvers()) & _QUADRATIC)


@contextmanager
def muted_output() -> Iterator[None]:
    """Output of compiled code goes nowhere meanwhile: HiGHS 1.16 has a banner for each solver."""
    try:
        kept = os.dup(1)
    except OSError:  # it is closed
        yield
        return
    try:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def solve_through_cvxpy(formulation: Formulation, delta_p: Array, torque: float, solver: str) -> tuple[Array, Array]:
    """Forces [N], shape (M,), and free displacements [mm, rad] of one state, by a solver called through cvxpy.

    Arguments: delta_p, gaps without force [mm], shape (M,); torque [N*mm]; solver, a name cvxpy knows.
    Raises UsageError for an unknown solver, UntrustedError where it gives no answer.
    """
    import cvxpy as cp

    name = require_solver(solver)
    stated = formulation.statement
    stated.gaps.value = formulation.gaps(delta_p)
    stated.load.value = formulation.load(torque)
    try:
        with warnings.catch_warnings(), muted_output():
            # "solution may be inaccurate": residuals and the other solver decide that, not a status
            warnings.simplefilter("ignore", UserWarning)
            stated.problem.solve(solver=name, **SOLVER_SETTINGS.get(name, {}))
        forces = stated.forces.value
        duals = stated.equilibrium.dual_value
        status = stated.problem.status
    except cp.SolverError as error:
        forces = None
        duals = None
        status = str(error).splitlines()[0]
    if forces is None or duals is None:
        raise UntrustedError(f"{name} could not solve a mesh position: {status}", "", Fault.UNTRUSTED_STATE)
    return formulation.answer(forces, duals)


@dataclass(frozen=True)
class CrossCheck(ClosedRecord):
    """States solved again through cvxpy by another solver, and the greatest difference of the error."""

    solver: str
    states: Count
    max_difference_arcsec: Annotated[float, Field(strict=True, ge=0, le=CROSS_TOLERANCE)]


_CROSS_CHECK = TypeAdapter(CrossCheck)


def solvers_depend_on(solver: str | None) -> tuple[str, ...] | None:
    """All that a cross-check by a solver depends on beside its states; None where that is not known, so none is kept.

    Known are the solvers that come with cvxpy, and that there is no cross-check.
    """
    if solver is None:
        return ()
    name = require_solver(solver)
    return (name, *program("cvxpy", *_SHIPPED.values())) if name in _SHIPPED else None


def solve_again(
    formulation: Formulation,
    torques: Array,
    delta_p: Array,
    rotation_arcsec: Array,
    solver: str,
    place: Callable[[int], str],
) -> CrossCheck:
    """Solve states of one system by another solver, called through cvxpy, and compare the rotations.

    Arguments: torques M_g [N*m] and rotation_arcsec, of the engine [arcsec], shape (states,); delta_p, gaps
    without force [mm], shape (states, M); solver, its name, behind which SECOND_SOLVER stands; place, words for where
    state k is, for errors. By the solvers that come with cvxpy the outcome is kept in the user's cache, for the same
    states and rotations to the last digit. Raises UntrustedError where two rotations differ by more than
    CROSS_TOLERANCE.
    """
    used = {require_solver(solver): None}
    worst = 0.0
    known = solvers_depend_on(solver)
    key = sha256(f"{known} {operating_system()}".encode() + formulation.digest)
    for array in (delta_p, torques, rotation_arcsec):
        key.update(f"{array.shape}".encode() + array.tobytes())
    keeps = keeps_answers() and known is not None
    with suppress(ValueError):
        kept = _CROSS_CHECK.validate_json((keeps and cached(_SOLVED_AGAIN, key.hexdigest())) or b"")
        if kept.states == len(torques) and {*kept.solver.split(", ")} <= {*_SHIPPED}:
            return kept
    for k, M_g in enumerate(torques.tolist()):
        state = formulation, M_g * N_MM, delta_p[k], rotation_arcsec[k]
        try:
            difference = _difference(*state, solver)
        except UntrustedError:
            difference = np.inf
        if not difference <= CROSS_TOLERANCE:
            used[SECOND_SOLVER] = None
            difference = _difference(*state, SECOND_SOLVER)
        if not difference <= CROSS_TOLERANCE:
            raise UntrustedError(
                f"two solvers disagree at {place(k)}: {difference:.3g}″ between the engine and "
                f"{' and '.join(used).lower()}, {CROSS_TOLERANCE} allowed",
                "use another solver for the cross-check (--cross-check osqp)",
                Fault.SOLVERS_DISAGREE,
            )
        worst = max(worst, difference)
    found = CrossCheck(", ".join(used), len(torques), worst)
    if keeps:
        keep(_SOLVED_AGAIN, key.hexdigest(), _CROSS_CHECK.dump_json(found))
    return found


def _difference(formulation: Formulation, torque: float, delta_p: Array, expected: float, solver: str) -> float:
    """How far a solver's rotation of one state is from the one expected [arcsec]."""
    _, free = solve_through_cvxpy(formulation, delta_p, torque, solver)
    return float(np.abs(free[formulation.system.free_rotation] * ARCSEC - expected))


# --- a torque on the contact system

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
        self._formulation = formulation
        self._solver = solver
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
        forces = np.full(delta_p.shape, np.nan)
        free = np.full((len(delta_p), len(self._formulation.A)), np.nan)
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
        gaps = self._formulation.gaps(delta_p)
        right = -self._formulation.load(torque)
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
        formulation = self._formulation
        right = -self._formulation.load(torque)
        n = len(delta_p)
        upper = np.append(np.full(n, np.inf), right)
        lower = np.append(np.zeros(n), right)
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
        loads = torques * N_MM
        delta_p = np.repeat(self.system.delta_p[None], len(torques), axis=0)
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
            near = next((each.arrays["contact"] > 0 for each in known.values() if each), None)  # at another torque
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
