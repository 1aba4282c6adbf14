"""One question, one number: what every command states of the same drive, to the last digit."""

import json

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.belief.draws import turn_of_test_deg
from hdassist.belief.evidence import evidence_of
from hdassist.belief.prior import prior_of
from hdassist.belief.samples import SamplingEffort, draw_samples
from hdassist.drive.error.error_map import ErrorMap
from hdassist.features.correction.correct import correction_of
from hdassist.features.correction.forms import CorrectionForm
from hdassist.features.mounting.positions import rotated
from hdassist.run.run import Run
from tests.helpers.process import TINY, run

AT_4 = "operation.M_g=4"
SEAT = ("source.supports.C_3={kind: assumed, range: [1000, 8000], ref: judged}", "mounting.holes=6", AT_4)
ANY_DIRECTION = (*SEAT, "phases.xi_b=unknown", "acceptance.F_ior=2040")
DIRECTIONS = (*SEAT, "phases.xi_b=90", "acceptance.F_ior=2040")


def answer(command: str, overrides: tuple[str, ...], *options: str) -> dict:
    """Return the JSON of a command on the tiny drive."""
    changes = [word for each in overrides for word in ("--set", each)]
    return json.loads(run(command, TINY, *options, *changes, "--draws", "16", "--json").stdout)


@pytest.mark.usefixtures("kept")
@pytest.mark.parametrize("overrides", [ANY_DIRECTION, pytest.param(DIRECTIONS, marks=pytest.mark.thorough)])
def test_each_command_states_the_same_median_and_probability(overrides):
    (point,) = answer("check", overrides)["operating_points"]
    now = point["belief"]
    mounted = answer("mount", overrides)
    (present,) = (each for each in mounted["positions"] if each["hole"] == 0)
    assert present["F_ior_arcsec"] == {name: [now[f"{name}_arcsec"]] for name in ("p5", "p50", "p95")}
    assert present["probability_kept"] == now["probability"]
    report = answer("report", overrides)
    assert report["check"]["operating_points"] == [point]
    compared = answer("compare", overrides, TINY)["presets"][0]["operating_points"]
    assert [each["belief"] for each in compared] == [now]
    (accepted,) = answer("accept", overrides)["checks"]
    assert accepted["belief"]["probability"] == now["probability"]
    planned = answer("plan", overrides)
    assert planned["F_ior_arcsec"]["p50"] == now["p50_arcsec"]
    assert planned["beyond_limit"]["value"] == pytest.approx(1 - now["probability"])
    corrected = answer("compensate", overrides)["forms"]
    assert {each["residuals"][0]["uncorrected_p50"] for each in corrected} == {now["p50_arcsec"]}


@pytest.mark.usefixtures("kept")
def test_equivalent_holes_have_the_number_of_the_present_hole():
    mounted = answer("mount", ANY_DIRECTION)
    assert mounted["word"] == "ANY_HOLE"
    for name in ("F_ior_arcsec", "expected_loss", "probability_good", "probability_kept"):
        assert [each[name] for each in mounted["positions"]] == [mounted["positions"][0][name]] * 6
    others = {each["probability_better"] for each in mounted["positions"] if each["hole"]}
    assert len(others) == 1 and 0 < others.pop() < 1


def test_the_accuracy_of_a_drive_was_tested_in_any_hole():
    drive = load_preset(TINY, (*ANY_DIRECTION, "catalogue.accuracy=2500"))
    turns = [turn_of_test_deg(drive, [0, number]) for number in range(60)]
    assert {*turns} == {60.0 * k for k in range(6)}
    prior = prior_of(drive)
    samples = draw_samples(prior, (4.0,), evidence=evidence_of(drive), effort=SamplingEffort(4, 4, 8, 4))
    rows = [k for k, draw in enumerate(samples.made) if draw.F_ior_arcsec is not None]
    for values, number in zip(samples.values(), rows, strict=True):
        sample = rotated(drive.with_values(values), turns[number])
        tested = ErrorMap(sample, 0.02 * sample.rated_torque).extremes(sample).first
        assert samples.made[number].figures["accuracy"] == pytest.approx(tested, abs=1e-6)


def test_no_hole_is_tried_where_all_are_the_same():
    floating = load_preset(TINY, (*SEAT, "cam.coupling=oldham", "catalogue.accuracy=2500"))
    assert {turn_of_test_deg(floating, [0, number]) for number in range(8)} == {0.0}


def test_what_a_correction_misses_is_that_of_several_drives():
    """The order of equally likely drives says nothing, so it may not decide what a correction leaves."""
    drive = load_preset(TINY, (*DIRECTIONS, "tolerances.f_p2=30", "phases.xi_b=90 ± 40"))
    prior = prior_of(drive)
    samples = draw_samples(prior, (4.0,), effort=SamplingEffort(8, 8, 16, 8))
    drives, form = samples.values()[:8], CorrectionForm(None, 20)
    left = []
    for first in range(3):
        order = [*drives[first:], *drives[:first]]
        F_ior = np.roll(samples.F_ior_arcsec[:8], -first, axis=0)
        found = correction_of(drive, order, {}, form, Run(), samples=samples, F_ior_arcsec=F_ior)
        left.append(found.chosen.residuals[0].p50)
    assert left == pytest.approx([left[0]] * 3, rel=1e-9)
