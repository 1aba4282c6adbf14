"""F'_ior over a grid of values of a preset's fields: the axes, and a row a value of each field and a torque."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from math import prod

import numpy as np
from pydantic import TypeAdapter

from hdassist.error.extremes import extremes_of
from hdassist.errors import DataError, HdassistError, UntrustedError, UsageError
from hdassist.loading.load import OVERRIDE_PLACE, load_text
from hdassist.model.geometry import Array
from hdassist.model.unknown import unknown_notes
from hdassist.preset.fields import Drive, PresetField, field_table, is_overridden, path_of
from hdassist.preset.text import InvalidValueError, near_miss, read_count, read_number, scalar_value, shown
from hdassist.report import attributes
from hdassist.run.kept import ClosedRecord, Count, Magnitude, Number, RecordKind
from hdassist.solve.answers import Residual

_VARY = "--vary"
_TORQUE = "operation.M_g"
MOST_VALUES = 10_000  # values of a field, at most
_FORM = f"like {_VARY} tolerances.e_hb=20:120:11, from 20 to 120 in 11 steps, or {_VARY} tolerances.e_hb=20,50,80"
_MOST_ROWS = 1_000_000  # of a grid, at most


@dataclass(frozen=True)
class Axis:
    """A field that is varied: path, unit, and its values in that unit."""

    path: str
    unit: str
    values: tuple[float, ...]


def read_axes(texts: Sequence[str], overrides: Sequence[str]) -> tuple[Axis, ...]:
    """Fields that are varied, from texts such as "tolerances.e_hb=20:120:11" or "gears.j_n=0,5 um,10".

    Arguments: texts; overrides of the preset, which must not set the same fields.
    Raises UsageError for the first text that is wrong.
    """
    if not texts:
        raise UsageError("nothing is varied", _FORM)
    axes: list[Axis] = []
    for text in texts:
        try:
            axis = _axis(text)
            if axis.path in [before.path for before in axes]:
                raise InvalidValueError("each field once", "one range, or one list with all values")
            if is_overridden(axis.path, overrides):
                hint = f"leave out {_VARY} or --set and --torque"
                raise InvalidValueError("a field that is not set to one value", hint)
        except InvalidValueError as fault:
            words = f"invalid {_VARY} {shown(text) or 'nothing'}: expected {fault.message}"
            raise UsageError(words, fault.hint) from None
        axes.append(axis)
    return tuple(axes)


@cache
def _fields() -> dict[str, PresetField]:
    """Fields that can be varied, by path."""
    table = field_table().items()
    return {path: field for path, field in table if path == _TORQUE or field.kind in ("number", "count")}


def _axis(text: str) -> Axis:
    """The field that a text varies. Raises InvalidValueError, with what was expected: it is not of the form."""
    key, equals, values = text.partition("=")
    if not equals:
        raise InvalidValueError("KEY=START:STOP:STEPS or KEY=A,B,C", _FORM)
    path = ".".join(map(str, path_of(key)))
    field = _fields().get(path)
    if field is None:
        same = (field for field in _fields() if field.split(".")[1] == path.split(".")[-1])
        close = f"did you mean {meant}?" if (meant := next(same, "")) else near_miss(path, _fields())
        raise InvalidValueError("a field of a single number", close or "write section.key, like gears.j_n")
    unit, is_count = field.unit, field.kind == "count"

    def number(part: str) -> float:
        value = scalar_value(part)
        try:
            return read_count(value) if is_count else float(read_number(value, unit))
        except InvalidValueError as fault:
            raise InvalidValueError(f"numbers ({shown(part) or 'nothing'} {fault.message})", fault.hint) from None

    parts = [part.strip() for part in values.split(":" if ":" in values else ",")]
    if ":" in values and len(parts) != 3:
        raise InvalidValueError("KEY=START:STOP:STEPS", _FORM)
    numbers = [number(part) for part in (parts if ":" not in values else parts[:2])]
    if len(set(numbers)) < len(numbers):
        raise InvalidValueError("each value once")
    if ":" in values:
        numbers = _grid(Fraction(repr(numbers[0])), Fraction(repr(numbers[1])), parts[2], is_count)
    return Axis(path, unit, tuple(numbers))


def _grid(start: Fraction, stop: Fraction, steps: str, is_count: bool) -> list[float]:
    """Values from start to stop, as near to their places as numbers can be. Raises InvalidValueError: no such steps."""
    count = int(steps) if re.fullmatch("[0-9]{1,9}", steps) else 0
    if not 2 <= count <= MOST_VALUES:
        raise InvalidValueError(f"steps from 2 to {MOST_VALUES}", _FORM)
    places = [start + (stop - start) * k / (count - 1) for k in range(count)]
    if is_count and any(place.denominator > 1 for place in places):
        raise InvalidValueError("steps on whole numbers")
    return [int(place) if is_count else float(place) for place in places]


@dataclass(frozen=True, kw_only=True)
class SweepRow(ClosedRecord):
    """F'_ior [arcsec] of a row at its torque M_g [N*m], in the flank window [deg] that it was computed in.

    values: of the fields that are varied; states and max_residual: of the proof; reason: why the row has no answer, and
    the exit code that this is elsewhere, 0 with an answer. Raises ValueError for another one.
    """

    values: Mapping[str, Number]
    M_g_Nm: Number
    F_ior_arcsec: Magnitude | None = None
    states: Count | None = None
    max_residual: Residual | None = None
    reason: str | None = None
    exit_code: Count = 0

    def __post_init__(self) -> None:
        has_answer = self.F_ior_arcsec is not None
        codes = (0,) if has_answer else (HdassistError.exit_code, DataError.exit_code, UntrustedError.exit_code)
        if self.exit_code not in codes or has_answer != (self.reason is None):
            raise ValueError("expected F'_ior and no exit code, or a reason with the exit code of its error")


@dataclass(frozen=True)
class Sweep:
    """The rows of a grid; called with (first, last) it gives their records, as `stream` wants it.

    text and file of the preset; overrides; varied fields; further axes, along which a row has the drive of the preset:
    its torques M_g [N*m], where they are not varied. The last axis changes fastest.
    """

    text: bytes
    file: str
    overrides: tuple[str, ...]
    varied: tuple[Axis, ...]
    further: tuple[Axis, ...]

    @classmethod
    def of(cls, text: bytes, file: str, drive: Drive, varied: Sequence[Axis]) -> Sweep:
        """The sweep of a preset, read with its overrides as drive. Raises UsageError for too many rows."""
        is_varied = _TORQUE in [axis.path for axis in varied]
        further = () if is_varied else (Axis(_TORQUE, "N*m", drive.operation.M_g),)
        sweep = cls(text, file, drive.origin.overrides, tuple(varied), further)
        if sweep.rows > _MOST_ROWS:
            hint = "fewer steps, or fewer fields"
            raise UsageError(f"{_VARY} asks for {sweep.rows} rows, more than {_MOST_ROWS}", hint)
        return sweep

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Varied fields, and torques."""
        return self.varied + self.further

    @property
    def shape(self) -> tuple[int, ...]:
        """Values of each axis: the shape of the results of the rows."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return prod(self.shape)

    def values(self, row: int) -> dict[str, float]:
        """Values along each axis, by path, in a row."""
        places = np.unravel_index(row, self.shape)
        return {axis.path: axis.values[k] for axis, k in zip(self.axes, places, strict=True)}

    @property
    def kind(self) -> RecordKind[SweepRow]:
        """Type of the records in a file: that of a row has its values."""

        def fault(item: int, record: SweepRow) -> str:
            if item >= self.rows:
                return f"expected {self.rows} rows"
            is_own = {_TORQUE: record.M_g_Nm, **record.values} == self.values(item)
            return "" if is_own else f"expected the values of row {item + 1}"

        return RecordKind(TypeAdapter(SweepRow), fault)

    def __call__(self, first: int, last: int) -> list[SweepRow]:
        """Records of the rows first ... last - 1; a row depends on its own number alone."""
        return [self._record(self.values(row)) for row in range(first, last)]

    def _record(self, values: dict[str, float]) -> SweepRow:
        changes, M_g = {axis.path: values[axis.path] for axis in self.varied}, values[_TORQUE]
        sets = [f"{path}={[value] if path == _TORQUE else value!r}" for path, value in changes.items()]
        try:  # the drive of a row is validated as any other
            (extremes,) = extremes_of(load_text(self.text, self.file, [*self.overrides, *sets]), [M_g])
        except HdassistError as error:
            reason = OVERRIDE_PLACE.sub("", error.message).replace("\n", "; ")
            code = DataError.exit_code if isinstance(error, UsageError) else error.exit_code
            return SweepRow(values=changes, M_g_Nm=M_g, reason=reason, exit_code=code)
        proof = attributes(extremes.certificate, "states", "max_residual")
        return SweepRow(values=changes, M_g_Nm=M_g, F_ior_arcsec=extremes.first, **proof)


@dataclass(frozen=True, eq=False)
class Swept:
    """Results of a sweep.

    F_ior_arcsec, NaN where a row has no answer, of the sweep's shape; states and max_residual of all rows; failed, rows
    without an answer; reason, of the first of them; exit_codes of all of them.
    """

    sweep: Sweep
    drive: Drive
    F_ior_arcsec: Array
    states: int
    max_residual: float
    failed: int
    reason: str
    exit_codes: frozenset[int]

    @property
    def ends(self) -> dict[str, tuple[int, float]]:
        """The rows with the least and the greatest F'_ior, and that [arcsec]; none where no row has an answer."""
        if self.failed == self.sweep.rows:
            return {}
        rows = {"least": np.nanargmin(self.F_ior_arcsec), "greatest": np.nanargmax(self.F_ior_arcsec)}
        return {end: (int(row), float(self.F_ior_arcsec.flat[row])) for end, row in rows.items()}

    @property
    def largest(self) -> Drive:
        """The drive with each varied size at its greatest: inputs unknown in it are unknown in some row."""
        varied = {axis.path: max(axis.values) for axis in self.sweep.varied if axis.path != _TORQUE}
        return self.drive.with_values(varied)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the numbers."""
        return *self.drive.origin.warnings, *unknown_notes(self.largest)


def collect(sweep: Sweep, drive: Drive, records: Iterable[SweepRow]) -> Swept:
    """Results from the records of all rows, in their order; each record is read once."""
    F_ior = np.full(sweep.rows, np.nan)
    states, residual, failed, reason, codes = 0, 0.0, 0, "", set[int]()
    for row, record in enumerate(records):
        if record.F_ior_arcsec is None:
            failed, reason = failed + 1, reason or record.reason or ""
            codes.add(record.exit_code)
            continue
        F_ior[row] = record.F_ior_arcsec
        states, residual = states + (record.states or 0), max(residual, record.max_residual or 0.0)
    shaped = F_ior.reshape(sweep.shape)
    return Swept(sweep, drive, shaped, states, residual, failed, reason, frozenset(codes))
