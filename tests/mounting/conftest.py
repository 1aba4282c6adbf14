"""The samples that measured values are compared with."""

import pytest

from hdassist.features.mounting.posterior import HoleSamples, hole_samples
from tests.mounting.drives import COARSE, FEW, SETUP, told


@pytest.fixture(scope="session")
def cloud() -> HoleSamples:
    return hole_samples(told(), (1.0,), SETUP, draws=FEW)


@pytest.fixture(scope="session")
def coarse_cloud() -> HoleSamples:
    """Fewer samples from a coarser table, in a twentieth of the time: for tests of how they are used."""
    return hole_samples(told(), (1.0,), SETUP, **COARSE)
