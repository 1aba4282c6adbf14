"""A measured trace as a page."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.measuring.figures import ORDER
from hdassist.measuring.measurement import Direction, Measurement
from hdassist.measuring.uncertainty import COVERAGE_FACTOR, STATED
from hdassist.preset.fields import Drive
from hdassist.terminal.console import Style, table
from hdassist.terminal.plot import curve

SHOWN = 12  # orders in the table, the greatest
NAMES = {1: "growing cam angle", -1: "falling cam angle"}


def _value(found: Direction) -> str:
    low, high = found.interval_arcsec
    bound = "at least, for the angles visited: " if found.is_bound else ""
    value = f"{found.range.value:.2f} arcsec, u = {found.uncertainty_arcsec:.2f}"
    return f"F'_ior {bound}{value}, 95 % {low:.2f} to {high:.2f}"


def _visited(result: Measurement, found: Direction) -> str:
    if found.coverage is None or result.gearing is None:
        return f"{found.cells.span:.2f} cam turns; without --drive or --ratio the full cycle is not known"
    c, gearing = found.coverage, result.gearing
    turns = "turn" if gearing.cycle_output == 1 else "turns"
    cycle = f"full cycle: {gearing.cycle} cam turns, {gearing.cycle_output} output {turns}"
    cells = f"{c.visited} of {c.cells} cells of {c.cam_deg:g} deg of the cam by {c.output_deg:.3g} deg of the output"
    return f"visited: {100 * c.share:.1f} % of the cycle, {cells} ({cycle})"


def render(result: Measurement, drive: Drive | None, style: Style, *, plots: bool = True) -> RenderableType:
    """What was found in each direction: F'_ior, coverage, orders and budget."""
    name = f"{result.trace.file}: {len(result.trace.line)} rows" + (f", {drive.name}" if drive else "")
    parts: list[RenderableType] = [Text(style.text(name), style="bold")]
    parts += [Text(style.text(f"note: {text}")) for text in result.notes]
    for found in result.directions:
        parts += [Text(""), *_direction(result, found, style, plots)]
    if result.reversal:
        r = result.reversal
        words = f"reversal error {r.mean_arcsec:.2f} arcsec on the mean, up to {r.greatest_arcsec:.2f} arcsec off that"
        parts += [Text(""), Text(f"{words}; it is not lost motion")]
    return Group(*parts)


def _direction(result: Measurement, found: Direction, style: Style, plots: bool) -> list[RenderableType]:
    parts: list[RenderableType] = [Text(f"{NAMES[found.direction]}: {_value(found)}", style="bold")]
    raw = f"raw range {found.raw_range_arcsec:.2f} arcsec; limited to the orders {found.range.fitted:.2f}"
    within = f"{found.revolution.value:.2f} arcsec, u = {found.revolution_uncertainty_arcsec:.2f}"
    parts += [Text(f"{raw}, of which noise adds {found.range.bias:.2f}"), Text(f"greatest within one turn: {within}")]
    parts += [Text(_visited(result, found)), Text("")]
    if plots:
        first = found.cells.sweep == 0
        x, y = found.cells.turns[first], found.cells.error[first] - found.fit.level[0]
        drawn = curve(style, x, y, x_label="cam angle, turns", y_label="error, arcsec")
        parts += [Text(drawn), Text("")]
    grid = table(style, f"orders: amplitude·cos(order·angle + phase), the {SHOWN} greatest of {len(found.orders)}")
    shown = ORDER if any(order.cause for order in found.orders) else ORDER[:-1]
    for quantity in shown:
        words = style.text(quantity.words)
        grid.add_column(words, justify="left" if quantity is ORDER[-1] else "right", overflow="fold")
    greatest = sorted(found.orders, key=lambda o: -o.amplitude_arcsec)[:SHOWN]
    for order in sorted(greatest, key=lambda o: o.per_cam_rev):
        grid.add_row(*(style.text(quantity.text(order)) for quantity in shown))
    sources = table(style, f"standard uncertainty of F'_ior; u combined, 95 %: k = {COVERAGE_FACTOR:g}")
    for words in ("source", "arcsec", "from"):
        sources.add_column(words, justify="right" if words == "arcsec" else "left", overflow="fold")
    for source in found.sources:
        sources.add_row(
            source.name, "-" if source.arcsec is None else f"{source.arcsec:.3f}", style.text(source.origin)
        )
    sources.add_row("combined", f"{found.uncertainty_arcsec:.3f}", "" if _all_stated(found) else "without what is -")
    return [*parts, grid, sources]


def _all_stated(found: Direction) -> bool:
    return sum(source.arcsec is not None for source in found.sources if source.name in STATED) == len(STATED)


def brief(result: Measurement) -> str:
    """The answer alone: F'_ior with its expanded uncertainty."""
    found = result.directions[0]
    bound = ">= " if found.is_bound else ""
    return f"{bound}{found.range.value:.2f} +- {COVERAGE_FACTOR * found.uncertainty_arcsec:.2f} arcsec"
