"""Texts of presets: a commented one to start from, and one with other values put into it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic.fields import FieldInfo

from hdassist.errors import DataError, UsageError
from hdassist.loading.load import load_text
from hdassist.preset import coupling
from hdassist.preset.fields import SCHEMA, Source, field_table, fields, read_range, sections
from hdassist.preset.kinds import Section, plain, unit_of
from hdassist.preset.overrides import path_of
from hdassist.preset.yamltext import Path, read, resolve

MAX_NAME = 200


def new_preset(name: str) -> str:
    """Text of a preset that is valid as it stands, with example numbers to be replaced.

    Every required field and every one with an example has a line; each other field has one that is
    commented out, with its default.
    Raises UsageError: a name that a preset cannot have.
    """
    require_name(name)
    lines = [
        "# A preset to start from. EVERY NUMBER BELOW IS AN EXAMPLE: put in those of your drive.",
        '# A bare number is in the unit beside it; a text with a unit, such as "75 um", is converted.',
        "# Lines that are commented out show what else can be given, with the value used without them.",
        f"schema: {SCHEMA}",
        f"name: {quoted(name)}",
        "description: Example numbers, not yet those of a drive.",
    ]
    for section, model in sections():
        lines += ["", *_section(section, model)]
    lines += [
        "",
        "# Where a value comes from: given, assumed or identified. Beside a value of yours write kind: given.",
        "source:",
        *(f'  {path}: {{kind: assumed, ref: "example"}}' for path, info in fields() if info.examples),
    ]
    return "\n".join(lines) + "\n"


def require_name(name: str) -> None:
    """Raise UsageError for a name that a preset cannot have."""
    if not 1 <= len(name) <= MAX_NAME or not name.isprintable():
        raise UsageError(f"a drive needs a name of 1 to {MAX_NAME} printable characters")


def _section(section: str, model: type[Section]) -> Iterator[str]:
    active = any(info.examples for info in model.model_fields.values())
    yield f"{'' if active else '#'}{section}:  # {(model.__doc__ or '').strip()}"
    for name, info in model.model_fields.items():
        value = info.examples[0] if info.examples else info.default
        if value is not None:
            entry = f"{'  ' if info.examples else '#  '}{name}: {_value(value)}"
            yield f"{entry:<27} # {about(info)}"
        else:
            yield f"{f'#  {name}:':<27} # {about(info)}"


def about(info: FieldInfo) -> str:
    """Unit and meaning of a field, as a comment beside it says them."""
    unit = unit_of(info)
    return f"{unit}, {info.description}" if unit else str(info.description)


def _value(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, tuple):
        return f"[{', '.join(map(plain, value))}]"
    return "{}" if isinstance(value, dict) else plain(value)


def quoted(text: str) -> str:
    """A text as YAML: as it is where that is safe, else in quotes."""
    word = re.fullmatch(r"[A-Za-z][A-Za-z0-9]*([-_][A-Za-z0-9]+)*", text)
    return text if word and isinstance(resolve(text), str) else json.dumps(text, ensure_ascii=False)


def with_found_values(
    text: str,
    file: str,
    values: Mapping[str, float],
    ref: str,
    alternatives: Sequence[Mapping[str, float]] = (),
    model: Mapping[str, str | int] | None = None,
) -> str:
    """Text of a preset with identified values.

    Arguments: text; file, its name in messages; values, by path, of fields that the text gives or leaves out; ref,
    where they come from; alternatives, other sets of such values; model, the fields of numerics that they were
    identified with, which the text says from now on.
    Raises DataError where the text is not laid out so that it can be changed in place.
    """
    changed = text if text.endswith("\n") else text + "\n"
    for path, value in values.items():
        changed = _with_value(changed, file, path, f"{value:g}" if f"{value:g}" == repr(value) else repr(value))
        kept = _range_around(changed, file, path, value)
        changed = _with_source(
            changed, file, path, f"{{kind: identified, {kept}ref: {json.dumps(ref, ensure_ascii=False)}}}"
        )
    for name, setting in (model or {}).items():
        if ("numerics", name) not in read(changed, file).places:
            changed = _with_key(changed, file, "numerics", f"{name}: {setting}")
    changed = _without_block(changed, file, ("alternatives",))
    if alternatives:
        lines = [f"  - {{{', '.join(f'{path}: {value!r}' for path, value in each.items())}}}" for each in alternatives]
        changed += "\n".join(["", "alternatives:  # other values that agree with the same targets", *lines, ""])
    _require(changed, file, values, alternatives)
    return changed


def with_changes(text: bytes, file: str, overrides: Sequence[str]) -> str:
    """Text of a preset with overrides put in, its comments and order as they are.

    A changed value that was assumed or identified is assumed from now on, without a range that it has left. Arguments:
    text; file, its name in messages; overrides, such as "cam.W_0=0.95". Raises what loading the preset with them
    raises; DataError where an override is of no single field, or the text is not laid out so that it can be changed in
    place.
    """
    wanted, before = load_text(text, file, overrides), load_text(text, file)
    changed = text.decode("utf-8-sig").replace("\r\n", "\n")
    changed = changed if changed.endswith("\n") else changed + "\n"
    changes = set()
    for override in overrides:
        key, _, written = override.partition("=")
        path = ".".join(map(str, path_of(key)))
        if path not in field_table():
            raise DataError(f"--set {override} cannot be saved", "only single fields can: write it into the file")
        changes.add(path)
        changed = _with_value(changed, file, path, written.strip())
        source = before.source.get(path)
        if source is not None and wanted.value(path) != before.value(path):
            changed = _with_source(changed, file, path, _assumed(source, wanted.value(path)))
    if "supports.C_3" not in changes and changes & {*coupling.FIELDS}:  # the support follows from them, on the line too
        changed = _without_block(changed, file, ("source", "supports.C_3"))
        changed = _with_value(changed, file, "supports.C_3", "null")
    try:
        same = load_text(changed, file)
        right = all(same.value(path) == wanted.value(path) for path in field_table())
        right = right and same.uncertainty == wanted.uncertainty
    except DataError:
        right = False
    if not right:
        raise DataError(f"{file} is not laid out so that its values can be changed in place", "change it by hand")
    return changed


def _assumed(source: Source, value: Any) -> str:
    """The source of a value that was changed by hand, in place of that of the value before."""
    inside = source.range is not None and isinstance(value, int | float) and source.range[0] <= value <= source.range[1]
    kept = f"range: [{source.range[0]!r}, {source.range[1]!r}], " if inside and source.range else ""
    return f"{{kind: assumed, {kept}ref: {json.dumps(f'changed by hand; was {source.kind}', ensure_ascii=False)}}}"


def _with_value(text: str, file: str, path: str, written: str) -> str:
    section, name = path.split(".")
    place = read(text, file).places.get((section, name))
    lines = text.split("\n")
    if place is None:
        return _with_key(text, file, section, f"{name}: {written}")
    row, column = place.value.line - 1, place.value.column - 1
    length = len(place.text) + 2 * place.quoted
    if lines[row][column : column + 1] in ("[", "{"):
        length = _bracketed(lines[row][column:])
    lines[row] = lines[row][:column] + written + lines[row][column + length :]
    return "\n".join(lines)


def _bracketed(text: str) -> int:
    """Length of the list or table that a text begins with; 0 where it does not end on its line."""
    depth = 0
    for place, letter in enumerate(text, 1):
        depth += (letter in "[{") - (letter in "]}")
        if not depth:
            return place
    return 0


def _range_around(text: str, file: str, path: str, value: float) -> str:
    """The plausible range that the text gives a field, as it is written again; empty where the value is not in it."""
    table = (read(text, file).data or {}).get("source")
    entry = table.get(path) if isinstance(table, dict) else None
    bounds = read_range(path, entry.get("range")) if isinstance(entry, dict) else None
    inside = isinstance(bounds, tuple) and bounds[0] <= value <= bounds[1]
    return f"range: [{bounds[0]!r}, {bounds[1]!r}], " if isinstance(bounds, tuple) and inside else ""


def _with_source(text: str, file: str, path: str, entry: str) -> str:
    text = _without_block(text, file, ("source", path))
    place = read(text, file).places.get(("source",))
    if place is None:
        return f"{text}\nsource:\n  {path}: {entry}\n"
    lines = text.split("\n")
    row = place.key.line - 1
    following = next((line for line in lines[row + 1 :] if line.strip() and not line.lstrip().startswith("#")), "")
    indent = following[: len(following) - len(following.lstrip())] or "  "
    lines.insert(row + 1, f"{indent}{path}: {entry}")
    return "\n".join(lines)


def _with_key(text: str, file: str, section: str, entry: str) -> str:
    """The text with a key more in a section, which is added where there is none."""
    places = read(text, file).places
    table = places.get((section,))
    if table is None:
        return f"{text}\n{section}:\n  {entry}\n"
    lines, row = text.split("\n"), table.value.line - 1
    line, column = lines[row], table.value.column - 1
    if line[column : column + 1] == "{":
        rest = line[column + 1 :]
        more = "" if rest.lstrip().startswith("}") else ", "
        lines[row] = f"{line[: column + 1]}{entry}{more}{rest.lstrip()}"
    elif any(path[:1] == (section,) and len(path) > 1 for path in places):  # a block begins with its first key
        lines.insert(row, f"{' ' * column}{entry}")
    else:  # a key with nothing behind it
        lines.insert(table.key.line, f"{' ' * (table.key.column + 1)}{entry}")
    return "\n".join(lines)


def _without_block(text: str, file: str, path: Path) -> str:
    """The text without a key and all that is indented under it."""
    place = read(text, file).places.get(path)
    if place is None:
        return text
    lines = text.split("\n")
    first = place.key.line - 1
    depth = place.key.column - 1
    last = first + 1
    while last < len(lines) and _belongs(lines[last], depth):
        last += 1
    return "\n".join(lines[:first] + lines[last:])


def _belongs(line: str, depth: int) -> bool:
    indent = len(line) - len(line.lstrip())
    return bool(line.strip()) and (indent > depth or (indent == depth and line.lstrip().startswith("- ")))


def _require(text: str, file: str, values: Mapping[str, float], alternatives: Sequence[Mapping[str, float]]) -> None:
    """Read the text again: what was put in has to come out."""
    try:
        drive = load_text(text, file)
        right = all(drive.value(path) == value for path, value in values.items())
        right = right and [dict(each) for each in drive.alternatives] == [dict(each) for each in alternatives]
    except DataError:
        right = False
    if not right:
        raise DataError(
            f"{file} is not laid out so that values can be put into it",
            "one key a line, and source as a block of lines; hdassist presets new shows the form",
        )
