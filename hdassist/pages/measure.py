"""A measured trace as a page, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.json_parts import Json
from hdassist.measuring.measure import Measurement, SweepResult
from hdassist.measuring.orders import MeasuredOrder
from hdassist.measuring.uncertainty import COVERAGE_FACTOR, STATED
from hdassist.preset.fields import Drive
from hdassist.report.quantities import Quantity, as_object
from hdassist.terminal.answers import envelope
from hdassist.terminal.brief import again, facts
from hdassist.terminal.console import Style, table
from hdassist.terminal.plot import curve
from hdassist.terminal.runs import Answer, CsvTable
from hdassist.textfile import STDIN

SHOWN_ORDERS, NAMED_ORDERS = 12, 3  # orders in the table, and in a line: the greatest
MANY_TURNS = 8  # cam turns from which on their least and greatest values are drawn
ENVELOPE = "error, arcsec: least and greatest around each cam turn"
DIRECTION_NAMES = {1: "growing cam angle", -1: "falling cam angle"}

ORDER_COLUMNS: tuple[Quantity[MeasuredOrder], ...] = (
    Quantity("per_cam_rev", "order", "1/turn", ".2f", lambda o: o.per_cam_rev),
    Quantity("amplitude_arcsec", "amplitude", "arcsec", ".3f", lambda o: o.amplitude_arcsec),
    Quantity("amplitude_uncertainty_arcsec", "+/-", "arcsec", ".3f", lambda o: o.uncertainty_arcsec),
    Quantity("phase_deg", "phase", "deg", ".1f", lambda o: o.phase_deg),
    Quantity("cause", "cause", "", "", lambda o: o.cause or None),
)


def measure_answer(result: Measurement, drive: Drive | None, *, plots: bool, details: bool = False) -> Answer:
    """A measured trace as a page, JSON, CSV and a line; plots: whether it is drawn; details: with all tables."""
    return Answer(
        to_json=lambda: _to_json(result, drive),
        page=lambda style: _render(result, drive, style, plots=plots, details=details),
        summary_line=lambda: _summary_line(result),
        figures=lambda: _figures(result),
        about=result.trace.file,
        warnings=result.warnings,
    )


def _render(
    result: Measurement, drive: Drive | None, style: Style, *, plots: bool = True, details: bool = False
) -> RenderableType:
    """F'_ior in each direction and what it takes to read it right; with details all orders and the budget."""
    name = f"{result.trace.file}: {len(result.trace.line)} rows" + (f", {drive.name}" if drive else "")
    parts: list[RenderableType] = [Text(style.text(name), style="bold")]
    for found in result.directions:
        parts += [Text(""), *_direction(found, style, plots)]
        parts.append(facts(style, _facts(result, found, details=details)))
        if details:
            parts += [Text(""), _orders(found, style), _budget(found, style)]
    return Group(*parts, Text(""), facts(style, _below(result, drive, details=details)))


def _direction(found: SweepResult, style: Style, plots: bool) -> list[RenderableType]:
    heading = Text(f"{DIRECTION_NAMES[found.direction]}: {_value(found)}", style="bold")
    if not plots:
        return [heading]
    first = found.bins.sweep == 0
    x, y = found.bins.turns[first], found.bins.error[first] - found.fit.level[0]
    over, label = (1.0, ENVELOPE) if np.ptp(x) > MANY_TURNS else (0.0, "error, arcsec")
    return [heading, Text(""), Text(curve(style, x, y, x_label="cam angle, turns", y_label=label, over=over)), Text("")]


def _facts(result: Measurement, found: SweepResult, *, details: bool) -> Iterator[tuple[str, str]]:
    """Facts on a direction, a label and a text each."""
    if details:
        raw = f"{found.raw_range_arcsec:.2f} arcsec as read; limited to the orders {found.range.fitted:.2f}"
        yield "range", f"{raw}, of which noise adds {found.range.bias:.2f}"
    yield "in a turn", f"at most {found.revolution.value:.2f} arcsec, u = {found.revolution_uncertainty_arcsec:.2f}"
    if found.lines:
        yield "lines", _lines(found)
    yield "visited", _visited(result, found, details=details)
    if not details:
        greatest = sorted(found.orders, key=lambda o: -o.amplitude_arcsec)[:NAMED_ORDERS]
        yield "orders", "; ".join(map(_order, greatest))
        missing = [source.name for source in found.sources if source.arcsec is None]
        yield "not in u", f"{', '.join(missing)}: --budget {missing[0]}=ARCSEC says them" if missing else ""


