"""Full mesh cycle of a measured drive, orders of its recording, and F'_ior of the fitted curve with its uncertainty.

Deviations of the wheel that rotates with the output beat with deviations that are fixed. The error therefore has
orders n + k/ratio around each declared order n. BEATS such orders on either side reproduce a model's error over the
full mesh cycle within about 1 % of its range. A recording of T input revolutions resolves orders 1/T apart; of closer
orders, fewer represent all of them. F'_ior is the maximum minus the minimum of the curve over the covered angles,
corrected for noise.

Noise makes the range of a curve too large, because the maximum is taken over values with errors. The bias is
estimated by a parametric bootstrap. Coefficients shrunk towards 0 by their share of noise represent the true ones,
and receive noise by the covariance of the fit. The mean increase of the range of their curves is subtracted. The
standard uncertainty is the spread of those ranges, times SPREAD_FACTOR because the correction repeats the noise of
the estimate, and a BIAS_SHARE of the correction. Both numbers come from simulation (tests/measuring/test_measure.py).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from hdassist.error.waves import NO_CAUSE, known_causes
from hdassist.errors import UsageError
from hdassist.files import number_of
from hdassist.measuring.fit import COVERAGE_FACTOR, EVEN, OrderIndices, TraceFit, distance, even_readings
from hdassist.measuring.terms import DESIGN_CHUNK, SlowTerms, curve_of, order_columns
from hdassist.model.geometry import Array, Kinematics
from hdassist.preset.fields import Drive
from hdassist.readers.trace import MeasuredTrace

_FULL_CYCLE_DEG = 720.0  # output angle of the longest full mesh cycle
_LEAST_RATIO = 10.0
_GREATEST_RATIO = 1000.0
_RATIO_ROUNDING = 1e-9
_ORDER_ROUNDING = 1e-9  # orders per input revolution
FULL_SHARE = 0.95  # share from which the cycle counts as visited
DEFAULT_ORDERS = tuple(float(order) for order in range(1, 13))
_HIGHEST_ORDER = 200.0
BEATS = 6
_SLOW_ORDERS = 12  # periods of slow terms in an output revolution, at most
_SLOW_PER_CAM_TURN = 0.2  # periods of slow terms in an input revolution, at most
USUAL_RATIO = 100.0  # assumed for the width of the beats where none is known
_DRIFTING = 4.0  # cam turns: from here on one order to either side stands for beats that change the error slowly
_SIZE_ITERATIONS = 8  # iterations for the size of sidebands that a recording leaves open
_UNSEEN_FACTOR = 2.5  # ovals of both wheels cancel more often than beats that are drawn: found with solved cycles
_RESOLVED_SHARE = 0.5  # a recording determines an amplitude if its 95 % interval is narrower than this share of it
WHOLE_TURN = 0.97  # share of an output revolution from which a recording resolves its sidebands
_TRAVEL_GAP = 0.6  # distance of the orders of a travel, as a share of the resolution
_TRAVEL_RIDGE = 1e-7  # ridge of the normal equations of a travel: it moves the curve by less than its noise
_LINE_CAUSE = "no order of the drive, or not resolved from an order: ball pass, cage, test rig"
_BEAT_CAUSE = "sidebands of an order, or a line: a part of an output revolution does not resolve them"
LINE_WIDTH = 1.5  # half width of a wave's own peak, in units of the resolution
_RIG_CAUSES = {  # parts of the rig that repeat so often in a turn of the output
    1.0: "once per output revolution: drive, encoder, coupling, gravity",
    2.0: "twice per output revolution: drive, encoder, coupling",
}
_CAM_CAUSE = "once per input revolution: drive, input encoder"
LARGEST_UNCERTAINTY = 1e6  # arcsec, of one that is stated
STATED = {  # sources that a single record cannot show
    "encoder": "graduation of the output encoder, once per output revolution; eccentricity of the input encoder",
    "coupling": "eccentricity of the output coupling: looks like an error once per output revolution",
    "reseating": "removal of the drive from the test rig and reinstallation",
    "temperature": "temperature of drive and test rig (operation.dT)",
}
WIND_UP = "wind-up"
# Sources of the range of fitted orders that the model of a recording contains: noise with its memory, waves that coarse
# readings hide, and waves beyond the fitted orders.
SCATTER = ("noise", "bias correction", "between readings", "beyond the orders")
_POINTS_PER_PERIOD = 16  # points in a period of the highest order
GAP_PERIODS = 0.5  # periods of the highest declared order: between readings as near as that the curve is followed
_BRIDGED_TURNS = 1 / 8  # widest gap between readings that counts as visited, in input revolutions
_BRIDGED_IN_CYCLE = 1 / 2  # the same of whole output turns, whose other turns of the cam show these angles too
_BRIDGED_SPREAD = 2.0  # times the usual spread of the curve by noise: between readings it is as well known
_SPREAD_PLACES = 200  # readings, whose spread is the usual one
_SPREAD_FACTOR = 1.15
BIAS_SHARE = 1 / 3
_TURN_PARTS = 24  # parts of an input revolution at which single revolutions may begin
_SLOPE_ENDS = 1.0  # turns of the cam, at the ends of a travel, whose slope noise hides
_SLOPE_DRAWS = 60  # draws of the bootstrap for a slope
_SHRINK = 2.0  # times the power of noise, taken off the power of each order
_HIGHEST_IMAGE = 30.0  # per cam turn: of orders that may be the image of another; ball passes lie below
_SAME_BEAT = 0.2  # distances of sidebands from their orders are equal within this share of the resolution
_CLEAR_BEAT = 0.05  # smallest sideband that shows a ratio, as a share of the largest amplitude
_FEWEST_BEATS = 3  # beats at the same distance that show a ratio
_CORRELATED = 1e3  # condition of the normal equations: beyond, orders cannot be shrunk one by one


@dataclass(frozen=True)
class Gearing:
    """Cam turns per output turn (without sign), of the full cycle, and of the travel, where that is less.

    travel: None if the drive turns through its full cycle.
    """

    ratio: float
    cycle: int
    travel: float | None = None

    @property
    def cam_turns(self) -> float:
        """Turns of the cam whose error counts: of the travel, or of the full cycle."""
        return self.travel or self.cycle

    @property
    def travel_deg(self) -> float | None:
        """Travel of the output."""
        return self.travel and 360 * self.travel / self.ratio

    def within(self, travel_deg: float | None) -> Gearing:
        """Return the gearing of a drive with an output travel [deg]; None for the full mesh cycle."""
        travel = (travel_deg or _FULL_CYCLE_DEG) / 360 * self.ratio
        return replace(self, travel=travel if travel < self.cycle else None)

    @property
    def cycle_output(self) -> int:
        """Output turns of the full cycle: 1, or 2 where the flexspline has an odd number of teeth."""
        return round(self.cycle / self.ratio)


@dataclass(frozen=True)
class Coverage:
    """Turns of the cam that a record has visited, each place of the full cycle once, and their share of it, 0 to 1.

    An angle is visited between two readings that are near enough to follow the highest order. longest_share: that of
    the longest sweep, from its first to its last angle.
    """

    cam_turns: float
    share: float
    longest_share: float


def gearing_of(drive: Drive | None, ratio: float | None) -> Gearing | None:
    """Return the gearing of a drive, or of a drive with two waves by its ratio; None if neither is known.

    Raises UsageError: both are given, or no ratio that a drive with two waves can have.
    """
    # a drive knows its numbers of teeth, so its cycle needs no assumption
    if drive is not None:
        if ratio is not None:
            raise UsageError("--ratio cannot be combined with --drive, which states the ratio", "leave out --ratio")
        kinematics = Kinematics.of(drive)
        return Gearing(abs(kinematics.u), kinematics.cycle_cam_revolutions)
    if ratio is None:
        return None
    ratio = abs(ratio)
    # with two waves the wheels differ by two teeth, so twice the ratio is a whole number of teeth
    doubled = round(2 * ratio) if ratio <= _GREATEST_RATIO else 0
    if not _LEAST_RATIO <= ratio <= _GREATEST_RATIO or abs(2 * ratio - doubled) > _RATIO_ROUNDING:
        hint = "give half the number of teeth of the moving wheel, for example 100 or 99.5"
        span = f"from {_LEAST_RATIO:g} to {_GREATEST_RATIO:g}"
        raise UsageError(f"invalid --ratio {ratio:g}: expected a multiple of 0.5 {span}", hint)
    # an odd number of teeth meets its own position only after two output revolutions
    return Gearing(ratio, doubled // 2 if doubled % 2 == 0 else doubled)


@dataclass(frozen=True)
class MeasuredOrder:
    """One order: amplitude cos(per_cam_rev phi + phase), with its standard uncertainty and the cause in words.

    cause: empty if no drive is given.
    is_line: whether it is outside the declared orders, or contains a spectral line.
    is_of_record: whether amplitude and uncertainty are those in the recording alone, which does not determine them
    over whole output revolutions.
    """

    per_cam_rev: float
    amplitude_arcsec: float
    uncertainty_arcsec: float
    phase_deg: float
    cause: str
    is_line: bool = False
    is_of_record: bool = False


def parse_orders(text: str | None) -> tuple[float, ...] | None:
    """Return the declared orders per cam turn, rising, from a text like "1-12" or "1,2,4"; None if there is none.

    Raises UsageError: no such text, or orders beyond 0 to 200.
    """
    if text is None:
        return None
    orders: set[float] = set()
    for part in text.split(","):
        # "1-12" is a range of whole orders; a single order may be a fraction
        match = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]+)?)\s*(?:-\s*([0-9]+)\s*)?", part)
        if match is None:
            raise UsageError(
                f"invalid --orders {text}: expected a range or a list of whole numbers",
                "write for example 1-12 or 1,2,4",
            )
        first = float(match[1])
        last = float(match[2] or match[1])
        if not 0 < first <= last <= _HIGHEST_ORDER or (match[2] and not first.is_integer()):
            raise UsageError(f"invalid --orders {text}: expected increasing orders above 0, up to {_HIGHEST_ORDER:g}")
        orders.update(np.arange(first, last + 0.5).tolist() if match[2] else [first])
    return tuple(sorted(orders))


def slow_terms(
    turns: float,
    ratio: float,
    degree: int,
    *,
    is_travel: bool = False,
) -> SlowTerms:
    """Return the slow terms of a recording over input revolutions: a drift, or more in a part of an output revolution.

    There a drift and the orders of the output, up to SLOW_ORDERS a turn of it, look alike, and polynomials stand for
    both, unless the record is all of the travel: then slow terms are error, and all orders are those of whole turns.
    """
    # within a travel drift is part of the error that counts, and a small ridge holds unresolved orders
    if is_travel:
        return SlowTerms(degree, ridge=_TRAVEL_RIDGE)
    # share of an output revolution that is recorded
    part = turns / ratio
    # a whole output revolution determines the slow orders; a short recording has no room for more terms
    if turns < _DRIFTING or part >= WHOLE_TURN:
        return SlowTerms(degree)
    # two unknowns for each period, as a wave has two, and two for the ends
    return SlowTerms(round(2 * min(_SLOW_ORDERS * part, _SLOW_PER_CAM_TURN * turns)) + 2, by_angle=True)


def order_grid(
    declared: Sequence[float],
    turns: float,
    ratio: float,
    slow: SlowTerms = SlowTerms(),
    *,
    beats: int = BEATS,
) -> Array:
    """Return the orders per input revolution to fit, rising, shape (orders,).

    In a travel they are those of whole revolutions, or closer than the recording resolves: its curve has no period.

    declared: orders per input revolution.
    turns: input revolutions that the recording spans.
    ratio: input revolutions per output revolution.
    slow: slow terms besides the orders; if these are polynomials, there are no sidebands around 0.
    beats: number of sidebands on each side of a declared order, as far as the recording resolves them.
    """
    # neighbouring sidebands are one output revolution apart
    spacing = 1 / ratio
    width = BEATS * spacing
    if slow.ridge:
        step = max(spacing, _TRAVEL_GAP / turns)
        width = step * np.ceil(width / step - 1e-9)
    else:
        # a shorter recording resolves orders that are 1/turns apart only
        step = spacing if turns * spacing >= WHOLE_TURN else 1 / turns
    # at least one sideband on each side where the error is seen to change slowly
    resolved_beats = max(int(width / step + 1e-9), int(turns >= _DRIFTING))
    offsets = step * np.arange(1, resolved_beats + 1)
    sidebands = np.concatenate([-offsets[:beats], [0.0], offsets[:beats]])
    # orders below the first sideband are in the polynomials already
    around_zero = np.empty(0) if slow.by_angle else offsets
    orders = np.concatenate([around_zero, *(order + sidebands for order in declared)])
    orders = np.sort(orders[orders > 0])
    is_new = np.concatenate([[True], np.diff(orders) > step / 2])  # sidebands of two orders may coincide
    return np.asarray(orders[is_new])


@dataclass(frozen=True, eq=False)
class _Causes:
    """Causes of the orders of a fit, in words.

    width: distance from an order up to which it is taken for that of a product of deviations.
    products: products of deviations at each order, as their degree and their words.
    sidebands: lines that are sidebands of a declared order, not resolved in a part of an output revolution.
    """

    fit: TraceFit
    gearing: Gearing | None
    has_drive: bool
    width: float
    products: tuple[tuple[tuple[int, str], ...], ...]
    sidebands: Array

    @classmethod
    def of(
        cls,
        fit: TraceFit,
        drive: Drive | None,
        gearing: Gearing | None,
        sidebands: Array,
    ) -> _Causes:
        """Assign each product of the deviations of a drive to the nearest order of a fit, if it is close enough."""
        fitted = fit.orders[~fit.is_line]
        # half the distance of fitted orders: nearer, a cause belongs to this order
        width = float(np.diff(fitted).min()) / 2 if len(fitted) > 1 else 0.5
        products: list[list[tuple[int, str]]] = [[] for _ in fit.orders]
        for (k_g, k_b), (order, text) in (known_causes(drive) if drive else {}).items():
            # each product of deviations falls to one fitted order
            index = int(np.abs(fit.orders - order).argmin())
            if abs(fit.orders[index] - order) <= width + _ORDER_ROUNDING:
                products[index].append((abs(k_g) + abs(k_b), text))
        return cls(
            fit=fit,
            gearing=gearing,
            has_drive=drive is not None,
            width=width,
            products=tuple(map(tuple, products)),
            sidebands=sidebands,
        )

    def text_of(self, group: OrderIndices) -> str:
        """Return the causes of a group of orders, the simplest ones of the drive first; empty without any."""
        # the drive first, then the rig, then what remains unresolved
        causes = self._simplest_products(group)
        if self.gearing:
            causes += self._causes_of_rig(self.fit.orders[group], self.gearing.ratio)
        if np.isin(self.fit.orders[group], self.sidebands).any():
            causes.append(_BEAT_CAUSE)
        elif self.fit.is_line[group].any():
            causes.append(_LINE_CAUSE)
        if causes:
            return "; ".join(dict.fromkeys(causes))
        # without a drive nothing is known of causes, so nothing is said
        return NO_CAUSE if self.has_drive else ""

    def _simplest_products(self, group: OrderIndices) -> list[str]:
        """Return the products of the lowest degree, which are the largest ones of small deviations."""
        products = [product for index in group for product in self.products[index]]
        lowest_degree = min((degree for degree, _ in products), default=0)
        return [text for degree, text in products if degree == lowest_degree]

    def _causes_of_rig(self, orders: Array, ratio: float) -> list[str]:
        """Return the parts of the test rig that repeat as often as some orders."""
        # in orders per output revolution
        reach = min(self.width * ratio, 0.5)
        causes = [text for per_output, text in _RIG_CAUSES.items() if (abs(orders * ratio - per_output) < reach).any()]
        if (abs(orders - 1) < _ORDER_ROUNDING).any():
            causes.append(_CAM_CAUSE)
        return causes


def order_tables(
    fit: TraceFit,
    declared: Sequence[float],
    drive: Drive | None,
    gearing: Gearing | None,
) -> tuple[tuple[MeasuredOrder, ...], tuple[MeasuredOrder, ...]]:
    """Return the orders of a fit with their simplest causes, rising, and each declared order with its sidebands.

    A line and the orders that the recording does not resolve from it are one entry. In a part of an output revolution
    a line among the sidebands of a declared order is one of these, and the sidebands that the recording does not
    determine are part of the uncertainty.

    fit: with its lines.
    declared: orders per input revolution, rising.
    drive: whose deviations are the causes, None if it is unknown.
    gearing: None if the ratio is unknown.
    """
    ratio = gearing.ratio if gearing else USUAL_RATIO
    is_part = fit.bins.span_on_output(ratio) < WHOLE_TURN * ratio
    # a line this near to an order may be one of its sidebands that a part does not resolve
    sideband_reach = BEATS / ratio + LINE_WIDTH / fit.bins.span
    is_sideband = is_part & (distance(fit.lines, np.asarray(declared)) <= sideband_reach)
    causes = _Causes.of(fit, drive, gearing, fit.lines[is_sideband])
    table = [_order_of(fit, group, fit.lines[~is_sideband], causes) for group in fit.groups]
    joint_table = []
    for order, indices in _with_sidebands(fit, declared, ratio).items():
        nearest = np.abs(fit.orders - order).argmin()
        row = next((row for row, group in enumerate(fit.groups) if nearest in group), 0)
        joint = _joint_order(fit, order, indices)
        if is_part:
            sidebands = _Sidebands.of(fit, indices, joint, ratio)
            joint = sidebands.widened(joint, BEATS)
            table[row] = sidebands.widened(table[row], 0)
        joint_table.append(replace(joint, cause=table[row].cause))
    return tuple(table), tuple(joint_table)


def _with_sidebands(
    fit: TraceFit,
    declared: Sequence[float],
    ratio: float,
) -> dict[float, OrderIndices]:
    """Return the places of each declared order and its sidebands in a fit, of those that have any."""
    # a sideband belongs to the nearer order
    reach = np.minimum(BEATS / ratio, np.diff(declared).min(initial=1.0) / 2)  # half way to the next order
    indices = {}
    for order in declared:
        is_near = np.abs(fit.orders - order) <= reach + _ORDER_ROUNDING
        indices[order] = np.flatnonzero(is_near & ~fit.is_slow)
    return {order: places for order, places in indices.items() if len(places)}


def _order_of(
    fit: TraceFit,
    group: OrderIndices,
    lines: Array,
    causes: _Causes,
) -> MeasuredOrder:
    """Return the order of a group of a fit; lines: those that are no sidebands."""
    wave = fit.wave(group)
    return MeasuredOrder(
        per_cam_rev=wave.per_cam_rev,
        amplitude_arcsec=wave.amplitude_arcsec,
        uncertainty_arcsec=wave.uncertainty_arcsec,
        phase_deg=wave.phase_deg,
        cause=causes.text_of(group),
        is_line=bool(np.isin(fit.orders[group], lines).any()),
    )


def _joint_order(
    fit: TraceFit,
    per_cam_rev: float,
    indices: OrderIndices,
) -> MeasuredOrder:
    """Return a declared order together with its sidebands, without a cause."""
    wave = fit.joint_wave(indices)
    return MeasuredOrder(
        per_cam_rev=per_cam_rev,
        amplitude_arcsec=wave.amplitude_arcsec,
        uncertainty_arcsec=wave.uncertainty_arcsec,
        phase_deg=wave.phase_deg,
        cause="",
    )


def other_ratio(
    fit: TraceFit,
    declared: Sequence[float],
    ratio: float,
) -> float | None:
    """Return the ratio that the sidebands of a fit show, if it is another one than that of the drive; else None.

    The error of a drive has sidebands at the same distances from several orders. Lines of a ball pass or of the test
    rig do not come in such pairs around declared orders.

    fit: with its lines; declared: orders per cam turn, rising; ratio: cam turns in an output turn of the drive.
    """
    # of the resolution of the recording, 1/span
    tolerance = _SAME_BEAT / fit.bins.span
    step = 1 / ratio
    distances: dict[tuple[float, bool], float] = {}  # of the lines from their orders, by the order and the side
    for index in np.flatnonzero(fit.is_line):
        line = float(fit.orders[index])
        order = min(declared, key=lambda declared_order: abs(declared_order - line))
        offset = abs(line - order)
        is_of_ratio = abs(offset / step - round(offset / step)) * step <= tolerance
        is_sideband = tolerance < offset <= min(BEATS / ratio, 1 / _LEAST_RATIO) and not is_of_ratio
        if is_sideband and float(fit.amplitude[index]) >= _CLEAR_BEAT * float(fit.amplitude.max()):
            distances[order, line > order] = offset
    for offset in sorted(distances.values()):
        equal = [distance for distance in distances.values() if abs(distance - offset) <= tolerance]
        if len(equal) >= _FEWEST_BEATS:
            return 1 / float(np.mean(equal))
    return None


@dataclass(frozen=True, eq=False)
class _Sidebands:
    """Distribution of the sidebands of an order over whole output revolutions, given a part of one.

    numbers: of the sidebands, from -BEATS to BEATS, of the cosines and then of the sines, shape (coefficients,).
    mean: of the coefficients [arcsec], shape (coefficients,).
    covariance: of the coefficients [arcsec^2], shape (coefficients, coefficients).
    student: factor of an interval over that of a normal distribution, because their size is estimated.
    """

    numbers: NDArray[np.int64]
    mean: Array
    covariance: Array
    student: float

    @classmethod
    def of(
        cls,
        fit: TraceFit,
        indices: OrderIndices,
        joint: MeasuredOrder,
        ratio: float,
    ) -> _Sidebands:
        """Return the distribution of the sidebands of a joint component.

        Cosine and sine of each sideband c are drawn from a normal distribution. The sidebands next to the order are as
        large as the order itself, and each further one is half as large as the one before. The coefficients of the
        recording are B c and noise. The common size of c is found by expectation and maximisation.
        """
        numbers = np.tile(np.arange(-BEATS, BEATS + 1), 2)
        pair = fit.pair(indices)
        noise = fit.covariance(pair)
        orders = joint.per_cam_rev + numbers[: len(numbers) // 2] / ratio
        projection = fit.design.project(lambda rows: order_columns(fit.bins.turns[rows], orders))[pair]  # B
        share = 4.0 ** -np.maximum(np.abs(numbers) - 1.0, 0)  # of the variance
        variance = joint.amplitude_arcsec**2 / share.sum() + np.trace(noise)
        for _ in range(_SIZE_ITERATIONS):
            # expectation: the normal distribution of c, given the coefficients and the size
            gain, covariance = _conditional(variance * share, projection, noise)
            mean = gain @ fit.coefficients[pair]
            # maximisation: the size that makes this distribution most likely
            variance = float(np.mean((mean**2 + np.diag(covariance)) / share))
        freedom = len(numbers) - float((np.diag(covariance) / (variance * share)).sum())  # of that size
        student = float(stdtrit(max(freedom, 1.0), 0.975)) / COVERAGE_FACTOR
        return cls(
            numbers=numbers,
            mean=mean,
            covariance=covariance,
            student=student,
        )

    def widened(self, order: MeasuredOrder, beats: int) -> MeasuredOrder:
        """Return an order with its uncertainty over whole output revolutions; beats: sidebands on each side of it."""
        margin = self.margin_arcsec(order.amplitude_arcsec, beats)
        uncertainty = float(np.hypot(order.uncertainty_arcsec, margin))
        if COVERAGE_FACTOR * uncertainty > _RESOLVED_SHARE * order.amplitude_arcsec:
            return replace(order, is_of_record=True)
        return replace(order, uncertainty_arcsec=uncertainty)

    def margin_arcsec(self, amplitude_arcsec: float, beats: int) -> float:
        """Return how far the amplitude with some sidebands on each side may differ from that in the recording."""
        # sidebands that count with the order; the order itself has number 0
        is_part = np.abs(self.numbers) <= beats
        mean = self.mean[is_part]
        covariance = self.covariance[is_part][:, is_part]
        # root of the expected square of all sidebands together
        size = float(np.sqrt(mean @ mean + np.trace(covariance)))
        # of a quadratic form in normal numbers
        variance_of_square = 2 * np.trace(covariance @ covariance) + 4 * mean @ covariance @ mean
        scatter = float(np.sqrt(variance_of_square)) / (2 * size)
        return float(_UNSEEN_FACTOR * self.student * np.hypot(size - amplitude_arcsec, scatter))


def _conditional(
    variances: Array,
    projection: Array,
    noise: Array,
) -> tuple[Array, Array]:
    """Return how normal numbers c follow from B c + noise: the gain, shape (n, m), and their covariance, shape (n, n).

    variances: of independent numbers before, shape (n,).
    projection: B, shape (m, n).
    noise: its covariance, shape (m, m).
    """
    # lstsq in place of an inverse: without noise the matrix may be singular
    prior = projection * variances
    gain = np.linalg.lstsq(prior @ projection.T + noise, prior, rcond=None)[0].T
    return np.asarray(gain), np.diag(variances) - gain @ prior


@dataclass(frozen=True)
class UncertaintySource:
    """One source: its name, its standard uncertainty [arcsec] (None if not stated), and its origin."""

    name: str
    arcsec: float | None
    origin: str


def parse_stated(texts: Sequence[str]) -> dict[str, float]:
    """Return stated standard uncertainties [arcsec] by source, from texts like "encoder=0.5,coupling=0".

    Raises UsageError for any other text, an unknown source, or a source that is stated twice.
    """
    stated: dict[str, float] = {}
    # the option may be repeated, or list several sources
    for text in ",".join(texts).split(",") if texts else ():
        name, _, number = text.partition("=")
        value = number_of(number)
        if name not in STATED or name in stated or not 0 <= value <= LARGEST_UNCERTAINTY:
            expected = f"NAME=ARCSEC, from 0 to {LARGEST_UNCERTAINTY:g}"
            if name in stated:
                expected = "state each source only once"
            hint = f"a standard uncertainty of F'_ior, NAME one of {', '.join(STATED)}"
            raise UsageError(f"invalid --budget {text}: expected {expected}", hint)
        stated[name] = value
    return stated


def resolution_source(trace: MeasuredTrace, scatter: float) -> UncertaintySource:
    """Return the source of the step of a trace's readings.

    Counts at uneven angles are dithered, and so is a step below twice the scatter, except for counts of the input at
    even angles, as noise of the output does not move them. A rounded value has the standard uncertainty step/sqrt(12).
    If the readings are in time with the revolutions, the fit follows the rounding, and both extremes of a range may err
    together: hence 2. Otherwise they err independently: hence sqrt(2).

    scatter: standard deviation of single readings [arcsec].
    """
    # standard deviation of an even distribution over a step
    rounding = trace.step_arcsec / sqrt(12)
    # scatter over more than half a step evens its rounding out
    if trace.dithered or trace.step_arcsec / 2 < scatter:
        if trace.in_time and trace.cam_step_arcsec:
            by_input = 2 * trace.cam_step_arcsec / sqrt(12)
            return UncertaintySource("resolution", by_input, "counts of the input at even angles")
        return UncertaintySource("resolution", 0.0, "no step seen above the noise")
    if trace.in_time:
        # at even angles rounding repeats from revolution to revolution, and both extremes may be off the
        # opposite way
        return UncertaintySource("resolution", 2 * rounding, "step of the readings, at even angles")
    # two extremes with independent rounding
    return UncertaintySource("resolution", sqrt(2) * rounding, "step of the readings")


def stated_sources(stated: Mapping[str, float]) -> tuple[UncertaintySource, ...]:
    """Return the sources that a single recording cannot show, by their stated standard uncertainties [arcsec]."""
    sources = []
    for name, effect in STATED.items():
        # an unstated source stands in the table too, so that nobody takes it for zero
        origin = "stated" if name in stated else f"not stated; {effect}"
        sources.append(UncertaintySource(name, stated.get(name), origin))
    return tuple(sources)


def combined(sources: Sequence[UncertaintySource]) -> float:
    """Return the combined standard uncertainty [arcsec] of the sources that have a value."""
    return sqrt(sum(source.arcsec**2 for source in sources if source.arcsec is not None))


@dataclass(frozen=True)
class Range:
    """Range of a fitted curve [arcsec], its bias by noise, and the standard uncertainty of the range by noise.

    rise: possible increase by spectral lines if their phases relative to the orders differ, as in another cycle.
    others: standard uncertainty by all sources except noise.
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

    def at_most(self, arcsec: float) -> Range:
        """Return the range, or one of a smaller value: a lower bound is no more than the range of the readings."""
        return replace(self, fitted=min(self.fitted, arcsec + self.bias))

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
        """Return the range minus and plus its expanded uncertainty; the rise is added to the upper end."""
        reach = COVERAGE_FACTOR * self.uncertainty
        # lines may add up in another cycle: only the upper end rises
        return max(0.0, self.value - reach), self.value + self.rise + reach


