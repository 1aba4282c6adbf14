"""Trials: F'_ior measured with the fixed wheel in a few positions of its seat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hdassist.errors import UsageError
from hdassist.mounting.positions import FREE_STEP, hole_of
from hdassist.preset.yamltext import shown
from hdassist.readers.trace import MOST

FARTHEST = 3600.0  # deg that a wheel can be meant to be turned by


@dataclass(frozen=True)
class Trial:
    """F'_ior measured [arcsec] with the fixed wheel turned by rotation_deg from where it stood at 0."""

    rotation_deg: float
    F_ior_arcsec: float


LEAST_NOISE, MOST_NOISE = 1e-6, 1e6  # arcsec; beyond them squares of it leave the range of numbers
MOST_RESEAT = 1e3  # um, as any eccentricity of a preset


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
        if not (0 < abs(self.M_g) <= 1e7):  # as operation.M_g
            raise UsageError(f"the torque of a trial must not be {self.M_g:g}", "--trial-torque 80")
        if not (self.noise_arcsec > 0):
            raise UsageError(f"the noise of a trial must be above zero, not {self.noise_arcsec:g}", "--noise 1")
        if not (LEAST_NOISE <= self.noise_arcsec <= MOST_NOISE):
            words = f"from {LEAST_NOISE:g} to {MOST_NOISE:g} arcsec, not {self.noise_arcsec:g}"
            raise UsageError(f"the noise of a trial must be {words}", "--noise 1")
        if not (0 <= self.reseat_um <= MOST_RESEAT):
            raise UsageError(f"the error of the seat must not be {self.reseat_um:g}", "--reseat 10")


def trial_positions(holes: int, allowed: Sequence[int] | str) -> list[float]:
    """Positions that may be chosen [deg]: the usable holes, or 5 degree steps where the angle is free."""
    if not holes:
        return [FREE_STEP * k for k in range(round(360 / FREE_STEP))]
    return [360 * k / holes for k in range(holes) if allowed == "all" or k in allowed]


def read_trial(text: str, holes: int) -> Trial:
    """Read 120:17.3 (degrees) or h4:17.3 (holes of the seat). Raises UsageError for anything else."""
    where, _, value = text.partition(":")
    where = where.lower()
    hint = "like 120:17.3 (degrees) or h4:17.3 (holes), then the measured F'_ior in arcsec"
    try:
        rotation, F_ior = float(where.removeprefix("h")), float(value)
    except ValueError:
        raise UsageError(f"{shown(text)!r} is no trial", hint) from None
    if not (0 < F_ior <= MOST and abs(rotation) <= FARTHEST):
        raise UsageError(f"{shown(text)!r} is no trial", hint)
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
