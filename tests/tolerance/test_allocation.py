"""The cheapest tolerances, where they are known: by the law of costs alone, and by the error of a linear drive."""

import numpy as np
import pytest

from hdassist import Drive, load_preset
from hdassist.model.unknown import pitch_deviation
from hdassist.preset.fields import CostLaw
from hdassist.tolerance.allocation import Allocator, Tolerance, _cheapest, loosest, tolerances
from hdassist.tolerance.production import Production, RandomDrive
from hdassist.tolerance.scatter import Draws, scatters
from tests.process import SMALL


@pytest.fixture(scope="module")
def oval() -> Drive:
    """A drive whose F'_ior is c (a_g2 + a_b2): nothing else deviates, and no contact changes."""
    none = {f"tolerances.{name}": 0.0 for name in ("F_i1", "F_i2", "e_hb", "e_hh")}
    drive = load_preset(SMALL, ["cost.harmonics.a_g2.share=4", "operation.M_g=4"])
    return drive.with_values(none | {"harmonics.a_g2": 0.2, "harmonics.a_b2": 0.2})


@pytest.fixture(scope="module")
def production(oval: Drive) -> Production:
    draws = Draws(scatters(oval, "fixed"), 0)
    found = Production.of(oval, loosest(oval, draws), (4.0,), mounting=False).tabled()
    return found.drawing(draws)


def proven(production: Production, count: int) -> list[RandomDrive]:
    return production.records(0, count)


def test_laws_come_from_the_preset_or_are_assumed(oval: Drive) -> None:
    a_g2, a_b2 = tolerances(oval, Draws(scatters(oval), 0))
    assert (a_g2.path, a_g2.law.share, a_g2.assumed_law) == ("harmonics.a_g2", 4.0, False)
    assert (a_b2.path, a_b2.law.share, a_b2.assumed_law) == ("harmonics.a_b2", 1.0, True)
    assert a_b2.cost(0.1) == 2.0
    assert (a_b2.least, a_b2.most) == pytest.approx((0.02, 0.4))


def test_a_linear_drive_has_the_tolerances_that_lagrange_finds(oval: Drive, production: Production) -> None:
    here = production.records(0, 1)[0].F_ior_arcsec[0]
    room = 0.9 * here  # so a_g2 + a_b2 = 0.36 um, and 4/a_g2 + 1/a_b2 is least where a_g2 = 2 a_b2
    found = Allocator(production, [room], 0.95, proven, 20).cheapest(turned=False)
    assert found.fits
    assert found.values["harmonics.a_g2"] == pytest.approx(0.24, rel=0.08)
    assert found.values["harmonics.a_b2"] == pytest.approx(0.12, rel=0.08)
    assert found.cost == pytest.approx(4 * 0.2 / 0.24 + 0.2 / 0.12, rel=0.05)
    assert found.tried.share == 1.0


def test_what_cannot_be_reached_is_told_with_the_least_tolerances(production: Production) -> None:
    here = production.records(0, 1)[0].F_ior_arcsec[0]
    found = Allocator(production, [0.05 * here], 0.95, proven, 20).cheapest(turned=False)
    assert not found.fits
    assert found.tried.share == 0
    assert dict(found.values) == pytest.approx({"harmonics.a_g2": 0.02, "harmonics.a_b2": 0.02}, rel=0.02)


def test_where_anything_passes_tolerances_are_as_loose_as_they_may_be(production: Production) -> None:
    here = production.records(0, 1)[0].F_ior_arcsec[0]
    found = Allocator(production, [10 * here], 0.95, proven, 20).cheapest(turned=False)
    assert found.fits
    assert dict(found.values) == pytest.approx({"harmonics.a_g2": 0.4, "harmonics.a_b2": 0.4}, rel=0.01)


def test_the_cheapest_on_a_line_is_where_costs_grow_alike() -> None:
    choices = [
        Tolerance(name, 1.0, 0.01, 100.0, CostLaw(share=share, k=k), False)
        for name, share, k in (("a", 8.0, 1.0), ("b", 1.0, 2.0))
    ]
    found = _cheapest(choices, np.zeros(2), 0.5, np.array([1.0, 1.0]), [(-3.0, 3.0)] * 2)
    assert found.sum() == pytest.approx(-0.5, abs=1e-6)
    growth = [
        choice.law.share * choice.law.k * np.exp(-choice.law.k * x) for choice, x in zip(choices, found, strict=True)
    ]
    assert growth[0] == pytest.approx(growth[1], rel=1e-3)


def test_classes_are_those_of_the_standard() -> None:
    # d = 160 mm, m = 0.8 mm: (0.002 160 + 0.55 160**0.5 + 0.7 0.8 + 12) um in class 5, and a factor 2**0.5 a class
    drive = load_preset("vzp160")
    assert pitch_deviation(drive, 5) == pytest.approx(19.837, abs=1e-3)
    assert pitch_deviation(drive, 7) == pytest.approx(2 * pitch_deviation(drive, 5))


def test_wheels_of_whole_classes_cost_more_and_still_pass() -> None:
    drive = load_preset(SMALL, ["operation.M_g=4", "tolerances.e_hh=0", "tolerances.e_hb=0"])
    draws = Draws(scatters(drive, "fixed", known=["phases.xi_g", "phases.xi_b"]), 0)
    production = Production.of(drive, loosest(drive, draws), (4.0,), mounting=False).tabled().drawing(draws)
    room = production.records(0, 1)[0].F_ior_arcsec[0]
    allocator = Allocator(production, [room], 0.95, proven, 20)
    free = allocator.cheapest(turned=False)
    whole = allocator.in_classes(free)
    assert set(whole.classes) == {"tolerances.F_i1", "tolerances.F_i2"}
    for path, grade in whole.classes.items():
        assert whole.values[path] == pytest.approx(pitch_deviation(drive, grade))
    assert whole.fits
    assert whole.cost >= 0.98 * free.cost
