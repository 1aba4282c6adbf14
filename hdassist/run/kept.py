"""Storage of results: records in a file from which the same command resumes, and results in the user's cache folder.

The records of all commands have one JSON Lines form. The first line is the owner: the command that made the records,
and its inputs. Each further line is a record with its number (item, from 0), its fields, and a checksum of this line
and the line above. No line can therefore be changed, moved, duplicated or removed between others. An invalid record is
rejected with its line number. An incomplete last line of a killed run is dropped.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import secrets
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import asdict, dataclass, field
from functools import cache, cached_property, partial
from hashlib import sha256
from importlib.metadata import version
from io import BytesIO
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Generic, Literal, TypeVar

from platformdirs import user_cache_path
from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter, ValidationError

from hdassist import __version__
from hdassist.run import system
from hdassist.run.errors import DataError, Fault, UsageError, validation_words
from hdassist.run.files import in_place_of, is_file, is_there, os_reason, printable
from hdassist.run.stops import at_stop
from hdassist.run.system import PrivateFolder, UnsafeFolderError, private_folder

_KEPT_SCHEMA: Literal["hdassist.kept/1"] = "hdassist.kept/1"
_LONGEST_LINE = 1 << 26  # largest length of a line [bytes]
# time to wait for a lock [s], because processes started by a killed run hold its lock until they have ended
LOCK_PATIENCE = 1.0
_DIGITS = 16  # digits of a checksum

Number = Annotated[float, Field(strict=True)]
Magnitude = Annotated[float, Field(strict=True, ge=0)]
Count = Annotated[int, Field(strict=True, ge=0)]
_RecordT = TypeVar("_RecordT")


def own_schema(own: str) -> AfterValidator:
    """Return a validator that accepts only the given schema of a record and rejects any other by name."""

    def require(schema: str) -> str:
        if schema != own:
            raise ValueError(f"the schema is {schema[:60]}, but this version of hdassist reads and writes {own}")
        return schema

    return AfterValidator(require)


class ClosedRecord:
    """Base class of records in files written by hdassist; extra fields and numbers that are not finite are invalid."""

    __pydantic_config__ = ConfigDict(extra="forbid", allow_inf_nan=False)


@dataclass(frozen=True, kw_only=True)
class KeptOwner(ClosedRecord):
    """Owner of a file: everything that determines its records.

    version: version of hdassist; empty if each record has its own.
    preset: name of the drive; empty if there are several.
    inputs: SHA-256 of each input; empty if each record has its own.
    """

    schema: Literal["hdassist.kept/1"] = _KEPT_SCHEMA
    version: str = __version__
    command: str
    preset: str = ""
    inputs: Mapping[str, str]
    options: Mapping[str, Any] = field(default_factory=dict)
    seed: int | None = None

    def require_same(self, now: KeptOwner, path: str) -> None:
        """Raise UsageError with the differences if the records of the file belong to another owner.

        now: owner of this run.
        path: name of the file.
        """
        # a conversion to JSON and back makes tuples and lists equal
        before, after = (json.loads(json.dumps(asdict(owner))) for owner in (self, now))
        for inputs, name in product((before, after), ("inputs", "options")):
            # flat keys give each difference its own name
            inputs |= {f"{name}.{key}": value for key, value in inputs.pop(name).items()}
        differences = [
            f"{key}: {_short(before.get(key))} there, {_short(after.get(key))} here"
            for key in sorted(before.keys() | after.keys())
            if before.get(key) != after.get(key)
        ]
        if differences:
            raise UsageError(f"{path} contains results of another run: {'; '.join(differences)}", _OTHER_FILE)


_OWNER = TypeAdapter(KeptOwner)
_OTHER_FILE = "name another file, or delete this one"


@dataclass(frozen=True)
class RecordKind(Generic[_RecordT]):
    """Kind of the records of a file.

    adapter: type of the records, without other fields and with finite numbers.
    fault: function that returns the reason why a record cannot have an item number, or an empty text.
    hint: remedy for an invalid record.
    """

    adapter: TypeAdapter[_RecordT]
    fault: Callable[[int, _RecordT], str] = lambda _item, _record: ""
    hint: str = (
        "the file was changed or damaged; delete this line and all lines below it, then the same command resumes"
    )

    def read(
        self,
        lines: Iterable[bytes],
        above: bytes,
        name: str,
    ) -> Iterator[tuple[_RecordT, bytes]]:
        """Yield the records with their lines, except for an incomplete last line.

        lines: lines below the owner.
        above: checksum of the owner.
        name: name of the file in messages.

        Raises DataError for an invalid record.
        """
        checksum = above  # checksum of the previous line, which each line includes
        # each checksum covers the previous line, so no line can be moved or removed
        for item, line in enumerate(lines):
            try:
                fields, checksum = _unsealed(line, checksum)
                # another item number means that the line belongs to another position in the file
                if fields.pop("item", None) != item:
                    raise ValueError(f"expected item {item}")
                record = self.adapter.validate_python(fields)
                if fault := self.fault(item, record):
                    raise ValueError(fault)
            except (ValueError, RecursionError) as error:
                begin = b'{"item":%d,' % item
                # zeros appear where power was lost before data reached the disk
                start = line.rstrip(b"\0")[: len(begin)]
                # an incomplete last line of a killed run is computed again
                if not line.endswith(b"\n") and len(line) < _LONGEST_LINE and begin.startswith(start):
                    return
                raise DataError(f"{name}:{item + 2}: invalid record: {why_invalid(error)}", self.hint) from None
            yield record, line


@dataclass
class Kept(Generic[_RecordT]):
    """An open file of records, returned by `open_kept`.

    done: number of records, which a stop may read at any time.
    _lock: descriptor of the file whose lock excludes other runs, which is this file or a separate one.
    """

    _path: str | None
    _descriptor: int
    _lock: int
    _owner: KeptOwner
    _kind: RecordKind[_RecordT]
    done: int = 0
    _size: int = 0  # bytes
    _checksum: bytes = b""  # checksum of the last line

    def append(self, records: Iterable[_RecordT]) -> None:
        """Write the records of the next items; once this returns, they survive a power failure.

        Raises DataError if they cannot be written, or if the file differs from what this run has written.
        """
        lines = []
        checksum = self._checksum
        for item, record in enumerate(records, self.done):
            # include the checksum of the previous line
            lines.append(_sealed({"item": item, **self._kind.adapter.dump_python(record, mode="json")}, checksum))
            checksum = _checksum_of(lines[-1])
        # after a single write, a stop can only leave complete lines and one incomplete last line
        self._write(b"".join(lines), len(lines))
        self._checksum = checksum

    def records(self) -> Iterator[_RecordT]:
        """Yield the existing records in the order of the items, to be read before more are written.

        Raises DataError for an invalid record.
        """
        lines = _lines(self._descriptor)
        read = self._kind.read(lines, _checksum_of(next(lines, b"")), str(self._path))
        # the file is locked, so a missing record means that the file was changed without the lock
        for _ in range(self.done):
            if (record := next(read, None)) is None:
                raise self._lost()
            yield record[0]

    def rewrite(self, records: Iterable[_RecordT]) -> None:
        """Replace the whole content of the file by records of this run's owner, in one step."""
        assert self._path is not None
        if system.locks_beside():
            self._rewrite_closed(self._path, records)
        else:
            self._rewrite_open(self._path, records)

    def _rewrite_open(self, path: str, records: Iterable[_RecordT]) -> None:
        """Rewrite a file that is its own lock; the new file is locked before it receives the name."""
        with (
            _writing(path),
            in_place_of(path) as part_file,
            at_stop(partial(part_file.unlink, missing_ok=True)),
        ):
            descriptor, lock = _locked(str(part_file))
            # a complete file under another name replaces this file in one step
            fresh = Kept(
                _path=str(part_file),
                _descriptor=descriptor,
                _lock=lock,
                _owner=self._owner,
                _kind=self._kind,
            )
            fresh.begin()
            fresh.append(records)
        # the new file is already locked, so no other run can intervene
        os.close(self._descriptor)
        self._descriptor = descriptor
        self._lock = lock
        self._take_content(fresh)

    def _rewrite_closed(self, path: str, records: Iterable[_RecordT]) -> None:
        """Rewrite a file with a separate lock; both files are closed when the new one receives the name."""
        try:
            with (
                _writing(path),
                in_place_of(path) as part_file,
                at_stop(partial(part_file.unlink, missing_ok=True)),
            ):
                descriptor = _opened(str(part_file))
                try:
                    fresh = Kept(
                        _path=str(part_file),
                        _descriptor=descriptor,
                        _lock=self._lock,
                        _owner=self._owner,
                        _kind=self._kind,
                    )
                    fresh.begin()
                    fresh.append(records)
                finally:
                    os.close(descriptor)
                os.close(self._descriptor)
                self._descriptor = _CLOSED
        finally:
            # Windows does not replace an open file, so it was closed temporarily
            if self._descriptor == _CLOSED:
                with _writing(path):
                    self._descriptor = _opened(path)
        self._take_content(fresh)

    def _take_content(self, rewritten: Kept[_RecordT]) -> None:
        """Copy the state of the rewritten file, which now has the name of this one."""
        self.done = rewritten.done
        self._size = rewritten._size
        self._checksum = rewritten._checksum

    def require_there(self) -> None:
        """Raise DataError if the named file is not the file written by this run, or if it was truncated."""
        if self._path is None:
            return
        with suppress(OSError):
            status = Path(self._path).stat()
            # the name must still belong to the same file, which must not be shorter
            if os.path.samestat(status, os.fstat(self._descriptor)) and status.st_size >= self._size:
                return
        raise self._lost()

    def _lost(self) -> DataError:
        message = f"{self._path} was removed, replaced or truncated during this run"
        return DataError(message, "run the command again, and do not change the file meanwhile", Fault.FILE_UNWRITABLE)

    def begin(self) -> None:
        """Empty the file and write the owner."""
        self._cut(0)
        line = _sealed(asdict(self._owner), b"")
        self._write(line)
        self._checksum = _checksum_of(line)

    def take_up(self) -> None:
        """Count the existing records and drop an incomplete last line.

        Raises UsageError if the records belong to another run or were not written by hdassist, DataError for an invalid
        record.
        """
        name = str(self._path)
        lines = _lines(self._descriptor)
        first = next(lines, b"")
        # an incomplete owner was left by a run that was killed before it wrote any record
        if not first.endswith(b"\n") and _sealed(asdict(self._owner), b"").startswith(first):
            return self.begin()
        owner, self._checksum = _owner_of(first, name)
        # records with different inputs must not be mixed
        owner.require_same(self._owner, name)
        self._size = len(first)
        for _, line in self._kind.read(lines, self._checksum, name):
            self.done = self.done + 1
            self._size = self._size + len(line)
            self._checksum = _checksum_of(line)
        # anything after the last complete record is removed
        if os.fstat(self._descriptor).st_size > self._size:
            self._cut(self._size)
        return None

    def _cut(self, size: int) -> None:
        with _writing(self._path):
            os.ftruncate(self._descriptor, size)
        self._size = size

    def _write(self, data: bytes, records: int = 0) -> None:
        self.require_there()
        with _writing(self._path, "" if self._path is None else "resume with the same command"):
            remaining = memoryview(data)
            # a single call may write only part of the data
            while remaining:
                remaining = remaining[os.write(self._descriptor, remaining) :]
            self.done += records
            if self._path is not None:
                # a finished record must survive a power failure
                os.fsync(self._descriptor)
        self._size += len(data)


