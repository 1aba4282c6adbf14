"""Fields of a preset: their kinds, the sections and the drive that they make, and the origin of each value.

fields.toml declares unit, range, default and meaning of each field. Numbers are in the unit of their field; the model
converts them. A deviation that a preset does not give is unknown, not zero.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from math import inf, isfinite
from typing import Annotated, Any, Literal, NamedTuple, Self, cast, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, PrivateAttr
from pydantic.fields import FieldInfo

from hdassist.plaintext import NUMBER, UNSIGNED, number_of
from hdassist.preset.units import read_count, read_number, read_spread
from hdassist.preset.yamltext import InvalidValueError, Path, near_miss

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


Part = Literal["g", "b", "h"]


class Tolerances(Section):
    """Deviations of the parts: first harmonics, as peak-to-peak for teeth and as offset for the cam."""


class Phases(Section):
    """Directions of the deviations at phi_h = phi_g = 0, counter-clockwise seen from the cam side."""


class Harmonics(Section):
    """Deviations of the teeth of higher order, along the pitch circle."""


@dataclass(frozen=True)
class Deviation:
    """A deviation of a part, by the paths of its size [um] and its direction [deg].

    kind: composite, the first harmonic of a wheel's teeth from peak to peak (F'_i); harmonic of the teeth, an
    amplitude; seat, a harmonic that the seat of the rigid wheel presses on it; cam, an offset of the cam; centre, an
    offset of a wheel's teeth. part: that it turns with, flexspline g, rigid wheel b or cam h; order: waves around it.
    """

    size: str
    direction: str
    kind: Literal["composite", "harmonic", "seat", "cam", "centre"]
    part: Part
    order: int = 1

    @property
    def name(self) -> str:
        """Name of the size within its section."""
        return self.size.split(".")[1]

    @property
    def stays_with_seat(self) -> bool:
        """Whether it stands still where the wheel that it belongs to is turned on its seat."""
        return self.kind in ("cam", "seat")


DEVIATIONS = tuple(Deviation(**each) for each in DECLARED_FIELDS["deviations"])
COMPOSITES = {each.part: each for each in DEVIATIONS if each.kind == "composite"}
CAM_OFFSETS = {each.part: each for each in DEVIATIONS if each.kind == "cam"}
DEVIATION_FIELDS = frozenset(path for each in DEVIATIONS for path in (each.size, each.direction))
# sizes, by wheel, that measured pitch deviations replace
IN_TEETH: dict[str, tuple[str, ...]] = {
    wheel: tuple(d.size for d in DEVIATIONS if d.part == wheel and d.kind in ("composite", "harmonic"))
    for wheel in COMPOSITES
}


PRESET_SCHEMA = "hdassist.preset/1"

# fields that presets had once, with a hint
REMOVED = {
    "alternatives": "no command reads them any more: leave them out",
    "acceptance.margin": "no margin any more: predictions are held by their probability, hdassist accept --sure",
    "numerics.window": "no flank window any more: every tooth that may touch is looked at",
}

# fields of numerics that identified values depend on, and the value of each before it was a field
IDENTIFIED_WITH: dict[str, str | int] = {"nominal_curve": "linear", "stations": 1}


class Gears(Section):
    """Teeth of the two wheels."""

    z_g: int
    z_b: int
    m: float
    alpha: float
    x_g: float
    x_b: float
    h_a: float
    h_f: float
    j_n: float

    @property
    def pitch_diameter(self) -> float:
        """Pitch diameter of the flexspline [mm]."""
        return self.m * self.z_g

    @property
    def root_radius(self) -> float:
        """Radius of the root of the flexspline's teeth [mm]."""
        return self.m * (self.z_g + 2 * self.x_g - 2 * self.h_f) / 2


class Material(Section):
    """Material of the flexspline, of the cam and of its bearing."""

    E: float
    nu: float
    alpha_T: float


class Flexspline(Section):
    """Rim under the teeth and the shell behind it."""

    h_1: float
    h_3: float
    b_w: float
    l: float
    k_t: float


class Bearing(Section):
    """Flexible bearing between flexspline and cam."""

    N: int
    ring_b: float
    ring_h: float
    d_ball: float | None
    g_b: float
    ball_motion: Literal["locked", "rolling"]
    beta: float


