"""Coverage of the intervals of F'_ior of two directions: `python -m benchmarks.directions --rigs 32`.

A rig records an invented drive of benchmarks/recordings.py in both directions. Every third drive has a spectrum of no
real drive. The two error curves differ by the lost motion, and in turn by a lag of an encoder, by friction that changes
all waves, by a dead band, or by differences of single waves. The directions cover the parts of the cycle in `LAYOUTS`,
with 25 to 120 readings per revolution and white noise of 0.2 to 2 arcsec. The truth is the range of the curve of each
direction on a fine grid. Each direction is evaluated without the other (`posterior_of_recording`), and both by one
model (`posteriors_of_directions`).

A rig takes 6 to 15 s of processor time, 32 rigs 4 to 8 minutes.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, field

import numpy as np

from benchmarks.recordings import FINE, LIMITS, MadeDrive, made_drive
from hdassist.drive.model.geometry import Array
from hdassist.recording.figures import RangeFigure, range_figure
from hdassist.recording.positions import Recording, recording_from_columns
from hdassist.recording.posterior import posterior_of_recording, posteriors_of_directions
from hdassist.run.errors import Verdict

LAYOUTS = ("whole, whole", "first part, remaining part", "part, same part", "whole, part")
METHODS = ("separate", "one model")
LAG_REV = 0.02  # largest lag of an encoder [input rev]
FRICTION = 0.15  # largest change of all waves by friction, relative to the wave
DEAD_BAND = 0.3  # size of the dead band, relative to the standard deviation of the error
DIFFERENT_WAVES = 6  # number of waves that differ between the directions
DIFFERENCE = 0.15  # largest difference of such a wave, relative to the standard deviation of the error
LOST_MOTION = 30.0  # largest lost motion [arcsec]


class Rig:
    """A drive with an error curve for each direction.

    drive: the invented drive.
    layout: index of the covered parts in LAYOUTS.
    """

    def __init__(self, seed: int, number: int) -> None:
        """Invent a rig; number: number of the rig, which determines its layout, its drive and its differences."""
        rng = self._rng = np.random.default_rng([seed, number])
        self.layout = number % len(LAYOUTS)
        self.drive: MadeDrive = made_drive(rng, number % 3 != 2)
        self._kind = number // len(LAYOUTS) % 4
        turns = np.linspace(0, self.drive.ratio, 4000)
        self._size = float(np.std(self.drive.error(turns)))
        self._lag = rng.uniform(-LAG_REV, LAG_REV)
        self._friction = rng.uniform(-FRICTION, FRICTION)
        self._orders = rng.choice([0, 1, 2, 2, 4, 6], DIFFERENT_WAVES)
        sidebands = rng.integers(-4, 5, DIFFERENT_WAVES)
        self._sidebands = np.where((self._orders == 0) & (sidebands == 0), 1, sidebands)
        self._sizes = self._size * rng.uniform(0, DIFFERENCE, DIFFERENT_WAVES)
        self._phases = rng.uniform(0, 2 * np.pi, DIFFERENT_WAVES)

    def error(self, turns: Array, direction: int) -> Array:
        """Return the error of a direction [arcsec].

        turns: input angles [rev], ascending, shape (angles,).
        direction: 1 or -1.
        """
        if self._kind == 0:
            return self.drive.error(turns + direction * self._lag)
        error = self.drive.error(turns)
        if self._kind == 1:
            return error * (1 + direction * self._friction / 2)
        if self._kind == 2:
            slope = np.gradient(error, turns) / (4 * np.pi * self._size)
            return np.asarray(error + direction * DEAD_BAND * self._size / 2 * np.tanh(slope))
        for order, sideband, size, phase in zip(self._orders, self._sidebands, self._sizes, self._phases, strict=True):
            periods = order + sideband / self.drive.ratio
            error = error + direction * size / 2 * np.cos(2 * np.pi * periods * turns + phase)
        return error

    def true_range(self, direction: int) -> float:
        """Return the range of the error of a direction over the cycle [arcsec]."""
        turns = np.arange(self.drive.ratio * FINE) / FINE
        return float(np.ptp(self.error(turns, direction)))

    def recordings(self) -> list[Recording]:
        """Return the recordings of the forward and of the backward direction."""
        rng = self._rng
        ratio = self.drive.ratio
        per_rev = rng.uniform(25, min(120, 6000 / ratio))
        sigma = 0.2 * 10 ** rng.uniform(0, 1)
        part = rng.uniform(0.4, 0.6)
        lost_motion = rng.uniform(0, LOST_MOTION)
        ends = (
            ((0.0, 1.0), (0.0, 1.0)),
            ((0.0, part), (part, 1.0)),
            ((0.0, part), (0.0, part)),
            ((0.0, 1.0), (0.1, 0.1 + part)),
        )[self.layout]
        recordings = []
        for (first, last), direction in zip(ends, (1, -1), strict=True):
            turns = first * ratio + np.arange(int((last - first) * ratio * per_rev)) / per_rev
            noise = sigma * rng.standard_normal(len(turns))
            error = self.error(turns, direction) - direction * lost_motion / 2 + noise
            recordings.append(recording_from_columns(turns[::direction], error[::direction], ratio))
        return recordings


@dataclass
class Tally:
    """Counts of the results of a method for a layout.

    intervals: number of intervals.
    holding: number of intervals that contain the true value.
    widths: width of each interval over the true value.
    seconds: processor time of each rig [s].
    wrong: wrong verdicts.
    """

    intervals: int = 0
    holding: int = 0
    widths: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    wrong: int = 0

    def add(self, figure: RangeFigure, truth: float, greatest: float) -> bool:
        """Add a result, and return whether its interval contains the true value.

        truth: true range of the recorded cycle [arcsec].
        greatest: largest true range of any cycle [arcsec].
        """
        low, high = figure.interval_arcsec
        is_holding = low <= greatest and truth <= high
        self.intervals += 1
        self.holding += is_holding
        self.widths.append((high - low) / truth)
        for limit in LIMITS:
            verdict = figure.verdict(limit * (truth if limit < 1 else greatest))
            self.wrong += verdict is (Verdict.PASS if limit < 1 else Verdict.FAIL)
        return is_holding


def judge(rig: Rig, name: str, tallies: dict[tuple[int, str], Tally]) -> None:
    """Record a rig, and add the results of both methods; print intervals without the true value.

    name: name of the rig for messages.
    tallies: counts by layout and method.
    """
    recordings = rig.recordings()
    for method in METHODS:
        tally = tallies[rig.layout, method]
        begin = time.process_time()
        if method == "separate":
            posteriors = [posterior_of_recording(recording) for recording in recordings]
        else:
            posteriors = list(posteriors_of_directions(*recordings))
        tally.seconds.append(time.process_time() - begin)
        for posterior, direction in zip(posteriors, (1, -1), strict=True):
            truth = rig.true_range(direction)
            figure = range_figure(posterior)
            if not tally.add(figure, truth, truth + 2 * rig.drive.line[1]):
                low, high = figure.interval_arcsec
                print(f"  missed: {name}, {method}, direction {direction}: {truth:.2f} not in {low:.2f} to {high:.2f}")


def main() -> None:
    """Print coverage, widths, wrong verdicts and times by layout."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=int, default=32, help="number of rigs")
    parser.add_argument("--first", type=int, default=0, help="number of the first rig")
    parser.add_argument("--seed", type=int, default=777, help="seed of the rigs")
    arguments = parser.parse_args()
    tallies = {(layout, method): Tally() for layout in range(len(LAYOUTS)) for method in METHODS}
    for number in range(arguments.first, arguments.first + arguments.rigs):
        judge(Rig(arguments.seed, number), f"rig {number}", tallies)
    print("layout, method: interval holds | width | wrong verdicts | CPU s of a rig")
    for (layout, method), tally in tallies.items():
        if tally.intervals:
            print(
                f"{LAYOUTS[layout]:>26}, {method:>9}: {tally.holding} of {tally.intervals} | "
                f"{100 * np.median(tally.widths):.1f} % | {tally.wrong} | {np.median(tally.seconds):.1f}"
            )


if __name__ == "__main__":
    main()
