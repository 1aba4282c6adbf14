"""Words with which gear checkers name what a column of pitch deviations holds."""

from __future__ import annotations

import re
from collections.abc import Callable

from hdassist.preset.units import UnitError, convert

AMBIGUOUS = "ambiguous"
_WORD = "[^\\W_]"
_CUMULATIVE = re.compile(r"c?cumul|kumul|summe|gesamt|total|накопл")
_SINGLE = re.compile(r"single|einzel|individual|tooth[ -]to[ -]tooth|adjacent|шаг")
_CUMULATIVE_SYMBOL = re.compile(rf"(?<!{_WORD})F_?pi?(?!{_WORD})")
_SINGLE_SYMBOL = re.compile(rf"(?<!{_WORD})f_?p[ti]?(?!{_WORD})")
_UNCLEAR = re.compile(rf"(?<!{_WORD})(?:F_?P[TI]?|F_?p[tk])(?!{_WORD})")
_INDEX = re.compile(rf"(?<!{_WORD})index(?!{_WORD})")
_LEFT = re.compile(rf"(?<!{_WORD})(?:left|links?|linke[rn]?|lf|l)(?!{_WORD})|(?<!{_WORD})лев")
_RIGHT = re.compile(rf"(?<!{_WORD})(?:right|rechts?|rechte[rn]?|rf|r)(?!{_WORD})|(?<!{_WORD})прав")
_TOOTH = re.compile(
    rf"(?:tooth|teeth|zahn|zähne|lücke|space|gap|number|nummer|номер|зуб|впадина)|(?:no|nr|k|i|n|z|№)\.?(?!{_WORD})|#$"
)
_SPELLED = {"мкм": "um", "мм": "mm", "нм": "nm", "micron": "um", "microns": "um", "micrometer": "um", "mkm": "um"}
_SPELLED |= {"micrometre": "um", "micrometres": "um", "micrometers": "um", "millimeter": "mm", "millimetre": "mm"}
_MICRO = str.maketrans("µμ", "uu")
_LENGTHS = ("um", "mm", "nm", "cm")
_INCHES = ("in", "inch", "inches", "uin", "uinch", "mil", "mils", "thou", '"')
_ANGLES = ("arcsec", "arcmin", "deg", "°", "rad", "mrad", "urad", "sec", "'", "''")


def form_in(text: str) -> str:
    """Form that a text names: cumulative, single, ambiguous, or empty for none.

    F_p is cumulative and f_p single, so capitals count. The bare word index is ambiguous: ANSI/AGMA calls
    the cumulative deviation of a tooth its index deviation.
    """
    low = text.lower()
    if _CUMULATIVE.search(low):
        return "cumulative"
    if _SINGLE.search(low):
        return "single"
    if _CUMULATIVE_SYMBOL.search(text):
        return "cumulative"
    if _SINGLE_SYMBOL.search(text):
        return "single"
    return AMBIGUOUS if _UNCLEAR.search(text) or _INDEX.search(low) else ""


def flank_in(text: str) -> str:
    """Flank that a text names: left, right, or empty for none or both."""
    low = text.lower()
    left, right = bool(_LEFT.search(low)), bool(_RIGHT.search(low))
    return "" if left == right else "left" if left else "right"


def names_teeth(text: str) -> bool:
    """Whether a name is that of a column of tooth numbers."""
    return bool(_TOOTH.match(text.strip().lower()))


def unit_in(name: str) -> str:
    """Unit in the name of a column, such as "deviation [µm]", "Abweichung/µm" or "dev_mm"; empty for none."""
    for text in re.findall(r"\[([^\]]*)\]", name):
        if not form_in(text) and not flank_in(text):
            return str(text).strip()
    foreign = {*_INCHES, *_ANGLES}
    for text in re.findall(r"\(([^)]*)\)|/\s*(\S+)\s*$", name):
        inner = "".join(text).strip()
        if _plain(inner) in (*_LENGTHS, *foreign):
            return inner
    foreign -= {"in", "sec", '"', "'", "''"}  # may be words and marks of a name
    words = (word for word in re.split(r"[\s()/,;_]+", name) if _plain(word) in (*_LENGTHS, *foreign))
    return next(words, "")


def _plain(unit: str) -> str:
    unit = unit.strip().translate(_MICRO)
    return _SPELLED.get(unit.lower(), unit)


def micrometres(unit: str) -> float:
    """How many micrometres one of a unit is.

    Raises UnitError: no unit of length, or one that is not metric.
    """
    plain = _plain(unit)
    if plain.lower() in _INCHES:
        raise UnitError("not a metric unit", "convert to um or mm; 1 µin is 0.0254 um")
    if plain in _ANGLES:
        raise UnitError("an angle, not a length", "multiply by the pitch radius: 1 arcsec at 100 mm is 0.485 um")
    if plain.lower() in _LENGTHS:
        plain = plain.lower()
    return convert(f"1 {plain or '-'}", "um")


def sense_in(text: str) -> str:
    """Sense of rotation that a text names, ccw or cw; empty for none."""
    words = re.sub(r"[\s-]+", "", text.lower())
    if words in ("ccw", "counterclockwise", "anticlockwise"):
        return "ccw"
    return "cw" if words in ("cw", "clockwise") else ""


def _sign(text: str) -> str:
    return "along" if text.lower() == "along" else sense_in(text)


def _mark(text: str) -> str:
    return str(int(text)) if re.fullmatch(r"[+]?[0-9]{1,9}", text) else ""


def _form(text: str) -> str:
    low = text.lower()
    found = "single" if low in ("index", "single") else form_in(text)
    return "" if found == AMBIGUOUS else found


def _unit(text: str) -> str:
    return text


# Keys that a file may state: what they are written as, how their value is read, what it may be.
KEYS: dict[str, tuple[tuple[str, ...], Callable[[str], str], str]] = {
    "form": (("form", "форма"), _form, "cumulative or single"),
    "unit": (("unit", "units", "einheit", "единица", "единицы"), _unit, "um or mm"),
    "sense": (("sense", "drehsinn", "направление"), sense_in, "ccw or cw, seen from the cam side"),
    "sign": (("sign", "vorzeichen", "знак"), _sign, "along (the numbering), ccw or cw"),
    "mark": (("mark", "markierung", "метка"), _mark, "the number of a tooth"),
    "flank": (("flank", "flanke", "профиль"), flank_in, "left or right"),
}
