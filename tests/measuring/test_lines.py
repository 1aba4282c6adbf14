"""Lines off the orders: found where they are, in F'_ior with what they may add, and not seen where there are none."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.lines import Group, look, rig, row
from hdassist.features.measuring import fit
from hdassist.features.measuring.measure import SweepResult, measure
from tests.helpers.rigs import drive_error, recorded, slow_noise, whole_range

RATIO, PER_TURN = 30.0, 60
TURNS = np.arange(RATIO * PER_TURN) / PER_TURN
CURVE = drive_error(np.random.default_rng(3), RATIO)


def found_in(error: np.ndarray, turns: np.ndarray = TURNS) -> SweepResult:
    (found,) = measure(recorded(turns, error), ratio=RATIO).directions
    return found


def line(order: float, size: float, phase: float = 0.4, turns: np.ndarray = TURNS) -> np.ndarray:
    return np.asarray(size * np.cos(2 * np.pi * order * turns + phase))


NOISE = 0.5 * np.random.default_rng(1).standard_normal(len(TURNS))


@pytest.mark.thorough
@pytest.mark.parametrize("order", [0.51, 6.48, 12.96, 13.0, 14.02, 19.3])
def test_a_line_is_found_where_it_is(order):
    found = found_in(CURVE(TURNS) + line(order, 3.0) + NOISE)
    (only,) = found.lines
    assert only.per_cam_rev == pytest.approx(order, abs=0.002)
    assert only.amplitude_arcsec == pytest.approx(3.0, abs=4 * only.uncertainty_arcsec)
    assert only.phase_deg == pytest.approx(np.degrees(0.4), abs=8)
    assert "not an order of the drive, or not resolved" in only.cause
    assert {round(o.per_cam_rev, 9) for o in found_in(CURVE(TURNS) + NOISE).orders} == {
        round(o.per_cam_rev, 9) for o in found.orders if o is not only
    }


TEN = np.arange(2000) / 200  # turns
WAVE = 8 * np.cos(4 * np.pi * TEN + 0.3) + 2 * np.cos(2 * np.pi * TEN) + np.cos(8 * np.pi * TEN + 1)


@pytest.mark.parametrize("order", [6.95, 11.07, 5.08, 0.554])
def test_line_near_an_order_of_a_short_recording_merges(order):
    # ten turns tell orders apart that lie 0.1 apart: 6.95 lies between 6.9 and 7.0, and may be a beat of 7
    error = WAVE + line(order, 3.0, turns=TEN)
    found = found_in(error + 0.3 * np.random.default_rng(0).standard_normal(len(TEN)), TEN)
    (only,) = (o for o in found.orders if abs(o.per_cam_rev - order) < 0.02)
    assert only.amplitude_arcsec == pytest.approx(3.0, abs=0.05)
    assert found.lines == ((only,) if order < 1 else ())
    assert ("sidebands of an order, or a separate line" in only.cause) == (order > 1)
    assert sum(o.amplitude_arcsec > 0.2 for o in found.orders) == 4
    low, high = found.interval_arcsec
    assert low < np.ptp(error) < high < low + 1


@pytest.mark.thorough
@pytest.mark.parametrize("order", [6.95, 5.08])
def test_line_between_sidebands_of_the_full_cycle_is_one_line(order):
    found = found_in(CURVE(TURNS) + line(order, 3.0) + NOISE)
    (only,) = found.lines
    assert only.per_cam_rev == pytest.approx(order, abs=0.02)
    assert found.range.rise < 2 * 3.0


def test_even_readings_in_uneven_places_have_no_images():
    # 200 readings a turn in places of 1/480: a wave that is left has no image at 40 a turn
    slow = measure(recorded(TEN, WAVE + line(0.25, 3.0, turns=TEN)), ratio=100).directions[0]
    assert not [o for o in slow.lines if o.per_cam_rev > 20]


def test_several_lines_are_found_the_strongest_first():
    error = CURVE(TURNS) + line(6.48, 1.0) + line(14.02, 4.0) + line(17.5, 2.0) + NOISE
    found = found_in(error)
    assert [o.per_cam_rev for o in found.lines] == pytest.approx([6.48, 14.02, 17.5], abs=0.005)
    assert [o.amplitude_arcsec for o in found.lines] == pytest.approx([1, 4, 2], abs=0.15)


def test_noise_is_estimated_once_for_all_trial_positions_of_lines(monkeypatch):
    """That took most of the time of a long record with lines."""
    noise_floor, estimated = fit.noise_floor, []

    def counted(*of):
        estimated.append(of)
        return noise_floor(*of)

    monkeypatch.setattr(fit, "noise_floor", counted)
    found = found_in(CURVE(TURNS) + line(6.48, 1.0) + line(14.02, 4.0) + NOISE)
    assert (len(found.lines), len(estimated)) == (2, 1)


def test_lines_may_add_twice_their_amplitude_in_another_cycle():
    # the greatest of a line that stands freely meets that of the curve in some cycle, its least the curve's least
    found = found_in(CURVE(TURNS) + line(12.96, 3.0) + 0.02 * NOISE)
    sup = whole_range(CURVE, RATIO) + 2 * 3.0
    assert found.range.fitted + found.range.rise == pytest.approx(sup, rel=0.01)
    assert found.range.rise > 0
    fine = np.arange(RATIO * 480) / 480
    others = [np.ptp(CURVE(fine) + line(12.96, 3.0, phase, fine)) for phase in np.linspace(0, 6, 40)]
    low, high = found.interval_arcsec
    assert max(others) < high
    assert high - found.range.value - found.range.rise == pytest.approx(found.range.value - low)


def test_a_part_of_the_cycle_speaks_of_its_own_angles():
    part = TURNS < 12
    found = found_in((CURVE(TURNS) + line(13.0, 3.0) + 0.1 * NOISE)[part], TURNS[part])
    assert found.lines
    assert found.is_bound
    assert found.range.rise == 0


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("turns", "per_turn", "memory"), [(4, 150, 0.9), (4, 150, 0.0), (10, 100, 0.98), (30, 60, 0.6)]
)
def test_noise_has_no_lines(turns, per_turn, memory):
    # slow noise is stronger at low orders: it must not look like lines there
    x, alarms = np.arange(turns * per_turn) / per_turn, 0
    for seed in range(10):
        noise = slow_noise(np.random.default_rng(seed), len(x), 1.0, memory)
        (found,) = measure(recorded(x, 10 * np.cos(4 * np.pi * x) + noise), ratio=100).directions
        alarms += len(found.lines) > 0
    assert alarms == 0


@pytest.mark.thorough
@pytest.mark.parametrize("noise", [0.3, pytest.param(2.0, marks=pytest.mark.slow)])
def test_full_cycles_with_a_line_are_held_and_not_passed(noise):
    # the short form of `python -m benchmarks.lines`
    group = Group("orders", 30, 1, noise)
    told = row([look((group, seed)) for seed in range(6)])
    assert told["rigs"] == 6
    assert told["held"] == 100
    assert told["any held"] == 100
    assert told["false PASS"] == 0
    assert told["lines"] == pytest.approx(1, abs=0.1)


def test_omitting_a_line_would_make_F_ior_too_small():
    group, missed = Group("orders", 30, 1, 0.3), 0
    for seed in range(2):
        made = rig(group, seed)
        found = found_in(made.error, made.turns)
        without = found.fit.coefficients * np.tile(~np.isin(found.fit.orders, found.fit.lines), 2)
        curve = np.ptp(_curve(found, without))
        missed += curve < made.recorded - 2 * found.uncertainty_arcsec
    assert missed == 2


def _curve(found: SweepResult, coefficients: np.ndarray) -> np.ndarray:
    from hdassist.features.measuring.terms import curve_of

    return curve_of(coefficients, found.fit.orders, found.grid_turns)


@pytest.mark.thorough
@pytest.mark.parametrize("order", [14, 17])
@pytest.mark.parametrize("uneven", [0.0, 0.4, 1.0])
def test_order_barely_resolved_by_few_rows_is_in_the_range(order, uneven):
    rng = np.random.default_rng([order, round(10 * uneven)])
    rows, size = rng.integers(35, 40), rng.uniform(1, 2)
    phase = rng.uniform(0, 2 * np.pi, 4)

    def curve(turns):
        high = np.cos(2 * np.pi * order * turns + phase[2]) + 0.5 * np.cos(
            2 * np.pi * (order + 1 / 30) * turns + phase[3]
        )
        oval = np.cos(4 * np.pi * turns + phase[0]) * (1 + 0.3 * np.cos(2 * np.pi * turns / 30 + phase[1]))
        return 10 * oval + size * high

    turns = np.arange(30.5 * rows) / rows
    turns = np.sort(turns + rng.uniform(-0.5, 0.5, len(turns)) * uneven / rows)
    error = curve(turns) + 0.3 * rng.standard_normal(len(turns))
    (found,) = measure(recorded(turns, error), ratio=30).directions
    low, high = found.interval_arcsec
    assert low <= whole_range(curve, 30) <= high
    assert not found.is_bound
    assert min(abs(line.per_cam_rev - order) for line in found.lines) < 0.1


@pytest.mark.thorough
def test_an_order_that_even_rows_show_as_another_is_held():
    # 35 to 39 even rows a turn: order 24 looks like 11 to 15, and F'_ior came out too small in half of the records
    for seed in range(3):
        rng = np.random.default_rng([24, 0, seed])
        rows, size, phase = int(rng.integers(35, 40)), rng.uniform(1, 2), rng.uniform(0, 2 * np.pi, 4)

        def curve(turns, size=size, phase=phase):
            cam, output = 2 * np.pi * turns, 2 * np.pi * turns / 30
            high = np.cos(24 * cam + phase[2]) + 0.5 * np.cos(24 * cam + output + phase[3])
            return 10 * np.cos(2 * cam + phase[0]) * (1 + 0.3 * np.cos(output + phase[1])) + size * high

        turns = np.arange(30.5 * rows) / rows
        (found,) = measure(recorded(turns, curve(turns) + 0.3 * rng.standard_normal(len(turns))), ratio=30).directions
        low, high = found.interval_arcsec
        assert low <= whole_range(curve, 30) <= high
        (hidden,) = (each.arcsec for each in found.sources if each.name == "between readings")
        assert hidden
        assert hidden > 0
