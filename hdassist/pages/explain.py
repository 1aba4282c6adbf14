"""What names stand for, in words and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.acceptance.checks import CODES, Check
from hdassist.explaining.lookup import Entry, entries
from hdassist.terminal.brief import facts
from hdassist.terminal.console import Style
from hdassist.version import __version__


def explain_page(found: Sequence[Entry], style: Style) -> RenderableType:
    """What each is; the names of all there is, by kind, where none is asked for."""
    if not found:
        codes = [(item.code, item.words) for item in CODES.values()]
        parts: list[RenderableType] = [Text("checks and remarks", style="bold"), facts(style, codes), Text("")]
        for title, kind in (("errors", "error"), ("quantities and words", "quantity or word"), ("symbols", "symbol")):
            named = ", ".join(entry.names[0] for entry in entries() if entry.kind == kind)
            parts += [Text(title, style="bold"), Text(style.text(named)), Text("")]
        named = ", ".join(entry.names[0] for entry in entries() if entry.kind == "section")
        parts += [Text("fields of a preset, by section or name", style="bold"), Text(style.text(named)), Text("")]
        return Group(*parts, Text(style.text("hdassist explain NAME: any of these, English or Russian")))
    return Group(*(part for item in found for part in _one(item, style)))


def _one(item: Entry, style: Style) -> list[RenderableType]:
    head = f"{item.names[0]}: {item.words}"
    return [Text(style.text(head), style="bold"), facts(style, (("is a", item.kind), *item.facts)), Text("")]


def explain_json(found: Sequence[Entry]) -> dict[str, Any]:
    """Checks and remarks, and all other names, as a JSON object; all of them where none is asked for."""
    shown = found or entries()
    named = [CODES[entry.names[0]] for entry in shown if entry.kind in ("check", "remark")]
    return {
        "schema": "hdassist.explain/1",
        "version": __version__,
        "exit_code": 0,
        "warnings": [],
        "codes": [
            {
                "code": item.code,
                "kind": "check" if isinstance(item, Check) else "remark",
                "words": item.words,
                "limit": f"acceptance.{item.field}" if isinstance(item, Check) else None,
                "unit": item.unit if isinstance(item, Check) else None,
                "tests": item.tests,
                "goes_wrong": item.wrong,
                "change": item.change,
            }
            for item in named
        ],
        "names": [
            {"name": entry.names[0], "kind": entry.kind, "words": entry.words, "facts": dict(entry.facts)}
            for entry in shown
            if entry.kind not in ("check", "remark")
        ],
    }
