"""The complete report of a drive, and the output of reports and cards as HTML, Markdown and text."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import cos, radians, sin
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from rich.console import Group
from rich.text import Text

from hdassist import __version__
from hdassist.drive.model.deviations import unknown_names
from hdassist.drive.model.geometry import Array, Kinematics
from hdassist.drive.preset.fields import Drive, origin_counts, resolved_fields, value_text
from hdassist.features.preset_comparison import DriveSheet
from hdassist.features.report import (
    BLANK,
    Block,
    Curve,
    Facts,
    Figure,
    Paragraph,
    Report,
    ReportSection,
    Table,
    Tiles,
    four_digits,
    tone_of,
)
from hdassist.interface.pages.card import TRADE, Card, hole_place
from hdassist.interface.pages.check import (
    F_ior_table,
    check_facts,
    check_report,
    error_tables,
    steps_tables,
    uncertain_inputs_words,
)
from hdassist.interface.pages.compare import sheet_warnings
from hdassist.interface.pages.curves import stiffness_report
from hdassist.interface.pages.mount import WORDS, mount_report
from hdassist.interface.terminal.output import Output, report_object
from hdassist.interface.terminal.page import block_on_page, in_characters
from hdassist.interface.terminal.plot import least_and_greatest, ticks
from hdassist.interface.terminal.streams import Style
from hdassist.interface.terminal.words import named, proof, samples_words
from hdassist.run.errors import Verdict
from hdassist.run.files import visible

_INPUT_HEADS = ("input", "contribution, %", "preset", "sampled from", "unit", "source")
_VERDICT_WORDS = {
    Verdict.PASS: "PASS: within its limits",
    Verdict.FAIL: "FAIL: beyond its limits",
    Verdict.INCONCLUSIVE: "INCONCLUSIVE: unknown inputs may change the verdict",
    Verdict.NO_LIMIT: "no limit set",
}


def _error_section(sheet: DriveSheet, check: Report) -> ReportSection:
    """Return the section of the kinematic error with the curves, tables and facts of the check."""
    curves = [block for block in (*check.blocks, *check.details) if isinstance(block, Curve)]
    # the report shows only the first table, the error over the full mesh cycle
    first_orders = next(error_tables(sheet.check))
    tables = [F_ior_table(sheet.check), *steps_tables(sheet.check), first_orders]
    return ReportSection("Kinematic error", (*curves, *tables, Facts.of(check_facts(sheet.check))))


def _mounting_section(sheet: DriveSheet, mount: Report) -> ReportSection:
    """Return the section of the fixed wheel: figures, the table of holes, and facts that the check does not state."""
    blocks = (*mount.blocks, *mount.details)
    figures = [block for block in blocks if isinstance(block, Figure)]
    *_, holes_table = (block for block in mount.details if isinstance(block, Table))
    facts = [row for block in blocks if isinstance(block, Facts) for row in block.rows]
    facts_of_check = [*check_facts(sheet.check)]
    further_facts = Facts.of(row for row in facts if row not in facts_of_check)
    return ReportSection("Mounting the fixed wheel", (*figures, holes_table, further_facts))


def _reasons(check: Report) -> list[str]:
    """Return the facts that explain the verdict of the check: all except options, questions and the next command."""
    facts = next(block for block in check.blocks if isinstance(block, Facts))
    return [f"{label}: {text}" for label, text in facts.rows if label not in ("options", "to clarify", "next")]


def drive_report(
    sheet: DriveSheet,
    *,
    draws: int,
    seed: int,
) -> Report:
    """Return the complete report of a drive, which fills two printed pages.

    sheet: results for the drive.
    draws: required effective sample size.
    seed: seed of the samples.
    """
    drive = sheet.drive
    verdict = sheet.check.verdict
    check = check_report(sheet.check, seed)
    mount = mount_report(sheet.advice, seed)
    stiff = stiffness_report(drive, sheet.stiffness)
    k = Kinematics.of(drive)
    values = origin_counts(drive)
    inputs = (*_basis(sheet, values), _provenance(drive, draws, seed))
    return Report(
        command="report",
        drive=drive,
        head=f"{k.z_g}/{k.z_b} teeth, module {drive.gears.m:g} mm, ratio {abs(k.u):g}, fixed: {TRADE[k.fixed]}",
        verdict=_VERDICT_WORDS[verdict],
        why=(*check.why, *mount.why, *_reasons(check)),
        blocks=(
            Tiles(tuple(_tiles(sheet, values))),
            _error_section(sheet, check),
            _mounting_section(sheet, mount),
            ReportSection("Torsional stiffness", tuple(_without_next(stiff.blocks))),
            ReportSection("Inputs and provenance", inputs),
        ),
        certificate=sheet.certificate,
        cross_checks=tuple(sheet.cross_checks),
        values={
            "verdict": str(verdict),
            "values": values,
            **{page.command: report_object(page) for page in (check, mount, stiff)},
            "seed": seed,
        },
        line=check.line,
        warnings=sheet_warnings(sheet),
        exit_code=check.exit_code,
    )


def _without_next(blocks: Iterable[Block]) -> Iterator[Block]:
    """Yield the blocks of a page without the next command."""
    for block in blocks:
        yield Facts(tuple(row for row in block.rows if row[0] != "next")) if isinstance(block, Facts) else block


def _tiles(sheet: DriveSheet, values: Mapping[str, int]) -> Iterator[tuple[str, str, str]]:
    for point in sheet.check.points:
        belief = point.belief
        subtitle = f"{belief.p5:.1f} to {belief.p95:.1f}″ (5 to 95 %)" if belief else "over the full mesh cycle"
        statistic = "median" if belief else "nominal"
        yield f"F'_ior at {point.M_g:g} N·m, {statistic}", f"{point.F_ior_or_error:.1f}″", subtitle
    advice = sheet.advice
    if advice.names_hole:
        gain = f"{-100 * advice.gain_range[1]:+.0f} % F'_ior" if advice.turn else "leave it in this hole"
        yield "position of the fixed wheel", hole_place(advice.chosen), f"{WORDS[advice.word]}: {gain}"
    else:
        yield "position of the fixed wheel", "any", "no hole is expected to be better"
    uncertain = len(sheet.check.prior.fields) if sheet.check.prior else 0
    yield "uncertain inputs", str(uncertain), f"{values['given']} given, {values['identified']} identified"


def _basis(sheet: DriveSheet, values: Mapping[str, int]) -> Iterator[Block]:
    """Yield the table of the inputs with the largest contributions, and a summary of the origins of all values."""
    drive = sheet.drive
    check = sheet.check
    resolved = {row.path: row for row in resolved_fields(drive)}
    drawn = check.prior.fields if check.prior else ()
    ranges = {field.path: f"{four_digits(field.low)} to {four_digits(field.high)}" for field in drawn}
    # a group is represented by its first field: the size, or the direction if the size is known
    groups = {field.group: field.path for field in reversed(drawn)}
    rows = tuple(
        (named(row.path), f"{100 * share:.0f}", value_text(row.value), ranges[row.path], row.unit, row.ref)
        for row, share in ((resolved[groups[influence.group]], influence.share) for influence in check.influences)
    )
    title = f"inputs by their contribution to the variance of F'_ior at {check.points[check.governing].M_g:g} N·m"
    yield Table(title, _INPUT_HEADS, rows)
    names = unknown_names(check.unknown)
    sampled = ""
    if check.samples:
        sampled = f"Inputs: {uncertain_inputs_words(check.samples.prior)}. Samples: {samples_words(check.samples)}. "
    yield Paragraph(
        f"{sampled}{f'Unknown deviations: {names}. ' if names else ''}"
        f"The preset states the source of {sum(values.values())} values: {values['given']} given, "
        f"{values['identified']} identified from measurements, {values['assumed']} assumed (hdassist presets show "
        "--resolved lists each with its range and source). Assumed values without a range are not sampled. Identified "
        "values agree with the measurements by construction, which does not validate the model; "
        "docs/validation.md lists the measurements with which the model was compared."
    )


def _provenance(
    drive: Drive,
    draws: int,
    seed: int,
) -> Facts:
    origin = drive.origin
    rows = (
        ("preset", f"{origin.file or drive.name}, SHA-256 {origin.sha256}"),
        ("overrides", "; ".join(origin.overrides) or "none"),
        ("description", " ".join(drive.description.split()) or "none"),
        ("made by", f"hdassist {__version__}, seed {seed}, effective sample size at least {draws}"),
    )
    return Facts(rows)


_CARD_COLUMNS = 78  # characters; width of the card as plain text
_LINES_BESIDE = 45  # lines of the card as text (drawing, checks, empty lines) that take no height of their own on paper
_CYRILLIC = range(0x400, 0x500)
_UNICODE = Style(
    ascii=False,
    codes=False,
    width=80,
)


def report_html(report: Report) -> str:
    """Return a report as one HTML file without scripts or further files."""
    return _html(
        "report.html",
        report=report,
        proof=proof(report.certificate, report.cross_checks),
    )


def report_markdown(report: Report, style: Style) -> str:
    """Return a report as GitHub Markdown, with figures drawn in text characters; style: style of the texts."""

    def safe(value: Any) -> Any:
        """Return a value as text, with a backslash before each character that is markup in Markdown or HTML."""
        if isinstance(value, Markup):
            return value
        return re.sub(r"([\\`*_\[\]<>|~&#])", r"\\\1", style.text(str(value)).replace("\n", "\\n"))

    page = _environment(safe, style).get_template("report.md")
    return page.render(report=report, proof=proof(report.certificate, report.cross_checks))


def card_html(card: Card) -> str:
    """Return the card as one HTML file for an A4 page, without scripts or further files."""
    return _html("card.html", card=card, lines=lines_on_paper(card))


def card_text(card: Card, *, ascii: bool = False) -> str:
    """Return the card as text; ascii: whether it may contain only 7-bit characters and Cyrillic letters."""
    return blocks_text(card.title, card.blocks, ascii=ascii)


def blocks_text(
    title: str,
    blocks: Iterable[Block],
    *,
    ascii: bool = False,
) -> str:
    """Return a title and blocks as text in the width of a card.

    ascii: whether the text may contain only 7-bit characters and Cyrillic letters.
    """
    style = Style(
        ascii,
        codes=False,
        width=_CARD_COLUMNS,
        beyond_ascii=_CYRILLIC,
    )
    parts = [part for block in (Paragraph(title), *blocks) for part in block_on_page(block, style)]
    return Output(style).page(Group(*[line for part in parts for line in (part, Text(""))]))


def lines_on_paper(card: Card) -> int:
    """Return the approximate number of lines that determine the height of a printed card.

    Table rows are higher and count twice. From this number, the style sheet chooses a font size at which the card fits
    on one page.
    """
    return len(card_text(card).splitlines()) - _LINES_BESIDE + len(card.torques.rows)


def _html(name: str, **parts: Any) -> str:
    page = _environment(_html_safe, _UNICODE, autoescape=True)
    return page.get_template(name).render(**parts)


def _environment(
    finalize: Callable[[Any], Any],
    style: Style,
    *,
    autoescape: bool = False,
) -> Environment:
    """Return the jinja2 environment of the templates, with their folder, their functions and the escaping of texts.

    A line that contains only a tag produces no line of output.

    finalize: function applied to each inserted value.
    style: style of the figures.
    autoescape: whether jinja2 escapes inserted values for HTML.
    """
    environment = Environment(
        loader=PackageLoader("hdassist.interface.pages"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=autoescape,
        finalize=finalize,
    )
    plain = replace(style, codes=False, width=_UNICODE.width)

    def drawn(figure: Figure) -> str:
        """Return a figure drawn in text characters; in Markdown, the fence of a code block is replaced within it."""
        text = visible(in_characters(figure, plain))
        return text if autoescape else Markup(text.replace("```", "'''"))

    environment.filters.update(
        drawn=drawn,
        unbroken=_unbroken,
        kind=lambda block: type(block).__name__,
    )
    environment.tests["figure"] = lambda block: isinstance(block, Figure)
    environment.globals.update(
        BLANK=BLANK,
        CENTRE=CENTRE,
        HOLE_CIRCLE=HOLE_CIRCLE,
        CHART_BOX=_CHART_BOX,
        ENVELOPE_COLUMNS=ENVELOPE_COLUMNS,
        ChartAxes=_ChartAxes,
        at=at,
        outline=outline,
        tone_of=tone_of,
    )
    return environment


def _unbroken(text: str) -> str:
    """Return a text in which no line breaks within a range or before a unit, and each arrow is one character."""
    return re.sub(
        r"\([-+.\d]+-[-+.\d]+\)|[-+.\d]+ to [-+.\d]+|\d (?:N·m|\u041d·\u043c|µm|mm|%)",
        lambda found: found[0].replace("-", "\N{NON-BREAKING HYPHEN}").replace(" ", "\N{NO-BREAK SPACE}"),
        text.replace(" -> ", " → "),
    )


def _html_safe(value: Any) -> Any:
    """Return a text with hidden characters escaped, or a rounded number; jinja2 escapes markup."""
    if isinstance(value, float):
        return round(value, 2)
    return _UNICODE.text(value) if isinstance(value, str) and not isinstance(value, Markup) else value


CENTRE = (210.0, 146.0)  # centre of the seat in its drawing
HOLE_CIRCLE = 112.0  # radius of the circle of holes in the drawing of a seat
_CHART_BOX = (50.0, 34.0, 466.0, 214.0)  # left, top, right and bottom of the axes in a chart
ENVELOPE_COLUMNS = 400  # number of columns of the envelope that replaces a curve with many points


def at(angle_deg: float, distance: float) -> tuple[float, float]:
    """Return the point in the drawing of a seat at an angle and a distance from its centre.

    angle_deg: angle counter-clockwise from the right; y points downwards in the drawing.
    distance: distance in units of the drawing.
    """
    return CENTRE[0] + distance * cos(radians(angle_deg)), CENTRE[1] - distance * sin(radians(angle_deg))


@dataclass(frozen=True)
class _ChartAxes:
    """Axes of a chart.

    columns: numbers on the x axis.
    rows: numbers on the y axis; the first and the last are its ends.
    ends: ends of the x axis.
    """

    columns: list[float]
    rows: list[float]
    ends: tuple[float, float]

    @classmethod
    def around(cls, figure: Curve) -> _ChartAxes:
        """Return axes that include the values, the limit and the whiskers of a figure with more than one point."""
        ends = float(figure.x[0]), float(figure.x[-1])
        columns = [tick for tick in ticks(*ends, 8) if ends[0] <= tick <= ends[1]]
        return cls(columns, ticks(*figure.ends, 5), ends)

    def right(self, x: float) -> float:
        """Return the horizontal coordinate of x in the drawing."""
        return _CHART_BOX[0] + (x - self.ends[0]) / (self.ends[1] - self.ends[0]) * (_CHART_BOX[2] - _CHART_BOX[0])

    def down(self, y: float) -> float:
        """Return the vertical coordinate of y in the drawing."""
        return _CHART_BOX[3] - (y - self.rows[0]) / (self.rows[-1] - self.rows[0]) * (_CHART_BOX[3] - _CHART_BOX[1])


def outline(figure: Curve, y: Array) -> list[tuple[float, float]]:
    """Return the points of a line or, for a line with many points, the corners of its envelope.

    The corners follow the largest values from left to right, then the smallest values from right to left.

    figure: curve with the x values.
    y: values of the line, shape (points,).
    """
    if len(figure.x) <= 2 * ENVELOPE_COLUMNS:
        return list(
            zip(
                figure.x.tolist(),
                y.tolist(),
                strict=True,
            )
        )
    (x, low), (_, high) = least_and_greatest(figure.x, y, ENVELOPE_COLUMNS, figure.over)
    return [*zip(x, high, strict=True), *zip(x[::-1], low[::-1], strict=True)]
