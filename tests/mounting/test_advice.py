"""The advice on where to mount the fixed wheel: holes, weights, free angles, uncertainty, words."""

from dataclasses import replace

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.error.error_map import ErrorMap
from hdassist.errors import UsageError
from hdassist.model.unknown import draw
from hdassist.mounting.advice import Advice, advise
from hdassist.mounting.curve import mounting_curve
from hdassist.mounting.losses import Criterion, Losses
from hdassist.mounting.page import summary_line, to_json
from hdassist.mounting.positions import MountingCurve, rotated, seat_positions
from hdassist.mounting.robust import robust
from hdassist.mounting.seat_page import instruction, seat_text, turn
from hdassist.solve.answers import EMPTY
from hdassist.terminal.console import Style
from tests.process import SMALL

LOOK = Style(ascii=True, codes=False, width=80)


def curve_of(*values: list[float], holes: int = 12, **options) -> MountingCurve:
    count = len(values[0])
    rotations = np.arange(count) * 360.0 / count
    torques = tuple(float(k + 1) for k in range(len(values)))
    every = np.ones(np.shape(values), dtype=bool)
    return MountingCurve(torques, rotations, rotations, np.array(values), EMPTY, (), every, holes=holes, **options)


def advice_of(curve: MountingCurve, sampled: Losses | None = None) -> Advice:
    return Advice(load_preset(SMALL), curve, sampled, (), (), ())


def test_only_allowed_holes_are_recommended():
    values = [20.0, 9.0, 8.0, 7.0, 30.0, 6.0]
    assert curve_of(values, holes=6).recommended.hole == 5
    some = curve_of(values, holes=6, allowed=(1, 2, 4))
    assert [p.hole for p in some.ranked] == [2, 1, 4]
    # the present hole is not among them: it has to be left, even for a worse one
    forced = curve_of([5.0, 9.0, 8.0, 7.0, 30.0, 6.0], holes=6, allowed=(1, 2))
    assert advice_of(forced).worth_turning
    assert summary_line(advice_of(forced)) == "2"
    drive = load_preset(SMALL, ["mounting.allowed=[2,5]"])
    assert seat_positions(drive) == [0, 60, 150]


def test_positions_between_the_holes_are_shown_and_not_recommended():
    curve = curve_of([20.0, 1.0, 9.0, 2.0, 8.0, 3.0], holes=3)
    assert curve.recommended.rotation_deg == 240
    assert curve.extremes(0)[0].rotation_deg == 60
    assert curve.at(1).hole is None


def test_weights_decide_between_torques():
    light, heavy = [20.0, 10.0, 18.0], [10.0, 12.0, 5.0]
    assert curve_of(light, heavy, holes=3).recommended.hole == 2
    assert curve_of(light, heavy, holes=3, weights=(2.0, 1.0)).recommended.hole == 1
    assert curve_of(light, heavy, holes=3, weights=(20.0, 10.0)).recommended.hole == 1


@pytest.mark.parametrize("weights", [[1.0], [1.0, 0.0], [1.0, -1.0], [1.0, float("nan")]])
def test_bad_weights(weights):
    with pytest.raises(UsageError, match="weights"):
        mounting_curve(load_preset(SMALL), [1.0, 4.0], [0.0], weights=weights)


def test_a_free_angle_is_as_good_as_brute_force_in_one_degree_steps():
    drive = load_preset(SMALL, ["mounting.holes=0"])
    curve = mounting_curve(drive, [4.0], seat_positions(drive, free_step=15.0), cross_check=None)
    search = ErrorMap(drive, 4.0)
    around = np.arange(-20, 21) + round(curve.recommended.rotation_deg)
    brute = min(search.extremes(rotated(drive, float(r))).first for r in around)
    assert curve.recommended.F_ior_arcsec[0] <= brute + 0.05
    # no position of the coarse curve is better, and the bottom of the valley is none of them
    assert curve.recommended.F_ior_arcsec[0] <= curve.F_ior_arcsec[0, :24].min()
    assert curve.recommended.rotation_deg % 15 != 0
    assert curve.recommended.hole is None


def test_no_gain_means_stay():
    assert not advice_of(curve_of([10.0, 11.0, 12.0], holes=3)).worth_turning
    # less than a hundredth is nothing
    assert not advice_of(curve_of([10.0, 9.95, 12.0], holes=3)).worth_turning
    assert advice_of(curve_of([10.0, 9.8, 12.0], holes=3)).worth_turning
    assert summary_line(advice_of(curve_of([10.0, 9.95, 12.0], holes=3))) == "0"
    assert instruction(advice_of(curve_of([10.0, 11.0, 12.0], holes=3)).choice) == "Leave the rigid wheel as it is."


def test_the_instruction_takes_the_shorter_way():
    curve = curve_of([20.0, 9.0, 30.0, 8.0], holes=4)
    assert turn(curve.at(1)) == "1 hole (90 deg) counter-clockwise"
    assert turn(curve.at(2)) == "2 holes (180 deg) counter-clockwise"
    assert turn(curve.at(3)) == "1 hole (90 deg) clockwise"
    said = instruction(advice_of(curve).choice)
    assert said.startswith("Turn the rigid wheel by 1 hole (90 deg) clockwise, seen from the cam side: ")
    assert "20.00 -> 8.00 arcsec at 1 N" in said
    free = curve_of([20.0, 9.0, 30.0, 8.0], holes=0)
    assert turn(free.at(1)) == "90 deg counter-clockwise"


