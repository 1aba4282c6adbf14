"""Pitch deviations of a wheel, measured on a gear checker, from a file with a row for each tooth.

The deviation of a tooth is where its flank lies against the place it should have, along the pitch circle, up to a
constant for the whole wheel. A file has two columns, tooth number and deviation, and may say in remarks:

    # form: cumulative | single   cumulative deviations F_p (default), or single pitch deviations f_pt, that of tooth
                                  k between the teeth k - 1 and k; "index" means the same as "single"
    # unit: um | mm               or in the name of the column; um by default
    # sense: ccw | cw             in which sense the numbers grow, seen from the cam side; ccw by default
    # sign: along | ccw | cw      to where a positive deviation points: along the growing numbers (default), or
                                  to one side whatever the numbering
    # mark: 17                    the tooth that bears the mark; the first one by default
    # flank: left | right

The deviations read always count counter-clockwise from the mark, positive ones counter-clockwise. A wheel of four
teeth, numbered clockwise, mark on tooth 2:

    # sense: cw
    # mark: 2              read: tooth 2, 1, 4, 3, with the signs turned round: -3, 0, -1, +2
    1; 0                   with "# sign: ccw" the order is the same and the signs stay: +3, 0, +1, -2
    2; 3
    3; -2
    4; 1

(here less the mean). The mean of the deviations has no effect and is taken off.
"""

from __future__ import annotations

import re
from typing import Literal, NamedTuple, get_args

import numpy as np

from hdassist.errors import UsageError
from hdassist.model.geometry import Array
from hdassist.model.wheels import PitchFile
from hdassist.preset.units import UnitError
from hdassist.preset.yamltext import near_miss
from hdassist.readers.table import NumberTable, read_numbers, shortened
from hdassist.readers.words import (
    AMBIGUOUS,
    PITCH_KEYS,
    flank_in,
    form_in,
    length_in,
    micrometres,
    names_teeth,
    plain_unit,
)
from hdassist.textfile import Readable

LEAST_RANGE, LARGEST_RANGE = 0.5, 1000.0  # um: range of the deviations of a wheel
CLOSING = 0.2  # of the range: greatest sum of the single deviations
NOISE = 1e-9  # of the summed deviations: a closing error that is rounding of the sum
_CODE_PAGE = re.compile("[\x80-\xff]{3}")  # in Latin-1: letters of another code page

PitchForm = Literal["cumulative", "single", "index"]
Sense = Literal["ccw", "cw"]
Sign = Literal["along", "ccw", "cw"]
Flank = Literal["left", "right"]

CHOICES = {"form": get_args(PitchForm), "sense": get_args(Sense), "sign": get_args(Sign), "flank": get_args(Flank)}
EXPECTED = {  # by key, for messages
    "form": "cumulative or single",
    "unit": "um or mm",
    "sense": "ccw or cw, seen from the cam side",
    "sign": "along (the numbering), ccw or cw",
    "mark": "the number of a tooth",
    "flank": "left or right",
}
FORM_HINT = 'write a comment line above the rows, like "# form: cumulative" or "# form: single"'


