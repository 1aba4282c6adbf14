"""The tables of a comparison: orders, and the deviations that would explain the difference."""

from __future__ import annotations

from collections.abc import Iterator

from rich.table import Table

from hdassist.comparing.compare import Comparison
from hdassist.comparing.findings import Explanation, VectorChange
from hdassist.comparing.vectors import VECTORS
from hdassist.error.orders import UNKNOWN
from hdassist.terminal.console import Style, table

TABLED_ORDERS = 12  # the greatest
LEFT_ALIGNED = ("deviation", "cause")


def comparison_tables(result: Comparison, style: Style) -> Iterator[Table]:
    """Orders, each deviation alone, and all together, as far as they were fitted."""
    yield _orders(result, style)
    if result.singles:
        yield _singles(result, style)
    if result.joint and result.joint.changes:
        yield _joint(result.joint, style)


def plus_minus(value: float | None, uncertainty: float | None, digits: int = 1) -> str:
    """A value with its standard uncertainty; a dash without one."""
    return "-" if value is None or uncertainty is None else f"{value:.{digits}f} ± {uncertainty:.{digits}f}"


def size_and_direction(change: VectorChange) -> tuple[str, str]:
    """Cells of size [um] and direction [deg], each with its standard uncertainty."""
    direction = plus_minus(change.direction_deg, change.direction_uncertainty_deg)
    return plus_minus(change.size_um, change.size_uncertainty_um), direction


def F_ior_text(found: Explanation) -> str:
    """F'_ior of the full cycle [arcsec] in an explanation; a dash where it was not computed."""
    return "-" if found.F_ior_arcsec is None else f"{found.F_ior_arcsec:.2f}"


def _table(style: Style, title: str, *heads: str) -> Table:
    """A table whose columns are numbers but for deviations and causes."""
    rows = table(style, title)
    for head in heads:
        rows.add_column(style.text(head), justify="left" if head in LEFT_ALIGNED else "right", overflow="fold")
    return rows


def _orders(result: Comparison, style: Style) -> Table:
    shown = f"the {TABLED_ORDERS} greatest of {len(result.orders)}"
    title = f"orders: amplitude·cos(order·angle + phase), arcsec and deg, {shown}"
    rows = _table(style, title, "order", "measured", "phase", "predicted", "phase", "difference", "cause")
    greatest = sorted(result.orders, key=lambda pair: -max(pair.measured.amplitude_arcsec, pair.predicted_arcsec))
    for pair in sorted(greatest[:TABLED_ORDERS], key=lambda pair: pair.measured.per_cam_rev):
        order = pair.measured
        measured = plus_minus(order.amplitude_arcsec, order.uncertainty_arcsec, 2)
        difference = plus_minus(pair.difference_arcsec, pair.difference_uncertainty_arcsec, 2)
        rows.add_row(
            f"{order.per_cam_rev:.2f}", style.text(measured), f"{order.phase_deg:.0f}", f"{pair.predicted_arcsec:.2f}",
            f"{pair.predicted_phase_deg:.0f}", style.text(difference), "-" if order.cause == UNKNOWN else order.cause,
        )  # fmt: skip
    return rows


def _singles(result: Comparison, style: Style) -> Table:
    title = "one deviation fitted alone, the best first; ±: standard; left: chi-square per degree of freedom"
    rows = _table(style, title, "deviation", "size, um", "direction, deg", "explains", "left", "F'_ior, arcsec")
    unchanged = result.unchanged
    rows.add_row("none: as the preset", "", "", "", f"{unchanged.reduced_chi_square:.2f}", F_ior_text(unchanged))
    for single in sorted(result.singles, key=lambda single: single.chi_square):
        vector = VECTORS[single.vectors[0]]
        name = f"{vector.name}, {vector.direction.split('.')[1]}: {vector.words}"
        cells, F_ior = ("not clear of noise", ""), ""
        if single.clear:
            cells, F_ior = size_and_direction(single.changes[0]) if single.changes else ("-", "-"), F_ior_text(single)
        share, residual = f"{100 * max(single.share, 0):.1f} %", f"{single.reduced_chi_square:.2f}"
        rows.add_row(*map(style.text, (name, *cells, share, residual, F_ior)))
    return rows


def _joint(joint: Explanation, style: Style) -> Table:
    title = (
        f"all deviations fitted together: {100 * joint.share:.1f} % explained, left {joint.reduced_chi_square:.2f}, "
        f"F'_ior {F_ior_text(joint)}"
    )
    rows = _table(style, title, "deviation", "size, um", "direction, deg")
    changes = {change.vector: size_and_direction(change) for change in joint.changes}
    for k in joint.vectors:
        rows.add_row(VECTORS[k].name, *map(style.text, changes.get(k, ("not told", "not told"))))
    return rows
