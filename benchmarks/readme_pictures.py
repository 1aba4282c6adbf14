"""The answer that README and index show, as a terminal has it: `python -m benchmarks.readme_pictures`."""

from __future__ import annotations

import io
import os
import pty
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.color import Color
from rich.console import Console
from rich.terminal_theme import DIMMED_MONOKAI, TerminalTheme
from rich.text import Text

from hdassist.explorer.app import without_fonts

COMMAND = ("mount", "vzp160")
FIGURES = Path(__file__).parents[1] / "docs/figures"
COLOURS = ("#24292e", "#b31d28", "#22863a", "#9a6700", "#0366d6", "#5a32a3", "#1b7c83", "#57606a")  # readable on white
LIGHT = TerminalTheme((255, 255, 255), (36, 41, 46), [Color.parse(c).get_truecolor() for c in COLOURS])
COLUMNS = 80


def on_terminal(command: tuple[str, ...], folder: str) -> str:
    """What a command writes to a terminal of COLUMNS, with its colours."""
    ours, theirs = pty.openpty()
    named = {"COLUMNS": str(COLUMNS), "TERM": "xterm-256color", "PYTHONPATH": str(FIGURES.parents[1])}
    process = subprocess.Popen(
        [sys.executable, "-m", "hdassist", *command], cwd=folder, stdout=theirs, stderr=subprocess.DEVNULL,
        stdin=subprocess.DEVNULL, env=os.environ | named,
    )  # fmt: skip
    os.close(theirs)
    written = b""
    while True:
        try:
            more = os.read(ours, 65536)
        except OSError:  # the other end is closed
            break
        if not more:
            break
        written += more
    process.wait()
    return written.decode().replace("\r\n", "\n")


def main() -> None:
    with TemporaryDirectory() as folder:
        answer = on_terminal(COMMAND, folder)
    for kind, theme in (("light", LIGHT), ("dark", DIMMED_MONOKAI)):
        console = Console(record=True, width=COLUMNS, file=io.StringIO(), highlight=False, force_terminal=True)
        console.print(Text(f"$ hdassist {' '.join(COMMAND)}\n", style="bold"))
        console.print(Text.from_ansi(answer.rstrip()))
        svg = console.export_svg(title="hdassist", theme=theme, unique_id=f"mount-{kind}")
        (FIGURES / f"mount-{kind}.svg").write_text(without_fonts(svg) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
