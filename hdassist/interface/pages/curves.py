"""Reports of curves: the error over input revolutions, the twist over torque, F'_ior over a varied field."""

from collections.abc import Iterable, Iterator, Sequence
from math import pi
from typing import Any

import numpy as np

from hdassist.drive.error.stiffness import (
    LOST_MOTION_SHARE,
    Stiffness,
    ends_elsewhere,
    off,
    segments_beside,
    stiffness_object,
)
from hdassist.drive.error.waves import ErrorAlong, Trace, TraceOrder, order_legend
from hdassist.drive.model.deviations import unknown_notes, unknowns
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import Drive, Measured
from hdassist.features.design import Axis, Sweep, SweepRow, Swept
from hdassist.features.report import (
    Curve,
    Fact,
    Facts,
    Json,
    Paragraph,
    Report,
    Series,
    Table,
    as_object,
    as_objects,
    attributes,
    csv_columns,
    pitch_object,
    quantity_table,
    unknown_objects,
)
from hdassist.interface.terminal.words import ENVELOPE, again, heading, not_known, on_what
from hdassist.run.errors import worst_exit_code

_LISTED_ORDERS = 12  # number of orders in the table of --details, chosen by amplitude
_NAMED_ORDERS = 2  # number of orders on a short page, chosen by amplitude
_LEAST_SHOWN = 0.005  # arcsec; a smaller amplitude would be shown as 0.00
_MANY_TURNS = 8  # largest number of input revolutions drawn as a curve; for more, the envelope is drawn

_END_WORDS = {"least": "smallest", "greatest": "largest"}  # ends of a sweep, by their keys in JSON
_UNKNOWN_AS_ZERO = "Unknown inputs are set to 0; hdassist check gives F'_ior with its range over them."

ORDER_QUANTITIES = quantity_table("trace.orders")


def slope_words(
    slope: float,
    uncertainty: float,
    speed: float | None,
    *,
    is_least: bool = False,
) -> str:
    """Return a text on the largest slope and, if a speed is given, on the rate at this speed.

    slope: largest slope [arcsec per deg of the output].
    uncertainty: standard uncertainty of the slope, 0 if it has none.
    speed: output speed [arcsec/s], None if it is not given.
    is_least: whether the slope is a lower bound.
    """
    reach = f" ± {2 * uncertainty:.2g}" if uncertainty else ""
    factor = " (k = 2)" if uncertainty else ""
    text = f"at {'least' if is_least else 'most'} {slope:.3g}{reach}″ per ° of output rotation{factor}"
    return f"{text}; {slope * speed / 3600:.3g}″/s at an output speed of {speed:g}″/s" if speed else text


def _largest_orders(trace: Trace) -> list[TraceOrder]:
    """Return the orders of an error curve that are large enough to be shown, the largest first."""
    shown = [order for order in trace.orders if order.amplitude_arcsec >= _LEAST_SHOWN]
    return sorted(shown, key=lambda order: -order.amplitude_arcsec)


def _orders_table(largest: Sequence[TraceOrder]) -> Table:
    """Return the table of the largest orders, sorted by order."""
    title = f"orders: amplitude·cos(order·phi_h + phase), the {_LISTED_ORDERS} largest"
    by_number = sorted(largest[:_LISTED_ORDERS], key=lambda order: order.per_cam_rev)
    return Table.by_row(title, ORDER_QUANTITIES, by_number)


def _start_words(trace: Trace, moving: str) -> str:
    """Return the torque, length and start of an error curve as text; moving: name of the moving wheel's angle."""
    revolutions = "revolution" if trace.revolutions == 1 else "revolutions"
    return f"{trace.error.M_g:g} N·m, {trace.revolutions} input {revolutions} from {moving} = {trace.start_deg:g}°"


def _trace_facts(
    drive: Drive,
    trace: Trace,
    *,
    is_part: bool,
) -> list[Fact]:
    """Return the facts on the assumptions behind an error curve, and the next command.

    is_part: whether the curve is shorter than the full mesh cycle.
    """
    return [
        ("gravity", _along_words(trace.along)),
        ("assumed", on_what(drive)),
        ("unknown", not_known(drive)),
        ("next", _next(drive, trace, is_part=is_part)),
    ]


