"""Test of `measure` on rigs with a line between the orders: `python -m benchmarks.lines [--rigs 200] [--jobs 2]`.

Each group of simulated rigs gives a row: how often the 95 % interval of `measure` contains the true F'_ior, how often
the guard band rule passes a drive exactly at its limit, and the width of the interval. The error consists of invented
orders and sidebands (ratio 30 and 100), or is the solved cycle of a drive of the library. The amplitude of the line is
10 to 25 % of the range of the error. Its order is 6.48, 12.96, 13, 14.02 or random up to 20 per input revolution, at
least 0.3 from any order.

There are two true values: the range of the error without noise over the recorded angles ("recorded"), and the largest
range in any cycle, in which the phase of the line relative to the orders is free ("any cycle"). The latter is the range
of the orders plus twice the amplitude of the line.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from tests.helpers.rigs import drive_error, recorded, slow_noise

SMALL = str(Path(__file__).parents[1] / "tests/data/small.yaml")
OFF = (6.48, 12.96, 13.0, 14.02)
APART = 0.3  # smallest distance of a random line from the orders
SHARE = (0.10, 0.25)  # amplitude of a line over the range of the drive: smallest and largest
FINE = 480  # points per input revolution at which the true error is computed
SOLVED = {"small": (SMALL, ["numerics.n_max=20", "numerics.n_2=40"], 4.0, 30), "vzp160": ("vzp160", [], 80.0, 100)}


@dataclass(frozen=True)
class Group:
    """Parameters of a group of rigs.

    curve: "orders" for an invented error, or the name of a drive in SOLVED.
    cycle: input revolutions of the full cycle.
    cycles: number of recorded cycles.
    noise: standard deviation of the noise [arcsec].
    lines: number of lines between the orders.
    memory: correlation of the noise of adjacent readings.
    per_turn: readings per input revolution.
    """

    curve: str
    cycle: int
    cycles: float
    noise: float
    lines: int = 1
    memory: float = 0.0
    per_turn: int = 60

    @property
    def words(self) -> str:
        slow = f", memory {self.memory:g}" if self.memory else ""
        return f"{self.curve} {self.cycle}, {self.cycles:g} cycles, noise {self.noise:g}{slow}, {self.lines} lines"


GROUPS = (
    *(Group("orders", 30, 1, noise, lines) for lines in (0, 1) for noise in (0.3, 1.0, 2.0)),
    *(Group("orders", 30, cycles, 1.0) for cycles in (0.1, 0.3, 1.5, 2)),
    *(Group("orders", 30, 0.1, 1.0, 0), Group("orders", 30, 0.3, 1.0, 0), Group("orders", 30, 2, 1.0, 0)),
    *(Group("orders", 30, 1, 1.0, lines, 0.8) for lines in (0, 1)),
    Group("orders", 30, 1, 1.0, 2),
    *(Group("small", 30, 1, noise, lines) for lines in (0, 1) for noise in (0.3, 1.0)),
    *(Group("orders", 100, 1, 1.0, lines) for lines in (0, 1)),
    *(Group("vzp160", 100, 1, 1.0, lines) for lines in (0, 1)),
)


@cache
def solved(name: str) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function that interpolates the error of a drive over its full cycle [arcsec].

    name: name in SOLVED.
    """
    from hdassist import load_preset
    from hdassist.drive.error.cycle import kinematic_error
    from hdassist.run.run import UNCHECKED

    preset, overrides, M_g, turns = SOLVED[name]
    error = kinematic_error(load_preset(preset, overrides), M_g, run=UNCHECKED)
    x, y = error.states.phi_h / (2 * np.pi), error.error_arcsec
    sorting = np.argsort(np.mod(x, turns))
    x, y = np.mod(x, turns)[sorting], y[sorting]
    return lambda at: np.interp(np.mod(at, turns), x, y, period=turns)


@dataclass(frozen=True)
class Rig:
    """A rig with its recording.

    turns: input angles [rev].
    error: readings [arcsec].
    recorded: true range over the recorded angles [arcsec].
    any_cycle: largest true range in any cycle [arcsec].
    """

    turns: np.ndarray
    error: np.ndarray
    recorded: float
    any_cycle: float


