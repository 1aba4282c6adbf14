"""Knowledge of strain wave drives in general: laws of growth, bounds, proportions, deviations, the cam's support.

Lengths grow with the pitch diameter d, the module is d over the teeth, the wave and the clearance of the teeth keep
their size in modules, stiffnesses grow with d and compliances with 1/d (one modulus of elasticity), torques with d^3.
Tolerances do not scale like that: they follow ISO 1328-1.
"""

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from math import pi

from hdassist.preset.fields import Drive, Source

REFERENCE = 160.0  # mm, pitch diameter at which the ranges below are stated
REFERENCE_MODULE = 0.8  # mm, of the bounds that are in modules
# N*m/rad at the reference: K3 of catalogue sizes 20 to 65, ratio 80 and more, by d^3, is this to 3 %; of 17 and
# 14 it is 10 and 28 % less
CATALOGUE_K3 = 9.0e5
# N*m/mm^3, rated torque over d^3 of catalogue sizes 14 to 65, ratio 100: from size 14 of the standard series (7.8 N*m)
# to size 20 of the high-torque series (52 N*m); d = 2.54 mm a size
TORQUE_DENSITY = (1.7e-4, 4.0e-4)
BOUND_ROUNDING = 1e-9  # of a bound
# Greatest deviations where a preset does not give them. F'_i: F_p of this class of ISO 1328-1:2013, the coarsest teeth
# that a drive is taken to have; those of the paper are there
COARSEST_CLASS = 9
# um for each mm of the pitch diameter, cam offsets: 80 and 30 um at 160 mm in the paper; a wheel's centre: assumed,
# 10 um at 160 mm
STANDING_OFFSET, TURNING_OFFSET, CENTRE_OFFSET = 0.5, 0.2, 0.06
# of half of F'_i, amplitudes of order 2 and of orders 3 and 4; assumed: twice as much breaks the accuracy that
# catalogues promise of size 20, half as much makes the one recorded drive one in a hundred (docs/validation.md)
SECOND_ORDER, HIGHER_ORDERS = 0.08, 0.04
# arcsec: accuracy that catalogues promise, the second below SIZE_20 [mm]
USUAL_ACCURACY, SMALL_ACCURACY, SIZE_20 = 60.0, 90.0, 50.0
# arcsec: backlash and lost motion that no drive of a catalogue exceeds; the second below LARGE_SIZE [mm]
PLAY, LOST_MOTION, LOST_MOTION_SMALL, LARGE_SIZE = 5.0, 60.0, 180.0, 35.0
# N/mm for each mm of its bore: radial stiffness of the bearing of a shaft with an overhung cam, and its range; a guess
SHAFT_BEARING = (5e3, 2e3, 1e4)


def F_p(d: float, m: float, accuracy: int) -> float:
    """Total cumulative pitch deviation [um] by ISO 1328-1:2013, of a pitch diameter and module [mm] and a class."""
    return float((0.002 * d + 0.55 * d**0.5 + 0.7 * m + 12) * 2 ** ((accuracy - 5) / 2))


def growth(by: str, d: float, m: float) -> float:
    """Factor on a field by its law where the pitch diameter is d times, and the module m times as large."""
    return {"same": 1.0, "d": d, "1/d": 1 / d, "m": m}[by]


@dataclass(frozen=True)
class Law:
    """Law by which a field grows with the drive, and its plausible bounds.

    by: "same", "d" (length or stiffness), "1/d" (compliance), "m" (in modules); bounds: in the unit of the
    field at a pitch diameter of 160 mm and a module of 0.8 mm, or, with of_value, as shares of the value; why, the
    reason of the bounds; least: value of the upper one at least; usual: value at that size, where the drive to be like
    has 0; assumed: whether the default of a preset that leaves the field out has these bounds too.
    """

    by: str
    bounds: tuple[float, float] | None = None
    why: str = ""
    of_value: bool = False
    least: float = 0.0
    usual: float | None = None
    assumed: bool = False

    def range_at(self, d: float, m: float, value: float) -> tuple[float, float] | None:
        """Plausible range of a field, which includes its value, at a pitch diameter d and a module m [mm]."""
        if self.bounds is None:
            return None
        scale = value if self.of_value else growth(self.by, d / REFERENCE, m / REFERENCE_MODULE)
        return min(self.bounds[0] * scale, value), max(self.bounds[1] * scale, self.least, value)


