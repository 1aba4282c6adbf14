"""How high a card comes out on paper, and how small its letters must be for one page."""

from __future__ import annotations

from collections.abc import Iterable
from math import ceil

from hdassist.report.card import Card

PAGE = 300.0  # mm; the estimate is 1.16 to 1.28 times what a browser makes of it, a page has 277
LINE = 4.6  # mm, at the full size of letters
DRAWING = 84.0  # mm of the seat and what stands below it


def scale(card: Card) -> float:
    """Size of the letters on paper, 1 where there is room for all; smaller letters only shorten the estimate."""
    return round(min(1.0, PAGE / _height(card)), 3)


def _height(card: Card) -> float:
    """Height of the card [mm] with letters of the full size, each part with the letters that fit in its line."""
    beside = LINE * 1.15 * len(card.directions) + 9 + _text(card.checks.lines, 36, 1.8)
    tables = 18 + 7.6 * len(card.torques.rows) + _text((card.torques.note,), 110)
    if card.others.rows:
        tables += 23 + _text((row[0] for row in card.others.rows), 25, 1.4) + _text((card.others.note,), 100)
    lists = sum(9 + _text(part.lines, 85) for part in (card.chance, card.warnings) if part.lines)
    return (
        13
        + _text((value for _, value in card.subject), 58, 1.5)
        + 10 + 1.2 * _text((card.instruction,), 56)
        + max(DRAWING, beside)
        + tables
        + lists
        + 20 + _text(card.foot, 105, 1.0)
    )  # fmt: skip


def _text(texts: Iterable[str], letters: int, between: float = 0.0) -> float:
    """Height of texts that break after so many letters, with so much between them [mm]."""
    return sum(LINE * ceil(len(text) / letters) + between for text in texts if text or between)
