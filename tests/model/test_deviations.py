"""Deviations: frames, marks, and measured teeth."""

import numpy as np
import pytest

from hdassist import ToothDeviations, kinematic_error
from hdassist.drive.model.contacts import CAM, StateGaps, contact_system
from hdassist.drive.model.deviations import (
    carried,
    deviation_scalars,
    standing_offset,
    tooth_phases,
)
from hdassist.drive.model.geometry import Kinematics, pitch_locked_states
from hdassist.run.errors import UsageError
from hdassist.run.run import UNCHECKED
from tests.helpers.support import changed, delta_p_of, first_harmonic

QUIET = {"tolerances__F_i1": 0.0, "tolerances__F_i2": 0.0, "tolerances__e_hb": 0.0, "tolerances__e_hh": 0.0}


PITCH_ORDERS = range(6, 17, 2)


def scalars(drive, phi_h: float, phi_g: float = 0.0):
    """Deviation scalars at angles of cam and flexspline [deg], circular spline fixed."""
    return deviation_scalars(drive, np.radians([phi_g - phi_h]), np.radians([-phi_h]))[0]


def test_cam_offsets_turn_as_their_names_say(reference):
    quiet = changed(reference, **QUIET)
    still = changed(quiet, tolerances__e_hb=80.0, phases__phi_hb=30.0)
    with_cam = changed(quiet, tolerances__e_hh=80.0, phases__phi_hh=30.0)
    with_wheel = changed(quiet, tolerances__e_hg=80.0, phases__phi_hg=30.0)
    # e_hb stands still: seen from a cam at 90 deg it has gone back by 90 deg
    assert scalars(still, 90)[2:] == pytest.approx(0.08 * np.array([np.cos(np.radians(-60)), np.sin(np.radians(-60))]))
    assert scalars(with_cam, 90)[2:] == pytest.approx(scalars(with_cam, 0)[2:])
    assert scalars(with_wheel, 90, -0.9)[2:] == pytest.approx(
        0.08 * np.array([np.cos(np.radians(30 - 90.9)), np.sin(np.radians(30 - 90.9))])
    )


def test_teeth_are_displaced_along_theta_as_stated(reference):
    # flexspline alone, xi_g = 0, cam at 0: tooth at theta_x1 has (F/2) sin(theta_x1)
    drive = changed(reference, **{**QUIET, "tolerances__F_i1": 60.0}, phases__xi_g=0.0)
    system = contact_system(drive)
    change = delta_p_of(drive, system, pitch_locked_states(Kinematics.of(drive), np.array([0])))[0] - system.delta_p
    f = system.flanks
    displaced = 0.03 * np.sin(f.theta + np.pi / 2)
    # moving along +theta closes the + flank and opens the - flank
    assert change[: system.n_flanks] == pytest.approx(-f.side * np.cos(f.alpha) * displaced, abs=1e-15)


def test_equal_deviations_of_both_wheels_cancel(reference):
    drive = changed(reference, phases__xi_b=40.0, phases__xi_g=40.0)
    assert scalars(drive, 33, 0)[:2] - scalars(drive, 33, 0)[:2] == pytest.approx([0, 0])
    assert scalars(drive, 0, 0)[:2] == pytest.approx([0, 0], abs=1e-15)


def test_centre_shift_is_a_first_harmonic_half_a_revolution_ahead(reference):
    # a tooth ring whose centre lies off by e towards beta: each tooth moves along +theta by e sin(beta - theta)
    e, beta, theta = 0.02, np.radians(70), np.linspace(0, 2 * np.pi, 13)
    drive = changed(reference, phases__xi_b=70.0, mounting__mark_kind="runout")
    xi = tooth_phases(drive)[1]
    assert e * np.sin(beta - theta) == pytest.approx(e * np.sin(theta - xi), abs=1e-12)


def test_a_pitch_mark_is_where_the_teeth_lead_most(reference):
    drive = changed(reference, phases__xi_g=50.0, phases__xi_b=70.0, mounting__mark_kind="pitch")
    theta = np.radians(np.arange(0, 360, 1.0))
    for xi, mark in zip(tooth_phases(drive), (50.0, 70.0), strict=True):
        assert np.degrees(theta[np.argmax(np.sin(theta - xi))]) == pytest.approx(mark)


