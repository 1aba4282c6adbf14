"""The programme through cvxpy: proven to be the data of the engines, and sent to solvers that know nothing of them.

cvxpy hands a solver H, local, A, gaps and load as they were stated, whatever their numbers. So it is compiled and
compared once for each version of cvxpy, of the statement, and of the set of free freedoms; that it held is kept in the
user's cache. The tests compile every preset, `hdassist doctor` compiles anew. States sent to another solver are a check
of the engine. cvxpy, which takes a second to import, is imported where there is a programme.
"""

from __future__ import annotations

import hashlib
import os
import platform
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter

from hdassist.errors import Fault, UntrustedError, UsageError
from hdassist.model.geometry import Array
from hdassist.run.kept import ClosedRecord, Count, cached, keep, keeps_answers, program
from hdassist.run.run import CROSS_SOLVER
from hdassist.solve import formulation as statement
from hdassist.solve.answers import ARCSEC, N_MM
from hdassist.solve.formulation import Formulation, imported_cvxpy

_COMPILED_TEMPLATE = "compiled"
_proven: set[tuple[bool, ...]] = set()  # freedoms that were free in the proven programmes, in this process


def require_compiled_as_stated(formulation: Formulation) -> None:
    """Make sure that cvxpy compiles this formulation to the data that the engines run.

    Raises UntrustedError where it compiles to something else.
    """
    supported = tuple(formulation.system.supported.tolist())
    if supported in _proven:
        return
    key = _key(formulation)
    if cached(_COMPILED_TEMPLATE, key) is None:
        if wrong := list(template_differences(formulation)):
            raise UntrustedError(
                f"cvxpy compiles the programme to other data than stated: {', '.join(wrong)}",
                "install the versions that hdassist was tested with (hdassist doctor)",
            )
        keep(_COMPILED_TEMPLATE, key, b"")
    _proven.add(supported)


def template_differences(formulation: Formulation) -> Iterator[str]:
    """Names of parts that cvxpy compiles to other data than stated, at two torques and gaps."""
    stated, place = formulation.statement, formulation.system.place
    M, m = len(formulation.local), len(formulation.H)
    P = np.zeros((M + m, M + m))
    P[:M, :M], P[M:, M:] = np.diag(formulation.local), formulation.H
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
        raise UsageError(f"no solver {name!r} for the contact problem", f"there are: {', '.join(_able()).lower()}")
    return name.upper()


@cache  # cvxpy looks for every solver anew each time
def _able() -> list[str]:
    return sorted(set(imported_cvxpy().installed_solvers()) & _QUADRATIC)


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
    name, stated = require_solver(solver), formulation.statement
    stated.gaps.value, stated.load.value = formulation.gaps(delta_p), formulation.load(torque)
    try:
        with warnings.catch_warnings(), muted_output():
            # "solution may be inaccurate": residuals and the other solver decide that, not a status
            warnings.simplefilter("ignore", UserWarning)
            stated.problem.solve(solver=name, **SOLVER_SETTINGS.get(name, {}))
        forces, duals, status = stated.forces.value, stated.equilibrium.dual_value, stated.problem.status
    except imported_cvxpy().SolverError as error:
        forces, duals, status = None, None, str(error).splitlines()[0]
    if forces is None or duals is None:
        raise UntrustedError(f"{name} could not solve a state: {status}", "", Fault.UNTRUSTED_STATE)
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
    units, used, worst = formulation.units, {require_solver(solver): None}, 0.0
    known = solvers_depend_on(solver)
    key = sha256(f"{known} {platform.platform()}".encode())
    system = formulation.H, formulation.local, formulation.A, formulation.system.place, units.load
    for array in (*system, np.array([units.gap, units.force]), delta_p, torques, rotation_arcsec):
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
                "try another solver for the cross-check (--cross-check osqp)",
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
