"""The seat of the fixed wheel as a drawing (SVG), in black and white."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from itertools import groupby
from math import ceil, cos, pi, radians, sin

from hdassist.mounting.seat_page import Hole, Seat, SeatMark

WIDE, HIGH = 420, 292
CENTRE = (210.0, 146.0)
HOLES = 112.0  # radius of the circle of holes
TURN = 88.0  # of the arrow that shows the turn
LENGTH = {"now": 52.0, "after": 72.0, "cam": 36.0}  # of the directions from the centre
DASHES = {"now": "5 4", "after": "none", "cam": "1.5 3"}
NUMBERED = 36  # holes that have room for their number
HEAD = 8.0  # length of an arrow's head
LINE = 14.0  # between the words of places that coincide
ASIDE = 0.3  # words stand beside a place that lies further to a side, else above or below it


def seat_svg(seat: Seat) -> str:
    """The seat seen from the cam side: holes counter-clockwise, places in words, arrows for the directions."""
    x, y = CENTRE
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE} {HIGH}" role="img">',
        f"<title>{escape(seat.title)}</title>",
        '<g fill="none" stroke="#000" stroke-width="1.2" font-size="12" text-anchor="middle">',
        f'<circle class="seat" cx="{x:g}" cy="{y:g}" r="{HOLES:g}" stroke="#999"/>',
        f'<path class="centre" d="M{x - 5:g} {y:g}h10M{x:g} {y - 5:g}v10"/>',
        *(_scale(seat.first_deg) if not seat.holes else _holes(seat)),
        *_places(seat),
        *_turn(seat),
        *(_pointer(p) for p in seat.pointers),
        "</g></svg>",
    ]
    return "\n".join(parts)


def at(angle_deg: float, radius: float) -> tuple[float, float]:
    """Where a direction lies on the drawing: counter-clockwise from the right, y downwards."""
    return CENTRE[0] + radius * cos(radians(angle_deg)), CENTRE[1] - radius * sin(radians(angle_deg))


def _holes(seat: Seat) -> Iterator[str]:
    count = len(seat.holes)
    each, radius = ceil(count / NUMBERED), _radius(seat)
    for hole in seat.holes:
        chosen = _is_goal(seat, hole.angle_deg)
        yield _hole(hole, radius, chosen=chosen, numbered=each == 1, beside=each > 1 and hole.number % each == 0)


def _is_goal(seat: Seat, angle_deg: float) -> bool:
    """Whether the wheel is to stand there."""
    return abs((angle_deg - seat.first_deg - seat.turn_deg + 180) % 360 - 180) < 1e-3


def _radius(seat: Seat) -> float:
    """Radius of a hole."""
    return min(13.0, 0.8 * pi * HOLES / len(seat.holes)) if seat.holes else 5.0


def _hole(hole: Hole, radius: float, *, chosen: bool, numbered: bool, beside: bool) -> str:
    x, y = at(hole.angle_deg, HOLES)
    parts = [f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{radius:.2f}" fill="{"#000" if chosen else "#fff"}"/>']
    if not hole.usable:
        r = 1.1 * radius
        lines = f"M{x - r:.2f} {y - r:.2f}l{2 * r:.2f} {2 * r:.2f}m0 {-2 * r:.2f}l{-2 * r:.2f} {2 * r:.2f}"
        parts.append(f'<path class="barred" d="{lines}"/>')
    if numbered or beside:
        x, y = (x, y) if numbered else at(hole.angle_deg, HOLES - 12)
        size = min(12.0, 1.1 * radius) if numbered else 7
        ink = _ink("#fff" if chosen and numbered else "#000")
        if not hole.usable:  # the number on top of the cross
            ink = 'fill="#000" stroke="#fff" stroke-width="3.5" paint-order="stroke"'
        place = f'x="{x:.2f}" y="{y + 0.36 * size:.2f}" font-size="{size:.1f}"'
        parts.append(f"<text {place} {ink}>{hole.number}</text>")
    return f'<g class="hole" data-hole="{hole.number}">{"".join(parts)}</g>'


def _ink(colour: str) -> str:
    return f'fill="{colour}" stroke="none"'


def _scale(first_deg: float) -> Iterator[str]:
    """Angles from now, where the seat has no holes."""
    for angle in range(0, 360, 10):
        (x, y), (u, v) = at(first_deg + angle, HOLES), at(first_deg + angle, HOLES + (7 if angle % 30 == 0 else 4))
        yield f'<path class="tick" d="M{x:.2f} {y:.2f}L{u:.2f} {v:.2f}"/>'
        if angle % 30 == 0:
            x, y = at(first_deg + angle, HOLES + 16)
            yield f'<text x="{x:.2f}" y="{y + 3:.2f}" font-size="9" {_ink("#000")}>{angle}°</text>'


def _places(seat: Seat) -> Iterator[str]:
    """Words beside the positions; those that coincide share a line."""
    order = {"now": 0, "best": 1, "worst": 2}
    places = sorted(seat.places, key=lambda p: (p.angle_deg % 360, order[p.kind]))
    out = HOLES + _radius(seat) + (5 if seat.holes else 22)
    for _, group in groupby(places, key=lambda p: round(p.angle_deg % 360, 3)):
        found = list(group)
        if not seat.holes:
            x, y = at(found[0].angle_deg, HOLES)
            fill = "#000" if _is_goal(seat, found[0].angle_deg) else "#fff"
            yield f'<circle class="place" cx="{x:.2f}" cy="{y:.2f}" r="5" fill="{fill}"/>'
        yield from _words(found, out)


def _words(places: list[SeatMark], out: float) -> Iterator[str]:
    """A line for each word, outside the seat."""
    angle = places[0].angle_deg
    x, y = at(angle, out)
    side, up = cos(radians(angle)), sin(radians(angle))
    anchor = "start" if side > ASIDE else "end" if side < -ASIDE else "middle"
    upwards = LINE * (len(places) - 1)
    y += 4 - 5 * up - upwards / 2 if abs(side) > ASIDE else (10 if up < 0 else -upwards)
    for k, place in enumerate(places):
        yield (
            f'<text class="place {place.kind}" x="{x:.2f}" y="{y + LINE * k:.2f}" text-anchor="{anchor}" '
            f'font-size="13" font-weight="bold" {_ink("#000")}>{escape(place.words)}</text>'
        )


def _turn(seat: Seat) -> Iterator[str]:
    """An arrow along the way from now to where the wheel goes."""
    if not seat.turn_deg:
        return
    sweep = 0 if seat.turn_deg > 0 else 1  # SVG counts clockwise
    sense = 1 if seat.turn_deg > 0 else -1
    end = seat.first_deg + seat.turn_deg
    short = min(abs(seat.turn_deg) / 2, 4.0)  # deg that the arrow's head takes
    (x, y), (u, v) = at(seat.first_deg, TURN), at(end - sense * short, TURN)
    arc = f"M{x:.2f} {y:.2f}A{TURN:g} {TURN:g} 0 0 {sweep} {u:.2f} {v:.2f}"
    yield f'<path class="turn" stroke-width="2" d="{arc}"/>'
    yield _head(*at(end, TURN), end + sense * 90)


def _pointer(pointer: SeatMark) -> str:
    length = LENGTH[pointer.kind]
    x, y = CENTRE
    (u, v), (s, t) = at(pointer.angle_deg, length - HEAD / 2), at(pointer.angle_deg, length + 8)
    width = 3 if pointer.kind == "after" else 1.8
    return (
        f'<g class="pointer {pointer.kind}">'
        f'<line x1="{x:g}" y1="{y:g}" x2="{u:.2f}" y2="{v:.2f}" stroke-width="{width}" '
        f'stroke-dasharray="{DASHES[pointer.kind]}"/>'
        f"{_head(*at(pointer.angle_deg, length), pointer.angle_deg)}"
        f'<text x="{s:.2f}" y="{t + 4:.2f}" font-style="italic" {_ink("#000")}>{pointer.letter}</text></g>'
    )


def _head(x: float, y: float, direction_deg: float) -> str:
    """The head of an arrow whose tip lies at (x, y)."""
    a = radians(direction_deg)
    back = [
        (-HEAD * cos(a) - side * HEAD / 2.6 * sin(a), HEAD * sin(a) - side * HEAD / 2.6 * cos(a)) for side in (1, -1)
    ]
    points = " ".join(f"{x + dx:.2f},{y + dy:.2f}" for dx, dy in ((0.0, 0.0), *back))
    return f'<polygon points="{points}" fill="#000" stroke="none"/>'
