"""Targets of a calibration: a YAML text with the values to find, and the measured values of the drive.

schema: hdassist.targets/1
name: acceptance rig, drive 17
unknowns:
  gears.j_n: {low: 0, high: 20}
  supports.C_2:                     # between the ends of its range in the preset's source
targets:
  - {quantity: F_ior, M_g: 80, phase: 180, value: 20.1, tolerance: 0.5}
  - {quantity: K_1, value: 50e4, tolerance: 10 %}
  - {quantity: self_error, M_g: 80, low: 0.25, high: 2.0}
"""

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, Literal

from hdassist.belief.prior import LOGARITHMIC, FieldPrior, owner_of
from hdassist.errors import PresetError
from hdassist.preset import yamltext
from hdassist.preset.fields import Drive, measures
from hdassist.preset.kinds import plain, range_of, unit_of
from hdassist.preset.units import read_number
from hdassist.preset.yamltext import Document, InvalidValueError, Path, near_miss, ordered_findings

TARGETS_SCHEMA = "hdassist.targets/1"
RANGE_TOLERANCE = "10 %"  # of its greater end: how far outside a range counts as much as a tolerance does
INSIDE = 0.5  # tolerances that a fit is to lie inside a range, for its last step may end beside it
TEXT = "text"  # in place of a unit
KEY_UNITS = {"M_g": "N*m", "phase": "deg", "T_1": "N*m", "T_2": "N*m"}
# unit of each quantity, the keys that it needs and those that it takes
TARGET_KINDS: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "F_ior": ("arcsec", ("M_g",), ("phase",)),
    "F_ior_max": ("arcsec", ("M_g",), ()),  # over the mounting phase
    "F_ior_min": ("arcsec", ("M_g",), ()),
    "self_error": ("arcsec", ("M_g",), ()),
    **{f"K_{k}": ("N*m/rad", (), ("T_1", "T_2")) for k in (1, 2, 3)},  # on the weaker side
    "lost_motion": ("arcsec", (), ("M_g",)),  # by default at 4 % of the rated torque
}
PARTS: dict[str, tuple[type, str]] = {
    "unknowns": (dict, "gears.j_n: {low: 0, high: 20}"),
    "targets": (list, "- {quantity: F_ior_max, M_g: 80, value: 31, tolerance: 7 %}"),
}


@dataclass(frozen=True)
class CalibrationTarget:
    """A quantity that should lie in low..high, in its unit; tolerance is a deviation that counts as one.

    asked: values of the keys of its kind; value: the best one, None where any value in the range is.
    """

    quantity: str
    asked: Mapping[str, float]
    value: float | None
    low: float
    high: float
    tolerance: float

    @property
    def unit(self) -> str:
        """Unit of the quantity."""
        return TARGET_KINDS[self.quantity][0]

    def deviation(self, predicted: float, inside: float = 0.0) -> float:
        """Deviation of a predicted quantity in tolerances; 0 in a range made narrower by so many of them."""
        margin = min(inside * self.tolerance, (self.high - self.low) / 2)
        nearest = min(max(predicted, self.low + margin), self.high - margin)
        return (predicted - (nearest if self.value is None else self.value)) / self.tolerance

    @property
    def wanted(self) -> str:
        """The value with its tolerance, or the range, in words."""
        if self.value is not None:
            return f"{plain(self.value)} ± {self.tolerance:.3g}"
        return f"{plain(self.low)} to {plain(self.high)}".replace("-inf to", "at most").replace(" to inf", " or more")

    @property
    def words(self) -> str:
        """The target in short: quantity and its arguments."""
        return ", ".join([self.quantity, *(f"{key} {value:g} {KEY_UNITS[key]}" for key, value in self.asked.items())])


@dataclass(frozen=True)
class Targets:
    """Fields to find, even between their bounds, and targets to meet; name and SHA-256 of the text that states them."""

    name: str
    sha256: str
    unknowns: tuple[FieldPrior, ...]
    targets: tuple[CalibrationTarget, ...]

    def by_path(self, values: Iterable[float]) -> dict[str, float]:
        """Values of the unknowns, in their order, by the path of each."""
        return {unknown.path: value for unknown, value in zip(self.unknowns, values, strict=True)}

    def deviations(self, predictions: Sequence[float], inside: float = 0.0) -> list[float]:
        """Deviation of the prediction from each target, as that target's own deviation has it."""
        return [target.deviation(each, inside) for target, each in zip(self.targets, predictions, strict=True)]

    def met(self, predictions: Sequence[float]) -> list[bool]:
        """Which targets are met by their predictions."""
        return [target.low <= each <= target.high for target, each in zip(self.targets, predictions, strict=True)]