def test_pitch_mark_is_a_quarter_revolution_ahead_of_the_phase(reference):
    marked = changed(reference, phases__xi_g=50.0, phases__xi_b=70.0, mounting__mark_kind="pitch")
    phases = changed(reference, phases__xi_g=-40.0, phases__xi_b=-20.0)
    assert scalars(marked, 33, 7) == pytest.approx(scalars(phases, 33, 7), abs=1e-15)


@pytest.mark.parametrize("j", [0, 1, 77, 5000])
def test_measured_flexspline_equals_its_first_harmonic(reference, j):
    system, states = contact_system(reference), pitch_locked_states(Kinematics.of(reference), np.array([j]))
    measured = ToothDeviations(g=first_harmonic(75.0, tooth_phases(reference)[0], 200))
    assert delta_p_of(reference, system, states, measured) == pytest.approx(
        delta_p_of(reference, system, states), abs=1e-12
    )


@pytest.mark.parametrize("j", [0, 1, 77, 5000])
def test_measured_rigid_wheel_equals_its_first_harmonic(reference, j):
    # a space's own angle differs from its tooth's by up to 25 (1.8 - 1.782) deg = 0.446 deg where the mesh ends
    system, states = contact_system(reference), pitch_locked_states(Kinematics.of(reference), np.array([j]))
    measured = ToothDeviations(b=first_harmonic(75.0, tooth_phases(reference)[1], 202))
    apart = np.abs(delta_p_of(reference, system, states, measured) - delta_p_of(reference, system, states))
    assert apart.max() < 0.0375 * np.radians(0.446)
    middle = np.abs(np.mod(system.flanks.theta + np.pi / 2, np.pi) - np.pi / 2) < 0.02
    assert apart[0, : system.n_flanks][middle].max() < 0.0375 * np.radians(0.02)


@pytest.mark.thorough
def test_measured_wheels_give_the_same_error(reference):
    states = pitch_locked_states(Kinematics.of(reference), np.arange(404))
    xi_g, xi_b = tooth_phases(reference)
    once = kinematic_error(reference, 80, states=states)
    teeth = ToothDeviations(g=first_harmonic(75.0, xi_g, 200))
    again = kinematic_error(reference, 80, states=states, teeth=teeth)
    assert again.error_arcsec == pytest.approx(once.error_arcsec, abs=1e-7)
    # the circular spline's spaces keep their own deviation: up to 0.19 um, at half an arcsec per um
    teeth = ToothDeviations(b=first_harmonic(75.0, xi_b, 202))
    again = kinematic_error(reference, 80, states=states, teeth=teeth)
    assert again.error_arcsec == pytest.approx(once.error_arcsec, abs=0.2)


def test_one_bad_tooth_is_felt_when_it_meshes(reference):
    drive = changed(reference, **QUIET)
    states = pitch_locked_states(Kinematics.of(drive), np.arange(202))
    bad = np.zeros(200)
    bad[50] = 20.0  # um
    error = kinematic_error(drive, 80, states=states, teeth=ToothDeviations(g=bad), run=UNCHECKED)
    system = contact_system(drive)
    touched = delta_p_of(drive, system, states, ToothDeviations(g=bad)) != system.delta_p
    in_mesh = touched.any(axis=1)
    assert in_mesh.sum() == 2 * 51  # positions in each of two zones
    still = error.rotation_arcsec[~in_mesh]
    assert np.ptp(still) < 1e-9
    assert np.abs(error.rotation_arcsec[in_mesh] - still[0]).max() > 0.05


