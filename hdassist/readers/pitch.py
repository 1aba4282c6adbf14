"""Pitch deviations of a wheel, measured on a gear checker, from a file with one row for each tooth.

The deviation of a tooth is the distance of its flank from its ideal position along the pitch circle, up to a constant
for the whole wheel. A file has two columns, tooth number and deviation, and may state in comments:

    # form: cumulative | single   cumulative deviations F_p (default), or single pitch deviations f_pt; that of tooth
                                  k lies between the teeth k - 1 and k
    # unit: um | mm               also in the name of the column; um by default
    # sense: ccw | cw             sense in which the numbers increase, seen from the wave generator side; ccw by default
    # sign: along | ccw | cw      direction of a positive deviation: along increasing numbers (default), or in one
                                  sense for any numbering
    # mark: 17                    number of the marked tooth; the first one by default
    # flank: left | right

The result always counts counter-clockwise from the mark, with positive deviations counter-clockwise. An example is a
wheel with four teeth, numbered clockwise, with the mark on tooth 2:

    # sense: cw
    # mark: 2              result: teeth 2, 1, 4, 3, with reversed signs: -3, 0, -1, +2
    1; 0                   with "# sign: ccw" the order is the same and the signs stay: +3, 0, +1, -2
    2; 3
    3; -2
    4; 1

(here without subtraction of the mean). The mean of the deviations has no effect and is subtracted.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Literal, NamedTuple, cast, get_args

import numpy as np

from hdassist.drive.model.deviations import MeasuredTeeth, MeasuredWheel, PitchFile
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import IN_TEETH, Drive, is_overridden
from hdassist.drive.preset.text import UnitError, near_miss
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
from hdassist.run.errors import UsageError
from hdassist.run.files import Readable

_LEAST_RANGE = 0.5  # um: smallest plausible range of the deviations of a wheel
_LARGEST_RANGE = 1000.0  # um: largest plausible range of the deviations of a wheel
_CLOSING = 0.2  # largest sum of the single deviations, as a share of their range
_NOISE = 1e-9  # closing error that is rounding of the sum, as a share of the summed magnitudes
_CODE_PAGE = re.compile("[\x80-\xff]{3}")  # letters of another code page, as they appear in Latin-1
_SENSES = {"clockwise": "cw", "counterclockwise": "ccw", "anticlockwise": "ccw"}
_PitchForm = Literal["cumulative", "single"]
_Sense = Literal["ccw", "cw"]
_Flank = Literal["left", "right"]
_CHOICES = {  # by key: valid values, and their description for messages
    "form": (get_args(_PitchForm), "cumulative or single"),
    "sense": (get_args(_Sense), "ccw or cw, seen from the wave generator side"),
    "sign": (("along", "ccw", "cw"), "along (the numbering), ccw or cw"),
    "flank": (get_args(_Flank), "left or right"),
}
ASSUMED = {  # by key: assumed value if none is stated, and the note on it
    "form": ("cumulative", "no form is stated; the values are read as cumulative deviations"),
    "unit": ("um", "no unit is stated; the values are read as um"),
    "sense": (
        "ccw",
        "no sense is stated; the teeth are read as numbered counter-clockwise, seen from the wave generator side",
    ),
    "sign": ("along", ""),
}
COLUMNS_HINT = (
    "name the columns above the rows, for example left [um]; right [um], and select one flank or form; "
    "with decimal commas separate columns by ;"
)
_FORM_HINT = 'write a comment line above the rows, like "# form: cumulative" or "# form: single"'
_WHEEL_NAMES = ("b", "g")


def read_pitch(
    source: Readable,
    teeth: int,
    *,
    form: _PitchForm | None = None,
    sense: _Sense | None = None,
    flank: _Flank | None = None,
) -> PitchFile:
    """Return the pitch deviations of a wheel from a file of the form that the module describes.

    source: path ("-" is standard input), stream or bytes.
    teeth: number of teeth of the wheel.
    form, sense: form of the deviations and sense of the numbers; None for those that the file states.
    flank: flank whose column is selected from columns for two flanks; None if there is only one.
    Raises DataError if the file cannot be read.
    Raises PresetError that lists all faults of the file.
    Raises UsageError for an invalid argument.
    """
    arguments = {"form": form, "sense": sense, "flank": flank}
    # only explicitly stated arguments can contradict the file
    stated_arguments = {key: value for key, value in arguments.items() if value is not None}
    for key, value in stated_arguments.items():
        if value not in _CHOICES[key][0]:
            raise UsageError(f"invalid {key} {value}: expected one of {', '.join(_CHOICES[key][0])}")
    if teeth < 2:
        raise UsageError(f"invalid number of teeth {teeth}: expected two or more")
    # faults of the table are collected, so that faults of the statements are reported in the same run
    table = read_numbers(source, ("tooth number", "deviation"))
    stated = _Statements(table, stated_arguments)
    is_table = not table.findings
    teeth_in, deviation_in = stated.columns() if is_table else (0, 0)
    unit = _length_unit(stated)
    layout = _Layout.of(stated)
    # if the table is invalid, its columns are unknown
    first, order = _rows_by_tooth(table, teeth_in, teeth) if is_table else (1, [])
    mark = _marked_tooth(stated, first, teeth)
    # raises all faults found so far, because sums of invalid values would only add further ones
    table.require_sound()
    values = _cumulative(
        table,
        deviation_in,
        order,
        unit,
        is_single=layout.form == "single",
    )
    table.require_sound()
    deviation = _from_mark(table, values, first - mark, layout)
    flank_is = cast(_Flank | None, layout.flank or None)
    return PitchFile(
        deviation=deviation, mark=mark, flank=flank_is, file=table.file, sha256=table.sha256, notes=tuple(table.notes)
    )


@dataclass(frozen=True)
class _Layout:
    """The form in which a file gives its deviations, each as a word of _CHOICES; flank is empty if it is not stated."""

    form: str
    sense: str
    sign: str
    flank: str

    @classmethod
    def of(cls, stated: _Statements) -> _Layout:
        """Return the form that the arguments or the file state, and add notes on assumed values."""
        return cls(
            form=stated.value("form"),
            sense=stated.value("sense"),
            sign=stated.value("sign"),
            flank=stated.value("flank"),
        )

    @property
    def positive_sense(self) -> str:
        """The sense, cw or ccw, of a positive deviation."""
        # if signs follow the numbering, they reverse with it
        return self.sense if self.sign == "along" else self.sign


def _length_unit(stated: _Statements) -> tuple[str, float]:
    """Return the unit of the deviations and its size [um]. For an unknown unit, a finding is added and um returned."""
    unit = stated.value("unit")
    try:
        return unit, micrometres(unit)
    except UnitError as error:
        return stated.refused("unit", error.message, "um", error.hint), 1.0


def _marked_tooth(
    stated: _Statements,
    first: int,
    teeth: int,
) -> int:
    """Return the number of the marked tooth. If none is stated, it is the first one, and a note is added.

    stated: statements of the file, to which a finding is added if the wheel does not have the stated tooth.
    first: number of the first tooth, 0 or 1.
    teeth: number of teeth.
    """
    mark = int(stated.value("mark") or first)
    if not stated.stated["mark"]:
        stated.table.notes.append(f"no mark is stated; tooth {mark} is taken as the marked tooth")
    elif not first <= mark < first + teeth:
        message = f"the mark must be one of the wheel's teeth, {first} to {first + teeth - 1}"
        stated.refused("mark", message, "", "state the number of the marked tooth")
    return mark


def _from_mark(
    table: NumberTable,
    values: Array,
    shift: int,
    layout: _Layout,
) -> Array:
    """Return deviations [um] counter-clockwise from the marked tooth, without their mean, shape (teeth,).

    table: table to which notes on reversals are added.
    values: cumulative deviations in the order and with the signs of the file, shape (teeth,).
    shift: number of the first tooth minus that of the marked tooth.
    layout: sense of the numbers and of the signs.
    """
    # the marked tooth becomes the first one
    values = np.roll(values, shift)
    if layout.sense == "cw":
        values = np.roll(values[::-1], 1)  # rolled by one, so that the marked tooth stays first
        table.notes.append("numbers reversed")
    if layout.positive_sense == "cw":
        values = -values
        table.notes.append("signs reversed")
    # the mean depends on the choice of the zero tooth and only rotates the wheel
    deviation: Array = values - values.mean()
    deviation.setflags(write=False)
    return deviation


class _Statement(NamedTuple):
    """A statement of a file on a key: its value (empty if invalid), text, line and column."""

    value: str
    text: str
    line: int
    column: int


class _Statements:
    """Statements on the form of a file of pitch deviations, from arguments, comments and column names."""

    def __init__(self, table: NumberTable, asked: Mapping[str, str]) -> None:
        self.table = table
        self.asked = asked
        self.stated: dict[str, list[_Statement]] = {key: [] for key in PITCH_KEYS.values()}
        if table.names_in_remark and not any(map(names_teeth, table.names)):
            table.names = ()  # by chance, this comment has as many words as there are columns
        entries = [(remark.number, remark.remark, *remark.entry) for remark in table.remarks if remark.entry]
        names = [entry[:3] for entry in entries]
        # Latin-1 accepts any byte, so a wrong code page is recognised by letters that no name contains
        for line, column, name in (*names, *((table.names_line, 1, name) for name in table.names)):
            if table.is_latin and _CODE_PAGE.search(name):
                table.add(line, column, "", "a name that is not UTF-8 text", name, "save the file as UTF-8")
        for line, _, word, text, column in entries:
            if key := PITCH_KEYS.get(word):
                statement = _Statement(
                    value=_value_of(key, text),
                    text=text,
                    line=line,
                    column=column,
                )
                self.stated[key].append(statement)
            # the note is added because a misspelled key is ignored
            elif hint := near_miss(word, PITCH_KEYS):
                table.notes.append(f'line {line}: "{word}" is ignored; {hint}')

    def value(self, key: str) -> str:
        """Return the value of a key: from the argument, else from the file, else the assumed value.

        A note is added if the value is assumed, or if the argument contradicts the file.
        """
        stated = self.stated[key]
        default, note = ASSUMED.get(key, ("", ""))
        # an argument takes precedence over the file
        if argument := self.asked.get(key):
            contradiction = next((statement.text for statement in stated if statement.value != argument), None)
            if contradiction is not None:
                self.table.notes.append(f"{key} {argument} as requested; the file states {contradiction}")
            return argument
        for statement in stated:
            if not statement.value:
                expected = _CHOICES[key][1] if key in _CHOICES else "the number of a tooth"
                return self.refused(key, f"must be {expected}", default, at=statement)
            # comments and column names may repeat the same statement
            if statement.value != stated[0].value:
                hint = f"line {stated[0].line} states {stated[0].text}; keep one of the two"
                return self.refused(key, "two different values are stated", default, hint, statement)
        if not stated and note:
            self.table.notes.append(note)
        return stated[0].value if stated else default

    def columns(self) -> tuple[int, int]:
        """Return the columns of tooth numbers and of deviations, and add the statements in the latter column's name."""
        names = self.table.names
        teeth = [index for index, name in enumerate(names) if names_teeth(name)]
        # if no name states tooth numbers, the first column contains them
        first = teeth[0] if len(teeth) == 1 else 0
        columns = [index for index in range(self.table.values.shape[1]) if index != first]
        for key, meaning in (("flank", flank_in), ("form", form_in)):
            wanted = self.asked.get(key) or next((statement.value for statement in self.stated[key]), "")
            if wanted and len(columns) > 1 and names:
                # several columns of deviations are distinguished by flank, then by form
                columns = [index for index in columns if meaning(names[index]) == wanted] or columns
        if len(columns) > 1:
            self._refuse_columns(columns)
        elif names:
            self._take_statements(names[columns[0]])
        return first, columns[0]

    def _refuse_columns(self, columns: Sequence[int]) -> None:
        """Add a finding that several columns contain deviations."""
        table = self.table
        got = " and ".join(f'"{table.name(column)}"' for column in columns)
        line = table.names_line if table.names else int(table.lines[0])
        table.add(line, 1, "", f"{len(columns)} columns of deviations", got, COLUMNS_HINT)

    def _take_statements(self, name: str) -> None:
        """Add the statements in the name of a column of deviations. A form that stays ambiguous gives a finding."""
        table = self.table
        for key, value in (("form", form_in(name)), ("flank", flank_in(name)), ("unit", length_in(name))):
            if value and value != AMBIGUOUS:
                statement = _Statement(
                    value=value,
                    text=name,
                    line=table.names_line,
                    column=1,
                )
                self.stated[key].append(statement)
            # "pitch deviation" without an attribute may mean either form
            elif value and not self.stated[key] and key not in self.asked:
                message = "state whether they are single or cumulative pitch deviations"
                table.add(table.names_line, 1, key, message, name, _FORM_HINT)

    def refused(
        self,
        key: str,
        message: str,
        default: str,
        hint: str = "",
        at: _Statement | None = None,
    ) -> str:
        """Return the default value of a key after adding a finding.

        at: statement to which the finding refers, None for the first statement of the key.
        """
        statement = at or self.stated[key][0]
        self.table.add(statement.line, statement.column, key, message, statement.text or "nothing", hint)
        return default


