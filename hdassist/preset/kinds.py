"""Kinds of fields of a preset: declaring them, reading their values, their units and bounds."""

from __future__ import annotations

import tomllib
from importlib.resources import files
from math import inf, isfinite
from typing import Annotated, Any, Literal, NamedTuple, Self, cast, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic.fields import FieldInfo

from hdassist.numerals import NUMBER, UNSIGNED, number_of
from hdassist.preset.units import read_count, read_number, read_spread
from hdassist.preset.yamltext import InvalidValueError, near_miss

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


MAX_NAME = 200  # characters of a drive's name
OneLine = Annotated[str, AfterValidator(_one_line)]  # of a name: with a line break it could forge a line of a report


UNKNOWN = "unknown"  # written in a preset in place of a value
DECLARED_FIELDS: dict[str, Any] = tomllib.loads(files("hdassist.preset").joinpath("fields.toml").read_text("utf-8"))


def _declared(meaning: str, unit: str = "", default: Any = ..., *, unknown: bool = False, **bounds: float) -> Any:
    """A field as fields.toml declares it: meaning, unit, default (none: required), whether it may be unknown, range."""
    extra: dict[str, Any] = {"unit": unit, UNKNOWN: unknown, "bounds": bounds}
    return Field(default, description=meaning, json_schema_extra=extra)


class Section(BaseModel):
    """A part of a preset: immutable, closed, its fields as fields.toml declares them."""

    model_config = CLOSED

    def __init_subclass__(cls) -> None:
        """Join each field, without a type a number or None, with its declaration; what may be None is so by default."""
        declared = DECLARED_FIELDS[cls.__name__]
        if declared.keys() > cls.__annotations__.keys():
            cls.__annotations__ = {name: cls.__annotations__.get(name, "float | None") for name in declared}
        for name in declared:
            none = {"default": None} if "None" in cls.__annotations__[name] else {}
            setattr(cls, name, _declared(**none | declared[name]))

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
    """The value of a field in a preset as the field holds it; of several values the list or table of their texts.

    Raises InvalidValueError: it cannot be read.
    """
    kind, unit = kind_of(info), unit_of(info)
    if kind == "choice":
        if value not in (choices := choices_of(info)):
            raise InvalidValueError(f"must be one of {', '.join(choices)}", near_miss(str(value), choices))
    elif kind == "text":
        if not isinstance(value, str):
            raise InvalidValueError("must be text", "put it in quotes" if isinstance(value, int | float) else "")
        if info.metadata and not ("\n" not in value and 1 <= len(value) <= MAX_NAME):
            words = f"must be one line of 1 to {MAX_NAME} characters"
            raise InvalidValueError(words, "what is longer stands in description" * bool(value))
    elif value is None:
        if not is_optional(info):
            required = f"in {unit}" if unit else ""
            hint = required if info.is_required() else f"leave the key out for its default, {info.default}"
            raise InvalidValueError("needs a value", hint)
    elif isinstance(value, str) and may_be_unknown(info) and (meant := near_miss(value, [UNKNOWN])):
        if value != UNKNOWN:
            raise InvalidValueError("must be a number", meant)
        return None
    elif kind in ("number", "count"):
        return read_measure(info, value, unit)
    elif kind in KEYED_TABLES:
        if not isinstance(value, dict) and (like_table := KEYED_TABLES[kind][3]):
            raise InvalidValueError("must be a table of keys", like_table)
        return value if isinstance(value, dict) else {"all": value}
    elif kind == "numbers" or value != "all":
        if isinstance(value, dict) or (kind == "holes" and isinstance(value, str)):
            raise InvalidValueError(WANTED_LISTS[kind])
        return value if isinstance(value, list) else [value]
    return value


def read_measure(info: FieldInfo, value: Any, unit: str) -> float:
    """A number in a unit and in the range of a field; its text may have an uncertainty where the field is a single one.

    Raises InvalidValueError for any other.
    """
    kind = kind_of(info)
    number = read_count(value) if kind in ("count", "holes") else read_number(value, unit, spread=kind == "number")
    if not in_range(info, number):
        hint = f"that is {number:g} {unit}" if isinstance(value, str) else ""
        raise InvalidValueError(f"out of range: {range_of(info, unit)}", hint)
    return number


def read_reading(info: FieldInfo, value: Any, unit: str) -> UncertainReading:
    """A measured value with its uncertainty, in a unit and the range of a field; InvalidValueError for any other."""
    reading = UncertainReading(*read_spread(str(value), unit))
    if not all(in_range(info, number) for number in reading):
        raise InvalidValueError(f"out of range: value and uncertainty {range_of(info, unit)}")
    return reading


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
