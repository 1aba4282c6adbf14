"""Build hook of hatchling: the compiled walk goes into the wheel, and beside an editable install."""

from __future__ import annotations

import runpy
import shutil
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# the package can't be imported while it is built
_BUILD = runpy.run_path(str(Path(__file__).parent / "build.py"))


class _WalkHook(BuildHookInterface[Any]):
    """Compiles the walk where there is a compiler."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile into a folder of its own, and name the libraries as files of the wheel."""
        if version == "editable":
            _BUILD["compile_walk"](_BUILD["development_folder"]())
            return
        self._folder = tempfile.mkdtemp()
        libraries = _BUILD["compile_walk"](Path(self._folder))
        for library in libraries:
            build_data["force_include"][str(library)] = f"hdassist/solve/{library.name}"
        if libraries:
            build_data["pure_python"] = False
            build_data["tag"] = f"py3-none-{_BUILD['wheel_platform']()}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Leave no file behind."""
        if version != "editable":
            shutil.rmtree(self._folder, ignore_errors=True)
