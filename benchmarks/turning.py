"""Benefit of the best hole compared with teeth one accuracy class finer: `python -m benchmarks.turning [--n 400]`.

The tables of docs/tolerance.md are printed, and its figures are written. They show the share of random drives below a
value of F'_ior, as assembled and in their best holes, with the teeth of the preset and with teeth one class better
(F'_i1 and F'_i2 divided by the square root of two).

With --support, a table and docs/figures/turning-support.svg show the ratio of F'_ior in the worst hole to that in the
best hole, by the support of the wave generator and its housing-fixed eccentricity, with samples of shipped presets.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hdassist.drive.model.geometry import Array
    from hdassist.drive.preset.fields import Drive
    from hdassist.features.tolerance.production import Production, RandomDrive

PRESETS = ("vzp160", "synthetic-160-162")
SHIPPED = ("size-17-100", "size-65-100", "mvz-80")
SUPPORTS = (0, 500, 1000, 2000, 4000, 6000, 8950, 12000, 16000, 30000, 60000, 100000)  # N/mm
OFFSETS = (0.0, 15.0, 30.0, 60.0, 80.0, 100.0)  # um
SEED = 0
CHUNK = 10
WIDTH, HEIGHT, LEFT, BOTTOM, TOP = 640, 300, 48, 40, 30
RED, BLUE, DASHES = "#b03a2e", "#1f618d", "6 4"
OLIVE, GREEN, RULE = "#7d6608", "#117a65", "#ddd"
ON_DARK = {BLUE: "#79c0ff", RED: "#ff9492", OLIVE: "#e3b341", GREEN: "#56d4bc"}
STYLE = "<style>svg{fill:#24292e} .paper{fill:#ffffff} @media (prefers-color-scheme: dark) {svg{fill:#e6edf3} "
STYLE += ".paper{fill:#16191d} " + "".join(f'[fill="{ink}"]{{fill:{to}}} ' for ink, to in ON_DARK.items())
STYLE += f'[stroke="{RED}"]{{stroke:{ON_DARK[RED]}}} [stroke="{RULE}"]{{stroke:#3d444d}}}}</style>'
INK = {
    ("nominal", "as assembled"): (RED, ""),
    ("nominal", "best hole"): (RED, DASHES),
    ("one class better", "as assembled"): (BLUE, ""),
    ("one class better", "best hole"): (BLUE, DASHES),
}


def chunk(task: tuple[Production, int, int]) -> list[RandomDrive]:
    made, first, last = task
    return made.records(first, last)


def drives(preset: str, finer: bool, count: int, executor: Executor) -> tuple[tuple[float, ...], list[RandomDrive]]:
    from hdassist import load_preset
    from hdassist.features.tolerance.production import Production, production_law
    from hdassist.run.run import Run

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
    label = f"F'_ior at {M_g:g} N·m, arcsec: share of the drives below this value"
    parts.append(f'<text x="{WIDTH / 2}" y="{HEIGHT - 6}" text-anchor="middle">{label}</text></svg>')
    return "\n".join(parts) + "\n"


def by_support() -> tuple[dict[float, list[float]], list[float]]:
    """Return the ratio of F'_ior in the worst hole to that in the best hole of vzp160.

    The first result is for 80 N*m, by eccentricity and then support. The second result is for 800 N*m, by support.
    """
    from hdassist import load_preset

    drive = load_preset("vzp160")
    every = {
        offset: [
            worst_over_best(drive.with_values({"supports.C_3": C_3, "tolerances.e_hb": offset}), 80.0)
            for C_3 in SUPPORTS
        ]
        for offset in OFFSETS
    }
    return every, [worst_over_best(drive.with_values({"supports.C_3": C_3}), 800.0) for C_3 in SUPPORTS]


def worst_over_best(drive: Drive, M_g: float) -> float:
    """Return the ratio of F'_ior in the worst of twelve holes to that in the best hole."""
    import numpy as np

    from hdassist.drive.error.error_map import Batch, ErrorMap
    from hdassist.drive.error.extremes import many_extremes

    F_ior = many_extremes(ErrorMap(drive, M_g), Batch.turned(drive, np.arange(0, 360, 30.0))).F_ior_arcsec
    return float(F_ior.max() / F_ior.min())


def shipped_drives(preset: str, count: int) -> list[tuple[float, float]]:
    """Return the support, scaled by diameter to 160 mm, and the ratio of worst to best hole, for samples of a preset.

    count: number of samples.
    """
    import numpy as np

    from hdassist import load_preset
    from hdassist.belief.evidence import evidence_of
    from hdassist.belief.prior import prior_of
    from hdassist.belief.samples import SamplingEffort, draw_samples

    drive = load_preset(preset)
    samples = draw_samples(
        prior_of(drive), drive.operation.M_g[:1], rotations_deg=np.arange(0, 360, 30.0).tolist(),
        evidence=evidence_of(drive), effort=SamplingEffort.of(count),
    )  # fmt: skip
    turned = samples.turned_arcsec[:, 0]
    supports = [each.get("supports.C_3", drive.supports.C_3) for each in samples.prior.values(samples.shares)]
    rows = np.random.default_rng(SEED).choice(len(turned), count, p=samples.weights / samples.weights.sum())
    to_160 = 160 / drive.gears.pitch_diameter
    return [(supports[k] * to_160, float(turned[k].max() / turned[k].min())) for k in rows]


