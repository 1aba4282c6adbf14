"""Abilities of streams, messages on standard error, and files that are written completely or not at all."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, TypeVar

from hdassist.run.errors import DataError, Fault, UsageError
from hdassist.run.files import claim_output, in_place_of, is_claimed, is_file, is_there, note_written, visible
from hdassist.run.stops import at_stop
from hdassist.run.system import command_line, output_encoding, takes_codes, why_not_a_file

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType
    from rich.segment import Segment

PIPE_WIDTH = 80
_STRICT = "HDASSIST_STRICT"
_Made = TypeVar("_Made")
PLAIN_CHARACTERS = str.maketrans("·µ×−–’█─", "*ux--'#-") | str.maketrans(
    {"°": " deg", "±": "+-", "…": "...", "≤": "<=", "≥": ">=", "→": "->", "″": " arcsec", "σ": "sigma"}
)


@dataclass(frozen=True)
class Style:
    """Abilities of a stream.

    ascii: whether it shows only 7-bit text.
    codes: whether it accepts control codes.
    width, height: its columns and lines.
    beyond_ascii: code points that are shown in addition to ASCII.
    """

    ascii: bool
    codes: bool
    width: int
    beyond_ascii: range = range(0)
    height: int = 24

    @classmethod
    def of(
        cls,
        stream: TextIO,
        *,
        ascii: bool = False,
        no_color: bool = False,
    ) -> Style:
        """Return the style of a stream, determined from its terminal, the environment and the options."""
        terminal = stream.isatty()
        plain = no_color or bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb"
        columns = os.environ.get("COLUMNS", "")
        width = int(columns) if columns.isdecimal() and int(columns) else PIPE_WIDTH
        height = 24
        if terminal:
            width, height = shutil.get_terminal_size((PIPE_WIDTH, 24))
        codes = terminal and not plain and takes_codes(stream)
        return cls(
            ascii or not _shows_unicode(stream),
            codes,
            width,
            height=height,
        )

    def text(self, text: str) -> str:
        """Return a text that the stream can show: control characters are escaped, and unsupported ones replaced."""
        text = visible(text)
        if not self.ascii:
            return re.sub(r"\bum\b", "µm", text.replace("N*m", "N·m"))
        plain = re.sub(" ([″°])", r"\1", text).translate(PLAIN_CHARACTERS)
        return "".join(c if c.isascii() or ord(c) in self.beyond_ascii else "?" for c in plain)


def _shows_unicode(stream: TextIO) -> bool:
    """Return whether a stream shows Unicode; under LC_ALL=C it does not, although Python would write UTF-8."""
    if os.environ.get("LC_ALL") in ("C", "POSIX"):
        return False
    try:
        "─⣿·".encode(stream.encoding or "ascii")
    except (LookupError, UnicodeEncodeError):
        return False
    return True


def stderr_style(*, no_color: bool = False) -> Style:
    """Return the style of standard error; --ascii is read from sys.argv, because messages may precede the options."""
    return Style.of(
        sys.stderr,
        ascii="--ascii" in sys.argv,
        no_color=no_color,
    )


def silence(stream: TextIO | None = None) -> None:
    """Discard further output to a stream that cannot be written, stdout by default, without changing the exit code."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), (stream or sys.stdout).fileno())


def say(line: str, *, whole: bool = False) -> None:
    """Write a message to standard error; a failure to write is ignored and does not change the exit code.

    line: message, which may have several lines.
    whole: whether the message is not wrapped, because it contains a command to be copied.
    """
    try:
        style = stderr_style()
        text = style.text(line)
        sys.stderr.write(f"{text if whole or not sys.stderr.isatty() else _in_words(text, style.width)}\n")
        sys.stderr.flush()
    except OSError:
        silence(sys.stderr)


def _in_words(text: str, width: int) -> str:
    """Return a text wrapped between words to a width; a word that is longer than the width is not broken."""
    lines = []
    for line in text.split("\n"):
        indent = line[: len(line) - len(line.lstrip())] + "  "
        lines.append(
            textwrap.fill(
                line,
                width,
                subsequent_indent=indent,
                break_long_words=False,
                break_on_hyphens=False,
            )
        )
    return "\n".join(lines)


def made_or(
    name: str,
    make: Callable[[], _Made],
    instead: Callable[[], _Made],
) -> _Made:
    """Return a form of a result; if making this form fails, return a simpler form and warn on standard error.

    If the environment contains HDASSIST_STRICT, as in the tests, the failure is raised.

    name: name of the form, for the warning.
    make: function that returns the form.
    instead: function that returns the simpler form.
    """
    try:
        return make()
    except Exception as error:  # no failure of a figure may affect the result
        if os.environ.get(_STRICT):
            raise
        say(f"warning: no {name}, the result is not affected: {type(error).__name__}: {error} (a bug in hdassist)")
        return instead()


