"""Panes and lines of the explorer: F'_ior by torque and hole, seat, inputs, revolution, and recommendation."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import ClassVar

from rich.console import Group, RenderableType
from rich.table import Table as RichTable
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import VerticalScroll
from textual.message import Message
from textual.widgets import DataTable, Static

from hdassist.belief.evidence import measured_errors
from hdassist.belief.prior import prior_of
from hdassist.drive.preset.fields import ResolvedField, resolved_fields, text_of
from hdassist.features.design import DesignCheck
from hdassist.features.mounting.positions import bare
from hdassist.features.report import Block, Curve, Facts, Lines, Paragraph, Report, Seat, SeatMark, four_digits
from hdassist.interface.explorer.asking import Known
from hdassist.interface.explorer.compute import (
    SURE_PROVEN,
    SURE_RANGE,
    SURE_REFINED,
    LeverEffects,
    SeatCurve,
    typical_of,
)
from hdassist.interface.explorer.state import SETTING_SECTIONS, Session
from hdassist.interface.pages.card import TRADE, seat_holes
from hdassist.interface.pages.check import F_ior_table, steps_tables
from hdassist.interface.pages.mount import order_and_reason
from hdassist.interface.terminal.page import block_on_page
from hdassist.interface.terminal.plot import SEAT_WIDTH, seat_in_characters, ticks
from hdassist.interface.terminal.streams import Style
from hdassist.interface.terminal.words import named, proof
from hdassist.run.errors import Verdict
from hdassist.run.files import visible

# one sign for each torque, in the sequence of _BAR_LINES
MARKS = {SURE_REFINED: "○□△", SURE_PROVEN: "●■▲", SURE_RANGE: "◌▫▵"}
_BAR_LINES = "─═╌"  # lines of the bars of each torque
_INK: tuple[str, ...] = ("#0a8fa8", "#a87a00", "#b04ab0", "#2a9040")  # legible on a dark and on a light background
_RED = "#d04040"
# the screen would show these colours as greys, which are less legible than the default colour
if os.environ.get("NO_COLOR"):
    _INK = tuple("not dim" for _ in _INK)
    _RED = "not dim"
_LETTER_STYLES = {"B": f"{_INK[3]} bold", "W": f"{_RED} bold", "?": f"{_INK[2]} bold"}
_LETTER_KINDS = {"N": "now", "B": "best", "W": "worst", "?": "next"}
_SEAT_WORDS = {"N": "now", "B": "best", "W": "worst", "?": "measure next", "x": "not allowed", "o": "selected"}
_LEAST_BAR = 14  # smallest width of a bar with ranges beside it, in columns
_LEAST_PANE = 10  # smallest width of a pane with text, in columns
_LEGEND_COLUMNS = 60  # smallest width of a pane with a legend beside the seat, in columns
# angles in the middle of the seat
_TICKS = tuple(
    SeatMark(kind="cam", angle_deg=float(angle_deg), letter=f"{angle_deg}", words="") for angle_deg in (0, 90, 180, 270)
)


def _torque_style(place: int) -> str:
    """Return the style of a torque; place: index of the torque."""
    return _INK[place % len(_INK)]


def _torque_sign(place: int, sure: str = SURE_RANGE) -> str:
    """Return the sample bar of a torque, which can be distinguished without colour.

    place: index of the torque.
    sure: kind of verification.
    """
    line = _BAR_LINES[place % len(_BAR_LINES)]
    return f"{line}{MARKS.get(sure, MARKS[SURE_REFINED])[place % len(_BAR_LINES)]}{line}"


class KeyedTable(DataTable[Text]):
    """A table with rows by key, updated in place without losing the cursor."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left", "app.turn(-1)", "turn", key_display="←→"),
        Binding("right", "app.turn(1)", "", show=False),
    ]

    def on_mount(self) -> None:
        """Set a row cursor and no gaps between columns."""
        self.cursor_type = "row"
        self.cell_padding = 0

    class Resized(Message):
        """Message that the space of a table has changed."""

    def on_resize(self) -> None:
        """Request a redraw in the new size."""
        self.post_message(self.Resized())

    def fill(self, heads: Sequence[str], rows: Mapping[str, Sequence[Text]]) -> None:
        """Show rows under heads; if the table has the focus, the cursor stays on its row.

        heads: heads of the columns.
        rows: cells of each row, by key.
        """
        # columns are as wide as their widest cell
        columns = {head: max(map(len, (head, *cells))) for head, *cells in zip(heads, *rows.values(), strict=True)}
        with self.prevent(DataTable.RowHighlighted):
            shown = {str(column.label): column.width for column in self.columns.values()}
            # with the same rows, only changed cells are drawn and the cursor stays
            if shown == columns and [key.value for key in self.rows] == list(rows):
                for key, cells in rows.items():
                    for column, cell in zip(self.columns, cells, strict=True):
                        if self.get_cell(key, column) != cell:
                            self.update_cell(key, column, cell)
                return
            before = self.key
            # with other rows or widths, the table is rebuilt
            self.clear(columns=True)
            for head, width in columns.items():
                self.add_column(Text(head), width=width)
            for key, cells in rows.items():
                self.add_row(*cells, key=key)
            if before in rows and self.has_focus:
                self.move_cursor(row=self.get_row_index(before))

    @property
    def key(self) -> str:
        """Key of the row under the cursor; empty without rows."""
        return str(self.coordinate_to_cell_key(self.cursor_coordinate).row_key.value) if self.row_count else ""


