"""How near sets of values of vzp160 come to Fig. 3 and Fig. 2 of its paper: `python -m benchmarks.identify [NAME ...]`.

NAME: preset, an alternative of it by its number, reference (tests/validation/vzp160_reference.yaml, from before flanks
were coned), or middle (of the bounds). Prints the bars of Fig. 3, and Fig. 2's greatest over least range in a turn.

--fig-3: least squares of `hdassist calibrate` from there, to Fig. 3 alone, without the drives that it spreads over the
bounds otherwise. --both N: N rounds from there towards both figures: the greatest excess over their tolerances is made
less by a linear programme in a small box around the best set, its slopes being difference quotients over the box.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGETS = ROOT / "docs/vzp160.targets.yaml"
ITERATIONS = 20
BARS = (31, 15, 13, 2)  # arcsec, Fig. 3: greatest and least at 80 N*m, at 800 N*m; met within 5 %
MOST = 3.0  # Fig. 2: the range changes 2 to 3 times
BOX = 0.012  # of the bounds' width, to each side of the best set
WEAK = {"supports.C_1": 2, "contact.k_face": 3, "flexspline.k_t": 4}  # the box is so much wider


def start_of(name: str) -> dict[str, float]:
    """Values of the unknowns to start from, by path."""
    import numpy as np

    from hdassist import load_preset
    from hdassist.calibration.targets import read_targets
    from hdassist.preset.yamltext import read_yaml

    drive = load_preset("vzp160")
    unknowns = read_targets(TARGETS.read_bytes(), str(TARGETS), drive).unknowns
    if name == "middle":
        return {u.path: float(u.value(np.array(0.5))) for u in unknowns}
    if name == "reference":
        drive = load_preset(str(ROOT / "tests/validation/vzp160_reference.yaml"))
    elif name != "preset":
        others = read_yaml((ROOT / "tests/validation/vzp160_alternatives.yaml").read_bytes(), name).data
        drive = drive.with_values(others[int(name) - 1])
    return {u.path: drive.number(u.path) for u in unknowns}


def figures(values: Mapping[str, float]) -> list[float]:
    """The four bars of Fig. 3 [arcsec], and greatest over least range in the three turns of Fig. 2."""
    from hdassist import load_preset
    from hdassist.calibration.quantities import phase_scan
    from hdassist.error.trace import trace
    from hdassist.run.run import UNCHECKED

    drive = load_preset("vzp160").with_values(values)
    ranges = [trace(drive, 80, start_deg=start, run=UNCHECKED).error.range_arcsec for start in (20, 100, 300)]
    scans = (phase_scan(drive, 80), phase_scan(drive, 800))
    return [*(bar for scan in scans for bar in (scan.greatest, scan.least)), max(ranges) / min(ranges)]


def off(found: list[float]) -> list[float]:
    """By how many per cent each of the figures is off: of the bars from the middle, of Fig. 2 from its upper end."""
    return [100 * (got / wanted - 1) for got, wanted in zip(found, (*BARS, MOST), strict=True)]


def excess(found: list[float]) -> float:
    """The greatest excess over the tolerances [per cent]: none below 0."""
    *bars, ratio = off(found)
    return max(*(abs(bar) - 5 for bar in bars), ratio)


def towards_both(values: Mapping[str, float], rounds: int, executor: ProcessPoolExecutor) -> dict[str, float]:
    """The set with the least excess that so many rounds come to."""
    import numpy as np
    from scipy.optimize import linprog

    from hdassist import load_preset
    from hdassist.calibration.calibrate import places_of, rounded_values
    from hdassist.calibration.targets import read_targets

    unknowns = read_targets(TARGETS.read_bytes(), str(TARGETS), load_preset("vzp160")).unknowns
    paths = [u.path for u in unknowns]
    width = BOX * np.array([WEAK.get(path, 1) for path in paths])
    best = places_of(unknowns, values)

    def at(points: Sequence[np.ndarray]) -> list[list[float]]:
        return list(executor.map(figures, [named(point) for point in points]))

    def named(point: np.ndarray) -> dict[str, float]:
        return dict(zip(paths, rounded_values(unknowns, np.clip(point, 0, 1)), strict=True))

    for number in range(rounds):
        ends = best + np.diag(np.where(best < 0.5, width, -width))
        here, *moved = at([best, *ends])
        slopes = (np.array([off(each) for each in moved]) - off(here)).T / (ends - best).diagonal()
        # least t with |bar| - 5 <= t and ratio <= t, all in per cent
        *bars, ratio = np.c_[slopes, -np.ones(5)]
        rows = [*bars, *(np.r_[-bar[:-1], -1] for bar in bars), ratio]
        known = off(here)
        ends_of_rows = [*(5 - bar for bar in known[:4]), *(5 + bar for bar in known[:4]), -known[4]]
        tried = []
        for share in (1, 0.4, 0.15):
            reach = share * width
            box = [(max(-r, -b), min(r, 1 - b)) for r, b in zip(reach, best, strict=True)]
            cost = np.r_[np.zeros(len(paths)), 1]
            step = linprog(cost, A_ub=rows, b_ub=ends_of_rows, bounds=[*box, (None, None)]).x[:-1]
            tried.append(best + step)
        points = [best, *tried, *ends]
        all_found = [here, *at(tried), *moved]
        least = min(range(len(points)), key=lambda k: excess(all_found[k]))
        print(f"  round {number + 1}: excess {excess(all_found[least]):+.2f} %", flush=True)
        best, width = points[least], width * (1.4 if least in (1,) else 1 if least else 0.5)
    return named(best)


def towards_fig_3(values: Mapping[str, float], executor: ProcessPoolExecutor) -> dict[str, float]:
    """The least squares of Fig. 3 and the self error."""
    from hdassist import load_preset
    from hdassist.calibration.calibrate import calibrate
    from hdassist.calibration.targets import read_targets
    from hdassist.run.run import Run

    drive = load_preset("vzp160", [f"{path}={value}" for path, value in values.items()])
    targets = read_targets(TARGETS.read_bytes(), str(TARGETS), drive)
    found = calibrate(drive, targets, points=1, starts=1, iterations=ITERATIONS, run=Run(executor))
    squares = sum(deviation**2 for deviation in targets.deviations(found.fits[0].predictions))
    print(f"  {found.evaluations} drives: weighted sum of squares {squares:.2f}")
    return targets.by_path(found.fits[0].values)


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("names", nargs="*", default=["preset", "1", "2", "3"], metavar="NAME")
    reader.add_argument("--fig-3", action="store_true")
    reader.add_argument("--both", type=int, default=0, metavar="N")
    options = reader.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # numpy is not loaded yet
    with ProcessPoolExecutor(os.cpu_count()) as executor:
        for name in options.names:
            print(f"{name}:", flush=True)
            values = start_of(name)
            if options.fig_3:
                values = towards_fig_3(values, executor)
            if options.both:
                values = towards_both(values, options.both, executor)
            found = figures(values)
            print("  " + ", ".join(f"{value:.4g}" for value in found) + f"; excess {excess(found):+.2f} %")
            print("  " + ", ".join(f"{path} {value:g}" for path, value in values.items()), flush=True)


if __name__ == "__main__":
    main()
