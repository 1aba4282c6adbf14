"""Checks and remarks of an acceptance in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.text import Text

from hdassist.acceptance.checks import CODES, Check, Explained
from hdassist.terminal.console import Style, table
from hdassist.version import __version__


def render(found: Sequence[Explained], style: Style) -> RenderableType:
    """What each tests, what goes wrong and what to change; all codes, a line each, where none is asked for."""
    if not found:
        grid = table(style, "checks and remarks: hdassist explain CODE")
        for words in ("code", "what it is", "limit in the preset"):
            grid.add_column(words, overflow="fold")
        for item in CODES.values():
            grid.add_row(
                item.code, style.text(item.words), f"acceptance.{item.field}" if isinstance(item, Check) else ""
            )
        return grid
    return Group(*(part for item in found for part in _one(item, style)))


def _one(item: Explained, style: Style) -> list[RenderableType]:
    parts: list[RenderableType] = [Text(style.text(f"{item.code}: {item.words}"), style="bold")]
    if isinstance(item, Check):
        how, unit = "greatest" if item.upper else "least", item.unit.replace("*", "·")
        parts.append(Text(style.text(f"  limit: acceptance.{item.field}, the {how} value allowed, {unit}")))
    for title, text in (("tests", item.tests), ("goes wrong", item.wrong), ("change", item.change)):
        parts += [Text(f"  {title}"), Padding(Text(style.text(text)), (0, 0, 0, 4))]
    return [*parts, Text("")]


def to_json(found: Sequence[Explained]) -> dict[str, Any]:
    """Checks and remarks as a JSON object; all of them where none is asked for."""
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
            for item in found or CODES.values()
        ],
    }
