"""The contact system of a drive: compliance D, geometry of motion G, supports C, gaps without force.

Candidates are in the order flanks, bore nodes, balls. A flank has one candidate for each station along its face, in
consecutive rows. All stations of a flank load the structure at one place; they differ in their gap and in their own
compliance. A force opens its own gap: delta = delta_p + D F + G a. Freedoms a: circular spline x, y; flexspline x, y,
rotation; outer ring x, y; cam x, y. Equilibrium is the transpose, as virtual work demands: G' F - C a + b = 0. Units
mm, N, rad.

Places on the rim and on the outer ring of the bearing deflect in the plane of the ring: thin rings bend without
stretching, mode by mode, and stretch uniformly (n = 0). Mode n = 1 is rigid motion and belongs to the displacements of
the bodies.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.model.geometry import Array, Face, Flanks, Geometry, flank_candidates, nominal_shape
from hdassist.drive.preset.fields import Drive

FREEDOMS = (
    "circular spline x",
    "circular spline y",
    "flexspline x",
    "flexspline y",
    "flexspline rotation",
    "outer ring x",
    "outer ring y",
    "cam x",
    "cam y",
)
# columns of G by body
_RIGID = slice(0, 2)
_FLEX = slice(2, 4)
# the rotation of the flexspline is the only freedom loaded by the torque
ROTATION = 4
_RING = slice(5, 7)
CAM = slice(7, 9)
# Orders of tooth deviations beyond the first. Beyond the fourth only even orders are included, because odd ones nearly
# cancel on two opposite zones. The mesh averages higher orders: two thirds of a micrometre's effect remain at order 16,
# half at order 20, a fifth at order 32.
TOOTH_ORDERS = (2, 3, 4, 6, 8, 10, 12, 14, 16)
TO_X1 = np.pi / 2  # converts angles from the major axis to angles from x1, the minor axis: theta_x1 = theta + pi/2


@dataclass(frozen=True)
class StateGaps:
    """Changes of the gaps of states due to the deviations of a drive.

    scalars: deviations [mm], shape (states, scalars), in the order of the columns of the deviation map; trailing
        columns that are 0 may be omitted.
    at_flanks: changes due to measured teeth [mm], shape (states, flank candidates), equal at all stations of a flank;
        None without measured teeth.
    """

    scalars: Array
    at_flanks: Array | None = None

    def __len__(self) -> int:
        return len(self.scalars)

    # blocks of states for worker processes and for the walk
    def __getitem__(self, rows: slice | NDArray[np.int64]) -> StateGaps:
        return StateGaps(self.scalars[rows], None if self.at_flanks is None else self.at_flanks[rows])


WITHOUT_DEVIATIONS = StateGaps(np.zeros((1, 0)))  # one state


@dataclass(frozen=True)
class ContactSystem:
    """System (1) of a drive at one tooth phase and one ball phase: M candidates at m places, 9 freedoms.

    A flank is one place, and each of its stations is a candidate with its own row of `flanks`.
    """

    geometry: Geometry
    flanks: Flanks
    ball_theta: Array  # angles of the balls [rad], shape (balls,)
    compliance: Array  # compliance of the structure between the places [mm/N], shape (m, m)
    local: Array  # local compliance of each candidate [mm/N], shape (M,)
    G: Array  # shape (M, 9), equal rows for all candidates at a place; the rotation column is in mm
    C: Array  # stiffness of the supports [N/mm], shape (9,); 0 for a freedom without support
    delta_p: Array  # gaps of a drive without deviations [mm], shape (M,)
    face: Face

    @property
    def n_flanks(self) -> int:
        """Number of flank candidates, which come first."""
        return len(self.flanks.theta)

    @property
    def pairs(self) -> int:
        """Number of flanks, without regard to their stations; their places come first."""
        # all flanks have the same number of stations
        return self.n_flanks // len(self.face.fall)

    @cached_property
    def place(self) -> NDArray[np.int64]:
        """Place of each candidate among all places, shape (M,)."""
        # the stations of a flank are contiguous, so integer division gives the flank index
        flanks = np.arange(self.n_flanks) // len(self.face.fall)
        return np.append(flanks, self.pairs + np.arange(len(self.delta_p) - self.n_flanks))

    @cached_property
    def first(self) -> NDArray[np.int64]:
        """First candidate at each place, shape (m,)."""
        return np.searchsorted(self.place, np.arange(len(self.compliance)))

    def at_places(self, forces: Array) -> Array:
        """Return the force at each place [N], shape (states, m), from forces of candidates [N], shape (states, M)."""
        return np.asarray(
            np.add.reduceat(
                forces,
                self.first,
                axis=1,
            )
        )

    @property
    def balls(self) -> slice:
        """Rows of the balls, which come last."""
        return slice(len(self.delta_p) - len(self.ball_theta), len(self.delta_p))

    @property
    def supported(self) -> NDArray[np.bool_]:
        """Whether each freedom has a support, shape (9,)."""
        return self.C > 0

    @property
    def free_rotation(self) -> int:
        """Index of the flexspline's rotation among the freedoms without support."""
        return int(np.count_nonzero(~self.supported[:ROTATION]))

    @cached_property
    def lever(self) -> Array:
        """Moment on the flexspline per unit force at each flank, by zone [mm], shape (flanks, 2)."""
        first_station = self.first[: self.pairs, None]
        # one moment per zone, because the zones' shares of the torque distinguish single-zone meshing
        is_in_zone = self.flanks.zone[first_station] == (0, 1)
        # G contains the direction of the force on the flexspline with the opposite sign
        return np.where(is_in_zone, -self.G[first_station, ROTATION], 0.0)

    @cached_property
    def deviation_map(self) -> Array:
        """Change of the gaps per unit of each deviation scalar (deviations.py), equal at a place, shape (M, 24)."""
        flanks = self.flanks
        # columns: first harmonics (2), cam offset (2), shift of the teeth (2), then two for each of TOOTH_ORDERS
        x1 = self.flanks.theta + TO_X1
        # component of a tangential deviation along the contact normal, which closes a flank towards +theta
        along = flanks.side * np.cos(flanks.alpha)
        n = self.n_flanks
        change = np.zeros((len(self.delta_p), 6 + 2 * len(TOOTH_ORDERS)))
        # sine first, then cosine, because equation (7) has (sin, cos) of theta_x1
        change[:n, :2] = -along[:, None] * _radial(x1)[:, ::-1]
        for column, order in enumerate(TOOTH_ORDERS, 3):
            change[:n, 2 * column : 2 * column + 2] = -along[:, None] * _radial(order * x1)[:, ::-1]
        # the eccentricity of the cam moves its raceway towards the balls, in the direction of each ball
        change[self.balls, 2:4] = -_radial(self.ball_theta + TO_X1)
        # equation (8b): a shift of the teeth changes a gap by its component along the normal
        change[:n, 4:6] = _normal(flanks) @ np.array([[0.0, 1.0], [-1.0, 0.0]])  # x1 points along -y, y1 along x
        return change

    def delta_p_of(self, gaps: StateGaps) -> Array:
        """Return the gaps without force delta_p [mm] of states, shape (states, M)."""
        # the most common case in self errors and stiffness needs only a view
        if not gaps.scalars.shape[1] and gaps.at_flanks is None:
            return np.broadcast_to(self.delta_p, (len(gaps), len(self.delta_p)))
        # the gaps are linear in the deviations, so one product gives them
        delta_p = self.delta_p + gaps.scalars @ self.deviation_map[:, : gaps.scalars.shape[1]].T
        if gaps.at_flanks is not None:
            delta_p[:, : self.n_flanks] += gaps.at_flanks
        return np.asarray(delta_p)


