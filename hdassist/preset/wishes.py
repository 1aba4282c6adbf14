"""What is asked of a new drive, from the texts of a command line."""

from __future__ import annotations

import re
from math import isfinite

from hdassist.errors import UsageError
from hdassist.preset.fields import Drive
from hdassist.preset.kinds import plain
from hdassist.preset.similarity import Wish, teeth_of_ratio
from hdassist.preset.units import read_number
from hdassist.preset.yamltext import Unread, resolve, shown


def read_wish(
    like: Drive,
    *,
    diameter: str | None = None,
    teeth: str | None = None,
    ratio: float | None = None,
    torque: str | None = None,
    stiffness: str | None = None,
) -> Wish:
    """What is given of a drive that is to be like another one.

    Arguments: diameter [mm], torque [N*m] and three stiffnesses [N*m/rad], with units if need be; teeth, like 160/162;
    ratio, of the drive built in as the other one. Raises UsageError: what cannot be read, or contradicts itself.
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
    said |= {} if d is None else {"diameter": f"--pitch-diameter {d:g}"}
    said |= {} if T is None else {"torque": f"--torque {plain(T)}"}
    said |= (
        {}
        if K is None
        else {"stiffness": f"--stiffness {','.join(map(plain, K))}; not fitted, hdassist stiffness compares"}
    )
    return Wish(z_g, d, T, K, said=said)


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
    value = read_number(resolve(text.strip()), unit)
    if isinstance(value, Unread):
        raise UsageError(f"{option}: {value.message} (got {shown(text) or 'nothing'})", value.hint)
    if not value > 0:
        raise UsageError(f"{option} must be above 0 {unit} (got {shown(text)})")
    return float(value)


def _stiffnesses(text: str) -> tuple[float, float, float]:
    values = [_measure("--stiffness", part, "N*m/rad") for part in text.split(",")]
    if len(values) != 3:
        raise UsageError(f"--stiffness takes three numbers, like 3.1e4,5e4,5.7e4 (got {len(values)})")
    return values[0], values[1], values[2]
