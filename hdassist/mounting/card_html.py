"""The assembly card as one HTML file that prints on one A4 page."""

from __future__ import annotations

from html import escape
from importlib.resources import files

from hdassist.mounting.card import Card, Lines
from hdassist.mounting.card_size import scale
from hdassist.mounting.card_svg import seat_svg
from hdassist.mounting.card_tables import Table

NARROW = "&nbsp;&rarr;&nbsp;"  # an arrow that no line breaks at


def render(card: Card) -> str:
    """The card as HTML: everything inside the file, no scripts."""
    style = (files(__package__) / "card.css").read_text(encoding="utf-8")
    directions = "".join(f"<li>{escape(text)}</li>" for text in card.directions)
    body = [
        f"<h1>{escape(card.title)}</h1>",
        _subject(card),
        f'<p class="do">{escape(card.instruction).replace(" -&gt; ", NARROW)}</p>',
        f'<div class="two"><figure>{seat_svg(card.seat)}<figcaption>{escape(card.seat.title)}</figcaption></figure>',
        f'<div><ul class="directions">{directions}</ul>{_lines(card.checks, "checks")}</div></div>',
        _table(card.torques, "torques"),
        _table(card.others, "others") if card.others.rows else "",
        _lines(card.chance, "chance"),
        _lines(card.warnings, "warnings"),
        '<div class="sign">' + "".join(f"<span>{escape(label)}</span>" for label in card.sign) + "</div>",
        "<footer>" + "".join(f"<p>{escape(text)}</p>" for text in card.foot) + "</footer>",
    ]
    return (
        f'<!DOCTYPE html>\n<html lang="{escape(card.language)}">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(card.title)}: {escape(card.subject[0][1])}</title>\n<style>\n{style}</style>\n</head>\n"
        f'<body style="--scale: {scale(card):g}">\n' + "\n".join(filter(None, body)) + "\n</body>\n</html>\n"
    )


def _subject(card: Card) -> str:
    rows = "".join(f"<tr><th>{escape(label)}</th><td>{escape(value)}</td></tr>" for label, value in card.subject)
    return f'<table class="subject">{rows}</table>'


def _lines(lines: Lines, kind: str) -> str:
    items = "".join(f"<li>{escape(text)}</li>" for text in lines.lines)
    return f'<section class="{kind}"><h2>{escape(lines.title)}</h2><ul>{items}</ul></section>' if items else ""


def _table(content: Table, kind: str) -> str:
    head = "".join(f"<th>{escape(words)}</th>" for words in content.head)
    rows = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in content.rows)
    note = f'<p class="note">{escape(content.note)}</p>' if content.note else ""
    return (
        f'<section class="{kind}"><h2>{escape(content.title)}</h2><div class="wide"><table>'
        f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>{note}</section>"
    )
