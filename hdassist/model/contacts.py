"""The contact system of a drive: compliance D, geometry of motion G, supports C, gaps without force.

Candidates stand in the order flanks, bore nodes, balls; a flank has one for each station along its face, the stations
one after the other. All stations of a flank load the structure at one place: they differ in their gap and in how they
yield themselves. A force opens its own gap: delta = delta_p + D F + G a. Freedoms a: rigid wheel x, y; flexspline x,
y, rotation; outer ring x, y; cam x, y. Equilibrium is the transpose, as virtual work demands: G' F - C a + b = 0.
Units mm, N, rad.

Places on the rim and on the bearing's outer ring yield in its plane: thin rings bend without stretching, mode by mode,
and stretch uniformly (n = 0). Mode n = 1 is rigid motion and belongs to the displacements of the bodies.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hdassist.model.geometry import Array, Face, Flanks, Geometry, flank_candidates, nominal_shape
from hdassist.preset.fields import Drive

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
_RIGID = slice(0, 2)
_FLEX = slice(2, 4)
ROTATION = 4
_RING = slice(5, 7)
CAM = slice(7, 9)
# of the teeth's deviations beyond the first, of which only even ones go on: odd ones nearly cancel on two opposite
# zones. The mesh averages what is beyond the last one: of a micrometre's effect two thirds are left of order 16, half
# of 20, a fifth of 32
TOOTH_ORDERS = (2, 3, 4, 6, 8, 10, 12, 14, 16)
TO_X1 = np.pi / 2  # directions of deviations count from x1, the minor axis: theta_x1 = theta + pi/2


@dataclass(frozen=True)
class StateGaps:
    """Gaps without force of states beyond those of a drive without deviations.

    scalars [mm], shape (states, scalars), of the deviations, in the order of the columns of the deviation map, of which
    the last may be left out where they are 0; at_flanks [mm], shape (states, flank candidates), of measured teeth, the
    same at all stations of a flank, None without.
    """

    scalars: Array
    at_flanks: Array | None = None

    def __len__(self) -> int:
        return len(self.scalars)

    def __getitem__(self, rows: slice | NDArray[np.int64]) -> StateGaps:
        return StateGaps(self.scalars[rows], None if self.at_flanks is None else self.at_flanks[rows])


WITHOUT_DEVIATIONS = StateGaps(np.zeros((1, 0)))  # one state


@dataclass(frozen=True)
class ContactSystem:
    """System (1) of a drive at one tooth phase and one ball phase: M candidates at m places, 9 freedoms.

    compliance of the structure between the places, shape (m, m), and local, that of each candidate by itself, shape
    (M,) [mm/N]; G, shape (M, 9), its rotation column in mm, the same for all candidates at a place; C [N/mm], shape
    (9,), 0 where a freedom has no support; delta_p [mm], shape (M,), the gaps of a drive without deviations; face, the
    stations along each flank, which are rows of flanks of their own.
    """

    geometry: Geometry
    flanks: Flanks
    ball_theta: Array
    compliance: Array
    local: Array
    G: Array
    C: Array
    delta_p: Array
    face: Face

    @property
    def n_flanks(self) -> int:
        """Number of flank candidates, which come first."""
        return len(self.flanks.theta)

    @property
    def pairs(self) -> int:
        """Number of flanks whatever their stations: their places come first."""
        return self.n_flanks // len(self.face.fall)

    @cached_property
    def place(self) -> NDArray[np.int64]:
        """Place of each candidate among all places, shape (M,)."""
        flanks = np.arange(self.n_flanks) // len(self.face.fall)
        return np.append(flanks, self.pairs + np.arange(len(self.delta_p) - self.n_flanks))

    @cached_property
    def first(self) -> NDArray[np.int64]:
        """First candidate at each place, shape (m,)."""
        return np.searchsorted(self.place, np.arange(len(self.compliance)))

    def at_places(self, forces: Array) -> Array:
        """Force at each place [N], all its candidates together, shape (states, m), of forces, shape (states, M)."""
        return np.asarray(np.add.reduceat(forces, self.first, axis=1))

    @property
    def balls(self) -> slice:
        """Rows of the balls, which come last."""
        return slice(len(self.delta_p) - len(self.ball_theta), len(self.delta_p))

    @property
    def supported(self) -> NDArray[np.bool_]:
        """Which of the freedoms have a support, shape (9,)."""
        return self.C > 0

    @property
    def free_rotation(self) -> int:
        """Place of the flexspline's rotation among the freedoms without support."""
        return int(np.count_nonzero(~self.supported[:ROTATION]))

    @cached_property
    def lever(self) -> Array:
        """Moment [N*mm] that a unit of force at each flank takes off the flexspline in each zone, shape (flanks, 2)."""
        flanks = self.first[: self.pairs, None]
        return np.where(self.flanks.zone[flanks] == (0, 1), -self.G[flanks, ROTATION], 0.0)

    @cached_property
    def deviation_map(self) -> Array:
        """Change of the gaps by a unit of each deviation scalar (deviations.py), the same at a place, shape (M, 24)."""
        flanks = self.flanks
        x1 = self.flanks.theta + TO_X1
        along = flanks.side * np.cos(flanks.alpha)
        n = self.n_flanks
        change = np.zeros((len(self.delta_p), 6 + 2 * len(TOOTH_ORDERS)))
        change[:n, :2] = -along[:, None] * _radial(x1)[:, ::-1]
        for column, order in enumerate(TOOTH_ORDERS, 3):
            change[:n, 2 * column : 2 * column + 2] = -along[:, None] * _radial(order * x1)[:, ::-1]
        change[self.balls, 2:4] = -_radial(self.ball_theta + TO_X1)
        change[:n, 4:6] = _normal(flanks) @ np.array([[0.0, 1.0], [-1.0, 0.0]])  # x1 points along -y, y1 along x
        return change

    def delta_p_of(self, gaps: StateGaps) -> Array:
        """Gaps without force delta_p [mm] of states, shape (states, M)."""
        if not gaps.scalars.shape[1] and gaps.at_flanks is None:
            return np.broadcast_to(self.delta_p, (len(gaps), len(self.delta_p)))
        delta_p = self.delta_p + gaps.scalars @ self.deviation_map[:, : gaps.scalars.shape[1]].T
        if gaps.at_flanks is not None:
            delta_p[:, : self.n_flanks] += gaps.at_flanks
        return np.asarray(delta_p)


