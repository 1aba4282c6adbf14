"""The explorer's other views: the error over a cam turn with the teeth in mesh, and a measured trace over it."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, cast

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.message import Message
from textual.timer import Timer
from textual.widget import Widget
from textual.widgets import Static

from hdassist.explorer import words
from hdassist.explorer.answers import Answer, Compared, Failed, Sure, Turned
from hdassist.explorer.graphs import graph, zone_picture
from hdassist.explorer.pictures import Inks
from hdassist.visible import visible

if TYPE_CHECKING:
    from hdassist.explorer.asking import Asking

FRAME = 0.12  # s between states of the animation
SLIDE = 10.0  # deg that the start angle goes on by


def _inks(widget: Widget) -> Inks:
    return cast("Asking", widget.app).inks


class Drawing(Widget):
    """A picture that its view draws."""

    def __init__(self, view: TurnView | TraceView, which: str) -> None:
        super().__init__(id=which, classes="pane")
        self._view = view

    def render(self) -> Text:
        """The picture."""
        return self._view.picture(str(self.id), self.size.width, self.size.height)


class Started(Message):
    """Another start angle or torque is wanted."""


class TurnView(Vertical, can_focus=True):
    """The error over one cam turn, its orders, and the forces on the teeth where the cursor stands.

    start_deg: angle of the moving wheel at phi_h = 0; torque: place of the torque among the drive's.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left", "move(-1)", "cam", key_display="←→"),
        Binding("right", "move(1)", "cam", show=False),
        Binding("up", "slide(1)", "start angle", key_display="↑↓"),
        Binding("down", "slide(-1)", "start angle", show=False),
        Binding("space", "run", "run"),
        Binding("m", "torque", "torque"),
    ]

    def __init__(self) -> None:
        super().__init__(id="turn-view")
        self.start_deg, self.torque, self.state = 0.0, 0, 0
        self.found: Turned | None = None
        self.failed: Failed | None = None
        self._clock: Timer | None = None
        self._parts = [Drawing(self, name) for name in ("error", "zone-0", "zone-1")]
        self._orders = Static(id="orders", classes="pane", markup=False)

    def compose(self) -> ComposeResult:
        """The error and its orders above, the two zones below."""
        with Horizontal():
            yield self._parts[0]
            yield self._orders
        with Horizontal():
            yield from self._parts[1:]

    def take(self, answer: Answer) -> None:
        """Show an answer."""
        if isinstance(answer, Turned):
            self.found, self.failed = answer, None
            self.state = min(self.state, len(answer.phi_h_deg) - 1)
        elif isinstance(answer, Failed):
            self.found, self.failed = None, answer
        self.draw()

    def draw(self) -> None:
        """Draw all parts anew."""
        found, inks = self.found, _inks(self)
        for part in self._parts:
            part.refresh()
        if found is None:
            told = self.failed.message if self.failed else "computing …"
            self._orders.update(visible(told))
            return
        error, zones = self._parts[0], self._parts[1:]
        sure = Sure.AT_ZERO if found.warnings else Sure.PROVEN
        error.border_title = f"{sure} · {found.M_g:g} N·m · error over the cam angle, arcsec"
        error.border_subtitle = (
            f"start {found.start_deg:g}° (↑↓)  cam {found.phi_h_deg[self.state]:.1f}° (←→)  "
            f"error {found.error_arcsec[self.state]:+.2f}  range {found.range_arcsec:.2f}"
        )
        for name, zone in zip(("0°", "180°"), zones, strict=True):
            zone.border_title = f"mesh zone at {name}: force on each tooth"
        lines = Text("".join(f"{line}\n" for line in words.belief(cast("Asking", self.app).known)), inks.limit)
        for per_turn, amplitude, cause in found.orders:
            lines.append(f"{per_turn:6.2f} {amplitude:7.2f}  ", inks.text)
            first, *others = cause.split("; ")
            lines.append(f"{first}{' …' if others else ''}\n", inks.muted)
        lines.append("\n".join(["", *found.warnings, found.proof]), inks.muted)
        self._orders.border_title = "orders: per cam turn, arcsec"
        self._orders.update(lines)

    def picture(self, which: str, columns: int, rows: int) -> Text:
        """One of the pictures."""
        found, inks = self.found, _inks(self)
        if found is None:
            return Text("computing …" if not self.failed else "no answer", inks.muted)
        if which == "error":
            cursor = found.phi_h_deg[self.state]
            series = [(found.error_arcsec, inks.torque(self.torque))]
            return graph(found.phi_h_deg, series, columns, rows, inks, words="deg", cursor=cursor)
        return zone_picture(found, self.state, int(which[-1]), columns, rows, inks)

    def action_move(self, by: int) -> None:
        """Turn the cam by states."""
        if self.found:
            self.state = (self.state + by) % len(self.found.phi_h_deg)
            self.draw()

    def action_slide(self, by: int) -> None:
        """Start with the moving wheel turned on."""
        self.start_deg = (self.start_deg + by * SLIDE) % 360
        self.post_message(Started())

    def action_torque(self) -> None:
        """Take the next torque."""
        self.torque += 1
        self.post_message(Started())

    def action_run(self) -> None:
        """Run through the cam turn, or stand."""
        if self._clock:
            self._clock.stop()
            self._clock = None
        else:
            self._clock = self.set_interval(FRAME, lambda: self.action_move(1))

    def stop(self) -> None:
        """Stand."""
        if self._clock:
            self.action_run()


