"""A value held against its limit: the decision, and the rule that it follows.

Measured values, guard rule (JCGM 106, ISO 14253-1): accepted within the limit by GUARD standard uncertainties or
more, which conforms with 95 % probability, rejected beyond it by as much, inconclusive between; lines off the
orders may add in another cycle has to find room too, and an uncertainty that nobody has stated leaves it open.
Simple rule: accepted up to the limit. Predicted values follow the rule of `hdassist check` under both: the probability
of keeping the limit over all that is not known exactly. That is no decision on conformity.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from hdassist.acceptance.checks import Extent
from hdassist.acceptance.limits import Limit, LimitText
from hdassist.acceptance.predictions import Belief, Predictions
from hdassist.errors import UsageError
from hdassist.measuring.measure import SweepResult
from hdassist.measuring.uncertainty import COVERAGE_FACTOR
from hdassist.preset.units import UnitError, is_spread, read_spread
from hdassist.run.kept import ClosedRecord
from hdassist.verdict import Verdict, percent_text, verdict_by_probability

GUARD = 1.65  # standard uncertainties: one-sided 95 %

Basis = Literal["measured", "stated", "predicted"]
Rule = Literal["guard", "simple"]


@dataclass(frozen=True)
class AcceptedValue(ClosedRecord):
    """A measured or predicted value with its uncertainty; unknown without arguments.

    value, in the unit of its check, the median where there is a belief; expanded_uncertainty, k = 2, None where it is
    predicted; basis, how it is known; extent: the value of the whole cycle, a lower bound of it, that of a part which
    does not hold for the whole, or a prediction at the preset's own numbers where others are as possible (not known);
    rise, by how much it may be greater in another cycle; unstated, sources of its uncertainty that nobody has stated;
    belief, of a prediction over the uncertain inputs.
    """

    value: float | None = None
    expanded_uncertainty: float | None = None
    basis: Basis | None = None
    extent: Extent | None = None
    rise: float = 0.0
    unstated: tuple[str, ...] = ()
    belief: Belief | None = None

    @classmethod
    def predicted(cls, limit: Limit, predictions: Predictions) -> AcceptedValue:
        """The value of predictions that a limit is for."""
        if belief := predictions.belief(limit):
            return cls(belief.p50, None, "predicted", "whole", belief=belief)
        extent: Extent = "not known" if predictions.is_open(limit) else "whole"
        return cls(predictions.quantities.value(limit), None, "predicted", extent)

    @classmethod
    def stated(cls, given: LimitText, limit: Limit) -> AcceptedValue:
        """The value that was measured otherwise, VALUE±U with U the expanded uncertainty, k = 2.

        Raises UsageError: it is none, has no uncertainty, or is below zero.
        """
        if not is_spread(given.text):
            hint = f"like {given.text}±1.2: expanded, k = 2; ±0 for none"
            raise UsageError(f"--value {given}: without its uncertainty", hint)
        try:
            value, expanded = read_spread(given.text, limit.check.unit)
        except UnitError as error:
            raise UsageError(f"--value {given}: {error.message}", error.hint) from None
        if value < 0:
            raise UsageError(f"--value {given}: {limit.label} cannot be below zero", "its size, without a sign")
        return cls(value, expanded, "stated", "whole")

    @classmethod
    def measured(cls, limit: Limit, found: SweepResult) -> AcceptedValue:
        """The value by one direction of a trace, with the expanded uncertainty; none where that does not tell it."""
        read = limit.check.measured(found, limit.per_cam_rev or 0.0) if limit.check.measured else None
        if read is None:
            return cls()
        value, uncertainty, rise = read
        unstated = tuple(source.name for source in found.sources if source.arcsec is None)
        extent = limit.check.of_part if found.is_bound else "whole"
        return cls(value, COVERAGE_FACTOR * uncertainty, "measured", extent, rise, unstated)


@dataclass(frozen=True, kw_only=True)
class DecidedCheck(AcceptedValue, Limit):
    """A value and the limit that it is held against, as the files of `hdassist accept` have them.

    guard: band on each side of the limit; limit_is: "greatest" or "least" value allowed; margin: room that the value
    leaves to it; reason: None where the verdict is plain.
    """

    guard: float
    limit_is: Literal["greatest", "least"]
    margin: float | None
    unit: str
    verdict: Verdict
    reason: str | None = None


def decide(limit: Limit, found: AcceptedValue, rule: Rule, sure: float) -> DecidedCheck:
    """Decide on a value by a rule; sure: probability of keeping a limit that PASS of a prediction needs."""
    known = found.value is not None and found.basis != "predicted"
    found = replace(found, expanded_uncertainty=(found.expanded_uncertainty or 0.0) if known else None)
    guard = GUARD * (found.expanded_uncertainty or 0.0) / COVERAGE_FACTOR if rule == "guard" else 0.0
    margin = None if found.value is None else limit.room(found.value)
    verdict, reason = _verdict(found, margin, guard, rule, sure)
    return DecidedCheck(
        **vars(limit),
        **vars(found),
        guard=guard,
        limit_is="greatest" if limit.check.upper else "least",
        margin=margin,
        unit=limit.check.unit,
        verdict=verdict,
        reason=reason or None,
    )


def _verdict(found: AcceptedValue, room: float | None, guard: float, rule: Rule, sure: float) -> tuple[Verdict, str]:
    """The verdict on a value by its room to the limit, and why where that is not plain."""
    if room is None:
        return Verdict.INCONCLUSIVE, "neither the record nor a given value (--value) tells it"
    if belief := found.belief:
        verdict = verdict_by_probability(belief.probability, sure)
        open_ = verdict is Verdict.INCONCLUSIVE
        kept = percent_text(belief.probability, belief.probability_low, belief.probability_high, sure)
        return verdict, f"kept with a probability of {kept}" * open_
    if found.extent == "not known":
        return Verdict.INCONCLUSIVE, "what is not known exactly was not drawn"
    if found.extent == "part":
        return Verdict.INCONCLUSIVE, "of a part of the cycle only"
    if room < -guard:
        within = found.extent == "at least" and room + (found.expanded_uncertainty or 0.0) > 0
        return Verdict.FAIL, f"the estimate {found.value:.4g} is beyond the limit by its rule" * within
    if found.extent == "at least":
        return Verdict.INCONCLUSIVE, "a lower bound: part of the cycle only"
    strict = rule == "guard" and found.basis != "predicted"
    if room - (found.rise if strict else 0.0) < guard:
        lines = f", with {found.rise:.3g} that lines may add in another cycle" if strict and found.rise else ""
        return Verdict.INCONCLUSIVE, f"within the guard band{lines}"
    if strict and found.unstated:
        names, options = ", ".join(found.unstated), ",".join(f"{name}=U" for name in found.unstated)
        words = f"nothing stated of {names}: --budget {options}, U in ″, 0 where a source adds nothing"
        return Verdict.INCONCLUSIVE, words
    return Verdict.PASS, ""
