"""Whole processes as users start them: seconds on the clock, and memory."""

from __future__ import annotations

import os
import pty
import statistics
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

EVERY = 0.2  # s between two looks at the memory
FIG_3 = ("mount", "vzp160", "--step", "5", "--csv", "-")


@dataclass(frozen=True)
class Process:
    """One command: its arguments and how often it runs.

    target_s: the most seconds it should take; ratio: of which other process, by its words, so many times the time;
    python: arguments of Python instead of hdassist.
    """

    arguments: tuple[str, ...]
    runs: int
    target_s: float | None = None
    ratio: tuple[str, float] | None = None
    python: bool = False

    @property
    def words(self) -> str:
        return " ".join(("python" if self.python else "hdassist", *self.arguments))

    @property
    def call(self) -> list[str]:
        return [sys.executable, *(() if self.python else ("-m", "hdassist")), *self.arguments]


IMPORT = Process(("-c", "import cvxpy"), 7, python=True)
CHECK = Process(("check", "vzp160"), 5, ratio=(IMPORT.words, 2.5))
MOUNT = Process(("mount", "vzp160"), 3, ratio=(CHECK.words, 1.5))
PROCESSES = (
    Process(("--help",), 7, 0.25),
    Process(("--version",), 7, 0.25),
    IMPORT,
    CHECK,
    MOUNT,
    Process(("self-error", "vzp160"), 5, ratio=(IMPORT.words, 1.5)),
    Process(("stiffness", "vzp160"), 5, ratio=(IMPORT.words, 1.5)),
    Process(FIG_3, 2, 10.0),
    Process((*FIG_3, "--every-state"), 1, 60.0),
)
FIRST_LINE = 1.5  # times the import: until an answer that takes longer shows something on a terminal


def measure(quick: bool) -> dict:
    """Medians of every process; quick: fewer runs, and Fig. 3 not with every state."""
    chosen = [p for p in PROCESSES if not (quick and "--every-state" in p.arguments)]
    runs = [measured(p, min(p.runs, 2) if quick else p.runs) for p in chosen]
    first = {p.words: statistics.median(_first_line(p) for _ in range(2 if quick else 5)) for p in (CHECK, MOUNT)}
    return {"runs": runs, "first_line_s": first}


def _first_line(process: Process) -> float:
    """Seconds until a command shows something on a terminal."""
    ours, theirs = pty.openpty()
    begun = time.perf_counter()
    child = subprocess.Popen(process.call, stdin=subprocess.DEVNULL, stdout=theirs, stderr=theirs)
    os.close(theirs)
    os.read(ours, 1)
    took = time.perf_counter() - begun
    child.kill()
    child.wait()
    os.close(ours)
    return took


def measured(process: Process, runs: int) -> dict:
    found = [_run(process) for _ in range(runs)]
    return {
        "command": process.words,
        "runs": runs,
        "target_s": process.target_s,
        "ratio": process.ratio,
        "median_s": statistics.median(run["s"] for run in found),
        "least_s": min(run["s"] for run in found),
        "processor_s": statistics.median(run["processor_s"] for run in found),
        "one_process_MB": max(run["one_process_MB"] for run in found),
        "all_processes_MB": max(run["all_processes_MB"] for run in found),
    }


def _run(process: Process) -> dict[str, float]:
    """One run: seconds on the clock, those of the processors (workers included), and memory.

    one_process_MB: the greatest resident set of any one process of the command, as the kernel kept it (ru_maxrss);
    all_processes_MB: the greatest sum over the command and its workers, looked at EVERY so often, pages that
    processes share counted once (PSS); at least what one process had.
    """
    begun = time.perf_counter()
    child = subprocess.Popen(process.call, stdout=subprocess.DEVNULL)
    sums, ended = [0.0], threading.Event()
    watch = threading.Thread(target=_watch, args=(child.pid, sums, ended))
    watch.start()
    _, status, usage = os.wait4(child.pid, 0)
    took = time.perf_counter() - begun
    ended.set()
    watch.join()
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
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
    except OSError:  # it has ended
        return []
    return [pid, *(one for child in children for one in _family(int(child)))]


def _pss_MB(pid: int) -> float:
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii").splitlines()
    except OSError:
        return 0.0
    return sum(int(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1024
