"""Kinds of fields of a preset: declaring them, reading their values, their units and bounds."""

from __future__ import annotations

import re
import tomllib
from importlib.resources import files
from math import inf, isfinite
from typing import Annotated, Any, Literal, NamedTuple, Self, cast, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator
from pydantic.fields import FieldInfo
from pydantic_core import InitErrorDetails

from hdassist.numerals import NUMBER, UNSIGNED, number_of
from hdassist.preset.units import UnitError, read_count, read_number, read_spread
from hdassist.preset.yamltext import InvalidValue, near_miss

FieldKind = Literal["number", "count", "text", "choice", "numbers", "holes", "limits", "orders", "readings"]
KINDS: dict[Any, FieldKind] = {
    float: "number", int: "count", str: "text",
    "numbers": "numbers", "holes": "holes", "limits": "limits", "orders": "orders", "readings": "readings",
}  # fmt: skip

CLOSED = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


def _one_line(text: str) -> str:
    if "\n" in text:
        raise ValueError("must be one line")
    return text


OneLine = Annotated[str, AfterValidator(_one_line)]  # of a name: with a line break it could forge a line of a report


UNKNOWN = "unknown"  # written in a preset in place of a value
DECLARED_FIELDS: dict[str, Any] = tomllib.loads(files("hdassist.preset").joinpath("fields.toml").read_text("utf-8"))


def _declared(meaning: str, unit: str = "", default: Any = ..., *, unknown: bool = False, **bounds: float) -> Any:
    """A field as fields.toml declares it: meaning, unit, default (none: required), whether it may be unknown, range."""
    extra: dict[str, Any] = {"unit": unit, UNKNOWN: unknown, "bounds": bounds}
    return Field(default, description=meaning, json_schema_extra=extra)


class DeclaredModel(BaseModel):
    """A part of a preset: immutable, closed, its fields as fields.toml declares them."""

    model_config = CLOSED

    def __init_subclass__(cls) -> None:
        """Join each field with its declaration; one that may be None is so by default."""
        declared = DECLARED_FIELDS[cls.__name__] if cls.__annotations__ else {}
        for name in declared:
            none = {"default": None} if "None" in cls.__annotations__[name] else {}
            setattr(cls, name, _declared(**none | declared[name]))


class Section(DeclaredModel):
    """A group of preset fields, read as each is declared."""

    @field_validator("*", mode="before")
    @classmethod
    def _read(cls, value: Any, info: ValidationInfo) -> Any:
        return read_value(cls.model_fields[str(info.field_name)], value)

    @classmethod
    def of_defaults(cls) -> Self:
        """The section where a preset leaves it out."""
        return cls.model_validate({})


def may_be_unknown(info: FieldInfo) -> bool:
    """Whether a field is unknown where a preset does not give it."""
    return bool(_extra(info).get(UNKNOWN))


def is_number(key: str) -> bool:
    """Whether a key of a table of limits is a finite number, such as a torque [N*m] (the other key is "all")."""
    return isfinite(number_of(key))


PerTorque = Annotated[dict[str, float], "limits"]
PerOrder = Annotated[dict[str, float], "orders"]


class UncertainReading(NamedTuple):
    """A measured value with its expanded uncertainty (k = 2), both in the unit of its field."""

    value: float
    uncertainty: float

    def __str__(self) -> str:
        return f"{self.value:g} ± {self.uncertainty:g}"


PerPosition = Annotated[dict[str, UncertainReading], "readings"]
WANTED_LISTS = {"numbers": "must be a list of numbers", "holes": "must be all, or a list of hole numbers"}
# of a table of values: pattern of its keys, their meaning, an example of a key, and of a table
KEYED_TABLES = {
    "limits": (NUMBER, "a torque in N*m, or all", "", ""),
    "orders": (rf"{UNSIGNED}(@{NUMBER})?", "an order per cam turn, or ORDER@TORQUE in N*m", "", "like {2: 10}"),
    "readings": (
        rf"(h[0-9]+|{NUMBER})@{NUMBER}", "a hole, or a turn in deg, at a torque in N*m",
        "like h4@80 or 120@80", "like {h0@80: 28.1 ± 1}",
    ),
}  # fmt: skip


