"""Description of the machine of a measurement, and measurement of processor time."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

VERSIONS = ("hdassist", "cvxpy", "daqp", "clarabel", "numpy", "scipy")


def machine() -> dict[str, str | int | float]:
    """Return a description of the machine, the versions of packages, and the load at the start of the measurements."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)),
        "load": round(os.getloadavg()[0], 1),
        "python": platform.python_version(),
        **{name: version(name) for name in VERSIONS},
    }


def _processor() -> str:
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def seconds(work: Callable[[], object], rounds: int) -> float:
    """Return the median processor time of some work on one thread [s]; a first round is not counted."""
    work()
    times = []
    for _ in range(rounds):
        begun = time.process_time()
        work()
        times.append(time.process_time() - begun)
    return statistics.median(times)
