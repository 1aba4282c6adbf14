"""Measured teeth of a drive's wheels from their pitch files, the directions of their marks, and notes on both."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite

from hdassist.errors import UsageError
from hdassist.model.wheels import MeasuredTeeth, MeasuredWheel
from hdassist.preset.fields import IN_TEETH, Drive, is_overridden
from hdassist.readers.pitch import Flank, PitchForm, Sense, read_pitch

WHEEL_NAMES = ("b", "g")


@dataclass(frozen=True)
class WheelFiles:
    """Pitch files of the rigid wheel (b) and the flexspline (g), directions [deg] of their marks, and their form."""

    pitch_b: str | None = None
    pitch_g: str | None = None
    mark_b: float | None = None
    mark_g: float | None = None
    pitch_form: PitchForm | None = None
    pitch_sense: Sense | None = None
    pitch_flank: Flank | None = None

    @property
    def files(self) -> dict[str, str]:
        """The given files by wheel."""
        return {name: file for name in WHEEL_NAMES if (file := getattr(self, f"pitch_{name}")) is not None}

    @property
    def marks(self) -> dict[str, float]:
        """The given directions of marks [deg] by wheel."""
        return {name: mark for name in WHEEL_NAMES if (mark := getattr(self, f"mark_{name}")) is not None}

    def require_sound(self) -> None:
        """Raise UsageError for a mark or a form without a file, and for a mark that is not finite."""
        for name, mark in self.marks.items():
            if name not in self.files:
                raise UsageError(
                    f"--mark-{name} is the mark of a measured wheel", f"--pitch-{name} FILE names its file"
                )
            if not isfinite(mark):
                raise UsageError(f"invalid --mark-{name} {mark}: expected an angle in deg")
        if not self.files and (self.pitch_form or self.pitch_sense or self.pitch_flank):
            raise UsageError("--pitch-form, --pitch-sense and --pitch-flank say how to read --pitch-b and --pitch-g")

    def read(self, drive: Drive) -> MeasuredTeeth | None:
        """The measured wheels of a drive, with the assumptions made in their notes; None without a file.

        Raises PresetError with the faults of a file, DataError for a file that cannot be read, UsageError where the
        direction of a mark is unknown.
        """
        wheels = {}
        for name, file in self.files.items():
            teeth = drive.gears.z_b if name == "b" else drive.gears.z_g
            pitch = read_pitch(file, teeth, form=self.pitch_form, sense=self.pitch_sense, flank=self.pitch_flank)
            mark, notes = self.marks.get(name), list(pitch.notes)
            if mark is None:
                if (given := drive.value(f"phases.xi_{name}")) is None:
                    raise UsageError(f"unknown direction of the mark of {file}", f"like --mark-{name} 30, in deg")
                mark = float(given)
                words = f"the mark stands at {mark:g} deg, as phases.xi_{name} of the preset"
                notes.append(f"{words}; --mark-{name} says otherwise")
            if name == "b" and drive.value("tolerances.e_b"):
                notes.append(
                    "tolerances.e_b is added to the measured teeth: right only where their own centre was the datum"
                )
            composite, *harmonics = IN_TEETH[name]
            replaced = [composite] if is_overridden(composite, drive.origin.overrides) else []
            without_effect = (*replaced, *filter(drive.number, harmonics))
            notes += [f"{path} has no effect, the teeth are measured" for path in without_effect]
            wheels[name] = MeasuredWheel(replace(pitch, notes=tuple(notes)), mark % 360)
        return MeasuredTeeth(**wheels) if wheels else None
