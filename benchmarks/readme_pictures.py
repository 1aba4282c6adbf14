"""Pictures of terminal screens and of the report for README and docs: `python -m benchmarks.readme_pictures [NAME...]`.

Their colours follow the light or dark scheme of the reader. tests/explorer/test_pictures.py compares them with the
output of the commands.
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

from hdassist.interface.explorer.app import without_fonts

PICTURES = Path(__file__).parents[1] / "docs/pictures"
SCREENS = {  # commands by name of the picture
    name: f"hdassist {arguments}"
    for name, arguments in {
        "check": "check vzp160", "mount": "mount vzp160", "tolerance": "tolerance vzp160 --limit 30",
        "compensate": "compensate vzp160", "plan": "plan vzp160", "stiffness": "stiffness size-25-100",
        "measure": "measure cycle.csv --drive vzp160", "compare": "compare vzp160 turned.csv --torque 80 --phi-g0 20",
        "accept": "accept lot.csv --preset vzp160 --measured-only",
    }.items()
}  # fmt: skip
REPORT = "hdassist report vzp160 -o vzp160.html"
_REPORT_SIZE = 1000, 770  # px; width of the page, and height that shows the first figures in usual fonts
COLOURS = ("#24292e", "#b31d28", "#22863a", "#9a6700", "#0366d6", "#5a32a3", "#1b7c83", "#57606a")  # readable on white
LIGHT = TerminalTheme((255, 255, 255), (36, 41, 46), [Color.parse(c).get_truecolor() for c in COLOURS])
COLUMNS = 80


def main() -> None:
    """Write the named pictures, or all pictures if none is named."""
    for name in sys.argv[1:] or [*SCREENS, "report"]:
        with TemporaryDirectory() as folder:
            if name == "report":
                on_terminal(REPORT, folder)
                picture = first_figures(Path(folder, "vzp160.html").read_text("utf-8"))
            else:
                write_input(name, folder)
                picture = drawn(name, on_terminal(SCREENS[name], folder))
        (PICTURES / f"{name}.svg").write_text(picture, encoding="utf-8")


def write_input(name: str, folder: str | Path) -> None:
    """Write the recording or the lot that a command reads, as in the examples of its page.

    name: name of the picture.
    folder: working folder.
    """
    docs = PICTURES.parent
    if name == "accept":
        lot = (docs / "accept.md").read_text("utf-8").partition("cat > lot.csv <<'END'\n")[2]
        Path(folder, "lot.csv").write_text(lot.partition("END\n")[0], encoding="utf-8")
    elif name in ("measure", "compare"):
        record = next(word for word in SCREENS[name].split() if word.endswith(".csv"))
        traces = re.findall(r"^hdassist trace .*$", (docs / "measure.md").read_text("utf-8"), re.MULTILINE)
        on_terminal(next(line for line in traces if f"--csv {record} " in line), folder)


def on_terminal(command: str, folder: str | Path) -> str:
    """Return the output of a command on a terminal of COLUMNS, with its colours."""
    ours, theirs = pty.openpty()
    named = {"COLUMNS": str(COLUMNS), "TERM": "xterm-256color", "PYTHONPATH": str(PICTURES.parents[1])}
    process = subprocess.Popen(
        [sys.executable, "-m", *shlex.split(command)], cwd=folder, stdout=theirs, stderr=subprocess.DEVNULL,
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
    """Return the SVG of a command and its output, with the colours of a dark terminal for dark screens.

    name: name of the picture.
    answer: output of the command.
    """
    console = Console(record=True, width=COLUMNS, file=io.StringIO(), highlight=False, force_terminal=True)
    console.print(Text(f"$ {SCREENS[name]}\n", style="bold"))
    page = Text.from_ansi(answer.rstrip())
    # dots get spans of their own, because in most fonts they are not as wide as letters
    page.highlight_regex("[\u2800-\u28ff]+", "default")
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


def first_figures(page: str) -> str:
    """Return the SVG of a report down to its first figures, which embeds the page itself."""
    width, height = _REPORT_SIZE
    style = page.partition("<style>")[2].partition("</style>")[0].partition("@media (max-width")[0]  # for one width
    body = page.partition("<body>")[2].partition('<div class="rest">')[0]
    return f"""<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}"
 style="width: {width}px; height: {height}px; overflow: hidden; background: var(--paper)"><style>{style}</style>
<foreignObject width="{width}" height="{height}"><body xmlns="http://www.w3.org/1999/xhtml">{body}</section></main></body>
</foreignObject><rect width="{width}" height="{height}" fill="none" stroke="var(--line)" stroke-width="4"/></svg>
"""


if __name__ == "__main__":
    main()
