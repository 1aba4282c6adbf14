"""Page of a report for a terminal: verdict and reasons, blocks, and one line on the verification."""

import re
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, Group, JustifyMethod, RenderableType
from rich.containers import Lines as RichLines
from rich.measure import Measurement
from rich.table import Table as RichTable
from rich.text import Text

from hdassist.drive.solve.answers import TOLERANCE, Certificate
from hdassist.drive.solve.loadcase import CROSS_TOLERANCE, CrossCheck
from hdassist.features.report import (
    BLANK,
    Block,
    Curve,
    Facts,
    Figure,
    Lines,
    Paragraph,
    Report,
    ReportProof,
    ReportSection,
    Seat,
    Table,
    Tiles,
    certificate_object,
    tone_of,
)
from hdassist.interface.terminal.plot import curve, seat_in_characters
from hdassist.interface.terminal.streams import Style, console, made_or
from hdassist.interface.terminal.words import proof
from hdassist.run.errors import Verdict
from hdassist.run.system import broken_line_end, command_quote

DRAWINGS: dict[type, Callable[[Style, Any], str]] = {
    Curve: curve,
    Seat: lambda style, seat: style.text(f"{seat_in_characters(seat)}\n\n{seat.legend}"),
}
_RESIDUALS = {  # names of the residuals in a certificate, each relative to its scale
    "negative_force": "negative force",
    "negative_gap": "negative gap",
    "complementarity": "force on an open gap",
    "equilibrium": "equilibrium",
}
_ASCII_HEAD = box.Box(str(box.SIMPLE_HEAD).replace("─", "-"), ascii=True)
_OCHRE = "color(136)"  # a colour between green and red; unlike yellow, it is legible on white and on black
# rich styles of verdicts, by tone
_STYLES = {"good": "bold green", "bad": "bold red", "open": f"bold {_OCHRE}", "loud": "bold", "quiet": "dim"}
# replaces each space at which a line must not break, because rich breaks lines even at no-break spaces
_UNBROKEN = "\ufffe"
_UNIT = r"[%″°]|N[·*]m|\u041d[·*]\u043c|µm|um\b|deg\b|arcsec\b"  # units in Unicode and ASCII, and the Russian N*m
_SPACE_IN_NUMBER = re.compile(rf"(?<=[\d,]) (?={_UNIT})|(?<=[±≤≥<>]) (?=\d)")  # space before a unit or after a sign
_COMMAND = re.compile("hdassist [a-z]")  # start of a command, but not of a line with the version
_SPACE_IN_QUOTES = {  # space in quotes, by quote: an odd number of quotes follows
    "'": re.compile(r" (?=[^']*'(?:[^']*'[^']*')*[^']*$)"),
    '"': re.compile(r' (?=[^"]*"(?:[^"]*"[^"]*")*[^"]*$)'),
}
_SPACE_BEHIND_OPTION = re.compile(r"(?<= )(--?[a-z][a-z-]*) (?=[^- ]\S{,39}(?: |$))")  # space before a short value
_GAP = f"[ {_UNBROKEN}]"
_NUMBERS_WITH_UNIT = (  # numbers that are bold in the reasons of a report
    rf"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?:{_GAP}?[%″°]|{_GAP}N·m(?:/rad)?)?(?!\w)"
)
_ANY_WIDTH = 100_000  # columns; a width that exceeds that of any table
_LONGEST_WORD = 30  # columns; largest width of a word that is never broken
_PAGE_WORDS: dict[str, str] = {Verdict.NO_LIMIT: "no limit set"}  # texts that replace verdicts on pages


