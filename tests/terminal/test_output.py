"""What goes to a terminal: our colours, and of other people's text only what is seen."""

from __future__ import annotations

import io
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock

import pytest
from rich.table import Table
from rich.text import Text

from hdassist.features.report import Facts, Report
from hdassist.features.report import Table as TableBlock
from hdassist.interface.terminal import output
from hdassist.interface.terminal.output import Output, complain
from hdassist.interface.terminal.page import report_page
from hdassist.interface.terminal.streams import Style
from hdassist.run.errors import DataError
from tests.conftest import ROOT
from tests.helpers.paper import on_paper
from tests.helpers.process import SMALL, TINY, on_terminal, posix_only, run
from tests.test_hidden import EVERY_HIDDEN, hidden

NAME = "a\x1b]0;owned\x07\u202e[/bold]b"
TOLD = "a\\x1b]0;owned\\x07\\u202e[/bold]b"
OURS = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\r")  # colours of rich, and the moves of its progress bar


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@contextmanager
def terminal() -> Iterator[Terminal]:
    """A terminal of 120 columns in place of both streams."""
    stream = Terminal()
    clean = {"TERM": "xterm-256color", "COLUMNS": "120", "NO_COLOR": "", "LC_ALL": "C.UTF-8"}
    with mock.patch.multiple(sys, stdout=stream, stderr=stream), mock.patch.dict(os.environ, clean):
        yield stream


@pytest.mark.parametrize("codes", [True, False])
def test_pages_have_our_colours_and_nothing_hidden(codes: bool) -> None:
    grid = Table(title=Text(NAME), style="red")
    grid.add_column(Text("head", style="bold"))
    grid.add_row(NAME)
    grid.add_row(Text(EVERY_HIDDEN))
    with terminal() as stream:
        Output(Style(False, codes, 120)).human(grid)
    sent = stream.getvalue()
    assert ("\x1b[" in sent) == codes
    assert not hidden(OURS.sub("", sent))
    assert "┃" in sent and "\\x1b]0;owned" in sent


def test_text_and_messages_have_nothing_hidden() -> None:
    with terminal() as stream:
        Output(Style(False, True, 120)).text(NAME + "\n")
        complain(DataError(NAME, NAME), NAME)
    assert stream.getvalue() == f"{TOLD}\nerror: {TOLD}: {TOLD}\n  hint: {TOLD} (hdassist explain DATA)\n"


def test_style_escapes_before_it_makes_seven_bits() -> None:
    assert Style(True, True, 80).text("5 µm\x1b[2J\u202e") == "5 um\\x1b[2J\\u202e"


