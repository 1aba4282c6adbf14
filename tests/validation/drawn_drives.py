"""Drives drawn from what a catalogue preset leaves open of its deviations, its design at the preset's own numbers."""

from __future__ import annotations

from functools import cache

import numpy as np

from hdassist import load_preset
from hdassist.belief.prior import prior_of
from hdassist.drive.error.error_map import Batch, ErrorMap
from hdassist.drive.error.extremes import many_extremes
from hdassist.drive.model.geometry import Array

DEVIATIONS = ("tolerances.", "phases.", "harmonics.")
AMPLITUDE, WHEEL, PITCH = "harmonics.a_", "tolerances.F_i", "tolerances.f_p"


@cache
def drawn_drives(size: int, count: int, harmonics: float = 1.0, wheels: float = 1.0) -> tuple[Batch, Array]:
    """Drives of a catalogue size, and a share of the cycle to begin at for each, shape (count,).

    Arguments: factors on the amplitudes of orders 2 to 4 and on F'_i, which are some on their bounds.
    """
    prior = prior_of(load_preset(f"size-{size}-100"))
    shares, factors = prior.shares(count), {AMPLITUDE: harmonics, WHEEL: wheels, PITCH: wheels}
    columns = {
        path: column * next((x for of, x in factors.items() if path.startswith(of)), 1.0)
        for path, column in prior.columns(shares).items()
        if path.startswith(DEVIATIONS)
    }
    return Batch(prior.drive, columns), shares[:, -1]


@cache
def F_ior_drawn(size: int, count: int, harmonics: float = 1.0, wheels: float = 1.0) -> Array:
    """F'_ior [arcsec] of drawn drives at the least torque of their preset, shape (count,)."""
    batch, _ = drawn_drives(size, count, harmonics, wheels)
    search = ErrorMap(batch.drive, min(batch.drive.operation.M_g))
    return many_extremes(search, batch).F_ior_arcsec


def percentiles(values: Array) -> str:
    """5th, 50th and 95th percentile of values, in words."""
    low, middle, high = np.percentile(values, [5, 50, 95])
    return f"{low:.3g}/{middle:.3g}/{high:.3g}"