def _below(result: Measurement, drive: Drive | None, *, details: bool) -> Iterator[tuple[str, str]]:
    if reversal := result.reversal:
        words = f"{reversal.mean_arcsec:.2f} arcsec on the mean, up to {reversal.greatest_arcsec:.2f} arcsec off that"
        yield "reversal", f"{words}; it is not lost motion"
    yield "read as", "; ".join(result.notes)
    file = result.trace.file
    yield "next", again("compare", drive, file) if drive and file != STDIN else ""
    yield "more", "" if details else "--details"


def _order(order: MeasuredOrder) -> str:
    """An order in words: 2.01 a turn, 6.46 arcsec (flexspline + rigid wheel)."""
    cause = f" ({order.cause})" if order.cause else ""
    return f"{order.per_cam_rev:.2f} a turn, {order.amplitude_arcsec:.2f} arcsec{cause}"


def _value(found: SweepResult) -> str:
    low, high = found.interval_arcsec
    bound = "at least, for the angles visited: " if found.is_bound else ""
    value = f"{found.range.value:.2f} arcsec, u = {found.uncertainty_arcsec:.2f}"
    return f"F'_ior {bound}{value}, 95 % {low:.2f} to {high:.2f}"


def _lines(found: SweepResult) -> str:
    lines = ", ".join(f"{line.per_cam_rev:.3f} ({line.amplitude_arcsec:.2f} arcsec)" for line in found.lines)
    rise = f"; in another cycle they may add {found.rise_arcsec:.2f} arcsec" if found.rise_arcsec else ""
    return f"off the orders: {lines}{rise}"


def _visited(result: Measurement, found: SweepResult, *, details: bool) -> str:
    if found.coverage is None or result.gearing is None:
        return f"{found.bins.span:.2f} cam turns; without --drive or --ratio the full cycle is not known"
    c, gearing = found.coverage, result.gearing
    turns = "turn" if gearing.cycle_output == 1 else "turns"
    cycle = f"full cycle: {gearing.cycle} cam turns, {gearing.cycle_output} output {turns}"
    share = f"{c.cam_turns:.4g} of {gearing.cycle} cam turns, {100 * c.share:.1f} % of the cycle"
    if not details:
        return f"{share}, a reading every {c.step_deg:.3g} deg ({cycle})"
    cells = f"{c.visited} of {c.cells} cells of {c.cam_deg:g} deg of the cam by {c.output_deg:.3g} deg of the output"
    return f"{share}, {cells}, a reading every {c.step_deg:.3g} deg of the cam ({cycle})"


def _orders(found: SweepResult, style: Style) -> Table:
    grid = table(
        style, f"orders: amplitude·cos(order·angle + phase), the {SHOWN_ORDERS} greatest of {len(found.orders)}"
    )
    shown = ORDER_COLUMNS if any(order.cause for order in found.orders) else ORDER_COLUMNS[:-1]
    for quantity in shown:
        left = quantity is ORDER_COLUMNS[-1]
        grid.add_column(style.text(quantity.words), justify="left" if left else "right", overflow="fold")
    greatest = sorted(found.orders, key=lambda o: -o.amplitude_arcsec)[:SHOWN_ORDERS]
    for order in sorted(greatest, key=lambda o: o.per_cam_rev):
        grid.add_row(*(style.text(quantity.text(order)) for quantity in shown))
    return grid


def _budget(found: SweepResult, style: Style) -> Table:
    grid = table(style, f"standard uncertainty of F'_ior; u combined, 95 %: k = {COVERAGE_FACTOR:g}")
    for words in ("source", "arcsec", "from"):
        grid.add_column(words, justify="right" if words == "arcsec" else "left", overflow="fold")
    for source in found.sources:
        value = "-" if source.arcsec is None else f"{source.arcsec:.3f}"
        grid.add_row(source.name, value, style.text(source.origin))
    stated = all(source.arcsec is not None for source in found.sources if source.name in STATED)
    grid.add_row("combined", f"{found.uncertainty_arcsec:.3f}", "" if stated else "without what is -")
    return grid


