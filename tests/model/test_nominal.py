"""The shape of the rim on the cam."""

import numpy as np
import pytest
from scipy.integrate import quad

from hdassist.drive.model.geometry import nominal_shape

W_0, R = 0.96, 80.7
THETA = np.radians([-200, -90, -30, 0, 3, 17, 45, 60, 90, 135, 180, 300])


def test_the_linear_shape_is_the_rings_bending_mode():
    w, v, chi = nominal_shape(THETA, W_0, R)
    slope = -2 * W_0 * np.sin(2 * THETA)
    assert w == pytest.approx(W_0 * np.cos(2 * THETA))
    # no stretch: w + dv/dtheta = 0
    assert (nominal_shape(THETA + 1e-6, W_0, R)[1] - v) / 1e-6 == pytest.approx(-w, abs=1e-5)
    assert chi == pytest.approx((v - slope) / R)


@pytest.mark.parametrize("wave", [0.2, 0.96, 4.0])
def test_the_inextensible_curve_keeps_its_length(wave):
    top, minor = (nominal_shape(np.array([angle]), wave, R, "inextensible")[0][0] for angle in (0.0, np.pi / 2))
    assert top == pytest.approx(wave, abs=1e-12)
    r_0, amplitude = R + (top + minor) / 2, (top - minor) / 2

    def arc(phi: float) -> float:
        speed = lambda p: np.hypot(r_0 + amplitude * np.cos(2 * p), 2 * amplitude * np.sin(2 * p))  # noqa: E731
        return quad(speed, 0, phi, epsabs=1e-12)[0]

    assert arc(2 * np.pi) == pytest.approx(2 * np.pi * R, abs=1e-9)
    w, v, chi = nominal_shape(THETA, wave, R, "inextensible")
    for theta, w_i, v_i, chi_i in zip(THETA, w, v, chi, strict=True):
        phi = theta + v_i / R
        assert arc(phi) == pytest.approx(R * theta, abs=1e-9)
        assert R + w_i == pytest.approx(r_0 + amplitude * np.cos(2 * phi), abs=1e-12)
        # the section stands normal to the curve
        assert np.tan(chi_i) == pytest.approx(2 * amplitude * np.sin(2 * phi) / (R + w_i), abs=1e-12)


def test_small_waves_agree_but_for_the_axes_of_the_turn():
    # the mode's chi counts from the undeformed radius, the curve's from the radius where the section stands
    wave = 1e-4
    (w, v, chi), (w_i, v_i, chi_i) = (nominal_shape(THETA, wave, R, curve) for curve in ("linear", "inextensible"))
    assert w_i == pytest.approx(w, abs=1e-5 * wave)
    assert v_i == pytest.approx(v, abs=1e-5 * wave)
    assert chi_i == pytest.approx(chi - v / R, abs=1e-5 * wave / R)
