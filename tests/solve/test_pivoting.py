"""Many states by principal pivots, against the same states one by one."""

import numpy as np
import pytest

from hdassist import kinematic_error, load_preset
from hdassist.error.cycle import _formulations
from hdassist.model.contacts import contact_system
from hdassist.model.deviations import ToothDeviations
from hdassist.model.kinematics import Kinematics, pitch_locked_states
from hdassist.run.run import UNCHECKED
from hdassist.solve import pivoting
from hdassist.solve.activeset import ActiveSet
from hdassist.solve.answers import ARCSEC, N_MM
from hdassist.solve.certificate import TOLERANCE, residuals
from hdassist.solve.engine import MANY, Engine
from hdassist.solve.formulation import formulate
from hdassist.solve.pivoting import Reference, exchanged
from hdassist.solve.sums import StateSums
from tests.process import SMALL
from tests.support import changed, delta_p_of

EXACT = 1e-7  # arcsec


@pytest.fixture(scope="module")
def small():
    return load_preset(SMALL)


@pytest.fixture(scope="module")
def system(small):
    return contact_system(small)


@pytest.fixture(scope="module")
def formulation(system):
    return formulate(system)


@pytest.fixture(scope="module")
def delta_p(small, system):
    return delta_p_of(small, system, pitch_locked_states(Kinematics.of(small), np.arange(200)))


def one_by_one(formulation, torque, delta_p):
    return ActiveSet(formulation, torque).solve(delta_p)


def same(formulation, torque, delta_p, found):
    """Whether forces and displacements found are those of the states solved one by one, with their proof."""
    (forces, free, _), (others, freed, _) = found, one_by_one(formulation, torque, delta_p)
    system = formulation.system
    assert residuals(system, delta_p, torque, forces, free).worst.max() <= TOLERANCE
    k = system.free_rotation
    assert free[:, k] * ARCSEC == pytest.approx(freed[:, k] * ARCSEC, abs=EXACT)
    assert forces == pytest.approx(others, abs=1e-6 * others.max())
    return True


def cycle_one_by_one(drive, M_g, teeth=None):
    """Rotation [arcsec] and share of each zone in every state of the cycle, solved one by one."""
    states = pitch_locked_states(Kinematics.of(drive))
    rotation, share = np.empty(len(states)), np.empty((len(states), 2))
    for rows, formulation in _formulations(drive, states):
        solver = ActiveSet(formulation, M_g * N_MM)
        delta_p = delta_p_of(drive, formulation.system, states.take(rows), teeth)
        sums = StateSums.of(formulation.system, delta_p, M_g * N_MM, *solver.solve(delta_p))
        assert sums.residuals.worst.max() <= TOLERANCE
        rotation[rows], share[rows] = sums.rotation * ARCSEC, sums.moment / (M_g * N_MM)
    return rotation, share


@pytest.mark.parametrize("torque", [80e3, 800e3, -300e3])
def test_the_cycle_of_the_reference_drive(reference, torque):
    system = contact_system(reference)
    some = np.sort(np.random.default_rng(3).choice(20200, 300, replace=False))
    delta_p = delta_p_of(reference, system, pitch_locked_states(Kinematics.of(reference), some))
    formulation = formulate(system)
    found = Engine(formulation, torque).forces(delta_p)
    assert found[2] == 0
    assert same(formulation, torque, delta_p, found)
    # without force is without force, to the last digit
    assert found[0].min() == 0
    assert 0.3 < np.mean(found[0] == 0) < 0.9
    assert not np.any((found[0] > 0) & (found[0] < 1e-9 * found[0].max()))


@pytest.mark.parametrize(
    "sets",
    [
        [],
        ["gears.z_g=61", "gears.z_b=63"],
        ["mounting.fixed=flexspline", "tolerances.e_hg=30", "tolerances.e_hb=0"],
        ["bearing.ball_motion=rolling", "bearing.d_ball=3", "numerics.n_beta=4"],
        ["bearing.g_b=8", "gears.j_n=15"],
    ],
)
@pytest.mark.parametrize("M_g", [4.0, 0.05, -1.0])
def test_cycles_of_small_drives(sets, M_g):
    drive = load_preset(SMALL, sets)
    found = kinematic_error(drive, M_g, run=UNCHECKED)
    rotation_arcsec, zone_share = cycle_one_by_one(drive, M_g)
    # next to no torque rests on a single flank, which cannot leave before another one has come
    assert found.certificate.fallbacks <= (0.02 * len(found.states) if M_g == 0.05 else 0)
    assert found.rotation_arcsec == pytest.approx(rotation_arcsec, abs=EXACT)
    assert found.zone_share == pytest.approx(zone_share, abs=1e-7)


