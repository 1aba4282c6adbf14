"""Everything about a drive as one report."""

from __future__ import annotations

from collections.abc import Iterator

from hdassist.comparing.sheet import DriveSheet
from hdassist.model.kinematics import Kinematics
from hdassist.model.unknown import unknown_names
from hdassist.pages.check import check_report
from hdassist.pages.compare_presets import F_ior_words, sheet_warnings
from hdassist.pages.mount import mount_report
from hdassist.pages.seat import TRADE, hole_place
from hdassist.pages.stiffness import ARCMIN, stiffness_report
from hdassist.preset.fields import Drive
from hdassist.preset.kinds import UNKNOWN as NOT_KNOWN
from hdassist.preset.schema import ResolvedField, origin_counts, resolved_fields, value_text
from hdassist.report.blocks import Block, Curve, Facts, Paragraph, ReportSection, Seat, Table, Tiles
from hdassist.report.report import Report
from hdassist.terminal.answers import report_object
from hdassist.terminal.influence_words import field_unit, named, samples_words
from hdassist.verdict import Verdict, worst_exit_code
from hdassist.version import __version__

FIELD_HEADS = ("field", "value", "unit", "plausible range; where from")
ORIGIN_WORDS = {
    NOT_KNOWN: "not given (the direction of a deviation of 0 does not matter)",
    "override": "set on the command line",
    "assumed": "assumed",
    "identified": "identified from measurements",
}
VERDICT_WORDS = {
    Verdict.PASS: "within its limits",
    Verdict.FAIL: "beyond its limits",
    Verdict.INCONCLUSIVE: "unknown inputs could change it",
    Verdict.NO_LIMIT: "no limit to hold it against",
}


def drive_report(sheet: DriveSheet, *, draws: int, seed: int) -> Report:
    """The report of a drive; draws, seed: of the unknown inputs."""
    drive, verdict = sheet.drive, sheet.check.verdict
    check = check_report(sheet.check, seed)
    mount = mount_report(sheet.advice, seed, limits=[point.left_arcsec for point in sheet.check.points])
    stiff = stiffness_report(drive, sheet.stiffness)
    k, facts = Kinematics.of(drive), next(block for block in check.blocks if isinstance(block, Facts))
    mounting = [
        block for block in (*mount.blocks, *mount.details) if mount.exit_code == 0 or not isinstance(block, Seat)
    ]
    return Report(
        command="report",
        drive=drive,
        head=f"{k.z_g}/{k.z_b} teeth, module {drive.gears.m:g} mm, ratio {abs(k.u):g}, fixed: {TRADE[k.fixed]}",
        verdict=f"{verdict}: {VERDICT_WORDS[verdict]}",
        why=(*check.why, *mount.why, *(f"{label}: {text}" for label, text in facts.rows)),
        blocks=(
            Tiles(tuple(_tiles(sheet))),
            _section("Kinematic error", *check.blocks, *check.details),
            _section("Mounting the fixed wheel", *mounting),
            _section("Torsional stiffness", *stiff.blocks, *stiff.details),
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


def _section(title: str, *blocks: Block) -> ReportSection:
    """Blocks under a title, seat and curves first."""
    order = {Seat: 0, Curve: 1}
    return ReportSection(title, tuple(sorted(blocks, key=lambda block: order.get(type(block), 2))))


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
        first = sheet.stiffness.positive[0]
        yield ("torsional stiffness K1", f"{first.stiffness * ARCMIN:.3g}", f"N·m/arcmin, up to {first.end:.4g} N·m")
    values = origin_counts(sheet.drive)
    yield ("values assumed", str(values["assumed"]), f"{values['given']} given, {values['identified']} identified")


def _basis(sheet: DriveSheet) -> Iterator[Block]:
    check = sheet.check
    rows = tuple(
        (named(f.path), f"{f.low:.4g}", f"{f.high:.4g}", field_unit(f.path), f.distribution, f.owner)
        for f in (check.prior.fields if check.prior else ())
    )
    title = f"not known exactly: {samples_words(check.samples)}" if check.samples else "not known exactly"
    yield Table(title, ("field", "from", "to", "unit", "distribution", "whose"), rows, words=(0, 3, 4, 5))
    names = unknown_names(check.unknown)
    yield Paragraph(f"Deviations that are not known: {names}." if names else "All deviations that matter are given.")


def _values(drive: Drive) -> Iterator[Block]:
    rows, values = resolved_fields(drive), origin_counts(drive)
    yield Paragraph(
        f"The preset gives {sum(values.values())} values: {values['given']} given, {values['identified']} identified, "
        f"{values['assumed']} assumed (all of them: hdassist presets show --resolved). What values were identified "
        "from agrees with the model by itself and proves nothing; what the model was compared with stands in "
        "docs/validation.md."
    )
    used = [row for row in rows if row.value is not None or not row.path.startswith("catalogue.")]
    for kind, words in ORIGIN_WORDS.items():
        found = tuple(_cells(row) for row in used if row.kind == kind)
        yield Table(f"{words}: {len(found)}", FIELD_HEADS, found, words=(0, 2, 3))


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
