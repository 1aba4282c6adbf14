"""Overhead of engines of other packages: `python -m benchmarks.executors [-n 2000] [--workers 1 2 4]`.

For processes of our own, then for so many workers of `--executor dask` each: random drives of `hdassist tolerance
vzp160 --torque 80`, and chunks of work that takes no time. What they cost is processor time of this process (with
dask its client, scheduler and nannies' threads) and of the workers; the time on the clock means something on a quiet
machine with a core for each worker only.
"""

from __future__ import annotations

import argparse
import os
import resource
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

CHUNKS = 2000  # of work that takes no time


def nothing(first: int, last: int) -> list[int]:
    """The records of work that takes no time."""
    return list(range(first, last))


@contextmanager
def engine(workers: int) -> Iterator[tuple[Executor | None, Callable[[], float]]]:
    """An engine of so many workers, 0 for none, and a function for the processor time of its workers [s]."""
    from hdassist.run.run import cluster, end_clusters
    from hdassist.solve.walk import installation

    if not workers:
        yield None, lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
        return
    with cluster("dask", workers, installation) as found:
        client = found._engine._client  # type: ignore[attr-defined]  # dask's own executor
        yield found, lambda: sum(sum(times[:2]) for times in client.run(os.times).values())
    end_clusters()


def measure(workers: int, drives: int, jobs: int = 2) -> str:
    """A line on so many workers (0: processes of our own) and random drives."""
    from hdassist import load_preset
    from hdassist.run.run import Run, stream
    from hdassist.tolerance.production import Production, production_law

    drive = load_preset("vzp160", ["operation.M_g=[80]"])
    made = Production(production_law(drive), (80.0,), per_design=10).with_designs(drives, run=Run())[0]
    with engine(workers) as (found, of_workers):
        begun = time.perf_counter(), time.process_time(), of_workers()
        for _ in stream(nothing, CHUNKS, jobs=jobs, seconds=0, executor=found):  # a chunk for each
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
    """Print a line on each engine."""
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("-n", type=int, default=2000, help="drives for each")
    reader.add_argument("--workers", type=int, nargs="*", default=[0, 1, 2, 4], help="0: processes of our own")
    options = reader.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # numpy is not loaded yet
    for workers in options.workers:
        print(measure(workers, options.n), flush=True)


if __name__ == "__main__":
    main()