@dataclass(frozen=True)
class FullCycle:
    """F'_ior of the full cycle by the model of a recording.

    value_arcsec: best estimate; if a part of the cycle was recorded, that of the range of this part.
    interval_arcsec: 95 % interval: its lower end is of visited places, its upper end of the cycle.
    standard_uncertainty_arcsec: of the value by the model alone, without the other sources of the budget.
    at_least_arcsec: largest limit that F'_ior exceeds with a probability of 95 %.
    at_most_arcsec: smallest limit that F'_ior meets with a probability of 95 %; None if too little of the cycle was
        recorded to pass a drive.
    record_next_rev: part of the cycle that would narrow the interval most, as input revolutions of the recorded angles
        modulo the cycle; None if there is none.
    effective_samples: number of independent samples of the range.
    """

    value_arcsec: float
    interval_arcsec: tuple[float, float]
    standard_uncertainty_arcsec: float
    at_least_arcsec: float
    at_most_arcsec: float | None
    record_next_rev: tuple[float, float] | None
    effective_samples: float


def visited_angles(fit: TraceFit) -> tuple[Array, int]:
    """Return the places of a fine grid of input angles at which a fit determines the error, and places per revolution.

    The places are whole numbers, rising, shape (places,). They lie between readings that are close enough to follow the
    highest declared order. Larger gaps up to _BRIDGED_TURNS (_BRIDGED_IN_CYCLE of whole output revolutions) count too
    if the fit determines the curve between about as well as at the readings.
    """
    slow = fit.design.slow
    bins = fit.bins
    longest_gap = _BRIDGED_TURNS if slow.by_angle or slow.ridge else _BRIDGED_IN_CYCLE
    # between readings that near no fitted order can hide an extreme
    followed_gap = GAP_PERIODS / float(fit.orders[~fit.is_line][-1])
    per_turn = _POINTS_PER_PERIOD * int(np.ceil(fit.orders[-1]))
    # over some readings: all of a long recording would take seconds
    usual_spread = float(np.median(_spread(fit, bins.turns[:: max(1, len(bins) // _SPREAD_PLACES)])))
    visited = []
    for turns in bins.by_sweep(bins.turns):
        gaps = np.diff(turns)
        is_determined = gaps <= followed_gap
        bridged = np.flatnonzero(~is_determined & (gaps <= longest_gap))
        if len(bridged):
            middles = turns[bridged] + gaps[bridged] / 2
            # a wider gap counts as visited if other revolutions determine the curve there
            is_determined[bridged] = _spread(fit, middles) <= _BRIDGED_SPREAD * usual_spread
        grid = np.arange(np.ceil(turns[0] * per_turn), np.floor(turns[-1] * per_turn) + 1)
        # the gap that an angle lies in is that before the next reading
        next_reading = np.clip(np.searchsorted(turns, grid / per_turn), 1, len(turns) - 1)
        visited.append(grid[is_determined[next_reading - 1]])
    return np.unique(np.concatenate(visited)), per_turn


def _spread(fit: TraceFit, turns: Array) -> Array:
    """Return the standard deviation of a fitted curve by noise [arcsec] at angles [turns], shape (angles,)."""
    spreads = []
    # in chunks, since the design of a long recording does not fit into memory
    for start in range(0, len(turns), DESIGN_CHUNK):
        errors = order_columns(turns[start : start + DESIGN_CHUNK], fit.orders) @ fit.factor
        spreads.append(np.linalg.norm(errors, axis=1))
    return np.concatenate(spreads)


def image_change(fit: TraceFit, turns: Array) -> float:
    """Return the largest change of a range [arcsec] if orders are images of higher ones.

    N even readings per revolution show order N - n as order n. Each declared order with its sidebands, and all
    together, are replaced by their images up to _HIGHEST_IMAGE.

    turns: visited input angles [turns], shape (angles,).
    """
    # at even angles an order and `rate` minus that order have the same readings
    rate, start, evenness = even_readings(fit.bins)
    images = rate - fit.orders
    declared = np.rint(fit.orders)
    # a declared order is hidden with all of its sidebands, or not at all
    is_hidden = (rate - declared > declared) & (rate - declared <= _HIGHEST_IMAGE)
    if evenness < EVEN or not is_hidden.any():
        return 0.0
    turns = np.concatenate([turns, turns + 1 / (2 * _POINTS_PER_PERIOD * fit.orders[-1])])  # images are finer
    # a column for all hidden orders together, then one for each
    # which orders are taken for their images: all of them, or those around one declared order
    is_replaced = np.column_stack(
        [is_hidden, *(is_hidden & (declared == order) for order in np.unique(declared[is_hidden]))]
    )
    amplitudes = fit.coefficients.reshape(2, -1).T @ [1, -1j]  # complex: a cos(p) + b sin(p) = Re((a - i b) exp(i p))
    # mirrored at the first reading, where order and image agree in phase
    image_amplitudes = (amplitudes * np.exp(2j * np.pi * rate * start)).conj()[:, None] * is_replaced
    image_curves = curve_of(np.concatenate([image_amplitudes.real, -image_amplitudes.imag]), images, turns)
    # orders that are not replaced keep their coefficients
    remaining = np.tile(~is_replaced, (2, 1)) * fit.coefficients[:, None]
    ranges = np.ptp(image_curves + curve_of(remaining, fit.orders, turns), axis=0)
    return float(np.abs(ranges - np.ptp(fit.curve(turns))).max())


@dataclass(frozen=True)
class CurveRanges:
    """Ranges of a fitted curve, and its largest slope.

    visited: over all visited angles.
    revolution: the largest within one input revolution.
    cam: of the orders of the cam, without slow terms of the output.
    slope: largest slope [arcsec per input revolution]; of a travel without its ends.
    """

    visited: Range
    revolution: Range
    cam: Range
    slope: Range


@dataclass(frozen=True)
class OtherUncertainties:
    """Standard uncertainties of the ranges of a curve [arcsec] by all sources except noise."""

    visited: float = 0.0
    revolution: float = 0.0
    cam: float = 0.0


def ranges_of(
    fit: TraceFit,
    turns: Array,
    rng: np.random.Generator,
    others: OtherUncertainties,
    *,
    whole: bool,
    draws: int = 200,
) -> CurveRanges:
    """Return the ranges of a fitted curve over angles, and its largest slope, with their bias and spread by noise.

    fit: of a direction.
    turns: input angles [turns], rising, shape (angles,).
    rng: of the parametric bootstrap.
    others: standard uncertainties of the ranges by all sources except noise.
    whole: whether the angles are those of the full cycle; in other cycles the lines may then add more.
    draws: number of draws of the bootstrap.
    """
    curves = _bootstrap_curves(fit, rng, draws)
    extremes = _extremes_of(fit, turns, curves)
    # of a whole cycle: what lines may add in another one
    lines = 0.0
    if whole:
        is_line = fit.is_line | fit.unresolved
        # a line may have any phase: peak to peak twice its amplitude
        lines = 2 * sum(fit.wave(group).amplitude_arcsec for group in fit.groups if is_line[group[0]])
    return CurveRanges(
        visited=_range(extremes.range_in_all(), lines, others.visited),
        revolution=_range(extremes.range_in_revolution(), lines, others.revolution),
        cam=_range(extremes.cam_high - extremes.cam_low, 0.0, others.cam),
        slope=_range(extremes.steepest, 0.0, 0.0),
    )


def _bootstrap_curves(
    fit: TraceFit,
    rng: np.random.Generator,
    draws: int,
) -> Array:
    """Return coefficients of curves [arcsec], shape (2 orders, 3 + draws), for `_range` and `_slope_coefficients`.

    The curves are the fitted one, this one without lines, the fitted one shrunk by its share of noise, and the shrunk
    one with drawn noise.
    """
    # parametric bootstrap: errors of the coefficients with their covariance
    noise = fit.factor @ rng.standard_normal((fit.factor.shape[1], draws))
    # drawn around a curve without the power that noise adds, so that noise is counted once
    shrunk = fit.coefficients * np.tile(_kept_shares(fit), 2)
    is_line = np.tile(fit.is_line | fit.unresolved, 2)
    without_lines = np.where(is_line, 0.0, fit.coefficients)
    fitted = np.stack([fit.coefficients, without_lines, shrunk], axis=1)
    return np.concatenate([fitted, shrunk[:, None] + noise], axis=1)


def _slope_coefficients(orders: Array, curves: Array) -> Array:
    """Return the coefficients of the slopes of curves [arcsec per input revolution], shape (2 orders, slopes).

    The columns are those that `_range` expects. Lines count in a slope, so the fitted curve takes the place of the
    curve without lines.
    """
    # the columns that `_range` expects; the second one has no meaning without lines
    columns = [0, 0, *range(2, 3 + _SLOPE_DRAWS)]
    cosines, sines = curves[:, columns].reshape(2, len(orders), -1)
    # derivative: cosines of the slope from sines of the curve, and the reverse
    return np.asarray((2 * np.pi * np.tile(orders, 2))[:, None] * np.concatenate([sines, -cosines]))


class _Extremes:
    """Extremes of curves over angles, collected from one part of the angles after the other.

    high, low: in each part of an input revolution [arcsec], shape (parts, curves).
    cam_high, cam_low: of the orders of the cam over all angles [arcsec], shape (curves,).
    steepest: largest slopes [arcsec per input revolution], shape (slopes,).
    """

    def __init__(
        self,
        parts: int,
        curves: int,
        slopes: int,
    ) -> None:
        self.high = np.full((parts, curves), -np.inf)
        self.low = np.full((parts, curves), np.inf)
        self.cam_high = np.full(curves, -np.inf)
        self.cam_low = np.full(curves, np.inf)
        self.steepest = np.zeros(slopes)

    def add_values(self, part: NDArray[np.int64], values: Array) -> None:
        """Add values [arcsec], shape (angles, curves), and the part of a revolution of each angle, rising."""
        # rows of one part are neighbours, so reduceat takes them at once
        parts, first = np.unique(part, return_index=True)
        self.high[parts] = np.maximum(self.high[parts], np.maximum.reduceat(values, first))
        self.low[parts] = np.minimum(self.low[parts], np.minimum.reduceat(values, first))

    def add_cam_values(self, values: Array) -> None:
        """Add values of the orders of the cam [arcsec], shape (angles, curves)."""
        self.cam_high = np.maximum(self.cam_high, values.max(axis=0))
        self.cam_low = np.minimum(self.cam_low, values.min(axis=0))

    def add_slopes(self, slopes: Array) -> None:
        """Add slopes [arcsec per input revolution], shape (angles, slopes); there may be no angles."""
        self.steepest = np.maximum(self.steepest, np.abs(slopes).max(axis=0, initial=0.0))

    def range_in_all(self) -> Array:
        """Return the range of each curve over all angles [arcsec], shape (curves,)."""
        return np.asarray(self.high.max(axis=0) - self.low.min(axis=0))

    def range_in_revolution(self) -> Array:
        """Return the largest range of each curve within one input revolution [arcsec], shape (curves,)."""
        ranges = []
        # a revolution may begin in any of _TURN_PARTS parts
        for first in range(len(self.high)):
            parts = slice(first, first + _TURN_PARTS)
            ranges.append(self.high[parts].max(axis=0) - self.low[parts].min(axis=0))
        return np.asarray(np.max(ranges, axis=0))


def _extremes_of(
    fit: TraceFit,
    turns: Array,
    curves: Array,
) -> _Extremes:
    """Return the extremes of curves, shape (2 orders, curves), at angles [turns], rising, shape (angles,)."""
    slopes = _slope_coefficients(fit.orders, curves)
    is_slow = np.tile(fit.is_slow, 2)
    margin = _SLOPE_ENDS if fit.design.slow.ridge else 0.0
    # polynomials bend at the ends of a travel, where no reading holds them
    is_inner = np.minimum(turns - turns[0], turns[-1] - turns) >= margin
    # 1e-6: an angle at the edge of a part belongs to the later one in spite of rounding
    part = np.floor(turns * _TURN_PARTS + 1e-6).astype(np.int64)
    part -= part[0]
    extremes = _Extremes(
        parts=int(part[-1]) + 1,
        curves=curves.shape[1],
        slopes=slopes.shape[1],
    )
    for start in range(0, len(turns), DESIGN_CHUNK):
        rows = slice(start, start + DESIGN_CHUNK)
        columns = order_columns(turns[rows], fit.orders)
        values = columns @ curves
        extremes.add_values(part[rows], values)
        # orders of the cam alone: slow ones belong to the output revolution
        extremes.add_cam_values(values - columns[:, is_slow] @ curves[is_slow])
        inner_columns = columns if is_inner[rows].all() else columns[is_inner[rows]]
        extremes.add_slopes(inner_columns @ slopes)
    return extremes


def _kept_shares(fit: TraceFit) -> Array:
    """Return the share of each order that is no noise, shape (orders,); of a travel that with its sidebands."""
    noise = (fit.factor**2).sum(axis=1).reshape(2, -1).sum(axis=0)  # of each order, arcsec^2
    power = fit.amplitude**2
    # unresolved orders have large coefficients that cancel: their joint curve is what counts
    if fit.design.slow.ridge:
        turns = fit.bins.turns[:: max(1, len(fit.bins) // _SPREAD_PLACES)]
        columns = order_columns(turns, fit.orders)
        nearest = np.rint(fit.orders)
        for order in np.unique(nearest):
            is_in = nearest == order
            pair = np.tile(is_in, 2)
            power[is_in] = np.mean((columns[:, pair] @ fit.coefficients[pair]) ** 2)
            noise[is_in] = np.mean(((columns[:, pair] @ fit.factor[pair]) ** 2).sum(axis=1))
    # orders that are nearly dependent cannot be shrunk one by one
    elif fit.design.condition > _CORRELATED:
        return np.ones(len(power))
    # twice the noise, which leaves nothing of an order that is noise alone
    return np.asarray(np.maximum(0.0, 1 - _SHRINK * noise / np.maximum(power, 1e-300)))


def _range(
    extents: Array,
    lines: float,
    others: float,
) -> Range:
    """Return a range from those of the curves of `_bootstrap_curves`, shape (curves,).

    lines: range that lines add if their extremes coincide with those of the curve [arcsec].
    others: see Range.
    """
    fitted, without_lines, shrunk = extents[:3].tolist()
    drawn = extents[3:]
    return Range(
        fitted=fitted,
        # noise widens a range; a negative difference is chance of the draws
        bias=max(0.0, float(drawn.mean()) - shrunk),
        spread=_SPREAD_FACTOR * float(drawn.std(ddof=1)),
        rise=max(0.0, without_lines + lines - fitted) if lines else 0.0,
        others=others,
    )
