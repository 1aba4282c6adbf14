"""Execution of the work of a command: settings passed to computations, executors by name, and streams of many items."""

from __future__ import annotations

import atexit
import gc
import logging
import multiprocessing
import os
import pickle
import platform
import signal
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from importlib import import_module
from multiprocessing import connection
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from queue import SimpleQueue
from typing import Any, TypeVar

from hdassist.run.errors import DataError, Fault, UntrustedError, UsageError
from hdassist.run.stops import at_stop
from hdassist.run.system import (
    STOPS,
    begin_resource_tracker,
    command_line,
    core_count,
    has_ended,
    is_killed_with_parent,
    let_stops_in,
    limits_hint,
    start_method,
    stops_held_back,
)

_ResultT = TypeVar("_ResultT")
Progress = Callable[[int], None]
CROSS_SOLVER = "HIGHS"  # solver that solves some states again as a check


@dataclass(frozen=True)
class Run:
    """Execution settings: where work is done, its progress, the seed, and the solver of the cross-check.

    executor: executor that distributes the work (any of concurrent.futures; no result depends on it), None for this
        process.
    progress: function called with numbers of solved states.
    seed: seed of samples.
    cross_check: name of a cvxpy solver that solves the extremes and a sample of states again; None for no check.
    """

    executor: Executor | None = None
    progress: Progress | None = None
    seed: int = 0
    cross_check: str | None = CROSS_SOLVER

    def map(self, function: Callable[..., _ResultT], *columns: Iterable[Any]) -> Iterator[_ResultT]:
        """Return the results of a function over rows of arguments, in order."""
        return iter((self.executor.map if self.executor else map)(function, *columns))

    def solved(self, states: int) -> None:
        """Report newly solved states to the progress callback, if there is one.

        states: number of states.
        """
        if self.progress:
            self.progress(states)

    def beside(self, function: Callable[..., _ResultT], *arguments: Any) -> Future[_ResultT]:
        """Return the future result of a function that imports large packages, computed in parallel with other work.

        All such functions of a command share one process, so other processes need not import the packages.
        """
        if self.executor:
            # use the separate process if there is one, because it imports cvxpy
            return (getattr(self.executor, "beside", None) or self.executor).submit(function, *arguments)
        future: Future[_ResultT] = Future()
        # without processes the result is available at once
        future.set_result(function(*arguments))
        return future

    @property
    def at_a_time(self) -> int:
        """Number of tasks that are currently processed in parallel; 0 if unknown or in this process."""
        # executors of the standard library have no size
        return int(getattr(self.executor, "size", 0))

    @property
    def of_task(self) -> Run:
        """Settings for one task, which reports its progress itself only if it runs in this process."""
        return replace(
            self,
            executor=None,
            progress=None if self.executor else self.progress,
        )

    def finished(self, states: int) -> None:
        """Report the states of a finished task to the progress callback if the task ran in a separate process.

        states: number of states.
        """
        if self.executor:
            self.solved(states)


UNCHECKED = Run(cross_check=None)  # settings for work in this process without a cross-check

# --- dask: workers of another package, on one machine or many

_RETRIES = 3  # number of retries for a task whose worker was lost
TIMEOUT = 10.0  # longest time to wait for the response of a scheduler [s]
_Installation = Callable[[], object]  # returns everything that the digits of a result depend on


class Cluster(Executor):
    """An executor of another package that checks whether each worker has the same installation."""

    def __init__(
        self,
        engine: Executor,
        size: Callable[[], int],
        installation: _Installation,
    ) -> None:
        self._engine = engine
        self._size = size
        self._installation = installation
        self._known = 1
        self._asked = 0.0
        self._here = installation()

    @property
    def size(self) -> int:
        """Number of tasks processed in parallel, which changes as workers join and leave."""
        # each query sends a message to the scheduler
        if time.monotonic() > self._asked + _SECONDS:
            self._known = max(1, self._size())
            self._asked = time.monotonic()
        return self._known

    def submit(self, task: Callable[..., Any], /, *args: Any, **more: Any) -> Future[Any]:
        """Return the future result of a task."""
        return self._engine.submit(_same_there, self._installation, self._here, task, args, more)


