"""How far F'_ior of drives near a known one lies from a search of each: `python -m benchmarks.nearby`.

The drives are the shipped presets with what they leave to defaults, or assume, at both ends of its plausible range, and
with a micrometre more and less of the lengths that `hdassist check` has slopes for. Costs are processor time of one
process.
"""

from __future__ import annotations

import os
import time


def ends(drive):
    """Fields and values to try."""
    from hdassist.error.sensitivity import MICROMETRE
    from hdassist.model.assumed import assumptions

    for each in assumptions(drive):
        yield from ((each.path, end) for end in (each.low, each.high))
    for path, micrometre in MICROMETRE.items():
        yield from ((path, drive.value(path) + step * micrometre) for step in (-1, 1))


def main() -> None:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # numpy is not loaded yet
    import numpy as np

    from hdassist.error.nearby import Nearby
    from hdassist.error.search import CycleSearch
    from hdassist.errors import HdassistError
    from hdassist.loading.load import load_preset
    from hdassist.preset.library import preset_names

    print(
        f"{'preset':18} {'M_g':>6} {'values':>6}  {'off by, arcsec: median, 95 %, worst':36} {'worst share':>11}  cost"
    )
    for name in preset_names():
        drive = load_preset(name)
        for M_g in drive.operation.M_g:
            near, off, shares, spent = Nearby(drive, (M_g,)), [], [], np.zeros(2)
            for path, end in ends(drive):
                try:
                    there = drive.with_values({path: end})
                    begun = time.process_time()
                    (found,), _ = near.F_ior(there)
                    between = time.process_time()
                    searched = CycleSearch(there, M_g).extremes(there).F_ior_arcsec
                except HdassistError:  # no such drive, or none that can be computed
                    continue
                spent += between - begun, time.process_time() - between
                off.append(abs(found - searched))
                shares.append(off[-1] / searched)
            told = "  ".join(f"{value:10.4f}" for value in np.quantile(off, [0.5, 0.95, 1]))
            print(f"{name:18} {M_g:6g} {len(off):6}  {told:36} {max(shares):11.2%}  {spent[0] / spent[1]:.2f}")


if __name__ == "__main__":
    main()
