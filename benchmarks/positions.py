"""Tests at positions held to account on drives that no belief can represent: `python -m benchmarks.positions --n 300`.

Each hidden drive of benchmarks/honesty.py is solved over its full cycle and tested at positions, at the states nearest
to them, from a random angle, against a limit around its true F'_ior. Of some of them the plan is asked beforehand, with
no more known than their preset, whether the share that twelve positions then see lies within its 5 to 95 %.

`--accepted 40`: the file of a plan is filled in for so many drives of one preset, whose teeth no belief has, and given
to the decision of `accept`; verdicts at limits around the true F'_ior that are wrong are counted.
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

from benchmarks.honesty import drawn_values, hidden_drive, rough_teeth

POSITIONS = (12, 24, 36, 72, 127, 211, 360)
RECORDS = (1, 10, 0)  # cam turns; 0: an output turn
NEAR = 0.2  # standard deviation of the logarithm of a limit around the true F'_ior
STARTS = 16  # of each test of a drive
PLANNED = 36  # positions of a plan that is carried out, both ways, twice
SCATTER, GRADUATION = 0.3, 1.0  # arcsec, of its readings: rms, and amplitude of the encoder's waves


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
    from hdassist.model.geometry import Kinematics
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


def reading(error: np.ndarray, turn: float, start: int, phase: float, rng: np.random.Generator, target: float) -> float:
    """What an encoder reads at a target [deg], actual less target [arcsec], of a drive that began at a state."""
    off = -error[round(start + target / 360 * turn) % len(error)] + SCATTER * rng.standard_normal()
    return float(off + GRADUATION * np.cos(np.radians(3 * target) + phase))


def filled_in(file: str, off: Callable[[float], float]) -> str:
    """The file of a plan with the angle that was read behind each last comma."""
    rows = []
    for line in file.split("\n"):
        if line.endswith(",") and not line.startswith("#"):
            target = float(line.split(",")[1])
            line += f"{target + off(target) / 3600:.7f}"
        rows.append(line)
    return "\n".join(rows)


def accepted(number: int, draws: int, seed: int) -> Counter[str]:
    """Verdicts, by `accept` and the truth, of drives of one preset by the file of a plan that was carried out."""
    from hdassist.acceptance.decision import AcceptedValue, decide
    from hdassist.acceptance.limits import Limit
    from hdassist.belief.prior import prior_of
    from hdassist.error.cycle import kinematic_error
    from hdassist.loading import load_preset, load_text, similar_preset
    from hdassist.measuring.bench import PositionRecord, bench_record, position_quantities, seen_range
    from hdassist.model.geometry import Kinematics
    from hdassist.model.rules import first_conflict
    from hdassist.pages.plan import approach_csv
    from hdassist.planning import ApproachRun, EncoderData, PlanDemands, ReadingPlan, choose_plan
    from hdassist.preset.knowledge import read_requirements
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
    # what it prints is all that this study gives: the plan, a line a drive so that a stopped run tells what it has
    print(f"{preset.name} at {M_g:g} N m sees {choice.test.judged.seen}", flush=True)
    verdicts: Counter[str] = Counter()
    for k in range(number):
        rng = np.random.default_rng([seed, k, 7])
        there = preset.with_values(drawn_values(prior_of(preset), rng, {}))
        while first_conflict(there) is not None:
            there = preset.with_values(drawn_values(prior_of(preset), rng, {}))
        found = kinematic_error(there, M_g, teeth=rough_teeth(there, rng), run=UNCHECKED)
        error, turn = found.error_arcsec, kinematics.teeth_fixed * abs(kinematics.u)  # states in an output turn
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
    """Test drives, and print what each test sees and passes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=300, help="hidden drives")
    parser.add_argument("--planned", type=int, default=0, help="of them, those that the plan is asked about")
    parser.add_argument("--draws", type=int, default=32, help="effective samples of a plan")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--accepted", type=int, default=0, help="drives that are accepted by the file of a plan")
    args = parser.parse_args()
    if args.accepted:
        print(dict(accepted(args.accepted, args.draws, args.seed)))  # the counts, for docs/plan.md
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
