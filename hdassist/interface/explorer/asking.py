"""Session of the explorer, results for each variant of its drive, and the processes that compute them."""

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

from hdassist.drive.preset.fields import Drive
from hdassist.features.design import DesignCheck
from hdassist.features.mounting.advice import Advice
from hdassist.features.report import Report
from hdassist.interface.explorer.compute import (
    FULL,
    Effort,
    FirstErrors,
    LeverEffects,
    SeatCurve,
    drive_answers,
    still_typical,
    typical_of,
)
from hdassist.interface.explorer.service import Service
from hdassist.interface.explorer.state import Session
from hdassist.interface.terminal.streams import PLAIN_CHARACTERS
from hdassist.interface.terminal.words import again
from hdassist.run.errors import HdassistError
from hdassist.run.files import visible

_BAR_COLUMNS = 16  # width of the progress bar in columns
# time without a key press before the error over a revolution and the steps of inputs are requested [s]
REST = 0.7
_THEMES = ("textual-light", "textual-dark")
# replacements of one column each
_SIGNS = PLAIN_CHARACTERS | str.maketrans("\N{NO-BREAK SPACE}○●◌□■▫△▲▵◆…°″±≤≥←→↑↓─━┄│═╌", ' o@%08:AV.#~d"~<><>^v-#-|=~')


@dataclass
class Known:
    """Results for one variant of the drive; `old` is the check of the previous variant."""

    curve: SeatCurve | None = None
    check: DesignCheck | None = None  # interim check from the samples so far, until its page is there
    page: Report | None = None  # page of the check
    old: DesignCheck | None = None
    first: FirstErrors | None = None
    advice: Advice | None = None
    report: Report | None = None  # page of the recommendation
    effects: LeverEffects | None = None
    turn: Report | None = None  # page of a typical drive
    failed: HdassistError | None = None
    done: float = 0.0  # completed share of the work for check and recommendation

    @property
    def whole(self) -> DesignCheck | None:
        """Result of `check`; None until it is complete."""
        return self.check if self.page else None

    @property
    def typical(self) -> Mapping[str, float]:
        """Values of the uncertain inputs of a typical drive, by path; empty before the result is complete."""
        return typical_of(self.whole)[0] if self.whole else {}

    @property
    def without(self) -> str:
        """Text in place of a missing result: the error, or the progress."""
        if self.failed:
            return visible(f"no result: {self.failed.message}\n{self.failed.hint}")
        full = round(_BAR_COLUMNS * self.done)
        return f"computing … {'━' * full}{'─' * (_BAR_COLUMNS - full)} {100 * self.done:.0f} %"


class _SevenBits(LineFilter):
    """Filter that shows every line of the screen in 7-bit characters of the same width."""

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        """Return the segments for a terminal without Unicode; lines of frames become +."""
        del background
        return [Segment(_seven_bits(segment.text), segment.style, segment.control) for segment in segments]


def _seven_bits(text: str) -> str:
    """Return a text in ASCII with the same width."""
    return "".join(sign if sign.isascii() else "+" * cell_len(sign) for sign in text.translate(_SIGNS))


class Asking(App[int]):
    """A session with requests for results; each change makes new requests and ends obsolete ones.

    session: the session.
    service: service that runs the processes.
    effort: effort of the computation.
    dark: whether the theme is dark instead of light.
    ascii: whether the screen has 7-bit characters.
    keep: function that is called at each change with the command that restores the session.
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
        self.torque = 0  # index of the torque of the error over a revolution and of the inputs
        self.session = session
        self.service = service
        self.effort = effort
        self.saved = session.changes  # changes that are saved in a preset, or were there at the start
        self.answers: dict[str, Known] = {}  # results by the command that gives them
        self.asked: dict[str, tuple[object, ...]] = {}  # last request of each group, by its arguments
        self._rest: Timer | None = None
        self.theme = _THEMES[dark]

    def get_line_filters(self) -> Sequence[LineFilter]:
        """Return the filters for every line of the screen."""
        return [*super().get_line_filters(), *([_SevenBits()] if self.ascii else [])]

    def draw(self) -> None:
        """Show the session and its results."""

    def ask_of_panes(self) -> None:
        """Request the missing results of visible panes."""

    def known_of(self, drive: Drive) -> Known:
        """Return the results for a drive."""
        return self.answers.setdefault(again("check", drive), Known())

    @property
    def known(self) -> Known:
        """Results for the present drive."""
        return self.known_of(self.session.drive)

    @property
    def pinned(self) -> Known | None:
        """Results for the pinned drive; None if it is the present drive or has other torques."""
        pinned = self.session.pinned
        drive = self.session.drive
        is_other = pinned.operation.M_g == drive.operation.M_g and self.known_of(pinned) is not self.known
        return self.known_of(pinned) if is_other else None

    @property
    def M_g(self) -> float:
        """Torque of the error over a revolution and of the inputs [N*m]."""
        torques = self.session.drive.operation.M_g
        return torques[self.torque % len(torques)]

    def show(self, session: Session) -> None:
        """Switch to another session, request missing results, and redraw."""
        before = self.known
        self.session = session
        if self.known is not before:
            self.known.old = before.whole or before.old or before.check
            self.ask_of_drive()
            self.keep(session.command("explore"))
        self.when_at_rest()
        self.draw()

    def change(self, change: Callable[[Session], Session]) -> None:
        """Switch to a changed session; show the error if this is not possible."""
        self.attempt(lambda: self.show(change(self.session)))

    def attempt(self, act: Callable[[], None]) -> None:
        """Call a function; show the error if it fails."""
        try:
            act()
        except HdassistError as error:
            self.complain(error)

    def complain(self, error: HdassistError) -> None:
        """Show an error and its hint."""
        self.notify(
            visible(f"{error.message}\n{error.hint}".strip()),
            severity="error",
            markup=False,
            timeout=8,
        )

    def ask_of_drive(self) -> None:
        """Request the results of `check` and `mount` unless they are already available."""
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
        """Request results and store each of them, unless the last request of the group was the same.

        The process of the previous request is ended.

        group: group of the request.
        known: object in which the results are stored.
        function: function of explorer.compute.
        arguments: its arguments.
        """
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
        """Request the remaining results after REST seconds without a further call."""
        if self._rest:
            self._rest.stop()
        self._rest = self.set_timer(REST, self.ask_of_panes)