def _value_of(key: str, text: str) -> str:
    """Return the value of a statement, or an empty string if it is invalid."""
    if key == "unit":
        return plain_unit(text)
    if key == "mark":
        # the number of the marked tooth
        return str(int(text)) if re.fullmatch(r"[+]?[0-9]{1,9}", text) else ""
    # "counter-clockwise" has several spellings
    value = re.sub(r"[\s-]+", "", text.lower())
    value = _SENSES.get(value, value)
    return value if value in _CHOICES[key][0] else ""


def _rows_by_tooth(
    table: NumberTable,
    column: int,
    teeth: int,
) -> tuple[int, list[int]]:
    """Return the first tooth number, 0 or 1, and the row index of each tooth of the wheel in order.

    Faults of the tooth numbers are added to the findings of the table.
    """
    row_of: dict[int, int] = {}
    for row, number in enumerate(table.values[:, column].tolist()):
        if not number.is_integer():
            hint = "put tooth numbers in the first column, or name the columns"
            table.add_at(row, column, "must be a tooth number (a whole number)", f"{number:g}", hint)
            return 1, []
        # rows may be in any order, but each tooth must occur once
        if row_of.setdefault(int(number), row) != row:
            hint = f"first in line {table.lines[row_of[int(number)]]}; keep one row"
            table.add_at(row, column, "the tooth is given twice", f"{number:g}", hint)
    # numbering starts at 0 or 1
    first = 0 if 0 in row_of else 1
    wanted = range(first, first + teeth)
    beyond = sorted(row_of.keys() - set(wanted))
    missing = sorted(set(wanted) - row_of.keys())
    for fault_words, numbers in (("a row for tooth", beyond), ("no row for tooth", missing)):
        if numbers:
            message = f"the wheel has {teeth} teeth, the file has {len(row_of)}"
            hint = "number the teeth from 0 or 1, each tooth once" if beyond else f"{teeth} rows are needed"
            row = row_of.get(numbers[0], 0)
            table.add_at(row, column, message, f"{fault_words} {shortened(numbers)}", hint)
    return first, [row_of.get(number, 0) for number in wanted]


