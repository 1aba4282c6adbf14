"""Sobol' points of samples: those of scipy, without the import of scipy.stats."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.stats import qmc

from hdassist.belief import statistics


def digits(points):
    """Digits of points after the one at the place of the first, shape (points, dimensions): without the shift."""
    numbers = (points * 2**30).astype(np.uint32)
    return numbers ^ numbers[0]


def require_scrambled(points, dimensions):
    """A scrambling by a lower triangular matrix with ones on its diagonal, and a shift, of the sequence as it is."""
    plain = digits(qmc.Sobol(dimensions, scramble=False).random_base2(max(len(points) - 1, 1).bit_length()))
    ours, plain = digits(points), plain[: len(points)]
    assert np.array_equal(np.frexp(ours)[1], np.frexp(plain)[1])  # the first digit that is not 0 stays
    for first in range(1, len(points), 7):  # linear: sums without carry of points stay sums
        for second in range(first, len(points), 11):
            both = np.flatnonzero((plain == plain[first] ^ plain[second]).all(axis=1))
            assert np.array_equal(ours[both], np.tile(ours[first] ^ ours[second], (len(both), 1)))


@pytest.mark.parametrize(("count", "dimensions", "seed"), [(64, 1, 0), (100, 7, 3), (1, 4, 1), (256, 40, 2)])
def test_points_are_a_scrambled_sequence_of_sobol(count, dimensions, seed):
    """Whatever scipy's version: how it draws the scrambling is its own affair."""
    points = statistics.sobol_points(count, dimensions, seed)
    require_scrambled(points, dimensions)
    assert not np.array_equal(points, statistics.sobol_points(count, dimensions, seed + 1))


def test_points_are_drawn_where_scipy_keeps_its_numbers_elsewhere(monkeypatch, tmp_path):
    monkeypatch.setattr(statistics, "DIRECTION_NUMBERS", tmp_path / "none.npz")
    require_scrambled(statistics.sobol_points(20, 5, 4), 5)


@pytest.mark.thorough
def test_the_shares_of_a_prior_import_no_scipy_stats():
    code = """
import sys
from hdassist.belief.prior import prior_of
from hdassist.drive.loading import load_preset
prior_of(load_preset("vzp160")).shares(64)
print("scipy.stats" in sys.modules)
"""
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "False\n"
