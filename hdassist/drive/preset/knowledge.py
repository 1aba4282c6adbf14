"""General knowledge of strain wave drives, and the fields of a drive that is similar to a known one.

Lengths grow with the pitch diameter d, and the module is d over the number of teeth. Radial deflection and flank
clearance keep their size in modules. Stiffnesses grow with d, compliances with 1/d (for a constant modulus of
elasticity), and torques with d^3. Tolerances do not scale in this way but follow ISO 1328-1. For a new drive, options
state some fields. All other fields follow a law with a plausible range, and profile shifts keep the bore in proportion
to the pitch diameter.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from math import isfinite, log10, pi
from typing import Any, NoReturn

from hdassist.drive.preset.fields import COMPOSITES, Drive, Source, field_table, plain
from hdassist.drive.preset.text import InvalidValueError, near_miss, read_number, scalar_value, shown
from hdassist.run.errors import UsageError
from hdassist.run.files import package_table

REFERENCE = 160.0  # mm: pitch diameter for which the ranges below are stated
_REFERENCE_MODULE = 0.8  # mm: module for which bounds in modules are stated
# N*m/rad at the reference diameter. K3 of catalogue sizes 20 to 65 with ratios of 80 and more follows this value by d^3
# within 3 %; for sizes 17 and 14 it is 10 and 28 % less
CATALOGUE_K3 = 9.0e5
# N*m/mm^3: rated torque over d^3 of catalogue sizes 14 to 65, ratio 100, from size 14 of the standard series (7.8 N*m)
# to size 20 of the high-torque series (52 N*m), with d = 2.54 mm per size
TORQUE_DENSITY = (1.7e-4, 4.0e-4)
# plausible stiffnesses as shares of K3 by the cube law; K1 of catalogue sizes is half of K3, and values outside this
# range have another unit
_STIFFNESS_SHARES = (0.05, 5.0)
_CATALOGUE_UNIT = 1e4  # N*m/rad: unit in which catalogues print stiffnesses
_BOUND_ROUNDING = 1e-9  # relative rounding error of a bound
# Accuracy class of the largest deviations if a preset does not state them: F'_i is F_p of this class of ISO
# 1328-1:2013, the coarsest teeth assumed for a drive; the values of the paper are within this class
COARSEST_CLASS = 9
# um per mm of the pitch diameter: eccentricities of the wave generator, 80 and 30 um at 160 mm in the paper, and that
# of a wheel's centre, assumed to be 10 um at 160 mm
STANDING_OFFSET = 0.5
TURNING_OFFSET = 0.2
CENTRE_OFFSET = 0.06
# amplitudes of order 2 and of orders 3 and 4, as shares of half of F'_i (assumed): with twice these values, size 20
# exceeds the accuracy in catalogues; with half, the only recorded drive is outside the range (docs/validation.md)
SECOND_ORDER = 0.08
HIGHER_ORDERS = 0.04
# arcsec: accuracy stated in catalogues, the second value below SIZE_20 [mm]
USUAL_ACCURACY = 60.0
SMALL_ACCURACY = 90.0
SIZE_20 = 50.0
# arcsec; the last value is the high-accuracy grade, available on order
ACCURACY_GRADES = (SMALL_ACCURACY, USUAL_ACCURACY, 30.0)
# arcsec: largest backlash and lost motion in catalogues, the last value below _LARGE_SIZE [mm]
_PLAY = 5.0
_LOST_MOTION = 60.0
_LOST_MOTION_SMALL = 180.0
_LARGE_SIZE = 35.0
# N/mm per mm of bore: radial stiffness of the shaft bearing of an overhung wave generator, with its range (engineering
# estimate)
_SHAFT_BEARING = (5e3, 2e3, 1e4)


def F_p(
    d: float,
    m: float,
    accuracy: int,
) -> float:
    """Return the total cumulative pitch deviation [um] by ISO 1328-1:2013.

    d: pitch diameter [mm].
    m: module [mm].
    accuracy: accuracy class.
    """
    return float((0.002 * d + 0.55 * d**0.5 + 0.7 * m + 12) * 2 ** ((accuracy - 5) / 2))


def f_p(
    d: float,
    m: float,
    accuracy: int,
) -> float:
    """Return the single pitch deviation [um] by ISO 1328-1:2013.

    d: pitch diameter [mm].
    m: module [mm].
    accuracy: accuracy class.
    """
    return float((0.001 * d + 0.4 * m + 5) * 2 ** ((accuracy - 5) / 2))


def _growth(
    by: str,
    d: float,
    m: float,
) -> float:
    """Return the factor by which a field grows with its law.

    by: law, as in `Law`.
    d: ratio of pitch diameters.
    m: ratio of modules.
    """
    return {"same": 1.0, "d": d, "1/d": 1 / d, "m": m}[by]


@dataclass(frozen=True)
class Law:
    """Law by which a field grows with the drive, and its plausible bounds.

    by: quantity with which the field grows: "d" (lengths, stiffnesses), "1/d" (compliances), "m" (sizes in modules), or
    "same" for none.
    bounds: bounds in the unit of the field at a pitch diameter of 160 mm and a module of 0.8 mm, or, with of_value, as
    shares of the value.
    why: reason for the bounds.
    of_value: whether the bounds are shares of the value.
    least: smallest value of the upper bound.
    usual: value at the size for which the bounds are stated, used if the known drive has 0.
    assumed: whether a default also has these bounds if a preset omits the field.
    """

    by: str
    bounds: tuple[float, float] | None = None
    why: str = ""
    of_value: bool = False
    least: float = 0.0
    usual: float | None = None
    assumed: bool = False

    def range_at(
        self,
        d: float,
        m: float,
        value: float,
    ) -> tuple[float, float] | None:
        """Return the plausible range of a field at a pitch diameter and module [mm], which includes its value."""
        if self.bounds is None:
            return None
        scale = value if self.of_value else _growth(self.by, d / REFERENCE, m / _REFERENCE_MODULE)
        return min(self.bounds[0] * scale, value), max(self.bounds[1] * scale, self.least, value)


@dataclass(frozen=True)
class Proportion:
    """Usual proportion of a field to another dimension of the drive.

    path: path of the field.
    base: path of the other dimension.
    low, high: usual range of the proportion.
    words: template of the message, with value, base and share.
    usual: template of the text on the usual range, with low and high and their source.
    """

    path: str
    base: str
    low: float
    high: float
    words: str
    usual: str


_TABLES = package_table("drive/preset/knowledge.toml")
LAWS = {path: Law(**law) for path, law in _TABLES["laws"].items()}
# by cam.coupling: stiffness of the wave generator's support and its plausible range [N/mm] at the reference diameter,
# and the reason
_CAM_SUPPORTS: dict[str, tuple[float, float, float, str]] = _TABLES["cam_supports"]
_PROPORTIONS = [Proportion(**row) for row in _TABLES["proportions"]]


def implausible(drive: Drive) -> Iterator[tuple[str, str, str]]:
    """Yield each field of a drive with a valid but unusual value: its path, a message and the usual range."""
    for proportion in _PROPORTIONS:
        value = drive.value(proportion.path)
        base = drive.value(proportion.base)
        # an unknown or zero dimension has no proportion
        share = value / base if value and base else None
        if share is not None and not proportion.low * (1 - _BOUND_ROUNDING) <= share <= proportion.high * (
            1 + _BOUND_ROUNDING
        ):
            finding_words = proportion.words.format(
                value=value,
                base=base,
                share=share,
            )
            yield (
                proportion.path,
                finding_words,
                f"usual: {proportion.usual.format(low=proportion.low, high=proportion.high)}",
            )
    # a torque beyond the strength of the drive most likely has a wrong unit
    largest_M_g = max(map(abs, drive.operation.M_g))
    rated = drive.operation.rated
    d = drive.gears.pitch_diameter
    limit = TORQUE_DENSITY[1] * d**3
    usual = f"{limit:.3g} N*m at {d:.4g} mm is the highest of catalogues: 52 N*m for size 20, ratio 100, by d^3"
    beyond = "times the rated torque of drives of this size"
    if rated is None and largest_M_g > limit:
        finding_words = f"{largest_M_g:g} N*m is {largest_M_g / limit:.3g} {beyond}"
        yield "operation.M_g", finding_words, f"{usual}; state operation.rated if it is different"
    if rated is not None and largest_M_g > rated * (1 + _BOUND_ROUNDING):
        finding_words = f"{largest_M_g:g} N*m is {largest_M_g / rated:.3g} times the rated torque"
        yield "operation.M_g", finding_words, f"operation.rated: {rated:g} N*m"
    if rated is not None and rated > limit * 1.01:
        yield "operation.rated", f"{rated:g} N*m is {rated / limit:.3g} {beyond}", usual
    if drive.material.E < _LEAST_STEEL_E:
        message = f"{drive.material.E:g} MPa is not steel: contact.* apply to steel, and creep is not modelled"
        yield "material.E", message, "usual: 200000 to 212000 MPa; results for a drive of plastic are not validated"
    yield from _implausible_stiffnesses(drive)


def _implausible_stiffnesses(drive: Drive) -> Iterator[tuple[str, str, str]]:
    """Yield torsional stiffnesses that are implausible for the drive's diameter: path, message, usual range."""
    d = drive.gears.pitch_diameter
    K_3 = CATALOGUE_K3 * (d / REFERENCE) ** 3
    low, high = (share * K_3 for share in _STIFFNESS_SHARES)
    for section, k in product(("catalogue", "measured"), (1, 2, 3)):
        path = f"{section}.K_{k}"
        K = drive.value(path)
        if K is None or low <= K <= high:
            continue
        usual = f"usual at {d:.4g} mm: {_rounded(low, 2):g} to {_rounded(high, 2):g} N*m/rad"
        # the value is plausible in the unit of the catalogues
        if low <= K * _CATALOGUE_UNIT <= high:
            usual += f"; if the catalogue gives {K:g} in 1e4 N*m/rad, write {K * _CATALOGUE_UNIT:g}"
        yield path, f"{K:g} N*m/rad is {K / K_3:.2g} times K3 of catalogue drives of this size", usual