class Cam(Section):
    """Wave generator."""

    W_0: float
    coupling: Literal["solid", "oldham", "overhung", "unknown"]
    shaft_d: float | None
    overhang: float | None


class Supports(Section):
    """Radial stiffness of the supports of the bodies; 0 leaves the body free, anything else is 1 N/mm or more."""

    C_1: float
    C_2: float
    C_3: float | None


class Contact(Section):
    """Local compliance of the contacts."""

    c_t: float
    k_face: float
    c_ball: float
    c_bore: float


class Mounting(Section):
    """How the drive is built in."""

    fixed: Literal["rigid", "flexspline"]
    mark_kind: Literal["xi", "runout", "pitch"]
    holes: int
    first_hole: float
    allowed: Annotated[Literal["all"] | tuple[int, ...], "holes"]


class Operation(Section):
    """Load."""

    M_g: Annotated[tuple[float, ...], "numbers"]
    rated: float | None
    dT: float


class Catalogue(Section):
    """Catalogue values of the drive: shown beside the model's figures, and no limit."""

    K_1: float | None
    K_2: float | None
    K_3: float | None
    T_1: float | None
    T_2: float | None
    lost_motion: float | None
    play: float | None
    accuracy: float | None


class Measured(Section):
    """Values measured on this drive; +- is its expanded uncertainty (k = 2). It weighs uncertain inputs."""

    F_ior: PerPosition


class Acceptance(Section):
    """Limits, and the rule that decides."""

    F_ior: PerTorque
    turn_range: PerTorque
    self_error: PerTorque
    order_amplitude: PerOrder
    rule: Literal["guard", "simple"]


class Numerics(Section):
    """Resolution of the model."""

    n_max: int
    n_2: int
    nominal_curve: Literal["linear", "inextensible"]
    stations: int
    n_beta: int
    n_phase: int


class Source(Section):
    """Where a value comes from."""

    kind: Literal["given", "assumed", "identified"]
    ref: str
    range: Annotated[tuple[float, float] | None, "numbers"]


class CostLaw(Section):
    """Cost of a tolerance: share at the value that the preset gives, and 1/tolerance^k of it at others."""

    share: float
    k: float
    least: float | None


BY_PATH: dict[str, type[Section]] = {"source": Source, "cost": CostLaw}  # tables whose keys are paths of fields
PATH_TABLES = ("uncertainty", "fit", *BY_PATH)  # all of them


@dataclass(frozen=True)
class Origin:
    """Where a drive was read: file as named by the user, SHA-256 of its bytes, overrides on top.

    asked: other options that the user gave, by name, which a next command on the drive is to have too.
    """

    file: str = ""
    sha256: str = ""
    overrides: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    asked: tuple[tuple[str, str], ...] = ()


class Drive(Section):
    """A strain wave drive as a preset describes it."""

    name: OneLine
    description: str
    gears: Gears
    material: Material = Material.of_defaults()
    flexspline: Flexspline
    bearing: Bearing
    cam: Cam
    supports: Supports
    contact: Contact = Contact.of_defaults()
    tolerances: Tolerances = Tolerances.of_defaults()
    phases: Phases = Phases.of_defaults()
    harmonics: Harmonics = Harmonics.of_defaults()
    uncertainty: dict[str, float]
    fit: dict[str, tuple[float, ...]]
    mounting: Mounting = Mounting.of_defaults()
    operation: Operation
    catalogue: Catalogue = Catalogue.of_defaults()
    measured: Measured = Measured.of_defaults()
    acceptance: Acceptance = Acceptance.of_defaults()
    numerics: Numerics = Numerics.of_defaults()
    cost: dict[str, CostLaw]
    source: dict[str, Source]

    _origin: Origin = PrivateAttr(default=Origin())

    @property
    def origin(self) -> Origin:
        """Where the drive was read."""
        return self._origin

    def limit(self, torque: float) -> float | None:
        """Limit of F'_ior [arcsec] at a torque [N*m]; None where none is set."""
        limits = self.acceptance.F_ior
        return next((value for key, value in limits.items() if number_of(key) == torque), limits.get("all"))

    def value(self, path: str) -> Any:
        """Value of a field, by path ("gears.j_n")."""
        section, name = path.split(".")
        return getattr(getattr(self, section), name)

    @property
    def unused_tooth_field(self) -> str:
        """Path of the stiffness of tooth pairs that has no effect with the drive's number of stations."""
        return "contact.k_face" if self.numerics.stations == 1 else "contact.c_t"

    def number(self, path: str) -> float:
        """Value of a field that holds a number, by path; 0 where it is not known."""
        return float(self.value(path) or 0.0)

    def allows(self, path: str, value: float) -> bool:
        """Whether a value is within the range of a field, by path ("gears.j_n")."""
        return in_range(field_table()[path], value)

    def with_values(self, values: Mapping[str, float]) -> Drive:
        """The drive with some fields changed, by path ("gears.j_n"); the new values are not validated."""
        changed: dict[str, Section] = {}
        for path, value in values.items():
            section, name = path.split(".")
            changed[section] = changed.get(section, getattr(self, section)).model_copy(update={name: value})
        return self.model_copy(update=changed)


