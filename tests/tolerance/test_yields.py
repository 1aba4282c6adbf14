"""Yields of designs against those that drives were drawn with, percentiles against the closed form."""

import numpy as np
import pytest
from scipy.stats import beta, binom

from hdassist.features.tolerance.production import RandomDrive
from hdassist.features.tolerance.yields import AtTorque, Summary, YieldBelief
from hdassist.run.errors import Verdict


def yields(passed: list[int], drives: int, weights: list[float] | None = None) -> YieldBelief:
    return YieldBelief(np.array(passed), np.full(len(passed), drives), np.array(weights or [1.0] * len(passed)))


def record(design: int, F_ior: float, weight: float = 1.0) -> RandomDrive:
    return RandomDrive(design=design, weight=weight, F_ior_arcsec=(F_ior,), best_F_ior_arcsec=(F_ior,), values={})


def summary(records: list[RandomDrive], wanted: float = 0.9) -> Summary:
    found = Summary((AtTorque(1.0, 10.0, 1.0),), 1, wanted)
    found.add(records)
    return found


def test_the_yield_of_one_design_is_that_of_jeffreys() -> None:
    found = yields([45], 50)
    for share in (0.05, 0.5, 0.95):
        assert found.percentile(share) == pytest.approx(beta(45.5, 5.5).ppf(share), abs=1e-3)
    chance = found.probability(0.8)
    assert chance.value == pytest.approx(beta(45.5, 5.5).sf(0.8))
    assert (chance.low, chance.high) == pytest.approx((binom(50, 0.8).cdf(44), binom(50, 0.8).cdf(45)))


@pytest.mark.parametrize("designs", [1, 10])
def test_no_range_is_narrower_than_counting_drives_allows(designs: int) -> None:
    """100 good drives of 100: one that passes less than 97.05 % shows that in fewer than 5 of 100 cases."""
    low, high = yields([100 // designs] * designs, 100 // designs).range
    assert (low, high) == (pytest.approx(0.05**0.01), 1)
    none = yields([0] * designs, 100 // designs).range
    assert none == (0, pytest.approx(1 - 0.05**0.01))
    assert yields([100 // designs] * designs, 100 // designs).probability(0.98).low <= 1 - 0.98**100 + 1e-12
    unequal = yields([50, 50], 50, [1.0, 1e-9])  # fifty drives in truth
    assert unequal.range[0] == pytest.approx(0.05**0.02, abs=1e-6)


@pytest.mark.parametrize(("a", "b"), [(8.0, 2.0), (2.0, 2.0), (60.0, 3.0), (0.5, 0.3)])
def test_yields_of_designs_are_found_through_few_drives_of_each(a: float, b: float) -> None:
    rng = np.random.default_rng(3)
    of_designs = rng.beta(a, b, 1500)
    found = yields(rng.binomial(10, of_designs).tolist(), 10)
    for share in (0.05, 0.5, 0.95):
        assert found.percentile(share) == pytest.approx(beta(a, b).ppf(share), abs=0.04)
    assert found.probability(0.85).value == pytest.approx(beta(a, b).sf(0.85), abs=0.05)


def test_the_interval_of_a_probability_holds_it_in_most_seeds() -> None:
    true, held = beta(8, 2).sf(0.8), []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        chance = yields(rng.binomial(10, rng.beta(8, 2, 40)).tolist(), 10).probability(0.8)
        held.append(chance.low <= true <= chance.high)
    assert np.mean(held) >= 0.8


def test_designs_that_differ_are_told_from_drives_that_do() -> None:
    apart, alike = yields([10, 0] * 20, 10), yields([5] * 40, 10)
    assert apart.share == alike.share == 0.5
    assert apart.percentile(0.05) < 0.02 and apart.percentile(0.95) > 0.98
    assert alike.percentile(0.95) - alike.percentile(0.05) < 0.2


def test_designs_count_by_their_weight() -> None:
    assert yields([10, 0], 10, [3.0, 1.0]).share == 0.75
    assert yields([10] * 30 + [0] * 30, 10, [1.0] * 30 + [1e-9] * 30).probability(0.9).value > 0.99


@pytest.mark.parametrize(
    ("passing", "drives", "verdict"),
    [(200, 200, Verdict.PASS), (10, 200, Verdict.FAIL), (181, 200, Verdict.INCONCLUSIVE)],
)
def test_the_verdict_is_the_probability_that_the_yield_is_reached(passing: int, drives: int, verdict: Verdict) -> None:
    records = [record(0, 8.0) for _ in range(passing)] + [record(0, 12.0) for _ in range(drives - passing)]
    assert summary(records).verdict is verdict


def test_yield_that_depends_on_the_design_stays_inconclusive() -> None:
    records = [record(k, 8.0 if k % 5 else 12.0) for k in range(40) for _ in range(50)]
    found = summary(records, wanted=0.75)
    assert found.yield_of(False).share == 0.8
    assert found.verdict is Verdict.INCONCLUSIVE


def test_drives_without_an_answer_count_both_ways() -> None:
    refused = [RandomDrive(design=0, weight=1.0, refused="no such drive", values={})] * 30
    found = summary([record(0, 8.0)] * 170 + refused)
    assert (found.count, len(found.refused), found.reason) == (170, 30, "no such drive")
    assert found.verdict is Verdict.INCONCLUSIVE
    assert summary([record(0, 8.0)] * 170).verdict is Verdict.PASS
    assert summary(refused).verdict is Verdict.INCONCLUSIVE


def test_percentiles_are_weighted_with_intervals_that_contain_the_truth() -> None:
    held, narrow = [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        middles = rng.normal(0, 1, 60)
        values = (middles[:, None] + rng.normal(0, 0.3, (60, 5))).ravel() + 20
        found = summary([record(k // 5, float(v)) for k, v in enumerate(values)])
        median = found.percentile(values.tolist(), 0.5)
        held.append(median.low <= 20 <= median.high)
        narrow.append(median.high - median.low)
    assert np.mean(held) >= 0.8
    assert np.mean(narrow) > 0.35, "drives of a design are no independent ones: 60 designs, not 300 drives"
    weighted = summary([record(k, float(k), 1.0 + (k == 9)) for k in range(1, 10)])
    assert weighted.percentile(range(1, 10), 0.5).value == pytest.approx(5.5)


def test_reductions_count_designs_by_their_weights() -> None:
    """Nine tenths of the weight belong to a design whose best position halves F'_ior."""
    point = AtTorque(1.0, None, 0.0)
    found = Summary((point,), 12, None)
    for design, weight, best in ((0, 1.0, 9.0), (1, 9.0, 5.0)):
        drive = RandomDrive(design=design, weight=weight, F_ior_arcsec=(10.0,), best_F_ior_arcsec=(best,), values={})
        found.add([drive for _ in range(4)])
    assert found.reduction(point, 0.5).value == pytest.approx(0.5)
    assert found.reduction(point, 0.05).value == pytest.approx(0.1)
