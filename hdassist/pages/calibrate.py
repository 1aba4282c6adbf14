"""A calibration as tables, and as JSON."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.calibration.calibrate import Calibration, Fit
from hdassist.calibration.targets import CalibrationTarget
from hdassist.json_parts import Json
from hdassist.model.unknown import unknown_notes
from hdassist.terminal.answers import envelope
from hdassist.terminal.console import Style, table
from hdassist.terminal.runs import Answer

UNDETERMINED = 0.1  # a value whose interval the targets have narrowed by less is the bounds' alone
MOVED = {"F_ior", "F_ior_max", "F_ior_min", "revolution_range", "trace"}  # by deviations
NOTE = (
    "Interval: half-widths as the tolerances are; the bounds count as knowledge. Fitted targets are no evidence for "
    "the model: what was not fitted is."
)


def calibrate_answer(result: Calibration) -> Answer:
    """A calibration as a page, as JSON and in a line."""
    return Answer(
        to_json=lambda: _to_json(result),
        page=lambda style: _render(result, style),
        # the values, in the form of --set
        summary_line=lambda: "\n".join(f"{path}={value!r}" for path, value in _best(result).items()),
        about=result.drive.name,
        warnings=_warnings(result),
        proof=f"{result.evaluations} drives computed",
    )


def _best(result: Calibration) -> dict[str, float]:
    return result.targets.by_path(result.best.values)


def _warnings(result: Calibration) -> tuple[str, ...]:
    wanted = result.targets
    words = [*result.drive.origin.warnings]
    if any(target.quantity in MOVED for target in wanted.targets):
        words += unknown_notes(result.drive)
    if result.shortfall:
        words.append(f"targets are missed: {result.shortfall}; the values are the nearest that were found")
    shares = wanted.by_path(result.determined)
    if unseen := [path for path, share in shares.items() if share < UNDETERMINED]:
        words.append(f"the targets say nothing about {', '.join(unseen)}")
    words += [f"the targets cannot tell {a} and {b} apart (correlation {r:+.2f})" for a, b, r in result.indistinct]
    return tuple(words)


def _render(result: Calibration, style: Style) -> RenderableType:
    """Targets met or missed, values found with their intervals, and the sets that do as well."""
    heading = f"{result.drive.name}: {len(result.targets.unknowns)} values from {len(result.targets.targets)} targets"
    parts: list[RenderableType] = [
        Text(style.text(f"{heading} ({result.targets.name})" if result.targets.name else heading), style="bold"),
        _targets(result, style),
        _values(result, style),
        _sets(result, style),
        Text(style.text(NOTE)),
    ]
    return Group(*(line for part in parts for line in (part, Text(""))))


def _table(style: Style, title: str, first: str, columns: Iterable[str]) -> Table:
    grid = table(style, title)
    grid.add_column(first, overflow="fold")
    for words in columns:
        grid.add_column(words, justify="right")
    return grid


def _wanted(target: CalibrationTarget) -> str:
    if target.value is not None:
        return f"{target.value:g} +- {target.tolerance:.3g}"
    low, high = (f"{x:g}" if isfinite(x) else "" for x in (target.low, target.high))
    return f"{low} to {high}" if low and high else f"{low} or more" if low else f"{high} or less"


def _targets(result: Calibration, style: Style) -> Table:
    grid, best = _table(style, "targets", "target", ("unit", "wanted", "found", "off, tolerances", "")), result.best
    columns = (result.targets.targets, best.predictions, best.deviations, best.met)
    for target, found, off, met in zip(*columns, strict=True):
        words = "met" if met else "MISSED"
        row = (target.words, target.unit, _wanted(target), f"{found:.4g}", f"{off:+.2f}", words)
        grid.add_row(*map(style.text, row))
    return grid


def _values(result: Calibration, style: Style) -> Table:
    grid = _table(style, "values", "field", ("unit", "start", "found", "+-", "bounds", "determined"))
    columns = (result.targets.unknowns, result.start, result.best.values, result.half_width, result.determined)
    for u, start, value, half, share in zip(*columns, strict=True):
        bounds = f"{u.low:g} to {u.high:g}"
        row = (u.path, u.unit, f"{start:g}", f"{value:g}", f"{half:.2g}", bounds, f"{share:.0%}")
        grid.add_row(*map(style.text, row))
    return grid


def _sets(result: Calibration, style: Style) -> Table:
    title = "sets that were kept, and the mounting phase each finds best, deg"
    grid = _table(style, title, "field", ["best", *(f"other {k}" for k in range(1, len(result.fits)))])
    for row, unknown in enumerate(result.targets.unknowns):
        grid.add_row(unknown.path, *(f"{fit.values[row]:g}" for fit in result.fits))
    for row, M_g in enumerate(result.drive.operation.M_g):
        phases = (fit.best_deg[row] for fit in result.fits)
        words = style.text(f"best phase at {M_g:g} N·m")
        grid.add_row(words, *("-" if deg is None else f"{deg:.0f}" for deg in phases))
    furthest = (max(map(abs, fit.deviations)) for fit in result.fits)
    grid.add_row("furthest target, tolerances", *(f"{off:.2f}" for off in furthest))
    return grid


def _to_json(result: Calibration) -> Json:
    targets = result.targets

    def one(fit: Fit) -> Json:
        return {
            "values": targets.by_path(fit.values),
            "off_tolerances": list(fit.deviations),
            "found": list(fit.predictions),
            "best_phase_deg": list(fit.best_deg),
            "targets_met": list(fit.met),
            "met": fit.all_met,
        }

    names = ("start", "found", "half_width", "determined", "held_at")
    columns = (result.start, result.best.values, result.half_width, result.determined, result.held)
    return {
        **envelope("calibrate", result.drive, 0, _warnings(result)),
        "targets_file": {"name": targets.name, "sha256": targets.sha256},
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
            for t in targets.targets
        ],
        "unknowns": [
            {"path": u.path, "unit": u.unit, "low": u.low, "high": u.high, **dict(zip(names, row, strict=True))}
            for u, *row in zip(targets.unknowns, *columns, strict=True)
        ],
        "correlation": result.correlation.tolist(),
        "best": one(result.best),
        "alternatives": [one(fit) for fit in result.fits[1:]],
        "evaluations": result.evaluations,
        "seed": result.seed,
    }
