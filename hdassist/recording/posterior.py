"""Posterior of the amplitudes, by Gibbs sampling.

Block means of the readings are linear in all coefficients beta: amplitudes of the waves, a level for each run, a slow
drift for each run (polynomials of the time, up to a stated degree), and lines off the orders:

    y = X beta + n,   n with the memory (R4) and white variance sigma^2,   beta ~ N(0, V).                     (R8)

V is diagonal: v_kj of the waves (R6), one variance for the drifts of each power, inverse gamma distributed so that a
drift is Cauchy distributed with a scale of 0.02 A, none (a flat prior) for levels, and A^2 for lines. The readings
decide the degree of the drift: a power that they do not show stays near 0. Given the sizes the posterior of beta is
normal. With X and y whitened,

    P = X^T X / sigma^2 + V^-1,   beta | V, sigma, y ~ N(P^-1 X^T y / sigma^2, P^-1),                          (R9)

one Cholesky factor for each draw. Columns that hardly correlate (over a long recording, waves of different orders)
are drawn in groups, each given the others: with the columns g of X and all other coefficients o held,

    P_g = X_g^T X_g / sigma^2 + V_g^-1,   m_g = P_g^-1 X_g^T (y - X_o beta_o) / sigma^2,                       (R10)

which is still a Gibbs sampler of the same posterior, at a small part of the work. Given beta, the sizes are drawn by
(R7) and sigma^2 is inverse gamma:

    sigma^2 | beta, y ~ IG(m/2, |y - X beta|^2 / 2),   m blocks.                                               (R11)

Sampling alternates the two steps. It stops when the ranges of the curve over the cycle and over the visited places have
enough effective samples, or at a largest number of draws; the number of effective samples is part of the result. If
components of the residuals clearly exceed the noise (R14), the width of the sidebands is increased from 6 to 10 and 14
on each side while Akaike's criterion of white residuals improves, up to a quarter of the ratio: half of the spectrum is
left to tell noise with a memory from waves. Then the components that are left are added.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dtrtrs
from scipy.sparse.csgraph import connected_components

from hdassist.errors import Fault, UntrustedError
from hdassist.model.geometry import Array
from hdassist.recording.components import NO_COMPONENTS, Components, clear_components, line_columns
from hdassist.recording.noise import WHITE, NoiseMemory, memory_of, whitened
from hdassist.recording.positions import OrderedReadings, Recording, ordered_readings
from hdassist.recording.sizes import SizeTree, inverse_gamma
from hdassist.recording.waves import (
    USUAL_SIDEBANDS,
    BlockDesign,
    block_means,
    block_starts,
    cycle_curves,
    distinct_pairs,
    visited_places,
    wave_pairs,
)

_Indices = NDArray[np.int64]
ENOUGH_SAMPLES = 100.0  # effective: the ends of a 95 % interval are then good to some 10 % of its width
_MOST_DRAWS = 1200
_BATCH = 40  # draws between two looks at the effective samples
_BURN_SHARE = 0.2  # of the draws so far, dropped as not yet settled
_FIRST_DRAWS, _FIRST_KEPT = 50, 12  # of the fit with white noise; draws averaged for its residuals
_MORE_SIDEBANDS = (4, 8)  # beyond the usual 6, tried in this order
_WIDEST_OF_RATIO = 0.25  # sidebands over the ratio: wider ones fill the spectrum and take slow noise for waves
_DRIFT_SIZE = 0.02  # of A: scale of the Cauchy distribution of each power of the drift over a run (assumed)
_LEVEL_PRECISION = 1e-10  # over A^2: flat in effect
_COHERENT = 0.1  # correlation of two columns from which they are drawn together; below, a chain hardly slows
_GROUP_COLUMNS = 100  # small groups are merged up to so many columns, which one factor takes fastest
_LEAST_NOISE = 1e-3  # of A: no recording is better, and rounding errors stay far below


@dataclass(frozen=True, eq=False)
class AmplitudePosterior:
    """Samples of the amplitudes of a recording.

    pairs: waves (k, j), shape (waves, 2).
    cycle: ratio in lowest terms.
    amplitudes: cosines, then sines [arcsec], shape (draws, 2 waves).
    sigma_arcsec: white part of the noise of a block, shape (draws,).
    memory: memory of the noise.
    visited_rev: places with readings on the cycle [input rev], ascending, shape (readings,).
    readings_range: range of the readings less levels and drifts [arcsec].
    drift: coefficients of the drift of each run and power [arcsec], shape (draws, runs * degree).
    lines: periods per input revolution of the lines off the orders, shape (lines,).
    line_amplitudes: largest amplitude of each line in a run [arcsec], shape (draws, lines).
    block_curves: waves and lines at the blocks of readings [arcsec], shape (draws, blocks).
    block_place_rev: place of each block on the cycle [input rev], shape (blocks,).
    block_run: number of the run of each block, shape (blocks,).
    block_residual: block means less the mean curve [arcsec], shape (blocks,).
    effective: number of effective samples of the range over the cycle, or over the visited places if that is less.
    """

    pairs: _Indices
    cycle: Fraction
    amplitudes: Array
    sigma_arcsec: Array
    memory: NoiseMemory
    visited_rev: Array
    readings_range: float
    drift: Array
    lines: tuple[float, ...]
    line_amplitudes: Array
    block_curves: Array
    block_place_rev: Array
    block_run: _Indices
    block_residual: Array
    effective: float

    @property
    def noise_rms(self) -> Array:
        """Samples of the rms of the noise of a block [arcsec], with all that the waves leave, shape (draws,)."""
        return self.sigma_arcsec * self.memory.gain


def posterior_of_recording(
    recording: Recording, *, drift_degree: int = 2, seed: int = 0, most_draws: int = _MOST_DRAWS
) -> AmplitudePosterior:
    """Return samples of the amplitudes given a recording.

    recording: readings of one drive at one torque in one direction.
    drift_degree: highest degree of the slow drift over the time of a run; 0 for none.
    seed: of the random numbers.
    most_draws: draws at most, with those that are dropped.
    Raises DataError for sweeps in both directions.
    """
    readings = ordered_readings(recording)
    columns = BlockDesign(readings, block_starts(readings))
    model = _Model(readings, drift_degree=drift_degree, columns=columns)
    sampler = _Sampler(model, seed=seed)
    mean = sampler.first_mean()
    components = model.components(mean)
    for more_sidebands in _MORE_SIDEBANDS:
        if components == NO_COMPONENTS or more_sidebands + USUAL_SIDEBANDS > _WIDEST_OF_RATIO * recording.ratio:
            break
        wider = _Model(readings, drift_degree=drift_degree, more_sidebands=more_sidebands, columns=columns)
        other = _Sampler(wider, seed=seed)
        other_mean = other.first_mean()
        if wider.criterion(other_mean) > model.criterion(mean):
            break
        model, sampler, mean = wider, other, other_mean
        components = model.components(mean)
    if components != NO_COMPONENTS:
        model = _Model(
            readings,
            drift_degree=drift_degree,
            more_sidebands=model.more_sidebands,
            components=components,
            columns=columns,
        )
        sampler = _Sampler(model, seed=seed)
        mean = sampler.first_mean()
    sampler.use_memory(model.memory(mean))
    coefficients, sigma, effective = sampler.run(most_draws)
    return _result(readings, model, model.memory(mean), coefficients, sigma, effective)


def effective_samples(values: Array) -> float:
    """Return the number of independent samples that a chain is worth (Geyer 1992, initial positive sequence).

    values: of successive draws, shape (draws,).
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


