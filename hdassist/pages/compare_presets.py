"""A comparison of drives as a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from string import ascii_uppercase

from hdassist.comparing.drives import DriveChanges, DrivesComparison, ErrorChange
from hdassist.comparing.sheet import DriveSheet
from hdassist.design.check import OperatingPoint
from hdassist.json_parts import Json
from hdassist.model.unknown import unknown_names
from hdassist.pages import check as check_page
from hdassist.pages.mount import mount_warnings
from hdassist.pages.seat import hole_place
from hdassist.pages.stiffness import stiffness_warnings
from hdassist.preset.kinds import UNKNOWN as NOT_KNOWN
from hdassist.preset.schema import ResolvedField, value_text
from hdassist.report import NO_VALUE, Facts, Report, Table
from hdassist.terminal.answers import report_object
from hdassist.terminal.words import again

NAMED_PATHS = 6  # in a line
LARGEST_SHARE = 100.0  # of F'_ior of A: a greater one says that A has hardly any error
DRIVE_HEADS = ("", "torque", "as built", "mounted best", "against A", "most by")


def drives_report(result: DrivesComparison, seed: int) -> Report:
    """Drives beside each other, the first as the measure of the others; seed, of draws and samples."""
    names = ", ".join(f"{letter} {sheet.drive.origin.file}" for letter, sheet in _lettered(result).items())
    verdict = _verdict(result)
    differing = ((f"{row[0].path}, {row[0].unit}".removesuffix(", "), *map(_cell, row)) for row in result.differing)
    return Report(
        command="compare-presets",
        drive=result.sheets[0].drive,
        head=names,
        verdict=verdict,
        blocks=(
            Table(
                "F'_ior, ″; 5 to 95 % where inputs are unknown", DRIVE_HEADS, tuple(_drive_rows(result)), words=(0, 5)
            ),
            Facts.of(_facts(result)),
        ),
        details=(
            *_changes(result),
            Table("fields that differ", ("", *_lettered(result)), tuple(differing)),
        ),
        certificate=result.certificate,
        cross_checks=tuple(cross for sheet in result.sheets for cross in sheet.cross_checks),
        values=_values(result, seed),
        line=verdict,
        about=", ".join(sheet.drive.name for sheet in result.sheets),
    )


def comparison_warnings(result: DrivesComparison) -> tuple[str, ...]:
    """Warnings of all drives, each once."""
    return tuple(dict.fromkeys(f"{each.drive.name}: {text}" for each in result.sheets for text in sheet_warnings(each)))


def sheet_warnings(sheet: DriveSheet) -> tuple[str, ...]:
    """Warnings of a drive's check, mounting and stiffness, each once."""
    stiff = stiffness_warnings(sheet.drive, sheet.stiffness)
    return tuple(dict.fromkeys((*sheet.check.warnings, *mount_warnings(sheet.advice), *stiff)))


def F_ior_words(point: OperatingPoint, digits: str = ".2f") -> str:
    """F'_ior [arcsec] at a torque, or its 5th to 95th percentile over the uncertain inputs."""
    found = point.belief
    return f"{found.p5:{digits}} to {found.p95:{digits}}" if found else f"{point.F_ior_or_error:{digits}}"


def _lettered(result: DrivesComparison) -> dict[str, DriveSheet]:
    """The sheets by letters that stand for the drives: A, B, and so on."""
    return {ascii_uppercase[k] if k < 26 else f"#{k + 1}": sheet for k, sheet in enumerate(result.sheets)}


def _drive_rows(result: DrivesComparison) -> Iterator[tuple[str, ...]]:
    """A cell for each of DRIVE_HEADS of each drive at each torque."""
    for k, M_g in enumerate(result.torques):
        for (letter, sheet), changes in zip(_lettered(result).items(), (None, *result.changes), strict=True):
            change = _change(changes, k) if changes else (NO_VALUE, NO_VALUE)
            best = sheet.advice.choice.target
            mounted = f"{best.F_ior_arcsec[k]:.2f}, {hole_place(best)}"
            yield letter, f"{M_g:g} N·m", F_ior_words(sheet.check.points[k]), mounted, *change


def _change(changes: DriveChanges, k: int) -> tuple[str, str]:
    """How F'_ior changes from A at a torque by its place, and the field that alone does most."""
    most = max(changes.single, key=lambda change: abs(change.change_arcsec[k]), default=None)
    sense, share = changes.F_ior_is[k], changes.together.share[k]
    plain = sense == "the same" or share > LARGEST_SHARE
    words = "open" if sense == NOT_KNOWN else sense if plain else f"{100 * share:.0f} % {sense}"
    return words, most.field if most else NO_VALUE


