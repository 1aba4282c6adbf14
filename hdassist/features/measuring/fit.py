"""Least-squares fit of orders to a recording at its recorded angles, with its uncertainty.

The uncertainty of the coefficients is that for independent residuals, increased by the noise floor of the residuals at
each order. In recordings too short for a noise floor, it is increased according to the number of correlated neighbours,
from the integrated autocorrelation. The part of the residuals that is correlated between neighbouring bins is not
reading noise. It is an error outside the given orders or a slow error, and `unmodelled` is its size.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from hdassist.drive.model.geometry import Array
from hdassist.features.measuring.terms import Bins, SlowTerms, TraceDesign, curve_of, order_columns

COVERAGE_FACTOR = 2.0
OrderIndices = NDArray[np.int64]
_LAGS = 2000  # maximum number of lags of the autocorrelation
_POWER_CLEAR = 4.0  # standard deviations by which power must exceed that of noise
_FLOOR_SHORTEST = 2.0  # input revolutions of a recording below which the orders leave no room for a noise floor
_FLOOR_APART = 0.75  # smallest distance from fitted orders at which noise is measured, as a share of the resolution
_FLOOR_AROUND = 0.5  # distance on each side of an order over which the noise is averaged, in orders
_FLOOR_FEWEST = 8  # minimum number of frequencies over which the noise at an order is averaged
_FLOOR_WAVES = 32  # maximum number of frequencies at which the noise absorbed by the fit is estimated
_STUDENT_SHARE = 0.97725  # share of a normal distribution below two standard deviations
_DRIFTED = 0.05  # smallest remaining drift that is reported, as a share of F'_ior
_DRIFT_CLEAR = 4.0  # standard uncertainties by which a drift must exceed 0
RESOLVED_GAP = 0.75  # smallest distance at which a line and an order are resolved, as a share of the resolution
EVEN = 0.9  # evenness of the readings above which they do not distinguish an order from its image
_SHARED_READINGS = 10  # weight of the noise of all readings in the noise of a level, as a number of readings
_MOMENTS = 3  # powers of the position of a reading within its cell
SLOWEST_ORDER = 0.5  # order per input revolution below which orders are those of the output, or drift
_NEIGHBOURS = 10.0  # largest distance of neighbours whose correlation is evaluated, in bins


@dataclass(frozen=True)
class Wave:
    """The wave of an order or group of orders: amplitude cos(per_cam_rev angle + phase), with standard uncertainty."""

    per_cam_rev: float
    amplitude_arcsec: float
    uncertainty_arcsec: float
    phase_deg: float


@dataclass(frozen=True, eq=False)
class _FitBlock:
    """The coefficients of a block of unknowns, shape (unknowns,), and the rows of the design's root for the block."""

    coefficients: Array
    root: Array


