"""Drives at the ends of what a preset may say, and anywhere between: each is solved with a proof, or refused.

Every drive is the small one with some fields changed, and goes through `hdassist check` in a process of its own, so
that one that hangs or dies is seen.
"""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import resource
import signal
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations, product
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from hdassist.preset.fields import field_table, fields
from hdassist.preset.kinds import bounds_of, choices_of, kind_of
from hdassist.preset.yamltext import read
from hdassist.solve.certificate import TOLERANCE
from tests.process import SMALL, run

Change = dict[str, object]

LONGEST = 20.0  # s of processor time for one drive
PATIENCE = 10  # times as long by the clock, on a machine that has other work
HANGS = "hangs"
LIMITS = "acceptance"  # decide on numbers, and move none
# How much work is asked for, of states and of candidates: their upper ends are minutes, not a hang; tried so far.
WORK: dict[str, float] = {"numerics.n_phase": 10, "numerics.n_beta": 8, "numerics.n_2": 120, "numerics.n_max": 60}
TINY = (1e-300, 1e-30, 1e-10, 1e-6, 1e-3, 1.0)  # above 0, which often means something of its own
NEAR = 0.5  # of random drives, so much of them stays near the small drive
FEW = 4  # fields that a random drive changes beyond all measure


@dataclass(frozen=True)
class Outcome:
    """What became of a drive: one of ENDS; what was said; seconds of processor time."""

    change: Change
    end: str
    said: str
    seconds: float

    @property
    def good(self) -> bool:
        """Solved with a proof, refused by name, or declared untrustworthy; in time."""
        return self.end in GOOD


GOOD = ("solved", "refused", "untrusted")
BY_CODE = {0: "solved", 3: "solved", 4: "refused", 5: "untrusted"}


def numbers() -> dict[str, tuple[float, float]]:
    """Ends of the range of each field that holds a number and moves one, by path."""
    found = {}
    for path, info in fields():
        bounds = bounds_of(info)
        if kind_of(info) in ("number", "count") and not path.startswith(LIMITS) and {"ge", "le"} <= {*bounds}:
            found[path] = bounds["ge"], min(bounds["le"], WORK.get(path, np.inf))
    return found


def ends() -> Iterator[Change]:
    """Every field at each end of its range, just above an end of 0, and each word of each choice."""
    for path, (low, high) in numbers().items():
        yield from ({path: _as_field(path, end)} for end in (low, high))
        if low == 0 and kind_of(field_table()[path]) == "number":
            yield from ({path: tiny} for tiny in TINY)
    for path, info in fields():
        if kind_of(info) == "choice" and not path.startswith(LIMITS):
            yield from ({path: word} | _needed(word) for word in choices_of(info))
    for torque in (-1e7, -1e-300, 1e-300, 1e-9, 1e-3, 1e3, 1e7):
        yield {"operation.M_g": [torque]}


def pairs() -> Iterator[Change]:
    """Both ends of both of two fields, for every two fields of a section, and of stiffness against compliance."""
    by_path = numbers()
    sections = ("gears", "material", "flexspline", "bearing", "supports", "contact", "tolerances", "numerics")
    groups = [[path for path in by_path if path.startswith(section + ".")] for section in sections]
    groups.append([path for path in by_path if path.startswith(("supports.", "contact.", "material."))])
    seen: set[tuple[str, str]] = set()
    for group in groups:
        for one, other in combinations(group, 2):
            if (one, other) not in seen:
                seen.add((one, other))
                for a, b in product(by_path[one], by_path[other]):
                    yield {one: _as_field(one, a), other: _as_field(other, b)}


def at_random(n: int, seed: int) -> Iterator[Change]:
    """Random drives of 60 and 62 teeth: half of them near the small one, the rest with fields anywhere in range."""
    base = _small()
    by_path = {path: pair for path, pair in numbers().items() if path not in ("gears.z_g", "gears.z_b")}
    for k in range(n):
        rng = np.random.default_rng([seed, k])
        change: Change = {}
        if rng.random() < NEAR:
            for path, (low, high) in by_path.items():
                section, name = path.split(".")
                here = float(base.get(section, {}).get(name, field_table()[path].default or 0))
                change[path] = _as_field(path, min(max(here * rng.uniform(0.8, 1.25), low), high))
            # teeth fit by some per cent at most, whatever else is changed
            for path, spread in (("gears.m", 0), ("gears.x_g", 0.03), ("gears.x_b", 0.03), ("cam.W_0", 0.03)):
                section, name = path.split(".")
                change[path] = base[section][name] * (1 + spread * rng.uniform(-1, 1))
            change["gears.alpha"], change["gears.h_f"] = 20.0, 1.35
        for path in rng.choice(list(by_path), int(rng.integers(0 if change else 1, FEW + 1)), replace=False).tolist():
            change[path] = _anywhere(path, *by_path[path], rng)
        if rng.random() < 0.3:
            change |= {"bearing.ball_motion": "rolling", "bearing.d_ball": float(rng.uniform(1, 4)), "bearing.N": 14}
        change["operation.M_g"] = [float(10 ** rng.uniform(-2, 2) * rng.choice([-1, 1]))]
        yield change


