"""What a micrometre does: derivatives of F'_ior by the lengths that it hinges on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hdassist.error.cycle import KinematicError, state_place
from hdassist.model.contacts import contact_system
from hdassist.model.deviations import state_gaps
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.formulation import formulate
from hdassist.solve.loadcase import LoadCase

SLOPE_UNITS = {"gears.j_n": 1.0, "cam.W_0": 1e-3, "bearing.g_b": 1.0}  # a micrometre in the unit of each field
LENGTH_STEP = 0.1  # micrometres to both sides, so that no contact set changes much


@dataclass(frozen=True)
class Sensitivity:
    """Change of F'_ior [arcsec per um] with the flank clearance j_n, the wave W_0 and the bearing clearance g_b.

    Differences over LENGTH_STEP to both sides; where a clearance is less than that, to one side.
    """

    j_n: float
    W_0: float
    g_b: float
    certificate: Certificate


def sensitivity(drive: Drive, extremes: Sequence[KinematicError]) -> tuple[Sensitivity, ...]:
    """Sensitivity of a drive at each of its torques.

    F'_ior is the difference of two states, which stay the extremes where a length moves a little: so those two are
    solved at lengths LENGTH_STEP away. Arguments: extremes, the error at each torque. Raises UntrustedError where an
    answer cannot be trusted.
    """
    slopes, proofs = np.zeros((len(extremes), len(SLOPE_UNITS))), [EMPTY] * len(extremes)
    for column, (path, micrometre) in enumerate(SLOPE_UNITS.items()):
        value = drive.number(path)
        less, more = max(value - LENGTH_STEP * micrometre, 0.0), value + LENGTH_STEP * micrometre
        for end, sign in ((less, -1), (more, 1)):
            moved = drive.with_values({path: end})
            formulation = formulate(contact_system(moved))
            for row, error in enumerate(extremes):
                states, case = (
                    error.states.take(np.array([error.at_max, error.at_min])),
                    LoadCase(formulation, error.M_g),
                )
                gaps = state_gaps(moved, formulation.system, states)
                answers = case.solve(gaps, partial(state_place, states, error.M_g))
                F_ior = -error.kinematics.error_sign * np.diff(answers.rotation_arcsec)[0]
                slopes[row, column] += sign * F_ior * micrometre / (more - less)
                proofs[row] += answers.certificate
    return tuple(
        Sensitivity(j_n, W_0, g_b, proof) for (j_n, W_0, g_b), proof in zip(slopes.tolist(), proofs, strict=True)
    )
