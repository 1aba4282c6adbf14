"""`hdassist explore`: a drive turned on the screen."""

from __future__ import annotations

import os
import select
import signal
import sys
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from threading import Thread

from hdassist.errors import UsageError
from hdassist.run.stops import end_now
from hdassist.terminal import options as o
from hdassist.terminal.output import Output
from hdassist.terminal.streams import Style, put_text, say

_SESSION_FILE = "explore.txt"  # among the user's states: the command that comes back to the last session


@dataclass(frozen=True, kw_only=True)
class ExploreCommand(o.LimitedDriveOptions):
    """A drive turned on the screen: where the fixed wheel is best, and the effect of each value of the preset.

    \b
    Examples:
      hdassist explore vzp160
      hdassist explore my-drive.yaml --set phases.xi_b=230
      hdassist explore my-drive.yaml --limit 45
      hdassist explore my-drive.yaml h0=28.1 h4=17.3 h8=24.9

    Arrow keys turn the fixed wheel (the rigid wheel, that is the circular spline, or the flexspline); e takes what is
    known of the drive, c writes the assembly card, ? explains the screen. A number is searched first, then
    proven; a card comes only from an order that mount and trials would give too. The line at the bottom is the command
    that gives the same answer in a script; the one that comes back to the session is printed on leaving, and kept at
    each change in explore.txt in the user's folder of states.
    """

    preset: str
    measured: list[str] | None = None
    pin: str | None = None
    light: bool = False
    ascii: bool = False
    jobs: int = 0
    debug: bool = False

    def run(self) -> int:
        """Show the drive; returns the exit code."""
        if self.preset == "-":
            raise UsageError("the explorer needs standard input for its keys", "name a preset or a file")
        style = Style.of(sys.stdout, ascii=self.ascii)
        with Output(style).progress(self.preset):  # words before numpy is imported
            from hdassist.explorer.service import Service
            from hdassist.explorer.state import opened_state, with_evidence

            self.load(self.preset)  # says what is wrong with options as every command does
            overrides = (*self.changes, *(limit.override for limit in self.limits))
            session = opened_state(self.preset, overrides, self.pin or "")
            if self.measured:
                session = with_evidence(session, " ".join(self.measured))
            if not (sys.stdin.isatty() and sys.stdout.isatty()) or os.environ.get("TERM") == "dumb":
                words = "the explorer needs a terminal that moves its cursor"
                raise UsageError(words, f"in a script: {session.command()}")
            service = Service()  # it imports beside this process
            from platformdirs import user_state_path

            from hdassist.explorer.app import Explorer
            from hdassist.explorer.compute import Effort

        Thread(target=_end_with_terminal, daemon=True).start()
        with closing(service):
            keep = partial(put_text, str(user_state_path("hdassist", ensure_exists=True) / _SESSION_FILE))
            effort = Effort(jobs=self.jobs)
            app = Explorer(session, service, effort, dark=not self.light, ascii=style.ascii, keep=keep)
            app.run()
        if app.session.changes != session.changes:
            for words, name in (("back to it", "explore"), ("its numbers", "check")):
                say(f"{words}: {app.session.command(name)}", whole=True)
        return app.return_code or 0


def _end_with_terminal() -> None:
    """End the process once the terminal on standard input is gone, in a thread of its own.

    No signal reports that where SIGHUP is ignored (nohup), and the screen may wait for ever to be written.
    """
    terminal = select.poll()
    terminal.register(0, 0)  # a hang-up is reported unasked
    if any(event & (select.POLLHUP | select.POLLERR) for _, event in terminal.poll()):
        end_now(signal.SIGHUP)
