"""How the work of a command is carried out: one object that computations are given, engines by name, long streams."""

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

from hdassist.errors import DataError, Fault, UntrustedError, UsageError
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
CROSS_SOLVER = "HIGHS"  # the solver by which some states are solved again


@dataclass(frozen=True)
class Run:
    """How work is carried out: where, watched by whom, from which seed, and checked by which solver.

    executor: spreads the work (any of concurrent.futures; no number depends on it), None for this process; progress:
    called with numbers of states that were solved; seed of samples; cross_check: the solver, of those that cvxpy knows,
    by which extremes and a sample of states are solved again, None for none.
    """

    executor: Executor | None = None
    progress: Progress | None = None
    seed: int = 0
    cross_check: str | None = CROSS_SOLVER

    def map(self, function: Callable[..., _ResultT], *columns: Iterable[Any]) -> Iterator[_ResultT]:
        """Return the results of a function over rows of arguments, in their order."""
        return iter((self.executor.map if self.executor else map)(function, *columns))

    def solved(self, states: int) -> None:
        """Report to the progress that so many states more were solved."""
        if self.progress:
            self.progress(states)

    def beside(self, function: Callable[..., _ResultT], *arguments: Any) -> Future[_ResultT]:
        """Answer of a function that imports much, found while the rest goes on.

        All such functions of a command share one process, whose imports the others are spared.
        """
        if self.executor:
            # a process of its own if there is one, since it imports cvxpy
            return (getattr(self.executor, "beside", None) or self.executor).submit(function, *arguments)
        future: Future[_ResultT] = Future()
        # without processes the answer is there at once
        future.set_result(function(*arguments))
        return future

    @property
    def at_a_time(self) -> int:
        """How many tasks are worked on at a time by now; 0 if that is not known, or in this process."""
        # executors of the library have no size
        return int(getattr(self.executor, "size", 0))

    @property
    def of_task(self) -> Run:
        """The run of one task: in a process of its own, which reports once it is done, or in this one."""
        return replace(
            self,
            executor=None,
            progress=None if self.executor else self.progress,
        )

    def finished(self, states: int) -> None:
        """Report the states of a task to the progress, where it could not do so itself."""
        if self.executor:
            self.solved(states)


UNCHECKED = Run(cross_check=None)  # in this process, no state solved again

# --- dask: workers of another package, on one machine or many

_RETRIES = 3  # attempts for a task whose worker was lost
TIMEOUT = 10.0  # s for a scheduler to answer
_Installation = Callable[[], object]  # all that the digits of an answer depend on, if it is called


class Cluster(Executor):
    """An executor of another package, each worker of which is asked whether it has the same installation.

    size: how many tasks it works on at a time, by now.
    """

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
        """How many tasks are worked on at a time: workers may join and leave."""
        # asking a scheduler takes a message to it
        if time.monotonic() > self._asked + _SECONDS:
            self._known = max(1, self._size())
            self._asked = time.monotonic()
        return self._known

    def submit(self, task: Callable[..., Any], /, *args: Any, **more: Any) -> Future[Any]:
        """Return the answer of a task."""
        return self._engine.submit(_same_there, self._installation, self._here, task, args, more)


def _same_there(
    installation: _Installation,
    expected: object,
    task: Callable[..., Any],
    args: tuple[Any, ...],
    more: dict[str, Any],
) -> Any:
    """Do a task on a worker. Raises UntrustedError: its installation is not that of the process that asks."""
    # other versions may have other last digits
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
    """An engine by its name, as ENGINES has it; it stays for the next time, and ends with this process.

    Arguments: name, with "=ADDRESS" of a scheduler that runs already; jobs, workers that are begun if there is none
    (0: one for each core); installation. Raises UsageError: no such engine, or its package is not there; DataError: it
    cannot be reached or begun; UntrustedError: it has lost the work, or a worker has another installation.
    """
    kind, _, address = name.partition("=")
    if kind != "dask":
        raise UsageError(f"unknown executor: {name}", "use dask or dask=tcp://HOST:PORT")
    try:
        engine = _dask_cluster(address, jobs, installation)
    except ImportError as error:
        message = f"--executor dask needs a package that is not installed: {error.name or error}"
        raise UsageError(message, command_line(["pip", "install", "hdassist[dask]"])) from None
    # all of them mean that no work can be done there
    except Exception as error:  # dask and its transports raise errors of many types when they cannot connect
        message = f"cannot reach or start {name}: {str(error) or type(error).__name__}"
        raise DataError(
            message, "check that its scheduler is running and reachable from this machine", Fault.SYSTEM_LIMITS
        ) from None
    try:
        yield engine
    except Exception as error:
        # errors of tasks are not those of dask
        if type(error).__module__.partition(".")[0] not in ("distributed", "dask", "concurrent"):
            raise
        message = f"dask lost the work: {str(error) or type(error).__name__}"
        hint = "see the log of its scheduler; then resume with the same command"
        raise UntrustedError(message, hint, Fault.WORKERS_LOST) from None


