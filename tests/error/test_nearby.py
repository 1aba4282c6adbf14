"""Drives near a known one, against every state of each."""

import numpy as np
import pytest

from hdassist import kinematic_error, load_preset
from hdassist.error.nearby import Nearby
from hdassist.errors import UsageError
from hdassist.preset.fields import Drive
from tests.process import SMALL
from tests.support import changed

TORQUES = (1.0, 4.0)


@pytest.fixture(scope="module")
def known() -> Nearby:
    return Nearby(load_preset(SMALL), TORQUES)


def every_state(drive: Drive) -> list[float]:
    return [kinematic_error(drive, M_g, cross_check=None).F_ior_arcsec for M_g in TORQUES]


def test_the_known_drive_itself(known: Nearby) -> None:
    assert known.F_ior_arcsec == pytest.approx(every_state(known.drive), abs=0.01)
    assert all(proof.max_residual < 1e-8 for proof in known.certificates)


@pytest.mark.parametrize(
    ("fields", "least"),
    [
        ({"bearing.g_b": 4.0}, 0.5),
        ({"gears.j_n": 7.0}, 5.0),
        ({"contact.c_t": 1.3e-4}, 0.5),
        ({"tolerances.F_i2": 30.0, "supports.C_2": 1e3}, 5.0),
    ],
)
def test_a_drive_that_differs(known: Nearby, fields: dict[str, float], least: float) -> None:
    there = known.drive.with_values(fields)
    found, proofs = known.F_ior(there)
    exact = every_state(there)
    assert np.abs(exact - known.F_ior_arcsec).max() > least, "it moves, or this shows nothing"
    assert found == pytest.approx(exact, rel=5e-3)
    assert all(proof.states < 1860 / 2 for proof in proofs), "that is what it is for"


def test_rolling_balls_have_no_map() -> None:
    rolling = changed(load_preset(SMALL), bearing__ball_motion="rolling", bearing__d_ball=3.0)
    with pytest.raises(UsageError):
        Nearby(rolling, TORQUES)
