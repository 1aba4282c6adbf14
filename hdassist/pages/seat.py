"""The seat of the fixed wheel: what to do there in words, its places as facts, and drawn in characters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, cos, inf, radians, sin

from hdassist.mounting.positions import Choice, Position, hole_of
from hdassist.preset.fields import Drive
from hdassist.terminal.console import Style
from hdassist.terminal.texts import Texts, texts

TRADE = {"rigid": "rigid wheel (circular spline)", "flexspline": "flexspline"}  # the fixed wheel, in the trade's words
SEAT_WIDTH, SEAT_HEIGHT = 41, 15  # of the drawing, in characters
NUMBERED_IN_TEXT = 24  # holes that have room for their number
LETTER_RADIUS = {"now": 0.5, "after": 0.5, "cam": 0.28}  # how far out the letters of directions stand


def wheel(drive: Drive, say: Texts | None = None) -> str:
    """The wheel that is fixed, in words."""
    return (say or texts())(f"wheel.{drive.mounting.fixed}")


def turn(position: Position, say: Texts | None = None) -> str:
    """The turn to a position by the shorter way: holes, degrees and direction."""
    say = say or texts()
    way = position.short_way_deg
    direction = say("turn.counter_clockwise" if way > 0 else "turn.clockwise")
    angle = say.angle(abs(way))
    if position.hole is None:
        return say("turn.angle", angle=angle, direction=direction)
    per_hole = position.rotation_deg / position.hole if position.hole else 360.0
    return say("turn.holes", holes=say.holes(round(abs(way) / per_hole)), angle=angle, direction=direction)


def hole_place(position: Position, say: Texts | None = None) -> str:
    """A position in words: its hole, or the angle of the turn where the seat has none."""
    say = say or texts()
    return say.angle(position.rotation_deg) if position.hole is None else say("place.hole", hole=position.hole)


def place_at(rotation_deg: float, holes: int, say: Texts) -> str:
    """The same of a turn [deg] on a seat with so many holes."""
    hole = hole_of(rotation_deg, holes)
    return say.angle(rotation_deg) if hole is None else say("place.hole", hole=hole)


def instruction(choice: Choice, say: Texts | None = None, *, room: float = inf) -> str:
    """One sentence: what to do with the wheel; and what it brings, where there is room for that at each torque."""
    say = say or texts()
    fixed = wheel(choice.drive, say)
    if not choice.turn:
        return say("instruction.leave", wheel=fixed)
    if len(choice.torques) > room:
        return say("instruction.turn_alone", wheel=fixed, turn=turn(choice.chosen, say))
    values = zip(choice.torques, choice.current.F_ior_arcsec, choice.chosen.F_ior_arcsec, strict=True)
    gains = say("instruction.and").join(
        say("instruction.gain", now=say.number(now, ".2f"), new=say.number(new, ".2f"), torque=say.torque(M_g))
        for M_g, now, new in values
    )
    return say("instruction.turn", wheel=fixed, turn=turn(choice.chosen, say), gains=gains)


@dataclass(frozen=True)
class Hole:
    """A hole of the seat: its number, counted from now; its direction [deg]; whether it may be used."""

    number: int
    angle_deg: float
    usable: bool


@dataclass(frozen=True)
class SeatMark:
    """A direction on the seat [deg], with a letter and words for it.

    kind: of a place of the wheel now, best or worst; of a pointer from the centre now, after (the wheel's mark) or cam.
    """

    kind: str
    angle_deg: float
    letter: str
    words: str


@dataclass(frozen=True)
class Seat:
    """The seat, counter-clockwise from the right, seen from the cam side.

    holes: none where the angle is free; first_deg: direction of hole 0; turn_deg: the turn from now, the shorter
    way, negative for clockwise; barred: the letter of holes that are not allowed; legend: what letters and numbers
    mean, for a drawing in characters.
    """

    title: str
    holes: tuple[Hole, ...]
    first_deg: float
    turn_deg: float
    places: tuple[SeatMark, ...]
    pointers: tuple[SeatMark, ...]
    barred: str
    legend: str


def seat_of(choice: Choice, say: Texts, goal: Position | None, pointers: Sequence[SeatMark] = ()) -> Seat:
    """The seat of a drive with the position now, the worst one, and the one to go to.

    Arguments: choice; say, the texts of the reader's language; goal, where the wheel goes, None where it stays;
    pointers, directions of the mark and the cam.
    """
    mounting = choice.drive.mounting
    first, barred = mounting.first_hole, say("seat.letter_barred")
    named = {"now": choice.current, "best": goal, "worst": choice.ranked[-1]}
    places = [
        SeatMark(kind, first + p.rotation_deg, say(f"seat.letter_{kind}"), say(f"seat.{kind}"))
        for kind, p in named.items()
        if p
    ]
    holes = tuple(
        Hole(k, first + 360 * k / mounting.holes, mounting.allowed == "all" or k in mounting.allowed)
        for k in range(mounting.holes)
    )
    words = ", ".join(f"{p.letter} {p.words}" for p in places)
    legend = say("seat.legend" if holes else "seat.legend_free", places=words)
    if not all(hole.usable for hole in holes):
        legend += "; " + say("seat.barred", letter=barred)
    drawn = sorted(places, key=lambda p: ("worst", "now", "best").index(p.kind))  # the best one on top
    turned = goal.short_way_deg if goal else 0.0
    return Seat(say("seat.title"), holes, first, turned, tuple(drawn), tuple(pointers), barred, legend)


def seat_text(choice: Choice, style: Style) -> str:
    """The seat in characters: its holes by number, the present (N), chosen (B) and worst (W) one marked.

    Hole 0 is where the wheel stands; it lies at mounting.first_hole, counted counter-clockwise from the right.
    """
    seat = seat_of(choice, texts(), choice.chosen)
    return style.text(f"{drawing(seat)}\n\n{seat.legend}")


def drawing(seat: Seat) -> str:
    """The seat in characters, seen from the cam side."""
    canvas = [[" "] * SEAT_WIDTH for _ in range(SEAT_HEIGHT)]
    each = ceil(len(seat.holes) / NUMBERED_IN_TEXT)
    for hole in seat.holes:
        label = "." if hole.number % each else str(hole.number)
        _put(canvas, hole.angle_deg, label if hole.usable else seat.barred, 1.0)
    for k in range(0 if seat.holes else NUMBERED_IN_TEXT):
        _put(canvas, seat.first_deg + 360 * k / NUMBERED_IN_TEXT, ".", 1.0)
    for place in seat.places:
        _put(canvas, place.angle_deg, place.letter, 0.72)
    for pointer in seat.pointers:
        _put(canvas, pointer.angle_deg, pointer.letter, LETTER_RADIUS[pointer.kind])
    _put(canvas, 0, "+", 0.0)
    return "\n".join("".join(row).rstrip() for row in canvas)


def _put(canvas: list[list[str]], angle: float, text: str, radius: float) -> None:
    x = (SEAT_WIDTH - 1) / 2 * (1 + 0.9 * radius * cos(radians(angle)))
    y = (SEAT_HEIGHT - 1) / 2 * (1 - 0.95 * radius * sin(radians(angle)))
    start = max(0, min(SEAT_WIDTH - len(text), round(x) - (len(text) - 1) // 2))
    canvas[round(y)][start : start + len(text)] = list(text)
