"""Compilation of the walk: the build hook of the package, and the search for the library.

There is one C source without Python headers and one shared library per instruction set. The wheel is
`py3-none-PLATFORM`. Without a compiler, or with HDASSIST_PURE set, the wheel is pure Python and the numpy engine runs.
HDASSIST_PLATFORM names the platform of the wheel (manylinux_2_17_aarch64, win_amd64) if CC is a cross compiler.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sysconfig
from collections.abc import Sequence
from pathlib import Path

SOURCE = Path(__file__).parent / "walk.c"
# without -ffast-math, so that comparisons with NaN and the order of sums are preserved; a product may be fused with the
# sum to which it is added
_FLAGS = ["-std=c11", "-O3", "-fopenmp-simd", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=fast"]
_SHARED = ["-shared", "-fPIC"]
_SHARED_WINDOWS = ["-shared"]  # libraries on Windows are always relocatable
X86 = {1: ["-march=x86-64"], 3: ["-march=x86-64-v3"], 4: ["-march=x86-64-v4", "-mprefer-vector-width=512"]}


def source_hash() -> str:
    """Return the SHA-256 hash of the source of the walk."""
    return hashlib.sha256(SOURCE.read_bytes()).hexdigest()


def library_name(level: int) -> str:
    """Return the file name of the library for an instruction set.

    level: 1 for any machine, 3 for AVX2, 4 for AVX-512.
    """
    return f"_walk_{level}{'.dll' if _is_for_windows() else '.so'}"


def development_folder() -> Path:
    """Return the folder for the libraries of an editable install, which git ignores and no wheel contains."""
    return SOURCE.parents[3] / "build" / f"walk-{sysconfig.get_platform()}"


def wheel_platform() -> str:
    """Return the platform of the libraries as a wheel tag."""
    return os.environ.get("HDASSIST_PLATFORM") or sysconfig.get_platform().replace("-", "_").replace(".", "_")


def _is_for_windows() -> bool:
    """Return whether the libraries are for Windows, which depends on the target and not on this system."""
    return wheel_platform().startswith("win")


def compile_walk(folder: Path, more: Sequence[str] = ()) -> list[Path]:
    """Compile the walk into a folder and return the libraries, none if there is no compiler or it fails.

    more: further compiler options.
    """
    compiler = shutil.which(os.environ.get("CC", "cc"))
    if not compiler or os.environ.get("HDASSIST_PURE"):
        return []
    folder.mkdir(parents=True, exist_ok=True)
    levels = X86 if wheel_platform().endswith(("x86_64", "amd64")) else {1: []}
    libraries = []
    for level, flags in levels.items():
        library = folder / library_name(level)
        # replace the library as a whole, because another process may have the old one open; some libraries contain
        # their own name
        new = folder / str(os.getpid()) / library.name
        new.parent.mkdir(exist_ok=True)
        shared = _SHARED_WINDOWS if _is_for_windows() else _SHARED
        if wheel_platform().startswith("macosx"):
            shared = [*shared, f"-Wl,-install_name,@rpath/{library.name}"]  # without the folder in which it was built
        options = [*_FLAGS, *shared, *flags, *more, f'-DWALK_SOURCE="{source_hash()}"']
        command = [compiler, *options, str(SOURCE), "-o", str(new), "-lm"]
        if subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False).returncode:
            shutil.rmtree(new.parent)
            return []
        new.replace(library)
        shutil.rmtree(new.parent)  # together with files that some linkers leave next to it
        libraries.append(library)
    return libraries
