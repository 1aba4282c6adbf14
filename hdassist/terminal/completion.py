"""What a shell offers to complete: drives of the library, files, fields of a preset."""

from __future__ import annotations

from pathlib import Path

FILES = (".yaml", ".yml")


def presets(incomplete: str) -> list[str]:
    """Names of the library, and folders and YAML files that begin so."""
    from hdassist.preset.library import preset_names

    return [name for name in preset_names() if name.startswith(incomplete)] + _paths(incomplete)


def overrides(incomplete: str) -> list[str]:
    """Fields that begin so, each with the = that comes behind."""
    from hdassist.preset.fields import field_table

    return [f"{path}=" for path in field_table() if path.startswith(incomplete)]


def completed_names(incomplete: str) -> list[str]:
    """Names that can be explained and begin so."""
    from hdassist.errors import Fault
    from hdassist.preset.fields import field_table

    return [name for name in (*Fault, *field_table()) if name.startswith(incomplete)]


def _paths(incomplete: str) -> list[str]:
    folder, _, begin = incomplete.rpartition("/")
    try:
        found = list(Path(folder or ("/" if incomplete.startswith("/") else ".")).iterdir())
    except OSError:
        return []
    before = incomplete[: len(incomplete) - len(begin)]
    kept = [path for path in found if path.name.startswith(begin) and (path.suffix in FILES or path.is_dir())]
    return sorted(f"{before}{path.name}" + "/" * path.is_dir() for path in kept)
