"""How near vzp160 lies to the least of its targets: `python -m benchmarks.identify [preset reference middle ...]`.

Least squares of `hdassist calibrate` from a start alone, without the drives that it spreads over the bounds otherwise:
from the preset's own values, from those of tests/validation/vzp160_reference.yaml (before flanks were coned), from the
middle of the bounds, from an alternative of the preset by its number.
"""

from __future__ import annotations

import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGETS = ROOT / "docs/vzp160.targets.yaml"
ITERATIONS = 20


def start_of(name: str) -> dict[str, float]:
    """Values of the unknowns to start from, by path."""
    from hdassist import load_preset
    from hdassist.calibration.targets import read_targets

    drive = load_preset("vzp160")
    unknowns = read_targets(TARGETS.read_bytes(), str(TARGETS), drive).unknowns
    if name == "middle":
        return {u.path: (u.low * u.high) ** 0.5 if u.log else (u.low + u.high) / 2 for u in unknowns}
    if name == "reference":
        drive = load_preset(str(ROOT / "tests/validation/vzp160_reference.yaml"))
    elif name != "preset":
        drive = drive.with_values(drive.alternatives[int(name) - 1])
    return {u.path: drive.number(u.path) for u in unknowns}


def main() -> None:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # numpy is not loaded yet
    from hdassist import load_preset
    from hdassist.calibration.calibrate import calibrate
    from hdassist.calibration.evaluations import Evaluations
    from hdassist.calibration.targets import read_targets
    from hdassist.run.run import Run

    with ProcessPoolExecutor(os.cpu_count()) as executor:
        for name in sys.argv[1:] or ("preset", "reference"):
            drive = load_preset("vzp160", [f"{path}={value}" for path, value in start_of(name).items()])
            targets = read_targets(TARGETS.read_bytes(), str(TARGETS), drive)
            evaluations = Evaluations(drive, targets, Run(executor))
            found = calibrate(drive, targets, evaluations, points=1, starts=1, iterations=ITERATIONS)
            squares = sum(deviation**2 for deviation in found.best.deviations)
            print(f"from {name}, {found.evaluations} drives: weighted sum of squares {squares:.2f}")
            print("  " + ", ".join(f"{value:.4g}" for value in found.best.predictions))
            print("  " + ", ".join(f"{path} {value:g}" for path, value in targets.by_path(found.best.values).items()))


if __name__ == "__main__":
    main()
