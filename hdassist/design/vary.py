"""Axes of a sweep: fields of a preset, each with its values."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

from pydantic.fields import FieldInfo

from hdassist.errors import UsageError
from hdassist.preset.fields import field_table
from hdassist.preset.kinds import kind_of, unit_of
from hdassist.preset.overrides import is_overridden, path_of
from hdassist.preset.units import read_count, read_number
from hdassist.preset.yamltext import InvalidValueError, near_miss, scalar_value, shown

VARY = "--vary"
TORQUE = "operation.M_g"
MOST_VALUES = 10_000  # values of a field, at most
FORM = f"like {VARY} tolerances.e_hb=20:120:11, from 20 to 120 in 11 steps, or {VARY} tolerances.e_hb=20,50,80"


@dataclass(frozen=True)
class Axis:
    """A field that is varied: path, unit, and its values in that unit."""

    path: str
    unit: str
    values: tuple[float, ...]


def read_axes(texts: Sequence[str], overrides: Sequence[str]) -> tuple[Axis, ...]:
    """Fields that are varied, from texts such as "tolerances.e_hb=20:120:11" or "gears.j_n=0,5 um,10".

    Arguments: texts; overrides of the preset, which must not set the same fields.
    Raises UsageError for the first text that is wrong.
    """
    if not texts:
        raise UsageError("nothing is varied", FORM)
    axes: list[Axis] = []
    for text in texts:
        axis = _axis(text)
        if axis.path in [before.path for before in axes]:
            raise _invalid(text, "each field once", "one range, or one list with all values")
        if is_overridden(axis.path, overrides):
            raise _invalid(text, "a field that is not set to one value", f"leave out {VARY} or --set and --torque")
        axes.append(axis)
    return tuple(axes)


@cache
def _fields() -> dict[str, FieldInfo]:
    """Fields that can be varied, by path."""
    found = field_table().items()
    return {path: info for path, info in found if path == TORQUE or kind_of(info) in ("number", "count")}


def _axis(text: str) -> Axis:
    """The field that a text varies. Raises UsageError: the text is not of the form, or has no such values."""
    key, equals, values = text.partition("=")
    if not equals:
        raise _invalid(text, "KEY=START:STOP:STEPS or KEY=A,B,C", FORM)
    path = ".".join(map(str, path_of(key)))
    info = _fields().get(path)
    if info is None:
        same = (each for each in _fields() if each.split(".")[1] == path.split(".")[-1])
        close = f"did you mean {meant}?" if (meant := next(same, "")) else near_miss(path, _fields())
        raise _invalid(text, "a field of a single number", close or "write section.key, like gears.j_n")
    unit, is_count = unit_of(info), kind_of(info) == "count"

    def number(part: str) -> float:
        value = scalar_value(part)
        try:
            return read_count(value) if is_count else float(read_number(value, unit))
        except InvalidValueError as fault:
            raise _invalid(text, f"numbers ({shown(part) or 'nothing'} {fault.message})", fault.hint) from None

    parts = [part.strip() for part in values.split(":" if ":" in values else ",")]
    if ":" in values and len(parts) != 3:
        raise _invalid(text, "KEY=START:STOP:STEPS", FORM)
    found = [number(part) for part in (parts if ":" not in values else parts[:2])]
    if len(set(found)) < len(found):
        raise _invalid(text, "each value once")
    if ":" in values:
        found = _grid(text, Fraction(repr(found[0])), Fraction(repr(found[1])), parts[2], is_count)
    return Axis(path, unit, tuple(found))


def _grid(text: str, start: Fraction, stop: Fraction, steps: str, is_count: bool) -> list[float]:
    """Values from start to stop, each as near to its place as a number can be. Raises UsageError: no such steps."""
    count = int(steps) if re.fullmatch("[0-9]{1,9}", steps) else 0
    if not 2 <= count <= MOST_VALUES:
        raise _invalid(text, f"steps from 2 to {MOST_VALUES}", FORM)
    places = [start + (stop - start) * k / (count - 1) for k in range(count)]
    if is_count and any(place.denominator > 1 for place in places):
        raise _invalid(text, "steps on whole numbers")
    return [int(place) if is_count else float(place) for place in places]


def _invalid(text: str, expected: str, hint: str = "") -> UsageError:
    return UsageError(f"invalid {VARY} {shown(text) or 'nothing'}: expected {expected}", hint)
