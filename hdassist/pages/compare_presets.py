"""A comparison of drives as a verdict and tables, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import partial
from itertools import zip_longest
from string import ascii_uppercase

from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.comparing.drives import DriveChanges, DrivesComparison, ErrorChange, differs, field_rows
from hdassist.comparing.sheet import DriveSheet
from hdassist.design.check import OperatingPoint
from hdassist.json_parts import Json, certificate_object
from hdassist.model.unknown import unknown_names
from hdassist.pages import check as check_page
from hdassist.pages.check import BELIEF, POINT_QUANTITIES
from hdassist.pages.compare import table_of
from hdassist.pages.mount import mount_warnings, what_to_do
from hdassist.pages.seat import hole_place
from hdassist.pages.stiffness import WHOLE_QUANTITIES, segment_objects, stiffness_warnings
from hdassist.preset.kinds import UNKNOWN as NOT_KNOWN
from hdassist.preset.schema import ResolvedField, value_text
from hdassist.report.quantities import as_object
from hdassist.solve.throughcvxpy import CrossCheck
from hdassist.terminal.answers import cross_check_words, envelope, report_object
from hdassist.terminal.brief import again, facts, proof
from hdassist.terminal.console import Style
from hdassist.terminal.runs import Answer, CsvTable

NAMED_PATHS = 6  # in a line


def drives_answer(result: DrivesComparison, *, seed: int, details: bool = False) -> Answer:
    """A comparison of drives in each form; seed, of draws and samples; details, whether all tables are shown."""
    return Answer(
        to_json=partial(_json, result, seed),
        page=partial(_page, result, details),
        summary_line=partial(_verdict, result),
        figures=partial(_figures, result),
        about=", ".join(sheet.drive.name for sheet in result.sheets),
        proof=result.certificate,
    )


def comparison_warnings(result: DrivesComparison) -> tuple[str, ...]:
    """Warnings of all drives, each once."""
    warnings = [f"{sheet.drive.name}: {text}" for sheet in result.sheets for text in sheet_warnings(sheet)]
    return tuple(dict.fromkeys(warnings))


def sheet_warnings(sheet: DriveSheet) -> tuple[str, ...]:
    """Warnings of a drive's check, mounting and stiffness, each once."""
    stiff = stiffness_warnings(sheet.drive, sheet.stiffness)
    return tuple(dict.fromkeys((*sheet.check.warnings, *mount_warnings(sheet.advice), *stiff)))


def F_ior_words(point: OperatingPoint, digits: str = ".2f") -> str:
    """F'_ior [arcsec] at a torque, or its 5th to 95th percentile over what is not known."""
    found = point.belief
    return f"{found.p5:{digits}} to {found.p95:{digits}}" if found else f"{point.error.F_ior_arcsec:{digits}}"


def _lettered(result: DrivesComparison) -> dict[str, DriveSheet]:
    """The sheets by letters that stand for the drives: A, B, and so on."""
    return {ascii_uppercase[k] if k < 26 else f"#{k + 1}": sheet for k, sheet in enumerate(result.sheets)}


def _hole(sheet: DriveSheet) -> str:
    """The position that is ordered, unknown where none can be."""
    return NOT_KNOWN if sheet.advice.order == "none" else hole_place(sheet.advice.choice.target).removeprefix("hole ")


def _mounted_best(sheet: DriveSheet, torque: int) -> str:
    """F'_ior [arcsec] in the position that is ordered, at a torque by its place."""
    best = sheet.advice.choice.target
    return NOT_KNOWN if sheet.advice.order == "none" else f"{best.F_ior_arcsec[torque]:.2f}"


def _verdict(result: DrivesComparison) -> str:
    """A sentence for each drive but the first: its error as built and mounted best, and how many fields differ."""
    (first, sheet), *others = _lettered(result).items()
    lines = []
    for (letter, other), changes in zip(others, result.changes, strict=True):
        both = sheet, other
        count = sum(map(differs, field_rows([each.drive for each in both])))
        parts = [_at_torque(both, changes, k, M_g) for k, M_g in enumerate(result.torques)]
        parts.append(f"best hole {' -> '.join(dict.fromkeys(map(_hole, both)))}")
        parts.append(f"{count or 'no'} field{'s differ' if count > 1 else ' differs'}")
        lines.append(f"{letter} against {first}: {'; '.join(parts)}")
    return "\n".join(lines)


