"""Results of very many items in an append-only file: what was written stays, and the same command goes on after it.

JSON Lines: a header that says what decides the numbers, then a record an item, in the order of the items. A run that
was killed leaves whole records, and half a line at most behind them.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import ConfigDict, TypeAdapter, ValidationError

from hdassist.errors import DataError, UsageError
from hdassist.preset.yamltext import shown
from hdassist.textfile import PART, is_file, is_there, opened
from hdassist.version import __version__
from hdassist.visible import printable

SCHEMA: Literal["hdassist.results/1"] = "hdassist.results/1"
LONGEST = 1 << 20  # bytes of a line
PATIENCE = 1.0  # s: processes that a killed run has begun hold its lock until they have ended too

Record = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Header:
    """What decides the records of a file: command, preset with its SHA-256, options, seed, version of hdassist."""

    __pydantic_config__ = ConfigDict(extra="forbid", allow_inf_nan=False)

    schema: Literal["hdassist.results/1"] = SCHEMA
    command: str
    preset: str
    preset_sha256: str
    options: Mapping[str, Any]
    seed: int | None = None
    version: str = __version__

    def told(self) -> dict[str, Any]:
        """The header as a JSON object."""
        return dict(_HEADER.dump_python(self))


_HEADER = TypeAdapter(Header)


class Results:
    """An open file of results; done, how many whole records it has. Made by `open_results`."""

    def __init__(self, descriptor: int, path: str | None, header: Header, anew: bool) -> None:
        self.done = 0
        self._descriptor, self._path = descriptor, path
        line = _line(header.told())
        self._begin = len(line)
        there = b"" if anew else os.pread(descriptor, LONGEST, 0)
        if line.startswith(there) and there != line:  # nothing, or what a run that was killed has begun to write
            self._cut(0)
            self._write(line)
        else:
            _require_same(_header(there, str(path)), header, str(path))
            self._take_up()

    def append(self, records: Sequence[Record]) -> None:
        """Write the records of the next items; when this returns they outlast a loss of power.

        Raises DataError: they cannot be written.
        """
        self._write(b"".join(_line({"item": k, **record}) for k, record in enumerate(records, self.done)))
        self.done += len(records)

    def records(self) -> Iterator[Record]:
        """The records that are there, in the order of the items."""
        for k, line in zip(range(self.done), _lines(self._descriptor, self._begin), strict=False):
            yield _record(line, k) or {}

    def _take_up(self) -> None:
        """Count whole records, and cut off what a killed run or a loss of power has left behind the last of them."""
        end, size = self._begin, os.fstat(self._descriptor).st_size
        for line in _lines(self._descriptor, end):
            if _record(line, self.done) is None:
                is_half = not line.endswith(b"\n") and end + len(line) == size
                if not is_half and b"\0" not in line:  # zeros stand where power was lost before data came to the disk
                    words = f"{self._path}: line {self.done + 2} is not the record of item {self.done}"
                    raise DataError(
                        words, "it was changed: take out this line and all below, and the same command goes on"
                    )
                self._cut(end)
                return
            self.done += 1
            end += len(line)

    def _cut(self, size: int) -> None:
        with _said(self._path):
            os.ftruncate(self._descriptor, size)

    def _write(self, data: bytes) -> None:
        with _said(self._path, "" if self._path is None else "the same command goes on behind what is kept"):
            left = memoryview(data)
            while left:
                left = left[os.write(self._descriptor, left) :]
            if self._path is not None:
                os.fsync(self._descriptor)


@contextmanager
def open_results(path: str | None, header: Header, *, force: bool = False) -> Iterator[Results]:
    """A file to which results are added, behind those that a run before it has left there.

    Arguments: path, None for a file without a name that goes when it is closed; header of this run; force, whether
    whatever is there is replaced. Raises UsageError: the file holds anything else than results of this header, or
    another run writes it; DataError: it cannot be written, or was changed. Then it is as it was.
    """
    with _said(path):
        descriptor = _open(path)
    try:
        _lock(descriptor, path)
        yield Results(descriptor, path, header, force)
    finally:
        os.close(descriptor)  # and with it the lock


@contextmanager
def read_results(path: str) -> Iterator[tuple[Header, Iterator[Record]]]:
    """Header and records of a file of results, each record read when it is asked for; half a line is left out.

    Raises DataError: a file that cannot be read, or was changed; UsageError: one that is none of results.
    """
    with opened(path) as stream:
        line = stream.readline(LONGEST)

        def records() -> Iterator[Record]:
            for k, text in enumerate(iter(lambda: stream.readline(LONGEST), b"")):
                record = _record(text, k)
                if record is None:
                    if b"\0" not in text and (text.endswith(b"\n") or stream.read(1)):
                        raise DataError(f"{path}: line {k + 2} is not the record of item {k}", "it was changed")
                    return
                yield record

        yield _header(line, path), records()


def _open(path: str | None) -> int:
    if path is None:
        with tempfile.TemporaryFile() as file:
            return os.dup(file.fileno())
    if is_there(path) and not is_file(path):
        raise DataError(f"{path} is no file that results can be kept in")
    return os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o666)


def _lock(descriptor: int, path: str | None) -> None:
    """Hold the file until it is closed or this process ends, in any way. Raises UsageError: another run holds it."""
    import fcntl

    begun = time.monotonic()
    while True:
        try:
            with _said(path):
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if time.monotonic() - begun > PATIENCE:
                words = f"{path} is being written by another run"
                raise UsageError(words, "wait for it to end, or name another file") from None
            time.sleep(0.05)


@contextmanager
def _said(path: str | None, hint: str = "") -> Iterator[None]:
    """Raise DataError, with a hint, for what the system says of a file; BlockingIOError, that of a lock, as it is."""
    try:
        yield
    except BlockingIOError:
        raise
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
        name = "a temporary file" if path is None else path or "a file without a name"
        raise DataError(f"cannot write {name}: {getattr(error, 'strerror', None) or error}", hint) from None


def _line(told: Mapping[str, Any]) -> bytes:
    """A JSON object on a line; never NaN or Infinity, and each float as it is."""
    text = json.dumps(told, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return printable(text).encode() + b"\n"


def _lines(descriptor: int, at: int) -> Iterator[bytes]:
    """Lines of a file from a place on, each with its end; one that is longer than any of ours breaks off."""
    rest = b""
    while part := os.pread(descriptor, PART, at):
        at += len(part)
        *whole, rest = (rest + part).split(b"\n")
        yield from (line + b"\n" for line in whole)
        if len(rest) > LONGEST:
            break
    if rest:
        yield rest


def _record(line: bytes, item: int) -> Record | None:
    """The record of an item as its line has it; None where it is none."""
    try:
        told = json.loads(line) if line.endswith(b"\n") else None
    except (ValueError, RecursionError):
        return None
    return told if isinstance(told, dict) and told.pop("item", None) == item else None


def _header(start: bytes, path: str) -> Header:
    """The header that a file begins with. Raises UsageError: it is none of ours."""
    line, end, _ = start.partition(b"\n")
    try:
        told = json.loads(line) if end else None
    except (ValueError, RecursionError):
        told = None
    if not isinstance(told, dict) or told.get("schema") != SCHEMA:
        raise UsageError(f"{path} exists, and holds no results of hdassist", "name another file; --force replaces it")
    try:
        return _HEADER.validate_python(told)
    except ValidationError:
        words = f"{path} holds results whose header cannot be read: another version of hdassist wrote it"
        raise UsageError(words, "name another file; --force replaces it") from None


def _require_same(there: Header, here: Header, path: str) -> None:
    """Raise UsageError, with what differs, where the records of a file are not those of this header."""
    before, now = (_flat(json.loads(_line(header.told()))) for header in (there, here))
    told = [
        f"{key}: {shown(json.dumps(before.get(key)))} there, {shown(json.dumps(now.get(key)))} here"
        for key in sorted(before.keys() | now.keys())
        if before.get(key) != now.get(key)
    ]
    if told:
        words = f"{path} holds the results of another run: {'; '.join(told)}"
        raise UsageError(words, "name another file; --force replaces it")


def _flat(told: dict[str, Any]) -> dict[str, Any]:
    options = told.pop("options")
    return told | {f"options.{key}": value for key, value in options.items()}
