"""Made-up recordings: waves of known amplitudes along the cycle, with noise."""

import numpy as np

RATIO = 40.0
WAVES = ((0, 1, 4.0, 0.3), (2, 0, 9.0, 1.0), (2, 2, 3.0, 2.0), (4, 0, 2.5, 0.1), (4, -1, 1.0, 2.5))  # k, j, size, phase


def known_error(turns, ratio=RATIO):
    """Error [arcsec] at input angles [rev]."""
    error = np.zeros(len(turns))
    for k, j, size, phase in WAVES:
        error += size * np.cos(2 * np.pi * (k + j / ratio) * turns - phase)
    return error


def known_range(ratio=RATIO):
    """Range of the error over the cycle [arcsec]."""
    return float(np.ptp(known_error(np.arange(0, ratio, 1 / 500), ratio)))


def noisy_readings(readings=1320, span=RATIO, sigma=0.4, seed=0, ratio=RATIO):
    """Input angles [rev] from 0 to span and errors [arcsec] with white noise."""
    turns = np.arange(readings) * span / readings
    noise = sigma * np.random.default_rng(seed).standard_normal(readings)
    return turns, known_error(turns, ratio) + noise
