"""The explorer's application: the screen, and keys to actions."""

from __future__ import annotations

import asyncio
import signal
from collections import defaultdict
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.widgets import DataTable, Footer, Input, Static

from hdassist.explorer import state, words
from hdassist.explorer.compute import LeverEffects, Sure, is_any_hole, lever_effects
from hdassist.explorer.levers import Lever, levers, stepped
from hdassist.explorer.panes import MARKS, TORQUE_STYLES, Holes, Levers, seat_pane
from hdassist.explorer.saving import Saving
from hdassist.explorer.screens import Explain
from hdassist.explorer.state import Session
from hdassist.model.unknown import unknowns
from hdassist.mounting.positions import hole_words, usable_positions
from hdassist.run.stops import STOPS, end_at_stops
from hdassist.visible import visible

LINE_WIDGETS = ("head", "headline", "about", "looked-at", "advice-text", "command")
TOO_SMALL = "too small for the explorer: 60 x 18 at least. q quits."


class Explorer(Saving):
    """A drive turned on the screen. Arguments as those of `Asking`."""

    CSS_PATH = "app.tcss"
    TITLE = "hdassist explore"
    ENABLE_COMMAND_PALETTE = False
    # no class variables for mypy, as Textual declares them
    HORIZONTAL_BREAKPOINTS = [(0, "-tiny"), (60, "-narrow"), (100, "-normal"), (140, "-wide")]  # noqa: RUF012
    VERTICAL_BREAKPOINTS = [(0, "-flat"), (18, "-low"), (28, "-high"), (40, "-tall")]  # noqa: RUF012
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left,h", "turn(-1)", "turn", key_display="←→"),
        Binding("right", "turn(1)", "turn on", show=False),
        Binding("b", "look('best')", "look at the best", show=False),
        Binding("0,home", "look('')", "look at where it stands", show=False),
        Binding("1", "view('holes')", "views", key_display="1-3"),
        Binding("2", "view('seat')", "view the seat", show=False),
        Binding("3,l", "view('levers')", "levers", show=False),
        Binding("slash", "filter", "filter levers", show=False),
        Binding("u,ctrl+z", "change('undone')", "undo"),
        Binding("r,ctrl+y", "change('redone')", "redo", show=False),
        Binding("s", "save", "save"),
        Binding("question_mark", "explain", "explain", key_display="?"),
        Binding("q", "quit", "quit"),
    ]

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.holes, self.levers = Holes(id="holes"), Levers(id="levers")
        self.seat, self.panes = Static(id="seat", markup=False), Horizontal(id="panes", classes="holes")
        self.lines = {name: Static(id=name, markup=False) for name in LINE_WIDGETS}
        self.side, self.wanted = Vertical(id="side"), Input(placeholder="/ filters", id="filter", compact=True)

    def compose(self) -> ComposeResult:
        """Head, F'_ior, the panes, advice, the command line, the keys."""
        yield self.lines["head"]
        yield self.lines["headline"]
        with self.panes:
            yield self.holes
            yield self.seat
            with self.side:
                yield self.wanted
                yield self.levers
                yield self.lines["about"]
        yield self.lines["looked-at"]
        with VerticalScroll(id="advice"):
            yield self.lines["advice-text"]
        yield self.lines["command"]
        yield Footer(compact=True)
        yield Static(TOO_SMALL, id="too-small")

    def on_mount(self) -> None:
        """Ask the first questions."""
        self._end_when_told()
        self.seat.border_title, self.side.border_title = "SEAT, cam side", "LEVERS"
        self.side.border_subtitle = "step: greatest change, ″"
        self.query_one("#advice").border_title = "ADVICE"
        self.holes.focus()
        self.ask_of_drive()
        self.when_at_rest()
        self.draw()

    def _end_when_told(self) -> None:
        """End in order at a stop from outside, at once at a second one."""
        loop = asyncio.get_running_loop()

        def end(number: int) -> None:
            for each in STOPS:
                loop.remove_signal_handler(each)
            end_at_stops()
            self.exit(None, 128 + number)

        for number in STOPS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                with suppress(NotImplementedError, RuntimeError, ValueError):  # not here, or not in this thread
                    loop.add_signal_handler(number, end, number)

    # --- the screen

    def on_resize(self) -> None:
        """Draw with the new room."""
        self.call_after_refresh(self.draw)

    def ask_of_panes(self) -> None:
        """Ask for steps of levers, where they are on the screen and not there yet."""
        known, drive, headline = self.known, self.session.drive, self.known.headline
        if self.levers.region.width and known.effects is None and headline and headline.whole:
            known.effects = LeverEffects({})
            self.follow(partial(lever_effects, drive, headline.typical, self.effort), known, "levers")

    def draw(self) -> None:
        """Show the session and its answers."""
        if not self.holes.is_attached:
            return
        session, known, behind, letters = self.session, self.known, self.of_preset, self._letters()
        self.lines["head"].update(words.head(session))
        self.lines["headline"].update(words.headline(session, known, behind))
        self.holes.show(session, known.curve, behind.curve if behind else None, letters)
        self.lines["looked-at"].update(self._looked_at())
        self.seat.update(seat_pane(session, letters))
        self.holes.border_subtitle = words.stage(known, self.busy)
        changed = {path for path, _ in session.changes}
        self.levers.show(levers(session.drive, changed), known.effects, self.wanted.value)
        self.lines["advice-text"].update(words.advice_text(known, is_any_hole(session.drive)))
        self.lines["command"].update(visible(f"= {session.command()}"))

    def _letters(self) -> dict[float, str]:
        """Letters of positions by their turn [deg]: now, best, worst, to measure next, not allowed."""
        shown, drive = self.known, self.session.drive
        allowed, letters = usable_positions(drive.mounting.holes, drive.mounting.allowed), defaultdict(str, {0.0: "N"})
        if shown.curve and shown.advice:
            ranked = shown.advice.choice.ranked
            letters[ranked[0].rotation_deg] += "B"
            letters[ranked[-1].rotation_deg] += "W"
        if shown.advice and (following := words.next_deg(shown.advice)) is not None:
            letters[following] += "?"
        for at in {*self.session.positions} - {*allowed}:
            letters[at] += "x"
        return letters

    def _looked_at(self) -> Text:
        """Where the wheel is looked at, and F'_ior there."""
        session, curve, text = self.session, self.known.curve, Text()
        turn = session.turn_deg
        text.append(f"{hole_words(turn, session.drive.mounting.holes)}{', where it stands' * (not turn)}")
        if curve is None:
            return text.append(", directions unknown: any hole" * is_any_hole(session.drive))
        if (place := curve.place(turn)) is not None:
            now = curve.F_ior_arcsec[1, :, curve.rotations_deg.index(0.0)]
            for k, value in enumerate(curve.F_ior_arcsec[1, :, place]):
                change = f" {value / max(now[k], 1e-9) - 1:+.0%}" if turn else ""
                text.append(
                    f"  {session.drive.operation.M_g[k]:g} N·m {value:.1f}″{change}",
                    TORQUE_STYLES[k % len(TORQUE_STYLES)],
                )
            sure = curve.sure[place]
            at_zero = sure is not Sure.RANGE and unknowns(session.drive)
            text.append(f"  {MARKS[sure]} {sure}{', unknown as 0' if at_zero else ''}")
        return text

    @on(DataTable.RowHighlighted)
    def look_at(self, event: DataTable.RowHighlighted) -> None:
        """Look at the wheel in the hole under the cursor, or explain the field there."""
        if event.data_table is self.levers:
            lever = self._lever()
            self.lines["about"].update(f"{lever.path}: {lever.words}" if lever else "")
        elif (key := self.holes.key) and key != f"{self.session.turn_deg}":
            self.show(replace(self.session, turn_deg=float(key)))

    def _lever(self) -> Lever | None:
        """The field under the cursor."""
        return next((each for each in levers(self.session.drive, set()) if each.path == self.levers.key), None)

    @on(Input.Changed, "#filter")
    def filtered(self) -> None:
        """Show the levers that are looked for."""
        self.draw()

    @on(Input.Submitted, "#filter")
    def to_levers(self) -> None:
        """Go from the filter to the levers."""
        self.levers.focus()

    # --- actions

    def action_view(self, name: str) -> None:
        """Show a pane where not all of them have room, and go to it."""
        self.panes.set_classes(name)
        (self.levers if name == "levers" else self.holes).focus()
        self.call_after_refresh(self.draw)
        self.when_at_rest()

    def action_filter(self) -> None:
        """Go to the filter of the levers."""
        self.action_view("levers")
        self.wanted.focus()

    def action_turn(self, by: int) -> None:
        """Look at the wheel so many positions further."""
        self.show(state.turned_state(self.session, by))

    def action_look(self, where: str) -> None:
        """Look at the best position by now, or at where the wheel stands."""
        best = next((at for at, signs in self._letters().items() if "B" in signs), self.session.turn_deg)
        self.show(replace(self.session, turn_deg=best if where else 0.0))

    def action_change(self, name: str) -> None:
        """Go on with the session as a function of `state` makes it."""
        self.change(getattr(state, name))

    @on(DataTable.RowSelected, "#levers")
    def edit(self) -> None:
        """Ask for another value of the field under the cursor."""
        if lever := self._lever():
            title = f"{lever.path}, {lever.unit}" if lever.unit else lever.path
            hint = f"{lever.words}. Empty takes a change back."

            def change(session: Session, value: str) -> Session:
                return state.edited(session, lever.path, value)

            self.fill_in(
                title,
                lever.text,
                hint,
                lambda value: self.change(lambda session: change(session, value)),
                lambda value: change(self.session, value),
            )

    def action_nudge(self, steps: int) -> None:
        """Change the field under the cursor by steps."""
        path = self.levers.key
        if path and (value := stepped(self.session.drive, path, steps)) is not None:
            self.change(lambda s: state.edited(s, path, value))

    def action_explain(self) -> None:
        """Explain the screen."""
        self.push_screen(Explain())
