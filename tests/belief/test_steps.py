"""What it would take: each option and answer is carried out through the command line, and compared."""

import json
from unittest import mock

import pytest

from hdassist import load_preset
from hdassist.belief.options import steps_of
from hdassist.features.correction.correct import correct
from hdassist.features.correction.forms import CorrectionForm
from hdassist.features.design import DesignCheck, check
from hdassist.features.mounting.advice import advise
from hdassist.features.mounting.positions import seat_positions
from tests.helpers.process import TINY, run

OPEN = (
    "source.supports.C_3={kind: assumed, range: [1000, 8000], ref: judged}",
    "source.gears.j_n={kind: assumed, range: [16, 20], ref: judged}",
    "phases.xi_b=90 ± 20", "mounting.holes=6", "operation.M_g=4", "acceptance.F_ior=2040",
)  # fmt: skip
SIZES = (  # one of each way in which a size may be known
    "tolerances.F_i1=40 ± 8", "source.tolerances.F_i2={kind: assumed, range: [20, 60], ref: drawing}",
    "tolerances.e_hb=unknown", "tolerances.e_hh=12",
)  # fmt: skip
TESTED = "catalogue.accuracy=130"


@pytest.fixture(scope="module")
def held():
    return check(load_preset(TINY, OPEN))


def carried_out(overrides, edit) -> dict:
    """Return the point of a check of the edited preset, by the command line, without what it would take from there."""
    words = [word for each in (*overrides, *edit) for word in ("--set", each)]
    with mock.patch.object(DesignCheck, "with_steps", lambda self, _run: self):
        (point,) = json.loads(run("check", TINY, *words, "--draws", "32", "--json").stdout)["operating_points"]
    return point["belief"]


@pytest.mark.thorough
@pytest.mark.usefixtures("kept")
@pytest.mark.parametrize(
    "overrides",
    [OPEN, (*OPEN, *SIZES), ("cam.coupling=solid", "operation.M_g=4", "acceptance.F_ior=2100"), (*OPEN, TESTED)],
)
def test_options_agree_with_check_of_the_edited_preset(overrides):
    drive = load_preset(TINY, overrides)
    found = check(drive, draws=32)
    kinds = {step.kind for step in found.steps}
    assert {"tolerance", "coupling"} <= kinds
    for step in found.steps:
        edits = [(outcome.edit, outcome) for outcome in step.outcomes]
        if not step.is_question:
            edits = [(step.edit, step.outcomes[0])]
        for edit, outcome in edits:
            if not edit:
                assert step.needs in ("values in holes", "recording")
                continue
            belief = carried_out(overrides, edit)
            # the same random numbers where the edit leaves the same inputs open; else two sets of 32 samples, or of 16
            is_same = step.kind in ("tolerance", "hole")
            assert outcome.probability == pytest.approx(belief["probability"], abs=0.03 if is_same else 0.2)
            # samples that the limit settles have the factors of others: a third of the standard error of the median
            assert outcome.p50 == pytest.approx(belief["p50_arcsec"], rel=0.04 if is_same else 0.15)
            assert outcome.probability_low <= outcome.probability <= outcome.probability_high


@pytest.mark.thorough
def test_a_tighter_wheel_has_a_tighter_pitch_and_smaller_harmonics():
    """What a preset leaves unknown is bounded by F'_i, so it is tightened with it."""
    open_ = ("tolerances.f_p2=unknown", "harmonics.a_b2=unknown", "phases.xi_b=90", "operation.M_g=4")
    open_ = (*open_, "acceptance.F_ior=2050")
    drive = load_preset(TINY, open_)
    found = check(drive, draws=16)
    (step,) = (each for each in found.steps if each.of == "tolerances.F_i2")
    belief = check(load_preset(TINY, (*open_, *step.edit)), draws=16).points[0].belief
    alone = check(load_preset(TINY, (*open_, *step.edit, "tolerances.f_p2=0")), draws=16)
    assert step.outcomes[0].p50 == pytest.approx(belief.p50, rel=1e-6)
    assert alone.points[0].belief.p50 != pytest.approx(belief.p50, rel=1e-3)


@pytest.mark.thorough
def test_reference_data_are_reapplied_only_to_an_edited_drive():
    found = check(load_preset(TINY, (*OPEN, TESTED)), draws=16)
    applied = {step.kind: step.reference_data for step in found.steps}
    assert applied["tolerance"] == "applied again"
    assert {applied[kind] for kind in ("hole", "trials", "correction") if kind in applied} == {"kept"}


@pytest.mark.thorough
def test_a_better_accuracy_of_the_catalogue_is_an_option():
    sheet = (*OPEN[:4], "operation.M_g=2", "operation.rated=50", "catalogue.accuracy=90")
    found = check(load_preset(TINY, sheet), draws=32)
    (grade,) = (step for step in found.steps if step.kind == "accuracy")
    assert grade.edit == ("catalogue.accuracy=60",)
    belief = carried_out(sheet, grade.edit)
    assert grade.outcomes[0].p50 == pytest.approx(belief["p50_arcsec"], rel=0.1)
    assert grade.outcomes[0].p50 < found.points[0].belief.p50


