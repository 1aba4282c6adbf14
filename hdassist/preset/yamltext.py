"""Strict YAML text to plain data, with the place of every key and value.

A preset needs little of YAML, and a slip in a number must not pass unseen. So there are no anchors, aliases
and tags, a key stands once, and a plain scalar is read by the rules below and no others.
"""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple

import yaml

from hdassist.errors import Finding

MAX_BYTES = 256 * 1024
MAX_DEPTH = 20
MAX_DIGITS = 300  # a longer whole number is read as a float

Path = tuple[str | int, ...]


class Broken(Enum):
    """Stands for a value that could not be read; the finding about it is already there."""

    BROKEN = "broken"


BROKEN = Broken.BROKEN


class Mark(NamedTuple):
    """Line and column in a text, both counted from 1."""

    line: int
    column: int


@dataclass(frozen=True)
class Place:
    """Where a key and its value stand, and the value as it is written."""

    file: str
    key: Mark
    value: Mark
    text: str = ""
    quoted: bool = False


@dataclass
class Document:
    """What a text says: data, the place of each path, what is wrong, and whether it was read to its end."""

    data: Any = None
    places: dict[Path, Place] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    complete: bool = True


NUMBER = r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
_FLOAT = re.compile(NUMBER)
_INT = re.compile(r"[-+]?[0-9]+")
_CONSTANTS = {"": None, "~": None, "null": None, "true": True, "false": False}
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_SURROGATE = re.compile("[\ud800-\udfff]")


def resolve(text: str) -> Any:
    """Value of a plain scalar: nothing, true, false, a number, or else the text itself."""
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if _INT.fullmatch(text) and len(text) <= MAX_DIGITS:
        return int(text)
    return float(text) if _FLOAT.fullmatch(text) else text


def shown(text: str, width: int = 60) -> str:
    """Text on one line for a message: unprintable characters escaped, a long text shortened."""
    text = text if len(text) <= width else text[: width - 3] + "..."
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def read(text: bytes | str, file: str) -> Document:
    """Read YAML text; what is wrong with it ends up in the findings, nothing is raised.

    Arguments: text, as bytes in UTF-8 or as str; file, the name that findings bear.
    """
    document = Document()
    try:
        decoded = _decode(text)
        _Builder(document, file).run(decoded)
    except _EndError as end:
        document.findings.append(Finding(file, *end.mark, "", end.message, end.got, end.hint))
        document.complete = False
    return document


class _EndError(Exception):
    """Reading cannot go on behind this place."""

    def __init__(self, mark: Mark, message: str, got: str = "", hint: str = "") -> None:
        super().__init__(message)
        self.mark, self.message, self.got, self.hint = mark, message, got, hint


def _decode(text: bytes | str) -> str:
    data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    if len(data) > MAX_BYTES:
        raise _EndError(Mark(1, 1), f"the file is larger than {MAX_BYTES // 1024} KiB", hint="is this a preset?")
    data = data.removeprefix(BOM_UTF8)
    try:
        decoded = data.decode()
    except UnicodeDecodeError as error:
        before = data[: error.start].decode()
        raise _EndError(
            _mark_at_end(before),
            "not UTF-8 text",
            f"byte 0x{data[error.start]:02x}",
            "save the file as UTF-8",
        ) from None
    if found := _UNPRINTABLE.search(decoded):
        mark = _mark_at_end(decoded[: found.start()])
        raise _EndError(mark, "a control character, which YAML does not allow", shown(found.group()))
    return decoded


def _mark_at_end(text: str) -> Mark:
    lines = re.split(r"\r\n|[\n\r\x85\u2028\u2029]", text)
    return Mark(len(lines), len(lines[-1]) + 1)


