"""Numbers with a unit such as "75 um", with an uncertainty such as "260 ± 10 deg", in the unit of a field.

Conversion is decimal and rounds once, so "75 um" and 0.075 are the same number.
"""

from __future__ import annotations

import difflib
import re
from dataclasses import replace
from decimal import Decimal
from math import isfinite, isinf
from typing import Any

from hdassist.numerals import NUMBER
from hdassist.preset.yamltext import InvalidValue, shown

PI = Decimal("3.14159265358979323846264338328")
_DEGREE = PI / 180

# Dimension: unit (as `_normal` writes it) -> its size, in the same measure throughout the dimension.
_TABLE: dict[str, dict[str, Decimal | int | str]] = {
    "a length": {"mm": 1, "um": "1e-3", "nm": "1e-6", "cm": 10, "inch": "25.4", "in": "25.4"},
    "an angle": {
        "deg": 1, "°": 1, "arcmin": Decimal(1) / 60, "'": Decimal(1) / 60, "arcsec": Decimal(1) / 3600,
        '"': Decimal(1) / 3600, "rad": 1 / _DEGREE,
        "mrad": Decimal("1e-3") / _DEGREE, "urad": Decimal("1e-6") / _DEGREE,
    },
    "a torque": {
        "N*m": 1, "Nm": 1, "N m": 1, "kN*m": 1000, "kNm": 1000, "kN m": 1000,
        "N*mm": "1e-3", "Nmm": "1e-3", "N mm": "1e-3", "mN*m": "1e-3", "mNm": "1e-3",
    },
    "a stress": {
        "MPa": 1, "Pa": "1e-6", "kPa": "1e-3", "GPa": 1000, "N/mm2": 1, "kN/mm2": 1000,
    },
    "a stiffness": {
        "N/mm": 1, "N/um": 1000, "kN/mm": 1000, "kN/um": 1000000, "N/m": "1e-3", "kN/m": 1, "MN/m": 1000,
    },
    "a compliance": {
        "mm/N": 1, "um/N": "1e-3", "nm/N": "1e-6", "mm/kN": "1e-3", "um/kN": "1e-6", "m/N": 1000,
    },
    "a stiffness by width": {
        "N/um/mm": 1, "N/mm/um": 1, "N/(um*mm)": 1, "N/(mm*um)": 1,
    },
    "a torsional stiffness": {
        f"{torque}/{angle}": size / share
        for torque, size in (("N*m", Decimal(1)), ("Nm", Decimal(1)), ("kN*m", Decimal(1000)), ("kNm", Decimal(1000)))
        for angle, share in (("rad", Decimal(1)), ("mrad", Decimal("1e-3")), ("deg", _DEGREE), ("arcmin", _DEGREE / 60))
    },
    "a difference of temperatures": {"K": 1},
    "a thermal expansion": {"/K": 1, "um/m/K": "1e-6", "um/(m*K)": "1e-6", "ppm/K": "1e-6"},
    "a share": {"%": 1},
}  # fmt: skip
_SIZES = {name: {unit: Decimal(size) for unit, size in units.items()} for name, units in _TABLE.items()}

# Units that could be mistaken for another one: refused, with a hint.
_MISTAKEN = {
    ("a length", "m"): "metre or module? write mm or um",
    ("a length", "M"): "metre or module? write mm or um",
    ("a length", "Mm"): "write mm or um",
    ("a length", "mu"): "write um",
    ("a length", "u"): "write um",
    ("a torque", "mN"): "millinewton or metre times newton? write N*m",
    ("a torque", "MN"): "write N*m or kN*m",
    ("a torque", "MNm"): "write N*m or kN*m",
    ("a torque", "MN*m"): "write N*m or kN*m",
    ("a torque", "nm"): "write N*m",
    ("a torque", "N"): "a force; write N*m",
    ("a stress", "mPa"): "write MPa or GPa",
    ("an angle", "min"): "write arcmin",
    ("an angle", "m"): "write arcmin",
    ("an angle", "sec"): "write arcsec",
    ("an angle", "s"): "write arcsec",
    ("an angle", "''"): "write arcsec",
    ("a difference of temperatures", "°C"): "a temperature, or a difference of two? write K",
    ("a difference of temperatures", "C"): "a temperature, or a difference of two? write K",
}