def contact_system(drive: Drive, tau: float = 0.0, beta: float | None = None) -> ContactSystem:
    """Contact system of a drive at tooth phase tau [tooth pitches] and ball phase beta [ball pitches].

    Without beta, that of the preset. Raises UntrustedError where no teeth overlap.
    """
    return ContactSystems(drive).at(tau, drive.bearing.beta if beta is None else beta)


@dataclass(frozen=True)
class _Part:
    """One kind of contact by itself: G, shape (n, 9), delta_p [mm] and local [mm/N], shape (n,)."""

    G: Array
    delta_p: Array
    local: Array


class ContactSystems:
    """Contact systems of a drive at many phases: a part that depends on one phase alone is made once for each."""

    def __init__(self, drive: Drive) -> None:
        self._drive = drive
        self._geometry = Geometry.of(drive)
        self._face = Face.of(drive)
        self._bore = 2 * np.pi * np.arange(drive.numerics.n_2) / drive.numerics.n_2
        n = len(self._bore)
        self._nodes = _Part(_between(_FLEX, _RING, self._bore), np.zeros(n), np.full(n, drive.contact.c_bore))
        self._flexspline: dict[float, tuple[Flanks, Array, _Part]] = {}
        self._ring: dict[float, tuple[Array, Array, _Part]] = {}

    def at(self, tau: float, beta: float) -> ContactSystem:
        """System at tooth phase tau [tooth pitches] and ball phase beta [ball pitches].

        Raises UntrustedError where no teeth overlap.
        """
        drive = self._drive
        geometry = self._geometry
        bore = self._bore
        if tau not in self._flexspline:
            pairs = flank_candidates(geometry, tau)
            flanks = pairs.repeated(len(self._face.fall))
            compliance = _flexspline_compliance(drive, geometry, pairs, bore)
            self._flexspline = {tau: (flanks, compliance, _flank_part(geometry, flanks, self._face))}  # the last one
        if beta not in self._ring:
            balls = 2 * np.pi * (np.arange(drive.bearing.N) + beta) / drive.bearing.N
            gaps = drive.bearing.g_b * 1e-3 - geometry.W_0 * np.cos(2 * balls)
            part = _Part(_between(_RING, CAM, balls), gaps, np.full(len(balls), drive.contact.c_ball))
            ring = outer_ring(drive, geometry)
            compliance = _compliance_of(ring, np.vstack([-ring.radial(bore), ring.radial(balls)]))
            self._ring[beta] = balls, compliance, part
        flanks, flexspline, at_flanks = self._flexspline[tau]
        balls, of_ring, at_balls = self._ring[beta]
        inside = len(flexspline) - len(bore)
        D = np.zeros((len(flexspline) + len(balls),) * 2)
        D[: len(flexspline), : len(flexspline)] = flexspline
        D[inside:, inside:] += of_ring  # both see the bore
        parts = (at_flanks, self._nodes, at_balls)
        supports = np.zeros(len(FREEDOMS))
        supports[_RIGID] = drive.supports.C_1
        supports[_FLEX] = drive.supports.C_2
        supports[CAM] = drive.number("supports.C_3")
        return ContactSystem(
            geometry=geometry,
            flanks=flanks,
            ball_theta=balls,
            compliance=D,
            local=np.concatenate([part.local for part in parts]),
            G=np.concatenate([part.G for part in parts]),
            C=supports,
            delta_p=np.concatenate([part.delta_p for part in parts]),
            face=self._face,
        )