def _same_there(
    installation: _Installation,
    expected: object,
    task: Callable[..., Any],
    args: tuple[Any, ...],
    more: dict[str, Any],
) -> Any:
    """Perform a task on a worker.

    Raises UntrustedError if the installation of the worker differs from that of the requesting process.
    """
    # other versions may give other last digits
    if (worker_installation := installation()) != expected:
        message = f"the worker on {platform.node()} has another installation: {worker_installation}, not {expected}"
        raise UntrustedError(message, "install the same versions on all machines", Fault.WORKERS_LOST)
    return task(*args, **more)


@contextmanager
def cluster(
    name: str,
    jobs: int,
    installation: _Installation,
) -> Iterator[Cluster]:
    """Provide an executor of another package, which remains for further use and ends with this process.

    name: dask, or dask=ADDRESS of a running scheduler.
    jobs: number of workers started without a scheduler (0: one per core).
    installation: function that returns everything that the digits of a result depend on.

    Raises UsageError if the executor is unknown or its package is not installed, DataError if it cannot be reached or
    started, UntrustedError if it lost the work or a worker has another installation.
    """
    kind, _, address = name.partition("=")
    if kind != "dask":
        raise UsageError(f"unknown executor: {name}", "use dask or dask=tcp://HOST:PORT")
    try:
        engine = _dask_cluster(address, jobs, installation)
    except ImportError as error:
        message = f"--executor dask needs a package that is not installed: {error.name or error}"
        raise UsageError(message, command_line(["pip", "install", "hdassist[dask]"])) from None
    # dask and its transports raise errors of many types when they cannot connect
    except Exception as error:
        message = f"cannot reach or start {name}: {str(error) or type(error).__name__}"
        raise DataError(
            message, "check that its scheduler is running and reachable from this machine", Fault.SYSTEM_LIMITS
        ) from None
    try:
        yield engine
    except Exception as error:
        # errors of tasks are not errors of dask
        if type(error).__module__.partition(".")[0] not in ("distributed", "dask", "concurrent"):
            raise
        message = f"dask lost the work: {str(error) or type(error).__name__}"
        hint = "check the log of its scheduler, then run the same command again to resume"
        raise UntrustedError(message, hint, Fault.WORKERS_LOST) from None


_clusters = ExitStack()  # closes the clusters that this process has started or connected to


@cache
def _dask_cluster(
    address: str,
    jobs: int,
    installation: _Installation,
) -> Cluster:
    """Return the cluster of a scheduler, or of workers on this machine, which is started once per process."""
    with ExitStack() as stack:
        client = _dask_client(stack, address, count(jobs))
        # pass the resources on only after everything has started
        _clusters.enter_context(stack.pop_all())
    engine = client.get_executor(pure=False, retries=_RETRIES)
    return Cluster(engine, lambda: sum(client.nthreads().values()), installation)


@atexit.register
def end_clusters() -> None:
    """End the clusters that this process has started, and disconnect from those that were already running."""
    # workers must end before the interpreter does
    _clusters.close()
    _dask_cluster.cache_clear()