@contextmanager
def open_kept(
    path: str | None,
    owner: KeptOwner,
    kind: RecordKind[_RecordT],
    *,
    force: bool = False,
    patience: float = LOCK_PATIENCE,
) -> Iterator[Kept[_RecordT]]:
    """Open a file to which records are added after those of previous runs; only one run at a time has access.

    path: name of the file; None for a temporary file without a name.
    owner: owner of this run.
    kind: kind of the records.
    force: whether existing content is replaced.
    patience: time to wait for another run that has the file open [s].

    Raises UsageError if the file contains anything other than records of this owner or if another run is writing it,
    DataError if it cannot be written, contains an invalid record, or is removed or truncated while it is written.
    """
    descriptor, lock = _locked(path, patience)
    kept = Kept(
        _path=path,
        _descriptor=descriptor,
        _lock=lock,
        _owner=owner,
        _kind=kind,
    )
    try:
        # --force discards the existing content
        if force:
            kept.begin()
        else:
            kept.take_up()
        yield kept
        kept.require_there()
    finally:
        system.unlock(kept._lock)  # other processes may still have a descriptor of the file
        os.close(kept._descriptor)
        if path is not None and system.locks_beside():
            os.close(kept._lock)
            with suppress(OSError):  # fails while the next run is waiting for the lock
                _lock_file(path).unlink()


