"""The fields of a preset as levers: value, unit and meaning of each, and how far a step goes."""

from __future__ import annotations

from math import floor, inf, log10

from pydantic.fields import FieldInfo

from hdassist.preset.fields import Drive, ResolvedField, bounds_of, field_table, kind_of, range_of, text_of, unit_of

SETTING_SECTIONS = (
    "mounting",
    "operation",
    "catalogue",
    "measured",
    "acceptance",
    "numerics",
)  # sections that are no part of the drive
TEETH_FIELDS = ("gears.z_g", "gears.z_b")  # change together
LEVER_STEPS = {"um": 1.0, "deg": 5.0, "N*m": 10.0}  # a step in units that have a natural one


def about_field(field: ResolvedField) -> str:
    """Path, meaning and range of a field."""
    reach = range_of(field_table()[field.path], field.unit)
    return f"{field.path}: {field.meaning}{f'; {reach}' if reach else ''}"


def step_of(info: FieldInfo, value: float) -> float:
    """How far a step of a field goes from a value: by its unit, else about one per cent in a round number.

    By its unit only where that is at most a tenth of the field's range: 5 deg of a phase, not of a pressure angle.
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