class _Builder:
    """One pass over the events of the parser, building data and places and collecting findings."""

    def __init__(self, document: Document, file: str) -> None:
        self.document = document
        self.file = file
        self.last = Mark(1, 1)

    def run(self, text: str) -> None:
        events = self._events(text)
        documents = 0
        for event in events:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise _EndError(_mark(event.start_mark), "a second document", hint="one preset, one document")
                self.document.data = self._node(next(events), events, (), None, self.document.places)

    def _events(self, text: str) -> Iterator[yaml.Event]:
        try:
            for event in yaml.parse(text, Loader=yaml.SafeLoader):
                self.last = _mark(event.end_mark)
                yield event
        except yaml.MarkedYAMLError as error:
            raise _syntax_error(error, self.last) from None
        except (yaml.YAMLError, ValueError, OverflowError):  # the parser fails so on "\U99999999"
            raise _EndError(self.last, "not valid YAML", hint="a bad escape in a quoted text?") from None

    def _find(self, mark: Mark, path: Path, message: str, got: str = "", hint: str = "") -> None:
        self.document.findings.append(Finding(self.file, *mark, path_text(path), message, got, hint))

    def _node(
        self,
        event: yaml.Event,
        events: Iterator[yaml.Event],
        path: Path,
        key: Mark | None,
        places: dict[Path, Place],
    ) -> Any:
        mark = _mark(event.start_mark)
        value: Any
        text, quoted = "", False
        if isinstance(event, yaml.AliasEvent):
            self._find(mark, path, "aliases are not allowed", shown(f"*{event.anchor}"), "write the value out")
            places[path] = Place(self.file, key or mark, mark, f"*{event.anchor}")
            return BROKEN
        assert isinstance(event, yaml.ScalarEvent | yaml.SequenceStartEvent | yaml.MappingStartEvent)
        if len(path) >= MAX_DEPTH:
            raise _EndError(mark, f"nested deeper than {MAX_DEPTH} levels")
        if event.anchor is not None:
            self._find(mark, path, "anchors are not allowed", shown(f"&{event.anchor}"), "leave the anchor out")
        if event.tag is not None:
            tag = str(event.tag).replace("tag:yaml.org,2002:", "!!")
            self._find(mark, path, "tags are not allowed", shown(tag), "leave the tag out")
        if isinstance(event, yaml.ScalarEvent):
            value, text, quoted = self._scalar(event, path)
        elif isinstance(event, yaml.SequenceStartEvent):
            value, text = self._sequence(events, path, places), "a list"
        else:
            value, text = self._mapping(events, path, places), "a table of keys"
        places[path] = Place(self.file, key or mark, mark, text, quoted)
        return BROKEN if event.tag is not None else value

    def _scalar(self, event: yaml.ScalarEvent, path: Path) -> tuple[Any, str, bool]:
        text, quoted = str(event.value), event.style is not None
        if _SURROGATE.search(text):
            self._find(_mark(event.start_mark), path, "half of a surrogate pair is no character", shown(text))
            return BROKEN, text, quoted
        return (text if quoted else resolve(text)), text, quoted

    def _sequence(self, events: Iterator[yaml.Event], path: Path, places: dict[Path, Place]) -> list[Any]:
        items: list[Any] = []
        for event in events:
            if isinstance(event, yaml.SequenceEndEvent):
                break
            items.append(self._node(event, events, (*path, len(items)), None, places))
        return items

    def _mapping(self, events: Iterator[yaml.Event], path: Path, places: dict[Path, Place]) -> dict[str, Any]:
        table: dict[str, Any] = {}
        for event in events:
            if isinstance(event, yaml.MappingEndEvent):
                break
            mark = _mark(event.start_mark)
            known = len(self.document.findings)
            name = str(event.value) if isinstance(event, yaml.ScalarEvent) else ""
            scratch: dict[Path, Place] = {}
            key = self._node(event, events, (*path, name), mark, scratch)
            bad_key = len(self.document.findings) > known
            if not isinstance(event, yaml.ScalarEvent) and not bad_key:
                self._find(mark, path, "a key must be a single word", scratch[(*path, name)].text)
            if name in table:
                first = places[(*path, name)].key
                self._find(
                    mark,
                    (*path, name),
                    "duplicate key",
                    hint=f"first given in line {first.line}, column {first.column}",
                )
            keep = isinstance(event, yaml.ScalarEvent) and key is not BROKEN and name not in table
            value = self._node(next(events), events, (*path, name), mark, places if keep else {})
            if keep:
                table[name] = value
        return table


def _mark(mark: Any) -> Mark:
    return Mark(mark.line + 1, mark.column + 1) if mark is not None else Mark(1, 1)


def path_text(path: Path) -> str:
    """Path as messages write it: gears.z_g, operation.M_g[1]."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return shown(text.removeprefix("."), 80)


# What the parser says, and what it means to somebody who writes a preset.
_WORDS = (
    (
        "mapping values are not allowed",
        "a ':' where none can stand",
        "wrong indentation, or a text that needs quotes",
    ),
    ("could not find expected ':'", "a line without a ':' behind its key", ""),
    ("found character '\\t'", "a tab", "indent with spaces"),
    ("expected ',' or", "a bracket is not closed, or a comma is missing", ""),
    ("unexpected end of stream", "quotes are not closed", ""),
    ("expected the node content", "a value is missing, or a bracket stays open", ""),
    ("expected <block end>", "wrong indentation", "keys of one table start in the same column"),
    ("unknown escape character", "a bad escape in a quoted text", "single quotes take \\ as it is"),
    (
        "that cannot start any token",
        "a character that no plain text can start with",
        "put the text in quotes",
    ),
)


def _syntax_error(error: yaml.MarkedYAMLError, last: Mark) -> _EndError:
    problem = str(error.problem or error.context or "")
    at = error.problem_mark or error.context_mark
    mark = _mark(at) if at is not None else last
    begun = error.context_mark
    for start, message, hint in _WORDS:
        if start in problem:
            if "not closed" in message and begun is not None:
                hint = f"opened in line {begun.line + 1}, column {begun.column + 1}"
            return _EndError(mark, f"not valid YAML: {message}", hint=hint)
    return _EndError(mark, f"not valid YAML: {shown(problem, 100)}")
