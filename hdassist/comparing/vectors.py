"""Deviation vectors that are fitted to a record: size and direction of a deviation as a complex number.

Deviations that look like another one in a single position of the wheel are left out: order 3 (on two opposite zones it
looks like a first harmonic), the offset e_b of the rigid wheel, and the ovality a_s2 of its seat.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hdassist.error.waves import Complex
from hdassist.preset.deviations import DEVIATIONS
from hdassist.preset.fields import Drive

VECTORS = tuple(d for d in DEVIATIONS if d.order != 3 and d.kind not in ("centre", "seat"))
VECTOR_ORDERS = np.array([vector.order for vector in VECTORS])
# um, in which each is counted, so that all weigh about alike: first harmonics nearly cancel on two opposite zones
VECTOR_UNITS = np.where(VECTOR_ORDERS > 1, 0.1, 1.0)


def vectors_of(drive: Drive) -> Complex:
    """Deviations of a drive as complex numbers in their units, shape (vectors,); the angle is order x direction."""
    sizes, directions = np.array([[drive.number(v.size), drive.number(v.direction)] for v in VECTORS]).T
    return np.asarray(sizes / VECTOR_UNITS * np.exp(1j * np.radians(VECTOR_ORDERS * directions)))


def size_and_direction(drive: Drive, vectors: Complex, k: int) -> tuple[float, float]:
    """Size [um] and direction [deg] of one of the vectors, in the turn nearest to the direction that the drive has."""
    near, turn = drive.number(VECTORS[k].direction), 360 / VECTORS[k].order
    away = float(np.degrees(np.angle(vectors[k]))) / VECTORS[k].order - near
    return float(abs(vectors[k]) * VECTOR_UNITS[k]), near + (away + turn / 2) % turn - turn / 2


def with_vectors(drive: Drive, vectors: Complex, fitted: Iterable[int]) -> Drive:
    """The drive with those of its deviation vectors changed that were fitted, by their places in VECTORS."""
    values: dict[str, float] = {}
    for k in fitted:
        values[VECTORS[k].size], values[VECTORS[k].direction] = size_and_direction(drive, vectors, k)
    return drive.with_values(values)
