"""Kinds of fields of a preset: declaring them, reading their values, their units and bounds."""

from __future__ import annotations

import re
from math import inf, isfinite
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)  # fmt: skip
from pydantic.fields import FieldInfo
from pydantic_core import InitErrorDetails

from hdassist.numerals import NUMBER, number_of
from hdassist.preset.units import UnitError, read_count, read_number, read_spread
from hdassist.preset.yamltext import InvalidValue, near_miss

FieldKind = Literal["number", "count", "text", "choice", "numbers", "holes", "limits", "orders", "readings"]

CLOSED = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


def _one_line(text: str) -> str:
    if "\n" in text:
        raise ValueError("must be one line")
    return text


OneLine = Annotated[str, AfterValidator(_one_line)]  # of a name: with a line break it could forge a line of a report


class Section(BaseModel):
    """A group of preset fields: immutable, closed, and read as each field declares."""

    model_config = CLOSED

    @model_validator(mode="before")
    @classmethod
    def _empty(cls, data: Any) -> Any:
        return {} if data is None else data

    @field_validator("*", mode="before")
    @classmethod
    def _read(cls, value: Any, info: ValidationInfo) -> Any:
        return read_value(cls.model_fields[str(info.field_name)], value)


UNKNOWN = "unknown"  # written in a preset in place of a value


def field(
    meaning: str,
    unit: str = "",
    default: Any = ...,
    *,
    unknown: bool = False,
    **limits: float,
) -> Any:
    """Declare a field: meaning, unit, default (none: required), whether it may be unknown, range."""
    extra = {"unit": unit, UNKNOWN: unknown}
    return Field(  # type: ignore[call-overload]
        default, description=meaning, json_schema_extra=extra, **limits
    )


def may_be_unknown(info: FieldInfo) -> bool:
    """Whether a field is unknown where a preset does not give it."""
    extra = info.json_schema_extra
    return isinstance(extra, dict) and extra.get(UNKNOWN) is True


def is_number(key: str) -> bool:
    """Whether a key of a table of limits is a number, such as a torque [N*m] (the other key is "all")."""
    return re.fullmatch(NUMBER, key) is not None and isfinite(float(key))


PER_ORDER = "by orders per cam turn"
LimitArcsec = Annotated[float, Field(gt=0, le=1e6)]
PerTorque = dict[str, LimitArcsec]
PerOrder = Annotated[dict[str, LimitArcsec], PER_ORDER]


class UncertainReading(NamedTuple):
    """A measured value with its expanded uncertainty (k = 2), both in the unit of its field."""

    value: float
    uncertainty: float

    def __str__(self) -> str:
        return f"{self.value:g} ± {self.uncertainty:g}"


LARGEST_READING = 1e6
PER_POSITION = "by positions of the fixed wheel"
PerPosition = Annotated[dict[str, UncertainReading], PER_POSITION]
POSITION_KEY = rf"(?:h[0-9]+|{NUMBER})@{NUMBER}"


def read_value(info: FieldInfo, value: Any) -> Any:
    """What a preset gives for a field, in the form that the field holds; where it cannot be read `InvalidValue`."""
    kind, unit = kind_of(info), unit_of(info)
    if isinstance(value, InvalidValue) or kind in ("text", "choice") or (value is None and is_optional(info)):
        return value
    if isinstance(value, str) and may_be_unknown(info):
        if value == UNKNOWN:
            return None
        if meant := near_miss(value, [UNKNOWN]):
            return InvalidValue("must be a number", meant)
    if value is None and not info.is_required() and kind not in ("numbers", "holes"):
        expected = "a whole number" if kind == "count" else "a number"
        return InvalidValue(f"must be {expected}", f"leave the key out for its default, {info.default}")
    if kind == "number":
        return read_number(value, unit, spread=True)
    if kind == "count":
        return read_count(value)
    if kind == "numbers":
        if value is None or isinstance(value, dict):
            return InvalidValue("must be a list of numbers")
        return tuple(read_number(item, unit) for item in _items(value))
    if kind == "holes":
        return value if value == "all" else _read_holes(value)
    return _read_readings(value, unit) if kind == "readings" else _read_limits(value, unit, kind == "orders")


def _items(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list | tuple) else [value]


def _read_holes(value: Any) -> Any:
    if value is None or isinstance(value, dict | str):
        return InvalidValue("must be all, or a list of hole numbers")
    holes = tuple(map(read_count, _items(value)))
    unread = [
        InitErrorDetails(type="int_type", loc=(index,), input=hole)
        for index, hole in enumerate(holes)
        if isinstance(hole, InvalidValue)
    ]
    if unread:  # raised here, as pydantic would put the names of the types of a union into the place
        raise ValidationError.from_exception_data("holes", unread)
    return holes


