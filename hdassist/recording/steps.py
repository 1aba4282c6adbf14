"""Steps of the level, decided by the evidence of a recording.

A coupling slips, an encoder loses counts, or a recording is interrupted and continued with another zero. The error then
has another level from one reading to the next, and the readings need not show where. A step at reading b is a column c
of the model, which is 1 from b to the end of the run and 0 elsewhere, with a coefficient h ~ N(0, A^2). Here the model
(R8) contains waves up to order 16 with the sizes of the profile, slow waves up to 12 periods per output revolution,
levels, and drifts. Given P (R9) and the residuals r of the mean without a step, the information I on h, its estimate,
and the evidence for a step at b are

    I = (c^T c - c^T X P^-1 X^T c / sigma^2) / s^2,   h = c^T r / (s^2 I),                                     (R18)
    log B = (I h)^2 / (2 (I + 1/A^2)) - log(1 + A^2 I) / 2.                                                    (R19)

Noise with a memory, encoder counts and waves that the model lacks resemble steps. The variance s^2 therefore follows
from the readings themselves: after removal of the most evident step, s^2 I h^2 of noise has the median 0.455 s^2 over
all readings. One recording in 100 has a step (assumed), at any reading with the same probability. A step is accepted if
its probability, by the mean of B over the readings, is at least 95 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dtrtrs

from hdassist.drive.model.geometry import Array
from hdassist.recording.positions import LARGEST_DENOMINATOR
from hdassist.recording.sizes import wave_profile
from hdassist.recording.waves import ALWAYS_ORDER, block_means, wave_pairs, wave_values
from hdassist.run.errors import SURE

_Indices = NDArray[np.int64]
_STEP_CHANCE = 0.01  # probability of a step in a recording (assumed)
_BLOCKS_PER_REV = 64.0  # largest number of blocks per input revolution, 4 per period of the highest order
_BESIDE_REV = 1.0  # smallest distance of a step from the ends of a run [input rev]
_FEWEST_BESIDE = 8  # minimum number of blocks between a step and the ends of a run
_NOISE_STEPS = 10  # iterations for the variance of the noise
_LEAST_NOISE = 1e-3  # smallest noise, as a share of A, so that rounding errors are no evidence
_LEAST_FREE = 1e-6  # smallest part of c^T c that the model does not represent, so that no division is by 0
_MEDIAN_OF_SQUARE = 0.4549  # median of the square of a standard normal variable
_SLOW_ORDERS = 12  # periods of slow waves per output revolution; test rigs have more of them than drives
_COARSEST = 0.0  # blocks per input revolution for which the model has sidebands up to order 16 only
_DRIFT_DEGREE = 2
_FLAT = 1e-10  # precision of a level relative to 1/A^2


@dataclass(frozen=True)
class _LevelStep:
    """Step of the level.

    first: index of the first reading of a run after the step.
    size_arcsec: size of the step, in the order of the readings [arcsec].
    """

    first: int
    size_arcsec: float


def clear_step(
    turns: Array,
    error_arcsec: Array,
    run: _Indices,
    ratio: float,
) -> _LevelStep | None:
    """Return the most evident step of a recording, or None if no step has a probability of 95 %.

    turns: input angle [rev], ascending in each run, shape (readings,).
    error_arcsec: error [arcsec], shape (readings,).
    run: number of the run of each reading, in the order of the runs, shape (readings,).
    ratio: input revolutions per output revolution.
    """
    starts = _block_starts(turns, run)
    blocks = _Blocks(
        turns=block_means(turns, starts),
        errors=block_means(error_arcsec, starts),
        run=run[starts],
    )
    is_place = blocks.is_place()
    if not is_place.any():
        return None
    fit = _Fit.of(blocks, ratio)
    free = np.maximum(blocks.count_to_end() - fit.represented(blocks.sums_to_end(fit.design)), _LEAST_FREE)
    score = blocks.sums_to_end(fit.residual[:, None])[:, 0]
    place = int(np.where(is_place, score**2 / free, 0.0).argmax())
    size = float(score[place] / free[place])
    without_step = fit.residual - size * fit.unexplained(blocks.step_column(place))
    squares = blocks.sums_to_end(without_step[:, None])[:, 0] ** 2 / free
    variance = max(float(np.median(squares[is_place])) / _MEDIAN_OF_SQUARE, _LEAST_NOISE**2 * fit.mean_square)
    if not _is_probable(log_evidence(score, free, variance, fit.mean_square)[is_place]):
        return None
    return _LevelStep(first=_first_after(starts[place - 1 : place + 2], error_arcsec, size), size_arcsec=size)


def _is_probable(evidence: Array) -> bool:
    """Return whether a step is probable enough, from log B of the steps at all possible readings, shape (steps,)."""
    log_odds = float(np.logaddexp.reduce(evidence)) - np.log(len(evidence))
    log_odds += np.log(_STEP_CHANCE / (1 - _STEP_CHANCE))
    return bool(log_odds >= np.log(SURE / (1 - SURE)))


def _first_after(
    starts: _Indices,
    error_arcsec: Array,
    size: float,
) -> int:
    """Return the first reading after a step, by the largest change between readings in its direction.

    starts: first readings of the block before the step, of that after it, and of the next.
    error_arcsec: error [arcsec], shape (readings,).
    size: size of the step [arcsec].
    """
    readings = np.arange(starts[0] + 1, starts[-1] + 1)
    changes = np.sign(size) * (error_arcsec[readings] - error_arcsec[readings - 1])
    return int(readings[changes.argmax()])


def log_evidence(
    score: Array,
    free: Array,
    variance: float,
    prior_variance: float,
) -> Array:
    """Return log B of (R19) for steps, shape (steps,).

    score: c^T r of each step [arcsec], shape (steps,).
    free: c^T c minus the part that the model represents, shape (steps,).
    variance: s^2 [arcsec^2].
    prior_variance: variance of the prior of the size [arcsec^2].
    """
    information = free / variance
    gain = (score / variance) ** 2 / (2 * (information + 1 / prior_variance))
    return np.asarray(gain - np.log1p(prior_variance * information) / 2)


def _block_starts(turns: Array, run: _Indices) -> _Indices:
    """Return the first reading of each block, shape (blocks,)."""
    starts: list[_Indices] = []
    for rows in np.split(np.arange(len(run)), np.flatnonzero(np.diff(run)) + 1):
        blocks = int(np.clip(np.ceil(_BLOCKS_PER_REV * np.ptp(turns[rows])), 1, len(rows)))
        starts.append(rows[0] + np.arange(blocks) * len(rows) // blocks)
    return np.concatenate(starts)


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Means of the readings over blocks: angle [rev], error [arcsec] and number of the run, each of shape (blocks,)."""

    turns: Array
    errors: Array
    run: _Indices

    @property
    def runs(self) -> list[_Indices]:
        """The blocks of each run."""
        return np.split(np.arange(len(self.run)), np.flatnonzero(np.diff(self.run)) + 1)

    def is_place(self) -> NDArray[np.bool_]:
        """Return whether a step can be at the start of each block, shape (blocks,)."""
        is_place = np.zeros(len(self.run), bool)
        for blocks in self.runs:
            turns = self.turns[blocks]
            is_inside = (turns - turns[0] >= _BESIDE_REV) & (turns[-1] - turns >= _BESIDE_REV)
            is_inside[:_FEWEST_BESIDE] = False
            is_inside[len(blocks) - _FEWEST_BESIDE :] = False
            is_place[blocks] = is_inside
        return is_place

    def sums_to_end(self, values: Array) -> Array:
        """Return c^T values for the steps at all blocks, with the shape of values, (blocks, columns)."""
        sums = np.empty_like(values)
        for blocks in self.runs:
            sums[blocks] = np.cumsum(values[blocks][::-1], axis=0)[::-1]
        return sums

    def step_column(self, first: int) -> Array:
        """Return the column c of a step at a block, shape (blocks,)."""
        is_after = np.arange(len(self.run)) >= first
        return np.asarray(is_after & (self.run == self.run[first]), float)

    def count_to_end(self) -> Array:
        """Return c^T c, the number of blocks from each block to the end of its run, shape (blocks,)."""
        return np.concatenate([np.arange(len(blocks), 0, -1, dtype=float) for blocks in self.runs])


