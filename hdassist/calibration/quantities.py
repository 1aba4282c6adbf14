"""Quantities of a drive that a calibration can be asked to meet."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from scipy.optimize import minimize_scalar

from hdassist.calibration.targets import CalibrationTarget
from hdassist.error.error_map import Batch, ErrorMap
from hdassist.error.self_error import self_error
from hdassist.error.stiffness import Twist, stiffness
from hdassist.model.geometry import Array
from hdassist.mounting.positions import phase_deg
from hdassist.preset.fields import Drive
from hdassist.run.run import UNCHECKED

PHASE_STEP = 20.0  # deg between the phases of which the extremes are located from
PHASE_TOLERANCE = 0.1  # deg, of an extreme


@dataclass(frozen=True)
class PhaseScan:
    """Extremes of F'_ior over the mounting phase: least and greatest [arcsec], and the phases [deg] of both."""

    least: float
    best_deg: float
    greatest: float
    worst_deg: float


def predictions(drive: Drive, targets: Sequence[CalibrationTarget]) -> tuple[float, ...]:
    """The quantity of each target in its unit. Raises UntrustedError where one cannot be trusted."""
    scan = cache(partial(phase_scan, drive))
    torques = sorted({target.asked["M_g"] for target in targets if target.quantity == "self_error"})
    self_errors = dict(zip(torques, self_error(drive, torques) if torques else (), strict=True))
    chords = cache(partial(stiffness, drive, points=0, run=UNCHECKED))

    def predicted(target: CalibrationTarget) -> float:
        asked, quantity = target.asked, target.quantity
        M_g = asked.get("M_g", 0.0)
        if quantity == "F_ior":
            return float(F_ior_at_phases(ErrorMap(drive, M_g), [asked.get("phase", phase_deg(drive))])[0])
        if quantity.startswith("F_ior"):
            return scan(M_g).greatest if quantity == "F_ior_max" else scan(M_g).least
        if quantity == "self_error":
            return self_errors[M_g].range_arcsec
        if M_g:  # lost motion
            return Twist(drive).between(-M_g, M_g)
        found = chords(T_1=asked.get("T_1"), T_2=asked.get("T_2"))
        return found.lost_motion_arcsec if quantity == "lost_motion" else found.weaker(int(quantity[-1]))

    return tuple(map(predicted, targets))


def F_ior_at_phases(error_map: ErrorMap, phases: Iterable[float]) -> Array:
    """F'_ior [arcsec] of a map's drive at mounting phases [deg], shape (phases,)."""
    own = phase_deg(error_map.drive)
    return error_map.many_extremes(Batch.turned(error_map.drive, [phase - own for phase in phases])).F_ior_arcsec


def phase_scan(drive: Drive, M_g: float) -> PhaseScan:
    """Extremes of F'_ior over the mounting phase at a torque [N*m]."""
    error_map, phases = ErrorMap(drive, M_g), np.arange(0, 360, PHASE_STEP)
    F_ior = F_ior_at_phases(error_map, phases)

    def least(sign: int) -> tuple[float, float]:
        """The least sign * F'_ior [arcsec] and its phase [deg]."""
        middle = phases[(sign * F_ior).argmin()]
        found = minimize_scalar(
            lambda phase: sign * F_ior_at_phases(error_map, [phase])[0],
            bounds=(middle - PHASE_STEP, middle + PHASE_STEP),
            method="bounded",
            options={"xatol": PHASE_TOLERANCE},
        )
        return float(found.fun), float(found.x) % 360

    (low, best), (high, worst) = least(+1), least(-1)
    return PhaseScan(low, best, -high, worst)
