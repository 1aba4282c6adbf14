"""What is not known of a drive, in the advice: no order that it could reverse."""

from dataclasses import replace

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.model.deviations import deviation_scalars
from hdassist.mounting.advice import advise
from hdassist.mounting.positions import rotated, seat_positions
from hdassist.pages.mount import mount_card_facts, mount_report, position_curves, positions_table, what_to_do
from hdassist.run.run import UNCHECKED
from hdassist.terminal.answers import report_object
from hdassist.terminal.texts import texts
from tests.process import SMALL, run
from tests.support import changed

OVAL = ("harmonics.a_b2=1", "harmonics.xi_b2=unknown", "mounting.holes=6", "operation.M_g=4")


def advice_on(*overrides: str, **options):
    drive = load_preset(SMALL, list(overrides))
    return advise(drive, drive.operation.M_g, seat_positions(drive), run=UNCHECKED, **options)


@pytest.fixture(scope="module")
def oval():
    return advice_on(*OVAL, draws=16)


def test_without_a_direction_that_decides_any_hole_may_be_the_best():
    advice = advice_on("phases.phi_hb=unknown", "operation.M_g=4")
    assert (advice.order, advice.any_hole, mount_report(advice, 0).line) == ("none", True, "unknown")
    told = report_object(mount_report(advice, 0))
    assert (told["exit_code"], told["order"], told["turn"], told["recommended"]) == (6, "none", False, None)
    assert [place["hole"] for place in told["measure"]] == [0, 4, 8]
    assert told["unknown"] == [{"field": "phases.phi_hb", "range": [0, 360], "reason": "any direction"}]
    assert advice.positions
    assert [curve.whiskers for curve in position_curves(advice)] == [()]  # of holes, which no phase is
    overrides = "--set phases.phi_hb=unknown --set operation.M_g=4"
    assert f"hdassist trials {SMALL} {overrides} h0=F_IOR h4=F_IOR h8=F_IOR" in what_to_do(advice)


FREE = "the cam aligns itself (its support has a stiffness of 0), so no offset of it is felt."
STILL = "nothing that stands still with the seat is off."
TRUE = "the wheel has no deviation that could be turned."


@pytest.mark.parametrize(
    ("overrides", "why"),
    [
        (("cam.coupling=oldham",), FREE),
        (("cam.coupling=oldham", "tolerances.e_hb=unknown", "phases.phi_hb=unknown"), FREE),
        (("tolerances.e_hb=0",), STILL),
        (("tolerances.e_hb=0", "cam.coupling=oldham", "phases.xi_b=unknown"), STILL),
        (("tolerances.F_i2=0",), TRUE),
    ],
)
def test_where_no_hole_can_be_better_the_first_line_says_why_and_nothing_is_to_be_measured(overrides, why):
    advice = advice_on("operation.M_g=4", "mounting.holes=4", *overrides, draws=8)
    # holes are no whole number of teeth apart
    assert advice.curve.F_ior_arcsec.max() < 1.01 * advice.curve.F_ior_arcsec.min()
    assert (advice.order, advice.any_hole, advice.to_try and mount_report(advice, 0).line) == ("leave", False, "0")
    assert what_to_do(advice) == f"No hole is better than another: {why} Leave the rigid wheel as it is."
    assert (report_object(mount_report(advice, 0))["exit_code"], report_object(mount_report(advice, 0))["measure"]) == (
        0,
        [],
    )


@pytest.mark.parametrize(
    "overrides", [("cam.coupling=oldham", "harmonics.a_s2=1"), ("harmonics.a_s2=unknown", "tolerances.e_hb=0")]
)
def test_an_oval_seat_makes_one_hole_better_on_any_cam(overrides):
    advice = advice_on("operation.M_g=4", "mounting.holes=4", *overrides, draws=0)
    assert advice.no_hole_better == ""


def test_its_samples_are_drives_that_are_oval_in_any_direction(oval):
    best = oval.positions.losses.argmin(axis=1)
    assert len(set(best.tolist())) > 1  # such an ovality decides as much as all the rest


def test_every_number_of_a_hole_is_the_median_over_the_samples(oval):
    told, card = report_object(mount_report(oval, 0)), mount_card_facts(oval, texts())
    sampled = told["belief"]
    medians = {place["rotation_deg"]: place["F_ior_arcsec"]["expected"] for place in sampled["positions"]}
    for name in ("current", "best_bet", "worst"):
        assert told[name]["F_ior_arcsec"] == pytest.approx(medians[told[name]["rotation_deg"]])
    unsure = report_object(mount_report(replace(oval, needed=1.1), 0))
    assert [place["hole"] for place in unsure["measure"]] == [0, 2, 4]
    for place in (*unsure["measure"], unsure["current"]):
        assert place["F_ior_arcsec"] == pytest.approx(medians[place["rotation_deg"]])
    now = sampled["now"][0]
    assert now["p5"] < now["p50"] < now["p95"]
    assert told["gain_range"]["p5"] <= told["gain"] <= told["gain_range"]["p95"]
    assert card.choice.chosen.F_ior_arcsec == tuple(told["best_bet"]["F_ior_arcsec"])


def test_nobody_looked_and_nothing_is_ordered(oval):
    assert replace(oval, positions=None, gain_probability=None).order == "none"


def test_what_is_known_is_ordered_as_ever():
    advice = advice_on("operation.M_g=4")
    assert (advice.order, advice.unknown, advice.positions) == ("turn", (), None)


def test_without_a_direction_there_is_no_order_and_no_card(tmp_path):
    open_ = (SMALL, "--set", "phases.phi_hb=unknown", "--torque", "4", "--no-plot")
    refused = run("mount", *open_, "--card", "card.txt", cwd=tmp_path)
    assert refused.returncode == 6
    assert "no card: nothing can be ordered" in refused.stderr
    assert not (tmp_path / "card.txt").exists()
    given = run("mount", *open_, "--card", "card.txt", "--assume-phases", cwd=tmp_path)
    assert (given.returncode, "--set phases.phi_hb=0" in given.stderr) == (2, True)


def test_a_seats_ovality_stands_still_while_the_wheel_turns(reference):
    alpha = np.linspace(0, 6, 5)
    for name, moves in (("b", True), ("s", False)):
        drive = changed(reference, **{f"harmonics__a_{name}2": 3.0, f"harmonics__xi_{name}2": 20.0})
        here, there = (deviation_scalars(each, alpha, -alpha)[:, 6:8] for each in (drive, rotated(drive, 30.0)))
        assert np.allclose(here, there) != moves


def test_the_page_has_one_gain_the_median_over_the_samples():
    advice = advice_on("phases.xi_b=90±20", "mounting.holes=6", "operation.M_g=[1,4]", draws=16)
    assert advice.positions
    row = next(row for row in positions_table(advice).rows if row[0] == "best")
    assert row[-1] == f"{-100 * advice.gain:+.0f} %"
    assert "%" not in what_to_do(advice).partition("the best bet is ")[2].partition(".")[0]
