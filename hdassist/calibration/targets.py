"""Targets of a calibration: a YAML text that says which values to find, and what is known of the drive.

schema: hdassist.targets/1
name: acceptance rig, drive 17
unknowns:
  gears.j_n: {low: 0, high: 20}
  supports.C_2: {scale: log}        # between the ends of its range in the preset's source
targets:
  - {quantity: F_ior, M_g: 80, phase: 180, value: 20.1, tolerance: 0.5}
  - {quantity: K_1, value: 50e4, tolerance: 10 %}
  - {quantity: self_error, M_g: 80, low: 0.25, high: 2.0}
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path as Folder
from typing import Any, TypeVar

import numpy as np

from hdassist.errors import DataError, PresetError
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.preset import yamltext
from hdassist.preset.fields import Drive, field_table, measures
from hdassist.preset.kinds import unit_of
from hdassist.preset.units import read_number
from hdassist.preset.yamltext import Document, InvalidValue, Path, near_miss, ordered_findings
from hdassist.readers.trace import read_trace

TARGETS_SCHEMA = "hdassist.targets/1"
FEWEST_READINGS = 10  # of a trace
RANGE_SHARE = 0.1  # of its width: how far outside a range counts as much as a tolerance does
_Value = TypeVar("_Value")
TEXT = "text"  # in place of a unit
SHARE_HINT = "a number, or a share like 5 %"


@dataclass(frozen=True)
class TargetKind:
    """A quantity that can be a target: its unit, and units of the keys that it needs and takes, or TEXT."""

    unit: str
    needs: Mapping[str, str]
    takes: Mapping[str, str]

    @property
    def keys(self) -> dict[str, str]:
        """Units of all keys that it is asked with."""
        return {**self.needs, **self.takes}


_AT_TORQUE = {"M_g": "N*m"}
_STIFFNESS = TargetKind("N*m/rad", {}, {"T_1": "N*m", "T_2": "N*m"})  # on the weaker side; ends of the segments
TARGET_KINDS: dict[str, TargetKind] = {
    "F_ior": TargetKind("arcsec", _AT_TORQUE, {"phase": "deg"}),
    "F_ior_max": TargetKind("arcsec", _AT_TORQUE, {}),  # over the mounting phase
    "F_ior_min": TargetKind("arcsec", _AT_TORQUE, {}),
    "revolution_range": TargetKind("arcsec", _AT_TORQUE, {"phi_g0": "deg"}),
    "self_error": TargetKind("arcsec", _AT_TORQUE, {}),
    "torsional_stiffness": TargetKind("N*m/rad", {"from": "N*m", "to": "N*m"}, {}),  # chord, tube of the shell included
    "K_1": _STIFFNESS,
    "K_2": _STIFFNESS,
    "K_3": _STIFFNESS,
    "lost_motion": TargetKind("arcsec", {}, _AT_TORQUE),  # by default at 4 % of the rated torque
    "trace": TargetKind("arcsec", {**_AT_TORQUE, "file": TEXT}, {"phi_g0": "deg"}),
}


@dataclass(frozen=True)
class SoughtField:
    """A preset field to be found between two bounds, in its unit; log: searched by its logarithm.

    start: the preset's value or its default, or, of a field that has none, the middle between the bounds.
    """

    path: str
    low: float
    high: float
    log: bool
    start: float

    @property
    def unit(self) -> str:
        """Unit of the field."""
        return unit_of(field_table()[self.path])


@dataclass(frozen=True)
class CalibrationTarget:
    """A quantity that should be a value, or lie in low..high, in its unit; tolerance is a deviation that counts as one.

    asked: values of the keys of its kind; trace: cam angles [deg], ascending, and errors [arcsec] measured there, empty
    for any other quantity; trace_sha256: of its file.
    """

    quantity: str
    asked: Mapping[str, Any]
    value: float | None
    low: float
    high: float
    tolerance: float
    trace: tuple[tuple[float, ...], ...] = ()
    trace_sha256: str = ""

    @property
    def residual_count(self) -> int:
        """Number of residuals: one, or one for each reading of a trace."""
        return len(self.trace[0]) if self.trace else 1

    @property
    def unit(self) -> str:
        """Unit of the quantity."""
        return TARGET_KINDS[self.quantity].unit

    def residuals(self, predicted: Array, margin: float = 0.0) -> Array:
        """Deviations in tolerances, 0 inside a range made narrower by a margin [tolerances]; of a trace over sqrt(n).

        Argument: predicted, the quantity, shape (1,), or what a trace is off, shape (readings,).
        """
        wanted = self.value
        if wanted is None:
            inside = min(margin * self.tolerance, (self.high - self.low) / 2)
            wanted = float(np.clip(predicted[0], self.low + inside, self.high - inside))
        return np.asarray((predicted - wanted) / self.tolerance / np.sqrt(len(predicted)))

    def is_met(self, deviation: float) -> bool:
        """Whether a deviation [tolerances] meets it: within the tolerance, or inside the range."""
        return abs(deviation) <= 1 if self.value is not None else deviation == 0

    @property
    def words(self) -> str:
        """The target in short: quantity and what it is asked with."""
        keys = TARGET_KINDS[self.quantity].keys
        parts = (
            str(value) if keys[key] == TEXT else f"{key} {value:g} {keys[key]}" for key, value in self.asked.items()
        )
        return ", ".join([self.quantity, *parts])


@dataclass(frozen=True)
class Targets:
    """Fields to find and targets to meet; name and sha256 of the text that states them."""

    name: str
    sha256: str
    unknowns: tuple[SoughtField, ...]
    targets: tuple[CalibrationTarget, ...]

    @property
    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file that they were read from: targets, and traces by their names in it."""
        traces = {f"trace {t.asked['file']}": t.trace_sha256 for t in self.targets if t.trace}
        return {"targets": self.sha256, **traces}

    def by_path(self, values: Iterable[_Value]) -> dict[str, _Value]:
        """Values of the unknowns, in their order, by the path of each."""
        return {unknown.path: value for unknown, value in zip(self.unknowns, values, strict=True)}


