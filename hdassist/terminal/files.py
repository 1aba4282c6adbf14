"""Files that appear whole or not at all, and never over another one unasked."""

import errno
import os
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from hdassist.errors import DataError, Fault, UsageError
from hdassist.files import claim_output, in_place_of, is_claimed, is_file, is_there, note_written
from hdassist.plaintext import visible
from hdassist.run.stops import at_stop
from hdassist.terminal.console import say, silence


def write_text(path: str, text: str, force: bool) -> None:
    """Write text as UTF-8, and "wrote FILE" on standard error; a terminal gets it with hidden characters escaped.

    Arguments: path, "-" for standard output; text; force, whether an existing file may be replaced.
    Raises UsageError: the file exists; DataError: it cannot be written. Then no file has changed.
    """
    note_written(path)
    if path == "-":
        encoding = sys.stdout.encoding or "utf-8"
        if sys.stdout.isatty():
            text = visible(text.replace("\r\n", "\n"))
        give_stdout(text.encode(encoding, "backslashreplace").decode(encoding))
        return
    if not is_claimed(path):
        claim_output(path)
    require_writable(path, force)
    put_text(path, text)
    say(f"wrote {path}")


def begins_with(path: str, heads: Sequence[str]) -> bool:
    """Whether a file begins with one of some texts."""
    try:
        with Path(path).open("rb") as stream:
            start = stream.read(max(map(len, heads)))
    except (OSError, ValueError):
        return False
    return start.startswith(tuple(head.encode() for head in heads))


def give_stdout(answer: str | bytes) -> None:
    """Write to standard output; silent where its reader has gone. Raises DataError: it cannot be written."""
    try:
        if isinstance(answer, bytes):
            sys.stdout.buffer.write(answer)
        else:
            sys.stdout.write(answer)
        sys.stdout.flush()
    except BrokenPipeError:
        silence()
    except OSError as error:
        silence()  # or the rest of the buffer fails once more at the end
        raise _unwritable("standard output", error.strerror or str(error)) from None


def put_text(path: str, text: str) -> None:
    """Write text as UTF-8 to a file, in place of its content. Raises DataError: it cannot be; then no file changed."""
    target, data = Path(path), text.encode("utf-8", "backslashreplace")
    try:
        if _is_device(target):
            with open(target, "wb", opener=_at_once) as stream:
                stream.write(data)
        else:
            with in_place_of(target) as beside, at_stop(partial(beside.unlink, missing_ok=True)):
                descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
                with open(descriptor, "wb") as stream:  # noqa: PTH123 (a descriptor has no path)
                    stream.write(data)
    except OSError as error:
        reason = "nobody reads the pipe" if error.errno == errno.ENXIO else error.strerror or str(error)
        raise _unwritable(path, reason) from None


def _at_once(path: str, flags: int) -> int:
    """Open a device or a pipe to write. Raises OSError: nobody reads the pipe, for whom open() would wait."""
    descriptor = os.open(path, (flags | getattr(os, "O_NONBLOCK", 0)) & ~os.O_CREAT)
    if hasattr(os, "O_NONBLOCK"):
        os.set_blocking(descriptor, True)
    return descriptor


def take_output(path: str, force: bool, *, is_kept: bool = False) -> None:
    """Claim a file for an answer of this run, before anything is computed for it.

    Arguments: path, "-" for standard output; force, whether an existing file may be replaced; is_kept, whether the run
    goes on with its content. Raises UsageError: the file exists, or the run reads it or writes it for another option;
    DataError: it cannot be written.
    """
    claim_output(path, is_kept=is_kept)
    require_writable(path, force or is_kept)


def require_writable(path: str, force: bool) -> None:
    """Refuse a file that `write_text` would refuse, before anything is computed for it.

    Arguments: path, "-" for standard output; force, whether an existing file may be replaced.
    Raises UsageError: the file exists; DataError: it cannot be written.
    """
    if path == "-":
        return
    target = Path(path)
    try:
        if not path or target.is_dir():
            raise _unwritable(path, "it is a directory" if path else "it has no name")
        if target.exists() and not _is_device(target) and not force:
            raise UsageError(f"{path} exists", "--force replaces it", Fault.FILE_EXISTS)
        if _real(target).is_symlink():
            raise _unwritable(path, "its links go round in a circle")
        folder = _real(target).parent
        if not folder.is_dir():
            raise _unwritable(path, f"there is no directory {folder}")
        if not os.access(target if _is_device(target) else folder, os.W_OK):
            raise _unwritable(path, "no permission")
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
        raise _unwritable(path, getattr(error, "strerror", None) or str(error)) from None


def _real(target: Path) -> Path:
    """The target of a link: the link stays one when its file is replaced."""
    return Path(os.path.realpath(target))


def _is_device(target: Path) -> bool:
    """A device or a pipe, which keeps no content and must not be replaced."""
    return is_there(target) and not is_file(target)


def _unwritable(path: str, reason: str) -> DataError:
    return DataError(f"cannot write {path or 'a file'}: {reason}", "", Fault.FILE_UNWRITABLE)
