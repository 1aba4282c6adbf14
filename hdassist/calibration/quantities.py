"""What a drive does, in the quantities that a calibration can be asked to meet."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil

import numpy as np
from scipy.optimize import minimize_scalar

from hdassist.calibration.targets import Target
from hdassist.error.cycle import kinematic_error
from hdassist.error.error_map import Batch, ErrorMap, searchable
from hdassist.error.self_error import self_error
from hdassist.error.stiffness import Stiffness, Twist, stiffness
from hdassist.error.trace import trace
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics, pitch_locked_states
from hdassist.mounting.positions import phase_deg, rotated
from hdassist.preset.fields import Drive
from hdassist.solve.answers import ARCSEC


@dataclass(frozen=True)
class Accuracy:
    """How closely quantities are computed.

    phases: mounting positions tried around the turn; refine: how closely [deg] the extremes over the phase are
    then looked for, 0: a parabola through the positions tried; n_phase: tooth and ball phases of the self error,
    at most; margin: by how many tolerances a range that should hold something is held narrower, because a coarse
    look sees less than there is.
    """

    phases: int
    refine: float
    n_phase: int
    margin: float


ROUGH = Accuracy(phases=8, refine=0.0, n_phase=5, margin=0.5)
MEDIUM = Accuracy(phases=8, refine=6.0, n_phase=12, margin=0.5)
FINE = Accuracy(phases=18, refine=1.0, n_phase=200, margin=0.0)


@dataclass(frozen=True)
class Scan:
    """F'_ior over the mounting phase: least and greatest [arcsec], and the phases [deg] where they stand."""

    least: float
    best_deg: float
    greatest: float
    worst_deg: float


