"""`hdassist explore`: the interactive explorer of a drive."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import closing
from functools import partial
from threading import Thread

from hdassist.interface.terminal import options as o
from hdassist.interface.terminal.output import Output
from hdassist.interface.terminal.streams import Style, put_text, say
from hdassist.run.errors import UsageError
from hdassist.run.stops import end_now
from hdassist.run.system import wait_for_hangup

_SESSION_FILE = "explore.txt"  # file in the user's state folder with the command that restores the last session


class ExploreCommand(o.LimitedDriveOptions):
    """Interactive screen of a drive: F'_ior in each hole of the fixed wheel, and the effect of each input.

    \b
    Examples:
      hdassist explore vzp160
      hdassist explore my-drive.yaml --set phases.xi_b=230
      hdassist explore my-drive.yaml --limit 45
      hdassist explore my-drive.yaml h0=28.1 h4=17.3 h8=24.9

    Arrow keys turn the fixed wheel (the circular spline or the flexspline); e enters known data of the drive, c writes
    the assembly card, ? explains the screen. Each number is first found by a search, and then verified in every mesh
    position. A card is written only for a recommendation that mount would give too. The line at the bottom is the
    command that gives the same result in a script. On exit, hdassist prints the command that restores the session.
    After each change, the command is also stored in explore.txt in the user's state folder.
    """

    preset: str
    measured: list[str] | None = None
    pin: str | None = None
    light: bool = False
    ascii: bool = False
    jobs: int = 0
    debug: bool = False

    def run(self) -> int:
        """Run the explorer and return the exit code."""
        if self.preset == "-":
            raise UsageError(
                "the explorer reads keys from standard input, so the preset cannot be read from it",
                "name a preset or a file",
            )
        style = Style.of(sys.stdout, ascii=self.ascii)
        with Output(style).progress(self.preset):  # shows a text before numpy is imported
            from hdassist.interface.explorer.state import opened_state, with_evidence

            self.load(self.preset)  # reports invalid options like every command
            overrides = (*self.changes, *(limit.override for limit in self.limits))
            session = opened_state(self.preset, overrides, self.pin or "")
            if self.measured:
                session = with_evidence(session, " ".join(self.measured))
            if (
                not all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr))
                or os.environ.get("TERM") == "dumb"
            ):
                message = "the explorer needs a terminal with cursor control"
                raise UsageError(message, f"in a script: {session.command()}")
            from hdassist.interface.explorer.service import Service

            service = Service()  # imports its modules in parallel with this process
            from platformdirs import user_state_path

            from hdassist.interface.explorer.app import Explorer
            from hdassist.interface.explorer.compute import Effort

        Thread(target=_end_with_terminal, daemon=True).start()
        with closing(service):
            keep = partial(put_text, str(user_state_path("hdassist", ensure_exists=True) / _SESSION_FILE))
            effort = Effort(jobs=self.jobs)
            app = Explorer(
                session,
                service,
                effort,
                dark=not self.light,
                ascii=style.ascii,
                keep=keep,
            )
            app.run()
        if app.session.changes != session.changes:
            for label, name in (("restore the session", "explore"), ("check this drive", "check")):
                say(f"{label}: {app.session.command(name)}", whole=True)
        return app.return_code or 0


def _end_with_terminal() -> None:
    """End the process once the terminal on standard input is gone; runs in its own thread.

    Otherwise the screen could wait forever to be written.
    """
    if wait_for_hangup(0):
        end_now(signal.SIGHUP)
