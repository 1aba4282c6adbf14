"""Turning the fixed wheel on its seat."""

import numpy as np
import pytest

from hdassist import kinematic_error, load_preset
from hdassist.drive.solve.answers import EMPTY
from hdassist.features.mounting import positions as making
from hdassist.features.mounting.positions import MountingCurve, mounting_curve, phase_deg, rotated
from hdassist.run.errors import UsageError
from hdassist.run.run import UNCHECKED
from tests.helpers.process import SMALL
from tests.helpers.support import changed


def test_turning_the_wheel_is_turning_its_deviation():
    drive = load_preset(SMALL)
    curve = mounting_curve(drive, [1.0], [0.0, 30.0, 60.0])
    for k, xi_b in enumerate((90, 120, 150)):
        alone = kinematic_error(load_preset(SMALL, [f"phases.xi_b={xi_b}"]), 1.0)
        assert curve.F_ior_arcsec[0, k] == pytest.approx(alone.F_ior_arcsec, abs=1e-9)
        assert curve.phase_deg[k] == xi_b
    assert curve.certificate.states == 3 * 1860
    assert len(curve.cross_checks) == 3


def test_with_the_flexspline_fixed_it_is_the_flexspline_that_turns():
    drive = load_preset(SMALL, ["mounting.fixed=flexspline", "tolerances.e_hg=30", "tolerances.e_hb=0"])
    curve = mounting_curve(drive, [1.0], [0.0, 90.0], run=UNCHECKED)
    alone = kinematic_error(changed(drive, phases__xi_g=90.0), 1.0)
    assert curve.F_ior_arcsec[0, 1] == pytest.approx(alone.F_ior_arcsec, abs=1e-9)
    assert curve.phase_deg.tolist() == [0, 90]
    assert abs(np.diff(curve.F_ior_arcsec[0])[0]) > 1


def test_a_full_turn_comes_home():
    drive = load_preset(SMALL)
    curve = mounting_curve(drive, [1.0], [0.0, 360.0], run=UNCHECKED)
    assert curve.F_ior_arcsec[0, 1] == pytest.approx(curve.F_ior_arcsec[0, 0], abs=1e-7)


def test_phase_counts_from_the_offset_and_knows_marks(reference):
    assert phase_deg(reference) == 260
    assert phase_deg(changed(reference, phases__phi_hb=30.0)) == 230
    assert phase_deg(changed(reference, mounting__mark_kind="runout")) == 80
    assert phase_deg(rotated(reference, 130.0)) == 30
    fixed = changed(reference, mounting__fixed="flexspline", phases__xi_g=10.0, phases__phi_hg=40.0)
    assert phase_deg(fixed) == 330


def curve_of(*values: list[float]) -> MountingCurve:
    rotations = np.arange(len(values[0])) * 30.0
    torques = tuple(float(k + 1) for k in range(len(values)))
    every = np.ones(np.shape(values), dtype=bool)
    return MountingCurve(torques, rotations, rotations, np.array(values), EMPTY, (), every, holes=12)


def test_the_recommendation_serves_the_torque_served_worst():
    curve = curve_of([20.0, 10.0, 14.0], [10.0, 12.0, 7.0])
    assert curve.recommended.rotation_deg == 60
    assert curve.ranked[-1].rotation_deg == 0


def test_nothing_better_means_stay():
    curve = curve_of([10.0, 9.5], [10.0, 11.0])
    assert curve.recommended == curve.current


def test_of_equals_the_least_turn():
    assert curve_of([10.0, 8.0, 8.0]).recommended.rotation_deg == 30


@pytest.mark.parametrize("rotations", [[], [30.0, 60.0]])
def test_the_present_position_comes_first(reference, rotations):
    with pytest.raises(UsageError, match="first rotation"):
        mounting_curve(reference, [80.0], rotations)


ROTATIONS = [30.0 * k for k in range(12)]


@pytest.fixture(scope="module")
def every_state():
    return mounting_curve(load_preset(SMALL), [1.0, 4.0], ROTATIONS, run=UNCHECKED)


def test_searched_curves_are_those_of_every_state(every_state):
    searched = mounting_curve(load_preset(SMALL), [1.0, 4.0], ROTATIONS, drawn=True, run=UNCHECKED)
    assert searched.F_ior_arcsec == pytest.approx(every_state.F_ior_arcsec, abs=0.01)
    # what the advice rests on is proven: the present and the recommended position
    for torque in range(2):
        assert set(searched.rotation_deg[searched.every_state[torque]]) == {0, searched.recommended.rotation_deg}
    assert searched.every_state.sum() == 4
    assert every_state.every_state.all()
    assert searched.recommended.rotation_deg == every_state.recommended.rotation_deg


def test_a_search_that_missed_is_not_used(every_state, monkeypatch):
    real = making._searched
    monkeypatch.setattr(making, "_searched", lambda *task: (real(*task)[0] - 0.5, real(*task)[1]))
    some = slice(None, None, 3)
    curve = mounting_curve(load_preset(SMALL), [1.0, 4.0], ROTATIONS[some], drawn=True, run=UNCHECKED)
    assert curve.every_state.all()
    assert curve.F_ior_arcsec == pytest.approx(every_state.F_ior_arcsec[:, some], abs=1e-9)