def read_value(info: FieldInfo, value: Any) -> Any:
    """The value of a field in a preset, in the form that the field holds; where it cannot be read `InvalidValue`."""
    kind, unit = kind_of(info), unit_of(info)
    if isinstance(value, InvalidValue) or kind in ("text", "choice") or (value is None and is_optional(info)):
        return value
    if kind == "holes" and value == "all":
        return value
    if isinstance(value, str) and may_be_unknown(info):
        if value == UNKNOWN:
            return None
        if meant := near_miss(value, [UNKNOWN]):
            return InvalidValue("must be a number", meant)
    if value is None:
        required = f"in {unit}" if unit else ""
        hint = required if info.is_required() else f"leave the key out for its default, {info.default}"
        return InvalidValue("needs a value", hint)
    if kind in ("number", "count"):
        return read_measure(info, value, unit, spread=True)
    if kind in KEYED_TABLES:
        return _read_table(info, value)
    if isinstance(value, dict) or (kind == "holes" and isinstance(value, str)):
        return InvalidValue(WANTED_LISTS[kind])
    items = value if isinstance(value, list | tuple) else [value]
    if kind == "numbers":
        return tuple(read_measure(info, item, unit) for item in items)
    holes = tuple(map(read_count, items))
    unread = [
        InitErrorDetails(type="int_type", loc=(index,), input=hole)
        for index, hole in enumerate(holes)
        if isinstance(hole, InvalidValue)
    ]
    if unread:  # raised here, as pydantic would put the names of the types of a union into the place
        raise ValidationError.from_exception_data("holes", unread)
    return holes


def read_measure(info: FieldInfo, value: Any, unit: str, *, spread: bool = False) -> float | InvalidValue:
    """A number in a unit and in the range of a field; spread: a text of it may have an uncertainty."""
    number = read_count(value) if kind_of(info) == "count" else read_number(value, unit, spread=spread)
    if isinstance(number, InvalidValue) or in_range(info, number):
        return number
    hint = f"that is {number:g} {unit}" if isinstance(value, str) else ""
    return InvalidValue(f"out of range: {range_of(info, unit)}", hint)


def _read_table(info: FieldInfo, value: Any) -> Any:
    """A table of values by torque, order or position; a single limit is that of all torques."""
    kind = kind_of(info)
    pattern, expected, like_key, like_table = KEYED_TABLES[kind]
    read, unit = _read_reading if kind == "readings" else read_measure, unit_of(info)
    if not isinstance(value, dict):
        limit = InvalidValue("must be a table of keys", like_table) if like_table else read(info, value, unit)
        return limit if isinstance(limit, InvalidValue) else {"all": limit}
    table: dict[str, float | UncertainReading | InvalidValue] = {}
    known: set[tuple[float | str, ...]] = set()
    for key, item in value.items():
        numbers = [number_of(part.removeprefix("h")) for part in key.split("@")]
        meant = (key[:1] if kind == "readings" and key[:1] == "h" else "", *numbers)
        fits = re.fullmatch(pattern, key) and all(map(isfinite, numbers))
        if not (fits and all(numbers[kind == "readings" :])) and (kind, key) != ("limits", "all"):
            table[key] = InvalidValue(f"must be {expected}", like_key, at_key=True)
        elif meant in known:
            table[key] = InvalidValue("given twice", at_key=True)
        else:
            table[key] = read(info, item, unit)
        known.add(meant)
    return table


def _read_reading(info: FieldInfo, value: Any, unit: str) -> UncertainReading | InvalidValue:
    if isinstance(value, InvalidValue | UncertainReading):
        return value
    try:
        reading = UncertainReading(*read_spread(str(value), unit))
    except UnitError as error:
        return error
    if all(in_range(info, number) for number in reading):
        return reading
    return InvalidValue(f"out of range: value and uncertainty {range_of(info, unit)}")


def unit_of(info: FieldInfo) -> str:
    """Unit of a field as declared, empty for a pure number."""
    return str(_extra(info).get("unit", ""))


def _extra(info: FieldInfo) -> dict[str, Any]:
    """The declaration of a field beside its type, default and range."""
    return cast(dict[str, Any], info.json_schema_extra or {})


def kind_of(info: FieldInfo) -> FieldKind:
    """Kind of a field's value: a number, count, text, choice, several numbers, holes, limits, readings."""
    parts = (*info.metadata, info.annotation, *get_args(info.annotation))
    return next((KINDS[part] for part in parts if part in KINDS), "choice")


def is_optional(info: FieldInfo) -> bool:
    """Whether a field may be empty."""
    return type(None) in get_args(info.annotation)


def choices_of(info: FieldInfo) -> tuple[str, ...]:
    """Words that a field of the kind "choice" takes."""
    return tuple(map(str, get_args(info.annotation)))


def bounds_of(info: FieldInfo) -> dict[str, float]:
    """Bounds of a field, or of each item of it, as far as it has them: ge and le, in its range; gt, just out of it."""
    return dict(_extra(info).get("bounds", {}))


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
    if isinstance(value, bool | str | UncertainReading):
        return str(value)
    if isinstance(value, tuple):
        return f"[{', '.join(map(text_of, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {text_of(each)}' for key, each in value.items())}}}"
    return plain(value) if float(plain(value)) == value else repr(value)
