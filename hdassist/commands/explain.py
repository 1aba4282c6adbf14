"""`hdassist explain`: the meaning of names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.explaining.lookup import Entry


@dataclass(frozen=True, kw_only=True)
class ExplainCommand(o.PageOptions):
    """Meaning of a check, an error, a field, a symbol, a word of the trade or an option, and the remedy.

    \b
    Examples:
      hdassist explain
      hdassist explain F_IOR COVERAGE
      hdassist explain cam.W_0 phi_g "one-wave share"
      hdassist explain "гибкое колесо" robust --json

    Without a name: all that there is.
    """

    names: list[str]

    def report(self, _out: o.Output, _preset: str) -> o.Report:
        """The names, explained."""
        from hdassist.pages.explain import explain_report

        found = list(dict.fromkeys(entry for name in self.names for entry in _entries(name)))
        return explain_report(found)


def _entries(name: str) -> list[Entry]:
    """Entries of a name; the options of a name that is none. Raises UsageError: an unknown name."""
    from hdassist.errors import UsageError
    from hdassist.explaining.lookup import Entry, explained, normal_spelling

    try:
        return explained(name)
    except UsageError:
        every = ((field, words) for table in o.DECLARED.values() for field, words in table.items())
        found = [
            Entry("option", (o.option_name(field),), words["help"].rstrip("."))
            for field, words in every
            if normal_spelling(field) == normal_spelling(name) and not words.get("is_argument")
        ]
        if not found:
            raise
        return found
