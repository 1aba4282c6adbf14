"""Plain data of a preset to the values that `Drive` takes: units converted, scalars in lists, keys known."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from functools import cache
from math import isfinite
from typing import Any

from pydantic.fields import FieldInfo

from hdassist.preset.fields import Drive, Section, fields, is_number, is_optional, kind_of, sections, unit_of
from hdassist.preset.findings import MAX_FINDINGS, OVERRIDE, Findings, near
from hdassist.preset.spread import is_spread, read_spread
from hdassist.preset.units import UnitError, convert
from hdassist.preset.yamltext import BROKEN, Path, shown

Values = dict[str, Any]


@cache
def field_table() -> dict[str, FieldInfo]:
    """Path and declaration of each field that stands in a section."""
    return dict(fields())


class Converter:
    """Turns the data of one preset into values, noting what cannot be turned."""

    def __init__(self, findings: Findings) -> None:
        self.findings = findings
        self._spreads: dict[str, float] = {}  # given beside a value, by path

    def drive(self, data: dict[str, Any]) -> Values:
        """Values for `Drive`; what has a finding is left out."""
        tables = dict(sections())
        values: Values = {}
        for key, value in data.items():
            if key == "schema":
                continue
            if key not in Drive.model_fields:
                self._unknown((key,), value, ["schema", *Drive.model_fields])
            elif value is BROKEN:
                self.findings.bad.add((key,))
            elif key in tables:
                self._section(values, key, tables[key], value)
            elif key == "uncertainty":
                self._uncertainty(values, value)
            elif key == "alternatives":
                self._alternatives(values, value)
            elif key == "source":
                self._source(values, value)
            else:
                values[key] = value
        self._join_spreads(values)
        return values

    def _join_spreads(self, values: Values) -> None:
        """Put uncertainties that stand beside values to the others; of two, one on the command line wins."""
        for path, spread in self._spreads.items():
            table = values.setdefault("uncertainty", {})
            beside = self.findings.where(tuple(path.split(".")))[0] == OVERRIDE
            own = ("uncertainty", path)
            if path not in table or (beside and self.findings.where(own)[0] != OVERRIDE):
                table[path] = spread
            elif beside or self.findings.where(own)[0] != OVERRIDE:
                self.findings.add(own, "given twice", f"the value has an uncertainty of {spread:g} beside it")

    def _section(self, values: Values, name: str, model: type[Section], data: Any) -> None:
        if (table := self._table((name,), data)) is None:
            return
        section: Values = {}
        values[name] = section
        for key, value in table.items():
            path = (name, key)
            if key not in model.model_fields:
                self._unknown(path, value, list(model.model_fields))
            elif value is BROKEN:
                self.findings.bad.add(path)
            else:
                self._field(section, path, model.model_fields[key], value)

    def _field(self, section: Values, path: Path, info: FieldInfo, value: Any) -> None:
        kind, key = kind_of(info), str(path[-1])
        if value is None and is_optional(info):
            section[key] = None
        elif kind == "number" and isinstance(value, str) and is_spread(value):
            self._spread(section, path, value, unit_of(info))
        elif kind == "number":
            self._put(section, path, self.number, value, unit_of(info))
        elif kind == "count":
            self._put(section, path, self.count, value)
        elif kind in ("numbers", "holes") and value != "all":
            self._items(section, path, info, value)
        elif kind in ("limits", "orders"):
            self._limits(section, path, info, value)
        else:
            section[key] = value

    def _put(self, section: Values, path: Path, read: Callable[..., Any], value: Any, *unit: str) -> None:
        number = read(path, value, *unit)
        if number is not None:
            section[str(path[-1])] = number

    def _spread(self, section: Values, path: Path, text: str, unit: str) -> None:
        try:
            section[str(path[-1])], self._spreads[".".join(map(str, path))] = read_spread(text, unit)
        except UnitError as error:
            self.findings.add(path, error.message, error.hint)

    def _items(self, section: Values, path: Path, info: FieldInfo, value: Any) -> None:
        holes = kind_of(info) == "holes"
        items = value if isinstance(value, list) else [value]
        if value is None or isinstance(value, dict) or (holes and isinstance(value, str)):
            self.findings.add(path, "must be all, or a list of hole numbers" if holes else "must be a list of numbers")
            return
        numbers = []
        for index, item in enumerate(items):
            at = (*path, index) if isinstance(value, list) else path
            numbers.append(self.count(at, item) if holes else self.number(at, item, unit_of(info)))
        section[str(path[-1])] = tuple(numbers)  # an item that is no number has its finding already

    def _limits(self, section: Values, path: Path, info: FieldInfo, value: Any) -> None:
        orders, unit = kind_of(info) == "orders", unit_of(info)
        what, word = ("an order per cam turn", "order") if orders else ("a torque in N*m, or all", "torque")
        if not isinstance(value, dict):
            limit = self.number(path, value, unit)
            if limit is not None and orders:
                self.findings.add(path, "must be a table of orders per cam turn", "like {2: 10}")
            elif limit is not None:
                section[str(path[-1])] = {"all": limit}
            return
        limits: dict[str, float] = {}
        seen: set[float] = set()
        for key, item in value.items():
            at = (*path, key)
            fits = is_number(key) and (float(key) > 0 or not orders)
            if not fits and (orders or key != "all"):
                self.findings.add(at, f"must be {what}", got=self._key(key), key=True)
            elif fits and float(key) in seen:
                self.findings.add(at, f"the same {word} twice", got=self._key(key), key=True)
            elif (limit := self.number(at, item, unit)) is not None:
                limits[key] = limit
            if fits:
                seen.add(float(key))
        section[str(path[-1])] = limits

    def _uncertainty(self, values: Values, data: Any) -> None:
        if (table := self._table(("uncertainty",), data)) is None:
            return
        known = {path: info for path, info in field_table().items() if kind_of(info) == "number"}
        values["uncertainty"] = {}
        for key, value in table.items():
            path = ("uncertainty", key)
            if key not in known:
                if key in field_table():
                    self.findings.add(path, "only single measures have an uncertainty", "", self._key(key), key=True)
                else:
                    self.findings.add(path, "names no field", self._near_path(key, known), self._key(key), key=True)
            else:
                self._put(values["uncertainty"], path, self.number, value, unit_of(known[key]))

    def _alternatives(self, values: Values, data: Any) -> None:
        if not isinstance(data, list):
            if data is not None:
                self.findings.add(("alternatives",), "must be a list of tables", "like - {gears.j_n: 6.1}")
            return
        known = {path: info for path, info in field_table().items() if kind_of(info) == "number"}
        sets: list[Values] = []
        for index, item in enumerate(data):
            at: Path = ("alternatives", index)
            if (table := self._table(at, item)) is None:
                continue
            converted: Values = {}
            sets.append(converted)
            for key, value in table.items():
                if key not in known:
                    hint = self._near_path(key, known)
                    self.findings.add((*at, key), "names no measure of a preset", hint, self._key(key), key=True)
                else:
                    self._put(converted, (*at, key), self.number, value, unit_of(known[key]))
        values["alternatives"] = tuple(sets)

    def _source(self, values: Values, data: Any) -> None:
        if (table := self._table(("source",), data)) is None:
            return
        values["source"] = {}
        for key, value in table.items():
            path = ("source", key)
            if key not in field_table():
                self.findings.add(path, "names no field", self._near_path(key, field_table()), self._key(key), key=True)
            elif value is BROKEN:
                self.findings.bad.add(path)
            elif not isinstance(value, dict):
                self.findings.add(path, "must be a table of keys", "like {kind: given, ref: page 6}")
            else:
                entry = {k: v for k, v in value.items() if v is not BROKEN}
                self.findings.bad.update((*path, k) for k in value if k not in entry)
                values["source"][key] = entry

    def number(self, path: Path, value: Any, unit: str) -> float | None:
        """A number in a unit, from a number or a text with a unit; None with a finding if it is none."""
        if isinstance(value, str):
            try:
                return convert(value, unit)
            except UnitError as error:
                self.findings.add(path, error.message, error.hint)
                return None
        if isinstance(value, int | float) and not isinstance(value, bool):
            if isfinite(value):
                return value
            self.findings.add(path, "must be a finite number")
        elif value is BROKEN:
            self.findings.bad.add(path)
        else:
            self.findings.add(path, "must be a number", self._instead(path, value) or (f"in {unit}" if unit else ""))
        return None

    def count(self, path: Path, value: Any) -> int | None:
        """A whole number; None with a finding if it is none."""
        if isinstance(value, str):
            try:
                convert(value, "")
            except UnitError as error:
                message = error.message.replace("a number", "a whole number").replace("a pure", "a whole")
                self.findings.add(path, message, error.hint)
                return None
        if isinstance(value, int | float) and not isinstance(value, bool):
            if isfinite(value) and value == int(value):
                return int(value)
            self.findings.add(path, "must be a whole number")
        elif value is BROKEN:
            self.findings.bad.add(path)
        else:
            self.findings.add(path, "must be a whole number", self._instead(path, value))
        return None

    def _instead(self, path: Path, value: Any) -> str:
        info = field_table().get(".".join(map(str, path)))
        optional = info is not None and not info.is_required()
        return f"leave the key out for its default, {info.default}" if value is None and info and optional else ""

    def _table(self, path: Path, data: Any) -> dict[str, Any] | None:
        """The data as a table; an empty key counts as an empty table."""
        if data is None:
            return {}
        if not isinstance(data, dict):
            self.findings.add(path, "must be a table of keys")
            return None
        return data

    def _unknown(self, path: Path, value: Any, options: list[str]) -> None:
        many = len(self.findings.items) > MAX_FINDINGS
        hint = "" if many else self._unknown_hint(path, value, options)
        self.findings.add(path, "unknown key", hint, "", key=True)

    def _unknown_hint(self, path: Path, value: Any, options: list[str]) -> str:
        key = str(path[-1])
        if value is None and ":" in key:
            return "a space is missing behind the colon"
        if value is None and key.replace(".", "").isdigit():
            return "a comma in a number? write a decimal point"
        for section, model in sections():
            if key in model.model_fields:
                return f"{key} belongs to {section}"
        return near(key, options) or f"known: {', '.join(options)}"

    def _near_path(self, key: str, known: dict[str, FieldInfo]) -> str:
        whole = next((path for path in known if path.split(".")[1] == key.split(".")[-1]), "")
        if whole:
            return f"did you mean {whole}?"
        close = difflib.get_close_matches(key[:60], known, 1, 0.7)
        return f"did you mean {close[0]}?" if close else "write section.key, like gears.z_g"

    def _key(self, key: str) -> str:
        return shown(key) or "nothing"
