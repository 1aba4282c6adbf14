"""The explorer's screen in 7-bit characters: each character that is not one becomes one as wide."""

from __future__ import annotations

from rich.cells import cell_len
from rich.segment import Segment
from textual.color import Color
from textual.filter import LineFilter

from hdassist.explorer.canvas import BRAILLE, DOTS
from hdassist.terminal.console import PLAIN

SIGNS = str.maketrans("○◎●◌◆…°″±←→↑↓─━┄╌│█▀", "o0@%#~d\"~<>^v----|#'")
BOXES = range(0x2500, 0x2580)  # lines, corners of frames
UPPER = sum(bit for row in DOTS[:2] for bit in row)


class SevenBits(LineFilter):
    """Every line of the screen as a terminal without Unicode can show it."""

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        """The same segments, as wide as before."""
        del background
        return [Segment(seven_bits(text), style, control) for text, style, control in segments]


def seven_bits(text: str) -> str:
    """A text in ASCII that takes as many columns."""
    return text if text.isascii() else "".join(map(_letter, text.translate(SIGNS)))


def _letter(letter: str) -> str:
    """One character: frames as + (lines as they are), dots by the half of a row they lie in, others as ?."""
    code, plain = ord(letter), letter.translate(PLAIN)
    if plain.isascii() and len(plain) == 1:
        return plain
    if code in BOXES:
        return "+"
    if BRAILLE < code < BRAILLE + 0x100:
        bits = code - BRAILLE
        return ":" if bits & UPPER and bits & ~UPPER else "'" if bits & UPPER else "."
    if 0x2580 <= code < 0x25A0:
        return "_"
    return "?" * cell_len(letter)
