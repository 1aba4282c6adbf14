"""The samples that measured values are compared with."""

import pytest

from hdassist.features.mounting.posterior import HoleSamples, hole_samples
from tests.mounting.drives import FEW, SETUP, told


@pytest.fixture(scope="session")
def cloud() -> HoleSamples:
    return hole_samples(told(), (1.0,), SETUP, draws=FEW)
