"""Files of a run: bytes and text of its inputs, including presets, and its outputs, which must not be inputs.

Text is read in parts from a path, a stream or bytes. It may be of unknown origin: hidden characters are escaped when it
is shown, and numbers have ASCII digits and a decimal point. Files are compared by device and inode instead of by name,
because links and other cases of a name are the same file.
"""

from __future__ import annotations

import codecs
import difflib
import errno
import gzip
import hashlib
import io
import os
import re
import secrets
import shutil
import stat
import sys
import tomllib
import unicodedata
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from math import copysign, inf, nan
from pathlib import Path
from typing import IO, Any, BinaryIO, cast

from hdassist.run.errors import DataError, Fault, Finding, PresetError, UsageError

STDIN = "<stdin>"
_GZIP = b"\x1f\x8b"
MAX_LINE = 10_000  # longest line, in characters
PART = 1 << 18  # bytes per read
_NOT_UTF_8 = re.compile("[\udc80-\udcff]")

Readable = str | Path | bytes | IO[bytes] | IO[str]


class TextFile:
    """Text of a file, read once and in parts, which limits the memory for large files.

    name: name of the file in messages.
    sha256: hash of the bytes, available once all parts are read. A gzip file is hashed unpacked, and a
        text stream as UTF-8.
    is_latin: whether lines that are not UTF-8 were read as Latin-1.
    """

    def __init__(self, source: Readable, at_most: int) -> None:
        """Store a source, which parts() opens.

        source: a path ("-" is standard input), bytes, or a stream.
        at_most: maximum number of bytes.
        """
        is_path = isinstance(source, str | Path)
        named = STDIN if source == "-" else str(source) if is_path else str(getattr(source, "name", "<bytes>"))
        self.source = source
        self.at_most = at_most
        self.name = named
        self.sha256 = ""
        self.is_latin = False

    def parts(self) -> Iterator[tuple[int, str]]:
        """Yield blocks of whole lines, joined by newlines, each with the number of its first line.

        Raises DataError if the file cannot be read. Raises PresetError if it is too large, empty, binary, damaged, or
        not in the encoding of its byte order mark.
        """
        line = 1
        unfinished = ""
        is_empty = True
        for text in self._decoded():
            if "\0" in text:
                hint = "save the table as text: CSV in UTF-8"
                zero_line = line + text.count("\n", 0, text.index("\0"))
                raise self._refusal("the file is binary", "a NUL character", hint, zero_line)
            is_empty = is_empty and not text.strip("\x1a \t\n")
            lines, newline, after = text.rpartition("\n")
            if newline:
                part = self._readable(unfinished + lines)
                unfinished = after
                yield line, part
                line += part.count("\n") + 1
            else:
                unfinished += after
            if len(unfinished) > max(MAX_LINE, PART):
                raise self._refusal(f"the line has more than {MAX_LINE} characters", "", "write one row per line", line)
        if is_empty:
            raise self._refusal("the file is empty", hint="check that the measurement was saved")
        if unfinished := unfinished.rstrip("\x1a"):
            yield line, self._readable(unfinished)

    def _decoded(self) -> Iterator[str]:
        r"""Yield the decoded text with \n at the end of lines; bytes that are not UTF-8 become lone surrogates."""
        digest = hashlib.sha256()
        size = 0
        decoder = None
        with self._opened() as stream:
            data = b"start"
            while data:
                try:
                    read = stream.read(PART)
                except (EOFError, zlib.error, gzip.BadGzipFile):
                    raise self._refusal(
                        "the gzip file is damaged or incomplete", hint="compress or copy it again"
                    ) from None
                data = read.encode("utf-8", "surrogatepass") if isinstance(read, str) else read
                decoder = decoder or self._decoder(data)
                digest.update(data)
                size += len(data)
                if size > self.at_most:
                    limit = f"{self.at_most / 1e6:g} MB" if self.at_most >= 1e6 else f"{self.at_most} bytes"
                    raise self._refusal(
                        f"the file is larger than {limit}", hint="check that this is the file with the table"
                    )
                try:
                    yield decoder.decode(data, final=not data)
                except UnicodeDecodeError as error:
                    encoding = error.encoding[:6].upper().rstrip("-")
                    message = f"the text is not valid {encoding}, although its first bytes indicate this encoding"
                    got = f"byte 0x{error.object[error.start]:02x}"
                    raise self._refusal(message, got, "save the file as UTF-8") from None
        self.sha256 = digest.hexdigest()

    @contextmanager
    def _opened(self) -> Iterator[IO[bytes] | IO[str]]:
        """Yield the source as an open stream, unpacked if it is a gzip file."""
        source = io.BytesIO(self.source) if isinstance(self.source, bytes) else self.source
        if not isinstance(source, str | Path | io.BufferedIOBase):
            yield source
            return
        with opened(source) if isinstance(source, str | Path) else nullcontext(source) as stream:
            buffered = io.BufferedReader(cast(io.RawIOBase, stream))
            is_packed = buffered.peek(len(_GZIP))[: len(_GZIP)] == _GZIP
            yield cast(BinaryIO, gzip.GzipFile(fileobj=buffered) if is_packed else buffered)
            buffered.detach()  # keeps standard input open

    def _decoder(self, start: bytes) -> io.IncrementalNewlineDecoder:
        encoding = "utf-8"
        errors = "surrogateescape"
        if start.startswith(codecs.BOM_UTF8):
            encoding = "utf-8-sig"
            errors = "strict"
        elif start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            encoding = "utf-16"
            errors = "strict"
        return io.IncrementalNewlineDecoder(codecs.getincrementaldecoder(encoding)(errors), translate=True)

    def _readable(self, lines: str) -> str:
        """Return the lines; those that are not UTF-8 are decoded as Latin-1."""
        if lines.isascii() or not _NOT_UTF_8.search(lines):
            return lines
        self.is_latin = True
        return "\n".join(
            line.encode("utf-8", "surrogateescape").decode("latin-1") if _NOT_UTF_8.search(line) else line
            for line in lines.split("\n")
        )

    def _refusal(
        self,
        message: str,
        got: str = "",
        hint: str = "",
        line: int = 1,
    ) -> PresetError:
        return PresetError(
            [
                Finding(
                    file=self.name,
                    line=line,
                    column=1,
                    path="",
                    message=message,
                    got=got,
                    hint=hint,
                )
            ]
        )


