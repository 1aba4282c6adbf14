"""The panes and lines of the explorer: F'_ior by torque and hole, the seat, the levers, a cam turn, the advice."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

from rich.console import Group, RenderableType
from rich.table import Table as RichTable
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import VerticalScroll
from textual.widgets import DataTable, Static

from hdassist.belief.evidence import measured_errors
from hdassist.belief.prior import prior_of
from hdassist.design.check import OperatingPoint
from hdassist.explorer.asking import Known
from hdassist.explorer.compute import (
    SURE_PROVEN,
    SURE_RANGE,
    SURE_REFINED,
    LeverEffects,
    SeatCurve,
    is_any_hole,
    typical_of,
)
from hdassist.explorer.state import SETTING_SECTIONS, Session
from hdassist.mounting.positions import bare
from hdassist.pages.card import seat_holes
from hdassist.pages.check import F_ior_table, possible_steps
from hdassist.plaintext import visible
from hdassist.preset.fields import ResolvedField, resolved_fields, text_of
from hdassist.report import Block, Curve, Facts, Lines, Report, Seat, SeatMark, Table
from hdassist.terminal.page import block_on_page
from hdassist.terminal.plot import seat_in_characters, ticks
from hdassist.terminal.streams import Style
from hdassist.terminal.words import named, proof
from hdassist.verdict import Verdict

MARKS = {SURE_REFINED: "○", SURE_PROVEN: "●", SURE_RANGE: "◌"}  # else ○
INK = ("#0a8fa8", "#a87a00", "#b04ab0", "#2a9040")  # legible on a dark ground as on a light one
LETTER_STYLES = {"B": f"{INK[3]} bold", "W": "red bold", "?": f"{INK[2]} bold"}
LETTER_KINDS = {"N": "now", "B": "best", "W": "worst", "?": "best"}
LEAST_BAR = 10  # columns of a bar at least
TICKS = tuple(SeatMark("cam", float(at), f"{at}", "") for at in (0, 90, 180, 270))  # in the seat's middle


def torque_style(place: int) -> str:
    """The style of a torque by its place."""
    return INK[place % len(INK)]


class LeverTable(DataTable[Text]):
    """Rows by key, put in place without losing the cursor."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left", "app.turn(-1)", "turn", key_display="←→"),
        Binding("right", "app.turn(1)", "", show=False),
    ]

    def on_mount(self) -> None:
        """Have rows only."""
        self.cursor_type, self.show_header, self.cell_padding = "row", False, 0

    def fill(self, rows: Mapping[str, Sequence[Text]]) -> None:
        """Show rows; the cursor stays on its key while somebody uses it."""
        with self.prevent(DataTable.RowHighlighted):
            if [key.value for key in self.rows] == list(rows):
                for key, cells in rows.items():
                    for column, cell in zip(self.columns, cells, strict=True):
                        if self.get_cell(key, column) != cell:
                            self.update_cell(key, column, cell, update_width=True)
                return
            before = self.key
            self.clear(columns=True)
            self.add_columns(*[""] * len(next(iter(rows.values()), ())))
            for key, cells in rows.items():
                self.add_row(*cells, key=key)
            if before in rows and self.has_focus:
                self.move_cursor(row=self.get_row_index(before))

    @property
    def key(self) -> str:
        """Key of the row under the cursor; empty without rows."""
        return str(self.coordinate_to_cell_key(self.cursor_coordinate).row_key.value) if self.row_count else ""