def read_kept(
    data: bytes,
    name: str,
    kind: RecordKind[_RecordT],
) -> list[_RecordT] | None:
    """Return the records of a file that is only read; None if the file has another form.

    Raises DataError for an invalid record.
    """
    lines = BytesIO(data)
    try:
        _, previous = _owner_of(lines.readline(), name)
    except UsageError:
        return None
    return [record for record, _ in kind.read(lines, previous, name)]


def _locked(path: str | None, patience: float = LOCK_PATIENCE) -> tuple[int, int]:
    """Return the descriptors of a file and of its lock, which lasts until both are closed or this process ends.

    Raises UsageError if another run has the lock, DataError if the file cannot be opened.
    """
    # without a name the records are in a temporary file, which disappears with the process
    if path is None:
        with _writing(path), tempfile.TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
        return descriptor, descriptor  # no other process can open it
    if path.endswith(".parquet"):
        raise UsageError(
            f"results are written as JSON Lines, not to {path}",
            "name a file FILE.jsonl; for a table, use --parquet FILE",
        )
    if is_there(path) and not is_file(path):
        raise DataError(f"{path} is not a file in which results can be stored", "name a regular file")
    if not system.locks_beside():
        descriptor = _held(path, path, patience)
        return descriptor, descriptor
    with _writing(path):
        place = str(_lock_file(path))
    lock = _held(place, path, patience)
    try:
        with _writing(path):
            return _opened(path), lock
    except DataError:
        os.close(lock)
        raise