_SPELLINGS = str.maketrans({
    "µ": "u", "μ": "u", "·": "*", "⋅": "*", "∙": "*", "•": "*", "×": "*", "²": "2",
    "′": "'", "″": '"', "º": "°",
})  # fmt: skip
_DOUBLES = {"°", "'", '"', "Nm", "N m", "kNm", "kN m", "Nmm", "N mm", "mNm"}  # known by another name as well
_SPLIT = re.compile(rf"({NUMBER})\s*(.*)", re.DOTALL)
_SIGN = r"(?:±|\+/-|\+-)"
_SPREAD = re.compile(rf"(.*?)\s*{_SIGN}\s*(.*)", re.DOTALL)
_NOT_FINITE = re.compile(r"[-+]?\.?(nan|inf|infinity)", re.IGNORECASE)
_SMALLEST = 1e-290
LONGEST_NUMBER = (
    400  # characters of a number with its unit and uncertainty; time to match them grows faster than they do
)


class UnitError(ValueError):
    """A text that is no number in a fitting unit: message and hint."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


def convert(text: str, unit: str) -> float:
    """Read a number with a unit.

    Arguments: text, such as "75 um"; unit, the unit of the field, empty for a pure number.
    Result: the number in the unit of the field.
    Raises UnitError: no number, not finite, no unit, or a unit that does not fit.
    """
    match = None if _is_long(text) else _SPLIT.fullmatch(text.strip())
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


def _is_long(text: str) -> bool:
    """Whether a text is too long to be a number."""
    return len(text.strip()) > LONGEST_NUMBER


def is_spread(text: str) -> bool:
    """Whether a text has a sign of an uncertainty in it."""
    return not _is_long(text) and _SPREAD.fullmatch(text.strip()) is not None


def read_spread(text: str, unit: str) -> tuple[float, float]:
    """A number and its expanded uncertainty (k = 2), both in the unit of the field.

    Arguments: text, such as "260±10", "75 ± 5 um" or "1.2 deg +- 3 arcmin": a unit that one of them lacks is the
    other's, and two bare numbers are in the unit of the field. Raises UnitError for anything else.
    """
    match = None if _is_long(text) else _SPREAD.fullmatch(text.strip())
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


def read_number(value: Any, unit: str, *, spread: bool = False) -> float | InvalidValue:
    """A number in a unit from a value of a preset, a number or a text with a unit; InvalidValue for any other.

    spread: the text may have an uncertainty, which read_spread reads.
    """
    if isinstance(value, InvalidValue):
        return value
    if isinstance(value, str):
        try:
            return read_spread(value, unit)[0] if spread and is_spread(value) else convert(value, unit)
        except UnitError as error:
            return InvalidValue(error.message, error.hint)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return value if isfinite(value) else InvalidValue("must be a finite number")
    return InvalidValue("must be a number", f"in {unit}" if unit else "")


def read_count(value: Any) -> int | InvalidValue:
    """A whole number from a value of a preset; InvalidValue for any other."""
    if isinstance(value, float) and not value.is_integer():
        return InvalidValue("must be a whole number")
    number = read_number(value, "")
    if isinstance(number, InvalidValue):
        words = number.message.replace("a number", "a whole number").replace("a pure", "a whole")
        return replace(number, message=words)
    return int(number)


def units_for(unit: str) -> tuple[str, ...]:
    """Every unit that converts to the given one, as messages write it; empty for a pure number."""
    dimension = _dimension(unit)
    return tuple(u for u in _SIZES[dimension] if u not in _DOUBLES) if dimension else ()


def _normal(unit: str) -> str:
    unit = re.sub(r"\s*([*/^])\s*", r"\1", unit.translate(_SPELLINGS).strip())
    return re.sub(r"\s+", " ", unit.replace("^2", "2").replace("**", "*"))


def _dimension(unit: str) -> str:
    return next((name for name, units in _SIZES.items() if unit in units), "")


def _factor(given: str, unit: str) -> Decimal:
    dimension = _dimension(unit)
    if not dimension:
        raise UnitError("takes a pure number, without a unit")
    sizes = _SIZES[dimension]
    if given in sizes:
        return sizes[given] / sizes[unit]
    shown_unit = shown(given, 30)
    if hint := _MISTAKEN.get((dimension, given)):
        raise UnitError(f"the unit {shown_unit} could be mistaken", hint)
    fitting = f"a bare number is in {unit}; units: {', '.join(units_for(unit))}"
    if other := _dimension(given):
        raise UnitError(f"{shown_unit} is the unit of {other}, {dimension} is wanted", fitting)
    known = {u.lower(): u for u in units_for(unit)}
    near = difflib.get_close_matches(given[:30].lower(), known, 1, 0.6)
    meant = known[near[0]] if near else ""
    raise UnitError(f"unknown unit {shown_unit}", f"did you mean {meant}?" if meant else fitting)


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
