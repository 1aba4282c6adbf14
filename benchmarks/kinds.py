"""How often intervals of `measure` contain the truth, by kind of recording: `python -m benchmarks.kinds [RIGS]`.

Each rig is made from angles and times only, with an unknown drive: coloured noise, counts, lost rows, drift, lag,
friction or few angles. It has none of the orders, bins or fits of the tool. The table gives how often the 95 %
intervals on the page of `measure` contain F'_ior, order 2 of the input with its sidebands, lost motion and lag, and the
number of wrong verdicts of `accept` at limits 3 % off the true F'_ior. With both directions, F'_ior is that of each
direction. A rig takes 1 to 4 s. `--kinds` restricts the study to kinds, `--first` continues it.
"""

from __future__ import annotations

import argparse
import io
from collections import Counter

import numpy as np
from scipy.signal import lfilter

from hdassist.drive.model.geometry import Array
from hdassist.features.measuring.full_cycle import with_full_cycle
from hdassist.features.measuring.measure import SweepResult, measure
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.run.errors import GUARD, HdassistError

RATIO, ROWS = 30, 60  # input revolutions of the cycle, one output revolution; rows per input revolution at 1 rev/s
FEW_ROWS = 16
KINDS = ("white noise", "coloured noise", "counts", "lost rows", "drift", "lag", "friction", "few angles")
BOTH_WAYS = ("lag", "friction")  # kinds recorded in both directions, at two speeds
COUNTS = (2**14, 2**22)  # counts per revolution of the input encoder and of the output encoder
LIMITS = (0.97, 1.03)  # limits as shares of the true F'_ior
PER_MS = 1.296e3 / RATIO  # arcsec s/rev; effect of a lag of 1 ms
FINE = np.arange(RATIO * 240) / 240


class Rig:
    """A rig with a recording, given by its kind and its seed.

    file: recording as text.
    F_ior: true F'_ior [arcsec].
    order_2: true amplitude of order 2 [arcsec].
    play: true lost motion [arcsec].
    lag: true lag of the output encoder [ms].
    """

    def __init__(self, kind: str, seed: int) -> None:
        rng = self.rng = np.random.default_rng([KINDS.index(kind), seed])
        self.kind, self.size = kind, rng.uniform(3, 12)
        self.phase, self.share = rng.uniform(0, 2 * np.pi, 8), rng.uniform(0, 1, 8)
        self.play, self.lag, self.rubs = (
            (rng.uniform(0, 20), *((rng.uniform(-1, 1), 0.0) if kind == "lag" else (0.0, rng.uniform(0, 3))))
            if kind in BOTH_WAYS
            else (0.0, 0.0, 0.0)
        )
        self.F_ior, self.order_2 = float(np.ptp(self.error(FINE))), float(np.sqrt(2 * np.mean(self.oval(FINE) ** 2)))
        self.file = self.written()

    def oval(self, turns: Array) -> Array:
        """Return the error [arcsec] of order 2 of the input with its sidebands, at input angles [rev]."""
        cam, output, p, s = 2 * np.pi * turns, 2 * np.pi * turns / RATIO, self.phase, self.share
        beats = 1 + 0.5 * s[0] * np.cos(output + p[1]) + 0.2 * s[1] * np.cos(2 * output + p[2])
        return np.asarray(self.size * np.cos(2 * cam + p[0]) * beats)

    def error(self, turns: Array) -> Array:
        """Return the total error [arcsec] at input angles [rev]."""
        cam, output, p, s = 2 * np.pi * turns, 2 * np.pi * turns / RATIO, self.phase, self.share
        rest = 0.3 * s[2] * np.cos(cam + p[3] + 0.5 * s[3] * np.sin(output + p[4])) + 0.1 * s[4] * np.cos(
            4 * cam + p[5]
        )
        return np.asarray(self.oval(turns) + self.size * (rest + s[5] * np.cos(output + p[6])))

    def noise(self, count: int) -> Array:
        """Return the noise of readings [arcsec]; count: number of readings."""
        white = self.rng.standard_normal(count)
        if self.kind == "coloured noise":
            memory = self.rng.uniform(0.3, 0.9)
            white = lfilter([np.sqrt(1 - memory**2)], [1, -memory], white)
        return np.asarray(self.rng.choice([0.2, 0.6, 1.5]) * white)

    def written(self) -> str:
        """Return the columns of time, input angle and output angle as text."""
        parts, start, per_turn = [], 0.0, FEW_ROWS if self.kind == "few angles" else ROWS
        for speed in (1.0, 2.0) if self.kind in BOTH_WAYS else (1.0,):
            for way in (1, -1) if self.kind in BOTH_WAYS else (1,):
                time = np.arange(1, RATIO * per_turn + 1) / per_turn / speed
                first = 0.0 if way > 0 else float(RATIO)
                turns = first + way * speed * time
                if self.kind == "counts":  # motors turn unevenly
                    turns += self.rng.uniform(-0.3, 0.3, len(turns)) / ROWS
                late = turns + way * speed * self.lag / 1e3
                lost = way * (self.play / 2 + self.rubs * speed)
                output = late / RATIO * 1_296_000 + self.error(late) - lost + self.noise(len(time))
                parts.append(np.array([start + time, turns * 360, output / 3600]))
                start += float(time[-1]) + 0.5
        time, cam, output = np.concatenate(parts, axis=1)
        kept = np.ones(len(time), bool)
        if self.kind == "counts":
            cam, output = (np.round(each / 360 * count) for each, count in zip((cam, output), COUNTS, strict=True))
        if self.kind == "drift":
            output = output + self.rng.uniform(-5, 5) / 3600 * time / time[-1]
        while self.kind == "lost rows" and kept.mean() > 0.75:
            gap = self.rng.integers(len(kept))
            kept[gap : gap + self.rng.integers(1, 7)] = False
        rows = zip(time[kept], cam[kept], output[kept], strict=True)
        return "time_s,cam_deg,output_deg\n" + "\n".join(f"{t:.5f},{a:.6f},{b:.8f}" for t, a, b in rows)


