"""`hdassist explain`: what a check tests, what goes wrong, and what to change."""

from __future__ import annotations

from typing import Annotated

import typer

from hdassist.terminal import options as o


@o.with_groups
def command(
    codes: Annotated[list[str], typer.Argument(metavar="[CODE]...", help="Codes of checks or remarks.")] = [],  # noqa: B006 (typer copies it)
    *,
    options: o.PageOptions,
) -> None:
    """What the checks of an acceptance test, what goes wrong, and what to change.

    \b
    Examples:
      hdassist explain
      hdassist explain F_IOR COVERAGE
      hdassist explain order --json

    Without a code: all of them, a line each.
    """
    from hdassist.acceptance import explain_page as report
    from hdassist.acceptance.checks import explained
    from hdassist.terminal.answers import json_text

    out = options.open()
    found = [explained(code) for code in codes]
    if options.json:
        out.text(json_text(report.to_json(found)))
    else:
        out.human(report.render(found, out.style))
