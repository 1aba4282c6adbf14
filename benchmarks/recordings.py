"""Coverage of the interval of F'_ior, and verdicts, of hdassist.recording on independently made recordings.

python -m benchmarks.recordings --n 40 --solved 10

Each drive of `--n` is a sum of cosines with random sizes: orders 1 to 16 of the input, up to 8 sidebands on each side,
and waves of the output. Half of the drives have the sizes of typical drives. The others have spectra of no real drive:
every order is equally probable, sidebands are as large as the order, every third has a line between the orders, and
every fourth has a square wave. A recording covers the whole cycle, the whole cycle in 2 to 4 sweeps with separate
levels, or 12 to 95 % of the cycle. It has 20 to 200 readings per revolution at even or uneven angles, with or without
encoder steps, white or correlated noise, and a linear or curved drift. The truth is the range of the error of the drive
on a fine grid of the recorded cycle. A line between the orders has another phase in the next cycle. A PASS is therefore
judged by the recorded cycle, a FAIL by the cycle with the largest range, and the interval may end between these ranges.

With `--measure`, the recordings are files, and `accept` decides with a budget of 0. Recordings of the whole cycle and
of parts have lost rows, outliers and, in every fourth, a step of the level, which `measure` corrects. The interval is
that of `measure`.

With `--solved`, this number of hidden drives of benchmarks/honesty.py is solved over the full cycle. Each is recorded
four times: the whole cycle, the split cycle, and two parts.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from dataclasses import dataclass, field
from io import BytesIO

import numpy as np

from benchmarks.sizes import solved_cycle
from hdassist.drive.model.geometry import Array
from hdassist.features.acceptance.accept import covered_cycle
from hdassist.features.acceptance.decision import AcceptedValue, CoveredCycle, decide
from hdassist.features.acceptance.limits import F_IOR, Limit
from hdassist.features.measuring.full_cycle import with_full_cycle
from hdassist.features.measuring.measure import SweepResult, measure
from hdassist.features.measuring.orders import STATED
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.recording.figures import RangeFigure, range_figure
from hdassist.recording.positions import Recording, recording_from_columns
from hdassist.recording.posterior import posterior_of_recording
from hdassist.run.errors import SURE, HdassistError, Verdict

LIMITS = (0.9, 0.97, 1.03, 1.1)  # limits as shares of the true range
FINE = 400  # points per input revolution at which the true error is computed
FINER = 16  # points per state of a solved drive


@dataclass(frozen=True)
class MadeDrive:
    """Invented drive, given by its waves.

    ratio: input revolutions per output revolution.
    orders, sidebands: periods of each wave per input revolution and per output revolution, shape (waves,).
    sizes: amplitudes [arcsec], shape (waves,).
    phases: phases [rad], shape (waves,).
    line: periods per input revolution and amplitude of a line between the orders.
    square: order and size of a square wave.
    """

    ratio: int
    orders: Array
    sidebands: Array
    sizes: Array
    phases: Array
    line: tuple[float, float] = (1.0, 0.0)
    square: tuple[int, float] = (2, 0.0)

    def error(self, turns: Array) -> Array:
        total = np.zeros(len(turns))
        for k, j, size, phase in zip(self.orders, self.sidebands, self.sizes, self.phases, strict=True):
            total += size * np.cos(2 * np.pi * (k + j / self.ratio) * turns + phase)
        order, size = self.square
        return np.asarray(total + size * np.tanh(8 * np.sin(2 * np.pi * order * turns + 1.0)))

    def recorded(self, turns: Array) -> Array:
        return self.error(turns) + self.line[1] * np.cos(2 * np.pi * self.line[0] * turns)

    def ranges(self, begin: float) -> tuple[float, float]:
        turns = begin + np.arange(self.ratio * FINE) / FINE
        return float(np.ptp(self.recorded(turns))), float(np.ptp(self.error(turns))) + 2 * self.line[1]


def made_drive(rng: np.random.Generator, is_typical: bool) -> MadeDrive:
    """Return an invented drive; is_typical: whether its waves have typical sizes, or a spectrum of no real drive."""
    ratio = int(rng.choice([30, 50, 80, 100, 120]))
    waves = []
    line, square = (1.0, 0.0), (2, 0.0)
    if is_typical:
        largest = rng.uniform(5, 20)
        strength = {1: 0.15, 2: 1.0, 3: 0.08, 4: 0.5, 6: 0.08, 8: 0.05, 10: 0.02, 16: 0.01}
        for k, share in strength.items():
            main = largest * share * rng.lognormal(0, 0.5)
            waves.append((k, 0, main))
            waves.append((k, k * int(rng.choice([-1, 1])), main * rng.uniform(0, 0.8)))
            for j in range(1, 6):
                waves += [(k, sign * j, main * rng.uniform(0, 0.5) / 2.0**j) for sign in (-1, 1)]
        waves += [(0, j, largest * rng.uniform(0, 0.6) / j) for j in (1, 2, 4)]
    else:
        for k in rng.choice(np.arange(1, 17), size=int(rng.integers(1, 7)), replace=False).tolist():
            main = rng.uniform(1, 10)
            waves.append((k, 0, main))
            for j in rng.integers(-8, 9, size=int(rng.integers(0, 4))).tolist():
                waves.append((k, j, main * rng.uniform(0, 1)))
        waves += [(0, j, rng.uniform(0, 8)) for j in range(1, int(rng.integers(1, 4)))]
        if rng.random() < 1 / 3:
            line = rng.uniform(3.2, 9.8), rng.uniform(0.5, 3)
        if rng.random() < 1 / 4:
            square = int(rng.choice([1, 2, 4])), rng.uniform(2, 10)
    k, j, sizes = np.array(waves, float).T
    phases = rng.uniform(0, 2 * np.pi, len(k))
    return MadeDrive(ratio=ratio, orders=k, sidebands=j, sizes=sizes, phases=phases, line=line, square=square)


@dataclass(frozen=True)
class SolvedDrive:
    """Solved drive.

    ratio: input revolutions per output revolution.
    cycle: error at even angles of the full cycle [arcsec], shape (angles,).
    """

    ratio: int
    cycle: Array

    @classmethod
    def of(cls, ratio: int, states: Array) -> SolvedDrive:
        """Return a drive whose error is the Fourier series through its states.

        The states are one tooth pitch apart. Chords between them would reduce the waves of rough teeth: order 40 of a
        drive with ratio 50 by 40 %.

        ratio: input revolutions per output revolution.
        states: error of the states of the full cycle [arcsec], shape (states,).
        """
        cycle = np.fft.irfft(np.fft.rfft(states), FINER * len(states)) * FINER
        return cls(ratio=ratio, cycle=cycle)

    def recorded(self, turns: Array) -> Array:
        points = len(self.cycle)
        places = turns % self.ratio * points / self.ratio
        return np.asarray(np.interp(places, np.arange(points + 1), np.append(self.cycle, self.cycle[0])))

    def ranges(self, _begin: float) -> tuple[float, float]:
        return float(np.ptp(self.cycle)), float(np.ptp(self.cycle))


def made_recording(rng: np.random.Generator, drive: MadeDrive | SolvedDrive, kind: str) -> Recording:
    """Return a recording of a drive; kind: whole, split or part."""
    per_rev = rng.uniform(20, min(200, 6000 / drive.ratio))
    begin = rng.uniform(0, drive.ratio)
    share = rng.uniform(0.12, 0.95) if kind == "part" else 1.0
    steps = np.full(int(share * drive.ratio * per_rev), 1 / per_rev)
    if rng.random() < 0.25:
        steps *= rng.uniform(0.6, 1.4, len(steps))
    turns = begin + np.cumsum(steps)
    sweep = np.zeros(len(turns), int)
    if kind == "split":
        sweep = np.arange(len(turns)) * int(rng.integers(2, 5)) // len(turns)
    sigma = 0.2 * 10 ** rng.uniform(0, 1)
    noise = sigma * rng.standard_normal(len(turns))
    if rng.random() < 0.5:
        decay = float(np.exp(-1 / (per_rev * rng.uniform(0.01, 0.2))))
        for row in range(1, len(noise)):
            noise[row] = decay * noise[row - 1] + np.sqrt(1 - decay**2) * noise[row]
    travelled = (turns - begin) / drive.ratio
    drift = rng.uniform(-1, 1) * travelled + rng.choice([0.0, 1.0]) * rng.uniform(-1, 1) * travelled**2
    error = drive.recorded(turns) + noise + drift
    if rng.random() < 0.25:
        step = rng.uniform(0.2, 2.0)
        error = step * np.rint(error / step)
    stamps = np.arange(len(turns), dtype=float)
    if kind == "split":  # pieces are recorded in random order, each with its own level
        pieces = int(sweep.max()) + 1
        order = rng.permutation(pieces)
        error += rng.uniform(-5, 5, pieces)[sweep]
        stamps += 2.0 * len(turns) * order[sweep]
    return recording_from_columns(turns, error, drive.ratio, sweep=sweep, time=stamps)


def soiled(rng: np.random.Generator, recording: Recording) -> tuple[Array, Array]:
    """Return the angles [rev] and errors [arcsec] of a recording with lost rows, outliers and a step of the level."""
    turns, error = recording.input_rev, recording.error_arcsec.copy()
    if rng.random() < 0.25:
        error += rng.uniform(20, 60) * (turns > rng.uniform(turns[0] + 2, turns[-1] - 2))
    far_off = rng.choice(len(error), size=int(rng.integers(0, 4)), replace=False)
    error[far_off] += rng.choice([-1, 1], len(far_off)) * rng.uniform(200, 500, len(far_off))
    kept = rng.random(len(error)) > 0.02 * rng.random()
    return turns[kept], error[kept]


def file_of(turns: Array, error: Array) -> bytes:
    """Return the file of a recording; turns: input angles [rev]; error: errors [arcsec]."""
    rows = (f"{360 * turn:.6f},{value:.4f}" for turn, value in zip(turns.tolist(), error.tolist(), strict=True))
    return "\n".join(["cam_deg,error_arcsec", *rows]).encode()


@dataclass(frozen=True)
class MeasuredFigure:
    """F'_ior of a file by `measure` and `accept`, with the attributes of a RangeFigure.

    interval_arcsec: 95 % interval [arcsec].
    direction: direction with the largest F'_ior.
    cycle: covered part of the full cycle, None if the model does not apply.
    """

    interval_arcsec: tuple[float, float]
    direction: SweepResult
    cycle: CoveredCycle | None
    has_few_samples: bool = False

    def verdict(self, limit_arcsec: float) -> Verdict:
        """Return the verdict of `accept` on a limit."""
        limit = Limit(F_IOR.code, limit_arcsec, 1.0)
        return decide(limit, AcceptedValue.measured(limit, self.direction, self.cycle), "guard", SURE).verdict


def measured_figure(rng: np.random.Generator, recording: Recording, kind: str) -> MeasuredFigure | None:
    """Return F'_ior of a recording as a file; None if `measure` refuses it, or if the interval has no upper end."""
    in_time = np.argsort(recording.time, kind="stable")
    turns, error = recording.input_rev[in_time], recording.error_arcsec[in_time]
    if kind != "split":
        turns, error = soiled(rng, recording)
    try:
        trace = read_trace(BytesIO(file_of(turns, error)), TraceForm(robust=True))
        result = measure(trace, ratio=recording.ratio, stated=dict.fromkeys(STATED, 0.0), may_be_noise=True)
        result = with_full_cycle(result)
    except HdassistError:
        return None
    direction = result.greatest
    if direction.by_model is None and direction.is_bound:
        return None
    cycle = covered_cycle(Limit(F_IOR.code, 1.0, 1.0), result, direction)
    return MeasuredFigure(interval_arcsec=direction.interval_arcsec, direction=direction, cycle=cycle)