class Holes(KeyedTable):
    """F'_ior in each position of the fixed wheel: numbers, and a bar from the 5th to the 95th percentile."""

    def show(
        self,
        session: Session,
        found: SeatCurve | None,
        behind: SeatCurve | None,
        letters: Mapping[float, str],
    ) -> None:
        """Show the positions.

        session: the session.
        found: F'_ior in its positions.
        behind: F'_ior of another variant.
        letters: letters of positions, by rotation [deg].
        """
        readings = measured_errors(session.drive)
        limits = [limit for M_g in session.drive.operation.M_g if (limit := session.drive.limit(M_g))]
        # all bars have the same scale
        top = _top_of_bars(found, [reading.value for reading in readings], limits)
        places = sorted({*session.positions, *letters, *(reading.rotation_deg for reading in readings)})
        heads = [f" {M_g:g} N·m" for M_g in session.drive.operation.M_g] if found else []
        blank = [Text() for _ in heads]
        # each torque has a range, or an empty cell before the result
        numbers = {place: values_of(found, place) or blank for place in places}
        is_narrow = self._room(numbers, heads) < _LEAST_BAR
        if is_narrow:  # medians leave more space for bars
            numbers = {place: values_of(found, place, medians=True) or blank for place in places}
        width = max(self._room(numbers, heads), 1)
        rows = {}
        for place in places:
            # measured values of this position
            measured = [reading.value for reading in readings if abs(reading.rotation_deg - place) < 1e-6]
            # the pinned drive is drawn behind the present one
            marks = [*_range_marks(found, behind, place, [limit for limit in limits if limit <= top])]
            marks += [(value, value, "◆", _INK[2]) for value in measured]
            name = _place_name(session, place, letters.get(place, "") + ("◆" if measured else ""))
            rows[f"{place}"] = name, *numbers[place], _bar(width, top, marks)
        scale = f" 0{f'{top:g}″':>{max(width - 2, 1)}}"
        self.fill(["hole" if session.drive.mounting.holes else "turn", *heads, scale if found else ""], rows)
        self.border_title = "F'_ior by hole, ″"
        if found and SURE_RANGE in found.sure:
            self.border_title += ": median" if is_narrow else ": 5 to 95 %"
        present_row = f"{session.turn_deg}"
        # the cursor follows keys that turn the wheel
        if present_row in rows and self.key != present_row:
            # the move must not count as a key of the user
            with self.prevent(DataTable.RowHighlighted):
                self.move_cursor(row=self.get_row_index(present_row))

    def _room(self, numbers: Mapping[float, Sequence[Text]], heads: Sequence[str]) -> int:
        """Return the width in columns for bars beside numbers under heads."""
        by_torque = zip(
            heads,
            zip(*numbers.values(), strict=True),
            strict=False,
        )
        return self.size.width - 11 - sum(max(len(head), *map(len, cells)) for head, cells in by_torque)


