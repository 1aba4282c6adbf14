"""The preset library: presets by name, from a file, or from standard input."""

import difflib
from contextlib import suppress
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from hdassist.errors import DataError, Fault
from hdassist.files import is_file, near_files, read_bytes

READ_AT_MOST = 1024 * 1024  # more than a preset may have, so that it is refused with the reason


def preset_names() -> list[str]:
    """Names of the presets that come with hdassist, in alphabetical order."""
    return sorted(_library())


def read_preset(name_or_path: str) -> tuple[bytes, str]:
    """Bytes of a preset, and the name that messages give it.

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
    """Presets by name: from the package, or from the checkout that the package lies in."""
    places: list[Traversable] = [files("hdassist") / "presets", Path(__file__).parents[2] / "presets"]
    for place in places:
        if place.is_dir():
            items = (item for item in place.iterdir() if item.name.endswith(".yaml"))
            return {item.name.removesuffix(".yaml"): item for item in items}
    return {}


def _unknown(name: str, names: list[str]) -> DataError:
    beside = [file for file in (f"{name}.yaml", f"{name}.yml") if name and is_file(file)]
    with suppress(OSError, ValueError):
        beside = beside or [file for file in near_files(Path(name)) if file.endswith((".yaml", ".yml"))]
    close = beside or difflib.get_close_matches(Path(name).stem.lower()[:60], names, 3, 0.5)
    hint = f"did you mean {' or '.join(close)}? " if close else ""
    kind = "no such file" if Path(name).suffix or "/" in name else "no such preset or file"
    library = f"{hint}in the library: {', '.join(sorted(names))}"
    return DataError(f"{kind}: {name or 'an empty name'}", library, Fault.FILE_UNREADABLE)
