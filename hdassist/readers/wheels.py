"""Measured teeth of a drive's wheels from their pitch files, the directions of their marks, and notes on both."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import isfinite

from hdassist.errors import UsageError
from hdassist.model.wheels import MeasuredTeeth, MeasuredWheel
from hdassist.preset.deviations import IN_TEETH
from hdassist.preset.fields import Drive
from hdassist.preset.overrides import is_overridden
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
    def is_marked(self) -> bool:
        """Whether a direction of a mark is given."""
        return self.mark_b is not None or self.mark_g is not None

    def mark(self, name: str) -> float | None:
        """Direction [deg] of the mark of a wheel; None where it is not given."""
        return self.mark_b if name == "b" else self.mark_g

    def require_sound(self) -> None:
        """Raise UsageError for a mark or a form without a file, and for a mark that is not finite."""
        for name in WHEEL_NAMES:
            mark = self.mark(name)
            if mark is not None and name not in self.files:
                raise UsageError(
                    f"--mark-{name} is the mark of a measured wheel", f"--pitch-{name} FILE names its file"
                )
            if mark is not None and not isfinite(mark):
                raise UsageError(f"invalid --mark-{name} {mark}: expected an angle in deg")
        if not self.files and (self.pitch_form or self.pitch_sense or self.pitch_flank):
            raise UsageError("--pitch-form, --pitch-sense and --pitch-flank say how to read --pitch-b and --pitch-g")

    def read(self, drive: Drive) -> MeasuredTeeth | None:
        """The measured wheels of a drive, with the assumptions made in their notes; None without a file.

        Raises PresetError with the faults of a file, DataError for a file that cannot be read, UsageError where the
        direction of a mark is unknown.
        """
        wheels = {name: self._wheel(name, file, drive) for name, file in self.files.items()}
        return MeasuredTeeth(**wheels) if wheels else None

    def _wheel(self, name: str, file: str, drive: Drive) -> MeasuredWheel:
        teeth = drive.gears.z_b if name == "b" else drive.gears.z_g
        pitch = read_pitch(file, teeth, form=self.pitch_form, sense=self.pitch_sense, flank=self.pitch_flank)
        mark, notes = self.mark(name), list(pitch.notes)
        if mark is None and (given := drive.value(f"phases.xi_{name}")) is None:
            raise UsageError(f"unknown direction of the mark of {file}", f"like --mark-{name} 30, in deg")
        if mark is None:
            mark = float(given)
            notes.append(
                f"the mark stands at {mark:g} deg, as phases.xi_{name} of the preset; --mark-{name} says otherwise"
            )
        notes += _other_deviations(drive, name)
        return MeasuredWheel(replace(pitch, notes=tuple(notes)), mark % 360)


def _other_deviations(drive: Drive, name: str) -> Iterator[str]:
    """Notes on the preset's deviations that are added to a measured wheel, or have no effect beside it."""
    if name == "b" and drive.value("tolerances.e_b"):
        yield "tolerances.e_b is added to the measured teeth: right only where their own centre was the datum"
    composite, *harmonics = IN_TEETH[name]
    replaced = [composite] if is_overridden(composite, drive.origin.overrides) else []
    for path in (*replaced, *filter(drive.number, harmonics)):
        yield f"{path} has no effect, the teeth are measured"
