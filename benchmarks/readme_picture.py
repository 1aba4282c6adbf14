"""The picture of the README, light and dark: `hdassist mount vzp160` at one torque."""

from __future__ import annotations

import io
from pathlib import Path

from rich.console import Console
from rich.terminal_theme import DIMMED_MONOKAI, TerminalTheme
from rich.text import Text

from hdassist.explorer.export import without_fonts
from tests.process import run

COMMAND = ("mount", "vzp160", "--torque", "80", "--set", "bearing.g_b=0")
FIGURES = Path(__file__).parents[1] / "docs/figures"
LIGHT = TerminalTheme((255, 255, 255), (36, 41, 46), DIMMED_MONOKAI.ansi_colors._colors)


def main() -> None:
    done = run(*COMMAND)
    assert done.returncode == 0, done.stderr
    for name, theme in (("light", LIGHT), ("dark", DIMMED_MONOKAI)):
        console = Console(record=True, width=80, file=io.StringIO(), highlight=False)
        console.print(Text(f"$ hdassist {' '.join(COMMAND)}\n", style="bold"))
        console.print(Text(done.stdout.rstrip()))
        svg = console.export_svg(title="hdassist", theme=theme, unique_id=f"mount-{name}")
        (FIGURES / f"mount-{name}.svg").write_text(without_fonts(svg) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
