"""Very many items worked on by an executor of any kind: records in the order of the items, as they come.

Items go out in chunks that take a few seconds each, by what those before them took, and only so many ahead of the one
that is waited for: memory does not grow with the number of items.
"""

from __future__ import annotations

import pickle
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import nullcontext
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from hdassist.errors import Fault, UntrustedError
from hdassist.run.cluster import Pool

SECONDS = 2.0  # of work in a chunk, about
MOST_ITEMS = 10_000  # items in a chunk
AHEAD = 3  # chunks under way or done for each task that is worked on at a time
DEATHS = 3  # pools of workers that may break one after the other with nothing coming of any

Work = Callable[[int, int], list[Any]]


def stream(
    work: Work, total: int, *, done: int = 0, pool: Pool | None = None, seconds: float = SECONDS
) -> Generator[list[Any], None, None]:
    """Records of the items done, done + 1, ... total - 1, in lists of one chunk each; close it to stop the work.

    Arguments: work, which can be pickled and gives the records of the items first ... last - 1: where chunks begin and
    end depends on how fast it is, so a record must not depend on that; total; done, how many items are done already;
    pool, which begins an executor and tells how many tasks it works on at a time (None: in this process); seconds of
    work in a chunk. Where workers die, new ones begin with the items left.
    Raises the errors of the work; UntrustedError: the same items end workers again and again.
    """
    queue = _Queue(work, total, done, seconds)
    deaths = 0
    while queue.taken < total:
        with pool() if pool else nullcontext((_Here(), 1)) as (executor, at_a_time):
            try:
                for records in queue.records(executor, at_a_time, AHEAD * at_a_time if pool else 1):
                    deaths = 0
                    yield records
            except BrokenExecutor:
                deaths += 1
                if deaths == DEATHS:
                    raise UntrustedError(
                        f"processes were ended from outside {deaths} times while they worked on items "
                        f"{queue.taken} to {queue.end - 1}",
                        "was memory short? fewer --jobs take less of it",
                        Fault.WORKERS_LOST,
                    ) from None


def collected(work: Work, total: int, pool: Pool, progress: Callable[[int], None]) -> list[Any]:
    """Records of all of so many items; progress, called with how many came."""
    found = []
    for records in stream(work, total, pool=pool):
        found += records
        progress(len(records))
    return found


@dataclass
class _Chunk:
    """Items first ... last - 1; answer, None where nobody works on them."""

    first: int
    last: int
    answer: Future[tuple[float, list[Any]]] | None = None


class _Queue:
    """Chunks in the order of their items; taken, the items whose records were taken away; end, those in chunks."""

    def __init__(self, work: Work, total: int, done: int, seconds: float) -> None:
        self.taken = self.end = done
        self._work, self._total, self._seconds = pickle.dumps(work), total, seconds
        self._chunks: deque[_Chunk] = deque()
        self._cost = self._counted = 0.0  # s and items of chunks that are done, the last ones counting most

    def records(self, executor: Executor, at_a_time: int, ahead: int) -> Iterator[list[Any]]:
        """Records of one chunk after the other, to the last; items that a broken executor has finished are kept.

        Arguments: executor; at_a_time, tasks that it works on at a time; ahead, chunks that are given to it at once.
        """
        for chunk in self._chunks:
            if chunk.answer is None or not _is_done(chunk.answer):
                chunk.answer = self._begin(executor, chunk)
        while self.taken < self._total:
            while self.end < self._total and len(self._chunks) < ahead:
                chunk = _Chunk(self.end, self.end + self._size(at_a_time))
                self._chunks.append(chunk)
                self.end = chunk.last
                chunk.answer = self._begin(executor, chunk)
            yield self._first()

    def _begin(self, executor: Executor, chunk: _Chunk) -> Future[tuple[float, list[Any]]]:
        return executor.submit(_timed, self._work, chunk.first, chunk.last)

    def _first(self) -> list[Any]:
        """Records of the first chunk, waited for; how long it took tells how large the next ones shall be."""
        chunk = self._chunks[0]
        assert chunk.answer is not None
        took, records = chunk.answer.result()
        count = chunk.last - chunk.first
        if len(records) != count:
            raise ValueError(f"{len(records)} records of {count} items")
        self._chunks.popleft()
        self.taken = chunk.last
        self._cost, self._counted = self._cost / 2 + took, self._counted / 2 + count
        return records

    def _size(self, at_a_time: int) -> int:
        """Items of the next chunk: smaller ones towards the end, so that all workers end together."""
        by_time = self._seconds * self._counted / max(self._cost, 1e-9)
        return max(1, min(int(by_time), MOST_ITEMS, -(-(self._total - self.end) // (2 * at_a_time))))


def _is_done(answer: Future[Any]) -> bool:
    return answer.done() and not answer.cancelled() and answer.exception() is None


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


class _Here(Executor):
    """Works in this process, on each task when it is given."""

    def submit(self, task: Callable[..., Any], /, *args: Any, **more: Any) -> Future[Any]:
        answer: Future[Any] = Future()
        answer.set_result(task(*args, **more))
        return answer
