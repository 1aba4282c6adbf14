"""Rows lost in short gaps, and columns beside the angle and the error, of rigs whose truth is known."""

from __future__ import annotations

import io
import time

import numpy as np
import pytest

from hdassist.features.measuring.measure import Measurement, measure
from hdassist.readers.trace import TraceForm, read_trace
from tests.helpers.rigs import recorded, text

RATIO, ROWS = 100, 60


def burst(seed: int, names: str = "cam_deg,error_arcsec", beside: tuple[float, ...] = ()) -> tuple[Measurement, float]:
    """A full cycle of which a quarter of the rows is lost in gaps of one to six, and its true F'_ior."""
    rng = np.random.default_rng(seed)
    p = rng.uniform(0, 2 * np.pi, 4)

    def error(turns):
        x = 2 * np.pi * turns
        return (
            8 * np.cos(2 * x + p[0]) * (1 + 0.3 * np.cos(x / RATIO + p[1]))
            + 2 * np.cos(x + p[2])
            + 3 * np.cos(x / RATIO)
        )

    turns = (np.arange(RATIO * ROWS) + rng.uniform(-0.1, 0.1, RATIO * ROWS)) / ROWS
    kept = np.ones(len(turns), bool)
    while kept.mean() > 0.75:
        first = rng.integers(len(turns))
        kept[first : first + rng.integers(1, 7)] = False
    turns = turns[kept]
    noise = 0.5 * rng.standard_normal(len(turns))
    columns = [turns * 360, error(turns) + noise, *(np.full(len(turns), value) + noise / 10 for value in beside)]
    trace = read_trace(io.StringIO(text(columns, names)), TraceForm(), RATIO)
    return measure(trace, ratio=RATIO), float(np.ptp(error(np.arange(RATIO * 400) / 400)))


@pytest.mark.thorough
def test_rows_lost_in_short_gaps_leave_no_lower_bound():
    held = 0
    for seed in range(8):
        found, true = burst(seed)
        low, high = found.directions[0].interval_arcsec
        assert not found.directions[0].is_bound
        held += low <= true <= high
    assert held >= 7


def test_a_lost_turn_is_a_gap():
    turns = np.arange(RATIO * ROWS) / ROWS
    error = 8 * np.cos(4 * np.pi * turns) + 0.3 * np.random.default_rng(1).standard_normal(len(turns))
    kept = (turns < 40) | (turns > 41)
    (found,) = measure(recorded(turns[kept], error[kept]), ratio=RATIO).directions
    assert found.coverage.cam_turns < RATIO - 0.9


def test_columns_that_are_not_used_are_named():
    found, _ = burst(1, "cam_deg,error_arcsec,temp_C,speed_rpm,torque_Nm", (25.0, 60.0, 80.0))
    (words,) = [note for note in found.notes if "not used" in note]
    assert words.startswith('not used: "temp_C" (24.')
    assert '"speed_rpm" (59.' in words
    assert "torque_Nm" not in words  # its change is looked at


@pytest.mark.thorough
def test_a_record_costs_at_most_about_twice_plain_least_squares():
    """Its own columns in one least squares; 20 200 rows, the least of three."""
    turns = np.arange(20_200) / 202
    error = 8 * np.cos(4 * np.pi * turns) + 0.5 * np.random.default_rng(0).standard_normal(len(turns))
    trace, costs = recorded(turns, error), []
    for _ in range(3):
        begun = time.process_time()
        fit = measure(trace, ratio=RATIO).directions[0].fit
        middle = time.process_time()
        phase = 2 * np.pi * np.outer(turns, fit.orders)
        np.linalg.lstsq(np.concatenate([np.cos(phase), np.sin(phase), np.ones((len(turns), 1))], axis=1), error)
        costs.append((middle - begun) / (time.process_time() - middle))
    assert min(costs) < 2.6  # 1.9 on a quiet machine
