"""Short pages: a verdict in its colour, labelled lines, the command to type next, one line of proof."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from hdassist.model.assumed import assumptions
from hdassist.model.unknown import unknown_names, unknowns
from hdassist.preset.fields import Drive
from hdassist.solve.throughcvxpy import CrossCheck
from hdassist.textfile import STDIN
from hdassist.verdict import Verdict, percent_text

if TYPE_CHECKING:
    from hdassist.belief.statistics import Probability
    from hdassist.report.report import ReportProof

DRAWN = ("tolerance", "sensitivity", "allocate")  # commands of random drives
SAMPLED = ("check", "report", "mount", "plan", "accept", "compare", "compensate")  # commands that draw samples
LIMITED = ("check", "report", "mount", "plan", "accept", *DRAWN)  # commands that take --limit
TOOTHED = ("check", "trace", "mount", "accept")  # commands that take measured teeth
TAKEN_OVER = {  # options that the next command has too, by their name: the commands that take them
    "draws": SAMPLED,
    "seed": (*SAMPLED, *DRAWN),
    "sure": ("accept",),
    "form": ("compensate",),
    "points": ("compensate",),
    "each_load": ("compensate",),
    "compensated": ("mount",),
    "distribution": DRAWN,
    "known": DRAWN,
    **dict.fromkeys(("pitch_b", "pitch_g", "mark_b", "mark_g"), TOOTHED),
    **dict.fromkeys(("pitch_form", "pitch_sense", "pitch_flank"), TOOTHED),
}
COLOURS: dict[str, str] = {Verdict.PASS: "green", Verdict.FAIL: "red"}


def again(command: str, drive: Drive | None, *more: str) -> str:
    """A command about the same drive, as a shell takes it; PRESET stands for one that is not known."""
    words = ["PRESET"]
    if drive:
        origin = drive.origin
        given = [
            (name, value) for name, value in origin.asked if command in TAKEN_OVER[name] and f"--{name}" not in more
        ]
        asked = [f"--{name.replace('_', '-')}={value}".removesuffix("=True") for name, value in given]
        preset = "-" if origin.file == STDIN else origin.file or drive.name
        words = [preset, *_options(command, origin.overrides), *asked]
    return shlex.join(["hdassist", command, *words, *more])


def _options(command: str, overrides: Iterable[str]) -> Iterator[str]:
    """Overrides as options of a command; torques and limits as they were asked for."""
    for override in overrides:
        if torques := re.fullmatch(r"operation\.M_g=\[([-+.\de, ]+)\]", override):
            yield from (f"--torque={torque.strip().removesuffix('.0')}" for torque in torques[1].split(","))
        elif command in LIMITED and (limit := re.fullmatch(r"acceptance\.F_ior(?:\.([^=]+))?=([^{]+)", override)):
            yield from ("--limit", f"F_ior@{limit[1]}={limit[2]}" if limit[1] else limit[2])
        else:
            yield from ("--set", override)


def proof(found: ReportProof | None, cross_checks: Iterable[CrossCheck | None] = ()) -> str:
    """One line of proof: states, greatest residual as a share of its scale, states that another solver solved."""
    if not found or not found.states:
        return ""
    words = f"{thousands(found.states)} states, residual {found.max_residual:.0e}"
    if crosses := [cross for cross in cross_checks if cross]:
        words += f", {sum(cross.states for cross in crosses)} again by {crosses[0].solver}"
    return words


def probability_words(found: Probability, needed: float | None = None) -> str:
    """A probability in per cent with its Monte Carlo interval, and that which is needed, as percent_text has them."""
    return percent_text(found.value, found.low, found.high, needed)


def thousands(count: int) -> str:
    """A count with its thousands apart: 20 200."""
    return f"{count:,}".replace(",", " ")


def on_what(drive: Drive) -> str:
    """How many values of a drive are assumed, or left to a default, and have a range that nobody has weighed."""
    ranges = len(assumptions(drive))
    return f"the ranges of {ranges} values are not weighed here: hdassist check weighs them" if ranges else ""


def not_known(drive: Drive) -> str:
    """Deviations of a drive that are not known, and were computed as 0."""
    open_ = unknowns(drive)
    return f"taken as 0: {unknown_names(open_)}" if open_ else ""
