"""What a run keeps: work in a file, from which the same command goes on, and answers in the user's cache folder.

Work has one form of JSON Lines for all commands. The first line is the owner: which command made the records, from
which inputs. Each line below is a record: its number (item, from 0), its fields, and the checksum of this line and of
that above it, so that no line can be changed, moved, doubled or taken out from between others. A record that does not
hold is refused with its line; a last line that a killed run has not finished is dropped.
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
from hdassist.errors import DataError, Fault, UsageError, validation_words
from hdassist.files import in_place_of, is_file, is_there, os_reason, printable
from hdassist.run import system
from hdassist.run.stops import at_stop
from hdassist.run.system import PrivateFolder, UnsafeFolderError, private_folder

_KEPT_SCHEMA: Literal["hdassist.kept/1"] = "hdassist.kept/1"
_LONGEST_LINE = 1 << 26  # bytes of a line
LOCK_PATIENCE = 1.0  # s: processes that a killed run has begun hold its lock until they have ended too
_DIGITS = 16  # digits of a checksum

Number = Annotated[float, Field(strict=True)]
Magnitude = Annotated[float, Field(strict=True, ge=0)]
Count = Annotated[int, Field(strict=True, ge=0)]
_RecordT = TypeVar("_RecordT")


def own_schema(own: str) -> AfterValidator:
    """Return a validator of a record's schema, which refuses every other one by its name."""

    def require(schema: str) -> str:
        if schema != own:
            raise ValueError(f"{schema[:60]}; this version of hdassist reads and writes {own}")
        return schema

    return AfterValidator(require)


class ClosedRecord:
    """Contents of a file of ours: its fields alone, and finite numbers."""

    __pydantic_config__ = ConfigDict(extra="forbid", allow_inf_nan=False)


@dataclass(frozen=True, kw_only=True)
class KeptOwner(ClosedRecord):
    """All that decides the records of a file: command, inputs (SHA-256 of each), options, seed and version of hdassist.

    preset: name of the drive, empty if there are several; inputs and version: empty where each record has its own.
    """

    schema: Literal["hdassist.kept/1"] = _KEPT_SCHEMA
    version: str = __version__
    command: str
    preset: str = ""
    inputs: Mapping[str, str]
    options: Mapping[str, Any] = field(default_factory=dict)
    seed: int | None = None

    def require_same(self, now: KeptOwner, path: str) -> None:
        """Raise UsageError, with the differences, where the records of a file are not those of the owner now."""
        # as they would be read from a file, so that tuples and lists are equal
        before, after = (json.loads(json.dumps(asdict(owner))) for owner in (self, now))
        for inputs, name in product((before, after), ("inputs", "options")):
            # flat, so that each difference is named by its own key
            inputs |= {f"{name}.{key}": value for key, value in inputs.pop(name).items()}
        differences = [
            f"{key}: {_short(before.get(key))} there, {_short(after.get(key))} here"
            for key in sorted(before.keys() | after.keys())
            if before.get(key) != after.get(key)
        ]
        if differences:
            raise UsageError(f"{path} holds the work of another run: {'; '.join(differences)}", _OTHER_FILE)


_OWNER = TypeAdapter(KeptOwner)
_OTHER_FILE = "name another file, or delete this one"


