"""Sessions of random keys: whatever is pressed, the explorer goes on, and its command line gives the same drive."""

from __future__ import annotations

import random
import shlex
from pathlib import Path

import pytest
from textual.pilot import Pilot

from hdassist.interface.explorer.app import Explorer
from hdassist.interface.explorer.asking import REST
from hdassist.interface.explorer.state import Session, opened_state, redone, undone
from hdassist.interface.terminal.options import torque_overrides
from tests.explorer.rig import FEW, explored, said, screen, settled
from tests.helpers.process import TINY

LENGTH = 12  # keys of a session
MOVES = ("left", "right", "up", "down", "home", "end", "pageup", "pagedown", "tab", "shift+tab", "b", "0")
VIEWS = ("1", "2", "3", "4", "5", "6", "7", "m", "o", "k", "p", "question_mark", "slash")
CHANGES = ("plus", "minus", "e", "e", "u", "r", "ctrl+z", "ctrl+y", "enter", "enter", "backspace")
ANSWERS = ("escape", "escape", "y", "n", "q", "c", "s", "w")
TEXT = ("h", "1", "5", "full_stop", "equals_sign", "slash", "space", "a", "é", "left_square_bracket")
KEYS = (*MOVES, *MOVES, *VIEWS, *CHANGES, *CHANGES, *ANSWERS, *TEXT)
SIZES = ((80, 24), (100, 30), (140, 44), (60, 18), (40, 12))
DRIVES = ((), ("phases.xi_b=unknown",), ("mounting.holes=0",), ("mounting.allowed=[1, 2]",))


@pytest.fixture(scope="module")
def preset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One place for the preset of all sessions: keys save it, and answers are computed once."""
    return tmp_path_factory.mktemp("sessions") / "tiny.yaml"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(500))
def test_no_key_is_a_fault(seed: int, preset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    preset.write_bytes(Path(TINY).read_bytes())

    def tiny(*overrides: str) -> Session:
        return opened_state(str(preset), (*FEW, *overrides))

    chance = random.Random(seed)
    overrides, size = chance.choice(DRIVES), chance.choice(SIZES)

    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        for _ in range(LENGTH):
            await pilot.press(chance.choice(KEYS))
            if not app.is_running:
                break
            if chance.random() < 0.05:
                await pilot.resize_terminal(*chance.choice(SIZES))
            if chance.random() < 0.02:
                await pilot.pause(REST + 0.1)
        if app.is_running:
            await settled(app, pilot)
            assert {len(row) for row in screen(app).splitlines()} == {app.size.width}

    app = explored(act, tiny(*overrides), size)
    session = app.session
    assert app.return_code in (0, None) and "internal error" not in said(app)
    _, _, name, *words = shlex.split(session.command("check"))
    torques = [word.removeprefix("--torque=") for word in words if word.startswith("--torque=")]
    again = opened_state(name, (*torque_overrides(torques), *(word for word in words if not word.startswith("--"))))
    assert again.drive.model_dump(exclude={"source"}) == session.drive.model_dump(exclude={"source"})
    back = session
    while back.past:
        back = undone(back)
    assert back.changes == () and back.drive == tiny(*overrides).drive
    while back.future:
        back = redone(back)
    assert back.drive == session.drive or session.future
