"""Where the work of a command is done: by processes here, or by the workers of a dask.distributed cluster."""

from __future__ import annotations

import json
import logging
import os
import platform
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from hdassist.errors import DataError, Fault, UntrustedError, UsageError
from hdassist.run.processes import count, workers
from hdassist.textfile import read_bytes
from hdassist.version import __version__

if TYPE_CHECKING:
    from distributed import Client

WAIT = 5.0  # s for a scheduler to answer
WORKERS_WAIT = 10.0  # s for it to have a worker
DECISIVE_PACKAGES = ("numpy", "scipy", "cvxpy", "daqp")  # whose versions decide the digits of an answer
_ALONE = threading.Lock()  # a worker may have threads; solvers are made for one

Pool = Callable[[], AbstractContextManager[tuple[Executor, int]]]


@contextmanager
def pools(address: str | None, jobs: int) -> Iterator[Pool]:
    """What begins an executor and tells how many tasks it works on at a time; a cluster is reached before that.

    Arguments: address of a cluster's scheduler, None for processes; jobs, processes here (0: one for each core).
    Raises UsageError: jobs of a cluster; DataError: distributed is not installed, the cluster is not reached, has no
    workers, or others than this process.
    """
    if address is None:
        yield partial(_processes, jobs)
        return
    if jobs:
        raise UsageError("--jobs is for processes on this machine", f"{address} has the workers that it has")
    _require_distributed()
    with _reached(address) as client:
        _require_same(client, address)
        yield partial(_on_cluster, client)


@contextmanager
def _processes(jobs: int) -> Iterator[tuple[Executor, int]]:
    with workers(jobs) as executor:
        yield executor, count(jobs)


@contextmanager
def _on_cluster(client: Client) -> Iterator[tuple[Executor, int]]:
    """An executor of a cluster's workers. Raises DataError: the scheduler is lost; UntrustedError: workers died."""
    from distributed.scheduler import KilledWorker

    executor = client.get_executor(pure=False)  # type: ignore[no-untyped-call]
    try:
        yield _Checked(executor), len(_workers_of(client))
    except KilledWorker:
        words = "workers of the cluster were ended from outside, again and again, over the same items"
        raise UntrustedError(words, "was memory short?", Fault.WORKERS_LOST) from None
    except CancelledError:
        raise DataError(
            "the scheduler was lost", "is it still running? the same command goes on", Fault.SCHEDULER_LOST
        ) from None
    finally:
        executor.shutdown(wait=False)


class _Checked(Executor):
    """Gives tasks to a cluster; a worker that came later, with other versions, refuses them."""

    def __init__(self, executor: Executor) -> None:
        self._executor, self._versions = executor, versions()

    def submit(self, task: Callable[..., Any], /, *args: Any, **more: Any) -> Future[Any]:
        return self._executor.submit(_checked, self._versions, task, *args, **more)


def _checked(wanted: dict[str, str], task: Callable[..., Any], *args: Any, **more: Any) -> Any:
    if versions() != wanted:
        raise _different(wanted, {platform.node(): versions()})
    with _ALONE:
        return task(*args, **more)


def versions() -> dict[str, str]:
    """What decides the digits of an answer, beside the processor: versions, and threads of linear algebra."""
    parts = {name: version(name) for name in DECISIVE_PACKAGES}
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "not 1")
    return {"hdassist": __version__, "Python": platform.python_version(), **parts, "OPENBLAS_NUM_THREADS": threads}


def scheduler_address(scheduler: str | None, scheduler_file: str | None) -> str | None:
    """Address of a scheduler, as given or from the JSON file in which it wrote that; None without either.

    Raises UsageError: no address; DataError: a file that has none.
    """
    if scheduler_file is None:
        if scheduler is not None and not _is_address(scheduler):
            words = f"invalid --scheduler {scheduler!r}: expected an address like tcp://10.0.0.5:8786"
            raise UsageError(words, "--jobs N works with N processes on this machine")
        return scheduler
    if scheduler is not None:
        raise UsageError("--scheduler and --scheduler-file name two schedulers", "leave one of them out")
    data, name = read_bytes(scheduler_file, 1_000_000)
    try:
        address = json.loads(data)["address"]
        if not isinstance(address, str) or not _is_address(address):
            raise ValueError
    except (ValueError, KeyError, TypeError, RecursionError):
        words = f"{name} is no file of a scheduler: it has no address"
        raise DataError(words, "dask scheduler --scheduler-file FILE writes one") from None
    return address


def _is_address(text: str) -> bool:
    protocol, separator, place = text.partition("://")
    port = place.rpartition(":")[2]
    return bool(separator) and protocol in ("tcp", "tls") and port.isascii() and port.isdigit() and int(port) < 65536


def _require_distributed() -> None:
    """Raise DataError where distributed is not installed; else have it say nothing beside what it raises."""
    try:
        import distributed  # noqa: F401 (is it there?)
    except ImportError:
        words = "a scheduler needs the package distributed, which is not installed"
        raise DataError(words, 'pip install "hdassist[cluster]"') from None
    for handler in logging.getLogger("distributed").handlers:
        handler.setLevel(logging.CRITICAL + 1)


@contextmanager
def _reached(address: str) -> Iterator[Client]:
    """A client of a cluster that is there. Raises DataError: its scheduler does not answer, or has no workers."""
    from distributed import Client
    from distributed.security import Security

    try:
        keys = Security().get_connection_args("client")  # type: ignore[no-untyped-call]
        if address.startswith("tls:") and keys.get("ssl_context") is None:
            raise ValueError("dask's configuration names no key; docs/tolerance.md shows how")
        if keys.get("require_encryption") and not address.startswith("tls:"):
            raise ValueError("dask's configuration requires encryption: tls://")
        client = Client(address, timeout=WAIT, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise DataError(
            f"cannot reach the scheduler at {address}", f"is it running? {error}", Fault.SCHEDULER_LOST
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=WORKERS_WAIT)
        except TimeoutError:
            raise DataError(
                f"the scheduler at {address} has no workers", f"dask worker {address}", Fault.SCHEDULER_LOST
            ) from None
        yield client


def _workers_of(client: Client) -> list[str]:
    """Addresses of the workers that are there."""
    return list(client.nthreads())  # type: ignore[no-untyped-call]


def _require_same(client: Client, address: str) -> None:
    """Raise DataError where a worker's versions are not those of this process."""
    try:
        there = client.run(versions)
    except Exception as error:  # whatever a worker says that cannot even read the question
        words = f"the workers of {address} cannot be asked for their versions: {type(error).__name__}: {error}"
        raise DataError(words, f"is hdassist {__version__} installed where they run?") from None
    if any(found != versions() for found in there.values()):
        raise _different(versions(), there)


def _different(here: dict[str, str], there: dict[str, dict[str, str]]) -> DataError:
    """What differs on the first worker where something does."""
    worker, found = next((worker, found) for worker, found in there.items() if found != here)
    differing = [key for key in here if found.get(key) != here[key]]
    told = "; ".join(f"{key} {found.get(key, 'unknown')} there, {here[key]} here" for key in differing)
    hint = "the same digits need the same versions, and OPENBLAS_NUM_THREADS=1 where workers begin"
    return DataError(f"the worker {worker} is another than this process: {told}", hint)
