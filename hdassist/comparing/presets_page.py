"""A comparison of drives as a verdict and tables, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from string import ascii_uppercase

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.comparing.changes import Change, Changes
from hdassist.comparing.presets import DrivesComparison
from hdassist.comparing.sheet import DriveSheet
from hdassist.design.check import OperatingPoint
from hdassist.design.check_page import BELIEF, POINT
from hdassist.design.stiffness_page import WHOLE
from hdassist.design.stiffness_page import warnings as stiffness_warnings
from hdassist.error.stiffness import Stiffness
from hdassist.model.unknown import names
from hdassist.mounting.advice import Advice
from hdassist.mounting.page import warnings as mount_warnings
from hdassist.mounting.page import what_to_do
from hdassist.mounting.seat_page import place
from hdassist.preset.kinds import UNKNOWN as NOT_KNOWN
from hdassist.preset.schema import ResolvedField, value_text
from hdassist.terminal.answers import Json, certificate_object, cross_checked, envelope
from hdassist.terminal.basis import unknown_objects
from hdassist.terminal.brief import again, facts, proof
from hdassist.terminal.console import Style, table
from hdassist.terminal.influence_words import influence_objects
from hdassist.terminal.quantities import as_object
from hdassist.terminal.runs import Answer, Figures

SHOWN = 6  # paths in a line
SENSE = {-1: "less", 0: "the same", 1: "more"}


def answer(result: DrivesComparison, *, seed: int, details: bool = False) -> Answer:
    """What there is to say of a comparison; seed, of draws and samples; details, whether all tables are shown."""
    return Answer(
        to_json=lambda: to_json(result, seed),
        page=lambda style: render(result, style, details=details),
        summary_line=lambda: verdict_line(result),
        figures=lambda: figures(result),
        about=", ".join(drive.name for drive in result.drives),
        proof=result.certificate,
    )


def warnings(result: DrivesComparison) -> tuple[str, ...]:
    """What a reader should know beside the numbers, each said once."""
    found = [f"{sheet.drive.name}: {text}" for sheet in result.sheets for text in sheet_warnings(sheet)]
    return tuple(dict.fromkeys(found))


def sheet_warnings(sheet: DriveSheet) -> tuple[str, ...]:
    """What a reader should know beside the numbers of one drive, each said once."""
    stiff = stiffness_warnings(sheet.drive, sheet.stiffness)
    return tuple(dict.fromkeys((*sheet.check.warnings, *mount_warnings(sheet.advice), *stiff)))


def letters(result: DrivesComparison) -> list[str]:
    """What the drives are called: A, B, and so on."""
    return [ascii_uppercase[k] if k < 26 else f"#{k + 1}" for k in range(len(result.sheets))]


def verdict_line(result: DrivesComparison) -> str:
    """The answer in a sentence for each drive but the first."""
    called = letters(result)
    return "\n".join(f"{called[k]} against {called[0]}: {_verdict(result, k)}" for k in range(1, len(called)))


def _verdict(result: DrivesComparison, other: int) -> str:
    parts = [_at_torque(result, other, k) for k in range(len(result.torques))]
    first, second = (_hole(result.sheets[k]) for k in (0, other))
    parts.append(f"best hole {first}" if first == second else f"best hole {first} -> {second}")
    count = sum(field.there[0].value != field.there[other].value for field in result.differences)
    parts.append("no field differs" if not count else "1 field differs" if count == 1 else f"{count} fields differ")
    return "; ".join(parts)


def _at_torque(result: DrivesComparison, other: int, torque: int) -> str:
    sense, whole = result.sense(other, torque), result.changes[other - 1].whole
    values = " -> ".join(_error(result.sheets[k].check.points[torque]) for k in (0, other))
    where = f"{result.torques[torque]:g} N·m: F'_ior {values} arcsec"
    if sense is None:
        return f"{where}, open: what is not known could reverse it"
    if not sense:
        return f"{where}, the same"
    share = 100 * abs(whole.median_arcsec[torque]) / np.median(whole.F_ior_arcsec[:, torque])
    drawn = f" in {len(whole.change_arcsec)} drawn pairs" if len(whole.change_arcsec) > 1 else ""
    single = max(result.changes[other - 1].single, key=lambda c: abs(c.median_arcsec[torque]), default=None)
    most = f", most by {single.path} alone" if single and len(result.differences) > 1 else ""
    return f"{where}, {share:.0f} % {SENSE[sense]}{drawn}{most}"


def _error(point: OperatingPoint) -> str:
    """F'_ior, or its range over what is not known."""
    found = point.belief
    return f"{found.p5:.2f} to {found.p95:.2f}" if found else f"{point.error.F_ior_arcsec:.2f}"


