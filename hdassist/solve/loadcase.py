"""A drive's contact system under a torque: its states solved and proven, some of them again by another solver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hdassist.errors import UntrustedError
from hdassist.model.contacts import contact_system
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.solve.answers import ARCSEC, Answers, Progress, solve_states
from hdassist.solve.engine import Engine, StateSolver, ThroughCvxpy
from hdassist.solve.formulation import Formulation, formulate, require_solver, solve_through_cvxpy

N_MM = 1e3  # N*mm in a N*m
CROSS_TOLERANCE = 0.01  # arcsec between the engine and the other solver


@dataclass(frozen=True)
class CrossCheck:
    """States solved again through cvxpy by another solver, and the greatest difference of the error."""

    solver: str
    states: int
    max_difference_arcsec: float


class LoadCase:
    """A contact system under a torque, ready to solve many states.

    Arguments: formulation, the programme of the system; M_g, torque on the flexspline [N*m]; like, the load case of a
    system that is the same or differs a little, from whose compiled programme and contacts this one starts; solver, a
    name that cvxpy knows, to send each state through cvxpy instead of the engine.
    """

    def __init__(
        self, formulation: Formulation, M_g: float, *, like: LoadCase | None = None, solver: str | None = None
    ) -> None:
        self.formulation, self.system, self._torque = formulation, formulation.system, M_g * N_MM
        near = like._solver if like and isinstance(like._solver, Engine) else None
        self._solver: StateSolver = (
            ThroughCvxpy(formulation, self._torque, solver) if solver else Engine(formulation, self._torque, near)
        )

    @classmethod
    def of(cls, drive: Drive, M_g: float, *, like: LoadCase | None = None) -> LoadCase:
        """Load case of a drive at a torque M_g [N*m], at tooth phase 0 and the preset's ball phase."""
        return cls(formulate(contact_system(drive)), M_g, like=like)

    def load(self, M_g: float) -> None:
        """Go on with another torque [N*m]; what was factored stays."""
        self._torque = M_g * N_MM
        self._solver.load(self._torque)

    def solve(self, delta_p: Array, place: Callable[[int], str], progress: Progress | None = None) -> Answers:
        """Solve states from their gaps without force [mm], shape (states, M); arguments and errors as solve_states."""
        return solve_states(self.system, self._solver, self._torque, delta_p, place, progress)


def solve_again(
    formulation: Formulation,
    torques: Array,
    delta_p: Array,
    rotation_arcsec: Array,
    solver: str,
    place: Callable[[int], str],
) -> CrossCheck:
    """Solve states of one system by another solver, called through cvxpy, and compare the rotations.

    Arguments: torques M_g [N*m] and rotation_arcsec, what the engine found [arcsec], shape (states,); delta_p, gaps
    without force [mm], shape (states, M); place, words for where state k is, for errors. Raises UntrustedError where
    two rotations differ by more than CROSS_TOLERANCE.
    """
    worst, free_rotation = 0.0, formulation.system.free_rotation
    for k, M_g in enumerate(torques.tolist()):
        _, free = solve_through_cvxpy(formulation, delta_p[k], M_g * N_MM, solver)
        difference = float(np.abs(free[free_rotation] * ARCSEC - rotation_arcsec[k]))
        if not difference <= CROSS_TOLERANCE:
            raise UntrustedError(
                f"two solvers disagree at {place(k)}: {difference:.3g} arcsec between the engine and {solver}, "
                f"{CROSS_TOLERANCE} allowed",
                "try another solver for the cross-check (--cross-check osqp)",
            )
        worst = max(worst, difference)
    return CrossCheck(require_solver(solver), len(torques), worst)