def _coherent_groups(gram: Array) -> list[_Indices]:
    """Return groups of columns such that columns of different groups hardly correlate.

    gram: products of the columns, shape (columns, columns).
    """
    lengths = np.sqrt(np.diag(gram))
    lengths[lengths == 0] = 1.0
    coherence = np.abs(gram) / np.outer(lengths, lengths)
    count, label = connected_components(coherence > _COHERENT, directed=False)
    merged: list[_Indices] = []
    for number in range(count):
        columns = np.flatnonzero(label == number)
        if merged and len(merged[-1]) + len(columns) <= _GROUP_COLUMNS:
            merged[-1] = np.concatenate([merged[-1], columns])
        else:
            merged.append(columns)
    return merged


class _Model:
    """Block means and their design (R8): columns of the waves, then levels, then drifts, then lines."""

    def __init__(
        self,
        readings: OrderedReadings,
        *,
        drift_degree: int,
        more_sidebands: int = 0,
        components: Components = NO_COMPONENTS,
        columns: BlockDesign | None = None,
    ) -> None:
        """Set up the design of a recording.

        readings: readings in the order of their places.
        drift_degree: highest degree of the drift.
        more_sidebands: sidebands on each side beyond the usual ones.
        components: components of the residuals of a smaller model.
        columns: those of the smaller models of the same readings, which are not computed again.
        """
        starts = block_starts(readings)
        self.cycle = readings.cycle
        self.run = readings.run[starts]
        self.runs = int(self.run.max()) + 1
        self.more_sidebands = more_sidebands
        self.errors = block_means(readings.error_arcsec, starts)
        self.is_visited = visited_places(np.sort(readings.place_rev), readings.cycle)
        self.place_rev = block_means(readings.place_rev, starts)
        self.path_rev = block_means(readings.path_rev, starts)
        steps = np.diff(self.place_rev)[np.diff(self.run) == 0]
        positive = steps[steps > 0]
        self.blocks_per_rev = 1 / float(np.median(positive)) if len(positive) else 1.0
        pairs = wave_pairs(readings.cycle, self.blocks_per_rev, more_sidebands, components.pairs)
        self.pairs = distinct_pairs(pairs, self.place_rev, readings.cycle)
        self.row_slow = _slow_columns(readings.run, readings.elapsed, drift_degree)
        self.lines = components.lines
        self.row_lines = line_columns(readings.path_rev, readings.run, components.lines)
        beside = block_means(np.hstack([self.row_slow, self.row_lines]), starts)
        self.waves = 2 * len(self.pairs)
        self.design = np.empty((len(starts), self.waves + beside.shape[1]))
        (columns or BlockDesign(readings, starts)).fill(self.pairs, self.design[:, : self.waves])
        self.design[:, self.waves :] = beside
        self.degree = drift_degree
        self.slow_end = self.waves + self.runs * (1 + drift_degree)
        levels = beside[:, : self.runs]
        offsets = np.linalg.lstsq(levels, self.errors, rcond=None)[0]
        self.mean_square = float(np.var(self.errors - levels @ offsets)) or float(np.var(self.errors)) or 1e-12

    def residual(self, coefficients: Array) -> Array:
        """Return block means less the model's."""
        return self.errors - self.design @ coefficients

    def components(self, coefficients: Array) -> Components:
        """Return the components of the residuals that clearly exceed the noise."""
        return clear_components(self.residual(coefficients), self.path_rev, self.run, self.cycle)

    def memory(self, coefficients: Array) -> NoiseMemory:
        """Return the memory of the residuals."""
        return memory_of(self.residual(coefficients), self.run, self.blocks_per_rev)

    def criterion(self, coefficients: Array) -> float:
        """Return -2 log likelihood of white residuals, plus 2 for each column (Akaike's criterion)."""
        blocks, columns = self.design.shape
        mean_square = float(np.mean(self.residual(coefficients) ** 2))
        return float(blocks * np.log(mean_square) + 2 * columns)


