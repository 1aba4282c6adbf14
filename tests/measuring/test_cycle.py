"""Ratios and the full cycle."""

from __future__ import annotations

import pytest

from hdassist import load_preset
from hdassist.errors import UsageError
from hdassist.measuring.cycle import Gearing, gearing_of


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
    with pytest.raises(UsageError, match="which has the ratio"):
        gearing_of(load_preset("vzp160"), 100)