@pytest.mark.thorough
def test_check_names_the_angle_of_mount_if_holes_are_absent():
    drive = load_preset(TINY, (*OPEN[:4], "mounting.holes=0", "phases.xi_b=75", "operation.M_g=[1, 4]"))
    (step,) = (step for step in check(drive, draws=16).steps if step.kind == "hole")
    turn_deg = advise(drive, seat_positions(drive), draws=16).chosen.rotation_deg
    assert turn_deg % 30 > 0  # no multiple of a coarser step
    assert step.of == f"{turn_deg:g}"


@pytest.mark.thorough
def test_check_names_the_hole_of_mount():
    """With a limit, and without one: each of the torques alone would choose another hole."""
    for limit in ("acceptance.F_ior=2060", "name=any"):
        drive = load_preset(TINY, (*OPEN[:4], limit, "operation.M_g=[1, 4]"))
        found, advice = check(drive, draws=16), advise(drive, seat_positions(drive), draws=16)
        (hole,) = (step for step in found.steps if step.kind == "hole")
        assert hole.of == str(advice.chosen.hole)
        torque = found.samples.torques.index(found.points[found.governing].M_g)
        # another number of holes at once rounds otherwise
        assert hole.outcomes[0].p50 == pytest.approx(advice.chosen.F_ior_arcsec[torque], rel=1e-12)


def test_what_a_correction_leaves_is_what_compensate_states():
    found = check(load_preset(TINY, ("operation.M_g=4", "acceptance.F_ior=1950")))
    (step,) = (each for each in found.steps if each.kind == "correction")
    assert (step.needs, step.edit) == ("recording", ())
    corrected = correct(load_preset(TINY, ["operation.M_g=4"]), form=CorrectionForm(None, int(step.of)), draws=0)
    (form,) = (each for each in corrected.forms if each.form.name == f"{step.of} phasors")
    # two ways of computing what is left, of which one adds in squares what lines miss
    assert step.outcomes[0].p50 == pytest.approx(form.residuals[0].p50, rel=0.1)


@pytest.mark.thorough
def test_options_precede_questions_by_gain_and_none_worsens_the_drive(held):
    options = [each for each in held.steps if not each.is_question]
    questions = [each for each in held.steps if each.is_question]
    assert [*held.steps] == [*options, *questions]
    for some in (options, questions):
        gains = [each.gain for each in some]
        assert gains == sorted(gains, reverse=True) and gains[-1] > 0
    now = held.points[0].probability.value
    assert all(each.outcomes[0].probability > now for each in options)


@pytest.mark.thorough
def test_the_answers_to_a_question_make_up_the_probability_now(held):
    asked = [each for each in held.steps if each.kind == "question" and each.of != "cam.coupling"]
    for each in asked:
        chances = [outcome.chance for outcome in each.outcomes]
        assert sum(chances) == pytest.approx(1)
        kept = sum(outcome.chance * outcome.probability for outcome in each.outcomes)
        samples = held.samples.of_ranges
        inside = samples.F_ior_arcsec[:, 0] <= held.points[0].left_arcsec
        assert kept == pytest.approx(samples.weights @ inside / samples.weights.sum())


@pytest.mark.thorough
def test_coupling_is_a_question_if_unknown_and_an_option_otherwise(held):
    (asked,) = (each for each in held.steps if each.of == "cam.coupling")
    oldham, solid = asked.outcomes
    assert (oldham.answer, solid.answer) == ("oldham", "solid")
    assert oldham.probability > held.points[0].probability.value > solid.probability
    (option,) = (each for each in held.steps if each.kind == "coupling")  # a user may order it, too
    assert (option.of, option.edit, option.outcomes[0].p50) == ("oldham", ("cam.coupling=oldham",), oldham.p50)
    known = check(load_preset(TINY, ("operation.M_g=4", "cam.coupling=solid", "acceptance.F_ior=2040")))
    kinds = {(each.kind, each.of) for each in known.steps}
    assert ("coupling", "oldham") in kinds and ("question", "cam.coupling") not in kinds
    floats = check(load_preset(TINY, ("operation.M_g=4", "cam.coupling=oldham")))
    assert not any(each.of in ("oldham", "cam.coupling") for each in floats.steps)


def test_what_is_surely_kept_takes_nothing():
    assert check(load_preset(TINY, (*OPEN, "acceptance.F_ior=9000")), draws=8).steps == ()


@pytest.mark.thorough
def test_steps_are_the_same_from_kept_answers(held):
    left = [point.left_arcsec for point in held.points]
    again, proof = steps_of(held.prior, held.samples, (4.0,), 0, left, middle=held.points[0].error)
    assert (again, proof) == (held.steps, held.steps_proof)
