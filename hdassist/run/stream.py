"""Very many items worked on by processes: records in the order of the items, as they come.

Items go out in chunks that take a few seconds each, by the time of those before them, and only so many ahead of the one
that is waited for: memory does not grow with the number of items.
"""

import pickle
import time
from collections import deque
from collections.abc import Callable, Generator
from concurrent.futures import Future
from functools import lru_cache
from typing import Any

from hdassist.run.processes import count, workers

SECONDS = 2.0  # of work in a chunk, about
MOST_ITEMS = 10_000  # items in a chunk
AHEAD = 3  # chunks under way or done for each process

Work = Callable[[int, int], list[Any]]


def stream(
    work: Work, total: int, *, done: int = 0, jobs: int = 0, seconds: float = SECONDS
) -> Generator[list[Any], None, None]:
    """Records of the items done, done + 1, ... total - 1, in lists of one chunk each; close it to stop the work.

    Arguments: work, which can be pickled and gives the records of the items first ... last - 1: where chunks begin and
    end depends on how fast it is, so a record must not depend on that; total; done, how many items are done already;
    jobs, processes at work (0: one for each core); seconds of work in a chunk.
    Raises the errors of the work; UntrustedError: a process was ended from outside.
    """
    pickled, at_a_time = pickle.dumps(work), count(jobs)
    chunks: deque[tuple[int, Future[tuple[float, list[Any]]]]] = deque()  # items of each, and its answer
    end, cost, counted = done, 0.0, 0.0  # s and items of chunks that are done, the last ones counting most
    with workers(jobs) as executor:
        while done < total:
            while end < total and len(chunks) < AHEAD * at_a_time:
                by_time = int(seconds * counted / max(cost, 1e-9))
                to_the_end = -(-(total - end) // (2 * at_a_time))  # smaller ones there: all processes end together
                size = max(1, min(by_time, MOST_ITEMS, to_the_end))
                chunks.append((size, executor.submit(_timed, pickled, end, end + size)))
                end += size
            size, answer = chunks.popleft()
            took, records = answer.result()
            if len(records) != size:
                raise ValueError(f"{len(records)} records of {size} items")
            cost, counted, done = cost / 2 + took, counted / 2 + size, done + size
            yield records


def _timed(work: bytes, first: int, last: int) -> tuple[float, list[Any]]:
    """How long some items took [s], and their records; work, pickled."""
    begun = time.perf_counter()
    records = _unpickled(work)(first, last)
    return time.perf_counter() - begun, records


@lru_cache(maxsize=1)
def _unpickled(work: bytes) -> Work:
    """The work, unpickled once in each process: its caches stay from chunk to chunk."""
    found: Work = pickle.loads(work)
    return found
