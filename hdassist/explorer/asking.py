"""The explorer's session, the answers about each variant of it, and the processes that are asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from rich.cells import cell_len
from rich.segment import Segment
from textual.app import App
from textual.color import Color
from textual.filter import LineFilter
from textual.timer import Timer

from hdassist.design import DesignCheck
from hdassist.errors import HdassistError
from hdassist.explorer.command import Service
from hdassist.explorer.compute import (
    FULL,
    Effort,
    FirstErrors,
    LeverEffects,
    SeatCurve,
    drive_answers,
    still_typical,
    typical_of,
)
from hdassist.explorer.state import Session
from hdassist.files import visible
from hdassist.mounting.advice import Advice
from hdassist.preset.fields import Drive
from hdassist.report import Report
from hdassist.terminal.streams import PLAIN_CHARACTERS
from hdassist.terminal.words import again

_BAR_COLUMNS = 16  # width of the progress bar
REST = 0.7  # s without a key before the cam turn and the steps of levers are asked for
_THEMES = ("textual-light", "textual-dark")
# of one column each
_SIGNS = PLAIN_CHARACTERS | str.maketrans("\N{NO-BREAK SPACE}○●◌□■▫△▲▵◆…°″±≤≥←→↑↓─━┄│═╌", ' o@%08:AV.#~d"~<><>^v-#-|=~')


@dataclass
class Known:
    """Answers about one variant of the drive; old: the check of the variant before."""

    curve: SeatCurve | None = None
    check: DesignCheck | None = None  # by the samples so far, before its page is there
    page: Report | None = None  # of the check
    old: DesignCheck | None = None
    first: FirstErrors | None = None
    advice: Advice | None = None
    report: Report | None = None  # of the advice
    effects: LeverEffects | None = None
    turn: Report | None = None  # of a typical drive
    failed: HdassistError | None = None
    done: float = 0.0  # share of the work for check and advice

    @property
    def whole(self) -> DesignCheck | None:
        """The whole answer of `check`, None before."""
        return self.check if self.page else None

    @property
    def typical(self) -> Mapping[str, float]:
        """Values by path of a typical drive of what is not known exactly; empty before the answer is whole."""
        return typical_of(self.whole)[0] if self.whole else {}

    @property
    def without(self) -> str:
        """What stands in place of an answer that is not there, with the reason if there is none."""
        if self.failed:
            return visible(f"no result: {self.failed.message}\n{self.failed.hint}")
        full = round(_BAR_COLUMNS * self.done)
        return f"computing … {'━' * full}{'─' * (_BAR_COLUMNS - full)} {100 * self.done:.0f} %"


class _SevenBits(LineFilter):
    """Every line of the screen in 7-bit characters, each as wide as before."""

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        """Return the same segments for a terminal without Unicode; lines of frames become +."""
        del background
        return [Segment(_seven_bits(segment.text), segment.style, segment.control) for segment in segments]


def _seven_bits(text: str) -> str:
    """Return a text in ASCII that takes as many columns."""
    return "".join(sign if sign.isascii() else "+" * cell_len(sign) for sign in text.translate(_SIGNS))


class Asking(App[int]):
    """A session, and questions about it: each change asks for new answers, and ends questions that became needless.

    Arguments: session, service and effort; dark or light; ascii, whether in 7 bits; keep, which is given the command
    that comes back to the session at each change.
    """

    def __init__(
        self,
        session: Session,
        service: Service,
        effort: Effort = FULL,
        *,
        dark: bool = True,
        ascii: bool = False,
        keep: Callable[[str], object] = str,
    ) -> None:
        super().__init__()
        self.ascii = ascii
        self.keep = keep
        self.torque = 0  # place of the torque that cam turn and levers are shown at
        self.session = session
        self.service = service
        self.effort = effort
        self.saved = session.changes  # that are in a preset, or were opened
        self.answers: dict[str, Known] = {}  # by the command that gives them
        self.asked: dict[str, tuple[object, ...]] = {}  # the last question of a group, by its arguments
        self._rest: Timer | None = None
        self.theme = _THEMES[dark]

    def get_line_filters(self) -> Sequence[LineFilter]:
        """Return the filters that every line goes through on its way to the terminal."""
        return [*super().get_line_filters(), *([_SevenBits()] if self.ascii else [])]

    def draw(self) -> None:
        """Show the session and its answers."""

    def ask_of_panes(self) -> None:
        """Ask for the rest of the screen."""

    def known_of(self, drive: Drive) -> Known:
        """Return the answers about a drive."""
        return self.answers.setdefault(again("check", drive), Known())

    @property
    def known(self) -> Known:
        """Answers about the drive as it is now."""
        return self.known_of(self.session.drive)

    @property
    def pinned(self) -> Known | None:
        """Answers about the drive to compare with, None if it is the one that is shown or has other torques."""
        pinned = self.session.pinned
        drive = self.session.drive
        is_other = pinned.operation.M_g == drive.operation.M_g and self.known_of(pinned) is not self.known
        return self.known_of(pinned) if is_other else None

    @property
    def M_g(self) -> float:
        """Torque that cam turn and levers are shown at [N*m]."""
        torques = self.session.drive.operation.M_g
        return torques[self.torque % len(torques)]

    def show(self, session: Session) -> None:
        """Go on with another session: ask for answers that are missing, and draw it."""
        before = self.known
        self.session = session
        if self.known is not before:
            self.known.old = before.whole or before.old or before.check
            self.ask_of_drive()
            self.keep(session.command("explore"))
        self.when_at_rest()
        self.draw()

    def change(self, change: Callable[[Session], Session]) -> None:
        """Go on with a changed session; say why where that cannot be."""
        self.attempt(lambda: self.show(change(self.session)))

    def attempt(self, act: Callable[[], None]) -> None:
        """Do something; say why where that cannot be."""
        try:
            act()
        except HdassistError as error:
            self.complain(error)

    def complain(self, error: HdassistError) -> None:
        """Notify of an error and its hint."""
        self.notify(
            visible(f"{error.message}\n{error.hint}".strip()),
            severity="error",
            markup=False,
            timeout=8,
        )

    def ask_of_drive(self) -> None:
        """Ask for the answers of `check` and of `mount`, unless they are there."""
        if self.known.advice is not None:
            self.workers.cancel_group(self, "drive")
            self.asked.pop("drive", None)
            return
        self.known.failed = None
        drive = self.session.drive
        old = self.known.old
        self.ask("drive", self.known, drive_answers, drive, still_typical(old, drive) if old else {}, self.effort)

    def ask(
        self,
        group: str,
        known: Known,
        function: Callable[..., None],
        *arguments: object,
    ) -> None:
        """Ask, and take each answer, unless that was the last question of its group, the process of which is ended."""
        if self.asked.get(group) == arguments:
            return
        self.asked[group] = arguments

        async def follow() -> None:
            async for name, answer in self.service.ask(partial(function, *arguments)):
                if name == "failed" and group != "drive":
                    self.complain(answer)
                else:
                    setattr(known, name, answer)
                if name in ("page", "report"):
                    self.when_at_rest()
                self.draw()
            self.call_later(self.draw)

        self.run_worker(follow(), group=group, exclusive=True)

    def when_at_rest(self) -> None:
        """Ask for the rest of the screen once no key was pressed for a while."""
        if self._rest:
            self._rest.stop()
        self._rest = self.set_timer(REST, self.ask_of_panes)
