"""Sections of a preset and the drive that they make; fields.toml declares each field's unit, range, default, meaning.

Numbers are in the unit of their field; the model converts them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal

from pydantic import PrivateAttr
from pydantic.fields import FieldInfo

from hdassist.numerals import number_of
from hdassist.preset.deviations import Harmonics, Phases, Tolerances
from hdassist.preset.kinds import (
    OneLine,
    PerOrder,
    PerPosition,
    PerTorque,
    Section,
    in_range,
    kind_of,
)

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
