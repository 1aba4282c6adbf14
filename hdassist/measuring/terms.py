"""What a trace is fitted by: averages over small steps of its angle, waves of its orders, and terms that are slow.

error = level of the sweep + slow terms + lag * speed + compliance * load + sum of a cos(2 pi f x) + b sin(2 pi f x).
Where the orders change with the torque, a and b are a_0 + a_1 t + a_2 |t|, t 0 at the mean torque and 1 or -1 at the
farthest: straight lines to either side of the mean.
The trace is averaged over small steps of the angle first, so that the effort does not grow with its rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from hdassist.errors import Fault, UntrustedError
from hdassist.model.geometry import Array
from hdassist.readers.trace import MeasuredTrace

_PER_PERIOD = 40  # bins in a period of the highest order: its amplitude falls by 0.1 %
_HEAVIEST = 4.0  # times the median weight: a shaft that stands still does not outweigh the rest
DESIGN_CHUNK = 8192  # rows of the design that stand in memory at once
_WORST_CONDITION = 1e8  # of the normal equations
_JOINED_CELLS = 24  # in a turn of the cam, by which sweeps are joined on the output revolution
_MOST_JOINED = 4  # sweeps: levels of more of them take too much of the slow terms
BINS_PER_COLUMN = 1.5


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

    @cached_property
    def torques(self) -> tuple[float, float, float]:
        """Least, mean and greatest load, without the noise of its readings: 5 and 95 % lie below."""
        low, high = np.quantile(self.load, (0.05, 0.95)).tolist()
        return low, float(np.average(self.load, weights=self.rows)), high

    def away(self, load: Array | float) -> Array | float:
        """How far loads are from the mean, 1 or -1 at the farther of the least and the greatest."""
        low, mean, high = self.torques
        return (load - mean) / max(mean - low, high - mean, 1e-300)

    @property
    def span(self) -> float:
        """Turns of the cam from least to greatest angle of the longest sweep."""
        return max(float(np.ptp(turns)) for turns in self.by_sweep(self.turns))

    def span_on_output(self, ratio: float) -> float:
        """Return the turns of the cam that the sweeps cover on the output revolution, by their positions there.

        These are the turns of the longest sweep. A few sweeps that cover more together count as one, in any order:
        each has its own level, so they need not follow each other.

        ratio: turns of the cam in an output revolution.
        """
        if self.span >= ratio or not 1 < self.sweeps <= _MOST_JOINED:
            return self.span
        cells = round(ratio * _JOINED_CELLS)
        is_covered = np.zeros(cells, dtype=bool)
        for turns in self.by_sweep(self.turns):
            first = np.ceil(turns.min() * _JOINED_CELLS)
            last = np.floor(turns.max() * _JOINED_CELLS)
            is_covered[np.arange(first, last).astype(np.int64) % cells] = True
        return max(self.span, float(np.count_nonzero(is_covered)) / cells * ratio)

    def by_sweep(self, values: Array) -> list[Array]:
        """Values of all bins, shape (bins,), parted into those of each sweep."""
        return np.split(values, np.flatnonzero(np.diff(self.sweep)) + 1)


def travel_of(trace: MeasuredTrace) -> Array:
    """Travel of the cam since the first row, in either direction, shape (rows,) [turns]."""
    return np.concatenate([[0.0], np.cumsum(np.abs(np.diff(trace.cam_deg)))]) / 360


def bins_of(trace: MeasuredTrace, highest: float) -> Bins:
    """Average rows of the sweeps of a trace over bins of 1/(PER_PERIOD highest) of a turn; highest order per turn."""
    travel = travel_of(trace)
    per_turn = _PER_PERIOD * highest
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
    weight = np.minimum(count, _HEAVIEST * np.median(count))
    counts = index.astype(np.int64), level.astype(np.int64)
    return Bins(turns, error, count, weight / weight.mean(), *counts, path, speed, loads, per_turn)


def order_columns(turns: Array, orders: Array) -> Array:
    """Cosines, then sines, of the orders at angles [turns], shape (angles, 2 orders)."""
    whole, part = np.divmod(orders, 1)  # the wave of n + k/ratio is the product of two of few waves
    part = part.round(12)
    waves = {order: np.exp(2j * np.pi * order * turns) for order in {*whole.tolist(), *part.tolist()}}
    columns = np.empty((2, len(orders), len(turns)))
    for row, (n, off) in enumerate(zip(whole.tolist(), part.tolist(), strict=True)):
        wave = waves[n] * waves[off]
        columns[0, row] = wave.real
        columns[1, row] = wave.imag
    return columns.reshape(2 * len(orders), len(turns)).T


def curve_of(coefficients: Array, orders: Array, turns: Array) -> Array:
    """Curves [arcsec] of coefficients, shape (2 orders, ...), at cam angles [turns], shape (angles, ...)."""
    parts = range(0, len(turns), DESIGN_CHUNK)
    return np.concatenate([order_columns(turns[k : k + DESIGN_CHUNK], orders) @ coefficients for k in parts])


@dataclass(frozen=True)
class SlowTerms:
    """Terms besides the orders: a drift, powers of the travel up to a degree, and slopes over columns of the bins.

    by_angle: whether Legendre polynomials of the input angle are used instead, for slow terms in a part of an output
    revolution.
    over: names of the columns: speed for a lag between the encoders, load for the wind-up.
    ridge: added to the normal equations of unit diagonal, so that orders that the recording does not resolve stay
    small, although their sum does not.
    order_changes: change of the orders with the torque: 0 none, 1 along a straight line, 2 with a bend at the mean
    torque.
    """

    degree: int = 0
    by_angle: bool = False
    over: tuple[str, ...] = ()
    ridge: float = 0.0
    order_changes: int = 0

    @property
    def periods(self) -> float:
        """Periods in the record of the fastest wave that they take off: no noise is left below.

        Legendre polynomials resolve a wave where there are pi of them for each of its periods.
        """
        return self.degree / np.pi if self.by_angle else 0.0


class TraceDesign:
    """Normal equations of orders, levels of the sweeps and slow terms on the bins of a trace, factored once.

    columns: unknowns, cosines and sines of the orders first, their changes with the torque last; reach: travel [turns]
    at the end of the drift; gram: normal equations, shape (columns, columns); root: times its transpose the inverse of
    these, same shape; condition: of these.
    Raises UntrustedError: too few bins, or angles that do not resolve the orders.
    """

    def __init__(self, bins: Bins, orders: Array, slow: SlowTerms = SlowTerms()) -> None:
        self.bins = bins
        self.orders = orders
        self.slow = slow
        self.reach = max(float(bins.travel.max()), 1e-12)
        self.columns = columns = 2 * len(orders) * (1 + slow.order_changes) + bins.levels + slow.degree + len(slow.over)
        if len(bins) < BINS_PER_COLUMN * columns:
            message = f"{len(bins)} steps of the angle are too few for {columns} unknowns"
            raise UntrustedError(
                message, "record more densely, or declare fewer orders: --orders 1,2,4", Fault.ORDERS_UNTOLD
            )
        self._parts = [slice(k, min(k + DESIGN_CHUNK, len(bins))) for k in range(0, len(bins), DESIGN_CHUNK)]
        gram = np.zeros((columns, columns))
        for rows in self._parts:
            matrix = self._rows(rows.start) * np.sqrt(bins.weight[rows, None])
            gram += matrix.T @ matrix  # of one array with itself: half the work
        self.gram = gram
        scale = 1 / np.sqrt(np.diag(gram))
        values, vectors = np.linalg.eigh(gram * scale * scale[:, None])
        values += slow.ridge
        self.condition = float(values[-1] / values[0]) if values[0] > 0 else float("inf")
        if self.condition > _WORST_CONDITION:
            hint = "record at least one input revolution at even steps, or declare fewer orders: --orders 1,2,4"
            raise UntrustedError("the recorded angles do not resolve the declared orders", hint, Fault.ORDERS_UNTOLD)
        # the symmetric root: vectors of values that are nearly alike are a matter of rounding, and draws with them
        self.root: Array = scale[:, None] * ((vectors / np.sqrt(values)) @ vectors.T)

    @lru_cache(maxsize=4)  # noqa: B019 - of four parts in all: most records have fewer, of which fits ask several times
    def _rows(self, start: int) -> Array:
        """Rows of the design from a bin on, shape (DESIGN_CHUNK at most, columns)."""
        bins = self.bins
        rows = slice(start, start + DESIGN_CHUNK)
        levels = np.eye(bins.levels)[bins.level[rows]]
        slow = self._slow(bins.turns[rows], bins.travel[rows])
        over = [getattr(bins, name)[rows, None] for name in self.slow.over]
        away = bins.away(bins.load[rows, None])
        waves = order_columns(bins.turns[rows], self.orders)
        changes = (waves * share for share in (away, np.abs(away))[: self.slow.order_changes])
        return np.concatenate([waves, levels, slow, *over, *changes], axis=1)

    def _slow(self, turns: Array, travel: Array) -> Array:
        """Drift, or polynomials of the angle, at angles and travels [turns], shape (angles, degree)."""
        if not self.slow.by_angle:
            return (travel[:, None] / self.reach) ** np.arange(1, self.slow.degree + 1)
        least = self.bins.turns.min()
        greatest = self.bins.turns.max()
        return legvander((2 * turns - least - greatest) / (greatest - least), self.slow.degree)[:, 1:]

    def fitted(self, curves: Array) -> tuple[Array, Array]:
        """Unknowns that fit curves at the bins best, shape (columns, ...), and what they leave, shape (bins, ...)."""
        solution = self.project(lambda rows: curves[rows])
        return solution, curves - np.concatenate([self._rows(rows.start) @ solution for rows in self._parts])

    def project(self, curves: Callable[[slice], Array]) -> Array:
        """Unknowns that fit curves best, shape (columns, ...), from their values at a slice of the bins."""
        moments = [(self._rows(rows.start) * self.bins.weight[rows, None]).T @ curves(rows) for rows in self._parts]
        return self.root @ (self.root.T @ sum(moments))

    def drift_at(self, drift: Array, turns: Array, travel: Array) -> Array:
        """A drift [arcsec] at cam angles and after so much travel [turns]."""
        return self._slow(turns, travel) @ drift
