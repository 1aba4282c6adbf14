"""A value held against its limit: the decision, and the rule that it follows.

Measured values, guard rule (JCGM 106, ISO 14253-1): accepted within the limit by GUARD standard uncertainties or
more, which conforms with 95 % probability, rejected beyond it by as much, inconclusive between; what lines off the
orders may add in another cycle has to find room too, and what nobody has stated of the uncertainty leaves it open.
Simple rule: accepted up to the limit. Predicted values follow the rule of `hdassist check` under both: the probability
of keeping the limit over all that is not known exactly. That is no decision on conformity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from hdassist.acceptance.checks import Extent, check_of
from hdassist.acceptance.limits import Limit
from hdassist.acceptance.predictions import Belief, Predictions
from hdassist.measuring.uncertainty import COVERAGE_FACTOR
from hdassist.run.kept import ClosedRecord
from hdassist.verdict import Verdict, verdict_by_probability

GUARD = 1.65  # standard uncertainties: one-sided 95 %

Basis = Literal["measured", "stated", "predicted"]
Rule = Literal["guard", "simple"]


@dataclass(frozen=True)
class Value:
    """What is known of a value.

    number, in the unit of its check, the median where there is a belief; uncertainty, the standard one, 0 where it is
    predicted; basis, how it is known; extent: the value of the whole cycle, a lower bound of it, that of a part which
    says nothing of the whole, or a prediction at the preset's own numbers where others are as possible (not known);
    rise, by how much it may be greater in another cycle; unstated, sources of its uncertainty that nobody has stated;
    belief, of a prediction over what is not known exactly.
    """

    number: float
    uncertainty: float
    basis: Basis
    extent: Extent = "whole"
    rise: float = 0.0
    unstated: tuple[str, ...] = ()
    belief: Belief | None = None

    @classmethod
    def predicted(cls, limit: Limit, predictions: Predictions) -> Value:
        """The value of predictions that a limit is for."""
        if belief := predictions.belief(limit):
            return cls(belief.p50, 0.0, "predicted", belief=belief)
        open_ = predictions.is_open(limit)
        return cls(predictions.number(limit), 0.0, "predicted", "not known" if open_ else "whole")


@dataclass(frozen=True)
class Decision(ClosedRecord):
    """A decision on a limit, as the files of `hdassist accept` have it.

    limit_is: "greatest" or "least" value allowed; margin: room that the value leaves to it; reason: None where the
    verdict is plain. Other fields are those of Limit and Value.
    """

    code: str
    M_g_Nm: float | None
    per_cam_rev: float | None
    basis: Basis | None
    extent: Extent | None
    value: float | None
    expanded_uncertainty: float | None
    guard: float
    limit: float
    limit_is: Literal["greatest", "least"]
    margin: float | None
    unit: str
    verdict: Verdict
    reason: str | None = None
    rise: float = 0.0
    unstated: tuple[str, ...] = ()
    belief: Belief | None = None

    @property
    def held_against(self) -> Limit:
        """The limit of the decision. Raises DataError: no check has the code."""
        return Limit(check_of(self.code), self.limit, self.M_g_Nm, self.per_cam_rev)

    @property
    def held(self) -> Value | None:
        """The value of the decision."""
        if self.value is None or self.basis is None or self.extent is None:
            return None
        uncertainty = (self.expanded_uncertainty or 0.0) / COVERAGE_FACTOR
        return Value(self.value, uncertainty, self.basis, self.extent, self.rise, self.unstated, self.belief)


def decide(limit: Limit, value: Value | None, rule: Rule, sure: float) -> Decision:
    """Decide on a value by a rule; sure: probability of keeping a limit that PASS of a prediction needs.

    Without a value the decision is INCONCLUSIVE.
    """
    check, guard = limit.check, GUARD * value.uncertainty if value and rule == "guard" else 0.0
    verdict, reason = _verdict(limit, value, guard, rule, sure)
    basis, extent, number = (value.basis, value.extent, value.number) if value else (None, None, None)
    expanded = COVERAGE_FACTOR * value.uncertainty if value and value.basis != "predicted" else None
    return Decision(
        check.code, limit.M_g, limit.order, basis, extent, number, expanded, guard, limit.bound,
        "greatest" if check.upper else "least", limit.room(value.number) if value else None, check.unit,
        verdict, reason or None, *((value.rise, value.unstated, value.belief) if value else ()),
    )  # fmt: skip


def _verdict(limit: Limit, value: Value | None, guard: float, rule: Rule, sure: float) -> tuple[Verdict, str]:
    """The verdict on a value, and why where that is not plain; guard: band on each side of the limit."""
    if value is None:
        return Verdict.INCONCLUSIVE, "the record does not tell it"
    if value.belief:
        verdict = verdict_by_probability(value.belief.probability_low, value.belief.probability_high, sure)
        open_ = verdict is Verdict.INCONCLUSIVE
        return verdict, f"kept with a probability of {value.belief.percent}, {100 * sure:g} % needed" * open_
    if value.extent == "not known":
        return Verdict.INCONCLUSIVE, "what is not known exactly was not drawn"
    if value.extent == "part":
        return Verdict.INCONCLUSIVE, "of a part of the cycle only"
    room = limit.room(value.number)
    if room < -guard:
        return Verdict.FAIL, ""
    if value.extent == "at least":
        return Verdict.INCONCLUSIVE, "a lower bound: part of the cycle only"
    strict = rule == "guard" and value.basis != "predicted"
    if room - (value.rise if strict else 0.0) < guard:
        lines = f", with {value.rise:.3g} that lines may add in another cycle" if strict and value.rise else ""
        return Verdict.INCONCLUSIVE, f"within the guard band{lines}"
    if strict and value.unstated:
        names, options = ", ".join(value.unstated), ",".join(f"{name}=U" for name in value.unstated)
        words = f"nothing stated of {names}: --budget {options}, U in arcsec, 0 where a source adds nothing"
        return Verdict.INCONCLUSIVE, words
    return Verdict.PASS, ""
