"""Components of the residuals that clearly exceed the noise.

A wave that the model lacks stays in the residuals and would count as noise, so that a bad drive could pass. The
residuals r of a run, at the angles u along it, have the power

    P(f) = |sum of r exp(-2 pi i f u)|^2                                                                       (R14)

at f periods per input revolution. If r is noise, P(f) exceeds q times the mean power of its m neighbours with
probability (1 + q/m)^-m. Correlated noise has a smooth spectrum, so the neighbours show its level. A component is
accepted if noise has so large a power in only one of 1000 recordings, over all frequencies f. It is then removed from
the residuals, and the search continues with the remainder.

The frequency of a component determines its kind. If a run over the whole cycle resolves the sidebands, and the
component lies on a sideband of an order, with |j| up to 14 and a quarter of the ratio, it is this wave (k, j) of the
torus. Otherwise it is a line, for example of a ball pass or a motor. A line has a separate phase in each run, because
its phase differs from cycle to cycle.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.model.geometry import Array

_Indices = NDArray[np.int64]
_CHANCE = 1e-3  # probability per recording of a component due to noise
_NEIGHBOURS = 64  # total number of frequencies on both sides of a peak that show the level of the noise
_PEAK_PLACES = 4  # number of frequencies on each side of a peak that belong to it, two per resolved frequency
MOST_COMPONENTS = 8  # maximum number of components
_FEWEST_PERIODS = 3.0  # minimum number of periods in the longest run; slower components are drift or output waves
# largest |j| of a component that is a wave of the torus: as a number, and as a share of the ratio
_WIDEST_SIDEBAND, _WIDEST_OF_RATIO = 14, 0.25
_ON_WAVE = 0.2  # largest distance of a component from a wave of the torus, as a share of the resolution
_WHOLE = 0.97  # share of the cycle in one run from which its sidebands are resolved
# number of cells per usual step to which residuals are assigned, for which a wave loses at most 3 % of its power
_CELLS_PER_STEP = 4
# distance from a removed line, as a share of the resolution, within which a component is a remainder of the line
SAME_PLACE = 0.25
_REMOVAL_STEPS = 5  # number of steps between two frequencies of the spectrum in the search for a peak


@dataclass(frozen=True)
class Components:
    """Components of the residuals.

    pairs: waves (k, j) of the torus.
    lines: periods per input revolution of the other components, shape (lines,).
    """

    pairs: tuple[tuple[int, int], ...] = ()
    lines: tuple[float, ...] = ()

    def joined(self, others: Components) -> Components:
        """Return all of these components and of other components."""
        return Components(pairs=tuple({*self.pairs, *others.pairs}), lines=self.lines + others.lines)


NO_COMPONENTS = Components()


def clear_components(
    residual: Array,
    path_rev: Array,
    run: _Indices,
    cycle: Fraction,
    most: int = MOST_COMPONENTS,
) -> Components:
    """Return the components of the residuals that clearly exceed the noise.

    residual: residual of each block [arcsec], shape (blocks,).
    path_rev: input angle along the run [rev], shape (blocks,).
    run: number of the run of each block, ascending, shape (blocks,).
    cycle: ratio in lowest terms.
    most: largest number of components.
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


def line_columns(
    path_rev: Array,
    run: _Indices,
    lines: tuple[float, ...],
) -> Array:
    """Return the cosine and sine of each line in each run, as columns of shape (readings, 2 runs lines).

    path_rev: input angle along the run [rev], shape (readings,).
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


def _clearest_place(
    residual: Array,
    path_rev: Array,
    run: _Indices,
    longest: float,
) -> float | None:
    """Return the frequency of the component that exceeds the noise most [periods per input rev].

    The result is None if no component clearly exceeds the noise.

    longest: length of the longest run [rev].
    """
    places, power = _spectrum(residual, path_rev, run, longest)
    around = _sum_around(power, _NEIGHBOURS // 2)
    own = _sum_around(power, _PEAK_PLACES)
    neighbours = _NEIGHBOURS - 2 * _PEAK_PLACES
    level = np.maximum(around - own, 1e-300) / neighbours
    resolved = neighbours / 2  # the spectrum has two frequencies for each one that the recording resolves
    log_chance = -resolved * np.log1p(power / level / resolved)
    log_chance[places < _FEWEST_PERIODS / longest] = 0.0
    chosen = int(log_chance.argmin())
    if log_chance[chosen] > np.log(_CHANCE / len(places)):
        return None
    step = places[1] - places[0]
    near = places[chosen] + step * np.linspace(-1, 1, 2 * _REMOVAL_STEPS + 1)
    removed = [float(np.sum(_wave_at(residual, path_rev, run, float(place)) ** 2)) for place in near]
    return float(near[int(np.argmax(removed))])


def _sum_around(power: Array, reach: int) -> Array:
    """Return the sums of a spectrum over the frequencies around each one, with the ends mirrored, same shape as power.

    reach: number of frequencies on each side.
    """
    # scipy.ndimage has this filter, but its import takes as long as 50 draws of the posterior
    return np.convolve(np.pad(power, reach, mode="symmetric"), np.ones(2 * reach + 1), mode="valid")


def _spectrum(
    residual: Array,
    path_rev: Array,
    run: _Indices,
    longest: float,
) -> tuple[Array, Array]:
    """Return frequencies [periods per input rev], two per resolved frequency of the longest run, and the power (R14).

    The power is summed over the runs. Residuals are assigned to even angles that are finer than the usual step, so that
    missing or uneven readings do not shift a component. The highest frequency is half a period per usual step.
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


def _wave_at(
    residual: Array,
    path_rev: Array,
    run: _Indices,
    place: float,
) -> Array:
    """Return the best-fitting wave at a frequency, with an amplitude and phase for each run, shape (blocks,)."""
    columns = line_columns(path_rev, run, (place,))
    return np.asarray(columns @ np.linalg.lstsq(columns, residual, rcond=None)[0])


def _pair_at(
    place: float,
    cycle: Fraction,
    longest: float,
) -> tuple[int, int] | None:
    """Return the wave (k, j) of the torus at a frequency [periods per input rev], or None if there is none."""
    order = round(place)
    sideband = round((place - order) * float(cycle))
    off = abs(place - order - sideband / float(cycle))
    is_resolved = longest >= _WHOLE * cycle.numerator
    widest = min(_WIDEST_SIDEBAND, _WIDEST_OF_RATIO * float(cycle))
    if not is_resolved or off > _ON_WAVE / longest or abs(sideband) > widest:
        return None
    return (order, sideband) if order else (0, abs(sideband))
