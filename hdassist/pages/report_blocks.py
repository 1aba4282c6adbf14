"""Blocks of a report, whatever it is written as: paragraphs, tables, figures, in sections."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.report.blocks import Seat
from hdassist.terminal.console import TextTable


@dataclass(frozen=True)
class Paragraph:
    """Text."""

    text: str


@dataclass(frozen=True)
class Label:
    """Words at a place of a chart; kind: x or y of an axis, or what it marks."""

    x: float
    y: float
    words: str
    kind: str


@dataclass(frozen=True)
class ChartShape:
    """Corners of a line or of an area in a chart, "x,y x,y", and what it is: line, area, whisker, limit."""

    points: str
    kind: str


@dataclass(frozen=True)
class Chart:
    """A drawing over two axes, already in its own coordinates: size, box of the axes, words and shapes.

    dots: labels whose words stand beside a dot; grid: heights of the horizontal lines.
    """

    width: float
    height: float
    box: tuple[float, float, float, float]
    x_label: str
    y_label: str
    ticks: tuple[Label, ...]
    grid: tuple[float, ...]
    shapes: tuple[ChartShape, ...]
    dots: tuple[Label, ...] = ()


@dataclass(frozen=True)
class Figure:
    """A drawing with its caption, as shapes and in characters."""

    caption: str
    drawing: Chart | Seat
    text: str


Block = Paragraph | TextTable | Figure


@dataclass(frozen=True)
class ReportSection:
    """Blocks under a title."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Tile:
    """A number to be seen at once: what it is, the number, and what stands below."""

    label: str
    value: str
    below: str


@dataclass(frozen=True)
class Report:
    """One report: its title, what the drive is, the verdict and why, numbers to be seen at once, warnings, sections."""

    title: str
    subject: str
    verdict: str
    reasons: tuple[str, ...]
    tiles: tuple[Tile, ...]
    warnings: tuple[str, ...]
    sections: tuple[ReportSection, ...]
    foot: tuple[str, ...]
