"""Acceptance of a drive or of the rows of a lot.

Each limit is compared with a measured value or, if there is none, with the predicted value.

`run/run.stream` distributes the rows. The result of each row depends only on its own drive.
"""

from __future__ import annotations

import traceback
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from functools import lru_cache

from hdassist import __version__
from hdassist.drive.model.deviations import unknown_names
from hdassist.drive.preset.fields import Drive
from hdassist.features.acceptance.answer import (
    ANSWER,
    AcceptAnswer,
    ErrorRecord,
    Note,
    PresetRecord,
    RuleRecord,
    TraceRecord,
    now,
    of_predictions,
)
from hdassist.features.acceptance.decision import AcceptedValue, CoveredCycle, DecidedCheck, Predictions, decide
from hdassist.features.acceptance.limits import F_IOR, Limit, limits_of
from hdassist.features.acceptance.request import Inputs, LotRow, Request
from hdassist.features.measuring.fit import COVERAGE_FACTOR
from hdassist.features.measuring.full_cycle import is_covered_together, reason_outside, with_full_cycle
from hdassist.features.measuring.measure import Measurement, SweepResult
from hdassist.readers.table import NO_UNIT
from hdassist.run.errors import GUARD, SEVERITY, DataError, HdassistError, UsageError, Verdict, worst

_QUARTER = 0.25  # share of the limit that corresponds to a test uncertainty ratio of 4 to 1


def _warnings(drive: Drive, predictions: Predictions | None) -> tuple[str, ...]:
    """Return the warnings on a preset and on the samples of its predictions."""
    if predictions and predictions.samples:
        return (*drive.origin.warnings, *predictions.samples.remarks)
    return (*drive.origin.warnings,)


def accept(
    request: Request,
    inputs: Inputs,
    predictions: Predictions | None = None,
    place: str | None = None,
) -> AcceptAnswer:
    """Return the result of comparing a drive with the limits of its preset.

    request: the request.
    inputs: inputs named in the request, as read.
    predictions: predictions needed for the request, for the same drive and limits; None if none are needed.
    place: position of the row in a lot, FILE:LINE; None for a single drive.
    Raises DataError if there is no limit, if there is a recording without a limit, if no value is measured or
    predicted, or if an order of the preset does not exist in the full cycle.
    Raises UsageError if an order on the command line does not exist in the full cycle.
    """
    # the model of a recording gives the interval of the full cycle
    measured = {M_g: with_full_cycle(measurement) for M_g, measurement in inputs.measurements.items()}
    inputs = replace(inputs, measurements=measured)
    drive = inputs.drive
    unmeasured = inputs.unmeasured
    _require_value(request, drive, unmeasured, predictions)
    decisions = _decisions(request, inputs, unmeasured, predictions)
    # a limit without a measured value is omitted, unless --strict requires all limits
    left_out = () if predictions or request.strict else unmeasured
    remarks = [
        *_of_traces(inputs, decisions),
        *_of_decisions(inputs, decisions, left_out, predictions),
        *_of_sharing(request),
    ]
    verdict = worst(decision.verdict for decision in decisions)
    rule = drive.acceptance.rule
    return ANSWER.validate_python({
        "version": __version__,
        "preset": PresetRecord(drive.name, drive.origin.sha256, drive.origin.overrides),
        "exit_code": verdict.exit_code,
        "warnings": _warnings(drive, predictions),
        "serial": request.serial,
        "seed": request.seed,
        "request": request,
        "time": now(),
        "verdict": verdict,
        "checks": decisions,
        "left_out": [limit.label for limit in left_out],
        "remarks": remarks,
        "measured": _trace_records(inputs),
        "rule": RuleRecord(rule, GUARD if rule == "guard" else 0.0, request.sure),
        "place": place,
        **of_predictions(predictions, inputs.wheels),
    })  # fmt: skip


