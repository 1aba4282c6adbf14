"""F'_ior of the full cycle from a part of it: both ends, the cleaning before, and the domain in which it is given."""

import json
from io import BytesIO

import numpy as np
import pytest

from hdassist.features.measuring.full_cycle import cleaned_recording, full_cycle, reason_outside, with_full_cycle
from hdassist.features.measuring.measure import measure
from hdassist.features.measuring.orders import FullCycle
from hdassist.interface.pages.measure import measure_report
from hdassist.readers.trace import read_trace
from tests.helpers.paper import facts_of
from tests.helpers.process import run

RATIO, PER_TURN = 30, 40


def true_error(turns):
    """Error [arcsec] at input angles [rev]: orders of the input, of the output, and a sideband."""
    error = 8 * np.cos(4 * np.pi * turns) + 2 * np.cos(8 * np.pi * turns + 1.0) + 3 * np.cos(2 * np.pi * turns / RATIO)
    return error + 3 * np.cos(2 * np.pi * (2 + 2 / RATIO) * turns + 0.5)


TRUE = float(np.ptp(true_error(np.arange(0, RATIO, 1 / 500))))


def file_of(turns, error=None, **columns):
    """A file of a recording, with 0.3 arcsec of noise."""
    noise = 0.3 * np.random.default_rng(1).standard_normal(len(turns))
    values = {
        "cam_deg": 360 * turns,
        "error_arcsec": (true_error(turns) if error is None else error) + noise,
        **columns,
    }
    rows = zip(*values.values(), strict=True)
    return "\n".join([",".join(values), *(",".join(f"{value:.6f}" for value in row) for row in rows)]).encode()


def measured(turns, error=None, ratio=RATIO, travel_deg=None, **columns):
    """A measurement of such a file."""
    trace = read_trace(BytesIO(file_of(turns, error, **columns)))
    return measure(trace, ratio=ratio, travel_deg=travel_deg)


def turns_of(share):
    """Input angles [rev] of a share of the cycle."""
    return np.arange(int(share * RATIO * PER_TURN)) / PER_TURN


@pytest.mark.thorough
@pytest.mark.parametrize("share", [0.4, 0.75])
def test_a_part_of_the_cycle_has_both_ends(share):
    result = measured(turns_of(share))
    (sweep,) = result.directions
    found = full_cycle(result, sweep)
    assert isinstance(found, FullCycle)
    low, high = found.interval_arcsec
    assert low < found.value_arcsec < TRUE < high
    assert low < found.at_least_arcsec < found.value_arcsec
    first, last = found.record_next_rev
    assert share * RATIO - 1 <= first < last <= RATIO


@pytest.mark.thorough
def test_more_of_the_cycle_narrows_it():
    ends = []
    for share in (0.3, 0.9):
        result = measured(turns_of(share))
        ends.append(full_cycle(result, result.directions[0]).interval_arcsec[1])
    assert TRUE < ends[1] < ends[0]


def test_a_step_of_the_level_is_cleaned_first():
    turns = turns_of(0.6)
    stepped = true_error(turns) + 40.0 * (turns > 9.3)
    result = measured(turns, stepped)
    (sweep,) = result.directions
    assert cleaned_recording(sweep, RATIO).sweep.max() == 1
    low, high = full_cycle(result, sweep).interval_arcsec
    assert low < TRUE < high < 40.0


def test_two_sweeps_of_a_direction_are_runs_of_their_own():
    forth, back, again = np.arange(360) / PER_TURN, 9 - np.arange(200) / PER_TURN, 4 + np.arange(600) / PER_TURN
    result = measured(np.concatenate([forth, back, again]))
    (sweep,) = (each for each in result.directions if each.direction == 1)
    assert cleaned_recording(sweep, RATIO).sweep.max() == 1
    low, high = full_cycle(result, sweep).interval_arcsec
    assert low < TRUE < high


@pytest.mark.thorough
def test_outside_its_domain_it_says_why():
    turns = turns_of(0.6)
    part = measured(turns)
    assert reason_outside(part, part.directions[0]) == ""
    ramp = true_error(turns) + 100.0 * turns
    torque = 10 + 5 * np.sin(2 * np.pi * turns / 7)
    for result in (
        measured(turns, ratio=None),
        measured(turns, travel_deg=300.0),
        measured(turns_of(0.08)),
        measured(turns, ramp),
        measured(turns, torque_Nm=torque),
    ):
        (sweep, *_) = result.directions
        assert isinstance(full_cycle(result, sweep), str)
        assert reason_outside(result, sweep)


