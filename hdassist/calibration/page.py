"""A calibration as tables, and as JSON."""

from __future__ import annotations

from math import isfinite

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.calibration.calibrate import Calibration, Fit
from hdassist.calibration.shortfall import in_the_way
from hdassist.calibration.targets import Target
from hdassist.model.unknown import told
from hdassist.terminal.answers import Json, envelope
from hdassist.terminal.console import Style, table
from hdassist.terminal.runs import Answer

UNSEEN = 0.1  # a value whose interval the targets have narrowed by less is the bounds' alone


def answer(result: Calibration) -> Answer:
    """What there is to say of a calibration."""
    return Answer(
        to_json=lambda: to_json(result),
        page=lambda style: render(result, style),
        summary_line=lambda: summary_line(result),
        about=result.drive.name,
        warnings=warnings(result),
        proof=f"{result.evaluations} drives computed",
    )


MOVED = {"F_ior", "F_ior_max", "F_ior_min", "revolution_range", "trace"}  # by deviations


def warnings(result: Calibration) -> tuple[str, ...]:
    """What a reader should know beside the numbers."""
    best, drive = result.best, result.drive
    words, wanted = [*drive.origin.warnings], result.targets
    if any(target.quantity in MOVED for target in wanted.targets):
        words += told(drive)
    if missed := in_the_way(wanted.unknowns, wanted.targets, best.found, best.met, result.held):
        words.append(f"targets are missed: {missed}; the values are the nearest that were found")
    unseen = [u.path for u, share in zip(result.targets.unknowns, result.determined, strict=True) if share < UNSEEN]
    if unseen:
        words.append(f"the targets say nothing about {', '.join(unseen)}")
    words += [f"the targets cannot tell {a} and {b} apart (correlation {r:+.2f})" for a, b, r in result.indistinct]
    return tuple(words)


def render(result: Calibration, style: Style) -> RenderableType:
    """Targets met or missed, values found with their intervals, and the sets that do as well."""
    heading = f"{result.drive.name}: {len(result.targets.unknowns)} values from {len(result.targets.targets)} targets"
    parts: list[RenderableType] = [
        Text(style.text(f"{heading} ({result.targets.name})" if result.targets.name else heading), style="bold"),
        _targets(result, style),
        _values(result, style),
        _sets(result, style),
        Text(style.text(
            "Interval: half-widths as the tolerances are; the bounds count as knowledge. Fitted targets are no "
            "evidence for the model: what was not fitted is."
        )),
    ]  # fmt: skip
    return Group(*(line for part in parts for line in (part, Text(""))))


def _wanted(target: Target) -> str:
    if target.value is not None:
        return f"{target.value:g} +- {target.tolerance:.3g}"
    low, high = (f"{x:g}" if isfinite(x) else "" for x in (target.low, target.high))
    return f"{low} to {high}" if low and high else f"{low} or more" if low else f"{high} or less"


def _targets(result: Calibration, style: Style) -> Table:
    grid = table(style, "targets")
    grid.add_column("target", overflow="fold")
    for words in ("unit", "wanted", "found", "off, tolerances", ""):
        grid.add_column(words, justify="right")
    best = result.best
    for target, found, off, met in zip(result.targets.targets, best.found, best.off, best.met, strict=True):
        unit = target.unit
        row = (target.words, unit, _wanted(target), f"{found:.4g}", f"{off:+.2f}", "met" if met else "MISSED")
        grid.add_row(*map(style.text, row))
    return grid


def _values(result: Calibration, style: Style) -> Table:
    grid = table(style, "values")
    grid.add_column("field", overflow="fold")
    for words in ("unit", "start", "found", "+-", "bounds", "determined"):
        grid.add_column(words, justify="right")
    columns = (result.targets.unknowns, result.start, result.best.values, result.half_width, result.determined)
    for unknown, start, value, half, share in zip(*columns, strict=True):
        row = (
            unknown.path, unknown.unit, f"{start:g}", f"{value:g}", f"{half:.2g}",
            f"{unknown.low:g} to {unknown.high:g}", f"{share:.0%}",
        )  # fmt: skip
        grid.add_row(*map(style.text, row))
    return grid


def _sets(result: Calibration, style: Style) -> Table:
    grid = table(style, "sets that were kept, and the mounting phase each finds best, deg")
    grid.add_column("field", overflow="fold")
    for k in range(len(result.fits)):
        grid.add_column("best" if k == 0 else f"other {k}", justify="right")
    for row, unknown in enumerate(result.targets.unknowns):
        grid.add_row(unknown.path, *(f"{fit.values[row]:g}" for fit in result.fits))
    for row, M_g in enumerate(result.drive.operation.M_g):
        phases = (fit.best_deg[row] for fit in result.fits)
        grid.add_row(
            style.text(f"best phase at {M_g:g} N·m"), *("-" if deg is None else f"{deg:.0f}" for deg in phases)
        )
    worst = (max(map(abs, fit.off)) for fit in result.fits)
    grid.add_row("furthest target, tolerances", *(f"{off:.2f}" for off in worst))
    return grid


def to_json(result: Calibration) -> Json:
    """The calibration as a JSON object."""
    unknowns, targets = result.targets.unknowns, result.targets.targets

    def one(fit: Fit) -> Json:
        return {
            "values": result.targets.by_path(fit.values),
            "off_tolerances": list(fit.off),
            "found": list(fit.found),
            "best_phase_deg": list(fit.best_deg),
            "targets_met": list(fit.met),
            "met": fit.all_met,
        }

    return {
        **envelope("calibrate", result.drive, 0, warnings(result)),
        "targets_file": {"name": result.targets.name, "sha256": result.targets.sha256},
        "targets": [
            {
                "quantity": t.quantity,
                "unit": t.unit,
                "asked": dict(t.asked),
                "value": t.value,
                "low": t.low if isfinite(t.low) else None,
                "high": t.high if isfinite(t.high) else None,
                "tolerance": t.tolerance,
            }
            for t in targets
        ],
        "unknowns": [
            {
                "path": u.path,
                "unit": u.unit,
                "low": u.low,
                "high": u.high,
                "start": start,
                "found": value,
                "half_width": half,
                "determined": share,
                "held_at": bound,
            }
            for u, start, value, half, share, bound in zip(
                unknowns,
                result.start,
                result.best.values,
                result.half_width,
                result.determined,
                result.held,
                strict=True,
            )
        ],
        "correlation": result.correlation.tolist(),
        "best": one(result.best),
        "alternatives": [one(fit) for fit in result.alternatives],
        "evaluations": result.evaluations,
        "seed": result.seed,
    }


def summary_line(result: Calibration) -> str:
    """The answer alone: the values, in the form of --set."""
    return "\n".join(f"{path}={value!r}" for path, value in result.targets.by_path(result.best.values).items())
