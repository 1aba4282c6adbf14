"""The walk in numpy, against the same states one by one."""

import gc
import weakref

import numpy as np
import pytest

from hdassist import kinematic_error, load_preset
from hdassist.drive.error.cycle import _formulations
from hdassist.drive.model.contacts import StateGaps, contact_system
from hdassist.drive.model.deviations import ToothDeviations, state_gaps
from hdassist.drive.model.geometry import Kinematics, pitch_locked_states
from hdassist.drive.solve import loadcase, pivoting
from hdassist.drive.solve.answers import ARCSEC, N_MM, TOLERANCE, StateSums, residuals
from hdassist.drive.solve.formulation import Reference, formulate, principal_transform
from hdassist.drive.solve.loadcase import MANY_STATES, OneByOne
from hdassist.drive.solve.walk import walk_library
from hdassist.run.run import UNCHECKED
from tests.helpers.process import SMALL
from tests.helpers.support import changed, delta_p_of, load_case

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
def gaps(small, system):
    return state_gaps(small, system, pitch_locked_states(Kinematics.of(small), np.arange(200)))


def plain(formulation, torque, **options):
    """The engine that walks in numpy."""
    return load_case(formulation, torque, many=True, compiled=False, **options)


def walked(engine, gaps):
    """Forces and displacements of states by the walk of an engine alone."""
    engine.sums(gaps[:0])
    return engine._walk.forces(gaps, engine._torque)


def same(formulation, torque, gaps, sums):
    """Whether sums found are those of the states solved one by one, with their proof."""
    alone = load_case(formulation, torque)._alone(gaps)
    assert sums.residuals.worst.max() <= TOLERANCE
    assert sums.rotation * ARCSEC == pytest.approx(alone.rotation * ARCSEC, abs=EXACT)
    assert sums.tooth_force == pytest.approx(alone.tooth_force, abs=1e-6 * alone.tooth_force.max())
    return True


def cycle_one_by_one(drive, M_g, teeth=None):
    """Rotation [arcsec] and share of each zone in every state of the cycle, solved one by one."""
    states = pitch_locked_states(Kinematics.of(drive))
    rotation, share = np.empty(len(states)), np.empty((len(states), 2))
    for rows, formulation in _formulations(drive, states):
        solver = OneByOne(formulation)
        delta_p = delta_p_of(drive, formulation.system, states.take(rows), teeth)
        sums = StateSums.of(formulation.system, delta_p, M_g * N_MM, *solver.solve(delta_p, M_g * N_MM))
        assert sums.residuals.worst.max() <= TOLERANCE
        rotation[rows], share[rows] = sums.rotation * ARCSEC, sums.moment / (M_g * N_MM)
    return rotation, share


@pytest.mark.thorough
@pytest.mark.parametrize("torque", [80e3, 800e3, -300e3])
def test_the_cycle_of_the_reference_drive(reference, torque):
    system = contact_system(reference)
    some = np.sort(np.random.default_rng(3).choice(20200, 300, replace=False))
    gaps = state_gaps(reference, system, pitch_locked_states(Kinematics.of(reference), some))
    formulation = formulate(system)
    engine = plain(formulation, torque)
    found = engine.sums(gaps)
    assert found.given_up == 0
    assert same(formulation, torque, gaps, found)
    # without force is without force, to the last digit
    forces, _ = walked(engine, gaps)
    assert forces == pytest.approx(
        OneByOne(formulation).solve(system.delta_p_of(gaps), torque)[0], abs=1e-6 * forces.max()
    )
    assert forces.min() == 0
    assert 0.3 < np.mean(forces == 0) < 0.9
    assert not np.any((forces > 0) & (forces < 1e-9 * forces.max()))


@pytest.mark.thorough
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
    # next to no torque rests on a single flank, which cannot leave before another one has come: the walk in numpy gives
    # up more such states than the compiled one
    share = 0.02 if walk_library()[0] else 0.05
    assert found.certificate.fallbacks <= (share * len(found.states) if M_g == 0.05 else 0)
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
    formulation = formulate(contact_system(changed(small, gears__j_n=0.0)))
    scalars = np.zeros((2 * MANY_STATES, 4))
    scalars[::3] = [0, 0, 1e-13, 1e-12]  # and next to them states that break the symmetry by next to nothing
    gaps = StateGaps(scalars)
    assert same(formulation, torque, gaps, plain(formulation, torque).sums(gaps))


def test_answers_hang_neither_on_the_order_nor_on_the_batches(formulation, gaps):
    whole, free = walked(plain(formulation, 4e3), gaps)
    order = np.random.default_rng(0).permutation(len(gaps))
    mixed, freed = walked(plain(formulation, 4e3), gaps[order])
    assert mixed == pytest.approx(whole[order], abs=1e-8 * whole.max())
    assert freed[:, 0] * ARCSEC == pytest.approx(free[order, 0] * ARCSEC, abs=EXACT)
    engine = plain(formulation, 4e3)
    for first, last in ((0, 100), (100, 101), (101, 101), (101, 170), (170, 200)):
        forces, _ = walked(engine, gaps[first:last])
        assert forces == pytest.approx(whole[first:last], abs=1e-8 * whole.max())


def test_the_same_states_give_the_same_digits(formulation, gaps):
    # the same instructions on the same numbers
    (one, free), (other, freed) = (walked(plain(formulation, 4e3), gaps) for _ in range(2))
    assert np.array_equal(one, other)
    assert np.array_equal(free, freed)


