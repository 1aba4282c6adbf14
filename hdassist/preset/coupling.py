"""The support of the cam by the way its wave generator sits on the shaft, where nobody gives its stiffness."""

from __future__ import annotations

from math import pi

from hdassist.preset.fields import Drive, Source
from hdassist.preset.knowledge import REFERENCE

PATH = "supports.C_3"
FIELDS = ("cam.coupling", "cam.shaft_d", "cam.overhang")
# stiffness and its plausible range [N/mm] at the reference diameter, with which they grow, and why
SUPPORTS = {
    "unknown": (1e4, 1e3, 1e5, "the middle of a range from a compliant to a solid hub"),
    "solid": (4.5e4, 2e4, 1e5, "a solid hub on a stiff shaft; by judgement"),
    # the cam's 8 N*m at 15 mm press the slides by 530 N: friction of 0.08 of that over an offset of 80 um is 500 N/mm
    "oldham": (0.0, 0.0, 500.0, "self-aligning; what friction of its slides adds is a guess"),
}
SHAFT_BEARING = (
    5e3,
    2e3,
    1e4,
)  # N/mm for each mm of its bore: radial stiffness of a shaft's bearing, and its range; a guess


def with_cam_support(drive: Drive) -> Drive:
    """The drive with supports.C_3 as its coupling has it: assumed, within a range; None where a size is missing."""
    found, source = _support(drive), {path: each for path, each in drive.source.items() if path != PATH}
    supports = drive.supports.model_copy(update={"C_3": found[0] if found else None})
    if found:
        why = f"cam.coupling: {drive.cam.coupling}; {found[3]}"
        source[PATH] = Source(kind="assumed", range=found[1:3], ref=why)
    others = tuple({path: value for path, value in each.items() if path != PATH} for each in drive.alternatives)
    return drive.model_copy(update={"supports": supports, "source": source, "alternatives": others})


def _support(drive: Drive) -> tuple[float, float, float, str] | None:
    """Stiffness [N/mm] of the cam's support, its range, and why."""
    cam, why = drive.cam, "3 E I/L^3 of its shaft in series with a bearing, whose stiffness is a guess"
    if cam.coupling != "overhung":
        size = drive.gears.m * drive.gears.z_g / REFERENCE
        *numbers, why = SUPPORTS[cam.coupling]
        value, low, high = (float(f"{number * size:.4g}") for number in numbers)
    elif cam.shaft_d is None or cam.overhang is None:
        return None
    else:  # equation (2a)
        shaft = 3 * drive.material.E * pi * cam.shaft_d**4 / 64 / cam.overhang**3
        value, low, high = (float(f"{1 / (1 / shaft + 1 / (k * cam.shaft_d)):.4g}") for k in SHAFT_BEARING)
    return value, low, high, why