def trace_report(
    drive: Drive,
    trace: Trace,
    seed: int,
    speed: float | None = None,
) -> Report:
    """Return the report of the error of a drive over input revolutions.

    drive: computed drive.
    trace: error curve of the drive.
    seed: seed for choosing the mesh positions that are solved again.
    speed: output speed [arcsec/s] that converts the slope to a rate; None if it is not given.
    """
    error = trace.error
    is_part = trace.revolutions < error.kinematics.cycle_cam_revolutions
    moving = "phi_g0" if error.kinematics.fixed == "rigid" else "phi_b0"
    facts = _trace_facts(drive, trace, is_part=is_part)
    largest = _largest_orders(trace)
    y_label = f"kinematic error F_kpp at {error.M_g:g} N·m, ″"
    return Report(
        command="trace",
        drive=drive,
        head=f"{drive.name} (nominal), {_start_words(trace, moving)}{heading(trace.measured)}",
        verdict=f"range {error.range_arcsec:.2f}″",
        why=tuple(_limits_of_trace(drive, trace, is_part=is_part)),
        blocks=(
            *([Table.by_row("", quantity_table("trace.page"), largest[:_NAMED_ORDERS])] if largest else []),
            Facts.of(facts),
            curve_of_turns(error.states.phi_h / (2 * np.pi), error.error_arcsec, y_label),
        ),
        details=(
            _orders_table(largest),
            Paragraph(order_legend(drive)),
            Facts.of([("slope", slope_words(trace.slope_arcsec_per_deg, 0.0, speed))]),
        ),
        certificate=error.certificate,
        cross_checks=(error.cross_check,),
        values=_trace_object(drive, trace, moving, seed, speed),
        csv=csv_columns(**_angles_deg(trace), **attributes(error, "error_arcsec", "rotation_arcsec")),
        line=f"{error.range_arcsec:.2f} arcsec",
        warnings=(*drive.origin.warnings, *unknown_notes(drive)),
    )


def _trace_object(
    drive: Drive,
    trace: Trace,
    moving: str,
    seed: int,
    speed: float | None,
) -> Json:
    """Return an error curve as JSON.

    moving: name of the angle at which the curve starts; the other arguments are those of trace_report.
    """
    error = trace.error
    return {
        "unknown": unknown_objects(unknowns(drive)),
        "pitch": pitch_object(trace.measured),
        "statistic": "nominal",
        "M_g_Nm": error.M_g,
        "gravity": trace.along,
        f"{moving}_deg": trace.start_deg,
        "cam_revolutions": trace.revolutions,
        "phi_h_deg": _angles_deg(trace)["phi_h_deg"],
        **attributes(error, "error_arcsec", "range_arcsec"),
        "orders": trace.orders,
        "slope_arcsec_per_deg": trace.slope_arcsec_per_deg,
        "rate_arcsec_per_s": speed and trace.slope_arcsec_per_deg * speed / 3600,
        "seed": seed,
    }


def _angles_deg(trace: Trace) -> dict[str, Array]:
    """Return the angles of the input and of both wheels [deg] by name, each of shape (states,)."""
    states = trace.error.states
    return {f"{name}_deg": np.degrees(getattr(states, name)) for name in ("phi_h", "phi_g", "phi_b")}


def _limits_of_trace(
    drive: Drive,
    trace: Trace,
    *,
    is_part: bool,
) -> Iterator[str]:
    """Yield the limitations of an error curve; is_part: whether the curve is shorter than the full mesh cycle."""
    if drive.measured != Measured.of_defaults():
        yield "Computed from the preset; measurements of the drive are not taken into account."
    if is_part:
        cycle = trace.error.kinematics.cycle_cam_revolutions
        yield (f"The curve covers {trace.revolutions} of {cycle} input revolutions, so F'_ior is at least as large.")
    if unknowns(drive):
        yield _UNKNOWN_AS_ZERO


def _next(
    drive: Drive,
    trace: Trace,
    *,
    is_part: bool,
) -> str:
    """Return the next command, which computes the full mesh cycle if the error curve covers only a part.

    is_part: whether the error curve is shorter than the full mesh cycle.
    """
    if not is_part:
        return again("mount", drive)
    cycle = trace.error.kinematics.cycle_cam_revolutions
    return again("trace", drive, "-n", str(cycle), "--phi-g0", f"{trace.start_deg:g}")


def _along_words(along: ErrorAlong | None) -> str:
    """Return a text on the varying torque of an error curve and on the interpolation; empty for a constant torque."""
    if along is None:
        return ""
    ends = f"{along.least_Nm:.4g} to {along.greatest_Nm:.4g} N·m"
    solved = f"{len(along.torques_Nm)} torques solved, interpolation error at most {along.bound_arcsec:.2g}″"
    ranges = f"{along.ranges_arcsec[0]:.2f}″ and {along.ranges_arcsec[-1]:.2f}″"
    constant = f"range at the smallest and at the largest torque, each held constant: {ranges}"
    return f"{ends}, {solved}. {constant.capitalize()}. The wind-up of {along.wind_up_arcsec:.4g}″ is not included"


