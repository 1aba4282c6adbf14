"""The pictures of the explorer: F'_ior over the holes, and the seat from the cam side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import ceil, cos, floor, log10, pi, radians, sin
from textwrap import wrap

from rich.text import Text

from hdassist.explorer.answers import Curve, Place, Sure
from hdassist.explorer.canvas import TALL, WIDE, Canvas

MARKS = {Sure.COARSE: "·", Sure.REFINED: "○", Sure.AT_ZERO: "◎", Sure.PROVEN: "●", Sure.FITTED: "◌"}
LABELS = 5  # columns of the numbers at the left
ROOM = 24  # holes that have room for their number


@dataclass(frozen=True)
class Inks:
    """Styles of what is drawn, by what it is: torques one after the other; band and cursor are backgrounds."""

    torques: tuple[str, ...]
    text: str
    muted: str
    ghost: str
    band: str
    cursor: str
    limit: str
    trial: str
    now: str
    best: str
    worst: str

    def torque(self, place: int) -> str:
        """That of a torque by its place."""
        return self.torques[place % len(self.torques)]


@dataclass(frozen=True)
class Plotted:
    """What a curve is drawn with: rotation looked at, a curve behind it, limits by torque, trials at one torque.

    empty: lines where there is no curve.
    """

    curve: Curve | None
    turn_deg: float = 0.0
    ghost: Curve | None = None
    limits: Mapping[float, float] = field(default_factory=dict)
    trials: tuple[tuple[float, float], ...] = ()
    trial_torque: float | None = None
    best_deg: float | None = None
    next_deg: float | None = None
    empty: str = "computing …"


def curve_picture(plot: Plotted, columns: int, rows: int, inks: Inks) -> Text:
    """F'_ior against the position, a curve a torque, from nothing up, over the whole turn."""
    canvas = Canvas(columns, rows)
    if plot.curve is None or not plot.curve.places or rows < 5 or columns < 20:
        lines = [line for text in plot.empty.split("\n") for line in wrap(text, max(columns - 2, 1)) or [""]]
        for k, line in enumerate(lines):
            canvas.text((columns - len(line)) // 2, (rows - len(lines)) // 2 + k, line, inks.muted)
        return canvas.drawn()
    top = _top(plot)
    step = round_step(top, max(2, (rows - 2) // 3))
    top = ceil(top / step - 1e-9) * step
    steps = round(top / step)
    high = max(1, (rows - 3) // steps) * steps + 1  # so that ticks lie as far apart as their numbers
    frame = _Frame(canvas, min(high, rows - 2), top, step, rows - 2 - min(high, rows - 2))
    frame.axes(inks)
    _cursor(frame, plot, inks)
    if plot.ghost:
        for t in range(len(plot.ghost.torques)):
            canvas.path(frame.points(plot.ghost, t), inks.ghost, 3)
    for t in range(len(plot.curve.torques)):
        _band(frame, plot.curve, t, inks)
    for M_g, limit in plot.limits.items():
        _limit(frame, plot, M_g, limit, inks)
    for t in range(len(plot.curve.torques)):
        canvas.path(frame.points(plot.curve, t), inks.torque(t))
    for t in range(len(plot.curve.torques)):
        for place in plot.curve.places:
            value = place.values[t]
            canvas.text(*frame.cell(place.rotation_deg, value.F_ior_arcsec), MARKS[value.sure], inks.torque(t))
    for rotation, F_ior in plot.trials:
        canvas.text(*frame.cell(rotation, F_ior), "◆", inks.trial)
    _holes(frame, plot, inks)
    return canvas.drawn()


@dataclass(frozen=True)
class _Frame:
    """Where rotations [deg] and values [arcsec] lie on a canvas.

    rows above the axis, the value at their top, the step of the numbers, and rows above all of them.
    """

    canvas: Canvas
    rows: int
    top: float
    step: float
    above: int = 0

    @property
    def columns(self) -> int:
        return self.canvas.columns - LABELS - 1

    def x(self, rotation: float) -> float:
        return LABELS * WIDE + WIDE * self.columns * rotation / 360

    def y(self, value: float) -> float:
        return self.above * TALL + TALL / 2 + (self.rows - 1) * TALL * (1 - value / self.top)

    def cell(self, rotation: float, value: float) -> tuple[int, int]:
        return round(self.x(rotation)) // WIDE, int(max(0, self.y(value))) // TALL

    def points(self, curve: Curve, torque: int) -> list[tuple[float, float]]:
        found = [(self.x(p.rotation_deg), self.y(p.values[torque].F_ior_arcsec)) for p in curve.places]
        whole = curve.places[0].rotation_deg == 0 and len(curve.places) > 2
        return [*found, (self.x(360), found[0][1])] if whole else found

    def axes(self, inks: Inks) -> None:
        for row in range(self.above, self.above + self.rows):
            self.canvas.text(LABELS - 1, row, "│", inks.muted)
        for k in range(round(self.top / self.step) + 1):
            row = self.cell(0, k * self.step)[1]
            self.canvas.text(0, row, f"{k * self.step:>{LABELS - 2}g} ┤", inks.muted)
        self.canvas.text(LABELS - 1, self.above + self.rows, "└" + "─" * (self.columns + 1), inks.muted)


def _top(plot: Plotted) -> float:
    """A round number [arcsec] that nothing drawn is above."""
    curves = [c for c in (plot.curve, plot.ghost) if c]
    values = [v.F_ior_arcsec for c in curves for p in c.places for v in p.values]
    values += [v.band[1] for c in curves[:1] for p in c.places for v in p.values if v.band]
    highest = max([*values, *(value for _, value in plot.trials), 0.1])
    nearby = [limit for limit in plot.limits.values() if limit < 1.5 * highest]
    highest = max([highest, *nearby])
    step = round_step(highest, 6)
    return ceil(highest / step * 1.001) * step


def round_step(reach: float, most: int) -> float:
    """A round step of which at most so many reach so far."""
    power = 10.0 ** floor(log10(reach / most))
    return next(s * power for s in (1, 2, 5, 10, 20) if reach / (s * power) <= most)


def _cursor(frame: _Frame, plot: Plotted, inks: Inks) -> None:
    column = frame.cell(plot.turn_deg, 0)[0]
    for row in range(frame.above + frame.rows):
        frame.canvas.shade(column, row, inks.cursor)


def _band(frame: _Frame, curve: Curve, torque: int, inks: Inks) -> None:
    """Shade between what is likely, straight from one position to the next."""
    bands = [(p.rotation_deg, p.values[torque].band) for p in curve.places]
    known = [(rotation, band) for rotation, band in bands if band]
    if len(known) < 2:
        return
    if known[0][0] == 0:
        known.append((360.0, known[0][1]))
    for (left, (low, high)), (right, (to_low, to_high)) in pairwise(known):
        first, last = frame.cell(left, 0)[0], frame.cell(right, 0)[0]
        for column in range(first, last + 1):
            share = (column - first) / max(last - first, 1)
            top = frame.cell(0, high + share * (to_high - high))[1]
            bottom = frame.cell(0, low + share * (to_low - low))[1]
            for row in range(top, bottom + 1):
                frame.canvas.shade(column, row, inks.band)


def _limit(frame: _Frame, plot: Plotted, M_g: float, limit: float, inks: Inks) -> None:
    if limit > frame.top or plot.curve is None:
        return
    row = frame.cell(0, limit)[1]
    frame.canvas.text(LABELS, row, "╌" * (frame.columns + 1), inks.limit)
    frame.canvas.text(frame.canvas.columns, row, f" limit {limit:g} at {M_g:g} N·m", inks.limit)


def _holes(frame: _Frame, plot: Plotted, inks: Inks) -> None:
    """The numbers of the holes below the axis, those that have a name in its colour."""
    curve, row = plot.curve, frame.above + frame.rows + 1
    if curve is None:
        return
    holes = curve.holes
    ticks = [(360 * k / holes, f"{k}") for k in range(holes)] if holes else [(45.0 * k, f"{45 * k}") for k in range(8)]
    each = ceil(len(ticks) / max(1, frame.columns // 4))
    letters = frame.columns >= 3.5 * len(ticks)  # room for them beside the numbers
    named = {}
    for letter, rotation, ink in _named(plot, inks):
        number = f"{round(rotation * holes / 360)}" if holes else f"{rotation:g}"
        named[rotation] = (f"{letter}{number}" if letters else number, ink)
    taken: set[int] = set()
    others = {rotation: (label, inks.muted) for rotation, label in ticks[::each] if rotation not in named}
    for rotation, (label, ink) in (named | others).items():
        first = frame.cell(rotation, 0)[0] - (len(label) - 1) // 2
        columns = set(range(first - 1, first + len(label) + 1))
        if rotation in named or not columns & taken:
            frame.canvas.text(first, row, label, ink)
            taken |= columns
    frame.canvas.text(0, row, "hole" if holes else "deg", inks.muted)


def _named(plot: Plotted, inks: Inks) -> Iterable[tuple[str, float, str]]:
    """Rotations that have a name, the most important last."""
    curve = plot.curve
    if curve is None or len(curve.places) < 2:
        return
    yield "N", 0.0, inks.now
    yield "W", curve.worst.rotation_deg, inks.worst
    yield "B", curve.best.rotation_deg if plot.best_deg is None else plot.best_deg, inks.best
    if plot.next_deg is not None:
        yield "?", plot.next_deg, inks.trial


def seat_picture(
    plot: Plotted, holes: int, first_deg: float, barred: Sequence[int], columns: int, rows: int, inks: Inks
) -> Text:
    """The seat from the cam side: holes by number, counter-clockwise from the right, and the one looked at.

    Arguments: holes of the seat, 0 for a free angle; first_deg, direction of hole 0; barred holes.
    """
    canvas = Canvas(columns, rows)
    high = max(1.0, min((rows - 1) / 2, (columns - 3) / 4))
    ring = _Ring(canvas, high)
    for k in range(240):
        ring.dot(2 * pi * k / 240, 0.78, inks.muted)
    ring.line(radians(first_deg + plot.turn_deg), 0.7, inks.text)
    canvas.text(*ring.cell(0, 0), "+", inks.text)
    measured = {round(rotation, 6) for rotation, _ in plot.trials}
    each = ceil(holes / ROOM) or 1
    for k in range(holes):
        turned = 360 * k / holes
        label = f"{k}" if k % each == 0 else "."
        ink = inks.trial + " reverse" if round(turned, 6) in measured else inks.muted if k in barred else inks.text
        ring.text(radians(first_deg + turned), 1.0, "x" if k in barred else label, ink)
    if not holes:
        for rotation in measured:
            ring.text(radians(first_deg + rotation), 1.0, "◆", inks.trial)
    for words, rotation, ink in _named(plot, inks):
        ring.text(radians(first_deg + rotation), 0.56, words, f"{ink} bold")
    return canvas.drawn()


@dataclass(frozen=True)
class _Ring:
    """A circle about the middle of a canvas, so many rows high to either side."""

    canvas: Canvas
    high: float

    def cell(self, angle: float, radius: float) -> tuple[int, int]:
        x = (self.canvas.columns - 1) / 2 + 2 * self.high * radius * cos(angle)
        y = (self.canvas.rows - 1) / 2 - self.high * radius * sin(angle)
        return round(x), round(y)

    def dot(self, angle: float, radius: float, ink: str) -> None:
        x = self.canvas.columns * WIDE / 2 + 2 * WIDE * self.high * radius * cos(angle)
        y = self.canvas.rows * TALL / 2 - TALL * self.high * radius * sin(angle)
        self.canvas.dot(x, y, ink)

    def line(self, angle: float, radius: float, ink: str) -> None:
        for k in range(10, 60):
            self.dot(angle, radius * k / 60, ink)

    def text(self, angle: float, radius: float, text: str, ink: str) -> None:
        column, row = self.cell(angle, radius)
        self.canvas.text(column - (len(text) - 1) // 2, row, text, ink)


def value_words(place: Place, now: Place | None, torques: Sequence[float]) -> list[str]:
    """A line a torque: F'_ior, how it stands against where the wheel is, and how sure it is."""
    lines = []
    for t, (M_g, value) in enumerate(zip(torques, place.values, strict=False)):
        told = f"{value.F_ior_arcsec:.1f}" if value.sure is not Sure.COARSE else f"~{value.F_ior_arcsec:.0f}"
        change = ""
        if now and now is not place and t < len(now.values):
            change = f" {value.F_ior_arcsec / max(now.values[t].F_ior_arcsec, 1e-9) - 1:+.0%}"
        if value.band and value.sure is Sure.AT_ZERO:
            lines.append(f"{M_g:g} N·m {value.band[0]:.1f}…{value.band[1]:.1f}″ (90 %)")
            continue
        if value.band:
            change = f" {value.band[0]:.0f}…{value.band[1]:.0f}"
        lines.append(f"{M_g:g} N·m {told}″{change} {value.sure}")
    return lines
