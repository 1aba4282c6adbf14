"""Least-squares fit of a recording at given orders, on the recorded angles, with its uncertainty.

The uncertainty of the coefficients is that of independent residuals, widened by the noise floor of the residuals at
each order. In recordings too short for a noise floor it is widened by the number of correlated neighbours, from the
integrated autocorrelation. The part of the residuals that is correlated from one bin to the next is not reading
noise. It is error outside the given orders, or slow; its size is `unmodelled`.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
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
_FLOOR_APART = 0.75  # distance from fitted orders at which noise is read, as a share of the resolution
_FLOOR_AROUND = 0.5  # orders to either side
_FLOOR_FEWEST = 8  # places, nearest to the order
_FLOOR_WAVES = 32  # number of such places from which the noise that the fit has taken there is estimated
_STUDENT_SHARE = 0.97725  # share of a normal distribution below two standard deviations
_DRIFTED = 0.05  # smallest remaining drift that is reported, as a share of F'_ior
_DRIFT_CLEAR = 4.0  # standard uncertainties of a drift
RESOLVED_GAP = 0.75  # smallest distance at which a line and an order are resolved, as a share of the resolution
EVEN = 0.9  # how even readings are that show an order and its image alike
_MOMENTS = 3  # moments of the places of readings within their cells that are kept
SLOWEST_ORDER = 0.5  # per cam turn: lower ones are of the output, or drift
_NEIGHBOURS = 10.0  # bins: readings closer than that show the correlation of neighbours


@dataclass(frozen=True)
class Wave:
    """A wave of one order or of a group: amplitude cos(per_cam_rev angle + phase), with its standard uncertainty."""

    per_cam_rev: float
    amplitude_arcsec: float
    uncertainty_arcsec: float
    phase_deg: float


@dataclass(frozen=True, eq=False)
class _FitBlock:
    """Coefficients of some unknowns of a fit, shape (unknowns,), and their rows of the root of the design."""

    coefficients: Array
    root: Array


class TraceFit:
    """Least squares of values at the bins of a design [arcsec], shape (bins,).

    orders: per input revolution, rising, shape (orders,).
    lines: those that were found in the residuals, rising.
    coefficients: of the cosines, then of the sines, at the mean torque, shape (2 orders,).
    order_root: their rows of the root of the design, shape (2 orders, columns).
    level: of the error, shape (levels,).
    drift: coefficients of the slow terms, shape (degree,).
    slopes: over columns of the bins by name, each with its standard uncertainty: over speed [arcsec s/turn] and load.
    blocks: of the orders, and of their changes with the torque.
    residual: of the values [arcsec], shape (bins,).
    variance: of the residuals at weight 1 [arcsec^2].
    correlated: number of bins that err together.
    unmodelled: size of the residuals beyond noise of reading [arcsec].
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
        # unbiased: divided by the degrees of freedom
        self.variance = float(self.bins.weight @ self.residual**2) / (len(self.bins) - design.columns)
        self.correlated, self.unmodelled = _residual_memory(design, self.residual, self.variance)
        orders, levels, drift, slopes, *order_changes = _blocks_of(design, solution)
        self.blocks = [orders, *order_changes]
        self.coefficients = orders.coefficients
        self.order_root = orders.root
        self.level = levels.coefficients
        self.drift = drift.coefficients
        # neighbours that err together are fewer independent readings
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
        """Return the same fit with the curve that is a sum of such shares of its blocks."""
        combined_fit = copy(self)
        pairs = list(zip(shares, self.blocks, strict=False))
        combined_fit.coefficients = np.asarray(sum(share * block.coefficients for share, block in pairs))
        combined_fit.order_root = np.asarray(sum(share * block.root for share, block in pairs))
        combined_fit.__dict__.pop("factor", None)  # cached, of the former root
        return combined_fit

    def at_torque(self, torque: float) -> TraceFit:
        """Return the same fit with the curve at a torque between the smallest and the largest [N*m]."""
        away = float(self.bins.away(torque))
        return self.combined(1.0, away, abs(away))

    @cached_property
    def noise(self) -> tuple[Array, Array]:
        """Power of the noise at each order over that of independent residuals; factor of an interval of the order."""
        # noise is read beside the orders if there is room, else taken from the memory of the residuals
        ones = np.ones(len(self.orders))
        power, student = noise_floor(self.design, self.residual, self.variance) or (self.correlated * ones, ones)
        if self.design.slow.ridge:  # large errors of unresolved orders cancel
            # sidebands around one order share their noise
            _, cluster = np.unique(np.rint(self.orders), return_inverse=True)
            power = (np.bincount(cluster, power) / np.bincount(cluster))[cluster]
        return power, student

    @cached_property
    def factor(self) -> Array:
        """Shape (2 orders, columns): its product with unit noise is an error of the coefficients."""
        power, _ = self.noise
        # a root of the covariance: draws and norms need no factorisation
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

    def pair(self, indices: OrderIndices) -> OrderIndices:
        """Return the places of the cosines, then of the sines of some orders among the coefficients."""
        return np.concatenate([indices, indices + len(self.orders)])

    def covariance(self, pair: OrderIndices | slice = slice(None)) -> Array:
        """Return the covariance of coefficients by noise [arcsec^2], of all by default."""
        return np.asarray(self.factor[pair] @ self.factor[pair].T)

    @property
    def error(self) -> Array:
        """The values without levels, drift and slopes, shape (bins,)."""
        return self.curve(self.bins.turns) + self.residual

    def beside(self, curves: Array) -> tuple[Array, Array]:
        """Return further columns of the design without the part that its own columns fit, and their coefficients.

        curves: shape (bins, columns). Columns are left as by a fit of them to the others, so that the coefficients are
        those of a joint fit.
        """
        # Frisch and Waugh: the part of a column that the fit does not explain has the coefficient of a joint
        # fit
        remainder = self.design.fitted(curves)[1]
        weighted = remainder * self.bins.weight[:, None]
        normal = weighted.T @ remainder
        return remainder, np.asarray(np.linalg.lstsq(normal, weighted.T @ self.residual, rcond=None)[0])

    @property
    def amplitude(self) -> Array:
        """Amplitude of each order [arcsec]."""
        cosine, sine = self.coefficients.reshape(2, -1)
        return np.hypot(cosine, sine)

    @property
    def groups(self) -> list[OrderIndices]:
        """Places of the orders in groups: those that the recording does not resolve from a line are together."""
        is_line = self.is_line
        # a line and an order this near trade amplitude with each other
        is_close = np.diff(self.orders) < RESOLVED_GAP / self.bins.span
        is_joined = is_close & (is_line[1:] | is_line[:-1])
        return np.split(np.arange(len(self.orders)), np.flatnonzero(~is_joined) + 1)

    @property
    def unresolved(self) -> NDArray[np.bool_]:
        """Whether an order is in a group with others, shape (orders,)."""
        return np.concatenate([np.full(len(group), len(group) > 1) for group in self.groups])

    @property
    def is_slow(self) -> NDArray[np.bool_]:
        """Whether an order is of the output revolution, not of the input, shape (orders,)."""
        return self.orders < SLOWEST_ORDER

    def mean_square(self, indices: OrderIndices) -> Array:
        """Return twice the mean products of cosines and sines of orders over the recording, shape (2 n, 2 n).

        Over whole revolutions it is the identity.
        """
        # over whole periods cosine and sine have a mean square of one half
        if len(indices) == 1:
            return np.eye(2)
        pair = self.pair(indices)
        return np.asarray(2 * self.design.gram[np.ix_(pair, pair)] / self.bins.weight.sum())

    def wave(self, indices: OrderIndices, square: Array | None = None) -> Wave:
        """Return the wave of a group of orders, with its standard uncertainty.

        The amplitude of several orders is that of a wave of the same mean square, and their order that of the same
        mean square slope.

        indices: of the orders of the group.
        square: mean products as `mean_square` returns them; None for those over the recording.
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
            # of the joint wave: rms of its derivative over its rms is its frequency
            slope = np.concatenate([orders * sines, -orders * cosines])
            order = float(np.sqrt(slope @ square @ slope / max(coefficients @ square @ coefficients, 1e-300)))
        amplitude = float(np.sqrt(coefficients @ square @ coefficients))
        # the amplitude's uncertainty to first order
        gradient = square @ coefficients / max(amplitude, 1e-300)  # of the amplitude over the coefficients
        return Wave(
            per_cam_rev=order,
            amplitude_arcsec=amplitude,
            uncertainty_arcsec=float(np.linalg.norm(gradient @ self.factor[pair]) * self.noise[1][indices].max()),
            phase_deg=float(np.degrees(np.angle((cosines - 1j * sines).sum()))),
        )

    def joint_wave(self, indices: OrderIndices) -> Wave:
        """Return the wave of an order and its sidebands without the part that noise adds to its mean square.

        The mean is over whole output revolutions, or over the recording if it is a part of one.
        """
        pair = self.pair(indices)
        slow = self.design.slow
        # over a part of an output revolution sidebands are not orthogonal
        square = self.mean_square(indices) if slow.by_angle or slow.ridge else np.eye(len(pair))
        wave = self.wave(indices, square)
        # its trace is the mean square that noise adds
        noise = square @ self.covariance(pair)
        spread_by_order = 2 * wave.amplitude_arcsec * wave.uncertainty_arcsec
        spread = float(np.hypot(spread_by_order, np.sqrt(2 * np.trace(noise @ noise))))  # of the mean square
        amplitude = float(np.sqrt(max(0.0, wave.amplitude_arcsec**2 - np.trace(noise))))
        # to first order, but no more than the root of the spread, where the amplitude is as small as the noise
        uncertainty = min(spread / max(2 * amplitude, 1e-300), float(np.sqrt(spread)))
        return replace(wave, amplitude_arcsec=amplitude, uncertainty_arcsec=uncertainty)

    @property
    def clear_of_noise(self) -> bool:
        """Whether the orders together have more power than noise alone would leave in them, but once in thousands."""
        # chi-square of all coefficients, with mean `freedom` and variance twice that
        power = float(self.coefficients @ np.linalg.solve(self.covariance(), self.coefficients))
        freedom = 2 * len(self.orders)
        return power > freedom + _POWER_CLEAR * float(np.sqrt(2 * freedom))

    def curve(self, turns: Array) -> Array:
        """Return the curve [arcsec] at cam angles [turns], without levels and drift."""
        return curve_of(self.coefficients, self.orders, turns)


def fit_orders(
    bins: Bins,
    orders: Array,
    slow: SlowTerms = SlowTerms(),
    lines: ArrayLike = (),
) -> TraceFit:
    """Fit the orders, lines beside them, a level of each sweep, and slow terms to a trace's bins.

    Raises UntrustedError: too few bins, or angles that do not resolve the orders.
    """
    lines = np.sort(lines)
    return TraceFit(TraceDesign(bins, np.sort(np.concatenate([orders, lines])), slow), bins.error, lines)


def _blocks_of(design: TraceDesign, solution: Array) -> list[_FitBlock]:
    """Return the solution of a design in blocks: orders, levels, slow terms, slopes, and changes of the orders."""
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
    """Return the linear drift [arcsec] over a recording, if the residuals of a fit without drift show it, else 0.

    It is fitted together with the orders: sidebands take most of it, but none of them closes with the cycle as a
    drift does not.

    fit: without a drift.
    extent: range of its curve [arcsec]; a drift that is small beside it does not count.
    """
    design = fit.design
    bins = fit.bins
    # from the fit without drift, so nothing is fitted again
    column, (size,) = fit.beside(bins.travel[:, None] / design.reach)
    residual = fit.residual - size * column[:, 0]
    variance = float(bins.weight @ residual**2) / (len(bins) - design.columns)
    correlated, _ = _residual_memory(design, residual, variance)
    uncertainty = float(np.sqrt(variance * max(correlated, 1.0) / (bins.weight @ column**2)[0]))
    # clear of its noise, and large enough to matter
    return float(size) if abs(size) > max(_DRIFT_CLEAR * uncertainty, _DRIFTED * extent) else 0.0


def _residual_memory(
    design: TraceDesign,
    residual: Array,
    variance: float,
) -> tuple[float, float]:
    """Return the number of bins that err together, and the size of the correlated part of the residuals [arcsec].

    residual: [arcsec], shape (bins,); variance: at weight 1 [arcsec^2].
    """
    # a recording without noise, such as a computed one
    if not variance:
        return 1.0, 0.0
    size = len(residual)
    products = _lagged_products(residual)
    removed = _removed_by_fit(design, size, len(products))
    # a fit takes part of the noise away, which lowers all correlations
    rho = products / products[0] * (1 - design.columns / size) + removed  # autocorrelation
    # the sum stops at the first lag within its error: later ones are chance
    insignificant = np.flatnonzero(rho[1:] < 2 / np.sqrt(size))
    last = int(insignificant[0]) if len(insignificant) else len(rho) - 1
    correlated = 1 + 2 * float(rho[1 : last + 1].sum())
    return correlated, _correlated_size(design.bins, residual, variance, float(removed[1]))


def _lagged_products(residual: Array) -> Array:
    """Return the mean products of residuals with later ones, by their lag in bins, shape (lags,).

    The transform is of twice the length, so that the last residuals do not meet the first ones.
    """
    size = len(residual)
    # padded with zeros, so that the end does not meet the beginning
    spectrum = np.fft.rfft(residual, 2 * size)
    return np.asarray(np.fft.irfft(np.abs(spectrum) ** 2)[: min(_LAGS, size // 4)] / size)


def _removed_by_fit(
    design: TraceDesign,
    size: int,
    lags: int,
) -> Array:
    """Return the part of the autocorrelation of white noise that a fit removes, by the lag, shape (lags,).

    The fit removes white noise at its own orders only: what remains is correlated by as much less.
    """
    # each fitted wave takes its own frequency out of white noise
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
    """Return the size of the part of residuals [arcsec] that is correlated from one bin to the next; 0 if unclear.

    removed: part of their correlation that the fit removed.
    """
    # of one sweep, and close: a gap says nothing on neighbours
    are_neighbours = (np.diff(bins.turns) < _NEIGHBOURS / bins.per_turn) & (np.diff(bins.sweep) == 0)
    if are_neighbours.sum() < len(residual) / 5:
        return 0.0
    covariance = float((residual[1:] * residual[:-1])[are_neighbours].mean()) + variance * removed
    # twice the standard error of a mean product of white noise
    is_clear = covariance > 2 * variance / np.sqrt(are_neighbours.sum())
    return float(np.sqrt(covariance)) if is_clear else 0.0


def residual_power(
    bins: Bins,
    residual: Array,
    variance: float,
) -> tuple[Array, Array]:
    """Return orders per input revolution, and the power of residuals there over that of independent ones.

    The orders rise, and are at least twice as dense as the recording resolves, shape (probes,). Readings lie somewhere
    within the places of the transform: exp(i a x) of their distance x from the middle is a series in powers of x.
    Without it even readings in uneven places would have images.

    residual: [arcsec], shape (bins,); variance: of the independent ones at weight 1 [arcsec^2].
    """
    parts = list(
        zip(
            bins.by_sweep(bins.turns * bins.per_turn),
            bins.by_sweep(bins.weight * residual),
            strict=True,
        )
    )
    longest = max(int(np.ptp(np.floor(turns))) for turns, _ in parts) + 1
    # a power of two, with room for no wrap-around
    length = 1 << int(np.ceil(np.log2(2 * longest)))
    frequency = -2j * np.pi * np.arange(length // 2 + 1) / length
    power = np.zeros(length // 2 + 1)
    for turns, values in parts:
        cell = np.floor(turns)
        offset = turns - cell - 0.5  # of a reading from the middle of its place
        places = (cell - cell[0]).astype(np.int64)
        transform = np.zeros(length // 2 + 1, complex)
        # Taylor series of the phase within a place: readings need not lie on the grid
        for moment in range(_MOMENTS):
            line = np.zeros(longest)
            line[places] = values * offset**moment
            transform += frequency**moment / factorial(moment) * np.fft.rfft(line, length)
        power += np.abs(transform) ** 2
    power /= float((bins.weight**2).sum()) * variance
    return np.arange(1, len(power)) * bins.per_turn / length, power[1:]


def even_readings(bins: Bins) -> tuple[float, float, float]:
    """Return the readings in an input revolution if they lie at even angles, one such angle [turns], and the evenness.

    The evenness is 0 to 1, and 1 if all angles are even.
    """
    turns = max(bins.by_sweep(bins.turns), key=len)
    steps = np.diff(turns)
    step, start = np.polyfit(np.append(0.0, np.cumsum(np.rint(steps / np.median(steps)))), turns, 1).tolist()
    return 1 / step, start, float(np.abs(np.exp(2j * np.pi * (bins.turns - start) / step).mean()))


def distance(probes: Array, orders: Array) -> Array:
    """Return how far probes lie from the nearest of some orders, which rise, shape (probes,)."""
    after = np.clip(np.searchsorted(orders, probes), 1, max(len(orders) - 1, 1))
    return np.minimum(np.abs(probes - orders[after - 1]), np.abs(probes - orders[np.minimum(after, len(orders) - 1)]))


def noise_floor(
    design: TraceDesign,
    residual: Array,
    variance: float,
) -> tuple[Array, Array] | None:
    """Return the power of the noise at each order over that of independent residuals, and the Student factor.

    Residuals of a real recording are not white: low orders have more noise than high ones. Their power halfway between
    fitted orders, and on both sides of a group of them, stands for the power of the noise at the orders.
    Both have shape (orders,); the factor is that of an interval of k = 2 where the power is of few places. The result
    is None if the recording is too short.

    residual: [arcsec], shape (bins,); variance: of the residuals at weight 1 [arcsec^2].
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

    If rows are lost, all columns of the design take some of it everywhere.
    """
    bins = design.bins
    waves = order_columns(bins.turns, probes[:: max(1, len(probes) // _FLOOR_WAVES)])
    return float((bins.weight @ design.fitted(waves)[1] ** 2).mean() / (bins.weight @ waves**2).mean())


def _floor_windows(probes: Array, orders: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first probe around each order, and the one after the last, each of shape (orders,).

    A window is _FLOOR_AROUND orders to each side, or the nearest _FLOOR_FEWEST probes if it has fewer.
    """
    first = np.searchsorted(probes, orders - _FLOOR_AROUND)
    last = np.searchsorted(probes, orders + _FLOOR_AROUND)
    has_few = last - first < _FLOOR_FEWEST
    nearest = np.clip(np.searchsorted(probes, orders) - _FLOOR_FEWEST // 2, 0, len(probes) - _FLOOR_FEWEST)
    return np.where(has_few, nearest, first), np.where(has_few, nearest + _FLOOR_FEWEST, last)
