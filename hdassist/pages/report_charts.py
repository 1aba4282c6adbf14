"""Curves as shapes with numbered axes, for a page that draws them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from hdassist.model.geometry import Array
from hdassist.report.blocks import Curve, CurveMark
from hdassist.terminal.plot import least_and_greatest, ticks

CHART_WIDTH, CHART_HEIGHT = 480.0, 258.0
CHART_LEFT, CHART_RIGHT, CHART_TOP, CHART_BOTTOM = 50.0, 14.0, 34.0, 44.0
ENVELOPE_COLUMNS = 400  # of a curve of many points, drawn from least to greatest


@dataclass(frozen=True)
class ChartShape:
    """Corners of a line or of an area in a chart, "x,y x,y", and its kind: line, area, whisker, limit."""

    points: str
    kind: str


@dataclass(frozen=True)
class Chart:
    """A drawing over two axes, already in its own coordinates: size, box of the axes, words and shapes.

    ticks: numbers at the axes, kind x or y; dots: marks whose words stand beside a dot; grid: heights of the horizontal
    lines.
    """

    width: float
    height: float
    box: tuple[float, float, float, float]
    x_label: str
    y_label: str
    ticks: tuple[CurveMark, ...]
    grid: tuple[float, ...]
    shapes: tuple[ChartShape, ...]
    dots: tuple[CurveMark, ...] = ()


def chart(curve: Curve) -> Chart:
    """A chart of a curve of more than one point; where points crowd, from least to greatest."""
    x, y, limit = curve.x, curve.y, curve.limit
    values = [*y.tolist(), *(end for _, *ends in curve.whiskers for end in ends), *([] if limit is None else [limit])]
    rows = ticks(min(values + [0.0] * curve.from_zero), max(values), 5)
    begin, end = float(x[0]), float(x[-1])
    columns = [tick for tick in ticks(begin, end, 8) if begin <= tick <= end]
    box = (CHART_LEFT, CHART_TOP, CHART_WIDTH - CHART_RIGHT, CHART_HEIGHT - CHART_BOTTOM)

    def right(value: float) -> float:
        return box[0] + (value - begin) / (end - begin) * (box[2] - box[0])

    def down(value: float) -> float:
        return box[3] - (value - rows[0]) / (rows[-1] - rows[0]) * (box[3] - box[1])

    def line(places: Iterable[tuple[float, float]], kind: str) -> ChartShape:
        return ChartShape(" ".join(f"{right(a):.1f},{down(b):.1f}" for a, b in places), kind)

    shapes = [line([(a, low), (a, high)], "whisker") for a, low, high in curve.whiskers]
    if len(x) > 2 * ENVELOPE_COLUMNS:
        shapes.append(line(_outline(x, y, curve.over), "area"))
    else:
        shapes.append(line(zip(x.tolist(), y.tolist(), strict=True), "line"))
    if limit is not None:
        shapes.append(line([(begin, limit), (end, limit)], "limit"))
    marks = [CurveMark(right(tick), box[3] + 16, f"{tick:g}", "x") for tick in columns]
    marks += [CurveMark(box[0] - 6, down(tick) + 4, f"{tick:g}", "y") for tick in rows]
    places = [CurveMark(a, b, "", "point") for a, b in zip(x.tolist(), y.tolist(), strict=True)] if curve.points else []
    labels = tuple(CurveMark(right(dot.x), down(dot.y), dot.words, dot.kind) for dot in (*places, *curve.marks))
    return Chart(
        CHART_WIDTH,
        CHART_HEIGHT,
        box,
        curve.x_label,
        curve.y_label,
        tuple(marks),
        tuple(down(tick) for tick in rows),
        tuple(shapes),
        labels,
    )


def _outline(x: Array, y: Array, over: float) -> list[tuple[float, float]]:
    """Corners around a curve of many points: along its greatest values, and back along its least."""
    (places, low), (_, high) = least_and_greatest(x, y, ENVELOPE_COLUMNS, over)
    middle = places.tolist()
    return [*zip(middle, high.tolist(), strict=True), *reversed(list(zip(middle, low.tolist(), strict=True)))]
