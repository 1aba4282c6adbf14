"""The instruction to the person at the bench, and the seat drawn with its holes."""

from __future__ import annotations

from math import ceil, cos, inf, radians, sin

from hdassist.mounting.advice import Advice
from hdassist.mounting.positions import Position
from hdassist.mounting.seat_facts import Seat, seat_of
from hdassist.preset.fields import Drive
from hdassist.terminal.console import Style
from hdassist.terminal.texts import Texts, texts

WIDE, HIGH = 41, 15  # of the drawing, in characters
NUMBERED = 24  # holes that have room for their number
REACH = {"now": 0.5, "after": 0.5, "cam": 0.28}  # how far out the letters of directions stand


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


def instruction(advice: Advice, say: Texts | None = None, *, room: float = inf) -> str:
    """One sentence: what to do with the wheel; and what it brings, where there is room for that at each torque."""
    say = say or texts()
    if not advice.worth_turning:
        return say("instruction.leave", wheel=wheel(advice.drive, say))
    if len(advice.curve.torques) > room:
        return say("instruction.turn_alone", wheel=wheel(advice.drive, say), turn=turn(advice.chosen, say))
    gains = say("instruction.and").join(
        say("instruction.gain", now=say.number(now, ".2f"), new=say.number(new, ".2f"), torque=say.torque(M_g))
        for M_g, now, new in zip(
            advice.curve.torques, advice.curve.current.F_ior_arcsec, advice.chosen.F_ior_arcsec, strict=True
        )
    )
    return say("instruction.turn", wheel=wheel(advice.drive, say), turn=turn(advice.chosen, say), gains=gains)


def circle(advice: Advice, style: Style) -> str:
    """The seat seen from the cam side: its holes by number, the present (N), chosen (B) and worst (W) one marked.

    Hole 0 is where the wheel stands; it lies at mounting.first_hole, counted counter-clockwise from the right.
    """
    seat = seat_of(advice, texts(), advice.chosen)
    return style.text(f"{drawing(seat)}\n\n{seat.legend}")


def drawing(seat: Seat, *, pointers: bool = False) -> str:
    """The seat in characters; pointers: with the directions of mark and cam."""
    canvas = [[" "] * WIDE for _ in range(HIGH)]
    each = ceil(len(seat.holes) / NUMBERED)
    for hole in seat.holes:
        label = "." if hole.number % each else str(hole.number)
        _put(canvas, hole.angle_deg, label if hole.usable else seat.barred, 1.0)
    for k in range(0 if seat.holes else NUMBERED):
        _put(canvas, seat.first_deg + 360 * k / NUMBERED, ".", 1.0)
    for place in seat.places:
        _put(canvas, place.angle_deg, place.letter, 0.72)
    for pointer in seat.pointers if pointers else ():
        _put(canvas, pointer.angle_deg, pointer.letter, REACH[pointer.kind])
    _put(canvas, 0, "+", 0.0)
    return "\n".join("".join(row).rstrip() for row in canvas)


def _put(canvas: list[list[str]], angle: float, text: str, radius: float) -> None:
    x = (WIDE - 1) / 2 * (1 + 0.9 * radius * cos(radians(angle)))
    y = (HIGH - 1) / 2 * (1 - 0.95 * radius * sin(radians(angle)))
    start = max(0, min(WIDE - len(text), round(x) - (len(text) - 1) // 2))
    canvas[round(y)][start : start + len(text)] = list(text)