@contextmanager
def opened(path: str | Path) -> Iterator[BinaryIO]:
    """Yield a file, or standard input for the path "-", opened for reading bytes.

    A pipe without a writer reads as empty. A device may never end, so the caller must stop at a maximum size.
    Raises DataError if the file does not exist, is a directory, or cannot be read.
    """
    name = str(path)
    if not name:
        raise DataError("no such file: the name is empty", "use - for standard input", Fault.FILE_UNREADABLE)
    if name == "-" and sys.stdin is None:
        raise DataError("cannot read standard input: it is closed", "name a file instead", Fault.FILE_UNREADABLE)
    try:
        with nullcontext(sys.stdin.buffer) if name == "-" else open_at_once(name) as stream:
            if name == "-":
                with suppress(OSError):  # standard input may have no descriptor
                    note_input(stream.fileno(), STDIN)
            yield stream
    except FileNotFoundError:
        raise DataError(f"no such file: {name}", _near_by(Path(name)), Fault.FILE_UNREADABLE) from None
    except IsADirectoryError:
        raise DataError(f"{name} is a directory, not a file", "name a file in it", Fault.FILE_UNREADABLE) from None
    except (OSError, ValueError) as error:  # ValueError: a path that contains NUL
        raise DataError(
            f"cannot read {'standard input' if name == '-' else name}: {os_reason(error)}", "", Fault.FILE_UNREADABLE
        ) from None


def open_at_once(name: str) -> BinaryIO:
    """Open an input file of this run for reading.

    Unlike open(), the function does not wait for a writer of a pipe, which may never come.
    Raises OSError or ValueError if the file cannot be opened, and UsageError if it is an output of this run.
    """

    def opener(path: str, flags: int) -> int:
        try:
            descriptor = os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
        except PermissionError:  # Windows reports a folder as a permission error
            if not Path(path).is_dir():
                raise
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), path) from None
        note_input(descriptor, name)
        if hasattr(os, "O_NONBLOCK"):
            os.set_blocking(descriptor, True)
        return descriptor

    return open(name, "rb", opener=opener)  # Path.open has no opener


def is_file(path: str | Path) -> bool:
    """Return whether a path is a regular file; False for an invalid path."""
    return os.path.isfile(path)  # noqa: PTH113 (Path.is_file raises an error for a name that is too long)


def is_there(path: str | Path) -> bool:
    """Return whether a path is a file, folder or device; False for an invalid path."""
    return os.path.exists(path)  # noqa: PTH110 (Path.exists raises an error for a name that is too long)


