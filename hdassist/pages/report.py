"""Everything about a drive as one report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from hdassist.comparing.sheet import DriveSheet
from hdassist.model.kinematics import Kinematics
from hdassist.pages.check import check_report
from hdassist.pages.compare_presets import F_ior_words, sheet_warnings
from hdassist.pages.mount import mount_report
from hdassist.pages.seat import TRADE, hole_place
from hdassist.pages.stiffness import ARCMIN, stiffness_report
from hdassist.preset.catalogue import of_catalogue
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import UNKNOWN as NOT_KNOWN
from hdassist.preset.kinds import unit_of
from hdassist.preset.schema import ResolvedField, origin_counts, resolved_fields, value_text
from hdassist.report.blocks import Block, Curve, Facts, Paragraph, ReportSection, Seat, Table, Tiles
from hdassist.report.report import Report
from hdassist.terminal.answers import report_object
from hdassist.terminal.influence_words import named, samples_words
from hdassist.verdict import Verdict, worst_exit_code
from hdassist.version import __version__

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


def drive_report(sheet: DriveSheet, *, draws: int, seed: int) -> Report:
    """The report of a drive; draws, seed: of what is not known."""
    drive, verdict = sheet.drive, sheet.check.verdict
    check, mount = check_report(sheet.check, seed), mount_report(sheet.advice, seed)
    stiff = stiffness_report(drive, sheet.stiffness)
    k, facts = Kinematics.of(drive), next(block for block in check.blocks if isinstance(block, Facts))
    curves = [block for block in (*mount.blocks, *mount.details) if isinstance(block, Curve)]
    seats = [] if sheet.advice.order == "none" else [b for b in (*mount.blocks, *mount.details) if isinstance(b, Seat)]
    others = [b for b in (*mount.blocks, *mount.details) if not isinstance(b, Curve | Seat)]
    return Report(
        command="report",
        drive=drive,
        head=f"{k.z_g}/{k.z_b} teeth, module {drive.gears.m:g} mm, ratio {abs(k.u):g}, fixed: {TRADE[k.fixed]}",
        verdict=f"{verdict}: {VERDICT_WORDS[verdict]}",
        why=(*check.why, *mount.why, *(f"{label}: {text}" for label, text in facts.rows)),
        blocks=(
            Tiles(tuple(_tiles(sheet))),
            ReportSection("Kinematic error", tuple(_figures_first([*check.blocks, *check.details]))),
            ReportSection("Mounting the fixed wheel", (*seats, *_held(sheet, curves), *others)),
            ReportSection("Torsional stiffness", tuple(_figures_first([*stiff.blocks, *stiff.details]))),
            ReportSection("What it rests on, and what is not known", tuple(_basis(sheet))),
            ReportSection("Where its values come from", tuple(_values(drive))),
            ReportSection("Provenance", (_provenance(drive, draws, seed),)),
        ),
        certificate=sheet.certificate,
        cross_checks=tuple(sheet.cross_checks),
        values={
            "verdict": str(verdict),
            "values": origin_counts(drive),
            "check": report_object(check),
            "mount": report_object(mount),
            "stiffness": report_object(stiff),
            "seed": seed,
        },
        line=check.line,
        warnings=sheet_warnings(sheet),
        exit_code=worst_exit_code([check.exit_code, mount.exit_code]),
    )


def _figures_first(blocks: Sequence[Block]) -> list[Block]:
    return sorted(blocks, key=lambda block: not isinstance(block, Curve))


def _held(sheet: DriveSheet, curves: Sequence[Curve]) -> Iterator[Curve]:
    """Curves over the positions with the limit of each torque less the self error."""
    points = {f"{point.M_g:g} N·m": point for point in sheet.check.points}
    for curve in curves:
        point = next(point for torque, point in points.items() if f" at {torque}" in curve.caption)
        if (limit := point.left_arcsec) is None:
            yield curve
        else:
            yield replace(curve, limit=limit, caption=f"{curve.caption}; dashed: the limit less the self error")


def _tiles(sheet: DriveSheet) -> Iterator[tuple[str, str, str]]:
    for point in sheet.check.points:
        below = "arcsec, 5 to 95 % over what is not known" if point.belief else "arcsec over the full cycle"
        yield (f"F'_ior at {point.M_g:g} N·m", F_ior_words(point, ".1f"), below)
    advice = sheet.advice
    if advice.order == "none":
        yield ("position of the wheel", NOT_KNOWN, "measure first")
    else:
        below = f"{advice.gain:.0%} less error" if advice.order == "turn" else "leave it as it is"
        yield ("position of the wheel", hole_place(advice.choice.target), below.replace("%", " %"))
    if sheet.stiffness.positive:
        yield ("K1", f"{sheet.stiffness.positive[0].stiffness * ARCMIN:.3g}", "N·m/arcmin near zero")
    values = origin_counts(sheet.drive)
    yield ("values assumed", str(values["assumed"]), f"{values['given']} given, {values['identified']} identified")


def _basis(sheet: DriveSheet) -> Iterator[Block]:
    check = sheet.check
    if check.prior and check.prior.fields:
        units = {path: unit_of(info) for path, info in field_table().items()}
        drawn = tuple(
            (named(each.path), f"{each.low:.4g}", f"{each.high:.4g}", units[each.path], each.distribution, each.owner)
            for each in check.prior.fields
        )
        title = f"not known exactly: {samples_words(check.samples)}" if check.samples else "not known exactly"
        yield Table(title, ("field", "from", "to", "unit", "distribution", "whose"), drawn, words=(0, 3, 4, 5))
    else:
        yield Paragraph("Nothing that has a plausible range is assumed.")
    if check.unknown:
        units = {path: unit_of(info) for path, info in field_table().items()}
        rows = tuple((u.path, f"{u.low:g}", f"{u.high:.4g}", units[u.path], u.reason) for u in check.unknown)
        yield Table("not known", ("field", "from", "to", "unit", "why"), rows, words=(0, 3, 4))
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
            yield Table(f"{words}: {len(found)}", FIELD_HEADS, found, words=(0, 2, 3))
    if beside := tuple(_cells(row) for row in rows if of_catalogue(row.path) and row.value is not None):
        yield Table("figures of the catalogue", FIELD_HEADS, beside, words=(0, 2, 3))


def _cells(row: ResolvedField) -> tuple[str, ...]:
    bounds = " to ".join(map(value_text, row.range or ()))
    return row.path, value_text(row.value), row.unit, "; ".join(filter(None, (bounds, row.ref)))


def _provenance(drive: Drive, draws: int, seed: int) -> Facts:
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
    return Facts(rows)
