"""The engine against other solvers, on random states of random drives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hdassist.drive.model.contacts import StateGaps, contact_system
from hdassist.drive.solve.answers import ARCSEC, TOLERANCE, residuals
from hdassist.drive.solve.formulation import formulate
from hdassist.drive.solve.loadcase import MANY_STATES, solve_through_cvxpy
from tests.helpers.support import changed, load_case


def span(low: float, high: float):
    """Numbers spread evenly over the decades from low to high."""
    return st.floats(np.log(low), np.log(high)).map(lambda x: float(np.exp(x)))


DRIVES = st.fixed_dictionaries(
    {
        "contact__c_t": span(3e-6, 6e-5),
        "contact__c_ball": span(1e-5, 5e-5),
        "supports__C_1": st.one_of(span(2e5, 1e8), st.just(0.0)),
        "supports__C_2": span(5e3, 1e5),
        "supports__C_3": st.one_of(span(1e3, 1e5), st.just(0.0)),
        "gears__j_n": st.floats(0, 20),
        "bearing__g_b": st.floats(0, 20),
        "bearing__N": st.sampled_from([17, 23, 24, 30]),
        "bearing__ring_h": st.floats(3.0, 5.0),
        "flexspline__k_t": st.floats(1, 1.8),
        "cam__W_0": st.floats(0.94, 0.98),
        "numerics__n_2": st.sampled_from([60, 100]),
        "numerics__n_max": st.sampled_from([20, 40]),
    }
)
STATES = st.tuples(*[st.floats(-0.1, 0.1)] * 4).map(np.array)
TORQUES = st.tuples(span(20e3, 1000e3), st.sampled_from([-1, 1])).map(lambda x: x[0] * x[1])


@settings(max_examples=12)
@given(DRIVES, st.floats(0, 1), st.floats(0, 1), STATES, TORQUES)
def test_engine_agrees_with_two_other_solvers(reference, fields, tau, beta, scalars, torque):
    system = contact_system(changed(reference, **fields), tau, beta)
    formulation = formulate(system)
    delta_p = system.delta_p + system.deviation_map[:, :4] @ scalars
    forces, free, _ = load_case(formulation, torque).forces(delta_p[None])
    assert residuals(system, delta_p[None], torque, forces, free).worst[0] <= TOLERANCE
    for solver in ("CLARABEL", "OSQP"):
        others, same = solve_through_cvxpy(formulation, delta_p, torque, solver)
        assert same[system.free_rotation] * ARCSEC == pytest.approx(free[0, system.free_rotation] * ARCSEC, abs=0.005)
        assert others == pytest.approx(forces[0], abs=2e-3 * forces.max())


@pytest.mark.thorough
@settings(max_examples=3)
@given(DRIVES, st.floats(5, 15), STATES, TORQUES)
def test_engine_agrees_with_two_other_solvers_on_coned_flanks(reference, fields, k_face, scalars, torque):
    drive = changed(reference, **fields, numerics__stations=4, contact__k_face=k_face)
    system = contact_system(drive)
    formulation = formulate(system)
    delta_p = system.delta_p + system.deviation_map[:, :4] @ scalars
    forces, free, _ = load_case(formulation, torque).forces(delta_p[None])
    assert residuals(system, delta_p[None], torque, forces, free).worst[0] <= TOLERANCE
    for solver in ("CLARABEL", "OSQP"):
        others, same = solve_through_cvxpy(formulation, delta_p, torque, solver)
        assert same[system.free_rotation] * ARCSEC == pytest.approx(free[0, system.free_rotation] * ARCSEC, abs=0.005)
        assert others == pytest.approx(forces[0], abs=2e-3 * forces.max())


@pytest.mark.thorough
@pytest.mark.parametrize("stations", [1, 3])
@settings(max_examples=6)
@given(DRIVES, st.floats(0, 1), st.floats(0, 1), st.integers(0, 2**32 - 1), TORQUES)
def test_many_states_at_once_are_what_each_is_alone(reference, stations, fields, tau, beta, seed, torque):
    system = contact_system(changed(reference, **fields, numerics__stations=stations), tau, beta)
    formulation = formulate(system)
    scalars = np.random.default_rng(seed).uniform(-0.1, 0.1, (MANY_STATES, 4))
    delta_p = system.delta_p_of(StateGaps(scalars))
    _, free, _ = load_case(formulation, torque).forces(delta_p)
    for compiled in (True, False):
        found = load_case(formulation, torque, compiled=compiled).sums(StateGaps(scalars))
        assert found.residuals.worst.max() <= TOLERANCE
        assert found.rotation * ARCSEC == pytest.approx(free[:, system.free_rotation] * ARCSEC, abs=1e-7)


def test_warm_answers_do_not_depend_on_their_order(reference):
    system = contact_system(reference)
    formulation = formulate(system)
    scalars = np.random.default_rng(1).uniform(-0.08, 0.08, (60, 4))
    delta_p = system.delta_p + scalars @ system.deviation_map[:, :4].T
    there, free, _ = load_case(formulation, 80e3).forces(delta_p)
    back, freed, _ = load_case(formulation, 80e3).forces(delta_p[::-1])
    assert back[::-1] == pytest.approx(there, abs=1e-8 * there.max())
    assert freed[::-1, 0] * ARCSEC == pytest.approx(free[:, 0] * ARCSEC, abs=1e-8)


def test_symmetric_degenerate_states_are_solved(reference):
    # no deviations, balls and nodes in mirror pairs, torque from nothing up: contacts just touch in pairs
    system = contact_system(changed(reference, gears__j_n=0.0))
    formulation = formulate(system)
    for torque in (1e-3, 1.0, 1e3, -1e3, 1e5):
        forces, free, _ = load_case(formulation, torque).forces(np.repeat(system.delta_p[None], 3, axis=0))
        assert (
            residuals(system, np.repeat(system.delta_p[None], 3, axis=0), torque, forces, free).worst.max() <= TOLERANCE
        )
