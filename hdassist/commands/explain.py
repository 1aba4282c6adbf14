"""`hdassist explain`: the meaning of names."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.terminal import options as o


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
        from hdassist.explaining.lookup import explained
        from hdassist.pages.explain import explain_report

        options = {field: words["help"] for table in o.DECLARED.values() for field, words in table.items()}
        found = list(dict.fromkeys(entry for name in self.names for entry in explained(name, options)))
        return explain_report(found)