def rig(group: Group, seed: int) -> Rig:
    """Return a rig of a group, given by its seed."""
    rng = np.random.default_rng([seed, group.cycle])
    made_up = group.curve == "orders"
    own = drive_error(rng, group.cycle, scale=rng.choice([1.5, 5.0])) if made_up else solved(group.curve)
    turns = np.arange(int(group.cycle * group.cycles * group.per_turn)) / group.per_turn
    fine = np.arange(int(group.cycle * group.cycles * FINE)) / FINE
    whole = float(np.ptp(own(np.arange(group.cycle * FINE) / FINE)))
    error, true, any_cycle = own(turns), own(fine), whole
    for _ in range(group.lines):
        order = rng.choice(OFF) if rng.random() < 0.6 else rng.integers(0, 20) + rng.uniform(APART, 1 - APART)
        size, phase = rng.uniform(*SHARE) * whole, rng.uniform(0, 2 * np.pi)
        error = error + size * np.cos(2 * np.pi * order * turns + phase)
        true = true + size * np.cos(2 * np.pi * order * fine + phase)
        any_cycle += 2 * size
    noise = rng.standard_normal(len(turns)) if not group.memory else slow_noise(rng, len(turns), 1.0, group.memory)
    return Rig(turns, error + group.noise * noise, float(np.ptp(true)), any_cycle)


def look(task: tuple[Group, int]) -> tuple[float, ...] | None:
    """Return the results of a rig; None if `measure` refuses the recording.

    They are the true range over the recorded angles and in any cycle, F'_ior, both ends of its interval [arcsec],
    whether a limit at each true range passes, whether a limit at the first one fails, and the number of found lines.

    task: group and seed of the rig.
    """
    from hdassist.features.acceptance.decision import AcceptedValue, decide
    from hdassist.features.acceptance.limits import Limit
    from hdassist.features.measuring.measure import measure
    from hdassist.features.measuring.orders import STATED
    from hdassist.run.errors import HdassistError

    group, seed = task
    made = rig(group, seed)
    try:
        (found,) = measure(
            recorded(made.turns, made.error), ratio=float(group.cycle), stated=dict.fromkeys(STATED, 0.0)
        ).directions
    except HdassistError:
        return None
    limits = [Limit("F_IOR", true) for true in (made.recorded, made.any_cycle)]
    verdicts = [decide(limit, AcceptedValue.measured(limit, found), "guard", 0.0).verdict for limit in limits]
    passes = [float(v == "PASS") for v in verdicts]
    low, high = found.interval_arcsec
    lines = len(found.lines)
    return (made.recorded, made.any_cycle, found.range.value, low, high, *passes, float(verdicts[0] == "FAIL"), lines)


def row(found: list[tuple[float, ...] | None]) -> dict[str, float]:
    """Return the shares of a group in per cent, and medians in per cent of the true value."""
    kept = np.array([one for one in found if one is not None])
    true, every, value, low, high, passes, passes_any, fails, lines = kept.T
    return {
        "rigs": len(kept),
        "held": 100 * float(np.mean((low <= true) & (true <= high))),
        "any held": 100 * float(np.mean((low <= every) & (every <= high))),
        "false PASS": 100 * float(passes.mean()),
        "any PASS": 100 * float(passes_any.mean()),
        "false FAIL": 100 * float(fails.mean()),
        "bias": 100 * float(np.median(value / true - 1)),
        "below": 100 * float(np.median((value - low) / true)),
        "above": 100 * float(np.median((high - value) / true)),
        "lines": float(lines.mean()),
    }


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--rigs", type=int, default=200, help="of a group")
    reader.add_argument("--jobs", type=int, default=os.cpu_count())
    reader.add_argument("--groups", default=",".join(map(str, range(len(GROUPS)))))
    options = reader.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with ProcessPoolExecutor(options.jobs) as executor:
        for group in (GROUPS[int(k)] for k in options.groups.split(",")):
            told = row(list(executor.map(look, [(group, seed) for seed in range(options.rigs)], chunksize=4)))
            print(f"{group.words:50}", "  ".join(f"{name} {value:.3g}" for name, value in told.items()), flush=True)


if __name__ == "__main__":
    main()
