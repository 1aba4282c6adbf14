"""How often and how accurately `compare` finds hidden deviations of the small drive on simulated test rigs.

    python -m benchmarks.compare_rigs FIRST LAST

Each rig gives one line: input revolutions of the recording, whether the start was given, the conclusion, the hidden
deviation, and the errors of its size and direction with their standard uncertainties. Every third rig has no hidden
deviation.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from hdassist import load_preset, trace
from hdassist.features.measuring.measure import measure
from hdassist.features.record_comparison.compare import compare
from hdassist.features.record_comparison.record import VECTORS, Alignment, size_and_direction, vectors_of, with_vectors
from hdassist.run.run import UNCHECKED
from tests.helpers.rigs import recorded, slow_noise

SMALL = str(Path(__file__).parents[1] / "tests/data/small.yaml")
TURNS = (30, 12, 8, 4)
NOISE = 0.5  # arcsec; white, or in every fifth rig correlated over five readings
M_G = 4.0
SIZES = [vector.size for vector in VECTORS]


def rig(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drive = load_preset(SMALL, ["numerics.n_max=20", "numerics.n_2=40"])
    turns, given = TURNS[seed // 2 % len(TURNS)], bool(seed % 2)
    vectors, hidden, k = vectors_of(drive), drive, None
    if seed % 3:
        k = SIZES.index(rng.choice(["tolerances.F_i1", *["tolerances.F_i2", "tolerances.e_hb"] * 2, "tolerances.e_hh"]))
        vectors[k] += rng.uniform(6, 25) * np.exp(1j * rng.uniform(0, 2 * np.pi))
        hidden = with_vectors(drive, vectors, [k])
    start = float(rng.uniform(0, 360))
    error = trace(hidden, M_G, revolutions=turns, start_deg=start, run=UNCHECKED).error
    count = len(error.states)
    noise = slow_noise(rng, count, NOISE, 0.8) if seed % 5 == 3 else NOISE * rng.standard_normal(count)
    record = recorded(error.states.phi_h / (2 * np.pi), error.error_arcsec + noise)
    found = measure(record, drive=drive, together=True)
    result = compare(found, drive, M_G, asked=Alignment(start_deg=start if given else 0.0, fitted=(not given, False)))
    words = [f"rig {seed}: {turns} turns, start {'given' if given else 'fitted'}: {result.conclusion.kind}"]
    if result.conclusion.best:
        words.append("+".join(result.conclusion.best.deviations))
    if k is not None:
        words.append(f"hidden {VECTORS[k].size}")
    if k is not None and result.singles:
        size, direction = size_and_direction(drive, vectors, k)
        for change in result.singles[k].changes:
            words.append(f"size {change.size_um - size:+.2f} um, u {change.size_uncertainty_um:.2f}")
            if change.direction_deg is not None:
                off = (change.direction_deg - direction + 180) % 360 - 180
                words.append(f"direction {off:+.2f} deg, u {change.direction_uncertainty_deg:.2f}")
    print("; ".join(words), flush=True)


if __name__ == "__main__":
    for number in range(int(sys.argv[1]), int(sys.argv[2])):
        rig(number)
