"""The decision among holes: loss, word, probability, and what one more value brings."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import beta

from hdassist.features.mounting.decision import Decision, MeasurementValue, as_measured, value_of_measurement
from hdassist.features.report import to_error_digit


def decision_of(*rows: list[float], weights: list[float] | None = None, torques: int = 1, **more: object) -> Decision:
    """A decision over samples, a row each with F'_ior of its holes, the first where the wheel stands."""
    F_ior = np.repeat(np.array(rows, dtype=float)[None], torques, axis=0)
    rotations = tuple(360.0 * k / F_ior.shape[2] for k in range(F_ior.shape[2]))
    return Decision(rotations, F_ior, F_ior[..., 0], np.array(weights or [1.0] * len(rows)), **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("rows", "word", "place", "probability"),
    [
        ([[10.0, 5.0]] * 80, "TURN", 1, 1.0),
        ([[10.0, 5.0]] * 70 + [[10.0, 12.0]] * 10, "BEST_BET", 1, 0.875),
        ([[10.0, 12.0]] * 70 + [[10.0, 9.0]] * 10, "BEST_BET", 0, 0.875),
        ([[10.0, 12.0]] * 80, "LEAVE", 0, 1.0),
        ([[10.0, 9.95]] * 80, "ANY_HOLE", 0, 1.0),  # less than a hundredth
        ([[10.0, 9.0]] * 40 + [[9.0, 10.0]] * 40, "ANY_HOLE", 0, 0.5),
    ],
)
def test_the_word_goes_by_expected_loss_and_probability(rows, word, place, probability):
    found = decision_of(*rows)
    assert (found.word(), found.best) == (word, place)
    assert found.probability.value == pytest.approx(probability)


@pytest.mark.parametrize(("worth", "word"), [(4.0, "BEST_BET"), (31.0, "BEST_BET"), (33.0, "TURN"), (None, "TURN")])
def test_samples_drawn_again_from_few_order_nothing(worth, word):
    found = decision_of(*[[10.0, 5.0]] * 2048, worth=worth)
    assert (found.word(), found.best, found.probability.value) == (word, 1, 1.0)
    low = beta.ppf(0.05, (worth or 2048) + 0.5, 0.5)  # Jeffreys
    assert found.probability.low == pytest.approx(low)


def test_standard_error_of_a_median_is_that_of_repeated_samples():
    rng = np.random.default_rng(0)
    decisions = [decision_of(*rng.normal(30.0, 4.0, (200, 2)).tolist()) for _ in range(200)]
    spread = np.std([decision.quantile(0.5, 1)[0] for decision in decisions])
    stated = np.mean([decision.standard_errors(0.5, 1)[0] for decision in decisions])
    assert stated == pytest.approx(spread, rel=0.15)  # the spread of 200 has a standard error of 5 %
    assert decision_of([10.0, 5.0]).standard_errors(0.5, 1) == (0.0,)


@pytest.mark.parametrize(
    ("value", "standard_error", "text"),
    [
        (48.65, 1.7, "49"),
        (27.72, 0.149, "27.7"),
        (7.93, 0.083, "7.93"),
        (7.93, 0.001, "7.93"),
        (127.41, None, "127.41"),
    ],
)
def test_a_number_has_the_digits_that_its_standard_error_carries(value, standard_error, text):
    assert to_error_digit(value, standard_error) == text


def test_statistics_are_those_of_the_weighted_samples():
    rng = np.random.default_rng(0)
    rows, weights = rng.uniform(5, 15, (40, 4)), rng.uniform(0.1, 1, 40)
    found, share = decision_of(*rows.tolist(), weights=weights.tolist()), weights / weights.sum()
    lost = rows / rows.min(axis=1, keepdims=True) - 1
    action = found.action(2)
    assert action.expected_loss == pytest.approx(share @ lost[:, 2])
    assert action.probability_good == pytest.approx(share @ (lost[:, 2] < 0.05))
    assert action.probability_better == pytest.approx(share @ (rows[:, 2] < 0.99 * rows[:, 0]))
    assert found.best == np.argmin(share @ lost)


def test_governing_torque_decides_but_each_torque_has_its_best_hole():
    F_ior = np.array([[[20.0, 10.0, 12.0]], [[10.0, 12.0, 7.0]]])
    found = Decision((0.0, 120.0, 240.0), F_ior, F_ior[..., 0], np.ones(1))
    assert [found.of_torque(k).best for k in range(2)] == [1, 2]
    assert found.best == 2
    served = np.array([20 / 14, 12 / (29 / 3), 12 / 14])  # over the mean of the holes at each torque
    assert found.losses[0] == pytest.approx(served / served[2] - 1)
    assert [found.gains(k)[0] for k in range(3)] == pytest.approx([0, -0.2, 0.3])
    assert [bool(found.is_better(k)[0]) for k in range(3)] == [False, True, True]  # 12/9.7 is less than 20/14


@settings(max_examples=50)
@given(st.integers(0, 10**6), st.integers(0, 5))
def test_the_choice_does_not_hang_on_where_the_wheel_stands(seed, stands):
    """The same drives counted from another hole: the same hole is named, at several torques too."""
    F_ior = np.random.default_rng(seed).uniform(10, 20, (2, 30, 6)) + 4 * np.cos(np.arange(6) * np.pi / 3)
    rotations = tuple(60.0 * k for k in range(6))
    first, other = (
        Decision(rotations, shown, shown[..., 0], np.ones(30), cost=0.0)
        for shown in (F_ior, np.roll(F_ior, -stands, 2))
    )
    assert (other.best + stands) % 6 == first.best
    assert other.expected_loss == pytest.approx(np.roll(first.expected_loss, -stands))


