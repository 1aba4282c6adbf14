"""Teeth that mesh without play: the profile shift of the rigid wheel that follows from all else of a drive.

A harmonic drive is made so that its teeth just fill their spaces: wave, clearances and the shifts of both wheels are
chosen for each other, whatever they are. Without load the flanks are free of each other up to there, so the play grows
by the same angle with each micrometre of clearance, and one answer with much clearance shows where it begins.
"""

from __future__ import annotations

import numpy as np

from hdassist.belief.prior import RIGID_SHIFT
from hdassist.error.stiffness import NEAR_ZERO, Twist, rated_torque
from hdassist.model.geometry import Geometry, flank_candidates
from hdassist.preset.fields import Drive
from hdassist.solve.answers import ARCSEC, Certificate

_OPENED = 0.1  # modules of clearance at each flank, with which any drive has play


def meshing_shift(drive: Drive) -> tuple[float, Certificate]:
    """Profile shift of the rigid wheel [modules] at which the teeth of a drive at rest just mesh, with the proof.

    Raises UntrustedError where the drive has no answer with play.
    """
    gears, alpha, opened = drive.gears, np.radians(drive.gears.alpha), _OPENED * drive.gears.m
    at_rest = drive.with_values({"operation.dT": 0.0})
    nearest = float(flank_candidates(Geometry.of(at_rest)).gap.min()) + 1e-3 * gears.j_n  # on the cam's own shape
    near = drive.number(RIGID_SHIFT) - nearest / (gears.m * np.sin(alpha))
    there = at_rest.with_values({RIGID_SHIFT: near, "gears.j_n": gears.j_n + 1e3 * opened})
    least = NEAR_ZERO * rated_torque(drive)
    contact, tube, proof = Twist(there).at(np.array([-least, least]))
    play = float(np.diff(contact + tube)[0]) / ARCSEC  # rad
    # a flank's force acts at the base circle: half of the play is the clearance over its radius
    left = play / 2 * gears.m * gears.z_g / 2 * np.cos(alpha) - opened
    return near - float(left / (gears.m * np.sin(alpha))), proof