class TraceFit:
    """Least-squares fit of values at the bins of a design [arcsec], shape (bins,).

    orders: orders per input revolution, in increasing order, shape (orders,).
    lines: orders of the lines found in the residuals, in increasing order.
    coefficients: coefficients of the cosines, then of the sines, at the mean torque, shape (2 orders,).
    order_root: rows of the design's root for the coefficients, shape (2 orders, columns).
    level: levels of the error, shape (levels,).
    drift: coefficients of the slow terms, shape (degree,).
    slopes: slope over each column of the bins, by name, with its standard uncertainty: over speed [arcsec s/revolution]
    and load.
    blocks: blocks of the orders, and of their changes with the torque.
    residual: residuals of the values [arcsec], shape (bins,).
    variance: variance of the residuals at weight 1 [arcsec^2].
    correlated: number of bins whose errors are correlated.
    unmodelled: size of the residuals beyond reading noise [arcsec].
    """

    def __init__(
        self,
        design: TraceDesign,
        values: Array,
        lines: Array,
    ) -> None:
        self.design = design
        self.bins = design.bins
        self.lines = lines
        self.orders = design.orders
        # weighted least squares by the factored normal equations
        solution, self.residual = design.fitted(values)
        # division by the degrees of freedom makes the variance unbiased
        self.variance = float(self.bins.weight @ self.residual**2) / (len(self.bins) - design.columns)
        self.correlated, self.unmodelled = _residual_memory(design, self.residual, self.variance)
        orders, levels, drift, slopes, *order_changes = _blocks_of(design, solution)
        self.blocks = [orders, *order_changes]
        self.coefficients = orders.coefficients
        self.order_root = orders.root
        self.level = levels.coefficients
        self.drift = drift.coefficients
        # correlated neighbours count as fewer independent readings
        uncertainty = np.linalg.norm(slopes.root, axis=1) * np.sqrt(self.variance * max(self.correlated, 1.0))
        slope_pairs = zip(
            slopes.coefficients.tolist(),
            uncertainty.tolist(),
            strict=True,
        )
        self.slopes = dict(
            zip(
                design.slow.over,
                slope_pairs,
                strict=True,
            )
        )

    def combined(self, *shares: float) -> TraceFit:
        """Return a copy of the fit whose curve is the weighted sum of its blocks.

        shares: weight of each block.
        """
        combined_fit = copy(self)
        pairs = list(zip(shares, self.blocks, strict=False))
        combined_fit.coefficients = np.asarray(sum(share * block.coefficients for share, block in pairs))
        combined_fit.order_root = np.asarray(sum(share * block.root for share, block in pairs))
        combined_fit.__dict__.pop("factor", None)  # cached for the previous root
        return combined_fit

    def at_torque(self, torque: float) -> TraceFit:
        """Return a copy of the fit with the curve at a torque between the smallest and the largest [N*m]."""
        away = float(self.bins.away(torque))
        return self.combined(1.0, away, abs(away))

    @cached_property
    def noise(self) -> tuple[Array, Array]:
        """The noise power at each order relative to independent residuals, and the factor for a confidence interval."""
        # the noise floor is estimated next to the orders if there is room; otherwise from the autocorrelation of the
        # residuals
        ones = np.ones(len(self.orders))
        power, student = noise_floor(self.design, self.residual, self.variance) or (self.correlated * ones, ones)
        if self.design.slow.ridge:  # with a ridge, large errors of unresolved orders cancel
            # the sidebands of one order get the same noise
            _, cluster = np.unique(np.rint(self.orders), return_inverse=True)
            power = (np.bincount(cluster, power) / np.bincount(cluster))[cluster]
        return power, student

    @cached_property
    def factor(self) -> Array:
        """The root of the coefficients' covariance, whose product with unit noise is an error; (2 orders, columns)."""
        power, _ = self.noise
        # with a root of the covariance, draws and norms need no factorisation
        return self.order_root * np.sqrt(self.variance * np.tile(power, 2))[:, None]

    @property
    def level_covariance(self) -> Array:
        """The covariance of the levels due to noise [arcsec^2], shape (levels, levels).

        Each level has the noise of its own readings, because a sweep at another speed may have more or less noise.
        """
        rows = self.design.root[2 * len(self.orders) :][: len(self.level)]
        rows = rows * np.sqrt(self._level_variance)[:, None]
        return np.asarray(rows @ rows.T * max(self.correlated, 1.0))

    @property
    def _level_variance(self) -> Array:
        """The variance of the residuals of each level at weight 1 [arcsec^2], shape (levels,).

        The variance of all residuals is included with the weight of `_SHARED_READINGS` readings, so that the few
        readings of a short level do not determine its noise alone.
        """
        level = self.bins.level
        squares = np.bincount(level, self.bins.weight * self.residual**2, len(self.level))
        readings = np.bincount(level, minlength=len(self.level))
        fitted_share = self.design.columns / len(self.bins)  # share of the variance that the fit absorbs
        return np.asarray(
            (squares + _SHARED_READINGS * self.variance) / (readings * (1 - fitted_share) + _SHARED_READINGS)
        )

    @property
    def is_line(self) -> NDArray[np.bool_]:
        """Whether each order is that of a line, shape (orders,)."""
        return np.isin(self.orders, self.lines)

    def pair(self, indices: OrderIndices) -> OrderIndices:
        """Return the indices of the cosines, then of the sines, of orders among the coefficients."""
        return np.concatenate([indices, indices + len(self.orders)])

    def covariance(self, pair: OrderIndices | slice = slice(None)) -> Array:
        """Return the covariance of coefficients due to noise [arcsec^2].

        pair: indices of the coefficients, all by default.
        """
        return np.asarray(self.factor[pair] @ self.factor[pair].T)

    @property
    def error(self) -> Array:
        """The values without levels, drift and slopes, shape (bins,)."""
        return self.curve(self.bins.turns) + self.residual

    def beside(self, curves: Array) -> tuple[Array, Array]:
        """Return the part of further columns that the design does not fit, and the coefficients of these columns.

        The coefficients are those of a joint fit of the design and the columns.

        curves: values of the columns, shape (bins, columns).
        """
        # Frisch and Waugh: the part of a column that the fit does not explain has the coefficient of a joint fit
        remainder = self.design.fitted(curves)[1]
        weighted = remainder * self.bins.weight[:, None]
        normal = weighted.T @ remainder
        return remainder, np.asarray(np.linalg.lstsq(normal, weighted.T @ self.residual, rcond=None)[0])

    @property
    def amplitude(self) -> Array:
        """The amplitude of each order [arcsec], shape (orders,)."""
        cosine, sine = self.coefficients.reshape(2, -1)
        return np.hypot(cosine, sine)

    @property
    def groups(self) -> list[OrderIndices]:
        """The indices of the orders in groups. Orders that are not resolved from a line belong to its group."""
        is_line = self.is_line
        # a line and an order this close together exchange amplitude
        is_close = np.diff(self.orders) < RESOLVED_GAP / self.bins.span
        is_joined = is_close & (is_line[1:] | is_line[:-1])
        return np.split(np.arange(len(self.orders)), np.flatnonzero(~is_joined) + 1)

    @property
    def unresolved(self) -> NDArray[np.bool_]:
        """Whether each order shares its group with others, shape (orders,)."""
        return np.concatenate([np.full(len(group), len(group) > 1) for group in self.groups])

    @property
    def is_slow(self) -> NDArray[np.bool_]:
        """Whether each order is an order of the output rather than of the input, shape (orders,)."""
        return self.orders < SLOWEST_ORDER

    def mean_square(self, indices: OrderIndices) -> Array:
        """Return twice the mean products of the cosines and sines of orders over the recording, shape (2 n, 2 n).

        Over whole revolutions this is the identity matrix.
        """
        # over whole periods, cosine and sine have a mean square of one half
        if len(indices) == 1:
            return np.eye(2)
        pair = self.pair(indices)
        return np.asarray(2 * self.design.gram[np.ix_(pair, pair)] / self.bins.weight.sum())

    def wave(self, indices: OrderIndices, square: Array | None = None) -> Wave:
        """Return the wave of a group of orders, with its standard uncertainty.

        The amplitude of several orders is that of a wave with the same mean square. Its order is that of a wave with
        the same mean square slope.

        indices: indices of the orders in the group.
        square: mean products as returned by `mean_square`, None for those over the recording.
        """
        orders = self.orders[indices]
        pair = self.pair(indices)
        coefficients = self.coefficients[pair]
        if square is None:
            square = self.mean_square(indices)
        cosines = coefficients[: len(indices)]
        sines = coefficients[len(indices) :]
        order = float(orders[0])
        if len(indices) > 1:
            # frequency of the joint wave: rms of its derivative divided by its rms
            slope = np.concatenate([orders * sines, -orders * cosines])
            order = float(np.sqrt(slope @ square @ slope / max(coefficients @ square @ coefficients, 1e-300)))
        amplitude = float(np.sqrt(coefficients @ square @ coefficients))
        # derivative of the amplitude with respect to the coefficients, for its uncertainty to first order
        gradient = square @ coefficients / max(amplitude, 1e-300)
        return Wave(
            per_cam_rev=order,
            amplitude_arcsec=amplitude,
            uncertainty_arcsec=float(np.linalg.norm(gradient @ self.factor[pair]) * self.noise[1][indices].max()),
            phase_deg=float(np.degrees(np.angle((cosines - 1j * sines).sum()))),
        )

    def joint_wave(self, indices: OrderIndices) -> Wave:
        """Return the wave of an order and its sidebands without the noise contribution to its mean square.

        The mean is taken over whole output revolutions, or over the recording if it covers only a part of one.
        """
        pair = self.pair(indices)
        slow = self.design.slow
        # over a part of an output revolution, sidebands are not orthogonal
        square = self.mean_square(indices) if slow.by_angle or slow.ridge else np.eye(len(pair))
        wave = self.wave(indices, square)
        # the trace of this product is the mean square that noise adds
        noise = square @ self.covariance(pair)
        spread_by_order = 2 * wave.amplitude_arcsec * wave.uncertainty_arcsec
        # standard deviation of the mean square
        spread = float(np.hypot(spread_by_order, np.sqrt(2 * np.trace(noise @ noise))))
        amplitude = float(np.sqrt(max(0.0, wave.amplitude_arcsec**2 - np.trace(noise))))
        # the uncertainty is that to first order, but at most the root of the standard deviation, which applies if the
        # amplitude is as small as the noise
        uncertainty = min(spread / max(2 * amplitude, 1e-300), float(np.sqrt(spread)))
        return replace(wave, amplitude_arcsec=amplitude, uncertainty_arcsec=uncertainty)

    @property
    def clear_of_noise(self) -> bool:
        """Whether all orders together have more power than noise has, except in one of thousands of recordings."""
        # for noise only, this power is a chi-square with mean `freedom` and variance 2 `freedom`
        power = float(self.coefficients @ np.linalg.solve(self.covariance(), self.coefficients))
        freedom = 2 * len(self.orders)
        return power > freedom + _POWER_CLEAR * float(np.sqrt(2 * freedom))

    def curve(self, turns: Array) -> Array:
        """Return the curve [arcsec] at input angles [revolutions], without levels and drift."""
        return curve_of(self.coefficients, self.orders, turns)


