"""Assumed stiffnesses, clearances and shapes of a drive, and the bounds between which they may really lie."""

from __future__ import annotations

from hdassist.model.unknown import Unknown
from hdassist.preset.fields import Drive, is_overridden, measures
from hdassist.preset.knowledge import LAWS


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