def _cumulative(
    table: NumberTable,
    column: int,
    order: list[int],
    unit: tuple[str, float],
    *,
    is_single: bool,
) -> Array:
    """Return the cumulative deviations [um] in the order of the tooth numbers, with their signs in the file.

    table: table to which notes and findings are added.
    column: column of the deviations.
    order: row index of each tooth, in the order of the tooth numbers.
    unit: name of the unit and its size [um].
    is_single: whether they are single pitch deviations.
    """
    name, size = unit
    values = table.values[order, column] * size
    if size != 1:
        table.notes.append(f"converted from {name} to um")
    # cumulative deviations are sums of single ones, starting at the first tooth
    if is_single:
        gap = float(values.sum())
        sum_of_magnitudes = float(np.abs(values).sum())
        # the pitches of a wheel add up to one revolution, so their deviations add up to 0
        values = np.cumsum(values - gap / len(values))
        closes = abs(gap) <= _NOISE * sum_of_magnitudes
        if not closes and abs(gap) > _CLOSING * np.ptp(values):
            sizes = f"their sum is {gap:.3g} um, their curve spans {np.ptp(values):.3g} um"
            hint = "check whether they are cumulative deviations, rounded too coarsely, or measured in several passes"
            table.add_at(0, column, f"single pitch deviations do not close: {sizes}", "", hint)
        else:
            shared = "" if closes else f", closing error of {gap:.3g} um distributed over all teeth"
            table.notes.append(f"single pitch deviations summed up{shared}")
    reach = float(np.ptp(values))
    # so large a range indicates positions or another unit
    if reach > _LARGEST_RANGE:
        hint = "check the unit, and that the values are deviations, not positions"
        table.add_at(0, column, f"{reach:.4g} um over the whole wheel", f"unit {name}", hint)
    elif 0 < reach < _LEAST_RANGE:
        hint = (
            "check whether the unit is mm" if name != "mm" else "check whether the unit is um; no wheel is so accurate"
        )
        table.add_at(0, column, f"{reach:.3g} um over the whole wheel", f"unit {name}", hint)
    return values


