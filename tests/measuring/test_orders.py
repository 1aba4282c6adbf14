"""Orders: as they are declared, that a record tells apart, and of measured traces with their causes and uncertainty."""

from __future__ import annotations

import numpy as np
import pytest

from hdassist import load_preset, trace
from hdassist.features.measuring.measure import measure
from hdassist.features.measuring.orders import Gearing, gearing_of, order_grid, parse_orders
from hdassist.run.errors import UsageError
from hdassist.run.run import UNCHECKED
from tests.helpers.process import SMALL
from tests.helpers.rigs import RATIO, recorded, slow_noise


def test_gearings():
    assert gearing_of(None, 100) == Gearing(100, 100)
    odd = gearing_of(None, -99.5)
    assert odd == Gearing(99.5, 199)
    assert odd is not None
    assert odd.cycle_output == 2
    assert gearing_of(load_preset("vzp160"), None) == Gearing(100, 100)
    for ratio in (99.7, 3.0, float("nan")):
        with pytest.raises(UsageError, match="expected a multiple"):
            gearing_of(None, ratio)
    with pytest.raises(UsageError, match="which states the ratio"):
        gearing_of(load_preset("vzp160"), 100)


def test_declared_orders():
    assert parse_orders("1-3, 6") == (1, 2, 3, 6)
    assert parse_orders("2.02") == (2.02,)
    assert parse_orders(None) is None
    for wrong in ("", "0", "3-1", "x", "1;2", "1-", "-1", "1e9", "1.5-3"):
        with pytest.raises(UsageError):
            parse_orders(wrong)


def test_the_grid_follows_what_the_record_resolves():
    assert order_grid((1.0, 2.0), 3.0, 100).tolist() == [1, 2]
    assert len(order_grid((1.0, 2.0), 100.0, 100)) == 6 + 2 * 13
    fewer = order_grid((1.0, 2.0), 100.0, 100, beats=2)
    assert fewer.tolist() == pytest.approx(np.array([*range(1, 7), *range(98, 103), *range(198, 203)]) / 100)
    part = order_grid((1.0, 2.0), 20.0, 100)
    assert np.diff(part).min() == pytest.approx(1 / 20)
    assert order_grid((2.0, 2.02), 10.0, 100).tolist() == pytest.approx([0.1, 1.9, 2.0, 2.1])
    assert order_grid((2.01, 2.02), 10.0, 100, beats=0).tolist() == [0.1, 2.01]


@pytest.fixture(scope="module")
def model():
    """Cam turns and error of the full cycle of the small drive."""
    result = trace(load_preset(SMALL), 4, revolutions=30, run=UNCHECKED)
    return result.error.states.phi_h / (2 * np.pi), result.error.error_arcsec


def test_orders_of_a_model_have_its_causes(model):
    (found,) = measure(recorded(*model), drive=load_preset(SMALL)).directions
    causes = {round(o.per_cam_rev, 3): o for o in found.orders}
    assert causes[round(2 + 1 / 30, 3)].cause == "flexspline + circular spline"
    assert "once per output revolution: drive, encoder" in causes[round(1 / 30, 3)].cause
    assert "once per input revolution: drive, input encoder" in causes[1.0].cause
    spectrum = 2 * np.abs(np.fft.rfft(model[1])) / len(model[1])
    assert causes[2.0].amplitude_arcsec == pytest.approx(spectrum[60], abs=0.05)


@pytest.mark.thorough
def test_the_range_of_a_model_is_recovered(model):
    turns, error = model
    drive = load_preset(SMALL)
    hits = 0
    for seed in range(5):
        noisy = error + 0.5 * np.random.default_rng(seed).standard_normal(len(error))
        (found,) = measure(recorded(turns, noisy), drive=drive).directions
        hits += found.interval_arcsec[0] <= np.ptp(error) <= found.interval_arcsec[1]
        assert not found.is_bound
    assert hits == 5


def test_a_clean_wave_comes_back():
    turns = np.sort(np.random.default_rng(1).uniform(0, 4, 900))
    error = 7 + 10 * np.cos(2 * np.pi * 2 * turns + 0.5) + 1e-3 * np.sin(1e4 * turns)
    (found,) = measure(recorded(turns, error), ratio=100).directions
    order = next(o for o in found.orders if o.per_cam_rev == 2)
    assert (order.amplitude_arcsec, order.phase_deg) == pytest.approx((10, np.degrees(0.5)), abs=1e-2)
    assert found.range.value == pytest.approx(20, abs=0.05)


