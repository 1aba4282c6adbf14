"""The error along which the torque changes, held against states that are solved at their own torque."""

from __future__ import annotations

import json

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.error.cycle import kinematic_error
from hdassist.drive.error.waves import Gravity, trace
from hdassist.run.run import UNCHECKED
from tests.helpers.process import SMALL, in_a_line, run


def test_error_under_gravity_agrees_with_states_solved_at_their_torque():
    drive = load_preset(SMALL)
    found = trace(drive, 6.0, gravity=Gravity(4.0, 70.0), revolutions=30, run=UNCHECKED)
    error, along = found.error, found.along
    torque = 6 + 4 * np.cos(error.states.phi_g - np.radians(70))
    assert (along.least_Nm, along.greatest_Nm) == pytest.approx((torque.min(), torque.max()))
    wind_up = {M_g: kinematic_error(drive, M_g, run=UNCHECKED).wind_up_arcsec for M_g in np.linspace(2, 10, 33)}
    for k in np.random.default_rng(3).choice(len(torque), 40, replace=False):
        own = kinematic_error(drive, torque[k], states=error.states.take(np.array([k])), run=UNCHECKED)
        mean = np.interp(torque[k], [*wind_up], [*wind_up.values()])
        assert abs(own.rotation_arcsec[0] - mean - error.rotation_arcsec[k]) <= along.bound_arcsec + 0.1
    assert along.bound_arcsec < 0.2 * error.range_arcsec
    assert along.wind_up_arcsec == pytest.approx(max(wind_up.values()) - min(wind_up.values()), rel=0.01)


def test_light_weight_changes_nothing_and_heavy_weight_crosses_zero_torque():
    drive = load_preset(SMALL)
    even = trace(drive, 6.0, revolutions=2, run=UNCHECKED).error
    light = trace(drive, 6.0, gravity=Gravity(1e-4), revolutions=2, run=UNCHECKED).error
    assert light.error_arcsec == pytest.approx(even.error_arcsec, abs=0.01)
    heavy = trace(drive, 4.0, gravity=Gravity(8.0), revolutions=30, run=UNCHECKED)
    assert heavy.along.least_Nm < 0 < heavy.along.greatest_Nm
    assert np.isfinite(heavy.error.error_arcsec).all()


def test_the_page_and_json():
    page = in_a_line(run("trace", SMALL, "--torque", "6", "--gravity", "4,70", "-n", "30", "--no-plot").stdout)
    assert "gravity 2 to 10 N·m, " in page
    assert " torques solved, interpolation error at most " in page
    assert "The wind-up of " in page
    found = json.loads(run("trace", SMALL, "--torque", "6", "--gravity", "4", "--json").stdout)["gravity"]
    assert found["gravity"] == {"amplitude_Nm": 4.0, "direction_deg": 0.0}
    assert len(found["torques_Nm"]) == len(found["ranges_arcsec"])
    assert run("trace", SMALL, "--gravity", "0").returncode == 2
    assert json.loads(run("trace", SMALL, "--json").stdout)["gravity"] is None