def console(stream: TextIO, style: Style) -> Console:
    """Return a rich console that writes to a stream in a style."""
    console_of_stream: Console = _console_class()(
        file=stream,
        width=style.width,
        color_system="auto" if style.codes else None,
        force_terminal=style.codes,
        no_color=not style.codes,
        highlight=False,
        markup=False,
        emoji=False,
        legacy_windows=False,
        seven_bits=style.ascii,
    )
    return console_of_stream


@cache
def _console_class() -> type[Any]:
    """Return the class of consoles; rich is imported here because help and plain text do not need it."""
    from rich.console import Console

    class QuietConsole(Console):
        def __init__(self, *, seven_bits: bool, **options: Any) -> None:
            self.seven_bits = seven_bits
            super().__init__(**options)

        @property
        def encoding(self) -> str:
            """Encoding by which rich chooses the characters of bars and boxes."""
            return "ascii" if self.seven_bits else super().encoding

        def on_broken_pipe(self) -> None:
            self.quiet = True
            silence()

        def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
            """Yield the segments without control characters, except those that rich adds for colours.

            Style.text already removes them before the layout; this method covers text that bypassed it.
            """
            for segment in super().render(renderable, options):
                yield segment if segment.is_control else segment._replace(text=visible(segment.text))

    return QuietConsole


def write_text(
    path: str,
    text: str,
    force: bool,
) -> None:
    """Write a text to a file as UTF-8 and report "wrote FILE" on standard error, or write it to standard output.

    A terminal receives the text with hidden characters escaped.

    path: name of the file, "-" for standard output.
    text: text to write.
    force: whether an existing file may be replaced.
    Raises UsageError if the file exists, and DataError if it cannot be written. In both cases no file is changed.
    """
    note_written(path)
    if path == "-":
        if sys.stdout.isatty():
            encoding = sys.stdout.encoding or "utf-8"
            shown = visible(text.replace("\r\n", "\n"))
            give_stdout(shown.encode(encoding, "backslashreplace").decode(encoding))
        else:  # text would change line ends on some systems, bytes do not
            give_stdout(text.encode(output_encoding(sys.stdout), "backslashreplace"))
        return
    if not is_claimed(path):
        claim_output(path)
    require_writable(path, force)
    put_text(path, text)
    say(f"wrote {path}")


_PARQUET_ROWS = 100_000  # largest number of rows that are in memory at the same time


def require_parquet(path: str) -> None:
    """Raise UsageError if the package that writes Parquet is not installed, or if no file is named."""
    if not find_spec("pyarrow"):
        message = "--parquet needs a package that is not installed: pyarrow"
        raise UsageError(message, command_line(["pip", "install", "hdassist[parquet]"]))
    if path == "-" or _is_device(Path(path)):
        raise UsageError(
            "--parquet needs the name of a file, not a stream", "write the table to a file: --parquet FILE"
        )


def write_parquet(
    path: str,
    columns: Mapping[str, type],
    rows: Iterable[Sequence[Any]],
    owner: Mapping[str, Any],
    force: bool,
) -> None:
    """Write a table as Parquet and report "wrote FILE" on standard error.

    path: name of the file.
    columns: type of each column by its name.
    rows: rows, with None for an empty cell.
    owner: all inputs that determine the rows, stored in the metadata of the table as "hdassist".
    force: whether an existing file may be replaced.
    Raises UsageError if the file exists, and DataError if it cannot be written. In both cases no file is changed.
    """
    import pyarrow
    from pyarrow.parquet import ParquetWriter

    types = {float: pyarrow.float64(), int: pyarrow.int64(), str: pyarrow.string()}
    named = [(name, types[kind]) for name, kind in columns.items()]
    schema = pyarrow.schema(named, {"hdassist": json.dumps(owner)})
    require_writable(path, force)
    remaining_rows = iter(rows)
    try:
        with (
            in_place_of(path) as part_file,
            at_stop(partial(part_file.unlink, missing_ok=True)),
            ParquetWriter(part_file, schema) as writer,
        ):
            while chunk := list(islice(remaining_rows, _PARQUET_ROWS)):
                cells = map(pyarrow.array, zip(*chunk, strict=True), schema.types)
                writer.write_table(pyarrow.Table.from_arrays(list(cells), schema=schema))
    except OSError as error:
        raise _unwritable(path, error.strerror or str(error)) from None
    say(f"wrote {path}")


