"""The files of a run: an output is never an input of the same run, nor another output of it.

Files are compared by device and inode, not by name: links and other cases of a name are the same file.
"""

import os
import stat
import sys
import unicodedata
from contextlib import suppress
from pathlib import Path

from hdassist.errors import UsageError

Identity = tuple[int, int] | tuple[int, int, str]  # device and inode: of a file; of its folder, with its name there

_inputs: dict[Identity, str] = {}
_outputs: dict[Identity, str] = {}
_kept: set[str] = set()
_written: set[str] = set()


def begin_run() -> None:
    """Forget the files of the run before; a file that takes standard output is the first of this one."""
    for known in (_inputs, _outputs, _kept, _written):
        known.clear()
    with suppress(OSError, ValueError):
        _outputs.update(dict.fromkeys(_file(sys.stdout.fileno()), "standard output"))


def note_input(file: str | int, name: str = "") -> None:
    """Note that a run reads a file, by its path or descriptor; name, for messages: its path without.

    Raises UsageError: the file is an output of the run, and not one of its own that it goes on with.
    """
    for identity in _file(file):
        _inputs[identity] = name or str(file)
        if identity in _outputs and _inputs[identity] not in _kept:
            raise UsageError(f"{_outputs[identity]} is an input of this run too", "name another file for the answer")


def claim_output(path: str, *, is_kept: bool = False) -> None:
    """Note that a run writes a file; is_kept, whether it continues the contents of that file.

    Raises UsageError: the run reads that file, or writes it for another option.
    """
    if path == "-":
        return
    identities = _file(path) + _place(path)
    for identity in identities:
        if identity in _inputs:
            raise UsageError(f"{path} is an input of this run too", "name another file for the answer")
        if identity in _outputs:
            raise UsageError(f"{path} is to take two answers", "each needs a file of its own")
    _outputs.update(dict.fromkeys(identities, path))
    if is_kept:
        _kept.add(path)


def is_claimed(path: str) -> bool:
    """Whether a file was claimed under this name."""
    return path in _outputs.values()


def note_written(path: str) -> None:
    """Note that an answer stands in a file, or on standard output as "-"."""
    _written.add(path)


def is_written(path: str) -> bool:
    """Whether an answer stands there."""
    return path in _written


def _file(file: str | int) -> list[Identity]:
    """A regular file that is there: devices and pipes take any number of answers."""
    with suppress(OSError, ValueError):
        found = os.fstat(file) if isinstance(file, int) else Path(file).stat()
        return [(found.st_dev, found.st_ino)] if stat.S_ISREG(found.st_mode) else []
    return []


def _place(path: str) -> list[Identity]:
    """Where a file is or will be, whatever the case of its name."""
    with suppress(OSError, ValueError):
        real = Path(os.path.realpath(path))
        if real.is_file() or not real.exists():
            folder = real.parent.stat()
            return [(folder.st_dev, folder.st_ino, unicodedata.normalize("NFC", real.name).casefold())]
    return []
