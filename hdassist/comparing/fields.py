"""Fields in which drives differ: value, unit and origin of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hdassist.preset.fields import Drive
from hdassist.preset.schema import ResolvedField, resolved

# have no bearing on F'_ior at a torque: loads, figures of catalogues, limits, the seat's holes, resolution of other
# answers
_UNRELATED = (
    "operation.", "catalogue.", "acceptance.", "mounting.holes", "mounting.first_hole", "mounting.allowed",
    "numerics.n_phase",
)  # fmt: skip


@dataclass(frozen=True)
class FieldDifference:
    """A field that drives have with different values; rows: one for each drive."""

    path: str
    rows: tuple[ResolvedField, ...]

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return self.rows[0].unit

    @property
    def moves(self) -> bool:
        """Whether the field may move F'_ior at a torque."""
        return not self.path.startswith((*_UNRELATED, "uncertainty."))


def field_differences(drives: Sequence[Drive]) -> tuple[FieldDifference, ...]:
    """Fields in which drives differ, in the order of the declarations; uncertainties of fields behind them."""
    rows = list(zip(*map(resolved, drives), strict=True))
    units = {row[0].path: row[0].unit for row in rows}
    paths = dict.fromkeys(path for drive in drives for path in drive.uncertainty)
    rows += [tuple(_uncertainty(drive, path, units[path]) for drive in drives) for path in paths]
    return tuple(FieldDifference(row[0].path, row) for row in rows if not _alike(row))


def other_origins(drives: Sequence[Drive]) -> tuple[str, ...]:
    """Paths of the fields that drives have with the same value, but not by the same kind of origin."""
    rows = zip(*map(resolved, drives), strict=True)
    return tuple(row[0].path for row in rows if _alike(row) and len({cell.kind for cell in row}) > 1)


def _alike(row: Sequence[ResolvedField]) -> bool:
    return all(cell.value == row[0].value for cell in row)


def _uncertainty(drive: Drive, path: str, unit: str) -> ResolvedField:
    value = drive.uncertainty.get(path)
    kind = "default" if value is None else "given"
    return ResolvedField(f"uncertainty.{path}", value, unit, kind, "", "expanded uncertainty (k = 2)", None)
