"""Scrambled Sobol' points, to the last digit those of scipy.stats.qmc, whose import takes as much as half a check.

Source: Joe and Kuo 2008, doi 10.1137/070709359 (direction numbers, as scipy has them); Matousek 1998,
doi 10.1006/jcom.1998.0489 (scrambling by a linear matrix and a digital shift).
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from hdassist.model.geometry import Array

DIRECTION_NUMBERS = Path(scipy.__file__).parent / "stats" / "_sobol_direction_numbers.npz"
BITS = 30  # of a coordinate
PLACES = np.arange(BITS, dtype=np.uint32)


def sobol_points(count: int, dimensions: int, seed: int | list[int]) -> Array:
    """The first points of a scrambled sequence, shape (count, dimensions), each coordinate in 0..1.

    Of more points by the same seed the first are the same.
    """
    if not DIRECTION_NUMBERS.exists():
        from scipy.stats import qmc  # takes most of a second

        sequence = qmc.Sobol(dimensions, rng=np.random.default_rng(seed))
        return np.asarray(sequence.random_base2(max(count - 1, 1).bit_length())[:count])
    rng, ones = np.random.default_rng(seed).spawn(1)[0], np.eye(BITS, dtype=np.uint32)
    shift = rng.integers(2, size=(dimensions, BITS), dtype=np.uint32) @ (1 << PLACES)
    matrix = np.tril(rng.integers(2, size=(dimensions, BITS, BITS), dtype=np.uint32), -1) + ones
    digits = _directions(dimensions)[:, None, :] >> PLACES[::-1, None] & 1  # shape (dimensions, digits, directions)
    scrambled = ((matrix @ digits & 1) << PLACES[::-1, None]).sum(axis=1, dtype=np.uint32)
    index = np.arange(count, dtype=np.uint32)
    points = np.tile(shift.astype(np.uint32), (count, 1))
    for place, direction in zip(PLACES, scrambled.T, strict=True):
        points ^= ((index ^ index >> 1) >> place & 1)[:, None] * direction  # in the order of a Gray code
    return np.asarray(points / 2.0**BITS)


@cache
def _directions(dimensions: int) -> NDArray[np.uint32]:
    """Direction numbers, shape (dimensions, BITS), by the recurrence of each dimension's primitive polynomial."""
    with np.load(DIRECTION_NUMBERS) as known:
        polynomials, first = known["poly"][:dimensions].tolist(), known["vinit"][:dimensions].tolist()
    found = [[1] * BITS]
    for polynomial, row in zip(polynomials[1:], first[1:], strict=True):
        degree = polynomial.bit_length() - 1
        numbers = row[:degree]
        for j in range(degree, BITS):
            number = numbers[j - degree]
            for k in range(1, degree + 1):
                number ^= (polynomial >> degree - k & 1) * numbers[j - k] << k
            numbers.append(number)
        found.append(numbers)
    return np.array(found[:dimensions], dtype=np.uint32).reshape(-1, BITS) << PLACES[::-1]
