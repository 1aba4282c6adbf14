"""Application of the explorer: screen, actions of keys, forms, and the files that it writes."""

from __future__ import annotations

import asyncio
import re
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.content import Content
from textual.events import DescendantFocus
from textual.screen import ModalScreen
from textual.widgets import DataTable, Input, Static

from hdassist.drive.loading import with_changes
from hdassist.drive.model.deviations import unknowns
from hdassist.drive.preset.fields import ResolvedField, resolved_fields, text_of
from hdassist.features.mounting.positions import hole_words, usable_positions
from hdassist.features.report import Paragraph
from hdassist.interface.commands.bench import CARD_SUFFIXES, CardFile
from hdassist.interface.explorer import state
from hdassist.interface.explorer.asking import Asking
from hdassist.interface.explorer.compute import (
    LeverEffects,
    cam_turn,
    drive_answers,
    lever_effects,
)
from hdassist.interface.explorer.panes import (
    MARKS,
    Holes,
    KeyedTable,
    Levers,
    Pane,
    facts_of,
    head_line,
    headline,
    next_text,
    order_words,
    seat_pane,
    turn_blocks,
    values_of,
    why_blocks,
)
from hdassist.interface.explorer.state import Session, about_field, stepped
from hdassist.interface.pages.report import report_html, report_markdown
from hdassist.interface.terminal.streams import Style, put_text, require_writable
from hdassist.interface.terminal.words import texts
from hdassist.run.errors import HdassistError, UsageError
from hdassist.run.files import visible
from hdassist.run.stops import end_at_stops
from hdassist.run.system import hear_in_loop

_EXPLAINED = """\
SCREEN
The top shows F'_ior (the peak-to-peak kinematic error over the full mesh cycle) at each torque: median, 5th and 95th \
percentile over the uncertain inputs. It also shows the limit, the verdict of check, the margin from the 95th \
percentile to the limit, and the probability that the limit is met. The change is relative to the preset, or to the \
pinned drive; the best hole is shown with its F'_ior. The bars of the first torque look like ─◌─, those of the second \
like ═▫═.

After a change, the previous result remains visible and is marked old. F'_ior of a typical drive before and after the \
change is shown next to it.

Holes: F'_ior with the fixed wheel in each hole. Holes are numbered counter-clockwise from hole 0, seen from the wave \
generator side. Bars extend from the 5th to the 95th percentile, on one scale for all torques.
N now, B best, W worst, ? measure next, ◆ measured, x not allowed, o selected, │ limit.

Why: the contributions of the inputs to the variance, the options, and the questions to clarify.

VERIFICATION OF A NUMBER
REFINED ○ □  the extremes of the cycle were found by a search.
PROVEN ● ■  every mesh position of the cycle was solved and verified.
90 % RANGE ◌ ▫  median, and 5th to 95th percentile over the uncertain inputs.
The card is the same as that of mount, and it is written only if mount would write one for this drive.

INPUTS
? uncertain, * changed here. The value is followed by a plausible step, and by the resulting change of F'_ior \
[arcsec] for a typical drive. If a field is uncertain, a step is about one standard deviation. Fields in which the \
pinned drive differs come first, with the step to its value; then the fields with the largest change, in a sequence \
that stays the same until o sorts them again.
Enter edits the field; an empty value reverts a change. Both numbers of teeth change together: enter one of them (120) \
or the ratio (60:1).
k changes x_b with W_0, so that the flank clearance remains the same.

KEYS
1 to 7   holes, seat, inputs, revolution, full cycle, why, advice
Tab      next pane
/        filter inputs, by name or meaning
← → ↑ ↓  move the fixed wheel to another hole
b        best hole
0        present hole
m        next torque, marked ▸ at the top
e        enter known data of the drive: a stiffness, F'_ior in a hole, a recording or a limit. If F'_ior is given in \
several holes at the smallest torque, the recommendation is the same as that of mount with measured values
Enter    edit a field
+ -      a step up or down
o        inputs by group or by change
u r      undo, redo
p        pin the present drive, for comparison
c w s    write the card, the report, the preset
g y      write a picture, copy the command line
q        quit, and print the command that restores the session
"""


