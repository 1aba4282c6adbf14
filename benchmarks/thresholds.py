"""Two thresholds of the evaluation of recordings: `python -m benchmarks.thresholds --drives 40 --seeds 12`.

**Likely images.** N even readings per input revolution do not distinguish order n from order N - n. The second is the
image, and it counts as likely if its usual size is at least a third of that of the lower order (`_LIKELY_IMAGE` in
features/measuring/orders.py). Hidden drives of benchmarks/honesty.py are solved over the full cycle. For each pair of
orders up to 16, the table gives the share of drives in which the image is larger than the lower order, by the ratio of
their usual sizes. Only pairs with more than 2 % of the range of the error count.

**Kept samples.** The interval of F'_ior follows from the kept draws of a chain. With n independent normal samples, the
standard error of an end of a 95 % interval is sqrt(0.025 * 0.975 / n) / 0.0584 standard deviations, which is
0.68 / sqrt(n) of the width. 0.0584 is the normal density at this end. Recordings of invented drives are sampled with
several seeds. The table compares the standard deviation of the ends over the seeds with this formula, at the mean kept
effective sample size (`_ENOUGH_KEPT` in recording/chain.py).
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.recordings import made_drive, made_recording
from benchmarks.sizes import solved_cycle, wave_sizes
from hdassist.recording.chain import effective_samples
from hdassist.recording.figures import range_figure
from hdassist.recording.posterior import posterior_of_recording
from hdassist.recording.sizes import ORDER_PROFILE
from hdassist.recording.waves import ALWAYS_ORDER

CLEAR = 0.02  # smallest sum of both amplitudes of a pair, relative to the range of the error
RATIO_CLASSES = (0.0, 0.1, 0.2, 1 / 3, 0.5, 1.0)  # borders of classes of the ratio of the usual sizes
KINDS = ("whole", "part")  # recordings whose chains are compared
END_ERROR = 0.68  # standard error of an end of a 95 % interval for one sample, relative to the width


def image_counts(drives: int, seed: int) -> list[tuple[int, int]]:
    """Return the number of pairs with the larger image, and the number of all clear pairs, for each class of ratios.

    drives: number of solved drives.
    seed: seed of the drives.
    """
    counts = [[0, 0] for _ in RATIO_CLASSES[1:]]
    for number in range(drives):
        ratio, error = solved_cycle(number, seed)
        sizes = wave_sizes(ratio, error)
        clear_size = CLEAR * float(np.ptp(error))
        for lower in range(1, ALWAYS_ORDER):
            for image in range(lower + 1, ALWAYS_ORDER + 1):
                usual_ratio = ORDER_PROFILE[image] / ORDER_PROFILE[lower]
                if usual_ratio >= 1 or sizes[lower, 0] + sizes[image, 0] < clear_size:
                    continue
                place = int(np.searchsorted(RATIO_CLASSES, usual_ratio, side="right")) - 1
                counts[place][0] += sizes[image, 0] > sizes[lower, 0]
                counts[place][1] += 1
    return [(larger, pairs) for larger, pairs in counts]


def end_errors(kind: str, number: int, seeds: int) -> tuple[float, float, float]:
    """Return the mean kept effective sample size, and the standard deviations of both ends relative to the width.

    kind: kind of the recording.
    number: number of the invented drive.
    seeds: number of chains.
    """
    rng = np.random.default_rng([number, KINDS.index(kind)])
    recording = made_recording(rng, made_drive(rng, is_typical=True), kind)
    effective: list[float] = []
    ends: list[tuple[float, float]] = []
    for seed in range(seeds):
        posterior = posterior_of_recording(recording, seed=seed)
        effective.append(effective_samples(posterior.extremes.range_arcsec))
        ends.append(range_figure(posterior).interval_arcsec)
    low, high = np.array(ends).T
    width = float(np.mean(high - low))
    return float(np.mean(effective)), float(np.std(low, ddof=1)) / width, float(np.std(high, ddof=1)) / width


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drives", type=int, default=40, help="number of solved drives")
    parser.add_argument("--recordings", type=int, default=2, help="number of recordings of each kind")
    parser.add_argument("--seeds", type=int, default=12, help="number of chains of a recording")
    parser.add_argument("--seed", type=int, default=61, help="seed of the drives")
    arguments = parser.parse_args()
    print("ratio of the usual sizes: image larger than the lower order")
    for place, (larger, pairs) in enumerate(image_counts(arguments.drives, arguments.seed)):
        share = f"{100 * larger / pairs:.1f} %" if pairs else "-"
        borders = f"{RATIO_CLASSES[place]:.2f} to {RATIO_CLASSES[place + 1]:.2f}"
        print(f"  {borders}: {larger} of {pairs}, {share}", flush=True)
    print(
        "recording: kept effective samples | error of the lower end, of the upper end, by the formula [% of the width]"
    )
    for kind in KINDS:
        for number in range(arguments.recordings):
            effective, low, high = end_errors(kind, number, arguments.seeds)
            errors = ", ".join(f"{100 * error:.0f}" for error in (low, high, END_ERROR / np.sqrt(effective)))
            print(f"  {kind} {number}: {effective:.0f} | {errors}", flush=True)


if __name__ == "__main__":
    main()
