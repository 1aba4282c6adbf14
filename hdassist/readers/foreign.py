"""Files of other programs: what they are, and rows of a table in place of those whose meaning is known.

PHD2 guide log: sections of rows under a line of names; RARawDistance in pixels, `Pixel scale` and `Dec` above them.
While `MountGuidingEnabled = false`, or the mount's guiding is disabled, the mount follows the sky by itself.
EQMOD PE file: `!WormPeriod` in s, `!StepsPerWorm`, then rows of time in s, motor steps and error in arcsec.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from math import cos, radians

from hdassist.errors import DataError, Finding, PresetError
from hdassist.numerals import number_of
from hdassist.textfile import TextFile

SIDEREAL = 15.041067  # arcsec/s: of a telescope's axis that follows the sky
FARTHEST_DEC = 80.0  # deg: beyond, a turn of the axis hardly moves the star
PROGRAMS = {  # words in the first lines, and the file that they are of
    r"PHD2 (?:version|log version)|^PHD2": "a guide log of PHD2",
    r"^!WormPeriod": "a PE file of EQMOD",
    r"^TARGET DATA::|^USER-TEXT::": "a record of a laser at targets (.rtl)",
    r"^\W*(?:Record Length|Sample Interval|Horizontal Scale)\b": "a record of an oscilloscope",
    r"\b(?:TRUE|FALSE)$": "a record of a controller's signals",
    r"^\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d\S* \D": "a log of events",
}
_HEAD = 40  # lines that name a program
_NUMBER = r"\s*=\s*([-+0-9.]+)"


def program_of(lines: Sequence[str]) -> str:
    """The file of another program that some first lines are of, in words; empty for none that is known."""
    text = "\n".join(lines[:_HEAD])
    return next((words for pattern, words in PROGRAMS.items() if re.search(pattern, text, re.MULTILINE)), "")


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
    """Angle of what turns once a worm period, the cam, by motor steps, else by time."""
    period, steps = (_stated(rf"^!{key}{_NUMBER}", lines) for key in ("WormPeriod", "StepsPerWorm"))
    if not (period and period > 0):
        raise DataError("a PE file of EQMOD without its !WormPeriod", "!WormPeriod=479 above the rows, in s")
    column, turn, by = (1, steps, "motor steps") if steps and steps > 0 else (0, period, "time")
    notes.append(
        f"a PE file of EQMOD: a turn of the cam in the worm period of {period:g} s, by {by}; its sense is not known"
    )
    names = "cam_deg time_s error_arcsec"
    for line in lines:
        numbers = [number_of(word) for word in line.split()]
        is_row = len(numbers) == 3 and all(number == number for number in numbers)
        row = f"{360 * numbers[column] / turn:.7f} {numbers[0]:g} {numbers[2]:g}" if is_row else ""
        yield names if names and "=" in line else row
        names = "" if "=" in line else names


def _of_guide_log(lines: list[str], notes: list[str]) -> list[str]:
    """The longest unguided section: error in right ascension over the angle of the axis that follows the sky."""
    sections: list[dict[int, str]] = [{}]
    scale, dec, is_guided, names = 0.0, 0.0, True, 0
    place = {name: index for index, name in enumerate(("Frame", "Time", "mount", "dx", "dy", "RARawDistance"))}
    for index, line in enumerate(lines):
        if found := re.search(rf"Pixel scale{_NUMBER}", line):
            scale = float(found[1])
        if found := re.search(rf"\bDec{_NUMBER} deg", line):
            dec = float(found[1])
        if found := re.search(r"MountGuidingEnabled = (\w+)|^Mount = .*guiding (enabled|disabled)", line):
            is_guided = (found[1] or found[2]) in {"true", "enabled"}
            sections.append({})
        if line.startswith(("Frame,", "Guiding Begins")):
            place = {name: at for at, name in enumerate(line.split(","))} if line.startswith("Frame,") else place
            sections.append({})
        cells = line.split(",")
        if is_guided or not cells[0].isdecimal() or len(cells) <= place["RARawDistance"]:
            continue
        time, distance = (number_of(cells[place[name]]) for name in ("Time", "RARawDistance"))
        if scale and abs(dec) < FARTHEST_DEC and time == time and distance == distance:
            angle, error = time * SIDEREAL / 3600, distance * scale / cos(radians(dec))
            sections[-1][index] = f"{angle:.7f} {time:g} {error:.4f}"
    longest = max(sections, key=len)
    if not longest:
        raise DataError(
            "a guide log of PHD2 without an unguided section: corrections hide the error",
            "record with guide output off, as the Guiding Assistant does, for some turns of the cam",
        )
    names = min(longest) - 1
    where = f"lines {names + 2} to {max(longest) + 1}"
    words = f"error in right ascension at {dec:g} deg, over the angle at {SIDEREAL:g} arcsec/s; its sense is not known"
    notes.append(f"a guide log of PHD2: the longest unguided section, {where}, {words}")
    return [longest.get(index, "output_deg time_s error_arcsec" * (index == names)) for index in range(len(lines))]


def _stated(pattern: str, lines: list[str]) -> float | None:
    """The number of the first line that fits a pattern."""
    return next((number_of(found[1]) for line in lines if (found := re.search(pattern, line))), None)
