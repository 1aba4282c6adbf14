"""Radii, involute flanks, the nominal gaps between flexspline and rigid wheel, and where teeth bear along their face.

Lengths in mm, angles in rad. Angles theta are measured from the major axis of the cam, in its frame.

The shape that the cam gives the unloaded rim has two conventions. Both give, for sections at angles theta of the
undeformed mid-line, the radial displacement w, the tangential v, so that the section stands at radius r_m + w and angle
theta + v/r_m, and its turn chi there.

The far end of the shell stays round, so the wave of the rim falls towards it, and flanks that were cut parallel touch
first at the open edge of the tooth ring. Each further strip stands off by its share of the wave.

States of a drive are positions of cam and wheels, locked by their pitches, over the full cycle.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache, cached_property, lru_cache
from itertools import pairwise
from math import lcm
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import Fault, UntrustedError
from hdassist.preset.fields import Drive

FLANK_SAMPLES = 401  # heights tried on each flank by default; 4001 move no gap of the shipped presets by 1e-9 mm
_EVERY = (20, 5, 1)  # of them looked at first, then around the least of those, then all around that
_RADIUS_ROUNDS = 60  # of a search for a radius, which gains a factor of about 50 a round, at most
_RADIUS_CONVERGED = 1e-15  # of a radius, its last change
_ACTIVE_ROOT = 0.2  # modules above the root where the fillet ends and the active flank begins


def _involute(alpha: Array | float) -> Array:
    """Involute function tan(alpha) - alpha [rad] of a pressure angle [rad]."""
    return np.asarray(np.tan(alpha) - alpha)


@dataclass(frozen=True)
class Wheel:
    """Involute teeth of one wheel: number, module [mm], reference pressure angle [rad], profile shift."""

    z: int
    m: float
    alpha: float
    x: float

    @cached_property
    def base_radius(self) -> float:
        """Radius of the base circle [mm]."""
        return self.m * self.z * float(np.cos(self.alpha)) / 2

    def pressure_angle(self, radius: Array) -> Array:
        """Pressure angle [rad] of the flank at radii [mm] outside the base circle."""
        return np.asarray(np.arccos(self.base_radius / radius))

    def half_angle(self, radius: Array) -> Array:
        """Half angle psi [rad] of an external tooth, and of an internal wheel's space, at radii [mm]."""
        at_base = (np.pi / 2 + 2 * self.x * np.tan(self.alpha)) / self.z + _involute(self.alpha)
        return np.asarray(at_base - _involute(self.pressure_angle(radius)))


@dataclass(frozen=True)
class Geometry:
    """Radii of a drive [mm] and its two wheels, at their temperatures; z_b - z_g = 2 and two waves."""

    flexspline: Wheel
    rigid: Wheel
    r_f: float  # root of the flexspline
    r_m: float  # mid-line of its rim
    r_ag: float  # tip of the flexspline
    r_ab: float  # tip of the rigid wheel
    r_fb: float  # its root
    r_ring: float  # mid-line of the outer ring of the bearing
    r_raceway: float  # its raceway
    W_0: float
    j_n: float
    curve: _NominalCurve

    @classmethod
    def of(cls, drive: Drive) -> Geometry:
        """Radii of a drive; those of flexspline, bearing and cam grown against the rigid wheel by equation (6c)."""
        g = drive.gears
        alpha = float(np.radians(g.alpha))
        growth = 1 + drive.material.alpha_T * drive.operation.dT
        m = growth * g.m
        h_1 = growth * drive.flexspline.h_1
        ring_h = growth * drive.bearing.ring_h
        r_f = growth * g.root_radius
        r_m = r_f - h_1 / 2
        bore = r_f - h_1
        return cls(
            flexspline=Wheel(z=g.z_g, m=m, alpha=alpha, x=g.x_g),
            rigid=Wheel(z=g.z_b, m=g.m, alpha=alpha, x=g.x_b),
            r_f=r_f,
            r_m=r_m,
            r_ag=m * (g.z_g + 2 * g.x_g + 2 * g.h_a) / 2,
            r_ab=g.m * (g.z_b + 2 * g.x_b - 2 * g.h_a) / 2,
            r_fb=g.m * (g.z_b + 2 * g.x_b + 2 * g.h_f) / 2,
            r_ring=bore - ring_h / 2,
            r_raceway=bore - ring_h,
            W_0=growth * drive.cam.W_0,
            j_n=drive.gears.j_n * 1e-3,
            curve=drive.numerics.nominal_curve,
        )


