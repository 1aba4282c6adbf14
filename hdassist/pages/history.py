"""How a measured drive changed, as a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import date

import numpy as np

from hdassist.json_parts import as_json
from hdassist.measuring.archive import ArchiveEntry, DriveHistory, histories
from hdassist.pages.measure import DIRECTION_NAMES
from hdassist.report import Curve, Facts, Quantity, Report, Table

ENTRY_COLUMNS: tuple[Quantity[ArchiveEntry], ...] = (
    Quantity("date", "date", "", ""),
    Quantity("hole", "hole", "", ""),
    Quantity("M_g_Nm", "torque", "", "g"),
    Quantity("direction", "cam angle", "", DIRECTION_NAMES.__getitem__),
    Quantity(
        "F_ior_arcsec",
        "F'_ior",
        "",
        "",
        lambda e: f"≥ {e.low_arcsec:.2f}" if e.F_ior_is_lower_bound else f"{e.F_ior_arcsec:.2f}",
    ),
    Quantity("interval", "95 %", "", "", lambda e: f"{e.low_arcsec:.2f} to {e.high_arcsec:.2f}"),
    Quantity("temperature_C", "at °C", "", "g"),
)


def history_report(serial: str, archive: str, entries: Sequence[ArchiveEntry]) -> Report:
    """How F'_ior of a drive changed, by its entries in an archive, and whether that is more than its uncertainty."""
    found = histories(entries)
    verdict = "no change beyond its uncertainty" if found else "nothing to compare"
    verdict = "changed by more than its uncertainty" if any(each.is_changed for each in found) else verdict
    objects = [as_json(each) for each in entries]
    return Report(
        command="measure-history",
        drive=None,
        head=f"{serial} in {archive}, measured {len(entries)} times",
        verdict=verdict,
        why=tuple(map(_sentence, found)),
        blocks=(
            Table.by_row("F'_ior in ″, torque in N·m", ENTRY_COLUMNS, entries, words=(0, 1, 3)),
            Facts.of(_facts(entries)),
            *(_curve(each) for each in sorted(found, key=lambda each: -len(each.entries))[:1]),
        ),
        values={"serial": serial, "archive": archive, "verdict": verdict, "entries": objects, "histories": found},
        csv=([*objects[0]], [[*(each | {"unstated": " ".join(each["unstated"])}).values()] for each in objects]),
        line=verdict,
    )


def _sentence(found: DriveHistory) -> str:
    """The change of a history in words."""
    values, (first, *_) = [each.F_ior_arcsec for each in found.entries], found.entries
    hole, torque = (quantity.text(first) for quantity in ENTRY_COLUMNS[1:3])
    where = f"hole {hole}, {torque} N·m, {DIRECTION_NAMES[first.direction]} cam angle"
    spread = f"unchanged drives spread so in {100 * found.probability:.2g} % of cases"
    return f"{where}: {min(values):.2f} to {max(values):.2f}″; {spread}"


def _facts(entries: Sequence[ArchiveEntry]) -> Iterator[tuple[str, str]]:
    """The parts left out of the comparison and of the uncertainty, a label and a text each."""
    parts = sum(each.F_ior_is_lower_bound for each in entries)
    yield "left out", f"{parts} of a part of the cycle: lower bounds" if parts else ""
    missing = dict.fromkeys(name for each in entries for name in each.unstated)
    yield "not in u", f"{', '.join(missing)}: a change may be theirs (--budget NAME=U)" if missing else ""


def _curve(found: DriveHistory) -> Curve:
    """F'_ior over the days since the first measurement, with intervals."""
    first, *_ = dates = [date.fromisoformat(each.date) for each in found.entries]
    days = np.array([(each - first).days for each in dates], dtype=float)
    ends = [(day, each.low_arcsec, each.high_arcsec) for day, each in zip(days, found.entries, strict=True)]
    y, label = np.array([each.F_ior_arcsec for each in found.entries]), "F'_ior, ″"
    return Curve(days, y, f"days since {first}", label, whiskers=tuple(ends), points=True, rows=6)
