"""How often orders and F'_ior of records of simulated benches are held: `python -m benchmarks.records [RIGS]`.

Each bench has a drive that nobody knows, two encoders off their centres and in counts, gravity, a motor that is not
even, rows lost and glitches, both ways with play, the output read late. It writes a file, and `hdassist measure` reads
it. The bench is made of angles alone, sampled in time: it has none of the orders, bins or fits of the tool.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from hdassist.errors import HdassistError
from hdassist.measuring.measure import Measurement, measure
from hdassist.model.geometry import Array
from hdassist.readers.trace import TraceForm, read_trace

RATIO, ROWS = 30, 60  # cam turns per output turn, rows a cam turn
CAM_COUNTS, OUTPUT_COUNTS = 16384, 4194304
FORM = TraceForm(angle="cam", second="output", angle_unit=f"{CAM_COUNTS},{OUTPUT_COUNTS}", robust=True)
ORDERS, TOLD_ORDERS = range(1, 7), range(1, 5)
FINE = 240  # angles a cam turn of the true curve


@dataclass(frozen=True)
class Truth:
    """Ranges [arcsec] of the record and of its orders of the cam alone, and amplitudes of these over the cycle."""

    whole: float
    cam: float
    orders: dict[int, float]
    lag_ms: float


class Bench:
    """A drive on a bench; seed: of all that is not known; turns: of the cam that are recorded, one way and back.

    is_clean: without rows that are lost or misread.
    """

    def __init__(self, seed: int, turns: float, *, is_clean: bool = False) -> None:
        self.is_clean = is_clean
        self.rng = rng = np.random.default_rng([seed, round(turns)])
        self.turns = turns
        self.size = rng.uniform(2, 12)
        self.phase = rng.uniform(0, 2 * np.pi, 12)
        self.share = rng.uniform(0, 1, 8)
        self.lag = rng.uniform(-2e-3, 2e-3)
        self.play = rng.uniform(0, 20)

    def cam_error(self, phi: Array) -> Array:
        """Error [arcsec] of the orders of the cam in the record, at cam angles [rad]; it goes with the output too."""
        theta, p, share = phi / RATIO, self.phase, self.share
        oval = np.cos(2 * phi + p[0]) * (1 + 0.5 * share[0] * np.cos(theta + p[1]) + 0.2 * share[1] * np.cos(2 * theta))
        bump = share[2] * np.exp(2 * np.cos(phi + p[2]) - 2)  # once a turn, and all that is in it
        off_centre = 0.3 * share[3] * np.sin(phi + p[3]) * (1 + 0.5 * np.cos(theta + p[4]))
        teeth = 0.2 * share[4] * np.cos(4 * phi + p[5] + 0.5 * np.sin(theta))
        bump -= share[2] * 0.308508  # its mean: e^-2 I_0(2)
        return np.asarray(self.size * (oval + bump + off_centre + teeth) - self.cam_encoder(phi) / RATIO)

    def cam_encoder(self, phi: Array) -> Array:
        """Error [arcsec] of the cam's encoder, off its centre."""
        return np.asarray(2 * RATIO * np.sin(phi + self.phase[6]))

    def slow_error(self, phi: Array) -> Array:
        """Error [arcsec] of the output alone: the drive, gravity, graduation, the encoder off its centre."""
        theta, p = phi / RATIO, self.phase
        return np.asarray(
            self.size * self.share[5] * np.cos(theta + p[7]) + 15 * self.share[6] * np.cos(theta + p[8])
            + 6 * self.share[7] * np.sin(2 * theta + p[9]) + 1.5 * np.cos(3 * theta + p[10])
        )  # fmt: skip

    def file(self) -> bytes:
        """The file of the bench."""
        rng = self.rng
        count = round(self.turns * ROWS)
        speed = 1 + 0.15 * np.sin(np.arange(count) / ROWS * 0.9 + self.phase[11])
        speed += np.convolve(0.1 * rng.standard_normal(count), np.ones(20) / 20, "same")  # no shaft leaps
        one_way = np.cumsum(speed) / ROWS
        scale = self.turns / one_way[-1]
        turns = np.concatenate([one_way, one_way[::-1]]) * scale
        speed = np.concatenate([speed, -speed[::-1]]) * scale
        time = np.arange(2 * count) / ROWS  # a turn of the cam in about a second
        phi, later = 2 * np.pi * turns, 2 * np.pi * (turns + speed * self.lag)
        way = np.where(np.arange(2 * count) < count, 0.5, -0.5)
        cam = turns * 1296000 + self.cam_encoder(phi)
        output = later * (648000 / np.pi / RATIO) + self.cam_error(later) + self.cam_encoder(later) / RATIO
        output += self.slow_error(later) + self.play * way + 0.6 * rng.standard_normal(2 * count)
        cam_counts = np.mod(np.round(cam / 1296000 * CAM_COUNTS) + 1234, CAM_COUNTS)
        out_counts = np.mod(np.round(output / 1296000 * OUTPUT_COUNTS) + OUTPUT_COUNTS - 99, OUTPUT_COUNTS)
        glitch = rng.random(2 * count) < (0.0 if self.is_clean else 0.004)
        out_counts[glitch] = np.mod(out_counts[glitch] + rng.integers(300, 3000, glitch.sum()), OUTPUT_COUNTS)
        kept = rng.random(2 * count) > 0.25
        gap = round(rng.uniform(0.1, 0.8) * count)
        kept[gap : gap + ROWS // 4] = False
        kept[2 * count - gap : 2 * count - gap + ROWS] = False  # a turn of the cam
        kept |= self.is_clean
        rows = zip(time[kept], cam_counts[kept], out_counts[kept], strict=True)
        text = [f"{t:.6f};{a:.0f};{b:.0f}" for t, a, b in rows]
        for row in [] if self.is_clean else rng.integers(50, len(text), 3):
            text[row] = "---"
        return "\n".join(["t;cam;output", *text]).encode()

    def truth(self) -> Truth:
        """A record without noise: its ranges, and amplitudes over the cycle."""
        whole = 2 * np.pi * np.arange(RATIO * FINE) / FINE
        phi = whole[: round(self.turns * FINE)]
        spectrum, orders = np.fft.rfft(self.cam_error(whole)), np.arange(RATIO * FINE // 2 + 1) / RATIO
        amplitudes = {}
        for order in TOLD_ORDERS:
            band = np.fft.irfft(np.where(np.abs(orders - order) < 0.5, spectrum, 0))
            amplitudes[order] = float(np.sqrt(2 * np.mean(band**2)))
        cam = self.cam_error(phi)
        return Truth(float(np.ptp(cam + self.slow_error(phi))), float(np.ptp(cam)), amplitudes, 1e3 * self.lag)


@dataclass
class Held:
    """How many of so many were held, by quantity."""

    count: dict[str, list[int]]

    def add(self, quantity: str, *, held: bool) -> None:
        """Count one more."""
        numbers = self.count.setdefault(quantity, [0, 0])
        numbers[0] += held
        numbers[1] += 1


def look(seed: int, turns: float, held: Held) -> Measurement:
    """Read the file of a bench, and count what was held."""
    bench = Bench(seed, turns)
    result = measure(read_trace(bench.file(), FORM, RATIO), ratio=RATIO, orders=ORDERS)
    found = result.directions[0]
    truth = bench.truth()
    if not found.is_part:
        low, high = found.interval_arcsec
        held.add("F'_ior", held=low <= truth.whole <= high)
    low, high = found.cam.interval
    held.add("range of the cam's orders", held=low <= truth.cam <= high)
    for order in found.orders_of_cam:
        if (true := truth.orders.get(round(order.per_cam_rev))) is not None:
            held.add("orders", held=abs(order.amplitude_arcsec - true) <= 2 * order.uncertainty_arcsec)
    if result.lag and result.lag.ms is not None and result.lag.uncertainty_ms is not None:
        held.add("lag", held=abs(result.lag.ms - truth.lag_ms) <= 2 * result.lag.uncertainty_ms)
    return result


def main(rigs: int) -> None:
    for turns in (RATIO, 0.6 * RATIO):
        held = Held({})
        for seed in range(rigs):
            try:
                look(seed, turns, held)
            except HdassistError as refused:
                held.add(f"answered ({refused})"[:90], held=False)
        print(f"{turns:g} of {RATIO} turns of the cam")
        for quantity, (hits, count) in held.count.items():
            print(f"  {quantity}: {hits} of {count}, {100 * hits / count:.1f} %", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 250)
