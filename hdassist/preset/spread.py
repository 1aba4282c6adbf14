"""Measures with their expanded uncertainty in one text, such as "260 ± 10 deg"."""

from __future__ import annotations

import re

from hdassist.preset.units import UnitError, convert
from hdassist.preset.yamltext import NUMBER

SIGN = r"(?:±|\+/-|\+-)"
_PARTS = re.compile(rf"(.*?)\s*{SIGN}\s*(.*)", re.DOTALL)
_NUMBER_FIRST = re.compile(rf"({NUMBER})\s*(.*)", re.DOTALL)


def is_spread(text: str) -> bool:
    """Whether a text has a sign of an uncertainty in it."""
    return _PARTS.fullmatch(text.strip()) is not None


def read_spread(text: str, unit: str) -> tuple[float, float]:
    """A number and its expanded uncertainty (k = 2), both in the unit of the field.

    Arguments: text, such as "260±10", "75 ± 5 um" or "1.2 deg +- 3 arcmin": a unit that one of them lacks is the
    other's, and two bare numbers are in the unit of the field. Raises UnitError for anything else.
    """
    match = _PARTS.fullmatch(text.strip())
    if match is None:
        raise UnitError("must be a number and its uncertainty", "like 260 ± 10")
    number, spread = match[1], match[2]
    units = [m[2] if (m := _NUMBER_FIRST.fullmatch(part)) else "" for part in (number, spread)]
    common = units[0] or units[1]
    values = [_read(part, own, common, unit) for part, own in zip((number, spread), units, strict=True)]
    if spread.startswith(("-", "+")):
        raise UnitError("an uncertainty has no sign", "like 260 ± 10")
    return values[0], values[1]


def _read(part: str, own: str, common: str, unit: str) -> float:
    if not own and common:
        part = f"{part} {common}"
    elif re.fullmatch(NUMBER, part):
        return float(part)
    return convert(part, unit)


def spread_pattern(spelled_units: str) -> str:
    """Regular expression of such texts for editors; spelled_units, alternatives of a unit, empty for none."""
    unit = rf"\s*(?:{spelled_units})?" if spelled_units else ""
    positive = NUMBER.replace("[-+]?", "", 1)
    return rf"^\s*{NUMBER}{unit}\s*{SIGN}\s*{positive}{unit}\s*$"
