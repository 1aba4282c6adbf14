"""Files of measured teeth: asked for on the command line, read, with notes on stderr, and in the heads of pages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hdassist.errors import UsageError
from hdassist.preset.yamltext import shown
from hdassist.terminal.options import PitchOptions, stdin_once
from hdassist.terminal.output import note

if TYPE_CHECKING:
    from hdassist.model.wheels import MeasuredTeeth
    from hdassist.preset.fields import Drive
    from hdassist.readers.pitch import WheelFiles

WHEEL_WORDS = {"b": "rigid wheel", "g": "flexspline"}


def pitch_files(presets: Sequence[str], options: PitchOptions) -> WheelFiles:
    """The files that options name, if any. Raises UsageError for options that cannot be meant, before any is read."""
    found = options.wheels()
    found.require_sound()
    if found.files and len(presets) > 1:
        raise UsageError("measured teeth are those of one drive", "check the drives one by one")
    stdin_once(*presets, *found.files.values())
    return found


def read_teeth(files: WheelFiles, drive: Drive) -> MeasuredTeeth | None:
    """The measured wheels of a drive, None without a file; assumptions are noted on stderr.

    Raises PresetError with the faults of a file, DataError for a file that cannot be read.
    """
    found = files.read(drive)
    say_notes(found)
    return found


def say_notes(measured: MeasuredTeeth | None) -> None:
    """Note assumptions on measured wheels on stderr."""
    for name, wheel in measured.by_name.items() if measured else ():
        for text in wheel.pitch.notes:
            note(f"note: {WHEEL_WORDS[name]}, {wheel.pitch.file}: {text}")


def heading(measured: MeasuredTeeth | None) -> str:
    """Words behind a heading: whose teeth were measured; empty where none were."""
    found = measured.by_name.items() if measured else ()
    words = ", ".join(f"{WHEEL_WORDS[name]} ({shown(wheel.pitch.file)})" for name, wheel in found)
    return f"; measured teeth: {words}" if words else ""
