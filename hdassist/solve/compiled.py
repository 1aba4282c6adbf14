"""The programme as cvxpy compiles it: the data that every engine runs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hdassist.errors import UntrustedError
from hdassist.model.geometry import Array
from hdassist.solve.formulation import Formulation

ZERO = 1e-10  # in the programme's units: a value this far below zero counts as zero


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

    def load(self, torque: float) -> Array:
        """Right side of the equilibrium rows at a torque [N*mm], shape (free,)."""
        return self.b_0 + torque * self.b_1

    def moved(self, here: Formulation, there: Formulation) -> Compiled:
        """The data of a neighbouring system of the same shape: P and A move as the coefficients stated do.

        The load's unit moves with the stiffness of a tooth.
        """
        units = (here.units.force * here.units.load) / (there.units.force * there.units.load)
        return replace(self, P=self.P + (there.P - here.P), A=self.A + (there.A - here.A), b_1=self.b_1 * units)


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
