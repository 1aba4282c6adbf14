"""Words of the trade, symbols of the paper and kinds of errors, as words.toml declares them."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files

from hdassist.errors import Fault


@dataclass(frozen=True)
class Term:
    """A word: in Russian, its meaning, other names (symbols, keys of JSON), and the unit of a quantity."""

    word: str
    meaning: str
    russian: str = ""
    others: Sequence[str] = ()
    unit: str = ""


@dataclass(frozen=True)
class Symbols:
    """Symbols with one meaning: as the paper writes them, where the code has them (Markdown), in words, with unit."""

    paper: Sequence[str]
    code: str
    words: str
    unit: str = ""


@dataclass(frozen=True)
class FaultWords:
    """Meaning of a kind of error, and its remedy."""

    meaning: str
    change: str


_TABLE = tomllib.loads(files("hdassist.explaining").joinpath("words.toml").read_text("utf-8"))
GROUPS: Mapping[str, Sequence[Term]] = {
    group: tuple(Term(**each) for each in terms) for group, terms in _TABLE["terms"].items()
}
TERMS = tuple(term for group in GROUPS.values() for term in group)
WORDS_OF_PAGES: Mapping[tuple[str, ...], str] = {
    tuple(names.split(", ")): words for names, words in _TABLE["pages"].items()
}
SYMBOLS = tuple(Symbols(**each) for each in _TABLE["symbols"])
FAULTS = {Fault(code): FaultWords(**each) for code, each in _TABLE["faults"].items()}