def begins_with(path: str, heads: Sequence[str]) -> bool:
    """Return whether a file begins with one of the given texts; False for a file that cannot be read."""
    try:
        with Path(path).open("rb") as stream:
            start = stream.read(max(map(len, heads)))
    except (OSError, ValueError):
        return False
    return start.startswith(tuple(head.encode() for head in heads))


def give_stdout(answer: str | bytes) -> None:
    """Write a result to standard output. A closed pipe is ignored; other failures raise DataError."""
    try:
        if isinstance(answer, bytes):
            sys.stdout.flush()  # earlier text is written before these bytes
            sys.stdout.buffer.write(answer)
        else:
            sys.stdout.write(answer)
        sys.stdout.flush()
    except BrokenPipeError:
        silence()
    except OSError as error:
        silence()  # the rest of the buffer would cause another error when the process ends
        raise _unwritable("standard output", error.strerror or str(error)) from None


def put_text(path: str, text: str) -> None:
    """Replace the contents of a file by a text in UTF-8. A failure raises DataError and leaves the file unchanged."""
    target = Path(path)
    data = text.encode("utf-8", "backslashreplace")
    try:
        if _is_device(target):
            with open(target, "wb", opener=_at_once) as stream:
                stream.write(data)
        else:
            with in_place_of(target) as part_file, at_stop(partial(part_file.unlink, missing_ok=True)):
                descriptor = os.open(part_file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
                with open(descriptor, "wb") as stream:  # noqa: PTH123 (a descriptor has no path)
                    stream.write(data)
    except OSError as error:
        reason = "no process reads the pipe" if error.errno == errno.ENXIO else error.strerror or str(error)
        raise _unwritable(path, reason) from None


def _at_once(path: str, flags: int) -> int:
    """Open a device or a pipe for writing without waiting for a reader. Raises OSError if nothing reads the pipe."""
    descriptor = os.open(path, (flags | getattr(os, "O_NONBLOCK", 0)) & ~os.O_CREAT)
    if hasattr(os, "O_NONBLOCK"):
        os.set_blocking(descriptor, True)
    return descriptor


def take_output(
    path: str,
    force: bool,
    *,
    is_kept: bool = False,
) -> None:
    """Claim a file for a result of this run, before the computation.

    path: name of the file, "-" for standard output.
    force: whether an existing file may be replaced.
    is_kept: whether the run continues the contents of the file.
    Raises UsageError if the file exists, or if the run reads the file or writes it for another option. Raises DataError
    if the file cannot be written.
    """
    claim_output(path, is_kept=is_kept)
    require_writable(path, force or is_kept)


def require_writable(path: str, force: bool) -> None:
    """Raise the error of `write_text` for a file that cannot be written, before the computation.

    path: name of the file, "-" for standard output.
    force: whether an existing file may be replaced.
    Raises UsageError if the file exists, and DataError if it cannot be written.
    """
    if path == "-":
        return
    target = Path(path)
    try:
        if not path or target.is_dir():
            raise _unwritable(path, "it is a directory" if path else "the name is empty")
        if reason := why_not_a_file(path):
            raise _unwritable(path, reason)
        if target.exists() and not _is_device(target) and not force:
            raise UsageError(f"{path} already exists", "use --force to overwrite it", Fault.FILE_EXISTS)
        if _real(target).is_symlink():
            raise _unwritable(path, "its symbolic links form a loop")
        folder = _real(target).parent
        if not folder.is_dir():
            raise _unwritable(path, f"there is no directory {folder}")
        if not os.access(target if _is_device(target) else folder, os.W_OK):
            raise _unwritable(path, "the file system is read-only" if _is_read_only(folder) else "no permission")
    except (OSError, ValueError) as error:  # ValueError is raised for a path that contains NUL
        raise _unwritable(path, getattr(error, "strerror", None) or str(error)) from None


def _is_read_only(folder: Path) -> bool:
    """Return whether the file system of a folder is mounted read-only; False if the system does not report it."""
    return hasattr(os, "statvfs") and bool(os.statvfs(folder).f_flag & os.ST_RDONLY)


def _real(target: Path) -> Path:
    """Return the target of a symbolic link, because a file is replaced without replacing the link to it."""
    return Path(os.path.realpath(target))


def _is_device(target: Path) -> bool:
    """Return whether a path is a device or a pipe, which has no contents and must not be replaced."""
    return is_there(target) and not is_file(target)


def _unwritable(path: str, reason: str) -> DataError:
    return DataError(f"cannot write {path or 'a file'}: {reason}", "", Fault.FILE_UNWRITABLE)
