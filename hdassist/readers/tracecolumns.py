"""What the columns of a measured trace hold, and in which units: as asked for, by their names, or by their order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from hdassist.errors import Finding, PresetError, UsageError
from hdassist.preset.yamltext import shown
from hdassist.readers.columns import Columns
from hdassist.readers.tracewords import UNITS, plain_unit, role_in, unit_fault, unit_in

Shaft = Literal["cam", "output"]


@dataclass(frozen=True)
class TraceForm:
    """What is asked of a file: columns by name or number (from 1), their units, and what the angle is that of.

    Of error and second one at most; second is the column of the output's own encoder. wrap is the angle [deg] after
    which the encoders begin again. None: found out.
    """

    angle: str | None = None
    angle_of: Shaft | None = None
    angle_unit: str | None = None
    error: str | None = None
    error_unit: str | None = None
    second: str | None = None
    wrap: float | None = None

    def require_sound(self) -> None:
        """Raise UsageError for what no file could meet: units that are none, or both error and second."""
        if self.error is not None and self.second is not None:
            raise UsageError("the error, or the angle of a second encoder, not both")
        for option, unit in (("--angle-unit", self.angle_unit), ("--error-unit", self.error_unit)):
            if unit is not None and (fault := unit_fault(unit)):
                raise UsageError(f"{option}: no unit of angle: {unit}", fault)


@dataclass(frozen=True)
class Roles:
    """Columns (from 0) of the angle and of the error or second angle; sizes of their units in arcsec."""

    angle: int
    angle_of: Shaft
    angle_size: float
    other: int
    other_is: Literal["error", "second"]
    other_size: float


def roles(table: Columns, form: TraceForm, notes: list[str]) -> Roles:
    """Find out what the columns hold.

    Arguments: table; form, what is asked; notes, to which is added what was found out.
    Raises UsageError: wrong units or both error and second; PresetError: columns that cannot be told.
    """
    form.require_sound()
    kinds = [role_in(name) for name in table.names] or [""] * table.values.shape[1]
    if len(kinds) == 2 and not any(kinds):
        kinds = ["cam", "error"]
        notes.append("columns by their order: cam angle, error")
    angle = _column(table, form.angle, _first_of(kinds, "cam", "angle", "output"), "angle")
    of: Shaft = form.angle_of or ("output" if kinds[angle] == "output" else "cam")
    kinds[angle] = ""
    by_second = form.second is not None or (form.error is None and "error" not in kinds and "output" in kinds)
    asked, found = (form.second, "output") if by_second else (form.error, "error")
    other = _column(table, asked, _first_of(kinds, found), "second" if by_second else "error")
    if other == angle:
        raise UsageError(f"one column cannot be both: {table.name(angle)}", f"columns: {_listed(table)}")
    if by_second and of == "output":
        raise _unclear(table, "no column of cam angles", "name one: --angle NAME --angle-of cam")
    angle_unit, angle_size = _unit(table, angle, form.angle_unit, "deg", "--angle-unit", notes)
    other_unit = (form.error_unit, "arcsec") if not by_second else (None, angle_unit)
    unit, size = _unit(table, other, *other_unit, "--angle-unit" if by_second else "--error-unit", notes)
    words = "output angle, second encoder" if by_second else "error"
    notes.append(f'"{table.name(angle)}": {of} angle, {angle_unit}; "{table.name(other)}": {words}, {unit}')
    return Roles(angle, of, angle_size, other, "second" if by_second else "error", size)


def _first_of(kinds: Sequence[str], *wanted: str) -> list[int]:
    """Columns of the first kind that there is."""
    return next((found for kind in wanted if (found := [i for i, k in enumerate(kinds) if k == kind])), [])


def _column(table: Columns, asked: str | None, found: list[int], option: str) -> int:
    if asked is not None:
        for plain in (str, str.lower):
            same = [i for i, name in enumerate(table.names) if plain(name) == plain(asked)]
            if len(same) == 1:
                return same[0]
        if asked.isdecimal() and 0 < int(asked) <= table.values.shape[1]:
            return int(asked) - 1
        raise _unclear(table, f"no column {asked}", "give its name or number")
    if len(found) == 1:
        return found[0]
    what = {"angle": "cam or output angles", "error": "errors", "second": "output angles"}[option]
    if found:
        several = ", ".join(f'"{table.name(i)}"' for i in found)
        raise _unclear(table, f"{len(found)} columns of {what}: {several}", f"choose one: --{option} NAME")
    raise _unclear(table, f"no column of {what} by its name", f"name it: --{option} NAME, or its number")


def _unit(
    table: Columns, column: int, asked: str | None, default: str, option: str, notes: list[str]
) -> tuple[str, float]:
    if asked is not None:
        named = unit_in(table.name(column))
        if named and named != plain_unit(asked):
            notes.append(f'"{table.name(column)}": {asked} as asked for, though the name says {named}')
        return plain_unit(asked), UNITS[plain_unit(asked)]
    named = unit_in(table.name(column))
    if not named:
        notes.append(f'"{table.name(column)}": no unit given, {default} assumed ({option})')
    return named or default, UNITS[named or default]


def _listed(table: Columns) -> str:
    return shown(", ".join(table.name(i) for i in range(table.values.shape[1])))


def _unclear(table: Columns, message: str, hint: str) -> PresetError:
    return PresetError([Finding(table.file, table.names_line, 1, "", message, _listed(table), hint)])
