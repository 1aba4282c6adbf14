"""Numbers as files, options and trials write them: ASCII digits with a decimal point, unseparated."""

import re
from math import nan

UNSIGNED = r"(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
NUMBER = rf"[-+]?{UNSIGNED}"


def number_of(text: str) -> float:
    """Value of a number, spaces around it allowed; NaN for any other text, infinity beyond the range of floats."""
    return float(text) if re.fullmatch(NUMBER, text.strip()) else nan
