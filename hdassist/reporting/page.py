"""The report of a drive: what stands in it, and in which order."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table as Grid
from rich.text import Text

from hdassist.comparing.presets_page import sheet_warnings
from hdassist.comparing.sheet import SEAT_SAMPLES, DriveSheet
from hdassist.design import check_page
from hdassist.design.check import OperatingPoint
from hdassist.design.check_page import BELIEF, MONTE_CARLO, POINT, SLOPES, reason, samples_words
from hdassist.design.influence_words import influence_words, measure_words, named
from hdassist.design.stiffness_page import ARCMIN
from hdassist.design.stiffness_page import render as stiffness_render
from hdassist.design.stiffness_page import to_json as stiffness_json
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.model.unknown import names
from hdassist.mounting import page as mount_page
from hdassist.mounting.seat_page import TRADE, place, seat_of, seat_text
from hdassist.preset.catalogue import of_catalogue
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import UNKNOWN as NOT_KNOWN
from hdassist.preset.kinds import unit_of
from hdassist.preset.schema import ResolvedField, counted, resolved, value_text
from hdassist.reporting.blocks import Block, Figure, Paragraph, Report, Section, Table, Tile
from hdassist.reporting.charts import Dot, chart
from hdassist.terminal.answers import Json, certificate_object, cross_checked, envelope
from hdassist.terminal.brief import again
from hdassist.terminal.console import Style
from hdassist.terminal.plot import curve
from hdassist.terminal.quantities import Quantity
from hdassist.terminal.texts import texts
from hdassist.verdict import Verdict, worst_exit_code
from hdassist.version import __version__

STYLE = Style(ascii=False, codes=False, width=10_000)  # of tables that nobody cuts
DRAWN = 80  # columns of figures in characters
ZERO = "what is not known taken as 0"
HEAD = ("field", "value", "unit", "plausible range; where from")
KINDS = {
    NOT_KNOWN: "not given (a direction of what is 0 does not matter)",
    "override": "set on the command line",
    "assumed": "assumed",
    "identified": "identified from measurements",
    "given": "given",
    "default": "left to the default",
}
WORDS = {
    Verdict.PASS: "within its limits",
    Verdict.FAIL: "beyond its limits",
    Verdict.INCONCLUSIVE: "what is not known could reverse it",
    Verdict.NO_LIMIT: "no limit to hold it against",
}


def exit_code(sheet: DriveSheet) -> int:
    """Exit code of the command: that of check or of mount, whichever is worse."""
    return worst_exit_code([sheet.check.verdict.exit_code, mount_page.exit_code(sheet.advice)])


def to_json(sheet: DriveSheet, seed: int) -> Json:
    """What stands in the report, as the commands that it is of give it."""
    return {
        **envelope("report", sheet.drive, exit_code(sheet), sheet_warnings(sheet)),
        "verdict": str(sheet.check.verdict),
        "values": counted(sheet.drive),
        "check": check_page.to_json(sheet.check, seed),
        "mount": mount_page.to_json(sheet.advice, seed),
        "stiffness": stiffness_json(sheet.drive, sheet.stiffness),
        "certificate": certificate_object(sheet.certificate, sheet.cross_checks),
        "seed": seed,
    }


def report_of(sheet: DriveSheet, *, draws: int, seed: int, ascii: bool = False) -> Report:
    """The report of a drive; draws, seed: of what is not known; ascii: figures in 7-bit characters."""
    style = Style(ascii, codes=False, width=DRAWN)
    drive, verdict = sheet.drive, sheet.check.verdict
    k = Kinematics.of(drive)
    subject = f"{k.z_g}/{k.z_b} teeth, module {drive.gears.m:g} mm, ratio {abs(k.u):g}, fixed: {TRADE[k.fixed]}"
    return Report(
        title=drive.name,
        subject=subject,
        verdict=f"{verdict}: {WORDS[verdict]}",
        reasons=tuple(_reasons(sheet)),
        tiles=tuple(_tiles(sheet)),
        warnings=sheet_warnings(sheet),
        sections=(
            Section("Kinematic error", tuple(_errors(sheet, style))),
            Section("Mounting the fixed wheel", tuple(_mounting(sheet, style))),
            Section("Torsional stiffness", tuple(_stiffness(sheet, style))),
            Section("What it rests on, and what is not known", tuple(_basis(sheet))),
            Section("Where its values come from", tuple(_values(drive))),
            Section("Provenance", (_provenance(drive, draws, seed),)),
        ),
        foot=(f"certificate: {sheet.certificate}{cross_checked(sheet.cross_checks)}",),
    )


def _reasons(sheet: DriveSheet) -> Iterator[str]:
    """Why the verdict is what it is; what to do with the wheel; what it rests on most; what to do next."""
    for point in sheet.check.points:
        found = point.belief
        value = f"{found.p5:.2f} to {found.p95:.2f}" if found else f"{point.error.F_ior_arcsec:.2f}"
        words = f"{point.M_g:g} N·m: F'_ior {value}, self error {point.self_error.range_arcsec:.2f} arcsec"
        limit = (
            "" if point.limit_arcsec is None else f"; both together may have {point.limit_arcsec:g}: {point.verdict}"
        )
        yield words + limit
        if why := reason(point):
            yield why
    yield mount_page.what_to_do(sheet.advice)
    if shares := sheet.check.influences:
        yield f"The spread of F'_ior comes from {influence_words(shares)}."
    if gains := sheet.check.to_measure:
        held = sheet.check.points[sheet.check.least_sure].limit_arcsec is not None
        yield f"Measure next: {measure_words(gains, held)}."
    if sheet.check.unknown:
        yield f"Not known: {names(sheet.check.unknown)}."
    if sheet.advice.order != "none":
        yield f"Next: {again('mount', sheet.drive, '--card', 'card.html')}"


def _tiles(sheet: DriveSheet) -> Iterator[Tile]:
    for point in sheet.check.points:
        if found := point.belief:
            value, below = f"{found.p5:.1f} to {found.p95:.1f}", "arcsec, 5 to 95 % over what is not known"
        else:
            value, below = f"{point.error.F_ior_arcsec:.1f}", "arcsec over the full cycle"
        yield Tile(f"F'_ior at {point.M_g:g} N·m", value, below)
    advice = sheet.advice
    if advice.order == "none":
        yield Tile("position of the wheel", NOT_KNOWN, "measure first")
    else:
        below = f"{advice.gain:.0%} less error" if advice.order == "turn" else "leave it as it is"
        yield Tile("position of the wheel", place(advice.choice.target), below.replace("%", " %"))
    if sheet.stiffness.positive:
        yield Tile("K1", f"{sheet.stiffness.positive[0].stiffness * ARCMIN:.3g}", "N·m/arcmin near zero")
    values = counted(sheet.drive)
    yield Tile("values assumed", str(values["assumed"]), f"{values['given']} given, {values['identified']} identified")


def _errors(sheet: DriveSheet, style: Style) -> Iterator[Block]:
    check = sheet.check
    taken = f", {ZERO}" if check.unknown else ""
    for point in check.points:
        turns = np.asarray(point.error.states.phi_h / (2 * np.pi))
        yield _figure(
            style, f"Error over the full cycle at {point.M_g:g} N·m{taken}", turns, point.error.error_arcsec,
            "cam angle phi_h, turns", f"error at {point.M_g:g} N·m, arcsec",
        )  # fmt: skip
    if check.samples:
        yield _by_torque("F'_ior over all that is not known", (POINT[0], *BELIEF, *MONTE_CARLO), check.points)
    still = "phi_b" if check.kinematics.fixed == "rigid" else "phi_g"
    shown = [quantity for quantity in POINT if not quantity.label.strip().startswith(still)]
    yield _by_torque(f"over the full cycle{taken}", shown, check.points)
    if any(point.sensitivity for point in check.points):
        yield _by_torque(f"what a micrometre more does to F'_ior{taken}", (POINT[0], *SLOPES), check.points)


def _by_torque(title: str, shown: Iterable[Quantity[OperatingPoint]], points: Iterable[OperatingPoint]) -> Table:
    """A row a quantity, a column a torque: the first quantity is the head."""
    first, *rest = [(q.words.strip(), *(q.text(point) for point in points)) for q in shown]
    rest = [row for row in rest if set(row[1:]) - {"-", str(Verdict.NO_LIMIT)}]
    return Table(title, first, tuple(rest), (False, *([True] * (len(first) - 1))))


def _figure(style: Style, caption: str, x: Array, y: Array, x_label: str, y_label: str, **how: Any) -> Figure:
    """A curve as shapes and in characters; how, more arguments of the chart."""
    drawn = chart(x, y, x_label=x_label, y_label=y_label, **how)
    return Figure(caption, drawn, curve(style, x, y, x_label=x_label, y_label=y_label))


def _mounting(sheet: DriveSheet, style: Style) -> Iterator[Block]:
    advice, choice = sheet.advice, sheet.advice.choice
    _, instruction, *rest = blocks_of(mount_page.render(advice, STYLE, plots=False, details=True))
    yield instruction
    if advice.order != "none":
        seat = seat_of(choice, texts(), choice.chosen if choice.turn else None)
        yield Figure(seat.title, seat, seat_text(choice, style))
    if advice.has_curve and len(advice.curve.rotation_deg) > 1:
        yield from _curves(sheet, style)
    yield from rest


def _curves(sheet: DriveSheet, style: Style) -> Iterator[Figure]:
    """F'_ior over the positions of the wheel at each torque; over the phase where nobody knows how it stands."""
    advice, result = sheet.advice, sheet.advice.curve
    per = 360 / result.holes if result.holes else 1.0
    turned, x_label, over = (
        result.rotation_deg / per,
        "turned by, holes" if result.holes else "turned by, deg",
        "positions",
    )
    if advice.any_hole:
        turned, over = result.phase_deg, "phases"
        x_label = "phase, deg, of the wheel's deviation against the cam offset"
    order = np.argsort(turned)
    for k, point in enumerate(sheet.check.points):
        caption, limit = f"F'_ior over the {over} of the wheel at {point.M_g:g} N·m", point.limit_arcsec
        if advice.robust:
            caption += "; bars: 5 to 95 % of what is uncertain or not known"
        if advice.unknown and not advice.any_hole:
            caption += f"; line: {ZERO}"
        if limit is not None:
            caption += "; dashed: the limit less the self error"
            limit -= point.self_error.range_arcsec
        yield _figure(
            style, caption, turned[order], result.F_ior_arcsec[k, order], x_label,
            f"F'_ior at {point.M_g:g} N·m, arcsec",
            limit=limit, whiskers=_whiskers(sheet, k, per), dots=_dots(sheet, k, per),
            points=bool(result.holes) and not advice.any_hole, from_zero=True,
        )  # fmt: skip