def sections() -> Iterator[tuple[str, type[Section]]]:
    """Name and class of each section of a preset, in the order they are written."""
    for name, info in Drive.model_fields.items():
        if isinstance(info.annotation, type) and issubclass(info.annotation, Section):
            yield name, info.annotation


@cache
def field_table() -> dict[str, FieldInfo]:
    """Path ("gears.z_g") and declaration of each field that stands in a section."""
    return {f"{section}.{name}": info for section, model in sections() for name, info in model.model_fields.items()}


@cache
def measures() -> dict[str, FieldInfo]:
    """Path and declaration of each field that holds a single number, and so may have an uncertainty."""
    return {path: info for path, info in field_table().items() if kind_of(info) == "number"}


@cache
def deviation_sizes() -> tuple[str, ...]:
    """Paths of the sizes of deviations, which are tolerances where drives are drawn."""
    return tuple(path for path in field_table() if path.startswith(("tolerances.", "harmonics.a_")))


def path_of(key: str) -> Path:
    """Path that the key of an override sets; keys of `uncertainty`, `fit`, `source` and `cost` have a dot in them."""
    parts = [part.strip() for part in key.split(".")]
    if parts[0] in PATH_TABLES:
        return tuple(filter(None, (parts[0], ".".join(parts[1:3]), *parts[3:])))
    return (*parts[:2], ".".join(parts[2:])) if len(parts) > 2 else tuple(parts)


def is_overridden(path: str, overrides: Sequence[str]) -> bool:
    """Whether overrides set a field ("gears.z_g"), a table around it or an entry of it."""
    field = tuple(path.split("."))
    paths = [path_of(text.partition("=")[0]) for text in overrides]
    return any(p[: len(field)] == field[: len(p)] for p in paths)


@dataclass(frozen=True)
class ResolvedField:
    """One field of a drive: path, value in its unit, kind of origin, reference, meaning, plausible range in its unit.

    Kinds: given, assumed, identified (by `source`; given without one), default, override; unknown, with a value of
    None.
    """

    path: str
    value: Any
    unit: str
    kind: str
    ref: str
    meaning: str
    range: tuple[float, float] | None

    @property
    def reference(self) -> str:
        """Where the value comes from, its plausible range first."""
        bounds = " to ".join(map(value_text, self.range or ()))
        return "; ".join(filter(None, (bounds, self.ref)))


def resolved_fields(drive: Drive) -> list[ResolvedField]:
    """Rows for every field of a drive that stands in a section, in the order of the declarations."""
    rows = []
    for path, info in field_table().items():
        section, name = path.split(".")
        table, value, source = getattr(drive, section), drive.value(path), drive.source.get(path)
        kind, ref, bounds = (str(source.kind), source.ref, source.range) if source else ("given", "", None)
        if is_overridden(path, drive.origin.overrides):
            kind, ref, bounds = "override", "--set", None
        elif may_be_unknown(info) and value is None:
            kind, ref, bounds = UNKNOWN, "", None
        elif name not in table.model_fields_set:
            kind = "default"
        rows.append(ResolvedField(path, value, unit_of(info), kind, ref, str(info.description), bounds))
    return rows


def origin_counts(drive: Drive) -> dict[str, int]:
    """Numbers of fields that are given, identified and assumed in a preset."""
    kinds = [row.kind for row in resolved_fields(drive)]
    return {kind: kinds.count(kind) for kind in ("given", "identified", "assumed")}


def value_text(value: Any) -> str:
    """A value as a preset has it, without brackets; a dash where there is none."""
    return "-" if value is None else text_of(value).strip("[]{}") or "-"
