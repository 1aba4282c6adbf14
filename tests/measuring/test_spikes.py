"""Readings far off all others: refused, or left out and named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hdassist.errors import UntrustedError
from hdassist.measuring.measure import measure
from tests.rigs import EVEN, RATIO, even_wave, recorded, simulated, whole_range


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
    found = measure(recorded(turns, even_wave(turns) + np.repeat([0.0, 5.0], 600)), ratio=100)
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
