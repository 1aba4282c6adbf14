"""The picture of docs/design.md, made by the explorer itself: python -m benchmarks.explorer_pictures."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from pathlib import Path

PICTURE = Path(__file__).parents[1] / "docs/pictures/explorer-80x24.svg"
PRESET = "vzp160"
SIZE = 80, 24  # columns, rows
BEST_HOLE = "b"  # key
LONGEST = 300.0  # s that the explorer may compute


def main() -> None:
    """Write the picture."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    PICTURE.write_text(asyncio.run(picture()), encoding="utf-8")


async def picture() -> str:
    """The SVG of the screen, the wheel in the best hole."""
    from hdassist.explorer.app import Explorer
    from hdassist.explorer.export import without_fonts
    from hdassist.explorer.service import Service
    from hdassist.explorer.state import opened_state

    service = Service()
    app = Explorer(opened_state(PRESET, ()), service, dark=True)
    try:
        async with app.run_test(size=SIZE) as pilot:

            async def wait_until(done: Callable[[], object]) -> None:
                for _ in range(round(LONGEST / 0.1)):
                    await pilot.pause(0.1)
                    if done():
                        await pilot.pause(1.0)
                        return
                raise TimeoutError(f"{PRESET}: no answer in {LONGEST:g} s")

            await wait_until(lambda: app.known.advice and not app.busy)
            await pilot.press(BEST_HOLE)
            await wait_until(lambda: not app.busy)
            return without_fonts(app.export_screenshot(title=f"hdassist explore {PRESET}"))
    finally:
        service.close()


if __name__ == "__main__":
    main()
