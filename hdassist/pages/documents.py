"""Reports as HTML and Markdown, assembly cards as HTML and plain text: the templates of templates/."""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from rich.console import Group
from rich.text import Text

from hdassist.pages import drawings
from hdassist.pages.card import Card
from hdassist.report import BLANK, Figure, Paragraph, Report
from hdassist.terminal.console import Style
from hdassist.terminal.output import Output
from hdassist.terminal.page import block_on_page, in_characters
from hdassist.terminal.words import proof
from hdassist.visible import visible

CARD_COLUMNS = 78  # of the card as plain text
LINES_BESIDE = 45  # of the card as text: drawing, checks and empty lines, which stand side by side on paper
CYRILLIC = range(0x400, 0x500)
UNICODE = Style(ascii=False, codes=False, width=80)


def report_html(report: Report) -> str:
    """A report as one HTML file: everything inside it, no scripts."""
    return _html("report.html", report=report, proof=proof(report.certificate, report.cross_checks))


def report_markdown(report: Report, style: Style) -> str:
    """A report as Markdown, with the tables of GitHub's dialect and figures in characters; style: of its texts."""

    def safe(value: Any) -> Any:
        return markdown_safe(value if isinstance(value, Markup) else style.text(str(value)))

    page = _environment(safe, style).get_template("report.md")
    return page.render(report=report, proof=proof(report.certificate, report.cross_checks))


def card_html(card: Card) -> str:
    """The card as one HTML file that prints on an A4 page: everything inside it, no scripts."""
    return _html("card.html", card=card, lines=lines_on_paper(card))


def card_text(card: Card, *, ascii: bool = False) -> str:
    """The card as text; ascii: with 7-bit characters only, but for Cyrillic letters."""
    style = Style(ascii, codes=False, width=CARD_COLUMNS, beyond_ascii=CYRILLIC)
    parts = [part for block in (Paragraph(card.title), *card.blocks) for part in block_on_page(block, style)]
    return Output(style).page(Group(*[line for part in parts for line in (part, Text(""))]))


def lines_on_paper(card: Card) -> int:
    """About how many lines a card has beside its drawing, rows to write in counted by their height.

    By that the style sheet chooses letters with which the card is one page.
    """
    return len(card_text(card).splitlines()) - LINES_BESIDE + len(card.torques.rows)


def _html(name: str, **parts: Any) -> str:
    page = _environment(html_safe, UNICODE, autoescape=True)
    return page.get_template(name).render(**parts)


def _environment(finalize: Callable[[Any], Any], style: Style, *, autoescape: bool = False) -> Environment:
    """Where templates are found, how what they print is made safe, and what they know of blocks.

    Lines of a tag alone leave none.
    """
    found = Environment(
        loader=PackageLoader("hdassist.pages"), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True, autoescape=autoescape, finalize=finalize,
    )  # fmt: skip
    plain = replace(style, codes=False, width=UNICODE.width)

    def drawn(figure: Figure) -> str:
        """A figure in characters; in a fenced block of Markdown only the fence is a sign."""
        text = visible(in_characters(figure, plain))
        return text if autoescape else Markup(text.replace("```", "'''"))

    found.filters.update(drawn=drawn, kind=lambda block: type(block).__name__)
    found.tests["figure"] = lambda block: isinstance(block, Figure)
    found.globals.update(vars(drawings), BLANK=BLANK)
    return found


def html_safe(value: Any) -> Any:
    """Text with hidden characters escaped (jinja2 does the rest); numbers of the drawing need no more digits."""
    if isinstance(value, float):
        return round(value, 2)
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def markdown_safe(value: Any) -> Any:
    """The text with what Markdown or HTML would take for a sign of their own behind a backslash."""
    if isinstance(value, Markup):
        return value
    return re.sub(r"([\\`*_\[\]<>|~&#])", r"\\\1", visible(str(value)).replace("\n", "\\n"))
