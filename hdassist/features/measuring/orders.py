"""Orders of a measured recording, coverage of the full mesh cycle, and F'_ior of the fitted curve with its uncertainty.

Deviations of the wheel that rotates with the output modulate the effect of deviations that are fixed. The error
therefore has orders n + k/ratio around each declared order n. BEATS such orders on either side reproduce a model's
error over the full mesh cycle within about 1 % of its range. A recording of T input revolutions resolves orders 1/T
apart; if orders are closer, a smaller number of orders represents all of them. F'_ior is the maximum minus the minimum
of the curve over the covered angles, corrected for noise.

Noise makes the range of a curve too large, because the maximum is taken over values with errors. The bias is estimated
by a parametric bootstrap. Coefficients shrunk towards 0 by their share of noise represent the true ones, and receive
noise with the covariance of the fit. The mean increase of the range of their curves is subtracted. The standard
uncertainty combines two parts: the spread of those ranges, times SPREAD_FACTOR because the correction repeats the noise
of the estimate, and a BIAS_SHARE of the correction. Both factors come from simulation
(tests/measuring/test_measure.py).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from hdassist.drive.error.waves import NO_CAUSE, known_causes
from hdassist.drive.model.geometry import Array, Kinematics
from hdassist.drive.preset.fields import Drive
from hdassist.features.measuring.fit import COVERAGE_FACTOR, EVEN, OrderIndices, TraceFit, distance, even_readings
from hdassist.features.measuring.terms import DESIGN_CHUNK, SlowTerms, curve_of, order_columns
from hdassist.readers.trace import MeasuredTrace
from hdassist.recording.sizes import ORDER_PROFILE
from hdassist.recording.waves import ALWAYS_ORDER
from hdassist.run.errors import UsageError
from hdassist.run.files import number_of

_FULL_CYCLE_DEG = 720.0  # output angle of the longest full mesh cycle
_LEAST_RATIO = 10.0
_GREATEST_RATIO = 1000.0
_RATIO_ROUNDING = 1e-9
_ORDER_ROUNDING = 1e-9  # largest rounding error of an order, per input revolution
FULL_SHARE = 0.95  # share of the cycle from which the full cycle counts as covered
DEFAULT_ORDERS = tuple(float(order) for order in range(1, 13))
_HIGHEST_ORDER = 200.0
BEATS = 6
_SLOW_ORDERS = 12  # maximum number of periods of slow terms per output revolution
_SLOW_PER_CAM_TURN = 0.2  # maximum number of periods of slow terms per input revolution
USUAL_RATIO = 100.0  # ratio assumed for the width of the sidebands if the ratio is unknown
# input revolutions of a recording from which each order has at least one sideband on each side, for slow changes
_DRIFTING = 4.0
_SIZE_ITERATIONS = 8  # iterations for the size of sidebands that a recording does not determine
# factor on the uncertainty of undetermined sidebands: ovality of both wheels cancels more often than sampled sidebands;
# determined with solved cycles
_UNSEEN_FACTOR = 2.5
_RESOLVED_SHARE = 0.5  # a recording determines an amplitude if its 95 % interval is narrower than this share of it
WHOLE_TURN = 0.97  # share of an output revolution from which a recording resolves its sidebands
_TRAVEL_GAP = 0.6  # distance of the orders of a travel, as a share of the resolution
_TRAVEL_RIDGE = 1e-7  # ridge of the normal equations of a travel: it moves the curve by less than its noise
_LINE_CAUSE = "not an order of the drive, or not resolved from one: ball pass, cage, test rig"
_BEAT_CAUSE = "sidebands of an order, or a separate line: part of an output revolution does not resolve them"
LINE_WIDTH = 1.5  # half-width of the spectral peak of one wave, in units of the resolution
_RIG_CAUSES = {  # causes in the test rig, by their number of periods per output revolution
    1.0: "once per output revolution: drive, encoder, coupling, gravity",
    2.0: "twice per output revolution: drive, encoder, coupling",
}
_CAM_CAUSE = "once per input revolution: drive, input encoder"
LARGEST_UNCERTAINTY = 1e6  # arcsec: largest uncertainty that may be stated
STATED = {  # sources that a single recording cannot show
    "encoder": "graduation of the output encoder, once per output revolution; eccentricity of the input encoder",
    "coupling": "eccentricity of the output coupling, which appears as an error once per output revolution",
    "reseating": "removal of the drive from the test rig and reinstallation",
    "temperature": "temperature of drive and test rig (operation.dT)",
}
WIND_UP = "wind-up"
BETWEEN_TORQUES = "between torques"
# Sources of the range of fitted orders that the model of a recording contains: correlated noise, waves that coarse
# readings hide, and waves beyond the fitted orders.
SCATTER = ("noise", "bias correction", "between readings", "beyond the orders")
_POINTS_PER_PERIOD = 16  # points in a period of the highest order
# widest gap between readings, in periods of the highest declared order, in which the curve is followed
GAP_PERIODS = 0.5
_BRIDGED_TURNS = 1 / 8  # widest gap between readings that counts as covered, in input revolutions
# the same limit if whole output revolutions are recorded, as other input revolutions also cover these angles
_BRIDGED_IN_CYCLE = 1 / 2
# largest spread of the curve between readings, as a multiple of the usual spread, at which the gap counts as covered
_BRIDGED_SPREAD = 2.0
_SPREAD_PLACES = 200  # number of readings from which the usual spread is computed
_SPREAD_FACTOR = 1.15
BIAS_SHARE = 1 / 3
_TURN_PARTS = 24  # parts of an input revolution at which single revolutions may begin
_SLOPE_ENDS = 1.0  # input revolutions at each end of a travel in which noise hides the slope
_EXTREMES_CHUNK = 1024  # number of angles whose curves are computed at a time, because they must fit into the cache
_SLOPE_DRAWS = 60  # draws of the bootstrap for a slope
_SHRINK = 2.0  # multiple of the noise power that is subtracted from the power of each order
# highest order per input revolution that may appear as a lower one; ball-pass orders lie below it
_HIGHEST_IMAGE = 30.0
# Largest number of periods by which an order and its image may differ over the recording; then the readings agree
_SAME_IMAGE = 0.5
# Smallest usual size of an image that may be the cause, relative to that of the lower order. In 14 solved drives, the
# order of the image was larger in 6 of 445 pairs below this ratio, and in 50 of 219 above (benchmarks/thresholds.py).
_LIKELY_IMAGE = 1 / 3
_SAME_BEAT = 0.2  # distances of sidebands from their orders are equal within this share of the resolution
# smallest amplitude of a sideband that is evidence of another ratio, as a share of the largest
_LEAST_SIDEBAND_SHARE = 0.05
_FEWEST_BEATS = 3  # minimum number of sidebands at the same distance that are evidence of another ratio
_CORRELATED = 1e3  # condition number of the normal equations above which orders cannot be shrunk individually


@dataclass(frozen=True)
class Gearing:
    """Input revolutions per output revolution, per full cycle, and within the travel.

    ratio: input revolutions per output revolution, without sign.
    cycle: input revolutions of the full cycle.
    travel: input revolutions of the travel, None if the drive turns through its full cycle.
    """

    ratio: float
    cycle: int
    travel: float | None = None

    @property
    def cam_turns(self) -> float:
        """The input revolutions to which F'_ior refers: those of the travel or of the full cycle."""
        return self.travel or self.cycle

    @property
    def travel_deg(self) -> float | None:
        """The travel of the output [deg], None if the drive turns through its full cycle."""
        return self.travel and 360 * self.travel / self.ratio

    def within(self, travel_deg: float | None) -> Gearing:
        """Return the gearing of a drive with an output travel [deg], None for the full mesh cycle."""
        travel = (travel_deg or _FULL_CYCLE_DEG) / 360 * self.ratio
        return replace(self, travel=travel if travel < self.cycle else None)

    @property
    def cycle_output(self) -> int:
        """The output revolutions of the full cycle: 1, or 2 if the flexspline has an odd number of teeth."""
        return round(self.cycle / self.ratio)


