"""The JSON Schema of presets for editors, and the fields of one drive with their origins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hdassist.numerals import NUMBER
from hdassist.preset.fields import PRESET_SCHEMA, Drive, deviation_sizes, field_table, fields, measures
from hdassist.preset.kinds import UNKNOWN, UncertainReading, may_be_unknown, unit_of
from hdassist.preset.overrides import is_overridden

Schema = dict[str, Any]
NUMBER_TEXT = {"type": "string", "pattern": rf"^\s*({NUMBER}.*|{UNKNOWN})$"}  # with a unit, or an uncertainty


def preset_schema() -> Schema:
    """JSON Schema (draft 2020-12) of presets: names, types, ranges and meanings of the fields, as they are declared.

    Units within texts, and rules on several fields together, are left to the validation of hdassist.
    """
    schema = _as_written(Drive.model_json_schema())
    properties = schema["properties"]
    for table, paths in (("source", field_table()), ("cost", deviation_sizes()), ("uncertainty", measures())):
        properties[table]["propertyNames"] = {"enum": list(paths)}
    properties["schema"] = {"const": PRESET_SCHEMA, "description": "form of this file"}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "hdassist preset"}
    whole: Schema = schema | head | {"required": ["schema", *schema["required"]]}
    return whole


def _as_written(part: Any) -> Any:
    """A schema of pydantic as presets are written: texts for numbers, one item for a list, a number for all torques."""
    if isinstance(part, list):
        return [_as_written(each) for each in part]
    if not isinstance(part, dict):
        return part
    part = {key: _as_written(each) for key, each in part.items()}
    kind = part.get("type")
    if kind in ("number", "integer"):
        bounds = {key: part.pop(key) for key in list(part) if key == "type" or key.lower().endswith("imum")}
        return part | {"anyOf": [bounds, NUMBER_TEXT]}
    if kind == "array" or "anyOf" in (part.get("additionalProperties") or {}):  # several values, or one
        rules = ("type", "items", "prefixItems", "minItems", "maxItems", "additionalProperties")
        several = {key: part.pop(key) for key in rules if key in part}
        return part | {"anyOf": [several, several.get("items") or several.get("additionalProperties") or NUMBER_TEXT]}
    if "$ref" in part and "default" in part:
        return part | {"anyOf": [{"$ref": part.pop("$ref")}, {"type": "null"}]}  # an optional section may be empty
    return part


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


def resolved_fields(drive: Drive) -> list[ResolvedField]:
    """Rows for every field of a drive that stands in a section, in the order of the declarations."""
    rows = []
    for path, info in fields():
        section, name = path.split(".")
        table = getattr(drive, section)
        source = drive.source.get(path)
        kind, ref, bounds = (str(source.kind), source.ref, source.range) if source is not None else ("given", "", None)
        if is_overridden(path, drive.origin.overrides):
            kind, ref, bounds = "override", "--set", None
        elif may_be_unknown(info) and getattr(table, name) is None:
            kind, ref, bounds = UNKNOWN, "", None
        elif name not in table.model_fields_set:
            kind = "default"
        rows.append(ResolvedField(path, getattr(table, name), unit_of(info), kind, ref, str(info.description), bounds))
    return rows


def origin_counts(drive: Drive) -> dict[str, int]:
    """Numbers of fields that are given, identified and assumed in a preset."""
    kinds = [row.kind for row in resolved_fields(drive)]
    return {kind: kinds.count(kind) for kind in ("given", "identified", "assumed")}


def value_text(value: Any) -> str:
    """A value with every digit it has."""
    if value is None:
        return "-"
    if isinstance(value, tuple) and not isinstance(value, UncertainReading):
        return ", ".join(map(value_text, value))
    if isinstance(value, dict):
        return ", ".join(f"{key}: {value_text(item)}" for key, item in value.items()) or "-"
    return repr(value).removesuffix(".0") if isinstance(value, float) else str(value)
