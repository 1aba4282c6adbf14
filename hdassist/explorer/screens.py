"""What the explorer asks: a form, whether to replace a file; and what explains the screen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical, VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Input, Static

from hdassist.errors import HdassistError
from hdassist.visible import visible

EXPLAINED = """\
[b]What you see[/b]
At the top F'_ior, the kinematic error from peak to peak over the full cycle, at each torque: median, 5th and 95th
percentile over all that is not known exactly; the limit, what it leaves above the 95th percentile, how probably it is
kept, and the verdict of check; the change from the preset, or from the pinned drive; and the best hole.
After a change the old answer stays, marked [b]old[/b], beside a typical drive as it was and as it is now.
[b]Holes[/b]: F'_ior with the fixed wheel turned, counted counter-clockwise from now, from the cam side.
[b]N[/b] now, [b]B[/b] best, [b]W[/b] worst, [b]?[/b] measure next, ◆ measured, x not allowed.
[b]Why[/b]: the inputs from which the width of the range comes, and what each measurement would bring.

[b]How sure a number is[/b]
[b]REFINED[/b] ○  the extremes of the cycle were searched for.
[b]PROVEN[/b] ●  every state of the cycle was solved, and each answer proven.
[b]90 % RANGE[/b] ◌  median, and 5th to 95th percentile over what is not known exactly.
A card is written only from the advice of mount or trials, and only where these would write one.

[b]Levers[/b]
[b]?[/b] assumed, [b]*[/b] changed here. Behind the value: a plausible step, and its change of F'_ior [arcsec] of a
typical drive, the greatest first. Where a field is not known exactly a step is about one standard deviation. Fields in
which the pinned drive differs come first, with the step to its value.
Enter edits; an empty value takes a change back. Numbers of teeth change together: 120, or 120/122, or the ratio.
k has x_b change with W_0, so that the teeth keep their clearance.

[b]Keys[/b]
1 holes   2 seat   3 levers   4 cam turn   5 full cycle   6 why   7 advice   Tab next pane   / filter levers
← → ↑ ↓ turn the wheel   b best hole   0 where it stands   m next torque, marked ▸ at the top
e what is known of the drive: stiffness, F'_ior in a hole, a trace, a limit
t add trials   x drop the last one   Enter edit a field   + - a step   o levers by group or by change
u undo   r redo   p pin the drive as it is, to compare
c card   w report   s preset   g picture   y copy the command line
q leave: the command that comes back to the session is printed
"""


class Form(ModalScreen[None]):
    """A few lines to fill in, which stay until they are taken; what is wrong with them is said below.

    Arguments: title; fields, label and value of each; hint below; take, called with the values, may raise
    HdassistError.
    """

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "dismiss(None)", "leave")]

    def __init__(self, title: str, fields: Sequence[tuple[str, str]], hint: str, take: Callable[..., None]) -> None:
        super().__init__()
        self._title, self._fields, self._hint, self._take = title, fields, hint, take

    def compose(self) -> ComposeResult:
        """Title, lines, hint, and room for what is wrong."""
        with Vertical(id="form") as form:
            form.border_title = visible(self._title)
            form.border_subtitle = "Enter takes it, Escape leaves it"
            for label, value in self._fields:
                if label:
                    yield Static(label, classes="label")
                yield Input(value, select_on_focus=True)
            yield Static(visible(self._hint), id="hint", markup=False)
            yield Static("", id="wrong", markup=False)

    def on_input_submitted(self) -> None:
        """Take what was filled in, or say what is wrong with it."""
        try:
            self._take(*(line.value.strip() for line in self.query(Input)))
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

    def __init__(self, text: str, *, markup: bool = False) -> None:
        super().__init__()
        self._text, self._markup = text, markup

    def compose(self) -> ComposeResult:
        """The text."""
        with VerticalScroll(id="notice") as scroll:
            scroll.border_subtitle = "Escape closes"
            yield Static(self._text, markup=self._markup)
