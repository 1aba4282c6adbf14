"""Acceptance of a drive: each limit of its preset held against what was measured, or else against the prediction."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from hdassist.acceptance.checks import (
    BUDGET,
    COVERAGE,
    F_IOR,
    LINES,
    NOT_TESTED,
    RATED,
    RECORD,
    UNCERTAINTY,
    UNKNOWN,
)
from hdassist.acceptance.decision import Decision, Value, decide
from hdassist.acceptance.limits import Limit, limits_of
from hdassist.acceptance.predictions import Predictions, order_place, predict
from hdassist.belief.evidence import STIFFNESS_FIGURES
from hdassist.belief.influence import Influence, influences
from hdassist.belief.measure import MeasurementGain, measurements
from hdassist.belief.samples import Samples
from hdassist.design.check import DRAWS
from hdassist.errors import DataError, UsageError
from hdassist.measuring.measure import Measurement, SweepResult
from hdassist.measuring.uncertainty import COVERAGE_FACTOR
from hdassist.model.kinematics import Kinematics
from hdassist.model.unknown import names
from hdassist.model.wheels import MeasuredTeeth
from hdassist.preset.fields import Drive
from hdassist.preset.overrides import is_overridden
from hdassist.run.run import Run
from hdassist.verdict import SEVERITY, SURE, Verdict, worst

QUARTER = 0.25  # of the limit: a test uncertainty ratio of 4 to 1


@dataclass(frozen=True)
class Note:
    """A remark by its code, and what it is about in words."""

    code: str
    text: str


@dataclass(frozen=True)
class AcceptanceResult:
    """Decisions on the limits of a drive, in the order of the checklist.

    left_out: limits that were not decided on; measurements: traces by torque [N*m]; predictions: None where all was
    measured; wheels: with measured teeth, which predictions are of; sure: probability of keeping a limit that PASS of a
    prediction needs.
    """

    drive: Drive
    decisions: tuple[Decision, ...]
    left_out: tuple[Limit, ...]
    measurements: Mapping[float, Measurement]
    predictions: Predictions | None
    wheels: MeasuredTeeth | None = None
    sure: float = SURE

    @property
    def least_sure(self) -> Decision | None:
        """The prediction of F'_ior whose verdict is least sure; None where none was drawn."""
        doubts = [(min(d.belief.probability, 1 - d.belief.probability), d) for d in self.decisions if d.belief]
        return max(
            (each for each in doubts if each[1].code == F_IOR.code), key=lambda each: each[0], default=(0, None)
        )[1]

    @cached_property
    def influences(self) -> tuple[Influence, ...]:
        """Shares of the variance of ln F'_ior at the torque that is least sure, by field, the largest first."""
        return influences(*found[:2]) if (found := self._least_sure_samples) else ()

    @cached_property
    def to_measure(self) -> tuple[MeasurementGain, ...]:
        """What to measure next, for the torque that is least sure, the largest gain first."""
        return measurements(*found) if (found := self._least_sure_samples) and found[2] > 0 else ()

    @property
    def _least_sure_samples(self) -> tuple[Samples, int, float] | None:
        """Samples, place of the torque that is least sure among theirs, and limit [arcsec] less self error there."""
        found, decision = self.predictions, self.least_sure
        if decision is None or found is None or found.error_samples is None:
            return None
        samples, M_g = found.error_samples, decision.M_g_Nm or 0.0
        figures = {name: values for name, values in samples.figures.items() if name in STIFFNESS_FIGURES}
        left = decision.limit - found.quantities.self_errors[M_g].range_arcsec
        return replace(samples, figures=figures), samples.torques.index(M_g), left

    @property
    def verdict(self) -> Verdict:
        """The worst of the decisions."""
        return worst(decision.verdict for decision in self.decisions)

    @property
    def notes(self) -> tuple[Note, ...]:
        """Remarks that the verdict should not be read without."""
        return (*_of_traces(self), *_of_decisions(self))


def accept(
    drive: Drive,
    measurements: Mapping[float, Measurement] | None = None,
    *,
    wheels: MeasuredTeeth | None = None,
    stated: Mapping[Limit, Value] | None = None,
    measured_only: bool = False,
    predictions: Predictions | None = None,
    draws: int = DRAWS,
    sure: float = SURE,
    run: Run = Run(),
) -> AcceptanceResult:
    """Hold a drive against the limits of its preset.

    Arguments: measurements, traces by their torque [N*m]; wheels, with measured teeth, in place of first harmonics;
    stated, values measured otherwise, by their limit;
    measured_only, leave out limits that nothing was measured for, else the model predicts their values; predictions, of
    the same drive and limits where they are known already; sure, probability of keeping a limit that PASS of a
    prediction needs; draws and run as those of predict. Raises DataError: no limit,
    something measured that no limit is for, or an order that the full cycle does not have; UsageError: such an order on
    the command line; UntrustedError where a prediction cannot be trusted.
    """
    limits, measured, known = limits_of(drive), measurements or {}, stated or {}
    left = without_values(drive, measured, known)
    if measured_only and len(left) == len(limits):
        raise DataError(
            f"{drive.name}: nothing was measured that has a limit",
            "--measured FILE or --value NAME=VALUE±U, or no --measured-only",
        )
    if not left or measured_only:
        predictions = None
    elif predictions is None:
        predictions = predict(drive, left, wheels=wheels, draws=draws, sure=sure, run=run)
    decisions = []
    for limit in limits:
        values: Sequence[Value | None]
        if limit in known:
            values = [known[limit]]
        elif limit not in left:
            values = _measured(limit, measured[limit.M_g or 0.0]) or [None]
        elif predictions is None:
            continue
        else:
            values = [Value.predicted(limit, predictions)]
        decisions.append(_decisive([decide(limit, value, drive.acceptance.rule, sure) for value in values]))
    left_out = tuple(left) if measured_only else ()
    return AcceptanceResult(drive, tuple(decisions), left_out, measured, predictions, wheels, sure)


