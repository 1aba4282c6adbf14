"""What presets may say, as JSON Schema for editors; and what one really says, field by field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydantic.fields import FieldInfo

from hdassist.preset.fields import SCHEMA, Drive, fields, sections
from hdassist.preset.kinds import Section, is_optional, kind_of, unit_of
from hdassist.preset.overrides import is_overridden
from hdassist.preset.units import pattern_for, spread_pattern, units_for

Schema = dict[str, Any]
NUMBER = r"(\.[0-9]+|[0-9]+\.?[0-9]*)([eE][-+]?[0-9]+)?"
KEYS = {"limits": rf"^(all|[-+]?{NUMBER})$", "orders": rf"^[+]?{NUMBER}$"}


def preset_schema() -> Schema:
    """JSON Schema (draft 2020-12) of what presets accept, unit strings and single items of lists included.

    It says what one field may be; what fields must satisfy together only the validation of hdassist says.
    """
    schema = Drive.model_json_schema()
    definitions = schema.pop("$defs")
    tables = dict(sections())
    properties: Schema = {"schema": {"const": SCHEMA, "description": "form of this file"}}
    for name, info in Drive.model_fields.items():
        if name in tables:
            properties[name] = _section(definitions[tables[name].__name__], tables[name], info)
        else:
            properties[name] = {k: v for k, v in schema["properties"][name].items() if k in _KEPT}
    properties["uncertainty"] |= _measures({"type": "number", "minimum": 0})
    properties["alternatives"] |= {"type": ["array", "null"], "items": _measures({"type": "number"})}
    properties["source"] |= {
        "type": ["object", "null"],
        "propertyNames": {"enum": [path for path, _ in fields()]},
        "additionalProperties": _bare(definitions["Source"]),
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "hdassist preset",
        "description": schema["description"],
        "type": "object",
        "required": ["schema", *schema["required"]],
        "additionalProperties": False,
        "properties": properties,
    }


_KEPT = ("type", "description", "minLength", "maxLength")


def _section(definition: Schema, model: type[Section], info: FieldInfo) -> Schema:
    table: Schema = {
        "type": "object" if info.is_required() else ["object", "null"],
        "description": definition["description"],
        "additionalProperties": False,
        "properties": {
            name: _field(definition["properties"][name], field) for name, field in model.model_fields.items()
        },
    }
    return table | ({"required": definition["required"]} if "required" in definition else {})


def _field(declared: Schema, info: FieldInfo) -> Schema:
    unit, kind = unit_of(info), kind_of(info)
    about = {"description": f"{info.description} [{unit}]" if unit else info.description}
    about |= {key: declared[key] for key in ("default", "examples") if key in declared}
    if kind == "choice":
        return about | {"enum": declared["enum"]}
    if kind == "holes":
        hole = {"type": "integer", "minimum": 0}
        return about | {"anyOf": [{"const": "all"}, hole, {"type": "array", "items": hole, "minItems": 1}]}
    if kind == "numbers":
        one = _quantity(declared["items"], unit)
        return about | {"anyOf": [*one, {"type": "array", "items": {"anyOf": one}, "minItems": 1}]}
    if kind in KEYS:
        one = _quantity(declared["additionalProperties"], unit)
        limits = {
            "type": "object", "propertyNames": {"pattern": KEYS[kind]}, "additionalProperties": {"anyOf": one}
        }  # fmt: skip
        return about | ({"anyOf": [*one, limits]} if kind == "limits" else limits)
    number = declared.get("anyOf", [declared])[0]
    choices = _quantity(number, unit) + ([{"type": "null"}] if is_optional(info) else [])
    if kind == "number":
        choices.append({"type": "string", "pattern": spread_pattern(unit)})
    return about | (choices[0] if len(choices) == 1 else {"anyOf": choices})


def _quantity(number: Schema, unit: str) -> list[Schema]:
    """A number in its range, or a text with a unit."""
    limits = ("type", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")
    bare = {key: number[key] for key in limits if key in number}
    text = {"type": "string", "pattern": pattern_for(unit)} if units_for(unit) else None
    return [bare, text] if text else [bare]


def _measures(number: Schema) -> Schema:
    """A table of measures by path, each a number or a text with a unit."""
    entries = {
        path: {"anyOf": _quantity(number, unit_of(info))} for path, info in fields() if kind_of(info) == "number"
    }
    return {"type": ["object", "null"], "additionalProperties": False, "properties": entries}


def _bare(definition: Schema) -> Schema:
    """A definition without the titles that only repeat the names of the fields."""
    properties = {
        name: {key: value for key, value in field.items() if key not in ("title", "unit")}
        for name, field in definition["properties"].items()
    }
    return {key: value for key, value in definition.items() if key != "title"} | {"properties": properties}


@dataclass(frozen=True)
class ResolvedField:
    """One field: path, value in its unit, kind of origin, reference, meaning.

    Kinds: given, assumed, identified (from `source`, or given in the file without one), default, override.
    """

    path: str
    value: Any
    unit: str
    kind: str
    ref: str
    meaning: str


def resolved(drive: Drive) -> list[ResolvedField]:
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
        rows.append(ResolvedField(path, getattr(table, name), unit_of(info), kind, ref, str(info.description)))
    return rows
