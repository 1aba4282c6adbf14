"""Ratio and full cycle of a measured drive, and the share of the cycle that a trace has visited."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.errors import UsageError
from hdassist.model.kinematics import Kinematics
from hdassist.preset.fields import Drive

LEAST_RATIO, GREATEST_RATIO = 10.0, 1000.0
RATIO_ROUNDING = 1e-9
FULL_SHARE = 0.95  # share from which the cycle counts as visited


@dataclass(frozen=True)
class Gearing:
    """Cam turns per output turn (without sign), and cam turns of the full cycle."""

    ratio: float
    cycle: int

    @property
    def cycle_output(self) -> int:
        """Output turns of the full cycle: 1, or 2 where the flexspline has an odd number of teeth."""
        return round(self.cycle / self.ratio)


@dataclass(frozen=True)
class Coverage:
    """Turns of the cam that a record has visited, each place of the full cycle once, and their share of it, 0 to 1.

    An angle is visited between two readings that are near enough to follow the highest order.
    """

    cam_turns: float
    share: float


def gearing_of(drive: Drive | None, ratio: float | None) -> Gearing | None:
    """Gearing of a drive, or of a drive with two waves by its ratio; None where neither is known.

    Raises UsageError: both are given, or no ratio that a drive with two waves can have.
    """
    if drive is not None:
        if ratio is not None:
            raise UsageError("invalid --ratio: expected none with --drive, which has the ratio", "leave out --ratio")
        kinematics = Kinematics.of(drive)
        return Gearing(abs(kinematics.u), kinematics.cycle_cam_revolutions)
    if ratio is None:
        return None
    ratio = abs(ratio)
    doubled = round(2 * ratio) if ratio <= GREATEST_RATIO else 0
    if not LEAST_RATIO <= ratio <= GREATEST_RATIO or abs(2 * ratio - doubled) > RATIO_ROUNDING:
        hint = "half the number of teeth of the wheel that turns, such as 100 or 99.5"
        span = f"from {LEAST_RATIO:g} to {GREATEST_RATIO:g}"
        raise UsageError(f"invalid --ratio {ratio:g}: expected a multiple of 0.5 {span}", hint)
    return Gearing(ratio, doubled // 2 if doubled % 2 == 0 else doubled)
