"""One statement of the programme, one proof of the answer."""

import re
import subprocess
import sys
from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest

from hdassist import kinematic_error, load_preset, preset_names
from hdassist.drive.model.contacts import ROTATION, WITHOUT_DEVIATIONS, StateGaps, contact_system
from hdassist.drive.model.geometry import Kinematics, pitch_locked_states
from hdassist.drive.solve import loadcase
from hdassist.drive.solve.answers import ARCSEC, StateSums, proven_answers, residuals
from hdassist.drive.solve.formulation import formulate
from hdassist.drive.solve.loadcase import (
    OneByOne,
    require_compiled_as_stated,
    solve_again,
    solve_through_cvxpy,
    template_differences,
)
from hdassist.interface.cli import THREADS
from hdassist.run import kept
from hdassist.run.errors import Fault, UntrustedError, UsageError
from hdassist.run.run import UNCHECKED, Run
from tests.helpers.process import CLEAN, SMALL
from tests.helpers.support import changed, load_case


@pytest.fixture(scope="module")
def system(reference):
    return contact_system(reference)


@pytest.fixture
def formulation(system):
    return formulate(system)


def test_units_make_the_numbers_of_order_one(reference, formulation, system):
    units = formulation.units
    assert (units.gap, units.force) == pytest.approx((1e-3, 1e-3 / reference.contact.c_t))  # a um, and what closes it
    assert units.load == pytest.approx([system.geometry.r_m, 1, 1])


def test_the_programme_is_dpp(formulation):
    problem = formulation.statement.problem
    assert problem.is_dcp(dpp=True)
    assert {p.name() for p in problem.parameters()} == {"delta_p", "b"}


@pytest.mark.thorough
@pytest.mark.parametrize("name", preset_names())
def test_the_engine_runs_what_cvxpy_compiles(name):
    drive = load_preset(name)
    assert list(template_differences(formulate(contact_system(drive)))) == []
    some = changed(drive, supports__C_1=0.0, numerics__stations=3)
    assert list(template_differences(formulate(contact_system(some, tau=0.3, beta=0.7)))) == []


def test_a_neighbours_engine_and_another_torque_give_the_same_answers(reference, formulation, system):
    near = load_case(formulation, 80e3)
    near.forces(system.delta_p[None])
    other = contact_system(reference, tau=0.4, beta=0.2)
    engine = load_case(formulate(other), -5e3, like=near)
    engine.forces(other.delta_p[None])
    engine.load(800.0)
    forces, free, fallbacks = engine.forces(other.delta_p[None])
    alone, freed, _ = load_case(formulate(other), 800e3).forces(other.delta_p[None])
    assert fallbacks == 0
    assert forces == pytest.approx(alone, abs=1e-8 * alone.max())
    assert free == pytest.approx(freed, abs=1e-12)


@pytest.mark.parametrize(
    ("part", "wrong"), [("quadratic", "P"), ("linear", "q"), ("equality", "A"), ("bound", "further rows")]
)
def test_a_coefficient_changed_in_cvxpy_is_noticed(formulation, system, tmp_path, monkeypatch, part, wrong):
    # the statement is what everything runs: data that differ from what it compiles to are refused
    stated, n = formulation.statement, len(system.delta_p)
    x, pick = stated.forces, np.eye(n)[3]
    objective, constraints = stated.problem.objective.expr, list(stated.problem.constraints)
    if part == "quadratic":
        objective = objective + cp.quad_form(x, cp.psd_wrap(np.diag(pick)))
    elif part == "linear":
        objective = objective + 3.0 * (pick @ x)
    elif part == "equality":
        old, sums = constraints
        constraints = [old.args[0] - np.array([0.2, 0, 0]) * (pick @ x) == 0, sums]
    else:
        constraints.append(x >= 0.001 * np.ones(n))
    problem = cp.Problem(cp.Minimize(objective), constraints)
    altered = replace(formulation)
    altered.__dict__["statement"] = replace(stated, problem=problem, equilibrium=constraints[0])
    monkeypatch.setattr(loadcase, "_proven", set())
    monkeypatch.setenv(kept.FOLDER, str(tmp_path))
    with pytest.raises(UntrustedError, match=f"compiled the programme to different data: .*{wrong}"):
        require_compiled_as_stated(altered)
    assert list(tmp_path.iterdir()) == []


