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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, sqrt

import numpy as np
from scipy.special import stdtrit

from hdassist.error.waves import NO_CAUSE, known_causes
from hdassist.errors import UsageError
from hdassist.files import number_of
from hdassist.measuring.fit import COVERAGE_FACTOR, EVEN, OrderIndices, TraceFit, distance, even_readings
from hdassist.measuring.terms import DESIGN_CHUNK, SlowTerms, curve_of, order_columns
from hdassist.model.geometry import Array, Kinematics
from hdassist.preset.fields import Drive
from hdassist.readers.trace import MeasuredTrace

_FULL_CYCLE_DEG = 720.0  # of the output, at most
_LEAST_RATIO, _GREATEST_RATIO = 10.0, 1000.0
_RATIO_ROUNDING = 1e-9
FULL_SHARE = 0.95  # share from which the cycle counts as visited
DEFAULT_ORDERS = tuple(float(order) for order in range(1, 13))
_HIGHEST_ORDER = 200.0
BEATS = 6
_SLOW_ORDERS, _SLOW_PER_CAM_TURN = 12, 0.2  # periods of slow terms in a turn, at most: of the output and of the cam
USUAL_RATIO = 100.0  # assumed for the width of the beats where none is known
_DRIFTING = 4.0  # cam turns: from here on one order to either side stands for beats that change the error slowly
_SIZE_ITERATIONS = 8  # of the size of beats that a record leaves open
_UNSEEN_FACTOR = 2.5  # ovals of both wheels cancel more often than beats that are drawn: found with solved cycles
WHOLE_TURN = 0.97  # of an output turn: a record that has its beats
_TRAVEL_GAP = 0.6  # of the resolution, between orders of a travel
_TRAVEL_RIDGE = 1e-7  # of the normal equations: in the travel, the curve moves by less than its noise
_LINE_CAUSE = "no order of the drive, or not resolved from an order: ball pass, cage, test rig"
_BEAT_CAUSE = "sidebands of an order, or a line: a part of an output revolution does not resolve them"
LINE_WIDTH = 1.5  # of the resolution, to either side: a wave's own peak
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
SCATTER = ("noise", "bias correction")  # sources of the range of fitted orders, by its readings alone
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
_SAME_BEAT = 0.2  # of the resolution: distances of beats from their orders that are the same
_CLEAR_BEAT = 0.05  # of the greatest amplitude: least beat that shows a ratio
_FEWEST_BEATS = 3  # beats at the same distance that show a ratio
_CORRELATED = 1e3  # condition of the normal equations: beyond, orders cannot be shrunk one by one


