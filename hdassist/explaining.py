"""Explanations of checks, remarks, fields, sections, symbols, words and errors, by any spelling of their names."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from typing import Literal

from hdassist.acceptance.limits import CODES, Check
from hdassist.errors import Fault, UsageError
from hdassist.files import package_table
from hdassist.preset.fields import PresetField, field_table, plain, sections


@dataclass(frozen=True)
class _Term:
    """A word: in Russian, its meaning, other names (symbols, keys of JSON), and the unit of a quantity."""

    word: str
    meaning: str
    russian: str = ""
    others: Sequence[str] = ()
    unit: str = ""


@dataclass(frozen=True)
class _Symbols:
    """Symbols with one meaning: as the paper writes them, where the code has them (Markdown), in words, with unit."""

    paper: Sequence[str]
    code: str
    words: str
    unit: str = ""


@dataclass(frozen=True)
class _FaultWords:
    """Meaning of a kind of error, and its remedy."""

    meaning: str
    change: str


_TABLE = package_table("explaining.toml")
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
_LATIN = dict(zip("абвгдеёзийклмнопрстуфыэ", "abvgdeeziiklmnoprstufye", strict=True)) | {  # as in passports
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
_LONGEST_NAME = 60  # characters of a name that are compared with others
_LONGEST_PHRASE = 12  # words of a phrase whose parts are looked up


@dataclass(frozen=True)
class Entry:
    """An explanation. names: all its names, the proper one first; facts: pairs of label and text."""

    kind: _EntryKind
    names: tuple[str, ...]
    words: str
    facts: tuple[tuple[str, str], ...] = ()

    def in_latin(self) -> Entry:
        """Return the entry with Cyrillic and Greek letters transliterated, for terminals that show 7 bits."""
        facts = tuple((label, latin(text)) for label, text in self.facts)
        return Entry(kind=self.kind, names=tuple(map(latin, self.names)), words=latin(self.words), facts=facts)


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
    """All entries."""
    return tuple(_entries())


def _entries() -> Iterator[Entry]:
    """Checks and remarks, words, symbols, sections, fields and errors."""
    for code, item in CODES.items():
        limit: tuple[tuple[str, str], ...] = ()
        names: tuple[str, ...] = (code,)
        if isinstance(item, Check):
            how = "largest" if item.upper else "smallest"
            limit = (("limit", f"acceptance.{item.field}, the {how} value allowed, {item.unit.replace('*', '·')}"),)
            names = (code, item.words)
        meaning = (("tests", item.tests), ("goes wrong", item.wrong), ("change", item.change))
        yield Entry(
            kind="check" if isinstance(item, Check) else "remark",
            names=names,
            words=item.words,
            facts=(*limit, *meaning),
        )
    for term in TERMS:
        russian = tuple(term.russian.split(", ")) if term.russian else ()
        facts = (("Russian", term.russian), ("unit", term.unit), ("also", ", ".join(term.others)))
        yield Entry(
            kind="quantity or word", names=(term.word, *russian, *term.others), words=term.meaning, facts=_given(facts)
        )
    for names, page_meaning in _WORDS_OF_PAGES.items():
        yield Entry("quantity or word", names, page_meaning)
    for symbol in SYMBOLS:
        of_symbol = (("in the code", symbol.code.replace("`", "")), ("unit", symbol.unit))
        for name in symbol.paper:
            shared = f"{', '.join(symbol.paper)}: {symbol.words}" if len(symbol.paper) > 1 else symbol.words
            yield Entry(kind="symbol", names=(name,), words=shared, facts=_given(of_symbol))
    for section, model in sections():
        keys = ", ".join(model.model_fields)
        yield Entry(kind="section", names=(section,), words=str(model.__doc__).rstrip("."), facts=(("fields", keys),))
    for path, field in field_table().items():
        yield Entry(kind="field", names=(path, path.split(".")[1]), words=field.meaning, facts=_given(_of_field(field)))
    for fault, fault_words in FAULTS.items():
        yield Entry(
            kind="error", names=(str(fault),), words=fault_words.meaning, facts=(("change", fault_words.change),)
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
    """A name without differences of spelling: case, primes, dashes, Greek letters."""
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
    """Whether a word without its plural's s is in the names of an entry, or in the values of its field."""
    spellings = re.split(r"[\s.,-]+", " ".join((*entry.names, dict(entry.facts).get("values", ""))))
    return stem in (_normal_spelling(word).removesuffix("s") for word in spellings)


def explained(name: str, options: Mapping[str, str] | None = None) -> list[Entry]:
    """Entries of a name, or with it in their names or values; of a letter those of its case, of a phrase of its parts.

    Argument: help of the options of commands, by their fields. Raises UsageError: an unknown name; its hint has the
    nearest names.
    """
    spelling = _normal_spelling(name)
    entries_by_spelling = _by_spelling()
    stem = spelling.removesuffix("s")
    same_spelling = entries_by_spelling.get(spelling) or entries_by_spelling.get(stem, [])
    exact = [entry for entry in same_spelling if name in entry.names]
    if len(spelling) == 1 and exact:  # m and M, N and n
        return exact
    if stem and (entries_found := same_spelling or [entry for entry in entries() if _has_word(entry, stem)]):
        return entries_found
    if option := (options or {}).get(re.sub(r"\W", "_", name)):
        return [Entry("option", (name,), option.rstrip("."))]
    phrase = name.split()[:_LONGEST_PHRASE]
    for size in range(len(phrase) - 1, 0, -1):
        parts = (_normal_spelling(" ".join(phrase[k : k + size])) for k in range(len(phrase) - size + 1))
        if entries_found := list(dict.fromkeys(entry for part in parts for entry in entries_by_spelling.get(part, ()))):
            return entries_found
    near_spellings = get_close_matches(spelling[:_LONGEST_NAME], entries_by_spelling, 3, 0.6)
    meant = " or ".join(dict.fromkeys(entries_by_spelling[key][0].names[0] for key in near_spellings))
    raise UsageError(
        f"unknown name: {name[:_LONGEST_NAME]}",
        f"the nearest name is {meant}" if meant else "list all names with hdassist explain",
    )
