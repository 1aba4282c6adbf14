"""A measured trace as a page, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.analysis.budget import COVERAGE_FACTOR, STATED
from hdassist.analysis.measured import Direction, Measurement
from hdassist.analysis.measuredorders import MeasuredOrder
from hdassist.analysis.tracefit import waves
from hdassist.errors import HdassistError
from hdassist.preset.drive import Drive
from hdassist.report.console import Look, table
from hdassist.report.csvtext import to_csv
from hdassist.report.plot import curve
from hdassist.report.quantities import Quantity, as_object
from hdassist.version import __version__

SCHEMA = "hdassist.measure/1"
SHOWN = 12  # orders in the table, the greatest
NAMES = {1: "growing cam angle", -1: "falling cam angle"}

ORDER: tuple[Quantity[MeasuredOrder], ...] = (
    Quantity("per_cam_rev", "order", "1/turn", ".2f", lambda o: o.per_cam_rev),
    Quantity("amplitude_arcsec", "amplitude", "arcsec", ".3f", lambda o: o.amplitude_arcsec),
    Quantity("amplitude_uncertainty_arcsec", "+/-", "arcsec", ".3f", lambda o: o.uncertainty_arcsec),
    Quantity("phase_deg", "phase", "deg", ".1f", lambda o: o.phase_deg),
    Quantity("cause", "cause", "", "", lambda o: o.cause or None),
)
DIRECTION: tuple[Quantity[Direction], ...] = (
    Quantity("direction", "direction", "", "", lambda d: d.direction),
    Quantity("rows", "rows", "", "", lambda d: int(d.cells.rows.sum())),
    Quantity("sweeps", "sweeps", "", "", lambda d: len(d.fit.level)),
    Quantity("cam_revolutions", "cam turns", "", ".2f", lambda d: d.cells.span),
    Quantity("F_ior_arcsec", "F'_ior", "arcsec", ".2f", lambda d: d.range.value),
    Quantity("F_ior_is_lower_bound", "lower bound", "", "", lambda d: d.is_bound),
    Quantity("standard_uncertainty_arcsec", "u", "arcsec", ".2f", lambda d: d.uncertainty_arcsec),
    Quantity("interval_arcsec", "95 %", "arcsec", "", lambda d: list(d.interval_arcsec)),
    Quantity("band_limited_range_arcsec", "as fitted", "arcsec", ".2f", lambda d: d.range.fitted),
    Quantity("noise_bias_arcsec", "added by noise", "arcsec", ".2f", lambda d: d.range.bias),
    Quantity("raw_range_arcsec", "raw range", "arcsec", ".2f", lambda d: d.raw_range_arcsec),
    Quantity("drift_arcsec", "drift taken off", "arcsec", ".2f", lambda d: float(d.fit.drift.sum())),
    Quantity("residuals.rms_arcsec", "residuals", "arcsec", ".2f", lambda d: float(np.std(d.fit.residual))),
    Quantity("residuals.unmodelled_arcsec", "unmodelled", "arcsec", ".2f", lambda d: d.fit.unmodelled),
    Quantity("residuals.correlated_steps", "correlated", "", ".1f", lambda d: d.fit.correlated),
    Quantity("residuals.condition", "condition", "", ".3g", lambda d: d.fit.condition),
)


def _coverage(found: Direction) -> dict[str, Any] | None:
    c = found.coverage
    return c and {
        "share": c.share,
        "visited_cells": c.visited,
        "cells": c.cells,
        "cell_cam_deg": c.cam_deg,
        "cell_output_deg": c.output_deg,
    }


def answer(result: Measurement, drive: Drive | None) -> dict[str, Any]:
    """The measurement as a JSON object."""
    gearing, reversal = result.gearing, result.reversal
    return {
        "schema": SCHEMA,
        "version": __version__,
        "preset": {
            "name": drive.name if drive else None,
            "sha256": drive.origin.sha256 if drive else None,
            "overrides": list(drive.origin.overrides) if drive else [],
        },
        "file": {"name": result.trace.file, "sha256": result.trace.sha256, "rows": len(result.trace.line)},
        "exit_code": 0,
        "warnings": list(result.warnings),
        "notes": list(result.notes),
        "cycle": gearing
        and {
            "ratio": gearing.ratio,
            "cam_revolutions": gearing.cycle,
            "output_revolutions": gearing.cycle_output,
        },
        "F_ior_arcsec": result.F_ior_arcsec,
        "directions": [
            {
                **as_object(DIRECTION, found),
                "coverage": _coverage(found),
                "orders": [as_object(ORDER, order) for order in found.orders],
                "budget": [
                    {"source": s.name, "standard_uncertainty_arcsec": s.arcsec, "origin": s.origin}
                    for s in found.sources
                ],
            }
            for found in result.directions
        ],
        "reversal_error": reversal
        and {"mean_arcsec": reversal.mean_arcsec, "greatest_departure_arcsec": reversal.greatest_arcsec},
        "seed": result.seed,
    }


def failure(name: str, error: HdassistError) -> dict[str, Any]:
    """The answer about a file that has none: its error."""
    return {
        "schema": SCHEMA,
        "version": __version__,
        "preset": {"name": None, "sha256": None},
        "file": {"name": name, "sha256": None},
        "exit_code": error.exit_code,
        "warnings": [],
        "error": {"message": error.message, "hint": error.hint},
    }


def _value(found: Direction) -> str:
    low, high = found.interval_arcsec
    bound = "at least, for the angles visited: " if found.is_bound else ""
    return f"F'_ior {bound}{found.range.value:.2f} arcsec, u = {found.uncertainty_arcsec:.2f}, 95 % {low:.2f} to {high:.2f}"


def _visited(result: Measurement, found: Direction) -> str:
    if found.coverage is None or result.gearing is None:
        return f"{found.cells.span:.2f} cam turns; without --drive or --ratio the full cycle is not known"
    c, gearing = found.coverage, result.gearing
    turns = "turn" if gearing.cycle_output == 1 else "turns"
    cycle = f"full cycle: {gearing.cycle} cam turns, {gearing.cycle_output} output {turns}"
    cells = f"{c.visited} of {c.cells} cells of {c.cam_deg:g} deg of the cam by {c.output_deg:.3g} deg of the output"
    return f"visited: {100 * c.share:.1f} % of the cycle, {cells} ({cycle})"


def render(result: Measurement, drive: Drive | None, look: Look, *, plots: bool = True) -> RenderableType:
    """What was found in each direction: F'_ior, coverage, orders and budget."""
    name = f"{result.trace.file}: {len(result.trace.line)} rows" + (f", {drive.name}" if drive else "")
    parts: list[RenderableType] = [Text(look.text(name), style="bold")]
    parts += [Text(look.text(f"note: {text}")) for text in result.notes]
    for found in result.directions:
        parts += [Text(""), *_direction(result, found, look, plots)]
    if result.reversal:
        r = result.reversal
        words = f"reversal error {r.mean_arcsec:.2f} arcsec on the mean, up to {r.greatest_arcsec:.2f} arcsec off that"
        parts += [Text(""), Text(f"{words}; it is not lost motion")]
    return Group(*parts)


