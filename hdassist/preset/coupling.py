"""The stiffness of the cam's support from the way the wave generator sits on its shaft, where it is not given."""

from math import pi

from hdassist.preset.fields import Drive, Source
from hdassist.preset.knowledge import CAM_SUPPORTS, REFERENCE, SHAFT_BEARING

SUPPORT_FIELD = "supports.C_3"
COUPLING_FIELDS = ("cam.coupling", "cam.shaft_d", "cam.overhang")


def with_cam_support(drive: Drive) -> Drive:
    """The drive with supports.C_3 as its coupling has it: assumed, within a range; None where a size is missing."""
    support = _support(drive)
    source = {path: entry for path, entry in drive.source.items() if path != SUPPORT_FIELD}
    supports = drive.supports.model_copy(update={"C_3": support[0] if support else None})
    if support:
        reason = f"cam.coupling: {drive.cam.coupling}; {support[3]}"
        source[SUPPORT_FIELD] = Source(kind="assumed", range=support[1:3], ref=reason)
    return drive.model_copy(update={"supports": supports, "source": source})


def _support(drive: Drive) -> tuple[float, float, float, str] | None:
    """Stiffness [N/mm] of the cam's support, its range, and why."""
    cam, why = drive.cam, "3 E I/L^3 of its shaft in series with a bearing, whose stiffness is a guess"
    if cam.coupling != "overhung":
        size = drive.gears.pitch_diameter / REFERENCE
        *numbers, why = CAM_SUPPORTS[cam.coupling]
        value, low, high = (float(f"{number * size:.4g}") for number in numbers)
    elif cam.shaft_d is None or cam.overhang is None:
        return None
    else:  # equation (2a)
        shaft = 3 * drive.material.E * pi * cam.shaft_d**4 / 64 / cam.overhang**3
        value, low, high = (float(f"{1 / (1 / shaft + 1 / (k * cam.shaft_d)):.4g}") for k in SHAFT_BEARING)
    return value, low, high, why
