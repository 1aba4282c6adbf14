"""Misfit of F'_ior over the positions by different stiffnesses: `python -m benchmarks.misfit [PRESET] [M_G]`.

Drives of a preset have the same deviations, and all other inputs are sampled. For each pair of drives, one curve of
F'_ior over 24 positions is scaled and turned (by up to two positions) until the difference is smallest. The remaining
difference shows the size and the smoothness of the misfit of a drive to its nearest drive of the preset. MISFITS and
LENGTH in belief/evidence.py represent it.
"""

from __future__ import annotations

import argparse
from itertools import permutations

import numpy as np
from scipy.special import ive

from hdassist.drive.model.geometry import Array

POSITIONS, SYSTEMS, DEVIATIONS, MOST_TURNED = 24, 8, 6, 2


def curves(name: str, M_g: float) -> Array:
    """Return F'_ior of samples [arcsec], shape (systems, deviations, positions).

    name: name of the preset.
    M_g: torque [N*m].
    """
    from hdassist import load_preset
    from hdassist.belief.draws import meshing_shift
    from hdassist.belief.prior import RIGID_SHIFT
    from hdassist.belief.proposals import open_deviations
    from hdassist.drive.error.error_map import Batch, error_maps
    from hdassist.drive.error.extremes import DRAWN_GRIDS, many_extremes
    from hdassist.drive.model.deviations import carried
    from hdassist.features.mounting.posterior import open_prior

    prior, found = open_prior(load_preset(name)), []
    turns = np.linspace(0, 360, POSITIONS, endpoint=False)
    deviations = {each.path for each in open_deviations(prior)}
    drawn = [{p: v for p, v in each.items() if p in deviations} for each in prior.values(prior.shares(DEVIATIONS, 5))]
    for values in prior.values(prior.shares(SYSTEMS, 3)):
        drive = prior.drive.with_values({p: v for p, v in values.items() if p not in deviations})
        drive = drive.with_values({RIGID_SHIFT: meshing_shift(drive)[0]}) if prior.meshing else drive
        (error_map,) = error_maps(drive, [M_g])
        every = [drive.with_values(each) for each in drawn]
        batches = [Batch(each, {path: each.number(path) + turns for path in carried(each)}) for each in every]
        found.append([many_extremes(error_map, each, DRAWN_GRIDS).F_ior_arcsec for each in batches])
    return np.array(found)


def main() -> None:
    """Print the sizes of the differences, and their waves over the positions compared with those of the kernel."""
    from hdassist.belief.evidence import LENGTH

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("preset", nargs="?", default="vzp160")
    parser.add_argument("M_g", nargs="?", type=float, default=80.0)
    args = parser.parse_args()
    F_ior, differences = curves(args.preset, args.M_g), []
    for one, other in permutations(range(SYSTEMS), 2):
        for y, f in zip(F_ior[one], F_ior[other], strict=True):
            turned = np.stack([np.roll(f, k) for k in range(-MOST_TURNED, MOST_TURNED + 1)])
            scaled = turned * ((turned @ y) / np.square(turned).sum(axis=1))[:, None]
            rest = (scaled - y) / y.mean()
            differences.append(rest[np.argmin(np.square(rest).sum(axis=1))])
    sizes = np.sqrt(np.square(differences).mean(axis=1))
    power = np.square(np.abs(np.fft.rfft(differences))).mean(axis=0) * np.where(np.arange(POSITIONS // 2 + 1), 2, 1)
    order = np.arange(7)
    print("share of the mean F'_ior, rms, median, 90 %:", np.sqrt(np.mean(sizes**2)), *np.quantile(sizes, (0.5, 0.9)))
    print("waves a turn of the seat, share of each:", (power / power.sum())[:7].round(3))
    print("of the kernel:                         ", (ive(order, LENGTH**-2) * np.where(order, 2, 1)).round(3))


if __name__ == "__main__":
    main()