@dataclass(frozen=True)
class RecordKind(Generic[_RecordT]):
    """Kind of the records of a file.

    adapter: their type, closed and of finite numbers; fault: why a record cannot be the item of a number, empty where
    it can; hint: the remedy for one that does not hold.
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
        """Yield records with their lines; a last one that is not finished is left out.

        lines: those below the owner.
        above: the owner's checksum.
        name: of the file, in messages.
        Raises DataError for a record that does not hold.
        """
        checksum = above  # of the line above, which each line carries
        # each checksum covers the line above, so no line can be moved or taken out
        for item, line in enumerate(lines):
            try:
                fields, checksum = _unsealed(line, checksum)
                # a line of another place in the file
                if fields.pop("item", None) != item:
                    raise ValueError(f"expected item {item}")
                record = self.adapter.validate_python(fields)
                if fault := self.fault(item, record):
                    raise ValueError(fault)
            except (ValueError, RecursionError) as error:
                begin = b'{"item":%d,' % item
                start = line.rstrip(b"\0")[: len(begin)]  # zeros stand where power was lost before data came to disk
                # the last line of a killed run: it is made anew
                if not line.endswith(b"\n") and len(line) < _LONGEST_LINE and begin.startswith(start):
                    return
                raise DataError(f"{name}:{item + 2}: invalid record: {why_invalid(error)}", self.hint) from None
            yield record, line


@dataclass
class Kept(Generic[_RecordT]):
    """An open file of records, made by `open_kept`; done: how many it has, which a stop may ask for at any time.

    _lock: descriptor of the file whose lock keeps other runs out, which is this file or another one beside it.
    """

    _path: str | None
    _descriptor: int
    _lock: int
    _owner: KeptOwner
    _kind: RecordKind[_RecordT]
    done: int = 0
    _size: int = 0  # bytes
    _checksum: bytes = b""  # of the last line

    def append(self, records: Iterable[_RecordT]) -> None:
        """Write the records of the next items; when this returns they outlast a loss of power.

        Raises DataError: they cannot be written, or the file is not what this run has written.
        """
        lines = []
        checksum = self._checksum
        for item, record in enumerate(records, self.done):
            # sealed with the checksum of the line above
            lines.append(_sealed({"item": item, **self._kind.adapter.dump_python(record, mode="json")}, checksum))
            checksum = _checksum_of(lines[-1])
        # one write: a stop leaves whole lines, or one unfinished line
        self._write(b"".join(lines), len(lines))
        self._checksum = checksum

    def records(self) -> Iterator[_RecordT]:
        """Yield the records that are there, in the order of the items, to be read before more are written.

        Raises DataError: one that does not hold.
        """
        lines = _lines(self._descriptor)
        read = self._kind.read(lines, _checksum_of(next(lines, b"")), str(self._path))
        # another process cannot have added any: the file is locked
        for _ in range(self.done):
            if (record := next(read, None)) is None:
                raise self._lost()
            yield record[0]

    def rewrite(self, records: Iterable[_RecordT]) -> None:
        """Put records of this run's owner in place of all that the file has; until then it stays as it is."""
        assert self._path is not None
        if system.locks_beside():
            self._rewrite_closed(self._path, records)
        else:
            self._rewrite_open(self._path, records)

    def _rewrite_open(self, path: str, records: Iterable[_RecordT]) -> None:
        """Rewrite a file that has its own lock: the new one is locked before it gets the name."""
        with (
            _writing(path),
            in_place_of(path) as part_file,
            at_stop(partial(part_file.unlink, missing_ok=True)),
        ):
            descriptor, lock = _locked(str(part_file))
            # a complete file under another name, which takes the place of this one at once
            fresh = Kept(
                _path=str(part_file),
                _descriptor=descriptor,
                _lock=lock,
                _owner=self._owner,
                _kind=self._kind,
            )
            fresh.begin()
            fresh.append(records)
        # the new file is locked already, so no other run can come between
        os.close(self._descriptor)
        self._descriptor = descriptor
        self._lock = lock
        self._take_content(fresh)

    def _rewrite_closed(self, path: str, records: Iterable[_RecordT]) -> None:
        """Rewrite a file whose lock is another one beside it: both are closed when the new one gets the name."""
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
            # Windows replaces no open file: it was closed for the moment
            if self._descriptor == _CLOSED:
                with _writing(path):
                    self._descriptor = _opened(path)
        self._take_content(fresh)

    def _take_content(self, rewritten: Kept[_RecordT]) -> None:
        """Take over what the rewritten file has: it has the name of this one now."""
        self.done = rewritten.done
        self._size = rewritten._size
        self._checksum = rewritten._checksum

    def require_there(self) -> None:
        """Raise DataError unless the file of this name is still the one that this run writes, and no line is cut."""
        if self._path is None:
            return
        with suppress(OSError):
            status = Path(self._path).stat()
            # the same file still, and no shorter
            if os.path.samestat(status, os.fstat(self._descriptor)) and status.st_size >= self._size:
                return
        raise self._lost()

    def _lost(self) -> DataError:
        message = f"{self._path} was removed, replaced or cut during this run"
        return DataError(
            message, "run the command again, and do not change the file during the run", Fault.FILE_UNWRITABLE
        )

    def begin(self) -> None:
        """Empty the file, and write the owner."""
        self._cut(0)
        line = _sealed(asdict(self._owner), b"")
        self._write(line)
        self._checksum = _checksum_of(line)

    def take_up(self) -> None:
        """Count the records that are there, and drop a last line that is not finished.

        Raises UsageError: they are of another run, or none of ours; DataError: one that does not hold.
        """
        name = str(self._path)
        lines = _lines(self._descriptor)
        first = next(lines, b"")
        # not even the owner was written completely
        if not first.endswith(b"\n") and _sealed(asdict(self._owner), b"").startswith(first):
            return self.begin()  # empty, or begun by a run that was killed
        owner, self._checksum = _owner_of(first, name)
        # records of other inputs must not be mixed
        owner.require_same(self._owner, name)
        self._size = len(first)
        for _, line in self._kind.read(lines, self._checksum, name):
            self.done = self.done + 1
            self._size = self._size + len(line)
            self._checksum = _checksum_of(line)
        # behind the last complete record
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
            # a write may take a part only
            while remaining:
                remaining = remaining[os.write(self._descriptor, remaining) :]
            self.done += records
            if self._path is not None:
                # a finished record outlasts a loss of power
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
    """A file to which records are added, behind those that a run before it has left there; one run at a time holds it.

    Arguments: path, None for a file without a name that goes when it is closed; owner of this run; kind of its records;
    force, whether whatever is there is replaced; patience [s], with another run that holds it.
    Raises UsageError: the file holds anything else than the work of this owner, or another run writes it; DataError: it
    cannot be written, has a record that does not hold, or is removed or cut while it is written.
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
        # --force: what the file has is given up
        if force:
            kept.begin()
        else:
            kept.take_up()
        yield kept
        kept.require_there()
    finally:
        system.unlock(kept._lock)  # whoever still reads has a descriptor too
        os.close(kept._descriptor)
        if path is not None and system.locks_beside():
            os.close(kept._lock)
            with suppress(OSError):  # the next run waits for it
                _lock_file(path).unlink()


def read_kept(
    data: bytes,
    name: str,
    kind: RecordKind[_RecordT],
) -> list[_RecordT] | None:
    """Return the records of a file that is only read; None for another form. Raises DataError as `open_kept` does."""
    lines = BytesIO(data)
    try:
        _, previous = _owner_of(lines.readline(), name)
    except UsageError:
        return None
    return [record for record, _ in kind.read(lines, previous, name)]


def _locked(path: str | None, patience: float = LOCK_PATIENCE) -> tuple[int, int]:
    """Return the descriptors of a file and of its lock, held until they are closed or this process ends, in any way.

    Raises UsageError: another run holds it; DataError: it cannot be opened.
    """
    # without a file the work is kept in an unnamed one, which ends with the process
    if path is None:
        with _writing(path), tempfile.TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
        return descriptor, descriptor  # nobody else can open it
    if path.endswith(".parquet"):
        raise UsageError(
            f"{path} would be written as JSON Lines", "use FILE.jsonl for results; for a table use --parquet FILE"
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
    """Return the descriptor of a file whose lock this process has; path, the name for messages; patience [s]."""
    begun = time.monotonic()
    # a lock of a killed run ends with its last process
    while True:
        with _writing(path):
            descriptor = _opened(place)
            try:
                system.lock(descriptor)
                # another run may have put a new file in its place meanwhile
                if os.path.samestat(os.fstat(descriptor), Path(place).stat()):
                    return descriptor
            except FileNotFoundError:
                pass  # it was replaced meanwhile
            except BlockingIOError:
                if time.monotonic() - begun > patience:
                    os.close(descriptor)  # Windows removes no open file
                    message = f"{path} is being written by another run"
                    raise UsageError(message, "wait for it to end, or name another file") from None
                time.sleep(0.05)
            os.close(descriptor)


_CLOSED = -1  # in place of a descriptor


def _opened(path: str) -> int:
    """Return the descriptor of a file that is read and written behind its end. Raises OSError: it cannot be opened."""
    return os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT | system.BINARY, 0o666)


def _lock_file(path: str) -> Path:
    """Return the file whose lock is that of another one, by whatever link this is named."""
    target = Path(os.path.realpath(path))
    return target.with_name(f".{target.name[:100]}.lock")


@contextmanager
def _writing(path: str | None, hint: str = "") -> Iterator[None]:
    """Raise DataError, with a hint, for the system's error of a file."""
    try:
        yield
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL in it
        name = "a temporary file" if path is None else path or "a file without a name"
        raise DataError(f"cannot write {name}: {os_reason(error)}", hint, Fault.FILE_UNWRITABLE) from None