def test_measured_teeth(small):
    rng = np.random.default_rng(5)
    z_g, z_b = small.gears.z_g, small.gears.z_b
    teeth = ToothDeviations(g=rng.normal(0, 5, z_g), b=rng.normal(0, 5, z_b))
    found = kinematic_error(small, 2.0, teeth=teeth, run=UNCHECKED)
    assert found.certificate.fallbacks == 0
    assert found.rotation_arcsec == pytest.approx(cycle_one_by_one(small, 2.0, teeth)[0], abs=EXACT)


@pytest.mark.parametrize("torque", [1e-3, 1.0, 1e3, -1e3, 4e3])
def test_symmetric_states_in_which_contacts_just_touch(small, torque):
    system = contact_system(changed(small, gears__j_n=0.0))
    delta_p = np.repeat(system.delta_p[None], 2 * MANY, axis=0)
    # and next to them states that break the symmetry by next to nothing
    delta_p[::3] += system.deviation_map[:, :4] @ [0, 0, 1e-13, 1e-12]
    formulation = formulate(system)
    assert same(formulation, torque, delta_p, Engine(formulation, torque).forces(delta_p))


def test_answers_hang_neither_on_the_order_nor_on_the_batches(formulation, delta_p):
    whole, free, _ = Engine(formulation, 4e3).forces(delta_p)
    order = np.random.default_rng(0).permutation(len(delta_p))
    mixed, freed, _ = Engine(formulation, 4e3).forces(delta_p[order])
    assert mixed == pytest.approx(whole[order], abs=1e-8 * whole.max())
    assert freed[:, 0] * ARCSEC == pytest.approx(free[order, 0] * ARCSEC, abs=EXACT)
    solver = Engine(formulation, 4e3)
    for first, last in ((0, 100), (100, 101), (101, 101), (101, 170), (170, 200)):
        forces, _, _ = solver.forces(delta_p[first:last])
        assert forces == pytest.approx(whole[first:last], abs=1e-8 * whole.max())


def test_the_same_states_give_the_same_digits(formulation, delta_p):
    (one, free, _), (other, freed, _) = (Engine(formulation, 4e3).forces(delta_p) for _ in range(2))
    assert np.array_equal(one, other)
    assert np.array_equal(free, freed)


def test_few_states_are_not_worth_a_reference_unless_more_will_come(formulation, delta_p):
    for many in (False, True):
        engine = Engine(formulation, 4e3, many=many)
        engine.forces(delta_p[: MANY - 1])
        assert (engine._pivoting is not None) is many
    alone = Engine(formulation, 4e3)
    alone.forces(delta_p[:MANY])
    assert alone._pivoting is not None


def test_an_engine_like_another_gives_the_digits_it_would_give_alone(formulation, delta_p):
    fresh = Engine(formulation, 4e3)
    alone = Engine(formulation, 4e3).forces(delta_p)
    Engine(formulation, 4e3, like=fresh).forces(delta_p[50:])
    like = Engine(formulation, 4e3, like=fresh).forces(delta_p)
    assert np.array_equal(like[0], alone[0])


def test_another_torque_later(formulation, delta_p):
    solver = Engine(formulation, 4e3)
    solver.forces(delta_p)
    for torque in (40e3, -1e3, 1e-3):
        solver.load(torque)
        assert same(formulation, torque, delta_p, solver.forces(delta_p))


@pytest.mark.parametrize("name", ["PIVOTS", "GREEDY"])
def test_tableaux_made_anew_and_least_indices_lead_to_the_same(formulation, delta_p, monkeypatch, name):
    monkeypatch.setattr(pivoting, name, 0)
    found = Engine(formulation, 4e3).forces(delta_p)
    assert found[2] == 0
    assert same(formulation, 4e3, delta_p, found)


