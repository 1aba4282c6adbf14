"""What is wrong with a preset, collected with the place of each thing."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from hdassist.errors import Finding
from hdassist.preset.yamltext import Document, Mark, Path, path_text, shown

MAX_FINDINGS = 100
OVERRIDE = "--set"  # stands for the file in findings on overrides


class Findings:
    """Findings on one document, and the paths whose values are not to be used."""

    def __init__(self, document: Document, file: str) -> None:
        self.file = file
        self.places = document.places
        self.items = list(document.findings)
        self.bad: set[Path] = set()

    def add(self, path: Path, message: str, hint: str = "", got: str | None = None, key: bool = False) -> None:
        """Note what is wrong with a value (or, on demand, with a key) and mark the path as bad.

        Without `got` the finding says how the value is written.
        """
        self.bad.add(path)
        file, mark = self.where(path, key)
        self.items.append(
            Finding(file, *mark, path_text(path), message, self.written(path) if got is None else got, hint)
        )

    def where(self, path: Path, key: bool = False) -> tuple[str, Mark]:
        """File and place of a value or key; of the nearest table around it where it is not given."""
        while path and path not in self.places:
            path, key = path[:-1], True
        if not path:
            return self.file, Mark(1, 1)
        place = self.places[path]
        return place.file, place.key if key else place.value

    def written(self, path: Path) -> str:
        """Value of a path as it is written; empty if it is not given."""
        place = self.places.get(path)
        if place is None:
            return ""
        text = shown(place.text)
        return f'"{text}"' if place.quoted else text or "nothing"

    def is_bad(self, path: Path) -> bool:
        """Whether a path, or a table around it, has a finding."""
        return any(path[:n] in self.bad for n in range(1, len(path) + 1))

    def sorted(self) -> list[Finding]:
        """Every finding in order; the first hundred of very many."""
        return in_order(self.items)


def in_order(items: Iterable[Finding]) -> list[Finding]:
    """Findings in the order of the file, then of the overrides; the first hundred of very many."""
    ordered = sorted(items, key=lambda f: (f.file == OVERRIDE, f.line, f.column))
    if len(ordered) > MAX_FINDINGS:
        last, more = ordered[MAX_FINDINGS], len(ordered) - MAX_FINDINGS
        ordered[MAX_FINDINGS:] = [Finding(last.file, last.line, last.column, "", f"and {more} more")]
    return ordered


def near(word: str, options: Iterable[str]) -> str:
    """A hint "did you mean ...?" if an option looks like the word, else an empty text."""
    known = {option.lower(): option for option in options}
    close = difflib.get_close_matches(word[:60].lower(), known, 1, 0.6)
    return f"did you mean {known[close[0]]}?" if close else ""