def test_few_states_need_no_reference_unless_more_will_follow(formulation, gaps):
    for many in (False, True):
        engine = load_case(formulation, 4e3, many=many)
        engine.sums(gaps[: MANY_STATES - 1])
        assert (engine._walk is not None) is many
    alone = load_case(formulation, 4e3)
    alone.sums(gaps[:MANY_STATES])
    assert alone._walk is not None


@pytest.mark.parametrize("compiled", [False, True])
def test_engine_based_on_another_gives_the_same_results(formulation, gaps, compiled):
    fresh = load_case(formulation, 4e3, compiled=compiled)
    alone = load_case(formulation, 4e3, compiled=compiled).sums(gaps)
    load_case(formulation, 4e3, like=fresh, compiled=compiled).sums(gaps[50:])
    like = load_case(formulation, 4e3, like=fresh, compiled=compiled).sums(gaps)
    assert like.rotation * ARCSEC == pytest.approx(alone.rotation * ARCSEC, abs=EXACT)


def test_another_torque_later(formulation, gaps):
    engine = plain(formulation, 4e3)
    engine.sums(gaps)
    for torque in (40e3, -1e3, 1e-3):
        engine.load(torque / 1e3)
        assert same(formulation, torque, gaps, engine.sums(gaps))


@pytest.mark.parametrize(("name", "value"), [("LIMIT", 0), ("SMALLEST", 0.9)])
def test_states_given_up_are_counted_and_solved_one_by_one(formulation, gaps, monkeypatch, name, value):
    # too many pivots, a pivot that would spoil the tableau
    monkeypatch.setattr(pivoting, name, value)
    found = plain(formulation, 4e3).sums(gaps)
    assert 0 < found.given_up <= len(gaps)
    assert same(formulation, 4e3, gaps, found)


def test_a_walk_that_rounding_spoiled_is_given_up(formulation, gaps, monkeypatch):
    pivoted = pivoting.Pivoting._pivoted
    monkeypatch.setattr(pivoting.Pivoting, "_pivoted", lambda self, start: pivoted(self, start) * (1 + 1e-3))
    found = plain(formulation, 4e3).sums(gaps)
    assert found.given_up > 0
    assert same(formulation, 4e3, gaps, found)


def test_a_state_that_is_no_number_spoils_no_other(formulation, gaps):
    expected = plain(formulation, 4e3).sums(gaps)
    scalars = gaps.scalars.copy()
    scalars[5, 3] = np.nan
    found = plain(formulation, 4e3).sums(StateGaps(scalars))
    assert found.given_up == 1
    assert found.residuals.worst[5] == np.inf
    others = np.arange(len(gaps)) != 5
    assert found.rotation[others] == pytest.approx(expected.rotation[others], abs=EXACT / ARCSEC)


def test_a_contact_set_that_holds_nothing_is_no_reference(formulation, gaps, monkeypatch):
    none, one = np.zeros(len(formulation.P), dtype=bool), np.arange(len(formulation.P)) == 3
    for contact in (none, one):
        with pytest.raises(ValueError, match=r"Singular|hold the parts"):
            Reference(formulation, contact)

    def refuse(*_):
        raise ValueError

    monkeypatch.setattr(loadcase, "Reference", refuse)
    found = plain(formulation, 4e3).sums(gaps)
    assert found.given_up == 0
    assert same(formulation, 4e3, gaps, found)


@pytest.mark.parametrize("stations", [1, 3])
def test_a_reference_solves_the_programme_at_its_contact_set(small, stations):
    formulation = formulate(contact_system(changed(small, numerics__stations=stations)))
    nothing = StateGaps(np.zeros((1, 0)))
    forces, free, _ = OneByOne(formulation).solve(formulation.system.delta_p[None], 4e3)
    walk = pivoting.Pivoting(formulation, Reference(formulation, forces[0] > 1e-9 * forces.max()))
    solved, freed = walk.forces(nothing, 4e3)
    assert len(walk._swing) == 0  # no pivot
    assert solved == pytest.approx(forces, abs=1e-8 * forces.max())
    assert freed == pytest.approx(free, abs=1e-12)
    assert residuals(formulation.system, formulation.system.delta_p[None], 4e3, solved, freed).worst[0] < 1e-11


def test_transformed_twice_what_is_mapped_trades_places_and_comes_back():
    rng = np.random.default_rng(0)
    root, inside = rng.normal(size=(9, 9)), rng.random(9) < 0.5
    matrix = root @ root.T
    # values and others trade places
    others = rng.normal(size=9)
    values = matrix @ others
    there = principal_transform(matrix, inside)
    assert there @ np.where(inside, values, others) == pytest.approx(np.where(inside, others, values))
    assert principal_transform(there[np.ix_(inside, inside)], np.ones(inside.sum(), dtype=bool)) == pytest.approx(
        matrix[np.ix_(inside, inside)]
    )


def test_parts_that_are_one_and_the_same_have_no_inverse():
    # two springs side by side in the same place: which of them carries is not determined, so there is no pivot
    one, both = np.ones((2, 2)), np.ones(2, dtype=bool)
    with pytest.raises(ValueError, match=r"Singular|hold the parts"):
        principal_transform(one, both)
    assert principal_transform(one + np.eye(2), both) == pytest.approx(np.linalg.inv(one + np.eye(2)))


@pytest.mark.parametrize("compiled", [False, True])
def test_the_matrices_of_a_system_go_with_its_last_user(small, gaps, compiled):
    gc.disable()  # which collects circles long after: of many drives, hundreds of MB
    try:
        case = load_case(formulate(contact_system(small)), 40.0, many=True, compiled=compiled)
        case.sums(gaps[:5])
        kept = weakref.ref(case.formulation)
        del case
        assert kept() is None
    finally:
        gc.enable()
