"""Waves of the error over both wheels' angles, against the states themselves."""

import numpy as np
import pytest

from hdassist import kinematic_error, load_preset
from hdassist.drive.error.waves import ErrorWaves
from hdassist.drive.model.geometry import Kinematics, pitch_locked_states
from hdassist.run.errors import UsageError
from hdassist.run.run import UNCHECKED, Run
from tests.helpers.process import SMALL


@pytest.mark.parametrize("fixed", ["rigid", "flexspline"])
def test_the_error_is_the_sum_of_its_waves(fixed):
    drive = load_preset(SMALL, [f"mounting.fixed={fixed}"])
    told: list[int] = []
    model = ErrorWaves(drive, 4.0, Run(progress=told.append))
    (waves,) = model.waves([drive])
    states = pitch_locked_states(Kinematics.of(drive), np.arange(0, 1860, 31))
    exact = kinematic_error(drive, 4.0, states=states, run=UNCHECKED).error_arcsec
    turned = np.outer(states.alpha_g, model.k_g) + np.outer(states.alpha_b, model.k_b)
    found = (waves * np.exp(1j * turned)).real.sum(axis=1)
    missed = found - found.mean() - (exact - exact.mean())
    assert np.sqrt(np.mean(missed**2)) < 0.01 * np.std(exact)
    assert sum(told) == model.certificate.states == 1600


def test_rolling_balls_are_refused():
    with pytest.raises(UsageError, match=r"bearing\.ball_motion: locked"):
        ErrorWaves(load_preset(SMALL, ["bearing.ball_motion=rolling", "bearing.d_ball=3"]), 4.0)
