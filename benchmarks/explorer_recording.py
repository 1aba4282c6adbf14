"""The animation in the README, an SVG of the explorer in which the wheel of vzp160 is turned hole by hole.

`python -m benchmarks.explorer_recording` takes a minute or two. Viewers without animation show the last screen.
"""

from __future__ import annotations

import asyncio
import os
import re
from pathlib import Path

from benchmarks.explorer_pictures import at_rest

RECORDING = Path(__file__).parents[1] / "docs/pictures/explorer.svg"
PRESET, SIZE = "vzp160", (100, 30)  # columns and rows of the terminal
SCREEN, LAST = 1.2, 4.0  # s; time for which each screen, and the last screen, is shown


def main() -> None:
    """Write the animation."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    RECORDING.write_text(moving(asyncio.run(screens())), encoding="utf-8")


async def screens() -> list[str]:
    """Return the screens as SVG: after opening, with the wheel turned by one hole each time, and in the best hole."""
    from hdassist.interface.explorer.app import Explorer
    from hdassist.interface.explorer.service import Service
    from hdassist.interface.explorer.state import opened_state

    service = Service()
    app = Explorer(opened_state(PRESET, ()), service)
    pictures = []
    try:
        async with app.run_test(size=SIZE) as pilot:
            for key in ("1", *["right"] * 7, "b"):
                await pilot.press(key)
                await at_rest(app, pilot)
                pictures.append(app.export_screenshot(title=f"hdassist explore {PRESET}"))
    finally:
        service.close()
    return pictures


def moving(pictures: list[str]) -> str:
    """Return one SVG that shows pictures of the same size one after another, in an endless loop."""
    from hdassist.interface.explorer.app import without_fonts

    bare = [re.sub(r'<clipPath id="[^"]*-line-.*?</clipPath>\s*| clip-path="[^"]*-line-[^"]*"', "", p, flags=re.DOTALL)
            for p in map(without_fonts, pictures)]  # fmt: skip
    (opening,) = re.findall(r"<svg [^>]*>", bare[0])
    whole, frames = SCREEN * (len(bare) - 1) + LAST, []
    for k, picture in enumerate(bare):
        name, begin = f"s{k}", 100 * SCREEN * k / whole
        end = 100.0 if picture is bare[-1] else 100 * SCREEN * (k + 1) / whole
        steps = f"0%{{opacity:0}}{begin:.3f}%{{opacity:1}}{end:.3f}%{{opacity:0}}"
        rule = f"@keyframes {name}{{{steps}}}#{name}{{animation:{name} {whole:g}s step-end infinite}}"
        inner = picture[picture.index(">", picture.index("<svg")) + 1 : picture.rindex("</svg>")]
        frames.append(f'<style>{rule}</style><g id="{name}">{inner}</g>')
    return "\n".join([opening, "<title>The fixed wheel turned hole by hole</title>", *frames, "</svg>\n"])


if __name__ == "__main__":
    main()
