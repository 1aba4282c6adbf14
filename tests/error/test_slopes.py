"""Slopes of F'_ior by single numbers, against differences of full cycles."""

import pytest

from hdassist import Drive, kinematic_error, load_preset
from hdassist.error.slopes import STEP, Slope, slopes
from hdassist.errors import UsageError
from tests.process import SMALL

M_G = 4.0


@pytest.fixture(scope="module")
def small() -> Drive:
    return load_preset(SMALL, ["bearing.g_b=0"])


@pytest.fixture(scope="module")
def found(small: Drive) -> dict[str, Slope]:
    return {slope.path: slope for slope in slopes(small, [M_G])[0]}


def full(drive: Drive) -> float:
    return kinematic_error(drive, M_G, cross_check=None).F_ior_arcsec


@pytest.mark.parametrize("path", ["tolerances.F_i1", "tolerances.e_hb", "contact.c_ball", "supports.C_2", "cam.W_0"])
def test_they_are_differences_of_every_state(small: Drive, found: dict[str, Slope], path: str) -> None:
    value = small.number(path)
    below, above = (full(small.with_values({path: value * way})) for way in (1 - STEP, 1 + STEP))
    assert found[path].per_unit[0] == pytest.approx((above - below) / (2 * STEP * value), rel=1e-6)
    assert found[path].elasticity is not None
    assert found[path].elasticity[0] == pytest.approx((above - below) / (2 * STEP) / full(small), rel=1e-6)


def test_a_clearance_of_nothing_has_one_side(small: Drive, found: dict[str, Slope]) -> None:
    expected = full(small.with_values({"bearing.g_b": 1.0})) - full(small)
    assert found["bearing.g_b"].per_unit[0] == pytest.approx(expected, rel=1e-6)
    assert found["bearing.g_b"].elasticity is None


def test_the_steepest_comes_first_and_what_is_not_there_does_not_come(found: dict[str, Slope]) -> None:
    steep = [abs(slope.elasticity[0]) for slope in found.values() if slope.elasticity]
    assert steep == sorted(steep, reverse=True)
    assert "tolerances.e_b" not in found


def test_rolling_balls_are_refused() -> None:
    with pytest.raises(UsageError, match="rolling balls"):
        slopes(load_preset(SMALL, ["bearing.ball_motion=rolling", "bearing.d_ball=4"]), [M_G])
