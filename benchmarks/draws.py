"""Error of the search for extremes of samples, compared with a fine grid: `python -m benchmarks.draws`.

Samples of a preset are made as by check, each with its wheel in twelve holes at the torques of the preset. F'_ior is
found from a coarse grid of states with slopes, as for samples, and from a grid of 60 x 60 states
(hdassist/drive/error/extremes.py).
"""

from __future__ import annotations

import argparse
import os
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hdassist import Drive

HOLES = 12
DRAWS = 64
FINEST_GRID = (60,)


@dataclass(frozen=True)
class Searched:
    """Both searches for the extremes of a sample at a torque.

    M_g: torque [N*m].
    missed: F'_ior of the coarse minus the fine search in each hole [arcsec].
    F_ior: F'_ior of the fine search in each hole [arcsec].
    states: states per search: of the fine grid, verified in the coarse search, and of its climbs.
    seconds: processor time per search [s], coarse and fine.
    """

    M_g: float
    missed: tuple[float, ...]
    F_ior: tuple[float, ...]
    states: tuple[float, ...]
    seconds: tuple[float, ...]


def drawn_drives(preset: str, count: int) -> list[Drive]:
    """Return the first drives that check samples for a preset; count: their number."""
    from hdassist import load_preset
    from hdassist.belief.evidence import evidence_of
    from hdassist.belief.prior import prior_of
    from hdassist.belief.samples import SamplingEffort, draw_samples

    drive = load_preset(preset)
    prior, effort = prior_of(drive), SamplingEffort(count, count, 32 * count, 16)
    samples = draw_samples(prior, drive.operation.M_g, evidence=evidence_of(drive), effort=effort)
    return [drive.with_values(values) for values in samples.values()[:count]]


def searched(drive: Drive) -> list[Searched]:
    """Return both searches for a drive, one result per torque."""
    from hdassist.drive.error.error_map import Batch, error_maps
    from hdassist.drive.error.extremes import DRAWN_GRIDS, many_extremes
    from hdassist.drive.solve.walk import Walk

    batch, found = Batch.turned(drive, [360 / HOLES * k for k in range(HOLES)]), []
    for error_map in error_maps(drive, drive.operation.M_g):
        error_map.load_case()  # prepares the reference, which both searches use
        begun, climbed = time.process_time(), Walk.climbed
        few = many_extremes(error_map, batch, DRAWN_GRIDS)
        between, climbed = time.process_time(), Walk.climbed - climbed
        fine = many_extremes(error_map, batch, FINEST_GRID)
        seconds = between - begun, time.process_time() - between
        states = fine.certificate.states, few.certificate.states, climbed
        found.append(
            Searched(
                error_map.M_g,
                tuple((few.F_ior_arcsec - fine.F_ior_arcsec).tolist()),
                tuple(fine.F_ior_arcsec.tolist()),
                tuple(each / HOLES for each in states),
                tuple(each / HOLES for each in seconds),
            )
        )
    return found


def measure(quick: bool, preset: str = "vzp160", count: int = DRAWS) -> list[dict[str, Any]]:
    """Return the errors of the coarse search [arcsec], and states and processor time [ms] of both, by torque."""
    import numpy as np

    with ProcessPoolExecutor(os.cpu_count()) as executor:
        every = list(executor.map(searched, drawn_drives(preset, 4 if quick else count)))
    rows = []
    for at_torque in zip(*every, strict=True):
        missed = np.concatenate([each.missed for each in at_torque])
        states, seconds = (
            np.mean([getattr(each, name) for each in at_torque], axis=0) for name in ("states", "seconds")
        )
        rows.append(
            {
                "preset": preset,
                "M_g": at_torque[0].M_g,
                "searches": len(missed),
                "F_ior_arcsec": float(np.median(np.concatenate([each.F_ior for each in at_torque]))),
                "bias": float(missed.mean()),
                "rms": float(np.sqrt((missed**2).mean())),
                "worst": float(np.abs(missed).max()),
                "over": int((np.abs(missed) > 0.2).sum()),
                "states": states.tolist(),
                "ms": (1e3 * seconds).tolist(),
            }
        )
    return rows


def main() -> None:
    """Compare the searches, and print a line for each torque."""
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("preset", nargs="?", default="vzp160")
    reader.add_argument("--n", type=int, default=DRAWS, help="draws")
    options = reader.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # set before numpy is loaded
    for row in measure(False, options.preset, options.n):
        print(", ".join(f"{name} {value}" for name, value in row.items()))


if __name__ == "__main__":
    main()
