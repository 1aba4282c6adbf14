"""The panes of the explorer: F'_ior over the holes, the seat, the levers, a cam turn."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

import numpy as np
from rich.text import Text
from textual.binding import Binding, BindingType
from textual.widgets import DataTable, Static

from hdassist.error.trace import Trace
from hdassist.explorer.compute import LeverEffects, SeatCurve, Sure
from hdassist.explorer.levers import Lever
from hdassist.explorer.state import Session
from hdassist.mounting.positions import bare
from hdassist.mounting.trial import Trial
from hdassist.pages.seat import seat_holes
from hdassist.report.blocks import Curve, Seat, SeatMark
from hdassist.terminal.console import Style
from hdassist.terminal.plot import curve, ticks
from hdassist.terminal.seat import seat_in_characters
from hdassist.visible import visible

MARKS = {Sure.REFINED: "○", Sure.PROVEN: "●", Sure.RANGE: "◌"}
TORQUE_STYLES = ("cyan", "yellow", "magenta", "green")  # styles of the torques, one after the other
LETTER_STYLES = {"B": "green bold", "W": "red bold", "?": "magenta bold", "◆": "magenta"}
LETTER_KINDS = {"N": "now", "B": "best", "W": "worst", "?": "best"}
ORDERS = 5  # that a cam turn names, the greatest
LEAST_BAR = 10  # columns of a bar at least


class LeverTable(DataTable[Text]):
    """Rows by key, put in place without losing the cursor."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left", "app.turn(-1)", "turn", show=False),
        Binding("right", "app.turn(1)", "turn", show=False),
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
        trials: Sequence[Trial],
    ) -> None:
        """Show positions.

        Arguments: session; found, their F'_ior; behind, that of another variant; letters by turn [deg]; trials.
        """
        drive = session.drive
        limits = [limit for M_g in drive.operation.M_g if (limit := drive.limit(M_g))]
        highest = max(
            [0.1, *(one.F_ior_arcsec for one in trials), *(found.F_ior_arcsec.max(axis=(1, 2)) if found else ())]
        )
        highest = max([highest, *(limit for limit in limits if limit < 1.5 * highest)])
        top = ticks(0.0, highest, 5)[-1]
        values = {
            at: _values(found, at)
            for at in sorted({*session.positions, *letters, *(one.rotation_deg for one in trials)})
        }
        width = self.size.width - max(map(len, values.values())) - 12
        rows = {}
        for rotation, numbers in values.items():
            hole, signs = bare(rotation, session.drive.mounting.holes), letters.get(rotation, "")
            measured = [one.F_ior_arcsec for one in trials if abs(one.rotation_deg - rotation) < 1e-6]
            head = Text.assemble((f"{hole:>4} ", "bold" if rotation == session.turn_deg else ""))
            for sign in f"{signs}{'◆' * bool(measured)}"[:4].ljust(4):
                head.append(sign, LETTER_STYLES.get(sign, "bold"))
            bar = _bar(max(width, LEAST_BAR), top, rotation, found, behind, limits, measured)
            rows[f"{rotation}"] = (head, Text.assemble(" ", numbers, " "), bar)
        self.fill(rows)
        self.border_title = f"F'_ior in each hole, arcsec{f', bars 0 to {top:g}' * bool(found)}"
        if (at := f"{session.turn_deg}") in self.rows and self.key != at:
            with self.prevent(DataTable.RowHighlighted):
                self.move_cursor(row=self.get_row_index(at))


def _values(found: SeatCurve | None, rotation_deg: float) -> Text:
    """F'_ior at each torque in a position: a value, or its 5th and 95th percentile."""
    place, text = found.place(rotation_deg) if found else None, Text()
    if found is None or place is None:
        return text
    for k, (low, _, high) in enumerate(found.F_ior_arcsec[:, :, place].T.tolist()):
        words = f"{low:.1f}…{high:.1f}" if high > low else f"{low:.2f}"
        text.append(f"{words:>6} ", TORQUE_STYLES[k % len(TORQUE_STYLES)])
    return text


