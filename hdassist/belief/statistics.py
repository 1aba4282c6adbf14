"""Even draws, and statistics of weighted samples: effective number, quantiles, probabilities with their interval.

Draws are scrambled Sobol' points, to the last digit those of scipy.stats.qmc, whose import takes 0.6 s of processor
time, more than all else that a check imports. Source: Joe and Kuo 2008, doi 10.1137/070709359 (direction numbers, as
scipy has them); Matousek 1998, doi 10.1006/jcom.1998.0489 (scrambling by a linear matrix and a digital shift).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import betaincinv

from hdassist.errors import SURE, Verdict, is_settled, percent_text, verdict_by_probability
from hdassist.model.geometry import Array

RESOLVED_ERROR = 1e-3  # arcsec
CONFIDENCE = 0.9  # confidence of the interval of a probability: 5 % lie beyond each end
_FINE_ENOUGH = 0.7  # width of an interval, as a share of 1 - sure, below which it need be no narrower


@dataclass(frozen=True)
class Probability:
    """A probability from samples with its Monte Carlo interval (5 % beyond each end).

    few: it is of fewer samples than an answer takes, so that a verdict takes all of the interval, not the point.
    """

    value: float
    low: float
    high: float
    few: bool = field(default=False, kw_only=True)

    @property
    def complement(self) -> Probability:
        """Probability of the other outcome."""
        return replace(
            self,
            value=1 - self.value,
            low=1 - self.high,
            high=1 - self.low,
        )

    def verdict(self, sure: float = SURE) -> Verdict:
        """Return the verdict on a limit that is met with this probability; sure: the one that PASS needs."""
        # enough samples: the value itself is compared, and its interval is shown beside it
        if not self.few:
            return verdict_by_probability(self.value, sure)
        # few samples: both ends of the interval have to give the same verdict
        verdict = verdict_by_probability(self.low, sure)
        return verdict if verdict is verdict_by_probability(self.high, sure) else Verdict.INCONCLUSIVE

    def text(self, needed: float | None = None, *, outcome: str = Verdict.PASS) -> str:
        """Return it in per cent with its interval, and the probability that an outcome needs, as percent_text does."""
        over_all = " over the whole interval" if self.few and needed is not None else ""
        return percent_text(self.value, self.low, self.high, needed, outcome=outcome) + over_all

    def is_stable(self, sure: float = SURE) -> bool:
        """Return whether as many samples again would leave a verdict that needs `sure` as it is, with 95 % each time.

        From n samples to 2 n the estimate moves by 1/sqrt(2) of its standard error; the interval has 5 % beyond an end.
        So is one whose interval is so narrow that its middle decides, whatever more samples would say.
        """
        # with twice as many samples the interval is narrower by sqrt(2)
        low = self.value + (self.low - self.value) / np.sqrt(2)
        high = self.value + (self.high - self.value) / np.sqrt(2)
        return self.high - self.low <= _FINE_ENOUGH * (1 - sure) or is_settled(low, high, sure)


def log_error(arcsec: Array) -> Array:
    """Return the natural logarithm of errors [arcsec], same shape, floored at RESOLVED_ERROR."""
    return np.asarray(np.log(np.maximum(arcsec, RESOLVED_ERROR)))


def effective_number(weights: Array) -> float:
    """Return the effective number of weighted samples (Kish), (sum of w)^2 / sum of w^2; 0 of none."""
    if not weights.any():
        return 0.0
    # Kish's number does not depend on the scale of the weights
    shares = weights / weights.max()  # squares of tiny weights are 0
    return float(shares.sum() ** 2 / (shares**2).sum())


def shares_below(values: Array, weights: Array) -> tuple[Array, Array]:
    """Return the percentage of the weight up to each value, and the values in growing order, shape (values,) each."""
    # the distribution function of weighted samples is a staircase over the sorted values
    order = np.argsort(values)
    return np.asarray(100 * np.cumsum(weights[order]) / weights.sum()), values[order]


def even_rows(weights: Array, count: int) -> NDArray[np.int64]:
    """Return the places of samples that stand for equal shares of all weights, shape (count,)."""
    return np.searchsorted(np.cumsum(weights) / weights.sum(), (np.arange(count) + 0.5) / count)


def weighted_quantile(
    values: Array,
    weights: Array,
    share: float,
) -> float:
    """Return a quantile of weighted values, linear between the middles of their weights (Hazen if all are equal)."""
    order = np.argsort(values, kind="stable")
    # half of its own weight lies below a value, as in Hazen's plotting positions
    middles = (np.cumsum(weights[order]) - weights[order] / 2) / weights.sum()
    return float(np.interp(share, middles, values[order]))


def probability_of(inside: NDArray[np.bool_] | Array, weights: Array) -> Probability:
    """Return the probability of an outcome from weighted samples, with its interval.

    inside: which of them have it, or with which probability each has it, shape (samples,).
    weights: of the samples, shape (samples,).

    Jeffreys' interval of equal weights: half a sample more has the outcome, and half a one has it not. Here that sample
    weighs as much as the heaviest one, for an outcome that was not drawn yet may weigh as much (Fay and Feuer 1997,
    Statistics in Medicine 16, 791); the beta distribution has the mean and the variance of such weights, so that heavy
    samples on one side count as the few that they are.
    """
    value = float((weights * inside).sum() / weights.sum())
    # one more sample, as heavy as the heaviest, with half the outcome: the interval of 0 of n hits is not empty
    # then
    shares = np.append(weights, weights.max()) / weights.max()  # squares of tiny weights are 0
    has = np.append(inside, 0.5)
    mean = float(has @ shares / shares.sum())
    # variance of the weighted mean; its effective number replaces n in the beta distribution
    square = (1 - mean) ** 2 * has @ shares**2 + mean**2 * (1 - has) @ shares**2
    # the number of equal samples with the same variance of the mean
    count = mean * (1 - mean) * shares.sum() ** 2 / square
    return _with_interval(value, mean * count, (1 - mean) * count)


def probability_of_systems(shares: Array, weights: Array) -> Probability:
    """Return the probability of an outcome from weighted systems, with its interval.

    The shares of the systems are what varies between independent cases, as sets of deviations on one contact system
    are alike. The interval is that of probability_of, of which this is the general form.

    shares: of the sets of each system that have the outcome, shape (systems,).
    weights: of the systems, shape (systems,).
    """
    value = float(np.average(shares, weights=weights))
    sizes = weights / weights.max()
    total = sizes.sum() + 1  # a further system, as heavy as the heaviest one, of which half has the outcome
    mean = float((sizes @ shares + 0.5) / total)
    square = float(sizes**2 @ (shares - mean) ** 2 + ((1 - mean) ** 2 + mean**2) / 2)
    count = mean * (1 - mean) * total**2 / square
    return _with_interval(value, mean * count, (1 - mean) * count)


def probability_by_share(value: float, count: float) -> Probability:
    """Return the probability of an outcome that a share of so many effective samples has, with Jeffreys' interval."""
    return _with_interval(value, value * count + 0.5, (1 - value) * count + 0.5)


