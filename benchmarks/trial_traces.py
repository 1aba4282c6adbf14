"""How good the advice from traces is: `python -m benchmarks.trial_traces [--cases 40] [--rows 0,2] [--write]`.

The drives of benchmarks.trials, but in place of F'_ior the error over two turns of the cam is recorded, at a random
place in the output's turn, with white noise of 1 arcsec on every reading. --write puts the table of the rows that
were run at the end of docs/trials.md.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache

from benchmarks.trials import GOOD, HOLES, M_G, PAGE, Study, simulate, told

READING = 1.0  # arcsec, white noise of a reading
TURNS = 2  # of the cam
HEADING = "## Traces in place of F'_ior"


@dataclass(frozen=True)
class Row:
    """Drives, and the holes in which a trace, or F'_ior, is measured."""

    study: Study
    traces: tuple[int, ...]
    numbers: tuple[int, ...] = ()

    @property
    def words(self) -> str:
        names = [f"a trace in hole {' and one in hole '.join(map(str, self.traces))}"]
        names += [f"F'_ior in hole {hole}" for hole in self.numbers]
        return ", ".join(names)


KNOWN = Study("all else known", "rest")
HIDDEN = Study("e_hh hidden too", "stiffness", e_hh=True)
BOTH = Study("e_hh and stiffness set hidden too", "nothing", e_hh=True, other="half")
OTHER = Study("made from the alternative set, of which the tool is not told", "rest", other="all")
ROWS = (
    Row(KNOWN, (0,)),
    Row(KNOWN, (0, 4)),
    Row(HIDDEN, (0,)),
    Row(HIDDEN, (0, 4)),
    Row(HIDDEN, (0,), (4,)),
    Row(BOTH, (0, 4)),
    Row(OTHER, (0, 4)),
)


def trial(drive, hole: int, rng):
    """A trace of a drive in a hole, as a trial."""
    import numpy as np

    from hdassist import load_preset
    from hdassist.error.trace import trace
    from hdassist.mounting.positions import rotated
    from hdassist.readers.sweeps import sweeps
    from hdassist.readers.trace import MeasuredTrace
    from hdassist.trials.trial import Trial
    from hdassist.trials.trial_traces import trial_trace

    turn = 360 * hole / HOLES
    seen = trace(
        rotated(drive, turn), M_G, start_deg=float(rng.uniform(0, 360)), revolutions=TURNS, cross_check=None
    ).error
    cam = np.degrees(seen.states.phi_h)
    error = seen.error_arcsec + READING * rng.standard_normal(len(cam))
    record = MeasuredTrace("", "", cam, error, np.arange(len(cam)), 0.0, tuple(sweeps(cam)), ())
    curve = trial_trace(record, load_preset("vzp160"), turn)
    return Trial(turn, curve.range_arcsec, curve)


@cache
def tables_of(known: str):
    from hdassist.trials.prior import tabulated

    return tabulated(told(known), [M_G], traced=True)


def advise(task: tuple[Row, int]) -> tuple[float, float, float, list[bool], float] | None:
    """Loss of the recommended hole, the loss expected of it, where the true F'_ior lie, how far the direction is off.

    Where they lie: whether in the interval of 90 %, for each hole; the direction in its standard deviations. None where
    nothing explains the trials.
    """
    import numpy as np

    from benchmarks.trials import hidden_drive
    from hdassist.errors import UntrustedError
    from hdassist.trials.posterior import posterior
    from hdassist.trials.prior import prior_of
    from hdassist.trials.trial import Rig, Trial, trial_positions

    row, seed = task
    rng = np.random.default_rng(20_000 + seed)
    true = np.array(simulate((row.study, seed))[0])
    drive = hidden_drive(row.study, np.random.default_rng(seed), seed)
    trials = [trial(drive, hole, rng) for hole in row.traces]
    trials += [Trial(360 * hole / HOLES, float(true[hole] + rng.standard_normal())) for hole in row.numbers]
    rig = Rig(M_G)
    try:
        prior = prior_of(tables_of(row.study.known), trials=trials, rig=rig)
        known = posterior(prior, trials, rig, trial_positions(HOLES, "all"))
    except UntrustedError:
        return None
    low, high = known.expected_F_ior(0.05)[0], known.expected_F_ior(0.95)[0]
    turn = (prior.direction_deg[np.unravel_index(known.nodes, prior.weight.shape)[2]] - drive.phases.phi_hb) % 360
    farther = np.abs((turn + 180) % 360 - 180)
    return (
        float(true[known.best] / true.min() - 1),
        float(known.expected_loss[known.best]),
        float(known.weight @ (farther < 15)),
        ((true >= low) & (true <= high)).tolist(),
        float(known.expected_loss[known.best] <= GOOD),
    )


