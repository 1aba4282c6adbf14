"""Processor time from a key to numbers on the screen of the explorer, compared with one check of the same drive."""

from __future__ import annotations

import os
import statistics
from collections.abc import Callable
from contextlib import suppress
from typing import Any

NAMES = ("vzp160", "size-25-100")
FIELD = "gears.j_n"  # field that a key changes


class AnsweredError(Exception):
    """Signal that the awaited number has been computed."""


def measure(quick: bool) -> list[dict[str, Any]]:
    """Return the time to the first number, to the verified number, and of a complete check, for each drive [s]."""
    return [measured(name, 3 if quick else 9) for name in NAMES]


def measured(name: str, rounds: int) -> dict[str, Any]:
    """Return the median times over a number of key presses, each of which changes a field by a step."""
    from hdassist.features.design import check
    from hdassist.interface.explorer.compute import SURE_PROVEN, SURE_REFINED, Effort, drive_answers, still_typical
    from hdassist.interface.explorer.state import edited, opened_state, stepped
    from hdassist.run.run import Run, workers

    session = opened_state(name)
    effort = Effort(jobs=1)

    def checked() -> None:
        with workers(effort.jobs) as executor:
            check(session.drive, draws=effort.draws, run=Run(executor))

    def answered(until: str) -> None:
        def tell(_name: str, answer: object) -> None:
            if getattr(answer, "sure", "") == until:
                raise AnsweredError

        with suppress(AnsweredError):
            drive_answers(session.drive, typical, effort, tell)

    before = check(session.drive, draws=effort.draws)
    found: dict[str, list[float]] = {"first_s": [], "proven_s": [], "check_s": []}
    for _ in range(rounds):
        value = stepped(session.drive, FIELD, 1)
        session = edited(session, FIELD, value or "")
        typical = still_typical(before, session.drive)
        found["first_s"].append(spent(lambda: answered(SURE_REFINED)))
        found["proven_s"].append(spent(lambda: answered(SURE_PROVEN)))
    found["check_s"].append(spent(checked))
    return {"name": name, **{key: statistics.median(values) for key, values in found.items()}}


def spent(work: Callable[[], object]) -> float:
    """Return the processor time of some work and of the processes that it started and ended [s]."""
    begun = os.times()
    work()
    return sum(now - then for now, then in zip(os.times()[:4], begun[:4], strict=True))
