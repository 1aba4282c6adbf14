"""Joints that turn through less than the full cycle: their F'_ior is that of the travel, and so is the verdict."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.joints import RATIO, Joint, JointStudy
from hdassist import load_preset
from hdassist.drive.preset.fields import Acceptance
from hdassist.features.acceptance.decision import OF_TRAVEL
from hdassist.features.measuring.measure import measure
from hdassist.features.measuring.orders import STATED, Gearing, gearing_of
from tests.helpers.acceptances import accept
from tests.helpers.rigs import recorded

NOTHING = dict.fromkeys(STATED, 0.0)


def test_travel_counts_where_it_is_less_than_the_full_cycle():
    gearing = gearing_of(None, 100)
    assert gearing == Gearing(100, 100)
    assert gearing.within(360) == gearing.within(None) == gearing
    assert gearing.within(90) == Gearing(100, 100, 25.0)
    assert gearing_of(None, 99.5).within(540) == Gearing(99.5, 199, 149.25)


@pytest.mark.thorough
@pytest.mark.parametrize("travel_deg", [300.0, 120.0, 40.0])
def test_ranges_of_joints_are_held(travel_deg):
    study = JointStudy()
    for seed in range(4):
        study.add(Joint(seed, travel_deg), travel_deg)
    assert (study.held, study.false_pass, study.false_fail) == (4, 0, 0)
    assert abs(study.bias) / 4 < 0.03


@pytest.mark.thorough
@pytest.mark.parametrize("output_deg", [150.0, 200.0])
def test_orders_of_the_input_are_independent_of_the_travel(output_deg: float):
    """Orders nearer than the travel tells apart cancel each other: together they are no more than the error is."""
    turns = np.arange(0, output_deg / 360 * RATIO, 1 / 36)
    cam, output = 2 * np.pi * turns, 2 * np.pi * turns / RATIO
    error = 8 * np.cos(2 * cam) + 3 * np.cos(2 * cam + output + 1) + 1.5 * np.cos(cam + 0.7) + 2 * np.cos(output + 0.5)
    record = recorded(turns, error + 0.5 * np.random.default_rng(3).standard_normal(len(turns)))
    (joint,), (alone,) = (measure(record, ratio=RATIO, travel_deg=travel).directions for travel in (output_deg, None))
    sizes = [[each.amplitude_arcsec for each in found.orders_of_cam] for found in (joint, alone)]
    assert sizes[0] == pytest.approx(sizes[1], abs=0.5)  # noise of 0.5 in 26 waves of each
    assert max(sizes[0]) == pytest.approx(np.sqrt(2 * np.var(error - 2 * np.cos(output + 0.5))), rel=0.15)


def test_less_than_the_travel_is_a_lower_bound():
    joint = Joint(0, 120.0)
    (found,) = measure(joint.trace, ratio=RATIO, travel_deg=200.0).directions
    assert found.is_bound
    assert found.coverage.share == pytest.approx(0.6, abs=0.01)


@pytest.mark.thorough
@pytest.mark.moves("acceptance.travel")
def test_a_joint_is_accepted_by_a_record_of_its_travel():
    joint, drive = Joint(2, 300.0), load_preset("vzp160", ["operation.M_g=80"])

    def verdict(limit, travel):
        tested = drive.model_copy(update={"acceptance": Acceptance(F_ior={"80": limit}, travel=travel)})
        found = measure(joint.trace, drive=tested, stated=NOTHING, travel_deg=travel)
        return accept(tested, {80.0: found}, measured_only=True).verdict

    good, bad = 1.2 * joint.F_ior_arcsec, 0.8 * joint.F_ior_arcsec
    assert [verdict(good, 300.0), verdict(bad, 300.0)] == ["PASS", "FAIL"]
    whole = float(np.ptp(joint.error(np.arange(0, RATIO, 1 / 240))))
    assert whole < good  # over the full cycle the record is a part, which leaves the bad limit open
    assert [verdict(good, 720.0), verdict(bad, 720.0)] == ["PASS", "INCONCLUSIVE"]


@pytest.mark.thorough
def test_prediction_over_the_full_cycle_never_fails_a_limited_joint():
    whole = load_preset("vzp160", ["operation.M_g=80"])
    for travel, verdict in ((720.0, "FAIL"), (90.0, "INCONCLUSIVE")):
        tested = whole.model_copy(update={"acceptance": Acceptance(F_ior={"80": 5.0}, travel=travel)})
        (check,) = accept(tested).checks
        assert check.verdict == verdict
        assert (check.reason == OF_TRAVEL) == (verdict == "INCONCLUSIVE")


@pytest.mark.thorough
def test_slow_parts_of_the_output_count_in_a_travel():
    joint = Joint(1, 300.0)
    (alone,) = measure(joint.trace, ratio=RATIO).directions
    (found,) = measure(joint.trace, ratio=RATIO, travel_deg=300.0).directions
    assert found.range.value > 1.05 * alone.range.value