@dataclass(frozen=True, eq=False)
class _Fit:
    """Mean of the coefficients (R9) with the sizes of the profile.

    design: columns of the waves, levels and drifts, shape (blocks, columns).
    factor: Cholesky factor of P, shape (columns, columns).
    residual: errors minus the mean [arcsec], shape (blocks,).
    sigma2: variance of the noise that P contains [arcsec^2].
    mean_square: A^2 [arcsec^2].
    """

    design: Array
    factor: Array
    residual: Array
    sigma2: float
    mean_square: float

    @classmethod
    def of(cls, blocks: _Blocks, ratio: float) -> _Fit:
        """Return the fit to means over blocks.

        ratio: input revolutions per output revolution.
        """
        levels = [float(blocks.errors[rows].mean()) for rows in blocks.runs]
        departures = blocks.errors - np.repeat(levels, [len(rows) for rows in blocks.runs])
        mean_square = float(np.mean(departures**2)) or 1.0
        design, precision = _design(blocks, ratio)
        gram = design.T @ design
        moment = design.T @ departures
        sigma2 = 1e-2 * mean_square
        for _ in range(_NOISE_STEPS):
            used = max(sigma2, _LEAST_NOISE**2 * mean_square)
            factor = dpotrf(gram / used + np.diag(precision / mean_square), lower=1)[0]
            half = dtrtrs(factor, moment / used, lower=1)[0]
            residual = departures - design @ dtrtrs(factor, half, lower=1, trans=1)[0]
            sigma2 = float(np.mean(residual**2))
        return cls(
            design=design,
            factor=factor,
            residual=residual,
            sigma2=used,
            mean_square=mean_square,
        )

    def represented(self, products: Array) -> Array:
        """Return c^T X P^-1 X^T c / sigma^2 of columns c, shape (columns,).

        products: X^T c of each column, shape (columns, columns of the design).
        """
        half = dtrtrs(self.factor, products.T, lower=1)[0]
        return np.asarray(np.sum(half**2, axis=0) / self.sigma2)

    def unexplained(self, column: Array) -> Array:
        """Return the part of a column that the model does not represent, shape (blocks,)."""
        half = dtrtrs(self.factor, self.design.T @ column / self.sigma2, lower=1)[0]
        return np.asarray(column - self.design @ dtrtrs(self.factor, half, lower=1, trans=1)[0])


