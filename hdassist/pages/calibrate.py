"""A calibration as a report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite

from hdassist.calibration.calibrate import Calibration, Fit
from hdassist.calibration.targets import CalibrationTarget, SoughtField
from hdassist.json_parts import Json, attributes
from hdassist.model.unknown import unknown_notes
from hdassist.report.blocks import Facts, Table
from hdassist.report.quantities import NO_VALUE, Quantity, as_object
from hdassist.report.report import Report

UNDETERMINED = 0.1  # a value whose interval the targets have narrowed by less is the bounds' alone
MOVED = {"F_ior", "F_ior_max", "F_ior_min", "revolution_range", "trace"}  # by deviations
NOTE = "fitted targets are no evidence for the model: targets that were not fitted are"


@dataclass(frozen=True)
class FoundValue:
    """A value of the best set; start, half width of its interval and the bound where it is held in its unit."""

    unknown: SoughtField
    start: float
    found: float
    half_width: float
    determined: float
    held_at: float | None


FOUND_VALUES: tuple[Quantity[FoundValue], ...] = (
    Quantity("path", "field", "", "", "unknown.path"),
    Quantity("unit", "unit", "", "", "unknown.unit"),
    Quantity("start", "start", "", "g"),
    Quantity("found", "found", "", "g"),
    Quantity("half_width", "±", "", ".2g"),
    Quantity("low", "least", "", "g", "unknown.low"),
    Quantity("high", "most", "", "g", "unknown.high"),
    Quantity("determined", "determined", "", ".0%"),
    Quantity("held_at", "held at bound", "", "g"),
)


def calibrate_report(result: Calibration) -> Report:
    """A calibration."""
    wanted, best = result.targets, result.best
    columns = (wanted.unknowns, result.start, best.values, result.half_width, result.determined, result.held)
    values = [FoundValue(*row) for row in zip(*columns, strict=True)]
    name = f" ({wanted.name})" * bool(wanted.name)
    write = "the same command with --write FILE writes a preset with these values"
    return Report(
        command="calibrate",
        drive=result.drive,
        head=f"{result.drive.name}, calibration{name}",
        verdict=f"{sum(best.met)} of {len(best.met)} targets met",
        why=(result.shortfall or f"sets of values that meet all targets: {len(result.fits)}",),
        blocks=(
            Table.by_row("values, half width of their interval, bounds", FOUND_VALUES[:-1], values, words=(0, 1)),
            _targets(result),
            Facts((("note", NOTE), ("next", write))),
        ),
        details=(_sets(result),),
        values={
            "targets_file": attributes(wanted, "name", "sha256"),
            "targets": [
                attributes(each, "quantity", "unit", "asked", "value", "tolerance")
                | {end: bound if isfinite(bound := getattr(each, end)) else None for end in ("low", "high")}
                for each in wanted.targets
            ],
            "unknowns": [as_object(FOUND_VALUES, value) for value in values],
            "best": _set_object(result, best),
            "alternatives": [_set_object(result, fit) for fit in result.fits[1:]],
            **attributes(result, "correlation", "evaluations", "seed"),
        },
        # in the form of --set
        line="\n".join(f"{path}={value!r}" for path, value in wanted.by_path(best.values).items()),
        warnings=tuple(_warnings(result)),
    )


def _warnings(result: Calibration) -> Iterator[str]:
    wanted = result.targets
    yield from result.drive.origin.warnings
    if any(target.quantity in MOVED for target in wanted.targets):
        yield from unknown_notes(result.drive)
    if result.shortfall:
        yield f"targets are missed: {result.shortfall}; the values are the nearest that were found"
    open_ = [path for path, share in wanted.by_path(result.determined).items() if share < UNDETERMINED]
    if open_:
        yield f"the targets do not determine {', '.join(open_)}"
    for a, b, r in result.indistinct:
        yield f"the targets cannot tell {a} and {b} apart (correlation {r:+.2f})"


def _wanted(target: CalibrationTarget) -> str:
    if target.value is not None:
        return f"{target.value:g} ± {target.tolerance:.3g}"
    low, high = (f"{x:g}" if isfinite(x) else "" for x in (target.low, target.high))
    return f"{low} to {high}" if low and high else f"{low} or more" if low else f"{high} or less"


def _targets(result: Calibration) -> Table:
    best = result.best
    columns = (result.targets.targets, best.predictions, best.deviations, best.met)
    rows = tuple(
        (t.words, t.unit, _wanted(t), f"{found:.4g}", f"{off:+.2f}", "met" if met else "MISSED")
        for t, found, off, met in zip(*columns, strict=True)
    )
    return Table("targets", ("target", "unit", "wanted", "found", "off, tolerances", ""), rows)


def _sets(result: Calibration) -> Table:
    rows = [
        (unknown.path, *(f"{fit.values[row]:g}" for fit in result.fits))
        for row, unknown in enumerate(result.targets.unknowns)
    ]
    for row, M_g in enumerate(result.drive.operation.M_g):
        phases = (fit.best_deg[row] for fit in result.fits)
        rows.append((f"best phase at {M_g:g} N·m", *(NO_VALUE if deg is None else f"{deg:.0f}" for deg in phases)))
    heads = ("field", "best", *(f"other {k}" for k in range(1, len(result.fits))))
    return Table("sets of values that were kept, and the best mounting phase of each, °", heads, tuple(rows))


def _set_object(result: Calibration, fit: Fit) -> Json:
    return {
        "values": result.targets.by_path(fit.values),
        "off_tolerances": fit.deviations,
        "found": fit.predictions,
        "best_phase_deg": fit.best_deg,
        "targets_met": fit.met,
        "met": fit.all_met,
    }
