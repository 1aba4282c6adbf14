"""Words with which rigs name the columns of a trace: what a column holds, and in which unit."""

from __future__ import annotations

import re
from math import pi

from hdassist.preset.yamltext import near

UNITS = {  # size in arcsec
    "deg": 3600.0, "rad": 648000 / pi, "arcsec": 1.0, "arcmin": 60.0, "mdeg": 3.6, "mrad": 648 / pi,
    "urad": 0.648 / pi, "turn": 1296000.0,
}  # fmt: skip
_SPELLED = {
    "°": "deg", "degree": "deg", "degrees": "deg", "degs": "deg", "град": "deg", "radian": "rad", "radians": "rad",
    "рад": "rad", "arcsecond": "arcsec", "arcseconds": "arcsec", "arcs": "arcsec", "asec": "arcsec", "″": "arcsec",
    '"': "arcsec", "arcminute": "arcmin", "arcminutes": "arcmin", "amin": "arcmin", "′": "arcmin",
    "millidegree": "mdeg", "microrad": "urad", "turns": "turn", "rev": "turn", "revs": "turn",
}  # fmt: skip
_MICRO = str.maketrans("µμ", "uu")
_ROLES = (
    ("error", r"err|error|te|dev|deviation|fehler|abweichung|fkpp|kpp|погрешность|ошибка"),
    ("cam", r"cam|wg|wave|generator|input|motor|mot|antrieb|eingang|phih|phi_h|thetah|вход|генератор|кулачок"),
    ("output", r"output|out|load|abtrieb|ausgang|link|phig|phi_g|phib|phi_b|выход"),
    ("angle", r"angle|ang|phi|theta|position|pos|winkel|угол|encoder|enc"),
)
_WORD = {role: re.compile(rf"(?<![^\W_\d])(?:{words})(?![^\W_\d])") for role, words in _ROLES}


def role_in(name: str) -> str:
    """What a column holds by its name: error, cam, output, angle, or empty for anything else."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()
    return next((role for role, words in _WORD.items() if words.search(spaced)), "")


def unit_in(name: str) -> str:
    """Unit in the name of a column, such as "angle [deg]", "error/arcsec" or "wg_angle_deg"; empty for none."""
    found = ""
    for word in re.split(r"[\s_()\[\],;/]+", name.strip()):
        found = plain_unit(word) if len(word) > 1 or word in _SPELLED else ""
        if found in UNITS:
            return found
    return ""


def plain_unit(unit: str) -> str:
    """A unit as this module spells it."""
    low = unit.translate(_MICRO).lower()
    return _SPELLED.get(low, low)


def unit_fault(unit: str) -> str:
    """What is wrong with a unit that is asked for; empty if nothing is."""
    if plain_unit(unit) in UNITS:
        return ""
    return near(unit, UNITS) or f"one of {', '.join(UNITS)}"
