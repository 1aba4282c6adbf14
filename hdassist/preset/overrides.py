"""Overrides "section.key=VALUE" on top of a preset, read by the same YAML reader."""

import re
from collections.abc import Sequence
from dataclasses import replace

from hdassist.errors import Finding, UsageError
from hdassist.preset.fields import PATH_TABLES, field_table
from hdassist.preset.kinds import kind_of
from hdassist.preset.yamltext import OVERRIDE, Document, Mark, Path, SourceSpan, path_text, read_yaml, shown

OVERRIDE_PLACE = re.compile(rf"^{OVERRIDE}:\d+:\d+: ", re.MULTILINE)  # in a message, of an override that nobody typed
PER_TORQUE = [tuple(path.split(".")) for path, info in field_table().items() if kind_of(info) == "limits"]


def set_override(document: Document, text: str, index: int) -> None:
    """Put an override "section.key=VALUE" on top of a document.

    Arguments: text; index, its number from 1, which findings bear as their line.
    Raises UsageError: no "=", a key that is empty or has hidden characters, or a value that is no YAML.
    """
    key, equals, value = text.partition("=")
    whole = path_of(key)
    if not equals or not all(whole) or not key.strip().isprintable():  # YAML has no such keys either
        raise UsageError(
            f"{OVERRIDE}:{index}:1: not of the form section.key=VALUE (got {shown(text) or 'nothing'})",
            f"like {OVERRIDE} gears.j_n=6",
        )
    at_key, start = Mark(index, 1), len(key) + 1
    read = read_yaml(value, OVERRIDE, whole, lambda line, column: Mark(index, (column if line == 1 else 1) + start))
    if read.findings:
        raise UsageError("\n".join(map(str, read.findings)))
    own = replace(read.places.get(whole, SourceSpan(OVERRIDE, at_key, Mark(index, start + 1))), key=at_key)
    table, path = document.data, tuple[str | int, ...]()
    for part in whole[:-1] if isinstance(table, dict) else ():
        path, inner = (*path, part), table.get(part)
        if inner is not None and not isinstance(inner, dict):
            if path not in PER_TORQUE:
                message = f"{path_text(path)} is no table of keys"
                document.findings.append(Finding(OVERRIDE, *at_key, path_text(whole), message))
                return
            inner = {"all": inner}  # one entry on top of a bare number, which is the limit for all torques
            document.places[(*path, "all")] = document.places[path]
        document.places.setdefault(path, own)
        table[part] = table = {} if inner is None else inner
    if isinstance(table, dict):
        table[whole[-1]] = read.data
        kept = {path: place for path, place in document.places.items() if path[: len(whole)] != whole}
        document.places = kept | read.places | {whole: own}
        document.bad = {path for path in document.bad if path[: len(whole)] != whole}


def path_of(key: str) -> Path:
    """Path that the key of an override sets; keys of `uncertainty`, `fit`, `source` and `cost` have a dot in them."""
    parts = [part.strip() for part in key.split(".")]
    if parts[0] in PATH_TABLES:
        return tuple(filter(None, (parts[0], ".".join(parts[1:3]), *parts[3:])))
    return (*parts[:2], ".".join(parts[2:])) if len(parts) > 2 else tuple(parts)


def is_overridden(path: str, overrides: Sequence[str]) -> bool:
    """Whether overrides set a field ("gears.z_g"), a table around it or an entry of it."""
    field = tuple(path.split("."))
    paths = [path_of(text.partition("=")[0]) for text in overrides]
    return any(p[: len(field)] == field[: len(p)] for p in paths)
