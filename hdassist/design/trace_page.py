"""A trace of the error as a plot with an order table, as JSON, and as CSV."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.error.orders import LEGEND, Order
from hdassist.error.trace import Trace
from hdassist.model.unknown import told, unknowns
from hdassist.preset.fields import Drive
from hdassist.terminal.answers import Json, certificate_object, cross_checked, envelope
from hdassist.terminal.basis import unknown_objects
from hdassist.terminal.console import Style, table
from hdassist.terminal.plot import curve
from hdassist.terminal.quantities import Quantity, as_object
from hdassist.terminal.runs import Answer, Figures
from hdassist.terminal.wheels_page import heading, pitch_object

SHOWN = 12  # orders in the table, the greatest

ORDER: tuple[Quantity[Order], ...] = (
    Quantity("per_cam_rev", "order", "1/turn", ".2f", lambda o: o.per_cam_rev),
    Quantity("amplitude_arcsec", "amplitude", "arcsec", ".3f", lambda o: o.amplitude_arcsec),
    Quantity("phase_deg", "phase", "deg", ".1f", lambda o: o.phase_deg),
    Quantity("cause", "cause", "", "", lambda o: o.cause),
)


def _degrees(angles: Any) -> list[float]:
    return [float(a) for a in np.degrees(angles)]


def answer(drive: Drive, trace: Trace, *, seed: int, plots: bool) -> Answer:
    """What there is to say of a trace; seed, of its sample that was solved again; plots, whether it is drawn."""
    return Answer(
        to_json=lambda: to_json(drive, trace, seed),
        page=lambda style: render(drive, trace, style, plots=plots),
        summary_line=lambda: summary_line(trace),
        figures=lambda: figures(trace),
        about=drive.name,
        warnings=_warnings(drive),
        proof=trace.error.certificate,
    )


def render(drive: Drive, trace: Trace, style: Style, *, plots: bool = True) -> RenderableType:
    """Plot of the error, its range, and the table of its greatest orders."""
    error = trace.error
    turns = "turn" if trace.revolutions == 1 else "turns"
    moving = "phi_g0" if error.kinematics.fixed == "rigid" else "phi_b0"
    words = f"{drive.name}: {error.M_g:g} N·m, {moving} = {trace.start_deg:g} deg, {trace.revolutions} cam {turns}"
    parts: list[RenderableType] = [Text(style.text(words + heading(trace.measured)), style="bold")]
    if plots:
        by_turns = trace.revolutions > 2
        x = error.states.phi_h / (2 * np.pi) if by_turns else np.degrees(error.states.phi_h)
        label = "cam angle phi_h, " + ("turns" if by_turns else "deg")
        parts.append(Text(curve(style, x, error.error_arcsec, x_label=label, y_label="error F_kpp, arcsec")))
    parts.append(Text(f"range {error.range_arcsec:.2f} arcsec over {trace.revolutions} cam {turns}"))

    grid = table(style, f"orders: amplitude·cos(order·phi_h + phase), the {SHOWN} greatest")
    for quantity in ORDER[:-1]:
        grid.add_column(style.text(quantity.words), justify="right", no_wrap=True)
    grid.add_column(ORDER[-1].words, overflow="fold")
    greatest = sorted(trace.orders, key=lambda o: -o.amplitude_arcsec)[:SHOWN]
    for order in sorted(greatest, key=lambda o: o.per_cam_rev):
        grid.add_row(*(style.text(q.text(order)) for q in ORDER))
    proof = error.certificate
    check = f"certificate: {proof.states} states, greatest residual {proof.max_residual:.1e} of its scale"
    check += cross_checked([error.cross_check])
    parts += [grid, Text(style.text(LEGEND)), Text(check)]
    return Group(*(line for part in parts for line in (part, Text(""))))


def to_json(drive: Drive, trace: Trace, seed: int) -> Json:
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
        "orders": [as_object(ORDER, order) for order in trace.orders],
        "certificate": certificate_object(error.certificate, [error.cross_check]),
        "seed": seed,
    }


def figures(trace: Trace) -> Figures:
    """One row per state."""
    error = trace.error
    columns = (error.states.phi_h, error.states.phi_g, error.states.phi_b)
    rows = zip(*map(_degrees, columns), error.error_arcsec.tolist(), error.rotation_arcsec.tolist(), strict=True)
    return ["phi_h_deg", "phi_g_deg", "phi_b_deg", "error_arcsec", "rotation_arcsec"], list(rows)


def summary_line(trace: Trace) -> str:
    """The answer alone: the range."""
    return f"{trace.error.range_arcsec:.2f} arcsec"


def _warnings(drive: Drive) -> tuple[str, ...]:
    return (*drive.origin.warnings, *told(drive))