def curve_of_turns(
    turns: Series,
    error: Series,
    words: str,
) -> Curve:
    """Return the curve of the error over input revolutions; words: label of the error axis, with the unit."""
    over = float(np.ptp(turns) > _MANY_TURNS)
    around = f": {ENVELOPE}" if over else ""
    return Curve(
        turns,
        error,
        x_label="input angle, revolutions",
        y_label=f"{words}{around}",
        over=over,
        rows=4,
    )


_ARCMIN = pi / 10800  # rad


def _scaled(stiffness: float) -> str:
    return f"{stiffness / 1e4:.3g}"


def _percent_off(percent: float) -> str:
    """Return a relative difference [%] as text with its sign."""
    return f"{percent:+z.0f} %"


WHOLE_QUANTITIES = quantity_table("stiffness.whole")
_SEGMENT_QUANTITIES = quantity_table("stiffness.segments")
_SEGMENT_COLUMNS = quantity_table(
    "stiffness.page",
    symbol=lambda name: name.replace("_", ""),
    span=lambda segment: f"{segment.start:.4g} to {segment.end:.4g}",
    scaled=_scaled,
    percent_off=_percent_off,
    by_arcmin=lambda beside: beside.segment.stiffness * _ARCMIN,
)


def stiffness_report(drive: Drive, found: Stiffness) -> Report:
    """Return the report of the stiffness of a drive: twist over torque, K1, K2, K3, lost motion."""
    curve = {"torque_Nm": found.torque, **attributes(found, "twist_arcsec", "contact_arcsec", "tube_arcsec")}
    sides = {"positive": found.positive, "negative": found.negative}
    rows = [segment for side in sides.values() for segment in segments_beside(drive.catalogue, side)]
    lines = [f"K{k}: {_scaled(segment.stiffness)}e4 N*m/rad" for k, segment in enumerate(found.positive, 1)]
    return Report(
        command="stiffness",
        drive=drive,
        head=f"{drive.name}: torsional stiffness without deviations, wave generator locked",
        blocks=(
            Table.by_row("torsional stiffness in both directions", _SEGMENT_COLUMNS, rows),
            Facts.of(_facts(drive, found)),
            Curve(x=found.torque, y=found.twist_arcsec, x_label="torque, N·m", y_label="twist, ″"),
        ),
        certificate=found.certificate,
        cross_checks=(found.cross_check,),
        values={
            **as_object(WHOLE_QUANTITIES, found),
            "catalogue": stiffness_object(drive.catalogue, found),
            **{name: as_objects(_SEGMENT_QUANTITIES, side) for name, side in sides.items()},
            "curve": curve,
        },
        csv=csv_columns(**curve),
        line="\n".join([*lines, f"lost motion: {found.lost_motion_arcsec:.2f} arcsec"]),
        warnings=stiffness_warnings(drive, found),
    )


def stiffness_warnings(drive: Drive, result: Stiffness) -> tuple[str, ...]:
    """Return the warnings about a drive and about the torque to which its lost motion refers."""
    if drive.operation.rated is not None:
        return drive.origin.warnings
    torque = f"the lost motion refers to {result.rated:g} N*m, the largest torque in operation.M_g"
    advice = "state the rated torque with --set operation.rated=T"
    return (*drive.origin.warnings, f"the preset has no operation.rated, so {torque}; {advice}")


def _facts(drive: Drive, found: Stiffness) -> Iterator[Fact]:
    """Yield segments, lost motion, assumptions and the next command, each as a label and a text."""
    segments = ""
    if ends_elsewhere(drive.catalogue, found.positive):
        segments = (
            "the segments end at torques other than those in the catalogue, so their stiffnesses are not compared"
        )
    yield "segments", segments
    ends = f"±{100 * LOST_MOTION_SHARE:.0f} % of {found.rated:g} N·m"
    yield "lost motion", f"{found.lost_motion_arcsec:.2f}″ between {ends}; backlash {found.play_arcsec:.2f}″"
    yield "  catalogue", _lost_motion_limit(drive, found.lost_motion_arcsec)
    yield "assumed", on_what(drive)
    yield "next", again("check", drive)


def _lost_motion_limit(drive: Drive, lost_motion_arcsec: float) -> str:
    """Return a text that compares the lost motion with the limit of the catalogue; empty without a limit."""
    limit_arcsec = drive.catalogue.lost_motion
    if limit_arcsec is None:
        return ""
    source = drive.source.get("catalogue.lost_motion")
    origin = " (assumed)" if source and source.kind == "assumed" else ""
    excess = off(lost_motion_arcsec, limit_arcsec) or 0.0
    compared = f"exceeds this limit by {excess:.0f} %" if excess > 0 else "is below this limit"
    return f"at most {limit_arcsec:g}″{origin}, friction included; the model, which has no friction, {compared}"


