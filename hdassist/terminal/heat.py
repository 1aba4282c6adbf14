"""A quantity over two others, drawn with characters of different darkness."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hdassist.report.blocks import HeatMap
from hdassist.terminal.console import Style
from hdassist.terminal.plot import WIDEST_PLOT, figure

HEAT_ROWS = 20  # at most
NONE = "!"  # where there is no value

CellIndices = NDArray[np.int64]


@figure
def heat(style: Style, drawn: HeatMap) -> str:
    """A map with y upwards, numbered axes and a legend; of more values than there is room for some are left out.

    Returns lines without a final newline.
    """
    x, y, z = drawn.x, drawn.y, drawn.z
    shades = ".:-=+*#%@" if style.ascii else "·░▒▓█"
    up = _some(len(y), HEAT_ROWS)[::-1]
    margin = max(7, *(len(f"{y[k]:g}") for k in up))
    room = min(style.width, WIDEST_PLOT) - margin - 2
    across = _some(len(x), room)
    cell = room // len(across)
    low, high = float(np.nanmin(z)), float(np.nanmax(z))
    step = (high - low) / len(shades) or 1.0
    corner, side, floor = ("+", "|", "-") if style.ascii else ("└", "│", "─")
    lines = [style.text(drawn.y_label)]
    for k in up:
        row = (
            NONE if np.isnan(value) else shades[min(int((value - low) / step), len(shades) - 1)]
            for value in z[across, k]
        )
        lines.append(f"{y[k]:>{margin}g} {side}{''.join(glyph * cell for glyph in row)}")
    lines.append(" " * (margin + 1) + corner + floor * (cell * len(across)))
    lines.append(" " * (margin + 2) + _x_numbers([x[k] for k in across], cell))
    lines.append(" " * (margin + 2) + style.text(drawn.x_label).center(cell * len(across)).rstrip())
    lines.append(_legend(shades, low, high, step, bool(np.isnan(z).any())))
    return "\n".join(lines)


def _some(count: int, most: int) -> CellIndices:
    """At most so many of count places, the first and the last among them."""
    return np.unique(np.rint(np.linspace(0, count - 1, min(count, most))).astype(np.int64))


def _x_numbers(values: Sequence[float], cell: int) -> str:
    """As many of the numbers under the middle of their cells as do not touch."""
    line, free = "", 0
    for k, value in enumerate(values):
        number = f"{value:g}"
        start = max(0, min(k * cell + (cell - len(number)) // 2, cell * len(values) - len(number)))
        if start >= free:
            line = line.ljust(start) + number
            free = len(line) + 2
    return line


def _legend(shades: str, low: float, high: float, step: float, has_none: bool) -> str:
    if low == high:
        words = [f"{shades[0]} {low:.4g}"]
    else:
        words = [f"{glyph} {low + k * step:.4g}" for k, glyph in enumerate(shades)]
        words[-1] += f" to {high:.4g}"
    return "  ".join(["from", *words, *([f"{NONE} no answer"] if has_none else [])])
