"""Full cycle of a measured drive, orders to which its trace is limited, and the table of those that were found.

Deviations of the wheel that turns with the output beat with those that stand still, so around each declared order n the
error has orders n + k/ratio. BEATS of them to either side hold a model's error over the full cycle to about 1 % of its
range. A record of T cam turns resolves orders 1/T apart: of closer ones, fewer stand for all.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from hdassist.error.trace import NO_CAUSE, known_causes
from hdassist.errors import UsageError
from hdassist.measuring.fit import COVERAGE_FACTOR, OrderIndices, SlowTerms, TraceFit, distance, order_columns
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.preset.fields import Drive

_FULL_CYCLE_DEG = 720.0  # of the output, at most
_LEAST_RATIO, _GREATEST_RATIO = 10.0, 1000.0
_RATIO_ROUNDING = 1e-9
FULL_SHARE = 0.95  # share from which the cycle counts as visited
DEFAULT_ORDERS = tuple(float(order) for order in range(1, 13))
_HIGHEST_ORDER = 200.0
_BEATS = 6
_SLOW_ORDERS, _SLOW_PER_CAM_TURN = 12, 0.2  # periods of slow terms in a turn, at most: of the output and of the cam
USUAL_RATIO = 100.0  # assumed for the width of the beats where none is known
_DRIFTING = 4.0  # cam turns: from here on one order to either side stands for beats that change the error slowly
_SIZE_ITERATIONS = 8  # of the size of beats that a record leaves open
_UNSEEN_FACTOR = 2.5  # ovals of both wheels cancel more often than beats that are drawn: found with solved cycles
WHOLE_TURN = 0.97  # of an output turn: a record that has its beats
_TRAVEL_GAP = 0.6  # of the resolution, between orders of a travel
_TRAVEL_RIDGE = 1e-7  # of the normal equations: in the travel, the curve moves by less than its noise
_LINE_CAUSE = "none of the orders, or not told apart from one: ball pass, cage, rig"
_BEAT_CAUSE = "beats of an order with the output, or a line: part of an output turn does not tell them apart"
LINE_WIDTH = 1.5  # of the resolution, to either side: a wave's own peak
_RIG_CAUSES = {  # parts of the rig that repeat so often in a turn of the output
    1.0: "once per output turn: also encoder graduation and coupling, gravity",
    2.0: "twice per output turn: also encoder graduation and coupling",
}
_CAM_CAUSE = "once per cam turn: also the cam's encoder"


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
        """The same of a drive whose output turns through so many degrees; None for the full cycle."""
        travel = (travel_deg or _FULL_CYCLE_DEG) / 360 * self.ratio
        return replace(self, travel=travel if travel < self.cycle else None)

    @property
    def cycle_output(self) -> int:
        """Output turns of the full cycle: 1, or 2 where the flexspline has an odd number of teeth."""
        return round(self.cycle / self.ratio)


@dataclass(frozen=True)
class Coverage:
    """Turns of the cam that a record has visited, each place of the full cycle once, and their share of it, 0 to 1.

    An angle is visited between two readings that are near enough to follow the highest order.
    """

    cam_turns: float
    share: float


def gearing_of(drive: Drive | None, ratio: float | None) -> Gearing | None:
    """Gearing of a drive, or of a drive with two waves by its ratio; None where neither is known.

    Raises UsageError: both are given, or no ratio that a drive with two waves can have.
    """
    if drive is not None:
        if ratio is not None:
            raise UsageError("invalid --ratio: expected none with --drive, which has the ratio", "leave out --ratio")
        kinematics = Kinematics.of(drive)
        return Gearing(abs(kinematics.u), kinematics.cycle_cam_revolutions)
    if ratio is None:
        return None
    ratio = abs(ratio)
    doubled = round(2 * ratio) if ratio <= _GREATEST_RATIO else 0
    if not _LEAST_RATIO <= ratio <= _GREATEST_RATIO or abs(2 * ratio - doubled) > _RATIO_ROUNDING:
        hint = "half the number of teeth of the wheel that turns, such as 100 or 99.5"
        span = f"from {_LEAST_RATIO:g} to {_GREATEST_RATIO:g}"
        raise UsageError(f"invalid --ratio {ratio:g}: expected a multiple of 0.5 {span}", hint)
    return Gearing(ratio, doubled // 2 if doubled % 2 == 0 else doubled)


@dataclass(frozen=True)
class MeasuredOrder:
    """amplitude cos(per_cam_rev phi + phase), with the standard uncertainty of the amplitude and the cause in words.

    cause: empty where no drive is known; is_line: whether it is none of the declared orders, or has such a line in it;
    is_of_record: whether amplitude and uncertainty are those in the record alone, which does not tell them over whole
    turns of the output.
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
    *,
    beats: bool = True,
    slow: bool = True,
    is_travel: bool = False,
) -> Array:
    """Orders per cam turn to fit, rising, shape (orders,).

    Arguments: declared orders; turns of the cam that the record spans; ratio; beats,
    whether to put them around the declared orders, as far as the record resolves them; slow, and around 0; is_travel,
    whether they are those of whole turns, or nearer than the record resolves: its curve has no period then.
    """
    base = 1 / ratio
    width = _BEATS * base
    if is_travel:
        step = max(base, _TRAVEL_GAP / turns)
        width = step * np.ceil(width / step - 1e-9)
    else:
        step = base if turns * base >= WHOLE_TURN else 1 / turns
    count = max(int(width / step + 1e-9), int(turns >= _DRIFTING)) if beats else 0
    around = np.arange(-count, count + 1) * step
    every = np.concatenate([around[around > 0] if slow else [], *(order + around for order in declared)])
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
    is_part = span < WHOLE_TURN * ratio
    fitted = orders[~np.isin(orders, fit.lines)]
    width = float(np.diff(fitted).min()) / 2 if len(fitted) > 1 else 0.5
    is_beat = is_part & (distance(fit.lines, np.asarray(declared)) <= _BEATS / ratio + LINE_WIDTH / span)
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
        elif np.isin(orders[own], fit.lines).any():
            words.append(_LINE_CAUSE)
        return "; ".join(dict.fromkeys(words)) or (NO_CAUSE if drive else "")

    table = [
        MeasuredOrder(*fit.wave(own), cause(own), bool(np.isin(orders[own], fit.lines[~is_beat]).any()))
        for own in fit.groups
    ]
    together = []
    for order in declared:
        off = np.abs(orders - order)
        near = off <= np.minimum(_BEATS / ratio, np.diff(declared).min(initial=1.0) / 2) + 1e-9
        if not len(own := np.flatnonzero(near & ~fit.is_slow)):
            continue
        joint = MeasuredOrder(order, *fit.joint_wave(own)[1:], "")
        place = next((k for k, group in enumerate(fit.groups) if off.argmin() in group), 0)
        if is_part:
            widened = _over_whole_turns(fit, own, joint, ratio)
            joint, table[place] = widened(joint, _BEATS), widened(table[place], 0)
        together.append(replace(joint, cause=table[place].cause))
    return tuple(table), tuple(together)


def _over_whole_turns(
    fit: TraceFit, own: OrderIndices, joint: MeasuredOrder, ratio: float
) -> Callable[[MeasuredOrder, int], MeasuredOrder]:
    """Orders of a part of an output turn with the uncertainty of their amplitude over whole turns, with so many beats.

    Arguments: places of an order and its beats in a fit, which are a joint wave over the record.
    Cosine and sine of each beat c are drawn from a normal distribution, those next to the order as large as the
    order itself and those further off smaller by half from one to the next; the coefficients of the record are B c
    and noise. Their common size is found by expectation and maximisation.
    """
    away = np.tile(np.arange(-_BEATS, _BEATS + 1), 2)
    pair = np.concatenate([own, own + len(fit.orders)])
    beats, turns = joint.per_cam_rev + away[: len(away) // 2] / ratio, fit.bins.turns
    record = fit.design.project(lambda rows: order_columns(turns[rows], beats))[pair]
    noise = fit.factor[pair] @ fit.factor[pair].T
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