def _hole(sheet: DriveSheet) -> str:
    """The position that is ordered, unknown where nothing can be."""
    target = sheet.advice.choice.target
    if sheet.advice.order == "none":
        return NOT_KNOWN
    return place(target).removeprefix("hole ")


def render(result: DrivesComparison, style: Style, *, details: bool = False) -> RenderableType:
    """The verdict; errors, holes and stiffness beside each other; what does most; with details all that differs."""
    called = list(zip(letters(result), result.drives, strict=True))
    subject = ", ".join(f"{letter} {drive.name} ({drive.origin.file})" for letter, drive in called)
    parts: list[RenderableType] = [
        Text(style.text(verdict_line(result)), style="bold"),
        Text(style.text(subject)),
        _table(style, "what comes of it", result, list(_rows(result))),
    ]
    parts += [_changes(result, style)] if result.changes[0].single else []
    parts += [_fields(result, style)] if result.differences and details else []
    parts.append(facts(style, _lines(result, details)))
    if details:
        crossed = cross_checked(cross for sheet in result.sheets for cross in sheet.cross_checks)
        parts.append(Text(style.text(f"certificate: {result.certificate}{crossed}")))
    return Group(*(line for part in parts for line in (part, Text(""))))


def _rows(result: DrivesComparison) -> Iterator[tuple[str, list[str]]]:
    """Rows of the table of errors, holes and stiffness: words, and a cell for each drive."""
    checks, curves = [sheet.check for sheet in result.sheets], [sheet.stiffness for sheet in result.sheets]
    for k, M_g in enumerate(result.torques):
        points = [check.points[k] for check in checks]
        held = any(point.limit_arcsec is not None for point in points)
        some_open = any(point.belief for point in points)
        for quantity in (*POINT[1:2], *(BELIEF[:3] if some_open else ()), *(POINT[3:6] if held else ())):
            zero = ", what is not known as 0" if some_open and quantity is POINT[1] else ""
            yield f"{M_g:g} N·m: {quantity.words}{zero}", [quantity.text(point) for point in points]
        yield f"{M_g:g} N·m: in its best hole, arcsec", [_best(sheet.advice, k) for sheet in result.sheets]
    yield "best hole", [_hole(sheet) for sheet in result.sheets]
    yield from _segments(curves)
    for whole in WHOLE:
        yield whole.words, [whole.text(curve) for curve in curves]


def _segments(curves: list[Stiffness]) -> Iterator[tuple[str, list[str]]]:
    """Rows of K1 to K3; the torques that they lie between stand with each where they are not the same."""
    for k in range(max(len(curve.positive) for curve in curves)):
        ends = [curve.positive[k] if k < len(curve.positive) else None for curve in curves]
        spans = [f"{s.start:.4g} to {s.end:.4g} N·m" if s else "" for s in ends]
        same = len(set(spans)) == 1
        cells = [f"{s.stiffness / 1e4:.3g}" + ("" if same else f", {span}") if s else "-"
                 for s, span in zip(ends, spans, strict=True)]  # fmt: skip
        yield f"K{k + 1}{f', {spans[0]}' if same else ''}, 1e4 N·m/rad", cells


def _best(advice: Advice, torque: int) -> str:
    return "-" if advice.order == "none" else f"{advice.choice.target.F_ior_arcsec[torque]:.2f}"


def _table(style: Style, title: str, result: DrivesComparison, rows: list[tuple[str, list[str]]]) -> Table:
    grid = table(style, title)
    grid.add_column("")
    for letter in letters(result):
        grid.add_column(letter, justify="right")
    for words, cells in rows:
        grid.add_row(style.text(words), *map(style.text, cells))
    return grid


def _changes(result: DrivesComparison, style: Style) -> Table:
    """What does most: each field alone changed from A to B, and all together."""
    found = result.changes[0]
    drawn = len(found.whole.change_arcsec)
    title = "which field does most: each alone from A to B, change of F'_ior, arcsec"
    title += f"\nmedian (least to greatest) of {drawn} pairs drawn from what is not known" if drawn > 1 else ""
    grid = table(style, title)
    grid.add_column("")
    for M_g in result.torques:
        grid.add_column(style.text(f"{M_g:g} N·m"), justify="right")
    for change in (*found.single, found.whole):
        grid.add_row(
            change.path or "all together", *(style.text(_change(change, k)) for k in range(len(result.torques)))
        )
    return grid


def _change(change: Change, torque: int) -> str:
    values = change.change_arcsec[:, torque]
    words = f"{np.median(values):+.2f}"
    return words if len(values) == 1 else f"{words} ({values.min():+.2f} to {values.max():+.2f})"


