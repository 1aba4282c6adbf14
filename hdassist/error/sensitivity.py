"""What a micrometre does: derivatives of F'_ior by the lengths that it hinges on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hdassist.error.cycle import KinematicError, kinematic_error
from hdassist.preset.fields import Drive
from hdassist.run.run import UNCHECKED
from hdassist.solve.answers import EMPTY, Certificate

SLOPE_UNITS = {"gears.j_n": 1.0, "cam.W_0": 1e-3, "bearing.g_b": 1.0}  # a micrometre in the unit of each field
LENGTH_STEP = 0.1  # micrometres to both sides, so that no contact set changes much


@dataclass(frozen=True)
class Sensitivity:
    """Change of F'_ior [arcsec per um] with the flank clearance j_n, the wave W_0 and the bearing clearance g_b.

    Differences over LENGTH_STEP to both sides; where a clearance is less than that, to one side.
    """

    certificate: Certificate
    j_n: float
    W_0: float
    g_b: float


def sensitivity(drive: Drive, extremes: Sequence[KinematicError]) -> tuple[Sensitivity, ...]:
    """Sensitivity of a drive at each of its torques.

    F'_ior is the difference of two states, which stay the extremes where a length moves a little: so those two are
    solved at lengths LENGTH_STEP away. Arguments: extremes, the error at each torque. Raises UntrustedError where an
    answer cannot be trusted.
    """
    found = []
    for error in extremes:
        states, slopes, proof = error.states.take(np.array([error.at_max, error.at_min])), [], EMPTY
        for path, micrometre in SLOPE_UNITS.items():
            value, step = drive.number(path), LENGTH_STEP * micrometre
            ends = max(value - step, 0.0), value + step
            moved = [drive.with_values({path: end}) for end in ends]
            less, more = (kinematic_error(each, error.M_g, states=states, run=UNCHECKED) for each in moved)
            slopes.append((more.range_arcsec - less.range_arcsec) * micrometre / (ends[1] - ends[0]))
            proof += less.certificate + more.certificate
        found.append(Sensitivity(proof, *slopes))
    return tuple(found)
