"""Measured traces with a known answer: F'_ior, orders, directions, coverage and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import encoders, records
from hdassist import load_preset, trace
from hdassist.acceptance.decision import AcceptedValue, decide
from hdassist.acceptance.limits import Limit
from hdassist.errors import DataError, UntrustedError, UsageError
from hdassist.measuring.measure import measure
from hdassist.measuring.uncertainty import combined, parse_stated
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.run.run import UNCHECKED
from tests.process import SMALL
from tests.rigs import Curve, drive_error, recorded, slow_noise, text, turn_range, whole_range

RATIO, PER_TURN = 30.0, 120


def simulated(seed: int) -> tuple[np.ndarray, np.ndarray, Curve]:
    """Cam angles [turns], errors [arcsec] and the true curve of one of five rigs."""
    rng = np.random.default_rng(seed)
    curve = drive_error(rng, RATIO, scale=rng.choice([1.5, 5.0]))
    turns = np.arange(RATIO * PER_TURN) / PER_TURN
    rig = seed % 5
    if rig == 1:  # uneven steps
        turns = np.sort(turns + rng.uniform(-0.5, 0.5, len(turns)) / PER_TURN)
    if rig == 2:  # a third of the samples is missing
        turns = turns[rng.random(len(turns)) > 1 / 3]
    noise = slow_noise(rng, len(turns), 1.0, 0.8) if rig == 3 else rng.standard_normal(len(turns))
    error = curve(turns) + noise
    if rig == 4:  # a coarse reading
        error = np.round(error * 2) / 2
    return turns, error, curve


def test_known_ranges_lie_within_the_stated_uncertainty():
    hits, within, passed, raw_too_large, widths = 0, 0, 0, 0, []
    for seed in range(20):
        turns, error, curve = simulated(seed)
        (found,) = measure(recorded(turns, error), ratio=RATIO).directions
        low, high = found.interval_arcsec
        true, u = whole_range(curve, RATIO), found.uncertainty_arcsec
        hits += low <= true <= high
        in_turn = abs(found.revolution.value - turn_range(curve, RATIO))
        within += in_turn <= 2 * found.revolution_uncertainty_arcsec
        # a drive that stands just at its limit
        passed += (
            decide(
                Limit("F_IOR", true), AcceptedValue(found.range.value, 2 * u, "measured", "whole"), "guard", 0
            ).verdict
            == "PASS"
        )
        raw_too_large += found.raw_range_arcsec > high
        widths.append(u / found.range.value)
    assert hits >= 19
    assert within >= 19
    assert passed <= 1  # 5 % at most
    assert raw_too_large > 10  # what the uncorrected range would have said
    assert np.median(widths) < 0.05  # the uncertainty is not idle


@pytest.fixture(scope="module")
def model():
    """Cam turns and error of the full cycle of the small drive."""
    result = trace(load_preset(SMALL), 4, revolutions=30, run=UNCHECKED)
    return result.error.states.phi_h / (2 * np.pi), result.error.error_arcsec


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


def test_orders_of_a_model_have_its_causes(model):
    (found,) = measure(recorded(*model), drive=load_preset(SMALL)).directions
    causes = {round(o.per_cam_rev, 3): o for o in found.orders}
    assert causes[round(2 + 1 / 30, 3)].cause == "flexspline + rigid wheel"
    assert "once per output turn: also encoder" in causes[round(1 / 30, 3)].cause
    assert "once per cam turn: also the cam's encoder" in causes[1.0].cause
    spectrum = 2 * np.abs(np.fft.rfft(model[1])) / len(model[1])
    assert causes[2.0].amplitude_arcsec == pytest.approx(spectrum[60], abs=0.05)


def test_a_clean_wave_comes_back():
    turns = np.sort(np.random.default_rng(1).uniform(0, 4, 900))
    error = 7 + 10 * np.cos(2 * np.pi * 2 * turns + 0.5) + 1e-3 * np.sin(1e4 * turns)
    (found,) = measure(recorded(turns, error), ratio=100).directions
    order = next(o for o in found.orders if o.per_cam_rev == 2)
    assert (order.amplitude_arcsec, order.phase_deg) == pytest.approx((10, np.degrees(0.5)), abs=1e-2)
    assert found.range.value == pytest.approx(20, abs=0.05)


def test_amplitudes_are_as_uncertain_as_they_say():
    turns = np.arange(600) / 150
    departures = []
    for seed in range(40):
        noise = slow_noise(np.random.default_rng(seed), 600, 1.0, 0.9)
        (found,) = measure(recorded(turns, 10 * np.cos(4 * np.pi * turns) + noise), ratio=100).directions
        _, amplitude, uncertainty, _ = found.fit.wave(np.flatnonzero(found.fit.orders == 2))
        departures.append((amplitude - 10) / uncertainty)
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


def test_an_order_alone_has_room_for_the_beats_that_a_part_leaves_open():
    """Order 2 with a beat of the same size, over the cycle 10 of 20 that a part of it may show."""
    turns = np.arange(12 * 60) / 60
    error = 10 * (np.cos(4 * np.pi * turns) + np.cos(2 * np.pi * 2.01 * turns))
    noise = 0.1 * np.random.default_rng(0).standard_normal(len(turns))
    (found,) = measure(recorded(turns, error + noise), ratio=100).directions
    order = min(found.orders, key=lambda o: abs(o.per_cam_rev - 2))
    assert order.amplitude_arcsec > 12
    assert abs(order.amplitude_arcsec - 10) <= 2 * order.uncertainty_arcsec


def wave(turns: np.ndarray, seed: int = 0) -> np.ndarray:
    noise = 0.3 * np.random.default_rng(seed).standard_normal(len(turns))
    return 10 * np.cos(4 * np.pi * turns) + 3 * np.cos(2 * np.pi * turns + 1) + noise


EVEN = np.arange(600) / 200


def test_directions_are_kept_apart():
    turns = np.concatenate([EVEN, EVEN[::-1]])
    error = wave(turns) + np.repeat([0.0, 5.0], 600)
    result = measure(recorded(turns, error), ratio=100)
    assert {d.direction for d in result.directions} == {1, -1}
    assert result.reversal is not None
    assert result.reversal.mean_arcsec == pytest.approx(-5, abs=0.1)
    assert result.reversal.greatest_departure_arcsec < 1
    for found in result.directions:  # the step between the directions is no part of F'_ior
        assert found.range.value == pytest.approx(24.2, abs=0.4)


def test_repeated_runs_in_one_record_share_their_orders():
    result = measure(recorded(np.concatenate([EVEN, EVEN]), np.concatenate([wave(EVEN), 3 + wave(EVEN, 1)])), ratio=100)
    (found,) = result.directions
    assert len(found.fit.level) == 2
    assert found.range.value == pytest.approx(24.2, abs=0.4)


def test_falling_angles_alone():
    (found,) = measure(recorded(EVEN[::-1], wave(EVEN)[::-1]), ratio=100).directions
    assert found.direction == -1
    assert found.range.value == pytest.approx(24.2, abs=0.4)


def test_a_shaft_that_stands_still_weighs_no_more():
    turns = np.concatenate([EVEN[:300], np.full(5000, EVEN[300]), EVEN[301:]])
    (found,) = measure(recorded(turns, wave(turns)), ratio=100).directions
    assert found.range.value == pytest.approx(24.2, abs=0.4)


def test_a_gap_is_not_visited():
    turns = np.concatenate([EVEN[:250], EVEN[400:]])
    (found,) = measure(recorded(turns, wave(turns)), ratio=100).directions
    gap = (found.grid_turns > EVEN[249] + 0.01) & (found.grid_turns < EVEN[400] - 0.01)
    assert not gap.any()
    assert found.coverage is not None
    assert found.coverage.cam_turns < 3 - 20 / 36


def test_drift_is_taken_off_when_asked_and_said_when_not():
    error = wave(EVEN) + 4 * EVEN
    left = measure(recorded(EVEN, error), ratio=100)
    assert any("drift of 1" in text and "--drift linear" in text for text in left.warnings)
    (found,) = measure(recorded(EVEN, error), ratio=100, drift="linear").directions
    assert found.range.value == pytest.approx(24.2, abs=0.4)
    assert found.fit.drift.sum() == pytest.approx(12, abs=0.6)
    bent = measure(recorded(EVEN, error + 6 * (EVEN - 1.5) ** 2), ratio=100, drift="quadratic")
    assert bent.F_ior_arcsec == pytest.approx(24.2, abs=0.4)


def test_a_cycle_that_does_not_close_drifts():
    turns, error, curve = simulated(0)
    clean = measure(recorded(turns, error), ratio=RATIO)
    assert not clean.warnings
    for shape in (turns / RATIO, (turns / RATIO) ** 2, np.sqrt(turns / RATIO)):
        result = measure(recorded(turns, error + 12 * shape), ratio=RATIO)
        (text,) = result.warnings
        assert "does not close: linear drift of 1" in text
        (found,) = result.directions
        low, high = found.interval_arcsec
        assert low < whole_range(curve, RATIO) < high
        assert found.range.value == pytest.approx(clean.F_ior_arcsec, abs=3)
        assert next(s.arcsec for s in found.sources if s.name == "drift") == pytest.approx(12 / 4 / np.sqrt(3), rel=0.2)


def test_a_wrong_ratio_is_asked_about():
    """Over the cycle of a wrong ratio the slow terms of the output do not come round."""
    turns, _, _ = simulated(0)
    error = 5 * np.cos(4 * np.pi * turns) + 4 * np.sin(2 * np.pi * turns / RATIO)
    error += 0.5 * np.random.default_rng(0).standard_normal(len(turns))
    assert not measure(recorded(turns, error), ratio=RATIO).warnings
    assert any("is the ratio right?" in text for text in measure(recorded(turns, error), ratio=24).warnings)


def test_a_spike_is_refused_or_left_out_and_named():
    turns, error, curve = simulated(0)
    error[777] += 500
    rig = recorded(turns, error)
    with pytest.raises(UntrustedError, match=r"lines 778: .* no readings of a shaft"):
        measure(rig, ratio=RATIO)
    result = measure(replace(rig, robust=True), ratio=RATIO)
    (text,) = result.warnings
    assert text.startswith("lines 778: ")
    assert "left out" in text
    low, high = result.directions[0].interval_arcsec
    assert low < whole_range(curve, RATIO) < high < low + 3
    error[::16] += 500
    with pytest.raises(UntrustedError, match=r"lines 1, 17, 33 ... \(22[56] in all\): .* too many to leave out"):
        measure(replace(recorded(turns, error), robust=True), ratio=RATIO)
    bump = simulated(0)[1]
    bump[700:760] += 60  # lasts half a turn: no reading of one row
    assert not [text for text in measure(recorded(turns, bump), ratio=RATIO).warnings if "lines" in text]


def test_a_turning_point_is_no_spike():
    turns = np.concatenate([EVEN, EVEN[::-1]])
    found = measure(recorded(turns, wave(turns) + np.repeat([0.0, 5.0], 600)), ratio=100)
    assert [int(each.bins.rows.sum()) for each in found.directions] == [600, 600]


def test_many_outliers_are_left_out_when_asked_and_their_effect_said():
    turns, error, curve = simulated(0)
    rng = np.random.default_rng(3)
    off = rng.random(len(turns)) < 0.05
    error[off] += rng.normal(0, 80, off.sum())
    result = measure(replace(recorded(turns, error), robust=True), ratio=RATIO)
    low, high = result.directions[0].interval_arcsec
    assert low < whole_range(curve, RATIO) < high < low + 4
    assert result.warnings
    assert all("left out; else the curve would span" in text for text in result.warnings)


@pytest.mark.parametrize(("turns", "step", "share"), [(69.84, 20, 69.84 / 101), (101, 15, 1.0)])
def test_coverage_is_of_turns_however_sparse(turns, step, share):
    x = np.arange(0, turns * 360, step) / 360
    found = measure(recorded(x, wave(x)), ratio=101).directions[0]
    assert found.coverage is not None
    assert found.coverage.share == pytest.approx(share, abs=0.002)
    assert found.coverage.cam_turns == pytest.approx(turns, abs=0.2)
    assert found.coverage.step_deg == pytest.approx(step)
    assert found.is_bound == (share < 1)


def test_a_part_of_the_cycle_is_a_bound():
    (part,) = measure(recorded(EVEN, wave(EVEN)), ratio=100).directions
    assert part.is_bound
    assert part.coverage is not None
    assert part.coverage.cam_turns == pytest.approx(3, abs=0.02)
    assert part.coverage.share == pytest.approx(0.03, abs=2e-4)
    (unknown,) = measure(recorded(EVEN, wave(EVEN))).directions
    assert unknown.is_bound
    assert unknown.coverage is None


@pytest.mark.parametrize(
    ("turns", "error", "words"),
    [
        (EVEN, np.random.default_rng(0).standard_normal(600), "not clear of its noise"),
        (EVEN[:190], wave(EVEN[:190]), "less than one cam turn"),
        (EVEN, wave(EVEN) + 60 * EVEN, "not clear"),
    ],
)
def test_what_cannot_be_trusted_is_not_given(turns, error, words):
    with pytest.raises((UntrustedError, DataError), match=words):
        measure(recorded(turns, error), ratio=100)


def test_steps_too_long_for_an_order():
    turns = np.arange(60) / 20
    assert any("orders up to 8 only" in text for text in measure(recorded(turns, wave(turns)), ratio=100).notes)
    with pytest.raises(UntrustedError, match="too long for order 12"):
        measure(recorded(turns, wave(turns)), ratio=100, orders=range(1, 13))


def test_budget():
    stated = parse_stated(["encoder=0.3", "temperature=0.4"])
    (found,) = measure(recorded(EVEN, wave(EVEN)), ratio=100, stated=stated).directions
    (bare,) = measure(recorded(EVEN, wave(EVEN)), ratio=100).directions
    assert found.uncertainty_arcsec == pytest.approx(np.hypot(bare.uncertainty_arcsec, 0.5))
    assert {s.name for s in bare.sources if s.arcsec is None} == {"encoder", "coupling", "reseating", "temperature"}
    assert combined(bare.sources) == bare.uncertainty_arcsec
    for wrong in (["x=1"], ["encoder"], ["encoder=-1"], ["encoder=nan"], ["encoder=1", "encoder=2"]):
        with pytest.raises(UsageError):
            parse_stated(wrong)


def test_a_coarse_reading_without_noise_counts():
    error = np.round(10 * np.cos(4 * np.pi * EVEN))
    coarse = measure(recorded(EVEN, error, step=1.0), ratio=100).directions[0]
    (source,) = (s for s in coarse.sources if s.name == "resolution")
    assert source.arcsec == pytest.approx(1 / np.sqrt(6))


def by_two_encoders(step: float, uneven: float):
    """What is read of an error of 30 arcsec by encoders at both shafts, the output's with steps [arcsec]."""
    turns = np.arange(6000) / 200
    error = 14 * np.cos(4 * np.pi * turns) + np.cos(2 * np.pi * turns / 30)
    file = encoders.recorded(error, 30, step, 0.01, 0.0, uneven)
    return measure(read_trace(file, TraceForm(second="output_deg"), ratio=30), ratio=30).directions[0]


