"""Directions, repeated runs, coverage and drift of a measured trace."""

from __future__ import annotations

import numpy as np
import pytest

from hdassist.features.measuring.measure import measure
from hdassist.interface.pages.measure import measure_report
from tests.helpers.rigs import EVEN, RATIO, drive_error, even_wave, recorded, simulated, whole_range


def test_directions_are_kept_apart():
    turns = np.concatenate([EVEN, EVEN[::-1]])
    error = even_wave(turns) + np.repeat([0.0, 5.0], 600)
    result = measure(recorded(turns, error), ratio=100)
    assert {d.direction for d in result.directions} == {1, -1}
    assert result.reversal is not None
    assert result.reversal.mean_arcsec == pytest.approx(-5, abs=0.1)
    assert result.reversal.greatest_departure_arcsec < 1
    for found in result.directions:  # the step between the directions is no part of F'_ior
        assert found.range.value == pytest.approx(24.2, abs=0.4)


def test_repeated_runs_in_one_record_share_their_orders():
    result = measure(
        recorded(np.concatenate([EVEN, EVEN]), np.concatenate([even_wave(EVEN), 3 + even_wave(EVEN, 1)])), ratio=100
    )
    (found,) = result.directions
    assert len(found.fit.level) == 2
    assert found.range.value == pytest.approx(24.2, abs=0.4)


def test_falling_angles_alone():
    (found,) = measure(recorded(EVEN[::-1], even_wave(EVEN)[::-1]), ratio=100).directions
    assert found.direction == -1
    assert found.range.value == pytest.approx(24.2, abs=0.4)


def test_a_shaft_that_stands_still_weighs_no_more():
    turns = np.concatenate([EVEN[:300], np.full(5000, EVEN[300]), EVEN[301:]])
    (found,) = measure(recorded(turns, even_wave(turns)), ratio=100).directions
    assert found.range.value == pytest.approx(24.2, abs=0.4)


def test_a_gap_is_not_visited():
    turns = np.concatenate([EVEN[:250], EVEN[400:]])
    (found,) = measure(recorded(turns, even_wave(turns)), ratio=100).directions
    gap = (found.grid_turns > EVEN[249] + 0.01) & (found.grid_turns < EVEN[400] - 0.01)
    assert not gap.any()
    assert found.coverage is not None
    assert found.coverage.cam_turns < 3 - 20 / 36


def test_drift_is_taken_off_when_asked_and_said_when_not():
    error = even_wave(EVEN) + 4 * EVEN
    left = measure(recorded(EVEN, error), ratio=100)
    assert any("drift of 1" in text and "--drift linear" in text for text in left.warnings)
    (found,) = measure(recorded(EVEN, error), ratio=100, drift="linear").directions
    assert found.range.value == pytest.approx(24.2, abs=0.4)
    assert found.fit.drift.sum() == pytest.approx(12, abs=0.6)
    bent = measure(recorded(EVEN, error + 6 * (EVEN - 1.5) ** 2), ratio=100, drift="quadratic")
    assert bent.F_ior_arcsec == pytest.approx(24.2, abs=0.4)


@pytest.mark.thorough
def test_a_cycle_that_does_not_close_drifts():
    turns, error, curve = simulated(0)
    clean = measure(recorded(turns, error), ratio=RATIO)
    assert not clean.warnings
    for shape in (turns / RATIO, (turns / RATIO) ** 2, np.sqrt(turns / RATIO)):
        result = measure(recorded(turns, error + 12 * shape), ratio=RATIO)
        (text,) = result.warnings
        assert "does not close over the cycle, so a linear drift of 1" in text
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
    assert any("check the ratio" in text for text in measure(recorded(turns, error), ratio=24).warnings)


@pytest.mark.thorough
@pytest.mark.parametrize(("turns", "step", "share"), [(69.84, 20, 69.84 / 101), (101, 15, 1.0)])
def test_coverage_is_of_turns_however_sparse(turns, step, share):
    x = np.arange(0, turns * 360, step) / 360
    found = measure(recorded(x, even_wave(x)), ratio=101).directions[0]
    assert found.coverage is not None
    assert found.coverage.share == pytest.approx(share, abs=0.002)
    assert found.coverage.cam_turns == pytest.approx(turns, abs=0.2)
    assert found.is_bound == (share < 1)


def test_a_part_of_the_cycle_is_a_bound():
    (part,) = measure(recorded(EVEN, even_wave(EVEN)), ratio=100).directions
    assert part.is_bound
    assert part.coverage is not None
    assert part.coverage.cam_turns == pytest.approx(3, abs=0.02)
    assert part.coverage.share == pytest.approx(0.03, abs=2e-4)
    (unknown,) = measure(recorded(EVEN, even_wave(EVEN))).directions
    assert unknown.is_bound
    assert unknown.coverage is None


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [7, 9, 21])
def test_a_lower_bound_lies_below_the_hidden_truth(seed: int):
    """Of nine of thirty turns noise makes the value itself about as great as F'_ior of the full cycle, or greater."""
    rng = np.random.default_rng([seed, 7])
    curve = drive_error(rng, RATIO)
    turns = np.arange(9 * 60) / 60 + rng.uniform(0, RATIO)
    result = measure(recorded(turns, curve(turns) + 0.5 * rng.standard_normal(len(turns))), ratio=RATIO)
    true, answer = whole_range(curve, RATIO), measure_report(result, None).line
    assert result.F_ior_arcsec > 0.97 * true  # it is no more than the range of the readings
    assert answer.startswith(">= ")
    assert 0.8 * true < float(answer.removeprefix(">= ").removesuffix("″")) < true
