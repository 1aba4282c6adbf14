"""The assembly card as HTML that prints on one A4 page, as Markdown, or as plain text: the templates of templates/."""

from __future__ import annotations

import io
import re
import textwrap
from collections.abc import Callable
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from hdassist.pages.card import Card
from hdassist.pages.card_svg import seat_geometry
from hdassist.report.blocks import Table
from hdassist.terminal.console import PLAIN_CHARACTERS, Style, console
from hdassist.terminal.page import tables
from hdassist.terminal.seat import seat_in_characters
from hdassist.visible import visible

CARD_COLUMNS = 78  # of the card as plain text
BLANK = "_" * 12  # to write on
MARKDOWN_LINE = Markup("&nbsp;" * 24)  # the same in Markdown
CYRILLIC = range(0x400, 0x500)


def html(card: Card) -> str:
    """The card as one HTML file: everything inside it, no scripts."""
    page = environment(autoescape=True, finalize=html_safe).get_template("card.html")
    return page.render(card=card, lines=lines_on_paper(card), seat=card.seat, **seat_geometry(card.seat))


def markdown(card: Card) -> str:
    """The card as Markdown, with the tables of GitHub's dialect."""
    page = environment(finalize=markdown_safe).get_template("card.md")
    return page.render(card=card, drawing=Markup(seat_in_characters(card.seat)), line=MARKDOWN_LINE)


def plain_text(card: Card, *, ascii: bool = False) -> str:
    """The card as text; ascii: with 7-bit characters only, but for Cyrillic letters."""
    plain = _seven_bits if ascii else str
    page = environment(
        finalize=_visible,
        wrapped=lambda text, first="", further="": _wrapped(plain(text), first, further),
        drawn=lambda content, blank: _drawn(content, blank, plain),
    )
    label_width = max(len(label) for label, _ in card.subject) + 2
    text = page.get_template("card.txt").render(
        card=card, drawing=seat_in_characters(card.seat), columns=CARD_COLUMNS, blank=BLANK, label_width=label_width
    )
    text = "\n".join(line.rstrip() for line in text.splitlines()) + "\n"
    return _seven_bits(text) if ascii else text


def lines_on_paper(card: Card) -> int:
    """About how many lines a card has beside its drawing, headings and rows counted by their height.

    By that the style sheet chooses letters with which the card is one page.
    """
    values = [value for _, value in card.subject]
    texts = [*values, card.instruction, *card.foot]
    parts = (card.chance, card.warnings)
    texts += [text for part in parts for text in part.lines]
    headings = sum(3 for part in parts if part.lines)
    rows = 2 * len(card.torques.rows) + sum(1 + len(row[0]) // 16 for row in card.others.rows)
    return sum(1 + len(text) // 90 for text in texts) + headings + rows


def environment(
    *,
    autoescape: bool = False,
    finalize: Callable[[Any], Any] | None = None,
    **filters: Callable[..., str],
) -> Environment:
    """Where templates are found, and how what they print is made safe; lines with nothing but a tag leave none.

    Arguments: finalize, through which each value goes; filters.
    """
    found = Environment(
        loader=PackageLoader("hdassist.pages"), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True, autoescape=autoescape, finalize=finalize,
    )  # fmt: skip
    found.filters.update(filters)
    return found


def _visible(value: Any) -> Any:
    """Text with hidden characters escaped; what templates made stays."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def html_safe(value: Any) -> Any:
    """Text with hidden characters escaped (jinja2 does the rest); numbers of the drawing need no more digits."""
    return round(value, 2) if isinstance(value, float) else _visible(value)


def markdown_safe(value: Any) -> Any:
    """The text with what Markdown or HTML would take for a sign of their own behind a backslash."""
    if isinstance(value, Markup):
        return value
    return re.sub(r"([\\`*_\[\]<>|~&#])", r"\\\1", visible(str(value)).replace("\n", "\\n"))


def _wrapped(text: str, first: str = "", further: str = "") -> str:
    return textwrap.fill(
        visible(text), CARD_COLUMNS, initial_indent=first, subsequent_indent=further, break_on_hyphens=False
    )


def _drawn(content: Table, blank: str, plain: Callable[[str], str]) -> str:
    """A table in characters; blank stands in its empty cells; plain, what makes a text one that can be shown."""
    style, page = Style(ascii=False, codes=False, width=CARD_COLUMNS), io.StringIO()
    rows = tuple(tuple(plain(cell or blank) for cell in row) for row in content.rows)
    heads, notes = tuple(map(plain, content.heads)), tuple(map(plain, content.notes))
    console(page, style).print(*tables(Table(plain(content.title), heads, rows, notes=notes), style))
    return page.getvalue().rstrip()


def _seven_bits(text: str) -> str:
    """The text in 7-bit characters; Cyrillic letters stay."""
    return "".join(
        c if c.isascii() or ord(c) in CYRILLIC else "?" for c in text.replace(" ″", "″").translate(PLAIN_CHARACTERS)
    )
