"""What the explorer asks: a form, whether to replace a file; and what explains the screen."""

from __future__ import annotations

from collections.abc import Callable
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
At the top F'_ior, the kinematic error from peak to peak over the full cycle, at each torque: 5th percentile, median and
95th percentile over all that is not known exactly, the limit, how probably it is kept, and the verdict of check.
[b]Holes[/b]: the same with the fixed wheel turned, counted counter-clockwise from now, from the cam side.
[b]N[/b] now, [b]B[/b] best, [b]W[/b] worst, [b]?[/b] measure next, x not allowed.

[b]How sure a number is[/b]
[b]REFINED[/b] ○  the extremes of the cycle were searched for.
[b]PROVEN[/b] ●  every state of the cycle was solved, and each answer proven.
[b]90 % RANGE[/b] ◌  median, and 5th to 95th percentile over what is not known exactly.
The advice is that of mount: its command stands at the bottom, and --card card.html behind it writes the card.

[b]Levers[/b]
[b]?[/b] assumed, [b]*[/b] changed here. Behind the value: a plausible step, and its change of F'_ior [arcsec] of a
typical drive, at the torque where that is greatest; the greatest first. Where a field is not known exactly a step is
about one standard deviation.
Enter edits; an empty value takes a change back. Numbers of teeth change together: 120, or 120/122.

[b]Keys[/b]
1 holes   2 seat   3 or l levers   Tab next pane   / filter levers
← → ↑ ↓ turn the wheel   b best hole   0 where it stands
Enter edit a field   + - a step   u undo   r redo   s save the preset
q leave: the command that comes back to the session is printed
"""


class Form(ModalScreen[str | None]):
    """A line to fill in; check says what is wrong with it, and the form stays until nothing is.

    Arguments: title; text that is there; hint below; check, which may raise HdassistError.
    """

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "dismiss(None)", "leave")]

    def __init__(self, title: str, text: str, hint: str, check: Callable[[str], object]) -> None:
        super().__init__()
        self._title, self._text, self._hint, self._check = title, text, hint, check

    def compose(self) -> ComposeResult:
        """Title, line, hint, and room for what is wrong."""
        with Vertical(id="form") as form:
            form.border_title = visible(self._title)
            form.border_subtitle = "Enter takes it, Escape leaves it"
            yield Input(self._text, select_on_focus=True)
            yield Static(visible(self._hint), id="hint", markup=False)
            yield Static("", id="wrong", markup=False)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Take what was filled in, or say what is wrong with it."""
        text = event.value.strip()
        try:
            self._check(text)
        except HdassistError as error:
            hint = f"\n{error.hint}" if error.hint else ""
            self.query_one("#wrong", Static).update(visible(f"{error.message}{hint}"))
            return
        self.dismiss(text)


class Confirm(ModalScreen[bool | None]):
    """A question that y and n answer; Escape, with None, leaves it open. Arguments: question; meanings of y and n."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("y", "dismiss(True)", "yes"),
        Binding("n", "dismiss(False)", "no"),
        Binding("escape", "dismiss(None)", "leave it open"),
    ]

    def __init__(self, question: str, yes: str = "yes", no: str = "no") -> None:
        super().__init__()
        self._text = f"{question}\n\ny {yes}\nn {no}"

    def compose(self) -> ComposeResult:
        """The question."""
        yield Static(visible(self._text), id="confirm", markup=False)


class Explain(ModalScreen[None]):
    """What is on the screen, and every key."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape,question_mark,q,enter", "dismiss", "close")]

    def compose(self) -> ComposeResult:
        """The text."""
        with VerticalScroll(id="explain") as scroll:
            scroll.border_title = "explain"
            scroll.border_subtitle = "Escape closes"
            yield Static(EXPLAINED)
