"""The model fitted to a recording: averages over small steps of the angle, waves at its orders, and slow terms.

error = level of the sweep + slow terms + lag * speed + compliance * load + sum of a cos(2 pi f x) + b sin(2 pi f x). If
the orders change with the torque, a and b are a_0 + a_1 t + a_2 |t|, where t is 0 at the mean torque and 1 or -1 at the
torque farthest from it. The coefficients are therefore linear on either side of the mean. The recording is first
averaged over small steps of the angle, because the effort would otherwise grow with its rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from hdassist.drive.model.geometry import Array
from hdassist.readers.trace import MeasuredTrace
from hdassist.run.errors import Fault, UntrustedError

_PER_PERIOD = 40  # bins per period of the highest order, whose amplitude averaging reduces by 0.1 %
# multiple of the median weight that limits all weights, so that a stationary shaft does not dominate the fit
_HEAVIEST = 4.0
DESIGN_CHUNK = 8192  # number of rows of the design that are in memory at a time
_WORST_CONDITION = 1e8  # largest condition number of the normal equations
_JOINED_CELLS = 24  # cells per input revolution that are used to join sweeps on the output revolution
_MOST_JOINED = 4  # maximum number of joined sweeps, because more levels would absorb too much of the slow terms
BINS_PER_COLUMN = 1.5  # minimum number of bins per unknown


@dataclass(frozen=True, eq=False)
class Bins:
    """Averages over steps of the angle within each sweep, in arrays of shape (bins,).

    turns: input angle [revolutions].
    error: error [arcsec].
    rows: number of rows in each bin.
    weight: weight, with a mean of 1.
    sweep: index of the sweep, from 0.
    level: index of the level of the error, from 0. A sweep has one level, and a further one after each step of the
    error.
    travel: travel of the input since the first row [revolutions].
    speed: speed of the input [revolutions/s], 0 if there are no time stamps.
    load: load of the recording, that is its torque or wind-up; 0 if it has none.
    per_turn: number of bins per input revolution.
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
        """The 5 % quantile, the mean and the 95 % quantile of the load."""
        # quantiles replace the extremes, which include noise of the readings
        low, high = np.quantile(self.load, (0.05, 0.95)).tolist()
        return low, float(np.average(self.load, weights=self.rows)), high

    def away(self, load: Array | float) -> Array | float:
        """Return loads relative to their mean, scaled to 1 or -1 at the extreme that is farther from the mean."""
        low, mean, high = self.torques
        # 1e-300 avoids 0/0 at a constant torque
        return (load - mean) / max(mean - low, high - mean, 1e-300)

    @property
    def span(self) -> float:
        """The largest range of input angles in one sweep [revolutions]."""
        return max(float(np.ptp(turns)) for turns in self.by_sweep(self.turns))

    def span_on_output(self, ratio: float) -> float:
        """Return the input revolutions that the sweeps cover of one output revolution.

        It is the span of the longest sweep, or the span that the sweeps cover together if this is larger and there are
        at most _MOST_JOINED sweeps. Their sequence does not matter, because each sweep has its own level.

        ratio: input revolutions per output revolution.
        """
        # a single sweep that covers the output revolution needs no joining
        if self.span >= ratio or not 1 < self.sweeps <= _MOST_JOINED:
            return self.span
        # cells of the output revolution
        cells = round(ratio * _JOINED_CELLS)
        is_covered = np.zeros(cells, dtype=bool)
        for turns in self.by_sweep(self.turns):
            # a cell counts only if it is completely covered
            first = np.ceil(turns.min() * _JOINED_CELLS)
            last = np.floor(turns.max() * _JOINED_CELLS)
            is_covered[np.arange(first, last).astype(np.int64) % cells] = True
        return max(self.span, float(np.count_nonzero(is_covered)) / cells * ratio)

    def by_sweep(self, values: Array) -> list[Array]:
        """Return the values of all bins, shape (bins,), split by sweep."""
        return np.split(values, np.flatnonzero(np.diff(self.sweep)) + 1)


def travel_of(trace: MeasuredTrace) -> Array:
    """Return the travel of the input since the first row in either direction [revolutions], shape (rows,)."""
    return np.concatenate([[0.0], np.cumsum(np.abs(np.diff(trace.cam_deg)))]) / 360


@dataclass(frozen=True, eq=False)
class _SweepBins:
    """Averages of the rows of one sweep, with the fields of `Bins`; the levels of each sweep are numbered from 0."""

    turns: Array
    error: Array
    travel: Array
    speed: Array
    load: Array
    rows: Array
    level: NDArray[np.int64]