@dataclass(frozen=True)
class WheelFiles:
    """Pitch files of circular spline (b) and flexspline (g), the directions of their marks [deg], and their form."""

    pitch_b: str | None = None
    pitch_g: str | None = None
    mark_b: float | None = None
    mark_g: float | None = None
    pitch_form: _PitchForm | None = None
    pitch_sense: _Sense | None = None
    pitch_flank: _Flank | None = None

    @property
    def files(self) -> dict[str, str]:
        """The given files by wheel."""
        return {name: file for name in _WHEEL_NAMES if (file := getattr(self, f"pitch_{name}")) is not None}

    @property
    def marks(self) -> dict[str, float]:
        """The given directions of marks [deg] by wheel."""
        return {name: mark for name in _WHEEL_NAMES if (mark := getattr(self, f"mark_{name}")) is not None}

    def require_sound(self) -> None:
        """Raise UsageError for a mark or a form without a file, and for a mark that is not finite."""
        for name, mark in self.marks.items():
            if name not in self.files:
                message = f"--mark-{name} requires the pitch deviations of this wheel"
                raise UsageError(message, f"name their file with --pitch-{name} FILE")
            if not isfinite(mark):
                message = f"invalid --mark-{name} {mark}: expected an angle in deg"
                raise UsageError(message, f"use, for example, --mark-{name} 30")
        if not self.files and (self.pitch_form or self.pitch_sense or self.pitch_flank):
            message = "--pitch-form, --pitch-sense and --pitch-flank require --pitch-b or --pitch-g"
            raise UsageError(message, "name the file with --pitch-b FILE or --pitch-g FILE")

    def read(self, drive: Drive) -> MeasuredTeeth | None:
        """Return the measured wheels of a drive, with notes on assumptions, or None if no file is given.

        Raises PresetError that lists the faults of a file.
        Raises DataError if a file cannot be read.
        Raises UsageError if the direction of a mark is unknown.
        """
        wheels = {}
        for name, file in self.files.items():
            teeth = drive.gears.z_b if name == "b" else drive.gears.z_g
            pitch = read_pitch(
                file,
                teeth,
                form=self.pitch_form,
                sense=self.pitch_sense,
                flank=self.pitch_flank,
            )
            # an option takes precedence over the preset
            mark = self.marks.get(name)
            notes = list(pitch.notes)
            if mark is None:
                if (mark_of_preset := drive.value(f"phases.xi_{name}")) is None:
                    raise UsageError(
                        f"the direction of the mark in {file} is unknown",
                        f"state it in deg, for example --mark-{name} 30",
                    )
                mark = float(mark_of_preset)
                note = f"the mark is at {mark:g} deg, from phases.xi_{name} of the preset"
                notes.append(f"{note}; to change it use --mark-{name}")
            # if the teeth were measured about the seat, the deviations already include the eccentricity
            if name == "b" and drive.value("tolerances.e_b"):
                notes.append(
                    "tolerances.e_b is added to the measured teeth, which is right only "
                    "if they were measured about their own centre"
                )
            # fields of the preset that the measured teeth replace
            composite, *harmonics = IN_TEETH[name]
            replaced = [composite] if is_overridden(composite, drive.origin.overrides) else []
            without_effect = (*replaced, *filter(drive.number, harmonics))
            notes += [f"{path} has no effect, because the teeth are measured" for path in without_effect]
            wheels[name] = MeasuredWheel(replace(pitch, notes=tuple(notes)), mark % 360)
        return MeasuredTeeth(**wheels) if wheels else None
