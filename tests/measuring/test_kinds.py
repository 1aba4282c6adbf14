"""Records of each kind, made without any part of the tool: the short form of `python -m benchmarks.kinds`."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from benchmarks.kinds import BOTH_WAYS, KINDS, Rig, counted
from hdassist.features.measuring.fit import fit_orders
from hdassist.features.measuring.orders import DEFAULT_ORDERS, order_grid
from hdassist.features.measuring.terms import SlowTerms, bins_of
from tests.helpers.rigs import recorded


@pytest.mark.thorough
@pytest.mark.parametrize("kind", KINDS)
def test_recording_of_any_kind_gives_no_wrong_verdict(kind: str):
    count = sum((counted(Rig(kind, seed)) for seed in (2, 3)), Counter())
    intervals = 4 if kind in BOTH_WAYS else 2
    assert count["F'_ior"] == intervals
    assert count["F'_ior held"] >= intervals - 1
    assert not count["false PASS"] + count["false FAIL"] + count["refused"]


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [13, 28])
def test_rows_lost_beside_an_extreme_fail_no_drive(seed: int):
    """A parabola across the gap exceeds the curve, so the range would be too large by up to 11 %."""
    count = counted(Rig("lost rows", seed))
    assert count["F'_ior held"] == 1
    assert not count["false FAIL"]


def test_white_noise_of_few_rows_is_no_unmodelled_error():
    turns, orders = np.arange(1800) / 60, order_grid(DEFAULT_ORDERS, 30.0, 30.0)
    noise = np.random.default_rng(0).standard_normal((16, 1800))
    fits = [fit_orders(bins_of(recorded(turns, each), 12), orders) for each in noise]
    assert sum(fit.unmodelled > 0 for fit in fits) <= 2
    assert max(fit.correlated for fit in fits) < 1.5


def test_fit_with_lines_needs_only_their_own_products():
    turns, orders = np.arange(1800) / 60, order_grid(DEFAULT_ORDERS, 30.0, 30.0)
    error = np.cos(2 * np.pi * 5.31 * turns) + np.random.default_rng(0).standard_normal(1800)
    bins = bins_of(recorded(turns, error), 12)
    base = fit_orders(bins, orders).design
    alone = fit_orders(bins, orders, lines=[5.3, 14.2])
    by_base = fit_orders(bins, orders, lines=[5.3, 14.2], base=base)
    assert np.allclose(by_base.design.gram, alone.design.gram, rtol=0, atol=1e-9)
    assert np.allclose(by_base.coefficients, alone.coefficients, rtol=0, atol=1e-11)
    assert np.allclose(by_base.residual, alone.residual, rtol=0, atol=1e-11)
    with_other_terms = fit_orders(bins, orders, SlowTerms(degree=1), lines=[5.3, 14.2], base=base)
    assert np.allclose(with_other_terms.drift, fit_orders(bins, orders, SlowTerms(degree=1), [5.3, 14.2]).drift)


def test_level_of_each_sweep_has_the_noise_of_its_sweep():
    turns, orders = np.arange(1800) / 60, order_grid(DEFAULT_ORDERS, 30.0, 30.0)
    noise = np.random.default_rng(3).standard_normal((2, 1800))
    quiet, loud = 0.2, 2.0  # arcsec
    there_and_here = np.concatenate([turns, turns])
    fit = fit_orders(bins_of(recorded(there_and_here, np.concatenate([quiet * noise[0], loud * noise[1]])), 12), orders)
    first, second = np.sqrt(1800 * np.diag(fit.level_covariance))
    assert fit.bins.levels == 2
    assert second == pytest.approx(loud, rel=0.2)
    assert quiet < first < 0.3 * loud  # both sweeps share the fitted curve, which contains noise of the other one
