"""The seat of the fixed wheel as a drawing, in black and white: the geometry behind templates/seat.svg."""

from __future__ import annotations

from itertools import groupby
from math import ceil, cos, pi, radians, sin
from typing import Any

from hdassist.report.blocks import Seat

CENTRE = (210.0, 146.0)
HOLE_CIRCLE = 112.0  # radius of the circle of holes
TURN = 88.0  # of the arrow that shows the turn
NUMBERED_HOLES = 36  # holes that have room for their number
ARROW_HEAD = 8.0  # length of an arrow's head
LINE_HEIGHT = 14.0  # between the words of places that coincide
ASIDE = 0.3  # words stand beside a place that lies further to a side, else above or below it


def seat_geometry(seat: Seat) -> dict[str, Any]:
    """What the template draws a seat with: sizes, places that coincide together, and where things lie."""
    count = len(seat.holes)
    radius = min(13.0, 0.8 * pi * HOLE_CIRCLE / count) if count else 5.0
    words_out = HOLE_CIRCLE + radius + (5 if count else 22)

    def is_goal(angle_deg: float) -> bool:
        """Whether the wheel is to stand there."""
        return abs((angle_deg - seat.first_deg - seat.turn_deg + 180) % 360 - 180) < 1e-3

    def words_at(angle_deg: float, lines: int) -> tuple[float, float, str]:
        """Where so many lines of words beside a place begin, and their anchor."""
        x, y = at(angle_deg, words_out)
        side, up = cos(radians(angle_deg)), sin(radians(angle_deg))
        upwards = LINE_HEIGHT * (lines - 1)
        if abs(side) > ASIDE:
            return x, y + 4 - 5 * up - upwards / 2, "start" if side > 0 else "end"
        return x, y + (10 if up < 0 else -upwards), "middle"

    order = ("now", "best", "worst")
    places = sorted(seat.places, key=lambda p: (p.angle_deg % 360, order.index(p.kind)))
    together = [list(group) for _, group in groupby(places, key=lambda p: round(p.angle_deg % 360, 3))]
    return {
        "ring": HOLE_CIRCLE,
        "turn": TURN,
        "line": LINE_HEIGHT,
        "radius": radius,
        "numbered_each": ceil(count / NUMBERED_HOLES),
        "together": together,
        "at": at,
        "arrow_head": arrow_head,
        "is_goal": is_goal,
        "words_at": words_at,
    }


def at(angle_deg: float, distance: float) -> tuple[float, float]:
    """Where a direction lies on the drawing: counter-clockwise from the right, y downwards."""
    return CENTRE[0] + distance * cos(radians(angle_deg)), CENTRE[1] - distance * sin(radians(angle_deg))


def arrow_head(angle_deg: float, distance: float, direction_deg: float) -> str:
    """Corners of an arrow's head: its tip lies at an angle and a distance, and it points in a direction."""
    (x, y), a = at(angle_deg, distance), radians(direction_deg)
    back = [
        (
            -ARROW_HEAD * cos(a) - side * ARROW_HEAD / 2.6 * sin(a),
            ARROW_HEAD * sin(a) - side * ARROW_HEAD / 2.6 * cos(a),
        )
        for side in (1, -1)
    ]
    return " ".join(f"{x + dx:.2f},{y + dy:.2f}" for dx, dy in ((0.0, 0.0), *back))