@dataclass
class Tally:
    """Counts of the results for a kind of recordings."""

    recordings: int = 0
    refused: int = 0
    truth_below: int = 0
    truth_above: int = 0
    few_samples: int = 0
    widths: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    verdicts: dict[tuple[float, Verdict], int] = field(default_factory=lambda: defaultdict(int))


def judge(
    rng: np.random.Generator, name: str, tally: Tally, drive: MadeDrive | SolvedDrive, kind: str, *, by_file: bool
) -> None:
    """Record a drive, and add the result to a tally; print wrong verdicts, and intervals without the truth.

    rng: random generator.
    name: name of the recording for messages.
    tally: counts of its kind.
    drive: drive to record.
    kind: whole, split or part.
    by_file: whether `measure` and `accept` read a file.
    """
    recording = made_recording(rng, drive, kind)
    begin = time.process_time()
    figure: RangeFigure | MeasuredFigure | None
    if by_file:
        figure = measured_figure(rng, recording, kind)
    else:
        figure = range_figure(posterior_of_recording(recording, seed=int(rng.integers(1 << 30))))
    tally.seconds.append(time.process_time() - begin)
    if figure is None:
        tally.refused += 1
        return
    truth, greatest = drive.ranges(float(recording.input_rev[0]))
    low, high = figure.interval_arcsec
    if not (low <= greatest and truth <= high):
        rows = len(recording.error_arcsec)
        print(f"  missed: {name}, {rows} readings, ratio {drive.ratio}: {truth:.2f} not in {low:.2f} to {high:.2f}")
    tally.recordings += 1
    tally.truth_below += greatest < low
    tally.truth_above += truth > high
    tally.few_samples += figure.has_few_samples
    tally.widths.append((high - low) / truth)
    for limit in LIMITS:
        verdict = figure.verdict(limit * (truth if limit < 1 else greatest))
        tally.verdicts[limit, verdict] += 1
        if verdict is (Verdict.PASS if limit < 1 else Verdict.FAIL):
            print(f"  wrong {verdict}: {name} at {limit} of {truth:.2f}")


