"""The explorer's session, the answers about each variant of it, and the processes that are asked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from rich.cells import cell_len
from rich.segment import Segment
from textual.app import App
from textual.color import Color
from textual.filter import LineFilter
from textual.timer import Timer

from hdassist.errors import HdassistError
from hdassist.explorer.compute import (
    FULL,
    Effort,
    ExplorerAnswer,
    Headline,
    LeverEffects,
    SeatCurve,
    drive_answers,
)
from hdassist.explorer.screens import Form
from hdassist.explorer.service import Failed, Question, Service
from hdassist.explorer.state import Changes, Session
from hdassist.mounting.advice import Advice
from hdassist.report.report import Report
from hdassist.terminal.console import PLAIN_CHARACTERS
from hdassist.visible import visible

REST = 0.7  # s without a key before the steps of levers are asked for
THEMES = ("textual-light", "textual-dark")
SIGNS = PLAIN_CHARACTERS | str.maketrans("○●◌…°″±≤≥←→↑↓─━┄│", 'o@%~d"~<><>^v---|')  # of one column each


@dataclass
class Known:
    """Answers about one variant of the drive."""

    curve: SeatCurve | None = None
    headline: Headline | None = None
    advice: Advice | None = None
    report: Report | None = None  # of the advice
    effects: LeverEffects | None = None
    failed: Failed | None = None

    def take(self, answer: ExplorerAnswer) -> None:
        """Learn an answer."""
        setattr(self, FIELD_OF.get(type(answer), "advice"), answer)


FIELD_OF = {
    SeatCurve: "curve",
    Headline: "headline",
    LeverEffects: "effects",
    Report: "report",
    Failed: "failed",
}


class SevenBits(LineFilter):
    """Every line of the screen in 7-bit characters, each as wide as before."""

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        """The same segments for a terminal without Unicode; lines of frames become +."""
        del background
        return [Segment(seven_bits(segment.text), segment.style, segment.control) for segment in segments]


def seven_bits(text: str) -> str:
    """A text in ASCII that takes as many columns."""
    return "".join(sign if sign.isascii() else "+" * cell_len(sign) for sign in text.translate(SIGNS))


class Asking(App[int]):
    """A session, and questions about it: each change asks for new answers, and ends questions that became needless.

    Arguments: session, service and effort; dark or light; ascii, whether in 7 bits.
    """

    def __init__(
        self,
        session: Session,
        service: Service,
        effort: Effort = FULL,
        *,
        dark: bool = True,
        ascii: bool = False,
    ) -> None:
        super().__init__()
        self.ascii = ascii
        self.session, self.service, self.effort = session, service, effort
        self.answers: dict[Changes, Known] = {}
        self._rest: Timer | None = None
        self.theme = THEMES[dark]

    def get_line_filters(self) -> Sequence[LineFilter]:
        """The filters that every line goes through on its way to the terminal."""
        return [*super().get_line_filters(), *([SevenBits()] if self.ascii else [])]

    def draw(self) -> None:
        """Show the session and its answers."""

    def ask_of_panes(self) -> None:
        """Ask for what else is on the screen."""

    @property
    def known(self) -> Known:
        """Answers about the drive as it is changed."""
        return self.answers.setdefault(self.session.changes, Known())

    @property
    def of_preset(self) -> Known | None:
        """Answers about the drive as it was opened, None where nothing is changed."""
        return self.answers.get(()) if self.session.changes else None

    def show(self, session: Session) -> None:
        """Go on with another session: ask for answers that are missing, and draw it."""
        old, before, self.session = self.session, self.known, session
        if session.changes != old.changes:
            if self.workers.cancel_group(self, "levers"):
                before.effects = None
            self.ask_of_drive()
        self.when_at_rest()
        self.draw()

    def change(self, change: Callable[[Session], Session]) -> None:
        """Go on with a changed session; say why where that cannot be."""
        try:
            self.show(change(self.session))
        except HdassistError as error:
            self.complain(error)

    def complain(self, error: HdassistError | Failed) -> None:
        """Notify of an error and its hint."""
        hint = f"\n{error.hint}" if error.hint else ""
        self.notify(visible(f"{error.message}{hint}"), severity="error", markup=False, timeout=8)

    def fill_in(
        self,
        title: str,
        text: str,
        hint: str,
        take: Callable[[str], None],
        check: Callable[[str], object] = lambda _: None,
    ) -> None:
        """Have a line filled in, and take its text unless it is left."""
        self.push_screen(Form(title, text, hint, check), lambda found: None if found is None else take(found))

    def ask_of_drive(self) -> None:
        """Ask for the answers of `check` and `mount`, unless they are there."""
        self.workers.cancel_group(self, "drive")
        if self.known.advice is None:
            self.known.failed = None
            self.follow(partial(drive_answers, self.session.drive, self.effort), self.known, "drive")

    def follow(self, question: Question, known: Known, group: str) -> None:
        """Ask, and take each answer; another question of the group ends the process of this one."""

        async def follow() -> None:
            async for answer in self.service.ask(question):
                if isinstance(answer, Failed) and group == "levers":
                    self.complain(answer)
                else:
                    known.take(answer)
                if isinstance(answer, Headline) and answer.whole:
                    self.when_at_rest()
                self.draw()
            self.call_later(self.draw)

        self.run_worker(follow(), group=group, exclusive=True)

    def when_at_rest(self) -> None:
        """Ask for what else is on the screen once no key was pressed for a while."""
        if self._rest:
            self._rest.stop()
        self._rest = self.set_timer(REST, self.ask_of_panes)

    @property
    def busy(self) -> bool:
        """Whether processes compute."""
        return any(not worker.is_finished for worker in self.workers if worker.group == "drive")
