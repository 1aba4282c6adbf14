"""Processes that compute for the explorer.

Each request has its own process, which is ended when its results are no longer needed.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from hdassist.run.errors import HdassistError
from hdassist.run.run import begin_worker
from hdassist.run.system import (
    begin_resource_tracker,
    has_forkserver,
    limits_hint,
    stops_held_back,
    wait_until_readable,
)

Question = Callable[[Callable[[str, object], None]], None]  # a function of explorer.compute with its arguments
_PRELOADED = ["__main__", "hdassist.interface.cli", "hdassist.interface.explorer.preloaded"]
_WAITING = 2  # number of waiting processes on systems that cannot fork


@dataclass(frozen=True, eq=False)
class _Answering:
    """A process that computes results or waits for a request, and the connection for its results."""

    process: BaseProcess
    connection: Connection

    def end(self) -> None:
        """End the process at once; results that it has sent can still be read."""
        self.process.kill()
        self.process.join()


class _ForkedProcesses:
    """Processes forked from a server process that imports all required modules once.

    The import takes a second. Each process starts within milliseconds and has no threads of the screen.
    """

    def __init__(self) -> None:
        from multiprocessing import forkserver

        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload(_PRELOADED)
        # the server is started now because it inherits the streams, which the screen replaces, and the single-thread
        # environment of the command line
        forkserver.ensure_running()

    def begin(self, question: Question) -> _Answering:
        """Start a process for a request. Raises OSError if the system has no process for it."""
        receiving_end, sending_end = self._context.Pipe(duplex=False)
        process = self._context.Process(
            target=_answer_forked,
            args=(question, sending_end),
            daemon=False,
        )
        with sending_end:
            process.start()
        return _Answering(process, receiving_end)

    def waiting(self) -> list[_Answering]:
        """Return an empty list, because no process waits for a request."""
        return []


class _WaitingProcesses:
    """Processes that have imported all required modules and wait for a request, for systems that cannot fork.

    Each computes one request and is replaced by a new one.
    """

    def __init__(self) -> None:
        self._context = multiprocessing.get_context("spawn")
        self._waiting: deque[_Answering] = deque()
        begin_resource_tracker()
        for _ in range(_WAITING):
            self._waiting.append(self._begun())

    def begin(self, question: Question) -> _Answering:
        """Send a request to a waiting process. Raises OSError if it was ended, or if the system has no process."""
        try:
            process = self._waiting.popleft()
        except IndexError:  # all processes are busy
            process = self._begun()
        process.connection.send(question)
        self._waiting.append(self._begun())
        return process

    def waiting(self) -> list[_Answering]:
        """Return the processes that wait for a request."""
        return list(self._waiting)

    def _begun(self) -> _Answering:
        own_end, worker_end = self._context.Pipe()
        process = self._context.Process(
            target=_answer_spawned,
            args=(worker_end, os.getpid()),
            daemon=False,
        )
        with worker_end, stops_held_back():
            process.start()
        return _Answering(process, own_end)


class Service:
    """Service that starts processes, passes on their results, and ends them."""

    def __init__(self) -> None:
        self.processes = _ForkedProcesses() if has_forkserver() else _WaitingProcesses()
        self._running: set[_Answering] = set()
        self._closed = False

    async def ask(self, question: Question) -> AsyncIterator[tuple[str, Any]]:
        """Yield the results of a new process, which is ended when the caller stops iterating or is cancelled."""
        begun = asyncio.create_task(asyncio.to_thread(self._begin, question))
        try:
            try:
                process = await asyncio.shield(begun)
            except OSError as error:
                message = f"cannot start a worker process: {error.strerror or error}"
                yield "failed", HdassistError(message, limits_hint("check the limits of a process with ulimit -a"))
                return
            while process:
                if not await wait_until_readable(process.connection, process.process.sentinel):
                    return  # the process was ended before it started
                try:
                    yield process.connection.recv()
                except (EOFError, OSError):  # the process was ended
                    return
        finally:
            with suppress(asyncio.CancelledError, OSError):
                if process := await asyncio.shield(begun):
                    self._end(process)
                    process.connection.close()

    def _begin(self, question: Question) -> _Answering | None:
        """Start a process for a request; None if the service is closed. Raises OSError if there is no process."""
        if self._closed:
            return None
        process = self.processes.begin(question)
        self._running.add(process)
        if self._closed:  # closed in the meantime
            self.close()
        return process

    def _end(self, asked: _Answering) -> None:
        if asked in self._running:
            self._running.discard(asked)
            asked.end()

    def close(self) -> None:
        """End all processes that compute or wait for a request."""
        self._closed = True
        for process in list(self._running):
            self._end(process)
        for process in self.processes.waiting():
            process.end()


def _answer_forked(question: Question, there: Connection) -> None:
    """Compute a request in this process, which ends with the server process and thus with the screen."""
    begin_worker(os.getppid())
    _leave_screen()
    _answer(question, there)


def _answer_spawned(there: Connection, parent: int) -> None:
    """Compute one request in this process, which ends with the screen; parent: process id of the screen."""
    begin_worker(parent, of_thread=True)
    _leave_screen()
    import hdassist.interface.explorer.compute  # noqa: F401 (takes a second, so it precedes the request)

    with suppress(EOFError, OSError):  # the screen has ended without a request
        _answer(there.recv(), there)


def _leave_screen() -> None:
    """Redirect the output of this process to nowhere, because the terminal belongs to the screen."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)


def _answer(question: Question, there: Connection) -> None:
    """Compute a request and send each result as soon as it is available."""
    try:
        question(lambda *found: there.send(found))
    except HdassistError as error:
        there.send(("failed", error))
    except Exception as error:  # a bug, which the screen reports because this process has no terminal
        message = f"internal error: {type(error).__name__}: {error}"
        there.send(("failed", HdassistError(message, "report this bug")))
    finally:
        there.close()