def _require_value(
    request: Request,
    drive: Drive,
    unmeasured: Sequence[Limit],
    predictions: Predictions | None,
) -> None:
    """Raise DataError if no limit of a drive has a measured or predicted value, unless --strict is set."""
    limits = limits_of(drive)
    # at least one limit has a value, or --strict reports the missing ones as INCONCLUSIVE
    if predictions is not None or len(unmeasured) < len(limits) or request.strict:
        return
    hint = f"use {' '.join(limit.option for limit in limits)}"
    if request.measured_only:
        hint += ", or leave out --measured-only"
    raise DataError(f"{drive.name}: none of the limits has a measured value", hint)


def _decisions(
    request: Request,
    inputs: Inputs,
    unmeasured: Sequence[Limit],
    predictions: Predictions | None,
) -> list[DecidedCheck]:
    """Return the decision on each limit that is not omitted, in the order of the limits."""
    rule = inputs.drive.acceptance.rule
    decisions = []
    for limit in limits_of(inputs.drive):
        # a measured value takes precedence over a prediction
        if limit not in unmeasured:
            values = _measured_values(limit, inputs)
        else:
            values = _unmeasured_values(limit, request, predictions)
        if values:
            decisions.append(_decisive([decide(limit, value, rule, request.sure) for value in values]))
    # one recording cannot belong to several drives
    if request.shared and not request.shared_records:
        return [_open_by_sharing(decision, request.shared) for decision in decisions]
    return decisions


def _measured_values(limit: Limit, inputs: Inputs) -> list[AcceptedValue]:
    """Return the measured values for a limit: the reported value, or one for each direction of a recording."""
    # a reported value takes precedence over a recording
    if limit in inputs.stated:
        return [inputs.stated[limit]]
    measurement = inputs.measurements[limit.M_g_Nm or 0.0]
    # interpolation between recorded torques may be wrong, so it gives no value
    if measurement.trace.is_between_torques:
        return [AcceptedValue.between_torques()]
    by_direction = [
        AcceptedValue.measured(limit, direction, covered_cycle(limit, measurement, direction))
        for direction in measurement.directions
    ]
    values = [value for value in by_direction if value.value is not None]
    # the largest value comes first, because the first of equal verdicts is chosen
    return sorted(values, key=lambda value: -(value.value or 0.0)) or [AcceptedValue()]


def _unmeasured_values(
    limit: Limit,
    request: Request,
    predictions: Predictions | None,
) -> list[AcceptedValue]:
    """Return the predicted value for a limit, an unknown value if only a measurement can decide it, or []."""
    if predictions and limit.check.needs:
        return [AcceptedValue.predicted(limit, predictions)]
    # an unknown value makes the verdict INCONCLUSIVE
    if request.strict or (not request.measured_only and not limit.check.needs):
        return [AcceptedValue()]
    return []


def _trace_records(inputs: Inputs) -> list[TraceRecord]:
    """Return the records of the recordings, then those of the approached positions, by torque."""
    records = []
    for M_g, measurement in inputs.measurements.items():
        first = measurement.directions[0]
        records.append(
            TraceRecord(
                file=measurement.trace.file,
                sha256=measurement.trace.sha256,
                M_g_Nm=M_g,
                rows=len(measurement.trace.line),
                F_ior_arcsec=measurement.F_ior_arcsec,
                F_ior_is_lower_bound=first.is_bound,
                standard_uncertainty_arcsec=first.uncertainty_arcsec,
                is_between_torques=measurement.trace.is_between_torques,
            )
        )
    for M_g, (table, error_range) in inputs.positions.items():
        records.append(
            TraceRecord(
                file=table.file,
                sha256=table.sha256,
                M_g_Nm=M_g,
                rows=len(table.lines),
                F_ior_arcsec=error_range.arcsec,
                F_ior_is_lower_bound=True,  # positions capture only a part of the range
                standard_uncertainty_arcsec=error_range.uncertainty_arcsec or 0.0,
            )
        )
    return records


def covered_cycle(
    limit: Limit,
    measurement: Measurement,
    direction: SweepResult,
) -> CoveredCycle | None:
    """Return the coverage of the full cycle by a direction, for a limit of F'_ior.

    The result is None if the cycle is unknown, or if the direction covers all of it and the model does not apply. If
    the model applies but gives no upper end, the drive cannot pass by the fitted orders, which omit waves of its teeth.
    """
    # other checks do not distinguish parts of the cycle
    if limit.check is not F_IOR or measurement.gearing is None:
        return None
    # a text states why the model gives no result
    has_no_model = isinstance(direction.full_cycle, str) and reason_outside(measurement, direction)
    if has_no_model and not direction.is_bound:
        return None
    is_one_of_two = {sweep.direction for sweep in measurement.directions} == {1, -1}
    return CoveredCycle.of(direction, measurement.gearing.ratio, is_one_of_two=is_one_of_two)


