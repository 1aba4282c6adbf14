"""Reading of presets: plain data from strict YAML, with the position of every key and value, and numbers with units.

A preset needs only a small part of YAML, and an error in a number must not remain unnoticed. Anchors, aliases and tags
are therefore not allowed, each key occurs once, and plain scalars are read only by the rules below. A number may have a
unit, as in "75 um", and an uncertainty, as in "260 ± 10 deg". Conversion is decimal and rounds once, so "75 um" and
0.075 are the same number.
"""

import difflib
import re
from codecs import BOM_UTF8
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from decimal import Decimal
from math import isfinite, isinf
from typing import Any, NamedTuple

import yaml

from hdassist.run.errors import Finding, PresetError
from hdassist.run.files import GREATEST, NUMBER, bounded, escaped, package_table

MOST_PRESET_BYTES = 256 * 1024
MAX_DEPTH = 20
_MAX_DIGITS = 300  # maximum number of digits of an integer; a longer one is read as a float
MAX_FINDINGS = 100
OVERRIDE = "--set"  # replaces the file in findings on overrides

Path = tuple[str | int, ...]


@dataclass(frozen=True)
class InvalidValueError(ValueError):
    """A value that cannot be read: message, hint, and whether its key is at fault."""

    message: str
    hint: str = ""
    at_key: bool = False


class Mark(NamedTuple):
    """Line and column in a text, both counted from 1."""

    line: int
    column: int


@dataclass(frozen=True)
class SourceSpan:
    """The positions of a key and its value, and the value as written."""

    file: str
    key: Mark
    value: Mark
    text: str = ""
    quoted: bool = False


@dataclass
class Document:
    """A text as read.

    file: name of the text in findings.
    data: plain data, None if reading stopped before its end.
    places: position of the key and value of each path.
    findings: faults.
    warnings: warnings.
    bad: paths whose values are invalid.
    """

    file: str
    data: Any = None
    places: dict[Path, SourceSpan] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    warnings: list[Finding] = field(default_factory=list)
    bad: set[Path] = field(default_factory=set)

    def add(
        self,
        path: Path,
        message: str,
        hint: str = "",
        got: str | None = None,
        key: bool = False,
    ) -> None:
        """Add a finding on a value or its key, and mark the path as invalid.

        path: path of the value.
        message: description of the fault.
        hint: remedy.
        got: text in question, None for the value as written.
        key: whether the key is at fault.
        """
        self.bad.add(path)
        self.findings.append(self._finding(path, message, hint, self.written(path) if got is None else got, key))

    def warn(
        self,
        path: Path,
        message: str,
        hint: str,
    ) -> None:
        """Add a warning on a key."""
        self.warnings.append(
            self._finding(
                path,
                message,
                hint,
                "",
                key=True,
            )
        )

    def _finding(
        self,
        path: Path,
        message: str,
        hint: str,
        got: str,
        key: bool,
    ) -> Finding:
        file, mark = self.where(path, key)
        return Finding(
            file=file,
            line=mark.line,
            column=mark.column,
            path=path_text(path),
            message=message,
            got=got,
            hint=hint,
        )

    def refuse(self, path: Path, fault: InvalidValueError) -> None:
        """Add a finding on a value that cannot be read."""
        if path not in self.places:
            path = path[:2]  # the only item of a list, or the limit for all torques, may be written as a single value
        got = (shown(str(path[-1])) or "nothing") if fault.at_key else None
        self.add(
            path,
            fault.message,
            fault.hint,
            got,
            key=fault.at_key,
        )

    def where(self, path: Path, key: bool = False) -> tuple[str, Mark]:
        """Return the file and position of a value or key, or those of the nearest table that contains it."""
        while path and path not in self.places:
            path = path[:-1]
            key = True
        if not path:
            return self.file, Mark(1, 1)
        place = self.places[path]
        return place.file, place.key if key else place.value

    def is_override(self, path: Path) -> bool:
        """Return whether a value, or the nearest table that contains it, was given on the command line."""
        return self.where(path)[0] == OVERRIDE

    def written(self, path: Path) -> str:
        """Return the value of a path as written, empty if it is not given."""
        place = self.places.get(path)
        if place is None:
            return ""
        text = shown(place.text)
        return f'"{text}"' if place.quoted else text or "nothing"


_FLOAT = re.compile(NUMBER)
_INT = re.compile(r"[-+]?[0-9]+")
_CONSTANTS = {"": None, "~": None, "null": None, "true": True, "false": False}
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_SURROGATE = re.compile("[\ud800-\udfff]")