def test_displaced_space_of_the_circular_spline_opens_the_preceding_flank(reference):
    drive = changed(reference, **QUIET)
    system, states = contact_system(drive), pitch_locked_states(Kinematics.of(drive), np.arange(202))
    bad = np.zeros(202)
    bad[50] = 20.0  # um, along +theta
    change = delta_p_of(drive, system, states, ToothDeviations(b=bad)) - system.delta_p
    f = system.flanks
    met = np.abs(change[:, : system.n_flanks]) > 1e-12
    assert met.any(axis=1).sum() == 2 * 51  # positions in mesh
    assert (met.sum(axis=1) <= 2).all()  # both flanks of one tooth
    opened = np.broadcast_to(f.side * np.cos(f.alpha) * 0.02, met.shape)
    assert change[:, : system.n_flanks][met] == pytest.approx(opened[met])


def test_wrong_number_of_teeth(reference):
    states = pitch_locked_states(Kinematics.of(reference), np.arange(2))
    with pytest.raises(UsageError, match=r"expected 200 deviations .* not 199"):
        kinematic_error(reference, 80, states=states, teeth=ToothDeviations(g=np.zeros(199)))


def test_a_run_out_moves_the_wheel_as_its_translation_does(reference):
    # at phi_h = 0 the minor axis, x1, lies along x; the system's x lies along the major axis, 90 deg on
    drive = changed(reference, **QUIET, tolerances__e_b=20.0, phases__phi_eb=90.0)
    system = contact_system(drive)
    change = delta_p_of(drive, system, pitch_locked_states(Kinematics.of(drive), np.array([0])))[0] - system.delta_p
    assert change == pytest.approx(0.02 * system.G[:, 0], abs=1e-15)
    f = system.flanks
    beta = 0.0  # the same direction, from the major axis
    moved = f.side * 0.02 * np.sin(beta - f.theta + f.side * f.alpha)
    assert change[: system.n_flanks] == pytest.approx(moved, abs=1e-15)
    # and so does a shift along the minor axis, against the system's y
    along_x1 = system.delta_p_of(StateGaps(np.array([[0.0, 0.0, 0.0, 0.0, 0.02, 0.0]])))[0] - system.delta_p
    assert along_x1 == pytest.approx(-0.02 * system.G[:, 1], abs=1e-15)


def test_marks_of_run_out_are_offsets_of_both_wheels(reference):
    marked = changed(reference, mounting__mark_kind="runout", phases__xi_g=20.0, phases__xi_b=70.0)
    flexspline, rigid = ({**QUIET, "tolerances__F_i1": 75.0}, {**QUIET, "tolerances__e_b": 37.5})
    one = changed(marked, **flexspline)
    other = changed(marked, **rigid, phases__phi_eb=70.0)
    cam = changed(marked, tolerances__F_i1=0.0, tolerances__F_i2=0.0)
    alpha = np.linspace(0, 6, 7)
    parts = [np.pad(deviation_scalars(each, alpha, -alpha), ((0, 0), (0, 2)))[:, :6] for each in (one, other, cam)]
    assert deviation_scalars(marked, alpha, -alpha) == pytest.approx(sum(parts))


def test_what_moves_wheel_and_cam_alike_makes_no_error(reference):
    # nothing holds the flexspline, so it goes with them
    alike = changed(reference, **QUIET, supports__C_2=0.0)
    alike = changed(alike, tolerances__e_hb=60.0, phases__phi_hb=25.0, tolerances__e_b=60.0)
    states = pitch_locked_states(Kinematics.of(reference), np.arange(202))
    for M_g in (80, -80):
        ranges = [
            kinematic_error(changed(alike, phases__phi_eb=25.0 + away), M_g, states=states, run=UNCHECKED).range_arcsec
            for away in (0.0, 30.0, -30.0, 180.0)
        ]
        assert ranges[0] == pytest.approx(0, abs=1e-6)
        assert ranges[1] == pytest.approx(ranges[2], rel=0.01)
        assert 0.5 < ranges[1] < ranges[3]


