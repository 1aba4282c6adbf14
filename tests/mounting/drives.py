"""Small drives, their values in each hole, and samples for tests of trials."""

from functools import cache

import numpy as np

from hdassist import load_preset
from hdassist.belief.proposals import TableEffort
from hdassist.drive.error.error_map import ErrorMap, Mesh
from hdassist.drive.preset.fields import Drive
from hdassist.features.mounting.decision import Decision
from hdassist.features.mounting.positions import rotated, usable_positions
from hdassist.features.mounting.posterior import HolePosterior, HoleSamples, Trial, TrialSetup, posterior_of
from tests.helpers.process import SMALL

M_G, HOLES = 4.0, 12
POSITIONS = usable_positions(HOLES, "all")
THIRDS = (0.0, 120.0, 240.0)
KNOWN = {"tolerances.e_hh": 1.0, "phases.phi_hh": 2.0}  # the cam's own offset, well measured
SETUP = TrialSetup(M_G, noise_arcsec=0.5)
FEW = 32  # effective samples of the belief
COARSE_MESH = Mesh((9, 5, 9, 9), 12)
COARSE = {"draws": 4, "table": TableEffort(16, COARSE_MESH)}


def told(*overrides: str, **uncertainty: float) -> Drive:
    return load_preset(SMALL, overrides).model_copy(update={"uncertainty": KNOWN | uncertainty})


@cache
def measured(size: float, direction: float) -> tuple[float, ...]:
    """F'_ior [arcsec] in each hole, by search."""
    drive = load_preset(SMALL).with_values({"tolerances.e_hb": size, "phases.phi_hb": direction})
    search = ErrorMap(drive, M_G)
    return tuple(search.extremes(rotated(drive, r)).first for r in POSITIONS)


def direction_of(cloud: HoleSamples) -> np.ndarray:
    """Directions of the standing offset [deg], samples and directions flat."""
    return cloud.values["phases.phi_hb" if cloud.drive.mounting.fixed == "rigid" else "phases.phi_hg"].ravel()


def trials(values, rotations=THIRDS) -> list[Trial]:
    return [Trial(r, values[POSITIONS.index(r)]) for r in rotations]


def synthetic(F_ior: np.ndarray, weight: np.ndarray | None = None, setup: TrialSetup = SETUP) -> HoleSamples:
    """Samples with such F'_ior, shape (samples, holes), read without error."""
    weight = np.ones(F_ior.shape) if weight is None else weight
    values = dict.fromkeys(("tolerances.e_hb", "phases.phi_hb"), np.ones(F_ior.shape))
    return HoleSamples(told(), setup, {setup.M_g: F_ior}, weight / weight.sum(), values, 0.0)


def shown(samples: HoleSamples, rotations, places=None, torque: float = M_G) -> np.ndarray:
    """F'_ior of samples [arcsec] in positions, shape (places, rotations); without places of all of them."""
    every = np.arange(samples.weight.size) if places is None else places
    return samples.at([(turn, torque) for turn in rotations], every)


def learnt(samples: HoleSamples, tried, rotations, torques=(M_G,)) -> tuple[HolePosterior, Decision]:
    """Draws after values, and the decision among these positions."""
    after = posterior_of(samples, tried, [*rotations, 0.0])
    return after, after.decision(torques, (), 0.01)