class Opened(Message):
    """A trace is to be opened."""


class TraceView(Vertical, can_focus=True):
    """A measured trace over the prediction, and what the comparison says."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("o", "open", "open"),
        Binding("left", "move(-1)", "window", key_display="←→"),
        Binding("right", "move(1)", "window", show=False),
    ]

    def __init__(self) -> None:
        super().__init__(id="trace-view")
        self.found: Compared | None = None
        self.failed: Failed | None = None
        self.file = ""
        self.first = 0.0  # cam turns at the left edge
        self._part = Drawing(self, "trace")
        self._told = Static("o opens a measured trace: angle and error, as hdassist compare reads it", markup=False)

    def compose(self) -> ComposeResult:
        """Both curves, and the page of the comparison below."""
        yield self._part
        with VerticalScroll(classes="pane", id="told") as told:
            told.border_title = "COMPARISON"
            yield self._told

    def take(self, answer: Answer) -> None:
        """Show an answer."""
        if isinstance(answer, Compared):
            self.found, self.failed, self.first = answer, None, answer.turns[0] if answer.turns else 0.0
        elif isinstance(answer, Failed):
            self.found, self.failed = None, answer
        self.draw()

    def draw(self) -> None:
        """Draw both parts anew."""
        self._part.refresh()
        if found := self.found:
            ink = _inks(self)
            self._part.border_title = f"{visible(found.file)}: error over cam turns, arcsec"
            self._part.border_subtitle = f"[{ink.trial}]━ measured[/]  [{ink.torque(0)}]━ predicted[/]"
            self._told.update(visible(found.page))
        elif self.failed:
            hint = f"\n{self.failed.hint}" if self.failed.hint else ""
            self._told.update(visible(f"{self.failed.message}{hint}"))
        elif self.file:
            self._told.update("comparing: every deviation is fitted, which takes some seconds …")

    def picture(self, which: str, columns: int, rows: int) -> Text:
        """Both curves."""
        del which
        found, inks = self.found, _inks(self)
        if found is None:
            return Text("no answer" if self.failed else "comparing …" if self.file else "no trace yet", inks.muted)
        rows_of = [k for k, turn in enumerate(found.turns) if self.first <= turn <= self.first + self.window]
        if len(rows_of) < 2:
            return Text("nothing was measured here", inks.muted)
        turns = [found.turns[k] for k in rows_of]
        series = [
            ([found.measured_arcsec[k] for k in rows_of], inks.trial),
            ([found.predicted_arcsec[k] for k in rows_of], inks.torque(0)),
        ]
        return graph(turns, series, columns, rows, inks, words="cam turns")

    @property
    def window(self) -> float:
        """Cam turns that are drawn at once."""
        found = self.found
        return min(2.0, found.turns[-1] - found.turns[0]) if found and found.turns else 1.0

    def action_move(self, by: int) -> None:
        """Show the cam turns further on, or back."""
        if found := self.found:
            last = max(found.turns[0], found.turns[-1] - self.window)
            self.first = min(max(self.first + by * self.window / 2, found.turns[0]), last)
            self._part.refresh()

    def action_open(self) -> None:
        """Ask for a trace."""
        self.post_message(Opened())
