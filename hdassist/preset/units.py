"""Numbers with a unit such as "75 um", with an uncertainty such as "260 ± 10 deg", in the unit of a field.

Conversion is decimal and rounds once, so "75 um" and 0.075 are the same number.
"""

import re
import tomllib
from dataclasses import replace
from decimal import Decimal
from importlib.resources import files
from math import isfinite, isinf
from typing import Any

from hdassist.plaintext import NUMBER
from hdassist.preset.yamltext import InvalidValueError, near_miss, shown

_TABLE = tomllib.loads(files("hdassist.preset").joinpath("units.toml").read_text("utf-8"), parse_float=Decimal)
_SPELLINGS = str.maketrans(_TABLE.pop("spellings"))
_ALIASES: dict[str, str] = _TABLE.pop("aliases")
# by dimension: words about units that could be taken for another one
_MISTAKEN: dict[str, dict[str, str]] = {dimension: units.pop("mistaken", {}) for dimension, units in _TABLE.items()}
_LISTED = {unit: (dimension, size) for dimension, units in _TABLE.items() for unit, size in units.items()}
_UNITS: dict[str, tuple[str, Decimal]] = _LISTED | {alias: _LISTED[unit] for alias, unit in _ALIASES.items()}

_SPLIT = re.compile(rf"({NUMBER})\s*(.*)", re.DOTALL)
_SIGN = r"(?:±|\+/-|\+-)"
_SPREAD = re.compile(rf"(.*?)\s*{_SIGN}\s*(.*)", re.DOTALL)
_NOT_FINITE = re.compile(r"[-+]?\.?(nan|inf|infinity)", re.IGNORECASE)
_SMALLEST = 1e-290
LONGEST_NUMBER = (
    400  # characters of a number with its unit and uncertainty; time to match them grows faster than they do
)


class UnitError(InvalidValueError):
    """A text that is no number in a fitting unit."""


def convert(text: str, unit: str) -> float:
    """Read a number with a unit.

    Arguments: text, such as "75 um"; unit, the unit of the field, empty for a pure number.
    Result: the number in the unit of the field.
    Raises UnitError: no number, not finite, no unit, or a unit that does not fit.
    """
    match = _matched(_SPLIT, text)
    if match is None:
        raise _no_number(text.strip(), unit)
    number, given = match[1], _normal(match[2])
    if given == "":
        raise UnitError("must be a number, not text", "leave out the quotes")
    value = float(number)
    if isinf(value):
        raise UnitError("must be a finite number")
    if looks := re.match(r"[:,_0-9]", given):
        raise _no_number(text.strip(), unit, looks[0])
    factor = _factor(given, unit)
    if abs(value) < _SMALLEST:
        return value * float(factor)
    return float(Decimal(number) * factor)


def _matched(pattern: re.Pattern[str], text: str) -> re.Match[str] | None:
    """The match of a whole text that is not too long for a number."""
    return pattern.fullmatch(text.strip()) if len(text.strip()) <= LONGEST_NUMBER else None


def is_spread(text: str) -> bool:
    """Whether a text has a sign of an uncertainty in it."""
    return _matched(_SPREAD, text) is not None


def read_spread(text: str, unit: str) -> tuple[float, float]:
    """A number and its expanded uncertainty (k = 2), both in the unit of the field.

    Arguments: text, such as "260±10", "75 ± 5 um" or "1.2 deg +- 3 arcmin": a unit that one of them lacks is the
    other's, and two bare numbers are in the unit of the field. Raises UnitError for anything else.
    """
    match = _matched(_SPREAD, text)
    if match is None:
        raise UnitError("must be a number and its uncertainty", "like 260 ± 10")
    units = [number[2] if (number := _SPLIT.fullmatch(part)) else "" for part in match.groups()]
    common = units[0] or units[1]
    value, spread = (
        convert(part if own else f"{part} {common}", unit) if common or not re.fullmatch(NUMBER, part) else float(part)
        for part, own in zip(match.groups(), units, strict=True)
    )
    if match[2].startswith(("-", "+")):
        raise UnitError("an uncertainty has no sign", "like 260 ± 10")
    if not (isfinite(value) and isfinite(spread)):
        raise UnitError("must be a finite number")
    return value, spread


def read_number(value: Any, unit: str, *, spread: bool = False) -> float:
    """A number in a unit from a value of a preset, a number or a text with a unit.

    Raises InvalidValueError for any other. spread: the text may have an uncertainty, which read_spread reads.
    """
    if isinstance(value, str):
        return read_spread(value, unit)[0] if spread and is_spread(value) else convert(value, unit)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidValueError("must be a number", f"in {unit}" if unit else "")
    if not isfinite(value):
        raise InvalidValueError("must be a finite number")
    return value


def read_count(value: Any) -> int:
    """A whole number from a value of a preset. Raises InvalidValueError for any other."""
    try:
        number = read_number(value, "")
    except InvalidValueError as fault:
        words = fault.message.replace("a number", "a whole number").replace("pure", "whole")
        raise replace(fault, message=words) from None
    if number % 1:
        raise InvalidValueError("must be a whole number")
    return int(number)


def units_for(unit: str) -> tuple[str, ...]:
    """Every unit that converts to the given one, as messages write it; empty for a pure number."""
    return tuple(other for other, (dimension, _) in _LISTED.items() if unit and dimension == _UNITS[unit][0])


def _normal(unit: str) -> str:
    unit = re.sub(r"\s*([*/^])\s*", r"\1", unit.translate(_SPELLINGS).strip())
    return re.sub(r"\s+", " ", unit.replace("^2", "2").replace("**", "*"))


def _factor(given: str, unit: str) -> Decimal:
    if not unit:
        raise UnitError("takes a pure number, without a unit")
    dimension, own_size = _UNITS[unit]
    other, size = _UNITS.get(given, ("", own_size))
    if other == dimension:
        return size / own_size
    shown_unit = shown(given, 30)
    if hint := _MISTAKEN[dimension].get(given):
        raise UnitError(f"the unit {shown_unit} could be mistaken", hint)
    fitting = f"a bare number is in {unit}; units: {', '.join(units_for(unit))}"
    if other:
        raise UnitError(f"{shown_unit} is the unit of {other}, {dimension} is wanted", fitting)
    raise UnitError(f"unknown unit {shown_unit}", near_miss(given[:30], units_for(unit)) or fitting)


def _no_number(text: str, unit: str, sign: str = "") -> UnitError:
    if _NOT_FINITE.fullmatch(text.split(" ")[0]):
        return UnitError("must be a finite number")
    if sign == "," or re.fullmatch(r"[-+]?[0-9]+,[0-9]+.*", text):
        return UnitError("must be a number", "a decimal point, not a comma, and nothing between thousands")
    if sign == "_":
        return UnitError("must be a number", "write it without underscores")
    if text.startswith("\u2212"):
        return UnitError("must be a number", "write an ASCII minus sign")
    return UnitError("must be a number", f"in {unit}" if unit else "")