def _at_torque(both: Sequence[DriveSheet], changes: DriveChanges, k: int, M_g: float) -> str:
    built = " -> ".join(F_ior_words(sheet.check.points[k]) for sheet in both)
    mounted = " -> ".join(_mounted_best(sheet, k) for sheet in both)
    words, sense = f"{M_g:g} N·m: F'_ior {built} arcsec, mounted best {mounted}", changes.F_ior_is[k]
    if sense == NOT_KNOWN:
        return f"{words}, open: what is not known could reverse it"
    if sense == "the same":
        return f"{words}, the same"
    drawn = f" in {changes.pairs} drawn pairs" if changes.pairs > 1 else ""
    single = max(changes.single, key=lambda change: abs(change.change_arcsec[k]), default=None)
    most = f", most by {single.field} alone" if single and len(changes.single) > 1 else ""
    return f"{words}, {100 * changes.together.share[k]:.0f} % {sense}{drawn}{most}"


def _page(result: DrivesComparison, details: bool, style: Style) -> RenderableType:
    """The verdict; all drives side by side; which field does most; with details all that differs."""
    sheets, torques = _lettered(result), [f"{M_g:g} N·m" for M_g in result.torques]
    subject = ", ".join(f"{a} {sheet.drive.name} ({sheet.drive.origin.file})" for a, sheet in sheets.items())
    parts: list[RenderableType] = [Text(style.text(_verdict(result)), style="bold"), Text(style.text(subject))]
    parts.append(table_of(style, "side by side", ("", *sheets), _rows(result)))
    for letter, changes in zip([*sheets][1:], result.changes, strict=True):
        title = f"which field does most: each alone from A to {letter}, change of F'_ior, arcsec"
        if changes.pairs > 1:
            title += f"\nmedian (least to greatest) of {changes.pairs} pairs drawn from what is not known"
        rows = [(each.field or "all together", *_change_cells(each)) for each in (*changes.single, changes.together)]
        if changes.single:
            parts.append(table_of(style, title, ("", *torques), rows))
    if details:
        differing = ((_named(row), *map(_cell, row)) for row in result.fields if differs(row))
        parts.append(table_of(style, "fields that differ", ("", *sheets), differing))
    parts.append(facts(style, _lines(result, details)))
    if details:
        parts.append(Text(style.text(f"certificate: {result.certificate}{cross_check_words(_cross_checks(result))}")))
    return Group(*(line for part in parts for line in (part, Text(""))))


def _rows(result: DrivesComparison) -> Iterator[Sequence[str]]:
    """Rows of errors, holes and stiffness: words, and a cell for each drive."""
    sheets = result.sheets
    for k, M_g in enumerate(result.torques):
        points = [sheet.check.points[k] for sheet in sheets]
        held, open_ = any(point.limit_arcsec for point in points), any(point.belief for point in points)
        for quantity in (POINT_QUANTITIES[1], *(BELIEF[:3] if open_ else ()), *(POINT_QUANTITIES[3:6] if held else ())):
            zero = ", what is not known as 0" if open_ and quantity is POINT_QUANTITIES[1] else ""
            yield f"{M_g:g} N·m: {quantity.words}{zero}", *map(quantity.text, points)
        yield f"{M_g:g} N·m: F'_ior, mounted best, arcsec", *(_mounted_best(sheet, k) for sheet in sheets)
    yield "best hole", *map(_hole, sheets)
    for k, segments in enumerate(zip_longest(*(sheet.stiffness.positive for sheet in sheets)), 1):
        # the torques between which a segment lies, as they need not be the same
        ends = (f"{s.stiffness / 1e4:.3g} ({s.start:.4g} to {s.end:.4g} N·m)" if s else "-" for s in segments)
        yield f"K{k}, 1e4 N·m/rad", *ends
    for whole in WHOLE_QUANTITIES:
        yield whole.words, *(whole.text(sheet.stiffness) for sheet in sheets)


def _named(row: Sequence[ResolvedField]) -> str:
    """Path and unit of a field."""
    return f"{row[0].path}, {row[0].unit}".removesuffix(", ")


