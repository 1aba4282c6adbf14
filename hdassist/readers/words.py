"""Notation of tables of instruments and spreadsheets: cells, numbers, and the names, roles and units of columns.

Semicolons, tabs, commas or blanks separate cells. Lines that begin with #, // or % are comments. words.toml declares
the known names and units.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import chain, pairwise
from math import isnan
from typing import NamedTuple

from hdassist.drive.preset.text import UnitError, convert, near_miss
from hdassist.run.files import NUMBER, number_of, package_table

_TABLE = package_table("readers/words.toml")
ANGLES: dict[str, float] = _TABLE["angles"]
TORQUES: dict[str, float] = _TABLE["torques"]
TIMES: dict[str, float] = _TABLE["times"]
PITCH_KEYS: dict[str, str] = _TABLE["pitch_keys"]
_SPELLED: dict[str, str] = _TABLE["spelled"]
_ROLES: dict[str, str] = _TABLE["roles"]
_FEWEST_COUNTS = 8  # smallest number of counts of an encoder per revolution
_MOST_BITS = 48  # largest number of bits of an encoder per revolution
TURN_ARCSEC = ANGLES["turn"]
COUNTS = "counts"  # unit of counts whose size is not stated in the name
_LENGTHS: dict[str, list[str]] = _TABLE["lengths"]
_FLANKS: dict[str, str] = _TABLE["flanks"]
DEFINITIONS: dict[str, str] = _TABLE["definitions"]
_FOREIGN: dict[str, list[str]] = _TABLE["foreign"]
_LETTERS: dict[str, list[str]] = _TABLE["letters"]
_RUNS: dict[str, str] = _TABLE["runs"]
_EPICS_ROLES: dict[str, str] = _TABLE["epics_fields"]["roles"]
_EPICS_COUNTS: list[str] = _TABLE["epics_fields"]["counts"]
_EPICS_FIELD = re.compile(rf"[\w:{{}}-]+\.({'|'.join(_EPICS_ROLES)})(?![^\W_])")
_MOTEUS: dict[str, str] = _TABLE["moteus"]
_FEWEST_REGISTERS = 2  # minimum number of registers of moteus that identify a table without telemetry
_NO_UNIT = re.compile(_TABLE["no_units"]["words"], re.IGNORECASE)
_GERMAN = re.compile(_TABLE["no_units"]["german"], re.IGNORECASE)
_JOINED = [
    (re.compile(rf"(?<![^\W\d_])(?:{entry['words']})", re.IGNORECASE), entry["unit"]) for entry in _TABLE["joined"]
]
_SPELLINGS = sorted(
    {*ANGLES, *TORQUES, *TIMES, *_SPELLED, "nm"},
    key=len,
    reverse=True,
)
_UNIT = rf"(?<![^\W\d_])(?:{'|'.join(map(re.escape, _SPELLINGS))})(?![^\W\d_⁰¹²³⁴⁵⁶⁷⁸⁹])"
_POWER = r"(?:(?:\^|\*\*)\s*[-+−]?\d+|[⁻⁺]?[⁰¹²³⁴⁵⁶⁷⁸⁹]+)"
_FACTOR = rf"\d+(?:[.,]\d+)?(?:e[-+−]?\d+)?(?:\s*[×x*·]\s*10)?{_POWER}?"
_SCALED_IN_BRACKETS = re.compile(  # text in brackets that is a unit with a factor or power, or a quotient of units
    rf"[×x*·]?\s*(?!1\s){_FACTOR}\s*[×x*·]?\s*{_UNIT}|{_UNIT}\s*(?:{_POWER}|(?:[/×*·x]|per\s).*)|[^\s,;]+\s*(?:/|per\s)\s*{_UNIT}",
    re.IGNORECASE,
)
_SCALED = re.compile(  # the same without brackets, where a number without an operator is that of a channel or a sweep
    rf"(?:[×*·/]|(?<![^\W\d_])x)\s*{_FACTOR}[\s_\[(]*{_UNIT}"
    rf"|\d(?:e[-+−]?\d+|{_POWER})[\s_×x*·\[(]*{_UNIT}"
    rf"|{_UNIT}[\])]?[\s_]*(?:[/×*·]\s*\d|x[\s_]?\d|e[-−]\d|{_POWER}|per[\s_]+\w|/\s*{_UNIT})",
    re.IGNORECASE,
)
_IN_BRACKETS = re.compile(r"\[([^\]]*)\]|\(([^)]*)\)|/\s*(\S+)\s*$")
_AMBIGUOUS_DEGREE = "grad"  # a degree in German, 1/400 of a revolution elsewhere
_LONGEST_UNIT = 14  # maximum number of characters of a unit in brackets
_LEAST_BARE = 2  # minimum number of characters of a unit without brackets
_MICRO = str.maketrans("µμ", "uu", "·⋅*")
_WORD = r"(?<![^\W_\d])(?:{})(?![^\W_\d])"  # whole words only, without adjacent letters
AMBIGUOUS = "ambiguous"
_QUOTED = r'"(?:[^"]|"")*"'
_LIKE = r"[-+]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eE][-+]?[0-9]+)?"
_LIKE_A_NUMBER = re.compile(_LIKE)
_MEANT = re.compile(r"[-+−.,]*[0-9]")
_NOT_FINITE = re.compile(r"[-+]?\.?(?:nan|inf|infinity)|[-+]?1\.#\w+", re.IGNORECASE)
_THOUSANDS = re.compile(r"[-+]?[0-9]+(?:[.,' ][0-9]+)*[.,][0-9]*")
_REMARK = re.compile(r'[\s"]*(?:#|//|%)[#/%]*\s*')
_ENTRY = re.compile(r"([^\W\d][^:=]{0,39}?)\s*[:=](?!\s*//)\s*(.*)")
_CELLS = {mark: re.compile(rf" *({_QUOTED}(?= *(?:{mark}|$))|[^{mark}]*)") for mark in ";\t,"}
_CELLS[" "] = re.compile(rf"({_QUOTED}(?!\S)|\S+)")
_SEXAGESIMAL = re.compile(  # degrees, minutes and seconds of arc, written with their signs, with d m s, or with colons
    r"(?P<sign>[-+−]?)\s*(?P<degrees>\d{1,6})"
    r"(?:\s*(?:°|d|deg)\s*(?:(?P<minutes>\d{1,2}(?:[.,]\d+)?)\s*(?:['′’]|m)\s*"
    r"(?:(?P<seconds>\d{1,2}(?:[.,]\d+)?)\s*(?:[\"″”]|''|s)?)?)?"
    r"|:(?P<minutes_by_colon>\d{2}(?:[.,]\d+)?)(?::(?P<seconds_by_colon>\d{2}(?:[.,]\d+)?))?)",
    re.IGNORECASE,
)
_SIXTY = 60  # minutes of arc in a degree, and seconds in a minute
_WRITTEN = {".": re.compile(NUMBER), ",": re.compile(NUMBER.replace(r"\.", ","))}


def role_in(name: str) -> str:
    """Return the role of a column by its name (error, cam, output, angle and so on), empty if it is unknown."""
    if _names_temperature(name):
        return "temperature"
    if field := _epics_field_in(name):
        return _EPICS_ROLES[field]
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()
    return next((role for role, pattern in _ROLES.items() if re.search(_WORD.format(pattern), spaced)), "")


def _epics_field_in(name: str) -> str:
    """Return the field of an EPICS motor record in a name, such as RBV in "BL1:rot:m1.RBV", or ""."""
    match = _EPICS_FIELD.match(name.strip())
    return match[1] if match else ""


def is_in_counts(name: str) -> bool:
    """Return whether a name is that of an EPICS field with motor pulses or encoder counts."""
    return _epics_field_in(name) in _EPICS_COUNTS


def is_of_moteus(names: Sequence[str]) -> bool:
    """Return whether the names of a table are those of the telemetry or the registers of a moteus controller."""
    if any(re.match(_MOTEUS["telemetry"], name) for name in names):
        return True
    registers = [name for name in names if re.fullmatch(_MOTEUS["registers"], name)]
    return "POSITION" in registers and len(registers) >= _FEWEST_REGISTERS


def moteus_unit_of(name: str) -> str:
    """Return the unit of a moteus column by its name: revolutions or counts, empty for other columns."""
    if re.fullmatch(_MOTEUS["positions"], name):
        return "turn"
    return COUNTS if re.fullmatch(_MOTEUS["values"], name) else ""


def run_side_in(name: str) -> int:
    """Return the side of a column with one run of approaches, by its name: 1 forward, -1 backward, 0 if unknown.

    A sign denotes a side only at the end of a word, as in "run 1 -".
    """
    plain_name = re.sub(r"[\[(][^\])]*[\])]", " ", name.lower().replace("_", " "))
    sides = []
    for side, key in ((1, "forward"), (-1, "backward")):
        spelled, _, signs = _RUNS[key].rpartition("|")
        if re.search(_WORD.format(spelled), plain_name) or re.search(rf"{signs}(?=\s|$)", plain_name):
            sides.append(side)
    if len(sides) == 1:
        return sides[0]
    is_reverse = is_numbered_run(name) and re.search(rf"\b{_RUNS['reverse']}\s*[\[(]", name.lower().replace("_", " "))
    return -1 if is_reverse and not sides else 0


def is_numbered_run(name: str) -> bool:
    """Return whether the name of a column is that of a numbered run of approaches, for example "run 3"."""
    return bool(re.search(rf"(?<![^\W\d_]){_RUNS['number']}\s*\d+", name.lower().replace("_", " ")))


def form_in(text: str) -> str:
    """Return the form of pitch deviations stated in a name: cumulative, single, ambiguous, or ""."""
    return next((row["form"] for row in _TABLE["forms"] if re.search(row["words"], text)), "")


def flank_in(text: str) -> str:
    """Return the flank stated in a name: left, right, or empty if none or both are stated."""
    flanks = [flank for flank, pattern in _FLANKS.items() if re.search(pattern, text.lower())]
    return flanks[0] if len(flanks) == 1 else ""


def names_teeth(text: str) -> bool:
    """Return whether a name is that of a column of tooth numbers."""
    return bool(re.match(_TABLE["tooth"]["number"], text.strip().lower()))


def _names_temperature(name: str) -> bool:
    """Return whether a name is that of a temperature, by its unit or by a capital T without a unit of time."""
    marked, bare = _unit_texts(name)
    units = _FOREIGN["temperature"]
    if any(plain_unit(text) in units for text in marked):
        return True
    if any(plain_unit(word) in ("degc", "degf") and isnan(number_of(before)) for before, word in pairwise(["", *bare])):
        return True
    if not bare or bare[0] != "T" or unit_in(name, TIMES) or unit_in(name, TORQUES):
        return False
    return len(bare) == 1 or f"°{plain_unit(bare[-1])}" in units or plain_unit(bare[-1]) in units


def _unit_texts(name: str) -> tuple[list[str], list[str]]:
    """Return the texts of a name that may be units: first those in brackets or after a slash, then all its words.

    Units of several words, for example "arc min", count as one.
    """
    for pattern, unit in _JOINED:
        name = pattern.sub(f" {unit} ", name)
    marked = ["".join(match.groups("")).strip() for match in _IN_BRACKETS.finditer(name)]
    return marked, [word for word in re.split(r"[\s_()\[\],;/]+", name) if word]


def scaled_unit_in(name: str) -> str:
    """Return the part of a name that combines a unit with a factor, power or other unit ("0.1 arcsec"), or "".

    Such a text is not a plain unit: its readings differ by a factor, or are of another quantity.
    """
    for pattern, unit in _JOINED:
        name = pattern.sub(f" {unit} ", name)
    for match in _IN_BRACKETS.finditer(name):
        text = " ".join("".join(match.groups("")).split())
        if _SCALED_IN_BRACKETS.fullmatch(text):
            return text
    scaled = _SCALED.search(name)
    return scaled[0].strip() if scaled else ""


def unit_in(name: str, units: Iterable[str] = ANGLES) -> str:
    """Return the first known unit in a name such as "angle [deg]", "error/arcsec" or "wg_angle_deg", or "".

    A unit with a factor or quotient, as in "error [0.1 arcsec]" or "error [arcsec/s]", is not recognised.
    """
    if scaled_unit_in(name):
        return ""
    plain = {plain_unit(unit): unit for unit in units}
    marked, unit_texts = _unit_texts(name)
    if "deg" in plain and _GERMAN.search(name):
        plain[_AMBIGUOUS_DEGREE] = plain["deg"]
    for text in marked:
        if unit := plain.get(plain_unit(text)):
            return unit
    for word in unit_texts:
        is_long = len(word) >= _LEAST_BARE or word.lower() in _SPELLED or word.lower() in _LETTERS["own"]
        if is_long and word != "in" and (unit := plain.get(plain_unit(word))):
            return unit
    return ""


def foreign_unit_in(name: str, units: Iterable[str] = ANGLES) -> str:
    """Return the unit stated in a name, as written, if it is not one of the given units, or else an empty string.

    Any text in brackets counts as a unit, except for numbers, formulas and words such as "raw". A word without brackets
    counts only if it is a unit of another quantity and no number precedes it, as in "error at 20 °C".
    """
    if scaled := scaled_unit_in(name):
        return scaled
    if unit_in(name, units):
        return ""
    marked, unit_texts = _unit_texts(name)
    for text in marked:
        is_formula = len(text) > _LONGEST_UNIT or re.search(r"[=+]|\s[-−]\s|\s\S+\s", text)
        is_remark = " " in text and "[" not in name  # for example (1st run)
        is_part = f"/{text}" in name.replace(" ", "") and len(text) < _LEAST_BARE
        if text and not (is_formula or is_remark or is_part or role_in(text) or _NO_UNIT.fullmatch(text)):
            return text
    known_units = {plain_unit(unit) for unit in (*ANGLES, *TORQUES, *TIMES, COUNTS, *chain(*_FOREIGN.values()))}
    known_units.add(_AMBIGUOUS_DEGREE)
    for before, word in pairwise(["", *unit_texts]):
        is_word = (len(word) >= _LEAST_BARE and word != "in") or word.lower() in _LETTERS["foreign"]
        if is_word and plain_unit(word) in known_units and isnan(number_of(before)):
            return word
    return ""


def quantity_of(unit: str) -> str:
    """Return the quantity that a unit measures, empty if the unit is unknown."""
    plain = plain_unit(unit)
    tables: dict[str, Iterable[str]] = {"angle": ANGLES, "torque": TORQUES, "time": TIMES, **_FOREIGN}
    quantities = (quantity for quantity, units in tables.items() if plain in map(plain_unit, units))
    return next(quantities, "")


def length_in(name: str) -> str:
    """Return the unit stated in the name of a column of deviations; empty if none is stated."""
    for text in re.findall(r"\[([^\]]*)\]", name):
        if not form_in(text) and not flank_in(text):
            return plain_unit(text)
    known_units = (*_LENGTHS["metric"], *_LENGTHS["inches"], *ANGLES)
    if unit := unit_in(name, known_units):
        return unit
    foreign = foreign_unit_in(name, known_units)
    return "" if form_in(foreign) or flank_in(foreign) else foreign


def plain_unit(unit: str) -> str:
    """Return a unit in the spelling of words.toml, in lower case."""
    low = unit.strip().translate(_MICRO).lower()
    return _SPELLED.get(low, low)


def angle_size(unit: str) -> float:
    """Return the size of a unit of angle, or of an encoder count stated as counts per revolution [arcsec].

    Counts are written for example 16384 or 22bit. A minus sign reverses the sense of the angles.

    Raises UnitError if the text is neither of the two.
    """
    sense, text = (-1.0, unit.strip()[1:]) if unit.strip().startswith("-") else (1.0, unit)
    if (plain := plain_unit(text)) in ANGLES:
        return sense * ANGLES[plain]
    if plain == _AMBIGUOUS_DEGREE:
        raise UnitError("grad means a degree in German and 1/400 of a revolution elsewhere", "write deg or gon")
    number = number_of(plain.removesuffix("s").removesuffix("bit").strip())
    counts = 2 ** min(number, _MOST_BITS + 1) if "bit" in plain else number
    if not _FEWEST_COUNTS <= counts <= 2**_MOST_BITS:
        hint = (
            near_miss(text, ANGLES)
            or f"use one of {', '.join(ANGLES)}, or the counts per revolution, for example 16384 or 14bit"
        )
        raise UnitError("expected a unit of angle", hint)
    return sense * ANGLES["turn"] / counts


def micrometres(unit: str) -> float:
    """Return the size of a unit in micrometres. Raises UnitError if it is not a metric unit of length."""
    plain = plain_unit(unit)
    if plain in _LENGTHS["inches"]:
        raise UnitError("the unit is not metric", "convert to um or mm; 1 µin is 0.0254 um")
    if plain in ANGLES:
        raise UnitError(
            "the unit is a unit of angle, not of length", "multiply by the pitch radius: 1 arcsec at 100 mm is 0.485 um"
        )
    return convert(f"1 {plain or '-'}", "um")


class Cell(NamedTuple):
    """The text of a cell without quotes, and its position in the line, counted from 1."""

    text: str
    column: int


class TableLine(NamedTuple):
    """A line that is not blank.

    number: line number.
    text: text of the line.
    remark: position, from 1, at which the words of a comment begin; 0 if the line is not a comment.
    """

    number: int
    text: str
    remark: int

    @classmethod
    def of(cls, number: int, text: str) -> TableLine:
        """Return a line from its number and text."""
        mark = _REMARK.match(text)
        return cls(number, text, mark.end() + 1 if mark else 0)

    @property
    def words(self) -> str:
        """The words of a comment."""
        return self.text[self.remark - 1 :].rstrip(' ;,\t"')

    @property
    def entry(self) -> tuple[str, str, int] | None:
        """The key in lower case, the value and its position in a comment "key: value" or "key = value"."""
        match = _ENTRY.fullmatch(self.words)
        return (match[1].strip().lower(), match[2], self.remark + match.start(2)) if match else None


def cells_of(line: str, separator: str) -> list[Cell]:
    """Return the cells of a line, without empty ones at its end."""
    cells = []
    start = len(line) - len(line.lstrip())
    end = len(line.rstrip())
    while start <= end and (match := _CELLS[separator].search(line, start, end)):
        text = match[1].strip()
        if len(text) > 1 and text.startswith('"') and text.endswith('"'):
            text = text[1:-1].replace('""', '"').strip()
        cells.append(Cell(text, match.start(1) + 1))
        start = match.end() if separator == " " else (line.find(separator, match.end(), end) + 1 or end + 1)
    while cells and not cells[-1].text:
        cells.pop()
    return cells


def unclosed_quote(line: str, separator: str) -> int:
    """Return the position of the first cell in a line with an opening but no closing quote, 0 if there is none."""
    begin = len(line) - len(line.lstrip())
    end = len(line.rstrip())
    while begin <= end and (match := _CELLS[separator].search(line, begin, end)):
        if match[1].startswith('"') and not re.fullmatch(_QUOTED, match[1].strip()):
            return match.start(1) + 1
        begin = line.find(separator, match.end(), end) + 1 or end + 1
    return 0


def row_text(row: Iterable[Cell]) -> str:
    """Return the texts of cells, separated by blanks."""
    return " ".join(cell.text for cell in row).strip()


def has_numbers(row: Iterable[Cell]) -> bool:
    """Return whether a cell begins like a number, or is a number that is not finite."""
    return any(_MEANT.match(cell.text) or _NOT_FINITE.fullmatch(cell.text) for cell in row)


def separator_of(lines: Sequence[str]) -> str:
    """Return the separator of the cells in most lines of numbers: a semicolon, tab, comma or blank.

    Semicolons and tabs are never part of a number, so they take precedence over commas, and commas over blanks.
    """
    quoted = rf"(?<![^\s;,]){_QUOTED}"  # a quotation mark after a digit means seconds of arc
    bare = [re.sub(quoted, "0", line).strip() for line in lines]
    bare = [line for line in bare if _MEANT.match(line)] or bare
    for separator in ";\t":
        if 2 * sum(separator in line for line in bare) >= max(len(bare), 1):
            return separator
    by_commas = 2 * sum("," in line for line in bare) >= max(len(bare), 1)
    rows = [line.split() for line in bare]
    numbers = [[bool(_LIKE_A_NUMBER.fullmatch(cell)) and cell == cell.strip(",") for cell in row] for row in rows]
    by_blanks = sum(len(row) > 1 and all(row) for row in numbers)
    return "," if by_commas and 2 * by_blanks < len(bare) else " "


def names_in(
    line: str,
    width: int,
    separator: str,
) -> tuple[str, ...] | None:
    """Return the column names in a line above the rows, or None if no separator gives the number of columns.

    line: line that may contain the names.
    width: number of columns.
    separator: separator of the rows, which is tried first.
    """
    by_marks = (tuple(cell.text for cell in cells_of(line, mark)) for mark in dict.fromkeys((separator, *";\t,")))
    # a unit belongs to the name before it
    by_blanks = (tuple(re.split(separator, line.strip())) for separator in (r"\s{2,}", r"\s+(?![\[(/])(?<!/)(?<!/\s)"))
    return next((names for names in chain(by_marks, by_blanks) if len(names) == width), None)


def decimal_mark_in(text: str) -> str:
    """Return the decimal mark of a number; empty if it has none or both marks, or if the text is not a number."""
    if ("." in text) == ("," in text) or not _LIKE_A_NUMBER.fullmatch(text):
        return ""
    return "." if "." in text else ","


def sexagesimal_degrees(text: str, *, by_colons: bool) -> float | None:
    """Return an angle in degrees, minutes and seconds, such as 12°34'56.7", 12d34m or -0:00:30, in deg, or None.

    text: text of the cell.
    by_colons: whether colons may separate the parts of an angle; if not, they are those of a time.
    Raises ValueError for 60 or more minutes or seconds, and for a fraction before the last part.
    """
    match = _SEXAGESIMAL.fullmatch(text.strip())
    if match is None or (match["minutes_by_colon"] and not by_colons):
        return None
    minutes_text = match["minutes"] or match["minutes_by_colon"] or "0"
    seconds_text = match["seconds"] or match["seconds_by_colon"] or ""
    if seconds_text and ("." in minutes_text or "," in minutes_text):
        raise ValueError("minutes must be a whole number if seconds follow")
    minutes = float(minutes_text.replace(",", "."))
    seconds = float(seconds_text.replace(",", ".") or 0.0)
    if minutes >= _SIXTY or seconds >= _SIXTY:
        raise ValueError("minutes and seconds must be below 60")
    degrees = float(match["degrees"]) + minutes / _SIXTY + seconds / _SIXTY**2
    return -degrees if match["sign"] in ("-", "−") else degrees


def fault_of(text: str, decimal: str) -> tuple[str, str]:
    """Return the fault of the text of a number and a hint, both empty if the text is valid.

    decimal: decimal mark of the file.
    """
    if _WRITTEN[decimal].fullmatch(text):
        return "", ""
    if not text:
        return "a number is missing", "fill in the number, or leave out the row"
    if _NOT_FINITE.fullmatch(text):
        return "must be a finite number", "fill in the number, or leave out the row"
    if decimal_mark_in(text):
        wrong, usual = ("comma", "point") if decimal == "." else ("point", "comma")
        return f"a decimal {wrong} among decimal {usual}s", f"write every number with a decimal {usual}"
    if _THOUSANDS.fullmatch(text):
        return "must be a number", "write one decimal mark, and no separator between thousands"
    if "−" in text:
        return "must be a number", "write an ASCII minus sign"
    if re.match(rf"{_LIKE}\s*([^\W\d]|[°′″])", text):
        return "must be a number", "write the unit in the line of names, for example deviation [um]"
    return "must be a number", "put # in front of a comment line"
