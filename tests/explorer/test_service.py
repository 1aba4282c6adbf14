from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import time
from collections.abc import Awaitable, Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from hdassist.features.mounting.advice import Advice
from hdassist.interface.explorer.compute import (
    SURE_PROVEN,
    SURE_REFINED,
    Effort,
    FirstErrors,
    SeatCurve,
    cam_turn,
    drive_answers,
)
from hdassist.interface.explorer.service import Question, Service
from hdassist.run.errors import HdassistError
from tests.explorer.rig import QUICK, tiny

needs_proc = pytest.mark.skipif(sys.platform != "linux", reason="processes are counted in /proc")


@pytest.fixture(scope="module")
def service() -> Iterator[Service]:
    service = Service()
    yield service
    service.close()


async def told(service: Service, question: Question) -> list[object]:
    return [answer async for _, answer in service.ask(question)]


def turn(*overrides: str) -> Question:
    """What is computed soon."""
    return partial(cam_turn, tiny(*overrides).drive, {}, 0.0, 4.0)


def test_explorer_refines_its_results_to_those_of_the_command(service: Service) -> None:
    answers = asyncio.run(told(service, partial(drive_answers, tiny().drive, {}, QUICK)))
    curves = [answer for answer in answers if isinstance(answer, SeatCurve)]
    shares = [answer for answer in answers if isinstance(answer, float)]
    assert shares == sorted(shares) and all(0 < share < 1 for share in shares) and shares
    assert [curve.sure[0] for curve in curves] == [SURE_REFINED, SURE_PROVEN]
    assert isinstance(answers[-1], Advice) and {len(curve.rotations_deg) for curve in curves} == {6}
    searched, proven = (curve.F_ior_arcsec for curve in curves)
    assert searched == pytest.approx(proven, abs=0.01)


def test_available_result_arrives_before_the_next_is_computed(service: Service) -> None:
    async def first(question: Question) -> object:
        async with contextlib.aclosing(service.ask(question)) as answers:
            return (await anext(answers))[1]

    assert isinstance(asyncio.run(first(partial(drive_answers, tiny().drive, {}, LONG))), FirstErrors)


def test_what_cannot_be_computed_is_an_answer_too(service: Service) -> None:
    question = partial(cam_turn, tiny("operation.M_g=[9000000.0]").drive, {}, 0.0, 9e6)
    [failed] = asyncio.run(told(service, question))
    assert isinstance(failed, HdassistError) and "linear model" in failed.message


def test_no_process_that_can_begin_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise OSError(11, "Resource temporarily unavailable")

    service = Service()
    monkeypatch.setattr(service, "_begin", refused)
    [failed] = asyncio.run(told(service, turn()))
    assert isinstance(failed, HdassistError) and "cannot start a worker process" in failed.message


def processes() -> set[int]:
    """Processes of this one, and theirs."""
    parents: dict[int, int] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            parents[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
    found = {os.getpid()}
    while more := {pid for pid, parent in parents.items() if parent in found} - found:
        found |= more
    return found - {os.getpid()}


def vanished(before: set[int]) -> bool:
    """Whether no process is there that was not before; each gets some time to go."""
    end = time.monotonic() + 20
    while processes() - before and time.monotonic() < end:
        time.sleep(0.05)
    return not processes() - before


LONG = Effort(draws=20_000, jobs=2)  # with an uncertainty of a stiffness: minutes


def asked_for(service: Service, end: Callable[[asyncio.Task[list[object]]], Awaitable[None]]) -> set[int]:
    """Ask what takes minutes, and end that once its workers are at work; the processes that there were."""
    drive = tiny("uncertainty.cam.W_0=0.001").drive
    seen: set[int] = set()

    async def run() -> None:
        task = asyncio.create_task(told(service, partial(drive_answers, drive, {}, LONG)))
        before = processes()
        while len(seen) < 3:  # the one that answers, and two workers
            await asyncio.sleep(0.1)
            seen.update(processes() - before)
        await end(task)

    asyncio.run(run())
    return seen


@needs_proc
def test_a_question_that_is_superseded_leaves_no_process(service: Service) -> None:
    asyncio.run(told(service, turn()))  # what it forks from has begun
    before = processes()

    async def cancelled(task: asyncio.Task[list[object]]) -> None:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task

    assert len(asked_for(service, cancelled)) >= 3
    waiting = {asked.process.pid for asked in service.processes.waiting()}  # another one waits for the next question
    assert vanished(before | waiting)


@needs_proc
def test_a_service_that_is_closed_leaves_no_process() -> None:
    service = Service()
    asyncio.run(told(service, turn()))
    before = processes()

    async def closed(task: asyncio.Task[list[object]]) -> None:
        service.close()
        await task

    assert len(asked_for(service, closed)) >= 3 and vanished(before)


@pytest.mark.thorough
def test_waiting_processes_answer_questions_if_forking_is_unavailable(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("hdassist.interface.explorer.service.has_forkserver", lambda: False)
    service = Service()
    try:
        waiting = {asked.process.pid for asked in service.processes.waiting()}
        answers = asyncio.run(told(service, turn()))
        again = {asked.process.pid for asked in service.processes.waiting()}
        everybody = [*service.processes.waiting()]
    finally:
        service.close()
    assert answers
    assert len(waiting & again) == len(waiting) - 1 == len(again) - 1  # another one waits in its place
    assert not any(asked.process.is_alive() for asked in everybody)
