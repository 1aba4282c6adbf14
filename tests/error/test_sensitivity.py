"""What a micrometre does to F'_ior."""

import pytest

from hdassist import kinematic_error, load_preset
from hdassist.error.sensitivity import sensitivity
from hdassist.run.run import UNCHECKED
from tests.process import SMALL
from tests.support import changed


def F_ior(**fields) -> float:
    return kinematic_error(changed(load_preset(SMALL), **fields), 1.0, run=UNCHECKED).F_ior_arcsec


def test_slopes_are_those_of_the_full_cycle():
    small = load_preset(SMALL)
    found, _ = sensitivity(small, [kinematic_error(small, M_g, run=UNCHECKED) for M_g in (1.0, 4.0)])
    assert found.j_n == pytest.approx((F_ior(gears__j_n=6.1) - F_ior(gears__j_n=5.9)) / 0.2, abs=0.02)
    assert pytest.approx((F_ior(cam__W_0=0.5801) - F_ior(cam__W_0=0.5799)) / 0.2, abs=0.02) == found.W_0
    # no clearance cannot become less
    assert found.g_b == pytest.approx((F_ior(bearing__g_b=0.1) - F_ior()) / 0.1, abs=0.02)
    # wider flanks and a smaller wave free the wheels, so that more of the deviations shows at a light load
    assert found.j_n > 1
    assert found.W_0 < -1
    assert found.certificate.states == 2 * 2 * 3
    assert found.certificate.max_residual < 1e-8
