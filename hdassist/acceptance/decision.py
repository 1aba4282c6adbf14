"""A value held against its limit: the limits of a drive, the decision, and the rule that it follows.

Measured values, guard rule (JCGM 106, ISO 14253-1): accepted within the limit by GUARD standard uncertainties or
more, which conforms with 95 % probability, rejected beyond it by as much, inconclusive between; what lines off the
orders may add in another cycle has to find room too, and what nobody has stated of the uncertainty leaves it open.
Simple rule: accepted up to the limit. Predicted values have no standard uncertainty: a declared margin, a share of
the value, stands in its place under both rules, and what comes out is no decision on conformity.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import expm1
from typing import Literal

from hdassist.acceptance.checks import CHECKS, F_IOR, Check, Extent
from hdassist.acceptance.predictions import Needed, Predictions, is_calibrated
from hdassist.errors import DataError
from hdassist.measuring.uncertainty import COVERAGE_FACTOR
from hdassist.preset.fields import Drive
from hdassist.verdict import Verdict

GUARD = 1.65  # standard uncertainties: one-sided 95 %
CALIBRATED, ASSUMED = 10.0, 50.0  # margin of predictions, percent of the value

Basis = Literal["measured", "stated", "predicted"]
Rule = Literal["guard", "simple"]
MarginOrigin = Literal["given", "calibrated", "assumed", "spread"]


@dataclass(frozen=True)
class Limit:
    """A limit: the check, its bound in the check's unit, and what it is for: torque [N*m] and order per cam turn."""

    check: Check
    bound: float
    M_g: float | None = None
    order: float | None = None

    @property
    def label(self) -> str:
        """The check in words, with order and torque."""
        order = "" if self.order is None else f"amplitude of order {self.order:g}"
        torque = "" if self.M_g is None else f" at {self.M_g:g} N·m"
        return f"{order or self.check.words}{torque}"

    def predicted(self, predictions: Predictions) -> tuple[Value, ...]:
        """The value of predictions that it is for; the least and the greatest that it may be over what is not known.

        What has an uncertainty in the preset counts as that: of F'_ior alone, and of deviations alone.
        """
        number = self.check.predicted(predictions, self.M_g or 0.0, self.order or 0.0)
        over = predictions.over.get(self.M_g or 0.0) if self.check is F_IOR else None
        if over is None:
            open_ = predictions.unknown and "cycle" in self.check.needs
            return (Value(number, 0.0, "predicted", "not known" if open_ else "whole"),)
        more = number - predictions.errors[over.M_g].F_ior_arcsec
        return Value(over.low + more, 0.0, "predicted"), Value(over.high + more, 0.0, "predicted", "open")


@dataclass(frozen=True)
class Value:
    """What is known of a value.

    number, in the unit of its check; uncertainty, the standard one, 0 where it is predicted; basis, how it is known;
    extent: the value of the whole cycle, a lower bound of it, or that of a part which says nothing of the whole; of a
    prediction with deviations that are not known, what 95 % of them stay below (open), or one that takes them as 0;
    rise, by how much it may be greater in another cycle; unstated, sources of its uncertainty that nobody has stated.
    """

    number: float
    uncertainty: float
    basis: Basis
    extent: Extent = "whole"
    rise: float = 0.0
    unstated: tuple[str, ...] = ()


@dataclass(frozen=True)
class Decision:
    """A limit, the value held against it (None: there is none), the guard band, the verdict, and why in words."""

    limit: Limit
    value: Value | None
    guard: float
    verdict: Verdict
    reason: str

    @property
    def margin(self) -> float | None:
        """Room left to the limit, in the unit of the check: negative beyond it."""
        return None if self.value is None else _room(self.limit, self.value)

    @property
    def expanded(self) -> float | None:
        """Expanded uncertainty, k = 2, of a measured value."""
        known = self.value is not None and self.value.basis != "predicted"
        return COVERAGE_FACTOR * self.value.uncertainty if known and self.value else None