def fit_orders(
    bins: Bins,
    orders: Array,
    slow: SlowTerms = SlowTerms(),
    lines: ArrayLike = (),
    base: TraceDesign | None = None,
) -> TraceFit:
    """Fit the orders, the lines, a level of each sweep and slow terms to the bins of a recording.

    bins: averages of the recording.
    orders: orders per input revolution.
    slow: slow terms.
    lines: orders of further lines.
    base: design of the orders without lines, which reduces the time of a fit with lines to a fraction.
    Raises UntrustedError if there are too few bins, or the angles do not resolve the orders.
    """
    lines = np.sort(lines)
    design = TraceDesign(bins, np.sort(np.concatenate([orders, lines])), slow, base=base)
    return TraceFit(design, bins.error, lines)


def _blocks_of(design: TraceDesign, solution: Array) -> list[_FitBlock]:
    """Return the solution in blocks: orders, levels, slow terms, slopes, and changes of the orders with torque."""
    coefficients = 2 * len(design.orders)
    slow = design.slow
    sizes = [coefficients, design.bins.levels, slow.degree, len(slow.over)]
    sizes += [coefficients for _ in range(slow.order_changes)]
    ends = np.cumsum(sizes)[:-1]
    parts = zip(
        np.split(solution, ends),
        np.split(design.root, ends),
        strict=True,
    )
    return [_FitBlock(coefficients=part, root=root) for part, root in parts]


