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
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PlainValidator, ValidationError, create_model
from pydantic_core import ErrorDetails, PydanticCustomError

from hdassist.errors import DataError, PresetError
from hdassist.model.kinematics import Kinematics
from hdassist.preset import yamltext
from hdassist.preset.fields import Drive, field_table, measures
from hdassist.preset.kinds import unit_of
from hdassist.preset.units import read_number
from hdassist.preset.yamltext import Findings, Path, Unread, in_order, near
from hdassist.readers.trace import read_trace

SCHEMA = "hdassist.targets/1"
LEAST_POINTS = 10  # of a trace
RANGE_SHARE = 0.1  # of its width: how far outside a range counts as much as a tolerance does
ROUNDED = 1e-3  # of a bound: how far beyond it a found value may be, as it has four digits
CLOSED = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


@dataclass(frozen=True)
class TargetKind:
    """A quantity that can be a target: its unit and meaning, and what it is asked with (key: unit)."""

    unit: str
    meaning: str
    needs: Mapping[str, str]
    takes: Mapping[str, str]

    @property
    def keys(self) -> dict[str, str]:
        """All that it is asked with."""
        return {**self.needs, **self.takes}


TORQUE = {"M_g": "N*m"}
ENDS = {"T_1": "N*m", "T_2": "N*m"}  # of the first and the second segment, where a data sheet has its own
KINDS: dict[str, TargetKind] = {
    "F_ior": TargetKind(
        "arcsec", "F'_ior, full cycle; at a mounting phase, or as the wheel stands", TORQUE, {"phase": "deg"}
    ),
    "F_ior_max": TargetKind("arcsec", "greatest F'_ior over the mounting phase", TORQUE, {}),
    "F_ior_min": TargetKind("arcsec", "least F'_ior over the mounting phase", TORQUE, {}),
    "revolution_range": TargetKind("arcsec", "range within one cam revolution", TORQUE, {"phi_g0": "deg"}),
    "self_error": TargetKind("arcsec", "self error", TORQUE, {}),
    "torsional_stiffness": TargetKind(
        "N*m/rad", "chord of the stiffness curve, the shell's tube included", {"from": "N*m", "to": "N*m"}, {}
    ),
    "K_1": TargetKind("N*m/rad", "stiffness of the first segment, on the weaker side", {}, ENDS),
    "K_2": TargetKind("N*m/rad", "stiffness of the second segment, on the weaker side", {}, ENDS),
    "K_3": TargetKind("N*m/rad", "stiffness of the third segment, on the weaker side", {}, ENDS),
    "lost_motion": TargetKind(
        "arcsec", "twist between minus and plus a torque, by default 4 % of the rated torque", {}, TORQUE
    ),
    "trace": TargetKind(
        "arcsec", "error over the cam angle, in a file that measure takes", {**TORQUE, "file": ""}, {"phi_g0": "deg"}
    ),
}


@dataclass(frozen=True)
class Unknown:
    """A preset field to be found between two bounds, in its unit; log: searched by its logarithm.

    start: the preset's value or its default, or, of a field that has none, the middle between the bounds.
    """

    path: str
    low: float
    high: float
    log: bool
    start: float

    def allows(self, value: float) -> bool:
        """Whether a value lies between the bounds, to the digits of a found value."""
        return self.low - ROUNDED * abs(self.low) <= value <= self.high + ROUNDED * abs(self.high)

    @property
    def unit(self) -> str:
        """Unit of the field."""
        return unit_of(field_table()[self.path])


@dataclass(frozen=True)
class Target:
    """A quantity that should be a value, or lie in low..high; tolerance is how far off counts as one.

    asked: the keys of its kind, in their units; trace: cam angles [deg], ascending, and errors [arcsec] measured there;
    trace_sha256, of its file.
    """

    quantity: str
    asked: Mapping[str, Any]
    value: float | None
    low: float
    high: float
    tolerance: float
    trace: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    trace_sha256: str = ""

    @property
    def residuals(self) -> int:
        """Number of values that say how far off a drive is: one for each row of a trace."""
        return len(self.trace[0]) if self.trace else 1

    @property
    def unit(self) -> str:
        """Unit of the quantity."""
        return KINDS[self.quantity].unit

    def is_met(self, off: float) -> bool:
        """Whether a drive that is so many tolerances off meets it: within the tolerance, or inside the range."""
        return abs(off) <= 1 if self.value is not None else off == 0

    @property
    def words(self) -> str:
        """The target in short: quantity and what it is asked with."""
        keys = KINDS[self.quantity].keys
        parts = (f"{key} {value:g} {keys[key]}" if keys[key] else str(value) for key, value in self.asked.items())
        return ", ".join([self.quantity, *parts])


