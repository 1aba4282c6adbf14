"""Acceptance of a drive, and of the rows of a lot: each limit with the measured value, or else with the predicted one.

Rows are work for `run/run.stream`: the answer of each is that of its drive alone.
"""

from __future__ import annotations

import traceback
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from functools import lru_cache

from hdassist import __version__
from hdassist.acceptance.answer import (
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
from hdassist.acceptance.decision import AcceptedValue, CoveredCycle, DecidedCheck, Predictions, decide
from hdassist.acceptance.limits import F_IOR, Limit, limits_of
from hdassist.acceptance.request import Inputs, LotRow, Request
from hdassist.errors import GUARD, SEVERITY, DataError, HdassistError, UsageError, Verdict, worst
from hdassist.measuring.fit import COVERAGE_FACTOR
from hdassist.measuring.full_cycle import with_full_cycle
from hdassist.measuring.measure import Measurement, SweepResult
from hdassist.model.deviations import unknown_names
from hdassist.readers.table import NO_UNIT

_QUARTER = 0.25  # of the limit: a test uncertainty ratio of 4 to 1


def accept(
    request: Request,
    inputs: Inputs,
    predictions: Predictions | None = None,
    place: str | None = None,
) -> AcceptAnswer:
    """Hold a drive against the limits of its preset.

    Arguments: request; inputs that it names; predictions that it needs, of the same drive and limits; place of the row
    of a lot. Raises DataError: no limit, something measured that no limit is for,
    nothing measured without a prediction, or an order that the full cycle does not have; UsageError: such an
    order on the command line.
    """
    drive = inputs.drive
    measured = {M_g: with_full_cycle(measurement) for M_g, measurement in inputs.measurements.items()}
    inputs = replace(inputs, measurements=measured)
    limits, rule = limits_of(drive), drive.acceptance.rule
    left = inputs.unmeasured
    if predictions is None and len(left) == len(limits) and not request.strict:
        raise DataError(
            f"{drive.name}: no measured value belongs to a limit",
            " ".join(limit.option for limit in limits) + ", or no --measured-only" * request.measured_only,
        )
    decisions = []
    for limit in limits:
        if limit in inputs.stated:
            values = [inputs.stated[limit]]
        elif limit not in left and measured[limit.M_g_Nm or 0.0].trace.is_between_torques:
            values = [AcceptedValue.between_torques()]
        elif limit not in left:
            measurement = measured[limit.M_g_Nm or 0.0]
            by_direction = [
                AcceptedValue.measured(limit, direction, _covered_cycle(limit, measurement, direction))
                for direction in measurement.directions
            ]
            values = sorted(
                (value for value in by_direction if value.value is not None), key=lambda value: -(value.value or 0.0)
            )
            values = values or [AcceptedValue()]
        elif predictions and limit.check.needs:
            values = [AcceptedValue.predicted(limit, predictions)]
        elif request.strict or (not request.measured_only and not limit.check.needs):
            values = [AcceptedValue()]  # only a measured value decides it
        else:
            continue
        decisions.append(_decisive([decide(limit, value, rule, request.sure) for value in values]))
    if request.shared and not request.shared_records:
        decisions = [_open_by_sharing(decision, request.shared) for decision in decisions]
    left_out = [] if predictions or request.strict else left
    samples = predictions.samples if predictions else None
    remarks = [*_of_traces(inputs, decisions), *_of_decisions(inputs, decisions, left_out, predictions)]
    if request.shared:
        remarks.append(Note("SHARED_RECORD", f"a recording is that of {', '.join(request.shared)} too"))
    verdict = worst(decision.verdict for decision in decisions)
    traces = [
        TraceRecord(
            found.trace.file, found.trace.sha256, M_g, len(found.trace.line), found.F_ior_arcsec,
            found.directions[0].is_bound, found.directions[0].uncertainty_arcsec, found.trace.is_between_torques,
        )
        for M_g, found in measured.items()
    ]  # fmt: skip
    traces += [
        TraceRecord(
            table.file, table.sha256, M_g, len(table.lines), found.arcsec, True, found.uncertainty_arcsec or 0.0
        )
        for M_g, (table, found) in inputs.positions.items()
    ]
    return ANSWER.validate_python({
        "version": __version__,
        "preset": PresetRecord(drive.name, drive.origin.sha256, drive.origin.overrides),
        "exit_code": verdict.exit_code,
        "warnings": (*drive.origin.warnings, *(samples.remarks if samples else ())),
        "serial": request.serial,
        "seed": request.seed,
        "request": request,
        "time": now(),
        "verdict": verdict,
        "checks": decisions,
        "left_out": [limit.label for limit in left_out],
        "remarks": remarks,
        "measured": traces,
        "rule": RuleRecord(rule, GUARD * (rule == "guard"), request.sure),
        "place": place,
        **of_predictions(predictions, inputs.wheels),
    })  # fmt: skip


def _covered_cycle(limit: Limit, measurement: Measurement, direction: SweepResult) -> CoveredCycle | None:
    """Return what a direction covers of the full cycle, for a limit of F'_ior.

    None if the cycle is not known, or if a direction covers all of it and its model does not hold.
    """
    if limit.check is not F_IOR or measurement.gearing is None:
        return None
    if isinstance(direction.full_cycle, str) and not direction.is_bound:
        return None
    return CoveredCycle.of(direction, measurement.gearing.ratio)


def _open_by_sharing(decision: DecidedCheck, others: Sequence[str]) -> DecidedCheck:
    """Return a decision without its verdict if it is by a recording, which is that of other drives too."""
    if decision.basis != "measured":
        return decision
    reason = f"the recording is that of {', '.join(others)} too (--shared-records)"
    return replace(decision, verdict=Verdict.INCONCLUSIVE, reason=reason)


def _decisive(decisions: Sequence[DecidedCheck]) -> DecidedCheck:
    """The worst decision, the first of those alike.

    Beside a direction that visited the whole cycle, one of a part counts only where it is not clear of the limit.
    """
    if any(d.extent == "whole" for d in decisions):
        close = [d for d in decisions if d.extent == "at least" and d.room(d.value or 0.0) < d.guard]
        decisions = [d for d in decisions if d.extent == "whole" or d in close]
    return min(decisions, key=lambda decision: SEVERITY.index(decision.verdict))


def _of_traces(inputs: Inputs, decisions: Sequence[DecidedCheck]) -> Iterator[Note]:
    """Remarks on traces."""
    for M_g, measurement in inputs.measurements.items():
        where, directions = f"{measurement.trace.file}, {M_g:g} N*m", measurement.directions
        if any(d.M_g_Nm == M_g and d.extent not in (None, "whole", "between torques") for d in decisions):
            shares = [direction.coverage.share for direction in directions if direction.is_bound and direction.coverage]
            visited = [f"{100 * share:.3g} % of the full mesh cycle covered" for share in shares]
            yield Note("COVERAGE", f"{where}: {' and '.join(visited) or 'unknown cycle'}")
        if missing := [source.name for source in directions[0].sources if source.arcsec is None]:
            yield Note("BUDGET", f"{where}: no uncertainty is stated for {', '.join(missing)}")
        if lines := dict.fromkeys(f"{line.per_cam_rev:.3f}" for direction in directions for line in direction.lines):
            rise = max(direction.range.rise for direction in directions)
            more = f"; F'_ior may be {rise:.3g}″ larger in another cycle" if rise else ""
            yield Note("LINES", f"{where}: {', '.join(lines)} per input revolution{more}")
        assumed = [note for note in measurement.notes if NO_UNIT in note]
        yield from (Note("RECORD", f"{where}: {text}") for text in (*measurement.warnings, *assumed))


def _of_decisions(
    inputs: Inputs, decisions: Sequence[DecidedCheck], left_out: Sequence[Limit], predictions: Predictions | None
) -> Iterator[Note]:
    """Remarks on values, on unknown inputs, and on limits without a decision."""
    for decision in decisions:
        if decision.expanded_uncertainty is not None and decision.expanded_uncertainty > _QUARTER * decision.limit:
            text = f"U = {decision.expanded_uncertainty:.3g} (k = {COVERAGE_FACTOR:g}), limit {decision.limit:g}"
            yield Note("UNCERTAINTY", f"{decision.label}: {text}")
    rated = inputs.drive.operation.rated
    for M_g in sorted({decision.M_g_Nm for decision in decisions if decision.M_g_Nm}):
        if rated and abs(M_g) > rated:
            yield Note("RATED", f"{M_g:g} N*m is above the rated torque of {rated:g} N*m")
    if predictions and predictions.unknown:
        yield Note("UNKNOWN", f"unknown: {unknown_names(predictions.unknown)}")
    if left_out:
        yield Note("NOT_TESTED", "; ".join(limit.label for limit in left_out))


def answer_rows(rows: Sequence[LotRow], debug: bool, first: int, last: int) -> list[AcceptAnswer]:
    """Answers to the rows first ... last - 1; debug: whether a bug in a row is raised, and no answer."""
    return [answer_row(row, debug=debug) for row in rows[first:last]]


def answer_row(row: LotRow, *, debug: bool = False) -> AcceptAnswer:
    """The answer of a row; whatever is wrong with it is its answer."""
    try:
        if row.fault:
            raise row.fault
        drive = row.request.load()
        inputs = row.request.read(drive)
        alike = replace(row.request, serial="", measured=(), values=(), shared=())
        predictions = predicted(alike, inputs.unmeasured)
        return accept(row.request, inputs, predictions, row.place)
    except HdassistError as error:
        return failure_of(row, error)
    except (MemoryError, OSError, BrokenExecutor):  # a refusal of the system, or a lost process, is no row's
        raise
    except Exception as bug:  # the result of this row, with the exit code of a bug; the other rows continue
        if debug:
            raise
        where = traceback.extract_tb(bug.__traceback__)[-1]
        words = f"internal error: {type(bug).__name__}: {bug} ({where.name})"
        return failure_of(
            row, HdassistError(words, "report this bug in hdassist, with the traceback that --debug shows")
        )


@lru_cache(maxsize=2)
def predicted(request: Request, limits: tuple[Limit, ...]) -> Predictions | None:
    """Predictions for limits of a drive, kept for the next row in this process that needs the same."""
    drive = request.load()
    return request.predict(drive, limits, request.read_wheels(drive))


def _drive_name(request: Request) -> str:
    """Return the name of the drive of a request, that of its preset as asked for if it cannot be loaded."""
    try:
        return request.load().name
    except Exception:  # why it cannot be loaded is the row's own error, which is reported beside the name
        return request.preset


def failure_of(row: LotRow, error: HdassistError) -> AcceptAnswer:
    """The answer of a row with an error; the fault of a row is wrong data, not wrong usage."""
    kind, request = DataError if isinstance(error, UsageError) else error, row.request
    return AcceptAnswer(
        version=__version__, preset=PresetRecord(_drive_name(request)), exit_code=kind.exit_code, serial=request.serial,
        seed=request.seed, request=None if row.fault else request, time=now(), place=row.place,
        error=ErrorRecord(row.message(error), error.hint, kind.fault),
    )  # fmt: skip