def read_targets(text: bytes, file: str, drive: Drive) -> Targets:
    """Read and validate a targets text for a drive.

    Arguments: text; file, its name in messages; drive, the ranges of whose source are bounds where none are given.
    Raises PresetError with every finding.
    """
    document = yamltext.read_yaml(text, file)
    if document.findings:
        raise PresetError(ordered_findings(document.findings))
    data = {"name": ""} | _numbers(document, (), document.data, {"schema": None, "name": TEXT, **dict.fromkeys(PARTS)})
    if data.get("schema") != TARGETS_SCHEMA:
        document.add(("schema",), f"must be {TARGETS_SCHEMA}")
    for key, (kind, example) in PARTS.items():
        if not (isinstance(data.get(key), kind) and data[key]):
            document.add((key,), "needs at least one entry", f"like {example}")
            data[key] = kind()
    unknowns = [each for key, value in data["unknowns"].items() for each in _unknown(document, key, value, drive)]
    targets = [each for number, item in enumerate(data["targets"]) for each in _target(document, number, item)]
    if document.findings:
        raise PresetError(ordered_findings(document.findings))
    return Targets(data["name"], hashlib.sha256(text).hexdigest(), tuple(unknowns), tuple(targets))


def _numbers(
    document: Document, path: Path, table: Any, units: Mapping[str, str | None], needs: Iterable[str] = ()
) -> dict[str, Any]:
    """Values of the keys of a table that can be read; faults are added to the findings.

    Arguments: units by key, TEXT for a text and None for a value as it stands; needs, keys that must be given.
    """
    if not isinstance(table, dict):
        document.add(path, "must be a table of keys", f"known keys: {', '.join(units)}")
        return {}
    for key in needs:
        if key not in table:
            document.add((*path, key), "missing key", got="")
    values: dict[str, Any] = {}
    for key, value in table.items():
        at, unit = (*path, key), units.get(key)
        if unit in (TEXT, None):
            values[key] = value
        elif (number := document.read(at, read_number, value, unit)) is not None:
            values[key] = number
        if key not in units:
            document.add(at, "unknown key", near_miss(key, units) or f"known: {', '.join(units)}", "", key=True)
        elif unit == TEXT and not isinstance(value, str):
            document.add(at, "must be text")
    return values


def _unknown(document: Document, key: str, value: Any, drive: Drive) -> Iterator[FieldPrior]:
    path, source = ("unknowns", key), drive.source.get(key)
    if key not in measures():
        document.add(path, "names no measure of a preset", near_miss(key, measures()) or "like gears.j_n", "", key=True)
        return
    plausible = dict(zip(("low", "high"), source.range, strict=True)) if source and source.range else {}
    units = dict.fromkeys(("low", "high"), unit_of(measures()[key]))
    bounds = plausible | _numbers(
        document, path, {} if value is None else value, units, [end for end in units if end not in plausible]
    )
    if bounds.keys() != units.keys():
        return
    low, high = bounds["low"], bounds["high"]
    if not low < high or not (drive.allows(key, low) and drive.allows(key, high)):
        document.add(path, f"low must be below high, both within {range_of(measures()[key])}", got=f"{low:g}, {high:g}")
    scale: Literal["logarithmic", "even"] = "logarithmic" if low > 0 and high / low > LOGARITHMIC else "even"
    yield FieldPrior(key, scale, low, high, owner_of(drive, key), key, "bounds of the calibration")


def _target(document: Document, number: int, item: Any) -> Iterator[CalibrationTarget]:
    path: Path = ("targets", number)
    quantity = item.get("quantity") if isinstance(item, dict) else None
    if not isinstance(quantity, str) or quantity not in TARGET_KINDS:
        hint = near_miss(str(quantity), TARGET_KINDS) or f"known: {', '.join(TARGET_KINDS)}"
        document.add((*path, "quantity"), "names no quantity", hint)
        return
    unit, needs, takes = TARGET_KINDS[quantity]
    units = {"quantity": TEXT, **{key: KEY_UNITS[key] for key in (*needs, *takes)}, "tolerance": None}
    faults = len(document.findings)
    given = _numbers(document, path, item, units | dict.fromkeys(("value", "low", "high"), unit), needs)
    for key in ("M_g", "T_1", "T_2"):
        if given.get(key) == 0:
            document.add((*path, key), "a torque of 0 leaves the rotation undetermined")
    if len(document.findings) > faults:
        return
    value, low, high = given.get("value"), given.get("low", -inf), given.get("high", inf)
    if (value is None) == given.keys().isdisjoint(("low", "high")) or not low < high:
        document.add(path, "needs either a value with its tolerance, or low, high or both, low below high", got="")
        return
    ends = (low, high) if value is None else (value, value)
    whole = max(abs(end) for end in ends if isfinite(end))  # the base of a share
    stated = given.get("tolerance", RANGE_TOLERANCE if value is None else None)
    is_share = isinstance(stated, str) and stated.strip().endswith("%")
    try:
        tolerance = read_number(stated, "%" if is_share else unit) * (whole / 100 if is_share else 1)
    except InvalidValueError:
        tolerance = 0.0
    if not 0 < tolerance < inf:
        document.add((*path, "tolerance"), "must be above 0: a number, or a share like 5 %")
        return
    low, high = ends if value is None else (value - tolerance, value + tolerance)
    yield CalibrationTarget(
        quantity, {key: given[key] for key in KEY_UNITS if key in given}, value, low, high, tolerance
    )
