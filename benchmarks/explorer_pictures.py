"""The pictures of docs/explorer.md, made by the explorer itself: python -m benchmarks.explorer_pictures [FOLDER]."""

from __future__ import annotations

import asyncio
import os
import sys
import tempfile
from collections.abc import Callable
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "docs/pictures"
LONGEST = 300.0  # s that a scene may compute
TRIALS = "h0:31.7 h4:14.9 h8:27.9 h5:16.2 h4:15.3"


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
    trace: bool = False
    preset: str = "vzp160"
    overrides: tuple[str, ...] = ()


SCENES = (
    Scene("explorer-80x24", (80, 24), keys=("b",)),
    Scene("explorer-100x30", (100, 30), keys=("b",), after="slopes"),
    Scene("explorer-trials", (100, 30), "trials", trials=TRIALS, overrides=("operation.M_g=[80.0]",), keys=("b",)),
    Scene("explorer-changed", (140, 42), keys=("l", *["down"] * 9, "minus", "minus"), after="advised", dark=False),
    Scene("explorer-turn", (120, 36), keys=("2", *["right"] * 9), after="turn"),
    Scene("explorer-trace", (120, 36), "refined", trace=True, after="trace"),
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
    from hdassist.explorer.service import Service
    from hdassist.explorer.state import opened, with_trials
    from hdassist.explorer.writing import without_fonts

    session = opened(scene.preset, scene.overrides)
    session = with_trials(session, scene.trials) if scene.trials else session
    service = Service()
    app = Explorer(session, service, dark=scene.dark)
    reached: dict[str, Callable[[], object]] = {
        "refined": lambda: app.known.curve and len(app.known.curve.places) > 11 and app.known.curve.sure == "REFINED",
        "advised": lambda: app.known.advised and not app.busy,
        "trials": lambda: app.of_trials and app.of_trials.advised and app.known.advised,
        "slopes": lambda: app.known.slopes.get(app.session.turn_deg) and not app.busy,
        "rest": lambda: not app.busy,
        "turn": lambda: app.turn_view.found,
        "trace": lambda: app.trace_view.found,
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
            if scene.trace:
                with tempfile.TemporaryDirectory() as folder, chdir(folder):
                    await pilot.press("3", "escape")
                    app.compare(_trace(Path(folder) / "run.csv"), 80.0)
                    await wait(scene.after)
            else:
                await pilot.press(*scene.keys)
                await wait(scene.after)
            return without_fonts(app.export_screenshot(title=f"hdassist explore {scene.preset}"))
    finally:
        service.close()


def _trace(path: Path) -> str:
    """A trace as a rig would write it: of a drive whose wheel stands 25 degrees off, with noise."""
    import numpy as np

    from hdassist import load_preset
    from hdassist.error.trace import trace
    from hdassist.run.run import UNCHECKED

    found = trace(load_preset("vzp160", ["phases.xi_b=235"]), 80.0, revolutions=3, run=UNCHECKED)
    noise = np.random.default_rng(1).normal(0, 0.15, len(found.error.error_arcsec))
    rows = zip(np.degrees(found.error.states.phi_h), found.error.error_arcsec + noise, strict=True)
    path.write_text("phi_h_deg,error_arcsec\n" + "".join(f"{a:.4f},{b:.3f}\n" for a, b in rows), encoding="utf-8")
    return path.name


if __name__ == "__main__":
    main()
