"""Posterior distribution of the amplitudes, by Gibbs sampling.

Block means of the readings are linear in all coefficients beta: amplitudes of the waves, a level for each run, a slow
drift for each run (polynomials of the time, up to a given degree), and lines outside the orders:

    y = X beta + n,   n correlated by (R4) with white variance sigma^2,   beta ~ N(0, V).                      (R8)

V is diagonal. It contains v_kj of the waves (R6) and one variance for the drifts of each power, which has an inverse
gamma distribution, so that a drift is Cauchy distributed with a scale of 0.02 A. Levels have a flat prior, and lines
the variance A^2. The readings determine the degree of the drift: a power that they do not show stays near 0. Given the
sizes, the posterior of beta is normal. With X and y whitened,

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
the result. If components of the residuals clearly exceed the noise (R14), the width of the sidebands is increased from
6 to 10 and 14 on each side while Akaike's criterion for white residuals improves, up to a quarter of the ratio. Half of
the spectrum thus remains to distinguish correlated noise from waves. Then the remaining components are added.

A part of the cycle hardly distinguishes neighbouring sidebands. If the model lacks a component, waves that nearly
cancel one another at the readings replace it there, and are huge at other positions. The power of the waves reveals
this:

    sum over k > 0 of (a_kj^2 + b_kj^2) / 2 > 4 A^2,   which no sum of distinct waves can have.               (R16)

In this case the width of the sidebands is increased as well. If (R16) still holds, the components are found one by one
in the residuals of the mean (R9) with the sizes of the profile, for which the waves cannot become so large. The
frequency f of a line is refined by Gauss-Newton steps, with the derivative d of its curve with respect to f and the
residuals r:

    f += d^T r / (d^T d - d^T X P^-1 X^T d / sigma^2).                                                         (R17)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dtrtrs
from scipy.sparse.csgraph import connected_components

from hdassist.drive.model.geometry import Array
from hdassist.recording.components import (
    MOST_COMPONENTS,
    NO_COMPONENTS,
    SAME_PLACE,
    Components,
    clear_components,
    line_columns,
)
from hdassist.recording.noise import WHITE, NoiseMemory, memory_of, whitened
from hdassist.recording.positions import OrderedReadings, Recording, ordered_readings
from hdassist.recording.sizes import SizeTree, inverse_gamma
from hdassist.recording.waves import (
    USUAL_SIDEBANDS,
    CurveExtremes,
    block_means,
    block_starts,
    curve_extremes,
    cycle_curves,
    distinct_pairs,
    fill_block_columns,
    visited_places,
    wave_pairs,
)
from hdassist.run.errors import Fault, UntrustedError

_Indices = NDArray[np.int64]
# effective sample size for which the ends of a 95 % interval are accurate to about 10 % of its width
ENOUGH_SAMPLES = 100.0
_MOST_DRAWS = 1200
_BATCH = 40  # number of draws between two computations of the effective sample size
_LARGEST_POWER = 4.0  # largest power of all waves of the input, as a multiple of A^2
_LINE_STEPS = 4  # number of Gauss-Newton steps for the frequency of a line
_NOISE_STEPS = 3  # iterations for the variance of the noise with the usual sizes
_KEPT_DRAWS = 200  # approximate number of draws in the result, because neighbours in a longer chain are redundant
# draws of the sizes per draw of the coefficients, which takes longer; they reduce the correlation of the chain
_SIZE_STEPS = 4
_BURN_SHARE = 0.2  # share of the draws that is discarded as burn-in
_FIRST_DRAWS, _FIRST_KEPT = 30, 10  # number of draws of a short chain, and of those that are averaged
_MORE_SIDEBANDS = (4, 8)  # sidebands beyond the usual 6, tried in this sequence
# largest number of sidebands relative to the ratio; wider ones fill the spectrum and represent slow noise as waves
_WIDEST_OF_RATIO = 0.25
_DRIFT_SIZE = 0.02  # scale of the Cauchy distribution of each power of the drift over a run, as a share of A (assumed)
_LEVEL_PRECISION = 1e-10  # precision of the prior of levels relative to 1/A^2, which is effectively flat
# correlation of two columns above which they are drawn together; weaker correlation hardly slows the chain
_COHERENT = 0.1
_GROUP_COLUMNS = 100  # maximum number of columns of merged small groups, for which one factorisation is fastest
_LEAST_NOISE = 1e-3  # smallest noise, as a share of A: no recording is better, and rounding errors are much smaller


@dataclass(frozen=True, eq=False)
class AmplitudePosterior:
    """Samples of the amplitudes of a recording.

    pairs: waves (k, j), shape (waves, 2).
    cycle: ratio in lowest terms.
    amplitudes: cosines, then sines [arcsec], shape (draws, 2 waves).
    sigma_arcsec: white part of the noise of a block, shape (draws,).
    memory: autocorrelation of the noise.
    visited_rev: positions with readings on the cycle [input rev], ascending, shape (readings,).
    readings_range: range of the readings minus levels and drifts [arcsec].
    drift: coefficients of the drift of each run and power [arcsec], shape (draws, runs * degree).
    lines: periods per input revolution of the lines outside the orders, shape (lines,).
    line_amplitudes: largest amplitude of each line in a run [arcsec], shape (draws, lines).
    extremes: extremes of the curves over the cycle.
    block_curves: waves and lines at the blocks of readings [arcsec], shape (draws, blocks).
    block_place_rev: position of each block on the cycle [input rev], shape (blocks,).
    block_run: number of the run of each block, shape (blocks,).
    block_residual: block mean minus the mean curve [arcsec], shape (blocks,).
    effective: effective sample size of the range over the cycle or over the covered positions, whichever is smaller.
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
    extremes: CurveExtremes
    block_curves: Array
    block_place_rev: Array
    block_run: _Indices
    block_residual: Array
    effective: float

    @property
    def noise_rms(self) -> Array:
        """Samples of the rms of all noise of a block, including its correlated part [arcsec], shape (draws,)."""
        return self.sigma_arcsec * self.memory.gain


