"""Where things lie in the drawings of templates/: directions on the seat of the fixed wheel, values in a chart."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin

from hdassist.model.geometry import Array
from hdassist.report import Curve
from hdassist.terminal.plot import least_and_greatest, ticks

CENTRE = (210.0, 146.0)  # of the seat
HOLE_CIRCLE = 112.0  # radius of the circle of holes
CHART_BOX = (50.0, 34.0, 466.0, 214.0)  # of the axes: left, top, right, bottom
ENVELOPE_COLUMNS = 400  # of a curve of many points, drawn from least to greatest


def at(angle_deg: float, distance: float) -> tuple[float, float]:
    """Where a direction lies on the drawing of a seat: counter-clockwise from the right, y downwards."""
    return CENTRE[0] + distance * cos(radians(angle_deg)), CENTRE[1] - distance * sin(radians(angle_deg))


@dataclass(frozen=True)
class ChartAxes:
    """Axes of a chart: numbers at them, the first and the last of y being its ends, and the two ends of x."""

    columns: list[float]
    rows: list[float]
    ends: tuple[float, float]

    @classmethod
    def around(cls, figure: Curve) -> ChartAxes:
        """Axes that hold a figure of more than one point, its limit and its whiskers."""
        ends = float(figure.x[0]), float(figure.x[-1])
        columns = [tick for tick in ticks(*ends, 8) if ends[0] <= tick <= ends[1]]
        return cls(columns, ticks(*figure.ends, 5), ends)

    def right(self, x: float) -> float:
        """Where x lies in the drawing."""
        return CHART_BOX[0] + (x - self.ends[0]) / (self.ends[1] - self.ends[0]) * (CHART_BOX[2] - CHART_BOX[0])

    def down(self, y: float) -> float:
        """Where y lies in the drawing."""
        return CHART_BOX[3] - (y - self.rows[0]) / (self.rows[-1] - self.rows[0]) * (CHART_BOX[3] - CHART_BOX[1])


def outline(figure: Curve, y: Array) -> list[tuple[float, float]]:
    """Points of a line; of many points corners around them, along the greatest values and back along the least."""
    if len(figure.x) <= 2 * ENVELOPE_COLUMNS:
        return list(zip(figure.x.tolist(), y.tolist(), strict=True))
    (x, low), (_, high) = least_and_greatest(figure.x, y, ENVELOPE_COLUMNS, figure.over)
    return [*zip(x, high, strict=True), *zip(x[::-1], low[::-1], strict=True)]
