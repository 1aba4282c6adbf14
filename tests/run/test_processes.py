"""Processes that share the work of a command: how they begin, and what they do not hear."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import BrokenExecutor
from pathlib import Path

import pytest

from hdassist.interface.cli import THREADS
from hdassist.run import run as module
from hdassist.run.errors import DataError, Fault, UntrustedError
from hdassist.run.run import Run, count, workers
from hdassist.run.system import start_method
from tests.helpers.process import CLEAN, SMALL

BEGUN = """
import os, threading
import hdassist.drive.solve.loadcase
from hdassist.run.run import workers

if {thread}:
    threading.Thread(target=threading.Event().wait, daemon=True).start()
with workers(1) as executor:
    known = executor.submit(eval, "'hdassist.drive.solve.loadcase' in __import__('sys').modules").result()
    print(executor.submit(os.getppid).result() == os.getpid(), known)
"""


AT_WORK = """
import os, threading
from hdassist.run.run import workers

threading.Thread(target=threading.Event().wait, daemon=True).start()
with workers(1) as executor:
    print(executor.submit(os.getpid).result(), flush=True)
    threading.Event().wait()
"""


SOLVED = """
import numpy as np
from hdassist import kinematic_error, load_preset
from hdassist.drive.model.geometry import Kinematics, pitch_locked_states
from hdassist.run.run import workers
from hdassist.run.run import Run

drive = load_preset({small!r})
states = pitch_locked_states(Kinematics.of(drive), np.arange(4))
asked = {{"states": states, "run": Run(cross_check="CLARABEL")}}
here = kinematic_error(drive, 4.0, **asked)
with workers(1) as executor:
    there = executor.submit(kinematic_error, drive, 4.0, **asked).result()
print(np.array_equal(here.rotation_arcsec, there.rotation_arcsec))  # the same instructions on the same numbers
"""


def deaf(_: int) -> tuple[int, bool]:
    return os.getpid(), signal.getsignal(signal.SIGINT) is signal.SIG_IGN


def test_processes_answer_in_order_hear_no_interrupt_and_end():
    with workers(2) as executor:
        assert list(executor.map(abs, range(-3, 0))) == [3, 2, 1]
        found = list(executor.map(deaf, range(4)))
    assert all(ignored for _, ignored in found)
    assert os.getpid() not in {pid for pid, _ in found}
    assert not multiprocessing.active_children()
    assert signal.getsignal(signal.SIGINT) is not signal.SIG_IGN


@pytest.mark.thorough
@pytest.mark.skipif(start_method() == "spawn", reason="processes are forked on Linux alone, but for HDASSIST_SPAWN")
@pytest.mark.parametrize("thread", [False, True])
def test_processes_start_with_imports_and_never_fork_beside_threads(thread):
    told = subprocess.run(
        [sys.executable, "-c", BEGUN.format(thread=thread)], env=CLEAN | dict.fromkeys(THREADS, "1"),
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert told.stdout == f"{not thread} True\n"


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_workers_end_with_the_process_that_began_them():
    with subprocess.Popen([sys.executable, "-c", AT_WORK], env=CLEAN, stdout=subprocess.PIPE, text=True) as process:
        worker = Path("/proc", process.stdout.readline().strip())
        assert worker.exists()
        process.kill()
    until = time.monotonic() + 20
    while worker.exists() and time.monotonic() < until:
        time.sleep(0.01)
    assert not worker.exists()


@pytest.mark.thorough
def test_process_may_have_used_a_threaded_solver_before_its_workers():
    told = subprocess.run(
        [sys.executable, "-c", SOLVED.format(small=SMALL)], env=CLEAN, capture_output=True, text=True, timeout=120,
        check=True,
    )  # fmt: skip
    assert told.stdout == "True\n"


def test_no_number_of_jobs_is_one_for_each_core():
    assert count(3) == 3
    assert 1 <= count(0) <= (os.cpu_count() or 1)


def refuse(error: Exception) -> None:
    raise error


BESIDE = """
import os
from hdassist.run.errors import UntrustedError
from hdassist.run.run import Run, workers

