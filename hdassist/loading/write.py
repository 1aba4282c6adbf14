"""Texts of presets: one of a drive like another, one with other values put into it, and the JSON Schema of all."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from io import StringIO
from math import isfinite
from typing import TYPE_CHECKING, Any

from hdassist.errors import DataError, PresetError, UsageError
from hdassist.files import NUMBER
from hdassist.loading.load import load_text
from hdassist.preset.fields import (
    KEYED_TABLES,
    MAX_NAME,
    PRESET_SCHEMA,
    UNKNOWN,
    CostLaw,
    Drive,
    PresetField,
    Section,
    Source,
    deviation_sizes,
    field_table,
    measures,
    origin_counts,
    path_of,
    sections,
    text_of,
)
from hdassist.preset.knowledge import COUPLING_FIELDS, Requirements, SimilarValue, similar
from hdassist.preset.text import scalar_value

if TYPE_CHECKING:
    from ruamel.yaml import YAML

_WIDTH = 110  # of a description


def _name(text: str) -> str:
    """A text as YAML: as it is where that is safe, else in quotes."""
    word = re.fullmatch(r"[A-Za-z][A-Za-z0-9]*([-_][A-Za-z0-9]+)*", text)
    return text if word and isinstance(scalar_value(text), str) else _quoted(text)


def similar_preset(name: str, like: Drive, required: Requirements, description: str = "") -> str:
    """Text of a preset of a drive that is like another one.

    Arguments: name; like, the other drive; requirements of the new one; description, in place of the usual. Raises
    UsageError: a name that a preset cannot have, requirements that contradict each other, or no drive that meshes.
    """
    if not 1 <= len(name) <= MAX_NAME or not name.isprintable():
        raise UsageError(f"a drive needs a name of 1 to {MAX_NAME} printable characters")
    entries = similar(like, required)
    text = "\n".join(_similar_lines(name, like, entries, description)) + "\n"
    try:
        counts = origin_counts(load_text(text, name))
    except PresetError as error:
        raise UsageError(f"no such drive meshes: {error.findings[0].message}", "other teeth, or another size") from None
    other = like.name if like.name.isprintable() else "another drive"
    head = f"# Made by hdassist presets new, like {other}: {counts['given']} values given, {counts['assumed']} assumed."
    return f"{head}\n# yaml-language-server: $schema={SCHEMA_FILE}\n{text}"


def _similar_lines(name: str, like: Drive, entries: Mapping[str, SimilarValue], description: str) -> Iterator[str]:
    z_g, z_b, m = (entries[f"gears.{field}"].value for field in ("z_g", "z_b", "m"))
    yield "# `source` at the end of the file says how each was chosen, and in which range it may lie. Put in what you"
    yield "# know, with kind: given beside it. What is unknown is not zero: answers are ranges over it."
    yield f"schema: {PRESET_SCHEMA}"
    yield f"name: {_name(name)}"
    words = description or (
        f"Drive {z_g}/{z_b}, pitch diameter {m * z_g:.5g} mm, by similarity from {like.name}. "
        "Its absolute values are guesses; what each rests on stands in source."
    )
    if words.isprintable():
        yield "description: >-"
        yield from textwrap.wrap(words, _WIDTH, initial_indent="  ", subsequent_indent="  ", break_long_words=False)
    else:
        yield f"description: {_quoted(words)}"
    for section, model in sections():
        fields = {f"{section}.{name}": field for name, field in model.declared().items()}
        if entries.keys() & fields.keys() or section in ("tolerances", "phases", "harmonics"):
            yield from ("", f"{section}:")
        for path, field in fields.items():
            is_open = field.unknown and not path.startswith("harmonics.xi_")  # these need an amplitude
            if path in entries or is_open:
                value = text_of(entries[path].value) if path in entries else UNKNOWN
                line = f"  {path.split('.')[1]}: {value}"
                yield f"{line:<23} # {field.unit and f'{field.unit}, '}{field.meaning}"
    yield from ("", "source:")
    for path, entry in entries.items():
        bounds = f"range: {text_of(entry.range)}, " if entry.range else ""
        yield f"  {path}: {{kind: {entry.kind}, {bounds}ref: {_quoted(entry.ref)}}}"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=not text.isprintable())


def with_found_values(
    text: str, file: str, values: Mapping[str, float], ref: str, model: Mapping[str, str | int] | None = None
) -> str:
    """Text of a preset with identified values, its comments and order as they are.

    Arguments: text; file, its name in messages; values, by path, of fields that the text gives or leaves out; ref,
    where they come from; model, the fields of numerics that they were identified with, which are written into the
    text. A fit of before goes. Raises the errors of loading the text; DataError where it cannot be changed in place.
    """
    before, tables = load_text(text, file), _tables(text)
    tables.pop("fit", None)  # its draws are around other values
    for path, value in values.items():
        _set_value(tables, path, value)
        _table(tables, "source")[path] = _source("identified", ref, before.source.get(path), value)
    for name, setting in (model or {}).items():
        _table(tables, "numerics").setdefault(name, setting)
    return _written(tables, file, before.with_values(values), model)


def with_changes(text: bytes, file: str, overrides: Sequence[str]) -> str:
    """Text of a preset with overrides put in, its comments and order as they are.

    A changed value that was assumed or identified is assumed from now on, without a range that it has left. Arguments:
    text; file, its name in messages; overrides, such as "cam.W_0=0.95". Raises the errors of loading the preset with
    them; DataError where an override is of no single field, or the text cannot be changed in place.
    """
    wanted, before = load_text(text, file, overrides), load_text(text, file)
    tables, changes = _tables(text.decode("utf-8-sig")), set()
    for override in overrides:
        key, _, written = override.partition("=")
        section, name, *entry = path_of(key)
        path = f"{section}.{name}"
        if path not in field_table():
            raise DataError(f"--set {override} cannot be saved", "only single fields can: write it into the file")
        changes.add(path)
        _set_value(tables, path, _tables(written), *entry)
        source, value = before.source.get(path), wanted.value(path)
        if source is not None and value != before.value(path):
            ref = f"changed by hand; was {source.kind}"
            _table(tables, "source")[path] = _source("assumed", ref, source, value)
    # the support follows from the coupling, on the command line too
    if "supports.C_3" not in changes and changes & {*COUPLING_FIELDS}:
        _table(tables, "source").pop("supports.C_3", None)
        _table(tables, "supports")["C_3"] = None
    return _written(tables, file, wanted)


def _editor() -> YAML:
    """A reader and writer of YAML that keeps comments and order."""
    from ruamel.yaml import YAML  # 40 ms, for which only who writes a preset waits

    editor = YAML()
    editor.preserve_quotes, editor.width = True, 2**20
    editor.indent(mapping=2, sequence=4, offset=2)
    return editor


def _tables(text: str) -> Any:
    """Text of YAML as tables that know their comments."""
    return _editor().load(text)


def _table(tables: Any, name: str) -> Any:
    """A table of a preset, which is added where there is none."""
    if tables.get(name) is None:
        tables[name] = {}
    return tables[name]


def _set_value(tables: Any, path: str, value: Any, entry: str | int = "") -> None:
    """Put a value in place, or an entry of it; one value of all torques stays beside that of one."""
    section, name = path.split(".")
    table = _table(tables, section)
    if entry:
        if not isinstance(table.get(name), dict):
            table[name] = {} if table.get(name) is None else {"all": table[name]}
        table, name = table[name], str(entry)
    table[name] = value


def _source(kind: str, ref: str, before: Source | None, value: Any) -> Any:
    """A source in one line, with the range of the one before as far as the value lies in it."""
    bounds = before.range if before else None
    inside = bounds and isinstance(value, int | float) and bounds[0] <= value <= bounds[1]
    kept = f"range: {list(bounds)!r}, " if bounds and inside else ""
    return _tables(f"{{kind: {kind}, {kept}ref: {_quoted(ref)}}}")


def _written(tables: Any, file: str, wanted: Drive, model: Mapping[str, str | int] | None = None) -> str:
    """Text of tables, read again: it must give the wanted drive, but for fields of model that it has already."""
    stream = StringIO()
    _editor().dump(tables, stream)
    text, loose = stream.getvalue(), {f"numerics.{name}" for name in model or {}}
    with suppress(DataError):
        read = load_text(text, file)
        same = all(read.value(path) == wanted.value(path) for path in field_table() if path not in loose)
        if same and read.uncertainty == wanted.uncertainty:
            return text
    raise DataError(f"{file} cannot be changed in place", "change it by hand; hdassist presets new shows the form")


SCHEMA_FILE = "hdassist-preset.schema.json"  # that the first line of a new preset names
_NUMBER_TEXT = {"type": "string", "pattern": rf"^\s*{NUMBER}"}  # with a unit, or an uncertainty


def preset_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of presets: names, types, ranges, units and meanings of the fields as declared.

    Units within texts, keys of tables and rules between fields are left to `hdassist presets validate`.
    """
    schema, fields = _table_schema(Drive), Drive.declared()
    properties = schema["properties"]
    for name, model in sections():  # one that may be left out may be empty
        properties[name] = {"anyOf": [_table_schema(model)] + [{"type": "null"}] * (not fields[name].is_required)}
    for name, paths, item in (
        ("uncertainty", measures(), _number_schema(fields["uncertainty"])),
        ("fit", measures(), {"type": "array", "items": _number_schema(fields["fit"])}),
        ("cost", deviation_sizes(), _table_schema(CostLaw)),
        ("source", field_table(), _table_schema(Source)),
    ):
        properties[name] = {"propertyNames": {"enum": [*paths]}, "type": "object", "additionalProperties": item}
    properties["schema"] = {"const": PRESET_SCHEMA, "description": "form of this file"}
    schema["required"].append("schema")
    return schema | {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "hdassist preset"}


