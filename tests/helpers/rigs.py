"""Simulated test rigs with encoders and a known true error."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from hdassist.readers.trace import MeasuredTrace, sweeps

Array = NDArray[np.float64]
Curve = Callable[[Array], Array]


def recorded(turns: Array, error: Array, step: float = 0.0) -> MeasuredTrace:
    """Return a recording as the reader returns it.

    turns: input angles [rev].
    error: errors [arcsec].
    step: resolution of the errors [arcsec].
    """
    cam = np.asarray(turns) * 360
    return MeasuredTrace("rig.csv", "", cam, error, np.arange(len(cam)) + 1, step, tuple(sweeps(cam)), ())


def drive_error(rng: np.random.Generator, ratio: float, beats: int = 3, scale: float = 5.0) -> Curve:
    """Return the error of an invented drive, with orders up to 6 and their sidebands, random in size and phase.

    Order 2 is the largest.

    ratio: input revolutions per output revolution.
    beats: number of sidebands on each side of an order.
    scale: size of order 2 [arcsec].
    """
    orders, sizes = [], []
    for n in range(7):
        for k in range(-beats, beats + 1):
            if n + k / ratio > 0 and rng.random() < 0.6:
                orders.append(n + k / ratio)
                sizes.append(scale * rng.exponential() * (1.0 if n == 2 else 0.3 / (1 + n)))
    phases = rng.uniform(0, 2 * np.pi, len(orders))

    def curve(turns: Array) -> Array:
        total = np.zeros(len(turns))
        for order, size, phase in zip(orders, sizes, phases, strict=True):
            total += size * np.cos(2 * np.pi * order * turns + phase)
        return total

    return curve


def whole_range(curve: Curve, turns: float) -> float:
    """Return the range of a curve over a number of input revolutions, on a fine grid."""
    return float(np.ptp(curve(np.arange(int(turns * 400)) / 400)))


def turn_range(curve: Curve, turns: float) -> float:
    """Return the largest range of a curve within any one input revolution, on a fine grid.

    turns: period of the curve [input revolutions].
    """
    once = curve(np.arange(int(turns * 200)) / 200)
    around = np.concatenate([once, once[:200]])
    return max(float(np.ptp(around[start : start + 200])) for start in range(0, len(once), 4))


def slow_noise(rng: np.random.Generator, count: int, size: float, memory: float) -> Array:
    """Return first-order autoregressive noise; size: standard deviation; memory: correlation of adjacent values."""
    from scipy.signal import lfilter

    return np.asarray(lfilter([size * np.sqrt(1 - memory**2)], [1, -memory], rng.standard_normal(count)))


def text(columns: Sequence[Array], names: str, separator: str = ",", digits: int = 5) -> str:
    """Return the text of a file with a line of column names above the columns."""
    rows = (separator.join(f"{value:.{digits}f}" for value in row) for row in zip(*columns, strict=True))
    return "\n".join([names, *rows]) + "\n"


RATIO, PER_TURN = 30.0, 120


def simulated(seed: int) -> tuple[Array, Array, Curve]:
    """Return the input angles [rev], the errors [arcsec] and the true curve of one of five kinds of rigs."""
    rng = np.random.default_rng(seed)
    curve = drive_error(rng, RATIO, scale=rng.choice([1.5, 5.0]))
    turns = np.arange(RATIO * PER_TURN) / PER_TURN
    rig = seed % 5
    if rig == 1:  # the steps are uneven
        turns = np.sort(turns + rng.uniform(-0.5, 0.5, len(turns)) / PER_TURN)
    if rig == 2:  # a third of the samples is missing
        turns = turns[rng.random(len(turns)) > 1 / 3]
    noise = slow_noise(rng, len(turns), 1.0, 0.8) if rig == 3 else rng.standard_normal(len(turns))
    error = curve(turns) + noise
    if rig == 4:  # the resolution is coarse
        error = np.round(error * 2) / 2
    return turns, error, curve


def even_wave(turns: Array, seed: int = 0) -> Array:
    """Return orders 1 and 2 with noise of 0.3 arcsec; the range without noise is 24.2 arcsec."""
    noise = 0.3 * np.random.default_rng(seed).standard_normal(len(turns))
    return np.asarray(10 * np.cos(4 * np.pi * turns) + 3 * np.cos(2 * np.pi * turns + 1) + noise)


EVEN = np.arange(600) / 200
