"""Low-discrepancy draws, and statistics of weighted samples: effective sample size, quantiles, probabilities.

Draws are scrambled Sobol' points, identical to those of scipy.stats.qmc to the last digit. Importing that module takes
0.6 s of processor time, more than all other imports of a check. Source: Joe and Kuo 2008, doi 10.1137/070709359
(direction numbers, as in scipy); Matousek 1998, doi 10.1006/jcom.1998.0489 (scrambling by a linear matrix and a digital
shift).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import betaincinv

from hdassist.drive.model.geometry import Array
from hdassist.run.errors import SURE, Verdict, is_settled, percent_text, verdict_by_probability

RESOLVED_ERROR = 1e-3  # arcsec; smaller errors are not resolved
CONFIDENCE = 0.9  # confidence level of the interval of a probability, with 5 % beyond each end
_FINE_ENOUGH = 0.7  # width of an interval, as a share of 1 - sure, below which it need not be narrower


@dataclass(frozen=True)
class Probability:
    """A probability from samples with its Monte Carlo interval (5 % beyond each end).

    few: whether there are fewer samples than a result requires; a verdict then uses the whole interval instead of the
        value.
    """

    value: float
    low: float
    high: float
    few: bool = field(default=False, kw_only=True)

    @classmethod
    def certain(cls, is_true: bool) -> Probability:
        """Return the probability 1 or 0 of an event that is known to occur or not."""
        value = float(is_true)
        return cls(value, value, value)

    @property
    def complement(self) -> Probability:
        """Probability of the opposite outcome."""
        return replace(
            self,
            value=1 - self.value,
            low=1 - self.high,
            high=1 - self.low,
        )

    def verdict(self, sure: float = SURE) -> Verdict:
        """Return the verdict on a limit that is met with this probability.

        sure: probability that PASS needs.
        """
        # with enough samples, the value itself is compared, and its interval is shown next to it
        if not self.few:
            return verdict_by_probability(self.value, sure)
        # with few samples, both ends of the interval must give the same verdict
        verdict = verdict_by_probability(self.low, sure)
        return verdict if verdict is verdict_by_probability(self.high, sure) else Verdict.INCONCLUSIVE

    def text(self, needed: float | None = None, *, outcome: str = Verdict.PASS) -> str:
        """Return the probability in per cent with its interval and the required probability, as percent_text does."""
        over_all = " over the whole interval" if self.few and needed is not None else ""
        return percent_text(self.value, self.low, self.high, needed, outcome=outcome) + over_all

    def is_stable(self, sure: float = SURE) -> bool:
        """Return whether twice the number of samples would hardly change a verdict that needs `sure`.

        From n to 2 n samples, the estimate changes by 1/sqrt(2) of its standard error, and 5 % of the distribution lie
        beyond each end of the interval. A probability is also stable if its interval is so narrow that its value
        decides in any case.
        """
        # with twice as many samples the interval is narrower by a factor sqrt(2)
        low = self.value + (self.low - self.value) / np.sqrt(2)
        high = self.value + (self.high - self.value) / np.sqrt(2)
        return self.high - self.low <= _FINE_ENOUGH * (1 - sure) or is_settled(low, high, sure)


def log_error(arcsec: Array) -> Array:
    """Return the natural logarithm of errors [arcsec], same shape, limited below at RESOLVED_ERROR."""
    return np.asarray(np.log(np.maximum(arcsec, RESOLVED_ERROR)))


def effective_number(weights: Array) -> float:
    """Return the effective sample size (Kish), (sum of w)^2 / sum of w^2; 0 for no samples."""
    if not weights.any():
        return 0.0
    # dividing by the largest weight does not change the result
    shares = weights / weights.max()  # squares of very small weights would underflow to 0
    return float(shares.sum() ** 2 / (shares**2).sum())


def shares_below(values: Array, weights: Array) -> tuple[Array, Array]:
    """Return the percentage of the weight up to each value, and the values in ascending order, shape (values,) each."""
    # the distribution function of weighted samples is a step function over the sorted values
    order = np.argsort(values)
    return np.asarray(100 * np.cumsum(weights[order]) / weights.sum()), values[order]


def even_rows(weights: Array, count: int) -> NDArray[np.int64]:
    """Return the indices of samples that represent equal shares of all weights, shape (count,)."""
    return np.searchsorted(np.cumsum(weights) / weights.sum(), (np.arange(count) + 0.5) / count)


def weighted_quantile(
    values: Array,
    weights: Array,
    share: float,
) -> float:
    """Return a quantile of weighted values, interpolated between the centres of their weights (Hazen if equal)."""
    order = np.argsort(values, kind="stable")
    # half of a value's own weight lies below it, as in Hazen's plotting positions
    middles = (np.cumsum(weights[order]) - weights[order] / 2) / weights.sum()
    return float(np.interp(share, middles, values[order]))


def probability_of(inside: NDArray[np.bool_] | Array, weights: Array) -> Probability:
    """Return the probability of an outcome from weighted samples, with its interval.

    For equal weights it is Jeffreys' interval, which adds half a sample with the outcome and half a sample without it.
    Here that sample has the largest weight, because an outcome that was not sampled yet may have as large a weight (Fay
    and Feuer 1997, Statistics in Medicine 16, 791). The beta distribution has the mean and the variance of these
    weights, so that a few heavy samples count as few.

    inside: whether each sample has the outcome, or the probability with which it does, shape (samples,).
    weights: weights of the samples, shape (samples,).
    """
    value = float((weights * inside).sum() / weights.sum())
    # one further sample with the largest weight and half the outcome, so that the interval for 0 of n hits is not empty
    shares = np.append(weights, weights.max()) / weights.max()  # squares of very small weights would underflow to 0
    has = np.append(inside, 0.5)
    mean = float(has @ shares / shares.sum())
    # variance of the weighted mean
    square = (1 - mean) ** 2 * has @ shares**2 + mean**2 * (1 - has) @ shares**2
    # number of equal samples with the same variance of the mean, which replaces n in the beta distribution
    count = mean * (1 - mean) * shares.sum() ** 2 / square
    return _with_interval(value, mean * count, (1 - mean) * count)


def probability_of_systems(shares: Array, weights: Array) -> Probability:
    """Return the probability of an outcome from weighted systems, with its interval.

    Sets of deviations on one contact system are similar, so only the shares of the systems vary between independent
    cases. This is the general form of the interval of `probability_of`.

    shares: share of the sets of each system that have the outcome, shape (systems,).
    weights: weights of the systems, shape (systems,).
    """
    value = float(np.average(shares, weights=weights))
    sizes = weights / weights.max()
    total = sizes.sum() + 1  # includes a further system with the largest weight, half of whose sets have the outcome
    mean = float((sizes @ shares + 0.5) / total)
    square = float(sizes**2 @ (shares - mean) ** 2 + ((1 - mean) ** 2 + mean**2) / 2)
    count = mean * (1 - mean) * total**2 / square
    return _with_interval(value, mean * count, (1 - mean) * count)


def probability_by_share(value: float, count: float) -> Probability:
    """Return a probability with Jeffreys' interval.

    value: share of the samples with the outcome.
    count: effective sample size.
    """
    return _with_interval(value, value * count + 0.5, (1 - value) * count + 0.5)


def _with_interval(
    value: float,
    hits: float,
    misses: float,
) -> Probability:
    """Return a probability with the interval of a beta distribution with the given hits and misses."""
    # equal probability beyond each end
    tail = (1 - CONFIDENCE) / 2
    low, high = betaincinv(hits, misses, [tail, 1 - tail]).tolist()
    # the interval of a probability of 0 or 1 has only one open end
    return Probability(value, low if value > 0 else 0.0, high if value < 1 else 1.0)


DIRECTION_NUMBERS = Path(scipy.__file__).parent / "stats" / "_sobol_direction_numbers.npz"
_BITS = 30  # number of binary digits of a coordinate
_PLACES = np.arange(_BITS, dtype=np.uint32)


def sobol_points(
    count: int,
    dimensions: int,
    seed: int | list[int],
) -> Array:
    """Return the first points of a scrambled sequence, shape (count, dimensions), with coordinates in 0..1.

    A larger count with the same seed only adds points.
    """
    # scipy may move its private file; its public generator gives the same points but is slower to import
    if not DIRECTION_NUMBERS.exists():
        from scipy.stats import qmc  # importing this takes most of a second

        sequence = qmc.Sobol(dimensions, rng=np.random.default_rng(seed))
        return np.asarray(sequence.random_base2(max(count - 1, 1).bit_length())[:count])
    # the same scrambling as scipy.stats.qmc.Sobol, bit by bit
    rng = np.random.default_rng(seed).spawn(1)[0]
    shift_digits = rng.integers(
        2,
        size=(dimensions, _BITS),
        dtype=np.uint32,
    )
    # lower triangular with ones on the diagonal, so that the scrambling is invertible and points stay distinct
    matrix = np.tril(
        rng.integers(
            2,
            size=(dimensions, _BITS, _BITS),
            dtype=np.uint32,
        ),
        -1,
    )
    matrix += np.eye(_BITS, dtype=np.uint32)
    directions = _scrambled(_directions(dimensions), matrix)
    first_point = shift_digits @ (1 << _PLACES)  # digital shift
    points = np.tile(first_point.astype(np.uint32), (count, 1))
    index = np.arange(count, dtype=np.uint32)
    # in Gray code, consecutive points differ in one digit
    gray_code = index ^ index >> 1
    for place, direction in zip(_PLACES, directions.T, strict=True):
        has_digit = (gray_code >> place & 1)[:, None]  # shape (count, 1)
        # each digit of the index adds the direction number of its position, modulo 2
        points ^= has_digit * direction
    return np.asarray(points / 2.0**_BITS)


def _scrambled(directions: NDArray[np.uint32], matrix: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return direction numbers whose binary digits are mixed by a matrix, modulo 2, shape (dimensions, BITS).

    directions: direction numbers, shape (dimensions, BITS).
    matrix: lower triangular matrix with a unit diagonal, shape (dimensions, BITS, BITS).
    """
    digits = directions[:, None, :] >> _PLACES[::-1, None] & 1  # shape (dimensions, digits, directions)
    mixed = matrix @ digits & 1
    return np.asarray((mixed << _PLACES[::-1, None]).sum(axis=1, dtype=np.uint32))


@cache
def _directions(dimensions: int) -> NDArray[np.uint32]:
    """Return direction numbers, shape (dimensions, BITS), from the recurrence of each dimension's primitive polynomial.

    m_j is m_(j-d) xor the carry-free sum of 2^k a_k m_(j-k), k = 1..d (Joe and Kuo 2008). The first dimension has m_j =
    1 throughout.
    """
    with np.load(DIRECTION_NUMBERS) as table:
        polynomials = table["poly"][:dimensions].tolist()
        first_numbers = table["vinit"][:dimensions].tolist()
    rows = [[1 for _ in range(_BITS)]]
    for polynomial, first in zip(polynomials[1:], first_numbers[1:], strict=True):
        degree = polynomial.bit_length() - 1
        numbers = first[:degree]
        for j in range(degree, _BITS):
            number = numbers[j - degree]
            for k in range(1, degree + 1):
                coefficient = polynomial >> degree - k & 1
                number ^= coefficient * numbers[j - k] << k
            numbers.append(number)
        rows.append(numbers)
    return np.array(rows[:dimensions], dtype=np.uint32).reshape(-1, _BITS) << _PLACES[::-1]
