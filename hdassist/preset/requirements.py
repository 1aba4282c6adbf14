"""Requirements on a new drive from the options of a command line."""

import re
from math import isfinite

from hdassist.errors import UsageError
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import choices_of, plain, range_of
from hdassist.preset.similarity import PITCH_DIAMETER, STIFFNESS, Requirements, SimilarValue
from hdassist.preset.units import read_number
from hdassist.preset.yamltext import InvalidValueError, near_miss, scalar_value, shown

# options of a measure: their fields and units
MEASURES = {
    "pitch_diameter": (PITCH_DIAMETER, "mm"), "torque": ("operation.rated", "N*m"),
    "lost_motion": ("catalogue.lost_motion", "arcsec"), "accuracy": ("catalogue.accuracy", "arcsec"),
}  # fmt: skip


def read_requirements(like: Drive, *, ratio: float | None = None, **given: str | None) -> Requirements:
    """Requirements on a drive that is to be like another one.

    Arguments, None where not given: ratio, of the drive built in as the other one; coupling of the cam, as cam.coupling
    has it; shaft, diameter and overhang [mm] of one that it is overhung on, like 14x30; pitch_diameter [mm] and torque
    [N*m]; teeth, like 160/162; of a catalogue three stiffnesses [N*m/rad], lost_motion and accuracy [arcsec]: texts,
    which may have a unit.
    Raises UsageError: an option that cannot be read, or two that contradict each other.
    """
    required: dict[str, SimilarValue] = {}
    for name, (path, unit) in MEASURES.items():
        if (text := given.get(name)) is not None:
            option = f"--{name.replace('_', '-')}"
            required[path] = SimilarValue(_measure(option, text, unit), "given", f"{option} {text}")
    if (teeth := given.get("teeth")) is not None:
        z_g = _teeth(teeth)
        required["gears.z_g"] = SimilarValue(z_g, "given", f"--teeth {z_g}/{z_g + 2}")
    if ratio is not None:
        z_g = _teeth_of_ratio(like, ratio)
        by_teeth = required.get("gears.z_g")
        if by_teeth and by_teeth.value != z_g:
            raise UsageError(
                f"{by_teeth.ref} contradicts --ratio {plain(ratio)}, which takes {z_g}/{z_g + 2}",
                "leave one of them out",
            )
        required["gears.z_g"] = SimilarValue(z_g, "given", f"--ratio {plain(ratio)}, two waves")
    if (stiffness := given.get("stiffness")) is not None:
        K = tuple(_measure("--stiffness", part, "N*m/rad") for part in stiffness.split(","))
        if len(K) != 3:
            raise UsageError(f"invalid --stiffness {shown(stiffness)}: expected three numbers", "like 3.1e4,5e4,5.7e4")
        ref = f"--stiffness {','.join(map(plain, K))}; not fitted, hdassist stiffness compares"
        required[STIFFNESS] = SimilarValue(K, "given", ref)
    return required | _coupling(given.get("coupling"), given.get("shaft"))


def _teeth_of_ratio(like: Drive, ratio: float) -> int:
    """Teeth of the flexspline that make a ratio, built in as another drive is."""
    if not (isfinite(ratio) and ratio > 0):
        raise UsageError(f"invalid --ratio {ratio:g}: expected a number above 0")
    z_g = 2 * ratio if like.mounting.fixed == "rigid" else 2 * ratio - 2
    if not float(z_g).is_integer() or not like.allows("gears.z_g", z_g):
        raise UsageError(
            f"a ratio of {plain(ratio)} needs {z_g:g} teeth on the flexspline",
            f"two waves: twice the ratio, a whole number of teeth from {range_of(field_table()['gears.z_g'])}",
        )
    return int(z_g)


def _coupling(coupling: str | None, shaft: str | None) -> dict[str, SimilarValue]:
    """Fields of the cam's coupling, by path."""
    if (coupling == "overhung") != (shaft is not None):
        raise UsageError("--coupling overhung and --shaft belong together", "like --coupling overhung --shaft 14x30")
    if coupling is None:
        return {}
    if coupling not in (words := choices_of(field_table()["cam.coupling"])):
        raise UsageError(
            f"invalid --coupling {shown(coupling)}: expected one of {', '.join(words)}", near_miss(coupling, words)
        )
    kind = "given" if coupling != "unknown" else "assumed"
    values = {"cam.coupling": SimilarValue(coupling, kind, f"--coupling {coupling}")}
    if shaft is not None:
        sizes = re.fullmatch(r"\s*([0-9.]+)\s*x\s*([0-9.]+)\s*(?:mm)?\s*", shaft)
        if sizes is None:
            raise UsageError(f"invalid --shaft {shown(shaft)}: expected DIAMETERxOVERHANG in mm", "like 14x30")
        for path, text in zip(("cam.shaft_d", "cam.overhang"), sizes.groups(), strict=True):
            values[path] = SimilarValue(_measure("--shaft", text, "mm"), "given", f"--shaft {shaft}")
    return values


def _teeth(text: str) -> int:
    match = re.fullmatch(r"\s*([0-9]{1,6})\s*(?:/\s*([0-9]{1,6})\s*)?", text)
    if match is None:
        raise UsageError(f"invalid --teeth {shown(text)!r}: expected two whole numbers", "like 160/162")
    z_g = int(match[1])
    if match[2] is not None and int(match[2]) != z_g + 2:
        raise UsageError(
            f"invalid --teeth {z_g}/{int(match[2])}: expected z_b - z_g = 2 (two waves)",
            f"{z_g}/{z_g + 2}, the flexspline first",
        )
    return z_g


def option_value(option: str, text: str, unit: str) -> float:
    """Value of an option in a unit, from a text like "26" or "26 N·m". Raises UsageError: no such text."""
    try:
        return float(read_number(scalar_value(text.strip()), unit))
    except InvalidValueError as fault:
        raise UsageError(f"invalid {option} {shown(text)!r}: {fault.message}", fault.hint) from None


def _measure(option: str, text: str, unit: str) -> float:
    value = option_value(option, text, unit)
    if not value > 0:
        raise UsageError(f"invalid {option} {shown(text)}: expected a number above 0 {unit}")
    return value
