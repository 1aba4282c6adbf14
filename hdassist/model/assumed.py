"""What of a drive's stiffnesses, clearances and shapes is assumed, and between what bounds it may really lie."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.preset.fields import Drive, measures
from hdassist.preset.overrides import is_overridden


@dataclass(frozen=True)
class Assumption:
    """A field whose value is assumed, by path: the plausible range of it, in its unit, and why."""

    path: str
    low: float
    high: float
    reason: str


REFERENCE = 160.0  # mm: pitch diameter of the drive that the ranges below are of
# range of a field that a preset leaves to its default, the power of the pitch diameter that it grows with, and why
_LEFT_OUT = {
    "gears.h_a": (0.5, 0.7, 0, "tips of short involute teeth come free"),
    "gears.h_f": (1.25, 1.35, 0, "usual basic racks"),
    "gears.j_n": (0.0, 20.0, 1, "tooth thinning"),
    "flexspline.k_t": (1.0, 1.8, 0, "teeth stiffen the rim; no source found"),
    "bearing.g_b": (0.0, 20.0, 1, "bearing clearance"),
    "contact.c_t": (0.3e-5, 6e-5, -1, "the face width works near one edge only"),
    "contact.k_face": (6.8, 10.0, 0, "of a tooth pair, by width"),
    "contact.c_ball": (1 / 80_000, 1 / 35_000, -1, "ISO/TS 16281 ball, tangent at 100-1000 N"),
    "operation.dT": (-5.0, 15.0, 0, "cam and flexspline of a running drive are its warm parts; range by judgement"),
}


def assumptions(drive: Drive) -> tuple[Assumption, ...]:
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
            found.append(Assumption(path, *source.range, source.ref))
        elif source is None and name not in getattr(drive, section).model_fields_set and path in _LEFT_OUT:
            low, high, power, reason = _LEFT_OUT[path]
            scale = (drive.gears.m * drive.gears.z_g / REFERENCE) ** power
            bounds = sorted((low * scale, high * scale, value))  # the value itself may be
            found.append(Assumption(path, bounds[0], bounds[-1], reason))
    return tuple(a for a in found if a.low < a.high and drive.allows(a.path, a.low) and drive.allows(a.path, a.high))
