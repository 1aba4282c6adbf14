"""Torsional stiffness of catalogue drives of the neighbouring sizes 58 and 65."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from hdassist import Stiffness, load_preset, stiffness
from hdassist.model.geometry import Array
from hdassist.run.run import UNCHECKED
from tests.helpers.support import changed
from tests.validation.case import Case, Information, Kind, about, parameters

TITLE = "Catalogue stiffness"
ABOUT = (
    'The fit used only the rows of the kind "fitted". `vzp160` is compared with sizes 58 and 65 (40, 61, 71 '
    "and 54, 88, 98·10⁴ N·m/rad) by scaling with the cube of the diameter. The other rows use sizes 17 to 65, "
    "because the catalogue values of size 14 deviate from this rule. K1 of all sizes is fitted by one value, "
    "the clearance of the flexible bearing. It is 0.085 µm per mm of diameter, which gives 3.7 µm at size 17 "
    "and 14 µm at size 65. This clearance adds no backlash. A thinner shell, a smaller radial deflection, "
    "softer flanks or Hertzian balls each make K2 or K3 wrong. As a rule of thumb, manufacturers state a lost "
    "motion of 60″."
)
SIZES = {58: (40, 61, 71), 65: (54, 88, 98)}
SIMILAR = (17, 20, 25, 32, 40, 45, 50, 58, 65)
MM_A_SIZE, DIAMETER = 2.54, 160.0
STATIONS = 5


@cache
def curve(**fields: float) -> Stiffness:
    return stiffness(changed(load_preset("vzp160"), **fields), run=UNCHECKED)


def K(k: int, **fields: float) -> float:
    """K1, K2 or K3 [1e4 N*m/rad] with some fields changed."""
    return curve(**fields).positive[k - 1].stiffness / 1e4


def K1(j_n: float) -> float:
    """K1 [1e4 N*m/rad] with a clearance [um]."""
    return K(1, gears__j_n=j_n)


def scaled(k: int) -> float:
    """K1, K2 or K3 [1e4 N*m/rad] of the catalogue, by the cube of the pitch diameter; the mean of both sizes."""
    return sum(values[k - 1] * (DIAMETER / MM_A_SIZE / size) ** 3 for size, values in SIZES.items()) / len(SIZES)


def softer(j_n: float, before: float) -> Case:
    return Case(
        f"K1, j_n {j_n:g} µm over {before:g} µm", "", "the model alone", 0.4, 0.9,
        why="with a larger clearance, fewer teeth carry the first load",
        kind=Kind.MODEL, value=lambda: K1(j_n) / K1(before), digits=".2f",
    )  # fmt: skip


def segment(k: int, miss: str = "") -> Case:
    return Case(
        f"K{k} of vzp160", "10⁴N·m/rad",
        "Harmonic Drive CSF/CSG catalogue",
        **about(scaled(k), 0.1 * scaled(k)),
        why="another manufacturer's means: 10 % assumed",
        kind=Kind.PREDICTED, value=lambda: K(k), digits=".1f", miss=miss,
    )  # fmt: skip


def table() -> str:
    """K1 to K3 of the presets of all sizes over their catalogues', and lost motion."""
    lines = ["|size|K1|K2|K3 over the catalogue's|lost motion|", "|---|---|---|---|---|"]
    for size in (14, *SIMILAR):
        drive = load_preset(f"size-{size}-100")
        own, said = stiffness(drive, run=UNCHECKED), drive.catalogue
        pairs = zip(own.positive, (said.K_1, said.K_2, said.K_3), strict=True)
        cells = [f"{part.stiffness / K:.2f}" for part, K in pairs]
        lines.append(f"|{size}|{'|'.join(cells)}|{own.lost_motion_arcsec:.0f}″|")
    return "\n".join(lines)


@cache
def ratios(**fields: float) -> Array:
    """K1, K2, K3 over the catalogue's, shape (sizes, 3), with some fields of all sizes changed."""
    found = []
    for size in SIMILAR:
        drive = load_preset(f"size-{size}-100")
        own = stiffness(changed(drive, **fields), points=0, run=UNCHECKED).positive
        said = drive.catalogue
        found.append([part.stiffness / K for part, K in zip(own, (said.K_1, said.K_2, said.K_3), strict=True)])
    return np.array(found)


def over_sizes(k: int, words: str, get: Callable[[Array], float]) -> Case:
    return Case(
        f"K{k} over catalogue, {words}", "", "catalogues, manuals",
        **about(1, 0.15), why="similarity to one drive: 15 % assumed", kind=Kind.PREDICTED,
        value=lambda: get(ratios()[:, k - 1]), digits=".2f",
    )  # fmt: skip


SOFT_START = "the model is too stiff at the first load, because this drive's bearing has no clearance"
CASES = [
    segment(1, SOFT_START),
    segment(2),
    segment(3),
    *(
        over_sizes(k, words, get)
        for k in (2, 3) for words, get in (("least", np.min), ("greatest", np.max))
    ),
    *(
        Case(
            f"K1 over catalogue, {words}", "",
            "catalogues, manuals", **about(1, 0.05), why="one number for nine sizes",
            kind=Kind.FITTED, value=lambda get=get: get(ratios()[:, 0]), digits=".2f",
        )
        for words, get in (("least", np.min), ("greatest", np.max))
    ),
    Case(
        f"K1, {2 * STATIONS} stations over {STATIONS}", "", "numerics.stations", **about(1, 0.02),
        why="smaller than the uncertainty from k_face", kind=Kind.CONVERGENCE, digits=".3f",
        value=lambda: K(1, numerics__stations=2 * STATIONS) / K(1),
    ),
    softer(15.0, 0.0),
    softer(30.0, 15.0),
]  # fmt: skip
INFORMATION = [
    Information(
        "lost motion over that with whole flanks", "", "the model alone",
        value=lambda: curve().lost_motion_arcsec / curve(numerics__stations=1).lost_motion_arcsec, digits=".2f",
    ),
    Information(
        "K1 over catalogue without clearance of the bearing, mean of the sizes", "", "the model alone",
        value=lambda: ratios(bearing__g_b=0.0)[:, 0].mean(), digits=".2f",
    ),
]  # fmt: skip


@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case):
    case.check()
