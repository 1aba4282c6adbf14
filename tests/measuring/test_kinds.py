"""Records of each kind, made without any part of the tool: the short form of `python -m benchmarks.kinds`."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from benchmarks.kinds import KINDS, Rig, counted
from hdassist.measuring.fit import fit_orders
from hdassist.measuring.orders import DEFAULT_ORDERS, order_grid
from hdassist.measuring.terms import bins_of
from tests.helpers.rigs import recorded


@pytest.mark.thorough
@pytest.mark.parametrize("kind", KINDS)
def test_recording_of_any_kind_gives_no_wrong_verdict(kind: str):
    count = sum((counted(Rig(kind, seed)) for seed in (2, 3)), Counter())
    assert count["F'_ior"] == 2
    assert count["F'_ior held"] >= 1
    assert not count["false PASS"] + count["false FAIL"] + count["refused"]


def test_white_noise_of_few_rows_is_no_unmodelled_error():
    turns, orders = np.arange(1800) / 60, order_grid(DEFAULT_ORDERS, 30.0, 30.0)
    noise = np.random.default_rng(0).standard_normal((16, 1800))
    fits = [fit_orders(bins_of(recorded(turns, each), 12), orders) for each in noise]
    assert sum(fit.unmodelled > 0 for fit in fits) <= 2
    assert max(fit.correlated for fit in fits) < 1.5
