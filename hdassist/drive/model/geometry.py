"""Geometry of a drive: radii, involute flanks, nominal gaps between the wheels, and stations along the face.

Lengths in mm, angles in rad. Angles theta are measured from the major axis of the cam, in its frame.

There are two conventions for the shape of the unloaded rim on the cam. Both give the radial displacement w, the
tangential displacement v and the rotation chi of a section that is at the angle theta of the undeformed mid-line. On
the cam, the section is at radius r_m + w and angle theta + v/r_m.

The far end of the shell remains round, so the wave of the rim decreases towards it. Flanks that were cut parallel
therefore touch first at the open edge of the tooth ring. The gap of each further strip is larger, in proportion to the
share of the wave that is missing there.

States of a drive are positions of the wave generator and the wheels at whole tooth pitches over the full cycle.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache, cached_property, lru_cache
from itertools import pairwise
from math import lcm
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.preset.fields import Drive
from hdassist.run.errors import Fault, UntrustedError

# default number of heights sampled on each flank; 4001 heights change no gap of the shipped presets by 1e-9 mm
FLANK_SAMPLES = 401
# every 20th height is sampled first, then every 5th near the smallest gap, then all heights near it
_SAMPLE_STEPS = (20, 5, 1)
_RADIUS_ROUNDS = 60  # largest number of iterations for a radius; each reduces its error by a factor of about 50
_RADIUS_CONVERGED = 1e-15  # change per iteration at which a radius has converged, as a share of the tip radius
_ACTIVE_ROOT = 0.2  # modules above the root at which the fillet ends and the active flank begins

Array = NDArray[np.float64]
_NominalCurve = Literal["linear", "inextensible"]


def _involute(alpha: Array | float) -> Array:
    """Return the involute function tan(alpha) - alpha [rad] of a pressure angle [rad]."""
    return np.asarray(np.tan(alpha) - alpha)


@dataclass(frozen=True)
class Wheel:
    """Involute teeth of one wheel.

    z: number of teeth.
    m: module [mm].
    alpha: reference pressure angle [rad].
    x: profile shift.
    """

    z: int
    m: float
    alpha: float
    x: float

    @cached_property
    def base_radius(self) -> float:
        """Radius of the base circle [mm]."""
        return self.m * self.z * float(np.cos(self.alpha)) / 2

    def pressure_angle(self, radius: Array) -> Array:
        """Return the pressure angle of the flank [rad] at radii [mm] outside the base circle."""
        return np.asarray(np.arccos(self.base_radius / radius))

    def half_angle(self, radius: Array) -> Array:
        """Return the half angle psi of an external tooth, or of the space of an internal wheel [rad], at radii [mm].

        This is equation (6) of docs/theory.md.
        """
        # tooth and space have equal widths at the reference circle, apart from the profile shift; the involute function
        # gives the widths at all other radii
        half_angle_at_base = (np.pi / 2 + 2 * self.x * np.tan(self.alpha)) / self.z + _involute(self.alpha)
        return np.asarray(half_angle_at_base - _involute(self.pressure_angle(radius)))


@dataclass(frozen=True)
class Geometry:
    """Radii of a drive [mm] and its two wheels, at their temperatures, for z_b - z_g = 2 and two waves."""

    flexspline: Wheel
    rigid: Wheel
    r_f: float  # root of the flexspline
    r_m: float  # mid-line of the rim of the flexspline
    r_ag: float  # tip of the flexspline
    r_ab: float  # tip of the circular spline
    r_fb: float  # root of the circular spline
    r_ring: float  # mid-line of the outer ring of the bearing
    r_raceway: float  # raceway of the outer ring of the bearing
    W_0: float
    j_n: float
    curve: _NominalCurve

    @classmethod
    def of(cls, drive: Drive) -> Geometry:
        """Return the radii of a drive, with thermal expansion of flexspline, bearing and cam, equation (6c)."""
        g = drive.gears
        alpha = float(np.radians(g.alpha))
        # the circular spline has the reference temperature, and dT is the temperature of the flexspline above it
        growth = 1 + drive.material.alpha_T * drive.operation.dT
        # uniform heating preserves the shape of a body: its module grows and its angles do not change
        m = growth * g.m
        h_1 = growth * drive.flexspline.h_1
        ring_h = growth * drive.bearing.ring_h
        r_f = growth * g.root_radius
        # the rim below the teeth has the thickness h_1 and bends about its mid-line
        r_m = r_f - h_1 / 2
        bore = r_f - h_1
        return cls(
            flexspline=Wheel(
                z=g.z_g,
                m=m,
                alpha=alpha,
                x=g.x_g,
            ),
            rigid=Wheel(
                z=g.z_b,
                m=g.m,
                alpha=alpha,
                x=g.x_b,
            ),
            r_f=r_f,
            r_m=r_m,
            r_ag=m * (g.z_g + 2 * g.x_g + 2 * g.h_a) / 2,
            # the tip circle of an internal wheel is its smallest radius
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
    side: Array  # +1 for the flank towards +theta, -1 towards -theta
    theta: Array  # angle theta_i of the tooth [rad]
    gap: Array  # nominal gap without the clearance j_n [mm]
    alpha: Array  # pressure angle of the contact normal [rad]
    h_c: Array  # height of the contact above the mid-line [mm]

    def repeated(self, times: int) -> Flanks:
        """Return the flanks with every entry repeated in consecutive copies."""
        return Flanks(**{part.name: getattr(self, part.name).repeat(times) for part in fields(self)})


class _NominalShape(NamedTuple):
    """Displacement of rim sections by the cam.

    w: radial displacement [mm].
    v: tangential displacement [mm].
    chi: rotation [rad].
    """

    w: Array
    v: Array
    chi: Array


@dataclass(frozen=True)
class _FlankPairs:
    """Pairs of flanks that overlap radially, before their gap is computed, shape (n,)."""

    tooth: NDArray[np.int64]
    zone: NDArray[np.int64]
    side: Array
    theta: Array
    lowest_r_y: Array  # smallest tooth radius of the active flank [mm]
    shape: _NominalShape


class _FlankPoints(NamedTuple):
    """One point of each flank, shape (n,)."""

    sample: NDArray[np.int64]  # index of the point among the sampled heights
    gap: Array  # [mm]
    rho: Array  # distance from the axis [mm]
    r_y: Array  # tooth radius [mm]


@lru_cache(maxsize=64)  # the rules of a drive need the same flanks as its contact systems
def flank_candidates(
    geometry: Geometry,
    tau: float = 0.0,
    samples: int = FLANK_SAMPLES,
) -> Flanks:
    """Return all flank pairs that can touch, each with its smallest gap over the active height.

    Pairs whose teeth do not overlap radially cannot touch and are omitted.

    Args:
        geometry: radii and wheels of the drive.
        tau: tooth phase [tooth pitches].
        samples: number of heights sampled on each flank.

    Raises UntrustedError if no tooth of the flexspline reaches the circular spline.
    """
    pairs = _overlapping_pairs(geometry, tau)
    points = _nearest_points(geometry, pairs, samples)
    return Flanks(
        tooth=pairs.tooth,
        zone=pairs.zone,
        side=pairs.side,
        theta=pairs.theta,
        gap=points.gap,
        # contact normals are those of the circular spline's flanks, because its teeth keep their shape
        alpha=geometry.rigid.pressure_angle(points.rho),
        h_c=points.r_y - geometry.r_m,
    )


def _overlapping_pairs(geometry: Geometry, tau: float) -> _FlankPairs:
    """Return the flank pairs within a quarter revolution of a mesh zone whose teeth overlap radially."""
    z_g = geometry.flexspline.z
    # three revolutions of teeth, because the range around theta = 0 begins below 0 and the range around pi extends
    # further
    index = np.arange(-z_g, 2 * z_g)
    angle = 2 * np.pi * (index + tau) / z_g
    # the margin of 1e-9 rad keeps a tooth exactly on the minor axis, which rounding could exclude
    teeth_by_zone = [index[np.abs(angle - axis) <= np.pi / 2 + 1e-9] for axis in (0.0, np.pi)]
    # every tooth has two flanks in consecutive elements: s = +1, then s = -1
    tooth = np.repeat(np.concatenate(teeth_by_zone), 2)
    zone = np.repeat([0, 1], [2 * len(teeth) for teeth in teeth_by_zone])
    side = np.tile([1.0, -1.0], len(tooth) // 2)
    theta = 2 * np.pi * (tooth + tau) / z_g

    # both flanks of a tooth have the same rim shape
    shape_of_teeth = nominal_shape(theta[::2], geometry.W_0, geometry.r_m, geometry.curve)
    shape = _NominalShape(*(part.repeat(2) for part in shape_of_teeth))
    lowest_r_y, reaches = _lowest_active_radius(geometry, theta, side, shape)
    if not reaches.any():
        raise UntrustedError(
            "no tooth of the flexspline reaches the circular spline", "increase cam.W_0 or gears.h_a", Fault.NO_MESH
        )
    return _FlankPairs(
        tooth=tooth[reaches],
        zone=zone[reaches],
        side=side[reaches],
        theta=theta[reaches],
        lowest_r_y=lowest_r_y[reaches],
        shape=_NominalShape(*(part[reaches] for part in shape)),
    )


def _nearest_points(
    geometry: Geometry,
    pairs: _FlankPairs,
    samples: int,
) -> _FlankPoints:
    """Return the point of each flank with the smallest gap among the sampled heights of its active part.

    The gap along a flank has only one minimum, possibly at an end. The search therefore starts with coarse steps of
    height and refines them near the smallest gap.

    samples: number of heights.
    """
    # heights are shares of the active height, which differs between teeth
    heights = np.linspace(0, 1, samples)
    # the tip is always included, because the smallest gap is often there
    tried = np.unique(np.append(np.arange(0, samples, _SAMPLE_STEPS[0]), samples - 1))
    points = _nearest_of(geometry, pairs, heights, tried)
    for coarse_step, fine_step in pairwise(_SAMPLE_STEPS):
        # the search continues between the neighbours of the best height so far
        offsets = np.arange(-coarse_step + fine_step, coarse_step, fine_step)
        # clipping repeats the height at an end, which does not change the minimum
        tried = np.clip(points.sample[:, None] + offsets, 0, samples - 1)
        points = _nearest_of(geometry, pairs, heights, tried)
    return points


def _nearest_of(
    geometry: Geometry,
    pairs: _FlankPairs,
    heights: Array,
    tried: NDArray[np.int64],
) -> _FlankPoints:
    """Return the point of each flank with the smallest gap among the given samples.

    Args:
        geometry: radii and wheels of the drive.
        pairs: flank pairs, shape (n,).
        heights: relative heights of all samples, 0 at the lowest active point and 1 at the tip, shape (samples,).
        tried: indices of the samples, shape (tried,) for all flanks, or (n, tried).
    """
    # columns are heights, so arrays with one value per flank get a second axis
    lowest = pairs.lowest_r_y[:, None]
    r_y = lowest + (geometry.r_ag - lowest) * heights[tried]  # shape (n, tried)
    shape = _NominalShape(*(part[:, None] for part in pairs.shape))
    gap, rho = flank_gap(geometry, r_y, pairs.theta[:, None], pairs.zone[:, None], pairs.side[:, None], shape)
    rows = np.arange(len(gap))
    nearest = np.argmin(gap, axis=1)
    sample = np.broadcast_to(tried, gap.shape)
    return _FlankPoints(
        sample=sample[rows, nearest], gap=gap[rows, nearest], rho=rho[rows, nearest], r_y=r_y[rows, nearest]
    )


def flank_point(
    geometry: Geometry,
    r_y: Array,
    theta: Array,
    side: Array,
    shape: _NominalShape | None = None,
) -> tuple[Array, Array]:
    """Return the polar coordinates (rho [mm], phi [rad]) of flank points; all shapes broadcast.

    Args:
        geometry: radii and wheels of the drive.
        r_y: tooth radius of the point [mm].
        theta: angle of the tooth [rad].
        side: +1 for the flank towards +theta, -1 for the opposite flank.
        shape: displacement of the sections; by default the nominal shape at theta.
    """
    # a rigid section moves and turns with the mid-line, as in equation (3)
    w, v, chi = shape or nominal_shape(theta, geometry.W_0, geometry.r_m, geometry.curve)
    psi = geometry.flexspline.half_angle(r_y)
    # coordinates from the origin of the section, at radius r_m + w and angle theta + v/r_m, in the axes of the section
    along = side * r_y * np.sin(psi)
    across = r_y * np.cos(psi) - geometry.r_m
    # rotation of the section by chi
    tangential = along * np.cos(chi) + across * np.sin(chi)
    radial = geometry.r_m + w + across * np.cos(chi) - along * np.sin(chi)
    rho = np.hypot(radial, tangential)
    return rho, theta + v / geometry.r_m + np.arctan2(tangential, radial)


def flank_gap(
    geometry: Geometry,
    r_y: Array,
    theta: Array,
    zone: NDArray[np.int64],
    side: Array,
    shape: _NominalShape | None = None,
) -> tuple[Array, Array]:
    """Return the gap between flank points and the facing flank of the circular spline, and their radius rho [mm].

    The gap is given by equation (6).

    Args:
        geometry: radii and wheels of the drive.
        r_y: tooth radius of the point [mm].
        theta: angle of the tooth [rad].
        zone: 0 for the mesh zone at theta = 0, 1 for the zone at pi.
        side: +1 for the flank towards +theta, -1 for the opposite flank.
        shape: displacement of the sections; by default the nominal shape at theta.
    """
    rho, phi = flank_point(geometry, r_y, theta, side, shape)
    # axis of the zone, theta = 0 or pi; a tooth on the axis faces the middle of a space
    axis = zone * np.pi
    # the i-th space from the axis faces the i-th tooth: equal numbers of pitches of unequal width
    theta_space = axis + (theta - axis) * geometry.flexspline.z / geometry.rigid.z
    with np.errstate(invalid="ignore"):  # points inside the base circle of the circular spline have no gap
        gap = (side * (theta_space - phi) + geometry.rigid.half_angle(rho)) * geometry.rigid.base_radius
    return gap, rho


def _lowest_active_radius(
    geometry: Geometry,
    theta: Array,
    side: Array,
    shape: _NominalShape,
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the smallest r_y of each active flank [mm], and whether the tooth reaches the circular spline.

    Both arrays have the shape (n,). The active flank is the part above the fillet and outside the tip circle of the
    circular spline.
    """
    # the involute ends at the base circle, which lies above the fillet for small numbers of teeth
    fillet_end = geometry.r_f + _ACTIVE_ROOT * geometry.flexspline.m
    low = np.full_like(theta, max(fillet_end, geometry.flexspline.base_radius))
    high = np.full_like(theta, geometry.r_ag)
    rho_at_tip, _ = flank_point(geometry, high, theta, side, shape)
    rho_at_fillet, _ = flank_point(geometry, low, theta, side, shape)
    # fixed-point iteration: the correction is the distance of the point from the tip circle of the circular spline
    radius = high
    for _ in range(_RADIUS_ROUNDS):
        previous = radius
        rho, _ = flank_point(geometry, radius, theta, side, shape)
        # without a solution on the active flank, the radius is clipped to the end of the flank
        radius = np.clip(radius + geometry.r_ab - rho, low, high)
        if np.max(np.abs(radius - previous)) <= _RADIUS_CONVERGED * geometry.r_ag:
            break
    # a flank entirely beyond the tip circle is active from its fillet
    return np.where(rho_at_fillet >= geometry.r_ab, low, radius), rho_at_tip >= geometry.r_ab


