"""What a file of pitch deviations means: form, unit, senses, mark and flank, from its comments, names and arguments."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from hdassist.preset.units import UnitError
from hdassist.preset.yamltext import Mark, near
from hdassist.readers.pitchwords import AMBIGUOUS, KEYS, flank_in, form_in, micrometres, names_teeth, unit_in
from hdassist.readers.table import NumberTable

HOW = 'write a comment line above the rows, like "# form: cumulative" or "# form: single"'


@dataclass(frozen=True)
class Settings:
    """How to read a table: in which columns tooth numbers and deviations stand, and what these mean.

    scale: size of the unit in um; mark: number of the tooth with the mark, None if nobody says; mark_at: its place.
    """

    teeth_in: int
    deviation_in: int
    form: str
    unit: str
    scale: float
    sense: str
    sign: str
    mark: int | None
    mark_at: Mark
    flank: str


class _Statement(NamedTuple):
    value: str
    text: str
    mark: Mark


@dataclass
class _Settler:
    table: NumberTable
    asked: dict[str, str]
    notes: list[str]
    stated: dict[str, list[_Statement]] = field(default_factory=lambda: {key: [] for key in KEYS})

    def entries(self) -> None:
        keys = {word: key for key, (words, _, _) in KEYS.items() for word in words}
        for entry in self.table.entries:
            key = keys.get(entry.key)
            if key is not None:
                self.stated[key].append(_Statement(KEYS[key][1](entry.value), entry.value, entry.mark))
            elif hint := near(entry.key, keys):
                self.notes.append(f'line {entry.mark.line}: "{entry.key}" is passed over; {hint}')

    def value(self, key: str, default: str = "", if_none: str = "") -> str:
        """Value of a key: as asked for, else as the file states it, else the default with its note."""
        stated, asked = self.stated[key], self.asked.get(key)
        if asked is not None:
            other = next((s.text for s in stated if s.value != asked), None)
            if other is not None:
                self.notes.append(f"{key} {asked} as asked for; the file says {other}")
            return asked
        for statement in stated:
            if not statement.value:
                self._refuse(key, statement, f"must be {KEYS[key][2]}")
                return default
            if statement.value != stated[0].value:
                hint = f"line {stated[0].mark.line} says {stated[0].text}; keep one of them"
                self._refuse(key, statement, "stated twice, and not the same", hint)
                return default
        if not stated and if_none:
            self.notes.append(if_none)
        return stated[0].value if stated else default

    def _refuse(self, key: str, statement: _Statement, message: str, hint: str = "") -> None:
        self.table.add(*statement.mark, key, message, statement.text or "nothing", hint)

    def column(self) -> tuple[int, int]:
        """Columns of the tooth numbers and of the deviations; states what the name of the latter says."""
        names, width = self._names()
        teeth = [index for index, name in enumerate(names) if names_teeth(name)]
        first = teeth[0] if len(teeth) == 1 else 0
        others = [index for index in range(width) if index != first]
        for key, meaning in (("flank", flank_in), ("form", form_in)):
            wanted = self.asked.get(key) or next((s.value for s in self.stated[key]), "")
            if wanted and len(others) > 1 and names:
                others = [index for index in others if meaning(names[index]) == wanted] or others
        chosen = others[0] if others else first
        if len(others) > 1:
            self._several(names, others)
        elif names:
            self._name_says(names[chosen])
        return first, chosen

    def _names(self) -> tuple[tuple[str, ...], int]:
        table = self.table
        if table.names_in_comment and not any(map(names_teeth, table.names)):
            table.names = ()  # a remark with as many words as there are columns
        return table.names, len(table.rows[0].numbers) if table.rows else 0

    def _several(self, names: tuple[str, ...], columns: list[int]) -> None:
        shown = " and ".join(f'"{self.table.name(column)}"' for column in columns)
        if names and len({flank_in(names[column]) for column in columns}) > 1:
            hint = "ask for one flank: flank left or right"
        elif names and len({form_in(names[column]) for column in columns}) > 1:
            hint = "ask for one form: form cumulative or form single"
        else:
            hint = "name the columns in a line above the rows (left, right), or keep one of them"
        line = self.table.names_line if names else self.table.rows[0].line
        self.table.add(line, 1, "", f"{len(columns)} columns of deviations", shown, hint)

    def _name_says(self, name: str) -> None:
        place = Mark(self.table.names_line, 1)
        for key, value in (("form", form_in(name)), ("flank", flank_in(name)), ("unit", unit_in(name))):
            if value == AMBIGUOUS:
                if not self.stated[key] and key not in self.asked:
                    self.table.add(*place, key, "single pitch deviations, or cumulative ones?", name, HOW)
            elif value:
                self.stated[key].append(_Statement(value, name, place))

    def unit(self) -> tuple[str, float]:
        """Unit as it is written, and its size in um."""
        sizes: list[float] = []
        for statement in self.stated["unit"]:
            try:
                sizes.append(micrometres(statement.value))
            except UnitError as error:
                self._refuse("unit", statement, error.message, error.hint)
                return "um", 1.0
        if not sizes:
            self.notes.append("no unit given: um")
            return "um", 1.0
        if len(set(sizes)) > 1:
            self._refuse("unit", self.stated["unit"][-1], "stated twice, and not the same", "keep one of them")
        return self.stated["unit"][0].value, sizes[0]


def settle(table: NumberTable, asked: dict[str, str], notes: list[str]) -> Settings:
    """Find out what a table of pitch deviations means.

    Arguments: table, to whose findings is added what is wrong; asked, values by key that win over the file;
    notes, to which is added what was assumed. Result: the settings; of no use if there are findings.
    """
    settler = _Settler(table, asked, notes)
    sound = not table.findings
    settler.entries()
    teeth_in, deviation_in = settler.column() if sound else (0, 0)
    unit, scale = settler.unit()
    form = settler.value("form", "cumulative", "no form given: cumulative deviations")
    sense = settler.value("sense", "ccw", "no sense given: numbered counter-clockwise, seen from the cam side")
    sign, flank = settler.value("sign", "along"), settler.value("flank")
    mark = settler.value("mark")
    mark_at = next((statement.mark for statement in settler.stated["mark"]), Mark(1, 1))
    return Settings(teeth_in, deviation_in, form, unit, scale, sense, sign, int(mark) if mark else None, mark_at, flank)
