"""Fields of a preset: their kinds, the sections and the drive formed by them, and the origin of each value.

fields.toml declares the unit, range, default and meaning of each field. Numbers are in the unit of their field; the
model converts them. A deviation that a preset does not state is unknown, not zero. The module contains all of these
because they depend on each other: kinds check the values of sections, sections are built from kinds, and a drive from
sections.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from math import inf, isfinite
from typing import Annotated, Any, Literal, NamedTuple, Self, get_args, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import InitErrorDetails

from hdassist.drive.preset.text import InvalidValueError, Path, near_miss, read_count, read_number, read_spread
from hdassist.run.files import NUMBER, UNSIGNED, number_of, package_table

_CLOSED = ConfigDict(
    frozen=True,
    extra="forbid",
    strict=True,
    allow_inf_nan=False,
)
UNKNOWN = "unknown"  # word in a preset for an unknown value
_DECLARED_FIELDS: dict[str, Any] = package_table("drive/preset/fields.toml")


class Section(BaseModel):
    """A part of a preset: immutable, without undeclared keys, with the fields declared in fields.toml."""

    model_config = _CLOSED

    def __init_subclass__(cls) -> None:
        """Set the default of each field (None if allowed), and the type "number or None" of fields without a type."""
        declared = _DECLARED_FIELDS[cls.__name__]
        if declared.keys() > cls.__annotations__.keys():
            cls.__annotations__ = {name: cls.__annotations__.get(name, "float | None") for name in declared}
        for name in declared:
            if "None" in cls.__annotations__[name] or "default" in declared[name]:
                setattr(cls, name, declared[name].get("default"))

    @field_validator("*", mode="wrap")
    @classmethod
    def _read(
        cls,
        value: Any,
        validated: ValidatorFunctionWrapHandler,
        info: ValidationInfo,
    ) -> Any:
        """Return a validated value.

        If there is a context, the value is read in the notation of a preset and added to the context by path.
        """
        if info.context is None:
            return validated(value)
        name = str(info.field_name)
        read = validated(cls.declared()[name].read(value))
        info.context[f"{cls.__name__.lower()}.{name}"] = read
        return read

    @classmethod
    @cache
    def declared(cls) -> Mapping[str, PresetField]:
        """Return the declaration of each field, by name."""
        of_class = _DECLARED_FIELDS[cls.__name__]
        return {name: PresetField.of(info, **of_class.get(name, {})) for name, info in cls.model_fields.items()}

    @classmethod
    def of_defaults(cls) -> Self:
        """Return the section for a preset that omits it."""
        return cls.model_validate({})


MAX_NAME = 200  # maximum length of a drive's name


def _one_line(text: str) -> str:
    if "\n" in text:
        raise ValueError("must be a single line")
    return text


class _UncertainReading(NamedTuple):
    """A measured value with its expanded uncertainty (k = 2), both in the unit of its field."""

    value: float
    uncertainty: float

    def __str__(self) -> str:
        return f"{self.value:g} ± {self.uncertainty:g}"


FieldKind = Literal[
    "number",
    "count",
    "text",
    "line",
    "choice",
    "numbers",
    "range",
    "holes",
    "limits",
    "orders",
    "readings",
    "uncertainty",
    "fit",
    "source",
    "table",
]
# annotations of fields whose kind does not follow from the type of their values
# OneLine is a single line, because a line break in a name could forge a line of a report
OneLine = Annotated[str, AfterValidator(_one_line), "line"]
PerTorque = Annotated[dict[str, float], "limits"]
PerOrder = Annotated[dict[str, float], "orders"]
_PerPosition = Annotated[dict[str, _UncertainReading], "readings"]
KINDS: dict[Any, FieldKind] = {float: "number", int: "count", str: "text"}
_WANTED_LISTS = {"numbers": "must be a list of numbers", "holes": "must be all, or a list of hole numbers"}
# for each kind of table: pattern of its keys, their meaning, an example of a key, and an example of a table
KEYED_TABLES = {
    "limits": (NUMBER, "a torque in N*m, or all", "", ""),
    "orders": (
        rf"{UNSIGNED}(@{NUMBER})?",
        "an order per input revolution, or ORDER@TORQUE in N*m",
        "",
        "for example {2: 10}",
    ),
    "readings": (
        rf"(h[0-9]+|{NUMBER})@{NUMBER}",
        "a hole or an angle in deg, at a torque in N*m",
        "for example h4@80 or 120@80",
        "for example {h0@80: 28.1 ± 1}",
    ),
}


@dataclass(frozen=True)
class PresetField:
    """Declaration of a field of a preset.

    meaning: meaning of the field.
    unit: unit, empty for a pure number.
    default: default value, None if there is none.
    unknown: whether the value may be unknown.
    ge, gt, le: range of the field or of each of its items: at least ge, above gt, up to le.
    kind: kind of its value.
    choices: valid values of a choice.
    is_optional: whether its value may be None.
    is_required: whether a preset must state the field.
    question: question to the manufacturer, for the most important fields.
    how: instructions for measuring it, for the most important fields.
    """

    meaning: str = ""
    unit: str = ""
    default: Any = None
    unknown: bool = False
    ge: float = -inf
    gt: float = -inf
    le: float = inf
    kind: FieldKind = "number"
    choices: tuple[str, ...] = ()
    is_optional: bool = False
    is_required: bool = False
    question: str = ""
    how: str = ""

    @classmethod
    def of(cls, info: FieldInfo, **declared: Any) -> PresetField:
        """Return the declaration of a field of a model."""
        parts = get_args(info.annotation)
        kinds = (KINDS.get(part, part) for part in (*info.metadata, info.annotation, *parts))
        named = next((kind for kind in kinds if isinstance(kind, str)), "table")
        kind = "choice" if get_origin(info.annotation) is Literal else named
        about = {"kind": kind, "choices": tuple(map(str, parts)), "is_optional": type(None) in parts}
        return cls(**declared | about | {"default": info.get_default(), "is_required": info.is_required()})

    def read(self, value: Any) -> Any:
        """Return the field's value from a value in a preset.

        The items of a table keyed by paths are read by the fields with these paths.

        Raises InvalidValueError if the value cannot be read.
        Raises ValidationError if items cannot be read.
        """
        if self.kind == "range":
            path, ends = value
            return field_table()[path].bounds(ends)
        if self.kind == "choice":
            self._require_choice(value)
            return value
        if self.kind in ("text", "line"):
            self._require_text(value)
            return value
        if value is None:
            self._require_optional()
            return None
        if isinstance(value, str) and self.unknown and (near_word := near_miss(value, [UNKNOWN])):
            if value != UNKNOWN:
                raise InvalidValueError("must be a number", near_word)
            return None
        if self.kind in ("number", "count"):
            return self.number(value)
        if self.kind in KEYED_TABLES:
            return self._keyed_table(value)
        if self.kind == "numbers" or (self.kind == "holes" and value != "all"):
            return self._numbers(value)
        if self.kind in ("uncertainty", "fit", "source") and isinstance(value, dict):
            return _read_items(value, self._by_path)
        return value

    def _require_choice(self, value: Any) -> None:
        """Raise InvalidValueError for a value that is not one of the choices."""
        if value not in self.choices:
            message = f"must be one of {', '.join(self.choices)}"
            raise InvalidValueError(message, near_miss(str(value), self.choices))

    def _require_text(self, value: Any) -> None:
        """Raise InvalidValueError for a value that is not text, or not one line of valid length if one is required."""
        if not isinstance(value, str):
            raise InvalidValueError("must be text", "put it in quotes" if isinstance(value, int | float) else "")
        if self.kind == "line" and ("\n" in value or not 1 <= len(value) <= MAX_NAME):
            message = f"must be one line of 1 to {MAX_NAME} characters"
            raise InvalidValueError(message, "put a longer text in the field description" if value else "")

    def _require_optional(self) -> None:
        """Raise InvalidValueError unless the value may be None."""
        if self.is_optional:
            return
        if self.is_required:
            hint = f"write a number in {self.unit}" if self.unit else ""
        else:
            hint = f"leave out the key to use its default, {self.default}"
        raise InvalidValueError("needs a value", hint)

    def _keyed_table(self, value: Any) -> dict[str, Any]:
        """Return the entries of a table; if a single value is allowed and given, it is the entry for all keys."""
        if not isinstance(value, dict):
            like_table = KEYED_TABLES[self.kind][3]
            if like_table:
                raise InvalidValueError("must be a table of keys", like_table)
            value = {"all": value}
        seen_entries = set[tuple[object, ...]]()
        return _read_items(value, partial(self._entry, seen_entries))

    def _numbers(self, value: Any) -> tuple[float, ...]:
        """Return the numbers of a list, or a single number as a tuple."""
        if isinstance(value, dict) or (self.kind == "holes" and isinstance(value, str)):
            raise InvalidValueError(_WANTED_LISTS[self.kind])
        items = enumerate(value if isinstance(value, list) else [value])
        return tuple(_read_items(dict(items), lambda _, item: self.number(item)).values())

    def _by_path(self, path: str, entry: Any) -> Any:
        """Return the value of an entry in a table keyed by paths. A range in source is returned with its path."""
        if self.kind == "uncertainty":
            return self.number(entry, field_table()[path].unit)
        if self.kind == "fit":
            return field_table()[path].draws(entry)
        has_range = isinstance(entry, dict) and entry.get("range") is not None
        return entry | {"range": (path, entry["range"])} if has_range else entry

    def _entry(
        self,
        known: set[tuple[object, ...]],
        key: str,
        value: Any,
    ) -> float | _UncertainReading:
        """Return the value of a table entry, and add its key to the known keys.

        known: keys already read.
        key: key of the entry.
        value: value in the preset.
        Raises InvalidValueError if the key is invalid or repeated.
        """
        pattern, expected, like_key, _ = KEYED_TABLES[self.kind]
        numbers = [number_of(part.removeprefix("h")) for part in key.split("@")]
        fits = re.fullmatch(pattern, key) and all(map(isfinite, numbers)) and all(numbers[self.kind == "readings" :])
        if not fits and (self.kind, key) != ("limits", "all"):
            raise InvalidValueError(f"must be {expected}", like_key, at_key=True)
        if (meant := (key[:1] == "h", *numbers)) in known:
            raise InvalidValueError("the key is given twice", "keep one of the two entries", at_key=True)
        known.add(meant)
        return self.reading(value) if self.kind == "readings" else self.number(value)

    def number(self, value: Any, unit: str | None = None) -> float:
        """Return a number in a unit, after checking the range of the field.

        A text may include an uncertainty if the field is a single number.

        value: number, or text with a unit.
        unit: unit of the result, None for that of the field.
        Raises InvalidValueError if the value is not such a number.
        """
        unit = self.unit if unit is None else unit
        is_count = self.kind in ("count", "holes")
        number = read_count(value) if is_count else read_number(value, unit, spread=self.kind == "number")
        if not self.holds(number):
            hint = f"that is {number:g} {unit}" if isinstance(value, str) else ""
            raise InvalidValueError(f"must be {self._requirement(unit)}", hint)
        return number

    def reading(self, value: Any) -> _UncertainReading:
        """Return a measured value with its uncertainty. Raises InvalidValueError if one is invalid or out of range."""
        reading = _UncertainReading(*read_spread(str(value), self.unit))
        if not all(map(self.holds, reading)):
            raise InvalidValueError(f"the value and its uncertainty must both be {self._requirement(self.unit)}")
        return reading

    def draws(self, values: Any) -> tuple[float, ...]:
        """Return equally likely values of the field. Raises InvalidValueError if they are invalid or out of range."""
        if not isinstance(values, list) or len(values) < 2:
            raise InvalidValueError(
                "must be two or more numbers, beginning with the preset's own value",
                "write them in brackets, as in [8950, 9020]",
            )
        values_of_draws = tuple(read_number(value, self.unit) for value in values)
        if beyond := [value for value in values_of_draws if not self.holds(value)]:
            raise InvalidValueError(f"each value must be {self._requirement(self.unit)}, not {plain(beyond[0])}")
        return values_of_draws

    def bounds(self, ends: Any) -> tuple[float, float]:
        """Return the ends of a plausible range of the field. Raises InvalidValueError if the range is invalid."""
        if self.kind != "number":
            raise InvalidValueError("only a field with a single number can have a range")
        if not isinstance(ends, list) or len(ends) != 2:
            raise InvalidValueError(
                "must be two numbers, the smaller one first", "write them in brackets, as in [0, 20]"
            )
        low, high = (read_number(end, self.unit) for end in ends)
        if not (self.holds(low) and self.holds(high)):
            raise InvalidValueError(f"both ends must be {self._requirement(self.unit)}")
        if low >= high:
            raise InvalidValueError("the smaller number must be first")
        return low, high

    def holds(self, value: float) -> bool:
        """Return whether a number is within the range of the field."""
        return isfinite(value) and self.gt < value <= self.le and value >= self.ge

    def _requirement(self, unit: str) -> str:
        """Return the requirement of the range, as the end of a sentence that begins with "must be"."""
        range_text = self.range_words(unit)
        return f"from {range_text}" if self.gt == -inf and self.le < inf else range_text

    def range_words(self, unit: str = "") -> str:
        """Return a description of the range of the field or of its items, with the unit, empty if there is no range."""
        low = f"above {plain(self.gt)}, up" if self.gt > -inf else plain(self.ge) if self.ge > -inf else ""
        if self.le < inf:
            return f"{low} to {plain(self.le)} {unit}".rstrip()
        return f"{low} {unit}".rstrip() + " or more" if low else ""


def _read_items(items: Mapping[Any, Any], read: Callable[[Any, Any], Any]) -> dict[Any, Any]:
    """Return the items of a table or list by key, each converted by a function of its key and value.

    Raises ValidationError that lists all faults.
    """
    values = {}
    faults = list[InitErrorDetails]()
    for key, item in items.items():
        try:
            values[key] = read(key, item)
        except InvalidValueError as fault:
            faults.append({"type": "value_error", "loc": (key,), "input": item, "ctx": {"error": fault}})
    if faults:
        raise ValidationError.from_exception_data("items", faults)
    return values


def is_number(key: str) -> bool:
    """Return whether a key in a table of limits is a finite number, such as a torque [N*m], rather than "all"."""
    return isfinite(number_of(key))


def plain(number: float) -> str:
    """Return a number in the notation of a preset: 20, 0.05, 1e7."""
    return f"{number:g}".replace("e+0", "e").replace("e+", "e").replace("e-0", "e-")


def short(number: float) -> str:
    """Return a number in the notation of a preset, rounded to four significant digits."""
    return plain(float(f"{number:.4g}"))


def text_of(value: Any) -> str:
    """Return a value in the notation of a preset, with as many digits as needed to be exact."""
    if value is None:
        return UNKNOWN
    if isinstance(value, bool | str | _UncertainReading):
        return str(value)
    if isinstance(value, tuple):
        return f"[{', '.join(map(text_of, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {text_of(item)}' for key, item in value.items())}}}"
    return plain(value) if float(plain(value)) == value else repr(value)


# --- deviations of the parts

Part = Literal["g", "b", "h"]


class Tolerances(Section):
    """Deviations of the parts: peak to peak of first harmonics for teeth, eccentricity for the wave generator."""


class Phases(Section):
    """Directions of the deviations at phi_h = phi_g = 0, counter-clockwise, seen from the wave generator side."""


class Harmonics(Section):
    """Higher-order deviations of the teeth along the pitch circle."""


@dataclass(frozen=True)
class Deviation:
    """A deviation of a part.

    size: path of its size [um].
    direction: path of its direction [deg].
    kind: composite, the peak-to-peak first harmonic of a wheel's teeth (F'_i); harmonic, the amplitude of a harmonic of
    the teeth; pitch, an order of the deviations of single teeth, whose size is the largest single pitch deviation;
    seat, a harmonic that the housing seat impresses on the circular spline; cam, an eccentricity of the wave generator;
    centre, an eccentricity of a wheel's teeth.
    part: part with which it rotates: flexspline g, circular spline b or wave generator h.
    order: number of waves around the part.
    """

    size: str
    direction: str
    kind: Literal["composite", "harmonic", "pitch", "seat", "cam", "centre"]
    part: Part
    order: int = 1

    @property
    def name(self) -> str:
        """The name of the size within its section."""
        return self.size.split(".")[1]

    @property
    def stays_with_seat(self) -> bool:
        """Whether it keeps its position if its wheel is turned on the seat."""
        return self.kind in ("cam", "seat")


DEVIATIONS = tuple(Deviation(**row) for row in _DECLARED_FIELDS["deviations"])
COMPOSITES = {deviation.part: deviation for deviation in DEVIATIONS if deviation.kind == "composite"}
CAM_OFFSETS = {deviation.part: deviation for deviation in DEVIATIONS if deviation.kind == "cam"}
DEVIATION_FIELDS = frozenset(path for deviation in DEVIATIONS for path in (deviation.size, deviation.direction))
# paths of the sizes that measured pitch deviations replace, by wheel
IN_TEETH: dict[str, tuple[str, ...]] = {
    wheel: tuple(
        dict.fromkeys(d.size for d in DEVIATIONS if d.part == wheel and d.kind in ("composite", "harmonic", "pitch"))
    )
    for wheel in COMPOSITES
}


# --- sections and the drive

PRESET_SCHEMA = "hdassist.preset/1"

# removed fields of presets, with a hint
REMOVED = {
    "alternatives": "leave it out; commands no longer read it",
    "acceptance.margin": "leave it out; predictions are decided by their probability, see hdassist accept --sure",
    "numerics.window": "leave it out; every tooth that may touch is included",
}

# fields of numerics on which identified values depend, and the fixed value of each before the field existed
IDENTIFIED_WITH: dict[str, str | int] = {"nominal_curve": "linear", "stations": 1}


class Gears(Section):
    """Teeth of the two splines."""

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
        """The pitch diameter of the flexspline [mm]."""
        return self.m * self.z_g

    @property
    def root_radius(self) -> float:
        """The root radius of the flexspline's teeth [mm]."""
        return self.m * (self.z_g + 2 * self.x_g - 2 * self.h_f) / 2