def read_pitch(
    source: Readable,
    teeth: int,
    *,
    form: PitchForm | None = None,
    sense: Sense | None = None,
    sign: Sign | None = None,
    mark: int | None = None,
    flank: Flank | None = None,
) -> PitchFile:
    """Read the pitch deviations of a wheel; for the form of a file see the module.

    Arguments: source, a path ("-" is standard input), stream or bytes; teeth of the wheel; the others take precedence
    over remarks of the file, and flank chooses among columns for two flanks.
    Raises DataError: a file that cannot be read; PresetError: every fault of the file; UsageError: a wrong argument.
    """
    asked = {"form": form, "sense": sense, "sign": sign, "mark": mark, "flank": flank}
    given = {key: str(value) for key, value in asked.items() if value is not None}
    for key, choices in CHOICES.items():
        if given.get(key, choices[0]) not in choices:
            raise UsageError(f"invalid {key} {given[key]}: expected one of {', '.join(choices)}")
    if teeth < 2:
        raise UsageError(f"invalid number of teeth {teeth}: expected two or more")
    table = read_numbers(source, ("tooth number", "deviation"))
    is_table = not table.findings
    stated = _Statements(table, given)
    teeth_in, deviation_in = stated.columns() if is_table else (0, 0)
    unit, size = stated.unit()
    is_single = stated.value("form", "cumulative", "no form given: cumulative deviations") == "single"
    sense_is = stated.value("sense", "ccw", "no sense given: numbered counter-clockwise, seen from the cam side")
    sign_is, side = stated.value("sign", "along"), stated.value("flank")
    first, order = _rows_by_tooth(table, teeth_in, teeth) if is_table else (1, [])
    tooth = stated.tooth(range(first, first + teeth) if is_table else None)
    table.require_sound()
    values = _cumulative(table, deviation_in, order, (unit, size), is_single)
    table.require_sound()
    if not first <= tooth < first + teeth:
        hint = f"{table.file} has the teeth {first} to {first + teeth - 1}"
        raise UsageError(f"invalid mark {tooth}: expected a tooth of the wheel", hint)
    values = np.roll(values, first - tooth)
    if sense_is == "cw":
        values = np.roll(values[::-1], 1)
        table.notes.append("numbers turned round")
    if (sense_is if sign_is == "along" else sign_is) == "cw":
        values = -values
        table.notes.append("signs turned round")
    deviation = np.asarray(values - values.mean(), dtype=np.float64)
    deviation.setflags(write=False)
    known: Flank | None = "left" if side == "left" else "right" if side == "right" else None
    return PitchFile(deviation, tooth, known, table.file, table.sha256, tuple(table.notes))


class _Statement(NamedTuple):
    """A statement of a file on a key: its value (empty if invalid), text, line and column."""

    value: str
    text: str
    line: int
    column: int


