"""Files that instruments write: their bytes from a path or standard input, and their text."""

from __future__ import annotations

import difflib
import sys
import zlib
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from pathlib import Path

from hdassist.errors import DataError, Finding, PresetError

STDIN = "<stdin>"
GZIP = b"\x1f\x8b"


def read_bytes(path: str | Path, at_most: int) -> tuple[bytes, str]:
    """Read a file, or standard input where the path is "-".

    Arguments: path; at_most, the number of bytes to stop at. Result: the bytes, and the name that messages give them.
    Raises DataError: no such file, a directory, or a file that cannot be read.
    """
    name = str(path)
    if name == "-":
        return standard_input(at_most), STDIN
    if not name:
        raise DataError("no such file: an empty name", "- is standard input")
    try:
        with Path(name).open("rb") as stream:
            return stream.read(at_most), name
    except FileNotFoundError:
        raise DataError(f"no such file: {name}", _near_by(Path(name))) from None
    except IsADirectoryError:
        raise DataError(f"{name} is a directory, not a file", "name the file in it") from None
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
        raise DataError(f"cannot read {name}: {reason(error)}") from None


def standard_input(at_most: int) -> bytes:
    """Bytes of standard input, at most so many.

    Raises DataError: standard input is closed or cannot be read.
    """
    if sys.stdin is None:
        raise DataError("cannot read standard input: it is closed")
    try:
        return sys.stdin.buffer.read(at_most)
    except OSError as error:
        raise DataError(f"cannot read standard input: {reason(error)}") from None


def reason(error: Exception) -> str:
    """Why a file cannot be read, in the words of the system."""
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)


def decode(data: bytes, file: str, at_most: int) -> tuple[str, bool]:
    """Text of a file in UTF-8, in UTF-16 with its byte order mark, or else in Latin-1; packed by gzip or not.

    Arguments: data; file, its name in messages; at_most, the number of bytes that it may have, packed and unpacked.
    Result: the text, and whether it had to be read as Latin-1.
    Raises PresetError: too large, empty, binary, damaged, or not in the encoding that its first bytes say.
    """
    if data.startswith(GZIP) and len(data) <= at_most:
        data = _unpacked(data, file, at_most)
    if len(data) > at_most:
        size = f"{at_most / 1e6:g} MB" if at_most >= 1e6 else f"{at_most} bytes"
        raise _refusal(file, f"the file is larger than {size}", hint="is this the file with the table?")
    marked = [(BOM_UTF8, "utf-8"), (BOM_UTF16_LE, "utf-16-le"), (BOM_UTF16_BE, "utf-16-be")]
    mark, encoding = next((pair for pair in marked if data.startswith(pair[0])), (b"", "utf-8"))
    latin = False
    try:
        text = data[len(mark) :].decode(encoding)
    except UnicodeDecodeError as error:
        if mark:
            said = f"not {encoding[:6].upper().rstrip('-')} text, which its first bytes say"
            got = f"byte 0x{data[len(mark) + error.start]:02x}"
            raise _refusal(file, said, got, "save the file as UTF-8") from None
        text, latin = data.decode("latin-1"), True
    if "\0" in text:
        at = text.index("\0")
        hint = "save the table as text: CSV in UTF-8"
        raise _refusal(file, "a binary file", "a NUL character", hint, text.count("\n", 0, at) + 1)
    if not text.strip("\x1a \t\r\n"):
        raise _refusal(file, "the file is empty", hint="was the measurement saved?")
    return text.rstrip("\x1a"), latin


def _unpacked(data: bytes, file: str, at_most: int) -> bytes:
    """Bytes that gzip has packed, one more than allowed where there are too many."""
    parts: list[bytes] = []
    size = 0
    try:
        while data.startswith(GZIP):  # gzip files may be joined
            member = zlib.decompressobj(wbits=16 + zlib.MAX_WBITS)
            parts.append(member.decompress(data, at_most + 1 - size))
            size += len(parts[-1])
            if size > at_most:
                break
            if not member.eof:
                raise _refusal(file, "a gzip file that ends too early", hint="was it copied to its end?")
            data = member.unused_data
    except zlib.error:
        raise _refusal(file, "a damaged gzip file", hint="does gzip -t accept it?") from None
    return b"".join(parts)


def _refusal(file: str, message: str, got: str = "", hint: str = "", line: int = 1) -> PresetError:
    return PresetError([Finding(file, line, 1, "", message, got, hint)])


def _near_by(path: Path) -> str:
    """A hint at files beside it whose names look like the one that is missing."""
    try:
        names = [item.name for item in path.parent.iterdir()]
    except (OSError, ValueError):
        return f"there is no directory {path.parent} either"
    close = difflib.get_close_matches(path.name[:60], names, 3, 0.6)
    return f"did you mean {' or '.join(str(path.parent / name) for name in close)}?" if close else "is the path right?"