def counted(rig: Rig) -> Counter[str]:
    """Return the counts of a rig: determined quantities, quantities within their interval ("NAME held"), verdicts."""
    units = ",".join(map(str, COUNTS)) if rig.kind == "counts" else None
    form = TraceForm(angle="cam_deg", second="output_deg", angle_unit=units)
    drift = "linear" if rig.kind == "drift" else "none"
    try:
        trace = read_trace(io.StringIO(rig.file), form, RATIO)
        result = with_full_cycle(measure(trace, ratio=RATIO, drift=drift))
    except HdassistError:
        return Counter({"refused": 1})
    count: Counter[str] = Counter()
    for direction in result.directions:
        count += count_of_direction(direction, rig)
    if reversal := result.reversal:
        tolerance = 2 * reversal.lost_motion_standard_uncertainty_arcsec
        is_held = abs(reversal.lost_motion_arcsec - rig.play) <= tolerance
        count += Counter({"lost motion": 1, "lost motion held": is_held})
    if rig.kind in BOTH_WAYS and (lag := result.lag):
        true_ms = rig.lag - rig.rubs / PER_MS  # friction has the same effect as a lag
        is_held = abs(lag.ms - true_ms) <= 2 * lag.uncertainty_ms
        count += Counter({"lag": 1, "lag held": is_held})
    return count


def count_of_direction(direction: SweepResult, rig: Rig) -> Counter[str]:
    """Return the counts of one direction of a measurement of a rig."""
    low, high = direction.interval_arcsec
    order = next(order for order in direction.orders_of_cam if order.per_cam_rev == 2)
    is_order_held = abs(order.amplitude_arcsec - rig.order_2) <= 2 * order.uncertainty_arcsec
    reach = GUARD * direction.range.uncertainty
    at_least = direction.range.value - reach
    at_most = None if direction.is_bound else direction.range.value + direction.range.rise + reach
    if direction.by_model:
        at_least, at_most = direction.by_model.at_least_arcsec, direction.by_model.at_most_arcsec
    below, above = (share * rig.F_ior for share in LIMITS)
    return Counter(
        {
            "F'_ior": 1,
            "F'_ior held": low <= rig.F_ior <= high,
            "order 2": 1,
            "order 2 held": is_order_held,
            "lower bounds": direction.is_bound,
            "false PASS": at_most is not None and at_most <= below,
            "false FAIL": at_least > above,
        }
    )


def main() -> None:
    """Print a row of the table for each kind."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=int, default=40, help="number of rigs per kind")
    parser.add_argument("--first", type=int, default=0, help="number of the first rig")
    parser.add_argument("--kinds", default=",".join(KINDS), help="kinds, separated by commas")
    arguments = parser.parse_args()
    names = ("F'_ior", "order 2", "lost motion", "lag")
    print(f"| kind | {' | '.join(names)} | false PASS | false FAIL | lower bounds | refused |")
    for kind in arguments.kinds.split(","):
        count: Counter[str] = Counter()
        for seed in range(arguments.first, arguments.first + arguments.rigs):
            count += counted(Rig(kind, seed))
        cells = [f"{count[f'{name} held']} of {count[name]}" if count[name] else "" for name in names]
        cells += [str(count[name]) for name in ("false PASS", "false FAIL", "lower bounds", "refused")]
        print(f"| {kind} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
