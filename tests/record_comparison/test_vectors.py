"""Deviation vectors out of a preset and into it again."""

from __future__ import annotations

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.preset.fields import Drive
from hdassist.features.record_comparison.record import VECTORS, vectors_of, with_vectors
from tests.helpers.process import SMALL

F_I2 = [vector.size for vector in VECTORS].index("tolerances.F_i2")


@pytest.fixture(scope="module")
def drive() -> Drive:
    return load_preset(SMALL)


def test_directions_stay_in_the_turn_of_the_preset(drive):
    vectors = vectors_of(drive)
    for near, expected in ((90.0, 80.0), (-300.0, -280.0), (460.0, 440.0)):
        there = drive.with_values({"phases.xi_b": near})
        turned = vectors.copy()
        turned[F_I2] = 40 * np.exp(1j * np.radians(80))
        assert with_vectors(there, turned, [F_I2]).phases.xi_b == pytest.approx(expected)


def test_vectors_go_there_and_back(drive):
    vectors = vectors_of(drive) + np.array([1, 2j, -3, 4 - 1j, 5, 6j, -7, 8, 9 + 1j])
    assert vectors_of(with_vectors(drive, vectors, range(len(VECTORS)))) == pytest.approx(vectors)
    kept = with_vectors(drive, vectors, [2])
    assert kept.value(VECTORS[0].size) == drive.value(VECTORS[0].size)
