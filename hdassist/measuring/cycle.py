"""How cam and output of a measured drive hang together: ratio, and how long its full cycle is."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

from hdassist.errors import UsageError
from hdassist.model.kinematics import Kinematics
from hdassist.preset.fields import Drive

WHOLE = 1e-9
LEAST, MOST = 10.0, 1000.0


@dataclass(frozen=True)
class Gearing:
    """Cam turns per output turn (without sign), and cam turns of the full cycle."""

    ratio: float
    cycle: int

    @property
    def cycle_output(self) -> int:
        """Output turns of the full cycle: 1, or 2 where the flexspline has an odd number of teeth."""
        return round(self.cycle / self.ratio)


def gearing_of(drive: Drive | None, ratio: float | None) -> Gearing | None:
    """Gearing of a drive, or of a drive with two waves by its ratio; None where neither is known.

    Raises UsageError: both are given, or no ratio that a drive with two waves can have.
    """
    if drive is not None:
        if ratio is not None:
            raise UsageError("--drive knows the ratio", "leave out --ratio")
        kinematics = Kinematics.of(drive)
        return Gearing(abs(kinematics.u), kinematics.cycle_cam_revolutions)
    if ratio is None:
        return None
    ratio = abs(ratio)
    doubled = round(2 * ratio) if isfinite(ratio) else 0
    if not LEAST <= ratio <= MOST or abs(2 * ratio - doubled) > WHOLE:
        hint = "half the number of teeth of the wheel that turns, such as 100 or 99.5"
        raise UsageError(f"--ratio must be a multiple of 0.5 from {LEAST:g} to {MOST:g}, not {ratio:g}", hint)
    return Gearing(ratio, doubled // 2 if doubled % 2 == 0 else doubled)