COMPARED = """
import os, sys, time
os.environ["HDASSIST_CACHE"] = sys.argv[1]
from hdassist import load_preset
from hdassist.drive.error.cycle import require_programme
from hdassist.run.errors import UntrustedError
from hdassist.run.run import Run, workers
from hdassist.drive.solve import loadcase

with workers(1) as executor:
    require_programme(load_preset("size-14-100"), Run(executor))
    print("cvxpy" in sys.modules, Run(executor).beside(eval, "'cvxpy' in __import__('sys').modules").result())
while len(os.listdir("/proc/self/task")) > 1:  # a thread of the pool that ends; beside it no process is forked
    time.sleep(0.01)
loadcase._proven.clear()
loadcase._key = lambda _: "0" * 64
loadcase.template_differences = lambda _: iter("P")
with workers(1) as executor:
    try:
        require_programme(load_preset("size-14-100"), Run(executor))
    except UntrustedError as error:
        print(str(error).endswith("different data: P"))
"""


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform != "linux", reason="processes are spawned elsewhere")
def test_solver_process_compares_the_programme_and_reports_its_error(tmp_path):
    code, threads = [sys.executable, "-c", COMPARED, str(tmp_path)], dict.fromkeys(THREADS, "1")
    found = subprocess.run(code, env=CLEAN | threads, capture_output=True, text=True, timeout=60, check=True)
    assert found.stdout.split() == ["False", "True", "True"]


def test_verified_compilation_is_cached_and_invalid_cache_entries_are_ignored(formulation, tmp_path, monkeypatch):
    def anew():
        monkeypatch.setattr(loadcase, "_proven", set())
        require_compiled_as_stated(formulation)

    compilations = []
    monkeypatch.setenv(kept.FOLDER, str(tmp_path))
    monkeypatch.setattr(loadcase, "template_differences", lambda _: compilations.append(1) or [])
    anew()
    anew()
    assert len(compilations) == 1
    (answer,) = (tmp_path / kept.OWN_FOLDER).iterdir()
    answer.write_text("something else")
    anew()
    assert len(compilations) == 2
    monkeypatch.setattr(loadcase, "version", lambda _: "99")
    anew()
    assert len(compilations) == 3


@pytest.mark.thorough
@pytest.mark.parametrize("solver", ["daqp", "clarabel", "osqp", "highs", "scs"])
def test_every_state_can_go_through_cvxpy(reference, solver):
    states = pitch_locked_states(Kinematics.of(reference), np.arange(0, 202, 40))
    direct = kinematic_error(reference, 80, states=states, run=UNCHECKED)
    through = kinematic_error(reference, 80, states=states, run=UNCHECKED, solver=solver)
    assert through.rotation_arcsec == pytest.approx(direct.rotation_arcsec, abs=1e-3)


def test_an_unknown_solver_is_an_error(formulation, system):
    with pytest.raises(UsageError, match="nosuch") as error:
        load_case(formulation, 80e3, solver="nosuch").sums(WITHOUT_DEVIATIONS)
    assert error.value.hint.startswith("choose one of clarabel, ")
    assert "daqp" in error.value.hint


def test_solver_breakdown_is_reported_by_its_first_line(formulation, system, monkeypatch):
    def breaks(*_, **__):
        raise cp.SolverError("no luck\nat all")

    monkeypatch.setattr(formulation.statement.problem, "solve", breaks)
    with pytest.raises(UntrustedError) as error:
        solve_through_cvxpy(formulation, system.delta_p, 80e3, "clarabel")
    assert str(error.value) == "solver CLARABEL could not solve a mesh position: no luck"
    assert (error.value.hint, error.value.fault) == ("use another solver with --solver NAME", Fault.UNTRUSTED_STATE)


