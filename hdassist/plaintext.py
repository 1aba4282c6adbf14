"""Texts of unknown origin: hidden characters escaped as in Python, and numbers in ASCII digits with a decimal point."""

import re
from math import nan

# Controls but for newline and tab, marks that turn the writing's direction or have no width, line and paragraph
# separators, halves of surrogate pairs, and noncharacters; all characters that XML 1.0 does not have are among them.
_HIDDEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u00ad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ufffe\uffff\ud800-\udfff\U000e0000-\U000e007f]"
)


def visible(text: str) -> str:
    """The text with hidden characters escaped (\\x1b, \\u202e); newlines, tabs and all that is seen stay."""
    return _HIDDEN.sub(lambda found: escaped(found[0]), text)


def escaped(character: str) -> str:
    """A character as Python writes it in 7 bits."""
    return character.encode("unicode_escape").decode()


def printable(json: str) -> str:
    """JSON of 7 bits with DEL escaped as well, the one control character that JSON allows as it is."""
    return json.replace("\x7f", "\\u007f")


UNSIGNED = r"(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
NUMBER = rf"[-+]?{UNSIGNED}"


def number_of(text: str) -> float:
    """Value of a number, spaces around it allowed; NaN for any other text, infinity beyond the range of floats."""
    return float(text) if re.fullmatch(NUMBER, text.strip()) else nan
