"""Torsional stiffness of catalogue drives of the neighbouring sizes 58 and 65."""

from functools import cache

import pytest

from hdassist import Stiffness, load_preset, stiffness
from tests.support import changed
from tests.validation.case import Case, Information, Kind, about, parameters

TITLE = "Catalogue stiffness"
ABOUT = (
    "K1, K2, K3 of strain wave gears with a cup flexspline, sizes 58 and 65 (ratio 80 and more), in 1e4 N·m/rad: "
    "40, 61, 71 and 54, 88, 98. Brought to the pitch diameter of `vzp160`, 160 mm, by its cube from theirs (2.54 mm a "
    "size), both say 50, 79, 90 to 3 %. Nothing was fitted to them. Coned flanks are `numerics.stations: 5`, with "
    "`contact.k_face` in place of the identified `contact.c_t`, and all else as identified with whole flanks."
)
SIZES = {58: (40, 61, 71), 65: (54, 88, 98)}
MM_A_SIZE, DIAMETER = 2.54, 160.0
STATIONS = 5


@cache
def curve(**fields: float) -> Stiffness:
    return stiffness(changed(load_preset("vzp160"), **fields), cross_check=None)


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
        f"K1 with j_n {j_n:g} µm over that with {before:g} µm", "", "the model alone", 0, 1,
        why="the more clearance, the fewer teeth carry the first load: clearance lowers K1",
        kind=Kind.MODEL, value=lambda: K1(j_n) / K1(before), digits=".2f",
    )  # fmt: skip


def segment(k: int, miss: str = "", coned: bool = False) -> Case:
    fields = {"numerics__stations": STATIONS} if coned else {}
    return Case(
        f"K{k} of vzp160{', coned flanks' if coned else ''}", "1e4 N·m/rad",
        "Harmonic Drive CSF/CSG catalogue, sizes 58 and 65, by the cube of the diameter",
        **about(scaled(k), 0.1 * scaled(k)),
        why="means of many drives of another maker: 10 % assumed",
        kind=Kind.PREDICTED, value=lambda: K(k, **fields), digits=".1f", miss=miss,
    )  # fmt: skip


CASES = [
    segment(
        1,
        "flanks that bear as a whole are as stiff under the first load as under any; coned, they are not (rows below). "
        "Clearance lowers it as well; friction, which widens a catalogue's loop, is not in the model",
    ),
    segment(2),
    segment(3),
    segment(
        1,
        "nearly half of what whole flanks miss is gone; the rest is within what k_face and j_n leave open (K1 for "
        "information)",
        coned=True,
    ),
    segment(2, coned=True),
    segment(3, coned=True),
    Case(
        f"K1 with {2 * STATIONS} stations over that with {STATIONS}", "", "numerics.stations", **about(1, 0.02),
        why="below what k_face leaves open", kind=Kind.CONVERGENCE, digits=".3f",
        value=lambda: K(1, numerics__stations=2 * STATIONS) / K(1, numerics__stations=STATIONS),
    ),
    softer(15.0, 0.0),
    softer(30.0, 15.0),
]  # fmt: skip
INFORMATION = [
    Information(
        f"K1 with j_n {j_n:g} µm", "1e4 N·m/rad", "no catalogue says the clearance of its drives",
        value=lambda j_n=j_n: K1(j_n), digits=".1f",
    )
    for j_n in (0.0, 15.0, 30.0)
] + [
    Information(
        f"K1 with coned flanks, k_face {k_face:g} N/(µm·mm), j_n {j_n:g} µm", "1e4 N·m/rad",
        "no catalogue says the clearance of its drives, and k_face is known to 20 %",
        value=lambda k_face=k_face, j_n=j_n: K(
            1, numerics__stations=STATIONS, contact__k_face=k_face, gears__j_n=j_n
        ), digits=".1f",
    )
    for k_face in (6.8, 10.0) for j_n in (7.0, 10.0)
]  # fmt: skip


@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case):
    case.check()
