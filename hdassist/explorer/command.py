"""`hdassist explore`: a drive turned on the screen."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Annotated

import typer

from hdassist.terminal import options as o

HUNG_UP = "explore.txt"  # among the user's states: the command that goes on, where the terminal was closed


@dataclass(frozen=True, kw_only=True)
class ExploreCommand(o.TrialOptions, o.LoadedDriveOptions):
    """A drive turned on the screen: where the fixed wheel is best, and what each value of the preset does.

    \b
    Examples:
      hdassist explore vzp160
      hdassist explore my-drive.yaml --set phases.xi_b=230
      hdassist explore my-drive.yaml h0=28.1 h4=17.3 h8=24.9

    Arrow keys turn the fixed wheel (the rigid wheel, that is the circular spline, or the flexspline); t adds a trial, c
    writes the assembly card, ? explains the screen. Numbers are coarse at once, then refined, then proven; a card comes
    only from what mount and trials would order too. The line at the bottom is the command that gives the same answer in
    a script; on leaving, the command that comes back to the session is printed.
    """

    preset: o.Preset
    trials: Annotated[
        list[str] | None,
        typer.Argument(metavar="HOLE=F_IOR", help="Trials to begin with, as hdassist trials takes them."),
    ] = None
    light: Annotated[bool, typer.Option("--light", help="Dark letters on a light ground.")] = False
    ascii: o.Ascii = False
    jobs: o.Jobs = 0
    debug: o.Debug = False

    def run(self) -> int:
        """Show the drive; returns the exit code."""
        from hdassist.errors import UsageError
        from hdassist.explorer.state import opened_state, rig_of, with_trials

        if self.preset == "-":
            raise UsageError("the explorer needs standard input for its keys", "name a preset or a file")
        session = opened_state(self.preset, tuple(self.changes), self.only(o.TrialOptions))
        rig_of(session)
        if self.trials:
            session = with_trials(session, " ".join(self.trials))
        if not (sys.stdin.isatty() and sys.stdout.isatty()):
            raise UsageError("the explorer needs a terminal", f"in a script: {session.command()}")

        from hdassist.explorer.guard import terminal_guarded
        from hdassist.explorer.service import Service

        with terminal_guarded():
            service = Service()  # it imports beside this process
            try:
                from platformdirs import user_state_path

                from hdassist.explorer.app import Explorer
                from hdassist.explorer.compute import Effort
                from hdassist.terminal.console import Style, say, silence
                from hdassist.terminal.files import put_text

                plain = Style.of(sys.stdout, ascii=self.ascii).ascii
                app = Explorer(session, service, Effort(jobs=self.jobs), dark=not self.light, ascii=plain)
                app.run()
            finally:
                service.close()
        is_hung_up = not sys.stdout.isatty()  # what is left for the terminal has no place
        if is_hung_up:
            for stream in (sys.stdout, sys.stderr):
                silence(stream)
        if app.session.step != session.step:
            for words, name in (("back to it", "explore"), ("its numbers", "check")):
                say(f"{words}: {app.session.command(name)}")
            if is_hung_up:
                put_text(str(user_state_path("hdassist", ensure_exists=True) / HUNG_UP), app.session.command("explore"))
        return app.return_code or 0
