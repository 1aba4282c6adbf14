"""Acceptance of a drive: each limit of its preset held against what was measured, or else against the prediction."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from hdassist.acceptance.checks import (
    BUDGET,
    COVERAGE,
    F_IOR,
    LINES,
    NOT_TESTED,
    RATED,
    RECORD,
    UNCERTAIN,
    UNCERTAINTY,
    UNKNOWN,
)
from hdassist.acceptance.decision import Decision, Limit, Value, decide, limits_of, margin_of, needed_for
from hdassist.acceptance.predictions import Predictions, order_place, predict
from hdassist.error.unknown_range import uncertain_deviations
from hdassist.errors import DataError, UsageError
from hdassist.measuring.measure import Measurement, SweepResult
from hdassist.measuring.uncertainty import COVERAGE_FACTOR
from hdassist.model.kinematics import Kinematics
from hdassist.model.unknown import names
from hdassist.model.wheels import MeasuredTeeth
from hdassist.preset.fields import Drive
from hdassist.preset.overrides import is_overridden
from hdassist.solve.answers import Progress
from hdassist.solve.throughcvxpy import CROSS_SOLVER
from hdassist.verdict import SEVERITY, Verdict, worst

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
    measured; wheels: with measured teeth, which predictions are of.
    """

    drive: Drive
    decisions: tuple[Decision, ...]
    left_out: tuple[Limit, ...]
    measurements: Mapping[float, Measurement]
    predictions: Predictions | None
    wheels: MeasuredTeeth | None = None

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
    cross_check: str = CROSS_SOLVER,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> AcceptanceResult:
    """Hold a drive against the limits of its preset.

    Arguments: measurements, traces by their torque [N*m]; wheels, with measured teeth, in place of first harmonics;
    stated, values measured otherwise, by their limit;
    measured_only, leave out limits that nothing was measured for, else the model predicts their values; predictions, of
    the same drive and limits where they are known already; for predictions made here: cross_check, solver of some
    states again, and seed of their choice, executor, to spread the work over, progress, told how many states were
    solved. Raises DataError: no limit, something measured that no limit is for, or an order that the full cycle does
    not have; UsageError: such an order on the command line; UntrustedError where a prediction cannot be trusted.
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
        needed = needed_for(left)
        predictions = predict(
            drive, needed, wheels=wheels, cross_check=cross_check, seed=seed, executor=executor, progress=progress
        )
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
            values = limit.predicted(predictions)
        margin = margin_of(drive, predictions).percent / 100
        found = [decide(limit, value, drive.acceptance.rule, margin) for value in values]
        decisions.append(_open(found) if found[-1].value and found[-1].value.extent == "open" else _decisive(found))
    return AcceptanceResult(
        drive, tuple(decisions), tuple(left) if measured_only else (), measured, predictions, wheels
    )


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


def _open(found: Sequence[Decision]) -> Decision:
    """Of the least and the greatest that a value may be: the least one decides where it fails."""
    least, greatest = found
    return least if least.verdict is Verdict.FAIL else greatest


def _decisive(found: Sequence[Decision]) -> Decision:
    """The worst decision, the first of those alike.

    Beside a direction that visited the whole cycle, one of a part counts only where it is not clear of the limit.
    """
    known = [(decision, decision.value) for decision in found if decision.value]
    if any(value.extent == "whole" for _, value in known):
        found = [d for d, v in known if v.extent == "whole" or (v.extent == "at least" and (d.margin or 0.0) < d.guard)]
    return min(found, key=lambda decision: SEVERITY.index(decision.verdict))


def _of_traces(result: AcceptanceResult) -> Iterator[Note]:
    for M_g, measurement in result.measurements.items():
        where = f"{measurement.trace.file}, {M_g:g} N*m"
        parts = [d for d in measurement.directions if d.is_bound]
        if any(d.limit.M_g == M_g and d.value and d.value.extent != "whole" for d in result.decisions):
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
        expanded, limit = decision.expanded, decision.limit
        if expanded is not None and expanded > QUARTER * limit.bound:
            text = f"U = {expanded:.3g} beside a limit of {limit.bound:g}, k = {COVERAGE_FACTOR:g}"
            yield Note(UNCERTAINTY.code, f"{limit.label}: {text}")
    rated = result.drive.operation.rated
    torques = {d.limit.M_g for d in result.decisions if d.limit.M_g}
    for M_g in sorted(M_g for M_g in torques if M_g and rated and abs(M_g) > rated):
        yield Note(RATED.code, f"{M_g:g} N*m is above the rated torque of {rated:g} N*m")
    if result.predictions and result.predictions.unknown:
        yield Note(UNKNOWN.code, f"not known: {names(result.predictions.unknown)}")
    if words := _of_uncertainty(result):
        yield Note(UNCERTAIN.code, words)
    if result.left_out:
        yield Note(NOT_TESTED.code, "; ".join(limit.label for limit in result.left_out))


def _of_uncertainty(result: AcceptanceResult) -> str:
    """Which of the preset's uncertainties predicted values take in, and which they do not; empty without either."""
    if result.predictions is None:
        return ""
    drive, over = result.drive, result.predictions.over
    checks = {d.limit.check for d in result.decisions if d.value and d.value.basis == "predicted"}
    heeded = list(uncertain_deviations(drive)) if over and F_IOR in checks else []
    left = [path for path, spread in drive.uncertainty.items() if spread and path not in heeded]
    words = []
    if heeded:
        more = ", other values take them as they are given" if any("cycle" in c.needs for c in checks - {F_IOR}) else ""
        words.append(f"F'_ior is what 95 % of drives within ± of {', '.join(heeded)} stay below{more}")
    if left:
        words.append(f"± of {', '.join(left)} is in no predicted value")
    return "; ".join(words)