class Form(ModalScreen[None]):
    """A line to fill in, which stays open until its text is accepted; errors are shown below.

    title: title of the form.
    value: initial text.
    hint: hint below the line.
    take: function that is called with the text, and may raise HdassistError.
    """

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "dismiss(None)", "leave")]

    def __init__(
        self,
        title: str,
        value: str,
        hint: str,
        take: Callable[[str], None],
    ) -> None:
        super().__init__()
        self._title = title
        self._value = value
        self._hint = hint
        self._take = take

    def compose(self) -> ComposeResult:
        """Yield the line, the hint, and space for an error."""
        with Vertical(id="form") as form:
            form.border_title = visible(self._title)
            form.border_subtitle = "Enter accepts, Escape cancels"
            yield Input(self._value, select_on_focus=True)
            yield Static(
                visible(self._hint),
                id="hint",
                markup=False,
            )
            yield Static("", id="wrong", markup=False)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Accept the entered text, or show its error."""
        try:
            self._take(event.value.strip())
        # the form stays open with the entered text
        except HdassistError as error:
            self.query_one("#wrong", Static).update(visible(f"{error.message}\n{error.hint}".strip()))
            return
        self.dismiss()


class Notice(ModalScreen[bool | None]):
    """A text, or a question that is answered by y or n; other closing keys return None."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("y", "dismiss(True)", "yes"),
        Binding("n", "dismiss(False)", "no"),
        Binding("escape,question_mark,q,enter", "dismiss(None)", "close"),
    ]

    def __init__(self, text: str, *, asks: bool = True) -> None:
        super().__init__()
        self._text = text
        self._asks = asks

    def compose(self) -> ComposeResult:
        """Yield the text."""
        with VerticalScroll(id="notice") as scroll:
            scroll.border_subtitle = "y yes, n no, Escape cancels" if self._asks else "↑ ↓ scroll, Escape closes"
            yield Static(self._text, markup=False)