def _design(blocks: _Blocks, ratio: float) -> tuple[Array, Array]:
    """Return the columns of waves, levels and drifts, and the precision of their prior relative to 1/A^2.

    ratio: input revolutions per output revolution.
    """
    pairs = _pairs(ratio)
    waves = wave_values(blocks.turns, blocks.turns / ratio, pairs)
    slow = _slow_columns(blocks)
    orders, sidebands = wave_profile(pairs)
    variances = np.tile((sidebands * orders[pairs[:, 0]]) ** 2, 2)
    levels = len(blocks.runs)
    precision = np.concatenate([1 / variances, np.full(levels, _FLAT), np.ones(slow.shape[1] - levels)])
    return np.vstack([waves.real, waves.imag, slow.T]).T, precision


def _pairs(ratio: float) -> _Indices:
    """Return the waves (k, j) of the model up to order 16, and more slow waves, shape (waves, 2)."""
    slowest = range(1, min(_SLOW_ORDERS, max(1, int(ratio // 2))) + 1)
    # the fraction of any ratio, because the cycle determines only which waves are identical
    cycle = Fraction(ratio).limit_denominator(LARGEST_DENOMINATOR)
    pairs = wave_pairs(cycle, _COARSEST, more_pairs=[(0, j) for j in slowest])
    return pairs[pairs[:, 0] <= ALWAYS_ORDER]


def _slow_columns(blocks: _Blocks) -> Array:
    """Return the columns of the level and the drift of each run, first all levels, shape (blocks, columns)."""
    columns: list[Array] = []
    for power in range(_DRIFT_DEGREE + 1):
        for rows in blocks.runs:
            turns = blocks.turns[rows]
            along = 2 * (turns - turns[0]) / max(float(np.ptp(turns)), 1e-300) - 1
            column = np.zeros(len(blocks.run))
            column[rows] = np.polynomial.legendre.legval(along, np.eye(_DRIFT_DEGREE + 1)[power])
            columns.append(column)
    return np.stack(columns, axis=1)
