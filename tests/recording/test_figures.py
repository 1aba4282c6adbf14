"""F'_ior and its verdict: two ends, few samples, travels."""

from dataclasses import replace

import numpy as np
import pytest

from hdassist.recording.figures import RangeFigure, part_to_record, range_figure
from hdassist.recording.positions import recording_from_columns
from hdassist.recording.posterior import posterior_of_recording
from hdassist.run.errors import UsageError, Verdict
from tests.recording.readings import RATIO, known_error, known_range, noisy_readings

TRUE = known_range()


@pytest.fixture(scope="module")
def whole():
    return posterior_of_recording(recording_from_columns(*noisy_readings(), RATIO))


@pytest.fixture(scope="module")
def part():
    recording = recording_from_columns(*noisy_readings(readings=200, span=9.0), RATIO)
    return posterior_of_recording(recording, most_draws=240)


def test_a_whole_cycle_decides_both_ways(whole):
    figure = range_figure(whole)
    low, high = figure.interval_arcsec
    assert low < TRUE < high
    assert high - low < 0.06 * TRUE
    assert figure.verdict(0.93 * TRUE) is Verdict.FAIL
    assert figure.verdict(1.07 * TRUE) is Verdict.PASS
    assert figure.verdict(TRUE) is Verdict.INCONCLUSIVE
    assert figure.verdict(1.07 * TRUE, uncertainty_arcsec=0.1 * TRUE) is Verdict.INCONCLUSIVE


@pytest.mark.thorough
def test_a_part_of_the_cycle_leaves_a_wide_upper_end(whole, part):
    figure = range_figure(part)
    low, high = figure.interval_arcsec
    visited = float(np.ptp(known_error(np.arange(0, 9, 1 / 500))))
    assert low < visited * 1.03
    assert high > 1.2 * visited
    assert high - low > 5 * np.subtract(*range_figure(whole).interval_arcsec[::-1])
    assert figure.verdict(1.03 * TRUE) is not Verdict.FAIL
    assert figure.verdict(0.8 * visited) is Verdict.FAIL


def test_a_travel_is_a_part_of_the_cycle(whole, part):
    truth = float(np.ptp(known_error(np.arange(0.25 * RATIO, 0.5 * RATIO, 1 / 500))))
    low, high = range_figure(whole, travel_rev=(0.25, 0.5)).interval_arcsec
    assert low < truth < high
    unvisited = range_figure(part, travel_rev=(0.5, 0.7))
    assert unvisited.visited_share == 0
    assert unvisited.interval_arcsec[0] == 0
    assert unvisited.verdict(0.1) is Verdict.INCONCLUSIVE
    assert range_figure(whole, travel_rev=(3.0, 4.5)).visited_share == range_figure(whole).visited_share
    with pytest.raises(UsageError):
        range_figure(whole, travel_rev=(0.2, 0.2))


def test_noise_adds_nothing_to_the_value_of_a_cosine():
    # the range of the samples is 21.5, that of their mean 20.6
    turns = np.arange(0, 10, 1 / 80)
    values = []
    for seed in (0, 1):
        noise = np.random.default_rng(seed).standard_normal(len(turns))
        recording = recording_from_columns(turns, 10 * np.cos(4 * np.pi * turns) + noise, 10)
        cosine = range_figure(posterior_of_recording(recording, most_draws=160))
        values.append(cosine.median_recorded_arcsec)
        assert cosine.interval_arcsec[0] < 20 < cosine.interval_arcsec[1]
    assert np.mean(values) == pytest.approx(20, abs=0.4)


def test_nothing_exceeds_the_range_of_the_readings(whole):
    assert range_figure(replace(whole, readings_range=5.0)).seen_arcsec.max() <= 5.0


def figure(whole, seen, effective=200.0):
    """A figure of 200 samples around two values."""
    spread = np.linspace(-1, 1, 200)
    return RangeFigure(
        whole_arcsec=whole + spread,
        recorded_arcsec=whole + spread,
        seen_arcsec=seen + spread,
        visited_share=0.5,
        whole_effective=effective,
        seen_effective=effective,
    )


