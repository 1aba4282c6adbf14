"""A trace of the error as a plot with an order table, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.error.orders import Order, order_legend
from hdassist.error.trace import Trace
from hdassist.json_parts import Json, certificate_object, pitch_object, unknown_objects
from hdassist.model.unknown import unknown_notes, unknowns
from hdassist.preset.fields import Drive
from hdassist.report.quantities import Quantity, as_object
from hdassist.terminal.answers import cross_check_words, envelope
from hdassist.terminal.brief import again, facts, not_known, on_what, proof
from hdassist.terminal.console import Style, table
from hdassist.terminal.plot import curve
from hdassist.terminal.runs import Answer, CsvTable
from hdassist.terminal.wheels_page import heading

LISTED_ORDERS = 12  # orders in the table, the greatest
BRIEF_ORDERS = 3  # on the short page
BLOCK_TURNS = 10  # cam turns: of more the curve is a block, and its envelope is drawn

ORDER_QUANTITIES: tuple[Quantity[Order], ...] = (
    Quantity("per_cam_rev", "order", "1/turn", ".2f", lambda o: o.per_cam_rev),
    Quantity("amplitude_arcsec", "amplitude", "arcsec", ".3f", lambda o: o.amplitude_arcsec),
    Quantity("phase_deg", "phase", "deg", ".1f", lambda o: o.phase_deg),
    Quantity("cause", "cause", "", "", lambda o: o.cause),
)


def _degrees(angles: Any) -> list[float]:
    return [float(a) for a in np.degrees(angles)]


def trace_answer(drive: Drive, trace: Trace, *, seed: int, plots: bool, details: bool = False) -> Answer:
    """What there is to say of a trace.

    Arguments: seed, of its sample that was solved again; plots, whether it is drawn; details, whether all tables are
    shown.
    """
    return Answer(
        to_json=lambda: trace_json(drive, trace, seed),
        page=lambda style: trace_page(drive, trace, style, plots=plots, details=details),
        summary_line=lambda: trace_summary(trace),
        figures=lambda: trace_figures(trace),
        about=drive.name,
        warnings=_warnings(drive),
        proof=trace.error.certificate,
    )


def trace_page(
    drive: Drive, trace: Trace, style: Style, *, plots: bool = True, details: bool = False
) -> RenderableType:
    """Plot of the error, its range, its greatest orders, and what to know of the answer."""
    error = trace.error
    turns = "turn" if trace.revolutions == 1 else "turns"
    moving = "phi_g0" if error.kinematics.fixed == "rigid" else "phi_b0"
    words = f"{drive.name}: {error.M_g:g} N·m, {moving} = {trace.start_deg:g} deg, {trace.revolutions} cam {turns}"
    parts: list[RenderableType] = [Text(style.text(words + heading(trace.measured)), style="bold")]
    parts.append(Text(f"range {error.range_arcsec:.2f} arcsec over {trace.revolutions} cam {turns}"))
    if plots:
        by_turns = trace.revolutions > 2
        x = error.states.phi_h / (2 * np.pi) if by_turns else np.degrees(error.states.phi_h)
        label = "cam angle phi_h, " + ("turns" if by_turns else "deg")
        many = trace.revolutions > BLOCK_TURNS
        what = "error F_kpp, arcsec" + ": least and greatest around each cam turn" * many
        parts.append(Text(curve(style, x, error.error_arcsec, x_label=label, y_label=what, over=float(many))))
    if details:
        parts += [_orders(trace, style), Text(style.text(order_legend(drive)))]
    parts.append(facts(style, _lines(drive, trace, details)))
    if details:
        proven = error.certificate
        check = f"certificate: {proven.states} states, greatest residual {proven.max_residual:.1e} of its scale"
        parts.append(Text(check + cross_check_words([error.cross_check])))
    return Group(*(line for part in parts for line in (part, Text(""))))


def _greatest(trace: Trace, most: int) -> list[Order]:
    return sorted(trace.orders, key=lambda o: -o.amplitude_arcsec)[:most]


def _lines(drive: Drive, trace: Trace, details: bool) -> Iterator[tuple[str, str]]:
    """What is to be known beside the curve, a label and a text each."""
    error = trace.error
    greatest = _greatest(trace, BRIEF_ORDERS)
    yield "orders", ", ".join(f"{o.per_cam_rev:.2f}: {o.amplitude_arcsec:.2f} arcsec" for o in greatest)
    yield "lever", f"order {greatest[0].per_cam_rev:.2f}: {greatest[0].cause}" if greatest else ""
    yield "rests on", on_what(drive)
    yield "unknown", not_known(drive)
    cycle = error.kinematics.cycle_cam_revolutions
    own = again("mount", drive)
    if trace.revolutions < cycle:
        own = again("trace", drive, "-n", str(cycle), "--phi-g0", f"{trace.start_deg:g}")
    yield "next", own + (" with the same pitch files" if trace.measured else "")
    yield "proof", proof(error.certificate, [error.cross_check])
    yield "more", "" if details else "--details"


def _orders(trace: Trace, style: Style) -> Table:
    grid = table(style, f"orders: amplitude·cos(order·phi_h + phase), the {LISTED_ORDERS} greatest")
    for quantity in ORDER_QUANTITIES[:-1]:
        grid.add_column(style.text(quantity.words), justify="right", no_wrap=True)
    grid.add_column(ORDER_QUANTITIES[-1].words, overflow="fold")
    for order in sorted(_greatest(trace, LISTED_ORDERS), key=lambda o: o.per_cam_rev):
        grid.add_row(*(style.text(q.text(order)) for q in ORDER_QUANTITIES))
    return grid


def trace_json(drive: Drive, trace: Trace, seed: int) -> Json:
    """The trace as a JSON object."""
    error = trace.error
    moving = "phi_g0_deg" if error.kinematics.fixed == "rigid" else "phi_b0_deg"
    return {
        **envelope("trace", drive, 0, _warnings(drive)),
        "unknown": unknown_objects(unknowns(drive)),
        "pitch": pitch_object(trace.measured),
        "M_g_Nm": error.M_g,
        moving: trace.start_deg,
        "cam_revolutions": trace.revolutions,
        "phi_h_deg": _degrees(error.states.phi_h),
        "error_arcsec": error.error_arcsec.tolist(),
        "range_arcsec": error.range_arcsec,
        "orders": [as_object(ORDER_QUANTITIES, order) for order in trace.orders],
        "certificate": certificate_object(error.certificate, [error.cross_check]),
        "seed": seed,
    }


def trace_figures(trace: Trace) -> CsvTable:
    """One row per state."""
    error = trace.error
    columns = (error.states.phi_h, error.states.phi_g, error.states.phi_b)
    rows = zip(*map(_degrees, columns), error.error_arcsec.tolist(), error.rotation_arcsec.tolist(), strict=True)
    return ["phi_h_deg", "phi_g_deg", "phi_b_deg", "error_arcsec", "rotation_arcsec"], list(rows)


def trace_summary(trace: Trace) -> str:
    """The answer alone: the range."""
    return f"{trace.error.range_arcsec:.2f} arcsec"


def _warnings(drive: Drive) -> tuple[str, ...]:
    return (*drive.origin.warnings, *unknown_notes(drive))
