"""The race of the options: few samples are solved with every edit, others only where they decide."""

from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.belief import effects
from hdassist.belief.effects import Effect, _donors, _undecided
from hdassist.features.design import check
from hdassist.features.mounting.advice import advise
from hdassist.features.mounting.positions import seat_positions
from tests.belief.test_steps import OPEN, SIZES
from tests.helpers.process import TINY

LEFT = 50.0  # arcsec


def effect(*rows: tuple[float, ...], solved: tuple[int, ...] = ()) -> Effect:
    """Return an effect on samples of the same weight, by their F'_ior with the factors of their donors."""
    F_ior = np.array(rows)
    weights = np.full(F_ior.shape, 1 / F_ior.shape[1])
    return Effect(F_ior, weights, np.isin(np.arange(len(rows)), solved))


def test_sample_is_settled_if_its_donors_agree():
    found = effect((40, 45), (45, 55), (55, 60), (45, 55), solved=(3,))
    assert found.unsettled(LEFT).tolist() == [False, True, False, False]
    assert found.met(LEFT).tolist() == [1, 0.5, 0, 0.5]
    assert found.bounds(LEFT) == pytest.approx((0.375, 0.625))
    assert not found.unsettled(None).any()
    likelihood = Effect(found.F_ior_arcsec, found.weights * [[1, 0.5], [1, 1], [1, 1], [1, 1]], found.is_solved)
    assert likelihood.unsettled(None).tolist() == [True, False, False, False]


def test_sample_takes_the_factors_of_its_nearest_solved_samples():
    F_ior = np.array([10.0, 11.0, 20.0, 21.0, 40.0])
    factor = np.array([0.5, np.nan, 0.7, np.nan, 0.9])
    with mock.patch.object(effects, "_DONORS", 2):
        donors = _donors(F_ior, np.zeros(5), factor)
    assert [sorted({*row}) for row in donors.tolist()] == [[0], [0, 2], [2], [2, 4], [4]]


def test_donors_for_another_coupling_have_a_similar_support():
    F_ior = np.array([20.0, 20.0, 19.0, 21.0])
    levels = np.array([0.0, 1.0, 0.9, 0.2])
    factor = np.array([0.5, 0.9, np.nan, np.nan])
    with mock.patch.object(effects, "_DONORS", 1):
        assert _donors(F_ior, levels, factor).ravel().tolist() == [0, 1, 1, 0]


def test_undecided_options_that_may_be_best_are_solved():
    samples = SimpleNamespace(room_arcsec=LEFT, all_sets=(np.full(4, 60.0), np.ones(4)), rows=range(4))
    sure = effect((40, 40), (40, 40), (40, 40), (60, 60))
    wide = effect((40, 60), (40, 60), (40, 60), (40, 60))
    poor = effect((60, 60), (60, 60), (40, 60), (40, 60))
    of = {"tolerance:a": sure, "tolerance:b": sure, "tolerance:c": sure, "tolerance:wide": wide, "tolerance:poor": poor}
    assert _undecided(samples, of) == {row: ["tolerance:wide"] for row in range(4)}
    # without three better ones it is a step too, unless it gains nothing
    assert _undecided(samples, {"tolerance:poor": poor}) == {2: ["tolerance:poor"], 3: ["tolerance:poor"]}
    kept = SimpleNamespace(room_arcsec=LEFT, all_sets=(np.array([40.0, 40, 60, 60]), np.ones(4)), rows=range(4))
    assert _undecided(kept, {"tolerance:poor": poor}) == {}


@pytest.mark.thorough
@pytest.mark.usefixtures("kept")
@pytest.mark.parametrize("limit", [2040, 2080])
def test_the_race_has_the_options_and_probabilities_of_all_samples(limit):
    drive = load_preset(TINY, (*OPEN, *SIZES, f"acceptance.F_ior={limit}"))
    solved = {}
    for first in (8, 1000):
        with mock.patch.object(effects, "_FIRST_SAMPLES", first):
            solved[first] = {(each.kind, each.of): each for each in check(drive, draws=32).steps}
    few, every = solved.values()
    options = [key for key, each in every.items() if not each.is_question]
    best = max(options, key=lambda key: every[key].gain)
    assert few[best].gain == pytest.approx(max(each.gain for each in few.values() if not each.is_question))
    for key in options:
        assert few[key].outcomes[0].probability == pytest.approx(every[key].outcomes[0].probability, abs=0.03)
    assert {key for key, each in few.items() if not each.is_question} == {*options}


@pytest.mark.thorough
def test_the_race_names_the_hole_of_mount():
    for limit in ("acceptance.F_ior=2060", "name=any"):
        drive = load_preset(TINY, (*OPEN[:4], limit, "operation.M_g=[1, 4]"))
        with mock.patch.object(effects, "_FIRST_SAMPLES", 4):
            (hole,) = (step for step in check(drive, draws=16).steps if step.kind == "hole")
        assert hole.of == str(advise(drive, seat_positions(drive), draws=16).chosen.hole)
