"""Orders to which a measured trace is limited, and the table of those that were found.

Deviations of the wheel that turns with the output beat with those that stand still, so around each declared order n the
error has orders n + k/ratio. BEATS of them to either side hold a model's error over the full cycle to about 1 % of its
range. A record of T cam turns resolves orders 1/T apart: of closer ones, fewer stand for all.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hdassist.error.orders import NO_CAUSE, known_causes
from hdassist.errors import UsageError
from hdassist.measuring.cycle import Gearing
from hdassist.measuring.fit import OrderIndices, SlowTerms, TraceFit
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive

DEFAULT_ORDERS = tuple(float(order) for order in range(1, 13))
HIGHEST_ORDER = 200.0
BEATS = 6
SLOW_ORDERS, SLOW_PER_CAM_TURN = 12, 0.2  # periods of slow terms in a turn, at most: of the output and of the cam
USUAL_RATIO = 100.0  # assumed for the width of the beats where none is known
DRIFTING = 4.0  # cam turns: from here on one order to either side stands for beats that change the error slowly
WHOLE_TURN = 0.97  # of an output turn: a record that has its beats
LINE_CAUSE = "none of the orders: ball pass, cage, rig; in short records also an unresolved beat"
TOGETHER_CAUSE = "orders {:.3f} to {:.3f} together: the record does not tell a line between them apart"
RIG_CAUSES = {  # parts of the rig that repeat so often in a turn of the output
    1.0: "once per output turn: also encoder graduation and coupling, gravity",
    2.0: "twice per output turn: also encoder graduation and coupling",
}
CAM_CAUSE = "once per cam turn: also the cam's encoder"


@dataclass(frozen=True)
class MeasuredOrder:
    """amplitude cos(per_cam_rev phi + phase), with the standard uncertainty of the amplitude and the cause in words.

    cause: empty where no drive is known; is_line: whether it is none of the declared orders, or has such a line in it.
    """

    per_cam_rev: float
    amplitude_arcsec: float
    uncertainty_arcsec: float
    phase_deg: float
    cause: str
    is_line: bool = False


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
        if not 0 < first <= last <= HIGHEST_ORDER or (match[2] and not first.is_integer()):
            raise UsageError(f"invalid --orders {text}: expected rising orders above 0, up to {HIGHEST_ORDER:g}")
        orders.update(np.arange(first, last + 0.5).tolist() if match[2] else [first])
    return tuple(sorted(orders))


def slow_terms(turns: float, ratio: float | None, degree: int) -> SlowTerms:
    """Slow terms of a record over turns of the cam: a drift of a degree, or more where it is part of an output turn.

    There a drift and the orders of the output, up to SLOW_ORDERS a turn of it, look alike, and polynomials stand for
    both.
    """
    part = turns / (ratio or USUAL_RATIO)
    if turns < DRIFTING or part >= WHOLE_TURN:
        return SlowTerms(degree)
    return SlowTerms(round(2 * min(SLOW_ORDERS * part, SLOW_PER_CAM_TURN * turns)) + 2, by_angle=True)


def order_grid(
    declared: Sequence[float], turns: float, ratio: float | None, *, beats: bool = True, slow: bool = True
) -> Array:
    """Orders per cam turn to fit, rising, shape (orders,).

    Arguments: declared orders; turns of the cam that the record spans; ratio, None where it is not known; beats,
    whether to put them around the declared orders, as far as the record resolves them; slow, and around 0.
    """
    base = 1 / (ratio or USUAL_RATIO)
    width = BEATS * base
    step = base if turns * base >= WHOLE_TURN else 1 / turns
    count = max(int(width / step + 1e-9), int(turns >= DRIFTING)) if beats else 0
    around = np.arange(-count, count + 1) * step
    every = np.concatenate([around[around > 0] if slow else [], *(order + around for order in declared)])
    every = np.sort(every[every > 0])
    return np.asarray(every[np.concatenate([[True], np.diff(every) > step / 2])])


def order_table(fit: TraceFit, drive: Drive | None, gearing: Gearing | None) -> tuple[MeasuredOrder, ...]:
    """Orders of a fit, rising, with the simplest causes of each that lie nearest to it.

    A line and the orders that the record does not resolve from it are one entry.
    """
    orders = fit.orders
    declared = orders[~np.isin(orders, fit.lines)]
    width = float(np.diff(declared).min()) / 2 if len(declared) > 1 else 0.5
    causes: list[list[tuple[int, str]]] = [[] for _ in orders]
    for (k_g, k_b), (order, words) in (known_causes(drive) if drive else {}).items():
        place = int(np.abs(orders - order).argmin())
        if abs(orders[place] - order) <= width + 1e-9:
            causes[place].append((abs(k_g) + abs(k_b), words))

    def cause(own: OrderIndices) -> str:
        known = [each for place in own for each in causes[place]]
        words = [text for degree, text in known if degree == min(known)[0]]
        if gearing:
            reach = min(width * gearing.ratio, 0.5)
            per_output = orders[own] * gearing.ratio
            words += [text for often, text in RIG_CAUSES.items() if (abs(per_output - often) < reach).any()]
            words += [CAM_CAUSE] * bool((abs(orders[own] - 1) < 1e-9).any())
        if np.isin(orders[own], fit.lines).any():
            words.append(LINE_CAUSE if len(own) == 1 else TOGETHER_CAUSE.format(orders[own[0]], orders[own[-1]]))
        return "; ".join(dict.fromkeys(words)) or (NO_CAUSE if drive else "")

    rows = []
    for own in fit.groups:
        is_line = bool(np.isin(orders[own], fit.lines).any())
        rows.append(MeasuredOrder(*fit.wave(own), cause(own), is_line))
    return tuple(rows)


def orders_of_cam(
    fit: TraceFit, declared: Sequence[float], ratio: float | None, table: Sequence[MeasuredOrder]
) -> tuple[MeasuredOrder, ...]:
    """Each declared order together with its beats, as a wave of the same mean square; table: of the orders, for causes.

    In a part of an output turn a beat, n and 1/ratio off it, is not told from the order.
    """
    causes = {order.per_cam_rev: order.cause for order in table}
    rows = []
    for order in declared:
        off = np.abs(fit.orders - order)
        near = off <= np.minimum(BEATS / (ratio or USUAL_RATIO), np.diff(declared).min(initial=1.0) / 2) + 1e-9
        if len(own := np.flatnonzero(near & ~fit.is_slow)):
            centre = float(fit.orders[off.argmin()])
            rows.append(replace(MeasuredOrder(*fit.joint_wave(own), causes.get(centre, "")), per_cam_rev=order))
    return tuple(rows)
