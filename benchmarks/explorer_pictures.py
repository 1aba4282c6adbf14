"""The example of docs/explore.md: its keys are typed into the explorer, and the final screen is drawn.

`python -m benchmarks.explorer_pictures` takes a few minutes. It prints the top of the screen after each line of keys.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import shlex
import sys
import tempfile
from collections.abc import AsyncIterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from textual.pilot import Pilot

    from hdassist.interface.explorer.app import Explorer

DOCS = Path(__file__).parents[1] / "docs"
VIEWS = {(80, 24): "6", (100, 30): "1", (140, 40): "1"}  # size in columns and rows: key of the view
LONGEST = 1800.0  # s; time limit of a computation


def main() -> None:
    """Write the pictures in a temporary working folder."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        asyncio.run(write_pictures())


async def write_pictures() -> None:
    """Type the keys of the example, and write the final screen in each size as SVG."""
    from hdassist.interface.explorer.app import without_fonts

    async for line, app, pilot in played():
        print("\n".join([f"== {line}", *rows(app)[:4]]), flush=True)
        if line == key_lines()[-1]:
            for (columns, lines), key in VIEWS.items():
                await pilot.resize_terminal(columns, lines)
                await pilot.press(key)
                await at_rest(app, pilot)
                svg = without_fonts(app.export_screenshot(title="hdassist explore mine.yaml"))
                (DOCS / f"pictures/explorer-{columns}x{lines}.svg").write_text(svg, encoding="utf-8")


def key_lines() -> list[str]:
    """Return the lines of keys in the page, each with a key and a text to fill in."""
    page = (DOCS / "explore.md").read_text(encoding="utf-8")
    block = re.search(r"```none\nhdassist explore mine\.yaml --torque 6\.7\n(.*?)```", page, flags=re.DOTALL)
    assert block
    return block[1].splitlines()


async def played() -> AsyncIterator[tuple[str, Explorer, Pilot[int]]]:
    """Yield each line of keys with the explorer and its pilot, after all computations for this line.

    The preset of the page is made in the working folder.
    """
    from textual.widgets import Input

    from hdassist.interface.cli import run_command_line
    from hdassist.interface.explorer.app import Explorer
    from hdassist.interface.explorer.service import Service
    from hdassist.interface.explorer.state import opened_state

    new = re.search(r"^hdassist presets new mine .*$", (DOCS / "explore.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert new
    sys.argv = shlex.split(new[0])
    with contextlib.suppress(SystemExit):
        run_command_line()
    service = Service()
    app = Explorer(opened_state("mine.yaml", ("operation.M_g=[6.7]",)), service)
    try:
        async with app.run_test(size=(140, 40)) as pilot:
            await at_rest(app, pilot)
            for line in key_lines():
                key, _, text = line.partition(" ")
                await pilot.press(key)
                if text:
                    line_to_fill = app.screen.query_one(Input)
                    line_to_fill.focus().value = text
                    await pilot.pause()
                    await pilot.press("enter")
                await at_rest(app, pilot)
                if len(app.screen_stack) > 1:
                    raise RuntimeError("\n".join([f"{line}: a question is open", *rows(app)]))
                yield line, app, pilot
    finally:
        service.close()


async def at_rest(app: Explorer, pilot: Pilot[int]) -> None:
    """Wait until all computations have ended. Raises TimeoutError after LONGEST."""
    quiet = 0
    for _ in range(round(LONGEST / 0.2)):
        await pilot.pause(0.2)
        quiet = 0 if any(not worker.is_finished for worker in app.workers) else quiet + 1
        if quiet * 0.2 > 1.5:  # s; longer than the delay before the input revolution and the levers are requested
            return
    raise TimeoutError(f"no answer in {LONGEST:g} s")


def rows(app: Explorer) -> list[str]:
    """Return the lines of the screen."""
    # Textual has no public access to the cells of a screen
    strips = app.screen._compositor.render_strips()
    return ["".join(segment.text for segment in strip).rstrip() for strip in strips]


if __name__ == "__main__":
    main()
