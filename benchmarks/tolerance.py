"""Errors of F'_ior of random drives, and the time to compute them: `python -m benchmarks.tolerance [--n 500]`.

The drives are those of `hdassist tolerance vzp160 --seed 1`, and those of the same drive with harmonics and a runout.
F'_ior as assembled (all drives) and in the best position (every fifth drive) is compared with the result of all states
of the cycle. F'_ior of every fifth drive is also computed in all positions, to show whether the best one was found.
Times are processor times of one process. The efficiency of two processes is measured by elapsed time, which is
meaningful only on a quiet machine.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hdassist import Drive
    from hdassist.features.tolerance.production import Production

HARMONICS = {
    "tolerances.e_b": 10.0, "harmonics.a_g2": 3.0, "harmonics.a_b2": 3.0, "harmonics.a_g3": 1.5, "harmonics.a_b3": 1.5,
    "harmonics.a_g4": 1.5, "harmonics.a_b4": 1.5,
}  # fmt: skip
CASES: dict[str, dict[str, float]] = {"vzp160": {}, "vzp160 with harmonics": HARMONICS}
SEED = 1
EVERY = 5
CHUNK = 10
WANTED_MS = 7.5  # target for the time of one core per value of F'_ior


@dataclass(frozen=True)
class Drawn:
    """Comparison of a random drive with the results of all states.

    case: name in CASES.
    number: number of the drive.
    F_ior: F'_ior from all states as assembled at each torque [arcsec].
    as_built: F'_ior from all states minus the value of the drive, as assembled [arcsec].
    best: the same in the best position, None if it was not compared.
    loss: relative excess of the chosen over the best position, None if it was not computed.
    """

    case: str
    number: int
    F_ior: list[float]
    as_built: list[float]
    best: list[float] | None = None
    loss: float | None = None


def production(case: str, drives: int, executor: Executor | None = None) -> Production:
    from hdassist import load_preset
    from hdassist.features.tolerance.production import Production, production_law
    from hdassist.run.run import Run

    drive = load_preset("vzp160", [f"{path}={value}" for path, value in CASES[case].items()])
    made = Production(production_law(drive), drive.operation.M_g, seed=SEED, per_design=10)
    return made.with_designs(drives, run=Run(executor))[0]


def compare(task: tuple[str, Production, int, int]) -> list[Drawn]:
    import numpy as np

    from hdassist import kinematic_error
    from hdassist.drive.error.error_map import ErrorMap
    from hdassist.features.mounting.positions import merit, rotated
    from hdassist.run.run import UNCHECKED

    case, made, first, last = task
    found = []
    for k, record in enumerate(made.records(first, last), first):
        drive = made.drive.with_values(record.values)
        best_deg = record.best_rotation_deg
        assert best_deg is not None  # the position is None only if the drive has no F'_ior
        turned = rotated(drive, best_deg)

        def every_state(there: Drive) -> list[float]:
            return [kinematic_error(there, M_g, run=UNCHECKED).F_ior_arcsec for M_g in made.torques]

        exact = every_state(drive)
        missed = [e - v for e, v in zip(exact, record.F_ior_arcsec, strict=True)]
        best = loss = None
        if k % EVERY == 0:
            best = [e - v for e, v in zip(every_state(turned), record.best_F_ior_arcsec, strict=True)]
            searches = [ErrorMap(drive, M_g) for M_g in made.torques]
            all_ = np.array([[s.extremes(rotated(drive, r)).first for r in made.rotations] for s in searches])
            values = merit(all_, all_.mean(axis=1))
            loss = float(values[made.rotations.index(best_deg)] / values.min() - 1)
        found.append(Drawn(case, k, exact, missed, best, loss))
    return found


def remembered(file: Path) -> list[Drawn]:
    return [Drawn(**json.loads(line)) for line in file.read_text().splitlines()] if file.exists() else []


def report(case: str, rows: Sequence[Drawn]) -> None:
    import numpy as np

    for name, of in (("as built", "as_built"), ("best position", "best")):
        missed = np.abs([value for row in rows if getattr(row, of) for value in getattr(row, of)])
        print(
            f"{case}, {name}: {len(missed)} values; {np.mean(missed <= 0.01):.2%} within 0.01 arcsec, "
            f"{np.mean(missed <= 0.1):.2%} within 0.1, greatest {missed.max():.3f}"
        )
    loss = np.array([row.loss for row in rows if row.loss is not None])
    better = f"{np.sum(loss > 1e-3)} have a better position, by {loss.max():.2%} at most"
    print(f"{case}, choice: of {len(loss)} drives {better}")


def measure(quick: bool) -> list[dict[str, Any]]:
    """Return the results of each case.

    They are the processor time per value, per drive and for its share of a design [ms], the states per drive, and the
    efficiency of two processes.
    """
    return [speed(case, 10 if quick else 100) | efficiency(case, 20 if quick else 200) for case in CASES]


def speed(case: str, count: int) -> dict[str, Any]:
    begun = time.process_time()
    made = production(case, 2 + count)
    designs = time.process_time() - begun
    made.records(0, 2)  # computes everything that is computed only once
    begun = time.process_time()
    records = made.records(2, 2 + count)
    took = time.process_time() - begun
    each = 1e3 * took / count
    value = each / len(made.torques) / len(made.rotations)
    states = sum(record.states for record in records) / count
    print(
        f"{case}: {each:.1f} ms a drive, {value:.2f} ms a value ({WANTED_MS:g} wanted), {states:.0f} states a drive; "
        f"{designs:.1f} s for the designs", file=sys.stderr, flush=True,
    )  # fmt: skip
    of_designs = 1e3 * designs / (2 + count)
    return {"case": case, "value_ms": value, "drive_ms": each, "law_ms": of_designs, "drive_states": states}


def efficiency(case: str, count: int) -> dict[str, Any]:
    from hdassist.run.run import stream

    made, took = production(case, count), []
    for jobs in (1, 2):
        begun = time.perf_counter()
        for _ in stream(made.records, count, jobs=jobs):
            pass
        took.append(time.perf_counter() - begun)
    share = took[0] / took[1] / 2
    told = f"{case}: {count} drives in {took[0]:.1f} s by one process, {took[1]:.1f} s by two: {share:.0%}"
    print(told, file=sys.stderr, flush=True)
    return {"drives": count, "one_s": took[0], "two_s": took[1], "efficiency": share}


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--n", type=int, default=500, help="drives of each case that are compared")
    reader.add_argument("--speed", type=int, default=100, help="drives of each case that are timed")
    reader.add_argument("--cases", nargs="*", choices=CASES, default=list(CASES))
    reader.add_argument("--file", type=Path, default=Path("build/tolerance_study.jsonl"))
    options = reader.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # set before numpy is loaded
    if options.speed:
        for case in options.cases:
            speed(case, options.speed)
            efficiency(case, 2 * options.speed)
    if not options.n:
        return
    options.file.parent.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(os.cpu_count()) as executor, options.file.open("a", encoding="utf-8") as stream:
        for case in options.cases:
            known = [row for row in remembered(options.file) if row.case == case and row.number < options.n]
            made = production(case, options.n, executor)
            chunks = range(len(known), options.n, CHUNK)
            tasks = [(case, made, first, min(first + CHUNK, options.n)) for first in chunks]
            for rows in executor.map(compare, tasks):
                known += rows
                print(*(json.dumps(asdict(row)) for row in rows), sep="\n", file=stream, flush=True)
            report(case, known)


if __name__ == "__main__":
    main()
