"""Tests at positions on drives that no samples can represent: `python -m benchmarks.positions --n 300`.

Each hidden drive of benchmarks/honesty.py is solved over its full cycle. It is tested at the states nearest to the
positions, from a random angle, against a limit around its true F'_ior. For some drives, `plan` predicts from the preset
alone the share of F'_ior that twelve positions capture. The study counts how often the true share lies within the
predicted 5th and 95th percentile.

With `--accepted 40`, the file of a plan is filled in for this number of drives of one preset, with teeth that no
samples have, and decided as by `accept`. Wrong verdicts at limits around the true F'_ior are counted.
"""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.honesty import TEETH, drawn_values, hidden_drive, tooth_deviations

POSITIONS = (12, 24, 36, 72, 127, 211, 360)
RECORDS = (1, 10, 0)  # input revolutions of a recording; 0: one output revolution
NEAR = 0.2  # standard deviation of the logarithm of a limit around the true F'_ior
STARTS = 16  # random start angles of each test of a drive
PLANNED = 36  # positions of a plan that is carried out, twice from both sides
SCATTER, GRADUATION = 0.3, 1.0  # arcsec; rms scatter of readings, and amplitude of the encoder error


@dataclass(frozen=True)
class Tested:
    """Tests of a hidden drive.

    ratio: ratio of the drive.
    F_ior: true F'_ior [arcsec].
    limit: limit of F'_ior [arcsec].
    seen: share of F'_ior that each test captures, by name, shape (starts,).
    planned: predicted 5th and 95th percentile of the share at twelve positions, empty without a prediction.
    """

    ratio: float
    F_ior: float
    limit: float
    seen: dict[str, np.ndarray]
    planned: tuple[float, ...] = ()


def tested(number: int, seed: int, asked: int, draws: int) -> Tested:
    """Return the tests of a hidden drive.

    number: number of the drive.
    seed: seed of all drives.
    asked: number of the first drives for which a plan is computed.
    draws: effective sample size of a plan.
    """
    from hdassist.drive.error.cycle import kinematic_error
    from hdassist.drive.model.geometry import Kinematics
    from hdassist.features.planning import choose_plan
    from hdassist.run.errors import UntrustedError
    from hdassist.run.run import UNCHECKED, Run

    rng = np.random.default_rng([seed, number])
    preset, there, teeth = hidden_drive(rng)
    M_g = preset.operation.M_g[0]
    found = kinematic_error(there, M_g, teeth=teeth, run=UNCHECKED)
    error, F_ior, kinematics = found.error_arcsec, found.F_ior_arcsec, Kinematics.of(preset)
    turn = kinematics.teeth_fixed * abs(kinematics.u)  # states per output revolution
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
        with suppress(UntrustedError):  # too few samples agree with the catalogue
            planned = choose_plan(preset, draws=draws, run=Run(seed=number)).judged[0].seen[::2]
    return Tested(abs(kinematics.u), F_ior, F_ior * np.exp(NEAR * rng.standard_normal()), seen, planned)


def rows(drives: list[Tested]) -> Iterator[str]:
    """Yield the rows of a table: captured share for each test, and share of passed drives beyond their limit."""
    beyond = [each for each in drives if each.F_ior > each.limit]
    for name in drives[0].seen:
        low, middle, high = np.quantile(np.concatenate([each.seen[name] for each in drives]), (0.05, 0.5, 0.95))
        passed = np.mean([(each.seen[name] * each.F_ior <= each.limit).mean() for each in beyond] or np.nan)
        yield f"| {name} | {100 * low:.0f} | {100 * middle:.0f} | {100 * high:.0f} | {100 * passed:.0f} |"


def reading(error: np.ndarray, turn: float, start: int, phase: float, rng: np.random.Generator, target: float) -> float:
    """Return the reading of an encoder, actual minus target angle [arcsec].

    error: error of the drive over the cycle [arcsec].
    turn: number of states per output revolution.
    start: index of the state at angle 0.
    phase: phase of the encoder error [rad].
    rng: random generator of the scatter.
    target: target angle [deg].
    """
    off = -error[round(start + target / 360 * turn) % len(error)] + SCATTER * rng.standard_normal()
    return float(off + GRADUATION * np.cos(np.radians(3 * target) + phase))


