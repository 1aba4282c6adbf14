"""What the explorer holds: a session, what is known of it, and the processes that are asked."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from textual.app import App
from textual.filter import LineFilter
from textual.timer import Timer

from hdassist.errors import HdassistError
from hdassist.explorer.answers import Advised, Answer, Curve, Sure
from hdassist.explorer.known import Known, Memory
from hdassist.explorer.pictures import Inks
from hdassist.explorer.plain import SevenBits
from hdassist.explorer.questions import (
    FULL,
    BeliefQuestion,
    Effort,
    MountQuestion,
    ProofQuestion,
    Question,
    SlopesQuestion,
    TrialsQuestion,
)
from hdassist.explorer.screens import Form
from hdassist.explorer.service import Service
from hdassist.explorer.session_file import SessionFile
from hdassist.explorer.state import Session, Step
from hdassist.explorer.themes import THEMES, inks
from hdassist.visible import visible

REST = 0.7  # s that the wheel rests in a position before that is proven


class Asking(App[int]):
    """A session, and questions about it: each change asks what is not known yet, and ends what is no longer wanted.

    Arguments: session, service and effort of the first questions; dark or light; ascii, whether in 7 bits; kept, the
    file that holds the session for next time.
    """

    def __init__(
        self,
        session: Session,
        service: Service,
        effort: Effort = FULL,
        *,
        dark: bool = True,
        ascii: bool = False,
        kept: SessionFile | None = None,
    ) -> None:
        super().__init__()
        self.kept, self.unkept = kept, ""
        self.settled = session.step  # that needs no keeping: as it was opened, or saved
        self._plain = [SevenBits()] if ascii else []
        self.session, self.service, self.effort = session, service, effort
        self.memory = Memory()
        self._rest: Timer | None = None
        for theme in THEMES:
            self.register_theme(theme)
        self.theme = THEMES[0 if dark else 1].name

    def get_line_filters(self) -> Sequence[LineFilter]:
        """What every line goes through on its way to the terminal."""
        return [*super().get_line_filters(), *self._plain]

    def draw(self) -> None:
        """Show the session and what is known of it."""

    def wants_slopes(self) -> bool:
        """Whether slopes are on the screen."""
        return False

    @property
    def inks(self) -> Inks:
        """Styles of the theme."""
        return inks(self.current_theme.dark)

    @property
    def known(self) -> Known:
        """What is known of the drive without trials."""
        return self.memory.of(Step(self.session.changes))

    @property
    def of_trials(self) -> Known | None:
        """What is known from the trials; None where there are none."""
        return self.memory.of(self.session.step) if self.session.trials else None

    def show(self, session: Session) -> None:
        """Go on with another session: ask what is not known of it, and draw it."""
        old, before, self.session = self.session, self.known, session
        if session.changes != old.changes:
            self.known.old = before.belief or before.old
            self.ask_of_drive()
        if session.step != old.step:
            self.keep()
            self.ask_of_trials()
        self.when_at_rest()
        self.draw()

    def keep(self) -> None:
        """Have the session in the user's file; say so once where that cannot be."""
        try:
            if self.kept:
                self.kept.write(self.session)
            self.unkept = ""
        except HdassistError as error:
            if not self.unkept:
                self.complain(error)
            self.unkept = error.message

    def change(self, change: Callable[[Session], Session]) -> None:
        """Go on with a changed session; say why where that cannot be."""
        try:
            self.show(change(self.session))
        except HdassistError as error:
            self.complain(error)

    def complain(self, error: HdassistError) -> None:
        """Say what is wrong, and what to do about it."""
        hint = f"\n{error.hint}" if error.hint else ""
        self.notify(visible(f"{error.message}{hint}"), severity="error", markup=False, timeout=8)

    def fill_in(
        self,
        title: str,
        fields: Sequence[tuple[str, str]],
        hint: str,
        take: Callable[[tuple[str, ...]], None],
        check: Callable[[tuple[str, ...]], object] | None = None,
    ) -> None:
        """Have a form filled in, and take its values unless it is left."""
        self.push_screen(Form(title, fields, hint, check), lambda values: take(values) if values else None)

    def ask_of_drive(self) -> None:
        """Ask where the wheel of the drive is best, and what its error may be, unless that is known."""
        known = self.known
        for group in ("drive", "belief"):
            self.workers.cancel_group(self, group)
        if known.belief is None or not known.belief.whole:
            self.follow(BeliefQuestion(self.session.drive, self.effort), known.take, "belief")
        if known.advised is None:
            known.failed = None
            self.follow(MountQuestion(self.session.drive, self.effort), known.take, "drive")
        self.when_at_rest()

    def ask_of_trials(self) -> None:
        """Ask what the trials teach, unless that is known or there are none."""
        self.workers.cancel_group(self, "trials")
        if (known := self.of_trials) and known.advised is None:
            known.failed, known.share = None, 0.0
            session = self.session
            asked = TrialsQuestion(session.drive, session.trials, session.rig, self.effort)
            self.follow(asked, known.take, "trials")

    def follow(self, question: Question, take: Callable[[Answer], None], group: str) -> None:
        """Ask, and take each answer; another question of the group ends the process of this one."""

        async def follow() -> None:
            async for answer in self.service.ask(question):
                take(answer)
                self.draw()
                whole = isinstance(answer, Curve) and len(answer.places) == len(self.session.positions)
                if group == "drive" and (whole or isinstance(answer, Advised)):
                    self.when_at_rest()
            self.call_later(self.draw)

        self.run_worker(follow(), group=group, exclusive=True)

    def when_at_rest(self) -> None:
        """Prove the position that is looked at, and look for slopes there, once the wheel rests in it."""
        for group in ("proof", "slopes"):
            self.workers.cancel_group(self, group)
        if self._rest:
            self._rest.stop()
        self._rest = self.set_timer(REST, self._at_rest)

    def _at_rest(self) -> None:
        known, session = self.known, self.session
        curve, turn = known.curve, session.turn_deg
        if curve is None or curve.sure is Sure.COARSE or known.failed:
            return
        if self.wants_slopes() and turn not in known.slopes:
            self.follow(SlopesQuestion(session.drive, turn, self.effort), known.take, "slopes")
        place = curve.at(turn)
        if known.advised and (place is None or place.sure not in (Sure.PROVEN, Sure.AT_ZERO)):
            self.follow(ProofQuestion(session.drive, turn, self.effort), known.take, "proof")

    @property
    def busy(self) -> bool:
        """Whether processes compute."""
        return any(
            not worker.is_finished for worker in self.workers if worker.group in ("drive", "belief", "trials", "proof")
        )
