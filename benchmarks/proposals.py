"""Error of the extremes found by proposals, and their time: `python -m benchmarks.proposals --n 1000`.

The extremes are compared with those of all states. The drives are all presets; hard cases, which are `vzp160` with
eccentricities from none to large and its wheel in the positions of the smallest and the largest error; and random
drives (tests/helpers/searched_drives.py) with light, heavy and random torques.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hdassist import Drive

KINDS = ("light", "heavy", "any")  # kinds of tests/helpers/searched_drives.py
OFFSETS = (0.0, 80.0, 120.0)  # um; housing-fixed eccentricities
HOLES = 24  # positions among which those of the smallest and the largest error are found
RANDOM = 70  # random drives of each kind
FAR = 0.01  # arcsec; differences above this value are counted


@dataclass(frozen=True)
class Compared:
    """Results for a drive from all states and from proposals, in this order.

    F_ior: F'_ior [arcsec].
    states: number of solved states.
    seconds: processor time [s].
    """

    F_ior: tuple[float, float]
    states: tuple[int, int]
    seconds: tuple[float, float]

    @property
    def missed(self) -> float:
        """The difference between both results [arcsec]."""
        return abs(self.F_ior[0] - self.F_ior[1])


def compared(case: tuple[Drive, float]) -> Compared | None:
    """Compare both ways for a drive; None if its result is outside the limits of the model.

    case: drive and torque [N*m].
    """
    from hdassist.drive.error.error_map import Batch, ErrorMap
    from hdassist.drive.error.extremes import many_extremes
    from hdassist.run.errors import UntrustedError

    drive, M_g = case
    try:
        begun = time.process_time()
        every = ErrorMap(drive, M_g).extremes()
        between = time.process_time()
        proposed = many_extremes(ErrorMap(drive, M_g), Batch.of(drive))
        seconds = (between - begun, time.process_time() - between)
    except UntrustedError:
        return None
    return Compared((every.first, proposed.first), (every.certificate.states, proposed.certificate.states), seconds)


def cases(random: int) -> dict[str, list[tuple[Drive, float]]]:
    """Return drives with their torques [N*m], by group; random: number of random drives of each kind."""
    from hdassist import load_preset, preset_names
    from tests.helpers.searched_drives import searched_drive

    presets = [(drive, M_g) for drive in map(load_preset, preset_names()) for M_g in drive.operation.M_g]
    groups = {"presets": presets, "hard cases": list(_hard(load_preset("vzp160")))}
    return groups | {f"random drives, {kind}": [searched_drive(kind, k) for k in range(random)] for kind in KINDS}


def _hard(drive: Drive) -> Iterator[tuple[Drive, float]]:
    import numpy as np

    from hdassist.drive.error.error_map import ErrorMap
    from hdassist.features.mounting.positions import rotated

    for M_g in drive.operation.M_g:
        error_map = ErrorMap(drive, M_g)
        for e_hb in OFFSETS:
            turned = [rotated(drive.with_values({"tolerances.e_hb": e_hb}), 360 * k / HOLES) for k in range(HOLES)]
            values = [error_map.extremes(there).first for there in turned]
            yield from ((turned[k], M_g) for k in (np.argmin(values), np.argmax(values)))


def measure(quick: bool, random: int = RANDOM) -> list[dict[str, Any]]:
    """Return the errors of proposals [arcsec], and the states and processor time [ms] of both ways, by group."""
    with ProcessPoolExecutor(os.cpu_count()) as executor:
        return [
            _summary(name, [row for row in executor.map(compared, group) if row])
            for name, group in cases(5 if quick else random).items()
        ]


def _summary(group: str, rows: list[Compared]) -> dict[str, Any]:
    values, missed = [row.F_ior[0] for row in rows], [row.missed for row in rows]
    median = partial(map, statistics.median)
    return {
        "group": group,
        "cases": len(rows),
        "F_ior_arcsec": [min(values), max(values)],
        "states": list(median(zip(*(row.states for row in rows), strict=True))),
        "ms": [1e3 * s for s in median(zip(*(row.seconds for row in rows), strict=True))],
        "missed_arcsec": max(missed),
        "missed_share": max((row.missed / row.F_ior[0] for row in rows if row.missed > FAR), default=0.0),
        "far": sum(miss > FAR for miss in missed),
    }


def main() -> None:
    """Compare both ways, and print a line for each group."""
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--n", type=int, default=1000, help="random drives of each kind")
    reader.add_argument("--quick", action="store_true", help="five of each kind")
    options = reader.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # set before numpy is loaded
    for row in measure(options.quick, options.n):
        print(", ".join(f"{name} {value}" for name, value in row.items()))


if __name__ == "__main__":
    main()