class _PageText(Text):
    """Text that wraps at spaces, but not between a number and its sign or unit.

    A command wraps between arguments, and within quotes only if an argument is longer than a line. The lines of a
    command, except the last, end with the continuation character of the shell.
    """

    def __init__(self, text: str, style: str = "") -> None:
        is_command = bool(_COMMAND.match(text))
        # an argument in quotes could not be copied if it were broken
        if is_command:
            text = _SPACE_IN_QUOTES[command_quote()].sub(_UNBROKEN, text)
            text = _SPACE_BEHIND_OPTION.sub(rf"\1{_UNBROKEN}", text)
        super().__init__(text if is_command else _SPACE_IN_NUMBER.sub(_UNBROKEN, text), style)
        self._ending = broken_line_end() if is_command else ""

    def wrap(self, console: Console, width: int, **options: Any) -> RichLines:
        """Return the text as rich lines of at most the given width."""
        # only a command that needs several lines has a continuation character
        ending = self._ending * (self.cell_len > width)
        # if an argument is longer than a line, all spaces may break
        if ending and max(map(cell_len, self.plain.split())) > width - len(ending):
            self.plain = self.plain.replace(_UNBROKEN, " ")
        lines = super().wrap(
            console,
            width - len(ending),
            **options,
        )
        quotes = 0
        for line in lines:
            quotes += line.plain.count(command_quote())
            line.plain = line.plain.replace(_UNBROKEN, " ")
            # within quotes, the continuation character would be part of the argument
            if ending and quotes % 2 == 0 and line is not lines[-1]:
                line.plain = line.plain.rstrip() + ending
        return lines

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        """Return the smallest and the full width; a word longer than _LONGEST_WORD may be broken."""
        needed, taken = super().__rich_measure__(console, options)
        return Measurement(min(needed, _LONGEST_WORD), taken)


def _why_lines(report: Report, style: Style) -> list[_PageText]:
    """Return the reasons of a report with bold numbers, followed by an empty line.

    Without reasons, the empty line is needed only above a table with a title.
    """
    why = [_PageText(style.text("\n".join(report.why)))] if report.why else []
    is_titled = any(isinstance(block, Table) and block.title for block in report.blocks[:1])
    if why or is_titled:
        why.append(_PageText(""))
    for text in why:
        text.highlight_regex(_NUMBERS_WITH_UNIT, "bold")
    return why


def report_page(
    report: Report,
    style: Style,
    *,
    plots: bool = True,
    details: bool = False,
) -> RenderableType:
    """Return a report as a page for the terminal.

    plots: whether figures are drawn.
    details: whether details are shown.
    """
    head = _PageText(style.text(report.head), "bold")
    if report.verdict:
        head.append(": ").append(word(report.verdict, style))
    # the last line of the short page names the option that shows the details
    further_blocks = (*report.details, *_certificate_facts(report.certificate, report.cross_checks))
    blocks = [*report.blocks, *(further_blocks if details else ())]
    hidden = "" if details or not further_blocks else "--details"
    proven = proof(report.certificate, report.cross_checks)
    # every page with solved states ends with the line on the verification
    verified = ("verified", f"{proven} ({hidden})" if hidden else proven)
    last = Facts.of([verified if proven else ("more", hidden)])
    # an empty line follows each block
    parts = [part for block in blocks for part in block_on_page(block, style, plots)]
    lines = [line for part in parts for line in (part, Text(""))]
    if plots and blocks and isinstance(blocks[-1], Curve):
        lines = lines[:-1]  # after a plot, the label of its axis separates the blocks
    why = _why_lines(report, style)
    return Group(head, *why, *lines, *block_on_page(last, style))


def word(verdict: str, style: Style) -> Text:
    """Return a verdict as text for a page, in the colour of its tone; other texts are unchanged and have no colour."""
    return _PageText(style.text(_PAGE_WORDS.get(verdict, verdict)), _STYLES.get(tone_of(verdict), ""))


def block_on_page(
    block: Block,
    style: Style,
    plots: bool = True,
) -> Iterator[RenderableType]:
    """Yield the parts of a block in text characters; an empty block has no parts.

    plots: whether figures are drawn.
    """
    match block:
        case Paragraph():
            yield _PageText(style.text(block.text))
        case Lines() if block.lines:
            marked = _labelled(Facts(tuple((block.mark, line) for line in block.lines)), style)
            yield Group(Text(style.text(block.title), style="bold"), marked) if block.title else marked
        case Facts() if block.rows:
            yield _labelled(block, style)
        case Table() if block.rows:
            yield from _tables(block, style)
        case ReportSection():
            parts = [part for inner in block.blocks for part in block_on_page(inner, style, plots)]
            yield Group(Text(style.text(block.title), style="bold"), *parts[:1])
            yield from parts[1:]
        case Tiles():
            yield _labelled(Facts(tuple((label, f"{value} {note}") for label, value, note in block.rows)), style)
        case _ if isinstance(block, Figure) and plots:
            if text := in_characters(block, style):
                yield Text(text)


def in_characters(block: Figure, style: Style) -> str:
    """Return a figure drawn in text characters, or an empty text with a warning on standard error if drawing fails."""
    return made_or("plot", lambda: DRAWINGS[type(block)](style, block), str)


