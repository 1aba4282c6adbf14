"""What the answer hangs on and what to measure next, in words and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hdassist.belief.influence import Influence
from hdassist.belief.measure import MeasurementGain
from hdassist.preset.fields import field_table

REPORTED = 3  # influences and measurements on a short page
HOW = {
    "cam.W_0": "on a drawing, or the axes of the cam with a micrometre",
    "supports.C_1": "push the rigid wheel in its housing",
    "supports.C_2": "push the flexspline sideways",
    "supports.C_3": "push the cam sideways",
    "tolerances.F_i1": "run-out of the flexspline's teeth and where it is greatest",
    "tolerances.F_i2": "run-out of the rigid wheel's teeth and where it is greatest",
    "bearing.g_b": "radial play of the bearing on the cam",
    "gears.j_n": "tooth thickness over pins",
    "stiffness.lost_motion": "lost motion at 4 % of the rated torque",
}


def named(path: str) -> str:
    """A field, figure or error in words with its path in brackets."""
    if path.startswith("F_ior@"):
        return f"F'_ior at {path.removeprefix('F_ior@')} N·m"
    if path not in field_table():
        return f"{path.removeprefix('stiffness.')} (hdassist stiffness)"
    return f"{field_table()[path].description} ({path})"


def influence_words(found: Sequence[Influence]) -> str:
    """The largest shares of the variance of ln F'_ior, and what the rest is."""
    words = [f"{named(each.group)} {100 * each.share:.0f} %" for each in found[:REPORTED]]
    rest = 1 - sum(each.share for each in found[:REPORTED])
    return ", ".join(words) + f", others and unexplained {100 * rest:.0f} %, of the variance of ln F'_ior"


def measure_words(found: Sequence[MeasurementGain], held: bool) -> str:
    """The best measurements with what each is expected to gain; held, whether there is a limit."""
    words = []
    for each in found[:REPORTED]:
        gain = f"{100 * each.gain:+.0f} %" if held else f"{-100 * each.gain:.0f} % spread"
        how = f": {HOW[each.measured]}" if each.measured in HOW else ""
        words.append(f"{named(each.measured)}{how} ({gain})")
    return "; ".join(words) + (", of a right verdict" if words and held else "")


def influence_objects(found: Sequence[Influence]) -> list[dict[str, Any]]:
    """Influences for JSON, the largest first."""
    return [{"field": each.group, "share": each.share} for each in found]


def measure_objects(found: Sequence[MeasurementGain]) -> list[dict[str, Any]]:
    """Measurements for JSON, the largest gain first."""
    return [{"what": each.measured, "gain": each.gain} for each in found]
