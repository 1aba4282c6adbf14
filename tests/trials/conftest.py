"""The samples that trials are compared with."""

import pytest

from hdassist.trials.prior import Prior, trial_prior
from tests.trials.drives import FEW, RIG, told


@pytest.fixture(scope="session")
def cloud() -> Prior:
    return trial_prior(told(), (1.0,), RIG, effort=FEW)
