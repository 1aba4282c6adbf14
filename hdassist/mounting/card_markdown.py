"""The assembly card as Markdown: tables, and the seat in a block of code."""

from __future__ import annotations

import re

from hdassist.mounting.card import Card, Lines
from hdassist.mounting.card_tables import Table
from hdassist.mounting.seat import drawing

LINE = "&nbsp;" * 24  # to write on


def render(card: Card) -> str:
    """The card as Markdown, with the tables of GitHub's dialect."""
    subject = [f"| {_safe(label)} | {_safe(value) or LINE} |" for label, value in card.subject]
    directions = [f"- {_safe(text)}" for text in card.directions]
    parts = [
        f"# {_safe(card.title)}",
        "\n".join(["| | |", "| --- | --- |", *subject]),
        f"**{_safe(card.instruction)}**",
        f"```text\n{drawing(card.seat, pointers=True)}\n```",
        _safe(card.seat.legend),
        "\n".join(directions),
        _table(card.torques),
        _table(card.others) if card.others.rows else "",
        _lines(card.chance, ""),
        _lines(card.checks, "- [ ] "),
        _lines(card.warnings, "- "),
        "\n".join(["| | |", "| --- | --- |", *(f"| {_safe(label)} | {LINE} |" for label in card.sign)]),
        "\n\n".join(map(_safe, card.foot)),
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


def _lines(lines: Lines, first: str) -> str:
    between = "\n" if first else "\n\n"
    return f"## {_safe(lines.title)}\n\n{between.join(first + _safe(t) for t in lines.lines)}" if lines.lines else ""


def _table(content: Table) -> str:
    rows = [content.head, ("---", *("---:",) * (len(content.head) - 1)), *content.rows]
    text = "\n".join(f"| {' | '.join(c if k == 1 else _safe(c) for c in row)} |" for k, row in enumerate(rows))
    return f"## {_safe(content.title)}\n\n{text}" + (f"\n\n{_safe(content.note)}" if content.note else "")


def _safe(text: str) -> str:
    """The text with what Markdown or HTML would take for a sign of their own behind a backslash."""
    return re.sub(r"([\\`*_\[\]<>|~&#])", r"\\\1", text)