def scalar_value(text: str) -> Any:
    """Return the value of a plain scalar: None, True, False, a number, or the text itself if it is none of these."""
    # the rules are those of YAML 1.2, in which yes, no and on are texts
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    # conversion of a longer integer would take quadratic time
    if _INT.fullmatch(text) and len(text) <= _MAX_DIGITS:
        return int(text)
    return float(text) if _FLOAT.fullmatch(text) else text


def shown(text: str, width: int = 60) -> str:
    """Return a text on one line for a message, with unprintable characters escaped, and shortened if it is long."""
    # a message must be a single line
    text = text if len(text) <= width else text[: width - 3] + "..."
    return "".join(c if c.isprintable() else escaped(c) for c in text)


def read_yaml(
    text: bytes | str,
    file: str,
    path: Path = (),
    at: Callable[[int, int], Mark] = Mark,
) -> Document:
    """Return the document in a YAML text. Faults are added to its findings instead of being raised.

    text: bytes in UTF-8, or str.
    file: name of the text in findings.
    path: path of the value contained in the text.
    at: function that returns the position of a line and column of the text.
    """
    document = Document(file)
    try:
        _Reader(document, at, at(1, 1)).read(text, path)
    except PresetError as end:
        # faults found before reading stopped
        document.findings += end.findings
        document.bad.add(())
    return document