def test_solutions_by_another_solver_are_counted_with_their_largest_difference(formulation, system):
    torques = np.array([80.0, -300.0, 800.0])
    delta_p = np.repeat(system.delta_p[None], 3, axis=0)
    rotation = np.array([load_case(formulation, M_g * 1e3).forces(delta_p[:1])[1][0, 0] * ARCSEC for M_g in torques])
    # to the name of a solver that runs at its own settings, too
    found = solve_again(formulation, torques, delta_p, rotation + np.array([0.001, -0.004, 0.002]), "daqp", str)
    assert (found.solver, found.states) == ("DAQP", 3)
    assert found.max_difference_arcsec == pytest.approx(0.004, abs=1e-6)
    words = r"disagree at state 1: the solutions of hdassist and daqp, clarabel differ by 0.02″"
    with pytest.raises(UntrustedError, match=words) as error:
        solve_again(
            formulation, torques, delta_p, rotation + np.array([0.001, -0.02, 0.03]), "daqp", lambda k: f"state {k}"
        )
    assert error.value.fault is Fault.SOLVERS_DISAGREE
    assert "--cross-check" in error.value.hint


def test_the_second_solver_decides_a_long_cross_check(formulation, system, monkeypatch):
    monkeypatch.setitem(loadcase.CROSS_LIMITS, "HIGHS", {"qp_iteration_limit": 5})
    rotation = load_case(formulation, 80e3).forces(system.delta_p[None])[1][:, 0] * ARCSEC
    check = solve_again(formulation, np.array([80.0]), system.delta_p[None], rotation + 0.002, "highs", str)
    assert check.solver == "HIGHS, CLARABEL"
    assert check.max_difference_arcsec == pytest.approx(0.002, abs=2e-4)
    # the limit is that of a check: a user who names HIGHS as the solver gets its solution
    forces, _ = solve_through_cvxpy(formulation, system.delta_p, 80e3, "highs")
    assert forces.max() > 0


@pytest.mark.parametrize(
    ("residual", "spoil"),
    [
        (0, lambda f, a: (f - 1e-6 * f.max(), a)),
        (3, lambda f, a: (f * (1 + 1e-6), a)),
        (2, lambda f, a: (f, a + np.array([1e-7, 0, 0]))),
        (1, lambda f, a: (f, a + np.array([1e-7, 0, 0]))),
    ],
)
def test_a_wrong_answer_has_no_certificate(formulation, system, residual, spoil):
    forces, free, _ = load_case(formulation, 80e3).forces(system.delta_p[None])
    right = residuals(system, system.delta_p[None], 80e3, forces, free)
    assert right.shares[0, residual] < 1e-11
    wrong = residuals(system, system.delta_p[None], 80e3, *spoil(forces, free))
    assert wrong.shares[0, residual] > 1e-8


def test_the_certificate_is_made_from_the_unscaled_system(system):
    # forces that are right for other gaps are not right for these
    forces, free, _ = load_case(formulate(system), 80e3).forces(system.delta_p[None])
    moved = system.delta_p.copy()
    moved[np.argmax(forces[0])] += 1e-5
    assert residuals(system, moved[None], 80e3, forces, free).worst[0] > 1e-8


def test_nan_is_the_worst_residual(system):
    n = len(system.delta_p)
    proof = residuals(system, system.delta_p[None], 80e3, np.full((1, n), np.nan), np.zeros((1, 3)))
    assert proof.worst[0] == np.inf


def test_an_unsolved_state_is_named_and_no_number_comes_out(system, formulation):
    delta_p = system.delta_p_of(StateGaps(np.zeros((5, 0))))
    forces, free, _ = load_case(formulation, 80e3).forces(delta_p)
    forces[3] *= 1.001
    sums = StateSums.of(system, delta_p, 80e3, forces, free)
    with pytest.raises(
        UntrustedError, match=r"mesh position could not be solved at number 3: the relative residual is 9.9e-04"
    ) as error:
        proven_answers(system, 80e3, [sums], lambda k: f"number {k}")
    assert error.value.exit_code == 5
    assert error.value.fault is Fault.UNTRUSTED_STATE
    assert "--solver clarabel" in error.value.hint


