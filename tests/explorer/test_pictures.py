"""Pictures of the docs show the last code: screens of commands by their words, the explorer by its tabs and keys."""

from __future__ import annotations

import re
import shlex
from html import unescape
from pathlib import Path

import pytest
from textual.pilot import Pilot

from benchmarks.explorer_pictures import VIEWS, rows
from benchmarks.readme_pictures import COLUMNS, SCREENS
from hdassist.explorer.app import Explorer
from tests.conftest import ROOT
from tests.explorer.rig import explored
from tests.process import run
from tests.test_pages import alike

PICTURES = ROOT / "docs/pictures"
LARGEST = 2_000_000  # bytes


def lines_of(picture: Path) -> list[str]:
    """Lines of text of a picture of a terminal, below its title."""
    lines: dict[float, str] = {}
    for _, y, text in re.findall(
        r'<text [^>]*?x="([\d.]+)" y="([\d.]+)"[^>]*>([^<]*)</text>', picture.read_text("utf-8")
    ):
        lines[float(y)] = lines.get(float(y), "") + unescape(text).replace("\xa0", " ")
    return [lines[y] for y in sorted(lines)][1:]


def above_the_plot(lines: list[str]) -> list[str]:
    """Words of the lines of a page before its plot."""
    plot = next((k for k, line in enumerate(lines) if re.search("[│┤]", line)), len(lines))
    return " ".join(lines[:plot]).split()


@pytest.mark.slow
@pytest.mark.parametrize("name", SCREENS)
def test_a_screen_is_what_its_command_prints(name: str) -> None:
    told = run(*shlex.split(SCREENS[name])[1:], env={"COLUMNS": str(COLUMNS)}).stdout
    shown = above_the_plot(lines_of(PICTURES / f"{name}.svg")[1:])
    printed = above_the_plot(told.splitlines())
    assert len(shown) == len(printed) and all(map(alike, shown, printed)), (
        f"python -m benchmarks.readme_pictures {name}"
    )


@pytest.mark.parametrize(("columns", "lines"), [*VIEWS, (100, 30)])
def test_the_explorer_of_the_pictures_has_the_tabs_and_keys_of_today(columns: int, lines: int) -> None:
    names = ["explorer", "explorer-100x30"] if columns == 100 else [f"explorer-{columns}x{lines}"]

    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        screen = rows(app)
        tabs = [line.split() for line in screen if line.startswith("  1 holes")]
        for name in names:
            shown = [line.split() for line in lines_of(PICTURES / f"{name}.svg")]
            assert all(each in shown for each in tabs)
            words = " ".join(" ".join(line) for line in shown)
            assert all(key in words for key in re.split(r"  +", "  ".join(screen[-2:]).strip()))

    explored(act, size=(columns, lines))


def test_pictures_are_small_and_each_is_on_a_page() -> None:
    pages = "".join(path.read_text("utf-8") for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
    for picture in [*PICTURES.iterdir(), *(ROOT / "docs/figures").iterdir()]:
        assert picture.stat().st_size < LARGEST
        assert f"{picture.parent.name}/{picture.name}" in pages, picture
