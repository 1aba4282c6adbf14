"""What turning the wheel is worth against teeth one accuracy class finer: `python -m benchmarks.turning [--n 400]`.

Prints the tables of docs/tolerance.md, and writes its figures: how many random drives stay below which F'_ior, as built
and in their best hole, with the preset's teeth and with teeth one class finer (F'_i1 and F'_i2 over the root of two).
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hdassist.model.geometry import Array
    from hdassist.tolerance.production import Production, RandomDrive

PRESETS = ("vzp160", "synthetic-160-162")
SEED = 0
CHUNK = 10
WIDTH, HEIGHT, LEFT, BOTTOM, TOP = 640, 300, 48, 40, 30
RED, BLUE, DASHES = "#b03a2e", "#1f618d", "6 4"
INK = {
    ("as given", "as built"): (RED, ""),
    ("as given", "best hole"): (RED, DASHES),
    ("one class finer", "as built"): (BLUE, ""),
    ("one class finer", "best hole"): (BLUE, DASHES),
}


def chunk(task: tuple[Production, int, int]) -> list[RandomDrive]:
    made, first, last = task
    return made.records(first, last)


def drives(preset: str, finer: bool, count: int, executor: Executor) -> tuple[tuple[float, ...], list[RandomDrive]]:
    from hdassist import load_preset
    from hdassist.run.run import Run
    from hdassist.tolerance.law import production_law
    from hdassist.tolerance.production import Production

    drive = load_preset(preset)
    teeth = {path: drive.number(path) / 2**0.5 for path in ("tolerances.F_i1", "tolerances.F_i2")}
    drive = drive.with_values(teeth) if finer else drive
    made = Production(production_law(drive), drive.operation.M_g, seed=SEED, per_design=CHUNK)
    made, _ = made.with_designs(count, run=Run(executor))
    tasks = [(made, first, min(first + CHUNK, count)) for first in range(0, count, CHUNK)]
    return made.torques, [record for records in executor.map(chunk, tasks) for record in records]


def figure(M_g: float, curves: Mapping[tuple[str, str], Array]) -> str:
    import numpy as np

    most = max(float(np.quantile(values, 0.995)) for values in curves.values())
    step = next(s for s in (0.5, 1, 2, 5, 10, 20, 50, 100) if most / s <= 8)
    end = step * np.ceil(most / step)
    right, up = WIDTH - LEFT - 20, HEIGHT - BOTTOM - TOP

    def at(value: float, share: float) -> str:
        return f"{LEFT + right * min(value / end, 1):.1f},{TOP + up * (1 - share):.1f}"

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
        'font-size="12">',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for share in (0, 0.25, 0.5, 0.75, 0.95):
        y = TOP + up * (1 - share)
        parts.append(f'<path d="M{LEFT},{y:.1f}h{right}" stroke="#ddd"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{share:.0%}</text>')
    for k in range(round(end / step) + 1):
        x = LEFT + right * k * step / end
        parts.append(f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{k * step:g}</text>')
    for k, (key, values) in enumerate(curves.items()):
        ink, dashes = INK[key]
        points = " ".join(at(v, (n + 1) / len(values)) for n, v in enumerate(np.sort(values)))
        style = f'fill="none" stroke="{ink}" stroke-width="2"' + (f' stroke-dasharray="{dashes}"' if dashes else "")
        parts.append(f'<polyline points="{points}" {style}/>')
        y = TOP + 60 + 18 * k
        parts.append(f'<path d="M{WIDTH - 220},{y}h30" {style}/>')
        parts.append(f'<text x="{WIDTH - 184}" y="{y + 4}">{key[0]}, {key[1]}</text>')
    label = f"F'_ior at {M_g:g} N·m, arcsec: how many of the drives stay below"
    parts.append(f'<text x="{WIDTH / 2}" y="{HEIGHT - 6}" text-anchor="middle">{label}</text></svg>')
    return "\n".join(parts) + "\n"


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--n", type=int, default=400, help="drives of each case")
    reader.add_argument("--figures", type=Path, default=Path("docs/figures"))
    options = reader.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # numpy is not loaded yet
    import numpy as np

    options.figures.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(os.cpu_count()) as executor:
        for preset in PRESETS:
            cases = {}
            for finer, teeth in ((False, "as given"), (True, "one class finer")):
                torques, records = drives(preset, finer, options.n, executor)
                for way, key in (("as built", "F_ior_arcsec"), ("best hole", "best_F_ior_arcsec")):
                    cases[teeth, way] = np.array([getattr(record, key) for record in records])
            for t, M_g in enumerate(torques):
                curves = {key: values[:, t] for key, values in cases.items()}
                (options.figures / f"turning-{preset}-{M_g:g}.svg").write_text(figure(M_g, curves), encoding="utf-8")
                print(f"{preset}, {M_g:g} N·m | " + " | ".join(
                    f"{np.median(values):.2f} / {np.quantile(values, 0.95):.2f}" for values in curves.values()
                ), flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
