"""Files of measured teeth on the command line: asked for, read, and what was assumed said on stderr."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import TYPE_CHECKING, Literal

from hdassist.errors import DataError, PresetError, UsageError
from hdassist.terminal.options import PitchOptions
from hdassist.terminal.output import note

if TYPE_CHECKING:
    from hdassist.model.wheels import MeasuredTeeth, MeasuredWheel
    from hdassist.preset.fields import Drive


@dataclass(frozen=True)
class PitchFiles:
    """Pitch files of the rigid wheel (b) and the flexspline (g), and how to read them."""

    b: tuple[str | None, float | None]
    g: tuple[str | None, float | None]
    form: Literal["cumulative", "single"] | None
    sense: Literal["ccw", "cw"] | None
    flank: Literal["left", "right"] | None

    @classmethod
    def asked(cls, presets: Sequence[str], options: PitchOptions) -> PitchFiles:
        """What the options ask for. Raises UsageError for options that cannot be meant, before any file is read."""
        b, g = (options.pitch_b, options.mark_b), (options.pitch_g, options.mark_g)
        form, sense, flank = options.pitch_form, options.pitch_sense, options.pitch_flank
        for name, (file, mark) in (("b", b), ("g", g)):
            if mark is not None and file is None:
                raise UsageError(
                    f"--mark-{name} is the mark of a measured wheel", f"--pitch-{name} FILE names its file"
                )
            if mark is not None and not isfinite(mark):
                raise UsageError(f"--mark-{name} must be an angle in degrees, not {mark}")
        files = [file for file, _ in (b, g) if file is not None]
        if not files and (form or sense or flank):
            raise UsageError("--pitch-form, --pitch-sense and --pitch-flank say how to read --pitch-b and --pitch-g")
        if files and len(presets) > 1:
            raise UsageError("measured teeth are those of one drive", "check the drives one by one")
        if [*presets, *files].count("-") > 1:
            raise UsageError("standard input has one file, and - is given twice", "name the other file")
        return cls(b, g, form, sense, flank)

    def read(self, drive: Drive) -> MeasuredTeeth | None:
        """The measured wheels of a drive, None without a file; says on stderr what was assumed.

        Raises PresetError with the faults of both files, DataError for a file that cannot be read.
        """
        if self.b[0] is None and self.g[0] is None:
            return None
        from hdassist.model.wheels import MeasuredTeeth

        found: dict[str, MeasuredWheel | None] = {}
        errors: list[DataError] = []
        for name in ("b", "g"):
            try:
                found[name] = self._wheel(name, drive)
            except DataError as error:
                errors.append(error)
        if errors:
            raise errors[0] if len(errors) == 1 else _both(errors)
        for name, words in (("b", "rigid wheel"), ("g", "flexspline")):
            wheel = found[name]
            for text in wheel.pitch.notes if wheel else ():
                note(f"note: {words}, {wheel.pitch.file if wheel else ''}: {text}")
        return MeasuredTeeth(**found)

    def _wheel(self, name: str, drive: Drive) -> MeasuredWheel | None:
        from hdassist.model.wheels import MeasuredWheel
        from hdassist.preset.overrides import is_overridden
        from hdassist.readers.pitch import read_pitch

        file, mark = self.b if name == "b" else self.g
        if file is None:
            return None
        teeth = drive.gears.z_b if name == "b" else drive.gears.z_g
        pitch = read_pitch(file, teeth, form=self.form, sense=self.sense, flank=self.flank)
        notes = list(pitch.notes)
        if mark is None:
            mark = float(drive.value(f"phases.xi_{name}"))
            notes.append(
                f"the mark stands at {mark:g} deg, as phases.xi_{name} of the preset; --mark-{name} says otherwise"
            )
        replaced = f"tolerances.F_i{2 if name == 'b' else 1}"
        if is_overridden(replaced, drive.origin.overrides):
            notes.append(f"{replaced} has no effect, the teeth are measured")
        return MeasuredWheel(replace(pitch, notes=tuple(notes)), mark % 360)


def _both(errors: Sequence[DataError]) -> DataError:
    """One error for the faults of both files."""
    findings = [finding for error in errors if isinstance(error, PresetError) for finding in error.findings]
    if all(isinstance(error, PresetError) for error in errors):
        return PresetError(findings)
    return DataError("\n".join(e.message for e in errors), "\n  hint: ".join(e.hint for e in errors if e.hint))
