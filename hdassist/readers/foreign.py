"""Files of other programs: their kinds, and rows of a table in place of those whose meaning is known.

PHD2 guide log: sections of rows under a line of names; RARawDistance in pixels, `Pixel scale` and `Dec` above them.
Where no row has a pulse (RADuration), the mount follows the sky by itself; a line between rows may move the star.
EQMOD PE file: `!WormPeriod` in s, `!StepsPerWorm`, then rows of time in s, motor steps and error in arcsec.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from math import cos, isfinite, nan, radians

from hdassist.errors import DataError, Finding, PresetError
from hdassist.files import TextFile, number_of

_SIDEREAL = 15.041067  # arcsec/s: of a telescope's axis that follows the sky
_PROGRAMS = {  # words in the first lines, and the file that they are of
    r"PHD2 (?:version|log version)|^PHD2": "a guide log of PHD2",
    r"^!WormPeriod": "a PE file of EQMOD",
    r"^TARGET DATA::|^USER-TEXT::": "a record of a laser at targets (.rtl)",
    r"^\W*(?:Record Length|Sample Interval|Horizontal Scale)\b": "a record of an oscilloscope",
    r"\b(?:TRUE|FALSE)$": "a record of a controller's signals",
    r"^\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d\S* \D": "a log of events",
}
_HEAD = 40  # lines that name a program
_GUIDE_FACT = r"(Pixel scale|(?<!Cal )\bDec) = ([-+0-9.]+)(?: arc-sec/px| deg)?(?:,|$)"


def program_of(lines: Sequence[str]) -> str:
    """The file of another program that some first lines are of, in words; empty for none that is known."""
    text = "\n".join(lines[:_HEAD])
    return next((words for pattern, words in _PROGRAMS.items() if re.search(pattern, text, re.MULTILINE)), "")


def readable_parts(text: TextFile, notes: list[str]) -> Iterator[tuple[int, str]]:
    """Parts of a text, those of a guide log or PE file as lines of a table in the same places.

    Arguments: text; notes, to which it is added how a file was taken.
    Raises PresetError: such a file without anything that a trace can be made of.
    """
    parts = text.parts()
    for first, part in parts:
        program = program_of(part.split("\n", _HEAD)) if first == 1 else ""
        translate = {"a guide log of PHD2": _of_guide_log, "a PE file of EQMOD": _of_pe_file}.get(program)
        if translate is None:
            yield first, part
            continue
        lines = "\n".join([part, *(following for _, following in parts)]).split("\n")
        try:
            yield 1, "\n".join(translate(lines, notes))
        except DataError as error:
            raise PresetError([Finding(text.name, 1, 1, "", error.message, hint=error.hint)]) from None


def _of_pe_file(lines: list[str], notes: list[str]) -> Iterator[str]:
    """Angle of the shaft that turns once a worm period, the cam, by motor steps, else by time."""
    facts = re.findall(r"^!(WormPeriod|StepsPerWorm)\s*=\s*([-+0-9.]+)", "\n".join(lines), re.MULTILINE)
    stated = {key: number_of(number) for key, number in reversed(facts)}  # the first of each
    period, steps = (stated.get(key, nan) for key in ("WormPeriod", "StepsPerWorm"))
    if not period > 0:
        raise DataError("a PE file of EQMOD without its !WormPeriod", "!WormPeriod=479 above the rows, in s")
    column, turn, by = (1, steps, "motor steps") if steps > 0 else (0, period, "time")
    notes.append(
        f"a PE file of EQMOD: a turn of the cam in the worm period of {period:g} s, by {by}; its sense is not known"
    )
    names = "cam_deg error_arcsec"
    for line in lines:
        numbers = [number_of(word) for word in line.split()]
        is_row = len(numbers) == 3 and all(number == number for number in numbers)
        row = f"{360 * numbers[column] / turn:.7f} {numbers[2]:g}" if is_row else ""
        yield names if names and "=" in line else row
        names = "" if "=" in line else names


def _of_guide_log(lines: list[str], notes: list[str]) -> list[str]:
    """The longest unguided section: error in right ascension over the angle of the axis that follows the sky."""
    sections: list[tuple[float | None, dict[int, str]]] = [(None, {})]
    stated: dict[str, float] = {}
    names: list[str] = []
    for index, line in enumerate(lines):
        stated |= {key: number_of(number) for key, number in re.findall(_GUIDE_FACT, line)}
        names = line.split(",") if line.startswith("Frame,") else names
        row = dict(zip(names, line.split(","), strict=False))
        pulse = row.get("RADuration", "")
        if not line[:1].isdecimal() or pulse.strip("0"):
            sections.append((stated.get("Dec"), {}))
            continue
        time, pixels = (number_of(row.get(name, "")) for name in ("Time", "RARawDistance"))
        arcsec = pixels * stated.get("Pixel scale", nan) / cos(radians(stated.get("Dec", 0.0)))
        if pulse and isfinite(time) and isfinite(arcsec):
            sections[-1][1][index] = f"{time * _SIDEREAL / 3600:.7f} {arcsec:.4f}"
    dec, longest = max(sections, key=lambda section: len(section[1]))
    if not longest:
        raise DataError(
            "a guide log of PHD2 without an unguided section: corrections hide the error",
            "record with guide output off, as the Guiding Assistant does, for some turns of the cam",
        )
    first, last = min(longest), max(longest)
    where = f"lines {first + 1} to {last + 1}, at declination {'0, not stated' if dec is None else f'{dec:g} deg'}"
    words = f"error in right ascension over the angle at {_SIDEREAL:g} arcsec/s; its sense is not known"
    notes.append(f"a guide log of PHD2: the longest unguided section, {where}, {words}")
    return [longest.get(index, "output_deg error_arcsec" * (index == first - 1)) for index in range(len(lines))]
