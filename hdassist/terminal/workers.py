"""Processes that share the work of one command."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import connection
from pathlib import Path

PR_SET_PDEATHSIG = 1  # linux/prctl.h


@contextmanager
def workers(jobs: int) -> Iterator[Executor]:
    """An executor of so many processes (0: one for each core).

    One job is a process too: the same arithmetic, so the same digits for any number of jobs.
    """
    context = multiprocessing.get_context(_way())
    if context.get_start_method() == "forkserver":
        context.set_forkserver_preload([name for name in list(sys.modules) if name.startswith("hdassist.")])
    pool = ProcessPoolExecutor(max_workers=count(jobs), mp_context=context, initializer=_begin, initargs=(os.getpid(),))
    try:
        yield pool
    finally:
        with _deaf():
            if pool._pending_work_items:  # nobody waits for what is under way: a state may take for ever
                for process in list((pool._processes or {}).values()):
                    process.kill()
            pool.shutdown(wait=True, cancel_futures=True)


def _begin(parent: int) -> None:
    """What a worker does first: leave interrupts to the process that began it, and end when that ends, in any way.

    parent: its process id. Linux kills the worker, even in the middle of a solver; elsewhere a thread waits for that.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for stop in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(stop, signal.SIG_DFL)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    else:
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
    """Do not hear an interrupt: one that comes while a thread is waited for leaves Python 3.11 waiting for ever."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, heard)


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
