"""A recording that does not determine F'_ior gives a bound, and the order of its rows decides nothing."""

from __future__ import annotations

import numpy as np
import pytest

from hdassist.features.acceptance.decision import MEASURED
from hdassist.features.measuring.measure import SweepResult, measure
from hdassist.interface.pages.measure import measure_report
from hdassist.run.errors import DataError
from tests.helpers.rigs import RATIO, Array, recorded, whole_range

PER_TURN = 40
PLACES = np.arange(round(RATIO * PER_TURN))
TURNS = PLACES / PER_TURN


def slow_error(turns: Array) -> Array:
    """Orders of the cam, and larger ones of the output: 15 arcsec in one of its revolutions."""
    output = 2 * np.pi * turns / RATIO
    return 4 * np.cos(4 * np.pi * turns) + 7 * np.cos(output + 1) + 2 * np.cos(3 * output) + np.cos(2 * np.pi * turns)


def readings(places: Array, seed: int = 0) -> Array:
    """The error at places of the full cycle, with the same noise at a place in every recording."""
    return slow_error(TURNS)[places] + 0.3 * np.random.default_rng(seed).standard_normal(len(TURNS))[places]


def only_direction(turns: Array, error: Array, **how: float) -> SweepResult:
    (found,) = measure(recorded(turns, error), ratio=RATIO, **how).directions
    return found


@pytest.mark.thorough
@pytest.mark.parametrize("share", [0.5, 0.9, 0.955, 0.965])
def test_less_than_an_output_revolution_is_a_bound(share):
    """Its slow terms are removed, so its range is none of the full cycle, however many positions it visited."""
    places = PLACES[: round(share * len(PLACES))]
    found = only_direction(TURNS[places], readings(places))
    assert found.is_part
    assert found.is_bound
    assert found.interval_arcsec[0] < whole_range(slow_error, RATIO)


@pytest.mark.thorough
@pytest.mark.parametrize("first", [1, 400, 1160])
def test_the_start_of_the_cycle_never_matters(first):
    """Angles modulo the output revolution: they begin again where the cycle was not begun at zero."""
    once = only_direction(TURNS, readings(PLACES))
    begun = np.roll(PLACES, -first)
    found = only_direction(TURNS[begun], readings(begun))
    assert not found.is_bound
    assert found.range.value == pytest.approx(once.range.value, abs=0.15)
    low, high = found.interval_arcsec
    assert low < whole_range(slow_error, RATIO) < high


@pytest.mark.thorough
@pytest.mark.parametrize("parts", [(600,), (200, 900)])
def test_sweeps_that_join_on_the_output_are_one_cycle(parts):
    """In any order, and each with a zero of its own."""
    sweeps = np.split(PLACES, parts)[::-1]
    places = np.concatenate(sweeps)
    zero = np.concatenate([np.full(len(each), 3.0 * number) for number, each in enumerate(sweeps)])
    found = only_direction(TURNS[places], readings(places) + zero)
    assert not found.is_bound
    low, high = found.interval_arcsec
    assert low < whole_range(slow_error, RATIO) < high
    assert high - low < 1.5 * np.ptp(only_direction(TURNS, readings(PLACES)).interval_arcsec)


def test_many_short_sweeps_are_a_bound():
    """The levels of so many sweeps take the slow terms, so that these are not known."""
    parts = np.split(PLACES, 10)
    places = np.concatenate([parts[k] for k in (5, 0, 7, 2, 9, 4, 6, 1, 8, 3)])
    found = only_direction(TURNS[places], readings(places))
    assert found.is_bound


def test_a_travel_in_parts_is_a_bound():
    """The slow terms of a travel are part of its error; sweeps with levels of their own do not show them."""
    travel = PLACES[: len(PLACES) // 2]
    once = only_direction(TURNS[travel], readings(travel), travel_deg=179.0)
    assert not once.is_bound
    second, first = travel[: len(travel) // 2], travel[len(travel) // 2 :]
    places = np.concatenate([first, second])
    found = only_direction(TURNS[places], readings(places), travel_deg=179.0)
    assert found.is_bound


@pytest.mark.parametrize("seed", [0, 10, 24, 29])
def test_images_of_beats_are_no_lines_of_uneven_readings(seed):
    """A bound above the truth fails a good drive: readings of a part leave beats, whose images look like lines."""
    rng = np.random.default_rng(seed)
    beats = np.arange(-5, 6)
    sizes = rng.exponential(4, len(beats)) / (1 + np.abs(beats) / 2)
    phases = rng.uniform(0, 2 * np.pi, len(beats))

    def curve(turns: Array) -> Array:
        waves = np.cos(2 * np.pi * np.outer(turns, 2 + beats / RATIO) + phases)
        return waves @ sizes + 2 * np.cos(8 * np.pi * turns) + 2 * np.cos(2 * np.pi * turns + 1)

    places = np.arange(12 * PER_TURN)
    turns = (places + rng.uniform(-0.2, 0.2, len(places))) / PER_TURN
    error = curve(turns) + 0.02 * rng.standard_normal(len(turns))
    found = only_direction(turns, error)
    assert found.is_bound
    assert not [line for line in found.lines if line.per_cam_rev > PER_TURN / 2]
    assert found.range.value <= np.ptp(error)
    assert found.interval_arcsec[0] < whole_range(curve, RATIO)


def test_the_page_shows_the_amplitude_that_accept_compares():
    """`orders` shows an order with its beats, and beside it the amplitude alone, which a limit of the order is for."""
    output = 2 * np.pi * TURNS / RATIO
    error = readings(PLACES) + 3 * np.cos(4 * np.pi * TURNS + output)
    found = measure(recorded(TURNS, error), ratio=RATIO)
    amplitude, *_ = MEASURED["ORDER"](found.directions[0], 2.0) or (0.0,)
    assert amplitude == pytest.approx(4, abs=0.1)
    facts = dict(measure_report(found, None).blocks[1].rows)
    assert f"2: {found.directions[0].orders_of_cam[1].amplitude_arcsec:.2f}" in facts["orders"]
    assert f"({amplitude:.2f}″)" in facts["orders"]


@pytest.mark.thorough
@pytest.mark.parametrize("together", [False, True])
def test_beats_of_another_ratio_are_refused(together):
    """A recording of ratio 100 is none of a drive of ratio 30, whose cycle it goes through three times."""
    turns = np.arange(100 * PER_TURN) / PER_TURN
    output = 2 * np.pi * turns / 100
    error = (10 + 2 * np.cos(output)) * np.cos(4 * np.pi * turns) + 2 * np.cos(2 * np.pi * turns + output)
    error += 6 * np.cos(output + 1) + 0.2 * np.random.default_rng(1).standard_normal(len(turns))
    with pytest.raises(DataError, match=r"repeats every (99|100)"):
        measure(recorded(turns, error), ratio=RATIO, together=together)
    assert not measure(recorded(turns, error), ratio=100, together=together).directions[0].is_bound


@pytest.mark.thorough
def test_ball_passes_are_no_beats_of_another_ratio():
    """Lines of a cage and its balls lie near orders too, but not at the same distance from several of them."""
    turns = np.arange(3 * len(PLACES)) / PER_TURN
    error = slow_error(turns) + 0.3 * np.random.default_rng(2).standard_normal(len(turns))
    for line in (0.402, 0.804, 1.206, 2.01, 4.826):
        error += np.cos(2 * np.pi * line * turns + line)
    assert len(measure(recorded(turns, error), ratio=RATIO).directions[0].lines) >= 4
