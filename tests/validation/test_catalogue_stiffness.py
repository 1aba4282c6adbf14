"""Torsional stiffness of catalogue drives of the neighbouring sizes 58 and 65."""

from functools import cache

import pytest

from hdassist import Stiffness, load_preset, stiffness
from tests.support import changed
from tests.validation.case import Case, Information, Kind, parameters

TITLE = "Catalogue stiffness"
ABOUT = (
    "K1, K2, K3 of strain wave gears with a cup flexspline, sizes 58 and 65 (ratio 80 and more), in 1e4 N·m/rad: "
    "40, 61, 71 and 54, 88, 98. The pitch diameter of `vzp160`, 160 mm, lies between theirs (about 147 and 165 mm)."
)


@cache
def curve(j_n: float | None = None) -> Stiffness:
    drive = load_preset("vzp160")
    return stiffness(drive if j_n is None else changed(drive, gears__j_n=j_n), cross_check=None)


def K1(j_n: float) -> float:
    """K1 [1e4 N*m/rad] with a clearance [um]."""
    return curve(j_n).positive[0].stiffness / 1e4


def softer(j_n: float, before: float) -> Case:
    return Case(
        f"K1 with j_n {j_n:g} µm over that with {before:g} µm", "", "the model alone", 0, 1,
        why="the more clearance, the fewer teeth carry the first load: clearance lowers K1",
        kind=Kind.MODEL, value=lambda: K1(j_n) / K1(before), digits=".2f",
    )  # fmt: skip


def segment(k: int, low: float, high: float, miss: str = "") -> Case:
    return Case(
        f"K{k} of vzp160", "1e4 N·m/rad", "Harmonic Drive CSF/CSG catalogue, sizes 58 and 65", low, high,
        why="another maker's drive of nearly this size", kind=Kind.PREDICTED,
        value=lambda: curve().positive[k - 1].stiffness / 1e4, digits=".1f", miss=miss,
    )  # fmt: skip


CASES = [
    segment(
        1, 40, 54,
        "the reason is not settled; clearance lowers it (rows below); friction, which widens a catalogue's loop, and "
        "teeth that bear along their width only as the load grows are not in the model and were not tried",
    ),
    segment(2, 61, 88),
    segment(3, 71, 98),
    softer(15.0, 0.0),
    softer(30.0, 15.0),
]  # fmt: skip
INFORMATION = [
    Information(
        f"K1 with j_n {j_n:g} µm", "1e4 N·m/rad", "no catalogue says the clearance of its drives",
        value=lambda j_n=j_n: K1(j_n), digits=".1f",
    )
    for j_n in (0.0, 15.0, 30.0)
]  # fmt: skip


@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case):
    case.check()