def _table_schema(model: type[Section]) -> dict[str, Any]:
    """Schema of a table with the fields of a model."""
    fields = model.declared().items()
    return {
        "type": "object",
        "description": model.__doc__,
        "properties": {name: _field_schema(field) for name, field in fields},
        "required": [name for name, field in fields if field.is_required],
        "additionalProperties": False,
    }


def _field_schema(field: PresetField) -> dict[str, Any]:
    """Schema of a field as presets are written: texts for numbers, one item for a list, a number for a table."""
    number, text = _number_schema(field), {"type": "string"}
    table: Any = {"type": "object", "additionalProperties": _NUMBER_TEXT if field.kind == "readings" else number}
    several = table if field.kind in KEYED_TABLES else {"type": "array", "items": number}
    forms: Any = {
        "number": [number], "count": [number], "text": [text], "line": [text], "choice": [{"enum": [*field.choices]}],
        "range": [several | {"minItems": 2, "maxItems": 2}], "readings": [table],
        "holes": [{"const": "all"}, several, number],
    }.get(field.kind, [several, number])  # fmt: skip
    empty = [{"type": "null"}] * field.is_optional + [{"const": UNKNOWN}] * field.unknown
    default = {} if field.is_required else {"default": field.default}
    about = f"{field.meaning}{field.unit and f' [{field.unit}]'}"
    return {"description": about, "anyOf": [*forms, *empty]} | default


def _number_schema(field: PresetField) -> dict[str, Any]:
    """Schema of a number of a field, or of an item of it."""
    ends = {"minimum": field.ge, "exclusiveMinimum": field.gt, "maximum": field.le}
    limits = {name: end for name, end in ends.items() if isfinite(end)}
    return {"anyOf": [{"type": "integer" if field.kind in ("count", "holes") else "number"} | limits, _NUMBER_TEXT]}