class _Statements:
    """Statements on the form of a file of pitch deviations: by arguments, its remarks and the names of its columns."""

    def __init__(self, table: NumberTable, asked: dict[str, str]) -> None:
        self.table = table
        self.asked = {key: _plain(value) for key, value in asked.items()}
        self.stated: dict[str, list[_Statement]] = {key: [] for key in PITCH_KEYS.values()}
        for remark in table.remarks:
            if remark.entry is None:
                continue
            word, text, column = remark.entry
            self._require_readable(remark.number, remark.remark, word)
            if key := PITCH_KEYS.get(word):
                self.stated[key].append(_Statement(_value_of(key, text), text, remark.number, column))
            elif hint := near_miss(word, PITCH_KEYS):
                table.notes.append(f'line {remark.number}: "{word}" is passed over; {hint}')

    def _require_readable(self, line: int, column: int, name: str) -> None:
        if self.table.is_latin and _CODE_PAGE.search(name):
            self.table.add(line, column, "", "a name that is not UTF-8 text", name, "save the file as UTF-8")

    def value(self, key: str, default: str = "", if_none: str = "") -> str:
        """Value of a key: that of the argument, else that of the file, else the default with a note."""
        stated, asked = self.stated[key], self.asked.get(key)
        if asked is not None:
            other = next((s.text for s in stated if s.value != asked), None)
            if other is not None:
                self.table.notes.append(f"{key} {asked} as asked for; the file says {other}")
            return asked
        for statement in stated:
            if not statement.value:
                self._refuse(key, statement, f"must be {EXPECTED[key]}")
                return default
            if statement.value != stated[0].value:
                hint = f"line {stated[0].line} says {stated[0].text}; keep one of them"
                self._refuse(key, statement, "stated twice, and not the same", hint)
                return default
        if not stated and if_none:
            self.table.notes.append(if_none)
        return stated[0].value if stated else default

    def unit(self) -> tuple[str, float]:
        """Unit of the deviations, and its size in um."""
        unit = self.value("unit", "um", "no unit given: um")
        try:
            return unit, micrometres(unit)
        except UnitError as error:
            self._refuse("unit", self.stated["unit"][0], error.message, error.hint)
            return "um", 1.0

    def tooth(self, teeth: range | None) -> int:
        """The tooth with the mark, by default the first one; teeth: their numbers in the file, where it has them."""
        stated = self.value("mark")
        if teeth is None or "mark" in self.asked:
            return int(stated or 1)
        if not stated:
            self.table.notes.append(f"no mark given: tooth {teeth[0]} has it")
        elif int(stated) not in teeth:
            message = f"no tooth of the wheel: {teeth[0]} to {teeth[-1]}"
            self._refuse("mark", self.stated["mark"][0], message, "give the number of the tooth with the mark")
        return int(stated or teeth[0])

    def columns(self) -> tuple[int, int]:
        """Columns of the tooth numbers and of the deviations; states what the name of the latter says."""
        table = self.table
        if table.names_in_remark and not any(map(names_teeth, table.names)):
            table.names = ()  # a remark with as many words as there are columns
        names = table.names
        for name in names:
            self._require_readable(table.names_line, 1, name)
        teeth = [index for index, name in enumerate(names) if names_teeth(name)]
        first = teeth[0] if len(teeth) == 1 else 0
        others = [index for index in range(table.values.shape[1]) if index != first]
        for key, meaning in (("flank", flank_in), ("form", form_in)):
            wanted = self.asked.get(key) or next((s.value for s in self.stated[key]), "")
            if wanted and len(others) > 1 and names:
                others = [index for index in others if meaning(names[index]) == wanted] or others
        if len(others) > 1:
            self._refuse_columns(others)
        elif names:
            self._name_says(names[others[0]])
        return first, others[0]

    def _refuse_columns(self, columns: list[int]) -> None:
        table, names = self.table, [self.table.name(column) for column in columns]
        hint = "name the columns in a line above the rows (left, right), or keep one of them"
        if table.names and len(set(map(flank_in, names))) > 1:
            hint = "ask for one flank: flank left or right"
        elif table.names and len(set(map(form_in, names))) > 1:
            hint = "ask for one form: form cumulative or form single"
        got = " and ".join(f'"{name}"' for name in names)
        line = table.names_line if table.names else int(table.lines[0])
        table.add(line, 1, "", f"{len(columns)} columns of deviations", got, hint)

    def _name_says(self, name: str) -> None:
        line = self.table.names_line
        for key, value in (("form", form_in(name)), ("flank", flank_in(name)), ("unit", length_in(name))):
            if value == AMBIGUOUS:
                if not self.stated[key] and key not in self.asked:
                    self.table.add(line, 1, key, "single pitch deviations, or cumulative ones?", name, FORM_HINT)
            elif value:
                self.stated[key].append(_Statement(value, name, line, 1))

    def _refuse(self, key: str, at: _Statement, message: str, hint: str = "") -> None:
        self.table.add(at.line, at.column, key, message, at.text or "nothing", hint)


def _value_of(key: str, text: str) -> str:
    """Value of a remark; empty if it is invalid."""
    if key == "unit":
        return plain_unit(text)
    if key == "mark":
        return str(int(text)) if re.fullmatch(r"[+]?[0-9]{1,9}", text) else ""
    value = _plain(re.sub(r"[\s-]+", "", text.lower()))
    return value if value in CHOICES[key] else ""


def _plain(value: str) -> str:
    return {"index": "single", "clockwise": "cw", "counterclockwise": "ccw", "anticlockwise": "ccw"}.get(value, value)