class Material(Section):
    """Material of the flexspline, of the wave generator and of its bearing."""

    E: float
    nu: float
    alpha_T: float


class Flexspline(Section):
    """Rim under the teeth, and the adjoining shell."""

    h_1: float
    h_3: float
    b_w: float
    l: float
    k_t: float


class Bearing(Section):
    """Flexible bearing between flexspline and wave generator."""

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
    """Radial support stiffnesses. 0 means no support, and any other value must be at least 1 N/mm."""

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
    """Installation of the drive."""

    fixed: Literal["rigid", "flexspline"]
    mark_kind: Literal["xi", "runout", "pitch"]
    holes: int
    first_hole: float
    allowed: Annotated[Literal["all"] | tuple[int, ...], "holes"]


class Operation(Section):
    """Load and temperature."""

    M_g: Annotated[tuple[float, ...], "numbers"]
    rated: float | None
    dT: float


class Catalogue(Section):
    """Catalogue values of the drive. They are shown next to the values of the model, and are not limits."""

    K_1: float | None
    K_2: float | None
    K_3: float | None
    T_1: float | None
    T_2: float | None
    lost_motion: float | None
    play: float | None
    accuracy: float | None
    accuracy_test: Literal["unstated", "full_revolution", "12_positions", "typical"]


class Measured(Section):
    """Values measured on this drive. +- is the expanded uncertainty (k = 2). The values weight uncertain inputs."""

    F_ior: _PerPosition


