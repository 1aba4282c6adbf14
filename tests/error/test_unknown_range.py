"""F'_ior over what is not known: against the whole range of a single unknown."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.error.cycle import kinematic_error
from hdassist.error.unknown_range import unknown_ranges
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