def _lines(result: DrivesComparison, details: bool) -> Iterator[tuple[str, str]]:
    """What else there is to say, a labelled line each."""
    if none := result.changes[0].none:
        yield "not alone", f"{_some(none)}: no drive that can be computed, or one that leaves more unknown"
    for letter, sheet in zip(letters(result), result.sheets, strict=True):
        yield f"{letter} not known", names(sheet.check.unknown)
        if sheet.advice.order == "none":
            yield f"{letter} mounting", what_to_do(sheet.advice)
        yield f"{letter} influence", ", ".join(each.group for each in sheet.check.influences[:3])
    yield "differs", "" if details else _some([field.path for field in result.differences])
    yield "same value", f"{_some(result.origins)}: from another kind of origin" if result.origins else ""
    yield "next", again("report", result.drives[-1], "-o", "report.html")
    yield "more", "" if details else "--details"
    yield "proof", proof(result.certificate, [cross for sheet in result.sheets for cross in sheet.cross_checks])


def _some(paths: Sequence[str]) -> str:
    """Some of the paths, and how many more there are."""
    return ", ".join(paths[:SHOWN]) + (f" and {len(paths) - SHOWN} more" if len(paths) > SHOWN else "")


def _fields(result: DrivesComparison, style: Style) -> Table:
    grid = table(style, "what differs")
    grid.add_column("field")
    grid.add_column("unit")
    for letter in letters(result):
        grid.add_column(letter, justify="right", overflow="fold")
        grid.add_column(f"origin of {letter}")
    for field in result.differences:
        cells = [cell for row in field.there for cell in (_value(row), row.kind)]
        grid.add_row(field.path, style.text(field.unit), *map(style.text, cells))
    return grid


def _value(row: ResolvedField) -> str:
    return NOT_KNOWN if row.kind == NOT_KNOWN else value_text(row.value)


def to_json(result: DrivesComparison, seed: int) -> Json:
    """The comparison as a JSON object."""
    return {
        **envelope("compare-presets", result.drives[0], warnings=warnings(result)),
        "presets": [_drive(sheet) for sheet in result.sheets],
        "M_g_Nm": list(result.torques),
        "differences": [
            {
                "field": field.path,
                "unit": field.unit,
                "values": [{"value": row.value, "origin": row.kind, "reference": row.ref} for row in field.there],
            }
            for field in result.differences
        ],
        "same_value_other_origin": list(result.origins),
        "changes": [_changes_object(result, k) for k in range(1, len(result.sheets))],
        "certificate": certificate_object(result.certificate, [c for s in result.sheets for c in s.cross_checks]),
        "seed": seed,
    }


def _drive(sheet: DriveSheet) -> Json:
    check, advice, curve = sheet.check, sheet.advice, sheet.stiffness
    target = advice.choice.target if advice.order != "none" else None
    return {
        **envelope("compare-presets", sheet.drive)["preset"],
        "file": sheet.drive.origin.file,
        "operating_points": [as_object((*POINT, *BELIEF), point) for point in check.points],
        "order": advice.order,
        "best": target and {
            "hole": target.hole, "rotation_deg": target.rotation_deg, "F_ior_arcsec": list(target.F_ior_arcsec)
        },
        **as_object(WHOLE, curve),
        "stiffness": [
            {"from_Nm": s.start, "to_Nm": s.end, "stiffness_Nm_per_rad": s.stiffness} for s in curve.positive
        ],
        "unknown": unknown_objects(check.unknown),
        "influence": influence_objects(check.influences),
    }  # fmt: skip


def _changes_object(result: DrivesComparison, other: int) -> Json:
    found: Changes = result.changes[other - 1]
    senses = [result.sense(other, k) for k in range(len(result.torques))]
    return {
        "from": 0,
        "to": other,
        "pairs": len(found.whole.change_arcsec),
        "F_ior_is": [NOT_KNOWN if sense is None else SENSE[sense] for sense in senses],
        "together": _change_object(found.whole),
        "single": [{"field": change.path, **_change_object(change)} for change in found.single],
        "not_alone": list(found.none),
    }


def _change_object(change: Change) -> Json:
    return {
        "change_arcsec": change.median_arcsec.tolist(),
        "least_arcsec": change.change_arcsec.min(axis=0).tolist(),
        "greatest_arcsec": change.change_arcsec.max(axis=0).tolist(),
    }


def figures(result: DrivesComparison) -> Figures:
    """One row per drive and torque."""
    shown = (*POINT, *BELIEF)
    rows = [
        [letter, sheet.drive.name, *(q.value(point) for q in shown)]
        for letter, sheet in zip(letters(result), result.sheets, strict=True)
        for point in sheet.check.points
    ]
    return ["drive", "preset", *(q.key for q in shown)], rows
