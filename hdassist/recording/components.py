"""Components of the residuals that clearly exceed the noise.

A wave that the model lacks stays in the residuals and would be taken for noise, so a bad drive could pass. The
residuals r of a run, at the angles u along it, have the power

    P(f) = |sum of r exp(-2 pi i f u)|^2                                                                       (R14)

at f periods per input revolution. If r is noise, P(f) over the mean power of its m neighbours exceeds q with
probability (1 + q/m)^-m: noise with a memory has a smooth spectrum, so the neighbours show its level. A component is
taken if noise has so large a power once in 1000 recordings, all places f together. It is then removed from the
residuals, and the search continues with the remainder.

What a component is follows from its place. If a run of the whole cycle resolves the sidebands and the component lies on
one of an order, with |j| up to 14 and a quarter of the ratio, it is this wave (k, j) of the torus. Otherwise it is a
line, for example a ball pass or a motor: a wave with a phase of its own in each run, which comes back with another
phase in the next cycle.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from hdassist.model.geometry import Array

_Indices = NDArray[np.int64]
_CHANCE = 1e-3  # of a component in noise, for each recording
_NEIGHBOURS = 64  # places around a peak, on both sides together, that show the level of the noise
_PEAK_PLACES = 4  # on each side of a peak that belong to it, of a spectrum that is twice as fine as the resolution
MOST_COMPONENTS = 8
_FEWEST_PERIODS = 3.0  # in the longest run: slower components are drift or waves of the output
_WIDEST_SIDEBAND, _WIDEST_OF_RATIO = 14, 0.25  # of a component that is a wave of the torus; over the ratio
_ON_WAVE = 0.2  # of the resolution: how far a component may lie off a wave of the torus
_WHOLE = 0.97  # of the cycle, in one run, from which its sidebands are resolved
_CELLS_PER_STEP = 4  # of even angles, on which residuals are set: a wave loses 3 % of its power at most
SAME_PLACE = 0.25  # of the resolution: a component so near to a line that was removed is what the removal left of it
_REMOVAL_STEPS = 5  # places between two of the spectrum, at which a peak is sought


@dataclass(frozen=True)
class Components:
    """Components of the residuals.

    pairs: waves (k, j) of the torus.
    lines: periods per input revolution of the other components, shape (lines,).
    """

    pairs: tuple[tuple[int, int], ...] = ()
    lines: tuple[float, ...] = ()

    def joined(self, others: Components) -> Components:
        """Return these components and others."""
        return Components(pairs=tuple({*self.pairs, *others.pairs}), lines=self.lines + others.lines)


NO_COMPONENTS = Components()


def clear_components(
    residual: Array, path_rev: Array, run: _Indices, cycle: Fraction, most: int = MOST_COMPONENTS
) -> Components:
    """Return the components of the residuals that clearly exceed the noise.

    residual: of each block [arcsec], shape (blocks,).
    path_rev: angle of the input along the run [rev], shape (blocks,).
    run: number of the run of each block, ascending, shape (blocks,).
    cycle: ratio in lowest terms.
    """
    longest = max(float(np.ptp(path_rev[run == number])) for number in range(int(run.max()) + 1))
    if not longest:
        return NO_COMPONENTS
    pairs: list[tuple[int, int]] = []
    lines: list[float] = []
    rest = residual.copy()
    for _ in range(most):
        place = _clearest_place(rest, path_rev, run, longest)
        if place is None or any(abs(place - taken) < SAME_PLACE / longest for taken in lines):
            break
        rest = rest - _wave_at(rest, path_rev, run, place)
        pair = _pair_at(place, cycle, longest)
        if pair is None:
            lines.append(place)
        elif pair not in pairs:
            pairs.append(pair)
    return Components(pairs=tuple(pairs), lines=tuple(lines))


def line_columns(path_rev: Array, run: _Indices, lines: tuple[float, ...]) -> Array:
    """Return cosines and sines of lines, a pair of columns for each line and run, shape (readings, 2 runs lines).

    path_rev: angle of the input along the run [rev], shape (readings,).
    run: number of the run, shape (readings,).
    lines: periods per input revolution.
    """
    columns: list[Array] = []
    for line in lines:
        wave = np.exp(2j * np.pi * line * path_rev)
        for number in range(int(run.max()) + 1):
            in_run = run == number
            columns += [wave.real * in_run, wave.imag * in_run]
    return np.stack(columns, axis=1) if columns else np.zeros((len(path_rev), 0))


def _clearest_place(residual: Array, path_rev: Array, run: _Indices, longest: float) -> float | None:
    """Return the place [periods per input rev] of the component that exceeds the noise most; None if there is none.

    longest: length of the longest run [rev].
    """
    places, power = _spectrum(residual, path_rev, run, longest)
    around = uniform_filter1d(power, _NEIGHBOURS + 1, mode="reflect") * (_NEIGHBOURS + 1)
    own = uniform_filter1d(power, 2 * _PEAK_PLACES + 1, mode="reflect") * (2 * _PEAK_PLACES + 1)
    neighbours = _NEIGHBOURS - 2 * _PEAK_PLACES
    level = np.maximum(around - own, 1e-300) / neighbours
    resolved = neighbours / 2  # two places of the spectrum for each that the recording resolves
    log_chance = -resolved * np.log1p(power / level / resolved)
    log_chance[places < _FEWEST_PERIODS / longest] = 0.0
    chosen = int(log_chance.argmin())
    if log_chance[chosen] > np.log(_CHANCE / len(places)):
        return None
    step = places[1] - places[0]
    near = places[chosen] + step * np.linspace(-1, 1, 2 * _REMOVAL_STEPS + 1)
    removed = [float(np.sum(_wave_at(residual, path_rev, run, float(place)) ** 2)) for place in near]
    return float(near[int(np.argmax(removed))])


def _spectrum(residual: Array, path_rev: Array, run: _Indices, longest: float) -> tuple[Array, Array]:
    """Return places [periods per input rev], twice as fine as the longest run resolves, and the power (R14) there.

    The power is summed over the runs. Residuals are set on even angles that are finer than the usual step, so that
    neither lost nor uneven readings move a component. Places end at half a period per usual step.
    """
    steps = np.diff(path_rev)[np.diff(run) == 0]
    usual_step = float(np.median(steps[steps > 0])) if (steps > 0).any() else longest
    cells = _CELLS_PER_STEP * (int(np.ceil(longest / usual_step)) + 1)
    cell_rev = usual_step / _CELLS_PER_STEP
    points = 2 * cells
    power = np.zeros(points // 2 + 1)
    for number in range(int(run.max()) + 1):
        in_run = run == number
        angle = path_rev[in_run] - path_rev[in_run].min()
        cell = np.minimum(np.rint(angle / cell_rev).astype(np.int64), points - 1)
        line = np.bincount(cell, residual[in_run], minlength=points)
        power += np.abs(np.fft.rfft(line)) ** 2
    places = np.arange(len(power)) / (points * cell_rev)
    is_told = places <= 0.5 / usual_step
    return places[is_told], power[is_told]


def _wave_at(residual: Array, path_rev: Array, run: _Indices, place: float) -> Array:
    """Return the wave of a place that fits residuals best, with a phase of its own in each run, shape (blocks,)."""
    columns = line_columns(path_rev, run, (place,))
    return np.asarray(columns @ np.linalg.lstsq(columns, residual, rcond=None)[0])


def _pair_at(place: float, cycle: Fraction, longest: float) -> tuple[int, int] | None:
    """Return the wave (k, j) of the torus at a place [periods per input rev]; None if there is none."""
    order = round(place)
    sideband = round((place - order) * float(cycle))
    off = abs(place - order - sideband / float(cycle))
    is_resolved = longest >= _WHOLE * cycle.numerator
    widest = min(_WIDEST_SIDEBAND, _WIDEST_OF_RATIO * float(cycle))
    if not is_resolved or off > _ON_WAVE / longest or abs(sideband) > widest:
        return None
    return (order, sideband) if order else (0, abs(sideband))