# --- the shape of the rim on the cam

_HARMONICS = 32  # number of harmonics for which the arc length is sampled
# number of harmonics of the arc length in use; the eighth is below 1e-16 of the first for any realistic wave
_HARMONICS_KEPT = 8
_ANGLE_ROUNDS = 50  # largest number of fixed-point iterations; each reduces the error by a factor of W_0/r_m
_ANGLE_CONVERGED = 1e-15  # change per iteration at which an angle has converged [rad]


def nominal_shape(
    theta: Array,
    W_0: float,
    r_m: float,
    curve: _NominalCurve = "linear",
) -> _NominalShape:
    """Return the shape of the rim on the cam at angles theta.

    linear: bending mode n = 2 of a ring, w = W_0 cos 2 theta.
    inextensible: closed curve r_0 + A cos 2 phi with the length of the undeformed mid-line and a displacement of W_0 at
        the major axis; sections keep their arc length and remain normal to the curve.

    Args:
        theta: angles of sections of the undeformed mid-line, from the major axis [rad].
        W_0: radial deflection at the major axis [mm].
        r_m: radius of the undeformed mid-line [mm].
        curve: convention, linear or inextensible.
    """
    if curve == "inextensible":
        return _inextensible_shape(theta, W_0, r_m)
    w = W_0 * np.cos(2 * theta)
    # dv/dtheta = -w: the mid-line of a thin ring bends without stretching, equation (3) with n = 2
    v = -W_0 / 2 * np.sin(2 * theta)
    # chi = (v - dw/dtheta)/r, equation (3)
    chi = (v + 2 * W_0 * np.sin(2 * theta)) / r_m
    return _NominalShape(w, v, chi)