class _Exporting(Asking):
    """Actions that open a dialog and write a file."""

    def ask_in(self, dialog: ModalScreen[Any], then: Callable[[Any], object] = bool) -> None:
        """Open a dialog, call a function with its result, and update the screen."""

        def closed(answer: object) -> None:
            then(answer)
            self.draw()

        self.push_screen(dialog, closed)

    def named(self, end: str) -> str:
        """Return a file name that begins with the name of the preset."""
        return f"{Path(self.session.source.name).stem}{end}"

    def action_card(self) -> None:
        """Write the assembly card of the recommendation, if there is one."""
        advice = self.known.advice
        if advice is None:
            self.notify(visible(f"no card: {self.known.without}"), severity="warning", markup=False)
            return
        say = texts()
        hint = f"{', '.join(CARD_SUFFIXES)}; from {'the measured values' if advice.trials else 'the prediction'}"
        name = self.named("-card.html")
        self.ask_and_write_file("assembly card", name, hint, lambda path: CardFile(path, say).text(advice))

    def ask_and_write_file(
        self,
        title: str,
        name: str,
        hint: str,
        text: Callable[[str], str],
        written: Callable[[], object] = str,
    ) -> None:
        """Ask for a file name and write a text to that file; ask for confirmation if it exists.

        title: title of the form.
        name: suggested name.
        hint: hint in the form.
        text: function that returns the text for a file name.
        written: function that is called once the file is written.
        """

        def put(path: str, made: str) -> None:
            put_text(path, made)
            written()
            self.notify(visible(f"wrote {path}"), markup=False)

        def take(path: str) -> None:
            # text on standard output would overwrite the screen
            if path == "-":
                raise UsageError("the explorer's screen uses standard output", "name a file")
            require_writable(path, force=True)
            # the text is made before the question because it must belong to the present screen
            keep = partial(put, path, text(path))
            question = Notice(f"{path} exists. Replace it?")
            if Path(path).exists():  # the question is shown after the form has closed
                self.call_later(self.ask_in, question, lambda sure: self.attempt(keep) if sure else None)
            else:
                keep()

        self.ask_in(
            Form(
                title=f"{title}: file",
                value=name,
                hint=hint,
                take=take,
            )
        )

    def action_report(self) -> None:
        """Write the page of `check` with all its tables."""
        if not (report := self.known.page):
            self.notify("the report is not available before the result is complete", severity="warning")
            return

        def text(path: str) -> str:
            style = Style(
                ascii=self.ascii,
                codes=False,
                width=80,
            )
            return report_html(report) if path.endswith(".html") else report_markdown(report, style)

        hint = (
            "a name that ends in .html, or any other name for Markdown; contains the page of check, "
            "but not mount or stiffness"
        )
        self.ask_and_write_file("report", self.named("-check.html"), hint, text)

    def action_save(self) -> None:
        """Write the preset with the changes; comments and sequence remain unchanged."""
        source = self.session.source
        overrides = self.session.drive.origin.overrides
        # without a change, the file would be the same
        if not overrides:
            self.notify("no field is changed, so there is nothing to save")
            return
        name = source.file if Path(source.file).suffix else self.named("-changed.yaml")
        hint = "comments and order of the original are kept"
        saved = partial(setattr, self, "saved", self.session.changes)

        def changed_text(_path: str) -> str:
            return with_changes(source.text, source.file, overrides)

        self.ask_and_write_file("save the preset", name, hint, changed_text, saved)

    def action_picture(self) -> None:
        """Write the screen as SVG."""
        picture = without_fonts(self.export_screenshot())
        hint = "the current screen as SVG"
        self.ask_and_write_file("picture", self.named(".svg"), hint, lambda _: picture)

    def action_copy(self) -> None:
        """Copy the command line to the clipboard."""
        self.copy_to_clipboard(self.session.command())
        self.notify("command copied to the clipboard")

    async def action_quit(self) -> None:
        """Quit; ask for confirmation if there are unsaved or undone changes."""
        command = self.session.command("explore")
        question = f"Quit? The following command, which is also printed on exit, restores the session:\n\n{command}"
        # an undone change can be redone only in this session
        if self.session.changes != self.saved or self.session.future:
            self.ask_in(Notice(question), lambda sure: self.exit() if sure else None)
        else:
            self.exit()


def without_fonts(svg: str) -> str:
    """Return an SVG without external fonts, which is displayed with installed fonts."""
    return re.sub(r"\s*@font-face \{.*?\}", "", svg, flags=re.DOTALL)


_LINES = ("head", "headline", "tabs", "looked-at", "next", "command", "keys", "about")
_TOO_SMALL = "The explorer needs at least 60 x 18 characters. Press q to quit."
VIEWS = {
    "holes": "holes",
    "seat": "seat",
    "levers": "inputs",
    "turn": "revolution",
    "cycle": "full cycle",
    "why": "why",
    "advice": "advice",
}