def _flexspline_compliance(drive: Drive, geometry: Geometry, flanks: Flanks, bore: Array) -> Array:
    """Compliance of the flexspline between flanks and bore."""
    flexspline = flexspline_ring(drive, geometry)
    push = flanks.side * np.cos(flanks.alpha), np.sin(flanks.alpha)  # outward normal of the tooth
    at_flank = push[0][:, None] * flexspline.tangential(flanks.theta, flanks.h_c)
    at_flank += push[1][:, None] * flexspline.radial(flanks.theta)
    # the rigid wheel pushes the tooth inwards, the outer ring pushes the bore outwards, and so on
    return _compliance_of(flexspline, np.vstack([-at_flank, flexspline.radial(bore)]))


def _compliance_of(ring: Ring, loads: Array) -> Array:
    """Compliance [mm/N] of a ring between places that load its modes, shape (places, modes)."""
    by_mode = loads * np.sqrt(ring.compliance)
    return np.asarray(by_mode @ by_mode.T)  # symmetric to the last digit


def _between(inner: slice, outer: slice, theta: Array) -> Array:
    """Rows of G of radial contacts at angles theta [rad], which two bodies that move by these freedoms close."""
    G = np.zeros((len(theta), len(FREEDOMS)))
    G[:, inner] = _radial(theta)
    G[:, outer] = -_radial(theta)
    return G


def _flank_part(geometry: Geometry, flanks: Flanks, face: Face) -> _Part:
    s_cos = flanks.side * np.cos(flanks.alpha)
    pairs = len(flanks.theta) // len(face.fall)
    G = np.zeros((len(flanks.theta), len(FREEDOMS)))
    G[:, _RIGID] = _normal(flanks)
    G[:, _FLEX] = -_normal(flanks)
    # r_m + h_c, not rho: the flexspline slides through a held shape
    G[:, ROTATION] = -s_cos * (geometry.r_m + flanks.h_c)
    w, v, chi = nominal_shape(flanks.theta, geometry.W_0, geometry.r_m)
    # the nominal gap was drawn on the nominal shape, which is a displacement of the elastic rim
    shape = s_cos * (v + flanks.h_c * chi) + np.sin(flanks.alpha) * w
    # it was drawn at the open edge; beyond it the rim stands back by as much as the wave has fallen
    gaps = flanks.gap + geometry.j_n + shape * (1 + np.tile(face.fall, pairs))
    return _Part(G, gaps, np.tile(face.compliance, pairs))


def _normal(flanks: Flanks) -> Array:
    """Normals at the contacts, outward from the flexspline's teeth, shape (flanks, 2), x along the major axis."""
    along = np.stack([-np.sin(flanks.theta), np.cos(flanks.theta)], axis=1)
    s_cos = flanks.side * np.cos(flanks.alpha)
    sin = np.sin(flanks.alpha)
    return np.asarray(s_cos[:, None] * along + sin[:, None] * _radial(flanks.theta))


