"""What a tighter tolerance brings against drives that were drawn so, and what to measure before one is tightened."""

from dataclasses import replace

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.belief.statistics import weighted_quantile
from hdassist.features.tolerance.production import TIGHTER_STEP, Production, RandomDrive, production_law
from hdassist.features.tolerance.tightening import Sensitivities, sensitivities, to_measure, worst_torque
from hdassist.interface.pages.tolerance import sensitivity_report
from tests.helpers.paper import facts_of
from tests.helpers.process import TINY

SOFT = "source.supports.C_3={kind: assumed, range: [50, 80000], ref: judged}"


def proven(production: Production, count: int) -> list[RandomDrive]:
    return production.records(0, count)


def found_of(
    preset: str, sets: list[str], count: int, law_of_sizes: str = "rayleigh"
) -> tuple[Production, Sensitivities]:
    drive = load_preset(preset, sets)
    law = production_law(drive, law_of_sizes)
    own = replace(law, shared=law.shared + law.own, own=())
    production = Production(own, drive.operation.M_g, mounting=False, per_design=1, steps=True)
    production, samples = production.with_designs(count)
    assert samples
    return production, sensitivities(production, samples, proven)


def stated_percent(cell: str) -> float:
    """Reduction [%] that a cell of the page states before its interval."""
    return float(cell.removeprefix("≤ ").partition(" ")[0])


@pytest.fixture(scope="module")
def oval() -> tuple[Production, Sensitivities]:
    """A drive whose F'_ior is c (a_g2 + a_b2): no other size deviates, and no contact changes."""
    none = [f"tolerances.{name}=0" for name in ("F_i1", "F_i2", "e_hb", "e_hh")]
    return found_of(TINY, [*none, "harmonics.a_g2=0.2", "harmonics.a_b2=0.1", "operation.M_g=4"], 48, "uniform")


@pytest.mark.thorough
def test_larger_contribution_of_a_linear_drive_is_tightened_first(oval: tuple[Production, Sensitivities]) -> None:
    production, found = oval
    assert found.is_worth_tightening
    assert found.first.path == "harmonics.a_g2"
    assert found.first.proven
    sizes = {path: np.array([v[path] for v, _ in production.designs]) for path in ("harmonics.a_g2", "harmonics.a_b2")}
    F = np.array([r.F_ior_arcsec[0] for r in production.records(0, 48)])
    factor = np.median(F / sum(sizes.values()))
    then = factor * (TIGHTER_STEP * sizes["harmonics.a_g2"] + sizes["harmonics.a_b2"])
    assert found.first.then == pytest.approx(weighted_quantile(then, np.ones(48), 0.95), rel=0.02)
    assert found.first.low < found.first.then < found.first.high < found.first.now


def test_contributions_of_a_linear_drive_follow_its_sizes(oval: tuple[Production, Sensitivities]) -> None:
    shares = {each.group: each.share for each in oval[1].influences[0]}
    assert list(shares) == ["harmonics.a_g2", "harmonics.a_b2"]
    assert sum(shares.values()) > 0.8
    report = sensitivity_report(oval[1])
    assert report.line.startswith("tighten first: ")
    first, second = report.blocks[0].rows  # type: ignore[union-attr]
    assert first[0] == "amplitude of the flexspline's tooth deviations with 2 periods per revolution (harmonics.a_g2)"
    assert second[0].endswith(" (harmonics.a_b2)")
    assert stated_percent(first[-1]) > stated_percent(second[-1])


@pytest.mark.thorough
def test_unknown_support_is_measured_before_any_tolerance_is_tightened() -> None:
    _, found = found_of(TINY, [SOFT, "operation.M_g=4", "tolerances.e_hb=60"], 64, "fixed")
    assert found.largest and found.largest.group == "supports.C_3"
    assert not found.is_worth_tightening
    assert found.to_measure[0].measured == "supports.C_3"
    report = sensitivity_report(found)
    assert report.verdict == "no tolerance; measure radial support stiffness of the wave generator (supports.C_3)"
    assert "If a tolerance is 20 % tighter, the 95th percentile" in report.why[0]
    assert facts_of(report)["next"].endswith(" --set supports.C_3=VALUE")


@pytest.mark.thorough
def test_recommended_measurement_is_for_the_governing_torque() -> None:
    sets = [SOFT, "operation.M_g=[1, 4]", "acceptance.F_ior.1=1e5", "acceptance.F_ior.4=50"]
    production, found = found_of(TINY, sets, 32)
    assert found.worst == worst_torque(production.drive, found.samples) == 1
    assert worst_torque(load_preset(TINY, [*sets, "acceptance.F_ior.1=1"]), found.samples) == 0
    assert found.to_measure == to_measure(found.law, found.samples, 1) != to_measure(found.law, found.samples, 0)
    words = facts_of(sensitivity_report(found))["measure"]
    assert "narrows the spread of F'_ior at 4 N·m by " in words
