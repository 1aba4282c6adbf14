"""The pictures of docs/explorer.md, made by the explorer itself: python -m benchmarks.explorer_pictures [FOLDER]."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "docs/pictures"
LONGEST = 300.0  # s that a scene may compute
TRIALS = "h0=31.7 h4=14.9 h8=27.9 h5=16.2 h4=15.3"


@dataclass(frozen=True)
class Scene:
    """A picture: its name, columns and rows, keys after the first answer, what is waited for before and after them."""

    name: str
    size: tuple[int, int]
    before: str = "advised"
    keys: tuple[str, ...] = ()
    after: str = "rest"
    trials: str = ""
    dark: bool = True
    preset: str = "vzp160"
    overrides: tuple[str, ...] = ()


SCENES = (
    Scene("explorer-80x24", (80, 24), keys=("b",)),
    Scene("explorer-trials", (100, 30), "trials", trials=TRIALS, overrides=("operation.M_g=[80.0]",), keys=("b",)),
    Scene("explorer-changed", (140, 42), "effects", keys=("l", "minus"), after="effects", dark=False),
    Scene("explorer-unknown", (80, 24), preset="size-17-100"),
)


def main() -> None:
    """Make all pictures, or those whose names are given behind the folder."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    folder, *names = sys.argv[1:] or [str(FOLDER)]
    Path(folder).mkdir(parents=True, exist_ok=True)
    for scene in SCENES:
        if not names or scene.name in names:
            svg = asyncio.run(picture(scene))
            (Path(folder) / f"{scene.name}.svg").write_text(svg, encoding="utf-8")
            print(scene.name)


async def picture(scene: Scene) -> str:
    """The SVG of a scene."""
    from hdassist.explorer.app import Explorer
    from hdassist.explorer.export import without_fonts
    from hdassist.explorer.service import Service
    from hdassist.explorer.state import opened_state, with_trials

    session = opened_state(scene.preset, scene.overrides)
    session = with_trials(session, scene.trials) if scene.trials else session
    service = Service()
    app = Explorer(session, service, dark=scene.dark)
    reached: dict[str, Callable[[], object]] = {
        "advised": lambda: app.known.advice and not app.busy,
        "trials": lambda: app.of_trials and app.of_trials.advice and app.known.advice,
        "effects": lambda: app.known.effects and app.known.effects.steps and not app.busy,
        "rest": lambda: not app.busy,
    }
    try:
        async with app.run_test(size=scene.size) as pilot:

            async def wait(what: str) -> None:
                for _ in range(round(LONGEST / 0.1)):
                    await pilot.pause(0.1)
                    if reached[what]():
                        await pilot.pause(1.0)
                        return
                raise TimeoutError(f"{scene.name}: {what}")

            await wait(scene.before)
            await pilot.press(*scene.keys)
            await wait(scene.after)
            return without_fonts(app.export_screenshot(title=f"hdassist explore {scene.preset}"))
    finally:
        service.close()


if __name__ == "__main__":
    main()