def _held(
    place: str,
    path: str,
    patience: float,
) -> int:
    """Return the descriptor of a file locked by this process.

    place: file that carries the lock.
    path: name of the file in messages.
    patience: time to wait [s].
    """
    begun = time.monotonic()
    # the lock of a killed run ends with its last process
    while True:
        with _writing(path):
            descriptor = _opened(place)
            try:
                system.lock(descriptor)
                # another run may have replaced the file in the meantime
                if os.path.samestat(os.fstat(descriptor), Path(place).stat()):
                    return descriptor
            except FileNotFoundError:
                pass  # the file was replaced in the meantime
            except BlockingIOError:
                if time.monotonic() - begun > patience:
                    os.close(descriptor)  # Windows does not remove an open file
                    message = f"{path} is being written by another run"
                    raise UsageError(message, "wait for that run to end, or name another file") from None
                time.sleep(0.05)
            os.close(descriptor)


_CLOSED = -1  # value in place of the descriptor of a closed file


def _opened(path: str) -> int:
    """Return the descriptor of a file opened for reading and appending.

    Raises OSError if it cannot be opened.
    """
    return os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | system.BINARY, 0o666)


def _lock_file(path: str) -> Path:
    """Return the lock file of a file, which is the same for all links to it."""
    target = Path(os.path.realpath(path))
    return target.with_name(f".{target.name[:100]}.lock")


@contextmanager
def _writing(path: str | None, hint: str = "") -> Iterator[None]:
    """Convert an OSError or ValueError raised in the block into a DataError that names the file, with a hint."""
    try:
        yield
    except (OSError, ValueError) as error:  # ValueError: the path contains a NUL
        name = "a temporary file" if path is None else path or "a file without a name"
        raise DataError(f"cannot write {name}: {os_reason(error)}", hint, Fault.FILE_UNWRITABLE) from None


def _lines(descriptor: int) -> Iterator[bytes]:
    """Yield the lines of a file with their line ends; lines longer than _LONGEST_LINE are split."""
    with os.fdopen(os.dup(descriptor), "rb") as file:
        file.seek(0)
        yield from iter(partial(file.readline, _LONGEST_LINE), b"")


def _sealed(fields: Mapping[str, Any], above: bytes) -> bytes:
    """Return a JSON object as a line with its checksum, without NaN or Infinity.

    above: checksum of the previous line.
    """
    text = printable(
        json.dumps(
            fields,
            ensure_ascii=True,
            allow_nan=False,
            separators=(",", ":"),
        )
    ).encode()
    checksum = hashlib.sha256(above + text).hexdigest()[:_DIGITS]
    return text[:-1] + f',"checksum":"{checksum}"}}\n'.encode()