def _lines(descriptor: int) -> Iterator[bytes]:
    """Yield the lines of a file, each with its end; one that is longer than any of ours comes in parts."""
    with os.fdopen(os.dup(descriptor), "rb") as file:
        file.seek(0)
        yield from iter(partial(file.readline, _LONGEST_LINE), b"")


def _sealed(fields: Mapping[str, Any], above: bytes) -> bytes:
    """Return a JSON object as a line with its checksum; above, that of the line above. Never NaN or Infinity."""
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
    """Return the fields and checksum of a line. Raises ValueError: it is not as `_sealed` writes it."""
    with suppress(ValueError, LookupError, TypeError, AttributeError):
        fields: dict[str, Any] = json.loads(line)
        del fields["checksum"]
        if _sealed(fields, above) == line:
            return fields, _checksum_of(line)
    raise ValueError("expected the checksum of this line and of that above it")


def _checksum_of(line: bytes) -> bytes:
    return line[-_DIGITS - 3 : -3]


def _owner_of(line: bytes, name: str) -> tuple[KeptOwner, bytes]:
    """Return the owner in the first line of a file, and its checksum.

    Raises UsageError: the file is not of this form; DataError: it is, and was changed.
    """
    if not line.startswith(b'{"schema":"%s",' % _KEPT_SCHEMA.encode()):
        raise UsageError(f"{name} exists and was not written by hdassist", _OTHER_FILE)
    try:
        fields, checksum = _unsealed(line, b"")
        return _OWNER.validate_python(fields), checksum
    except (ValueError, RecursionError) as error:
        raise DataError(
            f"{name}:1: invalid first line: {why_invalid(error)}", "the file was changed or damaged"
        ) from None


