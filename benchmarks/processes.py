"""Complete processes as users start them: processor time relative to an import, elapsed time, and memory."""

from __future__ import annotations

import os
import pty
import re
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

EVERY = 0.2  # s; interval between two readings of the memory
ANSWERS = (0, 3, 6)  # exit codes of a command with a result
CONTROL = re.compile(rb"\x1b\[[0-9;?]*[A-Za-z]")


@dataclass(frozen=True)
class Process:
    """A command to measure.

    arguments: arguments of the command.
    runs: number of runs.
    over: process to compare with, and the largest allowed ratio of the processor times.
    python: whether the arguments are those of Python instead of hdassist.
    after: commands on the same drive that have run before, whose results are cached.
    """

    arguments: tuple[str, ...]
    runs: int
    over: tuple[Process, float] | None = None
    python: bool = False
    after: tuple[Process, ...] = ()

    @property
    def words(self) -> str:
        words = " ".join(("python" if self.python else "hdassist", *self.arguments))
        return f"{words}, after {' and '.join(each.arguments[0] for each in self.after)}" if self.after else words

    @property
    def call(self) -> list[str]:
        return [sys.executable, *(() if self.python else ("-m", "hdassist")), *self.arguments]


NEW = ("presets", "new", "own", "--ratio", "100", "--torque", "67", "-o", "own.yaml")  # data-sheet preset
THREE, FOUR = ("h0=20.2", "h3=24.1", "h6=31.5"), ("h0=20.2", "h3=24.1", "h6=31.5", "h9=27.6")
TERMINAL = Process(("-c", "import typer, rich"), 7, python=True)
IMPORT = Process(("-c", "import cvxpy"), 7, python=True)
CHECK = Process(("check", "vzp160"), 5, (IMPORT, 3.8))
OWN_CHECK = Process(("check", "own.yaml"), 5, (IMPORT, 3.0))
MOUNT = Process(("mount", "vzp160"), 3, (IMPORT, 7.0))
OWN_MOUNT = Process(("mount", "own.yaml"), 2, (IMPORT, 5.0))
REPORT = Process(("report", "own.yaml"), 2, (IMPORT, 8.0))
TRIALS = Process(("trials", "vzp160", *THREE, "--noise", "0.5", "--torque", "80"), 3, (IMPORT, 5.0))
TOLERANCE = Process(("tolerance", "vzp160", "-n", "150"), 3, (IMPORT, 10.0))
SENSITIVITY = Process(("sensitivity", "vzp160"), 3, (IMPORT, 9.0))
PROCESSES = (
    TERMINAL,
    Process(("--help",), 7, (TERMINAL, 1.7)),
    IMPORT,
    CHECK,
    OWN_CHECK,
    MOUNT,
    OWN_MOUNT,
    REPORT,
    Process(("report", "own.yaml"), 2, (IMPORT, 2.0), after=(OWN_CHECK,)),
    Process(("report", "own.yaml"), 2, (IMPORT, 2.0), after=(OWN_CHECK, OWN_MOUNT)),
    TRIALS,
    Process(("trials", "own.yaml", *FOUR, "--noise", "0.5"), 2, (IMPORT, 8.0)),
    TOLERANCE,
    SENSITIVITY,
    Process(("stiffness", "vzp160"), 5, (IMPORT, 1.6)),
)
WORDS_FIRST = (CHECK, MOUNT, TRIALS, REPORT, TOLERANCE, SENSITIVITY)
LONG = ("tolerance", "sensitivity")  # commands that run only once in a quick run


def measure(quick: bool) -> dict[str, Any]:
    """Return the medians for every process, in a folder with a preset from a data sheet; quick: fewer runs."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(Process(NEW, 1).call, cwd=folder, check=True, capture_output=True)
        runs = [measured(p, (1 if p.arguments[0] in LONG else 2) if quick else p.runs, folder) for p in PROCESSES]
        first = {
            p.words: statistics.median(_first_words(p, folder) for _ in range(2 if quick else 5)) for p in WORDS_FIRST
        }
    return {"runs": runs, "first_output_s": first}


def _first_words(process: Process, folder: str) -> float:
    """Return the processor time until a command shows text on a terminal [s]; control sequences do not count."""
    ours, theirs = pty.openpty()
    environment = os.environ | {"TERM": "xterm"}
    child = subprocess.Popen(
        process.call, cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=theirs, stderr=theirs
    )
    os.close(theirs)
    shown = b""
    while not CONTROL.sub(b"", shown).strip():
        shown += os.read(ours, 4096)
    child.terminate()  # its workers end with it
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    os.close(ours)
    return usage.ru_utime + usage.ru_stime


def measured(process: Process, runs: int, folder: str) -> dict[str, Any]:
    """Return the medians of the runs of a process.

    process: command to measure.
    runs: number of runs.
    folder: working folder.
    """
    found = [
        _run(process, folder, os.environ) if not process.after else _run_after(process, folder) for _ in range(runs)
    ]
    return {
        "command": process.words,
        "runs": runs,
        "over": process.over and [process.over[0].words, process.over[1]],
        "median_s": statistics.median(run["s"] for run in found),
        "processor_s": statistics.median(run["processor_s"] for run in found),
        "one_process_MB": max(run["one_process_MB"] for run in found),
        "all_processes_MB": max(run["all_processes_MB"] for run in found),
    }


def _run_after(process: Process, folder: str) -> dict[str, float]:
    """Run a process after its preceding commands, with a cache of its own, and return the measurements."""
    with tempfile.TemporaryDirectory() as cache:
        environment = {name: text for name, text in os.environ.items() if name != "HDASSIST_NO_CACHE"}
        environment["HDASSIST_CACHE"] = cache
        for before in process.after:
            _run(before, folder, environment)
        return _run(process, folder, environment)


def _run(process: Process, folder: str, environment: Mapping[str, str]) -> dict[str, float]:
    """Run a process, and return the elapsed time s [s], the processor time with workers [s], and the memory.

    one_process_MB is the largest resident set of any process of the command, as recorded by the kernel (ru_maxrss).
    all_processes_MB is the largest sum over the command and its workers, read at intervals of EVERY. It counts shared
    pages once (PSS), and is at least one_process_MB.
    """
    begun = time.perf_counter()
    silent = subprocess.DEVNULL
    child = subprocess.Popen(process.call, cwd=folder, env=environment, stdout=silent, stderr=silent)
    sums, ended = [0.0], threading.Event()
    watch = threading.Thread(target=_watch, args=(child.pid, sums, ended))
    watch.start()
    _, status, usage = os.wait4(child.pid, 0)
    took = time.perf_counter() - begun
    ended.set()
    watch.join()
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode not in ANSWERS:
        raise SystemExit(f"{process.words} ended with exit code {child.returncode}")
    one = usage.ru_maxrss / 1024
    return {
        "s": took,
        "processor_s": usage.ru_utime + usage.ru_stime,
        "one_process_MB": one,
        "all_processes_MB": max(one, *sums),
    }


def _watch(pid: int, sums: list[float], ended: threading.Event) -> None:
    while not ended.wait(EVERY):
        sums.append(sum(map(_pss_MB, _family(pid))))


def _family(pid: int) -> list[int]:
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    except OSError:  # the process has ended
        return []
    return [pid, *(one for child in children for one in _family(int(child)))]


def _pss_MB(pid: int) -> float:
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii").splitlines()
    except OSError:
        return 0.0
    return sum(int(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1024