def without_values(drive: Drive, torques: Collection[float], stated: Collection[Limit]) -> list[Limit]:
    """Limits of a drive that neither a trace at one of the torques [N*m] nor a stated value is for.

    Raises DataError and UsageError as accept does of what has no limit.
    """
    limits = limits_of(drive)
    for limit in limits:
        if limit.order is not None:
            _require_order(drive, limit.order)
    for M_g in torques:
        if not any(a.M_g == M_g and a.check.measured for a in limits):
            raise DataError(
                f"{drive.name}: measured at {M_g:g} N*m, where it has no limit", f"--limit F_ior@{M_g:g}=30"
            )
    for limit in stated:
        if limit not in limits:
            raise DataError(
                f"{drive.name}: a value of {limit.label} is stated, which has no limit", "--limit gives one"
            )
    return [a for a in limits if a not in stated and not (a.check.measured and a.M_g in torques)]


def _require_order(drive: Drive, order: float) -> None:
    """Raise UsageError where the command line has an order that the cycle has not, DataError where the preset has."""
    try:
        order_place(Kinematics.of(drive), order)
    except UsageError as error:
        if is_overridden("acceptance.order_amplitude", drive.origin.overrides):
            raise
        raise DataError(f"{drive.name}: acceptance.order_amplitude: {error.message}", error.hint) from None


def _measured(limit: Limit, measurement: Measurement) -> list[Value]:
    """What the directions of a trace say of a limit, the greatest first."""
    found = [value for d in measurement.directions if (value := value_of(limit, d)) is not None]
    return sorted(found, key=lambda value: -value.number)


def value_of(limit: Limit, found: SweepResult) -> Value | None:
    """What one direction of a trace says of a limit; None where it does not tell it."""
    value = limit.check.measured(found, limit.order or 0.0) if limit.check.measured else None
    if value is None:
        return None
    number, uncertainty, rise = value
    unstated = tuple(source.name for source in found.sources if source.arcsec is None)
    extent = limit.check.of_part if found.is_bound else "whole"
    return Value(number, uncertainty, "measured", extent, rise, unstated)


def _decisive(found: Sequence[Decision]) -> Decision:
    """The worst decision, the first of those alike.

    Beside a direction that visited the whole cycle, one of a part counts only where it is not clear of the limit.
    """
    if any(d.extent == "whole" for d in found):
        found = [d for d in found if d.extent in ("whole", "at least")]
        found = [d for d in found if d.extent == "whole" or (d.margin or 0.0) < d.guard]
    return min(found, key=lambda decision: SEVERITY.index(decision.verdict))


def _of_traces(result: AcceptanceResult) -> Iterator[Note]:
    for M_g, measurement in result.measurements.items():
        where = f"{measurement.trace.file}, {M_g:g} N*m"
        parts = [d for d in measurement.directions if d.is_bound]
        if any(d.M_g_Nm == M_g and d.extent not in (None, "whole") for d in result.decisions):
            visited = [f"{100 * d.coverage.share:.3g} % of the full cycle visited" for d in parts if d.coverage]
            yield Note(COVERAGE.code, f"{where}: {' and '.join(visited) or 'unknown cycle'}")
        missing = [source.name for source in measurement.directions[0].sources if source.arcsec is None]
        if missing:
            yield Note(BUDGET.code, f"{where}: nothing stated of {', '.join(missing)}")
        lines = dict.fromkeys(f"{line.per_cam_rev:.3f}" for d in measurement.directions for line in d.lines)
        if lines:
            rise = max(d.rise_arcsec for d in measurement.directions)
            more = f"; F'_ior may be {rise:.3g} arcsec greater in another cycle" if rise else ""
            yield Note(LINES.code, f"{where}: {', '.join(lines)} per cam turn{more}")
        yield from (Note(RECORD.code, f"{where}: {text}") for text in measurement.warnings)


def _of_decisions(result: AcceptanceResult) -> Iterator[Note]:
    for decision in result.decisions:
        expanded = decision.expanded_uncertainty
        if expanded is not None and expanded > QUARTER * decision.limit:
            text = f"U = {expanded:.3g} beside a limit of {decision.limit:g}, k = {COVERAGE_FACTOR:g}"
            yield Note(UNCERTAINTY.code, f"{decision.held_against.label}: {text}")
    rated = result.drive.operation.rated
    torques = {d.M_g_Nm for d in result.decisions if d.M_g_Nm}
    for M_g in sorted(M_g for M_g in torques if M_g and rated and abs(M_g) > rated):
        yield Note(RATED.code, f"{M_g:g} N*m is above the rated torque of {rated:g} N*m")
    if result.predictions and result.predictions.unknown:
        yield Note(UNKNOWN.code, f"not known: {names(result.predictions.unknown)}")
    if result.left_out:
        yield Note(NOT_TESTED.code, "; ".join(limit.label for limit in result.left_out))
