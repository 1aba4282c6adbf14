"""F'_ior over a grid of values of a preset's fields: a row a value of each field and a torque."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from pydantic import TypeAdapter

from hdassist.design.vary import TORQUE, Axis, grid_rows
from hdassist.error.error_map import extremes_of
from hdassist.errors import DataError, HdassistError, UsageError
from hdassist.loading.load import load_text
from hdassist.model.geometry import Array
from hdassist.model.unknown import unknown_notes
from hdassist.preset.fields import Drive
from hdassist.preset.overrides import OVERRIDE_PLACE
from hdassist.run.kept import ClosedRecord, Count, Magnitude, Number, RecordKind
from hdassist.solve.certificate import Residual


@dataclass(frozen=True, kw_only=True)
class SweepRow(ClosedRecord):
    """F'_ior [arcsec] of a row at its torque M_g [N*m], in the flank window [deg] that it was computed in.

    values: of the fields that are varied; states and max_residual: of the proof; reason: why the row has no answer, and
    the exit code that this is elsewhere.
    """

    values: Mapping[str, Number]
    M_g_Nm: Number
    F_ior_arcsec: Magnitude | None = None
    states: Count | None = None
    max_residual: Residual | None = None
    reason: str | None = None
    exit_code: Count = 0


@dataclass(frozen=True)
class Sweep:
    """The rows of a grid; called with (first, last) it gives their records, as `stream` wants it.

    text and file of the preset; overrides; axes, the last one changing fastest; torques M_g [N*m], which change faster
    still: that of the row where it is varied.
    """

    text: bytes
    file: str
    overrides: tuple[str, ...]
    axes: tuple[Axis, ...]
    torques: tuple[float, ...]

    @classmethod
    def of(cls, text: bytes, file: str, drive: Drive, axes: tuple[Axis, ...]) -> Sweep:
        """The sweep of a preset, read with its overrides as drive, over axes."""
        varied = any(axis.path == TORQUE for axis in axes)
        return cls(text, file, drive.origin.overrides, axes, () if varied else drive.operation.M_g)

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return grid_rows(self.axes) * max(1, len(self.torques))

    @property
    def shape(self) -> tuple[int, ...]:
        """Values of each axis, and torques: the shape of the results of the rows."""
        return (*(len(axis.values) for axis in self.axes), max(1, len(self.torques)))

    def values(self, row: int) -> dict[str, float]:
        """Values of the fields that are varied, by path, in a row."""
        places = np.unravel_index(row, self.shape)
        return {axis.path: axis.values[k] for axis, k in zip(self.axes, places, strict=False)}

    def torque(self, row: int) -> float:
        """Torque M_g [N*m] of a row."""
        return self.torques[row % len(self.torques)] if self.torques else self.values(row)[TORQUE]

    @property
    def kind(self) -> RecordKind[SweepRow]:
        """Type of the records in a file."""
        return RecordKind(TypeAdapter(SweepRow))

    def __call__(self, first: int, last: int) -> list[SweepRow]:
        """Records of the rows first ... last - 1; a row depends on its own number alone."""
        return [self._record(row) for row in range(first, last)]

    def _record(self, row: int) -> SweepRow:
        values, M_g = self.values(row), self.torque(row)
        try:
            (found,) = extremes_of(self._drive(values), [M_g])
            proof = found.certificate
            return SweepRow(
                values=values,
                M_g_Nm=M_g,
                F_ior_arcsec=found.first,
                states=proof.states,
                max_residual=proof.max_residual,
            )
        except HdassistError as error:
            reason = OVERRIDE_PLACE.sub("", error.message).replace("\n", "; ")
            code = DataError.exit_code if isinstance(error, UsageError) else error.exit_code
            return SweepRow(values=values, M_g_Nm=M_g, reason=reason, exit_code=code)

    def _drive(self, values: dict[str, float]) -> Drive:
        """The drive of a row, validated as any other. Raises UsageError: there is no such drive."""
        sets = [f"{path}={[value] if path == TORQUE else value!r}" for path, value in values.items()]
        return load_text(self.text, self.file, [*self.overrides, *sets])


@dataclass(frozen=True, eq=False)
class Swept:
    """Results of a sweep.

    F_ior_arcsec, NaN where a row has no answer, shape (values of each axis, torques); states and max_residual of all
    rows; failed, rows without an answer; reason, of the first of them; exit_codes of all of them.
    """

    sweep: Sweep
    drive: Drive
    F_ior_arcsec: Array
    states: int
    max_residual: float
    failed: int
    reason: str
    exit_codes: frozenset[int]

    def end(self, greatest: bool) -> tuple[int, float] | None:
        """The row with the least or the greatest F'_ior, and that [arcsec]; None where no row has an answer."""
        if self.failed == self.sweep.rows:
            return None
        row = int((np.nanargmax if greatest else np.nanargmin)(self.F_ior_arcsec))
        return row, float(self.F_ior_arcsec.flat[row])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the numbers."""
        return *self.drive.origin.warnings, *unknown_notes(largest(self.drive, self.sweep.axes))


def largest(drive: Drive, axes: Iterable[Axis]) -> Drive:
    """The drive with each varied size at its greatest: inputs unknown in it are unknown in some row."""
    return drive.with_values({axis.path: max(axis.values) for axis in axes if axis.path != TORQUE})


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
