"""What is not known of a drive, in the advice: no order that it could reverse."""

from dataclasses import replace

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.model.deviations import deviation_scalars
from hdassist.features.mounting.advice import advise
from hdassist.features.mounting.positions import rotated, seat_positions
from hdassist.features.report import Table
from hdassist.interface.pages.mount import instruction_of, mount_report, next_value_words
from hdassist.interface.terminal.output import report_object
from hdassist.run.run import UNCHECKED
from tests.helpers.process import SMALL, run
from tests.helpers.support import changed

OVAL = ("harmonics.a_b2=1", "harmonics.xi_b2=unknown", "mounting.holes=6", "operation.M_g=4")


def advice_on(*overrides: str, **options):
    drive = load_preset(SMALL, list(overrides))
    return advise(drive, seat_positions(drive), run=UNCHECKED, **options)


@pytest.fixture(scope="module")
def oval():
    return advice_on(*OVAL, draws=16)


@pytest.mark.thorough
def test_unknown_direction_gives_any_hole_and_the_holes_to_measure():
    advice = advice_on("phases.phi_hb=unknown", "operation.M_g=4")
    report = mount_report(advice, 0)
    told = report_object(report)
    assert (advice.word, report.line, told["exit_code"]) == ("ANY_HOLE", "any", 0)
    assert (told["word"], told["hole"], told["order"]) == ("ANY_HOLE", None, "leave")
    assert [place["hole"] for place in told["to_try"]] == [0, 4, 8]
    assert told["next"]["hole"] == 0
    assert told["unknown"] == [{"field": "phases.phi_hb", "range": [0, 360], "reason": "any direction"}]
    values, F_ior = zip(*((each["values"], each["F_ior_arcsec"]) for each in told["worth"]), strict=True)
    assert values == (0, 3, 4, 5, 6)
    assert list(F_ior) == sorted(F_ior, reverse=True) and F_ior[2] < 0.9 * F_ior[0]
    assert report.why[0].startswith("The direction of the deviations is unknown, so no hole is expected to be better")
    assert [row[1] for row in report.blocks[0].rows] == ["any"]  # what the others differ by is chance
    assert [len(block.rows) for block in report.details if isinstance(block, Table)] == [12]
    assert f"{F_ior[3]:.1f}″ after five values" in next_value_words(advice)
    assert f"(now {F_ior[0]:.1f}″)" in next_value_words(advice)
    several = replace(advice, drive=changed(advice.drive, operation__M_g=[4.0, 8.0]))
    assert f"{100 * (1 - F_ior[3] / F_ior[0]):.1f} % after five values" in next_value_words(several)
    overrides = "--set phases.phi_hb=unknown --set operation.M_g=4"
    assert f"hdassist mount {SMALL} {overrides} h0=F_IOR h4=F_IOR h8=F_IOR" in dict(report.blocks[1].rows)["next"]


FREE = "the wave generator aligns itself (stiffness of its support: 0), so its eccentricity has no effect."
STILL = "no part that is fixed to the housing seat has a deviation."
TRUE = "the fixed wheel has no deviation, so its hole has no effect."


@pytest.mark.thorough
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
def test_equal_holes_are_explained_first_and_need_no_measurement(overrides, why):
    advice = advice_on("operation.M_g=4", "mounting.holes=4", *overrides, draws=8)
    # holes are no whole number of teeth apart
    assert advice.curve.F_ior_arcsec.max() < 1.01 * advice.curve.F_ior_arcsec.min()
    told = report_object(mount_report(advice, 0))
    assert (advice.word, mount_report(advice, 0).line) == ("ANY_HOLE", "any")
    assert (
        instruction_of(advice) == f"No hole is better than another: {why} The circular spline may be put in any hole."
    )
    assert (told["exit_code"], told["to_try"], told["next"], told["worth"]) == (0, [], None, [])


@pytest.mark.parametrize(
    "overrides", [("cam.coupling=oldham", "harmonics.a_s2=1"), ("harmonics.a_s2=unknown", "tolerances.e_hb=0")]
)
def test_an_oval_seat_makes_one_hole_better_on_any_cam(overrides):
    advice = advice_on("operation.M_g=4", "mounting.holes=4", *overrides, draws=0)
    assert advice.no_hole_better == ""


@pytest.mark.thorough
def test_its_samples_are_drives_that_are_oval_in_any_direction(oval):
    best = oval.decision.losses.argmin(axis=1)
    assert len(set(best.tolist())) > 1  # such an ovality decides as much as all the rest


@pytest.mark.thorough
def test_F_ior_of_a_hole_is_the_median_of_samples(oval):
    told = report_object(mount_report(oval, 0))
    medians = {place["rotation_deg"]: place["F_ior_arcsec"]["p50"] for place in told["positions"]}
    for name in ("current", "best_bet", "worst"):
        assert told[name]["F_ior_arcsec"] == pytest.approx(medians[told[name]["rotation_deg"]])
    now = told["now"][0]
    assert now["p5"] < now["p50"] < now["p95"]
    assert told["gain"]["p5"] <= told["gain"]["p50"] <= told["gain"]["p95"]
    assert oval.chosen.F_ior_arcsec == tuple(told["best_bet"]["F_ior_arcsec"])


def test_what_is_known_is_ordered_as_ever():
    advice = advice_on("operation.M_g=4")
    assert (advice.word, advice.unknown, advice.decision.is_sampled) == ("TURN", (), False)


@pytest.mark.thorough
def test_unknown_direction_gives_a_card_that_says_any_hole(tmp_path):
    open_ = (SMALL, "--set", "phases.phi_hb=unknown", "--torque", "4", "--no-plot", "--draws", "16")
    done = run("mount", *open_, "--card", "card.txt", "-q", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "any\n")
    text = " ".join((tmp_path / "card.txt").read_text(encoding="utf-8").split())
    assert "Probability: ANY HOLE" in text
    assert "According to the known data, no hole is better than another." in text
    assert "also measure it for hole 0, hole 4, hole 8" in text
    given = run("mount", *open_, "--card", "card.txt", "--assume-phases", cwd=tmp_path)
    assert (given.returncode, "--set phases.phi_hb=0" in given.stderr) == (2, True)


def test_a_seats_ovality_stands_still_while_the_wheel_turns(reference):
    alpha = np.linspace(0, 6, 5)
    for name, moves in (("b", True), ("s", False)):
        drive = changed(reference, **{f"harmonics__a_{name}2": 3.0, f"harmonics__xi_{name}2": 20.0})
        here, there = (deviation_scalars(each, alpha, -alpha)[:, 6:8] for each in (drive, rotated(drive, 30.0)))
        assert np.allclose(here, there) != moves
