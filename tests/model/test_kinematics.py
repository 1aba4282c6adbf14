"""Ratio, cycle, and where the wheels stand."""

import numpy as np
import pytest

from hdassist.drive.error.cycle import kinematic_error, state_place
from hdassist.drive.model.geometry import (
    STRIP,
    Kinematics,
    ball_phase,
    neighbours_together,
    pitch_locked_states,
)
from tests.helpers.support import changed


@pytest.mark.parametrize(
    ("z_g", "fixed", "u", "states", "turns"),
    [
        (200, "rigid", -100, 20200, 100),
        (200, "flexspline", 101, 20200, 101),
        (160, "rigid", -80, 12960, 80),
        (161, "rigid", -80.5, 161 * 163, 161),  # odd: the cycle takes two turns of the output
    ],
)
def test_ratio_and_cycle(z_g, fixed, u, states, turns):
    kinematics = Kinematics(z_g, z_g + 2, fixed)
    assert kinematics.u == u
    assert kinematics.cycle_states == states
    assert kinematics.cycle_cam_revolutions == turns


@pytest.mark.parametrize("z_g", [200, 161])
@pytest.mark.parametrize("fixed", ["rigid", "flexspline"])
def test_teeth_stand_alike_in_every_state_and_every_pair_meets(z_g, fixed):
    kinematics = Kinematics(z_g, z_g + 2, fixed)
    states = pitch_locked_states(kinematics)
    for turned, z in ((states.alpha_g, z_g), (states.alpha_b, z_g + 2)):
        pitches = turned * z / (2 * np.pi)
        assert np.abs(pitches - np.rint(pitches)).max() < 1e-6
    first = np.rint(states.alpha_g * z_g / (2 * np.pi)).astype(int) % z_g
    second = np.rint(states.alpha_b * (z_g + 2) / (2 * np.pi)).astype(int) % (z_g + 2)
    assert len(set(zip(first.tolist(), second.tolist(), strict=True))) == kinematics.cycle_states


@pytest.mark.parametrize(("fixed", "still"), [("rigid", "phi_b"), ("flexspline", "phi_g")])
def test_fixed_wheel_stands_and_the_other_follows_the_ratio(fixed, still):
    kinematics = Kinematics(200, 202, fixed)
    states = pitch_locked_states(kinematics, np.arange(300), 0.35)
    moving = "phi_g" if still == "phi_b" else "phi_b"
    assert getattr(states, still) == pytest.approx(np.zeros(300), abs=1e-12)
    assert getattr(states, moving) == pytest.approx(0.35 + states.phi_h / kinematics.u, abs=1e-12)


def test_cage_of_rolling_balls(reference):
    drive = changed(reference, bearing__ball_motion="rolling", bearing__beta=0.25)
    # outer ring still in the cam frame's slow drift; pure rolling between r_i (cam) and r_o: with the outer
    # ring still and the cam turning at 1, the cage turns r_i/(r_i + r_o); seen from the cam that minus 1
    r_o = 80.0 - 4.0
    r_i = r_o - 14.3
    seen_from_cam = r_i / (r_i + r_o) - 1
    assert 0.53 < -seen_from_cam < 0.56
    phi_h = np.array([0.0, 0.1, 0.2])
    expected = np.mod(0.25 + seen_from_cam * phi_h * 24 / (2 * np.pi), 1)
    assert ball_phase(drive, phi_h) == pytest.approx(expected, abs=1e-9)


def test_locked_balls_keep_their_phase(reference):
    drive = changed(reference, bearing__beta=0.25)
    assert ball_phase(drive, np.array([0.0, 5.0])) == pytest.approx([0.25, 0.25])


def test_output_of_the_other_wheel_turns_against(reference):
    # the same relative positions and the same forces: only the side that is called output differs
    flex_fixed = changed(reference, mounting__fixed="flexspline")
    rows = np.arange(0, 2020)
    one = kinematic_error(reference, 80, states=pitch_locked_states(Kinematics.of(reference), rows))
    two = kinematic_error(flex_fixed, 80, states=pitch_locked_states(Kinematics.of(flex_fixed), rows))
    assert two.rotation_arcsec == pytest.approx(one.rotation_arcsec, abs=1e-7)
    assert two.error_arcsec == pytest.approx(-one.error_arcsec, abs=1e-7)


def test_error_is_measured_against_the_nominal_angle(reference):
    # F_kpp = phi_h/u - (phi_g - phi_g0): a wheel that runs ahead counter-clockwise has a negative error
    states = pitch_locked_states(Kinematics.of(reference), np.arange(202))
    result = kinematic_error(reference, 80, states=states)
    actual = states.phi_g + np.radians(result.rotation_arcsec / 3600)
    F_kpp = states.phi_h / -100 - (actual - actual[0])
    assert np.degrees(F_kpp) * 3600 == pytest.approx(result.error_arcsec, abs=1e-7)


@pytest.mark.parametrize("fixed", ["rigid", "flexspline"])
def test_neighbours_together_takes_every_state_once(reference, fixed):
    kinematics = Kinematics.of(changed(reference, mounting__fixed=fixed))
    for index in (np.arange(20200), np.arange(7, 20000, 3), np.arange(150), np.array([5]), np.arange(0)):
        states = pitch_locked_states(kinematics, index)
        order = neighbours_together(kinematics, states)
        assert np.array_equal(np.sort(order), np.arange(len(index)))


@pytest.mark.parametrize("fixed", ["rigid", "flexspline"])
def test_neighbours_together_takes_short_steps(reference, fixed):
    kinematics = Kinematics.of(changed(reference, mounting__fixed=fixed))
    states = pitch_locked_states(kinematics, np.arange(20200))
    wheels = states.take(neighbours_together(kinematics, states))
    tooth = 2 * np.pi / kinematics.z_g
    for turned in (wheels.alpha_g, wheels.alpha_b):
        step = np.abs(np.angle(np.exp(1j * np.diff(turned))))
        assert np.quantile(step, 0.99) < 2.1 * tooth  # within a strip
        assert step.max() < 2.1 * tooth * 2 * STRIP  # from one to the next


def test_results_stand_in_the_order_of_the_states_asked_for(reference):
    index = np.array([900, 3, 202, 4, 20199, 1])
    some = kinematic_error(reference, 80, states=pitch_locked_states(Kinematics.of(reference), index))
    for k, j in enumerate(index):
        alone = kinematic_error(reference, 80, states=pitch_locked_states(Kinematics.of(reference), np.array([j])))
        assert some.rotation_arcsec[k] == pytest.approx(alone.rotation_arcsec[0], abs=1e-7)


def test_a_state_is_named_by_the_turns_of_its_cam(reference):
    states = pitch_locked_states(Kinematics.of(reference), np.array([8370]))
    assert state_place(states, 80.0, 0).startswith("phi_h = 41 turns + 156.8°, phi_g = ")


def test_full_cycle_is_asked_for_by_name(reference):
    from hdassist.run.errors import UsageError

    states = pitch_locked_states(Kinematics.of(reference), np.arange(10))
    with pytest.raises(UsageError, match="full mesh cycle"):
        _ = kinematic_error(reference, 80, states=states).F_ior_arcsec
