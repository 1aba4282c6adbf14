"""In-plane compliance of the flexspline's rim with its shell, and of the bearing's outer ring.

Thin rings that bend without stretching, mode by mode, and a uniform stretch (n = 0).
Mode n = 1 is rigid motion and belongs to the displacements of the bodies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.model.geometry import Array, Geometry
from hdassist.preset.fields import Drive

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
    b, h = drive.bearing.ring_b, drive.bearing.ring_h
    return plain_ring(drive.material.E, b * h, b * h**3 / 12, geometry.r_ring, drive.numerics.n_max)


def flexspline_ring(drive: Drive, geometry: Geometry) -> Ring:
    """The toothed rim of the flexspline and the shell behind it.

    The shell's displacement is linear along its axis, its far edge free to warp axially: it adds bending
    D L/3 and twist 2 pi D (1 - nu) (n^2 - 1)^2/(n^2 r_m L). Only its edge zone helps the hoop.
    """
    E, nu, r = drive.material.E, drive.material.nu, geometry.r_m
    rim, length = drive.flexspline, drive.flexspline.l - drive.flexspline.b_w
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
