"""The assembly card as plain text, 78 columns wide."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterator

from rich.text import Text

from hdassist.mounting.card import Card, Lines
from hdassist.mounting.card_tables import Table
from hdassist.mounting.seat import drawing
from hdassist.terminal.console import PLAIN, Style, console, table

COLUMNS = 78
BOX = "[ ] "
BLANK = "_" * 12
CYRILLIC = range(0x400, 0x500)


def render(card: Card, *, ascii: bool = False) -> str:
    """The card as text; ascii: with 7-bit characters only, but for Cyrillic letters."""
    parts = [
        f"{card.title}\n{'=' * COLUMNS}",
        "\n".join(_subject(card)),
        f"{'-' * COLUMNS}\n{_wrapped(card.instruction)}\n{'-' * COLUMNS}",
        textwrap.indent(drawing(card.seat, pointers=True), " " * 18),
        "\n".join(map(_wrapped, (card.seat.legend, *card.directions))),
        _table(card.torques, ascii, blank=BLANK),
        _table(card.others, ascii) if card.others.rows else "",
        _lines(card.chance),
        _lines(card.checks, BOX),
        _lines(card.warnings, "! "),
        "\n".join(f"{label}: {BLANK * 2}" for label in card.sign),
        "\n".join(map(_wrapped, card.foot)),
    ]
    page = "\n\n".join(filter(None, parts))
    page = "\n".join(line.rstrip() for line in page.splitlines()) + "\n"
    return _plain(page) if ascii else page


def _subject(card: Card) -> Iterator[str]:
    wide = max(len(label) for label, _ in card.subject) + 2
    for label, value in card.subject:
        yield _wrapped(value or BLANK * 2, f"{label}: ".ljust(wide), " " * wide)


def _lines(lines: Lines, first: str = "") -> str:
    """Title and lines; nothing where there are none."""
    return "\n".join([lines.title, *(_wrapped(t, first, " " * len(first)) for t in lines.lines)]) if lines.lines else ""


def _wrapped(text: str, first: str = "", further: str = "") -> str:
    return textwrap.fill(text, COLUMNS, initial_indent=first, subsequent_indent=further, break_on_hyphens=False)


def _table(content: Table, ascii: bool, blank: str = "-") -> str:
    style = Style(ascii=ascii, codes=False, width=COLUMNS)
    grid = table(Style(ascii=False, codes=False, width=COLUMNS), content.title)
    grid.box, grid.show_edge = table(style).box, style.ascii
    for k, words in enumerate(content.head):
        cells = " / ".join([words.replace(" ", " / "), *(row[k] for row in content.rows), blank])
        longest = max(map(len, cells.split(" / " if k else None)))  # numbers stay whole
        grid.add_column(Text(words), justify="right" if k else "left", min_width=longest)
    for row in content.rows:
        grid.add_row(*(Text(cell or blank) for cell in row))
    page = io.StringIO()
    console(page, style).print(grid)
    return page.getvalue().rstrip() + (f"\n{_wrapped(content.note)}" if content.note else "")


def _plain(text: str) -> str:
    """The text in 7-bit characters; Cyrillic letters stay."""
    return "".join(c if c.isascii() or ord(c) in CYRILLIC else "?" for c in text.translate(PLAIN))