@pytest.mark.parametrize(
    ("name", "value", "all_of_them"),
    [("LIMIT", 0, False), ("SMALLEST", 0.9, False), ("INACCURATE", -1.0, True)],
)
def test_states_given_up_are_counted_and_solved_one_by_one(formulation, delta_p, monkeypatch, name, value, all_of_them):
    # too many pivots, a pivot that would spoil the tableau, rounding
    monkeypatch.setattr(pivoting, name, value)
    found = Engine(formulation, 4e3).forces(delta_p)
    assert found[2] == len(delta_p) if all_of_them else 0 < found[2] <= len(delta_p)
    assert same(formulation, 4e3, delta_p, found)


def test_a_walk_that_rounding_spoiled_is_given_up(formulation, delta_p, monkeypatch):
    walk = pivoting.Pivoting._walk

    def spoiled(self, start):
        solved, changed = walk(self, start)
        return solved * (1 + 1e-3 * changed), changed

    monkeypatch.setattr(pivoting.Pivoting, "_walk", spoiled)
    found = Engine(formulation, 4e3).forces(delta_p)
    assert found[2] > 0
    assert same(formulation, 4e3, delta_p, found)


def test_pivots_that_find_no_end_are_not_tried_for_ever(formulation, delta_p, monkeypatch):
    monkeypatch.setattr(pivoting, "LIMIT", 0)
    reach, tried = pivoting.Pivoting._reach, []
    monkeypatch.setattr(pivoting.Pivoting, "_reach", lambda self, *a: tried.append(1) or reach(self, *a))
    found = Engine(formulation, 4e3).forces(delta_p)
    assert len(tried) == pivoting.LOST < found[2]
    assert same(formulation, 4e3, delta_p, found)


def test_a_state_that_is_no_number_spoils_no_other(formulation, delta_p):
    expected, _, _ = Engine(formulation, 4e3).forces(delta_p)
    spoiled = delta_p.copy()
    spoiled[5, 3] = np.nan
    forces, free, fallbacks = Engine(formulation, 4e3).forces(spoiled)
    assert fallbacks == 1
    assert residuals(formulation.system, spoiled, 4e3, forces, free).worst[5] == np.inf
    others = np.arange(len(delta_p)) != 5
    assert forces[others] == pytest.approx(expected[others], abs=1e-8 * expected.max())


def test_a_contact_set_that_holds_nothing_is_no_reference(formulation, delta_p, monkeypatch):
    P, A = formulation.P, formulation.A
    none, one = np.zeros(len(P), dtype=bool), np.arange(len(P)) == 3
    assert Reference.at(P, A, none) is None
    assert Reference.at(P, A, one) is None
    monkeypatch.setattr(Reference, "at", lambda P, A, contact: None)
    found = Engine(formulation, 4e3).forces(delta_p)
    assert found[2] == 0
    assert same(formulation, 4e3, delta_p, found)


def test_a_reference_solves_the_programme_at_its_contact_set(formulation, delta_p):
    forces, free, _ = one_by_one(formulation, 4e3, delta_p[:1])
    contact = forces[0] > 1e-9 * forces.max()
    gaps, right = formulation.gaps(delta_p[:1]), formulation.right_side(4e3)
    values = Reference.at(formulation.P, formulation.A, contact).values(gaps, right)[0]
    M = len(contact)
    solved, dual = formulation.answer(values[:M] * contact, values[M:])
    assert solved == pytest.approx(forces[0], abs=1e-8 * forces.max())
    assert dual == pytest.approx(free[0], abs=1e-12)
    gap = formulation.P @ (values[:M] * contact) + gaps[0] + formulation.A.T @ values[M:]
    assert gap == pytest.approx(values[:M] * ~contact, abs=1e-8)


def test_exchanged_twice_is_what_it_was():
    rng = np.random.default_rng(0)
    root, change = rng.normal(size=(9, 9)), rng.random(9) < 0.5
    matrix = root @ root.T
    assert exchanged(exchanged(matrix, change), change) == pytest.approx(matrix)
    # values and others trade places
    others = rng.normal(size=9)
    values = matrix @ others
    assert exchanged(matrix, change) @ np.where(change, values, others) == pytest.approx(
        np.where(change, others, values)
    )


def test_candidates_that_are_one_and_the_same_are_no_reference():
    # two springs side by side in the same place: which of them carries is not determined, so there is no pivot
    one = np.ones((2, 2))
    assert Reference.at(one, one[:1], np.array([True, False])) is None
    assert Reference.at(one + np.eye(2), one[:1], np.array([True, True])) is not None