def _whiskers(sheet: DriveSheet, torque: int, per: float) -> list[tuple[float, float, float]]:
    """For each position that was sampled, where it lies and F'_ior of 5 and 95 % of the samples."""
    sampled, curve_ = sheet.advice.robust, sheet.advice.curve
    if sampled is None:
        return []
    low, high = np.quantile(sampled.F_ior_arcsec[torque], (0.05, 0.95), axis=0).tolist()
    return list(zip((curve_.rotation_deg[curve_.usable] / per).tolist(), low, high, strict=True))


def _dots(sheet: DriveSheet, torque: int, per: float) -> Iterator[Dot]:
    advice = sheet.advice
    if advice.any_hole:
        return
    now, target = advice.choice.current, advice.choice.target
    yield Dot(now.rotation_deg / per, now.F_ior_arcsec[torque], "now", "now")
    if advice.order == "turn":
        yield Dot(target.rotation_deg / per, target.F_ior_arcsec[torque], "best", "target")


def _stiffness(sheet: DriveSheet, style: Style) -> Iterator[Block]:
    found = sheet.stiffness
    caption = "Twist of the drive without deviations, the cam held"
    yield _figure(style, caption, found.torque, found.twist_arcsec, "torque, N·m", "twist, arcsec")
    yield from blocks_of(stiffness_render(sheet.drive, found, STYLE, plots=False, details=True))[1:]


