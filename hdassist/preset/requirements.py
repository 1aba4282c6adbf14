"""What is asked of a new drive, from the texts of a command line."""

from __future__ import annotations

import re
from math import isfinite

from hdassist.errors import UsageError
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import choices_of, plain
from hdassist.preset.similarity import Requirements, SimilarValue, teeth_of_ratio
from hdassist.preset.units import read_number
from hdassist.preset.yamltext import InvalidValue, near_miss, scalar_value, shown


def read_requirements(
    like: Drive,
    *,
    coupling: str | None = None,
    shaft: str | None = None,
    diameter: str | None = None,
    teeth: str | None = None,
    ratio: float | None = None,
    torque: str | None = None,
    stiffness: str | None = None,
    lost_motion: str | None = None,
    accuracy: str | None = None,
) -> Requirements:
    """What is given of a drive that is to be like another one.

    Arguments: coupling of the cam, as cam.coupling has it; shaft, diameter and overhang [mm] of one that it is overhung
    on, like 14x30; diameter [mm] and torque [N*m]; teeth, like 160/162; ratio, of the drive built in as the other one;
    of a catalogue three stiffnesses [N*m/rad], lost motion and accuracy [arcsec]; all with units if need be. Raises
    UsageError: what cannot be read, or contradicts itself.
    """
    said = {}
    z_g = None if teeth is None else _teeth(teeth)
    if z_g is not None:
        said["teeth"] = f"--teeth {z_g}/{z_g + 2}"
    if ratio is not None:
        if not (isfinite(ratio) and ratio > 0):
            raise UsageError(f"--ratio must be a number above 0 (got {ratio:g})")
        by_ratio = teeth_of_ratio(like, ratio)
        if z_g is not None and by_ratio != z_g:
            raise UsageError(
                f"--teeth {z_g}/{z_g + 2} contradicts --ratio {plain(ratio)}, which takes {by_ratio}/{by_ratio + 2}",
                "leave one of them out",
            )
        z_g = by_ratio
        said["teeth"] = f"--ratio {plain(ratio)}, two waves"
    d = None if diameter is None else _measure("--pitch-diameter", diameter, "mm")
    T = None if torque is None else _measure("--torque", torque, "N*m")
    K = None if stiffness is None else _stiffnesses(stiffness)
    limits = {
        f"catalogue.{name}": SimilarValue(_measure(option, text, "arcsec"), "given", f"{option} {text}")
        for name, option, text in (("lost_motion", "--lost-motion", lost_motion), ("accuracy", "--accuracy", accuracy))
        if text is not None
    }
    said |= {} if d is None else {"diameter": f"--pitch-diameter {d:g}"}
    said |= {} if T is None else {"torque": f"--torque {plain(T)}"}
    said |= (
        {}
        if K is None
        else {"stiffness": f"--stiffness {','.join(map(plain, K))}; not fitted, hdassist stiffness compares"}
    )
    return Requirements(z_g, d, T, K, said=said, others=_coupling(coupling, shaft) | limits)


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
    sizes = re.fullmatch(r"\s*([0-9.]+)\s*x\s*([0-9.]+)\s*(?:mm)?\s*", shaft or "")
    if shaft and sizes is None:
        raise UsageError(f"invalid --shaft {shown(shaft)}: expected DIAMETERxOVERHANG in mm", "like 14x30")
    kind, ref = "given" if coupling != "unknown" else "assumed", f"--coupling {coupling}"
    both = dict(zip(("cam.shaft_d", "cam.overhang"), sizes.groups() if sizes else (), strict=False))
    measured = {
        path: SimilarValue(_measure("--shaft", text, "mm"), "given", f"--shaft {shaft}") for path, text in both.items()
    }
    return {"cam.coupling": SimilarValue(coupling, kind, ref), **measured}


def _teeth(text: str) -> int:
    match = re.fullmatch(r"\s*([0-9]{1,6})\s*(?:/\s*([0-9]{1,6})\s*)?", text)
    if match is None:
        raise UsageError(f"--teeth must be two whole numbers, like 160/162 (got {shown(text) or 'nothing'})")
    z_g = int(match[1])
    if match[2] is not None and int(match[2]) != z_g + 2:
        raise UsageError(
            f"--teeth {z_g}/{int(match[2])}: only drives with two waves and z_b - z_g = 2 are supported",
            f"{z_g}/{z_g + 2}, the flexspline first",
        )
    return z_g


def _measure(option: str, text: str, unit: str) -> float:
    value = read_number(scalar_value(text.strip()), unit)
    if isinstance(value, InvalidValue):
        raise UsageError(f"{option}: {value.message} (got {shown(text) or 'nothing'})", value.hint)
    if not value > 0:
        raise UsageError(f"{option} must be above 0 {unit} (got {shown(text)})")
    return float(value)


def _stiffnesses(text: str) -> tuple[float, float, float]:
    values = [_measure("--stiffness", part, "N*m/rad") for part in text.split(",")]
    if len(values) != 3:
        raise UsageError(f"--stiffness takes three numbers, like 3.1e4,5e4,5.7e4 (got {len(values)})")
    return values[0], values[1], values[2]
