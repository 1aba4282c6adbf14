"""Answers kept in the user's cache folder: found again by all that they depend on, and never trusted as they stand.

They have a folder of their own in the one that is named, for this user alone, and are reached through its descriptor:
no link is followed and no file of another owner read, replaced or removed. A file is named by its kind and key; its
first line has the key and the checksum of the rest. Whatever does not hold is as if it were not there. The folder may
be emptied at any time, and where it cannot be used no data are kept.
"""

import json
import os
import platform
import re
import secrets
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, cached_property
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Generic, TypeVar

from platformdirs import user_cache_path
from pydantic import TypeAdapter

_AnswerT = TypeVar("_AnswerT")

FOLDER, NO_CACHE = "HDASSIST_CACHE", "HDASSIST_NO_CACHE"  # variables: another folder; whether answers are not kept
OWN_FOLDER = "answers"  # in the folder of the cache
_LARGEST_FILE = 1 << 24  # bytes of a file
MOST = 1 << 26  # bytes of all files: above it the oldest go
_OLDEST_LEFT = 0.75  # of MOST, that is left then
_OWN_FILE = re.compile(r"\.?[a-z]+-[0-9a-f]{16}(\.[0-9a-f]{8}\.part)?")  # a kept one, or one that is being written
_OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH
_AS_IT_IS = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)  # no link is followed, no pipe waited for
_UNUSABLE = (OSError, ValueError, AttributeError)  # a path with a NUL; a system without owners or folders to open


class _UnsafeFolderError(OSError):
    """A folder of the cache that another user can write to."""


def cache_folder() -> Path:
    """Folder of the user's cache, which may be emptied at any time."""
    return Path(named) if (named := os.environ.get(FOLDER)) else user_cache_path("hdassist")


def keeps_answers() -> bool:
    """Whether answers are read from the cache and kept there."""
    return not os.environ.get(NO_CACHE)


@cache
def program(*packages: str) -> tuple[str, ...]:
    """All of this installation that answers depend on, with packages by name beside numpy and scipy."""
    source = sha256()
    package = Path(__file__).parents[1]
    for path in sorted(path for kind in ("*.py", "*.toml", "*.c") for path in package.rglob(kind)):
        source.update(path.read_bytes())
    kernels = [f"{name}={text}" for name, text in sorted(os.environ.items()) if name.startswith("OPENBLAS_")]
    versions = [f"{name} {version(name)}" for name in ("numpy", "scipy", *packages)]
    return source.hexdigest(), *versions, *kernels, platform.python_version()


def why_unsafe() -> str:
    """Why answers are neither kept nor read in the folder of the cache: who else could have written them, or empty."""
    with suppress(*_UNUSABLE):
        try:
            with _own_folder():
                pass
        except _UnsafeFolderError as error:
            return str(error)
    return ""


def cached(kind: str, key: str) -> bytes | None:
    """Data kept of a kind by a key (SHA-256); None where there are none, or they do not hold."""
    with suppress(*_UNUSABLE), _own_folder() as folder:
        descriptor = os.open(_name(kind, key), os.O_RDONLY | _AS_IT_IS, dir_fd=folder)
        with os.fdopen(descriptor, "rb") as file:
            about = os.fstat(descriptor)
            if _is_own(about) and about.st_size <= _LARGEST_FILE:
                first, _, data = file.read().partition(b"\n")
                if first == _first_line(key, data):
                    os.utime(descriptor)  # the oldest go first
                    return data
    return None


def keep(kind: str, key: str, data: bytes) -> None:
    """Keep data of a kind by a key (SHA-256), in place of those before; none where that cannot be written."""
    name, line = _name(kind, key), _first_line(key, data)
    if len(line) + len(data) >= _LARGEST_FILE:
        return
    beside = f".{name}.{secrets.token_hex(4)}.part"
    with suppress(*_UNUSABLE), _own_folder(makes=True) as folder:
        try:
            made = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _AS_IT_IS, 0o600, dir_fd=folder)
            with os.fdopen(made, "wb") as file:
                file.write(line + b"\n" + data)
            os.rename(beside, name, src_dir_fd=folder, dst_dir_fd=folder)
        except BaseException:
            with suppress(OSError):
                os.unlink(beside, dir_fd=folder)
            raise
        _prune(folder, MOST, _OLDEST_LEFT * MOST)


