"""A real scheduler and two worker processes on loopback: the same records as here, whoever dies."""

from __future__ import annotations

import json
import socket
import sys
from contextlib import closing
from functools import partial

import pytest
from distributed import LocalCluster

from hdassist.errors import DataError, UntrustedError, UsageError
from hdassist.run.cluster import _checked, pools, scheduler_address, versions
from hdassist.run.stream import stream
from tests.run.test_stream import TOTAL, dies_over, flat, refuses, squares, squares_but_dies_once


@pytest.fixture
def pool(cluster):
    with pools(cluster, 0) as begin:
        yield begin


@pytest.fixture
def nobody():
    """An address on which nobody listens."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        yield f"tcp://127.0.0.1:{taken.getsockname()[1]}"


def test_a_cluster_gives_the_same_records_in_the_same_order(pool):
    with pool() as (_, at_a_time):
        assert at_a_time == 2
    assert flat(stream(squares, TOTAL, done=3, pool=pool)) == squares(3, TOTAL)


def test_a_scheduler_is_found_by_its_file(cluster, tmp_path):
    (tmp_path / "scheduler.json").write_text(json.dumps({"address": cluster}))
    assert scheduler_address(None, str(tmp_path / "scheduler.json")) == cluster


def test_a_worker_of_a_cluster_that_dies_half_way_loses_nothing(pool, tmp_path):
    work = partial(squares_but_dies_once, str(tmp_path), 20)
    assert flat(stream(work, TOTAL, pool=pool)) == squares(0, TOTAL)
    assert (tmp_path / "died").exists()


def test_what_the_work_raises_on_a_cluster_comes_as_it_is(pool):
    with pytest.raises(DataError, match="item 9 is wrong"):
        list(stream(partial(refuses, 9), TOTAL, pool=pool))


def test_items_that_kill_every_worker_of_a_cluster_end_as_an_error(pool):
    with pytest.raises(UntrustedError, match="ended from outside, again and again"):
        list(stream(partial(dies_over, 0), 2, pool=pool))


def test_a_stream_that_is_closed_leaves_the_cluster_to_others(pool):
    with closing(stream(squares, 10**9, pool=pool)) as chunks:
        next(chunks)
    assert flat(stream(squares, 3, pool=pool)) == squares(0, 3)


def test_workers_of_another_version_are_refused_by_what_differs(cluster, monkeypatch):
    monkeypatch.setattr("hdassist.run.cluster.__version__", "0.0.1")
    with pytest.raises(DataError, match=r"worker tcp://127.*: hdassist .* there, 0.0.1 here$"), pools(cluster, 0):
        pass


def test_a_worker_that_came_later_refuses_tasks_of_another_version():
    assert _checked(versions(), squares, 1, 2) == squares(1, 2)
    with pytest.raises(DataError, match=r"numpy .* there, 0.1 here$"):
        _checked(versions() | {"numpy": "0.1"}, squares, 1, 2)


def test_a_scheduler_that_is_not_there_is_a_data_error(nobody, monkeypatch):
    monkeypatch.setattr("hdassist.run.cluster.WAIT", 0.3)
    with pytest.raises(DataError, match=f"cannot reach the scheduler at {nobody}"), pools(nobody, 0):
        pass


@pytest.mark.parametrize(("protocol", "required"), [("tls", False), ("tcp", True)])
def test_keys_that_are_missing_are_a_data_error(nobody, protocol, required):
    import dask

    with (
        dask.config.set({"distributed.comm.require-encryption": required}),
        pytest.raises(DataError, match="cannot reach the scheduler") as raised,
        pools(nobody.replace("tcp", protocol), 0),
    ):
        pass
    assert "dask's configuration" in raised.value.hint


def test_a_scheduler_without_workers_is_a_data_error(monkeypatch):
    monkeypatch.setattr("hdassist.run.cluster.WORKERS_WAIT", 0.1)
    with (
        LocalCluster(
            n_workers=0, host="127.0.0.1", protocol="tcp://", dashboard_address=None,
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
        ) as empty,
        pytest.raises(DataError, match="has no workers"),
        pools(empty.scheduler_address, 0),
    ):  # fmt: skip
        pass


def test_without_distributed_it_says_what_to_install(monkeypatch, nobody):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(DataError) as told, pools(nobody, 0):
        pass
    assert told.value.hint == 'pip install "hdassist[cluster]"'


@pytest.mark.parametrize(
    "given",
    [
        ("", None), ("127.0.0.1:8786", None), ("tcp://here", None), ("tcp://here:x", None), ("http://here:80", None),
        ("local", None), ("tcp://here:99999", None), ("tcp://here:1", "a.json"),
    ],
)  # fmt: skip
def test_what_is_no_scheduler_is_wrong_usage(given):
    with pytest.raises(UsageError):
        scheduler_address(*given)


def test_jobs_of_a_cluster_are_wrong_usage():
    with pytest.raises(UsageError, match="--jobs is for processes on this machine"), pools("tcp://here:1", 2):
        pass


@pytest.mark.parametrize("text", ["", "x", "[]", "{}", '{"address": 3}', '{"address": "here"}', "[" * 100_000])
def test_a_file_that_is_none_of_a_scheduler_is_a_data_error(tmp_path, text):
    (tmp_path / "scheduler.json").write_text(text)
    with pytest.raises(DataError, match="no file of a scheduler"):
        scheduler_address(None, str(tmp_path / "scheduler.json"))
