"""The fields of one drive with their origins."""

from dataclasses import dataclass
from typing import Any

from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import UNKNOWN, may_be_unknown, text_of, unit_of
from hdassist.preset.overrides import is_overridden


@dataclass(frozen=True)
class ResolvedField:
    """One field of a drive: path, value in its unit, kind of origin, reference, meaning, plausible range in its unit.

    Kinds: given, assumed, identified (by `source`; given without one), default, override; unknown, with a value of
    None.
    """

    path: str
    value: Any
    unit: str
    kind: str
    ref: str
    meaning: str
    range: tuple[float, float] | None

    @property
    def reference(self) -> str:
        """Where the value comes from, its plausible range first."""
        bounds = " to ".join(map(value_text, self.range or ()))
        return "; ".join(filter(None, (bounds, self.ref)))


def resolved_fields(drive: Drive) -> list[ResolvedField]:
    """Rows for every field of a drive that stands in a section, in the order of the declarations."""
    rows = []
    for path, info in field_table().items():
        section, name = path.split(".")
        table, value, source = getattr(drive, section), drive.value(path), drive.source.get(path)
        kind, ref, bounds = (str(source.kind), source.ref, source.range) if source else ("given", "", None)
        if is_overridden(path, drive.origin.overrides):
            kind, ref, bounds = "override", "--set", None
        elif may_be_unknown(info) and value is None:
            kind, ref, bounds = UNKNOWN, "", None
        elif name not in table.model_fields_set:
            kind = "default"
        rows.append(ResolvedField(path, value, unit_of(info), kind, ref, str(info.description), bounds))
    return rows


def origin_counts(drive: Drive) -> dict[str, int]:
    """Numbers of fields that are given, identified and assumed in a preset."""
    kinds = [row.kind for row in resolved_fields(drive)]
    return {kind: kinds.count(kind) for kind in ("given", "identified", "assumed")}


def value_text(value: Any) -> str:
    """A value as a preset has it, without brackets; a dash where there is none."""
    return "-" if value is None else text_of(value).strip("[]{}") or "-"
