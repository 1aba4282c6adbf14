"""Processes that share the work of a command: how they begin, and what they do not hear."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hdassist.cli.main import THREADS
from hdassist.errors import DataError
from hdassist.terminal.workers import _deaf, count, workers
from tests.process import CLEAN, SMALL

BEGUN = """
import threading
import hdassist.solve.formulation
from hdassist.terminal.workers import workers

if {thread}:
    threading.Thread(target=threading.Event().wait, daemon=True).start()
with workers(1) as executor:
    known = executor.submit(eval, "'cvxpy' in __import__('sys').modules").result()
    print(executor._mp_context.get_start_method(), known)
"""


AT_WORK = """
import os, threading
from hdassist.terminal.workers import workers

threading.Thread(target=threading.Event().wait, daemon=True).start()
with workers(1) as executor:
    print(executor.submit(os.getpid).result(), flush=True)
    threading.Event().wait()
"""


SOLVED = """
import numpy as np
from hdassist import kinematic_error, load_preset
from hdassist.model.kinematics import Kinematics, pitch_locked_states
from hdassist.terminal.workers import workers

drive = load_preset({small!r})
states = pitch_locked_states(Kinematics.of(drive), np.arange(4))
here = kinematic_error(drive, 4.0, states=states, cross_check="CLARABEL", sample=1)
with workers(1) as executor:
    there = executor.submit(kinematic_error, drive, 4.0, states=states, cross_check="CLARABEL", sample=1).result()
print(np.array_equal(here.rotation_arcsec, there.rotation_arcsec))
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


@pytest.mark.skipif(sys.platform != "linux", reason="processes are spawned elsewhere")
@pytest.mark.parametrize(("thread", "way"), [(False, "fork"), (True, "forkserver")])
def test_processes_begin_with_what_is_imported_and_are_not_forked_beside_threads(thread, way):
    told = subprocess.run(
        [sys.executable, "-c", BEGUN.format(thread=thread)], env=CLEAN | dict.fromkeys(THREADS, "1"),
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert told.stdout == f"{way} True\n"


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs /proc")
def test_workers_that_another_process_forked_end_with_the_one_that_began_them():
    with subprocess.Popen([sys.executable, "-c", AT_WORK], env=CLEAN, stdout=subprocess.PIPE, text=True) as process:
        worker = Path("/proc", process.stdout.readline().strip())
        assert worker.exists()
        process.kill()
    until = time.monotonic() + 20
    while worker.exists() and time.monotonic() < until:
        time.sleep(0.01)
    assert not worker.exists()


def test_a_solver_with_threads_of_its_own_may_have_run_before():
    told = subprocess.run(
        [sys.executable, "-c", SOLVED.format(small=SMALL)], env=CLEAN, capture_output=True, text=True, timeout=120,
        check=True,
    )  # fmt: skip
    assert told.stdout == "True\n"


def test_no_number_of_jobs_is_one_for_each_core():
    assert count(3) == 3
    assert 1 <= count(0) <= (os.cpu_count() or 1)


def test_a_stop_that_is_not_heard_now_is_heard_later():
    done = False
    with pytest.raises(KeyboardInterrupt), _deaf():
        signal.raise_signal(signal.SIGINT)
        done = True
    assert done
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("fault", [OSError(28, "No space left on device"), RuntimeError("can't start new thread")])
def test_processes_that_cannot_begin_are_a_data_error(monkeypatch, fault):
    def refuse(*_: object, **__: object) -> None:
        raise fault

    monkeypatch.setattr("hdassist.terminal.workers.ProcessPoolExecutor", refuse)
    with pytest.raises(DataError, match=r"cannot begin the processes.*(No space left|new thread)"), workers(1):
        pass