@pytest.mark.parametrize("step", [1.0, 5.0])
def test_steps_that_come_round_with_the_turns_are_in_the_interval(step: float):
    found = by_two_encoders(step, encoders.CAM)
    low, high = found.interval_arcsec
    assert low < 30 < high
    (source,) = (s for s in found.sources if s.name == "resolution")
    assert source.arcsec == pytest.approx(step / np.sqrt(3), rel=1e-3)
    by_clock = by_two_encoders(step, encoders.CLOCK)
    assert next(s for s in by_clock.sources if s.name == "resolution").arcsec == 0
    low, high = by_clock.interval_arcsec
    assert low < 30 < high


@pytest.mark.parametrize(("uneven", "in_time"), [(encoders.CAM, True), (encoders.CLOCK, False)])
def test_steps_are_seen_in_a_record_of_both_directions(uneven: float, in_time: bool):
    head, *rows = encoders.recorded(14 * np.cos(np.arange(6000) * np.pi / 50), 30, 1.0, 0.01, 0.0, uneven).splitlines()
    found = read_trace(b"\n".join([head, *rows, *rows[-2::-1]]), TraceForm(second="output_deg"), ratio=30)
    assert len(found.sweeps) == 2
    assert found.in_time is in_time
    assert found.step_arcsec == pytest.approx(1.0 if in_time else 0.0, rel=1e-3)


