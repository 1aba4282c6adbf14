"""A comparison of drives as a verdict and tables, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from itertools import zip_longest
from string import ascii_uppercase

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.comparing.changes import ErrorChange
from hdassist.comparing.presets import DrivesComparison
from hdassist.comparing.sheet import DriveSheet
from hdassist.design.check import OperatingPoint
from hdassist.design.check_page import BELIEF, POINT
from hdassist.design.stiffness_page import WHOLE, segment_objects
from hdassist.design.stiffness_page import warnings as stiffness_warnings
from hdassist.model.unknown import names
from hdassist.mounting.page import warnings as mount_warnings
from hdassist.mounting.page import what_to_do
from hdassist.mounting.seat_page import place
from hdassist.preset.kinds import UNKNOWN as NOT_KNOWN
from hdassist.preset.schema import value_text
from hdassist.solve.throughcvxpy import CrossCheck
from hdassist.terminal.answers import Json, certificate_object, cross_checked, envelope
from hdassist.terminal.basis import unknown_objects
from hdassist.terminal.brief import again, facts, proof
from hdassist.terminal.console import Style, TextTable, grid, table
from hdassist.terminal.influence_words import influence_objects
from hdassist.terminal.quantities import as_object
from hdassist.terminal.runs import Answer, Figures

NAMED_PATHS = 6  # in a line
SENSE = {-1: "less", 0: "the same", 1: "more"}
Row = tuple[str, Sequence[str]]  # words, and a cell for each drive


def drives_answer(result: DrivesComparison, *, seed: int, details: bool = False) -> Answer:
    """A comparison of drives in each form; seed, of draws and samples; details, whether all tables are shown."""
    return Answer(
        to_json=lambda: _json(result, seed),
        page=lambda style: _page(result, style, details),
        summary_line=lambda: _verdict(result),
        figures=lambda: _figures(result),
        about=", ".join(drive.name for drive in result.drives),
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


def _letters(result: DrivesComparison) -> list[str]:
    """Letters that stand for the drives: A, B, and so on."""
    return [ascii_uppercase[k] if k < 26 else f"#{k + 1}" for k in range(len(result.sheets))]


def _verdict(result: DrivesComparison) -> str:
    """A sentence for each drive but the first: its error, its best hole, and how many fields differ."""
    letters, holes, lines = _letters(result), [_hole(sheet) for sheet in result.sheets], []
    for other in range(1, len(letters)):
        count = sum(field.rows[0].value != field.rows[other].value for field in result.differences)
        parts = [_at_torque(result, other, k) for k in range(len(result.torques))]
        parts.append(f"best hole {holes[0]}" + ("" if holes[0] == holes[other] else f" -> {holes[other]}"))
        parts.append("no field differs" if not count else "1 field differs" if count == 1 else f"{count} fields differ")
        lines.append(f"{letters[other]} against {letters[0]}: {'; '.join(parts)}")
    return "\n".join(lines)


def _at_torque(result: DrivesComparison, other: int, torque: int) -> str:
    sense, changes = result.sense(other, torque), result.changes[other - 1]
    points = [result.sheets[k].check.points[torque] for k in (0, other)]
    words = f"{result.torques[torque]:g} N·m: F'_ior {' -> '.join(map(F_ior_words, points))} arcsec"
    if sense is None:
        return f"{words}, open: what is not known could reverse it"
    if not sense:
        return f"{words}, the same"
    whole = changes.whole
    share = 100 * abs(whole.median_arcsec[torque]) / np.median(whole.F_ior_arcsec[:, torque])
    drawn = f" in {len(whole.change_arcsec)} drawn pairs" if len(whole.change_arcsec) > 1 else ""
    single = max(changes.single, key=lambda change: abs(change.median_arcsec[torque]), default=None)
    most = f", most by {single.path} alone" if single and len(result.differences) > 1 else ""
    return f"{words}, {share:.0f} % {SENSE[sense]}{drawn}{most}"


def F_ior_words(point: OperatingPoint, digits: str = ".2f") -> str:
    """F'_ior [arcsec] at a torque, or its 5th to 95th percentile over what is not known."""
    found = point.belief
    return f"{found.p5:{digits}} to {found.p95:{digits}}" if found else f"{point.error.F_ior_arcsec:{digits}}"