def _bar(
    width: int,
    top: float,
    rotation_deg: float,
    found: SeatCurve | None,
    behind: SeatCurve | None,
    limits: Iterable[float],
    measured: Iterable[float],
) -> Text:
    """A row of signs from 0 to a top [arcsec]: limits, the other variant, values with their range, trials."""
    signs = [(" ", "")] * width

    def put(value: float, sign: str, style: str) -> None:
        signs[min(round(value / top * (width - 1)), width - 1)] = (sign, style)

    for limit in limits:
        put(limit, "│", "red")
    for curve_, is_shown in ((behind, False), (found, True)):
        place = curve_.place(rotation_deg) if curve_ else None
        if curve_ is None or place is None:
            continue
        for k, (low, middle, high) in enumerate(curve_.F_ior_arcsec[:, :, place].T.tolist()):
            style = TORQUE_STYLES[k % len(TORQUE_STYLES)] if is_shown else "dim"
            for step in range(width if high > low and is_shown else 0):
                if low <= step / (width - 1) * top <= high:
                    put(step / (width - 1) * top, "─", style)
            put(middle, MARKS[curve_.sure[place]] if is_shown else "┄", style)
    for value in measured:
        put(value, "◆", "magenta")
    return Text.assemble(*signs)


def seat_pane(session: Session, letters: Mapping[float, str]) -> Text:
    """The seat from the cam side: holes by number, letters of positions, and a pointer to the one looked at."""
    first = session.drive.mounting.first_hole
    named = [(at, sign) for at, signs in letters.items() for sign in signs if sign in LETTER_KINDS]
    seat = Seat(
        "", seat_holes(session.drive), first, session.turn_deg,
        tuple(SeatMark(LETTER_KINDS[sign], first + at, sign, "") for at, sign in named),
        (SeatMark("now", first + session.turn_deg, "o", ""),), "x", "",
    )  # fmt: skip
    text = Text(seat_in_characters(seat))
    for letter in "BW?":
        text.highlight_words([letter], LETTER_STYLES[letter])
    return text


class Turn(Static):
    """The error over a cam turn with its greatest orders."""

    def show(self, found: Trace | None, style: Style) -> None:
        """Show a trace; None while it is computed."""
        if found is None:
            self.update(Text("computing …", "dim"))
            return
        if style.width < LEAST_BAR:
            return
        error = found.error
        rows = max(self.size.height - ORDERS - 4, 5)
        drawn = curve(style, Curve(np.degrees(error.states.phi_h), error.error_arcsec, "cam angle, deg", "", rows=rows))
        orders = sorted(found.orders, key=lambda order: -order.amplitude_arcsec)[:ORDERS]
        lines = [f"{each.per_cam_rev:6.2f} {each.amplitude_arcsec:7.2f}  {each.cause.split(';')[0]}" for each in orders]
        self.update(Text.assemble(drawn.lstrip("\n"), ("\n" + "\n".join(lines), "dim"), no_wrap=True, overflow="crop"))


class Levers(LeverTable):
    """The fields of the preset with their values and what a plausible step of each does."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("plus,equals_sign", "app.nudge(1)", "step", key_display="+ -"),
        Binding("minus", "app.nudge(-1)", "- step", show=False),
    ]

    def show(self, levers: Iterable[Lever], effects: LeverEffects | None, torque: int, wanted: str) -> None:
        """Show fields whose path or meaning has some words, those that change F'_ior most first."""
        steps = effects.steps if effects else {}
        words = wanted.lower().split()
        found = [each for each in levers if all(word in f"{each.path} {each.meaning}".lower() for word in words)]

        def change(lever: Lever) -> float:
            return abs(steps[lever.path][1][torque]) if lever.path in steps else -1.0

        rows = {}
        for lever in sorted(found, key=change, reverse=True):
            by, changes = steps.get(lever.path, (0.0, ()))
            ink = "green" if lever.mark == "*" else "dim" if lever.text == "unknown" else ""
            value = visible(lever.text)
            value = value if len(value) <= 12 else f"{value[:11]}…"
            rows[lever.path] = (
                Text.assemble(
                    f"{lever.path:.22}", (f" {lever.mark or ' '}", "yellow" if lever.mark == "?" else "green")
                ),
                Text.assemble((f"{value:>8}", ink), (f" {lever.unit}", "dim")),
                Text(f" {by:+g}: {changes[torque]:+.2f}" if changes else "", "cyan"),
            )
        self.fill(rows)
