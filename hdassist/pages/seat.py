"""The seat of the fixed wheel: what to do there in words, and its places as a figure."""

from collections.abc import Sequence

from hdassist.mounting.positions import Choice, Position
from hdassist.preset.fields import Drive
from hdassist.report import Hole, Seat, SeatMark
from hdassist.terminal.texts import Texts, texts

ENGLISH = texts()
TRADE = {"rigid": "rigid wheel (circular spline)", "flexspline": "flexspline"}  # the fixed wheel, in the trade's words


def wheel(drive: Drive, say: Texts = ENGLISH) -> str:
    """The wheel that is fixed, in words."""
    return say(f"wheel.{drive.mounting.fixed}")


def turn(position: Position, say: Texts = ENGLISH) -> str:
    """The turn to a position by the shorter way: holes, degrees and direction."""
    way = position.short_way_deg
    direction = say("turn.counter_clockwise" if way > 0 else "turn.clockwise")
    angle = say.angle(abs(way))
    if position.hole is None:
        return say("turn.angle", angle=angle, direction=direction)
    per_hole = position.rotation_deg / position.hole if position.hole else 360.0
    return say("turn.holes", holes=say.holes(round(abs(way) / per_hole)), angle=angle, direction=direction)


def hole_place(position: Position, say: Texts = ENGLISH) -> str:
    """A position in words: its hole, or the angle of the turn where the seat has none."""
    return place_at(position.rotation_deg, position.hole, say)


def place_at(rotation_deg: float, hole: int | None, say: Texts = ENGLISH) -> str:
    """The same of a turn [deg] and its hole."""
    return say.angle(rotation_deg) if hole is None else say("place.hole", hole=hole)


def instruction(choice: Choice, say: Texts = ENGLISH, *, gains: bool = True) -> str:
    """One sentence: what to do with the wheel; gains: and what it brings at each torque."""
    fixed = wheel(choice.drive, say)
    if not choice.turn:
        return say("instruction.leave", wheel=fixed)
    values = zip(choice.torques, choice.current.F_ior_arcsec, choice.chosen.F_ior_arcsec, strict=True)
    gain = ", ".join(f"F'_ior {now:.2f} -> {new:.2f}″ at {M_g:g} N·m" for M_g, now, new in values)
    order = say("instruction.turn", wheel=fixed, turn=turn(choice.chosen, say))
    return f"{order}: {gain}." if gains else f"{order}."


def after_trials(choice: Choice, say: Texts = ENGLISH, *, gains: bool = True) -> str:
    """The order after trials: the wheel lies in the last of them, and the first position is one to go to."""
    if not choice.turn:
        return say("instruction.first", wheel=wheel(choice.drive, say))
    return f"{instruction(choice, say, gains=gains)} {say('instruction.from_first')}"


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