def _slow_columns(run: _Indices, elapsed: Array, degree: int) -> Array:
    """Return the columns of levels and drifts, shape (readings, runs * (1 + degree)).

    run: number of the run, shape (readings,).
    elapsed: time within the run, -1/2 to 1/2, shape (readings,).
    degree: highest power of the time.
    """
    in_run = (run[:, None] == np.arange(int(run.max()) + 1)).astype(float)
    powers = [in_run]
    for power in range(1, degree + 1):
        legendre = np.polynomial.legendre.legval(2 * elapsed, np.eye(degree + 1)[power]) / 2  # 1 from end to end
        powers.append(in_run * legendre[:, None])
    return np.hstack(powers)


class _Sampler:
    """The chain: coefficients given sizes by (R9) and (R10), sizes given coefficients by (R7) and (R11)."""

    def __init__(self, model: _Model, *, seed: int) -> None:
        self._model = model
        self._rng = np.random.default_rng(seed)
        self._tree = SizeTree.start(model.pairs, model.mean_square)
        self._sigma2 = 1e-2 * model.mean_square
        self._drift2 = np.full(model.degree, _DRIFT_SIZE**2 * model.mean_square)
        self._beta = np.zeros(model.design.shape[1])
        self._use(WHITE)

    def use_memory(self, memory: NoiseMemory) -> None:
        """Whiten design and errors by a memory."""
        if memory != WHITE:
            self._use(memory)

    def _use(self, memory: NoiseMemory) -> None:
        design = whitened(self._model.design, self._model.run, memory)
        errors = whitened(self._model.errors, self._model.run, memory)
        self._gram = design.T @ design
        self._moment = design.T @ errors
        self._square = float(errors @ errors)
        self._blocks = len(errors)
        self._groups = _coherent_groups(self._gram)
        self._group_rows = [self._gram[group] for group in self._groups]
        self._group_grams = [self._gram[np.ix_(group, group)] for group in self._groups]

    def first_mean(self) -> Array:
        """Return the mean coefficients of a short chain."""
        draws = [self._step() for _ in range(_FIRST_DRAWS)]
        return np.asarray(np.mean(draws[-_FIRST_KEPT:], axis=0))

    def run(self, most_draws: int) -> tuple[Array, Array, float]:
        """Return draws of the coefficients, of sigma, and the number of effective samples."""
        model = self._model
        ranges: list[Array] = []
        draws: list[Array] = []
        sigmas: list[float] = []
        while True:
            for _ in range(_BATCH):
                draws.append(self._step())
                sigmas.append(float(np.sqrt(self._sigma2)))
            batch = np.array(draws[-_BATCH:])[:, : model.waves]
            curves = cycle_curves(batch, model.pairs, model.cycle)
            ranges.append(np.stack([np.ptp(curves, axis=1), np.ptp(curves[:, model.is_visited], axis=1)]))
            burnt = int(_BURN_SHARE * len(draws))
            whole, seen = np.concatenate(ranges, axis=1)[:, burnt:]
            effective = min(effective_samples(whole), effective_samples(seen))
            if effective >= ENOUGH_SAMPLES or len(draws) + _BATCH > most_draws:
                return np.array(draws[burnt:]), np.array(sigmas[burnt:]), effective

    def _prior_precision(self) -> Array:
        """Return the precision V^-1 of every coefficient, shape (columns,)."""
        model = self._model
        variances = np.concatenate([self._tree.wave, self._tree.wave])
        levels = np.full(model.runs, _LEVEL_PRECISION / model.mean_square)
        drifts = np.repeat(1 / self._drift2, model.runs)
        lines = np.full(len(self._moment) - model.slow_end, 1 / model.mean_square)
        return np.concatenate([1 / variances, levels, drifts, lines])

    def _step(self) -> Array:
        """Draw coefficients, then sizes; return the coefficients."""
        model, rng = self._model, self._rng
        prior = self._prior_precision()
        beta = self._beta
        for group, rows, gram in zip(self._groups, self._group_rows, self._group_grams, strict=True):
            others = rows @ beta - gram @ beta[group]
            moment = (self._moment[group] - others) / self._sigma2
            precision = gram / self._sigma2
            precision.flat[:: len(group) + 1] += prior[group]
            factor, is_singular = dpotrf(precision, lower=1, overwrite_a=1)  # scipy's own checks take twice as long
            if is_singular:
                raise UntrustedError(
                    "the readings do not distinguish the components", "record longer", Fault.ORDERS_UNTOLD
                )
            half = dtrtrs(factor, moment, lower=1)[0]
            normal = rng.standard_normal(len(group))
            beta[group] = dtrtrs(factor, half + normal, lower=1, trans=1)[0]

        cosines, sines = np.split(beta[: model.waves], 2)
        self._tree.draw(cosines**2 + sines**2, rng)
        misfit = float(self._square - 2 * beta @ self._moment + beta @ self._gram @ beta)
        drawn = float(inverse_gamma(self._blocks / 2, np.array(max(misfit, 0.0) / 2), rng))
        self._sigma2 = max(drawn, _LEAST_NOISE**2 * model.mean_square)
        if model.degree:
            drift = beta[model.waves + model.runs : model.slow_end].reshape(model.degree, model.runs)
            rates = (_DRIFT_SIZE**2 * model.mean_square + (drift**2).sum(axis=1)) / 2
            self._drift2 = inverse_gamma((1 + model.runs) / 2, rates, rng)
        return beta.copy()


