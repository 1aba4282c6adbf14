"""Every field of a drive with the value that is really used, and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hdassist.preset.fields import Drive, fields
from hdassist.preset.kinds import unit_of
from hdassist.preset.overrides import is_overridden


@dataclass(frozen=True)
class Row:
    """One field: path, value in its unit, kind of origin, reference, meaning.

    Kinds: given, assumed, identified (from `source`, or given in the file without one), default, override.
    """

    path: str
    value: Any
    unit: str
    kind: str
    ref: str
    meaning: str


def resolved(drive: Drive) -> list[Row]:
    """Rows for every field of a drive that stands in a section, in the order of the declarations."""
    rows = []
    for path, info in fields():
        section, name = path.split(".")
        table = getattr(drive, section)
        source = drive.source.get(path)
        kind, ref = (str(source.kind), source.ref) if source is not None else ("given", "")
        if is_overridden(path, drive.origin.overrides):
            kind, ref = "override", "--set"
        elif name not in table.model_fields_set:
            kind = "default"
        rows.append(Row(path, getattr(table, name), unit_of(info), kind, ref, str(info.description)))
    return rows
