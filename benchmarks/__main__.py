"""Speed and memory of what users wait for, measured in one run: `python -m benchmarks [--json FILE]`.

Ratios count; absolute times belong to the machine that is named with them.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

PROCESSES = {
    "hdassist --help": (["--help"], 0.3, None, 5),
    "hdassist --version": (["--version"], 0.3, None, 5),
    "hdassist check vzp160": (["check", "vzp160"], 20.0, 400.0, 3),
}
SAMPLE = 20  # states sent through cvxpy


def process(arguments: list[str]) -> tuple[float, float]:
    """Seconds and MB of one run of the command."""
    begun = time.perf_counter()
    child = subprocess.Popen([sys.executable, "-m", "hdassist", *arguments], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    assert child.returncode == 0
    return time.perf_counter() - begun, usage.ru_maxrss / 1024


def states() -> dict[str, float]:
    """Milliseconds a state: the engine over a full cycle, its certificate included, and cvxpy on a sample."""
    # a child starts with its parent's memory on its account: nothing heavy before the processes are measured
    import numpy as np

    from hdassist import load_preset
    from hdassist.model.contacts import contact_system
    from hdassist.model.deviations import gaps
    from hdassist.model.kinematics import Kinematics, pitch_locked_states
    from hdassist.solve.answers import solve_states
    from hdassist.solve.engine import Engine
    from hdassist.solve.formulation import formulate, solve_through_cvxpy

    drive = load_preset("vzp160")
    system = contact_system(drive)
    cycle = pitch_locked_states(Kinematics.of(drive))
    delta_p = gaps(drive, system, cycle)
    formulation = formulate(system)
    found = {}
    for M_g in drive.operation.M_g:
        begun = time.perf_counter()
        solve_states(system, Engine(formulation, M_g * 1e3), M_g * 1e3, delta_p, str)
        found[f"engine, {M_g:g} N*m"] = (time.perf_counter() - begun) / len(cycle) * 1e3
    rows = np.random.default_rng(0).choice(len(cycle), SAMPLE, replace=False)
    for solver in ("DAQP", "CLARABEL", "OSQP", "HIGHS"):
        solve_through_cvxpy(formulation, delta_p[0], 80e3, solver)
        times = []
        for row in rows:
            begun = time.perf_counter()
            solve_through_cvxpy(formulation, delta_p[row], 80e3, solver)
            times.append(time.perf_counter() - begun)
        found[f"cvxpy with {solver}, 80 N*m"] = statistics.median(times) * 1e3
    return found


def main() -> None:
    """Measure, print a table, and write JSON where asked."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--json", metavar="FILE", help="write the measurements to FILE")
    options = parser.parse_args()
    machine = {
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
        **{name: version(name) for name in ("hdassist", "cvxpy", "daqp", "numpy", "scipy")},
    }
    print("  ".join(f"{name} {value}" for name, value in machine.items()), "\n")

    runs = {}
    print(f"{'whole process, median':28}{'s':>8}{'target':>8}{'MB':>8}{'target':>8}")
    for name, (arguments, seconds, memory, repeats) in PROCESSES.items():
        measured = [process(arguments) for _ in range(repeats)]
        median, most = statistics.median(s for s, _ in measured), max(m for _, m in measured)
        runs[name] = {"median_s": median, "target_s": seconds, "max_MB": most, "target_MB": memory, "runs": repeats}
        print(f"{name:28}{median:8.2f}{seconds:8.1f}{most:8.0f}{memory or '-':>8}")

    print(f"\n{'one state, vzp160':28}{'ms':>8}{'ratio':>8}")
    solved = states()
    base = solved["engine, 80 N*m"]
    for name, milliseconds in solved.items():
        print(f"{name:28}{milliseconds:8.3f}{milliseconds / base:8.1f}")
    if options.json:
        told = {"machine": machine, "processes": runs, "state_ms": solved}
        Path(options.json).write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