# --- support of the wave generator, by its coupling

SUPPORT_FIELD = "supports.C_3"
COUPLING_FIELDS = ("cam.coupling", "cam.shaft_d", "cam.overhang")


def with_cam_support(drive: Drive) -> Drive:
    """Return the drive with supports.C_3 and its range estimated from cam.coupling.

    The field is set to unknown for an overhung wave generator without the dimensions of its shaft.
    """
    cam = drive.cam
    why = "3 E I/L^3 of its shaft in series with a bearing, whose stiffness is estimated"
    support: list[float] = []  # stiffness and both ends of its range [N/mm]
    # the stiffness for a kind of coupling grows with the diameter
    if cam.coupling != "overhung":
        *numbers, why = _CAM_SUPPORTS[cam.coupling]
        support = [number * (drive.gears.pitch_diameter / REFERENCE) for number in numbers]
    elif cam.shaft_d is not None and cam.overhang is not None:  # equation (2a)
        # 3 E I/L^3 with I = pi d^4/64
        shaft = 3 * drive.material.E * pi * cam.shaft_d**4 / 64 / cam.overhang**3
        support = [1 / (1 / shaft + 1 / (k * cam.shaft_d)) for k in _SHAFT_BEARING]
    source = {path: entry for path, entry in drive.source.items() if path != SUPPORT_FIELD}
    value = None
    if support:
        # four digits, as in a preset
        value, low, high = (float(f"{number:.4g}") for number in support)
        source[SUPPORT_FIELD] = Source(
            kind="assumed",
            range=(low, high),
            ref=f"cam.coupling: {cam.coupling}; {why}",
        )
    return drive.with_values({SUPPORT_FIELD: value}).model_copy(update={"source": source})