def _top_of_bars(
    found: SeatCurve | None,
    measured: Sequence[float],
    limits: Sequence[float],
) -> float:
    """Return the upper end of the bars [arcsec]: a tick above all values, or above the limits without values."""
    errors = found.F_ior_arcsec.max(axis=(1, 2)).tolist() if found else limits
    return ticks(0.0, max([0.1, *measured, *errors]), 5)[-1]


def _place_name(
    session: Session,
    place_deg: float,
    signs: str,
) -> Text:
    """Return the name of a position with its signs, in bold for the selected one."""
    style = "bold" if place_deg == session.turn_deg else ""
    name = Text(f"{bare(place_deg, session.drive.mounting.holes):>4} {signs:4.4}", style)
    name.highlight_regex("B", _LETTER_STYLES["B"])
    return name


def _range_marks(
    found: SeatCurve | None,
    behind: SeatCurve | None,
    place_deg: float,
    limits: Sequence[float],
) -> Iterator[tuple[float, float, str, str]]:
    """Yield the marks of a position in drawing order: other variant, ranges, limits, medians.

    A mark has two ends [arcsec], a sign and a style.

    found: F'_ior of the drive.
    behind: F'_ior of the other variant.
    place_deg: the position [deg].
    limits: limits within the bar [arcsec].
    """
    for _, middle, _ in _seat_ranges(behind, place_deg):
        yield middle, middle, "┄", "dim"
    surety = found.surety(place_deg) if found else ""
    ranges = _seat_ranges(found, place_deg)
    for k, (low, _, high) in enumerate(ranges):
        yield low, high, _torque_sign(k, surety)[0], _torque_style(k)
    for limit in limits:
        yield limit, limit, "│", _RED
    for k, (_, middle, _) in enumerate(ranges):
        yield middle, middle, _torque_sign(k, surety)[1], _torque_style(k)


def _seat_ranges(found: SeatCurve | None, rotation_deg: float) -> list[list[float]]:
    """Return the 5th, 50th and 95th percentiles of F'_ior [arcsec] in a position, one list per torque.

    The result is empty if there are no results for the position.
    """
    place = found.place(rotation_deg) if found else None
    return found.F_ior_arcsec[:, :, place].T.tolist() if found and place is not None else []


def values_of(
    found: SeatCurve | None,
    rotation_deg: float,
    *,
    medians: bool = False,
) -> list[Text]:
    """Return F'_ior in a position as text, one per torque: a single value, two percentiles, or the median.

    found: F'_ior over the positions.
    rotation_deg: the position [deg].
    medians: whether medians are returned instead of the 5th and 95th percentiles.
    """
    texts = []
    for k, (low, middle, high) in enumerate(_seat_ranges(found, rotation_deg)):
        text = f"{low:.2f}" if high <= low else f"{middle:.1f}" if medians else f"{low:.1f}…{high:.1f}"
        texts.append(Text(f" {text:>6}", _torque_style(k)))
    return texts


def _bar(
    width: int,
    top: float,
    marks: Iterable[tuple[float, float, str, str]],
) -> Text:
    """Return a row of signs from 0 to `top` [arcsec] with marks over their ranges; later marks are on top."""
    signs = [(" ", "") for _ in range(width)]
    for low, high, sign, style in marks:
        first, last = (min(round(value / top * (width - 1)), width - 1) for value in (low, high))
        for column in range(first, last + 1):
            signs[column] = (sign, style)
    return Text.assemble(*signs)


