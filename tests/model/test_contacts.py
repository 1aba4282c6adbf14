"""The contact system against cases that can be solved by hand."""

from dataclasses import replace

import numpy as np
import pytest

from hdassist.drive.model.contacts import FREEDOMS, ROTATION, ContactSystems, contact_system
from hdassist.drive.model.geometry import Flanks, Geometry
from hdassist.drive.solve.answers import ARCSEC
from tests.helpers.support import changed, compliance, rounding, solve_state

ALPHA, LEVER, C_TOOTH = np.radians(25), 82.0, 2e-5


def two_teeth(reference, gaps: tuple[float, float]):
    """One tooth pair in each zone, pushing towards +theta; rigid rings, no bearing."""
    flanks = Flanks(
        tooth=np.array([0, 100]),
        zone=np.array([0, 1]),
        side=np.ones(2),
        theta=np.array([0, np.pi]),
        gap=np.array(gaps),
        alpha=np.full(2, ALPHA),
        h_c=np.full(2, LEVER - Geometry.of(reference).r_m),
    )
    normal = np.array([np.sin(ALPHA), np.cos(ALPHA)])  # outward at theta = 0: radial x, tangential y
    G = np.zeros((2, len(FREEDOMS)))
    G[0, 0:2], G[1, 0:2] = normal, -normal
    G[:, 2:4] = -G[:, 0:2]
    G[:, ROTATION] = -np.cos(ALPHA) * LEVER
    system = contact_system(reference)
    C = np.where(np.arange(len(FREEDOMS)) == ROTATION, 0.0, np.maximum(system.C, 1.0))  # the ring is not part of it
    return replace(
        system, flanks=flanks, ball_theta=np.zeros(0),
        compliance=np.zeros((2, 2)), local=np.full(2, C_TOOTH), G=G, C=C,
        delta_p=np.array(gaps),
    )  # fmt: skip


def test_both_zones_carry_by_hand(reference):
    gaps = (0.010, 0.011)  # mm
    system, torque = two_teeth(reference, gaps), 80e3
    forces, _, rotation = solve_state(system, torque, system.delta_p)
    total = torque / (np.cos(ALPHA) * LEVER)
    yielding = 1 / reference.supports.C_1 + 1 / reference.supports.C_2
    apart = (gaps[1] - gaps[0]) / (C_TOOTH + 2 * yielding)
    assert forces == pytest.approx([(total + apart) / 2, (total - apart) / 2], rel=1e-9, abs=1e-9)
    turn = (sum(gaps) + C_TOOTH * total) / (2 * np.cos(ALPHA) * LEVER)
    assert rotation == pytest.approx(turn * ARCSEC, rel=1e-9)


def test_one_zone_carries_by_hand(reference):
    # the second pair is so far that the first alone takes the torque, and pushes the wheels apart
    gaps = (0.010, 10.0)
    system, torque = two_teeth(reference, gaps), 80e3
    forces, a, rotation = solve_state(system, torque, system.delta_p)
    force = torque / (np.cos(ALPHA) * LEVER)
    assert forces == pytest.approx([force, 0], rel=1e-9, abs=1e-9)
    normal = np.array([np.sin(ALPHA), np.cos(ALPHA)])
    assert a[0:2] == pytest.approx(force / reference.supports.C_1 * normal, rel=1e-9)
    assert a[2:4] == pytest.approx(-force / reference.supports.C_2 * normal, rel=1e-9)
    yielding = 1 / reference.supports.C_1 + 1 / reference.supports.C_2
    turn = (gaps[0] + (C_TOOTH + yielding) * force) / (np.cos(ALPHA) * LEVER)
    assert rotation == pytest.approx(turn * ARCSEC, rel=1e-9)


def test_motions_open_gaps_as_drawn(reference):
    system = contact_system(reference)
    flanks = system.flanks

    def gap_of(zone: int, side: int, freedom: str) -> float:
        k = np.flatnonzero((flanks.tooth == 100 * zone) & (flanks.zone == zone) & (flanks.side == side))[0]
        return float(system.G[k, FREEDOMS.index(freedom)])

    # tooth at theta = 0, its +theta flank: the circular spline's flank lies in +y and +x of it
    assert gap_of(0, +1, "circular spline y") > 0
    assert gap_of(0, +1, "circular spline x") > 0
    assert gap_of(0, -1, "circular spline y") < 0
    assert gap_of(1, +1, "circular spline y") < 0
    # the flexspline turning towards +theta closes the + flanks in both zones
    assert gap_of(0, +1, "flexspline rotation") < 0
    assert gap_of(1, +1, "flexspline rotation") < 0
    assert gap_of(0, -1, "flexspline rotation") > 0


def test_whole_drive_moved_as_one_body_changes_no_gap(reference):
    system = contact_system(reference)
    for axis in (" x", " y"):
        moved = np.array([float(freedom.endswith(axis)) for freedom in FREEDOMS])
        assert np.abs(system.G @ moved).max() < 1e-12


def test_nominal_shape_held_by_a_rigid_cam_has_nominal_gaps(reference):
    # the mode A_2 = W_0 laid on the rim gives back the drawn gap plus the clearance
    system = contact_system(reference)
    f, W_0, r_m = system.flanks, reference.cam.W_0, system.geometry.r_m
    w, v = W_0 * np.cos(2 * f.theta), -W_0 / 2 * np.sin(2 * f.theta)
    chi = (v + 2 * W_0 * np.sin(2 * f.theta)) / r_m
    outward = f.side * np.cos(f.alpha) * (v + f.h_c * chi) + np.sin(f.alpha) * w
    assert system.delta_p[: system.n_flanks] - outward == pytest.approx(f.gap + 0.007, abs=1e-12)


def test_system_is_positive_definite_and_reciprocal(reference):
    for drive in (reference, changed(reference, bearing__N=17, supports__C_1=0.0)):
        system = contact_system(drive)
        held = system.supported
        H = compliance(system) + (system.G[:, held] / system.C[held]) @ system.G[:, held].T
        D = compliance(system)
        assert np.abs(D - D.T).max() <= rounding(2 * reference.numerics.n_max, D.max())
        assert np.linalg.eigvalsh(H)[0] > 0


def test_teeth_and_balls_stand_at_their_phases(reference):
    systems = ContactSystems(reference)
    for tau, beta in ((0.3, 0.7), (0.3, 0.2), (0.0, 0.2)):  # parts of a phase met before are made once
        system = systems.at(tau, beta)
        assert system.flanks.theta == pytest.approx(2 * np.pi * (system.flanks.tooth + tau) / 200)
        assert system.ball_theta == pytest.approx(2 * np.pi * (np.arange(24) + beta) / 24)
        assert system.deviation_map.shape == (len(system.delta_p), 24)
        alone = contact_system(reference, tau, beta)
        for part in ("compliance", "local", "G", "delta_p", "deviation_map"):
            assert np.array_equal(getattr(system, part), getattr(alone, part))  # the same functions of the same phases
    assert contact_system(changed(reference, bearing__beta=0.4)).ball_theta[0] == pytest.approx(2 * np.pi * 0.4 / 24)
