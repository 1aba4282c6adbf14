"""A comparison of a measured trace with a drive as a page."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.comparing.compare import Reading
from hdassist.comparing.comparison import Comparison, Explanation
from hdassist.comparing.figures import options, start_name, turned
from hdassist.comparing.findings import as_good
from hdassist.comparing.vectors import VECTORS
from hdassist.error.orders import UNKNOWN
from hdassist.terminal.console import Style, table
from hdassist.terminal.plot import two_curves

SHOWN = 12  # orders in the table, the greatest
AROUND = 1.0  # cam turns drawn to either side of the largest difference
NOTHING = 359.0  # deg: a standard uncertainty that says nothing
BEYOND = (
    "Beyond these deviations there are: stiffnesses, clearances and a torque that differ from the preset's, teeth that "
    "are no first harmonic, friction, tilted shafts, the rig's encoders and couplings, a sign or a zero read wrongly."
)


def conclusion(result: Comparison, reading: Reading) -> str:
    """The answer in a sentence."""
    finding, best = result.finding, result.finding.best
    if finding.kind == "agrees":
        return "agrees: the difference is not clear of the noise; no change of the preset is called for"
    if finding.kind == "mirrored" and result.mirror:
        asked = options(result.mirror.option, reading)
        rms = f"{result.mirror.rms_arcsec:.2f} instead of {result.difference_rms_arcsec:.2f} arcsec rms"
        return f"mirrored: read the other way round the file fits clearly better, {rms}: {asked}"
    if best is None:
        return "unexplained: no deviation explains the difference"
    name = ", ".join(VECTORS[k].size for k in best.vectors)
    share = f"{100 * best.share:.1f} % of the difference"
    if finding.kind == "one":
        return f"explained by one deviation, {name}: {share}, and no more is left than noise"
    if finding.kind == "several":
        return f"explained by several deviations together, not by one: {share}, and no more is left than noise"
    return f"unexplained: the best single deviation, {name}, explains {share}; the rest is clear of noise"


def brief(result: Comparison, reading: Reading) -> str:
    """The answer alone: what was concluded, and the overrides that say it."""
    best = result.finding.best
    if result.finding.kind == "mirrored" and result.mirror:
        return f"mirrored {options(result.mirror.option, reading)}"
    sets = [f"--set {text}" for text in best.overrides] if best and result.finding.kind != "unexplained" else []
    return " ".join([result.finding.kind, *sets])


def render(result: Comparison, reading: Reading, style: Style, *, plots: bool = True) -> RenderableType:
    """Conclusion, both curves in one plot, ranges, orders and what would explain the difference."""
    trace = result.measurement.trace
    head = f"{trace.file} over {result.drive.name} at {result.M_g:g} N·m, {result.found.cells.span:.2f} cam turns"
    parts: list[RenderableType] = [Text(style.text(head), style="bold")]
    parts.append(Text(style.text(conclusion(result, reading)), style="bold"))
    notes = [*result.measurement.notes, _place(result), _sign(result)]
    parts.append(Text(style.text("\n".join(f"note: {text}" for text in notes))))
    if plots:
        parts.append(Text(_plot(result, style)))
    parts += [Text(style.text(_ranges(result))), _orders(result, style)]
    if result.singles:
        parts.append(_singles(result, style))
    if result.joint and result.joint.changes:
        parts.append(_joint(result.joint, style))
    parts += [Text(style.text(words)) for words in _advice(result)]
    proof = result.certificate
    parts.append(Text(f"certificate: {proof.states} states, greatest residual {proof.max_residual:.1e} of its scale"))
    return Group(*(line for part in parts for line in (part, Text(""))))


def _place(result: Comparison) -> str:
    pairs = (
        (start_name(result), result.place.start, result.start_uncertainty_deg),
        ("cam zero", result.place.zero, result.zero_uncertainty_deg),
    )
    words = []
    for name, angle, uncertainty in pairs:
        if uncertainty is None:
            words.append(f"{name} = {turned(angle):g} deg, given")
        elif uncertainty > NOTHING:
            words.append(f"{name}: fitted, but not told by the record")
        else:
            words.append(f"{name} = {turned(angle):.1f} deg, u = {uncertainty:.1f}, fitted")
    return "; ".join(words)


def _sign(result: Comparison) -> str:
    same = "the file's error is cam/ratio - output, as F_kpp" if result.place.sign > 0 else (
        "the file's error is output - cam/ratio, against F_kpp"
    )  # fmt: skip
    sense = "counter-clockwise" if result.place.sense > 0 else "clockwise"
    return f"{same}; its cam angle grows {sense}, seen from the cam side. Curves and phases below are the file's."


def _plot(result: Comparison, style: Style) -> str:
    cells = result.found.cells
    worst = result.largest_at_turns
    span = result.found.cells.turns
    sweep = cells.sweep == cells.sweep[abs(span - worst).argmin()]
    low = min(max(worst - AROUND, span[sweep].min()), max(span[sweep].max() - 2 * AROUND, span[sweep].min()))
    shown = sweep & (span >= low) & (span <= low + 2 * AROUND)
    predicted = result.predicted_arcsec[shown]
    return two_curves(
        style, span[shown], predicted + result.residual_arcsec[shown], predicted, names=("measured", "predicted"),
        x_label="cam angle, turns: around the largest difference", y_label="error, arcsec",
    )  # fmt: skip


def _ranges(result: Comparison) -> str:
    found = result.found
    whole = "the full cycle" if not found.is_bound else "the angles visited"
    size = result.residual_arcsec
    return "\n".join(
        (
            f"range over {whole}, limited to the orders: measured {found.range.value:.2f} arcsec "
            f"(u = {found.uncertainty_arcsec:.2f}), predicted {result.predicted_range_arcsec:.2f}",
            f"difference: rms {result.difference_rms_arcsec:.2f} arcsec, range {result.difference_range_arcsec:.2f}, "
            f"largest {result.largest_arcsec:.2f} at {result.largest_at_turns:.3f} cam turns",
            f"residual with its noise: rms {size.std():.2f} arcsec, range {size.max() - size.min():.2f}",
            f"predicted F'_ior of the full cycle: {result.F_ior_arcsec:.2f} arcsec",
        )
    )


def _orders(result: Comparison, style: Style) -> Table:
    title = f"orders: amplitude·cos(order·angle + phase), arcsec and deg, the {SHOWN} greatest of {len(result.orders)}"
    grid = table(style, title)
    for words in ("order", "measured", "phase", "predicted", "phase", "difference", "cause"):
        grid.add_column(words, justify="left" if words == "cause" else "right", overflow="fold")
    greatest = sorted(result.orders, key=lambda o: -max(o.amplitude_arcsec, o.predicted_arcsec))[:SHOWN]
    for o in sorted(greatest, key=lambda o: o.per_cam_rev):
        measured = _number(o.amplitude_arcsec, o.uncertainty_arcsec, 2)
        difference = _number(o.difference_arcsec, o.difference_uncertainty_arcsec, 2)
        grid.add_row(
            f"{o.per_cam_rev:.2f}", style.text(measured), f"{o.phase_deg:.0f}", f"{o.predicted_arcsec:.2f}",
            f"{o.predicted_phase_deg:.0f}", style.text(difference), "-" if o.cause == UNKNOWN else o.cause,
        )  # fmt: skip
    return grid


def _number(value: float | None, uncertainty: float | None, digits: int = 1) -> str:
    return "-" if value is None or uncertainty is None else f"{value:.{digits}f} ± {uncertainty:.{digits}f}"


def _singles(result: Comparison, style: Style) -> Table:
    title = "one deviation fitted alone, the best first; ±: standard; left: chi-square per degree of freedom"
    grid = table(style, title)
    for words in ("deviation", "size, um", "direction, deg", "explains", "left", "F'_ior, arcsec"):
        grid.add_column(style.text(words), justify="left" if words == "deviation" else "right", overflow="fold")
    now = f"{result.chi_square / result.freedom:.2f}"
    grid.add_row("none: as the preset", "", "", "", now, f"{result.F_ior_arcsec:.2f}")
    for single in sorted(result.singles, key=lambda s: s.chi_square):
        vector = VECTORS[single.vectors[0]]
        name = f"{vector.size.split('.')[1]}, {vector.direction.split('.')[1]}: {vector.words}"
        change = single.changes[0] if single.changes else None
        size = _number(change.size_um, change.size_uncertainty_um) if change else "-"
        turn = _number(change.direction_deg, change.direction_uncertainty_deg) if change else "-"
        cells = [
            size,
            turn,
            f"{100 * max(single.share, 0):.1f} %",
            f"{single.chi_square / single.freedom:.2f}",
            _whole(single),
        ]
        cells = cells if single.clear else ["not clear of noise", "", *cells[2:4], ""]
        grid.add_row(*(style.text(text) for text in (name, *cells)))
    return grid


def _whole(found: Explanation) -> str:
    return "-" if found.F_ior_arcsec is None else f"{found.F_ior_arcsec:.2f}"


def _joint(joint: Explanation, style: Style) -> Table:
    left = f"left {joint.chi_square / joint.freedom:.2f}"
    title = f"all deviations fitted together: {100 * joint.share:.1f} % explained, {left}, F'_ior {_whole(joint)}"
    grid = table(style, title)
    for words in ("deviation", "size, um", "direction, deg"):
        grid.add_column(words, justify="left" if words == "deviation" else "right", overflow="fold")
    told = {change.vector: change for change in joint.changes}
    for k in joint.vectors:
        change = told.get(k)
        size = _number(change.size_um, change.size_uncertainty_um) if change else "not told"
        turn = _number(change.direction_deg, change.direction_uncertainty_deg) if change else "not told"
        grid.add_row(VECTORS[k].size.split(".")[1], style.text(size), style.text(turn))
    return grid


def _advice(result: Comparison) -> list[str]:
    """Sentences below the tables: what is not told apart, what is left, what to type."""
    finding, best = result.finding, result.finding.best
    lines = []
    if result.joint:
        names = sorted({name for combination in result.joint.untold for name in combination})
        if names:
            count = len(result.joint.untold)
            ways = "one combination" if count == 1 else f"{count} combinations"
            lines.append(f"Fitted together, {ways} of {', '.join(names)} cannot be told from this record.")
    if finding.kind == "one" and best:
        others = ", ".join(VECTORS[s.vectors[0]].size for s in as_good(best, result.singles))
        if others:
            lines.append(f"As well explained by {others} alone: the record does not tell which of them it is.")
    if finding.kind == "unexplained":
        named = result.joint if result.joint and result.joint.left_orders else best
        left = (
            [f"order {order:.2f}: {size:.2f} arcsec ({why})" for order, size, why in named.left_orders] if named else []
        )
        lines.append((f"Left by the best fit: {'; '.join(left)}. " if left else "") + BEYOND)
    if best and best.overrides and finding.kind in ("one", "several"):
        rest = f"; {best.left_arcsec:.2f} arcsec rms left of {result.difference_rms_arcsec:.2f}, solved again"
        sets = " ".join(f"--set {text}" for text in best.overrides)
        lines.append(f"To go on with it{rest}:\n  {sets}")
    return lines