def _inextensible_shape(
    theta: Array,
    W_0: float,
    r_m: float,
) -> _NominalShape:
    """Return the shape of the rim on the inextensible curve at angles theta [rad]."""
    # the curve depends on only two numbers of the drive and is computed once
    curve = _closed_curve(W_0, r_m)
    k = 2 * np.arange(1, _HARMONICS_KEPT + 1)
    phi = np.asarray(theta, dtype=float)
    for _ in range(_ANGLE_ROUNDS):
        # arc length: r_m theta = r_m phi + sum of a_k sin(k phi)
        previous = phi
        phi = theta - np.sin(phi[..., None] * k) @ curve.arc_length / r_m
        if np.max(np.abs(phi - previous), initial=0) < _ANGLE_CONVERGED:
            break
    # r(phi) = r_0 + A cos 2 phi, whose derivative gives the direction of the normal
    radius = curve.mean_radius + curve.wave * np.cos(2 * phi)
    slope = -2 * curve.wave * np.sin(2 * phi)
    return _NominalShape(
        w=radius - r_m,
        v=r_m * (phi - theta),
        chi=-np.arctan2(slope, radius),
    )


@dataclass(frozen=True, eq=False)
class _ClosedCurve:
    """The inextensible curve r_0 + A cos 2 phi."""

    mean_radius: float  # r_0 [mm]
    wave: float  # A [mm]
    arc_length: Array  # amplitudes a_k of the sine series of the arc length, k = 2, 4, ... [mm]


