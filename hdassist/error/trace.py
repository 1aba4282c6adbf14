"""The error against the cam angle, as a rig would record it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdassist.error.cycle import KinematicError, kinematic_error
from hdassist.error.orders import Order, orders
from hdassist.errors import UsageError
from hdassist.model.kinematics import Kinematics, pitch_locked_states
from hdassist.model.wheels import MeasuredTeeth
from hdassist.preset.fields import Drive
from hdassist.run.run import Run


@dataclass(frozen=True)
class Trace:
    """Error over whole cam revolutions from phi_h = 0.

    start_deg: the moving wheel's angle there; measured: wheels in place of first harmonics.
    """

    error: KinematicError
    start_deg: float
    revolutions: int
    orders: tuple[Order, ...]
    measured: MeasuredTeeth | None = None


def trace(
    drive: Drive,
    M_g: float,
    *,
    measured: MeasuredTeeth | None = None,
    start_deg: float = 0.0,
    revolutions: int = 1,
    solver: str | None = None,
    run: Run = Run(),
) -> Trace:
    """Error of a drive at a torque M_g [N*m] over whole cam revolutions, and its orders.

    Arguments: measured, wheels in place of first harmonics; start_deg, angle of the moving wheel at phi_h = 0 (phi_g0
    with the rigid wheel fixed) [deg], where that wheel is measured to the nearest of its teeth; solver, a name that
    cvxpy knows, to send each state through cvxpy instead of the engine.
    Raises UsageError for less than one revolution, more than a cycle, a start angle that is no number or an unknown
    solver, UntrustedError where an answer cannot be trusted.
    """
    kinematics = Kinematics.of(drive)
    if not 1 <= revolutions <= kinematics.cycle_cam_revolutions:
        raise UsageError(
            f"revolutions must be 1 to {kinematics.cycle_cam_revolutions}, not {revolutions}",
            "after the full cycle the error repeats itself",
        )
    if not np.isfinite(start_deg):
        raise UsageError(f"the start angle must be a number, not {start_deg}")
    states = pitch_locked_states(
        kinematics, np.arange(revolutions * kinematics.teeth_fixed), float(np.radians(start_deg))
    )
    there, teeth = measured.in_drive(drive) if measured else (drive, None)
    error = kinematic_error(there, M_g, states=states, teeth=teeth, solver=solver, run=run)
    found = orders(drive, error.error_arcsec, revolutions)
    return Trace(error, start_deg, revolutions, tuple(found), measured)
