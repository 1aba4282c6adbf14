"""Text of a preset of a drive that is like another one: readable, with the source and range of every value."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from hdassist.errors import PresetError, UsageError
from hdassist.loading.load import load_text
from hdassist.loading.write import about, quoted, require_name
from hdassist.preset.catalogue import of_catalogue
from hdassist.preset.fields import SCHEMA, Drive, sections
from hdassist.preset.kinds import UNKNOWN, Section, may_be_unknown, plain
from hdassist.preset.similarity import Entry, Wish, similar

WIDTH = 110  # of the description
OF_DEVIATIONS = ("tolerances", "phases", "harmonics")


def similar_preset(name: str, like: Drive, wish: Wish, description: str = "") -> str:
    """Text of a preset of a drive that is like another one.

    Arguments: name; like, the other drive; wish, what is given of the new one; description, in place of the usual.
    Raises UsageError: a name that a preset cannot have, wishes that contradict each other, or no drive that meshes.
    """
    require_name(name)
    entries = similar(like, wish)
    text = "\n".join(_lines(name, like, entries, description)) + "\n"
    try:
        load_text(text, name)
    except PresetError as error:
        raise UsageError(f"no such drive meshes: {error.findings[0].message}", "other teeth, or another size") from None
    return text


def _lines(name: str, like: Drive, entries: Mapping[str, Entry], description: str) -> Iterator[str]:
    z_g, z_b, m = (entries[f"gears.{field}"].value for field in ("z_g", "z_b", "m"))
    kinds = [entry.kind for path, entry in entries.items() if not of_catalogue(path)]
    sure = kinds.count("given")
    other = like.name if like.name.isprintable() else "another drive"
    yield f"# Made by hdassist presets new, like {other}: {sure} values given, {len(kinds) - sure} assumed."
    yield "# `source` at the end of the file says how each was chosen, and in which range it may lie. Put in what you"
    yield "# know, with kind: given beside it. What is unknown is not zero: answers are ranges over it."
    yield f"schema: {SCHEMA}"
    yield f"name: {quoted(name)}"
    words = description or (
        f"Drive {z_g}/{z_b}, pitch diameter {m * z_g:.5g} mm, by similarity from {like.name}. "
        "Its absolute values are guesses; what each rests on stands in source."
    )
    if words.isprintable():
        yield "description: >-"
        yield from textwrap.wrap(words, WIDTH, initial_indent="  ", subsequent_indent="  ", break_long_words=False)
    else:
        yield f"description: {_in_quotes(words)}"
    for section, model in sections():
        written = {
            field: entries[f"{section}.{field}"] for field in model.model_fields if f"{section}.{field}" in entries
        }
        if written or section in OF_DEVIATIONS:
            yield ""
            yield from _section(section, model, written)
    yield ""
    yield "source:"
    for path, entry in entries.items():
        bounds = f"range: [{_number(entry.range[0])}, {_number(entry.range[1])}], " if entry.range else ""
        yield f"  {path}: {{kind: {entry.kind}, {bounds}ref: {_in_quotes(entry.ref)}}}"


def _section(section: str, model: type[Section], written: Mapping[str, Entry]) -> Iterator[str]:
    yield f"{section}:"
    for field, info in model.model_fields.items():
        if field in written:
            yield f"{f'  {field}: {_value(written[field].value)}':<23} # {about(info)}"
        elif may_be_unknown(info) and (section, field[:3]) != ("harmonics", "xi_"):  # needless without an amplitude
            yield f"{f'  {field}: {UNKNOWN}':<23} # {about(info)}"


def _in_quotes(text: str) -> str:
    return json.dumps(text, ensure_ascii=not text.isprintable())


def _value(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_number, value))}]"
    return _number(value) if isinstance(value, int | float) else str(value)


def _number(value: float) -> str:
    """A number with every digit it has, and no more."""
    short = plain(value)
    return short if float(short) == value else repr(value)