@pytest.mark.thorough
def test_more_readings_than_the_model_takes_are_refused_by_name(monkeypatch):
    result = measured(turns_of(0.6))
    monkeypatch.setattr("hdassist.features.measuring.full_cycle.MOST_BLOCKS", 0.5 * RATIO * PER_TURN)
    assert "record one full mesh cycle" in full_cycle(result, result.greatest)
    monkeypatch.setattr("hdassist.features.measuring.full_cycle.MOST_BLOCKS", 0.7 * RATIO * PER_TURN)
    assert isinstance(full_cycle(result, result.greatest), FullCycle)


def roughness(turns):
    """Error of rough teeth [arcsec] at input angles [rev]: many small waves beyond the fitted orders."""
    rng = np.random.default_rng(0)
    waves = [(order + beat / RATIO, rng.uniform(0, 2 * np.pi)) for order in range(13, 18) for beat in range(-8, 9)]
    return sum(0.2 * np.cos(2 * np.pi * per_rev * turns + phase) for per_rev, phase in waves)


def test_full_cycle_interval_includes_waves_that_fitted_orders_omit():
    turns, fine = turns_of(1.0), np.arange(0, RATIO, 1 / 500)
    result = measured(turns, true_error(turns) + roughness(turns))
    true = float(np.ptp(true_error(fine) + roughness(fine)))
    assert result.greatest.interval_arcsec[1] < true  # of the fitted orders
    low, high = with_full_cycle(result).greatest.interval_arcsec
    assert low < true < high


@pytest.mark.thorough
def test_sources_that_the_model_does_not_contain_widen_both_ends():
    turns = turns_of(1.0)
    trace = read_trace(BytesIO(file_of(turns)))
    plain, budgeted = (
        with_full_cycle(measure(trace, ratio=RATIO, stated=stated)).greatest for stated in ({}, {"encoder": 1.0})
    )
    assert budgeted.interval_arcsec[0] < plain.interval_arcsec[0] - 1.0
    assert budgeted.interval_arcsec[1] > plain.interval_arcsec[1] + 1.0
    assert budgeted.uncertainty_arcsec == pytest.approx(np.hypot(plain.uncertainty_arcsec, 1.0), rel=0.01)


@pytest.mark.thorough
def test_json_has_the_interval_or_the_reason(tmp_path):
    for name, share in (("part", 0.6), ("whole", 1.0), ("short", 0.1)):
        (tmp_path / f"{name}.csv").write_bytes(file_of(turns_of(share)))
    options = ("--ratio", str(RATIO), "--json")
    part, whole, short = (
        json.loads(run("measure", f"{name}.csv", *options, cwd=tmp_path).stdout)["directions"][0]
        for name in ("part", "whole", "short")
    )
    for found in (part, whole):
        assert found["full_cycle"]["interval_arcsec"] == found["interval_arcsec"]
        assert found["full_cycle"]["value_arcsec"] == found["F_ior_arcsec"]
        assert found["full_cycle_missing"] is None
    assert short["full_cycle"] is None
    assert short["full_cycle_missing"]


@pytest.mark.thorough
def test_orders_with_the_same_readings_are_both_named():
    turns = np.arange(20 * RATIO) / 20  # 20 readings per input revolution

    def with_order(order, at):
        return 9 * np.cos(4 * np.pi * at) + 8 * np.cos(2 * np.pi * order * at)

    # the readings cannot decide, whatever the model is
    np.testing.assert_allclose(with_order(15, turns), with_order(5, turns), atol=1e-9)
    result = with_full_cycle(measured(turns, with_order(15, turns)))
    high = result.directions[0].interval_arcsec[1]
    fine = np.arange(0, 1, 1 / 2000)
    assert high > max(float(np.ptp(with_order(order, fine))) for order in (5, 15))
    facts = facts_of(measure_report(result, None))
    assert "order 5 may be order 15, which gives the same readings" in facts["images"]
    finer = with_full_cycle(measured(turns / 2, with_order(15, turns / 2)))
    assert "images" not in facts_of(measure_report(finer, None))
