"""`hdassist explore`: a drive turned on the screen, and the processes that compute for it.

One process for each question under way, ended when nobody wants its answer.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import select
import signal
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import closing, suppress
from functools import partial
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from threading import Thread
from typing import Any

from hdassist.errors import HdassistError, UsageError
from hdassist.run.run import begin_worker
from hdassist.run.stops import end_now
from hdassist.terminal import options as o
from hdassist.terminal.output import Output
from hdassist.terminal.streams import Style, put_text, say

_SESSION_FILE = "explore.txt"  # among the user's states: the command that comes back to the last session
Question = Callable[[Callable[[str, object], None]], None]  # a function of explorer.compute with its arguments
_PRELOADED = ["__main__", "hdassist.cli", "hdassist.explorer.preloaded"]


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
            from hdassist.explorer.state import opened_state, with_evidence

            self.load(self.preset)  # says what is wrong with options as every command does
            overrides = (*self.changes, *(limit.override for limit in self.limits))
            session = opened_state(self.preset, overrides, self.pin or "")
            if self.measured:
                session = with_evidence(session, " ".join(self.measured))
            if (
                not all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr))
                or os.environ.get("TERM") == "dumb"
            ):
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


class Service:
    """Begins processes, hands on their answers, and ends them.

    They are forked from a process that has imported all that computes (a second, once), so that each begins within
    milliseconds and has no threads of the screen's.
    """

    def __init__(self) -> None:
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(_PRELOADED)
        # now: it inherits streams that the screen takes away, and of cli.main the environment of one thread
        forkserver.ensure_running()
        self._running: set[BaseProcess] = set()
        self._closed = False

    async def ask(self, question: Question) -> AsyncIterator[tuple[str, Any]]:
        """The answers of a process of its own; when the caller stops listening, or is cancelled, it is ended."""
        here, there = self._context.Pipe(duplex=False)
        process = self._context.Process(target=_answer, args=(question, there), daemon=False)
        begun = asyncio.create_task(asyncio.to_thread(self._begin, process, there))
        try:
            try:
                await asyncio.shield(begun)
            except OSError as error:
                words = f"cannot begin a process that computes: {error.strerror or error}"
                yield "failed", HdassistError(words, "ulimit -a shows why")
                return
            while True:
                await _readable(here)
                try:
                    yield here.recv()
                except EOFError:
                    return
        finally:
            with suppress(asyncio.CancelledError, OSError):
                await asyncio.shield(begun)
            self._end(process)
            here.close()

    def _begin(self, process: BaseProcess, there: Connection) -> None:
        try:
            if not self._closed:
                process.start()
                self._running.add(process)
        finally:
            there.close()

    def _end(self, process: BaseProcess) -> None:
        if process in self._running:
            self._running.discard(process)
            process.kill()
            process.join()

    def close(self) -> None:
        """End all that still computes."""
        self._closed = True
        for process in list(self._running):
            self._end(process)


async def _readable(connection: Connection) -> None:
    """Wait until there is something to read, or the other end is closed."""
    loop, ready = asyncio.get_running_loop(), asyncio.Event()
    loop.add_reader(connection.fileno(), ready.set)
    try:
        await ready.wait()
    finally:
        loop.remove_reader(connection.fileno())


def _answer(question: Question, there: Connection) -> None:
    """Answer a question in this process, which ends with the one that it was forked from, and so with the screen."""
    begin_worker(os.getppid())
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):  # the terminal is the screen's, whatever a library has to say
        os.dup2(nowhere, stream)
    try:
        question(lambda *found: there.send(found))
    except HdassistError as error:
        there.send(("failed", error))
    except Exception as error:  # a bug: the screen says so, as this process has no terminal to say it on
        words = f"internal error: {type(error).__name__}: {error}"
        there.send(("failed", HdassistError(words, "this is a bug in hdassist")))
    finally:
        there.close()