def _basis(sheet: DriveSheet) -> Iterator[Block]:
    check = sheet.check
    if check.prior and check.prior.fields:
        units = {path: unit_of(info) for path, info in field_table().items()}
        drawn = tuple(
            (named(each.path), f"{each.low:.4g}", f"{each.high:.4g}", units[each.path], each.distribution, each.owner)
            for each in check.prior.fields
        )
        title = f"not known exactly: {samples_words(check.samples)}" if check.samples else "not known exactly"
        head = ("field", "from", "to", "unit", "distribution", "whose")
        yield Table(title, head, drawn, (False, True, True, False, False, False))
    else:
        yield Paragraph("Nothing that has a plausible range is assumed.")
    if check.unknown:
        units = {path: unit_of(info) for path, info in field_table().items()}
        rows = tuple((u.path, f"{u.low:g}", f"{u.high:.4g}", units[u.path], u.reason) for u in check.unknown)
        yield Table("not known", ("field", "from", "to", "unit", "why"), rows, (False, True, True, False, False))
    else:
        yield Paragraph("All deviations of the drive are given, as far as they matter.")


def _values(drive: Drive) -> Iterator[Block]:
    rows, values = resolved(drive), counted(drive)
    yield Paragraph(
        f"The preset gives {sum(values.values())} values: {values['given']} given, {values['identified']} identified, "
        f"{values['assumed']} assumed. What values were identified from agrees with the model by itself and proves "
        "nothing; what the model was compared with stands in docs/validation.md."
    )
    for kind, words in KINDS.items():
        found = tuple(_cells(row) for row in rows if row.kind == kind and not of_catalogue(row.path))
        if found:
            yield Table(f"{words}: {len(found)}", HEAD, found, (False, True, False, False))
    if beside := tuple(_cells(row) for row in rows if of_catalogue(row.path) and row.value is not None):
        yield Table("what the catalogue says", HEAD, beside, (False, True, False, False))


