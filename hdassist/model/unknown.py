"""What may lie elsewhere than a preset has it: assumed stiffnesses, clearances and shapes, and deviations not given.

Assumed ones have the bounds of their reason. A size that is not given may be anything up to the bound of its part; a
direction that is not given, any direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from hdassist.model.deviations import fixed_part, standing_offset
from hdassist.preset.fields import COMPOSITES, DEVIATIONS, Deviation, Drive, is_overridden, measures
from hdassist.preset.knowledge import (
    CENTRE_OFFSET,
    COARSEST_CLASS,
    HIGHER_ORDERS,
    LAWS,
    SECOND_ORDER,
    STANDING_OFFSET,
    TURNING_OFFSET,
    F_p,
    f_p,
)


def assumptions(drive: Drive) -> tuple[Unknown, ...]:
    """Fields of a drive that are assumed, or left to a default, and have a plausible range.

    A field that the preset's `source` calls assumed has the range that stands there.
    """
    found = []
    for path in measures():
        source, value = drive.source.get(path), drive.value(path)
        section, name = path.split(".")
        if value is None or path == drive.unused_tooth_field or is_overridden(path, drive.origin.overrides):
            continue  # not known, without effect, or wanted so
        if source is not None and source.kind == "assumed" and source.range:
            found.append(Unknown(path, *source.range, source.ref))
        elif source is None and name not in getattr(drive, section).model_fields_set and path in LAWS:
            law, g = LAWS[path], drive.gears
            if law.assumed and (bounds := law.range_at(g.pitch_diameter, g.m, value)):
                found.append(Unknown(path, *bounds, law.why))
    return tuple(a for a in found if a.low < a.high and drive.allows(a.path, a.low) and drive.allows(a.path, a.high))


#


@dataclass(frozen=True)
class Unknown:
    """A field that is assumed or not given, by path: the bounds of its true value, in the field's unit, and why."""

    path: str
    low: float
    high: float
    reason: str


def unknowns(drive: Drive) -> tuple[Unknown, ...]:
    """Deviations of a drive that are not known, and matter: a direction without a size does not."""
    found = dict[str, Unknown]()  # by path: all orders of a wheel's pitch share their size
    for each in DEVIATIONS:
        high, reason = _largest(drive, each)
        if high and drive.value(each.size) is None:
            found[each.size] = Unknown(each.size, 0.0, high, reason)
        if high and drive.value(each.direction) is None:
            found[each.direction] = Unknown(each.direction, 0.0, 360.0 / each.order, "any direction")
    return tuple(found.values())


def unknown_turn(drive: Drive) -> tuple[str, ...]:
    """Directions that decide how the fixed wheel's deviations lie to those that stand still with its seat, if unknown.

    Where all of the one side are, or all of the other, any hole is as good as any other; else none is returned.
    """
    sides = [[each.direction for each in side] for side in reversed(_sides(drive))]
    open_ = [path for side in sides if all(drive.value(path) is None for path in side) for path in side]
    return tuple(open_)


def no_hole_better(drive: Drive) -> Literal["", "floating", "standing", "turning"]:
    """Why the fixed wheel of a drive is as good in any hole: its cam floats, or no deviation stands to turn against.

    floating: offsets of the cam are not felt; standing: no part that stands still with the seat deviates; turning: the
    fixed wheel has no deviation. Empty where one hole may be better than another.
    """
    standing, turning = _sides(drive)
    if standing and turning:
        return ""
    if not turning:
        return "turning"
    return "standing" if drive.value(standing_offset(drive)[0]) == 0 else "floating"


def _sides(drive: Drive) -> tuple[list[Deviation], list[Deviation]]:
    """Deviations, known or not, of parts that stand still with the seat of the fixed wheel, and of that wheel.

    Offsets of a cam that floats (C_3 = 0) are not felt, and not among them.
    """
    floats = not drive.number("supports.C_3")
    sides: tuple[list[Deviation], list[Deviation]] = ([], [])
    for each in DEVIATIONS:
        if each.part == fixed_part(drive) and _largest(drive, each)[0] and not (floats and each.kind == "cam"):
            sides[not each.stays_with_seat].append(each)
    return sides


def unknown_notes(drive: Drive) -> tuple[str, ...]:
    """A warning where a deviation is not known and counts as 0; none where all are known."""
    open_ = unknowns(drive)
    return (f"not known, and computed as 0: {unknown_names(open_)}",) if open_ else ()


def unknown_names(fields: Sequence[Unknown], most: int = 4) -> str:
    """Paths of some fields, and how many more there are."""
    paths = ", ".join(u.path for u in fields[:most])
    return f"{paths} and {len(fields) - most} more" if len(fields) > most else paths


def _largest(drive: Drive, deviation: Deviation) -> tuple[float, str]:
    """Greatest size [um] that a deviation has, or is taken to have, and why."""
    if (given := drive.value(deviation.size)) is not None:
        return given, "given"
    if deviation.kind == "composite":
        grade = F_p(drive.gears.pitch_diameter, drive.gears.m, COARSEST_CLASS)
        return grade, f"F_p of class {COARSEST_CLASS}, ISO 1328-1:2013"
    if deviation.kind in ("cam", "centre"):
        share = STANDING_OFFSET if deviation.size == standing_offset(drive)[0] else TURNING_OFFSET
        share = CENTRE_OFFSET if deviation.kind == "centre" else share
        return share * drive.gears.pitch_diameter, f"assumed: {share:g} um for each mm of the pitch diameter"
    composite, share = COMPOSITES[deviation.part], SECOND_ORDER if deviation.order == 2 else HIGHER_ORDERS
    size, _ = _largest(drive, composite)
    if deviation.kind == "pitch":
        wheel = drive.gears.pitch_diameter, drive.gears.m, COARSEST_CLASS
        return size * f_p(*wheel) / F_p(*wheel), f"f_p of the class of ISO 1328-1:2013 that {composite.name} has as F_p"
    return share * size / 2, f"assumed: {share:.0%} of half of {composite.name}"