def _labelled(block: Facts, style: Style) -> RichTable:
    """Return facts as a table of labels and texts; a text wraps beside its label, and a label wraps at half a page."""
    grid = RichTable.grid(padding=(0, 2, 0, 0))
    grid.add_column(no_wrap=max(cell_len(label) for label, _ in block.rows) <= style.width // 2)
    grid.add_column(overflow="fold")
    for label, text in block.rows:
        grid.add_row(
            *(_PageText(style.text(part)) for part in (label, text or BLANK)), style=_STYLES.get(tone_of(label))
        )
    return grid


def _tables(block: Table, style: Style) -> Iterator[RenderableType]:
    """Yield a table that fits the page: with wide columns, with tight columns, or split into several tables.

    Each of several tables repeats the first column.
    """
    # the console measures the width of each form of the table
    screen = console(sys.stdout, style)
    options = screen.options.update(width=_ANY_WIDTH)
    title = _PageText("\n".join(style.text(line) for line in (block.title, *block.notes) if line))
    title.stylize("bold", 0, len(style.text(block.title)))
    columns_left = list(range(1, len(block.heads)))
    # columns without room continue in a table below, which repeats the first column
    while columns_left or title:
        narrower = [(columns_left, {}), (columns_left, {"is_tight": True})]
        narrower += [
            (columns_left[:count], {"is_tight": True, "folds": True}) for count in range(len(columns_left), 0, -1)
        ]
        for columns, ways in narrower:
            table = _table(
                block,
                [0, *columns],
                style,
                **ways,
            )
            if Measurement.get(screen, options, table).minimum <= style.width:
                break
        yield Group(title, table) if title else table
        columns_left = columns_left[len(columns) :]
        title = _PageText("")


def _table(
    block: Table,
    columns: list[int],
    style: Style,
    *,
    is_tight: bool = False,
    folds: bool = False,
) -> RichTable:
    """Return selected columns of a table; only text with spaces wraps.

    is_tight: whether columns are close together and heads wrap.
    folds: whether brackets move below their numbers.
    """
    table = RichTable(
        box=_ASCII_HEAD if style.ascii else box.SIMPLE_HEAD,
        pad_edge=False,
        show_edge=False,
        padding=(0, 0 if is_tight else 1),
    )
    columns_of_cells = []
    for k in columns:
        head, *cells = (style.text(_PAGE_WORDS.get(row[k], row[k])) for row in (block.heads, *block.rows))
        is_words = k in block.words
        # "12 (10 to 15)" is split into two lines
        if folds and not is_words:
            cells = [cell.replace(" (", "\n(") for cell in cells]
        lines = [line for cell in cells for line in cell.split("\n")]
        if is_tight:
            head = textwrap.fill(
                head,
                max(1, *map(cell_len, (*lines, *head.split()))),
                break_on_hyphens=False,
            )
        # a cell with numbers never wraps
        wraps = is_words and any(" " in cell for cell in (head, *cells))
        least = None if wraps else max(map(cell_len, (*head.split("\n"), *lines)))
        justify: JustifyMethod = "left" if is_words else "right"
        table.add_column(
            head,
            justify=justify,
            overflow="fold",
            no_wrap=not wraps,
            min_width=least,
        )
        columns_of_cells.append(cells)
    for cells_of_row in zip(*columns_of_cells, strict=True):
        table.add_row(*(_PageText(cell, _STYLES.get(tone_of(cell), "")) for cell in cells_of_row))
    return table


def _certificate_facts(found: ReportProof | None, cross_checks: Iterable[CrossCheck | None]) -> Iterator[Facts]:
    """Yield the residuals of the mesh positions with their bounds; nothing for a report without a certificate."""
    if isinstance(found, Certificate):
        rows = [
            ("mesh positions solved", f"{found.states}"),
            ("mesh positions solved by the fallback solver", f"{found.fallbacks}"),
        ]
        bound = f", relative residual (limit {TOLERANCE:.0e})"
        rows += [(f"{label}{bound}", f"{getattr(found, name):.1e}") for name, label in _RESIDUALS.items()]
        if cross := certificate_object(found, cross_checks)["cross_check"]:
            label = f"{cross['states']} solved again with {cross['solver']}: difference (limit {CROSS_TOLERANCE:g}″)"
            rows.append((label, f"{cross['max_difference_arcsec']:.1e}″"))
        yield Facts(tuple(rows))