def _result(
    readings: OrderedReadings,
    model: _Model,
    memory: NoiseMemory,
    coefficients: Array,
    sigma: Array,
    effective: float,
) -> AmplitudePosterior:
    """Return the posterior in the sense and sign of the recording as it was given."""
    mean = coefficients.mean(axis=0)
    cosines, sines = np.split(coefficients[:, : model.waves], 2, axis=1)
    amplitudes = readings.flipped * np.hstack([cosines, readings.turned * sines])
    levelled = readings.error_arcsec - model.row_slow @ mean[model.waves : model.slow_end]
    line_pairs = coefficients[:, model.slow_end :].reshape(len(coefficients), len(model.lines), model.runs, 2)
    is_error = np.ones(len(mean), bool)
    is_error[model.waves : model.slow_end] = False
    block_curves = coefficients[:, is_error] @ model.design[:, is_error].T
    return AmplitudePosterior(
        pairs=model.pairs,
        cycle=readings.cycle,
        amplitudes=amplitudes,
        sigma_arcsec=sigma,
        memory=memory,
        visited_rev=np.sort(readings.turned * readings.place_rev % float(readings.cycle.numerator)),
        readings_range=float(np.ptp(levelled)),
        drift=readings.flipped * coefficients[:, model.waves + model.runs : model.slow_end],
        lines=model.lines,
        line_amplitudes=np.hypot(line_pairs[..., 0], line_pairs[..., 1]).max(axis=2, initial=0.0),
        block_curves=readings.flipped * block_curves,
        block_place_rev=readings.turned * model.place_rev % float(readings.cycle.numerator),
        block_run=model.run,
        block_residual=readings.flipped * model.residual(mean),
        effective=effective,
    )
