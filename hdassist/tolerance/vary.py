"""What is varied in a sweep: fields of a preset, each with the values that it takes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import prod

from hdassist.errors import Finding, UsageError
from hdassist.preset.fields import field_table
from hdassist.preset.kinds import kind_of, unit_of
from hdassist.preset.overrides import is_overridden, path_of
from hdassist.preset.units import read_count, read_number
from hdassist.preset.yamltext import InvalidValue, near_miss, scalar_value, shown

VARY = "--vary"
TORQUE = "operation.M_g"
MOST_VALUES = 10_000  # values of a field, at most
MOST_ROWS = 1_000_000  # of a grid, at most
FORM = f"like {VARY} tolerances.e_hb=20:120:11, from 20 to 120 in 11 steps, or {VARY} tolerances.e_hb=20,50,80"


@dataclass(frozen=True)
class Axis:
    """A field that is varied: path, unit, and its values in that unit."""

    path: str
    unit: str
    values: tuple[float, ...]


class _WrongError(Exception):
    """What is wrong with a text: message, what was got, hint, and the column at which it stands."""

    def __init__(self, message: str, got: str = "", hint: str = "", column: int = 1) -> None:
        super().__init__(message)
        self.found = (message, shown(got), hint)
        self.column = column


def read_axes(texts: Sequence[str], overrides: Sequence[str]) -> tuple[Axis, ...]:
    """Fields that are varied, from texts such as "tolerances.e_hb=20:120:11" or "gears.j_n=0,5 um,10".

    Arguments: texts; overrides of the preset, which must not set the same fields.
    Raises UsageError with all that is wrong, each with its place.
    """
    if not texts:
        raise UsageError("nothing is varied", FORM)
    axes, findings = list[Axis](), list[Finding]()
    for index, text in enumerate(texts, 1):
        key = text.partition("=")[0]
        try:
            axis = _read(text)
            if axis.path in [before.path for before in axes]:
                raise _WrongError("varied twice", key, "one range, or one list with all values")
            if is_overridden(axis.path, overrides):
                raise _WrongError("set to one value and varied too", key, f"leave out {VARY} or --set and --torque")
            axes.append(axis)
        except _WrongError as wrong:
            findings.append(Finding(VARY, index, wrong.column, "", *wrong.found))
    if findings:
        raise UsageError("\n".join(map(str, findings)))
    return tuple(axes)


def require_few(rows: int) -> None:
    """Raise UsageError for more rows than a sweep may have."""
    if rows > MOST_ROWS:
        raise UsageError(f"{VARY} asks for {rows} rows, more than {MOST_ROWS}", "fewer steps, or fewer fields")


def grid_rows(axes: Iterable[Axis]) -> int:
    """Points of the grid of all values."""
    return prod(len(axis.values) for axis in axes)


def _read(text: str) -> Axis:
    key, equals, values = text.partition("=")
    path = ".".join(map(str, path_of(key)))
    if not equals:
        raise _WrongError("not of the form section.key=START:STOP:STEPS", text or "nothing", FORM)
    info = field_table().get(path)
    if info is None:
        raise _WrongError("names no field", key or "nothing", _meant(path))
    if path != TORQUE and kind_of(info) not in ("number", "count"):
        raise _WrongError("not a field of a single number: it cannot be varied", key)
    is_count, unit = kind_of(info) == "count", unit_of(info)
    parts = _parts(values, len(key) + 2)
    found = _steps(parts, unit, is_count) if ":" in values else [_number(*part, unit, is_count) for part in parts]
    if len(set(found)) < len(found):
        raise _WrongError("the same value twice", values, column=len(key) + 2)
    return Axis(path, unit, tuple(found))


def _parts(text: str, column: int) -> list[tuple[str, int]]:
    """What stands between colons, or else commas, each with its column."""
    separator = ":" if ":" in text else ","
    found = []
    for part in text.split(separator):
        found.append((part.strip(), column))
        column += len(part) + 1
    return found


def _number(text: str, column: int, unit: str, is_count: bool) -> float:
    value = scalar_value(text)
    read = read_count(value) if is_count else read_number(value, unit)
    if isinstance(read, InvalidValue):
        raise _WrongError(read.message, text or "nothing", read.hint, column)
    return read if is_count else float(read)


def _steps(parts: Sequence[tuple[str, int]], unit: str, is_count: bool) -> list[float]:
    """Values from start to stop, each as near to its place as a number can be."""
    if len(parts) != 3:
        raise _WrongError("not of the form START:STOP:STEPS", ":".join(text for text, _ in parts), FORM, parts[0][1])
    start, stop = (Fraction(repr(_number(*part, unit, is_count))) for part in parts[:2])
    text, column = parts[2]
    if not re.fullmatch("[0-9]{1,9}", text) or not 2 <= int(text) <= MOST_VALUES:
        raise _WrongError(f"steps must be a whole number from 2 to {MOST_VALUES}", text or "nothing", FORM, column)
    if start == stop:
        raise _WrongError("a range from a value to itself", parts[0][0], "one value needs no colons", parts[0][1])
    places = [start + (stop - start) * k / (int(text) - 1) for k in range(int(text))]
    if is_count and any(place.denominator > 1 for place in places):
        raise _WrongError("steps between whole numbers", text, "as many as fall on whole numbers", column)
    return [int(place) if is_count else float(place) for place in places]


def _meant(path: str) -> str:
    paths = [one for one, info in field_table().items() if one == TORQUE or kind_of(info) in ("number", "count")]
    same = [one for one in paths if one.split(".")[1] == path.split(".")[-1]]
    return f"did you mean {same[0]}?" if same else near_miss(path, paths) or "write section.key, like gears.j_n"