def drift_of(fit: TraceFit, extent: float) -> float:
    """Return the linear drift over a recording [arcsec] if the residuals of a fit without drift show it, or 0.

    The drift is fitted together with the orders. Sidebands absorb most of it, but they repeat in each cycle,
    and a drift does not.

    fit: fit without a drift.
    extent: range of its curve [arcsec]; a drift that is small in comparison is ignored.
    """
    design = fit.design
    bins = fit.bins
    # the drift follows from the fit without drift, so no new fit is needed
    column, (size,) = fit.beside(bins.travel[:, None] / design.reach)
    residual = fit.residual - size * column[:, 0]
    variance = float(bins.weight @ residual**2) / (len(bins) - design.columns)
    correlated, _ = _residual_memory(design, residual, variance)
    uncertainty = float(np.sqrt(variance * max(correlated, 1.0) / (bins.weight @ column**2)[0]))
    # the drift must exceed its noise and be large enough to matter
    return float(size) if abs(size) > max(_DRIFT_CLEAR * uncertainty, _DRIFTED * extent) else 0.0


def _residual_memory(
    design: TraceDesign,
    residual: Array,
    variance: float,
) -> tuple[float, float]:
    """Return the number of bins with correlated errors, and the size of the correlated part of the residuals [arcsec].

    residual: residuals [arcsec], shape (bins,).
    variance: variance of the residuals at weight 1 [arcsec^2].
    """
    # the recording has no noise, for example a computed one
    if not variance:
        return 1.0, 0.0
    size = len(residual)
    products = _lagged_products(residual)
    removed = _removed_by_fit(design, size, len(products))
    # a fit absorbs a part of the noise, which lowers all correlations
    rho = products / products[0] * (1 - design.columns / size) + removed  # autocorrelation
    # the sum stops at the first lag that is not significant
    insignificant = np.flatnonzero(rho[1:] < 2 / np.sqrt(size))
    last = int(insignificant[0]) if len(insignificant) else len(rho) - 1
    correlated = 1 + 2 * float(rho[1 : last + 1].sum())
    return correlated, _correlated_size(design.bins, residual, variance, float(removed[1]))


