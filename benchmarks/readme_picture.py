"""The picture of the README, light and dark: `hdassist check` of the drive that its step one makes."""

from __future__ import annotations

import io
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.terminal_theme import DIMMED_MONOKAI, TerminalTheme
from rich.text import Text

from hdassist.explorer.export import without_fonts
from tests.process import run

PRESET = ("presets", "new", "own", "--ratio", "100", "--pitch-diameter", "63.5", "--torque", "67", "-o", "own.yaml")
COMMAND = ("check", "own.yaml", "--torque", "6.7", "--limit", "55")
INCONCLUSIVE = 6  # exit code
FIGURES = Path(__file__).parents[1] / "docs/figures"
LIGHT = TerminalTheme((255, 255, 255), (36, 41, 46), list(DIMMED_MONOKAI.ansi_colors._colors))


def main() -> None:
    with TemporaryDirectory() as folder:
        assert run(*PRESET, cwd=Path(folder)).returncode == 0
        done = run(*COMMAND, cwd=Path(folder))
    assert done.returncode == INCONCLUSIVE, done.stderr
    for name, theme in (("light", LIGHT), ("dark", DIMMED_MONOKAI)):
        console = Console(record=True, width=80, file=io.StringIO(), highlight=False)
        console.print(Text(f"$ hdassist {' '.join(COMMAND)}\n", style="bold"))
        console.print(Text(done.stdout.rstrip()))
        svg = console.export_svg(title="hdassist", theme=theme, unique_id=f"check-{name}")
        (FIGURES / f"check-{name}.svg").write_text(without_fonts(svg) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