@contextmanager
def in_place_of(path: str | Path) -> Iterator[Path]:
    """Yield the path of a temporary file, which replaces the target when the block succeeds; a link remains a link."""
    target = Path(os.path.realpath(path))
    part_file = target.with_name(f".{target.name[:100]}.{secrets.token_hex(4)}.part")
    try:
        yield part_file
        if target.exists():
            shutil.copymode(target, part_file)
        part_file.replace(target)
    except BaseException:
        with suppress(OSError):
            part_file.unlink()
        raise


def read_bytes(path: str | Path, at_most: int) -> tuple[bytes, str]:
    """Return the bytes of a file, or of standard input for the path "-", and its name in messages.

    path: the path.
    at_most: number of bytes at which reading stops.
    Raises DataError if the file does not exist, is a directory, or cannot be read.
    """
    with opened(path) as stream:
        return stream.read(at_most), STDIN if str(path) == "-" else str(path)


def os_reason(error: Exception) -> str:
    """Return the system's reason why a file cannot be read."""
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)


_ALIKE = 0.65  # smallest share of equal letters, without the extension, of similar names


def _near_files(path: Path) -> list[str]:
    """Return existing files with names similar to that of a missing file.

    Raises OSError or ValueError if its directory does not exist or cannot be read.
    """
    names: dict[str, list[str]] = {}
    for item in path.parent.iterdir():
        names.setdefault(item.stem.lower(), []).append(item.name)
    stems = difflib.get_close_matches(path.stem.lower()[:60], names, 3, _ALIKE)
    return [str(path.parent / name) for stem in stems for name in sorted(names[stem])][:3]


def _near_by(path: Path) -> str:
    try:
        close = _near_files(path)
    except (OSError, ValueError):
        return f"the directory {path.parent} does not exist either"
    return f"the nearest name is {' or '.join(close)}" if close else "check the path"


# --- the files of this run

# device and inode of a file; or device and inode of its folder, with the name in it
_Identity = tuple[int, int] | tuple[int, int, str]

_inputs: dict[_Identity, str] = {}
_outputs: dict[_Identity, str] = {}
_kept: set[str] = set()
_written: set[str] = set()


def begin_run() -> None:
    """Forget the files of the previous run; a file behind standard output is the first output of this run."""
    for names_of_files in (_inputs, _outputs, _kept, _written):
        names_of_files.clear()
    with suppress(OSError, ValueError):
        _outputs.update(dict.fromkeys(_file(sys.stdout.fileno()), "standard output"))


def note_input(file: str | int, name: str = "") -> None:
    """Record that a run reads a file, given by its path or descriptor.

    name: name in messages; the path by default.
    Raises UsageError if the file is an output of the run whose contents the run does not continue.
    """
    for identity in _file(file):
        _inputs[identity] = name or str(file)
        if identity in _outputs and _inputs[identity] not in _kept:
            raise UsageError(f"{_outputs[identity]} is also an input of this run", "write the result to another file")


def claim_output(path: str, *, is_kept: bool = False) -> None:
    """Record that a run writes a file.

    is_kept: whether the run continues the contents of the file.
    Raises UsageError if the run reads that file, or writes it for another option.
    """
    if path == "-":
        return
    identities = _file(path) + _place(path)
    for identity in identities:
        if identity in _inputs:
            raise UsageError(f"{path} is also an input of this run", "write the result to another file")
        if identity in _outputs:
            raise UsageError(f"two results would be written to {path}", "name a separate file for each result")
    _outputs.update(dict.fromkeys(identities, path))
    if is_kept:
        _kept.add(path)


def is_claimed(path: str) -> bool:
    """Return whether a file was claimed under this name."""
    return path in _outputs.values()


def note_written(path: str) -> None:
    """Record that a result was written to a file, or to standard output ("-")."""
    _written.add(path)


def is_written(path: str) -> bool:
    """Return whether a result was written to a file, or to standard output ("-")."""
    return path in _written


def _file(file: str | int) -> list[_Identity]:
    """Return the identity of a regular file; empty for devices and pipes, which take any number of results."""
    with suppress(OSError, ValueError):
        status = os.fstat(file) if isinstance(file, int) else Path(file).stat()
        return [(status.st_dev, status.st_ino)] if stat.S_ISREG(status.st_mode) else []
    return []


def _place(path: str) -> list[_Identity]:
    """Return the identity of an existing or future file by its folder and its name without case."""
    with suppress(OSError, ValueError):
        real = Path(os.path.realpath(path))
        if real.is_file() or not real.exists():
            folder = real.parent.stat()
            return [(folder.st_dev, folder.st_ino, unicodedata.normalize("NFC", real.name).casefold())]
    return []