def why_invalid(error: Exception) -> str:
    """Return the fault of a line or of fields that are no record: of a record, its first field at fault."""
    if not isinstance(error, ValidationError):
        return "nested too deep" if isinstance(error, RecursionError) else str(error)
    first = error.errors(include_url=False)[0]
    where = ".".join(str(key) or "''" for key in first["loc"])
    reason = validation_words(first["msg"])
    return f"{where}: {reason}" if where else reason


def _short(value: Any) -> str:
    text = printable(json.dumps(value))
    return text if len(text) <= 60 else f"{text[:57]}..."


# --- answers in the user's cache folder
#
# They have a folder of their own in the one that is named, for this user alone: no link is followed and no file of
# another owner read, replaced or removed. A file is named by its kind and key; its
# first line has the key and the checksum of the rest. Whatever does not hold is as if it were not there. The folder may
# be emptied at any time, and if it cannot be used no data are kept.

_AnswerT = TypeVar("_AnswerT")

# variables: another folder; whether answers are not kept
FOLDER = "HDASSIST_CACHE"
NO_CACHE = "HDASSIST_NO_CACHE"
OWN_FOLDER = "answers"  # in the folder of the cache
_LARGEST_FILE = 1 << 24  # bytes of a file
MOST = 1 << 26  # bytes of all files: above it the oldest go
_OLDEST_LEFT = 0.75  # share of MOST that remains after the oldest results were removed
_OWN_FILE = re.compile(r"\.?[a-z]+-[0-9a-f]{16}(\.[0-9a-f]{8}\.part)?")  # a kept one, or one that is being written
_UNUSABLE = (OSError, ValueError)  # a path with a NUL


def cache_folder() -> Path:
    """Return the folder of the user's cache, which may be emptied at any time."""
    return Path(named) if (named := os.environ.get(FOLDER)) else user_cache_path("hdassist")


def keeps_answers() -> bool:
    """Return whether answers are read from the cache and kept there."""
    return not os.environ.get(NO_CACHE)


