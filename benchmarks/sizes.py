"""Prior sizes of the waves of a recording, from solved drives: `python -m benchmarks.sizes --drives 80 --write`.

Each hidden drive of benchmarks/honesty.py is solved over its full cycle, half of the drives at the smallest and half at
the largest torque of the preset. The Fourier transform over the cycle gives the amplitude of each wave (k, j), with k
periods per input revolution and j per output revolution. They give the profiles of hdassist/recording/sizes.toml:

- order: size of order k with its sidebands over the rms of the error;
- sideband: size of the pair (k, +-j) over the size of its order, for orders with more than 5 % of the error;
- other_wheel: size of the pair (k, +-k) over the size of its order;
- beside_other_wheel: size of the pairs (k, +-k +- 1) of even orders over the size of the order, beyond the usual
  sidebands, and for the one of the two signs of k that the waves of the other wheel have;
- output: size of (0, j) over the size of all waves of the output;
- rest: rms of the waves that the model omits over the rms of its waves from order 12 on, and their contribution to the
  range over their rms, by the highest order of the model. The logarithm of the first value, and the second value, are
  straight lines over the logarithm of the ratio, with a standard deviation about the line.

Sizes are rms values over the drives, so waves of few drives count too. A size below the floor counts as the floor. Two
sizes are cautious assumptions, because they decide whether a part of the cycle can pass. The first number of `order` is
not computed from these drives, because slow waves of a recording also come from encoders, couplings and gravity. The
sizes of sidebands are doubled, because other drives and rigs may have larger sidebands.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np

from benchmarks.honesty import hidden_drive
from hdassist.drive.model.geometry import Array
from hdassist.recording.waves import USUAL_SIDEBANDS, wave_pairs

FLOOR = 0.02  # smallest size in a profile
CLEAR = 0.05  # smallest size of an order whose sidebands count, over the rms of the error
SLOW = 1.5  # assumed size of order 0 over the rms of the readings
CAUTION = 2.0  # factor for the sizes of sidebands
ORDERS, SIDEBANDS = 81, 7  # lengths of the profiles
FINE_ORDER = 12  # lowest order of the waves that show the roughness of the teeth
HIGHEST_ORDERS = (16, 24, 36)  # highest odd orders of the model for which the rest is tabulated
LEAST_RATIO, USUAL_RATIO = 50, 80  # smallest ratio of the solved drives; ratio of the tabulated rest
POINTS_PER_PERIOD = 2.2  # blocks per period of the highest order, as in recording/waves.py
TABLE = Path(__file__).parent.parent / "hdassist" / "recording" / "sizes.toml"
HEAD = """# Prior sizes of the waves of a recording (R6), written by `python -m benchmarks.sizes --write`.
# rms over {drives} solved drives of ratios 50 to 120; order[0] and a factor of 2 of the
# sidebands are cautious assumptions (see benchmarks/sizes.py).
"""


def solved_cycle(number: int, seed: int) -> tuple[int, Array]:
    """Return the ratio of a hidden drive, and its error over the full cycle [arcsec], shape (states,)."""
    from hdassist.drive.error.cycle import kinematic_error
    from hdassist.drive.model.geometry import Kinematics
    from hdassist.run.run import UNCHECKED

    rng = np.random.default_rng([seed, number])
    preset, there, teeth = hidden_drive(rng)
    torques = preset.operation.M_g
    M_g = torques[0] if number % 2 == 0 else torques[-1]
    error = kinematic_error(there, M_g, teeth=teeth, run=UNCHECKED).error_arcsec
    return round(abs(Kinematics.of(preset).u)), error - error.mean()


def wave_sizes(ratio: int, error: Array) -> dict[tuple[int, int], float]:
    """Return the amplitude of each wave (k, j) of an error over a cycle [arcsec]."""
    amplitudes = 2 * np.abs(np.fft.rfft(error)) / len(error)
    sizes: dict[tuple[int, int], float] = {}
    for periods in range(1, len(amplitudes)):
        order = round(periods / ratio)
        sizes[order, periods - order * ratio] = float(amplitudes[periods])
    return sizes


def rms(values: Sequence[float]) -> float:
    """Return the root mean square of values, at least the floor."""
    return max(FLOOR, float(np.sqrt(np.mean(np.square(values))))) if len(values) else FLOOR


def profiles(cycles: Sequence[tuple[int, Array]]) -> dict[str, list[float]]:
    """Return the profiles of sizes.toml, by name; cycles: ratio and error over the cycle [arcsec] of each drive."""
    order: list[list[float]] = [[] for _ in range(ORDERS)]
    sideband: list[list[float]] = [[] for _ in range(SIDEBANDS)]
    output: list[list[float]] = [[] for _ in range(SIDEBANDS)]
    other_wheel = list[float]()
    beside_other_wheel = list[float]()
    for ratio, error in cycles:
        sizes = wave_sizes(ratio, error)
        total = float(np.std(error)) * np.sqrt(2)
        for k in range(min(ORDERS, ratio)):
            own = {j: size for (number, j), size in sizes.items() if number == k}
            together = float(np.sqrt(sum(size**2 for size in own.values())))
            order[k].append(together / total)
            if together < CLEAR * total:
                continue
            if k == 0:
                for j in range(1, SIDEBANDS + 1):
                    output[j - 1].append(own[j] / together)
                continue
            for j in range(1, SIDEBANDS + 1):
                if j != k:
                    sideband[j - 1] += [own[j] / together, own[-j] / together]
            if 2 * k < ratio:
                other_wheel += [own[k] / together, own[-k] / together]
            if k % 2 == 0 and 2 * k + 2 < ratio:
                beside = [j for j in (k - 1, k + 1) if j > USUAL_SIDEBANDS]
                sign = 1 if own[k] > own[-k] else -1
                beside_other_wheel += [own[sign * j] / together for j in beside]
    return {
        "order": [SLOW, *(rms(each) for each in order[1:])],
        "sideband": [CAUTION * rms(each) for each in sideband],
        "other_wheel": [rms(other_wheel)],
        "beside_other_wheel": [CAUTION * rms(beside_other_wheel)],
        "output": [rms(each) for each in output],
    }


def rests(cycles: Sequence[tuple[int, Array]]) -> dict[str, list[float]]:
    """Return the columns of the table `rest` in sizes.toml, with one row for each highest order of the model."""
    names = ("size", "size_exponent", "size_log_sigma", "added", "added_slope", "added_sigma")
    table: dict[str, list[float]] = {name: [] for name in names}
    larger = np.array([np.log(ratio / USUAL_RATIO) for ratio, _ in cycles])
    for highest in HIGHEST_ORDERS:
        log_sizes, added = np.array([_rest_of(ratio, error, highest) for ratio, error in cycles]).T
        exponent, log_size = np.polyfit(larger, log_sizes, 1).tolist()
        slope, usual = np.polyfit(larger, added, 1).tolist()
        spreads = (
            float(np.std(values - line, ddof=2))
            for values, line in (
                (log_sizes, log_size + exponent * larger),
                (added, usual + slope * larger),
            )
        )
        log_sigma, added_sigma = spreads
        row = (float(np.exp(log_size)), exponent, log_sigma, usual, slope, added_sigma)
        for name, value in zip(names, row, strict=True):
            table[name].append(value)
    return table


def _rest_of(ratio: int, error: Array, highest: int) -> tuple[float, float]:
    """Return the size of the waves that a model omits, and their contribution to the range.

    The first value is the logarithm of their rms over the rms of the fine waves of the model. The second value is the
    increase of the range over their rms.

    highest: highest order of the model.
    """
    spectrum = np.fft.rfft(error)
    amplitudes = 2 * np.abs(spectrum) / len(error)
    fine = 0.0
    for k, j in wave_pairs(Fraction(ratio), POINTS_PER_PERIOD * highest + 0.1).tolist():
        if k * ratio + j >= len(spectrum):
            continue
        spectrum[k * ratio + j] = 0.0
        fine += amplitudes[k * ratio + j] ** 2 / 2 if k >= FINE_ORDER else 0.0
    left = np.fft.irfft(spectrum, len(error))
    added = float((np.ptp(error) - np.ptp(error - left)) / left.std())
    return float(np.log(left.std() / np.sqrt(fine))), added


def toml_line(name: str, sizes: Sequence[float]) -> str:
    """Return a line of a TOML file."""
    return f"{name} = [{', '.join(f'{size:.3g}' for size in sizes)}]\n"


def main() -> None:
    """Print the profiles, and write them with --write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drives", type=int, default=80, help="number of solved drives")
    parser.add_argument("--seed", type=int, default=1000, help="seed of the drives")
    parser.add_argument("--write", action="store_true", help="write hdassist/recording/sizes.toml")
    arguments = parser.parse_args()
    cycles = [solved_cycle(number, arguments.seed) for number in range(arguments.drives)]
    text = HEAD.format(drives=arguments.drives)
    for name, sizes in profiles(cycles).items():
        text += toml_line(name, sizes)
    text += f"\n[rest]\nfine_order = {FINE_ORDER}\nleast_ratio = {LEAST_RATIO}\nusual_ratio = {USUAL_RATIO}\n"
    text += toml_line("highest_order", HIGHEST_ORDERS)
    for name, sizes in rests(cycles).items():
        text += toml_line(name, sizes)
    print(text)
    if arguments.write:
        TABLE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
