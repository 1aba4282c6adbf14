"""The advice on where to mount the fixed wheel: holes, weights, free angles, uncertainty, words."""

from dataclasses import replace

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.error.error_map import ErrorMap
from hdassist.errors import UsageError
from hdassist.mounting.advice import Advice
from hdassist.mounting.curve import mounting_curve
from hdassist.mounting.losses import Criterion, PositionStatistics
from hdassist.mounting.positions import MountingCurve, rotated, seat_positions
from hdassist.pages.mount import mount_report
from hdassist.pages.seat import instruction, seat_of, turn
from hdassist.run.run import UNCHECKED
from hdassist.solve.answers import EMPTY
from hdassist.terminal.seat import seat_in_characters
from hdassist.terminal.texts import texts
from tests.process import SMALL


def curve_of(*values: list[float], holes: int = 12, **options) -> MountingCurve:
    count = len(values[0])
    rotations = np.arange(count) * 360.0 / count
    torques = tuple(float(k + 1) for k in range(len(values)))
    every = np.ones(np.shape(values), dtype=bool)
    return MountingCurve(torques, rotations, rotations, np.array(values), EMPTY, (), every, holes=holes, **options)


def advice_of(curve: MountingCurve) -> Advice:
    return Advice(load_preset(SMALL), curve)


def test_only_allowed_holes_are_recommended():
    values = [20.0, 9.0, 8.0, 7.0, 30.0, 6.0]
    assert curve_of(values, holes=6).recommended.hole == 5
    some = curve_of(values, holes=6, allowed=(1, 2, 4))
    assert [p.hole for p in some.ranked] == [2, 1, 4]
    # the present hole is not among them: it has to be left, even for a worse one
    forced = curve_of([5.0, 9.0, 8.0, 7.0, 30.0, 6.0], holes=6, allowed=(1, 2))
    assert advice_of(forced).worth_turning
    assert mount_report(advice_of(forced), 0).line == "2"
    drive = load_preset(SMALL, ["mounting.allowed=[2,5]"])
    assert seat_positions(drive) == [0, 60, 150]


def test_positions_between_the_holes_are_shown_and_not_recommended():
    curve = curve_of([20.0, 1.0, 9.0, 2.0, 8.0, 3.0], holes=3)
    assert curve.recommended.rotation_deg == 240
    assert curve.F_ior_arcsec[0].argmin() == 1 and curve.at(1).hole is None


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
    curve = mounting_curve(drive, [4.0], seat_positions(drive, free_step=15.0), run=UNCHECKED)
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
    assert mount_report(advice_of(curve_of([10.0, 9.95, 12.0], holes=3)), 0).line == "0"
    assert instruction(advice_of(curve_of([10.0, 11.0, 12.0], holes=3)).choice) == "Leave the rigid wheel as it is."


def test_the_instruction_takes_the_shorter_way():
    curve = curve_of([20.0, 9.0, 30.0, 8.0], holes=4)
    assert turn(curve.at(1)) == "1 hole (90°) counter-clockwise"
    assert turn(curve.at(2)) == "2 holes (180°) counter-clockwise"
    assert turn(curve.at(3)) == "1 hole (90°) clockwise"
    said = instruction(advice_of(curve).choice)
    assert said.startswith("Turn the rigid wheel by 1 hole (90°) clockwise, seen from the cam side: ")
    assert "20.00 -> 8.00″ at 1 N" in said
    free = curve_of([20.0, 9.0, 30.0, 8.0], holes=0)
    assert turn(free.at(1)) == "90° counter-clockwise"


@pytest.mark.moves("mounting.first_hole")
def test_the_seat_shows_where_holes_lie():
    drive = load_preset(SMALL)
    curve = curve_of([20.0, 9.0, 30.0, 8.0], holes=4)

    def where(letter: str, first_hole: float) -> tuple[float, float]:
        there = drive.model_copy(
            update={"mounting": drive.mounting.model_copy(update={"first_hole": first_hole, "holes": 4})}
        )
        choice = Advice(there, curve).choice
        rows = seat_in_characters(seat_of(choice, texts(), choice.chosen)).split("\n")
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