def _open_by_sharing(decision: DecidedCheck, others: Sequence[str]) -> DecidedCheck:
    """Return a decision with the verdict INCONCLUSIVE if it is based on a recording shared with other drives."""
    if decision.basis != "measured":
        return decision
    reason = f"the same recording was also given for {', '.join(others)}; --shared-records permits this"
    return replace(decision, verdict=Verdict.INCONCLUSIVE, reason=reason)


def _decisive(decisions: Sequence[DecidedCheck]) -> DecidedCheck:
    """Return the decision with the worst verdict, or the first of several such decisions.

    If a direction covers the whole cycle, a decision on a part counts only if it is close to the limit, or if the part
    is long enough for an upper end. A short return sweep thus does not prevent PASS.
    """
    if any(decision.extent == "whole" for decision in decisions):
        decisions = [decision for decision in decisions if decision.extent == "whole" or _is_decisive_part(decision)]
    return min(decisions, key=lambda decision: SEVERITY.index(decision.verdict))


def _is_decisive_part(decision: DecidedCheck) -> bool:
    """Return whether a decision on a part of the cycle counts although another direction covers the whole cycle."""
    return decision.at_most is not None or _is_close_bound(decision)


def _is_close_bound(decision: DecidedCheck) -> bool:
    """Return whether a decision is based on a lower bound that is closer to the limit than the guard band."""
    return decision.extent == "at least" and decision.room(decision.value or 0.0) < decision.guard


def _of_traces(inputs: Inputs, decisions: Sequence[DecidedCheck]) -> Iterator[Note]:
    """Yield notes on recordings."""
    for M_g, measurement in inputs.measurements.items():
        place = f"{measurement.trace.file}, {M_g:g} N*m"
        directions = measurement.directions
        by_a_part = [decision for decision in decisions if decision.M_g_Nm == M_g and _is_by_a_part(decision)]
        # the model of both directions describes the whole cycle, but only for F'_ior
        is_whole = all(decision.code == F_IOR.code for decision in by_a_part) and is_covered_together(measurement)
        if by_a_part and not is_whole:
            yield Note("COVERAGE", f"{place}: {_coverage_text(directions)}")
        # sources of uncertainty that a recording cannot show are unknown
        unstated = [source.name for source in directions[0].sources if source.arcsec is None]
        if unstated:
            yield Note("BUDGET", f"{place}: no uncertainty is stated for {', '.join(unstated)}")
        lines = dict.fromkeys(f"{line.per_cam_rev:.3f}" for direction in directions for line in direction.lines)
        if lines:
            rise = max(direction.range.rise for direction in directions)
            in_another_cycle = f"; F'_ior may be up to {rise:.3g}″ larger in another cycle" if rise else ""
            yield Note("LINES", f"{place}: components at {', '.join(lines)} per input revolution{in_another_cycle}")
        assumed = [note for note in measurement.notes if NO_UNIT in note]
        yield from (Note("RECORD", f"{place}: {text}") for text in (*measurement.warnings, *assumed))


def _is_by_a_part(decision: DecidedCheck) -> bool:
    """Return whether a decision is based on a value that does not describe the whole cycle."""
    return decision.extent not in (None, "whole", "between torques")


def _coverage_text(directions: Sequence[SweepResult]) -> str:
    """Return a text with the share of the full cycle covered by each direction that does not cover all of it."""
    shares = [direction.coverage.share for direction in directions if direction.is_bound and direction.coverage]
    texts = [f"{100 * share:.3g} % of the full mesh cycle covered" for share in shares]
    return " and ".join(texts) or "full mesh cycle unknown"