def kept_answer(
    kind: str, depends: object, adapter: TypeAdapter[_AnswerT], compute: Callable[[], _AnswerT]
) -> _AnswerT:
    """An answer of a kind as it is kept, or computed and kept.

    Arguments: depends, all that decides it, as JSON; adapter, its type.
    """
    answer = KeptAnswer(kind, depends, adapter)
    if (found := answer.found()) is None:
        answer.keep(found := compute())
    return found


@dataclass(frozen=True)
class KeptAnswer(Generic[_AnswerT]):
    """An answer of a kind that is kept, or will be.

    depends, all that decides it, as JSON; adapter, its type.
    """

    kind: str
    depends: object
    adapter: TypeAdapter[_AnswerT]

    @cached_property
    def _key(self) -> str:
        return sha256(json.dumps(self.depends, sort_keys=True).encode()).hexdigest()

    def found(self) -> _AnswerT | None:
        """The answer as it is kept; None where there is none, or it does not hold."""
        with suppress(ValueError):
            return self.adapter.validate_json((keeps_answers() and cached(self.kind, self._key)) or b"")
        return None

    def keep(self, answer: _AnswerT) -> None:
        """Keep the answer, where answers are kept."""
        if keeps_answers():
            keep(self.kind, self._key, self.adapter.dump_json(answer))


def cached_files() -> list[int]:
    """Sizes of the files that are kept [bytes]."""
    with suppress(*_UNUSABLE), _own_folder() as folder:
        return [about.st_size for _, about in _files(folder)]
    return []


def empty_cache() -> None:
    """Remove all that is kept, and no other file. Raises OSError: one cannot be removed."""
    with suppress(FileNotFoundError), _own_folder() as folder:
        _prune(folder, 0, 0)


def _prune(folder: int, most: float, left: float) -> None:
    """Remove the oldest files until so many bytes are left, where there are more than most."""
    files = _files(folder)
    total = sum(about.st_size for _, about in files)
    for name, about in files if total > most else ():
        if total > left:
            with suppress(FileNotFoundError):
                os.unlink(name, dir_fd=folder)
            total -= about.st_size


def _files(folder: int) -> list[tuple[str, os.stat_result]]:
    """Name of each file of the cache, and what is known of it, the one first that was used the longest ago."""
    found = []
    for name in os.listdir(folder):
        if _OWN_FILE.fullmatch(name):
            with suppress(OSError):
                found.append((name, os.stat(name, dir_fd=folder, follow_symlinks=False)))
    return sorted((each for each in found if _is_own(each[1])), key=lambda each: each[1].st_mtime)


@contextmanager
def _own_folder(*, makes: bool = False) -> Iterator[int]:
    """Descriptor of the folder for this user alone; makes: whether it is made where there is none.

    Raises FileNotFoundError: there is none; UnsafeFolderError; others of _UNUSABLE: it cannot be opened.
    """
    named, user = cache_folder(), os.geteuid()
    if makes:
        named.mkdir(mode=0o700, parents=True, exist_ok=True)
    above = os.open(named, os.O_RDONLY | os.O_DIRECTORY)
    try:
        about = os.fstat(above)
        if about.st_uid not in (user, 0) or about.st_mode & _OTHERS_MAY_WRITE:
            raise _UnsafeFolderError(f"another user can write to {named}")
        if makes:
            with suppress(FileExistsError):
                os.mkdir(OWN_FOLDER, 0o700, dir_fd=above)
        folder = os.open(OWN_FOLDER, os.O_RDONLY | os.O_DIRECTORY | _AS_IT_IS, dir_fd=above)
    finally:
        os.close(above)
    try:
        about = os.fstat(folder)
        if about.st_uid != user or about.st_mode & _OTHERS_MAY_WRITE:
            raise _UnsafeFolderError(f"another user can write to {named / OWN_FOLDER}")
        yield folder
    finally:
        os.close(folder)


def _is_own(about: os.stat_result) -> bool:
    """Whether it is a regular file that this user alone can write."""
    return stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid() and not about.st_mode & _OTHERS_MAY_WRITE


def _name(kind: str, key: str) -> str:
    return f"{kind}-{key[:16]}"


def _first_line(key: str, data: bytes) -> bytes:
    return f"{key} {sha256(data).hexdigest()}".encode()