def _hole(sheet: DriveSheet) -> str:
    """The position that is ordered, unknown where none can be."""
    return NOT_KNOWN if sheet.advice.order == "none" else place(sheet.advice.choice.target).removeprefix("hole ")


def _page(result: DrivesComparison, style: Style, details: bool) -> RenderableType:
    """The verdict; errors, holes and stiffness side by side; the largest changes; with details all that differs."""
    named = zip(_letters(result), result.drives, strict=True)
    subject = ", ".join(f"{letter} {drive.name} ({drive.origin.file})" for letter, drive in named)
    changes, torques = result.changes[0], [f"{M_g:g} N·m" for M_g in result.torques]
    parts: list[RenderableType] = [
        Text(style.text(_verdict(result)), style="bold"),
        Text(style.text(subject)),
        _table(style, "what comes of it", _letters(result), _rows(result)),
    ]
    if changes.single:
        drawn = len(changes.whole.change_arcsec)
        title = "which field does most: each alone from A to B, change of F'_ior, arcsec"
        title += f"\nmedian (least to greatest) of {drawn} pairs drawn from what is not known" if drawn > 1 else ""
        rows = ((each.path or "all together", _change_cells(each)) for each in (*changes.single, changes.whole))
        parts.append(_table(style, title, torques, rows))
    if result.differences and details:
        parts.append(_fields(result, style))
    parts.append(facts(style, _lines(result, details)))
    if details:
        parts.append(Text(style.text(f"certificate: {result.certificate}{cross_checked(_cross_checks(result))}")))
    return Group(*(line for part in parts for line in (part, Text(""))))


def _table(style: Style, title: str, heads: Sequence[str], rows: Iterable[Row]) -> TextTable:
    found = grid(style, title, "", *heads)
    for words, cells in rows:
        found.add_row(*map(style.text, (words, *cells)))
    return found


def _rows(result: DrivesComparison) -> Iterator[Row]:
    """Rows of errors, holes and stiffness: words, and a cell for each drive."""
    sheets, curves = result.sheets, [sheet.stiffness for sheet in result.sheets]
    for k, M_g in enumerate(result.torques):
        points = [sheet.check.points[k] for sheet in sheets]
        held = any(point.limit_arcsec is not None for point in points)
        open_ = any(point.belief for point in points)
        for quantity in (POINT[1], *(BELIEF[:3] if open_ else ()), *(POINT[3:6] if held else ())):
            zero = ", what is not known as 0" if open_ and quantity is POINT[1] else ""
            yield f"{M_g:g} N·m: {quantity.words}{zero}", [quantity.text(point) for point in points]
        best = [sheet.advice.order != "none" and sheet.advice.choice.target.F_ior_arcsec[k] for sheet in sheets]
        yield f"{M_g:g} N·m: in its best hole, arcsec", [f"{F_ior:.2f}" if F_ior else "-" for F_ior in best]
    yield "best hole", [_hole(sheet) for sheet in sheets]
    for k, segments in enumerate(zip_longest(*(curve.positive for curve in curves)), 1):
        # the torques between which a segment lies stand with each drive where they are not the same
        spans = [f"{s.start:.4g} to {s.end:.4g} N·m" if s else "" for s in segments]
        same = len(set(spans)) == 1
        ends = [f", {span}" * (not same) for span in spans]
        cells = [f"{s.stiffness / 1e4:.3g}{end}" if s else "-" for s, end in zip(segments, ends, strict=True)]
        yield f"K{k}{f', {spans[0]}' if same else ''}, 1e4 N·m/rad", cells
    for whole in WHOLE:
        yield whole.words, [whole.text(curve) for curve in curves]


def _change_cells(change: ErrorChange) -> list[str]:
    """The change at each torque: its median, and its range over drawn pairs."""
    median, values = change.median_arcsec, change.change_arcsec.T
    if values.shape[1] == 1:
        return [f"{value:+.2f}" for value in median]
    return [f"{m:+.2f} ({v.min():+.2f} to {v.max():+.2f})" for m, v in zip(median, values, strict=True)]


