"""The explorer's application: the screen, and keys to actions."""

from __future__ import annotations

import asyncio
import signal
from collections import defaultdict
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.content import Content
from textual.events import DescendantFocus
from textual.widgets import DataTable, Input, Static

from hdassist.explorer import state, words
from hdassist.explorer.compute import (
    LeverEffects,
    cam_turn,
    drive_answers,
    is_any_hole,
    lever_effects,
)
from hdassist.explorer.export import Exporting
from hdassist.explorer.levers import about_field, stepped
from hdassist.explorer.panes import MARKS, Holes, Levers, Pane, seat_pane, values_of
from hdassist.explorer.screens import EXPLAINED, Form, Notice
from hdassist.explorer.state import Session
from hdassist.model.unknown import unknowns
from hdassist.mounting.positions import hole_words, usable_positions
from hdassist.plaintext import visible
from hdassist.preset.fields import ResolvedField, resolved_fields, text_of
from hdassist.report import Paragraph
from hdassist.run.stops import end_at_stops

LINES = ("head", "headline", "tabs", "looked-at", "next", "command", "keys", "about")
NO_BREAK = "\N{NO-BREAK SPACE}"
TOO_SMALL = "too small for the explorer: 60 x 18 at least. q quits."
VIEWS = {
    "holes": "holes",
    "seat": "seat",
    "levers": "levers",
    "turn": "cam turn",
    "cycle": "full cycle",
    "why": "why",
    "advice": "advice",
}