def test_independent_tooth_deviations_have_the_orders_of_single_pitch_deviation(reference):
    rng, squares = np.random.default_rng(0), []
    teeth = reference.gears.z_b
    for _ in range(400):
        places = rng.standard_normal(teeth)
        places *= 10 / np.abs(places - np.roll(places, 1)).max()  # a single pitch deviation of 10 um
        squares.append(np.abs(np.fft.rfft(places)[list(PITCH_ORDERS)] * 2 / teeth) ** 2)
    drive = changed(reference, **QUIET, tolerances__f_p2=10.0)
    found = np.hypot(*scalars(drive, 0).reshape(-1, 2).T) * 1e3
    assert found[:6] == pytest.approx(0, abs=1e-12)
    assert found[6:] == pytest.approx(np.sqrt(np.mean(squares)), rel=0.03)


@pytest.mark.parametrize(("wheel", "part", "sign"), [("1", "g", 1.0), ("2", "b", -1.0)])
def test_a_single_pitch_deviation_is_as_teeth_with_its_orders(reference, wheel, part, sign):
    phases = {f"harmonics__xi_{part}{order}": 7.0 * order for order in PITCH_ORDERS}
    drive = changed(reference, **{**QUIET, f"tolerances__f_p{wheel}": 30.0, **phases})
    z = reference.gears.z_g if part == "g" else reference.gears.z_b
    a, b = sign * scalars(drive, 0).reshape(-1, 2)[6:].T[:, :, None] * 1e3  # um, of sine and cosine
    angle = np.array(PITCH_ORDERS)[:, None] * (2 * np.pi * np.arange(z) / z + np.pi / 2)
    teeth = ToothDeviations(**{part: (a * np.sin(angle) + b * np.cos(angle)).sum(axis=0)})
    states = pitch_locked_states(Kinematics.of(drive), np.arange(0, 20200, 201))
    by_field = kinematic_error(drive, 80, states=states, run=UNCHECKED).error_arcsec
    by_tooth = kinematic_error(drive, 80, states=states, teeth=teeth, run=UNCHECKED).error_arcsec
    assert np.ptp(by_field) > 5
    assert np.ptp(by_field - by_tooth) < 0.01 * np.ptp(
        by_field
    )  # spaces stand beside the teeth by half a pitch at most


def test_second_harmonics_weigh_twenty_times_as_much_as_first_harmonics(reference):
    oval = changed(reference, **QUIET, harmonics__a_b2=1.0)
    first = changed(reference, **{**QUIET, "tolerances__F_i2": 2.0})
    states = pitch_locked_states(Kinematics.of(reference), np.arange(202))
    even, odd = (kinematic_error(each, 80, states=states, run=UNCHECKED).range_arcsec for each in (oval, first))
    assert even == pytest.approx(4.95, abs=0.05)  # expected per um of amplitude
    assert 0.1 < odd < 0.3  # 0.14 to 0.23 expected


def test_fixed_wheel_carries_its_phases_while_the_eccentricity_stays(reference):
    orders = (2, 3, 4, *PITCH_ORDERS)
    assert carried(reference) == ("phases.xi_b", "phases.phi_eb", *(f"harmonics.xi_b{order}" for order in orders))
    assert standing_offset(reference) == ("tolerances.e_hb", "phases.phi_hb")
    other = changed(reference, mounting__fixed="flexspline")
    assert carried(other) == ("phases.xi_g", *(f"harmonics.xi_g{order}" for order in orders))
    assert standing_offset(other) == ("tolerances.e_hg", "phases.phi_hg")


@pytest.mark.parametrize("direction", [0.0, 90.0, 200.0])
def test_the_cam_closes_the_balls_that_it_moves_towards(reference, direction):
    # at phi_h = 0 the major axis, where theta is 0, lies 90 deg from x
    drive = changed(reference, **{**QUIET, "tolerances__e_hb": 80.0}, phases__phi_hb=direction)
    system = contact_system(drive)
    change = delta_p_of(drive, system, pitch_locked_states(Kinematics.of(drive), np.array([0])))[0] - system.delta_p
    towards = np.cos(system.ball_theta - np.radians(direction - 90))
    assert change[system.balls] == pytest.approx(-0.08 * towards, abs=1e-15)
    assert not change[: system.balls.start].any()
    along = np.array([np.sin(np.radians(direction)), -np.cos(np.radians(direction))])
    assert change == pytest.approx(0.08 * system.G[:, CAM] @ along)