# --- a drive like a known one

PITCH_DIAMETER = "gears.pitch_diameter"
STIFFNESS = "catalogue.K"
_SEGMENTS = (1, 2, 3)  # segments of the stiffness curve of a catalogue
# Classes of ISO 1328-1 by quality of the drive: for the value of F'_i and for both ends of its range (None for 0). For
# an unknown quality a wide range is assumed, from better teeth than those of catalogues to the coarsest class
_QUALITIES: dict[str, tuple[int, int | None, int]] = {"catalogue": (7, None, 8), "unknown": (8, 5, 11)}
_LEAST_STEEL_E = 1e5  # MPa: smallest Young's modulus of steel; below it the flexspline is of another material
_FARTHEST_TORQUE = 3.0  # largest factor by which the torque density of a drive may be outside that of catalogues
_FARTHEST_STIFFNESS = 4.0  # largest factor by which a stiffness may differ from that of catalogues at the same diameter
_NOT_MODELLED = {  # kinds of flexsplines that are not modelled, and the reason
    "ring": "a ring between two circular splines meshes with both, and the model has one mesh and a shell",
    "plastic": "it creeps and expands, and stiffnesses of contacts and tolerances are known for steel only",
}
_ACCURACY_TEST = "catalogue.accuracy_test"
_QUALITY = "quality"  # key in the requirements, in addition to fields
# fields copied only if the known drive states them with a value other than 0; all others get their defaults
_WHERE_GIVEN = ("material.alpha_T", "operation.dT", *COUPLING_FIELDS)
_SIMILAR_WORDS = {
    "same": "as {like}",
    "d": "{like} x {s:.4g}, in proportion to the diameter",
    "1/d": "{like} / {s:.4g}, inversely proportional to the diameter",
    "m": "{value:.4g} modules, as {like}",
}


@dataclass(frozen=True)
class SimilarValue:
    """A value of a field in its unit.

    value: the value.
    kind: given or assumed.
    ref: source of the value.
    range: plausible range, None if there is none.
    """

    value: Any
    kind: str
    ref: str
    range: tuple[float, float] | None = None


# requirements on a new drive: its fields by path, its PITCH_DIAMETER [mm], and its STIFFNESS, K1, K2, K3 or only K3
# [N*m/rad]
Requirements = dict[str, SimilarValue]


