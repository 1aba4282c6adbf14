"""A flexspline and a cam that are not as warm as the rigid wheel: what a second implementation of the model found."""

import pytest

from tests.validation.case import Case, Kind, about, parameters
from tests.validation.whole_flanks import F_ior

TITLE = "Temperature"
ABOUT = (
    "The flexspline and the wave generator of `vzp160` (with whole flanks) are warmer than the circular spline by "
    "`operation.dT`. The table compares F'_ior from two implementations of the model. The second implementation "
    "changes the gaps by equation (6c) of [theory](theory.md#temperature). hdassist scales the radii and recomputes "
    "the flanks. No measurement of the effect of temperature was available."
)
FOUND = {80.0: {-20: 26.9, 0: 28.9, 10: 23.5, 20: 15.9}, 800.0: {-20: 6.2, 0: 8.6, 10: 10.8, 20: 13.1}}
CASES = [
    Case(
        f"F'_ior, {M_g:g} N·m, {dT} K", "arcsec",
        "second implementation", **about(value, 0.03 * value), digits=".1f", kind=Kind.MODEL,
        why="The results of the second implementation are stated with two or three digits, and its drive differs "
            "slightly from `vzp160`",
        value=lambda M_g=M_g, dT=dT: F_ior(M_g, operation__dT=float(dT)),
    )
    for M_g, values in FOUND.items() for dT, value in values.items()
]  # fmt: skip


@pytest.mark.thorough
@pytest.mark.parametrize("case", parameters(CASES))
def test_temperature(case: Case):
    case.check()
