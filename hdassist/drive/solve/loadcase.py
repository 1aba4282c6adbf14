"""Solution of the states of a contact system under a torque, by engines and through cvxpy, with verified results.

The walk solves many states. A few states, and those that the walk gives up, are solved one after another by the first
method that succeeds: near the contact set of the previous state, by DAQP, or by an interior-point method.

cvxpy passes H, local, A, gaps and load to a solver without changes, whatever their numbers. The programme is therefore
compiled and compared with its statement only once for each version of cvxpy, for each version of the statement and for
each set of freedoms without support. The user's cache stores the successful check. The tests compile every preset, and
`hdassist doctor` compiles the programme again. Another solver only checks the results of the engine. cvxpy takes a
second to import, so it is imported only when a programme is stated.
"""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import daqp
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter

from hdassist.drive.model.contacts import StateGaps
from hdassist.drive.model.geometry import Array
from hdassist.drive.solve import formulation as statement
from hdassist.drive.solve.answers import (
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
from hdassist.drive.solve.formulation import Formulation, Reference
from hdassist.drive.solve.pivoting import Pivoting, solve_near
from hdassist.drive.solve.walk import Points, Rules, Starts, Torus, Walk, climbed, walk_library, walk_near_state
from hdassist.run.errors import Fault, UntrustedError, UsageError
from hdassist.run.kept import ClosedRecord, Count, cached, keep, keeps_answers, operating_system, program
from hdassist.run.run import CROSS_SOLVER, Progress, Run

_COMPILED_TEMPLATE = "compiled"
_proven: set[tuple[bool, ...]] = set()  # freedoms without support in the programmes verified in this process


def require_compiled_as_stated(formulation: Formulation, run: Run = Run()) -> None:
    """Check that cvxpy compiles a formulation to the data that the engines use.

    Args:
        formulation: the programme.
        run: run; if it has a process for other solvers, cvxpy is imported and compiles the programme there.

    Raises UntrustedError if cvxpy compiles the programme to other data.
    """
    # the compiled data depend on the numbers only through the stated matrices; their structure depends only on the set
    # of free freedoms
    supported = tuple(formulation.system.supported.tolist())
    if supported in _proven:
        return
    key = _key(formulation)
    # the check takes a second, so the user's cache stores it for each version of cvxpy
    is_kept = cached(_COMPILED_TEMPLATE, key) is not None
    # the other process imports cvxpy in any case for its solver
    if run.executor and not is_kept:
        run.beside(require_compiled_as_stated, formulation).result()
    elif not is_kept:
        differences = list(template_differences(formulation))
        if differences:
            raise UntrustedError(
                f"cvxpy compiled the programme to different data: {', '.join(differences)}",
                "install the required versions; hdassist doctor lists them",
            )
        keep(_COMPILED_TEMPLATE, key, b"")
    _proven.add(supported)


def template_differences(formulation: Formulation) -> Iterator[str]:
    """Yield the names of the parts whose compiled data differ from the stated data, at two torques and gaps."""
    stated = formulation.statement
    M = len(formulation.local)
    m = len(formulation.H)
    P, A = _stated_matrices(formulation)
    lower_bounds = np.repeat([0.0, -np.inf], [M, m])
    # two points determine an affine map, so data that agree at both agree everywhere
    for torque, gap in ((0.0, 0.0), (1e3, 1.0)):
        # all gaps have different values, so that a permutation of rows is noticed
        gaps = gap * np.arange(1.0, M + 1)
        load = formulation.load(torque)
        stated.gaps.value = gaps
        stated.load.value = load
        data, _, _ = stated.problem.get_problem_data("DAQP")
        # bounds must be compiled to bounds, not to rows of inequalities
        if data["F"].shape[0]:
            yield "further rows"
        expected: dict[str, Any] = {
            "P": P,
            "q": np.pad(gaps, (0, m)),
            "A": A,
            "b": np.pad(-load, (0, m)),
            "lower_bounds": lower_bounds,
            "upper_bounds": None,
        }
        for name, value in expected.items():
            compiled = data[name]
            if hasattr(compiled, "toarray"):
                compiled = compiled.toarray()
            if not np.array_equal(compiled, value):
                yield name


def _stated_matrices(formulation: Formulation) -> tuple[Array, Array]:
    """Return the matrices P and A of the programme, whose variables are the M forces and their m sums at the places.

    The rows of A are the equilibrium of the free freedoms, followed by the sums of the forces at the places.
    """
    M = len(formulation.local)
    m = len(formulation.H)
    free = len(formulation.A)
    # the forces of candidates come first, followed by their sums at the places
    P = np.zeros((M + m, M + m))
    P[:M, :M] = np.diag(formulation.local)
    P[M:, M:] = formulation.H
    A = np.zeros((free + m, M + m))
    A[:free, M:] = formulation.A
    # the sum of the forces minus the variable of the place is 0
    A[free + formulation.system.place, np.arange(M)] = 1
    A[free + np.arange(m), M + np.arange(m)] = -1
    return P, A


def _key(formulation: Formulation) -> str:
    # a change of the statement invalidates the stored check
    source = Path(statement.__file__).read_bytes()
    free = np.flatnonzero(~formulation.system.supported).tolist()
    return hashlib.sha256(f"{version('cvxpy')} {free} ".encode() + source).hexdigest()


# --- other solvers, called through cvxpy


CROSS_TOLERANCE = 0.01  # largest allowed difference between the engine and another solver [arcsec]

# solvers for quadratic programmes among those that cvxpy supports
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

# CROSS_SOLVER is the fastest of the solvers that come with cvxpy: 20 ms per state with five stations, compared with 70
# ms for CLARABEL. Its results are within 2e-4 arcsec of the engine for all presets. If it finds no solution, or a
# different one (stiff contacts under a small torque: 0.013 arcsec), CLARABEL decides.
SECOND_SOLVER = "CLARABEL"
_SHIPPED = {CROSS_SOLVER: "highspy", SECOND_SOLVER: "clarabel"}  # packages of the solvers that come with cvxpy
_SOLVED_AGAIN = "again"

# s; time limit for one state, which usually takes milliseconds, or seconds for the largest drives
_LONGEST_SOLVE = 120.0

# Tolerances at which the results of each solver pass verification, and limits of time or iterations. Solvers that are
# not listed run with their defaults, which limit their iterations.
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

# Limits of a solver in a cross-check, after which SECOND_SOLVER solves the state. HIGHS takes 350 to 600 iterations for
# a state of the presets. Where its active set cycles, it took 250 000 iterations, or 20 s; CLARABEL takes 0.2 s.
CROSS_LIMITS: dict[str, dict[str, Any]] = {"HIGHS": {"qp_iteration_limit": 5_000}}


def require_solver(name: str) -> str:
    """Return the name of a solver as cvxpy writes it.

    Raises UsageError if it is not installed or does not solve quadratic programmes.
    """
    if name.upper() not in (CROSS_SOLVER, SECOND_SOLVER) and name.upper() not in _able():
        message = f"solver {name!r} is not installed or cannot solve quadratic programmes"
        raise UsageError(message, f"choose one of {', '.join(_able()).lower()}")
    return name.upper()


@cache  # cvxpy searches for all solvers in each call
def _able() -> list[str]:
    import cvxpy as cp

    return sorted(set(cp.installed_solvers()) & _QUADRATIC)


@contextmanager
def muted_output() -> Iterator[None]:
    """Discard all standard output in the block, because HiGHS 1.16 prints a banner for each solver."""
    try:
        # compiled code writes the banner directly to the file descriptor, not to sys.stdout
        kept = os.dup(1)
    except OSError:  # standard output is closed, so there is nothing to mute
        yield
        return
    try:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def solve_through_cvxpy(
    formulation: Formulation,
    delta_p: Array,
    torque: float,
    solver: str,
    limits: Mapping[str, Any] = MappingProxyType({}),
) -> tuple[Array, Array]:
    """Return the forces [N], shape (M,), and the free displacements [mm, rad] of one state, solved through cvxpy.

    Args:
        formulation: the programme.
        delta_p: gaps without force [mm], shape (M,).
        torque: torque [N*mm].
        solver: name of a cvxpy solver.
        limits: settings of the solver beside SOLVER_SETTINGS.

    Raises UsageError for an unknown solver, and UntrustedError if the solver finds no solution.
    """
    import cvxpy as cp

    name = require_solver(solver)
    stated = formulation.statement
    # gaps and load are parameters, so cvxpy compiles the programme once for all states
    stated.gaps.value = formulation.gaps(delta_p)
    stated.load.value = formulation.load(torque)
    try:
        with warnings.catch_warnings(), muted_output():
            # ignore "solution may be inaccurate", because the residuals and the comparison show the accuracy
            warnings.simplefilter("ignore", UserWarning)
            stated.problem.solve(solver=name, **SOLVER_SETTINGS.get(name, {}), **limits)
        forces = stated.forces.value
        duals = stated.equilibrium.dual_value
        status = stated.problem.status
    except cp.SolverError as error:
        forces = None
        duals = None
        status = str(error).splitlines()[0]
    # a solver may return a status without a solution
    if forces is None or duals is None:
        message = f"solver {name} could not solve a mesh position: {status}"
        raise UntrustedError(message, "use another solver with --solver NAME", Fault.UNTRUSTED_STATE)
    return formulation.answer(forces, duals)


@dataclass(frozen=True)
class CrossCheck(ClosedRecord):
    """Number of states solved again by another solver through cvxpy, and the largest difference between the results."""

    solver: str
    states: Count
    max_difference_arcsec: Annotated[float, Field(strict=True, ge=0, le=CROSS_TOLERANCE)]


_CROSS_CHECK = TypeAdapter(CrossCheck)


def solvers_depend_on(solver: str | None) -> tuple[str, ...] | None:
    """Return all dependencies of a cross-check except its states, or None if they are not known.

    They are known for the solvers that come with cvxpy; without a cross-check (solver None) there are none. Results
    with other solvers are not stored.
    """
    if solver is None:
        return ()
    name = require_solver(solver)
    return (name, *program("cvxpy", *_SHIPPED.values())) if name in _SHIPPED else None


def _cross_check_key(
    formulation: Formulation,
    arrays: Sequence[Array],
    programs: str,
) -> str:
    """Return the hash of a programme, of all digits of some arrays, and of the programs that solve it."""
    hashed = sha256(programs.encode() + formulation.digest)
    for array in arrays:
        hashed.update(f"{array.shape}".encode() + array.tobytes())
    return hashed.hexdigest()


def solve_again(
    formulation: Formulation,
    torques: Array,
    delta_p: Array,
    rotation_arcsec: Array,
    solver: str,
    place: Callable[[int], str],
) -> CrossCheck:
    """Solve states of one system again with another solver, called through cvxpy, and compare the rotations.

    The user's cache stores results of the solvers that come with cvxpy. They are reused if states and rotations agree
    to the last digit.

    Args:
        formulation: the programme.
        torques: torques M_g [N*m], shape (states,).
        delta_p: gaps without force [mm], shape (states, M).
        rotation_arcsec: rotations from the engine [arcsec], shape (states,).
        solver: name of the solver; SECOND_SOLVER decides if it finds no solution or a different one.
        place: function that returns a description of state k for errors.

    Raises UntrustedError if two rotations differ by more than CROSS_TOLERANCE.
    """
    name = require_solver(solver)
    depends_on = solvers_depend_on(solver)
    # the version of a solver that does not come with cvxpy is unknown, so its result is not stored
    keeps_result = keeps_answers() and depends_on is not None
    key = _cross_check_key(formulation, (delta_p, torques, rotation_arcsec), f"{depends_on} {operating_system()}")
    kept = _kept_cross_check(key, len(torques)) if keeps_result else None
    if kept is not None:
        return kept
    used_solvers = [name]
    worst = 0.0
    for k, M_g in enumerate(torques.tolist()):
        torque = M_g * N_MM
        try:
            limits = CROSS_LIMITS.get(name, {})
            difference = _difference(formulation, torque, delta_p[k], rotation_arcsec[k], solver, limits)
        except UntrustedError:
            difference = np.inf
        # the comparison treats NaN as a disagreement
        if not difference <= CROSS_TOLERANCE:
            used_solvers.append(SECOND_SOLVER)
            difference = _difference(formulation, torque, delta_p[k], rotation_arcsec[k], SECOND_SOLVER)
        if not difference <= CROSS_TOLERANCE:
            names = ", ".join(dict.fromkeys(used_solvers)).lower()
            raise UntrustedError(
                f"two solvers disagree at {place(k)}: the solutions of hdassist and {names} differ by "
                f"{difference:.3g}″, at most {CROSS_TOLERANCE}″ is allowed",
                "use another solver for the cross-check (--cross-check osqp)",
                Fault.SOLVERS_DISAGREE,
            )
        worst = max(worst, difference)
    cross_check = CrossCheck(
        solver=", ".join(dict.fromkeys(used_solvers)), states=len(torques), max_difference_arcsec=worst
    )
    if keeps_result:
        keep(_SOLVED_AGAIN, key, _CROSS_CHECK.dump_json(cross_check))
    return cross_check


def _kept_cross_check(key: str, states: int) -> CrossCheck | None:
    """Return a cross-check from the user's cache; None if there is none, or if it is invalid.

    key: hash of the cross-check.
    states: expected number of states.
    """
    try:
        kept = _CROSS_CHECK.validate_json(cached(_SOLVED_AGAIN, key) or b"")
    except ValueError:
        return None
    # a file of another origin is not accepted as a check of these states
    is_valid = kept.states == states and set(kept.solver.split(", ")) <= set(_SHIPPED)
    return kept if is_valid else None


def _difference(
    formulation: Formulation,
    torque: float,
    delta_p: Array,
    expected: float,
    solver: str,
    limits: Mapping[str, Any] = MappingProxyType({}),
) -> float:
    """Return the absolute difference between a solver's rotation of one state and the expected rotation [arcsec].

    limits: settings of the solver beside SOLVER_SETTINGS.
    """
    _, free = solve_through_cvxpy(formulation, delta_p, torque, solver, limits)
    return float(np.abs(free[formulation.system.free_rotation] * ARCSEC - expected))


# --- single states

SOLVED = 1  # exit flag of daqp for a solved programme
ALWAYS_ACTIVE = 5  # sense of an equality row in daqp
_ACTIVE_LOWER = 3  # sense of a bound that is expected to be active, which means no force
# in units of the programme, forces are of order 0.1 to 100 and gaps of order 1 to 1000
DAQP_SETTINGS = {"primal_tol": 1e-10, "dual_tol": 1e-12}
_LOAD_STEPS = (1e4, 1e2, 1.0)  # multiples of the load from which a state is approached
ITERATIONS = 10  # largest number of daqp iterations per row; solved states take one or two

_Solution = tuple[Array, Array]  # forces [N] and free displacements [mm, rad] of one state
# solves one state from its gaps delta_p [mm] and its torque [N*mm]
_Method = Callable[[Array, float], _Solution | None]


class OneByOne:
    """Solver of single states: near a contact set, by DAQP, or by an interior-point method, in this order."""

    def __init__(
        self,
        formulation: Formulation,
        contact: NDArray[np.bool_] | None = None,
        *,
        compiled: bool = True,
        solver: str | None = None,
    ) -> None:
        """Prepare for the states of one system.

        Args:
            formulation: the programme.
            contact: whether each candidate is expected to carry force, shape (M,); all are by default.
            compiled: whether the method near a contact set may run in C if it is compiled.
            solver: name of a cvxpy solver that solves every state instead.
        """
        self._formulation = formulation
        self._solver = solver
        self._solve_near = walk_near_state if compiled and walk_library()[0] else solve_near
        self.contact = np.ones(len(formulation.local), dtype=bool) if contact is None else contact

    def solve(self, delta_p: Array, torque: float | Array) -> tuple[Array, Array, int]:
        """Return forces [N], shape (states, M), free displacements [mm, rad], and the number of fallbacks.

        The number of fallbacks is the number of states that the first method gave up. A state that no method solves has
        an unverified result or NaN. The states after it are not tried and have NaN, because they would usually fail for
        the same reason, and each failure takes the time of all methods.

        Args:
            delta_p: gaps without force [mm], shape (states, M).
            torque: torque on the flexspline [N*mm], one for all states or one per state.

        Raises UntrustedError if the requested solver fails.
        """
        system = self._formulation.system
        forces = np.full(delta_p.shape, np.nan)
        free = np.full((len(delta_p), len(self._formulation.A)), np.nan)
        methods: list[_Method] = [self._through_cvxpy]
        if not self._solver:
            methods = [self._near, self._by_daqp, self._through_cvxpy]
        given_up = 0
        loads = np.broadcast_to(torque, len(delta_p)).tolist()
        for k, load in enumerate(loads):
            solution = None
            method_number = 0
            for method_number, method in enumerate(methods):
                if method_number == 1:
                    given_up += 1
                solution = method(delta_p[k], load)
                if solution:
                    forces[k], free[k] = solution
                    break
            if method_number or self._solver:
                proof = residuals(system, delta_p[k, None], load, forces[k, None], free[k, None])
                if not proof.worst[0] <= TOLERANCE:
                    break
            self.contact = forces[k] > 0
        return forces, free, given_up

    def _near(self, delta_p: Array, torque: float) -> _Solution | None:
        """Solve a state from the last contact set, from no contact, or from the contact set of a larger load."""
        gaps = self._formulation.gaps(delta_p)
        right = -self._formulation.load(torque)
        no_contact = np.zeros_like(self.contact)
        # a start without contact takes half the steps of a start with all contacts, which sometimes does not converge
        starts = [no_contact] if self.contact.all() else [self.contact, no_contact]
        for contact in starts:
            solution = self._solve_near(self._formulation, gaps, right, contact)
            if solution:
                return self._formulation.answer(*solution)
        # Under a small load, contacts may open and close alternately without convergence. A larger load presses the
        # teeth together, and its contact set is a better start.
        solution = self._solve_near(self._formulation, gaps, _LOAD_STEPS[0] * right, no_contact)
        for factor in _LOAD_STEPS[1:]:
            if not solution:
                return None
            forces, _ = solution
            solution = self._solve_near(self._formulation, gaps, factor * right, forces > 0)
        return self._formulation.answer(*solution) if solution else None

    def _by_daqp(self, delta_p: Array, torque: float) -> _Solution | None:
        """Solve a state by DAQP, from the last contact set or from all contacts."""
        formulation = self._formulation
        right = -self._formulation.load(torque)
        n = len(delta_p)
        # rows: the bounds F >= 0, followed by the equilibrium, which is an equality
        upper = np.append(np.full(n, np.inf), right)
        lower = np.append(np.zeros(n), right)
        A = np.ascontiguousarray(formulation.A[:, formulation.system.place])
        # DAQP solves the dual problem from a guess of the active bounds; all contacts together always hold the parts
        for contact in (self.contact, np.ones(n, dtype=bool)):
            senses = np.where(contact, 0, _ACTIVE_LOWER)
            sense = np.append(senses, np.full(len(right), ALWAYS_ACTIVE)).astype(np.int32)
            model = daqp.Model()
            model.settings = DAQP_SETTINGS | {"iter_limit": ITERATIONS * len(sense)}
            flag, _ = model.setup(formulation.P, formulation.gaps(delta_p), A, upper, lower, sense)
            if flag < 0:  # the coefficients differ too much in size for a factorisation
                continue
            # the duals of the equality rows are the displacements of the free freedoms
            x, _, flag, info = model.solve()
            if flag == SOLVED:
                return formulation.answer(x, info["lam"][n:])
        return None

    def _through_cvxpy(self, delta_p: Array, torque: float) -> _Solution | None:
        """Solve a state through cvxpy, None if this fails; only a requested solver raises UntrustedError."""
        # if the last of three methods fails, the state remains NaN and fails its verification
        with nullcontext() if self._solver else suppress(UntrustedError):
            return solve_through_cvxpy(self._formulation, delta_p, torque, self._solver or SECOND_SOLVER)
        return None


# --- a torque on the contact system


_POOR_PROOF = 1e-9  # residual above which a state of the walk is solved again as a single state
MANY_STATES = 64  # number of states from which a walk with a reference takes less time than single states
_CARRIES = 1e-9  # smallest force of a candidate in contact, as a share of the largest force


class LoadCase:
    """A contact system under a torque, with the methods that solve its states.

    The walk solves many states. A few states, and those that the walk gives up, are solved one by one.
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
        """Prepare for the states of one system.

        Args:
            formulation: the programme.
            M_g: torque on the flexspline [N*m].
            like: load case of the same or a similar system; its last contact set is the start.
            many: whether many states will follow, in batches of any size.
            compiled: whether the walk may run in C if it is compiled.
            solver: name of a cvxpy solver that solves every state instead.

        Raises UntrustedError if cvxpy compiles the formulation to other data.
        """
        if not solver:
            require_compiled_as_stated(formulation)
        # the contact set of a similar load case saves most steps of the first state; the number of candidates differs
        # between phases
        contact = None
        if like and len(like.formulation.local) == len(formulation.local):
            contact = like._one_by_one.contact
        self.formulation: Formulation = formulation
        self.system = formulation.system
        self._compiled = compiled and walk_library()[0] is not None
        self._one_by_one: OneByOne = OneByOne(
            formulation,
            contact,
            compiled=self._compiled,
            solver=solver,
        )
        self._walk: Walk | Pivoting | None = None
        # a reference takes as long as some dozens of states solved singly
        self._walk_pays_from: float = 0 if many else MANY_STATES  # number of states
        if solver:
            self._walk_pays_from = np.inf
        self.load(M_g)

    def load(self, M_g: float) -> None:
        """Set another torque M_g [N*m] for further states."""
        self._torque = M_g * N_MM

    def solve(
        self,
        gaps: StateGaps,
        place: Callable[[int], str],
        progress: Progress | None = None,
        *,
        slope: bool = False,
    ) -> Answers:
        """Solve states and verify each result.

        Args:
            gaps: gap changes of the states.
            place: function that returns a description of state k for errors.
            progress: function called with the number of states solved since the last call.
            slope: whether to compute the slope of the rotation by the scalars.

        Raises UntrustedError if a state is not solved, or if its result exceeds the limits of the linear model.
        """
        # a generator, so that a chunk is solved only after the previous one is verified
        firsts = range(0, len(gaps), STATES_AT_A_TIME)
        chunks = (self.sums(gaps[first : first + STATES_AT_A_TIME], slope=slope) for first in firsts)
        return proven_answers(self.system, self._torque, chunks, place, progress)

    def over(
        self,
        torques: Array,
        place: Callable[[int], str],
        progress: Progress | None = None,
    ) -> Answers:
        """Solve the state without deviations at several torques M_g [N*m], each from the contacts of the previous one.

        The other arguments and the errors are those of `solve`.
        """
        loads = torques * N_MM
        delta_p = np.repeat(
            self.system.delta_p[None],
            len(torques),
            axis=0,
        )
        forces, free, given_up = self._one_by_one.solve(delta_p, loads)
        sums = StateSums.of(self.system, delta_p, loads, forces, free, given_up)
        return proven_answers(self.system, loads, [sums], place, progress)

    def sums(self, gaps: StateGaps, *, slope: bool = False) -> StateSums:
        """Return the sums of states without verification.

        A state that no method solves has unverified sums or NaN. The states after it are not tried and have NaN.

        Args:
            gaps: gap changes of the states.
            slope: whether to compute the slope of the rotation by the scalars.

        Raises UntrustedError if a requested solver finds no solution.
        """
        # the walk is created on first use, because many load cases solve only single states
        if self._walk is None and len(gaps) >= self._walk_pays_from:
            reference = self._reference()
            if reference:
                self._walk = Walk(reference) if self._compiled else Pivoting(self.formulation, reference)
        if self._walk is None:
            return self._alone(gaps, slope)
        sums = self._walk.solve(
            gaps,
            self._torque,
            slope=slope,
        )
        # a residual that grew over many pivots disappears in a solution from scratch
        given_up = np.flatnonzero(~(sums.residuals.worst <= _POOR_PROOF))  # includes NaN
        if len(given_up):
            sums.put(given_up, self._alone(gaps[given_up], slope))
        return replace(sums, given_up=len(given_up))

    def climb(
        self,
        torus: Torus,
        hills: Starts,
        rules: Rules,
    ) -> Points:
        """Return the highest states around hills without verification, as `climbed` does, shape (groups, 2)."""
        if isinstance(self._walk, Walk):
            return self._walk.climb(torus, self._torque, hills, rules)

        # the same climb without the compiled walk, state by state
        def state_at(scalars: Array) -> tuple[float, Array]:
            sums = self.sums(StateGaps(scalars[None]), slope=True)
            return float(sums.rotation[0]), np.zeros(0) if sums.slope is None else sums.slope[0]

        return climbed(torus, hills, rules, state_at)

    def forces(self, delta_p: Array) -> tuple[Array, Array, int]:
        """Return the results of OneByOne.solve at the torque of this case.

        Args:
            delta_p: gaps without force [mm], shape (states, M).
        """
        return self._one_by_one.solve(delta_p, self._torque)

    def _reference(self) -> Reference | None:
        """Return the reference at the contacts of the drive without deviations, None if they do not hold the parts.

        The reference does not depend on the states to be solved.
        """
        references = self.formulation.references
        if self._torque not in references:
            other_contacts = [reference.arrays["contact"] > 0 for reference in references.values() if reference]
            start = other_contacts[0] if other_contacts else None  # contacts at another torque
            nominal = OneByOne(self.formulation, start, compiled=self._compiled)
            forces, _, _ = nominal.solve(self.system.delta_p[None], self._torque)
            # None is stored first, so that an unusable contact set is tried only once
            references[self._torque] = None
            with suppress(ValueError):
                references[self._torque] = Reference(self.formulation, forces[0] > _CARRIES * forces[0].max())
        return references[self._torque]

    def _alone(self, gaps: StateGaps, slope: bool = False) -> StateSums:
        delta_p = self.system.delta_p_of(gaps)
        forces, free, given_up = self.forces(delta_p)
        slopes = rotation_slopes(self.formulation, forces, gaps.scalars.shape[1]) if slope else None
        return StateSums.of(
            system=self.system,
            delta_p=delta_p,
            torque=self._torque,
            forces=forces,
            free=free,
            given_up=given_up,
            slope=slopes,
        )