def _size_of(like: Drive, required: Requirements) -> tuple[SimilarValue, float]:
    """Return the pitch diameter [mm] of a drive that is similar to another one, and its K3 relative to catalogues.

    A required diameter takes precedence. Without one, the diameter follows by the cube law from the required K3, or
    from the required torque if K3 is not required either. If nothing is required, it is that of the other drive.

    Raises UsageError for a torque or a stiffness that is implausible for the size.
    """
    rated = required["operation.rated"].value if "operation.rated" in required else None
    K: tuple[float, ...] = required[STIFFNESS].value if STIFFNESS in required else ()
    _require_rising(K)
    stated_size = required.get(PITCH_DIAMETER)
    stiffness_ratio = 1.0
    # a stated diameter takes precedence; the stiffness then shows the difference from catalogues
    if stated_size:
        size = stated_size
        stiffness_ratio = _stiffness_ratio(size.value, K)
    # the diameter follows from the cube law of stiffness
    elif K:
        d = _rounded(REFERENCE * (K[-1] / CATALOGUE_K3) ** (1 / 3))
        reason = f"{d:g} mm from K3 = {plain(K[-1])} N*m/rad, which increases with d^3 in catalogues"
        size = SimilarValue(d, "assumed", reason)
    else:
        return _size_by_torque(like, rated), stiffness_ratio
    # the rated torque also grows with the cube of the diameter
    low, high = (density * size.value**3 for density in TORQUE_DENSITY)
    if rated is not None and not low / _FARTHEST_TORQUE <= rated <= high * _FARTHEST_TORQUE:
        usual = f"{_rounded(low, 2):g} to {_rounded(high, 2):g} N*m"
        _refuse_size(f"a rated torque of {plain(rated)} N*m", size.value, usual)
    return size, stiffness_ratio


def _require_rising(K: Sequence[float]) -> None:
    """Raise UsageError unless the stiffnesses of a torsion curve's segments [N*m/rad] are positive and increase."""
    if K and not (K[0] > 0 and all(first <= second for first, second in pairwise(K))):
        raise UsageError(
            f"K1, K2, K3 must be above 0 and increase: {', '.join(map(plain, K))} N*m/rad",
            "check the catalogue's stiffnesses and their sequence",
        )


def _stiffness_ratio(d: float, K: Sequence[float]) -> float:
    """Return K3 relative to that of catalogue drives with the same pitch diameter, or 1 if no stiffness is given.

    d: pitch diameter [mm].
    K: stiffnesses [N*m/rad], K3 last, possibly empty.

    Raises UsageError for an implausible ratio.
    """
    if not K:
        return 1.0
    of_catalogues = CATALOGUE_K3 * (d / REFERENCE) ** 3
    ratio = float(K[-1] / of_catalogues)
    if not 1 / _FARTHEST_STIFFNESS <= ratio <= _FARTHEST_STIFFNESS:
        _refuse_size(f"K3 = {plain(K[-1])} N*m/rad", d, f"about {_rounded(of_catalogues, 2):g}")
    return ratio


def _size_by_torque(like: Drive, rated: float | None) -> SimilarValue:
    """Return the pitch diameter [mm] from the rated torque by the cube law.

    like: similar drive, whose diameter is returned if no torque is required.
    rated: required rated torque [N*m], or None.
    """
    pitch_diameter = like.gears.pitch_diameter
    if rated is None:
        reason = f"the pitch diameter of {like.name}, {pitch_diameter:g} mm"
        return SimilarValue(pitch_diameter, "assumed", reason)
    # torque grows with the cube of the diameter
    d = _rounded(pitch_diameter * (rated / like.rated_torque) ** (1 / 3))
    low, high = ((rated / density) ** (1 / 3) for density in reversed(TORQUE_DENSITY))
    law = f"{d:g} mm from {plain(rated)} N*m, scaled with the cube of the diameter from {like.name}"
    return SimilarValue(d, "assumed", f"{law}; in catalogues {low:.3g} to {high:.3g} mm")


def _refuse_size(
    required: str,
    d: float,
    usual: str,
) -> NoReturn:
    raise UsageError(
        f"{required} contradicts a pitch diameter of {d:.6g} mm: drives of that size have {usual}",
        "omit one of the two; hdassist derives it from the other",
    )


def similar(like: Drive, required: Requirements) -> dict[str, SimilarValue]:
    """Return the fields of a drive that is similar to another one, by path.

    Required fields are marked as given, all others as assumed.

    Deviations other than F'_i, eccentricities and directions are unknown and omitted.

    like: the known drive.
    required: requirements on the new drive.
    Raises UsageError if requirements contradict each other.
    """
    size, stiffness_ratio = _size_of(like, required)
    d = size.value
    s = d / like.gears.pitch_diameter
    written_paths = _written_paths(like)
    entries = _kept_settings(like, written_paths)
    teeth = required.get("gears.z_g", entries["gears.z_g"])
    # the module needs many digits, because the diameter must be exact
    m = _rounded(d / teeth.value, 12)
    # with two waves, the numbers of teeth differ by 2
    entries["gears.z_b"] = replace(teeth, value=teeth.value + 2)
    entries["gears.m"] = SimilarValue(m, size.kind, f"{d:.6g} mm / {teeth.value} teeth; {size.ref}")
    for path, law in LAWS.items():
        value = like.value(path)
        is_left_out = path in _WHERE_GIVEN and not (path in written_paths and value)
        if value is not None and path != like.unused_tooth_field and not is_left_out:
            entries[path] = _scaled(like, path, law, s, m, stiffness_ratio)
    quality = required[_QUALITY].value if _QUALITY in required else "catalogue"
    entries |= _shifts(like, entries, d) | _tolerances(d, m, quality)
    backlash = _backlash(d) if quality == "catalogue" else {}
    entries |= _load(like, required, s, d) | backlash | required
    entries |= _stiffness_segments(required)
    if "cam.coupling" in entries:
        # a stated support would take precedence over the coupling
        del entries["supports.C_3"]  # the support follows from the coupling
    in_sequence = {path: entries[path] for path in field_table() if path in entries}
    _require_in_range(in_sequence)
    return in_sequence


