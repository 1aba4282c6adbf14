"""Studies of what the tool promises whatever it is given: `python -m tests.fuzz drives --n 200`."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from hdassist.interface.cli import THREADS
from tests.helpers.process import hear_what_is_ignored

for name in THREADS:
    os.environ.setdefault(name, "1")  # as the command line has it, before numpy is loaded


def drives(args: argparse.Namespace) -> bool:
    """Range ends, pairs of them, random drives."""
    from tests.fuzz.drives import at_random, ends, outcomes, pairs, report

    parts = {"ends": ends(), "pairs": pairs(), "random": at_random(args.n, args.seed, args.start)}
    good = True
    for part in args.parts or parts:
        print(f"{part}:", flush=True)
        good &= report(outcomes(parts[part], jobs=args.jobs))
    return good


def faults(args: argparse.Namespace) -> bool:
    """Kills, signals, surroundings, two runs at once."""
    from tests.fuzz.faults import CASES, kills, report, signals
    from tests.fuzz.surroundings import surroundings, two_at_once

    parts = {
        "kills": lambda: kills(args.kills, args.seed, args.commands or tuple(CASES)),
        "signals": lambda: signals(args.signals, args.seed),
        "surroundings": surroundings,
        "two runs at once": two_at_once,
    }
    good = True
    for part in args.parts or parts:
        good &= report(part, parts[part]())
    return good


def closings(args: argparse.Namespace) -> bool:
    """The explorer's terminal closed."""
    from tests.fuzz.closings import closings as closed
    from tests.fuzz.faults import report

    return report("closed terminals", closed(args.n, args.seed))


def relations(args: argparse.Namespace) -> bool:
    """The same question asked in two ways."""
    from tests.fuzz.relations import study

    return study(args.n, args.seed)


def recordings(args: argparse.Namespace) -> bool:
    """The same readings, written as another recording."""
    from tests.fuzz.recordings import study

    return study(args.n, args.seed)


def inputs(args: argparse.Namespace) -> bool:
    """Presets, targets, traces, pitch tables, lots, options, answers and states, changed at random."""
    if args.guided:
        more = ["--n", str(args.n), "--seed", str(args.seed), *(["--kinds", *args.kinds] if args.kinds else [])]
        os.execv(sys.executable, [sys.executable, "-m", "tests.fuzz.guided", *more])  # which imports under a watch
    from tests.fuzz.inputs import made, outcomes, report, save, until_results

    if args.results:
        return report(until_results(args.results, args.seed, args.kinds), args.seed, args.kinds, one_kind=True)
    if args.save is not None:
        save(made(args.save, args.seed, args.kinds), Path(f"input-{args.save}"))
    numbers = range(args.start, args.n) if args.save is None else [args.save]
    return report(outcomes(numbers, args.seed, args.kinds), args.seed, args.kinds)


def main() -> int:
    """Run one study; 1 where a promise is broken."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    studies = parser.add_subparsers(required=True)
    study = studies.add_parser("drives", help="drives at the ends of their ranges and at random")
    study.add_argument("--n", type=int, default=200, help="random drives")
    study.add_argument("--seed", type=int, default=0)
    study.add_argument("--start", type=int, default=0, help="go on with this random drive: the first was 0")
    study.add_argument("--jobs", type=int, default=1, help="drives at a time, in a process each")
    study.add_argument("--parts", nargs="*", choices=("ends", "pairs", "random"), help="all of them unless named")
    study.set_defaults(run=drives)
    study = studies.add_parser("faults", help="runs that are ended at any moment, or that the system gives little")
    study.add_argument("--kills", type=int, default=200, help="runs that are killed")
    study.add_argument("--commands", nargs="*", help="that are killed: all cases unless named")
    study.add_argument("--signals", type=int, default=300, help="runs that are told to stop")
    study.add_argument("--seed", type=int, default=0)
    known = ("kills", "signals", "surroundings", "two runs at once")
    study.add_argument("--parts", nargs="*", choices=known, help="all of them unless named")
    study.set_defaults(run=faults)
    study = studies.add_parser("closings", help="terminals that are closed under the explorer")
    study.add_argument("--n", type=int, default=300, help="runs")
    study.add_argument("--seed", type=int, default=0)
    study.set_defaults(run=closings)
    study = studies.add_parser("relations", help="the same question asked in two ways, of drives at random")
    study.add_argument("--n", type=int, default=20, help="drives, some twenty relations each")
    study.add_argument("--seed", type=int, default=0)
    study.set_defaults(run=relations)
    study = studies.add_parser("recordings", help="the same readings, written as another recording")
    study.add_argument("--n", type=int, default=20, help="recordings, a dozen relations each")
    study.add_argument("--seed", type=int, default=0)
    study.set_defaults(run=recordings)
    study = studies.add_parser("inputs", help="everything that is read, changed at random")
    study.add_argument("--n", type=int, default=1000, help="inputs")
    study.add_argument("--start", type=int, default=0, help="go on with this one: the first was 0")
    study.add_argument("--seed", type=int, default=0)
    study.add_argument("--kinds", nargs="*", default=(), help="of these kinds: all of them unless named")
    study.add_argument(
        "--save", type=int, metavar="K", help="run this one only, and keep its files in a folder input-K"
    )
    study.add_argument("--results", type=int, help="go on until so many of each kind have reached a result")
    study.add_argument("--guided", action="store_true", help="readers alone, guided by coverage (needs .[fuzz])")
    study.set_defaults(run=inputs)
    args = parser.parse_args()
    hear_what_is_ignored()
    return 0 if args.run(args) else 1


if __name__ == "__main__":
    sys.exit(main())