_ROW_COLUMNS = ("M_g_Nm", "F_ior_arcsec", "max_residual", "reason")


def columns(sweep: Sweep) -> list[str]:
    """Return the names of the columns of a sweep: the varied fields, then the results."""
    return [*(axis.path for axis in sweep.varied), *_ROW_COLUMNS]


def cells(record: SweepRow) -> list[Any]:
    """Return a row of a sweep as cells in the order of columns()."""
    return [*record.values.values(), *attributes(record, *_ROW_COLUMNS).values()]


def _spans(sweep: Sweep) -> str:
    """Return the varied fields with the ranges of their values as text."""
    spans = []
    for axis in sweep.varied:
        low = min(axis.values)
        high = max(axis.values)
        values = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        spans.append(f"{_of(axis, values, ' (')})")
    return " and ".join(spans)


def _sweep_object(swept: Swept, records: Iterable[SweepRow]) -> Json:
    """Return a sweep by the keys of the JSON result; records: rows for the result, empty if it omits the rows."""
    ends = {end: {"row": row, "F_ior_arcsec": F_ior} for end, (row, F_ior) in swept.ends.items()}
    return {
        "unknown": unknown_objects(unknowns(swept.largest)),
        "statistic": "nominal",
        "vary": [{"field": axis.path, **attributes(axis, "unit", "values")} for axis in swept.sweep.varied],
        "least": ends.get("least"),
        "greatest": ends.get("greatest"),
        "rows": list(records),
        "rows_without_answer": swept.failed,
    }


def sweep_report(swept: Swept, records: Iterable[SweepRow]) -> Report:
    """Return the report of a sweep; records: rows for the JSON result, empty if the result omits the rows."""
    sweep = swept.sweep
    drive = swept.drive
    ends = swept.ends
    figures = list(_figures(swept))
    line = " to ".join(f"{F_ior:.2f}" for _, F_ior in ends.values()) + " arcsec" if ends else "no result"
    return Report(
        command="sweep",
        drive=drive,
        head=f"{drive.name} (nominal), F'_ior over {_spans(sweep)}, {sweep.rows} rows",
        verdict=line.replace(" arcsec", "″"),
        why=(_UNKNOWN_AS_ZERO,) if unknowns(swept.largest) else (),
        blocks=(Facts.of(_sweep_facts(swept)), *figures[:1]),
        details=tuple(figures[1:]),
        certificate=swept,
        values=_sweep_object(swept, records),
        line=line,
        warnings=tuple(swept.warnings),
        exit_code=0 if ends else worst_exit_code(swept.exit_codes),
    )


def _sweep_facts(swept: Swept) -> Iterator[Fact]:
    """Yield the smallest and largest F'_ior, rows without a result and the next command, each as a label and a text."""
    sweep = swept.sweep
    ends = swept.ends
    for end, (row, F_ior) in ends.items():
        values = sweep.values(row)
        yield (
            _END_WORDS[end],
            f"{F_ior:.2f}″ at " + ", ".join(_of(axis, f"{values[axis.path]:g}", " = ") for axis in sweep.axes),
        )
    if swept.failed:
        yield "no result", f"{swept.failed} of {sweep.rows} rows; the first: {swept.reason}"
    if ends:
        values = sweep.values(ends["least"][0])
        sets = [f"{axis.path}={values[axis.path]!r}".removesuffix(".0") for axis in sweep.varied]
        yield "next", again("check", swept.drive, *(word for text in sets for word in ("--set", text)))


def _of(
    axis: Axis,
    values: str,
    sign: str,
) -> str:
    """Return a varied field as text: name, sign, and values with their unit."""
    return f"{axis.path}{sign}{values} {axis.unit.replace('*', '·')}".rstrip()


def _figures(swept: Swept) -> Iterator[Curve]:
    """Yield the curve of F'_ior over the varied field for each torque with at least two results.

    If several fields are varied, there are no curves.
    """
    axis, *other_axes = swept.sweep.varied
    torques = [f" at {M_g:g} N·m" for axis in swept.sweep.further for M_g in axis.values] or [""]
    order = np.argsort(axis.values)
    values = np.array(axis.values, dtype=float)[order]
    if other_axes:
        return
    curves = swept.F_ior_arcsec.reshape(len(values), -1)[order].T
    for torque, F_ior in zip(torques, curves, strict=True):
        solved = np.isfinite(F_ior)
        gaps = "" if solved.all() else f", {np.sum(~solved)} points without a result omitted"
        if solved.sum() > 1:
            label = _of(axis, "", ",").rstrip(",")
            yield Curve(
                x=values[solved],
                y=F_ior[solved],
                x_label=label,
                y_label=f"F'_ior{torque}, ″{gaps}",
            )