def contact_system(
    drive: Drive,
    tau: float = 0.0,
    beta: float | None = None,
) -> ContactSystem:
    """Return the contact system of a drive.

    Args:
        drive: drive with the geometry, stiffnesses and supports.
        tau: tooth phase [tooth pitches].
        beta: ball phase [ball pitches]; by default that of the preset.

    Raises UntrustedError if no teeth overlap.
    """
    return ContactSystems(drive).at(tau, drive.bearing.beta if beta is None else beta)


@dataclass(frozen=True)
class _Part:
    """The candidates of one kind: flanks, bore nodes or balls."""

    G: Array  # shape (n, 9)
    delta_p: Array  # gaps without force [mm], shape (n,)
    local: Array  # local compliance of each candidate [mm/N], shape (n,)


@dataclass(frozen=True)
class _ToothPhase:
    """Arrays that depend only on the tooth phase."""

    flanks: Flanks
    compliance: Array  # compliance of the flexspline between flanks and bore nodes [mm/N]
    part: _Part


@dataclass(frozen=True)
class _BallPhase:
    """Arrays that depend only on the ball phase."""

    theta: Array  # angles of the balls [rad]
    compliance: Array  # compliance of the outer ring between bore nodes and balls [mm/N]
    part: _Part


class ContactSystems:
    """Contact systems of a drive at many phases; parts that depend on one phase only are computed once per phase."""

    def __init__(self, drive: Drive) -> None:
        # arrays are grouped by dependence: on the drive, on the tooth phase, on the ball phase
        self._drive = drive
        self._geometry = Geometry.of(drive)
        self._face = Face.of(drive)
        nodes = drive.numerics.n_2
        self._bore = 2 * np.pi * np.arange(nodes) / nodes  # angles of the bore nodes [rad]
        # the bore of the flexspline contacts the outer ring at evenly spaced nodes without a gap
        self._nodes = _Part(
            G=_between(_FLEX, _RING, self._bore), delta_p=np.zeros(nodes), local=np.full(nodes, drive.contact.c_bore)
        )
        self._supports = _support_stiffness(drive)
        self._tooth_phase: dict[float, _ToothPhase] = {}  # only the last one, because its arrays are large
        self._ball_phases: dict[float, _BallPhase] = {}

    def at(self, tau: float, beta: float) -> ContactSystem:
        """Return the system at tooth phase tau [tooth pitches] and ball phase beta [ball pitches].

        Raises UntrustedError if no teeth overlap.
        """
        # callers visit all ball phases at one tooth phase before the next tooth phase
        if tau not in self._tooth_phase:
            self._tooth_phase = {tau: self._new_tooth_phase(tau)}
        if beta not in self._ball_phases:
            self._ball_phases[beta] = self._new_ball_phase(beta)
        teeth = self._tooth_phase[tau]
        balls = self._ball_phases[beta]
        # the candidates are in the order flanks, bore nodes, balls
        parts = (teeth.part, self._nodes, balls.part)
        return ContactSystem(
            geometry=self._geometry,
            flanks=teeth.flanks,
            ball_theta=balls.theta,
            compliance=self._structure_compliance(teeth, balls),
            local=np.concatenate([part.local for part in parts]),
            G=np.concatenate([part.G for part in parts]),
            C=self._supports.copy(),
            delta_p=np.concatenate([part.delta_p for part in parts]),
            face=self._face,
        )

    def _new_tooth_phase(self, tau: float) -> _ToothPhase:
        # one entry per flank, whose stations are copies with the same geometry
        pairs = flank_candidates(self._geometry, tau)
        flanks = pairs.repeated(len(self._face.fall))
        return _ToothPhase(
            flanks=flanks,
            compliance=_flexspline_compliance(self._drive, self._geometry, pairs, self._bore),
            part=_flank_part(self._geometry, flanks, self._face),
        )

    def _new_ball_phase(self, beta: float) -> _BallPhase:
        drive = self._drive
        # the cage keeps the balls evenly spaced
        theta = 2 * np.pi * (np.arange(drive.bearing.N) + beta) / drive.bearing.N
        ring = outer_ring(drive, self._geometry)
        part = _Part(
            G=_between(_RING, CAM, theta),
            # g_b [um] is the radial clearance; the oval cam pushes the balls outwards by W_0 cos 2 theta
            delta_p=drive.bearing.g_b * 1e-3 - self._geometry.W_0 * np.cos(2 * theta),
            local=np.full(len(theta), drive.contact.c_ball),
        )
        # the flexspline pushes the outer ring inwards at the nodes, and balls push it outwards
        compliance = _compliance_of(ring, np.vstack([-ring.radial(self._bore), ring.radial(theta)]))
        return _BallPhase(
            theta=theta,
            compliance=compliance,
            part=part,
        )

    def _structure_compliance(self, teeth: _ToothPhase, balls: _BallPhase) -> Array:
        """Return the compliance between all places [mm/N], shape (m, m), in the order flanks, bore nodes, balls."""
        of_flexspline = len(teeth.compliance)  # number of flanks and bore nodes
        places = of_flexspline + len(balls.theta)
        first_node = of_flexspline - len(self._bore)
        D = np.zeros((places, places))
        # equation (1): D is the compliance of all bodies between all places; the bodies share the bore nodes
        D[:of_flexspline, :of_flexspline] = teeth.compliance
        D[first_node:, first_node:] += balls.compliance  # both bodies deflect at the bore nodes
        return D


