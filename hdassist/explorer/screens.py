"""Questions of the explorer: a form, whether to replace a file; and the help of the screen."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical, VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Input, Static

from hdassist.errors import HdassistError
from hdassist.plaintext import visible

EXPLAINED = """\
WHAT YOU SEE
At the top F'_ior, the kinematic error from peak to peak over the full cycle, at each torque: median, 5th and 95th
percentile over all that is not known exactly; the limit, what it leaves above the 95th percentile, how probably it is
kept, and the verdict of check; the change from the preset, or from the pinned drive; and the best hole.
After a change the old answer stays, marked old, beside a typical drive as it was and as it is now.
Holes: F'_ior with the fixed wheel turned, counted counter-clockwise from now, from the cam side.
N now, B best, W worst, ? measure next, ◆ measured, x not allowed.
Why: the inputs from which the width of the range comes, and what each measurement would bring.

HOW SURE A NUMBER IS
REFINED ○  the extremes of the cycle were searched for.
PROVEN ●  every state of the cycle was solved, and each answer proven.
90 % RANGE ◌  median, and 5th to 95th percentile over what is not known exactly.
A card is written only from the advice of mount or trials, and only where these would write one.

LEVERS
? not known exactly, * changed here. Behind the value: a plausible step, and its change of F'_ior [arcsec]
of a typical drive, the greatest first. Where a field is not known exactly a step is about one deviation. Fields in
which the pinned drive differs come first, with the step to its value.
Enter edits; an empty value takes a change back. Numbers of teeth change together: 120, or the ratio, 60:1.
k has x_b change with W_0, so that the teeth keep their clearance.

KEYS
1 holes   2 seat   3 levers   4 cam turn   5 full cycle   6 why   7 advice   Tab next pane   / filter levers
← → ↑ ↓ turn the wheel   b best hole   0 where it stands   m next torque, marked ▸ at the top
e what is known of the drive: stiffness, F'_ior in a hole, a trace, a limit
  F'_ior in several holes at the lightest torque: the best hole and the order are those of trials
Enter edit a field   + - a step   o levers by group or by change
u undo   r redo   p pin the drive as it is, to compare
c card   w report   s preset   g picture   y copy the command line
q leave: the command that comes back to the session is printed
"""


class Form(ModalScreen[None]):
    """A line to fill in, which stays until it is taken; its faults are shown below.

    Arguments: title; value to begin with; hint below; take, called with the value, may raise HdassistError.
    """

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "dismiss(None)", "leave")]

    def __init__(self, title: str, value: str, hint: str, take: Callable[[str], None]) -> None:
        super().__init__()
        self._title, self._value, self._hint, self._take = title, value, hint, take

    def compose(self) -> ComposeResult:
        """Title, line, hint, and room for a fault."""
        with Vertical(id="form") as form:
            form.border_title = visible(self._title)
            form.border_subtitle = "Enter takes it, Escape leaves it"
            yield Input(self._value, select_on_focus=True)
            yield Static(visible(self._hint), id="hint", markup=False)
            yield Static("", id="wrong", markup=False)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Take the text that was filled in, or show its fault."""
        try:
            self._take(event.value.strip())
        except HdassistError as error:
            self.query_one("#wrong", Static).update(visible(f"{error.message}\n{error.hint}".strip()))
            return
        self.dismiss()


class Notice(ModalScreen[bool | None]):
    """A text, or a question that y and n answer; any other key of its own, with None, leaves it open."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("y", "dismiss(True)", "yes"),
        Binding("n", "dismiss(False)", "no"),
        Binding("escape,question_mark,q,enter", "dismiss(None)", "close"),
    ]

    def __init__(self, text: str) -> None:
        super().__init__()
        self._text = text

    def compose(self) -> ComposeResult:
        """The text."""
        with VerticalScroll(id="notice") as scroll:
            scroll.border_subtitle = "Escape closes"
            yield Static(self._text, markup=False)
