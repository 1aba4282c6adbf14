"""Studies of what the tool promises whatever it is given: `python -m tests.fuzz drives --n 200`."""

from __future__ import annotations

import argparse
import os
import sys

from hdassist.cli.main import THREADS

for name in THREADS:
    os.environ.setdefault(name, "1")  # as the command line has it, before numpy is loaded


def drives(args: argparse.Namespace) -> bool:
    """Range ends, pairs of them, random drives."""
    from tests.fuzz.drives import at_random, ends, outcomes, pairs, report

    parts = {"ends": ends(), "pairs": pairs(), "random": at_random(args.n, args.seed)}
    good = True
    for part in args.parts or parts:
        print(f"{part}:", flush=True)
        good &= report(outcomes(parts[part]))
    return good


def faults(args: argparse.Namespace) -> bool:
    """Kills, signals, surroundings, two runs at once."""
    from tests.fuzz.faults import kills, report, signals
    from tests.fuzz.surroundings import surroundings, two_at_once

    parts = {
        "kills": lambda: kills(args.kills, args.seed),
        "signals": signals,
        "surroundings": surroundings,
        "two runs at once": two_at_once,
    }
    good = True
    for part in args.parts or parts:
        good &= report(part, parts[part]())
    return good


def main() -> int:
    """Run one study; 1 where a promise is broken."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    studies = parser.add_subparsers(required=True)
    study = studies.add_parser("drives", help="drives at the ends of their ranges and at random")
    study.add_argument("--n", type=int, default=200, help="random drives")
    study.add_argument("--seed", type=int, default=0)
    study.add_argument("--parts", nargs="*", choices=("ends", "pairs", "random"), help="all of them unless named")
    study.set_defaults(run=drives)
    study = studies.add_parser("faults", help="runs that are ended at any moment, or that the system gives little")
    study.add_argument("--kills", type=int, default=200, help="runs that are killed")
    study.add_argument("--seed", type=int, default=0)
    known = ("kills", "signals", "surroundings", "two runs at once")
    study.add_argument("--parts", nargs="*", choices=known, help="all of them unless named")
    study.set_defaults(run=faults)
    args = parser.parse_args()
    return 0 if args.run(args) else 1


if __name__ == "__main__":
    sys.exit(main())
