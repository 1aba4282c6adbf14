"""Presets of published sizes, made as by `hdassist presets new`: `python -m benchmarks.catalogue [--check]`.

It writes presets/size-*.yaml and presets/mvz-*.yaml, their targets in docs/targets/, and the table of docs/theory.md,
which compares the computed stiffness of each size with its catalogue; --no-table omits the table. --check only names
the files that differ, without the table.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hdassist import Drive, Stiffness, load_preset, stiffness
from hdassist.drive.loading import load_text, similar_preset
from hdassist.drive.preset.knowledge import PITCH_DIAMETER, SimilarValue
from hdassist.run.run import UNCHECKED

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/theory.md"
BEGIN, END = "<!-- made by python -m benchmarks.catalogue -->\n", "<!-- end -->\n"
MM_A_SIZE = 2.54

HD = "Harmonic Drive CSF/CSG catalogue"
SECOND_HAND = (
    "K1 and K3 as in Schaeffler TPI 275, series RT1-H-CS, ratio 100, cited from a secondary source; K2 from memory, "
    "not verified"
)
EXAMPLE = "example in the Harmonic Drive manual CHA 1018854 (12/2015), p. 68, which states no size"
READ = f"{HD}, table of torsional stiffness, ratio 80 and more"
MEMORY = "from memory, not verified"
TORQUES = f"{HD} of Harmonic Drive LLC, tables 41 and 42"
RATED = (
    "CSF, ratio 100, 2000 rpm; from memory, not verified; equal to 1/1.3 of the CSG value, which is cited from a "
    "secondary source and stated in its catalogue to be 30 % above CSF"
)
COUPLING = (
    "the standard version has an Oldham coupling, a version without one is optional: Harmonic Drive AG, HFUS-2A data "
    "1019658 (11/2014), p. 40; the CSF/CSG catalogue lists its backlash; for a solid hub: --set cam.coupling=solid"
)


@dataclass(frozen=True)
class Published:
    """A catalogue size of ratio 100.

    size: number of the size.
    K: K1, K2 and K3 [1e4 N*m/rad].
    T: T1 and T2 [N*m].
    rated: rated torque [N*m].
    accuracy: accuracy [arcmin].
    source: source of K1 to K3.
    holes: number of bolt holes, its origin and its source; None if it is unknown.
    """

    size: int
    K: tuple[float, float, float]
    T: tuple[float, float]
    rated: float
    accuracy: float
    source: str
    holes: tuple[int, str, str] | None = None

    @property
    def name(self) -> str:
        """The name of the preset."""
        return f"size-{self.size}-100"

    @property
    def figures(self) -> dict[str, SimilarValue]:
        """The catalogue values as fields of the preset."""
        accuracy = f"{self.accuracy:g} arcmin over one revolution; not verified; no load stated"
        return {
            **{f"catalogue.K_{k}": SimilarValue(K * 1e4, "given", self.source) for k, K in enumerate(self.K, 1)},
            **{f"catalogue.T_{k}": SimilarValue(T, "given", TORQUES) for k, T in enumerate(self.T, 1)},
            "catalogue.accuracy": SimilarValue(60.0 * self.accuracy, "given", accuracy),
        }


SCREWS = "screws of the circular spline, according to the manuals"
SIZES = (
    Published(14, (0.47, 0.61, 0.71), (2.0, 6.9), 7.8, 1.5, SECOND_HAND, (6, "given", SCREWS)),
    Published(17, (1.0, 1.4, 1.6), (3.9, 12), 24, 1.5, SECOND_HAND, (12, "assumed", f"8 or 12 {SCREWS}")),
    Published(20, (1.6, 2.5, 2.9), (7.0, 25), 40, 1, SECOND_HAND, (12, "given", SCREWS)),
    Published(25, (3.1, 5.0, 5.7), (14, 48), 67, 1, SECOND_HAND, (12, "given", SCREWS)),
    Published(32, (6.7, 11, 12), (29, 108), 137, 1, EXAMPLE, (12, "given", SCREWS)),
    Published(40, (13, 20, 23), (54, 196), 265, 1, MEMORY, (12, "given", SCREWS)),
    Published(45, (18, 29, 33), (76, 275), 353, 1, MEMORY, (12, "given", SCREWS)),
    Published(50, (25, 40, 44), (108, 382), 470, 1, MEMORY, (12, "given", SCREWS)),
    Published(58, (40, 61, 71), (168, 598), 696, 1, READ),
    Published(65, (54, 88, 98), (235, 843), 951, 1, READ),
)
# The number of a motor gear unit MVz is the inner diameter of its flexspline. Neither ratio nor stiffness is published.
MVZ = {"mvz-80": (80.0, 100.0), "mvz-160": (160.0, 900.0)}
MVZ_SOURCE = "proizwodim.ru/motor-reduktory_volnovye, table of MVz-80 and MVz-160 (TU U 29.1-24587406.003-2003)"


def presets() -> Iterator[tuple[str, str]]:
    """Yield the name and the text of each preset."""
    like = load_preset("vzp160")
    for each in SIZES:
        d = round(MM_A_SIZE * each.size, 2)
        required = each.figures | {
            "gears.z_g": SimilarValue(200, "given", "ratio 100, two waves"),
            PITCH_DIAMETER: SimilarValue(
                d, "assumed", f"2.54 mm x size {each.size}; derived, not stated in catalogues"
            ),
            "operation.rated": SimilarValue(each.rated, "given", RATED),
            "cam.coupling": SimilarValue("oldham", "assumed", COUPLING),
        }
        if each.holes:
            required["mounting.holes"] = SimilarValue(*each.holes)
        yield each.name, similar_preset(
            each.name, like, required,
            f"Catalogue size {each.size}, ratio 100, scaled from vzp160. "
            "The model has not been compared with measurements. "
            "The ratio, the rated torque (Harmonic Drive CSF) and other catalogue values are given. "
            f"docs/targets/{each.name}.targets.yaml contains the targets for a calibration. "
            "Catalogues state neither the rim nor the radial deflection nor the profile shifts, and the teeth of these "
            "drives are not involute.",
        )  # fmt: skip
    for name, (d, rated) in MVZ.items():
        which = f"inner diameter of the flexspline ({MVZ_SOURCE}), which equals the pitch diameter in vzp160"
        required = {
            PITCH_DIAMETER: SimilarValue(d, "assumed", which),
            "operation.rated": SimilarValue(rated, "given", MVZ_SOURCE),
        }
        title = f"MVz-{d:g}"
        yield name, similar_preset(
            name, like, required,
            f"Motor gear unit {title}, scaled from vzp160. The model has not been compared with measurements. "
            "The rated torque is given. The name states the inner diameter of the flexspline; "
            "the ratio is not published.",
        )  # fmt: skip


def targets() -> Iterator[tuple[str, str]]:
    """Yield the name of each size and the text of its targets file."""
    texts = dict(presets())
    for each in SIZES:
        drive = load_text(texts[each.name], each.name)
        T_1, T_2 = each.T
        free = ("gears.j_n", "flexspline.k_t", "contact.k_face", "contact.c_ball")
        yield each.name, "\n".join([
            f"# hdassist calibrate {each.name} --targets docs/targets/{each.name}.targets.yaml",
            f"# K1 to K3: {each.source}.",
            f"# T1, T2: {TORQUES}.",
            "schema: hdassist.targets/1",
            f"name: catalogue size {each.size}, ratio 100",
            "",
            "unknowns:",
            *(f"  {path}: {{low: {low!r}, high: {high!r}}}" for path in free for low, high in [_bounds(drive, path)]),
            "",
            "targets:",
            *(f"  - {{quantity: K_{k}, T_1: {T_1:g}, T_2: {T_2:g}, value: {K:g}e4, tolerance: 10 %}}"
              for k, K in enumerate(each.K, 1)),
            "",
        ])  # fmt: skip


def _bounds(drive: Drive, path: str) -> tuple[float, float]:
    bounds = drive.source[path].range
    assert bounds is not None, path
    return bounds


def files() -> dict[Path, str]:
    """Return the text of every file except the page, by path."""
    made = {ROOT / f"presets/{name}.yaml": text for name, text in presets()}
    return made | {ROOT / f"docs/targets/{name}.targets.yaml": text for name, text in targets()}


def table() -> str:
    """Return the table that compares K1, K2 and K3 of each size with its catalogue.

    They are computed for the preset itself, and for a bearing without clearance.
    """
    lines = [
        "| preset | catalogue K1, K2, K3 | hdassist | ratio | lost motion "
        "| ratio without clearance of the bearing | lost motion | source of the catalogue values |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for each in SIZES:
        cells = [", ".join(f"{K:g}" for K in each.K)]
        drive = load_preset(each.name)
        for g_b in (drive.bearing.g_b, 0.0):
            curve = stiffness(drive.with_values({"bearing.g_b": g_b}), points=4, run=UNCHECKED)
            K = _stiffnesses(curve)
            cells += [", ".join(f"{k:.3g}" for k in K)] if g_b else []
            cells += [
                ", ".join(f"{k / c:.2f}" for k, c in zip(K, each.K, strict=True)),
                f'{curve.lost_motion_arcsec:.0f}"',
            ]
        lines.append(f"| `{each.name}` | {' | '.join(cells)} | {each.source} |")
        sys.stderr.write(f"{lines[-1]}\n")
    return "\n".join(lines) + "\n"


def _stiffnesses(curve: Stiffness) -> list[float]:
    """Return K1, K2 and K3 [1e4 N*m/rad]."""
    return [segment.stiffness / 1e4 for segment in curve.positive]


def main() -> int:
    """Write all files, or name the files that differ; return the exit code."""
    if "--check" in sys.argv:
        different = [path for path, text in files().items() if not path.exists() or path.read_text("utf-8") != text]
        sys.stderr.writelines(f"{path.relative_to(ROOT)} is not what presets new makes\n" for path in different)
        return int(bool(different))
    (ROOT / "docs/targets").mkdir(exist_ok=True)
    for path, text in files().items():
        path.write_text(text, encoding="utf-8")
    if "--no-table" not in sys.argv:
        head, _, rest = PAGE.read_text("utf-8").partition(BEGIN)
        PAGE.write_text(f"{head}{BEGIN}\n{table()}\n{END}{rest.partition(END)[2]}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
