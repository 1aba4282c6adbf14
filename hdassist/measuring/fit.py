"""Least-squares fit of a recording at given orders, on the recorded angles, with its uncertainty.

The uncertainty of the coefficients is that of independent residuals, widened by the noise floor of the residuals at
each order. In recordings too short for a noise floor it is widened by the number of correlated neighbours, from the
integrated autocorrelation. The part of the residuals that is correlated from one bin to the next is not reading
noise. It is error outside the given orders, or slow; its size is `unmodelled`.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property
from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from hdassist.measuring.terms import Bins, SlowTerms, TraceDesign, curve_of, order_columns
from hdassist.model.geometry import Array

COVERAGE_FACTOR = 2.0
OrderIndices = NDArray[np.int64]
_LAGS = 2000
_POWER_CLEAR = 4.0  # standard deviations of the power of noise
_FLOOR_SHORTEST = 2.0  # cam turns: below, there is no room for noise between the orders
_FLOOR_APART = 0.75  # of the resolution: how far from fitted orders the noise is read
_FLOOR_AROUND = 0.5  # orders to either side
_FLOOR_FEWEST = 8  # places, nearest to the order
_FLOOR_WAVES = 32  # of such places, by which the share of the noise is known that a fit has taken there
_STUDENT_SHARE = 0.97725  # of a normal distribution, below two standard deviations
_DRIFTED = 0.05  # of F'_ior: least drift left in that is reported
_DRIFT_CLEAR = 4.0  # standard uncertainties of a drift
RESOLVED_GAP = 0.75  # of the resolution: least distance at which a line and an order are resolved
EVEN = 0.9  # how even readings are that show an order and its image alike
_MOMENTS = 3  # of where readings lie in their places
SLOWEST_ORDER = 0.5  # per cam turn: lower ones are of the output, or drift
_NEIGHBOURS = 10.0  # bins: readings closer than that show the correlation of neighbours


class TraceFit:
    """Least squares of values at the bins of a design [arcsec], shape (bins,).

    orders: per cam turn, rising; lines: those that were found in the residuals, rising; coefficients: of the cosines,
    then of the sines, at the mean torque, shape (2 orders,); level: shape (levels,); drift: coefficients, shape
    (degree,); slopes: over columns of the bins by name, each with its standard uncertainty: over speed [arcsec s/turn],
    over the load; blocks: coefficients and rows of the design's root, of orders and of their changes with the torque;
    residual: shape (bins,); variance: of it, at weight 1; correlated: bins that err together; unmodelled: size of the
    residuals beyond noise of reading.
    """

    def __init__(self, design: TraceDesign, values: Array, lines: Array) -> None:
        bins = self.bins = design.bins
        self.design, self.lines, self.orders = design, lines, design.orders
        solution, self.residual = design.fitted(values)
        self.variance = float(bins.weight @ self.residual**2) / (len(bins) - design.columns)
        self.correlated, self.unmodelled = _residual_memory(design, self.residual, self.variance)
        waves = 2 * len(design.orders)
        sizes = waves, bins.levels, design.slow.degree, len(design.slow.over), *[waves] * design.slow.order_changes
        ends = np.cumsum(sizes)[:-1]
        parts = list(zip(np.split(solution, ends), np.split(design.root, ends), strict=True))
        self.blocks = [parts[0], *parts[4:]]
        (self.level, _), (self.drift, _), (slopes, root) = parts[1:4]
        self.coefficients, self.order_root = parts[0]
        unsure = np.linalg.norm(root, axis=1) * np.sqrt(self.variance * max(self.correlated, 1.0))
        pairs = zip(slopes.tolist(), unsure.tolist(), strict=True)
        self.slopes = dict(zip(design.slow.over, pairs, strict=True))

    def combined(self, *shares: float) -> TraceFit:
        """The same with the curve that is such shares of its blocks together."""
        found = copy(self)
        pairs = list(zip(shares, self.blocks, strict=False))
        found.coefficients = np.asarray(sum(share * coefficients for share, (coefficients, _) in pairs))
        found.order_root = np.asarray(sum(share * root for share, (_, root) in pairs))
        found.__dict__.pop("factor", None)
        return found

    def at_torque(self, torque: float) -> TraceFit:
        """The same with the curve at a torque between the least and the greatest [N*m]."""
        away = float(self.bins.away(torque))
        return self.combined(1.0, away, abs(away))

    @cached_property
    def noise(self) -> tuple[Array, Array]:
        """Power of the noise at each order over that of independent residuals; factor of an interval of the order."""
        ones = np.ones(len(self.orders))
        power, student = noise_floor(self.design, self.residual, self.variance) or (self.correlated * ones, ones)
        if self.design.slow.ridge:  # large errors of unresolved orders cancel
            _, cluster = np.unique(np.rint(self.orders), return_inverse=True)
            power = (np.bincount(cluster, power) / np.bincount(cluster))[cluster]
        return power, student

    @cached_property
    def factor(self) -> Array:
        """Shape (2 orders, columns): its product with unit noise is an error of the coefficients."""
        power, _ = self.noise
        return self.order_root * np.sqrt(self.variance * np.tile(power, 2))[:, None]

    @property
    def level_covariance(self) -> Array:
        """Covariance of the levels by noise [arcsec^2], shape (levels, levels)."""
        rows = self.design.root[2 * len(self.orders) :][: len(self.level)]
        return np.asarray(rows @ rows.T * self.variance * max(self.correlated, 1.0))

    @property
    def is_line(self) -> NDArray[np.bool_]:
        """Whether an order is a line, shape (orders,)."""
        return np.isin(self.orders, self.lines)

    def pair(self, own: OrderIndices) -> OrderIndices:
        """Places of the cosines, then of the sines of some orders among the coefficients."""
        return np.concatenate([own, own + len(self.orders)])

    def covariance(self, pair: OrderIndices | slice = slice(None)) -> Array:
        """Covariance of coefficients by noise [arcsec^2], of all by default."""
        return np.asarray(self.factor[pair] @ self.factor[pair].T)

    @property
    def error(self) -> Array:
        """The values without levels, drift and slopes, shape (bins,)."""
        return self.curve(self.bins.turns) + self.residual

    def beside(self, curves: Array) -> tuple[Array, Array]:
        """Further columns of the design, shape (bins, columns), less what others of it fit, and their coefficients."""
        own = self.design.fitted(curves)[1]
        weighted = own * self.bins.weight[:, None]
        return own, np.asarray(np.linalg.lstsq(weighted.T @ own, weighted.T @ self.residual, rcond=None)[0])

    @property
    def amplitude(self) -> Array:
        """Amplitude of each order [arcsec]."""
        cosine, sine = self.coefficients.reshape(2, -1)
        return np.hypot(cosine, sine)

    @property
    def groups(self) -> list[OrderIndices]:
        """Places of the orders in groups: those that the record does not resolve from a line are together."""
        line = self.is_line
        near = np.diff(self.orders) < RESOLVED_GAP / self.bins.span
        ends = np.flatnonzero(~(near & (line[1:] | line[:-1]))) + 1
        return np.split(np.arange(len(self.orders)), ends)

    @property
    def unresolved(self) -> NDArray[np.bool_]:
        """Whether an order stands in a group with others, shape (orders,)."""
        return np.concatenate([np.full(len(own), len(own) > 1) for own in self.groups])

    @property
    def is_slow(self) -> NDArray[np.bool_]:
        """Whether an order is of the output's turns, not of the cam's, shape (orders,)."""
        return self.orders < SLOWEST_ORDER

    def mean_square(self, own: OrderIndices) -> Array:
        """Twice the mean products of cosines and sines of some orders over the record: of even turns, the identity."""
        pair = self.pair(own)
        return 2 * self.design.gram[np.ix_(pair, pair)] / self.bins.weight.sum() if len(own) > 1 else np.eye(2)

    def wave(self, own: OrderIndices, square: Array | None = None) -> tuple[float, float, float, float]:
        """Order, amplitude, its standard uncertainty [arcsec] and phase [deg] of the wave of the orders of a group.

        Of several: the amplitude of a wave of the same mean square, by default over the record, and its mean order.
        """
        orders, pair = self.orders[own], self.pair(own)
        coefficients, square = self.coefficients[pair], self.mean_square(own) if square is None else square
        a, b = coefficients[: len(own)], coefficients[len(own) :]
        order = float(orders[0])
        if len(own) > 1:
            slope = np.concatenate([orders * b, -orders * a])
            order = float(np.sqrt(slope @ square @ slope / max(coefficients @ square @ coefficients, 1e-300)))
        amplitude = float(np.sqrt(coefficients @ square @ coefficients))
        along = square @ coefficients / max(amplitude, 1e-300) @ self.factor[pair]
        return (
            order,
            amplitude,
            float(np.linalg.norm(along) * self.noise[1][own].max()),
            float(np.degrees(np.angle((a - 1j * b).sum()))),
        )

    def joint_wave(self, own: OrderIndices) -> tuple[float, float, float, float]:
        """The wave of an order and its beats without the part that noise adds to its mean square.

        The mean is over whole turns of the output, or over the record where it is part of one.
        """
        pair = self.pair(own)
        slow = self.design.slow
        square = self.mean_square(own) if slow.by_angle or slow.ridge else np.eye(len(pair))
        order, amplitude, uncertainty, phase = self.wave(own, square)
        noise = square @ self.covariance(pair)
        spread = float(np.hypot(2 * amplitude * uncertainty, np.sqrt(2 * np.trace(noise @ noise))))
        left = float(np.sqrt(max(0.0, amplitude**2 - np.trace(noise))))
        return order, left, min(spread / max(2 * left, 1e-300), float(np.sqrt(spread))), phase

    @property
    def clear_of_noise(self) -> bool:
        """Whether the orders together have more power than noise alone would leave in them, but once in thousands."""
        power = float(self.coefficients @ np.linalg.solve(self.covariance(), self.coefficients))
        freedom = 2 * len(self.orders)
        return power > freedom + _POWER_CLEAR * float(np.sqrt(2 * freedom))

    def curve(self, turns: Array) -> Array:
        """The curve [arcsec] at cam angles [turns], without levels and drift."""
        return curve_of(self.coefficients, self.orders, turns)


def fit_orders(bins: Bins, orders: Array, slow: SlowTerms = SlowTerms(), lines: ArrayLike = ()) -> TraceFit:
    """Fit the orders, lines beside them, a level of each sweep, and slow terms to a trace's bins.

    Raises UntrustedError: too few bins, or angles that do not resolve the orders.
    """
    lines = np.sort(lines)
    return TraceFit(TraceDesign(bins, np.sort(np.concatenate([orders, lines])), slow), bins.error, lines)


def drift_of(fit: TraceFit, extent: float) -> float:
    """Linear drift [arcsec] over a record that residuals of a fit without drift show clearly beside a range, else 0.

    It is fitted together with the orders: those of the beats take most of it, but none of them closes with the cycle as
    a drift does not.
    """
    design, bins = fit.design, fit.bins
    own, (size,) = fit.beside(bins.travel[:, None] / design.reach)
    left = fit.residual - size * own[:, 0]
    variance = float(bins.weight @ left**2) / (len(bins) - design.columns)
    correlated, _ = _residual_memory(design, left, variance)
    uncertainty = float(np.sqrt(variance * max(correlated, 1.0) / (bins.weight @ own**2)[0]))
    return float(size) if abs(size) > max(_DRIFT_CLEAR * uncertainty, _DRIFTED * extent) else 0.0


def _residual_memory(design: TraceDesign, residual: Array, variance: float) -> tuple[float, float]:
    """Number of bins that err together, and size of the correlated part of the residuals [arcsec]."""
    size, columns, bins = len(residual), design.columns, design.bins
    if not variance:
        return 1.0, 0.0
    padded = np.fft.rfft(residual, 2 * size)
    products = np.fft.irfft(np.abs(padded) ** 2)[: min(_LAGS, size // 4)] / size
    # the fit takes white noise away at its own orders alone: what is left of it is alike as much less from step to step
    waves = 2 * len(design.orders) * (1 + design.slow.order_changes)
    turned = 2 * np.pi * float(np.median(np.abs(np.diff(bins.turns)))) * np.arange(len(products))
    taken = (waves * np.cos(turned[:, None] * design.orders).mean(axis=1) + columns - waves) / size
    rho = products / products[0] * (1 - columns / size) + taken
    below = np.flatnonzero(rho[1:] < 2 / np.sqrt(size))
    last = int(below[0]) if len(below) else len(rho) - 1
    correlated = 1 + 2 * float(rho[1 : last + 1].sum())
    near = (np.diff(bins.turns) < _NEIGHBOURS / bins.per_turn) & (np.diff(bins.sweep) == 0)
    if near.sum() < size / 5:
        return correlated, 0.0
    following = float((residual[1:] * residual[:-1])[near].mean()) + variance * float(taken[1])
    clear = following > 2 * variance / np.sqrt(near.sum())
    return correlated, float(np.sqrt(following)) if clear else 0.0


def residual_power(bins: Bins, residual: Array, variance: float) -> tuple[Array, Array]:
    """Power of residuals, shape (bins,) [arcsec], over that of independent ones of the same variance at weight 1.

    Returns orders per cam turn, rising, at least twice as dense as the record resolves, and the power there.
    """
    parts = list(zip(bins.by_sweep(bins.turns * bins.per_turn), bins.by_sweep(bins.weight * residual), strict=True))
    longest = max(int(np.ptp(np.floor(turns))) for turns, _ in parts) + 1
    length = 1 << int(np.ceil(np.log2(2 * longest)))
    turned = -2j * np.pi * np.arange(length // 2 + 1) / length
    power = np.zeros(length // 2 + 1)
    for turns, values in parts:
        at = np.floor(turns)
        off = turns - at - 0.5  # of a reading from the middle of its place
        places, transform = (at - at[0]).astype(np.int64), np.zeros(length // 2 + 1, complex)
        for k in range(_MOMENTS):  # exp(turned off) as a series: without it, even readings in uneven places have images
            line = np.zeros(longest)
            line[places] = values * off**k
            transform += turned**k / factorial(k) * np.fft.rfft(line, length)
        power += np.abs(transform) ** 2
    power /= float((bins.weight**2).sum()) * variance
    return np.arange(1, len(power)) * bins.per_turn / length, power[1:]


def even_readings(bins: Bins) -> tuple[float, float, float]:
    """Readings a cam turn if they lie at even angles, one of these angles [turns], and how even all are, 0 to 1."""
    turns = max(bins.by_sweep(bins.turns), key=len)
    steps = np.diff(turns)
    step, start = np.polyfit(np.append(0.0, np.cumsum(np.rint(steps / np.median(steps)))), turns, 1).tolist()
    return 1 / step, start, float(np.abs(np.exp(2j * np.pi * (bins.turns - start) / step).mean()))


def distance(probes: Array, orders: Array) -> Array:
    """How far probes lie from the nearest of some orders, which rise, shape (probes,)."""
    after = np.clip(np.searchsorted(orders, probes), 1, max(len(orders) - 1, 1))
    return np.minimum(np.abs(probes - orders[after - 1]), np.abs(probes - orders[np.minimum(after, len(orders) - 1)]))


def noise_floor(design: TraceDesign, residual: Array, variance: float) -> tuple[Array, Array] | None:
    """Power of the noise at each order, over that of independent residuals of the same variance, shape (orders,).

    And the Student factor of an interval of k = 2 where that power is of few places.

    Residuals of a real trace are not white: slow ones weigh on low orders more than on high ones. Their power halfway
    between fitted orders, and on both sides of a group of them, stands for the power of the noise at the orders.
    The fit has taken a share of the noise there too: where rows are lost, all of its columns take some everywhere.
    Arguments: residual, shape (bins,) [arcsec]; variance, of the residuals at weight 1. None: the record is too short.
    """
    bins, orders = design.bins, design.orders
    if bins.span < _FLOOR_SHORTEST or not variance:
        return None
    probes, power = residual_power(bins, residual, variance)
    resolved = probes[0] * bins.span  # places for each probe
    free = probes >= design.slow.periods / bins.span
    free &= (distance(probes, orders) >= _FLOOR_APART / bins.span) & (probes <= orders[-1] + 1)
    probes, power = probes[free], power[free]
    if len(probes) < _FLOOR_FEWEST:
        return None
    waves = order_columns(bins.turns, probes[:: max(1, len(probes) // _FLOOR_WAVES)])
    power /= (bins.weight @ design.fitted(waves)[1] ** 2).mean() / (bins.weight @ waves**2).mean()
    total = np.concatenate([[0.0], np.cumsum(power)])
    first, last = np.searchsorted(probes, orders - _FLOOR_AROUND), np.searchsorted(probes, orders + _FLOOR_AROUND)
    few = last - first < _FLOOR_FEWEST
    middle = np.clip(np.searchsorted(probes, orders) - _FLOOR_FEWEST // 2, 0, len(probes) - _FLOOR_FEWEST)
    first, last = np.where(few, middle, first), np.where(few, middle + _FLOOR_FEWEST, last)
    student = stdtrit(np.maximum(1.0, 2 * resolved * (last - first)), _STUDENT_SHARE) / COVERAGE_FACTOR
    return (total[last] - total[first]) / (last - first), student
