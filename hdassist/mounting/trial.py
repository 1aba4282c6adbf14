"""Trials: F'_ior measured with the fixed wheel in a few positions of its seat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hdassist.errors import UsageError
from hdassist.mounting.positions import hole_of
from hdassist.numerals import number_of
from hdassist.preset.measured import position_fault, turn_of
from hdassist.preset.yamltext import shown
from hdassist.readers.trace import LARGEST_ERROR


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
    """Read 120:17.3 (degrees) or h4:17.3 (holes of the seat, of which some are allowed). Raises UsageError for else."""
    where, _, value = text.lower().partition(":")
    hint = "like 120:17.3 (degrees) or h4:17.3 (holes), then the measured F'_ior in arcsec, with a point"
    rotation, F_ior = turn_of(where, holes), number_of(value)
    if not (0 < F_ior <= LARGEST_ERROR and rotation == rotation):
        raise UsageError(f"{shown(text)!r} is no trial", hint)
    if fault := position_fault(where, holes):
        raise UsageError(f"{text!r}: {fault[0]}", fault[1] or hint)
    hole = hole_of(rotation, holes)
    if hole is not None and allowed != "all" and hole % holes not in allowed:
        raise UsageError(
            f"{text!r}: hole {hole % holes} is not one of mounting.allowed",
            "an advice never chooses it: give it as one more trial",
        )
    return Trial(360 * (hole % holes) / holes if hole is not None else rotation % 360, F_ior)
