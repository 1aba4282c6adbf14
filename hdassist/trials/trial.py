"""Trials: F'_ior measured with the fixed wheel in a few positions of its seat."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.errors import UsageError
from hdassist.mounting.positions import hole_of
from hdassist.preset.yamltext import shown
from hdassist.readers.trace import MOST

FARTHEST = 3600.0  # deg that a wheel can be meant to be turned by


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
        torque, noise, reseat = self.M_g, self.noise_arcsec, self.reseat_um
        for words, value, sound, hint in (  # ends as in a preset; beyond those of noise, squares are no numbers
            ("torque of a trial", torque, 0 < abs(torque) <= 1e7, "more than 0 N*m: --trial-torque 80"),
            ("noise of a trial", noise, 1e-6 <= noise <= 1e6, "from 1e-6 to 1e6 arcsec: --noise 1"),
            ("error of the seat", reseat, 0 <= reseat <= 1e3, "from 0 to 1000 um: --reseat 10"),
        ):
            if not sound:
                raise UsageError(f"the {words} must not be {value:g}", hint)


def read_trial(text: str, holes: int) -> Trial:
    """Read 120:17.3 (degrees) or h4:17.3 (holes of the seat). Raises UsageError for anything else."""
    where, _, value = text.lower().partition(":")
    hint = "like 120:17.3 (degrees) or h4:17.3 (holes), then the measured F'_ior in arcsec"
    try:
        rotation, F_ior = float(where.removeprefix("h")), float(value)
    except ValueError:
        rotation = F_ior = 0.0
    if not (0 < F_ior <= MOST and abs(rotation) <= FARTHEST):
        raise UsageError(f"{shown(text)!r} is no trial", hint)
    if where.startswith("h"):
        if not holes:
            raise UsageError(f"{text!r} names a hole of a seat that has none", "mounting.holes says how many")
        if rotation not in range(holes):
            raise UsageError(f"{text!r}: the seat's holes are h0 to h{holes - 1}", hint)
        rotation *= 360 / holes
    elif holes and hole_of(rotation, holes) is None:
        raise UsageError(
            f"{text!r}: {rotation:g} deg is no hole of the seat, whose holes are {360 / holes:g} deg apart",
            f"was hole {round(rotation) % holes} meant? h{round(rotation) % holes}:{value}",
        )
    return Trial(rotation % 360, F_ior)
