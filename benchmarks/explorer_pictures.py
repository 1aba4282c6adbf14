"""The pictures of docs/design.md, made by the explorer itself on the path described there.

`python -m benchmarks.explorer_pictures` takes a few minutes; it prints the top of the screen after each step.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import tempfile
from pathlib import Path

PICTURES = Path(__file__).parents[1] / "docs/pictures"
CATALOGUE = (
    "--pitch-diameter", "63.5", "--ratio", "100", "--torque", "67",
    "--stiffness", "3.1e4,5.0e4,5.7e4", "--lost-motion", "60", "--accuracy", "60",
)  # fmt: skip
STEPS = ("limit=45", "supports.C_3=1000 ± 100", "h0=29 ± 3")  # typed one after the other
VIEWS = {(80, 24): "6", (100, 30): "1", (140, 40): "1"}  # size in columns and rows: key of the view
LONGEST = 1800.0  # s that the explorer may compute


def main() -> None:
    """Write the pictures."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from hdassist.cli.main import run_command_line

    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        import sys

        sys.argv = ["hdassist", "presets", "new", "own", *CATALOGUE, "-o", "own.yaml"]
        with contextlib.suppress(SystemExit):
            run_command_line()
        for name, svg in asyncio.run(pictures()).items():
            (PICTURES / name).write_text(svg, encoding="utf-8")


async def pictures() -> dict[str, str]:
    """The SVG of the screen at each size, at the end of the path, by file name."""
    from textual.widgets import Input

    from hdassist.explorer.app import Explorer
    from hdassist.explorer.export import without_fonts
    from hdassist.explorer.service import Service
    from hdassist.explorer.state import opened_state

    service = Service()
    app = Explorer(opened_state("own.yaml", ("operation.M_g=[6.7]",)), service)
    made = {}
    try:
        async with app.run_test(size=(140, 40)) as pilot:

            async def settle(*, whole: bool = False) -> None:
                for _ in range(round(LONGEST / 0.2)):
                    await pilot.pause(0.2)
                    at_work = any(not worker.is_finished for worker in app.workers)
                    done = not at_work if whole else app.known.page
                    if done:
                        await pilot.pause(1.5)
                        if not whole or not any(not worker.is_finished for worker in app.workers):
                            return
                raise TimeoutError(f"no answer in {LONGEST:g} s")

            await settle()
            for step in STEPS:
                await pilot.press("e")
                app.screen.query_one(Input).value = step
                await pilot.press("enter")
                await settle()
                print(
                    f"{step}\n" + "\n".join(rows(app)[:3]) + f"\n{app.known.check and app.known.check.to_measure[:3]}"
                )
            await settle(whole=True)
            for (columns, lines), key in VIEWS.items():
                await pilot.resize_terminal(columns, lines)
                await pilot.press(key)
                await settle(whole=True)
                svg = app.export_screenshot(title="hdassist explore own.yaml")
                made[f"explorer-{columns}x{lines}.svg"] = without_fonts(svg)
    finally:
        service.close()
    return made


def rows(app: object) -> list[str]:
    """The lines of the screen."""
    # Textual has no public way to the cells of a screen
    strips = app.screen._compositor.render_strips()  # type: ignore[attr-defined]
    return ["".join(segment.text for segment in strip).rstrip() for strip in strips]


if __name__ == "__main__":
    main()
