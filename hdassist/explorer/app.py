"""The explorer's application: keys to actions, actions to another session, and answers to the screen."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from math import isfinite
from typing import Any, ClassVar

from textual import on
from textual.app import ComposeResult, SystemCommand
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.events import Resize
from textual.screen import Screen
from textual.widgets import ContentSwitcher, DataTable, Footer, Static

from hdassist.errors import HdassistError, UsageError
from hdassist.explorer import state, words
from hdassist.explorer.answers import Failed
from hdassist.explorer.levers import is_knob, levers, stepped, text_of
from hdassist.explorer.pictures import MARKS, Plotted
from hdassist.explorer.questions import FULL, Effort, TraceQuestion, TurnQuestion
from hdassist.explorer.screens import Confirm, Explain
from hdassist.explorer.service import Service
from hdassist.explorer.state import Session, Step
from hdassist.explorer.themes import THEMES
from hdassist.explorer.trial_entry import read, rig_of
from hdassist.explorer.views import Opened, Started, TraceView, TurnView
from hdassist.explorer.widgets import CurvePlot, Levers, Seat, Turned
from hdassist.explorer.writing import Writing
from hdassist.numerals import number_of
from hdassist.preset.fields import field_table
from hdassist.run.stops import STOPS, end_at_stops
from hdassist.visible import visible

NARROW, LOW = 100, 28  # columns and rows below which panes fold
OF_SEAT = ("turn", "trial", "drop_trial", "best", "stand", "levers", "undo", "redo", "pin", "card", "nudge")
LEAST = (60, 18)  # columns and rows that the screen needs


def _require_trace(values: tuple[str, ...]) -> None:
    """Raise UsageError for a torque that is none, or a file that has no name."""
    torque = number_of(values[1])
    if not (isfinite(torque) and torque):
        raise UsageError(f"{values[1]!r} is no torque", "in N·m, like 80")
    if not values[0]:
        raise UsageError("no file is named")


class Explorer(Writing):
    """A drive turned on the screen.

    Arguments: session, what is shown at first; service, which computes; effort, how much; options of `Asking`.
    """

    CSS_PATH = "app.tcss"
    TITLE = "hdassist explore"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left,h", "turn(-1)", "turn", key_display="←→"),
        Binding("right", "turn(1)", "turn on", show=False),
        Binding("t", "trial", "trial"),
        Binding("x", "drop_trial", "drop the last trial", show=False),
        Binding("b", "best", "look at the best", show=False),
        Binding("0,home", "stand", "look at where it stands", show=False),
        Binding("l", "levers", "levers"),
        Binding("1", "view('seat')", "view the seat", show=False),
        Binding("2", "view('turn')", "views", key_display="1 2 3"),
        Binding("3", "view('trace')", "view a trace", show=False),
        Binding("u,ctrl+z", "undo", "undo"),
        Binding("r,ctrl+y", "redo", "redo", show=False),
        Binding("p", "pin", "pin to compare", show=False),
        Binding("c", "card", "card"),
        Binding("s", "save", "save"),
        Binding("j", "json", "write JSON", show=False),
        Binding("g", "picture", "picture of the screen", show=False),
        Binding("y", "copy", "copy the command line", show=False),
        Binding("d", "theme", "dark or light", show=False),
        Binding("question_mark", "explain", "explain", key_display="?"),
        Binding("q", "quit", "quit"),
    ]

    def __init__(self, session: Session, service: Service, effort: Effort = FULL, **options: Any) -> None:
        super().__init__(session, service, effort, **options)
        self.head, self.command = Static(id="head"), Static(id="command", markup=False)
        self.seat, self.plot, self.levers = Seat(id="seat"), CurvePlot(id="curve"), Levers(id="levers")
        self.about, self.side = Static(id="about", markup=False), Vertical(id="side")
        self.trials, self.advice = Static(id="trials", markup=False), Static(id="advice-text", markup=False)
        self.too_small = Static(id="too-small")
        self.views, self.bottom = ContentSwitcher(initial="seat-view", id="views"), Horizontal(id="bottom")
        self.turn_view, self.trace_view = TurnView(), TraceView()
        self.trace_torque = 0.0  # N*m, of the trace that was compared

    def compose(self) -> ComposeResult:
        """Head, the views, trials and advice, the command line, the keys."""
        yield self.head
        with self.views:
            with Horizontal(id="seat-view"):
                yield self.seat
                yield self.plot
                with self.side:
                    yield self.levers
                    yield self.about
            yield self.turn_view
            yield self.trace_view
        with self.bottom:
            yield self.trials
            with VerticalScroll(id="advice") as advice:
                advice.border_title = "ADVICE"
                yield self.advice
        yield self.command
        yield Footer(compact=True)
        yield self.too_small

    def on_mount(self) -> None:
        """Ask the first questions."""
        self._end_when_told()
        self.seat.border_title, self.side.border_title, self.trials.border_title = (
            "SEAT, cam side",
            "LEVERS",
            "TRIALS",
        )
        self.seat.focus()
        self.ask_of_drive()
        self.ask_of_trials()
        self.draw()
        self._offer_kept()

    def _offer_kept(self) -> None:
        """Ask whether to go on with the session that was kept, if one was."""
        try:
            found = self.kept.read(self.session) if self.kept else None
        except HdassistError as error:
            self.complain(error)
            return
        if not found:
            return
        earlier, same_text = found

        def answered(sure: bool | None) -> None:
            if sure:
                self.settled = earlier.step
                self.show(earlier)

        since = "" if same_text else "\nThe preset has changed since."
        question = f"A session of this preset was kept:\n\n{earlier.command('explore')}\n{since}"
        self.push_screen(Confirm(question, "go on with it", "begin anew; the first change replaces it"), answered)

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

    def on_resize(self, event: Resize) -> None:
        """Fold panes where there is little room; say so where there is too little."""
        wide, high = event.size.width, event.size.height
        narrow = wide < NARROW
        self.set_class(narrow, "narrow")
        self.set_class(high < LOW, "low")
        tiny = wide < LEAST[0] or high < LEAST[1]
        self.set_class(tiny, "tiny")
        self.too_small.update(
            f"{wide} x {high} is too small for the explorer: {LEAST[0]} x {LEAST[1]} at least. q quits."
        )
        self.side.set_class(narrow and not self.has_class("levers"), "folded")

    # --- the screen

    def wants_slopes(self) -> bool:
        """Whether the levers are on the screen."""
        return not self.side.has_class("folded")

    def draw(self) -> None:
        """Show the session and what is known of it."""
        if not self.seat.is_attached:
            return
        session, known, of_trials, ink = self.session, self.known, self.of_trials, self.inks
        plotted = self._plotted()
        self.turn_view.draw()
        self.trace_view.draw()
        for picture in (self.seat, self.plot):
            picture.show(plotted)
        self.seat.drive = session.drive
        self.plot.border_title = f"F'_ior, arcsec{words.basis(known, of_trials)}"
        self.plot.border_subtitle = self._legend(plotted)
        self.head.update(words.head(session, known, ink))
        self.seat.border_subtitle = words.stage(known, of_trials, self.busy, ink).plain
        changed = {path for path, _ in session.changes}
        slopes = known.slopes.get(session.turn_deg)
        self.side.border_subtitle = "step: unknown as 0" if slopes and known.facts and known.facts.unknown else ""
        self.levers.fill(levers(session.drive, changed), slopes.changes if slopes else {}, ink)
        torque = rig_of(session.drive, session.rig).M_g
        self.trials.update(words.trials_text(session, torque, ink))
        self.advice.update(words.advice_text(session, known, of_trials, ink))
        self.command.update(visible(f"= {self.command_line()}"))

    def _plotted(self) -> Plotted:
        session, known, of_trials = self.session, self.known, self.of_trials
        curve, best, next_ = known.curve, None, None
        ghost = self.memory.of(Step(session.pinned)).curve if session.pinned != session.changes else None
        if known.advised and known.advised.settled:
            best = known.advised.best_deg
        if of_trials and (advised := of_trials.advised):
            ghost, curve, best, next_ = curve, advised.curve, advised.best_deg, advised.next_deg
            next_ = None if advised.settled else next_
        limits = {M_g: limit for M_g in session.drive.operation.M_g if (limit := session.drive.limit(M_g))}
        trials = tuple((t.rotation_deg, t.F_ior_arcsec) for t in read(session.trials, session.drive))
        torque = rig_of(session.drive, session.rig).M_g
        unknown = known.facts is not None and known.facts.any_hole
        empty = "no answer" if known.failed else "computing …"
        if unknown and not known.failed:
            empty = "\n".join(["directions unknown: any hole", "", *(words.belief(known) or [empty])])
        return Plotted(curve, session.turn_deg, ghost, limits, trials, torque, best, next_, empty)

    def _legend(self, plotted: Plotted) -> str:
        if plotted.curve is None:
            return ""
        ink = self.inks
        torques = "  ".join(f"[{ink.torque(t)}]━ {M_g:g}[/]" for t, M_g in enumerate(plotted.curve.torques))
        behind = "predicted" if self.session.trials else "pinned" if self.session.pinned else "preset"
        ghost = f"  [{ink.muted}]┄ {behind}[/]" if plotted.ghost else ""
        marks = {place.sure for place in plotted.curve.places}
        told = "".join(f"  {sign} {sure.lower()}" for sure, sign in MARKS.items() if sure in marks)
        room = self.plot.size.width > 24 + 12 * len(marks)
        return f"{torques} N·m{ghost}{told if room else ''}"

    @on(DataTable.RowHighlighted)
    def tell_about(self) -> None:
        """Say what the field under the cursor is."""
        path = self.levers.path
        found = next((each for each in levers(self.session.drive, set()) if each.path == path), None)
        told = f"{found.path}: {found.meaning}" + (f"; {found.range}" if found.range else "") if found else ""
        self.about.display = bool(told)
        self.about.update(told)

    def get_system_commands(self, screen: Screen[Any]) -> Iterable[SystemCommand]:
        """What the command palette lists: every action that has a key, by its meaning."""
        del screen
        for binding in self.BINDINGS:
            if isinstance(binding, Binding) and self.check_action(binding.action.partition("(")[0], ()):
                key = binding.key_display or binding.key.partition(",")[0]
                yield SystemCommand(binding.description, f"key {key}", partial(self.run_action, binding.action))

    # --- views

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Which actions there are: those of the seat only where it is on the screen."""
        del parameters
        return self.views.current == "seat-view" or action not in OF_SEAT

    def action_view(self, name: str) -> None:
        """Show the seat, the error over a cam turn, or a measured trace over the prediction."""
        self.views.current = f"{name}-view"
        self.bottom.display = name == "seat"
        self.turn_view.stop()
        {"seat": self.seat, "turn": self.turn_view, "trace": self.trace_view}[name].focus()
        if name == "turn":
            self.ask_of_turn()
        elif name == "trace" and not self.trace_view.file:
            self.ask_for_trace()
        self.refresh_bindings()
        self.draw()

    @property
    def torque(self) -> float:
        """Torque of the second view [N*m]."""
        torques = self.session.drive.operation.M_g
        return torques[self.turn_view.torque % len(torques)]

    @on(Started)
    def ask_of_turn(self) -> None:
        """Ask for the error over a cam turn as the wheel is looked at."""
        session, view = self.session, self.turn_view
        asked = TurnQuestion(session.drive, session.turn_deg, self.torque, view.start_deg, self.effort)
        self.follow(asked, view.take, "turn")
        self.draw()

    @on(Opened)
    def ask_for_trace(self) -> None:
        """Ask which trace is to be opened, and compare it."""
        torque = f"{min(self.session.drive.operation.M_g, key=abs):g}"
        fields = [("file", self.trace_view.file), ("torque on the rig, N·m", torque)]
        hint = "a column of cam angles and one of errors, as hdassist compare reads it"

        def take(values: tuple[str, ...]) -> None:
            self.compare(values[0], number_of(values[1]))

        self.fill_in("a measured trace over the prediction", fields, hint, take, _require_trace)

    def compare(self, file: str, M_g: float) -> None:
        """Compare a trace in a file with the drive as the wheel is looked at, at a torque [N*m]."""
        view = self.trace_view
        view.file, view.found, view.failed, self.trace_torque = file, None, None, M_g
        try:
            drive = self.session.source.drive((*self.session.turned_changes(), ("operation.M_g", f"[{M_g!r}]")))
        except HdassistError as error:
            view.take(Failed(error.message, error.hint))
            return
        self.follow(TraceQuestion(drive, file, M_g, self.effort), view.take, "trace")
        self.draw()

    def command_line(self) -> str:
        """The command that gives what is shown."""
        session = self.session
        if self.views.current == "turn-view":
            start = self.turn_view.start_deg
            more = ["--torque", f"{self.torque:g}", *(["--phi-g0", f"{start:g}"] if start else [])]
            return session.command("trace", *more)
        if self.views.current == "trace-view" and self.trace_view.file:
            return session.command("compare", self.trace_view.file, "--torque", f"{self.trace_torque:g}")
        return session.command()

    # --- actions

    def action_turn(self, by: int) -> None:
        """Look at the wheel so many positions further."""
        self.show(state.turned(self.session, by))

    def show(self, session: Session) -> None:
        """Go on with another session, and another cam turn where that is on the screen."""
        super().show(session)
        if self.views.current == "turn-view":
            self.ask_of_turn()

    def on_turned(self, event: Turned) -> None:
        """Look at the wheel where was clicked, in the nearest position."""
        near = min(self.session.positions, key=lambda p: abs((p - event.rotation_deg + 180) % 360 - 180))
        self.show(state.turned_to(self.session, near))

    def action_best(self) -> None:
        """Look at the best position by now."""
        plotted = self._plotted()
        if plotted.curve:
            best = plotted.best_deg if plotted.best_deg is not None else plotted.curve.best.rotation_deg
            self.show(state.turned_to(self.session, best))

    def action_stand(self) -> None:
        """Look at where the wheel stands."""
        self.show(state.turned_to(self.session, 0.0))

    def action_undo(self) -> None:
        """Take the last change back."""
        self.change(state.undone)

    def action_redo(self) -> None:
        """Make the change again that was taken back."""
        self.change(state.redone)

    def action_pin(self) -> None:
        """Compare with the drive as it is now; again: with the preset."""
        self.show(state.pinned(self.session))

    def action_trial(self) -> None:
        """Ask for trials."""
        session = self.session
        here = words.where(session.turn_deg, session.drive.mounting.holes)
        torque = rig_of(session.drive, session.rig).M_g
        hint = f"F'_ior in arcsec at {torque:g} N·m: 28.1 for {here}, or h4:17.3; several with blanks between"
        self._ask_change("add trials", "", hint, state.with_trials)

    def action_drop_trial(self) -> None:
        """Drop the last trial."""
        self.change(state.without_trial)

    @on(DataTable.RowSelected)
    def edit(self) -> None:
        """Ask for another value of the field under the cursor."""
        path = self.levers.path
        if path is None:
            return
        found = next(each for each in levers(self.session.drive, set()) if each.path == path)
        title = f"{path}, {found.unit}" if found.unit else path
        hint = f"{found.meaning}{f'; {found.range}' if found.range else ''}. Empty takes a change back."
        self._ask_change(title, found.text, hint, lambda s, value: state.edited(s, path, value))

    def _ask_change(self, title: str, text: str, hint: str, change: Callable[[Session, str], Session]) -> None:
        """Have a text filled in that changes the session."""

        def take(values: tuple[str, ...]) -> None:
            self.change(lambda s: change(s, values[0]))

        self.fill_in(title, [("", text)], hint, take, lambda values: change(self.session, values[0]))

    def action_nudge(self, steps: int) -> None:
        """Turn the knob of the field under the cursor by steps."""
        path = self.levers.path
        if path is None or not is_knob(field_table()[path]) or self.session.drive.value(path) is None:
            return
        value = stepped(field_table()[path], self.session.drive.number(path), steps)
        self.change(lambda s: state.edited(s, path, text_of(value)))

    def action_levers(self) -> None:
        """Unfold the levers, or fold them where there is little room."""
        if self.has_class("narrow"):
            self.toggle_class("levers")
            self.side.set_class(not self.has_class("levers"), "folded")
        (self.seat if self.side.has_class("folded") or self.levers.has_focus else self.levers).focus()
        self.when_at_rest()

    def action_theme(self) -> None:
        """Change between dark and light."""
        self.theme = THEMES[self.current_theme.dark].name  # the dark one stands first
        self.draw()

    async def action_quit(self) -> None:
        """Leave; where changes or trials are not saved, ask before. Asked again over a question, leave at once."""
        if self.session.step == self.settled or isinstance(self.screen, Confirm):
            self.exit()
            return

        def answered(keep: bool | None) -> None:
            if keep is False and self.kept:
                with suppress(HdassistError, OSError):
                    self.kept.put_back()
            if keep is not None:
                self.exit()

        told = f"They are not kept: {self.unkept}" if self.unkept else "They are kept for next time."
        question = f"Changes and trials of this session are in no preset. {told}\nEscape stays, s saves the preset."
        self.push_screen(Confirm(question, "leave", "leave, and do not keep them"), answered)

    def action_explain(self) -> None:
        """Explain what is on the screen."""
        self.push_screen(Explain())