class Holes(LeverTable):
    """F'_ior in each position of the fixed wheel: numbers, and a bar from its 5th to its 95th percentile."""

    def show(
        self,
        session: Session,
        found: SeatCurve | None,
        behind: SeatCurve | None,
        letters: Mapping[float, str],
    ) -> None:
        """Show positions.

        Arguments: session; found, their F'_ior; behind, that of another variant; letters by turn [deg].
        """
        drive, holes, readings = session.drive, session.drive.mounting.holes, measured_errors(session.drive)
        limits = [limit for M_g in drive.operation.M_g if (limit := drive.limit(M_g))]
        errors = [*(one.value for one in readings), *(found.F_ior_arcsec.max(axis=(1, 2)) if found else limits)]
        top = ticks(0.0, max([0.1, *errors]), 5)[-1]
        places = sorted({*session.positions, *letters, *(one.rotation_deg for one in readings)})
        width = self.size.width - max(len(values_of(found, at)) for at in places) - 12
        rows = {}
        for at in places:
            measured = [one.value for one in readings if abs(one.rotation_deg - at) < 1e-6]
            signs = f"{letters.get(at, '')}{'◆' * bool(measured)}"
            head = Text(f"{bare(at, holes):>4} {signs:4.4}", "bold" if at == session.turn_deg else "")
            head.highlight_regex("B", LETTER_STYLES["B"])
            marks = [(limit, limit, "│", "red") for limit in limits]
            marks += [(middle, middle, "┄", "dim") for _, middle, _ in seat_ranges(behind, at)]
            sure = MARKS.get(found.surety(at), "○") if found else ""
            for k, (low, middle, high) in enumerate(seat_ranges(found, at)):
                marks += [(low, high, "─", torque_style(k)), (middle, middle, sure, torque_style(k))]
            marks += [(value, value, "◆", INK[2]) for value in measured]
            rows[f"{at}"] = head, Text.assemble(" ", values_of(found, at), " "), _bar(max(width, LEAST_BAR), top, marks)
        self.fill(rows)
        self.border_title = f"F'_ior by hole, ″{f', bars 0 to {top:g}' * bool(found)}"
        if (here := f"{session.turn_deg}") in rows and self.key != here:
            with self.prevent(DataTable.RowHighlighted):
                self.move_cursor(row=self.get_row_index(here))


def seat_ranges(found: SeatCurve | None, rotation_deg: float) -> list[list[float]]:
    """5th percentile, median and 95th of F'_ior [arcsec] at each torque in a position; empty where there are none."""
    place = found.place(rotation_deg) if found else None
    return found.F_ior_arcsec[:, :, place].T.tolist() if found and place is not None else []


def values_of(found: SeatCurve | None, rotation_deg: float) -> Text:
    """F'_ior at each torque in a position: a value, or its 5th and 95th percentile."""
    text = Text()
    for k, (low, _, high) in enumerate(seat_ranges(found, rotation_deg)):
        words = f"{low:.1f}…{high:.1f}" if high > low else f"{low:.2f}"
        text.append(f"{words:>6} ", torque_style(k))
    return text


def _bar(width: int, top: float, marks: Iterable[tuple[float, float, str, str]]) -> Text:
    """A row of signs from 0 to a top [arcsec], each from a value to another one, in a style; later ones above."""
    signs = [(" ", "")] * width
    for low, high, sign, style in marks:
        first, last = (min(round(value / top * (width - 1)), width - 1) for value in (low, high))
        signs[first : last + 1] = [(sign, style)] * (last + 1 - first)
    return Text.assemble(*signs)


def seat_pane(session: Session, letters: Mapping[float, str]) -> Text:
    """The seat from the cam side: holes by number, letters of positions, and a pointer to the one looked at."""
    first = session.drive.mounting.first_hole
    named = [(at, sign) for at, signs in letters.items() for sign in signs if sign in LETTER_KINDS]
    seat = Seat(
        "", seat_holes(session.drive), first, session.turn_deg,
        tuple(SeatMark(LETTER_KINDS[sign], first + at, sign, "") for at, sign in named),
        (*TICKS, SeatMark("now", first + session.turn_deg, "o", "")), "x", "",
    )  # fmt: skip
    text = Text(seat_in_characters(seat))
    for letter in "BW?":
        text.highlight_words([letter], LETTER_STYLES[letter])
    return text


class Pane(VerticalScroll):
    """A pane with a title that shows text, or blocks of a page, and is scrolled where they have no room."""

    def __init__(self, name: str, title: str) -> None:
        super().__init__(id=name)
        self.border_title, self._text = title, Static(markup=False)

    def compose(self) -> ComposeResult:
        """The text."""
        yield self._text

    def show(self, *parts: RenderableType | Block, ascii: bool = False) -> None:
        """Show texts and blocks; one moment later where there is no room yet."""
        style = Style(ascii=ascii, codes=False, width=self.scrollable_content_region.width)
        if style.width >= LEAST_BAR:
            shown = [[*block_on_page(part, style)] if isinstance(part, Block) else [part] for part in parts]
            self._text.update(Group(*(part for each in shown for part in each)))


