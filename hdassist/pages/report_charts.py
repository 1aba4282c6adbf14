"""Curves as shapes with numbered axes, for a page that draws them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from hdassist.model.geometry import Array
from hdassist.pages.report_blocks import Chart, ChartShape, Label
from hdassist.terminal.plot import ticks

CHART_WIDTH, CHART_HEIGHT = 480.0, 258.0
CHART_LEFT, CHART_RIGHT, CHART_TOP, CHART_BOTTOM = 50.0, 14.0, 34.0, 44.0
ENVELOPE_COLUMNS = 400  # of a curve of many points, drawn from least to greatest


@dataclass(frozen=True)
class Dot:
    """A place to be marked, with words; kind: now or target."""

    x: float
    y: float
    words: str
    kind: str


def chart(
    x: Array,
    y: Array,
    *,
    x_label: str,
    y_label: str,
    limit: float | None = None,
    whiskers: Sequence[tuple[float, float, float]] = (),
    dots: Iterable[Dot] = (),
    points: bool = False,
    from_zero: bool = False,
) -> Chart:
    """A chart of y over x, both shape (n,), x growing, n > 1; where points crowd, from least to greatest.

    Arguments: labels with units; limit, a line across; whiskers, x with a least and a greatest value; dots; points,
    whether each of x is marked; from_zero, whether the axis begins there.
    """
    values = [*y.tolist(), *(v for _, low, high in whiskers for v in (low, high)), *([] if limit is None else [limit])]
    rows = ticks(min(values + [0.0] * from_zero), max(values), 5)
    begin, end = float(x[0]), float(x[-1])
    columns = [tick for tick in ticks(begin, end, 8) if begin <= tick <= end]
    box = (CHART_LEFT, CHART_TOP, CHART_WIDTH - CHART_RIGHT, CHART_HEIGHT - CHART_BOTTOM)

    def right(value: float) -> float:
        return box[0] + (value - begin) / (end - begin) * (box[2] - box[0])

    def down(value: float) -> float:
        return box[3] - (value - rows[0]) / (rows[-1] - rows[0]) * (box[3] - box[1])

    def line(places: Iterable[tuple[float, float]], kind: str) -> ChartShape:
        return ChartShape(" ".join(f"{right(a):.1f},{down(b):.1f}" for a, b in places), kind)

    shapes = [line([(a, low), (a, high)], "whisker") for a, low, high in whiskers]
    if len(x) > 2 * ENVELOPE_COLUMNS:
        shapes.append(line(_outline(x, y), "area"))
    else:
        shapes.append(line(zip(x.tolist(), y.tolist(), strict=True), "line"))
    if limit is not None:
        shapes.append(line([(begin, limit), (end, limit)], "limit"))
    marks = [Label(right(tick), box[3] + 16, f"{tick:g}", "x") for tick in columns]
    marks += [Label(box[0] - 6, down(tick) + 4, f"{tick:g}", "y") for tick in rows]
    places = [Dot(a, b, "", "point") for a, b in zip(x.tolist(), y.tolist(), strict=True)] if points else []
    labels = tuple(Label(right(dot.x), down(dot.y), dot.words, dot.kind) for dot in (*places, *dots))
    return Chart(
        CHART_WIDTH,
        CHART_HEIGHT,
        box,
        x_label,
        y_label,
        tuple(marks),
        tuple(down(tick) for tick in rows),
        tuple(shapes),
        labels,
    )


def _outline(x: Array, y: Array) -> list[tuple[float, float]]:
    """Corners around a curve of many points: along its greatest values, and back along its least."""
    column = np.minimum(((x - x[0]) / (x[-1] - x[0]) * ENVELOPE_COLUMNS).astype(int), ENVELOPE_COLUMNS - 1)
    begin = np.flatnonzero(np.diff(column, prepend=-1))
    middle = x[begin].tolist()
    high, low = np.maximum.reduceat(y, begin).tolist(), np.minimum.reduceat(y, begin).tolist()
    return [*zip(middle, high, strict=True), *reversed(list(zip(middle, low, strict=True)))]
