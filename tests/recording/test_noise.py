"""Memory of the noise: found where it is, none where there is none, and bounded."""

import numpy as np
import pytest
from scipy.signal import lfilter

from hdassist.recording.noise import WHITE, NoiseMemory, memory_of, whitened

RNG = np.random.default_rng(5)
RUN = np.repeat([0, 1], [6000, 4000])


def colored(rho, theta, rows=10_000):
    """Noise of ARMA(1,1)."""
    return lfilter([1.0, theta], [1.0, -rho], RNG.standard_normal(rows))


def test_white_noise_has_no_memory():
    assert memory_of(RNG.standard_normal(10_000), RUN, blocks_per_rev=100) == WHITE


def test_a_memory_is_found():
    memory = memory_of(colored(0.8, -0.4), RUN, blocks_per_rev=100)
    assert abs(memory.rho - 0.8) < 0.06
    assert abs(memory.theta + 0.4) < 0.1


def test_whitening_undoes_the_memory_within_each_run():
    memory = NoiseMemory(rho=0.7, theta=-0.3)
    white = RNG.standard_normal((10_000, 2))
    runs = [lfilter([1.0, memory.theta], [1.0, -memory.rho], white[run == RUN], axis=0) for run in (0, 1)]
    assert np.allclose(whitened(np.concatenate(runs), RUN, memory), white)


def test_a_memory_decays_within_half_a_revolution():
    memory = memory_of(np.cumsum(RNG.standard_normal(10_000)), RUN, blocks_per_rev=100)
    assert np.isclose(memory.rho, np.exp(-1 / 50))
    assert memory_of(np.cumsum(RNG.standard_normal(10_000)), RUN, blocks_per_rev=2).rho <= np.exp(-1)


def test_rms_of_correlated_noise_exceeds_that_of_its_white_part():
    rng = np.random.default_rng(3)
    memory = NoiseMemory(rho=0.9, theta=-0.4)
    noise = lfilter([1.0, memory.theta], [1.0, -memory.rho], rng.standard_normal(200_000))
    assert memory.gain == pytest.approx(float(np.std(noise)), rel=0.02)
    assert WHITE.gain == 1.0