@dataclass(frozen=True)
class Flanks:
    """Flank pairs that can touch, one entry per candidate, shape (n,)."""

    tooth: NDArray[np.int64]  # index i of the flexspline tooth
    zone: NDArray[np.int64]  # 0: zone at theta = 0, 1: zone at theta = pi
    side: Array  # s = +1 towards +theta, -1 towards -theta
    theta: Array  # theta_i [rad]
    gap: Array  # nominal gap without the clearance j_n [mm]
    alpha: Array  # pressure angle of the contact normal [rad]
    h_c: Array  # height of the contact above the mid-line [mm]

    def repeated(self, times: int) -> Flanks:
        """Each entry so many times, one after the other."""
        return Flanks(**{part.name: getattr(self, part.name).repeat(times) for part in fields(self)})


@lru_cache(maxsize=64)  # the rules of a drive look at the flanks that its contacts are made of
def flank_candidates(geometry: Geometry, tau: float = 0.0, samples: int = FLANK_SAMPLES) -> Flanks:
    """Every flank pair that can touch, with its least gap over the active height.

    Arguments: geometry; tau, the tooth phase in tooth pitches; samples, heights tried on each flank. Pairs whose teeth
    do not overlap radially cannot touch and are left out.
    """
    z_g = geometry.flexspline.z
    index = np.arange(-z_g, 2 * z_g)
    angle = 2 * np.pi * (index + tau) / z_g
    near = [index[np.abs(angle - axis) <= np.pi / 2 + 1e-9] for axis in (0.0, np.pi)]
    tooth = np.repeat(np.concatenate(near), 2)
    zone = np.repeat([0, 1], [2 * len(teeth) for teeth in near])
    side = np.tile([1.0, -1.0], len(tooth) // 2)
    theta = 2 * np.pi * (tooth + tau) / z_g

    of_teeth = nominal_shape(theta[::2], geometry.W_0, geometry.r_m, geometry.curve)  # both flanks of a tooth have one
    w, v, chi = (part.repeat(2) for part in of_teeth)
    lowest, reaches = _lowest_active_radius(geometry, theta, side, (w, v, chi))
    if not reaches.any():
        raise UntrustedError(
            "no tooth of the flexspline reaches the circular spline", "increase cam.W_0 or gears.h_a", Fault.NO_MESH
        )
    tooth = tooth[reaches]
    zone = zone[reaches]
    side = side[reaches]
    theta = theta[reaches]
    lowest = lowest[reaches]
    w, v, chi = (part[reaches][:, None] for part in (w, v, chi))
    rows = np.arange(len(theta))
    height = np.linspace(0, 1, samples)

    def least_at(samples: NDArray[np.int64]) -> tuple[NDArray[np.int64], Array, Array, Array]:
        """The one of these samples of each flank that has the least gap, the gap, radius rho and height r_y there."""
        r_y = lowest[:, None] + (geometry.r_ag - lowest[:, None]) * height[samples]
        gap, rho = flank_gap(geometry, r_y, theta[:, None], zone[:, None], side[:, None], (w, v, chi))
        least = np.argmin(gap, axis=1)
        return np.broadcast_to(samples, gap.shape)[rows, least], gap[rows, least], rho[rows, least], r_y[rows, least]

    # the gap has one valley along a flank, or none but its ends: every 20th sample, then nearer and nearer to the least
    least, *_ = least_at(np.unique(np.append(np.arange(0, samples, _EVERY[0]), samples - 1)))
    for reach, every in pairwise(_EVERY):
        around = np.arange(-reach + every, reach, every)
        least, gap, rho, r_y = least_at(np.clip(least[:, None] + around, 0, samples - 1))
    return Flanks(
        tooth=tooth,
        zone=zone,
        side=side,
        theta=theta,
        gap=gap,
        alpha=geometry.rigid.pressure_angle(rho),
        h_c=r_y - geometry.r_m,
    )


def flank_point(
    geometry: Geometry, r_y: Array, theta: Array, side: Array, shape: _Shape | None = None
) -> tuple[Array, Array]:
    """Polar place (rho [mm], phi [rad]) of the flank point at tooth radius r_y of the tooth at theta.

    The section's origin lies at radius r_m + w and angle theta + v/r_m; shape, its (w, v, chi) where they are known.
    """
    w, v, chi = shape or nominal_shape(theta, geometry.W_0, geometry.r_m, geometry.curve)
    psi = geometry.flexspline.half_angle(r_y)
    along = side * r_y * np.sin(psi)
    across = r_y * np.cos(psi) - geometry.r_m
    tangential = along * np.cos(chi) + across * np.sin(chi)
    radial = geometry.r_m + w + across * np.cos(chi) - along * np.sin(chi)
    rho = np.hypot(radial, tangential)
    return rho, theta + v / geometry.r_m + np.arctan2(tangential, radial)


def flank_gap(
    geometry: Geometry, r_y: Array, theta: Array, zone: NDArray[np.int64], side: Array, shape: _Shape | None = None
) -> tuple[Array, Array]:
    """Gap [mm] of flank points to the facing flank of the rigid wheel, and their radius rho [mm].

    Arguments: those of flank_point; zone of each point.
    """
    rho, phi = flank_point(geometry, r_y, theta, side, shape)
    axis = zone * np.pi
    space = axis + (theta - axis) * geometry.flexspline.z / geometry.rigid.z
    with np.errstate(invalid="ignore"):
        gap = (side * (space - phi) + geometry.rigid.half_angle(rho)) * geometry.rigid.base_radius
    return gap, rho


def _lowest_active_radius(
    geometry: Geometry, theta: Array, side: Array, shape: _Shape
) -> tuple[Array, NDArray[np.bool_]]:
    """Least r_y of each active flank: above the fillet, and at or above the tip circle of the rigid wheel."""
    low = np.full_like(theta, max(geometry.r_f + _ACTIVE_ROOT * geometry.flexspline.m, geometry.flexspline.base_radius))
    high = np.full_like(theta, geometry.r_ag)
    reaches = flank_point(geometry, high, theta, side, shape)[0] >= geometry.r_ab
    inside = flank_point(geometry, low, theta, side, shape)[0] >= geometry.r_ab
    radius = high
    for _ in range(_RADIUS_ROUNDS):
        before = radius
        radius = np.clip(radius + geometry.r_ab - flank_point(geometry, radius, theta, side, shape)[0], low, high)
        if np.max(np.abs(radius - before)) <= _RADIUS_CONVERGED * geometry.r_ag:
            break
    return np.where(inside, low, radius), reaches


#


Array = NDArray[np.float64]
_NominalCurve = Literal["linear", "inextensible"]
_Shape = tuple[Array, Array, Array]

_HARMONICS = 32  # that the arc length is sampled for
_KEPT = 8  # of them: the eighth is below 1e-16 of the first for any wave a drive could have
_ANGLE_ROUNDS = 50  # of a fixed-point iteration that gains a factor W_0/r_m a round, at most
_ANGLE_CONVERGED = 1e-15  # rad, the last change of an angle


def nominal_shape(theta: Array, W_0: float, r_m: float, curve: _NominalCurve = "linear") -> _Shape:
    """Shape (w, v, chi) of the rim on a cam of wave W_0 [mm], mid-line radius r_m [mm].

    linear: the bending mode n = 2 of a ring, w = W_0 cos 2 theta. inextensible: the closed curve
    r_0 + A cos 2 phi that has the length of the undeformed mid-line and stands off by W_0 at the major axis;
    sections keep their arc length and stay normal to it.
    """
    if curve == "inextensible":
        return _inextensible(theta, W_0, r_m)
    w = W_0 * np.cos(2 * theta)
    v = -W_0 / 2 * np.sin(2 * theta)
    chi = (v + 2 * W_0 * np.sin(2 * theta)) / r_m
    return w, v, chi


def _inextensible(theta: Array, W_0: float, r_m: float) -> _Shape:
    r_0, wave, ripple = _closed_curve(W_0, r_m)
    k = 2 * np.arange(1, _KEPT + 1)
    phi = np.asarray(theta, dtype=float)
    for _ in range(_ANGLE_ROUNDS):
        # arc length r_m theta = r_m phi + sum of ripple sin(k phi)
        before = phi
        phi = theta - np.sin(phi[..., None] * k) @ ripple / r_m
        if np.max(np.abs(phi - before), initial=0) < _ANGLE_CONVERGED:
            break
    radius = r_0 + wave * np.cos(2 * phi)
    slope = -2 * wave * np.sin(2 * phi)
    return radius - r_m, r_m * (phi - theta), -np.arctan2(slope, radius)


@cache
def _closed_curve(W_0: float, r_m: float) -> tuple[float, float, Array]:
    """Mean radius and wave of the inextensible curve [mm], and the sine series of its arc length [mm]."""
    phi = np.pi * np.arange(2 * _HARMONICS) / (2 * _HARMONICS)  # a half turn, its period
    shrink = 0.0
    for _ in range(_ANGLE_ROUNDS):
        r_0 = r_m - shrink
        wave = W_0 + shrink
        speed = np.hypot(r_0 + wave * np.cos(2 * phi), 2 * wave * np.sin(2 * phi))
        excess = float(speed.mean()) - r_m
        shrink += excess
        if abs(excess) < _ANGLE_CONVERGED * r_m:
            break
    series = np.fft.rfft(speed).real / _HARMONICS
    return r_0, wave, series[1 : _KEPT + 1] / (2 * np.arange(1, _KEPT + 1))


#


_PER_UM = 1e3  # um in a mm
# width of the strip at the far edge over that at the open edge, of many strips: with five of them K1 is met to 1 % and
# F'_ior to 5 %, where strips that widen evenly (edges at b_w (k/n)^2) miss F'_ior by up to 12 %
_WIDENING = 14.0


@dataclass(frozen=True)
class Face:
    """Stations along the face of every flank, from the open edge of the tooth ring, shape (stations,).

    fall: share of the nominal wave that is missing there; compliance [mm/N] of a tooth pair there.
    """

    fall: Array
    compliance: Array

    @classmethod
    def of(cls, drive: Drive) -> Face:
        """Stations of a drive.

        One: the flank bears as a whole, with contact.c_t. More: strips, each wider than the one before by the same
        factor, as teeth bear on a few millimetres beside the open edge; each bears at its middle, with contact.k_face
        over its width.
        """
        n = drive.numerics.stations
        shell = drive.flexspline
        if n == 1:
            return cls(fall=np.zeros(1), compliance=np.array([drive.contact.c_t]))
        edges = shell.b_w * (_WIDENING ** (np.arange(n + 1) / n) - 1) / (_WIDENING - 1)
        middle = (edges[1:] + edges[:-1]) / 2
        width = np.diff(edges)
        # the cam's W_0 acts at mid-face
        fall = middle / (shell.l - shell.b_w / 2)
        return cls(fall=fall, compliance=1 / (drive.contact.k_face * _PER_UM * width))


# --- states: positions of cam and wheels over the full cycle

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
        return States(
            index=self.index[rows], phi_h=self.phi_h[rows], alpha_g=self.alpha_g[rows], alpha_b=self.alpha_b[rows]
        )


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