@cache
def program(*packages: str) -> tuple[str, ...]:
    """Return all of this installation that answers depend on, with packages by name beside numpy and scipy."""
    source = sha256()
    package = Path(__file__).parents[1]
    for path in sorted(path for kind in ("*.py", "*.toml", "*.c") for path in package.rglob(kind)):
        source.update(path.read_bytes())
    kernels = [f"{name}={text}" for name, text in sorted(os.environ.items()) if name.startswith("OPENBLAS_")]
    versions = [f"{name} {version(name)}" for name in ("numpy", "scipy", *packages)]
    return source.hexdigest(), *versions, *kernels, platform.python_version()


@cache
def operating_system() -> str:
    """Return the operating system, the kind of machine and the C library, on which last digits depend."""
    # not platform.platform(), which starts a process for the processor's name
    about = platform.system(), platform.release(), platform.version(), platform.machine(), *platform.libc_ver()
    return " ".join(about)


def why_unsafe() -> str:
    """Return why the cache is not used: who else could have written to its folder; empty if it is safe."""
    with suppress(*_UNUSABLE):
        try:
            with _own_folder():
                pass
        except UnsafeFolderError as error:
            return str(error)
    return ""


def cached(kind: str, key: str) -> bytes | None:
    """Return data kept of a kind by a key (SHA-256); None if there are none, or they do not hold."""
    name = _name(kind, key)
    with suppress(*_UNUSABLE), _own_folder() as folder:
        content = folder.read(name, _LARGEST_FILE)
        if content is not None:
            first, _, data = content.partition(b"\n")
            if first == _first_line(key, data):
                folder.note_use(name)  # the oldest go first
                return data
    return None


def keep(
    kind: str,
    key: str,
    data: bytes,
) -> None:
    """Keep data of a kind by a key (SHA-256), in place of those before; none if that cannot be written."""
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
    """Return an answer of a kind as it is kept, or computed and kept.

    Arguments: depends, all that decides it, as JSON; adapter, its type.
    """
    answer = KeptAnswer(kind, depends, adapter)
    if (value := answer.found()) is None:
        answer.keep(value := compute())
    return value


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
        """Return the answer as it is kept; None if there is none, or it does not hold."""
        with suppress(ValueError):
            return self.adapter.validate_json((keeps_answers() and cached(self.kind, self._key)) or b"")
        return None

    def keep(self, answer: _AnswerT) -> None:
        """Keep the answer, where answers are kept."""
        if keeps_answers():
            keep(self.kind, self._key, self.adapter.dump_json(answer))


def cached_files() -> list[int]:
    """Return the sizes of the files that are kept [bytes]."""
    with suppress(*_UNUSABLE), _own_folder() as folder:
        return [about.st_size for _, about in _files(folder)]
    return []


def empty_cache() -> None:
    """Remove all that is kept, and no other file. Raises OSError: one cannot be removed."""
    with suppress(FileNotFoundError), _own_folder() as folder:
        _prune(folder, 0, 0)


def _prune(
    folder: PrivateFolder,
    most: float,
    left: float,
) -> None:
    """Remove the oldest files until so many bytes are left, where there are more than most."""
    files = _files(folder)
    total = sum(about.st_size for _, about in files)
    for name, about in files if total > most else ():
        if total > left:
            with suppress(FileNotFoundError):
                folder.remove(name)
            total -= about.st_size


def _files(folder: PrivateFolder) -> list[tuple[str, os.stat_result]]:
    """Name of each file of the cache, and what is known of it, the one first that was used the longest ago."""
    names = filter(_OWN_FILE.fullmatch, folder.names())
    files = [(name, about) for name in names if (about := folder.own_status(name))]
    return sorted(files, key=lambda each: each[1].st_mtime)


def _own_folder(*, makes: bool = False) -> AbstractContextManager[PrivateFolder]:
    """Return the folder for this user alone, to be opened; makes: whether it is made if there is none."""
    return private_folder(cache_folder(), OWN_FOLDER, makes=makes)


def _name(kind: str, key: str) -> str:
    return f"{kind}-{key[:16]}"


def _first_line(key: str, data: bytes) -> bytes:
    return f"{key} {sha256(data).hexdigest()}".encode()
