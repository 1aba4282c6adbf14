"""Acceptance of a drive: each limit of its preset held against what was measured, or else against the prediction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from hdassist.acceptance.checks import (
    BUDGET,
    COVERAGE,
    F_IOR,
    FROM_TRACES,
    NOT_TESTED,
    RATED,
    RECORD,
    TURN_RANGE,
    UNCERTAINTY,
    Remark,
)
from hdassist.acceptance.decision import Asked, Decision, Known, decide
from hdassist.acceptance.limits import limits_of
from hdassist.acceptance.predictions import Predictions, order_place, predict
from hdassist.errors import DataError, UsageError
from hdassist.measuring.measure import Measurement, SweepResult
from hdassist.measuring.uncertainty import COVERAGE_FACTOR
from hdassist.model.kinematics import Kinematics
from hdassist.preset.fields import Drive
from hdassist.preset.overrides import is_overridden
from hdassist.solve.answers import Progress
from hdassist.verdict import SEVERITY, Verdict, worst

QUARTER = 0.25  # of the limit: a test uncertainty ratio of 4 to 1


@dataclass(frozen=True)
class Stated:
    """A value measured elsewhere, in the unit of its check, with its standard uncertainty."""

    value: float
    uncertainty: float


@dataclass(frozen=True)
class Said:
    """A remark, and what it is about in words."""

    remark: Remark
    text: str


@dataclass(frozen=True)
class Acceptance:
    """Decisions on the limits of a drive, in the order of the checklist.

    left_out: limits that were not decided on; measurements: traces by torque [N*m]; predictions: None where all was
    measured.
    """

    drive: Drive
    decisions: tuple[Decision, ...]
    left_out: tuple[Asked, ...]
    measurements: Mapping[float, Measurement]
    predictions: Predictions | None

    @property
    def verdict(self) -> Verdict:
        """The worst of the decisions."""
        return worst(decision.verdict for decision in self.decisions)

    @property
    def remarks(self) -> tuple[Said, ...]:
        """What the verdict should not be read without."""
        return tuple(_remarks(self))


def accept(
    drive: Drive,
    measurements: Mapping[float, Measurement] | None = None,
    *,
    stated: Mapping[Asked, Stated] | None = None,
    measured_only: bool = False,
    predictions: Predictions | None = None,
    cross_check: str = "CLARABEL",
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Acceptance:
    """Hold a drive against the limits of its preset.

    Arguments: measurements, traces by their torque [N*m]; stated, values measured otherwise, by their limit;
    measured_only, leave out limits that nothing was measured for, else the model predicts their values; predictions,
    of the same drive and limits where they are known already; the others as in predict.
    Raises DataError: no limit, something measured that no limit is for, or an order that the full cycle does not
    have; UsageError: such an order on the command line; and what predict raises.
    """
    limits, measured, told = limits_of(drive), measurements or {}, stated or {}
    _require_limits(drive, limits, measured, told)
    left = to_predict(limits, measured, told)
    if measured_only and len(left) == len(limits):
        raise DataError(
            f"{drive.name}: nothing was measured that has a limit",
            "--measured FILE or --value NAME=VALUE±U, or no --measured-only",
        )
    if left and not measured_only and predictions is None:
        predictions = predict(drive, left, cross_check=cross_check, seed=seed, executor=executor, progress=progress)
    decisions = []
    for asked in limits:
        if asked in told:
            knowns: list[Known | None] = [Known(told[asked].value, told[asked].uncertainty, "stated")]
        elif asked not in left:
            knowns = [*_measured(asked, measured[asked.M_g or 0.0])] or [None]
        elif measured_only or predictions is None:
            continue
        else:
            knowns = [predictions.known(asked)]
        rule, margin = drive.acceptance.rule, drive.acceptance.margin / 100
        decisions.append(_decisive([decide(asked, known, rule, margin) for known in knowns]))
    used = predictions if left and not measured_only else None
    return Acceptance(drive, tuple(decisions), tuple(left) if measured_only else (), measured, used)


def to_predict(
    limits: Sequence[Asked], measured: Mapping[float, Measurement], stated: Mapping[Asked, Stated]
) -> list[Asked]:
    """Limits that nothing was measured for."""
    return [a for a in limits if a not in stated and not (a.check in FROM_TRACES and a.M_g in measured)]


def _require_limits(
    drive: Drive, limits: Sequence[Asked], measured: Mapping[float, Measurement], stated: Mapping[Asked, Stated]
) -> None:
    for asked in limits:
        if asked.order is not None:
            _require_order(drive, asked.order)
    for M_g in measured:
        if not any(a.M_g == M_g and a.check in FROM_TRACES for a in limits):
            raise DataError(
                f"{drive.name}: measured at {M_g:g} N*m, where it has no limit", f"--limit F_ior@{M_g:g}=30"
            )
    for asked in stated:
        if asked not in limits:
            raise DataError(
                f"{drive.name}: a value of {asked.label} is stated, which has no limit", "--limit gives one"
            )


def _require_order(drive: Drive, order: float) -> None:
    """Raise UsageError where the command line has an order that the cycle has not, DataError where the preset has."""
    try:
        order_place(Kinematics.of(drive), order)
    except UsageError as error:
        if is_overridden("acceptance.order_amplitude", drive.origin.overrides):
            raise
        raise DataError(f"{drive.name}: acceptance.order_amplitude: {error.message}", error.hint) from None


def _measured(asked: Asked, measurement: Measurement) -> list[Known]:
    """What the directions of a trace say of a limit, the greatest first."""
    found = [known for d in measurement.directions if (known := _of_direction(asked, d)) is not None]
    return sorted(found, key=lambda known: -known.value)


def _decisive(found: Sequence[Decision]) -> Decision:
    """The worst decision, the first of those alike.

    Beside a direction that visited the whole cycle, one of a part counts only where it is not clear of the limit.
    """
    known = [(decision, decision.known) for decision in found if decision.known]
    if any(k.extent == "whole" for _, k in known):
        found = [d for d, k in known if k.extent == "whole" or (k.extent == "at least" and (d.margin or 0.0) < d.guard)]
    return min(found, key=lambda decision: SEVERITY.index(decision.verdict))


def _of_direction(asked: Asked, found: SweepResult) -> Known | None:
    if asked.check == F_IOR:
        extent = found.range.value, found.uncertainty_arcsec
    elif asked.check == TURN_RANGE:
        extent = found.revolution.value, found.revolution_uncertainty_arcsec
    else:
        orders = [o for o in found.orders if abs(o.per_cam_rev - (asked.order or 0.0)) <= 0.5 / found.bins.span]
        if not orders:
            return None
        order = min(orders, key=lambda o: abs(o.per_cam_rev - (asked.order or 0.0)))
        known = Known(order.amplitude_arcsec, order.uncertainty_arcsec, "measured")
        return known if not found.is_bound else Known(known.value, known.uncertainty, "measured", "part")
    return Known(*extent, "measured", "at least" if found.is_bound else "whole")


def _remarks(result: Acceptance) -> list[Said]:
    said = []
    for M_g, measurement in result.measurements.items():
        where = f"{measurement.trace.file}, {M_g:g} N*m"
        first = measurement.directions[0]
        parts = [d for d in measurement.directions if d.is_bound]
        if any(d.asked.M_g == M_g and d.known and d.known.extent != "whole" for d in result.decisions):
            visited = [f"{100 * d.coverage.share:.3g} % of the full cycle visited" for d in parts if d.coverage]
            said.append(Said(COVERAGE, f"{where}: {' and '.join(visited) or 'unknown cycle'}"))
        missing = [source.name for source in first.sources if source.arcsec is None]
        if missing:
            said.append(Said(BUDGET, f"{where}: nothing stated of {', '.join(missing)}"))
        said += [Said(RECORD, f"{where}: {text}") for text in measurement.warnings]
    for decision in result.decisions:
        expanded, limit = decision.expanded, decision.asked.limit
        if expanded is not None and expanded > QUARTER * limit:
            text = f"{decision.asked.label}: U = {expanded:.3g} beside a limit of {limit:g}, k = {COVERAGE_FACTOR:g}"
            said.append(Said(UNCERTAINTY, text))
    rated = result.drive.operation.rated
    over = {d.asked.M_g for d in result.decisions if rated and d.asked.M_g and abs(d.asked.M_g) > rated}
    said += [
        Said(RATED, f"{M_g:g} N*m is above the rated torque of {rated:g} N*m") for M_g in sorted(filter(None, over))
    ]
    if result.left_out:
        said.append(Said(NOT_TESTED, "; ".join(asked.label for asked in result.left_out)))
    return said
