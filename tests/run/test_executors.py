"""Work given to engines of other packages: the same records to the last digit, checked versions, lost workers."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest
from distributed import Client, LocalCluster, Security

from hdassist.drive.solve.walk import installation
from hdassist.run import run as module
from hdassist.run.errors import DataError, UntrustedError, UsageError
from hdassist.run.run import Cluster, cluster, end_clusters, stream
from tests.helpers.process import CLEAN, COMMAND, TINY, begun_by, ends, run

pytestmark = pytest.mark.filterwarnings("default")  # of packages that are not ours

ANY_PORT = "127.0.0.1:0"
LOT = "serial,preset,limit F_ior@4\n" + "".join(f"{k},{TINY},{limit}\n" for k, limit in enumerate((600, 10, 130)))
DRAWN = ("--torque", "4", "--jobs", "1")
COMMANDS = {
    "tolerance": ("tolerance", TINY, *DRAWN, "-n", "12", "--json"),
    "sensitivity": ("sensitivity", TINY, *DRAWN, "-n", "16", "--json"),
    "allocate": ("allocate", TINY, *DRAWN, "-n", "20", "--limit", "2000", "--json"),
    "sweep": ("sweep", TINY, "--torque", "4", "--vary", "gears.j_n=10:20:5", "--jobs", "1", "--csv", "-"),
}


needs_proc = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")


def plain(text: str) -> str:
    """A text without times of day."""
    return re.sub(r"T\d\d:\d\d:\d\d", "", text)


def squares(first: int, last: int) -> list[int]:
    return [k * k for k in range(first, last)]


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """The address of a scheduler with two workers."""
    with LocalCluster(2, processes=False, threads_per_worker=1, protocol="tcp://", dashboard_address=ANY_PORT) as own:
        yield f"dask={own.scheduler_address}"
        end_clusters()


@pytest.mark.thorough
@pytest.mark.parametrize("name", COMMANDS)
def test_result_is_identical_on_every_executor(scheduler: str, name: str) -> None:
    there, here = run(*COMMANDS[name], "--executor", scheduler), run(*COMMANDS[name])
    assert here.returncode in (0, 3, 6), here.stderr
    assert (there.returncode, there.stdout) == (here.returncode, here.stdout)


def test_lot_rows_are_identical_on_every_executor_and_after_resume(scheduler: str, tmp_path: Path) -> None:
    (tmp_path / "lot.csv").write_text(LOT)
    options = ("--jobs", "1", "--csv", "-", "--draws", "0")
    here = run("accept", "lot.csv", *options, cwd=tmp_path)
    there = run("accept", "lot.csv", *options, "--executor", scheduler, "--jsonl", "a.jsonl", cwd=tmp_path)
    assert plain(there.stdout) == plain(here.stdout)
    assert len(here.stdout.splitlines()) > 3
    kept = (tmp_path / "a.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "a.jsonl").write_text("".join(kept[:2]))
    again = run("accept", "lot.csv", *options, "--jsonl", "a.jsonl", "--resume", cwd=tmp_path)
    assert "1 of 3 rows are already computed" in again.stderr
    assert plain(again.stdout) == plain(here.stdout)


@pytest.mark.thorough
@needs_proc
def test_private_cluster_ends_with_its_stopped_command(tmp_path: Path) -> None:
    file = tmp_path / "rows.jsonl"
    arguments = ("tolerance", TINY, "--torque", "4", "-n", "4000", "--executor", "dask", "--jobs", "2")
    process = subprocess.Popen([*COMMAND, *arguments, "--results", str(file)], env=CLEAN, stderr=subprocess.PIPE)
    until = time.monotonic() + 200
    while (not file.exists() or file.read_bytes().count(b"\n") < 3) and time.monotonic() < until:
        assert process.poll() is None
        time.sleep(0.1)
    workers = begun_by(process.pid)
    assert len(workers) >= 2
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 143
    assert b"drives are stored in" in err
    assert all(map(ends, workers))


@pytest.mark.thorough
def test_an_own_cluster_takes_no_work_without_its_key() -> None:
    with cluster("dask", 1, installation) as engine:
        assert engine.submit(abs, -3).result(60) == 3
        scheduler = engine._engine._client.cluster.scheduler
        assert scheduler.address.startswith("tls://127.0.0.1:")
        with pytest.raises(OSError, match=r"."):
            Client(scheduler.address, security=Security.temporary(), timeout=1)
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(f"http://127.0.0.1:{scheduler.http_server.port}/health")
    end_clusters()


@pytest.mark.thorough
@needs_proc
def test_a_worker_that_is_lost_changes_nothing() -> None:
    with LocalCluster(2, threads_per_worker=1, dashboard_address=ANY_PORT) as own, Client(own) as client:
        pids = list(client.run(os.getpid).values())
        engine = Cluster(client.get_executor(pure=False, retries=3), lambda: 2, os.getcwd)
        found, chunks = [], stream(partial(slowly, 0.02), 40, executor=engine)
        for records in chunks:
            found += records
            if len(found) > 2 and pids:
                os.kill(pids.pop(), signal.SIGKILL)
                pids.clear()
        assert found == squares(0, 40)


def slowly(seconds: float, first: int, last: int) -> list[int]:
    time.sleep(seconds * (last - first))
    return squares(first, last)


def test_any_executor_of_the_standard_library_will_do() -> None:
    with ThreadPoolExecutor(2) as engine:
        assert [each for chunk in stream(squares, 40, executor=engine) for each in chunk] == squares(0, 40)
        assert engine.submit(abs, -3).result() == 3  # it stays the caller's


def test_closed_stream_cancels_work_that_has_not_begun() -> None:
    begun = threading.Event()

    def waits(first: int, last: int) -> list[int]:
        begun.set()
        time.sleep(0.05)
        return squares(first, last)

    done: list[int] = []
    with ThreadPoolExecutor(1) as engine:
        submit = engine.submit
        engine.submit = lambda _task, _work, first, last: submit(  # type: ignore[method-assign]
            lambda: (0.05, [done.append(k) or k * k for k in range(first, last) if not time.sleep(0.05)])
        )
        with contextlib.closing(stream(squares, 1000, jobs=2, executor=engine)) as chunks:
            next(chunks)
    assert len(done) <= 3


def test_a_worker_with_another_installation_answers_nothing() -> None:
    versions = iter([("1.0", "compiled"), ("1.0", "compiled"), ("0.9", "compiled")])
    with ThreadPoolExecutor(1) as engine:
        asked = Cluster(engine, lambda: 1, lambda: next(versions))
        assert asked.submit(abs, -3).result() == 3
        with pytest.raises(UntrustedError, match=r"another installation: .*0\.9.*not .*1\.0"):
            asked.submit(abs, -3).result()


def test_engine_failure_counts_as_lost_worker_unlike_a_task_error() -> None:
    with pytest.raises(UntrustedError, match="dask lost the work: broken"), lost():
        raise BrokenExecutor("broken")
    with pytest.raises(DataError, match="of the work"), lost():
        raise DataError("of the work")


@contextlib.contextmanager
def lost() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_dask_cluster", lambda *_: None)
        with cluster("dask", 1, installation):
            yield


@pytest.mark.parametrize(
    ("name", "error", "words"),
    [
        ("slurm", UsageError, "unknown executor: slurm"),
        ("mpi", UsageError, "unknown executor: mpi"),
        ("ray", UsageError, "unknown executor: ray"),
        ("dask=tcp://127.0.0.1:1", DataError, "cannot reach or start dask=tcp://127.0.0.1:1"),
    ],
)
def test_an_engine_that_cannot_be_had_is_refused(
    monkeypatch: pytest.MonkeyPatch, name: str, error: type[Exception], words: str
) -> None:
    monkeypatch.setattr(module, "TIMEOUT", 0.5)
    with pytest.raises(error, match=words), cluster(name, 1, installation):
        pass


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    words = "needs a package that is not installed: distributed"
    with pytest.raises(UsageError, match=words), cluster("dask", 0, installation):
        pass


def test_a_command_refuses_an_unknown_engine_by_its_name() -> None:
    done = run("tolerance", TINY, "--executor", "slurm")
    assert done.returncode == 2
    assert "unknown executor: slurm" in done.stderr
    assert "use dask or dask=tcp://HOST:PORT" in done.stderr