def _written_paths(like: Drive) -> set[str]:
    """Return the paths of the fields stated in the preset of a drive."""
    paths = set()
    for path in field_table():
        section, key = path.split(".")[:2]
        if key in getattr(like, section).model_fields_set:
            paths.add(path)
    return paths


def _kept_settings(like: Drive, written_paths: Iterable[str]) -> dict[str, SimilarValue]:
    """Return the number of teeth and the settings in which a drive differs from the defaults, by path."""
    settings = {}
    for path in written_paths:
        value = like.value(path)
        if path.startswith(("gears.z_g", "mounting.fixed", "numerics.")) and value != field_table()[path].default:
            settings[path] = SimilarValue(value, "assumed", f"as {like.name}")
    return settings


def _stiffness_segments(required: Requirements) -> dict[str, SimilarValue]:
    """Return the required stiffnesses by path of their segment. A single stiffness is that of K3."""
    stiffness = required.get(STIFFNESS)
    if stiffness is None:
        return {}
    segments = _SEGMENTS if len(stiffness.value) == len(_SEGMENTS) else _SEGMENTS[-1:]
    pairs = zip(segments, stiffness.value, strict=True)
    return {f"{STIFFNESS}_{segment}": replace(stiffness, value=K) for segment, K in pairs}


def _require_in_range(entries: Mapping[str, SimilarValue]) -> None:
    """Raise UsageError for a number outside the range of its field."""
    for path, entry in entries.items():
        field = field_table()[path]
        if isinstance(entry.value, float) and not field.holds(entry.value):
            raise UsageError(
                f"these values do not give a valid drive: {path} would be {entry.value:.3g} {field.unit}".rstrip(),
                f"choose other tooth numbers or another size; the range is {field.range_words(field.unit)}",
            )


def _scaled(like: Drive, path: str, law: Law, s: float, m: float, stiffer: float) -> SimilarValue:
    """Return a field scaled by its law.

    like: the known drive.
    path: path of the field.
    law: its law.
    s: ratio of pitch diameters.
    m: new module [mm].
    stiffer: K3 relative to that of catalogue drives with the same diameter.
    """
    value = like.value(path)
    ratio = m / like.gears.m
    d = s * like.gears.pitch_diameter
    factor = _growth(law.by, s, ratio)
    stiffness = path.startswith(("supports.", "contact.k_"))
    compliance = path.startswith("contact.c_")
    elastic = stiffer if stiffness else 1 / stiffer if compliance else 1.0
    in_modules = value / like.gears.m / (1000 if path == "gears.j_n" else 1) if law.by == "m" else 0.0
    comment = _SIMILAR_WORDS[law.by].format(
        like=like.name,
        s=s,
        value=in_modules,
    )
    if law.usual is not None and not value:
        value = _rounded(law.usual * _growth(law.by, d / REFERENCE, m / _REFERENCE_MODULE))
        comment = ""
    elif isinstance(value, float):
        value = _rounded(value * factor * elastic)
    if elastic != 1 and factor:
        comment += f", {'x' if elastic > 1 else '/'} {max(elastic, 1 / elastic):.3g} for K3 at this diameter"
    bounds = None
    if isinstance(value, float) and (scaled := law.range_at(d, m, value)):
        bounds = _around(like, path, value, *map(_rounded, scaled))
    return SimilarValue(
        value=value,
        kind="assumed",
        ref="; ".join(filter(None, (comment, law.why))),
        range=bounds,
    )


def _around(
    like: Drive,
    path: str,
    value: float,
    low: float,
    high: float,
) -> tuple[float, float] | None:
    """Return bounds widened to include the value, or None if they are equal or outside the range of the field."""
    low = min(low, value)
    high = max(high, value)
    return (low, high) if low < high and like.allows(path, low) and like.allows(path, high) else None


def _shifts(
    like: Drive,
    entries: Mapping[str, SimilarValue],
    d: float,
) -> dict[str, SimilarValue]:
    """Return profile shifts that keep the bore in proportion to the pitch diameter, and the tip distance in modules."""
    g = like.gears
    bore = 2 * (g.root_radius - like.flexspline.h_1) / g.pitch_diameter
    m, z_g, h_f = (entries[path].value for path in ("gears.m", "gears.z_g", "gears.h_f"))
    x_g = round((bore - 1) * z_g / 2 + h_f + entries["flexspline.h_1"].value / m, 3)
    shift_difference = round(g.x_b - g.x_g, 4)
    return {
        "gears.x_g": SimilarValue(
            x_g, "assumed", f"gives a bore of {bore * d:.5g} mm, that of {like.name} in proportion to the diameter"
        ),
        "gears.x_b": SimilarValue(
            round(x_g + shift_difference, 4),
            "assumed",
            f"x_g + {shift_difference:g}, as {like.name}; the tips do not interfere",
        ),
    }


