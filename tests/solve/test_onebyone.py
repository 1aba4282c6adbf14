"""One state after another, and the contact sets that they start from."""

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.belief.draws import meshing_shift
from hdassist.drive.model.contacts import StateGaps, contact_system
from hdassist.drive.solve import walk
from hdassist.drive.solve.answers import residuals
from hdassist.drive.solve.formulation import formulate
from hdassist.drive.solve.loadcase import OneByOne
from hdassist.drive.solve.pivoting import solve_near
from tests.helpers.support import HAS_WALK, load_case

WAYS = [
    solve_near,
    pytest.param(walk.walk_near_state, marks=pytest.mark.skipif(not HAS_WALK, reason="no compiled walk")),
]


@pytest.fixture(scope="module")
def system(reference):
    return contact_system(reference)


@pytest.fixture(scope="module")
def formulation(system):
    return formulate(system)


@pytest.mark.parametrize("way", WAYS)
def test_state_is_solved_from_near_and_distant_contact_sets(formulation, system, way):
    torque, delta_p = 80e3, system.delta_p_of(StateGaps(np.array([[0.03, 0.01, 0.05, -0.02]])))
    gaps, right = formulation.gaps(delta_p[0]), -formulation.load(torque)
    forces, free, _ = load_case(formulation, torque).forces(delta_p)
    solved = forces[0] > 0
    one_more = solved.copy()
    one_more[np.argmin(solved)] = True
    for start in (solved, one_more, np.ones_like(solved)):
        found, duals = formulation.answer(*way(formulation, gaps, right, start))
        assert found == pytest.approx(forces[0], abs=1e-8 * forces.max())
        assert duals == pytest.approx(free[0], abs=1e-11)
    assert way(formulation, gaps * np.nan, right, solved) is None


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("torque", [1.0, 80e3])
def test_flanks_that_separate_at_torque_reversal_are_tracked(formulation, system, way, torque):
    gaps, right = formulation.gaps(system.delta_p), -formulation.load(torque)
    other_way, _ = solve_near(formulation, gaps, -right, np.ones(len(gaps), dtype=bool))
    found = way(formulation, gaps, right, other_way > 0)
    forces, free = (answer[None] for answer in formulation.answer(*found))
    assert residuals(system, system.delta_p[None], torque, forces, free).worst.max() < 1e-10


CYCLES = {  # of size-25-100: from the contacts of 2.7 N*m to those of 14 all candidates at once go round in a circle
    "flexspline.h_1": 0.568, "flexspline.h_3": 0.334, "flexspline.b_w": 11.7, "flexspline.l": 36.0,
    "flexspline.k_t": 1.44, "bearing.ring_b": 9.15, "bearing.ring_h": 1.81, "bearing.d_ball": 5.77,
    "bearing.g_b": 1.17, "bearing.beta": 0.637, "supports.C_1": 90400.0, "supports.C_2": 3140.0,
    "supports.C_3": 32700.0, "contact.k_face": 8.46, "contact.c_ball": 3.21e-05, "contact.c_bore": 6.61e-08,
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_cycling_candidates_change_contact_one_at_a_time(way):
    system = contact_system(load_preset("size-25-100").with_values(CYCLES))
    formulation = formulate(system)
    gaps, contact = formulation.gaps(system.delta_p), np.ones(len(system.delta_p), dtype=bool)
    for torque in (2.7e3, 14e3):
        found = way(formulation, gaps, -formulation.load(torque), contact)
        contact = found[0] > 0
    forces, free = (answer[None] for answer in formulation.answer(*found))
    assert residuals(system, system.delta_p[None], torque, forces, free).worst.max() < 1e-10


FROM_ALL = {  # drawn from a data sheet: from all candidates in contact no step leads to the end
    "gears.m": 0.35, "gears.h_a": 0.5763, "gears.h_f": 1.268, "gears.j_n": 2.954, "material.E": 200300.0,
    "material.nu": 0.3012, "flexspline.h_1": 0.5209, "flexspline.h_3": 0.4675, "flexspline.b_w": 8.499,
    "flexspline.l": 37.64, "flexspline.k_t": 1.053, "bearing.ring_b": 9.36, "bearing.ring_h": 1.946,
    "bearing.d_ball": 6.393, "bearing.g_b": 4.396, "bearing.beta": 0.9312, "cam.W_0": 0.3755,
    "supports.C_1": 143100.0, "supports.C_2": 13900.0, "supports.C_3": 9538.0, "contact.k_face": 9.138,
    "contact.c_ball": 5.522e-05, "contact.c_bore": 6.25e-08, "operation.dT": 10.24,
}  # fmt: skip


def test_state_without_a_path_from_all_contacts_needs_no_model(monkeypatch):
    system = contact_system(load_preset("size-25-100").with_values(FROM_ALL))
    monkeypatch.setattr(OneByOne, "_by_daqp", lambda *_: pytest.fail("half a second each"))
    for compiled in (True, False):
        forces, free, fallbacks = OneByOne(formulate(system), compiled=compiled).solve(system.delta_p[None], 6.7e3)
        assert fallbacks == 0
        assert residuals(system, system.delta_p[None], 6.7e3, forces, free).worst.max() < 1e-10


JAMMED = [  # drawn from the sheet of size 17, its teeth pushed into each other, hardly loaded
    {"gears.j_n": 4.48, "flexspline.b_w": 9.42, "flexspline.l": 24.4, "flexspline.k_t": 1.17, "cam.W_0": 0.223,
     "contact.c_bore": 4.38e-07},
    {"gears.h_a": 0.522, "gears.j_n": 5.79, "material.nu": 0.281, "flexspline.h_1": 0.42, "flexspline.h_3": 0.334,
     "flexspline.l": 23.8, "bearing.ring_h": 1.18, "bearing.g_b": 6.24, "cam.W_0": 0.22, "contact.k_face": 7.46},
]  # fmt: skip


@pytest.mark.parametrize("values", JAMMED)
def test_weakly_held_parts_are_solved_from_a_heavier_load(values, monkeypatch):
    monkeypatch.setattr(OneByOne, "_by_daqp", lambda *_: pytest.fail("two seconds each"))
    meshing_shift(load_preset("size-17-100").with_values(values))


def test_empty_state_list_gives_no_results_and_keeps_the_contacts(formulation, system):
    contact = np.arange(len(system.delta_p)) % 2 == 0
    solver = OneByOne(formulation, contact)
    forces, free, fallbacks = solver.solve(system.delta_p[None][:0], 80e3)
    assert (forces.shape, free.shape, fallbacks) == ((0, len(contact)), (0, 3), 0)
    assert np.array_equal(solver.contact, contact)


def test_torques_together_are_answered_as_each_by_itself(formulation):
    torques = np.array([-300.0, -20.0, 20.0, 300.0])
    together = load_case(formulation, 80.0).over(torques, str)
    alone = [load_case(formulation, 80.0).over(torques[k : k + 1], str) for k in range(len(torques))]
    for name in ("rotation_arcsec", "zone_share", "tooth_force_N"):
        assert getattr(together, name) == pytest.approx(np.concatenate([getattr(one, name) for one in alone]), rel=1e-9)
    assert together.certificate.states == len(torques)
