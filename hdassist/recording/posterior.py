"""Posterior distribution of the amplitudes: the choice of the waves, and the samples.

The model of the block means and its sampler are in `blocks` and `chain`. If components of the residuals clearly exceed
the noise (R14), the width of the sidebands is increased from 6 to 10 and 14 on each side while Akaike's criterion for
white residuals improves, up to a quarter of the ratio. Half of the spectrum thus remains to distinguish correlated
noise from waves. Then the remaining components are added.

If the waves cannot be distinct (R16), the width of the sidebands is increased as well. If (R16) still holds, the
components are found one by one in the residuals of the mean (R9) with the sizes of the profile, for which the waves
cannot become so large. The frequencies of lines are refined by (R17).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.model.geometry import Array
from hdassist.recording.blocks import BlockModel
from hdassist.recording.chain import MOST_DRAWS, Chain, Sampler
from hdassist.recording.components import (
    MOST_COMPONENTS,
    NO_COMPONENTS,
    Components,
)
from hdassist.recording.directions import DirectionsSampler, ModelledDirection
from hdassist.recording.noise import NoiseMemory
from hdassist.recording.positions import OrderedReadings, Recording, ordered_readings
from hdassist.recording.waves import (
    USUAL_SIDEBANDS,
    CurveExtremes,
)

_Indices = NDArray[np.int64]
_LINE_STEPS = 4  # number of Gauss-Newton steps for the frequency of a line
_MORE_SIDEBANDS = (4, 8)  # sidebands beyond the usual 6, tried in this sequence
# largest number of sidebands relative to the ratio; wider ones fill the spectrum and represent slow noise as waves
_WIDEST_OF_RATIO = 0.25


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
    image_share: usual rms of the waves that the readings show as lower waves, over that of the fine waves.
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
    image_share: float

    @property
    def noise_rms(self) -> Array:
        """Samples of the rms of all noise of a block, including its correlated part [arcsec], shape (draws,)."""
        return self.sigma_arcsec * self.memory.gain


def posterior_of_recording(
    recording: Recording,
    *,
    drift_degree: int = 2,
    seed: int = 0,
    most_draws: int = MOST_DRAWS,
) -> AmplitudePosterior:
    """Return samples of the amplitudes from their posterior distribution given a recording.

    recording: readings of one drive at one torque in one direction.
    drift_degree: highest degree of the slow drift over the time of a run, 0 for none.
    seed: seed of the random numbers.
    most_draws: largest number of draws, including discarded ones.
    Raises DataError for sweeps in both directions.
    """
    readings = ordered_readings(recording)
    choice = _choice(readings, drift_degree=drift_degree, seed=seed)
    memory = choice.memory
    choice.sampler.use_memory(memory)
    return _result(readings, choice.model, memory, choice.sampler.run(most_draws))


def posteriors_of_directions(
    forward: Recording,
    backward: Recording,
    *,
    drift_degree: int = 2,
    seed: int = 0,
    most_draws: int = MOST_DRAWS,
) -> tuple[AmplitudePosterior, AmplitudePosterior]:
    """Return samples of the amplitudes of both directions of rotation, given the readings of both.

    The waves are chosen for each direction alone. Both directions then have the waves of either.

    forward, backward: readings of one drive at one torque, each in one direction.
    drift_degree, seed, most_draws: arguments of `posterior_of_recording`.
    Raises DataError under the conditions of `posterior_of_recording`.
    """
    readings = [ordered_readings(recording) for recording in (forward, backward)]
    choices = [_choice(of_direction, drift_degree=drift_degree, seed=seed) for of_direction in readings]
    pairs = np.unique(np.concatenate([choice.model.pairs for choice in choices]), axis=0)
    directions = []
    for of_direction, choice in zip(readings, choices, strict=True):
        model = choice.model
        if not np.array_equal(model.pairs, pairs):
            model = model.with_pairs(of_direction, pairs)
        cosine_signs = np.full(len(pairs), float(of_direction.flipped))
        signs = np.concatenate([cosine_signs, of_direction.turned * cosine_signs])
        directions.append(ModelledDirection(model=model, memory=choice.memory, signs=signs))
    chains = DirectionsSampler(directions, seed=seed).run(most_draws)
    results = [
        _result(of_direction, direction.model, direction.memory, chain)
        for of_direction, direction, chain in zip(readings, directions, chains, strict=True)
    ]
    return results[0], results[1]


@dataclass(frozen=True, eq=False)
class _Choice:
    """The chosen model of a recording.

    model: the model.
    sampler: its sampler after a short chain.
    memory: autocorrelation of the residuals of the short chain.
    """

    model: BlockModel
    sampler: Sampler
    memory: NoiseMemory


def _choice(
    readings: OrderedReadings,
    *,
    drift_degree: int,
    seed: int,
) -> _Choice:
    """Return the model with as many waves and components as the readings show.

    readings: readings in canonical order.
    drift_degree, seed: arguments of `posterior_of_recording`.
    """
    model = BlockModel(readings, drift_degree=drift_degree)
    sampler = Sampler(model, seed=seed)
    mean = sampler.first_mean()
    components = model.clear_components(mean)
    for more_sidebands in _MORE_SIDEBANDS:
        is_enough = components == NO_COMPONENTS and model.is_plausible(mean)
        if is_enough or more_sidebands + USUAL_SIDEBANDS > _WIDEST_OF_RATIO * float(readings.cycle):
            break
        wider = BlockModel(
            readings,
            drift_degree=drift_degree,
            more_sidebands=more_sidebands,
            smaller=model,
        )
        wider_sampler = Sampler(wider, seed=seed)
        wider_mean = wider_sampler.first_mean()
        if wider.rank(wider_mean) > model.rank(mean):
            break
        model = wider
        sampler = wider_sampler
        mean = wider_mean
        components = model.clear_components(mean)
    if not model.is_plausible(mean):
        components = _plausible_components(readings, model, seed)
    if components != NO_COMPONENTS:
        model = model.with_components(readings, components)
        sampler = Sampler(model, seed=seed)
        mean = sampler.first_mean()
    return _Choice(model=model, sampler=sampler, memory=model.memory(mean))


def _plausible_components(
    readings: OrderedReadings,
    model: BlockModel,
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
        fit = Sampler(larger, seed=seed).usual_fit()
        added = larger.clear_components(fit.coefficients, most=1)
        if added == NO_COMPONENTS or larger.has_line_near(added.lines):
            return components
        components = components.joined(added)
        for _ in range(_LINE_STEPS if added.lines else 0):
            larger = model.with_components(readings, components)
            components = larger.shifted_lines(Sampler(larger, seed=seed).usual_fit())
        larger = model.with_components(readings, components)
        mean = Sampler(larger, seed=seed).first_mean()
        if larger.is_plausible(mean):
            smaller_ones = larger.clear_components(mean)
            return components if larger.has_line_near(smaller_ones.lines) else components.joined(smaller_ones)
    return components


def _result(
    readings: OrderedReadings,
    model: BlockModel,
    memory: NoiseMemory,
    chain: Chain,
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
        image_share=model.image_share,
    )
