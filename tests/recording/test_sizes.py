"""Prior sizes: the profile, and draws of the tree against distributions of another way."""

from fractions import Fraction

import numpy as np
from scipy.stats import halfcauchy, kstest, t

from hdassist.recording.sizes import ORDER_PROFILE, SizeTree, inverse_gamma, wave_profile
from hdassist.recording.waves import wave_pairs


def test_profile_by_hand():
    pairs = np.array([[0, 1], [0, 2], [2, -2], [2, 0], [2, 1], [4, 6], [4, 14], [20, 0]])
    orders, waves = wave_profile(pairs)
    assert len(orders) == 21
    assert orders[2] == 1.0
    assert orders[20] == ORDER_PROFILE[-1]
    assert waves.tolist() == [1.0, 0.4, 0.6, 1.0, 0.35, 0.02, 0.02, 1.0]


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
