"""Screens of README and docs as a terminal has them: `python -m benchmarks.readme_pictures [NAME...]`.

Each is light or dark as the reader's screen is. tests/test_pictures.py holds them to what the commands print.
"""

from __future__ import annotations

import io
import os
import pty
import re
import shlex
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.color import Color
from rich.console import Console
from rich.terminal_theme import DIMMED_MONOKAI, TerminalTheme
from rich.text import Text

from hdassist.explorer.app import without_fonts

PICTURES = Path(__file__).parents[1] / "docs/pictures"
SCREENS = {  # by the name of the picture
    name: f"hdassist {arguments}"
    for name, arguments in {
        "check": "check vzp160", "mount": "mount vzp160", "tolerance": "tolerance vzp160 --limit 30",
        "compensate": "compensate vzp160", "plan": "plan vzp160", "stiffness": "stiffness size-25-100",
    }.items()
}  # fmt: skip
COLOURS = ("#24292e", "#b31d28", "#22863a", "#9a6700", "#0366d6", "#5a32a3", "#1b7c83", "#57606a")  # readable on white
LIGHT = TerminalTheme((255, 255, 255), (36, 41, 46), [Color.parse(c).get_truecolor() for c in COLOURS])
COLUMNS = 80


def main() -> None:
    """Write the pictures that are named, or all."""
    for name in sys.argv[1:] or SCREENS:
        with TemporaryDirectory() as folder:
            picture = drawn(name, on_terminal(shlex.split(SCREENS[name])[1:], folder))
        (PICTURES / f"{name}.svg").write_text(picture, encoding="utf-8")


def on_terminal(command: list[str], folder: str) -> str:
    """What a command writes to a terminal of COLUMNS, with its colours."""
    ours, theirs = pty.openpty()
    named = {"COLUMNS": str(COLUMNS), "TERM": "xterm-256color", "PYTHONPATH": str(PICTURES.parents[1])}
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


def drawn(name: str, answer: str) -> str:
    """One SVG of a command and its answer, with the colours of a dark terminal where the reader's screen is dark."""
    console = Console(record=True, width=COLUMNS, file=io.StringIO(), highlight=False, force_terminal=True)
    console.print(Text(f"$ {SCREENS[name]}\n", style="bold"))
    page = Text.from_ansi(answer.rstrip())
    page.highlight_regex("[\u2800-\u28ff]+", "default")  # apart, as few fonts have dots as wide as letters
    console.print(page)
    light, dark = (
        without_fonts(console.export_svg(title="hdassist", theme=theme, unique_id=name, clear=False))
        for theme in (LIGHT, DIMMED_MONOKAI)
    )
    light = re.sub(
        r'<clipPath id="[^"]*-line-.*?</clipPath>\s*| clip-path="[^"]*-line-[^"]*"', "", light, flags=re.DOTALL
    )
    light = light.replace(f'<rect fill="{LIGHT.background_color.hex}"', '<rect class="paper" fill="#ffffff"', 1)
    rules = "".join(re.findall(rf"\.{name}-r\d+ {{.*?}}", dark))
    paper, ink = DIMMED_MONOKAI.background_color.hex, DIMMED_MONOKAI.foreground_color.hex
    rules += f".paper{{fill:{paper}}}.{name}-title{{fill:{ink}}}"
    return light.replace("</style>", f"@media (prefers-color-scheme: dark){{{rules}}}</style>", 1) + "\n"


if __name__ == "__main__":
    main()
