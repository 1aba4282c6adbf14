"""States of a drive: pitch-locked positions of cam and wheels over the full cycle."""

from __future__ import annotations

from dataclasses import dataclass
from math import lcm

import numpy as np
from numpy.typing import NDArray

from hdassist.model.geometry import Array, Geometry
from hdassist.preset.fields import Drive

STRIP = 4  # cam revolutions abreast: 4 x 8 states, about square, are carried along by the engine at once


@dataclass(frozen=True)
class Kinematics:
    """Ratio and cycle of a drive. u: cam turns per turn of the output wheel, negative where they turn apart."""

    z_g: int
    z_b: int
    fixed: str

    @classmethod
    def of(cls, drive: Drive) -> Kinematics:
        """Kinematics of a drive, from its preset."""
        return cls(drive.gears.z_g, drive.gears.z_b, drive.mounting.fixed)

    @property
    def u(self) -> float:
        """Transmission ratio: u_hg = z_g/(z_g - z_b) with the rigid wheel fixed, z_b/(z_b - z_g) otherwise."""
        moving = self.z_g if self.fixed == "rigid" else -self.z_b
        return moving / (self.z_g - self.z_b)

    @property
    def error_sign(self) -> int:
        """Sign of F_kpp against the flexspline's rotation.

        The rotation is the flexspline's against the rigid wheel; the latter's is its opposite.
        """
        return -1 if self.fixed == "rigid" else 1

    @property
    def teeth_fixed(self) -> int:
        """Teeth of the fixed wheel: states per cam revolution."""
        return self.z_b if self.fixed == "rigid" else self.z_g

    @property
    def cycle_states(self) -> int:
        """States after which every pair of teeth has met: lcm(z_g, z_b)."""
        return lcm(self.z_g, self.z_b)

    @property
    def cycle_cam_revolutions(self) -> int:
        """Cam revolutions of the full cycle."""
        return self.cycle_states // self.teeth_fixed


@dataclass(frozen=True)
class States:
    """Positions of a drive [rad], shape (states,): the cam, and both wheels as they stand in its frame."""

    index: NDArray[np.int64]
    phi_h: Array
    alpha_g: Array  # phi_g - phi_h
    alpha_b: Array  # phi_b - phi_h

    @property
    def phi_g(self) -> Array:
        """Angle of the flexspline [rad]."""
        return self.alpha_g + self.phi_h

    @property
    def phi_b(self) -> Array:
        """Angle of the rigid wheel [rad]."""
        return self.alpha_b + self.phi_h

    def __len__(self) -> int:
        return len(self.index)

    def take(self, rows: NDArray[np.int64]) -> States:
        """Some of the states, by their place."""
        return States(self.index[rows], self.phi_h[rows], self.alpha_g[rows], self.alpha_b[rows])


def pitch_locked_states(kinematics: Kinematics, index: NDArray[np.int64] | None = None, start: float = 0.0) -> States:
    """States j, in which the cam has advanced by j tooth pitches of the fixed wheel.

    Arguments: index of the states, by default those of the full cycle; start, the angle [rad] of the
    moving wheel at phi_h = 0 (phi_g0 with the rigid wheel fixed).
    """
    j = np.arange(kinematics.cycle_states) if index is None else np.asarray(index)
    start_g, start_b = (start, 0.0) if kinematics.fixed == "rigid" else (0.0, start)
    return States(
        index=j,
        phi_h=2 * np.pi * j / kinematics.teeth_fixed,
        alpha_g=start_g - 2 * np.pi * j / kinematics.z_g,
        alpha_b=start_b - 2 * np.pi * j / kinematics.z_b,
    )


def neighbours_together(kinematics: Kinematics, states: States) -> NDArray[np.int64]:
    """Order of states, shape (states,), in which those that follow each other differ little.

    A cam revolution later the cam is where it was and the moving wheel has gone on by two teeth: the order goes
    over STRIP revolutions abreast, there and back.
    """
    turn, step = np.divmod(states.index, kinematics.teeth_fixed)
    strip, row = np.divmod(turn, STRIP)
    step = np.where(strip % 2, -step, step)
    return np.lexsort((np.where(step % 2, -row, row), step, strip))


def ball_phase(drive: Drive, phi_h: Array) -> Array:
    """Ball phase beta [ball pitches, in 0..1) at cam angles [rad]: constant, or that of a rolling cage.

    The cage turns by -phi_h r_o/(r_i + r_o) in the cam frame, r_o the raceway of the outer ring.
    """
    beta = np.full_like(phi_h, drive.bearing.beta)
    if drive.bearing.ball_motion == "rolling" and drive.bearing.d_ball is not None:
        r_o = Geometry.of(drive).r_raceway
        share = r_o / (2 * r_o - drive.bearing.d_ball)
        beta -= share * phi_h * drive.bearing.N / (2 * np.pi)
    return np.mod(beta, 1.0)