def bins_of(trace: MeasuredTrace, highest: float) -> Bins:
    """Return averages of the rows of a recording over steps of 1/(_PER_PERIOD highest) of an input revolution.

    trace: recording with its sweeps.
    highest: highest order per input revolution.
    """
    travel = travel_of(trace)
    per_turn = _PER_PERIOD * highest
    sweeps = [_bins_of_sweep(trace, slice(sweep.start, sweep.stop), travel, per_turn) for sweep in trace.sweeps]
    numbers = [np.full(len(sweep.turns), number, dtype=np.int64) for number, sweep in enumerate(sweeps)]
    levels = []
    first_level = 0  # first level of a sweep, because the levels of all sweeps are numbered consecutively
    for sweep in sweeps:
        levels.append(sweep.level + first_level)
        first_level = int(levels[-1].max()) + 1
    rows = np.concatenate([sweep.rows for sweep in sweeps])
    # a bin in which the shaft stood still has many rows with the same error, so its weight is limited
    weight = np.minimum(rows, _HEAVIEST * np.median(rows))
    return Bins(
        turns=np.concatenate([sweep.turns for sweep in sweeps]),
        error=np.concatenate([sweep.error for sweep in sweeps]),
        rows=rows,
        weight=weight / weight.mean(),
        sweep=np.concatenate(numbers),
        level=np.concatenate(levels),
        travel=np.concatenate([sweep.travel for sweep in sweeps]),
        speed=np.concatenate([sweep.speed for sweep in sweeps]),
        load=np.concatenate([sweep.load for sweep in sweeps]),
        per_turn=per_turn,
    )


def _bins_of_sweep(
    trace: MeasuredTrace,
    rows: slice,
    travel: Array,
    per_turn: float,
) -> _SweepBins:
    """Return averages of the rows of a sweep over steps of the input angle, with separate bins for separate levels.

    rows: rows of the sweep.
    travel: travel of the input at all rows [revolutions], shape (rows,).
    per_turn: number of bins per input revolution.
    """
    turns = trace.cam_deg[rows] / 360
    # a level is identified by the number of error steps before it
    steps_before = np.searchsorted(
        trace.breaks,
        trace.line[rows],
        side="right",
    )
    _, level = np.unique(steps_before, return_inverse=True)  # from 0
    # a level change divides a bin: the part of each level gets its own index, in the order of the levels
    _, place = np.unique(np.floor(turns * per_turn) + level / len(turns), return_inverse=True)
    count = np.bincount(place).astype(float)

    def mean_of(values: Array) -> Array:
        """Return the means of values over the rows of each bin, shape (bins,)."""
        return np.asarray(np.bincount(place, values) / count)

    return _SweepBins(
        turns=mean_of(turns),
        error=mean_of(trace.error_arcsec[rows]),
        travel=mean_of(travel[rows]),
        speed=np.zeros(len(count)) if trace.time_s is None else mean_of(np.gradient(turns, trace.time_s[rows])),
        load=np.zeros(len(count)) if trace.load is None else mean_of(trace.load[rows]),
        rows=count,
        level=np.rint(mean_of(level.astype(float))).astype(np.int64),
    )


def order_columns(turns: Array, orders: Array) -> Array:
    """Return the cosines, then the sines, of orders at angles [revolutions], shape (angles, 2 orders).

    The wave of order n + k/ratio is the product of the waves of orders n and k/ratio, of which there are only a few.
    """
    # sidebands of different orders have the same distances from their orders, so few waves generate all columns
    whole_orders = np.rint(orders)
    distances = (orders - whole_orders).round(12)
    whole_waves = _whole_waves(turns, whole_orders)
    beats = {distance: np.exp(2j * np.pi * distance * turns) for distance in np.unique(np.abs(distances)).tolist()}
    columns = np.empty((2, len(orders), len(turns)))
    pairs = zip(
        whole_orders.tolist(),
        distances.tolist(),
        strict=True,
    )
    for row, (whole_order, distance) in enumerate(pairs):
        beat = beats[abs(distance)]
        wave = whole_waves[whole_order] * (beat if distance >= 0 else beat.conj())
        columns[0, row] = wave.real
        columns[1, row] = wave.imag
    return columns.reshape(2 * len(orders), len(turns)).T


def _whole_waves(turns: Array, whole_orders: Array) -> dict[float, NDArray[np.complex128]]:
    """Return the complex wave of each whole order at angles [revolutions], each of shape (angles,)."""
    waves: dict[float, NDArray[np.complex128]] = {}
    first = np.exp(2j * np.pi * turns)
    for order in np.unique(whole_orders).tolist():
        before = waves.get(order - 1)
        # a product takes a tenth of the time of an exponential
        waves[order] = np.exp(2j * np.pi * order * turns) if before is None else before * first
    return waves


