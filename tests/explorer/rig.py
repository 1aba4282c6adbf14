"""An explorer under test: its keys pressed, its screen read back, its answers computed once for all tests."""

from __future__ import annotations

import asyncio
import pickle
from collections.abc import AsyncIterator, Awaitable, Callable
from functools import cache
from multiprocessing import resource_tracker

from textual.pilot import Pilot
from textual.widgets import Input

from hdassist.interface.explorer.app import Explorer, Form
from hdassist.interface.explorer.compute import Effort
from hdassist.interface.explorer.service import Question
from hdassist.interface.explorer.state import Session, opened_state
from hdassist.run.errors import HdassistError
from tests.helpers.process import TINY, no_processes

QUICK = Effort(draws=8, jobs=1)
FEW = ("operation.M_g=[4.0]", "mounting.holes=6")  # states
LONGEST = 60.0  # s


class Recorded:
    """A service that computes in this process, each question once."""

    def __init__(self) -> None:
        self.asked: list[Question] = []
        resource_tracker.ensure_running()  # inherits a stream that the screen takes away

    async def ask(self, question: Question) -> AsyncIterator[tuple[str, object]]:
        self.asked.append(question)
        for each in _answers(pickle.dumps(question)):
            await asyncio.sleep(0)
            yield each

    def close(self) -> None:
        pass


@cache
def _answers(pickled: bytes) -> list[tuple[str, object]]:
    found: list[tuple[str, object]] = []
    try:
        with no_processes():
            pickle.loads(pickled)(lambda *answer: found.append(answer))
    except HdassistError as error:
        found.append(("failed", error))
    return found


def tiny(*overrides: str) -> Session:
    """The tiny drive at one torque, with six holes, and more on top."""
    return opened_state(TINY, (*FEW, *overrides))


def explored(
    act: Callable[[Explorer, Pilot[int]], Awaitable[None]],
    session: Session | None = None,
    size: tuple[int, int] = (100, 30),
    ascii: bool = False,
) -> Explorer:
    """Run an explorer without a terminal, do something with it once its first answers are there, and give it back."""
    # Recorded stands in for the service: it has what the explorer calls of it, and no processes
    app = Explorer(session or tiny(), Recorded(), QUICK, ascii=ascii)  # type: ignore[arg-type]

    async def run() -> None:
        async with app.run_test(size=size) as pilot:
            await settled(app, pilot)
            await act(app, pilot)

    asyncio.run(run())
    return app


async def settled(app: Explorer, pilot: Pilot[int]) -> None:
    """Wait until all that was asked is answered and drawn."""
    await pilot.pause()
    await app.workers.wait_for_complete()
    await pilot.pause()


async def typed(pilot: Pilot[int], text: str) -> None:
    """Type a text."""
    named = {" ": "space", ":": "colon", ".": "full_stop", "-": "minus", "/": "slash", "_": "underscore"}
    await pilot.press(*(named.get(letter, letter) for letter in text))


def screen(app: Explorer) -> str:
    """What stands on the screen."""
    rows = app.screen._compositor.render_strips()
    return "\n".join("".join(segment.text for segment in row) for row in rows)


def said(app: Explorer) -> str:
    """What was notified."""
    return "\n".join(notification.message for notification in app._notifications)


def F_ior(app: Explorer, rotation_deg: float) -> float:
    """F'_ior in a position, as the holes have it."""
    curve = app.known.curve
    assert curve is not None
    place = curve.place(rotation_deg)
    assert place is not None
    return float(curve.F_ior_arcsec[1, 0, place])


async def to_lever(app: Explorer, pilot: Pilot[int], path: str) -> None:
    if path not in app.levers.rows:  # no part of the drive: it has to be looked for
        app.wanted.value = path
        await pilot.pause()
    app.levers.focus()
    await pilot.pause()  # from then on the cursor stays on its field when others are ranked above it
    app.levers.move_cursor(row=app.levers.get_row_index(path))
    await pilot.pause()


async def known_is(app: Explorer, pilot: Pilot[int], text: str) -> None:
    """Type what is known of the drive, and wait for the answer."""
    await pilot.press("e")
    await filled(app, pilot, text)
    await settled(app, pilot)
    assert not isinstance(app.screen, Form), screen(app)


async def filled(app: Explorer, pilot: Pilot[int], text: str) -> None:
    """Fill a text in the form that is open, and take it."""
    app.screen.query_one(Input).value = text
    await pilot.press("enter")
    await pilot.pause()