def filled_in(file: str, off: Callable[[float], float]) -> str:
    """Return the file of a plan with the actual angle after the last comma of each row.

    off: function that returns the reading minus the target angle [arcsec].
    """
    rows = []
    for line in file.split("\n"):
        if line.endswith(",") and not line.startswith("#"):
            target = float(line.split(",")[1])
            line += f"{target + off(target) / 3600:.7f}"
        rows.append(line)
    return "\n".join(rows)


def accepted(number: int, draws: int, seed: int) -> Counter[str]:
    """Return the counts of verdicts of `accept`, by verdict and truth, on drives of one preset tested by a plan.

    number: number of drives.
    draws: effective sample size of the plan.
    seed: seed of the drives.
    """
    from hdassist.belief.prior import prior_of
    from hdassist.drive.error.cycle import kinematic_error
    from hdassist.drive.loading import load_preset, load_text, similar_preset
    from hdassist.drive.model.geometry import Kinematics
    from hdassist.drive.model.rules import first_conflict
    from hdassist.drive.preset.knowledge import read_requirements
    from hdassist.features.acceptance.decision import AcceptedValue, decide
    from hdassist.features.acceptance.limits import Limit
    from hdassist.features.measuring.bench import PositionRecord, bench_record, position_quantities, seen_range
    from hdassist.features.planning import ApproachRun, EncoderData, PlanDemands, ReadingPlan, choose_plan
    from hdassist.interface.pages.plan import approach_csv
    from hdassist.readers.table import read_numbers
    from hdassist.run.run import UNCHECKED, Run

    like = load_preset("vzp160")
    requirements = read_requirements(like, ratio=30.0, pitch_diameter="42 mm", torque="20")
    preset = load_text(similar_preset("own", like, requirements), "own.yaml")
    unsure = EncoderData(0.5, GRADUATION).uncertainty_arcsec(30)
    asked, how = ReadingPlan.positions(PLANNED, both=True), ApproachRun(repeats=2)
    choice = choose_plan(
        preset, asked, demands=PlanDemands(noise_arcsec=unsure), test=how, draws=draws, run=Run(seed=seed)
    )
    file, M_g, kinematics = approach_csv(choice), choice.M_g, Kinematics.of(preset)
    # the plan and one line per drive are printed at once, so a stopped run has shown its results
    print(f"{preset.name} at {M_g:g} N m sees {choice.test.judged.seen}", flush=True)
    verdicts: Counter[str] = Counter()
    for k in range(number):
        rng = np.random.default_rng([seed, k, 7])
        there = preset.with_values(drawn_values(prior_of(preset), rng, {}))
        while first_conflict(there) is not None:
            there = preset.with_values(drawn_values(prior_of(preset), rng, {}))
        found = kinematic_error(there, M_g, teeth=tooth_deviations(there, rng, *TEETH["rough"]), run=UNCHECKED)
        error, turn = found.error_arcsec, kinematics.teeth_fixed * abs(kinematics.u)  # turn: states per revolution
        off = partial(reading, error, turn, int(rng.integers(len(error))), rng.uniform(0, 2 * np.pi), rng)
        record = bench_record(read_numbers(filled_in(file, off).encode()))
        assert isinstance(record, PositionRecord)
        seen = seen_range(record, position_quantities(record))
        assert seen is not None
        value = AcceptedValue.at_positions(seen, ())
        limit = float(found.F_ior_arcsec * np.exp(NEAR * rng.standard_normal()))
        decided = decide(Limit(code="F_IOR", limit=limit, M_g_Nm=M_g), value, "guard", 0.95)
        is_good = "within" if found.F_ior_arcsec <= limit else "beyond"
        verdicts[f"{decided.verdict.value} {is_good}"] += 1
        print(f"{k}: {found.F_ior_arcsec:.1f}, limit {limit:.1f}, {value.value:.1f} to {value.at_most:.1f}, "
              f"{decided.verdict.value}", flush=True)  # fmt: skip
    return verdicts


def main() -> None:
    """Test drives, and print the share that each test captures and the share of drives that it passes wrongly."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=300, help="hidden drives")
    parser.add_argument("--planned", type=int, default=0, help="of them, those that the plan is asked about")
    parser.add_argument("--draws", type=int, default=32, help="effective samples of a plan")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--accepted", type=int, default=0, help="drives that are accepted by the file of a plan")
    args = parser.parse_args()
    if args.accepted:
        print(dict(accepted(args.accepted, args.draws, args.seed)))  # counts for docs/plan.md
        return
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
