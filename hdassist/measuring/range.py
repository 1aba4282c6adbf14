"""Greatest minus least of a fitted curve over the angles visited, without the part of noise, and its uncertainty.

Noise makes the range of a curve too large: the greatest value is looked for among values that err. The bias is
estimated by a parametric bootstrap: coefficients shrunk towards 0 by their share of noise stand for the true ones, and
get noise by the covariance of the fit; the mean increase of the range of their curves is taken off.
The standard uncertainty is the spread of those ranges, SPREAD_FACTOR because the correction repeats the noise of the
estimate, and a BIAS_SHARE of the correction. Both numbers were found by simulation (tests/measuring/test_measure.py).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot, isfinite, sqrt

import numpy as np

from hdassist.errors import UsageError
from hdassist.files import number_of
from hdassist.measuring.fit import COVERAGE_FACTOR, DESIGN_CHUNK, EVEN, TraceFit, curve_of, even_readings, order_columns
from hdassist.model.geometry import Array
from hdassist.readers.trace import MeasuredTrace

STATED = {  # sources that a single record cannot show
    "encoder": "graduation of the output's encoder, once per output turn; the cam's off its centre, once per cam turn",
    "coupling": "eccentricity of the output coupling: cannot be told from once-per-output error",
    "reseating": "taking the drive off the rig and putting it back",
    "temperature": "temperature of drive and rig: operation.dT, known only so well",
}
WIND_UP = "wind-up"
_POINTS_PER_PERIOD = 16  # points in a period of the highest order
GAP_PERIODS = 0.5  # periods of the highest declared order: between readings as near as that the curve is followed
_BRIDGED_TURNS = 1 / 8  # of the cam: angles between readings further apart were not visited
_BRIDGED_IN_CYCLE = 1 / 2  # the same of whole output turns, whose other turns of the cam show these angles too
_BRIDGED_SPREAD = 2.0  # times the usual spread of the curve by noise: between readings it is as well known
_SPREAD_PLACES = 200  # readings, whose spread is the usual one
_SPREAD_FACTOR = 1.15
BIAS_SHARE = 1 / 3
_TURN_PARTS = 24  # of a turn, in steps of which single turns begin
_SLOPE_ENDS = 1.0  # turns of the cam, at the ends of a travel, whose slope noise hides
_SLOPE_DRAWS = 60  # of the bootstrap, for a slope
_SHRINK = 2.0  # times the power of noise, taken off the power of each order
_HIGHEST_IMAGE = 30.0  # per cam turn: of orders that may be the image of another; ball passes lie below
_CORRELATED = 1e3  # condition of the normal equations: beyond, orders cannot be shrunk one by one


@dataclass(frozen=True)
class UncertaintySource:
    """One source: its name, standard uncertainty [arcsec] (None: nobody has stated it), and where that comes from."""

    name: str
    arcsec: float | None
    origin: str


def parse_stated(texts: Sequence[str]) -> dict[str, float]:
    """Stated standard uncertainties [arcsec] by source, from texts like "encoder=0.5" or "encoder=0.5,coupling=0".

    Raises UsageError: no such text, an unknown source, or one given twice.
    """
    stated: dict[str, float] = {}
    for text in (part for given in texts for part in given.split(",")):
        name, _, number = text.partition("=")
        value = number_of(number)
        if name not in STATED or name in stated or not isfinite(value) or value < 0:
            expected = "each source once" if name in stated else "NAME=ARCSEC"
            hint = f"a standard uncertainty of F'_ior, NAME one of {', '.join(STATED)}"
            raise UsageError(f"invalid --budget {text}: expected {expected}", hint)
        stated[name] = value
    return stated


def resolution_source(trace: MeasuredTrace, scatter: float) -> UncertaintySource:
    """Source of the step of a trace's readings; scatter of single readings [arcsec].

    A step below twice the scatter is dithered, but for counts of the cam at even angles, as noise of the output does
    not move them. In time with the turns the fit follows the rounding, and both extremes of a range may err together:
    hence 2; else by themselves: hence sqrt(2).
    """
    unit = trace.step_arcsec / sqrt(12)
    if trace.step_arcsec / 2 < scatter:
        if trace.in_time and trace.cam_step_arcsec:
            return UncertaintySource("resolution", 2 * trace.cam_step_arcsec / sqrt(12), "cam counts at even angles")
        return UncertaintySource("resolution", 0.0, "no step seen above the noise")
    if trace.in_time:
        return UncertaintySource("resolution", 2 * unit, "step of the readings, at even angles")
    return UncertaintySource("resolution", sqrt(2) * unit, "step of the readings")


def stated_sources(stated: Mapping[str, float]) -> tuple[UncertaintySource, ...]:
    """Sources that a single record cannot show, by their stated standard uncertainties [arcsec]."""
    return tuple(
        UncertaintySource(name, stated.get(name), "stated" if name in stated else f"not stated; {words}")
        for name, words in STATED.items()
    )


def combined(sources: Sequence[UncertaintySource]) -> float:
    """Combined standard uncertainty [arcsec] of the sources that have a value."""
    return sqrt(sum(source.arcsec**2 for source in sources if source.arcsec is not None))


@dataclass(frozen=True)
class Range:
    """Range of a curve [arcsec]: as fitted, its bias by noise, and the standard uncertainty of the range by noise.

    rise: possible increase by lines where their phases to the orders differ, as in another cycle; others: standard
    uncertainty by all sources but noise.
    """

    fitted: float
    bias: float
    spread: float
    rise: float
    others: float

    @property
    def value(self) -> float:
        """The range without the bias."""
        return self.fitted - self.bias

    @property
    def bias_uncertainty(self) -> float:
        """Standard uncertainty of the correction."""
        return BIAS_SHARE * self.bias

    @property
    def uncertainty(self) -> float:
        """Combined standard uncertainty."""
        return hypot(self.spread, self.bias_uncertainty, self.others)

    @property
    def interval(self) -> tuple[float, float]:
        """The range less and plus its expanded uncertainty, and above that the rise."""
        reach = COVERAGE_FACTOR * self.uncertainty
        return max(0.0, self.value - reach), self.value + self.rise + reach


def visited_angles(fit: TraceFit) -> tuple[Array, int]:
    """Places of a fine grid of cam angles whose error a fit tells, rising, and the places in a turn.

    They lie between readings that follow its highest declared order, or at most BRIDGED_TURNS apart (of whole output
    turns BRIDGED_IN_CYCLE) where the fit knows the curve between about as surely as at the readings.
    """
    slow = fit.design.slow
    longest = _BRIDGED_TURNS if slow.by_angle or slow.ridge else _BRIDGED_IN_CYCLE
    bins, wide = fit.bins, GAP_PERIODS / float(fit.orders[~np.isin(fit.orders, fit.lines)][-1])
    per_turn = _POINTS_PER_PERIOD * int(np.ceil(fit.orders[-1]))
    usual = float(np.median(_spread(fit, bins.turns[:: max(1, len(bins) // _SPREAD_PLACES)])))
    visited = []
    for index in range(bins.sweeps):
        turns = bins.turns[bins.sweep == index]
        gaps = np.diff(turns)
        told = gaps <= wide
        bridged = np.flatnonzero(~told & (gaps <= longest))
        if len(bridged):
            told[bridged] = _spread(fit, turns[bridged] + gaps[bridged] / 2) <= _BRIDGED_SPREAD * usual
        grid = np.arange(np.ceil(turns[0] * per_turn), np.floor(turns[-1] * per_turn) + 1)
        after = np.clip(np.searchsorted(turns, grid / per_turn), 1, len(turns) - 1)
        visited.append(grid[told[after - 1]])
    return np.unique(np.concatenate(visited)), per_turn


def _spread(fit: TraceFit, turns: Array) -> Array:
    """Standard deviation [arcsec] of a fitted curve by noise at angles [turns], shape (angles,)."""
    parts = range(0, len(turns), DESIGN_CHUNK)
    columns = (order_columns(turns[k : k + DESIGN_CHUNK], fit.orders) @ fit.factor for k in parts)
    return np.concatenate([np.linalg.norm(each, axis=1) for each in columns])


def image_change(fit: TraceFit, turns: Array) -> float:
    """Greatest change of a range [arcsec] if orders are images of higher ones; angles [turns], shape (angles,).

    N even readings a turn show order N - n as order n. Each declared order with its beats, and all together, are taken
    for their images up to HIGHEST_IMAGE.
    """
    rate, start, evenness = even_readings(fit.bins)
    image = rate - fit.orders
    hidden = (image > fit.orders) & (image <= _HIGHEST_IMAGE)
    if evenness < EVEN or not hidden.any():
        return 0.0
    turns = np.concatenate([turns, turns + 1 / (2 * _POINTS_PER_PERIOD * fit.orders[-1])])  # images are finer
    each = np.unique(np.rint(fit.orders[hidden]))
    taken = np.column_stack([hidden, *(hidden & (np.rint(fit.orders) == order) for order in each)])
    turned = (fit.coefficients.reshape(2, -1).T @ [1, -1j] * np.exp(2j * np.pi * rate * start)).conj()[:, None] * taken
    curves = curve_of(np.concatenate([turned.real, -turned.imag]), image, turns)
    kept = np.tile(~taken, (2, 1)) * fit.coefficients[:, None]
    ranges = np.ptp(curves + curve_of(kept, fit.orders, turns), axis=0)
    return float(np.abs(ranges - np.ptp(fit.curve(turns))).max())


def ranges_of(
    fit: TraceFit, turns: Array, rng: np.random.Generator, others: Sequence[float], *, whole: bool, draws: int = 200
) -> tuple[Range, Range, Range, Range]:
    """Range of a fitted curve over angles [turns], shape (angles,), rising, within one cam turn, and of its cam orders.

    And its greatest slope [arcsec a cam turn], of a travel without its ends.

    others: standard uncertainty of each of the three by all sources but noise; whole: whether the angles are those of
    the full cycle, in others of which lines may add more.
    """
    noise = fit.factor @ rng.standard_normal((fit.factor.shape[1], draws))
    best = fit.coefficients * np.tile(_kept_shares(fit), 2)
    line = np.isin(fit.orders, fit.lines) | fit.unresolved
    own = np.where(np.tile(line, 2), 0.0, fit.coefficients)
    curves = np.concatenate([np.stack([fit.coefficients, own, best], axis=1), best[:, None] + noise], axis=1)
    slow = np.tile(fit.is_slow, 2)
    cosines, sines = curves[:, [0, 0, *range(2, 3 + _SLOPE_DRAWS)]].reshape(2, len(fit.orders), -1)
    slopes = (2 * np.pi * np.tile(fit.orders, 2))[:, None] * np.concatenate([sines, -cosines])
    steepest = np.zeros(slopes.shape[1])
    inner = np.minimum(turns - turns[0], turns[-1] - turns) >= _SLOPE_ENDS * bool(fit.design.slow.ridge)
    lines = 2 * sum(fit.wave(own)[1] for own in fit.groups if line[own[0]]) if whole else 0.0
    part = np.floor(turns * _TURN_PARTS + 1e-6).astype(np.int64)
    part -= part[0]
    shape = int(part[-1]) + 1, curves.shape[1]
    high, low, cam_high, cam_low = (np.full(size, end) for size in (shape, shape[1]) for end in (-np.inf, np.inf))
    for start in range(0, len(turns), DESIGN_CHUNK):
        rows = slice(start, start + DESIGN_CHUNK)
        columns = order_columns(turns[rows], fit.orders)
        values = columns @ curves
        steepness = np.abs((columns if inner[rows].all() else columns[inner[rows]]) @ slopes)
        steepest = np.maximum(steepest, steepness.max(axis=0, initial=0.0))
        places, first = np.unique(part[rows], return_index=True)
        high[places] = np.maximum(high[places], np.maximum.reduceat(values, first))
        low[places] = np.minimum(low[places], np.minimum.reduceat(values, first))
        values -= columns[:, slow] @ curves[slow]
        cam_high, cam_low = np.maximum(cam_high, values.max(axis=0)), np.minimum(cam_low, values.min(axis=0))

    def extents(parts: slice) -> Array:
        return np.asarray(high[parts].max(axis=0) - low[parts].min(axis=0))

    turn = np.max([extents(slice(k, k + _TURN_PARTS)) for k in range(len(high))], axis=0)
    return (
        _range(extents(slice(None)), lines, others[0]),
        _range(turn, lines, others[1]),
        _range(cam_high - cam_low, 0.0, others[2]),
        _range(steepest, 0.0, 0.0),
    )


def _kept_shares(fit: TraceFit) -> Array:
    """Share of each order that is no noise, shape (orders,); in a travel that of an order with its beats."""
    noise = (fit.factor**2).sum(axis=1).reshape(2, -1).sum(axis=0)  # of each order, arcsec^2
    power = fit.amplitude**2
    if fit.design.slow.ridge:
        turns = fit.bins.turns[:: max(1, len(fit.bins) // _SPREAD_PLACES)]
        columns, cluster = order_columns(turns, fit.orders), np.rint(fit.orders)
        for order in np.unique(cluster):
            own = np.tile(cluster == order, 2)
            power[cluster == order] = np.mean((columns[:, own] @ fit.coefficients[own]) ** 2)
            noise[cluster == order] = np.mean(((columns[:, own] @ fit.factor[own]) ** 2).sum(axis=1))
    elif fit.design.condition > _CORRELATED:
        return np.ones(len(power))
    return np.asarray(np.maximum(0.0, 1 - _SHRINK * noise / np.maximum(power, 1e-300)))


def _range(extents: Array, lines: float, others: float) -> Range:
    """Range out of those of the fitted curve, of it without lines, of the shrunk one, and of the drawn ones.

    lines: range that they add where their extremes meet those of the curve [arcsec]; others: see Range.
    """
    (fitted, own, without), drawn = extents[:3].tolist(), extents[3:]
    bias, spread = max(0.0, float(drawn.mean()) - without), _SPREAD_FACTOR * float(drawn.std(ddof=1))
    return Range(fitted, bias, spread, max(0.0, own + lines - fitted) if lines else 0.0, others)
