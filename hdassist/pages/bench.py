"""Approached positions or torque loops as a report: the figures that makers and buyers state beside F'_ior."""

from __future__ import annotations

from hdassist.acceptance.checks import CHECKS
from hdassist.measuring.bench import (
    LoopRecord,
    PlaceLoop,
    PositionRecord,
    StatedQuantity,
    loop_quantities,
    place_loops,
    position_quantities,
)
from hdassist.measuring.uncertainty import COVERAGE_FACTOR
from hdassist.pages.measure import ends_text
from hdassist.preset.fields import Drive
from hdassist.report import Facts, Lines, Quantity, Report, Table, as_object
from hdassist.terminal.words import again
from hdassist.textfile import STDIN

_CHECKS = {check.field: check for check in CHECKS}


def _interval(found: StatedQuantity) -> list[float] | None:
    reach = _expanded(found)
    return None if found.uncertainty_arcsec is None else [max(0.0, found.arcsec - reach), found.arcsec + reach]


_QUANTITIES: tuple[Quantity[StatedQuantity], ...] = (
    Quantity("name", "quantity", "", ""),
    Quantity("value_arcsec", "value", "″", ".2f", "arcsec"),
    Quantity("standard_uncertainty_arcsec", "u", "″", ".2f", "uncertainty_arcsec"),
    Quantity("interval_arcsec", "95 %", "″", ends_text, _interval),
    Quantity("of", "of", "", ""),
)
_ON_PAGE = (Quantity("", "", "", "", lambda q: _CHECKS[q.name].words), *_QUANTITIES[1:2], *_QUANTITIES[3:])
_PLACES: tuple[Quantity[PlaceLoop], ...] = (
    Quantity("place", "place", "", "g"),
    Quantity("hysteresis_loss_arcsec", "hysteresis loss", "″", ".2f", lambda p: p.hysteresis[0]),
    Quantity("hysteresis_loss_uncertainty_arcsec", "u", "″", ".2f", lambda p: p.hysteresis[1]),
    Quantity("lost_motion_arcsec", "lost motion", "″", ".2f", lambda p: p.lost_motion[0]),
    Quantity("lost_motion_uncertainty_arcsec", "u", "″", ".2f", lambda p: p.lost_motion[1]),
)


def bench_report(record: PositionRecord | LoopRecord, drive: Drive | None, seed: int) -> Report:
    """Quantities of approached positions, or of torque loops; drive, None where unknown, for the rated torque."""
    table = record.table
    places: tuple[PlaceLoop, ...] = ()
    if isinstance(record, PositionRecord):
        found = position_quantities(record, seed=seed)
    else:
        greatest = float(abs(record.torque_Nm).max())
        rated, by = drive.operation.rated if drive else None, "the preset"
        if rated is None:
            hint = f"{drive.name} has no operation.rated" if drive else "--drive PRESET for its own"
            rated, by = greatest, f"the greatest of the loop; {hint}"
        table.notes.append(f"rated torque {rated:g} N·m: {by}")
        places = place_loops(record, rated)
        found = loop_quantities(places)
    first, unsure = found[0], [each for each in found if each.uncertainty_arcsec is not None]
    once = "one approach a position: no uncertainty, and scatter widens the range by an unknown part"
    words = [word for q in unsure for word in ("--value", f"{q.name}={q.arcsec:.3g}±{_expanded(q):.2g}")]
    unlimited = [q.name for q in unsure if drive is None or getattr(drive.acceptance, q.name) is None]
    words += [word for name in unlimited for word in ("--limit", f"{name}=LIMIT")]
    return Report(
        command="measure",
        drive=drive,
        head=f"{table.file}, {len(table.lines)} rows" + (f", {drive.name}" if drive else ""),
        verdict=f"{_CHECKS[first.name].words} {first.arcsec:.2f}″",
        blocks=(
            Table.by_row("", _ON_PAGE, found, words=(0, 3)),
            *(Table.by_row("places", _PLACES, each, words=()) for each in [places] * (len(places) > 1)),
            Facts.of([
                ("read as", "; ".join(table.notes)),
                ("next", again("accept", drive, *words) if words and table.file != STDIN else ""),
            ]),
        ),
        details=(Lines("what they are", tuple(f"{_CHECKS[q.name].words}: {_CHECKS[q.name].tests}" for q in found)),),
        values={
            "file": {"name": table.file, "sha256": table.sha256, "rows": len(table.lines)},
            "notes": list(table.notes),
            "quantities": [as_object(_QUANTITIES, q) for q in found],
            "places": [as_object(_PLACES, place) for place in places],
            "seed": seed,
        },
        line=", ".join(
            f"{q.name} {q.arcsec:.2f}{f' +- {_expanded(q):.2f}' if q in unsure else ''}″" for q in found
        ),
        about=table.file,
        warnings=(once,) * (len(unsure) < len(found)),
    )  # fmt: skip


def _expanded(found: StatedQuantity) -> float:
    return COVERAGE_FACTOR * (found.uncertainty_arcsec or 0.0)
