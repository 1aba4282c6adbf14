"""Flanks and nominal gaps against an independently drawn tooth pair."""

from dataclasses import replace

import numpy as np
import pytest

from hdassist.drive.model import contacts
from hdassist.drive.model.contacts import ROTATION, contact_system, flexspline_ring, outer_ring
from hdassist.drive.model.geometry import Geometry, Wheel, flank_candidates, flank_gap, flank_point
from hdassist.run.errors import Fault, UntrustedError
from tests.helpers.support import changed, solve_state


def drawn_flank(m: float, z: int, x: float, radii: np.ndarray, side: float) -> np.ndarray:
    """Points (x, y) of a tooth's flank, tooth along +x, by unrolling a string from the base circle.

    Nothing is shared with the model: the tooth's thickness comes from the rack, the curve from the string.
    """
    alpha = np.radians(20)
    r, r_base = m * z / 2, m * z / 2 * np.cos(alpha)
    thickness = m * (np.pi / 2 + 2 * x * np.tan(alpha))  # arc on the pitch circle
    unrolled = np.sqrt(radii**2 - r_base**2) / r_base  # string length over r_base = roll angle
    polar = unrolled - np.arctan(unrolled)
    at_pitch = np.tan(alpha) - np.arctan(np.tan(alpha))
    angle = thickness / (2 * r) + at_pitch - polar
    return np.stack([radii * np.cos(angle), side * radii * np.sin(angle)], axis=1)


