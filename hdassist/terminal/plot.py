"""Curves drawn with characters: braille dots, or plain ASCII where the stream has none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import ParamSpec

import numpy as np
from numpy.typing import NDArray

from hdassist.report.blocks import Curve, TwoCurves
from hdassist.terminal.console import Style, made_or

FLAT = 1e-9  # a curve that moves less than this share of its values is a flat one

Drawn = ParamSpec("Drawn")
PlotValues = NDArray[np.float64]
Dots = NDArray[np.bool_]

DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])  # braille: 4 rows, 2 columns
WIDEST_PLOT = 80  # columns: wider says no more


def figure(draw: Callable[Drawn, str]) -> Callable[Drawn, str]:
    """A figure that takes no answer with it: empty, with a remark on stderr, where it cannot be drawn."""

    @wraps(draw)
    def drawn(*args: Drawn.args, **kwargs: Drawn.kwargs) -> str:
        return made_or("plot", lambda: draw(*args, **kwargs), lambda: "")

    return drawn


@figure
def curve(style: Style, drawn: Curve) -> str:
    """A curve with numbered axes; where points crowd, from least to greatest; marks by the first letter of their words.

    Returns lines without a final newline.
    """
    x, y, wide, tall = drawn.x, drawn.y, *((1, 1) if style.ascii else (2, 4))
    ends = [end for _, *both in drawn.whiskers for end in both] + [0.0] * drawn.from_zero
    frame = _Frame.around(style, [y, np.array([*ends, *y[:1]])], drawn)
    columns, rows = frame.columns * wide, frame.rows * tall
    bottom, top = frame.ticks[0], frame.ticks[-1]
    lines = least_and_greatest(x, y, columns, drawn.over) if drawn.over else [(x, y)]
    dots = np.logical_or.reduce([_fill(*line, columns, rows, bottom, top) for line in lines])

    def place(at_x: float, at_y: float, across: int, down: int) -> tuple[int, int]:
        share = (at_x - x[0]) / max(float(x[-1] - x[0]), np.finfo(float).tiny)
        return min(int(share * across), across - 1), round((top - at_y) / (top - bottom) * (down - 1))

    for at_x, low, high in drawn.whiskers:
        (column, first), (_, last) = place(at_x, high, columns, rows), place(at_x, low, columns, rows)
        dots[first : last + 1, column] = True
    cells = dots_to_ascii(dots) if style.ascii else dots_to_braille(dots)
    for mark in drawn.marks:
        column, row = place(mark.x, mark.y, frame.columns, frame.rows)
        cells[row][column] = mark.words[0].upper()
    return frame.drawn(style, ["".join(row) for row in cells], drawn, drawn.y_label)


@figure
def two_curves(style: Style, drawn: TwoCurves) -> str:
    """Two curves with a glyph each, a third where they meet, and a legend in words."""
    both = (drawn.first, drawn.second)
    frame = _Frame.around(style, both, drawn)
    first, second = (_fill(drawn.x, y, frame.columns, frame.rows, frame.ticks[0], frame.ticks[-1]) for y in both)
    glyphs = " .o#" if style.ascii else " ·o●"
    rows = ["".join(glyphs[k] for k in row) for row in (first + 2 * second.astype(int)).tolist()]
    words = (*drawn.names, "both")
    legend = ", ".join(f"{glyph} {name}" for glyph, name in zip(glyphs[1:], words, strict=True))
    return frame.drawn(style, rows, drawn, f"{drawn.y_label}: {legend}")


@dataclass(frozen=True)
class _Frame:
    """Numbered axes around a picture of so many columns and rows; apart, rows from tick to tick; limit, a line."""

    ticks: list[float]
    apart: int
    columns: int
    margin: int
    limit: float | None

    @classmethod
    def around(cls, style: Style, series: Sequence[PlotValues], figure: Curve | TwoCurves) -> _Frame:
        limits, height = [] if figure.limit is None else [figure.limit], figure.rows
        low, high = (float(end([*(end(y) for y in series), *limits])) for end in (min, max))
        marks = ticks(low, high, max(2, height // 2))
        margin = max(7, *(len(f"{tick:g}") for tick in marks))
        apart = max(1, round((height - 1) / (len(marks) - 1)))
        return cls(marks, apart, min(style.width, WIDEST_PLOT) - margin - 2, margin, figure.limit)

    @property
    def rows(self) -> int:
        return self.apart * (len(self.ticks) - 1) + 1

    @property
    def limit_row(self) -> int | None:
        """The row of the limit, from the top; None without one."""
        top, bottom = self.ticks[-1], self.ticks[0]
        return None if self.limit is None else round((top - self.limit) / (top - bottom) * (self.rows - 1))

    def drawn(self, style: Style, rows: Sequence[str], figure: Curve | TwoCurves, y_label: str) -> str:
        numbers = {k * self.apart: f"{tick:g}" for k, tick in enumerate(reversed(self.ticks))}
        corner, side, floor, mark = ("+", "|", "-", "+") if style.ascii else ("└", "│", "─", "┤")
        lines = [style.text(y_label)]
        for k, row in enumerate(rows):
            if k == self.limit_row:
                row = row.replace(" ", floor)
            lines.append(f"{numbers.get(k, ''):>{self.margin}} {mark if k in numbers else side}{row}".rstrip())
        lines.append(" " * (self.margin + 1) + corner + floor * self.columns)
        lines.append(" " * (self.margin + 2) + _x_numbers(float(figure.x[0]), float(figure.x[-1]), self.columns))
        lines.append(" " * (self.margin + 2) + style.text(figure.x_label).center(self.columns).rstrip())
        return "\n".join(lines)


def dots_to_braille(dots: Dots) -> list[list[str]]:
    """Characters of a grid of dots, four rows and two columns to a character."""
    rows, columns = dots.shape[0] // 4, dots.shape[1] // 2
    cells = dots.reshape(rows, 4, columns, 2).transpose(0, 2, 1, 3)
    return [[chr(0x2800 + int((cell * DOTS).sum())) if cell.any() else " " for cell in row] for row in cells]


def dots_to_ascii(dots: Dots) -> list[list[str]]:
    """Characters of a grid of dots, one to a character."""
    return [["*" if dot else " " for dot in row] for row in dots]


def least_and_greatest(x: PlotValues, y: PlotValues, columns: int, over: float) -> list[tuple[PlotValues, PlotValues]]:
    """Two lines with a point a column: the least and the greatest of y within so much of x, a column at least.

    NaN where nothing lies: a gap.
    """
    reach = max(over, float(x[-1] - x[0]) / columns) / 2
    places = np.linspace(x[0], x[-1], columns)
    ends = zip(np.searchsorted(x, places - reach), np.searchsorted(x, places + reach, "right"), strict=True)
    parts = [y[first:last] for first, last in ends]
    return [(places, np.array([end(part) if len(part) else np.nan for part in parts])) for end in (np.min, np.max)]


def _fill(x: PlotValues, y: PlotValues, columns: int, rows: int, bottom: float, top: float) -> Dots:
    if len(x) < columns:
        # between points that lie apart the curve is drawn straight
        x, y = (fine := np.linspace(x[0], x[-1], 4 * columns)), np.interp(fine, x, y)
    span = max(float(x[-1] - x[0]), np.finfo(float).tiny)
    place = np.minimum(((x - x[0]) / span * columns).astype(int), columns - 1)
    place, y = place[np.isfinite(y)], y[np.isfinite(y)]
    row = np.rint((top - y) / (top - bottom) * (rows - 1)).astype(int)
    dots = np.zeros((rows, columns), dtype=bool)
    previous: int | None = None
    for column in range(columns):
        here = row[place == column]
        if not len(here):
            previous = None  # a gap
            continue
        first, last = int(here.min()), int(here.max())
        if previous is not None:
            # join to the curve's last point in the column before, so that a steep curve has no holes
            first, last = min(first, previous), max(last, previous)
        dots[first : last + 1, column] = True
        previous = int(here[-1])
    return dots


def ticks(low: float, high: float, count: int) -> list[float]:
    """Round numbers that enclose low and high, at most count steps apart."""
    if high - low <= FLAT * max(1.0, abs(low), abs(high)):
        low, high = low - 1, high + 1
    span = high - low
    power = 10.0 ** np.floor(np.log10(span / count))
    step = next(s * power for s in (1, 2, 5, 10, 20) if span / (s * power) <= count)
    first, last = int(np.floor(low / step + 1e-9)), int(np.ceil(high / step - 1e-9))
    return [round(k * step, 12) for k in range(first, max(last, first + 1) + 1)]


def _x_numbers(low: float, high: float, columns: int) -> str:
    line = [" "] * columns
    for tick in ticks(low, high, 6):
        number = f"{tick:g}"
        place = round((tick - low) / (high - low) * (columns - 1))
        if 0 <= place < columns:
            start = min(max(0, place - len(number) // 2), columns - len(number))
            line[start : start + len(number)] = number
    return "".join(line).rstrip()