def _support_stiffness(drive: Drive) -> Array:
    """Return the stiffness of the support of each freedom [N/mm], shape (9,)."""
    C = np.zeros(len(FREEDOMS))
    # x and y of a body have equal stiffness; the outer ring and the rotation of the flexspline have no support
    C[_RIGID] = drive.supports.C_1
    C[_FLEX] = drive.supports.C_2
    C[CAM] = drive.number("supports.C_3")
    return C


def _flexspline_compliance(
    drive: Drive,
    geometry: Geometry,
    flanks: Flanks,
    bore: Array,
) -> Array:
    """Return the compliance of the flexspline between flanks and bore nodes [mm/N], shape (places, places)."""
    flexspline = flexspline_ring(drive, geometry)
    # components of the outward normal of the tooth: the normal leans towards +theta or -theta by the side of the flank,
    # and outwards by its pressure angle
    normal_tangential = flanks.side * np.cos(flanks.alpha)
    normal_radial = np.sin(flanks.alpha)
    # displacement of each flank along its normal per unit of each mode, shape (flanks, modes)
    along_normal = normal_tangential[:, None] * flexspline.tangential(flanks.theta, flanks.h_c)
    along_normal += normal_radial[:, None] * flexspline.radial(flanks.theta)
    # the circular spline pushes the tooth inwards, the outer ring pushes the bore outwards
    return _compliance_of(flexspline, np.vstack([-along_normal, flexspline.radial(bore)]))


