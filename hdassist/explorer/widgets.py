"""The parts of the explorer's screen, one purpose each; they show what they are given and tell what was clicked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import atan2, degrees
from typing import TYPE_CHECKING, ClassVar, cast

from rich.text import Text
from textual.binding import Binding, BindingType
from textual.events import Click, MouseScrollDown, MouseScrollUp
from textual.message import Message
from textual.widget import Widget
from textual.widgets import DataTable

from hdassist.explorer.levers import Lever
from hdassist.explorer.pictures import LABELS, Inks, Plotted, curve_picture, seat_picture, value_words
from hdassist.visible import visible

if TYPE_CHECKING:
    from hdassist.explorer.asking import Asking
    from hdassist.preset.fields import Drive

TURNS: list[BindingType] = [
    Binding("left", "app.turn(-1)", "turn", show=False),
    Binding("right", "app.turn(1)", "turn", show=False),
]


class Turned(Message):
    """The wheel is to be looked at turned by rotation_deg from where it stands."""

    def __init__(self, rotation_deg: float) -> None:
        super().__init__()
        self.rotation_deg = rotation_deg


class Picture(Widget):
    """Something drawn of what the app plots."""

    plotted: Plotted = Plotted(None)

    def inks(self) -> Inks:
        """Styles of the theme."""
        return cast("Asking", self.app).inks

    def show(self, plotted: Plotted) -> None:
        """Draw something else."""
        self.plotted = plotted
        self.refresh()

    def on_mouse_scroll_down(self, event: MouseScrollDown) -> None:
        """Turn the wheel on."""
        event.stop()
        self.app.call_later(self.app.run_action, "turn(1)")

    def on_mouse_scroll_up(self, event: MouseScrollUp) -> None:
        """Turn the wheel back."""
        event.stop()
        self.app.call_later(self.app.run_action, "turn(-1)")


class CurvePlot(Picture):
    """F'_ior against the position of the fixed wheel."""

    def render(self) -> Text:
        """The picture."""
        return curve_picture(self.plotted, self.size.width, self.size.height, self.inks())

    def on_click(self, event: Click) -> None:
        """Look at the wheel where was clicked."""
        width = self.size.width - LABELS - 1
        column = event.get_content_offset_capture(self).x - LABELS
        if width > 0:
            self.post_message(Turned(360 * min(max(column / width, 0), 1)))


class Seat(Picture, can_focus=True):
    """The seat from the cam side, and what the error is where the wheel is looked at."""

    BINDINGS: ClassVar[list[BindingType]] = TURNS
    drive: Drive | None = None

    def render(self) -> Text:
        """The picture, and the values below it."""
        words = self._words()
        rows = self.size.height - len(words.plain.splitlines())
        if self.drive is None:
            return words
        holes, allowed = self.drive.mounting.holes, self.drive.mounting.allowed
        barred = [] if allowed == "all" else [k for k in range(holes) if k not in allowed]
        first = self.drive.mounting.first_hole
        picture = seat_picture(self.plotted, holes, first, barred, self.size.width, rows, self.inks())
        return Text("\n").join([picture, words])

    def _words(self) -> Text:
        """Where the wheel is looked at, and F'_ior there."""
        plot, inks = self.plotted, self.inks()
        curve = plot.curve
        place = curve.at(plot.turn_deg) if curve else None
        turned = plot.turn_deg if plot.turn_deg <= 180 else plot.turn_deg - 360
        holes = self.drive.mounting.holes if self.drive else 0
        where = f"hole {round(plot.turn_deg * holes / 360)}" if holes else f"{plot.turn_deg:g} deg"
        words = Text(f"{where}, turned {turned:+g}°" if plot.turn_deg else f"{where}, where it stands", inks.text)
        if curve and place:
            now = curve.at(0)
            for t, line in enumerate(value_words(place, now, curve.torques)):
                words.append(f"\n{line}", inks.torque(t))
            if not place.usable:
                words.append("\nnot allowed", inks.worst)
        return words

    def on_click(self, event: Click) -> None:
        """Look at the wheel turned towards where was clicked."""
        at = event.get_content_offset_capture(self)
        rows = self.size.height - len(self._words().plain.splitlines())
        x, y = at.x - (self.size.width - 1) / 2, (rows - 1) / 2 - at.y
        if self.drive is not None and at.y < rows:
            self.post_message(Turned(degrees(atan2(2 * y, x)) - self.drive.mounting.first_hole))


class Levers(DataTable[Text]):
    """Every field of the preset with its value and what a step of it does."""

    BINDINGS: ClassVar[list[BindingType]] = [
        *TURNS,
        Binding("plus,equals_sign", "app.nudge(1)", "+ step", show=False),
        Binding("minus", "app.nudge(-1)", "- step", show=False),
    ]

    def on_mount(self) -> None:
        """Make the columns."""
        self.cursor_type = "row"
        self.zebra_stripes = False
        self.show_header = True
        self.cell_padding = 0
        for name, key, width in (
            ("field", "name", 11),
            ("value", "value", 9),
            (" unit", "unit", 6),
            ("step", "slope", 6),
        ):
            self.add_column(Text(name, justify="right" if key in ("value", "slope") else "left"), key=key, width=width)

    def fill(self, rows: Iterable[Lever], slopes: dict[str, tuple[float, ...]], inks: Inks) -> None:
        """Show fields, the first time in rows of their own; a section's name stands above its fields."""
        for lever in rows:
            cells = _cells(lever, slopes.get(lever.path), inks)
            if lever.path in self.rows:
                for key, cell in zip(("name", "value", "unit", "slope"), cells, strict=True):
                    if self.get_cell(lever.path, key) != cell:
                        self.update_cell(lever.path, key, cell)
                continue
            if f"#{lever.section}" not in self.rows:
                self.add_row(Text(lever.section, inks.text + " bold"), *[Text()] * 3, key=f"#{lever.section}")
            self.add_row(*cells, key=lever.path)

    @property
    def path(self) -> str | None:
        """Path of the field under the cursor; None on the name of a section."""
        if not self.row_count:
            return None
        key = str(self.coordinate_to_cell_key(self.cursor_coordinate).row_key.value)
        return None if key.startswith("#") else key


def _cells(lever: Lever, slope: Sequence[float] | None, inks: Inks) -> tuple[Text, ...]:
    value = visible(lever.text)
    value = value if len(value) <= 9 else f"{value[:8]}…"
    mark = {"?": inks.limit, "*": inks.best}.get(lever.mark, "")
    told = "" if slope is None or not slope else f"{slope[0]:+.2f}" if abs(slope[0]) >= 0.005 else "0"
    value_ink = inks.best if lever.mark == "*" else inks.muted if value == "unknown" else inks.text
    return (
        Text.assemble((f" {lever.name}", inks.text), (f" {lever.mark}", mark)),
        Text(value, value_ink, justify="right"),
        Text(f" {lever.unit}", inks.muted),
        Text(told, inks.torque(0) if told else "", justify="right"),
    )
