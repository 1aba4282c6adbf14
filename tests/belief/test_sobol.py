"""Sobol' points of samples: those of scipy, without the import of scipy.stats."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.stats import qmc

from hdassist.belief import sobol


@pytest.mark.parametrize(("count", "dimensions", "seed"), [(64, 1, 0), (100, 7, 3), (1, 4, 1), (2048, 40, 2)])
def test_points_are_those_of_scipy_to_the_last_digit(count, dimensions, seed):
    theirs = qmc.Sobol(dimensions, rng=np.random.default_rng(seed)).random_base2(max(count - 1, 1).bit_length())
    assert np.array_equal(sobol.sobol_points(count, dimensions, seed), theirs[:count])


def test_points_are_the_same_where_scipy_keeps_its_numbers_elsewhere(monkeypatch, tmp_path):
    ours = sobol.sobol_points(20, 5, 4)
    monkeypatch.setattr(sobol, "DIRECTION_NUMBERS", tmp_path / "none.npz")
    assert np.array_equal(sobol.sobol_points(20, 5, 4), ours)


def test_the_shares_of_a_prior_import_no_scipy_stats():
    code = """
import sys
from hdassist.belief.prior import prior_of
from hdassist.loading.load import load_preset
prior_of(load_preset("vzp160")).shares(64)
print("scipy.stats" in sys.modules)
"""
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "False\n"
