"""Strict YAML text to plain data, with line and column of every key and value, and findings.

A preset needs little of YAML, and a slip in a number must not pass unseen. So there are no anchors, aliases
and tags, a key stands once, and a plain scalar is read by the rules below and no others.
"""

import difflib
import re
from codecs import BOM_UTF8
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import yaml

from hdassist.errors import Finding, PresetError
from hdassist.plaintext import NUMBER, escaped

MOST_PRESET_BYTES = 256 * 1024
MAX_DEPTH = 20
MAX_DIGITS = 300  # digits: a longer integer is read as a float
MAX_FINDINGS = 100
OVERRIDE = "--set"  # stands for the file in findings on overrides

Path = tuple[str | int, ...]


@dataclass(frozen=True)
class InvalidValueError(ValueError):
    """A value that cannot be read: message, hint, and whether the key is at fault."""

    message: str
    hint: str = ""
    at_key: bool = False


class Mark(NamedTuple):
    """Line and column in a text, both counted from 1."""

    line: int
    column: int


@dataclass(frozen=True)
class SourceSpan:
    """Where a key and its value stand, and the value as it is written."""

    file: str
    key: Mark
    value: Mark
    text: str = ""
    quoted: bool = False


@dataclass
class Document:
    """A text as it was read: data, None where it breaks off; place of each path, findings, warnings.

    file: its name in findings; bad: paths whose values are not to be used.
    """

    file: str
    data: Any = None
    places: dict[Path, SourceSpan] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    warnings: list[Finding] = field(default_factory=list)
    bad: set[Path] = field(default_factory=set)

    def add(self, path: Path, message: str, hint: str = "", got: str | None = None, key: bool = False) -> None:
        """Add a finding on a value or its key, and mark the path as bad; got: the value as written by default."""
        self.bad.add(path)
        self.findings.append(self._finding(path, message, hint, self.written(path) if got is None else got, key))

    def warn(self, path: Path, message: str, hint: str) -> None:
        """Add a warning on a key."""
        self.warnings.append(self._finding(path, message, hint, "", key=True))

    def _finding(self, path: Path, message: str, hint: str, got: str, key: bool) -> Finding:
        file, mark = self.where(path, key)
        return Finding(file, *mark, path_text(path), message, got, hint)

    def refuse(self, path: Path, fault: InvalidValueError) -> None:
        """Add the finding on a value that cannot be read."""
        if path not in self.places:
            path = path[:2]  # the only item of a list, or the limit for all torques, written as one value
        got = (shown(str(path[-1])) or "nothing") if fault.at_key else None
        self.add(path, fault.message, fault.hint, got, key=fault.at_key)

    def where(self, path: Path, key: bool = False) -> tuple[str, Mark]:
        """File and place of a value or key; of the nearest table around it where it is not given."""
        while path and path not in self.places:
            path, key = path[:-1], True
        if not path:
            return self.file, Mark(1, 1)
        place = self.places[path]
        return place.file, place.key if key else place.value

    def is_override(self, path: Path) -> bool:
        """Whether a value, or the nearest table around it, is of the command line."""
        return self.where(path)[0] == OVERRIDE

    def written(self, path: Path) -> str:
        """Value of a path as it is written; empty if it is not given."""
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
    """Value of a plain scalar: None, true, false, a number, or else the text itself."""
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if _INT.fullmatch(text) and len(text) <= MAX_DIGITS:
        return int(text)
    return float(text) if _FLOAT.fullmatch(text) else text


def shown(text: str, width: int = 60) -> str:
    """Text on one line for a message: unprintable characters escaped, a long text shortened."""
    text = text if len(text) <= width else text[: width - 3] + "..."
    return "".join(c if c.isprintable() else escaped(c) for c in text)


