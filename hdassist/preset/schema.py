"""The fields of one drive with their origins, and of every drive as a JSON Schema for editors."""

from dataclasses import dataclass
from typing import Any

from hdassist.numerals import NUMBER
from hdassist.preset.fields import PRESET_SCHEMA, Drive, deviation_sizes, field_table, measures
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


SCHEMA_FILE = "hdassist-preset.schema.json"  # that the first line of a new preset names
NUMBER_TEXT = {"type": "string", "pattern": rf"^\s*{NUMBER}"}  # with a unit, or an uncertainty
LIMITS = {"ge": "minimum", "gt": "exclusiveMinimum", "le": "maximum"}
SEVERAL = ("type", "items", "prefixItems", "minItems", "maxItems", "additionalProperties")  # of a list or table


def preset_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of presets: names, types, ranges, units and meanings of the fields as declared.

    Units within texts, keys of tables and rules between fields are left to `hdassist presets validate`.
    """
    schema: dict[str, Any] = _as_written(Drive.model_json_schema(), {})
    properties = schema["properties"]
    by_path = {"source": field_table(), "cost": deviation_sizes(), "uncertainty": measures(), "fit": measures()}
    for table, paths in by_path.items():
        properties[table]["anyOf"][0]["propertyNames"] = {"enum": list(paths)}
    schema["$defs"]["UncertainReading"] = NUMBER_TEXT
    properties["schema"] = {"const": PRESET_SCHEMA, "description": "form of this file"}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "hdassist preset"}
    return schema | head | {"required": ["schema", *schema["required"]]}


def _as_written(part: Any, limits: dict[str, float]) -> Any:
    """A schema of pydantic as presets are written: texts for numbers, one item for a list, a number for a table.

    limits: range of the field that it is a part of, by the words of a schema.
    """
    if isinstance(part, list):
        return [_as_written(each, limits) for each in part]
    if not isinstance(part, dict):
        return part
    part = dict(part)
    if "properties" in part:  # by names of fields, that may be words of schemas too
        names = ("properties", "$defs")
        return part | {n: {name: _as_written(each, {}) for name, each in part[n].items()} for n in names if n in part}
    limits = {LIMITS[name]: bound for name, bound in part.pop("bounds", {}).items()} or limits
    unit, is_open = part.pop("unit", ""), part.pop(UNKNOWN, False)
    part = {key: each if key == "default" else _as_written(each, limits) for key, each in part.items()}
    if unit and "description" in part:
        part["description"] += f" [{unit}]"
    if part.get("type") in ("number", "integer"):
        part["anyOf"] = [{"type": part.pop("type")} | limits, NUMBER_TEXT]
    elif part.get("type") == "array" or "additionalProperties" in part:
        several = {key: part.pop(key) for key in SEVERAL if key in part}
        one = several.get("items") or several.get("additionalProperties", {})
        part["anyOf"] = [several] if "$ref" in one or "prefixItems" in several else [several, one]
    elif "$ref" in part and "default" in part:  # a section that may be left out may be empty
        part["anyOf"] = [{"$ref": part.pop("$ref")}, {"type": "null"}]
    if is_open:
        part["anyOf"] = [*part["anyOf"], {"const": UNKNOWN}]
    return part