def curve_of(
    coefficients: Array,
    orders: Array,
    turns: Array,
) -> Array:
    """Return curves [arcsec] at input angles [revolutions], shape (angles, ...).

    coefficients: coefficients of the cosines, then of the sines, of the orders [arcsec], shape (2 orders, ...).
    """
    # the angles are processed in chunks, because all columns at once would need gigabytes
    chunks = [turns[start : start + DESIGN_CHUNK] for start in range(0, len(turns), DESIGN_CHUNK)]
    return np.concatenate([order_columns(chunk, orders) @ coefficients for chunk in chunks])


@dataclass(frozen=True)
class SlowTerms:
    """Terms other than the orders: a drift and slopes over columns of the bins.

    degree: highest power of the travel in the drift.
    by_angle: whether Legendre polynomials of the input angle replace the powers, for slow terms in a part of an output
    revolution.
    over: names of the columns: speed for a lag between the encoders, load for the wind-up.
    ridge: value added to the diagonal of the normal equations after scaling to a unit diagonal. It keeps orders that
    the recording does not resolve small, but not their sum.
    order_changes: change of the orders with the torque: 0 none, 1 linear, 2 linear with a bend at the mean torque.
    """

    degree: int = 0
    by_angle: bool = False
    over: tuple[str, ...] = ()
    ridge: float = 0.0
    order_changes: int = 0

    @property
    def periods(self) -> float:
        """The periods per recording of the fastest wave that the slow terms absorb, with all noise of slower waves.

        Legendre polynomials resolve a wave if there are at least pi polynomials per period.
        """
        return self.degree / np.pi if self.by_angle else 0.0


