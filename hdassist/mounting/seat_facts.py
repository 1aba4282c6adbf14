"""The seat of the fixed wheel as facts: where its holes, the positions and the directions lie."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.mounting.advice import Advice
from hdassist.mounting.positions import Position
from hdassist.terminal.texts import Texts


@dataclass(frozen=True)
class Hole:
    """A hole of the seat: its number, counted from now; its direction [deg]; whether it may be used."""

    number: int
    angle_deg: float
    usable: bool


@dataclass(frozen=True)
class Place:
    """A position of the wheel on the seat: now, best or worst; its direction [deg], a letter and a word for it."""

    kind: str
    angle_deg: float
    letter: str
    words: str


@dataclass(frozen=True)
class Pointer:
    """A direction from the centre: mark now, mark afterwards, or cam; [deg], a letter and words for it."""

    kind: str
    angle_deg: float
    letter: str
    words: str


@dataclass(frozen=True)
class Seat:
    """The seat, counter-clockwise from the right, seen from the cam side.

    holes: none where the angle is free; first_deg: direction of hole 0; turn_deg: the turn from now, the shorter
    way, negative for clockwise; legend: what letters and numbers mean, for a drawing in characters.
    """

    title: str
    holes: tuple[Hole, ...]
    first_deg: float
    turn_deg: float
    places: tuple[Place, ...]
    pointers: tuple[Pointer, ...]
    barred: str
    legend: str


def seat_of(advice: Advice, texts: Texts, target: Position, *, best: bool = True) -> Seat:
    """The seat of a drive, with the position that the wheel is to go to.

    Arguments: advice; texts of the reader's language; target, where the wheel goes; best, whether that is another
    place than now.
    """
    mounting, curve = advice.drive.mounting, advice.curve
    first, barred = mounting.first_hole, texts("seat.letter_barred")
    shown = [("worst", advice.ranked[-1]), ("now", curve.current), *([("best", target)] if best else [])]
    places = tuple(
        Place(kind, first + p.rotation_deg, texts(f"seat.letter_{kind}"), texts(f"seat.{kind}")) for kind, p in shown
    )
    holes = tuple(
        Hole(k, first + 360 * k / mounting.holes, curve.allowed is None or k in curve.allowed)
        for k in range(mounting.holes)
    )
    order = {"now": 0, "best": 1, "worst": 2}
    words = [f"{p.letter} {p.words}" for p in sorted(places, key=lambda p: order[p.kind])]
    legend = texts("seat.legend" if holes else "seat.legend_free", places=", ".join(words))
    if not all(hole.usable for hole in holes):
        legend += "; " + texts("seat.barred", letter=barred)
    pointers = _pointers(advice, texts, target)
    turn = target.short_way_deg if best else 0.0
    return Seat(texts("seat.title"), holes, first, turn, places, pointers, barred, legend)


def mark_deg(advice: Advice) -> float:
    """Direction of the fixed wheel's mark [deg], in 0..360: as the preset gives it, or that of a measured wheel."""
    drive, phases = advice.drive, advice.drive.phases
    if measured := advice.measured and advice.measured.fixed(drive):
        return measured.mark_deg % 360
    return (phases.xi_b if drive.mounting.fixed == "rigid" else phases.xi_g) % 360


def _pointers(advice: Advice, texts: Texts, target: Position) -> tuple[Pointer, ...]:
    """Mark now and afterwards (one where they are the same), and the cam offset if there is one."""
    now, drive = mark_deg(advice), advice.drive
    if target.rotation_deg % 360:
        found = [
            Pointer("now", now, "a", texts("pointer.now")),
            Pointer("after", (now + target.rotation_deg) % 360, "b", texts("pointer.after")),
        ]
    else:
        found = [Pointer("after", now, "b", texts("pointer.stays"))]
    rigid = drive.mounting.fixed == "rigid"
    offset, angle, symbol = (
        (drive.tolerances.e_hb, drive.phases.phi_hb, "e_hb")
        if rigid
        else (drive.tolerances.e_hg, drive.phases.phi_hg, "e_hg")
    )
    if offset:
        found.append(Pointer("cam", angle % 360, "c", texts("pointer.cam", symbol=symbol)))
    return tuple(found)
