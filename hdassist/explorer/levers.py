"""The fields of a preset as levers: value, unit and meaning of each, and how far a step goes."""

from __future__ import annotations

from math import floor, isfinite, log10

from hdassist.preset.fields import Drive, PresetField, ResolvedField, field_table, text_of

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
    reach = field_table()[field.path].range_words(field.unit)
    return f"{field.path}: {field.meaning}{f'; {reach}' if reach else ''}"


def step_of(field: PresetField, value: float) -> float:
    """How far a step of a field goes from a value: by its unit, else about one per cent in a round number.

    By its unit only where that is at most a tenth of the field's range: 5 deg of a phase, not of a pressure angle.
    """
    natural, high, low = LEVER_STEPS.get(field.unit, 0.0), field.le, field.ge if isfinite(field.ge) else 0.0
    if field.kind == "count":
        return 1.0
    if 0 < 10 * natural <= high - low:
        return natural
    reach = abs(value) or (high if isfinite(high) else 1.0) / 100
    return 10.0 ** floor(log10(reach) - 1)


def stepped(drive: Drive, path: str, steps: int) -> str | None:
    """The value of a field so many steps on, as text; None where it has no steps."""
    field, value = field_table()[path], drive.value(path)
    if field.kind not in ("number", "count") or value is None:
        return None
    return text_of(float(f"{value + steps * step_of(field, value):.10g}"))