def read_targets(text: bytes, file: str, drive: Drive) -> Targets:
    """Read and validate a targets text for a drive.

    Arguments: text; file, its name in messages; drive, whose preset has to give the unknown fields a start.
    Raises PresetError with every finding.
    """
    document = yamltext.read_yaml(text, file)
    reader = _TargetsReader(document, drive, Folder(file).parent)
    result = None if isinstance(document.data, InvalidValue) else reader.read(document.data)
    if document.findings or result is None:
        raise PresetError(ordered_findings(document.findings))
    name, unknowns, targets = result
    return Targets(name, hashlib.sha256(text).hexdigest(), tuple(unknowns), tuple(targets))


class _TargetsReader:
    """Data of a targets text to targets; faults are added to findings."""

    def __init__(self, findings: Document, drive: Drive, folder: Folder) -> None:
        self.findings, self.drive, self.folder = findings, drive, folder

    def read(self, data: Any) -> tuple[str, list[SoughtField], list[CalibrationTarget]] | None:
        add = self.findings.add
        if not isinstance(data, dict):
            add((), "targets must be a table of keys", f"schema: {TARGETS_SCHEMA}, unknowns, targets", "")
            return None
        units = {"name": TEXT, "unknowns": None, "targets": None, "schema": None}
        head = self._values((), {"schema": None, **data}, units, ())
        if head and data.get("schema") != TARGETS_SCHEMA:
            add(("schema",), f"must be {TARGETS_SCHEMA}")
        unknowns, targets = data.get("unknowns"), data.get("targets")
        if not isinstance(unknowns, dict) or not unknowns:
            add(("unknowns",), "needs at least one field", "like gears.j_n: {low: 0, high: 20}", "")
            unknowns = {}
        if not isinstance(targets, list) or not targets:
            hint = "like - {quantity: F_ior_max, M_g: 80, value: 31, tolerance: 7 %}"
            add(("targets",), "needs at least one target", hint, "")
            targets = []
        sought = [self._unknown(key, value) for key, value in unknowns.items()]
        known = [self._target(("targets", index), item) for index, item in enumerate(targets)]
        return head.get("name", ""), list(filter(None, sought)), list(filter(None, known))

    def _values(
        self, path: Path, table: dict[str, Any], units: Mapping[str, str | None], needs: Iterable[str], need: str = ""
    ) -> dict[str, Any]:
        """Values of the keys of a table, numbers in their units; none where one of them is wrong.

        Arguments: units by key, TEXT for a text and None for a value as it stands; needs, keys that must be given;
        need, words behind "missing key".
        """
        values: dict[str, Any] = {}
        for key in needs:
            if key not in table:
                self.findings.add((*path, key), f"missing key{need}", got="")
        for key, value in table.items():
            at, unit = (*path, key), units.get(key)
            if key not in units:
                self.findings.add(
                    at, "unknown key", near_miss(key, units) or f"known: {', '.join(units)}", "", key=True
                )
            elif isinstance(read := value if unit in (TEXT, None) else read_number(value, unit), InvalidValue):
                self.findings.refuse(at, read)
            elif unit == TEXT and not isinstance(value, str):
                self.findings.add(at, "must be the name of a file" if key == "file" else "must be text")
            else:
                values[key] = read
        return values if values.keys() == {*table, *needs} else {}

    def _unknown(self, key: str, value: Any) -> SoughtField | None:
        path, add = ("unknowns", key), self.findings.add
        if key not in measures():
            add(path, "names no measure of a preset", near_miss(key, measures()) or "like gears.j_n", "", key=True)
            return None
        if value is not None and not isinstance(value, dict):
            add(path, "must be a table of keys", "like {low: 0, high: 20}")
            return None
        source = self.drive.source.get(key)
        plausible = dict(zip(("low", "high"), source.range, strict=True)) if source and source.range else {}
        unit = unit_of(measures()[key])
        need = "" if plausible else f", and no range at source.{key} of the preset"
        units = {"low": unit, "high": unit, "scale": None}
        bounds = self._values(path, {**plausible, **(value or {})}, units, ["low", "high"], need)
        if not bounds:
            return None
        low, high, scale = bounds["low"], bounds["high"], bounds.get("scale", "linear")
        if scale not in ("linear", "log"):
            add((*path, "scale"), "must be linear or log")
            return None
        got, start, log = f"{low:g} to {high:g}", self.drive.value(key), scale == "log"
        if not low < high or (log and low <= 0):
            add(path, f"low must be {'above 0, ' if log else ''}below high", got=got)
            return None
        if start is None:
            start = (low * high) ** 0.5 if log else (low + high) / 2
        if not low <= start <= high:
            add(path, "the preset's value lies outside the bounds", got=f"{start:g}, not in {got}")
        elif not (self.drive.allows(key, low) and self.drive.allows(key, high)):
            add(path, "the bounds reach beyond what a preset allows", got=got)
        return SoughtField(key, low, high, log, start)

    def _target(self, path: Path, item: Any) -> CalibrationTarget | None:
        if not isinstance(item, dict):
            hint = "like {quantity: F_ior, M_g: 80, value: 20, tolerance: 1}"
            self.findings.add(path, "must be a table of keys", hint)
            return None
        quantity = item.get("quantity")
        if not isinstance(quantity, str) or quantity not in TARGET_KINDS:
            hint = near_miss(str(quantity), TARGET_KINDS) or f"known: {', '.join(TARGET_KINDS)}"
            self.findings.add((*path, "quantity"), "names no quantity", hint)
            return None
        kind, is_trace = TARGET_KINDS[quantity], quantity == "trace"
        # a trace has no value: its difference from the computed one should be none
        limits = {} if is_trace else dict.fromkeys(("value", "low", "high"), kind.unit)
        units = {"quantity": TEXT, **kind.keys, **limits, "tolerance": None}
        given = self._values(path, item, units, kind.needs, f": {quantity} is asked with it")
        for key in ("M_g", "from", "to", "T_1", "T_2"):
            if given.get(key) == 0 and quantity != "torsional_stiffness":
                self.findings.add((*path, key), "a torque of 0 leaves the rotation undetermined")
        if not given:
            return None
        curve, sha256 = self._trace((*path, "file"), given) if is_trace else ((), "")
        wanted = self._limits(path, {"value": 0.0, **given} if is_trace else given, kind.unit)
        asked = {key: given[key] for key in kind.keys if key in given}
        return CalibrationTarget(quantity, asked, *wanted, curve, sha256) if wanted else None

    def _trace(self, path: Path, given: dict[str, Any]) -> tuple[tuple[tuple[float, ...], ...], str]:
        """Cam angles phi_h [deg], ascending, and errors [arcsec] of a file of a trace, and its SHA-256."""
        u = Kinematics.of(self.drive).u
        try:
            trace = read_trace(self.folder / given["file"], ratio=abs(u), fewest=FEWEST_READINGS)
        except DataError as error:
            faults = map(str, error.findings) if isinstance(error, PresetError) else (error.message,)
            for fault in faults:
                self.findings.add(path, f"cannot be read: {fault}", error.hint)
            return (), ""
        rows = np.concatenate([np.arange(sweep.start, sweep.stop) for sweep in trace.sweeps])
        # an angle of the output that grows where the cam's falls, and is phi_g0 where that is 0
        by_output = trace.angle_of == "output"
        phi_h = trace.cam_deg * np.sign(u) - u * given.get("phi_g0", 0.0) if by_output else trace.cam_deg
        rows = rows[np.argsort(phi_h[rows], kind="stable")]
        # two encoders give the opposite of F_kpp where both count the same way round, as they do if sense is that of u
        sign = -trace.sense * np.sign(u) if trace.sense else 1.0
        curve = tuple(phi_h[rows].tolist()), tuple((sign * trace.error_arcsec[rows]).tolist())
        return curve, trace.sha256

    def _limits(self, path: Path, given: dict[str, Any], unit: str) -> tuple[float | None, float, float, float] | None:
        """Value, low, high and tolerance of a target."""
        value, stated, at = given.get("value"), given.get("tolerance"), (*path, "tolerance")
        low, high = given.get("low", -inf), given.get("high", inf)
        if (value is None) == given.keys().isdisjoint(("low", "high")):
            self.findings.add(path, "needs either a value with its tolerance, or low, high or both", got="")
            return None
        if value is not None and stated is None:
            self.findings.add(at, "missing key", SHARE_HINT, "")
            return None
        if not low < high:
            self.findings.add(path, "low must be below high", got=f"{low:g} to {high:g}")
            return None
        width = high - low if high - low < inf else min(abs(low), abs(high))
        whole = width if value is None else abs(value)  # what a share is of
        if stated is None:
            tolerance = RANGE_SHARE * whole or 1.0
        elif isinstance(stated, str) and stated.strip().endswith("%"):
            share = read_number(stated, "%")
            tolerance = 0.0 if isinstance(share, InvalidValue) else share / 100 * whole
        elif isinstance(read := read_number(stated, unit), InvalidValue):
            self.findings.refuse(at, read)
            return None
        else:
            tolerance = read
        if not 0 < tolerance < inf:
            self.findings.add(at, f"must be above 0: {SHARE_HINT}")
            return None
        if value is not None:
            low, high = value - tolerance, value + tolerance
        return value, low, high, float(tolerance)
