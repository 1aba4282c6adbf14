"""A value held against its limit: the decision, and the rule that it follows.

Measured values, guard rule (JCGM 106, ISO 14253-1): accepted within the limit by GUARD standard uncertainties or
more, which conforms with 95 % probability, rejected beyond it by as much, inconclusive between. Simple rule: accepted
up to the limit. Predicted values have no standard uncertainty: a declared margin, a share of the value, stands in
its place under both rules, and what comes out is no decision on conformity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from hdassist.acceptance.checks import Check
from hdassist.measuring.uncertainty import COVERAGE_FACTOR
from hdassist.verdict import Verdict

GUARD = 1.65  # standard uncertainties: one-sided 95 %

Basis = Literal["measured", "stated", "predicted"]
Extent = Literal["whole", "at least", "part"]
Rule = Literal["guard", "simple"]


@dataclass(frozen=True)
class Asked:
    """A limit, and what it is for: a torque [N*m] and an order per cam turn where the check has them."""

    check: Check
    limit: float
    M_g: float | None = None
    order: float | None = None

    @property
    def label(self) -> str:
        """The check in words, with order and torque."""
        order = "" if self.order is None else f"amplitude of order {self.order:g}"
        torque = "" if self.M_g is None else f" at {self.M_g:g} N·m"
        return f"{order or self.check.words}{torque}"


@dataclass(frozen=True)
class Known:
    """What is known of a value.

    value, in the unit of its check; uncertainty, the standard one, 0 where it is predicted; basis, how it is known;
    extent: the value of the whole cycle, a lower bound of it, or that of a part which says nothing of the whole.
    """

    value: float
    uncertainty: float
    basis: Basis
    extent: Extent = "whole"


@dataclass(frozen=True)
class Decision:
    """A limit, the value held against it (None: there is none), the guard band, the verdict, and why in words."""

    asked: Asked
    known: Known | None
    guard: float
    verdict: Verdict
    reason: str

    @property
    def margin(self) -> float | None:
        """Room left to the limit, in the unit of the check: negative beyond it."""
        return None if self.known is None else _room(self.asked, self.known)

    @property
    def expanded(self) -> float | None:
        """Expanded uncertainty, k = 2, of a measured value."""
        measured = self.known is not None and self.known.basis != "predicted"
        return COVERAGE_FACTOR * self.known.uncertainty if measured and self.known else None


def decide(asked: Asked, known: Known | None, rule: Rule, margin: float) -> Decision:
    """Decide on a value by a rule; margin: of predictions, as a share of the value.

    Without a value the decision is INCONCLUSIVE.
    """
    if known is None:
        return Decision(asked, None, 0.0, Verdict.INCONCLUSIVE, "the record does not tell it")
    predicted = known.basis == "predicted"
    guard = margin * abs(known.value) if predicted else GUARD * known.uncertainty if rule == "guard" else 0.0
    room = _room(asked, known)
    if known.extent == "part":
        return Decision(asked, known, guard, Verdict.INCONCLUSIVE, "of a part of the cycle only")
    if room < -guard:
        return Decision(asked, known, guard, Verdict.FAIL, "")
    if known.extent == "at least":
        return Decision(asked, known, guard, Verdict.INCONCLUSIVE, "a lower bound: part of the cycle only")
    if room >= guard:
        return Decision(asked, known, guard, Verdict.PASS, "")
    band = "margin of the prediction" if predicted else "guard band"
    return Decision(asked, known, guard, Verdict.INCONCLUSIVE, f"within the {band}")


def _room(asked: Asked, known: Known) -> float:
    room = asked.limit - known.value
    return room if asked.check.upper else -room
