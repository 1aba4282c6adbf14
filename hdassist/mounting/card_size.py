"""How high a card comes out on paper, and how small its letters must be for one page."""

from __future__ import annotations

from collections.abc import Iterable
from math import ceil

from hdassist.mounting.card import Card

PAGE = 277.0  # mm of an A4 page between its margins
LINE = 4.6  # mm, at the full size of letters
DRAWING = 82.0  # mm of the seat and what stands below it
STEP = 0.02  # between the sizes of letters that are tried
LEAST = 0.3


def scale(card: Card) -> float:
    """Size of the letters on paper: 1, or the greatest below with which the card is one page."""
    size = 1.0
    while size > LEAST and size * height(card, size) > PAGE:
        size -= STEP
    return round(size, 3)


def height(card: Card, size: float = 1.0) -> float:
    """Height of the card [mm of letters of the full size], never less than what a browser makes of it.

    Arguments: card; size of its letters: smaller ones break into fewer lines.
    """

    def text(texts: Iterable[str], letters: int, between: float = 0.0) -> float:
        lines = [ceil(len(words) / letters * size) for words in texts if words or between]
        return LINE * sum(max(1, count) for count in lines) + between * len(lines)

    beside = LINE * 1.15 * len(card.directions) + 9 + text(card.checks.lines, 40, 1.8)
    tables = 16 + 7.4 * len(card.torques.rows) + text((card.torques.note,), 110)
    if card.others.rows:
        tables += 20 + text((row[0] for row in card.others.rows), 29, 1.3) + text((card.others.note,), 115)
    lists = sum(8 + text(part.lines, 96) for part in (card.chance, card.warnings) if part.lines)
    return (
        11
        + text((value for _, value in card.subject), 66, 1.4)
        + 9 + 1.2 * text((card.instruction,), 68)
        + max(DRAWING, beside)
        + tables
        + lists
        + 16 + 0.85 * text(card.foot, 118, 1.0)
    )  # fmt: skip