_clusters = ExitStack()  # closes the clusters that this process has begun or is connected to


@cache
def _dask_cluster(
    address: str,
    jobs: int,
    installation: _Installation,
) -> Cluster:
    """Return the cluster of a scheduler, or of workers on this machine, begun once and kept until this process ends."""
    with ExitStack() as stack:
        client = _dask_client(stack, address, count(jobs))
        # handed over only when everything has begun
        _clusters.enter_context(stack.pop_all())
    engine = client.get_executor(pure=False, retries=_RETRIES)
    return Cluster(engine, lambda: sum(client.nthreads().values()), installation)


@atexit.register
def end_clusters() -> None:
    """End the engines that this process has begun, and leave those that ran already."""
    # workers end before the interpreter does
    _clusters.close()
    _dask_cluster.cache_clear()


def _dask_client(
    stack: ExitStack,
    address: str,
    worker_count: int,
) -> Any:
    """Return a client of dask, closed with the stack.

    Arguments:
        stack: what is begun here ends with it.
        address: of a running scheduler, with TLS as dask's own configuration has it; empty for workers on this machine.
        worker_count: workers that are begun without an address.
    """
    config = import_module("dask.config")
    distributed = import_module("distributed")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # the error that cluster() raises has the message
    # a running scheduler has its own configuration
    if address:
        return stack.enter_context(distributed.Client(address, timeout=TIMEOUT))
    # no pages of a dashboard: they are open to every user of the machine
    stack.enter_context(
        config.set(
            {
                "logging.distributed": "critical",  # in the workers too
                "distributed.scheduler.http.routes": [],
                "distributed.worker.http.routes": [],
            }
        )
    )
    # Every user of the machine can connect to the ports of a local cluster, and a connection may run code: TLS with a
    # key that only this process has.
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

_SECONDS = 2.0  # approximate duration of a chunk of work
_MANY = 100  # workers, from which on chunks grow with their number: one process takes all their answers
MOST_ITEMS = 10_000  # items in a chunk
AHEAD = 3  # chunks under way or done for each process

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
    """Yield records of the items done, done + 1, ... total - 1, in lists of one chunk each; close it to stop the work.

    Items go out in chunks that take a few seconds each, by the time of those before them, and only so many ahead of the
    one that is waited for: memory does not grow with the number of items.
    Arguments: work, which can be pickled and gives the records of the items first ... last - 1: where chunks begin and
    end depends on how fast it is, so a record must not depend on that; total; done, how many items are done already;
    jobs, processes at work (0: one for each core); seconds of work in a chunk; executor in place of such processes, any
    of concurrent.futures.
    Raises the errors of the work; UntrustedError: a process was ended from outside.
    """
    # once, instead of with each chunk
    pickled = pickle.dumps(work)
    chunks: deque[tuple[int, Future[tuple[float, list[Any]]]]] = deque()  # items of each, and its answer
    # s and items of chunks that are done, the last ones counting most
    end = done
    cost = 0.0
    counted = 0.0
    # an executor that was passed is not ended here
    with nullcontext(executor) if executor else workers(jobs) as engine:
        try:
            while done < total:
                at_a_time = engine.size if isinstance(engine, Cluster) else count(jobs)
                # a few chunks ahead, so that no process waits for the one that collects
                while end < total and len(chunks) < AHEAD * at_a_time:
                    # at the measured cost of an item; 0 before the first chunk is done
                    by_time = int(seconds * max(1.0, at_a_time / _MANY) * counted / max(cost, 1e-9))
                    to_the_end = -(-(total - end) // (2 * at_a_time))  # smaller ones there: all end together
                    size = max(1, min(by_time, MOST_ITEMS, to_the_end))
                    chunks.append((size, engine.submit(_timed, pickled, end, end + size)))
                    end += size
                # in their order: records of a file stand in the order of the items
                size, answer = chunks.popleft()
                took, records = answer.result()
                if len(records) != size:
                    raise ValueError(f"{len(records)} records of {size} items")
                # older chunks count half as much each time
                cost = cost / 2 + took
                counted = counted / 2 + size
                done = done + size
                yield records
        finally:
            # the consumer stopped, or an error came up
            for _, answer in chunks:
                answer.cancel()


def _timed(
    work: bytes,
    first: int,
    last: int,
) -> tuple[float, list[Any]]:
    """Return how long some items took [s], and their records; work, pickled."""
    begun = time.perf_counter()
    records = _unpickled(work)(first, last)
    return time.perf_counter() - begun, records


@lru_cache(maxsize=1)
def _unpickled(work: bytes) -> _Work:
    """Return the work, unpickled once in each process: its caches stay from chunk to chunk."""
    function: _Work = pickle.loads(work)
    return function


# --- processes of this machine

_SHUTDOWN = 2.0  # s at most for processes that were killed to end

Task = tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]