def posterior_of_recording(
    recording: Recording,
    *,
    drift_degree: int = 2,
    seed: int = 0,
    most_draws: int = _MOST_DRAWS,
) -> AmplitudePosterior:
    """Return samples of the amplitudes from their posterior distribution given a recording.

    recording: readings of one drive at one torque in one direction.
    drift_degree: highest degree of the slow drift over the time of a run, 0 for none.
    seed: seed of the random numbers.
    most_draws: largest number of draws, including discarded ones.
    Raises DataError for sweeps in both directions.
    """
    readings = ordered_readings(recording)
    model = _Model(readings, drift_degree=drift_degree)
    sampler = _Sampler(model, seed=seed)
    mean = sampler.first_mean()
    components = model.clear_components(mean)
    for more_sidebands in _MORE_SIDEBANDS:
        is_enough = components == NO_COMPONENTS and model.is_plausible(mean)
        if is_enough or more_sidebands + USUAL_SIDEBANDS > _WIDEST_OF_RATIO * recording.ratio:
            break
        wider = _Model(
            readings,
            drift_degree=drift_degree,
            more_sidebands=more_sidebands,
            smaller=model,
        )
        other = _Sampler(wider, seed=seed)
        other_mean = other.first_mean()
        if wider.rank(other_mean) > model.rank(mean):
            break
        model, sampler, mean = wider, other, other_mean
        components = model.clear_components(mean)
    if not model.is_plausible(mean):
        components = _plausible_components(readings, model, seed)
    if components != NO_COMPONENTS:
        model = model.with_components(readings, components)
        sampler = _Sampler(model, seed=seed)
        mean = sampler.first_mean()
    sampler.use_memory(model.memory(mean))
    return _result(readings, model, model.memory(mean), sampler.run(most_draws))


def _plausible_components(
    readings: OrderedReadings,
    model: _Model,
    seed: int,
) -> Components:
    """Return components with which the waves of a model are no larger than the readings allow.

    The components are found one by one in the residuals of a fit with the sizes of the profile, for which the waves
    cannot become large.

    readings: readings in canonical order.
    model: model without components.
    seed: seed of the random numbers.
    """
    components = NO_COMPONENTS
    for _ in range(MOST_COMPONENTS):
        larger = model.with_components(readings, components)
        fit = _Sampler(larger, seed=seed).usual_fit()
        added = larger.clear_components(fit.coefficients, most=1)
        if added == NO_COMPONENTS or larger.has_line_near(added.lines):
            return components
        components = components.joined(added)
        for _ in range(_LINE_STEPS if added.lines else 0):
            larger = model.with_components(readings, components)
            components = larger.shifted_lines(_Sampler(larger, seed=seed).usual_fit())
        larger = model.with_components(readings, components)
        mean = _Sampler(larger, seed=seed).first_mean()
        if larger.is_plausible(mean):
            smaller_ones = larger.clear_components(mean)
            return components if larger.has_line_near(smaller_ones.lines) else components.joined(smaller_ones)
    return components


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


