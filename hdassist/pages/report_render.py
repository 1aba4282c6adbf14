"""The report as one HTML file, or as Markdown: the templates of templates/."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from jinja2 import Environment
from markupsafe import Markup

from hdassist.pages.card_render import environment, html_safe, markdown_safe
from hdassist.pages.card_svg import seat_geometry
from hdassist.pages.report_charts import chart
from hdassist.report.blocks import Block, Curve, Facts, HeatMap, Paragraph, Seat, Table, Tiles, TwoCurves
from hdassist.report.report import Report
from hdassist.terminal.brief import proof
from hdassist.terminal.console import Style
from hdassist.terminal.page import in_characters
from hdassist.visible import visible

FIGURE_COLUMNS = 80  # of figures in characters
KINDS = {"curve": Curve, "seat": Seat, "paragraph": Paragraph, "facts": Facts, "table": Table, "tiles": Tiles}
DRAWN = (Curve, TwoCurves, HeatMap, Seat)


def report_html(report: Report) -> str:
    """A report as one HTML file: everything inside it, no scripts."""
    page = _environment(autoescape=True, finalize=html_safe, batches=_batches, chart_of=chart)
    seat = page.get_template("seat.svg")
    page.globals["seat_svg"] = lambda drawn: Markup(seat.render(seat=drawn, **seat_geometry(drawn)))
    return page.get_template("report.html").render(report=report, proof=_proof(report))


def report_markdown(report: Report, style: Style) -> str:
    """A report as Markdown, with the tables of GitHub's dialect and figures in characters; style: of its texts."""

    def safe(value: Any) -> Any:
        return markdown_safe(value if isinstance(value, Markup) else style.text(str(value)))

    plain = replace(style, codes=False, width=FIGURE_COLUMNS)
    page = _environment(finalize=safe, as_drawn=lambda figure: _as_drawn(in_characters(figure, plain)))
    return page.get_template("report.md").render(report=report, proof=_proof(report))


def _proof(report: Report) -> str:
    return proof(report.certificate, report.cross_checks) if report.certificate else ""


def _environment(**options: Any) -> Environment:
    """Templates, which can ask the kind of a block."""
    found = environment(**options)
    for name, kind in KINDS.items():
        found.tests[name] = lambda block, kind=kind: isinstance(block, kind)
    return found


def _batches(blocks: Iterable[Block]) -> list[list[Block]]:
    """Blocks one by one, but figures that follow each other together."""
    found: list[list[Block]] = []
    for block in blocks:
        if found and isinstance(block, DRAWN) and isinstance(found[-1][0], DRAWN):
            found[-1].append(block)
        else:
            found.append([block])
    return found


def _as_drawn(text: str) -> Markup:
    """A figure in characters for a fenced block, where nothing is a sign but the fence."""
    return Markup(visible(text).replace("```", "'''"))
