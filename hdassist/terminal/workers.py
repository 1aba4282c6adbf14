"""Processes that share the work of one command."""

from __future__ import annotations

import ctypes
import io
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, redirect_stderr, suppress
from multiprocessing import connection
from pathlib import Path

from hdassist.errors import DataError, Fault, UntrustedError

PR_SET_PDEATHSIG = 1  # linux/prctl.h
STOPS = (signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else []))


@contextmanager
def workers(jobs: int) -> Iterator[Executor]:
    """An executor of so many processes (0: one for each core).

    One job is a process too: the same arithmetic, so the same digits for any number of jobs.
    Raises DataError: the system gives no processes; UntrustedError: one of them was ended from outside.
    """
    with _refusals():
        context = multiprocessing.get_context(_way())
        if context.get_start_method() == "forkserver":
            context.set_forkserver_preload([name for name in list(sys.modules) if name.startswith("hdassist.")])
        pool = ProcessPoolExecutor(
            max_workers=count(jobs), mp_context=context, initializer=begin_worker, initargs=(os.getpid(),)
        )
    try:
        with _refusals():
            _begin_processes(pool)
        yield pool
    except BrokenProcessPool:
        words = "a process that shared the work was ended from outside: there is no answer"
        raise UntrustedError(words, "was memory short? fewer --jobs take less of it", Fault.WORKERS_LOST) from None
    finally:
        # a thread of the pool that writes to a worker just killed says so in a traceback of its own
        with _deaf(), redirect_stderr(io.StringIO()):
            if pool._pending_work_items:  # nobody waits for what is under way: a state may take for ever
                for process in list((pool._processes or {}).values()):
                    process.kill()
            with suppress(RuntimeError):  # its thread could not be started
                pool.shutdown(wait=True, cancel_futures=True)


def _begin_processes(pool: ProcessPoolExecutor) -> None:
    """Have a first task done. Raises RuntimeError: one of the pool's threads could not start, and it waits for ever."""
    told, died = threading.excepthook, list[str]()
    threading.excepthook = lambda end: died.append(str(end.exc_value))
    try:
        first = pool.submit(int)
        while not wait([first], timeout=0.2).done:
            if died:
                raise RuntimeError(died[0])
        first.result()
    finally:
        threading.excepthook = told


@contextmanager
def _refusals() -> Iterator[None]:
    """Raise DataError where the system refuses what processes need: memory to share, files, threads, themselves."""
    try:
        yield
    except BrokenProcessPool:  # is a RuntimeError too
        raise
    except (OSError, RuntimeError) as error:
        words = f"cannot begin the processes that share the work: {getattr(error, 'strerror', None) or error}"
        raise DataError(words, "they need /dev/shm, and room in the limits of ulimit -a") from None


def begin_worker(parent: int) -> None:
    """What a worker does first: leave interrupts to the process that began it, and end when that ends, in any way.

    parent: its process id. Linux kills the worker, even in the middle of a solver; elsewhere, and where a process
    between the two did the forking, which lives as long as its workers do, a thread waits for that.
    """
    for stop in STOPS:
        signal.signal(stop, signal.SIG_IGN if stop == signal.SIGINT else signal.SIG_DFL)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent or sys.platform != "linux":
        threading.Thread(target=_end_with_parent, daemon=True).start()
    if not Path("/proc", str(parent)).exists() and Path("/proc/self").exists():  # it ended before
        os._exit(1)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


@contextmanager
def _deaf() -> Iterator[None]:
    """Hear stops later: one that comes while a thread is waited for leaves Python 3.11 waiting for ever."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    heard = {number: signal.signal(number, lambda number, _: came.append(number)) for number in STOPS}
    try:
        yield
    finally:
        for number, handler in heard.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


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