@dataclass(frozen=True)
class Coverage:
    """Coverage of the full cycle or the travel by a recording.

    An angle is covered if it lies between two readings close enough to follow the highest order.

    cam_turns: covered input revolutions; each angle of the cycle counts once.
    share: covered share, from 0 to 1.
    longest_share: share that the longest sweep spans from its first to its last angle.
    """

    cam_turns: float
    share: float
    longest_share: float


def gearing_of(drive: Drive | None, ratio: float | None) -> Gearing | None:
    """Return the gearing of a drive, or of a drive with two waves and a given ratio, or None if neither is given.

    Raises UsageError if both are given, or if a drive with two waves cannot have the ratio.
    """
    # the numbers of teeth of a drive determine its cycle without assumptions
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
        hint = "state half the number of teeth of the moving wheel, for example 100 or 99.5"
        span = f"from {_LEAST_RATIO:g} to {_GREATEST_RATIO:g}"
        raise UsageError(f"invalid --ratio {ratio:g}: expected a multiple of 0.5 {span}", hint)
    # a wheel with an odd number of teeth returns to its initial mesh only after two output revolutions
    return Gearing(ratio, doubled // 2 if doubled % 2 == 0 else doubled)


@dataclass(frozen=True)
class MeasuredOrder:
    """One order: amplitude cos(per_cam_rev phi + phase), with its standard uncertainty.

    cause: description of the cause, empty if no drive is given.
    is_line: whether it is outside the declared orders, or contains a spectral line.
    is_of_record: whether amplitude and uncertainty describe only the recorded part, because the recording does not
    determine them over whole output revolutions.
    """

    per_cam_rev: float
    amplitude_arcsec: float
    uncertainty_arcsec: float
    phase_deg: float
    cause: str
    is_line: bool = False
    is_of_record: bool = False


def parse_orders(text: str | None) -> tuple[float, ...] | None:
    """Return the declared orders per input revolution, increasing, from a text such as "1-12" or "1,2,4".

    Raises UsageError if the text does not have this form, or if an order is outside 0 to 200. The result is None
    if the text is None.
    """
    if text is None:
        return None
    orders: set[float] = set()
    for part in text.split(","):
        # "1-12" is a range of whole orders; a single order may be a fraction
        match = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]+)?)\s*(?:-\s*([0-9]+)\s*)?", part)
        if match is None:
            raise UsageError(
                f"invalid --orders {text}: expected a list of orders, or a range of whole orders",
                "use, for example, 1-12 or 1,2,4",
            )
        first = float(match[1])
        last = float(match[2] or match[1])
        if not 0 < first <= last <= _HIGHEST_ORDER or (match[2] and not first.is_integer()):
            message = f"invalid --orders {text}: expected increasing orders above 0, up to {_HIGHEST_ORDER:g}"
            raise UsageError(message, "use, for example, 1-12 or 1,2,4")
        orders.update(np.arange(first, last + 0.5).tolist() if match[2] else [first])
    return tuple(sorted(orders))