def _direction(result: Measurement, found: Direction, look: Look, plots: bool) -> list[RenderableType]:
    parts: list[RenderableType] = [Text(f"{NAMES[found.direction]}: {_value(found)}", style="bold")]
    raw = f"raw range {found.raw_range_arcsec:.2f} arcsec; limited to the orders {found.range.fitted:.2f}"
    parts += [Text(f"{raw}, of which noise adds {found.range.bias:.2f}"), Text(_visited(result, found)), Text("")]
    if plots:
        first = found.cells.sweep == 0
        x, y = found.cells.turns[first], found.cells.error[first] - found.fit.level[0]
        drawn = curve(look, x, y, x_label="cam angle, turns", y_label="error, arcsec")
        parts += [Text(drawn), Text("")]
    grid = table(look, f"orders: amplitude·cos(order·angle + phase), the {SHOWN} greatest of {len(found.orders)}")
    shown = ORDER if any(order.cause for order in found.orders) else ORDER[:-1]
    for quantity in shown:
        words = look.text(quantity.words)
        grid.add_column(words, justify="left" if quantity is ORDER[-1] else "right", overflow="fold")
    greatest = sorted(found.orders, key=lambda o: -o.amplitude_arcsec)[:SHOWN]
    for order in sorted(greatest, key=lambda o: o.per_cam_rev):
        grid.add_row(*(look.text(quantity.text(order)) for quantity in shown))
    sources = table(look, f"standard uncertainty of F'_ior; u combined, 95 %: k = {COVERAGE_FACTOR:g}")
    for words in ("source", "arcsec", "from"):
        sources.add_column(words, justify="right" if words == "arcsec" else "left", overflow="fold")
    for source in found.sources:
        sources.add_row(source.name, "-" if source.arcsec is None else f"{source.arcsec:.3f}", look.text(source.origin))
    sources.add_row("combined", f"{found.uncertainty_arcsec:.3f}", "" if _all_stated(found) else "without what is -")
    return [*parts, grid, sources]


def _all_stated(found: Direction) -> bool:
    return sum(source.arcsec is not None for source in found.sources if source.name in STATED) == len(STATED)


def csv(results: Sequence[Measurement]) -> str:
    """One row per step of the angle, in each direction: error less its level and drift, and the fitted curve."""
    rows: list[list[Any]] = []
    for result in results:
        for found in result.directions:
            cells = found.cells
            fitted = np.concatenate(
                [waves(cells.turns[k : k + 8192], found.fit.orders) @ found.fit.coefficients for k in range(0, len(cells), 8192)]
            )  # fmt: skip
            columns = (cells.sweep, 360 * cells.turns, fitted + found.fit.residual, fitted)
            sets = zip(*(column.tolist() for column in columns), strict=True)
            rows += [[result.trace.file, found.direction, *values] for values in sets]
    return to_csv(["file", "direction", "sweep", "cam_deg", "error_arcsec", "fitted_arcsec"], rows)


def brief(result: Measurement) -> str:
    """The answer alone: F'_ior with its expanded uncertainty."""
    found = result.directions[0]
    bound = ">= " if found.is_bound else ""
    return f"{bound}{found.range.value:.2f} +- {COVERAGE_FACTOR * found.uncertainty_arcsec:.2f} arcsec"
