"""Files of measured teeth on the command line: asked for, read, and what was assumed said on stderr."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import TYPE_CHECKING

from hdassist.errors import DataError, PresetError, UsageError
from hdassist.terminal.options import PitchOptions
from hdassist.terminal.output import note

if TYPE_CHECKING:
    from hdassist.model.wheels import MeasuredTeeth, MeasuredWheel
    from hdassist.preset.fields import Drive

WORDS = {"b": "rigid wheel", "g": "flexspline"}


@dataclass(frozen=True)
class PitchFiles:
    """Pitch files of the rigid wheel (b) and the flexspline (g), and how to read them."""

    options: PitchOptions

    @classmethod
    def asked(cls, presets: Sequence[str], options: PitchOptions) -> PitchFiles:
        """What the options ask for. Raises UsageError for options that cannot be meant, before any file is read."""
        found = cls(options)
        named = [file for file, _ in map(found._asked, WORDS) if file is not None]
        for name in WORDS:
            file, mark = found._asked(name)
            if mark is not None and file is None:
                raise UsageError(
                    f"--mark-{name} is the mark of a measured wheel", f"--pitch-{name} FILE names its file"
                )
            if mark is not None and not isfinite(mark):
                raise UsageError(f"--mark-{name} must be an angle in degrees, not {mark}")
        if not named and (options.pitch_form or options.pitch_sense or options.pitch_flank):
            raise UsageError("--pitch-form, --pitch-sense and --pitch-flank say how to read --pitch-b and --pitch-g")
        if named and len(presets) > 1:
            raise UsageError("measured teeth are those of one drive", "check the drives one by one")
        if [*presets, *named].count("-") > 1:
            raise UsageError("standard input has one file, and - is given twice", "name the other file")
        return found

    def read(self, drive: Drive) -> MeasuredTeeth | None:
        """The measured wheels of a drive, None without a file; says on stderr what was assumed.

        Raises PresetError with the faults of both files, DataError for a file that cannot be read.
        """
        from hdassist.model.wheels import MeasuredTeeth

        found: dict[str, MeasuredWheel] = {}
        errors: list[DataError] = []
        for name in WORDS:
            file, mark = self._asked(name)
            try:
                if file is not None:
                    found[name] = self._wheel(name, file, mark, drive)
            except DataError as error:
                errors.append(error)
        if errors:
            raise errors[0] if len(errors) == 1 else _both(errors)
        for name, wheel in found.items():
            for text in wheel.pitch.notes:
                note(f"note: {WORDS[name]}, {wheel.pitch.file}: {text}")
        return MeasuredTeeth(**found) if found else None

    def _asked(self, name: str) -> tuple[str | None, float | None]:
        """File of a wheel, and direction [deg] of its mark."""
        asked = self.options
        return (asked.pitch_b, asked.mark_b) if name == "b" else (asked.pitch_g, asked.mark_g)

    def _wheel(self, name: str, file: str, mark: float | None, drive: Drive) -> MeasuredWheel:
        from hdassist.model.wheels import MeasuredWheel
        from hdassist.preset.overrides import is_overridden
        from hdassist.readers.pitch import read_pitch

        asked = self.options
        teeth, F_i = (drive.gears.z_b, "F_i2") if name == "b" else (drive.gears.z_g, "F_i1")
        pitch = read_pitch(file, teeth, form=asked.pitch_form, sense=asked.pitch_sense, flank=asked.pitch_flank)
        notes = list(pitch.notes)
        if mark is None and (given := drive.value(f"phases.xi_{name}")) is None:
            raise UsageError(f"where the mark of {file} stands is not known", f"--mark-{name} 30, in deg")
        if mark is None:
            mark = float(given)
            notes.append(
                f"the mark stands at {mark:g} deg, as phases.xi_{name} of the preset; --mark-{name} says otherwise"
            )
        if name == "b" and drive.tolerances.e_b:
            notes.append(
                "tolerances.e_b is added to the measured teeth: right only where their own centre was the datum"
            )
        lost = [f"tolerances.{F_i}"] if is_overridden(f"tolerances.{F_i}", drive.origin.overrides) else []
        lost += [path for n in (2, 3, 4) if drive.number(path := f"harmonics.a_{name}{n}")]
        notes += [f"{path} has no effect, the teeth are measured" for path in lost]
        return MeasuredWheel(replace(pitch, notes=tuple(notes)), mark % 360)


def _both(errors: Sequence[DataError]) -> DataError:
    """One error for the faults of both files."""
    findings = [finding for error in errors if isinstance(error, PresetError) for finding in error.findings]
    if all(isinstance(error, PresetError) for error in errors):
        return PresetError(findings)
    return DataError("\n".join(e.message for e in errors), "\n  hint: ".join(e.hint for e in errors if e.hint))
