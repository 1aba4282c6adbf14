"""Trials: F'_ior measured with the fixed wheel in a few positions of its seat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hdassist.analysis.mounting import FREE_STEP, hole_of
from hdassist.errors import UsageError


@dataclass(frozen=True)
class Trial:
    """F'_ior measured [arcsec] with the fixed wheel turned by rotation_deg from where it stood at 0."""

    rotation_deg: float
    F_ior_arcsec: float


@dataclass(frozen=True)
class Rig:
    """How trials are measured: at a torque [N*m], with noise of a value [arcsec] and an error of the seat [um].

    Both are standard deviations; reseat_um is that of the wheel's centre along any direction.
    """

    M_g: float
    noise_arcsec: float = 1.0
    reseat_um: float = 0.0

    def require_sound(self) -> None:
        """Raise UsageError unless the torque turns something and the standard deviations are such."""
        if not (np.isfinite(self.M_g) and self.M_g):
            raise UsageError(f"the torque of a trial must not be {self.M_g:g}", "--trial-torque 80")
        if not (0 < self.noise_arcsec < np.inf):
            raise UsageError(f"the noise of a trial must be above zero, not {self.noise_arcsec:g}", "--noise 1")
        if not (0 <= self.reseat_um < np.inf):
            raise UsageError(f"the error of the seat must not be {self.reseat_um:g}", "--reseat 10")


def trial_positions(holes: int, allowed: Sequence[int] | str) -> list[float]:
    """Positions that may be chosen [deg]: the usable holes, or 5 degree steps where the angle is free."""
    if not holes:
        return [FREE_STEP * k for k in range(round(360 / FREE_STEP))]
    return [360 * k / holes for k in range(holes) if allowed == "all" or k in allowed]


def read_trial(text: str, holes: int) -> Trial:
    """Read 120:17.3 (degrees) or h4:17.3 (holes). Raises UsageError for anything else."""
    where, _, value = text.lower().partition(":")
    hint = "like 120:17.3 (degrees) or h4:17.3 (holes), then the measured F'_ior in arcsec"
    try:
        F_ior = float(value)
        rotation = float(where.removeprefix("h"))
    except ValueError:
        raise UsageError(f"{text!r} is no trial", hint) from None
    if not (0 < F_ior < np.inf and np.isfinite(rotation)):
        raise UsageError(f"{text!r} is no trial", hint)
    if where.startswith("h"):
        if not holes:
            raise UsageError(f"{text!r} names a hole of a seat that has none", "mounting.holes says how many")
        if rotation not in range(holes):
            raise UsageError(f"{text!r}: the seat's holes are h0 to h{holes - 1}", hint)
        rotation *= 360 / holes
    elif holes and hole_of(rotation, holes) is None:
        near = round(rotation) % holes
        raise UsageError(
            f"{text!r}: {rotation:g} deg is no hole of the seat, whose holes are {360 / holes:g} deg apart",
            f"was hole {near} meant? h{near}:{value}",
        )
    return Trial(rotation % 360, F_ior)
