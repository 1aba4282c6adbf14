"""A trace of the error as a report."""

import numpy as np

from hdassist.error.orders import Order, order_legend
from hdassist.error.trace import Trace
from hdassist.json_parts import attributes, pitch_object, unknown_objects
from hdassist.model.unknown import unknown_notes, unknowns
from hdassist.preset.fields import Drive, Measured
from hdassist.report import Curve, Facts, Paragraph, Quantities, Quantity, Report, Series, Table, csv_columns
from hdassist.terminal.wheels import heading
from hdassist.terminal.words import again, not_known, on_what

_LISTED_ORDERS, _NAMED_ORDERS = 12, 2  # with --details and without, the greatest
MANY_TURNS = 8  # cam turns from which on a curve is a block, and its envelope is drawn

ORDER_QUANTITIES: Quantities[Order] = (
    Quantity("per_cam_rev", "order", "", ".2f"),
    Quantity("amplitude_arcsec", "amplitude", "″", ".3f"),
    Quantity("phase_deg", "phase", "deg", ".1f"),
    Quantity("cause", "cause"),
)
_ON_PAGE: Quantity[Order] = Quantity("amplitude_arcsec", "″", "", ".2f")


def trace_report(drive: Drive, trace: Trace, seed: int) -> Report:
    """The error of a drive over cam turns; seed, of its sample that was solved again."""
    error = trace.error
    cycle = error.kinematics.cycle_cam_revolutions
    is_part, nominal = trace.revolutions < cycle, drive.measured != Measured.of_defaults()
    whole = ("-n", str(cycle), "--phi-g0", f"{trace.start_deg:g}")
    next_ = again("trace", drive, *whole) if is_part else again("mount", drive)
    turns = f"{error.M_g:g} N·m, {trace.revolutions} cam turn{'s' * (trace.revolutions != 1)}"
    moving = "phi_g0" if error.kinematics.fixed == "rigid" else "phi_b0"
    start = f"{turns} from {moving} = {trace.start_deg:g}°"
    title = "orders: amplitude·cos(order·phi_h + phase)"
    order, _, _, cause = ORDER_QUANTITIES
    orders = sorted(trace.orders, key=lambda o: -o.amplitude_arcsec)
    listed = sorted(orders[:_LISTED_ORDERS], key=lambda o: o.per_cam_rev)
    words = f"error F_kpp, ″, at {error.M_g:g} N·m"
    angles = {f"{name}_deg": np.degrees(getattr(error.states, name)) for name in ("phi_h", "phi_g", "phi_b")}
    return Report(
        command="trace",
        drive=drive,
        head=f"{drive.name}{', nominal' * nominal}, {start}{heading(trace.measured)}",
        verdict=f"range {error.range_arcsec:.2f}″",
        why=(
            *("values of the preset: what was measured on the drive is not weighed here",) * nominal,
            *(f"{trace.revolutions} of the {cycle} cam turns of the full cycle: F'_ior is at least as large",)
            * is_part,
        ),
        blocks=(
            Table.by_row("", [order, _ON_PAGE, cause], orders[:_NAMED_ORDERS], words=(2,)),
            Facts.of([("assumed", on_what(drive)), ("unknown", not_known(drive)), ("next", next_)]),
            curve_of_turns(error.states.phi_h / (2 * np.pi), error.error_arcsec, words),
        ),
        details=(
            Table.by_row(f"{title}, the {_LISTED_ORDERS} greatest", ORDER_QUANTITIES, listed, words=(3,)),
            Paragraph(order_legend(drive)),
        ),
        certificate=error.certificate,
        cross_checks=(error.cross_check,),
        values={
            "unknown": unknown_objects(unknowns(drive)),
            "pitch": pitch_object(trace.measured),
            "M_g_Nm": error.M_g,
            f"{moving}_deg": trace.start_deg,
            "cam_revolutions": trace.revolutions,
            "phi_h_deg": angles["phi_h_deg"],
            **attributes(error, "error_arcsec", "range_arcsec"),
            "orders": trace.orders,
            "seed": seed,
        },
        csv=csv_columns(**angles, **attributes(error, "error_arcsec", "rotation_arcsec")),
        line=f"{error.range_arcsec:.2f} arcsec",
        warnings=(*drive.origin.warnings, *unknown_notes(drive)),
    )


def curve_of_turns(turns: Series, error: Series, words: str) -> Curve:
    """The error over cam turns; words: of the error, with its unit."""
    over = float(np.ptp(turns) > MANY_TURNS)
    around = ": least and greatest around each cam turn" if over else ""
    return Curve(turns, error, x_label="cam angle, turns", y_label=f"{words}{around}", over=over)
