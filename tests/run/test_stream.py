"""Chunks of very many items: whatever they are and whoever dies over them, the same records in the same order."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import time
from concurrent.futures import Executor, Future
from contextlib import closing, nullcontext
from functools import partial

import pytest

from hdassist.run import run as module
from hdassist.run.errors import DataError, UntrustedError
from hdassist.run.run import AHEAD, MOST_ITEMS, stream

TOTAL = 40


def squares(first, last):
    return [{"square": k * k} for k in range(first, last)]


def dies_over(item, first, last):
    if first <= item < last:
        os.kill(os.getpid(), signal.SIGTERM)
    return squares(first, last)


def refuses(item, first, last):
    if first <= item < last:
        raise DataError(f"item {item} is wrong", "a hint")
    return squares(first, last)


class Counted(Executor):
    """Works here, and keeps what it was asked for: first and last of each chunk; takes seconds for each item."""

    def __init__(self, seconds=0.0):
        self.chunks, self.seconds = [], seconds

    def submit(self, task, work, first, last):
        self.chunks.append((first, last))
        answer = Future()
        answer.set_result((self.seconds * (last - first), pickle.loads(work)(first, last)))
        return answer


def flat(chunks):
    return [record for chunk in chunks for record in chunk]


@pytest.mark.parametrize("done", [0, 1, 39, 40, 50])
def test_stream_yields_every_remaining_record_in_sequence(done):
    assert flat(stream(squares, TOTAL, done=done, jobs=1)) == squares(done, TOTAL)


def test_chunks_grow_to_their_time_shrink_and_stay_few_ahead(monkeypatch):
    counted = Counted(seconds=0.01)
    monkeypatch.setattr(module, "workers", lambda _: nullcontext(counted))
    ahead = []
    for records in stream(squares, 5000, jobs=2, seconds=1.0):
        ahead.append(len(counted.chunks) - len(ahead))
        assert len(records) <= 100
    sizes = [last - first for first, last in counted.chunks]
    assert sizes[0] == 1
    assert max(sizes) == 100  # of 0.01 s each
    assert sizes[-1] == 1
    assert max(ahead) == AHEAD * 2


def test_no_chunk_is_longer_than_memory_allows(monkeypatch):
    counted = Counted()
    monkeypatch.setattr(module, "workers", lambda _: nullcontext(counted))
    count = sum(len(records) for records in stream(squares, 20 * MOST_ITEMS, jobs=2))
    assert count == 20 * MOST_ITEMS
    assert max(last - first for first, last in counted.chunks) == MOST_ITEMS


def test_killed_process_ends_the_stream_after_the_preceding_records():
    kept = []
    with pytest.raises(UntrustedError, match="a worker process was killed"):
        for records in stream(partial(dies_over, 20), TOTAL, jobs=2):
            kept += records
    assert kept == squares(0, len(kept))
    assert len(kept) <= 20


def test_what_the_work_raises_comes_behind_the_records_before_it():
    kept = []
    with pytest.raises(DataError, match="item 9 is wrong") as told:
        for records in stream(partial(refuses, 9), TOTAL, jobs=2, seconds=1e-9):
            kept += records
    assert kept == squares(0, 9)
    assert told.value.hint == "a hint"


def slow_but_first(first, last):
    time.sleep(3600 if first else 0)
    return squares(first, last)


def test_a_stream_that_is_closed_waits_for_nobody():
    with closing(stream(slow_but_first, TOTAL, jobs=2)) as chunks:
        assert next(chunks) == squares(0, 1)
    assert not multiprocessing.active_children()


def nothing(first, last):
    return []


def test_a_work_that_leaves_out_a_record_is_a_bug():
    with pytest.raises(ValueError, match="expected 1 records, not 0"):
        list(stream(nothing, 3, jobs=1))