def _lagged_products(residual: Array) -> Array:
    """Return the mean products of residuals with later residuals, by lag in bins, shape (lags,)."""
    size = len(residual)
    # residuals are padded with zeros to twice their length, because the last must not be multiplied with the first
    spectrum = np.fft.rfft(residual, 2 * size)
    return np.asarray(np.fft.irfft(np.abs(spectrum) ** 2)[: min(_LAGS, size // 4)] / size)


def _removed_by_fit(
    design: TraceDesign,
    size: int,
    lags: int,
) -> Array:
    """Return the reduction of the autocorrelation of white noise by a fit, by lag, shape (lags,).

    The fit removes white noise only at its own orders, which lowers the correlation of the remainder.

    size: number of bins.
    lags: number of lags.
    """
    # each fitted wave removes its own frequency from white noise
    waves = 2 * len(design.orders) * (1 + design.slow.order_changes)
    step = float(np.median(np.abs(np.diff(design.bins.turns))))
    angles = 2 * np.pi * step * np.arange(lags)
    by_waves = waves * np.cos(angles[:, None] * design.orders).mean(axis=1)
    return np.asarray((by_waves + design.columns - waves) / size)


def _correlated_size(
    bins: Bins,
    residual: Array,
    variance: float,
    removed: float,
) -> float:
    """Return the size of the part of the residuals that is correlated between neighbouring bins [arcsec].

    It is 0 if it is not significant.


    removed: amount by which the fit reduced the correlation of neighbours.
    """
    # neighbours are in the same sweep and close together; bins on opposite sides of a gap are not neighbours
    are_neighbours = (np.diff(bins.turns) < _NEIGHBOURS / bins.per_turn) & (np.diff(bins.sweep) == 0)
    if are_neighbours.sum() < len(residual) / 5:
        return 0.0
    covariance = float((residual[1:] * residual[:-1])[are_neighbours].mean()) + variance * removed
    # twice the standard error of the mean product of white noise
    is_clear = covariance > 2 * variance / np.sqrt(are_neighbours.sum())
    return float(np.sqrt(covariance)) if is_clear else 0.0


def residual_power(
    bins: Bins,
    residual: Array,
    variance: float,
) -> tuple[Array, Array]:
    """Return orders per input revolution, and the power of the residuals there relative to independent residuals.

    The orders increase and are at least twice as dense as the resolution of the recording, shape (probes,). Readings
    lie anywhere within the cells of the transform, so exp(i a x) is expanded in powers of their distance x from the
    cell's centre. Without the expansion, even unevenly spaced readings would produce images.

    residual: residuals [arcsec], shape (bins,).
    variance: variance of independent residuals at weight 1 [arcsec^2].
    """
    parts = list(
        zip(
            bins.by_sweep(bins.turns * bins.per_turn),
            bins.by_sweep(bins.weight * residual),
            strict=True,
        )
    )
    longest = max(int(np.ptp(np.floor(turns))) for turns, _ in parts) + 1
    # a power of two that is long enough to prevent wrap-around
    length = 1 << int(np.ceil(np.log2(2 * longest)))
    frequency = -2j * np.pi * np.arange(length // 2 + 1) / length
    power = np.zeros(length // 2 + 1)
    for turns, values in parts:
        cell = np.floor(turns)
        offset = turns - cell - 0.5  # distance of a reading from the centre of its cell
        places = (cell - cell[0]).astype(np.int64)
        transform = np.zeros(length // 2 + 1, complex)
        # Taylor series of the phase within a cell, because the readings need not lie on the grid
        for moment in range(_MOMENTS):
            line = np.zeros(longest)
            line[places] = values * offset**moment
            transform += frequency**moment / factorial(moment) * np.fft.rfft(line, length)
        power += np.abs(transform) ** 2
    power /= float((bins.weight**2).sum()) * variance
    return np.arange(1, len(power)) * bins.per_turn / length, power[1:]


def even_readings(bins: Bins) -> tuple[float, float, float]:
    """Return the number of readings per input revolution, the angle of the first [revolutions], and the evenness.

    The evenness is between 0 and 1, and 1 if all angles are evenly spaced.
    """
    turns = max(bins.by_sweep(bins.turns), key=len)
    steps = np.diff(turns)
    step, start = np.polyfit(np.append(0.0, np.cumsum(np.rint(steps / np.median(steps)))), turns, 1).tolist()
    return 1 / step, start, float(np.abs(np.exp(2j * np.pi * (bins.turns - start) / step).mean()))


def distance(probes: Array, orders: Array) -> Array:
    """Return the distance of probes from the nearest of the orders, shape (probes,).

    orders: orders in increasing order.
    """
    after = np.clip(np.searchsorted(orders, probes), 1, max(len(orders) - 1, 1))
    return np.minimum(np.abs(probes - orders[after - 1]), np.abs(probes - orders[np.minimum(after, len(orders) - 1)]))


def noise_floor(
    design: TraceDesign,
    residual: Array,
    variance: float,
) -> tuple[Array, Array] | None:
    """Return the noise power at each order relative to independent residuals, and the Student factor.

    Both have shape (orders,). Residuals of a real recording are not white, as low orders have more noise than high
    ones.
    The noise power at an order is estimated by the power of the residuals halfway between fitted orders, and on both
    sides of a group of orders. The Student factor widens the interval of k = 2 if the power is the mean of few
    frequencies. The result is None if the recording is too short.

    residual: residuals [arcsec], shape (bins,).
    variance: variance of the residuals at weight 1 [arcsec^2].
    """
    bins = design.bins
    if bins.span < _FLOOR_SHORTEST or not variance:
        return None
    probes, power = residual_power(bins, residual, variance)
    places_per_probe = probes[0] * bins.span
    is_free = probes >= design.slow.periods / bins.span
    is_free &= distance(probes, design.orders) >= _FLOOR_APART / bins.span
    is_free &= probes <= design.orders[-1] + 1
    probes = probes[is_free]
    power = power[is_free]
    if len(probes) < _FLOOR_FEWEST:
        return None
    power /= _share_left(design, probes)
    first, last = _floor_windows(probes, design.orders)
    total = np.concatenate([[0.0], np.cumsum(power)])
    freedom = np.maximum(1.0, 2 * places_per_probe * (last - first))
    student = stdtrit(freedom, _STUDENT_SHARE) / COVERAGE_FACTOR
    return (total[last] - total[first]) / (last - first), student


def _share_left(design: TraceDesign, probes: Array) -> float:
    """Return the share of the noise between the orders that a fit leaves in the residuals.

    The share is below 1 if rows are missing, because all columns then absorb some noise at every frequency.

    probes: orders between the fitted ones, shape (probes,).
    """
    bins = design.bins
    waves = order_columns(bins.turns, probes[:: max(1, len(probes) // _FLOOR_WAVES)])
    return float((bins.weight @ design.fitted(waves)[1] ** 2).mean() / (bins.weight @ waves**2).mean())


def _floor_windows(probes: Array, orders: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the index of the first probe around each order and the index after the last, each of shape (orders,).

    A window extends _FLOOR_AROUND orders to each side. If that includes fewer than _FLOOR_FEWEST probes, the window
    consists of the nearest _FLOOR_FEWEST probes.
    """
    first = np.searchsorted(probes, orders - _FLOOR_AROUND)
    last = np.searchsorted(probes, orders + _FLOOR_AROUND)
    has_few = last - first < _FLOOR_FEWEST
    nearest = np.clip(np.searchsorted(probes, orders) - _FLOOR_FEWEST // 2, 0, len(probes) - _FLOOR_FEWEST)
    return np.where(has_few, nearest, first), np.where(has_few, nearest + _FLOOR_FEWEST, last)