@dataclass(frozen=True)
class Gearing:
    """Cam turns per output turn (without sign), of the full cycle, and of the travel, where that is less.

    travel: None where the drive turns through its full cycle.
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
    """Gearing of a drive, or of a drive with two waves by its ratio; None where neither is known.

    Raises UsageError: both are given, or no ratio that a drive with two waves can have.
    """
    if drive is not None:
        if ratio is not None:
            raise UsageError("--ratio cannot be combined with --drive, which states the ratio", "leave out --ratio")
        kinematics = Kinematics.of(drive)
        return Gearing(abs(kinematics.u), kinematics.cycle_cam_revolutions)
    if ratio is None:
        return None
    ratio = abs(ratio)
    doubled = round(2 * ratio) if ratio <= _GREATEST_RATIO else 0
    if not _LEAST_RATIO <= ratio <= _GREATEST_RATIO or abs(2 * ratio - doubled) > _RATIO_ROUNDING:
        hint = "give half the number of teeth of the moving wheel, for example 100 or 99.5"
        span = f"from {_LEAST_RATIO:g} to {_GREATEST_RATIO:g}"
        raise UsageError(f"invalid --ratio {ratio:g}: expected a multiple of 0.5 {span}", hint)
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
    """Declared orders per cam turn, rising, from a text like "1-12" or "1,2,4"; None where there is none.

    Raises UsageError: no such text, or orders beyond 0 to 200.
    """
    if text is None:
        return None
    orders: set[float] = set()
    for part in text.split(","):
        match = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]+)?)\s*(?:-\s*([0-9]+)\s*)?", part)
        if match is None:
            raise UsageError(f"invalid --orders {text}: expected orders", 'like "1-12" or "1,2,4"')
        first, last = float(match[1]), float(match[2] or match[1])
        if not 0 < first <= last <= _HIGHEST_ORDER or (match[2] and not first.is_integer()):
            raise UsageError(f"invalid --orders {text}: expected rising orders above 0, up to {_HIGHEST_ORDER:g}")
        orders.update(np.arange(first, last + 0.5).tolist() if match[2] else [first])
    return tuple(sorted(orders))


def slow_terms(turns: float, ratio: float, degree: int, *, is_travel: bool = False) -> SlowTerms:
    """Slow terms of a record over turns of the cam: a drift of a degree, or more where it is part of an output turn.

    There a drift and the orders of the output, up to SLOW_ORDERS a turn of it, look alike, and polynomials stand for
    both, unless the record is all of the travel: then slow terms are error, and all orders are those of whole turns.
    """
    if is_travel:
        return SlowTerms(degree, ridge=_TRAVEL_RIDGE)
    part = turns / ratio
    if turns < _DRIFTING or part >= WHOLE_TURN:
        return SlowTerms(degree)
    return SlowTerms(round(2 * min(_SLOW_ORDERS * part, _SLOW_PER_CAM_TURN * turns)) + 2, by_angle=True)


def order_grid(
    declared: Sequence[float],
    turns: float,
    ratio: float,
    slow: SlowTerms = SlowTerms(),
    *,
    beats: int = BEATS,
) -> Array:
    """Orders per cam turn to fit, rising, shape (orders,).

    Arguments: declared orders; turns of the cam that the record spans; ratio; slow terms beside them; beats to either
    side of the declared orders, as far as the record resolves them, and all of them around 0 unless slow terms
    are there. In a travel they are those of whole turns, or nearer than the record resolves: its curve has no period.
    """
    base = 1 / ratio
    width = BEATS * base
    if slow.ridge:
        step = max(base, _TRAVEL_GAP / turns)
        width = step * np.ceil(width / step - 1e-9)
    else:
        step = base if turns * base >= WHOLE_TURN else 1 / turns
    count = np.arange(1, max(int(width / step + 1e-9), int(turns >= _DRIFTING)) + 1)
    beside = step * count[:beats]
    around = np.concatenate([-beside, [0.0], beside])
    every = np.concatenate([[] if slow.by_angle else step * count, *(order + around for order in declared)])
    every = np.sort(every[every > 0])
    return np.asarray(every[np.concatenate([[True], np.diff(every) > step / 2])])


def order_tables(
    fit: TraceFit, declared: Sequence[float], drive: Drive | None, gearing: Gearing | None
) -> tuple[tuple[MeasuredOrder, ...], tuple[MeasuredOrder, ...]]:
    """Orders of a fit with their simplest causes, rising; and each declared order with its beats, as one wave.

    A line and the orders that the record does not resolve from it are one entry. Over a part of an output turn a line
    among the beats of a declared order is none, and the beats that it leaves open are part of the uncertainty.
    """
    orders, span, ratio = fit.orders, fit.bins.span, gearing.ratio if gearing else USUAL_RATIO
    is_part = fit.bins.span_on_output(ratio) < WHOLE_TURN * ratio
    fitted = orders[~fit.is_line]
    width = float(np.diff(fitted).min()) / 2 if len(fitted) > 1 else 0.5
    is_beat = is_part & (distance(fit.lines, np.asarray(declared)) <= BEATS / ratio + LINE_WIDTH / span)
    causes: list[list[tuple[int, str]]] = [[] for _ in orders]
    for (k_g, k_b), (order, words) in (known_causes(drive) if drive else {}).items():
        place = int(np.abs(orders - order).argmin())
        if abs(orders[place] - order) <= width + 1e-9:
            causes[place].append((abs(k_g) + abs(k_b), words))

    def cause(own: OrderIndices) -> str:
        known = [each for place in own for each in causes[place]]
        words = [text for degree, text in known if degree == min(known)[0]]
        if gearing:
            reach = min(width * ratio, 0.5)
            words += [text for often, text in _RIG_CAUSES.items() if (abs(orders[own] * ratio - often) < reach).any()]
            words += [_CAM_CAUSE] * bool((abs(orders[own] - 1) < 1e-9).any())
        if np.isin(orders[own], fit.lines[is_beat]).any():
            words.append(_BEAT_CAUSE)
        elif fit.is_line[own].any():
            words.append(_LINE_CAUSE)
        return "; ".join(dict.fromkeys(words)) or (NO_CAUSE if drive else "")

    table = [
        MeasuredOrder(*fit.wave(own), cause(own), bool(np.isin(orders[own], fit.lines[~is_beat]).any()))
        for own in fit.groups
    ]
    together = []
    for order in declared:
        off = np.abs(orders - order)
        near = off <= np.minimum(BEATS / ratio, np.diff(declared).min(initial=1.0) / 2) + 1e-9
        if not len(own := np.flatnonzero(near & ~fit.is_slow)):
            continue
        joint = MeasuredOrder(order, *fit.joint_wave(own)[1:], "")
        place = next((k for k, group in enumerate(fit.groups) if off.argmin() in group), 0)
        if is_part:
            widened = _over_whole_turns(fit, own, joint, ratio)
            joint, table[place] = widened(joint, BEATS), widened(table[place], 0)
        together.append(replace(joint, cause=table[place].cause))
    return tuple(table), tuple(together)


def other_ratio(fit: TraceFit, declared: Sequence[float], ratio: float) -> float | None:
    """Return the ratio that the beats of a fit show, if it is another one than that of the drive; else None.

    The error of a drive has beats at the same distances from several orders. Lines of a ball pass or of the rig do not
    come in such pairs around declared orders.

    fit: with its lines; declared: orders per cam turn, rising; ratio: cam turns in an output turn of the drive.
    """
    within, step = _SAME_BEAT / fit.bins.span, 1 / ratio
    beats: dict[tuple[float, bool], float] = {}  # distance from its order, by the order and the side
    for place in np.flatnonzero(fit.is_line):
        line, size = float(fit.orders[place]), float(fit.amplitude[place])
        order = min(declared, key=lambda each: abs(each - line))
        away = abs(line - order)
        is_own = abs(away / step - round(away / step)) * step <= within
        is_beat = within < away <= min(BEATS / ratio, 1 / _LEAST_RATIO) and not is_own
        if is_beat and size >= _CLEAR_BEAT * float(fit.amplitude.max()):
            beats[order, line > order] = away
    for away in sorted(beats.values()):
        alike = [other for other in beats.values() if abs(other - away) <= within]
        if len(alike) >= _FEWEST_BEATS:
            return 1 / float(np.mean(alike))
    return None


def _over_whole_turns(
    fit: TraceFit, own: OrderIndices, joint: MeasuredOrder, ratio: float
) -> Callable[[MeasuredOrder, int], MeasuredOrder]:
    """Return orders of a part of an output revolution with the uncertainty of their amplitude over whole revolutions.

    Arguments: positions of an order and its sidebands in a fit, which form a joint component over the recording.
    Cosine and sine of each sideband c are drawn from a normal distribution. The sidebands next to the order are as
    large as the order itself, and each further one is half as large as the one before. The coefficients of the
    recording are B c and noise. Their common size is found by expectation and maximisation.
    """
    away = np.tile(np.arange(-BEATS, BEATS + 1), 2)
    pair = fit.pair(own)
    beats, turns = joint.per_cam_rev + away[: len(away) // 2] / ratio, fit.bins.turns
    record = fit.design.project(lambda rows: order_columns(turns[rows], beats))[pair]
    noise = fit.covariance(pair)
    share = 4.0 ** -np.maximum(np.abs(away) - 1.0, 0)
    variance = joint.amplitude_arcsec**2 / share.sum() + np.trace(noise)
    for _ in range(_SIZE_ITERATIONS):
        prior = record * (variance * share)
        gain = np.linalg.lstsq(prior @ record.T + noise, prior, rcond=None)[0].T
        mean, covariance = gain @ fit.coefficients[pair], np.diag(variance * share) - gain @ prior
        variance = float(np.mean((mean**2 + np.diag(covariance)) / share))
    freedom = len(away) - float((np.diag(covariance) / (variance * share)).sum())  # of that size
    student = float(stdtrit(max(freedom, 1.0), 0.975)) / COVERAGE_FACTOR

    def widened(order: MeasuredOrder, beats: int) -> MeasuredOrder:
        kept = np.abs(away) <= beats
        centre, spread = mean[kept], covariance[kept][:, kept]
        size = float(np.sqrt(centre @ centre + np.trace(spread)))
        scatter = float(np.sqrt(2 * np.trace(spread @ spread) + 4 * centre @ spread @ centre)) / (2 * size)
        room = _UNSEEN_FACTOR * student * np.hypot(size - order.amplitude_arcsec, scatter)
        uncertainty = float(np.hypot(order.uncertainty_arcsec, room))
        if uncertainty > order.amplitude_arcsec:
            return replace(order, is_of_record=True)
        return replace(order, uncertainty_arcsec=uncertainty)

    return widened


@dataclass(frozen=True)
class UncertaintySource:
    """One source: its name, its standard uncertainty [arcsec] (None if not stated), and its origin."""

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
        if name not in STATED or name in stated or not 0 <= value <= LARGEST_UNCERTAINTY:
            expected = (
                "state each source only once" if name in stated else f"NAME=ARCSEC, from 0 to {LARGEST_UNCERTAINTY:g}"
            )
            hint = f"a standard uncertainty of F'_ior, NAME one of {', '.join(STATED)}"
            raise UsageError(f"invalid --budget {text}: expected {expected}", hint)
        stated[name] = value
    return stated


def resolution_source(trace: MeasuredTrace, scatter: float) -> UncertaintySource:
    """Source of the step of a trace's readings; scatter of single readings [arcsec].

    Counts at uneven angles are dithered, and a step below twice the scatter, but for counts of the cam at even angles,
    as noise of the output does not move them. In time with the turns the fit follows the rounding, and both extremes of
    a range may err together: hence 2; else by themselves: hence sqrt(2).
    """
    unit = trace.step_arcsec / sqrt(12)
    if trace.dithered or trace.step_arcsec / 2 < scatter:
        if trace.in_time and trace.cam_step_arcsec:
            return UncertaintySource(
                "resolution", 2 * trace.cam_step_arcsec / sqrt(12), "counts of the input at even angles"
            )
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
    """Places of a fine grid of cam angles whose error a fit tells, rising, and the places in a turn.

    They lie between readings that follow its highest declared order, or at most BRIDGED_TURNS apart (of whole output
    turns BRIDGED_IN_CYCLE) where the fit knows the curve between about as surely as at the readings.
    """
    slow = fit.design.slow
    longest = _BRIDGED_TURNS if slow.by_angle or slow.ridge else _BRIDGED_IN_CYCLE
    bins, wide = fit.bins, GAP_PERIODS / float(fit.orders[~fit.is_line][-1])
    per_turn = _POINTS_PER_PERIOD * int(np.ceil(fit.orders[-1]))
    usual = float(np.median(_spread(fit, bins.turns[:: max(1, len(bins) // _SPREAD_PLACES)])))
    visited = []
    for turns in bins.by_sweep(bins.turns):
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
    image, order = rate - fit.orders, np.rint(fit.orders)
    hidden = (rate - order > order) & (rate - order <= _HIGHEST_IMAGE)  # an order with all of its beats, or none
    if evenness < EVEN or not hidden.any():
        return 0.0
    turns = np.concatenate([turns, turns + 1 / (2 * _POINTS_PER_PERIOD * fit.orders[-1])])  # images are finer
    taken = np.column_stack([hidden, *(hidden & (order == n) for n in np.unique(order[hidden]))])
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
    line = fit.is_line | fit.unresolved
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
