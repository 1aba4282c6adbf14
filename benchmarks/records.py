"""How often intervals of `measure` contain orders and F'_ior of simulated rigs: `python -m benchmarks.records`.

Each rig has an unknown drive, two eccentric encoders that count steps, gravity, a motor that turns unevenly, lost rows
and glitches, both directions with backlash, and late readings of the output. It writes a file, which `hdassist measure`
reads. The rig is made from angles sampled in time, without the orders, bins or fits of the tool. F'_ior is that of each
direction on the page of `measure`. A rig takes 2 to 6 s.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np

from hdassist.drive.model.geometry import Array
from hdassist.features.measuring.full_cycle import with_full_cycle
from hdassist.features.measuring.measure import Measurement, measure
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.run.errors import HdassistError

RATIO, ROWS = 30, 60  # input revolutions per output revolution, rows per input revolution
CAM_COUNTS, OUTPUT_COUNTS = 16384, 4194304
FORM = TraceForm(angle="cam", second="output", angle_unit=f"{CAM_COUNTS},{OUTPUT_COUNTS}", robust=True)
ORDERS, TOLD_ORDERS = range(1, 7), range(1, 5)
FINE = 240  # points per input revolution of the true curve


@dataclass(frozen=True)
class Truth:
    """True values of a recording.

    cycle: range of the error over the cycle [arcsec].
    cam: range of the orders of the input alone over the recorded part [arcsec].
    orders: amplitudes of these orders over the cycle [arcsec], by order.
    recorded_orders: amplitudes of these orders over the recorded part [arcsec], by order.
    lag_ms: lag of the output encoder [ms].
    """

    cycle: float
    cam: float
    orders: dict[int, float]
    recorded_orders: dict[int, float]
    lag_ms: float


class Bench:
    """A drive on a test rig.

    seed: seed of all unknown values.
    turns: recorded input revolutions in each direction.
    is_clean: whether no rows are lost or misread.
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
        """Return the error [arcsec] of the orders of the input in the recording, with sidebands.

        phi: input angles [rad].
        """
        theta, p, share = phi / RATIO, self.phase, self.share
        oval = np.cos(2 * phi + p[0]) * (1 + 0.5 * share[0] * np.cos(theta + p[1]) + 0.2 * share[1] * np.cos(2 * theta))
        bump = share[2] * np.exp(2 * np.cos(phi + p[2]) - 2)  # once per revolution, with all its harmonics
        off_centre = 0.3 * share[3] * np.sin(phi + p[3]) * (1 + 0.5 * np.cos(theta + p[4]))
        teeth = 0.2 * share[4] * np.cos(4 * phi + p[5] + 0.5 * np.sin(theta))
        bump -= share[2] * 0.308508  # mean of the bump: e^-2 I_0(2)
        return np.asarray(self.size * (oval + bump + off_centre + teeth) - self.cam_encoder(phi) / RATIO)

    def cam_encoder(self, phi: Array) -> Array:
        """Return the error [arcsec] of the eccentric input encoder at input angles [rad]."""
        return np.asarray(2 * RATIO * np.sin(phi + self.phase[6]))

    def slow_error(self, phi: Array) -> Array:
        """Return the slow error [arcsec] of the output at input angles [rad].

        It comes from the drive, gravity, and the graduation and eccentricity of the output encoder.
        """
        theta, p = phi / RATIO, self.phase
        return np.asarray(
            self.size * self.share[5] * np.cos(theta + p[7]) + 15 * self.share[6] * np.cos(theta + p[8])
            + 6 * self.share[7] * np.sin(2 * theta + p[9]) + 1.5 * np.cos(3 * theta + p[10])
        )  # fmt: skip

    def file(self) -> bytes:
        """Return the file that the rig writes."""
        rng = self.rng
        count = round(self.turns * ROWS)
        speed = 1 + 0.15 * np.sin(np.arange(count) / ROWS * 0.9 + self.phase[11])
        # the noise is smoothed, because the speed of a shaft cannot jump
        speed += np.convolve(0.1 * rng.standard_normal(count), np.ones(20) / 20, "same")
        one_way = np.cumsum(speed) / ROWS
        scale = self.turns / one_way[-1]
        turns = np.concatenate([one_way, one_way[::-1]]) * scale
        speed = np.concatenate([speed, -speed[::-1]]) * scale
        time = np.arange(2 * count) / ROWS  # about one input revolution per second
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
        kept[2 * count - gap : 2 * count - gap + ROWS] = False  # gap of one input revolution
        kept |= self.is_clean
        rows = zip(time[kept], cam_counts[kept], out_counts[kept], strict=True)
        text = [f"{t:.6f};{a:.0f};{b:.0f}" for t, a, b in rows]
        for row in [] if self.is_clean else rng.integers(50, len(text), 3):
            text[row] = "---"
        return "\n".join(["t;cam;output", *text]).encode()

    def truth(self) -> Truth:
        """Return the ranges without noise, and the amplitudes over the cycle and over the recorded part."""
        whole = 2 * np.pi * np.arange(RATIO * FINE) / FINE
        phi = whole[: round(self.turns * FINE)]
        spectrum, orders = np.fft.rfft(self.cam_error(whole)), np.arange(RATIO * FINE // 2 + 1) / RATIO
        amplitudes, recorded_amplitudes = {}, {}
        for order in TOLD_ORDERS:
            band = np.fft.irfft(np.where(np.abs(orders - order) < 0.5, spectrum, 0))
            amplitudes[order] = float(np.sqrt(2 * np.mean(band**2)))
            recorded_amplitudes[order] = float(np.sqrt(2 * np.mean(band[: len(phi)] ** 2)))
        error = self.cam_error(whole) + self.slow_error(whole)
        return Truth(
            cycle=float(np.ptp(error)),
            cam=float(np.ptp(self.cam_error(phi))),
            orders=amplitudes,
            recorded_orders=recorded_amplitudes,
            lag_ms=1e3 * self.lag,
        )


@dataclass
class Held:
    """Number of true values within their intervals, and number of all values, by quantity."""

    count: dict[str, list[int]]

    def add(self, quantity: str, *, held: bool) -> None:
        """Count a value; held: whether its interval contains the true value."""
        numbers = self.count.setdefault(quantity, [0, 0])
        numbers[0] += held
        numbers[1] += 1


def look(seed: int, turns: float, held: Held) -> Measurement:
    """Measure the file of a rig, and count the true values within their intervals."""
    bench = Bench(seed, turns)
    result = with_full_cycle(measure(read_trace(bench.file(), FORM, RATIO), ratio=RATIO, orders=ORDERS))
    truth = bench.truth()
    for direction in result.directions:
        if direction.by_model or not direction.is_part:
            low, high = direction.interval_arcsec
            held.add("F'_ior", held=low <= truth.cycle <= high)
    greatest = result.directions[0]
    low, high = greatest.cam.interval
    held.add("range of the orders of the input", held=low <= truth.cam <= high)
    for order in greatest.orders_of_cam:
        amplitudes = truth.recorded_orders if order.is_of_record else truth.orders
        amplitude = amplitudes.get(round(order.per_cam_rev))
        if amplitude is not None:
            is_held = abs(order.amplitude_arcsec - amplitude) <= 2 * order.uncertainty_arcsec
            held.add("orders", held=is_held)
    if result.lag and result.lag.ms is not None and result.lag.uncertainty_ms is not None:
        held.add("lag", held=abs(result.lag.ms - truth.lag_ms) <= 2 * result.lag.uncertainty_ms)
    return result


def main() -> None:
    """Print how many intervals contain the true value, for recordings of the whole and of a part of the cycle."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=int, default=60, help="number of rigs")
    parser.add_argument("--shares", default="1,0.6", help="recorded shares of the cycle, separated by commas")
    arguments = parser.parse_args()
    for share in map(float, arguments.shares.split(",")):
        held = Held({})
        for seed in range(arguments.rigs):
            try:
                look(seed, share * RATIO, held)
            except HdassistError as refused:
                held.add(f"answered ({refused})"[:90], held=False)
        print(f"{share * RATIO:g} of {RATIO} input revolutions")
        for quantity, (hits, count) in held.count.items():
            print(f"  {quantity}: {hits} of {count}, {100 * hits / count:.1f} %", flush=True)


if __name__ == "__main__":
    main()