def timed(speeds: list[np.ndarray], lag_s: float, play: float = 0.0):
    """A record of two encoders at speeds [turns/s] of sweeps in turn, the output read later by a lag [s]."""
    rng = np.random.default_rng(0)
    speed = np.concatenate(speeds)
    time = np.arange(len(speed)) * 0.02
    cam = np.cumsum(speed) * 0.02
    later = cam + speed * lag_s
    way = np.repeat([np.sign(each.mean()) for each in speeds], [len(each) for each in speeds])
    error = 14 * np.cos(4 * np.pi * later) + 2 * np.cos(2 * np.pi * later) + play * way / 2
    output = later / 100 + (error + 0.3 * rng.standard_normal(len(cam))) / 1296000
    file = text([time, cam * 360, output * 360], "time_s,cam_deg,output_deg", digits=8)
    return measure(read_trace(file.encode(), ratio=100), ratio=100)


UNEVEN = 1 + 0.1 * np.sin(np.arange(600) / 40)
EVEN_SPEED = np.ones(600)


def test_a_lag_between_the_encoders_is_told_by_a_speed_that_changes():
    for speeds in ([UNEVEN], [UNEVEN, -UNEVEN]):
        found = timed(speeds, 0.004, play=8.0)
        assert found.lag is not None
        assert abs(found.lag.ms - 4) <= 3 * found.lag.uncertainty_ms < 1.5
        for direction in found.directions:  # the way in between is none of the error
            assert direction.range.value == pytest.approx(30, abs=1)


