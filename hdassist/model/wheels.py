"""Wheels as a gear checker found them, put into a drive: where the mark stands says which tooth is where.

In pitch-locked states the teeth stand at fixed places before the cam, so a wheel can only stand there by whole teeth.
A mark between two of these places means that the states come at cam angles between those that are counted. The
pattern is turned by the nearest whole number of teeth, and the rest, up to half a pitch, turns the cam offset that
stands with the wheel by as much the other way: how the two stand to each other is exact, and no tooth's deviation is
smoothed by interpolation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import UsageError
from hdassist.model.deviations import ToothDeviations, fixed_part
from hdassist.preset.fields import IN_TEETH, Drive

MAJOR = 90.0  # deg from x: the major axis of the cam at phi_h = 0, where tooth 0 stands


@dataclass(frozen=True, eq=False)
class PitchFile:
    """Pitch deviations of a wheel, tooth by tooth from its mark on, and where they come from.

    deviation: cumulative deviations [um] without their mean, shape (teeth,), positive along +theta
    (counter-clockwise, seen from the cam side); element 0 is the tooth with the mark, and teeth follow
    counter-clockwise. mark: the number of that tooth where it was measured. flank, file, sha256: the measured flank,
    and its file. notes: conversions and assumptions.
    """

    deviation: NDArray[np.float64]
    mark: int = 1
    flank: Literal["left", "right"] | None = None
    file: str = ""
    sha256: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class MeasuredWheel:
    """Measured pitch deviations of a wheel, and the direction [deg] in which its mark stands.

    mark_deg: counter-clockwise from x, seen from the cam side, at phi_h = phi_g = 0, like phases.xi_b.
    """

    pitch: PitchFile
    mark_deg: float


@dataclass(frozen=True)
class MeasuredTeeth:
    """Measured wheels in place of the preset's first harmonics: flexspline g, rigid wheel b, None keeps a harmonic."""

    g: MeasuredWheel | None = None
    b: MeasuredWheel | None = None

    @property
    def by_name(self) -> dict[str, MeasuredWheel]:
        """The wheels that are measured, by their names."""
        return {name: wheel for name, wheel in (("b", self.b), ("g", self.g)) if wheel}

    def fixed(self, drive: Drive) -> MeasuredWheel | None:
        """The wheel that is fixed in a drive, where it is measured."""
        return self.b if drive.mounting.fixed == "rigid" else self.g

    def rotated(self, drive: Drive, rotation_deg: float) -> MeasuredTeeth:
        """The same with the fixed wheel turned on its seat [deg], counter-clockwise seen from the cam side."""
        wheel = self.fixed(drive)
        turned = wheel and replace(wheel, mark_deg=wheel.mark_deg + rotation_deg)
        return replace(self, **{fixed_part(drive): turned})

    def without_harmonics(self, drive: Drive) -> Drive:
        """The drive with its measured wheels as if they had no deviation: what else it has, and leaves open."""
        return drive.with_values({path: 0.0 for name in self.by_name for path in IN_TEETH[name]})

    def in_drive(self, drive: Drive) -> tuple[Drive, ToothDeviations]:
        """What kinematic_error takes: the drive with its cam offsets turned by the rests, and a deviation per tooth.

        Raises UsageError where a wheel has another number of teeth than the drive's.
        """
        turned: dict[str, float] = {}
        found = {}
        for name, wheel, z in (("g", self.g, drive.gears.z_g), ("b", self.b, drive.gears.z_b)):
            if wheel is None:
                continue
            if len(wheel.pitch.deviation) != z:
                raise UsageError(f"a wheel of {z} teeth needs {z} deviations, not {len(wheel.pitch.deviation)}")
            teeth = (wheel.mark_deg - MAJOR) / 360 * z
            found[name] = np.roll(wheel.pitch.deviation, round(teeth))
            angle = f"phases.phi_h{name}"
            turned[angle] = drive.number(angle) - (teeth - round(teeth)) * 360 / z
        return drive.with_values(turned), ToothDeviations(**found)
