"""The tables of a comparison: orders, and the deviations that would explain the difference."""

from __future__ import annotations

from collections.abc import Iterator

from rich.table import Table

from hdassist.comparing.compare import Comparison
from hdassist.comparing.findings import Explanation
from hdassist.comparing.vectors import VECTORS
from hdassist.error.orders import UNKNOWN
from hdassist.terminal.console import Style, table

SHOWN = 12  # orders in the table, the greatest


def tables(result: Comparison, style: Style) -> Iterator[Table]:
    """Orders, each deviation alone, and all together, as far as there are any."""
    yield _orders(result, style)
    if result.singles:
        yield _singles(result, style)
    if result.joint and result.joint.changes:
        yield _joint(result.joint, style)


def _grid(style: Style, title: str, columns: tuple[str, ...]) -> Table:
    """An empty table whose columns are numbers but for deviations and causes."""
    grid = table(style, title)
    for words in columns:
        left = words in ("deviation", "cause")
        grid.add_column(style.text(words), justify="left" if left else "right", overflow="fold")
    return grid


def _orders(result: Comparison, style: Style) -> Table:
    title = f"orders: amplitude·cos(order·angle + phase), arcsec and deg, the {SHOWN} greatest of {len(result.orders)}"
    columns = ("order", "measured", "phase", "predicted", "phase", "difference", "cause")
    grid = _grid(style, title, columns)
    greatest = sorted(result.orders, key=lambda pair: -max(pair.measured.amplitude_arcsec, pair.predicted_arcsec))
    for pair in sorted(greatest[:SHOWN], key=lambda pair: pair.measured.per_cam_rev):
        o = pair.measured
        measured = number(o.amplitude_arcsec, o.uncertainty_arcsec, 2)
        difference = number(pair.difference_arcsec, pair.difference_uncertainty_arcsec, 2)
        grid.add_row(
            f"{o.per_cam_rev:.2f}", style.text(measured), f"{o.phase_deg:.0f}", f"{pair.predicted_arcsec:.2f}",
            f"{pair.predicted_phase_deg:.0f}", style.text(difference), "-" if o.cause == UNKNOWN else o.cause,
        )  # fmt: skip
    return grid


def number(value: float | None, uncertainty: float | None, digits: int = 1) -> str:
    """A value with its standard uncertainty; a dash where there is none."""
    return "-" if value is None or uncertainty is None else f"{value:.{digits}f} ± {uncertainty:.{digits}f}"


def change(found: Explanation, vector: int, untold: str) -> tuple[str, str]:
    """New size and direction of a vector in words."""
    change = next((change for change in found.changes if change.vector == vector), None)
    if change is None:
        return untold, untold
    direction = number(change.direction_deg, change.direction_uncertainty_deg)
    return number(change.size_um, change.size_uncertainty_um), direction


def F_ior_text(found: Explanation) -> str:
    """F'_ior of the full cycle [arcsec] in an explanation; a dash where nobody computed it."""
    return "-" if found.F_ior_arcsec is None else f"{found.F_ior_arcsec:.2f}"


def _singles(result: Comparison, style: Style) -> Table:
    title = "one deviation fitted alone, the best first; ±: standard; left: chi-square per degree of freedom"
    columns = ("deviation", "size, um", "direction, deg", "explains", "left", "F'_ior, arcsec")
    grid = _grid(style, title, columns)
    now = result.unchanged
    left = f"{now.chi_square / now.freedom:.2f}"
    grid.add_row("none: as the preset", "", "", "", left, F_ior_text(now))
    for single in sorted(result.singles, key=lambda s: s.chi_square):
        vector = VECTORS[single.vectors[0]]
        name = f"{vector.name}, {vector.direction.split('.')[1]}: {vector.words}"
        shown, F_ior = ("not clear of noise", ""), ""
        if single.clear:
            shown, F_ior = change(single, single.vectors[0], "-"), F_ior_text(single)
        share, left = f"{100 * max(single.share, 0):.1f} %", f"{single.chi_square / single.freedom:.2f}"
        grid.add_row(*(style.text(text) for text in (name, *shown, share, left, F_ior)))
    return grid


def _joint(joint: Explanation, style: Style) -> Table:
    left = f"left {joint.chi_square / joint.freedom:.2f}"
    title = f"all deviations fitted together: {100 * joint.share:.1f} % explained, {left}, F'_ior {F_ior_text(joint)}"
    grid = _grid(style, title, ("deviation", "size, um", "direction, deg"))
    for k in joint.vectors:
        grid.add_row(VECTORS[k].name, *(style.text(text) for text in change(joint, k, "not told")))
    return grid