def _cell(field: ResolvedField) -> str:
    """A value and its origin."""
    return NOT_KNOWN if field.kind == NOT_KNOWN else f"{value_text(field.value)} ({field.kind})"


def _change_cells(change: ErrorChange) -> Iterator[str]:
    """The change at each torque: its median, and its range over drawn pairs."""
    for median, low, high in zip(change.change_arcsec, change.least_arcsec, change.greatest_arcsec, strict=True):
        yield f"{median:+.2f}" + (f" ({low:+.2f} to {high:+.2f})" if low < high else "")


def _lines(result: DrivesComparison, details: bool) -> Iterator[tuple[str, str]]:
    """Labelled lines below the tables."""
    if paths := [path for changes in result.changes for path in changes.not_alone]:
        yield "not alone", f"{_some(paths)}: no drive that can be computed, or one that leaves more unknown"
    for letter, sheet in _lettered(result).items():
        yield f"{letter} not known", unknown_names(sheet.check.unknown)
        yield f"{letter} mounting", what_to_do(sheet.advice) if sheet.advice.order == "none" else ""
        yield f"{letter} influence", ", ".join(each.group for each in sheet.check.influences[:3])
    yield "differs", "" if details else _some([row[0].path for row in result.fields if differs(row)])
    origins = _some(_other_origins(result))
    yield "same value", f"{origins}: from another kind of origin" if origins else ""
    yield "next", again("report", result.sheets[-1].drive, "-o", "report.html")
    yield "more", "" if details else "--details"
    yield "proof", proof(result.certificate, _cross_checks(result))


def _other_origins(result: DrivesComparison) -> list[str]:
    """Paths of the fields that drives have with the same value, but not by the same kind of origin."""
    return [row[0].path for row in result.fields if not differs(row) and len({cell.kind for cell in row}) > 1]


def _cross_checks(result: DrivesComparison) -> list[CrossCheck | None]:
    return [cross for sheet in result.sheets for cross in sheet.cross_checks]


def _some(paths: Sequence[str]) -> str:
    """The first of some paths, and how many more there are."""
    more = f" and {len(paths) - NAMED_PATHS} more" if len(paths) > NAMED_PATHS else ""
    return ", ".join(dict.fromkeys(paths[:NAMED_PATHS])) + more


def _json(result: DrivesComparison, seed: int) -> Json:
    """The comparison as a JSON object."""
    return {
        **envelope("compare-presets", result.sheets[0].drive, warnings=comparison_warnings(result)),
        "presets": [_drive_object(sheet, seed) for sheet in result.sheets],
        "M_g_Nm": list(result.torques),
        "differences": [
            {
                "field": row[0].path,
                "unit": row[0].unit,
                "values": [{"value": cell.value, "origin": cell.kind, "reference": cell.ref} for cell in row],
            }
            for row in result.fields
            if differs(row)
        ],
        "same_value_other_origin": _other_origins(result),
        "changes": [{"from": 0, "to": k, **asdict(changes)} for k, changes in enumerate(result.changes, 1)],
        "certificate": certificate_object(result.certificate, _cross_checks(result)),
        "seed": seed,
    }


def _drive_object(sheet: DriveSheet, seed: int) -> Json:
    """What `check`, `mount` and `stiffness` say of a drive in their JSON, as far as it is compared."""
    check, best = report_object(check_page.check_report(sheet.check, seed)), sheet.advice.choice.target
    ordered = {"hole": best.hole, "rotation_deg": best.rotation_deg, "F_ior_arcsec": list(best.F_ior_arcsec)}
    return {
        **check["preset"],
        "file": sheet.drive.origin.file,
        **{key: check[key] for key in ("operating_points", "unknown", "influence")},
        "order": sheet.advice.order,
        "best": None if sheet.advice.order == "none" else ordered,
        **as_object(WHOLE_QUANTITIES, sheet.stiffness),
        "stiffness": segment_objects(sheet.stiffness.positive),
    }


def _figures(result: DrivesComparison) -> CsvTable:
    """One row per drive and torque."""
    tables = {letter: check_page.check_csv(sheet.check) for letter, sheet in _lettered(result).items()}
    heads, _ = tables["A"]
    return ["drive", *heads], [[letter, *row] for letter, (_, rows) in tables.items() for row in rows]