def _dask_client(
    stack: ExitStack,
    address: str,
    worker_count: int,
) -> Any:
    """Return a dask client that is closed with the stack.

    Args:
        stack: stack that closes everything started here.
        address: address of a running scheduler, with TLS as in the configuration of dask; empty for workers on this
            machine.
        worker_count: number of workers started without an address.
    """
    config = import_module("dask.config")
    distributed = import_module("distributed")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # the error raised by cluster() contains the message
    # a running scheduler has its own configuration
    if address:
        return stack.enter_context(distributed.Client(address, timeout=TIMEOUT))
    # no dashboard pages, because they are open to every user of the machine
    stack.enter_context(
        config.set(
            {
                "logging.distributed": "critical",  # also in the workers
                "distributed.scheduler.http.routes": [],
                "distributed.worker.http.routes": [],
            }
        )
    )
    # Every user of the machine can connect to the ports of a local cluster, and a connection may run code, so the
    # cluster uses TLS with a key that only this process has.
    local_cluster = distributed.LocalCluster(
        n_workers=worker_count,
        threads_per_worker=1,
        host="127.0.0.1",
        protocol="tls://",
        security=distributed.Security.temporary(),
        silence_logs=logging.CRITICAL,
        dashboard_address="127.0.0.1:0",
        scheduler_kwargs={"dashboard": False},
    )
    stack.enter_context(local_cluster)
    return stack.enter_context(distributed.Client(local_cluster))


# --- very many items

_SECONDS = 2.0  # s; approximate duration of a chunk of work
_MANY = 100  # number of workers above which chunks become longer, because one process collects all results
MOST_ITEMS = 10_000  # largest number of items in a chunk
AHEAD = 3  # number of chunks in progress or done per process

_Work = Callable[[int, int], list[Any]]


def stream(
    work: _Work,
    total: int,
    *,
    done: int = 0,
    jobs: int = 0,
    seconds: float = _SECONDS,
    executor: Executor | None = None,
) -> Generator[list[Any], None, None]:
    """Yield the records of items done, done + 1, ... total - 1, in one list per chunk; closing it stops the work.

    Each chunk takes a few seconds, estimated from the duration of previous chunks. Only a few chunks are in progress,
    so memory does not grow with the number of items.

    work: picklable function that returns the records of items first ... last - 1. Chunk boundaries depend on its speed,
        so a record must not depend on them.
    total: number of items.
    done: number of items already done.
    jobs: number of processes (0: one per core).
    seconds: duration of a chunk [s].
    executor: any executor of concurrent.futures, in place of such processes.

    Raises the errors of the work, and UntrustedError if a process was ended from outside.
    """
    # the work is pickled only once instead of with each chunk
    pickled = pickle.dumps(work)
    # each chunk has its number of items and its future result
    chunks: deque[tuple[int, Future[tuple[float, list[Any]]]]] = deque()
    # `cost` and `counted` are the duration [s] and number of items of finished chunks; recent chunks have more weight
    end = done
    cost = 0.0
    counted = 0.0
    # an executor passed by the caller is not ended here
    with nullcontext(executor) if executor else workers(jobs) as engine:
        try:
            while done < total:
                at_a_time = engine.size if isinstance(engine, Cluster) else count(jobs)
                # a few chunks are submitted in advance because no worker should wait for the results to be collected
                while end < total and len(chunks) < AHEAD * at_a_time:
                    # the size follows from the measured duration of an item; it is 0 before the first chunk is done
                    by_time = int(seconds * max(1.0, at_a_time / _MANY) * counted / max(cost, 1e-9))
                    # chunks become smaller at the end, which lets all processes finish together
                    to_the_end = -(-(total - end) // (2 * at_a_time))
                    size = max(1, min(by_time, MOST_ITEMS, to_the_end))
                    chunks.append((size, engine.submit(_timed, pickled, end, end + size)))
                    end += size
                # results are collected in order because the records of a file are in the order of the items
                size, answer = chunks.popleft()
                took, records = answer.result()
                if len(records) != size:
                    raise ValueError(f"expected {size} records, not {len(records)}")
                # the weight of older chunks is halved each time
                cost = cost / 2 + took
                counted = counted / 2 + size
                done = done + size
                yield records
        finally:
            # chunks remain if the consumer stopped or an error was raised
            for _, answer in chunks:
                answer.cancel()


def _timed(
    work: bytes,
    first: int,
    last: int,
) -> tuple[float, list[Any]]:
    """Return the time that items took [s], and their records.

    work: the pickled work.
    first, last: first item, and the item after the last.
    """
    begun = time.perf_counter()
    records = _unpickled(work)(first, last)
    return time.perf_counter() - begun, records


@lru_cache(maxsize=1)
def _unpickled(work: bytes) -> _Work:
    """Return the unpickled work, which is the same object for all chunks of a process to preserve its caches."""
    function: _Work = pickle.loads(work)
    return function


# --- processes of this machine

_SHUTDOWN = 2.0  # s; longest wait for killed processes to end

Task = tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]