modules = "'wave' in __import__('sys').modules"
with workers(1) as executor:
    run = Run(executor)
    other = run.beside(eval, "(__import__('wave'), __import__('os').getpid())[1]").result()
    print(other not in (os.getpid(), executor.submit(os.getpid).result()), run.beside(os.getpid).result() == other)
    print(run.beside(eval, modules).result(), executor.submit(eval, modules).result())
    try:
        run.beside(int, "x").result()
    except ValueError:
        print(run.beside(abs, -3).result())
try:
    with workers(1) as executor:
        Run(executor).beside(eval, "__import__('os').kill(__import__('os').getpid(), 9)").result()
except UntrustedError as error:
    print(error.fault.name)
"""


@pytest.mark.skipif(start_method() == "spawn", reason="processes are forked on Linux alone, but for HDASSIST_SPAWN")
def test_side_task_has_its_own_process_and_reports_a_kill():
    found = subprocess.run(
        [sys.executable, "-c", BESIDE], env=CLEAN | dict.fromkeys(THREADS, "1"), capture_output=True, text=True,
        timeout=60, check=True,
    )  # fmt: skip
    assert found.stdout.split() == ["True", "True", "True", "False", "3", "WORKERS_LOST"]


def test_side_task_runs_in_the_same_process_without_workers():
    assert Run().beside(os.getpid).result() == os.getpid()


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_side_process_ignores_interrupts_and_ends_with_the_workers():
    with workers(2) as executor:
        beside, ignores = Run(executor).beside(deaf, 0).result()
        Run(executor).beside(time.sleep, 3600)
    assert ignores
    assert not Path("/proc", str(beside)).exists()


@pytest.mark.parametrize(
    "error", [DataError("row 3 is wrong", "a hint"), EOFError("of a file"), OSError(5, "of a disk")]
)
def test_task_error_is_raised_with_its_place_of_origin(error):
    with workers(1) as executor:
        with pytest.raises(type(error)) as raised:
            executor.submit(refuse, error).result()
        assert raised.value.args == error.args
        assert "in refuse" in raised.value.__notes__[0]
        assert executor.submit(abs, -3).result() == 3


def test_unpicklable_task_is_an_error_of_that_task_only():
    with workers(1) as executor:
        for task, *given in ((threading.Lock,), (repr, threading.Lock())):
            with pytest.raises(TypeError, match="pickle"):
                executor.submit(task, *given).result()
        assert executor.submit(abs, -3).result() == 3


def test_where_one_process_is_lost_no_other_is_waited_for():
    with pytest.raises(UntrustedError, match="a worker process was killed"), workers(2) as executor:
        slow, lost = executor.submit(time.sleep, 3600), executor.submit(os._exit, 1)
        with pytest.raises(BrokenExecutor):
            lost.result()
        with pytest.raises(BrokenExecutor):
            slow.result()
        executor.submit(abs, -3)
    assert not multiprocessing.active_children()


def test_process_that_ended_before_opening_its_pipe_is_not_awaited():
    """Windows keeps that end open in this process until then."""
    here, there = multiprocessing.Pipe()
    process = multiprocessing.get_context("spawn").Process(target=abs, args=(0,))
    process.start()
    process.join()
    with there, here, pytest.raises(EOFError):
        module._Worker(here, process.sentinel).answer((abs, (0,), {}))


@pytest.mark.parametrize("fault", [OSError(28, "No space left on device"), RuntimeError("can't start new thread")])
def test_processes_that_cannot_begin_are_a_data_error(monkeypatch, fault):
    monkeypatch.setattr("hdassist.run.run.Processes.begin", lambda *_: refuse(fault))
    with pytest.raises(DataError, match=r"cannot start worker processes.*(No space left|new thread)"), workers(1):
        pass


def test_a_process_lost_while_others_begin_is_no_data_error(monkeypatch):
    monkeypatch.setattr("hdassist.run.run.Processes.begin", lambda *_: refuse(BrokenExecutor()))
    with pytest.raises(UntrustedError) as error, workers(1):
        pass
    assert error.value.fault is Fault.WORKERS_LOST
