"""Slopes of F'_ior by single numbers, against differences of full cycles."""

from dataclasses import replace

import pytest

import hdassist.error.slopes as module
from hdassist import Drive, kinematic_error, load_preset
from hdassist.error.slopes import STEP, Slope, _ends, slopes
from hdassist.errors import UntrustedError, UsageError
from hdassist.solve.answers import EMPTY, Certificate
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


def test_what_is_not_there_or_cannot_be_moved_has_no_slope(small: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
    loose = small.with_values({"supports.C_3": 0.0})
    assert _ends((loose, (M_G,), "supports.C_3")) == (0.0, ([], []), EMPTY)

    def untrusted(*_: object) -> None:
        raise UntrustedError("no")

    monkeypatch.setattr(module, "_at", untrusted)
    assert _ends((small, (M_G,), "supports.C_3")) == (0.0, ([], []), EMPTY)


def test_slopes_are_put_together_of_both_ends(small: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
    def ends(task: tuple[Drive, tuple[float, ...], str]) -> tuple[float, tuple[list[float], list[float]], Certificate]:
        here, still = ([10.0], [10.0]), ([], [])
        if task[2] in ("", "contact.c_t"):
            return 0.0, still if task[2] else here, EMPTY
        return 2.0, ([9.0], [12.0]), replace(EMPTY, states=7)

    monkeypatch.setattr(module, "_ends", ends)
    told: list[int] = []
    found, here, proof = slopes(small, [M_G], progress=told.append)
    assert here == [10.0]
    assert sum(told) == proof.states == 7 * len(found)
    assert "contact.c_t" not in {slope.path for slope in found}
    assert {slope.per_unit for slope in found} == {(1.5,)}
    (stiffness,) = (slope for slope in found if slope.path == "supports.C_2")
    assert stiffness.elasticity == pytest.approx((1.5 * small.supports.C_2 / 10,))