def seat_pane(
    session: Session,
    letters: Mapping[float, str],
    width: int,
) -> tuple[Text, str]:
    """Return the seat, seen from the wave generator side, and the legend of its letters.

    The drawing includes the legend if there is space beside it.
    """
    first = session.drive.mounting.first_hole
    named = [(angle_deg, sign) for angle_deg, signs in letters.items() for sign in signs if sign in _LETTER_KINDS]
    seat = Seat(
        title="",
        holes=seat_holes(session.drive),
        first_deg=first,
        turn_deg=session.turn_deg,
        places=tuple(
            SeatMark(kind=_LETTER_KINDS[sign], angle_deg=first + angle_deg, letter=sign, words="")
            for angle_deg, sign in named
        ),
        pointers=(*_TICKS, SeatMark(kind="now", angle_deg=first + session.turn_deg, letter="o", words="")),
        barred="x",
        legend="",
    )
    present = dict.fromkeys([*"".join(letters.values()), "o"])
    legend = [f"{sign} {label}" for sign, label in _SEAT_WORDS.items() if sign in present]
    lines = seat_in_characters(seat).split("\n")
    if width >= _LEGEND_COLUMNS:
        with_legend = zip_longest(
            lines,
            legend[: len(lines)],
            fillvalue="",
        )
        lines = [f"{line:{SEAT_WIDTH + 4}}{entry}".rstrip() for line, entry in with_legend]
    text = Text("\n".join(lines))
    for letter, style in _LETTER_STYLES.items():
        text.highlight_words([letter], style)
    return text, "  ".join(legend)


class Pane(VerticalScroll):
    """A scrollable pane with a title, which shows text or blocks of a page."""

    def __init__(self, name: str, title: str) -> None:
        super().__init__(id=name)
        self.border_title = title
        self._text = Static(markup=False)

    def compose(self) -> ComposeResult:
        """Yield the text."""
        yield self._text

    def show(self, *parts: RenderableType | Block, ascii: bool = False) -> None:
        """Show texts and blocks if the pane is wide enough for text."""
        style = Style(
            ascii=ascii,
            codes=False,
            width=self.scrollable_content_region.width,
        )
        if style.width >= _LEAST_PANE:
            shown = [[*block_on_page(part, style)] if isinstance(part, Block) else [part] for part in parts]
            self._text.update(Group(*(part for group in shown for part in group)))