def _lines(result: DrivesComparison, details: bool) -> Iterator[tuple[str, str]]:
    """Labelled lines below the tables."""
    if paths := result.changes[0].impossible:
        yield "not alone", f"{_some(paths)}: no drive that can be computed, or one that leaves more unknown"
    for letter, sheet in zip(_letters(result), result.sheets, strict=True):
        yield f"{letter} not known", names(sheet.check.unknown)
        yield f"{letter} mounting", what_to_do(sheet.advice) if sheet.advice.order == "none" else ""
        yield f"{letter} influence", ", ".join(each.group for each in sheet.check.influences[:3])
    yield "differs", "" if details else _some([field.path for field in result.differences])
    yield "same value", f"{_some(result.origins)}: from another kind of origin" if result.origins else ""
    yield "next", again("report", result.drives[-1], "-o", "report.html")
    yield "more", "" if details else "--details"
    yield "proof", proof(result.certificate, _cross_checks(result))


def _cross_checks(result: DrivesComparison) -> list[CrossCheck | None]:
    return [cross for sheet in result.sheets for cross in sheet.cross_checks]


def _some(paths: Sequence[str]) -> str:
    """The first of some paths, and how many more there are."""
    return ", ".join(paths[:NAMED_PATHS]) + (
        f" and {len(paths) - NAMED_PATHS} more" if len(paths) > NAMED_PATHS else ""
    )


def _fields(result: DrivesComparison, style: Style) -> Table:
    """Fields that differ, with value and origin in each drive."""
    found = table(style, "what differs")
    found.add_column("field")
    found.add_column("unit")
    for letter in _letters(result):
        found.add_column(letter, justify="right", overflow="fold")
        found.add_column(f"origin of {letter}")
    for field in result.differences:
        values = [NOT_KNOWN if row.kind == NOT_KNOWN else value_text(row.value) for row in field.rows]
        cells = [cell for value, row in zip(values, field.rows, strict=True) for cell in (value, row.kind)]
        found.add_row(*map(style.text, (field.path, field.unit, *cells)))
    return found


def _json(result: DrivesComparison, seed: int) -> Json:
    """The comparison as a JSON object."""
    return {
        **envelope("compare-presets", result.drives[0], warnings=comparison_warnings(result)),
        "presets": [_drive_object(sheet) for sheet in result.sheets],
        "M_g_Nm": list(result.torques),
        "differences": [
            {
                "field": field.path,
                "unit": field.unit,
                "values": [{"value": row.value, "origin": row.kind, "reference": row.ref} for row in field.rows],
            }
            for field in result.differences
        ],
        "same_value_other_origin": list(result.origins),
        "changes": [_changes_object(result, k) for k in range(1, len(result.sheets))],
        "certificate": certificate_object(result.certificate, _cross_checks(result)),
        "seed": seed,
    }


def _drive_object(sheet: DriveSheet) -> Json:
    check, advice, curve = sheet.check, sheet.advice, sheet.stiffness
    best = asdict(advice.choice.target) if advice.order != "none" else {}
    return {
        **envelope("compare-presets", sheet.drive)["preset"],
        "file": sheet.drive.origin.file,
        "operating_points": [as_object((*POINT, *BELIEF), point) for point in check.points],
        "order": advice.order,
        "best": {key: best[key] for key in ("hole", "rotation_deg", "F_ior_arcsec")} if best else None,
        **as_object(WHOLE, curve),
        "stiffness": segment_objects(curve.positive),
        "unknown": unknown_objects(check.unknown),
        "influence": influence_objects(check.influences),
    }


def _changes_object(result: DrivesComparison, other: int) -> Json:
    changes = result.changes[other - 1]
    senses = [result.sense(other, k) for k in range(len(result.torques))]
    return {
        "from": 0,
        "to": other,
        "pairs": len(changes.whole.change_arcsec),
        "F_ior_is": [NOT_KNOWN if sense is None else SENSE[sense] for sense in senses],
        "together": _change_object(changes.whole),
        "single": [{"field": change.path, **_change_object(change)} for change in changes.single],
        "not_alone": list(changes.impossible),
    }


def _change_object(change: ErrorChange) -> Json:
    return {
        "change_arcsec": change.median_arcsec.tolist(),
        "least_arcsec": change.change_arcsec.min(axis=0).tolist(),
        "greatest_arcsec": change.change_arcsec.max(axis=0).tolist(),
    }


def _figures(result: DrivesComparison) -> Figures:
    """One row per drive and torque."""
    columns = (*POINT, *BELIEF)
    rows = [
        [letter, sheet.drive.name, *(quantity.value(point) for quantity in columns)]
        for letter, sheet in zip(_letters(result), result.sheets, strict=True)
        for point in sheet.check.points
    ]
    return ["drive", "preset", *(quantity.key for quantity in columns)], rows
