"""Texts in the language of the reader: one file a language in languages/."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import date
from functools import cache
from importlib.resources import files

from hdassist.errors import UsageError

HOME = "en"


@dataclass(frozen=True)
class Texts:
    """The catalogue of one language: entries by key, with {fields} to fill in."""

    language: str
    entries: Mapping[str, str]

    def __call__(self, key: str, **fields: object) -> str:
        """The text of a key, its fields filled in. Raises KeyError for a key or field that is not there."""
        return self.entries[key].format(**fields)

    def variant(self, name: str) -> Texts:
        """The same with the entries "name.key" in place of those of the key."""
        words = {key.removeprefix(f"{name}."): text for key, text in self.entries.items() if key.startswith(f"{name}.")}
        return replace(self, entries={**self.entries, **words})

    def number(self, value: float, form: str = "g") -> str:
        """A number with the decimal point of the language."""
        return f"{value:{form}}".replace(".", self("number.point"))

    def angle(self, degrees: float) -> str:
        """An angle with its unit."""
        return self("unit.angle", angle=self.number(degrees))

    def torque(self, M_g: float) -> str:
        """A torque [N*m] with its unit."""
        return self("unit.torque", torque=self.number(M_g))

    def percent(self, share: float, sign: str = "") -> str:
        """A share as per cent; sign "+" shows that of gains and losses."""
        return self("unit.percent", value=self.number(100 * share, f"{sign}.0f"))

    def holes(self, count: int) -> str:
        """A number of holes, in the plural that goes with it."""
        form = next((f for f in ("one", "few") if re.search(self(f"plural.{f}"), str(count))), "many")
        return self(f"holes.{form}", count=count)

    def date(self, day: date) -> str:
        """A date as it is written."""
        return self("date.form", year=f"{day.year:04}", month=f"{day.month:02}", day=f"{day.day:02}")


def languages() -> list[str]:
    """Languages that there is a catalogue of."""
    folder = files(__package__) / "languages"
    return sorted(item.name.removesuffix(".yaml") for item in folder.iterdir() if item.name.endswith(".yaml"))


@cache
def texts(language: str = HOME) -> Texts:
    """The catalogue of a language. Raises UsageError where there is none."""
    import yaml

    if language not in languages():
        raise UsageError(f"no language {language!r}", f"available: {', '.join(languages())}")
    source = (files(__package__) / "languages" / f"{language}.yaml").read_text(encoding="utf-8")
    return Texts(language, yaml.safe_load(source))
