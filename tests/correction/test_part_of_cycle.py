"""Tables over the input from a few input revolutions: what they truly leave over the cycle, and what they promise."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hdassist.drive.model.geometry import Array
from hdassist.features.correction.correct import Correction, correction_alone
from hdassist.features.correction.forms import CorrectionForm, CorrectionTable
from hdassist.features.measuring.measure import measure
from hdassist.features.record_comparison.record import Alignment
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.run.errors import UntrustedError
from tests.helpers.process import run

RATIO, PER_TURN, POINTS = 30, 40, 120
TABLE = CorrectionForm("cam", POINTS)
SPIKES = (100, 150, 233)  # rows of a file


def error_at(turns: Array, beat: float = 0.0, slow: float = 0.0) -> Array:
    """Error [arcsec]: 20 twice and 4 four times an input revolution, sidebands of the first, once an output one."""
    main = 20 * np.cos(4 * np.pi * turns + 0.4) + 4 * np.sin(8 * np.pi * turns)
    sideband = beat * np.cos(2 * np.pi * (2 + 2 / RATIO) * turns + 1)
    return main + sideband + slow * np.sin(2 * np.pi * turns / RATIO)


def recorded(turns: Array, seed: int, **parts: float) -> str:
    """A file of angles and errors with white noise of 0.3 arcsec."""
    noise = 0.3 * np.random.default_rng(seed).standard_normal(len(turns))
    rows = zip((360 * turns).tolist(), (error_at(turns, **parts) + noise).tolist(), strict=True)
    return "cam_deg,error_arcsec\n" + "".join(f"{angle:.6f},{error:.5f}\n" for angle, error in rows)


def corrected(text: str, form: CorrectionForm = TABLE, travel_deg: float | None = None) -> Correction:
    trace = read_trace(text.encode(), None, RATIO)
    found = measure(trace, ratio=RATIO, together=True, travel_deg=travel_deg)
    return correction_alone(found, Alignment(), 1.0, form, "against")


@cache
def of_revolutions(revolutions: float, first: float, seed: int, beat: float, slow: float) -> Correction:
    turns = first + np.arange(round(revolutions * PER_TURN) + 1) / PER_TURN
    return corrected(recorded(turns, seed, beat=beat, slow=slow))


def truly_left(result: Correction, turns: Array, **parts: float) -> float:
    """Range [arcsec] of the true error, at angles in input revolutions, that a table leaves: played point by point."""
    table = result.correction
    assert isinstance(table, CorrectionTable)
    values = np.append(table.error_arcsec, table.error_arcsec[0])
    played = np.interp(np.mod(turns, 1), np.arange(POINTS + 1) / POINTS, values)
    return float(np.ptp(error_at(turns, **parts) + played))  # the table has the output's error, the opposite


CYCLE = np.arange(RATIO * 200) / 200


@pytest.mark.thorough
def test_an_error_that_repeats_with_the_input_is_removed():
    result = of_revolutions(8.0, 0.0, 1, 0.0, 0.0)
    left = truly_left(result, CYCLE)
    assert left < 2.0  # of 45
    assert left <= result.chosen.residuals[0].p95


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(2))
def test_predicted_residual_covers_waves_missing_from_a_partial_cycle(seed: int):
    result = of_revolutions(6.0, 4.0 * seed, seed, 4.0, 3.0)
    promised = result.chosen.residuals[0]
    assert truly_left(result, CYCLE, beat=4.0, slow=3.0) <= promised.p95
    short, whole = promised, of_revolutions(24.0, 4.0 * seed, seed, 4.0, 3.0).chosen.residuals[0]
    assert whole.p95 - whole.p5 < short.p95 - short.p5  # a longer recording leaves less open


@pytest.mark.thorough
def test_a_travel_counts_only_where_it_was_recorded():
    turns = np.arange(6 * PER_TURN + 1) / PER_TURN
    result = corrected(recorded(turns, 3, slow=3.0), travel_deg=6 * 360 / RATIO)
    promised = result.chosen.residuals[0]
    assert promised.p95 < of_revolutions(6.0, 0.0, 3, 0.0, 3.0).chosen.residuals[0].p95
    assert truly_left(result, np.arange(1201) / 200, slow=3.0) <= promised.p95


@pytest.mark.thorough
def test_recording_start_angle_does_not_change_the_table():
    tables = [of_revolutions(8.0, first, 1, 0.0, 0.0).correction for first in (0.0, 12.25)]
    values = [table.error_arcsec for table in tables if isinstance(table, CorrectionTable)]
    assert np.abs(values[0] - values[1]).max() < 0.5


def test_other_forms_and_few_revolutions_are_refused():
    turns = np.arange(6 * PER_TURN + 1) / PER_TURN
    with pytest.raises(UntrustedError, match="of the full cycle"):
        corrected(recorded(turns, 1), CorrectionForm("output", 720))
    with pytest.raises(UntrustedError, match="input revolutions"):
        corrected(recorded(turns[: round(1.5 * PER_TURN)], 1))


@pytest.mark.thorough
def test_both_directions_count_as_one():
    turns = np.arange(6 * PER_TURN + 1) / PER_TURN
    result = corrected(recorded(np.concatenate([turns, turns[::-1]]), 1), travel_deg=6 * 360 / RATIO)
    assert truly_left(result, np.arange(1201) / 200) <= result.chosen.residuals[0].p95 < 3


@pytest.mark.thorough
def test_spikes_that_measure_leaves_out_are_not_in_the_table():
    turns = np.arange(8 * PER_TURN + 1) / PER_TURN
    spiked = recorded(turns, 1).splitlines()
    without = [line for row, line in enumerate(spiked) if row not in SPIKES]
    for row in SPIKES:
        angle, _, error = spiked[row].partition(",")
        spiked[row] = f"{angle},{float(error) + 12}"
    tables = []
    for lines in (spiked, without):
        trace = read_trace(("\n".join(lines) + "\n").encode(), TraceForm(robust=True), RATIO)
        found = measure(trace, ratio=RATIO, together=True)
        table = correction_alone(found, Alignment(), 1.0, TABLE, "against").correction
        assert isinstance(table, CorrectionTable)
        tables.append(table.error_arcsec)
    assert tables[0] == pytest.approx(tables[1], abs=1e-6)


@pytest.mark.thorough
def test_what_a_guide_rate_leaves_open_is_in_the_promise():
    """Errors that may all be 10 % larger or smaller: 5 % of them are more than 1.96 times 10 % off, to either side."""
    turns = np.arange(8 * PER_TURN + 1) / PER_TURN
    trace = read_trace(recorded(turns, 1).encode(), None, RATIO)
    left = {}
    for uncertainty in (0.0, 0.1):
        found = measure(replace(trace, scale_uncertainty=uncertainty), ratio=RATIO, together=True)
        left[uncertainty] = correction_alone(found, Alignment(), 1.0, TABLE, "against").chosen.residuals[0].p95
    assert left[0.0] < 3
    assert left[0.1] == pytest.approx(1.96 * 0.1 * np.ptp(error_at(CYCLE)), rel=0.25)


@pytest.mark.thorough
def test_telescope_mount_is_corrected_by_the_angle_of_its_axis(tmp_path):
    """Time is read by the speed of the output: the input angle follows from it, its zero is that of the time."""
    time_s = np.arange(0, 3000.0, 8.0)
    turns = time_s * 15.041 / 3600 / 360 * 100
    rows = zip(time_s.tolist(), (20 * np.sin(4 * np.pi * turns)).tolist(), strict=True)
    (tmp_path / "pe.csv").write_text("time_s,error_arcsec\n" + "".join(f"{t},{e:.4f}\n" for t, e in rows))
    options = ("--ratio", "100", "--speed", "15.041", "--torque", "1", "--form", "cam", "--points", "360")
    answer = json.loads(run("compensate", "pe.csv", *options, "--json", cwd=tmp_path).stdout)
    values = np.array(answer["correction"]["error_arcsec"])
    assert np.ptp(values) == pytest.approx(40, abs=1)
    expected = -20 * np.sin(4 * np.pi * np.arange(360) / 360)
    assert np.abs(values - expected).max() < 1
    refused = run("compensate", "pe.csv", *options[:2], *options[4:], cwd=tmp_path)
    assert refused.returncode == 4
    assert "--speed" in refused.stderr
