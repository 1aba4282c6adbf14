"""The report of a drive: what stands in it, and in which order."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from hdassist.comparing.sheet import DriveSheet
from hdassist.design.beside_catalogue import ends_words
from hdassist.design.check import OperatingPoint
from hdassist.json_parts import Json, certificate_object
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.model.unknown import unknown_names
from hdassist.pages import check as check_page
from hdassist.pages import mount as mount_page
from hdassist.pages.check import BELIEF, MONTE_CARLO, POINT_QUANTITIES, SLOPES, verdict_reason
from hdassist.pages.compare_presets import F_ior_words, sheet_warnings
from hdassist.pages.report_blocks import Block, Figure, Paragraph, Report, ReportSection, Tile
from hdassist.pages.report_charts import Dot, chart
from hdassist.pages.seat import TRADE, hole_place, seat_of, seat_text
from hdassist.pages.stiffness import ARCMIN, details_tables, segments_table, stiffness_json
from hdassist.preset.catalogue import of_catalogue
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import UNKNOWN as NOT_KNOWN
from hdassist.preset.kinds import unit_of
from hdassist.preset.schema import ResolvedField, origin_counts, resolved_fields, value_text
from hdassist.terminal.answers import cross_check_words, envelope
from hdassist.terminal.brief import again
from hdassist.terminal.console import Style, TextTable
from hdassist.terminal.influence_words import influence_words, measure_words, named, samples_words
from hdassist.terminal.plot import curve
from hdassist.terminal.quantities import Quantity
from hdassist.terminal.texts import texts
from hdassist.verdict import Verdict, worst_exit_code
from hdassist.version import __version__

UNCUT = Style(ascii=False, codes=False, width=10_000)  # of tables, whatever their width
FIGURE_COLUMNS = 80  # of figures in characters
UNKNOWN_AS_ZERO = "what is not known taken as 0"
FIELD_HEADS = ("field", "value", "unit", "plausible range; where from")
ORIGIN_WORDS = {
    NOT_KNOWN: "not given (a direction of what is 0 does not matter)",
    "override": "set on the command line",
    "assumed": "assumed",
    "identified": "identified from measurements",
    "given": "given",
    "default": "left to the default",
}
VERDICT_WORDS = {
    Verdict.PASS: "within its limits",
    Verdict.FAIL: "beyond its limits",
    Verdict.INCONCLUSIVE: "what is not known could reverse it",
    Verdict.NO_LIMIT: "no limit to hold it against",
}


def report_exit_code(sheet: DriveSheet) -> int:
    """Exit code of the command: that of check or of mount, whichever is worse."""
    return worst_exit_code([sheet.check.verdict.exit_code, mount_page.mount_exit_code(sheet.advice)])


def report_json(sheet: DriveSheet, seed: int) -> Json:
    """What stands in the report, as the commands that it is of give it."""
    return {
        **envelope("report", sheet.drive, report_exit_code(sheet), sheet_warnings(sheet)),
        "verdict": str(sheet.check.verdict),
        "values": origin_counts(sheet.drive),
        "check": check_page.check_json(sheet.check, seed),
        "mount": mount_page.mount_json(sheet.advice, seed),
        "stiffness": stiffness_json(sheet.drive, sheet.stiffness),
        "certificate": certificate_object(sheet.certificate, sheet.cross_checks),
        "seed": seed,
    }


def report_of(sheet: DriveSheet, *, draws: int, seed: int, ascii: bool = False) -> Report:
    """The report of a drive; draws, seed: of what is not known; ascii: figures in 7-bit characters."""
    style = Style(ascii, codes=False, width=FIGURE_COLUMNS)
    drive, verdict = sheet.drive, sheet.check.verdict
    k = Kinematics.of(drive)
    subject = f"{k.z_g}/{k.z_b} teeth, module {drive.gears.m:g} mm, ratio {abs(k.u):g}, fixed: {TRADE[k.fixed]}"
    return Report(
        title=drive.name,
        subject=subject,
        verdict=f"{verdict}: {VERDICT_WORDS[verdict]}",
        reasons=tuple(_reasons(sheet)),
        tiles=tuple(_tiles(sheet)),
        warnings=sheet_warnings(sheet),
        sections=(
            ReportSection("Kinematic error", tuple(_errors(sheet, style))),
            ReportSection("Mounting the fixed wheel", tuple(_mounting(sheet, style))),
            ReportSection("Torsional stiffness", tuple(_stiffness(sheet, style))),
            ReportSection("What it rests on, and what is not known", tuple(_basis(sheet))),
            ReportSection("Where its values come from", tuple(_values(drive))),
            ReportSection("Provenance", (_provenance(drive, draws, seed),)),
        ),
        foot=(f"certificate: {sheet.certificate}{cross_check_words(sheet.cross_checks)}",),
    )


def _reasons(sheet: DriveSheet) -> Iterator[str]:
    """Why the verdict is what it is; what to do with the wheel; what it rests on most; what to do next."""
    for point in sheet.check.points:
        words = f"{point.M_g:g} N·m: F'_ior {F_ior_words(point)}, self error {point.self_error.range_arcsec:.2f} arcsec"
        limit = (
            "" if point.limit_arcsec is None else f"; both together may have {point.limit_arcsec:g}: {point.verdict}"
        )
        yield words + limit
        if why := verdict_reason(point):
            yield why
    yield mount_page.what_to_do(sheet.advice)
    if shares := sheet.check.influences:
        yield f"The spread of F'_ior comes from {influence_words(shares)}."
    if gains := sheet.check.to_measure:
        held = sheet.check.points[sheet.check.least_sure].limit_arcsec is not None
        yield f"Measure next: {measure_words(gains, held)}."
    if sheet.check.unknown:
        yield f"Not known: {unknown_names(sheet.check.unknown)}."
    if sheet.advice.order != "none":
        yield f"Next: {again('mount', sheet.drive, '--card', 'card.html')}"


def _tiles(sheet: DriveSheet) -> Iterator[Tile]:
    for point in sheet.check.points:
        below = "arcsec, 5 to 95 % over what is not known" if point.belief else "arcsec over the full cycle"
        yield Tile(f"F'_ior at {point.M_g:g} N·m", F_ior_words(point, ".1f"), below)
    advice = sheet.advice
    if advice.order == "none":
        yield Tile("position of the wheel", NOT_KNOWN, "measure first")
    else:
        below = f"{advice.gain:.0%} less error" if advice.order == "turn" else "leave it as it is"
        yield Tile("position of the wheel", hole_place(advice.choice.target), below.replace("%", " %"))
    if sheet.stiffness.positive:
        yield Tile("K1", f"{sheet.stiffness.positive[0].stiffness * ARCMIN:.3g}", "N·m/arcmin near zero")
    values = origin_counts(sheet.drive)
    yield Tile("values assumed", str(values["assumed"]), f"{values['given']} given, {values['identified']} identified")


def _errors(sheet: DriveSheet, style: Style) -> Iterator[Block]:
    check = sheet.check
    taken = f", {UNKNOWN_AS_ZERO}" if check.unknown else ""
    for point in check.points:
        turns = np.asarray(point.error.states.phi_h / (2 * np.pi))
        yield _figure(
            style, f"Error over the full cycle at {point.M_g:g} N·m{taken}", turns, point.error.error_arcsec,
            "cam angle phi_h, turns", f"error at {point.M_g:g} N·m, arcsec",
        )  # fmt: skip
    if check.samples:
        yield _by_torque(
            "F'_ior over all that is not known", (POINT_QUANTITIES[0], *BELIEF, *MONTE_CARLO), check.points
        )
    still = "phi_b" if check.kinematics.fixed == "rigid" else "phi_g"
    shown = [quantity for quantity in POINT_QUANTITIES if not quantity.label.strip().startswith(still)]
    yield _by_torque(f"over the full cycle{taken}", shown, check.points)
    if any(point.sensitivity for point in check.points):
        yield _by_torque(f"what a micrometre more does to F'_ior{taken}", (POINT_QUANTITIES[0], *SLOPES), check.points)


def _table(title: str, heads: Sequence[str], rows: Iterable[tuple[str, ...]], *, numbers: Container[int]) -> TextTable:
    """A table; numbers: places of the columns that have such."""
    return TextTable(UNCUT, title, tuple(heads), tuple(k in numbers for k in range(len(heads))), rows=[*rows])


def _headless(rows: Iterable[tuple[str, str]]) -> TextTable:
    """A table of labels and texts."""
    return TextTable(UNCUT, "", ("", ""), (False, False), header=False, rows=[*rows])


def _by_torque(title: str, shown: Iterable[Quantity[OperatingPoint]], points: Iterable[OperatingPoint]) -> TextTable:
    """A row a quantity, a column a torque: the first quantity is the head."""
    first, *rest = [(q.words.strip(), *(q.text(point) for point in points)) for q in shown]
    rest = [row for row in rest if set(row[1:]) - {"-", str(Verdict.NO_LIMIT)}]
    return _table(title, first, rest, numbers=range(1, len(first)))


def _figure(style: Style, caption: str, x: Array, y: Array, x_label: str, y_label: str, **how: Any) -> Figure:
    """A curve as shapes and in characters; how, more arguments of the chart."""
    drawn = chart(x, y, x_label=x_label, y_label=y_label, **how)
    return Figure(caption, drawn, curve(style, x, y, x_label=x_label, y_label=y_label))


def _mounting(sheet: DriveSheet, style: Style) -> Iterator[Block]:
    advice, choice = sheet.advice, sheet.advice.choice
    yield Paragraph(mount_page.what_to_do(advice))
    if rows := tuple(mount_page.gain_lines(advice)):
        yield _headless(rows)
    if advice.order != "none":
        seat = seat_of(choice, texts(), choice.chosen if choice.turn else None)
        yield Figure(seat.title, seat, seat_text(choice, style))
    if advice.has_curve and len(advice.curve.rotation_deg) > 1:
        yield from _curves(sheet, style)
    if not advice.any_hole:
        yield mount_page.positions_table(advice, UNCUT)
    yield from mount_page.advice_tables(advice, UNCUT)
    yield Paragraph(mount_page.TURN_WORDS)
    yield _headless(tuple(row for row in mount_page.fact_lines(advice, details=True, carded=False) if row[1]))
    yield Paragraph(mount_page.curve_proof(advice.curve))


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
        if advice.positions:
            caption += "; bars: 5 to 95 % over all that is not known exactly"
        if advice.unknown and not advice.any_hole:
            caption += f"; line: {UNKNOWN_AS_ZERO}"
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
    found = sheet.advice.positions
    if found is None:
        return []
    ends = [[found.quantile(share, k)[torque] for share in (0.05, 0.95)] for k in range(len(found.rotations_deg))]
    return [(rotation / per, low, high) for rotation, (low, high) in zip(found.rotations_deg, ends, strict=True)]


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
    if found.positive:
        yield segments_table(sheet.drive, found, UNCUT, both=True)
    if words := ends_words(sheet.drive, found):
        yield _headless((("segments", words),))
    yield from details_tables(sheet.drive, found, UNCUT)
    yield Paragraph(f"certificate: {found.certificate}{cross_check_words([found.cross_check])}")


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
        yield _table(title, head, drawn, numbers=(1, 2))
    else:
        yield Paragraph("Nothing that has a plausible range is assumed.")
    if check.unknown:
        units = {path: unit_of(info) for path, info in field_table().items()}
        rows = tuple((u.path, f"{u.low:g}", f"{u.high:.4g}", units[u.path], u.reason) for u in check.unknown)
        yield _table("not known", ("field", "from", "to", "unit", "why"), rows, numbers=(1, 2))
    else:
        yield Paragraph("All deviations of the drive are given, as far as they matter.")


def _values(drive: Drive) -> Iterator[Block]:
    rows, values = resolved_fields(drive), origin_counts(drive)
    yield Paragraph(
        f"The preset gives {sum(values.values())} values: {values['given']} given, {values['identified']} identified, "
        f"{values['assumed']} assumed. What values were identified from agrees with the model by itself and proves "
        "nothing; what the model was compared with stands in docs/validation.md."
    )
    for kind, words in ORIGIN_WORDS.items():
        found = tuple(_cells(row) for row in rows if row.kind == kind and not of_catalogue(row.path))
        if found:
            yield _table(f"{words}: {len(found)}", FIELD_HEADS, found, numbers=(1,))
    if beside := tuple(_cells(row) for row in rows if of_catalogue(row.path) and row.value is not None):
        yield _table("what the catalogue says", FIELD_HEADS, beside, numbers=(1,))


def _cells(row: ResolvedField) -> tuple[str, ...]:
    bounds = " to ".join(map(value_text, row.range or ()))
    return row.path, value_text(row.value), row.unit, "; ".join(filter(None, (bounds, row.ref)))


def _provenance(drive: Drive, draws: int, seed: int) -> TextTable:
    origin = drive.origin
    rows = (
        ("preset", drive.name),
        ("file", origin.file),
        ("SHA-256", origin.sha256),
        ("set on top", "; ".join(origin.overrides) or "nothing"),
        ("description", " ".join(drive.description.split()) or "none"),
        ("hdassist", __version__),
        ("seed", f"{seed}; {draws} effective samples of what is not known at least"),
    )
    return _headless(rows)