def main() -> None:
    """Print coverage, wrong verdicts and times by kind."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=40, help="number of recordings")
    parser.add_argument("--solved", type=int, default=0, help="number of solved drives, four recordings each")
    parser.add_argument("--measure", action="store_true", help="judge `measure` and `accept` through files")
    parser.add_argument("--seed", type=int, default=0, help="first seed")
    arguments = parser.parse_args()
    tallies: dict[str, Tally] = defaultdict(Tally)
    for number in range(arguments.n):
        is_typical = number % 2 == 0
        kind = ("whole", "part", "split", "part")[number // 2 % 4]
        name = f"{'typical' if is_typical else 'other'} {kind}"
        rng = np.random.default_rng([arguments.seed, number])
        judge(rng, f"{name} {number}", tallies[name], made_drive(rng, is_typical), kind, by_file=arguments.measure)
    for number in range(arguments.solved):
        drive = SolvedDrive.of(*solved_cycle(number, arguments.seed))
        for take, kind in enumerate(("whole", "split", "part", "part")):
            rng = np.random.default_rng([arguments.seed, number, take])
            judge(rng, f"solved {kind} {number}", tallies[f"solved {kind}"], drive, kind, by_file=arguments.measure)
    heads = "interval holds | truth below, above | width | few samples | CPU s median, max"
    print(f"{'recordings':>16}: {heads} | PASS/FAIL/INCONCLUSIVE at {LIMITS} of the truth")
    for name, tally in sorted(tallies.items()):
        if not tally.recordings:
            print(f"{name:>16}: {tally.refused} without two ends")
            continue
        held = tally.recordings - tally.truth_below - tally.truth_above
        decisions = "  ".join(
            "/".join(
                str(tally.verdicts[limit, verdict]) for verdict in (Verdict.PASS, Verdict.FAIL, Verdict.INCONCLUSIVE)
            )
            for limit in LIMITS
        )
        print(
            f"{name:>16}: {held} of {tally.recordings} | {tally.truth_below}, {tally.truth_above} | "
            f"{100 * np.median(tally.widths):.1f} % | {tally.few_samples} | "
            f"{np.median(tally.seconds):.1f}, {max(tally.seconds):.1f} | {decisions}"
            f" | {tally.refused} without two ends"
        )
    wrong_pass = sum(t.verdicts[limit, Verdict.PASS] for t in tallies.values() for limit in LIMITS if limit < 1)
    wrong_fail = sum(t.verdicts[limit, Verdict.FAIL] for t in tallies.values() for limit in LIMITS if limit > 1)
    print(f"wrong PASS {wrong_pass}, wrong FAIL {wrong_fail} of {2 * sum(t.recordings for t in tallies.values())} each")


if __name__ == "__main__":
    main()