@pytest.mark.moves("mounting.first_hole")
def test_the_seat_shows_where_holes_lie():
    drive = load_preset(SMALL)
    curve = curve_of([20.0, 9.0, 30.0, 8.0], holes=4)

    def where(letter: str, first_hole: float) -> tuple[float, float]:
        there = drive.model_copy(
            update={"mounting": drive.mounting.model_copy(update={"first_hole": first_hole, "holes": 4})}
        )
        rows = seat_text(Advice(there, curve, None, (), (), ()).choice, LOOK).split("\n\nseat")[0].split("\n")
        ((row, column),) = [(r, line.index(letter)) for r, line in enumerate(rows) if letter in line]
        return column - 20, 7 - row

    x, y = where("N", 0.0)  # now: hole 0, on the right
    assert x > 10
    assert y == 0
    x, y = where("B", 0.0)  # three holes of four counter-clockwise: below
    assert (x, y < -4) == (0, True)
    x, y = where("W", 0.0)  # opposite
    assert (x < -10, y) == (True, 0)
    x, y = where("N", 90.0)  # hole 0 on top
    assert (x, y > 4) == (0, True)


UNSURE = ["uncertainty.phases.xi_b=60", "uncertainty.tolerances.e_hb=20", "mounting.holes=6"]


@pytest.fixture(scope="module")
def sampled() -> tuple[MountingCurve, Losses]:
    drive = load_preset(SMALL, UNSURE)
    curve = mounting_curve(drive, [4.0], seat_positions(drive), cross_check=None)
    return curve, robust(drive, curve, samples=64, seed=1)


def test_samples_are_drawn_as_the_preset_says():
    drive = load_preset(SMALL, UNSURE)
    drawn = draw(drive, 4000, seed=3)
    xi_b = np.array([d.phases.xi_b for d in drawn])
    e_hb = np.array([d.tolerances.e_hb for d in drawn])
    # expanded uncertainty: two standard deviations
    assert xi_b.mean() == pytest.approx(90, abs=2)
    assert xi_b.std() == pytest.approx(30, rel=0.05)
    assert e_hb.std() == pytest.approx(10, rel=0.05)
    assert abs(np.corrcoef(xi_b, e_hb)[0, 1]) < 0.05
    assert drawn[7] == draw(drive, 10, seed=3)[7]
    assert drawn[7] != draw(drive, 10, seed=4)[7]
    wide = draw(load_preset(SMALL, ["uncertainty.tolerances.e_hb=200"]), 50, seed=0)
    assert min(d.tolerances.e_hb for d in wide) == 0


def test_probabilities_and_criteria_are_those_of_the_samples(sampled):
    _, found = sampled
    F_ior = found.F_ior_arcsec[0]
    assert F_ior.shape == (64, 6)
    lost = F_ior / F_ior.min(axis=1, keepdims=True) - 1
    best = np.argmin(lost, axis=1)
    assert found.probability_best == pytest.approx(np.bincount(best, minlength=6) / 64, abs=0.03)
    assert found.probability_best.sum() == pytest.approx(1)
    assert found.best == np.argmin(lost.mean(axis=0))
    assert found.gain == pytest.approx(1 - F_ior[:, found.best].mean() / found.now_arcsec.mean())
    assert found.probability_gain == np.mean(F_ior[:, found.best] < found.now_arcsec[0])
    assert replace(found, criterion=Criterion.of("worst")).best == np.argmin(lost.max(axis=0))
    assert Criterion.of("quantile:0.9").over(lost) == pytest.approx(np.quantile(lost, 0.9, axis=0))


def test_without_spread_the_choice_is_the_curves():
    drive = load_preset(SMALL, ["uncertainty.phases.xi_b=0.001", "mounting.holes=6"])
    advice = advise(drive, [4.0], seat_positions(drive), samples=4, cross_check=None)
    assert advice.robust is not None
    assert advice.chosen == advice.curve.recommended
    assert advice.robust.probability_best.max() == 1
    assert advice.robust.probability_gain == 1
    assert advice.worth_turning
    told = to_json(advice, 0)
    best = told["uncertainty"]["best_bet"]
    assert (best["rotation_deg"], best["probability_best"]) == (advice.chosen.rotation_deg, 1)
    assert told["uncertainty"]["fields"] == {"phases.xi_b": 0.001}


def test_a_gain_below_the_uncertainty_is_left_alone(sampled):
    curve, found = sampled
    certain = advice_of(curve, found)
    assert certain.worth_turning == (found.probability_gain >= 0.95)
    # half the samples say the other way
    unsure = replace(found, now_arcsec=np.full((1, 64), np.median(found.at(found.best))))
    assert not advice_of(curve, unsure).worth_turning


@pytest.mark.parametrize("text", ["", "best", "quantile:2", "quantile:", "quantile:x"])
def test_unknown_criteria(text):
    with pytest.raises(UsageError, match="no criterion"):
        Criterion.of(text)


def test_what_cannot_be_sampled_is_said():
    drive = load_preset(SMALL)
    with pytest.raises(UsageError, match="gives no uncertainty"):
        robust(drive, curve_of([1.0, 2.0], holes=2))
    rolling = load_preset(SMALL, [*UNSURE, "bearing.ball_motion=rolling", "bearing.d_ball=3"])
    with pytest.raises(UsageError, match="locked"):
        robust(rolling, curve_of([1.0, 2.0], holes=2))