@cache
def _closed_curve(W_0: float, r_m: float) -> _ClosedCurve:
    """Return the inextensible curve for a radial deflection W_0 [mm] and a mid-line radius r_m [mm]."""
    phi = np.pi * np.arange(2 * _HARMONICS) / (2 * _HARMONICS)  # half a revolution, which is the period of the curve
    shrinkage = 0.0  # decrease of the mean radius that gives the curve the length of the mid-line
    for _ in range(_ANGLE_ROUNDS):
        r_0 = r_m - shrinkage
        wave = W_0 + shrinkage
        # ds/dphi [mm], shape (samples,); its mean over half a revolution is the length divided by pi
        speed = np.hypot(r_0 + wave * np.cos(2 * phi), 2 * wave * np.sin(2 * phi))
        excess = float(speed.mean()) - r_m
        # 1 mm of shrinkage reduces the mean length by nearly 1 mm, so the excess is the next step
        shrinkage += excess
        if abs(excess) < _ANGLE_CONVERGED * r_m:
            break
    # ds/dphi is even in phi, so only cosines occur; their integrals are sines with the factor 1/k
    series = np.fft.rfft(speed).real / _HARMONICS
    k = 2 * np.arange(1, _HARMONICS_KEPT + 1)
    return _ClosedCurve(
        mean_radius=r_0,
        wave=wave,
        arc_length=series[1 : _HARMONICS_KEPT + 1] / k,
    )


