"""Samples of a belief, which fields an answer comes from and what to measure next, in words and as JSON."""

from __future__ import annotations

from collections.abc import Sequence

from hdassist.belief.influence import Influence
from hdassist.belief.measure import MeasurementGain
from hdassist.belief.samples import Samples
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


def named(path: str, holes: int = 0) -> str:
    """A field, figure or error in words with its path in brackets; holes of the seat, 0 for a free angle."""
    if path.startswith("F_ior@"):
        M_g, _, rotation = path.removeprefix("F_ior@").partition("+")
        there = f"hole {round(float(rotation or 0) * holes / 360)}" if holes else f"turned by {rotation} deg"
        return f"F'_ior at {M_g} N·m" + (f" now and {there}" if rotation else "")
    if path not in field_table():
        return f"{path.removeprefix('stiffness.')} (hdassist stiffness)"
    return f"{field_table()[path].description} ({path})"


def influence_words(found: Sequence[Influence], result: str = "ln F'_ior") -> str:
    """The largest shares of the variance of a result, and what the rest is."""
    words = [f"{named(each.group)} {100 * each.share:.0f} %" for each in found[:REPORTED]]
    rest = 1 - sum(each.share for each in found[:REPORTED])
    return ", ".join(words) + f", others and unexplained {100 * rest:.0f} %, of the variance of {result}"


def measure_words(found: Sequence[MeasurementGain], held: bool, holes: int = 0) -> str:
    """The best measurements with what each is expected to gain; held, whether there is a limit; holes of the seat."""
    words = []
    turned = [each for each in found if "+" in each.measured][1:]  # one of them is enough
    for each in [each for each in found if each not in turned][:REPORTED]:
        gain = f"{100 * each.gain:+.0f} %" if held else f"{-100 * each.gain:.0f} % spread"
        how = f": {HOW[each.measured]}" if each.measured in HOW else ""
        words.append(f"{named(each.measured, holes)}{how} ({gain})")
    return "; ".join(words) + (", of a right verdict" if words and held else "")


def samples_words(samples: Samples) -> str:
    """How many samples there are, and why others are not."""
    refused = sum(samples.refused.values())
    words = f"{samples.effective:.0f} effective of {samples.draws} drawn"
    return words + (f"; {refused} are no drive ({next(iter(samples.refused))})" if refused else "")
