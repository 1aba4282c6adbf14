"""Hold the libraries in wheels for Windows and macOS to the platform that the wheel names. Usage: WHEEL...

Each must be of the machine of its platform, need only libraries that every such system has, and on macOS no later
version than the platform names: unless told zig makes libraries for the newest one.
"""

import io
import sys
import zipfile
from pathlib import Path

import pefile
from macholib.mach_o import LC_BUILD_VERSION, LC_LOAD_DYLIB, LC_VERSION_MIN_MACOSX
from macholib.MachO import MachO

MACHINES = {"win_amd64": 0x8664, "win_arm64": 0xAA64, "x86_64": 0x01000007, "arm64": 0x0100000C}
OF_EVERY_WINDOWS = ("kernel32.dll", "ntdll.dll", "ucrtbase.dll", "msvcrt.dll", "api-ms-win-crt-")
OF_EVERY_MACOS = "/usr/lib/libSystem.B.dylib"


def require(holds: bool, words: str) -> None:
    """End with words unless something holds."""
    if not holds:
        raise SystemExit(words)


def require_windows(library: bytes, platform: str, name: str) -> None:
    """Hold a library to a platform of Windows."""
    image = pefile.PE(data=library)
    require(image.FILE_HEADER.Machine == MACHINES[platform], f"{name} is of another machine")
    for needed in image.DIRECTORY_ENTRY_IMPORT:
        file = needed.dll.decode().lower()
        require(file.startswith(OF_EVERY_WINDOWS), f"{name} needs {file}")


def require_macos(library: bytes, platform: str, name: str) -> None:
    """Hold a library to a platform of macOS: macosx_11_0_arm64."""
    _, major, minor, machine = platform.split("_", 3)
    file = Path(name)
    file.write_bytes(library)
    [header] = MachO(str(file)).headers
    file.unlink()
    require(header.header.cputype & 0xFFFFFFFF == MACHINES[machine], f"{name} is of another machine")
    needed, versions = [], []
    for load, command, data in header.commands:
        if load.cmd == LC_LOAD_DYLIB:
            needed.append(data.rstrip(b"\0").decode())
        elif load.cmd == LC_BUILD_VERSION:
            versions.append(int(command.minos))
        elif load.cmd == LC_VERSION_MIN_MACOSX:
            versions.append(int(command.version))
    require(set(needed) <= {OF_EVERY_MACOS}, f"{name} needs {needed}")
    oldest = (int(major) << 16) + (int(minor) << 8)
    require(len(versions) == 1 and versions[0] <= oldest, f"{name} is for later versions of macOS: {versions}")


def main() -> None:
    """Hold each library of each wheel to the platform in the name of the wheel."""
    for wheel in map(Path, sys.argv[1:]):
        platform = wheel.stem.rpartition("-")[2]
        require_platform = require_windows if platform.startswith("win") else require_macos
        with zipfile.ZipFile(io.BytesIO(wheel.read_bytes())) as archive:
            libraries = [name for name in archive.namelist() if "/_walk_" in name]
            for name in libraries:
                require_platform(archive.read(name), platform, Path(name).name)
        require(bool(libraries), f"{wheel.name} has no compiled walk")
        print(f"{wheel.name}: {len(libraries)} libraries for {platform}")


if __name__ == "__main__":
    main()