def statistics(*rows: list[float], now: float = 10.0, weights: list[float] | None = None) -> PositionStatistics:
    """Statistics of samples at one torque, a row each, hole 0 having what now says."""
    F_ior = np.array([[now, *row] for row in rows])[None]
    rotations = tuple(360.0 * k / F_ior.shape[2] for k in range(F_ior.shape[2]))
    return PositionStatistics(
        rotations, F_ior, F_ior[..., 0], np.array(weights or [1.0] * len(rows)), Criterion.of("expected"),
        against_now=True,
    )  # fmt: skip


def test_probabilities_and_criteria_are_those_of_the_weighted_samples():
    rng = np.random.default_rng(0)
    rows, weights = rng.uniform(5, 15, (40, 3)), rng.uniform(0.1, 1, 40)
    found = statistics(*rows.tolist(), weights=weights.tolist())
    share, F_ior = weights / weights.sum(), found.F_ior_arcsec[0]
    lost = F_ior / F_ior.min(axis=1, keepdims=True) - 1
    best = np.argmin(lost, axis=1)
    assert found.probability_best == pytest.approx(np.bincount(best, share, minlength=4), abs=0.03)
    assert found.probability_best.sum() == pytest.approx(1)
    assert found.best == np.argmin(share @ lost)
    assert found.gains(2) == pytest.approx(1 - F_ior[:, 2] / 10)
    assert found.best_gains == pytest.approx(1 - F_ior.min(axis=1) / 10)
    assert found.probability_gain(2).value == pytest.approx(share @ (F_ior[:, 2] < 9.9))
    assert found.probability_close(0).value == pytest.approx(share @ (lost[:, 0] < 0.05))
    assert replace(found, criterion=Criterion.of("worst")).best == np.argmin(lost.max(axis=0))
    equal = replace(found, sample_weights=np.ones(40))
    middle = np.quantile(F_ior[:, 1], 0.5, method="hazen")
    assert equal.quantile(0.5, 1) == pytest.approx((middle,))
    quantiles = Criterion.of("quantile=0.9").over(lost, np.ones(40))
    assert quantiles == pytest.approx(np.quantile(lost, 0.9, axis=0, method="hazen"))


def test_the_torque_served_worst_decides_over_samples_too():
    light, heavy = np.array([[20.0, 10.0, 18.0]]), np.array([[10.0, 12.0, 5.0]])
    F_ior = np.stack([light, heavy])
    found = PositionStatistics(
        (0.0, 120.0, 240.0), F_ior, F_ior[..., 0], np.ones(1), Criterion.of("expected"), against_now=True
    )
    assert found.rotations_deg[found.best] == 240
    assert replace(found, weights=(20.0, 10.0)).rotations_deg[replace(found, weights=(20.0, 10.0)).best] == 120
    assert found.gains(1) == pytest.approx([-0.2])


@pytest.mark.parametrize(
    ("rows", "order"),
    [
        ([[5.0]] * 80, "turn"),  # a gain in all samples
        ([[5.0]] * 70 + [[12.0]] * 10, "none"),  # in 88 %
        ([[12.0]] * 70 + [[9.0]] * 10, "none"),  # the wheel stands well, but in 12 % another hole is better
        ([[12.0]] * 80, "leave"),
        ([[9.8]] * 40 + [[10.2]] * 40, "leave"),  # which is better is not known, and hardly matters
        ([[9.95]] * 80, "leave"),  # less than a hundredth
    ],
)
def test_an_order_takes_the_probability_that_the_verdicts_take(rows, order):
    found = statistics(*rows)
    curve = curve_of([10.0, 9.0], holes=2)
    advice = Advice(
        load_preset(SMALL), curve, positions=found, gain_probability=found.probability_gain(found.challenger),
        stay_probability=found.probability_close(0),
    )  # fmt: skip
    assert advice.order == order
    assert advice.choice.turn == (order == "turn")


@pytest.mark.parametrize("text", ["", "best", "quantile=2", "quantile=", "quantile:0.9", "quantile=x"])
def test_unknown_criteria(text):
    with pytest.raises(UsageError, match="invalid criterion"):
        Criterion.of(text)
