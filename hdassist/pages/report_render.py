"""The report as one HTML file, or as Markdown: the templates of templates/."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from jinja2 import Environment
from markupsafe import Markup

from hdassist.pages.card_render import environment, html_safe, markdown_safe
from hdassist.pages.card_svg import seat_geometry
from hdassist.pages.report_blocks import Block, Chart, Figure, Paragraph, Report
from hdassist.visible import visible

BLOCKS = {"chart": Chart, "figure": Figure, "paragraph": Paragraph}


def report_html(report: Report) -> str:
    """The report as one HTML file: everything inside it, no scripts."""
    page = _environment(autoescape=True, finalize=html_safe, batches=_batches)
    seat = page.get_template("seat.svg")
    page.globals["seat_svg"] = lambda drawn: Markup(seat.render(seat=drawn, **seat_geometry(drawn)))
    return page.get_template("report.html").render(report=report)


def report_markdown(report: Report, shown: Callable[[str], str] = str) -> str:
    """The report as Markdown, with the tables of GitHub's dialect and figures in characters.

    shown: what can be shown of a text, before what Markdown takes for signs is escaped.
    """

    def safe(value: Any) -> Any:
        return markdown_safe(value if isinstance(value, Markup) else shown(str(value)))

    page = _environment(finalize=safe, as_drawn=_as_drawn)
    return page.get_template("report.md").render(report=report)


def _environment(**options: Any) -> Environment:
    """Where templates are found, which can ask what kind a block is."""
    found = environment(**options)
    for name, kind in BLOCKS.items():
        found.tests[name] = lambda block, kind=kind: isinstance(block, kind)
    return found


def _batches(blocks: Iterable[Block]) -> list[list[Block]]:
    """Blocks one by one, but figures that follow each other together."""
    found: list[list[Block]] = []
    for block in blocks:
        if found and isinstance(block, Figure) and isinstance(found[-1][0], Figure):
            found[-1].append(block)
        else:
            found.append([block])
    return found


def _as_drawn(text: str) -> Markup:
    """A figure in characters for a fenced block, where nothing is a sign but the fence."""
    return Markup(visible(text).replace("```", "'''"))