class Levers(LeverTable):
    """The fields of the preset with their values and the effect of a plausible step of each."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("plus,equals_sign", "app.nudge(1)", "step", key_display="+ -"),
        Binding("minus", "app.nudge(-1)", "- step", show=False),
        Binding("o", "app.sort", "by group"),
        Binding("k", "app.keep_clearance", "x_b with W_0"),
    ]

    def show(self, session: Session, effects: LeverEffects, torque: int, wanted: str, *, is_grouped: bool) -> None:
        """Show fields whose path or meaning has some words, in the preset's order or by their effect.

        Without words those that are no part of the drive are left out. Those in which a pinned drive differs come
        first, then those that change F'_ior most. Arguments: session; effects of steps at a torque, by its place;
        wanted words.
        """
        marks = {field.path: "?" for field in prior_of(session.drive).fields} | {
            path: "*" for path, _ in session.changes
        }
        steps, words = effects.steps, wanted.lower().split()
        found = [
            each
            for each in resolved_fields(session.drive)
            if all(word in f"{each.path} {each.meaning}".lower() for word in words)
            and (words or each.path in steps or each.path.split(".")[0] not in SETTING_SECTIONS)
        ]

        def change(field: ResolvedField) -> tuple[bool, float]:
            return field.path in effects.differing, abs(steps[field.path][1][torque]) if field.path in steps else -1.0

        rows = {}
        for field in found if is_grouped else sorted(found, key=change, reverse=True):
            mark, (by, changes) = marks.get(field.path, " "), steps.get(field.path, (0.0, ()))
            step = f" {'pin ' * (field.path in effects.differing)}{by:+.4g}: {changes[torque]:+.2f}" if changes else ""
            value = visible(text_of(field.value))[: 13 - len(field.unit)]
            rows[field.path] = (
                Text.assemble(field.path, (f" {mark}", INK[1] if mark == "?" else INK[3])),
                Text.assemble((value, INK[3] if mark == "*" else ""), (f" {field.unit}", "dim")),
                Text(step, INK[0]),
            )
        self.fill(rows)


VERDICT_STYLES: dict[str, str] = {
    Verdict.PASS: f"{INK[3]} bold",
    Verdict.FAIL: "red bold",
    Verdict.INCONCLUSIVE: f"{INK[1]} bold",
}


def why_no_card(report: Report | None) -> str:
    """Why there is no card of an advice; empty where there is one."""
    return "" if report else "nothing is proven yet"


def head_line(session: Session) -> Text:
    """The drive, how much of it is uncertain and changed, and the drive beside it."""
    drive, line = session.drive, Text(no_wrap=True, overflow="ellipsis")
    line.append(visible(drive.name), "bold")
    line.append(f"  {drive.gears.z_g}/{drive.gears.z_b}  {drive.mounting.fixed} wheel fixed", "dim")
    counts = {"uncertain": prior_of(drive).fields, "changed": session.changes}
    line.append("".join(f"  {len(found)} {word}" for word, found in counts.items() if found), INK[3])
    more = len({*session.pinned.origin.overrides} - {*session.source.overrides, session.torques})
    line.append(f"  vs {visible(session.pinned.name)}{f' with {more} changed' * (more > 0)}", INK[2])
    return line.append("  x_b keeps clearance" * session.keeps_clearance, INK[1])


def headline(session: Session, known: Known, pinned: Known | None, torque: int, width: int) -> RichTable | Text:
    """F'_ior by torque as `check` has it, as it stands and in the best hole; columns that have no room are left out.

    Arguments: session; known, of it; pinned, of the drive beside it; torque, the place of the one to mark; width,
    in characters. Before the answer is whole a typical drive, as it was and is, stands beside the old one.
    """
    found, whole = known.check or known.old, known.whole
    if not found or (known.failed and not known.check):
        return Text(f"F'_ior: {known.without}")
    page = F_ior_table(found)
    sure = f"{found.samples.effective:.0f} samples" if found.samples else "every state"
    state = f"{sure if found is known.check else 'old'}{'' if whole else ' …'}"
    torques = [f"[{torque_style(k)}]{'▸' * (k == torque)}{point.M_g:g} N·m[/]" for k, point in enumerate(found.points)]
    columns = {state: torques, **dict(zip(page.heads, map(list, zip(*page.rows, strict=True)), strict=True))}
    for name in ("self error", page.heads[0]):
        del columns[name]
    if known.first and known.old and not whole:
        both = zip(typical_of(known.old)[1], known.first.F_ior_arcsec, strict=True)
        columns["typical drive"] = [f"{before:.2f} → {now:.2f} {MARKS[known.first.sure]}" for before, now in both]
    if "limit" in columns:
        held = [(point.limit_arcsec, point.held_arcsec, point.probability) for point in found.points]
        verdicts = columns.pop("verdict")
        if found is known.check and not whole:
            verdicts = ["…"] * len(held)
        columns["verdict"] = [f"[{VERDICT_STYLES.get(word, 'dim')}]{word}[/]" for word in verdicts]
        columns["margin"] = [f"{limit - ends[1]:+.2f}" if limit and ends else "" for limit, ends, _ in held]
        columns["kept"] = [f"{100 * kept.value:.0f} %" if kept else "" for _, _, kept in held]
    if whole and pinned and pinned.whole:
        both = zip(map(middle_of, found.points), map(middle_of, pinned.whole.points), strict=True)
        columns["change"] = [f"[{INK[0]}]{now - before:+.2f}[/]" for now, before in both]
    best_deg = known.advice.choice.chosen.rotation_deg if known.advice else 0.0
    if best_deg and known.curve and not is_any_hole(session.drive):
        name, best = f"best: {bare(best_deg, session.drive.mounting.holes)}", known.curve.place(best_deg)
        columns[name] = [f"[{INK[3]}]{value:.2f}[/]" for value in known.curve.F_ior_arcsec[1, :, best]]
    widths = {name: 1 + max(Text.from_markup(cell).cell_len for cell in (name, *columns[name])) for name in columns}
    for name in reversed(widths):
        if sum(widths[name] for name in columns) > width:
            del columns[name]
    table = RichTable(box=None, padding=(0, 1, 0, 0), header_style="dim")
    for name in columns:
        table.add_column(name, justify="right", no_wrap=True)
    for cells in zip(*columns.values(), strict=True):
        table.add_row(*cells)
    return table


def middle_of(point: OperatingPoint) -> float:
    """The median of F'_ior [arcsec], or its value where all is known."""
    return point.F_ior_or_error


