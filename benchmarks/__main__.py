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
ROUNDS = 3  # of every engine over the cycle


def process(arguments: list[str]) -> tuple[float, float]:
    """Seconds and MB of one run of the command."""
    begun = time.perf_counter()
    child = subprocess.Popen([sys.executable, "-m", "hdassist", *arguments], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    assert child.returncode == 0
    return time.perf_counter() - begun, usage.ru_maxrss / 1024


def states() -> dict[str, float]:
    """Milliseconds of processor time a state: cvxpy with several solvers, on a sample."""
    # a child starts with its parent's memory on its account: nothing heavy before the processes are measured
    import numpy as np

    from hdassist import load_preset
    from hdassist.model.contacts import contact_system
    from hdassist.model.deviations import gaps
    from hdassist.model.kinematics import Kinematics, pitch_locked_states
    from hdassist.solve.formulation import formulate, solve_through_cvxpy

    drive = load_preset("vzp160")
    system = contact_system(drive)
    cycle = pitch_locked_states(Kinematics.of(drive))
    rows = np.random.default_rng(0).choice(len(cycle), SAMPLE, replace=False)
    delta_p = gaps(drive, system, cycle.take(rows))
    formulation = formulate(system)
    found = {}
    for solver in ("DAQP", "CLARABEL", "OSQP", "HIGHS"):
        solve_through_cvxpy(formulation, delta_p[0], 80e3, solver)
        times = []
        for gap in delta_p:
            begun = time.process_time()
            solve_through_cvxpy(formulation, gap, 80e3, solver)
            times.append(time.process_time() - begun)
        found[f"cvxpy with {solver}, 80 N*m"] = statistics.median(times) * 1e3
    return found


def engines() -> dict[str, dict[str, float]]:
    """Microseconds of processor time a state over the full cycle, set-up included.

    For each torque: the engine, its certificate (part of what a state costs), and DAQP warm from state to state
    on the same matrices, in turns with the engine; medians of ROUNDS rounds.
    """
    import numpy as np

    from hdassist import load_preset
    from hdassist.model.contacts import contact_system
    from hdassist.model.deviations import gaps
    from hdassist.model.kinematics import Kinematics, neighbours_together, pitch_locked_states
    from hdassist.solve.activeset import ActiveSet
    from hdassist.solve.answers import CHUNK, solve_states
    from hdassist.solve.certificate import residuals
    from hdassist.solve.compiled import compile_programme
    from hdassist.solve.engine import Engine
    from hdassist.solve.formulation import formulate

    drive = load_preset("vzp160")
    system, kinematics = contact_system(drive), Kinematics.of(drive)
    cycle = pitch_locked_states(kinematics)
    delta_p = gaps(drive, system, cycle.take(neighbours_together(kinematics, cycle)))
    formulation, everywhere = formulate(system), np.ones(len(system.delta_p), dtype=bool)
    data = compile_programme(formulation)
    chunks = [delta_p[first : first + CHUNK] for first in range(0, len(delta_p), CHUNK)]
    found = {}
    for M_g in drive.operation.M_g:
        torque = M_g * 1e3
        times = []
        for _ in range(ROUNDS):
            marks = [time.process_time()]
            solve_states(system, Engine(formulation, torque), torque, delta_p, str)
            marks.append(time.process_time())
            daqp = ActiveSet(formulation, data, torque, everywhere)
            answers = [daqp.solve(chunk) for chunk in chunks]
            marks.append(time.process_time())
            for chunk, (forces, free, _) in zip(chunks, answers, strict=True):
                residuals(system, chunk, torque, forces, free)
            marks.append(time.process_time())
            times.append(np.diff(marks))
        both, daqp_alone, certificate = (float(t) for t in np.median(times, axis=0) / len(delta_p) * 1e6)
        found[f"{M_g:g} N*m"] = {
            "engine and certificate": both,
            "certificate": certificate,
            "daqp": daqp_alone,
            "daqp and certificate": daqp_alone + certificate,
        }
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

    print(f"\n{'one state, vzp160':36}{'us':>8}{'ratio':>8}")
    solved = engines()
    for torque, rows in solved.items():
        for name, microseconds in rows.items():
            ratio = microseconds / rows["engine and certificate"]
            print(f"{f'{name}, {torque}':36}{microseconds:8.1f}{ratio:8.2f}")
    base = solved["80 N*m"]["engine and certificate"]
    through = states()
    for name, milliseconds in through.items():
        print(f"{name:36}{milliseconds * 1e3:8.0f}{milliseconds * 1e3 / base:8.0f}")
    if options.json:
        told = {"machine": machine, "processes": runs, "state_us": solved, "state_through_cvxpy_ms": through}
        Path(options.json).write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