def test_a_lag_at_one_speed_is_not_told_and_no_part_of_the_error():
    turning = np.append(np.ones(350), [0.5])  # a change of speed at the turning point alone
    for speeds in ([EVEN_SPEED], [EVEN_SPEED, -EVEN_SPEED], [turning, -turning[::-1]]):
        found = timed(speeds, 0.004, play=8.0)
        assert found.lag is None
        assert found.F_ior_arcsec == pytest.approx(30, abs=1)


@pytest.mark.parametrize("turns", [12, 60, 100])
def test_slow_terms_of_the_output_are_no_orders_of_the_cam(turns: float):
    """Gravity, graduation, an encoder off its centre, once to five times per output turn; drift where it is a part."""
    x = np.arange(turns * 50) / 50
    cam = 8 * np.cos(4 * np.pi * x) + 3 * np.cos(2 * np.pi * 2.01 * x + 1) + 2 * np.cos(2 * np.pi * x)
    slow = sum(size * np.cos(2 * np.pi * k * x / 100 + k) for k, size in ((1, 300), (2, 20), (5, 3)))
    noise = 0.5 * np.random.default_rng(0).standard_normal(len(x))
    (found,) = measure(recorded(x, cam + slow + noise), ratio=100).directions
    assert found.is_part == (turns < 100)
    low, high = found.cam_interval_arcsec
    assert low < np.ptp(cam) < high < low + 6
    assert found.slow_arcsec == pytest.approx(np.ptp(slow), rel=0.05)
    orders = {order.per_cam_rev: order for order in found.orders_of_cam}
    # of a part of the output's turn the uncertainty has room for the beats that it leaves open
    most = {12: 8.0, 60: 2.5, 100: 0.4}[turns]
    for order, true in ((1.0, 2.0), (2.0, np.hypot(8, 3)), (3.0, 0.0)):
        assert abs(orders[order].amplitude_arcsec - true) <= 3 * orders[order].uncertainty_arcsec
        assert orders[order].uncertainty_arcsec < most
    assert found.slow_cost < 0.3
    # F'_ior of the record has them where they are told from drift: in an output turn
    assert (found.range.value > 600) == (turns == 100)