def _coherent_groups(gram: Array) -> list[_Indices]:
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


class _Model:
    """Block means and their design (R8). The columns are waves, levels, drifts and lines, in this order."""

    def __init__(
        self,
        readings: OrderedReadings,
        *,
        drift_degree: int,
        more_sidebands: int = 0,
        components: Components = NO_COMPONENTS,
        smaller: _Model | None = None,
    ) -> None:
        """Set up the design of a recording.

        readings: readings in canonical order.
        drift_degree: highest degree of the drift.
        more_sidebands: sidebands on each side beyond the usual ones.
        components: components of the residuals of a smaller model.
        smaller: model of the same readings, whose columns and products are reused.
        """
        starts = block_starts(readings)
        self.cycle = readings.cycle
        self.run = readings.run[starts]
        self.runs = int(self.run.max()) + 1
        self.more_sidebands = more_sidebands
        self.components = components
        self.errors = block_means(readings.error_arcsec, starts)
        self.is_visited = visited_places(np.sort(readings.place_rev), readings.cycle)
        self.place_rev = block_means(readings.place_rev, starts)
        self.path_rev = block_means(readings.path_rev, starts)
        self.blocks_per_rev = _blocks_per_rev(self.place_rev, self.run)
        pairs = wave_pairs(readings.cycle, self.blocks_per_rev, more_sidebands, components.pairs)
        self.pairs = distinct_pairs(pairs, self.place_rev, readings.cycle)
        self.waves = 2 * len(self.pairs)
        self.degree = drift_degree
        self.slow_end = self.waves + self.runs * (1 + drift_degree)
        self.row_slow = _slow_columns(readings.run, readings.elapsed, drift_degree)
        row_lines = line_columns(readings.path_rev, readings.run, components.lines)
        other_columns = block_means(np.hstack([self.row_slow, row_lines]), starts)
        self._set_design(readings, starts, other_columns, smaller)
        levels = other_columns[:, : self.runs]
        offsets = np.linalg.lstsq(levels, self.errors, rcond=None)[0]
        self.mean_square = float(np.var(self.errors - levels @ offsets)) or float(np.var(self.errors)) or 1e-12

    def _set_design(
        self,
        readings: OrderedReadings,
        starts: _Indices,
        other_columns: Array,
        smaller: _Model | None,
    ) -> None:
        """Set the columns and their products. Those that a smaller model has are copied from it.

        readings: readings in canonical order.
        starts: first row of each block.
        other_columns: columns other than waves, shape (blocks, other columns).
        smaller: model with some of the columns, or None.
        """
        is_old = np.zeros(self.waves + other_columns.shape[1], bool)
        old = np.zeros(0, np.int64)
        if smaller is not None:
            places = _places_of(self.pairs, smaller.pairs)
            is_old[: self.waves] = np.tile(places >= 0, 2)
            cosines = places[places >= 0]
            old = np.concatenate([cosines, len(smaller.pairs) + cosines])
        columns = np.empty((len(is_old), len(starts)))  # transposed, because each column is then contiguous
        new = np.flatnonzero(~is_old[: self.waves])
        fill_block_columns(readings, starts, self.pairs[new[: len(new) // 2]], [columns[place] for place in new])
        columns[self.waves :] = other_columns.T
        if smaller is not None:
            for place, old_place in zip(np.flatnonzero(is_old), old, strict=True):
                columns[place] = smaller.design[:, old_place]
        self.design: Array = columns.T
        self.gram: Array = self._products(smaller, old, is_old)

    def _products(
        self,
        smaller: _Model | None,
        old: _Indices,
        is_old: NDArray[np.bool_],
    ) -> Array:
        """Return the products of all columns, copied from a smaller model if it has them, shape (columns, columns)."""
        if smaller is None:
            return self.design.T @ self.design
        gram = np.empty((len(is_old), len(is_old)))
        gram[np.ix_(is_old, is_old)] = smaller.gram[np.ix_(old, old)]
        products = self.design.T @ self.design[:, ~is_old]
        gram[:, ~is_old] = products
        gram[~is_old] = products.T
        return gram

    def residual(self, coefficients: Array) -> Array:
        """Return the block means minus those of the model [arcsec], shape (blocks,)."""
        return self.errors - self.design @ coefficients

    def clear_components(self, coefficients: Array, most: int = MOST_COMPONENTS) -> Components:
        """Return the components of the residuals that clearly exceed the noise, the strongest first."""
        return clear_components(
            self.residual(coefficients),
            self.path_rev,
            self.run,
            self.cycle,
            most=most,
        )

    def memory(self, coefficients: Array) -> NoiseMemory:
        """Return the autocorrelation of the residuals."""
        return memory_of(self.residual(coefficients), self.run, self.blocks_per_rev)

    def with_components(self, readings: OrderedReadings, components: Components) -> _Model:
        """Return a copy of this model, which must not have components, with components added."""
        return _Model(
            readings,
            drift_degree=self.degree,
            more_sidebands=self.more_sidebands,
            components=components,
            smaller=self,
        )

    def is_plausible(self, coefficients: Array) -> bool:
        """Return whether the waves of the input are no larger than the readings allow.

        Waves that are hardly distinct at the readings may nearly cancel one another there. Such sums represent
        components that the model lacks, and are huge at other positions.
        """
        is_input = np.tile(self.pairs[:, 0] > 0, 2)
        power = float(np.sum(coefficients[: self.waves][is_input] ** 2)) / 2
        return power <= _LARGEST_POWER * self.mean_square

    def rank(self, coefficients: Array) -> tuple[bool, float]:
        """Return a sort key that is smaller for the better of two models."""
        return not self.is_plausible(coefficients), self.criterion(coefficients)

    @property
    def longest_run(self) -> float:
        """The length of the longest run [input rev]."""
        return max(float(np.ptp(self.path_rev[self.run == number])) for number in range(self.runs))

    def has_line_near(self, lines: Sequence[float]) -> bool:
        """Return whether a line is so close to a line of the model that the longest run does not resolve them."""
        return any(abs(line - own) < SAME_PLACE / self.longest_run for line in lines for own in self.components.lines)

    def shifted_lines(self, fit: _UsualFit) -> Components:
        """Return the components after one Gauss-Newton step of the frequencies of the lines."""
        residual = self.residual(fit.coefficients)
        in_lines = fit.coefficients[self.slow_end :].reshape(len(self.components.lines), self.runs, 2)
        largest_step = 0.5 / self.longest_run
        lines: list[float] = []
        for line, in_runs in zip(self.components.lines, in_lines, strict=True):
            slope = self._slope_over_place(line, in_runs)
            half = dtrtrs(fit.factor, slope @ self.design, lower=1)[0]
            # the information is reduced by the part that the other columns can represent
            information = float(slope @ slope - half @ half / fit.sigma2)
            step = float(slope @ residual) / information if information > 0 else 0.0
            lines.append(line + float(np.clip(step, -largest_step, largest_step)))
        return Components(pairs=self.components.pairs, lines=tuple(lines))

    def _slope_over_place(self, line: float, in_runs: Array) -> Array:
        """Return the derivative of a line with respect to its frequency, shape (blocks,).

        The phase in the middle of each run is fixed.

        in_runs: coefficients of its cosine and sine in each run [arcsec], shape (runs, 2).
        """
        slope = np.zeros(len(self.errors))
        for number, (cosine, sine) in enumerate(in_runs.tolist()):
            in_run = self.run == number
            path = self.path_rev[in_run]
            phase = 2 * np.pi * line * path
            slope[in_run] = 2 * np.pi * (path - path.mean()) * (sine * np.cos(phase) - cosine * np.sin(phase))
        return slope

    def criterion(self, coefficients: Array) -> float:
        """Return Akaike's criterion: -2 log likelihood of white residuals plus 2 for each column."""
        blocks, columns = self.design.shape
        mean_square = float(np.mean(self.residual(coefficients) ** 2))
        return float(blocks * np.log(mean_square) + 2 * columns)


def _blocks_per_rev(place_rev: Array, run: _Indices) -> float:
    """Return the usual number of blocks per input revolution, or 1 if all blocks of a run have the same position."""
    steps = np.diff(place_rev)[np.diff(run) == 0]
    positive = steps[steps > 0]
    return 1 / float(np.median(positive)) if len(positive) else 1.0


def _places_of(pairs: _Indices, others: _Indices) -> _Indices:
    """Return the index of each wave among other waves, -1 if it is not one of them, shape (waves,)."""
    place_of = {pair: place for place, pair in enumerate(map(tuple, others.tolist()))}
    return np.array([place_of.get(pair, -1) for pair in map(tuple, pairs.tolist())])


def _slow_columns(
    run: _Indices,
    elapsed: Array,
    degree: int,
) -> Array:
    """Return the columns of levels and drifts, shape (readings, runs * (1 + degree)).

    run: number of the run, shape (readings,).
    elapsed: time within the run, scaled to -1/2 to 1/2, shape (readings,).
    degree: highest power of the time.
    """
    in_run = (run[:, None] == np.arange(int(run.max()) + 1)).astype(float)
    powers = [in_run]
    for power in range(1, degree + 1):
        # the scale gives a change of 1 from end to end
        legendre = np.polynomial.legendre.legval(2 * elapsed, np.eye(degree + 1)[power]) / 2
        powers.append(in_run * legendre[:, None])
    return np.hstack(powers)


@dataclass(frozen=True, eq=False)
class _UsualFit:
    """Mean of the coefficients (R9) for the sizes of the profile.

    coefficients: mean coefficients, shape (columns,).
    factor: Cholesky factor of P, shape (columns, columns).
    sigma2: variance of the noise of a block [arcsec^2].
    """

    coefficients: Array
    factor: Array
    sigma2: float


@dataclass(frozen=True, eq=False)
class _Chain:
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


class _Sampler:
    """The Markov chain: coefficients given sizes by (R9) and (R10), sizes given coefficients by (R7) and (R11)."""

    def __init__(self, model: _Model, *, seed: int) -> None:
        self._model = model
        self._rng = np.random.default_rng(seed)
        self._tree = SizeTree.start(model.pairs, model.mean_square)
        self._sigma2 = 1e-2 * model.mean_square
        self._drift2 = np.full(model.degree, _DRIFT_SIZE**2 * model.mean_square)
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
        self._groups = _coherent_groups(self._gram)
        self._group_rows = [self._gram[group] for group in self._groups]
        self._group_grams = [self._gram[np.ix_(group, group)] for group in self._groups]
        self._gram_beta = self._gram @ self._beta

    def first_mean(self) -> Array:
        """Return the mean coefficients of the last draws of a short chain, shape (columns,)."""
        draws = [self._step() for _ in range(_FIRST_DRAWS)]
        return np.asarray(np.mean(draws[-_FIRST_KEPT:], axis=0))

    def usual_fit(self) -> _UsualFit:
        """Return the fit for the sizes of the profile. The chain must not have started."""
        sigma2 = self._sigma2
        for _ in range(_NOISE_STEPS):
            precision = self._gram / sigma2 + np.diag(self._prior_precision())
            factor = dpotrf(precision, lower=1)[0]
            half = dtrtrs(factor, self._moment / sigma2, lower=1)[0]
            mean = dtrtrs(factor, half, lower=1, trans=1)[0]
            used = sigma2
            sigma2 = float(np.mean(self._model.residual(mean) ** 2))
        return _UsualFit(
            coefficients=mean,
            factor=factor,
            sigma2=used,
        )

    def run(self, most_draws: int) -> _Chain:
        """Return the draws of a chain with a sufficient effective sample size, or of the largest allowed length."""
        model = self._model
        extremes: list[CurveExtremes] = []
        draws: list[Array] = []
        sigmas: list[float] = []
        while True:
            for _ in range(_BATCH):
                draws.append(self._step())
                sigmas.append(float(np.sqrt(self._sigma2)))
            batch = np.array(draws[-_BATCH:])[:, : model.waves]
            curves = cycle_curves(batch, model.pairs, model.cycle)
            extremes.append(curve_extremes(curves, model.is_visited))
            burnt = int(_BURN_SHARE * len(draws))
            joined = CurveExtremes.joined(extremes)
            whole = joined.range_arcsec[burnt:]
            seen = joined.visited_range_arcsec[burnt:]
            effective = min(effective_samples(whole), effective_samples(seen))
            if effective >= ENOUGH_SAMPLES or len(draws) + _BATCH > most_draws:
                break
        kept = slice(burnt, None, max(1, (len(draws) - burnt) // _KEPT_DRAWS))
        return _Chain(
            coefficients=np.array(draws[kept]),
            sigma_arcsec=np.array(sigmas[kept]),
            extremes=joined.chosen(kept),
            effective=effective,
        )

    def _prior_precision(self) -> Array:
        """Return the prior precision V^-1 of every coefficient, shape (columns,)."""
        model = self._model
        variances = np.concatenate([self._tree.wave, self._tree.wave])
        levels = np.full(model.runs, _LEVEL_PRECISION / model.mean_square)
        drifts = np.repeat(1 / self._drift2, model.runs)
        lines = np.full(len(self._moment) - model.slow_end, 1 / model.mean_square)
        return np.concatenate([1 / variances, levels, drifts, lines])

    def _step(self) -> Array:
        """Draw the coefficients and then the sizes, and return a copy of the coefficients, shape (columns,)."""
        model, rng = self._model, self._rng
        prior = self._prior_precision()
        beta = self._beta
        for group, rows, gram in zip(self._groups, self._group_rows, self._group_grams, strict=True):
            others = self._gram_beta[group] - gram @ beta[group]
            moment = (self._moment[group] - others) / self._sigma2
            precision = gram / self._sigma2
            precision.flat[:: len(group) + 1] += prior[group]
            # LAPACK directly, because scipy's checks take twice as long
            # transposed, because LAPACK would copy a symmetric matrix in C order
            factor, is_singular = dpotrf(precision.T, lower=1, overwrite_a=1)
            if is_singular:
                raise UntrustedError(
                    "the readings do not distinguish the components", "record longer", Fault.ORDERS_UNTOLD
                )
            half = dtrtrs(factor, moment, lower=1)[0]
            normal = rng.standard_normal(len(group))
            drawn_beta = dtrtrs(factor, half + normal, lower=1, trans=1)[0]
            # updating the product takes a third of the time of a new one, because memory limits both
            self._gram_beta += (drawn_beta - beta[group]) @ rows
            beta[group] = drawn_beta

        cosines, sines = np.split(beta[: model.waves], 2)
        for _ in range(_SIZE_STEPS):
            self._tree.draw(cosines**2 + sines**2, rng)
        misfit = float(self._square - 2 * beta @ self._moment + beta @ self._gram_beta)
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
    chain: _Chain,
) -> AmplitudePosterior:
    """Return the posterior in the direction and sign of the original recording."""
    coefficients = chain.coefficients
    mean = coefficients.mean(axis=0)
    cosines, sines = np.split(
        coefficients[:, : model.waves],
        2,
        axis=1,
    )
    amplitudes = readings.flipped * np.hstack([cosines, readings.turned * sines])
    levelled = readings.error_arcsec - model.row_slow @ mean[model.waves : model.slow_end]
    lines = model.components.lines
    line_pairs = coefficients[:, model.slow_end :].reshape(len(coefficients), len(lines), model.runs, 2)
    block_curves = coefficients[:, : model.waves] @ model.design[:, : model.waves].T
    block_curves += coefficients[:, model.slow_end :] @ model.design[:, model.slow_end :].T
    return AmplitudePosterior(
        pairs=model.pairs,
        cycle=readings.cycle,
        amplitudes=amplitudes,
        sigma_arcsec=chain.sigma_arcsec,
        memory=memory,
        visited_rev=np.sort(readings.turned * readings.place_rev % float(readings.cycle.numerator)),
        readings_range=float(np.ptp(levelled)),
        drift=readings.flipped * coefficients[:, model.waves + model.runs : model.slow_end],
        lines=lines,
        line_amplitudes=np.hypot(line_pairs[..., 0], line_pairs[..., 1]).max(axis=2, initial=0.0),
        extremes=chain.extremes.mirrored(
            turned=readings.turned, flipped=readings.flipped, points=len(model.is_visited)
        ),
        block_curves=readings.flipped * block_curves,
        block_place_rev=readings.turned * model.place_rev % float(readings.cycle.numerator),
        block_run=model.run,
        block_residual=readings.flipped * model.residual(mean),
        effective=chain.effective,
    )