def _summary_line(result: Measurement) -> str:
    """The answer alone: F'_ior with its expanded uncertainty."""
    found = result.directions[0]
    bound = ">= " if found.is_bound else ""
    reach, rise = COVERAGE_FACTOR * found.uncertainty_arcsec, found.rise_arcsec
    spread = f"+{reach + rise:.2f} -{reach:.2f}" if rise else f"+- {reach:.2f}"
    return f"{bound}{found.range.value:.2f} {spread} arcsec"


def _to_json(result: Measurement, drive: Drive | None) -> Json:
    """The measurement as a JSON object."""
    trace, gearing, reversal = result.trace, result.gearing, result.reversal
    return {
        **envelope("measure", drive, 0, result.warnings),
        "file": {"name": trace.file, "sha256": trace.sha256, "rows": len(trace.line)},
        "notes": list(result.notes),
        "cycle": gearing
        and {"ratio": gearing.ratio, "cam_revolutions": gearing.cycle, "output_revolutions": gearing.cycle_output},
        "F_ior_arcsec": result.F_ior_arcsec,
        "directions": [_sweep(found) for found in result.directions],
        "reversal_error": reversal
        and {"mean_arcsec": reversal.mean_arcsec, "greatest_departure_arcsec": reversal.greatest_arcsec},
        "seed": result.seed,
    }


def _sweep(found: SweepResult) -> Json:
    """One direction as a JSON object."""
    fit, c = found.fit, found.coverage
    return {
        "direction": found.direction,
        "rows": int(found.bins.rows.sum()),
        "sweeps": len(fit.level),
        "cam_revolutions": found.bins.span,
        "F_ior_arcsec": found.range.value,
        "F_ior_is_lower_bound": found.is_bound,
        "standard_uncertainty_arcsec": found.uncertainty_arcsec,
        "interval_arcsec": list(found.interval_arcsec),
        "revolution_range_arcsec": found.revolution.value,
        "revolution_range_standard_uncertainty_arcsec": found.revolution_uncertainty_arcsec,
        "rise_in_another_cycle_arcsec": found.rise_arcsec,
        "revolution_range_rise_arcsec": found.revolution_rise_arcsec,
        "band_limited_range_arcsec": found.range.fitted,
        "noise_bias_arcsec": found.range.bias,
        "raw_range_arcsec": found.raw_range_arcsec,
        "drift_arcsec": float(fit.drift.sum()),
        "residuals": {
            "rms_arcsec": float(np.std(fit.residual)),
            "unmodelled_arcsec": fit.unmodelled,
            "correlated_steps": fit.correlated,
            "condition": fit.design.condition,
        },
        "coverage": c
        and {
            "share": c.share,
            "visited_cam_revolutions": c.cam_turns,
            "step_cam_deg": c.step_deg,
            "visited_cells": c.visited,
            "cells": c.cells,
            "cell_cam_deg": c.cam_deg,
            "cell_output_deg": c.output_deg,
        },
        "orders": [as_object(ORDER_COLUMNS, order) for order in found.orders],
        "lines": [as_object(ORDER_COLUMNS, line) for line in found.lines],
        "budget": [
            {"source": s.name, "standard_uncertainty_arcsec": s.arcsec, "origin": s.origin} for s in found.sources
        ],
    }


def _figures(result: Measurement) -> CsvTable:
    """One row per step of the angle, in each direction: error less its level and drift, and the fitted curve."""
    rows: list[list[Any]] = []
    for found in result.directions:
        fitted = found.fit.curve(found.bins.turns)
        columns = (found.bins.sweep, 360 * found.bins.turns, fitted + found.fit.residual, fitted)
        steps = zip(*(column.tolist() for column in columns), strict=True)
        rows += [[result.trace.file, found.direction, *step] for step in steps]
    return ["file", "direction", "sweep", "cam_deg", "error_arcsec", "fitted_arcsec"], rows


def repeats(results: Sequence[Measurement]) -> Json | None:
    """Mean and standard deviation of F'_ior over files, as of repeat runs; None for one file."""
    values = [result.F_ior_arcsec for result in results]
    if len(values) < 2:
        return None
    spread = float(np.std(values, ddof=1))
    return {"files": len(values), "mean_arcsec": float(np.mean(values)), "standard_deviation_arcsec": spread}


def repeats_line(repeats: Json) -> str:
    """Repeat runs in a line."""
    mean, spread = repeats["mean_arcsec"], repeats["standard_deviation_arcsec"]
    return f"{repeats['files']} files: F'_ior {mean:.2f} arcsec on the mean, standard deviation {spread:.2f}"
