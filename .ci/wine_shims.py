"""Libraries that Wine 8 lacks: complex functions of the C library, and random numbers. Usage: SYSTEM32 FOLDER.

Wine's own ucrtbase.dll ends the process at a complex function. A library of this name takes its place: it hands these
functions on to one that is compiled here, all others to Wine's under another name. SYSTEM32: of the prefix that gets
the libraries; FOLDER: where they are made.
"""

import subprocess
import sys
from pathlib import Path

import pefile

COMPILER = ["x86_64-w64-mingw32-gcc", "-O2", "-s", "-shared", "-static-libgcc"]
WINE_UCRT = Path("/usr/lib/x86_64-linux-gnu/wine/x86_64-windows/ucrtbase.dll")
BUILTIN = b"Wine builtin DLL"  # a mark at a place in the file, with which Wine would load its own
BUILTIN_PLACE = slice(0x40, 0x60)
REAL = ("cabs", "carg", "cimag", "creal")  # whose results are real
COMPLEX = (
    "cacos", "cacosh", "casin", "casinh", "catan", "catanh", "ccos", "ccosh", "cexp", "clog", "conj", "cpow", "cproj",
    "csin", "csinh", "csqrt", "ctan", "ctanh",
)  # fmt: skip
FUNCTIONS = (*REAL, *COMPLEX)
EMPTY = """\
int _DllMainCRTStartup(void *a, unsigned b, void *c) { return 1; }
int DllMainCRTStartup(void *a, unsigned b, void *c) { return 1; }
"""
RANDOM = """\
#include <stddef.h>
__declspec(dllimport) unsigned char __stdcall SystemFunction036(void *, unsigned long);
__declspec(dllexport) int ProcessPrng(unsigned char *data, size_t size)
{
    return SystemFunction036(data, (unsigned long)size);
}
"""


def compiled_name(name: str) -> str:
    """Return the function that an export stands for, empty where it is none of ours; a long double is a double here."""
    if name in FUNCTIONS:
        return name
    if name.endswith("f") and name[:-1] in FUNCTIONS:
        return name
    if name.endswith("l") and name[:-1] in FUNCTIONS:
        return name[:-1]
    return ""


def source_of(name: str) -> str:
    """Return the C source of a function that hands on to the compiler's."""
    stem = name if name in FUNCTIONS else name[:-1]
    real = "double" if name == stem else "float"
    number = f"{real} _Complex"
    result = real if stem in REAL else number
    arguments, given = (f"{number} x, {number} y", "x, y") if stem == "cpow" else (f"{number} x", "x")
    return f"__declspec(dllexport) {result} w_{name}({arguments}) {{ return {name}({given}); }}\n"


def made(folder: Path, name: str, source: str, *more: str, exports: str = "") -> Path:
    """Compile a library of a name in a folder; exports: its definition file, where it has one."""
    code = folder / f"{name}.c"
    code.write_text(source)
    inputs = [str(code)]
    if exports:
        definition = folder / f"{name}.def"
        definition.write_text(f"LIBRARY {name}.dll\nEXPORTS\n{exports}")
        inputs.append(str(definition))
    library = folder / f"{name}.dll"
    subprocess.run([*COMPILER, *inputs, "-o", str(library), *more], check=True)
    return library


def main() -> None:
    """Make the libraries and put them in their place."""
    system, folder = map(Path, sys.argv[1:])
    folder.mkdir(parents=True, exist_ok=True)
    wine = pefile.PE(str(WINE_UCRT), fast_load=True)
    wine.parse_data_directories([0])
    names = sorted({symbol.name.decode() for symbol in wine.DIRECTORY_ENTRY_EXPORT.symbols if symbol.name})
    handed_on, own = "", set()
    for name in names:
        function = compiled_name(name)
        if function:
            own.add(function)
        handed_on += f"{name} = wcomplex.{function}\n" if function else f"{name} = wucrt.{name}\n"
    functions = "#include <complex.h>\n" + "".join(map(source_of, sorted(own)))
    own_names = "".join(f"{name} = w_{name}\n" for name in sorted(own))
    libraries = [
        made(folder, "wcomplex", functions, "-lm", exports=own_names),
        made(folder, "bcryptprimitives", RANDOM, "-ladvapi32"),
        made(folder, "ucrtbase", EMPTY, "-nostdlib", "-Wl,-e,DllMainCRTStartup", exports=handed_on),
    ]
    contents = {library.name: library.read_bytes() for library in libraries}
    renamed = bytearray(WINE_UCRT.read_bytes())
    if not renamed[BUILTIN_PLACE].startswith(BUILTIN):
        raise SystemExit(f"{WINE_UCRT} is not the library that this script knows")
    renamed[BUILTIN_PLACE] = bytes(BUILTIN_PLACE.stop - BUILTIN_PLACE.start)
    contents["wucrt.dll"] = bytes(renamed)
    for name, content in contents.items():
        place = system / name
        place.unlink(missing_ok=True)  # a link to Wine's
        place.write_bytes(content)


if __name__ == "__main__":
    main()