@contextmanager
def workers(jobs: int) -> Iterator[Executor]:
    """Provide an executor of worker processes, which end with the block, whatever they are doing.

    A further process serves `Run.beside`, except where it would have to import everything again. A single job is also a
    process, so the arithmetic and its last digits are the same for any number of jobs.

    jobs: number of processes (0: one per core).

    Raises DataError if the system does not start processes, UntrustedError if one of them was ended from outside.
    """
    # a spawned process would have to import everything again for a single check
    executor = Processes(count(jobs), has_beside=start_method() != "spawn")
    # a stop must not leave processes behind
    with at_stop(executor.kill):
        try:
            try:
                executor.begin()
            except BrokenExecutor:  # a process was ended while others were being started
                raise
            except (OSError, RuntimeError, EOFError) as error:
                reason = getattr(error, "strerror", None) or str(error) or "a process ended before it began"
                message = f"cannot start worker processes: {reason}"
                raise DataError(
                    message, limits_hint("check the free memory and the limits shown by ulimit -a")
                ) from None
            yield executor
        except BrokenExecutor:
            message = "a worker process was killed; there is no result"
            hint = "if memory ran out, reduce --jobs"
            raise UntrustedError(message, hint, Fault.WORKERS_LOST) from None
        finally:
            executor.end()


@dataclass
class _Worker:
    """The pipe to a worker process and the sentinel that signals its exit.

    is_there: whether the process has opened its side of the pipe. Until it has, Windows keeps that side open in the
        parent, so waiting on the pipe alone would never return if the process were killed before it started.
    """

    pipe: Connection
    sentinel: int
    is_there: bool = False

    def answer(self, task: Task) -> tuple[bool, Any]:
        """Return whether a task succeeded, and its result or error.

        Raises EOFError or OSError if the process has ended.
        """
        # the first message signals that the process is running
        if not self.is_there:
            self._received()
            self.is_there = True
        self.pipe.send(task)
        is_done, result = self._received()
        return is_done, result

    def _received(self) -> Any:
        # the sentinel is ready if the process has ended, in which case there is no result
        if self.pipe not in connection.wait([self.pipe, self.sentinel]):
            raise EOFError
        return self.pipe.recv()


