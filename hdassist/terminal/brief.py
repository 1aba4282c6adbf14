"""Short pages: a verdict in its colour, labelled lines, the command to type next, one line of proof."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Iterator

from hdassist.model.assumed import assumptions
from hdassist.model.unknown import unknown_names, unknowns
from hdassist.preset.fields import Drive
from hdassist.preset.schema import resolved_fields
from hdassist.solve.answers import Certificate
from hdassist.solve.throughcvxpy import CrossCheck
from hdassist.textfile import STDIN
from hdassist.verdict import Verdict

LIMITED = ("check", "report", "tolerance", "sensitivity", "allocate", "accept")  # commands that take --limit
COLOURS: dict[str, str] = {Verdict.PASS: "green", Verdict.FAIL: "red"}


def again(command: str, drive: Drive, *more: str) -> str:
    """A command about the same drive, as a shell takes it."""
    origin = drive.origin
    preset = "-" if origin.file == STDIN else origin.file or drive.name
    return shlex.join(["hdassist", command, preset, *_options(command, origin.overrides), *more])


def _options(command: str, overrides: Iterable[str]) -> Iterator[str]:
    """Overrides as options of a command; torques and limits as they were asked for."""
    for override in overrides:
        if torques := re.fullmatch(r"operation\.M_g=\[([-+.\de, ]+)\]", override):
            yield from (f"--torque={torque.strip().removesuffix('.0')}" for torque in torques[1].split(","))
        elif command in LIMITED and (limit := re.fullmatch(r"acceptance\.F_ior(?:\.([^=]+))?=([^{]+)", override)):
            yield from ("--limit", f"F_ior@{limit[1]}={limit[2]}" if limit[1] else limit[2])
        else:
            yield from ("--set", override)


def proof(certificate: Certificate, cross_checks: Iterable[CrossCheck | None] = ()) -> str:
    """A certificate in one line: states, greatest residual as a share of its scale, what another solver solved."""
    words = proof_words(certificate.states, certificate.max_residual)
    if crosses := [cross for cross in cross_checks if cross]:
        words += f", {sum(cross.states for cross in crosses)} again by {crosses[0].solver}"
    return words


def proof_words(states: int, max_residual: float) -> str:
    """Solved states and their greatest residual, a share of its scale, in words."""
    return f"{thousands(states)} states, residual {max_residual:.0e}"


def thousands(count: int) -> str:
    """A count with its thousands apart: 20 200."""
    return f"{count:,}".replace(",", " ")


def on_what(drive: Drive) -> str:
    """What is assumed of a drive, or left to a default that has a range, where nobody has weighed it."""
    ranges = {each.path for each in assumptions(drive)}
    assumed = ranges.union(row.path for row in resolved_fields(drive) if row.kind == "assumed")
    return f"{len(ranges)} of {len(assumed)} assumed values have a range: hdassist check weighs them" if ranges else ""


def not_known(drive: Drive) -> str:
    """What is not known of a drive and was computed as 0."""
    open_ = unknowns(drive)
    return f"taken as 0: {unknown_names(open_)}" if open_ else ""
