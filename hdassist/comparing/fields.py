"""Fields in which drives differ: value, unit and origin of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hdassist.preset.fields import Drive
from hdassist.preset.schema import ResolvedField, resolved

# what does not bear on F'_ior at a torque: loads, figures of catalogues, limits, the seat's holes, resolution of other
# answers
_ASIDE = (
    "operation.", "catalogue.", "acceptance.", "mounting.holes", "mounting.first_hole", "mounting.allowed",
    "numerics.n_phase",
)  # fmt: skip


@dataclass(frozen=True)
class Difference:
    """A field that drives have with different values; there: what each of them has."""

    path: str
    there: tuple[ResolvedField, ...]

    @property
    def unit(self) -> str:
        """Unit of the values."""
        return self.there[0].unit

    @property
    def moves(self) -> bool:
        """Whether the field may move F'_ior at a torque."""
        return not self.path.startswith((*_ASIDE, "uncertainty."))


def differences(drives: Sequence[Drive]) -> tuple[Difference, ...]:
    """Fields in which drives differ, in the order of the declarations; uncertainties of fields behind them."""
    rows = list(zip(*map(resolved, drives), strict=True))
    found = [Difference(there[0].path, there) for there in rows if not _alike(there)]
    paths = dict.fromkeys(path for drive in drives for path in drive.uncertainty)
    units = {there[0].path: there[0].unit for there in rows}
    for path in paths:
        there = tuple(_spread(drive, path, units[path]) for drive in drives)
        if not _alike(there):
            found.append(Difference(there[0].path, there))
    return tuple(found)


def other_origins(drives: Sequence[Drive]) -> tuple[str, ...]:
    """Paths of the fields that drives have with the same value, but not by the same kind of origin."""
    rows = zip(*map(resolved, drives), strict=True)
    return tuple(there[0].path for there in rows if _alike(there) and len({row.kind for row in there}) > 1)


def _alike(there: Sequence[ResolvedField]) -> bool:
    return all(row.value == there[0].value for row in there)


def _spread(drive: Drive, path: str, unit: str) -> ResolvedField:
    value = drive.uncertainty.get(path)
    kind = "default" if value is None else "given"
    return ResolvedField(f"uncertainty.{path}", value, unit, kind, "", "expanded uncertainty (k = 2)", None)