@dataclass(frozen=True)
class Targets:
    """What to find and what is known; name and sha256 say where that comes from."""

    name: str
    sha256: str
    unknowns: tuple[Unknown, ...]
    targets: tuple[Target, ...]

    @property
    def inputs(self) -> dict[str, str]:
        """SHA-256 of each file that they were read from: targets, and traces by their names in it."""
        traces = {f"trace {t.asked['file']}": t.trace_sha256 for t in self.targets if t.trace}
        return {"targets": self.sha256, **traces}

    def by_path(self, values: Iterable[float]) -> dict[str, float]:
        """Values of the unknowns, in their order, by the path of each."""
        return {unknown.path: value for unknown, value in zip(self.unknowns, values, strict=True)}


def read_targets(text: bytes, file: str, drive: Drive) -> Targets:
    """Read and validate a targets text for a drive.

    Arguments: text; file, its name in messages; drive, whose preset has to give the unknown fields a start.
    Raises PresetError with every finding.
    """
    document = yamltext.read(text, file)
    reader = _Reader(Findings(document, file), drive, Folder(file).parent)
    result = reader.read(document.data) if document.complete else None
    if reader.findings.items or result is None:
        raise PresetError(in_order(reader.findings.items))
    name, unknowns, targets = result
    return Targets(name, hashlib.sha256(text).hexdigest(), tuple(unknowns), tuple(targets))


class Percent(float):
    """A tolerance as a share of the value, or of the width of the range."""


def _number(value: Any, unit: str) -> float:
    """A finite number in a unit, from a number or a text with a unit."""
    number = read_number(value, unit)
    if isinstance(number, Unread):
        raise PydanticCustomError("unread", "no number", {"unread": number})
    return number


def _tolerance(value: Any, unit: str) -> float:
    if isinstance(value, str) and value.strip().endswith("%"):
        share = yamltext.resolve(value.strip()[:-1].strip())
        # what is no number is not above 0 either, and is told so
        return Percent(share if isinstance(share, int | float) and not isinstance(share, bool) else 0)
    return float(_number(value, unit))


def _in(unit: str) -> Any:
    return Annotated[float, PlainValidator(lambda value: _number(value, unit))]


class _Head(BaseModel):
    model_config = CLOSED

    stated_schema: Literal["hdassist.targets/1"] = Field(alias="schema")
    name: str = ""
    unknowns: Any = None
    targets: Any = None


def _bounds(unit: str) -> type[BaseModel]:
    """Model of the bounds of a field in a unit."""
    scale = Literal["linear", "log"]
    return create_model(
        "Bounds", __config__=CLOSED, low=(_in(unit), ...), high=(_in(unit), ...), scale=(scale, "linear")
    )


def _written(kind: TargetKind) -> type[BaseModel]:
    """Model of a target as it is written."""
    keys: dict[str, Any] = {key: (_in(unit) if unit else str, ...) for key, unit in kind.needs.items()}
    keys |= {key: (_in(unit), None) for key, unit in kind.takes.items()}
    if "file" not in keys:  # the difference between a trace and the computed one should be none
        keys |= {key: (_in(kind.unit), None) for key in ("value", "low", "high")}
    tolerance = Annotated[float, PlainValidator(lambda value: _tolerance(value, kind.unit))]
    return create_model("Target", __config__=CLOSED, quantity=(str, ...), **keys, tolerance=(tolerance, None))


