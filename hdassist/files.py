"""Files of a run: bytes and text of those that it reads, the presets among them, and outputs, none of them an input.

Text comes part after part, from a path, a stream or bytes. It may be of unknown origin: hidden characters are escaped
if it is shown, and numbers have ASCII digits and a decimal point. Files are compared by device and inode, not by
name: links and other cases of a name are the same file.
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

from hdassist.errors import DataError, Fault, Finding, PresetError, UsageError

STDIN = "<stdin>"
_GZIP = b"\x1f\x8b"
MAX_LINE = 10_000  # characters
PART = 1 << 18  # bytes that are read at once
_NOT_UTF_8 = re.compile("[\udc80-\udcff]")

Readable = str | Path | bytes | IO[bytes] | IO[str]


class TextFile:
    """Text of a file, read once and part after part, so that its size takes no memory.

    name: its name in messages. When all parts are read, sha256 is that of the bytes (of a gzip file unpacked; for a
    stream of text, of its UTF-8), and is_latin says whether there were lines that are not UTF-8, which are
    read as Latin-1.
    """

    def __init__(self, source: Readable, at_most: int) -> None:
        """Take a source, which parts() opens.

        Arguments: source, a path ("-" is standard input), bytes, or a stream; at_most, the bytes that it may have.
        """
        is_path = isinstance(source, str | Path)
        named = STDIN if source == "-" else str(source) if is_path else str(getattr(source, "name", "<bytes>"))
        self.source = source
        self.at_most = at_most
        self.name = named
        self.sha256 = ""
        self.is_latin = False

    def parts(self) -> Iterator[tuple[int, str]]:
        """Yield the whole lines, joined by newlines, and the number of the first of them.

        Raises DataError: a file that cannot be read; PresetError: one that is too large, empty, binary, damaged, or not
        in the encoding of its byte order mark.
        """
        line = 1
        unfinished = ""
        is_empty = True
        for text in self._decoded():
            if "\0" in text:
                hint = "save the table as text: CSV in UTF-8"
                zero_line = line + text.count("\n", 0, text.index("\0"))
                raise self._refusal("a binary file", "a NUL character", hint, zero_line)
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
                raise self._refusal(f"a line of more than {MAX_LINE} characters", "", "write one row per line", line)
        if is_empty:
            raise self._refusal("the file is empty", hint="check that the measurement was saved")
        if unfinished := unfinished.rstrip("\x1a"):
            yield line, self._readable(unfinished)

    def _decoded(self) -> Iterator[str]:
        """Yield the text as it comes, with \\n at the end of lines; bytes that are not UTF-8 as lone surrogates."""
        digest = hashlib.sha256()
        size = 0
        decoder = None
        with self._opened() as stream:
            data = b"start"
            while data:
                try:
                    read = stream.read(PART)
                except (EOFError, zlib.error, gzip.BadGzipFile):
                    raise self._refusal("a gzip file that is damaged or cut off") from None
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
                    message = f"not {error.encoding[:6].upper().rstrip('-')} text, although its first bytes announce it"
                    got = f"byte 0x{error.object[error.start]:02x}"
                    raise self._refusal(message, got, "save the file as UTF-8") from None
        self.sha256 = digest.hexdigest()

    @contextmanager
    def _opened(self) -> Iterator[IO[bytes] | IO[str]]:
        """The source to read from, unpacked if it is a gzip file."""
        source = io.BytesIO(self.source) if isinstance(self.source, bytes) else self.source
        if not isinstance(source, str | Path | io.BufferedIOBase):
            yield source
            return
        with opened(source) if isinstance(source, str | Path) else nullcontext(source) as stream:
            buffered = io.BufferedReader(cast(io.RawIOBase, stream))
            is_packed = buffered.peek(len(_GZIP))[: len(_GZIP)] == _GZIP
            yield cast(BinaryIO, gzip.GzipFile(fileobj=buffered) if is_packed else buffered)
            buffered.detach()  # standard input stays open

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
        """Return the lines with those in Latin-1 that are not UTF-8."""
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
    """A file, or standard input where the path is "-", to read bytes from.

    A pipe that nobody writes to reads as empty; a device may never end: who reads it stops at a bound.
    Raises DataError: no such file, a directory, or a file that cannot be read.
    """
    name = str(path)
    if not name:
        raise DataError("no such file: the name is empty", "use - for standard input", Fault.FILE_UNREADABLE)
    if name == "-" and sys.stdin is None:
        raise DataError("cannot read standard input: it is closed", "", Fault.FILE_UNREADABLE)
    try:
        with nullcontext(sys.stdin.buffer) if name == "-" else open_at_once(name) as stream:
            if name == "-":
                with suppress(OSError):  # it has no descriptor
                    note_input(stream.fileno(), STDIN)
            yield stream
    except FileNotFoundError:
        raise DataError(f"no such file: {name}", _near_by(Path(name)), Fault.FILE_UNREADABLE) from None
    except IsADirectoryError:
        raise DataError(f"{name} is a directory, not a file", "name a file in it", Fault.FILE_UNREADABLE) from None
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
        raise DataError(
            f"cannot read {'standard input' if name == '-' else name}: {os_reason(error)}", "", Fault.FILE_UNREADABLE
        ) from None


def open_at_once(name: str) -> BinaryIO:
    """Open a file to read, an input of this run.

    A pipe that nobody writes to is not waited for, as open() would for ever. Raises OSError and ValueError: it cannot
    be opened; UsageError: it is an output of this run.
    """

    def opener(path: str, flags: int) -> int:
        try:
            descriptor = os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
        except PermissionError:  # Windows opens no folder
            if not Path(path).is_dir():
                raise
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), path) from None
        note_input(descriptor, name)
        if hasattr(os, "O_NONBLOCK"):
            os.set_blocking(descriptor, True)
        return descriptor

    return open(name, "rb", opener=opener)  # a path's open takes no opener


def is_file(path: str | Path) -> bool:
    """Return whether there is a regular file; False for a path that no file can have."""
    return os.path.isfile(path)  # noqa: PTH113 (a path's is_file raises where a name is too long)


def is_there(path: str | Path) -> bool:
    """Return whether there is a file, folder or device; False for a path that none can have."""
    return os.path.exists(path)  # noqa: PTH110 (a path's exists raises where a name is too long)


@contextmanager
def in_place_of(path: str | Path) -> Iterator[Path]:
    """A file to be made beside another one, whose name it gets when all went well; a link stays one."""
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
    """Read a file, or standard input where the path is "-".

    Arguments: path; at_most, the number of bytes to stop at. Result: the bytes, and the name that messages give them.
    Raises DataError: no such file, a directory, or a file that cannot be read.
    """
    with opened(path) as stream:
        return stream.read(at_most), STDIN if str(path) == "-" else str(path)


def os_reason(error: Exception) -> str:
    """Return why a file cannot be read, in the words of the system."""
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)


_ALIKE = 0.65  # share of letters, without the ending, from which a name looks like another one


def _near_files(path: Path) -> list[str]:
    """Return the files whose names resemble that of a missing one. Raises OSError, ValueError without its directory."""
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

_Identity = tuple[int, int] | tuple[int, int, str]  # device and inode: of a file; of its folder, with its name there

_inputs: dict[_Identity, str] = {}
_outputs: dict[_Identity, str] = {}
_kept: set[str] = set()
_written: set[str] = set()


def begin_run() -> None:
    """Forget the files of the run before; a file that takes standard output is the first of this one."""
    for names_of_files in (_inputs, _outputs, _kept, _written):
        names_of_files.clear()
    with suppress(OSError, ValueError):
        _outputs.update(dict.fromkeys(_file(sys.stdout.fileno()), "standard output"))


def note_input(file: str | int, name: str = "") -> None:
    """Note that a run reads a file, by its path or descriptor; name, for messages: its path without.

    Raises UsageError: the file is an output of the run, and not one of its own that it goes on with.
    """
    for identity in _file(file):
        _inputs[identity] = name or str(file)
        if identity in _outputs and _inputs[identity] not in _kept:
            raise UsageError(f"{_outputs[identity]} is also an input of this run", "write the result to another file")


def claim_output(path: str, *, is_kept: bool = False) -> None:
    """Note that a run writes a file; is_kept, whether it continues the contents of that file.

    Raises UsageError: the run reads that file, or writes it for another option.
    """
    if path == "-":
        return
    identities = _file(path) + _place(path)
    for identity in identities:
        if identity in _inputs:
            raise UsageError(f"{path} is also an input of this run", "write the result to another file")
        if identity in _outputs:
            raise UsageError(f"{path} would receive two results", "write each to its own file")
    _outputs.update(dict.fromkeys(identities, path))
    if is_kept:
        _kept.add(path)


def is_claimed(path: str) -> bool:
    """Return whether a file was claimed under this name."""
    return path in _outputs.values()


def note_written(path: str) -> None:
    """Note that an answer stands in a file, or on standard output as "-"."""
    _written.add(path)


def is_written(path: str) -> bool:
    """Return whether an answer stands there."""
    return path in _written


def _file(file: str | int) -> list[_Identity]:
    """Return whether there is a regular file: devices and pipes take any number of answers."""
    with suppress(OSError, ValueError):
        status = os.fstat(file) if isinstance(file, int) else Path(file).stat()
        return [(status.st_dev, status.st_ino)] if stat.S_ISREG(status.st_mode) else []
    return []


def _place(path: str) -> list[_Identity]:
    """Return where a file is or will be, whatever the case of its name."""
    with suppress(OSError, ValueError):
        real = Path(os.path.realpath(path))
        if real.is_file() or not real.exists():
            folder = real.parent.stat()
            return [(folder.st_dev, folder.st_ino, unicodedata.normalize("NFC", real.name).casefold())]
    return []


# Controls but for newline and tab, marks that turn the writing's direction or have no width, line and paragraph
# separators, halves of surrogate pairs, and noncharacters; all characters that XML 1.0 does not have are among them.
_HIDDEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u00ad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ufffe\uffff\ud800-\udfff\U000e0000-\U000e007f]"
)


def visible(text: str) -> str:
    """Return the text with hidden characters escaped (\\x1b, \\u202e); newlines, tabs and all that is seen stay."""
    return _HIDDEN.sub(lambda found: escaped(found[0]), text)


def escaped(character: str) -> str:
    """Return a character as Python writes it in 7 bits."""
    return character.encode("unicode_escape").decode()


def printable(json: str) -> str:
    """Return JSON of 7 bits with DEL escaped as well, the one control character that JSON allows as it is."""
    return json.replace("\x7f", "\\u007f")


UNSIGNED = r"(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
NUMBER = rf"[-+]?{UNSIGNED}"


GREATEST = 1e30  # magnitude of a number that is read: its square is finite, and so are sums of squares


def number_of(text: str) -> float:
    """Return the value of a number, spaces around it allowed; NaN for any other text, infinity beyond GREATEST."""
    return bounded(float(text)) if re.fullmatch(NUMBER, text.strip()) else nan


def bounded(value: float) -> float:
    """Return a number as it is, or infinity with its sign if its magnitude is beyond GREATEST."""
    return copysign(inf, value) if abs(value) > GREATEST else value


def with_decimal_points(text: str) -> str:
    """Return a value with decimal points in place of commas, unless these may separate thousands."""
    may_be_thousands = "." in text or re.search(r"(?<![0-9,])[1-9][0-9]{0,2}(,[0-9]{3})+(?![0-9])", text)
    return text if may_be_thousands else re.sub(r"(?<=[0-9]),(?=[0-9])", ".", text)


def package_table(name: str, parse_float: Callable[[str], Any] = float) -> dict[str, Any]:
    """Return what a TOML file of this package declares; parse_float makes its numbers."""
    return tomllib.loads(files("hdassist").joinpath(name).read_text("utf-8"), parse_float=parse_float)


# --- presets by name, from a file, or from standard input

READ_AT_MOST = 1024 * 1024  # more than a preset may have, so that it is refused with the reason


def preset_names() -> list[str]:
    """Return the names of the presets that come with hdassist, in alphabetical order."""
    return sorted(_library())


def read_preset(name_or_path: str) -> tuple[bytes, str]:
    """Return the bytes of a preset, and the name that messages give it.

    Argument: a name from the library, a path, or "-" for standard input.
    Raises DataError: no such preset, or a file that cannot be read.
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


@cache  # a lot asks for it with each of its rows
def _library() -> dict[str, Traversable]:
    """Return the presets by name: from the package, or from the checkout that the package lies in."""
    places: list[Traversable] = [files("hdassist") / "presets", Path(__file__).parents[1] / "presets"]
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