class Explorer(_Exporting):
    """The explorer of a drive, with the arguments of `Asking`."""

    CSS_PATH = "app.tcss"
    TITLE = "hdassist explore"
    ENABLE_COMMAND_PALETTE = False
    # Textual declares these as ClassVar or None, so they have no annotation here for mypy
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
        self.holes = Holes(id="holes")
        self.levers = Levers(id="levers")
        self.is_grouped = False
        self.panes = {
            name: Pane(name, title.upper()) for name, title in VIEWS.items() if name not in ("holes", "levers")
        }
        self.lines = {name: Static(id=name, markup=False) for name in _LINES}
        self.side = Vertical(id="side")
        self.wanted = Input(
            placeholder="/ filters",
            id="filter",
            compact=True,
        )
        self.all = Vertical(id="all", classes="holes")

    def compose(self) -> ComposeResult:
        """Yield head, F'_ior, tabs, panes, selected position, next step, command line and keys."""
        with self.all:
            yield from (self.lines[name] for name in _LINES[:3])
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
            yield from (self.lines[name] for name in _LINES[3:7])
        yield Static(_TOO_SMALL, id="too-small")

    def on_mount(self) -> None:
        """Request the first results."""
        # a headless screen in a test leaves stops to its process
        if not self.is_headless:
            self._end_when_told()
        self.side.border_title = "INPUTS"
        self.holes.focus()
        self.ask_of_drive()
        self.when_at_rest()
        self.draw()

    def _end_when_told(self) -> None:
        """Exit properly at the first stop signal and immediately at the second; SIGHUP is handled by the process."""

        def end(number: int) -> None:
            end_at_stops()
            self.exit(None, 128 + number)

        hear_in_loop(asyncio.get_running_loop(), end)

    # --- the screen

    def on_resize(self) -> None:
        """Redraw in the new size."""
        self.call_after_refresh(self.draw)
        self.when_at_rest()

    @on(KeyedTable.Resized)
    def draw_again(self) -> None:
        """Redraw in the new size of a table."""
        self.draw()

    def ask_of_panes(self) -> None:
        """Request missing results of visible panes: pinned drive, steps of inputs, and error over a revolution."""
        known_data = self.known
        session = self.session
        effort = self.effort
        drive = session.drive
        pinned = session.pinned
        # each result is requested once, when its pane is visible
        if self.pinned and self.pinned.check is None:
            self.ask("pinned", self.pinned, drive_answers, pinned, {}, effort)
        # a pane without space is not drawn
        if known_data.whole and self.levers.region.width:
            self.ask("levers", known_data, lever_effects, drive, pinned, known_data.typical, effort)
        if known_data.whole and (self.panes["turn"].region.width or self.panes["cycle"].region.width):
            self.ask("turn", known_data, cam_turn, drive, self._of_turn(), session.turn_deg, self.M_g)

    def _of_turn(self) -> Mapping[str, float]:
        """Return the typical values of uncertain inputs for the revolution; empty if all deviations are known."""
        return self.known.typical if unknowns(self.session.drive) else {}

    def draw(self) -> None:
        """Show the session and its results."""
        # messages may arrive before the screen is built
        if not self.holes.is_attached:
            return
        session = self.session
        known = self.known
        panes = self.panes
        letters = self._letters()
        # the list of torques may have become shorter
        torque = self.torque % len(session.drive.operation.M_g)
        self.holes.show(session, known.curve, self.pinned.curve if self.pinned else None, letters)
        self.holes.border_subtitle = "" if known.advice or known.failed else known.without
        effects = known.effects or LeverEffects({})
        # rows are sorted only once, to prevent them from moving while the user reads
        if effects.is_whole and not self.levers.order:
            self.levers.sort_by_effect(effects, torque)
        self.levers.show(
            session,
            effects,
            torque,
            self.wanted.value,
            is_grouped=self.is_grouped,
        )
        typical = " of a typical drive"
        self.side.border_subtitle = f"change at {self.M_g:g} N·m, ″{typical if known.typical else ''}"
        seat = panes["seat"]
        drawing, seat.border_subtitle = seat_pane(session, letters, seat.scrollable_content_region.width)
        seat.show(drawing)
        panes["why"].show(*why_blocks(known), ascii=self.ascii)
        panes["advice"].show(
            Paragraph(order_words(known)),
            facts_of(known.report),
            ascii=self.ascii,
        )
        for name in ("turn", "cycle"):
            panes[name].border_title = f"{VIEWS[name].upper()}{typical if self._of_turn() else ''}"
            blocks = turn_blocks(known.turn, name) if known.turn else [Text(known.without, "dim")]
            panes[name].show(*blocks, ascii=self.ascii)
        for name, line in {
            "head": head_line(session),
            "headline": headline(session, known, self.pinned, torque, self.size.width - 2),
            "tabs": self._tabs(),
            "looked-at": self._looked_at(),
            "next": next_text(known),
            "command": visible(f"= {self.command_line()}"),
            "keys": self._keys(),
        }.items():
            self.lines[name].update(line)

    def _tabs(self) -> Content:
        """Return the views with their keys, with the visible one in reverse; a click selects a view."""
        tabs = [
            f"[{'reverse ' if self.all.has_class(name) else ''}@click=app.view('{name}')] {k} {title} [/]"
            for k, (name, title) in enumerate(VIEWS.items(), 1)
        ]
        return Content.from_markup(" ".join(tabs))

    def _keys(self) -> Content:
        """Return the keys available at the focus; a click simulates a key."""
        keys: dict[str, tuple[str, str]] = {}
        # a dialog shows its own keys, and the keys of the main screen do not work there
        if isinstance(self.screen, ModalScreen):
            return Content("")
        for active in self.screen.active_bindings.values():
            if (key := active.binding).show and active.enabled:
                keys.setdefault(key.description, (self.get_key_display(key), key.key))
        lines = [""]
        room = self.size.width - 2  # a key and its description are on one line
        for description, (display, name) in keys.items():
            width = len(f"  {display} {description}")
            # keys wrap as whole words
            if room < width:
                lines.append("")
                room = self.size.width - 2
            room -= width
            lines[-1] += f"[@click=app.simulate_key('{name}')][b]{display}[/b] {description}[/]  "
        return Content.from_markup("\n".join(lines))

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Return whether an action is available now."""
        session = self.session
        able = {"undone": session.past, "redone": session.future, "torque": session.drive.operation.M_g[1:]}
        return bool(able.get(str(*parameters) if action == "change" else action, True))

    @on(DescendantFocus)
    def show_keys(self) -> None:
        """Show the keys of the new focus."""
        self.call_after_refresh(self.draw)

    def _letters(self) -> dict[float, str]:
        """Return the letters of positions by rotation [deg]: now, best, worst, measure next, not allowed."""
        drive = self.session.drive
        letters = defaultdict(str, {0.0: "N"})
        advice = self.known.advice
        # among equal holes there is no best one
        if advice and advice.word != "ANY_HOLE":
            letters[advice.chosen.rotation_deg] += "B"
            letters[advice.worst.rotation_deg] += "W"
        if advice and advice.next:
            letters[advice.next.rotation_deg] += "?"
        for angle_deg in {*self.session.positions} - {*usable_positions(drive.mounting.holes, drive.mounting.allowed)}:
            letters[angle_deg] += "x"
        return letters

    def _looked_at(self) -> Text:
        """Return the selected position, and F'_ior there."""
        session = self.session
        curve = self.known.curve
        turn = self.session.turn_deg
        present = "" if turn else ", present hole"
        text = Text(f"{hole_words(turn, session.drive.mounting.holes)}{present}  ")
        for value in values_of(curve, turn):
            text.append(value).append("″")
        if curve:
            text.append(f" {MARKS.get(curve.surety(turn), ' ')[0]} {curve.surety(turn)}")
        return text

    @on(DataTable.RowHighlighted)
    def look_at(self, event: DataTable.RowHighlighted) -> None:
        """Select the hole under the cursor, or explain the field there."""
        if event.data_table is self.levers:
            field = self._field()
            self.lines["about"].update(about_field(field) if field else "")
        elif (key := self.holes.key) and key != f"{self.session.turn_deg}":
            self.show(replace(self.session, turn_deg=float(key)))

    def _field(self) -> ResolvedField | None:
        """Return the field under the cursor."""
        return next((row for row in resolved_fields(self.session.drive) if row.path == self.levers.key), None)

    @on(Input.Changed, "#filter")
    def filtered(self) -> None:
        """Show the inputs that match the filter."""
        self.draw()

    @on(Input.Submitted, "#filter")
    def to_levers(self) -> None:
        """Move the focus from the filter to the inputs."""
        self.levers.focus()

    def command_line(self) -> str:
        """Return the command that gives the same result."""
        if self.all.has_class("turn") or self.all.has_class("cycle"):
            return self.session.trace_command(self.M_g, self._of_turn())
        return self.session.command()

    # --- actions

    def action_view(self, name: str) -> None:
        """Focus a pane, and show it if the screen is too small for all panes."""
        self.all.set_classes(name)
        (self.levers if name == "levers" else self.panes[name] if name in ("why", "advice") else self.holes).focus()
        self.call_after_refresh(self.draw)
        self.when_at_rest()

    def action_filter(self) -> None:
        """Focus the filter of the inputs."""
        self.action_view("levers")
        self.wanted.focus()

    def action_torque(self) -> None:
        """Show revolution and inputs at the next torque."""
        self.torque += 1
        self.when_at_rest()
        self.draw()

    def action_turn(self, by: int) -> None:
        """Move the selection by a number of positions."""
        self.show(state.turned_state(self.session, by))

    def action_look(self, letter: str) -> None:
        """Select the position with a letter; show a message if no position has the letter."""
        place = next((angle_deg for angle_deg, letters in self._letters().items() if letter in letters), None)
        # before the recommendation, and among equal holes, no position has the letter of the best hole
        if place is None:
            message = order_words(self.known) if self.known.advice else f"no best hole yet: {self.known.without}"
            self.notify(visible(message), severity="warning", markup=False)
            return
        if place == self.session.turn_deg:
            self.notify(
                f"already shown: F'_ior with the wheel in {hole_words(place, self.session.drive.mounting.holes)}"
            )
        self.show(replace(self.session, turn_deg=place))

    def action_change(self, name: str) -> None:
        """Change the session by a function of `state`."""
        self.change(getattr(state, name))

    def action_keep_clearance(self) -> None:
        """Switch whether x_b changes with W_0."""
        self.show(replace(self.session, keeps_clearance=not self.session.keeps_clearance))

    def action_sort(self) -> None:
        """Switch between inputs by group and inputs sorted by their present effect."""
        self.is_grouped = not self.is_grouped
        if self.known.effects:
            self.levers.sort_by_effect(self.known.effects, self.torque % len(self.session.drive.operation.M_g))
        self.draw()

    def action_evidence(self) -> None:
        """Ask for known data of the drive: a stiffness, a value measured in a hole, a limit or a recording."""
        session = self.session
        hint = (
            f"For example K_1=3.1e4 lost_motion=50, h4=31 +- 2 (F'_ior in a hole at {session.trial_torque:g} N·m), "
            f"h4@80=31, supports.C_3=5200 +- 260, limit=45, or the path of a recording in {session.here}. +- is the "
            f"expanded uncertainty (k = 2); for F'_ior the default is {2 * state.TRIALS.noise:g}. A name without a "
            "value (h4=) removes the entry."
        )
        self._ask_change("known data of this drive", "", hint, state.with_evidence)

    @on(DataTable.RowSelected, "#levers")
    def edit(self) -> None:
        """Ask for another value of the field under the cursor."""
        if field := self._field():
            title = f"{field.path} {field.unit}"
            hint = f"{about_field(field)}. An empty value reverts a change."
            self._ask_change(title, text_of(field.value), hint, lambda s, value: state.edited(s, field.path, value))

    def _ask_change(
        self,
        title: str,
        text: str,
        hint: str,
        change: Callable[[Session, str], Session],
    ) -> None:
        """Open a form whose text changes the session."""
        self.ask_in(
            Form(
                title=title,
                value=text,
                hint=hint,
                take=lambda value: self.show(change(self.session, value)),
            )
        )

    def action_nudge(self, steps: int) -> None:
        """Change the field under the cursor by a number of steps."""
        path = self.levers.key
        if path and (value := stepped(self.session.drive, path, steps)) is not None:
            self.change(lambda s: state.edited(s, path, value))

    def action_explain(self) -> None:
        """Explain the screen."""
        self.ask_in(Notice(_EXPLAINED, asks=False))
