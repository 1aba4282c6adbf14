"""Ring compliance against closed forms."""

import numpy as np
import pytest

from hdassist.drive.model.contacts import contact_system, flexspline_ring, outer_ring, plain_ring, shell_twist_stiffness
from hdassist.drive.model.geometry import Geometry
from tests.helpers.support import changed, compliance, rounding

E, I, R = 2.06e5, 128.0, 76.0


def deflection(n_max: int, load_at: np.ndarray, seen_at: float) -> float:
    """Radial displacement at an angle by unit outward loads, inextensible part only."""
    ring = plain_ring(E, 1e12, I, R, n_max)
    return float(ring.radial(np.array([seen_at]))[0] @ (ring.compliance * ring.radial(load_at).sum(axis=0)))


@pytest.mark.parametrize(("n_max", "diametral", "perpendicular"), [(40, 0.148775, 0.136620), (400, 0.148779, 0.136620)])
def test_ring_under_two_opposite_loads(n_max, diametral, perpendicular):
    # Timoshenko, Strength of Materials II: (pi/4 - 2/pi) = 0.14878 and (2/pi - 1/2) = 0.13662 P r^3/(E I)
    loads, unit = np.array([0.0, np.pi]), R**3 / (E * I)
    # a cut at even n_max leaves out sum n > n_max of 4/(pi n^4)
    assert 2 * deflection(n_max, loads, 0.0) / unit == pytest.approx(diametral, abs=2e-6)
    assert -2 * deflection(n_max, loads, np.pi / 2) / unit == pytest.approx(perpendicular, abs=2e-6)


def test_closed_forms_are_those_of_the_textbook():
    unit = R**3 / (E * I)
    loads = np.array([0.0, np.pi])
    assert 2 * deflection(3000, loads, 0.0) / unit == pytest.approx(np.pi / 4 - 2 / np.pi, rel=1e-7)
    assert -2 * deflection(3000, loads, np.pi / 2) / unit == pytest.approx(2 / np.pi - 0.5, rel=1e-7)


def test_uniform_pressure_only_stretches():
    # N equal radial loads P: ring tension N P/(2 pi), stretch r * tension/(E A)
    area, count, load = 96.0, 48, 10.0
    ring = plain_ring(E, area, I, R, 20)
    angles = 2 * np.pi * np.arange(count) / count
    modes = load * ring.radial(angles).sum(axis=0)
    stretch = float(ring.radial(np.array([0.3]))[0] @ (ring.compliance * modes))
    assert stretch == pytest.approx(R * (count * load / (2 * np.pi)) / (E * area), rel=1e-9)


def test_the_mid_line_does_not_stretch_in_bending():
    # w + dv/dtheta = 0 for every mode but n = 0
    ring = plain_ring(E, 96.0, I, R, 12)
    theta, h = np.linspace(0, 2 * np.pi, 37), 1e-6
    slope = (ring.tangential(theta + h, 0.0) - ring.tangential(theta - h, 0.0)) / (2 * h)
    assert np.abs(ring.radial(theta)[:, 1:] + slope[:, 1:]).max() < 1e-8


def test_a_point_above_the_mid_line_moves_with_the_section():
    # chi = (v - dw/dtheta)/r, by differences
    ring, theta, h, height = plain_ring(E, 96.0, I, R, 12), np.linspace(0, 6, 31), 1e-6, 3.0
    slope = (ring.radial(theta + h) - ring.radial(theta - h)) / (2 * h)
    section = (ring.tangential(theta, 0.0) - slope) / R
    section[:, 0] = 0
    assert ring.tangential(theta, height) == pytest.approx(ring.tangential(theta, 0.0) + height * section, abs=1e-7)


def test_bending_stiffness_of_the_flexspline_adds_rim_and_shell(reference):
    geometry = Geometry.of(reference)
    f, m = reference.flexspline, reference.material
    D = m.E * f.h_3**3 / (12 * (1 - m.nu**2))
    L, n = f.l - f.b_w, 2
    rim = f.k_t * m.E * f.b_w * f.h_1**3 / 12
    bending = np.pi * (rim + D * L / 3) * (n**2 - 1) ** 2 / geometry.r_m**3
    twist = 2 * np.pi * D * (1 - m.nu) * (n**2 - 1) ** 2 / (n**2 * geometry.r_m * L)
    assert flexspline_ring(reference, geometry).stiffness[1] == pytest.approx(bending + twist, rel=1e-12)


def test_shell_alone_is_a_thin_tube(reference):
    # model reference: 2.29e6 N*m/rad
    assert shell_twist_stiffness(reference, Geometry.of(reference)) / 1e3 == pytest.approx(2.29e6, rel=0.005)


def test_compliance_is_reciprocal_and_positive(reference):
    for drive in (reference, changed(reference, numerics__n_2=24, bearing__beta=0.3)):
        D = compliance(contact_system(drive))
        assert np.abs(D - D.T).max() <= rounding(2 * reference.numerics.n_max, D.max())
        assert np.linalg.eigvalsh(D)[0] >= 0.999 * min(drive.contact.c_bore, drive.contact.c_t, drive.contact.c_ball)


def test_sections_of_both_rings_by_hand(reference):
    geometry, f, b, E_ = Geometry.of(reference), reference.flexspline, reference.bearing, reference.material.E
    outer, rim = outer_ring(reference, geometry), flexspline_ring(reference, geometry)
    r = geometry.r_m - f.h_1 / 2 - b.ring_h / 2
    assert outer.radius == pytest.approx(r)
    assert outer.stiffness[0] == pytest.approx(2 * np.pi * E_ * b.ring_b * b.ring_h / r)
    assert outer.stiffness[2] == pytest.approx(np.pi * E_ * b.ring_b * b.ring_h**3 / 12 * 64 / r**3)
    edge_zone = f.h_3 * np.sqrt(geometry.r_m * f.h_3) / (2 * 1.285)
    assert rim.stiffness[0] == pytest.approx(2 * np.pi * E_ * (f.b_w * f.h_1 + edge_zone) / geometry.r_m)
    for ring in (outer, rim):
        assert ring.order.tolist() == [0, *range(2, 41)]
        assert len(ring.stiffness) == 40