def _radial(theta: Array) -> Array:
    return np.stack([np.cos(theta), np.sin(theta)], axis=1)


# --- rings

_EDGE_ZONE = 2 * 1.285  # the edge of a shell stiffens the hoop over sqrt(r h)/_EDGE_ZONE (nu = 0.3)


@dataclass(frozen=True)
class Ring:
    """A ring: mid-line radius [mm], and stiffness K_n [N/mm] of its modes n = 0, 2, ..., n_max."""

    radius: float
    order: NDArray[np.int64]
    stiffness: Array

    @property
    def compliance(self) -> Array:
        """Compliance 1/K_n [mm/N] of the modes: n = 0, cos of n = 2..n_max, sin of n = 2..n_max."""
        bending = 1 / self.stiffness[1:]
        return np.concatenate([1 / self.stiffness[:1], bending, bending])

    def radial(self, theta: Array) -> Array:
        """Radial displacement w at angles theta [rad] for a unit of each mode, shape (points, modes)."""
        angle = np.outer(theta, self.order[1:])
        return np.hstack([np.ones((len(theta), 1)), np.cos(angle), np.sin(angle)])

    def tangential(self, theta: Array, height: Array | float) -> Array:
        """Tangential displacement v + h chi at angles theta [rad] for a unit of each mode, shape (points, modes).

        Arguments: height, h [mm] of the points above the mid-line.
        """
        n = self.order[1:]
        angle = np.outer(theta, n)
        # v = (-A sin + B cos)/n and chi = (v - dw/dtheta)/r give one factor for both
        arm = np.broadcast_to(height, np.shape(theta))[:, None] / self.radius
        factor = 1 / n - arm * (n - 1 / n)
        return np.hstack([np.zeros((len(theta), 1)), -factor * np.sin(angle), factor * np.cos(angle)])


def plain_ring(E: float, area: float, inertia: float, radius: float, n_max: int) -> Ring:
    """A ring of constant section: E [MPa], area [mm2], second moment [mm4], mid-line radius [mm]."""
    n = np.concatenate([[0], np.arange(2, n_max + 1)])
    stiffness = np.pi * E * inertia * (n**2 - 1.0) ** 2 / radius**3
    stiffness[0] = 2 * np.pi * E * area / radius
    return Ring(radius, n, stiffness)


def outer_ring(drive: Drive, geometry: Geometry) -> Ring:
    """The outer ring of the flexible bearing: a rectangle ring_b x ring_h."""
    b = drive.bearing.ring_b
    h = drive.bearing.ring_h
    return plain_ring(drive.material.E, b * h, b * h**3 / 12, geometry.r_ring, drive.numerics.n_max)


def flexspline_ring(drive: Drive, geometry: Geometry) -> Ring:
    """The toothed rim of the flexspline and the shell behind it.

    The shell's displacement is linear along its axis, its far edge free to warp axially: it adds bending
    D L/3 and twist 2 pi D (1 - nu) (n^2 - 1)^2/(n^2 r_m L). Only its edge zone helps the hoop.
    """
    E = drive.material.E
    nu = drive.material.nu
    r = geometry.r_m
    rim = drive.flexspline
    length = drive.flexspline.l - drive.flexspline.b_w
    D = E * rim.h_3**3 / (12 * (1 - nu**2))
    inertia = rim.k_t * rim.b_w * rim.h_1**3 / 12 + D * length / 3 / E
    area = rim.b_w * rim.h_1 + rim.h_3 * float(np.sqrt(r * rim.h_3)) / _EDGE_ZONE
    ring = plain_ring(E, area, inertia, r, drive.numerics.n_max)
    n = ring.order[1:]
    twist = 2 * np.pi * D * (1 - nu) * (n**2 - 1.0) ** 2 / (n**2 * r * length)
    return Ring(r, ring.order, ring.stiffness + np.concatenate([[0.0], twist]))


def shell_twist_stiffness(drive: Drive, geometry: Geometry) -> float:
    """Torsional stiffness [N*mm/rad] of the shell as a thin tube of length l: 2 pi G r_m^3 h_3/l."""
    G = drive.material.E / (2 * (1 + drive.material.nu))
    return 2 * np.pi * G * geometry.r_m**3 * drive.flexspline.h_3 / drive.flexspline.l
