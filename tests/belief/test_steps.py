"""What it would take: each step beside a check of the drive that is changed so, and the questions' answers."""

import pytest

from hdassist import load_preset
from hdassist.belief.steps import steps_of
from hdassist.design import check
from tests.process import TINY

OPEN = (
    "source.supports.C_3={kind: assumed, range: [1000, 8000], ref: judged}",
    "source.gears.j_n={kind: assumed, range: [16, 20], ref: judged}",
    "phases.xi_b=90±20", "mounting.holes=6", "operation.M_g=4", "acceptance.F_ior=2040",
)  # fmt: skip


@pytest.fixture(scope="module")
def held():
    return check(load_preset(TINY, OPEN))


def test_a_step_is_what_a_check_of_the_changed_drive_says(held):
    steps = {(each.kind, each.of): each.outcomes[0] for each in held.steps}
    now = held.points[0].probability.value
    (hole,) = (each.of for each in held.steps if each.kind == "hole")
    for key, change in (
        (("tolerance", "tolerances.F_i1"), f"tolerances.F_i1={40 * 2 / 3}"),
        (("tolerance", "tolerances.e_hb"), f"tolerances.e_hb={30 * 2 / 3}"),
        (("hole", hole), f"phases.xi_b={90 + 60 * int(hole)}±20"),
    ):
        (point,) = check(load_preset(TINY, (*OPEN, change))).points
        # medians of 64 samples have a standard error of 4 %, each
        assert steps[key].p50 == pytest.approx(point.belief.p50, rel=0.1)
        assert steps[key].probability == pytest.approx(point.probability.value, abs=0.12)
        assert point.probability.value > now


def test_steps_stand_by_their_gain_and_none_worsens_the_drive(held):
    gains = [each.gain for each in held.steps]
    assert gains == sorted(gains, reverse=True) and gains[-1] > 0
    now = held.points[0].probability.value
    assert all(each.outcomes[0].probability > now for each in held.steps if each.kind != "question")


def test_the_answers_to_a_question_make_up_the_probability_now(held):
    asked = [each for each in held.steps if each.kind == "question" and each.of != "cam.coupling"]
    for each in asked:
        chances = [outcome.chance for outcome in each.outcomes]
        assert sum(chances) == pytest.approx(1)
        kept = sum(outcome.chance * outcome.probability for outcome in each.outcomes)
        samples = held.samples
        inside = samples.F_ior_arcsec[:, 0] <= held.points[0].left_arcsec
        assert kept == pytest.approx(samples.weights @ inside / samples.weights.sum())


def test_the_coupling_is_asked_for_where_it_is_open_and_is_a_step_where_it_is_not(held):
    (asked,) = (each for each in held.steps if each.of == "cam.coupling")
    oldham, solid = asked.outcomes
    assert (oldham.answer, solid.answer) == ("oldham", "solid")
    assert oldham.probability > held.points[0].probability.value > solid.probability
    known = check(load_preset(TINY, ("operation.M_g=4", "cam.coupling=solid", "acceptance.F_ior=2040")))
    kinds = {(each.kind, each.of) for each in known.steps}
    assert ("coupling", "oldham") in kinds and ("question", "cam.coupling") not in kinds
    floats = check(load_preset(TINY, ("operation.M_g=4", "cam.coupling=oldham")))
    assert not any(each.of in ("oldham", "cam.coupling") for each in floats.steps)


def test_what_is_surely_kept_takes_nothing():
    assert check(load_preset(TINY, (*OPEN, "acceptance.F_ior=9000")), draws=8).steps == ()


def test_steps_are_the_same_from_kept_answers(held):
    left = [point.left_arcsec for point in held.points]
    again, proof = steps_of(held.prior, held.samples, (4.0,), 0, left)
    assert (again, proof) == (held.steps, held.steps_proof)