def test_a_limit_makes_the_likeliest_to_keep_it_the_choice():
    rows = [[10.0, 8.0, 9.0]] * 8 + [[10.0, 12.0, 9.0]] * 2
    free, held = decision_of(*rows), decision_of(*rows, room_arcsec=(9.5,))
    assert (free.best, held.best) == (1, 2)
    assert held.probability_kept == pytest.approx([0, 0.8, 1])
    assert decision_of(*rows, room_arcsec=(20.0,)).best == free.best  # all keep it


def test_a_bolted_wheel_turns_only_where_that_earns_its_cost():
    rows = [[10.0, 9.2]] * 10
    assert [decision_of(*rows, cost=cost).best for cost in (0.01, 0.2)] == [1, 0]


def test_where_staying_is_not_allowed_another_hole_is_the_choice():
    F_ior = np.array([[[8.0, 9.0]] * 5])
    found = Decision((90.0, 180.0), F_ior, np.full((1, 5), 7.0), np.ones(5))
    assert (found.stay, found.best, found.word()) == (None, 0, "TURN")


def test_holes_known_to_be_equal_are_always_any_hole():
    found = decision_of(*np.random.default_rng(1).uniform(5, 15, (16, 4)).tolist(), all_alike=True)
    assert (found.word(), found.best) == ("ANY_HOLE", 0)


def waves(number: int = 400, seed: int = 3) -> Decision:
    """Holes over a sine of any direction."""
    turn = np.random.default_rng(seed).uniform(0, 2 * np.pi, (number, 1))
    return decision_of(*(20 + 8 * np.cos(2 * np.pi * np.arange(12) / 12 - turn)).tolist())


def value_of(decision: Decision, noise: float, **more: object) -> MeasurementValue:
    F_ior = decision.F_ior_arcsec[0]
    # of keywords as a test gives them no type is known
    return value_of_measurement(decision, {1.0: F_ior}, np.full(len(F_ior), noise), **more)  # type: ignore[arg-type]


def test_one_more_value_brings_what_bayes_by_hand_says():
    """Two kinds of drives of the same probability: a value in the hole that differs tells which one it is."""
    rows = [[10.0, 8.0, 20.0]] * 50 + [[10.0, 16.0, 4.0]] * 50
    found = value_of(decision_of(*rows), 0.1, steps=1)
    now = min(np.mean(rows, axis=0))  # not of the least loss: 10 in hole 0
    least = np.argmin(decision_of(*rows).expected_loss)
    assert found.F_ior_arcsec[0] == pytest.approx(np.mean([row[least] for row in rows]), rel=0.02)
    assert found.F_ior_arcsec[1] == pytest.approx(6.0, rel=0.02)
    assert found.rotation_deg in (120.0, 240.0)
    assert now >= found.F_ior_arcsec[1]
    noisy = value_of(decision_of(*rows), 1e3, steps=1)
    assert noisy.gain_arcsec == pytest.approx(0, abs=0.7)
    assert found.is_worth() and not noisy.is_worth(0.1)


def test_one_more_value_brings_the_mean_of_the_lesser_error():
    rng = np.random.default_rng(5)
    rows = np.stack([rng.normal(27.0, 0.3, 4000), rng.normal(28.0, 2.5, 4000)], axis=1)
    found = value_of(decision_of(*rows.tolist()), 0.05, steps=3)
    less = np.maximum(rows[:, 0] - rows[:, 1], 0)  # what is gained where the other hole is known
    assert found.rotation_deg == 180.0
    assert found.gain_arcsec == pytest.approx(less.mean(), abs=3 * less.std() / np.sqrt(512))


def test_more_values_bring_more_and_less_each_time():
    found = value_of(waves(), 0.5, steps=3)
    now, one, _, three = found.F_ior_arcsec
    assert now > one > three > 12
    assert three < 12.6  # a sine is known from three values; 12 is its least
    first = value_of(waves(), 0.5, steps=3, first=(0.0, 120.0, 240.0))
    assert first.rotation_deg == 0
    assert first.F_ior_arcsec[3] < 12.6


def test_simulated_drives_show_the_misfit_of_samples_and_all_directions():
    still = decision_of(*[[20.0, 12.0, 20.0, 28.0]] * 4, all_alike=True)
    shown = as_measured(still, 4000)
    assert shown.F_ior_arcsec.mean(axis=1)[0] == pytest.approx([20] * 4, rel=0.05)
    assert set(shown.F_ior_arcsec[0].argmin(axis=1).tolist()) == {0, 1, 2, 3}
    turned = as_measured(decision_of(*[[20.0, 20.0, 20.0, 20.0]] * 4), 4000).F_ior_arcsec[0]
    level = turned.mean(axis=1)
    assert level.std() / level.mean() == pytest.approx(0.1, rel=0.25)  # scale, and what the misfit adds


def test_equal_holes_have_equal_expected_loss():
    """What few samples show between them is chance: no hole is named worse than the one that is kept."""
    rows = [[20.0, 12.0, 20.0, 28.0], [10.0, 20.0, 12.0, 11.0], [15.0, 14.0, 13.0, 12.0]]
    alike, apart = decision_of(*rows, all_alike=True), decision_of(*rows)
    assert np.ptp(apart.expected_loss) > 0.1
    assert alike.expected_loss == pytest.approx([apart.expected_loss.mean()] * 4)
    assert alike.probability_good == pytest.approx([apart.probability_good.mean()] * 4)
    assert (alike.best, alike.word()) == (0, "ANY_HOLE")


def test_the_worst_hole_has_the_largest_error() -> None:
    # hole 0 is the least likely to meet 29", and hole 1 has the larger expected error
    found = decision_of([10.0, 24.0, 9.0], [30.0, 24.0, 9.0], room_arcsec=(29.0,))
    assert (found.ranked[-1], found.worst) == (0, 1)