@pytest.mark.thorough
def test_amplitudes_are_as_uncertain_as_they_say():
    turns = np.arange(600) / 150
    departures = []
    for seed in range(40):
        noise = slow_noise(np.random.default_rng(seed), 600, 1.0, 0.9)
        (found,) = measure(recorded(turns, 10 * np.cos(4 * np.pi * turns) + noise), ratio=100).directions
        wave = found.fit.wave(np.flatnonzero(found.fit.orders == 2))
        departures.append((wave.amplitude_arcsec - 10) / wave.uncertainty_arcsec)
    assert 0.6 < np.std(departures) < 1.4


def test_the_noise_of_orders_is_not_lost_with_rows():
    """Where rows are lost, the columns of a fit take a share of the noise everywhere."""
    floors = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        turns = np.arange(30 * 50) / 50
        kept = rng.random(len(turns)) > 0.5
        error = 10 * np.cos(4 * np.pi * turns) + rng.standard_normal(len(turns))
        (found,) = measure(recorded(turns[kept], error[kept]), ratio=RATIO, orders=range(1, 7)).directions
        bare = np.linalg.norm(found.fit.design.root[: len(found.fit.coefficients)], axis=1)
        floors.append((np.linalg.norm(found.fit.factor, axis=1) / bare).mean())
    assert 0.94 < np.mean(floors) < 1.1


def test_single_order_includes_sidebands_that_a_partial_cycle_leaves_unresolved():
    """Order 2 with a beat of the same size, over the cycle 10 of 20 that a part of it may show."""
    turns = np.arange(12 * 60) / 60
    error = 10 * (np.cos(4 * np.pi * turns) + np.cos(2 * np.pi * 2.01 * turns))
    noise = 0.1 * np.random.default_rng(0).standard_normal(len(turns))
    (found,) = measure(recorded(turns, error + noise), ratio=100).directions
    order = min(found.orders, key=lambda o: abs(o.per_cam_rev - 2))
    assert order.amplitude_arcsec > 12
    assert order.is_of_record  # it may be none to three times as large over whole turns


@pytest.mark.thorough
@pytest.mark.parametrize("turns", [12, 60, 100])
def test_slow_output_terms_are_not_orders_of_the_input(turns: float):
    """Gravity, graduation, an encoder off its centre, once to five times per output turn; drift where it is a part."""
    x = np.arange(turns * 50) / 50
    cam = 8 * np.cos(4 * np.pi * x) + 3 * np.cos(2 * np.pi * 2.01 * x + 1) + 2 * np.cos(2 * np.pi * x)
    slow = sum(size * np.cos(2 * np.pi * k * x / 100 + k) for k, size in ((1, 300), (2, 20), (5, 3)))
    noise = 0.5 * np.random.default_rng(0).standard_normal(len(x))
    (found,) = measure(recorded(x, cam + slow + noise), ratio=100).directions
    assert found.is_part == (turns < 100)
    low, high = found.cam.interval
    assert low < np.ptp(cam) < high < low + 6
    assert found.slow_arcsec == pytest.approx(np.ptp(slow), rel=0.05)
    orders = {order.per_cam_rev: order for order in found.orders_of_cam}
    # of a part of the output's turn the uncertainty has room for the beats that it leaves open
    most = {12: 8.0, 60: 2.5, 100: 0.4}[turns]
    for order, true in ((1.0, 2.0), (2.0, np.hypot(8, 3)), (3.0, 0.0)):
        amplitude = orders[order].amplitude_arcsec
        if orders[order].is_of_record:  # the beats are too open for a value of the whole turn
            in_record = abs(2 * np.mean(cam * np.exp(2j * np.pi * order * x)))
            assert amplitude == pytest.approx(in_record, rel=0.02, abs=0.05)
        else:
            assert abs(amplitude - true) <= 3 * orders[order].uncertainty_arcsec
        assert orders[order].uncertainty_arcsec < most
    assert orders[2.0].is_of_record == (turns == 12)
    # F'_ior of the record has them where they are told from drift: in an output turn
    assert (found.range.value > 600) == (turns == 100)


def test_an_uncertainty_larger_than_the_record_is_not_stated():
    """Some two turns of the cam tell an order there, not over whole turns of the output."""
    turns = np.arange(2.2 * 60) / 60
    error = 21 * np.cos(4 * np.pi * turns) * (1 + 0.6 * turns) + 0.5 * np.random.default_rng(0).standard_normal(
        len(turns)
    )
    (found,) = measure(recorded(turns, error), ratio=100).directions
    (order,) = [each for each in found.orders_of_cam if each.per_cam_rev == 2]
    assert order.is_of_record
    assert order.uncertainty_arcsec < order.amplitude_arcsec
