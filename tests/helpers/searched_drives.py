"""Random drives for the tests and the benchmark of the search for extremes."""

from collections.abc import Sequence

import numpy as np

from hdassist import load_preset
from hdassist.drive.preset.fields import Drive

OFFSETS = {"e_hb": 160.0, "e_hh": 60.0}  # um; each size is uniform from 0 to this value, and its direction is random
DEVIATIONS = {"F_i1": 150.0, "F_i2": 150.0, "e_hg": 30.0}
CLEARANCES = {"gears.j_n": 20.0, "bearing.g_b": 10.0}
PHASES = ("xi_g", "xi_b", "phi_hb", "phi_hh")
TORQUES = (20.0, 1000.0)  # N*m; the logarithm of the torque is uniform


def searched_drive(kind: str, seed: int, overrides: Sequence[str] = ()) -> tuple[Drive, float]:
    """Return a random drive and its torque M_g [N*m]: `vzp160` with random eccentricities and phases.

    kind: light (80 N*m), heavy (800 N*m), or any (random torque, other deviations and clearances).
    seed: seed of the random values.
    overrides: overrides as in `load_preset`.
    """
    rng = np.random.default_rng(seed)
    values = {f"tolerances.{name}": rng.uniform(0, most) for name, most in OFFSETS.items()}
    values |= {f"phases.{name}": rng.uniform(0, 360) for name in PHASES}
    M_g = 80.0 if kind == "light" else 800.0
    if kind == "any":
        values |= {f"tolerances.{name}": rng.uniform(0, most) for name, most in DEVIATIONS.items()}
        values |= {"phases.phi_hg": rng.uniform(0, 360)}
        values |= {path: rng.uniform(0, most) for path, most in CLEARANCES.items()}
        M_g = float(np.exp(rng.uniform(*np.log(TORQUES))))
    return load_preset("vzp160", overrides).with_values({path: float(value) for path, value in values.items()}), M_g