def slow_terms(
    turns: float,
    ratio: float,
    degree: int,
    *,
    is_travel: bool = False,
) -> SlowTerms:
    """Return the slow terms of a recording: a drift, or polynomials for a part of an output revolution.

    In a part of an output revolution, a drift and the orders of the output (up to _SLOW_ORDERS per revolution) look
    alike, and polynomials represent both. If the recording covers a complete travel, slow terms are part of the error,
    and all orders are those of whole revolutions.

    turns: input revolutions of the recording.
    ratio: input revolutions per output revolution.
    degree: degree of the requested drift.
    is_travel: whether F'_ior refers to a travel.
    """
    # within a travel a drift is part of the error, and a small ridge limits unresolved orders
    if is_travel:
        return SlowTerms(degree, ridge=_TRAVEL_RIDGE)
    # share of an output revolution that is recorded
    part = turns / ratio
    # a whole output revolution determines the slow orders; a short recording has no room for more terms
    if turns < _DRIFTING or part >= WHOLE_TURN:
        return SlowTerms(degree)
    # two unknowns for each period, as for a wave, and two for the ends
    return SlowTerms(round(2 * min(_SLOW_ORDERS * part, _SLOW_PER_CAM_TURN * turns)) + 2, by_angle=True)


def order_grid(
    declared: Sequence[float],
    turns: float,
    ratio: float,
    slow: SlowTerms = SlowTerms(),
    *,
    beats: int = BEATS,
) -> Array:
    """Return the orders per input revolution to fit, increasing, shape (orders,).

    For a travel they are those of whole revolutions, or closer than the recording resolves, because its curve is not
    periodic.

    declared: orders per input revolution.
    turns: input revolutions that the recording spans.
    ratio: input revolutions per output revolution.
    slow: terms other than the orders; if these are polynomials, there are no sidebands around 0.
    beats: number of sidebands on each side of a declared order, if the recording resolves them.
    """
    # neighbouring sidebands are one output revolution apart
    spacing = 1 / ratio
    width = BEATS * spacing
    if slow.ridge:
        step = max(spacing, _TRAVEL_GAP / turns)
        width = step * np.ceil(width / step - 1e-9)
    else:
        # a shorter recording resolves only orders that are 1/turns apart
        step = spacing if turns * spacing >= WHOLE_TURN else 1 / turns
    # at least one sideband on each side if the recording is long enough to show slow changes of the error
    resolved_beats = max(int(width / step + 1e-9), int(turns >= _DRIFTING))
    offsets = step * np.arange(1, resolved_beats + 1)
    sidebands = np.concatenate([-offsets[:beats], [0.0], offsets[:beats]])
    # the polynomials represent orders below the first sideband
    around_zero = np.empty(0) if slow.by_angle else offsets
    orders = np.concatenate([around_zero, *(order + sidebands for order in declared)])
    orders = np.sort(orders[orders > 0])
    is_new = np.concatenate([[True], np.diff(orders) > step / 2])  # sidebands of two orders may coincide
    return np.asarray(orders[is_new])


