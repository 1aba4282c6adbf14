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
import time
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from itertools import combinations, product
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import numpy as np

from hdassist.drive.preset.fields import field_table
from hdassist.drive.preset.text import read_yaml
from hdassist.drive.solve.answers import TOLERANCE
from tests.helpers.process import SMALL, run

Change = dict[str, Any]

LONGEST = 20.0  # s of processor time for one drive
PATIENCE = 10  # times as long by the clock, on a machine that has other work
HANGS = "hangs"
LIMITS = ("acceptance.", "catalogue.")  # stand beside numbers, and move none
# How much work is asked for, of states and of candidates: their upper ends are minutes, not a hang; tried so far.
WORK: dict[str, float] = {"numerics.n_phase": 10, "numerics.n_beta": 8, "numerics.n_2": 120, "numerics.n_max": 60}
TINY = (1e-300, 1e-30, 1e-10, 1e-6, 1e-3, 1.0)  # above 0, which often means something of its own
NEAR = 0.5  # of random drives, so much of them stays near the small drive
FEW = 4  # fields that a random drive changes beyond all measure
SHIFTS = ("gears.x_g", "gears.x_b", "cam.W_0")
STEADY = ("gears.z_g", "gears.z_b", "gears.m", "gears.alpha", "gears.h_a", "gears.h_f", "numerics.n_phase")
TEETH = 30, 40  # of the flexspline of random drives: their full cycles are short
TOLD = 50  # drives after which the counts so far are printed


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
    for path, field in field_table().items():
        is_closed = np.isfinite([field.ge, field.le]).all()
        if field.kind in ("number", "count") and not path.startswith(LIMITS) and is_closed:
            found[path] = field.ge, min(field.le, WORK.get(path, np.inf))
    return found


def ends() -> Iterator[Change]:
    """Every field at each end of its range, just above an end of 0, and each word of each choice."""
    for path, (low, high) in numbers().items():
        yield from ({path: _as_field(path, end)} for end in (low, high))
        if low == 0 and field_table()[path].kind == "number":
            yield from ({path: tiny} for tiny in TINY)
    for path, field in field_table().items():
        if field.kind == "choice" and not path.startswith(LIMITS):
            yield from ({path: word} | _needed(word) for word in field.choices)
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


def at_random(n: int, seed: int, start: int = 0) -> Iterator[Change]:
    """Random drives, numbers start to n: half of them near the small one, others with fields anywhere.

    Their teeth fit unless a field that is changed says otherwise: 30 to 40 of them at the small drive's radius.
    """
    by_path = numbers()
    for k in range(start, n):
        rng = np.random.default_rng([seed, k])
        base = toothed(int(rng.integers(TEETH[0], TEETH[1] + 1)))
        change = dict(base)
        if rng.random() < NEAR:
            change = {path: _near(path, base, *pair, rng) for path, pair in by_path.items()}
            change["numerics.n_2"] = max(change["numerics.n_2"], 2 * change["numerics.n_max"])
        few = int(rng.integers(0 if len(change) > len(base) else 1, FEW + 1))
        for path in rng.choice(list(by_path), few, replace=False).tolist():
            change[path] = _anywhere(path, *by_path[path], rng)
        if rng.random() < 0.3:
            change |= {"bearing.ball_motion": "rolling", "bearing.d_ball": float(rng.uniform(1, 4)), "bearing.N": 14}
        change["operation.M_g"] = [float(10 ** rng.uniform(-2, 2) * rng.choice([-1, 1]))]
        yield change


def toothed(z_g: int) -> Change:
    """Fields that give the small drive so many teeth on the flexspline, at the same radius, and little work."""
    m = 30 / z_g
    x_g = 0.6 + (z_g - 30) / 30 * 0.8
    return {
        "gears.z_g": z_g, "gears.z_b": z_g + 2, "gears.m": m, "gears.x_g": x_g, "gears.x_b": x_g + 0.2,
        "cam.W_0": 1.16 * m, "numerics.n_phase": 2,
    }  # fmt: skip


