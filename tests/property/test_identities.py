"""What must hold for any state of any drive, whatever the numbers are."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hdassist.drive.error.cycle import kinematic_error
from hdassist.drive.error.error_map import ErrorMap, Mesh, Reach, error_table
from hdassist.drive.model.contacts import CAM, ROTATION, contact_system
from hdassist.drive.model.deviations import deviation_scalars, is_half_turn_symmetric
from hdassist.drive.model.geometry import Kinematics, pitch_locked_states
from hdassist.drive.solve.answers import ARCSEC
from hdassist.run.run import UNCHECKED
from tests.helpers.support import changed, compliance, delta_p_of, rotation, solve_state, wind_up

micrometres = st.floats(-100, 100).map(lambda um: round(um, 3) * 1e-3)
vectors = st.tuples(*[micrometres] * 4).map(np.array)
torques = st.sampled_from([30e3, 80e3, 300e3, 800e3])  # N*mm
FEW = settings(max_examples=8)


@pytest.fixture(scope="module", params=[1, 3], ids=["whole flanks", "coned flanks"])
def system(reference, request):
    return contact_system(changed(reference, numerics__stations=request.param))


@FEW
@given(vectors, torques)
def test_homogeneity(system, scalars, torque):
    delta_p = system.delta_p + system.deviation_map[:, :4] @ scalars
    forces, _, once = solve_state(system, torque, delta_p)
    doubled, _, twice = solve_state(system, 2 * torque, 2 * delta_p)
    assert twice == pytest.approx(2 * once, abs=1e-8)
    assert doubled == pytest.approx(2 * forces, abs=1e-8 * forces.max())


@FEW
@given(vectors, torques)
def test_half_turn(system, scalars, torque):
    # with even numbers of teeth, balls and nodes no order is odd: F'_ior comes from contacts that change
    assert rotation(system, torque, -scalars) == pytest.approx(rotation(system, torque, scalars), abs=1e-8)


def with_78_teeth(drive):
    fewer = {"gears__z_g": 78, "gears__z_b": 80, "gears__m": 2.0, "cam__W_0": 2.4}
    return changed(drive, bearing__N=15, bearing__d_ball=None, **fewer)


ODD = {
    "23 balls": lambda drive: changed(drive, bearing__N=23),
    "199 teeth": lambda drive: changed(drive, gears__z_g=199, gears__z_b=201),
    "78 teeth, 15 balls": with_78_teeth,
    "81 bore nodes": lambda drive: changed(drive, numerics__n_2=81),
}


@pytest.mark.parametrize("made", ODD.values(), ids=ODD)
def test_table_has_the_rotation_of_states_without_half_revolution_symmetry(reference, made):
    drive = changed(made(reference), harmonics__a_b3=1.0, harmonics__xi_b3=0.0)
    table = error_table(ErrorMap(drive, 800.0), Reach.of(drive), Mesh((3, 3, 3, 3)))
    system, step = contact_system(drive), 1e-5
    differences = []
    for place in ((1, 1, 1, 1), (1, 1, 2, 0), (2, 0, 1, 1), (2, 1, 2, 1), (2, 2, 2, 2)):  # of the second half
        scalars = (np.array(place) - 1) * table.reach.sizes
        direct = [rotation(system, 800e3, s) for s in (scalars, -scalars)]
        assert table.error[place] == pytest.approx(direct[0], abs=1e-7), place
        differences.append(abs(direct[0] - direct[1]))
        gaps_ = system.delta_p + system.deviation_map[:, :4] @ scalars
        forces = [solve_state(system, way * 800e3, gaps_)[0] for way in (1 - step, 1 + step)]
        pull = (
            (forces[1] - forces[0]) @ system.deviation_map[:, table.reach.other_columns] / (2 * step * 800e3) * ARCSEC
        )
        assert table.slopes[4:, *place] == pytest.approx(pull, rel=1e-5, abs=1e-3), place
    assert is_half_turn_symmetric(reference) and not is_half_turn_symmetric(drive)
    assert max(differences) > 0.01


@FEW
@given(vectors, torques)
def test_mirror_image(system, scalars, torque):
    mirrored = rotation(system, -torque, scalars * [-1, 1, -1, 1])
    assert mirrored == pytest.approx(-rotation(system, torque, scalars), abs=1e-8)


def test_reflecting_the_deviations_alone_is_no_mirror_image(system):
    scalars = np.array([0.03, 0.05, 0.06, -0.02])
    reflected = rotation(system, 80e3, scalars * [-1, 1, -1, 1])
    assert abs(reflected + rotation(system, 80e3, scalars)) > 10
    assert abs(reflected - rotation(system, 80e3, scalars)) > 0.1


@pytest.mark.thorough
def test_mirror_image_of_the_full_cycle(reference):
    reflected = changed(reference, phases__xi_b=-260.0)
    ahead = kinematic_error(reference, 80, run=UNCHECKED).F_ior_arcsec
    assert kinematic_error(reflected, -80, run=UNCHECKED).F_ior_arcsec == pytest.approx(ahead, abs=1e-7)
    assert abs(kinematic_error(reflected, 80, run=UNCHECKED).F_ior_arcsec - ahead) > 0.5


@FEW
@given(vectors, torques, micrometres)
def test_rigid_turn_of_a_wheel(system, scalars, torque, arc):
    # teeth moved along by a turn eps of the section: the wheel turns back by it, forces stay
    eps = arc / system.geometry.r_m
    delta_p = system.delta_p + system.deviation_map[:, :4] @ scalars
    turned = delta_p.copy()
    turned[: system.n_flanks] += system.G[: system.n_flanks, ROTATION] * eps
    forces, _, before = solve_state(system, torque, delta_p)
    same, _, after = solve_state(system, torque, turned)
    assert after - before == pytest.approx(-eps * ARCSEC, abs=1e-8)
    assert same == pytest.approx(forces, abs=1e-8 * forces.max())


@FEW
@given(vectors, torques)
def test_castigliano(system, scalars, torque):
    # the optimum's derivative by the torque is the rotation
    delta_p = system.delta_p + system.deviation_map[:, :4] @ scalars
    supported = system.supported

    def optimum(load: float) -> float:
        forces, _, _ = solve_state(system, load, delta_p)
        reactions = forces @ system.G[:, supported]
        stored = forces @ compliance(system) @ forces + reactions @ (reactions / system.C[supported])
        return float(stored / 2 + delta_p @ forces)

    step = torque * 1e-4
    slope = (optimum(torque + step) - optimum(torque - step)) / (2 * step)
    # the optimum is quadratic between changes of contact, where central differences are exact
    assert slope * ARCSEC == pytest.approx(rotation(system, torque, scalars), abs=2e-4)


def test_a_cam_without_support_follows(reference):
    # C_3 = 0: the cam's offset cannot be felt
    drive = changed(reference, supports__C_3=0.0)
    system = contact_system(drive)
    still = rotation(system, 80e3, np.array([0.02, 0.01, 0.0, 0.0]))
    assert rotation(system, 80e3, np.array([0.02, 0.01, 0.08, -0.05])) == pytest.approx(still, abs=1e-7)
    held = contact_system(reference)
    felt = rotation(held, 80e3, np.array([0.02, 0.01, 0.08, -0.05]))
    assert abs(felt - rotation(held, 80e3, np.array([0.02, 0.01, 0.0, 0.0]))) > 0.5


@pytest.mark.parametrize("free", ["C_1", "C_2"])
def test_wheels_without_support_follow_the_cam(reference, free):
    # both wheels free: nothing holds them against the cam; one free: the forces between the wheels have no sum
    drive = changed(reference, supports__C_1=0.0, supports__C_2=0.0)
    system = contact_system(drive)
    still = rotation(system, 80e3)
    assert rotation(system, 80e3, np.array([0, 0, 0.08, -0.05])) == pytest.approx(still, abs=1e-7)
    one = contact_system(changed(reference, **{f"supports__{free}": 0.0}))
    assert np.isfinite(rotation(one, 80e3, np.array([0.01, 0, 0.05, 0.02])))


@pytest.mark.parametrize("support", ["C_1", "C_2", "C_3"])
def test_a_very_soft_support_is_none(reference, support):
    scalars = np.array([0.02, -0.01, 0.03, 0.04])
    soft = contact_system(changed(reference, **{f"supports__{support}": 1e-3}))
    none = contact_system(changed(reference, **{f"supports__{support}": 0.0}))
    assert rotation(soft, 80e3, scalars) == pytest.approx(rotation(none, 80e3, scalars), abs=1e-3)


@pytest.mark.parametrize("support", ["C_1", "C_2", "C_3"])
def test_a_very_stiff_support_holds(reference, support):
    # ten times the stiffness, a tenth of what is left to move
    scalars = np.array([0.02, -0.01, 0.03, 0.04])
    soft, stiff, stiffer = (
        rotation(contact_system(changed(reference, **{f"supports__{support}": C})), 80e3, scalars)
        for C in (1e7, 1e8, 1e9)
    )
    assert abs(stiffer - stiff) < 0.15 * abs(stiff - soft)


def test_phases_come_round(reference):
    assert wind_up(reference, tau=1.0) == pytest.approx(wind_up(reference, tau=0.0), abs=1e-7)
    assert wind_up(reference, beta=1.0) == pytest.approx(wind_up(reference, beta=0.0), abs=1e-7)


@pytest.mark.parametrize(("tau", "beta"), [(0.1, 0.35), (0.45, 0.8)])
@pytest.mark.parametrize("M_g", [80.0, 800.0])
def test_phases_mirror_with_the_torque(reference, tau, beta, M_g):
    there = wind_up(reference, M_g, tau, beta)
    assert wind_up(reference, -M_g, 1 - tau, 1 - beta) == pytest.approx(-there, abs=1e-7)


def torque_on_cam(system, M_g, scalars):
    """Torque of the balls on the cam [N*mm]."""
    # uses nothing the programme was told: balls lie on a lobed cam, dr/dtheta = -2 W_0 sin 2 theta
    forces, _, _ = solve_state(system, M_g * 1e3, system.delta_p + system.deviation_map[:, :4] @ scalars)
    return float(forces[system.balls] @ (2 * system.geometry.W_0 * np.sin(2 * system.ball_theta)))


@pytest.mark.parametrize("M_g", [80.0, 800.0])
@pytest.mark.parametrize("scalars", [np.zeros(4), np.array([0.03, 0.02, 0.04, -0.03])])
def test_torque_on_the_cam_has_the_sign_of_the_load(system, M_g, scalars):
    assert np.sign(torque_on_cam(system, M_g, scalars)) == np.sign(M_g)


@pytest.mark.parametrize("M_g", [80.0, 800.0])
def test_torque_on_the_cam_is_that_of_the_ratio(reference, M_g):
    flanks = changed(reference, numerics__nominal_curve="inextensible")
    assert torque_on_cam(contact_system(flanks), M_g, np.zeros(4)) == pytest.approx(M_g * 1e3 / 100, rel=0.02)
    # the other shape counts v/r_m twice, which this test sees
    once_more = torque_on_cam(contact_system(reference), M_g, np.zeros(4))
    assert 0.93 < once_more / (M_g * 1e3 / 100) < 0.97


def test_no_deviations_no_error(reference):
    perfect = changed(reference, tolerances__F_i1=0.0, tolerances__F_i2=0.0, tolerances__e_hb=0.0, tolerances__e_hh=0.0)
    states = pitch_locked_states(Kinematics.of(perfect), np.arange(0, 20200, 37))
    assert kinematic_error(perfect, 80, states=states, run=UNCHECKED).range_arcsec < 1e-9


@settings(max_examples=3)
@given(st.floats(-180, 180))
def test_turning_everything_by_an_angle_changes_nothing(reference, turn):
    # wheels, fixed offset and the cam's start turn together: the same states, met in another order; between
    # states the cycle is smooth, so a turn by whole pitches of both wheels gives the very same set
    pitches = round(turn / 3.6)
    angle = pitches * 360 / 202
    drive = changed(
        reference, phases__xi_b=reference.phases.xi_b + angle, phases__xi_g=reference.phases.xi_g + angle * 1.01,
        phases__phi_hb=reference.phases.phi_hb + angle,
    )  # fmt: skip
    kinematics = Kinematics.of(reference)
    rows = np.arange(0, 20200, 997)
    here = pitch_locked_states(kinematics, rows)
    there = pitch_locked_states(kinematics, rows + pitches)
    one = deviation_scalars(reference, here.alpha_g, here.alpha_b)
    assert deviation_scalars(drive, there.alpha_g, there.alpha_b) == pytest.approx(one, abs=1e-12)
    system = contact_system(reference)
    assert delta_p_of(drive, system, there) == pytest.approx(delta_p_of(reference, system, here), abs=1e-12)


def test_cycle_does_not_depend_on_where_it_starts(reference):
    # turning both wheels and the housing as one body by a whole number of pitches: the same cycle
    drive = changed(reference, phases__xi_b=260 + 20 * 360 / 202, phases__phi_hb=20 * 360 / 202, phases__xi_g=20 * 1.8)
    ahead = kinematic_error(reference, 80, run=UNCHECKED)
    turned = kinematic_error(drive, 80, run=UNCHECKED)
    assert turned.F_ior_arcsec == pytest.approx(ahead.F_ior_arcsec, abs=1e-7)
    assert np.roll(turned.rotation_arcsec, -20) == pytest.approx(ahead.rotation_arcsec, abs=1e-7)


def test_a_hidden_offset_is_felt_where_it_is(system):
    # turning cam vector and tooth vectors against each other is not the same as turning them together
    together = rotation(system, 80e3, np.array([0.03, 0, 0.05, 0]))
    against = rotation(system, 80e3, np.array([0.03, 0, -0.05, 0]))
    assert abs(together - against) > 1


def test_a_support_wrongly_rigid_is_seen(system):
    # the cam held harder: its first-harmonic offset is no longer a nearly rigid shift
    scalars = np.array([0.0, 0.0, 0.08, 0.0])
    C = system.C.copy()
    C[CAM] *= 100
    assert abs(rotation(replace(system, C=C), 80e3, scalars) - rotation(system, 80e3, scalars)) > 1
