"""One state after another by the active-set solver, and the contact sets that they start from."""

import numpy as np
import pytest

from hdassist.model.contacts import StateGaps, contact_system
from hdassist.solve.activeset import ActiveSet, solve_near
from hdassist.solve.certificate import residuals
from hdassist.solve.engine import Engine
from hdassist.solve.formulation import formulate


@pytest.fixture(scope="module")
def system(reference):
    return contact_system(reference)


@pytest.fixture(scope="module")
def formulation(system):
    return formulate(system)


def test_a_state_is_found_from_contact_sets_that_are_near_and_far(formulation, system):
    torque, delta_p = 80e3, system.delta_p_of(StateGaps(np.array([[0.03, 0.01, 0.05, -0.02]])))
    gaps, right = formulation.gaps(delta_p[0]), formulation.right_side(torque)
    forces, free, _ = Engine(formulation, torque).forces(delta_p)
    solved = forces[0] > 0
    one_more = solved.copy()
    one_more[np.argmin(solved)] = True
    for start in (solved, one_more, np.ones_like(solved)):
        found, duals = formulation.answer(*solve_near(formulation, gaps, right, start))
        assert found == pytest.approx(forces[0], abs=1e-8 * forces.max())
        assert duals == pytest.approx(free[0], abs=1e-11)
    assert solve_near(formulation, gaps * np.nan, right, solved) is None


def test_a_model_is_set_up_once_for_many_states(formulation, system, monkeypatch):
    set_up, made = ActiveSet._set_up, []
    monkeypatch.setattr(ActiveSet, "_set_up", lambda self, *a: made.append(1) or set_up(self, *a))
    solver = ActiveSet(formulation, 80e3)
    few = system.delta_p_of(StateGaps(np.outer(np.linspace(0, 1, 4), [0.03, 0.01, 0.05, -0.02])))
    assert solver.solve(few)[2] == len(made) == 0  # near each other: no model at all
    many = np.repeat(few, 3, axis=0)
    for _ in range(2):
        forces, free, fallbacks = solver.solve(many)
        assert (fallbacks, len(made)) == (0, 1)
        assert residuals(system, many, 80e3, forces, free).worst.max() < 1e-8


def test_no_states_have_no_answers_and_leave_the_contacts_as_they_were(formulation, system):
    contact = np.arange(len(system.delta_p)) % 2 == 0
    solver = ActiveSet(formulation, 80e3, contact)
    forces, free, fallbacks = solver.solve(system.delta_p[None][:0])
    assert (forces.shape, free.shape, fallbacks) == ((0, len(contact)), (0, 3), 0)
    assert np.array_equal(solver.contact, contact)
