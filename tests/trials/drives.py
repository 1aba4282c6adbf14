"""Small drives, their values in each hole, and samples for tests of trials."""

from functools import cache

import numpy as np

from hdassist import load_preset
from hdassist.belief.tabled import TableEffort
from hdassist.error.error_map import ErrorMap
from hdassist.error.table import Mesh
from hdassist.mounting.positions import rotated, usable_positions
from hdassist.mounting.trial import Trial
from hdassist.preset.fields import Drive
from hdassist.trials.prior import Prior, Rig, TrialEffort
from tests.process import SMALL

M_G, HOLES = 4.0, 12
POSITIONS = usable_positions(HOLES, "all")
THIRDS = (0.0, 120.0, 240.0)
KNOWN = {"tolerances.e_hh": 1.0, "phases.phi_hh": 2.0}  # the cam's own offset, well measured
RIG = Rig(M_G, noise_arcsec=0.5)
FEW = TrialEffort.of(16)
COARSE_MESH = Mesh((9, 5, 9, 9), 12)
COARSE = TrialEffort(2, 2, 2, 64, TableEffort(16, COARSE_MESH))


def told(*overrides: str, **uncertainty: float) -> Drive:
    return load_preset(SMALL, overrides).model_copy(update={"uncertainty": KNOWN | uncertainty})


@cache
def measured(size: float, direction: float) -> tuple[float, ...]:
    """F'_ior [arcsec] in each hole, by search."""
    drive = load_preset(SMALL).with_values({"tolerances.e_hb": size, "phases.phi_hb": direction})
    search = ErrorMap(drive, M_G)
    return tuple(search.extremes(rotated(drive, r)).first for r in POSITIONS)


def direction_of(cloud: Prior) -> np.ndarray:
    """Directions of the standing offset [deg], samples and directions flat."""
    return cloud.offset(np.arange(cloud.weight.size))[1]


def trials(values, rotations=THIRDS) -> list[Trial]:
    return [Trial(r, values[POSITIONS.index(r)]) for r in rotations]


def synthetic(F_ior: np.ndarray, weight: np.ndarray | None = None, rig: Rig = RIG) -> Prior:
    """Samples with such F'_ior, shape (samples, holes), read without error."""
    weight = np.ones(F_ior.shape) if weight is None else weight
    return Prior(told(), rig, {rig.M_g: F_ior}, weight / weight.sum(), {}, {rig.M_g: 0.0})
