"""Tests at positions held to account on drives that no belief can represent: `python -m benchmarks.positions --n 300`.

Each hidden drive of benchmarks/honesty.py is solved over its full cycle and tested at positions, at the states nearest
to them, from a random angle, against a limit around its true F'_ior. Of some of them the plan is asked beforehand, with
no more known than their preset, whether the share that twelve positions then see lies within its 5 to 95 %.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.honesty import hidden_drive

POSITIONS = (12, 24, 36, 72, 127, 211, 360)
RECORDS = (1, 10, 0)  # cam turns; 0: an output turn
NEAR = 0.2  # standard deviation of the logarithm of a limit around the true F'_ior
STARTS = 16  # of each test of a drive


@dataclass(frozen=True)
class Tested:
    """A hidden drive: ratio, true F'_ior and limit [arcsec], share that each test sees from each start, by its name.

    planned: 5 and 95 % of the share at twelve positions as the plan had them, empty where it was not asked.
    """

    ratio: float
    F_ior: float
    limit: float
    seen: dict[str, np.ndarray]
    planned: tuple[float, ...] = ()


def tested(number: int, seed: int, asked: int, draws: int) -> Tested:
    """The tests of a hidden drive, by its number; of the first so many asked the plan too."""
    from hdassist.error.cycle import kinematic_error
    from hdassist.errors import UntrustedError
    from hdassist.model.kinematics import Kinematics
    from hdassist.planning import choose_plan
    from hdassist.run.run import UNCHECKED, Run

    rng = np.random.default_rng([seed, number])
    preset, there, teeth = hidden_drive(rng)
    M_g = preset.operation.M_g[0]
    found = kinematic_error(there, M_g, teeth=teeth, run=UNCHECKED)
    error, F_ior, kinematics = found.error_arcsec, found.F_ior_arcsec, Kinematics.of(preset)
    turn = kinematics.teeth_fixed * abs(kinematics.u)  # states in an output turn
    tests = {f"{N} positions": np.arange(N) * turn / N for N in POSITIONS}
    tests |= {
        f"record of {f'{turns} cam turns' if turns else 'an output turn'}": np.arange(
            (turns or abs(kinematics.u)) * kinematics.teeth_fixed
        )
        for turns in RECORDS
    }
    starts = rng.integers(len(error), size=(STARTS, 1))
    seen = {
        name: np.ptp(error[np.rint(starts + steps).astype(int) % len(error)], axis=1) / F_ior
        for name, steps in tests.items()
    }
    planned: tuple[float, ...] = ()
    if number < asked:
        with suppress(UntrustedError):  # too few draws agree with the catalogue
            planned = choose_plan(preset, draws=draws, run=Run(seed=number)).judged[0].seen[::2]
    return Tested(abs(kinematics.u), F_ior, F_ior * np.exp(NEAR * rng.standard_normal()), seen, planned)


def rows(drives: list[Tested]) -> Iterator[str]:
    """Rows of a table: share seen by each test, and how many drives that are beyond their limit it passes."""
    beyond = [each for each in drives if each.F_ior > each.limit]
    for name in drives[0].seen:
        low, middle, high = np.quantile(np.concatenate([each.seen[name] for each in drives]), (0.05, 0.5, 0.95))
        passed = np.mean([(each.seen[name] * each.F_ior <= each.limit).mean() for each in beyond] or np.nan)
        yield f"| {name} | {100 * low:.0f} | {100 * middle:.0f} | {100 * high:.0f} | {100 * passed:.0f} |"


def main() -> None:
    """Test drives, and print what each test sees and passes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=300, help="hidden drives")
    parser.add_argument("--planned", type=int, default=0, help="of them, those that the plan is asked about")
    parser.add_argument("--draws", type=int, default=32, help="effective samples of a plan")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    args = parser.parse_args()
    one = partial(tested, seed=args.seed, asked=args.planned, draws=args.draws)
    with ProcessPoolExecutor(args.jobs) as pool:
        drives = list(pool.map(one, range(args.n)))
    print(f"{len(drives)} drives, {sum(each.F_ior > each.limit for each in drives)} beyond their limit")
    print("| test | sees, 5 % | 50 % | 95 % | of those beyond passed, % |\n| --- | --- | --- | --- | --- |")
    print(*rows(drives), sep="\n")
    for ratio in sorted({each.ratio for each in drives}):
        group = [each for each in drives if each.ratio == ratio]
        print(f"ratio {ratio:g}, {len(group)} drives:", next(rows(group)))
    asked = [each for each in drives if each.planned]
    for each in asked:
        share = each.seen["12 positions"]
        print(
            f"planned {each.planned[0]:.2f} to {each.planned[1]:.2f}: {np.quantile(share, (0.05, 0.5, 0.95)).round(2)}"
        )
    if asked:
        inside = [
            ((low <= each.seen["12 positions"]) & (each.seen["12 positions"] <= high)).mean()
            for each in asked
            for low, high in [each.planned]
        ]
        print(f"of {len(asked)} plans, 5 to 95 % hold {100 * np.mean(inside):.0f} % of the shares seen")


if __name__ == "__main__":
    main()