def _verdict(result: DrivesComparison) -> str:
    """The change of each drive but A, at each torque where there are several."""
    verdicts = []
    for letter, changes in zip([*_lettered(result)][1:], result.changes, strict=True):
        loads = [f" at {M_g:g} N·m" * (len(result.torques) > 1) for M_g in result.torques]
        verdicts.append(f"{letter} " + ", ".join(_change(changes, k)[0] + load for k, load in enumerate(loads)))
    return "; ".join(verdicts)


def _changes(result: DrivesComparison) -> Iterator[Table]:
    """The change that each field that differs makes alone, by drive."""
    torques = [f"{M_g:g} N·m" for M_g in result.torques]
    for letter, changes in zip([*_lettered(result)][1:], result.changes, strict=True):
        title = f"each field alone from A to {letter}, change of F'_ior, ″"
        rows = [(each.field or "all together", *_change_cells(each)) for each in (*changes.single, changes.together)]
        notes = [f"median (5 to 95 %) of {changes.pairs} pairs drawn from unknown inputs"] * (changes.pairs > 1)
        paths = _some(changes.not_alone)
        notes += [f"no drive that can be computed, or one that leaves more unknown: {paths}"] * bool(paths)
        yield Table(title, ("", *torques), tuple(rows), notes=tuple(notes))


def _cell(field: ResolvedField) -> str:
    """A value, its origin and its range."""
    bounds = f" {' to '.join(map(value_text, field.range))}" if field.range and field.kind == "assumed" else ""
    return NOT_KNOWN if field.kind == NOT_KNOWN else f"{value_text(field.value)} ({field.kind}{bounds})"


def _change_cells(change: ErrorChange) -> Iterator[str]:
    """The change at each torque: its median, with 5th and 95th percentile over drawn pairs."""
    for median, low, high in zip(change.change_arcsec, change.p5_arcsec, change.p95_arcsec, strict=True):
        yield f"{median:+.2f}" + (f" ({low:+.2f} to {high:+.2f})" if low < high else "")


def _facts(result: DrivesComparison) -> Iterator[tuple[str, str]]:
    """Unknown inputs, influences, differences and the next command, a label and a text each."""
    for letter, sheet in _lettered(result).items():
        yield f"{letter} unknown", unknown_names(sheet.check.unknown)
        yield f"{letter} influence", ", ".join(each.group for each in sheet.check.influences[:3])
    yield "differs", _some([row[0].path for row in result.differing])
    if any(NOT_KNOWN in changes.F_ior_is for changes in result.changes):
        yield "open", "unknown inputs could reverse this change"
    yield "next", again("report", result.sheets[-1].drive, "-o", "report.html")


def _some(paths: Sequence[str]) -> str:
    """The first of some paths, and how many more there are."""
    more = f" and {len(paths) - NAMED_PATHS} more" if len(paths) > NAMED_PATHS else ""
    return ", ".join(dict.fromkeys(paths[:NAMED_PATHS])) + more


def _values(result: DrivesComparison, seed: int) -> Json:
    return {
        "warnings": list(comparison_warnings(result)),
        "presets": [_drive_object(sheet, seed) for sheet in result.sheets],
        "M_g_Nm": list(result.torques),
        "differences": [
            {
                "field": row[0].path,
                "unit": row[0].unit,
                "values": [
                    {"value": cell.value, "origin": cell.kind, "reference": cell.ref, "range": cell.range}
                    for cell in row
                ],
            }
            for row in result.differing
        ],
        "changes": [{"from": 0, "to": k, **asdict(changes)} for k, changes in enumerate(result.changes, 1)],
        "seed": seed,
    }


def _drive_object(sheet: DriveSheet, seed: int) -> Json:
    """The JSON of `check` and `mount` on a drive, as far as it is compared."""
    check, best = report_object(check_page.check_report(sheet.check, seed)), sheet.advice.choice.target
    ordered = {"hole": best.hole, "rotation_deg": best.rotation_deg, "F_ior_arcsec": list(best.F_ior_arcsec)}
    return {
        **check["preset"],
        "file": sheet.drive.origin.file,
        **{key: check[key] for key in ("operating_points", "unknown", "influence")},
        "word": sheet.advice.word,
        "order": "turn" if sheet.advice.choice.turn else "leave",
        "best": ordered,
    }
