"""Compiles the walk: the build hook of the package, and the search for the library.

One C source, no Python headers, one shared library for each instruction set; the wheel is `py3-none-PLATFORM`.
Without a compiler, or with HDASSIST_PURE set, the wheel is pure Python and the numpy engine runs. HDASSIST_PLATFORM
names the platform of the wheel (manylinux_2_17_aarch64, win_amd64) where CC compiles for another one than this.
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
# comparisons with NaN and sums in their order stay as they are written: no -ffast-math; a product may be rounded once
# with the sum that it is added to
_FLAGS = ["-std=c11", "-O3", "-fopenmp-simd", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=fast"]
_SHARED = ["-shared", "-fPIC"]
_SHARED_WINDOWS = ["-shared"]  # whose libraries need no more to be loaded anywhere
X86 = {1: ["-march=x86-64"], 3: ["-march=x86-64-v3"], 4: ["-march=x86-64-v4", "-mprefer-vector-width=512"]}


def source_hash() -> str:
    """Return SHA-256 of the source of the walk."""
    return hashlib.sha256(SOURCE.read_bytes()).hexdigest()


def library_name(level: int) -> str:
    """Return the file name of the library for an instruction set: 1 any machine, 3 AVX2, 4 AVX-512."""
    return f"_walk_{level}{'.dll' if _is_for_windows() else '.so'}"


def development_folder() -> Path:
    """Return where an editable install keeps its libraries: a folder that git ignores and no wheel takes."""
    return SOURCE.parents[2] / "build" / f"walk-{sysconfig.get_platform()}"


def wheel_platform() -> str:
    """Return the platform of the libraries, as a tag of wheels has it."""
    return os.environ.get("HDASSIST_PLATFORM") or sysconfig.get_platform().replace("-", "_").replace(".", "_")


def _is_for_windows() -> bool:
    """Return whether the libraries are for Windows: of the target, which may be another system than this one."""
    return wheel_platform().startswith("win")


def compile_walk(folder: Path, more: Sequence[str] = ()) -> list[Path]:
    """Compile the walk into a folder; the libraries made, none if there is no compiler or it fails.

    Arguments: more, further options of the compiler.
    """
    compiler = shutil.which(os.environ.get("CC", "cc"))
    if not compiler or os.environ.get("HDASSIST_PURE"):
        return []
    folder.mkdir(parents=True, exist_ok=True)
    levels = X86 if wheel_platform().endswith(("x86_64", "amd64")) else {1: []}
    libraries = []
    for level, flags in levels.items():
        library = folder / library_name(level)
        # replaced as a whole: another process may have the old one open; its name stands in some libraries
        new = folder / str(os.getpid()) / library.name
        new.parent.mkdir(exist_ok=True)
        shared = _SHARED_WINDOWS if _is_for_windows() else _SHARED
        if wheel_platform().startswith("macosx"):
            shared = [*shared, f"-Wl,-install_name,@rpath/{library.name}"]  # without the folder that it was made in
        options = [*_FLAGS, *shared, *flags, *more, f'-DWALK_SOURCE="{source_hash()}"']
        command = [compiler, *options, str(SOURCE), "-o", str(new), "-lm"]
        if subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False).returncode:
            shutil.rmtree(new.parent)
            return []
        new.replace(library)
        shutil.rmtree(new.parent)  # with what some linkers leave beside it
        libraries.append(library)
    return libraries
