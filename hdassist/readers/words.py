"""Names of columns in files of rigs and gear checkers: contents and units, as words.toml declares them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from importlib.resources import files

from hdassist.plaintext import number_of
from hdassist.preset.units import UnitError, convert
from hdassist.preset.yamltext import near_miss

_TABLE = tomllib.loads(files("hdassist.readers").joinpath("words.toml").read_text("utf-8"))
ANGLES: dict[str, float] = _TABLE["angles"]
TORQUES: dict[str, float] = _TABLE["torques"]
TIMES: dict[str, float] = _TABLE["times"]
PITCH_KEYS: dict[str, str] = _TABLE["pitch_keys"]
_SPELLED: dict[str, str] = _TABLE["spelled"]
_ROLES: dict[str, str] = _TABLE["roles"]
FEWEST_COUNTS, MOST_BITS = 8, 48  # of an encoder, in a turn
TURN_ARCSEC = ANGLES["turn"]
COUNTS = "counts"  # whose size a name does not give
_LENGTHS: dict[str, list[str]] = _TABLE["lengths"]
_FLANKS: dict[str, str] = _TABLE["flanks"]
_MICRO = str.maketrans("µμ", "uu", "·⋅*")
_WORD = r"(?<![^\W_\d])(?:{})(?![^\W_\d])"  # between letters it is none
AMBIGUOUS = "ambiguous"


def role_in(name: str) -> str:
    """Content of a column by its name: a key of _ROLES, as error, cam, output or angle; empty for an unknown one."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()
    return next((role for role, words in _ROLES.items() if re.search(_WORD.format(words), spaced)), "")


def form_in(text: str) -> str:
    """Form of pitch deviations by a name: cumulative, single, ambiguous, or empty without one."""
    return next((each["form"] for each in _TABLE["forms"] if re.search(each["words"], text)), "")


def flank_in(text: str) -> str:
    """Flank by a name: left, right, or empty for none or both."""
    found = [flank for flank, words in _FLANKS.items() if re.search(words, text.lower())]
    return found[0] if len(found) == 1 else ""


def names_teeth(text: str) -> bool:
    """Whether a name is that of a column of tooth numbers."""
    return bool(re.match(_TABLE["tooth"]["number"], text.strip().lower()))


def unit_in(name: str, units: Iterable[str] = ANGLES) -> str:
    """The first of some units in a name, such as "angle [deg]", "error/arcsec" or "wg_angle_deg"; empty for none."""
    plain = {plain_unit(unit): unit for unit in units}
    marked = re.findall(r"\[([^\]]*)\]|\(([^)]*)\)|/\s*(\S+)\s*$", name)
    bare = re.split(r"[\s_()\[\],;/]+", name)
    bare = [word for word in bare if (len(word) > 1 or word in _SPELLED) and word != "in"]
    words = (plain.get(plain_unit(word), "") for word in (*map("".join, marked), *bare))
    return next(filter(None, words), "")


def length_in(name: str) -> str:
    """Unit of a column of deviations by its name: a length, or another unit (see micrometres); empty without one."""
    for text in re.findall(r"\[([^\]]*)\]", name):
        if not form_in(text) and not flank_in(text):
            return plain_unit(text)
    return unit_in(name, (*_LENGTHS["metric"], *_LENGTHS["inches"], *ANGLES))


def plain_unit(unit: str) -> str:
    """A unit as this module spells it."""
    low = unit.strip().translate(_MICRO).lower()
    return _SPELLED.get(low, low)


def angle_size(unit: str) -> float:
    """Size [arcsec] of a unit of angle, or of a count of an encoder by its counts in a turn, like 16384 or 22bit.

    A minus sign turns the sense of the angles round. Raises UnitError: any other text.
    """
    sense, text = (-1.0, unit.strip()[1:]) if unit.strip().startswith("-") else (1.0, unit)
    if (plain := plain_unit(text)) in ANGLES:
        return sense * ANGLES[plain]
    number = number_of(plain.removesuffix("s").removesuffix("bit").strip())
    counts = 2 ** min(number, MOST_BITS + 1) if "bit" in plain else number
    if not FEWEST_COUNTS <= counts <= 2**MOST_BITS:
        hint = near_miss(text, ANGLES) or f"one of {', '.join(ANGLES)}, or counts in a turn: 16384 or 14bit"
        raise UnitError("expected a unit of angle", hint)
    return sense * ANGLES["turn"] / counts


def micrometres(unit: str) -> float:
    """Size of a unit in micrometres. Raises UnitError: no unit of length, or one that is not metric."""
    plain = plain_unit(unit)
    if plain in _LENGTHS["inches"]:
        raise UnitError("not a metric unit", "convert to um or mm; 1 µin is 0.0254 um")
    if plain in ANGLES:
        raise UnitError("an angle, not a length", "multiply by the pitch radius: 1 arcsec at 100 mm is 0.485 um")
    return convert(f"1 {plain or '-'}", "um")
