"""The advice on where to mount the fixed wheel: holes, uncertainty, words."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.error.cycle import limits_left
from hdassist.drive.solve.answers import EMPTY
from hdassist.features.mounting.advice import Advice
from hdassist.features.mounting.decision import Decision, MeasurementValue
from hdassist.features.mounting.positions import MountingCurve, seat_positions
from hdassist.features.mounting.posterior import Trial, TrialSetup
from hdassist.interface.pages.card import instruction, seat_of, turn
from hdassist.interface.pages.mount import mount_report, next_value_words
from hdassist.interface.terminal.plot import seat_in_characters
from hdassist.interface.terminal.words import texts
from tests.helpers.process import SMALL


def curve_of(*values: list[float], holes: int = 12, **options) -> MountingCurve:
    count = len(values[0])
    rotations = np.arange(count) * 360.0 / count
    torques = tuple(float(k + 1) for k in range(len(values)))
    every = np.ones(np.shape(values), dtype=bool)
    return MountingCurve(torques, rotations, rotations, np.array(values), EMPTY, (), every, holes=holes, **options)


def advice_of(curve: MountingCurve) -> Advice:
    drive = load_preset(SMALL, [f"operation.M_g={list(curve.torques)}", f"mounting.holes={curve.holes}"])
    return Advice(drive, Decision.as_given(curve), TrialSetup(curve.torques[0]), curve)


def test_only_allowed_holes_are_recommended():
    values = [20.0, 9.0, 8.0, 7.0, 30.0, 6.0]
    assert curve_of(values, holes=6).recommended.hole == 5
    some = curve_of(values, holes=6, allowed=(1, 2, 4))
    assert [p.hole for p in some.ranked] == [2, 1, 4]
    # the present hole is not among them: it has to be left, even for a worse one
    forced = curve_of([5.0, 9.0, 8.0, 7.0, 30.0, 6.0], holes=6, allowed=(1, 2))
    assert advice_of(forced).turn
    assert mount_report(advice_of(forced), 0).line == "2"
    drive = load_preset(SMALL, ["mounting.allowed=[2,5]"])
    assert seat_positions(drive) == [0, 60, 150]


def test_positions_between_the_holes_are_shown_and_not_recommended():
    curve = curve_of([20.0, 1.0, 9.0, 2.0, 8.0, 3.0], holes=3)
    assert curve.recommended.rotation_deg == 240
    assert curve.F_ior_arcsec[0].argmin() == 1 and curve.at(1).hole is None


def test_no_gain_means_stay():
    words = [advice_of(curve_of([10.0, best, 12.0], holes=3)).word for best in (11.0, 9.95, 9.8)]
    assert words == ["LEAVE", "LEAVE", "TURN"]  # less than a hundredth is nothing
    assert mount_report(advice_of(curve_of([10.0, 9.95, 12.0], holes=3)), 0).line == "0"
    assert instruction(advice_of(curve_of([10.0, 11.0, 12.0], holes=3))) == (
        "Leave the circular spline in hole 0, where it is now."
    )


def test_the_instruction_takes_the_shorter_way():
    curve = curve_of([20.0, 9.0, 30.0, 8.0], holes=4)
    assert turn(curve.at(1)) == "1 hole (90°) counter-clockwise"
    assert turn(curve.at(2)) == "2 holes (180°) counter-clockwise"
    assert turn(curve.at(3)) == "1 hole (90°) clockwise"
    said = instruction(advice_of(curve))
    assert said.startswith("Put the circular spline in hole 3. That is 1 hole (90°) clockwise from hole 0, ")
    assert "20.00 → 8.00″ at 1 N" in said
    free = curve_of([20.0, 9.0, 30.0, 8.0], holes=0)
    assert turn(free.at(1)) == "90° counter-clockwise"


@pytest.mark.moves("mounting.first_hole")
def test_the_seat_shows_where_holes_lie():
    drive = load_preset(SMALL)
    curve = curve_of([20.0, 9.0, 30.0, 8.0], holes=4)

    def where(letter: str, first_hole: float) -> tuple[float, float]:
        there = drive.model_copy(
            update={
                "operation": drive.operation.model_copy(update={"M_g": (1.0,)}),
                "mounting": drive.mounting.model_copy(update={"first_hole": first_hole, "holes": 4}),
            }
        )
        choice = replace(advice_of(curve), drive=there)
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


def test_mount_page_lists_the_best_hole_for_each_torque():
    light, heavy = [30.0, 10.0, 20.0], [10.0, 12.0, 7.0]
    (_, facts, *_), one = mount_report(advice_of(curve_of(light, heavy, holes=3)), 0).blocks, curve_of(light, holes=3)
    assert ("best hole for each torque", "1 N·m: hole 1; 2 N·m: hole 2") in facts.rows
    assert "best hole for each torque" not in dict(mount_report(advice_of(one), 0).blocks[1].rows)


def test_the_curve_has_the_limit_less_the_self_error():
    plain = advice_of(curve_of([20.0, 9.0, 12.0], holes=3))
    drive = load_preset(SMALL, [*plain.drive.origin.overrides, "acceptance.F_ior=15"])
    rooms = limits_left(drive, plain.torques)
    limited = replace(plain, drive=drive, decision=replace(plain.decision, room_arcsec=rooms.arcsec))
    curve, line = (mount_report(each, 0).blocks[-1] for each in (plain, limited))
    assert curve.limit is None
    assert line.limit == rooms.arcsec[0] and 0 < line.limit < 15


def goes_on_measuring(advice: Advice, values: int, worth: float) -> bool:
    """Return whether another hole is measured after a number of values, if one more gains 1.5 %."""
    one, value = Trial(0.0, 20.0), MeasurementValue(120.0, 1.0, (20.0, 19.7))
    return replace(advice, trials=(one,) * values, value=value, worth=worth).next is not None


def test_measuring_stops_when_another_value_gains_too_little_after_five():
    advice = advice_of(curve_of([20.0, 9.0, 12.0, 15.0, 18.0, 19.0], holes=6))
    assert [goes_on_measuring(advice, values, 0.02) for values in (4, 5, 6)] == [True, False, False]
    assert goes_on_measuring(advice, 6, 0.01)


def test_a_seat_of_three_holes_needs_four_values():
    advice = advice_of(curve_of([20.0, 9.0, 12.0], holes=3))
    assert [goes_on_measuring(advice, values, 0.02) for values in (3, 4, 5)] == [True, False, False]
    assert goes_on_measuring(advice, 5, 0.01)


def doubting(better_share: float, misread: float) -> Advice:
    """An advice after five values whose gain is small; hole 1 is the choice, and hole 2 was not measured.

    better_share: of samples in which hole 2 is better; misread: probability of the second value.
    """
    samples = np.tile([20.0, 10.0, 12.0, 25.0, 30.0], (100, 1))
    samples[: round(100 * better_share), 2] = 9.0
    decision = Decision(
        rotations_deg=(0.0, 72.0, 144.0, 216.0, 288.0),
        F_ior_arcsec=samples[None],
        now_arcsec=samples[None, :, 0],
        sample_weights=np.ones(100),
    )
    values = tuple(Trial(turn, 10.0) for turn in (0.0, 72.0, 216.0, 288.0, 288.0))
    after = SimpleNamespace(misread=np.array([0.0, misread, 0.0, 0.0, 0.0]), facing=(None, None))
    drive = load_preset(SMALL, ["operation.M_g=[1.0]", "mounting.holes=5"])
    value = MeasurementValue(288.0, 1.0, (10.0, 9.95, 9.94, 9.93))
    return Advice(drive, decision, TrialSetup(1.0), trials=values, after=after, value=value)


def test_measuring_does_not_stop_next_to_a_likely_better_hole():
    assert doubting(0.1, 0.0).next is None
    likely = doubting(0.3, 0.0)
    assert likely.next.hole == 2
    assert next_value_words(likely) == (
        "Before bolting, measure F'_ior in hole 2. Probability that hole 2 is better than hole 1 "
        "by more than 2 %: 30 %."
    )


def test_a_doubtful_value_is_repeated_before_all_else():
    assert doubting(0.1, 0.1).next is None
    doubtful = doubting(0.3, 0.3)
    assert doubtful.next.hole == 1
    assert next_value_words(doubtful) == (
        "Before bolting, measure F'_ior in hole 1 again. Probability that 10″ is a reading error: 30 %."
    )
    after = SimpleNamespace(misread=np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.0]), facing=(None, None))
    repeated = replace(doubtful, trials=(*doubtful.trials, Trial(72.0, 10.2)), after=after)
    assert repeated.next.hole == 2


def test_a_value_is_measured_for_its_number_with_a_reason():
    few = replace(doubting(0.0, 0.0), trials=(Trial(288.0, 30.0),))
    assert next_value_words(few).startswith(
        "Before bolting, measure F'_ior in hole 4 again: with fewer than 5 values, a reading "
        "error may go unnoticed. Mean F'_ior"
    )