# Control characters except newline and tab, marks that change the direction of writing or have no width, line and
# paragraph separators, halves of surrogate pairs, and noncharacters. They include all characters that XML 1.0 does not
# allow.
_HIDDEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u00ad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ufffe\uffff\ud800-\udfff\U000e0000-\U000e007f]"
)


def visible(text: str) -> str:
    r"""Return the text with hidden characters escaped (\x1b, \u202e); newlines, tabs and visible characters remain."""
    return _HIDDEN.sub(lambda found: escaped(found[0]), text)


def escaped(character: str) -> str:
    """Return a character in Python's 7-bit notation."""
    return character.encode("unicode_escape").decode()


def printable(json: str) -> str:
    """Return 7-bit JSON with DEL escaped, the only control character that JSON allows unescaped."""
    return json.replace("\x7f", "\\u007f")


UNSIGNED = r"(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
NUMBER = rf"[-+]?{UNSIGNED}"


GREATEST = 1e30  # largest magnitude of a number in a file: its square, and sums of squares, are finite


def number_of(text: str) -> float:
    """Return the value of a number with optional spaces around it; NaN for any other text, infinity beyond GREATEST."""
    return bounded(float(text)) if re.fullmatch(NUMBER, text.strip()) else nan


def bounded(value: float) -> float:
    """Return a number, or infinity with its sign if its magnitude exceeds GREATEST."""
    return copysign(inf, value) if abs(value) > GREATEST else value


def with_decimal_points(text: str) -> str:
    """Return a value with decimal points in place of commas, unless these may separate thousands."""
    may_be_thousands = "." in text or re.search(r"(?<![0-9,])[1-9][0-9]{0,2}(,[0-9]{3})+(?![0-9])", text)
    return text if may_be_thousands else re.sub(r"(?<=[0-9]),(?=[0-9])", ".", text)


def package_table(name: str, parse_float: Callable[[str], Any] = float) -> dict[str, Any]:
    """Return the contents of a TOML file of this package; parse_float: function that converts its numbers."""
    return tomllib.loads(files("hdassist").joinpath(name).read_text("utf-8"), parse_float=parse_float)


# --- presets by name, from a file, or from standard input

READ_AT_MOST = 1024 * 1024  # bytes; a larger preset is read up to this size and refused with the reason


def preset_names() -> list[str]:
    """Return the names of the presets that come with hdassist, in alphabetical order."""
    return sorted(_library())


def read_preset(name_or_path: str) -> tuple[bytes, str]:
    """Return the bytes of a preset, and its name in messages.

    name_or_path: a name from the library, a path, or "-" for standard input.
    Raises DataError if there is no such preset or its file cannot be read.
    """
    library = _library()
    if name_or_path in library:
        with library[name_or_path].open("rb") as stream:
            return stream.read(READ_AT_MOST), name_or_path
    try:
        return read_bytes(name_or_path, READ_AT_MOST)
    except DataError as error:
        if not name_or_path or isinstance(error.__context__, FileNotFoundError):
            raise _unknown(name_or_path, list(library)) from None
        if isinstance(error.__context__, IsADirectoryError):
            raise DataError(f"{name_or_path} is a directory, not a preset", error.hint, error.fault) from None
        raise


@cache  # a lot reads the library for each of its rows
def _library() -> dict[str, Traversable]:
    """Return the presets of the library by name, from the package or from the checkout that contains it."""
    places: list[Traversable] = [files("hdassist") / "presets", Path(__file__).parents[2] / "presets"]
    for place in places:
        if place.is_dir():
            items = (item for item in place.iterdir() if item.name.endswith(".yaml"))
            return {item.name.removesuffix(".yaml"): item for item in items}
    return {}


def _unknown(name: str, names: list[str]) -> DataError:
    candidates = [file for file in (f"{name}.yaml", f"{name}.yml") if name and is_file(file)]
    with suppress(OSError, ValueError):
        candidates = candidates or [file for file in _near_files(Path(name)) if file.endswith((".yaml", ".yml"))]
    close = candidates or difflib.get_close_matches(Path(name).stem.lower()[:60], names, 3, 0.5)
    hint = f"the nearest name is {' or '.join(close)}; " if close else ""
    kind = "no such file" if Path(name).suffix or "/" in name or os.sep in name else "no such preset or file"
    library = f"{hint}presets of the library: {', '.join(sorted(names))}"
    return DataError(f"{kind}: {name or 'an empty name'}", library, Fault.FILE_UNREADABLE)
