"""A grid of characters to draw on: braille dots, texts and shades, each with a style of rich."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import ceil

from rich.style import Style
from rich.text import Text

WIDE, TALL = 2, 4  # dots of a character
DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))  # by row and column
BRAILLE = 0x2800


class Canvas:
    """So many columns and rows of characters; dots count from the upper left, WIDE and TALL to a character."""

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = max(columns, 0), max(rows, 0)
        self._bits = [[0] * self.columns for _ in range(self.rows)]
        self._inks = [[""] * self.columns for _ in range(self.rows)]
        self._texts: dict[tuple[int, int], tuple[str, str]] = {}
        self._shades: dict[tuple[int, int], str] = {}

    def dot(self, x: float, y: float, ink: str) -> None:
        """Set a dot; one outside of the grid is left out."""
        column, row = int(x) // WIDE, int(y) // TALL
        if x >= 0 <= y and column < self.columns and row < self.rows:
            self._bits[row][column] |= DOTS[int(y) % TALL][int(x) % WIDE]
            self._inks[row][column] = ink

    def line(self, x: float, y: float, to_x: float, to_y: float, ink: str, gap: int = 1) -> None:
        """Draw a straight line; gap: every so many dots one is set."""
        steps = max(1, ceil(max(abs(to_x - x), abs(to_y - y))))
        for k in range(0, steps + 1, gap):
            self.dot(round(x + (to_x - x) * k / steps), round(y + (to_y - y) * k / steps), ink)

    def path(self, points: Sequence[tuple[float, float]], ink: str, gap: int = 1) -> None:
        """Draw lines from each point to the next."""
        for (x, y), (to_x, to_y) in pairwise(points):
            self.line(x, y, to_x, to_y, ink, gap)

    def text(self, column: int, row: int, text: str, ink: str) -> None:
        """Write a text over what is drawn, moved inside where it would stick out at a side."""
        column = max(0, min(column, self.columns - len(text)))
        for k, letter in enumerate(text[: self.columns]):
            if 0 <= row < self.rows:
                self._texts[row, column + k] = (letter, ink)

    def shade(self, column: int, row: int, colour: str) -> None:
        """Give a character a background."""
        if 0 <= column < self.columns and 0 <= row < self.rows:
            self._shades[row, column] = colour

    def drawn(self) -> Text:
        """All of it, its lines one below the other."""
        picture = Text(no_wrap=True, overflow="crop")
        for row in range(self.rows):
            for column in range(self.columns):
                letter, ink = self._texts.get((row, column), ("", ""))
                if not letter:
                    bits = self._bits[row][column]
                    letter, ink = (chr(BRAILLE + bits) if bits else " "), self._inks[row][column]
                shade = self._shades.get((row, column))
                picture.append(letter, Style.parse(f"{ink} on {shade}" if shade else ink or "none"))
            if row < self.rows - 1:
                picture.append("\n")
        return picture
