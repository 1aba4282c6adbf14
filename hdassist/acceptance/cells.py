"""Where in a lot a row's values stand, so that what is wrong with one is said of its cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hdassist.acceptance.request import Request
from hdassist.preset.overrides import path_of
from hdassist.preset.yamltext import path_text, shown


@dataclass(frozen=True)
class NamedCell:
    """A cell that says something of a drive.

    place: FILE:LINE:COLUMN; column, its name; text of the cell; said: the option that says the same ("--value
    F_ior@80=28"), as messages begin with it; path, of the override that it is; file that it names; empty for none.
    """

    place: str
    column: str
    text: str
    said: str = ""
    path: str = ""
    file: str = ""

    @property
    def name(self) -> str:
        """How a message begins that is about the cell."""
        return f"{self.place}: {shown(self.column)}"


def of_cells(message: str, request: Request, cells: Sequence[NamedCell]) -> str:
    """A message about a row in which its cells are named, not the options that would say the same.

    Arguments: message, one line for each fault; request and cells of the row.
    """
    lines = request.as_said(message, overrides=True).splitlines()
    found = [_of_option(line, cells) for line in lines]
    if any(found):
        return "\n".join(new or old for new, old in zip(found, message.splitlines(), strict=True))
    files = [cell for cell in cells if cell.file and cell.file in message]
    return f"{files[0].name}: {message}" if len(files) == 1 else message


def _of_option(line: str, cells: Sequence[NamedCell]) -> str:
    """A line about an option, about the cell that says the same; empty where there is none."""
    for cell in cells:
        if cell.said and line.startswith(f"{cell.said}: "):
            rest = line.removeprefix(f"{cell.said}: ")
            if cell.path:
                return f"{cell.name}: {rest.removeprefix(f'{path_text(path_of(cell.path))}: ')}"
            return f"{cell.name}: {rest} (got {shown(cell.text)})"
    return ""