def _of_decisions(
    inputs: Inputs,
    decisions: Sequence[DecidedCheck],
    left_out: Sequence[Limit],
    predictions: Predictions | None,
) -> Iterator[Note]:
    """Yield notes on values, on unknown inputs, and on limits without a decision."""
    for decision in decisions:
        # the note is for a test uncertainty ratio below 4:1
        if decision.expanded_uncertainty is not None and decision.expanded_uncertainty > _QUARTER * decision.limit:
            text = f"U = {decision.expanded_uncertainty:.3g} (k = {COVERAGE_FACTOR:g}), limit {decision.limit:g}"
            yield Note("UNCERTAINTY", f"{decision.label}: {text}")
    rated = inputs.drive.operation.rated
    # a limit above the rated torque may have the wrong unit
    for M_g in sorted({decision.M_g_Nm for decision in decisions if decision.M_g_Nm}):
        if rated and abs(M_g) > rated:
            yield Note("RATED", f"{M_g:g} N*m is above the rated torque of {rated:g} N*m")
    if predictions and predictions.unknown:
        yield Note("UNKNOWN", f"unknown: {unknown_names(predictions.unknown)}")
    if left_out:
        yield Note("NOT_TESTED", "; ".join(limit.label for limit in left_out))


def _of_sharing(request: Request) -> Iterator[Note]:
    """Yield the note on recordings shared with other drives."""
    if request.shared:
        yield Note("SHARED_RECORD", f"the same recording was also given for {', '.join(request.shared)}")


def answer_rows(
    rows: Sequence[LotRow],
    debug: bool,
    first: int,
    last: int,
) -> list[AcceptAnswer]:
    """Return the results of the rows from first to last - 1.

    debug: whether a bug in the program is raised instead of reported as the result of a row.
    """
    # this function is called in a worker process; the rows are independent of each other
    return [answer_row(row, debug=debug) for row in rows[first:last]]


def answer_row(row: LotRow, *, debug: bool = False) -> AcceptAnswer:
    """Return the result of a row; an error in the row becomes its result.

    debug: whether a bug in the program is raised instead of reported as the result.
    """
    try:
        # a row that could not be read also has a result, which is its error
        if row.fault:
            raise row.fault
        drive = row.request.load()
        inputs = row.request.read(drive)
        # parts that differ between drives are removed, so that drives with the same preset share their predictions
        design = replace(
            row.request,
            serial="",
            measured=(),
            values=(),
            shared=(),
        )
        predictions = predicted(design, inputs.unmeasured)
        return accept(row.request, inputs, predictions, row.place)
    except HdassistError as error:
        return failure_of(row, error)
    except (MemoryError, OSError, BrokenExecutor):  # these errors are not the fault of a row
        raise
    except Exception as bug:  # a bug becomes the result of this row, and the other rows continue
        if debug:
            raise
        function = traceback.extract_tb(bug.__traceback__)[-1].name
        message = f"internal error: {type(bug).__name__}: {bug} ({function})"
        hint = "report this bug in hdassist, with the traceback shown by --debug"
        return failure_of(row, HdassistError(message, hint))


@lru_cache(maxsize=2)
def predicted(request: Request, limits: tuple[Limit, ...]) -> Predictions | None:
    """Return predictions for limits of a drive, cached for the next row in this process with the same request."""
    drive = request.load()
    return request.predict(drive, limits, request.read_wheels(drive))


def _drive_name(request: Request) -> str:
    """Return the name of the drive of a request, or the requested preset if the drive cannot be loaded."""
    try:
        return request.load().name
    except Exception:  # the reason is the error of the row, which is reported next to the name
        return request.preset


def failure_of(row: LotRow, error: HdassistError) -> AcceptAnswer:
    """Return the result of a row with an error. An error in a row is invalid data, not wrong usage."""
    # the user who runs a lot did not type the row
    kind = DataError if isinstance(error, UsageError) else error
    return AcceptAnswer(
        version=__version__,
        preset=PresetRecord(_drive_name(row.request)),
        exit_code=kind.exit_code,
        serial=row.request.serial,
        seed=row.request.seed,
        request=None if row.fault else row.request,
        time=now(),
        place=row.place,
        error=ErrorRecord(row.message(error), error.hint, kind.fault),
    )
