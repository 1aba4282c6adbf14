"""Deviations of the parts: the fields of their sizes and directions, and the one table of them.

A size or direction that a preset does not give is unknown, not zero.
"""

from dataclasses import dataclass
from typing import Literal

from hdassist.preset.kinds import DECLARED_FIELDS, Section

Part = Literal["g", "b", "h"]


class Tolerances(Section):
    """Deviations of the parts: first harmonics, as peak-to-peak for teeth and as offset for the cam."""


class Phases(Section):
    """Directions of the deviations at phi_h = phi_g = 0, counter-clockwise seen from the cam side."""


class Harmonics(Section):
    """Deviations of the teeth of higher order, along the pitch circle."""


@dataclass(frozen=True)
class Deviation:
    """A deviation of a part, by the paths of its size [um] and its direction [deg].

    kind: composite, the first harmonic of a wheel's teeth from peak to peak (F'_i); harmonic of the teeth, an
    amplitude; seat, a harmonic that the seat of the rigid wheel presses on it; cam, an offset of the cam; centre, an
    offset of a wheel's teeth. part: that it turns with, flexspline g, rigid wheel b or cam h; order: waves around it.
    """

    size: str
    direction: str
    kind: Literal["composite", "harmonic", "seat", "cam", "centre"]
    part: Part
    order: int = 1

    @property
    def name(self) -> str:
        """Name of the size within its section."""
        return self.size.split(".")[1]

    @property
    def stays_with_seat(self) -> bool:
        """Whether it stands still where the wheel that it belongs to is turned on its seat."""
        return self.kind in ("cam", "seat")


DEVIATIONS = tuple(Deviation(**each) for each in DECLARED_FIELDS["deviations"])
COMPOSITES = {each.part: each for each in DEVIATIONS if each.kind == "composite"}
CAM_OFFSETS = {each.part: each for each in DEVIATIONS if each.kind == "cam"}
DEVIATION_FIELDS = frozenset(path for each in DEVIATIONS for path in (each.size, each.direction))
# sizes, by wheel, that measured pitch deviations replace
IN_TEETH: dict[str, tuple[str, ...]] = {
    wheel: tuple(d.size for d in DEVIATIONS if d.part == wheel and d.kind in ("composite", "harmonic"))
    for wheel in COMPOSITES
}
