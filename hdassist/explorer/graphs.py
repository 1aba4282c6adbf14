"""Graphs of the explorer's other views: curves over an angle, and the forces on the teeth of both mesh zones."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor

from rich.text import Text

from hdassist.explorer.answers import Turned
from hdassist.explorer.canvas import TALL, WIDE, Canvas
from hdassist.explorer.pictures import Inks, round_step

MARGIN = 6  # columns of the numbers at the left
EIGHTHS = " ▁▂▃▄▅▆▇█"


def graph(
    x: Sequence[float],
    series: Sequence[tuple[Sequence[float], str]],
    columns: int,
    rows: int,
    inks: Inks,
    *,
    words: str,
    cursor: float | None = None,
) -> Text:
    """Curves over x, each with its style, between numbered axes.

    Arguments: words, what x is, with its unit; cursor, an x that is marked.
    """
    canvas, high = Canvas(columns, rows), rows - 2
    wide = columns - MARGIN
    values = [value for y, _ in series for value in y]
    if not values or high < 3 or wide < 10:
        return canvas.drawn()
    step = round_step(max(max(values) - min(values), 1e-6), max(2, high // 3))
    bottom, top = floor(min(values) / step) * step, ceil(max(values) / step) * step
    steps = max(1, round((top - bottom) / step))
    high = min(high, max(1, (high - 1) // steps) * steps + 1)  # so that ticks lie as far apart as their numbers
    span = max(x[-1] - x[0], 1e-12)

    def across(value: float) -> float:
        return MARGIN * WIDE + (wide * WIDE - 1) * (value - x[0]) / span

    def down(value: float) -> float:
        return TALL / 2 + (high - 1) * TALL * (1 - (value - bottom) / (top - bottom or 1))

    for row in range(high):
        canvas.text(MARGIN - 1, row, "│", inks.muted)
    for k in range(round((top - bottom) / step) + 1):
        value = bottom + k * step
        canvas.text(0, int(down(value)) // TALL, f"{value:>{MARGIN - 2}g} ┤", inks.muted)
    canvas.text(MARGIN - 1, high, "└" + "─" * wide, inks.muted)
    across_step = round_step(span, max(2, wide // 12))
    for k in range(ceil(x[0] / across_step), floor(x[-1] / across_step + 1e-9) + 1):
        label = f"{k * across_step:g}"
        canvas.text(round(across(k * across_step)) // WIDE - len(label) // 2, high + 1, label, inks.muted)
    canvas.text(columns - len(words), high + 1, words, inks.muted)
    if cursor is not None:
        for row in range(high):
            canvas.shade(round(across(cursor)) // WIDE, row, inks.cursor)
    for y, ink in series:
        canvas.path([(across(a), down(b)) for a, b in zip(x, y, strict=True)], ink)
    return canvas.drawn()


def zone_picture(turned: Turned, state: int, zone: int, columns: int, rows: int, inks: Inks) -> Text:
    """The forces on the teeth of a mesh zone in a state, as bars over the angle from its middle.

    Up: flanks that carry the torque; the others down. All states have one scale.
    """
    canvas, high = Canvas(columns, rows), rows - 1
    if not turned.force_N or high < 3:
        canvas.text(1, rows // 2, "no forces: the balls roll", inks.muted)
        return canvas.drawn()
    greatest = max(abs(force) for each in turned.force_N for row in each for force in row) or 1.0
    least = min(force for each in turned.force_N for row in each for force in row)
    floor_rows = 1 if least < -0.02 * greatest else 0  # room for flanks that work against it
    forces, angles = turned.force_N[state][zone], turned.theta_deg[zone]
    reach = max(map(abs, angles)) or 1.0
    up = high - floor_rows
    pitch = max(1, columns // len(angles))
    first = (columns - pitch * len(angles)) // 2
    for k, force in enumerate(forces):
        for column in range(first + k * pitch, first + k * pitch + max(1, pitch - 1)):
            if force > 0:
                _bar(canvas, column, up, force / greatest * (up - 1), inks.torque(0))
            elif force < 0:
                canvas.text(column, up, "▀", inks.torque(1))
    canvas.text(0, high, f"{-reach:.0f}°", inks.muted)
    canvas.text(columns // 2, high, "0", inks.muted)
    canvas.text(columns - 4, high, f"{reach:.0f}°", inks.muted)
    share = turned.shares[state][zone]
    told = f"{max(forces):.0f} N at most, {share:.0%} of the torque"
    canvas.text(columns - len(told), 0, told, inks.muted)
    return canvas.drawn()


def _bar(canvas: Canvas, column: int, floor_row: int, height: float, ink: str) -> None:
    """A bar of so many rows above a row."""
    whole = int(height)
    for k in range(whole):
        canvas.text(column, floor_row - 1 - k, "█", ink)
    part = EIGHTHS[round((height - whole) * 8)]
    if part != " ":
        canvas.text(column, floor_row - 1 - whole, part, ink)