def _with_interval(
    value: float,
    hits: float,
    misses: float,
) -> Probability:
    """Return a probability with the interval of the beta distribution of so many hits and misses."""
    # the same share beyond each end
    tail = (1 - CONFIDENCE) / 2
    low, high = betaincinv(hits, misses, [tail, 1 - tail]).tolist()
    # a probability of 0 or 1 in all samples has one end only
    return Probability(value, low if value > 0 else 0.0, high if value < 1 else 1.0)


DIRECTION_NUMBERS = Path(scipy.__file__).parent / "stats" / "_sobol_direction_numbers.npz"
_BITS = 30  # binary digits of a coordinate
_PLACES = np.arange(_BITS, dtype=np.uint32)


def sobol_points(
    count: int,
    dimensions: int,
    seed: int | list[int],
) -> Array:
    """Return the first points of a scrambled sequence, shape (count, dimensions), each coordinate in 0..1.

    Of more points by the same seed the first are the same.
    """
    # scipy may move its private file; its own generator gives the same points, later
    if not DIRECTION_NUMBERS.exists():
        from scipy.stats import qmc  # takes most of a second

        sequence = qmc.Sobol(dimensions, rng=np.random.default_rng(seed))
        return np.asarray(sequence.random_base2(max(count - 1, 1).bit_length())[:count])
    # the same scrambling as scipy.stats.qmc.Sobol, bit by bit
    rng = np.random.default_rng(seed).spawn(1)[0]
    shift_digits = rng.integers(
        2,
        size=(dimensions, _BITS),
        dtype=np.uint32,
    )
    # lower triangular with ones on the diagonal: the scramble can be inverted, so points stay distinct
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
    first_point = shift_digits @ (1 << _PLACES)  # the digital shift
    points = np.tile(first_point.astype(np.uint32), (count, 1))
    index = np.arange(count, dtype=np.uint32)
    # in Gray code neighbouring points differ in one digit
    gray_code = index ^ index >> 1
    for place, direction in zip(_PLACES, directions.T, strict=True):
        has_digit = (gray_code >> place & 1)[:, None]  # shape (count, 1)
        # each digit of the index adds, modulo 2, the direction number of its place
        points ^= has_digit * direction
    return np.asarray(points / 2.0**_BITS)


def _scrambled(directions: NDArray[np.uint32], matrix: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return direction numbers whose binary digits a matrix has mixed, modulo 2, shape (dimensions, BITS).

    directions: shape (dimensions, BITS).
    matrix: lower triangular, with a unit diagonal, shape (dimensions, BITS, BITS).
    """
    digits = directions[:, None, :] >> _PLACES[::-1, None] & 1  # shape (dimensions, digits, directions)
    mixed = matrix @ digits & 1
    return np.asarray((mixed << _PLACES[::-1, None]).sum(axis=1, dtype=np.uint32))


@cache
def _directions(dimensions: int) -> NDArray[np.uint32]:
    """Return direction numbers, shape (dimensions, BITS), by the recurrence of each dimension's primitive polynomial.

    m_j = m_(j-d) xor the sum, without carry, of 2^k a_k m_(j-k), k = 1..d (Joe and Kuo 2008); the first dimension has
    m_j = 1 throughout.
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
