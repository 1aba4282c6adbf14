"""The greatest slope of the error, which guiding a mount asks for: of records with a known curve, and of the model."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.joints import RATIO, Joint
from hdassist import load_preset, trace
from hdassist.features.measuring.measure import measure
from hdassist.run.run import UNCHECKED
from tests.helpers.process import TINY, in_a_line, run


def true_slope(joint: Joint, travel_deg: float) -> float:
    turns = joint.start + np.arange(round(travel_deg / 360 * RATIO * 1000) + 1) / 1000
    return float(np.abs(np.gradient(joint.error(turns), 360 / RATIO / 1000))[1000:-1000].max())


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(6))
def test_slopes_of_records_are_held(seed):
    joint = Joint(seed, 120.0)
    slope, uncertainty = measure(joint.trace, ratio=RATIO, travel_deg=120.0).slope_arcsec_per_deg
    assert abs(slope - true_slope(joint, 120.0)) < 2 * uncertainty + 0.01 * slope
    assert uncertainty < slope


def test_recording_without_a_ratio_has_no_slope_over_the_output():
    joint = Joint(0, 120.0)
    assert measure(joint.trace).slope_arcsec_per_deg is None


def test_slope_of_a_predicted_trace_agrees_with_its_spectrum():
    found = trace(load_preset(TINY), 1.0, run=UNCHECKED)
    turns = found.error.states.phi_h / (2 * np.pi)
    spectrum = np.fft.rfft(found.error.error_arcsec - found.error.error_arcsec.mean())
    orders = np.arange(len(spectrum)) * (len(turns) - 1) / len(turns) / np.ptp(turns)
    steepest = np.abs(np.fft.irfft(2j * np.pi * orders * spectrum, len(turns))).max()  # arcsec a cam turn
    assert found.slope_arcsec_per_deg == pytest.approx(steepest * abs(found.error.kinematics.u) / 360, rel=0.25)


def test_commands_state_the_slope_and_the_rate_at_a_speed(tmp_path):
    joint = Joint(2, 120.0)
    rows = np.column_stack([360 * joint.cam_turns, joint.error_arcsec])
    np.savetxt(tmp_path / "run.csv", rows, fmt="%.6f", delimiter=",", header="cam_deg,error_arcsec", comments="")
    asked = ("measure", str(tmp_path / "run.csv"), "--ratio", "100", "--travel", "120", "--speed", "15.041")
    found = json.loads(run(*asked, "--json").stdout)
    slope = found["slope_arcsec_per_deg"]
    assert found["rate_arcsec_per_s"] == pytest.approx(slope * 15.041 / 3600)
    assert f"at most {slope:.3g} ±" in run(*asked).stdout
    told = run("trace", TINY, "--speed", "15.041", "--details").stdout
    assert "at an output speed of 15.041″/s" in in_a_line(told)
