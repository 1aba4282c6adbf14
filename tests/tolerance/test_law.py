"""What random drives are drawn from: laws against their densities, drives the same whatever is drawn beside them."""

from dataclasses import replace

import numpy as np
import pytest

from hdassist import Drive, load_preset
from hdassist.belief.prior import prior_of
from hdassist.features.tolerance.production import RAYLEIGH_TAIL, TolerancedSize, production_law
from hdassist.run.errors import UsageError
from tests.helpers.process import ASSUMED, TINY


@pytest.fixture(scope="module")
def tiny() -> Drive:
    return load_preset(TINY)


EVEN = (np.arange(20_000) + 0.5) / 20_000


def size(law: str, high: float) -> TolerancedSize:
    path = "tolerances.e_hb"
    return TolerancedSize(path, "even", 0.0, high, "drive", path, "its tolerance", law=law)


def test_rayleigh_size_ends_at_its_tolerance_with_the_rayleigh_density() -> None:
    values = size("rayleigh", 60.0).value(EVEN)
    x, y = np.random.default_rng(1).normal(0, 60 / RAYLEIGH_TAIL, (2, 200_000))
    parts = np.hypot(x, y)
    parts = parts[parts <= 60]
    assert values.max() <= 60
    assert values.mean() == pytest.approx(parts.mean(), rel=3e-3)
    for share in (0.1, 0.5, 0.9):
        assert np.quantile(values, share) == pytest.approx(np.quantile(parts, share), rel=6e-3)


def test_a_drive_is_the_same_whatever_is_drawn_beside_it(tiny: Drive) -> None:
    law = production_law(tiny)
    assert law.values(5, 7) == law.values(5, 7)
    assert len({law.values(5, k)["phases.xi_b"] for k in range(50)}) == 50
    assert law.scaled({"tolerances.e_hb": 0.5}).values(5, 7) == {
        path: value * (0.5 if path == "tolerances.e_hb" else 1) for path, value in law.values(5, 7).items()
    }


def test_ranges_derived_from_a_tolerance_scale_with_it() -> None:
    drive = load_preset(TINY, ["harmonics.a_b2=unknown", "harmonics.a_b3=unknown"])
    law, F_i2 = production_law(drive), drive.number("tolerances.F_i2")
    assert law.following("tolerances.F_i2") == ["harmonics.a_b2", "harmonics.a_b3"]
    assert law.following("tolerances.e_hb") == []
    tighter = production_law(drive.with_values({"tolerances.F_i2": 0.5 * F_i2}))
    scaled = law.scaled({"tolerances.F_i2": 0.5})
    assert [(f.path, f.low, f.high) for f in scaled.own] == [(f.path, f.low, f.high) for f in tighter.own]


def test_given_sizes_vary_up_to_tolerance_and_directions_are_random(tiny: Drive) -> None:
    found = {f.path: f for f in production_law(tiny).own}
    assert found["tolerances.e_hb"] == size("rayleigh", 30.0)
    direction = found["phases.xi_b"]
    assert (direction.low, direction.high, direction.is_any_direction) == (0.0, 360.0, True)
    assert "tolerances.e_b" not in found, "a tolerance of 0 leaves no size to draw"
    assert "phases.phi_eb" not in found


def test_what_has_no_tolerance_is_drawn_as_check_draws_it() -> None:
    sets = [
        "tolerances.e_b=unknown",
        "harmonics.a_b2=unknown",
        "source.tolerances.F_i2={kind: assumed, range: [0, 47]}",
    ]
    drive = load_preset(TINY, [*sets, "tolerances.e_hb=20 ± 4", "phases.phi_hb=10 ± 5"])
    law, prior = production_law(drive), {f.path: f for f in prior_of(drive).fields}
    own = {f.path: f for f in law.own}
    for path in ("tolerances.e_b", "harmonics.a_b2", "tolerances.F_i2", "tolerances.e_hb", "phases.phi_hb"):
        assert own[path] == prior[path]
    assert set(law.not_given) == {"tolerances.e_b", "harmonics.a_b2", "tolerances.F_i2"}
    each_its_own = replace(law, shared=law.shared + law.own, own=())  # as sensitivity has it
    assert set(each_its_own.not_given) == set(law.not_given)
    assert own["harmonics.xi_b2"].high == 180
    assert "tolerances.F_i2" not in {f.path for f in law.tolerances}
    # where tolerances are to be chosen a size that is assumed is one of them
    assert {f.path for f in production_law(drive, chosen=True).tolerances} - {f.path for f in law.tolerances} == {
        "tolerances.F_i2"
    }


def test_designs_share_unknown_inputs_and_drives_have_their_own_clearances() -> None:
    sets = [ASSUMED, "contact.c_t=6e-5 ± 1e-5", "gears.j_n=18 ± 1"]
    law = production_law(load_preset(TINY, sets))
    assert {f.path for f in law.shared} == {"bearing.g_b", "contact.c_t"}
    assert "gears.j_n" in {f.path for f in law.own}
    assert "gears.j_n" not in {f.path for f in production_law(load_preset(TINY, sets[:2])).own}


def test_a_known_direction_stays(tiny: Drive) -> None:
    assert "phases.xi_b" not in {f.path for f in production_law(tiny, known=["phases.xi_b"]).own}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"known": ["phases.xi_x"]}, "invalid --known phases.xi_x"),
        ({"known": ["tolerances.e_hb"]}, "invalid --known tolerances.e_hb"),
    ],
)
def test_other_fields_are_refused(tiny: Drive, arguments: dict, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        production_law(tiny, **arguments)


def test_direction_missing_in_the_preset_cannot_be_known() -> None:
    with pytest.raises(UsageError, match="expected a direction that the preset states"):
        production_law(load_preset(TINY, ["phases.xi_b=unknown"]), known=["phases.xi_b"])
