"""Averages of a trace over small steps of the angle, so that the effort does not grow with the number of rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.model.geometry import Array
from hdassist.readers.trace import MeasuredTrace

PER_PERIOD = 40  # bins in a period of the highest order: its amplitude falls by 0.1 %
HEAVIEST = 4.0  # times the median weight: a shaft that stands still does not outweigh the rest


@dataclass(frozen=True, eq=False)
class Bins:
    """Averages, shape (bins,), by sweep and along the angle.

    turns: cam angle; error: arcsec; rows: in each; weight: with a mean of 1; sweep: index from 0; level: index of the
    level of the error, from 0: a sweep has one, and one more behind each of its steps; travel: of the cam
    since the first row, turns; speed: of the cam, turns/s, 0 without time stamps; load: that of the trace, 0
    without; per_turn: bins in a turn of the cam.
    """

    turns: Array
    error: Array
    rows: Array
    weight: Array
    sweep: NDArray[np.int64]
    level: NDArray[np.int64]
    travel: Array
    speed: Array
    load: Array
    per_turn: float

    def __len__(self) -> int:
        return len(self.turns)

    @property
    def sweeps(self) -> int:
        """Number of sweeps."""
        return int(self.sweep[-1]) + 1

    @property
    def levels(self) -> int:
        """Number of levels."""
        return int(self.level.max()) + 1

    @property
    def span(self) -> float:
        """Turns of the cam from least to greatest angle of the longest sweep."""
        return max(float(np.ptp(self.turns[self.sweep == k])) for k in range(self.sweeps))


def travel_of(trace: MeasuredTrace) -> Array:
    """Travel of the cam since the first row, in either direction, shape (rows,) [turns]."""
    return np.concatenate([[0.0], np.cumsum(np.abs(np.diff(trace.cam_deg)))]) / 360


def bins_of(trace: MeasuredTrace, highest: float) -> Bins:
    """Average rows of the sweeps of a trace over bins of 1/(PER_PERIOD highest) of a turn; highest order per turn."""
    travel, per_turn = travel_of(trace), PER_PERIOD * highest
    load = np.zeros(len(travel)) if trace.load is None else trace.load
    parts: list[tuple[Array, ...]] = []
    levels = 0
    for number, sweep in enumerate(trace.sweeps):
        rows = slice(sweep.start, sweep.stop)
        turns = trace.cam_deg[rows] / 360
        speed = np.zeros(len(turns)) if trace.time_s is None else np.gradient(turns, trace.time_s[rows])
        behind = np.searchsorted(trace.breaks, trace.line[rows], side="right")  # steps of the level before a row
        _, behind = np.unique(behind, return_inverse=True)
        _, place = np.unique(np.floor(turns * per_turn) + behind / len(turns), return_inverse=True)
        count = np.bincount(place).astype(float)
        values = turns, trace.error_arcsec[rows], travel[rows], speed, load[rows]
        means = [np.bincount(place, each) / count for each in (*values, behind)]
        level = np.rint(means.pop()) + levels
        levels = int(level.max()) + 1
        parts.append((*means, count, level, np.full(len(count), number)))
    columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    turns, error, path, speed, loads, count, level, index = columns
    weight = np.minimum(count, HEAVIEST * np.median(count))
    counts = index.astype(np.int64), level.astype(np.int64)
    return Bins(turns, error, count, weight / weight.mean(), *counts, path, speed, loads, per_turn)
