"""F'_ior over what is not known: against the whole range of a single unknown, and as a check judges it."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.design.check import check
from hdassist.error.cycle import kinematic_error
from hdassist.error.unknown_range import unknown_ranges
from hdassist.verdict import Verdict
from tests.process import SMALL

ONE = ("phases.phi_hb=unknown", "operation.M_g=4")


@pytest.fixture(scope="module")
def over():
    return unknown_ranges(load_preset(SMALL, ONE), (4.0,), draws=80)[0]


def test_one_unknown_direction_spans_what_a_walk_around_it_finds(over):
    drive = load_preset(SMALL, ONE)
    around = [
        kinematic_error(drive.with_values({"phases.phi_hb": float(a)}), 4.0, cross_check=None).F_ior_arcsec
        for a in range(0, 360, 10)
    ]
    assert over.worst == pytest.approx(max(around), rel=0.01)
    assert over.F_ior_arcsec[0] == pytest.approx(min(around), rel=0.02)
    for share in (0.05, 0.5, 0.95):
        assert over.quantile(share) == pytest.approx(np.quantile(around, share), rel=0.05)
    assert over.low < over.median < over.high < over.worst
    assert over.certificate.max_residual <= 1e-8


def test_what_is_known_has_no_range_and_rolling_balls_have_none():
    assert unknown_ranges(load_preset(SMALL), (4.0,)) == ()
    rolling = load_preset(SMALL, [*ONE, "bearing.ball_motion=rolling", "bearing.d_ball=2"])
    assert unknown_ranges(rolling, (4.0,)) == ()


def test_the_same_digits_from_any_number_of_workers(over):
    told: list[int] = []
    with ThreadPoolExecutor(2) as executor:
        again = unknown_ranges(load_preset(SMALL, ONE), (4.0,), draws=80, executor=executor, progress=told.append)[0]
    assert np.array_equal(again.F_ior_arcsec, over.F_ior_arcsec)
    assert sum(told) == again.certificate.states


def test_a_check_passes_or_fails_only_where_nearly_all_of_it_does():
    (point,) = check(load_preset(SMALL, ONE), draws=20).points
    own, over = point.self_error.range_arcsec, point.over

    def verdict(limit: float, **change) -> Verdict:
        return replace(point, limit_arcsec=limit, **change).verdict

    assert verdict(over.high + own + 0.01) is Verdict.PASS
    assert verdict(over.high + own - 0.01) is verdict(over.low + own + 0.01) is Verdict.INCONCLUSIVE
    assert verdict(over.low + own - 0.01) is Verdict.FAIL
    # without a range nothing is settled, however wide the limit; where all is known it is the value that counts
    assert verdict(1000.0, over=None) is Verdict.INCONCLUSIVE
    assert verdict(1000.0, over=None, open_=False) is Verdict.PASS


def test_an_uncertainty_alone_is_judged_by_its_range_too():
    known = check(load_preset(SMALL, ["operation.M_g=4"]), draws=64)
    spread = ["operation.M_g=4", "phases.xi_b=90±60", "flexspline.h_1=0.35±0.01"]
    (point,) = check(load_preset(SMALL, spread), draws=64).points
    assert known.points[0].over is None
    assert point.over is not None
    assert point.over.high - point.over.low > 1
    for limit, verdict in ((point.over.low - 1, Verdict.FAIL), (point.over.median, Verdict.INCONCLUSIVE)):
        held = replace(point, limit_arcsec=limit + point.self_error.range_arcsec)
        assert held.verdict is verdict
    found = check(load_preset(SMALL, spread), draws=20)
    assert found.uncertain == ("phases.xi_b",)
    assert "the uncertainty of flexspline.h_1 is not in F'_ior" in found.warnings
