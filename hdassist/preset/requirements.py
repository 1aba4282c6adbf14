"""Requirements on a new drive from the options of a command line."""

from __future__ import annotations

import re
from math import isfinite
from typing import Any

from hdassist.errors import UsageError
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import choices_of, plain
from hdassist.preset.similarity import Requirements, SimilarValue, teeth_of_ratio
from hdassist.preset.units import read_number
from hdassist.preset.yamltext import InvalidValue, near_miss, scalar_value, shown

MEASURES = {"pitch_diameter": "mm", "torque": "N*m", "lost_motion": "arcsec", "accuracy": "arcsec"}  # and their units


def read_requirements(like: Drive, **given: Any) -> Requirements:
    """Requirements on a drive that is to be like another one.

    Arguments, None where not given: coupling of the cam, as cam.coupling has it; shaft, diameter and overhang [mm] of
    one that it is overhung on, like 14x30; pitch_diameter [mm] and torque [N*m]; teeth, like 160/162; ratio, of the
    drive built in as the other one; of a catalogue three stiffnesses [N*m/rad], lost_motion and accuracy [arcsec]. All
    but the ratio are texts, which may have a unit.
    Raises UsageError: an option that cannot be read, or two that contradict each other.
    """
    options = {name: f"--{name.replace('_', '-')}" for name in MEASURES}
    given = {name: value for name, value in given.items() if value is not None}
    values = {name: _measure(options[name], given[name], MEASURES[name]) for name in MEASURES if name in given}
    sources = {name: f"{options[name]} {plain(value)}" for name, value in values.items()}
    others = _coupling(given.get("coupling"), given.get("shaft"))
    for name in ("lost_motion", "accuracy"):
        if name in values:
            others[f"catalogue.{name}"] = SimilarValue(values[name], "given", f"{options[name]} {given[name]}")
    z_g = _teeth(given["teeth"]) if "teeth" in given else None
    if z_g is not None:
        sources["teeth"] = f"--teeth {z_g}/{z_g + 2}"
    if (ratio := given.get("ratio")) is not None:
        if not (isfinite(ratio) and ratio > 0):
            raise UsageError(f"invalid --ratio {ratio:g}: expected a number above 0")
        by_ratio = teeth_of_ratio(like, ratio)
        if z_g not in (None, by_ratio):
            raise UsageError(
                f"{sources['teeth']} contradicts --ratio {plain(ratio)}, which takes {by_ratio}/{by_ratio + 2}",
                "leave one of them out",
            )
        z_g = by_ratio
        sources["teeth"] = f"--ratio {plain(ratio)}, two waves"
    K = _stiffnesses(given["stiffness"]) if "stiffness" in given else None
    if K is not None:
        sources["stiffness"] = f"--stiffness {','.join(map(plain, K))}; not fitted, hdassist stiffness compares"
    d, T = values.get("pitch_diameter"), values.get("torque")
    return Requirements(z_g, d, T, K, sources=sources, others=others)


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
    value = read_number(scalar_value(text.strip()), unit)
    if isinstance(value, InvalidValue):
        raise UsageError(f"invalid {option} {shown(text)!r}: {value.message}", value.hint)
    return float(value)


def _measure(option: str, text: str, unit: str) -> float:
    value = option_value(option, text, unit)
    if not value > 0:
        raise UsageError(f"invalid {option} {shown(text)}: expected a number above 0 {unit}")
    return value


def _stiffnesses(text: str) -> tuple[float, float, float]:
    values = [_measure("--stiffness", part, "N*m/rad") for part in text.split(",")]
    if len(values) != 3:
        raise UsageError(f"invalid --stiffness {shown(text)}: expected three numbers", "like 3.1e4,5e4,5.7e4")
    return values[0], values[1], values[2]