def test_words_beside_a_bar_are_no_markup(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(output, "BAR_PATIENCE", -1.0)
    with terminal() as stream, Output(Style(False, True, 120)).progress(NAME, 2) as advance:
        advance(1)
    assert TOLD in OURS.sub("", stream.getvalue())
    assert not hidden(OURS.sub("", stream.getvalue()))


@pytest.mark.parametrize(
    "args",
    [
        *(
            [*command.split(), "µ±.yaml"]
            for command in (
                "check", "trace", "stiffness", "tolerance", "sensitivity", "allocate", "report", "mount",
                "measure", "accept", "explain", "presets show", "presets validate",
            )
        ),
        ["trials", "µ±.yaml", "h0=1"], ["compare", "µ±.yaml", "run.csv"], ["doctor", "µ±"],
        ["sweep", "µ±.yaml", "--vary", "gears.j_n=0:9:3"], ["calibrate", "µ±.yaml", "--targets", "µ±"],
        ["check", "vzp160", "--µ±"], ["check", SMALL, "--set", "µ±=1"],
        ["accept", SMALL, "--limit", "µ±"],
    ],
)  # fmt: skip
def test_seven_bits_on_stderr_too(args: list[str]) -> None:
    wide, narrow = run(*args), run(*args, "--ascii")
    assert "µ±" in wide.stderr
    assert "u+-" in narrow.stderr
    assert narrow.stderr.isascii()
    assert narrow.returncode == wide.returncode


def test_messages_wrap_between_words_and_write_units_like_pages() -> None:
    code, told = on_terminal("presets", "show", "nosuch", columns=60)
    lines = told.splitlines()
    assert (code, lines[0]) == (4, "error: no such preset or file: nosuch")
    assert len(lines) > 3 and max(map(len, lines)) <= 60
    assert all(line.startswith("    ") for line in lines[2:])  # what goes on stands further in
    assert told.split() == run("presets", "show", "nosuch").stderr.split()  # in a pipe it is one line
    wrong = ("check", TINY, "--limit", "F_ior@7=30")
    assert "7 N·m" in run(*wrong).stderr
    assert "7 N*m" in run(*wrong, "--ascii").stderr
    assert "\nerror: " in run("check", TINY, "--foo").stderr


def test_ctrl_c_leaves_no_bar_and_shows_the_cursor() -> None:
    """The line of the bar is emptied by codes of the terminal, not by their letters, and the cursor comes back."""
    code, sent = on_terminal("check", "vzp160", "--set", "gears.j_n=0.37", columns=80, interrupt_at=b" % ")
    assert code == 130
    assert "\\x1b" not in sent
    assert sent.endswith("\r\x1b[2K\x1b[?25hinterrupted\n")


def test_a_bar_of_seven_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(output, "BAR_PATIENCE", -1.0)
    monkeypatch.setattr(sys, "argv", ["hdassist", "check", "--ascii"])
    with terminal() as stream, Output(Style(False, True, 120)).progress("5 µm", 2) as advance:
        advance(1)
    assert "5 um" in stream.getvalue()
    assert stream.getvalue().isascii()


@pytest.mark.parametrize("columns", [60, 80, 100, 140])
def test_a_table_of_ranges_is_one_table_without_broken_words(columns: int) -> None:
    at = ["16.08 (14.6-16.9)", "11.85 (10.9-12.6)"]
    rows = [["best", "8", *at, "100", "100", "0.0"], ["worst", "3", *at, "0", "0", "148.7"]]
    heads = ("", "hole", "at 80 N·m", "at 800 N·m", "better", "good", "loss")
    style = Style(ascii=False, codes=False, width=columns)
    report = Report("mount", None, "x", blocks=(TableBlock("", heads, tuple(map(tuple, rows))),))
    page = Output(style).page(report_page(report, style))
    assert max(map(len, page.splitlines())) <= columns
    assert page.count("─\n") == 1
    assert {word for row in rows for cell in row for word in cell.split()} <= set(page.split())
    assert set(" ".join(heads).split()) <= set(page.split())


def test_every_character_of_pages_has_a_seven_bit_form() -> None:
    texts = [path.read_text("utf-8") for path in (ROOT / "hdassist/interface/pages").glob("*.py")]
    texts += [(ROOT / "hdassist/interface/terminal/languages/en.yaml").read_text("utf-8")]
    strange = {letter for text in texts for letter in text if not letter.isascii()}
    assert "?" not in Style(ascii=True, codes=False, width=80).text("".join(strange))


@posix_only("a shell")
@pytest.mark.parametrize("width", [60, 80, 200])
def test_a_command_that_breaks_is_the_same_to_a_shell(width):
    words = [
        "own.yaml",
        "--set",
        "catalogue.K_1=3 kN·m/rad",
        "--set",
        "name=a 'b' c",
        *(f"h{k}=3{k}.25" for k in range(9)),
    ]
    facts = Facts.of(
        [("next", shlex.join(["hdassist", *words])), ("limit", "30″ with 90 %, and no word of it is a command")]
    )
    page = on_paper(Report("mount", None, "own", blocks=(facts,)), width)
    lines = page[page.index("next") : page.index("limit")].rstrip().splitlines()
    assert max(map(len, lines)) <= width
    assert [line.endswith(" \\") for line in lines] == [True] * (len(lines) - 1) + [False]
    assert (len(lines) == 1) == (width == 200)
    assert not any(line.endswith("--set \\") for line in lines)  # an option stands beside its value
    typed = "\n".join(lines).replace("next   hdassist", "printf '%s\\n'")
    assert subprocess.run(["sh", "-c", typed], capture_output=True, text=True, check=True).stdout.splitlines() == words
