"""Everything that has a name: checks, remarks, fields, sections, symbols, words, errors; by any spelling of it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from typing import Literal

from pydantic.fields import FieldInfo

from hdassist.acceptance.checks import CODES, Check
from hdassist.errors import UsageError
from hdassist.explaining.faults import FAULTS
from hdassist.explaining.symbols import SYMBOLS
from hdassist.explaining.terms import TERMS
from hdassist.preset.fields import field_table, sections
from hdassist.preset.kinds import choices_of, kind_of, may_be_unknown, plain, range_of, unit_of

EntryKind = Literal["check", "remark", "quantity or word", "symbol", "field", "section", "error"]
GREEK = {"φ": "phi", "ξ": "xi", "δ": "delta", "β": "beta", "τ": "tau", "θ": "theta", "ё": "е"}
LONGEST_NAME = 60  # characters of a name that are compared with others


@dataclass(frozen=True)
class Entry:
    """Something that has a name. names: all its spellings, the first one its own; facts: a label and a text each."""

    kind: EntryKind
    names: tuple[str, ...]
    words: str
    facts: tuple[tuple[str, str], ...] = ()


@cache
def entries() -> tuple[Entry, ...]:
    """All that can be explained."""
    return (*_codes(), *_terms(), *_symbols(), *_fields(), *_faults())


def _codes() -> Iterator[Entry]:
    for code, item in CODES.items():
        limit: tuple[tuple[str, str], ...] = ()
        names: tuple[str, ...] = (code,)
        if isinstance(item, Check):
            how = "greatest" if item.upper else "least"
            limit = (("limit", f"acceptance.{item.field}, the {how} value allowed, {item.unit.replace('*', '·')}"),)
            names = (code, item.words)
        told = (("tests", item.tests), ("goes wrong", item.wrong), ("change", item.change))
        yield Entry("check" if isinstance(item, Check) else "remark", names, item.words, (*limit, *told))


def _terms() -> Iterator[Entry]:
    for term in TERMS:
        russian = tuple(term.russian.split(", ")) if term.russian else ()
        facts = (("Russian", term.russian), ("unit", term.unit), ("also", ", ".join(term.others)))
        yield Entry("quantity or word", (term.word, *russian, *term.others), term.meaning, _given(facts))


def _symbols() -> Iterator[Entry]:
    for each in SYMBOLS:
        facts = (("in the code", each.code.replace("`", "")), ("unit", each.unit))
        for name in each.paper:
            shared = f"{', '.join(each.paper)}: {each.words}" if len(each.paper) > 1 else each.words
            yield Entry("symbol", (name,), shared, _given(facts))


def _fields() -> Iterator[Entry]:
    for section, model in sections():
        keys = ", ".join(model.model_fields)
        yield Entry("section", (section,), str(model.__doc__).rstrip("."), (("fields", keys),))
    for path, info in field_table().items():
        yield Entry("field", (path, path.split(".")[1]), str(info.description), _given(_of_field(info)))


def _of_field(info: FieldInfo) -> tuple[tuple[str, str], ...]:
    choice = kind_of(info) == "choice"
    default = "unknown" if may_be_unknown(info) else "none: it has to be given" if info.is_required() else ""
    if not default:
        default = "none" if info.default in (None, {}, ()) else _plainly(info.default)
    span = ", ".join(choices_of(info)) if choice else range_of(info)
    return (("unit", unit_of(info)), ("values" if choice else "range", span), ("left out", default))


def _plainly(default: object) -> str:
    return plain(default) if isinstance(default, float) else str(default)


def _faults() -> Iterator[Entry]:
    for code, told in FAULTS.items():
        yield Entry("error", (str(code),), told.meaning, (("change", told.change),))


def _given(facts: Sequence[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    return tuple((label, text) for label, text in facts if text)


def spelt(name: str) -> str:
    """A name without what spellings differ in: case, primes, dashes, Greek letters."""
    text = "".join(GREEK.get(letter, letter) for letter in name.lower())
    return re.sub(r"[\W_]+", "", text)


@cache
def _by_spelling() -> dict[str, list[Entry]]:
    found: dict[str, list[Entry]] = {}
    for entry in entries():
        for key in dict.fromkeys(map(spelt, entry.names)):
            found.setdefault(key, []).append(entry)
    return found


def explained(name: str) -> list[Entry]:
    """What a name stands for; where letters' case tells one from the others, that one alone.

    Raises UsageError, with the names that are near: nothing is called so.
    """
    found = _by_spelling().get(spelt(name), []) if spelt(name) else []
    exact = [entry for entry in found if name in entry.names]
    if len(spelt(name)) == 1 and exact:  # m and M, N and n
        return exact
    if found:
        return found
    near = get_close_matches(spelt(name)[:LONGEST_NAME], _by_spelling(), 3, 0.6)
    meant = " or ".join(dict.fromkeys(_by_spelling()[key][0].names[0] for key in near))
    raise UsageError(
        f"nothing is called {name[:LONGEST_NAME]}",
        f"did you mean {meant}?" if meant else "hdassist explain lists what is",
    )