def shares(found: list) -> list[float]:
    """Columns of a row, from what advise gives."""
    import numpy as np

    some = [one for one in found if one is not None]
    loss, expected, near, inside, sure = (np.array(column, dtype=float) for column in zip(*some, strict=True))
    settled = sure > 0
    return [
        100 * float(np.sum(loss < GOOD)) / len(found),
        100 * float(settled.sum()) / len(found),
        100 * float(np.mean(loss[settled] < GOOD)) if settled.any() else float("nan"),
        100 * float(expected.mean()),
        100 * float(loss.mean()),
        100 * float(inside.mean()),
        100 * float(near.mean()),
        100 * (len(found) - len(some)) / len(found),
    ]


def section(cases: int, results: list[tuple[Row, list[float]]]) -> str:
    lines = [
        HEADING,
        "",
        "Made by `python -m benchmarks.trial_traces --write`.",
        "",
        *HOW,
        "",
        f"{cases} of the same drives a row, at the same torque; in place of F'_ior the error over {TURNS} turns of",
        "the cam is recorded, wherever the output stands, with white noise (standard deviation",
        f"{READING:g}″) on each of its 404 readings. `--noise` is left at 1″, so slow errors of that size are allowed",
        "for. All in %.",
        "",
        "- *good*: drives in which the recommended hole loses less than 5 % against the best of the twelve;",
        "- *settled*: drives in which the tool says so, and how many of those are good;",
        "- *told*, *seen*: loss that is expected of the recommended hole, and what it is, on the mean;",
        "- *inside*: F'_ior of the twelve holes that lie between their 5 % and 95 % quantiles (90 would be right);",
        "- *near*: probability given to directions within 15° of the hidden one, on the mean;",
        "- *refused*: drives in which the tool says that nothing explains the traces.",
        "",
        "| drives | measured | good | settled | good of those | told | seen | inside | near | refused |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row, values in results:
        numbers = " | ".join("-" if value != value else f"{value:.0f}" for value in values)
        lines.append(f"| {row.study.words} | {row.words} | {numbers} |")
    return "\n".join([*lines, "", *SAYS]) + "\n"


HOW = (
    "A trace has the cam's angle from its index (phi_h = 0), counter-clockwise seen from the cam side, over one",
    "turn or more, and the error F_kpp = cam/u - output as `hdassist trace` writes it; of two encoders it is made",
    "so. Growing angles are taken where there are both. Means over 9° of the cam are compared with the model's",
    "curve; its level and where in the output's turn it began are open. Noise of the readings is seen in them and",
    "averages out; slow errors of rig and model are taken as `--noise`, alike over 20° of the cam (assumed). What",
    "else is open, such as the cam's own offset, is drawn as likely as the traces make it. Traces that nothing",
    "explains, or that are a hundred times likelier with the other sign of the error, are refused.",
)

SAYS = (
    "What it says: where all else is known one trace advises about as well as three F'_ior do, and two traces",
    "better. It then errs to the safe side: told losses are above those seen, intervals hold more than they",
    "promise, for the simulated traces have none of the slow errors that are allowed for. Where the cam's own",
    "offset is not known one trace does not settle much, and of the nine drives where it said that it does one was",
    "lost; a second trace brings most of it back. A drive whose stiffnesses are none of those the tool was told gets",
    "advice that is wrong every other time and sure of itself all the same: nothing in two traces gives it away.",
    "Identify the drive first (`hdassist calibrate`), and look at `--verify` afterwards.",
)


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--cases", type=int, default=40)
    reader.add_argument("--rows", default=",".join(map(str, range(len(ROWS)))))
    reader.add_argument("--write", action="store_true")
    options = reader.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    chosen = [ROWS[int(k)] for k in options.rows.split(",")]
    for row in chosen:
        tables_of(row.study.known)  # once, before there are processes
    results = []
    with ProcessPoolExecutor(os.cpu_count()) as executor:
        for row in chosen:
            found = list(executor.map(advise, [(row, seed) for seed in range(options.cases)]))
            results.append((row, shares(found)))
            print(row.study.words, row.words, [round(v, 1) for v in results[-1][1]], flush=True)
    text = section(options.cases, results)
    print(text)
    if options.write:
        before = PAGE.read_text(encoding="utf-8").partition(HEADING)[0]
        PAGE.write_text(f"{before.rstrip()}\n\n{text}", encoding="utf-8")


if __name__ == "__main__":
    main()