@contextmanager
def workers(jobs: int) -> Iterator[Executor]:
    """An executor of so many processes (0: one for each core), which end with the block, whatever they are doing.

    One more is begun for `Run.beside`, but where it would have to import all that it needs. One job is a process too:
    the same arithmetic, so the same digits for any number of jobs.
    Raises DataError: the system gives no processes; UntrustedError: one of them was ended from outside.
    """
    # a spawned process would import everything anew for a single check
    executor = Processes(count(jobs), has_beside=start_method() != "spawn")
    # a stop must not leave processes behind
    with at_stop(executor.kill):
        try:
            try:
                executor.begin()
            except BrokenExecutor:  # a process was ended while others were begun
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
    """The pipe to a process and the sentinel that tells its end; is_there: whether the process has opened its end.

    Until then Windows keeps that end open here: a process that is killed before it begins would be waited for for ever.
    """

    pipe: Connection
    sentinel: int
    is_there: bool = False

    def answer(self, task: Task) -> tuple[bool, Any]:
        """Return whether a task was done, and its result or error. Raises EOFError, OSError: the process has ended."""
        # the first message tells that the process runs
        if not self.is_there:
            self._received()
            self.is_there = True
        self.pipe.send(task)
        is_done, result = self._received()
        return is_done, result

    def _received(self) -> Any:
        # the sentinel is ready if the process has ended; then there is no answer
        if self.pipe not in connection.wait([self.pipe, self.sentinel]):
            raise EOFError
        return self.pipe.recv()


class Processes(ThreadPoolExecutor):
    """Processes to which threads hand out tasks through pipes: a pool of the library may wait for a killed one.

    size: their number; beside: an executor of one process more, for tasks that import much, None without.
    """

    def __init__(self, count: int, *, has_beside: bool = False) -> None:
        # a thread for each process, which waits for its pipe
        super().__init__(count)
        self.beside = Processes(1) if has_beside else None
        self.size = count
        self._is_over = False
        self._processes: list[BaseProcess] = []
        self._idle: SimpleQueue[_Worker] = SimpleQueue()

    def begin(self) -> None:
        """Begin all processes, then the threads: a fork beside threads may inherit a lock that nobody opens.

        Raises OSError, RuntimeError and EOFError: the system gives no process, pipe or thread.
        """
        way = start_method()
        context: Any = multiprocessing.get_context(way)
        if way != "fork":
            begin_resource_tracker()
        # modules are imported once, in the server
        if way == "forkserver":
            from multiprocessing import forkserver  # Windows has none

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
        """Return the answer of a task. Raises BrokenExecutor: a process was ended from outside."""
        if self._is_over:
            raise BrokenExecutor
        return super().submit(self._answer, (task, args, more))

    def _answer(self, task: Task) -> Any:
        """Return the answer of a process to a task; where one is lost all others end too."""
        # as many threads as processes: there is always an idle one
        worker = self._idle.get()
        try:
            # blocks this thread, not the others
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
        """End the processes now."""
        if self.beside:
            self.beside.kill()
        self._is_over = True
        # killed, not asked: a solver does not listen
        for process in self._processes:
            process.kill()

    def end(self) -> None:
        """End processes and threads; nobody waits for work under way: a state may take for ever."""
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
    """Do tasks from a pipe, one after the other, to its end; here, the parent's end, which a fork has inherited."""
    begin_worker(parent)
    # before any task makes objects
    gc.freeze()  # modules that the parent imported stay shared with it, and are gone through no more
    here.close()
    with suppress(OSError):  # the process that began this one has ended
        there.send(None)
    while True:
        try:
            task, args, keywords = there.recv()
        except (EOFError, OSError):
            return
        try:
            there.send((True, task(*args, **keywords)))
        except Exception as error:  # whatever a task raises is raised where its result is asked for
            error.add_note("".join(traceback.format_exception(error)))  # for --debug: a traceback cannot be pickled
            with suppress(OSError):  # the process that asked has ended
                there.send((False, error))


def begin_worker(parent: int, *, of_thread: bool = False) -> None:
    """Leave stops to the process that began this one, and end when that ends, in any way.

    parent: its process id; of_thread: whether a thread began this one that may end earlier, which Linux takes for the
    end of the parent.

    Linux kills the worker, even in the middle of a solver; elsewhere, and where a process between the two did the
    forking, which lives as long as its workers do, a thread waits for that.
    """
    for stop in STOPS:  # one process can be ended by SIGTERM; the others come from a terminal, for all of them
        if signal.getsignal(stop) is not signal.SIG_IGN:
            signal.signal(stop, signal.SIG_DFL if stop == signal.SIGTERM else signal.SIG_IGN)
    let_stops_in()
    # where the system does not kill it, a thread watches the parent
    if of_thread or not is_killed_with_parent(parent):
        threading.Thread(target=_end_with_parent, daemon=True).start()
    # between the beginning of this process and the request to the system
    if has_ended(parent):
        # no clean-up: files belong to the parent
        os._exit(1)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def count(jobs: int) -> int:
    """Return the number of processes; 0 stands for one per core."""
    return jobs or core_count()