class Acceptance(Section):
    """Limits and decision rule."""

    F_ior: PerTorque
    turn_range: PerTorque
    self_error: PerTorque
    order_amplitude: PerOrder
    travel: float
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
    """Origin of a value."""

    kind: Literal["given", "assumed", "identified"]
    ref: str
    range: Annotated[tuple[float, float] | None, "range"]


class CostLaw(Section):
    """Cost of a tolerance: share at the value in the preset, scaled by 1/tolerance^k at other values."""

    share: float
    k: float
    least: float | None


BY_PATH: dict[str, type[Section]] = {"source": Source, "cost": CostLaw}  # tables whose keys are paths of fields
PATH_TABLES = ("uncertainty", "fit", *BY_PATH)  # all tables whose keys are paths


class AskedOption(NamedTuple):
    """An option given by the user: its command, the name of its field, and its text as typed."""

    command: str
    field: str
    text: str


@dataclass(frozen=True)
class Origin:
    """Origin of a drive.

    file: file as named by the user.
    sha256: checksum of its bytes.
    overrides: overrides applied to it.
    warnings: warnings on the preset.
    asked: other options given by the user, which suggested commands for the drive repeat.
    M_g: torques [N*m] of operation.M_g in the file if an override replaces them; empty otherwise.
    """

    file: str = ""
    sha256: str = ""
    overrides: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    asked: tuple[AskedOption, ...] = ()
    M_g: tuple[float, ...] = ()


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
    uncertainty: Annotated[dict[str, float], "uncertainty"]
    fit: Annotated[dict[str, tuple[float, ...]], "fit"]
    mounting: Mounting = Mounting.of_defaults()
    operation: Operation
    catalogue: Catalogue = Catalogue.of_defaults()
    measured: Measured = Measured.of_defaults()
    acceptance: Acceptance = Acceptance.of_defaults()
    numerics: Numerics = Numerics.of_defaults()
    cost: Annotated[dict[str, CostLaw], "table"]
    source: Annotated[dict[str, Source], "source"]

    _origin: Origin = PrivateAttr(default=Origin())

    @property
    def origin(self) -> Origin:
        """The origin of the drive."""
        return self._origin

    def limit(self, torque: float) -> float | None:
        """Return the limit of F'_ior [arcsec] at a torque [N*m], or None if there is none."""
        limits = self.acceptance.F_ior
        return next((value for key, value in limits.items() if number_of(key) == torque), limits.get("all"))

    def value(self, path: str) -> Any:
        """Return the value of a field, by path ("gears.j_n")."""
        section, name = path.split(".")
        return getattr(getattr(self, section), name)

    @property
    def rated_torque(self) -> float:
        """The rated torque [N*m], or the largest torque in the file if the preset has no rated torque.

        The torques of a single command do not replace those of the file, so quantities defined by shares of the rated
        torque, such as the lost motion, do not change.
        """
        if self.operation.rated is not None:
            return self.operation.rated
        return max(abs(M_g) for M_g in self.origin.M_g or self.operation.M_g)

    @property
    def unused_tooth_field(self) -> str:
        """The path of the tooth-pair stiffness that has no effect with the drive's number of stations."""
        return "contact.k_face" if self.numerics.stations == 1 else "contact.c_t"

    def number(self, path: str) -> float:
        """Return the value of a numeric field, by path, or 0 if it is unknown."""
        return float(self.value(path) or 0.0)

    def allows(self, path: str, value: float) -> bool:
        """Return whether a value is within the range of a field, by path ("gears.j_n")."""
        return field_table()[path].holds(value)

    def with_values(self, values: Mapping[str, Any]) -> Drive:
        """Return the drive with new values of some fields, given by path ("gears.j_n"). They are not validated."""
        changed: dict[str, Section] = {}
        for path, value in values.items():
            section, name = path.split(".")
            changed[section] = changed.get(section, getattr(self, section)).model_copy(update={name: value})
        return self.model_copy(update=changed)


