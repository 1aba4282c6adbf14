"""Both directions of rotation as one model.

Bench tests often record one sweep in each direction. The error curves of the two directions share most of their waves,
and differ by an offset (the lost motion), by a lag of an encoder, and by friction. The amplitudes f of the forward
direction and b of the backward direction of a wave are therefore a common part c and a difference d, cosine and sine
alike:

    f = c + d/2,   b = c - d/2,   c ~ N(0, v_kj),   d ~ N(0, g_kj^2 v_kj).                                     (R20)

Each direction also has its own levels, drifts, lines, noise and memory of the noise, so the offset between the
directions is free. The difference of a wave relative to the wave has its own size, and the sizes of all waves are
similar:

    g_kj ~ half-t(g),   g ~ half-t(0.2),   with nu = 3 as in (R6).                                             (R21)

The scale 0.2 is a cautious assumption. If both directions cover the same positions, the readings determine the
differences, and each direction has nearly the result of its own readings. At positions that only one direction covers,
the other direction is known as well as (R21) permits. Without common positions only the prior limits the difference.

Given the sizes, the posterior of all coefficients is normal. In (R9), X^T X / sigma^2 has one block for each direction,
and the prior couples the two amplitudes of a wave:

    |c|^2 / v + |d|^2 / (g_kj^2 v) = (f, b) Q (f, b)^T,   Q_ff = Q_bb = 1/(4 v) + 1/(g_kj^2 v),
    Q_fb = 1/(4 v) - 1/(g_kj^2 v).                                                                             (R22)

Both amplitudes of a wave are drawn in one group of (R10). v_kj is drawn by (R7) from |c|^2 + |d|^2 / g_kj^2, which
counts as two waves, and the shares by

    g_kj^2 | x ~ IG(nu/2 + 1, nu/x + |d|^2 / (2 v)),   x ~ IG((nu + 1)/2, nu/g_kj^2 + 1/g^2).                  (R23)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from hdassist.drive.model.geometry import Array
from hdassist.recording.blocks import BlockModel
from hdassist.recording.chain import (
    BATCH,
    DRIFT_SIZE,
    FIRST_DRAWS,
    LEAST_NOISE,
    LEVEL_PRECISION,
    SIZE_STEPS,
    Chain,
    DrawnRanges,
    coherent_groups,
    normal_draw,
)
from hdassist.recording.noise import NoiseMemory, whitened
from hdassist.recording.sizes import FREEDOM, SizeTree, inverse_gamma
from hdassist.recording.waves import cycle_curves

_Indices = NDArray[np.int64]
_USUAL_SHARE = 0.2  # scale of g: usual difference of a wave between the directions, relative to the wave (assumed)
_LEAST_SHARE2 = 1e-8  # smallest g_kj^2, which prevents overflow of a precision


@dataclass(frozen=True, eq=False)
class ModelledDirection:
    """One direction of a recording.

    model: linear model of its blocks.
    memory: autocorrelation of its noise.
    signs: factors that convert the cosines and sines of the model to those of the recorded angles and errors, shape
    (2 waves,).
    """

    model: BlockModel
    memory: NoiseMemory
    signs: Array


class _DifferenceShares:
    """The state of (R21) during sampling.

    share: g_kj^2, shape (waves,).
    share_aux: their auxiliary variables, shape (waves,).
    usual, usual_aux: g^2 and its auxiliary variable.
    """

    def __init__(self, waves: int) -> None:
        """Start with the usual share for each wave."""
        self.share = np.full(waves, _USUAL_SHARE**2)
        self.share_aux = 1 / self.share
        self.usual = _USUAL_SHARE**2
        self.usual_aux = 1 / self.usual

    def draw(self, squares: Array, rng: np.random.Generator) -> None:
        """Draw every share given the differences by (R23).

        squares: |d|^2 / v_kj of each wave, shape (waves,).
        """
        nu = FREEDOM
        self.share = _LEAST_SHARE2 + inverse_gamma(nu / 2 + 1, nu / self.share_aux + squares / 2, rng)
        self.share_aux = inverse_gamma((nu + 1) / 2, nu / self.share + 1 / self.usual, rng)
        rate = nu / self.usual_aux + float(np.sum(1 / self.share_aux))
        self.usual = float(inverse_gamma((nu + len(squares)) / 2, np.array(rate), rng))
        self.usual_aux = float(inverse_gamma((nu + 1) / 2, np.array(nu / self.usual + 1 / _USUAL_SHARE**2), rng))


class _Side:
    """One direction during sampling, with amplitudes in the orientation of the recorded angles and errors.

    model: linear model of its blocks.
    signs: factor between each coefficient and that of the model, shape (columns,).
    columns: its columns among those of both directions.
    gram: products of its whitened columns, shape (columns, columns).
    moment: products with the whitened errors, shape (columns,).
    square: sum of the squares of the whitened errors [arcsec^2].
    sigma2: variance of the noise of a block [arcsec^2].
    drift2: variance of the drifts of each power [arcsec^2], shape (degree,).
    """

    def __init__(self, direction: ModelledDirection, first_column: int) -> None:
        model = direction.model
        design = whitened(model.design, model.run, direction.memory)
        errors = whitened(model.errors, model.run, direction.memory)
        self.model = model
        self.signs = np.ones(design.shape[1])
        self.signs[: model.waves] = direction.signs
        self.columns = slice(first_column, first_column + design.shape[1])
        self.gram = np.outer(self.signs, self.signs) * (design.T @ design)
        self.moment = self.signs * (design.T @ errors)
        self.square = float(errors @ errors)
        self.sigma2 = 1e-2 * model.mean_square
        self.drift2 = np.full(model.degree, DRIFT_SIZE**2 * model.mean_square)

    @property
    def correlation(self) -> Array:
        """The correlation of the columns, shape (columns, columns)."""
        lengths = np.sqrt(np.diag(self.gram))
        lengths[lengths == 0] = 1.0
        return np.asarray(self.gram / np.outer(lengths, lengths))

    def other_precision(self) -> Array:
        """Return the prior precision of all coefficients other than amplitudes, shape (columns - 2 waves,)."""
        model = self.model
        levels = np.full(model.runs, LEVEL_PRECISION / model.mean_square)
        drifts = np.repeat(1 / self.drift2, model.runs)
        lines = np.full(len(self.moment) - model.slow_end, 1 / model.mean_square)
        return np.concatenate([levels, drifts, lines])

    def draw_noise(
        self,
        coefficients: Array,
        gram_coefficients: Array,
        rng: np.random.Generator,
    ) -> None:
        """Draw the variances of noise (R11) and drifts given the coefficients.

        coefficients: coefficients of this direction, shape (columns,).
        gram_coefficients: the products of the columns times the coefficients, shape (columns,).
        """
        model = self.model
        misfit = float(self.square - 2 * coefficients @ self.moment + coefficients @ gram_coefficients)
        drawn = float(inverse_gamma(len(model.errors) / 2, np.array(max(misfit, 0.0) / 2), rng))
        self.sigma2 = max(drawn, LEAST_NOISE**2 * model.mean_square)
        if model.degree:
            drift = coefficients[model.waves + model.runs : model.slow_end].reshape(model.degree, model.runs)
            rates = (DRIFT_SIZE**2 * model.mean_square + (drift**2).sum(axis=1)) / 2
            self.drift2 = inverse_gamma((1 + model.runs) / 2, rates, rng)


class DirectionsSampler:
    """The Markov chain of both directions, by (R10) with (R22), (R7), (R11) and (R23)."""

    def __init__(self, directions: Sequence[ModelledDirection], *, seed: int) -> None:
        """Start a chain.

        directions: forward and backward direction, whose models have the same waves.
        seed: seed of the random numbers.
        """
        forward = _Side(directions[0], 0)
        backward = _Side(directions[1], len(forward.moment))
        self._sides = (forward, backward)
        self._rng = np.random.default_rng(seed)
        self._waves = forward.model.waves
        self._partner = len(forward.moment)  # distance of a wave's column from that of the other direction
        mean_square = float(np.mean([side.model.mean_square for side in self._sides]))
        self._tree = SizeTree.start(forward.model.pairs, mean_square)
        self._shares = _DifferenceShares(len(forward.model.pairs))
        self._moment = np.concatenate([side.moment for side in self._sides])
        self._beta = np.zeros(len(self._moment))
        self._gram_beta = np.zeros(len(self._moment))
        gram = block_diag(forward.gram, backward.gram)
        self._groups = self._coupled_groups()
        self._group_rows = [gram[group] for group in self._groups]
        self._group_grams = [gram[np.ix_(group, group)] for group in self._groups]

    def _coupled_groups(self) -> list[_Indices]:
        """Return groups of coherent columns, ascending, that contain both amplitudes of each wave."""
        closeness = block_diag(*[side.correlation for side in self._sides])
        waves = np.arange(self._waves)
        closeness[waves, waves + self._partner] = 1.0
        closeness[waves + self._partner, waves] = 1.0
        return [np.sort(group) for group in coherent_groups(closeness)]

    def run(self, most_draws: int) -> tuple[Chain, Chain]:
        """Return the draws of both directions, as `Sampler.run` does for one."""
        for _ in range(FIRST_DRAWS):
            self._step()
        ranges = [DrawnRanges(), DrawnRanges()]
        draws: list[Array] = []
        sigmas: list[list[float]] = []
        while True:
            for _ in range(BATCH):
                self._step()
                draws.append(self._beta.copy())
                sigmas.append([float(np.sqrt(side.sigma2)) for side in self._sides])
            batch = np.array(draws[-BATCH:])
            for side, side_ranges in zip(self._sides, ranges, strict=True):
                model = side.model
                amplitudes = (side.signs * batch[:, side.columns])[:, : model.waves]
                side_ranges.add(cycle_curves(amplitudes, model.pairs, model.cycle), model.is_visited)
            if all(side_ranges.is_enough for side_ranges in ranges) or len(draws) + BATCH > most_draws:
                break
        coefficients = np.array(draws)
        sigma_arcsec = np.array(sigmas)
        forward, backward = (
            ranges[number].chain(side.signs * coefficients[:, side.columns], sigma_arcsec[:, number])
            for number, side in enumerate(self._sides)
        )
        return forward, backward

    def _step(self) -> None:
        """Draw the coefficients and then the sizes."""
        self._draw_coefficients()
        self._draw_sizes()

    def _draw_coefficients(self) -> None:
        """Draw the coefficients of each group given those of the other groups, by (R10) with the prior (R22)."""
        common = np.tile(1 / (4 * self._tree.wave), 2)
        difference = np.tile(1 / (self._shares.share * self._tree.wave), 2)
        prior = np.concatenate([part for side in self._sides for part in (common + difference, side.other_precision())])
        weight = np.concatenate([np.full(len(side.moment), 1 / side.sigma2) for side in self._sides])
        beta = self._beta
        for group, rows, gram in zip(self._groups, self._group_rows, self._group_grams, strict=True):
            by_others = self._gram_beta[group] - gram @ beta[group]
            precision = weight[group][:, None] * gram
            precision.flat[:: len(group) + 1] += prior[group]
            forward = np.flatnonzero(group < self._waves)
            backward = np.searchsorted(group, group[forward] + self._partner)
            coupling = (common - difference)[group[forward]]
            precision[forward, backward] += coupling
            precision[backward, forward] += coupling
            drawn = normal_draw(precision, weight[group] * (self._moment[group] - by_others), self._rng)
            self._gram_beta += (drawn - beta[group]) @ rows
            beta[group] = drawn

    def _draw_sizes(self) -> None:
        """Draw the sizes of the waves and of their differences, the noise and the drifts given the coefficients."""
        rng = self._rng
        amplitudes = self._beta[: self._waves]
        partners = self._beta[self._partner : self._partner + self._waves]
        common2 = _squares((amplitudes + partners) / 2)
        difference2 = _squares(amplitudes - partners)
        for _ in range(SIZE_STEPS):
            self._tree.draw(common2 + difference2 / self._shares.share, rng, amplitudes=2)
            self._shares.draw(difference2 / self._tree.wave, rng)
        for side in self._sides:
            side.draw_noise(self._beta[side.columns], self._gram_beta[side.columns], rng)


def _squares(amplitudes: Array) -> Array:
    """Return the sum of the squares of cosine and sine of each wave, shape (waves,).

    amplitudes: cosines, then sines, shape (2 waves,).
    """
    cosines, sines = np.split(amplitudes, 2)
    return np.asarray(cosines**2 + sines**2)