# --- stations along the face

_PER_UM = 1e3  # um in a mm
# Ratio of the strip widths at the far and the open edge, for many strips. With five strips K1 is accurate to 1 % and
# F'_ior to 5 %. Linearly widening strips (edges at b_w (k/n)^2) give errors of F'_ior of up to 12 %.
_WIDENING = 14.0


@dataclass(frozen=True)
class Face:
    """Stations along the face of every flank, from the open edge of the tooth ring, shape (stations,)."""

    fall: Array  # share of the nominal wave that is missing at the station
    compliance: Array  # compliance of a tooth pair at the station [mm/N]

    @classmethod
    def of(cls, drive: Drive) -> Face:
        """Return the stations of a drive, equation (6a).

        With one station, the flank has contact over the whole face, with the compliance contact.c_t. Several stations
        are strips whose widths grow by a constant factor from the open edge, because teeth have contact over only a few
        millimetres there. A strip has contact at its middle, with the stiffness contact.k_face times its width.
        """
        n = drive.numerics.stations
        shell = drive.flexspline
        # the whole face of the paper's parallel flanks is one contact
        if n == 1:
            return cls(fall=np.zeros(1), compliance=np.array([drive.contact.c_t]))
        # 0 at the open edge and b_w at the far edge; widths grow by the factor _WIDENING^(1/n) from strip to strip
        edges = shell.b_w * (_WIDENING ** (np.arange(n + 1) / n) - 1) / (_WIDENING - 1)
        middle = (edges[1:] + edges[:-1]) / 2
        width = np.diff(edges)
        cam_to_far_end = shell.l - shell.b_w / 2  # W_0 of the cam acts at mid-face
        # a spring of k_face N/(um mm) under each millimetre makes wide strips stiffer
        return cls(fall=middle / cam_to_far_end, compliance=1 / (drive.contact.k_face * _PER_UM * width))


