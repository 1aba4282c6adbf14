"""Answers kept in the user's cache folder: found again by all that they depend on, and never trusted as they stand.

A file is named by its kind and key; its first line has the key and the checksum of the rest. Whatever does not hold
is as if it were not there. The folder may be emptied at any time, and where it cannot be written no data are kept.
"""

import os
import platform
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from platformdirs import user_cache_path

from hdassist.textfile import in_place_of, is_file

FOLDER, NO_CACHE = "HDASSIST_CACHE", "HDASSIST_NO_CACHE"  # variables: another folder; whether answers are not kept
LARGEST_FILE = 1 << 24  # bytes of a file
MOST = 1 << 26  # bytes of all files: above it the oldest go
_OLDEST_LEFT = 0.75  # of MOST, that is left then


def cache_folder() -> Path:
    """Folder of the user's cache, which may be emptied at any time."""
    return Path(named) if (named := os.environ.get(FOLDER)) else user_cache_path("hdassist")


def keeps_answers() -> bool:
    """Whether answers are read from the cache and kept there."""
    return not os.environ.get(NO_CACHE)


@cache
def program(*packages: str) -> tuple[str, ...]:
    """All of this installation that digits of an answer depend on, of packages by name beside hdassist and numpy."""
    source = sha256()
    package = Path(__file__).parents[1]
    for path in sorted(path for kind in ("*.py", "*.toml", "*.c") for path in package.rglob(kind)):
        source.update(path.read_bytes())
    kernels = [f"{name}={text}" for name, text in sorted(os.environ.items()) if name.startswith("OPENBLAS_")]
    versions = [f"{name} {version(name)}" for name in ("numpy", "scipy", *packages)]
    return source.hexdigest(), *versions, *kernels, platform.platform(), platform.python_version()


def cached(kind: str, key: str) -> bytes | None:
    """Data kept of a kind by a key (SHA-256); None where there are none, or they do not hold."""
    path = _path(kind, key)
    with suppress(OSError, ValueError):
        if is_file(path) and path.stat().st_size <= LARGEST_FILE:
            first, _, data = path.read_bytes().partition(b"\n")
            if first == _first_line(key, data):
                os.utime(path)  # the oldest go first
                return data
    return None


def keep(kind: str, key: str, data: bytes) -> None:
    """Keep data of a kind by a key (SHA-256), in place of those before; none where that cannot be written."""
    path, line = _path(kind, key), _first_line(key, data)
    if len(line) + len(data) >= LARGEST_FILE:
        return
    with suppress(OSError, ValueError):
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with in_place_of(path) as beside:
            beside.write_bytes(line + b"\n" + data)
        files = cached_files()
        total = sum(size for _, size, _ in files)
        for _, size, oldest in files if total > MOST else ():
            if total > _OLDEST_LEFT * MOST:
                oldest.unlink(missing_ok=True)
                total -= size


def cached_files() -> list[tuple[float, int, Path]]:
    """When each file of the cache was used last [s], its size [bytes] and path, the oldest first."""
    found: list[tuple[float, int, Path]] = []
    with suppress(OSError):
        for path in cache_folder().iterdir():
            with suppress(OSError):
                if is_file(path):
                    found.append((path.stat().st_mtime, path.stat().st_size, path))
    return sorted(found)


def _path(kind: str, key: str) -> Path:
    return cache_folder() / f"{kind}-{key[:16]}"


def _first_line(key: str, data: bytes) -> bytes:
    return f"{key} {sha256(data).hexdigest()}".encode()