class Explorer(Exporting):
    """A drive turned on the screen. Arguments as those of `Asking`."""

    CSS_PATH = "app.tcss"
    TITLE = "hdassist explore"
    ENABLE_COMMAND_PALETTE = False
    # no class variables for mypy, as Textual declares them
    HORIZONTAL_BREAKPOINTS = [(0, "-tiny"), (60, "-narrow"), (100, "-normal"), (140, "-wide")]  # noqa: RUF012
    VERTICAL_BREAKPOINTS = [(0, "-flat"), (18, "-low"), (24, "-middle"), (28, "-high"), (40, "-tall")]  # noqa: RUF012
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left", "turn(-1)", "turn", key_display="←→"),
        Binding("right", "turn(1)", "", show=False),
        ("b", "look('B')", "best"),
        ("0", "look('N')", "now"),
        *(Binding(f"{k}", f"view('{name}')", name, show=False) for k, name in enumerate(VIEWS, 1)),
        Binding("slash", "filter", "filter", key_display="/"),
        ("m", "torque", "torque"),
        ("e", "evidence", "evidence"),
        ("p", "change('pinned')", "pin"),
        ("u,ctrl+z", "change('undone')", "undo"),
        ("r,ctrl+y", "change('redone')", "redo"),
        ("c", "card", "card"),
        ("w", "report", "report"),
        ("s", "save", "save"),
        ("g", "picture", "picture"),
        ("y", "copy", "copy"),
        Binding("question_mark", "explain", "help", key_display="?"),
        ("q", "quit", "quit"),
    ]

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.holes, self.levers, self.is_grouped = Holes(id="holes"), Levers(id="levers"), False
        self.panes = {
            name: Pane(name, title.upper()) for name, title in VIEWS.items() if name not in ("holes", "levers")
        }
        self.lines = {name: Static(id=name, markup=False) for name in LINES}
        self.side, self.wanted = Vertical(id="side"), Input(placeholder="/ filters", id="filter", compact=True)
        self.all = Vertical(id="all", classes="holes")

    def compose(self) -> ComposeResult:
        """Head, F'_ior, tabs, the panes, the position looked at, the next step, the command line, the keys."""
        with self.all:
            yield from (self.lines[name] for name in LINES[:3])
            with Horizontal():
                with Vertical(id="left"):
                    yield self.holes
                    yield self.panes["cycle"]
                with Vertical(id="middle"):
                    yield self.panes["seat"]
                    yield self.panes["turn"]
                with Vertical(id="right"):
                    with self.side:
                        yield self.wanted
                        yield self.levers
                        yield self.lines["about"]
                    yield self.panes["why"]
                    yield self.panes["advice"]
            yield from (self.lines[name] for name in LINES[3:7])
        yield Static(TOO_SMALL, id="too-small")

    def on_mount(self) -> None:
        """Ask the first questions."""
        if not self.is_headless:  # else stops are those of the process that it runs in
            self._end_when_told()
        self.side.border_title = "LEVERS"
        self.holes.focus()
        self.ask_of_drive()
        self.when_at_rest()
        self.draw()

    def _end_when_told(self) -> None:
        """End in order at a stop from outside, at once at a second one; SIGHUP is that of the whole process."""
        loop = asyncio.get_running_loop()

        def end(number: int) -> None:
            for each in (signal.SIGINT, signal.SIGTERM):
                loop.remove_signal_handler(each)
            end_at_stops()
            self.exit(None, 128 + number)

        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:
                with suppress(RuntimeError):  # not in this thread
                    loop.add_signal_handler(number, end, number)

    # --- the screen

    def on_resize(self) -> None:
        """Draw with the new room."""
        self.call_after_refresh(self.draw)
        self.when_at_rest()

    def ask_of_panes(self) -> None:
        """Ask for what is on the screen and not there yet: the pinned drive, steps of levers, errors of a cam turn."""
        known, drive, pinned = self.known, self.session.drive, self.session.pinned
        if self.pinned and self.pinned.check is None:
            self.ask_once(partial(drive_answers, pinned, {}, self.effort), self.pinned, "pinned")
        if known.whole and self.levers.region.width:
            self.ask_once(partial(lever_effects, drive, pinned, known.typical, self.effort), known, "levers")
        if known.whole and (self.panes["turn"].region.width or self.panes["cycle"].region.width):
            where = self.session.turn_deg, self.M_g
            self.ask_once(partial(cam_turn, drive, self._of_turn(), *where), known, "turn")

    def _of_turn(self) -> Mapping[str, float]:
        """Typical values for a cam turn: none where all deviations are known."""
        return self.known.typical if unknowns(self.session.drive) else {}

    def draw(self) -> None:
        """Show the session and its answers."""
        if not self.holes.is_attached:
            return
        session, known, panes = self.session, self.known, self.panes
        letters, torque = self._letters(), self.torque % len(session.drive.operation.M_g)
        self.holes.show(session, known.curve, self.pinned.curve if self.pinned else None, letters)
        self.holes.border_subtitle = "" if known.advice or known.failed else "COMPUTING …"
        effects = known.effects or LeverEffects({})
        self.levers.show(session, effects, torque, self.wanted.value, is_grouped=self.is_grouped)
        typical = ", of a typical drive"
        self.side.border_subtitle = f"step: change at {self.M_g:g} N·m, ″{typical * bool(known.typical)}"
        panes["seat"].show(seat_pane(session, letters))
        panes["why"].show(*words.why_blocks(known), ascii=self.ascii)
        panes["advice"].show(Paragraph(words.order_words(known)), words.facts_of(known.report), ascii=self.ascii)
        for name in ("turn", "cycle"):
            panes[name].border_title = f"{VIEWS[name].upper()}{typical * bool(self._of_turn())}"
            blocks = words.turn_blocks(known.turn, name) if known.turn else [Text(known.without, "dim")]
            panes[name].show(*blocks, ascii=self.ascii)
        for name, line in {
            "head": words.head(session),
            "headline": words.headline(session, known, self.pinned, torque, self.size.width - 2),
            "tabs": self._tabs(),
            "looked-at": self._looked_at(),
            "next": words.next_text(known),
            "command": visible(f"= {self.command_line()}"),
            "keys": self._keys(),
        }.items():
            self.lines[name].update(line)

    def _tabs(self) -> Content:
        """The views by their keys, the one that is shown in reverse; a click goes to one."""
        tabs = [
            f"[{'reverse ' * self.all.has_class(name)}@click=app.view('{name}')] {k} {title} [/]"
            for k, (name, title) in enumerate(VIEWS.items(), 1)
        ]
        return Content.from_markup(" ".join(tabs))

    def _keys(self) -> Content:
        """Keys that work where the focus is; a click presses one."""
        keys: dict[str, str] = {}
        for active in self.screen.active_bindings.values():
            if (key := active.binding).show and active.enabled:
                words = f"[b]{self.get_key_display(key)}[/b] {key.description}".replace(" ", NO_BREAK)
                keys.setdefault(key.description, f"[@click=app.simulate_key('{key.key}')]{words}[/]")
        return Content.from_markup("  ".join(keys.values()))

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Whether an action can be done now."""
        session = self.session
        able = {"undone": session.past, "redone": session.future}
        return bool(able.get(str(*parameters), True)) if action == "change" else True

    @on(DescendantFocus)
    def show_keys(self) -> None:
        """Show the keys of another focus."""
        self.call_after_refresh(self.draw)

    def _letters(self) -> dict[float, str]:
        """Letters of positions by their turn [deg]: now, best, worst, to measure next, not allowed."""
        drive, letters = self.session.drive, defaultdict(str, {0.0: "N"})
        advice = self.known.advice
        if advice and not is_any_hole(drive):
            ranked = advice.choice.ranked
            letters[ranked[0].rotation_deg] += "B"
            letters[ranked[-1].rotation_deg] += "W"
        if advice and advice.next:
            letters[advice.next.rotation_deg] += "?"
        for at in {*self.session.positions} - {*usable_positions(drive.mounting.holes, drive.mounting.allowed)}:
            letters[at] += "x"
        return letters

    def _looked_at(self) -> Text:
        """Where the wheel is looked at, and F'_ior there."""
        session, curve, turn = self.session, self.known.curve, self.session.turn_deg
        text = Text(f"{hole_words(turn, session.drive.mounting.holes)}{', where it stands' * (not turn)}  ")
        text.append(values_of(curve, turn))
        if curve:
            text.append(f" {MARKS.get(curve.surety(turn), '')} {curve.surety(turn)}")
        return text

    @on(DataTable.RowHighlighted)
    def look_at(self, event: DataTable.RowHighlighted) -> None:
        """Look at the wheel in the hole under the cursor, or explain the field there."""
        if event.data_table is self.levers:
            field = self._field()
            self.lines["about"].update(about_field(field) if field else "")
        elif (key := self.holes.key) and key != f"{self.session.turn_deg}":
            self.show(replace(self.session, turn_deg=float(key)))

    def _field(self) -> ResolvedField | None:
        """The field under the cursor."""
        return next((each for each in resolved_fields(self.session.drive) if each.path == self.levers.key), None)

    @on(Input.Changed, "#filter")
    def filtered(self) -> None:
        """Show the levers that are looked for."""
        self.draw()

    @on(Input.Submitted, "#filter")
    def to_levers(self) -> None:
        """Go from the filter to the levers."""
        self.levers.focus()

    def command_line(self) -> str:
        """The command that gives the same answer."""
        if self.all.has_class("turn") or self.all.has_class("cycle"):
            return self.session.trace_command(self.M_g, self._of_turn())
        return self.session.command()

    # --- actions

    def action_view(self, name: str) -> None:
        """Show a pane where not all of them have room, and go to it."""
        self.all.set_classes(name)
        (self.levers if name == "levers" else self.panes[name] if name in ("why", "advice") else self.holes).focus()
        self.call_after_refresh(self.draw)
        self.when_at_rest()

    def action_filter(self) -> None:
        """Go to the filter of the levers."""
        self.action_view("levers")
        self.wanted.focus()

    def action_torque(self) -> None:
        """Show cam turn and levers at the next torque."""
        self.torque += 1
        self.when_at_rest()
        self.draw()

    def action_turn(self, by: int) -> None:
        """Look at the wheel so many positions further."""
        self.show(state.turned_state(self.session, by))

    def action_look(self, letter: str) -> None:
        """Look at the position that has a letter by now."""
        place = next((at for at, letters in self._letters().items() if letter in letters), self.session.turn_deg)
        self.show(replace(self.session, turn_deg=place))

    def action_change(self, name: str) -> None:
        """Change the session by a function of `state`."""
        self.change(getattr(state, name))

    def action_keep_clearance(self) -> None:
        """Have x_b change with W_0, or not."""
        self.show(replace(self.session, keeps_clearance=not self.session.keeps_clearance))

    def action_sort(self) -> None:
        """Show levers by group, or by their effect."""
        self.is_grouped = not self.is_grouped
        self.draw()

    def action_evidence(self) -> None:
        """Ask for the samples of the drive."""
        session = self.session
        hint = (
            f"K_1=3.1e4 lost_motion=50; h4=31 +- 2, F'_ior in a hole at {session.trial_torque:g} N·m; h4@80=31; "
            f"supports.C_3=5200 +- 260; limit=45; or the path of a trace measured in {session.here}. What stands "
            f"behind +- is k = 2, of F'_ior +- {2 * state.TRIALS.noise:g} without one; a name without a value, "
            f"like h4=, takes it back."
        )
        self._ask_change("what is known of this drive", "", hint, state.with_evidence)

    @on(DataTable.RowSelected, "#levers")
    def edit(self) -> None:
        """Ask for another value of the field under the cursor."""
        if field := self._field():
            title, hint = f"{field.path} {field.unit}", f"{about_field(field)}. Empty takes a change back."
            self._ask_change(title, text_of(field.value), hint, lambda s, value: state.edited(s, field.path, value))

    def _ask_change(self, title: str, text: str, hint: str, change: Callable[[Session, str], Session]) -> None:
        """Have a text filled in that changes the session."""
        self.push_screen(Form(title, text, hint, lambda value: self.show(change(self.session, value))))

    def action_nudge(self, steps: int) -> None:
        """Change the field under the cursor by steps."""
        path = self.levers.key
        if path and (value := stepped(self.session.drive, path, steps)) is not None:
            self.change(lambda s: state.edited(s, path, value))

    def action_explain(self) -> None:
        """Explain the screen."""
        self.push_screen(Notice(EXPLAINED))
