"""Tables of text under a line of names, as spreadsheets write them: separated by semicolons, tabs or commas."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

from hdassist.errors import Finding, PresetError
from hdassist.readers.cells import Cell, split
from hdassist.textfile import decode, read_bytes

MAX_BYTES = 5_000_000
SEPARATORS = ";\t,"
_LINE_END = re.compile(r"\r\n|\r|\n")
_REMARK = re.compile(r"#|//|%")
_DECIMAL_COMMA = re.compile(r"(?<=[0-9]),(?=[0-9])")


@dataclass(frozen=True)
class TextTable:
    """What a file says: its SHA-256, separator, names with the line they stand in, rows, and lines left out as remarks.

    rows: number of the line and its cells, as many as the line has.
    """

    file: str
    sha256: str
    separator: str
    names: tuple[Cell, ...]
    names_line: int
    rows: tuple[tuple[int, tuple[Cell, ...]], ...]
    remarks: tuple[int, ...]

    def with_points(self, text: str) -> str:
        """A cell with decimal points, where the separator leaves commas free and the cell has no list in it."""
        free = self.separator != "," and "." not in text and "[" not in text
        return _DECIMAL_COMMA.sub(".", text) if free else text


def read_text_table(path: str | Path) -> TextTable:
    """Read a table; lines that begin with #, // or % are remarks.

    Raises DataError: a file that cannot be read; PresetError: one that is empty, binary or has no rows.
    """
    data, file = read_bytes(path, MAX_BYTES + 1)
    text, _ = decode(data, file, MAX_BYTES)
    lines = [(n, line) for n, line in enumerate(_LINE_END.split(text), 1) if line.strip(' ;,\t"')]
    remarks = tuple(number for number, line in lines if _REMARK.match(line.lstrip(' "')))
    kept = [(number, line) for number, line in lines if number not in remarks]
    if len(kept) < 2:
        hint = "a line of names such as serial;preset;measured, and a row for each drive"
        raise PresetError([Finding(file, kept[0][0] if kept else 1, 1, "", "no rows in the table", hint=hint)])
    names_line, head = kept[0]
    separator = next((mark for mark in SEPARATORS if mark in head), ";")
    rows = tuple((number, tuple(split(line, separator))) for number, line in kept[1:])
    digest = hashlib.sha256(data).hexdigest()
    return TextTable(file, digest, separator, tuple(split(head, separator)), names_line, rows, remarks)
