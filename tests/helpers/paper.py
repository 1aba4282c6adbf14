"""Reports as plain text, for tests of their contents."""

from __future__ import annotations

from hdassist.features.report import Facts, Report
from hdassist.interface.terminal.output import Output
from hdassist.interface.terminal.page import report_page
from hdassist.interface.terminal.streams import Style


def on_paper(report: Report, width: int = 80, *, ascii: bool = False, details: bool = False) -> str:
    """Return the page of a report as plain text without plots; width: number of columns."""
    style = Style(ascii, False, width)
    return Output(style).page(report_page(report, style, plots=False, details=details))


def facts_of(report: Report) -> dict[str, str]:
    """Return the texts of the labelled lines of a report, by label."""
    return {label: text for block in report.blocks if isinstance(block, Facts) for label, text in block.rows}