def _near(path: str, base: Change, low: float, high: float, rng: np.random.Generator) -> float | int:
    """A value within a fifth of the small drive's; of teeth, which fit by some per cent at most, nearer."""
    section, name = path.split(".")
    here = base[path] if path in base else _small().get(section, {}).get(name, field_table()[path].default or 0)
    spread = 0.03 if path in SHIFTS else 0.0 if path in STEADY else 0.2
    return _as_field(path, min(max(here * (1 + spread * rng.uniform(-1, 1.25)), low), high))


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
    return round(value) if field_table()[path].kind == "count" else float(value)


def _needed(word: str) -> Change:
    return {"bearing.d_ball": 2.5} if word == "rolling" else {}


@cache
def _small() -> dict[str, Any]:
    """The small drive as plain data."""
    data = read_yaml(Path(SMALL).read_text(encoding="utf-8"), SMALL).data
    assert isinstance(data, dict)
    return data


def preset(change: Change) -> str:
    """Text of the small drive with some fields changed."""
    data = deepcopy(_small())
    for path, value in change.items():
        section, name = path.split(".")
        data.setdefault(section, {})[name] = value
    return json.dumps(data)


def outcomes(changes: Iterable[Change], longest: float = LONGEST, jobs: int = 1) -> Iterator[Outcome]:
    """What becomes of each drive, in their order, in a process each and so many at a time.

    One that takes longer [s] is ended.
    """
    # unused here: loaded once, so that not every process that is forked loads them again
    from hdassist.drive import loading  # noqa: F401
    from hdassist.features import design  # noqa: F401
    from hdassist.interface.pages import check as check_page  # noqa: F401
    from hdassist.interface.terminal import output  # noqa: F401
    from hdassist.run import files, run  # noqa: F401

    context = multiprocessing.get_context("fork")
    under_way: deque[tuple[Change, Connection, BaseProcess]] = deque()
    for change in changes:
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=_check, args=(change, longest, theirs))
        process.start()
        theirs.close()
        under_way.append((change, ours, process))
        if len(under_way) == jobs:
            yield _outcome(*under_way.popleft(), longest)
    while under_way:
        yield _outcome(*under_way.popleft(), longest)


def _outcome(change: Change, answer: Connection, process: BaseProcess, longest: float) -> Outcome:
    """What a process says of its drive, or what became of the process."""
    with answer:
        try:
            end, said, seconds = answer.recv() if answer.poll(PATIENCE * longest) else (HANGS, "", PATIENCE * longest)
        except EOFError:
            end, said, seconds = "died", "", 0.0
    if end == HANGS and process.pid:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # with the processes that share its work
    process.join()
    return Outcome(change, end, said, seconds)


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
    """Print what became of drives as it comes, those that are not as promised in full; whether all are."""
    count: Counter[str] = Counter()
    slowest: Outcome | None = None
    spent, begun = 0.0, time.monotonic()

    def told() -> str:
        ends = ", ".join(f"{count[end]} {end}" for end in (*GOOD, *sorted(set(count) - {*GOOD})))
        drives = count.total()
        wall = time.monotonic() - begun
        return f"{drives} drives: {ends}; {spent / max(drives, 1):.2f} s of processor time each, {wall:.0f} s in all"

    with suppress(KeyboardInterrupt):  # then with what is known
        for outcome in found:
            count[outcome.end] += 1
            spent += outcome.seconds
            slowest = outcome if slowest is None or outcome.seconds > slowest.seconds else slowest
            if not outcome.good:
                print(f"{outcome.end}: {json.dumps(outcome.change)}\n  {outcome.said[-300:]}", flush=True)
            if count.total() % TOLD == 0:
                print(told(), flush=True)
    print(told())
    if slowest:
        print(f"slowest: {slowest.seconds:.1f} s, {json.dumps(slowest.change)}")
    return set(count) <= {*GOOD}