class Processes(ThreadPoolExecutor):
    """Processes to which threads pass tasks through pipes, because a standard pool may wait for a killed process.

    size: number of processes.
    beside: executor with one further process, for tasks that import large packages; None if there is no such process.
    """

    def __init__(self, count: int, *, has_beside: bool = False) -> None:
        # each process has one thread here, which waits for its pipe
        super().__init__(count)
        self.beside = Processes(1) if has_beside else None
        self.size = count
        self._is_over = False
        self._processes: list[BaseProcess] = []
        self._idle: SimpleQueue[_Worker] = SimpleQueue()

    def begin(self) -> None:
        """Start all processes, then the threads, because a fork may inherit a lock of a thread that is never released.

        Raises OSError, RuntimeError or EOFError if the system does not provide a process, pipe or thread.
        """
        way = start_method()
        context: Any = multiprocessing.get_context(way)
        if way != "fork":
            begin_resource_tracker()
        # modules are imported once, in the server
        if way == "forkserver":
            from multiprocessing import forkserver  # not available on Windows

            context.set_forkserver_preload([name for name in list(sys.modules) if name.startswith("hdassist.")])
            with stops_held_back():
                forkserver.ensure_running()
        pools = [self.beside, self] if self.beside else [self]
        pool_of_worker = [pool for pool in pools for _ in range(pool.size)]
        for pool in pool_of_worker:
            own_end, worker_end = context.Pipe()
            process = context.Process(target=_work, args=(own_end, worker_end, os.getpid()))
            with worker_end, nullcontext() if way == "forkserver" else stops_held_back():
                process.start()
            pool._processes.append(process)
            pool._idle.put(_Worker(own_end, process.sentinel))
        for pool in pool_of_worker:
            pool.submit(abs, 0)

    def submit(self, task: Callable[..., Any], /, *args: Any, **more: Any) -> Future[Any]:
        """Return the future result of a task.

        Raises BrokenExecutor if a process was ended from outside.
        """
        if self._is_over:
            raise BrokenExecutor
        return super().submit(self._answer, (task, args, more))

    def _answer(self, task: Task) -> Any:
        """Return the result of a task from a process; if the process is lost, all others end as well."""
        # there are as many threads as processes, so there is always an idle process
        worker = self._idle.get()
        try:
            # this blocks only the current thread
            is_done, result = worker.answer(task)
        except (EOFError, OSError):
            self.kill()
            raise BrokenExecutor from None
        finally:
            self._idle.put(worker)
        if is_done:
            return result
        raise result

    def kill(self) -> None:
        """End the processes immediately."""
        if self.beside:
            self.beside.kill()
        self._is_over = True
        # processes are killed instead of terminated, because a solver does not handle signals
        for process in self._processes:
            process.kill()

    def end(self) -> None:
        """End processes and threads without waiting for work in progress, because a state may never finish."""
        self.kill()
        if self.beside:
            self.beside.end()
        self.shutdown(cancel_futures=True)
        for process in self._processes:
            process.join(_SHUTDOWN)


def _work(
    here: Connection,
    there: Connection,
    parent: int,
) -> None:
    """Perform tasks from a pipe one after the other until it is closed.

    here: the parent's side of the pipe, which a fork has inherited.
    there: this process's side of the pipe.
    parent: id of the parent process.
    """
    begin_worker(parent)
    # frozen before any task, imported modules stay shared with the parent and are skipped by the garbage collector
    gc.freeze()
    here.close()
    with suppress(OSError):  # the parent process has ended
        there.send(None)
    while True:
        try:
            task, args, keywords = there.recv()
        except (EOFError, OSError):
            return
        try:
            there.send((True, task(*args, **keywords)))
        except Exception as error:  # any error of a task is raised again where its result is requested
            # the note contains the traceback for --debug, because a traceback object cannot be pickled
            error.add_note("".join(traceback.format_exception(error)))
            with suppress(OSError):  # the requesting process has ended
                there.send((False, error))


def begin_worker(parent: int, *, of_thread: bool = False) -> None:
    """Leave stops to the parent process, and end this process when the parent ends for any reason.

    Linux kills the worker, even in the middle of a solver. On other systems, and if an intermediate process did the
    forking, a thread waits for the end of the parent, because the intermediate process lives as long as its workers.

    parent: id of the parent process.
    of_thread: whether a thread started this process; the end of that thread would count as the end of the parent on
        Linux.
    """
    for stop in STOPS:  # SIGTERM ends a single process; the other signals come from a terminal and reach all processes
        if signal.getsignal(stop) is not signal.SIG_IGN:
            signal.signal(stop, signal.SIG_DFL if stop == signal.SIGTERM else signal.SIG_IGN)
    let_stops_in()
    # if the system does not kill this process, a thread watches the parent
    if of_thread or not is_killed_with_parent(parent):
        threading.Thread(target=_end_with_parent, daemon=True).start()
    # the parent may have ended between the start of this process and the request to the system
    if has_ended(parent):
        # the process exits without cleanup, because files belong to the parent
        os._exit(1)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def count(jobs: int) -> int:
    """Return the number of processes.

    jobs: requested number; 0 means one per core.
    """
    return jobs or core_count()
