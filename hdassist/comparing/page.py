"""A comparison of a measured trace with a drive as a page, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.comparing.compare import UNIDENTIFIABLE_ANGLE, Comparison
from hdassist.comparing.findings import Explanation, equally_good
from hdassist.comparing.record import OrderPair
from hdassist.comparing.tables_page import F_ior_text, comparison_tables, size_and_direction
from hdassist.comparing.vectors import VECTORS
from hdassist.model.kinematics import Kinematics, turns_and_degrees
from hdassist.model.unknown import told
from hdassist.terminal.answers import Json, certificate_object, envelope
from hdassist.terminal.brief import again, facts, not_known, on_what, proof
from hdassist.terminal.console import Style
from hdassist.terminal.plot import two_curves
from hdassist.terminal.runs import Answer, Figures
from hdassist.textfile import STDIN

PLOTTED_TURNS = 1.0  # of the cam, to either side of the largest difference
OTHER_CAUSES = (
    "Beyond these deviations there are: stiffnesses, clearances and a torque that differ from the preset's, teeth that "
    "are no first harmonic, friction, tilted shafts, the rig's encoders and couplings, a sign or a zero read wrongly."
)


def comparison_answer(result: Comparison, *, plots: bool, details: bool = False) -> Answer:
    """A comparison in each form; plots, whether curves are drawn; details, whether all tables are shown."""
    return Answer(
        to_json=lambda: _json(result),
        page=lambda style: comparison_page(result, style, plots=plots, details=details),
        summary_line=lambda: _summary(result),
        figures=lambda: _figures(result),
        about=result.measurement.trace.file,
        warnings=result.warnings,
        proof=result.certificate,
    )


def overrides_of(found: Explanation | None) -> list[str]:
    """New values of an explanation as --set takes them."""
    return [f"{path}={value:.10g}" for path, value in found.overrides] if found else []


def _swapping_options(result: Comparison) -> str:
    """Options that read a mirrored file the other way round: its error, its cam angle, or both."""
    error = "output-cam" if result.convention.error_is == "cam-output" else "cam-output"
    sense = "cw" if result.convention.cam_sense == "ccw" else "ccw"
    options = {"error_is": f"--error-is {error}", "cam_sense": f"--cam-sense {sense}"}
    swapped = result.mirror.swapped if result.mirror else None
    return " ".join(text for name, text in options.items() if swapped in (name, "both"))


def _start_name(result: Comparison) -> str:
    """Name of the angle of the output at phi_h = 0."""
    return "phi_g0" if Kinematics.of(result.drive).fixed == "rigid" else "phi_b0"


def _signed_degrees(angle: float) -> float:
    """An angle [rad] in degrees from -180 to 180."""
    return float((np.degrees(angle) + 180) % 360 - 180)


def _verdict(result: Comparison) -> str:
    """The conclusion in a sentence."""
    kind, best = result.conclusion.kind, result.conclusion.best
    if kind == "agrees":
        return "agrees: noise and stiffnesses that are a little off explain it; no change of the preset is called for"
    if kind == "mirrored" and result.mirror:
        rms = f"{result.mirror.rms_arcsec:.2f} instead of {result.difference_rms_arcsec:.2f} arcsec rms"
        options = _swapping_options(result)
        return f"mirrored: read the other way round the file fits clearly better, {rms}: {options}"
    if best is None:
        return "unexplained: no deviation explains the difference"
    name = ", ".join(VECTORS[k].size for k in best.vectors)
    share = f"{100 * best.share:.1f} % of the difference"
    if kind == "one":
        return f"explained by one deviation, {name}: {share}, and no more is left than noise"
    if kind == "several":
        return f"explained by several deviations together, not by one: {share}, and no more is left than noise"
    return f"unexplained: the best single deviation, {name}, explains {share}; the rest is clear of noise"


def _summary(result: Comparison) -> str:
    """The answer alone: what was concluded, and the overrides that say it."""
    kind = result.conclusion.kind
    if kind == "mirrored":
        return f"mirrored {_swapping_options(result)}"
    sets = [] if kind == "unexplained" else overrides_of(result.conclusion.best)
    return " ".join([kind, *(f"--set {text}" for text in sets)])


def comparison_page(result: Comparison, style: Style, *, plots: bool = True, details: bool = False) -> RenderableType:
    """Conclusion, both curves in one plot, what would explain the difference; with details ranges, orders, all fits."""
    trace = result.measurement.trace
    head = f"{trace.file} over {result.drive.name} at {result.M_g:g} N·m, {result.sweep.bins.span:.2f} cam turns"
    parts: list[RenderableType] = [
        Text(style.text(head), style="bold"),
        Text(style.text(_verdict(result)), style="bold"),
    ]
    if details:
        notes = [*result.measurement.notes, _alignment(result), _sign(result)]
        parts.append(Text(style.text("\n".join(f"note: {text}" for text in notes))))
    if plots:
        parts.append(Text(_plot(result, style)))
    if details:
        parts += [Text(style.text(_ranges(result))), *comparison_tables(result, style)]
    advice = [] if result.conclusion.kind == "agrees" else _advice(result, details)
    parts += [Text(style.text(words)) for words in advice]
    parts.append(facts(style, _lines(result, details)))
    return Group(*(line for part in parts for line in (part, Text(""))))


def _lines(result: Comparison, details: bool) -> Iterator[tuple[str, str]]:
    """What is to be known beside the curves, a label and a text each."""
    found, best = result.sweep, result.conclusion.best
    bound = " of the angles visited" if found.is_bound else ""
    measured = f"{found.range.value:.2f} arcsec{bound} (u = {found.uncertainty_arcsec:.2f})"
    yield "range", f"measured {measured}, predicted {result.predicted_range_arcsec:.2f}"
    yield (
        "apart",
        (
            f"{result.difference_rms_arcsec:.2f} arcsec rms, most {result.largest_arcsec:.2f} "
            f"at {turns_and_degrees(360 * result.largest_at_turns)} of the cam"
        ),
    )
    yield "aligned", _alignment(result)
    yield "read as", "" if details else _sign(result)
    change = best.changes[0] if best and best.changes else None
    if change:
        size, direction = size_and_direction(change)
        at = "" if change.direction_deg is None else f" at {direction} deg"
        yield "lever", f"{VECTORS[change.vector].size} fitted: {size} um{at}"
    yield "rests on", on_what(result.drive)
    yield "unknown", not_known(result.drive)
    yield "next", _next(result)
    yield "proof", proof(result.certificate)
    yield "more", "" if details else "--details"


def _next(result: Comparison) -> str:
    """The command to go on with: the file read the other way round, or the drive as the record shows it."""
    kind, file = result.conclusion.kind, result.measurement.trace.file
    if kind == "mirrored":
        return again("compare", result.drive, "-" if file == STDIN else file, *_swapping_options(result).split())
    best = result.conclusion.best if kind in ("one", "several") else None
    return again("mount", result.drive, *(word for text in overrides_of(best) for word in ("--set", text)))


def _alignment(result: Comparison) -> str:
    pairs = (
        (_start_name(result), result.unchanged.alignment.start, result.start_uncertainty_deg),
        ("cam zero", result.unchanged.alignment.zero, result.zero_uncertainty_deg),
    )
    words = []
    for name, angle, uncertainty in pairs:
        if uncertainty is None:
            words.append(f"{name} = {_signed_degrees(angle):g} deg, given")
        elif uncertainty >= UNIDENTIFIABLE_ANGLE:
            words.append(f"{name}: fitted, but not told by the record")
        else:
            words.append(f"{name} = {_signed_degrees(angle):.1f} deg, u = {uncertainty:.1f}, fitted")
    return "; ".join(words)


def _sign(result: Comparison) -> str:
    same = (
        "cam/ratio - output, as F_kpp" if result.unchanged.alignment.sign > 0 else "output - cam/ratio, against F_kpp"
    )
    sense = "counter-clockwise" if result.unchanged.alignment.sense > 0 else "clockwise"
    cam = f"its cam angle grows {sense}, seen from the cam side"
    return f"the file's error is {same}; {cam}. Curves and phases below are the file's."


def _plot(result: Comparison, style: Style) -> str:
    bins, worst = result.sweep.bins, result.largest_at_turns
    sweep = bins.sweep == bins.sweep[abs(bins.turns - worst).argmin()]
    first, last = bins.turns[sweep].min(), bins.turns[sweep].max()
    low = min(max(worst - PLOTTED_TURNS, first), max(last - 2 * PLOTTED_TURNS, first))
    shown = sweep & (bins.turns >= low) & (bins.turns <= low + 2 * PLOTTED_TURNS)
    predicted = result.predicted_arcsec[shown]
    return two_curves(
        style, bins.turns[shown], predicted + result.residual_arcsec[shown], predicted, names=("measured", "predicted"),
        x_label="cam angle, turns: around the largest difference", y_label="error, arcsec",
    )  # fmt: skip


def _ranges(result: Comparison) -> str:
    found = result.sweep
    whole = "the full cycle" if not found.is_bound else "the angles visited"
    size = result.residual_arcsec
    return "\n".join(
        (
            f"range over {whole}, limited to the orders: measured {found.range.value:.2f} arcsec "
            f"(u = {found.uncertainty_arcsec:.2f}), predicted {result.predicted_range_arcsec:.2f}",
            f"difference: rms {result.difference_rms_arcsec:.2f} arcsec, range {result.difference_range_arcsec:.2f}, "
            f"largest {result.largest_arcsec:.2f} "
            f"at {turns_and_degrees(360 * result.largest_at_turns)} of the cam",
            f"residual with its noise: rms {size.std():.2f} arcsec, range {size.max() - size.min():.2f}",
            f"predicted F'_ior of the full cycle: {F_ior_text(result.unchanged)} arcsec",
        )
    )


def _advice(result: Comparison, details: bool) -> list[str]:
    """Sentences: what is not told apart, what is left, what to type."""
    kind, best, joint = result.conclusion.kind, result.conclusion.best, result.joint
    lines = []
    if (
        details
        and joint
        and (names := sorted({name for combination in joint.indistinguishable for name in combination}))
    ):
        count = len(joint.indistinguishable)
        ways = "one combination" if count == 1 else f"{count} combinations"
        lines.append(f"Fitted together, {ways} of {', '.join(names)} cannot be told from this record.")
    if kind == "one" and best:
        others = ", ".join(VECTORS[s.vectors[0]].size for s in equally_good(best, result.singles))
        if others:
            lines.append(f"As well explained by {others} alone: the record does not tell which of them it is.")
    if kind == "unexplained":
        named = joint if joint and joint.residual_orders else best
        left = [
            f"order {pair.measured.per_cam_rev:.2f}: {pair.difference_arcsec:.2f} arcsec ({pair.measured.cause})"
            for pair in (named.residual_orders if named else ())
        ]
        lines.append((f"Left by the best fit: {'; '.join(left)}. " if left else "") + OTHER_CAUSES * details)
    if details and best and best.overrides and kind in ("one", "several"):
        rest = f"; {best.residual_rms_arcsec:.2f} arcsec rms left of {result.difference_rms_arcsec:.2f}, solved again"
        sets = " ".join(f"--set {text}" for text in overrides_of(best))
        lines.append(f"To go on with it{rest}:\n  {sets}")
    return lines


def _json(result: Comparison) -> Json:
    """The comparison as a JSON object."""
    found, trace, best = result.sweep, result.measurement.trace, result.conclusion.best
    start, alignment = _start_name(result), result.unchanged.alignment
    return {
        **envelope("compare", result.drive, 0, [*result.drive.origin.warnings, *told(result.drive), *result.warnings]),
        "file": {"name": trace.file, "sha256": trace.sha256, "rows": len(trace.line)},
        "notes": list(result.measurement.notes),
        "M_g_Nm": result.M_g,
        "place": {
            f"{start}_deg": _signed_degrees(alignment.start),
            f"{start}_uncertainty_deg": result.start_uncertainty_deg,
            f"{start}_fitted": result.start_uncertainty_deg is not None,
            "cam_zero_deg": _signed_degrees(alignment.zero),
            "cam_zero_uncertainty_deg": result.zero_uncertainty_deg,
            "cam_zero_fitted": result.zero_uncertainty_deg is not None,
            "error_is": "cam-output" if alignment.sign > 0 else "output-cam",
            "cam_sense": "ccw" if alignment.sense > 0 else "cw",
        },
        "cam_revolutions": found.bins.span,
        "measured": {
            "range_arcsec": found.range.value,
            "standard_uncertainty_arcsec": found.uncertainty_arcsec,
            "is_full_cycle": not found.is_bound,
        },
        "predicted": {"range_arcsec": result.predicted_range_arcsec, "F_ior_arcsec": result.unchanged.F_ior_arcsec},
        "difference": {
            "range_arcsec": result.difference_range_arcsec,
            "rms_arcsec": result.difference_rms_arcsec,
            "largest_arcsec": result.largest_arcsec,
            "largest_at_cam_deg": 360 * result.largest_at_turns,
        },
        "residual": {
            "rms_arcsec": float(np.std(result.residual_arcsec)),
            "range_arcsec": float(np.ptp(result.residual_arcsec)),
        },
        "chi_square": result.unchanged.chi_square,
        "degrees_of_freedom": result.unchanged.freedom,
        "orders": [_pair(pair) for pair in result.orders],
        "finding": {
            "kind": result.conclusion.kind,
            "deviations": [VECTORS[k].size for k in best.vectors] if best else [],
            "overrides": overrides_of(best),
            "F_ior_arcsec": best.F_ior_arcsec if best else None,
        },
        "mirrored": result.mirror
        and {"option": _swapping_options(result), "difference_rms_arcsec": result.mirror.rms_arcsec},
        "singles": [_explanation_object(result, single) for single in result.singles],
        "joint": result.joint and _explanation_object(result, result.joint),
        "certificate": certificate_object(result.certificate),
        "seed": result.measurement.seed,
    }


def _pair(pair: OrderPair) -> Json:
    """One order, measured and predicted, as a JSON object."""
    return {
        "per_cam_rev": pair.measured.per_cam_rev,
        "measured": {
            "amplitude_arcsec": pair.measured.amplitude_arcsec,
            "uncertainty_arcsec": pair.measured.uncertainty_arcsec,
            "phase_deg": pair.measured.phase_deg,
        },
        "predicted": {"amplitude_arcsec": pair.predicted_arcsec, "phase_deg": pair.predicted_phase_deg},
        "difference": {
            "amplitude_arcsec": pair.difference_arcsec,
            "uncertainty_arcsec": pair.difference_uncertainty_arcsec,
        },
        "cause": pair.measured.cause,
    }


def _explanation_object(result: Comparison, found: Explanation) -> Json:
    """One explanation as a JSON object."""
    return {
        "deviations": [VECTORS[k].size for k in found.vectors],
        "changes": [
            {
                "size": VECTORS[change.vector].size,
                "size_um": change.size_um,
                "size_uncertainty_um": change.size_uncertainty_um,
                "direction": VECTORS[change.vector].direction,
                "direction_deg": change.direction_deg,
                "direction_uncertainty_deg": change.direction_uncertainty_deg,
            }
            for change in found.changes
        ],
        "not_told_apart": [list(names) for names in found.indistinguishable],
        "chi_square": found.chi_square,
        "degrees_of_freedom": found.freedom,
        "explained_share": found.share,
        "clear": found.clear,
        "sufficient": found.sufficient,
        "overrides": overrides_of(found),
        "F_ior_arcsec": found.F_ior_arcsec,
        "difference_left_arcsec": found.residual_rms_arcsec,
        "orders_left": [
            {"per_cam_rev": p.measured.per_cam_rev, "amplitude_arcsec": p.difference_arcsec, "cause": p.measured.cause}
            for p in found.residual_orders
        ],
        f"{_start_name(result)}_deg": _signed_degrees(found.alignment.start),
        "cam_zero_deg": _signed_degrees(found.alignment.zero),
    }


def _figures(result: Comparison) -> Figures:
    """One row per step of the angle: error less level and drift, prediction, residual."""
    bins, predicted, residual = result.sweep.bins, result.predicted_arcsec, result.residual_arcsec
    columns = (bins.sweep, 360 * bins.turns, predicted + residual, predicted, residual)
    name = result.measurement.trace.file
    rows = [[name, *values] for values in zip(*(column.tolist() for column in columns), strict=True)]
    return ["file", "sweep", "cam_deg", "measured_arcsec", "predicted_arcsec", "residual_arcsec"], rows