def drawn_gap(drive, i: int, zone: int, side: float) -> float:
    """Least distance between the drawn flank of tooth i and the drawn flank of its space, mm."""
    g = drive.gears
    r_f = g.m * (g.z_g + 2 * g.x_g - 2 * g.h_f) / 2
    r_m = r_f - drive.flexspline.h_1 / 2
    tip_g, tip_b = g.m * (g.z_g + 2 * g.x_g + 2 * g.h_a) / 2, g.m * (g.z_b + 2 * g.x_b - 2 * g.h_a) / 2
    theta, W_0 = 2 * np.pi * i / g.z_g, drive.cam.W_0
    w, v = W_0 * np.cos(2 * theta), -W_0 / 2 * np.sin(2 * theta)
    chi = 1.5 * W_0 * np.sin(2 * theta) / r_m  # (v - w')/r
    flank = drawn_flank(g.m, g.z_g, g.x_g, np.linspace(r_f + 0.2 * g.m, tip_g, 4001), side) - [r_m, 0]
    turn = chi + theta + v / r_m
    rotated = flank @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    placed = rotated + (r_m + w) * np.array([np.cos(theta + v / r_m), np.sin(theta + v / r_m)])
    placed = placed[np.hypot(*placed.T) >= tip_b]

    axis = zone * np.pi
    space = axis + (theta - axis) * g.z_g / g.z_b
    other = drawn_flank(g.m, g.z_b, g.x_b, np.linspace(tip_b - 0.3, tip_b + 3, 60001), side)
    other = other @ np.array([[np.cos(space), np.sin(space)], [-np.sin(space), np.cos(space)]])
    steps = np.diff(other, axis=0)
    normals = side * np.stack([-steps[:, 1], steps[:, 0]], axis=1) / np.hypot(*steps.T)[:, None]
    gaps = []
    for point in placed[:: max(1, len(placed) // 200)]:
        nearest = np.argmin(np.hypot(*(other[:-1] - point).T))
        gaps.append(float((other[nearest] - point) @ normals[nearest]))
    return min(gaps)


@pytest.mark.thorough
@pytest.mark.parametrize(("i", "zone", "side"), [(0, 0, 1.0), (5, 0, 1.0), (5, 0, -1.0), (-9, 0, 1.0), (104, 1, -1.0)])
def test_nominal_gap_is_that_of_a_drawn_pair(reference, i, zone, side):
    flanks = flank_candidates(Geometry.of(reference))
    k = np.flatnonzero((flanks.tooth == i) & (flanks.zone == zone) & (flanks.side == side))[0]
    # normal distance against the model's distance along the involute's tangent: they differ by the
    # flanks' difference of direction only; 0.2 um is 1 % of the clearances that matter
    assert flanks.gap[k] == pytest.approx(drawn_gap(reference, i, zone, side), abs=2e-4)


def test_half_angle_at_pitch_circle_is_that_of_the_rack():
    wheel = Wheel(40, 2.0, np.radians(20), 0.5)
    thickness = 2.0 * (np.pi / 2 + 2 * 0.5 * np.tan(np.radians(20)))
    assert wheel.half_angle(np.array([40.0]))[0] == pytest.approx(thickness / 2 / 40.0, rel=1e-14)


@pytest.mark.parametrize("values", [{}, {"cam__W_0": 0.6, "gears__h_a": 0.75}])
def test_flank_candidates_are_those_whose_tips_pass_the_opposite_tips(reference, values):
    geometry = Geometry.of(changed(reference, **values))
    tooth, side = (axis.ravel() for axis in np.meshgrid(np.arange(-50, 51), [1.0, -1.0]))
    reaches = flank_point(geometry, np.array(geometry.r_ag), np.pi / 100 * tooth, side)[0] >= geometry.r_ab
    expected = set(zip(tooth[reaches].tolist(), side[reaches].tolist(), strict=True))
    assert 80 < len(expected) < 202
    flanks = flank_candidates(geometry)
    for zone in (0, 1):
        there = flanks.zone == zone
        found = zip((flanks.tooth[there] - 100 * zone).tolist(), flanks.side[there].tolist(), strict=True)
        assert set(found) == expected


def test_no_tooth_in_reach_is_an_error(reference):
    with pytest.raises(UntrustedError, match="no tooth of the flexspline reaches the circular spline") as error:
        flank_candidates(Geometry.of(changed(reference, cam__W_0=0.0, gears__h_a=0.3)))
    assert (error.value.hint, error.value.fault) == ("increase cam.W_0 or gears.h_a", Fault.NO_MESH)


def test_zones_and_sides_are_mirror_images(reference):
    flanks = flank_candidates(Geometry.of(reference))
    gap = {
        (int(t), int(z), float(s)): g
        for t, z, s, g in zip(flanks.tooth, flanks.zone, flanks.side, flanks.gap, strict=True)
    }
    for (tooth, zone, side), value in gap.items():
        assert gap[(-tooth if zone == 0 else 200 - tooth, zone, -side)] == pytest.approx(value, abs=1e-12)
        assert gap[((tooth + 100) if zone == 0 else tooth - 100, 1 - zone, side)] == pytest.approx(value, abs=1e-12)


def test_least_gap_is_found_on_a_denser_sampling_too(reference):
    coarse = flank_candidates(Geometry.of(reference)).gap
    dense = flank_candidates(Geometry.of(reference), samples=4001).gap
    assert np.abs(dense - coarse).max() < 1e-9


@pytest.mark.parametrize("curve", ["linear", "inextensible"])
def test_contacts_lie_between_the_tips_of_both_wheels(reference, curve):
    geometry = Geometry.of(changed(reference, numerics__nominal_curve=curve))
    flanks = flank_candidates(geometry)
    r_y = geometry.r_m + flanks.h_c
    rho, _ = flank_point(geometry, r_y, flanks.theta, flanks.side)
    assert r_y.max() <= geometry.r_ag + 1e-9
    assert r_y.min() >= geometry.r_f + 0.2 * 0.8 - 1e-9
    assert rho.min() == pytest.approx(geometry.r_ab, abs=1e-9)
    assert np.count_nonzero(np.abs(rho - geometry.r_ab) < 1e-9) > 10


@pytest.mark.parametrize("curve", ["linear", "inextensible"])
def test_a_tooth_is_moved_as_a_rigid_body(reference, curve):
    geometry = Geometry.of(changed(reference, numerics__nominal_curve=curve))
    r_y = np.array([geometry.r_f + 0.3, geometry.r_ag])
    psi = geometry.flexspline.half_angle(r_y)
    for theta in np.radians([-25.0, 0.0, 12.0, 170.0]):
        points = []
        for side in (1.0, -1.0):
            rho, phi = flank_point(geometry, r_y, np.full(2, theta), np.full(2, side))
            points += list(zip(rho * np.exp(1j * phi), r_y * np.exp(1j * side * psi), strict=True))
        for moved, drawn in points:
            for other, there in points:
                assert abs(moved - other) == pytest.approx(abs(drawn - there), abs=1e-12)


def test_radii_of_the_reference_by_hand(reference):
    g = Geometry.of(reference)
    assert (g.r_f, g.r_m, g.r_ag, g.r_ab) == pytest.approx((81.4, 80.7, 82.96, 82.96))
    assert (g.r_ring, g.r_raceway) == pytest.approx((78.0, 76.0))
    assert (g.W_0, g.j_n) == pytest.approx((0.96, 0.007))
    assert (g.flexspline, g.rigid) == (Wheel(200, 0.8, np.radians(20), 3.1), Wheel(202, 0.8, np.radians(20), 3.3))


def test_growth_closes_the_flanks_by_its_part_along_the_normal(reference):
    warm = changed(reference, operation__dT=10.0)
    geometry, there = Geometry.of(reference), Geometry.of(warm)
    flanks = flank_candidates(geometry)
    r_y, growth = geometry.r_m + flanks.h_c, 1 + 10 * 11.5e-6
    rho, phi = flank_point(geometry, r_y, flanks.theta, flanks.side)
    # the same point of the tooth is there at the same angle, so much further out
    moved = flank_point(there, growth * r_y, flanks.theta, flanks.side)
    assert moved[0] == pytest.approx(growth * rho, rel=1e-14)
    assert moved[1] == pytest.approx(phi, rel=1e-12, abs=1e-14)
    # equation (6c): 9.5 um out are 3.9 um less of a gap; squares of the growth are nanometres
    gap = flank_gap(there, growth * r_y, flanks.theta, flanks.zone, flanks.side)[0]
    assert gap - flanks.gap == pytest.approx(-10 * 11.5e-6 * rho * np.sin(flanks.alpha), abs=2e-6)
    assert (gap - flanks.gap).min() < -3.5e-3


def test_uniformly_warm_drive_is_the_same_drive_drawn_larger(reference):
    # flexspline, bearing and cam 100 K warmer, and a circular spline drawn as much larger: every gap grows by its share
    grown = Geometry.of(changed(reference, operation__dT=100.0))
    growth = 1 + 100 * 11.5e-6
    rigid = replace(grown.rigid, m=growth * grown.rigid.m)
    flanks = flank_candidates(replace(grown, rigid=rigid, r_ab=growth * grown.r_ab))
    cold = flank_candidates(Geometry.of(reference))
    assert flanks.gap == pytest.approx(growth * cold.gap, abs=1e-10)
    assert flanks.h_c == pytest.approx(growth * cold.h_c, abs=1e-9)


def test_growth_moves_levers_and_rings_by_hundredths_of_an_arcsecond(reference, monkeypatch):
    """What equation (6c) leaves out, for docs/theory.md: the warm drive with the levers, or rings, of the cold one."""
    warm, cold = changed(reference, operation__dT=10.0), Geometry.of(reference)
    whole = contact_system(warm)
    G = whole.G.copy()
    G[:, ROTATION] /= 1 + 10 * 11.5e-6
    monkeypatch.setattr(contacts, "flexspline_ring", lambda drive, _: flexspline_ring(drive, cold))
    monkeypatch.setattr(contacts, "outer_ring", lambda drive, _: outer_ring(drive, cold))
    stiff = contact_system(warm)
    for M_g, lever, rings in ((80e3, -0.00153, 0.00075), (800e3, -0.0292, 0.0055)):
        turn, levers_cold, rings_cold = (
            solve_state(each, M_g, whole.delta_p)[2] for each in (whole, replace(whole, G=G), stiff)
        )
        assert (turn - levers_cold, turn - rings_cold) == pytest.approx((lever, rings), rel=0.05)


def test_what_is_as_warm_as_its_neighbour_keeps_its_gap(reference):
    # bore and ring, raceway and cam grow together: what is left is the wave's own growth, 0.1 um at 10 K
    cold, warm = (contact_system(changed(reference, operation__dT=dT)) for dT in (0.0, 10.0))
    assert warm.delta_p[warm.n_flanks :] == pytest.approx(cold.delta_p[cold.n_flanks :], abs=1.2e-4)
    ends = [Geometry.of(changed(reference, operation__dT=dT)) for dT in (0.0, 10.0)]
    assert (ends[1].r_raceway - ends[0].r_raceway) == pytest.approx(10 * 11.5e-6 * ends[0].r_raceway)
