"""The seat of the fixed wheel: what to do there in words, and its places as a figure."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from hdassist.mounting.positions import Choice, Position, hole_of
from hdassist.preset.fields import Drive
from hdassist.report.blocks import Hole, Seat, SeatMark
from hdassist.terminal.texts import Texts, texts

TRADE = {"rigid": "rigid wheel (circular spline)", "flexspline": "flexspline"}  # the fixed wheel, in the trade's words


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


def seat_holes(drive: Drive) -> tuple[Hole, ...]:
    """The holes of a drive's seat, none where the angle is free."""
    at = drive.mounting
    turns = [360 * k / at.holes for k in range(at.holes)]
    return tuple(Hole(k, at.first_hole + t, at.allowed == "all" or k in at.allowed) for k, t in enumerate(turns))


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
    holes = seat_holes(choice.drive)
    words = ", ".join(f"{p.letter} {p.words}" for p in places)
    legend = say("seat.legend" if holes else "seat.legend_free", places=words)
    if not all(hole.usable for hole in holes):
        legend += "; " + say("seat.barred", letter=barred)
    drawn = sorted(places, key=lambda p: ("worst", "now", "best").index(p.kind))  # the best one on top
    turned = goal.short_way_deg if goal else 0.0
    return Seat(say("seat.title"), holes, first, turned, tuple(drawn), tuple(pointers), barred, legend)