class Levers(KeyedTable):
    """The fields of the preset with their values, and the effect of a plausible step of each."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("plus,equals_sign", "app.nudge(1)", "step", key_display="+ -"),
        Binding("minus", "app.nudge(-1)", "- step", show=False),
        Binding("o", "app.sort", "by group"),
        Binding("k", "app.keep_clearance", "x_b with W_0"),
    ]
    order: tuple[str, ...] = ()  # paths by their effect at the last sorting

    def sort_by_effect(self, effects: LeverEffects, torque: int) -> None:
        """Sort fields: first those in which the pinned drive differs, then by their change of F'_ior."""
        sizes = {path: abs(changes[torque]) for path, (_, changes) in effects.steps.items()}
        self.order = tuple(sorted(sizes, key=lambda path: (path not in effects.differing, -sizes[path])))

    def show(
        self,
        session: Session,
        effects: LeverEffects,
        torque: int,
        wanted: str,
        *,
        is_grouped: bool,
    ) -> None:
        """Show fields whose path or meaning contains all words of a filter.

        They are in the preset's sequence or sorted by their effect. Without a filter, fields that do not describe the
        drive are omitted.

        session: the session.
        effects: effects of steps.
        torque: index of the torque of the effects.
        wanted: words of the filter.
        is_grouped: whether fields are in the preset's sequence.
        """
        # the mark of a changed field replaces that of an uncertain field
        marks = {field.path: "?" for field in prior_of(session.drive).fields}
        marks |= {path: "*" for path, _ in session.changes}
        steps = effects.steps
        # every word must occur in the path or the meaning
        search_words = wanted.lower().split()
        shown_rows = {
            row.path: row
            for row in resolved_fields(session.drive)
            if all(word in f"{row.path} {row.meaning}".lower() for word in search_words)
            and (search_words or row.path in steps or row.path.split(".")[0] not in SETTING_SECTIONS)
        }
        # rows keep the sequence of the last sorting
        order = [] if is_grouped else [path for path in self.order if path in shown_rows]
        cells = {
            path: _lever_cells(shown_rows[path], marks, effects, torque)
            for path in dict.fromkeys([*order, *shown_rows])
        }
        # remaining width for the meaning of a field
        room = self.size.width - sum(max((len(row[k]) for row in cells.values()), default=0) for k in (0, 2, 3, 4)) - 2
        rows = {}
        for path, (name, meaning, *ranges) in cells.items():
            meaning.truncate(
                max(room, 0),
                overflow="ellipsis",
                pad=True,
            )
            rows[path] = name, Text(" ") + meaning, *ranges
        self.fill(["field", " meaning"[: room + 1], " value", " step", f" {'change':>7}"], rows)


def _lever_cells(
    field: ResolvedField,
    marks: Mapping[str, str],
    effects: LeverEffects,
    torque: int,
) -> tuple[Text, Text, Text, Text, Text]:
    """Return the table cells of a field: name and mark, meaning, value with unit, step, and change by the step.

    field: the field.
    marks: marks by path.
    effects: effects of steps.
    torque: index of the torque of the effects.
    """
    mark = marks.get(field.path, " ")
    by, changes = effects.steps.get(field.path, (0.0, ()))
    name = field.path.partition(".")[2]
    unit = "" if field.value is None else field.unit.replace("um", "µm").replace("N*m", "N·m").replace("deg", "°")
    value = visible(text_of(field.value))[: 13 - len(unit)]
    step = four_digits(abs(by))
    pinned = "pin " if field.path in effects.differing else ""
    return (
        Text.assemble(name, (f" {mark}", _INK[1] if mark == "?" else _INK[3])),
        Text(visible(field.meaning), "dim"),
        Text.assemble((f" {value}", _INK[3] if mark == "*" else ""), (f" {unit}", "dim")),
        Text(f" {pinned}{'-' if by < 0 else '+'}{step}" if changes else "", _INK[0]),
        Text(f" {changes[torque]:+7.2f}" if changes else "", _INK[0]),
    )


_WITH_UNIT = ("F'_ior", "5 to 95 %", "limit")  # columns of the headline with the unit arcsec
_VERDICT_STYLES: dict[str, str] = {
    Verdict.PASS: f"{_INK[3]} bold",
    Verdict.FAIL: f"{_RED} bold",
    Verdict.INCONCLUSIVE: f"{_INK[1]} bold",
}


def head_line(session: Session) -> Text:
    """Return a line with the drive, the numbers of its uncertain and changed inputs, and the pinned drive."""
    drive = session.drive
    line = Text(no_wrap=True, overflow="ellipsis")
    line.append(visible(drive.name), "bold")
    line.append(f"  {drive.gears.z_g}/{drive.gears.z_b}  {TRADE[drive.mounting.fixed]} fixed", "dim")
    counts = {"uncertain": prior_of(drive).fields, "changed": session.changes}
    line.append("".join(f"  {len(items)} {word}" for word, items in counts.items() if items), _INK[3])
    changed_count = len({*session.pinned.origin.overrides} - {*session.source.overrides, session.torques})
    changed = f" with {changed_count} changed" if changed_count else ""
    line.append(f"  vs {visible(session.pinned.name)}{changed}", _INK[2])
    return line.append("  x_b follows W_0" if session.keeps_clearance else "", _INK[1])