def read_yaml(text: bytes | str, file: str, path: Path = (), at: Callable[[int, int], Mark] = Mark) -> Document:
    """Read YAML text; faults are added to the findings of the document, none is raised.

    Arguments: text, as bytes in UTF-8 or as str; file, the name that findings bear; path of the value that the text is
    of; at, the place of a line and column of the text.
    """
    document = Document(file)
    try:
        _Reader(document, at, at(1, 1)).read(text, path)
    except PresetError as end:
        document.findings += end.findings
        document.bad.add(())
    return document


@dataclass
class _Reader:
    """One pass over the events of the parser, building data and places and collecting findings.

    Nodes composed first would come with less: a text that breaks off has none, and an alias in it has no place.
    """

    document: Document
    at: Callable[[int, int], Mark]
    last: Mark  # behind which the parser is

    def read(self, text: bytes | str, path: Path) -> None:
        """Read a text to its end. Raises PresetError: reading cannot go on behind a place."""
        self.events = self._parsed(self._decoded(text))
        for event in self.events:
            if isinstance(event, yaml.DocumentStartEvent):
                if self.document.places:
                    raise self._end(self._mark(event.start_mark), "a second document", hint="one preset, one document")
                self.document.data = self._value(next(self.events), path)

    def _decoded(self, text: bytes | str) -> str:
        data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
        if len(data) > MOST_PRESET_BYTES:
            words = f"the file is larger than {MOST_PRESET_BYTES // 1024} KiB"
            raise self._end(self.last, words, hint="is this a preset?")
        data = data.removeprefix(BOM_UTF8)
        try:
            decoded = data.decode()
        except UnicodeDecodeError as error:
            mark, got = self._behind(data[: error.start].decode()), f"byte 0x{data[error.start]:02x}"
            raise self._end(mark, "not UTF-8 text", got, "save the file as UTF-8") from None
        if control := _UNPRINTABLE.search(decoded):
            mark = self._behind(decoded[: control.start()])
            raise self._end(mark, "a control character, which YAML does not allow", shown(control.group()))
        return decoded

    def _behind(self, text: str) -> Mark:
        lines = re.split(r"\r\n|[\n\r\x85\u2028\u2029]", text)
        return self.at(len(lines), len(lines[-1]) + 1)

    def _mark(self, mark: Any) -> Mark:
        return self.at(mark.line + 1, mark.column + 1)

    def _end(self, mark: Mark, message: str, got: str = "", hint: str = "") -> PresetError:
        return PresetError([Finding(self.document.file, *mark, "", message, got, hint)])

    def _parsed(self, text: str) -> Iterator[Any]:
        try:
            for event in yaml.parse(text, Loader=yaml.SafeLoader):
                self.last = self._mark(event.end_mark)
                yield event
        except (yaml.YAMLError, ValueError, OverflowError) as error:  # "\U99999999" is no YAMLError
            raise self._syntax_error(error) from None

    def _until(self, end: type[yaml.Event]) -> Iterator[Any]:
        while not isinstance(event := next(self.events), end):
            yield event

    def _value(self, event: Any, path: Path, key: Mark | None = None) -> Any:
        """Value that begins with an event; key, where its key stands."""
        mark = self._mark(event.start_mark)
        if len(path) >= MAX_DEPTH:
            raise self._end(mark, f"nested deeper than {MAX_DEPTH} levels")
        text, quoted = "", False
        value: Any = None
        if isinstance(event, yaml.AliasEvent):
            text = f"*{event.anchor}"
            self._find(mark, path, "aliases are not allowed", shown(text), "write the value out")
            self.document.bad.add(path)
        elif event.anchor is not None:
            self._find(mark, path, "anchors are not allowed", shown(f"&{event.anchor}"), "leave the anchor out")
        if tag := getattr(event, "tag", None):
            got = shown(str(tag).replace("tag:yaml.org,2002:", "!!"))
            self._find(mark, path, "tags are not allowed", got, "leave the tag out")
        if isinstance(event, yaml.SequenceStartEvent):
            items = enumerate(self._until(yaml.SequenceEndEvent))
            value, text = [self._value(item, (*path, index)) for index, item in items], "a list"
        elif isinstance(event, yaml.MappingStartEvent):
            value, text = self._table(path), "a table of keys"
        elif isinstance(event, yaml.ScalarEvent):
            text, quoted = str(event.value), event.style is not None
            if _SURROGATE.search(text):
                self._find(mark, path, "half of a surrogate pair is no character", shown(text))
                self.document.bad.add(path)
            else:
                value = text if quoted else scalar_value(text)
        self.document.places[path] = SourceSpan(self.document.file, key or mark, mark, text, quoted)
        return value

    def _table(self, path: Path) -> dict[str, Any]:
        table: dict[str, Any] = {}
        for event in self._until(yaml.MappingEndEvent):
            mark = self._mark(event.start_mark)
            name = str(getattr(event, "value", ""))
            at = (*path, name)
            if name in table:
                first = self.document.places[at].key
                hint = f"first given in line {first.line}, column {first.column}"
                self._find(mark, at, "duplicate key", hint=hint)
            key = self._value(event, at, mark)
            value = self._value(next(self.events), at, mark)
            if isinstance(key, list | dict):
                self._find(mark, path, "a key must be a single word", hint="a text or a number")
            elif not _SURROGATE.search(name):
                table[name] = value  # of a key given twice the last one, whose place is known
        return table

    def _find(self, mark: Mark, path: Path, message: str, got: str = "", hint: str = "") -> None:
        finding = Finding(self.document.file, *mark, path_text(path), message, got, hint)
        self.document.findings.append(finding)

    def _syntax_error(self, error: Exception) -> PresetError:
        begun = getattr(error, "context_mark", None)
        at = getattr(error, "problem_mark", None) or begun
        problem = str(getattr(error, "problem", None) or getattr(error, "context", None) or error)
        other = (shown(problem, 100), "")
        message, hint = next((words for start, words in _WORDS.items() if start in problem), other)
        if "not closed" in message and begun is not None:
            opened = self._mark(begun)
            hint = f"opened in line {opened.line}, column {opened.column}"
        return self._end(self._mark(at) if at else self.last, f"not valid YAML: {message}", hint=hint)


