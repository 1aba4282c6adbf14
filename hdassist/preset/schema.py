"""The JSON Schema of presets for editors, and the fields of one drive with their origins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydantic.fields import FieldInfo

from hdassist.numerals import NUMBER, UNSIGNED
from hdassist.preset.catalogue import of_catalogue
from hdassist.preset.fields import PRESET_SCHEMA, Drive, deviation_sizes, fields, measures, sections
from hdassist.preset.kinds import (
    POSITION_KEY,
    UNKNOWN,
    Section,
    UncertainReading,
    bounds_of,
    choices_of,
    is_optional,
    kind_of,
    may_be_unknown,
    unit_of,
)
from hdassist.preset.overrides import is_overridden
from hdassist.preset.units import pattern_for, spread_pattern, units_for

Schema = dict[str, Any]
BOUNDS = {"ge": "minimum", "gt": "exclusiveMinimum", "le": "maximum"}
KEYS = {"limits": rf"^(all|{NUMBER})$", "orders": rf"^[+]?{UNSIGNED}(@{NUMBER})?$"}


def preset_schema() -> Schema:
    """JSON Schema (draft 2020-12) of presets, with texts with units and single items in place of lists.

    It covers fields one by one; rules on several fields together are left to the validation of hdassist.
    """
    schema = Drive.model_json_schema()
    tables = dict(sections())
    properties: Schema = {"schema": {"const": PRESET_SCHEMA, "description": "form of this file"}}
    for name, info in Drive.model_fields.items():
        own = _without(("title", "unit", "default", "items"), schema["properties"][name])
        properties[name] = _section(tables[name], info) if name in tables else own
    properties["uncertainty"] |= _measures({"type": "number", "minimum": 0})
    properties["alternatives"] |= {"type": ["array", "null"], "items": _measures({"type": "number"})}
    bounds = {"type": ["array", "null"], "items": {"type": ["number", "string"]}, "minItems": 2, "maxItems": 2}
    source = _without(("title", "unit"), schema["$defs"]["Source"])
    source["properties"]["range"] = {"description": source["properties"]["range"]["description"]} | bounds
    properties["source"] |= {
        "type": ["object", "null"],
        "propertyNames": {"enum": [path for path, _ in fields()]},
        "additionalProperties": source,
    }
    properties["cost"] |= {
        "type": ["object", "null"],
        "propertyNames": {"enum": list(deviation_sizes())},
        "additionalProperties": _without(("title", "unit"), schema["$defs"]["CostLaw"]),
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


def _section(model: type[Section], info: FieldInfo) -> Schema:
    required = [name for name, field in model.model_fields.items() if field.is_required()]
    table: Schema = {
        "type": "object" if info.is_required() else ["object", "null"],
        "description": model.__doc__,
        "additionalProperties": False,
        "properties": {name: _field(field) for name, field in model.model_fields.items()},
    }
    return table | ({"required": required} if required else {})


def _field(info: FieldInfo) -> Schema:
    unit, kind = unit_of(info), kind_of(info)
    about: Schema = {"description": f"{info.description} [{unit}]" if unit else info.description}
    about |= {} if info.is_required() else {"default": info.default}
    about |= {"examples": info.examples} if info.examples else {}
    if kind == "choice":
        return about | {"enum": list(choices_of(info))}
    if kind == "holes":
        hole = {"type": "integer", "minimum": 0}
        return about | {"anyOf": [{"const": "all"}, hole, {"type": "array", "items": hole, "minItems": 1}]}
    bounds = {BOUNDS[name]: bound for name, bound in bounds_of(info).items()}
    one = _quantity({"type": "integer" if kind == "count" else "number"} | bounds, unit)
    if kind == "numbers":
        return about | {"anyOf": [*one, {"type": "array", "items": {"anyOf": one}, "minItems": 1}]}
    if kind == "readings":
        reading = {"type": "string", "pattern": spread_pattern(unit)}
        keys = {"pattern": f"^{POSITION_KEY}$"}
        return about | {"type": "object", "propertyNames": keys, "additionalProperties": reading}
    if kind in KEYS:
        keys, limit = {"pattern": KEYS[kind]}, {"anyOf": one}
        limits = {"type": "object", "propertyNames": keys, "additionalProperties": limit}
        return about | ({"anyOf": [*one, limits]} if kind == "limits" else limits)
    if is_optional(info):
        one.append({"type": "null"})
    if may_be_unknown(info):
        one.append({"const": UNKNOWN})
    if kind == "number":
        one.append({"type": "string", "pattern": spread_pattern(unit)})
    return about | (one[0] if len(one) == 1 else {"anyOf": one})


def _quantity(number: Schema, unit: str) -> list[Schema]:
    """A number in its range, or a text with a unit."""
    return [number, {"type": "string", "pattern": pattern_for(unit)}] if units_for(unit) else [number]


def _measures(number: Schema) -> Schema:
    """A table of measures by path, each a number or a text with a unit."""
    entries = {path: {"anyOf": _quantity(number, unit_of(info))} for path, info in measures().items()}
    return {"type": ["object", "null"], "additionalProperties": False, "properties": entries}


def _without(keys: tuple[str, ...], schema: Any) -> Any:
    """A schema of pydantic without some keys, at any depth."""
    if not isinstance(schema, dict):
        return schema
    return {key: _without(keys, value) for key, value in schema.items() if key not in keys}


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
    """Numbers of fields that are given, identified and assumed in a preset, without those of the catalogue."""
    kinds = [row.kind for row in resolved_fields(drive) if not of_catalogue(row.path)]
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