def headline(
    session: Session,
    known: Known,
    pinned: Known | None,
    torque: int,
    width: int,
) -> RichTable | Text:
    """Return F'_ior by torque as in `check`, as assembled and in the best hole.

    Before the result is complete, it shows the previous result and a typical drive before and after the change.

    session: the session.
    known: results for its drive.
    pinned: results for the pinned drive.
    torque: index of the marked torque.
    width: width in characters; columns without space are omitted.
    """
    shown = known.check or known.old
    if not shown or (known.failed and not known.check):
        return Text(f"F'_ior: {known.without}")
    columns = _check_columns(known, shown, torque)
    if known.first and known.old and not known.whole:
        F_ior_pairs = zip(
            typical_of(known.old)[1],
            known.first.F_ior_arcsec,
            strict=True,
        )
        columns["typical drive, ″"] = [
            f"{before:.2f} → {new:.2f} {MARKS[known.first.sure][0]}" for before, new in F_ior_pairs
        ]
    if "limit, ″" in columns:
        columns |= _limit_columns(known, shown, columns.pop("verdict"))
    if known.whole and pinned and pinned.whole:
        points = zip(
            shown.points,
            pinned.whole.points,
            strict=True,
        )
        changes = [point.F_ior_or_error - before.F_ior_or_error for point, before in points]
        columns["change, ″"] = [f"[{_INK[0]}]{change:+.2f}[/]" for change in changes]
    columns |= _best_hole_column(session, known, _surety(shown))
    return _table_within(columns, width)


def _surety(check: DesignCheck) -> str:
    """Return the kind of verification of F'_ior in a check: a range of samples, or every state solved."""
    return SURE_RANGE if check.samples else SURE_PROVEN


def _check_columns(
    known: Known,
    shown: DesignCheck,
    torque: int,
) -> dict[str, list[str]]:
    """Return the columns of a check in the headline by their heads, with a cell for each torque.

    known: results for the drive.
    shown: its check, or the previous one.
    torque: index of the marked torque.
    """
    basis = f"{shown.samples.effective:.0f} samples" if shown.samples else "every position"
    if shown is not known.check:
        basis = "old"
    if not known.whole:
        basis += " …"
    torques = [
        f"[{_torque_style(k)}]{'▸' if k == torque else ''}{point.M_g:g} N·m {_torque_sign(k, _surety(shown))}[/]"
        for k, point in enumerate(shown.points)
    ]
    columns = {basis: torques}
    page = F_ior_table(shown)
    for head, *cells in zip(page.heads, *page.rows, strict=True):
        if head in ("self error", page.heads[0]):
            continue
        name = "F'_ior" if head == "median" else head
        if name in _WITH_UNIT:
            name += ", ″"
        columns[name] = cells
    return columns


def _limit_columns(
    known: Known,
    shown: DesignCheck,
    verdicts: Sequence[str],
) -> dict[str, list[str]]:
    """Return verdict, margin and probability of meeting the limit, with a cell for each torque."""
    if shown is known.check and not known.whole:
        verdicts = ["…" for _ in verdicts]
    margins = []
    probabilities = []
    for point in shown.points:
        ends = point.held_arcsec
        margins.append(f"{point.limit_arcsec - ends[1]:+.2f}" if point.limit_arcsec and ends else "")
        probabilities.append(f"{100 * point.probability.value:.0f} %" if point.probability else "")
    return {
        "verdict": [f"[{_VERDICT_STYLES.get(word, 'dim')}]{word}[/]" for word in verdicts],
        "margin, ″": margins,
        "P(met)": probabilities,
    }