# --- fields by path, and the origin of each value


def sections() -> Iterator[tuple[str, type[Section]]]:
    """Yield the name and class of each section of a preset, in the order of the declarations."""
    for name, info in Drive.model_fields.items():
        if isinstance(info.annotation, type) and issubclass(info.annotation, Section):
            yield name, info.annotation


@cache
def field_table() -> dict[str, PresetField]:
    """Return the declaration of each field of a section, by path ("gears.z_g")."""
    return {f"{section}.{name}": field for section, model in sections() for name, field in model.declared().items()}


@cache
def measures() -> dict[str, PresetField]:
    """Return the declaration of each field with a single number, which may have an uncertainty, by path."""
    return {path: field for path, field in field_table().items() if field.kind == "number"}


@cache
def deviation_sizes() -> tuple[str, ...]:
    """Return the paths of the sizes of deviations, which are tolerances if drives are sampled."""
    return tuple(path for path in field_table() if path.startswith(("tolerances.", "harmonics.a_")))


def path_of(key: str) -> Path:
    """Return the path set by the key of an override. In tables keyed by paths, one part of the path contains a dot."""
    parts = [part.strip() for part in key.split(".")]
    if parts[0] in PATH_TABLES:
        return tuple(filter(None, (parts[0], ".".join(parts[1:3]), *parts[3:])))
    return (*parts[:2], ".".join(parts[2:])) if len(parts) > 2 else tuple(parts)


