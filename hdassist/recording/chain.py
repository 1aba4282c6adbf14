"""Gibbs sampling of the coefficients of a recording.

The covariance V of the coefficients (R8) is diagonal. It contains v_kj of the waves (R6) and one variance for the
drifts of each power, which has an inverse gamma distribution, so that a drift is Cauchy distributed with a scale of
0.02 A. Levels have a flat prior, and lines the variance A^2. The readings determine the degree of the drift: a power
that they do not show stays near 0. Given the sizes, the posterior of beta is normal. With X and y whitened,

    P = X^T X / sigma^2 + V^-1,   beta | V, sigma, y ~ N(P^-1 X^T y / sigma^2, P^-1),                          (R9)

which takes one Cholesky factorisation per draw. Columns that are nearly uncorrelated (over a long recording, waves of
different orders) are drawn in groups, each given the others. For the columns g of a group, with all other coefficients
o fixed,

    P_g = X_g^T X_g / sigma^2 + V_g^-1,   m_g = P_g^-1 X_g^T (y - X_o beta_o) / sigma^2,                       (R10)

which gives a Gibbs sampler of the same posterior at a small part of the cost. Given beta, the sizes are drawn by (R7),
and sigma^2 has an inverse gamma distribution:

    sigma^2 | beta, y ~ IG(m/2, |y - X beta|^2 / 2),   m blocks.                                               (R11)

Sampling alternates between the two steps. It stops when the ranges of the curve over the cycle and over the covered
positions have a sufficient effective sample size, or at a largest number of draws; the effective sample size is part of
the result.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dtrtrs
from scipy.sparse.csgraph import connected_components

from hdassist.drive.model.geometry import Array
from hdassist.recording.blocks import BlockModel, UsualFit
from hdassist.recording.noise import WHITE, NoiseMemory, whitened
from hdassist.recording.sizes import SizeTree, inverse_gamma
from hdassist.recording.waves import (
    CurveExtremes,
    curve_extremes,
    cycle_curves,
)
from hdassist.run.errors import Fault, UntrustedError

_Indices = NDArray[np.int64]
# effective sample size for which the ends of a 95 % interval are accurate to about 10 % of its width
ENOUGH_SAMPLES = 100.0
# Effective sample size of the kept draws alone, from which the results follow; its estimate may be much lower. With n
# normal samples, the standard error of an end of a 95 % interval is 0.68 / sqrt(n) of the width, here 9 %
# (benchmarks/thresholds.py).
_ENOUGH_KEPT = 60.0
MOST_DRAWS = 1200
BATCH = 40  # number of draws between two computations of the effective sample size
_NOISE_STEPS = 3  # iterations for the variance of the noise with the usual sizes
_KEPT_DRAWS = 200  # approximate number of draws in the result, because neighbours in a longer chain are redundant
# draws of the sizes per draw of the coefficients, which takes longer; they reduce the correlation of the chain
SIZE_STEPS = 4
_BURN_SHARE = 0.2  # share of the draws that is discarded as burn-in
FIRST_DRAWS = 30  # number of draws of a short chain
_FIRST_KEPT = 10  # number of its last draws, which are averaged
DRIFT_SIZE = 0.02  # scale of the Cauchy distribution of each power of the drift over a run, as a share of A (assumed)
LEVEL_PRECISION = 1e-10  # precision of the prior of levels relative to 1/A^2, which is effectively flat
# correlation of two columns above which they are drawn together; weaker correlation hardly slows the chain
_COHERENT = 0.1
_GROUP_COLUMNS = 100  # maximum number of columns of merged small groups, for which one factorisation is fastest
LEAST_NOISE = 1e-3  # smallest noise, as a share of A: no recording is better, and rounding errors are much smaller


@dataclass(frozen=True, eq=False)
class Chain:
    """Draws of the sampler.

    coefficients: coefficient of each column [arcsec], shape (draws, columns).
    sigma_arcsec: white part of the noise of a block, shape (draws,).
    extremes: extremes of the curves over the cycle.
    effective: effective sample size.
    """

    coefficients: Array
    sigma_arcsec: Array
    extremes: CurveExtremes
    effective: float


class DrawnRanges:
    """The ranges of the curves of a chain that is being drawn, which show when it is long enough."""

    def __init__(self) -> None:
        self._batches: list[CurveExtremes] = []
        self._draws = 0
        self._effective = 0.0
        self._kept_effective = 0.0

    def add(self, curves: Array, is_visited: NDArray[np.bool_]) -> None:
        """Add a batch of curves.

        curves: curves over the cycle [arcsec], shape (draws, points).
        is_visited: whether each point has a reading nearby, shape (points,).
        """
        self._batches.append(curve_extremes(curves, is_visited))
        self._draws += len(curves)
        joined = CurveExtremes.joined(self._batches)
        self._effective = _least_effective(joined.chosen(slice(self._burnt, None)))
        self._kept_effective = _least_effective(joined.chosen(self._kept))

    @property
    def is_enough(self) -> bool:
        """Whether the effective sample size is sufficient."""
        return self._effective >= ENOUGH_SAMPLES and self._kept_effective >= _ENOUGH_KEPT

    @property
    def _burnt(self) -> int:
        """The number of draws that are discarded as burn-in."""
        return int(_BURN_SHARE * self._draws)

    @property
    def _kept(self) -> slice:
        """The draws of the result: after the burn-in, and evenly spaced."""
        return slice(self._burnt, None, max(1, (self._draws - self._burnt) // _KEPT_DRAWS))

    def chain(self, coefficients: Array, sigma_arcsec: Array) -> Chain:
        """Return the chain with the draws after the burn-in.

        coefficients: coefficients of all draws [arcsec], shape (draws, columns).
        sigma_arcsec: white part of the noise of a block of all draws, shape (draws,).
        """
        kept = self._kept
        return Chain(
            coefficients=coefficients[kept],
            sigma_arcsec=sigma_arcsec[kept],
            extremes=CurveExtremes.joined(self._batches).chosen(kept),
            effective=self._effective,
        )


class Sampler:
    """The Markov chain: coefficients given sizes by (R9) and (R10), sizes given coefficients by (R7) and (R11)."""

    def __init__(self, model: BlockModel, *, seed: int) -> None:
        self._model = model
        self._rng = np.random.default_rng(seed)
        self._tree = SizeTree.start(model.pairs, model.mean_square)
        self._sigma2 = 1e-2 * model.mean_square
        self._drift2 = np.full(model.degree, DRIFT_SIZE**2 * model.mean_square)
        self._beta = np.zeros(model.design.shape[1])
        self._use(WHITE)

    def use_memory(self, memory: NoiseMemory) -> None:
        """Whiten design and errors by the autocorrelation of the noise."""
        if memory != WHITE:
            self._use(memory)

    def _use(self, memory: NoiseMemory) -> None:
        design = whitened(self._model.design, self._model.run, memory)
        errors = whitened(self._model.errors, self._model.run, memory)
        self._gram = self._model.gram if memory == WHITE else design.T @ design
        self._moment = design.T @ errors
        self._square = float(errors @ errors)
        self._blocks = len(errors)
        self._groups = coherent_groups(self._gram)
        self._group_rows = [self._gram[group] for group in self._groups]
        self._group_grams = [self._gram[np.ix_(group, group)] for group in self._groups]
        self._gram_beta = self._gram @ self._beta

    def first_mean(self) -> Array:
        """Return the mean coefficients of the last draws of a short chain, shape (columns,)."""
        draws = [self._step() for _ in range(FIRST_DRAWS)]
        return np.asarray(np.mean(draws[-_FIRST_KEPT:], axis=0))

    def usual_fit(self) -> UsualFit:
        """Return the fit for the sizes of the profile. The chain must not have started."""
        sigma2 = self._sigma2
        for _ in range(_NOISE_STEPS):
            precision = self._gram / sigma2 + np.diag(self._prior_precision())
            factor = dpotrf(precision, lower=1)[0]
            half = dtrtrs(factor, self._moment / sigma2, lower=1)[0]
            mean = dtrtrs(factor, half, lower=1, trans=1)[0]
            used = sigma2
            sigma2 = float(np.mean(self._model.residual(mean) ** 2))
        return UsualFit(
            coefficients=mean,
            factor=factor,
            sigma2=used,
        )

    def run(self, most_draws: int) -> Chain:
        """Return the draws of a chain with a sufficient effective sample size, or of the largest allowed length."""
        model = self._model
        ranges = DrawnRanges()
        draws: list[Array] = []
        sigmas: list[float] = []
        while True:
            for _ in range(BATCH):
                draws.append(self._step())
                sigmas.append(float(np.sqrt(self._sigma2)))
            batch = np.array(draws[-BATCH:])[:, : model.waves]
            ranges.add(cycle_curves(batch, model.pairs, model.cycle), model.is_visited)
            if ranges.is_enough or len(draws) + BATCH > most_draws:
                break
        return ranges.chain(np.array(draws), np.array(sigmas))

    def _prior_precision(self) -> Array:
        """Return the prior precision V^-1 of every coefficient, shape (columns,)."""
        model = self._model
        variances = np.concatenate([self._tree.wave, self._tree.wave])
        levels = np.full(model.runs, LEVEL_PRECISION / model.mean_square)
        drifts = np.repeat(1 / self._drift2, model.runs)
        lines = np.full(len(self._moment) - model.slow_end, 1 / model.mean_square)
        return np.concatenate([1 / variances, levels, drifts, lines])

    def _step(self) -> Array:
        """Draw the coefficients and then the sizes, and return a copy of the coefficients, shape (columns,)."""
        self._draw_coefficients()
        self._draw_sizes()
        return self._beta.copy()

    def _draw_coefficients(self) -> None:
        """Draw the coefficients of each group given those of the other groups (R10)."""
        prior = self._prior_precision()
        beta = self._beta
        for group, rows, gram in zip(self._groups, self._group_rows, self._group_grams, strict=True):
            by_others = self._gram_beta[group] - gram @ beta[group]
            moment = (self._moment[group] - by_others) / self._sigma2
            precision = gram / self._sigma2
            precision.flat[:: len(group) + 1] += prior[group]
            drawn_beta = normal_draw(precision, moment, self._rng)
            # updating the product takes a third of the time of a new one, because memory limits both
            self._gram_beta += (drawn_beta - beta[group]) @ rows
            beta[group] = drawn_beta

    def _draw_sizes(self) -> None:
        """Draw the sizes of the waves (R7), the noise (R11) and the sizes of the drifts given the coefficients."""
        model = self._model
        rng = self._rng
        beta = self._beta
        cosines, sines = np.split(beta[: model.waves], 2)
        for _ in range(SIZE_STEPS):
            self._tree.draw(cosines**2 + sines**2, rng)
        misfit = float(self._square - 2 * beta @ self._moment + beta @ self._gram_beta)
        drawn = float(inverse_gamma(self._blocks / 2, np.array(max(misfit, 0.0) / 2), rng))
        self._sigma2 = max(drawn, LEAST_NOISE**2 * model.mean_square)
        if model.degree:
            drift = beta[model.waves + model.runs : model.slow_end].reshape(model.degree, model.runs)
            rates = (DRIFT_SIZE**2 * model.mean_square + (drift**2).sum(axis=1)) / 2
            self._drift2 = inverse_gamma((1 + model.runs) / 2, rates, rng)


def normal_draw(
    precision: Array,
    moment: Array,
    rng: np.random.Generator,
) -> Array:
    """Return a draw of coefficients with the distribution N(P^-1 m, P^-1), shape (columns,).

    precision: P, which is overwritten, shape (columns, columns).
    moment: m, shape (columns,).
    Raises UntrustedError if P is singular.
    """
    # LAPACK directly, because scipy's checks take twice as long
    # transposed, because LAPACK would copy a symmetric matrix in C order
    factor, is_singular = dpotrf(precision.T, lower=1, overwrite_a=1)
    if is_singular:
        raise UntrustedError(
            "the readings do not separate the components of the error", "record more revolutions", Fault.ORDERS_UNTOLD
        )
    half = dtrtrs(factor, moment, lower=1)[0]
    normal = rng.standard_normal(len(moment))
    return np.asarray(dtrtrs(factor, half + normal, lower=1, trans=1)[0])


def coherent_groups(gram: Array) -> list[_Indices]:
    """Return groups of columns such that columns of different groups are nearly uncorrelated.

    gram: products of the columns, shape (columns, columns).
    """
    lengths = np.sqrt(np.diag(gram))
    lengths[lengths == 0] = 1.0
    is_coherent = np.abs(gram) > np.outer(_COHERENT * lengths, lengths)
    merged: list[_Indices] = []
    count, label = connected_components(is_coherent, directed=False)
    for number in range(count):
        columns = np.flatnonzero(label == number)
        if merged and len(merged[-1]) + len(columns) <= _GROUP_COLUMNS:
            merged[-1] = np.concatenate([merged[-1], columns])
        else:
            merged.append(columns)
    return merged


def _least_effective(extremes: CurveExtremes) -> float:
    """Return the smaller effective sample size of the ranges over the cycle and over the covered points."""
    return min(effective_samples(extremes.range_arcsec), effective_samples(extremes.visited_range_arcsec))


def effective_samples(values: Array) -> float:
    """Return the effective sample size of a chain (Geyer 1992, initial positive sequence).

    values: values of successive draws, shape (draws,).
    """
    draws = len(values)
    centred = values - values.mean()
    if not centred.any():
        return float(draws)
    spectrum = np.fft.rfft(centred, 2 * draws)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2)[:draws]
    correlation = covariance / covariance[0]
    pairs = correlation[: 2 * (draws // 2)].reshape(-1, 2).sum(axis=1)
    negative = np.flatnonzero(pairs <= 0)
    positive = pairs[: negative[0]] if len(negative) else pairs
    return float(min(draws, draws / max(2 * positive.sum() - 1, 1e-12)))
