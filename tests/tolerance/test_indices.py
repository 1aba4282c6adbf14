"""Sobol indices against analytic ones, tighter tolerances against drives that were drawn so."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import sobol_indices

from hdassist import Drive, load_preset
from hdassist.tolerance.indices import (
    TIGHTER,
    Design,
    first_and_total,
    indices,
    likelier,
    of_bases,
    tightened,
    weighted_quantile,
)
from hdassist.tolerance.production import Production
from hdassist.tolerance.scatter import Draws, Scatter, scatters
from tests.process import SMALL

SIZES = tuple(Scatter(f"tolerances.{name}", "uniform", 0.0, high) for name, high in (("F_i1", 6.0), ("e_hb", 3.0)))
PHASE = Scatter("phases.phi_hb", "direction", 0.0, 360.0)


@pytest.fixture(scope="module")
def small() -> Drive:
    return load_preset(SMALL)


def test_an_additive_function_has_the_shares_of_its_parts(small: Drive) -> None:
    design = Design.of(small, Draws((*SIZES, PHASE), 3), 2048)
    assert [name for name, _ in design.groups] == ["tolerances.F_i1", "tolerances.e_hb"]
    values = design.values(0, design.total)
    additive = values["tolerances.F_i1"] + values["tolerances.e_hb"]
    (found,) = indices(design, additive[:, None])
    assert found.first == pytest.approx([0.8, 0.2], abs=0.01)  # 6**2 to 3**2
    assert found.total == pytest.approx([0.8, 0.2], abs=0.01)
    assert (found.first_bounds[:, 0] < found.first).all()
    assert (found.first < found.first_bounds[:, 1]).all()


def test_a_product_is_shared_as_ishigami_and_homma_have_it(small: Drive) -> None:
    # f = x1 cos(x2), x2 a direction and in the same group as x3: alone x1 says nothing, x2 everything it can
    design = Design.of(small, Draws((*SIZES, PHASE), 3), 4096)
    values = design.values(0, design.total)
    product = values["tolerances.F_i1"] * np.cos(np.radians(values["phases.phi_hb"]))
    (found,) = indices(design, np.stack([product], axis=1))
    assert found.first == pytest.approx([0.0, 0.75], abs=0.02)  # E[x1]^2 / E[x1^2] = 9/12
    assert found.total == pytest.approx([0.25, 1.0], abs=0.02)


@pytest.mark.parametrize("count", [16, 17, 20, 1000])
@pytest.mark.parametrize("names", [("tolerances.F_i1",), ("tolerances.F_i1", "tolerances.e_hb")])
def test_any_number_of_drives_has_indices_at_each_torque(small: Drive, count: int, names: tuple[str, ...]) -> None:
    design = Design.of(small, Draws(tuple(s for s in SIZES if s.path in names), 3), count)
    values = design.values(0, design.total)
    sums = np.sum([values[name] for name in names], axis=0)
    F_ior = np.stack([sums, 3 * sums + 5, np.full(design.total, 7.0)], axis=1)
    found = indices(design, F_ior)
    assert [each.total.shape for each in found] == [(len(names),)] * 3
    assert found[1].first == pytest.approx(found[0].first, abs=1e-12)
    assert found[0].total.sum() == pytest.approx(1, abs=0.4 if count < 1000 else 0.02)
    assert not found[2].first.any() and not found[2].total.any()


def test_the_indices_are_those_of_scipy_where_it_has_them() -> None:
    blocks = np.random.default_rng(2).normal(50, 9, (5, 2, 64))
    theirs = sobol_indices(func={"f_A": blocks[0], "f_B": blocks[1], "f_AB": blocks[2:]}, n=64)
    first, total = first_and_total(blocks)
    np.testing.assert_allclose(first, theirs.first_order, rtol=1e-10)
    np.testing.assert_allclose(total, theirs.total_order, rtol=1e-10)


def test_two_ovalities_share_the_error_as_a_linear_drive_has_it(small: Drive) -> None:
    # both wheels' second harmonics meet all over the cycle, so F'_ior = c (a_g2 + a_b2) as long as no contact changes
    none = {f"tolerances.{name}": 0.0 for name in ("F_i1", "F_i2", "e_hb", "e_hh")}
    oval = small.with_values(none | {"harmonics.a_g2": 0.2, "harmonics.a_b2": 0.1})
    design = Design.of(oval, Draws(scatters(oval, "uniform"), 1), 64)
    production = Production.of(oval, design, (4.0,), mounting=False).tabled()
    F_ior = np.array([record.F_ior_arcsec for record in production.records(0, design.total)])
    (found,) = indices(design, F_ior)
    assert dict(zip([name for name, _ in design.groups], found.first, strict=True)) == pytest.approx(
        {"harmonics.a_g2": 0.8, "harmonics.a_b2": 0.2}, abs=0.04
    )
    assert found.first == pytest.approx(found.total, abs=0.04)


@pytest.mark.parametrize("kind", ["rayleigh", "uniform"])
def test_weighted_drives_are_those_of_a_tighter_tolerance(kind: str) -> None:
    scatter = Scatter("tolerances.e_hb", kind, 0.0, 50.0)
    share = (np.arange(40_000) + 0.5) / 40_000
    size = scatter.at(share)
    weight = likelier(scatter, size)
    there = replace(scatter, high=50.0 * TIGHTER).at(share)
    assert weight.mean() == pytest.approx(1, abs=2e-3)
    assert (weight * size**2).mean() == pytest.approx((there**2).mean(), rel=2e-3)
    for quantile in (0.3, 0.95):
        assert weighted_quantile(size, weight, quantile) == pytest.approx(np.quantile(there, quantile), rel=2e-3)


def test_what_is_told_of_a_tighter_tolerance_is_its_quantile(small: Drive) -> None:
    design = Design.of(small, Draws(SIZES, 3), 2048)
    drawn = design.values(0, 2 * design.count)
    F_ior = (drawn["tolerances.F_i1"] + drawn["tolerances.e_hb"])[:, None]
    records = [{path: float(v[k]) for path, v in drawn.items()} for k in range(2 * design.count)]
    ((F_i1, e_hb),) = tightened(design, F_ior, of_bases(design, records))
    rng = np.random.default_rng(0)
    expected = np.quantile(6 * TIGHTER * rng.random(400_000) + 3 * rng.random(400_000), 0.95)
    assert F_i1.path == "tolerances.F_i1"
    assert F_i1.then == pytest.approx(expected, rel=0.01)
    assert F_i1.low < expected < F_i1.high
    assert F_i1.then < e_hb.then < e_hb.now
    assert F_i1.effective == pytest.approx(TIGHTER * 2 * design.count, rel=0.05)