@dataclass(frozen=True, eq=False)
class _Causes:
    """Descriptions of the causes of the orders of a fit.

    fit: fit with its lines.
    gearing: gearing of the drive, None if the ratio is unknown.
    has_drive: whether a drive is given.
    width: largest distance between a fitted order and the order of a product of deviations at which that product counts
    as its cause.
    products: products of deviations at each order, as pairs of degree and description.
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
        # causes within half the distance between fitted orders belong to an order
        width = float(np.diff(fitted).min()) / 2 if len(fitted) > 1 else 0.5
        products: list[list[tuple[int, str]]] = [[] for _ in fit.orders]
        for (k_g, k_b), (order, text) in (known_causes(drive) if drive else {}).items():
            # products without a fitted order close enough are omitted
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
        """Return the causes of a group of orders, the simplest causes in the drive first; empty if there are none."""
        # causes in the drive come first, then those in the test rig, then unresolved components
        causes = self._simplest_products(group)
        if self.gearing:
            causes += self._causes_of_rig(self.fit.orders[group], self.gearing.ratio)
        if np.isin(self.fit.orders[group], self.sidebands).any():
            causes.append(_BEAT_CAUSE)
        elif self.fit.is_line[group].any():
            causes.append(_LINE_CAUSE)
        if causes:
            return "; ".join(dict.fromkeys(causes))
        # without a drive the causes are unknown
        return NO_CAUSE if self.has_drive else ""

    def _simplest_products(self, group: OrderIndices) -> list[str]:
        """Return the products of the lowest degree, which are the largest ones if deviations are small."""
        products = [product for index in group for product in self.products[index]]
        lowest_degree = min((degree for degree, _ in products), default=0)
        return [text for degree, text in products if degree == lowest_degree]

    def _causes_of_rig(self, orders: Array, ratio: float) -> list[str]:
        """Return the causes in the test rig that occur at the given orders."""
        # largest distance between an order and that of a cause, per output revolution
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
    """Return the orders of a fit with their simplest causes, increasing, and each declared order with its sidebands.

    A line and the orders that the recording does not resolve from it are one entry. In a part of an output revolution,
    a line among the sidebands of a declared order counts as one of them, and sidebands that the recording does not
    determine contribute to the uncertainty.

    fit: fit with its lines.
    declared: orders per input revolution, increasing.
    drive: drive whose deviations are the causes, None if it is unknown.
    gearing: gearing of the drive, None if the ratio is unknown.
    """
    ratio = gearing.ratio if gearing else USUAL_RATIO
    is_part = fit.bins.span_on_output(ratio) < WHOLE_TURN * ratio
    # a line this close to an order may be one of its sidebands that a part of a revolution does not resolve
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
    """Return the indices of each declared order and its sidebands in a fit. Orders missing from the fit are omitted."""
    # a sideband belongs to the nearer order
    reach = np.minimum(BEATS / ratio, np.diff(declared).min(initial=1.0) / 2)  # at most half-way to the next order
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
    """Return the measured order that a group of fitted orders represents.

    lines: lines that are not sidebands.
    """
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
    """Return the ratio that the sidebands of a fit show if it differs from that of the drive, otherwise None.

    The error of a drive has sidebands at the same distances from several orders. Lines of a ball pass or of the test
    rig do not form such pairs around declared orders.

    fit: fit with its lines.
    declared: orders per input revolution, increasing.
    ratio: input revolutions per output revolution of the drive.
    """
    # the resolution of the recording is 1/span
    tolerance = _SAME_BEAT / fit.bins.span
    step = 1 / ratio
    distances: dict[tuple[float, bool], float] = {}  # distances of the lines from their orders, by order and side
    for index in np.flatnonzero(fit.is_line):
        line = float(fit.orders[index])
        order = min(declared, key=lambda declared_order: abs(declared_order - line))
        offset = abs(line - order)
        is_of_ratio = abs(offset / step - round(offset / step)) * step <= tolerance
        is_sideband = tolerance < offset <= min(BEATS / ratio, 1 / _LEAST_RATIO) and not is_of_ratio
        if is_sideband and float(fit.amplitude[index]) >= _LEAST_SIDEBAND_SHARE * float(fit.amplitude.max()):
            distances[order, line > order] = offset
    for offset in sorted(distances.values()):
        equal = [distance for distance in distances.values() if abs(distance - offset) <= tolerance]
        if len(equal) >= _FEWEST_BEATS:
            return 1 / float(np.mean(equal))
    return None


@dataclass(frozen=True, eq=False)
class _Sidebands:
    """Distribution of the sidebands of an order over whole output revolutions, given a recording of a part of one.

    numbers: numbers of the sidebands, from -BEATS to BEATS, for the cosines and then for the sines, shape
    (coefficients,).
    mean: mean of the coefficients [arcsec], shape (coefficients,).
    covariance: covariance of the coefficients [arcsec^2], shape (coefficients, coefficients).
    student: factor of an interval relative to a normal distribution, because the size of the sidebands is estimated.
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

        The coefficients c of the cosine and the sine of each sideband have a normal prior. The sidebands next to the
        order have the same size as the order, and each further one has half the size of the previous one. The
        coefficients of the recording are B c plus noise. The common size of c is found by expectation maximisation.
        """
        numbers = np.tile(np.arange(-BEATS, BEATS + 1), 2)
        pair = fit.pair(indices)
        noise = fit.covariance(pair)
        orders = joint.per_cam_rev + numbers[: len(numbers) // 2] / ratio
        projection = fit.design.project(lambda rows: order_columns(fit.bins.turns[rows], orders))[pair]  # matrix B
        share = 4.0 ** -np.maximum(np.abs(numbers) - 1.0, 0)  # share of the variance
        variance = joint.amplitude_arcsec**2 / share.sum() + np.trace(noise)
        for _ in range(_SIZE_ITERATIONS):
            # expectation: the normal distribution of c, given the coefficients and the size
            gain, covariance = _conditional(variance * share, projection, noise)
            mean = gain @ fit.coefficients[pair]
            # maximisation: the size that makes this distribution most likely
            variance = float(np.mean((mean**2 + np.diag(covariance)) / share))
        # degrees of freedom of the estimated size
        freedom = len(numbers) - float((np.diag(covariance) / (variance * share)).sum())
        student = float(stdtrit(max(freedom, 1.0), 0.975)) / COVERAGE_FACTOR
        return cls(
            numbers=numbers,
            mean=mean,
            covariance=covariance,
            student=student,
        )

    def widened(self, order: MeasuredOrder, beats: int) -> MeasuredOrder:
        """Return an order with its uncertainty over whole output revolutions.

        beats: number of sidebands on each side that belong to the order.
        """
        margin = self.margin_arcsec(order.amplitude_arcsec, beats)
        uncertainty = float(np.hypot(order.uncertainty_arcsec, margin))
        if COVERAGE_FACTOR * uncertainty > _RESOLVED_SHARE * order.amplitude_arcsec:
            return replace(order, is_of_record=True)
        return replace(order, uncertainty_arcsec=uncertainty)

    def margin_arcsec(self, amplitude_arcsec: float, beats: int) -> float:
        """Return the possible difference between the amplitude including sidebands and that in the recording [arcsec].

        beats: number of sidebands on each side that are included.
        """
        # sidebands that are included; the order itself has number 0
        is_part = np.abs(self.numbers) <= beats
        mean = self.mean[is_part]
        covariance = self.covariance[is_part][:, is_part]
        # root of the expected sum of squares of all sidebands
        size = float(np.sqrt(mean @ mean + np.trace(covariance)))
        # variance of a quadratic form in normal variables
        variance_of_square = 2 * np.trace(covariance @ covariance) + 4 * mean @ covariance @ mean
        scatter = float(np.sqrt(variance_of_square)) / (2 * size)
        return float(_UNSEEN_FACTOR * self.student * np.hypot(size - amplitude_arcsec, scatter))


def _conditional(
    variances: Array,
    projection: Array,
    noise: Array,
) -> tuple[Array, Array]:
    """Return the conditional distribution of normal variables c given B c + noise: gain (n, m) and covariance (n, n).

    variances: prior variances of the independent variables, shape (n,).
    projection: matrix B, shape (m, n).
    noise: covariance of the noise, shape (m, m).
    """
    # lstsq instead of an inverse, because the matrix may be singular without noise
    prior = projection * variances
    gain = np.linalg.lstsq(prior @ projection.T + noise, prior, rcond=None)[0].T
    return np.asarray(gain), np.diag(variances) - gain @ prior


@dataclass(frozen=True)
class UncertaintySource:
    """A source of uncertainty: its name, its standard uncertainty [arcsec] (None if not stated), and its origin."""

    name: str
    arcsec: float | None
    origin: str


def parse_stated(texts: Sequence[str]) -> dict[str, float]:
    """Return stated standard uncertainties [arcsec] by source, from texts such as "encoder=0.5,coupling=0".

    Raises UsageError if a text does not have this form, or if a source is unknown or stated twice.
    """
    stated: dict[str, float] = {}
    # the option may be repeated, or list several sources
    for text in ",".join(texts).split(",") if texts else ():
        name, _, number = text.partition("=")
        value = number_of(number)
        if name not in STATED or name in stated or not 0 <= value <= LARGEST_UNCERTAINTY:
            message = f"invalid --budget {text}: expected NAME=ARCSEC, from 0 to {LARGEST_UNCERTAINTY:g}"
            if name in stated:
                message = f"--budget {name} is given more than once"
            hint = f"state a standard uncertainty of F'_ior; NAME is one of {', '.join(STATED)}"
            raise UsageError(message, hint)
        stated[name] = value
    return stated


def resolution_source(trace: MeasuredTrace, scatter: float) -> UncertaintySource:
    """Return the source of uncertainty due to the step of a recording's readings.

    Counts at uneven angles are dithered, and so are steps below twice the scatter. Counts of the input at even angles
    are an exception, because noise of the output does not change them. A rounded value has the standard uncertainty
    step/sqrt(12). If the readings are synchronous with the revolutions, the fit follows the rounding and both extremes
    of a range may err together, hence the factor 2. Otherwise they err independently, hence the factor sqrt(2).

    scatter: standard deviation of single readings [arcsec].
    """
    # standard deviation of a uniform distribution over a step
    rounding = trace.step_arcsec / sqrt(12)
    # scatter over more than half a step averages out its rounding
    if trace.dithered or trace.step_arcsec / 2 < scatter:
        if trace.in_time and trace.cam_step_arcsec:
            by_input = 2 * trace.cam_step_arcsec / sqrt(12)
            return UncertaintySource("resolution", by_input, "input counts, with sampling at even angles")
        return UncertaintySource("resolution", 0.0, "quantization masked by noise")
    if trace.in_time:
        # at even angles, rounding repeats from revolution to revolution, and the extremes may err in opposite
        # directions
        return UncertaintySource("resolution", 2 * rounding, "quantization of the readings, at even angles")
    # the rounding of the two extremes is independent
    return UncertaintySource("resolution", sqrt(2) * rounding, "quantization of the readings")


def stated_sources(stated: Mapping[str, float]) -> tuple[UncertaintySource, ...]:
    """Return the sources that a single recording cannot show, with their stated standard uncertainties [arcsec]."""
    sources = []
    for name, effect in STATED.items():
        # an unstated source is listed as well, so that it is not mistaken for zero
        origin = "stated" if name in stated else f"not stated; {effect}"
        sources.append(UncertaintySource(name, stated.get(name), origin))
    return tuple(sources)


def combined(sources: Sequence[UncertaintySource]) -> float:
    """Return the combined standard uncertainty [arcsec] of the sources that have a value."""
    return sqrt(sum(source.arcsec**2 for source in sources if source.arcsec is not None))


@dataclass(frozen=True)
class Range:
    """Range of a fitted curve [arcsec] with its bias and uncertainty.

    fitted: range of the fitted curve.
    bias: bias due to noise.
    spread: standard uncertainty due to noise.
    rise: possible increase by spectral lines if their phases relative to the orders differ, as in another cycle.
    others: standard uncertainty due to all sources except noise.
    """

    fitted: float
    bias: float
    spread: float
    rise: float
    others: float

    @property
    def value(self) -> float:
        """The range minus its bias."""
        return self.fitted - self.bias

    def at_most(self, arcsec: float) -> Range:
        """Return the range limited to a largest value, because a lower bound is at most the range of the readings."""
        return replace(self, fitted=min(self.fitted, arcsec + self.bias))

    @property
    def bias_uncertainty(self) -> float:
        """The standard uncertainty of the correction."""
        return BIAS_SHARE * self.bias

    @property
    def uncertainty(self) -> float:
        """The combined standard uncertainty."""
        return hypot(self.spread, self.bias_uncertainty, self.others)

    @property
    def interval(self) -> tuple[float, float]:
        """The range minus and plus its expanded uncertainty, with the rise added to the upper end."""
        reach = COVERAGE_FACTOR * self.uncertainty
        # lines may add up in another cycle, which affects only the upper end
        return max(0.0, self.value - reach), self.value + self.rise + reach


@dataclass(frozen=True)
class FullCycle:
    """F'_ior of the full cycle from the model of a recording.

    value_arcsec: best estimate; if only a part of the cycle was recorded, that of the range of this part.
    interval_arcsec: 95 % interval, whose lower end refers to the covered angles and whose upper end to the cycle.
    standard_uncertainty_arcsec: uncertainty of the value from the model, without the other sources of the budget.
    at_least_arcsec: largest limit that F'_ior exceeds with a probability of 95 %.
    at_most_arcsec: smallest limit that F'_ior meets with a probability of 95 %; None if too little of the cycle was
    recorded to pass a drive.
    record_next_rev: part of the cycle whose recording would narrow the interval most, as input revolutions of the
    recorded angles modulo the cycle; None if there is none.
    effective_samples: effective sample size of the range.
    """

    value_arcsec: float
    interval_arcsec: tuple[float, float]
    standard_uncertainty_arcsec: float
    at_least_arcsec: float
    at_most_arcsec: float | None
    record_next_rev: tuple[float, float] | None
    effective_samples: float


def visited_angles(fit: TraceFit) -> tuple[Array, int]:
    """Return the points of a fine grid of input angles where a fit determines the error, and the points per revolution.

    The points are integers, increasing, shape (points,). They lie between readings that are close enough to follow the
    highest declared order. Larger gaps up to _BRIDGED_TURNS (_BRIDGED_IN_CYCLE for whole output revolutions) also count
    if the fit determines the curve in the gap about as well as at the readings.
    """
    slow = fit.design.slow
    bins = fit.bins
    longest_gap = _BRIDGED_TURNS if slow.by_angle or slow.ridge else _BRIDGED_IN_CYCLE
    # between readings this close, no fitted order can hide an extreme
    followed_gap = GAP_PERIODS / float(fit.orders[~fit.is_line][-1])
    per_turn = _POINTS_PER_PERIOD * int(np.ceil(fit.orders[-1]))
    # a sample of the readings is used, because all readings of a long recording would take seconds
    usual_spread = float(np.median(_spread(fit, bins.turns[:: max(1, len(bins) // _SPREAD_PLACES)])))
    visited = []
    for turns in bins.by_sweep(bins.turns):
        gaps = np.diff(turns)
        is_determined = gaps <= followed_gap
        bridged = np.flatnonzero(~is_determined & (gaps <= longest_gap))
        if len(bridged):
            middles = turns[bridged] + gaps[bridged] / 2
            # a wider gap counts as covered if other revolutions determine the curve there
            is_determined[bridged] = _spread(fit, middles) <= _BRIDGED_SPREAD * usual_spread
        grid = np.arange(np.ceil(turns[0] * per_turn), np.floor(turns[-1] * per_turn) + 1)
        # an angle lies in the gap before the next reading
        next_reading = np.clip(np.searchsorted(turns, grid / per_turn), 1, len(turns) - 1)
        visited.append(grid[is_determined[next_reading - 1]])
    return np.unique(np.concatenate(visited)), per_turn


def _spread(fit: TraceFit, turns: Array) -> Array:
    """Return the standard deviation of a fitted curve due to noise [arcsec], shape (angles,).

    turns: input angles [revolutions], shape (angles,).
    """
    spreads = []
    # the angles are processed in chunks, because the design of a long recording does not fit into memory
    for start in range(0, len(turns), DESIGN_CHUNK):
        errors = order_columns(turns[start : start + DESIGN_CHUNK], fit.orders) @ fit.factor
        spreads.append(np.linalg.norm(errors, axis=1))
    return np.concatenate(spreads)


def image_change(
    fit: TraceFit,
    turns: Array,
    *,
    is_likely: bool = False,
) -> float:
    """Return the largest change of a range [arcsec] if fitted orders are images of higher ones.

    With N evenly spaced readings per revolution, order N - n appears as order n. Each declared order with its
    sidebands, and all of them together, are replaced by their images up to _HIGHEST_IMAGE.

    turns: covered input angles [revolutions], shape (angles,).
    is_likely: whether only images with a usual size comparable to that of the order are considered.
    """
    # at even angles, an order and `rate` minus that order have the same readings
    rate, start, evenness = even_readings(fit.bins)
    declared = np.rint(fit.orders)
    # a declared order is hidden with all of its sidebands or not at all
    is_hidden = (rate - declared > declared) & (rate - declared <= _HIGHEST_IMAGE)
    if is_likely:
        is_hidden &= np.array([likely_image(fit, order) is not None for order in declared.tolist()])
    if evenness < EVEN or not is_hidden.any():
        return 0.0
    turns = np.concatenate([turns, turns + 1 / (2 * _POINTS_PER_PERIOD * fit.orders[-1])])  # images need a finer grid
    # the first column replaces all hidden orders, each further column those of one declared order
    is_replaced = np.column_stack(
        [is_hidden, *(is_hidden & (declared == order) for order in np.unique(declared[is_hidden]))]
    )
    # complex amplitude: a cos(p) + b sin(p) = Re((a - i b) exp(i p))
    amplitudes = fit.coefficients.reshape(2, -1).T @ [1, -1j]
    # images are reflected about the first reading, where order and image agree in phase
    image_amplitudes = amplitudes * np.exp(2j * np.pi * rate * start)
    real, imaginary, remaining, fitted = _replaced_curves(fit, turns, image_amplitudes, is_replaced)
    # the image of an order with the complex curve c is Re(exp(2 pi i rate t) conj(c))
    phase = 2 * np.pi * rate * turns[:, None]
    ranges = np.ptp(np.cos(phase) * real + np.sin(phase) * imaginary + remaining, axis=0)
    return float(np.abs(ranges - np.ptp(fitted)).max())


def likely_image(fit: TraceFit, order: float) -> int | None:
    """Return the higher order that the readings and the usual sizes do not distinguish from a fitted order, or None.

    N evenly spaced readings per revolution do not distinguish order n from order N - n. Only an order up to 16, and of
    a usual size that is comparable, is likely.

    order: fitted order per input revolution.
    """
    rate, _, evenness = even_readings(fit.bins)
    readings = round(rate)
    lower = round(order)
    image = readings - lower
    is_same = evenness >= EVEN and abs(rate - readings) * fit.bins.span < _SAME_IMAGE
    if not is_same or not 0 < lower < image <= ALWAYS_ORDER:
        return None
    return image if ORDER_PROFILE[image] >= _LIKELY_IMAGE * ORDER_PROFILE[lower] else None


def _replaced_curves(
    fit: TraceFit,
    turns: Array,
    amplitudes: NDArray[np.complex128],
    is_replaced: NDArray[np.bool_],
) -> tuple[Array, Array, Array, Array]:
    """Return curves in which some orders are replaced [arcsec], from one set of columns, which take most of the time.

    The curves are the real and the imaginary part of the complex curves of the replaced orders, the sums of the
    remaining orders, all of shape (angles, replacements), and the fitted curve, shape (angles, 1).

    turns: input angles [revolutions], shape (angles,).
    amplitudes: complex amplitudes of the replaced orders [arcsec], shape (orders,).
    is_replaced: whether each order is replaced, shape (orders, replacements).
    """
    replaced = amplitudes[:, None] * is_replaced
    coefficients = [
        np.concatenate([replaced.real, -replaced.imag]),
        np.concatenate([replaced.imag, replaced.real]),
        np.tile(~is_replaced, (2, 1)) * fit.coefficients[:, None],
        fit.coefficients[:, None],
    ]
    curves = curve_of(np.concatenate(coefficients, axis=1), fit.orders, turns)
    real, imaginary, remaining = np.split(curves[:, :-1], 3, axis=1)
    return real, imaginary, remaining, curves[:, -1:]


@dataclass(frozen=True)
class CurveRanges:
    """Ranges of a fitted curve, and its largest slope.

    visited: range over all covered angles.
    revolution: largest range within one input revolution.
    cam: range of the orders of the input, without slow terms of the output.
    slope: largest slope [arcsec per input revolution]; for a travel, its ends are excluded.
    """

    visited: Range
    revolution: Range
    cam: Range
    slope: Range


@dataclass(frozen=True)
class OtherUncertainties:
    """Standard uncertainties of the ranges of a curve [arcsec] due to all sources except noise."""

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
    """Return the ranges of a fitted curve over angles, and its largest slope, with their bias and spread due to noise.

    fit: fit of a direction.
    turns: input angles [revolutions], increasing, shape (angles,).
    rng: random generator of the parametric bootstrap.
    others: standard uncertainties of the ranges due to all sources except noise.
    whole: whether the angles cover the full cycle; if they do, lines may increase the range in other cycles.
    draws: number of bootstrap draws.
    """
    curves = _bootstrap_curves(fit, rng, draws)
    extremes = _extremes_of(fit, turns, curves)
    # possible contribution of lines in another cycle, if the whole cycle is recorded
    lines = 0.0
    if whole:
        is_line = fit.is_line | fit.unresolved
        # a line may have any phase, so its contribution is its peak-to-peak value, twice its amplitude
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
    """Return the coefficients of curves for `_range` and `_slope_coefficients` [arcsec], shape (2 orders, 3 + draws).

    The curves are the fitted one, the fitted one without lines, the fitted one shrunk by its share of noise, and the
    shrunk one with simulated noise.
    """
    # the parametric bootstrap draws errors of the coefficients with their covariance
    noise = fit.factor @ rng.standard_normal((fit.factor.shape[1], draws))
    # the draws are centred on a curve without the power of noise, so that noise counts only once
    shrunk = fit.coefficients * np.tile(_kept_shares(fit), 2)
    is_line = np.tile(fit.is_line | fit.unresolved, 2)
    without_lines = np.where(is_line, 0.0, fit.coefficients)
    fitted = np.stack([fit.coefficients, without_lines, shrunk], axis=1)
    return np.concatenate([fitted, shrunk[:, None] + noise], axis=1)


def _slope_coefficients(orders: Array, curves: Array) -> Array:
    """Return the coefficients of the slopes of curves [arcsec per input revolution], shape (2 orders, slopes).

    The columns have the order that `_range` expects. Lines count in a slope, so the fitted curve replaces the curve
    without lines.
    """
    # the second column, the curve without lines, is replaced by the fitted curve
    columns = [0, 0, *range(2, 3 + _SLOPE_DRAWS)]
    cosines, sines = curves[:, columns].reshape(2, len(orders), -1)
    # derivative: the sines of the curve become cosines, and the cosines become negative sines
    return np.asarray((2 * np.pi * np.tile(orders, 2))[:, None] * np.concatenate([sines, -cosines]))


class _Extremes:
    """Extremes of curves over angles, accumulated over successive parts of the angles.

    high, low: extremes in each part of an input revolution [arcsec], shape (parts, curves).
    cam_high, cam_low: extremes of the orders of the input over all angles [arcsec], shape (curves,).
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
        """Add values of the curves at further angles.

        part: number of the part of a revolution that contains each angle, increasing, shape (angles,).
        values: values of the curves [arcsec], shape (angles, curves).
        """
        # the rows of one part are contiguous, so reduceat processes them together
        parts, first = np.unique(part, return_index=True)
        self.high[parts] = np.maximum(self.high[parts], np.maximum.reduceat(values, first))
        self.low[parts] = np.minimum(self.low[parts], np.minimum.reduceat(values, first))

    def add_cam_values(self, values: Array) -> None:
        """Add values of the orders of the input [arcsec], shape (angles, curves)."""
        self.cam_high = np.maximum(self.cam_high, values.max(axis=0))
        self.cam_low = np.minimum(self.cam_low, values.min(axis=0))

    def add_slopes(self, slopes: Array) -> None:
        """Add slopes [arcsec per input revolution], shape (angles, slopes); the number of angles may be 0."""
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
    """Return the extremes of curves at angles.

    turns: angles [revolutions], increasing, shape (angles,).
    curves: coefficients of the curves [arcsec], shape (2 orders, curves).
    """
    slopes = _slope_coefficients(fit.orders, curves)
    is_slow = np.tile(fit.is_slow, 2)
    margin = _SLOPE_ENDS if fit.design.slow.ridge else 0.0
    # polynomials bend at the ends of a travel, where no further reading constrains them
    is_inner = np.minimum(turns - turns[0], turns[-1] - turns) >= margin
    # 1e-6 assigns an angle at the edge of a part to the later part in spite of rounding
    part = np.floor(turns * _TURN_PARTS + 1e-6).astype(np.int64)
    part -= part[0]
    extremes = _Extremes(
        parts=int(part[-1]) + 1,
        curves=curves.shape[1],
        slopes=slopes.shape[1],
    )
    for start in range(0, len(turns), _EXTREMES_CHUNK):
        rows = slice(start, start + _EXTREMES_CHUNK)
        columns = order_columns(turns[rows], fit.orders)
        values = columns @ curves
        extremes.add_values(part[rows], values)
        # only the orders of the input count, because slow orders belong to the output revolution
        extremes.add_cam_values(values - columns[:, is_slow] @ curves[is_slow])
        inner_columns = columns if is_inner[rows].all() else columns[is_inner[rows]]
        extremes.add_slopes(inner_columns @ slopes)
    return extremes