def is_overridden(path: str, overrides: Sequence[str]) -> bool:
    """Return whether overrides set a field ("gears.z_g"), a table that contains it, or one of its entries."""
    field = tuple(path.split("."))
    paths = [path_of(text.partition("=")[0]) for text in overrides]
    return any(p[: len(field)] == field[: len(p)] for p in paths)


def has_own_source(path: str, overrides: Sequence[str]) -> bool:
    """Return whether overrides also state the source of a field, in which case its range applies to the new value.

    path: path of the field ("gears.z_g").
    overrides: texts such as "cam.W_0=0.95".
    """
    return any(path_of(text.partition("=")[0])[:2] == ("source", path) for text in overrides)


@dataclass(frozen=True)
class ResolvedField:
    """A field of a drive with its origin.

    path: path of the field.
    value: value in its unit, None if unknown.
    unit: unit.
    kind: origin of the value: given, assumed, identified, default, override or unknown. The first three are stated in
    `source`; a value in the preset without an entry there is given.
    ref: reference.
    meaning: meaning of the field.
    range: plausible range in its unit.
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
        """The plausible range and the reference of the value, as text."""
        bounds = " to ".join(map(value_text, self.range or ()))
        return "; ".join(filter(None, (bounds, self.ref)))


def resolved_fields(drive: Drive) -> list[ResolvedField]:
    """Return every field of a drive with its origin, in the order of the declarations."""
    rows = []
    for path, field in field_table().items():
        section, name = path.split(".")
        table = getattr(drive, section)
        value = drive.value(path)
        source = drive.source.get(path)
        kind, ref, bounds = (str(source.kind), source.ref, source.range) if source else ("given", "", None)
        if is_overridden(path, drive.origin.overrides):
            kind = "override"
            ref = "--set"
            bounds = None
        elif field.unknown and value is None:
            kind = UNKNOWN
            ref = ""
            bounds = None
        elif name not in table.model_fields_set:
            kind = "default"
        rows.append(
            ResolvedField(
                path=path, value=value, unit=field.unit, kind=kind, ref=ref, meaning=field.meaning, range=bounds
            )
        )
    return rows


def origin_counts(drive: Drive) -> dict[str, int]:
    """Return the numbers of given, identified and assumed fields in a preset.

    A value replaced by a command counts with its origin in the file, so that all pages on a preset state the same
    numbers.
    """
    counts = dict.fromkeys(("given", "identified", "assumed"), 0)
    for row in resolved_fields(drive):
        kind = row.kind
        if kind == "override" and row.path in drive.source:
            kind = str(drive.source[row.path].kind)
        if kind in counts:
            counts[kind] += 1
    return counts


def value_text(value: Any) -> str:
    """Return a value in the notation of a preset, without brackets, or a dash if it is None or empty."""
    return "-" if value is None else text_of(value).strip("[]{}") or "-"
