"""The search for the extremes of the cycle, against solving every state of it."""

import numpy as np
import pytest

from hdassist import kinematic_error, load_preset
from hdassist.error.search import CycleSearch, Torus, searchable, worth_searching
from hdassist.errors import UsageError
from hdassist.model.kinematics import Kinematics
from tests.process import SMALL
from tests.support import changed


def random_drive(seed: int, preset: str = SMALL):
    rng = np.random.default_rng(seed)
    low = {"tolerances.F_i1": 80, "tolerances.F_i2": 80, "tolerances.e_hb": 80, "tolerances.e_hh": 50}
    low |= {"phases.xi_b": 360, "phases.xi_g": 360, "phases.phi_hh": 360, "gears.j_n": 12, "bearing.g_b": 4}
    return load_preset(preset, [f"{name}={rng.uniform(0, high):.4f}" for name, high in low.items()])


@pytest.mark.parametrize("seed", range(6))
def test_search_finds_what_every_state_shows(seed):
    drive, M_g = random_drive(seed), (1.0, 4.0)[seed % 2]
    full = kinematic_error(drive, M_g, cross_check=None)
    found = CycleSearch(drive, M_g).extremes(drive)
    assert found.F_ior_arcsec == pytest.approx(full.F_ior_arcsec, abs=0.01)
    # the states it names are extremes: of equals another one may be named
    assert full.error_arcsec[found.at_max] == pytest.approx(full.error_arcsec.max(), abs=0.01)
    assert full.error_arcsec[found.at_min] == pytest.approx(full.error_arcsec.min(), abs=0.01)
    assert found.certificate.states < len(full.states)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(60))
def test_search_finds_what_every_state_shows_of_larger_drives(seed):
    preset, torques = (("vzp160", (80.0, 800.0)), ("synthetic-160-162", (10.0, 100.0)))[seed % 2]
    drive, M_g = random_drive(seed, preset), torques[seed // 2 % 2]
    full = kinematic_error(drive, M_g, cross_check=None)
    found = CycleSearch(drive, M_g).extremes(drive)
    assert found.F_ior_arcsec == pytest.approx(full.F_ior_arcsec, abs=0.01)
    assert found.certificate.states < len(full.states) / 8


@pytest.mark.parametrize("teeth", [(200, 202), (60, 62), (61, 63), (159, 161)])
def test_where_anything_may_hide_every_state_is_solved_once(teeth, monkeypatch):
    monkeypatch.setattr("hdassist.error.search.HIDES", np.inf)
    kinematics = Kinematics(*teeth, fixed="rigid")
    asked = []

    def error(j):
        asked.append(j)
        return np.sin(j)

    found = Torus(kinematics, error).solve_around_extremes()
    asked = np.concatenate(asked)
    assert np.array_equal(np.sort(asked), np.arange(kinematics.cycle_states))
    assert np.array_equal(found, np.sin(np.arange(kinematics.cycle_states)))


@pytest.mark.parametrize(
    ("M_g", "phase", "F_ior"), [(80, 0, 31.50), (80, 180, 20.07), (800, 0, 12.29), (800, 180, 2.39)]
)
def test_reference_values_from_a_twentieth_of_the_states(reference, M_g, phase, F_ior):
    search = CycleSearch(reference, M_g)
    turned = changed(reference, phases__xi_b=float(phase))
    found = search.extremes(turned)
    assert found.F_ior_arcsec == pytest.approx(F_ior, abs=0.005)
    assert found.certificate.states < 20200 / 15


@pytest.mark.parametrize(
    "sets", [["gears.z_g=61", "gears.z_b=63"], ["mounting.fixed=flexspline", "tolerances.e_hg=30", "tolerances.e_hb=0"]]
)
def test_odd_teeth_and_the_other_wheel_fixed(sets):
    drive = load_preset(SMALL, sets)
    full = kinematic_error(drive, 4.0, cross_check=None)
    found = CycleSearch(drive, 4.0).extremes(drive)
    assert found.F_ior_arcsec == pytest.approx(full.F_ior_arcsec, abs=0.01)
    assert full.error_arcsec[found.at_max] == pytest.approx(full.error_arcsec.max(), abs=0.01)


def test_no_search_with_rolling_balls():
    drive = load_preset(SMALL, ["bearing.ball_motion=rolling", "bearing.d_ball=3"])
    assert not searchable(drive)
    assert not worth_searching(drive)
    with pytest.raises(UsageError, match="every state"):
        CycleSearch(drive, 1.0)


def test_short_cycles_are_not_worth_a_search(reference):
    assert searchable(load_preset(SMALL))
    assert not worth_searching(load_preset(SMALL))
    assert worth_searching(reference)