@dataclass
class _Reader:
    """A reader that builds data and positions in one pass over the parser's events, and collects findings.

    Composing nodes first would give less information: an incomplete text has no nodes, and an alias has no position.
    """

    document: Document
    mark_at: Callable[[int, int], Mark]
    last: Mark  # position of the parser

    def read(self, text: bytes | str, path: Path) -> None:
        """Read a text to its end. Raises PresetError if reading cannot continue."""
        self.events = self._parsed(self._decoded(text))
        for event in self.events:
            if isinstance(event, yaml.DocumentStartEvent):
                # the first document is complete, and a file describes one drive
                if self.document.places:
                    raise self._end(
                        self._mark(event.start_mark), "a second document", hint="write one document per preset"
                    )
                self.document.data = self._value(next(self.events), path)

    def _decoded(self, text: bytes | str) -> str:
        # a text from the command line may contain half of a surrogate pair
        data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
        if len(data) > MOST_PRESET_BYTES:
            message = f"the file is larger than {MOST_PRESET_BYTES // 1024} KiB"
            raise self._end(self.last, message, hint="check that the file is a preset")
        # Windows editors write a byte order mark
        data = data.removeprefix(BOM_UTF8)
        try:
            decoded = data.decode()
        except UnicodeDecodeError as error:
            mark = self._behind(data[: error.start].decode())
            got = f"byte 0x{data[error.start]:02x}"
            raise self._end(mark, "not UTF-8 text", got, "save the file as UTF-8") from None
        # PyYAML would reject it without line and column
        if control := _UNPRINTABLE.search(decoded):
            mark = self._behind(decoded[: control.start()])
            raise self._end(mark, "a control character, which YAML does not allow", shown(control.group()))
        return decoded

    def _behind(self, text: str) -> Mark:
        # lines end at all line ends that YAML recognises
        lines = re.split(r"\r\n|[\n\r\x85\u2028\u2029]", text)
        return self.mark_at(len(lines), len(lines[-1]) + 1)

    def _mark(self, mark: Any) -> Mark:
        return self.mark_at(mark.line + 1, mark.column + 1)

    def _end(
        self,
        mark: Mark,
        message: str,
        got: str = "",
        hint: str = "",
    ) -> PresetError:
        finding = Finding(
            file=self.document.file,
            line=mark.line,
            column=mark.column,
            path="",
            message=message,
            got=got,
            hint=hint,
        )
        return PresetError([finding])

    def _parsed(self, text: str) -> Iterator[Any]:
        try:
            for event in yaml.parse(text, Loader=yaml.SafeLoader):
                self.last = self._mark(event.end_mark)
                yield event
        except (yaml.YAMLError, ValueError, OverflowError) as error:  # "\U99999999" does not raise a YAMLError
            raise self._syntax_error(error) from None

    def _until(self, end: type[yaml.Event]) -> Iterator[Any]:
        while not isinstance(event := next(self.events), end):
            yield event

    def _value(
        self,
        event: Any,
        path: Path,
        key: Mark | None = None,
    ) -> Any:
        """Return the value that begins with an event.

        event: first event of the value.
        path: path of the value.
        key: position of its key, None if it has no key.
        """
        mark = self._mark(event.start_mark)
        # the depth is limited so that recursion does not overflow the stack
        if len(path) >= MAX_DEPTH:
            raise self._end(mark, f"nested deeper than {MAX_DEPTH} levels")
        # aliases could expand without bound, and a preset does not need them
        self._refuse_extras(event, mark, path)
        text = ""
        quoted = False
        value: Any = None
        if isinstance(event, yaml.AliasEvent):
            text = f"*{event.anchor}"
        # nested values have positions of their own, stored by their paths
        if isinstance(event, yaml.SequenceStartEvent):
            items = enumerate(self._until(yaml.SequenceEndEvent))
            value = [self._value(item, (*path, index)) for index, item in items]
            text = "a list"
        elif isinstance(event, yaml.MappingStartEvent):
            value = self._table(path)
            text = "a table of keys"
        elif isinstance(event, yaml.ScalarEvent):
            text = str(event.value)
            # a scalar in quotes is always a text, even "null" or "20"
            quoted = event.style is not None
            if _SURROGATE.search(text):
                self._find(mark, path, "half of a surrogate pair is not a character", shown(text))
                self.document.bad.add(path)
            else:
                value = text if quoted else scalar_value(text)
        self.document.places[path] = SourceSpan(
            file=self.document.file, key=key or mark, value=mark, text=text, quoted=quoted
        )
        return value

    def _refuse_extras(
        self,
        event: Any,
        mark: Mark,
        path: Path,
    ) -> None:
        """Add findings on aliases, anchors and tags, which are not allowed in presets."""
        if isinstance(event, yaml.AliasEvent):
            alias = shown(f"*{event.anchor}")
            self._find(mark, path, "YAML aliases are not allowed", alias, "write the value out")
            self.document.bad.add(path)
        elif event.anchor is not None:
            self._find(mark, path, "YAML anchors are not allowed", shown(f"&{event.anchor}"), "leave the anchor out")
        tag = getattr(event, "tag", None)
        if tag:
            short_tag = shown(str(tag).replace("tag:yaml.org,2002:", "!!"))
            self._find(mark, path, "YAML tags are not allowed", short_tag, "leave the tag out")

    def _table(self, path: Path) -> dict[str, Any]:
        table: dict[str, Any] = {}
        for event in self._until(yaml.MappingEndEvent):
            mark = self._mark(event.start_mark)
            name = str(getattr(event, "value", ""))
            item_path = (*path, name)
            # YAML silently uses the last value of a repeated key, which hides an error
            if name in table:
                first = self.document.places[item_path].key
                hint = f"it is given first in line {first.line}, column {first.column}"
                self._find(mark, item_path, "duplicate key", hint=hint)
            key = self._value(event, item_path, mark)
            value = self._value(next(self.events), item_path, mark)
            if isinstance(key, list | dict):
                self._find(mark, path, "a key must be a single word", hint="a text or a number")
            elif not _SURROGATE.search(name):
                table[name] = value  # the last value of a repeated key applies, whose position is stored
        return table

    def _find(
        self,
        mark: Mark,
        path: Path,
        message: str,
        got: str = "",
        hint: str = "",
    ) -> None:
        finding = Finding(
            file=self.document.file,
            line=mark.line,
            column=mark.column,
            path=path_text(path),
            message=message,
            got=got,
            hint=hint,
        )
        self.document.findings.append(finding)

    def _syntax_error(self, error: Exception) -> PresetError:
        # position at which an unclosed bracket or quote begins
        begun = getattr(error, "context_mark", None)
        error_mark = getattr(error, "problem_mark", None) or begun
        problem = str(getattr(error, "problem", None) or getattr(error, "context", None) or error)
        unnamed = (shown(problem, 100), "")
        message, hint = next((description for start, description in _WORDS.items() if start in problem), unnamed)
        if "not closed" in message and begun is not None:
            opened = self._mark(begun)
            hint = f"opened in line {opened.line}, column {opened.column}"
        return self._end(
            self._mark(error_mark) if error_mark else self.last,
            f"not valid YAML: {message}",
            hint=hint,
        )