def _tolerances(
    d: float,
    m: float,
    quality: str,
) -> dict[str, SimilarValue]:
    """Return F'_i of both wheels of a drive of a given quality, by path.

    d: pitch diameter [mm].
    m: module [mm].
    quality: key of _QUALITIES.
    """
    usual_class, finest, coarsest = _QUALITIES[quality]
    usual = _rounded(F_p(d, m, usual_class), 2)
    coarse = _rounded(F_p(d, m, coarsest), 2)
    fine = 0.0 if finest is None else _rounded(F_p(d, m, finest), 2)
    ends = f"0 to class {coarsest}" if finest is None else f"class {finest} to class {coarsest}"
    ref = f"F_p of class {usual_class} (ISO 1328-1:2013), used for F'_i; range: {ends}"
    if quality == "unknown":
        ref += "; assumed to be wide, because the quality is unknown (--quality unknown)"
    if m < 1:
        ref += "; GOST 9178-81 is the Russian standard for such modules"
    return {
        wheel.size: SimilarValue(value=usual, kind="assumed", ref=ref, range=(fine, coarse))
        for wheel in COMPOSITES.values()
    }


def _backlash(d: float) -> dict[str, SimilarValue]:
    lost = _LOST_MOTION if d > _LARGE_SIZE else _LOST_MOTION_SMALL
    return {
        "catalogue.lost_motion": SimilarValue(lost, "assumed", "usual value in catalogues for such sizes"),
        "catalogue.play": SimilarValue(_PLAY, "assumed", "manufacturers state no backlash for these drives"),
    }


def _load(
    like: Drive,
    required: Requirements,
    s: float,
    d: float,
) -> dict[str, SimilarValue]:
    rated_torque = like.rated_torque
    rating = required.get("operation.rated")
    if rating is None:
        rated = _rounded(rated_torque * s**3, 3)
        bounds = [_rounded(density * d**3, 2) for density in TORQUE_DENSITY]
        ref = f"{like.name} x d^3 = {s**3:.4g}; catalogues: {bounds[0]:g} to {bounds[1]:g} N*m"
        rating = SimilarValue(
            value=rated, kind="assumed", ref=ref, range=_around(like, "operation.rated", rated, *bounds)
        )
    shares = tuple(_rounded(torque / rated_torque * rating.value, 3) for torque in like.operation.M_g)
    return {
        "operation.M_g": SimilarValue(shares, "assumed", f"same shares of the rated torque as in {like.name}"),
        "operation.rated": rating,
    }


