"""The fields of a preset as levers: value, unit and meaning of each, and how far a step goes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import floor, inf, log10

from pydantic.fields import FieldInfo

from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import bounds_of, kind_of, range_of, text_of, unit_of
from hdassist.preset.schema import resolved_fields

SETTING_SECTIONS = (
    "mounting",
    "operation",
    "catalogue",
    "measured",
    "acceptance",
    "numerics",
)  # sections that are no part of the drive
LEVER_STEPS = {"um": 1.0, "deg": 5.0, "N*m": 10.0}  # a step in units that have a natural one


@dataclass(frozen=True)
class Lever:
    """One field: path, value as text, unit, range and meaning in words; mark: ? assumed, * changed, or nothing."""

    path: str
    text: str
    unit: str
    range: str
    meaning: str
    mark: str = ""

    @property
    def words(self) -> str:
        """Meaning and range."""
        return f"{self.meaning}{f'; {self.range}' if self.range else ''}"


def levers(drive: Drive, changed: set[str]) -> Iterator[Lever]:
    """The fields of a drive in the order in which a preset has them; changed: paths that differ from the preset."""
    for row in resolved_fields(drive):
        by_default = row.kind == "default" and row.value is not None and row.path.split(".")[0] not in SETTING_SECTIONS
        mark = "*" if row.path in changed else "?" * (by_default or row.kind == "assumed")
        reach = range_of(field_table()[row.path], row.unit)
        yield Lever(row.path, text_of(row.value), row.unit, reach, row.meaning, mark)


def step_of(info: FieldInfo, value: float) -> float:
    """How far a step of a field goes from a value: by its unit, else about one per cent in a round number.

    By its unit only where that is at most a tenth of what the field may be: 5 deg of a phase, not of a pressure angle.
    """
    bounds, natural = bounds_of(info), LEVER_STEPS.get(unit_of(info), 0.0)
    if kind_of(info) == "count":
        return 1.0
    if 0 < 10 * natural <= bounds.get("le", inf) - bounds.get("ge", 0.0):
        return natural
    reach = abs(value) or bounds.get("le", 1.0) / 100
    return 10.0 ** floor(log10(reach) - 1)


def stepped(drive: Drive, path: str, steps: int) -> str | None:
    """The value of a field so many steps on, as text; None where it has no steps."""
    info, value = field_table()[path], drive.value(path)
    if kind_of(info) not in ("number", "count") or value is None:
        return None
    return text_of(float(f"{value + steps * step_of(info, value):.10g}"))