def _compliance_of(ring: Ring, loads: Array) -> Array:
    """Return the compliance of a ring between places [mm/N], shape (places, places).

    Args:
        ring: ring with its modes and their stiffness.
        loads: load of each mode per unit force at each place, shape (places, modes).
    """
    # D = loads diag(1/K_n) loads', computed with the square root on both sides
    by_mode = loads * np.sqrt(ring.compliance)
    # the product of a matrix with its own transpose is symmetric to the last digit
    return np.asarray(by_mode @ by_mode.T)


def _between(
    inner: slice,
    outer: slice,
    theta: Array,
) -> Array:
    """Return the rows of G of radial contacts between two bodies at angles theta [rad].

    Args:
        inner: columns of the freedoms of the inner body.
        outer: columns of the freedoms of the outer body.
        theta: angles of the contacts, shape (contacts,).
    """
    G = np.zeros((len(theta), len(FREEDOMS)))
    # an outward displacement closes the contact if the inner body moves, and opens it if the outer body moves
    G[:, inner] = _radial(theta)
    G[:, outer] = -_radial(theta)
    return G


def _flank_part(
    geometry: Geometry,
    flanks: Flanks,
    face: Face,
) -> _Part:
    """Return the candidates of flanks, one row per station, equation (6a)."""
    s_cos = flanks.side * np.cos(flanks.alpha)
    pairs = len(flanks.theta) // len(face.fall)
    G = np.zeros((len(flanks.theta), len(FREEDOMS)))
    # the flexspline pushes the circular spline outwards along the normal, and the reaction acts on the flexspline
    G[:, _RIGID] = _normal(flanks)
    G[:, _FLEX] = -_normal(flanks)
    # the lever is r_m + h_c and not rho, because the flexspline slides through a stationary shape
    G[:, ROTATION] = -s_cos * (geometry.r_m + flanks.h_c)
    # the linear shape is correct for every convention of the gap, because the ring is linear
    w, v, chi = nominal_shape(flanks.theta, geometry.W_0, geometry.r_m)
    # The nominal gap was computed on the nominal shape, which is itself an elastic displacement of the rim, so the
    # closing by this displacement is added back: the closing along the normal at the height of the contact.
    closing = s_cos * (v + flanks.h_c * chi) + np.sin(flanks.alpha) * w
    # The gap was computed at the open edge. Behind the edge the rim is farther away by the decrease of the wave.
    delta_p = flanks.gap + geometry.j_n + closing * (1 + np.tile(face.fall, pairs))
    return _Part(
        G=G,
        delta_p=delta_p,
        local=np.tile(face.compliance, pairs),
    )


def _normal(flanks: Flanks) -> Array:
    """Return the contact normals, outward from the flexspline's teeth, shape (flanks, 2); x is the major axis."""
    # tangential unit vector at theta
    along = np.stack([-np.sin(flanks.theta), np.cos(flanks.theta)], axis=1)
    s_cos = flanks.side * np.cos(flanks.alpha)
    sin = np.sin(flanks.alpha)
    return np.asarray(s_cos[:, None] * along + sin[:, None] * _radial(flanks.theta))


def _radial(theta: Array) -> Array:
    """Return radial unit vectors at angles theta [rad], shape (points, 2)."""
    return np.stack([np.cos(theta), np.sin(theta)], axis=1)


# --- rings

_EDGE_ZONE = 2 * 1.285  # sqrt(r h) divided by the length over which the edge of a shell stiffens the hoop (nu = 0.3)


