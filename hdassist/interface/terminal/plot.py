"""Curves and the seat of the wheel, drawn with characters: braille dots, or ASCII for streams without them."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import ceil, cos, floor, log10, radians, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hdassist.features.report import Curve, CurveMark, Seat
from hdassist.interface.terminal.streams import Style

_PlotValues = NDArray[np.float64]
_Dots = NDArray[np.bool_]

_FLAT = 1e-9  # largest relative variation of a curve that is drawn as flat
_FAR = 0.5  # largest distance from the curve, in heights of the curve, at which a limit or 0 is included in the plot
_TALL = 40  # smallest number of lines of a terminal on which plots are taller
_TALL_ROWS = 12  # number of rows that every plot may use on such a terminal
_FINEST_PARTS = 5  # largest number of rows from one number on the vertical axis to the next
_DASH = 8  # period, in dots, of the dashes of the second series; half of it is drawn
_DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])  # bits of a braille character
_UNBROKEN = "\xa0"  # no-break space between the sign of a mark and its text in the legend
MARK_SIGNS = {
    "now": "N",
    "best": "B",
    "worst": "W",
    "next": "?",
    "best and next": "B",
    "measured": "◆",
    "enough": "E",
}  # the same signs as on the seat
SEAT_WIDTH = 41  # width of the drawing in characters
_SEAT_HEIGHT = 15  # height of the drawing in characters
_NUMBERED_IN_TEXT = 24  # largest number of holes at which every hole is numbered
_LETTER_RADIUS = {"now": 0.5, "after": 0.5, "cam": 0.28}  # radius of the letters of directions


def curve(style: Style, drawn: Curve) -> str:
    """Return a plot of a curve with numbered axes as text, without a final newline.

    Where points are dense, the plot shows the range from minimum to maximum. The second of two series is dashed. The
    legend of the series is above the plot, and the legend of the marks is below the plot.
    """
    frame = _Frame.around(style, drawn)
    # a character contains 4 x 2 braille dots
    fine = frame if style.ascii else frame.finer(_DOTS.shape)
    # a column with several points shows a line from the smallest to the largest value
    dots, *further_series = (
        np.logical_or.reduce(
            [
                fine.dots(*line)
                for line in (least_and_greatest(drawn.x, y, fine.columns, drawn.over) if drawn.over else [(drawn.x, y)])
            ]
        )
        for y in drawn.series
    )
    title = drawn.y_label
    under = dict.fromkeys(f"{sign(mark, style)}: {mark.words}" for mark in drawn.marks)
    # the interval at a point is drawn as a vertical line
    for x, *ends in drawn.whiskers:
        column, (last, first) = fine.place(x, ends)
        dots[first : last + 1, column] = True
    cells = np.where(dots, "*", " ").tolist() if style.ascii else dots_to_braille(dots)
    for dots_of_series in further_series:
        # where both series overlap, only the first is visible
        second = dots_of_series & ~dots
        if style.ascii:
            cells = np.array([*" *o"])[dots + 2 * second].tolist()
        else:
            cells = dots_to_braille(dots | (second & (np.arange(fine.columns) % _DASH < _DASH // 2)))
        looks = ("* ", "o ") if style.ascii else (f"⠒⠒⠒{_UNBROKEN}", f"⠒⠒{_UNBROKEN}⠒⠒{_UNBROKEN}")
        title += ": " + ", ".join(look + name for look, name in zip(looks, drawn.names, strict=True))
    # marks are drawn last, because curves would cover them
    for mark in drawn.marks:
        column, row = frame.place(mark.x, mark.y)
        cells[row][column] = sign(mark, style)
    return frame.around_cells(style, cells, title, f"{drawn.x_label} ({', '.join(under)})" if under else drawn.x_label)


def sign(mark: CurveMark, style: Style) -> str:
    """Return the sign of a mark, the same on every page: from a table, or the first letter of its text."""
    letter = MARK_SIGNS.get(mark.words, mark.words[0].upper())
    return "o" if style.ascii and not letter.isascii() else letter


@dataclass(frozen=True)
class _Rows:
    """Rows of a vertical axis, with round numbers exactly in the middle of a row.

    height: difference between the values of adjacent rows.
    last: value of the lowest row divided by the height.
    count: number of rows.
    parts: number of rows from each numbered row to the next.
    """

    height: float
    last: int
    count: int
    parts: int

    @classmethod
    def within(
        cls,
        low: float,
        high: float,
        row_limit: int,
    ) -> _Rows:
        """Return the axis that shows the interval from low to high and has the most rows up to the limit.

        At least two rows are numbered. Of axes with equal numbers of rows, one with every second row numbered is
        preferred.

        low: smallest value to be shown.
        high: largest value to be shown, above low.
        row_limit: largest number of rows, at least 3.
        """
        power = floor(log10((high - low) / row_limit))
        candidates = []
        for exponent in range(power - 1, power + 4):
            for digit in (1, 2, 5):
                for parts in range(1, _FINEST_PARTS + 1):
                    height = digit * 10.0**exponent / parts
                    last = floor(low / height + 0.5)
                    count = floor(high / height + 0.5) - last + 1
                    candidates.append(
                        cls(
                            height=height,
                            last=last,
                            count=count,
                            parts=parts,
                        )
                    )
        usable = [rows for rows in candidates if rows.count <= row_limit and len(rows.numbered) >= 2]
        return min(usable, key=lambda rows: (row_limit - rows.count, abs(rows.parts - 2)))

    @property
    def numbered(self) -> dict[int, str]:
        """Numbers on the axis, by the index of the row from the top."""
        first = self.last + self.count - 1
        return {first - k: f"{k * self.height:.10g}" for k in range(self.last, first + 1) if k % self.parts == 0}


@dataclass(frozen=True)
class _Frame:
    """Numbered axes around a plot.

    figure: plotted curve.
    low, high: values at the lower and the upper edge.
    columns, rows: size of the plot.
    margin: width of the numbers beside the plot.
    numbers: numbers on the vertical axis, by row.
    """

    figure: Curve
    low: float
    high: float
    columns: int
    rows: int
    margin: int
    numbers: Mapping[int, str]

    @classmethod
    def around(cls, style: Style, figure: Curve) -> _Frame:
        """Return axes that show all values of a figure, and also its limit and 0 if these are near the values."""
        low, high = figure.extent
        if high - low <= _FLAT * max(1.0, abs(low), abs(high)):
            low = low - 1
            high = high + 1
        nearby = [] if figure.limit is None else [figure.limit]
        for value in [*nearby, 0.0] if figure.from_zero else nearby:
            if low - _FAR * (high - low) <= value <= high + _FAR * (high - low):
                low = min(low, value)
                high = max(high, value)
        row_limit = figure.rows + 1
        if style.height >= _TALL:
            row_limit = max(row_limit, _TALL_ROWS)
        rows = _Rows.within(low, high, row_limit)
        margin = max(7, *map(len, rows.numbered.values()))
        return cls(
            figure=figure,
            low=(rows.last - 0.5) * rows.height,
            high=(rows.last + rows.count - 0.5) * rows.height,
            columns=style.width - margin - 2,
            rows=rows.count,
            margin=margin,
            numbers=rows.numbered,
        )

    def finer(self, cell: tuple[int, ...]) -> _Frame:
        """Return the frame with its size in dots; cell: numbers of dot rows and dot columns per character."""
        return replace(
            self,
            columns=self.columns * cell[1],
            rows=self.rows * cell[0],
        )

    def place(self, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the columns and the rows in which points lie; points outside the plot lie at its edges."""
        first = self.figure.x[0]
        span = max(float(np.ptp(self.figure.x)), np.finfo(float).tiny)
        column = ((np.asarray(x) - first) / span * self.columns).astype(int)
        row = ((self.high - np.asarray(y)) / (self.high - self.low) * self.rows).astype(int)  # counted from the top
        return np.clip(column, 0, self.columns - 1), np.clip(row, 0, self.rows - 1)

    def dots(self, x: _PlotValues, y: _PlotValues) -> _Dots:
        """Return the dots of a line through points, shape (rows, columns), with a gap at NaN.

        Between distant points, the line is straight.
        """
        if len(x) < self.columns:
            finer_x = np.linspace(x[0], x[-1], 4 * self.columns)
            y = np.interp(finer_x, x, y)
            x = finer_x
        is_finite = np.isfinite(y)
        place, row = self.place(x[is_finite], y[is_finite])
        dots = np.zeros((self.rows, self.columns), dtype=bool)
        last: list[int] = []  # row in the previous column; dots from this row close the gaps of a steep curve
        for column in range(self.columns):
            inside = row[place == column].tolist()
            if inside:
                dots[min(inside + last) : max(inside + last) + 1, column] = True
            last = inside[-1:]
        return dots

    def around_cells(
        self,
        style: Style,
        cells: list[list[str]],
        title: str,
        x_label: str,
    ) -> str:
        """Return the plot as text: the cells with axes, numbers, labels and, if there is one, the limit."""
        corner, side, floor, mark = ("+", "|", "-", "+") if style.ascii else ("└", "│", "─", "┤")
        figure = self.figure
        numbers = {row: f"{number} {mark}" for row, number in self.numbers.items()}
        if figure.limit is not None:
            limit_text = f" {figure.limit:.4g} "
            if self.low <= figure.limit <= self.high:
                self._draw_limit(cells, floor, limit_text)
            else:
                title += f"; limit {limit_text.strip()} lies {'above' if figure.limit > self.high else 'below'}"
        lines = [line.replace(_UNBROKEN, " ") for line in textwrap.wrap(style.text(title), style.width)]
        for k, cell in enumerate(cells):
            number = numbers.get(k, f" {side}")
            lines.append(f"{number:>{self.margin + 2}}{''.join(cell)}".rstrip())
        indent = f"{'':{self.margin + 2}}"
        lines.append(indent[:-1] + corner + floor * self.columns)
        lines.append(indent + self._x_numbers())
        label_lines = textwrap.wrap(style.text(x_label), self.columns)
        lines += [indent + line.center(self.columns).rstrip() for line in label_lines]
        return "\n".join(lines)

    def _draw_limit(
        self,
        cells: list[list[str]],
        floor: str,
        words: str,
    ) -> None:
        """Draw the limit as a line across the plot; words: number of the limit, written at a free end of the line."""
        row = cells[int(self.place(self.figure.x[0], self.figure.limit or 0.0)[1])]
        places = [range(self.columns - len(words), self.columns), range(len(words))]
        free = next((place for place in places if all(row[k] == " " for k in place)), places[0])
        row[:] = [floor if cell == " " else cell for cell in row]
        row[free.start : free.stop] = words

    def _x_numbers(self) -> str:
        line = [" "] * self.columns
        low, high = self.figure.x[[0, -1]].tolist()
        for tick in ticks(low, high, max(2, self.columns // 12)):
            if low <= tick <= high:
                number = f"{tick:g}"
                place = int(self.place(tick, 0)[0])
                start = min(max(0, place - len(number) // 2), self.columns - len(number))
                line[start : start + len(number)] = number
        return "".join(line).rstrip()


def dots_to_braille(dots: _Dots) -> list[list[str]]:
    """Return a grid of dots as rows of braille characters, each with four rows and two columns of dots."""
    rows = dots.shape[0] // 4
    columns = dots.shape[1] // 2
    codes = (dots.reshape(rows, 4, columns, 2).transpose(0, 2, 1, 3) * _DOTS).sum(axis=(2, 3))
    return [[chr(0x2800 + code) if code else " " for code in row] for row in codes.tolist()]


def least_and_greatest(
    x: _PlotValues,
    y: _PlotValues,
    columns: int,
    over: float,
) -> list[tuple[_PlotValues, _PlotValues]]:
    """Return two lines with one point per column: minimum and maximum of y within a window of x.

    At the ends of x, the window is moved to lie within x. A window without points gives NaN.

    x: increasing values.
    y: values at x.
    columns: number of columns.
    over: width of the window, which is at least the width of a column.
    """
    reach = max(over, float(x[-1] - x[0]) / columns) / 2
    places = np.linspace(x[0], x[-1], columns)
    middles = np.clip(places, x[0] + reach, x[-1] - reach)
    ends = zip(
        np.searchsorted(x, middles - reach),
        np.searchsorted(x, middles + reach, "right"),
        strict=True,
    )
    parts = [y[first:last] for first, last in ends]
    return [(places, np.array([end(part) if len(part) else np.nan for part in parts])) for end in (np.min, np.max)]


def ticks(
    low: float,
    high: float,
    count: int,
) -> list[float]:
    """Return evenly spaced round numbers that enclose low and high; count: largest number of steps from low to high."""
    if high - low <= _FLAT * max(1.0, abs(low), abs(high)):
        low = low - 1
        high = high + 1
    span = high - low
    power = 10.0 ** np.floor(np.log10(span / count))
    step = next(s * power for s in (1, 2, 5, 10, 20) if span / (s * power) <= count)
    first = int(np.floor(low / step + 1e-9))
    last = int(np.ceil(high / step - 1e-9))
    return [round(k * step, 12) for k in range(first, max(last, first + 1) + 1)]


def seat_in_characters(seat: Seat) -> str:
    """Return a drawing of the seat in text characters, without legend; brackets enclose the best hole.

    The seat is seen from the wave generator side.
    """
    canvas = [[" "] * SEAT_WIDTH for _ in range(_SEAT_HEIGHT)]
    # if there are too many holes, only every second, third, ... hole has a number
    number_step = ceil(len(seat.holes) / _NUMBERED_IN_TEXT)
    goals = [place.angle_deg for place in seat.places if place.kind == "best"]
    for hole in seat.holes:
        label = "." if hole.number % number_step else str(hole.number)
        if any(abs(hole.angle_deg - goal) < 1e-6 for goal in goals):
            label = f"[{hole.number}]"
        _put(canvas, hole.angle_deg, label if hole.usable else seat.barred, 1.0)
    # a seat without holes has ticks instead
    for k in range(0 if seat.holes else _NUMBERED_IN_TEXT):
        _put(canvas, seat.first_deg + 360 * k / _NUMBERED_IN_TEXT, ".", 1.0)
    # letters at the same angle are written side by side
    for angle in dict.fromkeys(place.angle_deg for place in seat.places):
        letters = [place.letter for place in seat.places if place.angle_deg == angle]
        _put(canvas, angle, "".join(letters), 0.72)
    for pointer in seat.pointers:
        _put(canvas, pointer.angle_deg, pointer.letter, _LETTER_RADIUS[pointer.kind])
    _put(canvas, 0, "+", 0.0)
    return "\n".join("".join(row).rstrip() for row in canvas)


def _put(
    canvas: list[list[str]],
    angle: float,
    text: str,
    radius: float,
) -> None:
    x = (SEAT_WIDTH - 1) / 2 * (1 + 0.9 * radius * cos(radians(angle)))
    y = (_SEAT_HEIGHT - 1) / 2 * (1 - 0.95 * radius * sin(radians(angle)))
    start = max(0, min(SEAT_WIDTH - len(text), round(x) - (len(text) - 1) // 2))
    canvas[round(y)][start : start + len(text)] = list(text)
