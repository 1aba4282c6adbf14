"""The seat of the fixed wheel drawn in characters."""

from math import ceil, cos, radians, sin

from hdassist.report import Seat

SEAT_WIDTH, SEAT_HEIGHT = 41, 15  # of the drawing, in characters
NUMBERED_IN_TEXT = 24  # holes that have room for their number
LETTER_RADIUS = {"now": 0.5, "after": 0.5, "cam": 0.28}  # how far out the letters of directions stand


def seat_in_characters(seat: Seat) -> str:
    """The seat seen from the cam side, without its legend."""
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
