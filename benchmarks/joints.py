"""How often intervals of `measure` contain F'_ior of joints of limited travel: `python -m benchmarks.joints [JOINTS]`.

For each travel, 40 joints move through a part of an output revolution. A joint has an unknown drive, slow terms of the
output in its error, white or correlated noise, encoder counts or lost rows. The recordings are made from angles only,
without the orders, bins or fits of the tool. This takes about two minutes.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from hdassist.drive.model.geometry import Array
from hdassist.features.measuring.measure import measure
from hdassist.readers.trace import MeasuredTrace, sweeps
from hdassist.run.errors import HdassistError

RATIO, ROWS = 100, 60  # input revolutions per output revolution, rows per input revolution
TRAVELS = (300.0, 240.0, 120.0, 40.0)  # deg
LIMITS = (0.97, 1.03)  # limits as shares of the true F'_ior


class Joint:
    """A joint with a recording, given by its seed and its travel [deg].

    cam_turns: input angles of the recording [rev].
    error_arcsec: errors of the recording [arcsec].
    F_ior_arcsec: true F'_ior [arcsec].
    """

    def __init__(self, seed: int, travel_deg: float) -> None:
        rng = self.rng = np.random.default_rng([seed, 5, int(travel_deg)])
        self.phase, self.share, self.size = rng.uniform(0, 2 * np.pi, 8), rng.uniform(0, 1, 8), rng.uniform(3, 12)
        self.start, span = rng.uniform(0, RATIO), travel_deg / 360 * RATIO
        fine = self.start + np.arange(round(span * 240) + 1) / 240
        self.F_ior_arcsec = float(np.ptp(self.error(fine)))
        count = round(span * ROWS)
        turns = self.start + np.sort(np.arange(count) + rng.uniform(-0.3, 0.3, count)) / count * span
        noise = rng.standard_normal(count)
        if seed % 2:
            noise = lfilter([0.75**0.5], [1, -0.5], noise)
        error = self.error(turns) + rng.choice([0.2, 0.6, 1.5]) * noise
        if seed % 3 == 0:
            error = np.round(error / 0.6) * 0.6
        kept = rng.random(count) > 0.2 * (seed % 4 == 1)
        self.cam_turns, self.error_arcsec = turns[kept], error[kept]

    def error(self, turns: Array) -> Array:
        """Return the error [arcsec] at input angles [rev]."""
        cam, output, p, s = 2 * np.pi * turns, 2 * np.pi * turns / RATIO, self.phase, self.share
        oval = np.cos(2 * cam + p[0]) * (
            1 + 0.5 * s[0] * np.cos(output + p[1]) + 0.2 * s[1] * np.cos(2 * output + p[2])
        )
        cams = 0.3 * s[2] * np.cos(cam + p[3] + 0.5 * s[3] * np.sin(output + p[4])) + 0.1 * s[4] * np.cos(
            4 * cam + p[5]
        )
        slow = s[5] * np.cos(output + p[6]) + 0.4 * s[6] * np.cos(2 * output + p[7])
        return np.asarray(self.size * (oval + cams + slow))

    @property
    def trace(self) -> MeasuredTrace:
        """The recording as the reader returns it."""
        cam = 360 * self.cam_turns
        return MeasuredTrace(
            "joint.csv", "", cam, self.error_arcsec, np.arange(len(cam)) + 1, 0.0, tuple(sweeps(cam)), ()
        )


@dataclass
class JointStudy:
    """Counts of the joints of one travel.

    joints: number of joints.
    held: joints whose interval contains F'_ior.
    false_pass: joints that pass although they exceed the limit by 3 %.
    false_fail: joints that fail although they are 3 % below the limit.
    refused: refused recordings.
    bias: sum of the relative errors of F'_ior.
    """

    joints: int = 0
    held: int = 0
    false_pass: int = 0
    false_fail: int = 0
    refused: int = 0
    bias: float = 0.0

    def add(self, joint: Joint, travel_deg: float) -> None:
        """Measure a joint, and count the result."""
        self.joints += 1
        try:
            (found,) = measure(joint.trace, ratio=RATIO, travel_deg=travel_deg).directions
        except HdassistError:
            self.refused += 1
            return
        low, high = found.interval_arcsec
        below, above = (share * joint.F_ior_arcsec for share in LIMITS)
        self.held += low <= joint.F_ior_arcsec <= high
        self.false_pass += found.range.value + 1.65 * found.uncertainty_arcsec < below and not found.is_bound
        self.false_fail += found.range.value - 1.65 * found.uncertainty_arcsec > above
        self.bias += found.range.value / joint.F_ior_arcsec - 1


def main(count: int) -> None:
    """Print a line for each travel; count: number of joints per travel."""
    for travel_deg in TRAVELS:
        study = JointStudy()
        for seed in range(count):
            study.add(Joint(seed, travel_deg), travel_deg)
        print(f"{travel_deg:g} deg: {vars(study)}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