def _read_limits(value: Any, unit: str, by_order: bool) -> Any:
    if not isinstance(value, dict):
        limit = read_number(value, unit)
        if by_order and not isinstance(limit, InvalidValue):
            return InvalidValue("must be a table of orders per cam turn", "like {2: 10}")
        return limit if isinstance(limit, InvalidValue) else {"all": limit}
    expected = "an order per cam turn, or ORDER@TORQUE in N*m" if by_order else "a torque in N*m, or all"
    limits: dict[str, float | InvalidValue] = {}
    read: set[tuple[float, ...]] = set()
    for key, item in value.items():
        own = _order_and_torque(key) if by_order else (float(key),) if is_number(key) else ()
        if not own and (by_order or key != "all"):
            limits[key] = InvalidValue(f"must be {expected}", at_key=True)
        elif own and own in read:
            limits[key] = InvalidValue(f"the same {'order' if by_order else 'torque'} twice", at_key=True)
        else:
            limits[key] = read_number(item, unit)
        if own:
            read.add(own)
    return limits


def _read_readings(value: Any, unit: str) -> Any:
    if not isinstance(value, dict):
        return InvalidValue("must be a table of positions", "like {h0@80: 28.1 ± 1}")
    where = InvalidValue("must be a hole, or a turn in deg, at a torque in N*m", "like h4@80 or 120@80", at_key=True)
    is_position = {key: re.fullmatch(POSITION_KEY, key) and number_of(key.split("@")[1]) for key in value}
    return {key: _read_reading(item, unit) if is_position[key] else where for key, item in value.items()}


def _read_reading(value: Any, unit: str) -> UncertainReading | InvalidValue:
    if isinstance(value, InvalidValue | UncertainReading):
        return value
    try:
        reading = UncertainReading(*read_spread(str(value), unit))
    except UnitError as error:
        return InvalidValue(error.message, error.hint)
    if all(0 < number <= LARGEST_READING for number in reading):
        return reading
    return InvalidValue(f"out of range: value and uncertainty above 0, up to {plain(LARGEST_READING)} {unit}")


def _order_and_torque(key: str) -> tuple[float, ...]:
    """The order above 0 and the torque, if any, that a key of a table of limits names; empty for any other."""
    parts = key.split("@")
    if len(parts) > 2 or not all(map(is_number, parts)):
        return ()
    numbers = tuple(map(float, parts))
    return numbers if numbers[0] > 0 else ()


def unit_of(info: FieldInfo) -> str:
    """Unit of a field as declared, empty for a pure number."""
    extra = info.json_schema_extra
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""


def kind_of(info: FieldInfo) -> FieldKind:
    """What a field takes: a number, count, text, choice, several numbers, holes, limits, readings."""
    union = get_origin(info.annotation) in (Union, UnionType)
    parts = get_args(info.annotation) if union else (info.annotation,)
    if float in parts:
        return "number"
    if int in parts:
        return "count"
    origins = [get_origin(part) for part in parts]
    if Literal in origins:
        return "holes" if tuple in origins else "choice"
    if dict in origins:
        return "orders" if PER_ORDER in info.metadata else "readings" if PER_POSITION in info.metadata else "limits"
    return "numbers" if tuple in origins else "text"


def is_optional(info: FieldInfo) -> bool:
    """Whether a field may be empty."""
    return type(None) in get_args(info.annotation)


def choices_of(info: FieldInfo) -> tuple[str, ...]:
    """Words that a field of the kind "choice" takes."""
    return tuple(map(str, get_args(info.annotation)))


def bounds_of(info: FieldInfo) -> dict[str, float]:
    """Bounds of a field, or of each item of it, as far as it has them: ge and le, in its range; gt, just out of it."""
    bounds: dict[str, float] = {}
    parts: list[Any] = [info]
    for part in parts:  # grows by its own parts
        if isinstance(part, FieldInfo):
            bounds |= {name: getattr(x, name) for x in part.metadata for name in ("ge", "gt", "le") if hasattr(x, name)}
        parts += [part.annotation] if isinstance(part, FieldInfo) else get_args(part)
    return bounds


def range_of(info: FieldInfo, unit: str = "") -> str:
    """Range of a field, or of each item of it, in words and with the unit; empty where there is none."""
    bounds = {name: plain(bound) for name, bound in bounds_of(info).items()}
    low = f"above {bounds['gt']}, up" if "gt" in bounds else bounds.get("ge", "")
    if "le" in bounds:
        return f"{low} to {bounds['le']} {unit}".rstrip()
    return f"{low} {unit}".rstrip() + " or more" if low else ""


def in_range(info: FieldInfo, value: float) -> bool:
    """Whether a number is within the range of a field."""
    bounds = bounds_of(info)
    return isfinite(value) and least_of(info) <= value <= bounds.get("le", inf) and value > bounds.get("gt", -inf)


def least_of(info: FieldInfo) -> float:
    """Least value that a field takes."""
    return bounds_of(info).get("ge", -inf)


def plain(number: float) -> str:
    """Number as in a preset: 20, 0.05, 1e7."""
    return f"{number:g}".replace("e+0", "e").replace("e-0", "e-")


def short(number: float) -> str:
    """The same in four digits."""
    return plain(float(f"{number:.4g}"))


def text_of(value: Any) -> str:
    """A value as a preset has it, with every digit it has, and no more."""
    if value is None:
        return UNKNOWN
    if isinstance(value, bool | str):
        return str(value)
    if isinstance(value, tuple):
        return f"[{', '.join(map(text_of, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {text_of(each)}' for key, each in value.items())}}}"
    return plain(value) if float(plain(value)) == value else repr(value)
