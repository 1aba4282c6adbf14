"""Pictures of the docs show the last code: screens of commands by their words, the explorer by its tabs and keys."""

from __future__ import annotations

import re
import shlex
from html import unescape
from pathlib import Path
from xml.etree import ElementTree

import pytest
from textual.pilot import Pilot

from benchmarks.explorer_pictures import VIEWS, rows
from benchmarks.readme_pictures import REPORT, SCREENS, first_figures, write_input
from hdassist.interface.explorer.app import Explorer
from tests.conftest import ROOT
from tests.explorer.rig import explored
from tests.helpers.process import run
from tests.test_pages import alike

PICTURES = ROOT / "docs/pictures"
LARGEST = 2_000_000  # bytes
CELL = 12.2  # of a character, its width in a picture


def lines_of(picture: Path) -> list[str]:
    """Lines of text of a picture of a terminal."""
    lines: dict[float, str] = {}
    for about, text in re.findall(r"<text ([^>]*)>([^<]*)</text>", picture.read_text("utf-8")):
        if place := re.search(r'-r\d+" x="([\d.]+)" y="([\d.]+)"', about):  # the title has none
            x, y = map(float, place.groups())
            before, column = lines.get(y, ""), round(x / CELL)
            apart = "  " * (len(before) > column)  # of the next picture of a recording
            lines[y] = before.ljust(column) + apart + unescape(text).replace("\xa0", " ")
    return [lines[y] for y in sorted(lines)]


def above_the_plot(lines: list[str]) -> list[str]:
    """Words of the lines of a page before its plot."""
    plot = next((k for k, line in enumerate(lines) if re.search("[│┤]", line)), len(lines))
    return " ".join(lines[:plot]).split()


@pytest.mark.slow
@pytest.mark.parametrize("name", SCREENS)
def test_a_screen_is_what_its_command_prints(name: str, tmp_path: Path) -> None:
    write_input(name, tmp_path)
    told = run(*shlex.split(SCREENS[name])[1:], cwd=tmp_path).stdout  # 80 columns in a pipe
    shown = above_the_plot(lines_of(PICTURES / f"{name}.svg")[1:])
    printed = above_the_plot(told.splitlines())
    assert len(shown) == len(printed) and all(map(alike, shown, printed)), (
        f"python -m benchmarks.readme_pictures {name}"
    )


def text_of(picture: str) -> list[str]:
    """Words of the picture of a report, which XML takes as it is."""
    drawing = ElementTree.fromstring(picture).find("{*}foreignObject")
    assert drawing is not None
    return " ".join(drawing.itertext()).split()


@pytest.mark.slow
def test_the_picture_of_the_report_is_its_first_page(tmp_path: Path) -> None:
    assert run(*shlex.split(REPORT)[1:], cwd=tmp_path).returncode == 0
    shown = text_of((PICTURES / "report.svg").read_text("utf-8"))
    written = text_of(first_figures((tmp_path / "vzp160.html").read_text("utf-8")))
    assert {"vzp160", "Kinematic"} < set(shown)
    assert len(shown) == len(written) and all(map(alike, shown, written)), "python -m benchmarks.readme_pictures report"


@pytest.mark.thorough
@pytest.mark.parametrize(("columns", "lines"), VIEWS)
def test_explorer_pictures_show_the_current_tabs_and_keys(columns: int, lines: int) -> None:
    names = ["explorer"] * (columns == 100) + [f"explorer-{columns}x{lines}"]

    async def act(app: Explorer, pilot: Pilot[int]) -> None:
        await pilot.press(VIEWS[columns, lines])
        await pilot.pause()
        screen = rows(app)
        tabs = next((line for line in screen if line.startswith("  1 holes")), "").split()
        for name in names:
            words = " ".join(lines_of(PICTURES / f"{name}.svg")).split()
            bottom = screen[max(k for k, line in enumerate(screen) if line.startswith(" = ")) + 1 :]
            keys = re.split(r"  +", "  ".join(bottom).strip())
            for each in (tabs, *(key.split() for key in keys)):
                assert any(words[k : k + len(each)] == each for k in range(len(words))), each

    explored(act, size=(columns, lines))


def test_pictures_are_small_and_each_is_on_a_page() -> None:
    pages = "".join(path.read_text("utf-8") for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
    for picture in PICTURES.iterdir():
        assert picture.stat().st_size < LARGEST
        assert f"pictures/{picture.name}" in pages, picture