def _anywhere(path: str, low: float, high: float, rng: np.random.Generator) -> float | int:
    """A value anywhere in a range: over its decades where there are some, and often just at an end, or none."""
    where = rng.random()
    if where < 0.2:
        return _as_field(path, low if where < 0.1 else high)
    least = low if low > 0 else high * 1e-12
    if low >= 0 and high > 100 * least:
        return _as_field(path, float(np.clip(np.exp(rng.uniform(np.log(least), np.log(high))), low, high)))
    return _as_field(path, float(rng.uniform(low, high)))


def _as_field(path: str, value: float) -> float | int:
    return round(value) if kind_of(field_table()[path]) == "count" else float(value)


def _needed(word: str) -> Change:
    return {"bearing.d_ball": 2.5} if word == "rolling" else {}


def _small() -> dict[str, Any]:
    """The small drive as plain data."""
    data = read(Path(SMALL).read_text(encoding="utf-8"), SMALL).data
    assert isinstance(data, dict)
    return data


def preset(change: Change) -> str:
    """Text of the small drive with some fields changed."""
    data = _small()
    for path, value in change.items():
        section, name = path.split(".")
        data.setdefault(section, {})[name] = value
    return json.dumps(data)


def outcomes(changes: Iterable[Change], longest: float = LONGEST) -> Iterator[Outcome]:
    """What becomes of each drive, in a process each; one that takes longer [s] is ended."""
    from hdassist.design import check, check_page  # noqa: F401 - so that not every process imports them again

    context = multiprocessing.get_context("fork")
    for change in changes:
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=_check, args=(change, longest, theirs))
        process.start()
        theirs.close()
        try:
            end, said, seconds = ours.recv() if ours.poll(PATIENCE * longest) else (HANGS, "", PATIENCE * longest)
        except EOFError:
            end, said, seconds = "died", "", 0.0
        if end == HANGS and process.pid:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # with the processes that share its work
        process.join()
        yield Outcome(change, end, said, seconds)


def _check(change: Change, longest: float, answer: Connection) -> None:
    """Check a drive, and answer how that ended, what was said, and the processor time it took [s]."""
    os.setpgid(0, 0)
    before = _worked()
    most = math.ceil(longest)
    resource.setrlimit(resource.RLIMIT_CPU, (most, most + 5))  # of each process: the one at work is a child of this
    done = run("check", "-", "--json", "--jobs", "1", stdin=preset(change))
    seconds, said = _worked() - before, done.stderr.strip()
    end = BY_CODE.get(done.returncode, f"exit {done.returncode}")
    if end == "solved" and not _proven(json.loads(done.stdout)):
        end = "unproven"
    if end not in GOOD and seconds >= 0.9 * longest:  # a worker was stopped at the limit, and that is all that broke
        end = HANGS
    answer.send((end, said, seconds))


def _worked() -> float:
    """Processor time [s] of this process and of those it began and that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def _proven(page: dict[str, object]) -> bool:
    certificate = page["certificate"]
    assert isinstance(certificate, dict)
    return bool(certificate["states"] > 0 and certificate["max_residual"] <= TOLERANCE and certificate["cross_check"])


def report(found: Iterable[Outcome]) -> bool:
    """Print what became of drives, those that are not as promised in full; whether all are."""
    count: Counter[str] = Counter()
    slowest: Outcome | None = None
    for outcome in found:
        count[outcome.end] += 1
        slowest = outcome if slowest is None or outcome.seconds > slowest.seconds else slowest
        if not outcome.good:
            print(f"{outcome.end}: {json.dumps(outcome.change)}\n  {outcome.said[-300:]}", flush=True)
    print(", ".join(f"{count[end]} {end}" for end in (*GOOD, *sorted(set(count) - {*GOOD}))))
    if slowest:
        print(f"slowest: {slowest.seconds:.1f} s, {json.dumps(slowest.change)}")
    return set(count) <= {*GOOD}
