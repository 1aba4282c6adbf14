"""F'_ior of vzp160 over what nobody printed of it: sets drawn within the bounds of its identification, not fitted."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from hdassist import Drive, load_preset
from hdassist.drive.error.error_map import Batch, ErrorMap
from hdassist.drive.error.extremes import many_extremes
from hdassist.drive.model.geometry import Array
from hdassist.features.calibration import read_targets

TARGETS = Path(__file__).parents[2] / "docs/vzp160.targets.yaml"
COUNT, TORQUES, PHASES = 24, (80.0, 800.0), np.arange(0.0, 360.0, 30.0)  # N*m, deg


@cache
def F_ior_over_sets() -> Array:
    """F'_ior [arcsec] of each set at TORQUES and PHASES, shape (COUNT, 2, 12)."""
    drive = load_preset("vzp160")
    unknowns = read_targets(TARGETS.read_bytes(), TARGETS.name, drive).unknowns
    shares = qmc.Sobol(len(unknowns), rng=np.random.default_rng(0)).random(32)[:COUNT]
    sets = [{u.path: float(u.value(x)) for u, x in zip(unknowns, row, strict=True)} for row in shares]
    return np.array([by_phase(drive.with_values(values)) for values in sets])


def by_phase(drive: Drive) -> Array:
    """F'_ior [arcsec] of a drive at TORQUES and PHASES."""
    batch = Batch(drive, {"phases.xi_b": PHASES})
    return np.array([many_extremes(ErrorMap(drive, M_g), batch).F_ior_arcsec for M_g in TORQUES])


def span(values: Array, digits: str = ".3g") -> str:
    """5 to 95 % of values over the sets, in words."""
    low, high = np.percentile(values, [5, 95])
    return f"{low:{digits}}–{high:{digits}}"


def scatter(values: Array) -> float:
    """Standard deviation of the logarithm of values over the sets."""
    return float(np.std(np.log(values), ddof=1))
