"""The cheapest tolerances, where they are known: by the law of costs alone, and by the error of a linear drive."""

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest

from hdassist import Drive, load_preset
from hdassist.belief.steps import MeasurementGain
from hdassist.drive.preset.knowledge import F_p
from hdassist.features.tolerance.production import Production, RandomDrive, production_law
from hdassist.features.tolerance.tightening import Allocator, tolerances
from hdassist.interface.pages.tolerance import allocate_report
from hdassist.run.errors import UntrustedError, Verdict
from tests.helpers.paper import facts_of
from tests.helpers.process import TINY

NONE = [f"tolerances.{name}=0" for name in ("F_i1", "F_i2", "e_hb", "e_hh")]
SOFT = "source.supports.C_3={kind: assumed, range: [50, 80000], ref: judged}"


@pytest.fixture(scope="module")
def oval() -> Drive:
    """A drive whose F'_ior is c (a_g2 + a_b2): no other size deviates, and no contact changes."""
    sets = ["cost.harmonics.a_g2.share=4", "operation.M_g=4", "harmonics.a_g2=0.2", "harmonics.a_b2=0.2"]
    return load_preset(TINY, [*NONE, *sets, "acceptance.F_ior=2000"])


@pytest.fixture(scope="module")
def production(oval: Drive) -> Production:
    law = production_law(oval, "fixed")
    return Production(law, (4.0,), mounting=False, steps=True).with_designs(40)[0]


@pytest.fixture(scope="module")
def here(production: Production) -> float:
    """F'_ior of the drive with the tolerances of its preset."""
    return production.records(0, 1)[0].F_ior_arcsec[0]


def proven(production: Production, count: int) -> list[RandomDrive]:
    return production.records(0, count)


def allocator(production: Production, room: float, drives: int = 40, wanted: float = 0.9, rounds: int = 5) -> Allocator:
    return Allocator(production, (room,), wanted, 0.95, proven, drives, rounds)


def test_laws_come_from_the_preset_or_are_assumed(oval: Drive) -> None:
    a_g2, a_b2 = tolerances(oval, production_law(oval))
    assert (a_g2.path, a_g2.law.share, a_g2.assumed_law) == ("harmonics.a_g2", 4.0, False)
    assert (a_b2.path, a_b2.law.share, a_b2.assumed_law) == ("harmonics.a_b2", 1.0, True)
    assert a_b2.cost(0.1) == 2.0
    assert (a_b2.least, a_b2.most) == pytest.approx((0.02, 0.4))


def test_a_linear_drive_has_the_tolerances_that_lagrange_finds(production: Production, here: float) -> None:
    # a_g2 + a_b2 = 0.36 um, and 4/a_g2 + 1/a_b2 is least where a_g2 = 2 a_b2
    found = allocator(production, 0.9 * here).cheapest(turned=False)
    assert found.fits
    assert found.values["harmonics.a_g2"] == pytest.approx(0.24, rel=0.08)
    assert found.values["harmonics.a_b2"] == pytest.approx(0.12, rel=0.08)
    assert found.cost == pytest.approx(4 * 0.2 / 0.24 + 0.2 / 0.12, rel=0.05)
    assert found.tried.share == 1.0


def test_kinks_of_quantiles_do_not_stop_the_search(production: Production, here: float) -> None:
    # the error of each drive scales by its own random factor, so the quantile over drives has kinks
    def scattered(tried: Production, count: int) -> list[RandomDrive]:
        factors = np.random.default_rng(tried.seed).uniform(0.5, 1.0, count).tolist()
        return [
            replace(
                record,
                best_F_ior_arcsec=(factor * record.best_F_ior_arcsec[0],),
                tighter={path: (factor * F_ior[0],) for path, F_ior in (record.tighter or {}).items()},
            )
            for record, factor in zip(tried.records(0, count), factors, strict=True)
        ]

    search = replace(allocator(production, 0.9 * here, drives=100), records=scattered)
    now = np.array([choice.now for choice in search.choices])
    sought = search._sought(scattered(production, 100), now, 0.98)
    # with one error common to all drives, the cheapest tolerances have the ratio that Lagrange gives
    assert sought[0] / sought[1] == pytest.approx(2.0, rel=0.05)
    assert search._ratio_of(scattered(production, 100), now)(sought) == pytest.approx(0.98, rel=1e-3)


def test_best_holes_never_need_tighter_tolerances(production: Production, here: float) -> None:
    def better_in_best_hole(tried: Production, count: int) -> list[RandomDrive]:
        records = tried.records(0, count)
        if not tried.mounting:
            return records
        return [replace(record, best_F_ior_arcsec=(0.9 * record.best_F_ior_arcsec[0],)) for record in records]

    search = replace(allocator(production, 0.9 * here, rounds=1), records=better_in_best_hole)
    as_assembled = search.cheapest(turned=False)
    in_best_holes = search.cheapest(turned=True, start=as_assembled.values)
    assert as_assembled.fits and in_best_holes.fits
    assert in_best_holes.cost <= as_assembled.cost


def test_what_cannot_be_reached_fails_with_the_least_tolerances(production: Production, here: float) -> None:
    found = allocator(production, 0.05 * here).cheapest(turned=False)
    assert found.verdict is Verdict.FAIL
    assert found.tried.share == 0
    assert dict(found.values) == pytest.approx({"harmonics.a_g2": 0.02, "harmonics.a_b2": 0.02}, rel=0.02)


