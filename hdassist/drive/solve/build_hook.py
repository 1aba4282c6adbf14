"""Build hook of hatchling that adds the compiled walk to the wheel or to an editable install."""

from __future__ import annotations

import runpy
import shutil
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# the package cannot be imported while it is built
_BUILD = runpy.run_path(str(Path(__file__).parent / "build.py"))


class _WalkHook(BuildHookInterface[Any]):
    """Build hook that compiles the walk if there is a compiler."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the walk for the wheel or for an editable install."""
        if version == "editable":
            _BUILD["compile_walk"](_BUILD["development_folder"]())
            return
        self._folder = tempfile.mkdtemp()
        libraries = _BUILD["compile_walk"](Path(self._folder))
        for library in libraries:
            build_data["force_include"][str(library)] = f"hdassist/drive/solve/{library.name}"
        if libraries:
            build_data["pure_python"] = False
            build_data["tag"] = f"py3-none-{_BUILD['wheel_platform']()}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Remove the temporary folder."""
        if version != "editable":
            shutil.rmtree(self._folder, ignore_errors=True)
