"""Prior sizes: the profile, and draws of the tree against distributions of another way."""

from fractions import Fraction

import numpy as np
from scipy.stats import halfcauchy, kstest, t

from hdassist.recording.sizes import (
    ORDER_PROFILE,
    OUTPUT_PROFILE,
    SIDEBAND_PROFILE,
    SizeTree,
    inverse_gamma,
    rest_profile,
    wave_profile,
)
from hdassist.recording.waves import wave_pairs


def test_profile_by_hand():
    pairs = np.array([[0, 1], [0, 2], [2, -2], [2, 0], [2, 1], [4, 6], [4, 14], [100, 0]])
    orders, waves = wave_profile(pairs)
    assert len(orders) == 101
    assert orders[2] == ORDER_PROFILE[2]
    assert orders[100] == ORDER_PROFILE[-1]
    other_wheel = waves[2]
    expected = [
        *OUTPUT_PROFILE[:2],
        other_wheel,
        1.0,
        SIDEBAND_PROFILE[0],
        SIDEBAND_PROFILE[5],
        SIDEBAND_PROFILE[-1],
        1.0,
    ]
    assert waves.tolist() == expected
    assert SIDEBAND_PROFILE[0] < other_wheel < 1.0


def test_the_rest_is_by_the_highest_order_of_the_pairs():
    coarse, fine = rest_profile(16, 80), rest_profile(36, 80)
    assert coarse.size > rest_profile(20, 80).size > fine.size
    assert rest_profile(12, 80) == coarse


def test_the_rest_of_a_drive_with_more_teeth_is_larger():
    small, large = rest_profile(16, 50), rest_profile(16, 120)
    assert large.size > small.size
    assert large.added > small.added
    assert rest_profile(16, 30) == small  # no drive below was solved


def test_the_auxiliary_variable_makes_a_half_t():
    rng = np.random.default_rng(0)
    auxiliary = inverse_gamma(0.5, np.full(4000, 1 / 2.0**2), rng)
    sizes = np.sqrt(inverse_gamma(1.5, 3.0 / auxiliary, rng))
    assert kstest(sizes / 2.0, lambda x: 2 * t.cdf(x, 3) - 1).pvalue > 1e-3
    assert kstest(sizes / 2.0, halfcauchy.cdf).pvalue < 1e-3


def test_a_chain_without_readings_keeps_the_prior():
    rng = np.random.default_rng(1)
    pairs = wave_pairs(Fraction(30), blocks_per_rev=12)
    tree = SizeTree.start(pairs, mean_square=4.0)
    orders = []
    for _ in range(2500):
        amplitudes = np.sqrt(tree.wave) * rng.standard_normal((2, len(pairs)))
        tree.draw((amplitudes**2).sum(axis=0), rng)
        orders.append(np.sqrt(tree.order) / (2.0 * wave_profile(pairs)[0]))
    shares = np.mean(np.array(orders) < t.ppf([[[0.65]], [[0.75]], [[0.9]]], 3), axis=(1, 2))  # of all orders together
    assert np.allclose(shares, [0.3, 0.5, 0.8], atol=0.07)