def _kept_shares(fit: TraceFit) -> Array:
    """Return the share of each order that is not noise, shape (orders,).

    For a travel, an order and its sidebands have one common share.
    """
    noise = (fit.factor**2).sum(axis=1).reshape(2, -1).sum(axis=0)  # noise power of each order, arcsec^2
    power = fit.amplitude**2
    # unresolved orders have large coefficients that cancel, so only the power of their joint curve is meaningful
    if fit.design.slow.ridge:
        turns = fit.bins.turns[:: max(1, len(fit.bins) // _SPREAD_PLACES)]
        columns = order_columns(turns, fit.orders)
        nearest = np.rint(fit.orders)
        for order in np.unique(nearest):
            is_in = nearest == order
            pair = np.tile(is_in, 2)
            power[is_in] = np.mean((columns[:, pair] @ fit.coefficients[pair]) ** 2)
            noise[is_in] = np.mean(((columns[:, pair] @ fit.factor[pair]) ** 2).sum(axis=1))
    # orders that are nearly linearly dependent cannot be shrunk individually
    elif fit.design.condition > _CORRELATED:
        return np.ones(len(power))
    # twice the noise power is subtracted, so that an order that is only noise becomes 0
    return np.asarray(np.maximum(0.0, 1 - _SHRINK * noise / np.maximum(power, 1e-300)))


def _range(
    extents: Array,
    lines: float,
    others: float,
) -> Range:
    """Return a range from the ranges of the curves of `_bootstrap_curves`.

    extents: ranges of the curves [arcsec], shape (curves,).
    lines: range that lines add if their extremes coincide with those of the curve [arcsec].
    others: standard uncertainty due to all sources except noise [arcsec].
    """
    fitted, without_lines, shrunk = extents[:3].tolist()
    drawn = extents[3:]
    return Range(
        fitted=fitted,
        # noise widens a range, so a negative difference is due to chance
        bias=max(0.0, float(drawn.mean()) - shrunk),
        spread=_SPREAD_FACTOR * float(drawn.std(ddof=1)),
        rise=max(0.0, without_lines + lines - fitted) if lines else 0.0,
        others=others,
    )
