"""Files that the explorer writes, and leaving it."""

from __future__ import annotations

from pathlib import Path

import pytest
from textual.pilot import Pilot
from textual.widgets import Static

from hdassist.drive.loading import load_text
from hdassist.interface.explorer.app import Explorer, Form, Notice
from hdassist.interface.explorer.state import with_evidence
from tests.explorer.rig import FEW, explored, filled, said, screen, tiny, to_lever
from tests.helpers.process import TINY, run

SETS = [word for text in FEW for word in ("--set", text)]


@pytest.mark.thorough
def test_a_picture_is_of_the_screen_and_loads_nothing(tmp_path: Path) -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("g")
        await filled(app, pilot, str(tmp_path / "screen.svg"))
        made = (tmp_path / "screen.svg").read_text()
        assert made.startswith("<svg") and "INPUTS" in made and "@font-face" not in made
        assert "as&#160;SVG" not in made  # of the form

    explored(act)


@pytest.mark.thorough
def test_saved_preset_keeps_its_comments_and_never_overwrites_without_confirmation(tmp_path: Path) -> None:
    original = Path(TINY).read_text()
    there = tmp_path / "mine.yaml"

    async def save(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("s")
        await filled(app, pilot, str(there))

    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await to_lever(app, pilot, "gears.j_n")
        await pilot.press("plus")
        await save(app, pilot)
        wanted = original.replace("j_n: 18", "j_n: 19").replace("[1, 4]", "[4.0]")
        assert there.read_text() == f"{wanted}mounting:\n  holes: 6\n"
        assert load_text(there.read_bytes(), str(there)).gears.j_n == 19 and f"wrote {there}" in said(app)
        there.write_text("precious")
        await save(app, pilot)
        assert isinstance(app.screen, Notice)
        await pilot.press("n")
        assert there.read_text() == "precious"
        await save(app, pilot)
        await pilot.press("y")
        assert "j_n: 19" in there.read_text()

    explored(act)


@pytest.mark.thorough
def test_quitting_asks_for_confirmation_while_changes_are_unsaved(tmp_path: Path) -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await to_lever(app, pilot, "gears.j_n")
        await pilot.press("plus", "q")
        await pilot.pause()
        assert "Quit?" in screen(app) and "gears.j_n=19" in screen(app)
        await pilot.press("n", "u", "q")
        await pilot.pause()
        assert "Quit?" in screen(app)
        await pilot.press("n", "r", "s")
        await filled(app, pilot, str(tmp_path / "mine.yaml"))
        await pilot.press("q")
        await pilot.pause()
        assert not app.is_running

    explored(act)


@pytest.mark.thorough
def test_quitting_needs_no_confirmation_if_all_data_were_typed_before() -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("q")
        await pilot.pause()
        assert not app.is_running

    explored(act, with_evidence(tiny(), "h0=28.1"))


def wrong(app: Explorer) -> str:
    """What the open form has to say about its text."""
    return str(app.screen.query_one("#wrong", Static).content)


@pytest.mark.thorough
def test_unwritable_file_is_reported_in_the_form_that_stays_open(tmp_path: Path) -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("s")
        await filled(app, pilot, str(tmp_path / "nowhere" / "mine.yaml"))
        assert "cannot write" in wrong(app) and "there is no directory" in wrong(app)
        await filled(app, pilot, str(tmp_path / "mine.yaml"))
        assert (tmp_path / "mine.yaml").exists() and not isinstance(app.screen, Form)

    explored(act)


@pytest.mark.thorough
def test_the_card_is_that_of_the_command(tmp_path: Path) -> None:

    card = tmp_path / "card.txt"
    assert run("mount", TINY, *SETS, "--draws", "8", "-q", "--card", str(card)).returncode == 0

    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("c")
        await filled(app, pilot, str(tmp_path / "card.pdf"))
        assert "use a name that ends in .txt, .html" in wrong(app)
        await filled(app, pilot, str(tmp_path / "mine.txt"))
        assert (tmp_path / "mine.txt").read_text() == card.read_text()

    explored(act)


@pytest.mark.thorough
def test_the_report_is_the_page_of_check(tmp_path: Path) -> None:
    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press("w")
        await filled(app, pilot, str(tmp_path / "page.md"))
        assert app.known.check is not None
        value = f"{app.known.check.points[0].error.F_ior_arcsec:.2f}"
        assert value in (tmp_path / "page.md").read_text()

    explored(act)
