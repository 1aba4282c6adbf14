"""Quantiles and yields from bins, against all values and against the closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdassist.tolerance.tally import FINE, Share, Tally


@given(st.lists(st.floats(0.002, 1e5), min_size=1, max_size=60), st.floats(0, 1))
def test_quantiles_are_those_of_all_values(values: list[float], share: float) -> None:
    tally = Tally()
    for value in values:
        tally.add(value)
    exact = np.quantile(values, share, method="inverted_cdf")
    assert tally.quantile(share) == pytest.approx(exact, rel=FINE)
    assert tally.mean == pytest.approx(np.mean(values))
    assert (tally.least, tally.greatest) == (min(values), max(values))


def test_what_lies_between_edges_is_counted() -> None:
    tally = Tally()
    for value in (1.5, 2.5, 2.6, 7.0):
        tally.add(value)
    assert tally.between(np.array([0.0, 1.0, 2.0, 3.0, 10.0])).tolist() == [0, 1, 2, 1]


def test_the_bounds_of_a_yield_are_those_of_clopper_and_pearson() -> None:
    assert Share(50, 50).bounds == (pytest.approx(0.025 ** (1 / 50)), 1.0)
    assert Share(0, 50).bounds == (0.0, pytest.approx(1 - 0.025 ** (1 / 50)))
    low, high = Share(45, 50).bounds
    assert (low, high) == (pytest.approx(0.78186, abs=1e-5), pytest.approx(0.96672, abs=1e-5))


def test_drives_without_an_answer_count_both_ways() -> None:
    assert Share(45, 50, open_=10).bounds[0] == Share(45, 60).bounds[0]
    assert Share(45, 50, open_=10).bounds[1] == Share(55, 60).bounds[1]
    assert Share(0, 0, open_=3).bounds == (0.0, 1.0)
