"""The reference of commands and of preset fields, as pages of docs/."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import typer

from hdassist.drive.preset.fields import (
    BY_PATH,
    sections,
)
from hdassist.interface.cli import app
from hdassist.interface.explaining import GROUPS, SYMBOLS

ROOT: Any = typer.main.get_command(app)
WIDTH = 68  # of help texts: what man has room for on a terminal of 80 columns
DOCS = Path(__file__).parents[2] / "docs"
MADE = "<!-- made by `python -m tests.reference` from the declarations of the code; CI fails when the two differ -->"


@cache
def made() -> dict[Path, str]:
    """Each page by its path."""
    pages = {"commands.md": commands(), "fields.md": fields(), "glossary.md": glossary()}
    return {DOCS / name: "\n".join(lines) + "\n" for name, lines in pages.items()}


def commands() -> Iterator[str]:
    """Lines of the reference of commands, in the order and groups in which `hdassist` lists them."""
    yield from ("# Commands", "", MADE, "", "```text", _help(), "```")
    for name in ROOT.commands:
        yield from _command(name)
        for inner in getattr(ROOT.get_command(None, name), "commands", {}):
            yield from _command(name, inner)


def _command(*names: str) -> Iterator[str]:
    yield from ("", f"{'#' * (len(names) + 1)} hdassist {' '.join(names)}", "", "```text", _help(*names), "```")


def _help(*names: str) -> str:
    """What --help says."""
    command, settings = ROOT, ROOT.context_settings | {"terminal_width": WIDTH}
    context = command.context_class(command, info_name="hdassist", **settings)
    for name in names:
        command = command.get_command(context, name)
        context = command.context_class(command, context, name, **settings)
    return str(command.get_help(context)).rstrip()


def fields() -> Iterator[str]:
    """Lines of the reference of preset fields, in the order in which presets have them."""
    yield from ("# Fields of a preset", "", MADE, "")
    yield "A number without a unit is in the unit of its field. `75 um` and `0.8 mm` are converted. `260 ± 10` states"
    yield "an uncertainty (k = 2). A field without a default is required. An omitted deviation is `unknown`"
    yield "([unknown inputs](unknown.md)). `uncertainty` contains the ± of fields by their path, and `fit` the"
    yield "values fitted together ([design](design.md#values-fitted-together))."
    for name, model in (*sections(), *BY_PATH.items()):
        head = f"`{name}`, by the path of a field" if name in BY_PATH else f"`{name}`"
        yield from ("", f"## {head}", "", str(model.__doc__), "")
        yield from ("| key | meaning | unit | range | default |", "| --- | --- | --- | --- | --- |")
        for key, field in model.declared().items():
            span = ", ".join(field.choices) if field.kind == "choice" else field.range_words()
            default = "unknown" if field.unknown else "" if field.is_required else _default(field.default)
            if field.is_optional and not default:
                default = "none"
            yield f"| `{key}` | {field.meaning} | {field.unit} | {span} | {default} |"


def glossary() -> Iterator[str]:
    """Lines of the glossary: words of the trade, then symbols."""
    yield from ("# Glossary", "", MADE, "")
    yield "This page defines the terms and symbols that hdassist uses. `hdassist explain WORD` shows the definition of"
    yield "an English or Russian term, or of a symbol, in the terminal."
    for name, group in GROUPS.items():
        yield from ("", f"## {name}", "", "| English | Russian | meaning | unit |", "| --- | --- | --- | --- |")
        for term in group:
            yield f"| {term.word} | {term.russian} | {term.meaning} | {term.unit} |".replace("|  |", "| |")
    yield from ("", "## Symbols", "", *symbol_table())


def symbol_table() -> Iterator[str]:
    """Symbols of the paper and of the docs as lines of a Markdown table."""
    yield "| paper | code | meaning | unit |"
    yield "| --- | --- | --- | --- |"
    for each in SYMBOLS:
        yield f"| {', '.join(each.paper)} | {each.code} | {each.words} | {each.unit} |".replace("|  |", "| |")


def _default(value: object) -> str:
    if value is None or value == {} or value == ():
        return "none"
    return f"{value:g}" if isinstance(value, float) else str(value)