def _unsealed(line: bytes, above: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the fields and the checksum of a line.

    Raises ValueError if the line differs from the form that `_sealed` writes.
    """
    with suppress(ValueError, LookupError, TypeError, AttributeError):
        fields: dict[str, Any] = json.loads(line)
        del fields["checksum"]
        if _sealed(fields, above) == line:
            return fields, _checksum_of(line)
    raise ValueError("the checksum does not match this line and the line above it")


def _checksum_of(line: bytes) -> bytes:
    return line[-_DIGITS - 3 : -3]


def _owner_of(line: bytes, name: str) -> tuple[KeptOwner, bytes]:
    """Return the owner in the first line of a file, and its checksum.

    Raises UsageError if the file has another form, DataError if it was changed.
    """
    if not line.startswith(b'{"schema":"%s",' % _KEPT_SCHEMA.encode()):
        raise UsageError(f"{name} exists and was not written by hdassist", _OTHER_FILE)
    try:
        fields, checksum = _unsealed(line, b"")
        return _OWNER.validate_python(fields), checksum
    except (ValueError, RecursionError) as error:
        raise DataError(
            f"{name}:1: invalid first line: {why_invalid(error)}", "restore the file if it was changed or damaged"
        ) from None


def why_invalid(error: Exception) -> str:
    """Return the reason why a line is not a valid record; with several invalid fields, the fault of the first one."""
    if not isinstance(error, ValidationError):
        return "nested too deep" if isinstance(error, RecursionError) else str(error)
    first = error.errors(include_url=False)[0]
    where = ".".join(str(key) or "''" for key in first["loc"])
    reason = validation_words(first["msg"])
    return f"{where}: {reason}" if where else reason


def _short(value: Any) -> str:
    text = printable(json.dumps(value))
    return text if len(text) <= 60 else f"{text[:57]}..."


# --- results in the user's cache folder
#
# Results have a separate private folder within the given folder. No link is followed, and no file of another owner is
# read, replaced or removed. The name of a file consists of its kind and key. Its first line contains the key and the
# checksum of the data. An invalid file is ignored. The folder may be emptied at any time; if it cannot be used, no data
# are stored.

_AnswerT = TypeVar("_AnswerT")

# environment variables with the location of the cache folder, and with a switch that disables the cache
FOLDER = "HDASSIST_CACHE"
NO_CACHE = "HDASSIST_NO_CACHE"
OWN_FOLDER = "answers"  # name of the folder within the cache folder
_LARGEST_FILE = 1 << 24  # largest size of a file [bytes]
MOST = 1 << 26  # total size of all files [bytes] above which the oldest are removed
_OLDEST_LEFT = 0.75  # share of MOST that remains after the oldest results were removed
_OWN_FILE = re.compile(r"\.?[a-z]+-[0-9a-f]{16}(\.[0-9a-f]{8}\.part)?")  # a stored file, or one that is being written
_UNUSABLE = (OSError, ValueError)  # ValueError: the path contains a NUL


def cache_folder() -> Path:
    """Return the folder of the user's cache, which may be emptied at any time."""
    return Path(named) if (named := os.environ.get(FOLDER)) else user_cache_path("hdassist")


def keeps_answers() -> bool:
    """Return whether results are read from the cache and stored there."""
    return not os.environ.get(NO_CACHE)


@cache
def program(*packages: str) -> tuple[str, ...]:
    """Return all properties of this installation that results depend on.

    packages: names of packages in addition to numpy and scipy.
    """
    source = sha256()
    package = Path(__file__).parents[1]
    for path in sorted(path for kind in ("*.py", "*.toml", "*.c") for path in package.rglob(kind)):
        source.update(path.read_bytes())
    kernels = [f"{name}={text}" for name, text in sorted(os.environ.items()) if name.startswith("OPENBLAS_")]
    versions = [f"{name} {version(name)}" for name in ("numpy", "scipy", *packages)]
    return source.hexdigest(), *versions, *kernels, platform.python_version()


@cache
def operating_system() -> str:
    """Return the operating system, the machine type and the C library, on which last digits depend."""
    # platform.platform() would start a process to find the name of the processor
    about = platform.system(), platform.release(), platform.version(), platform.machine(), *platform.libc_ver()
    return " ".join(about)


def why_unsafe() -> str:
    """Return the reason why the cache folder is not safe to use; empty if it is safe.

    The folder is not safe if another user may write to it.
    """
    with suppress(*_UNUSABLE):
        try:
            with _own_folder():
                pass
        except UnsafeFolderError as error:
            return str(error)
    return ""


def cached(kind: str, key: str) -> bytes | None:
    """Return stored data; None if there are no data or if they are invalid.

    kind: kind of the data.
    key: key of the data (SHA-256).
    """
    name = _name(kind, key)
    with suppress(*_UNUSABLE), _own_folder() as folder:
        content = folder.read(name, _LARGEST_FILE)
        if content is not None:
            first, _, data = content.partition(b"\n")
            if first == _first_line(key, data):
                folder.note_use(name)  # the files not used for longest are removed first
                return data
    return None


def keep(
    kind: str,
    key: str,
    data: bytes,
) -> None:
    """Store data in place of previous data, or do nothing if they cannot be written.

    kind: kind of the data.
    key: key of the data (SHA-256).
    """
    name = _name(kind, key)
    line = _first_line(key, data)
    if len(line) + len(data) >= _LARGEST_FILE:
        return
    part_name = f".{name}.{secrets.token_hex(4)}.part"
    with suppress(*_UNUSABLE), _own_folder(makes=True) as folder:
        try:
            folder.write(part_name, line + b"\n" + data)
            folder.replace(part_name, name)
        except BaseException:
            with suppress(OSError):
                folder.remove(part_name)
            raise
        _prune(folder, MOST, _OLDEST_LEFT * MOST)


def kept_answer(
    kind: str,
    depends: object,
    adapter: TypeAdapter[_AnswerT],
    compute: Callable[[], _AnswerT],
) -> _AnswerT:
    """Return a stored result, or compute and store it.

    depends: everything that determines the result, as JSON.
    adapter: type of the result.
    compute: function that computes the result.
    """
    answer = KeptAnswer(kind, depends, adapter)
    if (value := answer.found()) is None:
        answer.keep(value := compute())
    return value


@dataclass(frozen=True)
class KeptAnswer(Generic[_AnswerT]):
    """A result that may be stored in the cache.

    depends: everything that determines the result, as JSON.
    adapter: type of the result.
    """

    kind: str
    depends: object
    adapter: TypeAdapter[_AnswerT]

    @cached_property
    def _key(self) -> str:
        return sha256(json.dumps(self.depends, sort_keys=True).encode()).hexdigest()

    def found(self) -> _AnswerT | None:
        """Return the stored result; None if there is no result or if it is invalid."""
        with suppress(ValueError):
            return self.adapter.validate_json((keeps_answers() and cached(self.kind, self._key)) or b"")
        return None

    def keep(self, answer: _AnswerT) -> None:
        """Store the result if the cache is enabled."""
        if keeps_answers():
            keep(self.kind, self._key, self.adapter.dump_json(answer))


def cached_files() -> list[int]:
    """Return the sizes of the stored files [bytes]."""
    with suppress(*_UNUSABLE), _own_folder() as folder:
        return [about.st_size for _, about in _files(folder)]
    return []


def empty_cache() -> None:
    """Remove all files that hdassist has stored in the cache folder.

    Raises OSError if a file cannot be removed.
    """
    with suppress(FileNotFoundError), _own_folder() as folder:
        _prune(folder, 0, 0)


def _prune(
    folder: PrivateFolder,
    most: float,
    left: float,
) -> None:
    """Remove the oldest files if the total size exceeds a limit.

    most: limit of the total size [bytes].
    left: largest total size after the removal [bytes].
    """
    files = _files(folder)
    total = sum(about.st_size for _, about in files)
    for name, about in files if total > most else ():
        if total > left:
            with suppress(FileNotFoundError):
                folder.remove(name)
            total -= about.st_size


def _files(folder: PrivateFolder) -> list[tuple[str, os.stat_result]]:
    """Return the name and status of each file of the cache, the least recently used first."""
    names = filter(_OWN_FILE.fullmatch, folder.names())
    files = [(name, about) for name in names if (about := folder.own_status(name))]
    return sorted(files, key=lambda each: each[1].st_mtime)


def _own_folder(*, makes: bool = False) -> AbstractContextManager[PrivateFolder]:
    """Return a context manager that opens the private folder of this user.

    makes: whether a missing folder is created.
    """
    return private_folder(cache_folder(), OWN_FOLDER, makes=makes)


def _name(kind: str, key: str) -> str:
    return f"{kind}-{key[:16]}"


def _first_line(key: str, data: bytes) -> bytes:
    return f"{key} {sha256(data).hexdigest()}".encode()
