"""The advice on where to mount the fixed wheel: holes, uncertainty, words."""

from dataclasses import replace

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.belief.statistics import probability_of
from hdassist.mounting.advice import Advice
from hdassist.mounting.losses import PositionStatistics
from hdassist.mounting.positions import MountingCurve, seat_positions
from hdassist.pages.mount import mount_report
from hdassist.pages.seat import instruction, seat_of, turn
from hdassist.solve.answers import EMPTY
from hdassist.terminal.plot import seat_in_characters
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
    assert advice_of(forced).order == "turn"
    assert mount_report(advice_of(forced), 0).line == "2"
    drive = load_preset(SMALL, ["mounting.allowed=[2,5]"])
    assert seat_positions(drive) == [0, 60, 150]


def test_positions_between_the_holes_are_shown_and_not_recommended():
    curve = curve_of([20.0, 1.0, 9.0, 2.0, 8.0, 3.0], holes=3)
    assert curve.recommended.rotation_deg == 240
    assert curve.F_ior_arcsec[0].argmin() == 1 and curve.at(1).hole is None


def test_no_gain_means_stay():
    assert advice_of(curve_of([10.0, 11.0, 12.0], holes=3)).order != "turn"
    # less than a hundredth is nothing
    assert advice_of(curve_of([10.0, 9.95, 12.0], holes=3)).order != "turn"
    assert advice_of(curve_of([10.0, 9.8, 12.0], holes=3)).order == "turn"
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
        rotations, F_ior, F_ior[..., 0], np.array(weights or [1.0] * len(rows)), against_now=True
    )  # fmt: skip


def test_probabilities_are_those_of_the_weighted_samples():
    rng = np.random.default_rng(0)
    rows, weights = rng.uniform(5, 15, (40, 3)), rng.uniform(0.1, 1, 40)
    found = statistics(*rows.tolist(), weights=weights.tolist())
    share, F_ior = weights / weights.sum(), found.F_ior_arcsec[0]
    lost = F_ior / F_ior.min(axis=1, keepdims=True) - 1
    assert found.best == np.argmin(share @ lost)
    assert found.gains(2) == pytest.approx(1 - F_ior[:, 2] / 10)
    assert found.best_gains == pytest.approx(1 - F_ior.min(axis=1) / 10)
    assert found.is_better(2).tolist() == (F_ior[:, 2] < 9.9).tolist()
    assert found.is_close(0).tolist() == (lost[:, 0] < 0.05).tolist()
    assert found.probability_good == pytest.approx(share @ (lost < 0.05))
    equal = replace(found, sample_weights=np.ones(40))
    middle = np.quantile(F_ior[:, 1], 0.5, method="hazen")
    assert equal.quantile(0.5, 1) == pytest.approx((middle,))


def test_the_torque_served_worst_decides_over_samples_too():
    light, heavy = np.array([[20.0, 10.0, 18.0]]), np.array([[10.0, 12.0, 5.0]])
    F_ior = np.stack([light, heavy])
    found = PositionStatistics((0.0, 120.0, 240.0), F_ior, F_ior[..., 0], np.ones(1), against_now=True)
    assert found.rotations_deg[found.best] == 240
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
        load_preset(SMALL), curve, positions=found,
        gain_probability=probability_of(found.is_better(found.challenger), found.sample_weights),
        stay_probability=probability_of(found.is_close(0), found.sample_weights),
    )  # fmt: skip
    assert advice.order == order
    assert advice.choice.turn == (order == "turn")
