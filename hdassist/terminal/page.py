"""A report as a page of a terminal: verdict and reasons, its blocks, one line of proof."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from rich import box
from rich.cells import cell_len
from rich.console import Group, RenderableType
from rich.table import Table as RichTable
from rich.text import Text

from hdassist.json_parts import certificate_object
from hdassist.report.blocks import (
    BLANK,
    Block,
    Curve,
    Facts,
    Figure,
    Lines,
    Paragraph,
    ReportSection,
    Seat,
    Table,
    Tiles,
    TwoCurves,
)
from hdassist.report.report import Report, ReportProof
from hdassist.solve.answers import Certificate
from hdassist.solve.certificate import TOLERANCE
from hdassist.solve.throughcvxpy import CROSS_TOLERANCE, CrossCheck
from hdassist.terminal.brief import COLOURS, proof
from hdassist.terminal.console import Style, made_or
from hdassist.terminal.plot import curve, two_curves
from hdassist.terminal.seat import seat_in_characters
from hdassist.verdict import Verdict

DRAWINGS: dict[type, Callable[[Style, Any], str]] = {
    Curve: curve,
    TwoCurves: two_curves,
    Seat: lambda style, seat: style.text(f"{seat_in_characters(seat)}\n\n{seat.legend}"),
}
RESIDUALS = {  # of a certificate, each a share of its scale
    "negative_force": "negative force",
    "negative_gap": "negative gap",
    "complementarity": "force on an open gap",
    "equilibrium": "equilibrium",
}
PAGE_WORDS: dict[str, str] = {Verdict.NO_LIMIT: "no limit set"}  # of a verdict, where its own word says too little


def report_page(report: Report, style: Style, *, plots: bool = True, details: bool = False) -> RenderableType:
    """A report for people; plots: whether figures are drawn; details: whether all of it is shown."""
    head = Text(style.text(report.head), style="bold")
    if report.verdict:
        head.append(style.text(": ")).append(word(report.verdict, style))
    more = (*report.details, *certificate_tables(report.certificate, report.cross_checks))
    blocks = [*report.blocks, *(more if details else ())]
    hidden = "" if details or not more else "--details"
    proven = proof(report.certificate, report.cross_checks)
    last = Facts.of([("proof", f"{proven} (more: {hidden})" if hidden else proven) if proven else ("more", hidden)])
    parts = [part for block in blocks for part in block_on_page(block, style, plots)]
    lines = [line for part in parts for line in (part, Text(""))]
    if plots and blocks and isinstance(blocks[-1], Curve | TwoCurves):
        lines = lines[:-1]  # under an axis its words are enough of a gap
    why = [Text(style.text("\n".join(report.why))), Text("")] if report.why else []
    return Group(head, *why, *lines, *block_on_page(last, style))


def word(verdict: str, style: Style) -> Text:
    """A verdict as a page has it, green or red where there are colours; any other text as it is."""
    return Text(style.text(PAGE_WORDS.get(verdict, verdict)), style=COLOURS.get(verdict, ""))


def block_on_page(block: Block, style: Style, plots: bool = True) -> Iterator[RenderableType]:
    """A block in characters; nothing of an empty one, and of figures where no plots are wanted."""
    match block:
        case Paragraph():
            yield Text(style.text(block.text))
        case Lines() if block.lines:
            marked = labelled(Facts(tuple((block.mark, line) for line in block.lines)), style)
            yield Group(Text(style.text(block.title), style="bold"), marked) if block.title else marked
        case Facts() if block.rows:
            yield labelled(block, style)
        case Table() if block.rows:
            yield from tables(block, style)
        case ReportSection():
            parts = [part for inner in block.blocks for part in block_on_page(inner, style, plots)]
            yield Group(Text(style.text(block.title), style="bold"), *parts[:1])
            yield from parts[1:]
        case Tiles():
            yield labelled(Facts(tuple((label, f"{value} {below}") for label, value, below in block.rows)), style)
        case _ if isinstance(block, Figure) and plots:
            if text := in_characters(block, style):
                yield Text(text)


def in_characters(block: Figure, style: Style) -> str:
    """A figure in characters; empty, with a remark on stderr, where it cannot be drawn."""
    return made_or("plot", lambda: DRAWINGS[type(block)](style, block), str)


def labelled(block: Facts, style: Style) -> RichTable:
    """Labelled lines; a text that wraps stays beside its label."""
    grid = RichTable.grid(padding=(0, 2, 0, 0))
    grid.add_column(no_wrap=True)
    grid.add_column(overflow="fold")
    for label, text in block.rows:
        grid.add_row(style.text(label), style.text(text or BLANK))
    return grid


def tables(block: Table, style: Style) -> Iterator[RenderableType]:
    """A table, or several with the same first column where all columns are wider than the page."""
    columns = list(range(1, len(block.heads)))
    first = True
    while columns or first:
        shown = len(columns)
        while shown > 1 and _width(block, [0, *columns[:shown]], style) > style.width:
            shown -= 1
        table = _table(block, [0, *columns[:shown]], style)
        title = "\n".join((block.title, *block.notes)) if first else ""
        yield Group(Text(style.text(title), style="bold"), table) if title else table
        columns, first = columns[shown:], False


def _width(block: Table, columns: list[int], style: Style) -> int:
    """Columns of characters of a table in which only words wrap."""
    whole = [[block.heads[k] if block.header else "", *(row[k] for row in block.rows)] for k in columns]
    shown = [list(map(style.text, cells)) for cells in whole]
    parts = [" ".join(cells).split() if k in block.words else cells for k, cells in zip(columns, shown, strict=True)]
    apart = 3 * (len(columns) - 1) + (4 if style.ascii else 0)
    return apart + sum(max(map(cell_len, cells), default=0) for cells in parts)


def _table(block: Table, columns: list[int], style: Style) -> RichTable:
    found = RichTable(
        box=box.ASCII2 if style.ascii else box.SIMPLE_HEAD,
        show_header=block.header,
        pad_edge=False,
        show_edge=style.ascii,
    )
    for k in columns:
        head = style.text(block.heads[k])
        if k in block.words:
            spaced = any(" " in cell for cell in (head, *(row[k] for row in block.rows)))
            found.add_column(head, overflow="fold", no_wrap=not spaced)
        else:
            found.add_column(head, justify="right", no_wrap=True)
    for row in block.rows:
        found.add_row(*(word(row[k], style) for k in columns))
    return found


def certificate_tables(found: ReportProof | None, cross_checks: Iterable[CrossCheck | None]) -> Iterator[Table]:
    """Residuals of the states behind a report with the bounds that they keep; none of a proof that has none."""
    if isinstance(found, Certificate):
        rows = [("states solved", f"{found.states}"), ("states that needed a fallback", f"{found.fallbacks}")]
        bound = f", share of its scale, at most {TOLERANCE:.0e}"
        rows += [(f"{words}{bound}", f"{getattr(found, name):.1e}") for name, words in RESIDUALS.items()]
        if cross := certificate_object(found, cross_checks)["cross_check"]:
            words = f"{cross['states']} again by {cross['solver']}, apart by at most {CROSS_TOLERANCE:g}″"
            rows.append((words, f"{cross['max_difference_arcsec']:.1e}"))
        yield Table("proof", ("", ""), tuple(rows), header=False)
