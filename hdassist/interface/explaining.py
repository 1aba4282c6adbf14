"""Explanations of checks, notes, fields, sections, symbols, terms and errors, by any spelling of their names."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from typing import Literal

from hdassist.drive.preset.fields import PresetField, field_table, plain, sections
from hdassist.features.acceptance.limits import CODES, Check
from hdassist.run.errors import Fault, UsageError
from hdassist.run.files import package_table


@dataclass(frozen=True)
class _Term:
    """A term with its meaning, its Russian equivalent, other names (symbols, JSON keys), and the unit of a quantity."""

    word: str
    meaning: str
    russian: str = ""
    others: Sequence[str] = ()
    unit: str = ""


@dataclass(frozen=True)
class _Symbols:
    """Symbols with one meaning.

    paper: symbols in the paper.
    code: names in the code, in Markdown.
    words: the meaning.
    unit: the unit.
    """

    paper: Sequence[str]
    code: str
    words: str
    unit: str = ""


@dataclass(frozen=True)
class _FaultWords:
    """Meaning and remedy of a kind of error."""

    meaning: str
    change: str


_TABLE = package_table("interface/explaining.toml")
GROUPS: Mapping[str, Sequence[_Term]] = {
    group: tuple(_Term(**row) for row in terms) for group, terms in _TABLE["terms"].items()
}
TERMS = tuple(term for group in GROUPS.values() for term in group)
_WORDS_OF_PAGES: Mapping[tuple[str, ...], str] = {
    tuple(names.split(", ")): names_of_page for names, names_of_page in _TABLE["pages"].items()
}
SYMBOLS = tuple(_Symbols(**row) for row in _TABLE["symbols"])
FAULTS = {Fault(code): _FaultWords(**row) for code, row in _TABLE["faults"].items()}


_EntryKind = Literal["check", "remark", "quantity or word", "symbol", "field", "section", "error", "option"]
_GREEK = {
    "φ": "phi",
    "ξ": "xi",
    "δ": "delta",
    "β": "beta",
    "τ": "tau",
    "θ": "theta",
    "ё": "е",
    "±": "plusminus",
    "″": "arcsec",
}
# transliteration as in passports
_LATIN = dict(zip("абвгдеёзийклмнопрстуфыэ", "abvgdeeziiklmnoprstufye", strict=True)) | {
    "ж": "zh",
    "х": "kh",
    "ц": "ts",
    "ч": "ch",
    "ш": "sh",
    "щ": "shch",
    "ю": "iu",
    "я": "ia",
    "ъ": "",
    "ь": "",
}
_LONGEST_NAME = 60  # largest number of characters of a name that is compared with others
_LONGEST_PHRASE = 12  # largest number of words of a phrase whose parts are looked up


@dataclass(frozen=True)
class Entry:
    """An explanation.

    kind: kind of the explained name.
    names: all names, the proper one first.
    words: the explanation.
    facts: pairs of label and text.
    """

    kind: _EntryKind
    names: tuple[str, ...]
    words: str
    facts: tuple[tuple[str, str], ...] = ()

    def in_latin(self) -> Entry:
        """Return the entry with Cyrillic and Greek letters transliterated, for terminals with 7-bit characters."""
        facts = tuple((label, latin(text)) for label, text in self.facts)
        return Entry(
            kind=self.kind,
            names=tuple(map(latin, self.names)),
            words=latin(self.words),
            facts=facts,
        )


def latin(text: str) -> str:
    """Return a text with its Cyrillic and Greek letters transliterated."""
    letters = []
    for letter in text:
        low = letter.lower()
        latin_letter = _LATIN.get(low) or (_GREEK.get(low) if low.isalpha() else None)
        if latin_letter is None:
            letters.append(letter)
        else:
            letters.append(latin_letter if letter == low else latin_letter.capitalize())
    return "".join(letters)


@cache
def entries() -> tuple[Entry, ...]:
    """Return all entries."""
    return tuple(_entries())


def _entries() -> Iterator[Entry]:
    """Yield the entries of checks, notes, terms, symbols, sections, fields and errors."""
    yield from _code_entries()
    for term in TERMS:
        russian = tuple(term.russian.split(", ")) if term.russian else ()
        facts = (("Russian", term.russian), ("unit", term.unit), ("also", ", ".join(term.others)))
        names = (term.word, *russian, *term.others)
        yield Entry(
            kind="quantity or word",
            names=names,
            words=term.meaning,
            facts=_given(facts),
        )
    for names, page_meaning in _WORDS_OF_PAGES.items():
        yield Entry("quantity or word", names, page_meaning)
    yield from _symbol_entries()
    for section, model in sections():
        fields = (("fields", ", ".join(model.model_fields)),)
        yield Entry(
            kind="section",
            names=(section,),
            words=str(model.__doc__).rstrip("."),
            facts=fields,
        )
    for path, field in field_table().items():
        yield Entry(
            kind="field",
            names=(path, path.split(".")[1]),
            words=field.meaning,
            facts=_given(_of_field(field)),
        )
    for fault, text in FAULTS.items():
        yield Entry(
            kind="error",
            names=(str(fault),),
            words=text.meaning,
            facts=(("change", text.change),),
        )


def _code_entries() -> Iterator[Entry]:
    """Yield the entries of checks, with their limits, and of notes."""
    for code, item in CODES.items():
        meaning = (("tests", item.tests), ("goes wrong", item.wrong), ("change", item.change))
        if isinstance(item, Check):
            bound = "largest" if item.upper else "smallest"
            limit = f"acceptance.{item.field}, the {bound} permitted value, {item.unit.replace('*', '·')}"
            facts = (("limit", limit), *meaning)
            yield Entry(
                kind="check",
                names=(code, item.words),
                words=item.words,
                facts=facts,
            )
        else:
            yield Entry(
                kind="remark",
                names=(code,),
                words=item.words,
                facts=meaning,
            )


def _symbol_entries() -> Iterator[Entry]:
    """Yield an entry for each symbol of the paper; symbols with one meaning refer to each other."""
    for symbol in SYMBOLS:
        facts = (("in the code", symbol.code.replace("`", "")), ("unit", symbol.unit))
        meaning = f"{', '.join(symbol.paper)}: {symbol.words}" if len(symbol.paper) > 1 else symbol.words
        for name in symbol.paper:
            yield Entry(
                kind="symbol",
                names=(name,),
                words=meaning,
                facts=_given(facts),
            )


def _of_field(field: PresetField) -> tuple[tuple[str, str], ...]:
    choice = field.kind == "choice"
    default = "unknown" if field.unknown else "none; a value is required" if field.is_required else ""
    if not default:
        number = plain(field.default) if isinstance(field.default, float) else str(field.default)
        default = "none" if field.default in (None, {}, ()) else number
    span = ", ".join(field.choices) if choice else field.range_words()
    return (("unit", field.unit), ("values" if choice else "range", span), ("left out", default))


def _given(facts: Sequence[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    return tuple((label, text) for label, text in facts if text)


def _normal_spelling(name: str) -> str:
    """Return a name without differences of spelling: case, primes, dashes and Greek letters."""
    text = "".join(_GREEK.get(letter, letter) for letter in name.lower())
    return re.sub(r"[\W_]+", "", text)


@cache
def _by_spelling() -> dict[str, list[Entry]]:
    by_spelling: dict[str, list[Entry]] = {}
    for entry in entries():
        for key in dict.fromkeys(map(_normal_spelling, entry.names)):
            by_spelling.setdefault(key, []).append(entry)
    return by_spelling


def _has_word(entry: Entry, stem: str) -> bool:
    """Return whether the names of an entry, or the values of its field, contain a word.

    stem: the word without a plural s.
    """
    spellings = re.split(r"[\s.,-]+", " ".join((*entry.names, dict(entry.facts).get("values", ""))))
    return stem in (_normal_spelling(word).removesuffix("s") for word in spellings)


def is_name(name: str) -> bool:
    """Return whether a name or its plural has an entry of its own."""
    spelling = _normal_spelling(name)
    return any(key in _by_spelling() for key in (spelling, spelling.removesuffix("s")))


def explained(name: str, options: Mapping[str, str] | None = None) -> list[Entry]:
    """Return the entries with a name, or with this name as a word in their names or values.

    A single letter is matched with its case. A phrase without entries is split into its parts.

    name: name as typed.
    options: help texts of command options, by their fields.
    Raises UsageError for an unknown name, with the nearest names in its hint.
    """
    spelling = _normal_spelling(name)
    entries_by_spelling = _by_spelling()
    stem = spelling.removesuffix("s")
    same_spelling = entries_by_spelling.get(spelling) or entries_by_spelling.get(stem, [])
    exact = [entry for entry in same_spelling if name in entry.names]
    if len(spelling) == 1 and exact:  # m and M, N and n are different symbols
        return exact
    if stem and same_spelling:
        return same_spelling
    with_word = [entry for entry in entries() if _has_word(entry, stem)] if stem else []
    if with_word:
        return with_word
    option = (options or {}).get(re.sub(r"\W", "_", name))
    if option:
        return [Entry("option", (name,), option.rstrip("."))]
    of_parts = _entries_of_parts(name)
    if of_parts:
        return of_parts
    nearest_spellings = get_close_matches(spelling[:_LONGEST_NAME], entries_by_spelling, 3, 0.6)
    nearest = " or ".join(dict.fromkeys(entries_by_spelling[key][0].names[0] for key in nearest_spellings))
    hint = f"the nearest name is {nearest}" if nearest else "list all names with hdassist explain"
    raise UsageError(f"unknown name: {name[:_LONGEST_NAME]}", hint)


def _entries_of_parts(phrase: str) -> list[Entry]:
    """Return the distinct entries of the longest parts of a phrase that have entries; empty if no part has entries."""
    phrase_words = phrase.split()[:_LONGEST_PHRASE]
    for size in range(len(phrase_words) - 1, 0, -1):
        entries_of_size: list[Entry] = []
        for first in range(len(phrase_words) - size + 1):
            part = _normal_spelling(" ".join(phrase_words[first : first + size]))
            entries_of_size += _by_spelling().get(part, ())
        if entries_of_size:
            return list(dict.fromkeys(entries_of_size))
    return []
