"""How honest the orders of trials are: `python -m benchmarks.trials [--cases A,D1,D2,G,F] [--n 40]`.

Hidden drives with 12 holes. Trials in holes 0, 4 and 8, and then where the tool says, until there are six, are measured
with noise. Counted is what is ordered after six, and what was ordered first.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.honesty import hidden_drive, true_F_ior

M_G, HOLES, FIRST, NUMBER = 80.0, 12, (0, 4, 8), 6
GOOD = 0.05  # loss below which a hole is as good as the best
MISREAD = 8.0, 15.0  # arcsec that a misread value is off by


@dataclass(frozen=True)
class Case:
    """Hidden drives, noise of their trials [arcsec], stated as 1, and whether one of six is misread.

    order_2: arcsec that a hidden vzp160 has beside what the model computes, at twice a turn of the cam; None: drives of
    which a data sheet is known (honesty.py).
    """

    order_2: float | None = 0.0
    noise: float = 1.0
    misread: bool = False


CASES = {
    "A": Case(),  # vzp160 as stated: e_hb 20 to 140 um, e_hh 0 to 60 um, in any direction
    "D1": Case(order_2=2.0),
    "D2": Case(noise=2.0),
    "G": Case(order_2=4.0, noise=2.0, misread=True),
    "F": Case(order_2=None),
}


@dataclass(frozen=True)
class Judged:
    """What is said of a hidden drive: loss of the order after six trials and of the first order, None without one.

    loss of the hole with the best odds after six; effective samples; refused: why there is no answer.
    """

    ordered: float | None = None
    first: float | None = None
    loss: float = np.nan
    effective: float = np.nan
    refused: str = ""


def hidden_vzp160(seed: int, order_2: float):
    """The preset vzp160 and F'_ior [arcsec] in each hole of a hidden drive like it."""
    from hdassist import load_preset
    from hdassist.error.cycle import kinematic_error
    from hdassist.mounting.positions import rotated
    from hdassist.run.run import UNCHECKED

    rng, preset = np.random.default_rng([0, seed]), load_preset("vzp160")
    values = {
        "tolerances.e_hb": rng.uniform(20, 140),
        "phases.phi_hb": rng.uniform(0, 360),
        "tolerances.e_hh": rng.uniform(0, 60),
        "phases.phi_hh": rng.uniform(0, 360),
    }
    drive, phase = preset.with_values(values), rng.uniform(0, 2 * np.pi)
    turned = (rotated(drive, 360 * hole / HOLES) for hole in range(HOLES))
    found = [kinematic_error(each, M_G, run=UNCHECKED) for each in turned]
    more = order_2 * np.sin(2 * found[0].states.phi_h + phase)
    return preset, np.array([np.ptp(each.error_arcsec + more) for each in found])


def hidden_by_data_sheet(seed: int):
    """The preset that is known of a hidden drive and its F'_ior [arcsec] in each hole, what stands turned back."""
    preset, there, teeth = hidden_drive(np.random.default_rng([1, seed]))

    def turned(hole: int):
        directions = {"phases.phi_hb": 360, "harmonics.xi_s2": 180}
        return there.with_values(
            {path: (there.number(path) - 360 * hole / HOLES) % whole for path, whole in directions.items()}
        )

    M_g = preset.operation.M_g[0]
    return preset, np.array([true_F_ior(turned(hole), M_g, teeth) for hole in range(HOLES)])


def judged(case: Case, draws: int, seed: int) -> Judged:
    """What trials say of a hidden drive, by its number."""
    from hdassist.errors import HdassistError
    from hdassist.mounting.positions import usable_positions
    from hdassist.mounting.trial import Trial
    from hdassist.trials import advice as of_trials
    from hdassist.trials.prior import Rig, TrialEffort, trial_prior

    rng, positions = np.random.default_rng([20, seed]), usable_positions(HOLES, "all")
    wrong, off = rng.integers(NUMBER), rng.uniform(*MISREAD) * rng.choice([-1, 1])
    trials: list[Trial] = []
    first = None
    of_trials.trial_prior = _once(trial_prior)
    try:
        preset, true = hidden_by_data_sheet(seed) if case.order_2 is None else hidden_vzp160(seed, case.order_2)
        loss = true / true.min() - 1
        M_g = preset.operation.M_g[0] if case.order_2 is None else M_G
        one = preset.model_copy(update={"operation": preset.operation.model_copy(update={"M_g": (M_g,)})})
        for hole in FIRST:
            trials.append(_measured(positions, true, hole, case, rng, off * (case.misread and wrong == len(trials))))
        while True:
            advice = of_trials.advise_from_trials(one, trials, Rig(M_g), effort=TrialEffort.of(draws))
            best = loss[positions.index(advice.stay[0])]
            first = best if first is None and advice.settled else first
            if len(trials) == NUMBER:
                return Judged(best if advice.settled else None, first, best, advice.draws.effective)
            hole = positions.index(advice.to_measure_next[0])
            trials.append(_measured(positions, true, hole, case, rng, off * (case.misread and wrong == len(trials))))
    except HdassistError as error:
        return Judged(first=first, refused=error.message)


def _once(trial_prior):
    """The same samples for all trials of a drive, drawn once, as long as they suffice."""
    kept = []

    def drawn(*args, enough, **more):
        if not kept or not enough(kept[0]):
            kept[:] = [trial_prior(*args, enough=enough, **more)]
        return kept[0]

    return drawn


def _measured(positions, true, hole: int, case: Case, rng: np.random.Generator, off: float):
    from hdassist.mounting.trial import Trial

    return Trial(positions[hole], max(float(true[hole] + case.noise * rng.standard_normal() + off), 0.5))


def main() -> None:
    """Judge drives, and print how often orders were wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", default=",".join(CASES))
    parser.add_argument("--n", type=int, default=40, help="hidden drives of each case")
    parser.add_argument("--draws", type=int, default=32, help="as --draws of trials")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    args = parser.parse_args()
    for name in args.cases.split(","):
        found = []
        with ProcessPoolExecutor(args.jobs) as pool:
            for k, each in enumerate(pool.map(partial(judged, CASES[name], args.draws), range(args.n))):
                found.append(each)
                print(name, k, each, flush=True)
        answers = [each for each in found if not each.refused]
        for when, orders in (
            ("after six", [each.ordered for each in answers if each.ordered is not None]),
            ("first", [each.first for each in found if each.first is not None]),
        ):
            wrong = sum(loss >= GOOD for loss in orders)
            print(f"{name}: ordered {when} {len(orders)} of {len(found)}, wrong {wrong}")
        good, effective = sum(each.loss < GOOD for each in answers), np.median([each.effective for each in answers])
        print(
            f"{name}: best odds good {good}, refused {len(found) - len(answers)}, effective {effective:.0f}", flush=True
        )


if __name__ == "__main__":
    main()
