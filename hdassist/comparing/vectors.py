"""The five deviation vectors of a drive in terms of its preset: a size and a direction each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hdassist.error.waves import Complex
from hdassist.preset.fields import Drive


@dataclass(frozen=True)
class Vector:
    """One deviation: paths of its size [um] and its direction [deg], and what it is in words."""

    size: str
    direction: str
    words: str

    @property
    def name(self) -> str:
        """Symbol of the size."""
        return self.size.split(".")[1]


VECTORS = (
    Vector("tolerances.F_i1", "phases.xi_g", "flexspline teeth"),
    Vector("tolerances.F_i2", "phases.xi_b", "rigid wheel teeth"),
    Vector("tolerances.e_hb", "phases.phi_hb", "offset, rigid wheel"),
    Vector("tolerances.e_hh", "phases.phi_hh", "offset, cam"),
    Vector("tolerances.e_hg", "phases.phi_hg", "offset, flexspline"),
)


def vectors_of(drive: Drive) -> Complex:
    """Deviations of a drive as complex numbers [um], shape (5,)."""
    sizes = np.array([drive.value(v.size) for v in VECTORS], dtype=float)
    turned = np.radians([drive.value(v.direction) for v in VECTORS])
    return np.asarray(sizes * np.exp(1j * turned))


def direction_of(vector: complex, near: float) -> float:
    """Direction of a vector [deg], in the turn that is nearest to another direction."""
    return near + float((np.degrees(np.angle(vector)) - near + 180) % 360 - 180)


def with_vectors(drive: Drive, vectors: Complex, free: Sequence[int]) -> Drive:
    """The drive with some of its deviation vectors changed.

    Arguments: vectors [um, complex], one for each of VECTORS; free, places of those to take over. Directions are given
    in the turn nearest to those that the drive has.
    """
    values = {}
    for k in free:
        values[VECTORS[k].size] = float(abs(vectors[k]))
        values[VECTORS[k].direction] = direction_of(vectors[k], float(drive.value(VECTORS[k].direction)))
    return drive.with_values(values)