class Quantities:
    """Quantities of one drive, each computed once, when asked for.

    Raises UntrustedError where an answer cannot be trusted.
    """

    def __init__(self, drive: Drive, accuracy: Accuracy) -> None:
        self._drive, self._accuracy = drive, accuracy
        self._maps: dict[float, ErrorMap] = {}
        self._F_ior: dict[tuple[float, float], float] = {}
        self._self_errors: dict[float, float] = {}
        self._stiffnesses: dict[tuple[float | None, float | None], Stiffness] = {}

    def off(self, target: Target) -> Array:
        """How far the drive is from a target, in its tolerances; a trace has one value for each of its states."""
        if target.trace is not None:
            difference = self._off_trace(target)
            return np.asarray(difference / target.tolerance / np.sqrt(len(difference)))
        value = self.value(target)
        wanted = target.value
        if wanted is None:
            inside = min(self._accuracy.margin * target.tolerance, (target.high - target.low) / 2)
            wanted = float(np.clip(value, target.low + inside, target.high - inside))
        return np.array([(value - wanted) / target.tolerance])

    def value(self, target: Target) -> float:
        """The quantity of a target, in its unit; of a trace, the rms difference [arcsec]."""
        asked = target.asked
        match target.quantity:
            case "F_ior":
                return self.F_ior(asked["M_g"], asked.get("phase", phase_deg(self._drive)))
            case "F_ior_max":
                return self.scan(asked["M_g"]).greatest
            case "F_ior_min":
                return self.scan(asked["M_g"]).least
            case "revolution_range":
                start = asked.get("phi_g0", 0.0)
                return trace(self._drive, asked["M_g"], start_deg=start, cross_check=None).error.range_arcsec
            case "self_error":
                return self.self_error(asked["M_g"])
            case "torsional_stiffness":
                return float((asked["to"] - asked["from"]) / self._twist.between(asked["from"], asked["to"]) * ARCSEC)
            case "K_1" | "K_2" | "K_3":
                return self._stiffness(asked.get("T_1"), asked.get("T_2")).weaker(int(target.quantity[-1]))
            case "lost_motion" if "M_g" in asked:
                return self._twist.between(-asked["M_g"], asked["M_g"])
            case "lost_motion":
                return self._stiffness(None, None).lost_motion_arcsec
            case _:
                return float(np.sqrt(np.mean(self._off_trace(target) ** 2)))

    def F_ior(self, M_g: float, phase: float) -> float:
        """F'_ior [arcsec] at a torque [N*m] and a mounting phase [deg]."""
        key = (M_g, float(phase) % 360)
        if key not in self._F_ior:
            there = rotated(self._drive, key[1] - phase_deg(self._drive))
            if searchable(self._drive):
                if M_g not in self._maps:
                    self._maps[M_g] = ErrorMap(self._drive, M_g)
                self._F_ior[key] = self._maps[M_g].many_extremes(Batch.of(there)).first
            else:
                self._F_ior[key] = kinematic_error(there, M_g, cross_check=None).F_ior_arcsec
        return self._F_ior[key]

    def scan(self, M_g: float) -> Scan:
        """Least and greatest F'_ior over the mounting phase at a torque [N*m]."""
        (best, least), (worst, greatest) = (self._extreme(M_g, sign) for sign in (+1, -1))
        return Scan(least, best % 360, -greatest, worst % 360)

    def best_deg(self, M_g: float) -> float:
        """Mounting phase [deg] of the least F'_ior at a torque [N*m]."""
        return self._extreme(M_g, +1)[0] % 360

    def self_error(self, M_g: float) -> float:
        """Self error [arcsec] at a torque [N*m]."""
        if M_g not in self._self_errors:
            phases = min(self._drive.numerics.n_phase, self._accuracy.n_phase)
            coarse = self._drive.numerics.model_copy(update={"n_phase": phases})
            drive = self._drive.model_copy(update={"numerics": coarse})
            # most of the work is the same for all torques
            torques = sorted({M_g, *drive.operation.M_g})
            results = self_error(drive, torques)
            self._self_errors |= {M: result.range_arcsec for M, result in zip(torques, results, strict=True)}
        return self._self_errors[M_g]

    def _stiffness(self, T_1: float | None, T_2: float | None) -> Stiffness:
        """Stiffness, without points between its ends; T_1, T_2, ends of segments [N*m], by default a catalogue's."""
        if (T_1, T_2) not in self._stiffnesses:
            found = stiffness(self._drive, T_1=T_1, T_2=T_2, points=0, cross_check=None)
            self._stiffnesses[T_1, T_2] = found
        return self._stiffnesses[T_1, T_2]

    @cached_property
    def _twist(self) -> Twist:
        return Twist(self._drive)

    def _extreme(self, M_g: float, sign: int) -> tuple[float, float]:
        """Phase [deg] of the least sign * F'_ior, and that value."""
        step = 360 / self._accuracy.phases
        tried = np.arange(self._accuracy.phases) * step
        values = np.array([sign * self.F_ior(M_g, phase) for phase in tried])
        if not self._accuracy.refine:
            k = int(np.argmin(values))
            before, here, after = values[k - 1], values[k], values[(k + 1) % len(values)]
            bend = before - 2 * here + after
            shift = (before - after) / (2 * bend) if bend > 0 else 0.0
            return float(tried[k] + shift * step), float(here - (before - after) * shift / 4)
        # every valley that the phases tried show: the curve may have several
        valleys = np.flatnonzero((values <= np.roll(values, 1)) & (values <= np.roll(values, -1)))
        found = []
        for k in valleys.tolist():
            answer = minimize_scalar(
                lambda phase: sign * self.F_ior(M_g, phase),
                bounds=(tried[k] - step, tried[k] + step),
                method="bounded",
                options={"xatol": self._accuracy.refine},
            )
            found.append((float(answer.fun), float(answer.x)))
            found.append((float(values[k]), float(tried[k])))
        value, phase = min(found)
        return phase, value

    def _off_trace(self, target: Target) -> Array:
        """Computed less measured error [arcsec] at the angles of a trace, without their mean."""
        if target.trace is None:
            raise ValueError("the target has no trace")
        phi_h, measured = map(np.array, target.trace)
        kinematics = Kinematics.of(self._drive)
        start = float(np.radians(target.asked.get("phi_g0", 0.0)))
        index = np.arange(ceil(phi_h[-1] / 360 * kinematics.teeth_fixed) + 1)
        states = pitch_locked_states(kinematics, index, start)
        error = kinematic_error(self._drive, target.asked["M_g"], states=states, cross_check=None)
        difference = np.interp(phi_h, np.degrees(states.phi_h), error.error_arcsec) - measured
        return np.asarray(difference - difference.mean())
