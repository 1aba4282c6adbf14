"""`hdassist explain`: what a name stands for."""

from __future__ import annotations

from typing import Annotated

import typer

from hdassist.terminal import completion
from hdassist.terminal import options as o


@o.with_groups
def explain_command(
    names: Annotated[
        list[str],
        typer.Argument(
            metavar="[NAME]...",
            help="Codes of checks and errors, fields, symbols, quantities, words.",
            autocompletion=completion.completed_names,
        ),
    ] = [],  # noqa: B006 (typer copies it)
    *,
    options: o.PageOptions,
) -> None:
    """What a check, an error, a field, a symbol, a quantity or a word of the trade is, and what to change.

    \b
    Examples:
      hdassist explain
      hdassist explain F_IOR COVERAGE
      hdassist explain cam.W_0 phi_g "one-wave share"
      hdassist explain "гибкое колесо" --json

    Without a name: all that there is.
    """
    from hdassist.explaining.lookup import explained
    from hdassist.pages.explain import explain_report
    from hdassist.terminal.runs import give_report

    out = options.open()
    found = list(dict.fromkeys(entry for name in names for entry in explained(name)))
    give_report(explain_report(found), out, json=options.json)
