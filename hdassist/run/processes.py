"""Processes that share the work of one command."""

import ctypes
import gc
import multiprocessing
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager, nullcontext, suppress
from multiprocessing import connection, forkserver, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from hdassist.errors import DataError, Fault, UntrustedError
from hdassist.run.stops import STOPS, at_stop, stops_held_back

PR_SET_PDEATHSIG = 1  # linux/prctl.h
SHUTDOWN = 2.0  # s at most for processes that were killed, and for the threads that read from them, to end

Task = tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]


@contextmanager
def workers(jobs: int) -> Iterator[Executor]:
    """An executor of so many processes (0: one for each core), which end with the block, whatever they are doing.

    One job is a process too: the same arithmetic, so the same digits for any number of jobs.
    Raises DataError: the system gives no processes; UntrustedError: one of them was ended from outside.
    """
    executor = Processes()
    with at_stop(executor.kill):
        try:
            try:
                executor.begin(count(jobs))
            except (OSError, RuntimeError, EOFError) as error:
                words = f"cannot begin the processes that share the work: {getattr(error, 'strerror', None) or error}"
                raise DataError(words, "they need memory, and room in the limits of ulimit -a") from None
            yield executor
        except BrokenExecutor:
            words = "a process that shared the work was ended from outside: there is no answer"
            hint = "was memory short? fewer --jobs take less of it"
            raise UntrustedError(words, hint, Fault.WORKERS_LOST) from None
        finally:
            executor.end()


class Processes(Executor):
    """Processes, each with a pipe and a thread that gives it one task after the other."""

    def __init__(self) -> None:
        self._tasks: SimpleQueue[tuple[Future[Any], Task] | None] = SimpleQueue()
        self._processes: list[BaseProcess] = []
        self._threads: list[threading.Thread] = []
        self._is_over = False

    def begin(self, count: int) -> None:
        """Begin all processes, then the threads: a fork beside threads may inherit a lock that nobody opens.

        Raises OSError, RuntimeError and EOFError: the system gives no process, pipe or thread.
        """
        way = _way()
        context: Any = multiprocessing.get_context(way)
        if way != "fork":
            resource_tracker.ensure_running()  # now, as it lets signals in that are held back
        if way == "forkserver":
            context.set_forkserver_preload([name for name in list(sys.modules) if name.startswith("hdassist.")])
            with stops_held_back():
                forkserver.ensure_running()
        ends = []
        for _ in range(count):
            here, there = context.Pipe()
            process = context.Process(target=_work, args=(here, there, os.getpid()), daemon=True)
            with there, nullcontext() if way == "forkserver" else stops_held_back():
                process.start()
            self._processes.append(process)
            ends.append(here)
        for here in ends:
            thread = threading.Thread(target=self._hand_out, args=(here,), daemon=True)
            thread.start()
            self._threads.append(thread)

    def submit(self, task: Callable[..., Any], /, *args: Any, **more: Any) -> Future[Any]:
        """The answer of a task. Raises BrokenExecutor: a process was ended from outside."""
        if self._is_over:
            raise BrokenExecutor
        answer: Future[Any] = Future()
        self._tasks.put((answer, (task, args, more)))
        return answer

    def _hand_out(self, process: Connection) -> None:
        """Give tasks to the process at the other end of a pipe, to the end; where it is lost all others end too."""
        with process:
            while asked := self._tasks.get():
                answer, task = asked
                if not answer.set_running_or_notify_cancel():
                    continue
                try:
                    if self._is_over:
                        raise EOFError
                    process.send(task)
                    is_done, found = process.recv()
                except (EOFError, OSError):
                    self._is_over = True
                    self.kill()
                    answer.set_exception(BrokenExecutor())
                except Exception as error:  # of a task or answer that cannot be pickled: whatever its class raises
                    answer.set_exception(error)
                else:
                    (answer.set_result if is_done else answer.set_exception)(found)

    def kill(self) -> None:
        """End the processes now."""
        for process in self._processes:
            process.kill()

    def end(self) -> None:
        """End processes and threads; nobody waits for work under way: a state may take for ever."""
        self._is_over = True
        self.kill()
        for _ in self._threads:
            self._tasks.put(None)
        until = time.monotonic() + SHUTDOWN
        ending: list[threading.Thread | BaseProcess] = [*self._threads, *self._processes]
        for each in ending:
            each.join(max(0.0, until - time.monotonic()))


def apart(function: Callable[..., Any], *arguments: Any) -> Any:
    """Result of a function that imports much, found by a worker in a process of its own, which takes its memory along.

    Elsewhere, and where processes are not forked, in this one. Raises BrokenExecutor: that process was ended.
    """
    if multiprocessing.parent_process() is None or _way() != "fork":
        return function(*arguments)
    here, there = multiprocessing.Pipe()
    if not (child := os.fork()):
        _work(here, there, os.getppid())
        os._exit(0)
    with here, there:
        try:
            here.send((function, arguments, {}))
            there.close()
            is_done, found = here.recv()
        except (EOFError, OSError):
            raise BrokenExecutor from None
        finally:
            here.close()
            os.waitpid(child, 0)
    if is_done:
        return found
    raise found


def _work(here: Connection, there: Connection, parent: int) -> None:
    """Do tasks from a pipe, one after the other, to its end; here, the parent's end, which a fork has inherited."""
    begin_worker(parent)
    gc.freeze()  # modules that the parent imported stay shared with it, and are gone through no more
    here.close()
    while True:
        try:
            task, args, more = there.recv()
        except (EOFError, OSError):
            return
        try:
            there.send((True, task(*args, **more)))
        except Exception as error:  # whatever a task raises is raised where its result is asked for
            error.add_note("".join(traceback.format_exception(error)))  # for --debug: a traceback cannot be pickled
            with suppress(OSError):  # the process that asked has ended
                there.send((False, error))


def begin_worker(parent: int) -> None:
    """Leave stops to the process that began this one, and end when that ends, in any way; parent: its process id.

    Linux kills the worker, even in the middle of a solver; elsewhere, and where a process between the two did the
    forking, which lives as long as its workers do, a thread waits for that.
    """
    for stop in STOPS:  # one process can be ended by SIGTERM; the others come from a terminal, for all of them
        if signal.getsignal(stop) is not signal.SIG_IGN:
            signal.signal(stop, signal.SIG_DFL if stop == signal.SIGTERM else signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPS)
    is_killed = sys.platform == "linux" and ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL) == 0
    if os.getppid() != parent or not is_killed:
        threading.Thread(target=_end_with_parent, daemon=True).start()
    if not Path("/proc", str(parent)).exists() and Path("/proc/self").exists():  # it ended before
        os._exit(1)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _way() -> str:
    """How processes begin: with all that is imported here already (a second each), where that can be had.

    A fork of a process with threads may inherit a lock that nobody will open; there a process without threads, which
    has imported the same, does the forking. Solvers start threads that Python does not know of; the system does.
    """
    if sys.platform != "linux":
        return "spawn"
    tasks = Path("/proc/self/task")
    threads = len(list(tasks.iterdir())) if tasks.exists() else threading.active_count()
    return "fork" if threads == 1 else "forkserver"


def count(jobs: int) -> int:
    """So many processes (0: one for each core)."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return jobs or cores
