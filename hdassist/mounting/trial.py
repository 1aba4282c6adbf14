"""Trials: F'_ior measured with the fixed wheel in a few positions of its seat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hdassist.errors import UsageError
from hdassist.mounting.positions import hole_of
from hdassist.numerals import number_of
from hdassist.preset.yamltext import shown
from hdassist.readers.trace import LARGEST_ERROR

FARTHEST = 3600.0  # deg that a wheel can be meant to be turned by


@dataclass(frozen=True)
class Trial:
    """F'_ior measured [arcsec] with the fixed wheel turned by rotation_deg from where it stood at 0."""

    rotation_deg: float
    F_ior_arcsec: float


@dataclass(frozen=True)
class Tried:
    """Trials that an advice rests on, and their torque [N*m]."""

    M_g: float
    trials: tuple[Trial, ...]


def read_trial(text: str, holes: int, allowed: Sequence[int] | str = "all") -> Trial:
    """Read 120=17.3 (degrees) or h4=17.3 (holes of the seat, of which some are allowed). Raises UsageError for else."""
    where, equals, value = text.lower().partition("=")
    hint = "like 120=17.3 (degrees) or h4=17.3 (holes), then the measured F'_ior in arcsec, with a point"
    if not equals and ":" in text:  # as it was written before
        hint = text.replace(":", "=", 1)
    rotation, F_ior = number_of(where.removeprefix("h")), number_of(value)
    if not (0 < F_ior <= LARGEST_ERROR and abs(rotation) <= FARTHEST):
        raise UsageError(f"invalid trial {shown(text)!r}: expected HOLE=VALUE", hint)
    if where.startswith("h"):
        if not holes:
            raise UsageError(f"{text!r} names a hole of a seat that has none", "mounting.holes says how many")
        if rotation not in range(holes):
            raise UsageError(f"{text!r}: the seat's holes are h0 to h{holes - 1}", hint)
        rotation *= 360 / holes
    elif holes and hole_of(rotation, holes) is None:
        raise UsageError(
            f"{text!r}: {rotation:g} deg is no hole of the seat, whose holes are {360 / holes:g} deg apart",
            f"was hole {round(rotation) % holes} meant? h{round(rotation) % holes}={value}",
        )
    hole = hole_of(rotation, holes)
    if hole is not None and allowed != "all" and hole % holes not in allowed:
        raise UsageError(
            f"{text!r}: hole {hole % holes} is not one of mounting.allowed",
            "an advice never chooses it: give it as one more trial",
        )
    return Trial(360 * (hole % holes) / holes if hole is not None else rotation % 360, F_ior)