def test_a_missing_row_is_no_step():
    turns = np.arange(5000) / 50
    error = 14 * np.cos(4 * np.pi * turns) + np.cos(2 * np.pi * turns / 100)
    file = encoders.recorded(error, 100, 1e-3, 0.01, 0.0, encoders.CAM).splitlines()
    file.pop(1234)
    trace = read_trace(b"\n".join(file), TraceForm(second="output_deg"), ratio=100)
    assert (trace.step_arcsec, trace.in_time) == (0, False)
    assert measure(trace, ratio=100).F_ior_arcsec == pytest.approx(30, abs=0.2)


def test_steps_that_may_be_the_error_are_refused():
    with pytest.raises(UntrustedError, match="steps of 20″ at even angles"):
        by_two_encoders(20.0, encoders.CAM)
    assert by_two_encoders(20.0, encoders.CLOCK).range.value == pytest.approx(30, abs=5)


def test_the_same_seed_gives_the_same_figures():
    first, again = (measure(recorded(EVEN, wave(EVEN)), ratio=100, seed=4).F_ior_arcsec for _ in range(2))
    assert first == again


def test_rounding_does_not_move_the_draws():
    turns, error, _ = simulated(0)
    turns = turns + 0.37 / PER_TURN  # no reading at the edge of a bin
    apart = turns + 1e-13 * np.random.default_rng(2).standard_normal(len(turns))
    (one,), (two,) = (measure(recorded(angles, error), ratio=RATIO).directions for angles in (turns, apart))
    assert np.abs(one.fit.factor - two.fit.factor).max() < 1e-6 * np.abs(one.fit.factor).max()


def test_simulated_benches_are_held():
    """The short form of `python -m benchmarks.records`."""
    held = records.Held({})
    for seed in range(3):
        records.look(seed, records.RATIO, held)
    records.look(0, 0.6 * records.RATIO, held)
    for quantity in ("F'_ior", "range of the cam's orders", "lag"):
        hits, count = held.count[quantity]
        assert hits == count
    hits, count = held.count["orders"]  # 95 of 100 in 500 benches
    assert hits >= 0.85 * count
