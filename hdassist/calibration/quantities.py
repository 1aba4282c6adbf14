"""Quantities of a drive that a calibration can be asked to meet, computed no more closely than needed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property, partial
from math import ceil, floor

import numpy as np
from scipy.optimize import minimize_scalar

from hdassist.calibration.targets import CalibrationTarget
from hdassist.error.cycle import kinematic_error
from hdassist.error.error_map import Batch, ErrorMap, searchable
from hdassist.error.self_error import self_error
from hdassist.error.stiffness import Twist, stiffness
from hdassist.error.trace import trace
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics, pitch_locked_states
from hdassist.mounting.positions import phase_deg, rotated
from hdassist.preset.fields import Drive
from hdassist.run.run import UNCHECKED
from hdassist.solve.answers import ARCSEC


@dataclass(frozen=True)
class Accuracy:
    """How closely quantities are computed.

    phases: mounting phases around the turn at which the extremes of F'_ior are looked for first; phase_step: how
    closely [deg] they are then located; n_phase: tooth and ball phases of the self error, at most; margin: by how many
    tolerances a target's range is held narrower, because a coarse look misses part of an extreme.
    """

    phases: int
    phase_step: float
    n_phase: int
    margin: float


SEARCHING = Accuracy(phases=8, phase_step=6.0, n_phase=12, margin=0.5)
REPORTING = Accuracy(phases=18, phase_step=1.0, n_phase=200, margin=0.0)


@dataclass(frozen=True)
class PhaseScan:
    """Extremes of F'_ior over the mounting phase: least and greatest [arcsec], and the phases [deg] of both."""

    least: float
    best_deg: float
    greatest: float
    worst_deg: float


class TargetQuantities:
    """Quantities of one drive, each computed when asked for. Raises UntrustedError where one cannot be trusted."""

    def __init__(self, drive: Drive, accuracy: Accuracy) -> None:
        self._drive, self._accuracy = drive, accuracy
        self._error_map = cache(partial(ErrorMap, drive))
        self._stiffness = cache(partial(stiffness, drive, points=0, run=UNCHECKED))
        self._self_errors: dict[float, float] = {}
        self.scan = cache(self._scan)

    def residuals(self, target: CalibrationTarget) -> Array:
        """Deviation from a target in its tolerances, shape (1,), or (readings,) of a trace."""
        return target.residuals(self.predict(target), self._accuracy.margin)

    def predict(self, target: CalibrationTarget) -> Array:
        """The quantity of a target in its unit, shape (1,); of a trace computed less measured error, (readings,)."""
        return self._off_trace(target) if target.trace else np.array([self._value(target)])

    def _value(self, target: CalibrationTarget) -> float:
        asked, quantity = target.asked, target.quantity
        match quantity:
            case "F_ior":
                return self.F_ior(asked["M_g"], asked.get("phase", phase_deg(self._drive)))
            case "F_ior_max":
                return self.scan(asked["M_g"]).greatest
            case "F_ior_min":
                return self.scan(asked["M_g"]).least
            case "revolution_range":
                start = asked.get("phi_g0", 0.0)
                return trace(self._drive, asked["M_g"], start_deg=start, run=UNCHECKED).error.range_arcsec
            case "self_error":
                return self.self_error(asked["M_g"])
            case "torsional_stiffness":
                return float((asked["to"] - asked["from"]) / self._twist.between(asked["from"], asked["to"]) * ARCSEC)
            case "lost_motion" if "M_g" in asked:
                return self._twist.between(-asked["M_g"], asked["M_g"])
            case _:  # lost motion, or K_1 to K_3
                found = self._stiffness(T_1=asked.get("T_1"), T_2=asked.get("T_2"))
                return found.weaker(int(quantity[-1])) if quantity.startswith("K_") else found.lost_motion_arcsec

    def F_ior(self, M_g: float, phase: float) -> float:
        """F'_ior [arcsec] at a torque [N*m] and a mounting phase [deg]."""
        turned = rotated(self._drive, phase - phase_deg(self._drive))
        if searchable(self._drive):
            return self._error_map(M_g).many_extremes(Batch.of(turned)).first
        return kinematic_error(turned, M_g, run=UNCHECKED).F_ior_arcsec

    def self_error(self, M_g: float) -> float:
        """Self error [arcsec] at a torque [N*m]."""
        if M_g not in self._self_errors:
            phases = min(self._drive.numerics.n_phase, self._accuracy.n_phase)
            coarse = self._drive.numerics.model_copy(update={"n_phase": phases})
            # most of the work is the same for all torques
            torques = sorted({M_g, *self._drive.operation.M_g})
            results = self_error(self._drive.model_copy(update={"numerics": coarse}), torques)
            self._self_errors |= {M: result.range_arcsec for M, result in zip(torques, results, strict=True)}
        return self._self_errors[M_g]

    @cached_property
    def _twist(self) -> Twist:
        return Twist(self._drive)

    def _scan(self, M_g: float) -> PhaseScan:
        """Extremes of F'_ior over the mounting phase at a torque [N*m]."""
        step = 360 / self._accuracy.phases
        phases = np.arange(self._accuracy.phases) * step
        F_ior = np.array([self.F_ior(M_g, phase) for phase in phases])

        def least(sign: int) -> tuple[float, float]:
            """The least sign * F'_ior [arcsec] and its phase [deg], in whichever valley of the curve it lies."""
            values = sign * F_ior
            valleys = np.flatnonzero((values <= np.roll(values, 1)) & (values <= np.roll(values, -1)))
            located = [
                minimize_scalar(
                    lambda phase: sign * self.F_ior(M_g, phase),
                    bounds=(phases[k] - step, phases[k] + step),
                    method="bounded",
                    options={"xatol": self._accuracy.phase_step},
                )
                for k in valleys
            ]
            ends = [(float(end.fun), float(end.x) % 360) for end in located]
            return min(*ends, (float(values.min()), float(phases[values.argmin()])))

        (low, best), (high, worst) = least(+1), least(-1)
        return PhaseScan(low, best, -high, worst)

    def _off_trace(self, target: CalibrationTarget) -> Array:
        """Computed less measured error [arcsec] at the angles of a trace, without their mean."""
        phi_h, measured = map(np.array, target.trace)
        kinematics = Kinematics.of(self._drive)
        start = float(np.radians(target.asked.get("phi_g0", 0.0)))
        first, last = phi_h[[0, -1]] / 360 * kinematics.teeth_fixed
        index = np.arange(floor(first), ceil(last) + 1)
        states = pitch_locked_states(kinematics, index, start)
        error = kinematic_error(self._drive, target.asked["M_g"], states=states, run=UNCHECKED)
        difference = np.interp(phi_h, np.degrees(states.phi_h), error.error_arcsec) - measured
        return np.asarray(difference - difference.mean())
