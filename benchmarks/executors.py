"""Overhead of executors of other packages: `python -m benchmarks.executors [-n 2000] [--workers 1 2 4]`.

Random drives of `hdassist tolerance vzp160 --torque 80`, and chunks of work that takes no time, are computed by
processes of hdassist, and then by each number of workers of `--executor dask`. The cost is the processor time of this
process (with dask, its threads for client, scheduler and nannies) and of the workers. The elapsed time is meaningful
only on a quiet machine with a core for each worker.
"""

from __future__ import annotations

import argparse
import os
import resource
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

CHUNKS = 2000  # number of chunks of work that takes no time


def nothing(first: int, last: int) -> list[int]:
    """Return the records of work that takes no time."""
    return list(range(first, last))


@contextmanager
def engine(workers: int) -> Iterator[tuple[Executor | None, Callable[[], float]]]:
    """Yield an executor, and a function that returns the processor time of its workers [s].

    workers: number of dask workers; 0 for processes of hdassist, whose executor is None.
    """
    from hdassist.drive.solve.walk import installation
    from hdassist.run.run import cluster, end_clusters

    if not workers:
        yield None, lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
        return
    with cluster("dask", workers, installation) as found:
        client = found._engine._client  # type: ignore[attr-defined]  # the executor of dask
        yield found, lambda: sum(sum(times[:2]) for times in client.run(os.times).values())
    end_clusters()


def measure(workers: int, drives: int, jobs: int = 2) -> str:
    """Return the line of results for an executor.

    workers: number of dask workers; 0 for processes of hdassist.
    drives: number of random drives.
    jobs: number of processes of hdassist.
    """
    from hdassist import load_preset
    from hdassist.features.tolerance.production import Production, production_law
    from hdassist.run.run import Run, stream

    drive = load_preset("vzp160", ["operation.M_g=[80]"])
    made = Production(production_law(drive), (80.0,), per_design=10).with_designs(drives, run=Run())[0]
    with engine(workers) as (found, of_workers):
        begun = time.perf_counter(), time.process_time(), of_workers()
        for _ in stream(nothing, CHUNKS, jobs=jobs, seconds=0, executor=found):  # one record per chunk
            pass
        empty = time.perf_counter(), time.process_time(), of_workers()
        for _ in stream(made.records, drives, jobs=jobs, executor=found):
            pass
        done = time.perf_counter(), time.process_time(), of_workers()
    (_, here_ms, there_ms), (clock, here, there) = (
        [after - before for before, after in zip(*ends, strict=True)] for ends in ((begun, empty), (empty, done))
    )
    name = f"dask, {workers} workers" if workers else f"own processes, {jobs}"
    return (
        f"{name}: {1e3 * here_ms / CHUNKS:.2f} ms here and {1e3 * there_ms / CHUNKS:.2f} ms there a chunk of nothing; "
        f"{drives} drives: {here:.2f} s here, {there:.1f} s there ({1e3 * there / drives:.1f} ms a drive), "
        f"{clock:.1f} s on the clock; workers as they begin {begun[2]:.1f} s"
    )


def main() -> None:
    """Print a line for each executor."""
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("-n", type=int, default=2000, help="drives for each")
    reader.add_argument("--workers", type=int, nargs="*", default=[0, 1, 2, 4], help="0: processes of our own")
    options = reader.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # set before numpy is loaded
    for workers in options.workers:
        print(measure(workers, options.n), flush=True)


if __name__ == "__main__":
    main()