def test_solvers_that_disagree_are_an_error(reference, monkeypatch):
    import hdassist.drive.solve.loadcase as module

    real = module.solve_through_cvxpy
    monkeypatch.setattr(module, "solve_through_cvxpy", lambda *a: (real(*a)[0], real(*a)[1] + 0.02 / ARCSEC))
    states = pitch_locked_states(Kinematics.of(reference), np.arange(20))
    with pytest.raises(UntrustedError, match="two solvers disagree at phi_h"):
        kinematic_error(reference, 80, states=states)


def without_answer_for(state, monkeypatch, *ways):
    """Have some ways of OneByOne give up a state."""
    for name in ways:
        way = getattr(OneByOne, name)
        monkeypatch.setattr(
            OneByOne,
            name,
            lambda self, delta_p, torque, way=way: (
                None if np.array_equal(delta_p, state) else way(self, delta_p, torque)
            ),
        )


@pytest.fixture
def four_states(system):
    return system.delta_p + np.linspace(0, 1, 4)[:, None] * (system.deviation_map[:, :4] @ [0.03, 0, 0.05, 0])


@pytest.mark.parametrize("failing", [["_near"], ["_near", "_by_daqp"]])
def test_fallbacks_are_taken_and_counted(formulation, four_states, monkeypatch, failing):
    expected = OneByOne(formulation).solve(four_states, 80e3)[1]
    without_answer_for(four_states[2], monkeypatch, *failing)
    _, free, fallbacks = OneByOne(formulation).solve(four_states, 80e3)
    assert fallbacks == 1
    assert free[:, 0] * ARCSEC == pytest.approx(expected[:, 0] * ARCSEC, abs=1e-4)


def test_states_after_an_unsolvable_one_are_not_attempted(formulation, four_states, monkeypatch):
    # what makes one state hopeless makes its neighbours so
    def refuse(*_):
        raise UntrustedError("no")

    without_answer_for(four_states[2], monkeypatch, "_near", "_by_daqp")
    monkeypatch.setattr(loadcase, "solve_through_cvxpy", refuse)
    forces, free, fallbacks = OneByOne(formulation).solve(four_states, 80e3)
    assert fallbacks == 1
    for found in (forces, free):
        assert np.isnan(found[2:]).all()
        assert not np.isnan(found[:2]).any()


@pytest.mark.thorough
@pytest.mark.parametrize("C", [1e-6, 1e-10, 1e-30])
def test_a_drive_that_cannot_be_solved_costs_one_state(reference, monkeypatch, C):
    # coefficients too far apart for double precision; 256 states at two ways of seconds each looked like a hang
    drive = changed(reference, supports__C_1=C)
    tried = []
    for name in ("_by_daqp", "_through_cvxpy"):
        way = getattr(OneByOne, name)
        monkeypatch.setattr(OneByOne, name, lambda self, *a, way=way, name=name: tried.append(name) or way(self, *a))
    with pytest.raises(UntrustedError, match="mesh position could not be solved at phi_h = 0"):
        kinematic_error(drive, 80)
    assert tried.count("_through_cvxpy") <= 2  # of the reference of the walk, and of the first state
    assert tried.count("_by_daqp") <= 2


def test_daqp_iteration_limit_is_far_above_solved_states(reference, monkeypatch):
    steps = []

    class Counting(loadcase.daqp.Model):
        def solve(self):
            x, value, flag, info = super().solve()
            assert flag == loadcase.SOLVED
            steps.append(info["iterations"] / (len(x) + 3))
            return x, value, flag, info

    monkeypatch.setattr(loadcase.daqp, "Model", Counting)
    monkeypatch.setattr(OneByOne, "_near", lambda *_: None)
    for support in (0.0, 1.0, 1e9):
        system = contact_system(changed(reference, supports__C_1=support, supports__C_3=support))
        formulation = formulate(system)
        for torque in (1.0, 80e3, 3e6):
            OneByOne(formulation).solve(np.repeat(system.delta_p[None], 2, axis=0), torque)
    assert len(steps) == 18
    assert max(steps) < loadcase.ITERATIONS / 3