class TraceDesign:
    """Normal equations of orders, sweep levels and slow terms on the bins of a recording, factored once.

    bins: averages of the recording.
    orders: orders per input revolution, shape (orders,).
    slow: slow terms.
    columns: number of unknowns. Cosines and sines of the orders come first, their changes with the torque last.
    reach: largest travel of the bins, at which the drift ends [revolutions].
    gram: normal equations, shape (columns, columns).
    root: symmetric root of the inverse of gram: root @ root.T is the inverse, shape (columns, columns).
    condition: condition number of gram scaled to a unit diagonal.
    Raises UntrustedError if there are too few bins, or the angles do not resolve the orders.
    """

    def __init__(
        self, bins: Bins, orders: Array, slow: SlowTerms = SlowTerms(), base: TraceDesign | None = None
    ) -> None:
        """Form the normal equations and factor them.

        bins: averages of the recording.
        orders: orders per input revolution, increasing, shape (orders,).
        slow: terms other than the orders.
        base: design of the same bins with fewer orders. Its rows and products are reused if its slow terms are the same
        and its orders are among the given ones.
        """
        self.bins = bins
        self.orders = orders
        self.slow = slow
        # powers of the travel from 0 to 1 keep the equations well conditioned
        self.reach = max(float(bins.travel.max()), 1e-12)
        self.columns = 2 * len(orders) * (1 + slow.order_changes) + bins.levels + slow.degree + len(slow.over)
        if len(bins) < BINS_PER_COLUMN * self.columns:
            message = f"{len(bins)} steps of the angle are too few for {self.columns} unknowns"
            hint = "record with smaller angle steps, or declare fewer orders: --orders 1,2,4"
            raise UntrustedError(message, hint, Fault.ORDERS_UNTOLD)
        starts = range(0, len(bins), DESIGN_CHUNK)
        self._parts = [slice(start, min(start + DESIGN_CHUNK, len(bins))) for start in starts]
        self._base = base if base is not None and self._contains(base) else self
        self._set_added_columns()
        self.gram = self._normal_equations()
        self._factor()

    def _factor(self) -> None:
        """Set the condition number of the normal equations and the root of their inverse."""
        # after scaling to a unit diagonal, the condition number describes the angles
        scale = 1 / np.sqrt(np.diag(self.gram))
        values, vectors = np.linalg.eigh(self.gram * scale * scale[:, None])
        # the ridge limits unresolved combinations and changes resolved ones by a relative 1e-7
        values += self.slow.ridge
        self.condition = float(values[-1] / values[0]) if values[0] > 0 else float("inf")
        if self.condition > _WORST_CONDITION:
            hint = "record at least one input revolution in even steps, or declare fewer orders: --orders 1,2,4"
            raise UntrustedError("the recorded angles do not resolve the declared orders", hint, Fault.ORDERS_UNTOLD)
        # the symmetric root does not depend on rounding, unlike the eigenvectors of nearly equal eigenvalues
        self.root: Array = scale[:, None] * ((vectors / np.sqrt(values)) @ vectors.T)

    def _contains(self, other: TraceDesign) -> bool:
        """Return whether this design contains all columns of another one with the same slow terms."""
        is_alike = self.slow == other.slow and not self.slow.order_changes
        return is_alike and bool(np.isin(other.orders, self.orders).all())

    def _set_added_columns(self) -> None:
        """Set the indices of the base's columns in this design, and those of the added orders."""
        is_added = np.zeros(len(self.orders), bool)
        if self._base is not self:
            is_added = ~np.isin(self.orders, self._base.orders)
        self._added_orders = self.orders[is_added]
        is_added_column = np.zeros(self.columns, bool)
        is_added_column[: 2 * len(self.orders)] = np.tile(is_added, 2)
        self._added = np.flatnonzero(is_added_column)
        self._kept = np.flatnonzero(~is_added_column)

    def _normal_equations(self) -> Array:
        """Return the weighted products of the columns, shape (columns, columns)."""
        if self._base is not self:
            return self._bordered_equations()
        gram = np.zeros((self.columns, self.columns))
        for rows in self._parts:
            matrix = self._rows(rows.start) * np.sqrt(self.bins.weight[rows, None])
            gram += matrix.T @ matrix  # a product of one array with its own transpose takes half the work
        return gram

    def _bordered_equations(self) -> Array:
        """Return the weighted products of the columns, copied from the base except for added columns."""
        gram = np.empty((self.columns, self.columns))
        gram[np.ix_(self._kept, self._kept)] = self._base.gram
        products = self._moments(lambda rows: order_columns(self.bins.turns[rows], self._added_orders))
        gram[:, self._added] = products
        gram[self._added] = products.T
        return gram

    @lru_cache(maxsize=4)  # noqa: B019 - most recordings have up to four parts, which fits use repeatedly
    def _rows(self, start: int) -> Array:
        """Return up to DESIGN_CHUNK rows of the design, shape (rows, columns).

        start: index of the first bin.
        """
        bins = self.bins
        rows = slice(start, start + DESIGN_CHUNK)
        levels = np.eye(bins.levels)[bins.level[rows]]
        slow = self._slow(bins.turns[rows], bins.travel[rows])
        over = [getattr(bins, name)[rows, None] for name in self.slow.over]
        waves = order_columns(bins.turns[rows], self.orders)
        away = bins.away(bins.load[rows, None])
        changes = [waves * share for share in (away, np.abs(away))[: self.slow.order_changes]]
        return np.concatenate([waves, levels, slow, *over, *changes], axis=1)

    def _slow(self, turns: Array, travel: Array) -> Array:
        """Return the drift or the polynomials of the angle at angles and travels [revolutions].

        The result has the shape (angles, degree).
        """
        # a drift over travel continues while the shaft reverses; a polynomial of the angle repeats
        if not self.slow.by_angle:
            return (travel[:, None] / self.reach) ** np.arange(1, self.slow.degree + 1)
        least = self.bins.turns.min()
        greatest = self.bins.turns.max()
        # polynomials orthogonal on the interval; the levels represent the constant
        return legvander((2 * turns - least - greatest) / (greatest - least), self.slow.degree)[:, 1:]

    def fitted(self, curves: Array) -> tuple[Array, Array]:
        """Return the least-squares unknowns for curves, shape (columns, ...), and the residuals, shape (bins, ...).

        curves: values at the bins, shape (bins, ...).
        """
        solution = self.project(lambda rows: curves[rows])
        return solution, curves - np.concatenate([self._sum(rows, solution) for rows in self._parts])

    def project(self, curves: Callable[[slice], Array]) -> Array:
        """Return the least-squares unknowns for curves, shape (columns, ...).

        curves: function that returns the values at a slice of the bins.
        """
        return self.root @ (self.root.T @ self._moments(curves))

    def _sum(self, rows: slice, unknowns: Array) -> Array:
        """Return the sum of all columns times their unknowns at a part of the bins, shape (rows, ...)."""
        values = self._base._rows(rows.start) @ unknowns[self._kept]
        if len(self._added):
            values += order_columns(self.bins.turns[rows], self._added_orders) @ unknowns[self._added]
        return np.asarray(values)

    def _moments(self, curves: Callable[[slice], Array]) -> Array:
        """Return the weighted products of all columns with curves, shape (columns, ...).

        curves: function that returns the values at a slice of the bins.
        """
        # the products are summed over parts, because the whole design may not fit into memory
        parts = []
        for rows in self._parts:
            values = curves(rows)
            weighted = (self.bins.weight[rows] * values.T).T
            part = np.empty((self.columns, *values.shape[1:]))
            part[self._kept] = self._base._rows(rows.start).T @ weighted
            if len(self._added):
                part[self._added] = order_columns(self.bins.turns[rows], self._added_orders).T @ weighted
            parts.append(part)
        return np.asarray(sum(parts))

    def drift_at(
        self,
        drift: Array,
        turns: Array,
        travel: Array,
    ) -> Array:
        """Return a drift [arcsec] at input angles and travels [revolutions], shape (angles,).

        drift: coefficients of the slow terms, shape (degree,).
        """
        return self._slow(turns, travel) @ drift
