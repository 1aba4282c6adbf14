"""Samples of a belief, the fields that decide an answer and the next measurement, in words."""

from collections.abc import Sequence

from hdassist.belief.influence import Influence
from hdassist.belief.measure import MeasurementGain
from hdassist.belief.samples import Samples
from hdassist.belief.statistics import Probability
from hdassist.preset.fields import field_table
from hdassist.preset.kinds import unit_of
from hdassist.verdict import Verdict, is_settled, verdict_by_probability

REPORTED = 2  # influences and measurements on a short page
MORE_DRAWS = 4  # times as many samples, which halve the interval of a probability
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
        there = f"hole {round(float(rotation or 0) * holes / 360)}" if holes else f"turned by {rotation}°"
        return f"F'_ior at {M_g} N·m" + (f" now and {there}" if rotation else "")
    if path not in field_table():
        return f"{path.removeprefix('stiffness.')} (hdassist stiffness)"
    return f"{field_table()[path].description} ({path})"


def field_unit(path: str) -> str:
    """The unit of a field."""
    return unit_of(field_table()[path])


def influence_words(found: Sequence[Influence], result: str = "ln F'_ior") -> str:
    """The largest shares of the variance of a result: the first field in words, the second by its path."""
    words = [f"{named(each.group)}: {100 * each.share:.0f} % of the variance of {result}" for each in found[:1]]
    return "; ".join([*words, *(f"{each.group} {100 * each.share:.0f} %" for each in found[1:REPORTED])])


def measure_words(found: Sequence[MeasurementGain], held: bool, holes: int = 0) -> str:
    """The best measurements with the gain expected of each; held, whether there is a limit; holes of the seat."""
    words: list[str] = []
    turned = [each for each in found if "+" in each.measured][1:]  # one of them is enough
    for each in [each for each in found if each not in turned][:REPORTED]:
        gain = f"{100 * each.gain:.0f} % " + ("more sure" if held else "less spread")
        field = each.measured in HOW and words  # the first in words, others by their path
        how = f", {HOW[each.measured]}" if each.measured in HOW else ""
        words.append(f"{each.measured if field else named(each.measured, holes)}{how}: {gain}")
    return "; ".join(words)


def more_draws(samples: Samples) -> str:
    """The remedy for a verdict that is left open by its Monte Carlo interval alone."""
    return f"no measurement, more samples settle it: --draws {draws_to_settle(samples)}"


def draws_to_settle(samples: Samples) -> int:
    """Effective samples that halve the interval of a probability."""
    return MORE_DRAWS * round(samples.effective)


def settling_words(measured: str, found: Sequence[Probability | None], needed: float, samples: Samples | None) -> str:
    """Measurements that settle verdicts on probabilities, in words; more samples where chance alone leaves all open."""
    known = [each for each in found if each]
    by_value = {verdict_by_probability(each.value, each.value, needed) for each in known}
    if samples is None or Verdict.INCONCLUSIVE in by_value:
        return measured
    return measured if all(is_settled(each.low, each.high, needed) for each in known) else more_draws(samples)


def samples_words(samples: Samples) -> str:
    """How many samples there are, and why others are not."""
    refused = sum(samples.refused.values())
    words = f"{samples.effective:.0f} effective of {samples.draws} drawn"
    if samples.of_ranges.draws < samples.draws:
        words += f", ranges and influence by the first {samples.of_ranges.draws}"
    return words + (f"; {refused} are no drive ({next(iter(samples.refused))})" if refused else "")