def decide(limit: Limit, value: Value | None, rule: Rule, margin: float) -> Decision:
    """Decide on a value by a rule; margin: of predictions, as a share of the value.

    Without a value the decision is INCONCLUSIVE.
    """
    if value is None:
        return Decision(limit, None, 0.0, Verdict.INCONCLUSIVE, "the record does not tell it")
    predicted = value.basis == "predicted"
    guard = beyond = GUARD * value.uncertainty if rule == "guard" else 0.0
    if predicted:  # the drive's own may be so many times the value, or the value so many times it
        more, less = margin * abs(value.number), margin / (1 + margin) * abs(value.number)
        guard, beyond = (more, less) if limit.check.upper else (less, more)
    room = _room(limit, value)
    if value.extent == "not known":
        return Decision(limit, value, guard, Verdict.INCONCLUSIVE, "deviations that are not known were taken as 0")
    if value.extent == "open" and room < guard:
        return Decision(
            limit, value, guard, Verdict.INCONCLUSIVE, "what is not known, or uncertain, could take it across the limit"
        )
    if value.extent == "part":
        return Decision(limit, value, guard, Verdict.INCONCLUSIVE, "of a part of the cycle only")
    if room < -beyond:
        return Decision(limit, value, beyond, Verdict.FAIL, "")
    if value.extent == "at least":
        return Decision(limit, value, guard, Verdict.INCONCLUSIVE, "a lower bound: part of the cycle only")
    strict = rule == "guard" and not predicted
    if room - (value.rise if strict else 0.0) < guard:
        band = "margin of the prediction" if predicted else "guard band"
        lines = f", with {value.rise:.3g} that lines may add in another cycle" if strict and value.rise else ""
        return Decision(limit, value, guard, Verdict.INCONCLUSIVE, f"within the {band}{lines}")
    if strict and value.unstated:
        names, options = ", ".join(value.unstated), ",".join(f"{name}=U" for name in value.unstated)
        words = f"nothing stated of {names}: --budget {options}, U in arcsec, 0 where a source adds nothing"
        return Decision(limit, value, guard, Verdict.INCONCLUSIVE, words)
    return Decision(limit, value, guard, Verdict.PASS, "")


def _room(limit: Limit, value: Value) -> float:
    room = limit.bound - value.number
    return room if limit.check.upper else -room


@dataclass(frozen=True)
class Margin:
    """Margin of predicted values, in percent of them, and why it is so wide: given, or by the drive's stiffnesses."""

    percent: float
    origin: MarginOrigin

    @property
    def words(self) -> str:
        """What it is, and why."""
        why = {
            "given": "as given",
            "calibrated": "stiffnesses or clearances identified by a calibration",
            "assumed": "stiffnesses and clearances not calibrated",
            "spread": "over the plausible ranges of what is assumed (95 %)",
        }
        return f"margin {self.percent:.4g} %, {why[self.origin]}"


def margin_of(drive: Drive, predictions: Predictions | None = None) -> Margin:
    """Margin of what the model predicts of a drive: acceptance.margin, or by how its stiffnesses are known.

    A drive is calibrated where the preset says of a stiffness or clearance that it was identified, and neither they nor
    the model that they were identified with are overridden. Else the margin is what 95 % of the spread of predictions
    over what is assumed stays below; ASSUMED where that is less, or was not computed.
    """
    if drive.acceptance.margin is not None:
        return Margin(drive.acceptance.margin, "given")
    if is_calibrated(drive):
        return Margin(CALIBRATED, "calibrated")
    spread = predictions.spread if predictions else None
    percent = 100 * expm1(GUARD * spread) if spread else 0.0
    return Margin(percent, "spread") if percent > ASSUMED else Margin(ASSUMED, "assumed")


def limits_of(drive: Drive) -> tuple[Limit, ...]:
    """Limits of a drive: for torques, those of operation.M_g and those the limits name, for orders, for the drive.

    Raises DataError: there is none.
    """
    found = tuple(_limits(drive))
    if not found:
        raise DataError(
            f"{drive.name}: no limit to accept it by",
            "acceptance: {F_ior: {80: 30}} in the preset, or --limit F_ior=30",
        )
    return found


def _limits(drive: Drive) -> Iterator[Limit]:
    for check in sorted(CHECKS, key=lambda check: ("limits", "orders", "number").index(check.kind)):
        stated = drive.value(f"acceptance.{check.field}")
        if check.kind == "limits":
            named = [float(key) for key in stated if key != "all"]
            for M_g in dict.fromkeys([*drive.operation.M_g, *named]):
                if (bound := drive.limit(M_g, check.field)) is not None:
                    yield Limit(check, bound, M_g)
        elif check.kind == "orders":
            yield from _limits_of_orders(check, drive.operation.M_g, stated)
        elif stated is not None:
            yield Limit(check, stated)


def _limits_of_orders(check: Check, torques: Sequence[float], stated: Mapping[str, float]) -> Iterator[Limit]:
    """Limits of orders: at the torques of a drive and those they name; one for a torque wins over one for each."""
    by_order: dict[float, dict[float | None, float]] = {}
    for key, value in stated.items():
        order, _, torque = key.partition("@")
        by_order.setdefault(float(order), {})[float(torque) if torque else None] = value
    for number, bounds in by_order.items():
        for M_g in dict.fromkeys([*torques, *(at for at in bounds if at is not None)]):
            bound = bounds.get(M_g, bounds.get(None))
            if bound is not None:
                yield Limit(check, bound, M_g, number)


def needed_for(limits: Iterable[Limit]) -> Needed:
    """What has to be predicted for some limits."""
    wanted = dict.fromkeys((need, limit.M_g) for limit in limits for need in limit.check.needs)
    cycles, own = (
        tuple(M_g for need, M_g in wanted if need == kind and M_g is not None) for kind in ("cycle", "self error")
    )
    return Needed(cycles, own, any(need == "stiffness" for need, _ in wanted))