def _rows_by_tooth(table: NumberTable, column: int, teeth: int) -> tuple[int, list[int]]:
    """The first tooth number, 0 or 1, and the row (from 0) of each tooth of the wheel, from the first on.

    Faults of the tooth numbers are added to the findings of the table.
    """
    numbers = table.values[:, column].tolist()
    row_of: dict[int, int] = {}
    broken = [row for row, number in enumerate(numbers) if not number.is_integer()]
    few_broken = 2 * len(broken) <= len(numbers)
    for row in broken if few_broken else broken[:1]:
        message = "must be the whole number of a tooth" if few_broken else "no column of tooth numbers"
        hint = "the first column has the tooth numbers, unless a line of names says otherwise"
        table.add_at(row, column, message, f"{numbers[row]:g}", hint)
    for row, number in enumerate(numbers):
        if number.is_integer() and row_of.setdefault(int(number), row) != row:
            hint = f"first in line {table.lines[row_of[int(number)]]}; keep one row"
            table.add_at(row, column, "a tooth for the second time", f"{number:g}", hint)
    wanted = range(teeth) if 0 in row_of else range(1, teeth + 1)
    if few_broken:
        _require_all(table, column, row_of, wanted)
    return wanted[0], [row_of.get(number, 0) for number in wanted]


def _require_all(table: NumberTable, column: int, row_of: dict[int, int], wanted: range) -> None:
    """Add findings for teeth of the wheel without a row, and for rows beyond its teeth."""
    beyond, missing = sorted(row_of.keys() - set(wanted)), sorted(set(wanted) - row_of.keys())
    if (beyond or missing) and sorted(row_of) == list(range(wanted[0], wanted[0] + len(row_of))):
        hint = "leave out the first tooth, measured again" if len(beyond) == 1 else "check the wheel of the file"
        got = f"tooth {shortened(beyond)} too" if beyond else f"no row for tooth {shortened(missing)}"
        message = f"the wheel has {len(wanted)} teeth, the file {len(row_of)}"
        table.add_at(row_of[beyond[0]] if beyond else 0, column, message, got, hint)
        return
    if beyond:
        message, hint = f"tooth numbers beyond {wanted[0]} to {wanted[-1]}", "count the teeth from 0 or from 1 on"
        table.add_at(row_of[beyond[0]], column, message, shortened(beyond), hint)
    if missing:
        message, got = f"no row for tooth {shortened(missing)}", f"{len(table.lines)} rows"
        table.add_at(0, column, message, got, f"{len(wanted)} are needed")


def _cumulative(table: NumberTable, column: int, order: list[int], unit: tuple[str, float], is_single: bool) -> Array:
    """Cumulative deviations [um] in the order of the tooth numbers, with their signs in the file.

    Arguments: table, whose notes and findings are added to; column of the deviations, and their rows in order; unit,
    its name and size in um; is_single, whether they are single pitch deviations.
    """
    name, size = unit
    values = table.values[order, column] * size
    if size != 1:
        table.notes.append(f"{name} to um")
    if is_single:
        gap, whole = float(values.sum()), float(np.abs(values).sum())
        values = np.cumsum(values - gap / len(values))
        closes = abs(gap) <= NOISE * whole
        if not closes and abs(gap) > CLOSING * np.ptp(values):
            sizes = f"their sum is {gap:.3g} um, their curve spans {np.ptp(values):.3g} um"
            hint = "cumulative deviations, values rounded too far, or teeth measured in several passes?"
            table.add_at(0, column, f"single pitch deviations do not close: {sizes}", "", hint)
        else:
            shared = "" if closes else f", closing error of {gap:.3g} um shared out"
            table.notes.append(f"single pitch deviations summed up{shared}")
    reach = float(np.ptp(values))
    if reach > LARGEST_RANGE:
        hint = "is the unit right, and are these deviations, not places?"
        table.add_at(0, column, f"{reach:.4g} um over the whole wheel", f"unit {name}", hint)
    elif 0 < reach < LEAST_RANGE:
        hint = "is it mm?" if name != "mm" else "is it um? no wheel is that good"
        table.add_at(0, column, f"{reach:.3g} um over the whole wheel", f"unit {name}", hint)
    return np.asarray(values)
