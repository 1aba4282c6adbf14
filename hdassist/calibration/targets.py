"""Targets of a calibration: a YAML text that says which values to find, and what is known of the drive.

schema: hdassist.targets/1
name: acceptance rig, drive 17
unknowns:
  gears.j_n: {low: 0, high: 20}
  supports.C_2: {low: 5e3, high: 1e5, scale: log}
targets:
  - {quantity: F_ior, M_g: 80, phase: 180, value: 20.1, tolerance: 0.5}
  - {quantity: self_error, M_g: 80, low: 0.25, high: 2.0}
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as Folder
from typing import Any

import numpy as np

from hdassist.errors import DataError, PresetError
from hdassist.model.kinematics import Kinematics
from hdassist.preset import yamltext
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import kind_of, unit_of
from hdassist.preset.units import read_number
from hdassist.preset.yamltext import Findings, Path, Unread, near
from hdassist.readers.trace import read_trace

SCHEMA = "hdassist.targets/1"
LEAST_POINTS = 10  # of a trace
SHARE = 0.1  # of its width: how far outside a range counts as much as a tolerance does


@dataclass(frozen=True)
class Kind:
    """A quantity that can be a target: its unit and meaning, and what it is asked with (key: unit)."""

    unit: str
    meaning: str
    needs: Mapping[str, str]
    takes: Mapping[str, str]


TORQUE = {"M_g": "N*m"}
KINDS: dict[str, Kind] = {
    "F_ior": Kind(
        "arcsec", "F'_ior, full cycle; at a mounting phase, or as the wheel stands", TORQUE, {"phase": "deg"}
    ),
    "F_ior_max": Kind("arcsec", "greatest F'_ior over the mounting phase", TORQUE, {}),
    "F_ior_min": Kind("arcsec", "least F'_ior over the mounting phase", TORQUE, {}),
    "revolution_range": Kind("arcsec", "range within one cam revolution", TORQUE, {"phi_g0": "deg"}),
    "self_error": Kind("arcsec", "self error", TORQUE, {}),
    "torsional_stiffness": Kind(
        "N*m/rad", "chord of the stiffness curve, the shell's tube included", {"from": "N*m", "to": "N*m"}, {}
    ),
    "lost_motion": Kind("arcsec", "twist between minus and plus a torque", TORQUE, {}),
    "trace": Kind(
        "arcsec",
        "error over the cam angle, in a file that measure takes",
        {**TORQUE, "file": ""},
        {"phi_g0": "deg"},
    ),
}


@dataclass(frozen=True)
class Unknown:
    """A preset field to be found between two bounds, in its unit; log: searched by its logarithm."""

    path: str
    low: float
    high: float
    log: bool


@dataclass(frozen=True)
class Target:
    """A quantity that should be a value, or lie in low..high; tolerance is how far off counts as one.

    asked: the keys of its kind, in their units; trace: cam angles [deg], ascending, and errors [arcsec] measured there.
    """

    quantity: str
    asked: Mapping[str, Any]
    value: float | None
    low: float
    high: float
    tolerance: float
    trace: tuple[tuple[float, ...], tuple[float, ...]] | None = None

    def is_met(self, off: float) -> bool:
        """Whether a drive that is so many tolerances off meets it: within the tolerance, or inside the range."""
        return abs(off) <= 1 if self.value is not None else off == 0

    @property
    def words(self) -> str:
        """The target in short: quantity and what it is asked with."""
        keys = {**KINDS[self.quantity].needs, **KINDS[self.quantity].takes}
        parts = (f"{key} {value:g} {keys[key]}" if keys[key] else str(value) for key, value in self.asked.items())
        return ", ".join([self.quantity, *parts])


@dataclass(frozen=True)
class Targets:
    """What to find and what is known; name and sha256 say where that comes from."""

    name: str
    sha256: str
    unknowns: tuple[Unknown, ...]
    targets: tuple[Target, ...]


def read_targets(text: bytes, file: str, drive: Drive) -> Targets:
    """Read and validate a targets text for a drive.

    Arguments: text; file, its name in messages; drive, whose preset has to give the unknown fields a start.
    Raises PresetError with every finding.
    """
    document = yamltext.read(text, file)
    reader = _Reader(Findings(document, file), drive, Folder(file).parent)
    result = reader.read(document.data) if document.complete else None
    if reader.findings.items or result is None:
        raise PresetError(reader.findings.sorted())
    name, unknowns, targets = result
    return Targets(name, hashlib.sha256(text).hexdigest(), tuple(unknowns), tuple(targets))


class _Reader:
    def __init__(self, findings: Findings, drive: Drive, folder: Folder) -> None:
        self.findings, self.drive, self.folder = findings, drive, folder

    def number(self, path: Path, value: Any, unit: str) -> float | None:
        number = read_number(value, unit)
        if not isinstance(number, Unread):
            return number
        self.findings.refuse(path, number)
        return None

    def read(self, data: Any) -> tuple[str, list[Unknown], list[Target]] | None:
        if not isinstance(data, dict):
            self.findings.add((), "targets must be a table of keys", f"schema: {SCHEMA}, unknowns, targets", "")
            return None
        self._known((), data, ("schema", "name", "unknowns", "targets"))
        if data.get("schema") != SCHEMA:
            self.findings.add(("schema",), f"must be {SCHEMA}", got=None if "schema" in data else "")
        name = data.get("name", "")
        if not isinstance(name, str):
            self.findings.add(("name",), "must be text")
        unknowns = self._unknowns(data.get("unknowns"))
        targets = self._targets(data.get("targets"))
        return str(name), unknowns, targets

    def _known(self, path: Path, table: dict[str, Any], keys: tuple[str, ...]) -> None:
        for key in table:
            if key not in keys:
                hint = near(key, keys) or f"known: {', '.join(keys)}"
                self.findings.add((*path, key), "unknown key", hint, "", key=True)

    def _unknowns(self, data: Any) -> list[Unknown]:
        if not isinstance(data, dict) or not data:
            self.findings.add(("unknowns",), "needs at least one field", "like gears.j_n: {low: 0, high: 20}", "")
            return []
        found = (self._unknown(key, value) for key, value in data.items())
        return [unknown for unknown in found if unknown is not None]

    def _unknown(self, key: str, value: Any) -> Unknown | None:
        path = ("unknowns", key)
        numbers = {name for name, info in field_table().items() if kind_of(info) == "number"}
        if key not in numbers:
            self.findings.add(
                path, "names no measure of a preset", near(key, numbers) or "like gears.j_n", "", key=True
            )
            return None
        if not isinstance(value, dict):
            self.findings.add(path, "must be a table of keys", "like {low: 0, high: 20}")
            return None
        self._known(path, value, ("low", "high", "scale"))
        section, name = key.split(".")
        table = getattr(self.drive, section)
        start = getattr(table, name)
        if name not in table.model_fields_set or start is None:
            self.findings.add(
                path, "the preset gives it no value to start from", f"write {key} into the preset", "", key=True
            )
            return None
        low, high = (self._bound(path, value, bound) for bound in ("low", "high"))
        scale = value.get("scale", "linear")
        if scale not in ("linear", "log"):
            self.findings.add((*path, "scale"), "must be linear or log")
            return None
        if low is None or high is None:
            return None
        if not low < high or (scale == "log" and low <= 0):
            least = "above 0, " if scale == "log" else ""
            self.findings.add(path, f"low must be {least}below high", got=f"{low:g} to {high:g}")
            return None
        if not low <= start <= high:
            self.findings.add(
                path, "the preset's value lies outside the bounds", got=f"{start:g}, not in {low:g} to {high:g}"
            )
            return None
        if not (self.drive.allows(key, low) and self.drive.allows(key, high)):
            self.findings.add(path, "the bounds reach beyond what a preset allows", got=f"{low:g} to {high:g}")
            return None
        return Unknown(key, low, high, scale == "log")

    def _bound(self, path: Path, table: dict[str, Any], bound: str) -> float | None:
        if bound not in table:
            self.findings.add((*path, bound), "missing key", got="")
            return None
        return self.number((*path, bound), table[bound], unit_of(field_table()[str(path[1])]))

    def _targets(self, data: Any) -> list[Target]:
        if not isinstance(data, list) or not data:
            hint = "like - {quantity: F_ior_max, M_g: 80, value: 31, tolerance: 7 %}"
            self.findings.add(("targets",), "needs at least one target", hint, "")
            return []
        found = (self._target(("targets", index), item) for index, item in enumerate(data))
        return [target for target in found if target is not None]

    def _target(self, path: Path, item: Any) -> Target | None:
        if not isinstance(item, dict):
            self.findings.add(
                path, "must be a table of keys", "like {quantity: F_ior, M_g: 80, value: 20, tolerance: 1}"
            )
            return None
        quantity = item.get("quantity")
        if quantity not in KINDS:
            at = (*path, "quantity")
            self.findings.add(at, "names no quantity", near(str(quantity), KINDS) or f"known: {', '.join(KINDS)}")
            return None
        kind = KINDS[quantity]
        keys = {**kind.needs, **kind.takes}
        self._known(path, item, ("quantity", *keys, "value", "tolerance", "low", "high"))
        for key in kind.needs:
            if key not in item:
                self.findings.add((*path, key), f"missing key: {quantity} is asked with it", got="")
        asked: dict[str, Any] = {}
        for key in (k for k in keys if k in item):
            value = item[key] if not keys[key] else self.number((*path, key), item[key], keys[key])
            if key in ("M_g", "from", "to") and value == 0 and quantity != "torsional_stiffness":
                self.findings.add((*path, key), "a torque of 0 leaves the rotation undetermined")
            asked[key] = value
        trace = self._trace((*path, "file"), asked["file"]) if "file" in asked else None
        limits = self._limits(path, item, kind.unit, quantity)
        if limits is None or self.findings.is_bad(path):
            return None
        return Target(quantity, asked, *limits, trace)

    def _trace(self, path: Path, name: Any) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
        if not isinstance(name, str):
            self.findings.add(path, "must be the name of a file")
            return None
        u = Kinematics.of(self.drive).u
        try:
            trace = read_trace(self.folder / name, ratio=abs(u), fewest=LEAST_POINTS)
        except DataError as error:
            faults = map(str, error.findings) if isinstance(error, PresetError) else (error.message,)
            for fault in faults:
                self.findings.add(path, f"cannot be read: {fault}", error.hint)
            return None
        rows = np.concatenate([np.arange(sweep.start, sweep.stop) for sweep in trace.sweeps])
        rows = rows[np.argsort(trace.cam_deg[rows], kind="stable")]
        if trace.cam_deg[rows[0]] < 0:
            self.findings.add(path, f"needs cam angles from 0 on, not {trace.cam_deg[rows[0]]:g} deg")
            return None
        # two encoders give the opposite of F_kpp where both count the same way round, as they do if sense is that of u
        sign = -trace.sense * np.sign(u) if trace.sense else 1.0
        return tuple(trace.cam_deg[rows].tolist()), tuple((sign * trace.error_arcsec[rows]).tolist())

    def _limits(
        self, path: Path, item: dict[str, Any], unit: str, quantity: str
    ) -> tuple[float | None, float, float, float] | None:
        given = {key: item[key] for key in ("value", "low", "high") if key in item}
        if quantity == "trace":
            given["value"] = 0.0  # of the difference between measured and computed
        numbers = {key: self._in_unit((*path, key), value, unit) for key, value in given.items()}
        if set(numbers) not in ({"value"}, {"low"}, {"high"}, {"low", "high"}):
            self.findings.add(path, "needs either a value with its tolerance, or low, high or both", got="")
            return None
        if any(number is None for number in numbers.values()):
            return None
        value, low, high = (numbers.get(key) for key in ("value", "low", "high"))
        if value is not None:
            if "tolerance" not in item:
                self.findings.add((*path, "tolerance"), "missing key", "a number, or a share like 5 %", "")
                return None
            tolerance = self._tolerance(path, item["tolerance"], unit, value)
            return None if tolerance is None else (value, value - tolerance, value + tolerance, tolerance)
        if low is not None and high is not None and not low < high:
            self.findings.add(path, "low must be below high", got=f"{low:g} to {high:g}")
            return None
        width = abs(high - low) if low is not None and high is not None else abs((low or 0.0) + (high or 0.0))
        tolerance = SHARE * width or 1.0
        if "tolerance" in item:
            given_one = self._tolerance(path, item["tolerance"], unit, width)
            if given_one is None:
                return None
            tolerance = given_one
        infinite = float("inf")
        return None, (-infinite if low is None else low), (infinite if high is None else high), tolerance

    def _tolerance(self, path: Path, given: Any, unit: str, of: float) -> float | None:
        at = (*path, "tolerance")
        if isinstance(given, str) and given.strip().endswith("%"):
            share = yamltext.resolve(given.strip()[:-1].strip())
            number = share / 100 * abs(of) if isinstance(share, int | float) else None
        else:
            number = self._in_unit(at, given, unit)
            if number is None:
                return None
        if number is None or not 0 < number < float("inf"):
            self.findings.add(at, "must be above 0: a number, or a share like 5 %")
            return None
        return float(number)

    def _in_unit(self, path: Path, value: Any, unit: str) -> float | None:
        # stiffness against twist has no unit that a preset uses: a bare number
        angle = unit == "arcsec"
        number = self.number(path, value, "deg" if angle and isinstance(value, str) else "")
        return number * 3600 if number is not None and angle and isinstance(value, str) else number
