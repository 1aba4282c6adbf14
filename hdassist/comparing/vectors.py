"""Deviation vectors of a drive in terms of its preset, a size and a direction each.

Of order 3 there is none: on two opposite zones it looks like a first harmonic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hdassist.error.waves import Complex
from hdassist.preset.fields import Drive


@dataclass(frozen=True)
class DeviationVector:
    """One deviation: paths of its size [um] and its direction [deg], and its words.

    part: what it turns with, flexspline g, rigid wheel b or cam h; order: waves around it; unit [um] that it is counted
    in, so that all weigh about alike: first harmonics nearly cancel on two opposite zones, even ones do not.
    """

    size: str
    direction: str
    words: str
    part: Literal["g", "b", "h"]
    order: int = 1
    unit: float = 1.0

    @property
    def name(self) -> str:
        """Symbol of the size."""
        return self.size.split(".")[1]


EVEN_UNIT = 0.1  # um
VECTORS = (
    DeviationVector("tolerances.F_i1", "phases.xi_g", "flexspline teeth", "g"),
    DeviationVector("tolerances.F_i2", "phases.xi_b", "rigid wheel teeth", "b"),
    DeviationVector("tolerances.e_hb", "phases.phi_hb", "offset, rigid wheel", "b"),
    DeviationVector("tolerances.e_hh", "phases.phi_hh", "offset, cam", "h"),
    DeviationVector("tolerances.e_hg", "phases.phi_hg", "offset, flexspline", "g"),
    DeviationVector("harmonics.a_b2", "harmonics.xi_b2", "ovality of the rigid wheel or its seat", "b", 2, EVEN_UNIT),
    DeviationVector("harmonics.a_g2", "harmonics.xi_g2", "ovality of the flexspline", "g", 2, EVEN_UNIT),
    DeviationVector("harmonics.a_b4", "harmonics.xi_b4", "order 4 of the rigid wheel", "b", 4, EVEN_UNIT),
    DeviationVector("harmonics.a_g4", "harmonics.xi_g4", "order 4 of the flexspline", "g", 4, EVEN_UNIT),
)
_UNITS = np.array([v.unit for v in VECTORS])


def vectors_of(drive: Drive) -> Complex:
    """Deviations of a drive as complex numbers in their units, shape (vectors,); the angle is order x direction."""
    sizes = np.array([drive.number(v.size) for v in VECTORS])
    turned = np.radians([v.order * drive.number(v.direction) for v in VECTORS])
    return np.asarray(sizes / _UNITS * np.exp(1j * turned))


def direction_of(vector: complex, near: float, order: int = 1) -> float:
    """Direction of a vector of an order [deg], in the turn that is nearest to another direction."""
    turn = 360 / order
    return near + float((np.degrees(np.angle(vector)) / order - near + turn / 2) % turn - turn / 2)


def with_vectors(drive: Drive, vectors: Complex, free: Sequence[int]) -> Drive:
    """The drive with some of its deviation vectors changed.

    Arguments: vectors, complex and in their units, one for each of VECTORS; free, places of those to take over.
    Directions are given in the turn nearest to those that the drive has.
    """
    values = {}
    for k in free:
        vector = VECTORS[k]
        values[vector.size] = float(abs(vectors[k])) * vector.unit
        values[vector.direction] = direction_of(vectors[k], drive.number(vector.direction), vector.order)
    return drive.with_values(values)
