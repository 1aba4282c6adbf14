"""The error over all tooth positions: every state, and extremes that a grid of states proposes, against it."""

import numpy as np
import pytest

from hdassist import kinematic_error, load_preset
from hdassist.drive.error.error_map import Batch, ErrorMap, searchable
from hdassist.drive.error.extremes import extremes_of, many_extremes
from hdassist.drive.model.geometry import Kinematics
from hdassist.features.mounting.positions import rotated
from hdassist.run.errors import UsageError
from hdassist.run.run import UNCHECKED
from tests.helpers.process import SMALL
from tests.helpers.searched_drives import searched_drive
from tests.helpers.support import changed

# stiffnesses and clearances of vzp160 when the seeds below were found: where an island is hangs on them
WITH_ISLANDS = (
    "numerics.nominal_curve=linear", "gears.j_n=6.751", "flexspline.k_t=1.38", "bearing.ring_h=4.011",
    "supports.C_1=1.341e6", "supports.C_2=1.964e4", "supports.C_3=8.887e3",
    "contact.c_t=2.108e-5", "contact.c_ball=2.528e-5", "contact.k_face=9",
)  # fmt: skip


def random_drive(seed: int, preset: str = SMALL):
    rng = np.random.default_rng(seed)
    low = {"tolerances.F_i1": 80, "tolerances.F_i2": 80, "tolerances.e_hb": 80, "tolerances.e_hh": 50}
    low |= {"phases.xi_b": 360, "phases.xi_g": 360, "phases.phi_hh": 360, "gears.j_n": 12, "bearing.g_b": 4}
    return load_preset(preset, [f"{name}={rng.uniform(0, high):.4f}" for name, high in low.items()])


@pytest.mark.parametrize("seed", range(6))
def test_extremes_equal_those_of_every_state_and_proposals_are_close(seed):
    drive, M_g = random_drive(seed), (1.0, 4.0)[seed % 2]
    full = kinematic_error(drive, M_g, run=UNCHECKED)
    error_map = ErrorMap(drive, M_g)
    every, proposed = error_map.extremes(), many_extremes(error_map, Batch.of(drive))
    assert every.first == pytest.approx(full.F_ior_arcsec, abs=1e-8)
    assert (every.at_max[0], every.at_min[0], every.certificate.states) == (full.at_max, full.at_min, len(full.states))
    assert proposed.first == pytest.approx(full.F_ior_arcsec, abs=0.01)
    # the states it names are extremes: of equals another one may be named
    assert full.error_arcsec[proposed.at_max[0]] == pytest.approx(full.error_arcsec.max(), abs=0.01)
    assert full.error_arcsec[proposed.at_min[0]] == pytest.approx(full.error_arcsec.min(), abs=0.01)
    assert proposed.certificate.max_residual < 1e-8


# islands of the error that climbs from a coarse grid did not come to: they were up to 2.1 arcsec low
@pytest.mark.thorough
@pytest.mark.parametrize(
    ("seed", "beta"), [(223, 0.5), (461, 0.5), (163, 0.5), (276, 0.5), (296, 0.5), (406, 0.5), (685, 0.5), (276, 0.22)]
)
def test_proposals_find_islands(seed, beta):
    drive, M_g = searched_drive("light", seed, (*WITH_ISLANDS, f"bearing.beta={beta}"))
    error_map = ErrorMap(drive, M_g)
    assert many_extremes(error_map, Batch.of(drive)).first == pytest.approx(error_map.extremes().first, abs=0.01)


# along a crease a state may be higher than its neighbours and lower than one some steps on: 0.13 arcsec were missed
@pytest.mark.thorough
@pytest.mark.parametrize("seed", [47, 115, 158])
def test_proposals_go_along_creases(seed):
    drive, M_g = searched_drive("any", seed)
    error_map = ErrorMap(drive, M_g)
    assert many_extremes(error_map, Batch.of(drive)).first == pytest.approx(error_map.extremes().first, abs=1e-6)


def test_turned_drives_are_searched_together(reference):
    turns = [0.0, 90.0, 240.0]
    found = many_extremes(ErrorMap(reference, 800), Batch.turned(reference, turns))
    exact = [ErrorMap(rotated(reference, turn), 800).extremes().first for turn in turns]
    assert found.F_ior_arcsec == pytest.approx(exact, abs=1e-6)
    assert np.ptp(exact) > 1, "they differ, or this shows nothing"
    assert found.certificate.states < 3 * 1500


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["light", "heavy", "any"])
def test_proposals_find_what_every_state_shows_of_random_drives(kind):
    for seed in range(1000, 1060):
        drive, M_g = searched_drive(kind, seed)
        error_map = ErrorMap(drive, M_g)
        found = many_extremes(error_map, Batch.of(drive))
        assert found.first == pytest.approx(error_map.extremes().first, abs=0.05), seed


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("M_g", "phase", "F_ior"), [(80, 0, 31.50), (80, 180, 20.07), (800, 0, 12.29), (800, 180, 2.39)]
)
def test_reference_values(reference, M_g, phase, F_ior):
    turned = changed(reference, phases__xi_b=float(phase))
    error_map = ErrorMap(reference, M_g)
    assert error_map.extremes(turned).first == pytest.approx(F_ior, abs=0.005)
    proposed = many_extremes(error_map, Batch.of(turned))
    assert proposed.first == pytest.approx(F_ior, abs=0.005)
    assert proposed.certificate.states < 20200 / 4


@pytest.mark.parametrize(
    "sets", [["gears.z_g=61", "gears.z_b=63"], ["mounting.fixed=flexspline", "tolerances.e_hg=30", "tolerances.e_hb=0"]]
)
def test_odd_teeth_and_the_other_wheel_fixed(sets):
    drive = load_preset(SMALL, sets)
    full = kinematic_error(drive, 4.0, run=UNCHECKED)
    every, proposed = ErrorMap(drive, 4.0).extremes(), many_extremes(ErrorMap(drive, 4.0), Batch.of(drive))
    assert every.first == pytest.approx(full.F_ior_arcsec, abs=1e-8)
    assert (every.at_max[0], every.at_min[0]) == (full.at_max, full.at_min)
    assert proposed.first == pytest.approx(full.F_ior_arcsec, abs=0.01)
    assert full.error_arcsec[proposed.at_max[0]] == pytest.approx(full.error_arcsec.max(), abs=0.01)


def test_a_drive_without_deviations_has_no_error():
    drive = load_preset("vzp160").with_values(
        {f"tolerances.{name}": 0.0 for name in ("F_i1", "F_i2", "e_hh", "e_hg", "e_hb")}
    )
    assert ErrorMap(drive, 80.0).extremes().first == pytest.approx(0, abs=1e-6)
    assert many_extremes(ErrorMap(drive, 80.0), Batch.of(drive)).first == pytest.approx(0, abs=1e-6)


def test_short_cycles_and_rolling_balls_are_solved_in_every_state():
    small = load_preset(SMALL)
    cycle = Kinematics.of(small).cycle_states
    assert [found.certificate.states for found in extremes_of(small, (1.0, 4.0))] == [cycle, cycle]
    rolling = load_preset(SMALL, ["bearing.ball_motion=rolling", "bearing.d_ball=3", "numerics.n_beta=4"])
    assert not searchable(rolling)
    assert extremes_of(rolling, [1.0])[0].first == kinematic_error(rolling, 1.0, run=UNCHECKED).F_ior_arcsec
    with pytest.raises(UsageError, match="ball_motion"):
        ErrorMap(rolling, 1.0)
