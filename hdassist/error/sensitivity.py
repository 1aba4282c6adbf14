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

SLOPE_UNITS = {"gears.j_n": 1.0, "cam.W_0": 1e-3, "bearing.g_b": 1.0}  # in the unit of each field
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
    slopes = np.empty((len(extremes), len(SLOPE_UNITS)))
    proofs = [EMPTY] * len(extremes)
    for column, (path, micrometre) in enumerate(SLOPE_UNITS.items()):
        value = drive.number(path)
        ends = (max(value - LENGTH_STEP * micrometre, 0.0), value + LENGTH_STEP * micrometre)
        found = [_range_of_extremes(drive.with_values({path: end}), extremes) for end in ends]
        width = (ends[1] - ends[0]) / micrometre
        for row, ((less, proof), (more, other)) in enumerate(zip(*found, strict=True)):
            slopes[row, column] = (more - less) / width
            proofs[row] += proof + other
    return tuple(Sensitivity(row[0], row[1], row[2], proof) for row, proof in zip(slopes.tolist(), proofs, strict=True))


def _range_of_extremes(drive: Drive, extremes: Sequence[KinematicError]) -> list[tuple[float, Certificate]]:
    """Difference [arcsec] of the states that are the extremes at each torque, in a drive that differs a little."""
    formulation, found = formulate(contact_system(drive)), []
    for error in extremes:
        states = error.states.take(np.array([error.at_max, error.at_min]))
        case = LoadCase(formulation, error.M_g)
        answers = case.solve(state_gaps(drive, case.system, states), partial(state_place, states, error.M_g))
        found.append((error.kinematics.error_sign * float(-np.diff(answers.rotation_arcsec)[0]), answers.certificate))
    return found
