"""Readings far off all others: refused, or left out and named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hdassist.features.measuring.measure import measure
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.run.errors import PresetError, UntrustedError
from tests.helpers.rigs import EVEN, RATIO, even_wave, recorded, simulated, text, whole_range

TWO = TraceForm(angle="enc1", second="enc2")


@pytest.mark.thorough
def test_a_spike_is_refused_or_left_out_and_named():
    turns, error, curve = simulated(0)
    error[777] += 500
    rig = recorded(turns, error)
    with pytest.raises(UntrustedError, match=r"lines 778 .* no movement of a shaft explains"):
        measure(rig, ratio=RATIO)
    result = measure(replace(rig, robust=True), ratio=RATIO)
    (text,) = result.warnings
    assert text.startswith("lines 778 ")
    assert "omitted" in text
    low, high = result.directions[0].interval_arcsec
    assert low < whole_range(curve, RATIO) < high < low + 3
    error[::16] += 500
    with pytest.raises(UntrustedError, match=r"lines 1, 17, 33 ... \(22[56] in all\) .* too many rows to omit"):
        measure(replace(recorded(turns, error), robust=True), ratio=RATIO)
    bump = simulated(0)[1]
    bump[700:760] += 60  # lasts half a turn: no reading of one row
    assert not [text for text in measure(recorded(turns, bump), ratio=RATIO).warnings if "lines" in text]


def test_a_turning_point_is_no_spike():
    turns = np.concatenate([EVEN, EVEN[::-1]])
    found = measure(recorded(turns, even_wave(turns) + np.repeat([0.0, 5.0], 600)), ratio=100)
    assert not found.warnings
    assert [int(each.bins.rows.sum()) for each in found.directions] == [599, 599]


@pytest.mark.thorough
def test_robust_reading_omits_many_outliers_and_states_their_effect():
    turns, error, curve = simulated(0)
    rng = np.random.default_rng(3)
    off = rng.random(len(turns)) < 0.05
    error[off] += rng.normal(0, 80, off.sum())
    result = measure(replace(recorded(turns, error), robust=True), ratio=RATIO)
    low, high = result.directions[0].interval_arcsec
    assert low < whole_range(curve, RATIO) < high < low + 4
    assert result.warnings
    assert all("omitted; with them the curve would span" in text for text in result.warnings)


def stepped(size: float, share: float = 1.0):
    """Two orders with a beat, 0.3 arcsec of noise, and a step of the level behind 14.3 of 30 turns of the cam."""
    turns = np.arange(round(30.2 * 60 * share)) / 60
    noise = 0.3 * np.random.default_rng(1).standard_normal(len(turns))
    beat = 1 + 0.2 * np.cos(2 * np.pi * turns / 30 + 2)
    error = 12 * np.cos(4 * np.pi * turns + 1) * beat + 2 * np.cos(2 * np.pi * turns + 3)
    return turns, error + noise + size * (turns > 14.3)


def test_level_step_is_named_by_line_and_removed_from_range():
    turns, error = stepped(20)
    found = measure(recorded(turns, error), ratio=30)
    (words,) = found.warnings
    assert "at line 860," in words
    assert float(words.split("steps by ")[1].split("″")[0]) == pytest.approx(20, abs=1)
    without = measure(recorded(*stepped(0)), ratio=30)
    assert not without.warnings
    assert found.F_ior_arcsec == pytest.approx(without.F_ior_arcsec, abs=0.3)
    back = measure(recorded(turns[::-1], error[::-1]), ratio=30)  # the other way
    assert "steps by" in back.warnings[0]
    assert back.F_ior_arcsec == pytest.approx(without.F_ior_arcsec, abs=0.3)


def test_an_encoder_that_counts_anew_is_named_by_its_line():
    turns, error = stepped(0)
    output = turns * 12 + error / 3600
    for column in (0, 1):
        columns = [turns * 360, output.copy()]
        columns[column] = np.append(columns[column][:858], columns[column][858:] - columns[column][858])
        with pytest.raises(PresetError, match=r":860:1: enc2: .* an encoder was restarted"):
            read_trace(text(columns, "enc1,enc2", digits=6).encode(), ratio=30, form=TWO)


def test_two_runs_in_one_file_are_no_wrap():
    turns, error = stepped(0, 0.1)
    counts = [np.round(turns * 16384), np.round((turns / 30 + error / 1296000) * 4194304)]
    twice = [np.append(each, each) for each in counts]
    found = read_trace(text(twice, "enc1,enc2", digits=0).encode(), replace(TWO, angle_unit="16384,4194304"), 30)
    assert [sweep.direction for sweep in found.sweeps] == [1, 1]
    assert not any("begins again" in note for note in found.notes)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [1, 8, 11, 29])
def test_clean_partial_recordings_at_uneven_angles_have_no_spikes(seed):
    # what the fit misses at their ends is as great as a spike, and stands off readings that are few: refused before
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 2 * np.pi, 8)

    def curve(turns):
        cam, output = 2 * np.pi * turns, 2 * np.pi * turns / 50
        oval = 1 + 0.4 * np.cos(output + phase[1]) + 0.2 * np.cos(2 * output + phase[2])
        cams = 3 * np.cos(cam + phase[3] + 0.5 * np.sin(output + phase[4])) + 2 * np.cos(4 * cam + phase[5])
        slow = 6 * np.cos(output + phase[6]) + 3 * np.cos(2 * output + phase[7])
        return 10 * np.cos(2 * cam + phase[0]) * oval + cams + slow

    turns = np.sort(rng.uniform(0, 30, 1200))
    error = curve(turns) + 0.3 * rng.standard_normal(1200)
    assert not measure(recorded(turns, error), ratio=50).warnings
    near = np.maximum(np.diff(turns[1:]), np.diff(turns[:-1]))
    error[300 + near[300:900].argmin() + 1] += 20
    with pytest.raises(UntrustedError, match="no movement of a shaft explains this"):
        measure(recorded(turns, error), ratio=50)
