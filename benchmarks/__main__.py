"""Speed and memory of the commands that users wait for: `python -m benchmarks [--quick] [--json FILE] [--write]`.

A run prints every target with the measured value. --write writes docs/performance.md, which shows the previous run for
comparison (--first FILE). --from reads the numbers of an earlier run instead of measuring; only the parts that --anew
names are measured again (--anew engine --anew proposals).
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks import machine, page
from benchmarks.rows import rows

FORMAT = "hdassist.benchmarks/5"


# the memory of a parent counts for its child too, so nothing heavy is imported before processes are measured
PARTS = ("processes", "engine", "growth", "coned", "proposals", "draws", "tolerance", "explorer")


def measure(quick: bool, parts: Sequence[str] = PARTS) -> dict[str, Any]:
    """Measure parts one after another, so that they do not disturb each other, and return the results.

    quick: whether to measure fewer runs and cases.
    parts: names of the parts.
    """
    measured: dict[str, Any] = {"schema": FORMAT, "quick": quick, "machine": machine.machine()}
    for name in parts:
        begun = time.monotonic()
        measured[name] = import_module(f"benchmarks.{name}").measure(quick)
        sys.stderr.write(f"{name}: measured in {time.monotonic() - begun:.0f} s\n")
    return measured


def joined(earlier: dict[str, Any], later: dict[str, Any]) -> dict[str, Any]:
    """Return an earlier run with the parts of a later one, and the load of the machine during the later run."""
    anew = {name: later["machine"]["load"] for name in PARTS if name in later}
    return earlier | later | {"machine": earlier["machine"], "anew": earlier.get("anew", {}) | anew}


def table(measured: dict[str, Any]) -> str:
    """Return the table of targets and measurements for a terminal."""
    lines = ["  ".join(f"{name} {value}" for name, value in measured["machine"].items()), ""]
    cells = [(row.work, row.asked, row.got, "" if row.met else "missed") for row in rows(measured)]
    widths = [max(len(row[k]) for row in cells) for k in range(3)]
    for work, asked, got, verdict in cells:
        lines.append(f"{work:{widths[0]}}  {asked:>{widths[1]}}  {got:>{widths[2]}}  {verdict}".rstrip())
    return "\n".join(lines)


def main() -> None:
    """Measure, print a table, and write JSON and the page if requested."""
    reader = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    reader.add_argument("--quick", action="store_true", help="fewer runs and cases, no solvers through cvxpy")
    reader.add_argument("--json", metavar="FILE", help="write the measurements to FILE")
    reader.add_argument("--from", metavar="FILE", dest="earlier", help="read the measurements of an earlier run")
    reader.add_argument("--first", metavar="FILE", help="the run before, which the page has beside this one")
    reader.add_argument("--anew", metavar="PART", choices=PARTS, action="append", help="measure a part of it anew")
    reader.add_argument("--write", action="store_true", help="write docs/performance.md")
    options = reader.parse_args()
    if options.write and options.quick:
        reader.error("the page is not made from a quick run")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # same setting as the command line, before numpy is loaded

    def run_of(file: str) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(Path(file).read_text(encoding="utf-8"))
        if found.get("schema") != FORMAT or (options.write and found["quick"]):
            reader.error(f"{file} does not hold a full run of this format")
        return found

    first = run_of(options.first) if options.first else None
    if options.earlier:
        measured = run_of(options.earlier)
        if options.anew:
            measured = joined(measured, measure(options.quick, options.anew))
    else:
        measured = measure(options.quick)
    print(table(measured))
    if options.json:
        Path(options.json).write_text(json.dumps(measured, indent=2) + "\n", encoding="utf-8")
    if options.write:
        page.PAGE.write_text(page.page(measured, first), encoding="utf-8")


if __name__ == "__main__":
    main()