@dataclass(frozen=True)
class Ring:
    """An elastic ring with modes n = 0, 2, ..., n_max."""

    radius: float  # radius of the mid-line [mm]
    order: NDArray[np.int64]  # n of each mode
    stiffness: Array  # K_n [N/mm]

    @property
    def compliance(self) -> Array:
        """Compliance 1/K_n [mm/N] of the modes: n = 0, cos of n = 2..n_max, sin of n = 2..n_max."""
        # cos and sin modes of one order have the same stiffness
        bending = 1 / self.stiffness[1:]
        return np.concatenate([1 / self.stiffness[:1], bending, bending])

    def radial(self, theta: Array) -> Array:
        """Return the radial displacement w per unit of each mode, equation (3), shape (points, modes).

        Args:
            theta: angles of the points [rad], shape (points,).
        """
        # shape (points, n_max - 1)
        angle = np.outer(theta, self.order[1:])
        return np.hstack([np.ones((len(theta), 1)), np.cos(angle), np.sin(angle)])

    def tangential(self, theta: Array, height: Array | float) -> Array:
        """Return the tangential displacement v + h chi per unit of each mode, equation (3), shape (points, modes).

        Args:
            theta: angles of the points [rad], shape (points,).
            height: height h of the points above the mid-line [mm].
        """
        n = self.order[1:]
        angle = np.outer(theta, n)
        # v = (-A sin + B cos)/n and chi = (v - dw/dtheta)/r give one factor for both
        arm = np.broadcast_to(height, np.shape(theta))[:, None] / self.radius
        factor = 1 / n - arm * (n - 1 / n)
        return np.hstack([np.zeros((len(theta), 1)), -factor * np.sin(angle), factor * np.cos(angle)])


def plain_ring(
    E: float,
    area: float,
    inertia: float,
    radius: float,
    n_max: int,
) -> Ring:
    """Return a ring of constant section, equation (4).

    Args:
        E: Young's modulus [MPa].
        area: area of the section [mm2].
        inertia: second moment of area for in-plane bending [mm4].
        radius: radius of the mid-line [mm].
        n_max: highest mode.
    """
    # n = 1 is the rigid-body motion of the ring, which is a freedom of the system
    n = np.concatenate([[0], np.arange(2, n_max + 1)])
    stiffness = np.pi * E * inertia * (n**2 - 1.0) ** 2 / radius**3
    # n = 0 stretches the hoop instead of bending it
    stiffness[0] = 2 * np.pi * E * area / radius
    return Ring(
        radius=radius,
        order=n,
        stiffness=stiffness,
    )


def outer_ring(drive: Drive, geometry: Geometry) -> Ring:
    """Return the outer ring of the flexible bearing, with the rectangular section ring_b x ring_h."""
    b = drive.bearing.ring_b
    h = drive.bearing.ring_h
    return plain_ring(drive.material.E, b * h, b * h**3 / 12, geometry.r_ring, drive.numerics.n_max)


def flexspline_ring(drive: Drive, geometry: Geometry) -> Ring:
    """Return the toothed rim of the flexspline with the shell behind it, equation (5).

    The displacement of the shell is linear along its axis, and its far edge is free to warp axially. The shell adds the
    bending stiffness D L/3 and the twist stiffness 2 pi D (1 - nu) (n^2 - 1)^2/(n^2 r_m L). Only its edge zone stiffens
    the hoop.
    """
    E = drive.material.E
    nu = drive.material.nu
    r = geometry.r_m
    rim = drive.flexspline
    # length of the shell behind the toothed rim
    length = drive.flexspline.l - drive.flexspline.b_w
    # plate stiffness of the shell per length [N mm]
    D = E * rim.h_3**3 / (12 * (1 - nu**2))
    # k_t is the factor by which teeth increase the bending stiffness of the rim
    inertia = rim.k_t * rim.b_w * rim.h_1**3 / 12 + D * length / 3 / E
    # the hoop includes the rim, but only the edge zone of the shell
    area = rim.b_w * rim.h_1 + rim.h_3 * float(np.sqrt(r * rim.h_3)) / _EDGE_ZONE
    ring = plain_ring(E, area, inertia, r, drive.numerics.n_max)
    n = ring.order[1:]
    # second part of equation (5): the shell twists in the bending modes, with n^2 in the denominator
    twist = 2 * np.pi * D * (1 - nu) * (n**2 - 1.0) ** 2 / (n**2 * r * length)
    return Ring(
        radius=r,
        order=ring.order,
        stiffness=ring.stiffness + np.concatenate([[0.0], twist]),
    )


def shell_twist_stiffness(drive: Drive, geometry: Geometry) -> float:
    """Return the torsional stiffness [N*mm/rad] of the shell as a thin tube of length l, 2 pi G r_m^3 h_3/l."""
    # shear modulus [MPa]
    G = drive.material.E / (2 * (1 + drive.material.nu))
    return 2 * np.pi * G * geometry.r_m**3 * drive.flexspline.h_3 / drive.flexspline.l
