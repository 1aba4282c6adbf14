"""Options of check compared with the edited preset: `python -m benchmarks.options [--seeds 0,1] [--drives csf25,open]`.

Each option, and each reply to a question, that is an edit of the preset is carried out: a second `hdassist check` with
the same seed gets the edit by --set. A line gives the probability before the edit, the probability of the option with
its interval, and the probability of the edited preset. The summary gives the bias and the root mean square of the
difference by kind of option, in percentage points.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

# options take most of the time of a check, and the edited preset does not need them
WITHOUT_OPTIONS = """
from hdassist.features.design import DesignCheck
DesignCheck.with_steps = lambda self, run: self
from hdassist.interface.cli import run_command_line
run_command_line()
"""
ANSWERED = (0, 3, 6)  # exit codes of a check with a result
SHEET = ("--ratio", "100", "--pitch-diameter", "63.5", "--torque", "67", "--stiffness", "3.1e4,5.0e4,5.7e4")
ACCURATE = (*SHEET, "--lost-motion", "60", "--accuracy", "60")


@dataclass(frozen=True)
class Case:
    """A drive with limits at one torque.

    name: name of the drive or of its preset.
    M_g: torque [N*m].
    limits: limits of F'_ior [arcsec].
    made_by: arguments of `presets new` that make the preset, empty for a preset of the library.
    """

    name: str
    M_g: float
    limits: tuple[float, ...]
    made_by: tuple[str, ...] = ()


CASES = (
    Case("csf25", 6.7, (36, 45), (*ACCURATE, "--coupling", "oldham")),
    Case("csf25-solid", 6.7, (45, 60), (*ACCURATE, "--coupling", "solid")),
    Case("open", 6.7, (36, 48), SHEET),
    Case("size-17-100", 2.4, (42, 50)),
    Case("size-40-100", 26.5, (25, 31)),
    Case("vzp160", 80, (26, 28)),
)


@dataclass(frozen=True)
class Compared:
    """Probabilities of meeting the limit, for an option and for the edited preset.

    kind: kind of the option.
    of: field, or reply to a question.
    before: probability without the option.
    option: probability with the option, as check states it.
    low, high: ends of its interval.
    edited: probability of the edited preset.
    """

    kind: str
    of: str
    before: float
    option: float
    low: float
    high: float
    edited: float


def checked(preset: str, options: Sequence[str], folder: str, *, with_options: bool) -> dict[str, Any] | None:
    """Return the JSON result of a check; None if it has no result.

    preset: preset of the check.
    options: further arguments.
    folder: working folder.
    with_options: whether check computes options.
    """
    program = ["-m", "hdassist"] if with_options else ["-c", WITHOUT_OPTIONS]
    command = [sys.executable, *program, "check", preset, *options, "--json"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode not in ANSWERED:
        return None
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def compared(preset: str, options: Sequence[str], M_g: float, most: int, folder: str) -> Iterator[Compared]:
    """Yield the first options of a check with the results of the edited presets.

    preset: preset of the check.
    options: further arguments of all checks.
    M_g: torque of all checks [N*m].
    most: largest number of options.
    folder: working folder.
    """
    answer = checked(preset, options, folder, with_options=True)
    if answer is None:
        return
    before = probability(answer, M_g)
    edits = [step for step in answer["steps"] if step["edit"] or step["of"] == "cam.coupling"]
    for step in edits[:most]:
        for outcome in step["outcomes"]:
            edit = outcome["edit"] or step["edit"]
            if not edit or before is None or (step["kind"] == "question" and step["of"] != "cam.coupling"):
                continue
            words = [word for text in edit for word in ("--set", text)]
            after = checked(preset, [*options, *words], folder, with_options=False)
            edited = None if after is None else probability(after, M_g)
            if edited is not None:
                yield Compared(
                    kind=step["kind"],
                    of=outcome["answer"] or step["of"],
                    before=before,
                    option=outcome["probability"],
                    low=outcome["probability_low"],
                    high=outcome["probability_high"],
                    edited=edited,
                )


def probability(answer: dict[str, Any], M_g: float) -> float | None:
    """Return the probability of meeting the limit at a torque M_g [N*m]; None if the result does not have it."""
    [point] = [point for point in answer["operating_points"] if point["M_g_Nm"] == M_g]
    found = point["belief"] and point["belief"]["probability"]
    return None if found is None else float(found)


def summary(rows: Sequence[Compared]) -> str:
    """Return the table of number, bias and rms [percentage points], and share within the interval, by kind."""
    by_kind = defaultdict(list)
    for row in rows:
        by_kind[row.kind].append(row)
        by_kind["all"].append(row)
    lines = ["| kind | number | bias | rms | within the interval |", "| --- | --- | --- | --- | --- |"]
    for kind, some in by_kind.items():
        errors = [100 * (row.option - row.edited) for row in some]
        bias = sum(errors) / len(errors)
        rms = (sum(error**2 for error in errors) / len(errors)) ** 0.5
        within = sum(row.low <= row.edited <= row.high for row in some) / len(some)
        lines.append(f"| {kind} | {len(some)} | {bias:+.1f} | {rms:.1f} | {100 * within:.0f} % |")
    return "\n".join(lines)


def main() -> None:
    """Print each option as soon as it is compared, and then the summary."""
    reader = argparse.ArgumentParser(
        prog="python -m benchmarks.options", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    reader.add_argument("--seeds", default="0,1", help="seeds of the samples")
    reader.add_argument("--drives", default=",".join(case.name for case in CASES), help="names of the drives")
    reader.add_argument("--most", type=int, default=99, help="options of each check, the first ones")
    reader.add_argument("--jobs", type=int, default=0, help="number of processes of a check (0: one for each core)")
    arguments = reader.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            if case.name not in arguments.drives.split(","):
                continue
            preset = case.name
            if case.made_by:
                preset = f"{case.name}.yaml"
                made = [sys.executable, "-m", "hdassist", "presets", "new", case.name, *case.made_by, "-o", preset]
                subprocess.run(made, cwd=folder, check=True, capture_output=True)
            for limit in case.limits:
                for seed in map(int, arguments.seeds.split(",")):
                    options = ["--torque", f"{case.M_g:g}", "--limit", f"{limit:g}", "--seed", str(seed)]
                    options += ["--jobs", str(arguments.jobs)]
                    for row in compared(preset, options, case.M_g, arguments.most, folder):
                        rows.append(row)
                        stated = f"{row.option:.3f} ({row.low:.3f} to {row.high:.3f})"
                        words = f"{case.name} {limit:g} seed {seed} {row.kind} {row.of}: {row.before:.3f}"
                        sys.stdout.write(f"{words} option {stated} edited {row.edited:.3f}\n")
                        sys.stdout.flush()
    sys.stdout.write(summary(rows) + "\n")


if __name__ == "__main__":
    main()