# --- states: positions of wave generator and wheels over the full cycle

# number of adjacent input revolutions in the order of states; the engine processes 4 x 8 states at once, approximately
# a square
STRIP = 4


@dataclass(frozen=True)
class Kinematics:
    """Ratio and full cycle of a drive."""

    z_g: int
    z_b: int
    fixed: str

    @classmethod
    def of(cls, drive: Drive) -> Kinematics:
        """Return the kinematics of a drive."""
        return cls(
            z_g=drive.gears.z_g,
            z_b=drive.gears.z_b,
            fixed=drive.mounting.fixed,
        )

    @property
    def u(self) -> float:
        """Input revolutions per output revolution, negative if they have opposite directions, equation (9).

        u_hg = z_g/(z_g - z_b) if the circular spline is fixed, z_b/(z_b - z_g) if the flexspline is fixed.
        """
        # the sign follows from z_g < z_b: if the circular spline is fixed, output and input turn in opposite directions
        moving_teeth = self.z_g if self.fixed == "rigid" else -self.z_b
        return moving_teeth / (self.z_g - self.z_b)

    @property
    def error_sign(self) -> int:
        """Sign of F_kpp relative to the rotation of the flexspline.

        The computed rotation is that of the flexspline relative to the circular spline; the rotation of the circular
        spline has the opposite sign.
        """
        # F_kpp is the lag of the output behind phi_h/u, equation (9)
        return -1 if self.fixed == "rigid" else 1

    @property
    def teeth_fixed(self) -> int:
        """Number of teeth of the fixed wheel, which is the number of states per input revolution."""
        return self.z_b if self.fixed == "rigid" else self.z_g

    @property
    def cycle_states(self) -> int:
        """Number of states of the full cycle, lcm(z_g, z_b), after which every pair of teeth has met."""
        return lcm(self.z_g, self.z_b)

    @property
    def cycle_cam_revolutions(self) -> int:
        """Input revolutions of the full cycle."""
        return self.cycle_states // self.teeth_fixed