def test_tolerances_are_as_loose_as_allowed_if_every_drive_passes(production: Production, here: float) -> None:
    found = allocator(production, 10 * here).cheapest(turned=False)
    assert found.fits
    assert dict(found.values) == pytest.approx({"harmonics.a_g2": 0.4, "harmonics.a_b2": 0.4}, rel=0.01)


def test_what_fits_is_the_lower_bound_of_the_yield(production: Production, here: float) -> None:
    found = allocator(production, 10 * here, drives=20, wanted=0.95).cheapest(turned=False)
    assert found.tried.share == 1.0
    assert not found.fits, "20 of 20 drives do not show that 95 % pass"
    assert found.verdict is Verdict.INCONCLUSIVE


def test_next_command_follows_the_recommendation_and_never_repeats_itself(production: Production, here: float) -> None:
    search = allocator(production, 10 * here, drives=20, wanted=0.95)
    found = search.cheapest(turned=False)

    def next_command(verdict: Verdict, *gains: MeasurementGain) -> str:
        return facts_of(allocate_report(search, [replace(found, verdict=verdict)], [0.0], gains, 4.0))["next"]

    measured = next_command(Verdict.INCONCLUSIVE, MeasurementGain("stiffness.K_1", 0.3))
    assert measured.startswith("hdassist allocate ")
    assert measured.endswith(" --yield 0.95 --sure 0.95 -n 20 --set measured.K_1=VALUE")
    assert next_command(Verdict.INCONCLUSIVE).endswith(" -n 80")
    assert next_command(Verdict.FAIL).startswith("hdassist check ")


@pytest.mark.thorough
def test_no_tolerance_is_loosened_if_the_uncertain_design_forbids_it() -> None:
    known = load_preset(TINY, ["operation.M_g=4", "tolerances.e_hb=60"])
    drive = load_preset(TINY, ["operation.M_g=4", "tolerances.e_hb=60", SOFT])
    law = production_law(drive, "fixed")
    alone = Production(production_law(known, "fixed"), (4.0,), mounting=False, steps=True).with_designs(1)[0]
    F_ior = [record.F_ior_arcsec[0] for record in alone.records(0, 50)]
    room = 1.3 * float(np.quantile(F_ior, 0.95))
    loosened = allocator(alone, room, 50, rounds=2).cheapest(turned=False)
    assert loosened.fits
    assert any(loosened.values[c.path] > c.now for c in tolerances(known, law))
    designs = Production(law, (4.0,), mounting=False, per_design=5, steps=True).with_designs(50)[0]
    assert not allocator(designs, room, 50, rounds=1).cheapest(turned=False).fits


def test_classes_are_those_of_the_standard() -> None:
    # d = 160 mm, m = 0.8 mm: (0.002 160 + 0.55 160**0.5 + 0.7 0.8 + 12) um in class 5, and a factor 2**0.5 a class
    drive = load_preset("vzp160")
    classes = [F_p(drive.gears.pitch_diameter, drive.gears.m, grade) for grade in (5, 7)]
    assert classes == pytest.approx([19.837, 2 * 19.837], abs=2e-3)


def test_where_no_drive_can_be_solved_there_is_no_answer(production: Production, here: float) -> None:
    def refused(tried: Production, count: int) -> list[RandomDrive]:
        return [RandomDrive(design=0, weight=1.0, refused="no contact", values={}) for _ in range(count)]

    with pytest.raises(UntrustedError, match="none of 40 drives has a result: no contact"):
        Allocator(production, (here,), 0.9, 0.95, refused, 40, 2).cheapest(turned=False)


def test_drives_without_an_answer_lie_beyond_any_limit(production: Production, here: float) -> None:
    def some_refused(tried: Production, count: int) -> list[RandomDrive]:
        lost = [RandomDrive(design=0, weight=1.0, refused="no contact", values={}) for _ in range(count // 5)]
        return [*tried.records(0, count - len(lost)), *lost]

    found = Allocator(production, (10 * here,), 0.9, 0.95, some_refused, 40, 2).cheapest(turned=False)
    assert not found.fits
    assert found.tried.share == 0.8


def test_drives_without_an_error_bear_the_loosest_tolerances(production: Production) -> None:
    def without_error(production: Production, count: int) -> list[RandomDrive]:
        tighter = dict.fromkeys(("harmonics.a_g2", "harmonics.a_b2"), (0.0,))
        records = proven(production, count)
        return [replace(each, F_ior_arcsec=(0.0,), best_F_ior_arcsec=(0.0,), tighter=tighter) for each in records]

    found = replace(allocator(production, 10.0), records=without_error).cheapest(turned=False)
    assert dict(found.values) == pytest.approx({"harmonics.a_g2": 0.4, "harmonics.a_b2": 0.4}, rel=0.01)


@pytest.mark.thorough
def test_without_verified_tolerances_the_likeliest_attempt_is_the_answer(production: Production, here: float) -> None:
    """The second of three attempts has the greatest probability of the yield, and the last one the greatest cost."""
    chances = iter([0.2, 0.7, 0.4])
    search = allocator(production, here, rounds=2)
    of_drives = Allocator._tried

    def tried(self: Allocator, turned: bool, values: np.ndarray, attempt: int) -> tuple:
        records, allocation = of_drives(self, turned, values, attempt)
        value = next(chances)
        chance = replace(allocation.probability, value=value, low=value, high=value)
        return records, replace(allocation, probability=chance, verdict=Verdict.INCONCLUSIVE, cost=100 * value)

    with mock.patch.object(Allocator, "_tried", tried):
        found = search.cheapest(turned=False)
    assert next(chances, None) is None  # all three were made
    assert not found.fits
    assert (found.probability.value, found.cost) == (0.7, 70.0)
