"""A commented preset to start from, written from the declarations of the fields."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

from pydantic.fields import FieldInfo

from hdassist.errors import UsageError
from hdassist.preset.fields import SCHEMA, sections
from hdassist.preset.kinds import Section, plain, unit_of
from hdassist.preset.yamltext import resolve

MAX_NAME = 200


def new_preset(name: str) -> str:
    """Text of a preset that is valid as it stands, with example numbers to be replaced.

    Every required field and every one with an example has a line; each other field has one that is
    commented out, with its default.
    Raises UsageError: a name that a preset cannot have.
    """
    if not 1 <= len(name) <= MAX_NAME or not name.isprintable():
        raise UsageError(f"a drive needs a name of 1 to {MAX_NAME} printable characters")
    lines = [
        "# A preset to start from. EVERY NUMBER BELOW IS AN EXAMPLE: put in those of your drive.",
        '# A bare number is in the unit beside it; a text with a unit, such as "75 um", is converted.',
        "# Lines that are commented out show what else can be given, with the value used without them.",
        f"schema: {SCHEMA}",
        f"name: {_text(name)}",
        "description: Example numbers, not yet those of a drive.",
    ]
    for section, model in sections():
        lines += ["", *_section(section, model)]
    lines += [
        "",
        "# Where a value comes from: given, assumed or identified.",
        "#source:",
        '#  gears.z_g: {kind: given, ref: "drawing, sheet 1"}',
    ]
    return "\n".join(lines) + "\n"


def _section(section: str, model: type[Section]) -> Iterator[str]:
    active = any(info.examples for info in model.model_fields.values())
    yield f"{'' if active else '#'}{section}:  # {(model.__doc__ or '').strip()}"
    for name, info in model.model_fields.items():
        value = info.examples[0] if info.examples else info.default
        if value is not None:
            entry = f"{'  ' if info.examples else '#  '}{name}: {_value(value)}"
            yield f"{entry:<28}# {_about(info)}"
        else:
            yield f"{f'#  {name}:':<28}# {_about(info)}"


def _about(info: FieldInfo) -> str:
    unit = unit_of(info)
    return f"{unit}, {info.description}" if unit else str(info.description)


def _value(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, tuple):
        return f"[{', '.join(map(plain, value))}]"
    return "{}" if isinstance(value, dict) else plain(value)


def _text(text: str) -> str:
    """A text as YAML: as it is where that is safe, else in quotes."""
    word = re.fullmatch(r"[A-Za-z][A-Za-z0-9]*([-_][A-Za-z0-9]+)*", text)
    return text if word and isinstance(resolve(text), str) else json.dumps(text, ensure_ascii=False)
