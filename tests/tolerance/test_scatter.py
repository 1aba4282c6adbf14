"""What random drives are drawn from: distributions against their densities, drives the same in any chunks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdassist import Drive, load_preset
from hdassist.errors import UsageError
from hdassist.tolerance.scatter import TAIL, Draws, Scatter, scatters
from tests.process import TINY


@pytest.fixture(scope="module")
def small() -> Drive:
    return load_preset(TINY)


EVEN = (np.arange(20_000) + 0.5) / 20_000


def test_a_rayleigh_size_ends_at_the_tolerance_and_has_the_density_of_two_normal_parts() -> None:
    values = Scatter("tolerances.e_hb", "rayleigh", 0.0, 60.0).at(EVEN)
    x, y = np.random.default_rng(1).normal(0, 60 / TAIL, (2, 200_000))
    parts = np.hypot(x, y)
    parts = parts[parts <= 60]
    assert values.max() <= 60
    assert values.mean() == pytest.approx(parts.mean(), rel=3e-3)
    for share in (0.1, 0.5, 0.9):
        assert np.quantile(values, share) == pytest.approx(np.quantile(parts, share), rel=6e-3)


def test_a_value_with_an_uncertainty_is_normal_around_it_and_stays_within_it() -> None:
    values = Scatter("gears.j_n", "normal", 4.0, 8.0).at(EVEN)
    assert values.mean() == pytest.approx(6, abs=1e-6)
    assert values.std() == pytest.approx(0.88, abs=0.01)  # of a normal one, sd 1, cut off at two of them
    assert values.min() >= 4
    assert values.max() <= 8


def test_measured_sizes_come_as_often_as_they_were_measured() -> None:
    values = Scatter("tolerances.e_hb", "measured", 3.0, 9.0, (9.0, 3.0, 3.0, 5.0)).at(EVEN)
    assert {float(v): int((values == v).sum()) for v in np.unique(values)} == {3.0: 10_000, 5.0: 5_000, 9.0: 5_000}


@given(first=st.integers(0, 300), count=st.integers(1, 20), method=st.sampled_from(["mc", "sobol"]))
def test_a_drive_is_the_same_whatever_is_drawn_beside_it(first: int, count: int, method: str) -> None:
    draws = Draws(tuple(Scatter(f"tolerances.{name}", "uniform", 0.0, 9.0) for name in ("F_i1", "F_i2")), 5, method)
    whole = draws.shares(0, 400)
    assert (draws.shares(first, first + count) == whole[first : first + count]).all()


def test_sizes_go_up_to_their_tolerance_and_directions_are_any(small: Drive) -> None:
    found = {s.path: s for s in scatters(small)}
    assert found["tolerances.e_hb"] == Scatter("tolerances.e_hb", "rayleigh", 0.0, 30.0)
    assert found["phases.xi_b"] == Scatter("phases.xi_b", "direction", 0.0, 360.0)
    assert "tolerances.e_b" not in found, "a tolerance of 0 leaves nothing to draw"
    assert "phases.phi_eb" not in found


def test_what_is_not_given_is_drawn_up_to_what_it_may_be_and_called_assumed(small: Drive) -> None:
    open_ = load_preset(TINY, ["tolerances.e_b=unknown", "harmonics.a_b2=unknown"])
    found = {s.path: s for s in scatters(open_)}
    assert found["tolerances.e_b"].assumed
    assert found["tolerances.e_b"].high > 0
    assert found["harmonics.xi_b2"].high == 180
    assert not any(s.assumed for s in scatters(small))


def test_an_uncertainty_stands_for_a_measured_value(small: Drive) -> None:
    measured = load_preset(TINY, ["tolerances.e_hb=20 ± 4", "phases.phi_hb=10 ± 5", "gears.j_n=6 ± 1"])
    found = {s.path: s for s in scatters(measured)}
    assert found["tolerances.e_hb"] == Scatter("tolerances.e_hb", "normal", 16.0, 24.0)
    assert found["phases.phi_hb"] == Scatter("phases.phi_hb", "normal", 5.0, 15.0)
    assert found["gears.j_n"] == Scatter("gears.j_n", "normal", 5.0, 7.0)
    assert Draws(scatters(measured), 0).moves_system
    assert not Draws(scatters(small), 0).moves_system


def test_a_known_direction_stays(small: Drive) -> None:
    assert "phases.xi_b" not in {s.path for s in scatters(small, known=["phases.xi_b"])}


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"known": ["phases.xi_x"]}, "phases.xi_x is no direction"),
        ({"known": ["tolerances.e_hb"]}, "tolerances.e_hb is no direction"),
        ({"by_field": {"phases.xi_b": "uniform"}}, "phases.xi_b is no size"),
        ({"by_field": {"gears.j_n": "uniform"}}, "gears.j_n is no size"),
    ],
)
def test_other_fields_are_refused(small: Drive, arguments: dict, told: str) -> None:
    with pytest.raises(UsageError, match=told):
        scatters(small, **arguments)


def test_a_direction_that_the_preset_does_not_give_cannot_be_known() -> None:
    with pytest.raises(UsageError, match="does not give it"):
        scatters(load_preset(TINY, ["phases.xi_b=unknown"]), known=["phases.xi_b"])


def test_the_widest_drive_has_each_size_as_great_as_it_can_be(small: Drive) -> None:
    draws = Draws(scatters(small, by_field={"tolerances.e_hb": [5.0, 70.0]}), 0)
    widest = draws.widest(small)
    drawn = draws.values(0, 500)
    assert widest.tolerances.e_hb == 70
    assert all(
        (drawn[f"tolerances.{n}"] <= getattr(widest.tolerances, n)).all() for n in ("F_i1", "F_i2", "e_hb", "e_hh")
    )
    assert widest.phases == small.phases
