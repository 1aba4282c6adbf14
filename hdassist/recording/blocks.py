"""Linear model of the block means of a recording.

Block means of the readings are linear in all coefficients beta: amplitudes of the waves, a level for each run, a slow
drift for each run (polynomials of the time, up to a given degree), and lines outside the orders:

    y = X beta + n,   n correlated by (R4) with white variance sigma^2,   beta ~ N(0, V).                      (R8)

A part of the cycle hardly distinguishes neighbouring sidebands. If the model lacks a component, waves that nearly
cancel one another at the readings replace it there, and are huge at other positions. The power of the waves reveals
this:

    sum over k > 0 of (a_kj^2 + b_kj^2) / 2 > 4 A^2,   which no sum of distinct waves can have.               (R16)

The frequency f of a line is refined by Gauss-Newton steps, with the derivative d of its curve with respect to f, the
residuals r, and the precision P of the coefficients (R9):

    f += d^T r / (d^T d - d^T X P^-1 X^T d / sigma^2).                                                         (R17)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtrtrs

from hdassist.drive.model.geometry import Array
from hdassist.recording.components import (
    MOST_COMPONENTS,
    NO_COMPONENTS,
    SAME_PLACE,
    Components,
    clear_components,
    line_columns,
)
from hdassist.recording.noise import NoiseMemory, memory_of
from hdassist.recording.positions import OrderedReadings
from hdassist.recording.sizes import fine_size
from hdassist.recording.waves import (
    block_means,
    block_starts,
    distinct_pairs,
    fill_block_columns,
    visited_places,
    wave_pairs,
)

_Indices = NDArray[np.int64]
_LARGEST_POWER = 4.0  # largest power of all waves of the input, as a multiple of A^2


class BlockModel:
    """Block means and their design (R8). The columns are waves, levels, drifts and lines, in this order."""

    def __init__(
        self,
        readings: OrderedReadings,
        *,
        drift_degree: int,
        more_sidebands: int = 0,
        components: Components = NO_COMPONENTS,
        smaller: BlockModel | None = None,
        pairs: _Indices | None = None,
    ) -> None:
        """Set up the design of a recording.

        readings: readings in canonical order.
        drift_degree: highest degree of the drift.
        more_sidebands: sidebands on each side beyond the usual ones.
        components: components of the residuals of a smaller model.
        smaller: model of the same readings, whose columns and products are reused.
        pairs: waves (k, j), shape (waves, 2), None for those of the cycle that the readings distinguish.
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
        self._set_pairs(pairs)
        self.waves = 2 * len(self.pairs)
        self.degree = drift_degree
        self.slow_end = self.waves + self.runs * (1 + drift_degree)
        self.row_slow = _slow_columns(readings.run, readings.elapsed, drift_degree)
        other_columns = self._other_columns(readings, starts)
        self._set_design(readings, starts, other_columns, smaller)
        self.mean_square = _mean_square(self.errors, other_columns[:, : self.runs])

    def _set_pairs(self, pairs: _Indices | None) -> None:
        """Set the waves, and the usual size of those that the readings show as lower ones.

        pairs: waves (k, j), shape (waves, 2), None for those of the cycle that the readings distinguish.
        """
        all_pairs = wave_pairs(self.cycle, self.blocks_per_rev, self.more_sidebands, self.components.pairs)
        self.pairs = distinct_pairs(all_pairs, self.place_rev, self.cycle) if pairs is None else pairs
        self.image_share = _image_share(all_pairs, self.pairs)

    def _other_columns(self, readings: OrderedReadings, starts: _Indices) -> Array:
        """Return the columns of levels, drifts and lines, shape (blocks, columns).

        readings: readings in canonical order.
        starts: first row of each block.
        """
        row_lines = line_columns(readings.path_rev, readings.run, self.components.lines)
        return block_means(np.hstack([self.row_slow, row_lines]), starts)

    def _set_design(
        self,
        readings: OrderedReadings,
        starts: _Indices,
        other_columns: Array,
        smaller: BlockModel | None,
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
        smaller: BlockModel | None,
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

    def with_components(self, readings: OrderedReadings, components: Components) -> BlockModel:
        """Return a copy of this model, which must not have components, with components added."""
        return BlockModel(
            readings,
            drift_degree=self.degree,
            more_sidebands=self.more_sidebands,
            components=components,
            smaller=self,
        )

    def with_pairs(self, readings: OrderedReadings, pairs: _Indices) -> BlockModel:
        """Return a copy of this model with other waves (k, j), shape (waves, 2)."""
        return BlockModel(
            readings,
            drift_degree=self.degree,
            more_sidebands=self.more_sidebands,
            components=self.components,
            smaller=self,
            pairs=pairs,
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
        resolution = SAME_PLACE / self.longest_run
        return any(abs(line - fitted) < resolution for line in lines for fitted in self.components.lines)

    def shifted_lines(self, fit: UsualFit) -> Components:
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


def _mean_square(errors: Array, levels: Array) -> float:
    """Return the mean square A^2 of the errors minus the level of each run [arcsec^2], which is positive.

    errors: mean error of each block [arcsec], shape (blocks,).
    levels: columns of the levels, shape (blocks, runs).
    """
    offsets = np.linalg.lstsq(levels, errors, rcond=None)[0]
    return float(np.var(errors - levels @ offsets)) or float(np.var(errors)) or 1e-12


def _image_share(all_pairs: _Indices, pairs: _Indices) -> float:
    """Return the usual rms of the waves that the readings show as lower waves, over that of the fine waves of a model.

    all_pairs: waves (k, j) of the cycle, shape (waves, 2).
    pairs: waves of the model, shape (waves, 2).
    """
    images = all_pairs[_places_of(all_pairs, pairs) < 0]
    return fine_size(images) / fine_size(pairs)


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
class UsualFit:
    """Mean of the coefficients (R9) for the sizes of the profile.

    coefficients: mean coefficients, shape (columns,).
    factor: Cholesky factor of P, shape (columns, columns).
    sigma2: variance of the noise of a block [arcsec^2].
    """

    coefficients: Array
    factor: Array
    sigma2: float
