"""Fields of a preset, each declared once with its unit, range, default and meaning.

Schema, validation, unit strings, help texts and tests read these declarations.
Numbers are in the unit of their field; the model converts them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, PrivateAttr, ValidationInfo, field_validator
from pydantic.fields import FieldInfo

from hdassist.numerals import number_of
from hdassist.preset.catalogue import Catalogue
from hdassist.preset.components import Bearing, Cam, Contact, Flexspline, Gears, Material, Supports
from hdassist.preset.deviations import Harmonics, Phases, Tolerances
from hdassist.preset.kinds import (
    CLOSED,
    OneLine,
    PerOrder,
    PerTorque,
    Section,
    field,
    in_range,
    kind_of,
    range_of,
    unit_of,
)
from hdassist.preset.measured import Measured
from hdassist.preset.units import read_number
from hdassist.preset.yamltext import MAX_FINDINGS, InvalidValue, near_miss

PRESET_SCHEMA = "hdassist.preset/1"


class Mounting(Section):
    """How the drive is built in."""

    fixed: Literal["rigid", "flexspline"] = field("the wheel that stands still", default="rigid")
    mark_kind: Literal["xi", "runout", "pitch"] = field(
        "what phases.xi_g and xi_b are: phases, marks of greatest radial run-out, "
        "or marks of greatest cumulative pitch deviation",
        default="xi",
    )
    holes: int = field("holes of the seat of the fixed wheel (0: free angle)", default=12, ge=0, le=360)
    first_hole: float = field("angle of hole 0", "deg", 0.0, ge=-360, le=360)
    allowed: Annotated[Literal["all"] | tuple[int, ...], "holes"] = field("usable holes", default="all")


class Operation(Section):
    """Load."""

    M_g: Annotated[tuple[Annotated[float, Field(ge=-1e7, le=1e7)], ...], "numbers"] = field(
        "torques on the flexspline, counter-clockwise positive", "N*m"
    )
    rated: float | None = field("rated torque", "N*m", None, gt=0, le=1e7)
    dT: float = field("flexspline and cam warmer than the rigid wheel", "K", 0.0, ge=-150, le=150)


def _limit(meaning: str, unit: str = "arcsec", most: float = 1e6) -> Any:
    return field(meaning, unit, None, gt=0, le=most)


class Acceptance(Section):
    """Limits, and the rule that decides."""

    F_ior: PerTorque = field(
        "limit of F'_ior with the self error, per torque {80: 30} or for all torques", "arcsec", {}
    )
    turn_range: PerTorque = field("limit of the range within one cam turn, as F_ior", "arcsec", {})
    self_error: PerTorque = field("limit of the self error, as F_ior", "arcsec", {})
    order_amplitude: PerOrder = field(
        "limit of the amplitude of orders per cam turn {2: 10} at each torque, or at one {2@80: 8}", "arcsec", {}
    )
    lost_motion: float | None = _limit("limit of the lost motion")
    positioning: float | None = _limit("limit of the positioning error one way")
    repeatability: float | None = _limit("limit of the repeatability, plus and minus")
    bidirectional: float | None = _limit("limit of the repeatability from both sides, plus and minus")
    hysteresis_loss: float | None = _limit("limit of the hysteresis loss")
    starting_torque: float | None = _limit("limit of the torque at the cam that starts it", "N*m", 1e7)
    backdrive_torque: float | None = _limit("limit of the torque at the output that drives it back", "N*m", 1e7)
    ratchet_torque: float | None = _limit("least torque at the output at which teeth ratchet", "N*m", 1e9)
    K_1: float | None = _limit("least torsional stiffness near zero", "N*m/rad", 1e12)
    K_2: float | None = _limit("least torsional stiffness of the second segment", "N*m/rad", 1e12)
    K_3: float | None = _limit("least torsional stiffness of the third segment", "N*m/rad", 1e12)
    rule: Literal["guard", "simple"] = field(
        "decision rule for measured values: guard bands of 1.65 standard uncertainties, or simple acceptance",
        default="guard",
    )


class Numerics(Section):
    """Resolution of the model."""

    n_max: int = field("highest bending mode of the rings", default=40, ge=4, le=200)
    n_2: int = field("nodes between bore and outer ring", default=100, ge=12, le=720)
    nominal_curve: Literal["linear", "inextensible"] = field(
        "shape of the rim on the cam: the ring's bending mode, or a closed curve of unchanged length",
        default="inextensible",
    )
    stations: int = field(
        "stations along the face of each flank, which is coned; 1: flanks bear as a whole, with contact.c_t",
        default=5, ge=1, le=16,
    )  # fmt: skip
    n_beta: int = field("ball positions per ball pitch with rolling balls", default=48, ge=4, le=1000)
    n_phase: int = field("tooth phases, and ball phases, of the self error", default=20, ge=2, le=200)


# fields that presets had once, with a hint
REMOVED = {
    "acceptance.margin": "no margin any more: predictions are held by their probability, hdassist accept --sure",
    "numerics.window": "no flank window any more: every tooth that may touch is looked at",
}

# fields of numerics that identified values depend on, and the value of each before it was a field
IDENTIFIED_WITH: dict[str, str | int] = {"nominal_curve": "linear", "stations": 1}


class Source(Section):
    """Where a value comes from."""

    kind: Literal["given", "assumed", "identified"] = field("how sure the value is")
    ref: str = field("page, figure, standard or reason", default="")
    range: Annotated[tuple[float, float] | None, "numbers"] = field(
        "plausible range of the value, in the field's unit", default=None
    )


class CostLaw(Section):
    """What a tolerance costs: share at the value that the preset gives, and 1/tolerance^k of it at others."""

    share: float = field("cost at the preset's tolerance, in any unit", default=1.0, gt=0, le=1e9)
    k: float = field("power of 1/tolerance that the cost grows with", default=1.0, gt=0, le=10)
    least: float | None = field("least tolerance that can be made, in the field's unit", default=None, gt=0, le=1000)


BY_PATH: dict[str, type[Section]] = {"source": Source, "cost": CostLaw}  # tables whose keys are paths of fields


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


class Drive(BaseModel):
    """A strain wave drive as a preset describes it."""

    model_config = CLOSED

    name: OneLine = field("name of the drive", min_length=1, max_length=200)
    description: str = field("what the drive is, and how its numbers were found", default="")
    gears: Gears
    material: Material = Material()
    flexspline: Flexspline
    bearing: Bearing
    cam: Cam
    supports: Supports
    contact: Contact = Contact()
    tolerances: Tolerances = Tolerances()
    phases: Phases = Phases()
    harmonics: Harmonics = Harmonics()
    uncertainty: dict[str, Annotated[float, Field(ge=0)]] = field(
        "expanded uncertainty (k = 2) of fields, in their unit", default={}
    )
    mounting: Mounting = Mounting()
    operation: Operation
    catalogue: Catalogue = Catalogue()
    measured: Measured = Measured()
    acceptance: Acceptance = Acceptance()
    numerics: Numerics = Numerics()
    cost: dict[str, CostLaw] = field("what tolerances cost, for hdassist allocate", default={})
    source: dict[str, Source] = field("origin of single values", default={})

    _origin: Origin = PrivateAttr(default=Origin())

    @field_validator("uncertainty", "cost", "source", mode="before")
    @classmethod
    def _read_by_path(cls, table: Any, info: ValidationInfo) -> Any:
        if not isinstance(table, dict):
            return table
        return {path: _read_entry(str(info.field_name), path, entry, table) for path, entry in table.items()}

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


def fields() -> Iterator[tuple[str, FieldInfo]]:
    """Path and declaration of each field, in the order they are written."""
    yield from field_table().items()


@cache
def measures() -> dict[str, FieldInfo]:
    """Path and declaration of each field that holds a single number, and so may have an uncertainty."""
    return {path: info for path, info in fields() if kind_of(info) == "number"}


@cache
def deviation_sizes() -> tuple[str, ...]:
    """Paths of the sizes of deviations, which are tolerances where drives are drawn."""
    return tuple(path for path in field_table() if path.startswith(("tolerances.", "harmonics.a_")))


def _read_entry(name: str, path: str, entry: Any, table: Mapping[str, Any]) -> Any:
    """An entry of the table "uncertainty", "cost" or "source"."""
    known, words = {
        "uncertainty": (tuple(measures()), "names no field of a single number"),
        "cost": (deviation_sizes(), "names no size of a deviation"),
        "source": (tuple(field_table()), "names no field"),
    }[name]
    if path not in known:
        hint = f"like {known[0]}" if path in field_table() else _near_path(path, known, table)
        return InvalidValue(words, hint, at_key=True)
    if name == "uncertainty":
        return read_number(entry, unit_of(measures()[path]))
    if name == "source" and isinstance(entry, dict) and "range" in entry:
        return entry | {"range": read_range(path, entry["range"])}
    return entry


def read_range(path: str, bounds: Any) -> Any:
    """A plausible range of a field, by path, in its unit; InvalidValue for an invalid one."""
    info = field_table()[path]
    unit = unit_of(info)
    if bounds is None or isinstance(bounds, InvalidValue):
        return bounds
    if path not in measures():
        return InvalidValue("only single measures have a range")
    if not isinstance(bounds, list | tuple) or len(bounds) != 2:
        return InvalidValue("must be two numbers, the lower one first", "like [0, 20]")
    read: list[float] = []
    for bound in bounds:
        if isinstance(number := read_number(bound, unit), InvalidValue):
            return number
        if not in_range(info, number):
            return InvalidValue(f"reaches beyond what the field takes: {range_of(info, unit)}")
        read.append(number)
    return tuple(read) if read[0] < read[1] else InvalidValue("the lower one must stand first")


def _near_path(word: str, paths: Iterable[str], table: Mapping[str, Any]) -> str:
    """A hint at the field that a key of a table may mean; empty in a table with more keys than findings are shown."""
    if len(table) > MAX_FINDINGS:
        return ""
    name = word.split(".")[-1]
    whole = next((path for path in paths if path.split(".")[1] == name), word)
    return near_miss(whole, paths) or "write section.key, like gears.z_g"