def _rounded(value: float, digits: int = 4) -> float:
    """Return a number rounded to a number of significant digits."""
    return value if value == 0 else round(value, digits - 1 - int(log10(abs(value)) // 1))


# --- requirements by options

# options for dimensions and catalogue values: their fields and units
_MEASURES = {
    "pitch_diameter": (PITCH_DIAMETER, "mm"),
    "torque": ("operation.rated", "N*m"),
    "lost_motion": ("catalogue.lost_motion", "arcsec"),
    "accuracy": ("catalogue.accuracy", "arcsec"),
    "T1": ("catalogue.T_1", "N*m"),
    "T2": ("catalogue.T_2", "N*m"),
}


def read_requirements(like: Drive, *, ratio: float | None = None, **given: str | None) -> Requirements:
    """Return the requirements that options state on a new drive similar to a known one.

    Options other than the ratio are texts, which may include a unit. An option that is not given is None.

    like: the known drive.
    ratio: ratio of the drive if it is mounted like the known drive.
    coupling: coupling of the wave generator, as in cam.coupling.
    shaft: diameter and overhang of the shaft of an overhung wave generator [mm], such as 14x30.
    pitch_diameter: pitch diameter [mm].
    torque: rated torque [N*m].
    teeth: numbers of teeth, such as 160/162.
    holes: number of bolt holes of the seat.
    allowed_holes: numbers of the usable holes.
    stiffness: catalogue stiffnesses K1, K2, K3, or only K3 [N*m/rad].
    T1, T2: ends of the segments of the catalogue's torsion curve [N*m].
    lost_motion, accuracy: catalogue values [arcsec].
    accuracy_test: test of the accuracy, as in catalogue.accuracy_test.
    quality: catalogue or unknown; determines the assumptions on tolerances and backlash.
    flexspline: kind of the flexspline.
    Raises UsageError if an option cannot be read, or two options contradict each other.
    """
    _require_steel_cup(given.get("flexspline"))
    required = _quality(given.get("quality"))
    for name, (path, unit) in _MEASURES.items():
        text = given.get(name)
        if text is not None:
            option = f"--{name.replace('_', '-')}"
            required[path] = SimilarValue(_measure(option, text, unit), "given", f"{option} {text}")
    required |= _accuracy_test(given.get("accuracy_test"), has_accuracy=given.get("accuracy") is not None)
    required |= _teeth_requirement(like, given.get("teeth"), ratio)
    required |= _stiffness_requirement(given.get("stiffness"))
    _require_rising_torques(required)
    seat = _seat(like, given.get("holes"), given.get("allowed_holes"))
    return required | seat | _coupling(given.get("coupling"), given.get("shaft"))


def _quality(quality: str | None) -> Requirements:
    """Return the required quality, empty if it is not stated. Raises UsageError for an unknown quality."""
    if quality is None:
        return {}
    if quality not in _QUALITIES:
        message = f"invalid --quality {shown(quality)}: expected one of {', '.join(_QUALITIES)}"
        raise UsageError(message, near_miss(quality, _QUALITIES))
    return {_QUALITY: SimilarValue(quality, "given", f"--quality {quality}")}


def _accuracy_test(test: str | None, *, has_accuracy: bool) -> Requirements:
    """Return the manufacturer's test of the accuracy, empty if it is not stated.

    Raises UsageError for an unknown test, or if the accuracy is not stated.
    """
    if test is None:
        return {}
    tests = field_table()[_ACCURACY_TEST].choices
    if test not in tests:
        message = f"invalid --accuracy-test {shown(test)}: expected one of {', '.join(tests)}"
        raise UsageError(message, near_miss(test, tests))
    if not has_accuracy:
        raise UsageError(
            "--accuracy-test states how the value of --accuracy is tested, but --accuracy is not given",
            "give both, for example --accuracy 30 --accuracy-test full_revolution",
        )
    return {_ACCURACY_TEST: SimilarValue(test, "given", f"--accuracy-test {test}")}


def _teeth_requirement(
    like: Drive,
    teeth: str | None,
    ratio: float | None,
) -> Requirements:
    """Return the required number of teeth, empty if neither teeth nor ratio are stated.

    Raises UsageError if they contradict each other.
    """
    required = {}
    z_of_teeth = None
    if teeth is not None:
        z_of_teeth = _teeth(teeth)
        required["gears.z_g"] = SimilarValue(z_of_teeth, "given", f"--teeth {z_of_teeth}/{z_of_teeth + 2}")
    if ratio is not None:
        z_g = _teeth_of_ratio(like, ratio)
        if z_of_teeth is not None and z_of_teeth != z_g:
            stated = required["gears.z_g"].ref
            message = f"{stated} contradicts --ratio {plain(ratio)}, which needs {z_g}/{z_g + 2} teeth"
            raise UsageError(message, "omit one of the two")
        required["gears.z_g"] = SimilarValue(z_g, "given", f"--ratio {plain(ratio)}, two waves")
    return required


def _stiffness_requirement(stiffness: str | None) -> Requirements:
    """Return the required stiffnesses [N*m/rad], empty if none are stated.

    Raises UsageError unless the number of stiffnesses is one or three.
    """
    if stiffness is None:
        return {}
    K = tuple(_measure("--stiffness", part, "N*m/rad") for part in stiffness.split(","))
    if len(K) not in (1, len(_SEGMENTS)):
        raise UsageError(
            f"invalid --stiffness {shown(stiffness)}: expected one number or three",
            "write K1,K2,K3, for example 3.1e4,5e4,5.7e4, or a single stiffness, which is taken as K3",
        )
    ref = f"--stiffness {','.join(map(plain, K))}; not fitted; compare with hdassist stiffness"
    if len(K) == 1:
        ref += "; the only stiffness of the data sheet, used as K3"
    return {STIFFNESS: SimilarValue(K, "given", ref)}


def _require_rising_torques(required: Requirements) -> None:
    """Raise UsageError if the ends of the segments of a torsion curve do not increase."""
    if "catalogue.T_1" not in required or "catalogue.T_2" not in required:
        return
    T_1 = required["catalogue.T_1"].value
    T_2 = required["catalogue.T_2"].value
    if T_1 >= T_2:
        raise UsageError(
            f"--T1 {plain(T_1)} N*m must be below --T2 {plain(T_2)} N*m",
            "state the smaller torque first, for example --T1 14 --T2 48",
        )


def _require_steel_cup(flexspline: str | None) -> None:
    """Raise UsageError for a kind of flexspline that is not modelled, with the reason."""
    if flexspline is None or flexspline == "cup":
        return
    if reason := _NOT_MODELLED.get(flexspline):
        raise UsageError(
            f"--flexspline {flexspline} is not supported: {reason}",
            "use hdassist only for drives with a steel flexspline of the cup type",
        )
    kinds = ("cup", *_NOT_MODELLED)
    message = f"invalid --flexspline {shown(flexspline)}: expected one of {', '.join(kinds)}"
    raise UsageError(message, near_miss(flexspline, kinds))


def _seat(
    like: Drive,
    holes: str | None,
    allowed: str | None,
) -> dict[str, SimilarValue]:
    """Return the fields of the fixed wheel's seat, by path.

    holes: number of bolt holes, 0 for a free angle.
    allowed: numbers of the usable holes, counted from 0, separated by commas.
    Raises UsageError for an invalid number, or a usable hole that the seat does not have.
    """
    count = like.mounting.holes
    seat: dict[str, SimilarValue] = {}
    if holes is not None:
        count = _hole_number("--holes", holes)
        if not like.allows("mounting.holes", count):
            raise UsageError(f"invalid --holes {count}: expected {field_table()['mounting.holes'].range_words()}")
        seat["mounting.holes"] = SimilarValue(count, "given", f"--holes {count}")
    if allowed is not None:
        numbers = tuple(_hole_number("--allowed-holes", part) for part in allowed.split(","))
        if count == 0:
            raise UsageError("--allowed-holes needs holes, but --holes 0 means a free angle", "omit one of the two")
        if len(set(numbers)) < len(numbers) or max(numbers) >= count:
            raise UsageError(
                f"invalid --allowed-holes {shown(allowed)}: expected different holes from 0 to {count - 1}",
                "set the number of holes of the seat with --holes N",
            )
        seat["mounting.allowed"] = SimilarValue(numbers, "given", f"--allowed-holes {','.join(map(str, numbers))}")
    return seat


def _hole_number(option: str, text: str) -> int:
    if not re.fullmatch(r"\s*[0-9]{1,6}\s*", text):
        raise UsageError(
            f"invalid {option} {shown(text)}: expected whole numbers",
            "write whole numbers, for example --holes 12 --allowed-holes 0,4,8",
        )
    return int(text)


def _teeth_of_ratio(like: Drive, ratio: float) -> int:
    """Return the number of teeth of the flexspline for the ratio of a drive that is mounted like another one."""
    if not (isfinite(ratio) and ratio > 0):
        raise UsageError(
            f"invalid --ratio {ratio:g}: expected a number above 0", "state the ratio, for example --ratio 100"
        )
    z_g = 2 * ratio if like.mounting.fixed == "rigid" else 2 * ratio - 2
    if not float(z_g).is_integer() or not like.allows("gears.z_g", z_g):
        raise UsageError(
            f"a ratio of {plain(ratio)} requires {z_g:g} flexspline teeth",
            f"choose a ratio that gives a whole number of teeth from {field_table()['gears.z_g'].range_words()}",
        )
    return int(z_g)


def _coupling(coupling: str | None, shaft: str | None) -> dict[str, SimilarValue]:
    """Return the fields of the wave generator's coupling, by path."""
    if (coupling == "overhung") != (shaft is not None):
        raise UsageError(
            "--coupling overhung and --shaft must be stated together",
            "give both, for example --coupling overhung --shaft 14x30",
        )
    if coupling is None:
        return {}
    if coupling not in (choices := field_table()["cam.coupling"].choices):
        raise UsageError(
            f"invalid --coupling {shown(coupling)}: expected one of {', '.join(choices)}", near_miss(coupling, choices)
        )
    kind = "given" if coupling != "unknown" else "assumed"
    values = {"cam.coupling": SimilarValue(coupling, kind, f"--coupling {coupling}")}
    if shaft is not None:
        sizes = re.fullmatch(r"\s*([0-9.]+)\s*x\s*([0-9.]+)\s*(?:mm)?\s*", shaft)
        if sizes is None:
            raise UsageError(
                f"invalid --shaft {shown(shaft)}: expected DIAMETERxOVERHANG in mm", "use, for example, 14x30"
            )
        for path, text in zip(("cam.shaft_d", "cam.overhang"), sizes.groups(), strict=True):
            values[path] = SimilarValue(_measure("--shaft", text, "mm"), "given", f"--shaft {shaft}")
    return values


def _teeth(text: str) -> int:
    match = re.fullmatch(r"\s*([0-9]{1,6})\s*(?:/\s*([0-9]{1,6})\s*)?", text)
    if match is None:
        raise UsageError(f"invalid --teeth {shown(text)!r}: expected two whole numbers", "use, for example, 160/162")
    z_g = int(match[1])
    if match[2] is not None and int(match[2]) != z_g + 2:
        raise UsageError(
            f"invalid --teeth {z_g}/{int(match[2])}: expected z_b - z_g = 2 (two waves)",
            f"state the flexspline first: {z_g}/{z_g + 2}",
        )
    return z_g


def option_value(
    option: str,
    text: str,
    unit: str,
) -> float:
    """Return the value of an option in a unit, from a text such as "26" or "26 N·m".

    Raises UsageError if the text is not such a value.
    """
    try:
        return float(read_number(scalar_value(text.strip()), unit))
    except InvalidValueError as fault:
        raise UsageError(f"invalid {option} {shown(text)!r}: {fault.message}", fault.hint) from None


def _measure(
    option: str,
    text: str,
    unit: str,
) -> float:
    value = option_value(option, text, unit)
    if not value > 0:
        raise UsageError(f"invalid {option} {shown(text)}: expected a number above 0", f"state the value in {unit}")
    return value