@dataclass(frozen=True)
class Proportion:
    """Usual proportion of a field to another measure of the drive.

    path of the field; base, that of the measure; low, high: usual share of it; words: the proportion in words, of
    value, base and share; usual: the usual shares in words, of low and high, with their source.
    """

    path: str
    base: str
    low: float
    high: float
    words: str
    usual: str


_TABLES = tomllib.loads(files("hdassist.preset").joinpath("knowledge.toml").read_text("utf-8"))
LAWS = {path: Law(**law) for path, law in _TABLES["laws"].items()}
# by cam.coupling: stiffness of the cam's support and its plausible range [N/mm] at the reference diameter, and why
CAM_SUPPORTS: dict[str, tuple[float, float, float, str]] = _TABLES["cam_supports"]
PROPORTIONS = [Proportion(**each) for each in _TABLES["proportions"]]


def implausible(drive: Drive) -> Iterator[tuple[str, str, str]]:
    """Valid fields of a drive that are far from usual: path, message with the number, usual range."""
    for each in PROPORTIONS:
        value, base = drive.value(each.path), drive.value(each.base)
        share = value / base if value and base else None
        if share is not None and not each.low * (1 - BOUND_ROUNDING) <= share <= each.high * (1 + BOUND_ROUNDING):
            words = each.words.format(value=value, base=base, share=share)
            yield each.path, words, f"usual: {each.usual.format(low=each.low, high=each.high)}"
    most, rated, d = max(map(abs, drive.operation.M_g)), drive.operation.rated, drive.gears.pitch_diameter
    limit = TORQUE_DENSITY[1] * d**3
    usual = f"{limit:.3g} N*m, the highest of catalogues at {d:.4g} mm: 52 N*m for size 20, ratio 100, by d^3"
    beyond = "times what drives of this size are rated for"
    if rated is None and most > limit:
        words = f"{most:g} N*m is {most / limit:.3g} {beyond}"
        yield "operation.M_g", words, f"{usual}; give operation.rated where it is another"
    if rated is not None and most > rated * (1 + BOUND_ROUNDING):
        words = f"{most:g} N*m is {most / rated:.3g} times the rated torque"
        yield "operation.M_g", words, f"operation.rated: {rated:g} N*m"
    if rated is not None and rated > limit * 1.01:
        yield "operation.rated", f"{rated:g} N*m is {rated / limit:.3g} {beyond}", usual


SUPPORT_FIELD = "supports.C_3"
COUPLING_FIELDS = ("cam.coupling", "cam.shaft_d", "cam.overhang")


def with_cam_support(drive: Drive) -> Drive:
    """The drive with supports.C_3 as its coupling has it: assumed, within a range; None where a size is missing."""
    support = _support(drive)
    source = {path: entry for path, entry in drive.source.items() if path != SUPPORT_FIELD}
    supports = drive.supports.model_copy(update={"C_3": support[0] if support else None})
    if support:
        reason = f"cam.coupling: {drive.cam.coupling}; {support[3]}"
        source[SUPPORT_FIELD] = Source(kind="assumed", range=support[1:3], ref=reason)
    return drive.model_copy(update={"supports": supports, "source": source})


def _support(drive: Drive) -> tuple[float, float, float, str] | None:
    """Stiffness [N/mm] of the cam's support, its range, and why."""
    cam, why = drive.cam, "3 E I/L^3 of its shaft in series with a bearing, whose stiffness is a guess"
    if cam.coupling != "overhung":
        size = drive.gears.pitch_diameter / REFERENCE
        *numbers, why = CAM_SUPPORTS[cam.coupling]
        value, low, high = (float(f"{number * size:.4g}") for number in numbers)
    elif cam.shaft_d is None or cam.overhang is None:
        return None
    else:  # equation (2a)
        shaft = 3 * drive.material.E * pi * cam.shaft_d**4 / 64 / cam.overhang**3
        value, low, high = (float(f"{1 / (1 / shaft + 1 / (k * cam.shaft_d)):.4g}") for k in SHAFT_BEARING)
    return value, low, high, why
