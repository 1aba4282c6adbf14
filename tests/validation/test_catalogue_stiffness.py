"""Torsional stiffness of catalogue drives of the neighbouring sizes 58 and 65."""

from functools import cache

import pytest

from hdassist import Stiffness, load_preset, stiffness
from tests.validation.case import Case, Kind, parameters

TITLE = "Catalogue stiffness"
ABOUT = (
    "K1, K2, K3 of strain wave gears with a cup flexspline, sizes 58 and 65 (ratio 80 and more), in 1e4 N·m/rad: "
    "40, 61, 71 and 54, 88, 98. The pitch diameter of `vzp160`, 160 mm, lies between theirs (about 147 and 165 mm)."
)


@cache
def curve() -> Stiffness:
    return stiffness(load_preset("vzp160"))


def segment(k: int, low: float, high: float, miss: str = "") -> Case:
    return Case(
        f"K{k} of vzp160", "1e4 N·m/rad", "Harmonic Drive CSF/CSG catalogue, sizes 58 and 65", low, high,
        why="another maker's drive of nearly this size", kind=Kind.PREDICTED,
        value=lambda: curve().positive[k - 1].stiffness / 1e4, digits=".1f", miss=miss,
    )  # fmt: skip


CASES = [
    segment(
        1, 40, 54,
        "the model has no friction and a tooth contact that is as stiff at no load as at full load; a catalogue's K1 "
        "is measured across the loop of a drive whose teeth come to bear along their width only as the load grows",
    ),
    segment(2, 61, 88),
    segment(3, 71, 98),
]  # fmt: skip


@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case):
    case.check()