@pytest.mark.parametrize(
    ("limit", "verdict"), [(31.1, "PASS"), (30.0, "INCONCLUSIVE"), (20.0, "INCONCLUSIVE"), (18.9, "FAIL")]
)
def test_pass_asks_the_whole_cycle_and_fail_the_visited_places(limit, verdict):
    assert figure(whole=30.0, seen=20.0).verdict(limit) == verdict


def test_few_effective_samples_decide_nothing():
    few = figure(whole=30.0, seen=20.0, effective=12.0)
    assert few.has_few_samples
    assert few.verdict(31.1) is Verdict.INCONCLUSIVE
    assert few.verdict(18.9) is Verdict.INCONCLUSIVE


def recorded(curve, readings, sigma, span=RATIO, seed=0):
    """The figure of a recording of a curve of the input angle."""
    turns = np.arange(readings) * span / readings
    error = curve(turns) + sigma * np.random.default_rng(seed).standard_normal(readings)
    return range_figure(posterior_of_recording(recording_from_columns(turns, error, RATIO)))


@pytest.mark.thorough
def test_orders_that_coarse_readings_hide_stay_open():
    def fine(turns):
        return 9 * np.cos(4 * np.pi * turns) + 8 * np.cos(2 * np.pi * 15 * turns)

    true = float(np.ptp(fine(np.arange(0, 1, 1 / 2000))))
    even = recorded(fine, readings=int(20 * RATIO), sigma=0.3)  # 15 periods look like 5 there
    assert even.interval_arcsec[0] < true
    for share in (0.9, 0.97):
        assert even.verdict(share * true) is not Verdict.PASS
    resolved = recorded(fine, readings=int(31.3 * RATIO), sigma=0.3)  # 2.1 a period
    assert resolved.interval_arcsec[0] < true < resolved.interval_arcsec[1]
    assert resolved.verdict(0.8 * true) is Verdict.FAIL


@pytest.mark.thorough
def test_a_steep_flank_does_not_fail_by_its_overshoot():
    def steep(turns):
        return 5 * np.tanh(8 * np.sin(4 * np.pi * turns + 0.3))

    figure = recorded(steep, readings=int(40 * RATIO), sigma=0.2)
    assert figure.verdict(1.02 * 10.0) is not Verdict.FAIL
    assert figure.verdict(0.9 * 10.0) is Verdict.FAIL


@pytest.mark.thorough
def test_a_bent_drift_is_no_error():
    def drifting(turns):
        return 9 * np.cos(4 * np.pi * turns) + 4 * (turns / RATIO) ** 2 - turns / RATIO

    low, high = recorded(drifting, readings=int(40 * RATIO), sigma=0.3).interval_arcsec
    assert low < 18.0 < high < 19.5


def test_slow_waves_of_a_part_of_the_cycle_stay_open():
    def slow(turns):
        return 3 * np.cos(4 * np.pi * turns) + 8 * np.cos(2 * np.pi * turns / RATIO)

    figure = recorded(slow, readings=400, sigma=0.3, span=10.0)
    assert figure.interval_arcsec[1] > 22.0
    assert figure.verdict(20.0) is not Verdict.PASS


def test_the_ends_of_an_interval_are_farther_with_few_samples():
    many, few = figure(whole=30.0, seen=20.0, effective=1e6), figure(whole=30.0, seen=20.0, effective=50.0)
    assert np.isclose(many.interval_arcsec, (19.05, 30.95), atol=0.01).all()
    assert few.interval_arcsec[0] < many.interval_arcsec[0]
    assert few.interval_arcsec[1] > many.interval_arcsec[1]


def test_part_to_record_contains_the_extremes_not_covered(whole, part):
    assert part_to_record(whole) is None
    first, last = part_to_record(part)
    assert 9.0 <= first < last <= RATIO + 9.0
