"""Figures of a drive's catalogue beside those of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hdassist.error.stiffness import Segment, Stiffness
from hdassist.preset.fields import Catalogue

if TYPE_CHECKING:  # the page of the stiffness needs no samples
    from hdassist.design.check import OperatingPoint

STIFFNESSES = ("K_1", "K_2", "K_3")
CATALOGUE_UNITS = {**dict.fromkeys(STIFFNESSES, "Nm_per_rad"), "T_1": "Nm", "T_2": "Nm", "lost_motion": "arcsec"}


@dataclass(frozen=True)
class SegmentBeside:
    """A segment of the model's curve beside the stiffness of the catalogue [N*m/rad], None where it gives none.

    off_percent: how far the model is off; None without a catalogue, or where its segments end at other torques.
    """

    name: str
    segment: Segment
    catalogue: float | None
    off_percent: float | None


def segments_beside(catalogue: Catalogue, side: Sequence[Segment]) -> list[SegmentBeside]:
    """The segments of one side, each beside the catalogue's."""
    comparable = not ends_elsewhere(catalogue, side)
    rows = [(name, segment, getattr(catalogue, name)) for name, segment in zip(STIFFNESSES, side, strict=False)]
    return [SegmentBeside(*row, off(row[1].stiffness, row[2]) if comparable else None) for row in rows]


def ends_elsewhere(catalogue: Catalogue, side: Sequence[Segment]) -> bool:
    """Whether segments end at other torques than the catalogue's: chords between them are other stiffnesses."""
    given = zip(side, (catalogue.T_1, catalogue.T_2), strict=False)
    return any(T is not None and abs(segment.end) != T for segment, T in given)


def off(ours: float, theirs: float | None) -> float | None:
    """How far a value is off that of a catalogue, in per cent of the catalogue's."""
    return None if theirs is None else 100 * (ours / theirs - 1)


def stiffness_object(catalogue: Catalogue, result: Stiffness) -> dict[str, Any] | None:
    """Figures of a catalogue and how far the model is off, for JSON; None where it gives none."""
    given = {f"{name}_{unit}": getattr(catalogue, name) for name, unit in CATALOGUE_UNITS.items()}
    percents = dict.fromkeys(STIFFNESSES) | {
        each.name: each.off_percent for each in segments_beside(catalogue, result.positive)
    }
    percents["lost_motion"] = off(result.lost_motion_arcsec, catalogue.lost_motion)
    return {**given, "off_percent": percents} if any(given.values()) else None


def accuracy_words(accuracy: float | None, points: Sequence[OperatingPoint]) -> str:
    """F'_ior at the least load beside an accuracy [arcsec], measured without any; empty where none is given."""
    if accuracy is None:
        return ""
    point = min(points, key=lambda each: abs(each.M_g))
    compared = " to ".join(dict.fromkeys(f"{100 * end / accuracy:.0f}" for end in point.range_arcsec or ()))
    words = f"F'_ior at {point.M_g:g} N·m is {compared} % of it" if compared else "F'_ior is not known"
    return f"accuracy {accuracy:g}″ (no load); {words}"