def support_figure(lines: Mapping[float, list[float]], dots: Mapping[str, list[tuple[float, float]]]) -> str:
    """Return the figure of the ratio of worst to best hole over the support of the wave generator.

    lines: ratios by support for each eccentricity [um].
    dots: support and ratio of samples, by preset.
    """
    from math import log10

    low, high, end = log10(SUPPORTS[1]), log10(SUPPORTS[-1]), 3.5
    right, up = WIDTH - LEFT - 20, HEIGHT - BOTTOM - TOP

    def at(C_3: float, ratio: float) -> tuple[float, float]:
        across = min(max((log10(C_3) - low) / (high - low), 0), 1)
        return LEFT + right * across, TOP + up * (1 - (min(ratio, end) - 1) / (end - 1))

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
        'font-size="12">',
        "<title>Ratio of worst to best hole by the support and the eccentricity of the wave generator</title>",
        STYLE,
        '<rect width="100%" height="100%" class="paper"/>',
    ]
    for ratio in (1, 1.5, 2, 2.5, 3, 3.5):
        y = at(SUPPORTS[1], ratio)[1]
        parts.append(f'<path d="M{LEFT},{y:.1f}h{right}" stroke="#ddd"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{ratio:g}</text>')
    for C_3 in (1e3, 3e3, 1e4, 3e4, 1e5):
        x = at(C_3, 1)[0]
        parts.append(f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{C_3:g}</text>')
    for k, (name, drives) in enumerate(dots.items()):
        ink = (BLUE, OLIVE, GREEN)[k]
        for C_3, ratio in drives:
            x, y = at(C_3, ratio)
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" fill="{ink}" fill-opacity="0.6"/>')
        parts.append(f'<text x="{LEFT + 10}" y="{TOP + 14 + 16 * k}" fill="{ink}">{name}</text>')
    for offset, ratios in lines.items():
        points = [at(C_3, ratio) for C_3, ratio in zip(SUPPORTS[1:], ratios[1:], strict=True)]
        text, wide = " ".join(f"{x:.1f},{y:.1f}" for x, y in points), 2.5 if offset == 80 else 1
        parts.append(f'<polyline points="{text}" fill="none" stroke="{RED}" stroke-width="{wide}"/>')
        x, y = max(points, key=lambda each: -each[1])
        parts.append(f'<text x="{x:.1f}" y="{y - 4:.1f}" text-anchor="middle" fill="{RED}">{offset:g} µm</text>')
    label = "support C_3, N/mm, scaled to 160 mm; ratio of worst to best hole"
    parts.append(f'<text x="{WIDTH / 2}" y="{HEIGHT - 6}" text-anchor="middle">{label}</text></svg>')
    return "\n".join(parts) + "\n"


def write_support(folder: Path) -> None:
    lines, loaded = by_support()
    print("C_3, N/mm | " + " | ".join(f"{offset:g} µm" for offset in OFFSETS) + " | 80 µm, 800 N·m")
    for k, C_3 in enumerate(SUPPORTS):
        row = [*(ratios[k] for ratios in lines.values()), loaded[k]]
        print(f"{C_3:g} | " + " | ".join(f"{ratio:.2f}" for ratio in row), flush=True)
    dots = {preset: shipped_drives(preset, 32) for preset in SHIPPED}
    for preset, drives in dots.items():
        ratios = sorted(ratio for _, ratio in drives)
        print(f"{preset}: {ratios[1]:.2f} to {ratios[-2]:.2f}, median {ratios[len(ratios) // 2]:.2f}")
    (folder / "turning-support.svg").write_text(support_figure(lines, dots), encoding="utf-8")


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("--n", type=int, default=400, help="drives of each case")
    reader.add_argument("--figures", type=Path, default=Path("docs/figures"))
    reader.add_argument("--support", action="store_true")
    options = reader.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # set before numpy is loaded
    import numpy as np

    options.figures.mkdir(parents=True, exist_ok=True)
    if options.support:
        write_support(options.figures)
        return
    with ProcessPoolExecutor(os.cpu_count()) as executor:
        for preset in PRESETS:
            cases = {}
            for finer, teeth in ((False, "nominal"), (True, "one class better")):
                torques, records = drives(preset, finer, options.n, executor)
                for way, key in (("as assembled", "F_ior_arcsec"), ("best hole", "best_F_ior_arcsec")):
                    cases[teeth, way] = np.array([getattr(record, key) for record in records])
            for t, M_g in enumerate(torques):
                curves = {key: values[:, t] for key, values in cases.items()}
                (options.figures / f"turning-{preset}-{M_g:g}.svg").write_text(figure(M_g, curves), encoding="utf-8")
                print(f"{preset}, {M_g:g} N·m | " + " | ".join(
                    f"{np.median(values):.2f} / {np.quantile(values, 0.95):.2f}" for values in curves.values()
                ), flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