@dataclass(frozen=True)
class States:
    """Positions of a drive [rad], shape (states,): the wave generator, and both wheels in its frame."""

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
        """Angle of the circular spline [rad]."""
        return self.alpha_b + self.phi_h

    def __len__(self) -> int:
        return len(self.index)

    def take(self, rows: NDArray[np.int64]) -> States:
        """Return the selected states.

        rows: indices of the states.
        """
        return States(
            index=self.index[rows], phi_h=self.phi_h[rows], alpha_g=self.alpha_g[rows], alpha_b=self.alpha_b[rows]
        )


def pitch_locked_states(
    kinematics: Kinematics,
    index: NDArray[np.int64] | None = None,
    start: float = 0.0,
) -> States:
    """Return the states j in which the wave generator has advanced by j tooth pitches of the fixed wheel.

    Args:
        kinematics: ratio and cycle of the drive.
        index: numbers j, shape (states,); by default those of the full cycle.
        start: angle of the moving wheel at phi_h = 0 [rad] (phi_g0 if the circular spline is fixed).
    """
    # at these angles the same tooth phase recurs, so only deviations differ between states
    j = np.arange(kinematics.cycle_states) if index is None else np.asarray(index)
    is_rigid_fixed = kinematics.fixed == "rigid"
    start_g = start if is_rigid_fixed else 0.0
    start_b = 0.0 if is_rigid_fixed else start
    return States(
        index=j,
        phi_h=2 * np.pi * j / kinematics.teeth_fixed,
        alpha_g=start_g - 2 * np.pi * j / kinematics.z_g,
        alpha_b=start_b - 2 * np.pi * j / kinematics.z_b,
    )


def neighbours_together(kinematics: Kinematics, states: States) -> NDArray[np.int64]:
    """Return the indices of states, shape (states,), in an order in which consecutive states differ little.

    After one input revolution, the cam is in the same position, and the moving wheel has advanced by two teeth. The
    order therefore runs across STRIP adjacent revolutions, alternately forwards and backwards.
    """
    # step: position within the input revolution; row: revolution within its strip
    revolution, step = np.divmod(states.index, kinematics.teeth_fixed)
    strip, row = np.divmod(revolution, STRIP)
    # every second strip and every second step within a strip run backwards, which avoids jumps at their ends
    step = np.where(strip % 2, -step, step)
    return np.lexsort((np.where(step % 2, -row, row), step, strip))


def ball_phase(drive: Drive, phi_h: Array) -> Array:
    """Return the ball phase beta [ball pitches, 0 <= beta < 1] at input angles phi_h [rad], shape (states,).

    The phase is constant for locked balls. A rolling cage turns by -phi_h r_o/(r_i + r_o) in the frame of the cam. The
    raceway radii of the outer and the inner ring are r_o and r_i.
    """
    # a locked cage keeps its phase in the frame of the cam
    beta = np.full_like(phi_h, drive.bearing.beta)
    if drive.bearing.ball_motion == "rolling" and drive.bearing.d_ball is not None:
        r_o = Geometry.of(drive).r_raceway
        # d_ball = r_o - r_i, so r_i + r_o = 2 r_o - d_ball
        share = r_o / (2 * r_o - drive.bearing.d_ball)
        # a rotation of the cage by one ball pitch is a phase of 1
        beta -= share * phi_h * drive.bearing.N / (2 * np.pi)
    return np.mod(beta, 1.0)
