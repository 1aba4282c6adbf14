"""Where human output goes: width, colour and character set of a stream."""

from __future__ import annotations

import os
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TextIO, TypeVar

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from hdassist.plaintext import visible

PIPE_WIDTH = 80
STRICT = "HDASSIST_STRICT"
Made = TypeVar("Made")
PLAIN_CHARACTERS = str.maketrans("·µ×−–’█─", "*ux--'#-") | str.maketrans(
    {"°": " deg", "±": "+-", "…": "...", "≤": "<=", "≥": ">=", "″": " arcsec"}
)


@dataclass(frozen=True)
class Style:
    """Abilities of a stream: 7-bit text only (and some letters beyond it), control codes, and columns."""

    ascii: bool
    codes: bool
    width: int
    beyond_ascii: range = range(0)

    @classmethod
    def of(cls, stream: TextIO, *, ascii: bool = False, no_color: bool = False) -> Style:
        """Style of a stream, from its terminal, the environment and the options that force it."""
        terminal = stream.isatty()
        plain = no_color or bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb"
        width = shutil.get_terminal_size((PIPE_WIDTH, 24)).columns if terminal else PIPE_WIDTH
        return cls(ascii=ascii or not _shows_unicode(stream), codes=terminal and not plain, width=width)

    def text(self, text: str) -> str:
        """The text as the stream can show it, whatever it has of control characters escaped."""
        text = visible(text)
        if not self.ascii:
            return text.replace("N*m", "N·m")
        plain = re.sub(" ([″°])", r"\1", text).translate(PLAIN_CHARACTERS)
        return "".join(c if c.isascii() or ord(c) in self.beyond_ascii else "?" for c in plain)


def _shows_unicode(stream: TextIO) -> bool:
    """Whether a stream takes more than 7 bits; Python writes UTF-8 under LC_ALL=C, where nobody wants it."""
    if os.environ.get("LC_ALL") in ("C", "POSIX"):
        return False
    try:
        "─⣿·".encode(stream.encoding or "ascii")
    except (LookupError, UnicodeEncodeError):
        return False
    return True


def stderr_style(*, no_color: bool = False) -> Style:
    """Style of stderr. Whatever goes there may come before options are read, or beside them: --ascii is looked for."""
    return Style.of(sys.stderr, ascii="--ascii" in sys.argv, no_color=no_color)


def silence(stream: TextIO | None = None) -> None:
    """Stop talking on a stream (None: stdout) whose reader has gone: no complaint, the exit code stays the answer's."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), (stream or sys.stdout).fileno())


def say(line: str, *, whole: bool = False) -> None:
    """Write a line on stderr as it can show it; silent where it cannot be written: the exit code stays.

    whole: it is not broken between words, as it has a command to be copied.
    """
    try:
        style = stderr_style()
        text = style.text(line)
        sys.stderr.write(f"{text if whole or not sys.stderr.isatty() else _in_words(text, style.width)}\n")
        sys.stderr.flush()
    except OSError:
        silence(sys.stderr)


def _in_words(text: str, width: int) -> str:
    """Lines no wider than a terminal, broken between words; a longer word, as a path, is left to the terminal."""
    lines = []
    for line in text.split("\n"):
        indent = line[: len(line) - len(line.lstrip())] + "  "
        lines.append(
            textwrap.fill(line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
        )
    return "\n".join(lines)


def made_or(name: str, make: Callable[[], Made], instead: Callable[[], Made]) -> Made:
    """A form of an answer; where making it fails, a simpler one, with a remark on stderr.

    name: of what is made, in the remark. With STRICT in the environment, as the tests have it, the failure is raised.
    """
    try:
        return make()
    except Exception as error:  # whatever breaks a figure: the answer beside it stands
        if os.environ.get(STRICT):
            raise
        say(f"warning: no {name}, the answer stands: {type(error).__name__}: {error} (a bug in hdassist)")
        return instead()


class _QuietConsole(Console):
    seven_bits = False

    @property
    def encoding(self) -> str:
        """The encoding by which rich chooses bars and boxes."""
        return "ascii" if self.seven_bits else super().encoding

    def on_broken_pipe(self) -> None:
        self.quiet = True
        silence()

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        """Segments without control characters but those that rich adds to them when it writes colours.

        Style.text does the same before the layout; here whatever went past it is caught.
        """
        for segment in super().render(renderable, options):
            yield segment if segment.is_control else segment._replace(text=visible(segment.text))


def console(stream: TextIO, style: Style) -> Console:
    """A rich console that writes to a stream with a style."""
    found = _QuietConsole(
        file=stream,
        width=style.width,
        color_system="auto" if style.codes else None,
        force_terminal=style.codes,
        no_color=not style.codes,
        highlight=False,
        markup=False,
        emoji=False,
        legacy_windows=False,
    )
    found.seven_bits = style.ascii
    return found