def _cells(row: ResolvedField) -> tuple[str, ...]:
    bounds = " to ".join(map(value_text, row.range or ()))
    return row.path, value_text(row.value), row.unit, "; ".join(filter(None, (bounds, row.ref)))


def _provenance(drive: Drive, draws: int, seed: int) -> Table:
    origin = drive.origin
    rows = (
        ("preset", drive.name),
        ("file", origin.file),
        ("SHA-256", origin.sha256),
        ("set on top", "; ".join(origin.overrides) or "nothing"),
        ("description", " ".join(drive.description.split()) or "none"),
        ("hdassist", __version__),
        (
            "seed",
            f"{seed}; {draws} effective samples of what is not known at least, {SEAT_SAMPLES} samples for the position",
        ),
    )
    return Table("", (), rows, (False, False))


def blocks_of(page: RenderableType) -> list[Block]:
    """The texts and tables of a page for a terminal, as blocks."""
    if isinstance(page, Group):
        return [block for part in page.renderables for block in blocks_of(part)]
    if isinstance(page, Grid):
        title, *notes = str(page.title or "").split("\n")
        columns = [list(column.cells) for column in page.columns]
        head = tuple(str(column.header) for column in page.columns) if page.show_header else ()
        rows = tuple(tuple(map(str, row)) for row in zip(*columns, strict=True))
        return [Table(title, head, rows, tuple(c.justify == "right" for c in page.columns), tuple(notes))]
    text = str(page).strip() if isinstance(page, Text | str) else ""
    return [Paragraph(text, isinstance(page, Text) and "bold" in str(page.style))] if text else []