def path_text(path: Path) -> str:
    """Path as messages write it: gears.z_g, operation.M_g[1]."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return shown(text.removeprefix("."), 80)


# Messages of the parser, and the messages and hints for them
_WORDS = {
    "mapping values are not allowed": ("a ':' where none can stand", "wrong indentation, or a text that needs quotes"),
    "could not find expected ':'": ("a line without a ':' behind its key", ""),
    "found character '\\t'": ("a tab", "indent with spaces"),
    "expected ',' or": ("a bracket is not closed, or a comma is missing", ""),
    "unexpected end of stream": ("quotes are not closed", ""),
    "expected the node content": ("a value is missing, or a bracket stays open", ""),
    "expected <block end>": ("wrong indentation", "keys of one table start in the same column"),
    "chr() arg": ("a bad escape in a quoted text", ""),
    "int too large": ("a bad escape in a quoted text", ""),
    "unknown escape character": ("a bad escape in a quoted text", "single quotes take \\ as it is"),
    "that cannot start any token": ("a character that no plain text can start with", "put the text in quotes"),
}


def ordered_findings(items: Iterable[Finding]) -> list[Finding]:
    """Findings in the order of the file, then of the overrides; the first hundred of very many."""
    ordered = sorted(items, key=lambda f: (f.file == OVERRIDE, f.line, f.column))
    if len(ordered) > MAX_FINDINGS:
        last, more = ordered[MAX_FINDINGS], len(ordered) - MAX_FINDINGS
        ordered[MAX_FINDINGS:] = [Finding(last.file, last.line, last.column, "", f"and {more} more")]
    return ordered


def near_miss(word: str, options: Iterable[str]) -> str:
    """A hint "did you mean ...?" if an option looks like the word, else an empty text."""
    known = {option.lower(): option for option in options}
    close = difflib.get_close_matches(word[:60].lower(), known, 1, 0.6)
    return f"did you mean {known[close[0]]}?" if close else ""
