"""Whole processes as users start them: seconds on the clock, and memory."""

from __future__ import annotations

import os
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
    """One command: its arguments, how often it runs, and the most seconds it should take."""

    arguments: tuple[str, ...]
    runs: int
    target_s: float

    @property
    def words(self) -> str:
        return "hdassist " + " ".join(self.arguments)


PROCESSES = (
    Process(("--help",), 7, 0.25),
    Process(("--version",), 7, 0.25),
    Process(("check", "vzp160"), 5, 3.0),
    Process(FIG_3, 2, 10.0),
    Process((*FIG_3, "--every-state"), 1, 60.0),
)


def measure(quick: bool) -> list[dict]:
    """Medians of every process; quick: fewer runs, and Fig. 3 not with every state."""
    chosen = [p for p in PROCESSES if not (quick and "--every-state" in p.arguments)]
    return [measured(p, min(p.runs, 2) if quick else p.runs) for p in chosen]


def measured(process: Process, runs: int) -> dict:
    found = [_run(process.arguments) for _ in range(runs)]
    return {
        "command": process.words,
        "runs": runs,
        "target_s": process.target_s,
        "median_s": statistics.median(run["s"] for run in found),
        "least_s": min(run["s"] for run in found),
        "processor_s": statistics.median(run["processor_s"] for run in found),
        "one_process_MB": max(run["one_process_MB"] for run in found),
        "all_processes_MB": max(run["all_processes_MB"] for run in found),
    }


def _run(arguments: tuple[str, ...]) -> dict[str, float]:
    """One run: seconds on the clock, those of the processors (workers included), and memory.

    one_process_MB: the greatest resident set of any one process of the command, as the kernel kept it (ru_maxrss);
    all_processes_MB: the greatest sum over the command and its workers, looked at EVERY so often, pages that
    processes share counted once (PSS); at least what one process had.
    """
    begun = time.perf_counter()
    child = subprocess.Popen([sys.executable, "-m", "hdassist", *arguments], stdout=subprocess.DEVNULL)
    sums, ended = [0.0], threading.Event()
    watch = threading.Thread(target=_watch, args=(child.pid, sums, ended))
    watch.start()
    _, status, usage = os.wait4(child.pid, 0)
    took = time.perf_counter() - begun
    ended.set()
    watch.join()
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(f"{' '.join(arguments)} ended with exit code {child.returncode}")
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