def order_words(known: Known) -> str:
    """The order with its reasons, or why there is none."""
    return " ".join(known.report.why) if known.report else known.without


def next_text(known: Known) -> str:
    """The order in a line, and in another one the first measurement with its gain."""
    gains = dict(facts_of(known.page).rows).get("measure", "")
    return visible(order_words(known).partition("\n")[0]) + f"\nmeasure next: {gains}" * bool(gains)


def turn_blocks(page: Report, name: str) -> Iterator[Block]:
    """The first cam turn of a page of `trace`, or its full cycle with its greatest orders."""
    for block in reversed(page.blocks):
        if isinstance(block, Curve) and name == "turn":
            first, words = block.x < 1, block.y_label.partition(":")[0]
            yield replace(block, x=block.x[first], y=block.y[first], y_label=words, over=0.0)
        elif name == "cycle" and not isinstance(block, Facts):
            yield block


def why_blocks(known: Known) -> tuple[Lines | Table | Facts, ...]:
    """Influences on F'_ior with their shares, what it would take, and other facts of check."""
    if not (found := known.whole):
        return (Lines("", (known.without,)),)
    point = found.points[found.least_sure]
    shares = (f"{100 * each.share:3.0f} % {named(each.group)}" for each in found.influences)
    return (
        possible_steps(found).table,
        Lines(f"share of the spread of F'_ior at {point.M_g:g} N·m", tuple(shares) or ("no field stands out",)),
        facts_of(known.page, "influence", "measure"),
    )


def facts_of(report: Report | None, *left_out: str) -> Facts:
    """The labelled lines of a page, its warnings and proof, without some labels; not the command to type next."""
    if not report:
        return Facts(())
    rows = [row for block in (*report.blocks, *report.details) if isinstance(block, Facts) for row in block.rows]
    rows += [("warning", each) for each in report.warnings]
    rows.append(("proof", proof(report.certificate, report.cross_checks)))
    return Facts.of(row for row in rows if row[0] not in ("next", *left_out))