def path_text(path: Path) -> str:
    """Return a path in the notation of messages: gears.z_g, operation.M_g[1]."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return shown(text.removeprefix("."), 80)


# Messages of the parser, and the messages and hints that replace them
_WORDS = {
    "mapping values are not allowed": (
        "a ':' in a place where it is not allowed",
        "wrong indentation, or a text that needs quotes",
    ),
    "could not find expected ':'": ("a line without a ':' after its key", ""),
    "found character '\\t'": ("a tab", "indent with spaces"),
    "expected ',' or": ("a bracket is not closed, or a comma is missing", ""),
    "unexpected end of stream": ("quotes are not closed", ""),
    "expected the node content": ("a value is missing, or a bracket is not closed", ""),
    "expected <block end>": ("wrong indentation", "start the keys of a table in the same column"),
    "chr() arg": ("a bad escape in a quoted text", ""),
    "int too large": ("a bad escape in a quoted text", ""),
    "unknown escape character": ("a bad escape in a quoted text", "use single quotes for a literal \\"),
    "that cannot start any token": ("a character with which unquoted text cannot start", "put the text in quotes"),
}


def ordered_findings(items: Iterable[Finding]) -> list[Finding]:
    """Return the findings in the order of the file, followed by those on overrides, limited to one hundred."""
    ordered = sorted(items, key=lambda f: (f.file == OVERRIDE, f.line, f.column))
    if len(ordered) > MAX_FINDINGS:
        last = ordered[MAX_FINDINGS]
        unlisted = len(ordered) - MAX_FINDINGS
        ordered[MAX_FINDINGS:] = [
            Finding(
                file=last.file,
                line=last.line,
                column=last.column,
                path="",
                message=f"and {unlisted} more",
            )
        ]
    return ordered


def near_miss(word: str, options: Iterable[str]) -> str:
    """Return a hint that names the option most similar to a word, or an empty text if none is similar.

    Among options that are equally similar without regard to case, the one with the most similar case is named.
    """
    options_by_spelling = {option.lower(): option for option in options}
    word = word[:60]

    def likeness(option: str) -> tuple[float, float]:
        pairs = ((option, word.lower()), (options_by_spelling[option], word))
        return (difflib.SequenceMatcher(None, *pairs[0]).ratio(), difflib.SequenceMatcher(None, *pairs[1]).ratio())

    close = difflib.get_close_matches(word.lower(), options_by_spelling, 3, 0.6)
    return f"the nearest name is {options_by_spelling[max(close, key=likeness)]}" if close else ""


# --- numbers with their units

_TABLE = package_table("drive/preset/units.toml", parse_float=Decimal)
_SPELLINGS = str.maketrans(_TABLE.pop("spellings"))
_ALIASES: dict[str, str] = _TABLE.pop("aliases")
# by dimension: hints for units that could be mistaken for another one
_MISTAKEN: dict[str, dict[str, str]] = {dimension: units.pop("mistaken", {}) for dimension, units in _TABLE.items()}
_LISTED = {unit: (dimension, size) for dimension, units in _TABLE.items() for unit, size in units.items()}
_UNITS: dict[str, tuple[str, Decimal]] = _LISTED | {alias: _LISTED[unit] for alias, unit in _ALIASES.items()}

_SPLIT = re.compile(rf"({NUMBER})\s*(.*)", re.DOTALL)
_SIGN = r"(?:±|\+/-|\+-)"
_SPREAD = re.compile(rf"(.*?)\s*{_SIGN}\s*(.*)", re.DOTALL)
_NOT_FINITE = re.compile(r"[-+]?\.?(nan|inf|infinity)", re.IGNORECASE)
_SMALLEST = 1e-290
_LONGEST_NUMBER = (
    400  # maximum length of a number with its unit and uncertainty; matching time grows faster than linearly
)


class UnitError(InvalidValueError):
    """A text that is not a number in a suitable unit."""


def convert(text: str, unit: str) -> float:
    """Return a number, converted to the unit of the field, from a text with a unit.

    text: text such as "75 um".
    unit: unit of the field, empty for a pure number.
    Raises UnitError if the text is not a finite number, has no unit, or has an unsuitable unit.
    """
    match = _matched(_SPLIT, text)
    if match is None:
        raise _no_number(text.strip(), unit)
    number = match[1]
    unit_name = _normal(match[2])
    if unit_name == "":
        raise UnitError("must be a number, not text", "leave out the quotes")
    value = float(number)
    if isinf(bounded(value)):
        raise UnitError("must be a finite number" if isinf(value) else f"must be a number up to {GREATEST:g}")
    if looks := re.match(r"[:,_0-9]", unit_name):
        raise _no_number(text.strip(), unit, looks[0])
    factor = _factor(unit_name, unit)
    if abs(value) < _SMALLEST:
        return value * float(factor)
    return float(Decimal(number) * factor)


def _matched(pattern: re.Pattern[str], text: str) -> re.Match[str] | None:
    """Return the match of a complete text, or None if it does not match or is too long for a number."""
    return pattern.fullmatch(text.strip()) if len(text.strip()) <= _LONGEST_NUMBER else None


def is_spread(text: str) -> bool:
    """Return whether a text contains a sign of an uncertainty (±)."""
    return _matched(_SPREAD, text) is not None


def read_spread(text: str, unit: str) -> tuple[float, float]:
    """Return a number and its expanded uncertainty (k = 2), both in the unit of the field.

    If only one of the two has a unit, it applies to both. If neither has a unit, that of the field applies.

    text: text such as "260±10", "75 ± 5 um" or "1.2 deg +- 3 arcmin".
    unit: unit of the field.
    Raises UnitError if the text does not have this form.
    """
    match = _matched(_SPREAD, text)
    if match is None:
        raise UnitError("must be a number with its uncertainty", "use, for example, 260 ± 10")
    units = [number[2] if (number := _SPLIT.fullmatch(part)) else "" for part in match.groups()]
    common = units[0] or units[1]
    value, spread = (
        convert(part if has_unit else f"{part} {common}", unit)
        if common or not re.fullmatch(NUMBER, part)
        else float(part)
        for part, has_unit in zip(match.groups(), units, strict=True)
    )
    if match[2].startswith(("-", "+")):
        raise UnitError("the uncertainty has a sign", "write the uncertainty without a sign, as in 260 ± 10")
    if not (isfinite(bounded(value)) and isfinite(bounded(spread))):
        is_huge = isfinite(value) and isfinite(spread)
        raise UnitError(f"must be a number up to {GREATEST:g}" if is_huge else "must be a finite number")
    return value, spread


def read_number(
    value: Any,
    unit: str,
    *,
    spread: bool = False,
) -> float:
    """Return a number in a unit from a value of a preset, which is a number or a text with a unit.

    value: value in the preset.
    unit: unit of the result.
    spread: whether a text may include an uncertainty, which is not returned.
    Raises InvalidValueError if the value is not such a number.
    """
    if isinstance(value, str):
        return read_spread(value, unit)[0] if spread and is_spread(value) else convert(value, unit)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidValueError("must be a number", f"write a number in {unit}" if unit else "")
    if not isfinite(value):
        raise InvalidValueError("must be a finite number")
    if not abs(value) <= GREATEST:
        raise InvalidValueError(f"must be a number up to {GREATEST:g}")
    return value


def read_count(value: Any) -> int:
    """Return an integer from a value of a preset. Raises InvalidValueError if it is not a whole number."""
    try:
        number = read_number(value, "")
    except InvalidValueError as fault:
        message = fault.message.replace("a number", "a whole number").replace("pure", "whole")
        raise replace(fault, message=message) from None
    if number % 1:
        raise InvalidValueError("must be a whole number")
    return int(number)


def units_for(unit: str) -> tuple[str, ...]:
    """Return all units that convert to the given one, for messages; empty for a pure number."""
    return tuple(
        unit_of_dimension
        for unit_of_dimension, (dimension, _) in _LISTED.items()
        if unit and dimension == _UNITS[unit][0]
    )


def _normal(unit: str) -> str:
    unit = re.sub(r"\s*([*/^])\s*", r"\1", unit.translate(_SPELLINGS).strip())
    return re.sub(r"\s+", " ", unit.replace("^2", "2").replace("**", "*"))


def _factor(given: str, unit: str) -> Decimal:
    if not unit:
        raise UnitError("must be a number without a unit")
    dimension, own_size = _UNITS[unit]
    unit_dimension, size = _UNITS.get(given, ("", own_size))
    if unit_dimension == dimension:
        return size / own_size
    shown_unit = shown(given, 30)
    if hint := _MISTAKEN[dimension].get(given):
        raise UnitError(f"the unit {shown_unit} is ambiguous", hint)
    fitting = f"use one of {', '.join(units_for(unit))}; a number without a unit is in {unit}"
    if unit_dimension:
        raise UnitError(f"{shown_unit} is a unit of {unit_dimension}; expected a unit of {dimension}", fitting)
    raise UnitError(f"unknown unit {shown_unit}", near_miss(given[:30], units_for(unit)) or fitting)


def _no_number(
    text: str,
    unit: str,
    sign: str = "",
) -> UnitError:
    if _NOT_FINITE.fullmatch(text.split(" ")[0]):
        return UnitError("must be a finite number")
    if sign == "," or re.fullmatch(r"[-+]?[0-9]+,[0-9]+.*", text):
        hint = "use a point, not a comma, as the decimal separator, and no thousands separator"
        return UnitError("must be a number", hint)
    if sign == "_":
        return UnitError("must be a number", "write the number without underscores")
    if text.startswith("\u2212"):
        return UnitError("must be a number", "write an ASCII minus sign")
    return UnitError("must be a number", f"write a number in {unit}" if unit else "")
