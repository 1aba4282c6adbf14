"""Everything about a drive as one report."""

from collections.abc import Iterator

from hdassist.comparing.sheet import DriveSheet
from hdassist.model.kinematics import Kinematics
from hdassist.model.unknown import unknown_names
from hdassist.pages.check import check_report
from hdassist.pages.compare_presets import F_ior_words, sheet_warnings
from hdassist.pages.mount import WORDS, mount_report
from hdassist.pages.seat import TRADE, hole_place
from hdassist.pages.stiffness import ARCMIN, stiffness_report
from hdassist.preset.fields import Drive
from hdassist.preset.schema import origin_counts, resolved_fields, value_text
from hdassist.report import Block, Facts, Paragraph, Report, ReportSection, Table, Tiles
from hdassist.terminal.answers import report_object
from hdassist.terminal.words import named, samples_words
from hdassist.verdict import Verdict
from hdassist.version import __version__

INPUT_HEADS = ("input", "share, %", "preset", "drawn from", "unit", "where from")
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
    error = tuple(block for block in (*check.blocks, *check.details) if block is not facts)
    mounting = (*mount.blocks, *mount.details)
    return Report(
        command="report",
        drive=drive,
        head=f"{k.z_g}/{k.z_b} teeth, module {drive.gears.m:g} mm, ratio {abs(k.u):g}, fixed: {TRADE[k.fixed]}",
        verdict=f"{verdict}: {VERDICT_WORDS[verdict]}",
        why=(*check.why, *mount.why, *(f"{label}: {text}" for label, text in facts.rows)),
        blocks=(
            Tiles(tuple(_tiles(sheet))),
            ReportSection("Kinematic error", error),
            ReportSection("Mounting the fixed wheel", mounting),
            ReportSection("Torsional stiffness", (*stiff.blocks, *stiff.details)),
            ReportSection("Assumed and unknown inputs", tuple(_basis(sheet))),
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
        exit_code=check.exit_code,
    )


def _tiles(sheet: DriveSheet) -> Iterator[tuple[str, str, str]]:
    for point in sheet.check.points:
        below = "arcsec, 5 to 95 % over unknown inputs" if point.belief else "arcsec over the full cycle"
        yield (f"F'_ior at {point.M_g:g} N·m", F_ior_words(point, ".1f"), below)
    advice = sheet.advice
    word, gain = WORDS[advice.word].lower(), f"{100 * advice.gain_range[1]:.0f} % less error"
    below = f"{word}: {gain if advice.choice.turn else 'leave it as it is'}"
    yield ("position of the wheel", hole_place(advice.choice.target), below)
    if sheet.stiffness.positive:
        first = sheet.stiffness.positive[0]
        yield ("torsional stiffness K1", f"{first.stiffness * ARCMIN:.3g}", f"N·m/arcmin, up to {first.end:.4g} N·m")
    values = origin_counts(sheet.drive)
    yield ("values assumed", str(values["assumed"]), f"{values['given']} given, {values['identified']} identified")


def _basis(sheet: DriveSheet) -> Iterator[Block]:
    """The inputs that decide F'_ior, with their range and source, and a summary of all values."""
    drive, check = sheet.drive, sheet.check
    given, drawn = {row.path: row for row in resolved_fields(drive)}, check.prior.fields if check.prior else ()
    ranges = {each.path: f"{each.low:.4g} to {each.high:.4g}" for each in drawn}
    rows = tuple(
        (named(row.path), f"{100 * share:.0f}", value_text(row.value), ranges[row.path], row.unit, row.ref)
        for row, share in ((given[each.group], each.share) for each in check.influences)
    )
    title = f"inputs by their share of the variance of ln F'_ior at {check.points[check.least_sure].M_g:g} N·m"
    yield Table(title, INPUT_HEADS, rows, words=(0, 4, 5))
    values, names = origin_counts(drive), unknown_names(check.unknown)
    sampled = f"{len(drawn)} inputs are not known exactly: {samples_words(check.samples)}. " if check.samples else ""
    yield Paragraph(
        f"{sampled}{f'Deviations that are not known: {names}. ' if names else ''}"
        f"The preset gives {sum(values.values())} values: {values['given']} given, {values['identified']} identified, "
        f"{values['assumed']} assumed (hdassist presets show --resolved lists each with its range and source). Values "
        "identified from measurements agree with the model by themselves, which proves nothing of it; "
        "docs/validation.md has the measurements that the model was compared with."
    )


def _provenance(drive: Drive, draws: int, seed: int) -> Facts:
    origin = drive.origin
    rows = (
        ("preset", f"{origin.file or drive.name}, SHA-256 {origin.sha256}"),
        ("set on top", "; ".join(origin.overrides) or "none"),
        ("description", " ".join(drive.description.split()) or "none"),
        ("made by", f"hdassist {__version__}, seed {seed}, at least {draws} effective samples of uncertain inputs"),
    )
    return Facts(rows)