@pytest.mark.parametrize("solver", ["clarabel", "osqp", "scs", "highs"])
def test_solver_stopped_at_its_limit_ends_the_run(reference, formulation, monkeypatch, solver):
    bounds = loadcase.SOLVER_SETTINGS[solver.upper()]
    iterations = {"clarabel": "max_iter", "osqp": "max_iter", "scs": "max_iters", "highs": "qp_iteration_limit"}
    assert any(name.startswith("time_limit") for name in bounds)
    monkeypatch.setitem(loadcase.SOLVER_SETTINGS, solver.upper(), bounds | {iterations[solver]: 2})
    solve, asked = loadcase.solve_through_cvxpy, []
    monkeypatch.setattr(loadcase, "solve_through_cvxpy", lambda *a: asked.append(1) or solve(*a))
    states = pitch_locked_states(Kinematics.of(reference), np.arange(40))
    with pytest.raises(
        UntrustedError, match=r"mesh position could not be solved at phi_h = 0|could not solve a mesh position"
    ):
        kinematic_error(reference, 80, states=states, run=UNCHECKED, solver=solver)
    assert len(asked) == 1


def test_too_great_a_torque_is_outside_the_model(reference):
    states = pitch_locked_states(Kinematics.of(reference), np.arange(40))
    for torque in (1e6, -1e6):
        with pytest.raises(UntrustedError, match=r"wind-up of (\d+)″ .* pitch \(1620″\)") as error:
            kinematic_error(reference, torque, states=states)
        assert error.value.fault is Fault.BEYOND_MODEL
        assert error.value.hint == "reduce the torque"
        assert int(re.search(r"wind-up of (\d+)", str(error.value))[1]) > 1620


def test_progress_counts_every_state(reference, system, formulation):
    seen, states = [], pitch_locked_states(Kinematics.of(reference), np.arange(30))
    result = kinematic_error(reference, 80, states=states, run=Run(None, seen.append, cross_check=None))
    assert sum(seen) == 30 == result.certificate.states


def test_the_sample_of_the_cross_check_is_seeded(reference):
    states = pitch_locked_states(Kinematics.of(reference), np.arange(600))
    one, same, other = (
        kinematic_error(reference, 80, states=states, run=Run(seed=seed)).cross_check for seed in (1, 1, 2)
    )
    assert one == same  # the same instructions on the same numbers
    assert 3 <= one.states <= 5
    assert len({one.states, other.states}) == 2 or one.max_difference_arcsec != other.max_difference_arcsec


def test_a_torque_that_no_contact_can_hold_has_no_answer(system):
    # flanks that only push the flexspline one way
    G = system.G.copy()
    G[:, ROTATION] = -np.abs(G[:, ROTATION])
    one_way = formulate(replace(system, G=G))
    solve_through_cvxpy(one_way, system.delta_p, 80e3, "CLARABEL")
    with pytest.raises(UntrustedError, match="CLARABEL could not solve a mesh position: infeasible") as error:
        solve_through_cvxpy(one_way, system.delta_p, -80e3, "CLARABEL")
    assert (error.value.hint, error.value.fault) == ("use another solver with --solver NAME", Fault.UNTRUSTED_STATE)


def test_teeth_far_from_the_major_axis_carry_their_load():
    """Wherever teeth overlap radially they are candidates: here 66 deg away, where W_0 is small and teeth are high."""
    drive = load_preset(SMALL, ["gears.h_a=0.95", "gears.h_f=1.7", "cam.W_0=0.45"])
    system = contact_system(drive)
    away = np.degrees(np.abs(system.flanks.theta - system.flanks.zone * np.pi))
    forces, _, _ = load_case(formulate(system), 4e3).forces(system.delta_p[None])
    assert away.max() == pytest.approx(66)
    assert forces[0, : system.n_flanks][away > 60].max() > 100  # N
    found = kinematic_error(drive, 4.0)
    assert found.F_ior_arcsec == pytest.approx(22.788205, abs=1e-5)
    assert found.certificate.max_residual < 1e-10
