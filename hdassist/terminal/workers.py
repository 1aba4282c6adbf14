"""Processes that share the work of one command."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def workers(jobs: int) -> Iterator[Executor]:
    """An executor of so many processes (0: one for each core).

    One job is a process too: the same arithmetic, so the same digits for any number of jobs.
    """
    context = multiprocessing.get_context(_way())
    if context.get_start_method() == "forkserver":
        context.set_forkserver_preload([name for name in list(sys.modules) if name.startswith("hdassist.")])
    pool = ProcessPoolExecutor(
        max_workers=count(jobs),
        mp_context=context,
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_IGN),  # an interrupt is the parent's to handle
    )
    try:
        yield pool
    finally:
        with _deaf():
            pool.shutdown(wait=True, cancel_futures=True)


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