class _Reader:
    """Data of a targets text to what they mean; what is wrong is added to findings."""

    def __init__(self, findings: Findings, drive: Drive, folder: Folder) -> None:
        self.findings, self.drive, self.folder = findings, drive, folder

    def read(self, data: Any) -> tuple[str, list[Unknown], list[Target]] | None:
        if not isinstance(data, dict):
            self.findings.add((), "targets must be a table of keys", f"schema: {SCHEMA}, unknowns, targets", "")
            return None
        head = self._checked((), {"schema": None, **data}, _Head)
        unknowns, targets = data.get("unknowns"), data.get("targets")
        if not isinstance(unknowns, dict) or not unknowns:
            self.findings.add(("unknowns",), "needs at least one field", "like gears.j_n: {low: 0, high: 20}", "")
            unknowns = {}
        if not isinstance(targets, list) or not targets:
            hint = "like - {quantity: F_ior_max, M_g: 80, value: 31, tolerance: 7 %}"
            self.findings.add(("targets",), "needs at least one target", hint, "")
            targets = []
        sought = [self._unknown(key, value) for key, value in unknowns.items()]
        known = [self._target(("targets", index), item) for index, item in enumerate(targets)]
        return head.get("name", ""), list(filter(None, sought)), list(filter(None, known))

    def _checked(self, path: Path, table: dict[str, Any], model: type[BaseModel], needed: str = "") -> dict[str, Any]:
        """Keys given, with their values; none where something is wrong. Arguments: needed, words on a missing key."""
        try:
            found = model.model_validate(table)
        except ValidationError as error:
            for problem in error.errors(include_url=False):
                self._add((*path, str(problem["loc"][0])), problem, model, needed)
            return {}
        return {key: getattr(found, key) for key in found.model_fields_set}

    def _add(self, path: Path, problem: ErrorDetails, model: type[BaseModel], needed: str) -> None:
        """Add what pydantic found, in the words of somebody who writes targets."""
        keys, context = [info.alias or key for key, info in model.model_fields.items()], problem.get("ctx", {})
        unread = context.get("unread", problem["input"])
        if problem["type"] == "missing":
            self.findings.add(path, f"missing key{needed}", got="")
        elif problem["type"] == "extra_forbidden":
            self.findings.add(
                path, "unknown key", near(str(path[-1]), keys) or f"known: {', '.join(keys)}", "", key=True
            )
        elif isinstance(unread, Unread):
            self.findings.refuse(path, unread)
        elif problem["type"] == "literal_error":
            self.findings.add(path, f"must be {context['expected'].replace(chr(39), '')}")
        else:
            self.findings.add(path, "must be the name of a file" if path[-1] == "file" else "must be text")

    def _unknown(self, key: str, value: Any) -> Unknown | None:
        path, add = ("unknowns", key), self.findings.add
        if key not in measures():
            add(path, "names no measure of a preset", near(key, measures()) or "like gears.j_n", "", key=True)
            return None
        if value is not None and not isinstance(value, dict):
            add(path, "must be a table of keys", "like {low: 0, high: 20}")
            return None
        source = self.drive.source.get(key)
        plausible = dict(zip(("low", "high"), source.range, strict=True)) if source and source.range else {}
        lacking = "" if plausible else f", and no range at source.{key} of the preset"
        bounds = self._checked(path, {**plausible, **(value or {})}, _bounds(unit_of(measures()[key])), lacking)
        if not bounds:
            return None
        low, high, log = bounds["low"], bounds["high"], bounds.get("scale") == "log"
        got, start = f"{low:g} to {high:g}", self.drive.value(key)
        if not low < high or (log and low <= 0):
            add(path, f"low must be {'above 0, ' if log else ''}below high", got=got)
            return None
        if start is None:
            start = (low * high) ** 0.5 if log else (low + high) / 2
        if not low <= start <= high:
            add(path, "the preset's value lies outside the bounds", got=f"{start:g}, not in {got}")
        elif not (self.drive.allows(key, low) and self.drive.allows(key, high)):
            add(path, "the bounds reach beyond what a preset allows", got=got)
        return Unknown(key, low, high, log, start)

    def _target(self, path: Path, item: Any) -> Target | None:
        if not isinstance(item, dict):
            hint = "like {quantity: F_ior, M_g: 80, value: 20, tolerance: 1}"
            self.findings.add(path, "must be a table of keys", hint)
            return None
        quantity = item.get("quantity")
        if not isinstance(quantity, str) or quantity not in KINDS:
            hint = near(str(quantity), KINDS) or f"known: {', '.join(KINDS)}"
            self.findings.add((*path, "quantity"), "names no quantity", hint)
            return None
        kind = KINDS[quantity]
        given = self._checked(path, item, _written(kind), f": {quantity} is asked with it")
        for key in ("M_g", "from", "to", "T_1", "T_2"):
            if given.get(key) == 0 and quantity != "torsional_stiffness":
                self.findings.add((*path, key), "a torque of 0 leaves the rotation undetermined")
        trace, sha256 = None, ""
        if "file" in given:
            trace, sha256 = self._trace((*path, "file"), given["file"]) or (None, "")
            given["value"] = 0.0
        limits = self._limits(path, given) if given else None
        asked = {key: given[key] for key in kind.keys if key in given}
        return Target(quantity, asked, *limits, trace, sha256) if limits else None

    def _trace(self, path: Path, name: str) -> tuple[tuple[tuple[float, ...], tuple[float, ...]], str] | None:
        """Cam angles [deg], ascending, and errors [arcsec] of a file of a trace, and its SHA-256."""
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
        curve = tuple(trace.cam_deg[rows].tolist()), tuple((sign * trace.error_arcsec[rows]).tolist())
        return curve, trace.sha256

    def _limits(self, path: Path, given: dict[str, Any]) -> tuple[float | None, float, float, float] | None:
        """Value, low, high and tolerance of a target."""
        value, low, high, tolerance = map(given.get, ("value", "low", "high", "tolerance"))
        at = (*path, "tolerance")
        if (value is None) == (low is None and high is None):
            self.findings.add(path, "needs either a value with its tolerance, or low, high or both", got="")
            return None
        if value is not None and tolerance is None:
            self.findings.add(at, "missing key", "a number, or a share like 5 %", "")
            return None
        if low is not None and high is not None and not low < high:
            self.findings.add(path, "low must be below high", got=f"{low:g} to {high:g}")
            return None
        whole: float = value or 0.0  # what a share is of
        if value is None:
            whole = high - low if low is not None and high is not None else low or high or 0.0
        if tolerance is None:
            tolerance = RANGE_SHARE * abs(whole) or 1.0
        elif isinstance(tolerance, Percent):
            tolerance = tolerance / 100 * abs(whole)
        if not 0 < tolerance < inf:
            self.findings.add(at, "must be above 0: a number, or a share like 5 %")
            return None
        if value is not None:
            return value, value - tolerance, value + tolerance, tolerance
        return None, -inf if low is None else low, inf if high is None else high, tolerance
