"""Processes that compute for the screen: one for each question under way, ended when nobody wants its answer."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from hdassist.errors import HdassistError
from hdassist.run.run import begin_worker

Question = Callable[[Callable[[str, object], None]], None]  # a function of explorer.compute with its arguments
_PRELOADED = ["__main__", "hdassist.cli", "hdassist.explorer.preloaded"]


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