def _best_hole_column(
    session: Session,
    known: Known,
    surety: str,
) -> dict[str, list[str]]:
    """Return the column with F'_ior in the best hole; empty if the best hole is the present one or there is no result.

    session: the session.
    known: results for its drive.
    surety: kind of verification of the other columns, which the column must have.
    """
    advice = known.advice
    best_deg = advice.chosen.rotation_deg if advice and advice.word != "ANY_HOLE" else 0.0
    # nominal values are not shown beside medians
    if not best_deg or not known.curve or known.curve.surety(best_deg) != surety:
        return {}
    holes = session.drive.mounting.holes
    best_name = f"hole {bare(best_deg, holes)}" if holes else f"{bare(best_deg, holes)}°"
    medians = known.curve.F_ior_arcsec[1, :, known.curve.place(best_deg)]
    return {f"best: {best_name}, ″": [f"[{_INK[3]}]{value:.2f}[/]" for value in medians]}


def _table_within(columns: dict[str, list[str]], width: int) -> RichTable:
    """Return a table of the columns that fit in a width; the last columns are omitted first, and the verdict last."""
    columns = dict(columns)
    widths = {name: 2 + max(Text.from_markup(cell).cell_len for cell in (name, *columns[name])) for name in columns}
    for name in sorted(widths, key=lambda name: name != "verdict")[::-1]:
        if sum(widths[kept] for kept in columns) > width:
            del columns[name]
    table = RichTable(
        box=None,
        padding=(0, 2, 0, 0),
        header_style="dim",
    )
    for name in columns:
        table.add_column(name, justify="right", no_wrap=True)
    for cells in zip(*columns.values(), strict=True):
        table.add_row(*cells)
    return table


def order_words(known: Known) -> str:
    """Return the recommendation with its reasons, or the text that replaces a missing one."""
    return " ".join(known.report.why) if known.report else known.without


def next_text(known: Known) -> str:
    """Return a line with the recommendation and its reason, and another line with the next value to measure."""
    if not (known.advice and known.report):
        return known.without.replace("\n", " ")
    return visible("\n".join((" ".join(order_and_reason(known.advice)), *known.report.why[1:][-1:])))


def turn_blocks(page: Report, name: str) -> Iterator[Block]:
    """Yield the blocks of a page of `trace` for a pane.

    page: the page.
    name: turn for the first input revolution, cycle for the full cycle with the largest orders.
    """
    for block in reversed(page.blocks):
        if isinstance(block, Curve) and name == "turn":
            first = block.x < 1
            title = block.y_label.partition(":")[0]
            yield replace(
                block,
                x=block.x[first],
                y=block.y[first],
                y_label=title,
                over=0.0,
            )
        elif name == "cycle" and not isinstance(block, Facts):
            yield block


def why_blocks(known: Known) -> tuple[Block, ...]:
    """Return the contributions to the variance of F'_ior, the options, and other facts of `check`."""
    if not (whole_check := known.whole):
        return (Paragraph(known.without),)
    point = whole_check.points[whole_check.governing]
    shares = (f"{100 * influence.share:3.0f} % {named(influence.group)}" for influence in whole_check.influences)
    return (
        *steps_tables(whole_check),
        Lines(
            f"contributions to the variance of F'_ior at {point.M_g:g} N·m", tuple(shares) or ("no large contribution",)
        ),
        facts_of(known.page, "contributions", "measure"),
    )


def facts_of(report: Report | None, *left_out: str) -> Facts:
    """Return the labelled lines of a page, followed by its warnings and verification.

    report: the page; None gives no lines.
    left_out: labels that are omitted, in addition to the next command.
    """
    if not report:
        return Facts(())
    rows = [row for block in (*report.blocks, *report.details) if isinstance(block, Facts) for row in block.rows]
    rows += [("warning", warning) for warning in report.warnings]
    rows.append(("verified", proof(report.certificate, report.cross_checks)))
    return Facts.of(row for row in rows if row[0] not in ("next", *left_out))
